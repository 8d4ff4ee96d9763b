// Baseline and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "field/field_lanes.h"

#include <algorithm>
#include <bit>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "field/field_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/pack_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::implicit::lanes::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using supple::HWY_NAMESPACE::pack_lanes;

static_assert(sizeof(Vec3) == 3 * sizeof(double));

using Full = hn::CappedTag<double, kPack>;
using Pair = hn::CappedTag<double, 2>;

/// K vectors of points and their sums.
template <class D, std::size_t K, bool kGradient>
struct Tile {
  using V = hn::Vec<D>;
  V x[K], y[K], z[K];
  V f[K];
  V gx[K], gy[K], gz[K];

  void clear(D d) {
    for (std::size_t k = 0; k < K; ++k) {
      f[k] = hn::Zero(d);
      if constexpr (kGradient) gx[k] = gy[k] = gz[k] = hn::Zero(d);
    }
  }
};

/// Kernel as a product a b = f and s = 2 df/dq, so that grad f = s A^T v.
template <class V>
struct KernelLanes {
  V a, b, s;
};

template <bool kGradient, class D, class V = hn::Vec<D>>
HWY_INLINE KernelLanes<V> wyvill(D d, const PackedPrimitive& p, V q) {
  const V t = hn::Max(hn::NegMulAdd(q, hn::Set(d, p.inverse_r2), hn::Set(d, 1.0)), hn::Zero(d));
  const V t2 = hn::Mul(t, t);
  KernelLanes<V> out{t2, t, hn::Zero(d)};
  if constexpr (kGradient) out.s = hn::Mul(hn::Set(d, p.gradient_factor), t2);
  return out;
}

template <bool kGradient, class D, class V = hn::Vec<D>>
HWY_INLINE KernelLanes<V> gascuel(D d, const PackedShape& shape, V q) {
  const V R = hn::Set(d, shape.kernel.radius);
  const V k = hn::Set(d, shape.kernel.slope);
  const V distance = hn::Min(hn::Sqrt(q), R);
  const V beyond = hn::Sub(distance, hn::Set(d, shape.kernel.thickness));
  const V w = hn::Sub(distance, R);
  const V cubic = hn::Set(d, shape.outer_cubic);
  const V factor = hn::MulAdd(cubic, beyond, hn::Set(d, shape.outer_square));
  const V outer = hn::Mul(hn::Mul(w, w), factor);
  const V inner = hn::NegMulAdd(k, beyond, hn::Set(d, shape.kernel.iso));
  const auto outside = hn::Gt(beyond, hn::Zero(d));
  KernelLanes<V> out{hn::IfThenElse(outside, outer, inner), hn::Set(d, 1.0), hn::Zero(d)};
  if constexpr (kGradient) {
    const V outer_slope = hn::Mul(w, hn::MulAdd(cubic, w, hn::Add(factor, factor)));
    const V slope = hn::IfThenElse(outside, outer_slope, hn::Neg(k));
    out.s = hn::IfThenElseZero(hn::Gt(distance, hn::Zero(d)), hn::Div(slope, distance));
  }
  return out;
}

/// e^x for -200 < x <= 0, as math::exp computes it.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V exponential(D d, V x) {
  constexpr double kShift = 0x1.8p52;  // leaves no bits for a fraction
  const hn::RebindToSigned<D> di;
  const V shifted = hn::Add(hn::Mul(x, hn::Set(d, 0x1.71547652b82fep+0)), hn::Set(d, kShift));
  const V k = hn::Sub(shifted, hn::Set(d, kShift));
  const V high = hn::NegMulAdd(k, hn::Set(d, 0x1.62e42fefa39efp-1), x);
  const V low = hn::Mul(hn::Neg(k), hn::Set(d, 0x1.abc9e3b39803fp-56));
  const V r = hn::Add(high, low);
  const V rest = hn::Add(hn::Sub(high, r), low);
  V series = hn::Set(d, 1.0 / 6227020800.0);  // 1/13!
  double factorial = 6227020800.0;
  for (int i = 13; i > 2; --i) {
    factorial /= i;
    series = hn::MulAdd(series, r, hn::Set(d, 1.0 / factorial));
  }
  const V value = hn::Add(hn::Set(d, 1.0), hn::Add(r, hn::MulAdd(hn::Mul(r, r), series, rest)));
  // The low bits of `shifted` hold k.
  const auto exponent = hn::ShiftLeft<52>(hn::Add(hn::BitCast(di, shifted), hn::Set(di, 1023)));
  return hn::Mul(value, hn::BitCast(d, exponent));
}

