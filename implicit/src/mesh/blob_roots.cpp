// Baseline and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include <algorithm>
#include <cmath>

#include "mesh/blob_lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mesh/blob_roots.cpp"  // NOLINT
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

/// The potential and S = sum t^2 scale (scale x - centre), so that grad F = -6 S.
struct PointSums {
  V f, x, y, z;
};
HWY_INLINE PointSums sum_at(const BlobList& list, V x, V y, V z) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F);
  const float *scale = list.scale.data(), *px = list.x.data(), *py = list.y.data(), *pz = list.z.data();
  PointSums sum{zero, zero, zero, zero};
  for (std::size_t i = 0; i < list.count; ++i) {
    const V s = hn::Set(d, scale[i]);
    const V dx = hn::MulSub(s, x, hn::Set(d, px[i]));
    const V dy = hn::MulSub(s, y, hn::Set(d, py[i]));
    const V dz = hn::MulSub(s, z, hn::Set(d, pz[i]));
    const V t = hn::Max(hn::NegMulAdd(dz, dz, hn::NegMulAdd(dy, dy, hn::NegMulAdd(dx, dx, one))), zero);
    const V t2 = hn::Mul(t, t);
    sum.f = hn::MulAdd(t2, t, sum.f);
    const V w = hn::Mul(t2, s);
    sum.x = hn::MulAdd(w, dx, sum.x);
    sum.y = hn::MulAdd(w, dy, sum.y);
    sum.z = hn::MulAdd(w, dz, sum.z);
  }
  return sum;
}

/// Those whose support may meet a box, in its frame.
HWY_INLINE void cut(const BlobList& from, const float (&centre)[3], const float (&half)[3], BlobList& list) {
  const D d;
  list.reserve(from.count);
  std::size_t count = 0;
  for (std::size_t i = 0; i < from.count; i += kWidth) {
    const V s = hn::LoadU(d, from.scale.data() + i);
    V near2 = hn::Zero(d), at[3];
    for (std::size_t k = 0; k < 3; ++k) {
      at[k] = hn::LoadU(d, (k == 0 ? from.x : k == 1 ? from.y : from.z).data() + i);
      const V away = hn::Abs(hn::MulSub(s, hn::Set(d, centre[k]), at[k]));
      const V gap = hn::Max(hn::NegMulAdd(s, hn::Set(d, half[k]), away), hn::Zero(d));
      near2 = hn::MulAdd(gap, gap, near2);
    }
    const auto keep = hn::Lt(near2, hn::Set(d, kReach2));
    hn::StoreU(pack_lanes(s, keep), d, list.scale.data() + count);
    hn::StoreU(pack_lanes(at[0], keep), d, list.x.data() + count);
    hn::StoreU(pack_lanes(at[1], keep), d, list.y.data() + count);
    hn::StoreU(pack_lanes(at[2], keep), d, list.z.data() + count);
    count += hn::CountTrue(d, keep);
  }
  list.count = count;
}

constexpr float kClose = 4e-3F;  ///< a Newton step this short leaves an error below 1e-5 of a cell

