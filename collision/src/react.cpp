#include "supple/collision/react.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"

namespace supple::collision {
namespace {

PairMaterial material_of(std::span<const ContactBody> bodies, const ContactRules& rules, const BodyPair& pair) {
  const auto found = std::lower_bound(rules.overrides.begin(), rules.overrides.end(), pair,
                                      [](const ContactRules::Override& o, const BodyPair& p) { return o.pair < p; });
  if (found != rules.overrides.end() && found->pair == pair) return found->material;
  return combine(bodies[pair.a].material, bodies[pair.b].material);
}

/// Half-open range of the entries of `pair` that equal k; `pair` is sorted.
struct Range {
  std::size_t begin, end;
};
Range advance_range(const std::vector<std::uint32_t>& pair, std::size_t begin, std::uint32_t k) {
  std::size_t end = begin;
  while (end < pair.size() && pair[end] == k) ++end;
  return {begin, end};
}

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
    if (parts > 1) {
      body.field.evaluate_parts(points, rows_);
      for (std::size_t i = 0; i < points.size(); ++i) normalise_row(i);
      return;
    }
    velocity_ = body.velocity.empty() ? Vec3::Zero().eval() : body.velocity[0];
    spin_ = body.velocity.empty() || body.angular_velocity.empty() ? Vec3::Zero().eval() : body.angular_velocity[0];
    velocity_ -= spin_.cross(body.pose[0].position);
  }
  [[nodiscard]] bool single() const { return body_->pose.size() == 1; }

  /// Contribution-weighted velocity sum lambda_k (v_k + omega_k x (x - x_k)).
  [[nodiscard]] Vec3 velocity(std::size_t i, const Vec3& x) const {
    if (single()) return velocity_ + spin_.cross(x);
    if (body_->velocity.empty()) return Vec3::Zero();
    Vec3 sum = Vec3::Zero();
    for_parts(i, [&](std::size_t k, double lambda) {
      Vec3 v = body_->velocity[k];
      if (!body_->angular_velocity.empty()) v += body_->angular_velocity[k].cross(x - body_->pose[k].position);
      sum += lambda * v;
    });
    return sum;
  }

  /// A force and its moment about `centre`, to the only part.
  void add_whole(const Vec3& f, const Vec3& moment, const Vec3& centre) {
    force_[0] += f;
    torque_[0] += moment + (centre - body_->pose[0].position).cross(f);
  }

  void add_by_contribution(std::size_t i, const Vec3& x, const Vec3& f) {
    for_parts(i, [&](std::size_t k, double lambda) {
      force_[k] += lambda * f;
      torque_[k] += lambda * (x - body_->pose[k].position).cross(f);
    });
  }

  /// Elastic force, on A -integral p N dA: the gradient of the contact energy, corrected to `total` and `moment`
  /// (about `centre`) by the mean contributions, weighted with p dA.
  void add_by_energy(std::span<const Vec3> volume_points, std::span<const double> volume_weights,
                     std::span<const std::uint8_t> volume_sides, std::uint8_t side, std::span<const double> load,
                     const Vec3& centre, const Vec3& total, const Vec3& moment) {
    if (single()) return add_whole(total, moment, centre);
    const std::size_t parts = body_->pose.size();
    elastic_force_.assign(parts, Vec3::Zero());
    elastic_torque_.assign(parts, Vec3::Zero());
    double all = 0.0;
    for (std::size_t i = 0; i < load.size(); ++i) {
      for_parts(i, [&](std::size_t k, double lambda) { share_[k] += lambda * load[i]; });
      all += load[i];
    }
    if (!(all > 0.0)) return;
    for (double& s : share_) s /= all;

    own_point_.clear();
    own_weight_.clear();
    for (std::size_t i = 0; i < volume_points.size(); ++i) {
      if (volume_sides[i] != side) continue;
      own_point_.push_back(volume_points[i]);
      own_weight_.push_back(volume_weights[i] * body_->material.modulus);
    }
    body_->field.evaluate_parts(own_point_, volume_rows_);
    for (std::size_t i = 0; i < own_point_.size(); ++i) {
      for (std::uint32_t e = volume_rows_.offset[i]; e < volume_rows_.offset[i + 1]; ++e) {
        const std::size_t k = volume_rows_.part[e];
        const Vec3 f = own_weight_[i] * volume_rows_.gradient[e];
        elastic_force_[k] += f;
        elastic_torque_[k] += (own_point_[i] - body_->pose[k].position).cross(f);
      }
    }
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

  [[nodiscard]] double sign() const noexcept { return sign_; }

  void add_to(PartLoads& loads) const {
    for (std::size_t k = 0; k < force_.size(); ++k) {
      loads.force[k] += force_[k];
      loads.torque[k] += torque_[k];
    }
  }

  /// Adds what was gathered and starts again from zero.
  void move_to(PartLoads& loads) {
    add_to(loads);
    std::fill(force_.begin(), force_.end(), Vec3::Zero());
    std::fill(torque_.begin(), torque_.end(), Vec3::Zero());
  }

 private:
  /// Turns the values of a row into contributions lambda that sum to one.
  void normalise_row(std::size_t i) {
    const std::uint32_t begin = rows_.offset[i], end = rows_.offset[i + 1];
    double sum = 0.0;
    for (std::uint32_t e = begin; e < end; ++e) sum += rows_.value[e];
    for (std::uint32_t e = begin; e < end; ++e) rows_.value[e] /= sum;
  }

  template <class Use>
  void for_parts(std::size_t i, const Use& use) const {
    for (std::uint32_t e = rows_.offset[i]; e < rows_.offset[i + 1]; ++e) use(rows_.part[e], rows_.value[e]);
  }

  const ContactBody* body_ = nullptr;
  double sign_ = 0.0;
  Vec3 velocity_ = Vec3::Zero();  // of the only part, at the world origin
  Vec3 spin_ = Vec3::Zero();
  implicit::FieldParts rows_, volume_rows_;
  std::vector<Vec3> own_point_;
  std::vector<double> own_weight_;
  std::vector<Vec3> force_, torque_, elastic_force_, elastic_torque_;
  std::vector<double> share_;  // mean contribution of each part over Sigma, weighted with p dA
};

}  // namespace

