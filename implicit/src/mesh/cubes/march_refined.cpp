#include "mesh/cubes/march_refined.h"

#include <algorithm>
#include <utility>

#include "field/bytes_of.h"
#include "mesh/curved_middle.h"
#include "mesh/error_search.h"
#include "mesh/partition/polygonise_block_edges.h"

namespace supple::implicit::march {
namespace {

constexpr std::size_t kTilesPerTask = 64;

/// The tiles with triangles, in their order.
void list_tiles(const BlockTable& table, std::vector<TileTriangles>& tiles) {
  tiles.clear();
  for (const Block& block : table.block) {
    for (const Tile& tile : block.tile) {
      if (tile.triangles == 0) continue;
      const bool stays = (block.emit >> tile.place & 1u) == 0;
      const std::size_t last = block.old_triangle + std::size_t{block.solve == 0 ? tile.first_triangle : tile.old_triangle};
      tiles.push_back({&block, tile.place, block.first_triangle + std::size_t{tile.first_triangle}, tile.triangles,
                       stays ? last : TileTriangles::kNone});
    }
  }
}

std::uint32_t end_of(const std::array<std::uint32_t, 3>& triangle, std::size_t edge) { return triangle[edge == 2 ? 0 : edge + 1]; }

}  // namespace

void RefinedMarcher::march(const FieldView& field, const Lattice& lattice, bool skip, const Executor& executor) {
  std::swap(now_, last_);
  for (Step& step : last_) {
    for (const StraightEdge& edge : step.straight) {  // for tiles that keep their vertices
      step.mesh.position[edge.vertex] = edge.position;
      step.mesh.normal[edge.vertex] = edge.normal;
    }
  }
  for (Step& step : now_) {
    step.made = step.measured = false;
    step.straight.clear();
  }
  last_first_.swap(first_);
  first_.clear();
  listed_ = false;
  field_ = field;
  skip_ = skip;
  marcher_.march(field, lattice, skip, executor, counts_);
}

void RefinedMarcher::march_anew(const Executor& executor) {
  marcher_.kept = false;
  marcher_.march(field_, Lattice(marcher_.lattice), skip_, executor, counts_);
  if (listed_) list_tiles(marcher_.table, tiles_);  // blocks may lie elsewhere in memory
}

/// Lists the tiles, and finds what the last call's are of them.
void RefinedMarcher::list() {
  if (std::exchange(listed_, true)) return;
  list_tiles(marcher_.table, tiles_);
  first_.clear();
  last_tile_.clear();
  std::size_t at = 0;  // both lists are in the order of triangles
  for (const TileTriangles& tile : tiles_) {
    first_.push_back(tile.first);
    while (tile.last != TileTriangles::kNone && at < last_first_.size() && last_first_[at] < tile.last) ++at;
    const bool found = tile.last != TileTriangles::kNone && at < last_first_.size() && last_first_[at] == tile.last;
    last_tile_.push_back(found ? static_cast<std::uint32_t>(at) : kNone);
  }
  std::vector<std::uint8_t>& same = now_[0].same;
  same.assign(marcher_.mesh.vertex_count(), 0);
  for (const Run& run : marcher_.scratch.stayed) std::fill_n(same.begin() + static_cast<std::ptrdiff_t>(run.to), run.count, std::uint8_t{1});
  now_[0].made = true;
  find_changes();
}

void RefinedMarcher::find_changes() {
  const double feature = field_.feature_size();
  const bool other = std::exchange(feature_, feature) != feature;
  all_differs_ = other || whole();
  if (all_differs_ || !marcher_.sampler->single_precision()) return;
  const blobs::BlobGrid& grid = marcher_.memory.grid;
  const Lattice& lattice = marcher_.lattice;
  lattice::BlockRange range;
  for (std::size_t k = 0; k < 3; ++k) {  // and the tiles next to it
    range.lower[k] = static_cast<std::int32_t>(grid.support().lower[k] / kLeafNodes) - 2;
    range.upper[k] = static_cast<std::int32_t>(grid.support().upper[k] / kLeafNodes) + 2;
  }
  all_differs_ = range.count() > kMostLeaves;
  if (all_differs_) return;
  blob_changes_.reset(range);
  blob_reaches_.clear();
  for (const blobs::BlobGrid::Ball& ball : grid.change().balls) {
    const Vec3 centre = lattice.origin + lattice.cell * Vec3(ball.centre[0], ball.centre[1], ball.centre[2]);
    const double radius = ball.radius * lattice.cell;  // larger than the support by more than round-off
    Reach reach{.rounded = {}, .whole = Box{centre, centre}.inflated(radius)};
    for (std::size_t k = 0; k < 3; ++k) reach.rounded.lower[k] = reach.rounded.upper[k] = centre[static_cast<Eigen::Index>(k)];
    reach.rounded.reach2 = radius * radius;
    blob_changes_.add(reach, lattice);
    blob_reaches_.push_back(reach);
  }
}

bool RefinedMarcher::differs(const Box& evaluated) const {
  if (evaluated.empty()) return false;
  if (all_differs_) return true;
  if (!marcher_.sampler->single_precision()) return marcher_.memory.view.differs_at(evaluated);
  const Lattice& lattice = marcher_.lattice;
  return !blob_changes_.covers(evaluated, lattice) || (blob_changes_.meets(evaluated, lattice) && may_meet(blob_reaches_, evaluated));
}

bool RefinedMarcher::is_same(const TileTriangles& tile, int step) {
  const Mesh& mesh = mesh_of(step);
  const std::vector<std::uint8_t>& same = now_[static_cast<std::size_t>(step)].same;
  bool all = true;
  for_triangles(tile, step, [&](std::size_t n) {
    for (const std::uint32_t v : mesh.triangle[n]) all = all && same[v] != 0;
  });
  return all;
}

const Mesh& RefinedMarcher::mesh(int refinements, bool may_cross, const Executor& executor, CutScratch& scratch) {
  if (refinements > 0) list();
  for (int step = 1; step <= refinements; ++step) {
    if (!now_[static_cast<std::size_t>(step)].made) cut(step, may_cross, executor, scratch);
  }
  counts_.straight_edges = 0;
  for (int step = 1; step <= refinements; ++step) counts_.straight_edges += now_[static_cast<std::size_t>(step)].straight.size();
  return mesh_of(refinements);
}

/// Cuts every triangle into four at the middles of its edges, which are moved to the surface.
void RefinedMarcher::cut(int step, bool may_cross, const Executor& executor, CutScratch& scratch) {
  const Mesh& from = mesh_of(step - 1);
  Step& to = now_[static_cast<std::size_t>(step)];
  const Step& last = last_[static_cast<std::size_t>(step)];
  const std::vector<std::uint8_t>& same = now_[static_cast<std::size_t>(step - 1)].same;
  const std::size_t vertices = from.vertex_count(), triangles = from.triangle_count();
  const auto& triangle = from.triangle;
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
  lattice::expect_indexable(vertices + edges, marcher_.lattice);
  scratch.target.resize(edges);
  scratch.edge.resize(edges);
  scratch.middle.resize(triangles);
  to.added.resize(tiles_.size());
  auto number = static_cast<std::uint32_t>(vertices);
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    to.added[i].first = number;
    for_triangles(tiles_[i], step - 1, [&](std::size_t n) {
      const auto& t = triangle[n];
      for (std::size_t k = 0; k < 3; ++k) {
        if (t[k] >= end_of(t, k)) continue;
        const std::uint32_t at = scratch.start[t[k]]++;
        scratch.target[at] = end_of(t, k);
        scratch.edge[at] = number;
        scratch.middle[n][k] = number++;
      }
    });
    to.added[i].count = number - to.added[i].first;
  }
  Mesh& mesh = to.mesh;
  mesh.position.resize(vertices + edges);
  mesh.normal.resize(vertices + edges);
  mesh.triangle.resize(4 * triangles);
  std::copy(from.position.begin(), from.position.end(), mesh.position.begin());
  std::copy(from.normal.begin(), from.normal.end(), mesh.normal.begin());
  to.same.assign(vertices + edges, 0);
  std::copy(same.begin(), same.end(), to.same.begin());
  executor.for_blocks(tiles_.size(), kTilesPerTask, [&](std::size_t begin, std::size_t end) {
    thread_local std::vector<Vec3> points, normals;
    marcher_.sampler->begin_projection();
    for (std::size_t i = begin; i < end; ++i) {
      TileVertices& added = to.added[i];
      const TileVertices* known = last.made && last_tile_[i] != kNone ? &last.added[last_tile_[i]] : nullptr;
      if (known != nullptr && (!is_same(tiles_[i], step - 1) || differs(known->evaluated))) known = nullptr;
      points.clear();
      for_triangles(tiles_[i], step - 1, [&](std::size_t n) {
        const auto& t = triangle[n];
        auto& middle = scratch.middle[n];
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t a = t[k], b = end_of(t, k);
          if (a < b) {
            if (known != nullptr) continue;
            points.push_back(curved_middle(from.position[a], from.normal[a], from.position[b], from.normal[b]));
          } else {
            std::uint32_t at = b == 0 ? 0 : scratch.start[b - 1];  // starts have moved to the ends
            while (scratch.target[at] != a) ++at;
            middle[k] = scratch.edge[at];
          }
        }
        mesh.triangle[4 * n] = {t[0], middle[0], middle[2]};
        mesh.triangle[4 * n + 1] = {middle[0], t[1], middle[1]};
        mesh.triangle[4 * n + 2] = {middle[2], middle[1], t[2]};
        mesh.triangle[4 * n + 3] = middle;
      });
      const auto first = static_cast<std::ptrdiff_t>(added.first);
      if (known != nullptr) {  // vertices that stay keep their order, and so do the edges between them
        added.evaluated = known->evaluated;
        std::copy_n(last.mesh.position.begin() + known->first, added.count, mesh.position.begin() + first);
        std::copy_n(last.mesh.normal.begin() + known->first, added.count, mesh.normal.begin() + first);
        std::fill_n(to.same.begin() + first, added.count, std::uint8_t{1});
        const auto below = [](const StraightEdge& edge, std::uint32_t vertex) { return edge.vertex < vertex; };
        for (auto edge = std::lower_bound(last.straight.begin(), last.straight.end(), known->first, below);
             edge != last.straight.end() && edge->vertex < known->first + known->count; ++edge) {
          to.same[added.first + (edge->vertex - known->first)] = 0;  // was elsewhere in the last mesh
        }
        continue;
      }
      normals.resize(points.size());
      added.evaluated = Box{};
      marcher_.sampler->project(*tiles_[i].block, tiles_[i].tile, points, normals, added.evaluated);
      std::copy(points.begin(), points.end(), mesh.position.begin() + first);
      std::copy(normals.begin(), normals.end(), mesh.normal.begin() + first);
    }
  });
  to.made = true;
  if (may_cross) return;
  thread_local CutCrossings crossings;
  crossings.take_back(from, executor, mesh, to.straight);
  for (const StraightEdge& edge : to.straight) {
    to.same[edge.vertex] = 0;
    Vec3 slope;
    static_cast<void>(field_.value(mesh.position[edge.vertex], slope));
    if (slope.squaredNorm() > 0.0) mesh.normal[edge.vertex] = -slope.normalized();
  }
}

