#include "simulation/stages.h"

#include <algorithm>
#include <limits>

#include "simulation/contact_bodies.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

StageProfile& profile_of(const StageContext& context, Stage stage) { return context.profile[static_cast<std::size_t>(stage)]; }

/// Pairs of components of an object that may not touch each other, of those that its list names.
std::uint64_t count_never(const StageContext& context, const ObjectModel& object, const std::vector<collision::BodyPair>& pairs) {
  const std::vector<Body>& bodies = context.bodies;
  std::uint64_t never = 0;
  for (const collision::BodyPair& pair : pairs) {
    if (object.are_groups(pair)) continue;
    const std::uint32_t i = body_led_by(bodies, object.first + pair.a), j = body_led_by(bodies, object.first + pair.b);
    if (collides(context, bodies[i]) && collides(context, bodies[j]) && !context.rules.allowed(i, j)) ++never;
  }
  return never;
}

/// Pairs that may ever touch. The particles of a `separate` object have the same rules, and so have components that do not break
/// except for the listed pairs, so the first one represents all. Groups are checked one by one.
std::uint64_t count_present_pairs(const StageContext& context) {
  struct Kind {
    std::uint32_t first = 0;
    std::uint64_t count = 0;
  };
  const std::vector<Body>& bodies = context.bodies;
  std::vector<Kind> kinds;
  std::vector<std::size_t> kind_of(context.model.objects.size(), std::numeric_limits<std::size_t>::max());  // of objects with equal bodies
  const auto count = static_cast<std::uint32_t>(bodies.size() + context.model.fixed.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    if (i < bodies.size()) {
      if (!collides(context, bodies[i]) || bodies[i].origin.is_group()) continue;
      const ObjectModel& object = context.model.objects[bodies[i].object];
      if (object.separate || (!object.component.empty() && !object.breaks)) {
        std::size_t& kind = kind_of[bodies[i].object];
        if (kind < kinds.size()) {
          ++kinds[kind].count;
          continue;
        }
        kind = kinds.size();
      }
    }
    kinds.push_back({.first = i, .count = 1});
  }
  std::uint64_t pairs = 0;
  for (std::size_t a = 0; a < kinds.size(); ++a) {
    if (kinds[a].count > 1) {
      const ObjectModel& object = context.model.objects[bodies[kinds[a].first].object];
      pairs += kinds[a].count * (kinds[a].count - 1) / 2;
      pairs -= count_never(context, object, object.bonded) + count_never(context, object, object.overlapping);
    }
    for (std::size_t b = a + 1; b < kinds.size(); ++b) {
      const bool moves = kinds[a].first < bodies.size() || kinds[b].first < bodies.size();
      if (moves && context.rules.allowed(kinds[a].first, kinds[b].first)) pairs += kinds[a].count * kinds[b].count;
    }
  }
  for (auto i = static_cast<std::uint32_t>(surface_count(bodies)); i < bodies.size(); ++i) {
    for (std::uint32_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
      if (collides(context, bodies[i]) && context.rules.allowed(i, j)) ++pairs;
    }
  }
  return pairs;
}

/// Pairs of bodies whose supports reach one another, one of them awake; sorted.
void find_reaching(const StageContext& context, Frame& frame) {
  const std::size_t moving = context.bodies.size();
  if (frame.resting.empty()) {
    frame.reach_list.find(frame.reach, context.executor, frame.reaching);
  } else {
    std::vector<std::uint32_t> number;  // of the boxes in the sweep
    std::vector<Box> boxes;
    const auto add = [&](std::size_t i) {
      number.push_back(static_cast<std::uint32_t>(i));
      boxes.push_back(frame.reach[i]);
    };
    for_awake(context, add);
    const std::size_t awake = number.size();
    for (std::size_t i = moving; i < frame.reach.size(); ++i) add(i);
    frame.reach_list.find(boxes, context.executor, frame.reaching);
    for (collision::BodyPair& pair : frame.reaching) pair = {number[pair.a], number[pair.b]};
    std::vector<std::uint32_t> found;
    for (std::size_t k = 0; k < awake; ++k) {
      found.clear();
      frame.resting_boxes.find(boxes[k], found);
      for (const std::uint32_t j : found) frame.reaching.push_back({std::min(number[k], j), std::max(number[k], j)});
    }
    std::sort(frame.reaching.begin(), frame.reaching.end());
  }
  std::erase_if(frame.reaching, [&](const collision::BodyPair& pair) {
    return (pair.a >= moving && pair.b >= moving) || !context.rules.allowed(pair.a, pair.b);
  });
}

