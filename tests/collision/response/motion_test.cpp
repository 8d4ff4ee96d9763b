/// Contact in motion, integrated by velocity Verlet here: rest, impact, restitution, collision of free bodies.
#include <gtest/gtest.h>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Ellipsoid;
using testing::Linear;
using testing::LinearSphere;
using testing::Stage;

/// A linear sphere, a = 1, m = 1, over a rigid plane.
struct Drop {
  LinearSphere sphere{Vec3::Zero(), Linear{1.0, 1.0}};
  implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e6};
  Stage stage;
  explicit Drop(double modulus, double dissipation = 0.0) {
    stage.add(sphere, {Vec3::Zero()}, modulus);
    stage.add(plane, {Vec3::Zero()}, modulus).fixed = true;
    stage.rules.overrides.push_back({{0, 1}, {.friction = 0.0, .dissipation = dissipation}});
  }
  /// Upward force with the sphere `depth` deep and sinking at `speed`.
  double force(double depth, double speed = 0.0) {
    sphere.centre = Vec3(0, 0, 1.0 - depth);
    stage.pose(0)[0].position = sphere.centre;
    stage.velocity(0)[0] = Vec3(0, 0, -speed);
    stage.solve({.error = 1e-5});
    return stage.react()[0].force[0].z();
  }
};

TEST(RestingSphere, SinksToTheDepthThatCarriesItsWeight) {
  Drop drop(1e4);
  double low = 0.0, high = 0.1;
  for (int i = 0; i < 45; ++i) {
    const double middle = 0.5 * (low + high);
    (drop.force(middle) < 9.81 ? low : high) = middle;
  }
  EXPECT_NEAR(low, 0.0177765862, 1e-7);  // the plane gives way by 1e-6 of it, the quadrature by less
}

TEST(FallingSphere, ReboundsFromTheDepthAndAfterTheTimeOfTheClosedForm) {
  Drop drop(1e3);
  const double dt = 2e-4;
  double depth = 0.0, speed = 1.0, time = 0.0, deepest = 0.0, energy_before = 0.5;
  double push = 0.0;
  while (true) {
    speed -= 0.5 * dt * push;
    const double next = depth + dt * speed;
    if (next <= 0.0 && speed < 0.0) {
      time += dt * depth / (depth - next);
      break;
    }
    depth = next;
    push = drop.force(depth);
    speed -= 0.5 * dt * push;
    deepest = std::max(deepest, depth);
    time += dt;
    ASSERT_LT(time, 1.0);
  }
  // Verlet: relative errors (omega dt)^2 / 24 with omega ~ pi / .22, 3e-7; the deepest step misses by as much.
  EXPECT_NEAR(deepest, 0.0792193368, 1e-6);
  EXPECT_NEAR(time, 0.222868, 5e-6);
  EXPECT_NEAR(0.5 * speed * speed, energy_before, 1e-5);
}

TEST(Restitution, FollowsHuntAndCrossley) {
  // d v0 - ln(1 + d v0) + d v1 + ln(1 - d v1) = 0, whatever the elastic law.
  for (const auto& [d, e] : {std::pair{0.1, 0.93747558}, {0.5, 0.74843493}, {1.0, 0.59362426}, {2.0, 0.41071969}}) {
    Drop drop(1e3, d);
    const double dt = 2e-4;
    double depth = 0.0, speed = 1.0;
    for (int step = 0; step < 5000 && depth >= 0.0; ++step) {  // midpoint rule
      const double push = drop.force(depth, speed);
      const double push_middle = drop.force(depth + 0.5 * dt * speed, speed - 0.5 * dt * push);
      depth += dt * (speed - 0.5 * dt * push);
      speed -= dt * push_middle;
    }
    EXPECT_NEAR(-speed, e, 2e-4) << d;  // order 2 in dt, and the last step of 1e-3 of the contact
  }
}

