// Baseline and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "mesh/blob_lanes.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mesh/blob_lanes.cpp"  // NOLINT
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

/// The sum of a few lanes, in an order that does not depend on the width.
HWY_INLINE float sum_of_lanes(const float* lane) {
  float sum[kLanes / 2];
  for (std::size_t i = 0; i < kLanes / 2; ++i) sum[i] = lane[i] + lane[i + kLanes / 2];
  for (std::size_t n = kLanes / 4; n > 0; n /= 2) {
    for (std::size_t i = 0; i < n; ++i) sum[i] += sum[i + n];
  }
  return sum[0];
}

/// Centres are near a cube within half their radius, squared and relative.
constexpr float kNear2 = 0.25F;

/// Eight or sixteen blobs, as in a BlobList.
struct BlobLanes {
  V scale, x, y, z;
};
/// Centre and half edge of a cube [cells].
struct CubeLanes {
  V x, y, z, half;
};

/// Distances of blobs to a cube, scaled by their radius.
struct Distances {
  V near2, far2;
};
HWY_INLINE Distances distances(const BlobLanes& b, const CubeLanes& cube) {
  const D d;
  const V reach = hn::Mul(b.scale, cube.half);
  const V dx = hn::Abs(hn::MulSub(b.scale, cube.x, b.x)), dy = hn::Abs(hn::MulSub(b.scale, cube.y, b.y)),
          dz = hn::Abs(hn::MulSub(b.scale, cube.z, b.z));
  const auto near = [&](V v) HWY_ATTR { return hn::Max(hn::Sub(v, reach), hn::Zero(d)); };
  const V nx = near(dx), ny = near(dy), nz = near(dz);
  const V fx = hn::Add(dx, reach), fy = hn::Add(dy, reach), fz = hn::Add(dz, reach);
  return {hn::MulAdd(nz, nz, hn::MulAdd(ny, ny, hn::Mul(nx, nx))),
          hn::MulAdd(fz, fz, hn::MulAdd(fy, fy, hn::Mul(fx, fx)))};
}

/// Round-off bounds of the sums and of the evaluation of single points.
HWY_INLINE float round_off(std::size_t count, float size) {
  return (4e-6F + 1e-7F * static_cast<float>(count)) * (1.0F + size);
}

HWY_INLINE V cube(V t) { return hn::Mul(t, hn::Mul(t, t)); }

/// Writes those marked behind the first `count` of a list. @return how many they are now
HWY_INLINE std::size_t append(const BlobLanes& b, hn::Mask<D> keep, BlobList& list, std::size_t count) {
  const D d;
  hn::StoreU(pack_lanes(b.scale, keep), d, list.scale.data() + count);
  hn::StoreU(pack_lanes(b.x, keep), d, list.x.data() + count);
  hn::StoreU(pack_lanes(b.y, keep), d, list.y.data() + count);
  hn::StoreU(pack_lanes(b.z, keep), d, list.z.data() + count);
  return count + hn::CountTrue(d, keep);
}

/// Puts a list behind the first `count` of another.
HWY_INLINE void append_far(const BlobList& far, std::size_t far_count, BlobList& list, std::size_t count) {
  const D d;
  for (std::size_t i = 0; i < far_count; i += kWidth) {
    const auto move = [&](const std::vector<float>& out, std::vector<float>& in) HWY_ATTR {
      hn::StoreU(hn::LoadU(d, out.data() + i), d, in.data() + count + i);
    };
    move(far.scale, list.scale);
    move(far.x, list.x);
    move(far.y, list.y);
    move(far.z, list.z);
  }
  list.near = count;
  list.count = count + far_count;
  list.pad();
}

/// A list while blobs near a cube are put into it, those near it first where `far` is not null.
class Gathered {
 public:
  Gathered(std::size_t most, BlobList& list, BlobList* far) : list_(list), far_(far) {
    list.reserve(most);
    if (far != nullptr) far->reserve(most);
  }
  /// The first `valid` lanes, those whose support may meet the cube.
  HWY_INLINE void add(const BlobLanes& b, V near2, std::size_t valid) {
    const D d;
    auto keep = hn::Lt(near2, hn::Set(d, kReach2));
    if (valid < kWidth) keep = hn::And(keep, hn::FirstN(d, valid));
    if (far_ == nullptr) {
      count_ = append(b, keep, list_, count_);
      return;
    }
    const auto near = hn::Lt(near2, hn::Set(d, kNear2));
    count_ = append(b, hn::And(near, keep), list_, count_);
    far_count_ = append(b, hn::AndNot(near, keep), *far_, far_count_);
  }
  HWY_INLINE void finish() {
    if (far_ != nullptr) {
      append_far(*far_, far_count_, list_, count_);
      return;
    }
    list_.near = list_.count = count_;
    list_.pad();
  }

