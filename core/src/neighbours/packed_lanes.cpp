// AVX2 and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "neighbours/packed_lanes.h"

#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: false warnings in the headers of AVX-512.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "neighbours/packed_lanes.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/pack_lanes-inl.h"
#include "neighbours/packed_laws-inl.h"
#include "neighbours/packed_rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {
using supple::HWY_NAMESPACE::pack_lanes;

using F = hn::CappedTag<float, kFloatRoom>;
using U = hn::RebindToUnsigned<F>;

constexpr float kNowhere = 1e30F;  ///< a coordinate farther away than any range

void TwelveSixForces(const TwelveSixNumbers& given, const ListBlock& list, const Row* HWY_RESTRICT position,
                     Row* HWY_RESTRICT force) {
  struct Push {
    alignas(64) double x[kBatch], y[kBatch], z[kBatch];
  };
  constexpr std::size_t kNearBatches = 32;
  const D d;
  const TwelveSixNumbers law = given;
  const double* HWY_RESTRICT rows = &position->x;
  double* HWY_RESTRICT forces = &force->x;
  Push push[kNearBatches];
  for (std::size_t begin = 0; begin < list.batches; begin += kNearBatches) {
    const std::uint32_t* HWY_RESTRICT owner = list.owner.data() + begin;
    const std::uint32_t* HWY_RESTRICT neighbour = list.neighbour.data() + kBatch * begin;
    const std::size_t count = std::min(list.batches - begin, kNearBatches);
    for (std::size_t b = 0; b < count; ++b) {
      const Vector x = broadcast(rows + owner[b]);
      for (std::size_t k = 0; k < kBatch; k += kLanes) {
        const Vector r = minus(load_rows(rows, neighbour + kBatch * b + k), x);
        const V d2 = squared(r);
        const Vector f = scaled(twelve_six_slope(law, d2, hn::Div(set(1.0), d2)), r);
        hn::Store(f.x, d, push[b].x + k);
        hn::Store(f.y, d, push[b].y + k);
        hn::Store(f.z, d, push[b].z + k);
      }
    }
    for (std::size_t b = 0; b < count; ++b) {
      Vector f[kParts];
      for (std::size_t p = 0; p < kParts; ++p) {
        const std::size_t k = p * kLanes;
        f[p] = {hn::Load(d, push[b].x + k), hn::Load(d, push[b].y + k), hn::Load(d, push[b].z + k)};
      }
      const Rows out = rows_of(f);
      subtract_total(out, forces + owner[b]);
      add_rows(out, neighbour + kBatch * b, forces);
    }
  }
}

/// Vectors that are worked on in step: the results of one arrive while the others are begun.
constexpr std::size_t kChains = 4;
static_assert(kChains / kParts <= kSpareBatches + 1);
template <class Step>
HWY_INLINE void in_step(const Step& step) {
  for (std::size_t c = 0; c < kChains; ++c) step(c);
}

/// e^x for x <= 0; error about 2 ulp, below e^-700 that.
HWY_INLINE void exp_negative(V (&x)[kChains]) {
  const D d;
  const hn::RebindToSigned<D> whole;
  V n[kChains], shifted[kChains], r[kChains], r2[kChains], c0[kChains], c4[kChains], c8[kChains];
  // The sum with 3 2^51 rounds to a whole number and leaves it in the low bits.
  const V magic = set(0x1.8p52);
  in_step([&](std::size_t c) HWY_ATTR { x[c] = hn::Max(x[c], set(-700.0)); });
  in_step([&](std::size_t c) HWY_ATTR { shifted[c] = hn::MulAdd(x[c], set(0x1.71547652b82fep0), magic); });
  in_step([&](std::size_t c) HWY_ATTR { n[c] = hn::Sub(shifted[c], magic); });
  in_step([&](std::size_t c) HWY_ATTR { r[c] = hn::NegMulAdd(n[c], set(0x1.62e42fefa39efp-1), x[c]); });
  in_step([&](std::size_t c) HWY_ATTR { r[c] = hn::NegMulAdd(n[c], set(0x1.abc9e3b39803fp-56), r[c]); });
  // The series to r^12 / 12!: |r| < 0.35 leaves 2e-16.
  const auto four = [&](V (&out)[kChains], double k0, double k1, double k2, double k3) HWY_ATTR {
    V low[kChains], high[kChains];
    in_step([&](std::size_t c) HWY_ATTR { low[c] = hn::MulAdd(r[c], set(k1), set(k0)); });
    in_step([&](std::size_t c) HWY_ATTR { high[c] = hn::MulAdd(r[c], set(k3), set(k2)); });
    in_step([&](std::size_t c) HWY_ATTR { out[c] = hn::MulAdd(r2[c], high[c], low[c]); });
  };
  in_step([&](std::size_t c) HWY_ATTR { r2[c] = hn::Mul(r[c], r[c]); });
  four(c8, 1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800);
  in_step([&](std::size_t c) HWY_ATTR { x[c] = hn::Mul(r2[c], r2[c]); });
  in_step([&](std::size_t c) HWY_ATTR { c8[c] = hn::MulAdd(x[c], set(1.0 / 479001600), c8[c]); });
  four(c4, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040);
  in_step([&](std::size_t c) HWY_ATTR { c4[c] = hn::MulAdd(x[c], c8[c], c4[c]); });
  four(c0, 1.0, 1.0, 1.0 / 2, 1.0 / 6);
  in_step([&](std::size_t c) HWY_ATTR { c0[c] = hn::MulAdd(x[c], c4[c], c0[c]); });
  in_step([&](std::size_t c) HWY_ATTR {
    x[c] = hn::BitCast(d, hn::Add(hn::BitCast(whole, c0[c]), hn::ShiftLeft<52>(hn::BitCast(whole, shifted[c]))));
  });
}

