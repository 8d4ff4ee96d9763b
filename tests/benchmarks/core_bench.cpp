/// @file core_bench.cpp
/// Times of oriented particles, one JSON object per line: name, particles, time, size, hash of the result, peak
/// memory. Times are the least of several repeats, CPU time of the process; lines with two threads give wall time.
#include <sys/resource.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "core/support.h"
#include "programs.h"
#include "spiral_kernel.h"
#include "supple/core/gay_berne.h"
#include "supple/core/hash.h"
#include "supple/core/integrate.h"
#include "supple/core/interactions.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::core;

double seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Least time of `work` over at least `repeats` measurements and a span [s]. Work too short for the clock is timed many times in a row.
double least_time(int repeats, clockid_t clock, const std::function<void()>& work, double span = 0.3) {
  constexpr double kShortest = 1e-4;  // [s]
  double best = std::numeric_limits<double>::infinity();
  double total = 0.0;
  int in_a_row = 1;
  for (int k = 0; k < 10000 && (k < repeats || total < span);) {
    const double start = seconds(clock);
    for (int n = 0; n < in_a_row; ++n) work();
    const double time = seconds(clock) - start;
    if (time < kShortest && in_a_row < 65536) {
      in_a_row *= 2;
      continue;
    }
    best = std::min(best, time / in_a_row);
    total += time;
    ++k;
  }
  return best;
}

struct Line {
  std::string name;
  std::size_t particles = 0;
  int threads = 1;
  double time = 0.0;   ///< of one item [s]
  std::string rate;    ///< further fields, ", "-separated JSON
  std::uint64_t hash = 0;
};

void print(const Line& line) {
  std::printf("{\"name\": \"core/%s\", \"particles\": %zu, \"threads\": %d, \"ns_per_particle\": %.4g, \"us\": %.5g"
              "%s%s, \"peak_mb\": %.1f, \"hash\": \"%s\"}\n",
              line.name.c_str(), line.particles, line.threads, 1e9 * line.time / static_cast<double>(line.particles),
              1e6 * line.time, line.rate.empty() ? "" : ", ", line.rate.c_str(), peak_megabytes(),
              to_hex(line.hash).c_str());
  std::fflush(stdout);
}

std::string field(const char* name, double value) {
  char text[96];
  std::snprintf(text, sizeof text, "\"%s\": %.10g", name, value);
  return text;
}

std::uint64_t hash_of(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  Hasher hasher;
  hasher.add(a);
  hasher.add(b);
  return hasher.value();
}

std::vector<double> read_doubles(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) {
    std::fprintf(stderr, "%s: cannot be read\n", path.c_str());
    std::exit(2);
  }
  std::vector<double> values(static_cast<std::size_t>(in.tellg()) / sizeof(double));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(double)));
  return values;
}

/// Forces of what acts between the particles, by the stage that scenes run.
class Forces {
 public:
  Forces(const test::Particles& p, Interactions all) : all_(std::move(all)), workspace_(p.set, all_) {}
  const Loads& at(const test::Particles& p, const Executor& executor) { return at(p.set, p.state, executor); }
  const Loads& at(const ParticleSet& set, const ParticleState& state, const Executor& executor) {
    loads_.reset(set.size());
    external_.reset(set.size());
    counts = accumulate_interactions(set, state, all_, executor, workspace_, loads_);
    add_external_loads(set, all_, 0.0, external_);
    return loads_;
  }
  InteractionCounts counts;

 private:
  Interactions all_;
  InteractionWorkspace workspace_;
  Loads loads_, external_;
};

/// Lennard-Jones atoms in open space, in reduced units: m = epsilon = sigma = 1, cut-off 2.5 without a shift, time step 0.005.
struct Melt {
  static constexpr double kCutOff = 2.5;
  test::Particles p;

