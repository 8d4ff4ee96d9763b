/// @file tracer.h
/// Eight camera rays at a time: first hits, direct light of sun and rectangles there, and further paths.
#pragma once

#include <optional>

#include "path/geometry.h"
#include "path/lights.h"
#include "path/paint.h"
#include "picture/draw_list.h"

namespace supple::render::path {

struct GroundPlane {
  float height = 0.0F;         ///< in the picture's space, as all that follows
  Vec3f albedo = Vec3f::Zero();
  bool fades = false;          ///< into the background with distance, for the camera
  const Pattern* pattern = nullptr;  ///< in place of the albedo, by x and y; null: none
  Eigen::Vector2f pattern_origin = Eigen::Vector2f::Zero();
  float pattern_size = 1.0F;   ///< of a square, a slice or a width
};

struct TraceSettings {
  int width = 0;
  int height = 0;
  int least_samples = 1;       ///< initial camera rays per pixel, a power of two
  int most_samples = 256;      ///< per pixel, a power of two
  double noise = 0.05;         ///< standard error of a pixel's luminance over (luminance + 0.1), RMS of a tile; 0: most_samples
  int bounces = 6;             ///< surfaces along a path after the first
  bool exact = true;           ///< hits lie on the surface of the field, where an item has one
  double aperture = 0.0;       ///< radius of the lens
  double focus = 1.0;          ///< distance of the plane that is sharp, along the line of sight
  float largest_indirect = 10.0F;  ///< luminance that a bounce can add; keeps single bright paths out of a picture
};

/// First hit of one camera ray of a pixel, or of eight.
template <class Number>
struct FacetOf {
  using Vector = typename LaneTypes<Number>::Vector;
  Number cover{};
  Vector albedo = Vector::Zero();       ///< at normal incidence
  Vector reflectance = Vector::Zero();  ///< towards the eye
  Vector normal = Vector::Zero();
  Vector position = Vector::Zero();
};
using Facet = FacetOf<float>;

/// Result of a camera ray.
template <class Number>
struct SampleOf {
  using Vector = typename LaneTypes<Number>::Vector;
  Vector direct = Vector::Zero();
  Vector indirect = Vector::Zero();
  Number weight{};    ///< number of camera rays that its indirect light represents; 0: it has none
  Number nearness{};  ///< 1 / distance of where it comes from
  Number mirror{};
  FacetOf<Number> facet;
};
using Sample = SampleOf<float>;
using Samples = SampleOf<Lanes>;

[[nodiscard]] inline Sample lane(const Samples& samples, std::size_t k) {
  const FacetOf<Lanes>& facet = samples.facet;
  return {.direct = samples.direct.lane(k), .indirect = samples.indirect.lane(k), .weight = samples.weight[k],
          .nearness = samples.nearness[k], .mirror = samples.mirror[k],
          .facet = {.cover = facet.cover[k], .albedo = facet.albedo.lane(k), .reflectance = facet.reflectance.lane(k),
                    .normal = facet.normal.lane(k), .position = facet.position.lane(k)}};
}

/// Samples of neighbouring pixels, or of one. Of each pixel they are sample `number` of `count` that it takes together from two
/// sequences of numbers, `stream` and the next one.
struct Picks {
  LaneMask who{};               ///< lanes that hold one
  LaneBits x{}, y{};
  std::uint32_t stream = 0;
  std::uint32_t count = 1;
  LaneBits number{};
  std::uint32_t share = 0;      ///< camera rays that a path stands for, a power of two up to count; 0: they have no paths
  bool sees_mirrors = true;     ///< sharp reflections are edges, too: there rays go on in any case
};

class Tracer {
 public:
  Tracer(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
         const TraceSettings& settings)
      : geometry_(geometry), lights_(lights), ground_(ground), camera_(camera), settings_(settings),
        to_world_(camera.view.block<3, 3>(0, 0).transpose()), sun_axes_(Vec3Lanes(lights.sun.to_light)),
        sun_radiance_(lights.sun.radiance()), sun_density_(1.0F / lights.sun.solid_angle()),
        least_distance_(2e-5F * static_cast<float>(camera.distance)) {}

