#include "supple/render/renderer.h"

#include "gl/gl_renderer.h"
#include "path/path_renderer.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

void check_settings(const RenderSettings& settings) {
  const auto refuse = [](const char* key, const std::string& expected, const std::string& found) {
    throw Error(ErrorKind::Usage, Fault{.place = {}, .key = key, .expected = expected, .found = found, .hint = {}});
  };
  const auto check_size = [&refuse](const char* key, int value, int lowest) {
    if (value < lowest || value > 16384)
      refuse(key, "expected " + std::to_string(lowest) + " to 16384 pixels", std::to_string(value));
  };
  check_size("render.width", settings.width, 1);
  check_size("render.height", settings.height, 1);
  check_size("render.shadow_size", settings.shadow_size, 0);
  const int samples = settings.samples;
  if (samples != 1 && samples != 2 && samples != 4 && samples != 8)
    refuse("render.samples", "expected 1, 2, 4 or 8", std::to_string(samples));
  if (!(settings.shadow_softness >= 0.0 && settings.shadow_softness <= 0.5))
    refuse("render.shadow_softness", "expected an angle of 0 to 0.5 [rad]", std::to_string(settings.shadow_softness));
  const int most = settings.most_samples;
  if (most < 1 || most > 65536 || (most & (most - 1)) != 0)
    refuse("render.most_samples", "expected a power of two up to 65536", std::to_string(most));
  if (!(settings.noise >= 0.0)) refuse("render.noise", "expected a number >= 0", std::to_string(settings.noise));
  if (!(settings.shutter >= 0.0)) refuse("render.shutter", "expected a time >= 0 [s]", std::to_string(settings.shutter));
}

}  // namespace

bool has_path_tracer() {
#ifdef SUPPLE_HAS_EMBREE
  return true;
#else
  return false;
#endif
}

std::unique_ptr<Renderer> make_renderer(const RenderSettings& settings) {
  check_settings(settings);
  return settings.kind == RendererKind::Path ? make_path_renderer(settings) : make_gl_renderer(settings);
}

}  // namespace supple::render
