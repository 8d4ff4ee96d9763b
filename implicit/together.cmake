supple_together(
  "src/blend.cpp src/blob_grid.cpp src/claim_bounds.cpp src/convolution.cpp src/crease_points.cpp
   src/delaunay_estimate.cpp"
  "src/closed_surface.cpp src/crease_nodes.cpp src/creases.cpp src/even_samples.cpp src/half_space.cpp
   src/march_cubes.cpp"
  "src/crease_crossings.cpp src/eighth_bounds.cpp src/error_search.cpp src/exact_distance.cpp src/field_index.cpp
   src/mesh_solid.cpp"
  "src/crease_mending.cpp src/field.cpp src/field_bounds.cpp src/march_leaves.cpp"
  "src/crease_sharpening.cpp src/field_blend.cpp src/field_changes.cpp src/march_assemble.cpp src/mesh_columns.cpp
   src/mesh_motion.cpp src/patch_flips.cpp"
  "src/cut_crossings.cpp src/field_ray.cpp src/march_blobs.cpp src/rim_islands.cpp"
  "src/delaunay_partition.cpp src/field_box_bounds.cpp src/kinks.cpp src/march_sampling.cpp src/same_triangles.cpp
   src/triangle_steps.cpp"
  "src/height_field.cpp src/intersect.cpp src/march_moves.cpp src/march_refined.cpp src/patch_surface.cpp"
  "src/kernel.cpp src/march_view.cpp src/mesh_distance.cpp src/mesh_routes.cpp src/triangle_errors.cpp"
  "src/march_triangles.cpp src/missed_blobs.cpp src/patch_coarsen.cpp src/polygonise_within.cpp src/project.cpp"
  "src/missed_pieces.cpp src/sample_layout.cpp src/united_field.cpp"
  "src/partition_keep.cpp src/polygonise_junctions.cpp src/polygonise_rims.cpp src/rim_facets.cpp src/rim_pieces.cpp"
  "src/patch_complex.cpp src/shape_curvature.cpp src/skeleton.cpp src/surface_blocks.cpp"
  "src/patch_refine.cpp src/shapes.cpp src/solids.cpp src/triangle_tree.cpp"
  "src/polygonise_roots.cpp src/surface_samples.cpp src/volume.cpp"
  "src/polygonise_vertices.cpp src/rim_crossings.cpp src/triangle_crossings.cpp"
  "src/surface_grid.cpp src/grid_leaves.cpp src/grid_updater.cpp src/union_updater.cpp")
