/// @file supple/implicit/mesh_limits.h
/// Checks whether meshes and grids would be refused for their size, by the same limits, before anything is sampled (except where an error
/// is given). Where the bounding box of a surface has few enough blocks nothing else is checked.
#pragma once

#include <cstdint>
#include <span>

#include "supple/core/executor.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {

/// @throws Error{Limit} as CubeMesher::make without options.error, and march_creases
void expect_marchable(const FieldView& field, const Lattice& lattice, const Executor& executor);
/// @throws Error{Limit} as polygonise_partition and, for one field, polygonise
void expect_divisible(std::span<const FieldView> fields, const Lattice& lattice, const Executor& executor);
/// @throws Error{Limit} as polygonise_partition_within, as far as that follows from meshes of at most about most_blocks, which are made.
void expect_divisible_within(std::span<const FieldView> fields, const Lattice& coarsest, const PartitionError& error, const Executor& executor,
                             std::uint64_t most_blocks);
/// @throws Error{Limit} as make_surface_grid
void expect_griddable(const FieldView& field, const GridOptions& options, const Executor& executor);

}  // namespace supple::implicit
