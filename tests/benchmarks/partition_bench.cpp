/// @file partition_bench.cpp
/// Random balls that overlap, divided by polygonise_partition and delaunay_partition: sets of two, three, four and six, the same in every
/// run, one JSON object per line. Corners, where four regions (balls and outside) meet, have closed forms; the boundary curves between two
/// balls and outside are circles, or for other points the nearest ones that Newton's method finds.
///   partition_bench rims [SETS] [CELL]       distances of vertices on boundary curves and corners to the exact ones, over the cell
///   partition_bench delaunay [SETS] [SIZE]   number of sets that meet the angle
///   partition_bench moved [BALLS] [CELL] [ERROR]  a pile in which some balls move: PartitionMesher against polygonise_partition, or, for an
///                                            error [m] from CELL on, PartitionErrorMesher against polygonise_partition_within, one thread;
///                                            share is the ratio of the times, blocks_share that of the blocks visited
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <string_view>
#include <vector>

#include "implicit/analytic_fields.h"
#include "mesh/delaunay/patch_complex.h"
#include "programs.h"
#include "supple/core/content_versions.h"
#include "supple/core/hash.h"
#include "supple/implicit/delaunay.h"
#include "supple/implicit/partition_mesher.h"
#include "supple/implicit/polygonise.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::implicit;
using lattice::Label;
using lattice::LabelSet;

struct Ball {
  Vec3 centre;
  double radius;
  [[nodiscard]] double value(const Vec3& p) const { return radius - (p - centre).norm(); }
};

std::vector<Ball> random_balls(std::uint64_t seed, int count) {
  testing::Random random(seed);
  std::vector<Ball> balls;
  for (int i = 0; i < count; ++i) {
    const Vec3 centre = random.in_box(0.4);
    balls.push_back({centre, random.uniform(0.25, 0.5)});
  }
  return balls;
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Points at which the fields of three balls are 0, or those of four agree, and no other ball's is larger.
std::vector<Vec3> corners_of(const std::vector<Ball>& balls) {
  std::vector<Vec3> found;
  const std::size_t n = balls.size();
  const auto keep = [&](const Vec3& p, double level) {
    for (const Ball& ball : balls) {
      if (ball.value(p) > level + 1e-9) return;
    }
    if (level > -1e-12) found.push_back(p);
  };
  // |p - c_i| = r_i - s: differences are linear in p and s, and p = a + b s leaves a quadratic of s. With outside s = 0.
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      for (std::size_t k = 0; k < j; ++k) {
        const Vec3 u = balls[j].centre - balls[i].centre, v = balls[k].centre - balls[i].centre, w = u.cross(v);
        const auto half = [&](const Ball& b, const Vec3& to) {
          return 0.5 * (to.squaredNorm() - b.radius * b.radius + balls[i].radius * balls[i].radius);
        };
        const Vec3 foot = (half(balls[j], u) * v.cross(w) + half(balls[k], v) * w.cross(u)) / w.squaredNorm();
        const double rest = balls[i].radius * balls[i].radius - foot.squaredNorm();
        if (rest >= 0.0) {
          for (const double sign : {-1.0, 1.0}) keep(balls[i].centre + foot + sign * std::sqrt(rest) * w.normalized(), 0.0);
        }
        for (std::size_t l = 0; l < k; ++l) {
          Eigen::Matrix3d slope;
          Vec3 constant, linear;
          int row = 0;
          for (const std::size_t m : {j, k, l}) {
            const Vec3 to = balls[m].centre - balls[i].centre;
            const double ri = balls[i].radius, rm = balls[m].radius;
            slope.row(row) = to;
            constant[row] = 0.5 * (to.squaredNorm() - rm * rm + ri * ri);
            linear[row++] = rm - ri;
          }
          const auto lu = slope.partialPivLu();
          const Vec3 a = lu.solve(constant), b = lu.solve(linear);
          const double qa = b.squaredNorm() - 1.0, qb = a.dot(b) + balls[i].radius, qc = a.squaredNorm() - balls[i].radius * balls[i].radius;
          const double root = qb * qb - qa * qc;
          if (root < 0.0) continue;
          for (const double sign : {-1.0, 1.0}) {
            const double s = (-qb + sign * std::sqrt(root)) / qa;
            const Vec3 p = balls[i].centre + a + s * b;
            if (std::abs(balls[i].value(p) - s) < 1e-9 && std::abs(balls[l].value(p) - s) < 1e-9) keep(p, s);
          }
        }
      }
    }
  }
  return found;
}

