// An empty picture of the path tracer, where the package has one, as a PNG.
#include <supple/render/renderer.h>

#include <filesystem>

int main(int, char** argv) {
  using namespace supple::render;
  Image image{.width = 4, .height = 4, .pixels = std::vector<std::uint8_t>(48, 128)};
  if (has_path_tracer()) image = make_renderer({.width = 8, .height = 8, .kind = RendererKind::Path})->render({}, {});
  const std::filesystem::path file = std::filesystem::path(argv[0]).replace_extension(".png");
  write_png(file, image);
  return read_png(file).pixels == image.pixels ? 0 : 1;
}
