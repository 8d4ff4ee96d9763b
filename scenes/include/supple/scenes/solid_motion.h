/// @file supple/scenes/solid_motion.h
/// Motion of an obstacle: interpolation of keyed positions in time.
#pragma once

#include <vector>

#include "supple/core/types.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

struct SolidMotion {
  std::vector<ObstacleKeyDesc> keys;   ///< rising in time
  LeadName between = LeadName::Smooth;
  Vec3 axis = Vec3::UnitZ();           ///< of rotation, unit length
};

struct SolidPlace {
  Pose pose;
  Vec3 velocity = Vec3::Zero();  ///< of pose.position [m/s]
  Vec3 spin = Vec3::Zero();      ///< world axes [rad/s]
};

/// Smooth: monotone cubic pieces (Fritsch & Butland 1984), continuous in velocity, at rest at the first and the last key and
/// wherever a coordinate turns back. Linear: constant velocity from key to key. Beyond the keys it is at rest.
/// @pre motion.keys is not empty
[[nodiscard]] SolidPlace place_at(const SolidMotion& motion, double time);

/// Whether it moves at any time in [from, to].
[[nodiscard]] bool moves(const SolidMotion& motion, double from, double to);

/// Bound of the speed of points of a solid within `radius` of its position [m/s].
[[nodiscard]] double largest_speed(const SolidMotion& motion, double radius);

}  // namespace supple::scenes
