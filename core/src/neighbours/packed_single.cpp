// Pair forces in single precision. Two batches at a time; their results are added to rows of doubles.
// AVX2 and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "neighbours/packed_lanes.h"

#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: false warnings in the headers of AVX-512.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "neighbours/packed_single.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/packed_laws-inl.h"
#include "neighbours/packed_rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {

constexpr std::size_t kPair = 2 * kBatch;  ///< neighbours of two batches
using SD = hn::CappedTag<float, kPair>;
using SI = hn::RebindToSigned<SD>;
using S = hn::Vec<SD>;
using Single = VectorOf<S>;
constexpr std::size_t kSingles = hn::MaxLanes(SD());
constexpr std::size_t kSingleParts = kPair / kSingles;  ///< vectors of two batches

#if HWY_TARGET <= HWY_AVX3
HWY_INLINE __m512 four_rows(const float* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT j) {
  __m512 v = _mm512_castps128_ps512(_mm_load_ps(rows + j[0]));
  v = _mm512_insertf32x4(v, _mm_load_ps(rows + j[4]), 1);
  v = _mm512_insertf32x4(v, _mm_load_ps(rows + j[8]), 2);
  return _mm512_insertf32x4(v, _mm_load_ps(rows + j[12]), 3);
}
/// Rows as columns, within each 128 bits.
HWY_INLINE Single columns_of(__m512 a, __m512 b, __m512 c, __m512 d) {
  const __m512d xy = _mm512_castps_pd(_mm512_unpacklo_ps(a, b)), xy2 = _mm512_castps_pd(_mm512_unpacklo_ps(c, d));
  const __m512d zw = _mm512_castps_pd(_mm512_unpackhi_ps(a, b)), zw2 = _mm512_castps_pd(_mm512_unpackhi_ps(c, d));
  return {S{_mm512_castpd_ps(_mm512_unpacklo_pd(xy, xy2))}, S{_mm512_castpd_ps(_mm512_unpackhi_pd(xy, xy2))},
          S{_mm512_castpd_ps(_mm512_unpacklo_pd(zw, zw2))}};
}
/// A number of each of two particles, for the lanes of their batches.
HWY_INLINE S both(float first, float second) {
  return S{_mm512_mask_broadcastss_ps(_mm512_set1_ps(first), 0xff00, _mm_set_ss(second))};
}
#else
HWY_INLINE __m256 four_rows(const float* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT j) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(rows + j[0])), _mm_load_ps(rows + j[4]), 1);
}
/// Rows as columns, within each 128 bits.
HWY_INLINE Single columns_of(__m256 a, __m256 b, __m256 c, __m256 d) {
  const __m256d xy = _mm256_castps_pd(_mm256_unpacklo_ps(a, b)), xy2 = _mm256_castps_pd(_mm256_unpacklo_ps(c, d));
  const __m256d zw = _mm256_castps_pd(_mm256_unpackhi_ps(a, b)), zw2 = _mm256_castps_pd(_mm256_unpackhi_ps(c, d));
  return {S{_mm256_castpd_ps(_mm256_unpacklo_pd(xy, xy2))}, S{_mm256_castpd_ps(_mm256_unpackhi_pd(xy, xy2))},
          S{_mm256_castpd_ps(_mm256_unpacklo_pd(zw, zw2))}};
}
#endif

HWY_INLINE Single load_singles(const float* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT j) {
  return columns_of(four_rows(rows, j), four_rows(rows, j + 1), four_rows(rows, j + 2), four_rows(rows, j + 3));
}

/// A row of each of the particles of two batches; `part` is the vector of them.
HWY_INLINE Single own_rows(const float* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT owner,
                           [[maybe_unused]] std::size_t part) {
#if HWY_TARGET <= HWY_AVX3
  const float* const a = rows + owner[0];
  const float* const b = rows + owner[1];
  return {both(a[0], b[0]), both(a[1], b[1]), both(a[2], b[2])};
#else
  const SD d;
  const float* const a = rows + owner[part];
  return {hn::Set(d, a[0]), hn::Set(d, a[1]), hn::Set(d, a[2])};
#endif
}

