#include "supple/implicit/polygonise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/range_of_surface.h"
#include "mesh/partition/polygonise_lattice.h"

namespace supple::implicit {
namespace {

using namespace testing;

// Wyvill 1986: a point with R = 1 and iso 1/2 has its surface at 0.454202019 (checks on a closed mesh).
TEST(Polygonise, MeetsAreaAndVolumeOfTheWyvillSphereWithOrderTwo) {
  constexpr double kRadius = 0.454202019, kArea = 2.592435660, kVolume = 0.392496505;
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const Executor executor(1);
  std::array<double, 3> area_error{}, volume_error{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double cell = std::ldexp(0.08, -static_cast<int>(k));
    PolygoniseCounts counts;
    const Mesh mesh = polygonise(body.field, lattice_of(cell), executor, &counts);
    const MeshReport report = expect_closed(mesh);
    EXPECT_EQ(report.euler_characteristic, 2);
    for (const Vec3& p : mesh.position) {
      ASSERT_LT(std::abs(FieldView(body.field).value(p)), 1e-12);
      ASSERT_NEAR(p.norm(), kRadius, 1e-9);  // the radius is given to nine digits
    }
    EXPECT_LT(counts.residual, 1e-12);
    area_error[k] = kArea - report.area;
    volume_error[k] = kVolume - report.volume;
    // A facet with vertices on the sphere lies less than rho^2 / (2 R) inside it, rho <= sqrt(3)/2 cell because all its
    // vertices are in one cell.
    EXPECT_GT(volume_error[k], 0.0);
    EXPECT_LT(volume_error[k], kArea * 0.75 * cell * cell / (2.0 * kRadius));
  }
  for (std::size_t k = 0; k < 2; ++k) {  // 4 for order 2; how the lattice lies on the sphere moves it a little
    EXPECT_NEAR(area_error[k] / area_error[k + 1], 4.0, 0.3);
    EXPECT_NEAR(volume_error[k] / volume_error[k + 1], 4.0, 0.3);
  }
}

// Two Wyvill points, R = 1: one surface up to D = 1.216617401.
TEST(Polygonise, FindsOneBodyBelowTheMergingDistanceAndTwoAbove) {
  const auto components = [](double D) {
    const Body body = body_of({{wyvill_point(1.0), Vec3(-0.5 * D, 0, 0)}, {wyvill_point(1.0), Vec3(0.5 * D, 0, 0)}});
    return expect_closed(polygonise(body.field, lattice_of(0.02), Executor(2))).components;
  };
  EXPECT_EQ(components(1.21), 1u);
  EXPECT_EQ(components(1.22), 2u);
}

TEST(Polygonise, HasTheTopologyOfItsSurface) {
  const Executor executor(1);
  const auto report = [&](const FunctionField& field) { return expect_closed(polygonise(field, lattice_of(0.05), executor)); };
  const MeshReport ball = report(sphere(Vec3::Zero(), 0.5));
  EXPECT_EQ(ball.euler_characteristic, 2);
  EXPECT_EQ(ball.components, 1u);
  const MeshReport ring = report(torus(0.5, 0.2));
  EXPECT_EQ(ring.euler_characteristic, 0);
  EXPECT_EQ(ring.components, 1u);
  EXPECT_NEAR(ring.volume, 2.0 * std::numbers::pi * std::numbers::pi * 0.5 * 0.04, 0.02);
  const MeshReport two = report(either(sphere({-0.6, 0, 0}, 0.4), torus(0.5, 0.2)));
  EXPECT_EQ(two.components, 1u);
  const MeshReport apart = report(either(sphere({-0.6, 0, 0}, 0.4), sphere({0.6, 0, 0}, 0.4)));
  EXPECT_EQ(apart.euler_characteristic, 4);
  EXPECT_EQ(apart.components, 2u);
  FunctionField shell = sphere(Vec3::Zero(), 0.6);  // a hollow ball: two surfaces, facing away from the shell
  shell.function = [](const Vec3& p, Vec3& gradient) {
    const double n = p.norm();
    gradient = n > 0.5 ? Vec3(-p / n) : n > 0.0 ? Vec3(p / n) : Vec3::Zero();
    return 0.1 - std::abs(n - 0.5);
  };
  const MeshReport hollow = report(shell);
  EXPECT_EQ(hollow.components, 2u);
  EXPECT_NEAR(hollow.volume, 4.0 / 3.0 * std::numbers::pi * (0.216 - 0.064), 0.02);
}

TEST(Polygonise, StaysClosedWhereTheSurfaceIsRougherThanTheLattice) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    for (const double cell : {0.07, 0.11}) {
      PolygoniseCounts counts;
      const Mesh mesh = polygonise(noise(seed, 0.15), lattice_of(cell), Executor(1), &counts);
      const MeshReport report = expect_closed(mesh);
      EXPECT_EQ(report.euler_characteristic % 2, 0);
      EXPECT_GT(mesh.triangle_count(), 1000u);
      // Values reach about 12, and a root's tolerance is 1e-13 of the largest in its block.
      EXPECT_LT(counts.residual, 3e-12);
      EXPECT_EQ(self_intersections(mesh, cell), 0u);
    }
  }
}