/// Two free ellipsoids that meet off centre; isotropic inertia.
struct Collision {
  Ellipsoid body[2] = {{Vec3(-0.8, 0, 0), Quat(0.9, 0.2, -0.3, 0.1).normalized(), Vec3(1.0, 0.7, 0.8), 0.5},
                       {Vec3(0.45, 0.2, 0.1), Quat(0.8, -0.3, 0.2, 0.4).normalized(), Vec3(0.7, 0.9, 0.6), 0.5}};
  double mass[2] = {1.0, 0.6}, inertia[2] = {0.2, 0.1};
  Vec3 velocity[2] = {Vec3(0.5, 0, 0), Vec3(-0.4, 0.1, 0)};
  Vec3 spin[2] = {Vec3(0, 0.3, 0.1), Vec3(0.2, 0, -0.3)};
  Stage stage;
  double contact_energy = 0.0;
  double momentum_error = 0.0, angular_error = 0.0, energy_error = 0.0, largest_contact_energy = 0.0;

  Collision() {
    for (Ellipsoid& e : body) stage.add(e, {e.centre}, 5.0);
  }
  std::vector<PartLoads> loads() {
    for (std::size_t i : {0u, 1u}) stage.pose(i)[0].position = body[i].centre;
    const ContactSurface& s = stage.solve({.error = 1e-8});
    contact_energy = s.summary.empty() ? 0.0 : s.summary[0].energy;
    return stage.react();
  }
  void kick(const std::vector<PartLoads>& load, double dt) {
    for (const std::size_t i : {0u, 1u}) {
      velocity[i] += dt / mass[i] * load[i].force[0];
      spin[i] += dt / inertia[i] * load[i].torque[0];
    }
  }
  [[nodiscard]] Vec3 momentum() const { return mass[0] * velocity[0] + mass[1] * velocity[1]; }
  [[nodiscard]] Vec3 angular() const {
    Vec3 sum = Vec3::Zero();
    for (const std::size_t i : {0u, 1u}) sum += mass[i] * body[i].centre.cross(velocity[i]) + inertia[i] * spin[i];
    return sum;
  }
  [[nodiscard]] double energy() const {
    double sum = contact_energy;
    for (const std::size_t i : {0u, 1u}) {
      sum += 0.5 * mass[i] * velocity[i].squaredNorm() + 0.5 * inertia[i] * spin[i].squaredNorm();
    }
    return sum;
  }
  void run(int steps, double dt) {
    auto load = loads();
    const Vec3 p = momentum(), l = angular();
    const double e = energy();
    for (int n = 0; n < steps; ++n) {
      kick(load, 0.5 * dt);
      for (const std::size_t i : {0u, 1u}) {
        body[i].centre += dt * velocity[i];
        const double angle = spin[i].norm() * dt;
        body[i].orientation = Quat(Eigen::AngleAxisd(angle, spin[i].normalized())) * body[i].orientation;
        body[i].orientation.normalize();
      }
      load = loads();
      kick(load, 0.5 * dt);
      momentum_error = std::max(momentum_error, (momentum() - p).norm());
      angular_error = std::max(angular_error, (angular() - l).norm());
      energy_error = std::max(energy_error, std::abs(energy() - e) / e);
      largest_contact_energy = std::max(largest_contact_energy, contact_energy);
    }
  }
};

TEST(FreeCollision, KeepsMomentaAndLosesEnergyWithTheSquareOfTheStep) {
  double error[2];
  for (const int i : {0, 1}) {
    Collision collision;
    const int steps = 120 << i;
    collision.run(steps, 1.2 / steps);
    EXPECT_GT(collision.largest_contact_energy, 0.02);
    EXPECT_LT(collision.momentum_error, 1e-12);
    EXPECT_LT(collision.angular_error, 1e-12);
    error[i] = collision.energy_error;
  }
  EXPECT_LT(error[0], 1e-2);
  EXPECT_GT(error[0] / error[1], 3.5);
  EXPECT_LT(error[0] / error[1], 4.5);
}

}  // namespace
}  // namespace supple::collision
