/// @file patch_crossings.h
/// Where triangles of a PatchComplex pass through each other.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "patch_complex.h"

namespace supple::implicit {

/// Pairs of triangles of which an edge of one passes through the other by more than rounding, ascending; edges that end at a vertex of the
/// other triangle are left out.
[[nodiscard]] std::vector<std::array<std::uint32_t, 2>> find_crossings(const PatchComplex& complex);

}  // namespace supple::implicit
