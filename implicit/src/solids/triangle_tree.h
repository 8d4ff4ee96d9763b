/// @file triangle_tree.h
/// Nearest points on triangles and winding numbers about them, by a tree of boxes with eight children a node.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::implicit {

/// Where a triangle is nearest to a point.
struct TriangleSite {
  static constexpr std::uint8_t kFace = 0, kEdge = 1, kCorner = 4;  ///< edge k, from corner k to the next, is kEdge + k; corner k is kCorner + k

  double square = std::numeric_limits<double>::infinity();  ///< of the distance [m^2]
  std::uint32_t triangle = 0;
  std::uint8_t feature = kFace;
  double height = 0.0;         ///< of the point above the plane of a face, along its normal [m]
  Vec3 from = Vec3::Zero();    ///< from an edge or a corner to the point [m]
};

/// The nearest of several triangles does not depend on the order of the tests: among equally near ones it is that with the lowest index.
class TriangleTree {
 public:
  /// @param triangle  without area: they are nowhere nearest   @pre indices are valid, fewer than 2^31 triangles
  TriangleTree(std::span<const Vec3> position, std::span<const std::array<std::uint32_t, 3>> triangle);

  [[nodiscard]] std::size_t size() const { return count_; }
  /// The nearest triangle; none (an infinite `square`) without triangles that have an area. The last result on the same thread is tested first.
  [[nodiscard]] TriangleSite nearest(const Vec3& x) const;
  /// How often the triangles go around x: whole for a closed surface, but for the error of far triangles that are seen as dipoles, below 0.05, and half of
  /// a whole more or less in the plane of a triangle (Barill, Dickson, Schmidt, Levin & Jacobson 2018, "Fast Winding Numbers for Soups and Clouds").
  /// @param without  a triangle that is left out
  [[nodiscard]] double winding_number(const Vec3& x, std::uint32_t without = 0xffffffffU) const;
  /// Calls use(triangle) for those with an area whose boxes meet another one; boxes of nodes are rounded outwards.
  template <class Use>
  void each_near(const Box& box, const Use& use) const;
  /// Unit normals; zero for triangles without area.
  [[nodiscard]] const Vec3& normal(std::uint32_t triangle) const { return face_[place_[triangle]].normal; }

 private:
  static constexpr std::uint32_t kLeaf = 0x80000000U, kNone = 0xffffffffU;
  static constexpr std::size_t kWide = 8;  // children of a node, and faces of a leaf
  using Lanes = float __attribute__((vector_size(kWide * sizeof(float))));
  using Stack = std::array<std::uint32_t, 128>;  // seven a level, and each level has an eighth of the last

  /// Boxes relative to `origin_`, over `unit_`, in single precision and outwards by more than that loses.
  struct Node {
    std::array<Lanes, 3> lower, upper;
    std::array<std::uint32_t, kWide> child;  // a node, or kLeaf with a leaf; kNone
  };
  /// The far-field approximation of a child.
  struct Dipole {
    Vec3 centre = Vec3::Zero(), area = Vec3::Zero();  // area: of the faces, along their normals, summed
    double radius = 0.0;                              // of a ball about the centre that holds the child
  };
  struct Face {
    std::array<Vec3, 3> corner;
    Vec3 normal;
    std::array<Vec3, 3> inward;            // in the plane, perpendicular to each edge
    std::array<double, 3> inverse_square;  // of the lengths of the edges
    std::uint32_t triangle;
  };
  /// Up to eight faces in single precision, relative to `origin_` and over `unit_`: selects those that may be nearest.
  struct Leaf {
    std::array<std::array<Lanes, 3>, 3> corner, along, inward;  // by corner or edge, then by axis
    std::array<Lanes, 3> inverse_square, normal;
    std::uint32_t first, count;  // in face_
  };

  std::uint32_t build(std::span<std::uint32_t> faces, std::uint32_t first, std::span<const Face> given);
  std::uint32_t add_leaf(std::span<const std::uint32_t> faces, std::uint32_t first, std::span<const Face> given);
  static void look_at(const Face& face, const Vec3& x, TriangleSite& best);
  static Lanes squares(const Leaf& leaf, const std::array<float, 3>& at);

  std::size_t count_ = 0;
  Vec3 origin_ = Vec3::Zero();
  double unit_ = 1.0;                              // the power of two below the size, so that squares of single precision hold meshes of any size [m]
  double pad_ = 0.0;                               // more than single precision loses of a place in the mesh, over `unit_`
  std::uint32_t root_ = kNone;
  std::vector<Node> node_;
  std::vector<Leaf> leaf_;
  std::vector<std::array<Dipole, kWide>> dipole_;  // of the children of each node
  std::vector<Face> face_;                         // in the order of leaves, then one without area
  std::vector<std::uint32_t> place_;               // of each triangle in face_
};

template <class Use>
void TriangleTree::each_near(const Box& box, const Use& use) const {
  if (root_ == kNone) return;
  Stack stack;
  stack[0] = root_;
  const Box local{(box.lower - origin_) / unit_, (box.upper - origin_) / unit_};
  for (std::size_t n = 1; n > 0;) {
    const Node& node = node_[stack[--n]];
    for (std::size_t c = 0; c < kWide; ++c) {
      if (node.child[c] == kNone) continue;
      bool meets = true;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<Eigen::Index>(k);
        meets = meets && static_cast<double>(node.lower[k][c]) <= local.upper[axis] && local.lower[axis] <= static_cast<double>(node.upper[k][c]);
      }
      if (!meets) continue;
      if ((node.child[c] & kLeaf) == 0) {
        stack[n++] = node.child[c];
        continue;
      }
      const Leaf& leaf = leaf_[node.child[c] & ~kLeaf];
      for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) use(face_[i].triangle);
    }
  }
}

}  // namespace supple::implicit
