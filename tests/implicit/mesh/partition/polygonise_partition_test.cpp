// Meshes of bodies that touch: space is divided by the largest positive field.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/partition/polygonise_junctions.h"
#include "supple/core/error.h"
#include "supple/implicit/polygonise.h"
#include "support/mesh_distance.h"

namespace supple::implicit {
namespace {

using namespace testing;

const Vec3 kOffset(0.0137, -0.0071, 0.0229);

Lattice lattice_of(double cell) { return {.origin = kOffset, .cell = cell}; }

std::vector<FieldView> views_of(const std::vector<FunctionField>& fields) { return {fields.begin(), fields.end()}; }

double expect_all_closed(const std::vector<Mesh>& meshes) {
  double volume = 0.0;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const MeshReport report = inspect(meshes[m]);
    const bool hidden = meshes[m].triangle_count() == 0;  // the body lies inside others
    EXPECT_TRUE(hidden || report.closed) << m;
    EXPECT_TRUE(hidden || report.oriented) << m;
    EXPECT_EQ(meshes[m].normal.size(), meshes[m].vertex_count());
    EXPECT_EQ(meshes[m].columns.at(0).values.size(), meshes[m].vertex_count());
    volume += report.volume;
  }
  return volume;
}

double contact_of(const Mesh& mesh, std::uint32_t vertex) { return mesh.columns.at(0).values[vertex]; }

/// Triangles of `mesh` that lie in the contact with body `other`: those whose reverse is in the other mesh.
std::vector<Corners> contact_triangles(const Mesh& mesh, std::size_t other, bool reversed) {
  std::vector<Corners> found;
  for (auto t : mesh.triangle) {
    const bool touches = std::all_of(t.begin(), t.end(), [&](std::uint32_t v) {
      return contact_of(mesh, v) == static_cast<double>(other + 1);
    });
    if (!touches) continue;
    if (reversed) std::swap(t[1], t[2]);
    found.push_back(corners_of(mesh, t));
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<FunctionField> random_spheres(std::uint64_t seed, std::size_t count) {
  Random random(seed);
  std::vector<FunctionField> fields;
  for (std::size_t i = 0; i < count; ++i) fields.push_back(sphere(random.in_box(0.4), random.uniform(0.25, 0.5)));
  return fields;
}

TEST(PolygonisePartition, OfOneBodyIsItsMesh) {
  const Body body = random_body({.seed = 2, .parts = 20});
  const FieldView view = body.field;
  std::vector<Mesh> parts = polygonise_partition({&view, 1}, lattice_of(0.06), Executor(1));
  ASSERT_EQ(parts.size(), 1u);
  ASSERT_EQ(parts[0].columns.size(), 1u);
  EXPECT_EQ(parts[0].columns[0].name, "contact");
  for (const double contact : parts[0].columns[0].values) EXPECT_EQ(contact, 0.0);
  parts[0].columns.clear();
  const Mesh mesh = polygonise(body.field, lattice_of(0.06), Executor(1));
  EXPECT_EQ(hash_of(parts[0]), hash_of(mesh));
}

TEST(PolygonisePartition, OfTwoBallsSharesTheContactBitForBit) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const auto views = views_of(balls);
  PolygoniseCounts counts;
  const std::vector<Mesh> mesh = polygonise_partition(views, lattice_of(0.04), Executor(1), &counts);
  expect_all_closed(mesh);
  EXPECT_EQ(inspect(mesh[0]).euler_characteristic, 2);
  EXPECT_EQ(inspect(mesh[1]).euler_characteristic, 2);
  EXPECT_LT(counts.residual, 1e-12);

  const auto here = contact_triangles(mesh[0], 1, false), there = contact_triangles(mesh[1], 0, true);
  EXPECT_GT(here.size(), 100u);
  EXPECT_EQ(here, there);

  const auto difference = [&](const Vec3& p) { return views[0].value(p) - views[1].value(p); };
  for (std::size_t m = 0; m < 2; ++m) {
    for (std::uint32_t v = 0; v < mesh[m].vertex_count(); ++v) {
      const Vec3& p = mesh[m].position[v];
      if (contact_of(mesh[m], v) != 0.0) {
        ASSERT_LE(std::abs(difference(p)), 1e-12);
      } else {
        ASSERT_LE(std::abs(views[m].value(p)), 1e-12);
      }
    }
  }
}

// Rims are met to second order: their vertices lie on them, one in every tetrahedron that they pass, and both meshes have them.
TEST(PolygonisePartition, MeetsTheCircleThatIsTheRimOfTwoBalls) {
  constexpr double kRadius = 0.5, kApart = 0.7;
  for (const double other : {0.5, 0.35}) {
    const double place = (kApart * kApart + kRadius * kRadius - other * other) / (2.0 * kApart);
    const double rim = std::sqrt(kRadius * kRadius - place * place);
    for (const double tilt : {0.0, 0.3, 0.7}) {
      const Vec3 axis = Vec3(1.0, tilt, 0.5 * tilt * tilt).normalized(), u = axis.unitOrthogonal(), v = axis.cross(u);
      const std::vector<FunctionField> balls{sphere(Vec3::Zero(), kRadius), sphere(kApart * axis, other)};
      for (const double cell : {0.16, 0.08, 0.04, 0.02}) {
        PolygoniseCounts counts;
        const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(cell), Executor(1), &counts);
        expect_all_closed(mesh);
        EXPECT_EQ(contact_triangles(mesh[0], 1, false), contact_triangles(mesh[1], 0, true));
        EXPECT_GT(counts.boundary_points, 0u);
        EXPECT_LE(counts.boundary_points_moved, counts.boundary_points / 100);
        EXPECT_LE(counts.junctions_moved, counts.junctions / 100);
        // Sagitta of a chord as long as the diagonal of a cell.
        const double sagitta = 3.0 * cell * cell / (8.0 * rim);
        std::array<std::set<std::array<double, 3>>, 2> on_boundary;
        for (std::size_t m = 0; m < 2; ++m) {
          const supple::testing::MeshDistance distance(mesh[m], cell);
          double largest = 0.0;
          for (int i = 0; i < 500; ++i) {
            const double angle = 2.0 * std::numbers::pi * i / 500.0;
            largest = std::max(largest, distance(place * axis + rim * (std::cos(angle) * u + std::sin(angle) * v)));
          }
          EXPECT_LT(largest, sagitta) << other << " " << tilt << " " << cell;
          if (cell > 0.03) {
            EXPECT_EQ(self_intersections(mesh[m], cell), 0u);
          }
          for (const Vec3& p : mesh[m].position) {
            const double along = p.dot(axis), across = (p - along * axis).norm();
            if (std::hypot(along - place, across - rim) < 1e-9) on_boundary[m].insert({p.x(), p.y(), p.z()});
          }
        }
        EXPECT_EQ(on_boundary[0], on_boundary[1]);  // bit for bit
        EXPECT_GT(static_cast<double>(on_boundary[0].size()), 2.0 * std::numbers::pi * rim / cell);  // more than one a cell
      }
    }
  }
}

// A lens that no node of the lattice lies in still parts two balls: their meshes end at its rim and leave no gap or overlap.
TEST(PolygonisePartition, FindsTheRimOfALensThatHoldsNoNode) {
  constexpr double kCell = 0.1, kRadius = 0.5, kDepth = 0.01;
  const Vec3 axis = Vec3(1.0, 0.4, 0.2).normalized(), u = axis.unitOrthogonal(), v = axis.cross(u);
  const double half = kRadius - 0.5 * kDepth, rim = std::sqrt(kRadius * kRadius - half * half);
  const std::vector<FunctionField> balls{sphere(half * axis, kRadius), sphere(-half * axis, kRadius)};
  PolygoniseCounts counts;
  const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(kCell), Executor(1), &counts);
  expect_all_closed(mesh);
  EXPECT_GT(counts.boundary_points, 0u);
  for (std::size_t m = 0; m < 2; ++m) {
    EXPECT_EQ(self_intersections(mesh[m], kCell), 0u);
    const supple::testing::MeshDistance distance(mesh[m], kCell);
    for (int i = 0; i < 200; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / 200.0;
      EXPECT_LT(distance(rim * (std::cos(angle) * u + std::sin(angle) * v)), 3.0 * kCell * kCell / (8.0 * rim));
    }
  }
}