  /// fcc of density 0.8442 with cells^3 unit cells, at temperature 3.
  explicit Melt(int cells) {
    const double edge = std::cbrt(4.0 / 0.8442);
    std::mt19937_64 engine(87287);
    std::normal_distribution<double> normal;
    for (int i = 0; i < cells * cells * cells; ++i) {
      const Vec3 corner(i / cells / cells, i / cells % cells, i % cells);
      for (const Vec3& basis : {Vec3(0, 0, 0), Vec3(0.5, 0.5, 0), Vec3(0.5, 0, 0.5), Vec3(0, 0.5, 0.5)}) {
        p.add(edge * (corner + basis));
        p.state.velocity.back() = Vec3(normal(engine), normal(engine), normal(engine));
      }
    }
    std::vector<Vec3>& v = p.state.velocity;
    Vec3 mean = Vec3::Zero();
    for (const Vec3& u : v) mean += u / static_cast<double>(v.size());
    double squares = 0.0;
    for (Vec3& u : v) squares += (u -= mean).squaredNorm();
    const double scale = std::sqrt(9.0 * static_cast<double>(v.size() - 1) / squares);
    for (Vec3& u : v) u *= scale;
  }
  /// Positions and velocities as doubles in a file.
  explicit Melt(const std::string& path) {
    const std::vector<double> values = read_doubles(path);
    const std::size_t n = values.size() / 6;
    for (std::size_t i = 0; i < n; ++i) {
      p.add(Vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]));
      p.state.velocity.back() = Vec3(values[3 * (n + i)], values[3 * (n + i) + 1], values[3 * (n + i) + 2]);
    }
  }
  [[nodiscard]] static LennardJones law() { return {.r0 = std::cbrt(std::sqrt(2.0)), .depth = 1.0}; }
  [[nodiscard]] Forces forces() const {
    Interactions all;
    all.geometric_lennard_jones.push_back({.name = "melt", .range = kCutOff, .law = law()});
    return {p, all};
  }
  /// Velocity Verlet, whose forces are those of the last step.
  void step(Forces& forces, const Loads*& loads, const Executor& executor) {
    static constexpr double kStep = 0.005;
    constexpr std::size_t kBlock = 4096;
    const auto kick_and_drift = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        p.state.velocity[i] += 0.5 * kStep * loads->force[i];
        p.state.position[i] += kStep * p.state.velocity[i];
      }
    };
    const auto kick = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) p.state.velocity[i] += 0.5 * kStep * loads->force[i];
    };
    executor.for_blocks(p.set.size(), kBlock, std::cref(kick_and_drift));
    loads = &forces.at(p, executor);
    executor.for_blocks(p.set.size(), kBlock, std::cref(kick));
  }
  /// Temperature, potential and total energy per atom, by the law of one pair over all pairs in range.
  [[nodiscard]] std::string thermo(const std::string& prefix) const {
    double potential = 0.0, squares = 0.0;
    for (const IndexPair& pair : find_neighbours(p.state.position, kCutOff)) {
      potential += law().energy((p.state.position[pair.second] - p.state.position[pair.first]).norm());
    }
    for (const Vec3& u : p.state.velocity) squares += u.squaredNorm();
    const auto n = static_cast<double>(p.set.size());
    return field((prefix + "_temperature").c_str(), squares / (3.0 * (n - 1.0))) + ", " +
           field((prefix + "_potential").c_str(), potential / n) + ", " +
           field((prefix + "_energy").c_str(), (potential + 0.5 * squares) / n);
  }
};

void bench_melt(Melt melt, int steps, int repeats) {
  const Executor executor(1);
  const ParticleState start = melt.p.state;
  const std::string first = melt.thermo("first");
  double best = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < repeats; ++repeat) {
    melt.p.state = start;
    Forces forces = melt.forces();
    const Loads* loads = &forces.at(melt.p, executor);
    const double begin = seconds(CLOCK_PROCESS_CPUTIME_ID);
    for (int k = 0; k < steps; ++k) melt.step(forces, loads, executor);
    best = std::min(best, (seconds(CLOCK_PROCESS_CPUTIME_ID) - begin) / steps);
  }
  const std::size_t n = melt.p.set.size();
  print({.name = "melt/steps=" + std::to_string(steps),
         .particles = n,
         .time = best,
         .rate = field("atom_steps_per_s", static_cast<double>(n) / best) + ", " + first + ", " + melt.thermo("last"),
         .hash = hash_of(melt.p.state.position, melt.p.state.velocity)});
}

