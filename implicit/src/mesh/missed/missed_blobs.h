/// @file missed_blobs.h
/// Where sums of Wyvill points may have pieces of surface between the nodes of a lattice, settled by many cubes at a
/// time (cube_lanes.h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/partition/polygonise_lattice.h"
#include "supple/core/executor.h"
#include "supple/implicit/field.h"

namespace supple::implicit {

/// Cells of a block of 8^3.
struct OpenCells {
  lattice::BlockCoord block{};
  std::vector<std::array<std::uint8_t, 3>> cell;  ///< from its lowest
};

/// Whether find_open_cells can do it.
[[nodiscard]] bool is_sum_of_blobs(const Field& field);

/// The cells that are not known to be free of an extremum of F whose sign is not that around it; all others are. In z,
/// y, x order of the blocks, cells along a Morton curve. @param cubes counts those that were looked at @pre
/// is_sum_of_blobs(field) @throws Error{Limit} before taking memory, as march_cubes does
[[nodiscard]] std::vector<OpenCells> find_open_cells(const Field& field, const Lattice& lattice,
                                                     const Executor& executor, std::uint64_t& cubes);

}  // namespace supple::implicit
