#include "supple/core/integrators.h"

#include "implicit_step.h"
#include "runge_kutta.h"
#include "supple/core/error.h"

namespace supple::core {

struct IntegratorWorkspace::Impl {
  RungeKuttaBuffers runge_kutta;
  ImplicitBuffers implicit;
};

IntegratorWorkspace::IntegratorWorkspace() : impl_(std::make_unique<Impl>()) {}
IntegratorWorkspace::~IntegratorWorkspace() = default;
IntegratorWorkspace::IntegratorWorkspace(IntegratorWorkspace&&) noexcept = default;
IntegratorWorkspace& IntegratorWorkspace::operator=(IntegratorWorkspace&&) noexcept = default;

StepReport advance(const IntegratorSettings& settings, const ParticleSet& set, const Interactions& interactions,
                   const ForceModel& forces, double time, double dt, ParticleState& state, KickState& kick,
                   Ledger& ledger, const Executor& executor, InteractionWorkspace& pairs,
                   IntegratorWorkspace& workspace) {
  SUPPLE_EXPECTS(dt > 0.0 && state.size() == set.size());
  SUPPLE_EXPECTS(settings.tolerance > 0.0 && settings.length > 0.0 && settings.max_substeps > 0 && settings.max_iterations > 0);
  switch (settings.method) {
    case Integrator::Symplectic: {
      const int evaluations = kick.valid ? 1 : 2;
      advance(set, interactions, forces, time, dt, state, kick, ledger, settings.rotation);
      return {.substeps = 1, .force_evaluations = evaluations};
    }
    case Integrator::BackwardEuler:
    case Integrator::ImplicitMidpoint:
      return advance_implicit(settings, set, interactions, forces, time, dt, state, kick, ledger, executor,
                              pairs, workspace.impl().implicit);
    case Integrator::RungeKutta4:
    case Integrator::Adaptive: break;
  }
  return advance_runge_kutta(settings, set, interactions, forces, time, dt, state, kick, ledger,
                             workspace.impl().runge_kutta);
}

}  // namespace supple::core
