supple_together(
  "src/arrange.cpp src/audits.cpp src/bond_runs.cpp src/cohesion.cpp src/cohesion_table.cpp src/cohesion_variants.cpp
   src/content_versions.cpp src/directed_form.cpp src/error.cpp src/executor.cpp src/integrators.cpp"
  "src/contact_term.cpp src/gay_berne.cpp src/gay_berne_hessian.cpp src/hash.cpp src/integrate.cpp
   src/nearest_word.cpp"
  "src/damping.cpp src/interaction_reports.cpp src/links.cpp src/math.cpp src/neighbours.cpp"
  "src/implicit_step.cpp src/interactions.cpp src/lennard_jones.cpp src/literal_form.cpp src/mesh.cpp"
  "src/neighbour_list.cpp src/pair_laws.cpp src/particles.cpp src/parts.cpp src/rotation.cpp src/step_hessian.cpp
   src/stiffness_damping.cpp"
  "src/pair_hessian.cpp src/io/vtk_files.cpp"
  "src/runge_kutta.cpp src/io/atomic_file.cpp src/io/descriptor.cpp src/io/open_temporaries.cpp")
