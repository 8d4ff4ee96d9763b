// Bounds of second order on boxes: value and gradient at the centre, and bounds of the second derivatives anywhere.
#include <algorithm>
#include <cmath>
#include <limits>

#include "bounds/field_box_bounds.h"
#include "bounds/shape_curvature.h"
#include "bounds/shortest_in_hull.h"
#include "field/field_index.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kCancels = 1e4;  // of convolutions, which sum over edges: their round-off against that of others

/// Taylor's expansion of a sum of potentials about the centre of a box.
struct Expansion {
  std::uint32_t node = 0;         ///< of the blend
  double value = 0.0;             ///< of the terms that are expanded
  Vec3 gradient = Vec3::Zero();
  CurvatureRange curvature{};     ///< of its second derivatives on the box
  Interval rest{0.0, 0.0};        ///< of the others
  Interval plain{0.0, 0.0};       ///< of all, from distances alone
  bool sloped = true;             ///< nothing is left for the rest
  double scale = 0.0;             ///< of round-off [1]
  double slope_scale = 0.0;       ///< and of that of the gradient [1/m]
  double terms = 0.0;

  /// How far the gradient turns between the centre and a corner, at most.
  [[nodiscard]] double turn(double reach) const { return std::max(-curvature.lower, curvature.upper) * reach; }
  /// The same of the gradient as it is evaluated: 0 where it vanishes everywhere, as within solids.
  [[nodiscard]] double evaluated_turn(double reach) const {
    const double most = turn(reach);
    return most == 0.0 && gradient == Vec3::Zero() ? 0.0 : most + (64.0 + 2.0 * terms) * kEps * slope_scale;
  }
  [[nodiscard]] double round_off() const { return (64.0 + 2.0 * terms) * kEps * scale; }
  [[nodiscard]] Interval range(const Vec3& half) const {
    const double first = gradient.cwiseAbs().dot(half), reach2 = half.squaredNorm();
    return {value + rest.lower - first + 0.5 * curvature.lower * reach2 - round_off(),
            value + rest.upper + first + 0.5 * curvature.upper * reach2 + round_off()};
  }
};

Interval added(const Interval& a, const Interval& b) { return {a.lower + b.lower, a.upper + b.upper}; }

/// In the frame of the shape.
Vec3 local_middle(const PackedPrimitive& p, const Mat3& to_local, const Box& box) {
  return to_local * (box.centre() - Vec3(p.position[0], p.position[1], p.position[2]));
}
/// |A|^2: its rows are orthogonal.
double metric2_of(const Mat3& to_local) { return to_local.rowwise().squaredNorm().maxCoeff() * (1.0 + 4.0 * kEps); }

/// Bounds of 2 df/dq for q in [near2, far2]. It is negative and rises with q, but for two kernels: Blanc & Schlick's, which is flat at 0; and
/// that of Gascuel may be steepest farther out, where df/dd is largest at one end of any range: it is a parabola that opens upwards or rises.
Interval slope_range(const Kernel& kernel, double near2, double far2) {
  const double near = std::sqrt(near2), far = std::sqrt(far2);
  const double near_slope = 2.0 * evaluate(kernel, near2).slope, far_slope = 2.0 * evaluate(kernel, far2).slope;
  if (kernel.kind != KernelKind::BlancSchlick && kernel.kind != KernelKind::Gascuel) return {near_slope, far_slope};
  const double steepest = near > 0.0 ? -lipschitz(kernel, near, far) / near * (1.0 + 1e-12) : -kInfinity;
  if (kernel.kind == KernelKind::BlancSchlick) return {steepest, 0.0};
  return {steepest, std::max(near_slope * near / far, far_slope) * (1.0 - 1e-12)};
}

/// Values by distances. @return whether the primitive adds anything on the box
bool start_term(const Field::Index& index, std::uint32_t id, const Box& box, GradientBounds::Term& term) {
  const PackedShape& shape = index.shape[id];
  term = {.id = id};
  if (shape.foot == PackedFoot::Convolved) {
    term.value = bound_primitive(index, id, box, false).value;
    return true;
  }
  const DistanceRange range = distance_range(index, id, box);
  if (range.near2 > shape.kernel.radius * shape.kernel.radius * (1.0 + 1e-12)) return false;
  term.near2 = range.near2;
  term.far2 = range.far2;
  term.value = {evaluate(shape.kernel, range.far2).value, evaluate(shape.kernel, range.near2).value};
  return true;
}

