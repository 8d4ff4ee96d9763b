#include "mesh/partition/partition_keep.h"

#include <algorithm>
#include <utility>

#include "field/bytes_of.h"

namespace supple::implicit::lattice {
namespace {

constexpr Label kNoLabel = ~Label{0} - 1;

/// From labels of the last call to those of this one.
class LabelMap {
 public:
  LabelMap(std::span<const std::uint64_t> last, std::span<const std::uint64_t> now) : label_(last.size() + 1, kNoLabel) {
    label_[0] = 0;
    std::vector<std::pair<std::uint64_t, Label>> sorted;
    for (Label l = 1; l <= now.size(); ++l) sorted.emplace_back(now[l - 1], l);
    std::sort(sorted.begin(), sorted.end());
    Label highest = 0;
    for (std::size_t l = 1; l < label_.size(); ++l) {
      const auto at = std::lower_bound(sorted.begin(), sorted.end(), std::pair(last[l - 1], Label{0}));
      if (at == sorted.end() || at->first != last[l - 1]) continue;
      label_[l] = at->second;
      same_ = same_ && at->second == l;
      in_order_ = in_order_ && at->second > highest;
      highest = std::max(highest, at->second);
    }
  }
  /// No body that stays has another label.
  [[nodiscard]] bool same() const { return same_; }
  /// Bodies that stay follow each other as before.
  [[nodiscard]] bool in_order() const { return in_order_; }
  /// kNoLabel: of a body that is gone.
  [[nodiscard]] Label operator()(Label l) const { return l == kAnyLabel ? l : label_[l]; }
  [[nodiscard]] std::uint32_t body(std::uint32_t b) const { return b == kNoBody ? b : label_[b + 1] - 1; }

