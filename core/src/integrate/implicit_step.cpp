#include "integrate/implicit_step.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrate/step.h"
#include "laws/damping.h"
#include "laws/pair_hessians.h"

namespace supple::core {
namespace {

void turn(Quat& q, const Vec3& rotation) {
  q = rotation_exp(rotation) * q;
  q.coeffs() *= 1.5 - 0.5 * q.squaredNorm();
}

/// The incremental potential about one state, over one step h.
class StepPotential {
 public:
  StepPotential(const ParticleSet& set, const Interactions& interactions, const Executor& executor, double h,
                InteractionWorkspace& pairs, ImplicitBuffers& buffers)
      : set_(set), interactions_(interactions), executor_(executor), h_(h), pairs_(pairs), buffers_(buffers) {}

  [[nodiscard]] double value(const ParticleState& pose) const {
    double inertial = 0.0;
    for (std::size_t i = 0; i < set_.size(); ++i) {
      if (!holds_position(set_, i)) {
        inertial += set_.mass[i] * (pose.position[i] - buffers_.flight.position[i]).squaredNorm();
      }
      if (!holds_orientation(set_, i)) {
        const Vec3 delta = turned(pose, i);
        inertial += delta.dot(set_.inertia[i].cwiseProduct(delta));
      }
    }
    return 0.5 / (h_ * h_) * inertial + potential_energy(set_, pose, interactions_) + buffers_.damping.value(pose) + buffers_.contact.value(pose);
  }

  /// Computes the loads of the pair laws in `buffers.laws` and the gradient in `buffers.gradient`.
  void differentiate(const ParticleState& pose) {
    const std::size_t n = set_.size();
    buffers_.laws.reset(n);
    accumulate_interactions(set_, pose, interactions_, executor_, pairs_, buffers_.laws);
    buffers_.gradient.setZero(static_cast<Eigen::Index>(6 * n));
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = static_cast<Eigen::Index>(6 * i);
      if (!holds_position(set_, i)) {
        const Vec3 inertial = set_.mass[i] / (h_ * h_) * (pose.position[i] - buffers_.flight.position[i]);
        buffers_.gradient.segment<3>(row) = free_translation(set_.pinned[i], inertial - buffers_.laws.force[i]);
      }
      if (!holds_orientation(set_, i)) {
        const Vec3 delta = turned(pose, i);
        const Vec3 inertial =
            inverse_right_jacobian(delta).transpose() * (1.0 / (h_ * h_) * set_.inertia[i].cwiseProduct(delta));
        buffers_.gradient.segment<3>(row + 3) =
            free_rotation(set_.pinned[i], pose.orientation[i] * inertial - buffers_.laws.torque[i]);
      }
    }
    if (buffers_.contact.empty() && buffers_.damping.empty()) return;
    buffers_.damping.add_gradient(pose, buffers_.gradient);
    buffers_.contact.add_gradient(pose, buffers_.gradient);
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = static_cast<Eigen::Index>(6 * i);
      buffers_.gradient.segment<3>(row) = free_translation(set_.pinned[i], buffers_.gradient.segment<3>(row));
      buffers_.gradient.segment<3>(row + 3) = free_rotation(set_.pinned[i], buffers_.gradient.segment<3>(row + 3));
    }
  }

  /// The last correction as a change of the velocity of each particle, turns at a distance of `length`, over the speed below which friction on it fades out: the
  /// largest. Particles that touch nothing pass motion on to those that do.
  [[nodiscard]] double over_stick_speed(double length) const {
    const std::vector<std::uint32_t>& touched = buffers_.contact.touched();
    const std::vector<double>& stick = buffers_.contact.least_stick_speed();
    if (touched.empty()) return 0.0;
    const double least = *std::min_element(stick.begin(), stick.end());
    double largest = 0.0;
    std::size_t t = 0;
    for (std::size_t i = 0; i < set_.size(); ++i) {
      while (t < touched.size() && touched[t] < i) ++t;
      const bool touches = t < touched.size() && touched[t] == i;
      const auto row = static_cast<Eigen::Index>(6 * i);
      const double moved = std::max(buffers_.correction.segment<3>(row).norm(), length * buffers_.correction.segment<3>(row + 3).norm());
      largest = std::max(largest, moved / (touches ? stick[t] : least));
    }
    return largest / h_;
  }

