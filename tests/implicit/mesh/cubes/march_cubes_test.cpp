#include "supple/implicit/march_cubes.h"
#include "supple/implicit/project.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <set>

#include "field/field_index.h"
#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/blob_grid.h"
#include "mesh/blob_lanes.h"
#include "mesh/cubes/march_cases.h"
#include "supple/core/error.h"
#include "support/mesh_distance.h"

namespace supple::implicit {
namespace {

using namespace testing;

/// A Field that the mesher cannot recognise: it then takes the path in double precision.
struct Seen {
  const Field& field;
  void evaluate(std::span<const Vec3> points, std::span<double> values) const { field.evaluate(points, values); }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    field.evaluate(points, values, gradients);
  }
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field.evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const { return field.bound(box); }
  [[nodiscard]] double gradient_bound(const Box& box) const { return field.gradient_bound(box); }
  [[nodiscard]] Box surface_box() const { return field.surface_box(); }
  [[nodiscard]] double feature_size() const { return field.feature_size(); }
};

Body blobs(std::uint64_t seed, std::uint32_t count, double least_radius = 0.3, double largest_radius = 0.6) {
  return random_body({.seed = seed, .parts = count, .least_radius = least_radius, .largest_radius = largest_radius,
                      .only_points = true});
}

// Each loop of a case separates the inside corners of one component from the outside ones; the volume enclosed by the
// mesh of a lattice with any signs is positive and every edge has two triangles.
TEST(CellCases, JoinInsideCornersAlongEdgesOnlyAndFaceOutwards) {
  for (unsigned inside = 0; inside < 256; ++inside) {
    const march::CellLoops& c = march::kCellLoops[inside];
    // Components of inside corners, joined along edges.
    std::array<unsigned, 8> component{};
    for (unsigned k = 0; k < 8; ++k) component[k] = k;
    for (int round = 0; round < 8; ++round) {
      for (const march::CellEdge& edge : march::kCellEdge) {
        const unsigned a = edge.corner, b = edge.corner | 1u << edge.axis;
        if ((inside >> a & 1u) != 0 && (inside >> b & 1u) != 0) component[a] = component[b] = std::min(component[a], component[b]);
      }
    }
    std::set<unsigned> crossed;
    for (std::size_t l = 0; l < c.loops; ++l) {
      std::set<unsigned> parts;
      Vec3 area = Vec3::Zero(), towards = Vec3::Zero();
      const auto middle = [&](std::size_t k) {
        const march::CellEdge edge = march::kCellEdge[c.loop[l].edge[k % c.loop[l].size]];
        const unsigned a = edge.corner, b = a | 1u << edge.axis;
        const auto at = [](unsigned corner) { return Vec3(corner & 1u, corner >> 1 & 1u, corner >> 2); };
        const bool first = (inside >> a & 1u) != 0;
        EXPECT_NE(first, (inside >> b & 1u) != 0);
        parts.insert(component[first ? a : b]);
        towards += first ? Vec3(at(b) - at(a)) : Vec3(at(a) - at(b));
        return Vec3(0.5 * (at(a) + at(b)));
      };
      for (std::size_t k = 0; k < c.loop[l].size; ++k) {
        EXPECT_TRUE(crossed.insert(c.loop[l].edge[k]).second);
        area += middle(k).cross(middle(k + 1));
      }
      EXPECT_EQ(parts.size(), 1u) << inside;
      EXPECT_GT(area.dot(towards), 0.0) << inside;
    }
    std::size_t edges = 0;
    for (const march::CellEdge& edge : march::kCellEdge) {
      edges += (inside >> edge.corner & 1u) != (inside >> (edge.corner | 1u << edge.axis) & 1u) ? 1u : 0u;
    }
    EXPECT_EQ(crossed.size(), edges) << inside;
  }
}

// Wyvill 1986: a point with R = 1 and iso 1/2 has its surface at 0.454202019.
TEST(MarchCubes, MeetsAreaAndVolumeOfTheWyvillSphereWithOrderTwo) {
  constexpr double kRadius = 0.454202019, kArea = 2.592435660, kVolume = 0.392496505;
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const Executor executor(1);
  for (const int refinements : {0, 1}) {
    std::array<double, 3> area_error{}, volume_error{};
    for (std::size_t k = 0; k < 3; ++k) {
      const double cell = std::ldexp(0.08, -static_cast<int>(k));
      MarchCounts counts;
      const Mesh mesh =
          march_cubes(body.field, {.lattice = lattice_of(cell), .refinements = refinements}, executor, &counts);
      EXPECT_TRUE(counts.single_precision);
      const MeshReport report = expect_closed(mesh);
      EXPECT_EQ(report.euler_characteristic, 2);
      for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
        ASSERT_NEAR(mesh.position[v].norm(), kRadius, 1e-4 * cell);
        ASSERT_NEAR(mesh.normal[v].norm(), 1.0, 1e-14);
        // The gradient is taken within 4e-3 of a cell of the vertex, on a sphere of radius 0.45.
        ASSERT_LT((mesh.normal[v] - mesh.position[v].normalized()).norm(), 0.02 * cell);
      }
      area_error[k] = kArea - report.area;
      volume_error[k] = kVolume - report.volume;
      EXPECT_GT(volume_error[k], 0.0);
      EXPECT_LT(volume_error[k], kArea * 0.75 * cell * cell / (2.0 * kRadius));
    }
    for (std::size_t k = 0; k < 2; ++k) {  // 4 for order 2; how the lattice lies on the sphere moves it a little
      EXPECT_NEAR(area_error[k] / area_error[k + 1], 4.0, 0.4) << refinements;
      EXPECT_NEAR(volume_error[k] / volume_error[k + 1], 4.0, 0.4) << refinements;
    }
  }
}

