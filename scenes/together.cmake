supple_together(
  "src/model/arrangement.cpp src/simulation/audits.cpp src/simulation/bodies.cpp src/file/check.cpp src/file/count_scene.cpp src/output/draw_picture.cpp
   src/file/fields.cpp src/file/fields_members.cpp src/file/fields_reference.cpp src/output/folder_lock.cpp src/simulation/held_volumes.cpp"
  "src/output/camera.cpp src/simulation/contact_report.cpp src/simulation/contact_work.cpp src/model/divide.cpp src/output/drawing_crew.cpp src/file/fields_info.cpp
   src/simulation/frame.cpp"
  "src/simulation/fixed_step.cpp src/output/frame_looks.cpp src/output/frame_meshes.cpp src/file/limits.cpp src/output/output_limits.cpp
   src/file/scene_places.cpp"
  "src/output/frame_tables.cpp src/output/frame_writer.cpp src/output/look_columns.cpp src/model/model.cpp src/model/model_volume.cpp
   src/model/point_tree.cpp"
  "src/model/inspect.cpp src/model/model_contact.cpp src/model/model_skeleton.cpp"
  "src/model/model_laws.cpp src/output/output_files.cpp src/simulation/overload.cpp src/output/picture.cpp"
  "src/simulation/pieces.cpp src/simulation/probe.cpp src/file/read_scene.cpp src/file/read_scene_faults.cpp src/simulation/rest.cpp src/output/saved_frames.cpp
   src/simulation/simulation.cpp"
  "src/simulation/query.cpp src/model/time_steps.cpp"
  "src/file/read_scene_archive.cpp src/output/scene_grids.cpp src/simulation/simulation_bodies.cpp src/simulation/simulation_changes.cpp
   src/simulation/simulation_checks.cpp"
  "src/output/run.cpp src/file/scene_keys.cpp src/simulation/scene_samples.cpp src/simulation/simulation_results.cpp"
  "src/output/search_files.cpp src/model/solid_motion.cpp src/simulation/surface_motion.cpp src/model/warnings.cpp src/file/yaml_quantity.cpp"
  "src/simulation/state.cpp src/file/yaml_tree.cpp")
