/// @file patch_coarsen.h
/// A PatchComplex with as few vertices as show what its patches and rims are.
#pragma once

#include "mesh/delaunay/patch_complex.h"
#include "mesh/delaunay/patch_surface.h"
#include "supple/implicit/delaunay.h"

namespace supple::implicit {

/// Takes out short edges and vertices beyond their patch or rim, and takes vertices of rims to them. Edges are Delaunay's afterwards.
void coarsen_patches(const PatchSurface& surface, const DelaunayOptions& options, PatchComplex& complex);

}  // namespace supple::implicit