/// r in metres: differences of whole numbers of quanta are exact; padding lanes are out of range.
HWY_INLINE Single separation(const Fixed& fixed, const std::uint32_t* HWY_RESTRICT owner,
                             const std::uint32_t* HWY_RESTRICT j, std::uint32_t filler, std::size_t part) {
  const SD d;
  const SI whole;
  const Single x = own_rows(fixed.rows, owner, part), y = load_singles(fixed.rows, j);
  const S quantum = hn::Set(d, fixed.quantum);
  const auto along = [&](S from, S to) HWY_ATTR {
    return hn::Mul(hn::ConvertTo(d, hn::Sub(hn::BitCast(whole, to), hn::BitCast(whole, from))), quantum);
  };
  const hn::RebindToUnsigned<SD> index;
  const auto none = hn::RebindMask(d, hn::Eq(hn::LoadU(index, j), hn::Set(index, filler)));
  return {hn::IfThenElse(none, hn::Set(d, fixed.outside), along(x.x, y.x)), along(x.y, y.y), along(x.z, y.z)};
}

/// Eight vectors of one batch as pairs of rows of doubles: k and k + 4 of the batch together.
struct DoubleRows {
#if HWY_TARGET <= HWY_AVX3
  __m512d pair[4];
#else
  __m256d low[4], high[4];
#endif
};

/// Rows of the first and of the second batch.
struct RowsOfTwo {
  DoubleRows batch[2];
};

HWY_INLINE DoubleRows widen(__m256 r04, __m256 r15, __m256 r26, __m256 r37) {
  DoubleRows out;
#if HWY_TARGET <= HWY_AVX3
  out.pair[0] = _mm512_cvtps_pd(r04);
  out.pair[1] = _mm512_cvtps_pd(r15);
  out.pair[2] = _mm512_cvtps_pd(r26);
  out.pair[3] = _mm512_cvtps_pd(r37);
#else
  const __m256 r[4] = {r04, r15, r26, r37};
  for (std::size_t k = 0; k < 4; ++k) {
    out.low[k] = _mm256_cvtps_pd(_mm256_castps256_ps128(r[k]));
    out.high[k] = _mm256_cvtps_pd(_mm256_extractf128_ps(r[k], 1));
  }
#endif
  return out;
}

HWY_INLINE RowsOfTwo rows_of_singles(const Single (&v)[kSingleParts]) {
  RowsOfTwo out;
#if HWY_TARGET <= HWY_AVX3
  const __m512 x = v[0].x.raw, y = v[0].y.raw, z = v[0].z.raw;
  const __m512d xy = _mm512_castps_pd(_mm512_unpacklo_ps(x, y)), xy2 = _mm512_castps_pd(_mm512_unpackhi_ps(x, y));
  const __m512d zz = _mm512_castps_pd(_mm512_unpacklo_ps(z, z)), zz2 = _mm512_castps_pd(_mm512_unpackhi_ps(z, z));
  const __m512d r0 = _mm512_unpacklo_pd(xy, zz), r1 = _mm512_unpackhi_pd(xy, zz);
  const __m512d r2 = _mm512_unpacklo_pd(xy2, zz2), r3 = _mm512_unpackhi_pd(xy2, zz2);
  const auto low = [](__m512d r) HWY_ATTR { return _mm256_castpd_ps(_mm512_castpd512_pd256(r)); };
  const auto high = [](__m512d r) HWY_ATTR { return _mm256_castpd_ps(_mm512_extractf64x4_pd(r, 1)); };
  out.batch[0] = widen(low(r0), low(r1), low(r2), low(r3));
  out.batch[1] = widen(high(r0), high(r1), high(r2), high(r3));
#else
  for (std::size_t p = 0; p < kSingleParts; ++p) {
    const __m256 x = v[p].x.raw, y = v[p].y.raw, z = v[p].z.raw;
    const __m256d xy = _mm256_castps_pd(_mm256_unpacklo_ps(x, y)), xy2 = _mm256_castps_pd(_mm256_unpackhi_ps(x, y));
    const __m256d zz = _mm256_castps_pd(_mm256_unpacklo_ps(z, z)), zz2 = _mm256_castps_pd(_mm256_unpackhi_ps(z, z));
    const auto row = [](__m256d r) HWY_ATTR { return _mm256_castpd_ps(r); };
    out.batch[p] = widen(row(_mm256_unpacklo_pd(xy, zz)), row(_mm256_unpackhi_pd(xy, zz)),
                         row(_mm256_unpacklo_pd(xy2, zz2)), row(_mm256_unpackhi_pd(xy2, zz2)));
  }
#endif
  return out;
}