void SolveEdges(const BlobList& list, float iso, EdgeBatch& edges, std::size_t begin, BlobList& near) {
  const D d;
  constexpr float kLeast = 0x1p-17F;     // roots stay this far from the nodes, so that no two vertices coincide
  constexpr float kResolution = 0x1p-18F;
  constexpr int kMaxRounds = 60;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F), level = hn::Set(d, iso);
  const V least = hn::Set(d, kLeast), most = hn::Set(d, 1.0F - kLeast);
  for (std::size_t v = begin; v < edges.count; v += kWidth) {
    const auto load = [&](const EdgeBatch::Row& from) HWY_ATTR { return hn::LoadU(d, from.data() + v); };
    const V x0 = load(edges.x), y0 = load(edges.y), z0 = load(edges.z);
    const V axis = load(edges.axis);
    const auto unit = [&](float k) HWY_ATTR { return hn::IfThenElseZero(hn::Eq(axis, hn::Set(d, k)), one); };
    const V ax = unit(0.0F), ay = unit(1.0F), az = unit(2.0F);
    auto open = hn::FirstN(d, edges.count - v);
    float centre[3], half_box[3];  // around the edges
    const auto extend = [&](std::size_t k, V from, V to) HWY_ATTR {
      const float lower = hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(open, from, hn::Set(d, 1e30F))));
      const float upper = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElse(open, to, hn::Set(d, -1e30F))));
      centre[k] = 0.5F * (lower + upper);
      half_box[k] = 0.5F * (upper - lower);
    };
    extend(0, x0, hn::Add(x0, ax));
    extend(1, y0, hn::Add(y0, ay));
    extend(2, z0, hn::Add(z0, az));
    cut(list, centre, half_box, near);
    const V f0 = load(edges.low), f1 = load(edges.high);
    const auto starts_inside = hn::Gt(f0, zero);
    const auto both_known = hn::Ne(f1, zero);
    V t = hn::IfThenElse(both_known, hn::Div(f0, hn::Sub(f0, f1)), half);
    t = hn::Min(hn::Max(t, least), most);
    V low = zero, high = one, last = one, found = t, gx = zero, gy = zero, gz = zero;
    for (int round = 0; round < kMaxRounds; ++round) {
      const V x = hn::MulAdd(ax, t, x0), y = hn::MulAdd(ay, t, y0), z = hn::MulAdd(az, t, z0);
      const auto [potential, sx, sy, sz] = sum_at(near, x, y, z);
      const V f = hn::Sub(potential, level);
      gx = hn::IfThenElse(open, sx, gx);
      gy = hn::IfThenElse(open, sy, gy);
      gz = hn::IfThenElse(open, sz, gz);
      const V slope = hn::Mul(hn::Set(d, -6.0F), hn::MulAdd(az, sz, hn::MulAdd(ay, sy, hn::Mul(ax, sx))));
      V next = hn::Sub(t, hn::Div(f, slope));
      if (round == 0) {
        // The cubic with values f0, f, f1 at 0, t, 1 and this slope at t: f + slope w + w^2 (q0 (1 - x) + q1 x), w = x - t.
        const V rest = hn::Sub(one, t);
        const V q0 = hn::Div(hn::MulAdd(slope, t, hn::Sub(f0, f)), hn::Mul(t, t));
        const V q1 = hn::Div(hn::NegMulAdd(slope, rest, hn::Sub(f1, f)), hn::Mul(rest, rest));
        V root = next;
        for (int k = 0; k < 2; ++k) {
          const V w = hn::Sub(root, t), q = hn::MulAdd(q1, root, hn::NegMulAdd(q0, root, q0));
          const V value = hn::MulAdd(w, hn::MulAdd(w, q, slope), f);
          const V change = hn::MulAdd(w, hn::MulAdd(w, hn::Sub(q1, q0), hn::Add(q, q)), slope);
          root = hn::Sub(root, hn::Div(value, change));
        }
        const auto apart = hn::And(hn::Gt(t, hn::Set(d, 0.02F)), hn::Lt(t, hn::Set(d, 0.98F)));
        next = hn::IfThenElse(hn::And(apart, both_known), root, next);
      }
      const auto same_side = hn::Xor(hn::Gt(f, zero), hn::Not(starts_inside));
      low = hn::IfThenElse(same_side, t, low);
      high = hn::IfThenElse(same_side, high, t);
      const V step = hn::Abs(hn::Sub(next, t));
      // False for values that are no numbers.
      const auto newton = hn::And(hn::And(hn::Ge(next, low), hn::Le(next, high)), hn::Le(step, hn::Mul(half, last)));
      next = hn::IfThenElse(newton, next, hn::Mul(half, hn::Add(low, high)));
      found = hn::IfThenElse(open, next, found);
      last = hn::IfThenElse(newton, step, last);
      const auto closed = hn::Or(hn::And(newton, hn::Lt(step, hn::Set(d, kClose))),
                                 hn::Lt(hn::Sub(high, low), hn::Set(d, kResolution)));
      open = hn::AndNot(closed, open);
      if (hn::AllFalse(d, open)) break;
      t = found;
    }
    const auto store = [&](V value, EdgeBatch::Row& to) HWY_ATTR { hn::StoreU(value, d, to.data() + v); };
    store(hn::Min(hn::Max(found, least), most), edges.t);
    store(gx, edges.nx);
    store(gy, edges.ny);
    store(gz, edges.nz);
  }
}

