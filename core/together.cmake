supple_together(
  "src/arrange.cpp src/audits.cpp src/bond_runs.cpp src/cohesion.cpp src/cohesion_table.cpp src/cohesion_variants.cpp
   src/content_versions.cpp src/directed_form.cpp src/error.cpp src/executor.cpp src/integrators.cpp
   src/particles.cpp"
  "src/damping.cpp src/gay_berne.cpp src/hash.cpp src/integrate.cpp src/interaction_reports.cpp"
  "src/gay_berne_hessian.cpp src/interactions.cpp src/io/atomic_file.cpp src/io/vtk_files.cpp src/lennard_jones.cpp
   src/literal_form.cpp src/parts.cpp"
  "src/implicit_step.cpp src/math.cpp src/mesh.cpp src/neighbours.cpp src/step_hessian.cpp"
  "src/io/mesh_files.cpp src/links.cpp src/neighbour_list.cpp src/rotation.cpp"
  "src/io/read_mesh.cpp src/pair_laws.cpp src/runge_kutta.cpp src/stiffness_damping.cpp")
