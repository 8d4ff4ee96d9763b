#include "surface/polar/outline.h"

#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr double kFirst = 1e-3;        // kinks nearer to the middle are not gone to
constexpr double kBeyond = 4.0;        // kinks farther than that, in radii, tell no more than none; which are known depends on how the overlap's box lies
constexpr double kNear = 0.3;          // pressure at the rim, of that in the middle
constexpr double kFar = 2.0;           // from Sigma, in the overlap: Newton's method is not believed
constexpr double kWidest = 1.7;        // sector [rad] in units of u and v
constexpr double kSameCorner = 1e-6;
constexpr double kRough = 0.05;        // last step of walks, over the distance gone, where they only find the middle
constexpr double kClear = 0.1;         // of the radius, from kinks to the middle

/// A place of the outline where a sector may begin.
struct Mark {
  RimPoint point;
  bool corner;
  bool touch = false;
};

bool on_one_ray(const Mark& a, const Mark& b) {
  return cross(a.point.at, b.point.at) < kSameCorner * a.point.at.norm() * b.point.at.norm() && a.point.at.dot(b.point.at) > 0.0;
}

/// Corners and points of the outline by angle; of those that lie on one ray, corners are kept.
std::vector<Mark> mark_outline(std::span<const RimPoint> outline, std::span<const RimPoint> corners) {
  std::vector<Mark> all, marks;
  for (const RimPoint& c : corners) all.push_back({c, true});
  for (const RimPoint& p : outline) all.push_back({p, false});
  std::stable_sort(all.begin(), all.end(), [](const Mark& a, const Mark& b) { return before(a.point.at, b.point.at); });
  for (const Mark& mark : all) {
    if (!marks.empty() && on_one_ray(marks.back(), mark)) {
      if (!marks.back().corner) marks.back() = mark;
    } else {
      marks.push_back(mark);
    }
  }
  if (marks.size() > 1 && on_one_ray(marks.back(), marks.front())) {
    if (!marks.front().corner) marks.front() = marks.back();
    marks.pop_back();
  }
  return marks;
}

/// The point of the edge from a to b that a ray meets.
RimPoint point_between(const RimPoint& a, const RimPoint& b, const Vec2& way) {
  const double s = cross(a.at, way) / (cross(a.at, way) + cross(way, b.at));
  return {(1.0 - s) * a.at + s * b.at, (1.0 - s) * a.height + s * b.height, Vec2::Zero()};
}

/// Adds corners where rays touch imprints.
void mark_touches(std::span<const Imprint> imprints, std::vector<Mark>& marks) {
  for (const Imprint& imprint : imprints) {
    for (const Vec2& way : imprint.touches) {
      for (std::size_t k = 0; k < marks.size(); ++k) {
        Mark &a = marks[k], &b = marks[(k + 1) % marks.size()];
        if (!(cross(a.point.at, way) >= 0.0) || !(cross(way, b.point.at) > 0.0)) continue;
        const Mark touch{point_between(a.point, b.point, way), true, true};
        if (on_one_ray(a, touch)) {
          a.corner = a.touch = true;
        } else if (on_one_ray(touch, b)) {
          b.corner = b.touch = true;
        } else {
          marks.insert(marks.begin() + static_cast<std::ptrdiff_t>(k + 1), touch);
        }
        break;
      }
    }
  }
}

}  // namespace

Sheet sheet_of(const implicit::Kink& kink, const Vec3& origin) {
  using Form = implicit::Kink::Form;
  Sheet sheet;
  sheet.flat = kink.form == Form::Plane;
  const bool round = kink.form == Form::Offset && kink.half.isZero(0.0);
  sheet.told = sheet.flat || round;
  if (sheet.told) sheet.value = kink.value(origin, sheet.slope);
  if (round) sheet.bend = 0.5 / kink.level * (kink.to_local.transpose() * kink.to_local);
  return sheet;
}

