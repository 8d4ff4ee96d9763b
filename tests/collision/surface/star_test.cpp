/// Stars: panels in angle and radius about a point that sees the rim of a patch, cut where third bodies press harder.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "../../collision/src/surface/panels/plane_chart.h"
#include "benchmarks/several_bodies.h"
#include "collision/bodies.h"

namespace supple::collision {
namespace {

/// A star that reaches 1 + 0.3 cos 2t + 0.1 sin 3t over half axes of 2 and 0.5.
PlaneChart star() {
  std::vector<double> reach;
  for (int k = 0; k < 64; ++k) {
    const double t = 2.0 * std::numbers::pi * k / 64.0;
    reach.push_back(1.0 + 0.3 * std::cos(2.0 * t) + 0.1 * std::sin(3.0 * t));
  }
  return {{2.0, 0.5}, PlaneChart::waves_of(reach)};
}

TEST(PlaneChart, HasTheDerivativesOfItsPlacesAndFindsThemAgain) {
  const PlaneChart chart = star();
  constexpr double kStep = 1e-6;
  for (const double angle : {0.1, 1.3, 2.9, 4.0, 6.1}) {
    for (const double share : {0.05, 0.5, 0.95}) {
      const PlaneChart::Place place{angle, share}, at = chart.at(place), back = chart.place_of(at);
      EXPECT_NEAR(back[0], angle, 1e-12);
      EXPECT_NEAR(back[1], share, 1e-12);
      // Rows of the Jacobian are what the slopes (1, 0) and (0, 1) over the plane become.
      const PlaneChart::Place u = chart.slopes(place, {1.0, 0.0}), v = chart.slopes(place, {0.0, 1.0});
      for (const std::size_t k : {0u, 1u}) {
        PlaneChart::Place more = place, less = place;
        more[k] += kStep;
        less[k] -= kStep;
        const PlaneChart::Place to = chart.at(more), from = chart.at(less);
        EXPECT_NEAR(u[k], (to[0] - from[0]) / (2.0 * kStep), 1e-8);
        EXPECT_NEAR(v[k], (to[1] - from[1]) / (2.0 * kStep), 1e-8);
      }
      EXPECT_NEAR(chart.stretch(place), std::abs(u[0] * v[1] - u[1] * v[0]), 1e-12);
    }
  }
}

TEST(PlaneChart, OfAStarReachesEverywhere) {
  // A spike eight times as long as the rest: the sum of waves stays positive.
  std::vector<double> reach(64, 1.0);
  reach[10] = 8.0;
  const PlaneChart chart{{1.0, 1.0}, PlaneChart::waves_of(reach)};
  for (int k = 0; k < 200; ++k) EXPECT_GT(chart.stretch({2.0 * std::numbers::pi * k / 200.0, 1.0}), 0.0) << k;
}

std::vector<ContactSurface::Summary> query(std::span<const ContactBody> bodies, double error, bool energy = true) {
  const Executor executor(1);
  ContactCandidates candidates;
  ContactSurface surface;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = error, .energy = energy}, executor, surface);
  return surface.summary;
}

/// Groups of bodies in one place: forces within their estimates and energies within the error of sums over the volumes that the bodies lose.
void expect_forces_and_energy_of_volumes(int bodies_each, int groups, std::uint64_t first_seed) {
  constexpr int kColumns = 96;
  int all_touch = 0;
  for (int n = 0; n < groups; ++n) {
    const benchmarks::BodiesInOnePlace place(bodies_each, first_seed + static_cast<std::uint64_t>(n));
    const std::vector<ContactBody> bodies = place.bodies();
    const benchmarks::LostVolumes exact = benchmarks::lost_volumes(bodies, kColumns), half = benchmarks::lost_volumes(bodies, kColumns / 2);
    for (const double error : {1e-2, 1e-3}) {
      const benchmarks::ContactsOfBodies found(bodies.size(), query(bodies, error));
      EXPECT_LE(found.largest_estimate, 1.01 * error) << n;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        EXPECT_LE((found.force[b] - exact.force[b]).norm(), found.off[b] + force_left(exact, half, b)) << n << ' ' << b << ' ' << error;
      }
      EXPECT_NEAR(found.energy, exact.energy, error * exact.energy + energy_left(exact, half)) << n << ' ' << error;
      all_touch += found.pairs == bodies.size() * (bodies.size() - 1) / 2 ? 1 : 0;
    }
  }
  EXPECT_GE(all_touch, groups / 2);
}

