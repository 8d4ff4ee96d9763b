/// @file shell.h
/// Surface elements of a shell: particles on a surface with its principal frames, and bonds between neighbours on it.
#pragma once

#include <vector>

#include "fit/jets.h"
#include "fit/packing.h"

namespace supple::fit {

/// The closed mesh of a layer about a surface, whose borders get a rim. @pre no edge has more than two triangles, which are turned alike
[[nodiscard]] Mesh thickened(const Mesh& middle, double thickness);

struct ShellElements {
  SurfaceSamples samples;           ///< of the middle surface, of which each particle has a share
  Packing packing;                  ///< particles are samples; faces have the width of the common edge in place of an area
  std::vector<SurfaceFrame> frame;  ///< of each particle
};

/// Centroidal Voronoi tessellation of samples of a surface (Du, Gunzburger & Ju 2003). Bonds join shares with a common edge, so not through the shell.
[[nodiscard]] ShellElements pack_shell(const Mesh& middle, std::size_t count, const Executor& executor);

}  // namespace supple::fit
