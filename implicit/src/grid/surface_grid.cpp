#include "supple/implicit/surface_grid.h"

#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <numeric>
#include <sstream>

#include "grid/grid_leaves.h"
#include "mesh/triangle_crossings.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::implicit {
namespace {

using namespace lattice;
using openvdb::Coord;
using openvdb::FloatGrid;
using gridding::Leaf;

constexpr const char* kHashKey = "content_hash";

bool earlier(const Coord& a, const Coord& b) {
  return before({a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()});
}

/// Hash over the active voxels: leaves in z, y, x order, in each its voxels in z, y, x order.
std::uint64_t hash_of(const FloatGrid& grid) {
  std::vector<const Leaf*> leaves;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) leaves.push_back(leaf.getLeaf());
  std::sort(leaves.begin(), leaves.end(), [](const Leaf* a, const Leaf* b) { return earlier(a->origin(), b->origin()); });
  Hasher hasher;
  for (const Leaf* leaf : leaves) {
    for (int k = 0; k < kCells; ++k) {
      for (int j = 0; j < kCells; ++j) {
        for (int i = 0; i < kCells; ++i) {
          const Coord at = leaf->origin() + Coord(i, j, k);
          const auto offset = Leaf::coordToOffset(at);
          if (!leaf->isValueOn(offset)) continue;
          for (int axis = 0; axis < 3; ++axis) hasher.add(static_cast<std::uint64_t>(std::int64_t{at[axis]}));
          hasher.add(double{leaf->getValue(offset)});
        }
      }
    }
  }
  return hasher.value();
}

/// An OpenVDB archive in memory with the offsets that a seekable file has.
class MemoryArchive : public openvdb::io::Archive {
 public:
  [[nodiscard]] std::string bytes(const openvdb::GridCPtrVec& grids) const {
    std::ostringstream stream(std::ios_base::binary);
    stream.exceptions(std::ios_base::badbit | std::ios_base::failbit);  // streams keep what they could not allocate to themselves
    try {
      write(stream, grids, true);
    } catch (const std::ios_base::failure&) {  // in memory nothing else fails
      throw std::bad_alloc();
    }
    return std::move(stream).str();
  }
};

}  // namespace

SurfaceGrid::SurfaceGrid() = default;
SurfaceGrid::~SurfaceGrid() = default;
SurfaceGrid::SurfaceGrid(SurfaceGrid&&) noexcept = default;
SurfaceGrid& SurfaceGrid::operator=(SurfaceGrid&&) noexcept = default;

std::uint64_t SurfaceGrid::active_voxels() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return impl_->grid->activeVoxelCount();
}

std::uint64_t SurfaceGrid::hash() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return hash_of(*impl_->grid);
}

double SurfaceGrid::value(std::int32_t i, std::int32_t j, std::int32_t k) const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return double{impl_->grid->tree().getValue(Coord(i, j, k))};
}

double SurfaceGrid::interpolate(const Vec3& world) const {
  SUPPLE_EXPECTS(impl_ != nullptr && world.allFinite());
  const openvdb::Vec3d at = impl_->grid->worldToIndex({world.x(), world.y(), world.z()});
  const Coord low = Coord::floor(at);
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    Coord node = low;
    for (int axis = 0; axis < 3; ++axis) {
      const double t = at[axis] - low[axis];
      const int step = corner >> axis & 1;
      weight *= step == 1 ? t : 1.0 - t;
      node[axis] += step;
    }
    if (weight != 0.0) sum += weight * double{impl_->grid->tree().getValue(node)};
  }
  return sum;
}

void expect_griddable(const FieldView& field, const GridOptions& options, const Executor& executor) {
  if (gridding::range_of(field, options).count() > gridding::most_leaves(options)) (void)gridding::band_leaves(field, options, executor);
}

