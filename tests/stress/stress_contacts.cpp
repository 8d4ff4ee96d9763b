// Random contacts of all cases of the contact benchmarks: bodies in motion, with friction and damping. Checks of each: forces and moments of the pair
// sum to zero, both pressures agree on the contact surface, both deformed surfaces pass through it; and the same bodies moved
// apart have no contact. Prints one JSON object with the counts, the largest relative errors and every contact beyond the limits; exit code 1 if there is one.
//   stress_contacts [CONTACTS] [SEED]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks/contact_cases.h"
#include "benchmarks/usage.h"
#include "supple/collision/deformed_field.h"
#include "supple/collision/find_contacts.h"
#include "supple/collision/react.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;
using collision::ContactBody;
using collision::PartLoads;

constexpr double kLimit = 1e-10;        // relative, of momenta and of pressures
constexpr double kError = 1e-3;         // asked of the contact surface
constexpr std::size_t kMostTold = 20;

struct Worst {
  double force = 0.0, moment = 0.0, pressure = 0.0, surface = 0.0;
  [[nodiscard]] double largest() const { return std::max({force, moment, pressure, surface}); }
};

/// Velocities of all parts, at random.
struct Motion {
  std::array<std::vector<Vec3>, 2> velocity, spin;
  Motion(std::array<ContactBody, 2>& bodies, Draw& draw) {
    for (std::size_t i = 0; i < 2; ++i) {
      ContactBody& body = bodies[i];
      for (std::size_t k = 0; k < body.pose.size(); ++k) {
        velocity[i].push_back(draw.uniform(0.0, 1.0) * draw.direction());
        spin[i].push_back(draw.uniform(0.0, 5.0) * draw.direction());
      }
      body.velocity = velocity[i];
      body.angular_velocity = spin[i];
      body.material.friction = 0.4;
      body.material.dissipation = 0.3;
    }
  }
};

/// Sums of the loads on both bodies about the world's origin, over the sums of their sizes.
void judge_momenta(const std::array<ContactBody, 2>& bodies, const collision::ContactSurface& surface, Worst& worst) {
  std::vector<PartLoads> loads(2);
  for (std::size_t i = 0; i < 2; ++i) {
    loads[i].force.assign(bodies[i].pose.size(), Vec3::Zero());
    loads[i].torque.assign(bodies[i].pose.size(), Vec3::Zero());
  }
  collision::react({bodies, {}, surface}, Executor(1), {loads});
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double size = 0.0, moment_size = 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t k = 0; k < loads[i].force.size(); ++k) {
      const Vec3 arm = bodies[i].pose[k].position.cross(loads[i].force[k]);
      force += loads[i].force[k];
      moment += arm + loads[i].torque[k];
      size += loads[i].force[k].norm();
      moment_size += arm.norm() + loads[i].torque[k].norm();
    }
  }
  if (!(size > 0.0)) return;
  worst.force = std::max(worst.force, force.norm() / size);
  worst.moment = std::max(worst.moment, moment.norm() / std::max(moment_size, std::numeric_limits<double>::min()));
}

/// Both deformed fields at the points of the contact surface: a difference of pressures over the larger modulus, as the pressures are judged.
void judge_surfaces(const std::array<ContactBody, 2>& bodies, const collision::ContactSurface& surface, Worst& worst) {
  std::vector<double> values(surface.point.size());
  for (const std::uint32_t i : {0U, 1U}) {
    const collision::DeformedField field(bodies, i, surface, {});
    field.evaluate(surface.point, values);
    const double scale = bodies[i].material.modulus / std::max(bodies[0].material.modulus, bodies[1].material.modulus);
    for (const double v : values) worst.surface = std::max(worst.surface, std::isfinite(v) ? scale * std::abs(v) : std::numeric_limits<double>::infinity());
  }
  for (const auto& s : surface.summary) worst.pressure = std::max(worst.pressure, s.residual);
}

struct Solver {
  Executor executor{1};
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  void solve(std::array<ContactBody, 2>& bodies) {
    find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = kError}, executor, surface);
  }
};

/// Two balls that do not touch, however near they are. @return whether there is a contact
bool contact_of_apart(Rigid& a, Rigid& b, double radii, Solver& solver, Draw& draw) {
  const Vec3 centre = draw.direction(), axis = draw.direction();
  a.put({centre, draw.rotation()});
  b.put({centre + radii * (1.0 + draw.logarithmic(1e-9, 1.0)) * axis, draw.rotation()});
  std::array<ContactBody, 2> bodies{a.body(), b.body()};
  solver.solve(bodies);
  return !solver.surface.point.empty();
}

}  // namespace

int main(int argc, char** argv) {
  constexpr std::string_view kUsage = "stress_contacts [CONTACTS] [SEED]";
  answer_usage(argc, argv, kUsage, 2);
  const int contacts = argc > 1 ? whole_number(kUsage, argv[1]) : 1000;
  const std::uint64_t seed = argc > 2 ? whole_number<std::uint64_t>(kUsage, argv[2], 0) : 1;
  int cases = 0;
  for_cases({}, [](std::string_view name) { return names("all", name); }, [&](std::string_view, const auto&) { ++cases; });
  const int poses = (contacts + cases - 1) / cases;

  Solver solver;
  Worst worst;
  int tried = 0, touching = 0, apart = 0;
  nlohmann::json faults = nlohmann::json::array();
  const auto tell = [&faults](const std::string& what) {
    if (faults.size() < kMostTold) faults.push_back(what);
  };
  for_cases({}, [](std::string_view name) { return names("all", name); }, [&](std::string_view name, const auto& make_pose) {
    Draw draw(seed), motion_draw(seed + 1);
    for (int pose = 0; pose < poses; ++pose, ++tried) {
      Pair pair = make_pose(draw);
      const Motion motion(pair.bodies, motion_draw);
      solver.solve(pair.bodies);
      if (solver.surface.point.empty()) continue;
      ++touching;
      Worst here;
      if (!pair.bodies[0].fixed && !pair.bodies[1].fixed) judge_momenta(pair.bodies, solver.surface, here);
      judge_surfaces(pair.bodies, solver.surface, here);
      if (!(here.largest() <= kLimit)) {
        char text[200];
        std::snprintf(text, sizeof text, "%s, pose %d: forces %.1e, moments %.1e, pressures %.1e, surfaces %.1e", std::string(name).c_str(), pose, here.force,
                      here.moment, here.pressure, here.surface);
        tell(text);
      }
      worst.force = std::max(worst.force, here.force);
      worst.moment = std::max(worst.moment, here.moment);
      worst.pressure = std::max(worst.pressure, here.pressure);
      worst.surface = std::max(worst.surface, here.surface);
    }
  });
  constexpr double kRadius = 0.1;
  Rigid a(linear_sphere(kRadius), 1e6, 0.03), b(linear_sphere(2.0 * kRadius), 1e6, 0.06);
  Draw draw(seed);
  for (; apart < contacts; ++apart) {
    if (contact_of_apart(a, b, 3.0 * kRadius, solver, draw)) tell("a contact of balls apart, number " + std::to_string(apart));
  }
  const nlohmann::json result{{"tried", tried}, {"touching", touching}, {"apart", apart}, {"forces", worst.force}, {"moments", worst.moment},
                              {"pressures", worst.pressure}, {"surfaces", worst.surface}, {"faults", faults}};
  std::puts(result.dump().c_str());
  return faults.empty() ? 0 : 1;
}
