#include "simulation/overload.h"

#include <algorithm>
#include <limits>

#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

constexpr int kCoarseCells = 12;  // of energies that only trigger a closer check

/// Equal bodies have equal capacities: particles of one object that are separate bodies count as one kind.
std::uint32_t kind_of(const StageContext& context, std::uint32_t body) {
  constexpr std::uint32_t kAlike = 0x80000000;
  if (body >= context.bodies.size() || !context.model.objects[context.bodies[body].object].separate) return body;
  return kAlike | context.bodies[body].object;
}

/// Keeps when an overload began, and how hard it is at worst.
void note(const StageContext& context, const collision::BodyPair& bodies, RunRecord::Overload found, RunRecord& record) {
  found.a = body_name(context.model, context.bodies, bodies.a);
  found.b = body_name(context.model, context.bodies, bodies.b);
  const auto known = std::find_if(record.overloads.begin(), record.overloads.end(),
                                  [&](const RunRecord::Overload& o) { return o.a == found.a && o.b == found.b; });
  if (known == record.overloads.end()) {
    record.overloads.push_back(std::move(found));
  } else if (found.energy * known->capacity > known->energy * found.capacity) {
    known->energy = found.energy;
    known->capacity = found.capacity;
  }
}

}  // namespace

double mass_of(const StageContext& context, std::uint32_t body) {
  if (body >= context.bodies.size()) return std::numeric_limits<double>::infinity();
  double mass = 0.0;
  for (const std::uint32_t i : context.bodies[body].particle) {
    if ((context.model.particles.pinned[i] & core::kPinPosition) != 0) return std::numeric_limits<double>::infinity();
    mass += context.model.particles.mass[i];
  }
  return mass;
}

void find_mobility(const StageContext& context, const core::ParticleState& particles, const Frame& frame,
                   std::vector<collision::PartMobility>& mobility) {
  const core::ParticleSet& set = context.model.particles;
  mobility.resize(context.bodies.size() + context.model.fixed.size());
  for (const std::uint32_t b : frame.pressed) {
    if (b >= context.bodies.size()) continue;
    const std::vector<std::uint32_t>& particle = context.bodies[b].particle;
    mobility[b].inverse_mass.resize(particle.size());
    mobility[b].inverse_inertia.resize(particle.size());
    for (std::size_t k = 0; k < particle.size(); ++k) {
      const std::uint32_t i = particle[k];
      mobility[b].inverse_mass[k] = core::free_translation(set.pinned[i], Vec3::Constant(1.0 / set.mass[i]));
      const Mat3 turn = particles.orientation[i].toRotationMatrix();
      const Vec3 free = core::free_rotation(set.pinned[i], Vec3::Ones());
      mobility[b].inverse_inertia[k] =
          free.asDiagonal() * turn * set.inertia[i].cwiseInverse().asDiagonal() * turn.transpose() * free.asDiagonal();
    }
  }
}

void OverloadWatch::forget() {
  capacity_.clear();
  worst_.clear();
}

collision::BodyPair OverloadWatch::kinds_of(const StageContext& context, const collision::BodyPair& pair) {
  const auto [a, b] = std::minmax({kind_of(context, pair.a), kind_of(context, pair.b)});
  return {a, b};
}

