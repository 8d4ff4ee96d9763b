supple_together(
  "src/io/gltf_file.cpp src/base/content_versions.cpp src/base/counted.cpp src/base/error.cpp src/base/executor.cpp
   src/base/math.cpp src/base/mesh.cpp src/base/nearest_word.cpp src/integrate/block_cholesky.cpp
   src/integrate/damping_term.cpp src/integrate/integrators.cpp src/integrate/rotation.cpp src/io/open_temporaries.cpp
   src/io/scratch.cpp"
  "src/base/hash.cpp src/base/interrupt.cpp src/integrate/contact_term.cpp src/integrate/integrate.cpp
   src/integrate/step_hessian.cpp src/io/child_process.cpp src/laws/directed_form.cpp"
  "src/integrate/implicit_step.cpp src/io/atomic_file.cpp src/io/descriptor.cpp src/io/usd_file.cpp
   src/laws/bond_runs.cpp src/laws/cohesion_table.cpp src/laws/literal_form.cpp"
  "src/integrate/runge_kutta.cpp src/io/mesh_files.cpp src/laws/cohesion.cpp src/laws/cohesion_variants.cpp
   src/laws/lennard_jones.cpp src/laws/pair_laws.cpp src/laws/stiffness_damping.cpp src/neighbours/neighbours.cpp
   src/particles/audits.cpp"
  "src/io/particle_files.cpp src/io/vtk_files.cpp src/laws/damping.cpp src/laws/gay_berne.cpp
   src/laws/interaction_reports.cpp src/neighbours/pair_lists.cpp src/particles/arrange.cpp
   src/particles/particles.cpp"
  "src/io/read_mesh.cpp src/laws/gay_berne_hessian.cpp src/laws/interactions.cpp src/neighbours/cell_search.cpp
   src/particles/parts.cpp"
  "src/laws/pair_hessian.cpp src/particles/links.cpp")
