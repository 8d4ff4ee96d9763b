/// @file grid_field.h
/// Fields on a lattice of nodes, and what lies inside them.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::fit {

/// Values at the nodes of a lattice with steps of 1: F > 0 inside, linear between the nodes along each axis. The nodes at its border are outside.
class GridField {
 public:
  std::array<std::size_t, 3> count{};
  std::vector<float> value;  ///< i runs fastest

  [[nodiscard]] std::size_t at(std::size_t i, std::size_t j, std::size_t k) const { return (k * count[1] + j) * count[0] + i; }

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const { return 1.0; }

 private:
  double sample(const Vec3& place, Vec3* gradient) const;
};

/// The number of nodes that lie in no part.
inline constexpr std::uint32_t kNoPart = std::numeric_limits<std::uint32_t>::max();

/// Parts in which nodes of one side hang together by faces, in the order of their first nodes.
/// @param part  receives the part of each node, kNoPart on the other side   @return numbers of nodes of the parts
[[nodiscard]] std::vector<std::size_t> parts_of(const GridField& field, bool inside, std::vector<std::uint32_t>& part);

/// Puts inside what the inside encloses. @return the number of such cavities
std::size_t fill_cavities(GridField& field);

/// The closed surface F = 0 by marching cubes, in steps of the lattice, without normals.
[[nodiscard]] Mesh surface_of_grid(const GridField& field, const Executor& executor);

}  // namespace supple::fit
