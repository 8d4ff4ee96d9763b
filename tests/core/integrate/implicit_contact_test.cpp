// Contact inside implicit steps, on punches whose contact has closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/support.h"
#include "integrate/contact_term.h"
#include "supple/core/integrators.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

constexpr double kGravity = 9.81;

/// A particle that stands on the plane z = 0 with a foot of four points, each on a spring of stiffness `stiffness` / 4 along the normal.
struct Punch {
  Particles p;
  Interactions interactions;
  IntegratorSettings settings{.method = Integrator::BackwardEuler, .tolerance = 1e-12};
  KickState kick;
  Ledger ledger;
  IntegratorWorkspace workspace;
  ImplicitContact contact;
  double stiffness = 1e4;   ///< [N/m]
  double friction = 0.0, dissipation = 0.0;
  Vec3 normal = -Vec3::UnitZ();       ///< out of the particle, into the plane
  Vec3 belt = Vec3::Zero();           ///< velocity of the plane [m/s]
  double half_width = 0.1;
  double time = 0.0;
  std::int64_t iterations = 0;
  bool sound = true;

  explicit Punch(double height, const Vec3& velocity = Vec3::Zero()) {
    p.add(Vec3(0.0, 0.0, height));
    p.state.velocity[0] = velocity;
    interactions.gravity = Vec3(0.0, 0.0, -kGravity);
    contact.find = [this](const ParticleState& pose, double, ContactPoints& out) { find(pose, out); };
  }
  void find(const ParticleState& pose, ContactPoints& out) const {
    out.clear();
    out.offset.push_back(0);
    ContactPoints::Pair pair{.friction = friction, .dissipation = dissipation, .obstacle = ObstacleSide::B};
    for (const double x : {-half_width, half_width}) {
      for (const double y : {-half_width, half_width}) {
        const Vec3 foot = pose.position[0] + pose.orientation[0] * Vec3(x, y, 0.0);
        const double depth = foot.dot(normal);
        if (!(depth > 0.0)) continue;
        out.point.push_back(foot - depth * normal);
        out.normal.push_back(normal);
        out.weight.push_back(0.25);
        out.pressure.push_back(stiffness * depth);
        out.slope.push_back(stiffness);
        out.obstacle_velocity.push_back(belt);
        out.particle.push_back(0);
        out.share.push_back(1.0);
        out.offset.push_back(static_cast<std::uint32_t>(out.particle.size()));
      }
    }
    pair.end = static_cast<std::uint32_t>(out.point.size());
    out.pair.push_back(pair);
  }
  void run(double dt, int steps) {
    const Executor executor(1);
    InteractionWorkspace pairs(p.set, interactions);
    const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
      accumulate_interactions(p.set, state, interactions, executor, pairs, out.internal);
      add_external_loads(p.set, interactions, t, out.external);
    };
    for (int k = 0; k < steps; ++k) {
      const StepReport report = advance(settings, {p.set, interactions, forces, &contact}, time, dt, {p.state, kick, ledger},
                                        {executor, pairs, workspace});
      sound = sound && report.within_tolerance;
      iterations += report.newton_iterations;
      time += dt;
    }
  }
  [[nodiscard]] double mass() const { return p.set.mass[0]; }
  [[nodiscard]] Vec3 position() const { return p.state.position[0]; }
  [[nodiscard]] Vec3 velocity() const { return p.state.velocity[0]; }
};

TEST(ImplicitContact, RestsAtTheDepthOfItsWeightAtAnyStep) {
  for (const Integrator method : {Integrator::BackwardEuler, Integrator::ImplicitMidpoint}) {
    for (const double dt : {1e-4, 1e-2, 0.1}) {
      Punch punch(0.0);
      const double depth = punch.mass() * kGravity / punch.stiffness;
      punch.p.state.position[0].z() = -depth;
      punch.settings.method = method;
      punch.run(dt, 50);
      EXPECT_TRUE(punch.sound);
      EXPECT_NEAR(punch.position().z(), -depth, 1e-9 * depth + 1e-15) << dt;
      EXPECT_NEAR(punch.contact.load[0].force.z(), punch.mass() * kGravity, 1e-8 * kGravity) << dt;
    }
  }
}

