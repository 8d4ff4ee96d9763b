#include "supple/collision/deformed_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "deform/bulge_volume.h"
#include "numbers.h"
#include "pairs/boxes.h"
#include "supple/core/error.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

/// How far the pressure of a body falls below zero [Pa]: P c where the kernels are compact, infinite else.
double depth_outside(const ContactBody& body) {
  const Box box = body.field.surface_box();
  if (box.empty() || !is_finite(box)) return kInfinity;
  const Vec3 far = box.centre() + Vec3::Constant(100.0 * box.extent().maxCoeff());
  Vec3 slope;
  const double value = body.field.value(far, slope);
  return slope.isZero(0.0) ? -body.material.modulus * value : kInfinity;
}

/// The box of {p >= -below}. @param certain  false where it was not found
Box bounding_box(const ContactBody& body, double below, bool& certain) {
  certain = true;
  // Slabs are put on each side of the surface's box until one lies where p < -below everywhere.
  Box box = body.field.surface_box();
  const double step = 0.25 * body.field.feature_size();
  if (!(below > 0.0) || !std::isfinite(step) || box.empty()) return box;
  constexpr int kMostSteps = 32;
  const Box wide = box.inflated(kMostSteps * step);
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool upper : {false, true}) {
      double& side = upper ? box.upper[axis] : box.lower[axis];
      bool outside = !std::isfinite(side);
      for (int i = 0; i < kMostSteps && !outside; ++i) {
        Box slab = wide;
        slab.lower[axis] = upper ? side : side - step;
        slab.upper[axis] = upper ? side + step : side;
        outside = body.material.modulus * body.field.bound(slab).upper < -below;
        if (!outside) side += upper ? step : -step;
      }
      certain = certain && outside;
    }
  }
  return box;
}

/// Buffers of one call; taken from the thread while in use, because fields call each other.
struct Buffers {
  std::vector<double> value, bulge, limit;
  std::vector<Vec3> slope, bulge_slope, limit_slope;
  // Ways along a gradient.
  std::vector<std::uint32_t> open;
  std::vector<Vec3> start, at, open_at;
  std::vector<double> open_value, distance, steepness;
  std::vector<Vec3> open_slope;
};

class Borrowed {
 public:
  Borrowed() : buffers_(std::move(kept())) {}
  ~Borrowed() { kept() = std::move(buffers_); }
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  Buffers* operator->() { return &buffers_; }
  Buffers& operator*() { return buffers_; }

 private:
  static Buffers& kept() {
    thread_local Buffers buffers;
    return buffers;
  }
  Buffers buffers_;
};

/// From each point of `start` along the body's gradient to its surface: how far that is [m] (< 0 from inside, infinite where the
/// surface is farther than `reach` or the way is lost), and |grad p| there [Pa/m].
void follow_gradient(const ContactBody& body, double reach, Buffers& way) {
  constexpr int kSteps = 24;
  constexpr double kEnough = 1e-13;  // of the reach
  const std::size_t n = way.start.size();
  way.at = way.start;
  way.distance.assign(n, kInfinity);
  way.steepness.assign(n, 0.0);
  way.open.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) way.open[i] = i;
  for (int step = 0; step < kSteps && !way.open.empty(); ++step) {
    const std::size_t count = way.open.size();
    way.open_at.resize(count);
    way.open_value.resize(count);
    way.open_slope.resize(count);
    for (std::size_t k = 0; k < count; ++k) way.open_at[k] = way.at[way.open[k]];
    body.field.evaluate(way.open_at, way.open_value, way.open_slope);
    std::size_t left = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint32_t i = way.open[k];
      const double slope = way.open_slope[k].norm();
      if (!(slope > 0.0)) continue;
      const double length = -way.open_value[k] / slope;  // up the slope
      const double gone = (way.at[i] - way.start[i]).norm();
      if (gone > reach) continue;
      way.at[i] += (std::clamp(length, -0.5 * reach, 0.5 * reach) / slope) * way.open_slope[k];
      const double round_off = 4.0 * kEpsilon * way.at[i].lpNorm<Eigen::Infinity>();
      if (std::abs(length) > std::max(kEnough * reach, round_off)) {
        way.open[left++] = i;
        continue;
      }
      const Vec3 whole = way.at[i] - way.start[i];
      way.distance[i] = std::copysign(whole.norm(), whole.dot(way.open_slope[k]));
      way.steepness[i] = body.material.modulus * slope;
    }
    way.open.resize(left);
  }
}

