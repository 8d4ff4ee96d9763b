/// @file claim_bounds.h
/// Bodies that divide space, and what bounds tell of who has a cube. Label 0 is outside, m + 1 is body m.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "field_box_bounds.h"
#include "polygonise_junctions.h"
#include "supple/implicit/missed_pieces.h"

namespace supple::implicit {

using lattice::Label;

/// weight * F.
class Claim {
 public:
  /// @param alone  without others, to whose claims its own would be compared
  Claim(const SearchedBody& body, bool alone);
  /// About how much it changes over a length near its surface, > 0; 1 where it is alone.
  [[nodiscard]] double steepness() const { return steepness_; }
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
  [[nodiscard]] const Field& field() const { return *field_; }
  [[nodiscard]] double weight() const { return weight_; }

 private:
  [[nodiscard]] Interval scaled(const Interval& value) const { return {weight_ * value.lower, weight_ * value.upper}; }
  const Field* field_;
  double weight_, steepness_ = 1.0;
};

/// What bounds tell of a cube.
struct Verdict {
  bool certain = false;  ///< all of it is `label`'s
  Label label = 0;
  bool flat = false;     ///< no claim's difference to the next has an extremum there
  bool second_order = true;
  [[nodiscard]] bool settled() const { return certain || flat; }
};

/// Bodies that may have a part of a cube, each with those of its primitives that may reach it, where it is a sum.
struct Candidates {
  std::vector<std::uint32_t> body;    ///< ascending
  std::vector<std::uint32_t> offset;  ///< of their primitives, body.size() + 1 of them
  std::vector<std::uint32_t> primitive;

  [[nodiscard]] std::span<const std::uint32_t> primitives_of(std::size_t k) const {
    return std::span(primitive).subspan(offset[k], offset[k + 1] - offset[k]);
  }
};
void find_candidates(std::span<const Claim> claims, const Box& box, std::span<const std::uint32_t> bodies, Candidates& found);

/// Takes the bounds of the claims on cubes; outside claims 0.
class CubeBounds {
 public:
  explicit CubeBounds(std::span<const Claim> claims) : claims_(claims), entry_(1) {
    entry_[0].bounds.second_order = true;
    entry_[0].bounds.hull.assign(1, {});
  }

  /// Step by step, until a cube is settled: by bounds of first order, by directions, by second derivatives.
  /// @param flat_anyway  whether one that is certain is flat matters, too
  [[nodiscard]] Verdict operator()(const Box& box, const Candidates& candidates, bool flat_anyway);
  /// The same bodies with those of their primitives that add to them on the box that was looked at last.
  void narrow(const Candidates& from, Candidates& narrowed) const;
  /// The same verdicts on the eighths of the box that was looked at last and was not settled, x + 2 y + 4 z: by its bounds of second derivatives and
  /// by values and gradients at their middles. Undecided where some claim has no bounds of second derivatives, and between lone balls, where steps cost no more.
  [[nodiscard]] std::array<Verdict, 8> eighths(const Box& box);

 private:
  struct Entry {
    Label label = 0;
    double steepness = 0.0, weight = 1.0;
    GradientBounds bounds;              ///< of the field
    Interval value{};                   ///< of the claim
  };
  /// How far a claim is ahead of another one.
  struct Lead {
    const Entry* other;
    Interval value;  ///< [m], to first order
  };
  using Step = void (*)(const Field& field, const Box& box, GradientBounds& bounds);
  void start(const Box& box, const Candidates& candidates);
  void add(Step step, const Box& box);
  [[nodiscard]] std::span<Entry> entries() { return std::span(entry_).first(count_); }

  [[nodiscard]] std::span<const Entry> entries() const { return std::span(entry_).first(count_); }

  [[nodiscard]] bool knows_eighths() const;
  [[nodiscard]] Verdict judge();
  [[nodiscard]] bool is_flat();
  /// Whether there is a direction along which all leads rise that may be the least of a claim. They are divided by how steep their
  /// claims are, so that in most cubes on an interface no lead over a third competes.
  [[nodiscard]] bool rises(const Entry& own);
  /// Whether space outside has no maximum of its least lead: over one, two or three round bodies. Where no direction leads away from
  /// all, their normals lie in a plane, and along its normal all of them fall. @pre rises(outside) was looked at last
  [[nodiscard]] bool passes_round_bodies() const;

  std::span<const Claim> claims_;
  std::vector<Entry> entry_;  ///< the first is outside; they keep their memory
  std::size_t count_ = 1;     ///< of those in use
  std::vector<std::array<double, 8>> value_;  ///< by entry, at the middles of eighths,
  std::vector<std::array<Vec3, 8>> slope_;    ///< and gradients
  std::vector<Lead> lead_;
  std::vector<Vec3> over_;      ///< gradients of the leads,
  std::vector<double> turn_;    ///< and how far they turn
  double most_ = 0.0;  ///< that the largest claim is everywhere
};

}  // namespace supple::implicit
