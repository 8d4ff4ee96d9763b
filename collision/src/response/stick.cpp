#include "supple/collision/stick.h"

#include <algorithm>
#include <cmath>

#include "response/energy_loads.h"

namespace supple::collision {
namespace {

Vec3 place_of(const StickSpring& spring, int side, const ContactBody& body) {
  const Pose& pose = body.pose[spring.part[side]];
  return pose.position + pose.orientation * spring.anchor[side];
}

/// The part that contributes most at x; the first of equals.
std::uint32_t part_at(const ContactBody& body, const Vec3& x, implicit::FieldParts& row) {
  if (body.pose.size() == 1) return 0;
  body.field.evaluate_parts({&x, 1}, row);
  const auto most = std::max_element(row.value.begin(), row.value.end());
  return most == row.value.end() ? 0 : row.part[static_cast<std::size_t>(most - row.value.begin())];
}

}  // namespace

const StickSpring* StickState::find(const BodyPair& pair) const {
  const auto at = std::lower_bound(spring.begin(), spring.end(), pair,
                                   [](const StickSpring& s, const BodyPair& p) { return s.pair < p; });
  return at != spring.end() && at->pair == pair ? &*at : nullptr;
}

void StickState::save(StateWriter& out) const {
  out.write(std::uint64_t{spring.size()});
  for (const StickSpring& s : spring) {
    for (const std::uint32_t i : {s.pair.a, s.pair.b, s.part[0], s.part[1]}) out.write(std::uint64_t{i});
    out.write(std::span<const Vec3>(s.anchor));
    out.write(std::span<const Vec3>(s.displacement));
    for (const double value : {s.relative.x(), s.relative.y(), s.relative.z(), s.relative.w(), s.arm, s.twist}) out.write(value);
  }
}

void StickState::load(StateReader& in) {
  std::uint64_t count = 0;
  in.read(count);
  spring.clear();
  for (std::uint64_t k = 0; k < count; ++k) {
    StickSpring s;
    for (std::uint32_t* i : {&s.pair.a, &s.pair.b, &s.part[0], &s.part[1]}) {
      std::uint64_t value = 0;
      in.read(value);
      *i = static_cast<std::uint32_t>(value);
    }
    for (Vec3* vectors : {s.anchor, s.displacement}) {
      std::vector<Vec3> two;
      in.read(two);
      if (two.size() != 2) throw Error(ErrorKind::Corrupt, Fault{.expected = "expected two vectors in the saved state"});
      std::copy(two.begin(), two.end(), vectors);
    }
    for (double* value : {&s.relative.x(), &s.relative.y(), &s.relative.z(), &s.relative.w(), &s.arm, &s.twist}) in.read(*value);
    spring.push_back(s);
  }
}

void StickState::hash(Hasher& hasher) const {
  for (const StickSpring& s : spring) {
    for (const std::uint32_t i : {s.pair.a, s.pair.b, s.part[0], s.part[1]}) hasher.add(std::uint64_t{i});
    hasher.add(std::span<const Vec3>(s.anchor));
    hasher.add(std::span<const Vec3>(s.displacement));
    for (const double value : {s.relative.x(), s.relative.y(), s.relative.z(), s.relative.w(), s.arm, s.twist}) hasher.add(value);
  }
}

StickTrial stretch(const StickSpring& spring, const ContactBody& a, const ContactBody& b, const Vec3& normal) {
  const Vec3 on_a = place_of(spring, 0, a), on_b = place_of(spring, 1, b);
  const auto across = [&normal](const Vec3& v) -> Vec3 { return v - v.dot(normal) * normal; };
  // Carried with both bodies, laid into the plane, of the length that it had.
  Vec3 kept = across(a.pose[spring.part[0]].orientation * spring.displacement[0] +
                     b.pose[spring.part[1]].orientation * spring.displacement[1]);
  const double length = kept.norm();
  if (length > 0.0) kept *= spring.displacement[0].norm() / length;
  // A turned by an angle about the normal leaves B turned back by it in A's frame.
  const Quat& turned = a.pose[spring.part[0]].orientation;
  const Quat back = (turned.conjugate() * b.pose[spring.part[1]].orientation) * spring.relative.conjugate();
  const double angle = -2.0 * std::copysign(1.0, back.w()) * back.vec().dot(turned.conjugate() * normal);
  return {.point = 0.5 * (on_a + on_b), .displacement = kept + across(on_a - on_b), .twist = spring.twist + spring.arm * angle};
}

StickArms arms_of(std::span<const Vec3> points, std::span<const double> area, std::span<const double> pressure,
                  const Vec3& centre, const Vec3& normal) {
  StickArms arms;
  double all = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 arm = points[i] - centre;
    const double load = area[i] * pressure[i], along = arm.dot(normal);
    const double square = std::max(0.0, arm.squaredNorm() - along * along);
    arms.root_mean_square += load * square;
    arms.mean += load * std::sqrt(square);
    all += load;
  }
  if (!(all > 0.0)) return {};
  return {.root_mean_square = std::sqrt(arms.root_mean_square / all), .mean = arms.mean / all};
}