/// A width [m], or less, so that the kernels of a body end beyond it. @param place  near its surface
double width_within(const ContactBody& body, const Vec3& place, double width) {
  const double lowest = -0.9 * depth_outside(body) / body.material.modulus;
  Vec3 slope;
  const double value = body.field.value(place, slope);
  const double steepness = slope.norm();
  if (!std::isfinite(lowest) || !(steepness > 0.0)) return width;
  const Vec3 out = -slope / steepness;
  const double inside = std::max(value, 0.0) / steepness;  // how deep the place lies, to first order
  const auto ends_at = [&](double x) { return body.field.value(place + (inside + x) * out) < lowest; };
  double low = 0.0, high = width;
  if (!ends_at(high)) return width;
  for (int k = 0; k < kBracketSteps; ++k) (ends_at(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
  return low;
}

/// Means of |grad p| of the bodies of a contact and of |grad(p_A - p_B)| [Pa/m].
struct SigmaSlopes {
  double own = 0.0, other = 0.0, across = 0.0;
};

/// At some of the points of Sigma.
SigmaSlopes slopes_on(const ContactSurface& surface, std::size_t contact, const ContactBody& own, const ContactBody& other) {
  constexpr std::size_t kMost = 64;
  const auto pair = static_cast<std::uint32_t>(contact);
  const auto first = std::lower_bound(surface.pair.begin(), surface.pair.end(), pair), last = std::upper_bound(first, surface.pair.end(), pair);
  const auto begin = static_cast<std::size_t>(first - surface.pair.begin()), count = static_cast<std::size_t>(last - first);
  std::vector<Vec3> at, own_slope, other_slope;
  for (std::size_t k = 0; k < count; k += 1 + count / kMost) at.push_back(surface.point[begin + k]);
  if (at.empty()) at.push_back(surface.summary[contact].centre_of_pressure);
  own_slope.resize(at.size());
  other_slope.resize(at.size());
  std::vector<double> value(at.size());
  own.field.evaluate(at, value, own_slope);
  other.field.evaluate(at, value, other_slope);
  SigmaSlopes mean;
  const double share = 1.0 / static_cast<double>(at.size());
  for (std::size_t k = 0; k < at.size(); ++k) {
    const Vec3 a = own.material.modulus * own_slope[k], b = other.material.modulus * other_slope[k];
    mean.own += share * a.norm();
    mean.other += share * b.norm();
    mean.across += share * (a - b).norm();
  }
  return mean;
}

/// Adds the literal bulge around a body to `bulge`, at most `highest`, and to `bulge_slope` where that is wanted.
void add_literal(const ContactBody& body, BulgeProfile h, double highest, std::span<const Vec3> points, bool with_gradients,
                 Buffers& out) {
  const double step = 1e-5 * h.width;
  const std::size_t n = points.size();
  out.start.assign(points.begin(), points.end());
  if (with_gradients) {
    for (const Vec3& x : points) {
      for (int k = 0; k < 3; ++k) {
        out.start.push_back(x + step * Vec3::Unit(k));
        out.start.push_back(x - step * Vec3::Unit(k));
      }
    }
  }
  follow_gradient(body, h.width + 2.0 * step, out);
  for (std::size_t i = 0; i < n; ++i) {
    const double x = out.distance[i];
    if (!(x > 0.0) || !(x < h.width)) continue;
    h.stiffness = out.steepness[i];
    const double lift = h.value(x);
    out.bulge[i] += std::min(lift, highest);
    if (!with_gradients || lift >= highest) continue;
    const double rest = 1.0 - 2.0 * x / h.width, by_stiffness = rest > 0.0 ? x * rest * rest : 0.0;  // dh/dk
    for (int k = 0; k < 3; ++k) {
      const std::size_t ahead = n + 6 * i + 2 * static_cast<std::size_t>(k), behind = ahead + 1;
      const double moved = out.distance[ahead] - out.distance[behind];
      if (!std::isfinite(moved)) continue;
      const double change = h.slope(x) * moved + by_stiffness * (out.steepness[ahead] - out.steepness[behind]);
      out.bulge_slope[i][k] += change / (2.0 * step);
    }
  }
}

/// Pressures of a body at points, and their gradients if there is room for them.
void pressures_of(const ContactBody& body, std::span<const Vec3> points, std::span<double> p, std::span<Vec3> gradients) {
  if (gradients.empty()) {
    body.field.evaluate(points, p);
  } else {
    body.field.evaluate(points, p, gradients);
    for (Vec3& g : gradients) g *= body.material.modulus;
  }
  for (double& v : p) v *= body.material.modulus;
}

/// Bulges end where another body begins: they are no higher than its pressure is below zero.
void lower_limit(const ContactBody& other, std::span<const Vec3> points, Buffers& scratch) {
  pressures_of(other, points, scratch.value, scratch.slope);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (-scratch.value[i] >= scratch.limit[i]) continue;
    scratch.limit[i] = -scratch.value[i];
    if (!scratch.slope.empty()) scratch.limit_slope[i] = -scratch.slope[i];
  }
}

}  // namespace

