#include "mesh/creases/crease_nodes.h"

#include <algorithm>
#include <limits>

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// Sums by node of a point's row.
void gather(const BlendIndex& blend, std::size_t i, const FieldParts& parts, std::vector<NodeSample>& nodes) {
  nodes.clear();
  for (std::uint32_t r = parts.offset[i]; r < parts.offset[i + 1]; ++r) {
    const std::uint32_t node = blend.node_of(parts.part[r]);
    auto at = std::find_if(nodes.begin(), nodes.end(), [&](const NodeSample& n) { return n.node == node; });
    if (at == nodes.end()) at = nodes.insert(nodes.end(), NodeSample{.node = node});
    at->value += parts.value[r];
    at->gradient += parts.gradient[r];
  }
}

/// F_k and its gradient; where sums are equal up to rounding, the gradient from the node's own side, where its sum is the larger.
/// @param own  sums of node k  @param nodes  of all nodes
NodeSample node_sample(const Field::Index& index, const NodeSample& own, std::span<const NodeSample> nodes) {
  constexpr double kAlike = 1e-12;  // points of creases leave 1e-13
  NodeSample found{.node = own.node, .value = own.value - index.iso, .gradient = own.gradient};
  for (const NodeSample& other : nodes) {
    const double w = other.node == own.node ? 0.0 : index.blend.weight(own.node, other.node);
    if (w == 0.0) continue;
    found.value += w * std::min(other.value, own.value);
    found.gradient += w * (other.value < own.value + kAlike ? other : own).gradient;
  }
  return found;
}

/// Calls use(bounds of the nodes that the box touches, size of what was added).
template <class Use>
void bound_nodes(const Field::Index& index, const Box& box, bool with_slope, const Use& use) {
  thread_local std::vector<BlendIndex::NodeBound> nodes;
  nodes.clear();
  double scale = 0.0;
  for (const std::uint32_t id : candidates_of(index, box)) {
    if (!index.support[id].overlaps(box)) continue;
    const PrimitiveBound one = bound_primitive(index, id, box, with_slope);
    const std::uint32_t node = index.blend.node_of(index.primitive[id].part);
    auto at = std::find_if(nodes.begin(), nodes.end(), [&](const auto& n) { return n.node == node; });
    if (at == nodes.end()) at = nodes.insert(nodes.end(), BlendIndex::NodeBound{.node = node});
    at->value.lower += one.value.lower;
    at->value.upper += one.value.upper;
    at->slope += one.slope;
    scale += with_slope ? index.shape[id].lipschitz : index.shape[id].peak;
  }
  use(nodes, scale);
}

}  // namespace

std::vector<Box> node_supports(const Field::Index& index) {
  std::vector<Box> box;
  for (std::size_t i = 0; i < index.size(); ++i) {
    const std::uint32_t node = index.blend.node_of(index.primitive[i].part);
    if (node >= box.size()) box.resize(node + 1);
    box[node] = box[node].united(index.support[i]);
  }
  return box;
}

void NodeField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  const Field::Index& index = field_->index();
  thread_local FieldParts parts;
  thread_local std::vector<NodeSample> nodes;
  part_rows(index, points, parts);
  for (std::size_t i = 0; i < points.size(); ++i) {
    gather(index.blend, i, parts, nodes);
    const auto own = std::find_if(nodes.begin(), nodes.end(), [&](const NodeSample& n) { return n.node == node_; });
    const NodeSample found = node_sample(index, own == nodes.end() ? NodeSample{.node = node_} : *own, nodes);
    values[i] = found.value;
    if (!gradients.empty()) gradients[i] = found.gradient;
  }
}

Interval NodeField::bound(const Box& box) const {
  Interval own, total;
  double scale = 0.0;
  bound_nodes(field_->index(), box, false, [&](std::span<const BlendIndex::NodeBound> nodes, double size) {
    scale = size;
    for (const auto& n : nodes) {
      if (n.node == node_) own = n.value;
    }
    total = own;
    for (const auto& n : nodes) {
      const double w = n.node == node_ ? 0.0 : field_->index().blend.weight(node_, n.node);
      total.lower += w * std::min(n.value.lower, own.lower);
      total.upper += w * std::min(n.value.upper, own.upper);
    }
  });
  const double iso = field_->index().iso, round_off = 64.0 * kEps * (scale + iso);
  return {std::max(total.lower - iso - round_off, -iso), total.upper - iso + round_off};
}

double NodeField::gradient_bound(const Box& box) const {
  double total = 0.0;
  bound_nodes(field_->index(), box, true, [&](std::span<const BlendIndex::NodeBound> nodes, double size) {
    double own = 0.0;
    for (const auto& n : nodes) {
      if (n.node == node_) own = n.slope;
    }
    total = own;
    for (const auto& n : nodes) {
      if (n.node != node_) total += field_->index().blend.weight(node_, n.node) * std::max(n.slope, own);
    }
    total += 64.0 * kEps * size;
  });
  return total;
}

std::vector<std::uint32_t> largest_nodes(const Field& field, std::span<const std::uint32_t> nodes, std::span<const Vec3> points,
                                         const Executor& executor) {
  constexpr std::size_t kPointsPerTask = 512;
  const Field::Index& index = field.index();
  std::vector<std::uint32_t> largest(points.size());
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    thread_local FieldParts parts;
    thread_local std::vector<NodeSample> sums;
    part_rows(index, points.subspan(begin, end - begin), parts);
    for (std::size_t i = begin; i < end; ++i) {
      gather(index.blend, i - begin, parts, sums);
      NodeSample best{.node = 0, .value = -std::numeric_limits<double>::infinity()};
      for (const NodeSample& own : sums) {
        const double value = node_sample(index, own, sums).value;
        if (value > best.value || (value == best.value && own.node < best.node)) best = {.node = own.node, .value = value};
      }
      const auto place = std::lower_bound(nodes.begin(), nodes.end(), best.node) - nodes.begin();
      largest[i] = static_cast<std::uint32_t>(place);
    }
  });
  return largest;
}

}  // namespace supple::implicit