TEST(MarchCubes, MeetsTheVolumeOfThickBodiesOfAnyShape) {
  // Within them lie many blocks of 8^3 cells that only bounds know the sign of.
  for (const ShapeKind shape : {ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Box, ShapeKind::Ellipsoid,
                                ShapeKind::Superquadric, ShapeKind::Directed}) {
    Primitive p;
    p.shape = shape;
    p.kernel = Kernel::wyvill(1.4);
    p.size = shape == ShapeKind::Ellipsoid || shape == ShapeKind::Superquadric ? Vec3(1.8, 1.6, 1.5) : Vec3(0.7, 0.6, 0.5);
    if (shape == ShapeKind::Directed) {
      p.size = Vec3(1.8, 1.6, 1.5);
      p.control = {Vec3(1.4, 1.7, 1.9)};
    }
    Body body;
    body.skeleton.primitive = {p};
    body.skeleton.part_count = 1;
    body.parts.resize(1);
    body.place();
    constexpr double kCell = 0.025;
    const MeshReport cubes = expect_closed(march_cubes(body.field, {.lattice = lattice_of(kCell)}, Executor(2)));
    const MeshReport tetrahedra = expect_closed(polygonise(body.field, lattice_of(kCell), Executor(2)));
    EXPECT_EQ(cubes.components, 1u) << static_cast<int>(shape);
    EXPECT_EQ(cubes.euler_characteristic, 2) << static_cast<int>(shape);
    // Either lies within a quarter of h^2 / r of the surface, whose radii r are at least 0.4 here.
    EXPECT_NEAR(cubes.volume, tetrahedra.volume, 0.5 * kCell * kCell / 0.4 * cubes.area) << static_cast<int>(shape);
  }
}

TEST(MarchCubes, FindsOneBodyBelowTheMergingDistanceAndTwoAbove) {
  const auto components = [](double D) {
    const Body body = body_of({{wyvill_point(1.0), Vec3(-0.5 * D, 0, 0)}, {wyvill_point(1.0), Vec3(0.5 * D, 0, 0)}});
    return expect_closed(march_cubes(body.field, {.lattice = lattice_of(0.02)}, Executor(2))).components;
  };
  EXPECT_EQ(components(1.21), 1u);
  EXPECT_EQ(components(1.22), 2u);
}

// Cells that the surface cuts in four or five points are fans of two or three triangles: of all fans theirs is the one whose
// chords lie closest to the surface in their middles, but for those that are alike up to terms of third order.
TEST(MarchCubes, TakesTheFanThatLiesClosestToTheSurface) {
  const Body body = blobs(3, 60);
  const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(0.03)}, Executor(2));
  const auto away = [&](std::uint32_t a, std::uint32_t b) {
    Vec3 gradient;
    const double f = FieldView(body.field).value(0.5 * (mesh.position[a] + mesh.position[b]), gradient);
    return std::abs(f) / gradient.norm();
  };
  const auto goes_on = [&](std::size_t t) {  // to the triangle after it
    return t + 1 < mesh.triangle_count() && mesh.triangle[t][0] == mesh.triangle[t + 1][0] && mesh.triangle[t][2] == mesh.triangle[t + 1][1];
  };
  std::map<std::size_t, std::size_t> fans, worse;  // by the size of the loop
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) {
    std::vector<std::uint32_t> loop{mesh.triangle[t][0], mesh.triangle[t][1], mesh.triangle[t][2]};
    for (; goes_on(t); ++t) loop.push_back(mesh.triangle[t + 1][2]);
    const std::size_t n = loop.size();
    std::vector<double> sum(n, 0.0);
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t d = 2; d + 1 < n; ++d) sum[k] += away(loop[k], loop[(k + d) % n]);
    }
    ++fans[n];
    worse[n] += sum[0] > 1.2 * *std::min_element(sum.begin(), sum.end()) + 1e-3 * 0.03 ? 1u : 0u;
  }
  for (const std::size_t n : {4u, 5u}) {
    EXPECT_GT(fans[n], mesh.triangle_count() / 20);
    EXPECT_LT(worse[n], fans[n] / 50);
  }
}

// Blobs of very different size, some of two cells only, some alone: none may be missed by bounds.
TEST(MarchCubes, FindsEveryComponentOfScatteredBlobs) {
  constexpr double kCell = 0.05;
  std::vector<std::pair<Primitive, Vec3>> blobs;
  Random random(11);
  for (int k = 0; k < 6; ++k) {
    for (int j = 0; j < 6; ++j) {
      for (int i = 0; i < 6; ++i) {
        // A support of 4.5 cells or more: the surface at 0.45 R then holds a node.
        blobs.emplace_back(wyvill_point(random.uniform(0.225, 0.49)), Vec3(i, j, k) + random.in_box(0.01));
      }
    }
  }
  const Body body = body_of(blobs);
  const MeshReport report = expect_closed(march_cubes(body.field, {.lattice = lattice_of(kCell)}, Executor(2)));
  EXPECT_EQ(report.components, 216u);
  EXPECT_EQ(report.euler_characteristic, 2 * 216);
}

class MarchedBody : public ::testing::TestWithParam<std::uint64_t> {};

