supple_together(
  "gl/layers_test.cpp gl/renderer_process_test.cpp image/film_test.cpp image/image_test.cpp path/path_filter_test.cpp"
  "gl/light_test.cpp gl/paint_test.cpp path/path_rays_test.cpp picture/height_map_test.cpp"
  "gl/renderer_test.cpp path/path_media_test.cpp path/path_test.cpp picture/scale_test.cpp")
