#include "simulation/frame.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "supple/collision/deformed_field.h"
#include "supple/core/cpu_time.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

constexpr std::size_t kBodyBlock = 16;

Box box_of(const implicit::PlacedSkeleton& placed) {
  Box box;
  for (const Box& support : placed.support) box = box.united(support);
  return box;
}

bool has_surface(const Body& body) { return !body.skeleton.primitive.empty(); }

bool collides(const StageContext& context, const Body& body) {
  return has_surface(body) && context.model.objects[body.object].collides;
}

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

/// Pairs that may ever touch. The particles of a `separate` object are alike to the rules, and so are components that do not break
/// but for the pairs listed, so the first stands for all. Groups are looked at one by one.
std::uint64_t count_present_pairs(const StageContext& context) {
  struct Kind {
    std::uint32_t first = 0;
    std::uint64_t count = 0;
  };
  const std::vector<Body>& bodies = context.bodies;
  std::vector<Kind> kinds;
  std::vector<std::size_t> kind_of(context.model.objects.size(), std::numeric_limits<std::size_t>::max());  // of those whose bodies are alike
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

void place(const StageContext& context, const core::ParticleState& particles, std::size_t i, Frame& frame) {
  const Body& body = context.bodies[i];
  core::gather_poses(particles, body.particle, frame.pose[i]);
  implicit::place_skeleton(body.skeleton, frame.pose[i], frame.placed[i]);
  frame.reach[i] = box_of(frame.placed[i]);
  frame.indexed[i] = 0;
}

void index(const StageContext& context, std::size_t i, Frame& frame) {
  if (frame.indexed[i]) return;
  implicit::index_field(context.bodies[i].skeleton, frame.placed[i], frame.field[i]);
  frame.indexed[i] = 1;
}

/// What contact sees of one body.
void view_body(const StageContext& context, const core::ParticleState& particles, std::size_t i, Frame& frame) {
  const Model& model = context.model;
  const Body& own = context.bodies[i];
  collision::ContactBody& body = frame.bodies[i];
  core::gather_motion(model.particles, particles, own.particle, frame.velocity[i], frame.spin[i]);
  body.field = frame.field[i];
  body.material = model.objects[own.object].material;
  body.pose = frame.pose[i];
  body.velocity = frame.velocity[i];
  body.angular_velocity = frame.spin[i];
  body.samples = &frame.samples[i];
  body.skeleton = &own.skeleton;
  body.yield = own.yield;
  body.core_value = std::numeric_limits<double>::infinity();
  for (const implicit::Primitive& primitive : own.skeleton.primitive) {
    body.core_value = std::min(body.core_value, implicit::peak(primitive.kernel) - own.skeleton.iso);
  }
}

/// A solid that is led along, at its place; its field.
implicit::FieldView lead(const FixedBody& body, double time, LedSolid& led) {
  const SolidPlace place = place_at(body.motion, time);
  led.pose = place.pose;
  led.velocity = place.velocity;
  led.spin = place.spin;
  if (const auto* plane = std::get_if<implicit::HalfSpace>(&body.solid)) {
    led.solid = implicit::HalfSpace{place.pose.position, plane->normal, plane->slope};
  } else if (const auto* box = std::get_if<implicit::SolidBox>(&body.solid)) {
    led.solid = box->placed(place.pose);
  } else {
    led.solid = implicit::MovedField(body.field(), place.pose);
  }
  return std::visit(
      [](const auto& s) -> implicit::FieldView {
        if constexpr (std::is_same_v<std::decay_t<decltype(s)>, std::monostate>) {
          return {};
        } else {
          return s;
        }
      },
      led.solid);
}

/// Fixed bodies, after the others: all of them when `first_time`, then those that are led along.
void view_fixed_bodies(const Model& model, double time, bool first_time, Frame& frame) {
  const std::size_t first = frame.reach.size() - model.fixed.size();
  for (std::size_t k = 0; k < model.fixed.size(); ++k) {
    const FixedBody& fixed = model.fixed[k];
    if (!first_time && !fixed.led()) continue;
    LedSolid& led = frame.led[k];
    collision::ContactBody& body = frame.bodies[first + k];
    body.field = fixed.led() ? lead(fixed, time, led) : fixed.field();
    body.material = fixed.material;
    body.pose = {&led.pose, 1};
    body.velocity = {&led.velocity, 1};
    body.angular_velocity = {&led.spin, 1};
    body.fixed = true;
    const Box box = body.field.surface_box();
    if (fixed.core_value) {
      body.core_value = *fixed.core_value;
    } else if (box.lower.allFinite() && box.upper.allFinite()) {
      body.core_value = body.field.value(box.centre());
    }
    frame.reach[first + k] = frame.surface_box[first + k] = box;
    frame.convex[first + k] = body.field.core_point(Vec3::Zero()) ? 1 : 0;
  }
}

/// Calls use(i) for every body that is awake and collides.
template <class Use>
void for_awake(const StageContext& context, const Use& use) {
  const std::size_t count = context.awake != nullptr ? context.awake->size() : context.bodies.size();
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = context.awake != nullptr ? (*context.awake)[k] : k;
    if (collides(context, context.bodies[i])) use(i);
  }
}