// Where four of balls and outside meet there is a vertex of all that do, wherever the lattice lies, and rims run straight to it.
TEST(PolygonisePartition, HasAVertexWhereFourMeet) {
  constexpr double kRadius = 0.5, kAround = 0.35;
  std::vector<FunctionField> balls;
  for (const Vec3& corner : {Vec3(1, 1, 1), Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)}) {
    balls.push_back(sphere(kAround / std::sqrt(3.0) * corner, kRadius));
  }
  // Three balls and outside meet on the line through the origin and the middle of their centres, all four in the origin.
  const double middle = kAround / 3.0, across = std::sqrt(kAround * kAround - middle * middle);
  const double height = middle + std::sqrt(kRadius * kRadius - across * across);
  std::vector<std::pair<Vec3, std::vector<std::size_t>>> points{{Vec3::Zero(), {0, 1, 2, 3}}};
  for (std::size_t without = 0; without < 4; ++without) {
    points.push_back({-height * balls[without].box.centre().normalized(), {}});
    for (std::size_t m = 0; m < 4; ++m) {
      if (m != without) points.back().second.push_back(m);
    }
  }
  Random random(5);
  std::size_t meshes = 0, all = 0;
  for (int i = 0; i < 12; ++i) {
    const Lattice lattice{.origin = random.in_box(0.1), .cell = random.uniform(0.04, 0.1)};
    PolygoniseCounts counts;
    const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice, Executor(1), &counts);
    expect_all_closed(mesh);
    EXPECT_LT(counts.residual, 1e-12);
    for (const auto& [point, bodies] : points) {
      std::size_t with = 0;
      for (const std::size_t m : bodies) {
        const auto& p = mesh[m].position;
        with += std::any_of(p.begin(), p.end(), [&at = point](const Vec3& q) { return (q - at).norm() < 1e-9; }) ? 1 : 0;
      }
      EXPECT_GT(with, 0u) << i;
      meshes += with;
      all += bodies.size();
    }
    for (const Mesh& m : mesh) EXPECT_EQ(self_intersections(m, lattice.cell), 0u);
  }
  EXPECT_GT(10 * meshes, 9 * all);  // where a thin wedge of one ends in a vertex beside it, its mesh does without
}

