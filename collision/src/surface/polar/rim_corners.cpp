/// Corners of a patch's rim, where kinks meet it: p_A = p_B = s = 0. Newton's method for all three finds them where the three gradients differ. On
/// faces that lean by about their overlap these are nearly in one plane where the rim leaves the edge of a face for the strip beyond it, and the rim
/// turns within a tiny part of the strip. The pressure along the edge itself is smooth, though, and its sign on two rays says that a corner lies
/// between them.
#include <algorithm>
#include <cmath>
#include <limits>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/rim_corners.h"

namespace supple::collision {
namespace {

constexpr int kSearchSteps = 64;
constexpr int kDipRounds = 6;
constexpr double kDip = 0.1;              // of the pressures beside it
constexpr double kNearRim = 0.05;         // of the radius
constexpr double kBeside = 1.0;           // of the way to the next ray: where kinks may meet between two
constexpr double kParallel = 1e-9;        // sine between kinks that do not meet
constexpr double kLeastShare = 0.3;       // radius of the rim, as it leads from one ray to the next, over that of such a place
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kMet = 1e-9;             // of the radius, which the step leaves the square of
constexpr double kFarthest = 2.0;          // radius of an edge, over that of the rim, at which the pressure is asked
constexpr double kClose = 1e-4, kRough = 0.1;
constexpr double kLeastCosine = 0.02;     // of Sigma's normal to the axis

/// Where between 0 and 1 a cubic comes nearest to 0, from its values and derivatives at both, which have one sign; only where it may reach it.
double nearest_to_zero(double left, double left_rate, double right, double right_rate) {
  const double side = left > 0.0 ? 1.0 : -1.0, rise = right - left;
  // left + left_rate x + square x^2 + cube x^3
  const double square = 3.0 * rise - 2.0 * left_rate - right_rate, cube = left_rate + right_rate - 2.0 * rise;
  if (!(side * left_rate < 0.0) || !(side * right_rate > 0.0)) return kNotANumber;
  const double root = std::sqrt(square * square - 3.0 * cube * left_rate);
  const double x = -left_rate / (square + side * root), value = left + x * (left_rate + x * (square + x * cube));
  return side * value <= kDip * std::min(side * left, side * right) ? x : kNotANumber;
}

/// Calls `body` with each ray and the next one that meets the same kink, around the patch. @param rays  by kink and angle
template <class Rays, class Body>
void for_neighbours(const Rays& rays, const Body& body) {
  for (std::size_t first = 0, last = 0; first < rays.size(); first = last) {
    while (last < rays.size() && rays[last].kink == rays[first].kink) ++last;
    for (std::size_t i = first; i < last; ++i) body(rays[i], rays[i + 1 < last ? i + 1 : first]);
  }
}

}  // namespace

/// Where a function changes its sign around a closed line, from its values at points of it: i + t lies between points i and i + 1.
/// Between two changes that no point saw, or one alone, it is the parabola through three points.
void follow_signs(std::span<const double> values, std::vector<double>& places) {
  const std::size_t n = values.size();
  const auto at = [&](std::size_t i) { return values[i % n]; };
  const auto alone = [&](std::size_t i) { return (at(i + n - 1) > 0.0) != (at(i) > 0.0) && (at(i + 1) > 0.0) != (at(i) > 0.0); };
  /// The root of the parabola about point i on one side of it; not a number where there is none.
  const auto root = [&](std::size_t i, double side) {
    const double last = at(i + n - 1), here = at(i), next = at(i + 1);
    const double bend = last - 2.0 * here + next, slope = 0.5 * (next - last);
    return (side * std::copysign(std::sqrt(slope * slope - 2.0 * bend * here), bend) - slope) / bend;
  };
  const auto add = [&](double place) { places.push_back(place < 0.0 ? place + static_cast<double>(n) : place); };
  for (std::size_t i = 0; i < n; ++i) {
    const double last = at(i + n - 1), here = at(i), next = at(i + 1), begin = static_cast<double>(i);
    const bool side = here > 0.0;
    if ((next > 0.0) != side) {
      add(begin + (alone(i) ? root(i, 1.0) : alone(i + 1) ? 1.0 + root(i + 1, -1.0) : here / (here - next)));
      continue;
    }
    const double bend = last - 2.0 * here + next, slope = 0.5 * (next - last), square = slope * slope - 2.0 * bend * here;
    if ((last > 0.0) != side || !(bend * here > 0.0) || !(std::abs(slope) <= 0.5 * std::abs(bend)) || !(square > 0.0)) continue;
    for (const double which : {-1.0, 1.0}) add(begin + root(i, which));
  }
}

/// Newton's method to where kinks meet the rim, p_A = p_B = s = 0. @param kink  of each point   @param last  lengths of the last steps
void CornerFinder::move_to_corners(std::span<const std::size_t> kink, std::vector<double>& last) {
  PressureBatch& batch = batch_;
  batch.resize(batch.point.size());
  last.assign(kink.size(), 0.0);
  for (int step = 0; step < kFreeSteps; ++step) {
    pressure_.evaluate(batch);
    levels_.evaluate_thirds(batch.point);
    bool moved = false;
    for (std::size_t i = 0; i < kink.size(); ++i) {
      Vec3 slope;
      const double s = levels_.value(kink[i], frame_, batch, i, slope);
      Mat3 rows;
      rows.row(0) = batch.slope_a[i];
      rows.row(1) = batch.slope_b[i];
      rows.row(2) = slope;
      const double volume = rows.determinant();
      const Vec3 value(batch.a[i], batch.b[i], s);
      const Vec3 &a = batch.slope_a[i], &b = batch.slope_b[i];
      const Vec3 move = -(value[0] * b.cross(slope) + value[1] * slope.cross(a) + value[2] * a.cross(b)) / volume;
      last[i] = move.norm();
      if (!(last[i] <= extent_)) continue;
      batch.point[i] += move;
      moved = moved || last[i] > 1e-9 * extent_;
    }
    if (!moved) break;
  }
}

void CornerFinder::find(std::span<const Vec3> rim, std::size_t least, std::vector<Corner>& corners) {
  const std::size_t n = rim.size();
  std::vector<std::size_t> kink;
  std::vector<double> sides(n), places;
  PressureBatch& batch = batch_;
  batch.point.clear();
  for (const std::size_t k : levels_.crossing) {
    if (k < least) continue;
    for (std::size_t i = 0; i < n; ++i) sides[i] = levels_.value(k, frame_, pressure_, rim[i]);
    places.clear();
    follow_signs(sides, places);
    for (const double place : places) {
      const double whole = std::floor(place);
      const auto i = static_cast<std::size_t>(whole) % n;
      batch.point.push_back(rim[i] + (place - whole) * (rim[(i + 1) % n] - rim[i]));
      kink.push_back(k);
    }
  }
  for (const Imprint& imprint : levels_.imprint) {
    if (std::find(levels_.crossing.begin(), levels_.crossing.end(), levels_.kink.size() + imprint.third) == levels_.crossing.end()) continue;
    batch.point.insert(batch.point.end(), imprint.leaves.begin(), imprint.leaves.end());
    kink.resize(batch.point.size(), levels_.kink.size() + imprint.third);
  }
  if (kink.empty()) return;
  std::vector<double> last;
  move_to_corners(kink, last);
  for (std::size_t i = 0; i < kink.size(); ++i) {
    const auto same = [&](std::size_t j) { return kink[j] == kink[i] && (batch.point[j] - batch.point[i]).norm() <= 1e-6 * extent_; };
    bool found = last[i] <= 1e-6 * extent_;  // the panels find others by being parted
    for (std::size_t j = 0; j < i && found; ++j) found = !same(j);
    if (found) corners.push_back({batch.point[i], kink[i]});
  }
}

std::optional<double> CornerFinder::between(std::size_t level, const RayEnd& first, const RayEnd& second) {
  const Vec3 &a = first.place, &b = second.place;
  const double left = levels_.value(level, frame_, pressure_, a), right = levels_.value(level, frame_, pressure_, b);
  if ((left > 0.0) == (right > 0.0)) return std::nullopt;
  const double share = left / (left - right);
  batch_.point.assign(1, a + share * (b - a));
  std::vector<double> last;
  move_to_corners({&level, 1}, last);
  const Vec2 way = frame_.parts_of(batch_.point[0] - frame_.origin);
  const auto angle = [&](const Vec2& to) { return math::atan2(cross(first.way, to), first.way.dot(to)); };
  const double exact = angle(way) / angle(second.way);
  return exact > 0.0 && exact < 1.0 ? exact : share;
}

/// Where rays meet their kinks on Sigma, and the pressure there: that of minus infinity far outside. The height is to be near it.
/// @param close  distance from Sigma, in the overlap, at which the pressure is that there
void CornerFinder::meet_kinks(double close, std::span<KinkOnRay> rays) {
  PressureBatch& batch = batch_;
  const auto place = [&](const KinkOnRay& ray) -> Vec3 {
    return frame_.origin + ray.radius * frame_.across(ray.way) + ray.height * frame_.axis;
  };
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i].radius = rays[i].rim;
    rays[i].pressure = -kInfinity;
    rays[i].positive = levels_.kink[rays[i].kink].value(place(rays[i])) > 0.0;
    open.push_back(i);
  }
  for (int step = 0; step < kFreeSteps && !open.empty(); ++step) {
    std::erase_if(open, [&](std::size_t i) {
      KinkOnRay& ray = rays[i];
      const Vec3 along = frame_.across(ray.way);
      double move = 0.0;
      for (int k = 0; k < kFreeSteps; ++k) {
        Vec3 slope;
        const double s = levels_.kink[ray.kink].value(place(ray), slope);
        move = -s / slope.dot(along);
        ray.radius += move;
        if (std::abs(move) <= kMet * ray.rim) break;
      }
      ray.met = ray.radius > 0.0 && ray.radius <= kFarthest * ray.rim && std::abs(move) <= kMet * ray.rim;
      return !ray.met;
    });
    batch.resize(open.size());
    for (std::size_t j = 0; j < open.size(); ++j) batch.point[j] = place(rays[open[j]]);
    pressure_.evaluate(batch);
    std::size_t next = 0;
    std::erase_if(open, [&](std::size_t i) {
      KinkOnRay& ray = rays[i];
      const std::size_t j = next++;
      const Vec3 &a = batch.slope_a[j], &b = batch.slope_b[j], g = a - b;
      Vec3 slope;
      static_cast<void>(levels_.kink[ray.kink].value(batch.point[j], slope));
      const Vec3 along = frame_.across(ray.way), across = ray.radius * frame_.across({-ray.way.y(), ray.way.x()});
      const double s_along = slope.dot(along), s_up = slope.dot(frame_.axis), s_across = slope.dot(across);
      const double g_along = g.dot(along), g_up = g.dot(frame_.axis), g_across = g.dot(across), determinant = s_along * g_up - s_up * g_along;
      ray.positive = s_along < 0.0;
      if (!(-g_up > kLeastCosine * g.norm())) return true;
      // Newton's method for s = p_A - p_B = 0.
      const double gap = batch.a[j] - batch.b[j], lift = -gap * s_along / determinant, move = gap * s_up / determinant;
      ray.height += lift;
      ray.radius += move;
      if (!(std::abs(lift) <= close * frame_.thickness)) return false;
      ray.pressure = batch.a[j] + a.dot(lift * frame_.axis + move * along);
      ray.positive = (ray.pressure > 0.0) == (s_along > 0.0);
      // The place moves with the ray so that both stay 0.
      const double out = (s_up * g_across - g_up * s_across) / determinant, rise = (g_along * s_across - s_along * g_across) / determinant;
      ray.rate = a.dot(across + out * along + rise * frame_.axis);
      return true;
    });
  }
}

