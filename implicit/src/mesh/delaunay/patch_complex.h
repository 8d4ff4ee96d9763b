/// @file patch_complex.h
/// Surfaces that divide space, as triangles between two labels (0 is outside, m + 1 is body m). Triangles with the same two labels
/// are a patch; patches meet in boundary curves. Vertices list their triangles, so that any number of these may share an edge.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_junctions.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Interior of a patch, interior of a boundary curve, or a point where boundary curves meet.
enum class PatchPlace : std::uint8_t { Interior, Boundary, Corner };

class PatchComplex {
 public:
  using Vertex = std::uint32_t;
  struct Triangle {
    std::array<Vertex, 3> vertex{};  ///< counter-clockwise seen from `outer`
    lattice::Label inner = 0, outer = 0;
    std::uint32_t version = 0;       ///< another one for every change
    bool alive = true;

    [[nodiscard]] bool has(Vertex v) const { return vertex[0] == v || vertex[1] == v || vertex[2] == v; }
    [[nodiscard]] std::size_t place_of(Vertex v) const { return vertex[0] == v ? 0 : vertex[1] == v ? 1 : 2; }
    /// The corner opposite to an edge.
    [[nodiscard]] Vertex apex(Vertex a, Vertex b) const {
      return vertex[0] != a && vertex[0] != b ? vertex[0] : vertex[1] != a && vertex[1] != b ? vertex[1] : vertex[2];
    }
    [[nodiscard]] bool same_patch(const Triangle& t) const { return inner == t.inner && outer == t.outer; }
  };
  /// Those at an edge.
  struct Around {
    static constexpr std::size_t kMost = 12;
    std::array<std::uint32_t, kMost> triangle{};
    std::size_t count = 0;
    [[nodiscard]] std::span<const std::uint32_t> view() const { return {triangle.data(), count}; }
  };

  /// Meshes of bodies that share vertices and triangles bit by bit, as polygonise_partition makes them.
  PatchComplex(std::span<const FieldView> fields, std::span<const Mesh> meshes);

  [[nodiscard]] std::span<const Triangle> triangles() const { return triangle_; }
  [[nodiscard]] const Triangle& triangle(std::uint32_t t) const { return triangle_[t]; }
  [[nodiscard]] const Vec3& position(Vertex v) const { return position_[v]; }
  [[nodiscard]] std::span<const Vec3> positions() const { return position_; }
  [[nodiscard]] std::size_t vertex_count() const { return position_.size(); }  ///< those of none included
  [[nodiscard]] PatchPlace place(Vertex v) const { return place_[v]; }
  [[nodiscard]] std::span<const std::uint32_t> star(Vertex v) const { return star_[v]; }
  [[nodiscard]] std::array<Vec3, 3> corners(std::uint32_t t) const;

  [[nodiscard]] Around around(Vertex a, Vertex b) const;
  [[nodiscard]] bool joined(Vertex a, Vertex b) const { return around(a, b).count > 0; }
  /// Does a boundary curve run along an edge?
  [[nodiscard]] bool is_boundary(const Around& edge) const;
  [[nodiscard]] lattice::LabelSet labels(const Around& edge) const;
  [[nodiscard]] lattice::LabelSet labels(Vertex v) const;
  /// The other ends of the boundary curves at a vertex.
  [[nodiscard]] std::vector<Vertex> along_boundaries(Vertex v) const;

  void move(Vertex v, const Vec3& to) { position_[v] = to; }
  /// A vertex in the middle of a triangle. @return it
  Vertex split(std::uint32_t t, const Vec3& at);
  /// A vertex in the middle of an edge. @return it
  Vertex split(Vertex a, Vertex b, const Vec3& at);
  /// Flips the edge of two triangles of a patch.
  void flip(const Around& edge);
  /// Merges `from` into `to`; the triangles at the edge between them vanish.
  void collapse(Vertex from, Vertex to);

 private:
  void link(std::uint32_t t);
  void unlink(std::uint32_t t, Vertex v);
  void replace(std::uint32_t t, Vertex from, Vertex to);
  std::uint32_t add(const Triangle& t);

  std::vector<Vec3> position_;
  std::vector<PatchPlace> place_;
  std::vector<std::vector<std::uint32_t>> star_;
  std::vector<Triangle> triangle_;
};

}  // namespace supple::implicit