/// Walks begin in the middle, where the pressure and its slope are known. @return the pressure there, 0 where nothing presses or Sigma is no graph
double OutlineWalks::start(std::span<const Vec2> ways) {
  batch_.resize(1);
  batch_.point[0] = frame_.origin;
  pressure_.evaluate(batch_);
  sheets_.clear();
  for (const implicit::Kink& kink : kinks_) {
    const Sheet sheet = sheet_of(kink, frame_.origin);
    if (sheet.told) sheets_.push_back(sheet);
  }
  const AlongAxis sigma(batch_.slope_a[0], batch_.slope_b[0], frame_.axis);
  if (!sigma.upright(kGraphCosine)) return 0.0;
  const double p = sigma.pressure(batch_.a[0], batch_.b[0]);
  walks_.clear();
  for (const Vec2& way : ways) {
    Walk walk;
    walk.way = way;
    walk.along = frame_.across(way);
    walk.pressure = p;
    walk.slope = sigma.slope(walk.along);
    walk.rise = sigma.rise(walk.along);
    walk.out = walk.most = kInfinity;
    walks_.push_back(walk);
  }
  return p;
}

/// Where the pressure would be 0 by what is known of it inside, but not beyond the next kink.
void OutlineWalks::look_ahead(Walk& walk) const {
  double kink = kInfinity;
  const auto meet = [&](double r) {
    if (r > walk.passed * (1.0 + kSameCorner) && r > kFirst && r * walk.along.norm() < 0.5 * extent_) kink = std::min(kink, r);
  };
  for (const Sheet& sheet : sheets_) {
    // The roots of value + along r + square r^2, not numbers where there are none.
    const double along = sheet.slope.dot(walk.along), square = walk.along.dot(sheet.bend * walk.along);
    const double half = -0.5 * (along + std::copysign(std::sqrt(along * along - 4.0 * square * sheet.value), along));
    meet(sheet.value / half);
    if (square > 0.0) meet(half / square);
  }
  const double falls = -walk.slope, square = falls * falls - 2.0 * walk.bend * walk.pressure;
  double step = falls > 0.0 ? walk.pressure / falls : kInfinity;
  if (!walk.fresh && walk.bend < 0.0) step = (std::sqrt(square) - falls) / -walk.bend;
  // Beyond a kink the pressure may begin to fall: a short step tells how.
  if (walk.fresh && (walk.passed > 0.0 || !(kink < kBeyond))) step = std::min(step, frame_.thickness / walk.along.norm());
  walk.at = walk.in + step;
  if (walk.at > kink) walk.at = walk.passed = kink;
}

/// Where a walk looks next, or that it is at the rim, from the pressures where it looked.
void OutlineWalks::walk_on(Walk& walk, const AlongAxis& sigma, double a, double b, const WalkEnd& end) {
  const double lift = sigma.lift(a, b);
  if (!sigma.upright(kGraphCosine) || !(std::abs(lift) <= kFar * frame_.thickness)) {  // far outside
    walk.most = 0.5 * (walk.at - walk.in);
    walk.at = walk.in + walk.most;
    walk.height = walk.in_height + walk.rise * walk.most;
    return;
  }
  const double p = sigma.pressure(a, b), slope = sigma.slope(walk.along), rise = sigma.rise(walk.along);
  const double here = walk.at, height = walk.height + lift;
  if (p > 0.0) {
    walk.bend = (slope - walk.slope) / (here - walk.in);
    walk.fresh = here == walk.passed;
    walk.in = here;
    walk.in_height = height;
    walk.pressure = p;
    walk.slope = slope;
    walk.rise = rise;
    walk.most *= 4.0;
    if (walk.out == kInfinity) {
      look_ahead(walk);
    } else {
      walk.at = slope < 0.0 ? here - p / slope : kInfinity;
    }
  } else {
    walk.out = here;
    walk.at = slope < 0.0 ? here - p / slope : -kInfinity;
  }
  const double step = walk.at - here;
  const bool to_kink = p > 0.0 && walk.at == walk.passed;  // the rim may lie on either side of it
  if (std::abs(step) <= end.step * here && std::abs(p) <= end.pressure && slope < 0.0 && !to_kink) {
    walk.done = true;
    walk.outward = -Vec2(sigma.slope(frame_.u), sigma.slope(frame_.v));
    walk.height = height + rise * step;
    return;
  }
  if (walk.out < kInfinity && !(walk.at > walk.in && walk.at < walk.out)) walk.at = 0.5 * (walk.in + walk.out);
  walk.at = std::min(walk.at, walk.in + walk.most);
  walk.height = height + rise * (walk.at - here);
}

