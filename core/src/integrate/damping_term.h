// Friction between particles and stiffness damping in the incremental potential of an implicit step.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "integrate/step_hessian.h"
#include "supple/core/integrate.h"

namespace supple::core {

/// The damping of pairs, of positive semi-definite 12 x 12 matrices D of the predicted pose: with s the displacements and rotations of a pair since
/// the start, w its velocities there, the step minimises h / (2 t) v^T D v in addition, v = t s / h - (t - 1) w, so that the loads are -D v.
/// Damping acts in the same system as inertia and pair laws: half steps of it before and after the others would let modes that are damped faster than
/// dt relax at a rate that grows with dt, and one pair after the other would leave bodies damped too little.
/// Backward Euler has t = 1. Implicit midpoint has t = 1 + z^2 / (10 (1 + z^2)), z about the fastest rate times h: to second order the velocity in the
/// middle, and where dt is far too long for that, what is left of a velocity falls by 0.82 a step instead of swinging for ever.
class DampingTerm {
 public:
  /// @param predicted  the pose that D belongs to  @param h  from the start to the pose that the step solves for [s]
  void begin(const ParticleSet& set, const Interactions& interactions, const ParticleState& start, const ParticleState& predicted, double h,
             bool midpoint);
  void clear() {
    pair_.clear();
    coupled_.clear();
  }
  [[nodiscard]] bool empty() const { return pair_.empty(); }
  /// The two particles of each pair.
  [[nodiscard]] const std::vector<std::pair<std::uint32_t, std::uint32_t>>& coupled() const { return coupled_; }

  [[nodiscard]] double value(const ParticleState& pose);
  /// Adds the gradient in (displacement, rotation) of each particle, the rotation applied from the left, world axes.
  void add_gradient(const ParticleState& pose, Eigen::VectorXd& gradient);
  /// Adds t D / h, which leaves out how rotations of one step follow each other: Newton's method needs no more.
  /// @param first_pair  index of `coupled()[0]` in the list of the matrix
  void add_hessian(std::size_t first_pair, StepHessian& hessian) const;
  /// Adds the loads on particles at the pose, whose sums and moments vanish, and books what they take over `dt`.
  void finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger);

 private:
  using Vec12 = Eigen::Matrix<double, 12, 1, Eigen::DontAlign>;
  struct Damped {
    PairHessian matrix;
    Vec12 start = Vec12::Zero();  ///< velocities at the start
  };
  /// Moves all particles to the pose; does nothing where they are there.
  void place(const ParticleState& pose);
  /// Displacement and rotation of both particles of a pair since the start.
  [[nodiscard]] Vec12 moved(std::size_t k) const;
  [[nodiscard]] Vec12 velocity(const Damped& pair, const Vec12& moved) const { return factor_ / h_ * moved - (factor_ - 1.0) * pair.start; }

  const ParticleState* start_ = nullptr;
  double h_ = 0.0;
  double factor_ = 1.0;    ///< t
  bool midpoint_ = false;
  ParticleState placed_;   ///< places and orientations of the last call of `place`
  std::vector<Vec3> moved_, turned_;  ///< since the start, by particle, at the last call of `place` [m], [rad]
  std::vector<Damped> pair_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coupled_;
};

}  // namespace supple::core
