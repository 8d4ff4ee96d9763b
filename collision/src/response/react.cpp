#include "supple/collision/react.h"

#include <algorithm>
#include <cmath>

#include "response/energy_loads.h"
#include "supple/core/error.h"
#include "surface/kept_results.h"

namespace supple::collision {
namespace {

/// Sigma of a pair, and the elastic load on it.
struct PairLoads {
  std::span<const Vec3> x, normal;
  std::span<const double> area, pressure;
  std::span<const double> load;                         ///< p dA [N]
  Vec3 centre = Vec3::Zero();                           ///< of pressure
  Vec3 push = Vec3::Zero(), twist = Vec3::Zero();       ///< integrals of p N dA and of (x - centre) x p N dA
};

/// On one part: force, and torque about the part's centre.
struct PartLoad {
  Vec3 force, torque;
};

/// One body of a pair while its reaction is put together; buffers are reused.
class Side {
 public:
  /// @param side  0: A, 1: B
  void begin(const ContactBody& body, int side, std::span<const Vec3> points) {
    body_ = &body;
    sign_ = side == 0 ? -1.0 : 1.0;  // of the pressure along N, as a force on this body
    const std::size_t parts = body.pose.size();
    force_.assign(parts, Vec3::Zero());
    torque_.assign(parts, Vec3::Zero());
    share_.assign(parts, 0.0);
    if (parts > 1) return contributions_at(body, points, rows_);
    drift_ = body.velocity.empty() ? Vec3::Zero().eval() : body.velocity[0];
    spin_ = body.velocity.empty() || body.angular_velocity.empty() ? Vec3::Zero().eval() : body.angular_velocity[0];
    drift_ -= spin_.cross(body.pose[0].position);
  }
  [[nodiscard]] bool single() const { return body_->pose.size() == 1; }
  /// Of the only part: its velocity as it would be at the world origin, and its spin.
  [[nodiscard]] const Vec3& drift() const { return drift_; }
  [[nodiscard]] const Vec3& spin() const { return spin_; }

  /// Contribution-weighted velocity sum lambda_k (v_k + omega_k x (x - x_k)).
  [[nodiscard]] Vec3 velocity(std::size_t i, const Vec3& x) const {
    if (single()) return drift_ + spin_.cross(x);
    if (body_->velocity.empty()) return Vec3::Zero();
    Vec3 sum = Vec3::Zero();
    for_parts(i, [&](std::size_t k, double lambda) { sum += lambda * velocity_of(*body_, k, x); });
    return sum;
  }

  /// A force and its moment about `centre`, to the only part.
  void add_whole(const Vec3& f, const Vec3& moment, const Vec3& centre) {
    force_[0] += f;
    torque_[0] += moment + (centre - body_->pose[0].position).cross(f);
  }

  /// A force at x and a couple, to one part.
  void add_to_part(std::size_t k, const Vec3& x, const Vec3& f, const Vec3& couple) {
    force_[k] += f;
    torque_[k] += (x - body_->pose[k].position).cross(f) + couple;
  }

  void add_by_contribution(std::size_t i, const Vec3& x, const Vec3& f) {
    for_parts(i, [&](std::size_t k, double lambda) {
      force_[k] += lambda * f;
      torque_[k] += lambda * (x - body_->pose[k].position).cross(f);
    });
  }

  /// Elastic force, on A -integral p N dA: the gradient of the contact energy, corrected to the force and moment of Sigma by
  /// the mean contributions, weighted with p dA.
  void add_by_energy(const Squeezed& volume, const PairLoads& on) {
    const Vec3 centre = on.centre, total = sign() * on.push, moment = sign() * on.twist;
    if (single()) return add_whole(total, moment, centre);
    const std::size_t parts = body_->pose.size();
    elastic_force_.assign(parts, Vec3::Zero());
    elastic_torque_.assign(parts, Vec3::Zero());
    if (!share_out(on.load)) return;

    add_energy_loads(*body_, volume, sign() < 0.0 ? 0 : 1, energy_, elastic_force_, elastic_torque_);
    Vec3 force_left = total, moment_left = moment;
    for (std::size_t k = 0; k < parts; ++k) {
      force_left -= elastic_force_[k];
      moment_left -= (body_->pose[k].position - centre).cross(elastic_force_[k]) + elastic_torque_[k];
    }
    for (std::size_t k = 0; k < parts; ++k) {
      const Vec3 f = share_[k] * force_left;
      force_[k] += elastic_force_[k] + f;
      torque_[k] += elastic_torque_[k] + (centre - body_->pose[k].position).cross(f) + share_[k] * moment_left;
    }
  }

