// AVX2 and AVX-512 variants only; AES support must not decide which variant a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "packed_lanes.h"

#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: false warnings in the headers of AVX-512.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "packed_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, kBatch>;
using V = hn::Vec<D>;
using F = hn::CappedTag<float, kFloatRoom>;
using U = hn::RebindToUnsigned<F>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
constexpr std::size_t kParts = kBatch / kLanes;  ///< vectors of a batch

constexpr float kNowhere = 1e30F;  ///< a coordinate farther away than any range

struct Vector {
  V x, y, z;
};

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

/// Eight sums of four numbers, in kParts vectors.
struct Sums {
  struct Part {
    Vector v;
    V w;
  };
  Part part[kParts];
};

HWY_INLINE void clear(Sums& sums) {
  for (Sums::Part& p : sums.part) p.v.x = p.v.y = p.v.z = p.w = hn::Zero(D());
}

HWY_INLINE __m256d half_sum(V first, [[maybe_unused]] V last) {
#if HWY_TARGET <= HWY_AVX3
  return _mm256_add_pd(_mm512_castpd512_pd256(first.raw), _mm512_extractf64x4_pd(first.raw, 1));
#else
  return _mm256_add_pd(first.raw, last.raw);
#endif
}

/// ((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7)) of each number.
HWY_INLINE Row total(const Sums& sums) {
  const Sums::Part& a = sums.part[0];
  const Sums::Part& b = sums.part[kParts - 1];
  const __m256d x = half_sum(a.v.x, b.v.x), y = half_sum(a.v.y, b.v.y);
  const __m256d z = half_sum(a.v.z, b.v.z), w = half_sum(a.w, b.w);
  const __m256d xy = _mm256_add_pd(_mm256_unpacklo_pd(x, y), _mm256_unpackhi_pd(x, y));
  const __m256d zw = _mm256_add_pd(_mm256_unpacklo_pd(z, w), _mm256_unpackhi_pd(z, w));
  Row out;
  _mm256_store_pd(&out.x, _mm256_add_pd(_mm256_permute2f128_pd(xy, zw, 0x20), _mm256_permute2f128_pd(xy, zw, 0x31)));
  return out;
}

