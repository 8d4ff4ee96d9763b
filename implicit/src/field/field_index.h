/// @file field_index.h
/// The data of a Field: the primitives packed for evaluation, and a packed 8-ary hierarchy of bounding boxes over them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "field/blend.h"
#include "skeleton/shapes.h"
#include "supple/implicit/field.h"

namespace supple::implicit {

/// Shapes as the evaluation distinguishes them. Segment, rectangle, box and ellipsoid are all Slab: with y = A (x - p),
/// the vector from the foot point is v = y - clamp(y, -half, half) and q = |v|^2. For an ellipsoid half = 0 and
/// A = R D^-1 Q^T, otherwise A = S^-1 Q^T with the stretch S. The common pairs of shape and kernel have loops of their own.
enum class PackedKind : std::uint32_t {
  PointWyvill, PointGascuel, SlabWyvill, SlabGascuel, DiscWyvill, DiscGascuel,
  General,  ///< any foot with any kernel
};
/// How the foot point of a general primitive is found.
enum class PackedFoot : std::uint8_t { Slab, Disc, Scalar, Convolved };

/// Data of a primitive for the inner loop; one cache line.
struct alignas(64) PackedPrimitive {
  std::array<double, 3> position{};  ///< p [m]
  double inverse_r2 = 0.0;           ///< 1 / R^2 [1/m^2]
  double gradient_factor = 0.0;      ///< Wyvill: -6 / R^2, so that grad f = factor t^2 A^T v
  PackedKind kind = PackedKind::PointWyvill;
  std::uint32_t part = 0;
};

/// Further data of all but Wyvill points.
struct PackedShape {
  std::array<double, 9> to_local{};  ///< A, row by row
  std::array<double, 3> half{};      ///< [m]; a disc keeps its radius in half[0]
  Kernel kernel;
  double outer_cubic = 0.0;     ///< Gascuel: iso D
  double outer_square = 0.0;    ///< Gascuel: iso / (R - e)^2
  double distance_scale = 1.0;  ///< largest |grad d|, see skeleton.h
  double peak = 0.0;            ///< f(0)
  double lipschitz = 0.0;       ///< largest |grad f| [1/m]
  PackedFoot foot = PackedFoot::Slab;
  ShapeView view;               ///< of y = A (x - p); an ellipsoid is a point there
  Vec3 rounding = Vec3::Zero();  ///< how far the kernel widens the shape along the world axes, on each side [m]
};

/// The support of a primitive, {f > 0}, lies within `reach` of the box [lower, upper]; a point's box is the point.
struct alignas(64) RoundedBox {
  std::array<double, 3> lower{};
  std::array<double, 3> upper{};
  double reach2 = 0.0;  ///< reach^2, a little more than exact [m^2]
};

inline constexpr std::size_t kPack = 8;

/// Eight rounded boxes side by side; unused slots have reach2 < 0 and never match.
struct alignas(64) LeafPack {
  double lower[3][kPack];
  double upper[3][kPack];
  double reach2[kPack];
  double inverse_r2[kPack];  ///< of the kernel; only where the hierarchy's own leaves are read for bounds
  std::uint32_t id[kPack];
};

/// Boxes of eight packs of the level below; unused slots are empty.
struct alignas(64) NodePack {
  double lower[3][kPack];
  double upper[3][kPack];
  double peak[kPack];       ///< sum of f(0) below
  double lipschitz[kPack];  ///< sum of the largest |grad f| below
};

struct Field::Index {
  /// Up to this many primitives, all leaves are scanned in id order and there are no nodes.
  static constexpr std::size_t kScanLimit = 64;