double stick_energy(const StickRule& rule, const StickState& state) {
  double sum = 0.0;
  for (const StickSpring& s : state.spring) sum += 0.5 * rule.stiffness * (s.displacement[0].squaredNorm() + s.twist * s.twist);
  return sum;
}

void commit_sticks(std::span<const ContactBody> bodies, const ContactRules& rules, const ContactSurface& surface,
                   const StickRule& rule, const std::vector<std::uint8_t>& resting, StickState& state) {
  std::vector<StickSpring> next;
  implicit::FieldParts row;
  const auto rests = [&](std::uint32_t i) { return i < resting.size() ? resting[i] != 0 : bodies[i].fixed; };
  for (const StickSpring& s : state.spring) {
    const bool asleep = rests(s.pair.a) && rests(s.pair.b);
    if (asleep) next.push_back(s);
  }
  Range points;
  for (std::uint32_t k = 0; k < surface.summary.size(); ++k) {
    const ContactSurface::Summary& summary = surface.summary[k];
    points = advance_range(surface.pair, points.end, k);
    const double load = summary.force.norm();
    if (!(load > 0.0)) continue;
    const ContactBody &a = bodies[summary.bodies.a], &b = bodies[summary.bodies.b];
    const double friction = material_of(bodies, rules, summary.bodies).friction;
    if (!(friction > 0.0)) continue;
    const Vec3 normal = -summary.force / load;
    const auto of_pair = [&points](const auto& array) { return std::span(array).subspan(points.begin, points.end - points.begin); };
    const StickArms arms = arms_of(of_pair(surface.point), of_pair(surface.area), of_pair(surface.pressure), summary.centre_of_pressure, normal);
    Vec3 displacement = Vec3::Zero();
    double twist = 0.0;
    if (const StickSpring* before = state.find(summary.bodies)) {
      const StickTrial trial = stretch(*before, a, b, normal);
      displacement = trial.displacement;
      const double length = displacement.norm(), most = friction * load / rule.stiffness;
      if (length > most) displacement *= most / length;
      const double most_twist = before->arm > 0.0 ? most * arms.mean / before->arm : 0.0;
      twist = std::clamp(trial.twist, -most_twist, most_twist);
    }
    StickSpring s;
    s.pair = summary.bodies;
    s.arm = arms.root_mean_square;
    s.twist = twist;
    for (const int side : {0, 1}) {
      const ContactBody& body = side == 0 ? a : b;
      s.part[side] = part_at(body, summary.centre_of_pressure, row);
      const Pose& pose = body.pose[s.part[side]];
      const Quat back = pose.orientation.conjugate();
      s.anchor[side] = back * (summary.centre_of_pressure - pose.position);
      s.displacement[side] = back * displacement;
    }
    s.relative = a.pose[s.part[0]].orientation.conjugate() * b.pose[s.part[1]].orientation;
    next.push_back(s);
  }
  std::sort(next.begin(), next.end(), [](const StickSpring& x, const StickSpring& y) { return x.pair < y.pair; });
  state.spring = std::move(next);
}

}  // namespace supple::collision
