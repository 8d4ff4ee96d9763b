/// @file supple/scenes/division.h
/// Division of space between bodies that touch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/deformed_field.h"

namespace supple::scenes {

/// Bodies that contact divides from each other, and pieces of one object that still overlap, with their deformed pressures (docs/notation.md).
struct Division {
  std::vector<std::uint32_t> body;             ///< ascending
  std::vector<collision::BodyPair> pair;       ///< which of them divide each other
  std::vector<collision::ContactBody> placed;  ///< all bodies, the fixed ones last; deformed pressures view it
  std::vector<collision::DeformedPressure> pressure;  ///< of each `body`
  std::vector<std::vector<std::size_t>> excluded;  ///< for each `body`: the bodies in reach that it never touches and passes through, ascending; empty: none for any body
  /// Whether body[k] passes through another one.
  [[nodiscard]] bool passes(std::size_t k) const { return !excluded.empty() && !excluded[k].empty(); }
  /// The deformed pressures that can reduce the region of body[k].
  [[nodiscard]] std::vector<std::size_t> others_of(std::size_t k) const;
  Division() = default;
  Division(Division&&) = default;
  Division& operator=(Division&&) = default;
};

}  // namespace supple::scenes
