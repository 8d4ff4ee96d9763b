// Bodies that touch, with triangles of guaranteed quality.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <set>

#include "implicit/analytic_fields.h"
#include "implicit/mesh_checks.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/implicit/delaunay.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr double kDegree = std::numbers::pi / 180.0;

std::vector<FieldView> views_of(const std::vector<FunctionField>& fields) { return {fields.begin(), fields.end()}; }

DelaunayOptions options_of(double size, double distance) {
  return {.angle = 30.0 * kDegree, .size = size, .distance = distance, .cell = 0.5 * size};
}

/// Least angle, largest circumradius and largest distance from a circumcentre to a surface.
struct Quality {
  double angle = std::numbers::pi, radius = 0.0, distance = 0.0;
};
template <class Distance>
Quality quality_of(const Mesh& mesh, const Distance& distance) {
  Quality q;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &at = mesh.position[t[k]], u = mesh.position[t[(k + 1) % 3]] - at, v = mesh.position[t[(k + 2) % 3]] - at;
      q.angle = std::min(q.angle, std::atan2(u.cross(v).norm(), u.dot(v)));
    }
    const Vec3 u = b - a, w = c - a, n = u.cross(w);
    const Vec3 centre = a + (u.squaredNorm() * w.cross(n) + w.squaredNorm() * n.cross(u)) / (2.0 * n.squaredNorm());
    q.radius = std::max(q.radius, (centre - a).norm());
    q.distance = std::max(q.distance, distance(centre));
  }
  return q;
}

/// Triangles of a mesh whose vertices are all in contact with a body, by that of both meshes.
std::vector<Corners> contact_triangles(const Mesh& mesh, std::size_t other, bool reversed) {
  std::vector<Corners> found;
  for (auto t : mesh.triangle) {
    if (!std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return mesh.columns.at(0).values[v] == static_cast<double>(other + 1); })) continue;
    if (reversed) std::swap(t[1], t[2]);
    found.push_back(corners_of(mesh, t));
  }
  std::sort(found.begin(), found.end());
  return found;
}

// From balls that just touch, with a groove as sharp as one likes between them, to one that is nearly inside the other.
TEST(DelaunayPartition, HoldsAngleSizeAndDistanceAndSharesTheContact) {
  const std::vector<std::vector<FunctionField>> pairs{
      {sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)}, {sphere({-0.4995, 0, 0}, 0.5), sphere({0.4995, 0, 0}, 0.5)},
      {sphere({-0.495, 0, 0}, 0.5), sphere({0.495, 0.01, 0}, 0.5)},    {sphere({-0.05, 0, 0}, 0.5), sphere({0.15, 0.01, 0}, 0.5)},
      {sphere(Vec3::Zero(), 0.5), sphere({0.4, 0.01, 0}, 0.2)},        {torus(0.4, 0.2), sphere({0.3, 0.05, 0.3}, 0.3)}};
  for (const auto& [size, distance] : {std::pair{0.1, 0.01}, std::pair{0.1, 0.003}}) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const std::vector<FieldView> views = views_of(pairs[i]);
      DelaunayReport report;
      const std::vector<Mesh> mesh = delaunay_partition(views, options_of(size, distance), Executor(1), &report);
      EXPECT_EQ(report.sharp, 0u) << i;
      Quality worst;
      for (std::size_t m = 0; m < 2; ++m) {
        expect_closed(mesh[m]);
        EXPECT_EQ(inspect(mesh[m]).euler_characteristic, i == 5 && m == 0 ? 0 : 2) << i;
        EXPECT_EQ(self_intersections(mesh[m], size), 0u) << i;
        // |grad F| = 1, and |F_a - F_b| is at most twice the distance to where they are equal.
        const Quality q = quality_of(mesh[m], [&](const Vec3& p) {
          const double own = views[m].value(p), other = views[1 - m].value(p);
          return std::min(std::abs(own), 0.5 * std::abs(own - other));
        });
        EXPECT_GE(q.angle, 30.0 * kDegree - 1e-9) << i;
        EXPECT_LE(q.radius, size) << i;
        EXPECT_LE(q.distance, distance) << i;
        worst.angle = std::min(worst.angle, q.angle);
        worst.radius = std::max(worst.radius, q.radius);
      }
      EXPECT_NEAR(report.least_angle, worst.angle, 1e-12) << i;
      EXPECT_NEAR(report.largest_radius, worst.radius, 1e-12) << i;
      EXPECT_LE(report.largest_distance, distance) << i;
      const auto here = contact_triangles(mesh[0], 1, false), there = contact_triangles(mesh[1], 0, true);
      EXPECT_GT(here.size(), 4u) << i;
      std::vector<Corners> both;
      std::set_intersection(here.begin(), here.end(), there.begin(), there.end(), std::back_inserter(both));
      std::size_t lone = 0;  // three vertices of a rim may span a free surface, too
      for (std::size_t m = 0; m < 2; ++m) {
        for (const Corners& c : m == 0 ? here : there) {
          if (std::binary_search(both.begin(), both.end(), c)) continue;
          ++lone;
          const Vec3 middle = (Vec3(c[0].data()) + Vec3(c[1].data()) + Vec3(c[2].data())) / 3.0;
          EXPECT_LT(std::abs(views[m].value(middle)), std::abs(views[0].value(middle) - views[1].value(middle))) << i;
        }
      }
      EXPECT_LT(5 * lone, both.size()) << i;
    }
  }
}