// The path in single precision against the one through the view in double precision: same signs at the nodes (none is
// closer to the surface than round-off), so the same vertices on the same edges.
TEST_P(MarchedBody, AgreesWithThePathInDoublePrecision) {
  constexpr double kCell = 0.037;
  const Body body = blobs(GetParam(), 60, 0.15, 0.5);
  MarchCounts fast, clear;
  const MarchOptions options{.lattice = lattice_of(kCell)};
  const Mesh mesh = march_cubes(body.field, options, Executor(2), &fast);
  const Mesh expected = march_cubes(Seen{body.field}, options, Executor(2), &clear);
  EXPECT_TRUE(fast.single_precision);
  EXPECT_FALSE(clear.single_precision);
  EXPECT_LT(fast.nodes, clear.nodes);
  expect_closed(mesh);
  ASSERT_EQ(mesh.vertex_count(), expected.vertex_count());
  ASSERT_EQ(mesh.triangle_count(), expected.triangle_count());
  double sum = 0.0;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const double error = (mesh.position[v] - expected.position[v]).norm() / kCell;
    sum += error * error;
    ASSERT_LT(error, 1e-3);  // grazing edges see the surface at a small angle
    ASSERT_LT((mesh.normal[v] - expected.normal[v]).norm(), 5e-3);
  }
  EXPECT_LT(std::sqrt(sum / static_cast<double>(mesh.vertex_count())), 1e-4);
  // Diagonals may differ where both bend alike: normals are taken within 4e-3 of a cell of the vertices, which turns the
  // surface by less than a hundredth of what it turns along a diagonal.
  std::size_t differ = 0;
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) differ += mesh.triangle[t] != expected.triangle[t] ? 1u : 0u;
  EXPECT_LT(differ, mesh.triangle_count() / 100);
}

TEST_P(MarchedBody, IsClosedOnAllShapesAndKernels) {
  const Body body = random_body({.seed = GetParam(), .parts = 30});
  MarchCounts counts;
  const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(0.06), .refinements = 1}, Executor(2), &counts);
  EXPECT_FALSE(counts.single_precision);
  const MeshReport report = expect_closed(mesh);
  EXPECT_EQ(report.euler_characteristic % 2, 0);
  EXPECT_GT(report.volume, 0.0);
}

TEST_P(MarchedBody, DoesNotDependOnThreads) {
  const Body body = blobs(GetParam(), 80);
  for (const int refinements : {0, 2}) {
    const MarchOptions options{.lattice = lattice_of(0.05), .refinements = refinements};
    const std::uint64_t expected = hash_of(march_cubes(body.field, options, Executor(1)));
    for (const int threads : {2, 3, 8}) {
      EXPECT_EQ(hash_of(march_cubes(body.field, options, Executor(threads))), expected) << threads;
    }
  }
}

TEST_P(MarchedBody, RefinesTheSameSurface) {
  const Body body = blobs(GetParam(), 60);
  const double cell = 0.05;
  const Mesh coarse = march_cubes(body.field, {.lattice = lattice_of(cell)}, Executor(1));
  MarchCounts counts;
  const Mesh fine = march_cubes(body.field, {.lattice = lattice_of(cell), .refinements = 2}, Executor(1), &counts);
  const MeshReport before = expect_closed(coarse), after = expect_closed(fine);
  EXPECT_EQ(fine.triangle_count(), 16 * coarse.triangle_count());
  EXPECT_EQ(after.euler_characteristic, before.euler_characteristic);
  EXPECT_EQ(after.components, before.components);
  EXPECT_EQ(self_intersections(fine, cell), 0u);
  for (std::size_t v = 0; v < coarse.vertex_count(); ++v) ASSERT_EQ(fine.position[v], coarse.position[v]);
  const FieldView field(body.field);
  std::vector<double> error;  // over the cell
  for (std::size_t v = 0; v < fine.vertex_count(); ++v) {
    Vec3 gradient;
    const double f = field.value(fine.position[v], gradient);
    error.push_back(std::abs(f) / (gradient.norm() * cell));
    ASSERT_GT(fine.normal[v].dot(-gradient.normalized()), 0.999);
  }
  // Middles of edges that would cross are not on it.
  std::sort(error.begin(), error.end(), std::greater<>());
  EXPECT_LT(counts.straight_edges, fine.vertex_count() / 200);
  double sum = 0.0;
  for (std::size_t i = counts.straight_edges; i < error.size(); ++i) sum += error[i] * error[i];
  EXPECT_LT(std::sqrt(sum / static_cast<double>(fine.vertex_count())), 1e-4);
}
INSTANTIATE_TEST_SUITE_P(Seeds, MarchedBody, ::testing::Values(1, 2, 3));

TEST(MarchCubes, KeepsRefinedVerticesOnTheSurfaceWhereTheCellsResolveIt) {
  const Body body = body_of({{wyvill_point(1.0), Vec3(-0.55, 0, 0)}, {wyvill_point(1.0), Vec3(0.55, 0, 0)}});
  MarchCounts counts;
  const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(0.1), .refinements = 2}, Executor(1), &counts);
  expect_closed(mesh);
  EXPECT_EQ(self_intersections(mesh, 0.1), 0u);
  EXPECT_EQ(counts.straight_edges, 0u);
}

