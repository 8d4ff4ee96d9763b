// What a neighbour list keeps: its particles and their images sorted by cell, staged rows and the lists.
#pragma once

#include <algorithm>
#include <functional>

#include "neighbours/packed_lanes.h"
#include "supple/core/neighbour_list.h"

namespace supple::core {

inline constexpr std::size_t kPointBlock = 4096;

struct NeighbourList::Impl {
  double range = 0.0;
  double skin = 0.0;
  std::optional<PeriodicBox> box;

  std::vector<Vec3> reference;  ///< State; everything below follows from it
  bool built = false;

  packed::CellGrid grid;
  std::vector<std::uint32_t> source;       ///< particle of each point, shape [points]
  std::vector<std::uint32_t> images;       ///< points that are images
  std::vector<Vec3> shift;                 ///< from the particle to the point; empty in open space
  /// Blocks of one colour touch no common point, so they can be worked on at the same time. Colours come one after
  /// the other: a point gets its pairs in the same order for every number of threads.
  static constexpr std::size_t kColours = 4;
  std::vector<packed::ListBlock> block;    ///< colour by colour
  std::array<std::size_t, kColours + 1> colour{};  ///< first block of each
  std::vector<packed::Row> position;       ///< of the points, and far away those that fill the batches of each block
  std::vector<packed::Row> normal;
  std::array<std::vector<packed::Row>, 4> ellipsoid;
  std::vector<packed::SingleRow> fixed;    ///< positions in quanta of `kQuanta` a reach
  std::vector<packed::SingleRow> single_normal;
  std::vector<packed::Row> force;          ///< sums of the points
  std::vector<packed::Row> turn;

  std::vector<packed::CellBlock> cells;    ///< of each block
  // Of the points before they are sorted: the particles, then their images.
  std::vector<std::uint32_t> cell;
  std::vector<std::uint32_t> order;        ///< which of them each sorted point is
  std::vector<Vec3> unsorted_shift;
  std::vector<std::uint32_t> image_source;
  std::vector<double> block_move2;

  [[nodiscard]] std::size_t blocks() const { return colour[kColours]; }
  void build(const Executor& executor);
  void stage(std::span<const Vec3> positions, const Executor& executor);
  void clear(std::vector<packed::Row>& rows, const Executor& executor) const;
  void stage_normals(std::span<const Vec3> normals, const Executor& executor);
  packed::Fixed stage_fixed(const Executor& executor);
  void stage_single_normals(std::span<const Vec3> normals, const Executor& executor);
  void stage_ellipsoids(const Vec3& radii2, const Vec3& softness, std::span<const Quat> orientations,
                        const Executor& executor);
  /// Calls use(block) for all lists, those of one colour in any order.
  template <class Use>
  void for_lists(const Executor& executor, const Use& use) const {
    for (std::size_t c = 0; c < kColours; ++c) {
      const auto body = [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) use(block[colour[c] + b]);
      };
      executor.for_blocks(colour[c + 1] - colour[c], 1, std::cref(body));
    }
  }
  /// Calls use(particle, point) for all points, those of one particle in one order.
  template <class Use>
  void for_points(const Executor& executor, const Use& use) const {
    const auto body = [&](std::size_t begin, std::size_t end) {
      for (std::size_t p = begin; p < end; ++p) {
        if (grid.image[p] == 0) use(source[p], p);
      }
    };
    executor.for_blocks(source.size(), kPointBlock, std::cref(body));
    for (const std::uint32_t p : images) use(source[p], p);
  }

 private:
  void find_points(const Executor& executor);
  void sort_points(const Executor& executor);
  void lay_blocks();
  Vec3 origin, inverse_edge;                       ///< of the cells that hold particles
  std::array<std::uint32_t, 3> inner{};            ///< how many of those there are
};

}  // namespace supple::core
