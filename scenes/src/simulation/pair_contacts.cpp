#include "simulation/pair_contacts.h"

#include <algorithm>
#include <tuple>

#include "supple/core/particles.h"

namespace supple::scenes {
namespace {

using PairContact = RunRecord::PairContact;

/// Contact of two objects at the end of a step.
struct PairNow {
  collision::BodyPair objects;
  Vec3 force = Vec3::Zero();  ///< on A [N]
  double depth = 0.0;         ///< [m]
};

std::uint32_t object_of(const StageContext& context, std::uint32_t body) {
  const auto moving = static_cast<std::uint32_t>(context.bodies.size());
  return body < moving ? context.bodies[body].object : static_cast<std::uint32_t>(context.model.objects.size()) + body - moving;
}

/// By objects, ascending; pairs of one object and those without load are left out.
std::vector<PairNow> pairs_now(const StageContext& context, const Frame& frame, std::span<const double> depths) {
  std::vector<PairNow> all;
  const std::size_t count = std::min(frame.surface.summary.size(), frame.traction_force.size());
  for (std::size_t k = 0; k < count; ++k) {
    const auto& s = frame.surface.summary[k];
    PairNow one{.objects = {object_of(context, s.bodies.a), object_of(context, s.bodies.b)}, .force = frame.traction_force[k], .depth = k < depths.size() ? depths[k] : s.largest_overlap};
    if (one.objects.a == one.objects.b || !(one.force.squaredNorm() > 0.0)) continue;
    if (one.objects.b < one.objects.a) {
      std::swap(one.objects.a, one.objects.b);
      one.force = -one.force;
    }
    all.push_back(one);
  }
  std::stable_sort(all.begin(), all.end(), [](const PairNow& x, const PairNow& y) { return x.objects < y.objects; });
  std::size_t kept = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (kept > 0 && all[kept - 1].objects == all[k].objects) {
      all[kept - 1].force += all[k].force;
      all[kept - 1].depth = std::max(all[kept - 1].depth, all[k].depth);
    } else {
      all[kept++] = all[k];
    }
  }
  all.resize(kept);
  return all;
}

/// Motion of an object as a whole.
struct WholeMotion {
  Vec3 velocity = Vec3::Zero();  ///< of its centre of mass, or of an obstacle [m/s]
  double inverse_mass = 0.0;     ///< [1/kg]; 0 of obstacles and objects with pinned particles
};

WholeMotion motion_of_whole(const StageContext& context, const Frame& frame, const core::ParticleState& particles, std::uint32_t number) {
  const Model& model = context.model;
  if (number >= model.objects.size()) {
    const std::size_t fixed = number - model.objects.size();
    return {.velocity = fixed < frame.led.size() ? frame.led[fixed].velocity : Vec3(Vec3::Zero())};
  }
  WholeMotion motion;
  double mass = 0.0;
  bool pinned = false;
  for (std::uint32_t p = model.objects[number].first; p < model.objects[number].last; ++p) {
    motion.velocity += model.particles.mass[p] * particles.velocity[p];
    mass += model.particles.mass[p];
    pinned = pinned || (model.particles.pinned[p] & core::kPinPosition) != 0;
  }
  motion.velocity /= mass;
  motion.inverse_mass = pinned ? 0.0 : 1.0 / mass;
  return motion;
}

struct Booking {
  const StageContext& context;
  const Frame& frame;
  const BookedStep& step;
  const core::ParticleState& particles;

