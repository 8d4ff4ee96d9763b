/// @file panel_levels.h
/// What bounds or breaks a patch of Sigma: functions that are positive on one side. The rim, the walls of a cell, third bodies and kinks of the fields
/// are the same to an integrator, but that kinks count on both sides.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/implicit/kinks.h"
#include "surface/panels/sigma_rays.h"

namespace supple::collision {

/// A third body, which takes what it presses harder on.
struct ThirdLevel {
  const ContactBody* body;
  bool yields;  ///< where it presses just as hard, the pair keeps Sigma
};

/// The level functions of a pair: the rim, a cell's two walls, third bodies, kinks; numbered in this order.
struct Levels {
  std::span<const ThirdLevel> third;
  std::span<const implicit::Kink> kink;

  static constexpr std::uint16_t kRim = 0, kLowWall = 1, kHighWall = 2, kFirstThird = 3;
  [[nodiscard]] std::uint16_t first_kink() const { return static_cast<std::uint16_t>(kFirstThird + third.size()); }
  [[nodiscard]] bool is_kink(std::uint16_t level) const { return level >= first_kink(); }
  [[nodiscard]] bool is_third(std::uint16_t level) const { return level >= kFirstThird && level < first_kink(); }
};

/// A level function at the foot of a ray, and its slopes along Sigma over the plane of the ray.
struct LevelValue {
  double value = 0.0;
  std::array<double, 2> slope{};
};

/// A level that is asked for at a ray.
struct LevelQuery {
  std::uint32_t ray;
  std::uint16_t level;
  std::array<double, 2> wall;  ///< heights of the cell's walls
};

/// Room of `evaluate_levels`.
struct LevelScratch {
  std::vector<std::uint32_t> which;
  std::vector<Vec3> point, gradient;
  std::vector<double> value;
};

/// At the heights of the rays. The rim of a ray without a foot is negative, with no slope.
void evaluate_levels(const Levels& levels, const SigmaView& view, std::span<const SigmaRay> rays, std::span<const LevelQuery> queries, LevelScratch& scratch,
                     std::span<LevelValue> out);

}  // namespace supple::collision
