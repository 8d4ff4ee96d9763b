#include <algorithm>
#include <unordered_map>

#include "field_index.h"
#include "grid_leaves.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"

namespace supple::implicit {

using namespace gridding;
using lattice::before;
using lattice::block_range;
using openvdb::FloatTree;

namespace {

/// All that the values near a primitive depend on, by a hash for what is more than a point.
struct PrimitiveKey {
  std::array<double, 3> position{};
  double inverse_r2 = 0.0;
  std::uint64_t rest = 0;
  bool operator==(const PrimitiveKey&) const = default;
};

PrimitiveKey key_of(const Field::Index& index, std::size_t id) {
  const PackedPrimitive& p = index.primitive[id];
  PrimitiveKey key{p.position, p.inverse_r2, p.part};
  if (p.kind == PackedKind::PointWyvill) return key;
  const PackedShape& shape = index.shape[id];
  Hasher hasher;
  hasher.add(std::uint64_t{p.part});
  hasher.add(std::span<const double>(shape.to_local));
  hasher.add(std::span<const double>(shape.half));
  const Kernel& k = shape.kernel;
  hasher.add(static_cast<std::uint64_t>(k.kind));
  for (const double x : {k.radius, k.thickness, k.slope, k.iso, k.shape}) hasher.add(x);
  const ShapeView& v = shape.view;
  hasher.add(static_cast<std::uint64_t>(v.kind));
  hasher.add(std::span<const Vec3>(&v.size, 1));
  for (const double x : {v.radius, v.taper, v.pair[0], v.pair[1], v.gain}) hasher.add(x);
  hasher.add(v.control);
  key.rest = hasher.value();
  return key;
}

struct BlockHash {
  std::size_t operator()(const BlockCoord& b) const {
    return static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span<const std::int32_t>(b))));
  }
};

bool same(const BlockRange& a, const BlockRange& b) { return a.lower == b.lower && a.upper == b.upper; }

}  // namespace

struct GridUpdater::Impl {
  SurfaceGrid result;
  bool usable = false;
  GridOptions options;
  BlockRange range;
  double iso = 0.0;
  BlendIndex blend;
  std::vector<PrimitiveKey> key, next_key;
  std::vector<Box> support;
  float inside = 0.0F;
  std::unordered_map<BlockCoord, float, BlockHash> largest;  ///< |value| by leaf, for GridContent::Field
  std::vector<BlockCoord> touched;
  std::vector<SampledLeaf> sampled;

  /// Blocks of the range that a box reaches.
  void touch(const Box& box) {
    const BlockRange reached = block_range(box, options.lattice, 1);
    for (std::int32_t z = std::max(reached.lower[2], range.lower[2]); z <= std::min(reached.upper[2], range.upper[2]); ++z) {
      for (std::int32_t y = std::max(reached.lower[1], range.lower[1]); y <= std::min(reached.upper[1], range.upper[1]); ++y) {
        for (std::int32_t x = std::max(reached.lower[0], range.lower[0]); x <= std::min(reached.upper[0], range.upper[0]); ++x) {
          touched.push_back({x, y, z});
        }
      }
    }
  }

  /// Lists the blocks that may be different. @return false where everything may be
  bool list_touched(const Field::Index& index, const std::vector<Box>& boxes) {
    touched.clear();
    if (key.size() != next_key.size()) return false;
    for (std::size_t i = 0; i < key.size(); ++i) {
      if (key[i] == next_key[i]) continue;
      touch(support[i]);
      touch(boxes[i]);
      if (touched.size() > 64 * (index.size() + 4096)) drop_repeats();
    }
    drop_repeats();
    return 2 * touched.size() < std::max<std::size_t>(result.impl_->grid->tree().leafCount(), 64);
  }
  void drop_repeats() {
    std::sort(touched.begin(), touched.end(), before);
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  }

  /// @return false when the largest value is another one
  bool update(const FieldView& field, const Executor& executor, GridCounts& counts) {
    const double width = band_of(options);
    sampled.clear();
    sampled.resize(touched.size());
    std::vector<Verdict> verdict(touched.size());
    executor.for_blocks(touched.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const BlockCoord& b = touched[i];
        verdict[i] = look(field, width, box_of(b, options.lattice));
        if (verdict[i] == Verdict::Keep) {
          sampled[i] = sample_leaf(field, options, b);
        } else {
          sampled[i].inside = verdict[i] == Verdict::Inside;
        }
      }
    });
    counts.leaves_looked_at = touched.size();
    counts.leaves_sampled = static_cast<std::uint64_t>(std::count(verdict.begin(), verdict.end(), Verdict::Keep));
    if (options.content == GridContent::Field) {
      for (std::size_t i = 0; i < touched.size(); ++i) {
        if (sampled[i].leaf) {
          largest[touched[i]] = sampled[i].largest;
        } else {
          largest.erase(touched[i]);
        }
      }
      float most = 0.0F;
      for (const auto& [block, value] : largest) most = std::max(most, value);
      if (inside_value(options, most) != inside) return false;
    }
    FloatTree& tree = result.impl_->grid->tree();
    for (std::size_t i = 0; i < touched.size(); ++i) {
      if (sampled[i].leaf) set_beyond(*sampled[i].leaf, inside);
      place(tree, touched[i], sampled[i], inside);
    }
    tree.prune();
    return true;
  }
};

GridUpdater::GridUpdater() : impl_(std::make_unique<Impl>()) {}
GridUpdater::~GridUpdater() = default;
GridUpdater::GridUpdater(GridUpdater&&) noexcept = default;
GridUpdater& GridUpdater::operator=(GridUpdater&&) noexcept = default;

const SurfaceGrid& GridUpdater::make(const Field& field, const GridOptions& options, const Executor& executor,
                                     GridCounts* counts) {
  Impl& self = *impl_;
  const Field::Index& index = field.index();
  GridCounts count;
  self.next_key.resize(index.size());
  for (std::size_t i = 0; i < index.size(); ++i) self.next_key[i] = key_of(index, i);
  const BlockRange range = range_of(field, options);
  const bool comparable = self.usable && same(options, self.options) && index.iso == self.iso &&
                          index.blend == self.blend && same(range, self.range);
  self.usable = false;
  bool done = false;
  if (comparable && self.list_touched(index, index.support)) {
    executor.run([&] { done = self.update(field, executor, count); });
  }
  if (!done) {
    MadeGrid made = make_whole(field, options, executor);
    count = {.leaves_looked_at = made.looked_at, .leaves_sampled = made.looked_at, .whole = true};
    self.result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(made.grid));
    self.inside = made.inside;
    self.largest.clear();
    if (options.content == GridContent::Field) self.largest.insert(made.largest.begin(), made.largest.end());
    self.options = options;
    self.range = range;
    self.iso = index.iso;
    self.blend = index.blend;
  }
  self.key.swap(self.next_key);
  self.support = index.support;
  self.usable = true;
  if (counts != nullptr) *counts = count;
  return self.result;
}

}  // namespace supple::implicit
