#include "supple/implicit/surface_grid.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "supple/core/hash.h"
#include "supple/core/mesh.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/mesh_routes.h"
#include "support/temp_folder.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr double kCell = 0.05;
constexpr float kFloatEps = 6e-8F;  // rounding of a value below 1 to float
const Vec3 kOrigin(0.0125, -0.25, 0.375);

GridOptions options_of(GridContent content) {
  return {.lattice = {.origin = kOrigin, .cell = kCell}, .content = content, .half_width = 3.0, .name = "ball"};
}

Vec3 node(int i, int j, int k) { return kOrigin + kCell * Vec3(i, j, k); }

/// A folder of this test program, removed at the end.
class Folder {
 public:
  Folder() : path_(temp_folder() / "grid") {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

template <class Act>
void expect_error(const Act& act, ErrorKind kind, const std::string& word) {
  try {
    act();
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << word << " in: " << error.what();
  }
}

TEST(SurfaceGrid, HoldsTheDistanceInTheBandAndTheSideBeyond) {
  const FunctionField ball = sphere(kOrigin + Vec3(0.1, 0.2, 0.3), 0.6131);
  const SurfaceGrid grid = make_surface_grid(ball, options_of(GridContent::SignedDistance), Executor(2));
  const double band = 3.0 * kCell;
  std::uint64_t in_band = 0;
  for (int k = -16; k < 28; ++k) {
    for (int j = -16; j < 28; ++j) {
      for (int i = -16; i < 28; ++i) {
        const double distance = -FieldView(ball).value(node(i, j, k));
        const double expected = std::clamp(distance, -band, band);
        ASSERT_NEAR(grid.value(i, j, k), expected, kFloatEps) << i << ' ' << j << ' ' << k;
        in_band += std::abs(distance) <= band ? 1u : 0u;
      }
    }
  }
  EXPECT_EQ(grid.active_voxels(), in_band);
  EXPECT_LT(grid.value(2, 4, 6), 0.0);        // the centre
  EXPECT_GT(grid.value(1000, 0, 0), 0.0);     // far away
}

TEST(SurfaceGrid, OfTheFieldHoldsFWithItsSign) {
  const Body body = body_of({{wyvill_point(1.0), kOrigin}});
  const SurfaceGrid grid = make_surface_grid(body.field, options_of(GridContent::Field), Executor(1));
  std::uint64_t in_band = 0;
  for (int k = -24; k < 24; ++k) {
    for (int j = -24; j < 24; ++j) {
      for (int i = -24; i < 24; ++i) {
        Vec3 gradient;
        const double f = FieldView(body.field).value(node(i, j, k), gradient);
        const double value = grid.value(i, j, k);
        if (std::abs(f) <= 3.0 * kCell * gradient.norm()) {
          ++in_band;
          ASSERT_NEAR(value, f, kFloatEps);
        } else {
          ASSERT_EQ(value > 0.0, f > 0.0) << i << ' ' << j << ' ' << k;
        }
      }
    }
  }
  EXPECT_EQ(grid.active_voxels(), in_band);
}

TEST(SurfaceGrid, DistanceOfAFieldIsRightToFirstOrder) {
  const Body body = body_of({{wyvill_point(1.0), kOrigin}});
  const SurfaceGrid grid = make_surface_grid(body.field, options_of(GridContent::SignedDistance), Executor(1));
  constexpr double kRadius = 0.454202019;
  int near = 0;
  for (int k = -12; k <= 12; ++k) {
    for (int j = -12; j <= 12; ++j) {
      for (int i = -12; i <= 12; ++i) {
        const double distance = kCell * Vec3(i, j, k).norm() - kRadius;
        if (std::abs(distance) > kCell) continue;
        ++near;
        // -F/F' errs by |F''/2F'| d^2 + O(d^3), and |F''/F'| is below 3 within a cell of the surface.
        EXPECT_NEAR(grid.value(i, j, k), distance, 2.0 * distance * distance + 1e-7);
      }
    }
  }
  EXPECT_GT(near, 500);
}

TEST(SurfaceGrid, InterpolatesTheDistanceToSecondOrder) {
  const FunctionField ball = sphere(Vec3::Zero(), 0.6);
  const SurfaceGrid grid = make_surface_grid(ball, options_of(GridContent::SignedDistance), Executor(1));
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = 0.6 * random.direction();
    // Trilinear interpolation errs by at most 3/8 cell^2 times the largest second derivative, 1 / r with r >= 0.5.
    EXPECT_LT(std::abs(grid.interpolate(p)), 0.375 * kCell * kCell / 0.5 + kFloatEps);
  }
  EXPECT_NEAR(grid.interpolate(node(3, 4, 5)), grid.value(3, 4, 5), 1e-12);
}

TEST(SurfaceGrid, IsReadByPlainOpenVdbAsWritten) {
  const Folder folder;
  const auto path = folder / "ball.vdb";
  const FunctionField ball = sphere(kOrigin, 0.6);
  std::vector<SurfaceGrid> grids;
  grids.push_back(make_surface_grid(ball, options_of(GridContent::SignedDistance), Executor(1)));
  GridOptions field_options = options_of(GridContent::Field);
  field_options.name = "potential";
  grids.push_back(make_surface_grid(ball, field_options, Executor(1)));
  write_grids(path, grids);

  openvdb::initialize();
  openvdb::io::File file(path.string());
  file.open();
  ASSERT_TRUE(file.hasGrid("ball") && file.hasGrid("potential"));
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("ball"));
  ASSERT_TRUE(grid);
  EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_EQ(grid->metaValue<std::string>("units"), "m");
  EXPECT_EQ(grid->metaValue<std::string>("up_axis"), "z");
  EXPECT_EQ(grid->activeVoxelCount(), grids[0].active_voxels());
  EXPECT_NEAR(grid->background(), 3.0 * kCell, kFloatEps);
  const openvdb::Vec3d world = grid->indexToWorld(openvdb::Vec3d(3, -2, 7));
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(world[axis], node(3, -2, 7)[axis], 1e-15);
  for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel) {
    const openvdb::Coord at = voxel.getCoord();
    ASSERT_NEAR(*voxel, -FieldView(ball).value(node(at.x(), at.y(), at.z())), kFloatEps);
  }
  EXPECT_EQ(grid->tree().getValue({0, 0, 0}), -grid->background());
  EXPECT_EQ(grid->tree().getValue({99, 0, 0}), grid->background());
  const auto potential = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("potential"));
  EXPECT_EQ(potential->getGridClass(), openvdb::GRID_UNKNOWN);
  EXPECT_GT(potential->tree().getValue({0, 0, 0}), 0.0F);

  EXPECT_EQ(grid->metaValue<std::string>("content_hash"), to_hex(grids[0].hash()));
  EXPECT_EQ(grid->tree().getValue({5, 6, 7}), grids[0].value(5, 6, 7));
}

