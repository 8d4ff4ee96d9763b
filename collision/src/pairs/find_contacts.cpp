#include "supple/collision/find_contacts.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

#include "pairs/body_order.h"
#include "pairs/boxes.h"
#include "pairs/cores.h"

namespace supple::collision {
namespace {

/// Columns for a sweep: the finite box centres spread most along `sweep`; across the other two axes space is cut into columns
/// of about two boxes each.
struct Columns {
  int sweep = 0;
  std::array<int, 2> across = {1, 2};
  std::array<double, 2> begin{};             ///< of the first column [m]
  std::array<double, 2> width = {1.0, 1.0};  ///< [m]
  std::array<std::uint32_t, 2> count = {1, 1};

  explicit Columns(std::span<const Box> boxes) {
    constexpr double kMost = 256.0;  // along one axis
    Box spread;
    Vec3 extent = Vec3::Zero();
    double finite = 0.0;
    for (const Box& box : boxes) {
      if (box.empty() || !is_finite(box)) continue;
      spread.include(box.centre());
      extent += box.extent();
      finite += 1.0;
    }
    if (spread.empty()) return;
    std::array<int, 3> axis = {0, 1, 2};
    std::stable_sort(axis.begin(), axis.end(), [&](int i, int j) { return spread.extent()[i] > spread.extent()[j]; });
    sweep = axis[0];
    across = {axis[1], axis[2]};
    for (const std::size_t k : {0u, 1u}) {
      begin[k] = spread.lower[across[k]];
      const double length = spread.extent()[across[k]];
      if (!(length > 0.0)) continue;
      width[k] = std::max(2.0 * extent[across[k]] / finite, length / kMost);
      count[k] = static_cast<std::uint32_t>(length / width[k]) + 1;
    }
  }
  [[nodiscard]] std::size_t size() const { return std::size_t{count[0]} * count[1]; }

  /// The columns of a place, the outer ones without end.
  [[nodiscard]] std::array<std::uint32_t, 2> of(const Vec3& x) const {
    std::array<std::uint32_t, 2> at;
    for (const std::size_t k : {0u, 1u}) {
      at[k] = static_cast<std::uint32_t>(std::clamp((x[across[k]] - begin[k]) / width[k], 0.0, static_cast<double>(count[k] - 1)));
    }
    return at;
  }
};

bool allowed(std::span<const ContactBody> bodies, const ContactRules& rules, std::uint32_t a, std::uint32_t b) {
  return !(bodies[a].fixed && bodies[b].fixed) && (!rules.allowed || rules.allowed(a, b));
}

/// Whether samples tell where the surface of a body is near others.
bool is_sampled(const ContactBody& body) {
  return body.samples != nullptr && !body.samples->point.empty() &&
         (body.samples->visited == 0 || body.samples->failures < body.samples->visited);
}

/// Mean distance of the samples of a body [m]; 0 without samples.
double sample_spacing(const ContactBody& body) {
  if (body.samples == nullptr) return 0.0;
  // Invalid ones have no area. Four sums, as each waits for its last.
  const implicit::SurfaceSamples& samples = *body.samples;
  std::array<double, 4> area{};
  std::size_t count = 0;
  for (std::size_t s = 0; s < samples.area.size(); ++s) {
    area[s % 4] += samples.area[s];
    count += samples.valid[s];
  }
  return count == 0 ? 0.0 : std::sqrt((area[0] + area[1] + area[2] + area[3]) / static_cast<double>(count));
}

/// Buffers of one thread.
struct Scratch {
  std::vector<std::uint32_t> inside;
  std::vector<Vec3> point;
  std::vector<double> value;
  std::vector<Vec3> slope;
};

/// Samples that are looked at together: one bit of a word each.
constexpr std::size_t kTogether = 64;

/// Appends the numbers of those of the first kTogether points that are valid and lie in a box.
void add_inside(std::span<const Vec3> points, const std::uint8_t* valid, const Box& box, std::uint32_t first, std::vector<std::uint32_t>& inside) {
  const std::size_t count = std::min(points.size(), kTogether);
  const Vec3 lower = box.lower, upper = box.upper;
  // Which lie inside cannot be foreseen: no branch until it is known whether there are any.
  const auto is = [](bool yes) { return std::int64_t{yes}; };
  std::array<std::int64_t, kTogether> in;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3& x = points[i];
    in[i] = is(x[0] >= lower[0]) & is(x[1] >= lower[1]) & is(x[2] >= lower[2]) & is(x[0] <= upper[0]) & is(x[1] <= upper[1]) & is(x[2] <= upper[2]);
  }
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i) bits |= static_cast<std::uint64_t>(in[i] & valid[i]) << i;
  for (; bits != 0; bits &= bits - 1) inside.push_back(first + static_cast<std::uint32_t>(std::countr_zero(bits)));
}

