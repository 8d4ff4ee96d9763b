/// @file supple/implicit/missed_pieces.h
/// Pieces of surfaces that a lattice misses: closed pieces around no node, cavities in a body and islands beside it or in another body that
/// lie between the nodes. Each point belongs to the body with the largest weighted field, or to outside where all weighted fields are below 0. Within a piece the
/// lead of its weighted field over all others has a maximum, of one continuous function over space (weighted_bounds.h). So cubes are halved until bounds
/// prove that a cube belongs to one label, or that there is no such maximum in it: for a single body because its gradient does not vanish, for several
/// because there is a direction along which the weighted field of each possible label rises more than all others, or because a line to outside passes convex
/// shapes. The remaining cubes have pieces nearby or are undecided.
#pragma once

#include <cstdint>

#include "supple/implicit/field.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// Cells on which pieces are meshed, over a cell of the lattice; the smallest cubes are a quarter of them.
inline constexpr int kSearchParts = 16;

struct MissedPieces {
  std::uint64_t pieces = 0;     ///< found and added
  std::uint64_t joined = 0;     ///< nodes that are connected to regions around an extremum by passages that the lattice does not resolve
  std::uint64_t undecided = 0;  ///< cells where a piece may be missing, and pieces that were found but not meshed
  std::uint64_t cubes = 0;      ///< cubes whose bounds were evaluated
  [[nodiscard]] bool complete() const noexcept { return undecided == 0; }
};

/// Appends to `mesh`, a surface of `field` on the nodes of `lattice`, the pieces of the surface that enclose no node: closed,
/// oriented, with vertices on the surface and its normals. Pieces are separated on a lattice of a 16th of the cell: where a
/// passage to a node is thinner, its end counts as a piece; a piece between the nodes of that lattice is undecided, or merged with a region of
/// the same sign closer than its cell. With `undecided` zero no other piece is missing; where fields have no bounds of second order
/// (Field::box_bounds: blends by gradients) all cells with surface count as undecided. The result does not depend on the number of threads. Nodes
/// have the signs of F in double precision. @throws Error{Limit} when the lattice has too many blocks, see find_surface_blocks.
MissedPieces add_missed_pieces(const Field& field, const Lattice& lattice, const Executor& executor, Mesh& mesh);

/// A body that divides space with others: its weighted field is weight * F, and a point belongs to the body with the largest weighted field above 0.
struct SearchedBody {
  const Field* field = nullptr;
  double weight = 1.0;  ///< > 0
};

/// The same for meshes of polygonise_partition, by body: a piece between two bodies is added to both, with the same points. Pieces
/// that meet two others or more are not meshed and count as undecided.
MissedPieces add_missed_pieces(std::span<const SearchedBody> bodies, const Lattice& lattice, const Executor& executor,
                               std::span<Mesh> meshes);

}  // namespace supple::implicit