// Between two balls, a third one's wedge may lie on lattice edges without a node: both sheets of it are there.
TEST(PolygonisePartition, ThreeBallsMeetAtTheirRims) {
  std::vector<FunctionField> balls;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 3.0;
    balls.push_back(sphere({0.3 * std::cos(angle), 0.3 * std::sin(angle), 0.0}, 0.45));
  }
  // Where all three meet outside: at the height z on the axis; at height 0 between two of them.
  const Vec3 top(0.0, 0.0, std::sqrt(0.45 * 0.45 - 0.3 * 0.3));
  const auto views = views_of(balls);
  for (const double cell : {0.1, 0.05, 0.025}) {
    PolygoniseCounts counts;
    const std::vector<Mesh> mesh = polygonise_partition(views, lattice_of(cell), Executor(1), &counts);
    expect_all_closed(mesh);
    for (const Mesh& one : mesh) {
      EXPECT_EQ(self_intersections(one, cell), 0u);
      const supple::testing::MeshDistance distance(one, cell);
      EXPECT_LT(distance(top), 0.5 * cell);
    }
    // Triangles of two bodies are those of the other, reversed.
    for (std::size_t m = 0; m < 3; ++m) {
      std::size_t shared = 0;
      std::set<Corners> all;
      for (const auto& t : mesh[(m + 1) % 3].triangle) all.insert(corners_of(mesh[(m + 1) % 3], {t[0], t[2], t[1]}));
      for (const auto& t : mesh[m].triangle) shared += all.count(corners_of(mesh[m], t));
      EXPECT_GT(shared, 10u);
    }
  }
}

