// Eight neighbours as vectors: rows of them become columns and columns go back to rows. Included once for each width.
#if defined(SUPPLE_PACKED_ROWS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SUPPLE_PACKED_ROWS_INL_H
#undef SUPPLE_PACKED_ROWS_INL_H
#else
#define SUPPLE_PACKED_ROWS_INL_H
#endif

#include <hwy/highway.h>
#include <immintrin.h>

#include "neighbours/packed_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, kBatch>;
using V = hn::Vec<D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
constexpr std::size_t kParts = kBatch / kLanes;  ///< vectors of a batch

/// The same for each lane: W is a vector of doubles or of floats.
template <class W>
struct VectorOf {
  W x, y, z;
};
using Vector = VectorOf<V>;

HWY_INLINE V set(double value) { return hn::Set(D(), value); }

/// The rows of kLanes neighbours, as columns.
HWY_INLINE Vector load_rows(const double* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT j) {
#if HWY_TARGET <= HWY_AVX3
  const auto two = [rows](std::uint32_t low, std::uint32_t high) HWY_ATTR {
    return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(rows + low)), _mm256_load_pd(rows + high), 1);
  };
  const __m512d a = two(j[0], j[2]), b = two(j[1], j[3]), c = two(j[4], j[6]), d = two(j[5], j[7]);
  const __m512d ab = _mm512_unpacklo_pd(a, b), cd = _mm512_unpacklo_pd(c, d);
  return {V{_mm512_shuffle_f64x2(ab, cd, 0x88)},
          V{_mm512_shuffle_f64x2(_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d), 0x88)},
          V{_mm512_shuffle_f64x2(ab, cd, 0xDD)}};
#else
  const __m256d a = _mm256_load_pd(rows + j[0]), b = _mm256_load_pd(rows + j[1]);
  const __m256d c = _mm256_load_pd(rows + j[2]), d = _mm256_load_pd(rows + j[3]);
  const __m256d ab = _mm256_unpacklo_pd(a, b), cd = _mm256_unpacklo_pd(c, d);
  return {V{_mm256_permute2f128_pd(ab, cd, 0x20)},
          V{_mm256_permute2f128_pd(_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d), 0x20)},
          V{_mm256_permute2f128_pd(ab, cd, 0x31)}};
#endif
}

#if HWY_TARGET <= HWY_AVX3
/// Eight vectors as rows; those of lanes k and k + 2 in one register. What stands in `w` is of no account.
struct Rows {
  __m512d r02, r46, r13, r57;
};

HWY_INLINE Rows rows_of(const Vector (&v)[kParts]) {
  const __m512d even = _mm512_unpacklo_pd(v[0].x.raw, v[0].y.raw), odd = _mm512_unpackhi_pd(v[0].x.raw, v[0].y.raw);
  const auto with_z = [&](__m512d xy, long long k) HWY_ATTR {
    const __m512i from = _mm512_setr_epi64(k & 6, (k & 6) + 1, 8 + k, 8 + k, (k & 6) + 2, (k & 6) + 3, 10 + k, 10 + k);
    return _mm512_permutex2var_pd(xy, from, v[0].z.raw);
  };
  return {with_z(even, 0), with_z(even, 4), with_z(odd, 1), with_z(odd, 5)};
}

/// ((r0 + r4) + (r1 + r5)) + ((r2 + r6) + (r3 + r7)).
HWY_INLINE __m256d total(const Rows& r) {
  const __m512d sum = _mm512_add_pd(_mm512_add_pd(r.r02, r.r46), _mm512_add_pd(r.r13, r.r57));
  return _mm256_add_pd(_mm512_castpd512_pd256(sum), _mm512_extractf64x4_pd(sum, 1));
}

/// Each of the rows of eight particles combined with its own.
template <class Combine>
HWY_INLINE void combine_rows(const Rows& r, const std::uint32_t* HWY_RESTRICT j, double* HWY_RESTRICT rows,
                             const Combine& combine) {
  // Two rows at a time: the compiler would keep more indices in vector registers.
  const auto two = [&](std::size_t k, __m512d v) HWY_ATTR {
    double* const low = rows + j[k];
    double* const high = rows + j[k + 2];
    v = combine(_mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(low)), _mm256_load_pd(high), 1), v);
    _mm256_store_pd(low, _mm512_castpd512_pd256(v));
    _mm256_store_pd(high, _mm512_extractf64x4_pd(v, 1));
  };
  two(0, r.r02);
  two(4, r.r46);
  two(1, r.r13);
  two(5, r.r57);
}
#else
/// Eight vectors as rows. What stands in `w` is of no account.
struct Rows {
  __m256d r[kBatch];
};

