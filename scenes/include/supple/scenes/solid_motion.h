/// @file supple/scenes/solid_motion.h
/// How an obstacle is led along: keyed places joined in time.
#pragma once

#include <vector>

#include "supple/core/types.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

struct SolidMotion {
  std::vector<ObstacleKeyDesc> keys;   ///< rising in time
  LeadName between = LeadName::Smooth;
  Vec3 axis = Vec3::UnitZ();           ///< that it turns about, of unit length
};

struct SolidPlace {
  Pose pose;
  Vec3 velocity = Vec3::Zero();  ///< of pose.position [m/s]
  Vec3 spin = Vec3::Zero();      ///< world axes [rad/s]
};

/// Smooth: monotone cubic pieces (Fritsch & Butland 1984), continuous in velocity, at rest at the first and the last key and
/// wherever a coordinate turns back. Linear: an even velocity from key to key. Beyond the keys it stands still.
/// @pre motion.keys is not empty
[[nodiscard]] SolidPlace place_at(const SolidMotion& motion, double time);

/// Whether it is led along at any time in [from, to].
[[nodiscard]] bool moves(const SolidMotion& motion, double from, double to);

/// Bound of the speed of a point of a solid within `radius` of its place [m/s].
[[nodiscard]] double largest_speed(const SolidMotion& motion, double radius);

}  // namespace supple::scenes