HWY_INLINE V dot(const Vector& a, const Vector& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE V squared(const Vector& r) { return dot(r, r); }

HWY_INLINE void add_scaled(V s, const Vector& v, Vector& sum) {
  sum.x = hn::MulAdd(s, v.x, sum.x);
  sum.y = hn::MulAdd(s, v.y, sum.y);
  sum.z = hn::MulAdd(s, v.z, sum.z);
}

HWY_INLINE Vector minus(const Vector& a, const Vector& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

HWY_INLINE Vector broadcast(const Row& row) { return {set(row.x), set(row.y), set(row.z)}; }

/// Two batches of neighbours, which share a division.
struct TwoBatches {
  Vector a, b;
  V a2, b2, inverse;
};

HWY_INLINE TwoBatches load_two(const double* HWY_RESTRICT rows, const std::uint32_t* HWY_RESTRICT j, const Vector& x) {
  TwoBatches out;
  out.a = minus(load_rows(rows, j), x);
  out.b = minus(load_rows(rows, j + kBatch), x);
  out.a2 = squared(out.a);
  out.b2 = squared(out.b);
  out.inverse = hn::Div(set(1.0), hn::Mul(out.a2, out.b2));
  return out;
}

/// Calls use(r, d^2, 1 / d^2, part) for all vectors of neighbours of particle k.
template <class Use>
HWY_INLINE void for_neighbours(const ListBlock& list, std::size_t k, const Row* HWY_RESTRICT position, const Use& use) {
  const double* HWY_RESTRICT rows = &position->x;
  const Vector x = broadcast(position[list.point[k]]);
  const std::uint32_t* HWY_RESTRICT j = list.neighbour.data() + list.first[k];
  const std::uint32_t* const end = list.neighbour.data() + list.last[k];
  if (j + kBatch < end) {
    TwoBatches now[kParts];
    for (std::size_t p = 0; p < kParts; ++p) now[p] = load_two(rows, j + p * kLanes, x);
    j += 2 * kBatch;
    // The next two are divided while these are used: one after the other they would wait for each other.
    for (; j + kBatch < end; j += 2 * kBatch) {
      for (std::size_t p = 0; p < kParts; ++p) {
        const TwoBatches next = load_two(rows, j + p * kLanes, x);
        use(now[p].a, now[p].a2, hn::Mul(now[p].inverse, now[p].b2), p);
        use(now[p].b, now[p].b2, hn::Mul(now[p].inverse, now[p].a2), p);
        now[p] = next;
      }
    }
    for (std::size_t p = 0; p < kParts; ++p) {
      use(now[p].a, now[p].a2, hn::Mul(now[p].inverse, now[p].b2), p);
      use(now[p].b, now[p].b2, hn::Mul(now[p].inverse, now[p].a2), p);
    }
  }
  if (j < end) {
    for (std::size_t p = 0; p < kParts; ++p) {
      const Vector a = minus(load_rows(rows, j + p * kLanes), x);
      const V a2 = squared(a);
      use(a, a2, hn::Div(set(1.0), a2), p);
    }
  }
}

void TwelveSixForces(const TwelveSixNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                     const Row* HWY_RESTRICT position, Row* HWY_RESTRICT force) {
  const V range2 = set(law.range2), twelve = set(law.twelve), six = set(law.six);
  for (std::size_t k = begin; k < end; ++k) {
    Sums sums;
    clear(sums);
    for_neighbours(list, k, position,
                   [&](const Vector& r, V d2, V inverse, std::size_t p) HWY_ATTR {
                     const V i6 = hn::Mul(hn::Mul(inverse, inverse), inverse);
                     const V g = hn::Mul(hn::Mul(i6, inverse), hn::NegMulAdd(twelve, i6, six));
                     add_scaled(hn::IfThenElseZero(hn::Lt(d2, range2), g), r, sums.part[p].v);
                   });
    force[k - begin] = total(sums);
  }
}

/// e^x for x <= 0; error about 2 ulp, below e^-700 that.
HWY_INLINE V exp_negative(V x) {
  const D d;
  const hn::RebindToSigned<D> whole;
  x = hn::Max(x, set(-700.0));
  // The sum with 3 2^51 rounds to a whole number and leaves it in the low bits.
  const V magic = set(0x1.8p52);
  const V shifted = hn::MulAdd(x, set(0x1.71547652b82fep0), magic);
  const V n = hn::Sub(shifted, magic);
  const V r = hn::NegMulAdd(n, set(0x1.abc9e3b39803fp-56), hn::NegMulAdd(n, set(0x1.62e42fefa39efp-1), x));
  const V r2 = hn::Mul(r, r), r4 = hn::Mul(r2, r2);
  // The series to r^12 / 12!: |r| < 0.35 leaves 2e-16.
  const auto two = [&](double low, double high) HWY_ATTR { return hn::MulAdd(r, set(high), set(low)); };
  const V c0 = hn::MulAdd(r2, two(1.0 / 2, 1.0 / 6), two(1.0, 1.0));
  const V c4 = hn::MulAdd(r2, two(1.0 / 720, 1.0 / 5040), two(1.0 / 24, 1.0 / 120));
  const V c8 = hn::MulAdd(r2, two(1.0 / 3628800, 1.0 / 39916800), two(1.0 / 40320, 1.0 / 362880));
  const V high = hn::MulAdd(r4, set(1.0 / 479001600), c8);
  const V series = hn::MulAdd(r4, hn::MulAdd(r4, high, c4), c0);
  return hn::BitCast(d, hn::Add(hn::BitCast(whole, series), hn::ShiftLeft<52>(hn::BitCast(whole, shifted))));
}

/// 1 / sqrt(x) to about 1 ulp for x in [1e-300, 1e300], without the divider and with the same bits everywhere.
HWY_INLINE V inverse_sqrt(V x) {
  const D d;
  const hn::RebindToUnsigned<D> bits;
  // Halving the exponent is right to 3.5 %; two steps of the binomial series of (1 - e)^(-1/2) follow.
  V y = hn::BitCast(d, hn::Sub(hn::Set(bits, 0x5fe6eb50c7b537a9ULL), hn::ShiftRight<1>(hn::BitCast(bits, x))));
  V e = hn::NegMulAdd(hn::Mul(x, y), y, set(1.0));
  const V series = hn::MulAdd(hn::MulAdd(hn::MulAdd(e, set(35.0 / 128), set(5.0 / 16)), e, set(3.0 / 8)), e, set(0.5));
  y = hn::MulAdd(hn::Mul(y, e), series, y);
  e = hn::NegMulAdd(hn::Mul(x, y), y, set(1.0));
  return hn::MulAdd(hn::Mul(y, e), hn::MulAdd(e, set(3.0 / 8), set(0.5)), y);
}

/// Neighbours in range of some particles, in the order of their lists; whole batches, filled up with such that add 0.
/// Passes after each other fill the columns: each is so short that a processor works on several vectors of it at once.
struct InRange {
  static constexpr std::size_t kRoom = 328;       ///< neighbours: all columns fit the first cache
  static constexpr std::size_t kLongest = 256;    ///< of one segment, before those out of range are left out
  static constexpr std::size_t kSegments = 8;
  struct Segment {
    std::size_t particle, begin, end;
  };
  alignas(64) std::uint32_t index[kRoom + 2 * kBatch];
  alignas(64) double x[kRoom], y[kRoom], z[kRoom], d2[kRoom];          ///< r and its square
  alignas(64) double mx[kRoom], my[kRoom], mz[kRoom];                  ///< normals
  alignas(64) double a[kRoom], b[kRoom], unlike[kRoom];                ///< n_i . r, n_j . r, 1 - n_i . n_j
  alignas(64) double inverse[kRoom], rest[kRoom];                      ///< 1 / d^2, 1 - d^2 / h^2
  alignas(64) double well[kRoom];                                      ///< slope of cohesion over d
  Segment segment[kSegments];
  std::size_t segments = 0;
  std::size_t count = 0;
};

/// Appends the neighbours in range among [j, end) as a segment.
HWY_INLINE void keep_in_range(const double* HWY_RESTRICT rows, const Vector& x, double range2, std::uint32_t filler,
                              std::size_t particle, const std::uint32_t* HWY_RESTRICT j, const std::uint32_t* end,
                              InRange& out) {
  const V limit = set(range2);
  std::size_t count = out.count;
  for (; j < end; j += kLanes) {
    const auto near = hn::Lt(squared(minus(load_rows(rows, j), x)), limit);
#if HWY_TARGET <= HWY_AVX3
    const __m256i index = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(j));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.index + count), _mm256_maskz_compress_epi32(near.raw, index));
    count += static_cast<std::size_t>(__builtin_popcount(near.raw));
#else
    for (auto bits = static_cast<unsigned>(_mm256_movemask_pd(near.raw)); bits != 0; bits &= bits - 1U) {
      out.index[count++] = j[__builtin_ctz(bits)];
    }
#endif
  }
  for (std::size_t k = 0; k < kBatch; ++k) out.index[count + k] = filler;
  const std::size_t begin = out.count;
  out.count = (count + kBatch - 1) / kBatch * kBatch;
  out.segment[out.segments++] = {particle, begin, out.count};
}

