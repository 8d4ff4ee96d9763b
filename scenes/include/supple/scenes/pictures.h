/// @file supple/scenes/pictures.h
/// Pictures of single states, as `supple run` draws them.
#pragma once

#include <string>

#include "supple/render/renderer.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

struct PictureOptions {
  std::string camera{};        ///< name; empty: the first one
  int width = 0, height = 0;   ///< [pixel]; 0: size of output.images
  render::ContextKind context = render::ContextKind::Auto;
  int threads = 1;             ///< of the path tracer; 0: all of the machine
};

/// Draws the current state from a camera of the scene. Later calls of `meshes` are not affected.
/// Makes a renderer of its own, which takes about a tenth of a second.
/// @throws Error{Usage} for an unknown camera or an invalid size; Error{Io} when a texture cannot be read or no
/// OpenGL context can be made
[[nodiscard]] render::Image draw_picture(Simulation& simulation, const PictureOptions& options = {});

}  // namespace supple::scenes
