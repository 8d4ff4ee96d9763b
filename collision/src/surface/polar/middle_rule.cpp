/// Quadrature of a patch about its middle, for faces that lie on faces: their pressure is flat or has its peak at a corner,
/// about which rings say nothing. Rays are followed from kink to kink to the rim; the patch is parted into sectors between the
/// corners of its outline, where kinks meet the rim. A sector's rays go through a parabola near its piece of the rim, so that a
/// straight piece is a triangle, on which Gauss's rule is exact for polynomials. The rest is that of patches that kinks cross.
#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kFirst = 1e-3;            // kinks nearer to the middle are not gone to
constexpr double kBeyond = 4.0;            // kinks farther than that, in radii, tell no more than none; which are known depends on how the overlap's box lies
constexpr double kNear = 0.3;              // pressure at the rim, of that in the middle
constexpr double kFar = 2.0;               // from Sigma, in the overlap: Newton's method is not believed
constexpr double kRough = 0.05, kFine = 1e-2;  // of the radius, to find the middle and the corners
constexpr double kClear = 0.1;             // of the radius, from kinks to the middle
constexpr double kWidest = 1.7;            // sector [rad] in units of u and v
constexpr double kSameCorner = 1e-6;

std::vector<Vec2> circle(std::size_t n) {
  std::vector<Vec2> ways;
  for (std::size_t k = 0; k < n; ++k) {
    const auto [s, c] = math::sin_cos(kTurn * static_cast<double>(k) / static_cast<double>(n));
    ways.emplace_back(c, s);
  }
  return ways;
}

/// Where the tangents at two points of the rim meet; nothing where that is not between the rays through them.
std::optional<Vec2> between_tangents(const Vec2& a, const Vec2& out_a, const Vec2& b, const Vec2& out_b) {
  const double turn = cross(out_a, out_b);
  if (!(turn > 1e-6 * out_a.norm() * out_b.norm())) return std::nullopt;
  const double at_a = out_a.dot(a), at_b = out_b.dot(b);
  const Vec2 x = meeting_of(out_a, at_a, out_b, at_b);
  if (!(cross(a, x) > 0.0) || !(cross(x, b) > 0.0)) return std::nullopt;
  return x;
}

}  // namespace

