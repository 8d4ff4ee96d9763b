/// @file mesh_bench.cpp
/// Times and errors of surface meshes, one JSON object per line: CPU times of the index and of the mesh, triangles,
/// memory, a hash, and the distances of vertices and of triangle centroids to the exact surface in cells (RMS; Newton's
/// method along the analytic gradient, in double precision).
///
///   mesh_bench --bounded BODY CELLS            Hausdorff distances of cubes and tetrahedra to a mesh with a quarter of the cell
///                                              and back, with a bounded error (needs the component supple_cgal)
///   mesh_bench [PREFIX [--both]]               e.g. w3/128 or w3/128/cubes; all when absent; --both: errors both ways;
///                                              /moved and /grid: update of a mesh, of a grid when 1 % of the primitives moved;
///                                              /within: the same for meshes to an error of a tenth of a cell, with creases of half a cell;
///                                              /field: the field stage and its lower bounds; /searched (only by its full name):
///                                              cubes and the search for the pieces that they miss
///   mesh_bench --grid BODY CELLS FILE          the field on every node of the grid as raw float32, for other meshers
///   mesh_bench --errors BODY CELLS FILE        errors of a mesh: two int64 counts, float64 points, uint32 triangles
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks/field_bodies.h"
#include "field/field_index.h"
#include "mesh/blob_grid.h"
#include "mesh/cubes/march_sampling.h"
#include "programs.h"
#include "supple/core/hash.h"
#include "supple/implicit/creases.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/missed_pieces.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/surface_grid.h"
#include "support/mesh_distance.h"
#ifdef SUPPLE_HAS_CGAL
#include "supple/cgal/surface_meshes.h"
#endif
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::implicit;
using benchmarks::Body;

/// The cube that holds all supports with 2 % to spare, and its cells.
struct Frame {
  Vec3 lower = Vec3::Zero();
  double side = 0.0;
  [[nodiscard]] Lattice lattice(int cells) const { return {.origin = lower, .cell = side / cells}; }
};

Frame frame_of(const Body& body) {
  Box box;
  for (const Box& support : body.placed.support) box = box.united(support);
  const double side = 1.02 * box.extent().maxCoeff();
  return {.lower = box.centre() - Vec3::Constant(0.5 * side), .side = side};
}

Body make_body(std::string_view name) {
  if (name == "w1") return benchmarks::plate_spiral();
  if (name == "capsules") return benchmarks::capsules(1000);
  if (name == "united") return benchmarks::united_blobs(2000);
  return benchmarks::blobs(name == "w2" ? 1000u : name == "w3" ? 10000u : 100000u);
}

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// RMS distance of points to the surface.
double rms_distance(const Field& field, std::span<const Vec3> points) {
  constexpr std::size_t kMost = 200'000;
  constexpr std::size_t kBatch = 1024;
  const std::size_t stride = 1 + points.size() / kMost;
  std::vector<Vec3> start;
  for (std::size_t i = 0; i < points.size(); i += stride) start.push_back(points[i]);
  double sum = 0.0;
  std::vector<double> values(kBatch);
  std::vector<Vec3> gradients(kBatch);
  for (std::size_t begin = 0; begin < start.size(); begin += kBatch) {
    const std::size_t n = std::min(kBatch, start.size() - begin);
    std::vector<Vec3> at(start.begin() + static_cast<std::ptrdiff_t>(begin),
                         start.begin() + static_cast<std::ptrdiff_t>(begin + n));
    for (int round = 0; round < 5; ++round) {
      field.evaluate(at, std::span(values).first(n), std::span(gradients).first(n));
      for (std::size_t i = 0; i < n; ++i) {
        const double g2 = gradients[i].squaredNorm();
        if (g2 > 0.0) at[i] -= values[i] / g2 * gradients[i];
      }
    }
    for (std::size_t i = 0; i < n; ++i) sum += (at[i] - start[begin + i]).squaredNorm();
  }
  return start.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(start.size()));
}