/// Values of a batch. Short passes over some batches fill them: a processor works on several of them at once,
/// where one long pass would wait for its own results.
struct Near {
  alignas(64) double x[kBatch], y[kBatch], z[kBatch];  ///< r
  double d[kBatch];                                    ///< its length
  double pull[kBatch];                                 ///< slope of cohesion times d
  double mx[kBatch], my[kBatch], mz[kBatch];           ///< n_j
  double g[kBatch], u_a[kBatch], u_b[kBatch], u_c[kBatch];

  [[nodiscard]] HWY_INLINE Vector r(std::size_t k) const {
    return {hn::Load(D(), x + k), hn::Load(D(), y + k), hn::Load(D(), z + k)};
  }
  [[nodiscard]] HWY_INLINE Vector m(std::size_t k) const {
    return {hn::Load(D(), mx + k), hn::Load(D(), my + k), hn::Load(D(), mz + k)};
  }
};
constexpr std::size_t kNear = 16;  ///< batches that stay in the first cache, twice

HWY_INLINE void place_batch(std::uint32_t owner, const std::uint32_t* HWY_RESTRICT j, const double* HWY_RESTRICT rows,
                            Near& near) {
  const D d;
  const Vector x = broadcast(rows + owner);
  for (std::size_t k = 0; k < kBatch; k += kLanes) {
    const Vector r = minus(load_rows(rows, j + k), x);
    hn::Store(r.x, d, near.x + k);
    hn::Store(r.y, d, near.y + k);
    hn::Store(r.z, d, near.z + k);
    hn::Store(hn::Sqrt(squared(r)), d, near.d + k);
  }
}

/// The slope of cohesion times d is F0 r0 v^3 exp(-a v^2), v = d / r0 - 1.
HWY_INLINE void evaluate_cohesion(const SurfaceNumbers& law, Near* HWY_RESTRICT near) {
  const D d;
  V gain[kChains], bell[kChains];
  in_step([&](std::size_t c) HWY_ATTR {
    const V length = hn::Load(d, near[c / kParts].d + c % kParts * kLanes);
    const V v = hn::MulSub(length, set(law.inverse_r0), set(1.0));
    const V v2 = hn::Mul(v, v);
    bell[c] = hn::Mul(set(-law.a), v2);
    gain[c] = hn::IfThenElseZero(hn::Lt(length, set(law.range)), hn::Mul(hn::Mul(v2, v), set(law.cohesion)));
  });
  exp_negative(bell);
  in_step([&](std::size_t c) HWY_ATTR {
    hn::Store(hn::Mul(gain[c], bell[c]), d, near[c / kParts].pull + c % kParts * kLanes);
  });
}

HWY_INLINE void evaluate_gains(const SurfaceNumbers& law, std::size_t k, const Vector& n, const Vector& m, Near& near) {
  const D d;
  const SurfaceGains<V> gains = surface_gains(law, near.r(k), n, m, hn::Load(d, near.pull + k));
  hn::Store(m.x, d, near.mx + k);
  hn::Store(m.y, d, near.my + k);
  hn::Store(m.z, d, near.mz + k);
  hn::Store(gains.g, d, near.g + k);
  hn::Store(gains.u_a, d, near.u_a + k);
  hn::Store(gains.u_b, d, near.u_b + k);
  hn::Store(gains.u_c, d, near.u_c + k);
}