/// Flags the bodies whose supports reach another body.
void flag_reached(const StageContext& context, Frame& frame) {
  const std::size_t moving = context.bodies.size();
  for (const std::uint32_t i : frame.reached) frame.near[i] = 0;
  frame.reached.clear();
  find_reaching(context, frame);
  const auto flag = [&](std::size_t i, const Box& other) {
    if (i >= moving || frame.near[i] != 0) return;
    const std::vector<Box>& support = frame.placed[i].support;
    if (std::none_of(support.begin(), support.end(), [&](const Box& box) { return box.overlaps(other); })) return;
    frame.reached.push_back(static_cast<std::uint32_t>(i));
    frame.near[i] = 1;
  };
  for (const collision::BodyPair& pair : frame.reaching) {
    flag(pair.a, frame.reach[pair.b]);
    flag(pair.b, frame.reach[pair.a]);
  }
  std::sort(frame.reached.begin(), frame.reached.end());
}

/// Where the surfaces of a pair may meet, and the parts in reach: the only ones that are sampled, unless both bodies are
/// convex, which need no samples to find each other. A rule on State alone, so it decides which kept distances move on.
void flag_sampled(const StageContext& context, Frame& frame) {
  for (const std::uint32_t i : frame.reached) {
    frame.active[i].clear();
    frame.shared[i].clear();
  }
  const auto spacing_of = [&](std::size_t i) {
    return i < context.bodies.size() ? context.model.objects[context.bodies[i].object].sample_spacing : 0.0;
  };
  for (const collision::BodyPair& pair : frame.pairs) {
    const auto reaches = [&](std::size_t i) { return i >= context.bodies.size() || frame.near[i] != 0; };
    if ((frame.convex[pair.a] != 0 && frame.convex[pair.b] != 0) || !reaches(pair.a) || !reaches(pair.b)) continue;
    // Samples search as far as their spacing, which blends and slopes widen.
    const double margin = 2.0 * std::max(spacing_of(pair.a), spacing_of(pair.b));
    const Box shared = frame.surface_box[pair.a].intersection(frame.surface_box[pair.b]).inflated(margin);
    for (const std::uint32_t i : {pair.a, pair.b}) {
      if (i >= context.bodies.size()) continue;
      frame.shared[i].push_back(shared);
      frame.active[i].resize(context.bodies[i].particle.size());
      for (std::size_t k = 0; k < frame.placed[i].support.size(); ++k) {
        if (frame.placed[i].support[k].overlaps(shared)) frame.active[i][context.bodies[i].skeleton.primitive[k].part] = 1;
      }
    }
  }
}

void clear_contact(Frame& frame) {
  frame.surface.clear();
  frame.pressed.clear();
}

void clear_reactions(Frame& frame) {
  frame.reaction = {};
  frame.traction_force.clear();
  frame.pair_power.clear();
  frame.friction_speed.clear();
}

void clear_loads(const StageContext& context, Frame& frame) {
  context.executor.for_blocks(frame.pressed.size(), kBodyBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t i = frame.pressed[k];
      for (collision::PartLoads* loads : {&frame.loads[i], &frame.dissipative[i]}) {
        loads->force.assign(frame.bodies[i].pose.size(), Vec3::Zero());
        loads->torque.assign(frame.bodies[i].pose.size(), Vec3::Zero());
      }
    }
  });
}