TEST(ImplicitContact, BouncesToTheClosedFormWithTheOrderOfTheMethod) {
  // Without gravity a spring turns the particle back within half a period: it is back at z = 0 with the opposite velocity.
  const auto error = [](Integrator method, int steps) {
    Punch punch(0.0, Vec3(0.0, 0.0, -1.0));
    punch.interactions.gravity.setZero();
    punch.settings.method = method;
    const double omega = std::sqrt(punch.stiffness / punch.mass());
    const double end = 1.5 * std::numbers::pi / omega;  // a third of it in free flight
    punch.run(end / steps, steps);
    EXPECT_TRUE(punch.sound);
    return std::abs(punch.position().z() - 0.5 * std::numbers::pi / omega) * omega;
  };
  const double first = error(Integrator::BackwardEuler, 1000) / error(Integrator::BackwardEuler, 2000);
  EXPECT_GT(first, 1.8);
  const double second = error(Integrator::ImplicitMidpoint, 150) / error(Integrator::ImplicitMidpoint, 300);
  EXPECT_GT(second, 3.0);
  EXPECT_LT(error(Integrator::ImplicitMidpoint, 300), 1e-3);
}

TEST(ImplicitContact, NeverGainsEnergyWithBackwardEuler) {
  Draw draw(5);
  for (int trial = 0; trial < 50; ++trial) {
    Punch punch(draw.uniform(0.0, 0.05), Vec3(draw.uniform(-2.0, 2.0), 0.0, draw.uniform(-3.0, 0.0)));
    punch.stiffness = std::pow(10.0, draw.uniform(2.0, 7.0));
    punch.friction = draw.uniform(0.0, 1.0);
    const auto energy = [&] {
      double sum = measure_motion(punch.p.set, punch.p.state).kinetic_energy + punch.mass() * kGravity * punch.position().z();
      for (const double x : {-punch.half_width, punch.half_width}) {
        for (const double y : {-punch.half_width, punch.half_width}) {
          const double depth = -(punch.position() + punch.p.state.orientation[0] * Vec3(x, y, 0.0)).z();
          if (depth > 0.0) sum += 0.125 * punch.stiffness * depth * depth;
        }
      }
      return sum;
    };
    const double start = energy();
    const double dt = std::pow(10.0, draw.uniform(-4.0, -1.5));
    for (int k = 0; k < 50; ++k) {
      punch.run(dt, 1);
      EXPECT_LE(energy(), start * (1.0 + 1e-9)) << "trial " << trial << ", step " << k << " of " << dt << " s";
    }
  }
}

/// A punch on a slope of angle `angle`, which does not rock: gravity is turned instead of the plane.
Punch on_slope(double angle, double friction) {
  Punch punch(0.0);
  punch.p.set.pinned[0] = kPinOrientation;
  punch.friction = friction;
  punch.interactions.gravity = kGravity * Vec3(std::sin(angle), 0.0, -std::cos(angle));
  punch.p.state.position[0].z() = -punch.mass() * kGravity * std::cos(angle) / punch.stiffness;
  return punch;
}

TEST(ImplicitContact, HoldsBelowTheAngleOfFriction) {
  for (const Integrator method : {Integrator::BackwardEuler, Integrator::ImplicitMidpoint}) {
    for (const double dt : {1e-3, 1.0 / 24.0}) {
      Punch punch = on_slope(0.35, 0.4);  // tan .35 = .365
      punch.settings.method = method;
      punch.run(dt, static_cast<int>(10.0 / dt));
      EXPECT_TRUE(punch.sound);
      EXPECT_LE(std::abs(punch.position().x()), 10.0 * punch.contact.stick_speed) << dt;
      EXPECT_LE(punch.iterations, 5 * static_cast<int>(10.0 / dt)) << dt;  // the directions of friction are unknowns, too
      EXPECT_NEAR(punch.contact.load[0].force.x(), -punch.mass() * kGravity * std::sin(0.35), 1e-6 * punch.mass() * kGravity) << dt;
    }
  }
}

TEST(ImplicitContact, SlidesAboveItWithWhatIsLeft) {
  for (const Integrator method : {Integrator::BackwardEuler, Integrator::ImplicitMidpoint}) {
    Punch punch = on_slope(0.5, 0.3);
    punch.settings.method = method;
    punch.run(1e-3, 1000);
    EXPECT_TRUE(punch.sound);
    const double acceleration = kGravity * (std::sin(0.5) - 0.3 * std::cos(0.5));
    EXPECT_NEAR(punch.velocity().x(), acceleration, 1e-3 * acceleration);
    // What friction took is force times way.
    EXPECT_NEAR(punch.ledger.dissipated, 0.3 * punch.mass() * kGravity * std::cos(0.5) * punch.position().x(), 2e-3 * punch.ledger.dissipated);
  }
}

TEST(ImplicitContact, StopsASlideWithoutTurningItBack) {
  for (const Integrator method : {Integrator::BackwardEuler, Integrator::ImplicitMidpoint}) {
    Punch punch = on_slope(0.0, 0.5);
    punch.p.state.velocity[0].x() = 1.0;
    punch.settings.method = method;
    punch.run(0.01, 100);
    EXPECT_TRUE(punch.sound);
    EXPECT_NEAR(punch.position().x(), 0.5 / (0.5 * kGravity), 0.006);
    EXPECT_LE(std::abs(punch.velocity().x()), 2.0 * punch.contact.stick_speed);
  }
}

