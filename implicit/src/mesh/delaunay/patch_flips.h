/// @file patch_flips.h
/// Delaunay's criterion within patches: edges between two triangles of one patch are flipped until the angles opposite to them add up to
/// pi at most, as long as nothing folds.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/delaunay/patch_complex.h"

namespace supple::implicit {

using PatchEdge = std::array<PatchComplex::Vertex, 2>;

/// Those edges, and those around flips. @param changed  flipped triangles are added
void flip_edges(PatchComplex& complex, std::vector<PatchEdge> edges, std::vector<std::uint32_t>& changed);
/// All edges, and those of the triangles around a vertex.
void flip_all(PatchComplex& complex);
void flip_around(PatchComplex& complex, PatchComplex::Vertex v);

}  // namespace supple::implicit
