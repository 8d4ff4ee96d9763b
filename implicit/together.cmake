supple_together(
  "src/blend.cpp src/blob_grid.cpp src/claim_bounds.cpp src/convolution.cpp src/crease_points.cpp
   src/delaunay_estimate.cpp src/half_space.cpp src/rim_islands.cpp"
  "src/crease_crossings.cpp src/crease_nodes.cpp src/creases.cpp src/error_search.cpp src/even_samples.cpp
   src/field_index.cpp"
  "src/crease_mending.cpp src/eighth_bounds.cpp src/field.cpp src/march_assemble.cpp src/mesh_motion.cpp"
  "src/crease_sharpening.cpp src/field_blend.cpp src/field_changes.cpp src/march_cubes.cpp src/march_refined.cpp
   src/mesh_columns.cpp src/same_triangles.cpp"
  "src/cut_crossings.cpp src/field_bounds.cpp src/march_blobs.cpp src/march_moves.cpp"
  "src/delaunay_partition.cpp src/field_box_bounds.cpp src/kinks.cpp src/march_leaves.cpp src/triangle_steps.cpp"
  "src/field_ray.cpp src/kernel.cpp src/march_view.cpp src/partition_keep.cpp src/patch_flips.cpp src/rim_facets.cpp"
  "src/intersect.cpp src/march_sampling.cpp src/patch_complex.cpp src/polygonise_within.cpp src/sample_layout.cpp
   src/triangle_errors.cpp src/united_field.cpp"
  "src/march_triangles.cpp src/missed_blobs.cpp src/patch_coarsen.cpp src/project.cpp src/shape_curvature.cpp"
  "src/missed_pieces.cpp src/skeleton.cpp src/solids.cpp"
  "src/patch_refine.cpp src/shapes.cpp src/surface_blocks.cpp"
  "src/patch_surface.cpp src/surface_samples.cpp src/volume.cpp"
  "src/polygonise_junctions.cpp src/polygonise_rims.cpp src/polygonise_roots.cpp src/rim_pieces.cpp"
  "src/polygonise_vertices.cpp src/rim_crossings.cpp src/triangle_crossings.cpp"
  "src/surface_grid.cpp src/grid_leaves.cpp src/grid_updater.cpp src/union_updater.cpp")