/// Gay-Berne ellipsoids in open space, in reduced units: axes 1, 1.5 and 2, wells 1, 0.5 and 0.2, cut-off 4 without a switch
/// that would be felt, time step 0.002.
struct Ellipsoids {
  static constexpr double kRange = 4.0, kMass = 1.5;
  const SwitchedGayBerne law{.ellipsoid = {.radii = Vec3(0.5, 0.75, 1.0), .well = Vec3(1.0, 0.5, 0.2), .upsilon = 3, .mu = 1},
                             .switch_from = kRange * (1.0 - 1e-12),
                             .cut_off = kRange};
  test::Particles p;

  void add(const Vec3& x, const Vec3& v, const Quat& q) {
    const Vec3 r2 = law.ellipsoid.radii.cwiseAbs2();
    p.add(x, kMass);
    p.set.inertia.back() = kMass / 5.0 * Vec3(r2.y() + r2.z(), r2.z() + r2.x(), r2.x() + r2.y());
    p.state.velocity.back() = v;
    p.state.orientation.back() = q;
  }
  /// Density 0.22, side^3 ellipsoids.
  explicit Ellipsoids(int side) {
    test::Draw draw(982381);
    const double edge = std::cbrt(1.0 / 0.22);
    for (int i = 0; i < side * side * side; ++i) {
      add(edge * Vec3(i / side / side, i / side % side, i % side), draw.vector(1.5), draw.rotation());
    }
  }
  /// Positions, velocities, orientations (w, x, y, z) and angular momenta as doubles in a file.
  explicit Ellipsoids(const std::string& path) {
    const std::vector<double> values = read_doubles(path);
    const std::size_t n = values.size() / 13;
    const double* const x = values.data();
    const double* const v = x + 3 * n;
    const double* const q = v + 3 * n;
    const double* const l = q + 4 * n;
    for (std::size_t i = 0; i < n; ++i) {
      add(Vec3(x[3 * i], x[3 * i + 1], x[3 * i + 2]), Vec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]),
          Quat(q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]));
      p.state.angular_momentum.back() = Vec3(l[3 * i], l[3 * i + 1], l[3 * i + 2]);
    }
  }
  [[nodiscard]] Forces forces() const {
    Interactions all;
    all.gay_berne.push_back({.name = "ellipsoids", .range = kRange, .law = law});
    return {p, all};
  }
  /// Energies per particle, by the law of one pair over all pairs in range.
  [[nodiscard]] std::string thermo(const std::string& prefix) const {
    double potential = 0.0;
    for (const IndexPair& pair : find_neighbours(p.state.position, kRange)) {
      potential += evaluate(law, test::pair_pose(p, pair.first, pair.second)).energy;
    }
    const auto n = static_cast<double>(p.set.size());
    return field((prefix + "_potential").c_str(), potential / n) + ", " +
           field((prefix + "_energy").c_str(), (potential + measure_motion(p.set, p.state).kinetic_energy) / n);
  }
};

void bench_ellipsoids(Ellipsoids all, int steps, int repeats) {
  const Executor executor(1);
  const ParticleState start = all.p.state;
  const std::string first = all.thermo("first");
  double best = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < repeats; ++repeat) {
    all.p.state = start;
    Forces forces = all.forces();
    const ForceModel model = [&](const ParticleState& state, double, ForceSample& out) {
      out.external.reset(state.size());
      out.internal = forces.at(all.p.set, state, executor);
    };
    KickState kick;
    Ledger ledger;
    forces.at(all.p, executor);
    const double begin = seconds(CLOCK_PROCESS_CPUTIME_ID);
    for (int k = 0; k < steps; ++k) {
      advance({all.p.set, {}, model}, 0.002 * k, 0.002, {all.p.state, kick, ledger});
    }
    best = std::min(best, (seconds(CLOCK_PROCESS_CPUTIME_ID) - begin) / steps);
  }
  print({.name = "gay_berne/steps=" + std::to_string(steps),
         .particles = all.p.set.size(),
         .time = best,
         .rate = field("particle_steps_per_s", static_cast<double>(all.p.set.size()) / best) + ", " + first + ", " +
                 all.thermo("last"),
         .hash = hash_of(all.p.state.position, all.p.state.angular_momentum)});
}

