supple_together(
  "src/child_process.cpp src/colour_map.cpp src/draw_list.cpp src/exr.cpp src/gl.cpp src/gl_renderer.cpp
   src/glyphs.cpp src/shaders_geometry.cpp"
  "src/film.cpp src/gl_renderer_paint.cpp src/gl_renderer_setup.cpp src/height_map.cpp src/layers.cpp
   src/picture_space.cpp src/png.cpp src/renderer.cpp"
  "src/gl_context.cpp src/image.cpp src/overlay.cpp src/shader_parts.cpp"
  "src/shaders_light.cpp src/shaders_occlusion.cpp src/srgb.cpp"
  "src/path/integrator.cpp src/path/details.cpp src/path/tracer.cpp src/path/paint.cpp"
  "src/path/geometry.cpp src/path/denoise.cpp")
