// AVX2 and AVX-512 variants only; AES support must not decide which variant a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "integrate/contact_lanes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "integrate/contact_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace supple::core::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using D = hn::CappedTag<double, kContactLanes>;
using V = hn::Vec<D>;
constexpr std::size_t kWidth = hn::MaxLanes(D());

struct V3 {
  V x, y, z;
};

HWY_INLINE V set(double value) { return hn::Set(D(), value); }
HWY_INLINE V load(const std::vector<double>& values, std::size_t q) { return hn::LoadU(D(), values.data() + q); }
HWY_INLINE V3 load(const LaneVectors& values, std::size_t q) { return {load(values.x, q), load(values.y, q), load(values.z, q)}; }
HWY_INLINE void store(V v, std::vector<double>& values, std::size_t q) { hn::StoreU(v, D(), values.data() + q); }
HWY_INLINE void store(const V3& v, LaneVectors& values, std::size_t q) {
  store(v.x, values.x, q);
  store(v.y, values.y, q);
  store(v.z, values.z, q);
}
HWY_INLINE V3 set(const Vec3& v) { return {set(v.x()), set(v.y()), set(v.z())}; }
HWY_INLINE V dot(const V3& a, const V3& b) { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); }
/// a + s b
HWY_INLINE V3 add(const V3& a, V s, const V3& b) { return {hn::MulAdd(s, b.x, a.x), hn::MulAdd(s, b.y, a.y), hn::MulAdd(s, b.z, a.z)}; }
HWY_INLINE V3 scaled(V s, const V3& a) { return {hn::Mul(s, a.x), hn::Mul(s, a.y), hn::Mul(s, a.z)}; }
HWY_INLINE V3 cross(const V3& a, const V3& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)), hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}

/// K sums over the points of a group, in eight lanes that are added in fixed order whatever the vector width. `body(q, sums)` adds the points at q.
template <std::size_t K, class Body>
HWY_INLINE std::array<double, K> sum_over(const LaneGroup& group, const Body& body) {
  alignas(64) double lanes[K][kContactLanes];
  for (std::size_t lane = 0; lane < kContactLanes; lane += kWidth) {
    V sums[K];
    for (V& sum : sums) sum = hn::Zero(D());
    for (std::size_t q = group.begin + lane; q < group.end; q += kContactLanes) body(q, sums);
    for (std::size_t k = 0; k < K; ++k) hn::Store(sums[k], D(), lanes[k] + lane);
  }
  const hn::FixedTag<double, 4> four;
  const hn::FixedTag<double, 2> two;
  std::array<double, K> totals;
  for (std::size_t k = 0; k < K; ++k) {
    const auto halves = hn::Add(hn::Load(four, lanes[k]), hn::Load(four, lanes[k] + 4));
    const auto quarters = hn::Add(hn::LowerHalf(two, halves), hn::UpperHalf(two, halves));
    totals[k] = hn::GetLane(quarters) + hn::ExtractLane(quarters, 1);
  }
  return totals;
}

template <class Body>
HWY_INLINE void for_points(const LaneGroup& group, const Body& body) {
  for (std::size_t q = group.begin; q < group.end; q += kWidth) body(q);
}

/// The pressure and the factor of damping at the approach, both at least zero.
struct Press {
  V pressure, damping;
};

HWY_INLINE Press press(const ContactLanes& lanes, const LaneGroup& group, std::size_t q) {
  const V approach = load(lanes.approach, q);
  return {hn::Max(hn::MulAdd(load(lanes.slope, q), approach, load(lanes.offset_pressure, q)), hn::Zero(D())),
          hn::Max(hn::MulAdd(set(group.damping), approach, set(1.0)), hn::Zero(D()))};
}

HWY_INLINE V normal_force(const ContactLanes& lanes, const LaneGroup& group, std::size_t q) {
  const Press at = press(lanes, group, q);
  return hn::Mul(load(lanes.weight, q), hn::Mul(at.pressure, at.damping));
}

