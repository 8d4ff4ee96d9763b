// A state is kept, the run goes back to it with a push, and then without one: the same bits as the first time.
#include <supple/core/hash.h>
#include <supple/scenes/read_scene.h>
#include <supple/scenes/simulation.h>

#include <iostream>
#include <vector>

using namespace supple;

int main(int argc, char** argv) {
  if (argc != 2) return 2;  // a scene file
  scenes::Simulation simulation(scenes::read_scene(argv[1]));
  simulation.advance_to(4);
  const scenes::State kept = simulation.state();
  simulation.advance_to(8);
  const std::uint64_t straight = simulation.state_hash();

  simulation.restore(kept);
  std::vector<Vec3> velocity = kept.particles.velocity;
  for (Vec3& v : velocity) v += Vec3(0, 0.1, 0);
  simulation.set_particles({.velocity = velocity});
  simulation.advance_to(8);
  const std::uint64_t pushed = simulation.state_hash();

  simulation.restore(kept);
  simulation.advance_to(8);
  std::cout << "straight " << to_hex(straight) << ", pushed " << to_hex(pushed) << ", again " << to_hex(simulation.state_hash()) << '\n';
  return simulation.state_hash() == straight && pushed != straight ? 0 : 1;
}
