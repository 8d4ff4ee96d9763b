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

using Vec6 = Eigen::Matrix<double, 6, 1>;

constexpr double kNoEnd = -std::numeric_limits<double>::infinity();

/// Approach from which a point presses [m]: where its pressure or its damping factor reaches zero.
double first_approach(double pressure, double slope, double damping) {
  double from = kNoEnd;
  if (slope > 0.0) {
    from = -pressure / slope;
  } else if (!(pressure > 0.0)) {
    return -kNoEnd;
  }
  return damping > 0.0 ? std::max(from, -1.0 / damping) : from;
}

/// f1(y) = 2 y - y^2 below 1, 1 beyond; its integral.
double mollified(double y) { return y < 1.0 ? y * y * (1.0 - y / 3.0) : y - 1.0 / 3.0; }

/// Friction over its largest value at the slip v is f = slope v; its derivative is slope 1 - fall f v^T.
struct Secant {
  double slope = 0.0;  ///< [s/m]
  double fall = 0.0;   ///< [s^2/m^2]
};

Secant secant_of(double speed, double slow) {
  const double y = speed / slow;
  if (y >= 1.0) return {1.0 / speed, 1.0 / (speed * speed)};
  return {(2.0 - y) / slow, speed > 0.0 ? 1.0 / (slow * speed * (2.0 - y)) : 0.0};
}

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

void ContactTerm::find_touched() {
  const ContactPoints& points = *points_;
  touched_ = points.particle;
  touched_.insert(touched_.end(), points.split_particle.begin(), points.split_particle.end());
  std::sort(touched_.begin(), touched_.end());
  touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  const auto entry_of = [&](std::uint32_t particle) {
    return static_cast<std::uint32_t>(std::lower_bound(touched_.begin(), touched_.end(), particle) - touched_.begin());
  };
  entry_.resize(points.particle.size());
  std::transform(points.particle.begin(), points.particle.end(), entry_.begin(), entry_of);
  split_entry_.resize(points.split_particle.size());
  std::transform(points.split_particle.begin(), points.split_particle.end(), split_entry_.begin(), entry_of);
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
                         .friction = p.pair[k].friction, .damping = p.pair[k].dissipation / rule_.h});
    }
  }
}

void ContactTerm::begin(const ParticleSet& set, const ContactPoints& points, const ParticleState& start, const ParticleState& predicted,
                        const StepRule& rule, const SlowSlip& slow) {
  SUPPLE_EXPECTS(points.point.empty() || points.offset.size() == points.point.size() + 1);
  SUPPLE_EXPECTS(slow.speed > 0.0);
  points_ = &points;
  start_ = &start;
  rule_ = rule;
  find_touched();
  find_groups();
  const std::size_t count = points.point.size();
  arm_.resize(points.particle.size());
  local_.resize(count);
  start_velocity_.resize(count);
  offset_pressure_.resize(count);
  std::vector<Vec3> spin(touched_.size());
  for (std::size_t t = 0; t < touched_.size(); ++t) spin[t] = angular_velocity(set, start, touched_[t]);
  for (const Group& group : groups_) {
    Vec3 velocity = Vec3::Zero(), turn = Vec3::Zero();
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      const std::uint32_t i = points.particle[e];
      arm_[e] = group.origin - predicted.position[i];
      velocity += points.share[e] * (start.velocity[i] + spin[entry_[e]].cross(arm_[e]));
      turn += points.share[e] * spin[entry_[e]];
    }
    const double led = leads(group);
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      local_[q] = points.point[q] - group.origin;
      start_velocity_[q] = velocity + turn.cross(local_[q]);
      if (led != 0.0) start_velocity_[q] += led * points.obstacle_velocity[q];
    }
  }
  placed_.clear();
  place(predicted);
  for (std::size_t q = 0; q < count; ++q) offset_pressure_[q] = points.pressure[q] - points.slope[q] * approach_[q];
  split_place_.resize(points.split_particle.size());
  for (std::size_t s = 0; s < split_place_.size(); ++s) split_place_[s] = predicted.position[points.split_particle[s]];
  split_scale_.assign(points.pair.size(), 0.0);
  find_stick_speeds(slow);
  find_coupled();
  lagged_.assign(count, 0.0);
  direction_.assign(count, Vec3::Zero());
}

void ContactTerm::find_stick_speeds(const SlowSlip& slow) {
  const ContactPoints& points = *points_;
  stick_speed_.assign(points.pair.size(), slow.speed);
  for (std::size_t p = 0; p < points.pair.size(); ++p) {
    double square = 0.0, all = 0.0;
    for (std::uint32_t q = points.pair[p].begin; q < points.pair[p].end; ++q) {
      const double load = points.weight[q] * points.pressure[q];
      square += load * start_velocity_[q].squaredNorm();
      all += load;
    }
    if (all > 0.0) stick_speed_[p] = std::max(slow.speed, slow.share * std::sqrt(square / all));
  }
  for (Group& group : groups_) group.slow = stick_speed_[group.pair];
}

