// Largest usable time steps: step x stiffness x compression x mass ratio, on four small systems. Every run
// ends stable, with gained energy, or with a divergence that `find_divergence` reports; never with a NaN.
// Prints the table of docs/stability.md; with a file name, also writes the map as SVG. Exit 1 when a
// physically valid case at the automatic step is not stable.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "core/support.h"
#include "programs.h"
#include "supple/core/integrate.h"
#include "supple/core/lennard_jones.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::core;

constexpr std::array<double, 6> kSteps{0.25, 0.5, 1.0, 2.0, 4.0, 8.0};  // of the automatic step
constexpr std::array<double, 4> kStiffness{1e1, 1e3, 1e5, 1e7};
constexpr std::array<double, 4> kMassRatio{1.0, 1e2, 1e4, 1e6};
constexpr std::array<double, 5> kCompression{0.95, 0.85, 0.7, 0.55, 0.4};
constexpr std::size_t kAutomatic = 2;  // in kSteps
constexpr int kRunSteps = 3000;
constexpr int kStepsPerChoice = 4;  // the step is chosen anew after so many
// The energy of velocity Verlet swings by some (omega dt)^2, 9 % at the automatic step.
constexpr double kGain = 0.09;

enum class Outcome { Stable, Gains, Diverged };

struct System {
  const char* name;
  test::Particles p;
  Interactions laws;
  double binding_energy;  ///< infinite: cannot fly apart
};

test::Particles ring(int count) {
  test::Particles p;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / count;
    p.add(Vec3(std::cos(angle), std::sin(angle), 0.0), 1.0, 0.1);
    p.set.normal.back() = Vec3::UnitX();
    p.state.orientation.back() = test::turn_about(Vec3::UnitZ(), angle);
  }
  return p;
}

test::Particles triangle() {
  test::Particles p;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 3.0;
    p.add(Vec3(std::cos(angle), std::sin(angle), 0.0) / std::numbers::sqrt3, 1.0, 0.1);
  }
  return p;
}

std::vector<System> make_systems(double stiffness) {
  std::vector<System> systems;
  {
    System s{"ring of bond frames", ring(8), {}, std::numeric_limits<double>::infinity()};
    s.laws.bond_frame.push_back(test::bond_frames(s.p, stiffness, 0.2 * stiffness));
    systems.push_back(std::move(s));
  }
  {
    System s{"ring of form and bonds of length", ring(8), {}, std::numeric_limits<double>::infinity()};
    s.laws.form.resize(1);
    s.laws.form_radius.resize(1);
    test::along_chain(8, 1, [&](std::uint32_t a, std::uint32_t b) {
      const PairPose rest = test::pair_pose(s.p, a, b);
      s.laws.form[0].first.push_back(a);
      s.laws.form[0].second.push_back(b);
      s.laws.form[0].law.push_back({.strength = 0.2 * stiffness,
                                    .curvature = Form::fit_curvature(rest.r, rest.normal_a, rest.normal_b), .weight = {}});
      s.laws.form_radius[0].first.push_back(a);
      s.laws.form_radius[0].second.push_back(b);
      s.laws.form_radius[0].law.push_back({.strength = stiffness, .radius = 1.0, .weight = {}});
    });
    systems.push_back(std::move(s));
  }
  const std::vector<std::uint32_t> first{0, 0, 1}, second{1, 2, 2};
  {
    const Cohesion law{.r0 = 1.0, .f0 = stiffness, .a = 4.0};
    System s{"triangle of cohesion", triangle(), {}, 3.0 * law.binding_energy()};
    s.laws.cohesion.push_back({"cohesion", first, second, {3, law}});
    systems.push_back(std::move(s));
  }
  {
    const LennardJones law = LennardJones::from_gain(1.0, stiffness, 4);
    System s{"triangle of Lennard-Jones", triangle(), {}, 3.0 * stiffness / 8.0};
    s.laws.lennard_jones.push_back({"lennard_jones", first, second, {3, law}});
    systems.push_back(std::move(s));
  }
  return systems;
}

struct Run {
  Outcome outcome = Outcome::Stable;
  bool valid = false;     ///< stored energy is at most half of what holds the system together
  double gain = 0.0;      ///< largest energy over the stored one, less 1
  std::string cause;
  int step = 0;
};

