#include <algorithm>
#include <vector>

#include "file/read_scene_faults.h"
#include "output/pictures/picture.h"
#include "supple/core/error.h"
#include "supple/scenes/pictures.h"

namespace supple::scenes {
namespace {

/// @throws Error{Usage} for a name that no camera has
std::size_t find_camera(const Simulation& simulation, const std::string& name) {
  if (name.empty()) return 0;
  std::vector<std::string_view> names;
  for (const CameraDesc& camera : simulation.model().cameras) names.emplace_back(camera.name);
  const auto at = std::find(names.begin(), names.end(), name);
  if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
  throw Error(ErrorKind::Usage, Fault{.place = "camera",
                                      .key = {},
                                      .expected = "expected the name of a camera",
                                      .found = '\'' + shown(name) + '\'',
                                      .hint = known_hint(name, names)});
}

/// Gives a simulation its meshes back as they were.
class MeshesAsBefore {
 public:
  explicit MeshesAsBefore(Simulation& simulation) : simulation_(simulation), cell_(simulation.cell()) {}
  ~MeshesAsBefore() {
    simulation_.set_shown({});
    if (cell_ > 0.0) simulation_.set_cell(cell_);
  }
  MeshesAsBefore(const MeshesAsBefore&) = delete;
  MeshesAsBefore& operator=(const MeshesAsBefore&) = delete;

 private:
  Simulation& simulation_;
  double cell_;
};

}  // namespace

render::Image draw_picture(Simulation& simulation, const PictureOptions& options) {
  const std::size_t camera = find_camera(simulation, options.camera);
  Scene scene = simulation.scene();
  if (!scene.output.images) scene.output.images = ImagesDesc{};
  if (options.width != 0) scene.output.images->size.at(0) = options.width;
  if (options.height != 0) scene.output.images->size.at(1) = options.height;
  ScenePictures pictures(scene, simulation.model(), options.context, options.threads);
  const MeshesAsBefore restored(simulation);
  pictures.limit_meshes(simulation);
  return pictures.draw(simulation, camera, nullptr);
}

}  // namespace supple::scenes