void PlaceVertices(const EdgeBatch& edges, std::size_t begin, std::size_t end, const Placement& placement, const VertexRows& rows) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<float, decltype(d)> df;
  using VD = hn::Vec<decltype(d)>;
  constexpr std::size_t kWide = hn::MaxLanes(decltype(d)());
  const VD zero = hn::Zero(d), one = hn::Set(d, 1.0), cell = hn::Set(d, placement.cell);
  for (std::size_t v = begin; v < end; v += kWide) {
    const std::size_t n = v - begin;
    const auto load = [&](const EdgeBatch::Row& from) HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(df, from.data() + v)); };
    const VD t = load(edges.t), axis = load(edges.axis);
    const VD gx = load(edges.nx), gy = load(edges.ny), gz = load(edges.nz);
    const VD norm2 = hn::MulAdd(gz, gz, hn::MulAdd(gy, gy, hn::Mul(gx, gx)));
    const auto sloped = hn::Gt(norm2, zero);
    const VD inverse = hn::Div(one, hn::Sqrt(hn::IfThenElse(sloped, norm2, one)));
    VD position[3], normal[3];
    const auto along = [&](std::size_t k, VD low, VD g) HWY_ATTR {
      const auto moves = hn::Eq(axis, hn::Set(d, static_cast<double>(k)));
      const VD node = hn::Add(hn::Set(d, placement.base[k]), low);
      const VD at = hn::Add(node, hn::IfThenElseZero(moves, t));
      position[k] = hn::Add(hn::Set(d, placement.origin[k]), hn::Mul(cell, at));
      normal[k] = hn::IfThenElse(sloped, hn::Mul(g, inverse), hn::IfThenElseZero(moves, one));
    };
    along(0, load(edges.x), gx);
    along(1, load(edges.y), gy);
    along(2, load(edges.z), gz);
    const auto single = [&](VD value) HWY_ATTR { return hn::DemoteTo(df, value); };
    const auto store_points = [&](float* to) HWY_ATTR {
      hn::StoreInterleaved4(hn::LoadU(df, edges.t.data() + v), single(normal[0]), single(normal[1]), single(normal[2]), df, to);
    };
    if (end - v >= kWide) {
      store_points(rows.points + 4 * n);
      hn::StoreInterleaved3(position[0], position[1], position[2], d, rows.positions + 3 * n);
      hn::StoreInterleaved3(normal[0], normal[1], normal[2], d, rows.normals + 3 * n);
      continue;
    }
    alignas(64) double last[2][3 * kWide];
    alignas(64) float last_points[4 * kWide];
    store_points(last_points);
    std::copy_n(last_points, 4 * (end - v), rows.points + 4 * n);
    hn::StoreInterleaved3(position[0], position[1], position[2], d, last[0]);
    hn::StoreInterleaved3(normal[0], normal[1], normal[2], d, last[1]);
    std::copy_n(last[0], 3 * (end - v), rows.positions + 3 * n);
    std::copy_n(last[1], 3 * (end - v), rows.normals + 3 * n);
  }
}

