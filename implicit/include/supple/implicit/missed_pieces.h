/// @file supple/implicit/missed_pieces.h
/// What a lattice misses of surfaces: closed pieces around no node, cavities in a body and islands beside it or in another body that
/// lie between the nodes. Space belongs to the largest of the bodies' claims and 0 (outside); in a piece, how far its claim leads all others has a
/// maximum: of one continuous function all over space (claim_bounds.h). So cubes are halved until bounds show who has all of a cube, or that there is no
/// such maximum in it: for a single body that its gradient does not vanish, for several that there is a direction along which the claim of each label
/// that is possible rises more than all others, or that outside there passes convex shapes. What is left has pieces nearby or remains undecided.
#pragma once

#include <cstdint>

#include "supple/implicit/field.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// Cells on which pieces are meshed are this part of a cell of the lattice; the smallest cubes are a quarter of them.
inline constexpr int kSearchParts = 16;

struct MissedPieces {
  std::uint64_t pieces = 0;     ///< found and added
  std::uint64_t joined = 0;     ///< nodes with which parts around an extremum hang together, by ways that the lattice does not resolve
  std::uint64_t undecided = 0;  ///< cells where a piece may be that was not found, and pieces that were not made
  std::uint64_t cubes = 0;      ///< whose bounds were looked at
  [[nodiscard]] bool complete() const noexcept { return undecided == 0; }
};

/// Appends to `mesh`, a surface of `field` on the nodes of `lattice`, the pieces of the surface that go around no node: closed,
/// oriented, with vertices on the surface and its normals. Pieces are told apart on a lattice of a 16th of the cell: where a
/// way to a node is thinner, its end counts as a piece; what lies between its nodes alone is undecided, or one with a part of its
/// sign that is nearer than its cell. With `undecided` zero no other piece is left; where fields have no bounds of second order
/// (Field::box_bounds: blends by gradients) all cells that the surface passes count there. The result does not depend on the number of threads. Nodes
/// have the signs of F in double precision. @throws Error{Limit} when the lattice has too many blocks, see find_surface_blocks.
MissedPieces add_missed_pieces(const Field& field, const Lattice& lattice, const Executor& executor, Mesh& mesh);

/// A body that divides space with others: it claims weight * F, and has what it claims most, above 0.
struct SearchedBody {
  const Field* field = nullptr;
  double weight = 1.0;  ///< > 0
};

/// The same for meshes of polygonise_partition, by body: a piece between two bodies is added to both, with the same points. Pieces
/// that meet two others or more are not made: they count as undecided.
MissedPieces add_missed_pieces(std::span<const SearchedBody> bodies, const Lattice& lattice, const Executor& executor,
                               std::span<Mesh> meshes);

}  // namespace supple::implicit
