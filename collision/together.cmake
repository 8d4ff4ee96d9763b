supple_together(
  "src/surface/apex.cpp src/pairs/approach.cpp src/pairs/bodies.cpp src/pairs/body_order.cpp src/deform/bulge.cpp src/deform/bulge_volume.cpp
   src/surface/contact_surface.cpp src/pairs/cores.cpp src/surface/flat_cells.cpp"
  "src/surface/cross_kinks.cpp src/surface/find_peak.cpp src/response/linearise.cpp src/surface/march_feet.cpp"
  "src/deform/deformed_field.cpp src/pairs/find_contacts.cpp src/surface/pair_pressure.cpp src/surface/polar_cover.cpp src/surface/symmetry.cpp"
  "src/surface/imprint.cpp src/surface/pair_solver.cpp src/surface/quadrature.cpp"
  "src/surface/march_kinks.cpp src/surface/march_pieces.cpp src/surface/mild_rule.cpp src/surface/polar_patches.cpp"
  "src/surface/march_rule.cpp src/response/react.cpp"
  "src/surface/middle_rule.cpp src/pairs/sleep.cpp src/surface/smooth_bound.cpp src/surface/touch_kinks.cpp"
  "src/surface/polar_columns.cpp src/surface/rim_corners.cpp src/surface/squeezed_region.cpp"
  "src/surface/polar_rule.cpp src/response/stick.cpp src/surface/third_bodies.cpp"
  "src/surface/sample_rule.cpp src/surface/sigma_mesh.cpp")