  /// Whether the forces that the last `differentiate` left over change the velocity of each particle, turns at a distance of `length`, by at most
  /// `of_stick` of the speed below which friction on it fades out. Particles that touch nothing pass motion on to those that do.
  [[nodiscard]] bool leaves_less_than(double of_stick, double length) const {
    const std::vector<std::uint32_t>& touched = buffers_.contact.touched();
    const std::vector<double>& stick = buffers_.contact.least_stick_speed();
    if (touched.empty()) return true;
    const double least = *std::min_element(stick.begin(), stick.end());
    std::size_t t = 0;
    for (std::size_t i = 0; i < set_.size(); ++i) {
      while (t < touched.size() && touched[t] < i) ++t;
      const bool touches = t < touched.size() && touched[t] == i;
      const double most = of_stick * (touches ? stick[t] : least) / h_;
      const auto row = static_cast<Eigen::Index>(6 * i);
      const double push2 = (1.0 / set_.mass[i] * buffers_.gradient.segment<3>(row)).squaredNorm();
      const double spin2 = (buffers_.pose.orientation[i].conjugate() * Vec3(buffers_.gradient.segment<3>(row + 3))).cwiseQuotient(set_.inertia[i]).squaredNorm();
      if (!(std::max(push2, length * length * spin2) <= most * most)) return false;
    }
    return true;
  }

  /// Solves H correction = -gradient. The exact Hessian is taken where it is positive definite.
  /// @param renew  false: with the Hessian of the last call
  void solve(const IntegratorSettings& settings, const ParticleState& pose, bool renew, StepReport& report) {
    const bool direct = 6 * set_.size() <= static_cast<std::size_t>(settings.direct_unknowns);
    if (direct && !renew) {
      buffers_.correction = buffers_.solver.solve(-buffers_.gradient);
      return;
    }
    for (const HessianKind kind : {HessianKind::Exact, HessianKind::PositiveSemiDefinite}) {
      if (kind == HessianKind::PositiveSemiDefinite || direct) assemble(pose, kind);
      if (!direct || !buffers_.solver.factorise(buffers_.hessian)) continue;
      buffers_.correction = buffers_.solver.solve(-buffers_.gradient);
      return;
    }
    report.gradient_iterations +=
        StepSolver::solve_iteratively(buffers_.hessian, -buffers_.gradient, buffers_.correction);
  }

  /// Rotation from free flight, body axes.
  [[nodiscard]] Vec3 turned(const ParticleState& pose, std::size_t i) const {
    return rotation_log(buffers_.flight.orientation[i].conjugate() * pose.orientation[i]);
  }

 private:
  void assemble(const ParticleState& pose, HessianKind kind) {
    buffers_.bonded.clear();
    buffers_.blocks.clear();
    for_each_hessian(set_, pose, interactions_, kind, [this](std::uint32_t a, std::uint32_t b, const PairHessian& h) {
      buffers_.bonded.emplace_back(a, b);
      buffers_.blocks.push_back(h);
    });
    const std::vector<std::pair<std::uint32_t, std::uint32_t>>&damped = buffers_.damping.coupled(), &coupled = buffers_.contact.coupled();
    buffers_.bonded.insert(buffers_.bonded.end(), damped.begin(), damped.end());
    if (!buffers_.contact.empty()) buffers_.bonded.insert(buffers_.bonded.end(), coupled.begin(), coupled.end());
    buffers_.hessian.begin(set_.pinned, buffers_.bonded);
    for (std::size_t i = 0; i < set_.size(); ++i) {
      const Mat3 jacobian = inverse_right_jacobian(turned(pose, i)) * pose.orientation[i].conjugate().toRotationMatrix();
      Mat6 h = Mat6::Zero();
      h.topLeftCorner<3, 3>() = set_.mass[i] / (h_ * h_) * Mat3::Identity();
      h.bottomRightCorner<3, 3>() =
          jacobian.transpose() * (1.0 / (h_ * h_) * set_.inertia[i]).asDiagonal() * jacobian;
      buffers_.hessian.add_particle(static_cast<std::uint32_t>(i), h);
    }
    for (std::size_t k = 0; k < buffers_.blocks.size(); ++k) buffers_.hessian.add_pair(k, buffers_.blocks[k]);
    buffers_.damping.add_hessian(buffers_.blocks.size(), buffers_.hessian);
    buffers_.contact.add_hessian(pose, buffers_.blocks.size() + damped.size(), buffers_.hessian);
  }

