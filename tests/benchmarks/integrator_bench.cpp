// Time against error of every integrator on three systems: a stiff spiral, a tumbling cluster of soft bonds, a shell that
// rings. Error: RMS of positions at the end against the adaptive method at tolerance 1e-12, over the size of the system.
// Prints time against error of the integrators; with a file name, also draws it as SVG.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

#include "core/support.h"
#include "programs.h"
#include "supple/core/arrange.h"
#include "supple/core/hash.h"
#include "supple/core/integrators.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::core;

struct System {
  const char* name;
  test::Particles p;
  Interactions laws;
  double end;       ///< [s]
  double coarsest;  ///< largest step tried [s]
};

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void bond_within(System& s, double distance, double stretch, double rotation) {
  const Bonds bonds = bonds_within(s.p.state.position, 0, static_cast<std::uint32_t>(s.p.set.size()), distance);
  BondedLaw<BondFrame> list{"bond_frame", bonds.first, bonds.second, {}};
  for (std::size_t k = 0; k < bonds.first.size(); ++k) {
    list.law.push_back(BondFrame::from_rest(stretch, rotation, test::pair_pose(s.p, bonds.first[k], bonds.second[k])));
  }
  s.laws.bond_frame.push_back(std::move(list));
}

/// Ten particles, omega about 600 / s; one end is struck.
System stiff_spiral() {
  System s{"stiff spiral", test::make_spiral(), {}, 0.1, 2e-3};
  s.laws.bond_frame.push_back(test::bond_frames(s.p, 2000.0, 5.0));
  s.p.state.velocity.back() = Vec3(0.5, -0.3, 0.2);
  return s;
}

/// Thirty bodies with three different moments that turn fast on soft bonds.
System tumbling_cluster() {
  System s{"tumbling cluster", {}, {}, 1.0, 2e-2};
  test::Draw draw(7);
  for (int i = 0; i < 30; ++i) {
    s.p.add(draw.vector(1.0));
    s.p.set.inertia.back() = Vec3(0.05, 0.1, 0.15);
    s.p.state.orientation.back() = draw.rotation();
  }
  bond_within(s, 1.0, 20.0, 0.5);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.state.velocity[i] = Vec3(0, 0, 3).cross(s.p.state.position[i]) + draw.vector(0.2);
    s.p.state.angular_momentum[i] = draw.vector(0.5);
  }
  return s;
}

/// 162 particles on a sphere, pushed in at one pole.
System ringing_shell() {
  System s{"ringing shell", {}, {}, 0.2, 4e-3};
  const Arrangement shell = arrange_geodesic(4, 1.0);
  for (std::size_t i = 0; i < shell.size(); ++i) {
    s.p.add(shell.position[i], 0.02, 0.02 * 0.01);
    s.p.state.orientation.back() = shell.orientation[i];
    s.p.state.velocity.back() = -2.0 * std::pow(std::max(0.0, shell.position[i].z()), 4) * Vec3::UnitZ();
  }
  bond_within(s, 0.45, 300.0, 1.0);
  return s;
}

struct Result {
  double cpu = 0.0;
  std::vector<Vec3> position;
  bool sound = true;
};

Result run(System s, const IntegratorSettings& settings, double dt) {
  const Executor executor(1);
  InteractionWorkspace pairs(s.p.set, s.laws);
  IntegratorWorkspace workspace;
  const ForceModel forces = [&](const ParticleState& state, double time, ForceSample& out) {
    accumulate_interactions(s.p.set, state, s.laws, executor, pairs, out.internal);
    add_external_loads(s.p.set, s.laws, time, out.external);
  };
  KickState kick;
  Ledger ledger;
  Result result;
  const auto steps = static_cast<int>(std::lround(s.end / dt));
  const double begin = cpu_seconds();
  for (int k = 0; k < steps && result.sound; ++k) {
    advance(settings, {s.p.set, s.laws, forces}, k * dt, dt, {s.p.state, kick, ledger}, {executor, pairs, workspace});
    result.sound = !find_divergence(s.p.set, s.p.state, 1e3, 1e6).found;
  }
  result.cpu = cpu_seconds() - begin;
  result.position = s.p.state.position;
  return result;
}

