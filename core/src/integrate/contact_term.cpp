#include "integrate/contact_term.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrate/step.h"
#include "laws/cross_matrix.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// A spatial stiffness about `origin` as one about the particle's displacement and rotation: rows (force; moment about x).
Mat6 twist_map(const Vec3& arm) {
  Mat6 map = Mat6::Identity();
  map.topRightCorner<3, 3>() = -cross_matrix(arm);
  return map;
}

}  // namespace

Mat3 inverse_right_jacobian(const Vec3& delta) {
  const double angle2 = delta.squaredNorm();
  const Mat3 cross = cross_matrix(delta);
  double factor = 1.0 / 12.0 + angle2 / 720.0;
  if (angle2 > 1e-4) {
    const double angle = std::sqrt(angle2);
    const math::SinCos half = math::sin_cos(0.5 * angle);
    factor = (1.0 - 0.5 * angle * half.cos / half.sin) / angle2;
  }
  return Mat3::Identity() + 0.5 * cross + factor * cross * cross;
}

void ContactPoints::clear() {
  pair.clear();
  point.clear();
  normal.clear();
  weight.clear();
  pressure.clear();
  slope.clear();
  obstacle_velocity.clear();
  offset.clear();
  particle.clear();
  share.clear();
  split_particle.clear();
  split_force.clear();
  split_torque.clear();
}

void ContactTerm::find_touched(std::size_t particles) {
  constexpr std::uint32_t kUntouched = std::numeric_limits<std::uint32_t>::max();
  const ContactPoints& points = *points_;
  rank_.assign(particles, kUntouched);
  for (const std::uint32_t i : points.particle) rank_[i] = 0;
  for (const std::uint32_t i : points.split_particle) rank_[i] = 0;
  touched_.clear();
  for (std::uint32_t i = 0; i < particles; ++i) {
    if (rank_[i] == kUntouched) continue;
    rank_[i] = static_cast<std::uint32_t>(touched_.size());
    touched_.push_back(i);
  }
  const auto rank_of = [this](std::uint32_t particle) { return rank_[particle]; };
  entry_.resize(points.particle.size());
  std::transform(points.particle.begin(), points.particle.end(), entry_.begin(), rank_of);
  split_entry_.resize(points.split_particle.size());
  std::transform(points.split_particle.begin(), points.split_particle.end(), split_entry_.begin(), rank_of);
}

void ContactTerm::find_groups() {
  const ContactPoints& p = *points_;
  groups_.clear();
  for (std::uint32_t k = 0; k < p.pair.size(); ++k) {
    for (std::uint32_t q = p.pair[k].begin; q < p.pair[k].end; ++q) {
      const std::uint32_t begin = p.offset[q], end = p.offset[q + 1];
      if (q > p.pair[k].begin) {
        Group& last = groups_.back();
        const auto same = [&](const auto& list) {
          return std::equal(list.begin() + begin, list.begin() + end, list.begin() + last.entry_begin, list.begin() + last.entry_end);
        };
        if (same(p.particle) && same(p.share)) {
          last.end = q + 1;
          continue;
        }
      }
      groups_.push_back({.begin = q, .end = q + 1, .entry_begin = begin, .entry_end = end, .pair = k, .origin = p.point[q],
                         .lanes = {.friction = p.pair[k].friction, .damping = p.pair[k].dissipation / rule_.h}});
    }
  }
  std::size_t lane = 0;
  for (Group& group : groups_) {
    group.lanes.begin = lane;
    lane += (group.end - group.begin + kContactLanes - 1) / kContactLanes * kContactLanes;
    group.lanes.end = lane;
  }
}

void ContactTerm::begin(const ParticleSet& set, const ContactPoints& points, const ParticleState& start, const ParticleState& predicted,
                        const StepRule& rule, const SlowSlip& slow) {
  SUPPLE_EXPECTS(points.point.empty() || points.offset.size() == points.point.size() + 1);
  SUPPLE_EXPECTS(slow.speed > 0.0);
  points_ = &points;
  start_ = &start;
  rule_ = rule;
  find_touched(set.size());
  find_groups();
  fill_lanes(set, predicted);
  find_stick_speeds(slow);
  placed_.clear();
  place(predicted);
  for (std::size_t q = 0; q < lanes_.approach.size(); ++q) lanes_.offset_pressure[q] -= lanes_.slope[q] * lanes_.approach[q];
  split_place_.resize(points.split_particle.size());
  for (std::size_t s = 0; s < split_place_.size(); ++s) split_place_[s] = predicted.position[points.split_particle[s]];
  split_base_.assign(points.pair.size(), 0.0);
  for (std::size_t k = 0; k < points.pair.size(); ++k) {
    for (std::uint32_t q = points.pair[k].begin; q < points.pair[k].end; ++q) split_base_[k] += points.weight[q] * points.pressure[q];
  }
  split_scale_.assign(points.pair.size(), 0.0);
  find_coupled();
}

