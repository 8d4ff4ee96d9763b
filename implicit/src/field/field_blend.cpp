// Fields whose parts do not simply sum: the parts' sums are joined point by point by the rules of blend.h.
#include <algorithm>
#include <cmath>
#include <limits>

#include "field/field_index.h"

namespace supple::implicit {
namespace {

constexpr std::size_t kChunk = 256;
constexpr double kEps = std::numeric_limits<double>::epsilon();

/// Per thread, reused so that evaluation does not allocate.
struct Scratch {
  FieldParts parts;
  std::vector<NodeSample> nodes;
  std::vector<double> share;
  std::vector<Vec3> own;  ///< gradients of the parts of a row
  std::vector<BlendIndex::NodeBound> bounds;

  static Scratch& of_thread() {
    thread_local Scratch scratch;
    return scratch;
  }
};

/// Entry of `list` that belongs to a node, made where it is missing; lists are short and stay sorted.
template <class T>
T& at_node(std::vector<T>& list, std::uint32_t node) {
  if (list.empty() || list.back().node < node) return list.emplace_back(T{.node = node});
  const auto place = std::lower_bound(list.begin(), list.end(), node, [](const T& a, std::uint32_t b) { return a.node < b; });
  if (place->node == node) return *place;
  return *list.insert(place, T{.node = node});
}

/// Sums of the nodes at point i of the rows.
void gather(const BlendIndex& blend, const FieldParts& parts, std::size_t i, std::vector<NodeSample>& nodes) {
  nodes.clear();
  for (std::uint32_t r = parts.offset[i]; r < parts.offset[i + 1]; ++r) {
    NodeSample& node = at_node(nodes, blend.node_of(parts.part[r]));
    node.value += parts.value[r];
    node.gradient += parts.gradient[r];
  }
}

/// The point x, in row i of the parts, and the sums of the nodes there.
struct BlendPoint {
  std::span<const NodeSample> nodes;
  const FieldParts& parts;
  std::size_t i;
  const Vec3& x;
};

/// Calls use(row, added, along) for the parts of the winning pair: what the change of the angle between their gradients adds to
/// the gradient, split by the part whose second derivatives cause it, and dF / d(grad f) of their nodes [m].
template <class Use>
void for_turning(const Field::Index& index, const Combined& combined, const BlendPoint& at, const Use& use) {
  const FieldParts& parts = at.parts;
  const NodeSample* pair[2] = {&at.nodes[combined.first], &at.nodes[combined.second]};
  for (std::size_t side = 0; side < 2; ++side) {
    const NodeSample& own = *pair[side];
    const NodeSample& other = *pair[1 - side];
    const double length = own.gradient.norm();
    const Vec3 turn = other.gradient.normalized() - combined.cosine / length * own.gradient;
    const Vec3 along = combined.by_cosine / length * turn;
    for (std::uint32_t r = parts.offset[at.i]; r < parts.offset[at.i + 1]; ++r) {
      if (index.blend.node_of(parts.part[r]) == own.node) use(r, part_hessian(index, parts.part[r], at.x) * along, along);
    }
  }
}

}  // namespace

void evaluate_blended(const Field::Index& index, std::span<const Vec3> points, double* values, Vec3* gradients) {
  Scratch& scratch = Scratch::of_thread();
  for (std::size_t begin = 0; begin < points.size(); begin += kChunk) {
    const std::span<const Vec3> chunk = points.subspan(begin, std::min(kChunk, points.size() - begin));
    part_rows(index, chunk, scratch.parts);
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      gather(index.blend, scratch.parts, i, scratch.nodes);
      scratch.share.resize(scratch.nodes.size());
      const Combined combined = index.blend.combine(scratch.nodes, scratch.share);
      values[begin + i] = combined.value - index.iso;
      if (gradients == nullptr) continue;
      Vec3& gradient = gradients[begin + i];
      gradient.setZero();
      for (std::size_t k = 0; k < scratch.nodes.size(); ++k) gradient += scratch.share[k] * scratch.nodes[k].gradient;
      if (combined.by_cosine == 0.0) continue;
      for_turning(index, combined, {scratch.nodes, scratch.parts, i, chunk[i]},
                  [&](std::uint32_t, const Vec3& added, const Vec3&) { gradient += added; });
    }
  }
}

