/// @file supple/core/cohesion_variants.h
/// Variants of the cohesion law (`Cohesion` in pair_laws.h), which Lombardo & Puech 1995 name in sec. 3 or leave as
/// future work: with linear stiffness, with a rest distance that depends on direction, and from a table.
/// s = d / r0 and v = s - 1 throughout.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "supple/core/pair_laws.h"

namespace supple::core {

/// f = -F0 v (eta + v^2) exp(-a v^2): finite at d = 0, with an energy in closed form and, for eta > 0, the stiffness
/// F0 eta / r0 at rest that cohesion lacks.
struct LinearCohesion {
  double r0 = 0.0;   ///< rest distance [m], > 0
  double f0 = 0.0;   ///< F0 [N], > 0
  double a = 4.0;    ///< [1], > 0
  double eta = 0.0;  ///< [1], >= 0

  [[nodiscard]] double force(double distance) const;            ///< f [N]
  [[nodiscard]] double slope(double distance) const;            ///< df/dd [N/m]
  [[nodiscard]] double energy(double distance) const;           ///< U(d) - U(r0) [J]
  [[nodiscard]] double binding_energy() const;                  ///< U(inf) - U(r0) = F0 r0 (eta / 2a + 1 / 2a^2) [J]
  [[nodiscard]] double maximum_distance() const;                ///< r_m [m], of the largest attraction
  [[nodiscard]] double influence_radius(double epsilon) const;  ///< where |f| = epsilon F_max beyond r_m [m]
};

/// Cohesion between ellipsoids that turn with the particles: U = W(d / r0) with r0 = rho_A(r/d) + rho_B(-r/d), where
/// rho(u) = |D Q^T u| is the distance of an ellipsoid's tangent plane of outward normal u from its centre and W is the
/// energy of `Cohesion` with rest distance 1. Torques turn the particles towards the orientation of least energy.
struct DirectedCohesion {
  double scale = 0.0;                 ///< F0 r0 [J], > 0
  double a = 4.0;                     ///< [1], > 0
  Vec3 semi_axes_a = Vec3::Zero();    ///< D of A along its body axes [m], > 0
  Vec3 semi_axes_b = Vec3::Zero();    ///< D of B [m], > 0

  [[nodiscard]] double rest_distance(const PairPose& pose) const;  ///< r0 along r [m]
};

/// Cohesion force from a table ("easily tabulated", Lombardo & Puech 1995, sec. 3) over equal intervals of s. The
/// table's energy is the exact integral of the interpolated force, so that energy is conserved as without a table.
class CohesionTable {
 public:
  enum class Interpolation : std::uint8_t {
    Linear,       ///< error of order 2 in the interval; continuous force
    CubicHermite  ///< order 4; force with continuous slope
  };
  /// As many intervals (a power of two) as the error needs. The table covers s >= 1/4, nearer the law is evaluated
  /// directly, and ends, with zero force, where the attraction has fallen to a quarter of the error.
  /// @param error  largest error of the force over F_max, in [1e-9, 0.1]
  [[nodiscard]] static CohesionTable with_error(double a, double error,
                                                Interpolation interpolation = Interpolation::CubicHermite);
  [[nodiscard]] static CohesionTable with_intervals(double a, double end, int intervals, Interpolation interpolation);

  [[nodiscard]] double force(double s) const;   ///< f / F0
  [[nodiscard]] double slope(double s) const;   ///< df/ds / F0
  [[nodiscard]] double energy(double s) const;  ///< U / (F0 r0), 0 at s = 1
  [[nodiscard]] double a() const { return law_.a; }
  [[nodiscard]] int intervals() const { return static_cast<int>(piece_.size()) - 1; }
  [[nodiscard]] double end() const { return end_; }  ///< s from which the force is 0

 private:
  struct alignas(32) Piece {
    std::array<double, 4> coefficient;  ///< f / F0 as a polynomial of the share t in [0, 1] of the interval
  };
  struct Place {
    std::size_t piece;
    double t;
  };
  [[nodiscard]] Place place_of(double s) const;
  [[nodiscard]] double integral(const Place& place) const;  ///< of f / F0 from the beginning of the table

  Cohesion law_;                ///< in units F0 = r0 = 1
  double end_ = 0.0;
  double interval_ = 0.0;
  std::vector<Piece> piece_;    ///< shape [intervals + 1]; the last, beyond the end, is zero
  std::vector<double> begun_;   ///< integral up to each piece, shape [intervals + 1]
  double at_rest_ = 0.0;        ///< integral up to s = 1
};

/// Cohesion by a table, which many bonds share.
struct TabulatedCohesion {
  double r0 = 0.0;  ///< [m], > 0
  double f0 = 0.0;  ///< F0 [N], > 0
  std::shared_ptr<const CohesionTable> table;

  [[nodiscard]] double force(double distance) const { return f0 * table->force(distance / r0); }
  [[nodiscard]] double slope(double distance) const { return f0 / r0 * table->slope(distance / r0); }
  [[nodiscard]] double energy(double distance) const { return f0 * r0 * table->energy(distance / r0); }
};

/// Energy, force and torques of one pair. @pre d > 0
[[nodiscard]] PairLoad evaluate(const LinearCohesion& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const DirectedCohesion& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const TabulatedCohesion& law, const PairPose& pose);

/// As for `Cohesion`: of the steepest slope within r0/4 of rest.
[[nodiscard]] Stiffness stiffness(const LinearCohesion& law);
[[nodiscard]] Stiffness stiffness(const DirectedCohesion& law);
[[nodiscard]] Stiffness stiffness(const TabulatedCohesion& law);

}  // namespace supple::core