TEST(Polygonise, IsClosedOnRandomBodiesOfAllShapesAndKernels) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Body body = random_body({.seed = seed, .parts = 30});
    PolygoniseCounts counts;
    const Mesh mesh = polygonise(body.field, lattice_of(0.06), Executor(2), &counts);
    const MeshReport report = expect_closed(mesh);
    EXPECT_EQ(report.euler_characteristic % 2, 0);
    EXPECT_GT(report.volume, 0.0);
    EXPECT_LT(counts.residual, 1e-12 * 30);  // values up to 30 x 1
  }
}

TEST(Polygonise, KeepsVerticesOnTheEdgesOfItsTetrahedra) {
  constexpr double kCell = 0.07;
  const Mesh mesh = polygonise(torus(0.5, 0.2), lattice_of(kCell), Executor(1));
  for (const Vec3& p : mesh.position) {
    // On an edge, the lattice coordinates have one common fraction t where they move and are whole elsewhere.
    const Vec3 at = (p - kOffset) / kCell;
    double t = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double fraction = at[k] - std::floor(at[k]);
      if (std::min(fraction, 1.0 - fraction) < 1e-12) continue;
      if (t == 0.0) t = fraction;
      EXPECT_NEAR(fraction, t, 1e-12) << at.transpose();
    }
  }
}

TEST(Polygonise, GivesAnalyticOutwardNormals) {
  const FunctionField ring = torus(0.5, 0.2);
  const Mesh mesh = polygonise(ring, lattice_of(0.04), Executor(1));
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    Vec3 gradient;
    (void)ring.function(mesh.position[i], gradient);
    EXPECT_LT((mesh.normal[i] + gradient.normalized()).norm(), 1e-14);
  }
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    const Vec3 facet = (b - a).cross(c - a);
    // A facet turns by at most about cell / smallest radius = 0.2 from its vertices' normals, unless it is a sliver.
    if (facet.norm() < 1e-3 * 0.04 * 0.04) continue;
    EXPECT_GT(facet.normalized().dot(mesh.normal[t[0]]), 0.5);
  }
}

