#include "surface/polar/imprint.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr double kInside = 0.999;       // of the way to the rim: where the pair still presses
constexpr int kCoreSteps = 6;
constexpr double kNear = 0.25;          // radii of the patch, by which the place nearest to a core may be missed where Sigma is bent
constexpr int kGrid = 7;                // points along a side
constexpr int kClimbSteps = 10;
constexpr int kHalvings = 4;
constexpr double kBeyond = 1.2;         // of Newton's step, which alone would not arrive where the excess is concave
constexpr double kShortClimb = 1e-4;    // of the radius of the patch
constexpr double kFirst = 0.05;         // of the radius of the patch
constexpr double kRough = 0.05, kFine = 1e-4;  // of the distance from the centre of the imprint
constexpr double kGrowth = 2.0;         // of the distance in a step
constexpr int kLeaveSteps = 5;
constexpr int kTouchNewton = 3;
constexpr double kTouch = 1e-6;         // angle between ray and border [rad]: the ray is off by the square
constexpr double kFarthest = 4.0;       // radii of the patch

Vec3 place_of(const PeakFrame& frame, const Vec2& at, double height) {
  return frame.origin + at.x() * frame.u + at.y() * frame.v + height * frame.axis;
}

/// Over a metre, in units of u and v.
Vec2 direction(const PeakFrame& frame, double turns) {
  const auto [s, c] = math::sin_cos(kTurn * turns);
  return {c / frame.u.norm(), s / frame.v.norm()};
}

}  // namespace

std::optional<double> Imprint::middle_on(const Vec2& way) const {
  double nearest = kInfinity, farthest = 0.0;
  bool around = false;
  for (std::size_t k = 0; k < border.size(); ++k) {
    const Vec2 &a = border[k], &b = border[(k + 1) % border.size()];
    const double at_a = cross(way, a), at_b = cross(way, b);
    if ((at_a > 0.0) == (at_b > 0.0)) continue;
    const double distance = (a + at_a / (at_a - at_b) * (b - a)).dot(way) / way.squaredNorm();
    if (distance <= 0.0) {
      around = !around;
      continue;
    }
    nearest = std::min(nearest, distance);
    farthest = std::max(farthest, distance);
  }
  if (!(farthest > 0.0)) return std::nullopt;
  return 0.5 * ((around ? 0.0 : nearest) + farthest);
}

/// The nearest place on the same ray that lies on the patch, about where the rim has Sigma.
ImprintFinder::Spot ImprintFinder::on_patch(const PolarCover& cover, const Vec2& at) {
  const auto [far, rise] = cover.reach(at);
  Spot spot;
  spot.at = far > kInside ? Vec2(kInside / far * at) : at;
  spot.far = std::min(far, kInside);
  spot.height = rise * spot.far * spot.far;
  return spot;
}

/// Pressures at `spots_`, after their heights have been moved to Sigma.
void ImprintFinder::look(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body) {
  const std::size_t n = spots_.size();
  batch_.resize(n);
  place_.resize(n);
  value_.resize(n);
  slope_.resize(n);
  for (const bool last : {false, true}) {
    for (std::size_t i = 0; i < n; ++i) batch_.point[i] = place_of(frame, spots_[i].at, spots_[i].height);
    pressure.evaluate(batch_);
    for (std::size_t i = 0; i < n; ++i) {
      Spot& spot = spots_[i];
      const AlongAxis sigma(batch_.slope_a[i], batch_.slope_b[i], frame.axis);
      const double lift = sigma.lift(batch_.a[i], batch_.b[i]);
      const bool near = sigma.rate > 0.0 && std::abs(lift) <= 2.0 * frame.thickness;
      if (near) spot.height += lift;
      if (!last) continue;
      place_[i] = place_of(frame, spot.at, spot.height);
      spot.p = near ? sigma.pressure(batch_.a[i], batch_.b[i]) : -kInfinity;
      spot.fall = {sigma.slope(frame.u), sigma.slope(frame.v)};
      spot.rise = {sigma.rise(frame.u), sigma.rise(frame.v)};  // of Sigma, for now
    }
  }
  body.field.evaluate(place_, value_, slope_);
  for (std::size_t i = 0; i < n; ++i) {
    Spot& spot = spots_[i];
    const Vec3& g = slope_[i];
    const double up = g.dot(frame.axis);
    spot.third = body.material.modulus * value_[i];
    spot.excess = spot.third - spot.p;
    spot.rise = body.material.modulus * Vec2(g.dot(frame.u) + up * spot.rise.x(), g.dot(frame.v) + up * spot.rise.y()) - spot.fall;
  }
}

