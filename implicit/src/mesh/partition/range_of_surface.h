/// @file range_of_surface.h
/// Where the blocks of a surface lie, without a list of them.
#pragma once

#include <optional>

#include "mesh/partition/polygonise_blocks.h"

namespace supple::implicit::lattice {

/// The smallest range that holds the blocks of surface_blocks(). Of each side, the outermost boxes are halved first, so that most blocks are not looked at.
/// @return none without blocks, and where a side is not found quickly, as on large flat faces
/// @throws Error like block_range()
[[nodiscard]] std::optional<BlockRange> range_of_surface(const FieldView& field, const Lattice& lattice);

}  // namespace supple::implicit::lattice