TEST(Polygonise, IsClosedWhenTheSurfacePassesThroughNodes) {
  const Executor executor(1);
  // |(3, 4, 0)| / 8 = 5 / 8 in exact binary arithmetic: nodes at distance r have F = 0 exactly, and count as outside.
  const FunctionField ball = sphere(Vec3::Zero(), 0.625);
  ASSERT_EQ(FieldView(ball).value({0.375, 0.5, 0.0}), 0.0);
  const MeshReport report = expect_closed(polygonise(ball, {.origin = Vec3::Zero(), .cell = 0.125}, executor));
  EXPECT_EQ(report.euler_characteristic, 2);
  // A cube whose faces are planes of nodes: 0 on all of them, inside only beyond the first layer.
  FunctionField cube{.function =
                         [](const Vec3& p, Vec3& gradient) {
                           int axis = 0;
                           const double largest = p.cwiseAbs().maxCoeff(&axis);
                           gradient = Vec3::Zero();
                           gradient[axis] = p[axis] > 0.0 ? -1.0 : 1.0;
                           return 0.5 - largest;
                         },
                     .lipschitz = 1.0,
                     .box = Box{Vec3::Constant(-0.5), Vec3::Constant(0.5)}};
  const Mesh mesh = polygonise(cube, {.origin = Vec3::Zero(), .cell = 0.125}, executor);
  const MeshReport cube_report = expect_closed(mesh);
  EXPECT_EQ(cube_report.euler_characteristic, 2);
  EXPECT_GT(cube_report.volume, 0.9);  // the lattice bevels edges and corners by a cell
  EXPECT_LT(cube_report.volume, 0.99);
  for (const Vec3& p : mesh.position) EXPECT_NEAR(p.cwiseAbs().maxCoeff(), 0.5, 1e-15);
}

TEST(Polygonise, SurvivesAFieldWithoutGradient) {
  FunctionField steps = sphere(Vec3::Zero(), 0.5);  // a jump: no root, no gradient anywhere
  steps.function = [](const Vec3& p, Vec3& gradient) {
    gradient = Vec3::Zero();
    return p.norm() < 0.5 ? 1.0 : -1.0;
  };
  steps.bounds_everything = true;
  const Mesh mesh = polygonise(steps, lattice_of(0.1), Executor(1));
  expect_closed(mesh);
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR(mesh.position[i].norm(), 0.5, 1e-12);  // bisected to the jump
    EXPECT_NEAR(mesh.normal[i].norm(), 1.0, 1e-14);
    EXPECT_GT(mesh.normal[i].dot(mesh.position[i]), 0.0);
  }
}

TEST(Polygonise, DoesNotDependOnThreadsOrOnWhatBoundsSkip) {
  const Body body = random_body({.seed = 5, .parts = 40});
  PolygoniseCounts counts;
  const std::uint64_t expected = hash_of(polygonise(body.field, lattice_of(0.05), Executor(1), &counts));
  for (const int threads : {2, 3, 8}) {
    EXPECT_EQ(hash_of(polygonise(body.field, lattice_of(0.05), Executor(threads))), expected) << threads;
  }
  FunctionField everything;
  everything.function = [&](const Vec3& p, Vec3& gradient) { return FieldView(body.field).value(p, gradient); };
  everything.box = body.field.surface_box();
  everything.bounds_everything = true;
  PolygoniseCounts all;
  EXPECT_EQ(hash_of(polygonise(everything, lattice_of(0.05), Executor(1), &all)), expected);
  // All that the surface box reaches, and of those that only its margin of a cell reaches as many as rounding leaves.
  const double side = 8.0 * 0.05, round_off = 1e-9;
  std::uint64_t reached = 1;
  for (int k = 0; k < 3; ++k) {
    const double first = std::floor((everything.box.lower[k] + round_off - kOffset[k]) / side);
    const double last = std::floor((everything.box.upper[k] - round_off - kOffset[k]) / side);
    reached *= static_cast<std::uint64_t>(last - first) + 1;
  }
  EXPECT_GE(all.blocks_visited, reached);
  EXPECT_LE(all.blocks_visited, all.blocks_present);
  EXPECT_GT(reached, counts.blocks_visited);
  EXPECT_EQ(all.blocks_present, counts.blocks_present);
  EXPECT_LT(counts.blocks_visited, counts.blocks_present);
  EXPECT_EQ(counts.nodes, 729 * counts.blocks_visited);
}

TEST(Polygonise, KeepsItsShapeAtAnyScale) {
  const Executor executor(1);
  const auto count = [&](double scale) {
    const Body body = body_of({{wyvill_point(scale), Vec3::Zero()}, {wyvill_point(scale), Vec3(0.7 * scale, 0, 0)}});
    PolygoniseCounts counts;
    const Mesh mesh =
        polygonise(body.field, {.origin = scale * kOffset, .cell = 0.0625 * scale}, executor, &counts);
    expect_closed(mesh);
    EXPECT_LT(counts.residual, 1e-12);
    return std::pair(mesh.vertex_count(), mesh.triangle_count());
  };
  const auto expected = count(1.0);
  for (const double scale : {0x1p-10, 0x1p10}) EXPECT_EQ(count(scale), expected) << scale;
}