void add_loads(const StageContext& context, const Frame& frame, bool dissipates, core::ForceSample& out) {
  for (const std::uint32_t i : frame.pressed) {
    if (i >= context.bodies.size()) {
      const Vec3 &force = frame.loads[i].force[0], &torque = frame.loads[i].torque[0];
      const LedSolid& led = frame.led[i - context.bodies.size()];
      out.force_on_fixed += force;
      out.moment_on_fixed += led.pose.position.cross(force) + torque;
      out.power_of_fixed -= force.dot(led.velocity) + torque.dot(led.spin);
      const collision::PartLoads& taken = frame.dissipative[i];
      out.dissipated_at_fixed -= taken.force[0].dot(led.velocity) + taken.torque[0].dot(led.spin);
      continue;
    }
    const std::vector<std::uint32_t>& particle = context.bodies[i].particle;
    if (dissipates) {
      core::add_part_loads(frame.dissipative[i].force, frame.dissipative[i].torque, particle, out.dissipative);
    }
    core::add_part_loads(frame.loads[i].force, frame.loads[i].torque, particle, out.internal);
  }
}

}  // namespace

namespace stages {

void place_skeleton(const StageContext& context, const core::ParticleState& particles, Frame& frame) {
  StageProfile& profile = profile_of(context, Stage::PlaceSkeleton);
  StageTimer timer(profile, context.timing);
  place_contact_bodies(context, particles, frame);
  for_awake(context, [&](std::size_t i) { profile.visited += context.bodies[i].skeleton.primitive.size(); });
  profile.present += frame.primitives_present;
  flag_reached(context, frame);
}

void index_field(const StageContext& context, const core::ParticleState& particles, bool all, Frame& frame) {
  StageProfile& profile = profile_of(context, Stage::IndexField);
  StageTimer timer(profile, context.timing);
  profile.present += frame.bodies_present;
  const auto index_one = [&](std::size_t i) {
    index_body(context, i, frame);
    frame.surface_box[i] = frame.field[i].surface_box();
    view_body(context, particles, i, frame);
  };
  if (!context.skip) {
    for_awake_at_once(context, index_one);
    for_awake(context, [&](std::size_t) { ++profile.visited; });
    return;
  }
  // Bodies whose supports reach no other body cannot touch: their fields are not even indexed.
  context.executor.for_blocks(frame.reached.size(), kBodyBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) index_one(frame.reached[k]);
  });
  profile.visited += frame.reached.size();
  if (all) for_awake(context, [&](std::size_t i) { view_body(context, particles, i, frame); });
}

void sample_surface(const StageContext& context, std::vector<implicit::SampleState>& samples, Frame& frame) {
  frame.pairs.clear();
  if (context.skip && frame.reached.empty()) return;
  StageProfile& profile = profile_of(context, Stage::SampleSurface);
  StageTimer timer(profile, context.timing);
  const auto usable = [&](std::uint32_t i) {
    return i >= context.bodies.size() || frame.near[i] != 0 || (!context.skip && collides(context, context.bodies[i]));
  };
  for (const collision::BodyPair& pair : frame.reaching) {
    if (!usable(pair.a) || !usable(pair.b)) continue;
    if (frame.surface_box[pair.a].overlaps(frame.surface_box[pair.b])) frame.pairs.push_back(pair);
  }
  flag_sampled(context, frame);
  profile.present += frame.samples_present;
  for (const std::uint32_t i : frame.reached) {
    if (frame.shared[i].empty()) {
      frame.samples[i] = {};
      continue;
    }
    const Body& body = context.bodies[i];
    const bool rigid = body.skeleton.part_count == 1 && !context.model.objects[body.object].holds_volume;
    implicit::sample_surface({body.skeleton, body.samples, frame.pose[i], frame.field[i], rigid ? &frame.rigid_samples[i] : nullptr}, {frame.active[i], frame.shared[i]},
                             context.executor, samples[i], frame.samples[i]);
    profile.visited += frame.samples[i].visited;
  }
}

