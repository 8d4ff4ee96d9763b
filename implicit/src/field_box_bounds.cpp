// Bounds of second order on boxes: value and gradient at the centre, and bounds of the second derivatives anywhere.
#include <algorithm>
#include <cmath>
#include <limits>

#include "field_box_bounds.h"
#include "field_index.h"
#include "shape_curvature.h"
#include "shortest_in_hull.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Taylor's expansion of a sum of potentials about the centre of a box.
struct Expansion {
  std::uint32_t node = 0;         ///< of the blend
  double value = 0.0;             ///< of what is expanded
  Vec3 gradient = Vec3::Zero();
  CurvatureRange curvature{};     ///< of its second derivatives on the box
  Interval rest{0.0, 0.0};        ///< of what is not
  Interval plain{0.0, 0.0};       ///< of all, from distances alone
  bool sloped = true;             ///< nothing is left for the rest
  double scale = 0.0;             ///< of round-off [1]
  double terms = 0.0;

  /// How far the gradient turns between the centre and a corner, at most.
  [[nodiscard]] double turn(double reach) const { return std::max(-curvature.lower, curvature.upper) * reach; }
  [[nodiscard]] double round_off() const { return (64.0 + 2.0 * terms) * kEps * scale; }
  [[nodiscard]] Interval range(const Vec3& half) const {
    const double first = gradient.cwiseAbs().dot(half), reach2 = half.squaredNorm();
    return {value + rest.lower - first + 0.5 * curvature.lower * reach2 - round_off(),
            value + rest.upper + first + 0.5 * curvature.upper * reach2 + round_off()};
  }
};

Interval added(const Interval& a, const Interval& b) { return {a.lower + b.lower, a.upper + b.upper}; }

/// Bounds of df/dq for q in the range. It is negative and rises with q, but for two kernels: Blanc & Schlick's, which is flat at 0; and
/// that of Gascuel may be steepest farther out, where df/dd is largest at one end of any range: it is a parabola that opens upwards or rises.
/// @param curvature  of the kernel there, whose lower end is no more than twice df/dq
Interval slope_range(const Kernel& kernel, const DistanceRange& range, const KernelSample& near, const KernelSample& far,
                     const CurvatureRange& curvature) {
  switch (kernel.kind) {
    case KernelKind::BlancSchlick: return {0.5 * curvature.lower, 0.0};
    case KernelKind::Gascuel: {
      const double near_slope = near.slope * std::sqrt(range.near2 / range.far2);
      return {0.5 * curvature.lower, std::max(near_slope, far.slope) * (1.0 - 1e-12)};
    }
    default: return {near.slope, far.slope};
  }
}

/// How fast the vector from the nearest point of a shape may change, over how fast the place does: not at all along it and as fast
/// across for convex shapes.
double gap_rate(const ShapeView& shape) {
  switch (shape.kind) {
    case ShapeKind::Ring:
    case ShapeKind::Arc:
    case ShapeKind::Curve:
    case ShapeKind::Superquadric:
    case ShapeKind::Directed: return kInfinity;
    case ShapeKind::Segment: return shape.taper == 1.0 ? 1.0 : kInfinity;
    default: return 1.0;
  }
}

