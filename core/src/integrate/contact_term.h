// Contact in the incremental potential of an implicit step.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "integrate/contact_lanes.h"
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

/// The contact points of one step. Order of calls: `begin`; then `lag_friction` and the others at any poses; `finish`.
/// Friction is a sum of norms of slips, mollified at speeds far below the visible, where Newton's own corrections would be cut short. Its directions are unknowns of
/// their own, eliminated from the matrix, and lag behind the slips by one correction at most (primal-dual method of Chan, Golub and Mulet 1999).
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
  void add_hessian(const ParticleState& pose, std::size_t first_pair, StepHessian& hessian);
  /// Directions of friction after this correction of the pose of the last `add_hessian`. @return the largest change of a slip, over the
  /// speed below which its friction fades out [1]
  double predict_friction(const Eigen::VectorXd& correction);
  /// Goes this share of the way to the predicted directions.
  void turn_friction(double share);

  /// Touched particles, ascending, and the least speed below which friction on each fades out [m/s].
  [[nodiscard]] const std::vector<std::uint32_t>& touched() const { return touched_; }
  [[nodiscard]] const std::vector<double>& least_stick_speed() const { return least_stick_; }

  /// Adds the loads on particles at the pose; books what obstacles get and do, and what damping and friction take over `dt`.
  void finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger, std::vector<ContactPairLoad>& pairs);

 private:
  /// Points of one pair with the same particles and shares, which move as one rigid body.
  struct Group {
    std::uint32_t begin = 0, end = 0;              ///< points
    std::uint32_t entry_begin = 0, entry_end = 0;  ///< particles and shares of all of them
    std::uint32_t block = 0;                       ///< of its first pair of entries
    std::uint32_t pair = 0;
    Vec3 origin = Vec3::Zero();                    ///< its first point [m]
    LaneGroup lanes;
    Twist twist{};                                 ///< of A relative to B since the start, at the last call of `place`
  };
  void find_touched(std::size_t particles);
  void find_groups();
  void fill_lanes(const ParticleSet& set, const ParticleState& predicted);
  void find_stick_speeds(const SlowSlip& slow);
  void find_coupled();
  /// Sums of pressures, without damping, over those at the predicted pose, by pair.
  void scale_splits();
  /// Moves touched particles and points to the pose; does nothing where they are there.
  void place(const ParticleState& pose);
  [[nodiscard]] bool is_at(const ParticleState& pose) const;
  /// Sign of an obstacle's velocity in that of A relative to B; 0: none.
  [[nodiscard]] double leads(const Group& group) const;
  /// Adds a stiffness about one origin of a group's points.
  void spread(const Group& group, const Mat6& stiffness);

  const ContactPoints* points_ = nullptr;
  const ParticleState* start_ = nullptr;
  StepRule rule_;
  std::vector<double> stick_speed_;      // below which friction fades out, by pair [m/s]
  std::vector<std::uint32_t> touched_;   // particles, ascending
  std::vector<std::uint32_t> rank_;      // index into `touched_`, by particle, where it is touched
  std::vector<double> least_stick_;      // of the pairs of each touched particle [m/s]
  std::vector<std::uint32_t> entry_;     // index into `touched_`, by entry of the rows
  std::vector<Group> groups_;
  std::vector<Vec3> arm_;                // from the centres of its particles to a group's origin at the predicted pose, by entry of the group
  ContactLanes lanes_;
  std::vector<std::uint32_t> split_entry_;  // index into `touched_`, of each load within bodies
  std::vector<Vec3> split_place_;        // centre of its particle at the predicted pose [m]
  std::vector<double> split_base_;       // normal force at the predicted pose, without damping, by pair [N]
  std::vector<double> split_scale_;      // by pair, lagged [1]
  std::vector<Pose> placed_;             // of the touched particles, at the last call of `place`
  std::vector<Vec3> moved_, turned_;     // since the start, by touched particle [m], [rad]
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coupled_;
  std::vector<std::uint32_t> block_;     // of each pair of entries of each group, in order: into `coupled_`, or touched particle on the diagonal
  std::vector<Mat6> diagonal_, off_diagonal_;
};

/// Inverse of the right Jacobian of the exponential: log(exp(delta) exp(phi)) = delta + J_r^-1 phi + O(phi^2).
[[nodiscard]] Mat3 inverse_right_jacobian(const Vec3& delta);

}  // namespace supple::core