/// Corners between two rays whose ends on the rim lie on different sides of a kink. @return in each `at`, nothing where it is not found
void CornerFinder::find_between(std::span<CornerSearch> searches) {
  std::vector<std::size_t> open;
  std::vector<KinkOnRay> rays;
  for (std::size_t i = 0; i < searches.size(); ++i) open.push_back(i);
  for (int step = 0; step < kSearchSteps && !open.empty(); ++step) {
    rays.clear();
    for (const std::size_t i : open) {
      const CornerSearch& search = searches[i];
      const double rim = search.rim_left + search.place * (search.rim_right - search.rim_left);
      rays.push_back({search.kink, search.left + search.place * (search.right - search.left), rim, search.height});
    }
    meet_kinks(kClose, rays);
    std::size_t next = 0;
    std::erase_if(open, [&](std::size_t i) {
      const KinkOnRay& ray = rays[next++];
      CornerSearch& search = searches[i];
      const double place = search.place, turn = cross(search.left, search.right) / ray.way.squaredNorm();
      (ray.positive == search.positive_left ? search.from : search.to) = place;
      if (ray.pressure > 0.0) search.height = ray.height;  // Sigma bends far outside
      search.place = place - ray.pressure / (ray.rate * turn);
      if (std::isfinite(ray.pressure) && std::abs(search.place - place) <= kSameTurn) {
        search.at = ray.radius * (search.left + search.place * (search.right - search.left));
        search.height = ray.height;
        return true;
      }
      if (!(search.place > search.from && search.place < search.to)) search.place = 0.5 * (search.from + search.to);
      return search.to - search.from <= kSameTurn * kSameTurn;
    });
  }
}