HWY_INLINE void load_segment(const double* HWY_RESTRICT rows, const double* HWY_RESTRICT normals, const Vector& x,
                             const Vector& n, const InRange::Segment& segment, InRange& near) {
  const D d;
  for (std::size_t k = segment.begin; k < segment.end; k += kLanes) {
    const Vector r = minus(load_rows(rows, near.index + k), x);
    hn::Store(r.x, d, near.x + k);
    hn::Store(r.y, d, near.y + k);
    hn::Store(r.z, d, near.z + k);
    hn::Store(squared(r), d, near.d2 + k);
    hn::Store(dot(n, r), d, near.a + k);
  }
  for (std::size_t k = segment.begin; k < segment.end; k += kLanes) {
    const Vector m = load_rows(normals, near.index + k);
    const Vector r{hn::Load(d, near.x + k), hn::Load(d, near.y + k), hn::Load(d, near.z + k)};
    hn::Store(m.x, d, near.mx + k);
    hn::Store(m.y, d, near.my + k);
    hn::Store(m.z, d, near.mz + k);
    hn::Store(dot(m, r), d, near.b + k);
    hn::Store(hn::Sub(set(1.0), dot(n, m)), d, near.unlike + k);
  }
}

/// The columns that depend on the distance alone. The slope of cohesion over d is F0 r0 v^3 exp(-a v^2) / d^2.
HWY_INLINE void evaluate_distances(const SurfaceNumbers& law, InRange& near) {
  const D d;
  for (std::size_t k = 0; k < near.count; k += kLanes) {
    const V d2 = hn::Load(d, near.d2 + k);
    const V y = inverse_sqrt(d2);
    hn::Store(hn::Mul(y, y), d, near.inverse + k);
    hn::Store(hn::MulSub(hn::Mul(d2, y), set(law.inverse_r0), set(1.0)), d, near.well + k);
    hn::Store(hn::Max(hn::NegMulAdd(d2, set(law.inverse_h2), set(1.0)), hn::Zero(d)), d, near.rest + k);
  }
  for (std::size_t k = 0; k < near.count; k += kLanes) {
    const V v = hn::Load(d, near.well + k);
    const V v2 = hn::Mul(v, v);
    const V bell = exp_negative(hn::Mul(set(-law.a), v2));
    const V gain = hn::Mul(hn::Mul(v2, v), hn::Mul(set(law.cohesion), hn::Load(d, near.inverse + k)));
    const V near_enough = hn::IfThenElseZero(hn::Lt(hn::Load(d, near.d2 + k), set(law.range2)), gain);
    hn::Store(hn::Mul(near_enough, bell), d, near.well + k);
  }
}

