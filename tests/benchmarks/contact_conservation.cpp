// Conservation in collisions without loss: 2, 10 and 100 free balls over many steps, and how the energy error falls with
// the step and with the given error of the contact quadrature. Prints the tables of docs/accuracy_and_speed.md.
// Arguments: number of steps (default 100000), and a number of balls for that row alone.
#include <cstdio>
#include <ctime>
#include <string_view>
#include <vector>

#include "programs.h"
#include "scenes/contact_gas.h"
#include "usage.h"

int supple::benchmarks::programs::contact_conservation(int argc, char** argv) {
  using namespace supple::scenes;
  using namespace supple::benchmarks;
  constexpr std::string_view kUsage = "contact_conservation [STEPS] [BALLS]";
  answer_usage(argc, argv, kUsage, 2);
  const int steps = argc > 1 ? whole_number(kUsage, argv[1]) : 100000;
  const std::vector<int> counts = argc > 2 ? std::vector<int>{whole_number(kUsage, argv[2])} : std::vector<int>{2, 10, 100};
  constexpr double kStep = 2.5e-4;
  std::printf("| balls | steps | momentum | angular momentum | energy | largest contact energy | CPU s |\n|---|---|---|---|---|---|---|\n");
  for (const int count : counts) {
    Simulation simulation = gas::make(count, kStep, 1e-4);
    const std::clock_t begin = std::clock();
    const gas::Errors e = gas::run(simulation, steps, 50);
    std::printf("| %d | %d | %.1e | %.1e | %.1e | %.2f | %.0f |\n", count, steps, e.momentum, e.angular_momentum, e.energy, e.contact,
                static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    std::fflush(stdout);
  }
  if (argc > 2) return 0;
  std::printf("\n| contact error asked | 2 ms | 1 ms | 0.5 ms | 0.25 ms | 0.125 ms |\n|---|---|---|---|---|---|\n");
  for (const double error : {1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-9}) {
    std::printf("| %g |", error);
    for (const double dt : {2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4}) {
      Simulation simulation = gas::make(10, dt, error);
      const int every = static_cast<int>(std::lround(2e-3 / dt));
      std::printf(" %.2e |", gas::run(simulation, 1000 * every, every).energy);
      std::fflush(stdout);
    }
    std::printf("\n");
  }
  return 0;
}
