#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "field/field_changes.h"
#include "grid/grid_leaves.h"
#include "supple/core/error.h"

namespace supple::implicit {

using namespace gridding;
using lattice::before;

namespace {

bool before_box(const BlockBox& a, const BlockBox& b) { return std::tie(a.lower, a.upper) < std::tie(b.lower, b.upper); }

/// Calls use(box) for the boxes of a that are not in b. @pre both sorted
template <class Use>
void for_others(const std::vector<BlockBox>& a, const std::vector<BlockBox>& b, const Use& use) {
  auto at = b.begin();
  for (const BlockBox& box : a) {
    at = std::lower_bound(at, b.end(), box, before_box);
    if (at == b.end() || before_box(box, *at)) use(box);
  }
}

/// Leaves that may contain some of the band.
struct LeafList : BlockList {
  std::vector<std::optional<double>> constant;  ///< by candidate: its value, where that is the same in the whole leaf; with GridContent::Field
};

/// Of depths, each of slope 1: those in whose band a box may be.
Verdict look_at_depths(std::span<const UnitedBody> bodies, const GridOptions& options, bool thin, const Box& box,
                       std::span<const std::uint32_t> candidates, std::vector<std::uint32_t>& left) {
  const std::size_t none = left.size();
  for (const std::uint32_t b : candidates) {
    const Verdict verdict = look(bodies[b].view, options, thin, box);
    if (verdict == Verdict::Inside) return verdict;
    if (verdict == Verdict::Keep) left.push_back(b);
  }
  return left.size() == none ? Verdict::Outside : Verdict::Keep;
}

/// Selects the fields that may be the largest somewhere in a box. A field that is constant there, as all are beyond their supports, may
/// be the largest at any distance; the first of equal fields represents them.
Verdict look_at_fields(std::span<const UnitedBody> bodies, double width, const Box& box, std::span<const std::uint32_t> candidates,
                       std::vector<std::uint32_t>& left) {
  thread_local std::vector<Interval> value;
  value.clear();
  double least = -std::numeric_limits<double>::infinity(), most = least, slope = 0.0;
  for (const std::uint32_t b : candidates) {
    value.push_back(bodies[b].view.bound(box));
    least = std::max(least, value.back().lower);
  }
  bool constant = false;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    if (value[k].upper < least) continue;
    most = std::max(most, value[k].upper);
    if (value[k].lower == value[k].upper && std::exchange(constant, true)) continue;
    left.push_back(candidates[k]);
    slope = std::max(slope, bodies[candidates[k]].view.gradient_bound(box));
  }
  if (least > width * slope) return Verdict::Inside;
  return most < -width * slope ? Verdict::Outside : Verdict::Keep;
}

LeafList look_at(std::span<const UnitedBody> bodies, const BlockRange& range, const GridOptions& options, bool thin, const Executor& executor) {
  const bool depths = options.content == GridContent::SignedDistance;
  const double beside = thin ? options.lattice.cell : 0.0, width = band_of(options);
  LeafList found{band_leaves(range, options, static_cast<std::uint32_t>(bodies.size()), executor,
                             [&](const Box& box, std::span<const std::uint32_t> candidates, std::vector<std::uint32_t>& left) {
                               return depths ? look_at_depths(bodies, options, thin, box, candidates, left)
                                             : look_at_fields(bodies, width, box.inflated(beside), candidates, left);
                             }),
                 {}};
  std::sort(found.inside.begin(), found.inside.end(), before_box);
  found.constant.resize(found.candidate.size());
  if (depths) return found;
  executor.for_blocks(found.block.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Box leaf = box_of(found.block[i], options.lattice).inflated(beside);
      for (std::size_t k = found.offset[i]; k < found.offset[i + 1]; ++k) {
        const Interval value = bodies[found.candidate[k]].view.bound(leaf);
        if (value.lower == value.upper) found.constant[k] = value.lower;
      }
    }
  });
  return found;
}

}  // namespace

struct UnionUpdater::Impl {
  SurfaceGrid result;
  bool usable = false;
  bool thin = false;
  GridOptions options;
  float inside = 0.0F;
  LeafList list;                       ///< of the last call; candidates are places among its bodies
  std::vector<std::uint64_t> version;  ///< of these
  std::vector<FieldChanges> changes;   ///< by place
  LargestValues largest;               ///< with GridContent::Field

