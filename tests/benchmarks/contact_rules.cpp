/// @file contact_rules.cpp
/// Time against error of the rules that integrate over the contact surface: on panels, in polar rings about the peak, on marched
/// triangles; for each error asked, over the same random poses at an overlap of a tenth of the smaller
/// radius. A query is broad phase, candidates and contact surface. Errors are the largest of force, area (relative) and
/// centre of pressure (over the root of the area), RMS over the poses, against closed forms or the finest polar rule for
/// the bodies in another frame. The last case has ring-shaped patches. Prints tables; with a file name also writes the plot (SVG).
///   contact_rules [FILE.svg]
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "contact_shapes.h"
#include "programs.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;
using collision::ContactRule;

constexpr int kPoses = 20;
constexpr int kRepeats = 3;

struct Rule {
  const char* name;
  ContactRule rule;
  int first, last;  // digits of the error asked for
  const char* colour;
};
constexpr std::array<Rule, 3> kRules{{{"panels", ContactRule::Panels, 1, 6, "#d95f02"},
                                      {"polar", ContactRule::Polar, 1, 10, "#1b9e77"},
                                      {"march", ContactRule::March, 2, 8, "#7570b3"}}};

/// A log-log panel: error from 1e-15 to 1 across, CPU time from 1 us to 1 s upwards.
class Panel {
 public:
  Panel(double left, double top, const char* title) : left_(left), top_(top) {
    svg_ += "<rect x='" + text(left) + "' y='" + text(top) + "' width='300' height='260' fill='none' stroke='#999'/>\n<text x='" +
            text(left + 8) + "' y='" + text(top - 8) + "'>" + title + "</text>\n";
    for (int e = -15; e <= 0; e += 3) {
      svg_ += "<text x='" + text(x_of(std::pow(10.0, e)) - 12) + "' y='" + text(top + 274) + "' font-size='10'>1e" +
              std::to_string(e) + "</text>\n";
    }
    for (int e = 0; e <= 6; e += 2) {
      svg_ += "<text x='" + text(left - 40) + "' y='" + text(y_of(std::pow(10.0, e)) + 4) + "' font-size='10'>1e" +
              std::to_string(e) + " us</text>\n";
    }
  }
  void line(const char* colour, const std::vector<std::pair<double, double>>& points) {
    std::string path;
    for (const auto& [error, cpu] : points) {
      path += text(x_of(error)) + ',' + text(y_of(cpu)) + ' ';
      svg_ += "<circle cx='" + text(x_of(error)) + "' cy='" + text(y_of(cpu)) + "' r='3' fill='" + colour + "'/>\n";
    }
    svg_ += std::string("<polyline fill='none' stroke-width='2' stroke='") + colour + "' points='" + path + "'/>\n";
  }
  [[nodiscard]] const std::string& svg() const { return svg_; }

 private:
  static std::string text(double v) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.1f", v);
    return buffer.data();
  }
  [[nodiscard]] double x_of(double error) const {
    return left_ + 300.0 * (std::clamp(std::log10(error), -15.0, 0.0) + 15.0) / 15.0;
  }
  [[nodiscard]] double y_of(double cpu_us) const { return top_ + 260.0 - 260.0 * std::clamp(std::log10(cpu_us), 0.0, 6.0) / 6.0; }

  double left_, top_;
  std::string svg_;
};

struct Asked {
  Answer answer;
  bool found = false;
  double error_estimate = 1.0, points = 0.0, cpu_us = std::numeric_limits<double>::infinity();
};

Asked ask(std::span<const collision::ContactBody> bodies, const collision::ContactSettings& settings,
          collision::ContactSurface::Summary* summary = nullptr) {
  const Executor executor(1);
  thread_local collision::ContactCandidates candidates;
  thread_local collision::ContactSurface surface;
  Asked asked;
  for (int i = 0; i < kRepeats; ++i) {
    const double start = cpu_microseconds();
    find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, settings, executor, surface);
    asked.cpu_us = std::min(asked.cpu_us, cpu_microseconds() - start);
  }
  if (surface.summary.empty() || surface.summary[0].rule == ContactRule::None) return asked;
  const auto& s = surface.summary[0];
  asked.found = true;
  asked.answer = {s.force.norm(), s.area, s.centre_of_pressure};
  asked.error_estimate = s.error_estimate;
  asked.points = static_cast<double>(s.points);
  if (summary != nullptr) *summary = s;
  return asked;
}