/// The integral of the normal force over the approach.
HWY_INLINE V normal_potential(const ContactLanes& lanes, const LaneGroup& group, std::size_t q) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const V zero = hn::Zero(D()), approach = load(lanes.approach, q), g = load(lanes.slope, q), p0 = load(lanes.offset_pressure, q);
  // The point presses from the approach where its pressure or its damping factor is zero.
  V from = hn::IfThenElse(hn::Gt(g, zero), hn::Div(hn::Neg(p0), g), hn::IfThenElse(hn::Gt(p0, zero), set(-kInfinity), set(kInfinity)));
  if (group.damping > 0.0) from = hn::Max(from, set(-1.0 / group.damping));
  const V d = set(group.damping), t = hn::Sub(approach, from);
  const V p = hn::Max(hn::MulAdd(g, from, p0), zero), f = hn::Max(hn::MulAdd(d, from, set(1.0)), zero);
  const V linear = hn::Mul(p, f), square = hn::Mul(set(0.5), hn::MulAdd(p, d, hn::Mul(g, f))), cube = hn::Mul(set(1.0 / 3.0), hn::Mul(g, d));
  const V integral = hn::Mul(t, hn::MulAdd(t, hn::MulAdd(t, cube, square), linear));
  const V constant = hn::Mul(p0, approach);  // neither slope nor damping
  return hn::Mul(load(lanes.weight, q), hn::IfThenElseZero(hn::Gt(approach, from), hn::IfThenElse(hn::Eq(from, set(-kInfinity)), constant, integral)));
}

HWY_INLINE V normal_stiffness(const ContactLanes& lanes, const LaneGroup& group, std::size_t q) {
  const Press at = press(lanes, group, q);
  const auto presses = hn::And(hn::Gt(at.pressure, hn::Zero(D())), hn::Gt(at.damping, hn::Zero(D())));
  const V stiffness = hn::MulAdd(load(lanes.slope, q), at.damping, hn::Mul(at.pressure, set(group.damping)));
  return hn::IfThenElseZero(presses, hn::Mul(load(lanes.weight, q), stiffness));
}

/// Friction over its largest value at the slip v is f = slope v, by f1(y) = 2 y - y^2 below 1, 1 beyond; its derivative is slope 1 - fall f v^T.
struct Secant {
  V slope;  // [s/m]
  V fall;   // [s^2/m^2]
};

HWY_INLINE Secant secant_of(V speed, double slow) {
  const V one = set(1.0), inverse = hn::Div(one, hn::Max(speed, set(std::numeric_limits<double>::min())));
  const V rest = hn::NegMulAdd(speed, set(1.0 / slow), set(2.0));  // 2 - y
  const auto slides = hn::Ge(speed, set(slow)), moves = hn::Gt(speed, hn::Zero(D()));
  const V faded = hn::IfThenElseZero(moves, hn::Div(inverse, hn::Mul(set(slow), rest)));
  return {hn::IfThenElse(slides, inverse, hn::Mul(rest, set(1.0 / slow))), hn::IfThenElse(slides, hn::Mul(inverse, inverse), faded)};
}

/// The integral of f1.
HWY_INLINE V mollified(V y) {
  const V third = set(1.0 / 3.0);
  return hn::IfThenElse(hn::Lt(y, set(1.0)), hn::Mul(hn::Mul(y, y), hn::NegMulAdd(y, third, set(1.0))), hn::Sub(y, third));
}

HWY_INLINE V3 displacement(const ContactLanes& lanes, const Twist& twist, std::size_t q) {
  const V3 turned = cross(set(twist.turning), load(lanes.local, q)), led = load(lanes.led, q), moved = set(twist.moved);
  return {hn::Add(hn::Add(moved.x, turned.x), led.x), hn::Add(hn::Add(moved.y, turned.y), led.y), hn::Add(hn::Add(moved.z, turned.z), led.z)};
}

HWY_INLINE V3 gradient_at(const ContactLanes& lanes, const LaneGroup& group, std::size_t q) {
  const V3 normal = scaled(normal_force(lanes, group, q), load(lanes.normal, q));
  if (!(group.friction > 0.0)) return normal;
  const V most = hn::Mul(set(group.friction), load(lanes.lagged, q));
  return add(normal, hn::Mul(most, secant_of(load(lanes.speed, q), group.slow).slope), load(lanes.slip, q));
}

