/// What files of a whole animation (USD, glTF) show of a scene.
#pragma once

#include <span>
#include <vector>

#include "supple/core/io/usd_file.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Objects, then obstacles.
[[nodiscard]] std::vector<io::UsdObject> animated_objects(const Scene& scene);

/// Meshes and cameras of the simulation's state; valid until its next step.
class AnimatedFrame {
 public:
  explicit AnimatedFrame(Simulation& simulation);
  [[nodiscard]] std::span<const Mesh* const> meshes() const { return meshes_; }
  [[nodiscard]] std::span<const io::UsdCamera> cameras() const { return cameras_; }

 private:
  std::vector<Mesh> obstacles_;
  std::vector<const Mesh*> meshes_;
  std::vector<io::UsdCamera> cameras_;
};

}  // namespace supple::scenes
