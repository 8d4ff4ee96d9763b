#include "surface/third_bodies.h"

#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "pairs/body_order.h"
#include "pairs/boxes.h"

namespace supple::collision {
namespace {

constexpr double kAlike = 1e-7;        // over a size: distances that differ less are the same; those of meshes are kept to this share of a few cells
constexpr double kAlikeSlopes = 0.02;  // over their sum: where slopes differ more, surfaces only cross
constexpr double kNear = 0.01;         // of the step, outside the rival: rims are off by less

/// Where obstacles have one material and motion, it makes no difference which of them something meets.
bool same_stuff(const ContactBody& one, const ContactBody& other) {
  const auto still = [](const ContactBody& body) {
    const auto is_zero = [](const Vec3& v) { return v.isZero(0.0); };
    return std::all_of(body.velocity.begin(), body.velocity.end(), is_zero) && std::all_of(body.angular_velocity.begin(), body.angular_velocity.end(), is_zero);
  };
  return one.material.modulus == other.material.modulus && one.material.friction == other.material.friction &&
         one.material.dissipation == other.material.dissipation && still(one) && still(other);
}

}  // namespace

Comparison compare(const ContactBody& one, const ContactBody& other, const implicit::FieldView& met) {
  constexpr int kPlaces = 5;  // along each side
  Comparison found;
  found.alike = found.step = kInfinity;
  const Box box = met.surface_box(), box_one = one.field.surface_box(), box_other = other.field.surface_box();
  const Box common{box.lower.cwiseMax(box_one.lower).cwiseMax(box_other.lower), box.upper.cwiseMin(box_one.upper).cwiseMin(box_other.upper)};
  if (common.empty() || !is_finite(common)) return found;
  const double steepest = std::max(one.material.modulus * one.field.gradient_bound(common), other.material.modulus * other.field.gradient_bound(common));
  const double size = std::min({met.feature_size(), one.field.feature_size(), other.field.feature_size()});
  const double farthest = common.lower.cwiseAbs().cwiseMax(common.upper.cwiseAbs()).maxCoeff();
  found.step = steepest * size;
  found.alike = steepest * (kAlike * size + 16.0 * kEpsilon * farthest);
  thread_local std::vector<Vec3> place;
  thread_local std::vector<double> value, value_other;
  place.clear();
  for (int k = 0; k < kPlaces * kPlaces * kPlaces; ++k) {
    const Vec3 share = Vec3(k % kPlaces, k / kPlaces % kPlaces, k / (kPlaces * kPlaces)) / (kPlaces - 1);  // on its faces, too
    place.emplace_back(common.lower + share.cwiseProduct(common.extent()));
  }
  value.resize(place.size());
  value_other.resize(place.size());
  one.field.evaluate(place, value);
  other.field.evaluate(place, value_other);
  for (std::size_t i = 0; i < place.size(); ++i) {
    const double p = one.material.modulus * value[i], q = other.material.modulus * value_other[i];
    if (!(std::max(p, q) > found.alike)) continue;
    if (std::abs(p - q) <= found.alike) {
      found.tie = true;
    } else {
      (p < q ? found.less : found.more) = true;
    }
  }
  return found;
}

RivalField::RivalField(const ContactBody& rival, const ContactBody& other, bool first, const implicit::FieldView& met)
    : rival_(rival.field), other_(other.field), ratio_(other.material.modulus / rival.material.modulus), above_(first) {
  const Comparison found = compare(rival, other, met);
  alike_ = found.alike / rival.material.modulus;
  step_ = found.step / rival.material.modulus;
  if (found.less == found.more) return;
  rank_ = found.more ? Rank::Above : Rank::Below;
  above_ = found.more;
}

bool RivalField::may_settle(double value, double other) const {
  if (!std::isfinite(alike_)) return false;
  if (rank_ == Rank::Below) return value <= other + alike_;
  if (!(value > -kNear * step_)) return false;
  return rank_ == Rank::Above ? value >= other - alike_ : std::abs(value - other) <= alike_;
}

/// @param value, gradient  of the rival, where that may be settled   @return whether it is: then both are those that settle it
bool RivalField::settle(const Vec3& point, double& value, Vec3& gradient) const {
  Vec3 slope;
  const double other = ratio_ * other_.value(point, slope);
  slope *= ratio_;
  if (rank_ == Rank::Unknown && !((gradient - slope).norm() <= kAlikeSlopes * (gradient.norm() + slope.norm()))) return false;
  value = other + (above_ ? step_ : -step_);
  gradient = slope;
  return true;
}

void RivalField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  thread_local std::vector<double> other;
  other.resize(points.size());
  rival_.evaluate(points, values);
  other_.evaluate(points, other);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!may_settle(values[i], ratio_ * other[i])) continue;
    Vec3 gradient;
    double value = rival_.value(points[i], gradient);
    if (settle(points[i], value, gradient)) values[i] = value;
  }
}

void RivalField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  thread_local std::vector<double> other;
  other.resize(points.size());
  rival_.evaluate(points, values, gradients);
  other_.evaluate(points, other);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (may_settle(values[i], ratio_ * other[i])) settle(points[i], values[i], gradients[i]);
  }
}

