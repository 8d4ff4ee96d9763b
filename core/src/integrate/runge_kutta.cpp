#include "integrate/runge_kutta.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "integrate/step.h"
#include "laws/damping.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// Butcher's tableau; row s of `a` has s entries, one row after the other. The last stage of an embedded pair is taken at
/// the end of the step, so that an accepted step hands it on as the first of the next.
struct Tableau {
  std::span<const double> c;
  std::span<const double> a;
  std::span<const double> b;
  std::span<const double> error;  ///< b minus the weights of the embedded method; empty: there is none
};

constexpr std::array<double, 4> kClassicC{0.0, 0.5, 0.5, 1.0};
constexpr std::array<double, 6> kClassicA{0.5, 0.0, 0.5, 0.0, 0.0, 1.0};
constexpr std::array<double, 4> kClassicB{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
constexpr Tableau kClassic{kClassicC, kClassicA, kClassicB, {}};

// Dormand & Prince 1980, RK5(4)7M.
constexpr std::array<double, 7> kPrinceC{0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0};
constexpr std::array<double, 21> kPrinceA{
    1.0 / 5.0,
    3.0 / 40.0, 9.0 / 40.0,
    44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0,
    19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0,
    9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0,
    35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0};
constexpr std::array<double, 7> kPrinceB{35.0 / 384.0,     0.0,         500.0 / 1113.0, 125.0 / 192.0,
                                         -2187.0 / 6784.0, 11.0 / 84.0, 0.0};
constexpr std::array<double, 7> kPrinceError{71.0 / 57600.0,      0.0,          -71.0 / 16695.0, 71.0 / 1920.0,
                                             -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
constexpr Tableau kPrince{kPrinceC, kPrinceA, kPrinceB, kPrinceError};

/// Order of the local error estimate of the pair, for the choice of the next step.
constexpr double kErrorOrder = 5.0;
constexpr double kSafety = 0.9;
constexpr double kMostShrink = 0.2;
constexpr double kMostGrowth = 5.0;

void add(Ledger& sum, double weight, const Ledger& rate) {
  sum.external_work += weight * rate.external_work;
  sum.dissipated += weight * rate.dissipated;
  sum.external_impulse += weight * rate.external_impulse;
  sum.external_angular_impulse += weight * rate.external_angular_impulse;
  sum.pin_impulse += weight * rate.pin_impulse;
  sum.pin_angular_impulse += weight * rate.pin_angular_impulse;
}

void resize(Rates& rates, std::size_t n) {
  rates.velocity.resize(n);
  rates.acceleration.resize(n);
  rates.turning.resize(n);
  rates.torque.resize(n);
}

void evaluate_rates(const StepProblem& problem, const ParticleState& state, double time, RungeKuttaBuffers& buffers, Rates& rates) {
  const ParticleSet& set = problem.set;
  const Interactions& interactions = problem.interactions;
  const std::size_t n = set.size();
  ForceSample& sample = buffers.sample;
  evaluate(problem.forces, state, time, sample);
  buffers.friction.reset(n);
  buffers.medium.reset(n);
  add_friction_loads(set, interactions.friction, state, buffers.friction);
  add_stiffness_damping_loads(set, interactions, state, buffers.friction);
  add_medium_loads(set, interactions.medium, state, buffers.medium);

  rates.ledger = {};
  Ledger& books = rates.ledger;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& x = state.position[i];
    const Vec3& v = state.velocity[i];
    const Quat& q = state.orientation[i];
    const Vec3 omega = angular_velocity(set, state, i);
    const Vec3& external = sample.external.force[i];
    const Vec3& external_torque = sample.external.torque[i];
    Vec3 damping = buffers.friction.force[i] + buffers.medium.force[i];
    Vec3 damping_torque = buffers.friction.torque[i] + buffers.medium.torque[i];
    const Vec3 force = sample.internal.force[i] + external + damping;
    const Vec3 torque = sample.internal.torque[i] + external_torque + damping_torque;
    if (!sample.dissipative.force.empty()) {
      damping += sample.dissipative.force[i];
      damping_torque += sample.dissipative.torque[i];
    }
    books.external_work += external.dot(v) + external_torque.dot(omega);
    books.dissipated -= damping.dot(v) + damping_torque.dot(omega);
    const Vec3 outer = external + buffers.medium.force[i];
    books.external_impulse += outer;
    books.external_angular_impulse += x.cross(outer) + external_torque + buffers.medium.torque[i];

    rates.velocity[i] = v;
    rates.acceleration[i] = 1.0 / set.mass[i] * force;
    rates.torque[i] = torque;
    rates.turning[i] = Quat(0.0, 0.5 * omega.x(), 0.5 * omega.y(), 0.5 * omega.z()) * q;
    if (set.pinned[i] != 0) {
      const Vec3 free_force = free_translation(set.pinned[i], force);
      const Vec3 free_torque = free_rotation(set.pinned[i], torque);
      books.pin_impulse -= force - free_force;
      books.pin_angular_impulse -= x.cross(force - free_force) + (torque - free_torque);
      if ((set.pinned[i] & kPinPosition) != 0) books.external_work -= force.dot(v);
      if ((set.pinned[i] & kPinOrientation) != 0) books.external_work -= torque.dot(omega);
      rates.acceleration[i] = 1.0 / set.mass[i] * free_force;
      rates.torque[i] = free_torque;
    }
  }
  books.external_impulse -= sample.force_on_fixed;
  books.external_angular_impulse -= sample.moment_on_fixed;
  books.external_work += sample.power_of_fixed;
  books.dissipated += sample.dissipated_at_fixed;
}

/// state + dt sum_s weight[s] stage[s], orientations brought back to unit length.
void combine(const ParticleState& state, double dt, std::span<const double> weight, const std::vector<Rates>& stage,
             ParticleState& out) {
  const std::size_t n = state.size();
  out.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    Vec3 x = state.position[i];
    Vec3 v = state.velocity[i];
    Vec3 l = state.angular_momentum[i];
    Eigen::Vector4d q = state.orientation[i].coeffs();
    for (std::size_t s = 0; s < weight.size(); ++s) {
      if (weight[s] == 0.0) continue;
      const double h = dt * weight[s];
      x += h * stage[s].velocity[i];
      v += h * stage[s].acceleration[i];
      l += h * stage[s].torque[i];
      q += h * stage[s].turning[i].coeffs();
    }
    out.position[i] = x;
    out.velocity[i] = v;
    out.angular_momentum[i] = l;
    const bool turned = q != state.orientation[i].coeffs();
    out.orientation[i].coeffs() = turned ? Eigen::Vector4d(q / std::sqrt(q.squaredNorm())) : q;
  }
}