/// The same from several threads; bodies share nothing there.
template <class Use>
void for_awake_at_once(const StageContext& context, const Use& use) {
  const std::size_t count = context.awake != nullptr ? context.awake->size() : context.bodies.size();
  context.executor.for_blocks(count, kBodyBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t i = context.awake != nullptr ? (*context.awake)[k] : k;
      if (collides(context, context.bodies[i])) use(i);
    }
  });
}

/// Bodies that rest are placed when they have fallen asleep, and stay.
void place_resting(const StageContext& context, const core::ParticleState& particles, Frame& frame) {
  if (frame.resting_placed) return;
  frame.resting_placed = true;
  frame.resting.clear();
  for (std::uint32_t i = 0; context.awake != nullptr && i < context.bodies.size(); ++i) {
    if (!collides(context, context.bodies[i]) || !rests(context, i)) continue;
    place(context, particles, i, frame);
    frame.resting.push_back(i);
  }
  frame.resting_boxes.build(frame.reach, frame.resting);
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

/// Where the surfaces of a pair may meet, and the parts that reach there: the only ones that are sampled, unless both bodies are
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
    // Samples look as far as they lie apart, which blends and slopes widen.
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

}  // namespace

Frame::Frame(const Model& model, const std::vector<Body>& all)
    : pose(all.size()),
      velocity(all.size()),
      spin(all.size()),
      placed(all.size()),
      reach(all.size() + model.fixed.size()),
      surface_box(reach.size()),
      field(all.size()),
      indexed(all.size(), 0),
      mesher(all.size()),
      creases(all.size()),
      convex(reach.size(), 0),
      near(all.size(), 0),
      active(all.size()),
      shared(all.size()),
      samples(all.size()),
      led(model.fixed.size()),
      bodies(reach.size()),
      loads(reach.size()),
      dissipative(reach.size()) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    convex[i] = implicit::has_convex_core(all[i].skeleton) ? 1 : 0;
    primitives_present += all[i].skeleton.primitive.size();
    if (!has_surface(all[i]) || !model.objects[all[i].object].collides) continue;
    ++bodies_present;
    samples_present += all[i].samples.size();
  }
  view_fixed_bodies(model, 0.0, true, *this);
}

void StageProfile::scale() {
  cpu_s = apart_s + first_s;
  if (timed > 1) cpu_s += later_s * static_cast<double>(calls - 1) / static_cast<double>(timed - 1);
  cpu_s = std::max(cpu_s, 0.0);  // of next to nothing, without what the clock took
}

StageTimer::StageTimer(StageProfile& profile, bool timed) : profile_(profile), timed_(timed || profile.calls == 0) {
  ++profile.calls;
  if (timed_) begin_ = process_cpu_seconds();
}

StageTimer::~StageTimer() {
  if (timed_) (profile_.timed++ == 0 ? profile_.first_s : profile_.later_s) += process_cpu_seconds() - begin_ - process_cpu_clock_cost();
  profile_.scale();
}

std::uint32_t body_led_by(const std::vector<Body>& bodies, std::uint32_t particle) {
  const auto before = [](const Body& body, std::uint32_t p) { return !body.origin.is_group() && body.particle.front() < p; };
  return static_cast<std::uint32_t>(std::lower_bound(bodies.begin(), bodies.end(), particle, before) - bodies.begin());
}

