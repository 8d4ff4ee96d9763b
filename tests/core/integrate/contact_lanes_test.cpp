// Sums over contact points in lanes against one point at a time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/support.h"
#include "integrate/contact_lanes.h"

namespace supple::core {
namespace {

using test::Draw;
using Vec6 = Eigen::Matrix<double, 6, 1>;

constexpr double kSlipRate = 1.1 / 0.01, kBack = 0.1;

/// The formulas of `compliant_contact.h` for one point.
struct Point {
  Vec3 local, normal, start_velocity, led, direction;
  double weight, slope, offset_pressure, friction, damping, slow;
  double lagged = 0.0;
  Vec3 displacement = Vec3::Zero(), slip = Vec3::Zero();
  double approach = 0.0;

  void place(const Twist& twist) {
    displacement = twist.moved + twist.turning.cross(local) + led;
    approach = displacement.dot(normal);
    const Vec3 v = kSlipRate * displacement - kBack * start_velocity;
    slip = v - v.dot(normal) * normal;
  }
  [[nodiscard]] double pressure(double at) const { return std::max(offset_pressure + slope * at, 0.0); }
  [[nodiscard]] double force(double at) const { return weight * pressure(at) * std::max(1.0 + damping * at, 0.0); }
  /// By Simpson's rule, which is exact for cubics, from where the point begins to press.
  [[nodiscard]] double potential() const {
    double from = -std::numeric_limits<double>::infinity();
    if (slope > 0.0) {
      from = -offset_pressure / slope;
    } else if (!(offset_pressure > 0.0)) {
      return 0.0;
    }
    if (damping > 0.0) from = std::max(from, -1.0 / damping);
    const double normal_part = std::isinf(from) ? weight * offset_pressure * approach
                               : approach > from ? (approach - from) / 6.0 * (force(from) + 4.0 * force(0.5 * (from + approach)) + force(approach))
                                                 : 0.0;
    const double y = slip.norm() / slow;
    return normal_part + friction * lagged * slow / kSlipRate * (y < 1.0 ? y * y * (1.0 - y / 3.0) : y - 1.0 / 3.0);
  }
  /// f1(y) / speed.
  [[nodiscard]] double secant() const {
    const double speed = slip.norm(), y = speed / slow;
    return y < 1.0 ? (2.0 - y) / slow : 1.0 / speed;
  }
  /// Of the secant by the speed, over -speed: its derivative is slope 1 - fall f v^T with f = slope v.
  [[nodiscard]] double fall() const {
    const double speed = slip.norm();
    if (speed >= slow) return 1.0 / (speed * speed);
    return speed > 0.0 ? 1.0 / (slow * speed * (2.0 - speed / slow)) : 0.0;
  }
  [[nodiscard]] Vec3 gradient() const { return force(approach) * normal + friction * lagged * secant() * slip; }
  [[nodiscard]] Eigen::Matrix<double, 6, 6> stiffness(const Vec3& offset) const {
    const Vec3 x = local + offset;
    const bool presses = pressure(approach) > 0.0 && 1.0 + damping * approach > 0.0;
    const double k = presses ? weight * (slope * (1.0 + damping * approach) + pressure(approach) * damping) : 0.0;
    const double scale = friction * lagged * kSlipRate;
    const Mat3 of_point = k * normal * normal.transpose() + scale * secant() * (Mat3::Identity() - normal * normal.transpose()) -
                          0.5 * scale * fall() * (direction * slip.transpose() + slip * direction.transpose());
    Eigen::Matrix<double, 3, 6> map = Eigen::Matrix<double, 3, 6>::Zero();
    map.leftCols<3>() = Mat3::Identity();
    map.rightCols<3>() << 0.0, x.z(), -x.y(), -x.z(), 0.0, x.x(), x.y(), -x.x(), 0.0;
    return map.transpose() * of_point * map;
  }
  [[nodiscard]] Vec3 change(const Twist& twist) const {
    const Vec3 u = twist.moved + twist.turning.cross(local);
    return kSlipRate * (u - u.dot(normal) * normal);
  }
  [[nodiscard]] Vec3 next_direction(const Twist& twist) const {
    if (!(lagged > 0.0)) return direction;
    const Vec3 next = secant() * (slip + change(twist)) - fall() * slip.dot(change(twist)) * direction;
    return next / std::max(1.0, next.norm());
  }
};

/// A group of random points, and the same in lanes between two groups of others.
struct Drawn {
  std::vector<Point> points;
  ContactLanes lanes;
  LaneGroup group;
  Twist twist;

