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

/// @param inverse  of the mass [1/kg]; 0: fixed bodies @return [J]
double energy_of_approach(double speed, double inverse) { return speed > 0.0 && inverse > 0.0 ? 0.5 * speed * speed / inverse : 0.0; }

/// Kinetic energy of approach [J] of the masses that the contact moves: of one particle bodies all, of others what is near.
class MovedMasses {
 public:
  MovedMasses(const StageContext& context, const core::ParticleState& particles, const Frame& frame) : context_(context), particles_(particles), frame_(frame) {}

  [[nodiscard]] double energy(const collision::ContactSurface::Summary& s, double speed) {
    if (!(speed > 0.0)) return 0.0;
    if (mobility_.empty()) find_mobility(context_, particles_, frame_, mobility_);
    return energy_of_approach(speed, collision::approach_inverse_mass(frame_.bodies, mobility_, s));
  }

 private:
  const StageContext& context_;
  const core::ParticleState& particles_;
  const Frame& frame_;
  std::vector<collision::PartMobility> mobility_;
};

RunRecord::Overload overload_of(const StageContext& context, const collision::BodyPair& bodies, double time, double energy, double capacity) {
  return {.a = body_name(context.model, context.bodies, bodies.a),
          .b = body_name(context.model, context.bodies, bodies.b),
          .time = time,
          .energy = energy,
          .capacity = capacity};
}

std::vector<RunRecord::Overload>::iterator entry_of(const RunRecord::Overload& found, RunRecord& record) {
  return std::find_if(record.overloads.begin(), record.overloads.end(),
                      [&](const RunRecord::Overload& o) { return o.a == found.a && o.b == found.b; });
}

/// Keeps when an overload began, and how hard it is at worst.
void note(const RunRecord::Overload& found, RunRecord& record) {
  const auto known = entry_of(found, record);
  if (known == record.overloads.end()) {
    record.overloads.push_back(found);
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

std::optional<RunRecord::Overload> OverloadWatch::look(const StageContext& context, const core::ParticleState& particles, const Frame& frame, double time,
                                                       RunRecord& record) {
  const auto& summary = frame.surface.summary;
  const auto kinetic_energy = [&](const collision::ContactSurface::Summary& s, const collision::Approach& approach) {
    return energy_of_approach(approach.speed, 1.0 / mass_of(context, s.bodies.a) + 1.0 / mass_of(context, s.bodies.b));
  };
  constexpr double kSafety = 0.45;  // of a coarse capacity, where half is the bound
  // A lens whose pressure falls to zero at its faces holds a sixth of largest pressure x area x thickness, a paraboloid's
  // too; a fourth is on the safe side.
  const auto at_most = [](const collision::ContactSurface::Summary& s, double kinetic) {
    return kinetic + 0.25 * s.largest_pressure * s.area * s.largest_overlap;
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
                      at_most(s, kinetic_energy(s, collision::measure_approach(frame.bodies, s))) > kSafety * known->second.energy;
    }
  });
  std::optional<RunRecord::Overload> passing;
  MovedMasses masses(context, particles, frame);
  for (std::size_t k = 0; k < summary.size(); ++k) {
    if (looked_at_[k] == 0) continue;
    const collision::ContactSurface::Summary& s = summary[k];
    const collision::Approach approach = collision::measure_approach(frame.bodies, s);
    const double kinetic = kinetic_energy(s, approach);
    const collision::ContactBody &a = frame.bodies[s.bodies.a], &b = frame.bodies[s.bodies.b];
    const double enough = at_most(s, kinetic) / kSafety;
    Capacity& known = capacity_[kinds_of(context, s.bodies)];
    if (!known.whole && !(known.energy > enough)) {
      known.energy = collision::contact_capacity(a, b, approach.normal, kCoarseCells, enough);
      known.whole = !(known.energy > enough);
    }
    const double coarse = known.energy;
    if (!(at_most(s, kinetic) > kSafety * coarse)) continue;
    const double pressed = collision::shifted_energy(a, b, Vec3::Zero(), approach.normal, kCoarseCells);
    if (!(kinetic + pressed > kSafety * coarse)) continue;
    double& worst = worst_[s.bodies];
    constexpr int kCells = 24;
    constexpr double kWorthMeasuring = 1.02, kAtRest = 0.01;  // the latter of the capacity
    const double moving = pressed > kSafety * coarse ? masses.energy(s, approach.speed) : 0.0;
    const bool may_pass = moving > kAtRest * coarse && pressed + moving > 2.0 * kSafety * coarse;
    const double contact = collision::shifted_energy(a, b, Vec3::Zero(), approach.normal, kCells), energy = kinetic + contact;
    if (!may_pass && !(energy > kWorthMeasuring * worst)) continue;
    worst = std::max(worst, energy);
    const double capacity = collision::contact_capacity(a, b, approach.normal, kCells);
    if (!(energy > 0.5 * capacity)) continue;
    const RunRecord::Overload found = overload_of(context, s.bodies, time, energy, capacity);
    note(found, record);
    if (!passing && may_pass && contact > 0.5 * capacity && contact + moving > capacity) passing = found;
  }
  return passing;
}

std::optional<RunRecord::Overload> OverloadWatch::look_within(const StageContext& context, const Frame& frame, double time, RunRecord& record) {
  std::optional<RunRecord::Overload> passing;
  for (const collision::ContactSurface::Summary& s : frame.surface.summary) {
    if (s.reason != collision::RuleReason::Within) continue;
    // A pair with one body entirely inside the other has reached its capacity.
    const RunRecord::Overload found = overload_of(context, s.bodies, time, s.energy, s.energy);
    const auto known = entry_of(found, record);
    const bool began_so = known == record.overloads.end() || known->energy == known->capacity;
    note(found, record);
    if (!passing && !began_so) passing = found;
  }
  return passing;
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