Interval RivalField::bound(const Box& box) const {
  const Interval own = rival_.bound(box);
  if (!std::isfinite(alike_) || (rank_ != Rank::Below && !(own.upper > -kNear * step_))) return own;
  const Interval other = other_.bound(box);
  return above_ ? Interval{own.lower, std::max(own.upper, ratio_ * other.upper + step_)}
                : Interval{std::min(own.lower, ratio_ * other.lower - step_), own.upper};
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  thread_local std::vector<double> other;
  other.resize(points.size());
  field_.front().field.evaluate(points, values);
  for (std::size_t k = 1; k < field_.size(); ++k) {
    field_[k].field.evaluate(points, other);
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = std::max(values[i], field_[k].ratio * other[i]);
  }
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  thread_local std::vector<double> other;
  thread_local std::vector<Vec3> slope;
  other.resize(points.size());
  slope.resize(points.size());
  field_.front().field.evaluate(points, values, gradients);
  for (std::size_t k = 1; k < field_.size(); ++k) {
    field_[k].field.evaluate(points, other, slope);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!(field_[k].ratio * other[i] > values[i])) continue;
      values[i] = field_[k].ratio * other[i];
      gradients[i] = field_[k].ratio * slope[i];
    }
  }
}

void UnitedField::evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
  field_.front().field.evaluate_parts(points, parts);
  evaluate(points, parts.value, parts.gradient);
}

Interval UnitedField::bound(const Box& box) const {
  Interval bound{-kInfinity, -kInfinity};
  for (const Weighted& w : field_) {
    const Interval own = w.field.bound(box);
    bound.lower = std::max(bound.lower, w.ratio * own.lower);
    bound.upper = std::max(bound.upper, w.ratio * own.upper);
  }
  return bound;
}

double UnitedField::gradient_bound(const Box& box) const {
  double steepest = 0.0;
  for (const Weighted& w : field_) steepest = std::max(steepest, w.ratio * w.field.gradient_bound(box));
  return steepest;
}

Box UnitedField::surface_box() const {
  Box box;
  for (const Weighted& w : field_) box = box.united(w.field.surface_box());
  return box;
}

double UnitedField::feature_size() const {
  double size = kInfinity;
  for (const Weighted& w : field_) size = std::min(size, w.field.feature_size());
  return size;
}

/// @return whether there are several
bool Teams::gather(std::span<const ContactBody> bodies, std::uint32_t body, std::uint32_t obstacle, std::span<const std::uint32_t> partners, Team& team) {
  const auto joins = [&](std::uint32_t c, std::uint32_t member) {
    return same_stuff(bodies[c], bodies[member]) && compare(bodies[c], bodies[member], bodies[body].field).tie;
  };
  std::vector<std::uint32_t>& member = team.member;
  member.assign(1, obstacle);
  for (std::size_t k = 0; k < member.size(); ++k) {
    for (const std::uint32_t c : partners) {
      if (bodies[c].fixed && std::find(member.begin(), member.end(), c) == member.end() && joins(c, member[k])) member.push_back(c);
    }
  }
  if (member.size() == 1) return false;
  std::sort(member.begin(), member.end());
  team.field.clear();
  for (const std::uint32_t c : member) team.field.add(bodies[c].field, bodies[c].material.modulus / bodies[member.front()].material.modulus);
  team.body = bodies[member.front()];
  team.body.field = team.field;
  return true;
}

void Teams::find(std::span<const ContactBody> bodies, std::uint32_t body, std::span<const std::uint32_t> partners) {
  clear();
  if (std::count_if(partners.begin(), partners.end(), [&](std::uint32_t c) { return bodies[c].fixed; }) < 2) return;
  for (const std::uint32_t c : partners) {
    if (!bodies[c].fixed || of(c) != nullptr) continue;
    if (team_.size() == count_) team_.emplace_back();
    if (gather(bodies, body, c, partners, team_[count_])) ++count_;
  }
}

const Team* Teams::of(std::uint32_t obstacle) const {
  for (std::size_t k = 0; k < count_; ++k) {
    if (std::binary_search(team_[k].member.begin(), team_[k].member.end(), obstacle)) return &team_[k];
  }
  return nullptr;
}

void ThirdBodies::set(std::span<const ContactBody> bodies, const Pair& pair, std::span<const std::uint32_t> index, const Teams& teams, const Meets& meets) {
  third_.clear();
  rival_.clear();
  rival_.reserve(index.size());  // they must stay where they are
  for (const std::uint32_t c : index) {
    const Team* team = teams.of(c);
    ContactBody& third = third_.emplace_back(team != nullptr ? team->body : bodies[c]);
    for (const bool with_a : {true, false}) {
      const ContactBody &own = with_a ? pair.a : pair.b, &other = with_a ? pair.b : pair.a;
      const bool same = third.fixed && own.fixed;
      if (!meets(with_a ? pair.number.b : pair.number.a, c) || (!same && !coincide(third, own))) continue;
      third.field = rival_.emplace_back(third, own, c < (with_a ? pair.number.a : pair.number.b), other.field);
      break;
    }
  }
}

}  // namespace supple::collision