/// Distance to the surface of the ball round `centre` without what lies nearer to the other ball: its cap and the disc.
double distance_to_half(const Vec3& p, const Vec3& axis, double apart, double radius) {
  const double along = p.dot(axis), across = (p - along * axis).norm(), rim = std::sqrt(radius * radius - apart * apart);
  const Vec3 from = p - apart * axis;
  const double to_boundary = std::hypot(along, across - rim);
  // The foot on the ball lies on the cap where it is on this side of the plane.
  const bool on_cap = apart + radius * from.dot(axis) / from.norm() >= 0.0;
  const double to_cap = on_cap ? std::abs(from.norm() - radius) : to_boundary;
  return std::min(to_cap, across <= rim ? std::abs(along) : to_boundary);
}

// Meshes to a stated error, where bodies touch: both ways, and with the contact shared bit for bit.
TEST(PolygonisePartition, ReachesTheErrorThatIsAskedForWhereBodiesTouch) {
  constexpr double kRadius = 0.5, kApart = 0.35;
  const Vec3 axis = Vec3(1.0, 0.3, 0.045).normalized(), u = axis.unitOrthogonal(), v = axis.cross(u);
  const std::vector<FunctionField> balls{sphere(kApart * axis, kRadius), sphere(-kApart * axis, kRadius)};
  std::size_t last = 0;
  for (const double error : {2e-2, 5e-3, 2e-3}) {
    const std::vector<Mesh> mesh = polygonise_partition_within(views_of(balls), lattice_of(0.25), {error}, Executor(2));
    expect_all_closed(mesh);
    EXPECT_EQ(contact_triangles(mesh[0], 1, false), contact_triangles(mesh[1], 0, true));
    EXPECT_GT(mesh[0].triangle_count(), 3 * last / 2);
    last = mesh[0].triangle_count();
    for (const auto& [m, side] : {std::pair{0, 1.0}, std::pair{1, -1.0}}) {
      const Mesh& one = mesh[static_cast<std::size_t>(m)];
      double there = 0.0, back = 0.0;
      for (const auto& t : one.triangle) {
        const Vec3 c = (one.position[t[0]] + one.position[t[1]] + one.position[t[2]]) / 3.0;
        there = std::max(there, distance_to_half(c, side * axis, kApart, kRadius));
      }
      EXPECT_LE(there, error);
      EXPECT_GT(there, error / 16.0);  // of the finer of both
      const supple::testing::MeshDistance distance(one, std::sqrt(error));
      for (int i = 0; i < 4000; ++i) {  // of the disc, the rim and the cap
        const double angle = 2.399963 * i, share = (i + 0.5) / 4000.0, z = side * (kApart + kRadius) * share;
        const double rim = std::sqrt(kRadius * kRadius - kApart * kApart);
        const double across = std::sqrt(std::max(kRadius * kRadius - std::pow(z - side * kApart, 2), 0.0));
        const Vec3 turn = std::cos(angle) * u + std::sin(angle) * v;
        for (const Vec3& p : {Vec3(z * axis + across * turn), Vec3(rim * std::sqrt(share) * turn), Vec3(rim * turn)}) {
          back = std::max(back, distance(p));
        }
      }
      EXPECT_LE(back, 4.0 * error) << error;
    }
  }
  try {
    (void)polygonise_partition_within(views_of(balls), lattice_of(0.25), {1e-9, "some.key"}, Executor(2));
    FAIL() << "no error";
  } catch (const Error& caught) {
    EXPECT_EQ(caught.kind(), ErrorKind::Limit);
    EXPECT_EQ(caught.faults().front().key, "some.key");
    EXPECT_NE(std::string(caught.what()).find("where objects touch"), std::string::npos);
  }
}