/// RMS and largest distance of points of the exact surface to a mesh: vertices, in double precision, of tetrahedra on a
/// lattice that shares no nodes.
struct Back {
  double rms = 0.0, largest = 0.0;
};
Back distance_back(const Field& field, const Lattice& lattice, const Mesh& mesh) {
  const Mesh exact = polygonise(
      field, {.origin = lattice.origin + Vec3::Constant(0.37 * lattice.cell), .cell = lattice.cell}, Executor(2));
  const supple::testing::MeshDistance distance(mesh, lattice.cell);
  const std::size_t stride = 1 + exact.vertex_count() / 100'000;
  Back back;
  double n = 0.0;
  for (std::size_t i = 0; i < exact.vertex_count(); i += stride, ++n) {
    const double d = distance(exact.position[i]);
    back.rms += d * d;
    back.largest = std::max(back.largest, d);
  }
  back.rms = n > 0.0 ? std::sqrt(back.rms / n) : 0.0;
  return back;
}

std::vector<Vec3> centroids(const Mesh& mesh) {
  std::vector<Vec3> points;
  points.reserve(mesh.triangle_count());
  for (const auto& t : mesh.triangle) {
    points.push_back((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0);
  }
  return points;
}

std::string hash_of(const Mesh& mesh) {
  Hasher hasher;
  hasher.add(std::span<const Vec3>(mesh.position));
  hasher.add(std::span<const Vec3>(mesh.normal));
  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) hasher.add(std::uint64_t{v});
  }
  return to_hex(hasher.value());
}

struct Method {
  std::string_view name;
  int refinements;  ///< -1: tetrahedra, -2: a grid and OpenVDB's volumeToMesh, -3: cubes and a search for missed pieces
  bool may_cross = false;
};
/// "refined" starts from a lattice of twice the cell, "refined_twice" of four times.
constexpr std::array<Method, 8> kMethods{{{"cubes", 0}, {"refined", 1}, {"refined_twice", 2}, {"refined_may_cross", 1, true},
                                          {"refined_twice_may_cross", 2, true}, {"tetrahedra", -1}, {"openvdb", -2}, {"searched", -3}}};

/// 1 % of the blobs, those nearest to one on the surface.
std::vector<std::uint32_t> blobs_at_the_side(const Body& body) {
  std::vector<std::uint32_t> order(body.parts.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::size_t top = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (body.parts[i].position.x() > body.parts[top].position.x()) top = i;
  }
  const Vec3 centre = body.parts[top].position;
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return (body.parts[a].position - centre).squaredNorm() < (body.parts[b].position - centre).squaredNorm();
  });
  order.resize(std::max<std::size_t>(order.size() / 100, 1));
  return order;
}

/// Moves them by a tenth of their radius, to and fro.
void move(Body& body, std::span<const std::uint32_t> some, int repeat) {
  for (const std::uint32_t i : some) {
    body.parts[i].position.z() += (repeat % 2 == 0 ? 0.1 : -0.1) * body.skeleton.primitive[i].kernel.radius;
  }
  body.place();
}

/// A signed distance on the leaves around the surface as a grid for OpenVDB, and its update when 1 % of the blobs moved.
void measure_grid(const std::string& name, Body& body, const Lattice& lattice) {
  const Executor executor(1);
  const std::vector<std::uint32_t> some = blobs_at_the_side(body);
  const GridOptions options{.lattice = lattice};
  GridUpdater updater;
  GridCounts counts;
  double whole = 1e300, moved = 1e300, total = 0.0;
  std::uint64_t leaves = 0, sampled = 0;
  for (int repeat = 0; repeat < 40 && (repeat < 4 || total < 1.5); ++repeat) {
    move(body, some, repeat);
    (void)body.field.index();
    double begin = cpu_seconds();
    const SurfaceGrid& kept = updater.make(body.field, options, executor, &counts);
    const double once = cpu_seconds() - begin;
    if (repeat > 0) {
      moved = std::min(moved, once);
      sampled = counts.leaves_sampled;
    } else {
      leaves = counts.leaves_sampled;
    }
    begin = cpu_seconds();
    const SurfaceGrid made = make_surface_grid(body.field, options, executor);
    const double all = cpu_seconds() - begin;
    whole = std::min(whole, all);
    total += all;
    if (repeat < 3 && made.hash() != kept.hash()) std::printf("%s: differs from a whole grid\n", name.c_str());
  }
  std::printf("{\"name\": \"implicit/mesh/%s\", \"threads\": 1, \"cpu_ms_min\": %.5g, \"whole_cpu_ms\": %.5g, "
              "\"share\": %.3g, \"leaves\": %llu, \"leaves_sampled\": %llu}\n",
              name.c_str(), 1e3 * moved, 1e3 * whole, moved / whole, static_cast<unsigned long long>(leaves),
              static_cast<unsigned long long>(sampled));
  std::fflush(stdout);
}

