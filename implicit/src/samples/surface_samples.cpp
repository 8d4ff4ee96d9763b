#include "supple/implicit/surface_samples.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include "field/ray_box.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr std::size_t kBlock = 64;      // seeds projected together
constexpr std::size_t kMostSteps = 32;  // station intervals of a ray
constexpr double kEps = std::numeric_limits<double>::epsilon();
/// Least cosine between ray and normal that an area is divided by: beyond, the ray is no measure of the surface.
constexpr double kLeastCosine = 1.0 / 16.0;

/// A stretch of a ray at whose lower end F > 0 and at whose upper end F <= 0.
struct Exit {
  double low, high;
  double guess;
};

/// Value and derivative at one station of a ray.
struct Station {
  double t, f, slope;
};

/// Where the cubic through two stations has its extremum between them; nothing when it has none.
bool hermite_extremum(const Station& a, const Station& b, double& t) {
  const double h = b.t - a.t;
  const double c1 = h * a.slope;
  const double c2 = 3.0 * (b.f - a.f) - h * (2.0 * a.slope + b.slope);
  const double c3 = h * (a.slope + b.slope) - 2.0 * (b.f - a.f);
  // c1 + 2 c2 s + 3 c3 s^2 changes sign exactly once in (0, 1), for the end slopes have opposite signs.
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 24; ++i) {
    const double s = 0.5 * (low + high);
    const double derivative = c1 + s * (2.0 * c2 + s * 3.0 * c3);
    ((derivative > 0.0) == (a.slope > 0.0) ? low : high) = s;
  }
  t = a.t + h * 0.5 * (low + high);
  return t > a.t && t < b.t;
}

struct Seed {
  std::size_t id = 0;
  Vec3 origin, direction;
  std::array<Exit, kMostSteps + 1> exits;  // outermost first
  std::size_t exit_count = 0;
  std::size_t next_exit = 0;
  // Of the root that is being sought or was found last.
  Exit exit{};
  double t = 0.0, last_step = 0.0;
  Vec3 gradient;
  // The outermost root, kept while others are tried.
  double first_t = -1.0;
  Vec3 first_gradient;
  bool valid = false;
};

/// Buffers of one thread, reused from block to block and from step to step.
struct Scratch {
  std::vector<Vec3> points, gradients;
  std::vector<double> values;
  FieldParts parts;
  std::array<Seed, kBlock> seeds;
  std::vector<std::size_t> open, searching;
};

/// Data shared by all blocks of one call.
struct Task {
  const Skeleton& skeleton;
  const SampleLayout& layout;
  std::span<const Pose> parts;
  const FieldView& field;
  std::span<const std::uint8_t> active;
  std::span<const Box> near;
  SampleState& state;
  SurfaceSamples& out;
  RigidSamples* rigid;

  [[nodiscard]] bool is_near(const Vec3& from, const Vec3& along, double reach) const {
    return near.empty() || std::any_of(near.begin(), near.end(), [&](const Box& box) { return ray_meets(box, from, along, reach); });
  }
};

class BlockProjector {
 public:
  BlockProjector(const Task& task, Scratch& scratch) : task_(task), scratch_(scratch) {}

  void project(std::size_t begin, std::size_t end) {
    clear(begin, end);
    gather(begin, end);
    if (count_ == 0) return;
    task_.out.written[begin / kBlock] = 1;
    if (task_.rigid == nullptr) {
      find();
    } else {
      if (task_.rigid->found[begin / kBlock] == 0) {
        find_rigid(begin, end);
        gather(begin, end);
      }
      move();
    }
    for (std::size_t i = 0; i < count_; ++i) finish(scratch_.seeds[i]);
  }
  [[nodiscard]] std::size_t visited() const { return count_; }
  [[nodiscard]] std::size_t failures() const {
    return static_cast<std::size_t>(std::count_if(scratch_.seeds.begin(), scratch_.seeds.begin() + static_cast<std::ptrdiff_t>(count_),
                                                  [&](const Seed& seed) { return task_.state.distance[seed.id] < 0.0; }));
  }

