/// @file supple/scenes/preview.h
/// A scene in small: pictures of a quarter of the size, coarse meshes and coarse contact, for a first look at its film.
#pragma once

#include <string>
#include <vector>

#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Overrides as of `--set` with which the scene is read again as its preview: pictures of a quarter of the size with one sample a pixel by OpenGL,
/// lattice cells twice as long, contact.error at least 3e-2, accuracy 1e-2 where the scene gives another one and leaves its steps open; no other files. Times,
/// frames and cameras stay.
/// @throws as `build_model`, which gives the lattice cells
[[nodiscard]] std::vector<std::string> preview_overrides(const Scene& scene);

}  // namespace supple::scenes
