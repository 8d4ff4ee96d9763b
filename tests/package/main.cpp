// A minimal external project: reads a scene, steps it, prints the position of the first particle and the hash of the state.
#include <supple/core/hash.h>
#include <supple/scenes/read_scene.h>
#include <supple/scenes/simulation.h>

#include <iostream>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  supple::scenes::Simulation simulation(supple::scenes::read_scene(argv[1]));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  std::cout << "t = " << simulation.time() << " s, particle 0 at "
            << simulation.state().particles.position[0].transpose() << " m, state "
            << supple::to_hex(simulation.state_hash()) << '\n';
}
