/// @file supple/core/integrators.h
/// The integrators by name, behind one `advance`. What each one is good for:
///
/// | method           | order | limit omega dt | keeps                                                               |
/// |------------------|-------|----------------|---------------------------------------------------------------------|
/// | Symplectic       | 2     | 2              | momentum, angular momentum; energy without drift                    |
/// | RungeKutta4      | 4     | 2.83           | momentum; angular momentum and energy to its order                  |
/// | Adaptive         | 5     | by tolerance   | the same; the step follows the error of Dormand & Prince 1980       |
///
/// Omega is the largest angular frequency [rad/s]. Damping enters `Symplectic` by exact or implicit half steps
/// (integrate.h) and the Runge-Kutta methods as forces, so that their order holds.
#pragma once

#include <memory>

#include "supple/core/executor.h"
#include "supple/core/integrate.h"

namespace supple::core {

enum class Integrator : std::uint8_t { Symplectic, RungeKutta4, Adaptive };

struct IntegratorSettings {
  Integrator method = Integrator::Symplectic;
  RotationUpdate rotation = RotationUpdate::Splitting;  ///< of `Symplectic`
  /// Adaptive: largest local error of a substep, of positions over `length` and of angles in radians [1].
  double tolerance = 1e-6;
  double length = 1.0;      ///< what errors of position are relative to [m]
  double first_step = 0.0;  ///< Adaptive: first substep tried [s]; 0: the whole step
  int max_substeps = 4096;  ///< Adaptive: a substep of dt / max_substeps is taken whatever its error
};

/// What a step needed; the caller decides what is too much.
struct StepReport {
  int substeps = 0;         ///< accepted
  int rejected = 0;         ///< tried and taken back
  int force_evaluations = 0;
  bool within_tolerance = true;  ///< false: some substep was taken at the smallest size with a larger error
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

/// One step of size dt by the chosen method. Books work, dissipation and impulses to `ledger` by the quadrature of the
/// method. The substep that `Adaptive` would try next is kept in `kick`, so that a run continues with the same bits.
/// Deterministic: substeps follow from the state alone. Allocates nothing after the first step.
StepReport advance(const IntegratorSettings& settings, const ParticleSet& set, const Interactions& interactions,
                   const ForceModel& forces, double time, double dt, ParticleState& state, KickState& kick,
                   Ledger& ledger, IntegratorWorkspace& workspace);

}  // namespace supple::core
