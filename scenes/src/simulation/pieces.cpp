#include "simulation/pieces.h"

#include <algorithm>

#include "model/warnings.h"

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
  const auto origin = [&](const Body& body) {
    for (const Body& old : before) {
      if (old.origin.is_group() != body.origin.is_group()) continue;
      if (std::binary_search(old.particle.begin(), old.particle.end(), body.particle.front())) return leader_of(model, old);
    }
    return leader_of(model, body);
  };
  std::vector<std::uint32_t> from;
  for (const Body& body : bodies) from.push_back(origin(body));
  ApartPairs pairs;
  for (std::size_t i = 0; i < bodies.size() && !apart.empty(); ++i) {
    if (model.objects[bodies[i].object].separate) continue;
    for (std::size_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
      const auto [a, b] = std::minmax({from[i], from[j]});
      if (std::binary_search(apart.begin(), apart.end(), collision::BodyPair{a, b})) {
        pairs.push_back({leader_of(model, bodies[i]), leader_of(model, bodies[j])});
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<implicit::SampleState> inherited_samples(const std::vector<Body>& before, const std::vector<implicit::SampleState>& samples,
                                                     const std::vector<Body>& bodies) {
  std::vector<implicit::SampleState> out;
  for (const Body& body : bodies) {
    const auto same = std::find_if(before.begin(), before.end(), [&body](const Body& old) {
      return old.origin.is_group() == body.origin.is_group() && old.particle == body.particle;
    });
    out.push_back(same != before.end() ? samples[static_cast<std::size_t>(same - before.begin())] : fresh_samples(body));
  }
  return out;
}

implicit::SampleState fresh_samples(const Body& body) { return {.distance = std::vector<double>(body.samples.size(), -1.0)}; }

bool note_overlapping(const std::vector<Body>& bodies, const Frame& frame, Model& model) {
  bool any = false;
  const auto note = [&](const collision::BodyPair& pair) {
    if (pair.b >= bodies.size() || bodies[pair.a].object != bodies[pair.b].object) return;
    const BodyOrigin &first = bodies[pair.a].origin, &second = bodies[pair.b].origin;
    const auto [a, b] = std::minmax({first.number(), second.number()});
    ObjectModel& object = model.objects[bodies[pair.a].object];
    if (a == b || first.is_group() != second.is_group() || (object.component.empty() && !first.is_group())) return;
    object.overlapping.push_back({a, b});
    any = true;
  };
  for (const auto& s : frame.surface.summary) note(s.bodies);
  for (const collision::BodyPair& pair : frame.reaching) {
    if (begins_deep(bodies, frame, pair)) note(pair);
  }
  for (ObjectModel& object : model.objects) {
    std::vector<collision::BodyPair>& pairs = object.overlapping;
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  }
  return any;
}

namespace {

/// Groups of an object by their numbers: of what may break there may be several with the same, or none.
using GroupNumbers = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

GroupNumbers groups_of(const ObjectModel& object, const std::vector<Body>& bodies) {
  GroupNumbers all;
  const auto first = bodies.begin() + static_cast<std::ptrdiff_t>(surface_count(bodies));
  const auto before = [](const Body& body, std::uint32_t p) { return body.particle.front() < p; };
  for (auto body = std::lower_bound(first, bodies.end(), object.first, before); body != bodies.end() && body->particle.front() < object.last; ++body) {
    all.emplace_back(body->origin.group, static_cast<std::uint32_t>(body - bodies.begin()));
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// Pairs of one object of kind OnceApart that have not been apart yet.
std::vector<collision::BodyPair> pairs_to_part(const Model& model, const std::vector<Body>& bodies, const ApartPairs& apart) {
  std::vector<collision::BodyPair> pairs;
  const auto add = [&](std::uint32_t i, std::uint32_t j) {
    if (meeting_of(model.objects[bodies[i].object], bodies[i].origin, bodies[j].origin) != Meeting::OnceApart) return;
    if (bodies[i].skeleton.primitive.empty() || bodies[j].skeleton.primitive.empty()) return;
    const auto [a, b] = std::minmax({leader_of(model, bodies[i]), leader_of(model, bodies[j])});
    if (!std::binary_search(apart.begin(), apart.end(), collision::BodyPair{a, b})) pairs.push_back({std::min(i, j), std::max(i, j)});
  };
  const auto body_of = [&](std::uint32_t particle) { return body_led_by(bodies, particle); };
  for (const ObjectModel& object : model.objects) {
    if (!object.collides || object.separate) continue;
    const GroupNumbers groups = object.group.empty() ? GroupNumbers{} : groups_of(object, bodies);
    const auto add_groups = [&](std::uint32_t i, std::uint32_t number) {
      for (auto other = std::lower_bound(groups.begin(), groups.end(), std::pair(number, 0u)); other != groups.end() && other->first == number; ++other) {
        if (i < other->second) add(i, other->second);
      }
    };
    for (const auto& [number, body] : groups) {
      for (const std::uint32_t other : bodies[body].origin.cut) add_groups(body, other);
    }
    for (const collision::BodyPair& pair : object.overlapping) {  // few
      if (!object.are_groups(pair)) {
        if (!object.breaks) add(body_of(object.first + pair.a), body_of(object.first + pair.b));
        continue;
      }
      for (auto one = std::lower_bound(groups.begin(), groups.end(), std::pair(pair.a, 0u)); one != groups.end() && one->first == pair.a; ++one) {
        add_groups(one->second, pair.b);
      }
    }
    if (!object.breaks) continue;  // its bodies are components
    const std::uint32_t end = body_of(object.last);
    for (std::uint32_t i = body_of(object.first); i < end; ++i) {
      for (std::uint32_t j = i + 1; j < end; ++j) add(i, j);
    }
  }
  return pairs;
}

}  // namespace

bool note_apart(const StageContext& context, const core::ParticleState& particles, Frame& frame, ApartPairs& apart) {
  const std::vector<Body>& bodies = context.bodies;
  ApartPairs fresh;
  std::vector<std::uint8_t> placed(bodies.size(), 0);
  const auto surface_box = [&](std::size_t i) {
    if (placed[i] == 0) place_and_index(context, particles, i, frame);
    placed[i] = 1;
    return frame.field[i].surface_box();
  };
  for (const collision::BodyPair& pair : pairs_to_part(context.model, bodies, apart)) {
    if (surface_box(pair.a).overlaps(surface_box(pair.b))) continue;
    fresh.push_back({leader_of(context.model, bodies[pair.a]), leader_of(context.model, bodies[pair.b])});
  }
  if (fresh.empty()) return false;
  apart.insert(apart.end(), fresh.begin(), fresh.end());
  std::sort(apart.begin(), apart.end());
  return true;
}

}  // namespace supple::scenes