/// Appends the samples of `from` in `box` from which the surface of `to` is at most one spacing away.
void collect(const ContactBody& from, const ContactBody& to, const Box& box, double spacing, Scratch& scratch,
             std::vector<Vec3>& seeds) {
  if (from.samples == nullptr) return;
  const implicit::SurfaceSamples& samples = *from.samples;
  scratch.inside.clear();
  for (std::size_t first = 0; first < samples.point.size(); first += kTogether) {
    add_inside(std::span(samples.point).subspan(first), samples.valid.data() + first, box, static_cast<std::uint32_t>(first), scratch.inside);
  }
  const std::size_t count = scratch.inside.size();
  scratch.point.resize(count);
  scratch.value.resize(count);
  scratch.slope.resize(count);
  const std::span<const std::uint32_t> inside(scratch.inside);
  const std::span<Vec3> point(scratch.point), slope(scratch.slope);
  const std::span<double> value(scratch.value);
  for (std::size_t i = 0; i < count; ++i) point[i] = samples.point[inside[i]];
  to.field.evaluate(point, value, slope);
  // Which are near cannot be foreseen either. Distances by their squares: f > - reach |grad f|.
  std::size_t kept = seeds.size();
  seeds.resize(kept + count);
  const std::span<Vec3> seed(seeds);
  for (std::size_t i = 0; i < count; ++i) {
    const double reach2 = std::max(spacing * spacing, samples.area[inside[i]]);
    seed[kept] = point[i];
    kept += std::size_t{value[i] > 0.0} | std::size_t{value[i] * value[i] < reach2 * slope[i].squaredNorm()};
  }
  seeds.resize(kept);
}

/// All pairs of some lists in order: by the first body through counts, by the second within its few.
std::vector<BodyPair> in_order(std::span<const std::vector<BodyPair>> lists, std::size_t bodies) {
  std::vector<std::uint32_t> offset(bodies + 2, 0);
  for (const auto& some : lists) {
    for (const BodyPair& pair : some) ++offset[pair.a + 2];
  }
  for (std::size_t i = 2; i < offset.size(); ++i) offset[i] += offset[i - 1];
  std::vector<BodyPair> pairs(offset.back());
  for (const auto& some : lists) {
    for (const BodyPair& pair : some) pairs[offset[pair.a + 1]++] = pair;
  }
  for (std::size_t i = 0; i < bodies; ++i) std::sort(pairs.begin() + offset[i], pairs.begin() + offset[i + 1]);
  return pairs;
}

void make_room(std::size_t pairs, std::size_t seeds, ContactCandidates& out) {
  out.pair.resize(pairs);
  out.overlap.resize(pairs);
  out.spacing.resize(pairs);
  out.convex.resize(pairs);
  out.offset.resize(pairs + 1);
  out.seed.resize(seeds);
  out.offset[0] = 0;
}

/// What is found of one pair: seeds lie in a slot of its own, so that blocks may run in any order.
struct Slot {
  Box overlap;
  double spacing = 0.0;
  bool convex = false, kept = false;
  std::vector<Vec3> seed;
};

/// Copies what is found of a pair to its place. @param seeds  where its seeds begin
void put(const Slot& slot, const BodyPair& pair, std::size_t at, std::size_t seeds, ContactCandidates& out) {
  out.pair[at] = pair;
  out.overlap[at] = slot.overlap;
  out.spacing[at] = slot.spacing;
  out.convex[at] = slot.convex ? 1 : 0;
  std::copy(slot.seed.begin(), slot.seed.end(), out.seed.begin() + static_cast<std::ptrdiff_t>(seeds));
  out.offset[at + 1] = static_cast<std::uint32_t>(seeds + slot.seed.size());
}