bool rests(const StageContext& context, std::size_t body) {
  return context.awake != nullptr && !std::binary_search(context.awake->begin(), context.awake->end(), static_cast<std::uint32_t>(body));
}

void place_and_index(const StageContext& context, const core::ParticleState& particles, std::size_t body, Frame& frame) {
  place(context, particles, body, frame);
  index(context, body, frame);
}

void place_and_index_all(const StageContext& context, const core::ParticleState& particles, Frame& frame) {
  for (std::size_t i = 0; i < context.bodies.size(); ++i) {
    if (has_surface(context.bodies[i])) place_and_index(context, particles, i, frame);
  }
}

std::vector<std::uint32_t> find_stirred(const StageContext& context, const core::ParticleState& particles, double until, Frame& frame) {
  std::vector<std::uint32_t> stirred;
  const std::vector<FixedBody>& fixed = context.model.fixed;
  const auto led_along = [&](const FixedBody& body) { return moves(body.motion, context.time, until); };
  if (std::none_of(fixed.begin(), fixed.end(), led_along)) return stirred;
  place_resting(context, particles, frame);
  for (const double time : {context.time, until}) {
    view_fixed_bodies(context.model, time, false, frame);
    for (std::size_t k = 0; k < fixed.size(); ++k) {
      if (led_along(fixed[k])) frame.resting_boxes.find(frame.reach[context.bodies.size() + k], stirred);
    }
  }
  return stirred;
}

void place_contact_bodies(const StageContext& context, const core::ParticleState& particles, Frame& frame) {
  view_fixed_bodies(context.model, context.time, false, frame);
  place_resting(context, particles, frame);
  for_awake_at_once(context, [&](std::size_t i) { place(context, particles, i, frame); });
}

void find_contact_surface(const StageContext& context, const core::ParticleState& particles,
                          std::vector<implicit::SampleState>& samples, Frame& frame, bool energy) {
  const Model& model = context.model;
  const std::vector<Body>& bodies = context.bodies;
  const auto profile = [&](Stage stage) -> StageProfile& {
    return context.profile[static_cast<std::size_t>(stage)];
  };
  const auto nothing_touches = [&frame] {
    frame.surface.clear();
    frame.pressed.clear();
  };
  {
    StageTimer timer(profile(Stage::PlaceSkeleton), context.timed);
    place_contact_bodies(context, particles, frame);
    for_awake(context, [&](std::size_t i) { profile(Stage::PlaceSkeleton).visited += bodies[i].skeleton.primitive.size(); });
    profile(Stage::PlaceSkeleton).present += frame.primitives_present;
    flag_reached(context, frame);
  }
  // Bodies whose supports reach no other body cannot touch: their fields are not even indexed.
  const bool near = !frame.reached.empty();
  {
    StageTimer timer(profile(Stage::IndexField), context.timed);
    const auto index_one = [&](std::size_t i) {
      index(context, i, frame);
      frame.surface_box[i] = frame.field[i].surface_box();
      view_body(context, particles, i, frame);
    };
    std::uint64_t& visited = profile(Stage::IndexField).visited;
    profile(Stage::IndexField).present += frame.bodies_present;
    if (!context.skip) {
      for_awake_at_once(context, index_one);
      for_awake(context, [&](std::size_t) { ++visited; });
    } else {
      context.executor.for_blocks(frame.reached.size(), kBodyBlock, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) index_one(frame.reached[k]);
      });
      visited += frame.reached.size();
      if (energy) for_awake(context, [&](std::size_t i) { view_body(context, particles, i, frame); });
    }
  }
  if (context.skip && !near) return nothing_touches();
  {
    StageTimer timer(profile(Stage::SampleSurface), context.timed);
    const auto usable = [&](std::uint32_t i) {
      return i >= bodies.size() || frame.near[i] != 0 || (!context.skip && collides(context, bodies[i]));
    };
    frame.pairs.clear();
    for (const collision::BodyPair& pair : frame.reaching) {
      if (!usable(pair.a) || !usable(pair.b)) continue;
      if (frame.surface_box[pair.a].overlaps(frame.surface_box[pair.b])) frame.pairs.push_back(pair);
    }
    flag_sampled(context, frame);
    profile(Stage::SampleSurface).present += frame.samples_present;
    for (const std::uint32_t i : frame.reached) {
      if (frame.shared[i].empty()) {
        frame.samples[i] = {};
        continue;
      }
      const Body& body = bodies[i];
      implicit::sample_surface(body.skeleton, body.samples, frame.pose[i], frame.field[i], frame.active[i],
                               frame.shared[i], context.executor, samples[i], frame.samples[i]);
      profile(Stage::SampleSurface).visited += frame.samples[i].visited;
    }
  }
  {
    StageTimer timer(profile(Stage::FindContacts), context.timed);
    if (!frame.pairs_present) frame.pairs_present = count_present_pairs(context);
    profile(Stage::FindContacts).present += *frame.pairs_present;
    profile(Stage::FindContacts).visited += frame.pairs.size();
    if (context.skip && frame.pairs.empty()) return nothing_touches();
    collision::find_contacts(frame.bodies, frame.pairs, context.executor, frame.candidates);
  }
  if (context.skip && frame.candidates.pair.empty()) return nothing_touches();
  {
    StageTimer timer(profile(Stage::SolveContactSurface), context.timed);
    collision::ContactSettings settings = model.contact;
    settings.energy = energy;
    collision::solve_contact_surface(frame.bodies, frame.candidates, settings, context.executor, frame.surface);
    std::vector<std::uint8_t> touches(frame.bodies.size(), 0);
    for (const auto& s : frame.surface.summary) touches[s.bodies.a] = touches[s.bodies.b] = 1;
    frame.pressed.clear();
    for (std::uint32_t i = 0; i < touches.size(); ++i) {
      if (touches[i] != 0) frame.pressed.push_back(i);
    }
    profile(Stage::SolveContactSurface).present += frame.candidates.pair.size();
    profile(Stage::SolveContactSurface).visited += frame.surface.summary.size();
  }
}