/// Directions of places near the rim at which two kinks meet: edges that rays meet there are short.
void CornerFinder::add_vertices(std::span<const RimPoint> outline, std::vector<RimPoint>& rays) const {
  const std::size_t n = outline.size();
  std::vector<double> distance;  // of each kink from each point of the outline, in ways to the next
  for (const implicit::Kink& kink : levels_.kink) {
    for (std::size_t i = 0; i < n; ++i) {
      const Vec2 chord = outline[(i + 1) % n].at - outline[i].at;
      distance.push_back(std::abs(kink.value(frame_.place(outline[i].at, outline[i].height))) / frame_.across(chord).norm());
    }
  }
  for (std::size_t j = 0; j < levels_.kink.size(); ++j) {
    for (std::size_t k = 0; k < j; ++k) {
      const auto far = [&](std::size_t i) { return std::max(distance[j * n + i % n], distance[k * n + i % n]); };
      for (std::size_t i = 0; i < n; ++i) {
        if (!(far(i) <= kBeside) || far(i + n - 1) < far(i) || far(i + 1) <= far(i)) continue;
        Vec2 at = outline[i].at;
        bool met = false;
        for (int step = 0; step < kFreeSteps && !met; ++step) {
          Vec3 one, other;
          const Vec3 x = frame_.place(at, outline[i].height);
          const Vec2 s(levels_.kink[j].value(x, one), levels_.kink[k].value(x, other));
          const Vec2 a(one.dot(frame_.u), one.dot(frame_.v)), b(other.dot(frame_.u), other.dot(frame_.v));
          if (!(std::abs(cross(a, b)) > kParallel * a.norm() * b.norm())) break;
          const Vec2 move = meeting_of(a, -s[0], b, -s[1]);
          at += move;
          met = move.norm() <= kMet * at.norm();
        }
        if (!met) continue;
        const bool after = cross(outline[i].at, at) > 0.0;
        const RimPoint &p = outline[after ? i : (i + n - 1) % n], &q = outline[after ? (i + 1) % n : i];
        const double beyond = cross(p.at, at), left = cross(at, q.at), share = cross(p.at, q.at) / (beyond + left);  // of the radius of the chord
        if (beyond > 0.0 && left > 0.0 && share >= kLeastShare) rays.push_back({at, outline[i].height, Vec2::Zero()});
      }
    }
  }
}