  const ParticleSet& set_;
  const Interactions& interactions_;
  const Executor& executor_;
  double h_;
  InteractionWorkspace& pairs_;
  ImplicitBuffers& buffers_;
};

/// Size of a correction: positions over `length`, angles in radians.
double size_of(const Eigen::VectorXd& correction, double length) {
  double largest2 = 0.0;
  for (Eigen::Index row = 0; row < correction.size(); row += 6) {
    const double size2 = std::max(correction.segment<3>(row).squaredNorm() / (length * length),
                                  correction.segment<3>(row + 3).squaredNorm());
    if (!(size2 <= largest2)) largest2 = size2;
    if (!std::isfinite(largest2)) break;
  }
  return std::sqrt(largest2);
}

double largest_angle(const Eigen::VectorXd& correction) {
  double largest2 = 0.0;
  for (Eigen::Index row = 3; row < correction.size(); row += 6) {
    largest2 = std::max(largest2, correction.segment<3>(row).squaredNorm());
  }
  return std::sqrt(largest2);
}

/// Whether a correction is lost in the rounding of the pose.
bool is_rounding(const Eigen::VectorXd& correction, const ParticleState& pose) {
  constexpr double kRounding = 2.0 * std::numeric_limits<double>::epsilon();
  double far = 0.0, moved = 0.0, turned = 0.0;
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(6 * i);
    far = std::max(far, pose.position[i].cwiseAbs().maxCoeff());
    moved = std::max(moved, correction.segment<3>(row).cwiseAbs().maxCoeff());
    turned = std::max(turned, correction.segment<3>(row + 3).cwiseAbs().maxCoeff());
  }
  return moved <= kRounding * far && turned <= kRounding;
}

void move(const ParticleState& pose, const Eigen::VectorXd& correction, double share, ParticleState& out) {
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(6 * i);
    out.position[i] = pose.position[i] + share * correction.segment<3>(row);
    out.orientation[i] = pose.orientation[i];
    const Vec3 rotation = share * correction.segment<3>(row + 3);
    if (rotation != Vec3::Zero()) turn(out.orientation[i], rotation);
  }
}

