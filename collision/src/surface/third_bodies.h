/// @file third_bodies.h
/// Obstacles are one solid, whose pressure is the largest of theirs. Those that press alike on areas, as flush faces do, are met as one body, whose contact
/// the first of them has. Where they are not of one material, the one that nowhere presses less has such areas, else the first.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "supple/collision/bodies.h"

namespace supple::collision {

/// Two bodies by places in what both have in common with the box of a third one. Places only tell which way is taken to a contact, not what it is.
struct Comparison {
  double alike = 0.0;  ///< pressures that differ less are the same [Pa]; infinite where bodies have no bounds of slopes or sizes
  double step = 0.0;   ///< far more than a pressure that the third one can have there [Pa]
  bool tie = false;    ///< both press alike somewhere
  bool less = false;   ///< one presses less than the other somewhere,
  bool more = false;   ///< or more
};
[[nodiscard]] Comparison compare(const ContactBody& one, const ContactBody& other, const implicit::FieldView& met);

/// The field of a body as the rival of another one for the contact with a third: where both press alike, or where it nowhere presses more, or less, it is far
/// above the pressure of the other one, or far below.
class RivalField {
 public:
  /// @param first  it has the contact where nothing else decides   @param met  what they meet
  RivalField(const ContactBody& rival, const ContactBody& other, bool first, const implicit::FieldView& met);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const { rival_.evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const { return rival_.gradient_bound(box); }
  [[nodiscard]] Box surface_box() const { return rival_.surface_box(); }
  [[nodiscard]] double feature_size() const { return rival_.feature_size(); }
  [[nodiscard]] std::optional<implicit::CorePoint> core_point(const Vec3& place) const { return rival_.core_point(place); }

 private:
  enum class Rank : std::uint8_t { Unknown, Above, Below };
  [[nodiscard]] bool may_settle(double value, double other) const;
  bool settle(const Vec3& point, double& value, Vec3& gradient) const;

  implicit::FieldView rival_, other_;
  double ratio_;  // of the moduli: the other pressure in values of the rival's field is this times that of the other field
  double alike_, step_;  // of the comparison, in values of the rival's field
  Rank rank_ = Rank::Unknown;
  bool above_;    // the other one
};

/// The largest pressure of several bodies, in values of the field of the first.
class UnitedField {
 public:
  void clear() { field_.clear(); }
  /// @param ratio  of the modulus to that of the first
  void add(const implicit::FieldView& field, double ratio) { field_.push_back({field, ratio}); }

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;

 private:
  struct Weighted {
    implicit::FieldView field;
    double ratio;
  };
  std::vector<Weighted> field_;
};

/// Whether a body and another one are a pair.
using Meets = std::function<bool(std::uint32_t, std::uint32_t)>;

/// Obstacles that a body meets as one: they are of one material, move alike, and tie with each other, or with others that do.
struct Team {
  std::vector<std::uint32_t> member;  ///< rising
  UnitedField field;                  ///< of several members,
  ContactBody body;                   ///< as which the first one takes part for all
};

/// All teams that a body meets; what is not among them is met alone. Buffers are reused.
class Teams {
 public:
  /// @param partners  of the body, rising
  void find(std::span<const ContactBody> bodies, std::uint32_t body, std::span<const std::uint32_t> partners);
  void clear() { count_ = 0; }
  [[nodiscard]] const Team* of(std::uint32_t obstacle) const;

 private:
  bool gather(std::span<const ContactBody> bodies, std::uint32_t body, std::uint32_t obstacle, std::span<const std::uint32_t> partners, Team& team);

  std::deque<Team> team_;  // views of their fields stay
  std::size_t count_ = 0;
};

/// The third bodies of one pair; buffers are reused.
class ThirdBodies {
 public:
  /// The bodies of a pair and their numbers.
  struct Pair {
    const ContactBody &a, &b;
    BodyPair number;
  };
  /// @param index  of the third bodies, rising   @param teams  for which their first ones stand
  void set(std::span<const ContactBody> bodies, const Pair& pair, std::span<const std::uint32_t> index, const Teams& teams, const Meets& meets);
  [[nodiscard]] std::span<const ContactBody> all() const { return third_; }

 private:
  std::vector<ContactBody> third_;
  std::vector<RivalField> rival_;
};

}  // namespace supple::collision