/// Any kernel; the formulas are those of in_square in kernel.cpp.
template <bool kGradient, class D, class V = hn::Vec<D>>
HWY_INLINE KernelLanes<V> any_kernel(D d, const PackedPrimitive& p, const PackedShape& shape, V q) {
  const Kernel& k = shape.kernel;
  if (k.kind == KernelKind::Gascuel) return gascuel<kGradient>(d, shape, q);
  if (k.kind == KernelKind::Wyvill) return wyvill<kGradient>(d, p, q);
  const V one = hn::Set(d, 1.0);
  const V u = hn::Min(hn::Mul(q, hn::Set(d, p.inverse_r2)), one);
  const V w = hn::Sub(one, u);
  V f = hn::Zero(d), first = hn::Zero(d);  // f and df/du
  switch (k.kind) {
    case KernelKind::Wyvill:
    case KernelKind::Gascuel: break;
    case KernelKind::SoftObject: {
      const V a = hn::NegMulAdd(u, hn::Set(d, 4.0 / 9.0), hn::Set(d, 17.0 / 9.0));
      f = hn::MulAdd(u, hn::MulAdd(u, a, hn::Set(d, -22.0 / 9.0)), one);
      const V b = hn::NegMulAdd(u, hn::Set(d, 12.0 / 9.0), hn::Set(d, 34.0 / 9.0));
      first = hn::MulAdd(u, b, hn::Set(d, -22.0 / 9.0));
      break;
    }
    case KernelKind::Murakami:
      f = hn::Mul(w, w);
      first = hn::Mul(hn::Set(d, -2.0), w);
      break;
    case KernelKind::Nishimura: {
      const V rho = hn::Sqrt(u);
      const V beyond = hn::Sub(one, rho);
      const auto inner = hn::Le(u, hn::Set(d, 1.0 / 9.0));
      const V outer_slope = hn::Div(hn::Mul(hn::Set(d, -1.5), beyond), hn::Max(rho, hn::Set(d, 0.25)));
      f = hn::IfThenElse(inner, hn::NegMulAdd(u, hn::Set(d, 3.0), one),
                         hn::Mul(hn::Set(d, 1.5), hn::Mul(beyond, beyond)));
      first = hn::IfThenElse(inner, hn::Set(d, -3.0), outer_slope);
      break;
    }
    case KernelKind::Blinn:
    case KernelKind::Cauchy: {
      const V a = hn::Set(d, k.shape * k.shape);
      const V gain = hn::Set(d, k.gain), floor = hn::Set(d, k.floor), tilt = hn::Set(d, k.tilt);
      V g, fall;  // g and -dg/du
      if (k.kind == KernelKind::Blinn) {
        g = exponential(d, hn::Neg(hn::Mul(a, u)));
        fall = hn::Mul(a, g);
      } else {
        const V r = hn::Div(one, hn::MulAdd(a, u, one));
        g = hn::Mul(r, r);
        fall = hn::Mul(hn::Add(a, a), hn::Mul(g, r));
      }
      f = hn::Mul(gain, hn::Max(hn::NegMulAdd(floor, hn::MulAdd(tilt, w, one), g), hn::Zero(d)));
      first = hn::Mul(gain, hn::Sub(hn::Mul(floor, tilt), fall));
      break;
    }
    case KernelKind::BlancSchlick: {
      const double h = k.shape;
      const V beyond = hn::Sub(u, hn::Set(d, 0.25));
      const auto inner = hn::Le(beyond, hn::Zero(d));
      const V b = hn::IfThenElse(inner, hn::Set(d, 4.5 - 4.0 * h), hn::Set(d, 1.5 + 4.0 * h));
      const V bottom = hn::MulAdd(b, beyond, hn::Set(d, 1.125));
      const V share = hn::Div(one, bottom);
      const V near = hn::NegMulAdd(hn::Mul(hn::Set(d, 9.0), u), hn::Mul(u, share), one);
      f = hn::IfThenElse(inner, near, hn::Mul(hn::Mul(w, w), share));
      const V near_first = hn::Mul(hn::Mul(hn::Set(d, -9.0), u), hn::MulAdd(b, u, hn::Set(d, 2.0 * h)));
      const V far_first = hn::Neg(hn::Mul(w, hn::MulAdd(b, w, hn::Add(bottom, bottom))));
      first = hn::Mul(hn::IfThenElse(inner, near_first, far_first), hn::Mul(share, share));
      break;
    }
  }
  const auto reached = hn::Lt(u, one);
  KernelLanes<V> out{hn::IfThenElseZero(reached, f), one, hn::Zero(d)};
  if constexpr (kGradient) {
    out.s = hn::IfThenElseZero(reached, hn::Mul(first, hn::Set(d, 2.0 * p.inverse_r2)));
  }
  return out;
}