 private:
  BlobList& list_;
  BlobList* far_;
  std::size_t count_ = 0, far_count_ = 0;
};

/// Centres along one axis from `origin` on, scaled; loaded and subtracted in double precision.
HWY_INLINE V scaled(const double* from, double origin, V s) {
  const D d;
  const hn::Half<D> dh;
  const hn::Rebind<double, decltype(dh)> dd;
  const auto low = hn::Sub(hn::LoadU(dd, from), hn::Set(dd, origin));
  const auto high = hn::Sub(hn::LoadU(dd, from + kWidth / 2), hn::Set(dd, origin));
  const auto low_scale = hn::PromoteTo(dd, hn::LowerHalf(dh, s)), high_scale = hn::PromoteTo(dd, hn::UpperHalf(dh, s));
  return hn::Combine(d, hn::DemoteTo(dh, hn::Mul(high, high_scale)), hn::DemoteTo(dh, hn::Mul(low, low_scale)));
}

void Gather(const BlobArrays& all, std::span<const BlobRun> runs, const CubeAround& cube, BlobList& list, BlobList* far) {
  const D d;
  std::size_t most = 0;
  for (const BlobRun& run : runs) most += run.end - run.begin;
  Gathered gathered(most, list, far);
  const V centre = hn::Set(d, static_cast<float>(0.5 * cube.size)), half = hn::Set(d, static_cast<float>(0.5 * cube.size + cube.margin));
  for (const BlobRun& run : runs) {
    for (std::size_t i = run.begin; i < run.end; i += kWidth) {
      const V s = hn::LoadU(d, all.scale + i);
      const BlobLanes b{s, scaled(all.x + i, cube.base[0], s), scaled(all.y + i, cube.base[1], s), scaled(all.z + i, cube.base[2], s)};
      gathered.add(b, distances(b, {centre, centre, centre, half}).near2, run.end - i);
    }
  }
  gathered.finish();
}

void GatherColumn(const BlobArrays& all, std::span<const BlobRun> runs, std::span<const std::uint32_t> layer,
                  const std::array<double, 2>& base, double size, BlobColumn& column) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  std::size_t most = 2 * kLanes;
  for (const BlobRun& run : runs) most += run.end - run.begin;
  if (column.scale.size() < most) {
    most += most / 2;
    for (auto* array : {&column.scale, &column.x, &column.y}) array->resize(most);
    column.z.resize(most);
  }
  const V half = hn::Set(d, static_cast<float>(0.5 * size));
  std::size_t count = 0, r = 0;
  column.start.assign(1, 0);
  for (const std::uint32_t end : layer) {
    for (; r < end; ++r) {
      const BlobRun& run = runs[r];
      for (std::size_t i = run.begin; i < run.end; i += kWidth) {
        const V s = hn::LoadU(d, all.scale + i), x = scaled(all.x + i, base[0], s), y = scaled(all.y + i, base[1], s);
        // What is added along z takes none nearer.
        const V z = hn::Mul(s, half);
        auto keep = hn::Lt(distances({s, x, y, z}, {half, half, half, half}).near2, hn::Set(d, kReach2));
        if (run.end - i < kWidth) keep = hn::And(keep, hn::FirstN(d, run.end - i));
        hn::StoreU(pack_lanes(s, keep), d, column.scale.data() + count);
        hn::StoreU(pack_lanes(x, keep), d, column.x.data() + count);
        hn::StoreU(pack_lanes(y, keep), d, column.y.data() + count);
        // Doubles as pairs of words, which compress by the same mask.
        hn::VFromD<decltype(du)> low, high;
        hn::LoadInterleaved2(du, reinterpret_cast<const std::uint32_t*>(all.z + i), low, high);
        const auto words = hn::RebindMask(du, keep);
        hn::StoreInterleaved2(pack_lanes(low, words), pack_lanes(high, words), du, reinterpret_cast<std::uint32_t*>(column.z.data() + count));
        count += hn::CountTrue(d, keep);
      }
    }
    column.start.push_back(static_cast<std::uint32_t>(count));
  }
}