/// @tparam Mesher  CubeMesher or CreaseMesher
template <class Mesher>
void measure_moved(const std::string& name, Body& body, const MarchOptions& options) {
  const Executor executor(1);
  Mesher mesher, fresh;
  MarchCounts counts;
  const std::vector<std::uint32_t> some = blobs_at_the_side(body);
  // Memory stays at hand where it can, as in an animation where all moves.
  const auto start_afresh = [&] {
    if constexpr (requires { fresh.forget(); }) {
      fresh.forget();
    } else {
      fresh = Mesher();
    }
  };
  const auto move_some = [&](int repeat) {
    move(body, some, repeat);
    if (body.field.packed().primitive[0].kind != PackedKind::PointWyvill) (void)body.field.index();
  };
  double whole = 1e300, moved = 1e300, total = 0.0;
  Mesh mesh;
  for (int repeat = 0; repeat < 100 && (repeat < 4 || total < 1.5); ++repeat) {
    move_some(repeat);
    double begin = cpu_seconds();
    const Mesh& kept = mesher.make(body.field, options, executor, &counts);
    const double once = cpu_seconds() - begin;
    if (repeat > 0) moved = std::min(moved, once);
    mesh = kept;
    start_afresh();
    begin = cpu_seconds();
    const Mesh& made = fresh.make(body.field, options, executor);
    const double all = cpu_seconds() - begin;
    whole = std::min(whole, all);
    if (hash_of(made) != hash_of(mesh)) std::printf("%s: differs from a fresh mesh\n", name.c_str());
    total += all;
  }
  // Above, what is kept has left the nearer caches from call to call; here frame follows frame.
  double next = 1e300, next_whole = 1e300, still = 1e300;
  for (const bool keeps : {true, false}) {
    double& best = keeps ? next : next_whole;
    total = 0.0;
    for (int repeat = 0; repeat < 100 && (repeat < 4 || total < 0.5); ++repeat) {
      move_some(repeat);
      if (!keeps) start_afresh();
      const double begin = cpu_seconds();
      (void)(keeps ? mesher : fresh).make(body.field, options, executor);
      const double once = cpu_seconds() - begin;
      best = std::min(best, once);
      total += once;
    }
  }
  const auto sampled = static_cast<unsigned long long>(counts.tiles_sampled);
  for (int repeat = 0; repeat < 4; ++repeat) {
    const double begin = cpu_seconds();
    (void)mesher.make(body.field, options, executor, &counts);
    if (repeat > 0) still = std::min(still, cpu_seconds() - begin);
  }
  std::printf("{\"name\": \"implicit/mesh/%s\", \"threads\": 1, \"cpu_ms_min\": %.5g, \"whole_cpu_ms\": %.5g, "
              "\"share\": %.3g, \"in_a_row_cpu_ms\": %.5g, \"whole_in_a_row_cpu_ms\": %.5g, \"share_in_a_row\": %.3g, \"still_cpu_ms\": %.4g, "
              "\"kept_mb\": %.4g, \"tiles_sampled\": %llu, \"items\": %zu, \"hash\": \"%s\"}\n",
              name.c_str(), 1e3 * moved, 1e3 * whole, moved / whole, 1e3 * next, 1e3 * next_whole, next / next_whole, 1e3 * still,
              1e-6 * static_cast<double>(counts.bytes), sampled, mesh.triangle_count(), hash_of(mesh).c_str());
  std::fflush(stdout);
}

std::uint64_t bytes_of(const Mesh& mesh) {
  return mesh.position.capacity() * sizeof(Vec3) + mesh.normal.capacity() * sizeof(Vec3) +
         mesh.triangle.capacity() * sizeof(mesh.triangle[0]);
}

