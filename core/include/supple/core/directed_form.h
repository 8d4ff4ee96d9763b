/// @file supple/core/directed_form.h
/// Shape memory with a curvature that depends on direction (Lombardo & Puech 1995 leave it as future work).
#pragma once

#include <span>

#include "supple/core/pair_laws.h"

namespace supple::core {

/// The form interaction with a shape operator in place of one curvature: U = k psi(d) / d^2 |S r + n_A - n_B|^2, S the
/// mean of S_A and S_B, which turn with their particles. For outward normals dn = S dx on the rest surface, so that
/// S = I / R on a sphere and t . S t is the curvature along a unit tangent t (Euler). With S = kappa I this is `Form`.
/// A tangential S leaves displacements along the normals free: combine it with co-circularity.
struct DirectedForm {
  double strength = 0.0;       ///< k [J m^2]
  Mat3 shape_a = Mat3::Zero(); ///< S_A in the body axes of A [1/m], symmetric
  Mat3 shape_b = Mat3::Zero(); ///< S_B in the body axes of B [1/m], symmetric
  Weight weight;
};

/// Shape operator at a particle from its neighbours, in world axes [1/m]: the symmetric, tangential S that minimises
/// sum |P dn - S P dx|^2, P the projection along the normal. Neighbours in one direction only leave S partly free; then
/// the smallest such S is taken.
/// @param offsets  dx to the neighbours [m], shape [m]
/// @param normal_changes  dn of the unit normals, shape [m]
[[nodiscard]] Mat3 fit_shape_operator(const Vec3& normal, std::span<const Vec3> offsets,
                                      std::span<const Vec3> normal_changes);

/// @pre d > 0
[[nodiscard]] PairLoad evaluate(const DirectedForm& law, const PairPose& pose);
[[nodiscard]] Stiffness stiffness(const DirectedForm& law, double rest_distance);

}  // namespace supple::core