TEST(Polygonise, GivesAnEmptyMeshWithoutSurface) {
  FunctionField none = sphere(Vec3::Zero(), 0.5);
  none.box = Box{};
  EXPECT_EQ(polygonise(none, lattice_of(0.1), Executor(1)).vertex_count(), 0u);
  // Smaller than a cell and between the nodes: not seen, and no failure either.
  const Mesh mesh = polygonise(sphere(kOffset + Vec3(0.3, 0.3, 0.3), 0.1), lattice_of(1.0), Executor(1));
  EXPECT_EQ(mesh.triangle_count(), 0u);
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

TEST(Polygonise, RefusesWhatWouldNotEndWithAMessageThatNamesTheCell) {
  const Executor executor(1);
  const FunctionField ball = sphere(Vec3::Zero(), 0.5);
  expect_message([&] { (void)polygonise(ball, lattice_of(1e-6), executor); }, ErrorKind::Limit,
                 {"lattice.cell", "250000 blocks", "1e-06 m", "use cells of at least"});
  expect_message([&] { (void)polygonise(ball, lattice_of(1e-12), executor); }, ErrorKind::Limit,
                 {"lattice.cell", "node numbers", "use cells of at least"});
  expect_message([&] { (void)polygonise(below(0.0), lattice_of(0.1), executor); }, ErrorKind::Usage,
                 {"bounded box", "extends to infinity"});
  EXPECT_THROW((void)polygonise(ball, lattice_of(0.0), executor), ContractViolation);
  EXPECT_THROW((void)polygonise(ball, lattice_of(std::nan("")), executor), ContractViolation);
}

TEST(Polygonise, TheCellThatARefusalNamesFits) {
  const FunctionField ball = sphere(Vec3::Zero(), 0.5);
  const auto looked_at = [&](double cell) { return find_surface_blocks(ball, lattice_of(cell), Executor(1), 3000); };
  try {
    (void)looked_at(0.001);
    FAIL() << "no error";
  } catch (const Error& error) {
    const std::string hint = error.faults().front().hint;
    EXPECT_NO_THROW((void)looked_at(std::stod(hint.substr(hint.find_first_of("0123456789"))))) << hint;
  }
}

/// A ball whose bounds deny it on one side.
struct HidingBall : FunctionField {
  HidingBall() : FunctionField(sphere(Vec3::Zero(), 0.5)) {}
  [[nodiscard]] Interval bound(const Box& b) const {
    return b.lower.x() > 0.1 ? Interval{-1.0, -0.5} : FunctionField::bound(b);
  }
};

TEST(Polygonise, ReportsBoundsThatHideTheSurfaceInsteadOfLeavingAHole) {
  const HidingBall ball;
  expect_message([&] { (void)polygonise(ball, lattice_of(0.03), Executor(1)); }, ErrorKind::Internal,
                 {"surface in block", "bounds exclude"});
  const std::vector<FieldView> views{ball, ball};
  expect_message([&] { (void)polygonise_partition(views, lattice_of(0.03), Executor(1)); }, ErrorKind::Internal,
                 {"surface in block", "bounds exclude"});
}

TEST(SurfaceBlocks, LieInTheRangeThatIsFoundWithoutThem) {
  const auto expect_range = [](const FieldView& field, double cell, const std::string& name) {
    const auto blocks = find_surface_blocks(field, lattice_of(cell), Executor(2), 1'000'000);
    ASSERT_FALSE(blocks.empty()) << name;
    std::array<std::int32_t, 3> lower = blocks[0], upper = blocks[0];
    for (const auto& block : blocks) {
      for (std::size_t k = 0; k < 3; ++k) {
        lower[k] = std::min(lower[k], block[k]);
        upper[k] = std::max(upper[k], block[k]);
      }
    }
    const std::optional<lattice::BlockRange> range = lattice::range_of_surface(field, lattice_of(cell));
    ASSERT_TRUE(range) << name;
    EXPECT_EQ(range->lower, lower) << name;
    EXPECT_EQ(range->upper, upper) << name;
  };
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Body body = random_body({.seed = seed, .parts = 12});
    expect_range(body.field, 0.01 + 0.004 * seed, "body " + std::to_string(seed));
  }
  const FunctionField small = sphere(Vec3(0.31, -0.7, 0.2), 1e-3);
  expect_range(small, 0.05, "smaller than a cell");
}