/// Newton's method along the gradient for a vector of points. @return whether all stayed within `margin` of their start
HWY_INLINE bool project_vector(const BlobList& list, float iso, float margin, float (&at)[3][kLanes],
                               float (&slope)[3][kLanes]) {
  const D d;
  constexpr int kMaxRounds = 12;
  const V zero = hn::Zero(d), level = hn::Set(d, iso), longest = hn::Set(d, 0.5F);
  V x = hn::Load(d, at[0]), y = hn::Load(d, at[1]), z = hn::Load(d, at[2]);
  const V x0 = x, y0 = y, z0 = z;
  V gx = zero, gy = zero, gz = zero, far = zero;
  auto open = hn::FirstN(d, kWidth);
  for (int round = 0; round < kMaxRounds; ++round) {
    const PointSums sum = sum_at(list, x, y, z);
    gx = hn::IfThenElse(open, sum.x, gx);
    gy = hn::IfThenElse(open, sum.y, gy);
    gz = hn::IfThenElse(open, sum.z, gz);
    const V norm2 = hn::MulAdd(gz, gz, hn::MulAdd(gy, gy, hn::Mul(gx, gx)));
    const V norm = hn::Sqrt(norm2);
    // x - F grad F / |grad F|^2 = x + F S / (6 |S|^2)
    const V wanted = hn::Div(hn::Sub(sum.f, level), hn::Mul(hn::Set(d, 6.0F), norm));
    const V step = hn::Max(hn::Min(wanted, longest), hn::Neg(longest));
    const V factor = hn::IfThenElseZero(hn::And(open, hn::Gt(norm, zero)), hn::Div(step, norm));
    x = hn::MulAdd(factor, gx, x);
    y = hn::MulAdd(factor, gy, y);
    z = hn::MulAdd(factor, gz, z);
    far = hn::Max(far, hn::Max(hn::Abs(hn::Sub(x, x0)), hn::Max(hn::Abs(hn::Sub(y, y0)), hn::Abs(hn::Sub(z, z0)))));
    if (!hn::AllTrue(d, hn::Lt(far, hn::Set(d, margin)))) return false;
    open = hn::AndNot(hn::Lt(hn::Abs(step), hn::Set(d, kClose)), open);
    if (hn::AllFalse(d, open)) break;
  }
  hn::Store(x, d, at[0]);
  hn::Store(y, d, at[1]);
  hn::Store(z, d, at[2]);
  hn::Store(gx, d, slope[0]);
  hn::Store(gy, d, slope[1]);
  hn::Store(gz, d, slope[2]);
  return true;
}

void ProjectPoints(const BlobList& list, float iso, const Placement& placement, const PointRows& points, BlobList& near) {
  constexpr float kMargin = 0.25F;  // most middles move less
  const double per_cell = 1.0 / placement.cell;
  alignas(64) float at[3][kLanes], slope[3][kLanes];
  for (std::size_t v = 0; v < points.count; v += kWidth) {
    const std::size_t n = std::min(kWidth, points.count - v);
    float centre[3], half[3];
    for (std::size_t k = 0; k < 3; ++k) {
      float low = 1e30F, high = -1e30F;
      for (std::size_t i = 0; i < kWidth; ++i) {
        const double p = points.positions[3 * (v + std::min(i, n - 1)) + k];
        at[k][i] = static_cast<float>((p - placement.origin[k]) * per_cell - placement.base[k]);
        low = std::min(low, at[k][i]);
        high = std::max(high, at[k][i]);
      }
      centre[k] = 0.5F * (low + high);
      half[k] = 0.5F * (high - low) + kMargin;
    }
    cut(list, centre, half, near);
    if (!project_vector(near, iso, kMargin, at, slope)) (void)project_vector(list, iso, 1e30F, at, slope);
    for (std::size_t i = 0; i < n; ++i) {
      double* p = points.positions + 3 * (v + i);
      double* normal = points.normals + 3 * (v + i);
      double norm2 = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        p[k] = placement.origin[k] + placement.cell * (placement.base[k] + static_cast<double>(at[k][i]));
        normal[k] = static_cast<double>(slope[k][i]);
        norm2 += normal[k] * normal[k];
      }
      const double inverse = norm2 > 0.0 ? 1.0 / std::sqrt(norm2) : 0.0;
      for (std::size_t k = 0; k < 3; ++k) normal[k] *= inverse;
    }
  }
}

}  // namespace
}  // namespace supple::implicit::blobs::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::implicit::blobs {

HWY_EXPORT(SolveEdges);
HWY_EXPORT(PlaceVertices);
HWY_EXPORT(ProjectPoints);

void solve_edges(const BlobList& list, float iso, EdgeBatch& edges, std::size_t begin, BlobList& near) {
  HWY_DYNAMIC_DISPATCH(SolveEdges)(list, iso, edges, begin, near);
}

void place_vertices(const EdgeBatch& edges, std::size_t begin, std::size_t end, const Placement& placement, const VertexRows& to) {
  HWY_DYNAMIC_DISPATCH(PlaceVertices)(edges, begin, end, placement, to);
}

void project_points(const BlobList& list, float iso, const Placement& placement, const PointRows& points, BlobList& near) {
  HWY_DYNAMIC_DISPATCH(ProjectPoints)(list, iso, placement, points, near);
}

}  // namespace supple::implicit::blobs
#endif  // HWY_ONCE
