// A scene from text: two balls meet; kinetic energy after the impact for three values of damping.
#include <supple/scenes/read_scene.h>
#include <supple/scenes/simulation.h>

#include <array>
#include <iostream>
#include <string>

constexpr const char* kScene = R"(
schema: 1
duration: 1 s
frame_rate: 24
defaults: {objects: {skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}], contact: {modulus: 20 kPa}}}
objects:
  - {name: left, particles: {arrange: single, at: [-0.3, 0, 0], velocity: [1, 0, 0], mass: 0.5}}
  - {name: right, particles: {arrange: single, at: [0.3, 0, 0], mass: 0.5}}
)";

int main() {
  double before = 1.0;
  for (const char* dissipation : {"0", "0.2", "1"}) {
    const std::array overrides{"objects.left.contact.dissipation=" + std::string(dissipation), "objects.right.contact.dissipation=" + std::string(dissipation)};
    supple::scenes::Simulation simulation(supple::scenes::parse_scene(kScene, "rebound.yaml", ".", overrides));
    simulation.advance_to(simulation.scene().frame_count());
    const double left = simulation.energies().kinetic;
    std::cout << "dissipation " << dissipation << " s/m: " << left << " J of 0.25 J\n";
    if (!(left < before)) return 1;
    before = left;
  }
}
