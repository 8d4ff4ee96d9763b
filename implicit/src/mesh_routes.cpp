#include "supple/implicit/mesh_routes.h"

#include <algorithm>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kNodes = 512.0;  ///< of a leaf
/// Of a primitive at a node: a value in single or double precision, a value with its gradient in double precision [ns].
constexpr double kSingleValue = 0.1, kValue = 0.7, kGradient = 1.1;
/// Of a leaf besides: bounds, roots and triangles of about 45 vertices; bounds, the tree, and volumeToMesh [ns].
constexpr double kCubesLeaf = 3500.0, kGridLeaf = 10000.0;
/// Of a primitive, to find it near a leaf [ns].
constexpr double kPrimitive = 200.0;
/// Leaves of the band, three cells wide on each side, for one that holds surface.
constexpr double kBandLeaves = 1.8;

bool is_blobs(const Skeleton& skeleton) {
  return skeleton.blend.rule == BlendRule::Sum &&
         std::all_of(skeleton.primitive.begin(), skeleton.primitive.end(), [](const Primitive& p) {
           return p.shape == ShapeKind::Point && p.kernel.kind == KernelKind::Wyvill && p.stretch == Vec3::Ones();
         });
}

}  // namespace

RouteEstimate estimate_routes(const Skeleton& skeleton, std::span<const Box> supports, double cell) {
  SUPPLE_EXPECTS(cell > 0.0);
  RouteEstimate estimate;
  Box all;
  double volume = 0.0;
  for (const Box& box : supports) {
    all = all.united(box);
    volume += box.extent().prod();
  }
  if (all.empty()) return estimate;
  const Vec3 e = all.extent();
  const double leaf = 8.0 * cell;
  estimate.leaves = std::max(1.0, 2.0 * (e.x() * e.y() + e.y() * e.z() + e.z() * e.x()) / (leaf * leaf));
  estimate.overlap = std::clamp(volume / e.prod(), 1.0, static_cast<double>(supports.size()));
  const double at_nodes = kNodes * estimate.overlap;
  const double find = kPrimitive * static_cast<double>(supports.size());
  const double value = is_blobs(skeleton) ? kSingleValue : kValue;
  estimate.cubes_ms = 1e-6 * (find + estimate.leaves * (at_nodes * value + kCubesLeaf));
  estimate.openvdb_ms = 1e-6 * (find + kBandLeaves * estimate.leaves * (at_nodes * kGradient + kGridLeaf));
  return estimate;
}

}  // namespace supple::implicit