/// What `measure` returns at each point: a value, returned, and a vector, in place of the point.
template <class D, class Measure, class V = hn::Vec<D>>
HWY_INLINE V point_by_point(D d, const Measure& measure, V& x, V& y, V& z) {
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  alignas(64) double at[3][kLanes], value[kLanes];
  hn::Store(x, d, at[0]);
  hn::Store(y, d, at[1]);
  hn::Store(z, d, at[2]);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const auto [number, vector] = measure(Vec3(at[0][lane], at[1][lane], at[2][lane]));
    value[lane] = number;
    for (std::size_t k = 0; k < 3; ++k) at[k][lane] = vector[static_cast<Eigen::Index>(k)];
  }
  x = hn::Load(d, at[0]);
  y = hn::Load(d, at[1]);
  z = hn::Load(d, at[2]);
  return hn::Load(d, value);
}

/// Squared distance and half its gradient of shapes that are measured point by point.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V scalar_foot(D d, const ShapeView& view, V& x, V& y, V& z) {
  return point_by_point(d, [&view](const Vec3& p) { return foot(view, p); }, x, y, z);
}

/// f of a convolved shape and its gradient in place of y.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V scalar_convolution(D d, const PackedShape& shape, V& x, V& y, V& z) {
  return point_by_point(d, [&shape](const Vec3& p) { return convolve(shape.view, shape.kernel, p); }, x, y, z);
}

