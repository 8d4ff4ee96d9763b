// With u = s x - centre, s the scale of a blob, q = |u|^2 and t = max(1 - q, 0) at the middle of a cube, f = t^3 and
// grad f = -6 s t^2 u. From there to d, |d| <= rho, the distance of the corners, q changes by delta = 2 s u.d + s^2
// d^2.
#define HWY_DISABLE_PCLMUL_AES

#include "mesh/missed/cube_lanes.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mesh/missed/cube_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/pack_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::implicit::blobs::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using supple::HWY_NAMESPACE::pack_lanes;
namespace {

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;
constexpr std::size_t kWidth = hn::MaxLanes(D());

HWY_INLINE V sum_of_abs(V x, V y, V z) { return hn::Add(hn::Abs(x), hn::Add(hn::Abs(y), hn::Abs(z))); }
HWY_INLINE V dot(V ax, V ay, V az, V bx, V by, V bz) { return hn::MulAdd(az, bz, hn::MulAdd(ay, by, hn::Mul(ax, bx))); }

/// Writes those marked behind the first `count`, which is not beyond where they were read.
HWY_INLINE void store(V v, hn::Mask<D> keep, std::vector<float>& to, std::size_t count) {
  hn::StoreU(pack_lanes(v, keep), D(), to.data() + count);
}

/// f is convex in q, so F >= F(m) + g.d - 3 rho^2 sum s^2 t^2. The largest second derivative of a blob is s^2 t (24 -
/// 30 t) or negative, and rises up to t = 0.4, so F <= F(m) + g.d + rho^2 / 2 times the sum of what it is for the
/// largest t of the cube.
void BoundValues(const BlobList& list, float iso, float round_off, float half, bool drop, CubeBatch& cubes) {
  const D d;
  constexpr std::size_t kBetweenLooks = 8;
  const float rho2 = 3.0F * half * half, rho = 1.7320509F * half;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F), most = hn::Set(d, 0.4F);
  const V above = hn::Set(d, iso + round_off), below = hn::Set(d, iso - round_off);
  const V by_slope = hn::Set(d, 6.0F * half), by_bend = hn::Set(d, 3.0F * rho2), by_rise = hn::Set(d, 0.5F * rho2);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cubes.count; i += kWidth) {
    const V x = hn::LoadU(d, cubes.x.data() + i), y = hn::LoadU(d, cubes.y.data() + i),
        z = hn::LoadU(d, cubes.z.data() + i);
    V f = zero, vx = zero, vy = zero, vz = zero, bend = zero, rise = zero;
    const auto lower = [&]() HWY_ATTR {
      return hn::NegMulAdd(by_bend, bend, hn::NegMulAdd(by_slope, sum_of_abs(vx, vy, vz), f));
    };
    bool all_inside = false;
    for (std::size_t k = 0; k < list.count && !all_inside; ++k) {
      const float scale = list.scale[k];
      const V s = hn::Set(d, scale);
      const V ux = hn::MulSub(s, x, hn::Set(d, list.x[k])), uy = hn::MulSub(s, y, hn::Set(d, list.y[k])),
              uz = hn::MulSub(s, z, hn::Set(d, list.z[k]));
      const V q = dot(ux, uy, uz, ux, uy, uz), t = hn::Max(hn::Sub(one, q), zero), t2 = hn::Mul(t, t),
          w = hn::Mul(s, t2);
      f = hn::MulAdd(t2, t, f);
      vx = hn::MulAdd(w, ux, vx);
      vy = hn::MulAdd(w, uy, vy);
      vz = hn::MulAdd(w, uz, vz);
      bend = hn::MulAdd(w, s, bend);
      // The largest t is at most 1 - q + 2 s rho |u|, and |u| <= (1 + q) / 2.
      const float turn = scale * rho;
      const V largest = hn::MulAdd(q, hn::Set(d, turn - 1.0F), hn::Set(d, turn + 1.0F));
      const V up = hn::Min(hn::Max(largest, zero), most);
      rise = hn::MulAdd(hn::Mul(s, hn::Mul(s, up)), hn::NegMulAdd(hn::Set(d, 30.0F), up, hn::Set(d, 24.0F)), rise);
      // No term that is left out is negative.
      all_inside = drop && k % kBetweenLooks == kBetweenLooks - 1 && hn::AllTrue(d, hn::Gt(lower(), above));
    }
    if (all_inside) continue;
    const V upper = hn::MulAdd(by_rise, rise, hn::MulAdd(by_slope, sum_of_abs(vx, vy, vz), f));
    const auto open = hn::And(hn::Le(lower(), above), hn::Gt(upper, below));
    auto keep = hn::FirstN(d, cubes.count - i);
    if (drop) keep = hn::And(keep, open);
    store(x, keep, cubes.x, kept);
    store(y, keep, cubes.y, kept);
    store(z, keep, cubes.z, kept);
    store(vx, keep, cubes.slope_x, kept);
    store(vy, keep, cubes.slope_y, kept);
    store(vz, keep, cubes.slope_z, kept);
    store(bend, keep, cubes.bend, kept);
    store(hn::IfThenZeroElse(open, one), keep, cubes.one_sign, kept);
    kept += hn::CountTrue(d, keep);
  }
  cubes.count = kept;
}

