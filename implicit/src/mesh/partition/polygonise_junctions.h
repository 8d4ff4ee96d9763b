/// @file polygonise_junctions.h
/// Points where three or four labels meet: on a triangular face of the lattice's tetrahedra, or inside one.
/// Label 0 is outside, label m + 1 is body m.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "mesh/partition/polygonise_lattice.h"

namespace supple::implicit::lattice {

using Label = std::uint32_t;

/// Distinct labels of a simplex, ascending.
struct LabelSet {
  std::array<Label, 4> label{};
  std::uint8_t count = 0;

  void insert(Label l) {
    std::uint8_t at = 0;
    while (at < count && label[at] < l) ++at;
    if (at < count && label[at] == l) return;
    for (std::uint8_t k = count; k > at; --k) label[k] = label[k - 1];
    label[at] = l;
    ++count;
  }
  [[nodiscard]] std::span<const Label> view() const { return {label.data(), count}; }
  [[nodiscard]] bool has(Label l) const { return std::find(label.begin(), label.begin() + count, l) != label.begin() + count; }
  [[nodiscard]] LabelSet with(Label l) const {
    LabelSet set = *this;
    set.insert(l);
    return set;
  }
};

/// A simplex of the lattice: `corners` of the cell whose lowest node is at `low` and whose opposite node is at `high`,
/// each corner a subset of the next, with the label of each.
struct Simplex {
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();
  std::array<std::uint8_t, 4> corner{};
  std::array<Label, 4> label{};
  std::uint8_t size = 0;  ///< 3: a face, 4: a tetrahedron
};

[[nodiscard]] Vec3 corner_of(const Simplex& simplex, std::size_t k);
/// The face of a tetrahedron opposite to a corner, where three labels meet on it.
[[nodiscard]] std::optional<Simplex> face_of(const Simplex& tetrahedron, std::size_t opposite);

struct Junction {
  Vec3 point = Vec3::Zero();
  double residual = 0.0;  ///< largest difference of the fields that should be equal [1]
  bool exact = false;     ///< every label's condition holds; otherwise only F_a = F_b of the two lowest bodies
};

/// The point of the simplex where all labels meet, by Newton's method from `start`; not exact where it is not found inside.
[[nodiscard]] Junction meet_inside(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels,
                                   const Vec3& start, double scale);

/// The same for three labels where that fails: in a tetrahedron along the boundary curve from where it enters, then from other places.
[[nodiscard]] Junction search_inside(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels, double scale);

/// The point between `from`, where F_a >= F_b, and `to`, where F_a <= F_b, with F_a = F_b (outside has F = 0).
[[nodiscard]] Junction root_between(std::span<const FieldView> fields, Label a, Label b, const Vec3& from, const Vec3& to,
                                    double scale);

/// The point of the simplex where all its labels meet: F = 0 of every body when outside is among them, else equal
/// fields. Newton's method from `start`, which lies inside the simplex. When that point lies beyond the simplex: where the
/// way to it leaves the simplex, taken to F_a = F_b of the two lowest bodies. The point is always inside the simplex.
[[nodiscard]] Junction find_junction(std::span<const FieldView> fields, const Simplex& simplex, const LabelSet& labels,
                                     const Vec3& start, double scale);

/// The outward normal of `body` at a point between these labels: of its own field where outside is among them, else
/// away from all other bodies.
[[nodiscard]] Vec3 normal_at(std::span<const FieldView> fields, const LabelSet& labels, std::uint32_t body,
                             const Vec3& point);

}  // namespace supple::implicit::lattice
