#include "supple/core/neighbours.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "laws/lanes.h"
#include "neighbours/neighbour_grid.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

/// Cells are a little wider than the range, so that rounding of the coordinates cannot put neighbours two cells apart
/// while coordinates stay below kFarCell.
constexpr double kCellSlack = 1.0 + 0x1p-10;
constexpr double kFarCell = 0x1p40;
constexpr std::size_t kPointBlock = 1024;

/// The only squared distance: both searches must round in the same way.
template <class T>
T squared_distance(const T& dx, const T& dy, const T& dz) {
  return fma(dx, dx, fma(dy, dy, dz * dz));
}

/// x mod 2^32 for a whole x; 0 where x has no such bits.
std::uint32_t low_bits(double x) { return static_cast<std::uint32_t>(x - std::floor(x * 0x1p-32) * 0x1p32); }

}  // namespace

std::uint32_t NeighbourGrid::row(double x, double y) const {
  // A small whole double has its bits at the top, where a product does not spread them: they are folded down first.
  const auto mixed = [](std::uint64_t h) {
    h = (h ^ (h >> 32)) * 0x9e3779b97f4a7c15ULL;
    return h ^ (h >> 32);
  };
  return static_cast<std::uint32_t>(mixed(mixed(std::bit_cast<std::uint64_t>(x)) ^ std::bit_cast<std::uint64_t>(y)));
}

/// Cells above each other have buckets after each other.
std::uint32_t NeighbourGrid::bucket(const Cell& cell) const {
  return (row(cell[0], cell[1]) + low_bits(cell[2])) & mask_;
}

void NeighbourGrid::sort_into_buckets(std::span<const Vec3> positions, double range) {
  const auto n = static_cast<std::uint32_t>(positions.size());
  const double inverse = 1.0 / (range * kCellSlack);
  mask_ = std::bit_ceil(2 * n) - 1;
  cell_.resize(n);
  index_.resize(n);
  for (std::vector<double>* values : {&x_, &y_, &z_}) values->resize(n + kLanes);
  start_.assign(mask_ + 2U, 0);
  double farthest = 0.0;
  for (std::uint32_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double c = std::floor(positions[i][k] * inverse) + 0.0;
      cell_[i][static_cast<std::size_t>(k)] = c;
      farthest = std::max(farthest, std::abs(c));
    }
    ++start_[bucket(cell_[i]) + 1];
  }
  far_ = farthest >= kFarCell;
  for (std::uint32_t b = 0; b <= mask_; ++b) start_[b + 1] += start_[b];
  // Filled from the back: start_[b + 1] falls from the end of bucket b to its first entry, and points stay in order.
  for (std::uint32_t i = n; i-- > 0;) {
    const std::uint32_t entry = --start_[bucket(cell_[i]) + 1];
    index_[entry] = i;
    x_[entry] = positions[i].x();
    y_[entry] = positions[i].y();
    z_[entry] = positions[i].z();
  }
  for (std::uint32_t b = 0; b <= mask_; ++b) start_[b] = start_[b + 1];
  start_[mask_ + 1U] = n;
}

void NeighbourGrid::scan(const Query& query, std::uint32_t begin, std::uint32_t end,
                         std::vector<IndexPair>& pairs) const {
  const double reach = far_ ? 2.0 : 1.0;
  const Lanes x(query.x.x()), y(query.x.y()), z(query.x.z()), range2(query.range2);
  for (std::uint32_t k = begin; k < end; k += kLanes) {
    const Lanes dx = x - Lanes(_mm256_loadu_pd(&x_[k]));
    const Lanes dy = y - Lanes(_mm256_loadu_pd(&y_[k]));
    const Lanes dz = z - Lanes(_mm256_loadu_pd(&z_[k]));
    const __m256d near = _mm256_cmp_pd(squared_distance(dx, dy, dz).v, range2.v, _CMP_LT_OQ);
    auto hits = static_cast<unsigned>(_mm256_movemask_pd(near));
    if (end - k < kLanes) hits &= (1U << (end - k)) - 1U;
    for (; hits != 0; hits &= hits - 1U) {
      const std::uint32_t j = index_[k + static_cast<std::uint32_t>(std::countr_zero(hits))];
      if (j <= query.index) continue;
      // Rows may share buckets: a pair counts where its own row is visited.
      const Cell& cell = cell_[j];
      if (cell[0] == query.cell_x && cell[1] == query.cell_y && std::abs(cell[2] - query.home_z) <= reach) {
        pairs.push_back({query.index, j});
      }
    }
  }
}

