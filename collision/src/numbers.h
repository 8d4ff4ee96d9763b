/// @file numbers.h
/// Numbers that many files need.
#pragma once

#include <limits>
#include <numbers>

namespace supple::collision {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
inline constexpr double kTurn = 2.0 * std::numbers::pi;  ///< [rad]

}  // namespace supple::collision