constexpr double kCrowdRange = 2.5;

/// Particles with normals on a disturbed cubic lattice of spacing 1.
test::Particles make_crowd(std::size_t count) {
  test::Draw draw(17);
  test::Particles p;
  const auto side = static_cast<std::size_t>(std::ceil(std::cbrt(static_cast<double>(count))));
  for (std::size_t i = 0; i < count; ++i) {
    const auto z = static_cast<double>(i % side), y = static_cast<double>(i / side % side);
    p.add(Vec3(static_cast<double>(i / side / side), y, z) + draw.vector(0.2));
    p.set.normal.back() = draw.direction();
  }
  return p;
}

struct LawOfACrowd {
  const char* name;
  Interactions all;
};
std::vector<LawOfACrowd> laws_of_a_crowd() {
  const Weight weight{.range = kCrowdRange};
  const auto of = [](auto member, auto law) {
    Interactions all;
    (all.*member).push_back({.name = "law", .range = kCrowdRange, .law = law});
    return all;
  };
  return {{"lennard_jones", of(&Interactions::geometric_lennard_jones, Melt::law())},
          {"cohesion", of(&Interactions::geometric_cohesion, Cohesion{.r0 = 1.0, .f0 = 1.0, .a = 4.0})},
          {"repulsion", of(&Interactions::repulsion, Repulsion{.force = 1.0, .distance = 1.0, .length = 0.3, .tolerance = 6e-3})},
          {"coplanarity", of(&Interactions::geometric_coplanarity, Coplanarity{.strength = 0.4, .weight = weight})},
          {"co_normality", of(&Interactions::geometric_co_normality, CoNormality{.strength = 0.2, .weight = weight})},
          {"co_circularity", of(&Interactions::geometric_co_circularity, CoCircularity{.strength = 0.1, .weight = weight})}};
}

void bench_laws(std::size_t count) {
  const test::Particles p = make_crowd(count);
  const Executor executor(1);
  for (const LawOfACrowd& law : laws_of_a_crowd()) {
    Forces forces(p, law.all);
    std::uint64_t hash = 0;
    const double time = least_time(10, CLOCK_PROCESS_CPUTIME_ID, [&] { hash = test::hash_of(forces.at(p, executor)); });
    const auto pairs = static_cast<double>(forces.counts.pairs_present);
    print({.name = std::string("laws/") + law.name,
           .particles = count,
           .time = time,
           .rate = field("pairs_per_s", pairs / time) + ", " + field("pairs_per_particle", pairs / static_cast<double>(count)),
           .hash = hash});
  }
}

/// What new lists take: evaluations that make them, less those that keep them.
void bench_lists(std::size_t count) {
  test::Particles p = make_crowd(count), moved = p;
  for (Vec3& x : moved.state.position) x.x() += 0.4;
  const Executor executor(1);
  Forces forces(p, laws_of_a_crowd()[0].all);
  const double kept = least_time(6, CLOCK_PROCESS_CPUTIME_ID, [&] { forces.at(p, executor); });
  bool there = false;
  const double made = least_time(6, CLOCK_PROCESS_CPUTIME_ID, [&] {
    forces.at(there ? p : moved, executor);
    there = !there;
  });
  print({.name = "list_build",
         .particles = count,
         .time = made - kept,
         .rate = field("distances_per_particle", static_cast<double>(forces.counts.pairs_visited) / static_cast<double>(count)),
         .hash = 0});
}

/// Wall time of `work` with one and with two threads, in turns: the least of many short runs, which finds the moments
/// in which a shared machine has both cores free.
void bench_two_threads(const std::string& name, std::size_t particles, const std::function<void(const Executor&)>& work) {
  const Executor one(1), two(2);
  double time_one = std::numeric_limits<double>::infinity(), time_two = time_one;
  for (int turn = 0; turn < 20; ++turn) {
    time_one = std::min(time_one, least_time(2, CLOCK_MONOTONIC, [&] { work(one); }, 0.1));
    time_two = std::min(time_two, least_time(2, CLOCK_MONOTONIC, [&] { work(two); }, 0.2));
  }
  print({.name = name + "/threads",
         .particles = particles,
         .threads = 2,
         .time = time_two,
         .rate = field("one_thread_us", 1e6 * time_one) + ", " + field("speed_up", time_one / time_two),
         .hash = 0});
}