TEST(MarchCubes, DoesNotCrossItselfWhereRefinedTrianglesWould) {
  // Blobs of a cell or two, whose surface turns within one; and noise, in double precision.
  std::uint64_t straight = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Body body = random_body({.seed = seed, .parts = 400, .least_radius = 0.15, .largest_radius = 0.4, .only_points = true});
    for (const int refinements : {1, 2, 3}) {
      MarchCounts counts;
      const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(0.2), .refinements = refinements}, Executor(2), &counts);
      expect_closed(mesh);
      EXPECT_EQ(self_intersections(mesh, 0.1), 0u) << seed << ' ' << refinements;
      EXPECT_LT(counts.straight_edges, mesh.vertex_count() / 20);
      straight += counts.straight_edges;
    }
  }
  EXPECT_GT(straight, 20u);
  const Mesh rough = march_cubes(noise(1, 0.15), {.lattice = lattice_of(0.11), .refinements = 1}, Executor(2));
  expect_closed(rough);
  EXPECT_EQ(self_intersections(rough, 0.11), 0u);
}

TEST(MarchCubes, PutsOnlyMiddlesOfEdgesOfCrossingTrianglesBack) {
  // All others are on the surface: what is not lies in the middle of an edge of the mesh before.
  const Body body = random_body({.seed = 1, .parts = 400, .least_radius = 0.15, .largest_radius = 0.4, .only_points = true});
  const MarchOptions options{.lattice = lattice_of(0.2), .refinements = 1};
  MarchCounts counts;
  const Mesh mesh = march_cubes(body.field, options, Executor(1), &counts);
  const FieldView field(body.field);
  std::uint64_t middles = 0;
  std::vector<bool> seen(mesh.vertex_count(), false);
  for (std::size_t n = 3; n < mesh.triangle_count(); n += 4) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangle[n][k], a = mesh.triangle[n - 3 + k][k], b = mesh.triangle[n - 3 + (k + 1) % 3][(k + 1) % 3];
      if (seen[v]) continue;
      seen[v] = true;
      if (mesh.position[v] == 0.5 * (mesh.position[a] + mesh.position[b])) {
        ++middles;
        continue;
      }
      Vec3 gradient;
      const double f = field.value(mesh.position[v], gradient);
      EXPECT_LE(std::abs(f), 1e-3 * 0.2 * gradient.norm());
    }
  }
  EXPECT_EQ(middles, counts.straight_edges);
  EXPECT_GT(middles, 0u);
}

TEST(MarchCubes, StaysClosedWhereTheSurfaceIsRougherThanTheLattice) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    for (const double cell : {0.07, 0.11}) {
      const Mesh mesh = march_cubes(noise(seed, 0.15), {.lattice = lattice_of(cell)}, Executor(1));
      const MeshReport report = expect_closed(mesh);
      EXPECT_EQ(report.euler_characteristic % 2, 0);
      EXPECT_GT(mesh.triangle_count(), 1000u);
      EXPECT_EQ(self_intersections(mesh, cell), 0u);
    }
  }
  // Blobs of less than a cell in single precision.
  const Body dust = random_body({.seed = 4, .parts = 3000, .least_radius = 0.05, .largest_radius = 0.2, .only_points = true});
  const Mesh mesh = march_cubes(dust.field, {.lattice = lattice_of(0.07)}, Executor(1));
  expect_closed(mesh);
  EXPECT_EQ(self_intersections(mesh, 0.07), 0u);
}

TEST(MarchCubes, IsClosedWhenTheSurfacePassesThroughNodes) {
  const Executor executor(1);
  // |(3, 4, 0)| / 8 = 5 / 8 in exact binary arithmetic: nodes at distance r have F = 0 exactly, and count as outside.
  const FunctionField ball = sphere(Vec3::Zero(), 0.625);
  ASSERT_EQ(FieldView(ball).value({0.375, 0.5, 0.0}), 0.0);
  const MarchOptions options{.lattice = {.origin = Vec3::Zero(), .cell = 0.125}};
  EXPECT_EQ(expect_closed(march_cubes(ball, options, executor)).euler_characteristic, 2);
  // One Wyvill point with iso 27/64 = (1 - 1/4)^3, R = 1/2: F = 0 exactly at a distance of 1/4, two cells.
  Body body;
  body.skeleton.primitive.push_back(wyvill_point(0.5));
  body.skeleton.part_count = 1;
  body.skeleton.iso = 27.0 / 64.0;
  body.parts.push_back(Pose{});
  body.place();
  ASSERT_EQ(FieldView(body.field).value({0.0, 0.25, 0.0}), 0.0);
  MarchCounts counts;
  const Mesh mesh = march_cubes(body.field, options, executor, &counts);
  EXPECT_TRUE(counts.single_precision);
  EXPECT_EQ(expect_closed(mesh).euler_characteristic, 2);
  std::set<std::array<double, 3>> places;
  for (const Vec3& p : mesh.position) {
    EXPECT_NEAR(p.norm(), 0.25, 1e-4 * 0.125);
    EXPECT_TRUE(places.insert({p.x(), p.y(), p.z()}).second) << "two vertices at " << p.transpose();
  }
}

TEST(MarchCubes, SurvivesAFieldWithoutGradient) {
  FunctionField steps = sphere(Vec3::Zero(), 0.5);  // a jump: no root, no gradient anywhere
  steps.function = [](const Vec3& p, Vec3& gradient) {
    gradient = Vec3::Zero();
    return p.norm() < 0.5 ? 1.0 : -1.0;
  };
  steps.bounds_everything = true;
  const Mesh mesh = march_cubes(steps, {.lattice = lattice_of(0.1)}, Executor(1));
  expect_closed(mesh);
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR(mesh.position[i].norm(), 0.5, 2e-6);  // vertices keep 2^-17 of a cell from the nodes
    EXPECT_GT(mesh.normal[i].dot(mesh.position[i]), 0.0);
  }
}