/// Newton's method from `buffers.pose`, which ends at the minimum; `buffers.laws` are the loads there.
/// @param value  of the potential there
void minimise(const IntegratorSettings& settings, double value, StepPotential& potential, ImplicitBuffers& buffers, StepReport& report) {
  constexpr double kDescent = 1e-4;      // Armijo's share of the descent that the gradient promises
  constexpr double kRoundOff = 1e-14;    // of the potential
  constexpr double kLargestTurn = 0.5;   // [rad] in one correction
  constexpr int kMostHalvings = 30;
  constexpr double kKept = 0.1;          // of the correction before
  constexpr int kMostLags = 8;           // times that friction follows the normal forces
  constexpr double kOfStickSpeed = 5e-3; // of velocities at the end of a step, which tell what holds to a hundredth of the friction
  constexpr double kLastSlips = 5e-4;    // of the stick speed, in a correction: Newton leaves about the square of it, in friction too, which pushes what rests
  constexpr double kLagged = 1e-3;       // of all normal forces: a smaller change does not update friction
  report.within_tolerance = false;
  int lags = 0;
  const auto begin_at_pose = [&] {
    if (lags < kMostLags) {
      const double before = buffers.contact.value(buffers.pose);
      lags = buffers.contact.lag_friction(buffers.pose) > kLagged ? lags + 1 : kMostLags;
      value += buffers.contact.value(buffers.pose) - before;  // of the friction that follows the normal forces
    }
    potential.differentiate(buffers.pose);
  };
  begin_at_pose();
  bool renew = true;
  double before = 0.0;  // size of the correction before
  for (int iteration = 0; iteration < settings.max_iterations; ++iteration) {
    if ((buffers.gradient.array() == 0.0).all()) {
      report.last_correction = 0.0;
      report.within_tolerance = true;
      return;
    }
    potential.solve(settings, buffers.pose, renew, report);
    ++report.newton_iterations;
    report.last_correction = size_of(buffers.correction, settings.length);
    if (!std::isfinite(report.last_correction)) return;
    // The Hessian is kept while corrections fall fast with it. Where bodies touch it changes from pose to pose.
    renew = !buffers.contact.empty() || (iteration > 0 && report.last_correction > kKept * before);
    before = report.last_correction;

    // The gain of a small correction may be less than the potential's rounding errors.
    const double slips = buffers.contact.predict_friction(buffers.correction);
    const bool small = report.last_correction <= settings.tolerance;
    const bool sure = small && slips <= kOfStickSpeed;
    // Friction is so steep in the slip that forces, and with them velocities, may err where the pose does not. Its directions are not known before the second
    // correction.
    const bool last = small && (buffers.contact.empty() || (iteration > 0 && std::max(slips, potential.over_stick_speed(settings.length)) <= kLastSlips));
    const double slope = buffers.gradient.dot(buffers.correction);
    const double angle = largest_angle(buffers.correction);
    double share = angle > kLargestTurn ? kLargestTurn / angle : 1.0;
    bool found = false;
    double next = value;
    for (int halving = 0; halving < kMostHalvings; ++halving) {
      move(buffers.pose, buffers.correction, share, buffers.trial);
      if (!last) next = potential.value(buffers.trial);
      found = sure || next <= value + kDescent * share * slope + kRoundOff * std::abs(value);
      if (found) break;
      share *= 0.5;
    }
    if (!found) return;
    buffers.contact.turn_friction(share);
    std::swap(buffers.pose, buffers.trial);
    value = next;
    begin_at_pose();
    if (last || (small && (potential.leaves_less_than(kOfStickSpeed, settings.length) || is_rounding(buffers.correction, buffers.pose)))) {
      report.within_tolerance = true;
      return;
    }
  }
}

/// Of implicit midpoint: friction acts against the slip a little after the middle of the step. At the middle itself what sticks would swing to and fro for
/// ever, by what it slid in its last step; so it fades by 0.82 a step. At the end friction would be of first order only, as arms and normals are those of the
/// middle.
constexpr double kSlipFactor = 1.1;

/// Free flight from `state` over h under frozen loads, to `out`.
void fly(const ParticleSet& set, const ParticleState& state, const Loads& frozen, double h, ParticleState& out) {
  for (std::size_t i = 0; i < set.size(); ++i) {
    out.velocity[i] = state.velocity[i];
    out.angular_momentum[i] = state.angular_momentum[i];
    out.position[i] = state.position[i];
    out.orientation[i] = state.orientation[i];
    if (!holds_position(set, i)) {
      out.position[i] += h * (state.velocity[i] + h / set.mass[i] * free_translation(set.pinned[i], frozen.force[i]));
    }
    const Vec3 momentum = state.angular_momentum[i] + h * free_rotation(set.pinned[i], frozen.torque[i]);
    if (!holds_orientation(set, i) && momentum != Vec3::Zero()) {
      rotate_free(out.orientation[i], momentum, set.inertia[i], h);
    }
  }
}

/// Loads outside the pair laws, at the pose of `at` and the time `time`; external loads are kept in `buffers.sample`.
void freeze(const StepProblem& problem, double time, const ParticleState& at, const StepTools& tools, ImplicitBuffers& buffers) {
  const std::size_t n = problem.set.size();
  evaluate(problem.forces, at, time, buffers.sample);
  buffers.laws.reset(n);
  accumulate_interactions(problem.set, at, problem.interactions, tools.executor, tools.pairs, buffers.laws);
  buffers.frozen.reset(n);
  const ForceSample& sample = buffers.sample;
  for (std::size_t i = 0; i < n; ++i) {
    buffers.frozen.force[i] = sample.internal.force[i] - buffers.laws.force[i] + sample.external.force[i];
    buffers.frozen.torque[i] = sample.internal.torque[i] - buffers.laws.torque[i] + sample.external.torque[i];
  }
}