void PlacePoints(ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double slip_rate, double back) {
  for_points(group, [&](std::size_t q) HWY_ATTR {
    const V3 u = displacement(lanes, twist, q), n = load(lanes.normal, q);
    const V3 v = add(scaled(set(slip_rate), u), set(-back), load(lanes.start_velocity, q));
    const V3 slip = add(v, hn::Neg(dot(v, n)), n);
    store(dot(u, n), lanes.approach, q);
    store(slip, lanes.slip, q);
    store(hn::Sqrt(dot(slip, slip)), lanes.speed, q);
  });
}

LagSums LagForces(ContactLanes& lanes, const LaneGroup& group) {
  const auto [change, all] = sum_over<2>(group, [&](std::size_t q, V (&sums)[2]) HWY_ATTR {
    const V force = normal_force(lanes, group, q);
    sums[0] = hn::Add(sums[0], hn::Abs(hn::Sub(force, load(lanes.lagged, q))));
    sums[1] = hn::Add(sums[1], force);
    store(force, lanes.lagged, q);
  });
  return {change, all};
}

double PotentialOf(const ContactLanes& lanes, const LaneGroup& group, double slip_rate) {
  const double scale = group.friction * group.slow / slip_rate;
  return sum_over<1>(group, [&](std::size_t q, V (&sums)[1]) HWY_ATTR {
    V value = normal_potential(lanes, group, q);
    if (scale > 0.0) {
      const V y = hn::Mul(load(lanes.speed, q), set(1.0 / group.slow));
      value = hn::MulAdd(hn::Mul(set(scale), load(lanes.lagged, q)), mollified(y), value);
    }
    sums[0] = hn::Add(sums[0], value);
  })[0];
}

Wrench GradientOf(const ContactLanes& lanes, const LaneGroup& group) {
  const auto s = sum_over<6>(group, [&](std::size_t q, V (&sums)[6]) HWY_ATTR {
    const V3 f = gradient_at(lanes, group, q), moment = cross(load(lanes.local, q), f);
    sums[0] = hn::Add(sums[0], f.x);
    sums[1] = hn::Add(sums[1], f.y);
    sums[2] = hn::Add(sums[2], f.z);
    sums[3] = hn::Add(sums[3], moment.x);
    sums[4] = hn::Add(sums[4], moment.y);
    sums[5] = hn::Add(sums[5], moment.z);
  });
  return {{s[0], s[1], s[2]}, {s[3], s[4], s[5]}};
}

/// Adds (s a) b^T + b (s a)^T to the 21 sums of a symmetric matrix's lower half, by columns; half of it where a is b.
HWY_INLINE void add_product(const V (&a)[6], const V (&b)[6], bool same, V* sums) {
  std::size_t k = 0;
  for (std::size_t c = 0; c < 6; ++c) {
    for (std::size_t r = c; r < 6; ++r, ++k) {
      sums[k] = hn::MulAdd(a[r], b[c], sums[k]);
      if (!same) sums[k] = hn::MulAdd(b[r], a[c], sums[k]);
    }
  }
}