bool OutlineWalks::follow(std::span<const Vec2> ways, double enough, std::vector<RimPoint>& out) {
  const double middle = start(ways);
  if (!(middle > 0.0)) return false;
  const WalkEnd end{enough, kNear * middle};
  for (Walk& walk : walks_) look_ahead(walk);
  std::size_t open = walks_.size();
  for (int iteration = 0; iteration < kBracketSteps && open > 0; ++iteration) {
    batch_.resize(walks_.size());
    for (std::size_t k = 0; k < walks_.size(); ++k) {
      if (!(walks_[k].at * walks_[k].along.norm() <= extent_)) return false;
      batch_.point[k] = frame_.origin + walks_[k].at * walks_[k].along + walks_[k].height * frame_.axis;
    }
    pressure_.evaluate(batch_);
    for (std::size_t k = 0; k < walks_.size(); ++k) {
      if (walks_[k].done) continue;
      walk_on(walks_[k], {batch_.slope_a[k], batch_.slope_b[k], frame_.axis}, batch_.a[k], batch_.b[k], end);
      if (walks_[k].done) --open;
    }
  }
  if (open > 0) return false;
  for (const Walk& walk : walks_) out.push_back({walk.at * walk.way, walk.height, walk.outward});
  return true;
}

bool make_sectors(const Outline& outline, std::vector<Sector>& sectors, std::vector<RimPoint>& polygon) {
  std::vector<Mark> marks = mark_outline(outline.point, outline.corner);
  mark_touches(outline.imprint, marks);
  const std::size_t n = marks.size();
  polygon.clear();
  for (const Mark& mark : marks) polygon.push_back(mark.point);
  std::size_t begin = 0;
  while (begin < n && !marks[begin].corner) ++begin;
  if (begin == n) begin = 0;
  // The point of the polygon in a direction that lies within `count` edges of point `from`.
  const auto along = [&](const Vec2& way, std::size_t from, std::size_t count) {
    std::size_t k = 0;
    while (k + 1 < count && cross(way, marks[(from + k + 1) % n].point.at) < 0.0) ++k;
    return point_between(marks[(from + k) % n].point, marks[(from + k + 1) % n].point, way);
  };
  sectors.clear();
  std::size_t from = 0;
  while (from < n) {
    // As far as the next corner, or as wide as a sector may be.
    std::size_t to = from + 1;
    double turn = 0.0;
    for (;; ++to) {
      const Vec2 &a = marks[(begin + to - 1) % n].point.at, &b = marks[(begin + to) % n].point.at;
      turn += math::atan2(cross(a, b), a.dot(b));
      if (to > from + 1 && turn > kWidest) {
        --to;
        break;
      }
      if (to == n || marks[(begin + to) % n].corner) break;
    }
    const Mark &first = marks[(begin + from) % n], &last = marks[(begin + to) % n];
    const RimPoint &a = first.point, &b = last.point;
    const RimPoint middle = along(0.5 * (a.at + b.at), (begin + from) % n, to - from);
    sectors.push_back({{a.at, middle.at, b.at}, {a.height, middle.height, b.height}, first.touch, last.touch});
    from = to;
  }
  return std::all_of(sectors.begin(), sectors.end(), [](const Sector& sector) {
    return cross(sector.at[0], sector.at[1]) > 0.0 && cross(sector.at[1], sector.at[2]) > 0.0;
  });
}