/// A body with the mean distance of its samples and the box of its surface.
struct Sampled {
  const ContactBody& body;
  double spacing;
  const Box& box;
};

/// Where a pair may touch: between the cores of convex bodies, else at samples near the other body.
void look_at(const Sampled& a, const Sampled& b, Scratch& scratch, Slot& slot) {
  slot.overlap = a.box.intersection(b.box);
  slot.seed.clear();
  const std::optional<Between> between = between_cores(a.body, b.body, slot.overlap);
  slot.convex = between.has_value();
  slot.spacing = 0.0;
  if (slot.convex) {
    if (!between->apart) slot.seed.push_back(between->middle);
  } else {
    slot.spacing = std::max(a.spacing, b.spacing);
    const Box near = slot.overlap.inflated(slot.spacing);
    collect(a.body, b.body, near, a.spacing, scratch, slot.seed);
    collect(b.body, a.body, near, b.spacing, scratch, slot.seed);
  }
  slot.kept = !slot.seed.empty() || (!slot.convex && !is_sampled(a.body) && !is_sampled(b.body));
}

}  // namespace

std::vector<BodyPair> overlapping_boxes(std::span<const Box> boxes, const Executor& executor) {
  const Columns columns(boxes);
  const int axis = columns.sweep;
  struct Entry {
    Box box;
    std::uint32_t id;
    std::array<std::uint32_t, 2> first, last;  // columns
    [[nodiscard]] bool wide() const {
      constexpr std::uint32_t kWide = 8;  // columns; boxes in more are few and meet all others
      return (last[0] - first[0] + 1) * (last[1] - first[1] + 1) > kWide;
    }
  };
  std::vector<Entry> narrow, wide;
  std::vector<std::vector<Entry>> members(columns.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i].empty()) continue;
    const Entry e{boxes[i], i, columns.of(boxes[i].lower), columns.of(boxes[i].upper)};
    (e.wide() ? wide : narrow).push_back(e);
    if (e.wide()) continue;
    for (std::uint32_t m = e.first[0]; m <= e.last[0]; ++m) {
      for (std::uint32_t n = e.first[1]; n <= e.last[1]; ++n) members[m * columns.count[1] + n].push_back(e);
    }
  }
  const auto join = [](const Entry& x, const Entry& y, std::vector<BodyPair>& out) {
    if (x.box.overlaps(y.box)) out.push_back({std::min(x.id, y.id), std::max(x.id, y.id)});
  };
  std::vector<std::vector<BodyPair>> found(columns.size() + 1);  // by column; those of wide boxes
  constexpr std::size_t kBlock = 4;
  executor.for_blocks(columns.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t column = begin; column < end; ++column) {
      std::vector<Entry>& here = members[column];
      std::sort(here.begin(), here.end(), [axis](const Entry& x, const Entry& y) {
        return x.box.lower[axis] != y.box.lower[axis] ? x.box.lower[axis] < y.box.lower[axis] : x.id < y.id;
      });
      for (std::size_t i = 0; i < here.size(); ++i) {
        for (std::size_t j = i + 1; j < here.size() && here[j].box.lower[axis] <= here[i].box.upper[axis]; ++j) {
          // Two that share several columns meet in the first of them.
          const std::uint32_t m = std::max(here[i].first[0], here[j].first[0]), n = std::max(here[i].first[1], here[j].first[1]);
          if (column == m * columns.count[1] + n) join(here[i], here[j], found[column]);
        }
      }
    }
  });
  for (std::size_t i = 0; i < wide.size(); ++i) {
    for (std::size_t j = i + 1; j < wide.size(); ++j) join(wide[i], wide[j], found.back());
    for (const Entry& e : narrow) join(wide[i], e, found.back());
  }
  return in_order(found, boxes.size());
}

