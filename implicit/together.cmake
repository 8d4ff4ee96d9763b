supple_together(
  "src/field/blend.cpp src/mesh/blob_grid.cpp src/bounds/weighted_bounds.cpp src/skeleton/convolution.cpp src/mesh/creases/crease_points.cpp
   src/mesh/delaunay/delaunay_estimate.cpp"
  "src/solids/closed_surface.cpp src/mesh/creases/crease_nodes.cpp src/mesh/creases/creases.cpp src/samples/even_samples.cpp src/solids/half_space.cpp
   src/mesh/cubes/march_cubes.cpp"
  "src/mesh/creases/crease_crossings.cpp src/bounds/eighth_bounds.cpp src/mesh/error_search.cpp src/solids/exact_distance.cpp src/field/field_index.cpp
   src/solids/mesh_solid.cpp"
  "src/mesh/creases/crease_mending.cpp src/field/field.cpp src/bounds/field_bounds.cpp src/mesh/cubes/march_leaves.cpp"
  "src/mesh/creases/crease_sharpening.cpp src/field/field_blend.cpp src/field/field_changes.cpp src/mesh/cubes/march_assemble.cpp src/mesh/mesh_columns.cpp
   src/mesh/mesh_motion.cpp src/mesh/delaunay/patch_flips.cpp"
  "src/mesh/cut_crossings.cpp src/field/field_ray.cpp src/mesh/cubes/march_blobs.cpp src/mesh/partition/boundary_islands.cpp"
  "src/mesh/delaunay/delaunay_partition.cpp src/bounds/field_box_bounds.cpp src/field/kinks.cpp src/mesh/cubes/march_sampling.cpp src/mesh/same_triangles.cpp
   src/mesh/triangle_steps.cpp"
  "src/solids/height_field.cpp src/field/intersect.cpp src/mesh/cubes/march_moves.cpp src/mesh/cubes/march_refined.cpp src/mesh/delaunay/patch_surface.cpp"
  "src/skeleton/kernel.cpp src/mesh/cubes/march_view.cpp src/solids/mesh_distance.cpp src/mesh/mesh_routes.cpp src/mesh/triangle_errors.cpp"
  "src/mesh/cubes/march_triangles.cpp src/mesh/missed/missed_blobs.cpp src/mesh/delaunay/patch_coarsen.cpp src/mesh/partition/polygonise_within.cpp src/field/project.cpp"
  "src/mesh/missed/missed_pieces.cpp src/samples/sample_layout.cpp src/solids/united_field.cpp"
  "src/mesh/partition/partition_keep.cpp src/mesh/partition/polygonise_junctions.cpp src/mesh/partition/polygonise_boundaries.cpp src/mesh/partition/boundary_facets.cpp src/mesh/partition/boundary_pieces.cpp"
  "src/mesh/delaunay/patch_complex.cpp src/bounds/shape_curvature.cpp src/skeleton/skeleton.cpp src/mesh/surface_blocks.cpp"
  "src/mesh/delaunay/patch_refine.cpp src/skeleton/shapes.cpp src/solids/solids.cpp src/solids/triangle_tree.cpp"
  "src/mesh/partition/polygonise_roots.cpp src/samples/surface_samples.cpp src/field/volume.cpp"
  "src/mesh/partition/polygonise_vertices.cpp src/mesh/partition/boundary_crossings.cpp src/mesh/triangle_crossings.cpp"
  "src/grid/surface_grid.cpp src/grid/grid_leaves.cpp src/grid/grid_updater.cpp src/grid/union_updater.cpp")
