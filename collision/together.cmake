supple_together(
  "src/surface/polar/apex.cpp src/pairs/approach.cpp src/pairs/bodies.cpp src/pairs/body_order.cpp src/deform/bulge.cpp src/deform/bulge_volume.cpp
   src/surface/contact_surface.cpp src/pairs/cores.cpp src/surface/march/flat_cells.cpp"
  "src/surface/polar/cross_kinks.cpp src/surface/find_peak.cpp src/response/linearise.cpp src/surface/march/march_feet.cpp"
  "src/deform/deformed_field.cpp src/pairs/find_contacts.cpp src/surface/pair_pressure.cpp src/surface/polar/polar_cover.cpp src/surface/polar/symmetry.cpp"
  "src/surface/polar/imprint.cpp src/surface/pair_solver.cpp src/surface/quadrature.cpp"
  "src/surface/march/march_kinks.cpp src/surface/march/march_pieces.cpp src/surface/polar/polar_patches.cpp"
  "src/surface/march/march_rule.cpp src/response/react.cpp"
  "src/surface/polar/middle_rule.cpp src/pairs/sleep.cpp src/surface/polar/smooth_estimate.cpp src/surface/polar/touch_kinks.cpp"
  "src/surface/region/polar_columns.cpp src/surface/polar/rim_corners.cpp src/surface/region/squeezed_region.cpp"
  "src/surface/polar/polar_rule.cpp src/response/stick.cpp src/surface/third_bodies.cpp")