/// Of the process so far [MB].
double peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1e-6 * 1024.0 * static_cast<double>(usage.ru_maxrss);
}

void measure(const std::string& name, Body& body, const Lattice& lattice, const Method& method, bool two_sided) {
  const Executor executor(1);
  body.place();
  const double peak_before = peak_mb();
  double index = 1e300, best = 1e300, total = 0.0;
  Mesh mesh;
  CubeMesher mesher;
  MarchCounts counts;
  MissedPieces missed;
  const Mesh* made = &mesh;
  Lattice coarse = lattice;
  coarse.cell *= std::ldexp(1.0, std::max(method.refinements, 0));
  for (int repeat = 0; repeat < 200 && (repeat < (method.refinements == -3 ? 1 : 3) || total < 0.6); ++repeat) {
    mesher.forget();  // memory stays at hand, as in an animation where all moves
    const double begin = cpu_seconds();
    body.place();
    const double indexed = cpu_seconds();
    if (method.refinements == -2) {
      mesh = mesh_of(make_surface_grid(body.field, {.lattice = lattice}, executor), body.field, executor);
    } else if (method.refinements == -3) {
      mesh = mesher.make(body.field, {.lattice = lattice}, executor, &counts);
      missed = add_missed_pieces(body.field, lattice, executor, mesh);
    } else if (method.refinements < 0) {
      mesh = polygonise(body.field, lattice, executor);
    } else {
      made = &mesher.make(body.field, {.lattice = coarse, .refinements = method.refinements, .may_cross = method.may_cross}, executor, &counts);
    }
    const double end = cpu_seconds();
    index = std::min(index, indexed - begin);
    best = std::min(best, end - indexed);
    total += end - begin;
  }
  const std::uint64_t bytes = counts.bytes;
  const double peak = peak_mb();
  if (made != &mesh) mesh = *made;
  const double vertex_error = rms_distance(body.field, mesh.position) / lattice.cell;
  const double centroid_error = rms_distance(body.field, centroids(mesh)) / lattice.cell;
  const Back back = two_sided ? distance_back(body.field, lattice, mesh) : Back{};
  std::printf("{\"name\": \"implicit/mesh/%s\", \"threads\": 1, \"cpu_ms_min\": %.5g, \"index_cpu_ms\": %.4g, "
              "\"items\": %zu, \"items_per_s\": %.4g, \"error\": %.4g, \"error_kind\": \"rms_centroid_over_h\", "
              "\"rms_vertex_over_h\": %.3g, \"rms_back_over_h\": %.3g, \"largest_back_over_h\": %.3g, \"mesh_mb\": %.4g, \"work_mb\": %.4g, \"peak_mb\": %.4g, \"peak_of_body_mb\": %.4g, \"pieces\": %llu, \"joined\": %llu, \"undecided\": %llu, \"hash\": \"%s\"}\n",
              name.c_str(), 1e3 * best, 1e3 * index, mesh.triangle_count(),
              static_cast<double>(mesh.triangle_count()) / best, centroid_error, vertex_error,
              back.rms / lattice.cell, back.largest / lattice.cell,
              1e-6 * static_cast<double>(bytes_of(mesh)), 1e-6 * static_cast<double>(bytes), peak, peak_before, static_cast<unsigned long long>(missed.pieces),
              static_cast<unsigned long long>(missed.joined), static_cast<unsigned long long>(missed.undecided), hash_of(mesh).c_str());
  std::fflush(stdout);
}

/// Errors of a mesh that another program made.
int report_errors(Body& body, const Lattice& lattice, const char* path) {
  std::ifstream in(path, std::ios::binary);
  std::int64_t counts[2] = {};
  in.read(reinterpret_cast<char*>(counts), sizeof counts);
  Mesh mesh;
  mesh.position.resize(static_cast<std::size_t>(counts[0]));
  mesh.triangle.resize(static_cast<std::size_t>(counts[1]));
  in.read(reinterpret_cast<char*>(mesh.position.data()), counts[0] * static_cast<std::int64_t>(sizeof(Vec3)));
  in.read(reinterpret_cast<char*>(mesh.triangle.data()), counts[1] * std::int64_t{12});
  if (!in) {
    std::fprintf(stderr, "%s: too short\n", path);
    return 1;
  }
  const Back back = distance_back(body.field, lattice, mesh);
  std::printf("{\"items\": %zu, \"error\": %.4g, \"error_kind\": \"rms_centroid_over_h\", \"rms_vertex_over_h\": %.3g, "
              "\"rms_back_over_h\": %.3g, \"largest_back_over_h\": %.3g}\n",
              mesh.triangle_count(), rms_distance(body.field, centroids(mesh)) / lattice.cell,
              rms_distance(body.field, mesh.position) / lattice.cell, back.rms / lattice.cell,
              back.largest / lattice.cell);
  return 0;
}