ImprintFinder::Spot ImprintFinder::look(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Vec2& at, double height) {
  spots_.assign(1, {});
  spots_[0].at = at;
  spots_[0].height = height;
  look(pressure, frame, body);
  return spots_[0];
}

/// To where the core is nearest to Sigma on the patch, going from one to the other; kept as the only spot.
/// @return false where the body says nothing of a core
bool ImprintFinder::begin_at_core(PairPressure& pressure, const PolarCover& cover, const ContactBody& body) {
  const PeakFrame& frame = cover.frame;
  const double radius = (cover.rim.front() - frame.origin).norm();
  Vec3 x = frame.origin;
  for (int step = 0; step < kCoreSteps; ++step) {
    const std::optional<implicit::CorePoint> core = body.field.core_point(x);
    if (!core) return false;
    spots_.assign(1, on_patch(cover, frame.parts_of(core->point - frame.origin)));
    Spot& spot = spots_[0];
    if ((place_of(frame, spot.at, spot.height) - core->point).norm() > core->radius + cover.thickness + kNear * radius) {
      spot.third = -kInfinity;
      return true;
    }
    look(pressure, frame, body);
    const Vec3 next = place_of(frame, spot.at, spot.height);
    const double moved = (next - x).norm();
    x = next;
    if (moved <= 1e-3 * cover.thickness) break;
  }
  return true;
}

/// To the best of points between the sides of the body's surface on the patch; kept as the only spot.
void ImprintFinder::begin_on_grid(PairPressure& pressure, const PolarCover& cover, const ContactBody& body) {
  const PeakFrame& frame = cover.frame;
  Box patch;
  for (const Vec3& x : cover.rim) patch.include(x);
  patch.include(frame.origin);
  const Box surface = body.field.surface_box();
  const Box box{surface.lower.cwiseMax(patch.lower), surface.upper.cwiseMin(patch.upper)};
  Vec2 low = Vec2::Constant(kInfinity), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 x((corner & 1) != 0 ? box.upper.x() : box.lower.x(), (corner & 2) != 0 ? box.upper.y() : box.lower.y(),
                 (corner & 4) != 0 ? box.upper.z() : box.lower.z());
    const Vec2 at = frame.parts_of(x - frame.origin);
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  spots_.clear();
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      spots_.push_back(on_patch(cover, low + (high - low).cwiseProduct(Vec2(i, j) / (kGrid - 1))));
    }
  }
  look(pressure, frame, body);
  spots_.assign(1, *std::max_element(spots_.begin(), spots_.end(), [](const Spot& a, const Spot& b) { return a.excess < b.excess; }));
}

