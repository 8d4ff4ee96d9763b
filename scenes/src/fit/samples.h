/// @file samples.h
/// Points on and around a closed mesh at which a fit is compared with it.
#pragma once

#include <vector>

#include "fit/surface.h"
#include "supple/core/executor.h"

namespace supple::fit {

struct SurfaceSamples {
  std::vector<Vec3> position;
  std::vector<Vec3> normal;  ///< outward; between those of the corners, which are means but at creases sharper than 32 degrees
  double spacing = 0.0;      ///< square root of the area of one
};

/// Points even in area: the triangles in order, divided into equal parts of area, each with a point of a low-discrepancy sequence (Roberts 2018).
[[nodiscard]] SurfaceSamples sample_surface(const Mesh& mesh, std::size_t count);

/// Points of a cubic lattice about a mesh.
struct Surroundings {
  double step = 0.0;
  std::vector<Vec3> inside, outside;
  std::vector<double> depth, gap;  ///< distances of these to the surface
};

/// @param step  of the lattice, which reaches two steps beyond the mesh
[[nodiscard]] Surroundings sample_surroundings(const Mesh& mesh, const SurfaceTree& tree, double step, const Executor& executor);

}  // namespace supple::fit