Mat6 StiffnessOf(const ContactLanes& lanes, const LaneGroup& group, const Vec3& offset, double slip_rate) {
  constexpr std::size_t kMatrix = 21, kAll = kMatrix, kFirst = kAll + 1, kSecond = kFirst + 3, kSums = kSecond + 6;
  const auto s = sum_over<kSums>(group, [&](std::size_t q, V (&sums)[kSums]) HWY_ATTR {
    const V3 x = add(load(lanes.local, q), set(1.0), set(offset)), n = load(lanes.normal, q), arm = cross(x, n);
    V stiffness = normal_stiffness(lanes, group, q);
    if (group.friction > 0.0) {
      const V scale = hn::Mul(set(group.friction * slip_rate), load(lanes.lagged, q));
      const Secant secant = secant_of(load(lanes.speed, q), group.slow);
      const V a = hn::Mul(scale, secant.slope), b = hn::Mul(hn::Mul(set(-0.5), scale), secant.fall);
      stiffness = hn::Sub(stiffness, a);
      const V3 v = scaled(b, load(lanes.slip, q)), f = load(lanes.direction, q), v_arm = cross(x, v), f_arm = cross(x, f);
      const V along[6] = {v.x, v.y, v.z, v_arm.x, v_arm.y, v_arm.z}, direction[6] = {f.x, f.y, f.z, f_arm.x, f_arm.y, f_arm.z};
      add_product(along, direction, false, sums);
      const V3 first = scaled(a, x);
      sums[kAll] = hn::Add(sums[kAll], a);
      sums[kFirst] = hn::Add(sums[kFirst], first.x);
      sums[kFirst + 1] = hn::Add(sums[kFirst + 1], first.y);
      sums[kFirst + 2] = hn::Add(sums[kFirst + 2], first.z);
      sums[kSecond] = hn::MulAdd(first.x, x.x, sums[kSecond]);
      sums[kSecond + 1] = hn::MulAdd(first.x, x.y, sums[kSecond + 1]);
      sums[kSecond + 2] = hn::MulAdd(first.x, x.z, sums[kSecond + 2]);
      sums[kSecond + 3] = hn::MulAdd(first.y, x.y, sums[kSecond + 3]);
      sums[kSecond + 4] = hn::MulAdd(first.y, x.z, sums[kSecond + 4]);
      sums[kSecond + 5] = hn::MulAdd(first.z, x.z, sums[kSecond + 5]);
    }
    const V across[6] = {n.x, n.y, n.z, arm.x, arm.y, arm.z};
    const V pressed[6] = {hn::Mul(stiffness, n.x),   hn::Mul(stiffness, n.y),   hn::Mul(stiffness, n.z),
                          hn::Mul(stiffness, arm.x), hn::Mul(stiffness, arm.y), hn::Mul(stiffness, arm.z)};
    add_product(pressed, across, true, sums);
  });
  Mat6 sum;
  std::size_t k = 0;
  for (Eigen::Index c = 0; c < 6; ++c) {
    for (Eigen::Index r = c; r < 6; ++r) sum(r, c) = sum(c, r) = s[k++];
  }
  const double* const m = s.data() + kSecond;
  const double trace = m[0] + m[3] + m[5];
  Mat3 second, first;
  second << trace - m[0], -m[1], -m[2], -m[1], trace - m[3], -m[4], -m[2], -m[4], trace - m[5];
  first << 0.0, -s[kFirst + 2], s[kFirst + 1], s[kFirst + 2], 0.0, -s[kFirst], -s[kFirst + 1], s[kFirst], 0.0;
  sum.topLeftCorner<3, 3>() += s[kAll] * Mat3::Identity();
  sum.topRightCorner<3, 3>() -= first;
  sum.bottomLeftCorner<3, 3>() += first;
  sum.bottomRightCorner<3, 3>() += second;
  return sum;
}

double PredictDirections(ContactLanes& lanes, const LaneGroup& group, const Twist& correction, double slip_rate) {
  V largest2 = hn::Zero(D());
  for_points(group, [&](std::size_t q) HWY_ATTR {
    const V3 turned = cross(set(correction.turning), load(lanes.local, q)), n = load(lanes.normal, q);
    const V3 u = add(turned, set(1.0), set(correction.moved)), change = scaled(set(slip_rate), add(u, hn::Neg(dot(u, n)), n));
    const V3 v = load(lanes.slip, q), f = load(lanes.direction, q);
    const auto rubs = hn::Gt(load(lanes.lagged, q), hn::Zero(D()));
    const Secant secant = secant_of(load(lanes.speed, q), group.slow);
    const V3 next = add(scaled(secant.slope, add(v, set(1.0), change)), hn::Neg(hn::Mul(secant.fall, dot(v, change))), f);
    const V shorter = hn::Div(set(1.0), hn::Max(set(1.0), hn::Sqrt(dot(next, next))));
    store({hn::IfThenElse(rubs, hn::Mul(next.x, shorter), f.x), hn::IfThenElse(rubs, hn::Mul(next.y, shorter), f.y),
           hn::IfThenElse(rubs, hn::Mul(next.z, shorter), f.z)},
          lanes.next_direction, q);
    largest2 = hn::Max(largest2, hn::IfThenElseZero(rubs, dot(change, change)));
  });
  return std::sqrt(hn::GetLane(hn::MaxOfLanes(D(), largest2)));
}