// Vertices lie on what they bound, normals are those of the fields, and both meshes have the vertices of the rim bit by bit.
TEST(DelaunayPartition, HasItsVerticesOnTheSurfacesAndTheRim) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const std::vector<FieldView> views = views_of(balls);
  const std::vector<Mesh> mesh = delaunay_partition(views, options_of(0.12, 0.012), Executor(1));
  std::array<std::set<std::array<double, 3>>, 2> rim;
  for (std::size_t m = 0; m < 2; ++m) {
    ASSERT_EQ(mesh[m].columns.at(0).name, "contact");
    for (std::uint32_t v = 0; v < mesh[m].vertex_count(); ++v) {
      const Vec3& p = mesh[m].position[v];
      Vec3 own, other;
      const double f = views[m].value(p, own), g = views[1 - m].value(p, other);
      EXPECT_NEAR(mesh[m].normal[v].norm(), 1.0, 1e-12);
      if (mesh[m].columns[0].values[v] == 0.0) {
        EXPECT_LE(std::abs(f), 1e-12);
        EXPECT_LE(g, 1e-9);
        EXPECT_LT((mesh[m].normal[v] + own).norm(), 1e-9);
        continue;
      }
      EXPECT_LE(std::abs(f - g), 1e-12);
      EXPECT_GE(f, -1e-9);
      if (std::abs(f) < 1e-12) {
        rim[m].insert({p.x(), p.y(), p.z()});
      } else {
        EXPECT_LT((mesh[m].normal[v] + (own - other).normalized()).norm(), 1e-9);
      }
    }
  }
  EXPECT_EQ(rim[0], rim[1]);
  EXPECT_GE(rim[0].size(), 8u);
}

// Four balls around a point: contacts of two, rims of three, corners of four.
TEST(DelaunayPartition, HoldsTheAngleWhereThreeAndFourBodiesMeet) {
  std::vector<FunctionField> balls;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 3.0;
    balls.push_back(sphere({0.3 * std::cos(angle), 0.3 * std::sin(angle), 0.0}, 0.45));
  }
  for (const std::size_t count : {3u, 4u}) {
    if (count == 4) balls.push_back(sphere({0, 0, 0.35}, 0.4));
    DelaunayReport report;
    const std::vector<Mesh> mesh = delaunay_partition(views_of(balls), options_of(0.1, 0.01), Executor(2), &report);
    EXPECT_EQ(report.sharp, 0u);
    for (const Mesh& m : mesh) {
      expect_closed(m);
      EXPECT_EQ(inspect(m).euler_characteristic, 2);
      EXPECT_EQ(self_intersections(m, 0.1), 0u);
      EXPECT_GE(quality_of(m, [](const Vec3&) { return 0.0; }).angle, 30.0 * kDegree - 1e-9);
    }
    for (std::size_t a = 0; a < count; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        std::vector<Corners> both;
        const auto here = contact_triangles(mesh[a], b, false), there = contact_triangles(mesh[b], a, true);
        std::set_intersection(here.begin(), here.end(), there.begin(), there.end(), std::back_inserter(both));
        EXPECT_FALSE(both.empty()) << a << " " << b;
      }
    }
  }
}

