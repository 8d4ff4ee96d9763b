supple_together(
  "base/content_versions_test.cpp base/nearest_word_test.cpp benchmark_usage_test.cpp experiments_test.cpp
   figure4_test.cpp integrate/block_cholesky_test.cpp integrate/implicit_contact_test.cpp integrate/rotation_test.cpp
   io/particle_files_test.cpp"
  "integrate/integrate_test.cpp io/read_mesh_test.cpp laws/cohesion_test.cpp laws/cohesion_variants_test.cpp
   laws/lennard_jones_test.cpp"
  "integrate/integrators_test.cpp laws/damping_test.cpp neighbours/neighbours_test.cpp neighbours/pack_lanes_test.cpp"
  "laws/directed_form_law_test.cpp laws/gay_berne_test.cpp laws/literal_form_law_test.cpp laws/pair_laws_test.cpp
   neighbours/pair_lists_test.cpp particles/audits_test.cpp"
  "laws/interactions_test.cpp laws/pair_hessian_test.cpp particles/arrange_test.cpp particles/generators_test.cpp")
