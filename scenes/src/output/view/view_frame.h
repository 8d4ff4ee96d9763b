/// One frame of the viewer as bytes (viewer/README.md).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Writes frames one after the other: meshes and triangles that stay as they were in the frame before are left out.
class ViewFrames {
 public:
  /// @return the frame of the simulation's state, before compression
  [[nodiscard]] std::string write(Simulation& simulation);

 private:
  struct Kept {
    std::vector<Vec3> position;
    std::vector<double> pressure;
    std::vector<std::array<std::uint32_t, 3>> triangle;
  };
  std::vector<Kept> kept_;  ///< by mesh
};

}  // namespace supple::scenes