/// ((r0 + r1) + (r2 + r3)) + ((r4 + r5) + (r6 + r7)).
HWY_INLINE __m256d total(const DoubleRows& r) {
#if HWY_TARGET <= HWY_AVX3
  const __m512d sum = _mm512_add_pd(_mm512_add_pd(r.pair[0], r.pair[1]), _mm512_add_pd(r.pair[2], r.pair[3]));
  return _mm256_add_pd(_mm512_castpd512_pd256(sum), _mm512_extractf64x4_pd(sum, 1));
#else
  const auto four = [](const __m256d* v) HWY_ATTR {
    return _mm256_add_pd(_mm256_add_pd(v[0], v[1]), _mm256_add_pd(v[2], v[3]));
  };
  return _mm256_add_pd(four(r.low), four(r.high));
#endif
}

/// Adds (or with kSign = -1 subtracts) the rows of one batch to those of its particles.
template <int kSign>
HWY_INLINE void add_singles(const DoubleRows& r, const std::uint32_t* HWY_RESTRICT j, double* HWY_RESTRICT rows) {
  for (std::size_t k = 0; k < 4; ++k) {
    double* const low = rows + j[k];
    double* const high = rows + j[k + 4];
#if HWY_TARGET <= HWY_AVX3
    const __m512d old = _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(low)), _mm256_load_pd(high), 1);
    const __m512d sum = kSign > 0 ? _mm512_add_pd(old, r.pair[k]) : _mm512_sub_pd(old, r.pair[k]);
    _mm256_store_pd(low, _mm512_castpd512_pd256(sum));
    _mm256_store_pd(high, _mm512_extractf64x4_pd(sum, 1));
#else
    const __m256d at_low = _mm256_load_pd(low), at_high = _mm256_load_pd(high);
    _mm256_store_pd(low, kSign > 0 ? _mm256_add_pd(at_low, r.low[k]) : _mm256_sub_pd(at_low, r.low[k]));
    _mm256_store_pd(high, kSign > 0 ? _mm256_add_pd(at_high, r.high[k]) : _mm256_sub_pd(at_high, r.high[k]));
#endif
  }
}

HWY_INLINE void add_single_total(const DoubleRows& r, double* row) {
  _mm256_store_pd(row, _mm256_add_pd(_mm256_load_pd(row), total(r)));
}
HWY_INLINE void subtract_single_total(const DoubleRows& r, double* row) {
  _mm256_store_pd(row, _mm256_sub_pd(_mm256_load_pd(row), total(r)));
}

struct alignas(64) SingleColumn {
  float v[kPair];
};
struct SingleColumns {
  SingleColumn x, y, z;
};
HWY_INLINE S load(const SingleColumn& c, std::size_t k) { return hn::Load(SD(), c.v + k); }
HWY_INLINE Single load(const SingleColumns& c, std::size_t k) { return {load(c.x, k), load(c.y, k), load(c.z, k)}; }
HWY_INLINE void store(S value, std::size_t k, SingleColumn& c) { hn::Store(value, SD(), c.v + k); }
HWY_INLINE void store(const Single& value, std::size_t k, SingleColumns& c) {
  store(value.x, k, c.x);
  store(value.y, k, c.y);
  store(value.z, k, c.z);
}
HWY_INLINE RowsOfTwo load_rows_of(const SingleColumns& c) {
  Single v[kSingleParts];
  for (std::size_t p = 0; p < kSingleParts; ++p) v[p] = load(c, p * kSingles);
  return rows_of_singles(v);
}