TEST(MarchCubes, KeepsItsShapeAtAnyScaleAndFarFromTheOrigin) {
  const auto count = [&](double scale, const Vec3& shift) {
    const Body body =
        body_of({{wyvill_point(scale), shift}, {wyvill_point(scale), Vec3(shift + Vec3(0.7 * scale, 0, 0))}});
    const Mesh mesh =
        march_cubes(body.field, {.lattice = {.origin = scale * kOffset, .cell = 0.0625 * scale}}, Executor(1));
    expect_closed(mesh);
    return std::pair(mesh.vertex_count(), mesh.triangle_count());
  };
  const auto expected = count(1.0, Vec3::Zero());
  for (const double scale : {0x1p-10, 0x1p10}) EXPECT_EQ(count(scale, Vec3::Zero()), expected) << scale;
  EXPECT_EQ(count(1.0, Vec3(4096.0, -8192.0, 1024.0)), expected);
}

TEST(MarchCubes, ForgetsWhatItKeptFromAnotherBody) {
  CubeMesher mesher;
  const MarchOptions options{.lattice = lattice_of(0.05), .refinements = 1};
  for (const std::uint64_t seed : {1u, 2u, 3u, 2u}) {
    const Body body = blobs(seed, 40);
    EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(1))), hash_of(march_cubes(body.field, options, Executor(1))));
  }
  const Body none = body_of({{wyvill_point(0.01), Vec3(0.3, 0.3, 0.3)}});  // between the nodes
  EXPECT_EQ(mesher.make(none.field, options, Executor(1)).vertex_count(), 0u);
}

// The given error holds at the centroids, is not overdone, and smaller errors need more triangles.
TEST(MarchCubes, ReachesTheErrorThatIsAskedFor) {
  const Body body = body_of({{wyvill_point(1.0), Vec3(-0.4, 0, 0)}, {wyvill_point(1.0), Vec3(0.4, 0, 0)},
                             {wyvill_point(0.5), Vec3(2.5, 0.1, 0)}});
  std::size_t last = 0;
  for (const double error : {1e-2, 1e-3, 1e-4}) {
    MarchCounts counts;
    const Mesh mesh = march_cubes(body.field, {.lattice = {.origin = kOffset, .cell = 0.0}, .error = error}, Executor(2), &counts);
    EXPECT_EQ(expect_closed(mesh).components, 2u);
    EXPECT_LE(counts.error, error);
    EXPECT_GT(counts.error, error / 4.0);
    double largest = 0.0;
    for (const auto& t : mesh.triangle) {
      const Vec3 c = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
      largest = std::max(largest, (project_to_surface(body.field, c).point - c).norm());
    }
    EXPECT_NEAR(largest, counts.error, 0.1 * largest);
    EXPECT_GT(mesh.triangle_count(), 2 * last);
    last = mesh.triangle_count();
  }
}

// As fine as it takes: a ball of radius 0.45 m to a hundredth of a millimetre.
TEST(MarchCubes, ReachesFineErrorsAndHeedsAStatedCell) {
  const Body ball = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  MarchCounts counts;
  const Mesh mesh = march_cubes(ball.field, {.lattice = lattice_of(0.0), .error = 1e-5}, Executor(2), &counts);
  double largest = 0.0;
  for (const auto& t : mesh.triangle) {
    largest = std::max(largest, std::abs((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]).norm() / 3.0 - 0.454202019));
  }
  EXPECT_LE(largest, 1e-5);
  EXPECT_GT(largest, 2.5e-6);
  const Mesh stated = march_cubes(ball.field, {.lattice = lattice_of(0.05), .error = 0.1}, Executor(2), &counts);
  EXPECT_EQ(hash_of(stated), hash_of(march_cubes(ball.field, {.lattice = lattice_of(0.05)}, Executor(1))));
  // What it can reach does not depend on what was meshed before.
  const auto refused = [&](CubeMesher& mesher) -> std::string {
    try {
      (void)mesher.make(ball.field, {.lattice = lattice_of(0.0), .error = 1e-12}, Executor(1));
    } catch (const Error& error) {
      return error.what();
    }
    return "reached";
  };
  CubeMesher fresh, used;
  (void)used.make(ball.field, {.lattice = lattice_of(0.02), .refinements = 4}, Executor(2));
  EXPECT_EQ(refused(used), refused(fresh));
  const MarchOptions same{.lattice = lattice_of(0.0), .error = 1e-3};
  EXPECT_EQ(hash_of(march_cubes(ball.field, same, Executor(1))), hash_of(march_cubes(ball.field, same, Executor(3))));
}