HWY_INLINE Rows rows_of(const Vector (&v)[kParts]) {
  Rows out;
  for (std::size_t p = 0; p < kParts; ++p) {
    const __m256d even = _mm256_unpacklo_pd(v[p].x.raw, v[p].y.raw), odd = _mm256_unpackhi_pd(v[p].x.raw, v[p].y.raw);
    const __m256d z_even = _mm256_unpacklo_pd(v[p].z.raw, v[p].z.raw);
    const __m256d z_odd = _mm256_unpackhi_pd(v[p].z.raw, v[p].z.raw);
    __m256d* const r = out.r + p * kLanes;
    r[0] = _mm256_permute2f128_pd(even, z_even, 0x20);
    r[1] = _mm256_permute2f128_pd(odd, z_odd, 0x20);
    r[2] = _mm256_permute2f128_pd(even, z_even, 0x31);
    r[3] = _mm256_permute2f128_pd(odd, z_odd, 0x31);
  }
  return out;
}

/// ((r0 + r4) + (r1 + r5)) + ((r2 + r6) + (r3 + r7)).
HWY_INLINE __m256d total(const Rows& rows) {
  const __m256d* const r = rows.r;
  return _mm256_add_pd(_mm256_add_pd(_mm256_add_pd(r[0], r[4]), _mm256_add_pd(r[1], r[5])),
                       _mm256_add_pd(_mm256_add_pd(r[2], r[6]), _mm256_add_pd(r[3], r[7])));
}

/// Each of the rows of eight particles combined with its own.
template <class Combine>
HWY_INLINE void combine_rows(const Rows& r, const std::uint32_t* HWY_RESTRICT j, double* HWY_RESTRICT rows,
                             const Combine& combine) {
  for (std::size_t k = 0; k < kBatch; ++k) _mm256_store_pd(rows + j[k], combine(_mm256_load_pd(rows + j[k]), r.r[k]));
}
#endif

HWY_INLINE void add_rows(const Rows& r, const std::uint32_t* j, double* rows) {
  combine_rows(r, j, rows, [](auto a, auto b) HWY_ATTR { return a + b; });
}
HWY_INLINE void subtract_rows(const Rows& r, const std::uint32_t* j, double* rows) {
  combine_rows(r, j, rows, [](auto a, auto b) HWY_ATTR { return a - b; });
}

/// Adds the sum of eight rows to one.
HWY_INLINE void add_total(const Rows& r, double* row) {
  _mm256_store_pd(row, _mm256_add_pd(_mm256_load_pd(row), total(r)));
}
HWY_INLINE void subtract_total(const Rows& r, double* row) {
  _mm256_store_pd(row, _mm256_sub_pd(_mm256_load_pd(row), total(r)));
}

template <class W>
HWY_INLINE W dot(const VectorOf<W>& a, const VectorOf<W>& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
template <class W>
HWY_INLINE W squared(const VectorOf<W>& r) {
  return dot(r, r);
}
template <class W>
HWY_INLINE VectorOf<W> scaled(W s, const VectorOf<W>& v) {
  return {hn::Mul(s, v.x), hn::Mul(s, v.y), hn::Mul(s, v.z)};
}
/// s v + w.
template <class W>
HWY_INLINE VectorOf<W> scaled_sum(W s, const VectorOf<W>& v, const VectorOf<W>& w) {
  return {hn::MulAdd(s, v.x, w.x), hn::MulAdd(s, v.y, w.y), hn::MulAdd(s, v.z, w.z)};
}
template <class W>
HWY_INLINE VectorOf<W> minus(const VectorOf<W>& a, const VectorOf<W>& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

HWY_INLINE Vector broadcast(const double* row) { return {set(row[0]), set(row[1]), set(row[2])}; }

}  // namespace supple::core::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
