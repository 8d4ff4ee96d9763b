#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Linear;
using testing::LinearSphere;
using testing::Stage;

constexpr double kHeight = 0.8, kRim = 0.6;  // of the centres of two balls of radius 1 over the plane between them; its radius

/// A linear sphere that tells its core.
struct CoredSphere : LinearSphere {
  [[nodiscard]] std::optional<implicit::CorePoint> core_point(const Vec3&) const { return implicit::CorePoint{centre, profile.a, true}; }
};

double pressure_of_pair(const Vec3& x) { return 1.0 - std::sqrt(kHeight * kHeight + x.squaredNorm()); }

/// Integrals over a part of the plane.
struct Sums {
  double force = 0.0, area = 0.0;
  Vec3 first = Vec3::Zero();

  void add(const Vec3& x, double weight) {
    const double p = pressure_of_pair(x);
    force += weight * p;
    area += weight;
    first += weight * p * x;
  }
  Sums& operator-=(const Sums& other) {
    force -= other.force;
    area -= other.area;
    first -= other.first;
    return *this;
  }
};

/// About a place, out to where `inside` ends on every ray: equal angles, and Gauss's rule in the radius.
template <class Inside>
Sums star_about(const Vec3& middle, double most, const Inside& inside) {
  constexpr int kAngles = 4000, kCells = 4;
  const double root = std::sqrt(0.6);
  constexpr double kStep = 2.0 * std::numbers::pi / kAngles;
  Sums sums;
  for (int i = 0; i < kAngles; ++i) {
    const Vec3 e(std::cos(kStep * i), std::sin(kStep * i), 0.0);
    double low = 0.0, high = most;
    for (int step = 0; step < 50; ++step) (inside(middle + 0.5 * (low + high) * e) ? low : high) = 0.5 * (low + high);
    for (int j = 0; j < kCells; ++j) {
      const auto add = [&](double at, double share) {
        const double r = low * (j + 0.5 + 0.5 * at) / kCells;
        sums.add(middle + r * e, kStep * low / kCells / 18.0 * share * r);
      };
      add(-root, 5.0);
      add(0.0, 8.0);
      add(root, 5.0);
    }
  }
  return sums;
}

struct Ball {
  CoredSphere field;
  double modulus;
  [[nodiscard]] bool presses_harder(const Vec3& x) const {
    return modulus * field.profile.value((x - field.centre).norm()) > pressure_of_pair(x);
  }
};

/// A ball somewhere on the patch; number i of a sequence.
Ball ball(int i, double largest) {
  const auto part = [i](double step) { return std::fmod(0.37 + step * i, 1.0); };
  const double r = kRim * std::sqrt(part(0.618)), turn = 2.0 * std::numbers::pi * part(0.414);
  const double radius = largest * (0.1 + 0.9 * part(0.732));
  Ball b;
  b.field.centre = Vec3(r * std::cos(turn), r * std::sin(turn), 0.3 * radius * part(0.871));
  b.field.profile = Linear{radius, 1.0};
  b.modulus = std::pow(10.0, 1.5 * part(0.236)) / radius;
  return b;
}

/// The contact of the two balls beside others that are not near to one another. @param tell  their cores  @param errors  asked for
void expect_within_bounds(std::span<const Ball> others, bool tell, std::initializer_list<double> errors) {
  static const Sums whole = star_about(Vec3::Zero(), 1.0, [](const Vec3& x) { return pressure_of_pair(x) > 0.0; });
  const LinearSphere a{Vec3(0, 0, kHeight), Linear{1.0, 1.0}}, b{Vec3(0, 0, -kHeight), Linear{1.0, 1.0}};
  Stage stage;
  stage.add(a);
  stage.add(b);
  Sums exact = whole;
  for (const Ball& other : others) {
    const Vec3& at = other.field.centre;
    stage.add(tell ? implicit::FieldView(other.field) : implicit::FieldView(static_cast<const LinearSphere&>(other.field)), {at}, other.modulus);
    exact -= star_about(Vec3(at.x(), at.y(), 0.0), 2.0 * other.field.profile.a,
                        [&](const Vec3& x) { return pressure_of_pair(x) > 0.0 && other.presses_harder(x); });
  }
  stage.rules.allowed = [](std::uint32_t i, std::uint32_t j) { return std::min(i, j) == 0; };
  for (const double error : errors) {
    const ContactSurface::Summary s = stage.solve({.error = error}).summary.at(0);
    ASSERT_EQ(s.bodies, (BodyPair{0, 1}));
    EXPECT_EQ(s.rule, ContactRule::Polar);
    EXPECT_LE(s.error_estimate, error) << others[0].field.centre.transpose();
    // Where the rim cuts an imprint, the radii of its rays have kinks, which cost the sum a share of the square of the step, which is 2e-6.
    const double most = s.error_estimate + 2e-7;
    EXPECT_NEAR(s.force.z(), exact.force, most * exact.force) << others[0].field.centre.transpose() << ' ' << error;
    EXPECT_NEAR(s.area, exact.area, most * exact.area) << others[0].field.centre.transpose() << ' ' << error;
    EXPECT_LE((s.centre_of_pressure - exact.first / exact.force).norm(), most * std::sqrt(exact.area)) << others[0].field.centre.transpose() << ' ' << error;
  }
}