void OverlapList::find(std::span<const Box> boxes, const Executor& executor, std::vector<BodyPair>& out) {
  constexpr double kMargin = 0.05;  // of the shortest edge
  bool within = wide_.size() == boxes.size();
  for (std::size_t i = 0; i < boxes.size() && within; ++i) {
    within = (wide_[i].lower.array() <= boxes[i].lower.array()).all() && (boxes[i].upper.array() <= wide_[i].upper.array()).all();
  }
  if (!within) {
    wide_.assign(boxes.begin(), boxes.end());
    for (Box& box : wide_) {
      const double edge = box.extent().minCoeff();
      if (edge > 0.0 && std::isfinite(edge)) box = box.inflated(kMargin * edge);
    }
    near_ = overlapping_boxes(wide_, executor);
  }
  out.resize(near_.size());
  std::size_t count = 0;
  for (const BodyPair& pair : near_) {
    out[count] = pair;
    count += overlap_at_once(boxes[pair.a], boxes[pair.b]) ? 1 : 0;
  }
  out.resize(count);
}

std::vector<BodyPair> broad_phase(std::span<const ContactBody> bodies, const ContactRules& rules, const Executor& executor) {
  std::vector<Box> box;
  box.reserve(bodies.size());
  for (const ContactBody& body : bodies) box.push_back(body.field ? body.field.surface_box() : Box{});
  std::vector<BodyPair> pairs = overlapping_boxes(box, executor);
  std::erase_if(pairs, [&](const BodyPair& pair) { return !allowed(bodies, rules, pair.a, pair.b); });
  return pairs;
}

void find_contacts(std::span<const ContactBody> bodies, std::span<const BodyPair> pairs, const Executor& executor,
                   ContactCandidates& out) {
  struct Place {
    std::size_t pairs = 0, seeds = 0;
  };
  thread_local std::vector<Slot> slots;
  thread_local std::vector<double> spacing;
  thread_local std::vector<Box> box;
  thread_local std::vector<Place> places;  // of what blocks keep
  struct Job {
    std::span<const ContactBody> bodies;
    std::span<const BodyPair> pairs;
    std::vector<Slot>& slots;
    std::vector<double>& spacing;
    std::vector<Box>& box;
    std::vector<Place>& places;
    ContactCandidates& out;
    [[nodiscard]] Sampled sampled(std::uint32_t i) const { return {bodies[i], spacing[i], box[i]}; }
  } job{bodies, pairs, slots, spacing, box, places, out};

  constexpr std::size_t kBlock = 16;
  if (slots.size() < pairs.size()) slots.resize(pairs.size());
  spacing.resize(bodies.size());
  box.resize(bodies.size());
  places.assign(pairs.size() / kBlock + 1, {});
  executor.for_blocks(bodies.size(), kBlock, [&job](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      job.spacing[i] = sample_spacing(job.bodies[i]);
      job.box[i] = job.bodies[i].field ? job.bodies[i].field.surface_box() : Box{};
    }
  });
  executor.for_blocks(pairs.size(), kBlock, [&job](std::size_t begin, std::size_t end) {
    thread_local Scratch scratch;
    Place size;
    for (std::size_t k = begin; k < end; ++k) {
      Slot& slot = job.slots[k];
      look_at(job.sampled(job.pairs[k].a), job.sampled(job.pairs[k].b), scratch, slot);
      size.pairs += slot.kept ? 1 : 0;
      size.seeds += slot.seed.size();
    }
    job.places[begin / kBlock] = size;
  });

  Place all;
  for (Place& block : places) {
    const Place size = std::exchange(block, all);
    all.pairs += size.pairs;
    all.seeds += size.seeds;
  }
  make_room(all.pairs, all.seeds, out);
  executor.for_blocks(pairs.size(), kBlock, [&job](std::size_t begin, std::size_t end) {
    auto [at, seeds] = job.places[begin / kBlock];
    for (std::size_t k = begin; k < end; ++k) {
      const Slot& slot = job.slots[k];
      if (!slot.kept) continue;
      put(slot, job.pairs[k], at++, seeds, job.out);
      seeds += slot.seed.size();
    }
  });
}

}  // namespace supple::collision
