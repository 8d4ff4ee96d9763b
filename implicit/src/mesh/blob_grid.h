/// @file blob_grid.h
/// Wyvill points sorted into bins of lattice cells, so that those near a box are a few runs of the arrays. The order is
/// by bin and within a bin by id; bins lie on the lattice, so blobs that stay keep their order when others move. Behind each row
/// of bins is some room, so that a few blobs that move are put where they belong.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/blob_lanes.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
struct PackedPrimitive;
}

namespace supple::implicit::blobs {

using Cells = std::array<std::int64_t, 3>;

/// Inclusive box of lattice cells; empty when an upper is below its lower.
struct CellBox {
  Cells lower{0, 0, 0};
  Cells upper{-1, -1, -1};
  [[nodiscard]] bool empty() const {
    return upper[0] < lower[0] || upper[1] < lower[1] || upper[2] < lower[2];
  }
};

class BlobGrid {
 public:
  /// A support, a little wider than what the search for blobs near a box lets through [cells].
  struct Ball {
    std::array<double, 3> centre;
    double radius;
  };
  /// Changes since the last build: everything, or the regions that supports left and entered.
  struct Change {
    bool all = true;
    std::vector<Ball> balls;
  };
  /// @pre all primitives are Wyvill points
  void build(std::span<const PackedPrimitive> primitives, const Lattice& lattice);
  [[nodiscard]] const Change& change() const noexcept { return change_; }
  /// The next build has no last one.
  void forget() { forgotten_ = true; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (x_.capacity() + y_.capacity() + z_.capacity()) * sizeof(double) + last_.capacity() * sizeof(last_[0]) +
           scale_.capacity() * sizeof(float) +
           (start_.capacity() + next_.capacity() + bin_of_.capacity() + order_.capacity()) * sizeof(std::uint32_t);
  }
  /// Largest R [cells].
  [[nodiscard]] double reach() const noexcept { return reach_; }
  /// Cells that the supports reach.
  [[nodiscard]] const CellBox& support() const noexcept { return support_; }
  /// Edge of a bin [cells].
  [[nodiscard]] std::int64_t bin() const noexcept { return std::int64_t{1} << shift_; }

  /// Blobs whose support may meet the cube of `size` cells above `base`, wider by `margin`; in the frame of `base`.
  /// @param far  as in blobs::gather
  void gather(const Cells& base, std::int64_t size, std::int64_t margin, BlobList& list, BlobList* far = nullptr) const;
  /// The blobs around the cubes of `size` cells that stand between `base` and `height` cells above it.
  struct Column {
    std::int64_t first_layer = 0;  ///< of bins
    Cells base{};
    BlobColumn blobs;
  };
  void gather_column(const Cells& base, std::int64_t size, std::int64_t height, Column& column) const;
  /// As above, for a cube of a column that contains it, without a margin.
  void gather(const Column& column, const Cells& base, std::int64_t size, BlobList& list, BlobList* far = nullptr) const;
  /// Calls use(box) for each bin with blobs, with the cells of their centres.
  template <class Use>
  void for_bins(const Use& use) const {
    std::size_t b = 0;
    for (std::int64_t z = 0; z < count_[2]; ++z) {
      for (std::int64_t y = 0; y < count_[1]; ++y, ++b) {
        for (std::int64_t x = 0; x < count_[0]; ++x, ++b) {
          if (start_[b] == start_[b + 1]) continue;
          const Cells low{bin() * (first_[0] + x), bin() * (first_[1] + y), bin() * (first_[2] + z)};
          use(CellBox{low, {low[0] + bin() - 1, low[1] + bin() - 1, low[2] + bin() - 1}});
        }
      }
    }
  }

 private:
  int shift_ = 3;            ///< a bin has 2^shift cells along its edge
  Cells first_{}, count_{};  ///< lowest bin, bins along each axis
  double reach_ = 0.0;
  CellBox support_;
  /// Blobs of bin b are [start_[b], start_[b + 1]); each row of bins ends with one for its room.
  std::vector<std::uint32_t> start_, next_;
  std::vector<double> x_, y_, z_;     ///< [cells]
  std::vector<float> scale_;          ///< cell / R
  std::vector<std::uint32_t> bin_of_, order_;  ///< bin by id, id by place
  struct alignas(32) Source {
    std::array<double, 3> position;
    double inverse_r2;
  };
  std::vector<Source> last_;          ///< input of the last build
  bool forgotten_ = false;
  std::vector<std::uint32_t> moved_;  ///< ids
  Lattice lattice_;
  double per_cell_ = 0.0;
  double inverse_r2_ = 0.0, radius_ = 0.0;  ///< the one looked up last, and its R [cells]
  float radius_scale_ = 0.0F;               ///< 1 / R
  Change change_;

  [[nodiscard]] std::uint32_t row_length() const { return static_cast<std::uint32_t>(count_[0]) + 1; }
  [[nodiscard]] std::array<double, 3> centre_of(const Source& blob) const {
    const auto& [x, y, z] = blob.position;
    return {(x - lattice_.origin.x()) * per_cell_, (y - lattice_.origin.y()) * per_cell_, (z - lattice_.origin.z()) * per_cell_};
  }
  [[nodiscard]] std::uint32_t bin_of(const Source& blob) const {
    const std::array<double, 3> centre = centre_of(blob);
    std::array<std::int64_t, 3> at{};
    for (std::size_t k = 0; k < 3; ++k) at[k] = (static_cast<std::int64_t>(std::floor(centre[k])) >> shift_) - first_[k];
    return static_cast<std::uint32_t>((at[2] * count_[1] + at[1]) * row_length() + at[0]);
  }
  void look_up_radius(double inverse_r2) {
    if (inverse_r2 == inverse_r2_) return;  // mostly all are equal
    inverse_r2_ = inverse_r2;
    radius_ = per_cell_ / std::sqrt(inverse_r2);
    radius_scale_ = static_cast<float>(1.0 / radius_);
  }
  void put(std::size_t place, std::uint32_t id) {
    const Source& blob = last_[id];
    look_up_radius(blob.inverse_r2);
    const std::array<double, 3> centre = centre_of(blob);
    order_[place] = id;
    x_[place] = centre[0];
    y_[place] = centre[1];
    z_[place] = centre[2];
    scale_[place] = radius_scale_;
  }
  /// Inclusive, from the lowest bin.
  struct BinRange {
    Cells from{}, to{};
  };
  /// Bins of the blobs whose support may meet a box, wider by `margin`; none where from > to.
  [[nodiscard]] BinRange bins_near(const Cells& base, const Cells& size, std::int64_t margin) const;
  /// The blobs of a layer of these, row by row.
  void add_runs(const BinRange& bins, std::int64_t layer, std::vector<BlobRun>& runs) const;
  void sort_all();
  [[nodiscard]] bool sort_moved();
};

}  // namespace supple::implicit::blobs
