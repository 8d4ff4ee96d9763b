#include "polygonise_junctions.h"

#include <algorithm>
#include <cmath>

#include "polygonise_block_edges.h"
#include "polygonise_roots.h"

namespace supple::implicit::lattice {
namespace {

constexpr int kMaxIterations = 12;

/// Differences that vanish at the junction, with gradients; at most three.
struct Conditions {
  std::array<double, 3> value{};
  std::array<Vec3, 3> gradient{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  std::size_t count = 0;
};

Conditions conditions_at(std::span<const FieldView> fields, const LabelSet& labels, const Vec3& point) {
  Conditions c;
  const bool outside = labels.label[0] == 0;
  double first = 0.0;
  Vec3 first_gradient = Vec3::Zero();
  if (!outside) first = fields[labels.label[0] - 1].value(point, first_gradient);
  for (std::size_t k = 1; k < labels.count; ++k) {
    Vec3 gradient;
    const double value = fields[labels.label[k] - 1].value(point, gradient);
    c.value[c.count] = value - first;
    c.gradient[c.count] = gradient - first_gradient;
    ++c.count;
  }
  return c;
}

double largest(const Conditions& c) {
  double value = 0.0;
  for (std::size_t k = 0; k < c.count; ++k) value = std::max(value, std::abs(c.value[k]));
  return value;
}

bool vanishes(const Conditions& c, const Vec3& point, double scale) {
  for (std::size_t k = 0; k < c.count; ++k) {
    if (!(std::abs(c.value[k]) <= root_tolerance(scale, point, c.gradient[k]))) return false;
  }
  return true;
}

/// Coordinates of a simplex along its chain of corners, whose steps have no axis in common and so are orthogonal:
/// p = origin + sum of s_k step_k, and p is inside when 1 >= s_1 >= s_2 (>= s_3) >= 0.
struct Chain {
  Vec3 origin = Vec3::Zero();   ///< first corner [m]
  std::array<Vec3, 3> step{};   ///< corner k + 1 minus corner k [m]
  int steps = 0;