void ContactTerm::fill_lanes(const ParticleSet& set, const ParticleState& predicted) {
  const ContactPoints& points = *points_;
  arm_.resize(points.particle.size());
  lanes_.assign(groups_.empty() ? 0 : groups_.back().lanes.end);
  std::vector<Vec3> spin(touched_.size());
  for (std::size_t t = 0; t < touched_.size(); ++t) spin[t] = angular_velocity(set, *start_, touched_[t]);
  for (const Group& group : groups_) {
    Vec3 velocity = Vec3::Zero(), turn = Vec3::Zero();
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      const std::uint32_t i = points.particle[e];
      arm_[e] = group.origin - predicted.position[i];
      velocity += points.share[e] * (start_->velocity[i] + spin[entry_[e]].cross(arm_[e]));
      turn += points.share[e] * spin[entry_[e]];
    }
    const double led = leads(group);
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      const std::size_t lane = group.lanes.begin + (q - group.begin);
      const Vec3 local = points.point[q] - group.origin;
      Vec3 start_velocity = velocity + turn.cross(local);
      if (led != 0.0) {
        start_velocity += led * points.obstacle_velocity[q];
        lanes_.led.set(lane, rule_.h * led * points.obstacle_velocity[q]);
      }
      lanes_.local.set(lane, local);
      lanes_.normal.set(lane, points.normal[q]);
      lanes_.start_velocity.set(lane, start_velocity);
      lanes_.weight[lane] = points.weight[q];
      lanes_.slope[lane] = points.slope[q];
      lanes_.offset_pressure[lane] = points.pressure[q];  // until the approach is known
    }
  }
}

void ContactTerm::find_stick_speeds(const SlowSlip& slow) {
  const ContactPoints& points = *points_;
  std::vector<double> square(points.pair.size(), 0.0), all(points.pair.size(), 0.0);
  for (const Group& group : groups_) {
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      const double load = points.weight[q] * points.pressure[q];
      square[group.pair] += load * lanes_.start_velocity.at(group.lanes.begin + (q - group.begin)).squaredNorm();
      all[group.pair] += load;
    }
  }
  stick_speed_.assign(points.pair.size(), slow.speed);
  for (std::size_t k = 0; k < points.pair.size(); ++k) {
    if (all[k] > 0.0) stick_speed_[k] = std::max(slow.speed, slow.share * std::sqrt(square[k] / all[k]));
  }
  least_stick_.assign(touched_.size(), std::numeric_limits<double>::infinity());
  for (Group& group : groups_) {
    group.lanes.slow = stick_speed_[group.pair];
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      least_stick_[entry_[e]] = std::min(least_stick_[entry_[e]], group.lanes.slow);
    }
  }
}

void ContactTerm::scale_splits() {
  if (points_->split_particle.empty()) return;
  std::fill(split_scale_.begin(), split_scale_.end(), 0.0);
  for (const Group& group : groups_) split_scale_[group.pair] += elastic_force_of(lanes_, group.lanes);
  for (std::size_t k = 0; k < split_scale_.size(); ++k) split_scale_[k] = split_base_[k] > 0.0 ? split_scale_[k] / split_base_[k] : 0.0;
}

void ContactTerm::find_coupled() {
  const ContactPoints& p = *points_;
  coupled_.clear();
  for (const Group& group : groups_) {
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      for (std::uint32_t f = group.entry_begin; f < e; ++f) {
        if (p.particle[e] != p.particle[f]) coupled_.push_back(std::minmax(p.particle[e], p.particle[f]));
      }
    }
    // Neighbouring groups mostly couple the same particles.
    if (coupled_.size() > 4096) {
      std::sort(coupled_.begin(), coupled_.end());
      coupled_.erase(std::unique(coupled_.begin(), coupled_.end()), coupled_.end());
    }
  }
  std::sort(coupled_.begin(), coupled_.end());
  coupled_.erase(std::unique(coupled_.begin(), coupled_.end()), coupled_.end());
  block_.clear();
  for (Group& group : groups_) {
    group.block = static_cast<std::uint32_t>(block_.size());
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      for (std::uint32_t f = group.entry_begin; f < e; ++f) {
        if (p.particle[e] == p.particle[f]) {
          block_.push_back(entry_[e]);
          continue;
        }
        const std::pair<std::uint32_t, std::uint32_t> wanted = std::minmax(p.particle[e], p.particle[f]);
        block_.push_back(static_cast<std::uint32_t>(std::lower_bound(coupled_.begin(), coupled_.end(), wanted) - coupled_.begin()));
      }
    }
  }
}