/// Twice as many batches as this are processed in short passes; their intermediate values stay in the first cache.
constexpr std::size_t kNearPairs = 16;

void TwelveSixSingles(const TwelveSixNumbers& given, const ListBlock& list, const Fixed& fixed,
                      Row* HWY_RESTRICT force) {
  const TwelveSixNumbers law = given;
  double* HWY_RESTRICT forces = &force->x;
  SingleColumns push[kNearPairs];
  for (std::size_t begin = 0; begin < list.batches; begin += 2 * kNearPairs) {
    const std::uint32_t* HWY_RESTRICT owner = list.owner.data() + begin;
    const std::uint32_t* HWY_RESTRICT neighbour = list.neighbour.data() + kBatch * begin;
    const std::size_t count = std::min((list.batches - begin + 1) / 2, kNearPairs);
    for (std::size_t b = 0; b < count; ++b) {
      for (std::size_t p = 0; p < kSingleParts; ++p) {
        const std::size_t k = p * kSingles;
        const Single r = separation(fixed, owner + 2 * b, neighbour + kPair * b + k, list.filler, p);
        const S d2 = squared(r);
        store(scaled(twelve_six_slope(law, d2, hn::Div(all<S>(1.0), d2)), r), k, push[b]);
      }
    }
    for (std::size_t b = 0; b < count; ++b) {
      const RowsOfTwo rows = load_rows_of(push[b]);
      for (std::size_t k = 0; k < 2; ++k) {
        subtract_single_total(rows.batch[k], forces + owner[2 * b + k]);
        add_singles<1>(rows.batch[k], neighbour + kPair * b + k * kBatch, forces);
      }
    }
  }
}

/// e^x for x <= 0, below e^-87 that; error about 1 ulp.
HWY_INLINE S exp_negative_single(S x) {
  const SD d;
  const SI whole;
  x = hn::Max(x, all<S>(-87.0));
  // The sum with 3 2^22 rounds to a whole number and leaves it in the low bits.
  const S shifted = hn::MulAdd(x, all<S>(1.4426950408889634), all<S>(12582912.0));
  const S n = hn::Sub(shifted, all<S>(12582912.0));
  const S r = hn::NegMulAdd(n, all<S>(-0x1.05c610ca86c39p-29), hn::NegMulAdd(n, all<S>(0x1.62e43p-1), x));
  // The series to r^7 / 7!: |r| < 0.35 leaves 6e-9.
  const S r2 = hn::Mul(r, r);
  const auto two = [&](double low, double high) HWY_ATTR { return hn::MulAdd(r, all<S>(high), all<S>(low)); };
  const S low = hn::MulAdd(r2, two(1.0 / 2, 1.0 / 6), two(1.0, 1.0));
  const S high = hn::MulAdd(r2, two(1.0 / 720, 1.0 / 5040), two(1.0 / 24, 1.0 / 120));
  const S series = hn::MulAdd(hn::Mul(r2, r2), high, low);
  return hn::BitCast(d, hn::Add(hn::BitCast(whole, series), hn::ShiftLeft<23>(hn::BitCast(whole, shifted))));
}

/// Values of two batches.
struct NearSingles {
  SingleColumns r, push, turn_i, turn_j;
  SingleColumn d, pull;
};

