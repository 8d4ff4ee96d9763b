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
  pair_of_.resize(points.point.size());
  for (std::uint32_t p = 0; p < points.pair.size(); ++p) {
    std::fill(pair_of_.begin() + points.pair[p].begin, pair_of_.begin() + points.pair[p].end, p);
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
  const std::size_t count = points.point.size();
  arm_.resize(points.particle.size());
  start_velocity_.assign(count, Vec3::Zero());
  offset_pressure_.resize(count);
  std::vector<Vec3> spin(touched_.size());
  for (std::size_t t = 0; t < touched_.size(); ++t) spin[t] = angular_velocity(set, start, touched_[t]);
  for (std::size_t q = 0; q < count; ++q) {
    const ObstacleSide side = points.pair[pair_of_[q]].obstacle;
    if (side != ObstacleSide::None) start_velocity_[q] = (side == ObstacleSide::B ? -1.0 : 1.0) * points.obstacle_velocity[q];
    for (std::uint32_t e = points.offset[q]; e < points.offset[q + 1]; ++e) {
      const std::uint32_t i = points.particle[e];
      arm_[e] = points.point[q] - predicted.position[i];
      start_velocity_[q] += points.share[e] * (start.velocity[i] + spin[entry_[e]].cross(arm_[e]));
    }
  }
  placed_.clear();
  place(predicted);
  for (std::size_t q = 0; q < count; ++q) offset_pressure_[q] = points.pressure[q] - points.slope[q] * displacement_[q].dot(points.normal[q]);
  split_place_.resize(points.split_particle.size());
  for (std::size_t s = 0; s < split_place_.size(); ++s) split_place_[s] = predicted.position[points.split_particle[s]];
  split_scale_.assign(points.pair.size(), 0.0);
  find_stick_speeds(slow);
  find_coupled();
  lagged_.assign(count, 0.0);
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
}

void ContactTerm::scale_splits() {
  const ContactPoints& p = *points_;
  if (p.split_particle.empty()) return;
  for (std::size_t k = 0; k < p.pair.size(); ++k) {
    double now = 0.0, predicted = 0.0;
    for (std::uint32_t q = p.pair[k].begin; q < p.pair[k].end; ++q) {
      now += p.weight[q] * std::max(offset_pressure_[q] + p.slope[q] * displacement_[q].dot(p.normal[q]), 0.0);
      predicted += p.weight[q] * p.pressure[q];
    }
    split_scale_[k] = predicted > 0.0 ? now / predicted : 0.0;
  }
}

void ContactTerm::find_coupled() {
  const ContactPoints& p = *points_;
  coupled_.clear();
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
      for (std::uint32_t f = p.offset[q]; f < e; ++f) {
        if (p.particle[e] != p.particle[f]) coupled_.push_back(std::minmax(p.particle[e], p.particle[f]));
      }
    }
    // Neighbouring points mostly couple the same particles.
    if (coupled_.size() > 4096) {
      std::sort(coupled_.begin(), coupled_.end());
      coupled_.erase(std::unique(coupled_.begin(), coupled_.end()), coupled_.end());
    }
  }
  std::sort(coupled_.begin(), coupled_.end());
  coupled_.erase(std::unique(coupled_.begin(), coupled_.end()), coupled_.end());
  block_.clear();
  as_last_.assign(p.point.size(), 0);
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    const std::uint32_t begin = p.offset[q], end = p.offset[q + 1], length = end - begin;
    as_last_[q] = q > 0 && begin - p.offset[q - 1] == length && std::equal(p.particle.begin() + begin, p.particle.begin() + end, p.particle.begin() + begin - length) &&
                  std::equal(p.share.begin() + begin, p.share.begin() + end, p.share.begin() + begin - length);
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
      for (std::uint32_t f = p.offset[q]; f < e; ++f) {
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
  displacement_.resize(points_->point.size());
  for (std::size_t q = 0; q < displacement_.size(); ++q) displacement_[q] = displacement_of(q);
}

Vec3 ContactTerm::displacement_of(std::size_t q) const {
  const ContactPoints& p = *points_;
  Vec3 u = Vec3::Zero();
  for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
    u += p.share[e] * (moved_[entry_[e]] + turned_[entry_[e]].cross(arm_[e]));
  }
  const ObstacleSide side = p.pair[pair_of_[q]].obstacle;
  if (side != ObstacleSide::None) u += (side == ObstacleSide::B ? -rule_.h : rule_.h) * p.obstacle_velocity[q];
  return u;
}

Vec3 ContactTerm::slip(std::size_t q, const Vec3& u) const {
  const Vec3 v = rule_.slip_factor / rule_.h * u - (rule_.slip_factor - 1.0) * start_velocity_[q];
  const Vec3& n = points_->normal[q];
  return v - v.dot(n) * n;
}