 private:
  /// The seeds that come near.
  void gather(std::size_t begin, std::size_t end) {
    count_ = 0;
    for (std::size_t s = begin; s < end; ++s) {
      if (!task_.active.empty() && task_.active[task_.layout.part[s]] == 0) continue;
      const Pose& pose = task_.parts[task_.layout.part[s]];
      const Vec3 origin = pose.to_world(task_.layout.foot[s]), direction = pose.orientation * task_.layout.direction[s];
      if (!task_.is_near(origin, direction, task_.layout.reach[s])) continue;
      Seed& seed = scratch_.seeds[count_++];
      seed.id = s;
      seed.origin = origin;
      seed.direction = direction;
      seed.exit_count = 0;
      seed.next_exit = 0;
      seed.first_t = -1.0;
      seed.valid = false;
    }
  }

  void find() {
    find_exits();
    for (;;) {
      scratch_.open.clear();
      for (std::size_t i = 0; i < count_; ++i) {
        Seed& seed = scratch_.seeds[i];
        if (seed.valid || seed.next_exit == seed.exit_count) continue;
        seed.exit = seed.exits[seed.next_exit++];
        scratch_.open.push_back(i);
      }
      if (scratch_.open.empty()) break;
      find_roots();
      check_territories();
    }
  }

  /// All seeds of the block, in the frame of the part.
  void find_rigid(std::size_t begin, std::size_t end) {
    RigidSamples& rigid = *task_.rigid;
    static const Pose kOwnFrame;
    const FieldView field = rigid.field;
    const Task own{task_.skeleton, task_.layout, {&kOwnFrame, 1}, field, {}, {}, rigid.state, rigid.samples, nullptr};
    BlockProjector(own, scratch_).project(begin, end);
    rigid.found[begin / kBlock] = 1;
  }

  void move() {
    for (std::size_t i = 0; i < count_; ++i) {
      Seed& seed = scratch_.seeds[i];
      seed.t = seed.first_t = task_.rigid->state.distance[seed.id];
      seed.gradient = seed.first_gradient = -(task_.parts[0].orientation * task_.rigid->samples.normal[seed.id]);
      seed.valid = task_.rigid->samples.valid[seed.id] != 0;
    }
  }

  void clear(std::size_t begin, std::size_t end) {
    std::uint8_t& written = task_.out.written[begin / kBlock];
    if (written == 0) return;
    for (std::size_t s = begin; s < end; ++s) {
      task_.out.point[s] = Vec3::Zero();
      task_.out.normal[s] = Vec3::Zero();
      task_.out.area[s] = 0.0;
      task_.out.valid[s] = 0;
    }
    written = 0;
  }

  void evaluate(std::size_t n) {
    scratch_.values.resize(n);
    scratch_.gradients.resize(n);
    task_.field.evaluate(scratch_.points, scratch_.values, scratch_.gradients);
  }

  /// Values at fixed stations along every ray, and the stretches where F turns from positive to not.
  void find_exits() {
    double longest = 0.0;
    for (std::size_t i = 0; i < count_; ++i) longest = std::max(longest, task_.layout.reach[scratch_.seeds[i].id]);
    const double wanted = std::ceil(4.0 * longest / task_.field.feature_size());
    const std::size_t steps = static_cast<std::size_t>(std::clamp(wanted, 4.0, static_cast<double>(kMostSteps)));
    scratch_.points.resize(count_ * (steps + 1));
    for (std::size_t i = 0; i < count_; ++i) {
      const Seed& seed = scratch_.seeds[i];
      const double step = task_.layout.reach[seed.id] / static_cast<double>(steps);
      for (std::size_t j = 0; j <= steps; ++j) {
        scratch_.points[i * (steps + 1) + j] = seed.origin + step * static_cast<double>(j) * seed.direction;
      }
    }
    evaluate(scratch_.points.size());
    for (std::size_t i = 0; i < count_; ++i) {
      Seed& seed = scratch_.seeds[i];
      const double step = task_.layout.reach[seed.id] / static_cast<double>(steps);
      const auto station = [&](std::size_t j) -> Station {
        const std::size_t k = i * (steps + 1) + j;
        return {step * static_cast<double>(j), scratch_.values[k], scratch_.gradients[k].dot(seed.direction)};
      };
      const double kept = task_.state.distance[seed.id];
      Station b = station(steps);
      for (std::size_t j = steps; j-- > 0;) {
        const Station a = station(j);
        add_exit(seed, a, b, kept);
        b = a;
      }
    }
  }

