/// @file outline.h
/// The outline of a patch of faces: rays from its middle to the rim, from kink to kink, and sectors between its corners.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "supple/implicit/kinks.h"
#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/polar/imprint.h"

namespace supple::collision {

/// A point of a patch's rim in the frame of the patch.
struct RimPoint {
  Vec2 at = Vec2::Zero();       // in units of u and v
  double height = 0.0;          // [m]
  Vec2 outward = Vec2::Zero();  // the pressure falls
};

/// A kink as seen from the origin: of planes, spheres and cylinders s = value + slope . d + d . bend d, which others are asked for.
struct Sheet {
  double value = 0.0;
  Vec3 slope = Vec3::Zero();
  Mat3 bend = Mat3::Zero();
  bool flat = false, told = false;
};
[[nodiscard]] Sheet sheet_of(const implicit::Kink& kink, const Vec3& origin);

/// Last step of walks to where corners of the outline are sought, over the distance gone.
inline constexpr double kOutlineStep = 1e-2;

/// Rays from the middle to the rim. Between kinks the pressure along a ray is smooth: what is known of it inside, or beyond the
/// rim, says where to look next, and never beyond the next kink before that has been looked at.
class OutlineWalks {
 public:
  /// @param extent  farther nothing is followed [m]
  OutlineWalks(PairPressure& pressure, const PeakFrame& frame, std::span<const implicit::Kink> kinks, double extent)
      : pressure_(pressure), frame_(frame), kinks_(kinks), extent_(extent) {}
  /// Appends a point of the rim for each way. @param enough  the last step, over the distance gone   @return false where one is not found
  bool follow(std::span<const Vec2> ways, double enough, std::vector<RimPoint>& out);
  /// How far a way goes to the rim, in units of its length.
  [[nodiscard]] double length(std::size_t way) const { return walks_[way].at; }

 private:
  /// The search for the rim along one ray: the last place inside, and one outside.
  struct Walk {
    Vec2 way = Vec2::Zero();
    Vec3 along = Vec3::Zero();
    double in = 0.0, in_height = 0.0, pressure = 0.0, slope = 0.0, bend = 0.0;  // pressure along Sigma, its first and second derivatives
    double rise = 0.0;                   // of Sigma
    double out = 0.0;
    double most = 0.0;                   // length of a step that is believed
    double passed = 0.0;                 // the last kink gone to
    double at = 0.0, height = 0.0;       // where it looks next
    bool fresh = true, done = false;     // without a second derivative; at the rim
    Vec2 outward = Vec2::Zero();
  };
  /// What ends a walk: the step over the distance gone, and the pressure [Pa].
  struct WalkEnd {
    double step, pressure;
  };
  double start(std::span<const Vec2> ways);
  void look_ahead(Walk& walk) const;
  void walk_on(Walk& walk, const AlongAxis& sigma, double a, double b, const WalkEnd& end);

  PairPressure& pressure_;
  const PeakFrame& frame_;
  std::span<const implicit::Kink> kinks_;
  double extent_;
  std::vector<Sheet> sheets_;
  std::vector<Walk> walks_;
  PressureBatch batch_;
};

/// A patch of faces about its middle.
struct Middle {
  PeakFrame frame;  ///< about the centroid of the outline, which is as wide as it is long in units of u and v, but not on a kink
  std::vector<RimPoint> outline;
};

/// @param inside  of any place of the patch   @return nothing where the rim is not found
[[nodiscard]] std::optional<Middle> find_middle(PairPressure& pressure, const PeakFrame& inside, std::span<const implicit::Kink> kinks, double extent);

/// Directions of rays as a parabola through three points near the rim, with heights.
struct Sector {
  std::array<Vec2, 3> at;
  std::array<double, 3> height;
  bool touch_begin = false, touch_end = false;  // a ray touches an imprint there
};

/// What is known of a patch's outline.
struct Outline {
  std::span<const RimPoint> point, corner;
  std::span<const Imprint> imprint;  ///< where rays touch them sectors end, too
};

/// Sectors between corners of the outline, and between others of its points where these are too far apart.
/// @return whether rays through them turn one way
bool make_sectors(const Outline& outline, std::vector<Sector>& sectors, std::vector<RimPoint>& polygon);

}  // namespace supple::collision