/// Where the rays of the outline, and rays between them on which the pressure along a kink comes near to 0, meet the kinks that are near; by kink and angle.
std::vector<CornerFinder::KinkOnRay> CornerFinder::kinks_on_rays(std::span<const RimPoint> outline) {
  std::vector<RimPoint> points(outline.begin(), outline.end());
  add_vertices(outline, points);
  std::vector<KinkOnRay> all, fresh;
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    const auto far = [&](const RimPoint& p) {
      const Vec3 x = frame_.place(p.at, p.height);
      return std::abs(levels_.kink[k].value(x)) > levels_.kink[k].change(x, kNearRim * frame_.across(p.at).norm());
    };
    const bool crosses = std::binary_search(levels_.crossing.begin(), levels_.crossing.end(), k);
    if (!crosses && std::all_of(points.begin(), points.end(), far)) continue;
    for (const RimPoint& p : points) {
      const double length = p.at.norm();
      fresh.push_back({k, p.at / length, length, p.height});
    }
  }
  for (int round = 0; round <= kDipRounds && !fresh.empty(); ++round) {
    meet_kinks(kRough, fresh);
    all.insert(all.end(), fresh.begin(), fresh.end());
    std::stable_sort(all.begin(), all.end(), [](const KinkOnRay& a, const KinkOnRay& b) { return a.kink != b.kink ? a.kink < b.kink : before(a.way, b.way); });
    fresh.clear();
    if (round == kDipRounds) break;
    for_neighbours(all, [&](const KinkOnRay& ray, const KinkOnRay& next) {
      if (ray.positive != next.positive || !std::isfinite(ray.pressure) || !std::isfinite(next.pressure)) return;
      const double turn = cross(ray.way, next.way), place = nearest_to_zero(ray.pressure, turn * ray.rate, next.pressure, turn * next.rate);
      if (!(place > 0.0 && place < 1.0)) return;
      const Vec2 way = ray.way + place * (next.way - ray.way);
      fresh.push_back({ray.kink, way / way.norm(), ray.rim + place * (next.rim - ray.rim), ray.height, true});
    });
  }
  return all;
}

