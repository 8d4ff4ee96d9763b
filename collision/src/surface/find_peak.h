/// @file find_peak.h
/// Where on Sigma = {p_A = p_B} the pressure is largest: starting points from seeds, and the ascent from one of them.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "surface/pair_pressure.h"
#include "surface/plane.h"

namespace supple::collision {

/// A local frame of Sigma at its point of largest pressure: x = origin + rho (cos u + sin v) + t axis.
/// u and v are orthogonal tangents along the principal directions of the pressure on Sigma, scaled such that
/// p = peak - rho^2 / 2 to second order: an elongated patch becomes a circle. What the curvatures do not tell is told by the bodies
/// (PairPressure::tangent): the directions where both are nearly the same, and which way along them u and v go, so that u, v and the axis may be
/// left-handed.
struct PeakFrame {
  Vec3 origin = Vec3::Zero();
  Vec3 axis = Vec3::Zero();  ///< unit, out of A and into B
  Vec3 u = Vec3::Zero();     ///< [m / sqrt(Pa)]
  Vec3 v = Vec3::Zero();
  double peak = 0.0;         ///< p at the origin [Pa]
  /// Height of Sigma to second order: t = rho^2 / 2 (uu cos^2 + 2 uv cos sin + vv sin^2).
  double height_uu = 0.0, height_uv = 0.0, height_vv = 0.0;
  double thickness = 0.0;    ///< of the overlap along the axis, to first order [m]
  double depth[2] = {0.0, 0.0};  ///< share of A's and of B's squeezed region in it [m]
  bool flat = false;             ///< not the peak: the pressure is that of faces, flat along some direction

  /// A way over the tangent plane [m], from its parts along u and v in units of these; and the parts of a way.
  [[nodiscard]] Vec3 across(const Vec2& parts) const { return parts.x() * u + parts.y() * v; }
  [[nodiscard]] Vec2 parts_of(const Vec3& way) const { return {way.dot(u) / u.squaredNorm(), way.dot(v) / v.squaredNorm()}; }
  /// A place over the tangent plane, and at a height above it [m].
  [[nodiscard]] Vec3 place(const Vec2& parts, double height) const { return origin + across(parts) + height * axis; }
};

/// Principal directions of a symmetric 2 x 2 matrix: of the larger eigenvalue first.
struct Principal {
  double cosine, sine;   ///< of the first direction; the second is (-sine, cosine)
  double first, second;  ///< eigenvalues
};
[[nodiscard]] Principal principal(double xx, double xy, double yy);

/// A line that both bodies of a pair are the same all around.
struct CommonAxis {
  Vec3 point = Vec3::Zero();
  Vec3 direction = Vec3::UnitZ();  ///< unit, out of A and into B
};

/// A place, and the slope of p_B - p_A there: out of A, as the axes of patches are that the place may belong to. Zero: not known.
struct StartPoint {
  Vec3 at;
  Vec3 across = Vec3::Zero();  ///< [Pa / m]
};

/// Starting points of one pair, and points that lie inside both bodies.
struct StartPoints {
  std::vector<StartPoint> hill;    ///< one for each hill of the seeds, most promising first
  std::vector<StartPoint> inside;  ///< points of {p_A >= 0, p_B >= 0}: every component should hold one
  std::vector<StartPoint> beside;  ///< seeds that lie outside one body, near its surface: components between samples lie near one
};

class PeakFinder {
 public:
  /// From surface samples: a hill is a seed without a higher one within twice the spacing.
  void start_from_seeds(PairPressure& pressure, std::span<const Vec3> seeds, double spacing, StartPoints& out);
  /// Without samples: local maxima of min(p_A, p_B) on a coarse grid.
  void start_from_scan(PairPressure& pressure, const Box& overlap, StartPoints& out);
  /// Newton's method for the largest p on Sigma (Lagrange function with Hessian by differences of gradients).
  /// @param extent  longest half axis of a patch that is believed [m]
  /// @param convex  both bodies are: Sigma bends little over their contact
  /// @param stop_on_faces  ends where the pressure is flat along some direction, with a frame that says so
  /// @return nothing where no point with p > 0 was found
  [[nodiscard]] std::optional<PeakFrame> climb(PairPressure& pressure, const Vec3& start, double extent, bool convex, bool stop_on_faces);
  /// The same where the peak lies on the common axis. @return nothing also where a pressure rises towards the other body
  [[nodiscard]] std::optional<PeakFrame> find_on_axis(PairPressure& pressure, const CommonAxis& axis, const Vec3& start, double extent);

 private:
  /// Second derivatives along two directions.
  struct Bends {
    double uu, uv, vv;
    [[nodiscard]] Bends mixed(const Bends& other, double share, double share_of_other) const {
      return {share * uu + share_of_other * other.uu, share * uv + share_of_other * other.uv, share * vv + share_of_other * other.vv};
    }
  };
  /// Unit tangents of Sigma and its normal, and the slope of p_A - p_B [Pa/m].
  struct Tangents {
    Vec3 u, v, axis;
    double steepness;
  };
  /// A step up along Sigma, and what the pressure gains by it.
  struct Ascent {
    Vec3 step;
    double gain, least_curvature;
  };
  static Ascent ascent(const Tangents& at, const Bends& curvature, double flattest, const Vec3& slope);
  std::optional<Vec3> first_axis(PairPressure& pressure, const Vec3& x, Vec3& axis);
  void look_around(PairPressure& pressure, const Vec3& x, const Vec3& u, const Vec3& v, double h);
  [[nodiscard]] Bends bends_of(int side, const Vec3& u, const Vec3& v, double h) const;
  static void set_frame(PairPressure& pressure, const Tangents& at, const Bends& curvature, const Bends& gap, double flattest, PeakFrame& frame);
  Vec3 foot_on_sigma(PairPressure& pressure, const Vec3& x, double reach);
  /// Point n of `batch_`, once that is evaluated.
  [[nodiscard]] StartPoint start_at(std::size_t n) const { return {batch_.point[n], batch_.slope_b[n] - batch_.slope_a[n]}; }

  PressureBatch batch_;
  std::vector<std::uint32_t> order_;
  std::vector<double> score_;
};

}  // namespace supple::collision