// Bodies in mirror image of each other meet in a plane of a lattice that is laid by it: rounding decides on which side points lie.
TEST(PolygonisePartition, MeetsTheRimInAPlaneOfTheLattice) {
  constexpr double kRadius = 0.5, kApart = 0.44;
  for (const Vec3& beside : {Vec3(0, 0, 0), Vec3(0, 0.0034, 0.0071), Vec3(0, 0.05, -0.025)}) {
    const Vec3 apart(kApart, 0, 0);
    const std::vector<FunctionField> balls{sphere(beside - apart, kRadius), sphere(beside + apart, kRadius)};
    const Lattice lattice{.origin = Vec3::Zero(), .cell = 0.025};
    PolygoniseCounts counts;
    const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice, Executor(1), &counts);
    expect_all_closed(mesh);
    EXPECT_GT(counts.junctions, 0u);
    EXPECT_EQ(counts.junctions_moved, 0u);
    EXPECT_LT(counts.residual, 1e-13);
    // Chords of a tetrahedron are at most sqrt(3) cells long; a chord of the rim, of radius 0.24, leaves it by most.
    const double sagitta = 3.0 * lattice.cell * lattice.cell / (8.0 * std::sqrt(kRadius * kRadius - kApart * kApart));
    for (std::size_t m = 0; m < 2; ++m) {
      const Vec3 axis = m == 0 ? -Vec3::UnitX() : Vec3(Vec3::UnitX());
      for (const auto& t : mesh[m].triangle) {
        const Vec3 c = (mesh[m].position[t[0]] + mesh[m].position[t[1]] + mesh[m].position[t[2]]) / 3.0;
        EXPECT_LT(distance_to_half(c - beside, axis, kApart, kRadius), sagitta) << c.transpose();
      }
    }
  }
}

TEST(PolygonisePartition, VolumesAddUpToTheUnion) {
  // Two balls of radius r at distance D: the lens in both has the volume pi (4 r + D) (2 r - D)^2 / 12.
  const double r = 0.5, D = 0.6, ball = 4.0 / 3.0 * std::numbers::pi * r * r * r;
  const double lens = std::numbers::pi * (4 * r + D) * (2 * r - D) * (2 * r - D) / 12.0;
  const std::vector<FunctionField> balls{sphere({-0.5 * D, 0, 0}, r), sphere({0.5 * D, 0, 0}, r)};
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(std::ldexp(0.05, -k)), Executor(1));
    error[k] = 2.0 * ball - lens - expect_all_closed(mesh);
    EXPECT_NEAR(inspect(mesh[0]).volume, inspect(mesh[1]).volume, 2e-4);
  }
  EXPECT_NEAR(error[0] / error[1], 4.0, 0.5);  // order 2
  EXPECT_LT(std::abs(error[1]), 2e-3);
}

TEST(PolygonisePartition, NormalsAreOppositeInTheContactAndAnalyticOutside) {
  const std::vector<FunctionField> balls{sphere({-0.3, 0.02, 0}, 0.5), sphere({0.25, -0.05, 0.1}, 0.4)};
  const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(0.05), Executor(1));
  for (std::size_t m = 0; m < 2; ++m) {
    for (std::uint32_t v = 0; v < mesh[m].vertex_count(); ++v) {
      const Vec3& p = mesh[m].position[v];
      Vec3 own, other;
      (void)balls[m].function(p, own);
      (void)balls[1 - m].function(p, other);
      const Vec3 outer = -own.normalized(), inner = -(own - other).normalized();
      EXPECT_NEAR(mesh[m].normal[v].norm(), 1.0, 1e-14);
      const bool is_outer = (mesh[m].normal[v] - outer).norm() < 1e-9;
      const bool is_inner = (mesh[m].normal[v] - inner).norm() < 1e-9;
      EXPECT_TRUE(contact_of(mesh[m], v) == 0.0 ? is_outer : is_outer || is_inner);
    }
  }
}

