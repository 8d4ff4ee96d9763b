/// @file supple/implicit/field_view.h
/// A scalar field as other stages see it. F is the potential minus the iso value: inside F > 0, on the surface F = 0,
/// outside F < 0, and the outward normal is n = -grad F / |grad F|. This page is the only one that states the sign.
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/types.h"

namespace supple::implicit {

class Field;

/// Contributions of single parts (particles) to a field at many points, as rows: row i holds the parts whose support
/// reaches point i, in rising order. The parts' values sum to F + iso, their gradients to grad F.
struct FieldParts {
  std::vector<std::uint32_t> offset;  ///< row i is [offset[i], offset[i+1]), shape [n + 1]
  std::vector<std::uint32_t> part;    ///< index of the part within its body
  std::vector<double> value;          ///< f_k [1]
  std::vector<Vec3> gradient;         ///< grad f_k [1/m]
  /// Derivative of F by the rotation of a part, beyond -grad f_k . (omega x r) of rigid motion [1/rad]: in blends by gradients the part's own
  /// gradient rotates. Empty: zero.
  std::vector<Vec3> by_turn{};
};

/// The medial set of a convex body seen from a point: a convex set around which all level sets of the body lie at equal distances.
struct CorePoint {
  Vec3 point = Vec3::Zero();  ///< of the medial set, nearest to the point [m]
  double radius = 0.0;        ///< from the medial set to the surface [m]
  bool round = false;         ///< the field is symmetric about the line from any point to its `point`: balls, half-spaces
};

/// Optional operation of fields of convex bodies; its result is exact.
template <class T>
concept HasCore = requires(const T& field, const Vec3& place) {
  { field.core_point(place) } -> std::same_as<std::optional<CorePoint>>;
};

/// Optional operation: whether all {F >= c} are known to be convex; those with a medial set are.
template <class T>
concept SaysWhetherConvex = requires(const T& field) {
  { field.convex() } -> std::same_as<bool>;
};

/// Operations that a type must have to be used through a FieldView.
template <class T>
concept ScalarField = requires(const T& field, std::span<const Vec3> points, std::span<double> values,
                               std::span<Vec3> gradients, const Box& box, FieldParts& parts) {
  field.evaluate(points, values);
  field.evaluate(points, values, gradients);
  field.evaluate_parts(points, parts);
  { field.bound(box) } -> std::same_as<Interval>;
  { field.gradient_bound(box) } -> std::convertible_to<double>;
  { field.surface_box() } -> std::same_as<Box>;
  { field.feature_size() } -> std::convertible_to<double>;
};

/// Non-owning view of any ScalarField; one indirect call per batch. The viewed object must outlive it.
class FieldView {
 public:
  FieldView() = default;
  template <ScalarField T>
    requires(!std::same_as<T, FieldView>)
  FieldView(const T& field) : self_(&field), table_(&kTable<T>) {}  // NOLINT: implicit on purpose

  /// F at world points [m], shape [n] -> values [1], shape [n]. values[i] depends on points[i] alone.
  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    table_->values(self_, points, values);
  }
  /// F and grad F [1/m], shape [n].
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    table_->gradients(self_, points, values, gradients);
  }
  /// Contributions of the parts; replaces the content of `parts`, keeps its capacity.
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
    parts.by_turn.clear();
    table_->parts(self_, points, parts);
  }
  /// Conservative bounds of F on a box.
  [[nodiscard]] Interval bound(const Box& box) const { return table_->bound(self_, box); }
  /// Conservative bound of |grad F| on a box [1/m].
  [[nodiscard]] double gradient_bound(const Box& box) const { return table_->gradient_bound(self_, box); }
  /// Conservative box of {F >= 0} [m]; unbounded sides are infinite; empty when there is no surface.
  [[nodiscard]] Box surface_box() const { return table_->surface_box(self_); }
  /// A length [m] below which F has no features: iterations limit their steps to half of it.
  [[nodiscard]] double feature_size() const { return table_->feature_size(self_); }

  /// The nearest point of the medial set of a convex body; none where the body is not known to be convex.
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const { return table_->core_point(self_, place); }

  /// Whether all {F >= c} are known to be convex.
  [[nodiscard]] bool convex() const { return table_->convex(self_); }

  [[nodiscard]] double value(const Vec3& p) const {
    double v;
    evaluate({&p, 1}, {&v, 1});
    return v;
  }
  [[nodiscard]] double value(const Vec3& p, Vec3& gradient) const {
    double v;
    evaluate({&p, 1}, {&v, 1}, {&gradient, 1});
    return v;
  }
  /// The viewed object if it is a Field, else null: some loops are faster with access to the primitives.
  [[nodiscard]] const Field* as_field() const noexcept { return self_ != nullptr ? table_->as_field(self_) : nullptr; }
  explicit operator bool() const noexcept { return self_ != nullptr; }

 private:
  struct Table {
    void (*values)(const void*, std::span<const Vec3>, std::span<double>);
    void (*gradients)(const void*, std::span<const Vec3>, std::span<double>, std::span<Vec3>);
    void (*parts)(const void*, std::span<const Vec3>, FieldParts&);
    Interval (*bound)(const void*, const Box&);
    double (*gradient_bound)(const void*, const Box&);
    Box (*surface_box)(const void*);
    double (*feature_size)(const void*);
    std::optional<CorePoint> (*core_point)(const void*, const Vec3&);
    bool (*convex)(const void*);
    const Field* (*as_field)(const void*);
  };
  template <class T>
  static constexpr Table kTable{
      [](const void* f, std::span<const Vec3> p, std::span<double> v) { static_cast<const T*>(f)->evaluate(p, v); },
      [](const void* f, std::span<const Vec3> p, std::span<double> v, std::span<Vec3> g) {
        static_cast<const T*>(f)->evaluate(p, v, g);
      },
      [](const void* f, std::span<const Vec3> p, FieldParts& out) { static_cast<const T*>(f)->evaluate_parts(p, out); },
      [](const void* f, const Box& b) { return static_cast<const T*>(f)->bound(b); },
      [](const void* f, const Box& b) { return static_cast<double>(static_cast<const T*>(f)->gradient_bound(b)); },
      [](const void* f) { return static_cast<const T*>(f)->surface_box(); },
      [](const void* f) { return static_cast<double>(static_cast<const T*>(f)->feature_size()); },
      []([[maybe_unused]] const void* f, [[maybe_unused]] const Vec3& place) -> std::optional<CorePoint> {
        if constexpr (HasCore<T>) {
          return static_cast<const T*>(f)->core_point(place);
        } else {
          return std::nullopt;
        }
      },
      []([[maybe_unused]] const void* f) {
        if constexpr (SaysWhetherConvex<T>) {
          return static_cast<const T*>(f)->convex();
        } else if constexpr (HasCore<T>) {
          return static_cast<const T*>(f)->core_point(Vec3::Zero()).has_value();
        } else {
          return false;
        }
      },
      []([[maybe_unused]] const void* f) -> const Field* {
        if constexpr (std::same_as<T, Field>) {
          return static_cast<const Field*>(f);
        } else {
          return nullptr;
        }
      }};

  const void* self_ = nullptr;
  const Table* table_ = nullptr;
};

}  // namespace supple::implicit
