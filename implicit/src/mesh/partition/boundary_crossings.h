/// @file boundary_crossings.h
/// Points of boundary curves on edges of facets: between a vertex where a third label is largest and one where it is not, or between two vertices
/// where different labels are largest.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <tuple>
#include <vector>

#include "mesh/partition/boundary_facets.h"

namespace supple::implicit::lattice {

/// A point where three labels meet on an edge of facets.
struct Crossing {
  std::uint32_t a = 0, b = 0;  ///< its vertices, ascending
  LabelSet labels;
  std::uint32_t block = 0;
  std::uint16_t tetrahedron = 0;
  std::uint8_t face = 0;
  Label minus = 0, plus = 0;                       ///< F_plus - F_minus changes its sign
  Vec3 here = Vec3::Zero(), there = Vec3::Zero();  ///< from where it is negative, on the interface of the two other labels, or of each
  Junction found{};
  std::uint32_t before = kGone;  ///< number of its vertex in the last call

  [[nodiscard]] auto key() const { return std::tuple(a, b, labels.label); }
};

/// An edge of facets between labels low and high with ends where two different labels are largest.
struct TwiceCovered {
  enum class Kind : std::uint8_t { Unknown, Apart, Touching };  ///< Apart: low and high meet between them
  std::uint32_t a = 0, b = 0;                                   ///< its vertices, ascending
  Label low = 0, high = 0, at_a = 0, at_b = 0;
  std::uint32_t block = 0;
  std::uint16_t tetrahedron = 0;
  std::uint8_t face = 0;
  Kind kind = Kind::Unknown;

  [[nodiscard]] auto key() const { return std::tuple(a, b, low, high); }
};

/// Data of one call for the next, in the numbers of its vertices: points on boundary curves, and covered vertices with a single position.
struct KeptBoundaries {
  std::vector<Crossing> crossing;     ///< with the places and labels from which they were found left as they were
  std::vector<TwiceCovered> twice;
  std::vector<std::uint32_t> uncovered;
  std::vector<std::uint32_t> island;  ///< by vertex, see boundary_islands.h
};

class BoundaryCrossings {
 public:
  BoundaryCrossings(const BoundaryFacets& facets, const Lattice& lattice) : facets_(facets), lattice_(lattice) {}

  /// Finds all crossings.
  void find(const Executor& executor);
  /// Adds vertices at them after all others, and removes these.
  void add_vertices();
  void remove_vertices();
  /// Adds results of the last call, in the numbers of this one. @pre no vertices are added
  void add_kept(const KeptBoundaries& kept);
  void count(PolygoniseCounts& counts) const;
  [[nodiscard]] const std::vector<Crossing>& crossings() const { return crossing_; }
  [[nodiscard]] const std::vector<TwiceCovered>& twice() const { return twice_; }
  /// The vertex on the edge between two others where three labels meet. @pre there is one
  [[nodiscard]] std::uint32_t crossing_of(std::uint32_t v, std::uint32_t w, const std::array<Label, 3>& labels) const;
  /// The vertex on an edge where a third label meets two for which the edge has no end that is covered, if there is one.
  [[nodiscard]] std::optional<std::uint32_t> crossing_for_others(std::uint32_t v, std::uint32_t w, Label low, Label high) const;
  /// Data of an edge with ends where different labels are largest. @pre they are
  [[nodiscard]] TwiceCovered::Kind kind_of(std::uint32_t v, std::uint32_t w, Label low, Label high) const;
  /// The first vertex that was added.
  [[nodiscard]] std::uint32_t first_vertex() const { return first_; }

 private:
  struct EdgePlace {
    std::uint32_t block;
    std::uint16_t tetrahedron;
    std::uint8_t face;
  };
  /// Vertices a and b on the interface of two labels, and the label `by` that is largest at one of them.
  struct LoneCover {
    std::uint32_t a, b;
    Label low, high, by;
    bool wins_at_b;
  };
  /// The point of the interface from which the label is largest.
  [[nodiscard]] Crossing lone_crossing(const LoneCover& cover, const EdgePlace& at) const;
  /// Where the labels that are largest at the ends meet on the interface with one more label, `beside`.
  [[nodiscard]] Crossing touching(const TwiceCovered& t, Label beside) const;
  /// The kind of split of an edge: both of its points are exact, and none of the four labels is larger there.
  [[nodiscard]] std::array<Crossing, 2> look_between(TwiceCovered& t) const;
  /// The value at a point where labels meet.
  [[nodiscard]] double level(const LabelSet& labels, const Vec3& point) const;
  void solve(Crossing& c) const;
  void sort_crossings();
  /// The face or the tetrahedron that holds an edge.
  [[nodiscard]] Simplex simplex_of(const Crossing& c) const;
  void add_uses(const LabelSet& labels, const Vec3& point);

  const BoundaryFacets& facets_;
  Lattice lattice_;
  std::vector<Crossing> crossing_;   ///< by vertices and labels, ascending
  std::vector<TwiceCovered> twice_;  ///< by vertices and labels, ascending
  std::uint32_t first_ = 0;          ///< vertex of the first of them
};

/// The lowest body of those that meet, `body` excepted, as VertexUse has it.
[[nodiscard]] std::uint32_t contact_of(const LabelSet& labels, std::uint32_t body);

}  // namespace supple::implicit::lattice