 private:
  std::vector<Label> label_;
  bool same_ = true, in_order_ = true;
};

void relabel(const LabelMap& map, LabelSet& set) {
  for (std::size_t k = 0; k < set.count; ++k) set.label[k] = map(set.label[k]);
}

void relabel(const LabelMap& map, std::vector<Facet>& facets) {
  for (Facet& facet : facets) {
    facet.inner = map(facet.inner);
    facet.outer = map(facet.outer);
  }
}

void relabel(const LabelMap& map, KeptBlock& kept) {
  for (std::uint32_t& body : kept.candidate) body = map.body(body);
  for (LabelledBlock& block : kept.vertices.block) {
    for (Label& l : block.label) l = map(l);
  }
  for (VertexUse& use : kept.vertices.use) {
    use.body = map.body(use.body);
    use.other = map(use.other);
    use.contact = map(use.contact);
  }
  for (Cover& cover : kept.vertices.cover) {
    relabel(map, cover.between);
    cover.by = map(cover.by);
  }
  for (Meeting& meeting : kept.vertices.meeting) relabel(map, meeting.labels);
  relabel(map, kept.facets.facet);
  relabel(map, kept.facets.cut);
  for (BodyCount& count : kept.facets.body) count.body = map.body(count.body);
}

void relabel(const LabelMap& map, KeptBoundaries& boundaries) {
  for (Crossing& c : boundaries.crossing) relabel(map, c.labels);
  for (TwiceCovered& t : boundaries.twice) {
    for (Label* l : {&t.low, &t.high, &t.at_a, &t.at_b}) *l = map(*l);
  }
}

bool same_candidates(const LabelMap& map, const KeptBlock& kept, std::span<const std::uint32_t> candidates) {
  return std::equal(kept.candidate.begin(), kept.candidate.end(), candidates.begin(), candidates.end(),
                    [&](std::uint32_t last, std::uint32_t now) { return map.body(last) == now; });
}

/// Calls use(facets) for those of each tetrahedron.
template <class Use>
void for_tetrahedra(std::span<const Facet> facets, const Use& use) {
  for (std::size_t begin = 0, end = 0; begin < facets.size(); begin = end) {
    while (end < facets.size() && facets[end].tetrahedron == facets[begin].tetrahedron) ++end;
    use(facets.subspan(begin, end - begin));
  }
}

template <class Is>
bool has_vertex(std::span<const Facet> facets, const Is& is) {
  return std::any_of(facets.begin(), facets.end(), [&](const Facet& facet) { return std::any_of(facet.vertex.begin(), facet.vertex.end(), is); });
}

}  // namespace

std::uint64_t KeptPartition::bytes() const {
  std::uint64_t sum = bytes_of(all.block) + bytes_of(all.use_end) + bytes_of(all.use) + bytes_of(all.kind) + bytes_of(all.cover) + bytes_of(all.meeting);
  sum += bytes_of(version) + bytes_of(block) + bytes_of(boundaries.crossing) + bytes_of(boundaries.twice) + bytes_of(boundaries.uncovered) + bytes_of(boundaries.island);
  for (const KeptBlock& kept : block) {
    const PartitionVertices& v = kept.vertices;
    sum += bytes_of(kept.candidate) + bytes_of(v.block) + bytes_of(v.use_end) + bytes_of(v.use) + bytes_of(v.kind) + bytes_of(v.cover) +
           bytes_of(v.meeting) + bytes_of(kept.facets.facet) + bytes_of(kept.facets.cut) + bytes_of(kept.facets.body);
    for (const LabelledBlock& b : v.block) sum += bytes_of(b.face_key) + bytes_of(b.lone_key) + bytes_of(b.label);
  }
  return sum;
}

std::vector<ChangedBlock> take_blocks(KeptPartition& partition, const BlockList& list, const Lattice& lattice,
                                      std::span<const std::uint64_t> version) {
  if (lattice.cell != partition.lattice.cell || lattice.origin != partition.lattice.origin) partition = {};
  const LabelMap map(partition.version, version);
  if (!map.in_order()) partition = {};  // the order decides ties
  std::vector<KeptBlock> last = std::exchange(partition.block, {});
  partition.lattice = lattice;
  partition.version.assign(version.begin(), version.end());
  partition.block.resize(list.block.size());
  std::vector<ChangedBlock> changed;
  auto old = last.begin();
  const auto leave = [&] {
    changed.push_back({old->coord, std::move(old->facets.facet)});
    ++old;
  };
  for (std::size_t i = 0; i < list.block.size(); ++i) {
    const BlockCoord& coord = list.block[i];
    const std::span candidates(list.candidate.data() + list.offset[i], list.offset[i + 1] - list.offset[i]);
    while (old != last.end() && before(old->coord, coord)) leave();
    KeptBlock& block = partition.block[i];
    const bool was = old != last.end() && old->coord == coord;
    if (was && same_candidates(map, *old, candidates)) {
      block = std::move(*old++);
      block.made = false;
      if (!map.same()) relabel(map, block);
      continue;
    }
    block.coord = coord;
    block.candidate.assign(candidates.begin(), candidates.end());
    if (was) {
      leave();
    } else {
      changed.push_back({coord, {}});
    }
  }
  while (old != last.end()) leave();
  if (!map.same()) relabel(map, partition.boundaries);
  return changed;
}

std::vector<std::uint8_t> find_same_parts(std::span<const ChangedBlock> changed, std::span<const LabelledBlock* const> blocks) {
  std::vector<std::uint8_t> same(blocks.size(), 1);
  std::vector<BlockCoord> coords;
  for (const ChangedBlock& change : changed) coords.push_back(change.coord);
  for_parts_with(coords, blocks, [&](std::size_t part) { same[part] = 0; });
  return same;
}

void mark_last(std::span<const Facet> facets, bool all_of_them, Carried& carried) {
  const auto is_gone = [&](std::uint32_t v) { return carried.number[v] == kGone; };
  for_tetrahedra(facets, [&](std::span<const Facet> some) {
    if (!all_of_them && !has_vertex(some, is_gone)) return;
    for (const Facet& facet : some) {
      for (const std::uint32_t v : facet.vertex) {
        if (!is_gone(v)) carried.disturbed[carried.number[v]] |= kTouched;
      }
    }
  });
}

void mark_now(std::span<const Facet> facets, bool all_of_them, Carried& carried) {
  const auto is_new = [&](std::uint32_t v) { return (carried.disturbed[v] & kNew) != 0; };
  for_tetrahedra(facets, [&](std::span<const Facet> some) {
    if (!all_of_them && !has_vertex(some, is_new)) return;
    for (const Facet& facet : some) {
      for (const std::uint32_t v : facet.vertex) carried.disturbed[v] |= kTouched;
    }
  });
}

}  // namespace supple::implicit::lattice