TEST(SurfaceGrid, DoesNotDependOnThreads) {
  const Body body = random_body({.seed = 3, .parts = 25});
  const auto hash = [&](int threads) {
    return make_surface_grid(body.field, options_of(GridContent::SignedDistance), Executor(threads)).hash();
  };
  const std::uint64_t expected = hash(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(hash(threads), expected);
}

std::string bytes_of(const Folder& folder, const SurfaceGrid& grid) {
  const SurfaceGrid* const one[] = {&grid};
  write_grids(folder / "bytes.vdb", one);
  std::ifstream file(folder / "bytes.vdb", std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Hash of a file without the random number that OpenVDB puts into its head, after four numbers and a flag.
std::uint64_t content_of(std::string bytes) {
  constexpr std::size_t kBegin = 21, kLength = 36;
  bytes.erase(kBegin, kLength);
  return hash_bytes(std::as_bytes(std::span<const char>(bytes)));
}

TEST(GridUpdater, HasTheTreeOfAWholeGridWhateverMoved) {
  const Folder folder;
  for (const GridContent content : {GridContent::SignedDistance, GridContent::Field}) {
    Body body = random_body({.seed = 8, .parts = 60, .half_width = 2.0, .every_shape = true});
    const GridOptions options = options_of(content);
    GridUpdater updater;
    Random random(9);
    int kept = 0;
    for (int step = 0; step < 8; ++step) {
      if (step % 4 != 3) {  // one part moves, or a kernel grows, or nothing happens
        body.parts[random.below(60)].position += random.in_box(step % 2 == 0 ? 0.2 : 1.5);
      } else if (step == 7) {
        body.skeleton.primitive[3].kernel = Kernel::wyvill(0.9 * body.skeleton.primitive[3].kernel.radius);
      }
      body.place();
      GridCounts counts;
      const SurfaceGrid& grid = updater.make(body.field, options, Executor(2), &counts);
      const SurfaceGrid whole = make_surface_grid(body.field, options, Executor(1));
      ASSERT_EQ(grid.hash(), whole.hash()) << step;
      ASSERT_EQ(content_of(bytes_of(folder, grid)), content_of(bytes_of(folder, whole))) << step;
      kept += counts.whole ? 0 : 1;
    }
    EXPECT_GE(kept, 5);
  }
}

TEST(GridUpdater, FollowsASurfaceThatGrowsAndShrinks) {
  const Folder folder;
  const GridOptions options = options_of(GridContent::SignedDistance);
  Body body = random_body({.seed = 8, .parts = 200, .half_width = 3.0, .only_points = true});
  GridUpdater updater;
  for (const double x : {3.2, 3.5, 3.9, 3.3, 3.0}) {
    body.parts[7].position = Vec3(x, 0.3, -0.2);
    body.place();
    GridCounts counts;
    const SurfaceGrid& grid = updater.make(body.field, options, Executor(1), &counts);
    EXPECT_EQ(counts.whole, x == 3.2) << x;
    EXPECT_EQ(content_of(bytes_of(folder, grid)), content_of(bytes_of(folder, make_surface_grid(body.field, options, Executor(1))))) << x;
  }
}

TEST(GridUpdater, HasTheLargestValueOfAllBeyondTheBandWhicheverMoves) {
  const GridOptions options = options_of(GridContent::Field);
  Body body = random_body({.seed = 8, .parts = 60, .half_width = 2.0, .only_points = true});
  GridUpdater updater;
  int others = 0;
  double last = 0.0;
  for (std::size_t part = 0; part < 60; ++part) {
    body.parts[part].position.x() += 0.05;
    body.place();
    GridCounts counts;
    const SurfaceGrid& grid = updater.make(body.field, options, Executor(1), &counts);
    const SurfaceGrid whole = make_surface_grid(body.field, options, Executor(1));
    EXPECT_EQ(counts.whole, part == 0);
    const double beyond = grid.value(1000, 1000, 1000);
    ASSERT_EQ(beyond, whole.value(1000, 1000, 1000)) << part;
    ASSERT_EQ(grid.hash(), whole.hash()) << part;
    others += part > 0 && beyond != last ? 1 : 0;
    last = beyond;
  }
  EXPECT_GE(others, 1);
}

TEST(GridUpdater, TouchesOnlyLeavesThatAMovedPrimitiveReaches) {
  Body body = random_body({.seed = 8, .parts = 200, .half_width = 3.0, .only_points = true});
  GridUpdater updater;
  GridCounts counts;
  const GridOptions options = options_of(GridContent::SignedDistance);
  (void)updater.make(body.field, options, Executor(1), &counts);
  EXPECT_TRUE(counts.whole);
  const std::uint64_t all = counts.leaves_sampled;
  (void)updater.make(body.field, options, Executor(1), &counts);
  EXPECT_EQ(counts.leaves_looked_at, 0u);
  body.parts[7].position.x() += 0.01;
  body.place();
  (void)updater.make(body.field, options, Executor(1), &counts);
  EXPECT_FALSE(counts.whole);
  EXPECT_GT(counts.leaves_sampled, 0u);
  // A support of at most 0.6 m spans at most 5 leaves of 0.4 m along an axis.
  EXPECT_LE(counts.leaves_looked_at, 125u);
  EXPECT_LT(10 * counts.leaves_sampled, all);
}

TEST(GridUpdater, MakesEverythingAnewForAnotherIsoBlendOrOptions) {
  Body body = random_body({.seed = 8, .parts = 60, .half_width = 2.0, .only_points = true});
  GridUpdater updater;
  GridOptions options = options_of(GridContent::SignedDistance);
  const auto whole = [&] {
    body.place();
    GridCounts counts;
    const std::uint64_t hash = updater.make(body.field, options, Executor(1), &counts).hash();
    EXPECT_EQ(hash, make_surface_grid(body.field, options, Executor(1)).hash());
    return counts.whole;
  };
  EXPECT_TRUE(whole());
  EXPECT_FALSE(whole());
  options.half_width = 2.0;
  EXPECT_TRUE(whole());
  body.skeleton.iso = 0.4;
  EXPECT_TRUE(whole());
  body.skeleton.blend.rule = BlendRule::Ricci;
  EXPECT_TRUE(whole());
  body.skeleton.primitive.pop_back();
  EXPECT_FALSE(whole());
}

/// Bodies that come, move and go, each with a number for what it is.
struct Crowd {
  struct Member {
    Body body;
    std::uint64_t version;
  };
  std::vector<Member> member;
  std::uint64_t next = 0;

  void add(std::uint64_t seed, const Vec3& at) {
    Body body = random_body({.seed = seed, .parts = 3, .half_width = 0.3, .only_points = seed % 2 == 0});
    for (Pose& part : body.parts) part.position += at;
    body.place();
    member.push_back({std::move(body), next++});
  }
  void set_iso(std::size_t i, double iso) {
    member[i].body.skeleton.iso = iso;
    member[i].body.place();
    member[i].version = next++;
  }
  void move_a_part(std::size_t i, const Vec3& by) {
    member[i].body.parts[1].position += by;
    member[i].body.place();
    member[i].version = next++;
  }
  void move(std::size_t i, const Vec3& by) {
    for (Pose& part : member[i].body.parts) part.position += by;
    member[i].body.place();
    member[i].version = next++;
  }
  std::vector<DepthField> depths;

  /// Valid until the next call.
  [[nodiscard]] std::vector<UnitedBody> united(GridContent content) {
    depths.clear();
    for (const Member& m : member) depths.emplace_back(m.body.field);
    std::vector<UnitedBody> out;
    for (std::size_t i = 0; i < member.size(); ++i) {
      const Field& field = member[i].body.field;
      out.push_back({content == GridContent::Field ? FieldView(field) : FieldView(depths[i]), member[i].version, i % 2 == 0 ? &field : nullptr});
    }
    return out;
  }
};

UnitedField whole_of(std::span<const UnitedBody> bodies) {
  std::vector<FieldView> views;
  for (const UnitedBody& body : bodies) views.push_back(body.view);
  return UnitedField(std::move(views));
}

class UnitedGrid : public ::testing::TestWithParam<GridContent> {};

TEST_P(UnitedGrid, HasTheTreeOfAWholeGridWhateverMovesComesOrGoes) {
  const Folder folder;
  const GridOptions options = options_of(GetParam());
  Crowd crowd;
  Random random(31);
  for (std::uint64_t seed = 0; seed < 9; ++seed) crowd.add(seed, random.in_box(1.5));
  for (const double x : {4.0, 8.0, -4.0, -8.0}) crowd.member.push_back({body_of({{wyvill_point(2.6), Vec3(x, 0, 0)}}), crowd.next++});  // whole leaves of it lie inside
  UnionUpdater updater;
  int kept = 0;
  for (int step = 0; step < 16; ++step) {
    if (step % 2 == 1) crowd.move_a_part(random.below(9), random.in_box(0.1));
    if (step % 3 == 0) crowd.move(random.below(9), random.in_box(0.2));
    if (step == 4) crowd.move(2, Vec3(2.0, 0, 0));
    if (step == 5) crowd.member.erase(crowd.member.begin() + 1);
    if (step == 7) crowd.add(40, random.in_box(1.0));
    if (step == 8) std::swap(crowd.member[0], crowd.member[3]);
    if (step == 10) crowd.move(0, crowd.member[4].body.parts[0].position - crowd.member[0].body.parts[0].position);  // into another one
    if (step == 11) crowd.move(0, Vec3(0.05, 0.05, 0.0));
    if (step == 12) crowd.move(9, Vec3(0.6, 0.0, 0.2));  // a large one, which whole leaves stay inside of
    if (step == 13) crowd.move(10, Vec3(3.0, 0.0, 0.0));  // and one that leaves the box of all
    if (step == 14) crowd.set_iso(0, 0.3);
    if (step == 15) crowd.member.pop_back();
    GridCounts counts;
    const std::vector<UnitedBody> bodies = crowd.united(options.content);
    const SurfaceGrid& grid = updater.make(bodies, options, Executor(2), &counts);
    const SurfaceGrid whole = make_surface_grid(whole_of(bodies), options, Executor(1));
    ASSERT_EQ(grid.hash(), whole.hash()) << step;
    ASSERT_EQ(content_of(bytes_of(folder, grid)), content_of(bytes_of(folder, whole))) << step;
    kept += counts.whole ? 0 : 1;
  }
  EXPECT_GE(kept, 11);
}

TEST_P(UnitedGrid, TouchesOnlyLeavesNearBodiesThatChanged) {
  GridOptions options = options_of(GetParam());
  Crowd crowd;
  for (std::uint64_t i = 0; i < 20; ++i) crowd.add(2 * i, Vec3(1.5 * static_cast<double>(i), 0, 0));
  UnionUpdater updater;
  GridCounts counts;
  const auto make = [&] {
    const std::vector<UnitedBody> bodies = crowd.united(options.content);
    const std::uint64_t hash = updater.make(bodies, options, Executor(1), &counts).hash();
    EXPECT_EQ(hash, make_surface_grid(whole_of(bodies), options, Executor(1)).hash());
  };
  make();
  EXPECT_TRUE(counts.whole);
  const std::uint64_t all = counts.leaves_sampled;
  make();
  EXPECT_FALSE(counts.whole);
  EXPECT_EQ(counts.leaves_sampled, 0u);
  for (const std::size_t moved : {7u, 0u}) {  // the first also stands for all that are constant far away
    crowd.move(moved, Vec3(0.01, 0, 0));
    make();
    EXPECT_FALSE(counts.whole);
    EXPECT_GT(counts.leaves_sampled, 0u);
    EXPECT_LT(counts.leaves_sampled, all / 10);
  }
  options.half_width = 2.0;
  make();
  EXPECT_TRUE(counts.whole);
}

TEST_P(UnitedGrid, TouchesOnlyLeavesThatAMovedPrimitiveReaches) {
  Crowd crowd;
  crowd.member.push_back({random_body({.seed = 8, .parts = 200, .half_width = 3.0, .only_points = true}), crowd.next++});
  crowd.add(2, Vec3(6.0, 0, 0));
  UnionUpdater updater;
  GridCounts counts;
  const auto make = [&] {
    (void)updater.make(crowd.united(GetParam()), options_of(GetParam()), Executor(1), &counts);
    return counts.leaves_sampled;
  };
  const std::uint64_t all = make();
  crowd.move_a_part(0, Vec3(0.01, 0, 0));
  const std::uint64_t moved = make();
  EXPECT_GT(moved, 0u);
  EXPECT_LT(10 * moved, all);
}

INSTANTIATE_TEST_SUITE_P(EveryContent, UnitedGrid, ::testing::Values(GridContent::SignedDistance, GridContent::Field),
                         [](const auto& content) { return content.param == GridContent::Field ? "Field" : "SignedDistance"; });

TEST(SurfaceGrid, OfUnitedBodiesHasTheDistanceToTheNearest) {
  const FunctionField left = sphere(kOrigin, 0.4), right = sphere(kOrigin + Vec3(1.5, 0, 0), 0.3);
  const UnitedField both({left, right});
  const SurfaceGrid grid = make_surface_grid(both, options_of(GridContent::SignedDistance), Executor(1));
  for (int k = -12; k < 12; ++k) {
    for (int j = -12; j < 12; ++j) {
      for (int i = -12; i < 40; ++i) {
        const double distance = -std::max(FieldView(left).value(node(i, j, k)), FieldView(right).value(node(i, j, k)));
        ASSERT_NEAR(grid.value(i, j, k), std::clamp(distance, -3.0 * kCell, 3.0 * kCell), kFloatEps);
      }
    }
  }
}

// The field of the large ball falls off slowly: it is the larger one near the small ball, too.
TEST(SurfaceGrid, OfUnitedDepthsHasTheDistanceToTheNearestWhateverTheKernels) {
  const Body large = body_of({{wyvill_point(2.0), kOrigin}}), small = body_of({{wyvill_point(0.2), kOrigin + Vec3(1.05, 0, 0)}});
  const DepthField depth_of_large(large.field), depth_of_small(small.field);
  const UnitedField both({depth_of_large, depth_of_small});
  const SurfaceGrid grid = make_surface_grid(both, options_of(GridContent::SignedDistance), Executor(1));
  const SurfaceGrid one = make_surface_grid(large.field, options_of(GridContent::SignedDistance), Executor(1)),
                    two = make_surface_grid(small.field, options_of(GridContent::SignedDistance), Executor(1));
  int nearer_to_small = 0;
  for (int k = -24; k < 24; ++k) {
    for (int j = -24; j < 24; ++j) {
      for (int i = -24; i < 36; ++i) {
        const double a = one.value(i, j, k), b = two.value(i, j, k);
        ASSERT_NEAR(grid.value(i, j, k), std::min(a, b), kFloatEps);
        nearer_to_small += b < a ? 1 : 0;
      }
    }
  }
  EXPECT_GT(nearer_to_small, 20);
}

/// Of the vertices' distances from the surface to first order [m].
double rms_distance(const Mesh& mesh, const FieldView& field) {
  std::vector<double> values(mesh.vertex_count());
  std::vector<Vec3> gradients(mesh.vertex_count());
  field.evaluate(mesh.position, values, gradients);
  double sum = 0.0;
  for (std::size_t v = 0; v < values.size(); ++v) sum += values[v] * values[v] / gradients[v].squaredNorm();
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST(SurfaceGrid, BecomesAMeshOnTheSurfaceByOpenVdb) {
  Primitive plate = wyvill_point(0.5);
  plate.shape = ShapeKind::Box;
  plate.size = {0.4, 0.3, 0.1};
  Primitive ring = wyvill_point(0.4);
  ring.shape = ShapeKind::Ring;
  ring.size.x() = 0.6;
  const std::array bodies{body_of({{wyvill_point(1.0), kOrigin}, {wyvill_point(0.8), kOrigin + Vec3(0.5, 0, 0)}}), body_of({{plate, kOrigin}}),
                          body_of({{ring, kOrigin}}), random_body({.seed = 5, .parts = 12, .half_width = 0.5, .only_points = true})};
  for (const Body& body : bodies) {
    const SurfaceGrid grid = make_surface_grid(body.field, options_of(GridContent::SignedDistance), Executor(1));
    const Mesh mesh = mesh_of(grid, body.field, Executor(2));
    const MeshReport report = inspect(mesh);
    const MeshReport exact = inspect(march_cubes(body.field, {.lattice = {.cell = 0.01}}, Executor(1)));
    EXPECT_TRUE(report.closed && report.oriented);
    EXPECT_EQ(report.components, exact.components);
    EXPECT_NEAR(report.volume, exact.volume, 0.1 * kCell * exact.area);
    EXPECT_LE(rms_distance(mesh, body.field), 1e-4 * kCell);
    std::vector<double> values(mesh.vertex_count());
    std::vector<Vec3> gradients(mesh.vertex_count());
    body.field.evaluate(mesh.position, values, gradients);
    for (std::size_t v = 0; v < values.size(); ++v) ASSERT_NEAR(mesh.normal[v].dot(gradients[v].normalized()), -1.0, 1e-12);
    EXPECT_EQ(hash_of(mesh_of(grid, body.field, Executor(1))), hash_of(mesh));
  }
}

// Sheets nearer than a cell, which vertices on their way to the surface could pass through.
TEST(SurfaceGrid, BecomesAMeshThatDoesNotCrossItself) {
  std::size_t vertices = 0, on_surface = 0;
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    const Body body = random_body({.seed = seed, .parts = 30, .half_width = 1.0});
    for (const double cell : {0.3, 0.2}) {
      GridOptions options = options_of(GridContent::SignedDistance);
      options.lattice.cell = cell;
      const Mesh mesh = mesh_of(make_surface_grid(body.field, options, Executor(1)), body.field, Executor(1));
      EXPECT_TRUE(inspect(mesh).closed && inspect(mesh).oriented) << seed;
      EXPECT_EQ(self_intersections(mesh, cell), 0u) << seed << ' ' << cell;
      std::vector<double> values(mesh.vertex_count());
      std::vector<Vec3> gradients(mesh.vertex_count());
      body.field.evaluate(mesh.position, values, gradients);
      vertices += values.size();
      for (std::size_t v = 0; v < values.size(); ++v) on_surface += std::abs(values[v]) <= 1e-4 * cell * gradients[v].norm() ? 1 : 0;
    }
  }
  EXPECT_GE(static_cast<double>(on_surface), 0.98 * static_cast<double>(vertices));
}

// A grid of a ball half a cell smaller than the field's: there the way is short; of one two cells smaller it is too long, and all stay.
TEST(SurfaceGrid, GivesVerticesThatStayWhereTheSurfaceIsTooFar) {
  const Body body = body_of({{wyvill_point(1.0), kOrigin}});
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  for (const double off : {0.4, 2.0}) {
    const Body smaller = body_of({{wyvill_point((radius - off * kCell) / radius), kOrigin}});
    const SurfaceGrid grid = make_surface_grid(smaller.field, options_of(GridContent::SignedDistance), Executor(1));
    const Mesh mesh = mesh_of(grid, body.field, Executor(1));
    EXPECT_TRUE(inspect(mesh).closed && inspect(mesh).oriented);
    const double rms = rms_distance(mesh, off < 1.0 ? body.field : smaller.field);
    EXPECT_LE(rms, off < 1.0 ? 1e-4 * kCell : 0.1 * kCell);
    for (const Vec3& p : mesh.position) EXPECT_LT(std::abs((p - kOrigin).norm() - radius) / kCell, off < 1.0 ? 1e-4 : 2.1);
  }
}

TEST(MeshRoutes, CostByCountsAndCubesCostLess) {
  Body body = random_body({.seed = 8, .parts = 60, .half_width = 2.0, .only_points = true});
  const RouteEstimate blobs = estimate_routes(body.skeleton, body.placed.support, 0.05);
  EXPECT_TRUE(blobs.prefers_cubes());
  EXPECT_GT(blobs.cubes_ms, 0.0);
  EXPECT_NEAR(estimate_routes(body.skeleton, body.placed.support, 0.1).leaves, 0.25 * blobs.leaves, 1e-9 * blobs.leaves);
  body.skeleton.blend.rule = BlendRule::Ricci;  // double precision
  const RouteEstimate blended = estimate_routes(body.skeleton, body.placed.support, 0.05);
  EXPECT_GT(blended.cubes_ms, blobs.cubes_ms);
  EXPECT_EQ(blended.openvdb_ms, blobs.openvdb_ms);
  EXPECT_EQ(estimate_routes({}, {}, 0.05).leaves, 0.0);
}

TEST(MeshRoutes, EstimateSearchesByTheCellsThatSupportsSpan) {
  Body ball;
  ball.skeleton.part_count = 1;
  ball.skeleton.primitive.emplace_back().kernel = Kernel::wyvill(1.0);
  ball.parts = {Pose{}};
  ball.place();
  const auto times = [](const SearchEstimate& e) { return e.search_ms / e.mesh_ms; };
  const auto of = [](const Body& body, double cell) { return estimate_search(body.skeleton, body.placed.support, cell); };
  EXPECT_NEAR(times(of(ball, 0.02)), 0.5, 0.01);
  EXPECT_LT(times(of(ball, 0.3)), 1.0);
  EXPECT_GT(times(of(ball, 1.5)), 5.0);
  EXPECT_LT(of(ball, 100.0).search_ms, 1.1);  // a thousand cubes
  EXPECT_TRUE(of(ball, 0.02).decides);
  const Body many = random_body({.seed = 8, .parts = 60, .half_width = 0.5, .only_points = true});
  EXPECT_GT(times(of(many, 0.1)), times(of(ball, 0.2)));  // where many overlap
  const std::array<DividingBody, 2> two{{{&ball.skeleton, ball.placed.support}, {&ball.skeleton, ball.placed.support}}};
  const std::array<std::array<std::size_t, 2>, 1> pair{{{0, 1}}};
  const SearchEstimate apart = estimate_search(two, {}, 0.1), touching = estimate_search(two, pair, 0.1);
  EXPECT_GT(touching.search_ms, apart.search_ms + 0.1);
  EXPECT_GT(touching.mesh_ms, apart.mesh_ms);
}

TEST(MeshRoutes, EstimateLongerSearchesOfShapesThatTurnWithinTheirSupport) {
  const auto search_ms = [](ShapeKind shape, double size, double exponent) {
    Body body;
    body.skeleton.part_count = 1;
    Primitive& p = body.skeleton.primitive.emplace_back();
    p.shape = shape;
    p.size = Vec3::Constant(size);
    p.exponent = {exponent, exponent};
    p.kernel = Kernel::wyvill(1.0);
    body.parts = {Pose{}};
    body.place();
    return estimate_search(body.skeleton, body.placed.support, 0.05).search_ms;
  };
  EXPECT_GT(search_ms(ShapeKind::Superquadric, 1.0, 0.3), 1.1 * search_ms(ShapeKind::Superquadric, 1.0, 1.0));
  EXPECT_GT(search_ms(ShapeKind::Ring, 0.3, 1.0), 1.1 * search_ms(ShapeKind::Disc, 0.3, 1.0));
}

TEST(MeshRoutes, KnowBySkeletonsWhatASearchCannotDecide) {
  const auto decides = [](std::vector<Primitive> primitives, Blend blend) {
    Body body;
    body.skeleton.part_count = 2;
    body.skeleton.primitive = std::move(primitives);
    body.skeleton.blend = std::move(blend);
    for (Primitive& p : body.skeleton.primitive) p.kernel = Kernel::wyvill(0.3);
    body.parts = {Pose{}, Pose{}};
    body.place();
    return estimate_search(body.skeleton, body.placed.support, 0.05).decides;
  };
  std::vector<Primitive> points(2);
  points[1].part = 1;
  EXPECT_TRUE(decides(points, {}));
  EXPECT_TRUE(decides(points, {.rule = BlendRule::Ricci}));
  EXPECT_FALSE(decides(points, {.rule = BlendRule::Gradient}));
  EXPECT_FALSE(decides(points, {.rule = BlendRule::Gradient, .node = {0, 1}}));
  EXPECT_TRUE(decides(points, {.rule = BlendRule::Gradient, .node = {0, 0}}));
  // Surfaces lie 0.136 m from curves, whose least radius of curvature is 0.25 m^2 / height.
  const auto bow = [](double height, double taper) {
    Primitive p;
    p.shape = ShapeKind::Curve;
    p.control = {Vec3(-0.5, 0, 0), Vec3(0, height, 0), Vec3(0.5, 0, 0)};
    p.taper = taper;
    return std::vector<Primitive>{p, Primitive{}};  // beside a ball
  };
  EXPECT_TRUE(decides(bow(0.0, 1.0), {}));
  EXPECT_TRUE(decides(bow(1.6, 1.0), {}));
  EXPECT_FALSE(decides(bow(2.1, 1.0), {}));
  EXPECT_FALSE(decides(bow(1.6, 2.0), {}));
  EXPECT_TRUE(decides({bow(2.1, 1.0).front()}, {}));
}

TEST(SurfaceGrid, IsReadByTheToolsOfOpenVdb) {
  ASSERT_EQ(std::system("command -v vdb_print >/dev/null 2>&1"), 0) << "install libopenvdb-tools";
  const Folder folder;
  std::vector<SurfaceGrid> grids;
  grids.push_back(make_surface_grid(sphere(kOrigin, 0.6), options_of(GridContent::SignedDistance), Executor(1)));
  const auto path = folder / "ball.vdb";
  write_grids(path, grids);
  const auto report = folder / "report.txt";
  ASSERT_EQ(std::system(("vdb_print -l " + path.string() + " >" + report.string() + " 2>&1").c_str()), 0);
  std::ifstream file(report);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  for (const std::string word : {"Name: ball", "class: level set", "units: m", "voxel size: 0.05"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in\n" << text;
  }
}

TEST(SurfaceGrid, HoldsTheSideOfEveryVoxelOfARandomBody) {
  const Body body = random_body({.seed = 6, .parts = 25});
  const SurfaceGrid grid = make_surface_grid(body.field, options_of(GridContent::SignedDistance), Executor(2));
  const std::vector<Vec3> points = random_points(8, 4000, 2.0);
  for (const Vec3& p : points) {
    const Vec3 at = ((p - kOrigin) / kCell).array().round();
    const auto i = static_cast<int>(at.x()), j = static_cast<int>(at.y()), k = static_cast<int>(at.z());
    EXPECT_EQ(grid.value(i, j, k) < 0.0, FieldView(body.field).value(node(i, j, k)) > 0.0);
  }
}

TEST(SurfaceGrid, OfNothingIsEmpty) {
  FunctionField none = sphere(Vec3::Zero(), 0.5);
  none.box = Box{};
  const SurfaceGrid grid = make_surface_grid(none, options_of(GridContent::SignedDistance), Executor(1));
  EXPECT_EQ(grid.active_voxels(), 0u);
  EXPECT_GT(grid.value(0, 0, 0), 0.0);
}

TEST(SurfaceGrid, RefusesMoreVoxelsThanAllowedAndNamesTheCellThatFits) {
  const FunctionField ball = sphere(Vec3::Zero(), 0.5);
  GridOptions options = options_of(GridContent::SignedDistance);
  options.max_voxels = 100'000;
  options.lattice.cell = 0.005;
  try {
    (void)make_surface_grid(ball, options, Executor(1));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_NE(std::string(error.what()).find("voxels"), std::string::npos) << error.what();
    const std::string hint = error.faults().front().hint;
    options.lattice.cell = std::stod(hint.substr(hint.find_first_of("0123456789")));
    EXPECT_NO_THROW((void)make_surface_grid(ball, options, Executor(1))) << hint;
  }
  options.lattice.cell = 1e-8;  // would need 1e16 voxels: refused at once
  expect_error([&] { (void)make_surface_grid(ball, options, Executor(1)); }, ErrorKind::Limit, "use cells of at least");
  expect_error([&] { (void)make_surface_grid(below(0.0), options, Executor(1)); }, ErrorKind::Usage, "bounded box");
}

TEST(SurfaceGrid, RefusesCellsThatOpenVdbTakesForNone) {
  // A transform whose determinant, cell^3, is below 3e-15 is singular to OpenVDB: 1.4423e-5 m.
  const FunctionField ball = sphere(Vec3::Zero(), 1e-4);
  GridOptions options = options_of(GridContent::SignedDistance);
  options.lattice = {.origin = Vec3::Zero(), .cell = 1.46e-5};
  const SurfaceGrid grid = make_surface_grid(ball, options, Executor(1));
  EXPECT_GT(grid.active_voxels(), 0u);
  const Body body = body_of({{wyvill_point(1e-3), Vec3::Zero()}});
  const Skeleton& skeleton = body.skeleton;
  const std::vector<Box>& support = body.placed.support;
  EXPECT_TRUE(std::isfinite(estimate_routes(skeleton, support, options.lattice.cell).openvdb_ms));
  options.lattice.cell = 1.44e-5;
  expect_error([&] { (void)make_surface_grid(ball, options, Executor(1)); }, ErrorKind::Limit, "a size that OpenVDB takes");
  EXPECT_TRUE(estimate_routes(skeleton, support, options.lattice.cell).prefers_cubes());
  EXPECT_FALSE(std::isfinite(estimate_routes(skeleton, support, options.lattice.cell).openvdb_ms));
}

TEST(SurfaceGrid, LeavesNoTemporaryFileAndNamesTheFileThatCannotBeWritten) {
  const Folder folder;
  const auto path = folder / "ball.vdb";
  std::vector<SurfaceGrid> grids;
  grids.push_back(make_surface_grid(sphere(kOrigin, 0.6), options_of(GridContent::SignedDistance), Executor(1)));
  write_grids(path, grids);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path.parent_path()), {}), 1);
  expect_error([&] { write_grids(path / "ball.vdb", grids); }, ErrorKind::Io, "ball.vdb");
}

TEST(SurfaceGrid, ThatWasNeverMadeIsACallersMistake) {
  const SurfaceGrid none;
  EXPECT_THROW((void)none.active_voxels(), ContractViolation);
}

}  // namespace
}  // namespace supple::implicit
