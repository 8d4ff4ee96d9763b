#include "path_renderer.h"

#include <cmath>

#include "../draw_list.h"
#include "../lighting.h"
#include "../process_time.h"
#include "../srgb.h"
#include "denoise.h"
#include "integrator.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

using path::Vec3f;

class PathRenderer final : public Renderer {
 public:
  explicit PathRenderer(const RenderSettings& settings) : settings_(settings), executor_(settings.threads) {}
  using Renderer::render;
  Image render(const View& view, std::span<const Item> items, LinearImage* linear) override;
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
    lights.rectangles.push_back({.centre = (light.at - view.camera.look_at).cast<float>(), .u = edges.u.cast<float>(),
                                 .v = edges.v.cast<float>(), .front = light.facing.normalized().cast<float>(),
                                 .radiance = static_cast<float>(light.radiance) * linear_colour(light.colour)});
  }
  return lights;
}

Image PathRenderer::render(const View& view, std::span<const Item> items, LinearImage* linear) {
  SUPPLE_EXPECTS(view.light.direction.norm() > 0.0);
  const Vec3& origin = view.camera.look_at;
  const CameraMatrices camera = camera_matrices(view.camera, static_cast<double>(settings_.width) / settings_.height, {});
  const float footprint = 2.0F * camera.half_extent.y() / static_cast<float>(settings_.height);
  {
    const CpuClock clock(times_.upload);
    geometry_.set(items, origin, settings_.shutter, 0.6F * footprint);
  }
  std::optional<path::GroundPlane> ground;
  path::Pattern pattern;
  if (view.ground) {
    ground = {.height = static_cast<float>(view.ground->height - origin.z()), .albedo = linear_colour(view.ground->colour), .fades = true};
    if (view.ground->paint.kind != PaintKind::Plain) {
      pattern = path::Pattern(view.ground->paint, view.ground->colour);
      ground->pattern = &pattern;
      ground->origin = origin.head<2>().cast<float>();
    }
  }
  path::TraceSettings trace;
  trace.width = settings_.width;
  trace.height = settings_.height;
  trace.most_samples = settings_.most_samples;
  trace.noise = settings_.noise;
  trace.exact = settings_.exact;
  trace.aperture = view.camera.aperture;
  trace.focus = view.camera.focus > 0.0 ? view.camera.focus : camera.distance;
  {
    const CpuClock clock(times_.draw);
    path::trace(geometry_, lights_of(view, settings_.shadow_softness), ground, camera, trace, executor_, film_);
    if (settings_.denoise) denoiser_.run(settings_.width, settings_.height, camera.eye, footprint, executor_, film_);
  }
  const CpuClock clock(times_.read_back);
  if (linear != nullptr) {
    *linear = {.width = settings_.width, .height = settings_.height, .rgba = {}};
    for (std::size_t i = 0; i < film_.radiance.size(); ++i) {
      const Vec3f light = film_.cover[i] * film_.radiance[i];
      linear->rgba.insert(linear->rgba.end(), {light.x(), light.y(), light.z(), film_.cover[i]});
    }
  }
  return develop(view, film_);
}

/// A fit of the ACES output transform (Narkowicz 2015), as in the shaders.
Vec3f filmic(const Vec3f& radiance) {
  const Eigen::Array3f x = radiance.array().max(0.0F) * kExposure;
  return (x * (2.51F * x + 0.03F) / (x * (2.43F * x + 0.59F) + 0.14F)).min(1.0F).matrix();
}

Image PathRenderer::develop(const View& view, const path::Film& film) const {
  Image image{.width = settings_.width, .height = settings_.height, .pixels = {}};
  image.pixels.resize(3 * film.radiance.size());
  const Vec3f top = linear_colour(view.background_top), bottom = linear_colour(view.background_bottom);
  const auto width = static_cast<std::size_t>(settings_.width);
  for (std::size_t i = 0; i < film.radiance.size(); ++i) {
    const float t = 1.0F - (static_cast<float>(i / width) + 0.5F) / static_cast<float>(settings_.height);
    const Vec3f behind = bottom + t * t * (3.0F - 2.0F * t) * (top - bottom);
    const Vec3f seen = behind + film.cover[i] * (filmic(film.radiance[i]) - behind);
    for (Eigen::Index k = 0; k < 3; ++k) image.pixels[3 * i + static_cast<std::size_t>(k)] = srgb_of_linear(static_cast<double>(seen[k]));
  }
  return image;
}

}  // namespace

std::unique_ptr<Renderer> make_path_renderer(const RenderSettings& settings) { return std::make_unique<PathRenderer>(settings); }

}  // namespace supple::render
