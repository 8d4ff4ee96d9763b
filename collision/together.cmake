supple_together(
  "src/apex.cpp src/approach.cpp src/bodies.cpp src/body_order.cpp src/bulge.cpp src/bulge_volume.cpp
   src/contact_surface.cpp src/cores.cpp src/flat_cells.cpp"
  "src/cross_kinks.cpp src/find_peak.cpp src/linearise.cpp src/march_feet.cpp"
  "src/deformed_field.cpp src/find_contacts.cpp src/pair_pressure.cpp src/polar_cover.cpp src/symmetry.cpp"
  "src/imprint.cpp src/pair_solver.cpp src/quadrature.cpp"
  "src/march_kinks.cpp src/march_pieces.cpp src/mild_rule.cpp src/polar_patches.cpp"
  "src/march_rule.cpp src/react.cpp"
  "src/middle_rule.cpp src/sleep.cpp src/smooth_bound.cpp src/touch_kinks.cpp"
  "src/polar_columns.cpp src/rim_corners.cpp src/squeezed_region.cpp"
  "src/polar_rule.cpp src/stick.cpp src/third_bodies.cpp"
  "src/sample_rule.cpp src/sigma_mesh.cpp")