/// A hollow ball with a thin wall.
FunctionField hollow_ball(double radius, double wall) {
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                const double r = p.norm(), off = r - radius;
                gradient = r > 0.0 ? Vec3(std::copysign(1.0, -off) * p / r) : Vec3::Zero();
                return 0.5 * wall - std::abs(off);
              },
          .lipschitz = 1.0,
          .box = Box{Vec3::Constant(-radius), Vec3::Constant(radius)}.inflated(0.51 * wall)};
}

// A ball in a hollow one, with a gap that is a tenth of the distance: triangles of the one would reach through those of the other.
TEST(DelaunayPartition, KeepsSheetsApartThatAreNearerThanTheDistance) {
  for (const double gap : {0.01, 0.003}) {
    const std::vector<FunctionField> bodies{hollow_ball(0.1, 0.04), sphere(Vec3::Zero(), 0.08 - gap)};
    const DelaunayOptions options{.angle = 30.0 * kDegree, .size = 0.12, .distance = 0.03, .cell = 0.012};
    DelaunayReport report;
    const std::vector<Mesh> mesh = delaunay_partition(views_of(bodies), options, Executor(1), &report);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_EQ(report.sharp, 0u);
    Mesh both = mesh[0];
    append(both, mesh[1]);
    EXPECT_EQ(expect_closed(both).components, 3u);  // outside, inside and the ball
    EXPECT_EQ(self_intersections(both, 0.02), 0u) << gap;
    EXPECT_LE(report.largest_radius, options.size);
    EXPECT_LE(report.largest_distance, options.distance);
  }
}

// What it divides without the angle keeps the parts that cells of the lattice see.
TEST(DelaunayPartition, KeepsThinWallsWhereItDoesNotHoldTheAngle) {
  const std::vector<FunctionField> bodies{hollow_ball(0.1, 0.014), sphere({0.0, 0.005, 0.14}, 0.035)};
  const DelaunayOptions options{.angle = 30.0 * kDegree, .size = 0.09, .distance = 0.03, .cell = 0.0056};
  DelaunayReport report;
  const std::vector<Mesh> mesh = delaunay_partition(views_of(bodies), options, Executor(1), &report);
  EXPECT_GT(report.sharp, 0u);
  const MeshReport wall = expect_closed(mesh[0]);
  EXPECT_EQ(wall.components, 2u);
  EXPECT_EQ(wall.euler_characteristic, 4);
}

// Whatever lies how: meshes are closed, and what is not held is said. Of pairs, nearly all hold the angle.
TEST(DelaunayPartition, SaysWhereItDoesNotHoldTheAngle) {
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    std::vector<FunctionField> balls;
    for (int i = 0; i < (seed % 4 == 0 ? 6 : 2); ++i) balls.push_back(sphere(random.in_box(0.4), random.uniform(0.25, 0.5)));
    DelaunayReport report;
    const std::vector<Mesh> mesh = delaunay_partition(views_of(balls), options_of(0.2, 0.02), Executor(1), &report);
    double angle = std::numbers::pi;
    for (const Mesh& m : mesh) {
      if (m.triangle.empty()) continue;  // inside others
      expect_closed(m);
      angle = std::min(angle, quality_of(m, [](const Vec3&) { return 0.0; }).angle);
    }
    EXPECT_NEAR(report.least_angle, angle, 1e-9) << seed;
    EXPECT_EQ(report.sharp == 0, angle >= 30.0 * kDegree - 1e-12) << seed;
    if (seed % 4 != 0) held += report.sharp == 0 ? 1 : 0;
  }
  EXPECT_GE(held, 8);  // of 9
}