/// Largest difference of the two methods of a pair, of positions over `length` and of angles in radians; velocities enter
/// by the displacement in the step.
double local_error(const ParticleSet& set, const ParticleState& state, double dt, std::span<const double> weight,
                   const std::vector<Rates>& stage, double length) {
  double largest2 = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    Vec3 x = Vec3::Zero(), v = Vec3::Zero(), l = Vec3::Zero();
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
    for (std::size_t s = 0; s < weight.size(); ++s) {
      x += weight[s] * stage[s].velocity[i];
      v += weight[s] * stage[s].acceleration[i];
      l += weight[s] * stage[s].torque[i];
      q += weight[s] * stage[s].turning[i].coeffs();
    }
    const double scale = dt / length;
    const double spin = dt * dt / set.inertia[i].minCoeff();
    const double error2 = std::max({scale * scale * x.squaredNorm(), scale * scale * dt * dt * v.squaredNorm(),
                                    4.0 * dt * dt * q.squaredNorm(), spin * spin * l.squaredNorm()});
    if (!(error2 <= largest2)) largest2 = error2;
    if (!std::isfinite(largest2)) return std::numeric_limits<double>::infinity();
  }
  return std::sqrt(largest2);
}

class Stepper {
 public:
  Stepper(const Tableau& tableau, const StepProblem& problem, RungeKuttaBuffers& buffers)
      : tableau_(tableau), problem_(problem), buffers_(buffers) {
    if (buffers_.stage.size() < tableau_.c.size()) buffers_.stage.resize(tableau_.c.size());
    for (Rates& rates : buffers_.stage) resize(rates, problem.set.size());
  }