  /// Inverse mass that a force at `centre` meets [1/kg], at most over its directions. @param load  p dA of the points
  [[nodiscard]] double yield(std::span<const double> load, const Vec3& centre) {
    if (body_->yield.empty()) return 0.0;
    const auto of_part = [&](std::size_t k) {
      return body_->yield[k].inverse_mass + (centre - body_->pose[k].position).squaredNorm() * body_->yield[k].inverse_inertia;
    };
    if (single()) return of_part(0);
    double sum = 0.0;
    if (!share_out(load)) return sum;
    for (std::size_t k = 0; k < share_.size(); ++k)
      if (share_[k] > 0.0) sum += share_[k] * share_[k] * of_part(k);
    return sum;
  }

  [[nodiscard]] double sign() const noexcept { return sign_; }

  /// Hands over what was gathered and starts again from zero.
  void move_to(std::span<PartLoad> loads) {
    for (std::size_t k = 0; k < loads.size(); ++k) loads[k] = {force_[k], torque_[k]};
    std::fill(force_.begin(), force_.end(), Vec3::Zero());
    std::fill(torque_.begin(), torque_.end(), Vec3::Zero());
  }

 private:
  /// The parts' mean contributions. @return whether any load is there to share
  bool share_out(std::span<const double> load) {
    std::fill(share_.begin(), share_.end(), 0.0);
    double all = 0.0;
    for (std::size_t i = 0; i < load.size(); ++i) {
      for_parts(i, [&](std::size_t k, double lambda) { share_[k] += lambda * load[i]; });
      all += load[i];
    }
    if (!(all > 0.0)) return false;
    for (double& s : share_) s /= all;
    return true;
  }

  template <class Use>
  void for_parts(std::size_t i, const Use& use) const {
    for (std::uint32_t e = rows_.offset[i]; e < rows_.offset[i + 1]; ++e) use(rows_.part[e], rows_.value[e]);
  }

