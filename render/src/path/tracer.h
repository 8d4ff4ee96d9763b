/// @file tracer.h
/// Eight camera rays at once: what they meet, the light of sun and rectangles there, and paths further on.
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

class Tracer {
 public:
  Tracer(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
         const TraceSettings& settings)
      : geometry_(geometry), lights_(lights), ground_(ground), camera_(camera), settings_(settings),
        to_world_(camera.view.block<3, 3>(0, 0).transpose()), sun_axes_(Vec3Lanes(lights.sun.to_light)),
        sun_radiance_(lights.sun.radiance()), sun_density_(1.0F / lights.sun.solid_angle()),
        gap_(2e-5F * static_cast<float>(camera.distance)) {}

  /// Of at most kLanes neighbouring picks.
  void sample(std::span<const Pick> picks, std::span<Sample> out) const;

 private:
  using Random = SamplerOf<Lanes>;
  using Axes = AxesOf<Lanes>;
  struct Places {
    Vec3Lanes point, normal, leave;
    BsdfOf<Lanes> bsdf;
  };
  /// What rays meet first.
  struct Meeting {
    LaneMask surface;  ///< of an item or the ground; its place is known
    LaneMask ground;
    LaneMask lamp;
    Lanes distance;
    Vec3Lanes radiance;  ///< of the lamp
    Lanes density;       ///< over solid angle, with which lamplight() takes that direction
  };
  struct Light {
    Vec3Lanes light;
    Vec3Lanes direction;  ///< it comes from
  };

  [[nodiscard]] RayBundle camera_rays(std::span<const Pick> picks, LaneMask who, Random& random) const;
  [[nodiscard]] Meeting meet(const RayBundle& rays, Lanes choice, Places& places) const;
  [[nodiscard]] Light sunlight(const Places& places, const Axes& axes, const Vec3Lanes& out, Random& random) const;
  [[nodiscard]] Vec3Lanes lamplight(const Places& places, const Axes& axes, const Vec3Lanes& out, LaneMask who, Lanes time,
                                    Random& random) const;
  [[nodiscard]] Vec3Lanes direct(const Places& places, const Axes& axes, const Vec3Lanes& out, LaneMask who, Lanes time, bool together,
                                 Random& random) const;
  [[nodiscard]] Vec3Lanes indirect(Places& places, const RayBundle& camera_rays, Random& random, Lanes& nearness) const;
  [[nodiscard]] Lanes ground_share(const Vec3Lanes& point) const;

  const Geometry& geometry_;
  const Lights& lights_;
  const std::optional<GroundPlane>& ground_;
  const CameraMatrices& camera_;
  const TraceSettings& settings_;
  Eigen::Matrix3f to_world_;
  Axes sun_axes_;
  Vec3Lanes sun_radiance_;  // infinite for a point, as is the density of its directions; neither is asked for then
  float sun_density_;
  float gap_;  // between a surface and the paths that leave it [m]
};

}  // namespace supple::render::path