void GatherFromColumn(const BlobColumn& column, const ColumnCube& cube, BlobList& list, BlobList* far) {
  const D d;
  Gathered gathered(cube.end - cube.begin, list, far);
  const V half = hn::Set(d, static_cast<float>(0.5 * cube.size));
  for (std::size_t i = cube.begin; i < cube.end; i += kWidth) {
    const V s = hn::LoadU(d, column.scale.data() + i), x = hn::LoadU(d, column.x.data() + i), y = hn::LoadU(d, column.y.data() + i);
    const BlobLanes b{s, x, y, scaled(column.z.data() + i, cube.base_z, s)};
    gathered.add(b, distances(b, {half, half, half, half}).near2, cube.end - i);
  }
  gathered.finish();
}

/// @param far  null: the order stays
HWY_INLINE PotentialBounds select_into(const BlobList& from, const std::array<float, 3>& centre, float half, BlobList& list,
                                       BlobList* far) {
  const D d;
  list.reserve(from.count);
  if (far != nullptr) far->reserve(from.count);
  const V cx = hn::Set(d, centre[0]), cy = hn::Set(d, centre[1]), cz = hn::Set(d, centre[2]);
  const V around = hn::Set(d, half), one = hn::Set(d, 1.0F);
  std::size_t count = 0, far_count = 0;
  alignas(64) float lower[kLanes] = {}, upper[kLanes] = {};
  for (std::size_t i = 0; i < from.count; i += kWidth) {
    const BlobLanes b{hn::LoadU(d, from.scale.data() + i), hn::LoadU(d, from.x.data() + i), hn::LoadU(d, from.y.data() + i),
                      hn::LoadU(d, from.z.data() + i)};
    const Distances q = distances(b, {cx, cy, cz, around});
    const auto keep = hn::Lt(q.near2, hn::Set(d, kReach2));
    const V most = hn::Max(hn::Sub(one, q.near2), hn::Zero(d)), least = hn::Max(hn::Sub(one, q.far2), hn::Zero(d));
    float *low = lower + i % kLanes, *high = upper + i % kLanes;
    hn::Store(hn::Add(hn::Load(d, high), cube(most)), d, high);
    hn::Store(hn::Add(hn::Load(d, low), cube(least)), d, low);
    if (far == nullptr) {
      count = append(b, keep, list, count);
    } else {
      const auto near = hn::Lt(q.near2, hn::Set(d, kNear2));
      count = append(b, near, list, count);
      far_count = append(b, hn::AndNot(near, keep), *far, far_count);
    }
  }
  if (far != nullptr) {
    append_far(*far, far_count, list, count);
  } else {
    list.near = list.count = count;
    list.pad();
  }
  const float high = sum_of_lanes(upper);
  const float error = round_off(list.count, high);
  return {sum_of_lanes(lower) - error, high + error};
}