/// Adds the primitives ids[0..n), all of one kind, to the sums.
template <PackedKind kKind, bool kGradient, class D, std::size_t K>
HWY_INLINE void add_run(D d, const Primitives& in, const std::uint32_t* HWY_RESTRICT ids, std::size_t n,
                        Tile<D, K, kGradient>& tile) {
  using V = hn::Vec<D>;
  constexpr bool kPoint = kKind == PackedKind::PointWyvill || kKind == PackedKind::PointGascuel;
  constexpr bool kDisc = kKind == PackedKind::DiscWyvill || kKind == PackedKind::DiscGascuel;
  constexpr bool kGeneral = kKind == PackedKind::General;
  constexpr bool kWyvill =
      kKind == PackedKind::PointWyvill || kKind == PackedKind::SlabWyvill || kKind == PackedKind::DiscWyvill;
  Tile<D, K, kGradient> t = tile;
  for (std::size_t i = 0; i < n; ++i) {
    const PackedPrimitive& p = in.primitive[ids[i]];
    const PackedShape& shape = in.shape[ids[i]];
    const V px = hn::Set(d, p.position[0]);
    const V py = hn::Set(d, p.position[1]);
    const V pz = hn::Set(d, p.position[2]);
    for (std::size_t k = 0; k < K; ++k) {
      V vx = hn::Sub(t.x[k], px);
      V vy = hn::Sub(t.y[k], py);
      V vz = hn::Sub(t.z[k], pz);
      if constexpr (!kPoint) {
        const auto local = [&](std::size_t row) HWY_ATTR {
          const double* a = shape.to_local.data() + 3 * row;
          return hn::MulAdd(hn::Set(d, a[2]), vz,
                            hn::MulAdd(hn::Set(d, a[1]), vy, hn::Mul(hn::Set(d, a[0]), vx)));
        };
        const V y0 = local(0), y1 = local(1), y2 = local(2);
        if (kGeneral && shape.foot >= PackedFoot::Scalar) {
          vx = y0;
          vy = y1;
          vz = y2;
        } else if (kDisc || (kGeneral && shape.foot == PackedFoot::Disc)) {
          const V r = hn::Set(d, shape.half[0]);
          const V rho = hn::Sqrt(hn::MulAdd(y1, y1, hn::Mul(y0, y0)));
          const V share = hn::IfThenElseZero(hn::Gt(rho, r), hn::Div(hn::Sub(rho, r), rho));
          vx = hn::Mul(share, y0);
          vy = hn::Mul(share, y1);
          vz = y2;
        } else {
          const auto outside = [&](V y, std::size_t row) HWY_ATTR {
            const V h = hn::Set(d, shape.half[row]);
            return hn::Sub(y, hn::Min(hn::Max(y, hn::Neg(h)), h));
          };
          vx = outside(y0, 0);
          vy = outside(y1, 1);
          vz = outside(y2, 2);
        }
      }
      V q;
      if (kGeneral && shape.foot == PackedFoot::Scalar) {
        q = scalar_foot(d, shape.view, vx, vy, vz);
      } else {
        q = hn::MulAdd(vz, vz, hn::MulAdd(vy, vy, hn::Mul(vx, vx)));
      }
      KernelLanes<V> kernel;
      if constexpr (kWyvill) {
        kernel = wyvill<kGradient>(d, p, q);
      } else if constexpr (kGeneral) {
        if (shape.foot == PackedFoot::Convolved) {
          const V one = hn::Set(d, 1.0);
          kernel = {scalar_convolution(d, shape, vx, vy, vz), one, one};
        } else {
          kernel = any_kernel<kGradient>(d, p, shape, q);
        }
      } else {
        kernel = gascuel<kGradient>(d, shape, q);
      }
      t.f[k] = hn::MulAdd(kernel.a, kernel.b, t.f[k]);
      if constexpr (kGradient) {
        if constexpr (kPoint) {
          t.gx[k] = hn::MulAdd(kernel.s, vx, t.gx[k]);
          t.gy[k] = hn::MulAdd(kernel.s, vy, t.gy[k]);
          t.gz[k] = hn::MulAdd(kernel.s, vz, t.gz[k]);
        } else {
          const V sx = hn::Mul(kernel.s, vx), sy = hn::Mul(kernel.s, vy), sz = hn::Mul(kernel.s, vz);
          const double* a = shape.to_local.data();
          const auto back = [&](std::size_t column, V sum) HWY_ATTR {
            return hn::MulAdd(hn::Set(d, a[column]), sx,
                              hn::MulAdd(hn::Set(d, a[3 + column]), sy,
                                         hn::MulAdd(hn::Set(d, a[6 + column]), sz, sum)));
          };
          t.gx[k] = back(0, t.gx[k]);
          t.gy[k] = back(1, t.gy[k]);
          t.gz[k] = back(2, t.gz[k]);
        }
      }
    }
  }
  tile = t;
}

