#include <immintrin.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "mesh/cubes/march_assemble.h"

namespace supple::implicit::march {
namespace {

/// From the number `first` on, numbers move by `more` further than those before.
struct Shift {
  std::uint32_t first, more;
};

/// How the vertices move that stay and that triangles of a block may have, in rising order.
void find_shifts(const BlockTable& table, const Block& block, std::vector<Shift>& shifts) {
  shifts.clear();
  std::uint32_t total = 0;
  const auto add = [&](std::uint32_t from, std::uint32_t to) {
    if (!shifts.empty() && to - from == total) return;
    shifts.push_back({from, to - from - total});
    total = to - from;
  };
  const BlocksAbove above = blocks_above(table, block);
  for (unsigned step = 0; step < 7; ++step) {
    if (above[step] == nullptr) continue;
    const Block& other = *above[step];
    if (other.solve == 0) {
      if (other.vertices > 0) add(other.old_vertex, other.first_vertex);
      continue;
    }
    for_bits(other.held & ~other.solve & first_of(step), [&](unsigned place) {
      const Tile& tile = other.tile[other.rank(place)];
      if (tile.vertices > 0) add(other.old_vertex + tile.old_vertex, other.first_vertex + tile.first_vertex);
    });
  }
}

/// Calls move(run) for those that move down or stay in rising order, then for those that move up in falling order, so that
/// nothing is overwritten before it has moved.
template <class Move>
void for_runs(const std::vector<Run>& runs, const Move& move) {
  for (const Run& run : runs) {
    if (run.to <= run.from) move(run);
  }
  for (auto run = runs.rbegin(); run != runs.rend(); ++run) {
    if (run->to > run->from) move(*run);
  }
}

/// Moves items in place, page by page, each with the next one under way from memory: a processor foresees no other page.
template <class Item>
void move_run(const Run& run, Item* items) {
  constexpr std::size_t kPage = 4096, kLine = 64, kItems = kPage / sizeof(Item);
  const auto move = [&](std::size_t i, std::size_t count, std::ptrdiff_t next) {
    const char* ahead = reinterpret_cast<const char*>(items + run.from + i) + next;
    for (std::size_t byte = 0; byte < kPage; byte += kLine) _mm_prefetch(ahead + byte, _MM_HINT_T0);
    std::memmove(static_cast<void*>(items + run.to + i), static_cast<const void*>(items + run.from + i), count * sizeof(Item));
  };
  if (run.to < run.from) {
    for (std::size_t i = 0; i < run.count; i += kItems) move(i, std::min(kItems, run.count - i), kPage);
  } else if (run.to > run.from) {
    for (std::size_t left = run.count; left > 0; left -= std::min(kItems, left)) {
      move(left - std::min(kItems, left), std::min(kItems, left), -static_cast<std::ptrdiff_t>(kPage));
    }
  }
}

/// Copies numbers of vertices, moved by their shifts; may be in place. @pre there is a shift, and none is before the first
void move_numbers(const std::uint32_t* from, std::uint32_t* to, std::size_t count, std::span<const Shift> shifts) {
  constexpr std::size_t kWide = 16;
  const std::uint32_t base = shifts[0].more;
  const std::span<const Shift> further = shifts.subspan(1);
  const auto move_one = [&](std::size_t i) {
    std::uint32_t moved = from[i] + base;
    for (const Shift& shift : further) moved += from[i] >= shift.first ? shift.more : 0;
    to[i] = moved;
  };
  const std::ptrdiff_t ahead = to <= from ? 1024 : -1024;  // a page, as in move_run
  const __m256i first_more = _mm256_set1_epi32(static_cast<int>(base));
  const auto move_line = [&](std::size_t i) {
    _mm_prefetch(reinterpret_cast<const char*>(from + i + ahead), _MM_HINT_T0);
    const auto load = [&](std::size_t k) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from + i + k)); };
    const auto store = [&](std::size_t k, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + i + k), v); };
    const __m256i low = load(0), high = load(8);
    __m256i moved_low = _mm256_add_epi32(low, first_more), moved_high = _mm256_add_epi32(high, first_more);
    for (const Shift& shift : further) {
      const __m256i first = _mm256_set1_epi32(static_cast<int>(shift.first)), more = _mm256_set1_epi32(static_cast<int>(shift.more));
      const auto reached = [&](__m256i v) { return _mm256_and_si256(_mm256_cmpeq_epi32(_mm256_max_epu32(v, first), v), more); };
      moved_low = _mm256_add_epi32(moved_low, reached(low));
      moved_high = _mm256_add_epi32(moved_high, reached(high));
    }
    store(0, moved_low);
    store(8, moved_high);
  };
  const std::size_t whole = count / kWide * kWide;
  if (to <= from) {
    for (std::size_t i = 0; i < whole; i += kWide) move_line(i);
    for (std::size_t i = whole; i < count; ++i) move_one(i);
  } else {
    for (std::size_t i = count; i > whole; --i) move_one(i - 1);
    for (std::size_t i = whole; i > 0; i -= kWide) move_line(i - kWide);
  }
}

}  // namespace