double rms(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

struct Method {
  const char* name;
  Integrator method;
  RotationUpdate rotation;
  int levels;
  const char* colour;
};

const std::vector<Method> kMethods{
    {"symplectic, splitting", Integrator::Symplectic, RotationUpdate::Splitting, 8, "#1b9e77"},
    {"symplectic, exponential", Integrator::Symplectic, RotationUpdate::Exponential, 8, "#66a61e"},
    {"rk4", Integrator::RungeKutta4, RotationUpdate::Splitting, 7, "#7570b3"},
    {"adaptive", Integrator::Adaptive, RotationUpdate::Splitting, 7, "#e7298a"},
    {"backward_euler", Integrator::BackwardEuler, RotationUpdate::Splitting, 5, "#d95f02"},
    {"implicit_midpoint", Integrator::ImplicitMidpoint, RotationUpdate::Splitting, 5, "#a6761d"}};

/// A log-log panel: error from 1e-11 to 1 across, CPU time from 1e-5 to 100 s upwards.
class Panel {
 public:
  Panel(double left, const char* title) : left_(left) {
    svg_ += "<rect x='" + text(left) + "' y='30' width='330' height='350' fill='none' stroke='#999'/>\n<text x='" +
            text(left + 8) + "' y='22'>" + title + "</text>\n";
    for (int e = -10; e <= 0; e += 2) {
      svg_ += "<text x='" + text(x_of(std::pow(10.0, e)) - 12) + "' y='396' font-size='10'>1e" + std::to_string(e) + "</text>\n";
    }
    for (int e = -4; e <= 2; e += 2) {
      svg_ += "<text x='" + text(left - 30) + "' y='" + text(y_of(std::pow(10.0, e)) + 4) + "' font-size='10'>1e" +
              std::to_string(e) + " s</text>\n";
    }
  }
  void line(const char* colour, const std::vector<std::pair<double, double>>& points) {
    std::string path;
    for (const auto& [error, cpu] : points) path += text(x_of(error)) + ',' + text(y_of(cpu)) + ' ';
    svg_ += std::string("<polyline fill='none' stroke-width='2' stroke='") + colour + "' points='" + path + "'/>\n";
  }
  [[nodiscard]] const std::string& svg() const { return svg_; }

 private:
  static std::string text(double v) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.1f", v);
    return buffer;
  }
  [[nodiscard]] double x_of(double error) const {
    return left_ + 330.0 * (std::clamp(std::log10(error), -11.0, 0.0) + 11.0) / 11.0;
  }
  [[nodiscard]] static double y_of(double cpu) { return 380.0 - 350.0 * (std::clamp(std::log10(cpu), -5.0, 2.0) + 5.0) / 7.0; }

  double left_;
  std::string svg_;
};

}  // namespace

int supple::benchmarks::programs::integrator_bench(int argc, char** argv) {
  supple::benchmarks::answer_usage(argc, argv, "integrator_bench [FILE.svg]", 1);
  std::string svg;
  double left = 50.0;
  for (const System& s : {stiff_spiral(), tumbling_cluster(), ringing_shell()}) {
    IntegratorSettings exact{.method = Integrator::Adaptive, .tolerance = 1e-12};
    exact.max_substeps = 1 << 20;
    const Result reference = run(s, exact, s.coarsest);
    std::printf("\n## %s: %zu particles, %g s\n\n| integrator | step or tolerance | error | CPU ms |\n|---|---|---|---|\n", s.name,
                s.p.set.size(), s.end);
    Panel panel(left, s.name);
    for (const Method& m : kMethods) {
      std::vector<std::pair<double, double>> points;
      for (int level = 0; level < m.levels; ++level) {
        IntegratorSettings settings{.method = m.method, .rotation = m.rotation};
        const bool adaptive = m.method == Integrator::Adaptive;
        const double dt = adaptive ? s.coarsest : std::ldexp(s.coarsest, -level);
        settings.tolerance = adaptive ? std::pow(10.0, -3 - level) : 1e-10;
        const Result r = run(s, settings, dt);
        const double error = r.sound ? rms(r.position, reference.position) : 1e300;
        if (!(error < 1.0)) {
          std::printf("| %s | %.3g | unstable | %.3g |\n", m.name, adaptive ? settings.tolerance : dt, 1e3 * r.cpu);
          continue;
        }
        std::printf("| %s | %.3g | %.2e | %.3g |\n", m.name, adaptive ? settings.tolerance : dt, error, 1e3 * r.cpu);
        points.emplace_back(error, r.cpu);
      }
      panel.line(m.colour, points);
    }
    svg += panel.svg();
    left += 390.0;
    std::fflush(stdout);
  }
  if (argc > 1) {
    std::ofstream out(argv[1]);
    out << "<svg xmlns='http://www.w3.org/2000/svg' width='" << left << "' height='440' font-family='sans-serif' font-size='12'>\n"
        << "<rect width='100%' height='100%' fill='white'/>\n" << svg;
    for (std::size_t k = 0; k < kMethods.size(); ++k) {
      out << "<text x='" << 50 + 180 * k << "' y='425' fill='" << kMethods[k].colour << "'>" << kMethods[k].name << "</text>\n";
    }
    out << "</svg>\n";
  }
  return 0;
}
