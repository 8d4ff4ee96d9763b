supple_together(
  "src/image/colour_map.cpp src/picture/draw_list.cpp src/image/exr.cpp src/gl/gl.cpp src/gl/gl_renderer.cpp
   src/picture/glyphs.cpp src/gl/shaders_geometry.cpp"
  "src/image/film.cpp src/gl/gl_renderer_paint.cpp src/gl/gl_renderer_setup.cpp src/picture/height_map.cpp src/gl/layers.cpp
   src/picture/picture_space.cpp src/image/png.cpp src/gl/renderer.cpp"
  "src/gl/gl_context.cpp src/image/image.cpp src/image/overlay.cpp src/gl/shader_parts.cpp"
  "src/gl/shaders_light.cpp src/gl/shaders_occlusion.cpp src/image/srgb.cpp"
  "src/path/integrator.cpp src/path/details.cpp src/path/tracer.cpp src/path/paint.cpp"
  "src/path/geometry.cpp src/path/denoise.cpp src/path/media.cpp")
