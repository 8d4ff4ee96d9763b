/// @file supple/implicit/even_samples.h
/// Samples of a surface at an even spacing, each riding on the part that holds it: they stay themselves while the body moves
/// and deforms, some are added where the surface stretches and taken away where it shrinks (after Witkin & Heckbert 1994;
/// instead of their repulsion the spacing is kept by distances alone, as in Poisson-disc sampling).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/types.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {

/// Index s is the same sample in every array; samples are in the order of their ids.
struct EvenSampleSet {
  std::vector<std::uint64_t> id;     ///< never given twice
  std::vector<std::uint32_t> part;   ///< with the largest share of the field there
  std::vector<Vec3> local;           ///< place in the part's frame [m]
  std::vector<Vec3> point;           ///< on F = 0 [m]
  std::vector<Vec3> normal;          ///< unit, outward
  [[nodiscard]] std::size_t size() const noexcept { return id.size(); }
};

struct EvenSampleCounts {
  std::uint64_t kept = 0, added = 0, removed = 0;
  bool remade = false;  ///< the surface has another number of parts or holes than at the last call
};

class EvenSampler {
 public:
  /// @param spacing  d [m]: no two samples are nearer than d/2, and no point of the surface that a lattice of cells d/6 sees
  /// is farther than d from all of them   @pre d > 0
  explicit EvenSampler(double spacing);

  /// Samples of the body as it is now; valid until the next call. Kept samples are carried by their parts and projected
  /// onto the surface. After a change of topology all are made anew, with new ids.
  /// @param parts  world poses, shape [part_count]
  const EvenSampleSet& update(const Field& field, std::span<const Pose> parts, const Executor& executor,
                              EvenSampleCounts* counts = nullptr);

 private:
  double spacing_;
  CubeMesher mesher_;
  EvenSampleSet set_;
  std::uint64_t next_id_ = 0;
  std::size_t components_ = 0;
  long euler_ = 0;
};

}  // namespace supple::implicit