void SelectTiles(const BlobList& from, const std::array<float, 3>& centre, unsigned wanted, LeafTiles& tiles) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  constexpr float kHalf = 0.5F * kTile;
  struct Work {
    std::size_t tile;
    std::uint32_t *near, *far;
    alignas(64) float lower[kLanes], upper[kLanes];
  };
  std::array<Work, LeafTiles::kTiles> work;
  std::size_t n = 0;
  for (std::size_t t = 0; t < LeafTiles::kTiles; ++t) {
    if ((wanted >> t & 1u) == 0) continue;
    TileBlobs& blobs = tiles.blobs[t];
    for (BlobPlaces* places : {&blobs.near, &blobs.far}) {
      if (places->place.size() < from.count + kLanes) places->place.resize(2 * from.count + kLanes);
    }
    work[n++] = {t, blobs.near.place.data(), blobs.far.place.data(), {}, {}};
  }
  const V around = hn::Set(d, kHalf), one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  for (std::size_t i = 0; i < from.count; i += kWidth) {
    // What `distances` takes along each axis is shared by tiles, lower ones and upper ones.
    const V s = hn::LoadU(d, from.scale.data() + i), reach = hn::Mul(s, around);
    V nearest[3][2], farthest[3][2];
    for (std::size_t k = 0; k < 3; ++k) {
      const V at = hn::LoadU(d, (k == 0 ? from.x : k == 1 ? from.y : from.z).data() + i);
      for (std::size_t side = 0; side < 2; ++side) {
        const V off = hn::Abs(hn::MulSub(s, hn::Set(d, centre[k] + (side == 0 ? -kHalf : kHalf)), at));
        nearest[k][side] = hn::Max(hn::Sub(off, reach), zero);
        farthest[k][side] = hn::Add(off, reach);
      }
    }
    const auto place = hn::Iota(du, static_cast<std::uint32_t>(i));
    for (Work* w = work.data(); w != work.data() + n; ++w) {
      const auto square = [&](const V (&off)[3][2]) HWY_ATTR {
        const V x = off[0][w->tile & 1u], y = off[1][w->tile >> 1 & 1u], z = off[2][w->tile >> 2];
        return hn::MulAdd(z, z, hn::MulAdd(y, y, hn::Mul(x, x)));
      };
      const V near2 = square(nearest), far2 = square(farthest);
      const auto keep = hn::Lt(near2, hn::Set(d, kReach2)), close = hn::Lt(near2, hn::Set(d, kNear2));
      float *low = w->lower + i % kLanes, *high = w->upper + i % kLanes;
      hn::Store(hn::Add(hn::Load(d, high), cube(hn::Max(hn::Sub(one, near2), zero))), d, high);
      hn::Store(hn::Add(hn::Load(d, low), cube(hn::Max(hn::Sub(one, far2), zero))), d, low);
      const auto rest = hn::AndNot(close, keep);
      hn::StoreU(pack_lanes(place, hn::RebindMask(du, close)), du, w->near);
      hn::StoreU(pack_lanes(place, hn::RebindMask(du, rest)), du, w->far);
      w->near += hn::CountTrue(d, close);
      w->far += hn::CountTrue(d, rest);
    }
  }
  for (const Work* w = work.data(); w != work.data() + n; ++w) {
    TileBlobs& blobs = tiles.blobs[w->tile];
    blobs.near.count = static_cast<std::size_t>(w->near - blobs.near.place.data());
    blobs.far.count = static_cast<std::size_t>(w->far - blobs.far.place.data());
    const float high = sum_of_lanes(w->upper);
    const float error = round_off(blobs.count(), high);
    tiles.bounds[w->tile] = {sum_of_lanes(w->lower) - error, high + error};
  }
}

PotentialBounds Select(const BlobList& from, const std::array<float, 3>& centre, float half, BlobList& list) {
  return select_into(from, centre, half, list, nullptr);
}
PotentialBounds SelectNearFirst(const BlobList& from, const std::array<float, 3>& centre, float half, BlobList& list,
                                BlobList& far) {
  return select_into(from, centre, half, list, &far);
}

HWY_INLINE std::uint64_t mask_bits(hn::Mask<D> mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(D(), mask, bits);
  return std::uint64_t{static_cast<unsigned>(bits[0]) | static_cast<unsigned>(bits[1]) << 8};
}

TileSums EvaluateTile(const BlobList& list, const TileBlobs& tile, const std::array<float, 3>& corner, float iso, float sure,
                      float* values) {
  const D d;
  constexpr std::size_t kBetweenLooks = 8;
  constexpr std::size_t kPlane = std::size_t{kTile} * kTile;
  constexpr std::size_t kParts = kPlane / kWidth;
  alignas(64) float nodes[2][kPlane];
  for (std::size_t i = 0; i < kPlane; ++i) {
    nodes[0][i] = corner[0] + static_cast<float>(i % kTile);
    nodes[1][i] = corner[1] + static_cast<float>(i / kTile);
  }
  V x[kParts], y[kParts], sum[kTile][kParts];
  for (std::size_t p = 0; p < kParts; ++p) {
    x[p] = hn::Load(d, nodes[0] + p * kWidth);
    y[p] = hn::Load(d, nodes[1] + p * kWidth);
    for (std::size_t k = 0; k < kTile; ++k) sum[k][p] = hn::Zero(d);
  }
  V z[kTile];
  for (std::size_t k = 0; k < kTile; ++k) z[k] = hn::Set(d, corner[2] + static_cast<float>(k));
  const V one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const float *scale = list.scale.data(), *px = list.x.data(), *py = list.y.data(), *pz = list.z.data();
  const auto add = [&](std::size_t i) HWY_ATTR {
    const V s = hn::Set(d, scale[i]), cx = hn::Set(d, px[i]), cy = hn::Set(d, py[i]), cz = hn::Set(d, pz[i]);
    V rest[kParts];
    for (std::size_t p = 0; p < kParts; ++p) {
      const V dx = hn::MulSub(s, x[p], cx), dy = hn::MulSub(s, y[p], cy);
      rest[p] = hn::NegMulAdd(dy, dy, hn::NegMulAdd(dx, dx, one));
    }
    for (std::size_t k = 0; k < kTile; ++k) {
      const V dz = hn::MulSub(s, z[k], cz);
      for (std::size_t p = 0; p < kParts; ++p) {
        const V t = hn::Max(hn::NegMulAdd(dz, dz, rest[p]), zero);
        sum[k][p] = hn::MulAdd(hn::Mul(t, t), t, sum[k][p]);
      }
    }
  };
  const auto is_sure = [&]() HWY_ATTR {
    V least = sum[0][0];
    for (std::size_t k = 0; k < kTile; ++k) {
      for (std::size_t p = 0; p < kParts; ++p) least = hn::Min(least, sum[k][p]);
    }
    return hn::AllTrue(d, hn::Gt(least, hn::Set(d, sure)));
  };
  std::size_t added = 0;
  for (const BlobPlaces* places : {&tile.near, &tile.far}) {
    for (std::size_t n = 0; n < places->count; ++n) {
      add(places->place[n]);
      if (++added % kBetweenLooks == 0 && added < tile.count() && is_sure()) return {~std::uint64_t{0}, added};
    }
  }
  const V level = hn::Set(d, iso);
  std::uint64_t inside = 0;
  for (std::size_t k = 0; k < kTile; ++k) {
    for (std::size_t p = 0; p < kParts; ++p) {
      const std::size_t at = k * kPlane + p * kWidth;
      const V f = hn::Sub(sum[k][p], level);
      hn::StoreU(f, d, values + at);
      inside |= mask_bits(hn::Gt(f, zero)) << at;
    }
  }
  return {inside, added};
}

