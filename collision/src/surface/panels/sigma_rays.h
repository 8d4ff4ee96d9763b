/// @file sigma_rays.h
/// The contact surface Sigma = {p_A = p_B} along parallel rays: where a ray meets it, and what is there.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/pair_pressure.h"

namespace supple::collision {

/// Orthonormal axes with an origin; coordinates in it are distances [m].
struct RayFrame {
  Vec3 origin = Vec3::Zero();
  std::array<Vec3, 3> axis{Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()};

  [[nodiscard]] Vec3 local(const Vec3& x) const {
    const Vec3 d = x - origin;
    return {axis[0].dot(d), axis[1].dot(d), axis[2].dot(d)};
  }
  [[nodiscard]] Vec3 world(const Vec3& y) const { return origin + y[0] * axis[0] + y[1] * axis[1] + y[2] * axis[2]; }
};

/// The axes across axis k, in the order that makes (u, v, k) right-handed.
[[nodiscard]] constexpr int first_across(int k) { return (k + 1) % 3; }
[[nodiscard]] constexpr int second_across(int k) { return (k + 2) % 3; }

/// A ray along axis `along`, through `at` in the plane of the two others, and its foot: the place where it meets Sigma.
struct SigmaRay {
  std::array<double, 2> at{};    ///< along the axes across [m]
  std::array<double, 2> place{};  ///< the same in the coordinates of the panel that it belongs to
  double height = 0.0;           ///< a guess, then that of the foot [m]
  double low = 0.0, high = 0.0;  ///< between which the foot is sought [m]
  std::array<double, 2> rise{};  ///< of Sigma over the plane [1]
  double pressure = 0.0;         ///< at the foot [Pa]
  std::array<double, 2> slope{};  ///< of the pressure, along Sigma over the plane [Pa/m]
  double step = 0.0;             ///< of Newton's method from the last place that was evaluated [m]
  double mismatch = 0.0;         ///< |p_A - p_B| there [Pa]
  double cosine = 0.0;           ///< between the normal and the axis, with the ray's sense
  Vec3 normal = Vec3::Zero();    ///< unit, out of A into B
  std::array<double, 2> fall{};  ///< of p_A along the ray's sense, of p_B against it [Pa/m]
  std::uint8_t along = 2;
  bool low_seen = false, high_seen = false;  ///< `low`, `high` have been evaluated: the foot is certainly between
  bool bracketed = false;        ///< signs at both ends of where it was sought first tell that there is one
  bool reverse = false;          ///< the axis leads out of B into A
  bool outside = false;          ///< neither body presses at the last place
  bool found = false;

  [[nodiscard]] double sense() const { return reverse ? -1.0 : 1.0; }
  [[nodiscard]] Vec3 local(double z) const {
    Vec3 y;
    y[first_across(along)] = at[0];
    y[second_across(along)] = at[1];
    y[along] = z;
    return y;
  }
  /// Derivative of the foot's place over the plane, by coordinate i of the plane [world].
  [[nodiscard]] Vec3 tangent(const RayFrame& frame, std::size_t i) const {
    return frame.axis[static_cast<std::size_t>(i == 0 ? first_across(along) : second_across(along))] + rise[i] * frame.axis[along];
  }
};

/// A pair as its rays need it.
struct SigmaView {
  PairPressure& pressure;
  RayFrame frame;
  double reach = 0.0;  ///< longest step that is believed [m]
};

/// Room of `probe` and `lift`.
struct RayScratch {
  PressureBatch batch;
  std::vector<std::uint32_t> open;
};

/// Evaluates both bodies once on the rays `which`, at their heights, and puts there what a step of Newton's method along the ray says of the foot: all but
/// `height`, which stays, and `found`.
void probe(SigmaView& view, std::span<SigmaRay> rays, std::span<const std::uint32_t> which, RayScratch& scratch);

/// Newton's method along the rays, safeguarded by halving, from their heights. Along a ray p_A falls and p_B rises; where neither presses, the search ends.
/// @param enough  length of a step after which the rest of the way is of no account [m]
void lift(SigmaView& view, std::span<SigmaRay> rays, double enough, RayScratch& scratch);

}  // namespace supple::collision