// Both ways: from the mesh to the exact surface, and from points of the exact surface (vertices of the double-precision
// tetrahedra on a finer lattice) to the mesh. A triangle of a cell with its vertices on the surface has a circumradius below
// sqrt(3)/2 cell, and its distance to a surface of curvature k is below k/2 times its square.
TEST(MarchCubes, LiesOnTheExactSurfaceBothWaysAndAMissedPartShows) {
  constexpr double kCell = 0.04;
  const Body body = body_of({{wyvill_point(1.0), Vec3(-0.4, 0, 0)}, {wyvill_point(1.0), Vec3(0.4, 0, 0)},
                             {wyvill_point(0.5), Vec3(2.5, 0.1, 0)}});
  const Mesh exact = polygonise(body.field, lattice_of(0.31 * kCell), Executor(2));
  const double curvature = 1.0 / (0.454202019 * 0.5);  // of the smallest ball, the largest there is
  const double bound = 0.5 * 0.75 * kCell * kCell * curvature;
  for (const int refinements : {0, 1}) {
    const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(kCell), .refinements = refinements}, Executor(1));
    const supple::testing::MeshDistance to_mesh(mesh, kCell), to_exact(exact, kCell);
    double there = 0.0, back = 0.0;
    for (const auto& t : mesh.triangle) {
      there = std::max(there, to_exact((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0));
    }
    for (const Vec3& p : exact.position) back = std::max(back, to_mesh(p));
    EXPECT_LT(there, bound);
    EXPECT_LT(back, bound);
    EXPECT_GT(back, bound / 256.0);
  }
  const Body without = body_of({{wyvill_point(1.0), Vec3(-0.4, 0, 0)}, {wyvill_point(1.0), Vec3(0.4, 0, 0)}});
  const Mesh less = march_cubes(without.field, {.lattice = lattice_of(kCell)}, Executor(1));
  const supple::testing::MeshDistance to_less(less, 8.0 * kCell);  // from afar
  double back = 0.0;
  for (const Vec3& p : exact.position) {
    if (p.x() > 2.0) back = std::max(back, to_less(p));
  }
  EXPECT_GT(back, 1.0);
}

// Only sums are taken in single precision: other rules of blending see the view.
TEST(MarchCubes, HeedsTheRuleOfBlending) {
  Body body = body_of({{wyvill_point(1.0), Vec3(-0.5, 0, 0)}, {wyvill_point(1.0), Vec3(0.5, 0, 0)}});
  const MarchOptions options{.lattice = lattice_of(0.05)};
  const double sum = inspect(march_cubes(body.field, options, Executor(1))).volume;
  body.skeleton.blend.rule = BlendRule::Graph;  // without edges: a union
  body.place();
  MarchCounts counts;
  const Mesh apart = march_cubes(body.field, options, Executor(1), &counts);
  EXPECT_FALSE(counts.single_precision);
  EXPECT_NEAR(inspect(apart).volume, 2 * 0.392496505, 0.01);  // of two Wyvill spheres, which just do not overlap
  EXPECT_GT(sum, 1.1 * inspect(apart).volume);
}

// What moved primitives do not reach is kept: the mesh must be that of a fresh mesher, bit by bit.
class MovedBody : public ::testing::TestWithParam<int> {};

TEST_P(MovedBody, GivesTheMeshOfAFreshMesherAndSamplesOnlyWhatMoved) {
  Body body = random_body({.seed = 21, .parts = 400, .half_width = 1.5, .least_radius = 0.2, .largest_radius = 0.35,
                           .only_points = true});
  Random random(5);
  CubeMesher mesher;
  const Executor executor(GetParam());
  const MarchOptions options{.lattice = lattice_of(0.03)};
  MarchCounts all;
  (void)mesher.make(body.field, options, executor, &all);
  const auto expect_same = [&](const std::string& what, MarchCounts& counts) {
    body.place();
    const Mesh& kept = mesher.make(body.field, options, executor, &counts);
    EXPECT_EQ(hash_of(kept), hash_of(march_cubes(body.field, options, Executor(1)))) << what;
    expect_closed(kept);
  };
  MarchCounts counts;
  expect_same("nothing moved", counts);
  EXPECT_EQ(counts.tiles_sampled, 0u);
  for (int round = 0; round < 6; ++round) {
    const std::uint32_t moved = random.below(400);
    body.parts[moved].position += random.in_box(round < 3 ? 0.02 : 0.3);
    expect_same("one moved", counts);
    EXPECT_GT(counts.tiles_sampled, 0u);
    EXPECT_LT(counts.tiles_sampled, all.tiles_sampled / 10);
  }
  for (int round = 0; round < 3; ++round) {  // beyond the box that holds all, and back
    body.parts[7].position = round == 1 ? Vec3(0.1, 0.2, -0.1) : Vec3(-3.0 - round, 2.5, 4.0);
    expect_same("one left", counts);
  }
  for (std::size_t i = 0; i < 40; ++i) body.parts[i].position += random.in_box(0.05);
  expect_same("some moved", counts);
  for (int round = 0; round < 8; ++round) {  // more and more where few are: rows of bins run out of room
    for (std::size_t i = 0; i < 20; ++i) {
      body.parts[20 * static_cast<std::size_t>(round) + i].position = Vec3(1.3, 1.3, 1.3) + random.in_box(0.15);
    }
    expect_same("a crowd", counts);
  }
  body.skeleton.primitive[3].kernel = Kernel::wyvill(0.25);
  expect_same("one shrank", counts);
  for (Pose& part : body.parts) part.position += random.in_box(0.01);
  expect_same("all moved", counts);
  for (const double side : {-1.0, 1.0}) {  // between two that stay, so that the box does
    for (std::size_t i = 0; i < body.parts.size(); ++i) {
      const Vec3& p = body.parts[i].position;
      body.parts[i].position = i < 2 ? Vec3::Constant(i == 0 ? -3.0 : 3.0) : Vec3(side * std::abs(p.x()), p.y(), p.z());
    }
    expect_same("all on one side", counts);
  }
  body.skeleton.iso = 0.6;
  expect_same("another iso value", counts);
  body.parts.pop_back();
  body.skeleton.primitive.pop_back();
  body.skeleton.part_count = 399;
  expect_same("one fewer", counts);
}
INSTANTIATE_TEST_SUITE_P(Threads, MovedBody, ::testing::Values(1, 3));

