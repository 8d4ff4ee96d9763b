#include <algorithm>
#include <utility>

#include "field/field_changes.h"
#include "grid/grid_leaves.h"
#include "supple/core/error.h"

namespace supple::implicit {

using namespace gridding;
using lattice::before;
using lattice::block_range;
using openvdb::FloatTree;

namespace {

/// Larger ranges are rebuilt: their differences would be too many blocks to test.
constexpr std::uint64_t kMostBlocksKept = 100'000'000;

bool holds(const BlockRange& range, const BlockCoord& block) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (block[k] < range.lower[k] || block[k] > range.upper[k]) return false;
  }
  return true;
}

}  // namespace

struct GridUpdater::Impl {
  SurfaceGrid result;
  bool usable = false;
  bool thin = false;
  GridOptions options;
  BlockRange range;
  FieldChanges changes;
  float inside = 0.0F;
  LargestValues largest;  // with GridContent::Field
  std::vector<BlockCoord> touched;
  std::vector<SampledLeaf> sampled;

  void touch(const BlockRange& blocks) {
    for (std::int32_t z = blocks.lower[2]; z <= blocks.upper[2]; ++z) {
      for (std::int32_t y = blocks.lower[1]; y <= blocks.upper[1]; ++y) {
        for (std::int32_t x = blocks.lower[0]; x <= blocks.upper[0]; ++x) touched.push_back({x, y, z});
      }
    }
  }
  /// Blocks of the range that a box reaches.
  void touch(const Box& box) {
    BlockRange reached = block_range(box, options.lattice, 1);
    for (std::size_t k = 0; k < 3; ++k) {
      reached.lower[k] = std::max(reached.lower[k], range.lower[k]);
      reached.upper[k] = std::min(reached.upper[k], range.upper[k]);
    }
    touch(reached);
  }
  /// Blocks of a that are not in b, side by side.
  void touch_others(BlockRange a, const BlockRange& b) {
    if (b.empty()) return touch(a);
    for (std::size_t k = 0; k < 3 && !a.empty(); ++k) {
      BlockRange below = a, above = a;
      below.upper[k] = std::min(a.upper[k], b.lower[k] - 1);
      above.lower[k] = std::max(a.lower[k], b.upper[k] + 1);
      if (!below.empty()) touch(below);
      if (!above.empty() && above.lower[k] > below.upper[k]) touch(above);
      a.lower[k] = std::max(a.lower[k], b.lower[k]);
      a.upper[k] = std::min(a.upper[k], b.upper[k]);
    }
  }

  /// Lists the blocks that may be different. @param last  the range of the last call   @return false where too many are
  bool list_touched(const BlockRange& last) {
    const std::size_t most = std::max<std::size_t>(result.impl_->grid->tree().leafCount(), 64) / 2;
    touched.clear();
    if (changes.all() || last.count() + range.count() > kMostBlocksKept) return false;
    touch_others(last, range);
    touch_others(range, last);
    for (const Reach& reach : changes.reaches()) {
      touch(reach.whole);
      if (touched.size() > 64 * (most + 4096)) drop_repeats();
    }
    drop_repeats();
    return touched.size() < most;
  }
  void drop_repeats() {
    std::sort(touched.begin(), touched.end(), before);
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  }

  void update(const FieldView& field, const Executor& executor, GridCounts& counts) {
    sampled.clear();
    sampled.resize(touched.size());
    std::vector<Verdict> verdict(touched.size());
    executor.for_blocks(touched.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const BlockCoord& b = touched[i];
        verdict[i] = holds(range, b) ? look(field, options, thin, box_of(b, options.lattice)) : Verdict::Outside;
        if (verdict[i] == Verdict::Keep) {
          sampled[i] = sample_leaf(field, options, thin, b);
        } else {
          sampled[i].inside = verdict[i] == Verdict::Inside;
        }
      }
    });
    counts.leaves_looked_at = touched.size();
    counts.leaves_sampled = static_cast<std::uint64_t>(std::count(verdict.begin(), verdict.end(), Verdict::Keep));
    FloatTree& tree = result.impl_->grid->tree();
    if (options.content == GridContent::Field) {
      for (std::size_t i = 0; i < touched.size(); ++i) largest.set(touched[i], sampled[i]);
      if (const float now = inside_value(options, largest.of_all()); now != inside) change_beyond(tree, inside = now);
    }
    for (std::size_t i = 0; i < touched.size(); ++i) {
      if (sampled[i].leaf) set_beyond(*sampled[i].leaf, inside);
      place(tree, touched[i], sampled[i], inside);
    }
    tree.prune();
  }
};

GridUpdater::GridUpdater() : impl_(std::make_unique<Impl>()) {}
GridUpdater::~GridUpdater() = default;
GridUpdater::GridUpdater(GridUpdater&&) noexcept = default;
GridUpdater& GridUpdater::operator=(GridUpdater&&) noexcept = default;

const SurfaceGrid& GridUpdater::make(const Field& field, const GridOptions& options, const Executor& executor,
                                     GridCounts* counts) {
  Impl& self = *impl_;
  GridCounts count;
  const bool thin = is_thin(field, options);
  const bool comparable = std::exchange(self.usable, false) && same(options, self.options) && thin == self.thin;
  self.thin = thin;
  self.changes.update(field.index());
  const BlockRange last = std::exchange(self.range, range_of(field, options));
  if (comparable && self.list_touched(last)) {
    executor.run([&] { self.update(field, executor, count); });
  } else {
    MadeGrid made = make_whole(field, options, executor);
    count = {.leaves_looked_at = made.looked_at, .leaves_sampled = made.looked_at, .whole = true};
    self.result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(made.grid));
    self.inside = made.inside;
    self.largest.reset(made.largest);
    self.options = options;
  }
  self.usable = true;
  if (counts != nullptr) *counts = count;
  return self.result;
}

}  // namespace supple::implicit
