/// @file supple/implicit/missed_pieces.h
/// What a lattice misses of a surface: closed pieces around no node, cavities in the body and islands beside it that lie between
/// the nodes. Inside each F has an extremum; so cubes are halved until bounds show that F keeps its sign on them or its gradient
/// does not vanish, and what is left has pieces nearby or remains undecided.
#pragma once

#include <cstdint>

#include "supple/implicit/field.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// Cells on which pieces are meshed are this part of a cell of the lattice; the smallest cubes are a quarter of them.
inline constexpr int kSearchParts = 16;

struct MissedPieces {
  std::uint64_t pieces = 0;     ///< found and added
  std::uint64_t joined = 0;     ///< parts that hang together with what has nodes, by a way that the lattice does not resolve
  std::uint64_t undecided = 0;  ///< cells where a piece may be that was not found
  std::uint64_t cubes = 0;      ///< whose bounds were looked at
  [[nodiscard]] bool complete() const noexcept { return undecided == 0; }
};

/// Appends to `mesh`, a surface of `field` on the nodes of `lattice`, the pieces of the surface that go around no node: closed,
/// oriented, with vertices on the surface and its normals. Pieces are told apart on a lattice of a 16th of the cell: where a
/// way to a node is thinner, its end counts as a piece; what lies between its nodes alone is undecided, or one with a part of its
/// sign that is nearer than its cell. With `undecided` zero no other piece is left; where fields have no bounds of second order
/// (Field::box_bounds) all cells that the surface passes count there. The result does not depend on the number of threads. Nodes
/// have the signs of F in double precision. @throws Error{Limit} when the lattice has too many blocks, see find_surface_blocks.
MissedPieces add_missed_pieces(const Field& field, const Lattice& lattice, const Executor& executor, Mesh& mesh);

}  // namespace supple::implicit
