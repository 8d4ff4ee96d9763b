#include "mesh/blob_grid.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "field/field_index.h"
#include "mesh/cubes/march_sampling.h"
#include "supple/core/error.h"

namespace supple::implicit::blobs {
namespace {

/// Bins are made larger until there are at most this many for a blob.
constexpr std::int64_t kBinsPerBlob = 64;
constexpr std::int64_t kFewBins = 1 << 16;
/// Blobs are fetched from memory this many before they are put into their places.
constexpr std::size_t kAhead = 16;

/// The bin of edge 2^shift that holds a coordinate or cell.
std::int64_t bin_at(double x, int shift) { return static_cast<std::int64_t>(std::floor(x)) >> shift; }
std::int64_t bin_at(std::int64_t cell, int shift) { return cell >> shift; }

}  // namespace

void BlobGrid::build(std::span<const PackedPrimitive> primitives, const Lattice& lattice) {
  static_assert(offsetof(PackedPrimitive, position) == 0 && offsetof(PackedPrimitive, inverse_r2) == offsetof(Source, inverse_r2));
  const std::size_t n = primitives.size();
  const bool comparable = lattice.cell == lattice_.cell && lattice.origin == lattice_.origin && last_.size() == n && !forgotten_;
  const int last_shift = shift_;
  const Cells last_first = first_, last_count = count_;
  lattice_ = lattice;
  forgotten_ = false;
  per_cell_ = 1.0 / lattice.cell;
  inverse_r2_ = 0.0;
  last_.resize(n);
  moved_.clear();
  __m256d low = _mm256_set1_pd(1e300), high = _mm256_set1_pd(-1e300);
  for (std::size_t i = 0; i < n; ++i) {
    const __m256d now = _mm256_loadu_pd(primitives[i].position.data()), last = _mm256_load_pd(last_[i].position.data());
    low = _mm256_min_pd(now, low);
    high = _mm256_max_pd(now, high);
    if (!comparable) {
      _mm256_store_pd(last_[i].position.data(), now);
    } else if (_mm256_movemask_pd(_mm256_cmp_pd(now, last, _CMP_NEQ_UQ)) != 0) {
      moved_.push_back(static_cast<std::uint32_t>(i));
    }
  }
  alignas(32) Source least, most;
  _mm256_store_pd(least.position.data(), low);
  _mm256_store_pd(most.position.data(), high);
  reach_ = n == 0 ? 0.0 : per_cell_ / std::sqrt(least.inverse_r2);
  support_ = {};
  count_.fill(0);
  shift_ = 3;
  if (n > 0) {
    const std::array<double, 3> lower = centre_of(least), upper = centre_of(most);
    double far = 0.0;
    for (std::size_t k = 0; k < 3; ++k) far = std::max({far, reach_ - lower[k], reach_ + upper[k]});
    forgotten_ = true;  // where it throws, positions are kept that were not sorted
    march::expect_near_nodes(far, lattice);
    forgotten_ = false;
    while (static_cast<double>(2 * bin()) < reach_) ++shift_;
    for (;; ++shift_) {
      for (std::size_t k = 0; k < 3; ++k) {
        first_[k] = bin_at(lower[k], shift_);
        count_[k] = bin_at(upper[k], shift_) - first_[k] + 1;
      }
      const double bins = static_cast<double>(count_[0]) * static_cast<double>(count_[1]) * static_cast<double>(count_[2]);
      if (bins <= static_cast<double>(std::max(kFewBins, kBinsPerBlob * static_cast<std::int64_t>(n)))) break;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      support_.lower[k] = static_cast<std::int64_t>(std::floor(lower[k] - reach_)) - 1;
      support_.upper[k] = static_cast<std::int64_t>(std::floor(upper[k] + reach_)) + 1;
    }
  }
  // Looking at all is cheaper where many moved.
  change_.all = !comparable || last_shift != shift_ || 8 * moved_.size() > n + 64;
  change_.balls.clear();
  const auto reached = [&](const Source& blob) {
    look_up_radius(blob.inverse_r2);
    return Ball{centre_of(blob), 1.001 * radius_ + 0.01};
  };
  for (const std::uint32_t i : moved_) {
    if (!change_.all) change_.balls.push_back(reached(last_[i]));
    last_[i] = {primitives[i].position, primitives[i].inverse_r2};
    if (!change_.all) change_.balls.push_back(reached(last_[i]));
  }
  if (change_.all || first_ != last_first || count_ != last_count || !sort_moved()) sort_all();
}

void BlobGrid::sort_all() {
  const std::size_t n = last_.size(), bins = static_cast<std::size_t>(count_[1] * count_[2]) * row_length();
  start_.assign(bins + 1, 0);
  bin_of_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    bin_of_[i] = bin_of(last_[i]);
    ++start_[bin_of_[i] + 1];
  }
  for (std::size_t row = 0; row < bins; row += row_length()) {
    const std::size_t end = row + row_length();
    for (std::size_t b = row; b < end; ++b) start_[b + 1] += start_[b];
    start_[end] += 2 + (start_[end] - start_[row]) / 8;
  }
  const std::size_t room = start_[bins];
  order_.resize(room);
  for (auto* array : {&x_, &y_, &z_}) array->resize(room + kLanes);
  scale_.resize(room + kLanes);
  next_ = start_;
  for (std::size_t i = 0; i < n; ++i) order_[next_[bin_of_[i]]++] = static_cast<std::uint32_t>(i);
  for (std::size_t row = 0; row < bins; row += row_length()) {
    const std::size_t end = start_[row + row_length() - 1];
    for (std::size_t place = start_[row]; place < end; ++place) {
      _mm_prefetch(reinterpret_cast<const char*>(&last_[order_[std::min(place + kAhead, end - 1)]]), _MM_HINT_T0);
      put(place, order_[place]);
    }
  }
}