/// Distance, by Newton's method, of a point to where the fields of its labels agree.
double distance_to_boundary(const std::vector<Ball>& balls, const LabelSet& labels, const Vec3& start) {
  Vec3 p = start;
  for (int round = 0; round < 20; ++round) {
    Eigen::Matrix3d slope = Eigen::Matrix3d::Zero();
    Vec3 difference = Vec3::Zero(), first_slope = Vec3::Zero();
    double level = 0.0;
    const auto slope_of = [&](Label l) { return Vec3((balls[l - 1].centre - p).normalized()); };
    if (labels.label[0] != 0) {
      level = balls[labels.label[0] - 1].value(p);
      first_slope = slope_of(labels.label[0]);
    }
    for (int k = 0; k + 1 < labels.count; ++k) {
      const Label l = labels.label[static_cast<std::size_t>(k) + 1];
      difference[k] = balls[l - 1].value(p) - level;
      slope.row(k) = slope_of(l) - first_slope;
    }
    if (difference.cwiseAbs().maxCoeff() < 1e-14) break;
    const Eigen::Index rows = labels.count - 1;
    const Vec3 step = slope.topRows(rows).completeOrthogonalDecomposition().solve(difference.head(rows));
    p -= step;
  }
  return (p - start).norm();
}

struct Figures {
  std::size_t count = 0, off = 0;
  double squares = 0.0, largest = 0.0;
  void add(double distance) {
    ++count;
    off += distance > 1e-9 ? 1 : 0;
    squares += distance * distance;
    largest = std::max(largest, distance);
  }
  [[nodiscard]] double rms() const { return count == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(count)); }
};

std::vector<FieldView> views_of(const std::vector<testing::FunctionField>& fields) { return {fields.begin(), fields.end()}; }

void add(const std::vector<Mesh>& meshes, Hasher& hasher) {
  for (const Mesh& mesh : meshes) {
    hasher.add(std::span<const Vec3>(mesh.position));
    for (const auto& t : mesh.triangle) {
      for (const std::uint32_t v : t) hasher.add(std::uint64_t{v});
    }
  }
}

