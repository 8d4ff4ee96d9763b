#include "simulation/audits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace supple::scenes {
namespace {

void raise(double& largest, double value) { largest = std::max(largest, value); }

double share(double value, double scale) { return scale > 0.0 ? value / scale : value; }

void book_conservation(const core::Motion& motion, double energy, const core::Ledger& ledger, RunRecord& r) {
  const Vec3 momentum = motion.momentum - r.initial.momentum - ledger.external_impulse - ledger.pin_impulse;
  const Vec3 angular =
      motion.angular_momentum - r.initial.angular_momentum - ledger.external_angular_impulse - ledger.pin_angular_impulse;
  raise(r.momentum_error, momentum.norm());
  raise(r.angular_momentum_error, angular.norm());
  raise(r.momentum_scale, motion.momentum_scale);
  raise(r.angular_momentum_scale, motion.angular_momentum_scale);
  raise(r.largest_energy, energy);
  raise(r.energy_error, std::abs(energy - r.initial_energy - ledger.external_work + ledger.dissipated));
  raise(r.most_dissipated, ledger.dissipated);
  raise(r.energy_returned, r.most_dissipated - ledger.dissipated);
}

void book_contacts(const Model& model, const std::vector<Body>& bodies, const collision::ContactSurface& surface, RunRecord& r) {
  for (const auto& s : surface.summary) {
    raise(r.contact_residual, s.residual);
    raise(r.largest_overlap, s.largest_overlap);
    double thickness = std::numeric_limits<double>::infinity();
    for (const std::uint32_t body : {s.bodies.a, s.bodies.b}) {
      if (body < bodies.size()) thickness = std::min(thickness, 2.0 * model.objects[bodies[body].object].iso_radius);
    }
    raise(r.largest_overlap_share, s.largest_overlap / thickness);
  }
}

void book_shapes(const Model& model, const core::ParticleState& particles, RunRecord& r) {
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const ObjectModel& o = model.objects[i];
    if (o.separate) continue;  // bodies of one particle, which keep their shapes wherever they go
    const std::size_t n = o.last - o.first;
    const core::ShapeError error =
        core::shape_error(std::span(model.rest.position).subspan(o.first, n), std::span(particles.position).subspan(o.first, n));
    r.objects[i].final_shape_error = share(error.rms, o.rest_diameter);
    raise(r.objects[i].largest_deformation, r.objects[i].final_shape_error);
  }
}

}  // namespace

void book_audits(const Model& model, const std::vector<Body>& bodies, double energy, const collision::ContactSurface& surface, State& state) {
  RunRecord& r = state.record;
  const core::Motion motion = core::measure_motion(model.particles, state.particles);
  if (!r.valid) {
    r = {};
    r.valid = true;
    r.initial = motion;
    r.initial_energy = energy;
    r.objects.resize(model.objects.size());
  }
  book_conservation(motion, energy, state.ledger, r);
  book_contacts(model, bodies, surface, r);
  book_shapes(model, state.particles, r);
}

double unaccounted_energy(double energy, const State& state) {
  return energy - state.record.initial_energy - state.ledger.external_work + state.ledger.dissipated;
}

std::optional<double> find_created_energy(const Energies& now, double before, const State& state) {
  constexpr double kNearlyAll = 0.9;
  const double created = unaccounted_energy(now.total(), state) - before;
  // Energies of pair laws may be negative: a pair that leaves a well gains that much.
  const double well = std::max(0.0, -(now.interaction + now.contact));
  const double all = std::max(state.record.largest_energy, now.total()) + 2.0 * well;
  return created > kNearlyAll * all ? std::optional(created) : std::nullopt;
}

Audits audits_of(const RunRecord& r) {
  return {.momentum_error = share(r.momentum_error, r.momentum_scale),
          .angular_momentum_error = share(r.angular_momentum_error, r.angular_momentum_scale),
          .energy_error = share(r.energy_error, r.largest_energy),
          .energy_returned = share(r.energy_returned, r.largest_energy),
          .contact_residual = r.contact_residual,
          .largest_overlap = r.largest_overlap,
          .largest_overlap_share = r.largest_overlap_share};
}

}  // namespace supple::scenes
