/// @file supple/implicit/field.h
/// The field of one body: F(p) = sum_k f_k(p) - c over its primitives, or by another rule of blend.h, with a bounding volume hierarchy over their
/// supports and packed, batched evaluation. Sums run in primitive order, so culling cannot change a bit.
#pragma once

#include <memory>

#include "supple/core/executor.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

/// Work of the evaluations since the last reset, for `--profile`; exact with threads: counted per
/// call and summed by the caller.
struct FieldCounts {
  std::uint64_t points = 0;
  std::uint64_t primitives_visited = 0;  ///< kernel evaluations made
  std::uint64_t primitives_present = 0;  ///< points x primitives
};

class Field {
 public:
  Field();
  ~Field();
  Field(Field&&) noexcept;
  Field& operator=(Field&&) noexcept;

  // The ScalarField operations (see field_view.h).
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;
  /// For bodies with `has_convex_core`.
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const;
  /// Whether all {F >= c} are known to be convex: `has_convex_levels`.
  [[nodiscard]] bool convex() const noexcept;

  /// Bounds of F on a box, never wider than `bound` and much narrower on small boxes with overlapping primitives: value and
  /// gradient at the centre and bounds of the second derivatives leave an error of second order in the box. Costs about
  /// twice as much.
  [[nodiscard]] Interval tight_bound(const Box& box) const;
  /// The same, and a lower bound of |grad F| [1/m]: above 0 only on boxes so small that the gradient hardly rotates. Where a
  /// blend has creases it bounds Clarke's generalised gradient: F has no extremum in a box where it is above 0.
  struct BoxBounds {
    Interval value{};
    double least_slope = 0.0;
    bool second_order = false;  ///< false: the slope stays 0 on smaller boxes too, as where blends go by gradients
  };
  [[nodiscard]] BoxBounds box_bounds(const Box& box) const;

  /// Hessian of F [1/m^2] at one point (mean curvature, tests); the mean curvature is > 0 for a sphere:
  /// kappa = (g^T H g - |g|^2 tr H) / (2 |g|^3).
  [[nodiscard]] Mat3 hessian(const Vec3& point) const;

  [[nodiscard]] std::size_t primitive_count() const;
  /// Numbers of primitives visited and present when these points are evaluated as one batch.
  [[nodiscard]] FieldCounts count(std::span<const Vec3> points) const;
  /// Off: every primitive is evaluated at every point. Changes no bit of any value; on by default.
  void set_culling(bool on);

  struct Index;
  /// Data for the loops of this module, the hierarchy included; private to it.
  [[nodiscard]] const Index& index() const;
  /// The same without the hierarchy, which is built on first use.
  [[nodiscard]] const Index& packed() const noexcept { return *index_; }

 private:
  friend void index_field(const Skeleton&, const PlacedSkeleton&, Field&);
  std::unique_ptr<Index> index_;
};

/// Stage 3. Rebuilds `field` for the placed primitives; capacity is reused.
void index_field(const Skeleton& skeleton, const PlacedSkeleton& placed, Field& field);

/// Reference implementation: sums `potential` of every primitive, without index or batches;
/// of other rules than the sum the gradient is a central difference over 1e-6 m.
[[nodiscard]] double evaluate_reference(const Skeleton& skeleton, const PlacedSkeleton& placed, const Vec3& point,
                                        Vec3* gradient = nullptr);

/// Half-space {(x - point) . normal <= 0}: F = slope ((point - x) . normal), one part. Grounds and walls.
struct HalfSpace {
  Vec3 point = Vec3::Zero();     ///< [m]
  Vec3 normal = Vec3::UnitZ();   ///< unit, outward
  double slope = 1.0;            ///< |grad F| [1/m], > 0
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const;
};

}  // namespace supple::implicit