DeformedPressure::DeformedPressure(std::span<const ContactBody> bodies, std::uint32_t body, const ContactSurface& surface,
                       const BulgeSettings& settings)
    : bodies_(bodies), body_(body), literal_(settings.literal) {
  SUPPLE_EXPECTS(body < bodies.size());
  SUPPLE_EXPECTS(settings.attenuation >= 0.0 && settings.width > 0.0);
  SUPPLE_EXPECTS(!settings.literal || !settings.keep_volume);
  const auto is_own = [&](const ContactSurface::Summary& s) {
    return (s.bodies.a == body || s.bodies.b == body) && s.largest_pressure > 0.0;
  };
  if (settings.attenuation > 0.0 || settings.keep_volume) {
    // All bulges together stay below half of what would lift the empty space around the body onto its surface.
    const auto touching = static_cast<double>(std::count_if(surface.summary.begin(), surface.summary.end(), is_own));
    highest_ = touching > 0.0 ? 0.5 * depth_outside(bodies[body]) / touching : 0.0;
    std::vector<WantedBulge> wanted;
    for (std::size_t contact = 0; contact < surface.summary.size(); ++contact) {
      const ContactSurface::Summary& s = surface.summary[contact];
      if (!is_own(s)) continue;
      const std::uint32_t other = s.bodies.a == body ? s.bodies.b : s.bodies.a;
      const ContactBody& b = bodies[other];
      if (literal_) {
        const double size = std::isfinite(b.field.feature_size()) ? b.field.feature_size() : bodies[body].field.feature_size();
        const double width = width_within(b, s.centre_of_pressure, settings.width * size);
        neighbours_.push_back({other, {.height = settings.attenuation * s.largest_pressure, .width = width}});
        rise_ += literal_rise(neighbours_.back(), b.field.surface_box());
        continue;
      }
      if (settings.keep_volume) {
        const double width = settings.width * b.field.feature_size();
        want_volume(surface, contact, other, std::isnan(width) ? kInfinity : width, wanted);
        continue;
      }
      Vec3 slope;
      static_cast<void>(b.field.value(s.centre_of_pressure, slope));
      const double steepness = b.material.modulus * slope.norm();
      double width = settings.width * b.field.feature_size() * steepness;
      if (std::isnan(width)) width = kInfinity;
      // Where the kernels of the other body end, the bulge must have ended too.
      width = std::min(width, 0.9 * depth_outside(b));
      double height = std::min(settings.attenuation * s.largest_pressure, highest_);
      width = effective_width(width, height, 1.0);
      // h(x) <= x, and so no point belongs to two bulges, iff a0 <= w / 3.
      height = std::min(height, width / 3.0);
      if (!(height > 0.0)) continue;
      neighbours_.push_back({other, {.stiffness = 1.0, .height = height, .width = width}});
      rise_ += height;
    }
    keep_volumes(wanted);
  }
  bool certain;
  box_ = bounding_box(bodies[body], rise_, certain);
  if (literal_ && !certain) {
    box_ = bodies[body].field.surface_box();
    for (const Neighbour& n : neighbours_) box_ = box_.united(bodies[n.body].field.surface_box().inflated(n.profile.width));
  }
  if (neighbours_.empty() || literal_) return;
  find_limiting();
}

