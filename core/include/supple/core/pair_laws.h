/// @file supple/core/pair_laws.h
/// The interactions between two oriented particles A and B as energies, each with force and torque from the full
/// gradient. r = x_B - x_A points from A to B, d = |r|; torques are about the particles' centres.
/// Any energy that is unchanged by a common translation and rotation gives F_A = -F_B and
/// r x F_B + tau_A + tau_B = 0 (docs/notation.md); every law here is such an energy and is tested for both.
#pragma once

#include "supple/core/particles.h"
#include "supple/core/types.h"

namespace supple::core {

/// Input of a pair law.
struct PairPose {
  Vec3 r = Vec3::Zero();              ///< x_B - x_A [m]
  Quat orientation_a = Quat::Identity();
  Quat orientation_b = Quat::Identity();
  Vec3 normal_a = Vec3::UnitZ();      ///< unit normals in world axes
  Vec3 normal_b = Vec3::UnitZ();
};

/// The pose of particles a (A) and b (B).
[[nodiscard]] inline PairPose pair_pose(const ParticleSet& set, const ParticleState& state, std::uint32_t a,
                                        std::uint32_t b) {
  return {.r = state.position[b] - state.position[a],
          .orientation_a = state.orientation[a],
          .orientation_b = state.orientation[b],
          .normal_a = state.orientation[a] * set.normal[a],
          .normal_b = state.orientation[b] * set.normal[b]};
}

/// Output of a pair law; the force on A is -force_b.
struct PairLoad {
  double energy = 0.0;                ///< [J]
  Vec3 force_b = Vec3::Zero();        ///< [N]
  Vec3 torque_a = Vec3::Zero();       ///< [N m]
  Vec3 torque_b = Vec3::Zero();       ///< [N m]
};

/// Weight psi(d): 1 for bonded pairs, or (1 - d^2/h^2)^3 inside the range h and 0 beyond; C^2.
struct Weight {
  double range = 0.0;                 ///< h [m]; 0 means psi = 1
  struct Value {
    double psi;
    double slope;                     ///< d psi / d d [1/m]
    double second;                    ///< d^2 psi / d d^2 [1/m^2]
    /// psi / d^2 and its derivatives; a factor 1/m^2 in every unit.
    [[nodiscard]] Value over_distance_squared(double distance) const;
  };
  [[nodiscard]] Value at(double distance) const;
};

/// Cohesion, Lombardo & Puech 1995 sec. 3: f(s) = F0 (1 - s)^3 / s exp(-a (1 - s)^2), s = d / r0, f > 0 repulsive.
/// F0 = E r0^2 and a = alpha r0^2 in the paper's symbols. The repulsion is monotone iff a <= 16/3.
struct Cohesion {
  double r0 = 0.0;  ///< rest distance [m], > 0
  double f0 = 0.0;  ///< E r0^2 [N], > 0
  double a = 4.0;   ///< alpha r0^2 [1], > 0

  /// From the paper's E [N/m^2] and alpha [1/m^2].
  [[nodiscard]] static Cohesion from_gain(double r0, double gain, double alpha);
  /// From the distance r_m > r0 of the largest attraction and its size F_max [N].
  /// a = (2 v + 3) / (2 v^2 (1 + v)), F0 = F_max (1 + v) / v^3 exp(a v^2), v = r_m / r0 - 1.
  [[nodiscard]] static Cohesion from_maximum(double r0, double r_m, double f_max);
  /// From F0 and the ratio r_m / r0 > 1: then f / F0 is one function of d / r0 for every rest distance.
  [[nodiscard]] static Cohesion from_ratio(double r0, double ratio, double f0);