void ContactTerm::scale_splits() {
  const ContactPoints& p = *points_;
  if (p.split_particle.empty()) return;
  for (std::size_t k = 0; k < p.pair.size(); ++k) {
    double now = 0.0, predicted = 0.0;
    for (std::uint32_t q = p.pair[k].begin; q < p.pair[k].end; ++q) {
      now += elastic_force(q);
      predicted += p.weight[q] * p.pressure[q];
    }
    split_scale_[k] = predicted > 0.0 ? now / predicted : 0.0;
  }
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
  const double factor = rule_.slip_factor / rule_.h;
  displacement_.resize(p.point.size());
  approach_.resize(p.point.size());
  slip_.resize(p.point.size());
  speed_.resize(p.point.size());
  for (const Group& group : groups_) {
    Vec3 moved = Vec3::Zero(), turning = Vec3::Zero();
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      moved += p.share[e] * (moved_[entry_[e]] + turned_[entry_[e]].cross(arm_[e]));
      turning += p.share[e] * turned_[entry_[e]];
    }
    const double led = rule_.h * leads(group);
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      Vec3 u = moved + turning.cross(local_[q]);
      if (led != 0.0) u += led * p.obstacle_velocity[q];
      const Vec3& n = p.normal[q];
      const Vec3 v = factor * u - (rule_.slip_factor - 1.0) * start_velocity_[q];
      displacement_[q] = u;
      approach_[q] = u.dot(n);
      slip_[q] = v - v.dot(n) * n;
      speed_[q] = slip_[q].norm();
    }
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

double ContactTerm::normal_force(const Group& group, std::size_t q) const {
  const double approach = approach_[q];
  const double pressure = offset_pressure_[q] + points_->slope[q] * approach, damping = 1.0 + group.damping * approach;
  return points_->weight[q] * std::max(pressure, 0.0) * std::max(damping, 0.0);
}

double ContactTerm::elastic_force(std::size_t q) const {
  return points_->weight[q] * std::max(offset_pressure_[q] + points_->slope[q] * approach_[q], 0.0);
}

double ContactTerm::normal_potential(const Group& group, std::size_t q) const {
  const double approach = approach_[q];
  const double g = points_->slope[q], d = group.damping;
  const double from = first_approach(offset_pressure_[q], g, d);
  if (!(approach > from)) return 0.0;
  const double w = points_->weight[q];
  if (from == kNoEnd) return w * offset_pressure_[q] * approach;  // neither slope nor damping
  const double t = approach - from, p = std::max(offset_pressure_[q] + g * from, 0.0), f = std::max(1.0 + d * from, 0.0);
  return w * t * (p * f + t * (0.5 * (p * d + g * f) + t * (g * d / 3.0)));
}

double ContactTerm::normal_stiffness(const Group& group, std::size_t q) const {
  const double approach = approach_[q];
  const double g = points_->slope[q], d = group.damping;
  const double pressure = offset_pressure_[q] + g * approach, damping = 1.0 + d * approach;
  return pressure > 0.0 && damping > 0.0 ? points_->weight[q] * (g * damping + pressure * d) : 0.0;
}

Vec3 ContactTerm::gradient_of(const Group& group, std::size_t q) const {
  Vec3 gradient = normal_force(group, q) * points_->normal[q];
  const double most = group.friction * lagged_[q];
  if (most > 0.0) gradient += most * secant_of(speed_[q], group.slow).slope * slip_[q];
  return gradient;
}

Mat6 ContactTerm::hessian_of(const Group& group, const Vec3& origin) const {
  // Of each point: (k - a) n n^T + a 1 - b (f v^T + v f^T), f the direction of friction, v the slip.
  Mat6 sum = Mat6::Zero();
  double all = 0.0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (std::uint32_t q = group.begin; q < group.end; ++q) {
    const Vec3 x = points_->point[q] - origin;
    const Vec3& n = points_->normal[q];
    Vec6 normal;
    normal << n, x.cross(n);
    const double most = group.friction * lagged_[q], stiffness = normal_stiffness(group, q);
    if (!(most > 0.0)) {
      sum.noalias() += (stiffness * normal) * normal.transpose();
      continue;
    }
    const Vec3 &v = slip_[q], &f = direction_[q];
    const Secant secant = secant_of(speed_[q], group.slow);
    const double scale = most * rule_.slip_factor / rule_.h, a = scale * secant.slope;
    Vec6 along, direction;
    along << v, x.cross(v);
    direction << f, x.cross(f);
    const Vec6 scaled = (-0.5 * scale * secant.fall) * along;
    sum.noalias() += ((stiffness - a) * normal) * normal.transpose();
    sum.noalias() += scaled * direction.transpose();
    sum.noalias() += direction * scaled.transpose();
    all += a;
    first += a * x;
    second += a * x * x.transpose();
  }
  sum.topLeftCorner<3, 3>() += all * Mat3::Identity();
  sum.topRightCorner<3, 3>() -= cross_matrix(first);
  sum.bottomLeftCorner<3, 3>() += cross_matrix(first);
  sum.bottomRightCorner<3, 3>() += second.trace() * Mat3::Identity() - second;
  return sum;
}

