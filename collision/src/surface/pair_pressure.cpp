#include "surface/pair_pressure.h"

#include <cmath>

#include "surface/accuracy.h"

namespace supple::collision {

void step_to_sigma(PressureBatch& batch, double longest) {
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const Vec3 slope = batch.slope_a[i] - batch.slope_b[i];
    const double square = slope.squaredNorm();
    if (!(square > 0.0)) continue;
    Vec3 move = ((batch.b[i] - batch.a[i]) / square) * slope;
    const double length = move.norm();
    if (length > longest) move *= longest / length;
    batch.point[i] += move;
  }
}

std::optional<Vec3> PairPressure::tangent(const Vec3& from, const Vec3& normal, const Vec3* apart) const {
  constexpr double kLeast = 1e-3;  // of the length: what rounding leaves is not a direction
  constexpr int kToParts = 0, kWays = 4;  // to the first parts of both bodies, then along the axes of these
  for (int way = kToParts; way < kWays; ++way) {
    Vec3 sum = Vec3::Zero();
    double scale = 0.0;
    for (const ContactBody* body : body_) {
      // What has no skeleton may lie otherwise than its pose says, and what does not move usually does.
      if (body->pose.empty() || (body->skeleton == nullptr && (body->fixed || way != kToParts))) continue;
      const Pose& first = body->pose.front();
      const Vec3 to = way == kToParts ? Vec3(first.position - from) : first.orientation * Vec3::Unit(way - 1);
      sum += to;
      scale += to.norm();
    }
    const Vec3 across = sum - sum.dot(normal) * normal;
    if ((apart != nullptr ? std::abs(across.dot(*apart)) : across.norm()) > kLeast * scale) return across.normalized();
  }
  return std::nullopt;
}

double PairPressure::overlap_out_of(int side, const Vec3& from, const Vec3& way, double longest) {
  constexpr int kMostSteps = 200;
  constexpr double kEnough = 1e-6;  // of the longest step
  double t = 0.0;
  for (int i = 0; i < kMostSteps; ++i) {
    Vec3 slope;
    const double p = value(side, from + t * way, slope), fall = -slope.dot(way);
    const double step = fall > 0.0 ? std::clamp(p / fall, -longest, longest) : std::copysign(longest, p);
    t += step;
    if (std::abs(step) < kEnough * longest) break;
  }
  const auto other_presses = [&](double at) { return value(1 - side, from + at * way) > 0.0; };
  if (!(t > 0.0) || other_presses(t)) return t;
  double low = 0.0;
  for (int i = 0; i < kBracketSteps; ++i) {
    const double middle = 0.5 * (low + t);
    (other_presses(middle) ? low : t) = middle;
  }
  return t;
}

}  // namespace supple::collision
