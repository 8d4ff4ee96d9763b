/// @file supple/core/integrators.h
/// The integrators by name, called through one `advance`. Properties:
///
/// | method           | order | limit omega dt | conserves                                                              |
/// |------------------|-------|----------------|---------------------------------------------------------------------|
/// | Symplectic       | 2     | 2              | momentum, angular momentum; energy without drift                    |
/// | RungeKutta4      | 4     | 2.83           | momentum; angular momentum and energy to its order                  |
/// | Adaptive         | 5     | by tolerance   | the same; the step follows the error of Dormand & Prince 1980       |
/// | BackwardEuler    | 1     | none           | momentum; damps a mode of frequency omega by the ratio omega dt / 2 |
/// | ImplicitMidpoint | 2     | none           | momentum, angular momentum; quadratic energies                      |
///
/// Omega is the largest angular frequency [rad/s]. Damping enters the Runge-Kutta methods as forces, so that their order
/// holds; Symplectic takes implicit half steps of it (integrate.h). The implicit methods minimise friction between particles and stiffness damping with
/// the rest, and take exact half steps of the drag of a medium.
///
/// Backward Euler takes the pose that minimises the incremental potential (e.g. Martin et al. 2011, eq. 4)
///   Pi = 1/(2 h^2) sum_i (m |x - x~|^2 + delta^T I delta) + U(x, q),   delta = log(q~^-1 q) in body axes,
/// with x~, q~ the free motion over h under the loads outside U; implicit midpoint uses it with h = dt/2 as its midpoint
/// and continues by the mirrored half step. The minimum is computed by Newton's method with the Hessians of the pair laws
/// and a line search. Contact is a part of the potential (compliant_contact.h): it is found once per step, at the pose that free
/// motion under the external loads leads to, and is linear about it. Other loads that are not in `Interactions` are constant over the
/// step: taken at its start in backward Euler, in the middle of the free motion in the midpoint rule.
#pragma once

#include <memory>

#include "supple/core/compliant_contact.h"
#include "supple/core/executor.h"
#include "supple/core/integrate.h"

namespace supple::core {

enum class Integrator : std::uint8_t { Symplectic, RungeKutta4, Adaptive, BackwardEuler, ImplicitMidpoint };

[[nodiscard]] constexpr bool is_implicit(Integrator method) {
  return method == Integrator::BackwardEuler || method == Integrator::ImplicitMidpoint;
}

struct IntegratorSettings {
  Integrator method = Integrator::Symplectic;
  RotationUpdate rotation = RotationUpdate::Splitting;  ///< of `Symplectic`
  /// Adaptive: largest local error of a substep. Implicit methods: Newton's method ends with the first correction that is not
  /// larger. Of positions over `length` and of angles in radians [1].
  double tolerance = 1e-6;
  double length = 1.0;        ///< length that errors of position are relative to [m]
  double first_step = 0.0;    ///< Adaptive: first substep tried [s]; 0: the whole step
  int max_substeps = 4096;    ///< Adaptive: a substep of dt / max_substeps is accepted with any error
  int max_iterations = 50;    ///< of Newton's method
  int direct_unknowns = 12000;  ///< larger systems are solved by conjugate gradients instead of a Cholesky factor
};

/// Work of a step; the caller decides on limits.
struct StepReport {
  std::int64_t substeps = 0;           ///< accepted
  std::int64_t rejected = 0;           ///< trial substeps that were discarded
  std::int64_t force_evaluations = 0;  ///< calls of the force model
  bool within_tolerance = true;  ///< false: a substep of the smallest size, or Newton's method, ended with a larger error
  std::int64_t newton_iterations = 0;
  std::int64_t gradient_iterations = 0;  ///< of conjugate gradients, in total
  double last_correction = 0.0;  ///< size of the last Newton step, as `tolerance` measures it [1]
};

/// Buffers of the integrators; capacity is kept between steps. Frame data.
class IntegratorWorkspace {
 public:
  IntegratorWorkspace();
  ~IntegratorWorkspace();
  IntegratorWorkspace(IntegratorWorkspace&&) noexcept;
  IntegratorWorkspace& operator=(IntegratorWorkspace&&) noexcept;
  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Tools of a step. `pairs` is the workspace of `StepProblem::interactions`; the implicit methods use it.
struct StepTools {
  const Executor& executor;
  InteractionWorkspace& pairs;
  IntegratorWorkspace& workspace;
};

/// About the fastest rate at which friction between particles and stiffness damping take velocities of a pair [1/s]. Methods with half steps of damping
/// relax what is damped faster than dt at a rate of their own; the implicit ones do not.
[[nodiscard]] double largest_damping_rate(const ParticleSet& set, const ParticleState& rest, const Interactions& interactions);

/// One step of size dt by the chosen method. Books work, dissipation and impulses to the ledger by the quadrature of the
/// method. The next trial substep of `Adaptive` is kept in `kick`, so that a run continues with the same bits.
/// Momentum is exact in every method: velocities change by the loads alone, not by the residual of Newton's method.
/// Deterministic: substeps and iterations follow from the state alone. The explicit methods allocate nothing after the
/// first step.
StepReport advance(const IntegratorSettings& settings, const StepProblem& problem, double time, double dt, const StepTarget& target,
                   const StepTools& tools);

}  // namespace supple::core