template <class MakePose>
std::string measure(const char* name, double left, double top, const MakePose& make_pose) {
  std::printf("\n## %s\n\n| rule | error asked | points | error, RMS | error, worst | CPU us |\n|---|---|---|---|---|---|\n", name);
  Panel panel(left, top, name);
  for (const Rule& rule : kRules) {
    std::vector<std::pair<double, double>> line;
    for (int digits = rule.first; digits <= rule.last; ++digits) {
      Draw draw(7);
      double square = 0.0, worst = 0.0, points = 0.0, cpu = 0.0;
      int count = 0;
      for (int pose = 0; pose < kPoses; ++pose) {
        Pair pair = make_pose(draw);
        if (!pair.known) {
          const Asked finest = ask(seen_otherwise(pair.bodies), {.error = 1e-10, .only = ContactRule::Polar});
          if (!finest.found) continue;  // no polar patch to compare with
          pair.exact = finest.answer;
        }
        collision::ContactSurface::Summary s;
        // All rays are followed, as bodies that are the same all around an axis would else have one that stands for them.
        const Asked asked = ask(pair.bodies, {.error = std::pow(10.0, -digits), .only = rule.rule, .symmetry = false}, &s);
        if (!asked.found) continue;
        const double error = difference(s, pair.exact);
        square += error * error;
        worst = std::max(worst, error);
        points += asked.points;
        cpu += asked.cpu_us;
        ++count;
      }
      if (count == 0) continue;
      const double rms = std::sqrt(square / count);
      std::printf("| %s | 1e-%d | %.0f | %.1e | %.1e | %.3g |\n", rule.name, digits, points / count, rms, worst, cpu / count);
      std::fflush(stdout);
      line.emplace_back(rms, cpu / count);
    }
    panel.line(rule.colour, line);
  }
  return panel.svg();
}

/// Patches that are rings, which only marching solves finely: a ring in the ground, and one under a disc; errors of the force against 1e-9.
void measure_rings() {
  constexpr double kSupport = 0.2, kE = 1e6, kSpacing = 0.03;
  const double thick = implicit::iso_distance(implicit::Kernel::wyvill(kSupport), 0.5);
  Rigid ring(wyvill_shape(implicit::ShapeKind::Ring, Vec3(0.3, 0.0, 0.0), kSupport), kE, kSpacing);
  Rigid disc(wyvill_shape(implicit::ShapeKind::Disc, Vec3(0.4, 0.0, 0.0), kSupport), kE, kSpacing);
  ring.put({Vec3(0.0, 0.0, thick - 0.006), Quat::Identity()});
  disc.put({Vec3(0.0, 0.0, thick - 0.006 + 0.15), Quat::Identity()});
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 10.0};
  const Pose origin;
  collision::ContactBody ground = single_part(plane, kE, origin);
  ground.fixed = true;
  std::printf("\n## patches that are rings\n\n| bodies | error asked | bound | error of the force | points | CPU us |\n|---|---|---|---|---|---|\n");
  const auto add = [](const char* name, const std::array<collision::ContactBody, 2>& bodies) {
    const double force = ask(bodies, {.error = 1e-9, .only = ContactRule::March}).answer.force;
    for (const int digits : {2, 3, 5, 8}) {
      const Asked asked = ask(bodies, {.error = std::pow(10.0, -digits), .only = ContactRule::March});
      std::printf("| %s | 1e-%d | %.1e | %.1e | %.0f | %.3g |\n", name, digits, asked.error_estimate, std::abs(asked.answer.force / force - 1.0), asked.points, asked.cpu_us);
    }
  };
  add("on the ground", {ring.body(), ground});
  add("under a disc", {ring.body(), disc.body()});
}

}  // namespace

