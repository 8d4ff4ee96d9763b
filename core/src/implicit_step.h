// Backward Euler and the implicit midpoint rule.
#pragma once

#include <utility>
#include <vector>

#include "step_hessian.h"
#include "supple/core/integrators.h"

namespace supple::core {

struct ImplicitBuffers {
  ForceSample sample;
  Loads laws;       ///< of the pair laws
  Loads unused;     ///< external loads that the pair laws come with
  Loads frozen;     ///< all loads outside the pair laws
  ParticleState flight;  ///< after free flight under the frozen loads
  ParticleState pose;
  ParticleState trial;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> bonded;
  std::vector<PairHessian> blocks;
  StepHessian hessian;
  StepSolver solver;
  Eigen::VectorXd gradient;
  Eigen::VectorXd correction;
};

StepReport advance_implicit(const IntegratorSettings& settings, const ParticleSet& set,
                            const Interactions& interactions, const ForceModel& forces, double time, double dt,
                            ParticleState& state, KickState& kick, Ledger& ledger, const Executor& executor,
                            InteractionWorkspace& pairs, ImplicitBuffers& buffers);

}  // namespace supple::core
