#include "mesh/partition/polygonise_junctions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "mesh/partition/polygonise_block_edges.h"
#include "mesh/partition/polygonise_roots.h"

namespace supple::implicit::lattice {

Vec3 corner_of(const Simplex& simplex, std::size_t k) {
  Vec3 p;
  for (int axis = 0; axis < 3; ++axis) p[axis] = (simplex.corner[k] >> axis & 1u) != 0 ? simplex.high[axis] : simplex.low[axis];
  return p;
}

std::optional<Simplex> face_of(const Simplex& tetrahedron, std::size_t opposite) {
  Simplex face = tetrahedron;
  face.size = 0;
  LabelSet labels;
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == opposite) continue;
    face.label[face.size] = tetrahedron.label[k];
    face.corner[face.size++] = tetrahedron.corner[k];
    labels.insert(tetrahedron.label[k]);
  }
  return labels.count == 3 ? std::optional(face) : std::nullopt;
}

namespace {

constexpr int kMaxIterations = 12;
/// Of a step along a simplex: what lies beyond it by less is on its border, as where bodies meet in a plane of the lattice.
constexpr double kOnBorder = 1e-9;

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
    origin = corner_of(s, 0);
    for (int k = 0; k < steps; ++k) {
      const auto slot = static_cast<std::size_t>(k);
      step[slot] = corner_of(s, slot + 1) - corner_of(s, slot);
    }
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
  /// The nearest coordinates inside, of some that lie beyond by rounding.
  [[nodiscard]] Vec3 clipped(Vec3 s) const {
    double above = 1.0;
    for (int k = 0; k < steps; ++k) above = s[k] = std::clamp(s[k], 0.0, above);
    return s;
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

/// Newton's method from `start`. @param beyond  the point that was found beyond the simplex, if one was
Junction newton_inside(std::span<const FieldView> fields, const Chain& chain, const LabelSet& labels, const Vec3& start,
                       double scale, std::optional<Vec3>* beyond) {
  Vec3 s = chain.along(start - chain.origin);
  for (int i = 0; i < kMaxIterations; ++i) {
    const Vec3 p = chain.point(s);
    Conditions c = conditions_at(fields, labels, p);
    if (vanishes(c, p, scale)) {
      if (chain.contains(s, 0.0)) return {.point = p, .residual = largest(c), .exact = true};
      if (chain.contains(s, -kOnBorder)) {
        const Vec3 on_border = chain.point(chain.clipped(s));
        return {.point = on_border, .residual = largest(conditions_at(fields, labels, on_border)), .exact = true};
      }
      if (beyond != nullptr) *beyond = s;
      break;
    }
    for (Vec3& gradient : c.gradient) gradient = chain.in_plane(gradient);
    s += chain.along(newton_step(c));
    if (!chain.contains(s, -1.0)) break;
  }
  return {.point = start, .residual = 0.0, .exact = false};
}

}  // namespace

Junction meet_inside(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels, const Vec3& start,
                     double scale) {
  return newton_inside(fields, Chain(simplex), labels, start, scale, nullptr);
}

Junction search_inside(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels, double scale) {
  std::array<Vec3, 4> corner;
  Vec3 middle = Vec3::Zero();
  for (std::size_t v = 0; v < simplex.size; ++v) {
    corner[v] = corner_of(simplex, v);
    middle += corner[v] / simplex.size;
  }
  const auto from = [&](const Vec3& start) { return meet_inside(fields, simplex, labels, start, scale); };
  const double size = (simplex.high - simplex.low).norm();
  std::optional<Vec3> entered;
  for (std::size_t v = 0; v < 4 && simplex.size == 4; ++v) {
    const std::optional<Simplex> face = face_of(simplex, v);
    if (!face) continue;
    Junction on_face = meet_inside(fields, *face, labels, (4.0 * middle - corner[v]) / 3.0, scale);
    if (!on_face.exact) on_face = search_inside(fields, *face, labels, scale);
    if (!on_face.exact) continue;
    if (entered) {
      if (const Junction found = from(0.5 * (*entered + on_face.point)); found.exact) return found;
    }
    entered = on_face.point;
    const Conditions c = conditions_at(fields, labels, on_face.point);
    Vec3 along = c.gradient[0].cross(c.gradient[1]).normalized();
    const Vec3 &a = corner[(v + 1) % 4], across = (corner[(v + 2) % 4] - a).cross(corner[(v + 3) % 4] - a);
    if ((along.dot(across) > 0.0) != ((corner[v] - a).dot(across) > 0.0)) along = -along;  // into the tetrahedron
    for (const double share : {0.2, 0.05, 0.01}) {
      if (const Junction found = from(on_face.point + share * size * along); found.exact) return found;
    }
  }
  for (std::size_t v = 0; v < simplex.size; ++v) {
    for (const double share : {0.5, 0.1}) {
      if (const Junction found = from(corner[v] + share * (middle - corner[v])); found.exact) return found;
    }
  }
  return {};
}

Junction root_between(std::span<const FieldView> fields, Label a, Label b, const Vec3& from, const Vec3& to, double scale) {
  const auto difference = [&](const Vec3& p, Vec3& gradient) {
    Vec3 ga = Vec3::Zero(), gb = Vec3::Zero();
    const double f = (a == 0 ? 0.0 : fields[a - 1].value(p, ga)) - (b == 0 ? 0.0 : fields[b - 1].value(p, gb));
    gradient = ga - gb;
    return f;
  };
  Vec3 gradient;
  double low = 0.0, high = 1.0, t = 0.5, last_step = 1.0;
  const double f_low = difference(from, gradient);
  Junction result{.point = from, .residual = std::abs(f_low), .exact = false};
  for (int i = 0; i < 200 && result.residual > 0.0 && high - low > std::numeric_limits<double>::epsilon(); ++i) {
    const Vec3 p = from + t * (to - from);
    const double f = difference(p, gradient);
    result.point = p;
    result.residual = std::abs(f);
    if (std::abs(f) <= root_tolerance(scale, p, gradient)) break;
    ((f > 0.0) == (f_low > 0.0) ? low : high) = t;
    // Newton inside the bracket while its steps halve, else halve it.
    double next = t - f / gradient.dot(to - from);
    if (!(next > low && next < high) || std::abs(next - t) > 0.5 * last_step) next = 0.5 * (low + high);
    last_step = std::abs(next - t);
    t = next;
  }
  return result;
}

Junction find_junction(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels,
                       const Vec3& start, double scale) {
  const Chain chain(simplex);
  std::optional<Vec3> beyond;
  const Junction met = newton_inside(fields, chain, labels, start, scale, &beyond);
  if (met.exact) return met;
  const Vec3 from = beyond ? chain.point(chain.last_inside(chain.along(start - chain.origin), *beyond)) : start;
  // The two lowest bodies change sides between `from` and the node of whichever is the smaller there.
  const std::size_t lowest = labels.label[0] == 0 ? 1 : 0;
  const Label a = labels.label[lowest], b = labels.label[lowest + 1];
  const Label other = fields[a - 1].value(from) - fields[b - 1].value(from) > 0.0 ? b : a;
  const std::size_t corner =
      static_cast<std::size_t>(std::find(simplex.label.begin(), simplex.label.end(), other) - simplex.label.begin());
  return root_between(fields, a, b, from, corner_of(simplex, corner), scale);
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