/// Adds the primitives in the order of ids, run by run of one kind. Not inlined: it is most of the code.
template <bool kGradient, class D, std::size_t K>
HWY_NOINLINE void add_ids(D d, const Primitives& in, const std::uint32_t* ids, std::size_t n,
                        Tile<D, K, kGradient>& tile) {
  for (std::size_t i = 0; i < n;) {
    const PackedKind kind = in.primitive[ids[i]].kind;
    std::size_t j = in.uniform ? n : i + 1;
    while (j < n && in.primitive[ids[j]].kind == kind) ++j;
    switch (kind) {
      case PackedKind::PointWyvill: add_run<PackedKind::PointWyvill>(d, in, ids + i, j - i, tile); break;
      case PackedKind::PointGascuel: add_run<PackedKind::PointGascuel>(d, in, ids + i, j - i, tile); break;
      case PackedKind::SlabWyvill: add_run<PackedKind::SlabWyvill>(d, in, ids + i, j - i, tile); break;
      case PackedKind::SlabGascuel: add_run<PackedKind::SlabGascuel>(d, in, ids + i, j - i, tile); break;
      case PackedKind::DiscWyvill: add_run<PackedKind::DiscWyvill>(d, in, ids + i, j - i, tile); break;
      case PackedKind::DiscGascuel: add_run<PackedKind::DiscGascuel>(d, in, ids + i, j - i, tile); break;
      case PackedKind::General: add_run<PackedKind::General>(d, in, ids + i, j - i, tile); break;
    }
    i = j;
  }
}

/// Copies n numbers into whole vectors, reading nothing beyond them.
template <class D>
HWY_INLINE void load_some(D d, const double* from, std::size_t n, double* whole) {
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  for (std::size_t i = 0; i < n; i += kLanes) {
    hn::StoreU(hn::MaskedLoad(hn::FirstN(d, std::min(n - i, kLanes)), d, from + i), d, whole + i);
  }
}

/// Copies n numbers out of whole vectors, writing nothing beyond them.
template <class D>
HWY_INLINE void store_some(D d, const double* whole, std::size_t n, double* to) {
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  for (std::size_t i = 0; i < n; i += kLanes) {
    hn::BlendedStore(hn::LoadU(d, whole + i), hn::FirstN(d, std::min(n - i, kLanes)), d, to + i);
  }
}

/// Loads n <= K lanes points; the lanes beyond repeat the last one.
template <class D, std::size_t K, bool kGradient>
HWY_INLINE void load_points(D d, const Vec3* points, std::size_t n, Tile<D, K, kGradient>& tile) {
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  const double* from = points->data();
  if (n == 1) {
    for (std::size_t k = 0; k < K; ++k) {
      tile.x[k] = hn::Set(d, from[0]);
      tile.y[k] = hn::Set(d, from[1]);
      tile.z[k] = hn::Set(d, from[2]);
    }
    return;
  }
  if (n == K * kLanes) {
    for (std::size_t k = 0; k < K; ++k) {
      hn::LoadInterleaved3(d, from + 3 * kLanes * k, tile.x[k], tile.y[k], tile.z[k]);
    }
    return;
  }
  alignas(64) double padded[3 * K * kLanes] = {};
  load_some(d, from, 3 * n, padded);
  const double* last = from + 3 * (n - 1);
  for (std::size_t k = 0; k < K; ++k) {
    hn::LoadInterleaved3(d, padded + 3 * kLanes * k, tile.x[k], tile.y[k], tile.z[k]);
    const auto present = hn::FirstN(d, n > k * kLanes ? n - k * kLanes : 0);
    tile.x[k] = hn::IfThenElse(present, tile.x[k], hn::Set(d, last[0]));
    tile.y[k] = hn::IfThenElse(present, tile.y[k], hn::Set(d, last[1]));
    tile.z[k] = hn::IfThenElse(present, tile.z[k], hn::Set(d, last[2]));
  }
}

