/// @file blob_grid.h
/// Wyvill points sorted into bins of lattice cells, so that those near a box are a few runs of the arrays. The order is
/// by bin and within a bin by id; bins lie on the lattice, so blobs that stay keep their order when others move.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "blob_lanes.h"
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
  /// What is different from the last build: everything, or what supports left and entered.
  struct Change {
    bool all = true;
    std::vector<Ball> balls;
  };
  /// @pre all primitives are Wyvill points
  void build(std::span<const PackedPrimitive> primitives, const Lattice& lattice);
  [[nodiscard]] const Change& change() const noexcept { return change_; }
  /// The next build has no last one.
  void forget() { radius_.clear(); }
  [[nodiscard]] std::size_t size() const noexcept { return scale_.empty() ? 0 : scale_.size() - kLanes; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (x_.capacity() + y_.capacity() + z_.capacity() + cells_.capacity() + last_cells_.capacity() +
            radius_.capacity() + last_radius_.capacity()) * sizeof(double) +
           scale_.capacity() * sizeof(float) + (start_.capacity() + bin_of_.capacity() + order_.capacity()) * sizeof(std::uint32_t);
  }
  /// Largest R [cells].
  [[nodiscard]] double reach() const noexcept { return reach_; }
  /// Cells that the supports reach.
  [[nodiscard]] const CellBox& support() const noexcept { return support_; }
  /// Edge of a bin [cells].
  [[nodiscard]] std::int64_t bin() const noexcept { return std::int64_t{1} << shift_; }

  /// Blobs whose support may meet the cube of `size` cells above `base`, wider by `margin`; in the frame of `base`.
  void gather(const Cells& base, std::int64_t size, std::int64_t margin, BlobList& list) const;
  /// Calls use(box) for each bin that holds blobs, with the cells that their centres lie in.
  template <class Use>
  void for_bins(const Use& use) const {
    std::size_t b = 0;
    for (std::int64_t z = 0; z < count_[2]; ++z) {
      for (std::int64_t y = 0; y < count_[1]; ++y) {
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
  std::vector<std::uint32_t> start_;  ///< blobs of bin b are [start_[b], start_[b + 1])
  std::vector<double> x_, y_, z_;     ///< [cells]
  std::vector<float> scale_;          ///< cell / R
  std::vector<std::uint32_t> bin_of_, order_;
  std::vector<double> cells_, last_cells_;    ///< centres by id, of this build and the last
  std::vector<double> radius_, last_radius_;  ///< R [cells] by id
  Lattice lattice_;
  Change change_;

  void compare(bool comparable);
};

}  // namespace supple::implicit::blobs
