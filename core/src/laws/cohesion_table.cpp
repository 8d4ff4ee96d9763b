#include <algorithm>
#include <cmath>

#include "supple/core/cohesion_variants.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

constexpr double kBegin = 0.25;

}  // namespace

CohesionTable CohesionTable::with_intervals(double a, double end, int intervals, Interpolation interpolation) {
  SUPPLE_EXPECTS(a > 0.0 && end > 1.0 && intervals >= 1);
  CohesionTable table;
  table.law_ = {.r0 = 1.0, .f0 = 1.0, .a = a};
  table.end_ = end;
  table.interval_ = (end - kBegin) / intervals;
  double sum = 0.0;
  for (int k = 0; k < intervals; ++k) {
    const double h = table.interval_;
    const double s = kBegin + h * k;
    const bool last = k + 1 == intervals;  // force and slope are 0 at the end
    const double f_0 = table.law_.force(s);
    const double f_1 = last ? 0.0 : table.law_.force(s + h);
    Piece piece{{f_0, f_1 - f_0, 0.0, 0.0}};
    if (interpolation == Interpolation::CubicHermite) {
      const double g_0 = h * table.law_.slope(s);
      const double g_1 = last ? 0.0 : h * table.law_.slope(s + h);
      piece.coefficient = {f_0, g_0, 3.0 * (f_1 - f_0) - 2.0 * g_0 - g_1, 2.0 * (f_0 - f_1) + g_0 + g_1};
    }
    table.piece_.push_back(piece);
    table.begun_.push_back(sum);
    const std::array<double, 4>& c = piece.coefficient;
    sum += h * (c[0] + c[1] / 2.0 + c[2] / 3.0 + c[3] / 4.0);
  }
  table.piece_.push_back(Piece{});
  table.begun_.push_back(sum);
  table.at_rest_ = table.integral(table.place_of(1.0));
  return table;
}

CohesionTable CohesionTable::with_error(double a, double error, Interpolation interpolation) {
  SUPPLE_EXPECTS(error >= 1e-9 && error <= 0.1);
  const Cohesion law{.r0 = 1.0, .f0 = 1.0, .a = a};
  const double end = law.influence_radius(0.25 * error);
  const double f_max = std::abs(law.force(law.maximum_distance()));
  for (int intervals = 8;; intervals *= 2) {
    CohesionTable table = with_intervals(a, end, intervals, interpolation);
    // The error of an interval has its largest value near the middle; a quarter of it covers the distance between
    // three samples.
    double largest = 0.0;
    for (int k = 0; k < 4 * intervals; ++k) {
      const double s = kBegin + (end - kBegin) * k / (4.0 * intervals);
      largest = std::max(largest, std::abs(table.force(s) - law.force(s)));
    }
    if (largest <= 0.75 * error * f_max) return table;
    SUPPLE_EXPECTS(intervals < (1 << 24));
  }
}

CohesionTable::Place CohesionTable::place_of(double s) const {
  if (s >= end_) return {.piece = piece_.size() - 1, .t = 0.0};
  const double x = std::max(0.0, (s - kBegin) / interval_);
  const std::size_t piece = std::min(static_cast<std::size_t>(x), piece_.size() - 2);
  return {.piece = piece, .t = x - static_cast<double>(piece)};
}

double CohesionTable::integral(const Place& place) const {
  const std::array<double, 4>& c = piece_[place.piece].coefficient;
  const double t = place.t;
  return begun_[place.piece] + interval_ * t * (c[0] + t * (c[1] / 2.0 + t * (c[2] / 3.0 + t * c[3] / 4.0)));
}

double CohesionTable::force(double s) const {
  if (s < kBegin) return law_.force(s);
  const Place place = place_of(s);
  const std::array<double, 4>& c = piece_[place.piece].coefficient;
  return c[0] + place.t * (c[1] + place.t * (c[2] + place.t * c[3]));
}

double CohesionTable::slope(double s) const {
  if (s < kBegin) return law_.slope(s);
  const Place place = place_of(s);
  const std::array<double, 4>& c = piece_[place.piece].coefficient;
  return (c[1] + place.t * (2.0 * c[2] + place.t * 3.0 * c[3])) / interval_;
}

double CohesionTable::energy(double s) const {
  // U falls by the integral of f.
  if (s < kBegin) return at_rest_ + law_.energy(s) - law_.energy(kBegin);
  return at_rest_ - integral(place_of(s));
}

}  // namespace supple::core