SurfaceGrid make_surface_grid(const FieldView& field, const GridOptions& options, const Executor& executor) {
  SurfaceGrid result;
  result.impl_ = std::make_unique<SurfaceGrid::Impl>(gridding::make_whole(field, options, executor).grid);
  return result;
}

namespace {

constexpr std::size_t kPointsPerTask = 512;

/// Newton's steps along the gradient onto the surface; a point that they do not bring there within half a cell stays.
/// @pre no more than kPointsPerTask points
void project(const FieldView& field, double cell, std::span<const Vec3> from, std::span<Vec3> onto) {
  constexpr int kSteps = 6;
  constexpr double kNear = 1e-5, kFarthest = 0.5;  // of a cell; the step from so near goes to the square of it
  std::array<double, kPointsPerTask> values;
  std::array<Vec3, kPointsPerTask> at, gradients;
  std::array<std::size_t, kPointsPerTask> open;
  std::size_t count = from.size();
  for (std::size_t k = 0; k < count; ++k) {
    open[k] = k;
    at[k] = onto[k] = from[k];
  }
  for (int step = 0; step < kSteps && count > 0; ++step) {
    field.evaluate(std::span(at).first(count), std::span(values).first(count), std::span(gradients).first(count));
    std::size_t left = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double square = gradients[k].squaredNorm();
      if (!(square > 0.0)) continue;
      const Vec3 way = -values[k] / square * gradients[k];
      const Vec3 next = at[k] + way;
      if (!((next - from[open[k]]).norm() <= kFarthest * cell)) continue;
      if (way.norm() <= kNear * cell) {
        onto[open[k]] = next;
        continue;
      }
      open[left] = open[k];
      at[left++] = next;
    }
    count = left;
  }
}

using Triangle = std::array<std::uint32_t, 3>;

/// Takes back what presses closed pieces flat: all vertices of one about a node of a thin part may go to the same side of it.
void keep_volumes(const Mesh& mesh, std::vector<Vec3>& onto) {
  constexpr double kLeast = 0.1;  // of the volume before
  std::vector<std::uint32_t> next(onto.size());
  std::iota(next.begin(), next.end(), 0u);
  const auto piece_of = [&](std::uint32_t v) {
    while (next[v] != v) v = next[v] = next[next[v]];
    return v;
  };
  for (const Triangle& t : mesh.triangle) next[piece_of(t[1])] = next[piece_of(t[2])] = piece_of(t[0]);
  std::vector<double> before(onto.size(), 0.0), after(onto.size(), 0.0);  // six times that of a piece, by one of its vertices
  for (const Triangle& t : mesh.triangle) {
    const std::uint32_t piece = piece_of(t[0]);
    const auto volume = [&](const std::vector<Vec3>& p) { return (p[t[0]] - p[piece]).dot((p[t[1]] - p[piece]).cross(p[t[2]] - p[piece])); };
    before[piece] += volume(mesh.position);
    after[piece] += volume(onto);
  }
  for (std::uint32_t v = 0; v < onto.size(); ++v) {
    const std::uint32_t piece = piece_of(v);
    if (before[piece] > 0.0 && after[piece] < kLeast * before[piece]) onto[v] = mesh.position[v];
  }
}

/// Undoes moves that invert triangles, until none is inverted.
void keep_sides(const Mesh& mesh, std::vector<Vec3>& onto) {
  const auto normal_of = [](const std::vector<Vec3>& p, const Triangle& t) { return Vec3((p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]])); };
  for (bool turned = true; turned;) {
    turned = false;
    for (const Triangle& t : mesh.triangle) {
      const Vec3 before = normal_of(mesh.position, t);
      if (before.dot(normal_of(onto, t)) > 0.0 || before.isZero()) continue;
      for (const std::uint32_t v : t) {
        turned = turned || onto[v] != mesh.position[v];
        onto[v] = mesh.position[v];
      }
    }
  }
}

