/// @file field_changes.h
/// Where a field may have other values than in the last call.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/field_index.h"
#include "supple/core/content_versions.h"

namespace supple::implicit {

/// Points whose values depend on a primitive: within sqrt(reach2) of the box [lower, upper], and in `whole`.
struct Reach {
  RoundedBox rounded;
  Box whole;
  /// Whether it meets a closed box; never false where a point of the box is in reach of the primitive.
  [[nodiscard]] bool meets(const Box& box) const {
    double off2 = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      const double off = std::max({rounded.lower[k] - box.upper[axis], box.lower[axis] - rounded.upper[k], 0.0});
      off2 += off * off;
    }
    return off2 <= rounded.reach2;
  }
};

/// A value depends on the primitives whose supports reach the point, on the blend and on the iso value, on nothing else. Primitives are
/// known by their numbers: what is taken out from between others makes all behind it different.
class FieldChanges {
 public:
  /// Compares a field with that of the last call, bit by bit.
  void update(const Field::Index& index);
  /// The next call has no last one.
  void forget() { known_ = false; }
  /// Whether values may be different anywhere, or too many primitives are for it to matter where.
  [[nodiscard]] bool all() const { return all_; }
  /// Of the primitives that are different, as they were and as they are.
  [[nodiscard]] std::span<const Reach> reaches() const { return reaches_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  /// All data of the primitives of a field.
  struct Content {
    ContentWords words;
    std::vector<std::size_t> end;  ///< of the words of a primitive, by id
    std::vector<Reach> reach;      ///< by id
    void fill(const Field::Index& index);
    [[nodiscard]] std::span<const std::uint64_t> of(std::size_t id) const {
      const std::size_t begin = id == 0 ? 0 : end[id - 1];
      return words.view().subspan(begin, end[id] - begin);
    }
  };

  Content last_, now_;
  double iso_ = 0.0;
  BlendIndex blend_;
  bool known_ = false, all_ = true;
  std::vector<Reach> reaches_;
};

}  // namespace supple::implicit