std::optional<Vec3> ImprintFinder::find(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, double margin) {
  const PeakFrame& frame = cover.frame;
  const double lu = frame.u.norm(), lv = frame.v.norm(), radius = (cover.rim.front() - frame.origin).norm();
  if (!begin_at_core(pressure, cover, body)) {
    begin_on_grid(pressure, cover, body);
  } else if (const Spot& spot = spots_[0]; -spot.third > kNear * radius * Vec2(spot.rise.x() / lu, spot.rise.y() / lv).norm()) {
    return std::nullopt;
  }
  Spot spot = spots_[0];
  for (int step = 0; step < kClimbSteps; ++step) {
    if (spot.excess > -margin && spot.third > 0.0) return place_of(frame, spot.at, spot.height);
    Vec2 uphill(spot.rise.x() / lu, spot.rise.y() / lv);
    if (spot.far > 0.99 * kInside) {
      const Vec2 out = -Vec2(spot.fall.x() / lu, spot.fall.y() / lv).normalized();
      uphill -= std::max(uphill.dot(out), 0.0) * out;
    }
    const double steepness = uphill.squaredNorm();
    // The excess is about concave: its slope does not grow on the way.
    if (!(2.0 * radius * std::sqrt(steepness) > -margin - spot.excess)) return std::nullopt;
    Vec2 move = (-kBeyond * spot.excess / steepness) * uphill;
    if (move.norm() > 0.5 * radius) move *= 0.5 * radius / move.norm();
    bool higher = false;
    for (int half = 0; half < kHalvings && !higher; ++half, move *= 0.5) {
      if (!(move.norm() > kShortClimb * radius)) return std::nullopt;
      spots_.assign(1, on_patch(cover, spot.at + Vec2(move.x() / lu, move.y() / lv)));
      look(pressure, frame, body);
      const Spot& next = spots_[0];
      higher = next.excess > spot.excess;
      if (higher) spot = next;
    }
    if (!higher) return std::nullopt;
  }
  return std::nullopt;
}

/// Where rays along `way_` from the centre leave the imprint or the patch, begun at `radius_`. @return false where one does not
bool ImprintFinder::follow_border(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Spot& centre,
                                  double enough, double farthest) {
  const std::size_t n = way_.size();
  low_.assign(n, 0.0);
  high_.assign(n, kInfinity);
  done_.assign(n, 0);
  spots_.assign(n, centre);
  std::size_t open = n;
  for (int iteration = 0; iteration < kBracketSteps && open > 0; ++iteration) {
    for (std::size_t k = 0; k < n; ++k) spots_[k].at = centre.at + radius_[k] * way_[k];
    look(pressure, frame, body);
    for (std::size_t k = 0; k < n; ++k) {
      if (done_[k] != 0) continue;
      const Spot& spot = spots_[k];
      const double least = spot.least(), slope = spot.slope(way_[k]);
      double& r = radius_[k];
      (least > 0.0 ? low_[k] : high_[k]) = r;
      double next = slope < 0.0 ? std::min(r - least / slope, kGrowth * r) : kGrowth * r;
      if (!(next > low_[k]) || !(next < high_[k])) next = std::isfinite(high_[k]) ? 0.5 * (low_[k] + high_[k]) : kGrowth * r;
      if (!(next <= farthest)) return false;
      if (std::abs(next - r) <= enough * next) {
        done_[k] = 1;
        --open;
      }
      r = next;
    }
  }
  return open == 0;
}

/// Where the border leaves the patch: p = 0 = excess, begun between two of its points. @return false where that is not between them
bool ImprintFinder::leave_between(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Piece& piece, Node& out) {
  const auto& [centre, a, b] = piece;
  Spot spot = a.spot;
  spot.at = 0.5 * (a.spot.at + b.spot.at);
  Vec2 move = Vec2::Zero();
  for (int newton = 0; newton < kLeaveSteps; ++newton) {
    spot = look(pressure, frame, body, spot.at, spot.height);
    move = meeting_of(spot.fall, -spot.p, spot.rise, -spot.excess);
    if (!(move.norm() <= (a.spot.at - b.spot.at).norm())) return false;
    spot.at += move;
  }
  const Vec2 way = spot.at - centre.at;
  if (!(cross(a.spot.at - centre.at, way) > 0.0) || !(cross(way, b.spot.at - centre.at) > 0.0)) return false;
  const double metres_x = way.x() * frame.u.norm(), metres_y = way.y() * frame.v.norm();
  out.turns = math::atan2(metres_y, metres_x) / (kTurn);
  if (out.turns < a.turns) out.turns += 1.0;
  out.radius = std::sqrt(metres_x * metres_x + metres_y * metres_y);
  out.spot = spot;
  return true;
}