/// Walks begin in the middle, where the pressure and its slope are known. @return the pressure there, 0 where nothing presses or Sigma is no graph
double PolarRuleSolver::start_walks(PairPressure& pressure, std::span<const Vec2> ways) {
  PressureBatch& batch = rim_batch_;
  batch.resize(1);
  batch.point[0] = frame_.origin;
  pressure.evaluate(batch);
  sheets_.clear();
  for (const implicit::Kink& kink : kinks_) {
    const Sheet sheet = sheet_of(kink);
    if (sheet.told) sheets_.push_back(sheet);
  }
  const AlongAxis sigma(batch.slope_a[0], batch.slope_b[0], frame_.axis);
  if (!sigma.upright(kGraphCosine)) return 0.0;
  const double p = sigma.pressure(batch.a[0], batch.b[0]);
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
void PolarRuleSolver::look_ahead(Walk& walk) const {
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
void PolarRuleSolver::walk_on(Walk& walk, const AlongAxis& sigma, double a, double b, const WalkEnd& end) {
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

/// Rays from the middle to the rim. Between kinks the pressure along a ray is smooth: what is known of it inside, or beyond the
/// rim, says where to look next, and never beyond the next kink before that has been looked at.
bool PolarRuleSolver::follow_outline(PairPressure& pressure, std::span<const Vec2> ways, double enough, std::vector<RimPoint>& out) {
  const double middle = start_walks(pressure, ways);
  if (!(middle > 0.0)) return false;
  const WalkEnd end{enough, kNear * middle};
  PressureBatch& batch = rim_batch_;
  for (Walk& walk : walks_) look_ahead(walk);
  std::size_t open = walks_.size();
  for (int iteration = 0; iteration < kBracketSteps && open > 0; ++iteration) {
    batch.resize(walks_.size());
    for (std::size_t k = 0; k < walks_.size(); ++k) {
      if (!(walks_[k].at * walks_[k].along.norm() <= extent_)) return false;
      batch.point[k] = frame_.origin + walks_[k].at * walks_[k].along + walks_[k].height * frame_.axis;
    }
    pressure.evaluate(batch);
    for (std::size_t k = 0; k < walks_.size(); ++k) {
      if (walks_[k].done) continue;
      walk_on(walks_[k], {batch.slope_a[k], batch.slope_b[k], frame_.axis}, batch.a[k], batch.b[k], end);
      if (walks_[k].done) --open;
    }
  }
  if (open > 0) return false;
  for (const Walk& walk : walks_) out.push_back({walk.at * walk.way, walk.height, walk.outward});
  return true;
}

/// Rays that Newton's method loses, as the face on which they begin tells nothing of its edge.
bool PolarRuleSolver::follow_rays(PairPressure& pressure) {
  std::vector<Vec2> ways;
  std::vector<RimPoint> found;
  for (std::size_t i = 0; i < rays_.size(); ++i) ways.emplace_back(rays_.cosine[i], rays_.sine[i]);
  if (!follow_outline(pressure, ways, kFine, found)) return false;
  for (std::size_t i = 0; i < found.size(); ++i) {
    rays_.radius[i] = walks_[i].at;
    rays_.height[i] = found[i].height;
  }
  return true;
}

/// The frame's origin goes along the axis to Sigma, in `rim_batch_`, too. @return whether both press there
bool PolarRuleSolver::lift_to_sigma(PairPressure& pressure) {
  PressureBatch& batch = rim_batch_;
  batch.resize(1);
  for (int step = 0; step < kFreeSteps; ++step) {
    batch.point[0] = frame_.origin;
    pressure.evaluate(batch);
    const double rate = (batch.slope_b[0] - batch.slope_a[0]).dot(frame_.axis);
    if (!(rate > 0.0)) return false;
    const double lift = (batch.a[0] - batch.b[0]) / rate;
    frame_.origin += lift * frame_.axis;
    if (std::abs(lift) <= 1e-9 * frame_.thickness) break;
  }
  return std::min(batch.a[0], batch.b[0]) > 0.0;
}

/// The frame goes to the centroid of the outline, with axes in which the outline is as wide as it is long.
bool PolarRuleSolver::move_to_middle(PairPressure& pressure) {
  const double lu = frame_.u.norm(), lv = frame_.v.norm();
  PolygonMoments moments;
  for (std::size_t k = 0; k < outline_.size(); ++k) {
    const Vec2 &a = outline_[k].at, &b = outline_[(k + 1) % outline_.size()].at;
    const Vec2 p(lu * a.x(), lv * a.y()), q(lu * b.x(), lv * b.y());
    if (!(cross(p, q) > 0.0)) return false;
    moments.add_edge(p, q);
  }
  const Vec2 centre = moments.first / moments.area;
  const Eigen::Matrix2d second = moments.second / moments.area - centre * centre.transpose();
  const Principal axes = principal(second(0, 0), second(0, 1), second(1, 1));
  if (!(axes.second > 0.0)) return false;
  const Vec3 along = frame_.u / lu, across = frame_.v / lv;
  frame_.origin += centre.x() * along + centre.y() * across;
  if (!lift_to_sigma(pressure)) return false;
  // An ellipse has a quarter of the squares of its half axes as its second moments.
  frame_.axis = (rim_batch_.slope_b[0] - rim_batch_.slope_a[0]).normalized();
  const Vec3 u = axes.cosine * along + axes.sine * across, v = axes.cosine * across - axes.sine * along;
  const Vec3 one = (u - u.dot(frame_.axis) * frame_.axis).normalized();
  frame_.u = 2.0 * std::sqrt(axes.first) * one;
  frame_.v = 2.0 * std::sqrt(axes.second) * (v - v.dot(frame_.axis) * frame_.axis - v.dot(one) * one).normalized();
  return true;
}

/// Where a kink passes close to the middle, its crossings of rays nearly along it go from there to the rim within so small an angle that rules
/// agree without having seen it: the middle keeps away.
bool PolarRuleSolver::move_off_kinks(PairPressure& pressure) {
  double least = kClear;
  Vec2 away = Vec2::Zero();
  for (const implicit::Kink& kink : kinks_) {
    Vec3 slope;
    const double value = kink.value(frame_.origin, slope);
    const Vec2 rise(slope.dot(frame_.u), slope.dot(frame_.v));
    const double distance = std::abs(value) / rise.norm();
    if (!(distance < least)) continue;
    least = distance;
    away = std::copysign(kClear - distance, value) / rise.norm() * rise;
  }
  if (least == kClear) return true;
  frame_.origin += frame_.across(away);
  return lift_to_sigma(pressure);
}

/// Which kinks have points of the outline on the other side than the middle; third bodies may all cross.
void PolarRuleSolver::cross_outline() {
  crossing_.clear();
  for (std::size_t k = 0; k < kinks_.size(); ++k) {
    const bool side = kinks_[k].value(frame_.origin) > 0.0;
    const auto other = [&](const RimPoint& p) {
      return (kinks_[k].value(frame_.place(p.at, p.height)) > 0.0) != side;
    };
    if (std::any_of(outline_.begin(), outline_.end(), other)) crossing_.push_back(k);
  }
  for (std::size_t t = 0; t < third_.size(); ++t) crossing_.push_back(kinks_.size() + t);
}

/// The outline with the places where its tangents meet, which lie outside the patch, so that no kink hides between points of it.
void PolarRuleSolver::follow_tangents() {
  const std::size_t n = outline_.size();
  fine_rim_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const RimPoint &a = outline_[i], &b = outline_[(i + 1) % n];
    fine_rim_.push_back(frame_.place(a.at, a.height));
    if (const std::optional<Vec2> corner = between_tangents(a.at, a.outward, b.at, b.outward)) {
      fine_rim_.push_back(frame_.place(*corner, 0.5 * (a.height + b.height)));
    }
  }
}

/// Corners and points of the outline by angle; of those that lie on one ray, corners are kept.
std::vector<PolarRuleSolver::Mark> PolarRuleSolver::mark_outline(std::span<const RimPoint> corners) const {
  std::vector<Mark> all, marks;
  for (const RimPoint& c : corners) all.push_back({c, true});
  for (const RimPoint& p : outline_) all.push_back({p, false});
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

bool PolarRuleSolver::on_one_ray(const Mark& a, const Mark& b) {
  return cross(a.point.at, b.point.at) < kSameCorner * a.point.at.norm() * b.point.at.norm() && a.point.at.dot(b.point.at) > 0.0;
}

/// The point of the edge from a to b that a ray meets.
PolarRuleSolver::RimPoint PolarRuleSolver::point_between(const RimPoint& a, const RimPoint& b, const Vec2& way) {
  const double s = cross(a.at, way) / (cross(a.at, way) + cross(way, b.at));
  return {(1.0 - s) * a.at + s * b.at, (1.0 - s) * a.height + s * b.height, Vec2::Zero()};
}

/// Adds corners where rays touch imprints.
void PolarRuleSolver::mark_touches(std::vector<Mark>& marks) const {
  for (const Imprint& imprint : imprints_) {
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

/// Sectors between corners of the outline, and between others of its points where these are too far apart.
/// @return whether rays through them turn one way
bool PolarRuleSolver::make_sectors(std::span<const RimPoint> corners) {
  std::vector<Mark> marks = mark_outline(corners);
  mark_touches(marks);
  const std::size_t n = marks.size();
  polygon_.clear();
  for (const Mark& mark : marks) polygon_.push_back(mark.point);
  std::size_t begin = 0;
  while (begin < n && !marks[begin].corner) ++begin;
  if (begin == n) begin = 0;
  // The point of the polygon in a direction that lies within `count` edges of point `from`.
  const auto along = [&](const Vec2& way, std::size_t from, std::size_t count) {
    std::size_t k = 0;
    while (k + 1 < count && cross(way, marks[(from + k + 1) % n].point.at) < 0.0) ++k;
    return point_between(marks[(from + k) % n].point, marks[(from + k + 1) % n].point, way);
  };
  sectors_.clear();
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
    sectors_.push_back({{a.at, middle.at, b.at}, {a.height, middle.height, b.height}, first.touch, last.touch});
    from = to;
  }
  return std::all_of(sectors_.begin(), sectors_.end(), [](const Sector& sector) {
    return cross(sector.at[0], sector.at[1]) > 0.0 && cross(sector.at[1], sector.at[2]) > 0.0;
  });
}

/// A panel for each sector. @param nodes  on a ray
void PolarRuleSolver::start_sectors(int nodes) {
  panels_.clear();
  for (std::size_t k = 0; k < sectors_.size(); ++k) {
    Panel panel;
    panel.begin = static_cast<double>(k);
    panel.end = static_cast<double>(k + 1);
    panel.touch_begin = sectors_[k].touch_begin;
    panel.touch_end = sectors_[k].touch_end;
    panel.nodes = nodes;
    panels_.push_back(panel);
  }
}

void PolarRuleSolver::place_rays(const KronrodRule& rule, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Panel& panel = panels_[first + i / per_panel];
    const double node = rule.node[i % per_panel], half = 0.5 * (panel.end - panel.begin);
    const auto [at, rate_at] = panel.touches() ? panel.bend(node) : std::array{panel.begin + half * (1.0 + node), half};
    const double whole = std::floor(panel.begin), x = at - whole;
    const Sector& sector = sectors_[static_cast<std::size_t>(whole)];
    const std::array<double, 3> share{(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)};
    const std::array<double, 3> rate{4.0 * x - 3.0, 4.0 - 8.0 * x, 4.0 * x - 1.0};
    Vec2 way = Vec2::Zero(), moves = Vec2::Zero();
    double height = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      way += share[k] * sector.at[k];
      moves += rate[k] * sector.at[k];
      height += share[k] * sector.height[k];
    }
    rays_.cosine[i] = way.x();
    rays_.sine[i] = way.y();
    rays_.radius[i] = 1.0;
    rays_.height[i] = height;
    turn_[i] = rate_at * cross(way, moves);
  }
}

/// @param frame  of any place of the patch   @return false where no kink crosses, or this does not fit
bool PolarRuleSolver::solve_about_middle(const PolarJob& job, const PeakFrame& frame, PatchPoints& points) {
  return part_about_middle(job.pressure, frame, job.settings) && finish_parted(job, points);
}

bool PolarRuleSolver::part_about_middle(PairPressure& pressure, const PeakFrame& frame, const ContactSettings& settings) {
  frame_ = frame;
  static const std::vector<Vec2> few = circle(kFewRays), many = circle(kManyRays);
  kinks_.clear();
  // All of both bodies: which of them a box holds depends on how it lies.
  all_kinks_ = pressure.kinks({Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)}, kinks_);
  if (kinks_.empty()) return false;
  frame_.u *= std::sqrt(2.0 * frame_.peak);
  frame_.v *= std::sqrt(2.0 * frame_.peak);
  for (const int round : {0, 1, 2}) {
    outline_.clear();
    if (!follow_outline(pressure, round < 2 ? few : many, round < 2 ? kRough : kFine, outline_)) return false;
    if (round < 2 && !move_to_middle(pressure)) return false;
    if (round == 1 && !move_off_kinks(pressure)) return false;
  }
  jacobian_ = frame_.u.norm() * frame_.v.norm();
  cross_outline();
  find_imprints(pressure);
  cut_ = !third_.empty();
  if (cut_) follow_tangents();  // corners of third bodies are begun there
  about_middle_ = true;
  rise_.setZero();
  const double error = settings.error;
  const bool fine = error < 1e-4 || cut_, fewest = error >= 1e-3 && !cut_, third = fine && error >= 1e-6 && !cut_;
  for (;;) {
    std::vector<RimPoint> corners;
    find_outline_corners(pressure, corners);
    if (crossing_.empty()) return false;
    if (!make_sectors(corners)) return false;
    start_sectors(error >= 1e-4 ? 3 : error >= 1e-6 ? 5 : error >= 1e-8 ? 7 : 8);
    const KronrodRule& first = kronrod_rule(fewest ? 2 : !fine || third ? 3 : 7);
    const std::size_t crossing = crossing_.size();
    if (!solve_all_panels(pressure, settings, first, third ? &kronrod_rule(7) : nullptr)) return false;
    if (crossing_.size() == crossing) return true;
    outline_ = kept_rim_;  // they show kinks that the outline did not
    std::sort(outline_.begin(), outline_.end(), [](const RimPoint& a, const RimPoint& b) { return before(a.at, b.at); });
  }
}

}  // namespace supple::collision