/// Puts those that moved where they belong. @return false where a row has no room
bool BlobGrid::sort_moved() {
  std::vector<std::uint32_t> rows;                                 // those that blobs enter, leave or move in
  std::vector<std::pair<std::uint32_t, std::uint32_t>> entering;  // row and id
  for (const std::uint32_t i : moved_) {
    const std::uint32_t last = bin_of_[i], now = bin_of(last_[i]);
    if (now == last) {
      const auto begin = order_.begin() + start_[now], end = order_.begin() + start_[now + 1];
      put(static_cast<std::size_t>(std::lower_bound(begin, end, i) - order_.begin()), i);
      continue;
    }
    bin_of_[i] = now;
    const std::uint32_t from = last / row_length(), to = now / row_length();
    rows.push_back(to);
    if (from == to) continue;
    rows.push_back(from);
    entering.emplace_back(to, i);
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  std::sort(entering.begin(), entering.end());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> blobs;  // bin and id
  auto next = entering.begin();
  for (const std::uint32_t row : rows) {
    const std::size_t first = std::size_t{row} * row_length(), last = first + row_length() - 1;
    blobs.clear();
    for (std::size_t place = start_[first]; place < start_[last]; ++place) {
      const std::uint32_t i = order_[place];
      if (bin_of_[i] / row_length() == row) blobs.emplace_back(bin_of_[i], i);
    }
    for (; next != entering.end() && next->first == row; ++next) blobs.emplace_back(bin_of_[next->second], next->second);
    if (blobs.size() > start_[last + 1] - start_[first]) return false;
    std::sort(blobs.begin(), blobs.end());
    std::uint32_t place = start_[first];
    std::size_t bin = first;
    for (const auto& [at, i] : blobs) {
      for (; bin < at; ++bin) start_[bin + 1] = place;
      put(place++, i);
    }
    for (; bin < last; ++bin) start_[bin + 1] = place;
  }
  return true;
}

BlobGrid::BinRange BlobGrid::bins_near(const Cells& base, const Cells& size, std::int64_t margin) const {
  const auto reach = static_cast<std::int64_t>(std::ceil(reach_)) + 1 + margin;
  BinRange bins;
  for (std::size_t k = 0; k < 3; ++k) {
    bins.from[k] = std::max<std::int64_t>(bin_at(base[k] - reach, shift_) - first_[k], 0);
    bins.to[k] = std::min<std::int64_t>(bin_at(base[k] + size[k] + reach, shift_) - first_[k], count_[k] - 1);
  }
  return bins;
}

void BlobGrid::add_runs(const BinRange& bins, std::int64_t layer, std::vector<BlobRun>& runs) const {
  if (bins.from[0] > bins.to[0]) return;
  for (std::int64_t y = bins.from[1]; y <= bins.to[1]; ++y) {
    const auto row = static_cast<std::size_t>(layer * count_[1] + y) * row_length();
    const std::size_t begin = start_[row + static_cast<std::size_t>(bins.from[0])];
    const std::size_t end = start_[row + static_cast<std::size_t>(bins.to[0]) + 1];
    if (begin < end) runs.push_back({begin, end});
  }
}

void BlobGrid::gather(const Cells& base, std::int64_t size, std::int64_t margin, BlobList& list, BlobList* far) const {
  thread_local std::vector<BlobRun> runs;
  runs.clear();
  const BinRange bins = bins_near(base, {size, size, size}, margin);
  for (std::int64_t z = bins.from[2]; z <= bins.to[2]; ++z) add_runs(bins, z, runs);
  blobs::gather({x_.data(), y_.data(), z_.data(), scale_.data()}, runs,
                {{static_cast<double>(base[0]), static_cast<double>(base[1]), static_cast<double>(base[2])}, static_cast<double>(size),
                 static_cast<double>(margin)},
                list, far);
}

void BlobGrid::gather_column(const Cells& base, std::int64_t size, std::int64_t height, Column& column) const {
  thread_local std::vector<BlobRun> runs;
  thread_local std::vector<std::uint32_t> layer;
  runs.clear();
  layer.clear();
  const BinRange bins = bins_near(base, {size, size, height}, 0);
  for (std::int64_t z = bins.from[2]; z <= bins.to[2]; ++z) {
    add_runs(bins, z, runs);
    layer.push_back(static_cast<std::uint32_t>(runs.size()));
  }
  column.base = base;
  column.first_layer = bins.from[2];
  blobs::gather_column({x_.data(), y_.data(), z_.data(), scale_.data()}, runs, layer,
                       {static_cast<double>(base[0]), static_cast<double>(base[1])}, static_cast<double>(size), column.blobs);
}

void BlobGrid::gather(const Column& column, const Cells& base, std::int64_t size, BlobList& list, BlobList* far) const {
  const BinRange bins = bins_near(base, {size, size, size}, 0);
  const std::vector<std::uint32_t>& start = column.blobs.start;
  const auto at = [&](std::int64_t layer) {
    return start[static_cast<std::size_t>(std::clamp<std::int64_t>(layer - column.first_layer, 0, static_cast<std::int64_t>(start.size()) - 1))];
  };
  const std::size_t begin = at(bins.from[2]), end = std::max<std::size_t>(begin, at(bins.to[2] + 1));
  blobs::gather(column.blobs, {begin, end, static_cast<double>(base[2]), static_cast<double>(size)}, list, far);
}

}  // namespace supple::implicit::blobs
