#include "mesh/cubes/march_leaves.h"

#include <algorithm>
#include <cmath>

#include "mesh/cubes/march_tiles.h"
#include "supple/implicit/field.h"

namespace supple::implicit::march {

namespace {

template <class Use>
void for_range(const lattice::BlockRange& range, const Use& use) {
  for (std::int32_t z = range.lower[2]; z <= range.upper[2]; ++z) {
    for (std::int32_t y = range.lower[1]; y <= range.upper[1]; ++y) {
      for (std::int32_t x = range.lower[0]; x <= range.upper[0]; ++x) use(BlockCoord{x, y, z});
    }
  }
}

bool same(const Lattice& a, const Lattice& b) { return a.origin == b.origin && a.cell == b.cell; }

Box nodes_box(const blobs::Cells& lower, int edge, const Lattice& lattice) {
  return {lattice::node_position(lattice, lower[0], lower[1], lower[2]),
          lattice::node_position(lattice, lower[0] + edge, lower[1] + edge, lower[2] + edge)};
}

blobs::Cells first_node(const BlockCoord& leaf) {
  return {std::int64_t{kLeafNodes} * leaf[0], std::int64_t{kLeafNodes} * leaf[1], std::int64_t{kLeafNodes} * leaf[2]};
}

}  // namespace

Box leaf_box(const BlockCoord& leaf, const Lattice& lattice) { return nodes_box(first_node(leaf), kLeafNodes, lattice); }

bool may_meet(std::span<const Reach> reaches, const Box& box) {
  constexpr std::size_t kMany = 256;
  return reaches.size() > kMany || std::any_of(reaches.begin(), reaches.end(), [&](const Reach& reach) { return reach.meets(box); });
}

void ChangedTiles::reset(const lattice::BlockRange& range) {
  range_ = range;
  tiles_.assign(range.count(), 0);
}

std::size_t ChangedTiles::index(const BlockCoord& leaf) const {
  const auto along = [&](std::size_t k) { return static_cast<std::size_t>(leaf[k] - range_.lower[k]); };
  const auto count = [&](std::size_t k) { return static_cast<std::size_t>(range_.upper[k] - range_.lower[k] + 1); };
  return (along(2) * count(1) + along(1)) * count(0) + along(0);
}

std::pair<double, double> ChangedTiles::along(std::size_t k, const Box& box, const Lattice& lattice) {
  const auto axis = static_cast<Eigen::Index>(k);
  // One cell more on each side, for round-off and because boxes are closed.
  return {std::floor(((box.lower[axis] - lattice.origin[axis]) / lattice.cell - 1.0) / kLeafNodes),
          std::floor(((box.upper[axis] - lattice.origin[axis]) / lattice.cell + 1.0) / kLeafNodes)};
}

bool ChangedTiles::covers(const Box& box, const Lattice& lattice) const {
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = along(k, box, lattice);
    if (!(low >= range_.lower[k] && high <= range_.upper[k])) return false;
  }
  return true;
}

lattice::BlockRange ChangedTiles::around(const Box& box, const Lattice& lattice) const {
  lattice::BlockRange found;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = along(k, box, lattice);
    found.lower[k] = static_cast<std::int32_t>(std::clamp<double>(low, range_.lower[k], range_.upper[k] + 1.0));
    found.upper[k] = static_cast<std::int32_t>(std::clamp<double>(high, range_.lower[k] - 1.0, range_.upper[k]));
  }
  return found;
}

void ChangedTiles::add(const Reach& reach, const Lattice& lattice) {
  for_range(around(reach.whole, lattice), [&](const BlockCoord& leaf) {
    std::uint8_t& tiles = tiles_[index(leaf)];
    if (tiles == 0xff || !reach.meets(leaf_box(leaf, lattice))) return;
    const blobs::Cells first = first_node(leaf);
    for (unsigned t = 0; t < 8; ++t) {
      const blobs::Cells at{first[0] + blobs::kTile * (t & 1u), first[1] + blobs::kTile * (t >> 1 & 1u), first[2] + blobs::kTile * (t >> 2)};
      if (reach.meets(nodes_box(at, blobs::kTile, lattice))) tiles = static_cast<std::uint8_t>(tiles | 1u << t);
    }
  });
}

std::uint8_t ChangedTiles::operator[](const BlockCoord& leaf) const {
  for (std::size_t k = 0; k < 3; ++k) {
    if (leaf[k] < range_.lower[k] || leaf[k] > range_.upper[k]) return 0;
  }
  return tiles_[index(leaf)];
}

bool ChangedTiles::meets(const Box& box, const Lattice& lattice) const {
  bool found = false;
  for_range(around(box, lattice), [&](const BlockCoord& leaf) { found = found || tiles_[index(leaf)] != 0; });
  return found;
}

std::vector<BlockCoord> ChangedTiles::leaves() const {
  std::vector<BlockCoord> found;
  std::size_t i = 0;
  for_range(range_, [&](const BlockCoord& leaf) {
    if (tiles_[i++] != 0) found.push_back(leaf);
  });
  return found;
}

void ViewMemory::compare(const FieldView& field, const Lattice& now) {
  all = true;
  const Field* made = field.as_field();
  if (made == nullptr) {
    forget();
    return;
  }
  changes.update(made->index());
  const bool moved = !same(lattice, now);
  lattice = now;
  const Box surface = field.surface_box();
  if (changes.all() || moved || surface.empty()) return;
  lattice::BlockRange range = lattice::block_range(surface, now, 1);
  for (const BlockCoord& held : leaf) {
    for (std::size_t k = 0; k < 3; ++k) {
      range.lower[k] = std::min(range.lower[k], held[k]);
      range.upper[k] = std::max(range.upper[k], held[k]);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {  // the values next to the surface are included
    --range.lower[k];
    ++range.upper[k];
  }
  if (range.count() > kMostLeaves) return;
  changed.reset(range);
  for (const Reach& reach : changes.reaches()) changed.add(reach, now);
  all = false;
}

}  // namespace supple::implicit::march