bool ContactTerm::is_at(const ParticleState& pose) const {
  if (placed_.size() != touched_.size()) return false;
  for (std::size_t t = 0; t < touched_.size(); ++t) {
    const std::uint32_t i = touched_[t];
    if (placed_[t].position != pose.position[i] || placed_[t].orientation.coeffs() != pose.orientation[i].coeffs()) return false;
  }
  return true;
}

void ContactTerm::place(const ParticleState& pose) {
  if (is_at(pose)) return;
  placed_.resize(touched_.size());
  moved_.resize(touched_.size());
  turned_.resize(touched_.size());
  for (std::size_t t = 0; t < touched_.size(); ++t) {
    const std::uint32_t i = touched_[t];
    placed_[t] = {pose.position[i], pose.orientation[i]};
    moved_[t] = pose.position[i] - start_->position[i];
    turned_[t] = rotation_log(pose.orientation[i] * start_->orientation[i].conjugate());
  }
  const ContactPoints& p = *points_;
  for (Group& group : groups_) {
    group.twist = {};
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      group.twist.moved += p.share[e] * (moved_[entry_[e]] + turned_[entry_[e]].cross(arm_[e]));
      group.twist.turning += p.share[e] * turned_[entry_[e]];
    }
    place_points(lanes_, group.lanes, group.twist, rule_.slip_factor / rule_.h, rule_.slip_factor - 1.0);
  }
}

double ContactTerm::leads(const Group& group) const {
  switch (points_->pair[group.pair].obstacle) {
    case ObstacleSide::None: return 0.0;
    case ObstacleSide::A: return 1.0;
    case ObstacleSide::B: return -1.0;
  }
  return 0.0;
}

double ContactTerm::lag_friction(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double change = 0.0, all = 0.0;
  for (const Group& group : groups_) {
    const LagSums sums = lag_forces(lanes_, group.lanes);
    change += sums.change;
    all += sums.all;
  }
  scale_splits();
  return all > 0.0 ? change / all : 0.0;
}

double ContactTerm::value(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double sum = 0.0;
  for (const Group& group : groups_) sum += potential_of(lanes_, group.lanes, rule_.slip_factor / rule_.h);
  for (std::size_t k = 0; k < points_->pair.size(); ++k) {
    for (std::uint32_t s = points_->pair[k].split_begin; s < points_->pair[k].split_end; ++s) {
      const std::uint32_t t = split_entry_[s];
      sum -= split_scale_[k] * (points_->split_force[s].dot(moved_[t]) + points_->split_torque[s].dot(turned_[t]));
    }
  }
  return sum;
}

void ContactTerm::add_gradient(const ParticleState& pose, Eigen::VectorXd& gradient) {
  if (empty()) return;
  place(pose);
  std::vector<Vec3> force(touched_.size(), Vec3::Zero()), torque(touched_.size(), Vec3::Zero());
  const ContactPoints& p = *points_;
  for (const Group& group : groups_) {
    const auto [sum, moment] = gradient_of(lanes_, group.lanes);
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      force[entry_[e]] += p.share[e] * sum;
      torque[entry_[e]] += p.share[e] * (moment + arm_[e].cross(sum));
    }
  }
  for (std::size_t k = 0; k < p.pair.size(); ++k) {
    for (std::uint32_t s = p.pair[k].split_begin; s < p.pair[k].split_end; ++s) {
      force[split_entry_[s]] -= split_scale_[k] * p.split_force[s];
      torque[split_entry_[s]] -= split_scale_[k] * p.split_torque[s];
    }
  }
  for (std::size_t t = 0; t < touched_.size(); ++t) {
    const auto row = static_cast<Eigen::Index>(6) * touched_[t];
    gradient.segment<3>(row) += force[t];
    // d psi / d phi of psi = log(exp(phi) exp(psi)) is J_r^-1(-psi).
    gradient.segment<3>(row + 3) += inverse_right_jacobian(-turned_[t]).transpose() * torque[t];
  }
}

void ContactTerm::spread(const Group& group, const Mat6& stiffness) {
  const ContactPoints& p = *points_;
  std::uint32_t block = group.block;
  for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
    diagonal_[entry_[e]] += p.share[e] * p.share[e] * stiffness;
    for (std::uint32_t f = group.entry_begin; f < e; ++f, ++block) {
      const double shares = p.share[e] * p.share[f];
      if (p.particle[e] == p.particle[f]) {
        diagonal_[block_[block]] += 2.0 * shares * stiffness;
      } else {
        off_diagonal_[block_[block]] += shares * stiffness;
      }
    }
  }
}

