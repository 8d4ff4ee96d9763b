#include "integrate/damping_term.h"

#include <algorithm>

#include "integrate/contact_term.h"
#include "laws/damping.h"
#include "supple/core/integrators.h"

namespace supple::core {
namespace {

/// About the fastest rate at which a damping matrix takes velocities of a pair [1/s].
double rate_of(const ParticleSet& set, std::uint32_t a, std::uint32_t b, const PairHessian& d) {
  double largest = 0.0;
  for (const auto& [i, row] : {std::pair{a, 0}, std::pair{b, 6}}) {
    const Eigen::Matrix<double, 12, 1, Eigen::DontAlign> diagonal = d.diagonal();
    if ((set.pinned[i] & kPinPosition) == 0) largest = std::max(largest, diagonal.segment<3>(row).maxCoeff() / set.mass[i]);
    if ((set.pinned[i] & kPinOrientation) == 0) largest = std::max(largest, diagonal.segment<3>(row + 3).maxCoeff() / set.inertia[i].minCoeff());
  }
  return 2.0 * largest;  // both particles take part
}

}  // namespace

double largest_damping_rate(const ParticleSet& set, const ParticleState& rest, const Interactions& interactions) {
  double largest = 0.0;
  for_each_damping(set, rest, interactions,
                   [&](std::uint32_t a, std::uint32_t b, const PairHessian& d) { largest = std::max(largest, rate_of(set, a, b, d)); });
  return largest;
}

void DampingTerm::begin(const ParticleSet& set, const Interactions& interactions, const ParticleState& start, const ParticleState& predicted,
                        double h, bool midpoint) {
  constexpr double kBeyondMiddle = 0.1;
  start_ = &start;
  h_ = h;
  midpoint_ = midpoint;
  placed_ = {};
  clear();
  double z = 0.0;
  for_each_damping(set, predicted, interactions, [&](std::uint32_t a, std::uint32_t b, const PairHessian& d) {
    Damped damped{.matrix = d};
    damped.start << start.velocity[a], angular_velocity(set, start, a), start.velocity[b], angular_velocity(set, start, b);
    pair_.push_back(damped);
    coupled_.emplace_back(a, b);
    z = std::max(z, h * rate_of(set, a, b, d));
  });
  factor_ = midpoint ? 1.0 + kBeyondMiddle * z * z / (1.0 + z * z) : 1.0;
}

void DampingTerm::place(const ParticleState& pose) {
  const auto same = [](const Quat& a, const Quat& b) { return a.coeffs() == b.coeffs(); };
  if (placed_.position == pose.position && std::equal(placed_.orientation.begin(), placed_.orientation.end(), pose.orientation.begin(), pose.orientation.end(), same)) {
    return;
  }
  placed_.position = pose.position;
  placed_.orientation = pose.orientation;
  moved_.resize(pose.size());
  turned_.resize(pose.size());
  for (std::size_t i = 0; i < pose.size(); ++i) {
    moved_[i] = pose.position[i] - start_->position[i];
    turned_[i] = rotation_log(pose.orientation[i] * start_->orientation[i].conjugate());
  }
}

DampingTerm::Vec12 DampingTerm::moved(std::size_t k) const {
  const auto [a, b] = coupled_[k];
  Vec12 s;
  s << moved_[a], turned_[a], moved_[b], turned_[b];
  return s;
}

double DampingTerm::value(const ParticleState& pose) {
  if (empty()) return 0.0;
  place(pose);
  double sum = 0.0;
  for (std::size_t k = 0; k < pair_.size(); ++k) {
    const Vec12 v = velocity(pair_[k], moved(k));
    sum += v.dot(pair_[k].matrix.lazyProduct(v));
  }
  return 0.5 * h_ / factor_ * sum;
}

void DampingTerm::add_gradient(const ParticleState& pose, Eigen::VectorXd& gradient) {
  if (empty()) return;
  place(pose);
  std::vector<Vec3> force(pose.size(), Vec3::Zero()), torque(pose.size(), Vec3::Zero());
  for (std::size_t k = 0; k < pair_.size(); ++k) {
    const auto [a, b] = coupled_[k];
    const Vec12 load = pair_[k].matrix.lazyProduct(velocity(pair_[k], moved(k)));
    force[a] += load.segment<3>(0);
    torque[a] += load.segment<3>(3);
    force[b] += load.segment<3>(6);
    torque[b] += load.segment<3>(9);
  }
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(6 * i);
    gradient.segment<3>(row) += force[i];
    // As in contact: d psi / d phi of psi = log(exp(phi) exp(psi)) is J_r^-1(-psi).
    gradient.segment<3>(row + 3) += inverse_right_jacobian(-turned_[i]).transpose() * torque[i];
  }
}

void DampingTerm::add_hessian(std::size_t first_pair, StepHessian& hessian) const {
  for (std::size_t k = 0; k < pair_.size(); ++k) hessian.add_pair(first_pair + k, factor_ / h_ * pair_[k].matrix);
}

void DampingTerm::finish(const ParticleState& pose, double dt, Loads& loads, Ledger& ledger) {
  if (empty()) return;
  place(pose);
  for (std::size_t k = 0; k < pair_.size(); ++k) {
    const auto [a, b] = coupled_[k];
    const Vec12 s = moved(k), load = -pair_[k].matrix.lazyProduct(velocity(pair_[k], s));
    const Vec3 force = load.segment<3>(6);
    // The moment of the two forces at the pose itself; D has that of the predicted one.
    const Vec3 rest = 0.5 * (load.segment<3>(3) + load.segment<3>(9) + (pose.position[b] - pose.position[a]).cross(force));
    loads.force[a] -= force;
    loads.force[b] += force;
    loads.torque[a] += load.segment<3>(3) - rest;
    loads.torque[b] += load.segment<3>(9) - rest;
    // An impulse does the work of the mean of the velocities before and after it.
    const Vec12 mean = midpoint_ ? Vec12(s / h_) : Vec12(0.5 * (s / h_ + pair_[k].start));
    ledger.dissipated -= dt * load.dot(mean);
  }
}

}  // namespace supple::core
