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
#include "spiral_kernel.h"
#include "supple/core/gay_berne.h"
#include "supple/core/hash.h"
#include "supple/core/integrate.h"
#include "supple/core/neighbour_list.h"
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

/// Least time of `work` over at least `repeats` runs and a span [s].
double least_time(int repeats, clockid_t clock, const std::function<void()>& work, double span = 0.3) {
  double best = std::numeric_limits<double>::infinity();
  double total = 0.0;
  for (int k = 0; k < 10000 && (k < repeats || total < span); ++k) {
    const double start = seconds(clock);
    work();
    const double time = seconds(clock) - start;
    best = std::min(best, time);
    total += time;
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

/// Lennard-Jones atoms in reduced units: m = epsilon = sigma = 1, cut-off 2.5, skin 0.3, time step 0.005.
struct Melt {
  PeriodicBox box;
  std::vector<Vec3> x, v;
  Loads loads;
  NeighbourList list{2.5, 0.3};
  Precision precision = Precision::Double;
  std::size_t builds = 0;

  /// fcc of density 0.8442 with cells^3 unit cells, at temperature 3.
  explicit Melt(int cells) {
    const double edge = std::cbrt(4.0 / 0.8442);
    box.length = Vec3::Constant(cells * edge);
    std::mt19937_64 engine(87287);
    std::normal_distribution<double> normal;
    for (int i = 0; i < cells * cells * cells; ++i) {
      const Vec3 corner(i / cells / cells, i / cells % cells, i % cells);
      for (const Vec3& basis : {Vec3(0, 0, 0), Vec3(0.5, 0.5, 0), Vec3(0.5, 0, 0.5), Vec3(0, 0.5, 0.5)}) {
        x.push_back(edge * (corner + basis));
        v.push_back(Vec3(normal(engine), normal(engine), normal(engine)));
      }
    }
    Vec3 mean = Vec3::Zero();
    for (const Vec3& u : v) mean += u / static_cast<double>(v.size());
    double squares = 0.0;
    for (Vec3& u : v) squares += (u -= mean).squaredNorm();
    const double scale = std::sqrt(9.0 * static_cast<double>(v.size() - 1) / squares);
    for (Vec3& u : v) u *= scale;
  }
  /// Box length, positions and velocities as doubles in a file.
  explicit Melt(const std::string& path) {
    const std::vector<double> values = read_doubles(path);
    box.length = Vec3(values[0], values[1], values[2]);
    const std::size_t n = (values.size() - 3) / 6;
    for (std::size_t i = 0; i < n; ++i) {
      x.emplace_back(values[3 + 3 * i], values[4 + 3 * i], values[5 + 3 * i]);
      v.emplace_back(values[3 + 3 * (n + i)], values[4 + 3 * (n + i)], values[5 + 3 * (n + i)]);
    }
  }

  void start(const Executor& executor) {
    list = NeighbourList(2.5, 0.3, box);
    forces(executor);
    builds = 0;
  }
  void forces(const Executor& executor) {
    builds += list.update(x, executor) ? 1 : 0;
    loads.force.assign(x.size(), Vec3::Zero());
    accumulate_geometric(list, TwelveSix{}, executor, loads, precision);
  }
  /// Velocity Verlet.
  void step(const Executor& executor) {
    static constexpr double kStep = 0.005;
    constexpr std::size_t kBlock = 4096;
    const auto kick_and_drift = [this](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        v[i] += 0.5 * kStep * loads.force[i];
        x[i] += kStep * v[i];
      }
    };
    const auto kick = [this](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) v[i] += 0.5 * kStep * loads.force[i];
    };
    executor.for_blocks(x.size(), kBlock, std::cref(kick_and_drift));
    forces(executor);
    executor.for_blocks(x.size(), kBlock, std::cref(kick));
  }
  /// Temperature, potential and total energy per atom, and pressure, by the plain formulas over the pairs of the list.
  [[nodiscard]] std::string thermo(const std::string& prefix) const {
    double potential = 0.0, virial = 0.0, squares = 0.0;
    for (const IndexPair& pair : list.pairs()) {
      const double d2 = box.nearest_image(x[pair.second] - x[pair.first]).squaredNorm();
      if (d2 >= 6.25) continue;
      const double i6 = 1.0 / (d2 * d2 * d2);
      potential += 4.0 * (i6 * i6 - i6);
      virial += 48.0 * i6 * i6 - 24.0 * i6;
    }
    for (const Vec3& u : v) squares += u.squaredNorm();
    const auto n = static_cast<double>(x.size());
    return field((prefix + "_temperature").c_str(), squares / (3.0 * (n - 1.0))) + ", " +
           field((prefix + "_potential").c_str(), potential / n) + ", " +
           field((prefix + "_energy").c_str(), (potential + 0.5 * squares) / n) + ", " +
           field((prefix + "_pressure").c_str(), (squares + virial) / (3.0 * box.length.prod()));
  }
};