  void add_exit(Seed& seed, Station a, Station b, double kept) {
    const bool inside_a = a.f > 0.0;
    const bool inside_b = b.f > 0.0;
    if (inside_a == inside_b) {
      // A hump between two outer stations or a dip between two inner ones may hide two roots.
      const double towards = inside_a ? -1.0 : 1.0;
      if (!(towards * a.slope > 0.0 && towards * b.slope < 0.0)) return;
      double t;
      if (!hermite_extremum(a, b, t)) return;
      const double f = task_.field.value(seed.origin + t * seed.direction);
      if ((f > 0.0) == inside_a) return;
      (inside_a ? b : a) = Station{t, f, 0.0};
    } else if (!inside_a) {
      return;  // the ray enters here
    }
    if (seed.exit_count == seed.exits.size()) return;
    const double secant = a.t + (b.t - a.t) * (a.f / (a.f - b.f));
    const bool keeps = kept > a.t && kept < b.t;
    seed.exits[seed.exit_count++] = {a.t, b.t, keeps ? kept : secant};
  }

  /// Bracketed Newton on the open seeds, all of a round in one batch; converged seeds leave the batch.
  void find_roots() {
    scratch_.searching.assign(scratch_.open.begin(), scratch_.open.end());
    for (const std::size_t i : scratch_.searching) {
      scratch_.seeds[i].t = scratch_.seeds[i].exit.guess;
      scratch_.seeds[i].last_step = scratch_.seeds[i].exit.high - scratch_.seeds[i].exit.low;
    }
    while (!scratch_.searching.empty()) {
      scratch_.points.resize(scratch_.searching.size());
      for (std::size_t k = 0; k < scratch_.searching.size(); ++k) {
        const Seed& seed = scratch_.seeds[scratch_.searching[k]];
        scratch_.points[k] = seed.origin + seed.t * seed.direction;
      }
      evaluate(scratch_.searching.size());
      std::size_t left = 0;
      for (std::size_t k = 0; k < scratch_.searching.size(); ++k) {
        Seed& seed = scratch_.seeds[scratch_.searching[k]];
        const double f = scratch_.values[k];
        seed.gradient = scratch_.gradients[k];
        if (f == 0.0) continue;
        Exit& exit = seed.exit;
        (f > 0.0 ? exit.low : exit.high) = seed.t;
        double next = seed.t - f / seed.gradient.dot(seed.direction);
        if (!(next >= exit.low && next <= exit.high) || std::abs(next - seed.t) > 0.5 * seed.last_step) {
          next = 0.5 * (exit.low + exit.high);
        }
        seed.last_step = std::abs(next - seed.t);
        // A step this small is round-off: not taken, so that a root that is kept is found again bit by bit.
        if (!(seed.last_step > 4.0 * kEps * task_.layout.reach[seed.id])) continue;
        seed.t = next;
        scratch_.searching[left++] = scratch_.searching[k];
      }
      scratch_.searching.resize(left);
    }
  }

  /// Own contribution against all others at the roots of this round.
  void check_territories() {
    scratch_.points.resize(scratch_.open.size());
    for (std::size_t k = 0; k < scratch_.open.size(); ++k) {
      const Seed& seed = scratch_.seeds[scratch_.open[k]];
      scratch_.points[k] = seed.origin + seed.t * seed.direction;
    }
    task_.field.evaluate_parts(scratch_.points, scratch_.parts);
    for (std::size_t k = 0; k < scratch_.open.size(); ++k) {
      Seed& seed = scratch_.seeds[scratch_.open[k]];
      seed.valid = contributes_most(k, task_.layout.primitive[seed.id]);
      if (seed.first_t < 0.0) {
        seed.first_t = seed.t;
        seed.first_gradient = seed.gradient;
      }
    }
  }

  /// Whether primitive `own` contributes most at point k of the scratch; ties go to the lower primitive.
  [[nodiscard]] bool contributes_most(std::size_t k, std::uint32_t own) const {
    double largest = 0.0;
    std::size_t winner = task_.skeleton.primitive.size();
    for (std::uint32_t r = scratch_.parts.offset[k]; r < scratch_.parts.offset[k + 1]; ++r) {
      const auto [begin, end] = primitives_of(scratch_.parts.part[r]);
      for (std::size_t p = begin; p < end; ++p) {
        const double f = end - begin == 1 ? scratch_.parts.value[r] : contribution(p, scratch_.points[k]);
        if (f > largest) {
          largest = f;
          winner = p;
        }
      }
    }
    return winner == own;
  }