/// With a = n_i . r, b = n_j . r, c = n_i . n_j the energy of a pair is
/// U_c(d) + psi E, E = k_f (kappa^2 + 2 w / d^2) + k_p (a^2 + b^2) + k_c (a + b)^2 + 2 k_n (1 - c),
/// w = kappa (a - b) + 1 - c, so that dU/dr = G r + U_a n_i + U_b n_j and dU/dn_i = U_a r + U_c n_j.
HWY_INLINE void add_surface_loads(const SurfaceNumbers& law, std::size_t begin, const InRange& near, Sums& pull,
                                  Sums& turn) {
  const D d;
  for (std::size_t p = 0; p < kParts; ++p) {
    const std::size_t k = begin + p * kLanes;
    const Vector r{hn::Load(d, near.x + k), hn::Load(d, near.y + k), hn::Load(d, near.z + k)};
    const Vector m{hn::Load(d, near.mx + k), hn::Load(d, near.my + k), hn::Load(d, near.mz + k)};
    const V a = hn::Load(d, near.a + k), b = hn::Load(d, near.b + k), unlike = hn::Load(d, near.unlike + k);
    const V inverse = hn::Load(d, near.inverse + k), rest = hn::Load(d, near.rest + k);
    const V rest2 = hn::Mul(rest, rest);
    const V psi2 = hn::Mul(rest2, hn::Add(rest, rest));
    const V form = hn::Mul(set(law.form), inverse);
    const V bend = hn::Mul(set(law.curvature), form);
    const V both = hn::Add(a, b);
    const V circle = hn::Mul(set(law.cocircularity), both);
    const V w = hn::MulAdd(set(law.curvature), hn::Sub(a, b), unlike);
    const V half = hn::Mul(form, w);
    const V twice = hn::Add(half, half);
    const V flat = hn::MulAdd(a, a, hn::Mul(b, b));
    const V e = hn::Add(hn::MulAdd(set(law.conormality2), unlike, hn::Add(twice, set(law.form_offset))),
                        hn::MulAdd(circle, both, hn::Mul(set(law.coplanarity), flat)));
    const V well = hn::NegMulAdd(psi2, hn::Mul(twice, inverse), hn::Load(d, near.well + k));
    const V g = hn::MulAdd(hn::Mul(rest2, set(law.slope)), e, well);
    const V u_a = hn::Mul(psi2, hn::MulAdd(set(law.coplanarity), a, hn::Add(circle, bend)));
    const V u_b = hn::Mul(psi2, hn::MulAdd(set(law.coplanarity), b, hn::Sub(circle, bend)));
    const V u_c = hn::Mul(psi2, hn::Sub(set(-law.conormality), form));
    Sums::Part& f = pull.part[p];
    Sums::Part& t = turn.part[p];
    add_scaled(g, r, f.v);
    add_scaled(u_b, m, f.v);
    f.w = hn::Add(f.w, u_a);
    add_scaled(u_a, r, t.v);
    add_scaled(u_c, m, t.v);
  }
}

