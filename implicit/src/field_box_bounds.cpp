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
  Interval plain{0.0, 0.0};       ///< of all, from distances alone; only with a blend
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

void expand(const Field::Index& index, std::uint32_t id, const Box& box, Expansion& sum) {
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
  if (shape.foot == PackedFoot::Convolved) {
    // The peak is the measure of the shape times that of the kernel, which is 1.
    const double near = std::max(std::sqrt(foot(shape.view, y).q) - shape.distance_scale * reach, 0.0);
    curvature = curvature_range(shape.kernel, near, shape.kernel.radius);
    curvature = {shape.peak * curvature.lower, shape.peak * curvature.upper};
    centre = convolve(shape.view, shape.kernel, y);
    sum.scale += 1e4 * shape.peak;  // sums over edges cancel
  } else {
    const DistanceRange range = distance_range(index, id, box);
    const bool clipped = !(index.support[id].contains(box.lower) && index.support[id].contains(box.upper));
    const double far = clipped ? shape.kernel.radius : std::min(std::sqrt(range.far2), shape.kernel.radius);
    const ShapeBall ball{.centre = y, .reach = std::sqrt(metric2) * reach, .far = far};
    curvature = shape_curvature(shape.view, ball, curvature_range(shape.kernel, std::sqrt(range.near2), far));
    const FootSample sample = foot(shape.view, y);
    const KernelSample kernel = supple::implicit::evaluate(shape.kernel, sample.q);
    centre = {kernel.value, 2.0 * kernel.slope * sample.half_gradient};
  }
  if (!std::isfinite(curvature.lower) || !std::isfinite(curvature.upper)) {
    const PrimitiveBound one = bound_primitive(index, id, box, false);
    sum.rest = {sum.rest.lower + one.value.lower, sum.rest.upper + one.value.upper};
    sum.sloped = false;
    return;
  }
  sum.value += centre.value;
  sum.gradient += A.transpose() * centre.gradient;
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
    const PrimitiveBound one = bound_primitive(index, id, box, false);
    place->plain = {place->plain.lower + one.value.lower, place->plain.upper + one.value.upper};
    expand(index, id, box, *place);
  }
}

/// A unit vector along which F may rise on all of the box, by the gradients at its centre; zero where there is none.
Vec3 uphill(const BlendIndex& blend, std::span<const Expansion> nodes, std::span<const BlendIndex::NodeBound> bounds,
            std::span<const BlendIndex::Term> terms) {
  Vec3 along = Vec3::Zero();
  if (blend.rule() == BlendRule::Ricci) {
    const Interval all = blend.bound(bounds);
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const Interval share = blend.share(bounds[k], all);
      along += 0.5 * (share.lower + share.upper) * nodes[k].gradient;
    }
  } else {
    std::vector<Vec3> gradients;
    for (std::size_t t = 0; t < terms.size(); ++t) {
      const BlendIndex::Term& term = terms[t];
      if (t == 0 || terms[t - 1].winner != term.winner) gradients.push_back(Vec3::Zero());
      gradients.back() += term.weight * (term.or_winner ? Vec3(0.5 * (nodes[term.node].gradient + nodes[term.winner].gradient))
                                                        : nodes[term.node].gradient);
    }
    if (!gradients.empty()) along = shortest_in_hull(gradients);
  }
  const double length = along.norm();
  return length > 0.0 ? Vec3(along / length) : Vec3::Zero();
}

/// What the derivative of F along a direction is at least, from those of the nodes; where two nodes win in turn, of either.
double least_along(const BlendIndex& blend, std::span<const BlendIndex::NodeBound> nodes, std::span<const BlendIndex::Term> terms) {
  if (blend.rule() == BlendRule::Ricci) {
    const Interval all = blend.bound(nodes);
    double sum = 0.0;
    for (const BlendIndex::NodeBound& k : nodes) {
      const Interval share = blend.share(k, all);
      sum += std::min(share.lower * k.slope, share.upper * k.slope);
    }
    return sum;
  }
  double least = kInfinity, sum = 0.0;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    const BlendIndex::Term& term = terms[t];
    if (t == 0 || terms[t - 1].winner != term.winner) sum = 0.0;
    sum += term.weight * (term.or_winner ? std::min(nodes[term.node].slope, nodes[term.winner].slope) : nodes[term.node].slope);
    if (t + 1 == terms.size() || terms[t + 1].winner != term.winner) least = std::min(least, sum);
  }
  return least;
}

Field::BoxBounds blended_box_bounds(const Field::Index& index, const Box& box, const Interval& plain) {
  thread_local std::vector<Expansion> nodes;
  thread_local std::vector<BlendIndex::NodeBound> bounds;
  thread_local std::vector<BlendIndex::Term> terms;
  expand_nodes(index, box, nodes);
  if (nodes.empty()) return {.value = plain, .second_order = true};
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
  Field::BoxBounds out{.value = intersection(plain, {sum.lower - index.iso - round_off * scale, sum.upper - index.iso + round_off * scale}),
                       .second_order = true};
  if (index.blend.rule() != BlendRule::Ricci && !index.blend.find_terms(bounds, terms)) return {.value = out.value};
  if (!sloped || half.isZero()) return out;
  const Vec3 direction = uphill(index.blend, nodes, bounds, terms);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    bounds[k].slope = nodes[k].gradient.dot(direction) - nodes[k].turn(half.norm()) - nodes[k].round_off() / half.maxCoeff();
  }
  out.least_slope = std::max(least_along(index.blend, bounds, terms) - round_off * slopes, 0.0);
  return out;
}

}  // namespace

Interval Field::tight_bound(const Box& box) const { return box_bounds(box).value; }

Field::BoxBounds Field::box_bounds(const Box& box) const { return bounds_with_gradient(*this, box); }

GradientBounds bounds_with_gradient(const Field& field, const Box& box) {
  const Field::Index& index = field.index();
  const Interval plain = field.bound(box);
  if (box.empty() || !box.lower.allFinite() || !box.upper.allFinite()) return {{.value = plain}};
  if (index.blend.active()) return {blended_box_bounds(index, box, plain)};
  Expansion sum{.value = -index.iso, .scale = index.iso};
  for (const std::uint32_t id : candidates_of(index, box)) {
    if (index.support[id].overlaps(box)) expand(index, id, box, sum);
  }
  if (sum.terms == 0.0) return {{.value = plain, .second_order = true}, Vec3::Zero(), 0.0};
  const Vec3 half = 0.5 * box.extent();
  GradientBounds out{{.value = intersection(plain, sum.range(half)), .second_order = true}};
  if (sum.sloped && half.maxCoeff() > 0.0) {
    out.gradient = sum.gradient;
    out.turn = sum.turn(half.norm()) + sum.round_off() / half.maxCoeff();
    out.least_slope = std::max(sum.gradient.norm() * (1.0 - 1e-12) - out.turn, 0.0);
  }
  return out;
}

}  // namespace supple::implicit