template <bool kGradient, class D, std::size_t K>
HWY_INLINE void store_sums(D d, const Tile<D, K, kGradient>& tile, double iso, std::size_t n, double* values,
                           Vec3* gradients) {
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  if (n == 1) {
    values[0] = hn::GetLane(hn::Sub(tile.f[0], hn::Set(d, iso)));
    if constexpr (kGradient) {
      *gradients = Vec3(hn::GetLane(tile.gx[0]), hn::GetLane(tile.gy[0]), hn::GetLane(tile.gz[0]));
    }
    return;
  }
  const bool all = n == K * kLanes;
  alignas(64) double value_buffer[K * kLanes];
  double* to = all ? values : value_buffer;
  for (std::size_t k = 0; k < K; ++k) hn::StoreU(hn::Sub(tile.f[k], hn::Set(d, iso)), d, to + kLanes * k);
  if (!all) store_some(d, value_buffer, n, values);
  if constexpr (kGradient) {
    alignas(64) double gradient_buffer[3 * K * kLanes];
    double* g = all ? gradients->data() : gradient_buffer;
    for (std::size_t k = 0; k < K; ++k) {
      hn::StoreInterleaved3(tile.gx[k], tile.gy[k], tile.gz[k], d, g + 3 * kLanes * k);
    }
    if (!all) store_some(d, gradient_buffer, 3 * n, gradients->data());
  }
}

/// The next points of a batch, and the batch without them.
template <bool kGradient>
HWY_INLINE Batch take(std::size_t count, Batch& rest) {
  const Batch taken{rest.points, count, rest.values, rest.gradients};
  rest.count -= count;
  rest.points += count;
  rest.values += count;
  if constexpr (kGradient) rest.gradients += count;
  return taken;
}

template <bool kGradient, std::size_t K, class D>
HWY_INLINE void evaluate_tile(D d, const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at) {
  Tile<D, K, kGradient> tile;
  load_points(d, at.points, at.count, tile);
  tile.clear(d);
  add_ids(d, in, ids.data(), ids.size(), tile);
  store_sums(d, tile, in.iso, at.count, at.values, at.gradients);
}

template <bool kGradient>
HWY_INLINE void evaluate_points(const Primitives& in, std::span<const std::uint32_t> ids, Batch rest) {
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  while (rest.count > 0) {
    if (rest.count <= 2) {
      evaluate_tile<kGradient, 1>(Pair(), in, ids, take<kGradient>(rest.count, rest));
    } else if (rest.count <= kLanes) {
      evaluate_tile<kGradient, 1>(Full(), in, ids, take<kGradient>(rest.count, rest));
    } else {
      evaluate_tile<kGradient, 2>(Full(), in, ids, take<kGradient>(std::min(rest.count, 2 * kLanes), rest));
    }
  }
}

void EvaluateIds(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at) {
  if (at.gradients == nullptr) {
    evaluate_points<false>(in, ids, at);
  } else {
    evaluate_points<true>(in, ids, at);
  }
}

/// A box, each bound in all lanes.
struct BoxLanes {
  using V = hn::Vec<Full>;
  V lower_x, lower_y, lower_z, upper_x, upper_y, upper_z;
};

HWY_INLINE BoxLanes spread(const Bounds& box) {
  const Full d;
  return {hn::Set(d, box.lower[0]), hn::Set(d, box.lower[1]), hn::Set(d, box.lower[2]),
          hn::Set(d, box.upper[0]), hn::Set(d, box.upper[1]), hn::Set(d, box.upper[2])};
}

HWY_INLINE std::size_t filter_packs(const LeafPack* pack, std::size_t pack_count, const BoxLanes& box,
                                    std::uint32_t* ids) {
  const Full d;
  using V = hn::Vec<Full>;
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  const hn::CappedTag<std::uint32_t, kLanes> di;
  std::size_t count = 0;
  for (const LeafPack* p = pack; p < pack + pack_count; ++p) {
    for (std::size_t lane = 0; lane < kPack; lane += kLanes) {
      const auto gap = [&](std::size_t axis, V lower, V upper) HWY_ATTR {
        const V below = hn::Sub(hn::Load(d, p->lower[axis] + lane), upper);
        const V above = hn::Sub(lower, hn::Load(d, p->upper[axis] + lane));
        return hn::Max(hn::Max(below, above), hn::Zero(d));
      };
      const V x = gap(0, box.lower_x, box.upper_x);
      const V y = gap(1, box.lower_y, box.upper_y);
      const V z = gap(2, box.lower_z, box.upper_z);
      const V q = hn::MulAdd(z, z, hn::MulAdd(y, y, hn::Mul(x, x)));
      std::uint8_t bits[8];
      hn::StoreMaskBits(d, hn::Le(q, hn::Load(d, p->reach2 + lane)), bits);
      // Compressed in a register and stored as a full vector: scalar loads follow at once, and masked stores do not forward.
      hn::StoreU(pack_lanes(hn::Load(di, p->id + lane), hn::LoadMaskBits(di, bits)), di, ids + count);
      count += static_cast<std::size_t>(std::popcount(bits[0]));
    }
  }
  return count;
}