void blended_part_rows(const Field::Index& index, std::span<const Vec3> points, FieldParts& parts) {
  Scratch& scratch = Scratch::of_thread();
  part_rows(index, points, parts);
  const bool turns = index.blend.rule() == BlendRule::Gradient;
  if (turns) parts.by_turn.assign(parts.part.size(), Vec3::Zero());
  std::uint32_t kept = 0;
  std::uint32_t row_begin = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t row_end = parts.offset[i + 1];
    gather(index.blend, parts, i, scratch.nodes);
    scratch.share.resize(scratch.nodes.size());
    scratch.own.resize(row_end - row_begin);
    const Combined combined = index.blend.combine(scratch.nodes, scratch.share);
    for (std::uint32_t r = row_begin; r < row_end; ++r) {
      const std::uint32_t node = index.blend.node_of(parts.part[r]);
      const auto k = std::lower_bound(scratch.nodes.begin(), scratch.nodes.end(), node,
                                      [](const NodeSample& a, std::uint32_t b) { return a.node < b; });
      const double share = scratch.share[static_cast<std::size_t>(k - scratch.nodes.begin())];
      scratch.own[r - row_begin] = parts.gradient[r];
      parts.value[r] *= share;
      parts.gradient[r] *= share;
    }
    if (combined.by_cosine != 0.0) {
      for_turning(index, combined, {scratch.nodes, parts, i, points[i]}, [&](std::uint32_t r, const Vec3& added, const Vec3& along) {
        parts.gradient[r] += added;
        parts.by_turn[r] = scratch.own[r - row_begin].cross(along);
      });
    }
    parts.offset[i] = kept;
    for (std::uint32_t r = row_begin; r < row_end; ++r) {
      if (parts.value[r] == 0.0) continue;
      parts.part[kept] = parts.part[r];
      parts.value[kept] = parts.value[r];
      parts.gradient[kept] = parts.gradient[r];
      if (turns) parts.by_turn[kept] = parts.by_turn[r];
      ++kept;
    }
    row_begin = row_end;
  }
  parts.offset[points.size()] = kept;
  parts.part.resize(kept);
  parts.value.resize(kept);
  parts.gradient.resize(kept);
  if (turns) parts.by_turn.resize(kept);
}

namespace {

/// Bounds of the nodes that a box touches, and the size of what was added, for its round-off.
double bound_nodes(const Field::Index& index, const Box& box, bool with_slope, std::vector<BlendIndex::NodeBound>& nodes) {
  nodes.clear();
  double scale = 0.0;
  for (const std::uint32_t id : candidates_of(index, box)) {
    if (!index.support[id].overlaps(box)) continue;
    const PrimitiveBound one = bound_primitive(index, id, box, with_slope);
    BlendIndex::NodeBound& node = at_node(nodes, index.blend.node_of(index.primitive[id].part));
    node.value.lower += one.value.lower;
    node.value.upper += one.value.upper;
    node.slope += one.slope;
    scale += with_slope ? index.shape[id].lipschitz : index.shape[id].peak;
  }
  return scale;
}

}  // namespace

Interval blended_bound(const Field::Index& index, const Box& box) {
  std::vector<BlendIndex::NodeBound>& nodes = Scratch::of_thread().bounds;
  const double scale = bound_nodes(index, box, false, nodes);
  if (nodes.empty()) return {-index.iso, -index.iso};
  const Interval bound = index.blend.bound(nodes);
  const double n = static_cast<double>(nodes.size());
  const double round_off = (32.0 + 4.0 * n * n) * kEps * (scale + index.iso);
  return {std::max(bound.lower - index.iso - round_off, -index.iso), bound.upper - index.iso + round_off};
}

double blended_gradient_bound(const Field::Index& index, const Box& box) {
  std::vector<BlendIndex::NodeBound>& nodes = Scratch::of_thread().bounds;
  const double scale = bound_nodes(index, box, true, nodes);
  const double n = static_cast<double>(nodes.size());
  return index.blend.slope_bound(nodes) + (64.0 + 4.0 * n * n) * kEps * scale;
}

}  // namespace supple::implicit