/// Where a ray from the frame's origin touches the border between two of its points; nothing where none does.
std::optional<Vec2> ImprintFinder::touch_between(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Piece& piece) {
  const auto& [centre, a, b] = piece;
  const auto along = [](const Spot& spot) { return spot.rise.dot(spot.at); };
  double low = 0.0, high = 1.0, at_low = along(a.spot), at_high = along(b.spot);
  if ((at_low > 0.0) == (at_high > 0.0)) return std::nullopt;
  Spot spot = a.spot;
  for (int step = 0; step < kBracketSteps; ++step) {
    const double share = low + (high - low) * at_low / (at_low - at_high);
    const Vec2 way = direction(frame, (1.0 - share) * a.turns + share * b.turns);
    double r = (1.0 - share) * a.radius + share * b.radius;
    for (int newton = 0; newton < kTouchNewton; ++newton) {
      spot = look(pressure, frame, body, centre.at + r * way, spot.height);
      r -= spot.excess / spot.rise.dot(way);
    }
    spot.at = centre.at + r * way;
    const double here = along(spot);
    if (std::abs(here) <= kTouch * spot.rise.norm() * spot.at.norm()) break;
    // Illinois: an end that stays counts half.
    if ((here > 0.0) == (at_low > 0.0)) {
      low = share;
      at_low = here;
      at_high *= 0.5;
    } else {
      high = share;
      at_high = here;
      at_low *= 0.5;
    }
  }
  return spot.at;
}

ImprintFinder::Spot ImprintFinder::centre_at(const PeakFrame& frame, const Vec3& inside) {
  const Vec3 from = inside - frame.origin;
  Spot centre;
  centre.at = frame.parts_of(from);
  centre.height = from.dot(frame.axis);
  return centre;
}

/// The border along so many ways from the centre, finely along `kManyRays`. @param first  distance to begin at [m]
bool ImprintFinder::send_ways(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Spot& centre, std::size_t ways, double first) {
  const PeakFrame& frame = cover.frame;
  way_.clear();
  for (std::size_t k = 0; k < ways; ++k) way_.push_back(direction(frame, static_cast<double>(k) / static_cast<double>(ways)));
  radius_.assign(ways, first);
  return follow_border(pressure, frame, body, centre, ways == kManyRays ? kFine : kRough, kFarthest * (cover.rim.front() - frame.origin).norm());
}

/// From the ends of the ways. @return twice the area within, in units of u and v
double ImprintFinder::move_to_middle(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, Spot& centre) {
  const std::size_t n = way_.size();
  PolygonMoments moments;
  for (std::size_t k = 0; k < n; ++k) moments.add_edge(radius_[k] * way_[k], radius_[(k + 1) % n] * way_[(k + 1) % n]);
  const Spot better = look(pressure, frame, body, centre.at + moments.first / moments.area, centre.height);
  if (better.least() > 0.0) centre = better;
  return 2.0 * moments.area;
}

