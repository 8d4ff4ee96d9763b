supple_together(
  "src/file/fields/fields_reference.cpp src/model/inspect.cpp src/output/run/result_file.cpp
   src/output/run/run_origin.cpp src/sweep/measures.cpp src/sweep/sweep_plan.cpp src/file/expand/scale_object.cpp
   src/file/expand/shipped_includes.cpp src/file/expand/short_keys.cpp"
  "src/output/view/view.cpp src/sweep/job.cpp src/file/expand/course.cpp src/file/fields/fields_info.cpp
   src/file/fields/fields_members.cpp src/file/limits/count_scene.cpp src/file/limits/work_limit.cpp
   src/file/scene_places.cpp src/file/yaml/yaml_faults.cpp src/model/accuracy.cpp src/model/crowded_start.cpp
   src/model/divide.cpp src/model/led_pins.cpp src/output/files/animation_parts.cpp"
  "src/output/view/view_frame.cpp src/sweep/sweep_points.cpp src/sweep/sweep_values.cpp
   src/file/expand/expand_scene.cpp src/file/fields/fields.cpp src/file/limits/check.cpp src/file/named_files.cpp
   src/output/files/gltf.cpp src/output/run/output_limits.cpp src/simulation/friction_watch.cpp"
  "src/simulation/query.cpp src/model/material.cpp src/model/model_laws.cpp src/model/solid_motion.cpp"
  "src/file/expand/expression.cpp src/file/fields/scene_keys.cpp src/file/limits/limits.cpp src/model/arrangement.cpp
   src/model/model_volume.cpp src/model/point_tree.cpp src/model/time_steps.cpp src/output/files/output_files.cpp"
  "src/file/read_scene.cpp src/file/read_scene_archive.cpp src/file/read_scene_faults.cpp src/file/yaml/yaml_tree.cpp
   src/output/files/saved_frames.cpp src/output/files/scene_grids.cpp"
  "src/file/yaml/yaml_quantity.cpp src/model/model.cpp src/output/files/folder_lock.cpp
   src/output/files/frame_tables.cpp src/output/pictures/draw_picture.cpp"
  "src/model/model_contact.cpp src/model/model_skeleton.cpp src/output/files/frame_writer.cpp
   src/output/pictures/smooth_normals.cpp"
  "src/model/warnings.cpp src/output/forecast/estimate.cpp src/output/forecast/preview.cpp
   src/output/meshes/frame_meshes.cpp src/simulation/contact_report.cpp"
  "src/output/meshes/look_columns.cpp src/output/meshes/search_files.cpp src/output/pictures/camera.cpp
   src/output/pictures/drawing_crew.cpp src/output/pictures/even_surface.cpp src/output/pictures/frame_looks.cpp
   src/output/pictures/picture.cpp src/output/run/stage_errors.cpp"
  "src/output/run/run.cpp src/output/run/unreached.cpp src/output/view/view_arrays.cpp src/simulation/bodies.cpp"
  "src/output/run/spare_memory.cpp src/simulation/fixed_step.cpp src/simulation/held_volumes.cpp
   src/simulation/simulation_changes.cpp src/simulation/simulation_checks.cpp src/simulation/simulation_results.cpp
   src/simulation/stages.cpp"
  "src/simulation/audits.cpp src/simulation/contact_work.cpp src/simulation/frame.cpp src/simulation/overload.cpp
   src/simulation/scene_samples.cpp src/simulation/simulation_bodies.cpp src/simulation/surface_motion.cpp
   src/sweep/frame_columns.cpp"
  "src/simulation/pair_contacts.cpp src/simulation/pieces.cpp src/simulation/probe.cpp src/simulation/reach.cpp
   src/simulation/rest.cpp src/sweep/job_scripts.cpp"
  "src/simulation/simulation.cpp src/simulation/state.cpp"
  "cli/benchmarks.cpp cli/describe.cpp cli/fit.cpp cli/installed_program.cpp cli/job.cpp cli/last_resort.cpp
   cli/library.cpp cli/print.cpp cli/program.cpp cli/templates.cpp cli/view.cpp"
  "cli/progress_bar.cpp cli/sweep.cpp cli/view_server.cpp")
