/// @file supple/collision/find_contacts.h
/// Stage 5: which bodies may touch, and where to look. First the boxes of {F >= 0}, then the surface samples: a sample of
/// A with p_B near or above 0 is a candidate. The candidates are only starting points; their number changes no force.
#pragma once

#include "supple/collision/bodies.h"
#include "supple/core/executor.h"

namespace supple::collision {

struct ContactCandidates {
  std::vector<BodyPair> pair;          ///< sorted, shape [pairs]
  std::vector<Box> overlap;            ///< intersection of the two surface boxes [m], shape [pairs]
  std::vector<std::uint32_t> offset;   ///< seeds of pair k are [offset[k], offset[k+1]), shape [pairs + 1]
  std::vector<Vec3> seed;              ///< world points [m]
  std::vector<double> spacing;         ///< of the coarser samples of the two bodies [m], 0: none; shape [pairs]
  /// 1: both bodies are convex, so that their overlap is one piece with one peak; its only seed lies between their cores.
  std::vector<std::uint8_t> convex;    ///< shape [pairs]
};

/// Pairs of boxes that overlap, by sweep and prune along the longest axis, in columns across the others; sorted.
/// Empty boxes overlap nothing.
[[nodiscard]] std::vector<BodyPair> overlapping_boxes(std::span<const Box> boxes, const Executor& executor);

/// The same for boxes that move little from call to call: pairs of boxes with a margin serve until a box has left its own
/// (Verlet 1967).
class OverlapList {
 public:
  /// @param out  what `overlapping_boxes` gives
  void find(std::span<const Box> boxes, const Executor& executor, std::vector<BodyPair>& out);

 private:
  std::vector<Box> wide_;       // boxes with their margins
  std::vector<BodyPair> near_;  // which of these overlap
};

/// Pairs whose surface boxes overlap and that may touch, sorted: for bodies that the caller owns, of whom no list is kept.
[[nodiscard]] std::vector<BodyPair> broad_phase(std::span<const ContactBody> bodies, const ContactRules& rules,
                                                const Executor& executor);

/// Stage 5. Needs the samples of stage 4 for the bodies of the broad phase, but not of pairs of convex bodies. A sample is a seed when the other surface is,
/// to first order, at most one sample spacing away. Pairs that have samples but no seed are left out, and convex ones whose
/// cores are farther apart than both surfaces reach; pairs without any samples are kept and searched by stage 6.
void find_contacts(std::span<const ContactBody> bodies, std::span<const BodyPair> pairs, const Executor& executor,
                   ContactCandidates& out);

}  // namespace supple::collision
