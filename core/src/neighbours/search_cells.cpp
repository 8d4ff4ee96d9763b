// AVX2 and AVX-512 variants only; AES support must not decide which variant a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "neighbours/search_cells.h"

#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: false warnings in the headers of AVX-512.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "neighbours/search_cells.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/pack_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using supple::HWY_NAMESPACE::pack_lanes;

using D = hn::CappedTag<double, 8>;
using HalfF = hn::Rebind<float, D>;
using HalfU = hn::Rebind<std::uint32_t, D>;
using F = hn::CappedTag<float, kVectorRoom>;
using U = hn::RebindToUnsigned<F>;

constexpr float kNowhere = 1e30F;  ///< a coordinate farther away than any reach, in reaches
/// Points this near the first of a tile in every coordinate are searched with it [reach]: all of a tile, but those that
/// are whole boxes apart.
constexpr double kTogether = 2.0;
/// Coordinates of near points are at most 3 reaches, rounded to 2^-24 of that: a distance is known to 2^-20 of a reach.
constexpr float kReach2 = 1.0F + 0x1p-18F;

/// Copies the points that those of a tile may have near them, with coordinates relative to a point, in reaches.
/// @return how many
HWY_INLINE std::uint32_t collect(const CellGrid& grid, std::uint32_t tile, const double* base, NearLists& out) {
  const D d;
  const HalfF f;
  const HalfU u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(D()));
  const std::uint32_t nx = grid.cells[0], ny = grid.cells[1], nz = grid.cells[2];
  const std::uint32_t column = tile * kTile / nz, z = tile * kTile % nz;
  const std::uint32_t x = column / ny, y = column % ny;
  constexpr std::uint32_t kSpan = 2 * kCellsInReach + 1, kSpanUp = kTile + 2 * kCellsInReachUp;
  std::array<std::uint32_t, 2 * kSpan * kSpan> begin, end;
  std::uint32_t room = 2 * kVectorRoom;
  std::size_t rows = 0;
  const auto take = [&](std::uint32_t from, std::uint32_t to) HWY_ATTR {
    begin[rows] = grid.start[from];
    end[rows] = grid.start[to];
    room += end[rows] - begin[rows];
    ++rows;
  };
  const std::uint32_t bottom = (z + nz - kCellsInReachUp) % nz;
  for (std::uint32_t dx = 0; dx < kSpan; ++dx) {
    for (std::uint32_t dy = 0; dy < kSpan; ++dy) {
      const std::uint32_t cx = (x + dx + nx - kCellsInReach) % nx, cy = (y + dy + ny - kCellsInReach) % ny;
      const std::uint32_t row = (cx * ny + cy) * nz;
      if (bottom + kSpanUp <= nz) {
        take(row + bottom, row + bottom + kSpanUp);
      } else {
        take(row + bottom, row + nz);
        take(row, row + bottom + kSpanUp - nz);
      }
    }
  }
  if (out.index.size() < room) {
    for (std::vector<float>* v : {&out.x, &out.y, &out.z}) v->resize(room + room / 2);
    out.index.resize(room + room / 2);
  }
  const double* HWY_RESTRICT gx = grid.x.data();
  const double* HWY_RESTRICT gy = grid.y.data();
  const double* HWY_RESTRICT gz = grid.z.data();
  const std::uint32_t* HWY_RESTRICT gi = grid.index.data();
  float* HWY_RESTRICT to_x = out.x.data();
  float* HWY_RESTRICT to_y = out.y.data();
  float* HWY_RESTRICT to_z = out.z.data();
  std::uint32_t* HWY_RESTRICT to_index = out.index.data();
  const auto inverse = hn::Set(d, 1.0 / grid.reach);
  const auto bx = hn::Set(d, base[0]), by = hn::Set(d, base[1]), bz = hn::Set(d, base[2]);
  const auto limit = hn::Set(d, static_cast<double>(kNowhere));
  const auto relative = [&](const double* from, hn::Vec<D> origin) HWY_ATTR {
    const auto r = hn::Mul(hn::Sub(hn::LoadU(d, from), origin), inverse);
    return hn::DemoteTo(f, hn::Min(hn::Max(r, hn::Neg(limit)), limit));
  };
  std::uint32_t count = 0;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::uint32_t k = begin[r], to = count; k < end[r]; k += kStep, to += kStep) {
      hn::StoreU(relative(gx + k, bx), f, to_x + to);
      hn::StoreU(relative(gy + k, by), f, to_y + to);
      hn::StoreU(relative(gz + k, bz), f, to_z + to);
      hn::StoreU(hn::LoadU(u, gi + k), u, to_index + to);
    }
    count += end[r] - begin[r];
  }
  // What a vector reads past the end is no neighbour.
  hn::StoreU(hn::Set(F(), kNowhere), F(), to_x + count);
  return count;
}