void OverloadWatch::look(const StageContext& context, const Frame& frame, double time, RunRecord& record) {
  const auto& summary = frame.surface.summary;
  const auto kinetic_energy = [&](const collision::ContactSurface::Summary& s, const collision::Approach& approach) {
    const double speed = std::max(approach.speed, 0.0);
    const double inverse = 1.0 / mass_of(context, s.bodies.a) + 1.0 / mass_of(context, s.bodies.b);
    return inverse > 0.0 ? 0.5 * speed * speed / inverse : 0.0;
  };
  constexpr double kSafety = 0.45;  // of a coarse capacity, where half is the bound
  const auto suspicious = [&](const collision::ContactSurface::Summary& s, double kinetic, double coarse) {
    // A lens whose pressure falls to zero at its faces holds a sixth of largest pressure x area x thickness, a paraboloid's
    // too; a fourth is on the safe side.
    return kinetic + 0.25 * s.largest_pressure * s.area * s.largest_overlap > kSafety * coarse;
  };
  looked_at_.resize(summary.size());
  constexpr std::size_t kBlock = 64;
  context.executor.for_blocks(summary.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const collision::ContactSurface::Summary& s = summary[k];
      looked_at_[k] = 0;
      if (!(s.force.norm() > 0.0)) continue;
      const auto known = capacity_.find(kinds_of(context, s.bodies));
      looked_at_[k] = known == capacity_.end() ||
                      suspicious(s, kinetic_energy(s, collision::measure_approach(frame.bodies, s)), known->second);
    }
  });
  for (std::size_t k = 0; k < summary.size(); ++k) {
    if (looked_at_[k] == 0) continue;
    const collision::ContactSurface::Summary& s = summary[k];
    const collision::Approach approach = collision::measure_approach(frame.bodies, s);
    const double kinetic = kinetic_energy(s, approach);
    const auto [place, fresh] = capacity_.try_emplace(kinds_of(context, s.bodies), 0.0);
    if (fresh) {
      place->second = collision::contact_capacity(frame.bodies[s.bodies.a], frame.bodies[s.bodies.b], approach.normal, kCoarseCells);
    }
    const double coarse = place->second;
    if (!suspicious(s, kinetic, coarse)) continue;
    const collision::ContactBody &a = frame.bodies[s.bodies.a], &b = frame.bodies[s.bodies.b];
    if (!(kinetic + collision::shifted_energy(a, b, Vec3::Zero(), approach.normal, kCoarseCells) > kSafety * coarse)) continue;
    double& worst = worst_[s.bodies];
    constexpr int kCells = 24;
    constexpr double kWorthMeasuring = 1.02;
    const double energy = kinetic + collision::shifted_energy(a, b, Vec3::Zero(), approach.normal, kCells);
    if (!(energy > kWorthMeasuring * worst)) continue;
    worst = energy;
    const double capacity = collision::contact_capacity(a, b, approach.normal, kCells);
    if (energy > 0.5 * capacity) note(context, s.bodies, {.a = {}, .b = {}, .time = time, .energy = energy, .capacity = capacity}, record);
  }
}

void OverloadWatch::look_within(const StageContext& context, const Frame& frame, double time, RunRecord& record) {
  for (const collision::ContactSurface::Summary& s : frame.surface.summary) {
    if (s.reason != collision::RuleReason::Within) continue;
    // A pair with one body entirely inside the other has reached its capacity.
    note(context, s.bodies, {.a = {}, .b = {}, .time = time, .energy = s.energy, .capacity = s.energy}, record);
  }
}

bool hold_cores(const StageContext& context, Frame& frame, core::ParticleState& particles, core::Ledger& ledger,
                RunRecord& record) {
  const auto deep = [&](const collision::ContactSurface::Summary& s) {
    return s.largest_pressure > collision::core_pressure(frame.bodies[s.bodies.a], frame.bodies[s.bodies.b]);
  };
  if (std::none_of(frame.surface.summary.begin(), frame.surface.summary.end(), deep)) return false;
  const core::ParticleSet& set = context.model.particles;
  std::vector<collision::PartMobility> mobility;
  find_mobility(context, particles, frame, mobility);
  std::vector<collision::PartLoads> impulses(frame.bodies.size());
  for (const std::uint32_t b : frame.pressed) {
    impulses[b].force.assign(frame.bodies[b].pose.size(), Vec3::Zero());
    impulses[b].torque.assign(frame.bodies[b].pose.size(), Vec3::Zero());
    if (b < context.bodies.size()) {
      core::gather_motion(set, particles, context.bodies[b].particle, frame.velocity[b], frame.spin[b]);
    }
  }
  const collision::CoreImpulses done = collision::hold_cores(frame.bodies, mobility, frame.surface, impulses);
  if (done.turned == 0) return false;
  record.core_impulses += done.turned;

  const double before = core::measure_motion(set, particles).kinetic_energy;
  for (std::size_t b = 0; b < frame.bodies.size(); ++b) {
    for (std::size_t k = 0; k < impulses[b].force.size(); ++k) {
      const Vec3 &j = impulses[b].force[k], &turn = impulses[b].torque[k];
      if (b >= context.bodies.size()) {  // the moving ones take the opposite
        ledger.external_impulse -= j;
        ledger.external_angular_impulse -= frame.bodies[b].pose[k].position.cross(j) + turn;
        continue;
      }
      const std::uint32_t i = context.bodies[b].particle[k];
      const Vec3 free_j = core::free_translation(set.pinned[i], j), free_turn = core::free_rotation(set.pinned[i], turn);
      particles.velocity[i] += free_j / set.mass[i];
      particles.angular_momentum[i] += free_turn;
      const Vec3 held = free_j - j;
      ledger.pin_impulse += held;
      ledger.pin_angular_impulse += particles.position[i].cross(held) + free_turn - turn;
    }
  }
  ledger.dissipated += before - core::measure_motion(set, particles).kinetic_energy;
  return true;
}

}  // namespace supple::scenes
