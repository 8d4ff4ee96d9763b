/// @file apex.h
/// Columns through the space that a convex body loses to others, from one place of it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "numbers.h"
#include "surface/pair_pressure.h"

namespace supple::collision {

/// Where the columns of a body meet. Let w(x) be the way out of the apex times the integral of a density from x along it to where the body ends, each part
/// by how much the way has widened there: its divergence is minus the density, beside a source at the apex, and on the surface of a convex body w is 0. So
/// the integral over all that the body loses is the flux of w through Sigma (Gauss), whatever the shape of Sigma and however many bodies take their part;
/// where the apex is lost, too, the integral over the whole body comes to that.
struct Apex {
  Vec3 at = Vec3::Zero();  ///< the place; of parallel columns their way [unit]
  bool parallel = false;   ///< it is infinitely far
  bool lost = false;       ///< to the other body of the pair

  [[nodiscard]] Vec3 way(const Vec3& x) const { return parallel ? at : Vec3((x - at).normalized()); }
  [[nodiscard]] double distance(const Vec3& x) const { return parallel ? kInfinity : (x - at).norm(); }
};

/// Area across a column over the distance along it: a polynomial, whose factors are what the two curvatures of Sigma make of a step.
struct Swept {
  std::array<double, 3> of{};
  [[nodiscard]] double width(double t) const { return of[0] + t * (of[1] + t * of[2]); }
  [[nodiscard]] double widens(double t) const { return of[1] + 2.0 * t * of[2]; }
  [[nodiscard]] double volume(double t) const { return t * (of[0] + t * (0.5 * of[1] + t * of[2] / 3.0)); }
};
/// The same of a column out of an apex. @param flux  width where it leaves Sigma   @param bend  over the distance from the apex [1/m]
[[nodiscard]] inline Swept swept_out_of_apex(double flux, double bend) { return {{flux, 2.0 * bend * flux, bend * bend * flux}}; }

/// For a pair alone. @param from  a place of Sigma   @param outward  its normal out of the body   @return none of bodies that are not known to be convex
[[nodiscard]] std::optional<Apex> find_apex(PairPressure& pressure, int side, const Vec3& from, const Vec3& outward);

/// Which of the places that are farthest from Sigma.
enum class ApexRank : std::uint8_t { Best, Next };

/// For all pairs of a body whose space several others take: far from all their Sigma. @param others  that the body meets, in one order for all its pairs
/// @param taker  receives the place in `others` of the one that the apex is lost to, if it is   @return none of bodies that are not known to be convex
[[nodiscard]] std::optional<Apex> find_shared_apex(PairPressure& pressure, int side, Thirds others, ApexRank rank, std::size_t& taker);

/// Gauss points more along a column where it may go through most of the body.
inline constexpr int kMoreAcross = 2;

/// Points through all of a convex body as seen from the apex, and the volumes that they stand for; as many as `error` of the integral of the pressure asks.
void fill_body(PairPressure& pressure, int side, const Vec3& apex, double error, std::vector<Vec3>& point, std::vector<double>& volume);

}  // namespace supple::collision