void ContactTerm::add_hessian(const ParticleState& pose, std::size_t first_pair, StepHessian& hessian) {
  if (empty()) return;
  place(pose);
  diagonal_.assign(touched_.size(), Mat6::Zero());
  off_diagonal_.assign(coupled_.size(), Mat6::Zero());
  const Vec3 origin = points_->point.front();  // near all arms, so that nothing cancels
  std::vector<Vec3> centre(touched_.size(), origin);
  for (const Group& group : groups_) {
    spread(group, stiffness_of(lanes_, group.lanes, group.origin - origin, rule_.slip_factor / rule_.h));
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) centre[entry_[e]] = group.origin - arm_[e];
  }
  // Twists about `origin` from the displacement and the rotation of each particle.
  std::vector<Mat6> map(touched_.size());
  for (std::size_t t = 0; t < touched_.size(); ++t) {
    map[t] = twist_map(origin - centre[t]);
    map[t].rightCols<3>() = (map[t].rightCols<3>() * inverse_right_jacobian(-turned_[t])).eval();
  }
  for (std::size_t t = 0; t < touched_.size(); ++t) hessian.add_particle(touched_[t], map[t].transpose() * diagonal_[t] * map[t]);
  for (std::size_t c = 0; c < coupled_.size(); ++c) {
    const auto [low, high] = coupled_[c];
    hessian.add_coupling(first_pair + c, map[rank_[high]].transpose() * off_diagonal_[c] * map[rank_[low]]);
  }
}

double ContactTerm::predict_friction(const Eigen::VectorXd& correction) {
  if (empty()) return 0.0;
  const ContactPoints& p = *points_;
  lanes_.next_direction = lanes_.direction;
  double largest = 0.0;
  for (const Group& group : groups_) {
    if (!(group.lanes.friction > 0.0)) continue;
    Twist twist;
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      const auto row = static_cast<Eigen::Index>(6) * p.particle[e];
      twist.moved += p.share[e] * (correction.segment<3>(row) + correction.segment<3>(row + 3).cross(arm_[e]));
      twist.turning += p.share[e] * correction.segment<3>(row + 3);
    }
    largest = std::max(largest, predict_directions(lanes_, group.lanes, twist, rule_.slip_factor / rule_.h) / group.lanes.slow);
  }
  return largest;
}

void ContactTerm::turn_friction(double share) {
  const auto turn = [share](std::vector<double>& now, const std::vector<double>& next) {
    for (std::size_t q = 0; q < now.size(); ++q) now[q] += share * (next[q] - now[q]);
  };
  turn(lanes_.direction.x, lanes_.next_direction.x);
  turn(lanes_.direction.y, lanes_.next_direction.y);
  turn(lanes_.direction.z, lanes_.next_direction.z);
}

void ContactTerm::finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger, std::vector<ContactPairLoad>& pairs) {
  pairs.assign(points_ != nullptr ? points_->pair.size() : 0, {});
  if (empty()) return;
  place(pose);
  const ContactPoints& p = *points_;
  for (const Group& group : groups_) {
    const Wrench gradient = gradient_of(lanes_, group.lanes);
    const Vec3 sum = -gradient.force, moment = -gradient.moment;  // about the group's origin
    // The impulse does the work of the mean of the velocities before and after it.
    const PowerSums powers = powers_of(lanes_, group.lanes, group.twist, 0.5 * rule_.end_factor / rule_.h, 0.5 * (2.0 - rule_.end_factor));
    ContactPairLoad& pair = pairs[group.pair];
    pair.dissipated += dt * powers.dissipated;
    ledger.dissipated += dt * powers.dissipated;
    if (const double led = leads(group); led != 0.0) {
      ledger.external_impulse -= dt * led * sum;
      ledger.external_angular_impulse -= dt * led * (group.origin.cross(sum) + moment);
      ledger.external_work -= dt / rule_.h * powers.led;
    }
    pair.force += sum;
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      const std::uint32_t i = p.particle[e];
      loads.force[i] += p.share[e] * sum;
      loads.torque[i] += p.share[e] * (moment + (group.origin - pose.position[i]).cross(sum));
    }
  }
  for (std::size_t k = 0; k < p.pair.size(); ++k) {
    pairs[k].stick_speed = stick_speed_[k];
    for (std::uint32_t s = p.pair[k].split_begin; s < p.pair[k].split_end; ++s) {
      const std::uint32_t i = p.split_particle[s];
      // About the place where the moments sum to zero.
      const Vec3 f = split_scale_[k] * p.split_force[s];
      loads.force[i] += f;
      loads.torque[i] += split_scale_[k] * p.split_torque[s] + (split_place_[s] - pose.position[i]).cross(f);
    }
  }
}

}  // namespace supple::core
