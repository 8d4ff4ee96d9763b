/// @file supple/collision/linearise.h
/// The contact surface as implicit steps see it: at each quadrature point the pressure, its slope in the approach of the two
/// bodies, and the shares of their parts. For parallel layers p = g_A d_A = g_B d_B with d_A + d_B the depth, so the pressure rises
/// by g = g_A g_B / (g_A + g_B) per length of approach, g_i the slope of p_i along the normal. Parts share a point's motion and force
/// by their contributions f_k / f (Desbrun & Gascuel 1995), so that the two bodies' forces and moments cancel exactly. The elastic force is
/// the gradient of the energy of contact all the same (react.h): what it does to the parts beyond these shares is added pair by pair.
#pragma once

#include <span>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"
#include "supple/collision/react.h"
#include "supple/core/compliant_contact.h"
#include "supple/core/executor.h"

namespace supple::collision {

/// Buffers of one squeezed region; reused.
struct EnergyScratch {
  std::vector<Vec3> point;
  std::vector<double> weight;  ///< times the modulus [N m]
  implicit::FieldParts rows;
};

/// Buffers of `linearise_contacts`; reused.
struct LineariseScratch {
  std::vector<double> value;
  std::vector<Vec3> gradient_a, gradient_b;
  implicit::FieldParts parts_a, parts_b;
  EnergyScratch energy;
  std::vector<Vec3> force, torque;     ///< of the parts of one body
  std::vector<double> share;
};

/// @param in  `settings.split` and the surface; friction acts by Coulomb's law without springs
/// @param particles  of each body: the particle of each of its parts; empty for fixed bodies  @param out  replaced; its pairs are those of
/// `surface.summary`, so that pairs without points are empty ones
void linearise_contacts(const ReactionInputs& in, std::span<const std::span<const std::uint32_t>> particles, LineariseScratch& scratch,
                        core::ContactPoints& out);

}  // namespace supple::collision
