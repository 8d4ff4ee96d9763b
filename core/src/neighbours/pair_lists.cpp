#include "neighbours/pair_lists.h"

#include <algorithm>
#include <atomic>
#include <utility>

namespace supple::core {
namespace {

constexpr std::size_t kPointBlock = 4096;
/// Skin of the lists, in ranges.
constexpr double kSkin = 0.15;
/// Square of the largest move, in skins: half of one, less the rounding of distances.
constexpr double kMoveLimit2 = 0.2499;
/// Owners among which lists of like length are put together.
constexpr std::size_t kWindow = 256;

}  // namespace

PairLists::PairLists(double range, std::vector<std::uint32_t> particles, std::uint32_t filler, Takes takes)
    : range_(range), particle_(std::move(particles)), filler_(filler), takes_(std::move(takes)) {}

bool PairLists::holds(std::span<const Vec3> positions, const Executor& executor) {
  block_move2_.assign((particle_.size() + kPointBlock - 1) / kPointBlock, 0.0);
  if (reference_.size() != particle_.size()) return false;
  const auto body = [&](std::size_t begin, std::size_t end) {
    double move2 = 0.0;
    for (std::size_t k = begin; k < end; ++k) {
      move2 = std::max(move2, (positions[particle_[k]] - reference_[k]).squaredNorm());
    }
    block_move2_[begin / kPointBlock] = move2;
  };
  executor.for_blocks(particle_.size(), kPointBlock, std::cref(body));
  const double skin = kSkin * range_;
  return *std::max_element(block_move2_.begin(), block_move2_.end()) <= kMoveLimit2 * skin * skin;
}

std::uint64_t PairLists::update(std::span<const Vec3> positions, const Executor& executor) {
  if (particle_.empty() || holds(positions, executor)) return 0;
  std::vector<Vec3> found_at = std::exchange(reference_, {});  // lists that are not finished have none: an exception may end this call
  found_at.resize(particle_.size());
  for (std::size_t k = 0; k < particle_.size(); ++k) found_at[k] = positions[particle_[k]];
  cells_.sort(found_at, (1.0 + kSkin) * range_, executor);
  if (block_.size() < cells_.blocks()) block_.resize(cells_.blocks());
  while (scratch_.size() < static_cast<std::size_t>(executor.threads())) scratch_.push_back(std::make_unique<Scratch>());
  std::mutex lock;
  std::atomic<std::uint64_t> distances = 0;
  /// One of the scratches, given back however its block ends: the next blocks are begun all the same.
  struct Borrowed {
    Borrowed(std::vector<std::unique_ptr<Scratch>>& unused_now, std::mutex& mutex) : unused(unused_now), lock(mutex) {
      const std::lock_guard guard(lock);
      scratch = std::move(unused.back());
      unused.pop_back();
    }
    ~Borrowed() {
      const std::lock_guard guard(lock);
      unused.push_back(std::move(scratch));  // has room: it came from there
    }
    Borrowed(const Borrowed&) = delete;
    Borrowed& operator=(const Borrowed&) = delete;
    std::vector<std::unique_ptr<Scratch>>& unused;
    std::mutex& lock;
    std::unique_ptr<Scratch> scratch;
  };
  const auto body = [&](std::size_t begin, std::size_t end) {
    const Borrowed borrowed(scratch_, lock);
    for (std::size_t b = begin; b < end; ++b) {
      cells_.search(b, 1, borrowed.scratch->near);
      distances += borrowed.scratch->near.distances;
      fill(*borrowed.scratch, block_[b]);
    }
  };
  executor.for_blocks(cells_.blocks(), 1, std::cref(body));
  reference_ = std::move(found_at);
  return distances;
}

/// Leaves in each list the pairs that count, ascending.
void PairLists::take_lists(Scratch& scratch) const {
  for (NearLists::Owner& owner : scratch.near.owner) {
    std::uint32_t* const list = scratch.near.near.data() + owner.begin;
    std::uint32_t count = owner.count;
    if (takes_) {
      count = 0;
      for (std::uint32_t k = 0; k < owner.count; ++k) {
        if (takes_(owner.index, list[k])) list[count++] = list[k];
      }
      owner.count = count;
    }
    if (count > 1) scratch.sorter(list, count, hwy::SortAscending());
  }
}

void PairLists::lay_group(const Scratch& scratch, std::size_t first, std::size_t count, Block& out) const {
  PairGroup group;
  group.begin = out.entry.size();
  group.owners = static_cast<std::uint32_t>(count);
  group.owner.fill(filler_ + 1);
  const auto owner_at = [&](std::size_t k) -> const NearLists::Owner& { return scratch.near.owner[scratch.order[first + k]]; };
  for (std::size_t k = 0; k < count; ++k) {
    group.owner[k] = particle_[owner_at(k).index];
    group.steps = std::max(group.steps, owner_at(k).count);
    out.pairs += owner_at(k).count;
  }
  if (group.steps == 0) return;
  out.entry.resize(group.begin + kGroup * group.steps, filler_);
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t* const list = scratch.near.near.data() + owner_at(k).begin;
    std::uint32_t* const to = out.entry.data() + group.begin + k;
    for (std::uint32_t s = 0; s < owner_at(k).count; ++s) to[kGroup * s] = particle_[list[s]];
  }
  out.group.push_back(group);
}

void PairLists::fill(Scratch& scratch, Block& out) const {
  take_lists(scratch);
  const std::vector<NearLists::Owner>& owner = scratch.near.owner;
  out.group.clear();
  out.entry.clear();
  out.pairs = 0;
  scratch.order.resize(owner.size());
  for (std::size_t begin = 0; begin < owner.size(); begin += kWindow) {
    const std::size_t end = std::min(begin + kWindow, owner.size());
    // Sorted by length by counting.
    scratch.start.assign(1, 0);
    for (std::size_t k = begin; k < end; ++k) {
      if (scratch.start.size() < owner[k].count + 2) scratch.start.resize(owner[k].count + 2, 0);
      ++scratch.start[owner[k].count + 1];
    }
    for (std::size_t c = 1; c < scratch.start.size(); ++c) scratch.start[c] += scratch.start[c - 1];
    for (std::size_t k = begin; k < end; ++k) {
      scratch.order[begin + scratch.start[owner[k].count]++] = static_cast<std::uint32_t>(k);
    }
    for (std::size_t k = begin; k < end; k += kGroup) lay_group(scratch, k, std::min(kGroup, end - k), out);
  }
}

}  // namespace supple::core
