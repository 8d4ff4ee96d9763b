/// @file field_lanes.h
/// The vector loops of the field, compiled for AVX2 and AVX-512 and chosen at run time. Lanes hold points and never
/// exchange values, every product that is summed is an explicit fma, and a point's sum runs in id order: the width of
/// the vectors cannot change a bit, and neither can a candidate that contributes an exact zero.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "field/field_index.h"

namespace supple::implicit::lanes {

/// Points that are processed together when a batch is divided into groups.
inline constexpr std::size_t kBlock = 16;
/// Ids may be written this far beyond the end of a list.
inline constexpr std::size_t kSpill = kPack;

struct Primitives {
  const PackedPrimitive* primitive;
  const PackedShape* shape;
  double iso;
  bool uniform;  ///< all are of one kind
};

/// Axis-aligned box as plain numbers.
struct Bounds {
  double lower[3];
  double upper[3];
};

/// The box of n points. @pre n > 0
[[nodiscard]] Bounds bounds_of(const Vec3* points, std::size_t n) noexcept;

/// Ids of the packs' supports that may meet `box`, in pack order. @param ids  room for 8 pack_count + kSpill
/// @return how many
[[nodiscard]] std::size_t filter(const LeafPack* pack, std::size_t pack_count, const Bounds& box, std::uint32_t* ids);

/// Sets a bit for each primitive of the hierarchy whose support may meet `box`, and in `summary` a bit for each word.
void collect(const Field::Index& index, const Bounds& box, std::uint64_t* bits, std::uint64_t* summary);

/// Points and where what is found there goes.
struct Batch {
  const Vec3* points;
  std::size_t count;
  double* values;
  Vec3* gradients;  ///< null: none is asked for
};

/// F (and grad F) at points from the given primitives, summed in the order of `ids`.
void evaluate_ids(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at);

/// As above, the candidates filtered from the packs anew for every few points (two vectors).
/// @param ids  scratch, room for 8 packs.size() + kSpill
/// @return kernel evaluations made
std::uint64_t evaluate_packs(const Primitives& in, std::span<const LeafPack> packs, std::uint32_t* ids, const Batch& at);

/// f and grad f of each primitive alone at at most kPack points: values[kPack i + j] belongs to ids[i] and points[j],
/// likewise gradients[(kPack i + j)].
void evaluate_each(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at);

/// Sums over the primitives that a box touches.
struct BoundSums {
  double lower = 0.0;  ///< of the least f
  double upper = 0.0;  ///< of the largest f
  double slope = 0.0;  ///< of the largest |grad f| [1/m]; only when requested
  double slope_scale = 0.0;  ///< of the largest |grad f| anywhere, for round-off
  double scale = 0.0;  ///< of f(0), for round-off
  double terms = 0.0;  ///< how many were added
};

/// Bounds of a body of Wyvill points on a box. @pre all primitives are PointWyvill
[[nodiscard]] BoundSums bound_points(const Field::Index& index, const Bounds& box, bool with_slope);

}  // namespace supple::implicit::lanes
