#include "supple/core/lennard_jones.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// Without cut-off: Phi, f = -Phi' and f'.
struct Plain {
  double energy, force, slope;
};

Plain plain_at(const LennardJones& law, double d) {
  const double n = law.repulsive, m = law.attractive;
  const double repulsive = math::pow(law.r0 / d, n);
  const double attractive = math::pow(law.r0 / d, m);
  const double gain = law.depth * n * m / (n - m);
  return {.energy = law.depth / (n - m) * (m * repulsive - n * attractive),
          .force = gain / d * (repulsive - attractive),
          .slope = gain / (d * d) * ((m + 1.0) * attractive - (n + 1.0) * repulsive)};
}

/// S, S' and S''.
struct Switch {
  double value, slope, second;
};

Switch switch_at(const LennardJones& law, double d) {
  const double width = law.cut_off - law.switch_from;
  const double t = std::clamp((d - law.switch_from) / width, 0.0, 1.0);
  return {.value = 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t)),
          .slope = -30.0 * t * t * (1.0 - t) * (1.0 - t) / width,
          .second = -60.0 * t * (1.0 - t) * (1.0 - 2.0 * t) / (width * width)};
}

Plain truncated_at(const LennardJones& law, double d) {
  const Plain here = plain_at(law, d);
  if (law.cut_off == 0.0) return here;
  if (d >= law.cut_off) return {.energy = 0.0, .force = 0.0, .slope = 0.0};
  if (law.switch_from == 0.0) {
    const Plain end = plain_at(law, law.cut_off);
    return {.energy = here.energy - end.energy - (law.cut_off - d) * end.force,
            .force = here.force - end.force,
            .slope = here.slope};
  }
  const Switch s = switch_at(law, d);
  return {.energy = here.energy * s.value,
          .force = here.force * s.value - here.energy * s.slope,
          .slope = here.slope * s.value + 2.0 * here.force * s.slope - here.energy * s.second};
}

}  // namespace

LennardJones LennardJones::from_gain(double r0, double gain, int n) {
  SUPPLE_EXPECTS(r0 > 0.0 && gain > 0.0 && n > 0 && 2 * n <= kLargestExponent);
  return {.r0 = r0, .depth = gain * r0 / (2.0 * n), .repulsive = 2 * n, .attractive = n};
}

double LennardJones::energy(double distance) const { return truncated_at(*this, distance).energy; }
double LennardJones::force(double distance) const { return truncated_at(*this, distance).force; }
double LennardJones::slope(double distance) const { return truncated_at(*this, distance).slope; }

double LennardJones::maximum_distance() const {
  return r0 * math::pow((repulsive + 1.0) / (attractive + 1.0), 1.0 / (repulsive - attractive));
}

PairLoad evaluate(const LennardJones& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return {.energy = law.energy(d),
          .force_b = law.force(d) / d * pose.r,
          .torque_a = Vec3::Zero(),
          .torque_b = Vec3::Zero()};
}

Stiffness stiffness(const LennardJones& law) {
  constexpr int kSamples = 64;
  double largest = 0.0;
  for (int k = 0; k <= kSamples; ++k) {
    largest = std::max(largest, std::abs(law.slope(law.r0 * (0.9 + 0.2 * k / kSamples))));
  }
  return {.translation = largest, .rotation = 0.0};
}

}  // namespace supple::core
