/// @file bytes_of.h
/// Memory of containers.
#pragma once

#include <cstdint>
#include <vector>

#include "supple/core/mesh.h"

namespace supple::implicit {

template <class T>
[[nodiscard]] std::uint64_t bytes_of(const std::vector<T>& items) {
  return items.capacity() * sizeof(T);  // NOLINT: items may be pointers
}

[[nodiscard]] inline std::uint64_t bytes_of(const Mesh& mesh) { return bytes_of(mesh.position) + bytes_of(mesh.normal) + bytes_of(mesh.triangle); }

}  // namespace supple::implicit
