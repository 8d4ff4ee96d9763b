/// @file supple/core/pair_hessian.h
/// Second derivatives of the pair laws, for implicit integration and for modes about a rest shape.
#pragma once

#include "supple/core/cohesion_variants.h"
#include "supple/core/directed_form.h"
#include "supple/core/gay_berne.h"
#include "supple/core/lennard_jones.h"
#include "supple/core/pair_laws.h"

namespace supple::core {

/// Second derivatives of U along q = (dx_A, dtheta_A, dx_B, dtheta_B), 12 x 12 and symmetric, with rotations
/// Q <- exp([dtheta]) Q in world axes: U(q) = U(0) - F . dx - tau . dtheta + q^T H q / 2 + O(|q|^3).
/// Units by block: [N/m] for dx dx, [N/rad] for dx dtheta, [N m/rad] for dtheta dtheta.
/// Rotations do not commute, so the derivative of a torque is not symmetric: -d tau / d theta = H + [tau] / 2 in the
/// diagonal block of a particle, [tau] being the matrix of the cross product.
using PairHessian = Eigen::Matrix<double, 12, 12, Eigen::DontAlign>;

/// Exact, or a positive semi-definite matrix near it for Newton's method on a step. Of a sum of squares k |e|^2, the
/// weight included in e, that is 2 k J^T J with J = de/dq (Gauss-Newton), exact where e = 0. Of a central law both
/// coefficients U'' and U'/d are raised to 0 where negative.
enum class HessianKind : std::uint8_t { Exact, PositiveSemiDefinite };

/// @pre d > 0
[[nodiscard]] PairHessian hessian(const Cohesion& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const Form& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const FormRadius& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const BondFrame& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const Coplanarity& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const NormalisedCoplanarity& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const CoNormality& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const CoCircularity& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const NormalisedCoCircularity& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const LennardJones& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const LinearCohesion& law, const PairPose& pose, HessianKind kind);
/// Positive semi-definite: W'' J^T J with J = ds/dq and W'' raised to 0.
[[nodiscard]] PairHessian hessian(const DirectedCohesion& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const TabulatedCohesion& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const DirectedForm& law, const PairPose& pose, HessianKind kind);
/// Positive semi-definite: f'' J^T J with J the derivative of the gap d - sigma_12 and f'' raised to 0, f being the
/// potential of the gap.
[[nodiscard]] PairHessian hessian(const SwitchedGayBerne& law, const PairPose& pose, HessianKind kind);
[[nodiscard]] PairHessian hessian(const Repulsion& law, const PairPose& pose, HessianKind kind);

}  // namespace supple::core
