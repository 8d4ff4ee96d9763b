#include "supple/implicit/march_cubes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "error_search.h"
#include "field_index.h"
#include "march_mesher.h"
#include "polygonise_block_edges.h"
#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::implicit {
namespace march {

void list_tiles(const BlockTable& table, std::vector<TileTriangles>& tiles) {
  tiles.clear();
  for (const Block& block : table.block) {
    for (const Tile& tile : block.tile) {
      if (tile.triangles > 0) tiles.push_back({&block, tile.place, block.first_triangle + tile.first_triangle, tile.triangles});
    }
  }
}

void refine(const Sampler& sampler, const Lattice& lattice, const Executor& executor, MeshScratch& scratch, Mesh& mesh) {
  constexpr std::size_t kTilesPerTask = 64;
  const std::size_t vertices = mesh.vertex_count(), triangles = mesh.triangle_count();
  const auto& triangle = mesh.triangle;
  const auto end_of = [&](const std::array<std::uint32_t, 3>& t, std::size_t k) { return t[k == 2 ? 0 : k + 1]; };
  // Every edge runs once from its lower vertex to its higher one: there it gets its number, in the order of triangles,
  // and the triangle on the other side finds it among the edges of the lower vertex.
  scratch.start.assign(vertices + 1, 0);
  for (const auto& t : triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] < end_of(t, k)) ++scratch.start[t[k] + 1];
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) scratch.start[v + 1] += scratch.start[v];
  const std::size_t edges = scratch.start[vertices];
  lattice::expect_indexable(vertices + edges, lattice);
  scratch.target.resize(edges);
  scratch.edge.resize(edges);
  scratch.middle.resize(triangles);
  auto number = static_cast<std::uint32_t>(vertices);
  for (std::size_t i = 0; i < triangles; ++i) {
    const auto& t = triangle[i];
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] >= end_of(t, k)) continue;
      const std::uint32_t at = scratch.start[t[k]]++;
      scratch.target[at] = end_of(t, k);
      scratch.edge[at] = number;
      scratch.middle[i][k] = number++;
    }
  }
  mesh.position.resize(vertices + edges);
  mesh.normal.resize(vertices + edges);
  scratch.triangle.resize(4 * triangles);
  executor.for_blocks(scratch.tiles.size(), kTilesPerTask, [&](std::size_t begin, std::size_t end) {
    thread_local std::vector<Vec3> points, normals;
    sampler.begin_projection();
    for (std::size_t i = begin; i < end; ++i) {
      const TileTriangles& tile = scratch.tiles[i];
      std::size_t first = 0;
      points.clear();
      for (std::size_t n = tile.first; n < tile.first + tile.count; ++n) {
        const auto& t = triangle[n];
        auto& middle = scratch.middle[n];
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t a = t[k], b = end_of(t, k);
          if (a < b) {
            if (points.empty()) first = middle[k];
            // Middle of the cubic that is perpendicular to both normals (Vlachos et al. 2001, "Curved PN triangles").
            const Vec3 edge = mesh.position[b] - mesh.position[a];
            points.push_back(0.5 * (mesh.position[a] + mesh.position[b]) -
                             0.125 * (edge.dot(mesh.normal[a]) * mesh.normal[a] - edge.dot(mesh.normal[b]) * mesh.normal[b]));
          } else {
            std::uint32_t at = b == 0 ? 0 : scratch.start[b - 1];  // starts have moved to the ends
            while (scratch.target[at] != a) ++at;
            middle[k] = scratch.edge[at];
          }
        }
        scratch.triangle[4 * n] = {t[0], middle[0], middle[2]};
        scratch.triangle[4 * n + 1] = {middle[0], t[1], middle[1]};
        scratch.triangle[4 * n + 2] = {middle[2], middle[1], t[2]};
        scratch.triangle[4 * n + 3] = middle;
      }
      normals.resize(points.size());
      sampler.project(*tile.block, tile.tile, points, normals);
      std::copy(points.begin(), points.end(), mesh.position.begin() + static_cast<std::ptrdiff_t>(first));
      std::copy(normals.begin(), normals.end(), mesh.normal.begin() + static_cast<std::ptrdiff_t>(first));
    }
  });
  mesh.triangle.swap(scratch.triangle);
  for (TileTriangles& tile : scratch.tiles) {
    tile.first *= 4;
    tile.count *= 4;
  }
}

