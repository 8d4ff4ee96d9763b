supple_together(
  "src/particles/arrange.cpp src/particles/audits.cpp src/laws/bond_runs.cpp src/laws/cohesion.cpp src/laws/cohesion_table.cpp src/laws/cohesion_variants.cpp
   src/base/content_versions.cpp src/laws/directed_form.cpp src/base/error.cpp src/base/executor.cpp src/integrate/integrators.cpp"
  "src/integrate/contact_term.cpp src/laws/gay_berne.cpp src/laws/gay_berne_hessian.cpp src/base/hash.cpp src/integrate/integrate.cpp
   src/base/nearest_word.cpp"
  "src/laws/damping.cpp src/laws/interaction_reports.cpp src/particles/links.cpp src/base/math.cpp src/neighbours/neighbours.cpp"
  "src/integrate/implicit_step.cpp src/laws/interactions.cpp src/laws/lennard_jones.cpp src/laws/literal_form.cpp src/base/mesh.cpp"
  "src/neighbours/pair_lists.cpp src/laws/pair_laws.cpp src/particles/particles.cpp src/particles/parts.cpp src/integrate/rotation.cpp src/integrate/step_hessian.cpp
   src/laws/stiffness_damping.cpp"
  "src/laws/pair_hessian.cpp src/io/vtk_files.cpp"
  "src/integrate/runge_kutta.cpp src/io/atomic_file.cpp src/io/descriptor.cpp src/io/open_temporaries.cpp")