  const ContactBody* body_ = nullptr;
  double sign_ = 0.0;
  Vec3 drift_ = Vec3::Zero();
  Vec3 spin_ = Vec3::Zero();
  implicit::FieldParts rows_;
  EnergyScratch energy_;
  std::vector<Vec3> force_, torque_, elastic_force_, elastic_torque_;
  std::vector<double> share_;  // mean contribution of each part over Sigma, weighted with p dA
};

/// What a spring does to A; B gets the opposite at the same point.
struct SpringLoad {
  Vec3 point, force, couple;
  double power = 0.0;  ///< that it takes from the motion [W]
};

SpringLoad hold_by_spring(const StickSpring& spring, const ContactBody& a, const ContactBody& b, const StickRule& rule,
                          double friction, const PairLoads& on) {
  const double most = friction * on.push.norm();
  if (!(most > 0.0)) return {on.centre, Vec3::Zero(), Vec3::Zero()};
  const Vec3 normal = on.push.normalized();
  const StickTrial trial = stretch(spring, a, b, normal);
  Vec3 slide = velocity_of(a, spring.part[0], trial.point) - velocity_of(b, spring.part[1], trial.point);
  slide -= slide.dot(normal) * normal;
  Vec3 force = -rule.stiffness * (trial.displacement + rule.damping * slide);
  const double size = force.norm();
  if (size > most) force *= most / size;

  const auto spin_of = [](const ContactBody& body, std::size_t part) {
    return body.angular_velocity.empty() ? Vec3::Zero().eval() : body.angular_velocity[part];
  };
  const double spin = (spin_of(a, spring.part[0]) - spin_of(b, spring.part[1])).dot(normal);
  const double arm = spring.arm;
  const double most_couple = most * arms_of(on.x, on.area, on.pressure, on.centre, normal).mean;
  const double couple =
      std::clamp(-rule.stiffness * arm * (trial.twist + rule.damping * arm * spin), -most_couple, most_couple);
  return {trial.point, force, couple * normal, -force.dot(slide) - couple * spin};
}

}  // namespace

double friction_mollifier(double speed, double regularisation) noexcept {
  if (speed >= regularisation) return 1.0;
  const double y = speed / regularisation;
  return y * (2.0 - y);
}

namespace {

/// What one pair does.
struct PairReaction {
  std::span<PartLoad> elastic[2], dissipative[2];  ///< on the parts of A, of B
  Vec3 traction = Vec3::Zero();  ///< all of it, as a force on A
  double power = 0.0;            ///< that damping, friction and springs take [W]
  double friction_speed = 0.0;   ///< below which friction falls to zero [m/s]; 0: no such friction
  bool touches = false;          ///< false: no points, and nothing else here counts
};

/// Contacts of every body that press, among which what stops it is divided; empty: nobody asks.
using ContactCount = std::vector<std::uint32_t>;

/// Speed below which friction fades out. Slower bodies lose at most kTaken times their slip within a step: 1 stops them, at 2
/// they would go on to and fro.
double regularisation_of(const ReactionSettings& settings, const ContactCount& contacts, const BodyPair& pair, double friction,
                         const PairLoads& on, Side (&sides)[2]) {
  if (contacts.empty()) return settings.friction_speed;
  double total = 0.0;
  for (const double l : on.load) total += l;
  const double yield = contacts[pair.a] * sides[0].yield(on.load, on.centre) + contacts[pair.b] * sides[1].yield(on.load, on.centre);
  constexpr double kTaken = 1.6, kMollifierSlope = 2.0;
  return std::max(settings.friction_speed, kMollifierSlope / kTaken * friction * total * settings.step * yield);
}

/// Relative velocity of two bodies where one point of both is; bodies of one part move alike everywhere.
class Slip {
 public:
  explicit Slip(const Side (&sides)[2]) : sides_(sides), rigid_(sides[0].single() && sides[1].single()) {
    if (!rigid_) return;
    drift_ = sides[0].drift() - sides[1].drift();
    spin_ = sides[0].spin() - sides[1].spin();
  }
  [[nodiscard]] Vec3 at(std::size_t i, const Vec3& x) const {
    if (rigid_) return drift_ + spin_.cross(x);
    return sides_[0].velocity(i, x) - sides_[1].velocity(i, x);
  }

