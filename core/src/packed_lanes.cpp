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

/// Calls use(r, d^2, 1 / d^2, part) for all vectors of neighbours of particle k.
template <class Use>
HWY_INLINE void for_neighbours(const ListBlock& list, std::size_t k, const Row* HWY_RESTRICT position, const Use& use) {
  const double* HWY_RESTRICT rows = &position->x;
  const Vector x = broadcast(position[list.point[k]]);
  const std::uint32_t* HWY_RESTRICT j = list.neighbour.data() + list.first[k];
  const std::uint32_t* const end = list.neighbour.data() + list.last[k];
  const V one = set(1.0);
  // Two batches share a division.
  for (; j + kBatch < end; j += 2 * kBatch) {
    for (std::size_t p = 0; p < kParts; ++p) {
      const std::uint32_t* const ja = j + p * kLanes;
      const std::uint32_t* const jb = ja + kBatch;
      const Vector a = minus(load_rows(rows, ja), x);
      const Vector b = minus(load_rows(rows, jb), x);
      const V a2 = squared(a), b2 = squared(b);
      const V inverse = hn::Div(one, hn::Mul(a2, b2));
      use(ja, a, a2, hn::Mul(inverse, b2), p);
      use(jb, b, b2, hn::Mul(inverse, a2), p);
    }
  }
  if (j < end) {
    for (std::size_t p = 0; p < kParts; ++p) {
      const std::uint32_t* const ja = j + p * kLanes;
      const Vector a = minus(load_rows(rows, ja), x);
      const V a2 = squared(a);
      use(ja, a, a2, hn::Div(one, a2), p);
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
                   [&](const std::uint32_t*, const Vector& r, V d2, V inverse, std::size_t p) HWY_ATTR {
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

/// With a = n_i . r, b = n_j . r, c = n_i . n_j the energy of a pair is
/// U_c(d) + psi E, E = k_f (kappa^2 + 2 w / d^2) + k_p (a^2 + b^2) + k_c (a + b)^2 + 2 k_n (1 - c),
/// w = kappa (a - b) + 1 - c, so that dU/dr = G r + U_a n_i + U_b n_j and dU/dn_i = U_a r + U_c n_j.
void SurfaceLoads(const SurfaceNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                  const Row* HWY_RESTRICT position, const Row* HWY_RESTRICT normal, Row* HWY_RESTRICT force,
                  Row* HWY_RESTRICT torque) {
  const V one = set(1.0);
  const double* HWY_RESTRICT normals = &normal->x;
  for (std::size_t k = begin; k < end; ++k) {
    const Row& own = normal[list.point[k]];
    const Vector n = broadcast(own);
    Sums pull, turn;
    clear(pull);
    clear(turn);
    for_neighbours(list, k, position,
                   [&](const std::uint32_t* j, const Vector& r, V d2, V inverse, std::size_t p) HWY_ATTR {
      const Vector m = load_rows(normals, j);
      const V a = dot(n, r), b = dot(m, r), unlike = hn::Sub(one, dot(n, m));
      const V v = hn::MulSub(hn::Sqrt(d2), set(law.inverse_r0), one);
      const V v2 = hn::Mul(v, v);
      const V well = hn::Mul(hn::Mul(hn::Mul(v2, v), exp_negative(hn::Mul(set(-law.a), v2))),
                             hn::Mul(set(law.cohesion), inverse));
      const V rest = hn::Max(hn::NegMulAdd(d2, set(law.inverse_h2), one), hn::Zero(D()));
      const V rest2 = hn::Mul(rest, rest);
      const V psi2 = hn::Mul(rest2, hn::Add(rest, rest));
      const V form = hn::Mul(set(law.form), inverse);
      const V bend = hn::Mul(set(law.curvature), form);
      const V both = hn::Add(a, b);
      const V circle = hn::Mul(set(law.cocircularity), both);
      const V w = hn::MulAdd(set(law.curvature), hn::Sub(a, b), unlike);
      const V half = hn::Mul(form, w);
      const V twice = hn::Add(half, half);
      V e = hn::Add(twice, set(law.form_offset));
      e = hn::MulAdd(set(law.coplanarity), hn::MulAdd(a, a, hn::Mul(b, b)), e);
      e = hn::MulAdd(circle, both, e);
      e = hn::MulAdd(set(law.conormality2), unlike, e);
      V g = hn::IfThenElseZero(hn::Lt(d2, set(law.range2)), well);
      g = hn::MulAdd(hn::Mul(rest2, set(law.slope)), e, g);
      g = hn::NegMulAdd(psi2, hn::Mul(twice, inverse), g);
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
    });
    const Row f = total(pull), t = total(turn);
    force[k - begin] = {f.x + f.w * own.x, f.y + f.w * own.y, f.z + f.w * own.z, 0.0};
    torque[k - begin] = {own.z * t.y - own.y * t.z, own.x * t.z - own.z * t.x, own.y * t.x - own.x * t.y, 0.0};
  }
}

/// Points after each other that may be near those of a cell.
struct Run {
  std::uint32_t begin, end;
};

/// Puts particles with lists of equal length after each other, so that the ends of loops can be foretold. Groups are
/// small: neighbours of neighbouring particles are still in the cache.
void order_by_length(ListBlock& out) {
  constexpr std::size_t kGroup = 64;
  constexpr std::uint32_t kLengths = 32;
  const std::size_t n = out.point.size();
  std::array<std::uint32_t, kGroup> point, first, last;
  for (std::size_t begin = 0; begin < n; begin += kGroup) {
    const std::size_t count = std::min(kGroup, n - begin);
    std::array<std::uint32_t, kLengths + 1> start{};
    const auto length = [&](std::size_t k) {
      return std::min<std::uint32_t>((out.last[begin + k] - out.first[begin + k]) / kBatch, kLengths - 1);
    };
    for (std::size_t k = 0; k < count; ++k) ++start[length(k) + 1];
    for (std::size_t l = 0; l < kLengths; ++l) start[l + 1] += start[l];
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint32_t to = start[length(k)]++;
      point[to] = out.point[begin + k];
      first[to] = out.first[begin + k];
      last[to] = out.last[begin + k];
    }
    std::copy_n(point.begin(), count, out.point.begin() + static_cast<std::ptrdiff_t>(begin));
    std::copy_n(first.begin(), count, out.first.begin() + static_cast<std::ptrdiff_t>(begin));
    std::copy_n(last.begin(), count, out.last.begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

void SearchCells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t filler, ListBlock& out) {
  const F f;
  const U u;
  constexpr std::uint32_t kStep = hn::MaxLanes(F());
  out.point.clear();
  out.first.clear();
  out.last.clear();
  std::array<Run, (2 * kReach + 1) * (2 * kReach + 1)> run;
  const auto range2 = hn::Set(f, grid.range2);
  const auto steps = hn::Iota(u, 0);
  const float* HWY_RESTRICT gx = grid.x.data();
  const float* HWY_RESTRICT gy = grid.y.data();
  const float* HWY_RESTRICT gz = grid.z.data();
  const int ny = static_cast<int>(grid.cells[1]), nz = static_cast<int>(grid.cells[2]);
  std::uint32_t used = 0;
  for (std::uint32_t cell = begin; cell < end; ++cell) {
    const std::uint32_t first = grid.start[cell], last = grid.start[cell + 1];
    bool empty = true;
    for (std::uint32_t i = first; i < last; ++i) empty = empty && grid.image[i] != 0;
    if (empty) continue;
    std::size_t runs = 0;
    std::uint32_t most = 0;
    for (int dx = -kReach; dx <= kReach; ++dx) {
      for (int dy = -kReach; dy <= kReach; ++dy) {
        const std::uint32_t row = cell + static_cast<std::uint32_t>((dx * ny + dy) * nz);
        run[runs] = {grid.start[row - kReachUp], grid.start[row + kReachUp + 1]};
        most += run[runs].end - run[runs].begin;
        ++runs;
      }
    }
    for (std::uint32_t i = first; i < last; ++i) {
      if (grid.image[i] != 0) continue;
      if (out.neighbour.size() < used + most + 2 * kFloatRoom) {
        out.neighbour.resize(2 * out.neighbour.size() + most + 2 * kFloatRoom);
      }
      std::uint32_t* const list = out.neighbour.data() + used;
      std::uint32_t* to = list;
      const auto x = hn::Set(f, gx[i]), y = hn::Set(f, gy[i]), z = hn::Set(f, gz[i]);
      const auto self = hn::Set(u, 4 * i);
      for (std::size_t r = 0; r < runs; ++r) {
        for (std::uint32_t k = run[r].begin; k < run[r].end; k += kStep) {
          const auto dx = hn::Sub(hn::LoadU(f, gx + k), x);
          const auto dy = hn::Sub(hn::LoadU(f, gy + k), y);
          const auto dz = hn::Sub(hn::LoadU(f, gz + k), z);
          const auto d2 = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
          const auto index = hn::ShiftLeft<2>(hn::Add(hn::Set(u, k), steps));
          // Past the end of a run lie points of cells farther up, which are met here or are out of range.
          const auto inside = hn::Lt(index, hn::Set(u, 4 * run[r].end));
          const auto near = hn::And(hn::And(hn::RebindMask(u, hn::Lt(d2, range2)), inside), hn::Ne(index, self));
          hn::StoreU(hn::Compress(index, near), u, to);
          to += hn::CountTrue(u, near);
        }
      }
      while ((to - list) % static_cast<std::ptrdiff_t>(kBatch) != 0) *to++ = 4 * filler;
      out.point.push_back(i);
      out.first.push_back(used);
      used += static_cast<std::uint32_t>(to - list);
      out.last.push_back(used);
    }
  }
  order_by_length(out);
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
                   const Row* position, const Row* normal, Row* force, Row* torque) {
  HWY_DYNAMIC_DISPATCH(SurfaceLoads)(law, list, begin, end, position, normal, force, torque);
}

double largest_move2(const double* now, const double* before, std::size_t points) {
  return HWY_DYNAMIC_DISPATCH(LargestMove2)(now, before, points);
}

}  // namespace supple::core::packed
#endif  // HWY_ONCE