  [[nodiscard]] std::pair<WholeMotion, WholeMotion> motions(const PairContact& pair) const {
    return {motion_of_whole(context, frame, particles, pair.objects.a), motion_of_whole(context, frame, particles, pair.objects.b)};
  }
};

/// The force of a step in contact. @return its impulse
Vec3 add_force(const BookedStep& step, const PairNow& now, PairContact& pair) {
  const Vec3 impulse = step.size * (step.mean_forces ? now.force : Vec3(0.5 * (pair.force + now.force)));
  pair.impulse += impulse;
  pair.touch_impulse += impulse;
  pair.force = now.force;
  const double size = now.force.norm();
  if (size > pair.peak_force) {
    pair.peak_force = size;
    pair.peak_time = step.end;
  }
  pair.largest_depth = std::max(pair.largest_depth, now.depth);
  return impulse;
}

void begin_touch(const Booking& booking, const PairNow& now, PairContact& pair) {
  const BookedStep& step = booking.step;
  ++pair.touches;
  pair.touching = pair.begun = true;
  pair.touch_begin = step.end - 0.5 * step.size;
  pair.contact_time += 0.5 * step.size;
  pair.touch_impulse = Vec3::Zero();
  pair.depth = 0.0;
  pair.force = Vec3::Zero();
  const Vec3 impulse = add_force(step, now, pair);
  const auto [a, b] = booking.motions(pair);
  pair.touch_velocity = a.velocity - b.velocity - (a.inverse_mass + b.inverse_mass) * impulse;
  if (pair.touches == 1) pair.first_begin = pair.touch_begin;
}

/// A second depth tells when the contact began.
void date_begin(const BookedStep& step, double depth, PairContact& pair) {
  const double grown = depth - pair.depth;
  if (!(grown > 0.0)) return;
  const double back = std::min(pair.last_step, pair.depth * step.size / grown), assumed = 0.5 * pair.last_step;
  pair.touch_begin -= back - assumed;
  pair.contact_time += back - assumed;
  if (pair.touches == 1) pair.first_begin = pair.touch_begin;
}

void go_on(const BookedStep& step, const PairNow& now, PairContact& pair) {
  if (pair.begun) date_begin(step, now.depth, pair);
  pair.begun = false;
  pair.contact_time += step.size;
  (void)add_force(step, now, pair);
}

void end_touch(const Booking& booking, PairContact& pair) {
  const BookedStep& step = booking.step;
  const double fell = pair.depth_before - pair.depth;
  const double forward = !pair.begun && fell > 0.0 ? std::min(step.size, pair.depth * pair.last_step / fell) : 0.5 * step.size;
  if (!step.mean_forces) {
    pair.impulse += 0.5 * step.size * pair.force;
    pair.touch_impulse += 0.5 * step.size * pair.force;
  }
  pair.contact_time += forward;
  pair.touching = pair.begun = false;
  pair.force = Vec3::Zero();
  pair.depth = pair.depth_before = 0.0;
  if (pair.touches != 1) return;
  pair.first_end = step.end - step.size + forward;
  const auto [a, b] = booking.motions(pair);
  const double size = pair.touch_impulse.norm();
  if (!(size > 0.0)) return;
  const Vec3 along = pair.touch_impulse / size;
  pair.approach_speed = -pair.touch_velocity.dot(along);
  pair.rebound_speed = (a.velocity - b.velocity).dot(along);
}

/// Whether nothing of a pair can have changed: all of its bodies sleep.
bool sleeps(const StageContext& context, const State& state, const collision::BodyPair& objects) {
  if (context.awake == nullptr) return false;
  return std::none_of(context.awake->begin(), context.awake->end(),
                      [&](std::uint32_t body) { return context.bodies[body].object == objects.a || context.bodies[body].object == objects.b; }) &&
         state.sleep.any_asleep();
}

void book(const Booking& booking, const PairNow& now, PairContact& pair) {
  const double before = pair.depth;
  pair.touching ? go_on(booking.step, now, pair) : begin_touch(booking, now, pair);
  pair.depth_before = pair.touching && !pair.begun ? before : 0.0;
  pair.depth = now.depth;
  pair.last_step = booking.step.size;
}

}  // namespace

void EndDepths::predict(const core::ParticleState& pose, const core::ContactPoints& points) {
  peaks_.assign(points.pair.size(), {});
  for (std::size_t k = 0; k < points.pair.size(); ++k) {
    const core::ContactPoints::Pair& pair = points.pair[k];
    if (pair.begin == pair.end) continue;
    const auto first = points.pressure.begin() + pair.begin, last = points.pressure.begin() + pair.end;
    const auto q = static_cast<std::size_t>(std::max_element(first, last) - points.pressure.begin());
    peaks_[k].normal = points.normal[q];
    for (std::uint32_t e = points.offset[q]; e < points.offset[q + 1]; ++e) {
      const std::uint32_t p = points.particle[e];
      peaks_[k].movers.push_back({p, points.share[e], pose.position[p]});
    }
  }
}

std::vector<double> EndDepths::at_end(const core::ParticleState& particles, std::span<const collision::ContactSurface::Summary> pairs) const {
  std::vector<double> depths;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    Vec3 approach = Vec3::Zero();
    if (k < peaks_.size()) {
      for (const Mover& m : peaks_[k].movers) approach += m.share * (particles.position[m.particle] - m.predicted);
      depths.push_back(std::max(0.0, pairs[k].largest_overlap + approach.dot(peaks_[k].normal)));
    } else {
      depths.push_back(pairs[k].largest_overlap);
    }
  }
  return depths;
}

void book_pair_contacts(const StageContext& context, const Frame& frame, const BookedStep& step, State& state) {
  std::vector<PairContact>& all = state.record.pair_contacts;
  const std::vector<PairNow> now = pairs_now(context, frame, step.depths);
  if (now.empty() && all.empty()) return;
  const Booking booking{context, frame, step, state.particles};
  const std::size_t known = all.size();
  const auto without = [&](PairContact& pair) {
    if (!pair.touching) return;
    if (!sleeps(context, state, pair.objects)) return end_touch(booking, pair);
    const PairNow same{pair.objects, pair.force, pair.depth};
    book(booking, same, pair);
  };
  std::size_t at = 0;
  for (const PairNow& one : now) {
    for (; at < known && all[at].objects < one.objects; ++at) without(all[at]);
    if (at < known && all[at].objects == one.objects) {
      book(booking, one, all[at++]);
    } else {
      PairContact fresh;
      fresh.objects = one.objects;
      book(booking, one, all.emplace_back(fresh));
    }
  }
  for (; at < known; ++at) without(all[at]);
  std::inplace_merge(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(known), all.end(), [](const PairContact& x, const PairContact& y) { return x.objects < y.objects; });
}

const std::string& pair_member_name(const Model& model, std::uint32_t number) {
  return number < model.objects.size() ? model.objects[number].name : model.fixed[number - model.objects.size()].name;
}

}  // namespace supple::scenes