int supple::benchmarks::programs::contact_rules(int argc, char** argv) {
  supple::benchmarks::answer_usage(argc, argv, "contact_rules [FILE.svg]", 1);
  constexpr double kRadius = 0.1, kSpacing = 0.03, kE = 1e6, kDepth = 0.1 * kRadius;
  constexpr double kWidth = 360.0, kHeight = 320.0, kLeft = 60.0, kTop = 40.0;
  std::string svg;
  int panel = 0;
  const auto add = [&](const char* name, const auto& make_pose) {
    svg += measure(name, kLeft + kWidth * (panel % 3), kTop + kHeight * (panel / 3), make_pose);
    ++panel;
  };
  {
    Rigid ball(linear_sphere(kRadius), kLinearModulus * kE, kSpacing);
    implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
    const Pose origin;
    const double k = 100.0 * kE / kRadius;
    add("sphere on a plane", [&](Draw& draw) {
      const Vec3 up = draw.direction(), centre = draw.uniform(0.0, 1.0) * draw.direction();
      ball.put({centre, draw.rotation()});
      const double h = kRadius - kDepth;
      plane = {centre - h * up, up, 1.0};
      collision::ContactBody ground = single_part(plane, k, origin);
      ground.fixed = true;
      return Pair{{ball.body(), ground}, true, sphere_on_flat(kRadius, kE, k, h, centre, -up)};
    });
  }
  const auto two_spheres = [&](const char* name, double rb, double eb) {
    Rigid a(linear_sphere(kRadius), kLinearModulus * kE, kSpacing);
    Rigid b(linear_sphere(rb), kLinearModulus * eb, kSpacing * rb / kRadius);
    add(name, [&](Draw& draw) {
      const Vec3 axis = draw.direction(), centre = draw.uniform(0.0, 1.0) * draw.direction();
      const double D = kRadius + rb - kDepth;
      a.put({centre, draw.rotation()});
      b.put({centre + D * axis, draw.rotation()});
      return Pair{{a.body(), b.body()}, true, spheres(kRadius, kE, rb, eb, D, centre, axis)};
    });
  };
  two_spheres("two equal spheres", kRadius, kE);
  two_spheres("spheres, radii 1 : 2", 2.0 * kRadius, kE);
  two_spheres("spheres, stiffness 1 : 3", kRadius, 3.0 * kE);
  const auto pressed = [&](const char* name, Rigid& a, Rigid& b, double depth) {
    add(name, [&](Draw& draw) {
      press(a, b, depth, draw);
      return Pair{{a.body(), b.body()}, false, {}};
    });
  };
  {
    Rigid a(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.2, 0.3, 0.25), 0.2), kE, kSpacing);
    Rigid b(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.25, 0.2, 0.2), 0.2), 2.0 * kE, kSpacing);
    pressed("two ellipsoids", a, b, kDepth);
  }
  {
    Rigid ball(wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.22), kE, kSpacing);
    Rigid plate(wyvill_shape(implicit::ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), kE, kSpacing);
    pressed("ball on a plate", ball, plate, 0.7 * kDepth);
  }
  measure_rings();
  if (argc > 1) {
    std::ofstream out(argv[1]);
    const double height = kTop + 2.0 * kHeight + 20.0;
    out << "<svg xmlns='http://www.w3.org/2000/svg' width='" << kLeft + 3.0 * kWidth << "' height='" << height
        << "' font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' fill='white'/>\n"
        << svg;
    for (std::size_t k = 0; k < kRules.size(); ++k) {
      out << "<text x='" << 60 + 180 * k << "' y='" << height - 12.0 << "' fill='" << kRules[k].colour << "'>" << kRules[k].name
          << "</text>\n";
    }
    out << "<text x='" << 60 + 180 * kRules.size() << "' y='" << height - 12.0 << "'>error across (RMS over the poses), CPU time of a query upwards</text>\n</svg>\n";
    if (!out) return 4;
  }
  return 0;
}
