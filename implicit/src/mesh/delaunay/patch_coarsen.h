/// @file patch_coarsen.h
/// Reduces a PatchComplex to few vertices that still show its patches and boundary curves.
#pragma once

#include "mesh/delaunay/patch_complex.h"
#include "mesh/delaunay/patch_surface.h"
#include "supple/implicit/delaunay.h"

namespace supple::implicit {

/// Takes out short edges and vertices beyond their patch or boundary curve, and takes vertices of boundary curves to them. Edges are Delaunay's afterwards.
void coarsen_patches(const PatchSurface& surface, const DelaunayOptions& options, PatchComplex& complex);

}  // namespace supple::implicit
