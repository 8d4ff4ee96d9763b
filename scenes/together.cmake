supple_together(
  "src/arrangement.cpp src/audits.cpp src/bodies.cpp src/check.cpp src/count_scene.cpp src/draw_picture.cpp
   src/fields.cpp src/fields_members.cpp src/fields_reference.cpp src/folder_lock.cpp src/held_volumes.cpp"
  "src/camera.cpp src/contact_report.cpp src/contact_work.cpp src/divide.cpp src/drawing_crew.cpp src/fields_info.cpp
   src/frame.cpp"
  "src/fixed_step.cpp src/frame_looks.cpp src/frame_meshes.cpp src/limits.cpp src/output_limits.cpp
   src/scene_places.cpp"
  "src/frame_tables.cpp src/frame_writer.cpp src/look_columns.cpp src/model.cpp src/model_volume.cpp
   src/point_tree.cpp"
  "src/inspect.cpp src/model_contact.cpp src/model_skeleton.cpp"
  "src/model_laws.cpp src/output_files.cpp src/overload.cpp src/picture.cpp"
  "src/pieces.cpp src/probe.cpp src/read_scene.cpp src/read_scene_faults.cpp src/rest.cpp src/saved_frames.cpp
   src/simulation.cpp"
  "src/query.cpp src/time_steps.cpp"
  "src/read_scene_archive.cpp src/scene_grids.cpp src/simulation_bodies.cpp src/simulation_changes.cpp
   src/simulation_checks.cpp"
  "src/run.cpp src/scene_keys.cpp src/scene_samples.cpp src/simulation_results.cpp"
  "src/search_files.cpp src/solid_motion.cpp src/surface_motion.cpp src/warnings.cpp src/yaml_quantity.cpp"
  "src/state.cpp src/yaml_tree.cpp")
