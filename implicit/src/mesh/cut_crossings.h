/// @file cut_crossings.h
/// Prevents intersections of triangles that are divided into four with the midpoints of their edges moved to the surface.
///
/// On the way from the flat triangles, which do not intersect, to the moved ones two would have to touch first. Along a line across all sheets that
/// meet there inside and outside alternate, so two of them face each other: nothing touches where one direction has all normals of near triangles, at
/// all times, on its side. A triangle is near a point if the box of its corners and midpoints contains the point. Elsewhere the final triangles are compared one
/// by one; that intersections which begin there do not move to other places is tested, not proved.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"

namespace supple::implicit {

/// The midpoint of an edge that was put back on it, and its moved position.
struct StraightEdge {
  std::uint32_t vertex = 0;
  Vec3 position = Vec3::Zero();  ///< [m]
  Vec3 normal = Vec3::Zero();
};

/// Kept for its memory.
class CutCrossings {
 public:
  /// Puts back the midpoint that was moved farthest of intersecting triangles, until none intersect; normals stay.
  /// @param from  does not intersect itself   @param to  triangle n of it divided into 4n (a, ab, ca), 4n + 1 (ab, b, bc), 4n + 2 (ca, bc, c) and 4n + 3
  /// (ab, bc, ca); its first vertices are those of `from`   @param straight  receives the midpoints put back, by rising vertex
  void take_back(const Mesh& from, const Executor& executor, Mesh& to, std::vector<StraightEdge>& straight);

 private:
  /// A divided triangle.
  struct Cut {
    Box box;
    Vec3 axis = Vec3::Zero();  ///< unit; zero: its normals, on the way, are not all within a right angle of one
    double sine = 0.0;         ///< of the largest angle between the axis and any of them
  };
  /// Boxes that a cut overlaps: a range of each coordinate.
  struct Range {
    std::uint32_t first = 0;
    std::array<std::uint16_t, 3> more{};  ///< beyond the first one
  };
  struct InBox {
    std::uint32_t box, triangle;
  };
  struct Middle {
    std::uint32_t vertex = 0;
    Vec3 of_edge = Vec3::Zero();
  };

  void find_cuts(const Mesh& from, const Mesh& to, const Executor& executor);
  /// Those in boxes of one width in which no direction has all normals on its side.
  void find_doubtful();
  /// Midpoints of intersecting triangles that are to be put back.
  void find_crossing(const Mesh& from, const Mesh& to, const Executor& executor);

  std::vector<Cut> cut_;
  Box all_;
  double width_ = 0.0;                  ///< of the boxes [m]; changes no bit
  std::vector<Range> range_;            ///< of each cut
  std::vector<Vec3> axis_;              ///< by box, the sum
  std::vector<std::uint8_t> doubtful_;  ///< by box
  std::vector<InBox> in_box_;
  std::vector<std::vector<Middle>> found_;  ///< by doubtful box
  std::vector<Middle> middle_;
};

}  // namespace supple::implicit
