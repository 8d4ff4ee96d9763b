/// @file supple/core/types.h
/// The vocabulary of every module: vectors, rotations, boxes, intervals. SI units throughout; double everywhere.
/// Quaternions are stored x, y, z, w, map body to world, and compose by the Hamilton product.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

namespace supple {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
/// Unaligned, so that the layout does not depend on the instruction set a caller compiles for.
using Quat = Eigen::Quaternion<double, Eigen::DontAlign>;

/// A position and an orientation: x_world = orientation * x_body + position.
struct Pose {
  Vec3 position = Vec3::Zero();        ///< [m]
  Quat orientation = Quat::Identity(); ///< body to world, unit length

  [[nodiscard]] Vec3 to_world(const Vec3& body_point) const { return orientation * body_point + position; }
  [[nodiscard]] Vec3 to_body(const Vec3& world_point) const { return orientation.conjugate() * (world_point - position); }
};

/// Closed axis-aligned box; empty when any lower bound exceeds its upper bound.
struct Box {
  Vec3 lower = Vec3::Constant(std::numeric_limits<double>::infinity());   ///< [m]
  Vec3 upper = Vec3::Constant(-std::numeric_limits<double>::infinity());  ///< [m]

  [[nodiscard]] bool empty() const { return !(lower.array() <= upper.array()).all(); }
  [[nodiscard]] Vec3 centre() const { return 0.5 * (lower + upper); }
  [[nodiscard]] Vec3 extent() const { return upper - lower; }
  [[nodiscard]] bool contains(const Vec3& p) const {
    return (lower.array() <= p.array()).all() && (p.array() <= upper.array()).all();
  }
  [[nodiscard]] bool overlaps(const Box& b) const {
    return (lower.array() <= b.upper.array()).all() && (b.lower.array() <= upper.array()).all();
  }
  [[nodiscard]] Box intersection(const Box& b) const { return {lower.cwiseMax(b.lower), upper.cwiseMin(b.upper)}; }
  [[nodiscard]] Box united(const Box& b) const { return {lower.cwiseMin(b.lower), upper.cwiseMax(b.upper)}; }
  [[nodiscard]] Box inflated(double margin) const {
    return {lower - Vec3::Constant(margin), upper + Vec3::Constant(margin)};
  }
  void include(const Vec3& p) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
};

/// Closed interval [lower, upper].
struct Interval {
  double lower = 0.0;
  double upper = 0.0;
  [[nodiscard]] bool contains(double x) const { return lower <= x && x <= upper; }
};

}  // namespace supple
