#include "mesh/partition/polygonise_roots.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace supple::implicit::lattice {
namespace {

/// Bisection alone ends within 60 rounds; the cap only guards against fields that return NaN.
constexpr int kMaxRounds = 200;

Vec3 at(const Vec3& start, const Vec3& end, double t) {
  return (start + t * (end - start)).cwiseMin(end);  // never beyond the end by rounding
}

/// Root of the cubic c with c(0) = f0, c(1) = f1, c(t) = f, c'(t) = slope, by Newton's method from x.
double cubic_root(double f0, double f1, double t, double f, double slope, double x) {
  const double u = 1.0 - t;
  const double q0 = (f0 - f + slope * t) / (t * t);  // c(x) = f + slope (x-t) + (x-t)^2 (q0 (1-x) + q1 x)
  const double q1 = (f1 - f - slope * u) / (u * u);
  for (int i = 0; i < 3; ++i) {
    const double d = x - t, q = q0 * (1.0 - x) + q1 * x;
    const double value = f + d * (slope + d * q);
    const double derivative = slope + d * (2.0 * q + d * (q1 - q0));
    x -= value / derivative;
  }
  return x;
}

}  // namespace

double guess_root(double before, double f0, double f1, double after) {
  const double line = f0 / (f0 - f1);
  // Newton's form at the nodes 0, 1, then -1 and 2; a missing node drops its terms.
  const bool has_before = std::isfinite(before), has_after = std::isfinite(after);
  const double d1 = f1 - f0;
  const double second = has_before ? before - 2.0 * f0 + f1 : has_after ? f0 - 2.0 * f1 + after : 0.0;
  const double third = has_before && has_after ? after - 3.0 * f1 + 3.0 * f0 - before : 0.0;
  double t = line;
  for (int i = 0; i < 2; ++i) {
    const double bow = t * (t - 1.0), bow_slope = 2.0 * t - 1.0;
    const double value = f0 + t * d1 + bow * (0.5 * second + (t + 1.0) * third / 6.0);
    const double slope = d1 + bow_slope * (0.5 * second + (t + 1.0) * third / 6.0) + bow * third / 6.0;
    t -= value / slope;
  }
  return t >= 0.0 && t <= 1.0 ? t : line;
}

void EdgeRoots::clear() {
  start_.clear();
  end_.clear();
  bracket_.clear();
}

void EdgeRoots::add(const Vec3& start, const Vec3& end, double f_start, double f_end, double guess) {
  start_.push_back(start);
  end_.push_back(end);
  Bracket bracket{.low = 0.0, .high = 1.0, .f_low = f_start, .f_high = f_end, .t = guess, .last_step = 1.0};
  if (f_start == 0.0) bracket.high = bracket.t = 0.0;
  if (f_end == 0.0) bracket.low = bracket.t = 1.0;
  bracket_.push_back(bracket);
}

void EdgeRoots::solve(const FieldView& plus, const FieldView& minus, double scale) {
  const std::size_t n = size();
  point_.resize(n);
  gradient_.resize(n);
  value_.resize(n);
  plus_value_.resize(n);
  batch_point_.resize(n);
  batch_gradient_.resize(n);
  batch_value_.resize(n);
  if (minus) {
    batch_gradient_minus_.resize(n);
    batch_minus_.resize(n);
  }
  active_.resize(n);
  std::iota(active_.begin(), active_.end(), 0u);
  for (int round = 0; !active_.empty(); ++round) {
    const std::size_t count = active_.size();
    for (std::size_t j = 0; j < count; ++j) {
      const std::uint32_t i = active_[j];
      batch_point_[j] = at(start_[i], end_[i], bracket_[i].t);
    }
    const std::span<const Vec3> points(batch_point_.data(), count);
    plus.evaluate(points, {batch_value_.data(), count}, {batch_gradient_.data(), count});
    if (minus) minus.evaluate(points, {batch_minus_.data(), count}, {batch_gradient_minus_.data(), count});
    std::size_t left = 0;
    for (std::size_t j = 0; j < count; ++j) {
      const std::uint32_t i = active_[j];
      Bracket& b = bracket_[i];
      const double f = minus ? batch_value_[j] - batch_minus_[j] : batch_value_[j];
      const Vec3 gradient = minus ? Vec3(batch_gradient_[j] - batch_gradient_minus_[j]) : batch_gradient_[j];
      point_[i] = batch_point_[j];
      gradient_[i] = gradient;
      value_[i] = f;
      plus_value_[i] = batch_value_[j];
      const Vec3 along = end_[i] - start_[i];
      const double resolution = std::numeric_limits<double>::epsilon() *
                                std::max(1.0, batch_point_[j].cwiseAbs().maxCoeff() / along.cwiseAbs().maxCoeff());
      if (std::abs(f) <= root_tolerance(scale, batch_point_[j], gradient)) continue;
      if (b.high - b.low <= resolution || round == kMaxRounds) continue;
      const double slope = gradient.dot(along);
      double next = b.t - f / slope;
      if (round == 0 && b.t > 0.01 && b.t < 0.99) next = cubic_root(b.f_low, b.f_high, b.t, f, slope, next);
      const bool low_side = (f > 0.0) == (b.f_low > 0.0);
      (low_side ? b.low : b.high) = b.t;
      (low_side ? b.f_low : b.f_high) = f;
      if (!(next > b.low && next < b.high) || !(std::abs(next - b.t) <= 0.5 * b.last_step)) {
        next = 0.5 * (b.low + b.high);
      }
      b.last_step = std::abs(next - b.t);
      if (next == b.t) continue;
      b.t = next;
      active_[left++] = i;
    }
    active_.resize(left);
  }
}

}  // namespace supple::implicit::lattice