TEST(Star, OfRandomTriplesHasTheForcesAndTheEnergyOfTheVolumesThatTheyLose) { expect_forces_and_energy_of_volumes(3, 10, 100); }
TEST(Star, CountsNoEnergyTwiceWhereAThirdBodyPressesBesideSigma) {
  struct Ball {
    double modulus, support;
    Vec3 at;
  };
  const std::array balls{Ball{3.28, 0.395, Vec3(-0.084, 0.077, -0.098)}, Ball{1.99, 0.432, Vec3(0.063, 0.078, -0.194)}, Ball{2.56, 0.474, Vec3(0.001, 0.059, -0.127)}};
  for (const bool convex : {true, false}) {  // as far as is known
    std::vector<benchmarks::Rigid> rigid;
    rigid.reserve(balls.size());
    std::vector<testing::RadialField<testing::Wyvill>> field;
    field.reserve(balls.size());
    std::vector<ContactBody> bodies;
    for (const Ball& ball : balls) {
      rigid.emplace_back(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), ball.support), ball.modulus, 0.05);
      rigid.back().put({ball.at, Quat::Identity()});
      field.push_back({ball.at, {ball.support, 0.5}});
      bodies.push_back(rigid.back().body());
      if (!convex) bodies.back().field = field.back();
    }
    const benchmarks::LostVolumes exact = benchmarks::lost_volumes(bodies, 96);
    const benchmarks::ContactsOfBodies found(bodies.size(), query(bodies, 1e-3));
    EXPECT_NEAR(found.energy, exact.energy, 5e-3 * exact.energy) << convex;
  }
}

/// Three equal balls. The third one reaches over the rim of the patch of the others, on a part that is long and narrow, and about as much as may be left.
TEST(Star, LeavesNoMoreToAThirdBodyThanItsEstimateTells) {
  std::vector<benchmarks::Rigid> rigid;
  rigid.reserve(3);
  for (int b = 0; b < 3; ++b) rigid.emplace_back(benchmarks::linear_sphere(1.0), benchmarks::kLinearModulus, 0.2);
  for (const double deep : {0.05, 0.2}) {
    const double rim = std::sqrt(deep - 0.25 * deep * deep);
    rigid[0].put({Vec3(0.5 * deep - 1.0, 0, 0), Quat::Identity()});
    rigid[1].put({Vec3(1.0 - 0.5 * deep, 0, 0), Quat::Identity()});
    for (int i = 70; i < 130; i += 3) {
      rigid[2].put({Vec3(0.03, 1.0 + rim * (1.0 - 0.3 * i / 400.0), 0.1), Quat::Identity()});
      const std::vector<ContactBody> bodies{rigid[0].body(), rigid[1].body(), rigid[2].body()};
      const ContactSurface::Summary s = query(bodies, 1e-2).at(0), fine = query(bodies, 1e-6).at(0);
      EXPECT_LE(s.error_estimate, 1e-2) << i;
      const double most = s.error_estimate + fine.error_estimate;
      EXPECT_NEAR(s.area, fine.area, most * fine.area) << deep << ' ' << i;
      EXPECT_LE((s.force - fine.force).norm(), most * fine.force.norm()) << deep << ' ' << i;
    }
  }
}

/// Pairs that go through each other have two patches. Without energies no columns tell of the second one.
TEST(Star, HasTheForcesOfBodiesThatGoThroughEachOtherWithoutTheirEnergies) {
  constexpr double kError = 1e-3;
  for (const std::uint64_t seed : {5007u, 2026u, 2027u, 2028u}) {
    const benchmarks::BodiesInOnePlace place(4, seed);
    const std::vector<ContactBody> bodies = place.bodies();
    for (std::size_t a = 0; a < bodies.size(); ++a) {
      for (std::size_t b = a + 1; b < bodies.size(); ++b) {
        const std::array pair{bodies[a], bodies[b]};
        const auto with = query(pair, kError), without = query(pair, kError, false);
        if (with.empty() || !(with.front().load > 0.0)) continue;
        ASSERT_EQ(without.size(), 1u) << seed << ' ' << a << ' ' << b;
        EXPECT_LE((with.front().force - without.front().force).norm(), 2.0 * kError * std::max(with.front().force.norm(), 1e-3 * with.front().load)) << seed << ' ' << a << ' ' << b;
        EXPECT_NEAR(with.front().area, without.front().area, 2.0 * kError * with.front().area) << seed << ' ' << a << ' ' << b;
      }
    }
  }
}

/// One of which Sigma seems far away, to first order, from a place that it is near to.
TEST(Star, HasTheEnergyWhereSigmaIsNearToTheMiddleOfABody) { expect_forces_and_energy_of_volumes(3, 1, 9917 + 51); }

/// One of three, as one pair of them meets on a closed surface that lies in the third body.
TEST(Star, LiesInTheThirdBodyWithAllOfAClosedSurface) { expect_forces_and_energy_of_volumes(3, 1, 2026 + 49); }
TEST(Star, OfRandomQuadruplesHasTheForcesAndTheEnergyOfTheVolumesThatTheyLose) { expect_forces_and_energy_of_volumes(4, 5, 200); }

}  // namespace
}  // namespace supple::collision
