supple_together(
  "file/expand_scene_test.cpp file/limits_test.cpp file/named_files_test.cpp file/one_fault_test.cpp
   file/reference_test.cpp file/scene_keys_test.cpp model/accuracy_test.cpp model/generators_test.cpp
   model/plan_test.cpp simulation/contact_gas_test.cpp"
  "file/messages_test.cpp model/fixed_step_test.cpp model/material_test.cpp output/drawing_crew_test.cpp
   output/frame_looks_test.cpp output/grid_files_test.cpp output/smooth_normals_test.cpp output/stage_times_test.cpp
   simulation/contact_stress_test.cpp"
  "file/options_test.cpp file/read_scene_test.cpp sweep/sweep_values_test.cpp"
  "model/led_obstacles_test.cpp model/model_test.cpp output/folder_lock_test.cpp output/preview_test.cpp
   output/variation_test.cpp"
  "model/obstacles_test.cpp output/saved_states_test.cpp simulation/events_test.cpp simulation/figures_test.cpp"
  "output/delaunay_test.cpp output/looks_test.cpp sweep/job_test.cpp sweep/measures_test.cpp sweep/sweep_test.cpp"
  "output/kept_meshes_test.cpp output/run_test.cpp simulation/pair_contacts_test.cpp simulation/query_test.cpp"
  "output/object_meshing_test.cpp simulation/surface_motion_test.cpp"
  "simulation/contact_experiments_test.cpp simulation/overload_test.cpp"
  "simulation/pieces_test.cpp simulation/simulation_test.cpp")