  [[nodiscard]] std::pair<std::size_t, std::size_t> primitives_of(std::uint32_t part) const {
    const auto& all = task_.skeleton.primitive;
    const auto first = std::partition_point(all.begin(), all.end(), [&](const Primitive& p) { return p.part < part; });
    auto last = first;
    while (last != all.end() && last->part == part) ++last;
    return {static_cast<std::size_t>(first - all.begin()), static_cast<std::size_t>(last - all.begin())};
  }

  [[nodiscard]] double contribution(std::size_t primitive, const Vec3& x) const {
    const Primitive& p = task_.skeleton.primitive[primitive];
    const Vec3 y = p.offset.to_body(task_.parts[p.part].to_body(x));
    return potential(p, y).value;
  }

  void finish(const Seed& seed) {
    const double t = seed.valid ? seed.t : seed.first_t;
    const Vec3& gradient = seed.valid ? seed.gradient : seed.first_gradient;
    task_.state.distance[seed.id] = t;
    if (t < 0.0) return;
    task_.out.point[seed.id] = seed.origin + t * seed.direction;
    const double norm = gradient.norm();
    if (!(norm > 0.0)) return;
    task_.out.normal[seed.id] = -gradient / norm;
    if (!seed.valid) return;
    const Vec3& spread = task_.layout.spread[seed.id];
    const double cosine = std::max(task_.out.normal[seed.id].dot(seed.direction), kLeastCosine);
    // Negative beyond the centre of curvature of a curve, where its other pieces count.
    task_.out.area[seed.id] = std::max(spread.x() + t * (spread.y() + t * spread.z()), 0.0) / cosine;
    task_.out.valid[seed.id] = 1;
  }

  const Task& task_;
  Scratch& scratch_;
  std::size_t count_ = 0;  // seeds in use
};

}  // namespace

void SampleState::save(StateWriter& out) const { out.write(std::span<const double>(distance)); }
void SampleState::load(StateReader& in) { in.read(distance); }
void SampleState::hash(Hasher& hasher) const { hasher.add(std::span<const double>(distance)); }

namespace {

void prepare(std::size_t seeds, SampleState& state, SurfaceSamples& out) {
  if (state.distance.size() != seeds) state.distance.assign(seeds, -1.0);
  const std::size_t blocks = (seeds + kBlock - 1) / kBlock;
  if (out.point.size() == seeds && out.written.size() == blocks) return;
  out.point.assign(seeds, Vec3::Zero());
  out.normal.assign(seeds, Vec3::Zero());
  out.area.assign(seeds, 0.0);
  out.valid.assign(seeds, 0);
  out.written.assign(blocks, 0);
}

void prepare(const SampledBody& body, RigidSamples& rigid) {
  const std::size_t seeds = body.layout.size();
  if (rigid.samples.point.size() == seeds) return;
  const Pose own_frame;
  place_skeleton(body.skeleton, {&own_frame, 1}, rigid.placed);
  index_field(body.skeleton, rigid.placed, rigid.field);
  prepare(seeds, rigid.state, rigid.samples);
  rigid.found.assign(rigid.samples.written.size(), 0);
}

}  // namespace

void sample_surface(const SampledBody& body, const SampledRegion& region, const Executor& executor, SampleState& state,
                    SurfaceSamples& out) {
  SUPPLE_EXPECTS(body.parts.size() == body.skeleton.part_count);
  SUPPLE_EXPECTS(region.active.empty() || region.active.size() == body.parts.size());
  SUPPLE_EXPECTS(body.rigid == nullptr || body.parts.size() == 1);
  const std::size_t n = body.layout.size();
  prepare(n, state, out);
  if (body.rigid != nullptr) prepare(body, *body.rigid);
  const Task task{body.skeleton, body.layout, body.parts, body.field, region.active, region.near, state, out, body.rigid};
  struct Job {
    const Task& task;
    std::atomic<std::uint64_t> visited{0}, failures{0};
  } job{task};
  executor.for_blocks(n, kBlock, [&job](std::size_t begin, std::size_t end) {
    thread_local Scratch scratch;
    BlockProjector block(job.task, scratch);
    block.project(begin, end);
    job.visited += block.visited();
    job.failures += block.failures();
  });
  out.visited = job.visited;
  out.failures = job.failures;
}

}  // namespace supple::implicit
