/// @file supple/implicit/even_samples.h
/// Samples of a surface at an even spacing, each moving with a part: they keep their identity while the body moves
/// and deforms; samples are added where the surface stretches and removed where it shrinks (after Witkin & Heckbert 1994;
/// instead of their repulsion the spacing is kept by distances, as in Poisson-disc sampling).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/types.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {

/// The samples of one body; index s is the same sample in every array, and samples are in the order of their ids.
struct EvenSampleSet {
  std::vector<std::uint64_t> id;
  std::vector<std::uint32_t> part;   ///< the part with the largest share of the field there
  std::vector<Vec3> local;           ///< position in the part's frame [m]
  std::vector<Vec3> point;           ///< on F = 0 [m]
  std::vector<Vec3> normal;          ///< unit, outward
  std::vector<double> area;          ///< of the surface region closer to it than to the other samples of its side [m^2]
  std::size_t components = 0;        ///< of the surface they were last fitted to
  long euler_characteristic = 0;     ///< of that surface
  [[nodiscard]] std::size_t size() const noexcept { return id.size(); }
};

struct EvenSampleCounts {
  std::uint64_t kept = 0, added = 0, removed = 0;
  bool remade = false;  ///< the surface has another number of parts or holes than at the last call
};

/// Fits the samples of any number of bodies to their surfaces, repeatedly.
class EvenSampler {
 public:
  /// @param spacing  d [m]: no two samples are nearer than d/2, and no point of the surface on the lattice of cell()
  /// is farther than d from all of them; samples whose normals are more than a right angle apart, as on the two sides of a
  /// sheet, do not count for each other   @pre d > 0
  explicit EvenSampler(double spacing);

  /// Moves the samples of a body to its present surface; an empty set is filled. Kept samples are carried by their
  /// parts and projected onto the surface. After a change of topology all are new. New samples get ids that this
  /// sampler has not used before. Areas sum to that of the lattice's mesh.
  /// @param parts  world poses, shape [part_count]
  EvenSampleCounts update(const Field& field, std::span<const Pose> parts, const Executor& executor, EvenSampleSet& set);
  /// Cells of the lattice on which the surface of a field is found [m]: d/6, or half its feature size where that is less, so
  /// that thin sheets and small balls are found for any spacing.
  [[nodiscard]] double cell(const Field& field) const;
  [[nodiscard]] bool is_cell_of_feature(const Field& field) const;
  /// @throws Error{Limit} as update() would of this field
  void expect_size(const Field& field, const Executor& executor) const;

 private:
  double spacing_;
  CubeMesher mesher_;
  std::uint64_t next_id_ = 0;
};

/// The spacing at which a large smooth surface gets about this many samples per square metre: 1.28 / sqrt(density).
[[nodiscard]] double even_spacing(double density);

}  // namespace supple::implicit