void DeformedPressure::find_limiting() {
  limiting_.clear();
  for (std::uint32_t j = 0; j < bodies_.size(); ++j) {
    if (j == body_ || bodies_[j].material.modulus * bodies_[j].field.bound(box_).upper < -rise_) continue;
    limiting_.push_back(j);
  }
}

void DeformedPressure::want_volume(const ContactSurface& surface, std::size_t contact, std::uint32_t other, double width, std::vector<WantedBulge>& wanted) const {
  const ContactSurface::Summary& s = surface.summary[contact];
  const double displaced = s.bodies.a == body_ ? s.displaced_a : s.displaced_b;
  const SigmaSlopes slopes = slopes_on(surface, contact, bodies_[body_], bodies_[other]);
  if (!(displaced > 0.0) || !(slopes.own > 0.0) || !(slopes.other > 0.0)) return;
  // On the way from the body to a steep other one h rises as fast as p falls, and a tongue comes off the surface, where 3 a0 / w, of the outer half of h,
  // times the ratio of slopes is 1. With k = 1 / ratio that is half as much for w = 6 a0 / k.
  const double ratio = std::max(1.0, slopes.other / slopes.own), stiffness = 1.0 / ratio;
  width = std::min(width * slopes.other, 0.9 * depth_outside(bodies_[other]));
  // h(x) <= x, and so no point belongs to two bulges, iff a0 <= w / 3; no tongue, too, iff 3 a0 / w <= 1 / ratio. Together they stay below half of what
  // would fill the space around.
  const double size = bodies_[body_].field.feature_size();
  const double filling = 0.5 * depth_outside(bodies_[body_]);
  const double highest = std::min(std::isfinite(filling) ? filling : slopes.own * size, width / (3.0 * ratio));
  double guess = std::sqrt(stiffness) * volume_keeping_height(displaced, s.area, s.load, slopes.across, width);  // w = 6 a0 / k is longer by 1 / k
  if (!(guess > 0.0)) guess = s.largest_pressure;
  guess = std::min(guess, highest);
  // Along the surface of the body -p of the other rises by as much more than along Sigma as |grad(p_A - p_B)| / |grad p_A|.
  const double radius = std::sqrt(s.area / std::numbers::pi);
  const double slope_at_rim = 4.0 * s.load / (s.area * radius) * slopes.across / slopes.own;
  const double zone = std::clamp(effective_width(width, guess, stiffness) / slope_at_rim, radius / 32.0, std::max(size, radius / 32.0));
  wanted.push_back({.other = other, .volume = displaced, .stiffness = stiffness, .highest = highest, .width = width, .guess = guess, .zone = zone,
                    .centre = s.centre_of_pressure});
}

