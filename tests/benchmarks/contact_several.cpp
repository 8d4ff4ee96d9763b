/// @file contact_several.cpp
/// Contact queries of two to four bodies in one place, drawn at random; one JSON object per number of bodies and given error. Forces and energies are compared
/// with sums over the volumes that the bodies lose, forces with differences of the energy, and times with those of the same pairs without third bodies.
///   contact_several [GROUPS] [SEED]
#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <numeric>
#include <vector>

#include "programs.h"
#include "several_bodies.h"
#include "timed_query.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

constexpr int kCells = 96;
constexpr double kOfCells = 6e-3;  // of the largest load: what sums over that many cells leave
constexpr double kFineError = 1e-4, kStep = 2e-3;  // of the differences of the energy [m]

/// Of all pairs, each without the other bodies.
double time_alone(std::span<const collision::ContactBody> bodies, double error, TimedQuery& query) {
  double sum = 0.0;
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      const std::array pair{bodies[a], bodies[b]};
      query.ask(pair, error, 3);
      sum += query.cpu_us;
    }
  }
  return sum;
}

/// Largest difference of the force on the first body and the slope of the energy, over the force's load.
double off_energy(BodiesInOnePlace& place, const LostVolumes& exact, TimedQuery& query) {
  Vec3 slope;
  for (Eigen::Index k = 0; k < 3; ++k) {
    std::array<double, 2> energy{};
    for (const std::size_t side : {0u, 1u}) {
      place.move(0, (side == 0 ? -kStep : kStep) * Vec3::Unit(k));
      const auto bodies = place.bodies();
      energy[side] = ContactsOfBodies(bodies.size(), query.ask(bodies, kFineError)).energy;
    }
    slope[k] = (energy[1] - energy[0]) / (2.0 * kStep);
  }
  place.move(0, Vec3::Zero());
  const auto bodies = place.bodies();
  const ContactsOfBodies found(bodies.size(), query.ask(bodies, kFineError));
  return exact.load[0] > 0.0 ? (found.force[0] + slope).norm() / exact.load[0] : 0.0;
}

struct Figures {
  int beyond_estimate = 0, unmet = 0, energies_off = 0, energies_beyond_estimate = 0;
  double largest_over_estimate = 0.0, largest_energy = 0.0, energy_over_estimate = 0.0;
  int worst_force = -1, worst_energy = -1;  // groups
  std::vector<double> cpu_us, over_alone, energy_estimate;  // the last over the energy

  void add(int group, const ContactsOfBodies& found, const LostVolumes& exact, const LostVolumes& rough, double error) {
    unmet += found.largest_estimate > 1.01 * error ? 1 : 0;
    bool beyond = false;
    const double largest_load = *std::max_element(exact.load.begin(), exact.load.end());
    for (std::size_t b = 0; b < found.force.size(); ++b) {
      const double left = kOfCells * largest_load + (exact.force[b] - rough.force[b]).norm(), off = (found.force[b] - exact.force[b]).norm() - left;
      beyond = beyond || off > found.off[b];
      const double over = off > 0.0 ? off / std::max(found.off[b], std::numeric_limits<double>::min()) : 0.0;
      if (over > largest_over_estimate) worst_force = group;
      largest_over_estimate = std::max(largest_over_estimate, over);
    }
    beyond_estimate += beyond ? 1 : 0;
    const double energy = exact.energy > 0.0 ? std::abs(found.energy / exact.energy - 1.0) : 0.0;
    if (energy > largest_energy) worst_energy = group;
    largest_energy = std::max(largest_energy, energy);
    energies_off += energy > error + kOfCells ? 1 : 0;
  }
  /// @param off  of the energy of all pairs, less what sums over cells leave   @param estimate  of that [J]
  void add_estimate(double off, double estimate, double energy) {
    energies_beyond_estimate += off > estimate ? 1 : 0;
    energy_over_estimate = std::max(energy_over_estimate, off / std::max(estimate, std::numeric_limits<double>::min()));
    if (energy > 0.0) energy_estimate.push_back(estimate / energy);
  }
  static double middle(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  }
  void print(int bodies, double error, double slope_off) const {
    std::printf("{\"name\": \"collision/several/%d/error=%g\", \"groups\": %zu, \"cpu_us_median\": %.0f, \"cpu_us_worst\": %.0f, \"over_pairs_alone_median\": %.2g, "
                "\"unmet\": %d, \"forces_beyond_estimate\": %d, \"worst_force_over_estimate\": %.2g, \"of_group\": %d, \"energies_off\": %d, \"worst_energy\": %.2g, "
                "\"of_energy_of_group\": %d, \"energies_beyond_estimate\": %d, \"worst_energy_over_estimate\": %.2g, \"energy_estimate_median\": %.2g, "
                "\"worst_force_less_energy_slope\": %.2g}\n",
                bodies, error, cpu_us.size(), middle(cpu_us), *std::max_element(cpu_us.begin(), cpu_us.end()), middle(over_alone), unmet, beyond_estimate,
                largest_over_estimate, worst_force, energies_off, largest_energy, worst_energy,
                energies_beyond_estimate, energy_over_estimate, energy_estimate.empty() ? 0.0 : middle(energy_estimate), slope_off);
    std::fflush(stdout);
  }
};

void measure(int count, int groups, std::uint64_t seed) {
  constexpr std::array<double, 3> kErrors{1e-2, 1e-3, 1e-4};
  std::array<Figures, kErrors.size()> figures;
  double slope_off = 0.0;
  TimedQuery query;
  for (int n = 0; n < groups; ++n) {
    BodiesInOnePlace place(count, seed + static_cast<std::uint64_t>(n));
    const std::vector<collision::ContactBody> bodies = place.bodies();
    const LostVolumes exact = lost_volumes(bodies, kCells), rough = lost_volumes(bodies, kCells / 2);
    for (std::size_t k = 0; k < kErrors.size(); ++k) {
      const ContactsOfBodies found(bodies.size(), query.ask(bodies, kErrors[k], 3));
      figures[k].add(n, found, exact, rough, kErrors[k]);
      figures[k].cpu_us.push_back(query.cpu_us);
      const std::vector<double> estimates = query.estimate_energies(bodies, kErrors[k]);
      figures[k].add_estimate(std::abs(found.energy - exact.energy) - energy_left(exact, rough), std::accumulate(estimates.begin(), estimates.end(), 0.0), exact.energy);
      figures[k].over_alone.push_back(figures[k].cpu_us.back() / time_alone(bodies, kErrors[k], query));
    }
    slope_off = std::max(slope_off, off_energy(place, exact, query));
  }
  for (std::size_t k = 0; k < kErrors.size(); ++k) figures[k].print(count, kErrors[k], slope_off);
}

}  // namespace

int supple::benchmarks::programs::contact_several(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_several [GROUPS] [SEED]";
  answer_usage(argc, argv, kUsage, 2);
  const int groups = argc > 1 ? whole_number(kUsage, argv[1]) : 300;
  const std::uint64_t seed = argc > 2 ? whole_number<std::uint64_t>(kUsage, argv[2], 0) : 2026;
  for (const int count : {2, 3, 4}) measure(count, groups, seed);
  return 0;
}
