/// @file supple/core/io/read_mesh.h
/// Triangle meshes from other tools: Wavefront OBJ, and PLY in text or binary.
#pragma once

#include <filesystem>

#include "supple/core/mesh.h"

namespace supple::io {

/// Reads positions and faces; faces with more corners are divided into triangles, convex ones into fans. The extension, .obj or .ply, selects the format.
/// @throws Error{Io} when absent, Error{Scene} naming the place of the fault in the file, for coordinates above 1e50 m in size and for a mesh that is
/// shorter than 1e-50 m.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& path);

}  // namespace supple::io