/// Value and gradient at the middle, and where gradients lie by nearest points: the vectors from them change no faster than the place for convex
/// shapes, each component of those to boxes depends on its coordinate alone and rises no faster, and so does that across a disc.
void add_slope(const Field::Index& index, const Box& box, GradientBounds::Term& term) {
  const PackedShape& shape = index.shape[term.id];
  term.to_local = to_local_of(index.primitive[term.id], shape);
  term.turn = kInfinity;
  term.spread = kInfinity;
  const Vec3 y = local_middle(index.primitive[term.id], term.to_local, box);
  if (shape.foot == PackedFoot::Convolved) {
    const Potential centre = convolve(shape.view, shape.kernel, y);
    term.at_middle = centre.value;
    term.gradient = term.to_local.transpose() * centre.gradient;
    return;
  }
  const FootSample sample = foot(shape.view, y);
  const KernelSample kernel = evaluate(shape.kernel, sample.q);
  term.at_middle = kernel.value;
  term.gradient = term.to_local.transpose() * Vec3(2.0 * kernel.slope * sample.half_gradient);
  const bool scalar = shape.foot == PackedFoot::Scalar, curve = shape.view.kind == ShapeKind::Curve;
  if (scalar && !curve && shape.view.kind != ShapeKind::Triangle && shape.view.kind != ShapeKind::Polygon) return;
  term.factor = slope_range(shape.kernel, term.near2, term.far2);
  if (!std::isfinite(term.factor.lower)) return;
  const Vec3 half = 0.5 * box.extent() + rounding_of(box);
  const Vec3 step = (1.0 + 1e-12) * (term.to_local.cwiseAbs() * half);
  term.low = term.high = sample.half_gradient;
  term.spread = std::sqrt(metric2_of(term.to_local)) * half.norm() * (1.0 + 1e-12);
  if (curve) {
    // With the width w of its nearest point, grad d^2 = 2 gap / w^2.
    const NearestCurvePoints nearest = nearest_curve_points(shape.view, {.centre = y, .reach = term.spread, .far = 0.0});
    for (std::size_t k = 0; k < nearest.count; ++k) term.gap[k] = y - nearest.hull[k];
    term.gaps = nearest.count;
    term.spread += 1e-12 * (y.norm() + shape.kernel.radius);  // polynomials cancel
    const double least = nearest.least_width * (1.0 - 1e-12), largest = nearest.largest_width * (1.0 + 1e-12);
    term.factor = {term.factor.lower / (least * least), term.factor.upper / (largest * largest)};
  } else if (shape.foot == PackedFoot::Slab) {
    for (int k = 0; k < 3; ++k) {
      const double h = shape.half[static_cast<std::size_t>(k)], low = y[k] - step[k], high = y[k] + step[k];
      term.low[k] = low - std::clamp(low, -h, h);
      term.high[k] = high - std::clamp(high, -h, h);
    }
    term.spread = 0.0;
  } else if (shape.foot == PackedFoot::Disc) {
    term.low.z() -= step.z();
    term.high.z() += step.z();
    term.across = 0.0;
  }
}

/// Of second derivatives on the box.
CurvatureRange curvature_of(const Field::Index& index, const Box& box, const GradientBounds::Term& term) {
  const PackedShape& shape = index.shape[term.id];
  if (shape.foot == PackedFoot::Slab && term.far2 == 0.0) return {0.0, 0.0};  // within the solid
  const double reach = 0.5 * box.extent().norm(), metric2 = metric2_of(term.to_local);
  const Vec3 y = local_middle(index.primitive[term.id], term.to_local, box);
  CurvatureRange curvature;
  if (shape.foot == PackedFoot::Convolved) {
    // The peak is the measure of the shape times that of the kernel, which is 1.
    const double near = std::max(std::sqrt(foot(shape.view, y).q) - shape.distance_scale * reach, 0.0);
    curvature = curvature_range(shape.kernel, near, shape.kernel.radius);
    curvature = {shape.peak * curvature.lower, shape.peak * curvature.upper};
  } else {
    const bool clipped = !(index.support[term.id].contains(box.lower) && index.support[term.id].contains(box.upper));
    const double far = clipped ? shape.kernel.radius : std::min(std::sqrt(term.far2), shape.kernel.radius);
    const ShapeBall ball{.centre = y, .reach = std::sqrt(metric2) * reach, .far = far};
    curvature = shape_curvature(shape.view, ball, curvature_range(shape.kernel, std::sqrt(term.near2), far));
  }
  return {metric2 * curvature.lower, metric2 * curvature.upper};
}