  /// A leaf by the bodies that may be in its band, or the largest there; the others are farther out than it reaches, or less.
  static SampledLeaf sample(std::span<const UnitedBody> bodies, const LeafList& list, const GridOptions& options, bool thin, std::size_t i) {
    std::vector<FieldView> near;
    for (std::uint32_t k = list.offset[i]; k < list.offset[i + 1]; ++k) near.push_back(bodies[list.candidate[k]].view);
    if (near.size() == 1) return sample_leaf(near.front(), options, thin, list.block[i]);
    return sample_leaf(UnitedField(std::move(near)), options, thin, list.block[i]);
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
  /// Whether the view of a body is unchanged in a leaf, by the indices of its body now and in the last call.
  [[nodiscard]] bool stays(std::span<const UnitedBody> bodies, std::uint32_t now, std::uint32_t last, const Box& leaf) const {
    if (bodies[now].version == version[last]) return true;
    if (now != last || bodies[now].field == nullptr || changes[now].all()) return false;
    const auto& reaches = changes[now].reaches();
    return std::none_of(reaches.begin(), reaches.end(), [&](const Reach& reach) { return reach.whole.overlaps(leaf) && reach.meets(leaf); });
  }

  /// Changed leaves of `next`, and leaves of the last list that are not in `next`.
  void compare(std::span<const UnitedBody> bodies, const LeafList& next, std::vector<std::size_t>& changed, std::vector<BlockCoord>& gone) const {
    const auto unchanged = [&](std::size_t i, std::size_t old) {
      const std::size_t count = next.offset[i + 1] - next.offset[i];
      if (count != list.offset[old + 1] - list.offset[old]) return false;
      const Box leaf = box_of(next.block[i], options.lattice).inflated(thin ? options.lattice.cell : 0.0);
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t now = next.offset[i] + k, last = list.offset[old] + k;
        if (next.constant[now] && list.constant[last] && *next.constant[now] == *list.constant[last]) continue;
        if (!stays(bodies, next.candidate[now], list.candidate[last], leaf)) return false;
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

  void update(std::span<const UnitedBody> bodies, const LeafList& next, std::span<const std::size_t> changed, std::span<const BlockCoord> gone,
              const Executor& executor) {
    std::vector<SampledLeaf> leaves(changed.size());
    executor.for_blocks(changed.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) leaves[i] = sample(bodies, next, options, thin, changed[i]);
    });
    openvdb::FloatTree& tree = result.impl_->grid->tree();
    if (options.content == GridContent::Field) {
      for (const BlockCoord& block : gone) largest.erase(block);
      for (std::size_t i = 0; i < changed.size(); ++i) largest.set(next.block[changed[i]], leaves[i]);
      if (const float now = inside_value(options, largest.of_all()); now != inside) change_beyond(tree, inside = now);
    }
    // Former inside and band leaves are outside except where `next` has them.
    for_others(list.inside, next.inside, [&](const BlockBox& box) { fill(tree, box, -inside); });
    for (const BlockCoord& block : gone) fill(tree, {block, block}, -inside);
    for_others(next.inside, list.inside, [&](const BlockBox& box) { fill(tree, box, inside); });
    for (std::size_t i = 0; i < changed.size(); ++i) {
      if (leaves[i].leaf) set_beyond(*leaves[i].leaf, inside);
      place(tree, next.block[changed[i]], leaves[i], inside);
    }
    tree.prune();
  }
};

UnionUpdater::UnionUpdater() : impl_(std::make_unique<Impl>()) {}
UnionUpdater::~UnionUpdater() = default;
UnionUpdater::UnionUpdater(UnionUpdater&&) noexcept = default;
UnionUpdater& UnionUpdater::operator=(UnionUpdater&&) noexcept = default;

const SurfaceGrid& UnionUpdater::make(std::span<const UnitedBody> bodies, const GridOptions& options, const Executor& executor,
                                      GridCounts* counts) {
  SUPPLE_EXPECTS(options.half_width >= 1.0 && std::isfinite(options.half_width));
  Impl& self = *impl_;
  std::vector<FieldView> views;
  for (const UnitedBody& body : bodies) views.push_back(body.view);
  const UnitedField united(std::move(views));
  const bool thin = is_thin(united, options);
  const bool comparable = std::exchange(self.usable, false) && same(options, self.options) && thin == self.thin;
  self.thin = thin;
  self.find_changes(bodies, comparable);
  LeafList next = look_at(bodies, range_of(united, options), options, thin, executor);
  GridCounts count{.leaves_looked_at = next.block.size(), .leaves_sampled = next.block.size(), .whole = true};
  std::vector<std::size_t> changed;
  std::vector<BlockCoord> gone;
  if (comparable) {
    self.compare(bodies, next, changed, gone);
    count.whole = 2 * (changed.size() + gone.size()) >= std::max<std::size_t>(next.block.size(), 64);
  }
  if (count.whole) {
    MadeGrid made = make_whole(next, options, executor, [&](std::size_t i) { return Impl::sample(bodies, next, options, thin, i); });
    self.result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(made.grid));
    self.inside = made.inside;
    self.largest.reset(made.largest);
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
