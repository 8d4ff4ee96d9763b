#include "fit/measure.h"

#include <algorithm>
#include <cmath>

#include "supple/cgal/surface_meshes.h"
#include "supple/implicit/march_cubes.h"

namespace supple::fit {

Mesh mesh_of(const implicit::FieldView& field, double cell, const Executor& executor) {
  implicit::MarchOptions options;
  options.lattice.cell = cell;
  return implicit::march_cubes(field, options, executor);
}

std::vector<double> distances(std::span<const Vec3> points, const SurfaceTree& tree, const Executor& executor) {
  std::vector<double> out(points.size());
  constexpr std::size_t kBlock = 256;
  executor.for_blocks(out.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) out[k] = tree.distance(points[k]);
  });
  return out;
}

Distance measure(const Mesh& from, const Mesh& to, const SurfaceTree& tree_of_to, double error, const Executor& executor) {
  constexpr std::size_t kSamples = 20000;
  Distance out;
  double squares = 0.0;
  for (const double d : distances(sample_surface(from, kSamples).position, tree_of_to, executor)) squares += d * d;
  out.rms = std::sqrt(squares / static_cast<double>(kSamples));
  out.largest = cgal::one_sided_hausdorff_distance(from, to, error);
  return out;
}

}  // namespace supple::fit