/// @param terms  null: not wanted
void expand(const Field::Index& index, std::uint32_t id, const Box& box, Expansion& sum, std::vector<GradientBounds::Term>* terms) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const PackedPrimitive& p = index.primitive[id];
  const PackedShape& shape = index.shape[id];
  const double reach = 0.5 * box.extent().norm();
  sum.scale += shape.peak + shape.lipschitz * reach;
  sum.terms += 1.0;
  const Eigen::Map<const RowMajor> A(shape.to_local.data());
  const double metric2 = A.rowwise().squaredNorm().maxCoeff() * (1.0 + 4.0 * kEps);  // its rows are orthogonal
  const Vec3 y = A * (box.centre() - Vec3(p.position[0], p.position[1], p.position[2]));
  CurvatureRange curvature;
  Potential centre;
  Interval plain;
  GradientBounds::Term term{.spread = kInfinity, .factor = {-kInfinity, 0.0}};
  if (shape.foot == PackedFoot::Convolved) {
    plain = bound_primitive(index, id, box, false).value;
    // The peak is the measure of the shape times that of the kernel, which is 1.
    const double near = std::max(std::sqrt(foot(shape.view, y).q) - shape.distance_scale * reach, 0.0);
    curvature = curvature_range(shape.kernel, near, shape.kernel.radius);
    curvature = {shape.peak * curvature.lower, shape.peak * curvature.upper};
    centre = convolve(shape.view, shape.kernel, y);
    sum.scale += 1e4 * shape.peak;  // sums over edges cancel
  } else {
    const DistanceRange range = distance_range(index, id, box);
    const KernelSample near = evaluate(shape.kernel, range.near2), least = evaluate(shape.kernel, range.far2);
    plain = {least.value, near.value};
    const bool clipped = !(index.support[id].contains(box.lower) && index.support[id].contains(box.upper));
    const double far = clipped ? shape.kernel.radius : std::min(std::sqrt(range.far2), shape.kernel.radius);
    const ShapeBall ball{.centre = y, .reach = std::sqrt(metric2) * reach, .far = far};
    const CurvatureRange of_kernel = curvature_range(shape.kernel, std::sqrt(range.near2), far);
    curvature = shape_curvature(shape.view, ball, of_kernel);
    const FootSample sample = foot(shape.view, y);
    const KernelSample kernel = supple::implicit::evaluate(shape.kernel, sample.q);
    centre = {kernel.value, 2.0 * kernel.slope * sample.half_gradient};
    if (terms != nullptr && std::isfinite(of_kernel.lower)) {
      const Interval slope = slope_range(shape.kernel, range, near, least, of_kernel);
      term = {.gap = A.transpose() * sample.half_gradient, .spread = gap_rate(shape.view) * metric2 * reach * (1.0 + 1e-12),
              .factor = {2.0 * slope.lower, 2.0 * slope.upper}};
    }
  }
  sum.plain = added(sum.plain, plain);
  if (!std::isfinite(curvature.lower) || !std::isfinite(curvature.upper)) {
    sum.rest = added(sum.rest, plain);
    sum.sloped = false;
    return;
  }
  sum.value += centre.value;
  const Vec3 gradient = A.transpose() * centre.gradient;
  sum.gradient += gradient;
  if (terms != nullptr) {
    term.gradient = gradient;
    term.turn = metric2 * std::max(-curvature.lower, curvature.upper) * reach;
    terms->push_back(term);
  }
  sum.curvature = {sum.curvature.lower + metric2 * curvature.lower, sum.curvature.upper + metric2 * curvature.upper};
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
    expand(index, id, box, *place, nullptr);
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

/// Balls of gradients that F may have, from those of the nodes [1/m].
/// @param reach  from the centre of the box to its corners  @param largest  half its largest edge
void find_hull(const BlendIndex& blend, std::span<const Expansion> nodes, std::span<const BlendIndex::NodeBound> bounds,
               std::span<const BlendIndex::Term> terms, double reach, double largest, std::vector<GradientBounds::Ball>& hull) {
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
  find_hull(index.blend, nodes, bounds, terms, half.norm(), half.maxCoeff(), out.hull);
  for (GradientBounds::Ball& ball : out.hull) ball.turn += round_off * slopes;
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
  const Field::Index& index = field.index();
  if (box.empty() || !box.lower.allFinite() || !box.upper.allFinite()) return {{.value = field.bound(box)}, {}, {}};
  if (index.blend.active()) return blended_box_bounds(index, box, field.bound(box));
  Expansion sum{.value = -index.iso, .scale = index.iso};
  GradientBounds out{};
  bool round = true;
  for (const std::uint32_t id : candidates_of(index, box)) {
    if (!index.support[id].overlaps(box)) continue;
    expand(index, id, box, sum, &out.term);
    round = index.shape[id].view.kind == ShapeKind::Point;
  }
  // As Field::bound has them.
  const double round_off = (16.0 + sum.terms) * kEps * sum.scale;
  const Interval plain{std::max(sum.plain.lower - index.iso - round_off, -index.iso), sum.plain.upper - index.iso + round_off};
  if (sum.terms == 0.0) return {{.value = {-index.iso, -index.iso}, .second_order = true}, {}, {GradientBounds::Ball{}}};
  const Vec3 half = 0.5 * box.extent();
  out.value = intersection(plain, sum.range(half));
  out.second_order = true;
  out.round = round && sum.terms == 1.0;  // a lone ball or ellipsoid
  if (sum.sloped && half.maxCoeff() > 0.0) {
    out.slack = sum.round_off() / half.maxCoeff();
    out.hull.push_back({sum.gradient, sum.turn(half.norm()) + out.slack});
    out.least_slope = least_of_hull(out.hull);
    out.curved = {true, sum.curvature, sum.round_off()};
  }
  return out;
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
    const double way = term.gap.dot(direction), along = term.gradient.dot(direction);
    Interval one{along - term.turn, along + term.turn};
    if (std::isfinite(term.spread)) {
      const double least = way - term.spread, most = way + term.spread;
      one = intersection(one, {(most > 0.0 ? term.factor.lower : term.factor.upper) * most,
                               (least > 0.0 ? term.factor.upper : term.factor.lower) * least});
    }
    sum = added(sum, one);
  }
  return intersection(all, sum);
}

}  // namespace supple::implicit