void SurfaceSingles(const SurfaceNumbers& given, const ListBlock& list, const Fixed& fixed,
                    const float* HWY_RESTRICT normals, Row* HWY_RESTRICT force, Row* HWY_RESTRICT turn) {
  const SurfaceNumbers law = given;
  double* HWY_RESTRICT forces = &force->x;
  double* HWY_RESTRICT turns = &turn->x;
  NearSingles near[kNearPairs];
  for (std::size_t begin = 0; begin < list.batches; begin += 2 * kNearPairs) {
    const std::uint32_t* HWY_RESTRICT owner = list.owner.data() + begin;
    const std::uint32_t* HWY_RESTRICT neighbour = list.neighbour.data() + kBatch * begin;
    const std::size_t count = std::min((list.batches - begin + 1) / 2, kNearPairs);
    const auto each = [&](const auto& use) HWY_ATTR {
      for (std::size_t b = 0; b < count; ++b) {
        for (std::size_t p = 0; p < kSingleParts; ++p) use(b, p, p * kSingles);
      }
    };
    each([&](std::size_t b, std::size_t p, std::size_t k) HWY_ATTR {
      const Single r = separation(fixed, owner + 2 * b, neighbour + kPair * b + k, list.filler, p);
      store(r, k, near[b].r);
      store(hn::Sqrt(squared(r)), k, near[b].d);
    });
    each([&](std::size_t b, std::size_t, std::size_t k) HWY_ATTR {
      const S length = load(near[b].d, k);
      const S v = hn::MulSub(length, all<S>(law.inverse_r0), all<S>(1.0));
      const S v2 = hn::Mul(v, v);
      const S bell = exp_negative_single(hn::Mul(all<S>(-law.a), v2));
      const S gain = hn::Mul(hn::Mul(v2, v), all<S>(law.cohesion));
      store(hn::IfThenElseZero(hn::Lt(length, all<S>(law.range)), hn::Mul(gain, bell)), k, near[b].pull);
    });
    each([&](std::size_t b, std::size_t p, std::size_t k) HWY_ATTR {
      const Single r = load(near[b].r, k);
      const Single n = own_rows(normals, owner + 2 * b, p), m = load_singles(normals, neighbour + kPair * b + k);
      const SurfaceGains<S> u = surface_gains(law, r, n, m, load(near[b].pull, k));
      store(scaled_sum(u.u_b, m, scaled_sum(u.u_a, n, scaled(u.g, r))), k, near[b].push);
      store(scaled_sum(u.u_c, m, scaled(u.u_a, r)), k, near[b].turn_i);
      store(scaled_sum(u.u_c, n, scaled(u.u_b, r)), k, near[b].turn_j);
    });
    for (std::size_t b = 0; b < count; ++b) {
      const RowsOfTwo rows = load_rows_of(near[b].push);
      for (std::size_t k = 0; k < 2; ++k) {
        add_single_total(rows.batch[k], forces + owner[2 * b + k]);
        add_singles<-1>(rows.batch[k], neighbour + kPair * b + k * kBatch, forces);
      }
    }
    for (std::size_t b = 0; b < count; ++b) {
      const RowsOfTwo rows = load_rows_of(near[b].turn_i);
      for (std::size_t k = 0; k < 2; ++k) add_single_total(rows.batch[k], turns + owner[2 * b + k]);
    }
    for (std::size_t b = 0; b < count; ++b) {
      const RowsOfTwo rows = load_rows_of(near[b].turn_j);
      for (std::size_t k = 0; k < 2; ++k) {
        add_singles<1>(rows.batch[k], neighbour + kPair * b + k * kBatch, turns);
      }
    }
  }
}

}  // namespace supple::core::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::core::packed {

HWY_EXPORT(TwelveSixSingles);
HWY_EXPORT(SurfaceSingles);

void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, const Fixed& fixed, Row* force) {
  HWY_DYNAMIC_DISPATCH(TwelveSixSingles)(law, list, fixed, force);
}

void surface_loads(const SurfaceNumbers& law, const ListBlock& list, const Fixed& fixed, const float* normals,
                   Row* force, Row* turn) {
  HWY_DYNAMIC_DISPATCH(SurfaceSingles)(law, list, fixed, normals, force, turn);
}

}  // namespace supple::core::packed
#endif  // HWY_ONCE
