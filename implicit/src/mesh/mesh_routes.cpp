#include "supple/implicit/mesh_routes.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "field/field_index.h"
#include "skeleton/shapes.h"
#include "supple/core/error.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {
namespace {

/// Costs of meshing. Values and searches are fitted to the times of `bench implicit/mesh` (every shape, all scenes of the library) on one core
/// of an Intel Xeon at 2 to 3 GHz. Choices use ratios of them only, so they hold on other processors; estimates are most often right
/// within a factor of two.
constexpr double kNodes = 512.0;                      ///< of a leaf: 8^3, as in OpenVDB
constexpr double kSingleValue = 0.1;                  ///< a primitive at a node: its value in single precision [ns]
constexpr double kValue = 0.7;                        ///< the same in double precision [ns]
constexpr double kGradient = 1.1;                     ///< value and gradient in double precision [ns]
constexpr double kPrimitive = 200.0;                  ///< to find a primitive near a leaf [ns]
constexpr double kCubesLeaf = 3500.0;                 ///< further costs of a leaf of marching cubes: bounds, roots and triangles of 45 vertices [ns]
constexpr double kGridLeaf = 10000.0;                 ///< further costs of a leaf of a grid: bounds, the tree and volumeToMesh [ns]
constexpr double kGridVertices = 45.0;                ///< vertices of a leaf through a grid
constexpr double kLooksAtVertex = 3.5;                ///< evaluations of each: 2.5 for projection onto the surface, 1 for its normal
constexpr double kBandLeaves = 1.8;                   ///< leaves of the narrow band (three cells on each side) per leaf with surface
constexpr double kOtherShapes = 2.5;                  ///< nearest points on other shapes relative to points
constexpr double kDividedLeaf = 0.04;                 ///< a leaf of tetrahedra [ms]
constexpr double kBoundary = 0.8;                     ///< the boundary curve of a contact patch among tetrahedra [ms]
constexpr double kLeastHalved = 1.0;                  ///< a search near a primitive smaller than a cell: about a thousand cubes [ms]
constexpr double kContact = 0.2;                      ///< a search between two bodies that touch: some hundred cubes [ms]
constexpr double kMoreBalls = 1.0;                    ///< the same for each further primitive that overlaps there, for balls [ms]
constexpr double kMoreShapes = 170.0;                 ///< and for other shapes [ms]

/// Cost of a search relative to marching cubes: for cubes of the lattice, and for halving those near the surface until their edges
/// are a given fraction of the length on which gradients turn, where primitives are alone and where they overlap. Bounds of overlapping
/// primitives add up where their gradients cancel.
struct SearchWork {
  double lattice = 0.0, alone = 0.0, overlapping = 0.0;
};
constexpr SearchWork kBlobSearch{.lattice = 0.5, .alone = 0.0, .overlapping = 5.0};
constexpr SearchWork kEighthSearch{.lattice = 0.1, .alone = 12.0, .overlapping = 8.0};  ///< eight cubes at once (eighth_bounds.h)
constexpr SearchWork kSumSearch{.lattice = 0.2, .alone = 130.0, .overlapping = 85.0};

bool is_blobs(const Skeleton& skeleton) {
  return skeleton.blend.rule == BlendRule::Sum &&
         std::all_of(skeleton.primitive.begin(), skeleton.primitive.end(), [](const Primitive& p) {
           return p.shape == ShapeKind::Point && p.kernel.kind == KernelKind::Wyvill && p.stretch == Vec3::Ones();
         });
}

/// Least radius of curvature of a Bezier curve [m], and whether it is less than the distance of the surface there.
struct Bend {
  double radius = std::numeric_limits<double>::infinity();
  bool within_surface = false;
};
Bend bend_of(const Primitive& p, double iso) {
  constexpr int kSteps = 32;
  const double thickness = evaluate(p.kernel, 0.0).value > iso ? iso_distance(p.kernel, iso) : 0.0;
  Bend bend;
  for (int i = 0; i <= kSteps; ++i) {
    const double t = static_cast<double>(i) / kSteps;
    const BezierPoint g = bezier(p.control, t);
    const double speed = g.first.norm(), turn = g.first.cross(g.second).norm();
    if (!(turn > 0.0)) continue;
    const double radius = speed * speed * speed / turn;
    bend.radius = std::min(bend.radius, radius);
    bend.within_surface = bend.within_surface || radius < thickness * (1.0 + (p.taper - 1.0) * t);
  }
  return bend;
}

/// Over which a primitive's gradient turns far [m].
double turning_length(const Primitive& p, double iso) {
  const double feature = feature_of(p);
  switch (p.shape) {
    case ShapeKind::Ring:
    case ShapeKind::Arc: return std::min(feature, p.size.x() * p.stretch.minCoeff());
    case ShapeKind::Curve: return std::min(feature, bend_of(p, iso).radius * p.stretch.minCoeff());
    case ShapeKind::Superquadric: return feature * std::min(p.exponent[0], p.exponent[1]);
    default: return feature;
  }
}

bool decides(const Skeleton& skeleton) {
  const bool several = skeleton.blend.node.empty() ? skeleton.part_count > 1
                                                   : std::any_of(skeleton.blend.node.begin(), skeleton.blend.node.end(),
                                                                 [&](std::uint32_t n) { return n != skeleton.blend.node.front(); });
  if (skeleton.blend.rule == BlendRule::Gradient && several) return false;
  // Where two sides of a lone curve are as near, directions between both are tried, by a slope over squared distance that never vanishes.
  const bool lone = skeleton.primitive.size() == 1;
  return std::none_of(skeleton.primitive.begin(), skeleton.primitive.end(), [&](const Primitive& p) {
    return p.shape == ShapeKind::Curve && (!lone || p.kernel.kind == KernelKind::BlancSchlick) && bend_of(p, skeleton.iso).within_surface;
  });
}

/// Whether eight cubes are processed side by side: EighthBounds::know.
bool goes_by_eighths(const Skeleton& skeleton) {
  return skeleton.blend.rule == BlendRule::Sum && std::all_of(skeleton.primitive.begin(), skeleton.primitive.end(), [](const Primitive& p) {
    if (p.convolved || (p.kernel.kind != KernelKind::Wyvill && p.kernel.kind != KernelKind::Gascuel)) return false;
    switch (p.shape) {
      case ShapeKind::Segment: return p.taper == 1.0;
      case ShapeKind::Point:
      case ShapeKind::Rectangle:
      case ShapeKind::Box:
      case ShapeKind::Ellipsoid:
      case ShapeKind::Disc: return true;
      default: return false;
    }
  });
}

/// Supports that contain the centre of one of them, averaged over some.
double local_overlap(std::span<const Box> supports) {
  constexpr std::size_t kLooks = 8;
  const std::size_t looks = std::min(supports.size(), kLooks);
  std::array<Vec3, kLooks> middle;
  for (std::size_t k = 0; k < looks; ++k) middle[k] = supports[(2 * k + 1) * supports.size() / (2 * looks)].centre();
  std::size_t held = 0;
  for (const Box& box : supports) {
    for (std::size_t k = 0; k < looks; ++k) held += box.contains(middle[k]) ? 1 : 0;
  }
  return looks > 0 ? static_cast<double>(held) / static_cast<double>(looks) : 0.0;
}

/// CPU time of marching cubes [ms].
double cubes_ms(const Skeleton& skeleton, std::span<const Box> supports, double cell) {
  const bool points = std::all_of(skeleton.primitive.begin(), skeleton.primitive.end(),
                                  [](const Primitive& p) { return p.shape == ShapeKind::Point; });
  return (points ? 1.0 : kOtherShapes) * estimate_routes(skeleton, supports, cell).cubes_ms;
}

/// @param overlap  see local_overlap   @param mesh_ms  see cubes_ms
double search_ms(const SearchWork& work, const Skeleton& skeleton, double overlap, double mesh_ms, double cell) {
  if (skeleton.primitive.empty()) return 0.0;
  constexpr std::size_t kLooks = 1024;
  const std::size_t count = skeleton.primitive.size(), stride = 1 + count / kLooks;
  double coarseness = 0.0, looks = 0.0;
  for (std::size_t i = 0; i < count; i += stride, looks += 1.0) {
    const double ratio = cell / turning_length(skeleton.primitive[i], skeleton.iso);
    coarseness += ratio * ratio * ratio;
  }
  const double halved = (work.alone + work.overlapping * overlap) * coarseness / looks;
  return work.lattice * mesh_ms + std::min(halved * mesh_ms, kLeastHalved * static_cast<double>(count));
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
  const double at_vertices = kLooksAtVertex * kGridVertices * estimate.overlap * kGradient;
  if (cell < kLeastGridCell) {
    estimate.openvdb_ms = std::numeric_limits<double>::infinity();  // there is no such grid
    return estimate;
  }
  estimate.openvdb_ms = 1e-6 * (find + estimate.leaves * (kBandLeaves * (at_nodes * kGradient + kGridLeaf) + at_vertices));
  return estimate;
}

SearchEstimate estimate_search(const Skeleton& skeleton, std::span<const Box> supports, double cell) {
  const bool blobs = is_blobs(skeleton);
  const double mesh_ms = cubes_ms(skeleton, supports, cell);
  return {.decides = blobs || decides(skeleton),
          .search_ms = search_ms(blobs ? kBlobSearch : goes_by_eighths(skeleton) ? kEighthSearch : kSumSearch, skeleton, local_overlap(supports), mesh_ms, cell),
          .mesh_ms = mesh_ms};
}

SearchEstimate estimate_search(std::span<const DividingBody> bodies, std::span<const std::array<std::size_t, 2>> pairs, double cell) {
  SearchEstimate all;
  std::vector<double> more_ms;  // by body, of each of its contacts
  for (const DividingBody& body : bodies) {
    const double overlap = local_overlap(body.supports);
    more_ms.push_back((is_blobs(*body.skeleton) ? kMoreBalls : kMoreShapes) * std::max(overlap - 1.0, 0.0));
    all.decides = all.decides && decides(*body.skeleton);
    all.search_ms += search_ms(kSumSearch, *body.skeleton, overlap, cubes_ms(*body.skeleton, body.supports, cell), cell);
    all.mesh_ms += kDividedLeaf * estimate_routes(*body.skeleton, body.supports, cell).leaves;
  }
  for (const auto& [a, b] : pairs) {
    all.search_ms += kContact + std::max(more_ms[a], more_ms[b]);
    all.mesh_ms += kBoundary;
  }
  return all;
}

}  // namespace supple::implicit
