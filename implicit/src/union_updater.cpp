#include <algorithm>
#include <tuple>
#include <utility>

#include "field_changes.h"
#include "grid_leaves.h"
#include "supple/core/error.h"

namespace supple::implicit {

using namespace gridding;
using lattice::before;

namespace {

bool before_box(const BlockBox& a, const BlockBox& b) { return std::tie(a.lower, a.upper) < std::tie(b.lower, b.upper); }

/// Calls use(box) for the boxes of a that b has not. @pre both sorted
template <class Use>
void for_others(const std::vector<BlockBox>& a, const std::vector<BlockBox>& b, const Use& use) {
  auto at = b.begin();
  for (const BlockBox& box : a) {
    at = std::lower_bound(at, b.end(), box, before_box);
    if (at == b.end() || before_box(box, *at)) use(box);
  }
}

}  // namespace

struct UnionUpdater::Impl {
  SurfaceGrid result;
  bool usable = false;
  GridOptions options;
  BlockList list;                      ///< of the last call; candidates are places among its bodies
  std::vector<std::uint64_t> version;  ///< of these
  std::vector<FieldChanges> changes;   ///< by place

  [[nodiscard]] float inside() const { return inside_value(options, 0.0F); }

  /// What may be in the band of each leaf, and boxes that are inside.
  static BlockList look_at(std::span<const UnitedBody> bodies, const BlockRange& range, const GridOptions& options, const Executor& executor) {
    const double width = band_of(options);
    BlockList found = band_leaves(range, options, static_cast<std::uint32_t>(bodies.size()), executor,
                                  [&](const Box& box, std::span<const std::uint32_t> candidates, std::vector<std::uint32_t>& left) {
                                    const std::size_t none = left.size();
                                    for (const std::uint32_t b : candidates) {
                                      const Verdict verdict = look(bodies[b].depth, width, box);
                                      if (verdict == Verdict::Inside) return verdict;
                                      if (verdict == Verdict::Keep) left.push_back(b);
                                    }
                                    return left.size() == none ? Verdict::Outside : Verdict::Keep;
                                  });
    std::sort(found.inside.begin(), found.inside.end(), before_box);
    return found;
  }

  /// A leaf by the bodies that may be in its band; the others are farther out than it reaches.
  static SampledLeaf sample(std::span<const UnitedBody> bodies, const BlockList& list, const GridOptions& options, std::size_t i) {
    std::vector<FieldView> near;
    for (std::uint32_t k = list.offset[i]; k < list.offset[i + 1]; ++k) near.push_back(bodies[list.candidate[k]].depth);
    if (near.size() == 1) return sample_leaf(near.front(), options, list.block[i]);
    return sample_leaf(UnitedField(std::move(near)), options, list.block[i]);
  }

  /// Sees what moved within bodies that are not what they were. @param known  the last call is there to compare with
  void find_changes(std::span<const UnitedBody> bodies, bool known) {
    if (!known) changes.clear();
    changes.resize(bodies.size());
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (bodies[b].field == nullptr) {
        changes[b].forget();
      } else if (!known || b >= version.size() || bodies[b].version != version[b]) {
        changes[b].update(bodies[b].field->index());
      }
    }
  }
  /// Whether the depth of a body is in a leaf what that of a body of the last call was, by their places.
  [[nodiscard]] bool stays(std::span<const UnitedBody> bodies, std::uint32_t now, std::uint32_t last, const Box& leaf) const {
    if (bodies[now].version == version[last]) return true;
    if (now != last || bodies[now].field == nullptr || changes[now].all()) return false;
    const auto& reaches = changes[now].reaches();
    return std::none_of(reaches.begin(), reaches.end(), [&](const Reach& reach) { return reach.whole.overlaps(leaf) && reach.meets(leaf); });
  }