/// Of round-off, of a primitive's value on the box.
double scale_of(const PackedShape& shape, double reach) {
  return shape.peak + shape.lipschitz * reach + (shape.foot == PackedFoot::Convolved ? kCancels * shape.peak : 0.0);
}

/// With all known bounds of a primitive. @return these, or less where it cannot be expanded
void add_expanded(const Field::Index& index, const Box& box, GradientBounds::Term& term, Expansion& sum) {
  sum.plain = added(sum.plain, term.value);
  const CurvatureRange curvature = curvature_of(index, box, term);
  if (!std::isfinite(curvature.lower) || !std::isfinite(curvature.upper)) {
    sum.rest = added(sum.rest, term.value);
    sum.sloped = false;
    return;
  }
  sum.value += term.at_middle;
  sum.gradient += term.gradient;
  sum.curvature = {sum.curvature.lower + curvature.lower, sum.curvature.upper + curvature.upper};
  term.turn = std::max(-curvature.lower, curvature.upper) * 0.5 * box.extent().norm();
}

Interval intersection(const Interval& a, const Interval& b) { return {std::max(a.lower, b.lower), std::min(a.upper, b.upper)}; }

/// Expansions of the nodes of a blend that a box touches, in rising order.
void expand_nodes(const Field::Index& index, const Box& box, std::vector<Expansion>& nodes) {
  nodes.clear();
  for (const std::uint32_t id : candidates_of(index, box)) {
    if (!index.support[id].overlaps(box)) continue;
    const std::uint32_t node = index.blend.node_of(index.primitive[id].part);
    auto place = std::lower_bound(nodes.begin(), nodes.end(), node, [](const Expansion& a, std::uint32_t b) { return a.node < b; });
    if (place == nodes.end() || place->node != node) place = nodes.insert(place, Expansion{.node = node});
    GradientBounds::Term term;
    if (!start_term(index, id, box, term)) continue;
    add_slope(index, box, term);
    place->scale += scale_of(index.shape[id], 0.5 * box.extent().norm());
    place->slope_scale += index.shape[id].lipschitz * (index.shape[id].foot == PackedFoot::Convolved ? kCancels : 1.0);
    place->terms += 1.0;
    add_expanded(index, box, term, *place);
  }
}

/// Length of the shortest vector of the hull of balls, at least; 0 where it is not known to be longer.
double least_of_hull(std::span<const GradientBounds::Ball> hull) {
  std::vector<Vec3> centres;
  for (const GradientBounds::Ball& ball : hull) centres.push_back(ball.gradient);
  if (centres.empty()) return 0.0;
  const Vec3 along = shortest_in_hull(centres);
  const double length = along.norm();
  if (!(length > 0.0)) return 0.0;
  double least = kInfinity;
  for (const GradientBounds::Ball& ball : hull) least = std::min(least, ball.gradient.dot(along) / length * (1.0 - 1e-12) - ball.turn);
  return std::max(least, 0.0);
}

/// The nodes of a blend near a box, with bounds and the terms that their blend may have.
struct BoxNodes {
  std::span<const Expansion> nodes;
  std::span<const BlendIndex::NodeBound> bounds;
  std::span<const BlendIndex::Term> terms;
};

/// Balls of gradients that F may have in a box, from those of the nodes [1/m]. @param half  the box's extent, halved
void find_hull(const BlendIndex& blend, const BoxNodes& of, const Vec3& half, std::vector<GradientBounds::Ball>& hull) {
  // Names for the lambdas below, where clang 14 takes no structured bindings.
  const std::span<const Expansion> nodes = of.nodes;
  const std::span<const BlendIndex::NodeBound> bounds = of.bounds;
  const std::span<const BlendIndex::Term> terms = of.terms;
  const double reach = half.norm(), largest = half.maxCoeff();
  using Ball = GradientBounds::Ball;
  const auto ball = [&](std::size_t k) { return Ball{nodes[k].gradient, nodes[k].turn(reach) + nodes[k].round_off() / largest}; };
  hull.clear();
  if (blend.rule() == BlendRule::Ricci) {
    const Interval all = blend.bound(bounds);
    Ball sum;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const Interval share = blend.share(bounds[k], all);
      const Ball one = ball(k);
      sum.gradient += 0.5 * (share.lower + share.upper) * one.gradient;
      sum.turn += share.upper * one.turn + 0.5 * (share.upper - share.lower) * one.gradient.norm();
    }
    hull.push_back(sum);
    return;
  }
  constexpr std::size_t kMost = 8;  // sums with one winner; what may be either then counts as all in between
  std::size_t first = 0;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    const BlendIndex::Term& term = terms[t];
    if (t == 0 || terms[t - 1].winner != term.winner) {
      first = hull.size();
      hull.push_back({});
    }
    Ball one = ball(term.node), other = one;
    if (term.or_winner) other = ball(term.winner);
    const std::size_t count = hull.size() - first;
    if (term.or_winner && 2 * count > kMost) {
      one = {0.5 * (one.gradient + other.gradient), std::max(one.turn, other.turn) + 0.5 * (one.gradient - other.gradient).norm()};
    } else if (term.or_winner) {
      for (std::size_t k = 0; k < count; ++k) {
        const Ball& without = hull[first + k];
        hull.push_back({without.gradient + term.weight * other.gradient, without.turn + term.weight * other.turn});
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      hull[first + k].gradient += term.weight * one.gradient;
      hull[first + k].turn += term.weight * one.turn;
    }
  }
}