const char* name_of(Precision precision) { return precision == Precision::Double ? "" : "/single"; }

void bench_melt(Melt melt, Precision precision, int steps, int repeats) {
  const Executor executor(1);
  melt.precision = precision;
  const std::vector<Vec3> x = melt.x, v = melt.v;
  double best = std::numeric_limits<double>::infinity();
  std::string thermo;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    melt.x = x;
    melt.v = v;
    melt.start(executor);
    thermo = melt.thermo("first");
    const double start = seconds(CLOCK_PROCESS_CPUTIME_ID);
    for (int k = 0; k < steps; ++k) melt.step(executor);
    best = std::min(best, (seconds(CLOCK_PROCESS_CPUTIME_ID) - start) / steps);
  }
  const double n = static_cast<double>(x.size());
  print({.name = "melt" + std::string(name_of(precision)) + "/steps=" + std::to_string(steps),
         .particles = x.size(),
         .time = best,
         .rate = field("steps_per_build", static_cast<double>(steps) / static_cast<double>(melt.builds)) + ", " +
                 field("list_bytes_per_particle", static_cast<double>(melt.list.bytes()) / n) + ", " +
                 field("atom_steps_per_s", n / best) + ", " + thermo + ", " + melt.thermo("last"),
         .hash = hash_of(melt.x, melt.v)});
}

/// Gay-Berne ellipsoids in reduced units: axes 1, 1.5 and 2, wells 1, 0.5 and 0.2, cut-off 4, time step 0.002.
struct Ellipsoids {
  static constexpr double kRange = 4.0, kMass = 1.5;
  const GayBerne law{.radii = Vec3(0.5, 0.75, 1.0), .well = Vec3(1.0, 0.5, 0.2), .upsilon = 3, .mu = 1};
  PeriodicBox box;
  ParticleSet set;
  ParticleState state;

  void add(const Vec3& x, const Vec3& v, const Quat& q) {
    const Vec3 r2 = law.radii.cwiseAbs2();
    set.mass.push_back(kMass);
    set.inertia.push_back(kMass / 5.0 * Vec3(r2.y() + r2.z(), r2.z() + r2.x(), r2.x() + r2.y()));
    set.normal.push_back(Vec3::UnitZ());
    set.object.push_back(0);
    set.pinned.push_back(0);
    state.position.push_back(x);
    state.velocity.push_back(v);
    state.orientation.push_back(q);
    state.angular_momentum.push_back(Vec3::Zero());
  }
  /// Density 0.22, side^3 ellipsoids.
  explicit Ellipsoids(int side) {
    test::Draw draw(982381);
    const double edge = std::cbrt(1.0 / 0.22);
    box.length = Vec3::Constant(side * edge);
    for (int i = 0; i < side * side * side; ++i) {
      add(edge * Vec3(i / side / side, i / side % side, i % side), draw.vector(1.5), draw.rotation());
    }
  }
  /// Box length, positions, velocities, orientations (w, x, y, z) and angular momenta as doubles in a file.
  explicit Ellipsoids(const std::string& path) {
    const std::vector<double> values = read_doubles(path);
    box.length = Vec3(values[0], values[1], values[2]);
    const std::size_t n = (values.size() - 3) / 13;
    const double* const x = values.data() + 3;
    const double* const v = x + 3 * n;
    const double* const q = v + 3 * n;
    const double* const l = q + 4 * n;
    for (std::size_t i = 0; i < n; ++i) {
      add(Vec3(x[3 * i], x[3 * i + 1], x[3 * i + 2]), Vec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]),
          Quat(q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]));
      state.angular_momentum.back() = Vec3(l[3 * i], l[3 * i + 1], l[3 * i + 2]);
    }
  }
  /// Energies per particle, by the law of one pair over the pairs of the list.
  [[nodiscard]] std::string thermo(const NeighbourList& list, const std::string& prefix) const {
    double potential = 0.0;
    for (const IndexPair& pair : list.pairs()) {
      const Vec3 r = box.nearest_image(state.position[pair.second] - state.position[pair.first]);
      if (r.norm() >= kRange) continue;
      potential += evaluate(law, PairPose{.r = r,
                                          .orientation_a = state.orientation[pair.first],
                                          .orientation_b = state.orientation[pair.second]})
                       .energy;
    }
    const auto n = static_cast<double>(set.size());
    return field((prefix + "_potential").c_str(), potential / n) + ", " +
           field((prefix + "_energy").c_str(), (potential + measure_motion(set, state).kinetic_energy) / n);
  }
};