double ElasticForceOf(const ContactLanes& lanes, const LaneGroup& group) {
  return sum_over<1>(group, [&](std::size_t q, V (&sums)[1]) HWY_ATTR {
    sums[0] = hn::MulAdd(load(lanes.weight, q), press(lanes, group, q).pressure, sums[0]);
  })[0];
}

PowerSums PowersOf(const ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double rate, double start_share) {
  const auto [dissipated, led] = sum_over<2>(group, [&](std::size_t q, V (&sums)[2]) HWY_ATTR {
    const V3 gradient = gradient_at(lanes, group, q), n = load(lanes.normal, q);
    const V elastic = hn::Mul(load(lanes.weight, q), press(lanes, group, q).pressure);
    const V3 v = add(scaled(set(rate), displacement(lanes, twist, q)), set(start_share), load(lanes.start_velocity, q));
    sums[0] = hn::Add(sums[0], dot(add(gradient, hn::Neg(elastic), n), v));
    sums[1] = hn::Sub(sums[1], dot(gradient, load(lanes.led, q)));
  });
  return {dissipated, led};
}

}  // namespace
}  // namespace supple::core::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::core {

HWY_EXPORT(PlacePoints);
HWY_EXPORT(LagForces);
HWY_EXPORT(PotentialOf);
HWY_EXPORT(GradientOf);
HWY_EXPORT(StiffnessOf);
HWY_EXPORT(PredictDirections);
HWY_EXPORT(ElasticForceOf);
HWY_EXPORT(PowersOf);

void ContactLanes::assign(std::size_t count) {
  for (LaneVectors* vectors : {&local, &normal, &start_velocity, &led, &slip, &direction, &next_direction}) vectors->assign(count);
  for (std::vector<double>* values : {&weight, &slope, &offset_pressure, &approach, &speed, &lagged}) values->assign(count, 0.0);
}

void place_points(ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double slip_rate, double back) {
  HWY_DYNAMIC_DISPATCH(PlacePoints)(lanes, group, twist, slip_rate, back);
}

LagSums lag_forces(ContactLanes& lanes, const LaneGroup& group) { return HWY_DYNAMIC_DISPATCH(LagForces)(lanes, group); }

double potential_of(const ContactLanes& lanes, const LaneGroup& group, double slip_rate) {
  return HWY_DYNAMIC_DISPATCH(PotentialOf)(lanes, group, slip_rate);
}

Wrench gradient_of(const ContactLanes& lanes, const LaneGroup& group) { return HWY_DYNAMIC_DISPATCH(GradientOf)(lanes, group); }

Mat6 stiffness_of(const ContactLanes& lanes, const LaneGroup& group, const Vec3& offset, double slip_rate) {
  return HWY_DYNAMIC_DISPATCH(StiffnessOf)(lanes, group, offset, slip_rate);
}

double predict_directions(ContactLanes& lanes, const LaneGroup& group, const Twist& correction, double slip_rate) {
  return HWY_DYNAMIC_DISPATCH(PredictDirections)(lanes, group, correction, slip_rate);
}

double elastic_force_of(const ContactLanes& lanes, const LaneGroup& group) { return HWY_DYNAMIC_DISPATCH(ElasticForceOf)(lanes, group); }

PowerSums powers_of(const ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double rate, double start_share) {
  return HWY_DYNAMIC_DISPATCH(PowersOf)(lanes, group, twist, rate, start_share);
}

}  // namespace supple::core
#endif  // HWY_ONCE