/// Sets `buffers.pose` to that of least potential of three: free flight; the start, where bonds are stiff; the start moved on by its velocities, where bodies rest on others. @return its potential
double guess(const StepProblem& problem, double time, double h, const StepPotential& potential, ImplicitBuffers& buffers) {
  buffers.pose = buffers.flight;
  double least = potential.value(buffers.flight);
  const auto offer = [&](const ParticleState& pose) {
    const double value = potential.value(pose);
    if (!(value < least)) return;
    least = value;
    buffers.pose = pose;
  };
  buffers.trial = buffers.start;
  place_led(problem, time, buffers.trial);
  offer(buffers.trial);
  if (buffers.contact.empty()) return least;
  Loads none;
  none.reset(problem.set.size());
  fly(problem.set, buffers.start, none, h, buffers.trial);
  place_led(problem, time, buffers.trial);
  offer(buffers.trial);
  return least;
}

/// Momenta after dt under the loads at `buffers.pose`; books impulses and, by the way from `start` to `state`, works.
void finish(const ParticleSet& set, const ParticleState& start, double dt, const ImplicitBuffers& buffers,
            ParticleState& state, Ledger& ledger) {
  const ForceSample& sample = buffers.sample;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vec3& external = sample.external.force[i];
    const Vec3& external_torque = sample.external.torque[i];
    ledger.external_impulse += dt * external;
    ledger.external_angular_impulse += dt * (buffers.pose.position[i].cross(external) + external_torque);
    state.position[i] = buffers.pose.position[i];  // where the loads act
    apply_impulse(set, i, dt * (buffers.laws.force[i] + buffers.frozen.force[i]),
                  dt * (buffers.laws.torque[i] + buffers.frozen.torque[i]), state, ledger);
  }
  for (std::size_t i = 0; i < sample.dissipative.force.size(); ++i) {
    const Quat& q = buffers.pose.orientation[i];
    const Vec3 momentum = 0.5 * (start.angular_momentum[i] + state.angular_momentum[i]);
    const Vec3 spin = q * (q.conjugate() * momentum).cwiseQuotient(set.inertia[i]);
    ledger.dissipated -= dt * (0.5 * sample.dissipative.force[i].dot(start.velocity[i] + state.velocity[i]) +
                               sample.dissipative.torque[i].dot(spin));
  }
  ledger.external_impulse -= dt * sample.force_on_fixed;
  ledger.external_angular_impulse -= dt * sample.moment_on_fixed;
  ledger.external_work += dt * sample.power_of_fixed;
  ledger.dissipated += dt * sample.dissipated_at_fixed;
}

/// Of implicit midpoint: positions follow the pose, momenta the loads. What Newton's method leaves between them changes x cross p, which the spins make up for.
void keep_angular_momentum(const ParticleSet& set, const ParticleState& start, double h, const ParticleState& pose, ParticleState& state, Ledger& ledger) {
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (holds_position(set, i)) continue;
    const Vec3 velocity = 0.5 * (start.velocity[i] + state.velocity[i]);
    const Vec3 change = 2.0 * set.mass[i] * Vec3(pose.position[i] - start.position[i] - h * velocity).cross(velocity);
    if (holds_orientation(set, i)) {
      ledger.external_angular_impulse += change;
    } else {
      state.angular_momentum[i] -= free_rotation(set.pinned[i], change);
    }
  }
}

void book_external_work(const ParticleSet& set, const ParticleState& start, const ParticleState& state,
                        const Loads& external, Ledger& ledger) {
  for (std::size_t i = 0; i < set.size(); ++i) {
    ledger.external_work += external.force[i].dot(state.position[i] - start.position[i]);
    if (external.torque[i] != Vec3::Zero()) {
      ledger.external_work +=
          external.torque[i].dot(rotation_log(state.orientation[i] * start.orientation[i].conjugate()));
    }
  }
}

}  // namespace