/// Along n, the direction of the gradient at the middle, and with w = u.n each blob has n.grad f = -6 s t^2 w. Of those
/// ahead, w < 0, there is left at least what convexity of max(1 - q, 0)^2 in q leaves; those behind lose up to delta^2
/// more:
///   n.grad f >= -6 s (w + s n.d) (t^2 - 2 t delta) - 6 s max(w + s n.d, 0) delta^2.
/// Terms of first and of second order in d are summed over the blobs before they are bounded.
void DropSloped(const BlobList& list, float round_off, float half, CubeBatch& cubes) {
  const D d;
  const float rho2 = 3.0F * half * half;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F), half_edge = hn::Set(d, half);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cubes.count; i += kWidth) {
    const auto load = [&](const std::vector<float>& from) HWY_ATTR { return hn::LoadU(d, from.data() + i); };
    const V x = load(cubes.x), y = load(cubes.y), z = load(cubes.z);
    const V vx = load(cubes.slope_x), vy = load(cubes.slope_y), vz = load(cubes.slope_z), bend = load(cubes.bend),
        one_sign = load(cubes.one_sign);
    const V length = hn::Sqrt(dot(vx, vy, vz, vx, vy, vz)),
        inverse = hn::Div(hn::Set(d, -1.0F), hn::Max(length, hn::Set(d, 1e-20F)));
    const V nx = hn::Mul(vx, inverse), ny = hn::Mul(vy, inverse), nz = hn::Mul(vz, inverse);
    const V reach = hn::Mul(half_edge, sum_of_abs(nx, ny, nz));  // the largest |n.d|
    V turn_x = zero, turn_y = zero, turn_z = zero;               // sum s^2 t w u
    V skew_x = zero, skew_y = zero, skew_z = zero;               // sum s^3 t u
    V fourth = zero, behind = zero;                              // sum s^4 t, sum s max(w + s n.d, 0) delta^2
    for (std::size_t k = 0; k < list.count; ++k) {
      const float scale = list.scale[k];
      const V s = hn::Set(d, scale);
      const V ux = hn::MulSub(s, x, hn::Set(d, list.x[k])), uy = hn::MulSub(s, y, hn::Set(d, list.y[k])),
              uz = hn::MulSub(s, z, hn::Set(d, list.z[k]));
      const V rest = hn::Sub(one, dot(ux, uy, uz, ux, uy, uz)), t = hn::Max(rest, zero),
          w = dot(ux, uy, uz, nx, ny, nz);
      const V s2t = hn::Mul(hn::Mul(s, s), t), s3t = hn::Mul(s, s2t), turn = hn::Mul(s2t, w);
      turn_x = hn::MulAdd(turn, ux, turn_x);
      turn_y = hn::MulAdd(turn, uy, turn_y);
      turn_z = hn::MulAdd(turn, uz, turn_z);
      skew_x = hn::MulAdd(s3t, ux, skew_x);
      skew_y = hn::MulAdd(s3t, uy, skew_y);
      skew_z = hn::MulAdd(s3t, uz, skew_z);
      fourth = hn::MulAdd(s, s3t, fourth);
      // |u.d| <= half |u|_1; of blobs that do not reach the middle only the part beyond their support counts.
      const V delta = hn::MulAdd(hn::Set(d, 2.0F * scale * half), sum_of_abs(ux, uy, uz),
          hn::Set(d, scale * scale * rho2));
      const V past = hn::Max(hn::Add(delta, hn::Min(rest, zero)), zero);
      behind = hn::MulAdd(hn::Mul(s, hn::Max(hn::MulAdd(s, reach, w), zero)), hn::Mul(past, past), behind);
    }
    const auto change = [&](V turn, V n) HWY_ATTR {
      return hn::MulSub(hn::Set(d, 24.0F), turn, hn::Mul(hn::Set(d, 6.0F), hn::Mul(bend, n)));
    };
    const V first = hn::Mul(half_edge, sum_of_abs(change(turn_x, nx), change(turn_y, ny), change(turn_z, nz)));
    // 24 (n.d) (U.d) + 12 d^2 n.U with U the skew; (n.d) (U.d) is least half way between -n and U.
    const V along = dot(skew_x, skew_y, skew_z, nx, ny, nz),
        skew = hn::Sqrt(dot(skew_x, skew_y, skew_z, skew_x, skew_y, skew_z));
    const V product = hn::Min(hn::Mul(hn::Set(d, 0.5F * rho2), hn::Sub(skew, along)),
                              hn::Mul(hn::Mul(reach, half_edge), sum_of_abs(skew_x, skew_y, skew_z)));
    const V second = hn::MulAdd(hn::Set(d, 24.0F), product,
        hn::Mul(hn::Set(d, 12.0F * rho2), hn::Max(hn::Neg(along), zero)));
    const V third = hn::Mul(hn::Set(d, 12.0F * rho2), hn::Mul(reach, fourth));
    const V loss = hn::Add(hn::Add(first, second), hn::MulAdd(hn::Set(d, 6.0F), behind, third));
    const auto sloped = hn::Gt(hn::MulSub(hn::Set(d, 6.0F), length, loss), hn::Set(d, round_off));
    const auto keep = hn::AndNot(sloped, hn::FirstN(d, cubes.count - i));
    store(x, keep, cubes.x, kept);
    store(y, keep, cubes.y, kept);
    store(z, keep, cubes.z, kept);
    store(one_sign, keep, cubes.one_sign, kept);
    kept += hn::CountTrue(d, keep);
  }
  cubes.count = kept;
}

}  // namespace
}  // namespace supple::implicit::blobs::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::implicit::blobs {

