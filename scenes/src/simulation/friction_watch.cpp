#include "simulation/friction_watch.h"

#include <algorithm>

namespace supple::scenes {
namespace {

/// Effective inverse mass of a body for a force at `centre` [1/kg].
double yield_at(const collision::ContactBody& body, const Vec3& centre) {
  if (body.yield.empty()) return 0.0;
  const auto of_part = [&](std::size_t k) {
    return body.yield[k].inverse_mass + (centre - body.pose[k].position).squaredNorm() * body.yield[k].inverse_inertia;
  };
  if (body.pose.size() == 1) return of_part(0);
  implicit::FieldParts parts;
  body.field.evaluate_parts(std::span(&centre, 1), parts);
  double all = 0.0, sum = 0.0;
  for (const double value : parts.value) all += value;
  for (std::size_t e = 0; e < parts.part.size(); ++e) {
    const double share = all > 0.0 ? parts.value[e] / all : 0.0;
    sum += share * share * of_part(parts.part[e]);
  }
  return sum;
}

}  // namespace

void FrictionWatch::note(const StageContext& context, const collision::BodyPair& bodies, double speed) {
  auto names = std::minmax(object_name(context.model, context.bodies, bodies.a), object_name(context.model, context.bodies, bodies.b));
  double& known = speeds_[{names.first, names.second}];
  known = std::max(known, speed);
}

void FrictionWatch::look(const StageContext& context, const Frame& frame) {
  const collision::ReactionSettings& settings = context.model.reaction;
  if (!(context.step > 0.0) || settings.stick.stiffness > 0.0) return;
  constexpr double kPerLoad = 2.0 / 1.6;  // as in react.h: slope of the mollifier over the share of a slip that a step may remove
  std::vector<std::uint32_t> contacts(frame.bodies.size(), 0);
  for (const auto& s : frame.surface.summary) {
    if (!(s.load > 0.0)) continue;
    ++contacts[s.bodies.a];
    ++contacts[s.bodies.b];
  }
  for (const auto& s : frame.surface.summary) {
    const double friction = collision::material_of(frame.bodies, context.rules, s.bodies).friction;
    if (!(s.load > 0.0) || friction == 0.0) continue;
    const double yield = contacts[s.bodies.a] * yield_at(frame.bodies[s.bodies.a], s.centre_of_pressure) +
                         contacts[s.bodies.b] * yield_at(frame.bodies[s.bodies.b], s.centre_of_pressure);
    note(context, s.bodies, std::max(settings.friction_speed, kPerLoad * friction * s.load * context.step * yield));
  }
}

void FrictionWatch::look(const StageContext& context, const Frame& frame, std::span<const core::ContactPairLoad> loads) {
  for (std::size_t k = 0; k < std::min(loads.size(), frame.surface.summary.size()); ++k) {
    const auto& s = frame.surface.summary[k];
    if (!(s.load > 0.0) || collision::material_of(frame.bodies, context.rules, s.bodies).friction == 0.0) continue;
    note(context, s.bodies, loads[k].stick_speed);
  }
}

}  // namespace supple::scenes
