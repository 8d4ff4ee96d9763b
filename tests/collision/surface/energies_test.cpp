// Energies of contacts, and what they may be off by, beside sums over the volumes that bodies lose.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "../../benchmarks/several_bodies.h"
#include "../../benchmarks/timed_query.h"

namespace supple::collision {
namespace {

using benchmarks::BodiesInOnePlace;
using benchmarks::ContactsOfBodies;
using benchmarks::force_left;
using benchmarks::lost_volumes;
using benchmarks::LostVolumes;
using benchmarks::TimedQuery;

constexpr int kColumns = 192;

double sum_of(std::span<const double> values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// The energy of groups of bodies is within the estimates of their pairs.
void expect_estimates_to_hold(int bodies_each, int groups, std::uint64_t first_seed) {
  TimedQuery query;
  for (int n = 0; n < groups; ++n) {
    const BodiesInOnePlace place(bodies_each, first_seed + static_cast<std::uint64_t>(n));
    const std::vector<ContactBody> bodies = place.bodies();
    const LostVolumes exact = lost_volumes(bodies, kColumns), half = lost_volumes(bodies, kColumns / 2);
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

/// Forces on all bodies of a group are within their estimates.
void expect_forces_within_estimates(int bodies_each, std::uint64_t seed) {
  const BodiesInOnePlace place(bodies_each, seed);
  const std::vector<ContactBody> bodies = place.bodies();
  const LostVolumes exact = lost_volumes(bodies, kColumns), half = lost_volumes(bodies, kColumns / 2);
  TimedQuery query;
  for (const double error : {1e-2, 1e-3, 1e-4}) {
    const ContactsOfBodies found(bodies.size(), query.ask(bodies, error));
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      EXPECT_LE((found.force[b] - exact.force[b]).norm(), force_left(exact, half, b) + found.off[b]) << seed << ' ' << b << ' ' << error;
    }
  }
}

// A rod presses on the patch of another one and an ellipsoid beside a kink, where no imprint is found from the middle of the patch.
TEST(ForcesOfSeveral, LeaveOutWhatAThirdBodyTakesBesideAKink) { expect_forces_within_estimates(3, 10155); }

// Third bodies leave a pair a small share of its patch, at its border and between the nodes of a star.
TEST(ForcesOfSeveral, HoldWhatThirdBodiesLeaveOfAPatch) {
  expect_forces_within_estimates(4, 320086);
  expect_forces_within_estimates(4, 320094);
}

// Rays of a star lead to another sheet of Sigma, which does not press, and so do those beside them.
TEST(ForcesOfSeveral, HoldWhatRaysLoseToAnotherSheet) { expect_forces_within_estimates(3, 350099); }

/// Field evaluations of all pairs of a group; none where a pair is marched for its force, or where no third body takes part.
std::optional<double> evaluations_of(std::span<const ContactBody> bodies, bool energy) {
  ContactCandidates candidates;
  ContactSurface surface;
  const Executor executor(1);
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = 1e-3, .energy = energy}, executor, surface);
  if (surface.summary.size() < 2) return std::nullopt;
  double sum = 0.0;
  for (const ContactSurface::Summary& s : surface.summary) {
    if (!energy && s.rule != ContactRule::Polar) return std::nullopt;
    sum += static_cast<double>(s.evaluations);
  }
  return sum;
}

// All pairs of a body share one search for its apex. Panels are not divided where its pressure hardly falls along a column: pairs would be marched for their energy.
TEST(EnergiesOfSeveral, TakeAFewTimesTheEvaluationsOfForces) {
  int groups = 0;
  for (std::uint64_t seed = 9917; seed < 9943; ++seed) {
    const BodiesInOnePlace place(3, seed);
    const std::vector<ContactBody> bodies = place.bodies();
    const std::optional<double> forces = evaluations_of(bodies, false);
    if (!forces) continue;
    ++groups;
    EXPECT_LT(evaluations_of(bodies, true).value(), 8.0 * *forces) << seed;
  }
  EXPECT_GE(groups, 7);
}

// A third body takes a small part of a patch: a star holds what flows out of the bodies to the error, and imprints confirm it.
TEST(EnergiesOfSeveral, AreNotMarchedBesideSmallImprints) {
  TimedQuery query;
  const BodiesInOnePlace place(3, 9917);
  const std::vector<ContactBody> bodies = place.bodies();
  EXPECT_EQ(query.ask(bodies, 1e-3).size(), 3u);
  for (const ContactSurface::Summary& s : query.surface.summary) EXPECT_EQ(s.rule, ContactRule::Polar) << s.bodies.a << ' ' << s.bodies.b;
}

// At an error that coarse meshes meet, marching takes no finer ones.
TEST(Marching, TakesFewerPointsAtCoarserErrors) {
  std::array<std::size_t, 2> points{};
  TimedQuery query;
  for (std::uint64_t seed = 9917; seed < 9927; ++seed) {
    const BodiesInOnePlace place(3, seed);
    const std::vector<ContactBody> bodies = place.bodies();
    for (const std::size_t k : {0u, 1u}) {
      for (const ContactSurface::Summary& s : query.ask(bodies, k == 0 ? 1e-3 : 1e-4)) {
        EXPECT_LE(s.error_estimate, k == 0 ? 1.01e-3 : 1.01e-4) << seed;
        points[k] += s.rule == ContactRule::March ? s.points : 0;
      }
    }
  }
  EXPECT_LT(static_cast<double>(points[0]), 0.5 * static_cast<double>(points[1]));
}

// Columns out of the bodies go through where second derivatives of their pressures jump: above the rim of a disc, at the ends of a rod.
TEST(EnergiesOfSeveral, HoldWhereColumnsCrossKinks) {
  constexpr double kError = 1e-4;
  TimedQuery query;
  for (const std::uint64_t seed : {9965u, 330158u, 330254u}) {
    const BodiesInOnePlace place(3, seed);
    const std::vector<ContactBody> bodies = place.bodies();
    const LostVolumes exact = lost_volumes(bodies, kColumns), half = lost_volumes(bodies, kColumns / 2);
    for (const double error : {1e-3, kError}) {
      const double off = std::abs(ContactsOfBodies(bodies.size(), query.ask(bodies, error)).energy - exact.energy);
      EXPECT_LE(off, sum_of(query.estimate_energies(bodies, error)) + energy_left(exact, half)) << seed << ' ' << error;
    }
    EXPECT_NEAR(ContactsOfBodies(bodies.size(), query.ask(bodies, kError)).energy, exact.energy, kError * exact.energy + energy_left(exact, half)) << seed;
  }
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
    const double energy = lost_volumes(bodies, kColumns).energy;
    EXPECT_NEAR(ContactsOfBodies(bodies.size(), query.ask(bodies, 1e-4)).energy, energy, kOff * energy) << seed;
  }
}

/// A corner of the region reaches into a cell between its columns, and between those of its quarters.
TEST(SqueezedRegions, HoldCornersBetweenColumns) {
  TimedQuery query;
  const BodiesInOnePlace place(2, 10125);
  const std::vector<ContactBody> bodies = place.bodies();
  const LostVolumes exact = lost_volumes(bodies, kColumns), half = lost_volumes(bodies, kColumns / 2);
  for (const double error : {1e-3, 1e-4, 1e-6}) {
    const double off = std::abs(ContactsOfBodies(bodies.size(), query.ask(bodies, error)).energy - exact.energy);
    EXPECT_LE(off, 5e-4 * exact.energy) << error;
    EXPECT_LE(off, sum_of(query.estimate_energies(bodies, error)) + energy_left(exact, half)) << error;
  }
}

}  // namespace
}  // namespace supple::collision
