/// @file contact_several.cpp
/// Contact queries of two to four bodies in one place, drawn at random; one JSON object per number of bodies and given error. Forces and energies are compared
/// with sums over columns through the volumes that the bodies lose, forces with differences of the energy, and times with those of the same pairs without third
/// bodies. Groups are named by the seeds that draw them.
///   contact_several [GROUPS] [SEED]
#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "programs.h"
#include "several_bodies.h"
#include "timed_query.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

constexpr int kColumns = 192;
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
  int unmet = 0;
  double largest_over_estimate = 0.0, energy_over_estimate = 0.0;
  std::vector<std::uint64_t> beyond_estimate, energies_off, energies_beyond_estimate;  // groups
  std::vector<double> cpu_us, over_alone, energy_estimate;  // the last over the energy

  void add(std::uint64_t group, const ContactsOfBodies& found, const LostVolumes& exact, const LostVolumes& rough, double error) {
    unmet += found.largest_estimate > 1.01 * error ? 1 : 0;
    bool beyond = false;
    for (std::size_t b = 0; b < found.force.size(); ++b) {
      const double off = (found.force[b] - exact.force[b]).norm() - force_left(exact, rough, b);
      beyond = beyond || off > found.off[b];
      largest_over_estimate = std::max(largest_over_estimate, off / std::max(found.off[b], std::numeric_limits<double>::min()));
    }
    if (beyond) beyond_estimate.push_back(group);
    if (std::abs(found.energy - exact.energy) > error * exact.energy + energy_left(exact, rough)) energies_off.push_back(group);
  }
  /// @param off  of the energy of all pairs, less what columns leave   @param estimate  of that [J]
  void add_estimate(std::uint64_t group, double off, double estimate, double energy) {
    if (off > estimate) energies_beyond_estimate.push_back(group);
    energy_over_estimate = std::max(energy_over_estimate, off / std::max(estimate, std::numeric_limits<double>::min()));
    if (energy > 0.0) energy_estimate.push_back(estimate / energy);
  }
  static double middle(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  }
  static std::string list(std::span<const std::uint64_t> groups) {
    std::string out;
    for (const std::uint64_t group : groups) out += (out.empty() ? "" : ", ") + std::to_string(group);
    return "[" + out + "]";
  }
  void print(int bodies, double error, double slope_off) const {
    std::printf("{\"name\": \"collision/several/%d/error=%g\", \"groups\": %zu, \"cpu_us_median\": %.0f, \"cpu_us_worst\": %.0f, \"over_pairs_alone_median\": %.2g, "
                "\"over_pairs_alone_worst\": %.2g, \"unmet\": %d, \"forces_beyond_estimate\": %s, \"worst_force_over_estimate\": %.2g, \"energies_off\": %s, "
                "\"energies_beyond_estimate\": %s, \"worst_energy_over_estimate\": %.2g, \"energy_estimate_median\": %.2g, \"worst_force_less_energy_slope\": %.2g}\n",
                bodies, error, cpu_us.size(), middle(cpu_us), *std::max_element(cpu_us.begin(), cpu_us.end()), middle(over_alone),
                *std::max_element(over_alone.begin(), over_alone.end()), unmet, list(beyond_estimate).c_str(), largest_over_estimate, list(energies_off).c_str(),
                list(energies_beyond_estimate).c_str(), energy_over_estimate, energy_estimate.empty() ? 0.0 : middle(energy_estimate), slope_off);
    std::fflush(stdout);
  }
};

void measure(int count, int groups, std::uint64_t seed) {
  constexpr std::array<double, 3> kErrors{1e-2, 1e-3, 1e-4};
  std::array<Figures, kErrors.size()> figures;
  double slope_off = 0.0;
  TimedQuery query;
  for (int n = 0; n < groups; ++n) {
    const std::uint64_t group = seed + static_cast<std::uint64_t>(n);
    BodiesInOnePlace place(count, group);
    const std::vector<collision::ContactBody> bodies = place.bodies();
    const LostVolumes exact = lost_volumes(bodies, kColumns), rough = lost_volumes(bodies, kColumns / 2);
    for (std::size_t k = 0; k < kErrors.size(); ++k) {
      const ContactsOfBodies found(bodies.size(), query.ask(bodies, kErrors[k], 3));
      figures[k].add(group, found, exact, rough, kErrors[k]);
      figures[k].cpu_us.push_back(query.cpu_us);
      const std::vector<double> estimates = query.estimate_energies(bodies, kErrors[k]);
      figures[k].add_estimate(group, std::abs(found.energy - exact.energy) - energy_left(exact, rough), std::accumulate(estimates.begin(), estimates.end(), 0.0), exact.energy);
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
