#include "supple/scenes/probe.h"

#include <algorithm>
#include <array>
#include <string>

#include "file/read_scene_faults.h"
#include "supple/collision/approach.h"
#include "supple/core/error.h"

namespace supple::scenes {
namespace {

[[noreturn]] void refuse(std::string place, std::string expected, std::string found, std::string hint) {
  throw Error(ErrorKind::Usage, Fault{.place = std::move(place),
                                      .key = {},
                                      .expected = std::move(expected),
                                      .found = std::move(found),
                                      .hint = std::move(hint)});
}

std::size_t body_count(const Simulation& simulation) { return simulation.bodies().size() + simulation.model().fixed.size(); }

const std::string& name_of(const Simulation& simulation, std::size_t body) {
  return body_name(simulation.model(), simulation.bodies(), body);
}

/// Of all contacts that of two bodies; null where they do not touch. @throws Error{Usage} for one body twice
const collision::ContactSurface::Summary* find_pair(Simulation& simulation, std::uint32_t a, std::uint32_t b) {
  SUPPLE_EXPECTS(a < body_count(simulation) && b < body_count(simulation));
  if (a == b) refuse("b", "expected two bodies", '\'' + name_of(simulation, a) + "' twice", "");
  const collision::BodyPair pair{std::min(a, b), std::max(a, b)};
  const auto& touching = simulation.contacts().summary;
  const auto at = std::find_if(touching.begin(), touching.end(), [&](const auto& s) { return s.bodies == pair; });
  return at == touching.end() ? nullptr : &*at;
}

}  // namespace

std::uint32_t find_body(const Simulation& simulation, std::string_view name) {
  std::vector<std::string_view> names;
  for (std::size_t i = 0; i < body_count(simulation); ++i) names.emplace_back(name_of(simulation, i));
  const auto at = std::find(names.begin(), names.end(), name);
  if (at != names.end()) return static_cast<std::uint32_t>(at - names.begin());
  refuse("body", "expected the name of a body", '\'' + shown(name) + '\'', known_hint(name, names));
}

void evaluate_field(Simulation& simulation, std::uint32_t body, std::span<const Vec3> points, std::span<double> values,
                    std::span<Vec3> gradients) {
  SUPPLE_EXPECTS(body < body_count(simulation));
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  if (body >= simulation.bodies().size()) {
    simulation.contact_bodies()[body].field.evaluate(points, values, gradients);
    return;
  }
  if (simulation.bodies()[body].skeleton.primitive.empty()) {
    refuse("body", "expected a body with a surface", '\'' + name_of(simulation, body) + "' without a skeleton", "");
  }
  simulation.fields()[body].evaluate(points, values, gradients);
}

std::vector<core::LawReport> report_forces(Simulation& simulation) {
  std::vector<core::LawReport> laws =
      core::report_laws(simulation.model().particles, simulation.state().particles, simulation.laws(), simulation.time());
  double energy = 0.0;
  for (const auto& s : simulation.contacts().summary) energy += s.energy;
  laws.push_back({.name = "contact", .energy = energy, .loads = simulation.contact_loads()});
  return laws;
}

collision::ContactSurface solve_contact(Simulation& simulation, std::uint32_t a, std::uint32_t b, double error) {
  if (!(error >= 1e-10 && error <= 0.1)) refuse("error", "expected a relative error from 1e-10 to 0.1", short_text(error), "");
  const collision::ContactSurface::Summary* const found = find_pair(simulation, a, b);
  collision::ContactSurface alone;
  if (found == nullptr) return alone;

  const collision::BodyPair pair = found->bodies;
  const std::span<const collision::ContactBody> bodies = simulation.contact_bodies();
  const std::array two = {bodies[pair.a], bodies[pair.b]};
  const std::array one_pair = {collision::BodyPair{0, 1}};
  const Executor executor;
  collision::ContactSettings settings = simulation.model().contact;
  settings.error = error;
  collision::ContactCandidates candidates;
  collision::find_contacts(two, one_pair, executor, candidates);
  collision::solve_contact_surface(two, candidates, settings, executor, alone);
  for (auto& s : alone.summary) s.bodies = pair;
  return alone;
}

double contact_capacity(Simulation& simulation, std::uint32_t a, std::uint32_t b) {
  const collision::ContactSurface::Summary* const found = find_pair(simulation, a, b);
  if (found == nullptr || !(found->force.norm() > 0.0)) {
    refuse("b", "expected a body that touches '" + name_of(simulation, a) + '\'', '\'' + name_of(simulation, b) + '\'', "");
  }
  const std::span<const collision::ContactBody> bodies = simulation.contact_bodies();
  return collision::contact_capacity(bodies[found->bodies.a], bodies[found->bodies.b], -found->force.normalized());
}

}  // namespace supple::scenes