/// Calls use(corner x, y, z, values) for the tiles of a grid of n^3 nodes that some support reaches, all evaluated.
template <class Use>
void evaluate_touched(const Field& field, const Lattice& lattice, std::int64_t n, const Use& use) {
  const auto iso = static_cast<float>(field.packed().iso);
  blobs::BlobGrid grid;
  grid.build(field.packed().primitive, lattice);
  blobs::BlobList block, leaf;
  blobs::LeafTiles tiles;
  alignas(64) float tile_values[blobs::kTileNodes];
  const auto for_corners = [](int edge, const auto& at) {
    for (int c = 0; c < 8; ++c) at(edge * (c & 1), edge * (c >> 1 & 1), edge * (c >> 2));
  };
  const auto centre = [](int x, int y, int z, float half) {
    return std::array{static_cast<float>(x) + half, static_cast<float>(y) + half, static_cast<float>(z) + half};
  };
  for (std::int64_t bz = 0; bz < n; bz += 16) {
    for (std::int64_t by = 0; by < n; by += 16) {
      for (std::int64_t bx = 0; bx < n; bx += 16) {
        grid.gather({bx, by, bz}, 16, 0, block);
        if (block.count == 0) continue;
        for_corners(8, [&](int lx, int ly, int lz) {
          (void)blobs::select(block, centre(lx, ly, lz, 4.0F), 4.0F, leaf);
          if (leaf.count == 0) return;
          blobs::select_tiles(leaf, centre(lx, ly, lz, 4.0F), 0xffu, tiles);
          for_corners(4, [&](int tx, int ty, int tz) {
            const int x0 = lx + tx, y0 = ly + ty, z0 = lz + tz;
            const blobs::TileBlobs& tile = tiles.blobs[static_cast<std::size_t>(tx >> 2 | ty >> 1 | tz)];
            if (tile.count() == 0) return;
            blobs::evaluate_tile(leaf, tile, centre(x0, y0, z0, 0.0F), iso, std::numeric_limits<float>::infinity(), tile_values);
            use(bx + x0, by + y0, bz + z0, tile_values);
          });
        });
      }
    }
  }
}

/// Values where bounds admit a surface, candidate search included.
double sample_seconds(const Field& field, const Lattice& lattice, march::SamplerMemory& kept, march::BlockTable& table) {
  const Executor executor(1);
  const double begin = cpu_seconds();
  const auto sampler = march::make_sampler(field, lattice, true, kept);
  sampler->prepare(executor, table);
  sampler->sample(executor, table);
  return cpu_seconds() - begin;
}

/// Kernel values a second where nothing but their sum is taken: blobs in the nearest cache that all reach the tile.
double kernel_rate() {
  constexpr std::size_t kBlobs = 256, kTiles = 400;
  blobs::BlobList list;
  blobs::TileBlobs tile;
  list.reserve(kBlobs);
  tile.near.place.resize(kBlobs + blobs::kLanes);
  tile.near.count = list.count = list.near = kBlobs;
  for (std::uint32_t i = 0; i < kBlobs; ++i) {
    tile.near.place[i] = i;
    list.scale[i] = 0.1F;
    list.x[i] = list.y[i] = list.z[i] = 1e-3F * static_cast<float>(i);
  }
  list.pad();
  alignas(64) float values[blobs::kTileNodes];
  const float none = std::numeric_limits<float>::infinity();
  const double begin = cpu_seconds();
  for (std::size_t k = 0; k < kTiles; ++k) {
    blobs::evaluate_tile(list, tile, {static_cast<float>(k % 4), 0.0F, 0.0F}, 0.5F, none, values);
  }
  return static_cast<double>(kTiles * kBlobs * blobs::kTileNodes) / (cpu_seconds() - begin);
}