TEST(Imprints, OfBallsBetweenThePointsOfTheRuleAreLeftOut) {
  // The first is the case that was once missed: a ball of .05 with a modulus of 10, from the peak to the rim.
  for (int i = 0; i < 13; ++i) {
    const double turn = 0.1 + 0.5 * i, r = 0.049 * i;
    Ball small{{{Vec3(r * std::cos(turn), r * std::sin(turn), 0.0), Linear{0.05, 1.0}}}, 10.0};
    expect_within_bounds({&small, 1}, i % 2 == 0, {1e-2, 1e-6});
  }
  for (int i = 0; i < 14; ++i) {
    const Ball any = ball(i, i % 2 == 0 ? 0.1 : 0.3);
    expect_within_bounds({&any, 1}, i % 4 < 2, {1e-2, 1e-6});
  }
}

TEST(Imprints, ThatTheRimCutsAreLeftOut) {
  for (int i = 0; i < 6; ++i) {
    const double turn = 0.3 + i, r = 0.5896;
    Ball small{{{Vec3(r * std::cos(turn), r * std::sin(turn), 0.0163), Linear{0.075, 1.0}}}, 265.5};
    expect_within_bounds({&small, 1}, i % 2 == 0, {1e-2, 1e-6});
  }
}

TEST(Imprints, OnABentPatchAreThoseOfAFineRule) {
  // Two unequal balls. The last core lies beyond the rim, where the place nearest to it is not below it along the axis.
  const LinearSphere a{Vec3(0, 0, kHeight), Linear{1.0, 1.0}}, b{Vec3(0, 0, -0.45), Linear{0.7, 1.0}};
  for (const auto& [i, error] : std::vector<std::pair<int, double>>{{32, 1e-6}, {35, 1e-6}, {51, 1e-2}}) {
    Ball any = ball(i, 0.3);
    any.field.centre.z() += 0.12 + 0.1 * any.field.centre.head<2>().squaredNorm();
    const auto solved = [&](double asked) {
      Stage stage;
      stage.add(a);
      stage.add(b, {Vec3::Zero()}, 3.0);
      stage.add(any.field, {any.field.centre}, any.modulus);
      stage.rules.allowed = [](std::uint32_t x, std::uint32_t y) { return std::min(x, y) == 0; };
      return stage.solve({.error = asked}).summary.at(0);
    };
    const ContactSurface::Summary s = solved(error), fine = solved(1e-9);
    const double most = s.error_estimate + fine.error_estimate;
    EXPECT_LE((s.force - fine.force).norm(), most * fine.force.norm()) << i;
    EXPECT_NEAR(s.area, fine.area, most * fine.area) << i;
    EXPECT_LE((s.centre_of_pressure - fine.centre_of_pressure).norm(), most * std::sqrt(fine.area)) << i;
  }
}

TEST(Imprints, OfSeveralBallsAreLeftOut) {
  for (int i = 0; i < 3; ++i) {
    std::vector<Ball> balls;
    for (int k = 0; balls.size() < 4; ++k) {
      const Ball next = ball(17 * i + k, 0.06);
      const auto near = [&](const Ball& b) { return (b.field.centre - next.field.centre).norm() < b.field.profile.a + next.field.profile.a; };
      if (std::none_of(balls.begin(), balls.end(), near)) balls.push_back(next);
    }
    expect_within_bounds(balls, i % 2 == 0, {1e-2, 1e-5});
  }
}

}  // namespace
}  // namespace supple::collision