std::uint64_t NeighbourGrid::search(std::span<const Vec3> positions, double range, std::uint32_t begin,
                                    std::uint32_t end, std::vector<IndexPair>& pairs) const {
  const int reach = far_ ? 2 : 1;
  std::uint64_t visited = 0;
  for (std::uint32_t i = begin; i < end; ++i) {
    const std::size_t first_pair = pairs.size();
    const Cell& home = cell_[i];
    Query query{.x = positions[i],
                .index = i,
                .cell_x = 0.0,
                .cell_y = 0.0,
                .home_z = home[2],
                .range2 = range * range};
    for (int dx = -reach; dx <= reach; ++dx) {
      for (int dy = -reach; dy <= reach; ++dy) {
        query.cell_x = home[0] + dx + 0.0;
        query.cell_y = home[1] + dy + 0.0;
        const std::uint32_t first_bucket = row(query.cell_x, query.cell_y);
        // The cells of a row have buckets after each other, so that their entries are one range; not so where the
        // buckets wrap round, nor far out.
        const std::uint32_t low = (first_bucket + low_bits(home[2] - 1.0)) & mask_;
        if (!far_ && low + 2 <= mask_) {
          visited += start_[low + 3] - start_[low];
          scan(query, start_[low], start_[low + 3], pairs);
          continue;
        }
        std::uint32_t seen = mask_ + 1U;  // no bucket
        for (int dz = -reach; dz <= reach; ++dz) {
          const std::uint32_t b = (first_bucket + low_bits(home[2] + dz)) & mask_;
          if (b == seen) continue;
          seen = b;
          visited += start_[b + 1] - start_[b];
          scan(query, start_[b], start_[b + 1], pairs);
        }
      }
    }
    const auto first = pairs.begin() + static_cast<std::ptrdiff_t>(first_pair);
    std::sort(first, pairs.end());
    // With few buckets, or cells with equal hashes, buckets are visited more than once.
    pairs.erase(std::unique(first, pairs.end()), pairs.end());
  }
  return visited;
}

std::uint64_t NeighbourGrid::find(std::span<const Vec3> positions, double range, const Executor& executor,
                                  std::vector<IndexPair>& pairs) {
  SUPPLE_EXPECTS(range > 0.0);
  pairs.clear();
  const std::size_t n = positions.size();
  if (n < 2) return 0;
  SUPPLE_EXPECTS(n < (std::size_t{1} << 30));
  sort_into_buckets(positions, range);
  if (executor.threads() == 1 || n <= kPointBlock) {
    return search(positions, range, 0, static_cast<std::uint32_t>(n), pairs);
  }

  if (block_.size() < (n - 1) / kPointBlock + 1) block_.resize((n - 1) / kPointBlock + 1);
  const auto body = [&](std::size_t begin, std::size_t end) {
    Block& block = block_[begin / kPointBlock];
    block.pairs.clear();
    block.visited = search(positions, range, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end),
                           block.pairs);
  };
  executor.for_blocks(n, kPointBlock, std::ref(body));
  std::uint64_t visited = 0;
  for (std::size_t b = 0; b < (n - 1) / kPointBlock + 1; ++b) {
    pairs.insert(pairs.end(), block_[b].pairs.begin(), block_[b].pairs.end());
    visited += block_[b].visited;
  }
  return visited;
}

std::uint64_t NeighbourGrid::count(std::span<const Vec3> positions, double range, std::size_t stride) {
  SUPPLE_EXPECTS(range > 0.0 && stride > 0);
  if (positions.size() < 2) return 0;
  SUPPLE_EXPECTS(positions.size() < (std::size_t{1} << 30));
  sort_into_buckets(positions, range);
  std::vector<IndexPair> pairs;  // of one point
  std::uint64_t found = 0;
  for (std::size_t i = 0; i < positions.size(); i += stride) {
    pairs.clear();
    search(positions, range, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(i + 1), pairs);
    found += pairs.size();
  }
  return found;
}

std::vector<IndexPair> find_neighbours(std::span<const Vec3> positions, double range) {
  NeighbourGrid grid;
  std::vector<IndexPair> pairs;
  grid.find(positions, range, Executor(1), pairs);
  return pairs;
}

std::vector<IndexPair> find_neighbours_brute_force(std::span<const Vec3> positions, double range) {
  SUPPLE_EXPECTS(range > 0.0);
  std::vector<IndexPair> pairs;
  const auto n = static_cast<std::uint32_t>(positions.size());
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = i + 1; j < n; ++j) {
      const Vec3 r = positions[i] - positions[j];
      if (squared_distance(r.x(), r.y(), r.z()) < range * range) pairs.push_back({i, j});
    }
  }
  return pairs;
}

}  // namespace supple::core
