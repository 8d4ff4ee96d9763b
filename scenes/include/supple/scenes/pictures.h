/// @file supple/scenes/pictures.h
/// Pictures of single states, as `supple run` draws them.
#pragma once

#include <string>

#include "supple/render/renderer.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

struct PictureOptions {
  std::string camera{};        ///< name; empty: the first one
  int width = 0, height = 0;   ///< [pixel]; 0: as output.images says
  render::ContextKind context = render::ContextKind::Auto;
  int threads = 1;             ///< of the path tracer; 0: all the machine has
};

/// The current state as a camera of the scene sees it. Meshes that are asked for later are of all bodies, in the cells of before.
/// Makes a renderer of its own, which takes a tenth of a second or so.
/// @throws Error{Usage} for a camera that the scene has not, or a size that is no size; Error{Io} when a texture cannot be read or no
/// OpenGL context can be made
[[nodiscard]] render::Image draw_picture(Simulation& simulation, const PictureOptions& options = {});

}  // namespace supple::scenes