/// The field stage against two floors: the kernel values of all nodes of the leaves that hold surface at the rate of `kernel_rate`, and
/// evaluating every tile that a support reaches.
void measure_field(const std::string& name, const Body& body, const Lattice& lattice, int cells) {
  double stage = 1e300, touched = 1e300, sum = 0.0, values = 0.0, rate = 0.0;
  march::SamplerMemory kept;
  march::BlockTable table;
  for (int repeat = 0; repeat < 10; ++repeat) {
    kept.forget();  // memory stays at hand, as in an animation where all moves
    stage = std::min(stage, sample_seconds(body.field, lattice, kept, table));
    rate = std::max(rate, kernel_rate());
    const double begin = cpu_seconds();
    evaluate_touched(body.field, lattice, cells + 1,
                     [&](std::int64_t, std::int64_t, std::int64_t, const float* tile) { sum += static_cast<double>(tile[0]); });
    touched = std::min(touched, cpu_seconds() - begin);
    if (repeat > 0) continue;
    blobs::BlobList near, leaf_list;
    for (const march::Block& block : table.block) {
      if (block.uniform()) continue;
      kept.grid.gather(block.base(), march::kBlockNodes, 0, near);
      for (unsigned leaf = 0; leaf < march::kLeaves; ++leaf) {
        if ((block.held & march::tiles_of(leaf)) == 0) continue;
        const std::array centre{8.0F * static_cast<float>(leaf & 1u) + 4.0F, 8.0F * static_cast<float>(leaf >> 1 & 1u) + 4.0F,
                                8.0F * static_cast<float>(leaf >> 2) + 4.0F};
        (void)blobs::select(near, centre, 4.0F, leaf_list);
        values += static_cast<double>(leaf_list.count) * 8 * blobs::kTileNodes;
      }
    }
  }
  const double floor = values / rate;
  std::printf("{\"name\": \"implicit/mesh/%s\", \"threads\": 1, \"cpu_ms_min\": %.5g, \"items\": %.4g, \"items_per_s\": %.4g, "
              "\"kernel_values_per_s\": %.4g, \"floor_cpu_ms\": %.4g, \"over_floor\": %.3g, \"touched_cpu_ms\": %.4g, \"over_touched\": %.3g, \"hash\": \"%s\"}\n",
              name.c_str(), 1e3 * stage, values, values / stage, rate, 1e3 * floor, stage / floor, 1e3 * touched, stage / touched,
              to_hex(static_cast<std::uint64_t>(std::abs(sum))).c_str());
  std::fflush(stdout);
}

/// What a user of other meshers writes without a field stage of ours: each blob (1 - d^2/R^2)^3 is added to the nodes that its
/// support reaches, row by row in vectors.
void splat(const Body& body, const Lattice& lattice, std::int64_t n, std::vector<float>& values) {
  std::fill(values.begin(), values.end(), -static_cast<float>(body.skeleton.iso));
  const auto reach = [n](double middle, double half) {
    return std::array{std::max<std::int64_t>(0, static_cast<std::int64_t>(std::ceil(middle - half))),
                      std::min<std::int64_t>(n - 1, static_cast<std::int64_t>(std::floor(middle + half)))};
  };
  for (std::size_t i = 0; i < body.parts.size(); ++i) {
    const double radius = body.skeleton.primitive[i].kernel.radius / lattice.cell;
    const Vec3 at = (body.parts[i].position - lattice.origin) / lattice.cell;
    const auto scale = static_cast<float>(1.0 / (radius * radius)), x = static_cast<float>(at.x());
    const auto [z0, z1] = reach(at.z(), radius);
    for (std::int64_t z = z0; z <= z1; ++z) {
      const double across = radius * radius - (static_cast<double>(z) - at.z()) * (static_cast<double>(z) - at.z());
      const auto [y0, y1] = reach(at.y(), std::sqrt(std::max(across, 0.0)));
      for (std::int64_t y = y0; y <= y1; ++y) {
        const double along = across - (static_cast<double>(y) - at.y()) * (static_cast<double>(y) - at.y());
        const auto [x0, x1] = reach(at.x(), std::sqrt(std::max(along, 0.0)));
        const float middle = static_cast<float>(along) * scale, first = static_cast<float>(x0) - x;
        float* row = values.data() + (z * n + y) * n + x0;
        for (int k = 0; k <= static_cast<int>(x1 - x0); ++k) {
          const float d = first + static_cast<float>(k);
          const float v = std::max(middle - d * d * scale, 0.0F);
          row[k] += v * v * v;
        }
      }
    }
  }
}

