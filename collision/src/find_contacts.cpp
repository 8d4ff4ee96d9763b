#include "supple/collision/find_contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace supple::collision {
namespace {

/// Two axes for a sweep: the finite box centres spread most along `sweep` and second most along `across`, where they are
/// cut into strips of about two boxes each.
struct Strips {
  int sweep = 0;
  int across = 1;
  double begin = 0.0;  ///< of the first strip [m]
  double width = 1.0;  ///< [m]
  std::uint32_t count = 1;

  explicit Strips(std::span<const Box> boxes) {
    constexpr double kMostStrips = 65536.0;
    Box spread;
    Vec3 extent = Vec3::Zero();
    double finite = 0.0;
    for (const Box& box : boxes) {
      if (box.empty() || !box.lower.allFinite() || !box.upper.allFinite()) continue;
      spread.include(box.centre());
      extent += box.extent();
      finite += 1.0;
    }
    if (spread.empty()) return;
    std::array<int, 3> axis = {0, 1, 2};
    std::stable_sort(axis.begin(), axis.end(), [&](int i, int j) { return spread.extent()[i] > spread.extent()[j]; });
    sweep = axis[0];
    across = axis[1];
    begin = spread.lower[across];
    const double length = spread.extent()[across];
    if (!(length > 0.0)) return;
    width = std::max(2.0 * extent[across] / finite, length / kMostStrips);
    count = static_cast<std::uint32_t>(length / width) + 1;
  }

  /// The strip of a coordinate, the outer ones without end.
  [[nodiscard]] std::uint32_t of(double x) const {
    return static_cast<std::uint32_t>(std::clamp((x - begin) / width, 0.0, static_cast<double>(count - 1)));
  }
};

bool allowed(std::span<const ContactBody> bodies, const ContactRules& rules, std::uint32_t a, std::uint32_t b) {
  return !(bodies[a].fixed && bodies[b].fixed) && (!rules.allowed || rules.allowed(a, b));
}

}  // namespace

std::uint64_t count_allowed(std::span<const ContactBody> bodies, const ContactRules& rules) {
  const auto pairs_of = [](std::uint64_t n) { return n == 0 ? 0 : n * (n - 1) / 2; };
  if (!rules.allowed) {
    const auto fixed = std::count_if(bodies.begin(), bodies.end(), [](const ContactBody& b) { return b.fixed; });
    return pairs_of(bodies.size()) - pairs_of(static_cast<std::uint64_t>(fixed));
  }
  std::uint64_t count = 0;
  for (std::uint32_t a = 0; a < bodies.size(); ++a) {
    for (std::uint32_t b = a + 1; b < bodies.size(); ++b) count += allowed(bodies, rules, a, b) ? 1 : 0;
  }
  return count;
}

