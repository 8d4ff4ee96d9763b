/// @file same_triangles.h
/// Common parts of two meshes, to the bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/mesh.h"

namespace supple::implicit {

inline constexpr std::uint32_t kNoneSame = ~std::uint32_t{0};

/// For each vertex of a mesh one of another mesh with the same position and normal; kNoneSame where there is none.
[[nodiscard]] std::vector<std::uint32_t> same_vertices(const Mesh& mesh, const Mesh& other);

/// For each triangle of a mesh one of another mesh with the same corners in the same order; kNoneSame where there is none.
/// @param vertex  of the other mesh, by vertex of the first one
[[nodiscard]] std::vector<std::uint32_t> same_triangles(const Mesh& mesh, const Mesh& other, std::span<const std::uint32_t> vertex);

}  // namespace supple::implicit
