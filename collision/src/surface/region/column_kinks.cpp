#include "surface/region/column_kinks.h"

#include <algorithm>
#include <cmath>

#include "pairs/boxes.h"
#include "surface/accuracy.h"

namespace supple::collision {

ColumnKinks::ColumnKinks(const PairPressure& pressure, int side, double error) {
  const implicit::Field* const field = pressure.field(side).as_field();
  if (field == nullptr) return;
  const Box box = pressure.field(side).surface_box();
  if (!is_finite(box)) return;
  (void)implicit::kinks_of(*field, box, kink_);
  std::erase_if(kink_, [error](const implicit::Kink& kink) { return is_mild(kink, error); });
}

std::span<const double> ColumnKinks::parts(const Vec3& from, const Vec3& way, double length) {
  part_.assign(1, 0.0);
  for (const implicit::Kink& kink : kink_) cross(kink, from, way, length);
  std::sort(part_.begin(), part_.end());
  part_.push_back(length);
  return part_;
}

/// Along a line s is linear at a plane, a parabola at a distance from a point or a line, and convex at one from any convex set: it has two zeros at most, and
/// Newton's method from outside of one never passes it.
void ColumnKinks::cross(const implicit::Kink& kink, const Vec3& from, const Vec3& way, double length) {
  constexpr double kStepOfLength = 1e-6;  // of the length: sums miss a higher power of it
  if (kink.form == implicit::Kink::Form::Plane) {
    const double begin = kink.value(from), rate = kink.to_local.row(0).dot(way);
    if (rate != 0.0) add(-begin / rate, length);
    return;
  }
  if (kink.form == implicit::Kink::Form::Offset && kink.half.isZero(0.0)) {
    const Vec3 x = kink.to_local * (from - kink.origin), along = kink.to_local * way;
    const double a = along.squaredNorm(), b = x.dot(along), c = x.squaredNorm() - kink.level * kink.level, square = b * b - a * c;
    if (!(square > 0.0) || !(a > 0.0)) return;
    const double root = std::sqrt(square);
    add((-b - root) / a, length);
    add((-b + root) / a, length);
    return;
  }
  for (const double sense : {1.0, -1.0}) {
    double at = sense > 0.0 ? 0.0 : length;
    for (int step = 0; step < kBracketSteps && at >= 0.0 && at <= length; ++step) {
      Vec3 slope;
      const double value = kink.value(from + at * way, slope), rate = sense * slope.dot(way);
      if (value <= 0.0 && step == 0) break;  // it begins inside
      if (!(rate < 0.0)) break;              // and goes by
      const double move = value / -rate;
      at += sense * move;
      if (move > kStepOfLength * length) continue;
      add(at, length);
      break;
    }
  }
}

}  // namespace supple::collision