namespace {

/// Mean distance of the samples of a body [m]; 0 without samples.
double sample_spacing(const ContactBody& body) {
  if (body.samples == nullptr) return 0.0;
  double area = 0.0;
  std::size_t count = 0;
  for (std::size_t s = 0; s < body.samples->point.size(); ++s) {
    if (body.samples->valid[s] == 0) continue;
    area += body.samples->area[s];
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(area / static_cast<double>(count));
}

/// Buffers of one thread.
struct Scratch {
  std::vector<Vec3> point;
  std::vector<double> reach;  // how far this sample looks [m]
  std::vector<double> value;
  std::vector<Vec3> slope;
};

/// Appends the samples of `from` in `box` from which the surface of `to` is at most one spacing away.
void collect(const ContactBody& from, const ContactBody& to, const Box& box, double spacing, Scratch& scratch,
             std::vector<Vec3>& seeds) {
  if (from.samples == nullptr) return;
  const implicit::SurfaceSamples& samples = *from.samples;
  scratch.point.clear();
  scratch.reach.clear();
  for (std::size_t s = 0; s < samples.point.size(); ++s) {
    if (samples.valid[s] == 0 || !box.contains(samples.point[s])) continue;
    scratch.point.push_back(samples.point[s]);
    scratch.reach.push_back(std::max(spacing, std::sqrt(samples.area[s])));
  }
  scratch.value.resize(scratch.point.size());
  scratch.slope.resize(scratch.point.size());
  to.field.evaluate(scratch.point, scratch.value, scratch.slope);
  for (std::size_t s = 0; s < scratch.point.size(); ++s) {
    const double slope = scratch.slope[s].norm();
    if (scratch.value[s] > 0.0 || (slope > 0.0 && scratch.value[s] > -scratch.reach[s] * slope)) {
      seeds.push_back(scratch.point[s]);
    }
  }
}

/// Between two convex bodies.
struct Between {
  Vec3 middle = Vec3::Zero();  ///< of the overlap, or of the gap
  bool apart = false;          ///< certainly no overlap
};

/// On the line between the nearest points of two cores, which are found by going from one to the other. None when the
/// cores meet.
std::optional<Between> between_cores(const ContactBody& a, const ContactBody& b) {
  constexpr int kSteps = 32;
  constexpr double kEnough = 1e-3;  // of the distance: the overlap is sought from here, not measured
  const std::span<const Pose> moving = a.fixed ? b.pose : a.pose;  // a place to begin at, near one of them
  const Vec3 start = moving.empty() ? Vec3::Zero().eval() : moving.front().position;
  std::optional<implicit::CorePoint> on_a = a.field.core_point(start);
  if (!on_a) return std::nullopt;
  std::optional<implicit::CorePoint> on_b = b.field.core_point(on_a->point);
  if (!on_b) return std::nullopt;
  constexpr double kRounding = 1e-12;
  bool settled = false;  // the nearest points but for rounding, so that planes across the line part the cores
  for (int i = 0; i < kSteps; ++i) {
    const Vec3 before = on_a->point;
    on_a = a.field.core_point(on_b->point);
    const double moved = (on_a->point - before).norm(), between = (on_a->point - on_b->point).norm();
    settled = moved <= kRounding * (between + before.lpNorm<Eigen::Infinity>());
    if (moved <= kEnough * between) break;
    on_b = b.field.core_point(on_a->point);
  }
  const Vec3 across = on_b->point - on_a->point;
  const double distance = across.norm();
  if (!(distance > kEnough * (on_a->radius + on_b->radius))) return std::nullopt;
  const double middle = 0.5 * (std::min(on_a->radius, distance) + std::max(distance - on_b->radius, 0.0));
  constexpr double kMargin = 1e-9;  // covers the rounding, however long the cores are
  return Between{on_a->point + (middle / distance) * across,
                 settled && distance > (1.0 + kMargin) * (on_a->radius + on_b->radius)};
}

}  // namespace

std::vector<BodyPair> overlapping_boxes(std::span<const Box> boxes, const Executor& executor) {
  const Strips strips(boxes);
  const int axis = strips.sweep;
  constexpr std::uint32_t kWide = 8;  // strips; wider boxes are few and meet all others
  struct Entry {
    Box box;
    std::uint32_t id, first, last;  // strips
    [[nodiscard]] bool wide() const { return last - first >= kWide; }
  };
  std::vector<Entry> entry;
  entry.reserve(boxes.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i].empty()) continue;
    entry.push_back({boxes[i], i, strips.of(boxes[i].lower[strips.across]), strips.of(boxes[i].upper[strips.across])});
  }
  std::sort(entry.begin(), entry.end(), [axis](const Entry& x, const Entry& y) {
    return x.box.lower[axis] != y.box.lower[axis] ? x.box.lower[axis] < y.box.lower[axis] : x.id < y.id;
  });
  std::vector<std::vector<Entry>> members(strips.count);  // of each strip, in the order of the sweep
  std::vector<Entry> wide;
  for (const Entry& e : entry) {
    if (e.wide()) {
      wide.push_back(e);
    } else {
      for (std::uint32_t strip = e.first; strip <= e.last; ++strip) members[strip].push_back(e);
    }
  }
  const auto join = [](const Entry& x, const Entry& y, std::vector<BodyPair>& out) {
    if (x.box.overlaps(y.box)) out.push_back({std::min(x.id, y.id), std::max(x.id, y.id)});
  };
  std::vector<std::vector<BodyPair>> found(strips.count + 1);  // by strip; those of wide boxes
  executor.for_blocks(strips.count, 1, [&](std::size_t strip, std::size_t) {
    const std::vector<Entry>& here = members[strip];
    for (std::size_t i = 0; i < here.size(); ++i) {
      for (std::size_t j = i + 1; j < here.size() && here[j].box.lower[axis] <= here[i].box.upper[axis]; ++j) {
        // Two that share several strips meet in the first of them.
        if (strip == std::max(here[i].first, here[j].first)) join(here[i], here[j], found[strip]);
      }
    }
  });
  for (std::size_t i = 0; i < wide.size(); ++i) {
    for (std::size_t j = i + 1; j < wide.size(); ++j) join(wide[i], wide[j], found.back());
    for (const Entry& e : entry) {
      if (!e.wide()) join(wide[i], e, found.back());
    }
  }
  // In order: by the first body through counts, by the second within its few.
  std::vector<std::uint32_t> offset(boxes.size() + 2, 0);
  for (const auto& some : found) {
    for (const BodyPair& pair : some) ++offset[pair.a + 2];
  }
  for (std::size_t i = 2; i < offset.size(); ++i) offset[i] += offset[i - 1];
  std::vector<BodyPair> pairs(offset.back());
  for (const auto& some : found) {
    for (const BodyPair& pair : some) pairs[offset[pair.a + 1]++] = pair;
  }
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    std::sort(pairs.begin() + offset[i], pairs.begin() + offset[i + 1]);
  }
  return pairs;
}