void find_contacts(const StageContext& context, Frame& frame) {
  frame.candidates.pair.clear();
  if (context.skip && frame.reached.empty()) return;
  StageProfile& profile = profile_of(context, Stage::FindContacts);
  StageTimer timer(profile, context.timing);
  if (!frame.pairs_present) frame.pairs_present = count_present_pairs(context);
  profile.present += *frame.pairs_present;
  profile.visited += frame.pairs.size();
  if (context.skip && frame.pairs.empty()) return;
  collision::find_contacts(frame.bodies, frame.pairs, context.executor, frame.candidates);
}

void solve_contact_surface(const StageContext& context, bool energy, Frame& frame) {
  if (context.skip && frame.candidates.pair.empty()) return clear_contact(frame);
  StageProfile& profile = profile_of(context, Stage::SolveContactSurface);
  StageTimer timer(profile, context.timing);
  collision::ContactSettings settings = context.model.contact;
  settings.error = std::max(settings.error, context.contact_error);
  settings.energy = energy;
  collision::solve_contact_surface(frame.bodies, frame.candidates, settings, context.executor, frame.surface);
  std::vector<std::uint8_t> touches(frame.bodies.size(), 0);
  for (const auto& s : frame.surface.summary) {
    touches[s.bodies.a] = touches[s.bodies.b] = 1;
    profile.evaluations += s.evaluations;
  }
  frame.pressed.clear();
  for (std::uint32_t i = 0; i < touches.size(); ++i) {
    if (touches[i] != 0) frame.pressed.push_back(i);
  }
  profile.present += frame.candidates.pair.size();
  profile.visited += frame.surface.summary.size();
}

void react(const StageContext& context, Frame& frame, core::ForceSample& out) {
  const Model& model = context.model;
  clear_reactions(frame);
  if (context.skip && frame.surface.summary.empty()) return;
  StageProfile& profile = profile_of(context, Stage::React);
  StageTimer timer(profile, context.timing);
  clear_loads(context, frame);
  collision::ReactionSettings settings = model.reaction;
  settings.step = context.step;
  frame.reaction = collision::react({frame.bodies, context.rules, frame.surface, settings, context.sticks}, context.executor,
                                    {frame.loads, frame.dissipative, &frame.traction_force, &frame.pair_power, &frame.friction_speed});
  const bool dissipates = frame.reaction.dissipated_power != 0.0 || model.reaction.stick.stiffness > 0.0;
  if (dissipates) out.dissipative.reset(model.particles.size());
  add_loads(context, frame, dissipates, out);
  profile.visited += frame.surface.point.size();
  profile.present += frame.surface.point.size();
}

void linearise(const StageContext& context, Frame& frame, core::ContactPoints& out) {
  clear_reactions(frame);
  out.clear();
  if (frame.surface.summary.empty()) return;
  StageProfile& profile = profile_of(context, Stage::React);
  StageTimer timer(profile, context.timing);
  std::vector<std::span<const std::uint32_t>> particles(frame.bodies.size());
  for (std::size_t i = 0; i < context.bodies.size(); ++i) particles[i] = context.bodies[i].particle;
  collision::linearise_contacts({frame.bodies, context.rules, frame.surface, context.model.reaction}, particles, frame.linearise, out);
  profile.visited += frame.surface.point.size();
  profile.present += frame.surface.point.size();
}

}  // namespace stages

void find_contact_surface(const StageContext& context, const core::ParticleState& particles,
                          std::vector<implicit::SampleState>& samples, Frame& frame, bool energy) {
  stages::place_skeleton(context, particles, frame);
  stages::index_field(context, particles, energy, frame);
  stages::sample_surface(context, samples, frame);
  stages::find_contacts(context, frame);
  stages::solve_contact_surface(context, energy, frame);
}

}  // namespace supple::scenes
