#include "supple/core/integrators.h"

#include "integrate/implicit_step.h"
#include "integrate/runge_kutta.h"
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

StepReport advance(const IntegratorSettings& settings, const StepProblem& problem, double time, double dt, const StepTarget& target,
                   const StepTools& tools) {
  SUPPLE_EXPECTS(dt > 0.0 && target.state.size() == problem.set.size());
  SUPPLE_EXPECTS(settings.tolerance > 0.0 && settings.length > 0.0 && settings.max_substeps > 0 && settings.max_iterations > 0);
  SUPPLE_EXPECTS(problem.contact == nullptr || is_implicit(settings.method));
  switch (settings.method) {
    case Integrator::Symplectic: {
      const int evaluations = target.kick.valid ? 1 : 2;
      advance(problem, time, dt, target, settings.rotation);
      return {.substeps = 1, .force_evaluations = evaluations};
    }
    case Integrator::BackwardEuler:
    case Integrator::ImplicitMidpoint:
      return advance_implicit(settings, problem, {time, dt}, target, tools, tools.workspace.impl().implicit);
    case Integrator::RungeKutta4:
    case Integrator::Adaptive: break;
  }
  return advance_runge_kutta(settings, problem, time, dt, target, tools.workspace.impl().runge_kutta);
}

}  // namespace supple::core