double ContactTerm::lag_friction(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double change = 0.0, all = 0.0;
  for (const Group& group : groups_) {
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      const double force = normal_force(group, q);
      change += std::abs(force - lagged_[q]);
      all += force;
      lagged_[q] = force;
    }
  }
  scale_splits();
  return all > 0.0 ? change / all : 0.0;
}

double ContactTerm::value(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double sum = 0.0;
  for (const Group& group : groups_) {
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      sum += normal_potential(group, q);
      const double most = group.friction * lagged_[q];
      if (most > 0.0) sum += most * group.slow * rule_.h / rule_.slip_factor * mollified(speed_[q] / group.slow);
    }
  }
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
    Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();  // about the group's origin
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      const Vec3 f = gradient_of(group, q);
      sum += f;
      moment += local_[q].cross(f);
    }
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
    spread(group, hessian_of(group, origin));
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
    const auto local = [&](std::uint32_t i) {
      return static_cast<std::size_t>(std::lower_bound(touched_.begin(), touched_.end(), i) - touched_.begin());
    };
    const auto [low, high] = coupled_[c];
    hessian.add_coupling(first_pair + c, map[local(high)].transpose() * off_diagonal_[c] * map[local(low)]);
  }
}

double ContactTerm::predict_friction(const Eigen::VectorXd& correction) {
  if (empty()) return 0.0;
  const ContactPoints& p = *points_;
  next_direction_ = direction_;
  const double factor = rule_.slip_factor / rule_.h;
  double largest = 0.0;
  for (const Group& group : groups_) {
    if (!(group.friction > 0.0)) continue;
    Vec3 moved = Vec3::Zero(), turning = Vec3::Zero();
    for (std::uint32_t e = group.entry_begin; e < group.entry_end; ++e) {
      const auto row = static_cast<Eigen::Index>(6) * p.particle[e];
      moved += p.share[e] * (correction.segment<3>(row) + correction.segment<3>(row + 3).cross(arm_[e]));
      turning += p.share[e] * correction.segment<3>(row + 3);
    }
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      if (!(lagged_[q] > 0.0)) continue;
      const Vec3 u = moved + turning.cross(local_[q]);
      const Vec3 &v = slip_[q], change = factor * (u - u.dot(p.normal[q]) * p.normal[q]);
      const Secant secant = secant_of(speed_[q], group.slow);
      const Vec3 next = secant.slope * (v + change) - secant.fall * v.dot(change) * direction_[q];
      next_direction_[q] = next / std::max(1.0, next.norm());
      largest = std::max(largest, change.squaredNorm());
    }
  }
  return std::sqrt(largest);
}

void ContactTerm::turn_friction(double share) {
  for (std::size_t q = 0; q < direction_.size(); ++q) direction_[q] += share * (next_direction_[q] - direction_[q]);
}

void ContactTerm::finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger, std::vector<ContactPairLoad>& pairs) {
  pairs.assign(points_ != nullptr ? points_->pair.size() : 0, {});
  if (empty()) return;
  place(pose);
  const ContactPoints& p = *points_;
  for (const Group& group : groups_) {
    Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();  // about the group's origin
    ContactPairLoad& pair = pairs[group.pair];
    const double led = leads(group);
    for (std::uint32_t q = group.begin; q < group.end; ++q) {
      const Vec3 f = -gradient_of(group, q), dissipative = f + elastic_force(q) * p.normal[q];
      sum += f;
      moment += local_[q].cross(f);
      // The impulse does the work of the mean of the velocities before and after it.
      const Vec3 v = 0.5 * (rule_.end_factor / rule_.h * displacement_[q] + (2.0 - rule_.end_factor) * start_velocity_[q]);
      const double dissipated = -dt * dissipative.dot(v);
      pair.dissipated += dissipated;
      ledger.dissipated += dissipated;
      if (led == 0.0) continue;
      ledger.external_impulse -= dt * led * f;
      ledger.external_angular_impulse -= dt * led * p.point[q].cross(f);
      ledger.external_work -= dt * led * f.dot(p.obstacle_velocity[q]);
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
