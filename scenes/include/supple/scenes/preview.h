/// @file supple/scenes/preview.h
/// A scene in small: pictures of a quarter of the size, fewer frames, coarse meshes and coarse contact, for a first look at its film.
#pragma once

#include <string>
#include <vector>

#include "supple/scenes/model.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Of so many frames the preview shows one: a power of two, such that 12 frames per second or more stay, and 10 frames or more in all;
/// half as many again where 8 frames per second or more stay then, and 13 frames or more.
[[nodiscard]] int preview_stride(const Scene& scene);

/// Overrides as of `--set` with which the scene is read again as its preview: pictures of a quarter of the size with one sample a pixel by OpenGL,
/// lattice cells three times as long, contact.error 0.1, accuracy 4e-2 where the scene leaves its steps open; every `preview_stride`-th frame; a film
/// where there is more than one; no other files. Times and cameras stay.
/// @param model  of the scene; gives the lattice cells
[[nodiscard]] std::vector<std::string> preview_overrides(const Scene& scene, const Model& model);

}  // namespace supple::scenes
