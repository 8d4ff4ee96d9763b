// Steps the scene of the package's test.
#include <supple/scenes/read_scene.h>
#include <supple/scenes/simulation.h>

int main() {
  supple::scenes::Simulation simulation(supple::scenes::read_scene(SCENE));
  simulation.step_frame();
  return simulation.frame() == 2 ? 0 : 1;
}