void SurfaceLoads(const SurfaceNumbers& given, const ListBlock& list, std::size_t begin, std::size_t end,
                  std::uint32_t filler, const Row* HWY_RESTRICT position, const Row* HWY_RESTRICT normal,
                  Row* HWY_RESTRICT force, Row* HWY_RESTRICT torque) {
  const SurfaceNumbers law = given;
  const double* HWY_RESTRICT rows = &position->x;
  const double* HWY_RESTRICT normals = &normal->x;
  InRange near;
  const auto flush = [&]() HWY_ATTR {
    for (std::size_t s = 0; s < near.segments; ++s) {
      const std::uint32_t point = list.point[near.segment[s].particle];
      load_segment(rows, normals, broadcast(position[point]), broadcast(normal[point]), near.segment[s], near);
    }
    evaluate_distances(law, near);
    for (std::size_t s = 0; s < near.segments; ++s) {
      const InRange::Segment& segment = near.segment[s];
      const Row& own = normal[list.point[segment.particle]];
      Sums pull, turn;
      clear(pull);
      clear(turn);
      for (std::size_t b = segment.begin; b < segment.end; b += kBatch) {
        add_surface_loads(law, b, near, pull, turn);
      }
      const Row f = total(pull), t = total(turn);
      Row& out_f = force[segment.particle - begin];
      Row& out_t = torque[segment.particle - begin];
      out_f = {out_f.x + (f.x + f.w * own.x), out_f.y + (f.y + f.w * own.y), out_f.z + (f.z + f.w * own.z), 0.0};
      out_t = {out_t.x + (own.z * t.y - own.y * t.z), out_t.y + (own.x * t.z - own.z * t.x),
               out_t.z + (own.y * t.x - own.x * t.y), 0.0};
    }
    near.segments = 0;
    near.count = 0;
  };
  for (std::size_t k = begin; k < end; ++k) {
    force[k - begin] = torque[k - begin] = {};
    const Vector x = broadcast(position[list.point[k]]);
    const std::uint32_t* const last = list.neighbour.data() + list.last[k];
    for (const std::uint32_t* j = list.neighbour.data() + list.first[k]; j < last;) {
      const std::uint32_t* const stop = last - j > std::ptrdiff_t{InRange::kLongest} ? j + InRange::kLongest : last;
      const std::size_t room = static_cast<std::size_t>(stop - j) + kBatch;
      if (near.segments == InRange::kSegments || near.count + room > InRange::kRoom) flush();
      keep_in_range(rows, x, law.range2, filler, k, j, stop, near);
      j = stop;
    }
  }
  flush();
}

/// Copies the points of the rows of cells round the tile that begins at `cell`. @return how many
HWY_INLINE std::uint32_t collect(const CellGrid& grid, std::uint32_t cell, ListBlock& out) {
  const F f;
  const U u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(F()));
  const auto ny = static_cast<std::int32_t>(grid.cells[1]), nz = static_cast<std::int32_t>(grid.cells[2]);
  std::array<std::uint32_t, (2 * kReach + 1) * (2 * kReach + 1)> begin, end;
  std::uint32_t room = 2 * kFloatRoom;
  std::size_t rows = 0;
  for (int dx = -kReach; dx <= kReach; ++dx) {
    for (int dy = -kReach; dy <= kReach; ++dy, ++rows) {
      const std::uint32_t row = cell + static_cast<std::uint32_t>((dx * ny + dy) * nz);
      begin[rows] = grid.start[row - kReachUp];
      end[rows] = grid.start[row + kTile + kReachUp];
      room += end[rows] - begin[rows];
    }
  }
  if (out.near_index.size() < room) {
    for (std::vector<float>* v : {&out.near_x, &out.near_y, &out.near_z}) v->resize(room);
    out.near_index.resize(room);
  }
  const float* HWY_RESTRICT gx = grid.x.data();
  const float* HWY_RESTRICT gy = grid.y.data();
  const float* HWY_RESTRICT gz = grid.z.data();
  float* HWY_RESTRICT x = out.near_x.data();
  float* HWY_RESTRICT y = out.near_y.data();
  float* HWY_RESTRICT z = out.near_z.data();
  std::uint32_t* HWY_RESTRICT index = out.near_index.data();
  const auto steps = hn::Iota(u, 0);
  std::uint32_t count = 0;
  for (std::size_t r = 0; r < rows; ++r) {
    std::uint32_t k = begin[r], to = count;
    do {
      hn::StoreU(hn::LoadU(f, gx + k), f, x + to);
      hn::StoreU(hn::LoadU(f, gy + k), f, y + to);
      hn::StoreU(hn::LoadU(f, gz + k), f, z + to);
      hn::StoreU(hn::ShiftLeft<2>(hn::Add(hn::Set(u, k), steps)), u, index + to);
      k += kStep;
      to += kStep;
    } while (k < end[r]);
    count += end[r] - begin[r];
  }
  // What a vector reads past the end is no neighbour.
  hn::StoreU(hn::Set(f, kNowhere), f, x + count);
  return count;
}

