#include "path/path_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "image/process_time.h"
#include "image/srgb.h"
#include "path/denoise.h"
#include "path/integrator.h"
#include "picture/draw_list.h"
#include "picture/lighting.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

using path::Lanes;
using path::Vec3f;
using path::Vec3Lanes;

class PathRenderer final : public Renderer {
 public:
  explicit PathRenderer(const RenderSettings& settings) : settings_(settings), executor_(settings.threads) {}
  using Renderer::render;
  Image render(const View& world, std::span<const Item> items, LinearImage* linear) override;
  [[nodiscard]] std::string description() const override { return "path tracer, Embree " + std::string(RTC_VERSION_STRING); }
  [[nodiscard]] RenderTimes times() const override { return times_; }

 private:
  [[nodiscard]] Image develop(const View& view, const path::Film& film) const;
  RenderSettings settings_;
  RenderTimes times_;
  Executor executor_;
  path::Geometry geometry_;
  path::Film film_;
  path::Denoiser denoiser_;
};

/// Sky, sun and ground of the shaders: without a ground, half a sky from below.
path::Lights lights_of(const View& view, double softness) {
  path::Lights lights;
  lights.above = sky_colour();
  lights.below = 0.5F * sky_colour();
  lights.sun = {.to_light = -view.light.direction.normalized().cast<float>(), .irradiance = path::kPi * sun_colour(view.light),
                .cosine = static_cast<float>(std::cos(softness))};
  for (const AreaLight& light : view.area_lights) {
    const RectangleEdges edges = rectangle_edges(light);
    lights.rectangles.push_back({.centre = light.at.cast<float>(), .u = edges.u.cast<float>(),
                                 .v = edges.v.cast<float>(), .front = light.facing.normalized().cast<float>(),
                                 .radiance = static_cast<float>(light.radiance) * linear_colour(light.colour)});
  }
  return lights;
}

Image PathRenderer::render(const View& world, std::span<const Item> items, LinearImage* linear) {
  SUPPLE_EXPECTS(world.light.direction.norm() > 0.0);
  const LocalView local = localised(world, items);
  const View& view = local.view;
  const CameraMatrices camera = camera_matrices(view.camera, static_cast<double>(settings_.width) / settings_.height, {});
  const float footprint = 2.0F * camera.half_extent.y() / static_cast<float>(settings_.height);
  {
    const CpuClock clock(times_.upload);
    geometry_.set(items, local.space, settings_.shutter, 0.6F * footprint);
  }
  std::optional<path::GroundPlane> ground;
  path::Pattern pattern;
  if (view.ground) {
    ground = {.height = static_cast<float>(view.ground->height), .albedo = linear_colour(view.ground->colour), .fades = true};
    if (view.ground->paint.kind != PaintKind::Plain) {
      pattern = path::Pattern(view.ground->paint, view.ground->colour);
      ground->pattern = &pattern;
      ground->pattern_origin = local.pattern_origin.head<2>().cast<float>();
      ground->pattern_size = static_cast<float>(view.ground->paint.size);
    }
  }
  path::TraceSettings trace;
  trace.width = settings_.width;
  trace.height = settings_.height;
  trace.most_samples = settings_.most_samples;
  trace.noise = settings_.noise;
  trace.exact = settings_.exact;
  trace.aperture = view.camera.aperture;
  trace.focus = view.camera.focus;
  {
    const CpuClock clock(times_.draw);
    path::trace({geometry_, lights_of(view, settings_.shadow_softness), ground, camera}, trace, executor_, film_);
    if (settings_.denoise) denoiser_.run(camera.eye, footprint, executor_, film_);
  }
  const CpuClock clock(times_.read_back);
  if (linear != nullptr) {
    *linear = {.width = settings_.width, .height = settings_.height, .rgba = {}};
    for (int y = 0; y < settings_.height; ++y)
      for (int x = 0; x < settings_.width; ++x) {
        const float cover = film_.cover.at(x, y);
        const Vec3f light = cover * film_.radiance.at(x, y);
        linear->rgba.insert(linear->rgba.end(), {light.x(), light.y(), light.z(), cover});
      }
  }
  return develop(view, film_);
}

/// A fit of the ACES output transform (Narkowicz 2015), as in the shaders.
Vec3Lanes filmic(const Vec3Lanes& radiance) {
  const auto curve = [](Lanes light) {
    const Lanes x = path::larger(light, 0.0F) * kExposure;
    return path::smaller(x * (2.51F * x + 0.03F) / (x * (2.43F * x + 0.59F) + 0.14F), 1.0F);
  };
  return {curve(radiance.x()), curve(radiance.y()), curve(radiance.z())};
}

Image PathRenderer::develop(const View& view, const path::Film& film) const {
  Image image{.width = settings_.width, .height = settings_.height, .pixels = {}};
  const auto width = static_cast<std::size_t>(settings_.width), height = static_cast<std::size_t>(settings_.height);
  image.pixels.resize(3 * width * height);
  const Vec3f top = linear_colour(view.background_top), bottom = linear_colour(view.background_bottom);
  executor_.for_blocks(height, 16, [&](std::size_t begin, std::size_t end) {
    std::vector<float> light(3 * width);
    for (std::size_t row = begin; row < end; ++row) {
      const float t = 1.0F - (static_cast<float>(row) + 0.5F) / static_cast<float>(settings_.height);
      const Vec3Lanes behind(bottom + t * t * (3.0F - 2.0F * t) * (top - bottom));
      for (std::size_t left = 0; left < width; left += path::kLanes) {
        const int x = static_cast<int>(left), y = static_cast<int>(row);
        const Vec3Lanes seen = behind + film.cover.load(x, y) * (filmic(film.radiance.load(x, y)) - behind);
        const std::array channels = {seen.x(), seen.y(), seen.z()};
        for (std::size_t k = 0; k < std::min(path::kLanes, width - left); ++k)
          for (std::size_t c = 0; c < 3; ++c) light[3 * (left + k) + c] = channels[c][k];
      }
      srgb_of_linear(light, std::span(image.pixels).subspan(3 * row * width, 3 * width));
    }
  });
  return image;
}

}  // namespace

std::unique_ptr<Renderer> make_path_renderer(const RenderSettings& settings) { return std::make_unique<PathRenderer>(settings); }

}  // namespace supple::render
