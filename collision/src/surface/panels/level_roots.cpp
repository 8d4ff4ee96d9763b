#include "surface/panels/level_roots.h"

#include <algorithm>
#include <cmath>

namespace supple::collision {
namespace {

/// The cubic through two samples.
struct Hermite {
  LevelSample from, to;

  [[nodiscard]] double length() const { return to.place - from.place; }
  [[nodiscard]] double value(double place) const {
    const double h = length(), t = (place - from.place) / h, s = 1.0 - t;
    return s * s * (1.0 + 2.0 * t) * from.value + t * t * (1.0 + 2.0 * s) * to.value + h * t * s * (s * from.slope - t * to.slope);
  }
  [[nodiscard]] double slope(double place) const {
    const double h = length(), t = (place - from.place) / h, s = 1.0 - t;
    return 6.0 * t * s * (to.value - from.value) / h + s * (1.0 - 3.0 * t) * from.slope - t * (2.0 - 3.0 * t) * to.slope;
  }
};

/// By halving, of a function whose signs at both ends differ: a guess needs no more.
template <class Function>
double halve(const Function& f, double low, double high) {
  constexpr int kHalvings = 12;
  const bool positive = f(low) > 0.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    ((f(middle) > 0.0) == positive ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// The parabola from a sample with the slopes of two.
LevelSample extrapolate(const LevelSample& from, const LevelSample& other, double place) {
  const double bend = (other.slope - from.slope) / (other.place - from.place), way = place - from.place;
  return {place, from.value + way * (from.slope + 0.5 * way * bend), from.slope + way * bend};
}

void add_roots(const Hermite& cubic, bool open_low, bool open_high, std::vector<LevelRoot>& out) {
  const auto value = [&cubic](double place) { return cubic.value(place); };
  const auto add = [&](double low, double high, bool low_open, bool high_open) {
    out.push_back({low, high, halve(value, low, high), value(high) > 0.0, low_open, high_open});
  };
  const LevelSample &from = cubic.from, &to = cubic.to;
  const bool positive = from.value > 0.0;
  if (positive != (to.value > 0.0)) return add(from.place, to.place, open_low, open_high);
  // Two more where the cubic turns on the other side of zero.
  const std::optional<LevelSample> turn = turn_between(from, to);
  if (!turn || (turn->value > 0.0) == positive) return;
  add(from.place, turn->place, open_low, true);
  add(turn->place, to.place, true, open_high);
}

}  // namespace

std::optional<LevelSample> turn_between(const LevelSample& from, const LevelSample& to) {
  const double sign = from.value > 0.0 ? 1.0 : -1.0;
  if (!(sign * to.value > 0.0) || !(sign * from.slope < 0.0 && sign * to.slope > 0.0)) return std::nullopt;
  const Hermite cubic{from, to};
  const double place = halve([&cubic](double at) { return cubic.slope(at); }, from.place, to.place);
  return LevelSample{place, cubic.value(place), 0.0};
}

bool predict_roots(std::span<const LevelSample> samples, double begin, double end, std::vector<LevelRoot>& out) {
  const std::size_t n = samples.size();
  const auto beside = [&](std::size_t i, std::size_t other, double place) {
    if (n > 1) return extrapolate(samples[i], samples[other], place);
    return LevelSample{place, samples[i].value + samples[i].slope * (place - samples[i].place), samples[i].slope};
  };
  const LevelSample first = beside(0, std::min<std::size_t>(1, n - 1), begin), last = beside(n - 1, n > 1 ? n - 2 : 0, end);
  if (samples[0].place > begin) add_roots({first, samples[0]}, true, false, out);
  for (std::size_t i = 0; i + 1 < n; ++i) add_roots({samples[i], samples[i + 1]}, false, false, out);
  if (samples[n - 1].place < end) add_roots({samples[n - 1], last}, false, true, out);
  return first.value > 0.0;
}

}  // namespace supple::collision