HWY_INLINE void add_surface_loads(std::uint32_t i, const std::uint32_t* HWY_RESTRICT j, const Near& near,
                                  const double* HWY_RESTRICT normals, double* HWY_RESTRICT forces,
                                  double* HWY_RESTRICT turns) {
  const D d;
  const Vector n = broadcast(normals + i);
  Vector push[kParts], turn_i[kParts], turn_j[kParts];
  for (std::size_t p = 0; p < kParts; ++p) {
    const std::size_t k = p * kLanes;
    const Vector r = near.r(k), m = near.m(k);
    const V u_a = hn::Load(d, near.u_a + k), u_b = hn::Load(d, near.u_b + k), u_c = hn::Load(d, near.u_c + k);
    push[p] = scaled_sum(u_b, m, scaled_sum(u_a, n, scaled(hn::Load(d, near.g + k), r)));
    turn_i[p] = scaled_sum(u_c, m, scaled(u_a, r));
    turn_j[p] = scaled_sum(u_c, n, scaled(u_b, r));
  }
  const Rows gradient = rows_of(push);
  add_total(gradient, forces + i);
  subtract_rows(gradient, j, forces);
  add_total(rows_of(turn_i), turns + i);
  add_rows(rows_of(turn_j), j, turns);
}

void SurfaceLoads(const SurfaceNumbers& given, const ListBlock& list, const Row* HWY_RESTRICT position,
                  const Row* HWY_RESTRICT normal, Row* HWY_RESTRICT force, Row* HWY_RESTRICT turn) {
  const SurfaceNumbers law = given;
  const double* HWY_RESTRICT rows = &position->x;
  const double* HWY_RESTRICT normals = &normal->x;
  double* HWY_RESTRICT forces = &force->x;
  double* HWY_RESTRICT turns = &turn->x;
  const std::size_t batches = list.batches;
  Near buffer[2][kNear];
  Near* HWY_RESTRICT now = buffer[0];
  Near* HWY_RESTRICT next = buffer[1];
  std::size_t count = std::min(batches, kNear);
  for (std::size_t b = 0; b < count; ++b) {
    place_batch(list.owner[b], list.neighbour.data() + kBatch * b, rows, now[b]);
  }
  for (std::size_t begin = 0; begin < batches; begin += kNear) {
    const std::uint32_t* HWY_RESTRICT owner = list.owner.data() + begin;
    const std::uint32_t* HWY_RESTRICT neighbour = list.neighbour.data() + kBatch * begin;
    // After the last batch the memory holds old lengths or zeros.
    for (std::size_t b = 0; b < count; b += kChains / kParts) evaluate_cohesion(law, now + b);
    for (std::size_t b = 0; b < count; ++b) {
      const Vector n = broadcast(normals + owner[b]);
      for (std::size_t k = 0; k < kBatch; k += kLanes) {
        evaluate_gains(law, k, n, load_rows(normals, neighbour + kBatch * b + k), now[b]);
      }
    }
    // Square roots of the next batches are taken while loads are added.
    const std::size_t coming = std::min(batches - begin - count, kNear);
    for (std::size_t b = 0; b < count; ++b) {
      add_surface_loads(owner[b], neighbour + kBatch * b, now[b], normals, forces, turns);
      if (b < coming) place_batch(owner[kNear + b], neighbour + kBatch * (kNear + b), rows, next[b]);
    }
    std::swap(now, next);
    count = coming;
  }
}

/// Copies the points that the particles of the tile that begins at `cell` may have in their lists: those from the
/// tile upwards in its own column, then those of the columns behind. @return how many
HWY_INLINE std::uint32_t collect(const CellGrid& grid, std::uint32_t cell, ListBlock& out) {
  const F f;
  const U u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(F()));
  const std::uint32_t ny = grid.cells[1], nz = grid.cells[2];
  std::array<std::uint32_t, 1 + kReach + kReach * (2 * kReach + 1)> begin, end;
  std::uint32_t room = 2 * kFloatRoom;
  std::size_t rows = 0;
  const auto take = [&](std::uint32_t from, std::uint32_t row) {
    begin[rows] = grid.start[from];
    end[rows] = grid.start[row + kTile + kReachUp];
    room += end[rows] - begin[rows];
    ++rows;
  };
  take(cell, cell);
  const auto take_row = [&](std::uint32_t row) { take(row - kReachUp, row); };
  for (std::uint32_t dy = 1; dy <= kReach; ++dy) take_row(cell + dy * nz);
  for (std::uint32_t dx = 1; dx <= kReach; ++dx) {
    for (std::uint32_t dy = 0; dy <= 2 * kReach; ++dy) take_row(cell + (dx * ny + dy - kReach) * nz);
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
  // Lanes past the end are no neighbours.
  hn::StoreU(hn::Set(f, kNowhere), f, x + count);
  return count;
}