void bench_ellipsoids(Ellipsoids all, int steps, int repeats) {
  const Executor executor(1);
  const ParticleState start = all.state;
  double best = std::numeric_limits<double>::infinity();
  std::string thermo;
  std::size_t builds = 0;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    NeighbourList list(Ellipsoids::kRange, 0.5, all.box);
    const ForceModel forces = [&](const ParticleState& state, double, ForceSample& out) {
      builds += list.update(state.position, executor) ? 1 : 0;
      out.internal.reset(state.size());
      out.external.reset(state.size());
      accumulate_geometric(list, all.law, state.orientation, executor, out.internal);
    };
    all.state = start;
    KickState kick;
    Ledger ledger;
    list.update(all.state.position, executor);
    if (repeat == 0) thermo = all.thermo(list, "first");
    builds = 0;
    const double begin = seconds(CLOCK_PROCESS_CPUTIME_ID);
    for (int k = 0; k < steps; ++k) {
      advance({all.set, {}, forces}, 0.002 * k, 0.002, {all.state, kick, ledger});
    }
    best = std::min(best, (seconds(CLOCK_PROCESS_CPUTIME_ID) - begin) / steps);
    if (repeat + 1 == repeats) {
      list.update(all.state.position, executor);
      thermo += ", " + all.thermo(list, "last");
    }
  }
  print({.name = "gay_berne/steps=" + std::to_string(steps),
         .particles = all.set.size(),
         .time = best,
         .rate = field("builds", static_cast<double>(builds)) + ", " +
                 field("particle_steps_per_s", static_cast<double>(all.set.size()) / best) + ", " + thermo,
         .hash = hash_of(all.state.position, all.state.angular_momentum)});
}

/// Particles with normals on a disturbed cubic lattice of spacing 1 in open space.
struct Crowd {
  std::vector<Vec3> position, normal;
  explicit Crowd(std::size_t count) {
    test::Draw draw(17);
    const auto side = static_cast<std::size_t>(std::ceil(std::cbrt(static_cast<double>(count))));
    for (std::size_t i = 0; i < count; ++i) {
      const auto z = static_cast<double>(i % side), y = static_cast<double>(i / side % side);
      position.push_back(Vec3(static_cast<double>(i / side / side), y, z) + draw.vector(0.2));
      normal.push_back(draw.direction());
    }
  }
};

constexpr double kCrowdRange = 2.5;
const SurfaceLaws kCrowdLaws{.cohesion = {.r0 = 1.0, .f0 = 1.0, .a = 4.0},
                             .form = 0.5,
                             .curvature = 0.3,
                             .coplanarity = 0.4,
                             .conormality = 0.2,
                             .cocircularity = 0.1};

void bench_surface_laws(std::size_t count, Precision precision) {
  const Crowd crowd(count);
  const Executor executor(1);
  NeighbourList list(kCrowdRange, 0.25);
  list.update(crowd.position, executor);
  std::size_t pairs = 0;
  for (const IndexPair& pair : list.pairs()) {
    if ((crowd.position[pair.first] - crowd.position[pair.second]).norm() < kCrowdRange) ++pairs;
  }
  Loads loads;
  const double time = least_time(10, CLOCK_PROCESS_CPUTIME_ID, [&] {
    loads.reset(count);
    accumulate_geometric(list, kCrowdLaws, crowd.normal, executor, loads, precision);
  });
  const auto n = static_cast<double>(count);
  print({.name = "surface_laws" + std::string(name_of(precision)),
         .particles = count,
         .time = time,
         .rate = field("pairs_per_s", static_cast<double>(pairs) / time) + ", " +
                 field("pairs_per_particle", static_cast<double>(pairs) / n) + ", " +
                 field("list_entries_per_particle", static_cast<double>(list.entries()) / n),
         .hash = hash_of(loads.force, loads.torque)});
}

