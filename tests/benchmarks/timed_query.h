/// @file timed_query.h
/// Contact queries by one thread, with the processor time that they take.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "contact_shapes.h"

namespace supple::benchmarks {

struct TimedQuery {
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  double cpu_us = 0.0;  ///< least of the repeats

  const std::vector<collision::ContactSurface::Summary>& ask(std::span<const collision::ContactBody> bodies, double error, int repeats = 1) {
    const Executor executor(1);
    cpu_us = std::numeric_limits<double>::infinity();
    for (int i = 0; i < repeats; ++i) {
      const double start = cpu_microseconds();
      find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
      cpu_us = std::min(cpu_us, cpu_microseconds() - start);
    }
    return surface.summary;
  }
  /// Of the last answer. @return of each pair [J]
  [[nodiscard]] std::vector<double> estimate_energies(std::span<const collision::ContactBody> bodies, double error) const {
    return collision::estimate_energies(bodies, candidates, {.error = error}, Executor(1), surface);
  }
};

}  // namespace supple::benchmarks
