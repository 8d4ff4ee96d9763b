/// @file flat_cells.h
/// Cells for overlaps with a thin body: as long as the other body's features along its faces, as short as its own across them.
#pragma once

#include <optional>

#include "surface/pair_pressure.h"

namespace supple::collision {

struct FlatCells {
  Vec3 across = Vec3::UnitZ();  ///< normal of the faces, unit
  double stretch = 1.0;         ///< length over thickness
};

/// @param overlap  finite   @return nothing where no body is thin beside the other, or where its faces do not lie alike in most of the overlap
[[nodiscard]] std::optional<FlatCells> flat_cells(PairPressure& pressure, const Box& overlap);

}  // namespace supple::collision
