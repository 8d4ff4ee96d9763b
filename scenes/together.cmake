supple_together(
  "src/audits.cpp src/bodies.cpp src/draw_picture.cpp src/fields.cpp src/fields_info.cpp src/frame_writer.cpp
   src/output_limits.cpp src/scene_places.cpp"
  "src/camera.cpp src/contact_report.cpp src/contact_work.cpp src/divide.cpp src/drawing_crew.cpp
   src/fields_reference.cpp src/frame_tables.cpp src/held_volumes.cpp src/look_columns.cpp src/model_volume.cpp"
  "src/fixed_step.cpp src/frame.cpp src/pieces.cpp src/search_files.cpp"
  "src/frame_meshes.cpp src/inspect.cpp src/overload.cpp src/solid_motion.cpp"
  "src/model.cpp src/scene_samples.cpp"
  "src/model_laws.cpp src/model_skeleton.cpp src/output_files.cpp src/read_scene.cpp"
  "src/picture.cpp src/probe.cpp src/read_scene_faults.cpp src/rest.cpp src/scene_grids.cpp
   src/simulation_changes.cpp"
  "src/query.cpp src/time_steps.cpp"
  "src/read_scene_archive.cpp src/simulation.cpp src/simulation_bodies.cpp src/simulation_checks.cpp
   src/simulation_results.cpp"
  "src/run.cpp src/state.cpp src/surface_motion.cpp src/yaml_quantity.cpp"
  "src/warnings.cpp src/yaml_tree.cpp")