void add_run(std::vector<Run>& runs, const Run& run) {
  if (run.count == 0) return;
  if (!runs.empty()) {
    Run& last = runs.back();
    if (last.from + last.count == run.from && last.to + last.count == run.to && last.block == run.block && last.more == run.more) {
      last.count += run.count;
      return;
    }
  }
  runs.push_back(run);
}

void move_runs(const std::vector<Run>& runs, std::size_t count, std::vector<Vec3>& items) {
  if (items.size() < count) items.resize(count);
  for_runs(runs, [&](const Run& run) { move_run(run, items.data()); });
  items.resize(count);
}

void move_triangles(const BlockTable& table, const std::vector<Run>& runs, std::size_t count, Mesh& mesh) {
  if (mesh.triangle.size() < count) mesh.triangle.resize(count);
  if (mesh.triangle.empty()) return;
  std::uint32_t* vertex = mesh.triangle.data()->data();
  std::vector<Shift> shifts;
  const Block* block = nullptr;
  for_runs(runs, [&](const Run& run) {
    if (run.block == nullptr) {
      shifts.assign(1, {0, run.more});
    } else if (run.block != block) {
      find_shifts(table, *run.block, shifts);
    }
    block = run.block;
    if (run.to == run.from && shifts.size() == 1 && shifts[0].more == 0) return;
    move_numbers(vertex + 3 * run.from, vertex + 3 * run.to, 3 * run.count, shifts);
  });
  mesh.triangle.resize(count);
}

void place_points(BlockTable& table, std::span<const std::uint32_t> blocks, std::span<const std::uint32_t> counted, std::size_t vertices,
                  bool none_stays, std::vector<EdgePoint>& points) {
  const auto for_kept = [](const Block& block, const auto& use) {
    for_bits(block.held & ~block.solve, [&](unsigned place) {
      const Tile& tile = block.tile[block.rank(place)];
      if (tile.vertices > 0) use(tile);
    });
  };
  if (none_stays || 2 * points.size() > 3 * vertices) {  // in the order of vertices
    std::vector<EdgePoint> last;
    if (!none_stays) last = points;
    points.resize(vertices);
    for (const std::uint32_t b : blocks) {
      Block& block = table.block[b];
      const std::uint32_t from = std::exchange(block.first_point, block.first_vertex);
      block.point_room = block.vertices;
      for_kept(block, [&](const Tile& tile) {
        const std::uint16_t old = block.solve == 0 ? tile.first_vertex : tile.old_vertex;
        std::copy_n(last.data() + from + old, tile.vertices, points.data() + block.first_point + tile.first_vertex);
      });
    }
    return;
  }
  std::vector<EdgePoint> last;
  for (const std::uint32_t b : counted) {
    Block& block = table.block[b];
    if (block.solve == 0) continue;
    last.assign(points.data() + block.first_point, points.data() + block.first_point + block.point_room);
    if (block.vertices > block.point_room) {
      block.first_point = static_cast<std::uint32_t>(points.size());
      block.point_room = block.vertices + block.vertices / 8;
      points.resize(points.size() + block.point_room);
    }
    for_kept(block, [&](const Tile& tile) {
      std::copy_n(last.data() + tile.old_vertex, tile.vertices, points.data() + block.first_point + tile.first_vertex);
    });
  }
}

}  // namespace supple::implicit::march