TEST(PolygonisePartition, OfThreeAndFourBallsAroundAPointIsClosed) {
  std::vector<FunctionField> balls;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 3.0;
    balls.push_back(sphere({0.3 * std::cos(angle), 0.3 * std::sin(angle), 0.0}, 0.45));
  }
  for (const double cell : {0.15, 0.08, 0.04}) {
    PolygoniseCounts counts;
    std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(cell), Executor(1), &counts);
    expect_all_closed(mesh);
    EXPECT_GT(counts.junctions, 0u);
    balls.push_back(sphere({0.0, 0.0, 0.35}, 0.4));
    mesh = polygonise_partition(views_of(balls), lattice_of(cell), Executor(1));
    expect_all_closed(mesh);
    for (const Mesh& m : mesh) {
      EXPECT_EQ(inspect(m).euler_characteristic, 2);
      EXPECT_EQ(inspect(m).components, 1u);
    }
    balls.pop_back();
  }
}

TEST(PolygonisePartition, OfManyBallsIsClosedAndFillsTheirUnion) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const std::vector<FunctionField> balls = random_spheres(seed, 8);
    FunctionField all = balls[0];
    for (std::size_t i = 1; i < balls.size(); ++i) all = either(all, balls[i]);
    const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(0.06), Executor(2));
    const double volume = expect_all_closed(mesh);
    const double whole = inspect(polygonise(all, lattice_of(0.06), Executor(1))).volume;
    EXPECT_NEAR(volume, whole, 0.01 * whole);
  }
}

TEST(PolygonisePartition, DoesNotCrossItselfOnCoarseRandomBodies) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const std::vector<Mesh> mesh =
        polygonise_partition(views_of(random_spheres(seed, 6)), lattice_of(0.11), Executor(1));
    expect_all_closed(mesh);
    for (const Mesh& m : mesh) EXPECT_EQ(self_intersections(m, 0.11), 0u) << seed;
  }
}

// Rims of rims: balls of a few cells, between which any labels meet in any tetrahedron, with and without a ground.
TEST(PolygonisePartition, IsClosedAndDoesNotCrossItselfWhereRimsMeet) {
  for (std::uint64_t seed = 139; seed < 163; ++seed) {
    Random random(seed);
    std::vector<FunctionField> balls;
    for (std::uint64_t i = 0; i < 2 + seed % 6; ++i) balls.push_back(sphere(random.in_box(0.4), random.uniform(0.15, 0.5)));
    if (seed % 3 == 0) balls.push_back(below(-0.2));
    const double cell = 0.05 + 0.01 * static_cast<double>(seed % 8);
    PolygoniseCounts counts;
    const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(cell), Executor(1), &counts);
    expect_all_closed(mesh);
    for (const Mesh& m : mesh) EXPECT_EQ(self_intersections(m, cell), 0u) << seed;
    EXPECT_LE(counts.junctions_moved, counts.junctions / 10) << seed;
  }
}

// Where one label lies between three at one end of an edge, and another covers the other end, a wall between the two ends in a triangle.
TEST(PolygonisePartition, ClosesWallsThatEndWhereThreePart) {
  Random random(100105);
  std::vector<FunctionField> balls;
  for (int i = 0; i < 5; ++i) {
    const Vec3 centre = random.in_box(0.4);
    balls.push_back(sphere(centre, random.uniform(0.15, 0.5)));
  }
  const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(0.06), Executor(1));
  expect_all_closed(mesh);
  for (const Mesh& m : mesh) EXPECT_EQ(self_intersections(m, 0.06), 0u);
}

