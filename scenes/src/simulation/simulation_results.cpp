#include "simulation/simulation_impl.h"

#include <algorithm>
#include <utility>

#include "file/scene_places.h"
#include "model/divide.h"
#include "output/pictures/camera.h"
#include "output/pictures/picture.h"
#include "simulation/audits.h"
#include "simulation/stages.h"
#include "supple/core/error.h"

namespace supple::scenes {

/// Cameras without a position see the present surfaces, and the ground below them.
void Simulation::Impl::place_cameras() {
  const std::span<const CameraDesc> cameras = cameras_of(scene);
  Box seen;
  if (std::any_of(cameras.begin(), cameras.end(), is_open)) {
    pull_fields();
    for (std::size_t i = 0; i < surface_count(bodies); ++i) {
      const LookDesc& look = scene.objects[bodies[i].object].look;
      if (!bodies[i].skeleton.primitive.empty() && (look.surface || look.wireframe)) seen = seen.united(pulled.field[i].surface_box());
    }
    const std::vector<Mesh> obstacles = obstacle_meshes(scene, model, time());
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
      if (scene.obstacles[i].shape == ObstacleName::Plane) continue;
      for (const Vec3& p : obstacles[i].position) seen.include(p);
    }
    if (scene.ground && scene.ground->visible && !seen.empty()) seen.lower.z() = std::min(seen.lower.z(), scene.ground->height);
  }
  model.cameras = placed_cameras(scene, seen);
}

/// Results are dropped; meshers keep their data, which are valid for any state.
void Simulation::Impl::renew_pulled() {
  DivisionMeshers dividing = std::move(pulled.dividing);
  division.reset();
  pulled = Frame(model, bodies);
  pulled.dividing = std::move(dividing);
}

void Simulation::Impl::drop_results() {
  pulled_contacts = pulled_fields = pulled_meshes = false;
  division.reset();
  meshes.clear();
  searches = {};
}

void Simulation::Impl::pull_contacts() {
  if (pulled_contacts) return;
  if (contact_on()) {
    std::vector<implicit::SampleState> trial = state.samples;
    Profile unused{};
    StageContext quiet{model, bodies, rules, executor, unused, options.skip, StepTiming::None};
    quiet.sticks = &state.sticks;
    quiet.time = time();
    quiet.step = held_step();
    find_contact_surface(quiet, state.particles, trial, pulled, true);
    pulled_sample.internal.reset(model.particles.size());
    stages::react(quiet, pulled, pulled_sample);
  }
  pulled_contacts = true;
  pulled_fields = false;
}

void Simulation::Impl::pull_fields() {
  pull_contacts();
  if (pulled_fields) return;
  Profile unused{};
  place_and_index_all({model, bodies, rules, executor, unused, options.skip, StepTiming::None}, state.particles, pulled);
  pulled_fields = true;
}

const Division& Simulation::Impl::pull_division() {
  pull_fields();
  if (division) return *division;
  const bool bulges = model.bulge.attenuation > 0.0 || model.bulge.keep_volume;
  if (!options.divide && !bulges) return division.emplace();
  division = division_of(model, bodies, pulled.field, pulled.bodies, pulled.surface, executor);
  SearchCounts found;
  found.short_bulges = find_short_bulges(model, bodies, *division, time());
  searches.add(found);
  all_searches.add(found);
  set_missed(scene.output.meshing, all_searches, warnings);
  return *division;
}

const std::vector<Mesh>& Simulation::Impl::pull_meshes() {
  if (pulled_meshes) return meshes;
  pull_fields();
  const StageTimer timer(profile[static_cast<std::size_t>(Stage::Polygonise)], StepTiming::Apart);
  pull_division();
  StageContext wanted = context();
  if (shown) wanted.shown = &shown;
  try {
    meshes = polygonise_objects(wanted, *division, state, laws, pulled);
    searches.add(pulled.missed);
    all_searches.add(pulled.missed);
    set_missed(scene.output.meshing, all_searches, warnings);
  } catch (const Error& error) {
    rethrow_with_places(scene, error);
  }
  pulled_meshes = true;
  return meshes;
}

/// Of the present bodies as they touch now, without springs of friction [J]
double Simulation::Impl::contact_energy() {
  pull_contacts();
  double sum = 0.0;
  for (const auto& s : pulled.surface.summary) sum += s.energy;
  return sum;
}

Energies Simulation::Impl::energies() {
  Energies e;
  e.kinetic = core::measure_motion(model.particles, state.particles).kinetic_energy;
  e.interaction = core::potential_energy(model.particles, state.particles, laws);
  e.contact = contact_energy() + collision::stick_energy(model.reaction.stick, state.sticks);
  return e;
}

Energies Simulation::Impl::energies_within(double at) {
  Profile unused{};
  StageContext quiet = quiet_context(unused);
  quiet.time = at;
  std::vector<implicit::SampleState> trial = state.samples;
  find_contact_surface(quiet, state.particles, trial, pulled, true);
  Energies e{.kinetic = core::measure_motion(model.particles, state.particles).kinetic_energy,
             .interaction = core::potential_energy(model.particles, state.particles, laws)};
  for (const auto& s : pulled.surface.summary) e.contact += s.energy;
  return e;
}

/// @return the first pair that has passed into each other wholly
std::optional<RunRecord::Overload> Simulation::Impl::book_audits() {
  const double energy = energies().total();  // and the contacts
  scenes::book_audits(model, bodies, energy, pulled.surface, state);
  return OverloadWatch::look_within(context(), pulled, time(), state.record);
}

}  // namespace supple::scenes
