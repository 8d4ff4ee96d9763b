/// @file crease_nodes.h
/// The fields of the nodes of a blending graph, whose largest is that of the body.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "field/field_index.h"
#include "supple/core/executor.h"

namespace supple::implicit {

/// Boxes of the supports by node; empty for nodes without primitives.
[[nodiscard]] std::vector<Box> node_supports(const Field::Index& index);

/// F_k of one node.
class NodeField {
 public:
  NodeField(const Field& field, std::uint32_t node, const Box& support) : field_(&field), node_(node), box_(support) {}

  void evaluate(std::span<const Vec3> points, std::span<double> values) const { evaluate(points, values, {}); }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field_->evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const { return box_; }
  [[nodiscard]] double feature_size() const { return field_->feature_size(); }

 private:
  const Field* field_;
  std::uint32_t node_;
  Box box_;
};

/// The node whose F_k is the largest at each point, of several the first: at least one is zero or more on the surface.
/// @param nodes  those that have primitives, in rising order   @return places in it
[[nodiscard]] std::vector<std::uint32_t> largest_nodes(const Field& field, std::span<const std::uint32_t> nodes, std::span<const Vec3> points,
                                                       const Executor& executor);

}  // namespace supple::implicit