  double iso = 0.5;
  double feature_size = 0.0;
  double typical_extent = 0.0;  ///< mean edge of the supports' boxes [m]
  bool cull = true;
  bool uniform = true;          ///< all primitives are of one kind
  bool convolved = false;       ///< some primitive is a convolution
  bool convex = false;          ///< all level sets are
  /// Of many Wyvill points only their places are packed at once; shapes, rounded boxes and supports follow with the hierarchy.
  std::vector<double> ball_radius;
  BlendIndex blend;
  std::optional<double> core_radius;  ///< of a convex body: from its core to the surface [m]
  bool core_is_point = false;
  std::vector<PackedPrimitive> primitive;  ///< by id
  std::vector<PackedShape> shape;          ///< by id
  std::vector<RoundedBox> rounded;         ///< by id
  std::vector<Box> support;                ///< by id
  std::vector<Vec3> control;               ///< of all shapes, which hold spans of it
  std::vector<LeafPack> leaf;              ///< by id up to kScanLimit primitives, else along a Morton curve
  std::vector<std::vector<NodePack>> level;  ///< level[0] bounds the leaves, level[l + 1] bounds level[l]
  std::size_t level_count = 0;

  // The surface box, computed on first use; contact uses it every step, other stages never.
  mutable std::atomic<bool> surface_box_known{false};
  mutable std::mutex surface_box_mutex;
  mutable Box surface_box;

  // Scratch of the build, kept for its capacity.
  std::vector<std::uint32_t> order, order_swap;
  std::vector<std::uint32_t> code;
  std::vector<Box> leaf_box, box_swap;

  [[nodiscard]] std::size_t size() const noexcept { return primitive.size(); }
  // The hierarchy, built on first use: meshes of Wyvill points never need it.
  std::atomic<bool> built{false};
  std::mutex build_mutex;

  void pack_balls();
  void build_leaves();
  void build_levels();
};

/// Length on which the kernel falls, where level sets are closest [m].
[[nodiscard]] double feature_of(const Primitive& p) noexcept;

/// Rows of the parts' sums, whatever the blend.
void part_rows(const Field::Index& index, std::span<const Vec3> points, FieldParts& parts);
/// Ids of the primitives whose supports may meet a box, in rising order; valid until the thread evaluates again.
[[nodiscard]] std::span<const std::uint32_t> candidates_of(const Field::Index& index, const Box& box);
/// Hessian of one part's sum.
[[nodiscard]] Mat3 part_hessian(const Field::Index& index, std::uint32_t part, const Vec3& point);

/// Squared distances, as the kernel sees them, between which all points of a box lie that the support reaches. Where the box
/// reaches beyond the support, that part ends on the support's box, so far2 is R^2 or more and the least f is zero, as it should be.
struct DistanceRange {
  double near2, far2;
};
[[nodiscard]] DistanceRange distance_range(const Field::Index& index, std::uint32_t id, const Box& box);

/// Of one primitive on a box.
struct PrimitiveBound {
  Interval value{};
  double slope = 0.0;  ///< of |grad f|, where requested
};
[[nodiscard]] PrimitiveBound bound_primitive(const Field::Index& index, std::uint32_t id, const Box& box, bool with_slope);

// Fields with another rule than Sum: see field_blend.cpp.
void evaluate_blended(const Field::Index& index, std::span<const Vec3> points, double* values, Vec3* gradients);
void blended_part_rows(const Field::Index& index, std::span<const Vec3> points, FieldParts& parts);
[[nodiscard]] Interval blended_bound(const Field::Index& index, const Box& box);
[[nodiscard]] double blended_gradient_bound(const Field::Index& index, const Box& box);

/// A; the identity for balls, of which boxes of the world then are boxes, too.
[[nodiscard]] inline Mat3 to_local_of(const PackedPrimitive& p, const PackedShape& shape) noexcept {
  if (p.kind == PackedKind::PointWyvill || p.kind == PackedKind::PointGascuel) return Mat3::Identity();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.to_local.data());
}

/// One rounded box as slot of a pack.
inline void set_slot(LeafPack& pack, std::size_t slot, const RoundedBox& box, std::uint32_t id) noexcept {
  for (std::size_t k = 0; k < 3; ++k) {
    pack.lower[k][slot] = box.lower[k];
    pack.upper[k][slot] = box.upper[k];
  }
  pack.reach2[slot] = box.reach2;
  pack.inverse_r2[slot] = 0.0;
  pack.id[slot] = id;
}
inline void clear_slot(LeafPack& pack, std::size_t slot) noexcept {
  set_slot(pack, slot, RoundedBox{.lower = {}, .upper = {}, .reach2 = -1.0}, 0);
}

}  // namespace supple::implicit