  /// Computes the state after dt in `buffers.trial`. `first_known`: stage 0 holds the rates at `state` already.
  void attempt(const ParticleState& state, double time, double dt, bool first_known) {
    for (std::size_t s = first_known ? 1 : 0; s < tableau_.c.size(); ++s) {
      if (s == 0) {
        rates_at(state, time, 0);
      } else {
        combine(state, dt, tableau_.a.subspan(s * (s - 1) / 2, s), buffers_.stage, buffers_.trial);
        rates_at(buffers_.trial, time + tableau_.c[s] * dt, s);
      }
    }
    combine(state, dt, tableau_.b, buffers_.stage, buffers_.trial);
  }
  [[nodiscard]] double error(const ParticleState& state, double dt, double length) const {
    return local_error(problem_.set, state, dt, tableau_.error, buffers_.stage, length);
  }
  void accept(double dt, ParticleState& state, Ledger& ledger) {
    for (std::size_t s = 0; s < tableau_.b.size(); ++s) add(ledger, dt * tableau_.b[s], buffers_.stage[s].ledger);
    state = buffers_.trial;  // a swap would move the arrays, which others view
  }
  /// The last stage of an accepted step is the first of the next.
  void hand_on() { std::swap(buffers_.stage[0], buffers_.stage[tableau_.c.size() - 1]); }
  [[nodiscard]] std::int64_t evaluations() const { return evaluations_; }

 private:
  void rates_at(const ParticleState& state, double time, std::size_t stage) {
    evaluate_rates(problem_, state, time, buffers_, buffers_.stage[stage]);
    ++evaluations_;
  }

  const Tableau& tableau_;
  const StepProblem& problem_;
  RungeKuttaBuffers& buffers_;
  std::int64_t evaluations_ = 0;
};

StepReport advance_adaptively(const IntegratorSettings& settings, double time, double dt, const StepTarget& target, Stepper& stepper) {
  ParticleState& state = target.state;
  double& next_step = target.kick.next_step;
  StepReport report;
  const double smallest = dt / settings.max_substeps;
  double h = next_step > 0.0 ? next_step : (settings.first_step > 0.0 ? settings.first_step : dt);
  double done = 0.0;
  bool first_known = false;
  while (done < dt) {
    const double left = dt - done;
    h = std::max(h, smallest);
    const bool last = h >= left;
    const double step = last ? left : h;
    stepper.attempt(state, time + done, step, first_known);
    const double error = stepper.error(state, step, settings.length);
    first_known = true;
    double factor = kMostGrowth;
    if (error > 0.0) {
      factor = std::isfinite(error) ? kSafety * math::pow(settings.tolerance / error, 1.0 / kErrorOrder) : 0.0;
      factor = std::clamp(factor, kMostShrink, kMostGrowth);
    }
    if (error <= settings.tolerance || step <= smallest) {
      if (!(error <= settings.tolerance)) report.within_tolerance = false;
      stepper.accept(step, state, target.ledger);
      stepper.hand_on();
      ++report.substeps;
      // The end of the step may have shortened this substep, which does not reduce the size to try next.
      h = last && step < h ? std::max(h, step * factor) : step * factor;
      done = last ? dt : done + step;
    } else {
      ++report.rejected;
      h = step * factor;
    }
  }
  next_step = std::min(h, dt);
  return report;
}

}  // namespace

StepReport advance_runge_kutta(const IntegratorSettings& settings, const StepProblem& problem, double time, double dt,
                               const StepTarget& target, RungeKuttaBuffers& buffers) {
  const auto& [state, kick, ledger] = target;
  const bool adaptive = settings.method == Integrator::Adaptive;
  begin_pins(problem, time, dt, target);
  kick.valid = false;
  Stepper stepper(adaptive ? kPrince : kClassic, problem, buffers);
  StepReport report;
  if (adaptive) {
    report = advance_adaptively(settings, time, dt, target, stepper);
  } else {
    stepper.attempt(state, time, dt, false);
    stepper.accept(dt, state, ledger);
    report.substeps = 1;
  }
  end_pins(problem, time + dt, dt, target);
  report.force_evaluations = stepper.evaluations();
  return report;
}

}  // namespace supple::core
