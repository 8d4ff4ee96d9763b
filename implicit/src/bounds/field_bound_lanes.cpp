// Bounds of sums of Wyvill points, eight primitives at a time: f on a box lies between (1 - q_far / R^2)^3 and
// (1 - q_near / R^2)^3. Sums run in eight virtual lanes that are added in fixed order, whatever the vector width.
#define HWY_DISABLE_PCLMUL_AES

#include <algorithm>
#include <bit>

#include "field/field_lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bounds/field_bound_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace supple::implicit::lanes::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using Full = hn::CappedTag<double, kPack>;

/// The eight sums of one quantity.
struct alignas(64) LaneSums {
  double lane[kPack] = {};

  [[nodiscard]] double total() const {
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
  }
};

HWY_INLINE void add(LaneSums& sums, std::size_t lane, hn::Vec<Full> v) {
  const Full d;
  hn::Store(hn::Add(hn::Load(d, sums.lane + lane), v), d, sums.lane + lane);
}

struct Totals {
  LaneSums lower, upper, slope, slope_scale;
  double terms = 0.0;
};

template <bool kSlope>
HWY_INLINE void add_leaf(const LeafPack& leaf, const Bounds& box, Totals& totals) {
  const Full d;
  using V = hn::Vec<Full>;
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  for (std::size_t lane = 0; lane < kPack; lane += kLanes) {
    V near2 = hn::Zero(d), far2 = hn::Zero(d);
    const auto add_axis = [&](std::size_t axis) HWY_ATTR {
      const V p = hn::Load(d, leaf.lower[axis] + lane);
      const V below = hn::Sub(p, hn::Set(d, box.upper[axis]));
      const V above = hn::Sub(hn::Set(d, box.lower[axis]), p);
      const V gap = hn::Max(hn::Max(below, above), hn::Zero(d));
      const V far = hn::Max(hn::Abs(below), hn::Abs(above));
      near2 = hn::MulAdd(gap, gap, near2);
      far2 = hn::MulAdd(far, far, far2);
    };
    add_axis(0);
    add_axis(1);
    add_axis(2);
    const auto touched = hn::Le(near2, hn::Load(d, leaf.reach2 + lane));
    const V inverse_r2 = hn::Load(d, leaf.inverse_r2 + lane);
    const V one = hn::Set(d, 1.0);
    const auto kernel_base = [&](V q) HWY_ATTR { return hn::Max(hn::NegMulAdd(q, inverse_r2, one), hn::Zero(d)); };
    const V most = kernel_base(near2);
    const V least = kernel_base(far2);
    add(totals.upper, lane, hn::IfThenElseZero(touched, hn::Mul(most, hn::Mul(most, most))));
    add(totals.lower, lane, hn::IfThenElseZero(touched, hn::Mul(least, hn::Mul(least, least))));
    totals.terms += static_cast<double>(hn::CountTrue(d, touched));
    if constexpr (kSlope) {
      // |df/dd| = (6 s / R) (1 - s^2)^2 with s = d / R peaks at s^2 = 1/5.
      const V steepest = hn::Set(d, 0.2);
      const V s2 = hn::Min(hn::Max(steepest, hn::Mul(near2, inverse_r2)), hn::Mul(far2, inverse_r2));
      const V t = hn::Max(hn::Sub(one, s2), hn::Zero(d));
      const V inverse_r = hn::Sqrt(inverse_r2);
      const V factor = hn::Mul(hn::Set(d, 6.0), inverse_r);
      const V slope = hn::Mul(hn::Mul(factor, hn::Sqrt(s2)), hn::Mul(t, t));
      // Zero where t is: sqrt of an infinite far distance times zero would be no number.
      add(totals.slope, lane, hn::IfThenElseZero(hn::And(touched, hn::Gt(t, hn::Zero(d))), slope));
      add(totals.slope_scale, lane, hn::IfThenElseZero(touched, factor));
    }
  }
}

template <bool kSlope>
HWY_INLINE BoundSums sum_over(const Field::Index& index, const Bounds& box) {
  const Full d;
  using V = hn::Vec<Full>;
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  Totals totals;
  BoundSums sums;
  if (index.level_count == 0) {
    for (const LeafPack& leaf : index.leaf) add_leaf<kSlope>(leaf, box, totals);
  } else {
    struct Entry {
      std::size_t level, pack;
    };
    Entry stack[kPack * 12];
    std::size_t depth = 0;
    stack[depth++] = {index.level_count, 0};
    while (depth > 0) {
      const Entry entry = stack[--depth];
      if (entry.level == 0) {
        add_leaf<kSlope>(index.leaf[entry.pack], box, totals);
        continue;
      }
      const NodePack& node = index.level[entry.level - 1][entry.pack];
      for (std::size_t lane = 0; lane < kPack; lane += kLanes) {
        const auto relation = [&](std::size_t axis, auto& meets, auto& inside) HWY_ATTR {
          const V low = hn::Load(d, node.lower[axis] + lane), high = hn::Load(d, node.upper[axis] + lane);
          const V box_low = hn::Set(d, box.lower[axis]), box_high = hn::Set(d, box.upper[axis]);
          meets = hn::And(meets, hn::And(hn::Le(low, box_high), hn::Le(box_low, high)));
          inside = hn::And(inside, hn::And(hn::Le(box_low, low), hn::Le(high, box_high)));
        };
        auto meets = hn::FirstN(d, kLanes), inside = meets;
        relation(0, meets, inside);
        relation(1, meets, inside);
        relation(2, meets, inside);
        std::uint8_t met[8], whole[8];
        hn::StoreMaskBits(d, meets, met);
        hn::StoreMaskBits(d, inside, whole);
        for (unsigned left = met[0]; left != 0; left &= left - 1) {
          const auto bit = static_cast<std::size_t>(std::countr_zero(left));
          const std::size_t slot = lane + bit;
          if ((whole[0] >> bit & 1u) != 0) {
            sums.upper += node.peak[slot];
            sums.scale += node.peak[slot];
            sums.slope += node.lipschitz[slot];
            sums.slope_scale += node.lipschitz[slot];
            sums.terms += 1.0;
          } else {
            stack[depth++] = {entry.level - 1, entry.pack * kPack + slot};
          }
        }
      }
    }
  }
  sums.lower += totals.lower.total();
  sums.upper += totals.upper.total();
  sums.slope += totals.slope.total();
  sums.slope_scale += totals.slope_scale.total();
  sums.scale += totals.terms;  // f(0) = 1
  sums.terms += totals.terms;
  return sums;
}

BoundSums BoundPoints(const Field::Index& index, const Bounds& box, bool with_slope) {
  return with_slope ? sum_over<true>(index, box) : sum_over<false>(index, box);
}

}  // namespace
}  // namespace supple::implicit::lanes::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::implicit::lanes {

HWY_EXPORT(BoundPoints);

BoundSums bound_points(const Field::Index& index, const Bounds& box, bool with_slope) {
  return HWY_DYNAMIC_DISPATCH(BoundPoints)(index, box, with_slope);
}

}  // namespace supple::implicit::lanes
#endif  // HWY_ONCE
