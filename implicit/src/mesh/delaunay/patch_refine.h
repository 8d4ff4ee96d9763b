/// @file patch_refine.h
/// Vertices for the bad triangles of a PatchComplex: circumcentres, taken to the surface (Chew 1993), and points of the boundary curves that these
/// would come too near to (Ruppert 1995).
#pragma once

#include <span>

#include "mesh/delaunay/patch_complex.h"
#include "mesh/delaunay/patch_surface.h"
#include "supple/implicit/delaunay.h"

namespace supple::implicit {

/// Where triangles must be nearer to the surface than elsewhere.
struct NearerPlace {
  Box box;
  double distance = 0.0;  ///< [m], in place of DelaunayOptions::distance
};

/// Adds vertices until angle, size and distance hold, except for sharper angles between boundary curves.
/// @return false where edges become ever shorter
/// @param nearer  for a triangle whose box overlaps several, the least applies
/// @param report  counts of inserted vertices are added
/// @param estimate  for the words of a refusal
/// @throws Error{Limit} when most_vertices do not reach the bounds
[[nodiscard]] bool refine_patches(const PatchSurface& surface, const DelaunayOptions& options, const DelaunayEstimate& estimate,
                                  std::span<const NearerPlace> nearer, PatchComplex& complex, DelaunayReport& report);

}  // namespace supple::implicit
