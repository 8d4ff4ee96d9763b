supple_together(
  "src/file/check.cpp src/file/count_scene.cpp src/file/course.cpp src/file/expand_scene.cpp src/file/expression.cpp
   src/file/fields.cpp src/file/fields_members.cpp src/file/named_files.cpp src/file/scene_places.cpp"
  "src/file/fields_info.cpp src/file/read_scene.cpp src/file/read_scene_faults.cpp src/file/scale_object.cpp
   src/file/shipped_includes.cpp src/file/work_limit.cpp src/file/yaml_quantity.cpp src/model/accuracy.cpp
   src/model/arrangement.cpp src/model/crowded_start.cpp"
  "src/file/fields_reference.cpp src/file/limits.cpp src/file/read_scene_archive.cpp src/file/yaml_tree.cpp
   src/model/divide.cpp src/model/led_pins.cpp src/simulation/friction_watch.cpp"
  "src/file/scene_keys.cpp src/file/short_keys.cpp src/model/inspect.cpp src/model/model_laws.cpp src/model/model_volume.cpp"
  "src/model/material.cpp src/model/model_contact.cpp src/output/files/animation_parts.cpp"
  "src/model/model.cpp src/model/point_tree.cpp src/model/time_steps.cpp src/output/files/folder_lock.cpp
   src/output/files/frame_tables.cpp src/output/files/gltf.cpp"
  "src/model/model_skeleton.cpp src/model/solid_motion.cpp src/model/warnings.cpp src/output/files/frame_writer.cpp
   src/output/run/output_limits.cpp"
  "src/output/files/output_files.cpp src/output/files/saved_frames.cpp src/output/files/scene_grids.cpp
   src/output/forecast/estimate.cpp src/output/forecast/preview.cpp src/output/meshes/look_columns.cpp
   src/output/meshes/search_files.cpp src/output/pictures/camera.cpp src/output/pictures/draw_picture.cpp
   src/output/pictures/drawing_crew.cpp"
  "src/output/meshes/frame_meshes.cpp src/output/pictures/frame_looks.cpp src/output/run/result_file.cpp
   src/output/run/run_origin.cpp src/output/run/stage_errors.cpp"
  "src/output/pictures/picture.cpp src/output/run/spare_memory.cpp src/output/view/view.cpp
   src/output/view/view_arrays.cpp src/simulation/bodies.cpp"
  "src/output/run/run.cpp src/output/view/view_frame.cpp src/simulation/contact_report.cpp
   src/simulation/contact_work.cpp src/simulation/held_volumes.cpp src/simulation/pieces.cpp"
  "src/simulation/audits.cpp src/simulation/frame.cpp src/simulation/pair_contacts.cpp src/simulation/query.cpp
   src/simulation/rest.cpp src/simulation/scene_samples.cpp"
  "src/simulation/fixed_step.cpp src/simulation/overload.cpp src/simulation/simulation.cpp
   src/simulation/simulation_results.cpp"
  "src/simulation/probe.cpp src/simulation/simulation_bodies.cpp src/simulation/simulation_checks.cpp
   src/simulation/stages.cpp src/simulation/surface_motion.cpp src/sweep/frame_columns.cpp"
  "src/simulation/simulation_changes.cpp src/sweep/job.cpp src/sweep/job_scripts.cpp"
  "src/simulation/state.cpp src/sweep/measures.cpp src/sweep/sweep_points.cpp src/sweep/sweep_values.cpp")
