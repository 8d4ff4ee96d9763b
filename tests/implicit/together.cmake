supple_together(
  "bounds/eighth_bounds_test.cpp bounds/field_bounds_test.cpp field/field_test.cpp mesh/cut_crossings_test.cpp
   mesh/delaunay/cgal_test.cpp"
  "bounds/field_box_bounds_test.cpp samples/surface_samples_test.cpp skeleton/skeleton_test.cpp
   solids/half_space_test.cpp"
  "bounds/shape_curvature_test.cpp skeleton/convolution_test.cpp solids/height_field_test.cpp solids/solids_test.cpp"
  "field/blend_test.cpp field/volume_test.cpp refusals_test.cpp skeleton/kernel_test.cpp"
  "mesh/delaunay/delaunay_partition_test.cpp solids/exact_distance_test.cpp"
  "mesh/error_search_test.cpp solids/mesh_solid_test.cpp")
