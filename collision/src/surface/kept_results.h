/// @file kept_results.h
/// Results of pairs are kept from one query to the next for their memory, of which there is a most: a few deep contacts at a small error take
/// tens of megabytes each, which would otherwise be held for good.
#pragma once

#include <cstddef>
#include <span>

#include "surface/pair_result.h"

namespace supple::collision {

/// Pairs are solved, joined and reacted to in portions, so that what one step leaves is still near for the next; a thread takes so many of them together.
inline constexpr std::size_t kPortion = 512, kPairsTogether = 4;

/// Memory of the arrays of a patch [byte].
[[nodiscard]] inline std::size_t room_of(const PatchPoints& points) {
  const auto bytes = [](const auto&... arrays) { return (std::size_t{0} + ... + (arrays.capacity() * sizeof(arrays[0]))); };
  return bytes(points.point, points.normal, points.area, points.pressure, points.volume_point, points.volume_weight, points.volume_side);
}

/// Empties the points of each result that does not fit into `most` bytes beside those before it. No value of a later query depends on it.
inline void keep_room(std::span<PairResult> results, std::size_t most) {
  std::size_t kept = 0;
  for (PairResult& result : results) {
    const std::size_t room = room_of(result.points);
    if (kept + room > most) {
      result.points = {};
    } else {
      kept += room;
    }
  }
}

}  // namespace supple::collision