/// Appends the list of one point at x, relative to the same point as what is collected.
HWY_INLINE void scan(std::uint32_t index, const float (&at)[3], std::uint32_t count, NearLists& out) {
  const F f;
  const U u;
  constexpr auto kStep = static_cast<std::uint32_t>(hn::MaxLanes(F()));
  const std::size_t room = out.size + count + kVectorRoom;
  if (out.near.size() < room) out.near.resize(room + room / 2);
  std::uint32_t* const list = out.near.data() + out.size;
  std::uint32_t* HWY_RESTRICT to = list;
  const float* HWY_RESTRICT near_x = out.x.data();
  const float* HWY_RESTRICT near_y = out.y.data();
  const float* HWY_RESTRICT near_z = out.z.data();
  const std::uint32_t* HWY_RESTRICT near_index = out.index.data();
  const auto x = hn::Set(f, at[0]), y = hn::Set(f, at[1]), z = hn::Set(f, at[2]), reach2 = hn::Set(f, kReach2);
  const auto own = hn::Set(u, index);
  for (std::uint32_t k = 0; k < count; k += kStep) {
    const auto dx = hn::Sub(hn::LoadU(f, near_x + k), x);
    const auto dy = hn::Sub(hn::LoadU(f, near_y + k), y);
    const auto dz = hn::Sub(hn::LoadU(f, near_z + k), z);
    const auto d2 = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
    const auto j = hn::LoadU(u, near_index + k);
    const auto near = hn::AndNot(hn::Eq(j, own), hn::RebindMask(u, hn::Lt(d2, reach2)));
    hn::StoreU(pack_lanes(j, near), u, to);
    to += hn::CountTrue(u, near);
  }
  const auto found = static_cast<std::uint32_t>(to - list);
  out.owner.push_back({.index = index, .count = found, .begin = out.size});
  out.size += found;
  out.distances += count;
}

HWY_INLINE void search_tile(const CellGrid& grid, std::uint32_t tile, std::uint32_t stride, NearLists& out) {
  out.waiting.clear();
  for (std::uint32_t k = grid.start[tile * kTile]; k < grid.start[(tile + 1) * kTile]; ++k) {
    if (stride == 1 || grid.index[k] % stride == 0) out.waiting.push_back(k);
  }
  while (!out.waiting.empty()) {
    const std::uint32_t first = out.waiting[0];
    const double base[3] = {grid.x[first], grid.y[first], grid.z[first]};
    const std::uint32_t count = collect(grid, tile, base, out);
    std::size_t left = 0;
    for (const std::uint32_t k : out.waiting) {
      const double x = (grid.x[k] - base[0]) / grid.reach, y = (grid.y[k] - base[1]) / grid.reach;
      const double z = (grid.z[k] - base[2]) / grid.reach;
      if (std::max({std::abs(x), std::abs(y), std::abs(z)}) > kTogether) {
        out.waiting[left++] = k;
        continue;
      }
      scan(grid.index[k], {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)}, count, out);
    }
    out.waiting.resize(left);
  }
}

void SearchCells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t stride, NearLists& out) {
  for (std::uint32_t tile = begin; tile < end; ++tile) {
    if (grid.start[tile * kTile] < grid.start[(tile + 1) * kTile]) search_tile(grid, tile, stride, out);
  }
}

}  // namespace supple::core::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::core {

HWY_EXPORT(SearchCells);

void search_cells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t stride, NearLists& out) {
  HWY_DYNAMIC_DISPATCH(SearchCells)(grid, begin, end, stride, out);
}

}  // namespace supple::core
#endif  // HWY_ONCE