void SearchCells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t filler, ListBlock& out) {
  const F f;
  const U u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(F()));
  out.point.clear();
  out.first.clear();
  out.last.clear();
  const auto range2 = hn::Set(f, grid.range2);
  std::uint32_t used = 0;
  for (std::uint32_t cell = begin; cell < end; cell += kTile) {
    const std::uint32_t first = grid.start[cell], last = grid.start[cell + kTile];
    bool particles = false;
    for (std::uint32_t i = first; i < last; ++i) particles = particles || grid.image[i] == 0;
    if (!particles) continue;
    const std::uint32_t count = collect(grid, cell, out);
    const std::size_t room = used + std::size_t{last - first} * (count + kBatch) + 2 * kFloatRoom;
    if (out.neighbour.size() < room) out.neighbour.resize(room + room / 2);
    const float* HWY_RESTRICT near_x = out.near_x.data();
    const float* HWY_RESTRICT near_y = out.near_y.data();
    const float* HWY_RESTRICT near_z = out.near_z.data();
    const std::uint32_t* HWY_RESTRICT near_index = out.near_index.data();
    for (std::uint32_t i = first; i < last; ++i) {
      if (grid.image[i] != 0) continue;
      std::uint32_t* const list = out.neighbour.data() + used;
      std::uint32_t* HWY_RESTRICT to = list;
      const auto x = hn::Set(f, grid.x[i]), y = hn::Set(f, grid.y[i]), z = hn::Set(f, grid.z[i]);
      const auto own = hn::Set(u, 4 * i);
      for (std::uint32_t k = 0; k < count; k += kStep) {
        const auto dx = hn::Sub(hn::LoadU(f, near_x + k), x);
        const auto dy = hn::Sub(hn::LoadU(f, near_y + k), y);
        const auto dz = hn::Sub(hn::LoadU(f, near_z + k), z);
        const auto d2 = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
        const auto index = hn::LoadU(u, near_index + k);
        const auto near = hn::And(hn::Ne(index, own), hn::RebindMask(u, hn::Lt(d2, range2)));
        hn::StoreU(hn::Compress(index, near), u, to);
        to += hn::CountTrue(u, near);
      }
      // Whole batches: whatever stands after them is overwritten.
      const auto length = static_cast<std::uint32_t>(to - list);
      hn::StoreU(hn::Set(u, 4 * filler), u, to);
      out.point.push_back(i);
      out.first.push_back(used);
      constexpr auto kWhole = static_cast<std::uint32_t>(kBatch);
      used += (length + kWhole - 1) / kWhole * kWhole;
      out.last.push_back(used);
    }
  }
}

double LargestMove2(const double* HWY_RESTRICT now, const double* HWY_RESTRICT before, std::size_t points) {
  const D d;
  V largest = hn::Zero(d);
  std::size_t k = 0;
  for (; k + kLanes <= points; k += kLanes) {
    V x, y, z, x0, y0, z0;
    hn::LoadInterleaved3(d, now + 3 * k, x, y, z);
    hn::LoadInterleaved3(d, before + 3 * k, x0, y0, z0);
    largest = hn::Max(largest, squared({hn::Sub(x, x0), hn::Sub(y, y0), hn::Sub(z, z0)}));
  }
  double move2 = hn::GetLane(hn::MaxOfLanes(d, largest));
  for (; k < points; ++k) {
    const double x = now[3 * k] - before[3 * k], y = now[3 * k + 1] - before[3 * k + 1];
    const double z = now[3 * k + 2] - before[3 * k + 2];
    move2 = std::max(move2, std::fma(x, x, std::fma(y, y, z * z)));
  }
  return move2;
}

}  // namespace supple::core::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::core::packed {

HWY_EXPORT(SearchCells);
HWY_EXPORT(TwelveSixForces);
HWY_EXPORT(SurfaceLoads);
HWY_EXPORT(LargestMove2);

void search_cells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t filler, ListBlock& out) {
  HWY_DYNAMIC_DISPATCH(SearchCells)(grid, begin, end, filler, out);
}

void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                       const Row* position, Row* force) {
  HWY_DYNAMIC_DISPATCH(TwelveSixForces)(law, list, begin, end, position, force);
}

void surface_loads(const SurfaceNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                   std::uint32_t filler, const Row* position, const Row* normal, Row* force, Row* torque) {
  HWY_DYNAMIC_DISPATCH(SurfaceLoads)(law, list, begin, end, filler, position, normal, force, torque);
}

double largest_move2(const double* now, const double* before, std::size_t points) {
  return HWY_DYNAMIC_DISPATCH(LargestMove2)(now, before, points);
}

}  // namespace supple::core::packed
#endif  // HWY_ONCE