void rims(int sets, double cell) {
  for (const int count : {2, 3, 4, 6}) {
    Figures rim, point, near;
    double seconds = 0.0;
    PolygoniseCounts all;
    Hasher hasher;
    for (int set = 1; set <= sets; ++set) {
      const std::vector<Ball> balls = random_balls(static_cast<std::uint64_t>(set), count);
      std::vector<testing::FunctionField> fields;
      for (const Ball& ball : balls) fields.push_back(testing::sphere(ball.centre, ball.radius));
      const std::vector<FieldView> views = views_of(fields);
      PolygoniseCounts counts;
      const double start = cpu_seconds();
      const std::vector<Mesh> meshes = polygonise_partition(views, {.origin = Vec3(0.0137, -0.0071, 0.0229), .cell = cell}, Executor(1), &counts);
      seconds += cpu_seconds() - start;
      add(meshes, hasher);
      all.junctions += counts.junctions;
      all.junctions_moved += counts.junctions_moved;
      all.boundary_points += counts.boundary_points;
      all.boundary_points_moved += counts.boundary_points_moved;
      const PatchComplex complex(views, meshes);
      std::vector<Vec3> corner;
      for (PatchComplex::Vertex v = 0; v < complex.vertex_count(); ++v) {
        if (complex.place(v) == PatchPlace::Interior) continue;
        const LabelSet labels = complex.labels(v);
        if (labels.count == 3) rim.add(distance_to_boundary(balls, labels, complex.position(v)) / cell);
        if (labels.count == 4) {
          point.add(distance_to_boundary(balls, labels, complex.position(v)) / cell);
          corner.push_back(complex.position(v));
        }
      }
      for (const Vec3& exact : corners_of(balls)) {
        double least = 1e9;
        for (const Vec3& p : corner) least = std::min(least, (p - exact).norm());
        near.add(std::min(least / cell, 2.0));
      }
    }
    std::printf("{\"balls\":%d,\"sets\":%d,\"rim\":%zu,\"rim_off\":%zu,\"rim_rms\":%.2e,\"rim_largest\":%.2f,\"points\":%zu,\"points_off\":%zu,"
                "\"exact_points\":%zu,\"without\":%zu,\"farthest\":%.2f,\"junctions\":%llu,\"moved\":%llu,\"rim_points\":%llu,\"rim_moved\":%llu,\"s\":%.3f,\"hash\":\"%s\"}\n",
                count, sets, rim.count, rim.off, rim.rms(), rim.largest, point.count, point.off, near.count, near.off, near.largest,
                static_cast<unsigned long long>(all.junctions), static_cast<unsigned long long>(all.junctions_moved),
                static_cast<unsigned long long>(all.boundary_points), static_cast<unsigned long long>(all.boundary_points_moved), seconds,
                to_hex(hasher.value()).c_str());
  }
}

void delaunay(int sets, double size) {
  for (const int count : {2, 3, 4, 6}) {
    int held = 0, divided = 0;
    std::size_t most = 0;
    double seconds = 0.0;
    Hasher hasher;
    for (int set = 1; set <= sets; ++set) {
      std::vector<testing::FunctionField> fields;
      for (const Ball& ball : random_balls(static_cast<std::uint64_t>(set), count)) fields.push_back(testing::sphere(ball.centre, ball.radius));
      DelaunayReport report;
      const double start = cpu_seconds();
      const std::vector<Mesh> meshes =
          delaunay_partition(views_of(fields), {.size = size, .distance = 0.1 * size, .cell = 0.5 * size}, Executor(1), &report);
      seconds += cpu_seconds() - start;
      held += report.sharp == 0 ? 1 : 0;
      divided += report.largest_radius == 0.0 ? 1 : 0;
      std::size_t triangles = 0;
      for (const Mesh& mesh : meshes) triangles += mesh.triangle_count();
      most = std::max(most, triangles);
      add(meshes, hasher);
    }
    std::printf("{\"balls\":%d,\"sets\":%d,\"held\":%d,\"divided_by_tetrahedra\":%d,\"most_triangles\":%zu,\"s\":%.2f,\"hash\":\"%s\"}\n", count, sets, held, divided,
                most, seconds, to_hex(hasher.value()).c_str());
    std::fflush(stdout);
  }
}

/// Balls of radius 0.05 that press on their neighbours, a place each in layers of five by five.
std::vector<testing::Body> pile_of(int count) {
  testing::Random random(1);
  std::vector<testing::Body> balls;
  for (int i = 0; i < count; ++i) {
    Primitive point;
    point.kernel = Kernel::gascuel(0.05, 0.075, 10.0);
    const Vec3 place(i % 5, i / 5 % 5, i / 25);
    balls.push_back(testing::body_of({{point, 0.097 * place + random.in_box(0.002)}}));
  }
  return balls;
}