  Drawn(Draw& draw, int count, bool friction, bool damping) {
    group = {.begin = kContactLanes, .end = kContactLanes + (static_cast<std::size_t>(count) + kContactLanes - 1) / kContactLanes * kContactLanes,
             .friction = friction ? 0.4 : 0.0, .damping = damping ? 30.0 : 0.0, .slow = 0.5};
    lanes.assign(group.end + kContactLanes);
    twist = {.moved = draw.vector(0.01), .turning = draw.vector(0.02)};
    for (int k = 0; k < count; ++k) {
      const std::size_t lane = group.begin + static_cast<std::size_t>(k);
      Point p{.local = draw.vector(0.3), .normal = draw.vector(1.0).normalized(), .start_velocity = draw.vector(1.0), .led = draw.vector(0.005),
              .direction = draw.vector(0.5), .weight = 0.01, .slope = k % 4 == 1 ? 0.0 : 1e5, .offset_pressure = k % 3 == 2 ? -500.0 : 800.0,
              .friction = group.friction, .damping = group.damping, .slow = group.slow};
      if (k % 5 == 3) {  // at rest, without rounding
        p.local = p.start_velocity = Vec3::Zero();
        p.led = -twist.moved;
      }
      if (k % 5 == 4) p.led = -twist.moved - twist.turning.cross(p.local) + (kBack * p.start_velocity + draw.vector(0.2)) / kSlipRate;  // nearly
      p.place(twist);
      p.lagged = std::max(0.0, p.force(p.approach));
      points.push_back(p);
      lanes.local.set(lane, p.local);
      lanes.normal.set(lane, p.normal);
      lanes.start_velocity.set(lane, p.start_velocity);
      lanes.led.set(lane, p.led);
      lanes.direction.set(lane, p.direction);
      lanes.weight[lane] = p.weight;
      lanes.slope[lane] = p.slope;
      lanes.offset_pressure[lane] = p.offset_pressure;
    }
    for (const std::size_t other : {std::size_t{0}, group.end}) {  // must not be counted
      lanes.weight[other] = lanes.offset_pressure[other] = lanes.lagged[other] = 1e6;
    }
    place_points(lanes, group, twist, kSlipRate, kBack);
  }
};

constexpr double kRounding = 1e-13;  // of sums of at most 40 terms, each of some ten operations

TEST(ContactLanes, SumWhatOnePointAfterAnotherGives) {
  Draw draw(31);
  for (int count = 1; count <= 40; ++count) {
    Drawn drawn(draw, count, count % 3 != 0, count % 2 == 0);
    ContactLanes& lanes = drawn.lanes;
    double force = 0.0, elastic = 0.0, value = 0.0, size = 0.0, power = 0.0, led = 0.0, powers = 0.0, slip = 0.0;
    Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
    Eigen::Matrix<double, 6, 6> stiffness = Eigen::Matrix<double, 6, 6>::Zero();
    const Vec3 offset = draw.vector(1.0);
    const Twist correction{.moved = draw.vector(0.01), .turning = draw.vector(0.01)};
    for (const Point& p : drawn.points) {
      force += p.lagged;
      elastic += p.weight * p.pressure(p.approach);
      value += p.potential();
      size += std::abs(p.potential());
      sum += p.gradient();
      moment += p.local.cross(p.gradient());
      stiffness += p.stiffness(offset);
      const Vec3 v = 50.0 * p.displacement + 0.5 * p.start_velocity, dissipative = p.gradient() - p.weight * p.pressure(p.approach) * p.normal;
      power += dissipative.dot(v);
      powers += dissipative.norm() * v.norm() + p.gradient().norm() * p.led.norm();
      led -= p.gradient().dot(p.led);
      if (p.lagged > 0.0) slip = std::max(slip, p.change(correction).norm());
    }
    const LagSums lag = lag_forces(lanes, drawn.group);
    EXPECT_NEAR(lag.all, force, kRounding * force);
    EXPECT_NEAR(lag.change, force, kRounding * force);
    EXPECT_EQ(lag_forces(lanes, drawn.group).change, 0.0);
    EXPECT_NEAR(elastic_force_of(lanes, drawn.group), elastic, kRounding * elastic);
    EXPECT_NEAR(potential_of(lanes, drawn.group, kSlipRate), value, kRounding * size);
    const Wrench wrench = gradient_of(lanes, drawn.group);
    const double forces = 2.0 * force + 1.0;  // friction adds its share
    EXPECT_LT((wrench.force - sum).norm(), kRounding * forces) << count;
    EXPECT_LT((wrench.moment - moment).norm(), kRounding * forces) << count;
    const Eigen::Matrix<double, 6, 6> found = stiffness_of(lanes, drawn.group, offset, kSlipRate);
    EXPECT_LT((found - stiffness).cwiseAbs().maxCoeff(), kRounding * stiffness.cwiseAbs().maxCoeff()) << count;
    EXPECT_EQ(found, found.transpose());
    const PowerSums of = powers_of(lanes, drawn.group, drawn.twist, 50.0, 0.5);
    EXPECT_NEAR(of.dissipated, power, kRounding * powers);
    EXPECT_NEAR(of.led, led, kRounding * powers);
    EXPECT_NEAR(predict_directions(lanes, drawn.group, correction, kSlipRate), slip, kRounding * (slip + 1.0));
    for (std::size_t k = 0; k < drawn.points.size(); ++k) {
      const std::size_t lane = drawn.group.begin + k;
      EXPECT_LT((lanes.next_direction.at(lane) - drawn.points[k].next_direction(correction)).norm(), kRounding) << count << ' ' << k;
    }
  }
}

TEST(ContactLanes, LeavePointsThatFillUpAGroupAlone) {
  Draw draw(32);
  Drawn drawn(draw, 3, true, true);
  lag_forces(drawn.lanes, drawn.group);
  const Twist correction{.moved = Vec3(1.0, 2.0, 3.0), .turning = Vec3::UnitX()};
  EXPECT_GT(predict_directions(drawn.lanes, drawn.group, correction, kSlipRate), 0.0);
  for (std::size_t lane = drawn.group.begin + 3; lane < drawn.group.end; ++lane) {
    EXPECT_EQ(drawn.lanes.lagged[lane], 0.0);
    EXPECT_EQ(drawn.lanes.next_direction.at(lane), Vec3::Zero().eval());
  }
}

}  // namespace
}  // namespace supple::core
