/// @file supple/core/io/read_mesh.h
/// Triangle meshes from other tools: Wavefront OBJ, and PLY in text or binary.
#pragma once

#include <filesystem>

#include "supple/core/mesh.h"

namespace supple::io {

/// Positions and faces alone; faces with more corners are cut into triangles, convex ones into fans. The extension decides, .obj or .ply.
/// @throws Error{Io} when absent, Error{Scene} naming the place where the file is not what it should be.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& path);

}  // namespace supple::io