/// @param error  0: of the one lattice
void moved(int count, double cell, double error) {
  constexpr int kFrames = 8;
  const Lattice lattice{.origin = cell * Vec3(0.382, 0.236, 0.447), .cell = cell};
  for (const double part : {0.0, 0.01, 0.1, 1.0}) {
    const int moving = part > 0.0 ? std::max(1, static_cast<int>(std::lround(part * count))) : 0;
    testing::Random random(2);
    std::vector<testing::Body> balls = pile_of(count);
    PartitionMesher mesher;
    PartitionErrorMesher error_mesher;
    ContentVersions versions;
    double whole = 0.0, kept = 0.0;
    std::uint64_t blocks = 0, visited = 0, bytes = 0;
    bool same = true;
    for (int frame = 0; frame <= kFrames; ++frame) {
      std::vector<FieldView> views;
      std::vector<std::uint64_t> version;
      versions.begin_frame();
      for (const testing::Body& ball : balls) {
        ContentWords words;
        add_content(ball.skeleton, ball.placed, words);
        version.push_back(versions.of(words.view()));
        views.emplace_back(ball.field);
      }
      PolygoniseCounts all, counts;
      const double start = cpu_seconds();
      const std::vector<Mesh> fresh =
          error > 0.0 ? polygonise_partition_within(views, lattice, {error}, Executor(1), &all) : polygonise_partition(views, lattice, Executor(1), &all);
      const double between = cpu_seconds();
      const std::vector<Mesh> meshes = error > 0.0 ? error_mesher.make(views, version, lattice, {error}, Executor(1), &counts)
                                                   : mesher.make(views, version, lattice, Executor(1), &counts);
      const double end = cpu_seconds();
      Hasher hash, fresh_hash;
      add(meshes, hash);
      add(fresh, fresh_hash);
      same = same && hash.value() == fresh_hash.value();
      if (frame > 0) {  // nothing is kept before it
        whole += between - start;
        kept += end - between;
        blocks += all.blocks_visited;
        visited += counts.blocks_visited;
        bytes = counts.bytes;
      }
      for (int n = 0; n < moving; ++n) {
        testing::Body& ball = balls[moving == count ? static_cast<std::size_t>(n) : random.below(static_cast<std::uint32_t>(count))];
        ball.parts[0].position += random.in_box(0.001);
        ball.place();
      }
    }
    std::printf("{\"balls\":%d,\"moved\":%d,\"cell\":%g,\"whole_ms\":%.2f,\"moved_ms\":%.2f,\"share\":%.4f,\"blocks\":%.0f,\"blocks_share\":%.4f,"
                "\"kept_mb\":%.1f,\"same\":%s}\n",
                count, moving, cell, 1e3 * whole / kFrames, 1e3 * kept / kFrames, kept / whole, static_cast<double>(blocks) / kFrames,
                static_cast<double>(visited) / static_cast<double>(blocks), 1e-6 * static_cast<double>(bytes), same ? "true" : "false");
    std::fflush(stdout);
  }
}

}  // namespace

int supple::benchmarks::programs::partition_bench(int argc, char** argv) {
  using supple::benchmarks::expect_word;
  using supple::benchmarks::positive_number;
  using supple::benchmarks::whole_number;
  constexpr std::string_view kUsage = "partition_bench [rims] [SETS] [CELL]\n"
                                      "       partition_bench delaunay [SETS] [SIZE]\n"
                                      "       partition_bench moved [BALLS] [CELL] [ERROR]";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 4);
  const std::string_view what = argc > 1 ? argv[1] : "rims";
  expect_word(kUsage, what, std::array<std::string_view, 3>{"rims", "delaunay", "moved"});
  const int sets = argc > 2 ? whole_number(kUsage, argv[2]) : 50;
  const auto length = [&](int i, double otherwise) { return argc > i ? positive_number(kUsage, argv[i]) : otherwise; };
  if (what == "delaunay") {
    delaunay(sets, length(3, 0.1));
  } else if (what == "moved") {
    moved(argc > 2 ? sets : 100, length(3, 0.005), length(4, 0.0));
  } else {
    rims(sets, length(3, 0.05));
  }
  return 0;
}
