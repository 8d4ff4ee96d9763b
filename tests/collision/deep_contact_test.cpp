/// Bodies pressed into one another by as much as their radius and more, where most of a soft body lies beyond the contact surface.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "benchmarks/contact_shapes.h"
#include "bodies.h"

namespace supple::collision {
namespace {

constexpr double kSupport = 0.5, kModulus = 1e4;  // of a ball of Wyvill's kernel [m], [Pa]
constexpr double kStiffness = 1e6;                // of the plane [Pa/m]

ContactSurface::Summary query(const std::array<ContactBody, 2>& bodies, double error) {
  const Executor executor(1);
  ContactCandidates candidates;
  ContactSurface surface;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
  return surface.summary.at(0);
}

ContactSurface::Summary ball_on_plane(double height, double error) {
  benchmarks::Rigid ball(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), kSupport), kModulus, 0.03);
  ball.put({});
  const implicit::HalfSpace plane{Vec3(0.0, 0.0, height), Vec3::UnitZ(), 1.0};
  const Pose still;
  return query({ball.body(), benchmarks::single_part(plane, kStiffness, still)}, error);
}

/// Normal force: the integral of the pressure on Sigma over its projection, by Simpson's rule in rho = rim sin t.
double force_on_plane(double height) {
  const auto ball = [](double square) {
    const double t = 1.0 - square / (kSupport * kSupport);
    return std::array{kModulus * (t * t * t - 0.5), -3.0 * kModulus * t * t / (kSupport * kSupport)};  // and its rate over the square
  };
  const double radius_square = kSupport * kSupport * (1.0 - std::cbrt(0.5)), rim = std::sqrt(radius_square - height * height);
  constexpr int kNodes = 4000;
  double force = 0.0;
  for (int i = 0; i <= kNodes; ++i) {
    const double t = 0.5 * benchmarks::kPi * i / kNodes, rho = rim * std::sin(t);
    double z = height;
    for (int step = 0; step < 30; ++step) {  // ball = plane at z
      const auto [p, rate] = ball(rho * rho + z * z);
      z -= (p - kStiffness * (height - z)) / (2.0 * z * rate + kStiffness);
    }
    const double weight = i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
    force += weight * rho * kStiffness * (height - z) * rim * std::cos(t);
  }
  return force * 2.0 * benchmarks::kPi * 0.5 * benchmarks::kPi / kNodes / 3.0;
}

TEST(DeepContact, OfABallInAStiffPlaneIsItsIntegralPastItsMiddle) {
  for (const double height : {-0.15, -0.08, -0.05, -0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03, 0.06, 0.1, 0.15}) {
    for (const double error : {1e-3, 1e-6, 1e-8}) {
      const ContactSurface::Summary s = ball_on_plane(height, error);
      const double exact = force_on_plane(height);
      EXPECT_EQ(s.rule, ContactRule::Polar) << height;
      EXPECT_LE(s.error_estimate, error) << height;
      EXPECT_NEAR(s.force.z(), exact, s.error_estimate * exact + 1e-10 * exact) << height << ' ' << error;
    }
  }
}

TEST(DeepContact, OfABallInAStiffPlaneHasTheGradientOfItsEnergyAsForce) {
  constexpr double kStep = 1e-4;  // the third derivative of the energy is about that of F h / R^2: 1e-8 F
  for (const double height : {-0.1, -0.03, 0.0, 0.03, 0.1}) {
    const double rate = (ball_on_plane(height + kStep, 1e-8).energy - ball_on_plane(height - kStep, 1e-8).energy) / (2.0 * kStep);
    EXPECT_NEAR(rate, force_on_plane(height), 2e-5 * force_on_plane(0.0)) << height;
  }
}

TEST(DeepContact, OfBallsHasTrueBoundsToADepthOfMoreThanARadius) {
  constexpr double kRadius = 0.4;
  for (const double share : {1.9, 1.7, 1.5, 1.3, 1.2, 1.15, 1.1, 1.05, 1.0, 0.95, 0.9}) {
    const double far = share * kRadius;
    benchmarks::Rigid a(benchmarks::linear_sphere(kRadius), benchmarks::kLinearModulus * kModulus, 0.03);
    benchmarks::Rigid b(benchmarks::linear_sphere(kRadius), benchmarks::kLinearModulus * kModulus, 0.03);
    a.put({});
    b.put({Vec3(far, 0.0, 0.0), Quat::Identity()});
    const benchmarks::Answer exact = benchmarks::spheres(kRadius, kModulus, kRadius, kModulus, far, Vec3::Zero(), Vec3::UnitX());
    for (const double error : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10}) {
      const ContactSurface::Summary s = query({a.body(), b.body()}, error);
      EXPECT_LE(s.error_estimate, error) << share;
      EXPECT_LE(benchmarks::difference(s, exact), s.error_estimate + 1e-12) << share << ' ' << error;
    }
  }
}

}  // namespace
}  // namespace supple::collision
