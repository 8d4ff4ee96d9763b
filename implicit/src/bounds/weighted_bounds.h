/// @file weighted_bounds.h
/// Bodies that divide space, and bounds of the owner of a cube. Label 0 is outside, m + 1 is body m.
///
/// With weighted fields c_m = weight F_m, p_m = c_m + phi_m >= 0 is the weighted field above its least value, which it has beyond the supports of m. Label a owns the points where
///   M_a = c_a (1 - max over m != a of p_m / (c_a + phi_m)),  M_0 = 1 - max over m of p_m / phi_m
/// are above 0: where c_a > 0 and c_a > c_m, and where all c_m < 0. These do not depend on a cube, so each M_a is one continuous function over space
/// and has a maximum in every closed piece of a; a body has no effect out of its reach, as p_m is 0 there. So a cube needs only the bodies that
/// reach it. Each lead c_a (1 - p_m / (c_a + phi_m)) rises along a direction if c_a - rho c_m does, rho = 1 / (1 + phi_m (c_a - c_m) / (c_a (c_a + phi_m))) constant.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "bounds/field_box_bounds.h"
#include "mesh/partition/polygonise_junctions.h"
#include "supple/implicit/missed_pieces.h"

namespace supple::implicit {

using lattice::Label;

/// weight * F.
class WeightedField {
 public:
  explicit WeightedField(const SearchedBody& body);
  /// phi: beyond all supports it is -phi.
  [[nodiscard]] double depth() const { return depth_; }
  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    field_->evaluate(points, values);
    for (double& v : values) v *= weight_;
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    field_->evaluate(points, values, gradients);
    for (double& v : values) v *= weight_;
    for (Vec3& g : gradients) g *= weight_;
  }
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field_->evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const { return scaled(field_->bound(box)); }
  [[nodiscard]] double gradient_bound(const Box& box) const { return weight_ * field_->gradient_bound(box); }
  [[nodiscard]] Box surface_box() const { return field_->surface_box(); }
  [[nodiscard]] double feature_size() const { return field_->feature_size(); }
  /// Beyond it the weighted field has its least value.
  [[nodiscard]] Box support_box() const;
  [[nodiscard]] const Field& field() const { return *field_; }
  [[nodiscard]] double weight() const { return weight_; }

 private:
  [[nodiscard]] Interval scaled(const Interval& value) const { return {weight_ * value.lower, weight_ * value.upper}; }
  const Field* field_;
  double weight_, depth_;
};

/// Result of bounds on a cube.
struct Verdict {
  bool certain = false;  ///< all of it is `label`'s
  Label label = 0;
  bool flat = false;     ///< no difference of two weighted fields has an extremum there
  bool second_order = true;
  [[nodiscard]] bool settled() const { return certain || flat; }
};

/// Bodies that may own a part of a cube, or bound the lead there, each with its primitives in reach, if it is a sum.
struct Candidates {
  std::vector<std::uint32_t> body;    ///< ascending
  std::vector<std::uint32_t> offset;  ///< of their primitives, body.size() + 1 of them
  std::vector<std::uint32_t> primitive;

  [[nodiscard]] std::span<const std::uint32_t> primitives_of(std::size_t k) const {
    return std::span(primitive).subspan(offset[k], offset[k + 1] - offset[k]);
  }
};
/// Those of some bodies whose supports reach a box.
void find_candidates(std::span<const WeightedField> weighted, const Box& box, std::span<const std::uint32_t> bodies, Candidates& found);

/// Computes bounds of the weighted fields on cubes; the weighted field of outside is 0.
class CubeBounds {
 public:
  explicit CubeBounds(std::span<const WeightedField> weighted) : weighted_(weighted), entry_(1) {
    entry_[0].bounds.second_order = true;
    entry_[0].bounds.hull.assign(1, {});
  }

  /// In steps until a cube is decided: by bounds of first order, by directions, by second derivatives.
  /// @param flat_anyway  also test flatness of a cube with a certain owner
  [[nodiscard]] Verdict operator()(const Box& box, const Candidates& candidates, bool flat_anyway);
  /// Bodies that matter on parts of the last box, with their primitives in reach.
  void narrow(Candidates& narrowed) const;
  /// The same for the eighths of the last box if that was undecided, x + 2 y + 4 z: by its bounds of second derivatives and
  /// by values and gradients at their centres. Undecided where some weighted field has no bounds of second derivatives, and between single primitives, where steps cost no more.
  [[nodiscard]] std::array<Verdict, 8> eighths(const Box& box);

 private:
  struct Entry {
    Label label = 0;
    double weight = 1.0, depth = 0.0;
    GradientBounds bounds;              ///< of the field
    Interval value{};                   ///< of the weighted field
    bool matters = false;
  };
  /// Lead of a weighted field over another one.
  struct Lead {
    Entry* other;
    Interval rho;
  };
  using Step = void (*)(const Field& field, const Box& box, GradientBounds& bounds);
  void start(const Box& box, const Candidates& candidates);
  void add(Step step, const Box& box);
  [[nodiscard]] bool may_have_part(const Entry& e) const { return !(e.value.upper < most_) && (e.label == 0 || e.value.upper > 0.0); }
  /// Leaves out bodies that neither own a part of the cube nor are next to an owner. @pre judge() was called
  void drop_others();
  /// The leads of a weighted field that may be the least one where it owns a part of the cube.
  void find_leads(const Entry& own);
  [[nodiscard]] std::span<Entry> entries() { return std::span(entry_).first(count_); }

  [[nodiscard]] std::span<const Entry> entries() const { return std::span(entry_).first(count_); }

  [[nodiscard]] bool knows_eighths() const;
  [[nodiscard]] Verdict judge();
  [[nodiscard]] bool is_flat();
  /// Whether there is a direction along which all leads rise that may be the least of a weighted field.
  [[nodiscard]] bool rises(const Entry& own);
  /// Whether the least lead of outside has no maximum there because at most three convex primitives are near. Where no direction leads
  /// away from all bodies, some multiples of the slopes of squared distances cancel, so that those of three lie in a plane. By convexity no distance
  /// falls along the normal of that plane, and so no lead does: maxima would extend both ways, but the one farthest from the origin cannot.
  /// @pre rises(outside) was called last
  [[nodiscard]] bool passes_convex_primitives() const;

  std::span<const WeightedField> weighted_;
  std::vector<Entry> entry_;  ///< the first is outside; they keep their memory
  std::size_t count_ = 1;     ///< of those in use
  std::vector<std::array<double, 8>> value_;  ///< by entry, at the middles of eighths,
  std::vector<std::array<Vec3, 8>> slope_;    ///< and gradients
  std::vector<Lead> lead_;
  std::vector<Vec3> over_;      ///< gradients of the leads,
  std::vector<double> turn_;    ///< and how far they turn
  double most_ = 0.0;  ///< that the largest weighted field is everywhere
};

}  // namespace supple::implicit