double ContactTerm::normal_force(std::size_t q, double approach) const {
  const double pressure = offset_pressure_[q] + points_->slope[q] * approach;
  const double damping = 1.0 + points_->pair[pair_of_[q]].dissipation / rule_.h * approach;
  return points_->weight[q] * std::max(pressure, 0.0) * std::max(damping, 0.0);
}

double ContactTerm::normal_potential(std::size_t q, double approach) const {
  const double g = points_->slope[q], d = points_->pair[pair_of_[q]].dissipation / rule_.h;
  const double from = first_approach(offset_pressure_[q], g, d);
  if (!(approach > from)) return 0.0;
  const double w = points_->weight[q];
  if (from == kNoEnd) return w * offset_pressure_[q] * approach;  // neither slope nor damping
  const double t = approach - from, p = std::max(offset_pressure_[q] + g * from, 0.0), f = std::max(1.0 + d * from, 0.0);
  return w * t * (p * f + t * (0.5 * (p * d + g * f) + t * (g * d / 3.0)));
}

double ContactTerm::normal_stiffness(std::size_t q, double approach) const {
  const double g = points_->slope[q], d = points_->pair[pair_of_[q]].dissipation / rule_.h;
  const double pressure = offset_pressure_[q] + g * approach, damping = 1.0 + d * approach;
  return pressure > 0.0 && damping > 0.0 ? points_->weight[q] * (g * damping + pressure * d) : 0.0;
}

Vec3 ContactTerm::gradient_of(std::size_t q, const Vec3& u) const {
  const Vec3& n = points_->normal[q];
  Vec3 gradient = normal_force(q, u.dot(n)) * n;
  const double most = points_->pair[pair_of_[q]].friction * lagged_[q];
  if (!(most > 0.0)) return gradient;
  const Vec3 v = slip(q, u);
  const double slow = stick_speed_[pair_of_[q]], y = v.norm() / slow;
  gradient += (most / slow * (y < 1.0 ? 2.0 - y : 1.0 / y)) * v;
  return gradient;
}

Mat3 ContactTerm::hessian_of(std::size_t q, const Vec3& u, FrictionHessian friction) const {
  const Vec3& n = points_->normal[q];
  Mat3 hessian = normal_stiffness(q, u.dot(n)) * n * n.transpose();
  const double most = points_->pair[pair_of_[q]].friction * lagged_[q];
  if (!(most > 0.0)) return hessian;
  const Vec3 v = slip(q, u);
  const double speed = v.norm(), slow = stick_speed_[pair_of_[q]], y = speed / slow;
  const double scale = most * rule_.slip_factor / (rule_.h * slow);
  const double across = y < 1.0 ? 2.0 - y : 1.0 / y, along = y < 1.0 ? 2.0 - 2.0 * y : 0.0;
  hessian += scale * across * (Mat3::Identity() - n * n.transpose());
  if (speed > 0.0 && friction == FrictionHessian::Exact) hessian -= scale * (across - along) / (speed * speed) * v * v.transpose();
  return hessian;
}

ContactTerm::Traction ContactTerm::traction_of(std::size_t q, const Vec3& u) const {
  const Vec3& n = points_->normal[q];
  const double approach = u.dot(n);
  const double elastic = points_->weight[q] * std::max(offset_pressure_[q] + points_->slope[q] * approach, 0.0);
  return {-elastic * n, elastic * n - gradient_of(q, u)};
}

double ContactTerm::lag_friction(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double change = 0.0, all = 0.0;
  for (std::size_t q = 0; q < lagged_.size(); ++q) {
    const double force = normal_force(q, displacement_[q].dot(points_->normal[q]));
    change += std::abs(force - lagged_[q]);
    all += force;
    lagged_[q] = force;
  }
  scale_splits();
  return all > 0.0 ? change / all : 0.0;
}

