#include "simulation/fixed_step.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "file/read_scene_faults.h"
#include "simulation/overload.h"
#include "simulation/stages.h"
#include "supple/core/integrate.h"
#include "supple/scenes/solid_motion.h"

namespace supple::scenes {
namespace {

constexpr double kWorthALook = 1.0;  // iso radius of the thinner body: shorter motions of a pair are not checked
constexpr double kLookEvery = 0.5;   // of the same
constexpr double kSurely = 1.25;     // energies whose ratio is less may be the same
constexpr double kErrorOfEnergies = 1e-2;  // far below that

using Summary = collision::ContactSurface::Summary;

const Summary* find_pair(const std::vector<Summary>& all, const collision::BodyPair& bodies) {
  const auto at = std::lower_bound(all.begin(), all.end(), bodies, [](const Summary& s, const collision::BodyPair& b) { return s.bodies < b; });
  return at != all.end() && at->bodies == bodies ? &*at : nullptr;
}

double energy_of(const std::vector<Summary>& all, const collision::BodyPair& bodies) {
  const Summary* s = find_pair(all, bodies);
  return s != nullptr ? s->energy : 0.0;
}

/// Where particles are when a share of the step is over, by uniform motion.
core::ParticleState on_the_way(const TakenStep& step, double share) {
  core::ParticleState now = step.after;
  for (std::size_t i = 0; i < now.size(); ++i) {
    now.position[i] = step.before.position[i] + share * (step.after.position[i] - step.before.position[i]);
    const Quat& from = step.before.orientation[i];
    if (from.coeffs() == step.after.orientation[i].coeffs()) continue;
    now.orientation[i] = core::rotation_exp(share * core::rotation_log(step.after.orientation[i] * from.conjugate())) * from;
  }
  return now;
}

/// Motion of one body in a step.
struct Way {
  Box begin, end;               // of its supports
  Vec3 drift = Vec3::Zero();    // of its middle [m]
  double spread = 0.0;          // how much farther any of its points may go [m]

