#include "pieces.h"

#include <algorithm>

namespace supple::scenes {

bool age_broken_links(const Model& model, double dt, State& state) {
  bool any = false;
  for (std::size_t k = 0; k < state.broken_for.size(); ++k) {
    if (state.links.broken[k] == 0) continue;
    const double fade = model.objects[model.particles.object[model.links.first[k]]].fade;
    if (!(state.broken_for[k] < fade)) continue;
    state.broken_for[k] = std::min(state.broken_for[k] + dt, fade);
    any = true;
  }
  return any;
}

ApartPairs inherited_apart(const Model& model, const std::vector<Body>& before, const ApartPairs& apart, const std::vector<Body>& bodies) {
  const auto origin = [&before](const Body& body) {
    for (const Body& old : before) {
      if (std::binary_search(old.particle.begin(), old.particle.end(), body.particle.front())) return old.particle.front();
    }
    return body.particle.front();
  };
  ApartPairs pairs;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (model.objects[bodies[i].object].separate) continue;
    for (std::size_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
      const auto [a, b] = std::minmax({origin(bodies[i]), origin(bodies[j])});
      if (std::binary_search(apart.begin(), apart.end(), collision::BodyPair{a, b})) {
        pairs.push_back({bodies[i].particle.front(), bodies[j].particle.front()});
      }
    }
  }
  return pairs;
}

std::vector<implicit::SampleState> inherited_samples(const std::vector<Body>& before, const std::vector<implicit::SampleState>& samples,
                                                     const std::vector<Body>& bodies) {
  std::vector<implicit::SampleState> out;
  for (const Body& body : bodies) {
    const auto same = std::find_if(before.begin(), before.end(), [&body](const Body& old) { return old.particle == body.particle; });
    out.push_back(same != before.end() ? samples[static_cast<std::size_t>(same - before.begin())] : fresh_samples(body));
  }
  return out;
}

implicit::SampleState fresh_samples(const Body& body) { return {.distance = std::vector<double>(body.samples.size(), -1.0)}; }

bool note_apart(const StageContext& context, const core::ParticleState& particles, Frame& frame, ApartPairs& apart) {
  const std::vector<Body>& bodies = context.bodies;
  ApartPairs fresh;
  std::vector<std::uint8_t> placed(bodies.size(), 0);
  const auto surface_box = [&](std::size_t i) {
    if (placed[i] == 0) place_and_index(context, particles, i, frame);
    placed[i] = 1;
    return frame.field[i].surface_box();
  };
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const ObjectModel& object = context.model.objects[bodies[i].object];
    if (!object.collides || object.separate || bodies[i].skeleton.primitive.empty()) continue;
    for (std::size_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
      const collision::BodyPair pair{bodies[i].particle.front(), bodies[j].particle.front()};
      if (bodies[j].skeleton.primitive.empty() || std::binary_search(apart.begin(), apart.end(), pair)) continue;
      if (!surface_box(i).overlaps(surface_box(j))) fresh.push_back(pair);
    }
  }
  if (fresh.empty()) return false;
  apart.insert(apart.end(), fresh.begin(), fresh.end());
  std::sort(apart.begin(), apart.end());
  return true;
}

}  // namespace supple::scenes
