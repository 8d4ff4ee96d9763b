// Energies of contacts, and what they may be off by, beside sums over the volumes that bodies lose.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "../../benchmarks/several_bodies.h"
#include "../../benchmarks/timed_query.h"

namespace supple::collision {
namespace {

using benchmarks::BodiesInOnePlace;
using benchmarks::ContactsOfBodies;
using benchmarks::lost_volumes;
using benchmarks::LostVolumes;
using benchmarks::TimedQuery;

constexpr int kCells = 192;

double sum_of(std::span<const double> values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// The energy of groups of bodies is within the estimates of their pairs.
void expect_estimates_to_hold(int bodies_each, int groups, std::uint64_t first_seed) {
  TimedQuery query;
  for (int n = 0; n < groups; ++n) {
    const BodiesInOnePlace place(bodies_each, first_seed + static_cast<std::uint64_t>(n));
    const std::vector<ContactBody> bodies = place.bodies();
    const LostVolumes exact = lost_volumes(bodies, kCells), half = lost_volumes(bodies, kCells / 2);
    for (const double error : {1e-2, 1e-3, 1e-4}) {
      const ContactsOfBodies found(bodies.size(), query.ask(bodies, error));
      const double estimate = sum_of(query.estimate_energies(bodies, error));
      EXPECT_LE(std::abs(found.energy - exact.energy), estimate + energy_left(exact, half)) << n << ' ' << error;
    }
  }
}

TEST(EnergyEstimates, HoldForPairs) { expect_estimates_to_hold(2, 20, 400); }
TEST(EnergyEstimates, HoldForTriples) { expect_estimates_to_hold(3, 6, 400); }
TEST(EnergyEstimates, HoldForQuadruples) { expect_estimates_to_hold(4, 3, 400); }

TEST(EnergyEstimates, AreAboutTheErrorAskedForAtMost) {
  TimedQuery query;
  int pairs = 0;
  for (int n = 0; n < 20; ++n) {
    const BodiesInOnePlace place(2, 700 + static_cast<std::uint64_t>(n));
    const std::vector<ContactBody> bodies = place.bodies();
    for (const double error : {1e-2, 1e-3}) {
      const ContactsOfBodies found(bodies.size(), query.ask(bodies, error));
      const std::vector<double> estimate = query.estimate_energies(bodies, error);
      EXPECT_EQ(estimate.size(), query.surface.summary.size());
      if (!(found.energy > 0.0)) continue;
      ++pairs;
      EXPECT_LE(sum_of(estimate), 5.0 * error * found.energy) << n << ' ' << error;
      EXPECT_GT(sum_of(estimate), 0.0) << n << ' ' << error;
    }
  }
  EXPECT_GE(pairs, 20);
}

TEST(EnergyEstimates, AreNoneWithoutContact) {
  TimedQuery query;
  BodiesInOnePlace place(2, 400);
  place.move(0, Vec3(10.0, 0.0, 0.0));
  const std::vector<ContactBody> bodies = place.bodies();
  EXPECT_TRUE(query.ask(bodies, 1e-3).empty());
  EXPECT_TRUE(query.estimate_energies(bodies, 1e-3).empty());
}

/// Volumes and energies of regions that are filled by parallel columns, where these go through in short pieces, and where the pressure is no polynomial along them.
TEST(SqueezedRegions, HoldShortPiecesOfColumns) {
  constexpr double kOff = 1e-4;
  TimedQuery query;
  for (const std::uint64_t seed : {9917u + 28u, 9917u + 57u}) {
    const BodiesInOnePlace place(2, seed);
    const std::vector<ContactBody> bodies = place.bodies();
    const double energy = lost_volumes(bodies, kCells).energy;
    EXPECT_NEAR(ContactsOfBodies(bodies.size(), query.ask(bodies, 1e-4)).energy, energy, kOff * energy) << seed;
  }
}

}  // namespace
}  // namespace supple::collision
