// Explicit Runge-Kutta steps on (x, v, q, L), damping and the ledger included.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "supple/core/integrators.h"

namespace supple::core {

/// Time derivative of a state and of its books, shape [n].
struct Rates {
  std::vector<Vec3> velocity;
  std::vector<Vec3> acceleration;
  std::vector<Quat> turning;  ///< dq/dt = (0, omega) q / 2
  std::vector<Vec3> torque;
  Ledger ledger;
};

struct RungeKuttaBuffers {
  std::vector<Rates> stage;
  ParticleState trial;
  ForceSample sample;
  Loads friction;
  Loads medium;
};

StepReport advance_runge_kutta(const IntegratorSettings& settings, const StepProblem& problem, double time, double dt,
                               const StepTarget& target, RungeKuttaBuffers& buffers);

}  // namespace supple::core