// Any that move, in any way: a little, far, together, out of the others' reach and back.
TEST(MovedBodies, GiveTheMeshOfAFreshMesherWhateverMoves) {
  constexpr std::uint64_t kBodies = 3;
  for (std::uint64_t seed = 0; seed < kBodies; ++seed) {
    Random random(100 + seed);
    const std::uint32_t parts = 20 + random.below(300);
    const double radius = random.uniform(0.15, 0.5);
    Body body = random_body({.seed = seed, .parts = parts, .half_width = 1.0, .least_radius = 0.8 * radius, .largest_radius = radius, .only_points = true});
    const MarchOptions options{.lattice = lattice_of(radius * random.uniform(0.08, 0.4)), .refinements = static_cast<int>(random.below(2))};
    CubeMesher mesher;
    for (int round = 0; round < 20; ++round) {
      const std::uint32_t moving = 1 + random.below(round % 5 == 4 ? parts : 12), first = random.below(parts);
      const double far = std::array{0.01, 0.1, 1.0, 3.0}[random.below(4)] * radius;
      const Vec3 together = random.in_box(far);
      const bool alone = random.below(2) == 0;
      for (std::uint32_t k = 0; k < moving; ++k) body.parts[(first + k) % parts].position += alone ? random.in_box(far) : together;
      body.place();
      const Mesh& kept = mesher.make(body.field, options, Executor(1));
      ASSERT_EQ(hash_of(kept), hash_of(march_cubes(body.field, options, Executor(1)))) << seed << ' ' << round;
      expect_closed(kept);
    }
  }
}

/// Dense bodies, whose insides are not seen by bounds: a ball of blobs 40 supports deep.
Body dense(std::uint64_t seed, std::uint32_t count, double radius) {
  Random random(seed);
  std::vector<std::pair<Primitive, Vec3>> blobs;
  while (blobs.size() < count) {
    const Vec3 p = random.in_box(1.0);
    if (p.norm() < 1.0) blobs.emplace_back(wyvill_point(random.uniform(0.8, 1.2) * radius), p);
  }
  return body_of(blobs);
}

// Bins around cubes on each other are read once, and each cube has the blobs in the order and with the bits that its own bins give.
TEST(BlobColumns, GiveWhatTheBinsAroundACubeGive) {
  for (const double cell : {0.02, 0.05, 0.21}) {
    const Body body = blobs(11, 3000, 0.08, 0.3);
    blobs::BlobGrid grid;
    grid.build(body.field.packed().primitive, {.origin = Vec3(0.013, -0.02, 0.007), .cell = cell});
    blobs::BlobList expected, found, expected_far, far;
    blobs::BlobGrid::Column column;
    std::size_t all = 0;
    for (int round = 0; round < 12; ++round) {
      const std::int64_t side = round % 3 == 0 ? 8 : 16, x = 16 * (round % 4 - 2), y = 8 * (round % 5 - 2);
      const blobs::Cells base{x, y, -4 * side};
      grid.gather_column(base, side, 8 * side, column);
      for (std::int64_t z = 0; z < 8; ++z) {
        const blobs::Cells at{x, y, base[2] + z * side};
        const bool near_first = (round + z) % 2 == 0;
        grid.gather(at, side, 0, expected, near_first ? &expected_far : nullptr);
        grid.gather(column, at, side, found, near_first ? &far : nullptr);
        ASSERT_EQ(found.count, expected.count);
        ASSERT_EQ(found.near, expected.near);
        for (std::size_t i = 0; i < found.count; ++i) {
          const auto numbers = [&](const blobs::BlobList& list) { return std::array{list.scale[i], list.x[i], list.y[i], list.z[i]}; };
          ASSERT_EQ(numbers(found), numbers(expected)) << cell << " " << z << " " << i;
        }
        all += found.count;
      }
    }
    EXPECT_GT(all, 3000u);
  }
}