HWY_EXPORT(BoundValues);
HWY_EXPORT(DropSloped);

void CubeBatch::reserve(std::size_t cubes) {
  const std::size_t room = cubes + kLanes;
  if (x.size() >= room) return;
  for (auto* array : {&x, &y, &z, &one_sign, &slope_x, &slope_y, &slope_z, &bend}) array->resize(room + room / 2);
}

CubeRoundOff cube_round_off(const BlobList& list, float iso) {
  float sum = 0.0F, largest = 0.0F;
  for (std::size_t k = 0; k < list.count; ++k) {
    sum += list.scale[k];
    largest = std::max(largest, list.scale[k]);
  }
  // With scales up to 1 and frames of 16 cells each component of u is off by at most 1.3e-6, so t by 5e-6. With that
  // all terms of a blob together differ from exact ones by less than 1.5e-4 for values, 1e-3 s for slopes; a sum of n
  // terms, each step rounded, by n 6e-8 times the sum of their sizes, at most 16 a blob and 50 s a blob.
  const auto n = static_cast<float>(list.count);
  return {.value = (1.5e-4F + 1e-6F * n) * n + 1e-6F * iso, .slope = (1e-3F + 3e-6F * n) * sum,
      .bounded = largest <= 1.0F};
}

void bound_values(const BlobList& list, float iso, const CubeRoundOff& round_off, float half, bool drop,
    CubeBatch& cubes) {
  if (cubes.count > 0) HWY_DYNAMIC_DISPATCH(BoundValues)(list, iso, round_off.value, half, drop, cubes);
}

void drop_sloped(const BlobList& list, const CubeRoundOff& round_off, float half, CubeBatch& cubes) {
  if (cubes.count > 0) HWY_DYNAMIC_DISPATCH(DropSloped)(list, round_off.slope, half, cubes);
}

}  // namespace supple::implicit::blobs
#endif  // HWY_ONCE