GradientBounds blended_box_bounds(const Field::Index& index, const Box& box, const Interval& plain) {
  thread_local std::vector<Expansion> nodes;
  thread_local std::vector<BlendIndex::NodeBound> bounds;
  thread_local std::vector<BlendIndex::Term> terms;
  expand_nodes(index, box, nodes);
  if (nodes.empty()) return {{.value = plain, .second_order = true}, {}, {GradientBounds::Ball{}}};
  const Vec3 half = 0.5 * box.extent();
  bounds.clear();
  double scale = index.iso, slopes = 0.0;
  bool sloped = true;
  for (const Expansion& k : nodes) {
    bounds.push_back({.node = k.node, .value = intersection(k.plain, k.range(half))});
    if (k.sloped && !half.isZero()) {
      bounds.back().gradient = k.gradient;
      bounds.back().turn = k.evaluated_turn(half.norm());
    }
    scale += k.scale;
    slopes += k.gradient.norm();
    sloped = sloped && k.sloped;
  }
  const Interval sum = index.blend.bound(bounds);
  const double n = static_cast<double>(nodes.size()), round_off = (32.0 + 4.0 * n * n) * kEps;
  GradientBounds out{{.value = intersection(plain, {sum.lower - index.iso - round_off * scale, sum.upper - index.iso + round_off * scale}),
                      .second_order = true}, {}, {}};
  if (index.blend.rule() != BlendRule::Ricci && !index.blend.find_terms(bounds, terms)) return {{.value = out.value}, {}, {}};
  if (!sloped || half.isZero()) return out;
  find_hull(index.blend, {nodes, bounds, terms}, half, out.hull);
  for (GradientBounds::Ball& ball : out.hull) ball.turn += round_off * slopes;
  out.round_off = round_off * scale;
  out.least_slope = least_of_hull(out.hull);
  return out;
}

}  // namespace

Interval Field::tight_bound(const Box& box) const { return box_bounds(box).value; }

Field::BoxBounds Field::box_bounds(const Box& box) const {
  BoxBounds bounds = bounds_with_gradient(*this, box);
  bounds.value = intersection(bounds.value, bound(box));  // never wider, by no rounding either
  return bounds;
}

GradientBounds bounds_with_gradient(const Field& field, const Box& box) {
  GradientBounds bounds;
  std::vector<std::uint32_t> ids;
  if (is_sum(field) && !box.empty() && box.lower.allFinite() && box.upper.allFinite()) find_primitives(field, box, ids);
  start_bounds(field, box, ids, bounds);
  add_slopes(field, box, bounds);
  add_curvature(field, box, bounds);
  return bounds;
}

bool is_sum(const Field& field) { return !field.index().blend.active(); }

void find_primitives(const Field& field, const Box& box, std::vector<std::uint32_t>& ids) {
  for (const std::uint32_t id : candidates_of(field.index(), box)) {
    if (field.index().support[id].overlaps(box)) ids.push_back(id);
  }
}