void bench_lists(std::size_t count) {
  const Crowd crowd(count);
  std::vector<Vec3> moved = crowd.position;
  for (Vec3& x : moved) x.x() += 0.15;
  const Executor executor(1);
  NeighbourList list(kCrowdRange, 0.25);
  bool there = false;
  const double time = least_time(6, CLOCK_PROCESS_CPUTIME_ID, [&] {
    list.update(there ? crowd.position : moved, executor);
    there = !there;
  });
  Hasher hasher;
  list.hash(hasher);
  const auto n = static_cast<double>(count);
  print({.name = "list_build",
         .particles = count,
         .time = time,
         .rate = field("list_bytes_per_particle", static_cast<double>(list.bytes()) / n) + ", " +
                 field("list_entries_per_particle", static_cast<double>(list.entries()) / n),
         .hash = hasher.value()});
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
    melt.start(Executor(1));
    bench_two_threads("melt", melt.x.size(), [&](const Executor& executor) { melt.step(executor); });
  }
  for (const std::size_t count : {32000U, 1000000U}) {
    const Crowd crowd(count);
    NeighbourList list(kCrowdRange, 0.25);
    Loads loads;
    list.update(crowd.position, Executor(1));
    bench_two_threads("surface_laws", count, [&](const Executor& executor) {
      loads.reset(count);
      accumulate_geometric(list, kCrowdLaws, crowd.normal, executor, loads);
    });
    std::vector<Vec3> moved = crowd.position;
    for (Vec3& x : moved) x.x() += 0.15;
    bool there = false;
    bench_two_threads("list_build", count, [&](const Executor& executor) {
      list.update(there ? crowd.position : moved, executor);
      there = !there;
    });
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
      accumulate_interactions(rest_.set, at, all_, time, executor_, *workspace_, out.internal, out.external);
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

/// @param argv  melt [FILE [STEPS]], melt_single [FILE [STEPS]], ellipsoids [FILE [STEPS]], threads, surface, lists,
///              spiral; all when absent
int main(int argc, char** argv) {
  constexpr std::string_view kUsage = "core_bench [melt|melt_single|ellipsoids [FILE [STEPS]]]\n"
                                      "       core_bench threads|surface|lists|spiral";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 3);
  const std::string_view what = argc > 1 ? argv[1] : "";
  if (argc > 1) {
    supple::benchmarks::expect_word(kUsage, what, std::array<std::string_view, 7>{"melt", "melt_single", "ellipsoids", "threads", "surface", "lists", "spiral"});
  }
  const auto steps = [&](int otherwise) { return argc > 3 ? supple::benchmarks::whole_number(kUsage, argv[3]) : otherwise; };
  const auto wanted = [&](std::string_view name) { return what.empty() || what == name; };
  for (const Precision precision : {Precision::Double, Precision::SingleForces}) {
    const bool single = precision == Precision::SingleForces;
    if (what.empty() || what == (single ? "melt_single" : "melt")) {
      bench_melt(argc > 2 ? Melt(argv[2]) : Melt(20), precision, steps(100), 3);
    }
  }
  if (wanted("ellipsoids")) {
    bench_ellipsoids(argc > 2 ? Ellipsoids(argv[2]) : Ellipsoids(20), steps(50), 3);
  }
  if (wanted("surface")) {
    for (const Precision precision : {Precision::Double, Precision::SingleForces}) {
      for (const std::size_t count : {100U, 1000U, 10000U, 32000U, 100000U, 1000000U}) {
        bench_surface_laws(count, precision);
      }
    }
  }
  if (wanted("lists")) {
    for (const std::size_t count : {100U, 1000U, 10000U, 32000U, 100000U, 1000000U}) bench_lists(count);
  }
  if (wanted("spiral")) {
    for (const int count : {10, 100}) {
      for (const bool rubs : {false, true}) bench_spiral(count, rubs);
    }
  }
  if (wanted("threads")) bench_threads();
  return 0;
}