/// Appends the lists of the particles of a tile.
HWY_INLINE void search_tile(const CellGrid& grid, std::uint32_t cell, ListBlock& out) {
  const F f;
  const U u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(F()));
  constexpr auto kWhole = static_cast<std::uint32_t>(kBatch);
  const std::uint32_t first = grid.start[cell], last = grid.start[cell + kTile];
  bool particles = false;
  for (std::uint32_t i = first; i < last; ++i) particles = particles || grid.image[i] == 0;
  if (!particles) return;
  const std::uint32_t count = collect(grid, cell, out);
  const std::size_t room = out.batches + std::size_t{last - first} * (count / kWhole + 1);
  if (out.owner.size() < room + kFloatRoom) {
    out.owner.resize(room + room / 2 + kFloatRoom);
    out.neighbour.resize(kWhole * out.owner.size());
  }
  const auto range2 = hn::Set(f, grid.range2);
  const auto filler = hn::Set(u, out.filler);
  const float* HWY_RESTRICT near_x = out.near_x.data();
  const float* HWY_RESTRICT near_y = out.near_y.data();
  const float* HWY_RESTRICT near_z = out.near_z.data();
  const std::uint32_t* HWY_RESTRICT near_index = out.near_index.data();
  for (std::uint32_t i = first; i < last; ++i) {
    if (grid.image[i] != 0) continue;
    std::uint32_t* const list = out.neighbour.data() + kWhole * out.batches;
    std::uint32_t* HWY_RESTRICT to = list;
    const auto x = hn::Set(f, grid.x[i]), y = hn::Set(f, grid.y[i]), z = hn::Set(f, grid.z[i]);
    for (std::uint32_t k = i + 1 - first; k < count; k += kStep) {
      const auto dx = hn::Sub(hn::LoadU(f, near_x + k), x);
      const auto dy = hn::Sub(hn::LoadU(f, near_y + k), y);
      const auto dz = hn::Sub(hn::LoadU(f, near_z + k), z);
      const auto d2 = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
      const auto near = hn::RebindMask(u, hn::Lt(d2, range2));
      hn::StoreU(pack_lanes(hn::LoadU(u, near_index + k), near), u, to);
      to += hn::CountTrue(u, near);
    }
    // Whole batches: values after them are overwritten.
    hn::StoreU(filler, u, to);
    const auto batches = (static_cast<std::uint32_t>(to - list) + kWhole - 1) / kWhole;
    for (std::uint32_t b = 0; b < batches; b += kStep) {
      hn::StoreU(hn::Set(u, 4 * i), u, out.owner.data() + out.batches + b);
    }
    out.batches += batches;
  }
}

void SearchCells(const CellGrid& grid, const CellBlock& cells, ListBlock& out) {
  out.batches = 0;
  for (std::uint32_t z = cells.lowest; z < cells.highest; z += kTile) {
    for (std::uint32_t y = cells.begin[1]; y < cells.end[1]; ++y) {
      for (std::uint32_t x = cells.begin[0]; x < cells.end[0]; ++x) {
        search_tile(grid, (x * grid.cells[1] + y) * grid.cells[2] + z, out);
      }
    }
  }
  // Loops work on several batches at once and may read some past the last.
  out.owner.resize(std::max(out.owner.size(), out.batches + kFloatRoom));
  out.neighbour.resize(std::max(out.neighbour.size(), kBatch * (out.batches + kSpareBatches)));
  for (std::size_t b = out.batches; b < out.batches + kSpareBatches; ++b) {
    out.owner[b] = out.filler;
    std::fill_n(out.neighbour.begin() + static_cast<std::ptrdiff_t>(kBatch * b), kBatch, out.filler);
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
    largest = hn::Max(largest, squared(Vector{hn::Sub(x, x0), hn::Sub(y, y0), hn::Sub(z, z0)}));
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

void search_cells(const CellGrid& grid, const CellBlock& cells, ListBlock& out) {
  HWY_DYNAMIC_DISPATCH(SearchCells)(grid, cells, out);
}

void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, const Row* position, Row* force) {
  HWY_DYNAMIC_DISPATCH(TwelveSixForces)(law, list, position, force);
}

void surface_loads(const SurfaceNumbers& law, const ListBlock& list, const Row* position, const Row* normal,
                   Row* force, Row* turn) {
  HWY_DYNAMIC_DISPATCH(SurfaceLoads)(law, list, position, normal, force, turn);
}

double largest_move2(const double* now, const double* before, std::size_t points) {
  return HWY_DYNAMIC_DISPATCH(LargestMove2)(now, before, points);
}

}  // namespace supple::core::packed
#endif  // HWY_ONCE