  [[nodiscard]] double force(double distance) const;      ///< f [N]
  [[nodiscard]] double slope(double distance) const;      ///< df/dd [N/m]
  [[nodiscard]] double energy(double distance) const;     ///< U(d) - U(r0) [J], absolute error <= 1e-13 F0 r0
  [[nodiscard]] double binding_energy() const;            ///< U(inf) - U(r0) [J], closed form (Dawson and Ei)
  [[nodiscard]] double maximum_distance() const;          ///< r_m [m]: the only root beyond r0 of f' = 0
  [[nodiscard]] double influence_radius(double epsilon) const;  ///< r_c: |f| = epsilon F_max there, r_c > r_m [m]
};

/// Form (shape memory), Lombardo & Puech 1995 sec. 4 in its consistent, normalised form with one curvature per pair:
/// U = k psi(d) / d^2 |kappa r + n_A - n_B|^2. For a circular arc U = k psi (kappa' - kappa)^2 exactly.
struct Form {
  double strength = 0.0;   ///< k [J m^2]
  double curvature = 0.0;  ///< kappa [1/m]; > 0 convex, 0 flat, < 0 concave
  Weight weight;
  /// Least-squares curvature of a rest pose: kappa = r . (n_B - n_A) / d^2.
  [[nodiscard]] static double fit_curvature(const Vec3& r, const Vec3& normal_a, const Vec3& normal_b);
};

/// The same interaction with a radius, not normalised: U = k psi |r + R (n_A - n_B)|^2, a zero-length spring between the
/// two predicted centres of curvature x - R n.
struct FormRadius {
  double strength = 0.0;  ///< k [N/m]
  double radius = 0.0;    ///< R [m]
  Weight weight;
};

/// Exact shape memory of one bond: position of each particle in the other's frame, and their relative rotation.
/// U = k_s/4 (|r - Q_A d_A|^2 + |r + Q_B d_B|^2) + k_theta/2 |Q_A G_A - Q_B G_B|_F^2, G_X = Q_X0^T.
struct BondFrame {
  double stretch = 0.0;    ///< k_s [N/m]
  double rotation = 0.0;   ///< k_theta [N m]
  Vec3 rest_a = Vec3::Zero();          ///< d_A = Q_A0^T (x_B0 - x_A0) [m]
  Vec3 rest_b = Vec3::Zero();          ///< d_B = Q_B0^T (x_A0 - x_B0) [m]
  Quat rest_orientation_a = Quat::Identity();  ///< Q_A0
  Quat rest_orientation_b = Quat::Identity();  ///< Q_B0
  [[nodiscard]] static BondFrame from_rest(double stretch, double rotation, const PairPose& rest);
};

/// Co-planarity (Szeliski & Tonnesen 1992), once per direction: U = k psi ((n_A . r)^2 + (n_B . r)^2).
struct Coplanarity {
  double strength = 0.0;  ///< k [N/m]
  Weight weight;
};

/// The same, made independent of scale: psi / d^2 instead of psi (Lombardo & Puech 1995, footnote 6), as part of the
/// energy and differentiated with it.
struct NormalisedCoplanarity {
  double strength = 0.0;  ///< k [J]
  Weight weight;
};

/// Co-normality (Szeliski & Tonnesen 1992): U = k psi |n_A - n_B|^2.
struct CoNormality {
  double strength = 0.0;  ///< k [J]
  Weight weight;
};

/// Co-circularity (Szeliski & Tonnesen 1992): U = k psi ((n_A + n_B) . r)^2; zero on circles and spheres of any radius.
struct CoCircularity {
  double strength = 0.0;  ///< k [N/m]
  Weight weight;
};

/// Co-circularity with psi / d^2 instead of psi.
struct NormalisedCoCircularity {
  double strength = 0.0;  ///< k [J]
  Weight weight;
};

/// Exponential repulsion, force-shifted to vanish at the cut-off d_c = d0 + lambda ln(F_r / F_tol).
struct Repulsion {
  double force = 0.0;        ///< F_r [N], the (unshifted) force at d0
  double distance = 0.0;     ///< d0 [m]
  double length = 0.0;       ///< lambda [m], > 0
  double tolerance = 1e-3;   ///< F_tol / F_r [1]
  [[nodiscard]] double cut_off() const;  ///< d_c [m]
};

/// Energy, force and torques of one pair. @pre d > 0
[[nodiscard]] PairLoad evaluate(const Cohesion& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const Form& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const FormRadius& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const BondFrame& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const Coplanarity& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const NormalisedCoplanarity& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const CoNormality& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const CoCircularity& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const NormalisedCoCircularity& law, const PairPose& pose);
[[nodiscard]] PairLoad evaluate(const Repulsion& law, const PairPose& pose);

/// Upper bounds of the stiffness of a law near its rest pose, for the choice of the time step. The second variation of
/// U is at most translation |dx_B - dx_A|^2 when only positions change and 2 rotation (|dtheta_A|^2 + |dtheta_B|^2)
/// when only orientations do. Cohesion has no stiffness at rest: its steepest slope within r0/4 of rest is taken.
struct Stiffness {
  double translation = 0.0;  ///< [N/m]
  double rotation = 0.0;     ///< [N m/rad]
};
[[nodiscard]] Stiffness stiffness(const Cohesion& law);
[[nodiscard]] Stiffness stiffness(const Form& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const FormRadius& law);
[[nodiscard]] Stiffness stiffness(const BondFrame& law);
[[nodiscard]] Stiffness stiffness(const Coplanarity& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const NormalisedCoplanarity& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const CoNormality& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const CoCircularity& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const NormalisedCoCircularity& law, double rest_distance);
[[nodiscard]] Stiffness stiffness(const Repulsion& law);

}  // namespace supple::core
