#include "scenes/contact_gas.h"

#include <gtest/gtest.h>

namespace supple::scenes {
namespace {

TEST(FreeBalls, KeepMomentaAtEveryStepAndEnergyToTheSquareOfTheStep) {
  double error[2];
  for (const int i : {0, 1}) {
    const int every = 1 << i;
    Simulation simulation = gas::make(10, 2e-3 / every, 1e-3);
    const gas::Errors e = gas::run(simulation, 300 * every, every);
    EXPECT_GT(e.contact, 0.01);  // there were collisions
    EXPECT_LT(e.momentum, 1e-12);
    EXPECT_LT(e.angular_momentum, 1e-12);
    error[i] = e.energy;
  }
  EXPECT_LT(error[1], 1e-3);
  EXPECT_GT(error[0] / error[1], 3.5);
  EXPECT_LT(error[0] / error[1], 4.7);
}

}  // namespace
}  // namespace supple::scenes