void DeformedPressure::keep_volumes(std::span<const WantedBulge> wanted) {
  if (wanted.empty()) return;
  for (const WantedBulge& w : wanted) rise_ += w.highest;
  together_ = 0.5 * depth_outside(bodies_[body_]);
  rise_ = std::min(rise_, together_);
  bool certain;
  box_ = bounding_box(bodies_[body_], rise_, certain);
  if (!is_finite(box_)) {
    for (const WantedBulge& w : wanted) box_ = box_.intersection(bounding_box(bodies_[w.other], w.width, certain));
  }
  find_limiting();
  const std::vector<FoundBulge> found = find_bulges({.bodies = bodies_, .body = body_, .limiting = limiting_, .most = rise_, .box = box_}, wanted);
  rise_ = 0.0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double height = found[k].height;
    const double stiffness = wanted[k].stiffness;
    neighbours_.push_back({wanted[k].other, {.stiffness = stiffness, .height = height, .width = effective_width(wanted[k].width, height, stiffness)}});
    volumes_.push_back({wanted[k].other, wanted[k].volume, found[k].held});
    rise_ += height;
  }
  rise_ = std::min(rise_, together_);
}

double DeformedPressure::literal_rise(const Neighbour& neighbour, const Box& box) const {
  // h = k x (1 - 2 u)^2 + a0 (12 u^2 - 16 u^3) up to u = x / w = 1/2; the first is 2 k w / 27 at most, the second a0, as is all beyond.
  const ContactBody& other = bodies_[neighbour.body];
  const double width = (1.0 + 1e-9) * neighbour.profile.width;
  const Box near = box.inflated(width);  // the ways of its points end there
  if (other.field.bound(near).upper < 0.0 || other.field.bound(box).lower >= 0.0) return 0.0;
  const double steepness = other.material.modulus * other.field.gradient_bound(near);
  return std::min(highest_, 2.0 / 27.0 * steepness * width + neighbour.profile.height);
}

void DeformedPressure::evaluate_at(std::span<const Vec3> points, std::span<double> values,
                                 std::span<Vec3> gradients) const {
  const bool with_gradients = !gradients.empty();
  const std::size_t n = points.size();
  pressures_of(bodies_[body_], points, values, gradients);
  if (neighbours_.empty() || n == 0) return;

  Box box;
  for (const Vec3& x : points) box.include(x);
  Borrowed scratch;
  scratch->value.resize(n);
  scratch->bulge.assign(n, 0.0);
  scratch->limit.assign(n, together_);
  scratch->slope.resize(with_gradients ? n : 0);
  if (with_gradients) {
    scratch->bulge_slope.assign(n, Vec3::Zero());
    scratch->limit_slope.assign(n, Vec3::Zero());
  }
  bool any = false;
  for (const Neighbour& neighbour : neighbours_) {
    const ContactBody& other = bodies_[neighbour.body];
    if (literal_) {
      if (!(literal_rise(neighbour, box) > 0.0)) continue;
      any = true;
      add_literal(other, neighbour.profile, highest_, points, with_gradients, *scratch);
      continue;
    }
    const Interval p = other.field.bound(box);
    if (other.material.modulus * p.upper <= -neighbour.profile.width || p.lower >= 0.0) continue;  // no bulge here
    any = true;
    pressures_of(other, points, scratch->value, scratch->slope);
    for (std::size_t i = 0; i < n; ++i) {
      const double x = -scratch->value[i];
      scratch->bulge[i] += neighbour.profile.value(x);
      if (with_gradients && x > 0.0) scratch->bulge_slope[i] -= neighbour.profile.slope(x) * scratch->slope[i];
    }
  }
  if (!any) return;
  for (const std::uint32_t j : limiting_) {
    const ContactBody& other = bodies_[j];
    if (other.material.modulus * other.field.bound(box).upper < -rise_) continue;  // limits nothing
    lower_limit(other, points, *scratch);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const bool limited = scratch->limit[i] < scratch->bulge[i];
    const double lift = limited ? std::max(scratch->limit[i], 0.0) : scratch->bulge[i];
    values[i] += lift;
    if (with_gradients && lift > 0.0) gradients[i] += limited ? scratch->limit_slope[i] : scratch->bulge_slope[i];
  }
}

void DeformedPressure::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  evaluate_at(points, values, {});
}

