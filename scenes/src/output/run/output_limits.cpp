#include "supple/scenes/output_limits.h"

#include <functional>

#include "output/files/scene_grids.h"
#include "output/meshes/mesh_sizes.h"
#include "output/pictures/picture.h"
#include "simulation/scene_samples.h"

namespace supple::scenes {

void expect_output_sizes(Simulation& simulation, const OutputRequest& outputs) {
  const Scene& scene = simulation.scene();
  const Executor executor(1);
  const bool by_pixels = scene.render.pixel_error && !scene.output.cell;  // the cells of pictures alone
  if (outputs.meshes || (outputs.images && !by_pixels)) {
    std::function<bool(const Box&)> shown;
    if (!outputs.meshes) shown = shown_by_cameras(scene, simulation.model(), simulation.time());
    expect_mesh_sizes(simulation, shown, executor);
  }
  if (outputs.grids) expect_grid_sizes(simulation, executor);
  if (outputs.samples) SceneSamples(scene.output.sampling, simulation.cell()).expect_sizes(simulation, executor);
}

}  // namespace supple::scenes