// A cube is sure only if F is positive at all its nodes, to the last ten thousandth, and nearly always if it is so by a factor of two.
TEST(SureCubes, HoldNoNodeOutsideAndAreFound) {
  Random random(5);
  std::size_t cubes = 0, found = 0;
  for (int round = 0; round < 12; ++round) {
    const bool few = round % 2 == 0;
    const int edge = 2 + round % 3;
    const double radius = 3.5 * edge, side = 4.0 * edge;
    blobs::BlobList list;
    list.count = list.near = few ? 3 : 150;
    list.pad();
    for (std::size_t i = 0; i < list.count; ++i) {
      const Vec3 p = random.in_box(few ? 0.5 * side : side) + Vec3::Constant(0.5 * side);
      const double scale = 1.0 / (random.uniform(0.8, 1.2) * radius);
      list.scale[i] = static_cast<float>(scale);
      list.x[i] = static_cast<float>(scale * p.x());
      list.y[i] = static_cast<float>(scale * p.y());
      list.z[i] = static_cast<float>(scale * p.z());
    }
    const auto value = [&](int x, int y, int z) {
      double sum = 0.0;
      for (std::size_t i = 0; i < list.count; ++i) {
        const auto s = static_cast<double>(list.scale[i]);
        const Vec3 u(s * x - static_cast<double>(list.x[i]), s * y - static_cast<double>(list.y[i]), s * z - static_cast<double>(list.z[i]));
        const double t = std::max(1.0 - u.squaredNorm(), 0.0);
        sum += t * t * t;
      }
      return sum;
    };
    for (unsigned cube = 0; cube < 64; ++cube) {
      const int x0 = edge * static_cast<int>(cube & 3u), y0 = edge * static_cast<int>(cube >> 2 & 3u), z0 = edge * static_cast<int>(cube >> 4);
      double least = 1e300;
      for (int n = 0; n < edge * edge * edge; ++n) {
        least = std::min(least, value(x0 + n % edge, y0 + n / edge % edge, z0 + n / (edge * edge)));
      }
      const auto sure = [&](double iso) {
        return (blobs::find_sure_cubes(list, {0.0F, 0.0F, 0.0F}, edge, static_cast<float>(iso)).inside >> cube & 1u) != 0;
      };
      EXPECT_FALSE(sure(least + 1e-4)) << round << " " << cube;
      if (few) continue;
      ++cubes;
      found += sure(0.5 * least) ? 1 : 0;
    }
  }
  EXPECT_GT(found, cubes * 9 / 10);
}

// Sums that end early decide signs alone; what the mesh reads of values is made where the surface is next to them. Radii of
// 3 to 20 cells take every way to end early: by tiles, by cubes of 2^3 and of 4^3 nodes, of near blobs and of all.
TEST(MarchCubes, GivesTheSameMeshWhenSumsEndEarly) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    for (const double cells : {2.0, 3.0, 6.0, 10.0, 14.0, 20.0}) {
      const double radius = 0.3;
      Body body = dense(seed, 1500, radius);
      MarchOptions options{.lattice = lattice_of(radius / cells)};
      MarchCounts skipped, whole;
      CubeMesher mesher;
      const Executor executor(2);
      double share = 1.0;
      for (int round = 0; round < 3; ++round) {  // moved twice: a cave is dug, next to leaves that stay
        options.skip = true;
        const Mesh& fast = mesher.make(body.field, options, executor, &skipped);
        options.skip = false;
        const Mesh slow = march_cubes(body.field, options, executor, &whole);
        EXPECT_EQ(hash_of(fast), hash_of(slow)) << seed << " " << cells << " " << round;
        expect_closed(fast);
        if (round == 0) share = static_cast<double>(skipped.kernel_values) / static_cast<double>(whole.kernel_values);
        if (round > 0) {
          EXPECT_LT(skipped.tiles_sampled, whole.tiles_sampled / 2) << "all was made anew";
        }
        const Vec3 cave = Vec3(0.7 - 0.6 * round, 0.1, 0.0);
        for (std::size_t i = 0; i < body.parts.size(); ++i) {
          Vec3& p = body.parts[i].position;
          const Vec3 away = p - cave;
          if (away.norm() < 0.25) p = cave + 0.25 * away.normalized();
        }
        body.place();
      }
      EXPECT_NE(share, 1.0) << cells;
      if (cells > 2.0 && cells < 14.0) {  // few tiles lie inside of coarser ones, finer ones are decided by bounds
        EXPECT_LT(share, 0.8) << cells;
      }
    }
  }
}

void expect_message(const std::function<void()>& act, ErrorKind kind, const std::vector<std::string>& words) {
  try {
    act();
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    for (const std::string& word : words) {
      EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << word << " in: " << error.what();
    }
  }
}

TEST(MarchCubes, RefusesABillionNodesBeforeTakingMemory) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  expect_message([&] { (void)march_cubes(body.field, {.lattice = lattice_of(0.0018)}, Executor(1)); }, ErrorKind::Limit,
                 {"lattice.cell", "1000000000 lattice nodes", "1.38e+09", "0.0018 m", "use cells of at least 0.00"});
  expect_message([&] { (void)march_cubes(body.field, {.lattice = lattice_of(1e-12)}, Executor(1)); }, ErrorKind::Limit,
                 {"lattice.cell", "node numbers", "use cells of at least"});
  expect_message([&] { (void)march_cubes(body.field, {.lattice = lattice_of(0.0), .error = 1e-12}, Executor(1)); },
                 ErrorKind::Limit, {"mesh.error", "1e-12 m", " m with triangles of 0.0", "meets it is too large; allow at least"});
  EXPECT_THROW((void)march_cubes(body.field, {.lattice = lattice_of(0.0)}, Executor(1)), ContractViolation);
  EXPECT_THROW((void)march_cubes(body.field, {.lattice = lattice_of(0.1), .refinements = 5}, Executor(1)),
               ContractViolation);
}

/// A ball whose bounds deny it on one side.
struct HidingBall : FunctionField {
  HidingBall() : FunctionField(sphere(Vec3::Zero(), 0.5)) {}
  [[nodiscard]] Interval bound(const Box& b) const {
    return b.lower.x() > 0.1 ? Interval{-1.0, -0.5} : FunctionField::bound(b);
  }
};

TEST(MarchCubes, ReportsBoundsThatHideTheSurfaceInsteadOfLeavingAHole) {
  const HidingBall ball;
  expect_message([&] { (void)march_cubes(ball, {.lattice = lattice_of(0.03)}, Executor(1)); }, ErrorKind::Internal,
                 {"surface in block", "bounds exclude"});
}

}  // namespace
}  // namespace supple::implicit
