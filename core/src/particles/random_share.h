#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "supple/core/hash.h"

namespace supple::core {

/// Uniform in [0, 1), by key and number of the draw alone.
inline double random_share(std::uint64_t key, std::uint64_t draw) {
  const std::array<std::uint64_t, 2> words{key, draw};
  return static_cast<double>(hash_bytes(std::as_bytes(std::span(words))) >> 11) * 0x1p-53;
}

}  // namespace supple::core