  /// Lanes without a pick bring zeros.
  [[nodiscard]] Samples sample(const Picks& picks) const;

 private:
  using Random = SamplerOf<Lanes>;
  using Axes = AxesOf<Lanes>;
  struct Places {
    Vec3Lanes point, normal, leave;
    BsdfOf<Lanes> bsdf;
    Vec3Lanes pass;
    LaneBits item;           ///< 1 + the item; 0: the ground
    LaneMask glass, scatter; ///< light goes into the item
    LaneMask back;           ///< met from inside of it
    Lanes ratio;             ///< glass: index on this side over that beyond
  };
  /// First hits of rays.
  struct Meeting {
    LaneMask surface;  ///< of an item or the ground; the position is known
    LaneMask ground;
    LaneMask lamp;
    Lanes distance;
    Vec3Lanes radiance;  ///< of the lamp
    Lanes density;       ///< over solid angle, with which lamplight() takes that direction
  };
  /// Paths under way.
  struct Walk {
    RayBundle rays;
    Vec3Lanes weight;
    Lanes density;       ///< over solid angle, with which their directions were taken
    LaneMask from_eye;   ///< only glass has turned them
    LaneMask lights;     ///< sun and lamps that they meet count in full
    LaneMask no_lights;  ///< or not at all
  };
  /// Where light leaves a body, at first where it comes in.
  struct Exit {
    Vec3f point, normal, leave, pass;
  };
  struct Light {
    Vec3Lanes light;
    Vec3Lanes direction;  ///< it comes from
  };

  /// Of the rays from surfaces to lights: whose they are, their time, and whether those to the sun stay together.
  struct LightRays {
    LaneMask who;
    Lanes time;
    bool together = false;
  };

  [[nodiscard]] RayBundle camera_rays(const Picks& picks, Random& random) const;
  [[nodiscard]] Meeting meet(const RayBundle& rays, Lanes choice, Places& places) const;
  [[nodiscard]] Light sunlight(const Places& places, const Axes& axes, const Vec3Lanes& out, Random& random) const;
  [[nodiscard]] Vec3Lanes lamplight(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to, Random& random) const;
  [[nodiscard]] Vec3Lanes direct(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to, Random& random) const;
  [[nodiscard]] Vec3Lanes glint(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to) const;
  void put_inside(const Hit& hit, std::size_t lane, Places& places) const;
  void pass_glass(const Places& places, const Axes& axes, const Vec3Lanes& away, Lanes which, Walk& walk) const;
  [[nodiscard]] LaneMask scatter_inside(Places& places, const Vec3Lanes& away, Lanes which, Lanes seed, Walk& walk) const;
  [[nodiscard]] Vec3f scattered(std::uint32_t item, const Vec3f& albedo, std::uint32_t seed, float time, Exit& at) const;
  [[nodiscard]] static Lanes counted(const Walk& walk, Lanes density);
  void absorb(const Meeting& met, Walk& walk) const;
  [[nodiscard]] Vec3Lanes past_glass(const LightRays& to, const Vec3Lanes& from, const Vec3Lanes& direction, Lanes distance, LaneMask lit) const;
  [[nodiscard]] Vec3Lanes indirect(Places& places, const RayBundle& camera_rays, Random& random, Lanes& nearness) const;
  [[nodiscard]] Lanes ground_share(const Vec3Lanes& point) const;

  const Geometry& geometry_;
  const Lights& lights_;
  const std::optional<GroundPlane>& ground_;
  const CameraMatrices& camera_;
  const TraceSettings& settings_;
  Eigen::Matrix3f to_world_;
  Axes sun_axes_;
  Vec3Lanes sun_radiance_;  // infinite for a point, as is the density of its directions; neither is used then
  float sun_density_;
  float least_distance_;  // of what counts as near
};

}  // namespace supple::render::path