 private:
  const Side (&sides_)[2];
  bool rigid_;
  Vec3 drift_ = Vec3::Zero(), spin_ = Vec3::Zero();
};

/// A pair of the surface, with its points and its columns of the squeezed regions there.
struct PairOfSurface {
  std::uint32_t pair = 0;
  Range points, volume;
};

/// The elastic loads of Sigma: both bodies take them from the same sums, so that they cancel exactly.
PairLoads loads_of(const ContactSurface& surface, const PairOfSurface& which, std::vector<double>& load) {
  const auto& [begin, end] = which.points;
  const std::size_t n = end - begin;
  load.resize(n);
  PairLoads on{.x = std::span(surface.point).subspan(begin, n),
               .normal = std::span(surface.normal).subspan(begin, n),
               .area = std::span(surface.area).subspan(begin, n),
               .pressure = std::span(surface.pressure).subspan(begin, n),
               .load = load,
               .centre = surface.summary[which.pair].centre_of_pressure};
  for (std::size_t i = 0; i < n; ++i) {
    load[i] = on.area[i] * on.pressure[i];
    const Vec3 f = load[i] * on.normal[i];
    on.push += f;
    on.twist += (on.x[i] - on.centre).cross(f);
  }
  return on;
}

void add_elastic(SplitRule rule, const ContactSurface& surface, const Range& volume, const PairLoads& on, Side& side) {
  if (rule == SplitRule::Energy) {
    side.add_by_energy(squeezed_of(surface, volume), on);
  } else if (side.single()) {
    side.add_whole(side.sign() * on.push, side.sign() * on.twist, on.centre);
  } else {
    for (std::size_t i = 0; i < on.x.size(); ++i) side.add_by_contribution(i, on.x[i], side.sign() * on.load[i] * on.normal[i]);
  }
}

void react_pair(const ReactionInputs& in, const ContactCount& contacts, const PairOfSurface& which, PairReaction& out) {
  const auto& [bodies, rules, surface, settings, sticks] = in;
  const auto& [k, points, volume] = which;
  thread_local Side sides[2];
  thread_local std::vector<double> load_buffer;
  const std::size_t n = points.end - points.begin;
  out.touches = n > 0;
  out.power = out.friction_speed = 0.0;
  if (!out.touches) return;
  const BodyPair pair = surface.summary[k].bodies;
  const std::uint32_t body_of[2] = {pair.a, pair.b};
  const PairLoads on = loads_of(surface, which, load_buffer);
  for (const int s : {0, 1}) sides[s].begin(bodies[body_of[s]], s, on.x);
  for (Side& side : sides) add_elastic(settings.split, surface, volume, on, side);
  for (const int s : {0, 1}) sides[s].move_to(out.elastic[s]);

  const PairMaterial material = material_of(bodies, rules, pair);
  Vec3 dissipative = Vec3::Zero(), dissipative_twist = Vec3::Zero(), spring_force = Vec3::Zero();
  const bool springs = settings.stick.stiffness > 0.0;
  const bool rubs = material.friction > 0.0 && !springs;
  if (rubs || material.dissipation > 0.0) {
    const Slip slip(sides);
    const double slow = rubs ? regularisation_of(settings, contacts, pair, material.friction, on, sides) : 0.0;
    out.friction_speed = slow;
    double power = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3& x = on.x[i];
      const Vec3& normal = on.normal[i];
      const Vec3 v = slip.at(i, x);
      const double approach = v.dot(normal);
      const double factor = std::max(0.0, 1.0 + material.dissipation * approach);
      Vec3 f = -on.load[i] * (factor - 1.0) * normal;
      if (rubs) {
        const Vec3 slide = v - approach * normal;
        const double speed = slide.norm();
        if (speed > 0.0) f -= (material.friction * on.load[i] * factor * (friction_mollifier(speed, slow) / speed)) * slide;
      }
      if (!sides[0].single()) sides[0].add_by_contribution(i, x, f);
      if (!sides[1].single()) sides[1].add_by_contribution(i, x, -f);
      power -= f.dot(v);
      dissipative += f;
      dissipative_twist += (x - on.centre).cross(f);
    }
    out.power = power;
  }
  const StickSpring* spring = springs && sticks != nullptr && material.friction > 0.0 ? sticks->find(pair) : nullptr;
  if (spring != nullptr) {
    const SpringLoad hold = hold_by_spring(*spring, bodies[pair.a], bodies[pair.b], settings.stick, material.friction, on);
    for (const int s : {0, 1}) sides[s].add_to_part(spring->part[s], hold.point, -sides[s].sign() * hold.force, -sides[s].sign() * hold.couple);
    out.power += hold.power;
    spring_force = hold.force;
  }
  for (const int s : {0, 1}) {
    const double sign = -sides[s].sign();
    if (sides[s].single()) sides[s].add_whole(sign * dissipative, sign * dissipative_twist, on.centre);
    sides[s].move_to(out.dissipative[s]);
  }
  out.traction = dissipative + spring_force - on.push;
}

void add_loads(std::span<const PartLoad> from, PartLoads& to) {
  for (std::size_t k = 0; k < from.size(); ++k) {
    to.force[k] += from[k].force;
    to.torque[k] += from[k].torque;
  }
}

/// What all pairs do, and which pairs have a body; reused.
struct Reactions {
  std::vector<PartLoad> elastic, dissipative;  // by pair, of the parts of A, then of B
  std::vector<PairReaction> pair;
  std::vector<std::uint32_t> offset;           // pairs of body i are of_body[offset[i] .. offset[i + 1]), rising
  std::vector<std::uint32_t> of_body;
  ContactCount contacts;

  /// Of every body, where friction is to stop what slides within a step.
  void count_contacts(std::size_t bodies, const ReactionInputs& in) {
    contacts.clear();
    if (!(in.settings.step > 0.0) || in.settings.stick.stiffness > 0.0) return;
    contacts.resize(bodies);
    for (const ContactSurface::Summary& s : in.surface.summary) {
      if (!(s.force.norm() > 0.0)) continue;
      ++contacts[s.bodies.a];
      ++contacts[s.bodies.b];
    }
  }