void start_bounds(const Field& field, const Box& box, std::span<const std::uint32_t> ids, GradientBounds& bounds) {
  const Field::Index& index = field.index();
  std::vector<GradientBounds::Term> terms = std::move(bounds.term);
  std::vector<GradientBounds::Ball> hull = std::move(bounds.hull);
  terms.clear();
  hull.clear();
  bounds = {};
  if (box.empty() || !box.lower.allFinite() || !box.upper.allFinite()) {
    bounds.value = field.bound(box);
    return;
  }
  if (index.blend.active()) {
    bounds = blended_box_bounds(index, box, field.bound(box));
    return;
  }
  const double reach = 0.5 * box.extent().norm();
  bounds.scale = index.iso;
  Interval plain{0.0, 0.0};
  for (const std::uint32_t id : ids) {
    terms.emplace_back();
    if (!index.support[id].overlaps(box) || !start_term(index, id, box, terms.back())) {
      terms.pop_back();
      continue;
    }
    plain = added(plain, terms.back().value);
    bounds.scale += scale_of(index.shape[id], reach);
  }
  bounds.second_order = true;
  bounds.term = std::move(terms);
  bounds.hull = std::move(hull);
  if (bounds.term.empty()) {
    bounds.value = {-index.iso, -index.iso};
    bounds.hull.push_back({});
    return;
  }
  // As Field::bound has them.
  const double n = static_cast<double>(bounds.term.size()), round_off = (16.0 + n) * kEps * bounds.scale;
  bounds.value = {std::max(plain.lower - index.iso - round_off, -index.iso), plain.upper - index.iso + round_off};
  const double largest = 0.5 * box.extent().maxCoeff();
  bounds.stepwise = largest > 0.0;
  bounds.slack = Expansion{.scale = bounds.scale, .terms = n}.round_off() / largest;
  const bool convex = std::all_of(bounds.term.begin(), bounds.term.end(), [&](const GradientBounds::Term& term) {
    return index.shape[term.id].foot == PackedFoot::Slab || index.shape[term.id].foot == PackedFoot::Disc;
  });
  if (convex) bounds.convex = bounds.term.size();
}

void add_slopes(const Field& field, const Box& box, GradientBounds& bounds) {
  if (!bounds.stepwise) return;
  Vec3 gradient = Vec3::Zero();
  for (GradientBounds::Term& term : bounds.term) {
    add_slope(field.index(), box, term);
    gradient += term.gradient;
  }
  bounds.hull.assign(1, {gradient, kInfinity});
  // Where two parts of a lone curve are as near, some direction between their gradients.
  if (bounds.term.size() != 1 || bounds.term[0].gaps == 0) return;
  const GradientBounds::Term& curve = bounds.term[0];
  for (std::size_t k = 0; k < curve.gaps; ++k) bounds.hull.push_back({curve.factor.lower * (curve.to_local.transpose() * curve.gap[k]), kInfinity});
}

void add_curvature(const Field& field, const Box& box, GradientBounds& bounds) {
  if (!bounds.stepwise) return;
  const Field::Index& index = field.index();
  Expansion sum{.value = -index.iso, .scale = bounds.scale, .terms = static_cast<double>(bounds.term.size())};
  for (GradientBounds::Term& term : bounds.term) add_expanded(index, box, term, sum);
  const Vec3 half = 0.5 * box.extent();
  bounds.value = intersection(bounds.value, sum.range(half));
  bounds.hull.clear();
  if (!sum.sloped) return;
  bounds.hull.push_back({sum.gradient, sum.turn(half.norm()) + bounds.slack});
  bounds.least_slope = least_of_hull(bounds.hull);
  bounds.curved = {true, sum.curvature};
  bounds.round_off = sum.round_off();
}

Interval slope_along(const GradientBounds& bounds, const Vec3& direction) {
  Interval all{kInfinity, -kInfinity};
  for (const GradientBounds::Ball& ball : bounds.hull) {
    const double along = ball.gradient.dot(direction);
    all = {std::min(all.lower, along - ball.turn), std::max(all.upper, along + ball.turn)};
  }
  if (bounds.term.empty()) return all;
  Interval sum{-bounds.slack, bounds.slack};
  for (const GradientBounds::Term& term : bounds.term) {
    const double along = term.gradient.dot(direction);
    Interval one{along - term.turn, along + term.turn};
    if (std::isfinite(term.spread)) {
      const Vec3 local = term.to_local * direction;
      const Vec3 from = local.cwiseProduct(term.low), to = local.cwiseProduct(term.high);
      const double spread = term.spread * std::sqrt(local.head<2>().squaredNorm() + term.across * local.z() * local.z());
      Interval way{from.cwiseMin(to).sum(), from.cwiseMax(to).sum()};
      for (std::size_t k = 0; k < term.gaps; ++k) {
        const double one_way = local.dot(term.gap[k]);
        way = k == 0 ? Interval{one_way, one_way} : Interval{std::min(way.lower, one_way), std::max(way.upper, one_way)};
      }
      const double least = way.lower - spread, most = way.upper + spread;
      one = intersection(one, {(most > 0.0 ? term.factor.lower : term.factor.upper) * most,
                               (least > 0.0 ? term.factor.upper : term.factor.lower) * least});
    }
    sum = added(sum, one);
  }
  return intersection(all, sum);
}

}  // namespace supple::implicit