  [[nodiscard]] Box at(double share) const {
    const auto between = [share](const Vec3& a, const Vec3& b) {
      return Vec3((a.array() == b.array()).select(a, a + share * (b - a)));  // also of boxes without end
    };
    return Box{between(begin.lower, end.lower), between(begin.upper, end.upper)}.inflated(spread);
  }
  [[nodiscard]] Box swept() const { return begin.united(end).inflated(spread); }
};

Vec3 moved(const TakenStep& step, std::uint32_t particle) { return step.after.position[particle] - step.before.position[particle]; }

/// Largest displacement of points within a box by a particle's rotation [m].
double swung(const TakenStep& step, std::uint32_t particle, const Box& carried) {
  const Vec3& centre = step.after.position[particle];
  const double arm = (carried.upper - centre).cwiseAbs().cwiseMax((carried.lower - centre).cwiseAbs()).norm();
  return 2.0 * (step.after.orientation[particle] * step.before.orientation[particle].conjugate()).vec().norm() * arm;
}

/// Whether two bodies may have moved relative to each other by more than the unchecked distance. @param frame  after the step
bool any_moved_far(const StageContext& context, const TakenStep& step, const Frame& frame) {
  double length = std::numeric_limits<double>::infinity();
  for (const ObjectModel& object : context.model.objects) {
    if (object.collides) length = std::min(length, object.iso_radius);
  }
  const double far = 0.5 * kWorthALook * length;
  if (context.model.solid_speed * step.size > far) return true;
  for (std::size_t i = 0; i < context.bodies.size(); ++i) {
    const Body& body = context.bodies[i];
    if (!context.model.objects[body.object].collides || body.skeleton.primitive.empty()) continue;
    const auto goes_far = [&](std::uint32_t p) { return moved(step, p).norm() + swung(step, p, frame.reach[i]) > far; };
    if (std::any_of(body.particle.begin(), body.particle.end(), goes_far)) return true;
  }
  return false;
}

/// Drift and spread of a body. @param support  of its primitives after the step
void measure_way(const Body& body, const TakenStep& step, std::span<const Box> support, Way& way) {
  for (const std::uint32_t i : body.particle) way.drift += moved(step, i) / static_cast<double>(body.particle.size());
  for (std::size_t k = 0; k < support.size(); ++k) {
    const std::uint32_t i = body.particle[body.skeleton.primitive[k].part];
    way.spread = std::max(way.spread, (moved(step, i) - way.drift).norm() + swung(step, i, support[k]));
  }
}

/// Whether a fixed body moves within a step.
bool led_within(const StageContext& context, const TakenStep& step, std::size_t fixed) {
  return moves(context.model.fixed[fixed].motion, step.end - step.size, step.end);
}

/// Of all contact bodies.
std::vector<Way> ways_of(const StageContext& context, const TakenStep& step, Frame& frame) {
  StageContext then = context;
  then.time = step.end - step.size;
  place_contact_bodies(then, step.before, frame);
  std::vector<Way> ways(frame.reach.size());
  for (std::size_t i = 0; i < ways.size(); ++i) ways[i].begin = frame.reach[i];
  then.time = step.end;
  place_contact_bodies(then, step.after, frame);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    Way& way = ways[i];
    way.end = frame.reach[i];
    if (i < context.bodies.size()) {
      if (!way.end.empty()) measure_way(context.bodies[i], step, frame.placed[i].support, way);
    } else if (led_within(context, step, i - context.bodies.size())) {
      way.spread = context.model.solid_speed * step.size;
    }
  }
  return ways;
}

/// A pair with a large relative motion, and the times at which its boxes overlap.
struct FastPair {
  collision::BodyPair bodies;
  std::vector<double> looks;  // shares of the step, ascending
};

/// Looks fall on multiples of a power of two, so that pairs share them.
std::vector<double> looks_at(const Way& a, const Way& b, double length) {
  const double moved = (a.drift - b.drift).norm() + a.spread + b.spread;
  std::vector<double> looks;
  if (!(moved > kWorthALook * length)) return looks;
  const double count = std::ldexp(1.0, core::halvings(moved, kLookEvery * length));
  // Boxes overlap in one interval: along every axis both differences of their ends are linear.
  double first = 0.0, last = 1.0;
  const Box a0 = a.at(0.0), a1 = a.at(1.0), b0 = b.at(0.0), b1 = b.at(1.0);
  const auto clip = [&](double begin, double end) {  // to where it is >= 0
    if (begin < 0.0 && end < 0.0) last = -1.0;
    if ((begin < 0.0) == (end < 0.0)) return;
    const double root = begin / (begin - end);
    if (begin < 0.0) first = std::max(first, root);
    if (end < 0.0) last = std::min(last, root);
  };
  for (Eigen::Index k = 0; k < 3; ++k) {
    clip(b0.upper[k] - a0.lower[k], b1.upper[k] - a1.lower[k]);
    clip(a0.upper[k] - b0.lower[k], a1.upper[k] - b1.lower[k]);
  }
  for (double j = std::max(1.0, std::ceil(first * count)); j < count && j <= last * count; j += 1.0) looks.push_back(j / count);
  return looks;
}

std::vector<FastPair> fast_pairs(const StageContext& context, const TakenStep& step, Frame& frame) {
  const std::vector<Way> ways = ways_of(context, step, frame);
  std::vector<Box> swept;
  for (const Way& way : ways) swept.push_back(way.end.empty() ? Box{} : way.swept());
  const std::size_t moving = context.bodies.size();
  const auto length_of = [&](std::uint32_t i) {
    return i < moving ? context.model.objects[context.bodies[i].object].iso_radius : std::numeric_limits<double>::infinity();
  };
  std::vector<FastPair> fast;
  for (const collision::BodyPair& pair : collision::overlapping_boxes(swept, context.executor)) {
    if ((pair.a >= moving && pair.b >= moving) || !context.rules.allowed(pair.a, pair.b)) continue;
    FastPair found{pair, looks_at(ways[pair.a], ways[pair.b], std::min(length_of(pair.a), length_of(pair.b)))};
    if (!found.looks.empty()) fast.push_back(std::move(found));
  }
  return fast;
}

/// Kinetic energy of the relative motion of two bodies [J]; infinite where one is moved by keys.
double energy_of_motion(const StageContext& context, const TakenStep& step, const collision::BodyPair& pair) {
  const core::ParticleSet& set = context.model.particles;
  double mass = 0.0;
  Vec3 together = Vec3::Zero();  // momentum, then velocity of their centre
  for (const std::uint32_t body : {pair.a, pair.b}) {
    mass += mass_of(context, body);
    if (body >= context.bodies.size()) {
      if (led_within(context, step, body - context.bodies.size())) return std::numeric_limits<double>::infinity();
      continue;
    }
    for (const std::uint32_t i : context.bodies[body].particle) together += set.mass[i] / step.size * moved(step, i);
  }
  together = std::isfinite(mass) ? Vec3(together / mass) : Vec3::Zero();
  double energy = 0.0;
  for (const std::uint32_t body : {pair.a, pair.b}) {
    if (body >= context.bodies.size()) continue;
    for (const std::uint32_t i : context.bodies[body].particle) {
      const Quat& turn = step.before.orientation[i];
      const Vec3 spin = turn.conjugate() * core::rotation_log(step.after.orientation[i] * turn.conjugate()) / step.size;
      energy += 0.5 * (set.mass[i] * (moved(step, i) / step.size - together).squaredNorm() + set.inertia[i].dot(spin.cwiseAbs2()));
    }
  }
  return energy;
}

}  // namespace

