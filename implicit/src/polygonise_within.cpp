#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

constexpr std::size_t kBatch = 512;

/// Largest distance, to first order, of the centroids of body m's mesh to the surface of {F_m > 0, F_m >= F_j}.
double centroid_error(std::span<const FieldView> fields, std::size_t m, const Mesh& mesh, const Executor& executor) {
  std::vector<double> largest((mesh.triangle_count() + kBatch - 1) / kBatch, 0.0);
  executor.for_blocks(mesh.triangle_count(), kBatch, [&](std::size_t begin, std::size_t end) {
    const std::size_t n = end - begin;
    std::vector<Vec3> point(n), slope(n), most_slope(n, Vec3::Zero()), other_slope(n);
    std::vector<double> value(n), most(n, 0.0), other(n);
    Box box;
    for (std::size_t i = 0; i < n; ++i) {
      const auto& t = mesh.triangle[begin + i];
      point[i] = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
      box.include(point[i]);
    }
    fields[m].evaluate(point, value, slope);
    for (std::size_t j = 0; j < fields.size(); ++j) {
      if (j == m || !fields[j].surface_box().overlaps(box)) continue;
      fields[j].evaluate(point, other, other_slope);
      for (std::size_t i = 0; i < n; ++i) {
        if (other[i] <= most[i]) continue;
        most[i] = other[i];
        most_slope[i] = other_slope[i];
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double steepness = (slope[i] - most_slope[i]).norm();
      if (steepness > 0.0) largest[begin / kBatch] = std::max(largest[begin / kBatch], std::abs(value[i] - most[i]) / steepness);
    }
  });
  return largest.empty() ? 0.0 : *std::max_element(largest.begin(), largest.end());
}

}  // namespace

std::vector<Mesh> polygonise_partition_within(std::span<const FieldView> fields, const Lattice& coarsest, const PartitionError& error,
                                              const Executor& executor, PolygoniseCounts* counts) {
  SUPPLE_EXPECTS(error.largest > 0.0 && coarsest.cell > 0.0);
  constexpr int kHalvings = 6;
  Lattice lattice = coarsest;
  double found = 0.0;
  for (int halving = 0; halving < kHalvings; ++halving, lattice.cell *= 0.5) {
    std::vector<Mesh> meshes = polygonise_partition(fields, lattice, executor, counts);
    found = 0.0;
    for (std::size_t m = 0; m < meshes.size(); ++m) found = std::max(found, centroid_error(fields, m, meshes[m], executor));
    if (found <= error.largest) return meshes;
  }
  throw Error(ErrorKind::Limit, {.place = "",
                                 .key = error.key,
                                 .expected = "expected an error of at most " + lattice::three_digits(error.largest) + " m",
                                 .found = lattice::three_digits(found) + " m with cells of " +
                                          lattice::three_digits(2.0 * lattice.cell) + " m where objects touch",
                                 .hint = "allow at least " + lattice::three_digits(1.05 * found) + " m"});
}

}  // namespace supple::implicit