void apply_reactions(const StageContext& context, Frame& frame, core::ForceSample& out) {
  const Model& model = context.model;
  frame.reaction = {};
  frame.traction_force.clear();
  frame.pair_power.clear();
  if (context.skip && frame.surface.summary.empty()) return;
  StageProfile& profile = context.profile[static_cast<std::size_t>(Stage::React)];
  StageTimer timer(profile, context.timed);
  context.executor.for_blocks(frame.pressed.size(), kBodyBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t i = frame.pressed[k];
      for (collision::PartLoads* loads : {&frame.loads[i], &frame.dissipative[i]}) {
        loads->force.assign(frame.bodies[i].pose.size(), Vec3::Zero());
        loads->torque.assign(frame.bodies[i].pose.size(), Vec3::Zero());
      }
    }
  });
  collision::ReactionSettings settings = model.reaction;
  settings.step = context.step;
  frame.reaction = collision::react(frame.bodies, context.rules, frame.surface, settings, context.executor,
                                    frame.loads, &frame.traction_force, frame.dissipative, &frame.pair_power, context.sticks);
  const bool dissipates = frame.reaction.dissipated_power != 0.0 || model.reaction.stick.stiffness > 0.0;
  if (dissipates) out.dissipative.reset(model.particles.size());
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
  profile.visited += frame.surface.point.size();
  profile.present += frame.surface.point.size();
}

void linearise_reactions(const StageContext& context, Frame& frame, core::ContactPoints& out) {
  frame.reaction = {};
  frame.traction_force.clear();
  frame.pair_power.clear();
  out.clear();
  if (frame.surface.summary.empty()) return;
  StageProfile& profile = context.profile[static_cast<std::size_t>(Stage::React)];
  StageTimer timer(profile, context.timed);
  std::vector<std::span<const std::uint32_t>> particles(frame.bodies.size());
  for (std::size_t i = 0; i < context.bodies.size(); ++i) particles[i] = context.bodies[i].particle;
  collision::linearise_contacts(frame.bodies, context.rules, frame.surface, context.model.reaction.split, particles, frame.linearise, out);
  profile.visited += frame.surface.point.size();
  profile.present += frame.surface.point.size();
}

}  // namespace supple::scenes