SureCubes FindSureCubes(const BlobList& list, const std::array<float, 3>& corner, int edge, float iso) {
  const D d;
  constexpr int kCubes = 4;
  constexpr std::size_t kPlane = std::size_t{kCubes} * kCubes, kParts = kPlane / kWidth, kBetweenLooks = 8;
  // With t = 1 - q, q = |scale x - centre|^2, f = t^3 is convex in q, so that from the middle of a cube to a node at d
  // f >= t^3 - 3 t^2 (2 scale (scale x - centre) . d + scale^2 d^2): slopes of blobs on either side cancel in the sum.
  // Computed terms differ from exact ones by up to 60 roundings each, of numbers up to 4.
  const float half = 0.5F * static_cast<float>(edge - 1), step = static_cast<float>(edge);
  const V level = hn::Set(d, iso + 2e-5F * static_cast<float>(list.near + 1));
  alignas(64) float centres[2][kPlane];
  for (std::size_t i = 0; i < kPlane; ++i) {
    centres[0][i] = corner[0] + half + step * static_cast<float>(i % kCubes);
    centres[1][i] = corner[1] + half + step * static_cast<float>(i / kCubes);
  }
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F);
  V x[kParts], y[kParts], z[kCubes];
  struct {
    V f, x, y, z, bend;
  } sum[kCubes][kParts];
  for (std::size_t p = 0; p < kParts; ++p) {
    x[p] = hn::Load(d, centres[0] + p * kWidth);
    y[p] = hn::Load(d, centres[1] + p * kWidth);
    for (std::size_t k = 0; k < kCubes; ++k) sum[k][p] = {zero, zero, zero, zero, zero};
  }
  for (std::size_t k = 0; k < kCubes; ++k) z[k] = hn::Set(d, corner[2] + half + step * static_cast<float>(k));
  const auto bound = [&](std::size_t k, std::size_t p) HWY_ATTR {
    const auto& s = sum[k][p];
    const V slopes = hn::Add(hn::Abs(s.x), hn::Add(hn::Abs(s.y), hn::Abs(s.z)));
    const V fall = hn::MulAdd(hn::Set(d, 9.0F * half * half), s.bend, hn::Mul(hn::Set(d, 6.0F * half), slopes));
    return hn::Sub(s.f, fall);
  };
  const auto all_sure = [&]() HWY_ATTR {
    V least = bound(0, 0);
    for (std::size_t k = 0; k < kCubes; ++k) {
      for (std::size_t p = 0; p < kParts; ++p) least = hn::Min(least, bound(k, p));
    }
    return hn::AllTrue(d, hn::Gt(least, level));
  };
  std::size_t i = 0;
  for (; i < list.near; ++i) {
    const V s = hn::Set(d, list.scale[i]), cx = hn::Set(d, list.x[i]), cy = hn::Set(d, list.y[i]), cz = hn::Set(d, list.z[i]);
    V dx[kParts], dy[kParts], rest[kParts];
    for (std::size_t p = 0; p < kParts; ++p) {
      dx[p] = hn::MulSub(s, x[p], cx);
      dy[p] = hn::MulSub(s, y[p], cy);
      rest[p] = hn::NegMulAdd(dy[p], dy[p], hn::NegMulAdd(dx[p], dx[p], one));
    }
    for (std::size_t k = 0; k < kCubes; ++k) {
      const V dz = hn::MulSub(s, z[k], cz);
      for (std::size_t p = 0; p < kParts; ++p) {
        auto& to = sum[k][p];
        const V t = hn::Max(hn::NegMulAdd(dz, dz, rest[p]), zero), t2 = hn::Mul(t, t), w = hn::Mul(t2, s);
        to.f = hn::MulAdd(t2, t, to.f);
        to.x = hn::MulAdd(w, dx[p], to.x);
        to.y = hn::MulAdd(w, dy[p], to.y);
        to.z = hn::MulAdd(w, dz, to.z);
        to.bend = hn::MulAdd(w, s, to.bend);
      }
    }
    if (i % kBetweenLooks == kBetweenLooks - 1 && all_sure()) return {~std::uint64_t{0}, i + 1};
  }
  std::uint64_t inside = 0;
  for (std::size_t k = 0; k < kCubes; ++k) {
    for (std::size_t p = 0; p < kParts; ++p) {
      inside |= mask_bits(hn::Gt(bound(k, p), level)) << (k * kPlane + p * kWidth);
    }
  }
  return {inside, i};
}

}  // namespace
}  // namespace supple::implicit::blobs::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::implicit::blobs {