  void begin(std::span<const ContactBody> bodies, std::span<const ContactSurface::Summary> summary) {
    pair.resize(summary.size());
    offset.assign(bodies.size() + 2, 0);
    std::size_t parts = 0;
    for (const ContactSurface::Summary& s : summary) {
      parts += bodies[s.bodies.a].pose.size() + bodies[s.bodies.b].pose.size();
      ++offset[s.bodies.a + 2];
      ++offset[s.bodies.b + 2];
    }
    elastic.resize(parts);
    dissipative.resize(parts);
    for (std::size_t i = 2; i < offset.size(); ++i) offset[i] += offset[i - 1];
    of_body.resize(2 * summary.size());
    std::size_t at = 0;
    for (std::uint32_t k = 0; k < summary.size(); ++k) {
      const std::uint32_t body_of[2] = {summary[k].bodies.a, summary[k].bodies.b};
      for (const int s : {0, 1}) {
        const std::size_t count = bodies[body_of[s]].pose.size();
        pair[k].elastic[s] = std::span(elastic).subspan(at, count);
        pair[k].dissipative[s] = std::span(dissipative).subspan(at, count);
        at += count;
        of_body[offset[body_of[s] + 1]++] = k;
      }
    }
  }
};

}  // namespace

ReactionReport react(const ReactionInputs& in, const Executor& executor, const ReactionOutputs& out) {
  const std::span<const ContactBody> bodies = in.bodies;
  const ContactSurface& surface = in.surface;
  const ReactionSettings& settings = in.settings;
  SUPPLE_EXPECTS(out.loads.size() == bodies.size());
  SUPPLE_EXPECTS(out.dissipative.empty() || out.dissipative.size() == bodies.size());
  SUPPLE_EXPECTS(settings.friction_speed > 0.0);
  const std::size_t pairs = surface.summary.size();
  if (out.traction_force != nullptr) out.traction_force->assign(pairs, Vec3::Zero());
  if (out.pair_power != nullptr) out.pair_power->assign(pairs, 0.0);
  if (out.friction_speed != nullptr) out.friction_speed->assign(pairs, 0.0);
  thread_local Reactions kept;
  Reactions& all = kept;  // of the calling thread, whoever fills it
  all.begin(bodies, surface.summary);
  all.count_contacts(bodies.size(), in);
  // In the portions of stage 6, so that threads find the points that they made.
  constexpr std::size_t kBodies = 32;
  for (std::size_t portion = 0; portion < pairs; portion += kPortion) {
    executor.for_blocks(std::min(kPortion, pairs - portion), kPairsTogether, [&, portion](std::size_t begin, std::size_t end) {
      const std::size_t first = portion + begin, last = portion + end;
      const auto first_of = [first](const std::vector<std::uint32_t>& pair) {
        return static_cast<std::size_t>(std::lower_bound(pair.begin(), pair.end(), first) - pair.begin());
      };
      Range points{0, first_of(surface.pair)}, volume{0, first_of(surface.volume_pair)};
      for (std::size_t i = first; i < last; ++i) {
        const auto k = static_cast<std::uint32_t>(i);
        points = advance_range(surface.pair, points.end, k);
        volume = advance_range(surface.volume_pair, volume.end, k);
        PairReaction& reaction = all.pair[k];
        react_pair(in, all.contacts, {k, points, volume}, reaction);
        if (!reaction.touches) continue;
        if (out.pair_power != nullptr) (*out.pair_power)[k] = reaction.power;
        if (out.friction_speed != nullptr) (*out.friction_speed)[k] = reaction.friction_speed;
        if (out.traction_force != nullptr) (*out.traction_force)[k] = reaction.traction;
      }
    });
  }
  // Every body adds up its own pairs, in their order.
  executor.for_blocks(bodies.size(), kBodies, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::uint32_t e = all.offset[i]; e < all.offset[i + 1]; ++e) {
        const std::uint32_t k = all.of_body[e];
        const PairReaction& reaction = all.pair[k];
        if (!reaction.touches) continue;
        const std::size_t s = surface.summary[k].bodies.a == i ? 0 : 1;
        add_loads(reaction.elastic[s], out.loads[i]);
        add_loads(reaction.dissipative[s], out.loads[i]);
        if (!out.dissipative.empty()) add_loads(reaction.dissipative[s], out.dissipative[i]);
      }
    }
  });
  ReactionReport report;
  for (std::size_t k = 0; k < pairs; ++k) {
    if (!all.pair[k].touches) continue;
    report.energy += surface.summary[k].energy;
    report.dissipated_power += all.pair[k].power;
  }
  return report;
}

}  // namespace supple::collision