std::optional<ImprintSize> ImprintFinder::measure(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Vec3& inside) {
  constexpr std::size_t kAxes = 4, kAround = 8;
  const PeakFrame& frame = cover.frame;
  const double lu = frame.u.norm(), lv = frame.v.norm(), radius = (cover.rim.front() - frame.origin).norm();
  double whole = 0.0;
  for (std::size_t k = 0; k < cover.rim.size(); ++k) {
    whole += cross(frame.parts_of(cover.rim[k] - frame.origin), frame.parts_of(cover.rim[(k + 1) % cover.rim.size()] - frame.origin));
  }
  if (!(whole > 0.0)) return std::nullopt;
  Spot centre = centre_at(frame, inside);
  centre = look(pressure, frame, body, centre.at, centre.height);
  // Beside a rim imprints are long across the slope of the excess: ways are stretched as they are.
  const Vec2 up = Vec2(centre.rise.x() / lu, centre.rise.y() / lv).normalized(), across(-up.y(), up.x());
  std::array<double, 2> half{1.0, 1.0};
  ImprintSize size;
  for (const std::size_t n : {kAxes, kAround, kAround}) {  // the first place may be so near to a rim that the imprint seems short across
    way_.clear();
    radius_.clear();
    for (std::size_t k = 0; k < n; ++k) {
      const double angle = kTurn * static_cast<double>(k) / static_cast<double>(n);
      const auto [sine, cosine] = math::sin_cos(angle);
      const Vec2 to = half[0] * cosine * up + half[1] * sine * across;
      const Vec2 way = to.normalized();
      way_.emplace_back(way.x() / lu, way.y() / lv);
      radius_.push_back(n == kAxes ? kFirst * radius : to.norm());
    }
    if (!follow_border(pressure, frame, body, centre, kRough, kFarthest * radius)) return std::nullopt;
    for (const Spot& spot : spots_) size.pressure = std::max(size.pressure, spot.p);
    half = {0.5 * (radius_[0] + radius_[n / 2]), 0.5 * (radius_[n / 4] + radius_[3 * n / 4])};
    size.share = move_to_middle(pressure, frame, body, centre) / whole;
    size.pressure = std::max(size.pressure, centre.p);
  }
  return size;
}

bool ImprintFinder::trace(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Vec3& inside, Imprint& out) {
  const PeakFrame& frame = cover.frame;
  Spot centre = centre_at(frame, inside);
  if (!send_ways(pressure, cover, body, centre, kFewRays, kFirst * (cover.rim.front() - frame.origin).norm())) return false;
  const double first = std::accumulate(radius_.begin(), radius_.end(), 0.0) / static_cast<double>(radius_.size());
  move_to_middle(pressure, frame, body, centre);
  if (!send_ways(pressure, cover, body, centre, kManyRays, first)) return false;
  out.border.clear();
  out.touches.clear();
  out.leaves.clear();
  nodes_.clear();
  bool around = true;  // the origin
  for (std::size_t k = 0; k < kManyRays; ++k) {
    spots_[k].at = centre.at + radius_[k] * way_[k];
    nodes_.push_back({static_cast<double>(k) / kManyRays, radius_[k], spots_[k]});
  }
  for (std::size_t k = 0; k < kManyRays; ++k) {
    const Node &here = nodes_[k], &next = nodes_[(k + 1) % kManyRays];
    const Node end{(static_cast<double>(k) + 1.0) / kManyRays, next.radius, next.spot};
    around = around && cross(here.spot.at, end.spot.at) > 0.0;
    out.border.push_back(here.spot.at);
    Node corner;
    const bool leaves = here.spot.on_rim() != end.spot.on_rim(), found = leaves && leave_between(pressure, frame, body, {centre, here, end}, corner);
    if (leaves) {
      const Vec2 middle = 0.5 * (here.spot.at + end.spot.at);
      out.leaves.push_back(found ? place_of(frame, corner.spot.at, corner.spot.height) : place_of(frame, middle, here.spot.height));
    }
    const auto add_touch = [&](const Node& a, const Node& b) {
      const std::optional<Vec2> touch = touch_between(pressure, frame, body, {centre, a, b});
      if (!touch) return;
      out.border.push_back(*touch);
      out.touches.push_back(*touch);
    };
    if (!here.spot.on_rim() && (found || !leaves)) add_touch(here, found ? corner : end);
    if (found) out.border.push_back(corner.spot.at);
    if (here.spot.on_rim() && found) add_touch(corner, end);
  }
  if (around) out.touches.clear();
  return true;
}

}  // namespace supple::collision