TEST(ImplicitContact, IsCarriedByABelt) {
  Punch punch = on_slope(0.0, 0.5);
  punch.belt = Vec3(0.2, -0.1, 0.0);
  punch.run(0.005, 200);
  EXPECT_TRUE(punch.sound);
  EXPECT_LT((punch.velocity() - punch.belt).norm(), 2.0 * punch.contact.stick_speed);
  // The belt's work is the particle's motion and what friction took until it had the belt's speed.
  const double motion = 0.5 * punch.mass() * punch.belt.squaredNorm();
  EXPECT_NEAR(punch.ledger.external_work, motion + punch.ledger.dissipated, 1e-3 * motion);
}

TEST(ImplicitContact, DampsAsHuntAndCrossleySay) {
  // Without gravity: m v dv = -k z (1 + d v) dz, so that v / d - ln(1 + d v) / d^2 is the same, but for the spring's energy, before and after.
  Punch punch(0.0, Vec3(0.0, 0.0, -1.0));
  punch.interactions.gravity.setZero();
  punch.dissipation = 0.5;
  punch.settings.method = Integrator::ImplicitMidpoint;
  const double omega = std::sqrt(punch.stiffness / punch.mass());
  punch.run(0.005 / omega, 1200);
  const auto measure = [d = punch.dissipation](double v) { return v / d - std::log1p(d * v) / (d * d); };
  EXPECT_NEAR(measure(-punch.velocity().z()), measure(1.0), 2e-3 * measure(1.0));
  EXPECT_NEAR(punch.ledger.dissipated, 0.5 * punch.mass() * (1.0 - punch.velocity().squaredNorm()), 1e-3 * punch.mass());
}

/// Two pairs of particles, each a body, that press at random points.
struct TwoBodies {
  Particles p;
  Interactions interactions;
  ContactPoints points;

  explicit TwoBodies(Draw& draw) {
    for (int i = 0; i < 4; ++i) {
      p.add(draw.vector(1.0));
      p.state.velocity.back() = 0.3 * draw.vector(1.0);
      p.state.orientation.back() = rotation_exp(draw.vector(1.0));
      p.state.angular_momentum.back() = 0.01 * draw.vector(1.0);
    }
    points.offset.push_back(0);
    for (int q = 0; q < 7; ++q) {
      points.point.push_back(0.3 * draw.vector(1.0));
      points.normal.push_back((Vec3::UnitX() + 0.2 * draw.vector(1.0)).normalized());
      points.weight.push_back(draw.uniform(0.001, 0.01));
      points.pressure.push_back(draw.uniform(10.0, 1000.0));
      points.slope.push_back(draw.uniform(0.0, 1e5));
      points.obstacle_velocity.push_back(Vec3::Zero());
      const double a = draw.uniform(0.0, 1.0), b = draw.uniform(0.0, 1.0);
      points.particle.insert(points.particle.end(), {0, 1, 2, 3});
      points.share.insert(points.share.end(), {a, 1.0 - a, -b, b - 1.0});
      points.offset.push_back(static_cast<std::uint32_t>(points.particle.size()));
    }
    points.pair.push_back({.begin = 0, .end = 7, .friction = 0.4, .dissipation = 0.3, .split_begin = 0, .split_end = 4});
    for (std::uint32_t i = 0; i < 4; ++i) points.split_particle.push_back(i);
    for (int body = 0; body < 2; ++body) {
      const Vec3 force = 2.0 * draw.vector(1.0);
      points.split_force.insert(points.split_force.end(), {force, -force});
      points.split_torque.insert(points.split_torque.end(), {0.1 * draw.vector(1.0), Vec3::Zero()});
    }
  }
  /// The contact at a pose, in which the loads within a body have no moment.
  [[nodiscard]] ContactPoints at(const ParticleState& pose) const {
    ContactPoints out = points;
    for (std::size_t first : {0, 2}) {
      const Vec3 arm = pose.position[first + 1] - pose.position[first];
      out.split_torque[first + 1] = arm.cross(out.split_force[first]) - out.split_torque[first];
    }
    return out;
  }
};

