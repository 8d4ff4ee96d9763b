#include "simulation/frame.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "simulation/contact_bodies.h"
#include "supple/collision/deformed_field.h"
#include "supple/core/cpu_time.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

Box box_of(const implicit::PlacedSkeleton& placed) {
  Box box;
  for (const Box& support : placed.support) box = box.united(support);
  return box;
}

void place(const StageContext& context, const core::ParticleState& particles, std::size_t i, Frame& frame) {
  const Body& body = context.bodies[i];
  core::gather_poses(particles, body.particle, frame.pose[i]);
  implicit::place_skeleton(body.skeleton, frame.pose[i], frame.placed[i]);
  frame.reach[i] = box_of(frame.placed[i]);
  frame.indexed[i] = 0;
}

/// A moving solid at its position, and its field.
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

/// Fixed bodies, after the others: all of them when `first_time`, then the moving ones.
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
      rigid_samples(all.size()),
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
  if (timed > 1) cpu_s += later_s * static_cast<double>(calls - apart - 1) / static_cast<double>(timed - 1);
  cpu_s = std::max(cpu_s, 0.0);  // for very short times, without the duration of the clock reading
}

void StageProfile::book(double seconds, bool stands_for_itself) {
  if (stands_for_itself) {
    ++apart;
    apart_s += seconds;
  } else {
    (timed++ == 0 ? first_s : later_s) += seconds;
  }
}

StageTimer::StageTimer(StageProfile& profile, StepTiming timing)
    : profile_(profile), timing_(timing == StepTiming::None && profile.calls == 0 ? StepTiming::Sample : timing) {
  ++profile.calls;
  if (timing_ != StepTiming::None) begin_ = process_cpu_seconds();
}

StageTimer::~StageTimer() {
  if (timing_ != StepTiming::None) profile_.book(process_cpu_seconds() - begin_ - process_cpu_clock_cost(), timing_ == StepTiming::Apart);
  profile_.scale();
}

std::uint32_t body_led_by(const std::vector<Body>& bodies, std::uint32_t particle) {
  const auto before = [](const Body& body, std::uint32_t p) { return !body.origin.is_group() && body.particle.front() < p; };
  return static_cast<std::uint32_t>(std::lower_bound(bodies.begin(), bodies.end(), particle, before) - bodies.begin());
}

bool rests(const StageContext& context, std::size_t body) {
  return context.awake != nullptr && !std::binary_search(context.awake->begin(), context.awake->end(), static_cast<std::uint32_t>(body));
}

void index_body(const StageContext& context, std::size_t i, Frame& frame) {
  if (frame.indexed[i]) return;
  implicit::index_field(context.bodies[i].skeleton, frame.placed[i], frame.field[i]);
  frame.indexed[i] = 1;
}

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

void place_and_index(const StageContext& context, const core::ParticleState& particles, std::size_t body, Frame& frame) {
  place(context, particles, body, frame);
  index_body(context, body, frame);
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

}  // namespace supple::scenes