TEST(DelaunayPartition, KeepsGroupsApartAndAGroundWithoutAMesh) {
  const std::vector<FunctionField> fields{sphere({0, 0, 0.4}, 0.5), below(0.0), sphere({3, 0, 0.5}, 0.4), sphere({3.5, 0.1, 0.6}, 0.4)};
  DelaunayReport report;
  const std::vector<Mesh> mesh = delaunay_partition(views_of(fields), options_of(0.1, 0.01), Executor(1), &report);
  EXPECT_EQ(report.sharp, 0u);
  EXPECT_TRUE(mesh[1].triangle.empty());
  for (const std::size_t m : {0u, 2u, 3u}) expect_closed(mesh[m]);
  const auto others = [&](std::size_t m) { return std::set<double>(mesh[m].columns[0].values.begin(), mesh[m].columns[0].values.end()); };
  EXPECT_EQ(others(0), (std::set<double>{0.0, 2.0}));
  EXPECT_EQ(others(2), (std::set<double>{0.0, 4.0}));
  EXPECT_EQ(others(3), (std::set<double>{0.0, 3.0}));
  for (std::size_t v = 0; v < mesh[0].vertex_count(); ++v) {
    const Vec3& p = mesh[0].position[v];
    const double own = views_of(fields)[0].value(p);
    if (mesh[0].columns[0].values[v] != 0.0) {
      EXPECT_NEAR(own, -p.z(), 1e-12);
    } else {
      EXPECT_NEAR(own, 0.0, 1e-12);
    }
  }
}

TEST(DelaunayPartition, RepeatsBitByBitOnAnyNumberOfThreads) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const auto once = hash_of(delaunay_partition(views_of(balls), options_of(0.1, 0.01), Executor(1)));
  EXPECT_EQ(hash_of(delaunay_partition(views_of(balls), options_of(0.1, 0.01), Executor(2))), once);
}

// Of a ball: area over the largest triangle in a circle of radius min(size, sqrt(2 r distance)), and half as many vertices.
TEST(DelaunayEstimate, OfABallIsThatOfTheSphere) {
  constexpr double kRadius = 0.5, kDistance = 1e-4, kSize = 0.02, kCell = 0.05;
  const FunctionField ball = sphere({0.01, 0.02, 0.03}, kRadius);
  const Mesh mesh = polygonise(ball, {.cell = kCell}, Executor(1));
  const double area = 4.0 * std::numbers::pi * kRadius * kRadius, largest = 0.75 * std::numbers::sqrt3;
  const double by_distance = 0.5 * area / (largest * 2.0 * kRadius * kDistance), by_size = 0.5 * area / (largest * kSize * kSize);
  const DelaunayEstimate estimate = estimate_delaunay({&mesh, 1}, options_of(kSize, kDistance));
  const double sagitta = 3.0 * kCell * kCell / (8.0 * kRadius);  // chords are diagonals of cells at most
  const double least = std::pow(1.0 - sagitta / kRadius, 2);
  EXPECT_LE(estimate.by_distance, by_distance);
  EXPECT_GE(estimate.by_distance, least * by_distance);
  EXPECT_LE(estimate.by_size, by_size);
  EXPECT_GE(estimate.by_size, least * by_size);
  EXPECT_GE(estimate.vertices, std::max(estimate.by_size, estimate.by_distance));
  EXPECT_LE(estimate.vertices, estimate.by_size + estimate.by_distance);
}

