/// @file crease_sharpening.h
/// A mesh of marching cubes is put onto the creases of its field.
#pragma once

#include <cstdint>
#include <span>

#include "mesh/creases/crease_crossings.h"
#include "mesh/creases/crease_points.h"
#include "mesh/cubes/march_leaves.h"
#include "supple/core/mesh.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// A field with creases, and whose vertices a mesh of it has.
struct CreasedField {
  const FieldView& whole;                ///< F
  std::span<const FieldView> fields;     ///< F_k of the nodes
  const Lattice& lattice;
  std::span<const std::uint32_t> owner;  ///< of the vertices, by place in `fields`
  bool skip = true;                      ///< as MarchOptions::skip
};

struct Sharpened {
  std::uint64_t blunt_cells = 0;  ///< that keep a crease cut off
  std::size_t on_creases = 0;     ///< vertices, the last ones of the mesh
};

/// Puts a vertex onto the crease in every cell whose vertices belong to several nodes, turns edges that cross the crease, and cuts those
/// that still do (Kobbelt et al. 2001, "Feature sensitive surface extraction from volume data"; the crease itself is met here). What
/// crosses then is taken back.
/// @param changes  since the memory was last used
Sharpened sharpen(const CreasedField& field, const march::ViewMemory& changes, CreaseMemory& memory, CrossingMemory& crossings,
                      Mesh& mesh);

}  // namespace supple::implicit