std::size_t Filter(const LeafPack* pack, std::size_t pack_count, const Bounds& box, std::uint32_t* ids) {
  return filter_packs(pack, pack_count, spread(box), ids);
}

void Collect(const Field::Index& index, const Bounds& box, std::uint64_t* bits, std::uint64_t* summary) {
  const Full d;
  using V = hn::Vec<Full>;
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  const BoxLanes around = spread(box);
  struct Entry {
    std::size_t level, pack;
  };
  Entry stack[kPack * 12];  // twelve levels of eight hold 2^36 primitives
  std::size_t depth = 0;
  stack[depth++] = {index.level_count, 0};
  std::uint32_t ids[kPack + kSpill];
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.level == 0) {
      const std::size_t count = filter_packs(&index.leaf[entry.pack], 1, around, ids);
      for (std::size_t i = 0; i < count; ++i) {
        bits[ids[i] / 64] |= std::uint64_t{1} << (ids[i] % 64);
        summary[ids[i] / 4096] |= std::uint64_t{1} << (ids[i] / 64 % 64);
      }
      continue;
    }
    const NodePack& node = index.level[entry.level - 1][entry.pack];
    for (std::size_t lane = 0; lane < kPack; lane += kLanes) {
      const auto overlap = [&](std::size_t axis, V lower, V upper) HWY_ATTR {
        return hn::And(hn::Le(hn::Load(d, node.lower[axis] + lane), upper),
                       hn::Le(lower, hn::Load(d, node.upper[axis] + lane)));
      };
      const auto meets = hn::And(overlap(0, around.lower_x, around.upper_x),
                                 hn::And(overlap(1, around.lower_y, around.upper_y),
                                         overlap(2, around.lower_z, around.upper_z)));
      std::uint8_t mask[8];
      hn::StoreMaskBits(d, meets, mask);
      for (unsigned left = mask[0]; left != 0; left &= left - 1) {
        const std::size_t slot = lane + static_cast<std::size_t>(std::countr_zero(left));
        stack[depth++] = {entry.level - 1, entry.pack * kPack + slot};
      }
    }
  }
}

/// The box of a tile's points.
template <class D, std::size_t K, bool kGradient>
HWY_INLINE BoxLanes box_of(D d, const Tile<D, K, kGradient>& tile) {
  const auto reduce = [&](const hn::Vec<D>* v, bool upper) HWY_ATTR {
    auto best = v[0];
    for (std::size_t k = 1; k < K; ++k) best = upper ? hn::Max(best, v[k]) : hn::Min(best, v[k]);
    const auto all = upper ? hn::MaxOfLanes(d, best) : hn::MinOfLanes(d, best);
    if constexpr (hn::MaxLanes(D()) == hn::MaxLanes(Full())) {
      return all;
    } else {
      return hn::Set(Full(), hn::GetLane(all));
    }
  };
  return {reduce(tile.x, false), reduce(tile.y, false), reduce(tile.z, false),
          reduce(tile.x, true),  reduce(tile.y, true),  reduce(tile.z, true)};
}

