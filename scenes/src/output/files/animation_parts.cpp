#include "output/files/animation_parts.h"

#include "output/pictures/camera.h"
#include "output/pictures/picture.h"

namespace supple::scenes {

std::vector<io::UsdObject> animated_objects(const Scene& scene) {
  std::vector<io::UsdObject> objects;
  for (const ObjectDesc& o : scene.objects) objects.push_back({o.name, o.colour, o.roughness});
  for (const ObstacleDesc& o : scene.obstacles) objects.push_back({o.name, o.colour, o.roughness});
  return objects;
}

AnimatedFrame::AnimatedFrame(Simulation& simulation) {
  const Scene& scene = simulation.scene();
  obstacles_ = obstacle_meshes(scene, simulation.model(), simulation.time());
  for (const Mesh& mesh : simulation.meshes()) meshes_.push_back(&mesh);
  for (const Mesh& mesh : obstacles_) meshes_.push_back(&mesh);
  const std::vector<int> size = scene.output.images ? scene.output.images->size : ImagesDesc{}.size;
  for (const CameraDesc& desc : simulation.model().cameras) {
    const render::Camera at = camera_at(desc, simulation.time(), scene.duration);
    cameras_.push_back({desc.name.empty() ? "camera" : desc.name, at.from, at.look_at, at.up, at.field_of_view,
                        static_cast<double>(size.at(0)) / size.at(1)});
  }
}

}  // namespace supple::scenes