double friction_mollifier(double speed, double regularisation) noexcept {
  if (speed >= regularisation) return 1.0;
  const double y = speed / regularisation;
  return y * (2.0 - y);
}

ReactionReport react(std::span<const ContactBody> bodies, const ContactRules& rules, const ContactSurface& surface,
                     const ReactionSettings& settings, std::span<PartLoads> loads,
                     std::vector<Vec3>* traction_force, std::span<PartLoads> dissipative_loads,
                     std::vector<double>* pair_power) {
  SUPPLE_EXPECTS(loads.size() == bodies.size());
  SUPPLE_EXPECTS(dissipative_loads.empty() || dissipative_loads.size() == bodies.size());
  SUPPLE_EXPECTS(settings.friction_speed > 0.0);
  thread_local Side sides[2];
  thread_local std::vector<double> load;
  ReactionReport report;
  if (traction_force != nullptr) traction_force->assign(surface.summary.size(), Vec3::Zero());
  if (pair_power != nullptr) pair_power->assign(surface.summary.size(), 0.0);
  std::size_t point_begin = 0, volume_begin = 0;
  for (std::uint32_t k = 0; k < surface.summary.size(); ++k) {
    const ContactSurface::Summary& summary = surface.summary[k];
    const Range points = advance_range(surface.pair, point_begin, k);
    const Range volume = advance_range(surface.volume_pair, volume_begin, k);
    point_begin = points.end;
    volume_begin = volume.end;
    const std::size_t n = points.end - points.begin;
    if (n == 0) continue;
    const BodyPair pair = summary.bodies;
    const std::uint32_t body_of[2] = {pair.a, pair.b};
    const std::span<const Vec3> x = std::span(surface.point).subspan(points.begin, n);
    const std::span<const Vec3> normal = std::span(surface.normal).subspan(points.begin, n);
    for (const int s : {0, 1}) sides[s].begin(bodies[body_of[s]], s, x);

    // The elastic force of Sigma: both bodies take it from the same sums, so that they cancel exactly.
    load.resize(n);
    const Vec3 centre = summary.centre_of_pressure;
    Vec3 push = Vec3::Zero(), twist = Vec3::Zero();  // integral of p N dA and of (x - centre) x p N dA
    for (std::size_t i = 0; i < n; ++i) {
      load[i] = surface.area[points.begin + i] * surface.pressure[points.begin + i];
      const Vec3 f = load[i] * normal[i];
      push += f;
      twist += (x[i] - centre).cross(f);
    }
    const std::size_t volumes = volume.end - volume.begin;
    for (Side& side : sides) {
      if (settings.split == SplitRule::Energy) {
        side.add_by_energy(std::span(surface.volume_point).subspan(volume.begin, volumes),
                           std::span(surface.volume_weight).subspan(volume.begin, volumes),
                           std::span(surface.volume_side).subspan(volume.begin, volumes),
                           side.sign() < 0.0 ? std::uint8_t{0} : std::uint8_t{1}, load, centre, side.sign() * push,
                           side.sign() * twist);
      } else {
        if (side.single()) {
          side.add_whole(side.sign() * push, side.sign() * twist, centre);
          continue;
        }
        for (std::size_t i = 0; i < n; ++i) side.add_by_contribution(i, x[i], side.sign() * load[i] * normal[i]);
      }
    }

    for (const int s : {0, 1}) sides[s].move_to(loads[body_of[s]]);
    const PairMaterial material = material_of(bodies, rules, pair);
    Vec3 dissipative = Vec3::Zero(), dissipative_twist = Vec3::Zero();
    const double power_before = report.dissipated_power;
    if (material.friction > 0.0 || material.dissipation > 0.0) {
      for (std::size_t i = 0; i < n; ++i) {
        const Vec3 v = sides[0].velocity(i, x[i]) - sides[1].velocity(i, x[i]);
        const double approach = v.dot(normal[i]);
        const Vec3 slide = v - approach * normal[i];
        const double speed = slide.norm();
        const double factor = std::max(0.0, 1.0 + material.dissipation * approach);
        Vec3 f = -load[i] * (factor - 1.0) * normal[i];
        if (speed > 0.0) {
          const double grip = friction_mollifier(speed, settings.friction_speed) / speed;
          f -= (material.friction * load[i] * factor * grip) * slide;
        }
        if (!sides[0].single()) sides[0].add_by_contribution(i, x[i], f);
        if (!sides[1].single()) sides[1].add_by_contribution(i, x[i], -f);
        report.dissipated_power -= f.dot(v);
        dissipative += f;
        dissipative_twist += (x[i] - centre).cross(f);
      }
      for (const int s : {0, 1}) {
        const double sign = -sides[s].sign();
        if (sides[s].single()) sides[s].add_whole(sign * dissipative, sign * dissipative_twist, centre);
        if (!dissipative_loads.empty()) sides[s].add_to(dissipative_loads[body_of[s]]);
        sides[s].move_to(loads[body_of[s]]);
      }
    }
    if (pair_power != nullptr) (*pair_power)[k] = report.dissipated_power - power_before;
    if (traction_force != nullptr) (*traction_force)[k] = dissipative - push;
    report.energy += summary.energy;
  }
  return report;
}

}  // namespace supple::collision
