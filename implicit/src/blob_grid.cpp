#include "blob_grid.h"

#include <algorithm>
#include <cmath>

#include "field_index.h"
#include "supple/core/error.h"

namespace supple::implicit::blobs {
namespace {

/// Bins are made larger until there are at most this many for a blob.
constexpr std::int64_t kBinsPerBlob = 64;
constexpr std::int64_t kFewBins = 1 << 16;

/// The bin of edge 2^shift that holds a coordinate or cell.
std::int64_t bin_at(double x, int shift) { return static_cast<std::int64_t>(std::floor(x)) >> shift; }
std::int64_t bin_at(std::int64_t cell, int shift) { return cell >> shift; }

}  // namespace

void BlobGrid::build(std::span<const PackedPrimitive> primitives, const Lattice& lattice) {
  const std::size_t n = primitives.size();
  const double per_cell = 1.0 / lattice.cell;
  const bool same_lattice = lattice.cell == lattice_.cell && lattice.origin == lattice_.origin;
  const int last_shift = shift_;
  lattice_ = lattice;
  cells_.swap(last_cells_);
  radius_.swap(last_radius_);
  cells_.resize(3 * n);
  radius_.resize(n);
  std::array<double, 3> low, high;
  low.fill(1e300);
  high.fill(-1e300);
  double least_inverse = 1e300, inverse_r2 = 0.0, radius = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      const double u = (primitives[i].position[axis] - lattice.origin[k]) * per_cell;
      cells_[3 * i + axis] = u;
      low[axis] = std::min(low[axis], u);
      high[axis] = std::max(high[axis], u);
    }
    if (primitives[i].inverse_r2 != inverse_r2) {  // most often all are alike
      inverse_r2 = primitives[i].inverse_r2;
      radius = per_cell / std::sqrt(inverse_r2);
    }
    radius_[i] = radius;
    least_inverse = std::min(least_inverse, primitives[i].inverse_r2);
  }
  reach_ = n == 0 ? 0.0 : per_cell / std::sqrt(least_inverse);
  support_ = {};
  count_.fill(0);
  shift_ = 3;
  if (n > 0) {
    while (static_cast<double>(2 * bin()) < reach_) ++shift_;
    for (;; ++shift_) {
      for (std::size_t k = 0; k < 3; ++k) {
        first_[k] = bin_at(low[k], shift_);
        count_[k] = bin_at(high[k], shift_) - first_[k] + 1;
      }
      const double bins = static_cast<double>(count_[0]) * static_cast<double>(count_[1]) * static_cast<double>(count_[2]);
      if (bins <= static_cast<double>(std::max(kFewBins, kBinsPerBlob * static_cast<std::int64_t>(n)))) break;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      support_.lower[k] = static_cast<std::int64_t>(std::floor(low[k] - reach_)) - 1;
      support_.upper[k] = static_cast<std::int64_t>(std::floor(high[k] + reach_)) + 1;
    }
  }
  compare(same_lattice && last_shift == shift_ && last_radius_.size() == n);
  const auto bins = static_cast<std::size_t>(count_[0] * count_[1] * count_[2]);
  start_.assign(bins + 1, 0);
  bin_of_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::array<std::int64_t, 3> at{};
    for (std::size_t k = 0; k < 3; ++k) {
      at[k] = bin_at(cells_[3 * i + k], shift_) - first_[k];
    }
    bin_of_[i] = static_cast<std::uint32_t>((at[2] * count_[1] + at[1]) * count_[0] + at[0]);
    ++start_[bin_of_[i] + 1];
  }
  for (std::size_t b = 0; b < bins; ++b) start_[b + 1] += start_[b];
  order_.resize(n);
  for (std::size_t i = 0; i < n; ++i) order_[start_[bin_of_[i]]++] = static_cast<std::uint32_t>(i);
  for (auto* array : {&x_, &y_, &z_}) array->resize(n + kLanes);
  scale_.resize(n + kLanes);
  double last_radius = 0.0;
  float scale = 0.0F;
  for (std::size_t to = 0; to < n; ++to) {
    const std::size_t i = order_[to];
    x_[to] = cells_[3 * i];
    y_[to] = cells_[3 * i + 1];
    z_[to] = cells_[3 * i + 2];
    if (radius_[i] != last_radius) {
      last_radius = radius_[i];
      scale = static_cast<float>(1.0 / last_radius);
    }
    scale_[to] = scale;
  }
  for (std::size_t b = bins; b > 0; --b) start_[b] = start_[b - 1];
  start_[0] = 0;
}

void BlobGrid::compare(bool comparable) {
  change_.balls.clear();
  change_.all = !comparable;
  if (!comparable) return;
  const auto reached = [](const double* centre, double radius) {
    return Ball{{centre[0], centre[1], centre[2]}, 1.001 * radius + 0.01};
  };
  const std::size_t n = radius_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double *now = &cells_[3 * i], *last = &last_cells_[3 * i];
    if (now[0] == last[0] && now[1] == last[1] && now[2] == last[2] && radius_[i] == last_radius_[i]) continue;
    change_.balls.push_back(reached(last, last_radius_[i]));
    change_.balls.push_back(reached(now, radius_[i]));
    if (4 * change_.balls.size() > n + 64) {  // looking at all is then cheaper
      change_.all = true;
      change_.balls.clear();
      return;
    }
  }
}

void BlobGrid::gather(const Cells& base, std::int64_t size, std::int64_t margin, BlobList& list) const {
  list.count = 0;
  const auto reach = static_cast<std::int64_t>(std::ceil(reach_)) + 1 + margin;
  Cells from{}, to{};
  for (std::size_t k = 0; k < 3; ++k) {
    from[k] = std::max<std::int64_t>(bin_at(base[k] - reach, shift_) - first_[k], 0);
    to[k] = std::min<std::int64_t>(bin_at(base[k] + size + reach, shift_) - first_[k], count_[k] - 1);
  }
  const BlobArrays all{x_.data(), y_.data(), z_.data(), scale_.data()};
  const std::array<double, 3> corner{static_cast<double>(base[0]), static_cast<double>(base[1]),
                                     static_cast<double>(base[2])};
  if (from[0] <= to[0]) {
    for (std::int64_t z = from[2]; z <= to[2]; ++z) {
      for (std::int64_t y = from[1]; y <= to[1]; ++y) {
        const auto row = static_cast<std::size_t>((z * count_[1] + y) * count_[0]);
        const std::size_t begin = start_[row + static_cast<std::size_t>(from[0])];
        const std::size_t end = start_[row + static_cast<std::size_t>(to[0]) + 1];
        if (begin < end) blobs::gather(all, begin, end, corner, static_cast<double>(size),
                                         static_cast<double>(margin), list);
      }
    }
  }
  list.pad();
}

}  // namespace supple::implicit::blobs
