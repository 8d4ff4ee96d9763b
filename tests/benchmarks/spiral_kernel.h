// A plain kernel for one problem, written by hand: a chain of bodies with equal moments of inertia, held by bond frames
// and co-planarity, with friction on its bonds, stepped by velocity Verlet. It shares no code with the library and books no
// energies; the time that the library needs beyond it is the cost of generality.
#pragma once

#include <cstddef>
#include <vector>

namespace supple::benchmarks {

struct ChainNumbers {
  double inverse_mass = 0.0, inverse_inertia = 0.0;
  double stretch = 0.0, rotation = 0.0;        ///< of the bond frames
  double coplanarity = 0.0;
  double friction = 0.0, angular_friction = 0.0;
  double load[3] = {0.0, 0.0, 0.0};            ///< on the first body
};

/// Shapes [bodies][3] and [bodies][4] (x, y, z, w).
struct ChainState {
  std::vector<double> position, orientation, velocity, angular_momentum;
};

/// Bodies up to two apart are bonded; rest is the state given.
class Chain {
 public:
  Chain(const ChainNumbers& numbers, const ChainState& rest);
  ChainState state;
  void start();  ///< forces at the state
  void step(double dt);

 private:
  struct Bond {
    std::size_t a, b;
    double arm_a[3], arm_b[3];  ///< to the other body, in the body's frame
    double between[4];          ///< q_A* q_B at rest
  };
  void forces();
  void rub(const Bond& bond, double h);
  void kick(double dt);
  void drift(double dt);
  ChainNumbers numbers_;
  std::size_t count_;
  std::vector<Bond> bond_;
  std::vector<double> normal_, force_, torque_;
};

}  // namespace supple::benchmarks
