supple_together(
  "src/deform/bulge.cpp src/deform/bulge_volume.cpp src/deform/deformed_field.cpp src/pairs/bodies.cpp
   src/pairs/body_order.cpp src/pairs/cores.cpp src/pairs/soft_body.cpp"
  "src/pairs/approach.cpp src/pairs/find_contacts.cpp src/pairs/sleep.cpp src/response/energy_loads.cpp
   src/response/linearise.cpp src/response/stick.cpp src/surface/march/flat_cells.cpp src/surface/pair_pressure.cpp
   src/surface/panels/panel_corners.cpp"
  "src/response/react.cpp src/surface/contact_surface.cpp src/surface/find_peak.cpp src/surface/march/march_feet.cpp
   src/surface/march/sigma_mesh.cpp"
  "src/surface/march/march_kinks.cpp src/surface/march/march_pieces.cpp src/surface/march/march_rule.cpp
   src/surface/panels/panel_levels.cpp"
  "src/surface/pair_solver.cpp src/surface/panels/level_roots.cpp src/surface/panels/panel_doubts.cpp
   src/surface/panels/sigma_rays.cpp src/surface/polar/apex.cpp"
  "src/surface/panels/panel_rule.cpp src/surface/panels/panels.cpp src/surface/panels/star_rims.cpp"
  "src/surface/polar/cross_kinks.cpp src/surface/polar/middle_rule.cpp src/surface/polar/polar_cover.cpp
   src/surface/polar/symmetry.cpp"
  "src/surface/polar/imprint.cpp src/surface/polar/star_rule.cpp src/surface/quadrature.cpp"
  "src/surface/polar/polar_patches.cpp src/surface/polar/polar_rule.cpp src/surface/region/polar_columns.cpp
   src/surface/region/squeezed_region.cpp"
  "src/surface/polar/rim_corners.cpp src/surface/region/column_kinks.cpp src/surface/region/energy_columns.cpp
   src/surface/region/sigma_columns.cpp src/surface/third_bodies.cpp")