HWY_EXPORT(Gather);
HWY_EXPORT(GatherColumn);
HWY_EXPORT(GatherFromColumn);
HWY_EXPORT(Select);
HWY_EXPORT(SelectNearFirst);
HWY_EXPORT(SelectTiles);
HWY_EXPORT(EvaluateTile);
HWY_EXPORT(FindSureCubes);

void BlobList::reserve(std::size_t blobs) {
  const std::size_t room = blobs + 2 * kLanes;
  if (x.size() >= room) return;
  const std::size_t grown = room + room / 2;
  for (auto* array : {&scale, &x, &y, &z}) array->resize(grown);
}

void BlobList::pad() {
  reserve(count);
  for (std::size_t i = count; i < count + kLanes; ++i) {
    scale[i] = y[i] = z[i] = 0.0F;
    x[i] = 2.0F;
  }
}

void gather(const BlobArrays& all, std::span<const BlobRun> runs, const CubeAround& cube, BlobList& list, BlobList* far) {
  HWY_DYNAMIC_DISPATCH(Gather)(all, runs, cube, list, far);
}

void gather_column(const BlobArrays& all, std::span<const BlobRun> runs, std::span<const std::uint32_t> layer,
                   const std::array<double, 2>& base, double size, BlobColumn& column) {
  HWY_DYNAMIC_DISPATCH(GatherColumn)(all, runs, layer, base, size, column);
}

void gather(const BlobColumn& column, const ColumnCube& cube, BlobList& list, BlobList* far) {
  HWY_DYNAMIC_DISPATCH(GatherFromColumn)(column, cube, list, far);
}

PotentialBounds select(const BlobList& from, const std::array<float, 3>& centre, float half, BlobList& list) {
  return HWY_DYNAMIC_DISPATCH(Select)(from, centre, half, list);
}

PotentialBounds select_near_first(const BlobList& from, const std::array<float, 3>& centre, float half, BlobList& list,
                                  BlobList& far) {
  return HWY_DYNAMIC_DISPATCH(SelectNearFirst)(from, centre, half, list, far);
}

void select_tiles(const BlobList& from, const std::array<float, 3>& centre, unsigned wanted, LeafTiles& tiles) {
  HWY_DYNAMIC_DISPATCH(SelectTiles)(from, centre, wanted, tiles);
}

TileSums evaluate_tile(const BlobList& list, const TileBlobs& tile, const std::array<float, 3>& corner, float iso, float sure,
                       float* values) {
  return HWY_DYNAMIC_DISPATCH(EvaluateTile)(list, tile, corner, iso, sure, values);
}

SureCubes find_sure_cubes(const BlobList& list, const std::array<float, 3>& corner, int edge, float iso) {
  return HWY_DYNAMIC_DISPATCH(FindSureCubes)(list, corner, edge, iso);
}

}  // namespace supple::implicit::blobs
#endif  // HWY_ONCE