  /// Leaves of `next` that are not as they were, and leaves of the last list that `next` has not.
  void compare(std::span<const UnitedBody> bodies, const BlockList& next, std::vector<std::size_t>& changed, std::vector<BlockCoord>& gone) const {
    const auto unchanged = [&](std::size_t i, std::size_t old) {
      const std::size_t count = next.offset[i + 1] - next.offset[i];
      if (count != list.offset[old + 1] - list.offset[old]) return false;
      const Box leaf = box_of(next.block[i], options.lattice);
      for (std::size_t k = 0; k < count; ++k) {
        if (!stays(bodies, next.candidate[next.offset[i] + k], list.candidate[list.offset[old] + k], leaf)) return false;
      }
      return true;
    };
    std::size_t old = 0;
    for (std::size_t i = 0; i < next.block.size(); ++i) {
      for (; old < list.block.size() && before(list.block[old], next.block[i]); ++old) gone.push_back(list.block[old]);
      const bool was = old < list.block.size() && !before(next.block[i], list.block[old]);
      if (!was || !unchanged(i, old)) changed.push_back(i);
      if (was) ++old;
    }
    gone.insert(gone.end(), list.block.begin() + static_cast<std::ptrdiff_t>(old), list.block.end());
  }

  void update(std::span<const UnitedBody> bodies, const BlockList& next, std::span<const std::size_t> changed, std::span<const BlockCoord> gone,
              const Executor& executor) const {
    std::vector<SampledLeaf> leaves(changed.size());
    executor.for_blocks(changed.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        leaves[i] = sample(bodies, next, options, changed[i]);
        if (leaves[i].leaf) set_beyond(*leaves[i].leaf, inside());
      }
    });
    openvdb::FloatTree& tree = result.impl_->grid->tree();
    // What was inside or in the band is outside but where `next` says otherwise.
    for_others(list.inside, next.inside, [&](const BlockBox& box) { fill(tree, box, -inside()); });
    for (const BlockCoord& block : gone) fill(tree, {block, block}, -inside());
    for_others(next.inside, list.inside, [&](const BlockBox& box) { fill(tree, box, inside()); });
    for (std::size_t i = 0; i < changed.size(); ++i) place(tree, next.block[changed[i]], leaves[i], inside());
    tree.prune();
  }
};

UnionUpdater::UnionUpdater() : impl_(std::make_unique<Impl>()) {}
UnionUpdater::~UnionUpdater() = default;
UnionUpdater::UnionUpdater(UnionUpdater&&) noexcept = default;
UnionUpdater& UnionUpdater::operator=(UnionUpdater&&) noexcept = default;

const SurfaceGrid& UnionUpdater::make(std::span<const UnitedBody> bodies, const GridOptions& options, const Executor& executor,
                                      GridCounts* counts) {
  SUPPLE_EXPECTS(options.content == GridContent::SignedDistance);
  SUPPLE_EXPECTS(options.half_width >= 1.0 && std::isfinite(options.half_width));
  Impl& self = *impl_;
  std::vector<FieldView> depths;
  for (const UnitedBody& body : bodies) depths.push_back(body.depth);
  const bool comparable = std::exchange(self.usable, false) && same(options, self.options);
  self.find_changes(bodies, comparable);
  BlockList next = Impl::look_at(bodies, range_of(UnitedField(std::move(depths)), options), options, executor);
  GridCounts count{.leaves_looked_at = next.block.size(), .leaves_sampled = next.block.size(), .whole = true};
  std::vector<std::size_t> changed;
  std::vector<BlockCoord> gone;
  if (comparable) {
    self.compare(bodies, next, changed, gone);
    count.whole = 2 * (changed.size() + gone.size()) >= std::max<std::size_t>(next.block.size(), 64);
  }
  if (count.whole) {
    MadeGrid made = make_whole(next, options, executor, [&](std::size_t i) { return Impl::sample(bodies, next, options, i); });
    self.result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(made.grid));
    self.options = options;
  } else {
    count.leaves_sampled = changed.size();
    executor.run([&] { self.update(bodies, next, changed, gone, executor); });
  }
  self.list = std::move(next);
  self.version.clear();
  for (const UnitedBody& body : bodies) self.version.push_back(body.version);
  self.usable = true;
  if (counts != nullptr) *counts = count;
  return self.result;
}

}  // namespace supple::implicit
