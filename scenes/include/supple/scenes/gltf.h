/// @file supple/scenes/gltf.h
/// A run as one glTF file: `supple export --gltf`.
#pragma once

#include <filesystem>

#include "supple/scenes/run.h"

namespace supple::scenes {

/// Writes the meshes, materials and cameras of the saved states of a run (options.frames; empty: all) to options.folder/NAME.glb
/// (core/io/gltf_file.h), with the cells of the scene's `output`. @return the file
/// @throws Error{Io} without saved states, Error{Limit} above 4 GB, Interrupted
std::filesystem::path write_gltf(const Scene& scene, const RunOptions& options);

}  // namespace supple::scenes