TEST(PolygonisePartition, BodiesApartByLessThanACellKeepTheirOwnSurfaces) {
  constexpr double kCell = 0.05;
  const std::vector<FunctionField> balls{sphere({-0.51, 0.03, 0}, 0.5), sphere({0.5, 0, 0.02}, 0.5)};
  ASSERT_LT(Vec3(1.01, -0.03, 0.02).norm(), 1.0 + 0.3 * kCell);
  PolygoniseCounts counts;
  const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(kCell), Executor(1), &counts);
  EXPECT_GT(counts.gaps, 0u);
  expect_all_closed(mesh);
  for (std::size_t m = 0; m < 2; ++m) {
    EXPECT_EQ(self_intersections(mesh[m], kCell), 0u);
    for (std::uint32_t v = 0; v < mesh[m].vertex_count(); ++v) {
      const Vec3& p = mesh[m].position[v];
      EXPECT_LT(std::abs(FieldView(balls[m]).value(p)), 1e-12);
      EXPECT_EQ(contact_of(mesh[m], v), 0.0);
      Vec3 gradient;
      (void)balls[m].function(p, gradient);
      EXPECT_LT((mesh[m].normal[v] + gradient.normalized()).norm(), 1e-9);
    }
  }
}

TEST(PolygonisePartition, GivesTiesToTheLowerIndex) {
  const std::vector<FunctionField> twins{sphere(Vec3::Zero(), 0.5), sphere(Vec3::Zero(), 0.5)};
  const std::vector<Mesh> mesh = polygonise_partition(views_of(twins), lattice_of(0.1), Executor(1));
  EXPECT_GT(mesh[0].triangle_count(), 0u);
  EXPECT_EQ(mesh[1].triangle_count(), 0u);
  expect_all_closed(mesh);
}

TEST(PolygonisePartition, IsClosedWhenFieldsAgreeExactlyAtNodes) {
  // The contact plane x = 0 and the rim's plane hold nodes, where F_a - F_b is exactly zero.
  const std::vector<FunctionField> balls{sphere({-0.375, 0, 0}, 0.625), sphere({0.375, 0, 0}, 0.625)};
  ASSERT_EQ(FieldView(balls[0]).value({0, 0.5, 0}), 0.0);
  ASSERT_EQ(FieldView(balls[1]).value({0, 0.5, 0}), 0.0);
  const std::vector<Mesh> mesh =
      polygonise_partition(views_of(balls), {.origin = Vec3::Zero(), .cell = 0.125}, Executor(1));
  expect_all_closed(mesh);
  EXPECT_EQ(contact_triangles(mesh[0], 1, false), contact_triangles(mesh[1], 0, true));
  EXPECT_GT(contact_triangles(mesh[0], 1, false).size(), 0u);
}

TEST(PolygonisePartition, AGroundShapesTheOthersAndHasNoMesh) {
  const FunctionField ball = sphere({0, 0, 0.3}, 0.5), ground = below(0.0);
  const std::vector<FieldView> fields{ball, ground};
  const std::vector<Mesh> mesh = polygonise_partition(fields, lattice_of(0.05), Executor(1));
  expect_all_closed(mesh);
  EXPECT_EQ(mesh[1].vertex_count(), 0u);
  std::size_t touching = 0;
  for (std::uint32_t v = 0; v < mesh[0].vertex_count(); ++v) {
    const Vec3& p = mesh[0].position[v];
    if (contact_of(mesh[0], v) == 0.0) continue;
    ++touching;
    EXPECT_EQ(contact_of(mesh[0], v), 2.0);
    EXPECT_NEAR(fields[0].value(p), fields[1].value(p), 1e-12);
  }
  EXPECT_GT(touching, 20u);
  EXPECT_THROW((void)polygonise_partition({fields.data() + 1, 1}, lattice_of(0.05), Executor(1)), Error);
}

