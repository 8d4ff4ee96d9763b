/// @file energy_loads.h
/// What reactions, implicit steps and hard cores share of how a body's parts take part: contributions, velocities, and the elastic loads on the parts, which are
/// the gradient of the contact energy over the squeezed region.
#pragma once

#include "supple/collision/contact_surface.h"
#include "supple/collision/linearise.h"

namespace supple::collision {

/// Half-open range of the entries of a sorted list that equal k.
struct Range {
  std::size_t begin = 0, end = 0;
};
[[nodiscard]] Range advance_range(const std::vector<std::uint32_t>& sorted, std::size_t begin, std::uint32_t k);

/// Velocity of the point of a part that is at x [m/s]; zero where the body has no motion.
[[nodiscard]] Vec3 velocity_of(const ContactBody& body, std::size_t part, const Vec3& x);

/// By what share each part of a body contributes to its field at points; the shares of a point sum to one.
void contributions_at(const ContactBody& body, std::span<const Vec3> points, implicit::FieldParts& out);

/// Columns of the squeezed regions of a pair.
struct Squeezed {
  std::span<const Vec3> point;
  std::span<const double> weight;
  std::span<const std::uint8_t> side;  ///< 0: in A, 1: in B
};
[[nodiscard]] Squeezed squeezed_of(const ContactSurface& surface, const Range& volume);

/// Adds to each part of a body F_k, the integral of grad p_k over its squeezed region, and the torque about the part's centre
/// (react.h). @param side  of the body  @return false: the region has no columns
bool add_energy_loads(const ContactBody& body, const Squeezed& volume, std::uint8_t side, EnergyScratch& scratch, std::span<Vec3> force,
                      std::span<Vec3> torque);

}  // namespace supple::collision