namespace {

std::vector<Vec2> circle(std::size_t n) {
  std::vector<Vec2> ways;
  for (std::size_t k = 0; k < n; ++k) {
    const auto [s, c] = math::sin_cos(kTurn * static_cast<double>(k) / static_cast<double>(n));
    ways.emplace_back(c, s);
  }
  return ways;
}

/// The frame's origin goes along the axis to Sigma, in the batch, too. @return whether both press there
bool lift_to_sigma(PairPressure& pressure, PeakFrame& frame, PressureBatch& batch) {
  batch.resize(1);
  for (int step = 0; step < kFreeSteps; ++step) {
    batch.point[0] = frame.origin;
    pressure.evaluate(batch);
    const double rate = (batch.slope_b[0] - batch.slope_a[0]).dot(frame.axis);
    if (!(rate > 0.0)) return false;
    const double lift = (batch.a[0] - batch.b[0]) / rate;
    frame.origin += lift * frame.axis;
    if (std::abs(lift) <= 1e-9 * frame.thickness) break;
  }
  return std::min(batch.a[0], batch.b[0]) > 0.0;
}

/// The frame goes to the centroid of the outline, with axes in which the outline is as wide as it is long.
bool move_to_middle(PairPressure& pressure, std::span<const RimPoint> outline, PeakFrame& frame) {
  const double lu = frame.u.norm(), lv = frame.v.norm();
  PolygonMoments moments;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const Vec2 &a = outline[k].at, &b = outline[(k + 1) % outline.size()].at;
    const Vec2 p(lu * a.x(), lv * a.y()), q(lu * b.x(), lv * b.y());
    if (!(cross(p, q) > 0.0)) return false;
    moments.add_edge(p, q);
  }
  const Vec2 centre = moments.first / moments.area;
  const Eigen::Matrix2d second = moments.second / moments.area - centre * centre.transpose();
  const Principal axes = principal(second(0, 0), second(0, 1), second(1, 1));
  if (!(axes.second > 0.0)) return false;
  const Vec3 along = frame.u / lu, across = frame.v / lv;
  frame.origin += centre.x() * along + centre.y() * across;
  PressureBatch batch;
  if (!lift_to_sigma(pressure, frame, batch)) return false;
  // An ellipse has a quarter of the squares of its half axes as its second moments.
  frame.axis = (batch.slope_b[0] - batch.slope_a[0]).normalized();
  const Vec3 u = axes.cosine * along + axes.sine * across, v = axes.cosine * across - axes.sine * along;
  const Vec3 one = (u - u.dot(frame.axis) * frame.axis).normalized();
  frame.u = 2.0 * std::sqrt(axes.first) * one;
  frame.v = 2.0 * std::sqrt(axes.second) * (v - v.dot(frame.axis) * frame.axis - v.dot(one) * one).normalized();
  return true;
}

/// Where a kink passes close to the middle, its crossings of rays nearly along it go from there to the rim within so small an angle that rules
/// agree without having seen it: the middle keeps away.
bool move_off_kinks(PairPressure& pressure, std::span<const implicit::Kink> kinks, PeakFrame& frame) {
  double least = kClear;
  Vec2 away = Vec2::Zero();
  for (const implicit::Kink& kink : kinks) {
    Vec3 slope;
    const double value = kink.value(frame.origin, slope);
    const Vec2 rise(slope.dot(frame.u), slope.dot(frame.v));
    const double distance = std::abs(value) / rise.norm();
    if (!(distance < least)) continue;
    least = distance;
    away = std::copysign(kClear - distance, value) / rise.norm() * rise;
  }
  if (least == kClear) return true;
  frame.origin += frame.across(away);
  PressureBatch batch;
  return lift_to_sigma(pressure, frame, batch);
}

}  // namespace

std::optional<Middle> find_middle(PairPressure& pressure, const PeakFrame& inside, std::span<const implicit::Kink> kinks, double extent) {
  static const std::vector<Vec2> few = circle(kFewRays), many = circle(kManyRays);
  Middle middle;
  PeakFrame& frame = middle.frame;
  frame = inside;
  frame.u *= std::sqrt(2.0 * frame.peak);
  frame.v *= std::sqrt(2.0 * frame.peak);
  for (const int round : {0, 1, 2}) {
    middle.outline.clear();
    if (!OutlineWalks(pressure, frame, kinks, extent).follow(round < 2 ? few : many, round < 2 ? kRough : kOutlineStep, middle.outline)) return std::nullopt;
    if (round < 2 && !move_to_middle(pressure, middle.outline, frame)) return std::nullopt;
    if (round == 1 && !move_off_kinks(pressure, kinks, frame)) return std::nullopt;
  }
  return middle;
}

}  // namespace supple::collision