void CornerFinder::find_on_outline(std::span<const RimPoint> outline, std::span<const Vec3> rim, std::vector<RimPoint>& corners) {
  const std::vector<KinkOnRay> all = kinks_on_rays(outline);
  // Where the strip beyond an edge all but ends, its width has a kink.
  for (const KinkOnRay& ray : all) {
    if (ray.dip && ray.pressure > 0.0) corners.push_back({ray.radius * ray.way, ray.height, Vec2::Zero()});
  }
  std::vector<CornerSearch> searches;
  for_neighbours(all, [&](const KinkOnRay& ray, const KinkOnRay& next) {
    if (ray.positive == next.positive) return;
    const bool both = std::isfinite(ray.pressure) && std::isfinite(next.pressure);
    const KinkOnRay& near = ray.pressure > next.pressure ? ray : next;
    searches.push_back({ray.kink, ray.way, next.way, ray.rim, next.rim, ray.positive, both ? ray.pressure / (ray.pressure - next.pressure) : 0.5, near.height});
  });
  find_between(searches);
  std::erase_if(searches, [](const CornerSearch& search) { return !search.at; });
  for (const CornerSearch& search : searches) {
    const auto place = std::lower_bound(levels_.crossing.begin(), levels_.crossing.end(), search.kink);
    if (place == levels_.crossing.end() || *place != search.kink) levels_.crossing.insert(place, search.kink);
  }
  for (const CornerSearch& search : searches) corners.push_back({*search.at, search.height, Vec2::Zero()});
  std::vector<Corner> found;
  find(rim, levels_.kink.size(), found);
  for (const Corner& corner : found) {
    const Vec3 d = corner.at - frame_.origin;
    corners.push_back({frame_.parts_of(d), d.dot(frame_.axis), Vec2::Zero()});
  }
}

}  // namespace supple::collision