// Planes need no vertices for the distance, and what two bodies share counts once.
TEST(DelaunayEstimate, CountsContactsOnceAndByAreaAlone) {
  Mesh mesh;
  mesh.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normal.assign(3, Vec3::UnitZ());
  mesh.triangle = {{0, 1, 2}};
  const auto estimate_of = [&] { return estimate_delaunay({&mesh, 1}, options_of(0.1, 1e-9)); };
  const double plane = estimate_of().vertices;
  EXPECT_NEAR(plane, 0.5 * 0.5 / (0.75 * std::numbers::sqrt3 * 0.01), 1e-12 * plane);
  mesh.normal[1] = Vec3(1, 0, 1).normalized();
  EXPECT_GT(estimate_of().vertices, 1e6);
  mesh.columns = {{.name = "contact", .values = {0.0, 0.0, 2.0}}};
  EXPECT_NEAR(estimate_of().vertices, 0.5 * plane, 1e-12 * plane);
}

TEST(DelaunayPartition, TakesMoreVerticesThanTheEstimateAndNotMuchMore) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const std::vector<Mesh> seen = polygonise_partition(views_of(balls), {.origin = Vec3(0.01, 0.02, 0.03), .cell = 0.05}, Executor(1));
  for (const auto& [size, distance] : {std::pair{0.1, 0.01}, std::pair{0.1, 1e-3}, std::pair{0.2, 1e-3}}) {
    DelaunayReport report;
    const double estimate = estimate_delaunay(seen, options_of(size, distance)).vertices;
    (void)delaunay_partition(views_of(balls), options_of(size, distance), Executor(1), &report);
    EXPECT_GE(static_cast<double>(report.seeds + report.inserted), estimate) << size << ' ' << distance;
    EXPECT_LE(static_cast<double>(report.seeds + report.inserted), 4.0 * estimate) << size << ' ' << distance;
  }
}

TEST(DelaunayPartition, RefusesBoundsThatTakeTooManyVertices) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const auto fault_of = [&](DelaunayOptions options, std::uint64_t most) {
    options.most_vertices = most;
    try {
      (void)delaunay_partition(views_of(balls), options, Executor(1));
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Limit);
      return error.faults().front();
    }
    ADD_FAILURE() << "no error";
    return Fault{};
  };
  const Fault tiny = fault_of(options_of(0.2, 1e-9), 2'000'000);
  EXPECT_EQ(tiny.key, "mesh.distance");
  EXPECT_TRUE(tiny.found.starts_with("at least ") && tiny.found.ends_with(" by the area and curvature of the surface")) << tiny.found;
  DelaunayOptions small = options_of(1e-6, 0.1);
  small.cell = 0.1;
  EXPECT_EQ(fault_of(small, 2'000'000).key, "mesh.size");
  // More than the estimate, fewer than it takes.
  const Fault more = fault_of(options_of(0.2, 1e-3), 2200);
  EXPECT_EQ(more.key, "mesh.distance");
  EXPECT_EQ(more.found, "more");
  EXPECT_TRUE(more.hint.starts_with("use a distance of at least 0.00")) << more.hint;
}

// By evaluations of the fields, not by a clock: of a batch none comes after the first that is refused.
TEST(DelaunayPartition, EndsSoonAfterAnInterrupt) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  std::atomic<int> interrupt{0};
  std::uint64_t calls = 0, at = 0;
  std::vector<FunctionField> counted = balls;
  for (std::size_t m = 0; m < balls.size(); ++m) {
    counted[m].function = [&, m](const Vec3& p, Vec3& gradient) {
      if (++calls == at) interrupt = 15;
      return balls[m].function(p, gradient);
    };
  }
  for (const double distance : {0.003, 1e-4}) {  // by Delaunay's criterion, and where edges become too short for it
    DelaunayOptions options = options_of(0.2, distance);
    options.interrupt = &interrupt;
    calls = at = 0;
    interrupt = 0;
    (void)delaunay_partition(views_of(counted), options, Executor(1));
    const std::uint64_t all = calls;
    for (const double share : {0.01, 0.1, 0.5, 0.99}) {
      interrupt = 0;
      calls = 0;
      at = static_cast<std::uint64_t>(share * static_cast<double>(all));
      EXPECT_THROW((void)delaunay_partition(views_of(counted), options, Executor(1)), Interrupted) << share;
      EXPECT_LT(calls - at, 1000u) << share;
    }
  }
}

}  // namespace
}  // namespace supple::implicit
