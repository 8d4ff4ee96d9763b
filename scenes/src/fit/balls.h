/// @file balls.h
/// Balls of the medial axis: the largest ones that touch a surface from inside, and few of them that cover it.
#pragma once

#include <span>
#include <vector>

#include "fit/point_tree.h"
#include "fit/samples.h"

namespace supple::fit {

struct Ball {
  Vec3 centre = Vec3::Zero();
  double radius = 0.0;
};

/// For each sample the radius of the largest ball that touches the surface there and holds no other sample deeper than `slack`, by shrinking (Ma, Bae & Choi
/// 2012). @param side  -1: from inside, 1: from outside   @param most  largest radius
[[nodiscard]] std::vector<double> touching_radii(const SurfaceSamples& surface, const PointTree& tree, double side, double most, double slack, const Executor& executor);

/// Few balls that touch the surface from inside at samples, so that each of the samples `wanted` lies within `reach` of one: always the ball of most samples not
/// yet covered; of equal ones the first.
[[nodiscard]] std::vector<Ball> cover_surface(const SurfaceSamples& surface, const PointTree& tree, std::span<const double> radius, std::span<const std::uint32_t> wanted, double reach);

/// Further balls around points of the lattice inside, the deepest first, until each lies in one. @param most  largest radius
void cover_inside(const Surroundings& around, double most, std::vector<Ball>& balls);

}  // namespace supple::fit
