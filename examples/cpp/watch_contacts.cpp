// A run with an eye on its contacts: the largest force of each pair.
#include <supple/scenes/contact_report.h>
#include <supple/scenes/read_scene.h>

#include <algorithm>
#include <iostream>
#include <map>

using namespace supple;

int main(int argc, char** argv) {
  if (argc != 2) return 2;  // a scene file
  scenes::Simulation simulation(scenes::read_scene(argv[1]));
  std::map<std::string, double> largest;
  while (simulation.frame() < simulation.scene().frame_count()) {
    simulation.step_frame();
    for (const auto& pair : scenes::report_contacts(simulation).pairs) {
      double& force = largest[pair.a + " and " + pair.b];
      force = std::max(force, pair.force.norm());
    }
  }
  for (const auto& [pair, force] : largest) std::cout << pair << ": " << force << " N\n";
  std::cout << "momentum within " << simulation.audits().momentum_error << " of the largest\n";
  return largest.empty() ? 1 : 0;
}
