/// @file rim_corners.h
/// Corners of a patch's rim, where levels meet it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/polar/outline.h"
#include "surface/polar/patch_levels.h"

namespace supple::collision {

/// Angles that differ less are the same [rad]; of searches between two rays, a share of the angle between these, and Newton's method goes on to its square.
inline constexpr double kSameTurn = 1e-7;

struct Corner {
  Vec3 at;            // on the rim
  std::size_t level;  // that meets it
};

/// Where a function changes its sign around a closed line, from its values at points of it: i + t lies between points i and i + 1.
/// Between two changes that no point saw, or one alone, it is the parabola through three points.
void follow_signs(std::span<const double> values, std::vector<double>& places);

/// A ray, and where it meets the rim.
struct RayEnd {
  Vec2 way;  // in units of u and v
  Vec3 place;
};

class CornerFinder {
 public:
  /// @param extent  of the patch [m]
  CornerFinder(PairPressure& pressure, const PeakFrame& frame, PatchLevels& levels, double extent) : pressure_(pressure), frame_(frame), levels_(levels), extent_(extent) {}
  /// Appends where levels that cross the patch meet the rim, begun between points of it. @param least  of the levels, the first
  void find(std::span<const Vec3> rim, std::size_t least, std::vector<Corner>& corners);
  /// Share of the angle between two rays at which a level meets the rim, where its signs at their ends say that it does.
  std::optional<double> between(std::size_t level, const RayEnd& first, const RayEnd& second);
  /// Appends where levels meet the rim, between rays of the outline of faces; those that do cross the patch. @param rim  where third bodies may meet it
  void find_on_outline(std::span<const RimPoint> outline, std::span<const Vec3> rim, std::vector<RimPoint>& corners);

 private:
  /// A kink where a ray meets it, on Sigma.
  struct KinkOnRay {
    std::size_t kink;
    Vec2 way;                      // the ray's direction, of any length
    double rim, height;            // rim near there, in units of `way`, as is `radius`
    bool dip = false;               // the pressure along the kink comes near to 0 there
    double radius = 0.0;
    bool met = false;
    bool positive = false;         // s at the rim, which lies beyond the kink where the pressure is above 0
    double pressure = 0.0, rate = 0.0;  // over the angle
  };
  /// A corner is sought between the rays `left` and `right`: at left + place (right - left).
  struct CornerSearch {
    std::size_t kink;
    Vec2 left, right;
    double rim_left, rim_right;
    bool positive_left;            // s at the rim on the left
    double place, height;
    double from = 0.0, to = 1.0;
    std::optional<Vec2> at = std::nullopt;
  };
  void move_to_corners(std::span<const std::size_t> level, std::vector<double>& last);
  void meet_kinks(double close, std::span<KinkOnRay> rays);
  void find_between(std::span<CornerSearch> searches);
  void add_vertices(std::span<const RimPoint> outline, std::vector<RimPoint>& rays) const;
  [[nodiscard]] std::vector<KinkOnRay> kinks_on_rays(std::span<const RimPoint> outline);

  PairPressure& pressure_;
  const PeakFrame& frame_;
  PatchLevels& levels_;
  double extent_;
  PressureBatch batch_;
};

}  // namespace supple::collision