void Marcher::march(const FieldView& field, const Lattice& on, bool skip, const Executor& executor, MarchCounts& counts) {
  const Field* points = field.as_field();
  const double level = points != nullptr ? points->packed().iso : 0.0;
  const bool single = sampler != nullptr && sampler->single_precision();
  sampler = make_sampler(field, on, skip, memory);
  if (!kept || level != iso || sampler->single_precision() != single) memory.forget();
  kept = false;
  iso = level;
  sampler->prepare(executor, table);
  table.begin_call();
  sampler->sample(executor, table);
  assemble(table, *sampler, on, executor, scratch, mesh);
  kept = true;
  lattice = on;
  counts = {};
  counts.blocks = table.block.size();
  counts.single_precision = sampler->single_precision();
  counts.cell = on.cell;
  for (std::size_t b = 0; b < table.block.size(); ++b) {
    if (table.touched[b] == 0) continue;
    counts.tiles_sampled += static_cast<std::uint64_t>(std::popcount(table.block[b].changed));
    counts.kernel_values += table.block[b].kernel_values;
  }
  counts.tiles = table.held.tiles;
  counts.nodes = blobs::kTileNodes * counts.tiles;
  counts.bytes = table.held.bytes + scratch.bytes() + memory.bytes();
}

}  // namespace march

struct CubeMesher::Impl {
  march::Marcher marcher;
  Mesh refined;

  /// The last mesh, refined.
  const Mesh& refine(int refinements, const Executor& executor, MarchCounts& counts);
};

CubeMesher::CubeMesher() : impl_(std::make_unique<Impl>()) {}
CubeMesher::~CubeMesher() = default;
CubeMesher::CubeMesher(CubeMesher&&) noexcept = default;
CubeMesher& CubeMesher::operator=(CubeMesher&&) noexcept = default;

namespace {

/// How a mesh of a level is made: triangles are cut, up to twice, before cells get smaller.
struct LevelPlan {
  double cell = 0.0;  ///< [m]
  int refinements = 0;
};
LevelPlan plan_of(double first_cell, int level) {
  constexpr int kRefinements = 2;
  const int refinements = std::min(level / 2, kRefinements);
  return {spacing_at(first_cell, level - 2 * refinements), refinements};
}

}  // namespace

const Mesh& CubeMesher::make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                             MarchCounts* counts) {
  SUPPLE_EXPECTS(options.refinements >= 0 && options.refinements <= kMostRefinements && options.error >= 0.0);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  march::Marcher& marcher = impl_->marcher;
  if (options.error == 0.0) {
    marcher.march(field, options.lattice, options.skip, executor, count);
    return options.refinements == 0 ? marcher.mesh : impl_->refine(options.refinements, executor, count);
  }
  const double first = first_cell(field, options.lattice.cell);
  const Mesh* mesh = nullptr;
  make_within({.error = options.error, .first = first, .stated = first == options.lattice.cell}, [&](int level) {
    const LevelPlan plan = plan_of(first, level);
    if (mesh == nullptr || plan.cell != marcher.lattice.cell) {
      // What still fits is told by counts, and those of a mesh that was kept may be others than of a fresh one.
      marcher.memory.view.forget();
      marcher.march(field, {.origin = options.lattice.origin, .cell = plan.cell}, options.skip, executor, count);
      mesh = &marcher.mesh;
    }
    if (plan.refinements > 0) mesh = &impl_->refine(plan.refinements, executor, count);
    count.error = centroid_error(field, *mesh, executor);
    return tried(count.error, *mesh, count);
  });
  return *mesh;
}

const Mesh& CubeMesher::Impl::refine(int refinements, const Executor& executor, MarchCounts& counts) {
  refined = marcher.mesh;
  march::list_tiles(marcher.table, marcher.scratch.tiles);
  for (int level = 0; level < refinements; ++level) {
    march::refine(*marcher.sampler, marcher.lattice, executor, marcher.scratch, refined);
  }
  counts.refinements = refinements;
  return refined;
}

void CubeMesher::forget() { impl_->marcher.kept = false; }

Mesh march_cubes(const FieldView& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  CubeMesher mesher;
  return mesher.make(field, options, executor, counts);
}

void expect_marchable(const FieldView& field, const Lattice& lattice, const Executor& executor) {
  march::SamplerMemory memory;
  march::make_sampler(field, lattice, true, memory)->expect_size(executor);
}

}  // namespace supple::implicit