void DeformedPressure::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  evaluate_at(points, values, gradients);
}

void DeformedPressure::evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
  const ContactBody& own = bodies_[body_];
  own.field.evaluate_parts(points, parts);
  for (double& v : parts.value) v *= own.material.modulus;
  for (Vec3& g : parts.gradient) g *= own.material.modulus;
  for (Vec3& g : parts.by_turn) g *= own.material.modulus;
}

Interval DeformedPressure::bound(const Box& box) const {
  const ContactBody& own = bodies_[body_];
  Interval pressure = own.field.bound(box);
  pressure.lower *= own.material.modulus;
  pressure.upper *= own.material.modulus;
  for (const Neighbour& neighbour : neighbours_) {
    if (literal_) {
      pressure.upper += literal_rise(neighbour, box);
      continue;
    }
    const ContactBody& other = bodies_[neighbour.body];
    const Interval p = other.field.bound(box);
    if (p.lower >= 0.0 || other.material.modulus * p.upper <= -neighbour.profile.width) continue;
    // h <= min(a0, x)
    pressure.upper += std::min(neighbour.profile.height, -other.material.modulus * p.lower);
  }
  return pressure;
}

double DeformedPressure::gradient_bound(const Box& box) const {
  const auto steepness = [&](const ContactBody& body) { return body.material.modulus * body.field.gradient_bound(box); };
  double bulge = 0.0;  // |h'| <= 1
  for (const Neighbour& neighbour : neighbours_) {
    if (!literal_) {
      bulge += steepness(bodies_[neighbour.body]);
    } else if (literal_rise(neighbour, box) > 0.0) {
      // Around a convex body whose level sets lie at equal distances |h'| <= k + 3 a0 / w; elsewhere k changes with p0.
      const ContactBody& other = bodies_[neighbour.body];
      const double k = other.material.modulus * other.field.gradient_bound(box.inflated((1.0 + 1e-9) * neighbour.profile.width));
      bulge += other.field.core_point(box.centre()) ? k + 3.0 * neighbour.profile.height / neighbour.profile.width : kInfinity;
    }
  }
  for (const std::uint32_t j : limiting_) bulge = std::max(bulge, steepness(bodies_[j]));
  return steepness(bodies_[body_]) + bulge;
}

void DeformedPressure::add_content(const std::function<std::uint64_t(std::uint32_t)>& field, ContentWords& words) const {
  const auto add_body = [&](std::uint32_t body) {
    words.add(field(body));
    words.add(bodies_[body].material.modulus);
  };
  add_body(body_);
  words.add(neighbours_.size());
  for (const auto& [body, profile] : neighbours_) {
    add_body(body);
    for (const double x : {profile.stiffness, profile.height, profile.width}) words.add(x);
  }
  words.add(limiting_.size());
  for (const std::uint32_t body : limiting_) add_body(body);
  words.add(literal_);
  words.add(highest_);
  words.add(rise_);
  words.add(together_);
  words.add(box_.lower);
  words.add(box_.upper);
}

Box DeformedPressure::surface_box() const { return box_; }
double DeformedPressure::feature_size() const { return bodies_[body_].field.feature_size(); }

DeformedField::DeformedField(std::span<const ContactBody> bodies, std::uint32_t body, const ContactSurface& surface,
                             const BulgeSettings& settings)
    : own_(bodies, body, surface, settings), modulus_(bodies[body].material.modulus) {
  for (std::uint32_t j = 0; j < bodies.size(); ++j) {
    if (j == body) continue;
    DeformedPressure other(bodies, j, surface, settings);
    if (other.surface_box().overlaps(own_.surface_box())) others_.push_back(std::move(other));
  }
}

void DeformedField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  thread_local std::vector<double> largest, other;
  own_.evaluate(points, values);
  largest.assign(points.size(), 0.0);
  other.resize(points.size());
  for (const DeformedPressure& pressure : others_) {
    pressure.evaluate(points, other);
    for (std::size_t i = 0; i < points.size(); ++i) largest[i] = std::max(largest[i], other[i]);
  }
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = (values[i] - largest[i]) / modulus_;
}