void bench_threads() {
  for (const int cells : {20, 63}) {
    Melt melt(cells);
    Forces forces = melt.forces();
    const Loads* loads = &forces.at(melt.p, Executor(1));
    bench_two_threads("melt", melt.p.set.size(), [&](const Executor& executor) { melt.step(forces, loads, executor); });
  }
  for (const std::size_t count : {32000U, 1000000U}) {
    const test::Particles p = make_crowd(count);
    for (const LawOfACrowd& law : laws_of_a_crowd()) {
      Forces forces(p, law.all);
      bench_two_threads(std::string("laws/") + law.name, count, [&](const Executor& executor) { forces.at(p, executor); });
    }
  }
}

struct SpiralNumbers {
  double stretch = 400.0, rotation = 1.5, coplanarity = 2.0;
  double friction = 0.0, angular_friction = 0.0;
  double load = 0.1;  ///< on the first particle, along x
};
constexpr int kSpiralSteps = 1000;
constexpr double kSpiralStep = 1e-4;

/// A spiral with bond frames and co-planarity to second neighbours, with or without friction, stepped by `advance`.
class Spiral {
 public:
  Spiral(const test::Particles& rest, const SpiralNumbers& numbers) : rest_(rest) {
    all_.bond_frame.push_back(test::bond_frames(rest, numbers.stretch, numbers.rotation));
    all_.coplanarity.push_back(test::coplanarities(rest, numbers.coplanarity));
    if (numbers.friction > 0.0) {
      all_.friction.push_back({.name = "friction",
                               .first = all_.bond_frame[0].first,
                               .second = all_.bond_frame[0].second,
                               .linear = numbers.friction,
                               .angular = numbers.angular_friction});
    }
    all_.external.push_back({.particle = 0, .force = Vec3(numbers.load, 0.0, 0.0), .begin = 0.0, .end = 1e9});
    workspace_.emplace(rest.set, all_);
  }
  void run() {
    const ForceModel forces = [&](const ParticleState& at, double time, ForceSample& out) {
      accumulate_interactions(rest_.set, at, all_, executor_, *workspace_, out.internal);
      add_external_loads(rest_.set, all_, time, out.external);
    };
    state = rest_.state;
    kick_.valid = false;
    ledger_ = {};
    for (int k = 0; k < kSpiralSteps; ++k) {
      advance({rest_.set, all_, forces}, kSpiralStep * k, kSpiralStep, {state, kick_, ledger_});
    }
  }
  [[nodiscard]] std::size_t bonds() const { return all_.bond_frame[0].first.size(); }
  ParticleState state;

 private:
  const test::Particles& rest_;
  Interactions all_;
  const Executor executor_{1};
  std::optional<InteractionWorkspace> workspace_;
  KickState kick_;
  Ledger ledger_;
};

/// The same by the kernel of its own.
class HandSpiral {
 public:
  HandSpiral(const test::Particles& rest, const SpiralNumbers& numbers)
      : rest_{flat(rest.state.position), {}, flat(rest.state.velocity), flat(rest.state.angular_momentum)},
        chain_({.inverse_mass = 1.0 / rest.set.mass[0],
                .inverse_inertia = 1.0 / rest.set.inertia[0].x(),
                .stretch = numbers.stretch,
                .rotation = numbers.rotation,
                .coplanarity = numbers.coplanarity,
                .friction = numbers.friction,
                .angular_friction = numbers.angular_friction,
                .load = {numbers.load, 0.0, 0.0}},
               with_orientation(rest)) {}
  void run() {
    chain_.state = rest_;
    chain_.start();
    for (int k = 0; k < kSpiralSteps; ++k) chain_.step(kSpiralStep);
  }
  /// Largest difference of a coordinate.
  [[nodiscard]] double difference(const std::vector<Vec3>& position) const {
    double largest = 0.0;
    for (std::size_t k = 0; k < 3 * position.size(); ++k) {
      largest = std::max(largest, std::abs(chain_.state.position[k] - position[k / 3][static_cast<int>(k % 3)]));
    }
    return largest;
  }

