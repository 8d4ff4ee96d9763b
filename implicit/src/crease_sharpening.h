/// @file crease_sharpening.h
/// Puts a mesh of marching cubes onto the creases of its field.
#pragma once

#include <cstdint>
#include <span>

#include "crease_crossings.h"
#include "crease_points.h"
#include "march_leaves.h"
#include "supple/core/mesh.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// Puts a vertex onto the crease in every cell whose vertices belong to several nodes, turns edges that cross the crease, and cuts those
/// that still do (Kobbelt et al. 2001, "Feature sensitive surface extraction from volume data"; the crease itself is met here). What
/// crosses then is taken back.
/// @param whole    F   @param fields  F_k of the nodes   @param owner  of the vertices, by place in `fields`
/// @param changes  since the memory was last used   @param skip  as MarchOptions::skip
/// @return cells that keep a crease cut off
std::uint64_t sharpen(const FieldView& whole, std::span<const FieldView> fields, const Lattice& lattice, std::span<const std::uint32_t> owner,
                      bool skip, const march::ViewMemory& changes, CreaseMemory& memory, CrossingMemory& crossings, Mesh& mesh);

}  // namespace supple::implicit
