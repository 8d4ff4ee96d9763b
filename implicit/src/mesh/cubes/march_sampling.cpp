#include "mesh/cubes/march_sampling.h"

#include <cmath>
#include <string>

#include "field/field_index.h"
#include "mesh/cubes/march_changes.h"
#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit::march {

using blobs::Cells;
using blobs::kTileNodes;

std::unique_ptr<Sampler> make_sampler(const FieldView& field, const Lattice& lattice, bool skip, SamplerMemory& memory) {
  SUPPLE_EXPECTS(std::isfinite(lattice.cell) && lattice.cell > 0.0 && lattice.origin.allFinite());
  if (const Field* points = field.as_field()) {
    const Field::Index& index = points->packed();
    if (index.size() > 0 && index.uniform && index.primitive[0].kind == PackedKind::PointWyvill && !index.blend.active()) {
      return make_blob_sampler(*points, lattice, skip, memory.grid);
    }
  }
  return make_view_sampler(field, lattice, memory.view);
}

float value_at(const BlockTable& table, const Block& block, int x, int y, int z) {
  const Block* owner = &block;
  if (((x | y | z) & kBlockNodes) != 0) {
    owner = table.find({block.coord[0] + (x >> 4), block.coord[1] + (y >> 4), block.coord[2] + (z >> 4)});
    if (owner == nullptr) return 0.0F;
  }
  const auto tile = static_cast<unsigned>((x >> 2 & 3) | (y & 12) | (z & 12) << 2);
  if ((owner->held >> tile & 1u) == 0) return 0.0F;
  return owner->values[kTileNodes * owner->rank(tile) + static_cast<std::size_t>((x & 3) | (y & 3) << 2 | (z & 3) << 4)];
}

namespace {

[[noreturn]] void refuse(const std::string& expected, const std::string& found, double factor, const Lattice& lattice) {
  throw Error(ErrorKind::Limit, {.place = "",
                                 .key = "lattice.cell",
                                 .expected = expected,
                                 .found = found + " with cells of " + lattice::three_digits(lattice.cell) + " m",
                                 .hint = "use cells of at least " + lattice::three_digits(1.05 * factor * lattice.cell) + " m"});
}

}  // namespace

void expect_near_nodes(double far, const Lattice& lattice) {
  constexpr double kLargestNode = 1 << 30;
  if (far <= kLargestNode) return;
  refuse("expected node numbers up to " + lattice::three_digits(kLargestNode), lattice::three_digits(far), far / kLargestNode, lattice);
}

void expect_nodes(const Cells& lower, const Cells& upper, const Lattice& lattice) {
  double nodes = 1.0;
  double far = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    nodes *= static_cast<double>(upper[k] - lower[k] + 1);
    far = std::max({far, std::abs(static_cast<double>(lower[k])), std::abs(static_cast<double>(upper[k]))});
  }
  expect_near_nodes(far, lattice);
  if (nodes > static_cast<double>(kMarchNodes)) {
    refuse("expected at most " + std::to_string(kMarchNodes) + " lattice nodes around the body", "about " + lattice::three_digits(nodes),
           std::cbrt(nodes / static_cast<double>(kMarchNodes)), lattice);
  }
}

void lay_out(BlockTable& table, const Cells& lower, const Cells& upper, const Lattice& lattice) {
  expect_nodes(lower, upper, lattice);
  std::size_t blocks = 1;
  BlockCoord first{}, count{};
  for (std::size_t k = 0; k < 3; ++k) {
    first[k] = static_cast<std::int32_t>(lower[k] >> 4);
    count[k] = static_cast<std::int32_t>(upper[k] >> 4) - first[k] + 1;
    blocks *= static_cast<std::size_t>(count[k]);
  }
  if (first == table.lower && count == table.count) return;
  BlockTable old;
  std::swap(old, table);
  table.lower = first;
  table.count = count;
  table.block.assign(blocks, Block{});
  table.touched.assign(blocks, 1);
  table.holds.assign(blocks, 0);
  table.blank.assign(blocks, 1);
  std::size_t b = 0;
  for (std::int32_t z = 0; z < table.count[2]; ++z) {
    for (std::int32_t y = 0; y < table.count[1]; ++y) {
      for (std::int32_t x = 0; x < table.count[0]; ++x) {
        const BlockCoord coord{table.lower[0] + x, table.lower[1] + y, table.lower[2] + z};
        if (old.find(coord) != nullptr) {
          table.block[b] = std::move(old.block[old.index(coord)]);
          table.blank[b] = old.blank[old.index(coord)];
        }
        table.block[b].coord = coord;
        table.holds[b] = table.block[b].uniform() ? 0 : 1;
        table.held.tiles += table.block[b].counted.tiles;
        table.held.bytes += table.block[b++].counted.bytes;
      }
    }
  }
}

}  // namespace supple::implicit::march