/// One tile with the candidates of its own box. @return how many candidates
template <bool kGradient, std::size_t K, class D>
HWY_INLINE std::size_t filter_and_evaluate(D d, const Primitives& in, std::span<const LeafPack> packs, std::uint32_t* ids,
                                           const Batch& at) {
  Tile<D, K, kGradient> tile;
  load_points(d, at.points, at.count, tile);
  const std::size_t candidates = filter_packs(packs.data(), packs.size(), box_of(d, tile), ids);
  tile.clear(d);
  add_ids(d, in, ids, candidates, tile);
  store_sums(d, tile, in.iso, at.count, at.values, at.gradients);
  return candidates;
}

template <bool kGradient>
HWY_INLINE std::uint64_t evaluate_tiles(const Primitives& in, std::span<const LeafPack> packs, std::uint32_t* ids, Batch rest) {
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  std::uint64_t visited = 0;
  while (rest.count > 0) {
    const std::size_t left = rest.count;
    const Batch at = take<kGradient>(std::min(left, 2 * kLanes), rest);
    const auto use = [&](auto tile, auto d) HWY_ATTR {
      return filter_and_evaluate<kGradient, decltype(tile)::value>(d, in, packs, ids, at);
    };
    using One = std::integral_constant<std::size_t, 1>;
    using Two = std::integral_constant<std::size_t, 2>;
    const std::size_t candidates = left <= 2 ? use(One(), Pair()) : left <= kLanes ? use(One(), Full()) : use(Two(), Full());
    visited += candidates * at.count;
  }
  return visited;
}

std::uint64_t EvaluatePacks(const Primitives& in, std::span<const LeafPack> packs, std::uint32_t* ids, const Batch& at) {
  if (at.gradients == nullptr) return evaluate_tiles<false>(in, packs, ids, at);
  return evaluate_tiles<true>(in, packs, ids, at);
}

void EvaluateEach(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at) {
  const Full d;
  constexpr std::size_t kLanes = hn::MaxLanes(Full());
  for (std::size_t begin = 0; begin < at.count; begin += kLanes) {
    const std::size_t count = std::min(kLanes, at.count - begin);
    Tile<Full, 1, true> tile;
    load_points(d, at.points + begin, count, tile);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      tile.clear(d);
      add_ids(d, in, ids.data() + i, 1, tile);
      store_sums(d, tile, 0.0, count, at.values + kPack * i + begin, at.gradients + kPack * i + begin);
    }
  }
}

}  // namespace supple::implicit::lanes::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::implicit::lanes {

HWY_EXPORT(EvaluateIds);
HWY_EXPORT(EvaluatePacks);
HWY_EXPORT(EvaluateEach);
HWY_EXPORT(Filter);
HWY_EXPORT(Collect);

Bounds bounds_of(const Vec3* points, std::size_t n) noexcept {
  const double* p = points->data();
  Bounds box{{p[0], p[1], p[2]}, {p[0], p[1], p[2]}};
  for (std::size_t i = 1; i < n; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      box.lower[k] = std::min(box.lower[k], p[3 * i + k]);
      box.upper[k] = std::max(box.upper[k], p[3 * i + k]);
    }
  }
  return box;
}

void evaluate_ids(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at) {
  HWY_DYNAMIC_DISPATCH(EvaluateIds)(in, ids, at);
}

std::uint64_t evaluate_packs(const Primitives& in, std::span<const LeafPack> packs, std::uint32_t* ids, const Batch& at) {
  return HWY_DYNAMIC_DISPATCH(EvaluatePacks)(in, packs, ids, at);
}

void evaluate_each(const Primitives& in, std::span<const std::uint32_t> ids, const Batch& at) {
  HWY_DYNAMIC_DISPATCH(EvaluateEach)(in, ids, at);
}

std::size_t filter(const LeafPack* pack, std::size_t pack_count, const Bounds& box, std::uint32_t* ids) {
  return HWY_DYNAMIC_DISPATCH(Filter)(pack, pack_count, box, ids);
}

void collect(const Field::Index& index, const Bounds& box, std::uint64_t* bits, std::uint64_t* summary) {
  HWY_DYNAMIC_DISPATCH(Collect)(index, box, bits, summary);
}

}  // namespace supple::implicit::lanes
#endif  // HWY_ONCE