std::vector<BodyPair> broad_phase(std::span<const ContactBody> bodies, const ContactRules& rules, const Executor& executor,
                                  std::uint64_t* present) {
  std::vector<Box> box;
  box.reserve(bodies.size());
  for (const ContactBody& body : bodies) box.push_back(body.field ? body.field.surface_box() : Box{});
  std::vector<BodyPair> pairs = overlapping_boxes(box, executor);
  std::erase_if(pairs, [&](const BodyPair& pair) { return !allowed(bodies, rules, pair.a, pair.b); });
  if (present != nullptr) *present = count_allowed(bodies, rules);
  return pairs;
}

void find_contacts(std::span<const ContactBody> bodies, std::span<const BodyPair> pairs, const Executor& executor,
                   ContactCandidates& out) {
  // Seeds of one pair lie in a slot of its own, so that blocks may run in any order.
  struct Slot {
    Box overlap;
    double spacing = 0.0;
    bool convex = false;
    std::vector<Vec3> seed;
  };
  thread_local std::vector<Slot> slots;
  thread_local std::vector<double> spacing;
  struct Job {
    std::span<const ContactBody> bodies;
    std::span<const BodyPair> pairs;
    std::vector<Slot>& slots;
    std::vector<double>& spacing;
  } job{bodies, pairs, slots, spacing};

  if (slots.size() < pairs.size()) slots.resize(pairs.size());
  spacing.resize(bodies.size());
  constexpr std::size_t kBlock = 4;
  executor.for_blocks(bodies.size(), kBlock, [&job](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) job.spacing[i] = sample_spacing(job.bodies[i]);
  });
  executor.for_blocks(pairs.size(), kBlock, [&job](std::size_t begin, std::size_t end) {
    thread_local Scratch scratch;
    for (std::size_t k = begin; k < end; ++k) {
      const ContactBody& a = job.bodies[job.pairs[k].a];
      const ContactBody& b = job.bodies[job.pairs[k].b];
      Slot& slot = job.slots[k];
      slot.overlap = a.field.surface_box().intersection(b.field.surface_box());
      slot.seed.clear();
      const std::optional<Between> between = between_cores(a, b);
      slot.convex = between.has_value();
      slot.spacing = 0.0;
      if (slot.convex) {
        if (!between->apart) slot.seed.push_back(between->middle);
        continue;
      }
      slot.spacing = std::max(job.spacing[job.pairs[k].a], job.spacing[job.pairs[k].b]);
      const Box near = slot.overlap.inflated(slot.spacing);
      collect(a, b, near, job.spacing[job.pairs[k].a], scratch, slot.seed);
      collect(b, a, near, job.spacing[job.pairs[k].b], scratch, slot.seed);
    }
  });

  out.pair.clear();
  out.overlap.clear();
  out.spacing.clear();
  out.convex.clear();
  out.seed.clear();
  out.offset.assign(1, 0);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Slot& slot = slots[k];
    if (slot.seed.empty() && (slot.convex || slot.spacing > 0.0)) continue;
    out.pair.push_back(pairs[k]);
    out.overlap.push_back(slot.overlap);
    out.spacing.push_back(slot.spacing);
    out.convex.push_back(slot.convex ? 1 : 0);
    out.seed.insert(out.seed.end(), slot.seed.begin(), slot.seed.end());
    out.offset.push_back(static_cast<std::uint32_t>(out.seed.size()));
  }
}

}  // namespace supple::collision