/// Of each two triangles that cross takes back the vertex that was moved farthest, until none cross but those that did before.
void keep_apart(const Mesh& mesh, std::vector<Vec3>& onto) {
  std::vector<std::uint32_t> all(mesh.triangle_count()), back;
  std::iota(all.begin(), all.end(), 0u);
  do {
    keep_sides(mesh, onto);
    back.clear();
    const TriangleBoxes boxes(onto, mesh.triangle, all);
    for (std::uint32_t i = 0; i < all.size(); ++i) {
      const Triangle& s = mesh.triangle[i];
      boxes.each_near(box_of(onto, s), [&](std::uint32_t k) {
        if (k <= i || !triangles_cross(onto, s, mesh.triangle[k])) return;
        double farthest = 0.0;
        std::uint32_t which = 0;
        for (const Triangle& t : {s, mesh.triangle[k]}) {
          for (const std::uint32_t v : t) {
            const double moved = (onto[v] - mesh.position[v]).squaredNorm();
            if (moved > farthest || (moved == farthest && v < which)) which = v;
            farthest = std::max(farthest, moved);
          }
        }
        if (farthest > 0.0) back.push_back(which);
      });
    }
    for (const std::uint32_t v : back) onto[v] = mesh.position[v];
  } while (!back.empty());
}

}  // namespace

Mesh mesh_of(const SurfaceGrid& grid, const FieldView& field, const Executor& executor) {
  SUPPLE_EXPECTS(grid.impl_ != nullptr);
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quadrangles;
  executor.run([&] { openvdb::tools::volumeToMesh(*grid.impl_->grid, points, triangles, quadrangles); });
  Mesh mesh;
  for (const auto& p : points) mesh.position.push_back(Vec3(p.x(), p.y(), p.z()));
  // Clockwise from outside, as it gives them for F < 0 inside.
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) { mesh.triangle.push_back({a, c, b}); };
  for (const auto& t : triangles) add(t[0], t[1], t[2]);
  for (const auto& q : quadrangles) {
    add(q[0], q[1], q[2]);
    add(q[0], q[2], q[3]);
  }
  const double cell = grid.impl_->grid->voxelSize().x();
  std::vector<Vec3> onto(points.size());
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    project(field, cell, std::span(mesh.position).subspan(begin, end - begin), std::span(onto).subspan(begin, end - begin));
  });
  keep_volumes(mesh, onto);
  keep_apart(mesh, onto);
  mesh.position = std::move(onto);
  mesh.normal.resize(points.size());
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    std::array<double, kPointsPerTask> values;
    const auto normals = std::span(mesh.normal).subspan(begin, end - begin);
    field.evaluate(std::span(mesh.position).subspan(begin, end - begin), std::span(values).first(end - begin), normals);
    for (Vec3& n : normals) n = n.squaredNorm() > 0.0 ? Vec3(-n.normalized()) : Vec3::UnitZ();
  });
  return mesh;
}

void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid> grids) {
  std::vector<const SurfaceGrid*> pointers;
  for (const SurfaceGrid& grid : grids) pointers.push_back(&grid);
  write_grids(path, pointers);
}

void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid* const> grids) {
  openvdb::initialize();
  // OpenVDB makes the name of the type once, by a stream, which ends early where memory is out; no program could read the file.
  if (FloatGrid::gridType() != "Tree_float_5_4_3") throw std::bad_alloc();
  openvdb::GridCPtrVec pointers;
  for (const SurfaceGrid* grid : grids) {
    SUPPLE_EXPECTS(grid != nullptr && grid->impl_ != nullptr);
    const FloatGrid::Ptr marked = grid->impl_->grid->copy();  // shares the tree
    marked->insertMeta(kHashKey, openvdb::StringMetadata(to_hex(hash_of(*marked))));
    pointers.push_back(marked);
  }
  std::string bytes;
  Executor(1).run([&] { bytes = MemoryArchive().bytes(pointers); });
  io::write_atomically(path, std::as_bytes(std::span<const char>(bytes)));
}

}  // namespace supple::implicit
