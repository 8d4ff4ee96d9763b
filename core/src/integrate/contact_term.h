// Contact in the incremental potential of an implicit step.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "integrate/step_hessian.h"
#include "supple/core/compliant_contact.h"
#include "supple/core/integrate.h"

namespace supple::core {

/// A step of an implicit rule: the pose it solves for lies h after the start, and velocities at the end of the step are
/// `end_factor` u / h - (end_factor - 1) v, u the displacement until that pose and v the velocity at the start. Friction acts against the
/// velocity with `slip_factor` in place of `end_factor`.
struct StepRule {
  double h = 0.0;           ///< [s]
  double end_factor = 1.0;  ///< 1: backward Euler; 2: implicit midpoint
  double slip_factor = 1.0; ///< 1: at the pose that is solved for
};

/// Which slips count as sticking: slower ones than `speed` [m/s], or than this share of the pair's relative speed [1].
struct SlowSlip {
  double speed = 1.0;
  double share = 1e-3;
};

/// How friction enters the matrix. Both have the gradient of the potential; the majorant (of the weights of iteratively reweighted least squares) bounds it from
/// above, so that its corrections need no line search, and Newton's own is the faster one near the minimum.
enum class FrictionHessian : std::uint8_t { Exact, Majorant };

/// The contact points of one step. Order of calls: `begin`; then `lag_friction` and the others at any poses; `finish`.
class ContactTerm {
 public:
  /// @param predicted  the pose of `points`  @param start  at the begin of the step
  void begin(const ParticleSet& set, const ContactPoints& points, const ParticleState& start, const ParticleState& predicted,
             const StepRule& rule, const SlowSlip& slow);
  [[nodiscard]] bool empty() const { return points_ == nullptr || points_->point.empty(); }
  /// Pairs of particles that touch the same points, first < second.
  [[nodiscard]] const std::vector<std::pair<std::uint32_t, std::uint32_t>>& coupled() const { return coupled_; }

  /// Friction acts with the normal forces at this pose from here on. @return their change, over their sum [1]
  double lag_friction(const ParticleState& pose);
  [[nodiscard]] double value(const ParticleState& pose);
  /// Adds the gradient in (displacement, rotation) of each particle, the rotation applied from the left, world axes.
  void add_gradient(const ParticleState& pose, Eigen::VectorXd& gradient);
  /// Adds the positive semi-definite Hessian at the pose. @param first_pair  index of `coupled()[0]` in the list of the matrix
  void add_hessian(const ParticleState& pose, std::size_t first_pair, FrictionHessian friction, StepHessian& hessian);
  /// Largest displacement of a point of a sliding or sticking pair by a correction, over what sticks within a step [1].
  [[nodiscard]] double stick_ratio(const Eigen::VectorXd& correction) const;

  /// Adds the loads on particles at the pose; books what obstacles get and do, and what damping and friction take over `dt`.
  void finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger, std::vector<ContactPairLoad>& pairs);

 private:
  struct Traction {
    Vec3 force = Vec3::Zero();       ///< on A, of pressure alone, without damping [N]
    Vec3 dissipative = Vec3::Zero();  ///< on A [N]
  };
  void find_touched();
  void find_stick_speeds(const SlowSlip& slow);
  void find_coupled();
  /// Sums of pressures, without damping, over those at the predicted pose, by pair.
  void scale_splits();
  /// Moves touched particles and points to the pose; does nothing where they are there.
  void place(const ParticleState& pose);
  [[nodiscard]] bool is_at(const ParticleState& pose) const;
  [[nodiscard]] Vec3 displacement_of(std::size_t q) const;
  /// Adds a stiffness about one origin, its lower left block left out, of points with the entries of point q, to the blocks of its particles. @param block  of the first pair of entries
  void spread(std::size_t q, std::size_t block, const Mat6& stiffness);
  [[nodiscard]] Vec3 slip(std::size_t q, const Vec3& u) const;
  [[nodiscard]] double normal_force(std::size_t q, double approach) const;
  [[nodiscard]] double normal_potential(std::size_t q, double approach) const;
  [[nodiscard]] double normal_stiffness(std::size_t q, double approach) const;
  [[nodiscard]] Vec3 gradient_of(std::size_t q, const Vec3& u) const;
  [[nodiscard]] Mat3 hessian_of(std::size_t q, const Vec3& u, FrictionHessian friction) const;
  [[nodiscard]] Traction traction_of(std::size_t q, const Vec3& u) const;

  const ContactPoints* points_ = nullptr;
  const ParticleState* start_ = nullptr;
  StepRule rule_;
  std::vector<double> stick_speed_;      // below which friction fades out, by pair [m/s]
  std::vector<std::uint32_t> touched_;   // particles, ascending
  std::vector<std::uint32_t> entry_;     // index into `touched_`, by entry of the rows
  std::vector<Vec3> arm_;                // X - x_k at the predicted pose, by entry
  std::vector<double> offset_pressure_;  // p - g u_p . n [Pa], by point
  std::vector<Vec3> start_velocity_;     // relative, at the begin, by point [m/s]
  std::vector<double> lagged_;           // normal force, by point [N]
  std::vector<std::uint32_t> split_entry_;  // index into `touched_`, of each load within bodies
  std::vector<Vec3> split_place_;        // centre of its particle at the predicted pose [m]
  std::vector<double> split_scale_;      // by pair, lagged [1]
  std::vector<std::uint32_t> pair_of_;   // by point
  std::vector<Pose> placed_;             // of the touched particles, at the last call of `place`
  std::vector<Vec3> moved_, turned_;     // since the start, by touched particle [m], [rad]
  std::vector<Vec3> displacement_;       // of A relative to B since the start, by point [m]
  std::vector<std::uint8_t> as_last_;    // by point: its particles and their shares are those of the point before it
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coupled_;
  std::vector<std::uint32_t> block_;     // of each pair of entries of each row, in order: into `coupled_`, or touched particle on the diagonal
  std::vector<Mat6> diagonal_, off_diagonal_;
};

/// Inverse of the right Jacobian of the exponential: log(exp(delta) exp(phi)) = delta + J_r^-1 phi + O(phi^2).
[[nodiscard]] Mat3 inverse_right_jacobian(const Vec3& delta);

}  // namespace supple::core
