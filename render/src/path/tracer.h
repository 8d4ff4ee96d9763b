/// @file tracer.h
/// One camera ray after the other: what it meets, the light of sun and rectangles there, and a path further on.
#pragma once

#include <optional>
#include <span>

#include "../draw_list.h"
#include "geometry.h"
#include "lights.h"
#include "paint.h"

namespace supple::render::path {

struct GroundPlane {
  float height = 0.0F;         ///< relative to the origin [m]
  Vec3f albedo = Vec3f::Zero();
  bool fades = false;          ///< into the background with distance, for the camera
  const Pattern* pattern = nullptr;  ///< in place of the albedo, by world x and y; null: none
  Eigen::Vector2f origin = Eigen::Vector2f::Zero();  ///< of positions, in the world [m]
};

struct TraceSettings {
  int width = 0;
  int height = 0;
  int least_samples = 1;       ///< camera rays a pixel to begin with, a power of two
  int most_samples = 256;      ///< a pixel, a power of two
  double noise = 0.05;         ///< standard error of a pixel's luminance over (luminance + 0.1), RMS of a tile; 0: most_samples
  int bounces = 6;             ///< surfaces along a path after the first
  bool exact = true;           ///< hits lie on the surface of the field, where an item has one
  double aperture = 0.0;       ///< radius of the lens [m]
  double focus = 1.0;          ///< distance of the plane that is sharp, along the line of sight [m]
  float largest_indirect = 10.0F;  ///< luminance that a bounce can add; keeps single bright paths out of a picture
};

/// What one camera ray of a pixel met.
struct Facet {
  float cover = 0.0F;
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();  ///< relative to the origin [m]
};

/// Sample `number` of `count` that a pixel takes together from two sequences of numbers, `stream` and the next one.
struct Pick {
  int x = 0;
  int y = 0;
  std::uint32_t stream = 0;
  std::uint32_t count = 1;
  std::uint32_t number = 0;
  std::uint32_t share = 0;      ///< camera rays that its path stands for, a power of two up to count; 0: it has no path
  bool sees_mirrors = true;     ///< sharp reflections are edges, too: there the ray goes on in any case
};

/// What one camera ray brings.
struct Sample {
  Vec3f direct = Vec3f::Zero();
  Vec3f indirect = Vec3f::Zero();
  float weight = 0.0F;    ///< camera rays that its indirect light stands for; 0: it knows of none
  float nearness = 0.0F;  ///< 1 / distance of where it comes from
  float mirror = 0.0F;
  Facet facet;
};

struct Ray {
  Vec3f from;
  Vec3f direction;
};

class Tracer {
 public:
  Tracer(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
         const TraceSettings& settings)
      : geometry_(geometry), lights_(lights), ground_(ground), camera_(camera), settings_(settings),
        to_world_(camera.view.block<3, 3>(0, 0).transpose()), sun_axes_(lights.sun.to_light), sun_radiance_(lights.sun.radiance()),
        sun_density_(1.0F / lights.sun.solid_angle()), gap_(2e-5F * static_cast<float>(camera.distance)) {}

  /// Of a bundle of at most RayBundle::kSize neighbouring picks.
  void sample(std::span<const Pick> picks, std::span<Sample> out) const;

 private:
  struct Place {
    Vec3f point;
    Vec3f normal;
    Vec3f leave;
    Bsdf bsdf;
  };
  enum class Met : std::uint8_t { Nothing, Surface, Ground, Light };

  [[nodiscard]] Ray camera_ray(int x, int y, Sampler& random) const;
  [[nodiscard]] Met meet(const Ray& ray, float time, float choice, Place& place, float& distance, std::size_t& light) const;
  [[nodiscard]] Met nearest(const Ray& ray, bool met_surface, const Hit& hit, Place& place, float& distance, std::size_t& light) const;
  [[nodiscard]] Vec3f sunlight(const Place& place, const Axes& axes, const Vec3f& out, Sampler& random, Vec3f& direction) const;
  [[nodiscard]] Vec3f lamplight(const Place& place, const Axes& axes, const Vec3f& out, float time, Sampler& random) const;
  [[nodiscard]] Vec3f indirect(Place place, const Ray& camera_ray, float time, Sampler& random, float& nearness) const;
  [[nodiscard]] float ground_share(const Vec3f& point) const;

  const Geometry& geometry_;
  const Lights& lights_;
  const std::optional<GroundPlane>& ground_;
  const CameraMatrices& camera_;
  const TraceSettings& settings_;
  Eigen::Matrix3f to_world_;
  Axes sun_axes_;
  Vec3f sun_radiance_;   // infinite for a point, as is the density of its directions; neither is asked for then
  float sun_density_;
  float gap_;  // between a surface and the paths that leave it [m]
};

}  // namespace supple::render::path