TEST(SurfaceBlocks, HoldEverySignChangeAndComeInOrder) {
  const Body body = random_body({.seed = 9, .parts = 20});
  const double cell = 0.05;
  PolygoniseCounts counts;
  const auto blocks = find_surface_blocks(body.field, lattice_of(cell), Executor(2), 1'000'000, &counts);
  EXPECT_EQ(counts.blocks_visited, blocks.size());
  EXPECT_TRUE(std::is_sorted(blocks.begin(), blocks.end(), [](const auto& a, const auto& b) {
    return std::array{a[2], a[1], a[0]} < std::array{b[2], b[1], b[0]};
  }));
  const Mesh mesh = polygonise(body.field, lattice_of(cell), Executor(1));
  for (const Vec3& p : mesh.position) {
    const Vec3 at = ((p - kOffset) / (8.0 * cell)).array().floor();
    const std::array block{static_cast<std::int32_t>(at.x()), static_cast<std::int32_t>(at.y()),
                           static_cast<std::int32_t>(at.z())};
    EXPECT_TRUE(std::find(blocks.begin(), blocks.end(), block) != blocks.end());
  }
}

// So many that the levels above them are refined in parts: block by block, each is kept with the bodies that can be the largest in it.
TEST(SurfaceBlocks, OfManyAreThoseThatBoundsLeaveOneByOne) {
  const FunctionField left = sphere(Vec3(-0.3, 0.0, 0.0), 0.4), right = sphere(Vec3(0.25, 0.1, 0.0), 0.3);
  const std::vector<FieldView> fields{left, right};
  const std::vector<Box> surface{left.box, right.box};
  const Lattice cells = lattice_of(0.00125);
  PolygoniseCounts counts;
  const lattice::BlockList list = lattice::find_label_blocks(fields, surface, cells, Executor(2), 1'000'000, counts);
  ASSERT_GT(list.block.size(), 40'000u);  // a level above has more than 8,192
  std::size_t at = 0;
  const auto range = lattice::block_range(left.box.united(right.box), cells, 1);
  for (std::int32_t z = range.lower[2]; z <= range.upper[2]; ++z) {
    for (std::int32_t y = range.lower[1]; y <= range.upper[1]; ++y) {
      for (std::int32_t x = range.lower[0]; x <= range.upper[0]; ++x) {
        const Box box{lattice::node_position(cells, 8 * x, 8 * y, 8 * z), lattice::node_position(cells, 8 * x + 8, 8 * y + 8, 8 * z + 8)};
        std::vector<std::uint32_t> can;
        double most_lower = 0.0;
        for (std::uint32_t k = 0; k < 2; ++k) {
          if (surface[k].overlaps(box) && fields[k].bound(box).upper > 0.0) can.push_back(k);
          if (!can.empty() && can.back() == k) most_lower = std::max(most_lower, fields[k].bound(box).lower);
        }
        std::erase_if(can, [&](std::uint32_t k) { return fields[k].bound(box).upper < most_lower; });
        if (can.empty() || (can.size() == 1 && fields[can[0]].bound(box).lower > 0.0)) continue;
        ASSERT_LT(at, list.block.size());
        ASSERT_EQ(list.block[at], (lattice::BlockCoord{x, y, z}));
        ASSERT_TRUE(std::equal(can.begin(), can.end(), list.candidate.begin() + list.offset[at], list.candidate.begin() + list.offset[at + 1]));
        ++at;
      }
    }
  }
  EXPECT_EQ(at, list.block.size());
}

}  // namespace
}  // namespace supple::implicit