TEST(PolygonisePartition, DoesNotDependOnThreadsOrOnWhatBoundsSkip) {
  std::vector<FunctionField> balls = random_spheres(3, 7);
  PolygoniseCounts counts, all;
  const std::uint64_t expected =
      hash_of(polygonise_partition(views_of(balls), lattice_of(0.03), Executor(1), &counts));
  for (const int threads : {2, 3, 8}) {
    EXPECT_EQ(hash_of(polygonise_partition(views_of(balls), lattice_of(0.03), Executor(threads))), expected);
  }
  for (FunctionField& ball : balls) ball.bounds_everything = true;
  EXPECT_EQ(hash_of(polygonise_partition(views_of(balls), lattice_of(0.03), Executor(1), &all)), expected);
  EXPECT_LT(counts.blocks_visited, all.blocks_visited);
  EXPECT_LT(counts.nodes, all.nodes);
}

TEST(PolygonisePartition, OfBodiesApartIsTheirOwnMeshes) {
  const std::vector<FunctionField> balls{sphere({-0.6, 0, 0}, 0.4), sphere({0.6, 0, 0}, 0.4)};
  const std::vector<Mesh> mesh = polygonise_partition(views_of(balls), lattice_of(0.05), Executor(1));
  for (std::size_t m = 0; m < 2; ++m) {
    Mesh own = mesh[m];
    own.columns.clear();
    EXPECT_EQ(hash_of(own), hash_of(polygonise(balls[m], lattice_of(0.05), Executor(1))));
  }
}

TEST(PolygonisePartition, OfNothingIsEmpty) {
  EXPECT_TRUE(polygonise_partition({}, lattice_of(0.1), Executor(1)).empty());
}

// Newton's method doubles the digits that are right: from the middle of a segment six steps reach round-off where values bend little.
TEST(RootBetween, TakesFewValuesFromWhicheverSideItComes) {
  std::size_t values = 0;
  const auto counted = [&values](FunctionField field) {
    field.function = [&values, inner = field.function](const Vec3& p, Vec3& gradient) {
      ++values;
      return inner(p, gradient);
    };
    return field;
  };
  // F = 1/r^2 - |x - c|^2 / r^4 bends along the way, up or down by whose it is.
  const auto bent = [](const Vec3& centre, double radius) {
    FunctionField field = sphere(centre, radius);
    field.function = [=](const Vec3& p, Vec3& gradient) {
      const Vec3 d = p - centre;
      gradient = -2.0 / std::pow(radius, 4) * d;
      return 1.0 / (radius * radius) - d.squaredNorm() / std::pow(radius, 4);
    };
    return field;
  };
  const std::array bodies{counted(bent(Vec3(-0.4, 0, 0), 0.5)), counted(bent(Vec3(0.45, 0.1, 0), 0.6))};
  const std::array<FieldView, 2> fields{bodies[0], bodies[1]};
  std::size_t roots = 0;
  for (int k = 0; k < 200; ++k) {
    const Vec3 aside = 0.1 * Vec3(0, std::sin(1.7 * k), std::cos(2.3 * k));
    const Vec3 a = Vec3(-0.2, 0, 0) + aside, b = Vec3(0.2 + 0.001 * k, 0.05, 0.02) - aside;
    const lattice::Junction root = lattice::root_between(fields, 1, 2, a, b, 10.0);
    const lattice::Junction own = lattice::root_between(fields, 1, 0, a, Vec3(0.3, 0.2, 0) + aside, 10.0);
    EXPECT_LT(root.residual, 1e-11);
    EXPECT_LT(own.residual, 1e-11);
    roots += 2;
  }
  EXPECT_LT(values, 14 * roots);  // of two fields for one, of one for the other: seven steps and the start
}

}  // namespace
}  // namespace supple::implicit