/// The field on all nodes in single precision, x fastest, for other meshers: node count, origin and cell as float64, then
/// the values. Times: evaluating wherever a support reaches, only where bounds admit a surface, and `splat`.
int write_grid(Body& body, const Lattice& lattice, int cells, const char* path) {
  const auto n = static_cast<std::int64_t>(cells) + 1;
  const auto iso = static_cast<float>(body.skeleton.iso);
  std::vector<float> values(static_cast<std::size_t>(n * n * n), -iso);
  double touched = 1e300, surface = 1e300, splatted = 1e300;
  float apart = 0.0F;
  for (int repeat = 0; repeat < 3; ++repeat) {
    double begin = cpu_seconds();
    splat(body, lattice, n, values);
    splatted = std::min(splatted, cpu_seconds() - begin);
    const std::vector<float> other = values;
    begin = cpu_seconds();
    evaluate_touched(body.field, lattice, n, [&](std::int64_t x, std::int64_t y0, std::int64_t z0, const float* tile) {
      for (int row = 0; row < 16; ++row) {
        const std::int64_t y = y0 + row % 4, z = z0 + row / 4;
        if (y >= n || z >= n || x >= n) continue;
        std::copy_n(tile + 4 * row, std::min<std::int64_t>(4, n - x), values.begin() + (z * n + y) * n + x);
      }
    });
    touched = std::min(touched, cpu_seconds() - begin);
    for (std::size_t i = 0; i < values.size(); ++i) apart = std::max(apart, std::abs(values[i] - other[i]));
    march::SamplerMemory kept;
    march::BlockTable table;
    surface = std::min(surface, sample_seconds(body.field, lattice, kept, table));
  }
  std::ofstream out(path, std::ios::binary);
  const double header[5] = {static_cast<double>(n), lattice.origin.x(), lattice.origin.y(), lattice.origin.z(),
                            lattice.cell};
  out.write(reinterpret_cast<const char*>(header), sizeof header);
  out.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(4 * values.size()));
  std::printf("{\"cpu_ms_touched\": %.5g, \"cpu_ms_surface\": %.5g, \"cpu_ms_splat\": %.5g, \"splat_differs_by\": %.2g}\n", 1e3 * touched,
              1e3 * surface, 1e3 * splatted, static_cast<double>(apart));
  return out.good() ? 0 : 1;
}

#ifdef SUPPLE_HAS_CGAL
/// The reference errs by a sixteenth of what the meshes do.
int report_bounded(const std::string& name, const Body& body, const Frame& frame, int cells) {
  const Executor executor(2);
  const Lattice lattice = frame.lattice(cells);
  const double error = 0.01 * lattice.cell;
  const Mesh exact = polygonise(body.field, frame.lattice(4 * cells), executor);
  for (const bool cubes : {true, false}) {
    const Mesh mesh = cubes ? march_cubes(body.field, {.lattice = lattice}, executor) : polygonise(body.field, lattice, executor);
    const double begin = cpu_seconds();
    const double there = cgal::one_sided_hausdorff_distance(mesh, exact, error);
    const double back = cgal::one_sided_hausdorff_distance(exact, mesh, error);
    std::printf("{\"name\": \"implicit/bounded/%s/%d/%s\", \"cpu_ms_min\": %.4g, \"items\": %zu, \"error\": %.4g, "
                "\"error_kind\": \"hausdorff_over_h\", \"back_over_h\": %.4g, \"bound_over_h\": 0.01}\n",
                name.c_str(), cells, cubes ? "cubes" : "tetrahedra", 1e3 * (cpu_seconds() - begin), mesh.triangle_count(),
                there / lattice.cell, back / lattice.cell);
    std::fflush(stdout);
  }
  return 0;
}
#endif