  explicit Chain(const Simplex& s) : steps(s.size - 1) {
    origin = corner(s, 0);
    for (int k = 0; k < steps; ++k) {
      const auto slot = static_cast<std::size_t>(k);
      step[slot] = corner(s, slot + 1) - corner(s, slot);
    }
  }
  static Vec3 corner(const Simplex& s, std::size_t k) {
    Vec3 p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = (s.corner[k] >> axis & 1u) != 0 ? s.high[axis] : s.low[axis];
    return p;
  }
  [[nodiscard]] Vec3 point(const Vec3& s) const {
    Vec3 p = origin;
    for (int k = 0; k < steps; ++k) p += s[k] * step[static_cast<std::size_t>(k)];
    return p;
  }
  /// Coordinates of a direction.
  [[nodiscard]] Vec3 along(const Vec3& direction) const {
    Vec3 s = Vec3::Zero();
    for (int k = 0; k < steps; ++k) {
      const Vec3& d = step[static_cast<std::size_t>(k)];
      s[k] = direction.dot(d) / d.squaredNorm();
    }
    return s;
  }
  /// Is every difference of 1, s_1, s_2, ..., 0 at least `margin`? False when not finite.
  [[nodiscard]] bool contains(const Vec3& s, double margin) const {
    double above = 1.0;
    for (int k = 0; k < steps; ++k) {
      if (!(above - s[k] >= margin)) return false;
      above = s[k];
    }
    return above >= margin;
  }
  /// The last point with a margin of a hundredth on the way from a point inside to one that is not.
  [[nodiscard]] Vec3 last_inside(const Vec3& inside, const Vec3& beyond) const {
    double share = 1.0;
    const auto limit = [&](double here, double there) {  // a difference that must stay above the margin
      constexpr double kMargin = 0.01;
      if (there < kMargin) share = std::min(share, std::max(0.0, (here - kMargin) / (here - there)));
    };
    double above = 1.0, above_beyond = 1.0;
    for (int k = 0; k < steps; ++k) {
      limit(above - inside[k], above_beyond - beyond[k]);
      above = inside[k];
      above_beyond = beyond[k];
    }
    limit(above, above_beyond);
    return inside + share * (beyond - inside);
  }
  /// Component of a vector in the plane of a face.
  [[nodiscard]] Vec3 in_plane(const Vec3& v) const {
    if (steps == 3) return v;
    Vec3 sum = Vec3::Zero();
    const Vec3 s = along(v);
    for (int k = 0; k < steps; ++k) sum += s[k] * step[static_cast<std::size_t>(k)];
    return sum;
  }
};

/// The smallest Newton step for two or three conditions; not finite when they do not determine one.
Vec3 newton_step(const Conditions& c) {
  const Vec3 &g1 = c.gradient[0], &g2 = c.gradient[1];
  const Vec3 n = g1.cross(g2);  // two conditions: no step along their common line
  const Vec3 g3 = c.count == 3 ? c.gradient[2] : n;
  const double h3 = c.count == 3 ? c.value[2] : 0.0;
  return -(c.value[0] * g2.cross(g3) + c.value[1] * g3.cross(g1) + h3 * n) / n.dot(g3);
}

}  // namespace

Junction find_junction(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels,
                       const Vec3& start, double scale) {
  const Chain chain(simplex);
  Vec3 s = chain.along(start - chain.origin);
  Vec3 from = start;  // where to look for F_a = F_b
  for (int i = 0; i < kMaxIterations; ++i) {
    const Vec3 p = chain.point(s);
    Conditions c = conditions_at(fields, labels, p);
    if (vanishes(c, p, scale)) {
      if (chain.contains(s, 0.0)) return {.point = p, .residual = largest(c), .exact = true};
      from = chain.point(chain.last_inside(chain.along(start - chain.origin), s));
      break;
    }
    for (Vec3& gradient : c.gradient) gradient = chain.in_plane(gradient);
    s += chain.along(newton_step(c));
    if (!chain.contains(s, -1.0)) break;
  }

  // The two lowest bodies change sides between `from` and the node of whichever is the smaller there.
  const std::size_t lowest = labels.label[0] == 0 ? 1 : 0;
  const Label a = labels.label[lowest], b = labels.label[lowest + 1];
  const FieldView &field_a = fields[a - 1], &field_b = fields[b - 1];
  const double at_start = field_a.value(from) - field_b.value(from);
  const Label other = at_start > 0.0 ? b : a;
  const std::size_t corner =
      static_cast<std::size_t>(std::find(simplex.label.begin(), simplex.label.end(), other) - simplex.label.begin());
  const Vec3 node = Chain::corner(simplex, corner);
  double low = 0.0, high = 1.0, f_low = at_start;
  Junction result{.point = from, .residual = std::abs(at_start), .exact = false};
  double t = 0.5;
  for (int i = 0; i < 200 && result.residual > 0.0 && high - low > std::numeric_limits<double>::epsilon(); ++i) {
    Vec3 ga, gb;
    const Vec3 p = from + t * (node - from);
    const double f = field_a.value(p, ga) - field_b.value(p, gb);
    result.point = p;
    result.residual = std::abs(f);
    if (std::abs(f) <= root_tolerance(scale, p, ga - gb)) break;
    if ((f > 0.0) == (f_low > 0.0)) {
      low = t;
      f_low = f;
    } else {
      high = t;
    }
    const double next = t - f / (ga - gb).dot(node - from);
    // Newton where it stays well inside the bracket, else halve it.
    const double width = high - low;
    t = next > low + 0.01 * width && next < high - 0.01 * width ? next : 0.5 * (low + high);
  }
  return result;
}

Vec3 normal_at(std::span<const FieldView> fields, const LabelSet& labels, std::uint32_t body, const Vec3& point) {
  Vec3 own;
  (void)fields[body].value(point, own);
  Vec3 direction = own;
  if (labels.label[0] != 0) {
    direction.setZero();
    for (const Label l : labels.view()) {
      Vec3 gradient;
      (void)fields[l - 1].value(point, gradient);
      direction += own - gradient;
    }
  }
  return outward(direction, Vec3::UnitZ());
}

}  // namespace supple::implicit::lattice
