// Backward Euler and the implicit midpoint rule.
#pragma once

#include <utility>
#include <vector>

#include "integrate/contact_term.h"
#include "integrate/damping_term.h"
#include "integrate/step_hessian.h"
#include "supple/core/integrators.h"

namespace supple::core {

struct ImplicitBuffers {
  ForceSample sample;
  Loads laws;       ///< of the pair laws; at the end of damping and contact, too
  Loads frozen;     ///< all loads outside the pair laws
  ParticleState flight;  ///< after free flight under the frozen loads
  ParticleState start;   ///< after the first half of the drag of a medium
  ParticleState pose;
  ParticleState trial;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> bonded;
  std::vector<PairHessian> blocks;
  ContactPoints points;
  ContactTerm contact;
  DampingTerm damping;
  StepHessian hessian;
  StepSolver solver;
  Eigen::VectorXd gradient;
  Eigen::VectorXd correction;
};

/// The start and the length of a step [s].
struct StepSpan {
  double time, dt;
};

StepReport advance_implicit(const IntegratorSettings& settings, const StepProblem& problem, const StepSpan& span,
                            const StepTarget& target, const StepTools& tools, ImplicitBuffers& buffers);

}  // namespace supple::core