double RefinedMarcher::error(int refinements, const Executor& executor) {
  list();
  Step& step = now_[static_cast<std::size_t>(refinements)];
  const Step& last = last_[static_cast<std::size_t>(refinements)];
  SUPPLE_EXPECTS(step.made);
  const Mesh& mesh = mesh_of(refinements);
  step.error.resize(tiles_.size());
  executor.for_blocks(tiles_.size(), kTilesPerTask, [&](std::size_t begin, std::size_t end) {
    thread_local std::vector<std::uint32_t> triangle, tile;
    thread_local std::vector<double> error;
    thread_local std::vector<Box> evaluated;
    triangle.clear();
    tile.clear();
    for (std::size_t i = begin; i < end; ++i) {
      if (last.measured && last_tile_[i] != kNone) {
        const TileError& known = last.error[last_tile_[i]];
        if (is_same(tiles_[i], refinements) && !differs(known.evaluated)) {
          step.error[i] = known;
          continue;
        }
      }
      step.error[i] = {};
      for_triangles(tiles_[i], refinements, [&](std::size_t n) {
        triangle.push_back(static_cast<std::uint32_t>(n));
        tile.push_back(static_cast<std::uint32_t>(i));
      });
    }
    error.resize(triangle.size());
    evaluated.resize(triangle.size());
    centroid_errors(field_, mesh, triangle, error, evaluated);
    for (std::size_t j = 0; j < triangle.size(); ++j) {
      TileError& of = step.error[tile[j]];
      of.error = std::max(of.error, error[j]);
      of.evaluated = of.evaluated.united(evaluated[j]);
    }
  });
  step.measured = true;
  double largest = 0.0;
  for (const TileError& tile : step.error) largest = std::max(largest, tile.error);
  return largest;
}

std::uint64_t RefinedMarcher::bytes() const {
  std::uint64_t sum = counts_.bytes + bytes_of(marcher_.mesh) + bytes_of(tiles_) + bytes_of(first_) + bytes_of(last_first_) +
                      bytes_of(last_tile_) + blob_changes_.bytes() + bytes_of(blob_reaches_);
  for (const auto* steps : {&now_, &last_}) {
    for (const Step& step : *steps) sum += bytes_of(step.mesh) + bytes_of(step.added) + bytes_of(step.error) + bytes_of(step.same) + bytes_of(step.straight);
  }
  return sum;
}

Mesh RefinedMarcher::take_mesh(int refinements) {
  now_[static_cast<std::size_t>(refinements)].straight.clear();
  return std::move(mesh_of(refinements));
}

}  // namespace supple::implicit::march