 private:
  static std::vector<double> flat(const std::vector<Vec3>& rows) {
    std::vector<double> out;
    for (const Vec3& row : rows) out.insert(out.end(), row.data(), row.data() + 3);
    return out;
  }
  const benchmarks::ChainState& with_orientation(const test::Particles& rest) {
    for (const Quat& q : rest.state.orientation) {
      rest_.orientation.insert(rest_.orientation.end(), q.coeffs().data(), q.coeffs().data() + 4);
    }
    return rest_;
  }
  benchmarks::ChainState rest_;
  benchmarks::Chain chain_;
};

/// Both take turns, so that what else the machine does meets both.
void bench_spiral(int count, bool rubs) {
  const test::Particles rest = test::make_spiral(count);
  const SpiralNumbers numbers{.friction = rubs ? 0.2 : 0.0, .angular_friction = rubs ? 1e-3 : 0.0};
  Spiral spiral(rest, numbers);
  HandSpiral hand(rest, numbers);
  double time = std::numeric_limits<double>::infinity(), hand_time = time;
  for (int turn = 0; turn < 20; ++turn) {
    time = std::min(time, least_time(3, CLOCK_PROCESS_CPUTIME_ID, [&] { spiral.run(); }, 0.02));
    hand_time = std::min(hand_time, least_time(3, CLOCK_PROCESS_CPUTIME_ID, [&] { hand.run(); }, 0.02));
  }
  print({.name = rubs ? "spiral_step/friction" : "spiral_step",
         .particles = static_cast<std::size_t>(count),
         .time = time / kSpiralSteps,
         .rate = field("bonds", static_cast<double>(spiral.bonds())) + ", " +
                 field("hand_kernel_us", 1e6 * hand_time / kSpiralSteps) + ", " +
                 field("times_hand_kernel", time / hand_time) + ", " +
                 field("difference_m", hand.difference(spiral.state.position)),
         .hash = hash_of(spiral.state.position, spiral.state.velocity)});
}

}  // namespace

/// @param argv  melt [FILE [STEPS]], ellipsoids [FILE [STEPS]], threads, laws, lists, spiral; all when absent
int supple::benchmarks::programs::core_bench(int argc, char** argv) {
  constexpr std::string_view kUsage = "core_bench [melt|ellipsoids [FILE [STEPS]]]\n"
                                      "       core_bench laws|lists [MOST PARTICLES]\n"
                                      "       core_bench threads|spiral";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 3);
  const std::string_view what = argc > 1 ? argv[1] : "";
  if (argc > 1) {
    supple::benchmarks::expect_word(kUsage, what, std::array<std::string_view, 6>{"melt", "ellipsoids", "threads", "laws", "lists", "spiral"});
  }
  const auto steps = [&](int otherwise) { return argc > 3 ? supple::benchmarks::whole_number(kUsage, argv[3]) : otherwise; };
  const auto wanted = [&](std::string_view name) { return what.empty() || what == name; };
  if (wanted("melt")) bench_melt(argc > 2 ? Melt(argv[2]) : Melt(20), steps(100), 3);
  if (wanted("ellipsoids")) {
    bench_ellipsoids(argc > 2 ? Ellipsoids(argv[2]) : Ellipsoids(20), steps(50), 3);
  }
  const bool counts = what == "laws" || what == "lists";
  const auto most = counts && argc > 2 ? supple::benchmarks::whole_number<std::size_t>(kUsage, argv[2]) : 1000000;
  for (const std::size_t count : {100U, 1000U, 10000U, 32000U, 100000U, 1000000U}) {
    if (count > most) break;
    if (wanted("laws")) bench_laws(count);
    if (wanted("lists")) bench_lists(count);
  }
  if (wanted("spiral")) {
    for (const int count : {10, 100}) {
      for (const bool rubs : {false, true}) bench_spiral(count, rubs);
    }
  }
  if (wanted("threads")) bench_threads();
  return 0;
}