std::optional<TooCoarse> find_missed_contact(const StageContext& context, const TakenStep& step,
                                             const std::vector<implicit::SampleState>& samples, const Frame& seen,
                                             const EndContacts* ends, Frame& trial) {
  if (!any_moved_far(context, step, seen)) return std::nullopt;
  const std::vector<FastPair> fast = fast_pairs(context, step, trial);
  if (fast.empty()) return std::nullopt;
  StageContext now = context;
  now.contact_error = kErrorOfEnergies;
  const auto look = [&](double share) {
    now.time = step.end - (1.0 - share) * step.size;
    std::vector<implicit::SampleState> kept = samples;
    find_contact_surface(now, on_the_way(step, share), kept, trial, true);
  };
  const auto contacts_at = [&](double end) -> const std::vector<Summary>& {
    if (ends != nullptr) return end == 0.0 ? ends->before : ends->after;
    look(end);
    return trial.surface.summary;
  };
  std::vector<double> at_ends(fast.size());
  const std::vector<Summary>& before = contacts_at(0.0);
  for (std::size_t k = 0; k < fast.size(); ++k) at_ends[k] = energy_of(before, fast[k].bodies);
  const std::vector<Summary>& after = contacts_at(1.0);
  for (std::size_t k = 0; k < fast.size(); ++k) {
    const double energy = energy_of(after, fast[k].bodies), motion = energy_of_motion(context, step, fast[k].bodies);
    if (energy - at_ends[k] > kSurely * motion) {
      return TooCoarse{fast[k].bodies, " overlap more within one step than their motion allows: their contact gains " +
                                           short_text(energy - at_ends[k]) + " J, their kinetic energy is " + short_text(motion) + " J"};
    }
    at_ends[k] = std::max(at_ends[k], energy);
  }
  std::set<double> looks;
  for (const FastPair& pair : fast) looks.insert(pair.looks.begin(), pair.looks.end());
  for (const double share : looks) {
    look(share);
    for (std::size_t k = 0; k < fast.size(); ++k) {
      const double energy = energy_of(trial.surface.summary, fast[k].bodies);
      if (!(energy > kSurely * at_ends[k]) || !std::binary_search(fast[k].looks.begin(), fast[k].looks.end(), share)) continue;
      return TooCoarse{fast[k].bodies, " pass each other within one step: their contact holds " + short_text(energy) +
                                           " J on the way and at most " + short_text(at_ends[k]) + " J at its ends"};
    }
  }
  return std::nullopt;
}

std::optional<TooCoarse> find_unstable_contact(const StageContext& context, const TakenStep& step,
                                               const std::vector<implicit::SampleState>& samples, const Frame& seen, double limit,
                                               Frame& trial) {
  std::vector<collision::PartMobility> mobility;
  find_mobility(context, step.after, seen, mobility);
  // Energy [J] that the push of half a step gives to a pair beyond its contact energy `energy` and its kinetic energy.
  const auto gain = [&](const Summary& s, double energy) {
    const double inverse_mass = collision::approach_inverse_mass(seen.bodies, mobility, s);
    if (!(inverse_mass > 0.0)) return 0.0;
    const double push = step.size * s.force.norm() * inverse_mass / std::sqrt(limit);  // [m/s]
    const double speed = std::max(collision::measure_approach(seen.bodies, s).speed, 0.0);
    const double damping = collision::material_of(seen.bodies, context.rules, s.bodies).dissipation;
    const double turned = speed - push * (1.0 + damping * speed);
    const double most = std::max(push * push, turned * turned - speed * speed);
    return 0.5 * most / inverse_mass - energy;
  };
  // Contacts with lens-shaped and paraboloidal pressure have a sixth of this; a twelfth is on the safe side.
  const auto least_energy = [](const Summary& s) { return s.largest_pressure * s.area * s.largest_overlap / 12.0; };
  const auto& all = seen.surface.summary;
  const auto suspicious = [&](const Summary& s) { return s.force.norm() > 0.0 && gain(s, least_energy(s)) > 0.0; };
  if (std::none_of(all.begin(), all.end(), suspicious)) return std::nullopt;
  std::vector<implicit::SampleState> kept = samples;
  find_contact_surface(context, step.after, kept, trial, true);
  for (const Summary& s : all) {
    if (!suspicious(s)) continue;
    const double energy = energy_of(trial.surface.summary, s.bodies);
    if (!(gain(s, energy) > 0.0)) continue;
    return TooCoarse{s.bodies, " are pushed apart too hard within one step: half of it gives them " + short_text(gain(s, 0.0)) +
                                   " J, their contact holds " + short_text(energy) + " J"};
  }
  return std::nullopt;
}

}  // namespace supple::scenes