void DeformedField::evaluate(std::span<const Vec3> points, std::span<double> values,
                             std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  thread_local std::vector<double> largest, other;
  thread_local std::vector<Vec3> largest_slope, slope;
  own_.evaluate(points, values, gradients);
  largest.assign(points.size(), 0.0);
  largest_slope.assign(points.size(), Vec3::Zero());
  other.resize(points.size());
  slope.resize(points.size());
  for (const DeformedPressure& pressure : others_) {
    pressure.evaluate(points, other, slope);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (other[i] <= largest[i]) continue;
      largest[i] = other[i];
      largest_slope[i] = slope[i];
    }
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    values[i] = (values[i] - largest[i]) / modulus_;
    gradients[i] = (gradients[i] - largest_slope[i]) / modulus_;
  }
}

void DeformedField::evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
  own_.evaluate_parts(points, parts);
  for (double& v : parts.value) v /= modulus_;
  for (Vec3& g : parts.gradient) g /= modulus_;
  for (Vec3& g : parts.by_turn) g /= modulus_;
}

Interval DeformedField::bound(const Box& box) const {
  Interval sum = own_.bound(box);
  Interval taken{0.0, 0.0};
  for (const DeformedPressure& pressure : others_) {
    const Interval other = pressure.bound(box);
    taken.lower = std::max(taken.lower, other.lower);
    taken.upper = std::max(taken.upper, other.upper);
  }
  return {(sum.lower - taken.upper) / modulus_, (sum.upper - taken.lower) / modulus_};
}

double DeformedField::gradient_bound(const Box& box) const {
  double other = 0.0;
  for (const DeformedPressure& pressure : others_) other = std::max(other, pressure.gradient_bound(box));
  return (own_.gradient_bound(box) + other) / modulus_;
}

Box DeformedField::surface_box() const { return own_.surface_box(); }
double DeformedField::feature_size() const { return own_.feature_size(); }

void DeformedDepth::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  std::vector<Vec3> gradients(points.size());
  evaluate(points, values, gradients);
}

void DeformedDepth::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  const std::size_t n = points.size();
  std::vector<double> own(n), other(n);
  std::vector<Vec3> slope(n), other_slope(n);
  own_.evaluate(points, own, slope);
  std::fill(values.begin(), values.end(), kInfinity);
  std::fill(gradients.begin(), gradients.end(), Vec3::Zero());
  const auto take = [&](std::size_t i, double value, const Vec3& gradient) {
    const double steepness = gradient.norm();
    const double depth = value != 0.0 ? value / steepness : 0.0;
    if (!(depth < values[i])) return;
    values[i] = depth;
    if (steepness > 0.0) gradients[i] = gradient / steepness;
  };
  for (std::size_t i = 0; i < n; ++i) take(i, own[i], slope[i]);
  for (const DeformedPressure& pressure : others_) {
    pressure.evaluate(points, other, other_slope);
    for (std::size_t i = 0; i < n; ++i) take(i, own[i] - other[i], slope[i] - other_slope[i]);
  }
}

Interval DeformedDepth::bound(const Box& box) const {
  const Interval own = own_.bound(box);
  const double own_slope = own_.gradient_bound(box);
  Interval depth{kInfinity, kInfinity};
  const auto take = [&depth](const Interval& value, double steepest) {
    depth.lower = std::min(depth.lower, value.lower > 0.0 ? value.lower / steepest : -kInfinity);
    if (value.upper < 0.0) depth.upper = std::min(depth.upper, value.upper / steepest);
  };
  take(own, own_slope);
  for (const DeformedPressure& pressure : others_) {
    const Interval other = pressure.bound(box);
    take({own.lower - other.upper, own.upper - other.lower}, own_slope + pressure.gradient_bound(box));
  }
  return depth;
}

}  // namespace supple::collision