bool starts_alike(std::string_view a, std::string_view b) {
  const std::size_t n = std::min(a.size(), b.size());
  return a.substr(0, n) == b.substr(0, n);
}

}  // namespace

int supple::benchmarks::programs::mesh_bench(int argc, char** argv) {
  using supple::benchmarks::whole_number;
  constexpr std::array<std::string_view, 6> kBodies{"w1", "w2", "w3", "w4", "capsules", "united"};
  constexpr std::string_view kUsage =
      "mesh_bench [PREFIX [--both]]          prefix of the names to run, e.g. w3/128; --both: errors both ways\n"
      "       mesh_bench --bounded BODY CELLS\n"
      "       mesh_bench --grid BODY CELLS FILE\n"
      "       mesh_bench --errors BODY CELLS FILE";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 4, {{"--both"}, {"--bounded", 2}, {"--grid", 3}, {"--errors", 3}});
  // After an option: a body and its cells.
  if (argc > 3) supple::benchmarks::expect_word(kUsage, argv[2], kBodies);
  const int own_cells = argc > 3 ? whole_number(kUsage, argv[3], 2) : 0;
  if (argc == 4 && std::string_view(argv[1]) == "--bounded") {
#ifdef SUPPLE_HAS_CGAL
    const Body body = make_body(argv[2]);
    return report_bounded(argv[2], body, frame_of(body), own_cells);
#else
    std::fputs("built without the component supple_cgal\n", stderr);
    return 2;
#endif
  }
  if (argc == 5 && std::string_view(argv[1]) == "--errors") {
    Body body = make_body(argv[2]);
    return report_errors(body, frame_of(body).lattice(own_cells), argv[4]);
  }
  if (argc == 5 && std::string_view(argv[1]) == "--grid") {
    Body body = make_body(argv[2]);
    return write_grid(body, frame_of(body).lattice(own_cells), own_cells, argv[4]);
  }
  const std::string_view filter = argc > 1 ? argv[1] : "";
  const bool two_sided = argc > 2 && std::string_view(argv[2]) == "--both";
  bool any = false;
  const auto wanted = [&](const std::string& name) {
    const bool named = name.starts_with(filter);
    any = any || named;
    return named;
  };
  for (const std::string_view known : kBodies) {
    const std::string body_name(known);
    if (!starts_alike(filter, body_name)) continue;
    Body body = make_body(body_name);
    const Frame frame = frame_of(body);
    for (const int cells : {64, 128, 256, 512}) {
      for (const Method& method : kMethods) {
        const std::string name = body_name + '/' + std::to_string(cells) + '/' + std::string(method.name);
        if (!wanted(name) || (method.refinements == -3 && name != filter)) continue;
        measure(name, body, frame.lattice(cells), method, two_sided);
      }
      const Lattice lattice = frame.lattice(cells);
      for (const bool within : {false, true}) {
        const std::string name = body_name + '/' + std::to_string(cells) + (within ? "/within" : "/moved");
        if (body_name == "w1" || !wanted(name) || (within && name != filter)) continue;
        MarchOptions options{.lattice = lattice};
        if (within) options = {.lattice = {.origin = lattice.origin, .cell = 0.0}, .error = (body_name == "united" ? 0.5 : 0.1) * lattice.cell};
        if (body.skeleton.blend.rule == BlendRule::Graph) {
          measure_moved<CreaseMesher>(name, body, options);
        } else {
          measure_moved<CubeMesher>(name, body, options);
        }
      }
      const std::string field = body_name + '/' + std::to_string(cells) + "/field";
      if (body_name != "w1" && wanted(field)) {
        measure_field(field, body, frame.lattice(cells), cells);
      }
      const std::string grid = body_name + '/' + std::to_string(cells) + "/grid";
      if (body_name != "w1" && wanted(grid)) {
        measure_grid(grid, body, frame.lattice(cells));
      }
    }
  }
  if (!any) supple::benchmarks::refuse(kUsage, "a prefix of a name, such as w3/128", filter);
  return 0;
}