TEST(ImplicitContact, LeavesMomentaToRoundOff) {
  Draw draw(11);
  for (int trial = 0; trial < 20; ++trial) {
    TwoBodies two(draw);
    ImplicitContact contact{.find = [&](const ParticleState& pose, double, ContactPoints& out) { out = two.at(pose); }, .stick_speed = 1e-3};
    const Executor executor(1);
    InteractionWorkspace pairs(two.p.set, two.interactions);
    const ForceModel none = [](const ParticleState&, double, ForceSample&) {};
    KickState kick;
    Ledger ledger;
    IntegratorWorkspace workspace;
    const Motion before = measure_motion(two.p.set, two.p.state);
    advance({.method = Integrator::ImplicitMidpoint, .tolerance = 1e-12}, {two.p.set, two.interactions, none, &contact}, 0.0, 0.01,
            {two.p.state, kick, ledger}, {executor, pairs, workspace});
    const Motion after = measure_motion(two.p.set, two.p.state);
    EXPECT_GT(contact.load[0].force.norm(), 0.0);
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-13 * before.momentum_scale);
    EXPECT_LT((after.angular_momentum - before.angular_momentum).norm(), 1e-12 * before.angular_momentum_scale);
  }
}

TEST(ImplicitContact, HasTheGradientAndTheHessianOfItsPotential) {
  Draw draw(12);
  for (int trial = 0; trial < 20; ++trial) {
    TwoBodies two(draw);
    const auto moved = [&](double size) {
      ParticleState pose = two.p.state;
      for (std::size_t i = 0; i < pose.size(); ++i) {
        pose.position[i] += size * draw.vector(1.0);
        pose.orientation[i] = rotation_exp(size * draw.vector(1.0)) * pose.orientation[i];
      }
      return pose;
    };
    ContactTerm term;
    const ParticleState predicted = moved(0.01);
    const double end_factor = trial % 2 == 0 ? 1.0 : 2.0;
    term.begin(two.p.set, two.points, two.p.state, predicted, {.h = 0.01, .end_factor = end_factor, .slip_factor = trial % 2 == 0 ? 1.0 : 1.1}, {.speed = 0.5});
    term.lag_friction(predicted);
    const ParticleState pose = moved(0.003);
    const auto nudged = [&](Eigen::Index row, double by) {
      ParticleState other = pose;
      const auto i = static_cast<std::size_t>(row / 6);
      Vec3 unit = Vec3::Zero();
      unit[row % 3] = by;
      if (row % 6 < 3) {
        other.position[i] += unit;
      } else {
        other.orientation[i] = rotation_exp(unit) * other.orientation[i];
      }
      return other;
    };
    const auto gradient_at = [&](const ParticleState& at) {
      Eigen::VectorXd gradient = Eigen::VectorXd::Zero(24);
      term.add_gradient(at, gradient);
      return gradient;
    };
    const Eigen::VectorXd gradient = gradient_at(pose);
    StepHessian hessian;
    hessian.begin(two.p.set.pinned, term.coupled());
    term.predict_friction(Eigen::VectorXd::Zero(24));
    term.turn_friction(1.0);  // the directions are those of the slips
    term.add_hessian(pose, 0, hessian);
    const Eigen::MatrixXd dense = Eigen::MatrixXd(hessian.matrix()).selfadjointView<Eigen::Lower>();
    const double step = 1e-6;
    for (Eigen::Index row = 0; row < 24; ++row) {
      const double slope = (term.value(nudged(row, step)) - term.value(nudged(row, -step))) / (2.0 * step);
      EXPECT_NEAR(gradient[row], slope, 1e-5 * gradient.cwiseAbs().maxCoeff()) << trial << ' ' << row;
      // Second derivatives of the rotation vector are left out: they are the torque times the rotation since the start.
      const Eigen::VectorXd column = (gradient_at(nudged(row, step)) - gradient_at(nudged(row, -step))) / (2.0 * step);
      EXPECT_LT((dense.col(row) - column).cwiseAbs().maxCoeff(), 1e-5 * dense.cwiseAbs().maxCoeff() + gradient.cwiseAbs().maxCoeff())
          << trial << ' ' << row;
    }
  }
}

TEST(ImplicitContact, SharesTheElasticForceWithinABodyAsItsEnergyDoes) {
  Draw draw(13);
  TwoBodies two(draw);
  two.points.pair[0].friction = two.points.pair[0].dissipation = 0.0;
  const auto slope_of = [](const ContactPoints& points, const ParticleState& pose, const ParticleSet& set) {
    ContactTerm term;
    term.begin(set, points, pose, pose, {.h = 0.01}, {});
    term.lag_friction(pose);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(24);
    term.add_gradient(pose, gradient);
    return gradient;
  };
  const ContactPoints with = two.at(two.p.state);
  ContactPoints without = with;
  without.pair[0].split_end = 0;
  const Eigen::VectorXd change = slope_of(with, two.p.state, two.p.set) - slope_of(without, two.p.state, two.p.set);
  for (Eigen::Index i = 0; i < 4; ++i) {  // the normal force is the predicted one here
    const auto k = static_cast<std::size_t>(i);
    EXPECT_LT((change.segment<3>(6 * i) + with.split_force[k]).norm(), 1e-12);
    EXPECT_LT((change.segment<3>(6 * i + 3) + with.split_torque[k]).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace supple::core