Run run(System s, double mass_ratio, double compression, double factor) {
  s.p.set.mass[0] *= mass_ratio;
  s.p.set.inertia[0] *= mass_ratio;
  const double frequency = largest_frequency(s.p.set, s.p.state, s.laws);
  const double rest = potential_energy(s.p.set, s.p.state, s.laws);
  for (Vec3& x : s.p.state.position) x *= compression;
  const double stored = potential_energy(s.p.set, s.p.state, s.laws) - rest;
  Run result;
  result.valid = stored <= 0.5 * s.binding_energy;
  // Weak drag: what is stable comes to rest, what is not is not saved by it.
  s.laws.medium.push_back({.object = 0, .linear = 0.01 * frequency, .angular = 0.01 * frequency});

  const Executor executor(1);
  InteractionWorkspace workspace(s.p.set, s.laws);
  const ForceModel forces = [&](const ParticleState& state, double time, ForceSample& out) {
    accumulate_interactions(s.p.set, state, s.laws, executor, workspace, out.internal);
    add_external_loads(s.p.set, s.laws, time, out.external);
  };
  KickState kick;
  Ledger ledger;
  double time = 0.0, dt = 0.0;
  for (result.step = 0; result.step < kRunSteps; ++result.step) {
    if (result.step % kStepsPerChoice == 0) {
      StepLimits limits{.frequency = std::max(frequency, largest_frequency(s.p.set, s.p.state, s.laws)), .length = 0.5};
      for (std::size_t i = 0; i < s.p.set.size(); ++i) {
        limits.speed = std::max(limits.speed, s.p.state.velocity[i].norm());
        limits.angular_speed = std::max(limits.angular_speed, angular_velocity(s.p.set, s.p.state, i).norm());
      }
      dt = factor * stable_step(limits);
    }
    advance({s.p.set, s.laws, forces}, time, dt, {s.p.state, kick, ledger});
    time += dt;
    const Divergence divergence = find_divergence(s.p.set, s.p.state, 1e4, 1e6 * frequency);
    if (divergence.found) {
      result.outcome = Outcome::Diverged;
      result.cause = divergence.cause;
      return result;
    }
    const double energy =
        measure_motion(s.p.set, s.p.state).kinetic_energy + potential_energy(s.p.set, s.p.state, s.laws);
    if (!std::isfinite(energy)) {
      result.outcome = Outcome::Diverged;
      result.cause = "energy is not finite";
      return result;
    }
    result.gain = std::max(result.gain, (energy - rest) / stored - 1.0);
    if (result.gain > kGain) result.outcome = Outcome::Gains;
  }
  return result;
}

const char* colour(Outcome outcome) {
  return outcome == Outcome::Stable ? "#2c7fb8" : outcome == Outcome::Gains ? "#fdae61" : "#d7191c";
}

}  // namespace

int supple::benchmarks::programs::core_stress(int argc, char** argv) {
  supple::benchmarks::answer_usage(argc, argv, "core_stress [FILE.svg]", 1);
  constexpr double kCell = 14.0;
  std::string svg;
  int bad = 0, total = 0;
  const std::size_t system_count = make_systems(1.0).size();
  std::printf("| system | step over the automatic one | runs | stable | gains energy | diverged |\n|---|---|---|---|---|---|\n");
  for (std::size_t system = 0; system < system_count; ++system) {
    for (std::size_t f = 0; f < kSteps.size(); ++f) {
      std::array<int, 3> count{};
      for (std::size_t k = 0; k < kStiffness.size(); ++k) {
        const System s = make_systems(kStiffness[k])[system];
        for (std::size_t m = 0; m < kMassRatio.size(); ++m) {
          for (std::size_t c = 0; c < kCompression.size(); ++c) {
            const Run r = run(s, kMassRatio[m], kCompression[c], kSteps[f]);
            ++count[static_cast<std::size_t>(r.outcome)];
            ++total;
            if (f <= kAutomatic && r.valid && r.outcome != Outcome::Stable) {
              ++bad;
              std::fprintf(stderr, "%s, stiffness %g, mass ratio %g, compressed to %g, step %g: %s %s at step %d, gain %g\n", s.name,
                           kStiffness[k], kMassRatio[m], kCompression[c], kSteps[f],
                           r.outcome == Outcome::Gains ? "gains energy" : "diverged:", r.cause.c_str(), r.step, r.gain);
            }
            const double x = 230.0 + kCell * static_cast<double>(f * (kCompression.size() + 1) + c);
            const double y = 30.0 + kCell * static_cast<double>(system * 18 + k * kMassRatio.size() + m);
            svg += "<rect x='" + std::to_string(x) + "' y='" + std::to_string(y) + "' width='13' height='13' fill='" +
                   colour(r.outcome) + "'" + (r.valid ? "" : " opacity='0.4'") + "/>\n";
          }
        }
      }
      std::printf("| %s | %g | %d | %d | %d | %d |\n", make_systems(1.0)[system].name, kSteps[f],
                  count[0] + count[1] + count[2], count[0], count[1], count[2]);
    }
    svg += "<text x='8' y='" + std::to_string(45.0 + kCell * static_cast<double>(system * 18)) + "'>" +
           make_systems(1.0)[system].name + "</text>\n";
  }
  for (std::size_t f = 0; f < kSteps.size(); ++f) {
    char label[64];
    std::snprintf(label, sizeof label, "step x %g", kSteps[f]);
    svg += "<text x='" + std::to_string(230.0 + kCell * static_cast<double>(f * (kCompression.size() + 1))) +
           "' y='22'>" + label + "</text>\n";
  }
  std::printf("\n%d runs; %d physically valid ones at the automatic step or a finer one are not stable\n", total, bad);
  if (argc > 1) {
    std::ofstream out(argv[1]);
    out << "<svg xmlns='http://www.w3.org/2000/svg' width='" << 250 + kCell * 36 << "' height='" << 50 + kCell * 72
        << "' font-family='sans-serif' font-size='11'>\n<rect width='100%' height='100%' fill='white'/>\n"
        << svg << "</svg>\n";
  }
  return bad == 0 ? 0 : 1;
}