double ContactTerm::value(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double sum = 0.0;
  for (std::size_t q = 0; q < points_->point.size(); ++q) {
    const Vec3& u = displacement_[q];
    sum += normal_potential(q, u.dot(points_->normal[q]));
    const double most = points_->pair[pair_of_[q]].friction * lagged_[q];
    if (!(most > 0.0)) continue;
    const double slow = stick_speed_[pair_of_[q]];
    sum += most * slow * rule_.h / rule_.slip_factor * mollified(slip(q, u).norm() / slow);
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
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    const Vec3 f = gradient_of(q, displacement_[q]);
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
      force[entry_[e]] += p.share[e] * f;
      torque[entry_[e]] += p.share[e] * arm_[e].cross(f);
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

void ContactTerm::spread(std::size_t q, std::size_t block, const Mat6& stiffness) {
  const ContactPoints& p = *points_;
  Mat6 whole = stiffness;
  whole.bottomLeftCorner<3, 3>() = stiffness.topRightCorner<3, 3>().transpose();
  for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
    diagonal_[entry_[e]] += p.share[e] * p.share[e] * whole;
    for (std::uint32_t f = p.offset[q]; f < e; ++f, ++block) {
      const double shares = p.share[e] * p.share[f];
      if (p.particle[e] == p.particle[f]) {
        diagonal_[block_[block]] += 2.0 * shares * whole;
      } else {
        off_diagonal_[block_[block]] += shares * whole;
      }
    }
  }
}

void ContactTerm::add_hessian(const ParticleState& pose, std::size_t first_pair, FrictionHessian friction, StepHessian& hessian) {
  if (empty()) return;
  place(pose);
  diagonal_.assign(touched_.size(), Mat6::Zero());
  off_diagonal_.assign(coupled_.size(), Mat6::Zero());
  const ContactPoints& p = *points_;
  const Vec3 origin = p.point.front();  // near all arms, so that nothing cancels
  std::size_t block = 0, first = 0;
  Mat6 sum = Mat6::Zero();  // of points with the same particles and shares, from `first` on
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    if (q > 0 && !as_last_[q]) {
      spread(first, block, sum);
      const std::size_t length = p.offset[first + 1] - p.offset[first];
      block += (q - first) * (length * (length - 1) / 2);
      first = q;
      sum.setZero();
    }
    const Mat3 k = hessian_of(q, displacement_[q], friction);
    const Mat3 cross = cross_matrix(p.point[q] - origin), k_cross = k * cross;
    sum.topLeftCorner<3, 3>() += k;
    sum.topRightCorner<3, 3>() -= k_cross;
    sum.bottomRightCorner<3, 3>() -= cross * k_cross;
  }
  spread(first, block, sum);
  // Twists about `origin` from the displacement and the rotation of each particle.
  std::vector<Mat6> map(touched_.size());
  std::vector<Vec3> centre(touched_.size(), origin);
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) centre[entry_[e]] = p.point[q] - arm_[e];
  }
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

double ContactTerm::stick_ratio(const Eigen::VectorXd& correction) const {
  if (empty()) return 0.0;
  const ContactPoints& p = *points_;
  double largest2 = 0.0;
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    if (!(p.pair[pair_of_[q]].friction * lagged_[q] > 0.0)) continue;
    Vec3 u = Vec3::Zero();
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
      const auto row = static_cast<Eigen::Index>(6) * p.particle[e];
      u += p.share[e] * (correction.segment<3>(row) + correction.segment<3>(row + 3).cross(arm_[e]));
    }
    const double slow = stick_speed_[pair_of_[q]];
    largest2 = std::max(largest2, (u - u.dot(p.normal[q]) * p.normal[q]).squaredNorm() / (slow * slow));
  }
  return std::sqrt(largest2) * rule_.slip_factor / rule_.h;
}

void ContactTerm::finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger, std::vector<ContactPairLoad>& pairs) {
  pairs.assign(points_ != nullptr ? points_->pair.size() : 0, {});
  if (empty()) return;
  place(pose);
  const ContactPoints& p = *points_;
  for (std::size_t q = 0; q < p.point.size(); ++q) {
    const Vec3 u = displacement_[q];
    const Traction traction = traction_of(q, u);
    const Vec3 f = traction.force + traction.dissipative;
    for (std::uint32_t e = p.offset[q]; e < p.offset[q + 1]; ++e) {
      const std::uint32_t i = p.particle[e];
      loads.force[i] += p.share[e] * f;
      loads.torque[i] += p.share[e] * (p.point[q] - pose.position[i]).cross(f);
    }
    // The impulse does the work of the mean of the velocities before and after it.
    const Vec3 v = 0.5 * (rule_.end_factor / rule_.h * u + (2.0 - rule_.end_factor) * start_velocity_[q]);
    const double dissipated = -dt * traction.dissipative.dot(v);
    ContactPairLoad& pair = pairs[pair_of_[q]];
    pair.force += f;
    pair.dissipated += dissipated;
    ledger.dissipated += dissipated;
    const ObstacleSide side = p.pair[pair_of_[q]].obstacle;
    if (side == ObstacleSide::None) continue;
    const Vec3 on_moving = side == ObstacleSide::B ? f : Vec3(-f);
    ledger.external_impulse += dt * on_moving;
    ledger.external_angular_impulse += dt * p.point[q].cross(on_moving);
    ledger.external_work += dt * on_moving.dot(p.obstacle_velocity[q]);
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