StepReport advance_implicit(const IntegratorSettings& settings, const StepProblem& problem, const StepSpan& span,
                            const StepTarget& target, const StepTools& tools, ImplicitBuffers& buffers) {
  const auto [time, dt] = span;
  const ParticleSet& set = problem.set;
  const Interactions& interactions = problem.interactions;
  ParticleState& state = target.state;
  Ledger& ledger = target.ledger;
  const bool midpoint = settings.method == Integrator::ImplicitMidpoint;
  const double h = midpoint ? 0.5 * dt : dt;
  const std::size_t n = set.size();
  for (ParticleState* s : {&buffers.flight, &buffers.pose, &buffers.trial}) s->resize(n);
  target.kick.valid = false;
  StepReport report{.substeps = 1, .force_evaluations = 1};

  begin_pins(problem, time, dt, target);
  apply_medium(set, interactions.medium, 0.5 * dt, state, ledger);

  if (midpoint) {
    buffers.frozen.reset(n);
    fly(set, state, buffers.frozen, h, buffers.pose);
    place_led(problem, time + h, buffers.pose);
    freeze(problem, time + h, buffers.pose, tools, buffers);
  } else {
    freeze(problem, time + h, state, tools, buffers);
  }
  fly(set, state, buffers.frozen, h, buffers.flight);
  place_led(problem, time + h, buffers.flight);

  buffers.points.clear();
  if (problem.contact != nullptr) problem.contact->find(buffers.flight, time + h, buffers.points);
  // The start is kept: `state` changes before the contacts are booked.
  buffers.start = state;
  buffers.contact.begin(set, buffers.points, buffers.start, buffers.flight, {.h = h, .end_factor = midpoint ? 2.0 : 1.0, .slip_factor = midpoint ? kSlipFactor : 1.0},
                        problem.contact != nullptr ? SlowSlip{problem.contact->stick_speed, problem.contact->slow_slip} : SlowSlip{});
  buffers.damping.clear();

  StepPotential potential(set, interactions, tools.executor, h, tools.pairs, buffers);
  double value = guess(problem, time + h, h, potential, buffers);
  buffers.damping.begin(set, interactions, buffers.start, buffers.pose, h, midpoint);
  value += buffers.damping.value(buffers.pose);
  minimise(settings, value, potential, buffers, report);

  const ParticleState& start = buffers.start;
  buffers.damping.finish(buffers.pose, dt, buffers.laws, ledger);
  if (problem.contact != nullptr) buffers.contact.finish(buffers.pose, dt, buffers.laws, ledger, problem.contact->load);
  finish(set, start, dt, buffers, state, ledger);
  if (midpoint && !buffers.contact.empty()) keep_angular_momentum(set, start, h, buffers.pose, state, ledger);
  for (std::size_t i = 0; i < n; ++i) {
    if (midpoint && !holds_position(set, i)) {
      state.position[i] = Vec3(2.0 * buffers.pose.position[i] - start.position[i]);
    }
    if (holds_orientation(set, i)) continue;
    state.orientation[i] = buffers.pose.orientation[i];
    if (midpoint) {
      // The mirror of the first half: the same turn back, then free flight with the new momentum.
      const Vec3 back = -(buffers.pose.orientation[i] * potential.turned(buffers.pose, i));
      turn(state.orientation[i], back);
      const Vec3 momentum = state.angular_momentum[i] - h * free_rotation(set.pinned[i], buffers.frozen.torque[i]);
      if (momentum != Vec3::Zero()) rotate_free(state.orientation[i], momentum, set.inertia[i], h);
    }
  }
  place_led(problem, time + dt, state);
  book_external_work(set, start, state, buffers.sample.external, ledger);

  apply_medium(set, interactions.medium, 0.5 * dt, state, ledger);
  end_pins(problem, time + dt, dt, target);
  return report;
}

}  // namespace supple::core
