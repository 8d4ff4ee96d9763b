#include "mesh/missed/missed_blobs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/missed/cube_lanes.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/missed_pieces.h"

namespace supple::implicit {
namespace {

using namespace testing;

/// Wyvill points near a cube, in cells; `sum` is their sum in double precision.
struct Blobs {
  blobs::BlobList list;
  std::vector<Vec3> centre;
  std::vector<double> radius;

  void add(const Vec3& at, double R) {
    // What the lists hold, so that only the bounds' own round-off is left.
    const auto s = static_cast<float>(1.0 / R);
    list.reserve(list.count + 1);
    list.scale[list.count] = s;
    list.x[list.count] = static_cast<float>(double{s} * at.x());
    list.y[list.count] = static_cast<float>(double{s} * at.y());
    list.z[list.count] = static_cast<float>(double{s} * at.z());
    ++list.count;
    list.pad();
    centre.push_back(at);
    radius.push_back(R);
  }
  double sum(const Vec3& x, Vec3& gradient) const {
    double f = 0.0;
    gradient.setZero();
    for (std::size_t i = 0; i < centre.size(); ++i) {
      const Vec3 u = (x - centre[i]) / radius[i];
      const double t = std::max(1.0 - u.squaredNorm(), 0.0);
      f += t * t * t;
      gradient -= 6.0 / radius[i] * t * t * u;
    }
    return f;
  }
};

/// One to thirty points whose supports reach the middle of a cell somewhere in a block: all around it or, as below a
/// surface, on one side.
Blobs random_blobs(Random& random, const Vec3& middle) {
  Blobs blobs;
  const int count = 1 + static_cast<int>(random.below(3) == 0 ? random.below(30) : random.below(4));
  const bool one_side = random.below(2) == 0;
  const Vec3 side = random.direction();
  while (static_cast<int>(blobs.centre.size()) < count) {
    const double R = random.uniform(1.0, 9.0);
    Vec3 offset = random.direction() * random.uniform(0.0, R + 0.8);
    if (one_side && offset.dot(side) < 0.0) offset = -offset;
    blobs.add(middle + offset, R);
  }
  return blobs;
}

/// Calls use(point) for 7^3 points of a cube.
template <class Use>
void for_points(const Vec3& middle, double half, const Use& use) {
  constexpr int kPoints = 7;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Vec3 at(i % kPoints, i / kPoints % kPoints, i / kPoints / kPoints);
    use(Vec3(middle + half * (2.0 / (kPoints - 1) * at - Vec3::Ones())));
  }
}

/// The cube's middle as floats hold it.
Vec3 random_middle(Random& random) {
  const auto at = [&] { return double{static_cast<float>(random.uniform(0.5, 15.5))}; };
  const double x = at(), y = at(), z = at();
  return {x, y, z};
}

bool has_one_sign(const Blobs& blobs, const Vec3& middle, double half, double iso) {
  blobs::CubeBatch cubes;
  cubes.reserve(1);
  cubes.add(static_cast<float>(middle.x()), static_cast<float>(middle.y()), static_cast<float>(middle.z()));
  const blobs::CubeRoundOff round_off = blobs::cube_round_off(blobs.list, static_cast<float>(iso));
  EXPECT_TRUE(round_off.bounded);
  blobs::bound_values(blobs.list, static_cast<float>(iso), round_off, static_cast<float>(half), false, cubes);
  const bool one_sign = cubes.one_sign[0] != 0.0F;
  blobs::bound_values(blobs.list, static_cast<float>(iso), round_off, static_cast<float>(half), true, cubes);
  EXPECT_EQ(cubes.count, one_sign ? 0u : 1u);
  return one_sign;
}

bool is_sloped(const Blobs& blobs, const Vec3& middle, double half) {
  blobs::CubeBatch cubes;
  cubes.reserve(1);
  cubes.add(static_cast<float>(middle.x()), static_cast<float>(middle.y()), static_cast<float>(middle.z()));
  const blobs::CubeRoundOff round_off = blobs::cube_round_off(blobs.list, 0.5F);
  blobs::bound_values(blobs.list, 0.5F, round_off, static_cast<float>(half), false, cubes);
  blobs::drop_sloped(blobs.list, round_off, static_cast<float>(half), cubes);
  return cubes.count == 0;
}

// The iso values between which the sign is not known, by bisection, hold all values on the cube; and they are not far
// from them.
TEST(CubeLanes, BoundValuesOfSums) {
  Random random(11);
  double excess = 0.0, spread = 0.0;
  for (int round = 0; round < 3000; ++round) {
    const Vec3 middle = random_middle(random);
    const Blobs blobs = random_blobs(random, middle);
    const double half = random.uniform(0.05, 0.5);
    double least = 1e300, largest = -1e300;
    for_points(middle, half, [&](const Vec3& x) {
      Vec3 gradient;
      const double f = blobs.sum(x, gradient);
      least = std::min(least, f);
      largest = std::max(largest, f);
    });
    // Between `sure`, where the sign is known, and `open`.
    const auto bisect = [&](double sure, double open) {
      for (int k = 0; k < 20; ++k) {
        const double iso = 0.5 * (sure + open);
        (has_one_sign(blobs, middle, half, iso) ? sure : open) = iso;
      }
      return sure;
    };
    if (has_one_sign(blobs, middle, half, 0.0)) {
      const double low = bisect(0.0, largest);
      EXPECT_LE(low, least) << round;
      excess += least - low;
      spread += largest - least;
    }
    const double high = bisect(40.0, std::max(least, 0.0));
    EXPECT_GE(high, largest) << round;
    excess += high - largest;
    spread += largest - least;
  }
  EXPECT_LT(excess, 1.3 * spread);
}

// The largest cube that counts as sloped, by bisection, has no point where F does not rise along the gradient of its
// middle.
TEST(CubeLanes, FindWhereSumsRise) {
  Random random(12);
  int found = 0;
  for (int round = 0; round < 6000; ++round) {
    const Vec3 middle = random_middle(random);
    const Blobs blobs = random_blobs(random, middle);
    double half = 0.5;
    if (!is_sloped(blobs, middle, half)) {
      double open = half;
      half = 0.0;
      for (int k = 0; k < 12; ++k) {
        const double at = 0.5 * (half + open);
        (is_sloped(blobs, middle, at) ? half : open) = at;
      }
    }
    if (half == 0.0) continue;
    ++found;
    Vec3 along;
    blobs.sum(middle, along);
    double least = 1e300;
    for_points(middle, half, [&](const Vec3& x) {
      Vec3 gradient;
      blobs.sum(x, gradient);
      least = std::min(least, gradient.dot(along));
    });
    EXPECT_GT(least, 0.0) << round << ' ' << blobs.centre.size() << ' ' << half;
  }
  EXPECT_GT(found, 5000);
}

/// Blobs whose supports are a cell of kLattice and a little more: some six pieces between its nodes.
Body small_blobs(std::uint64_t seed) {
  return random_body({.seed = seed, .parts = 150, .half_width = 1.0, .least_radius = 0.24, .largest_radius = 0.312,
      .only_points = true});
}
const Lattice kLattice{.origin = Vec3(0.013, 0.021, 0.017), .cell = 0.24};

/// The body and, far away, a primitive of another kind: it is then searched one cube at a time.
Body beside_another_kind(const Body& body) {
  Body both;
  both.skeleton = body.skeleton;
  both.parts = body.parts;
  Primitive far = body.skeleton.primitive[0];
  far.part = both.skeleton.part_count++;
  far.shape = ShapeKind::Segment;
  far.size.x() = 0.1;
  both.skeleton.primitive.push_back(far);
  both.parts.push_back({Vec3(50.0, 0.0, 0.0), Quat::Identity()});
  both.place();
  return both;
}

/// Box, volume and vertices of a piece.
using Piece = std::array<double, 8>;
std::vector<Piece> pieces_of(const Mesh& mesh, std::size_t first_vertex) {
  std::vector<std::uint32_t> root(mesh.vertex_count());
  for (std::uint32_t v = 0; v < root.size(); ++v) root[v] = v;
  const auto find = [&](std::uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) root[find(v)] = find(t[0]);
  }
  std::vector<Piece> pieces;
  for (auto r = static_cast<std::uint32_t>(first_vertex); r < root.size(); ++r) {
    if (find(r) != r) continue;
    Box box;
    double volume = 0.0, count = 0.0;
    for (std::uint32_t v = r; v < root.size(); ++v) {
      if (find(v) == r) box = box.united({mesh.position[v], mesh.position[v]});
      count += find(v) == r ? 1.0 : 0.0;
    }
    for (const auto& t : mesh.triangle) {
      if (find(t[0]) == r) volume += mesh.position[t[0]].cross(mesh.position[t[1]]).dot(mesh.position[t[2]]) / 6.0;
    }
    pieces.push_back({box.lower.x(), box.lower.y(), box.lower.z(), box.upper.x(), box.upper.y(), box.upper.z(),
        volume, count});
  }
  std::sort(pieces.begin(), pieces.end());
  return pieces;
}

class ManyBlobs : public ::testing::TestWithParam<int> {};

// Many cubes at a time find the pieces that one at a time finds.
TEST_P(ManyBlobs, HaveTheSamePiecesOneCubeAtATime) {
  const Body body = small_blobs(static_cast<std::uint64_t>(GetParam()));
  const Body slow = beside_another_kind(body);
  ASSERT_TRUE(is_sum_of_blobs(body.field));
  ASSERT_FALSE(is_sum_of_blobs(slow.field));
  const Executor executor(2);
  const Mesh coarse = march_cubes(body.field, {.lattice = kLattice}, executor);
  Mesh mesh = coarse, reference = coarse, alone = coarse;
  const MissedPieces found = add_missed_pieces(body.field, kLattice, executor, mesh);
  const MissedPieces expected = add_missed_pieces(slow.field, kLattice, executor, reference);
  (void)add_missed_pieces(body.field, kLattice, Executor(1), alone);
  EXPECT_EQ(hash_of(alone), hash_of(mesh));
  EXPECT_LE(found.undecided, expected.undecided);
  EXPECT_EQ(found.pieces, expected.pieces);
  const std::vector<Piece> own = pieces_of(mesh, coarse.vertex_count()),
      others = pieces_of(reference, coarse.vertex_count());
  ASSERT_EQ(own.size(), others.size());
  for (std::size_t i = 0; i < own.size(); ++i) {
    for (std::size_t k = 0; k < own[i].size(); ++k) EXPECT_NEAR(own[i][k], others[i][k], 1e-9);
  }
  ::testing::Test::RecordProperty("pieces", static_cast<int>(found.pieces));
  ::testing::Test::RecordProperty("undecided", static_cast<int>(found.undecided));
  ::testing::Test::RecordProperty("before", static_cast<int>(expected.undecided));
}

INSTANTIATE_TEST_SUITE_P(MissedBlobs, ManyBlobs, ::testing::Range(1, 7));

// Each extremum whose sign is not that of the corners of its cell lies in an open cell: sought by Newton's method from
// all over the body.
TEST(MissedBlobs, AreOpenWhereAnExtremumIs) {
  int open_ones = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const Body body = small_blobs(seed);
    std::uint64_t cubes = 0;
    std::vector<std::array<int, 3>> open;
    for (const OpenCells& cells : find_open_cells(body.field, kLattice, Executor(2), cubes)) {
      const auto& block = cells.block;
      for (const auto& at : cells.cell) {
        open.push_back({8 * block[0] + at[0], 8 * block[1] + at[1], 8 * block[2] + at[2]});
      }
    }
    const FieldView field(body.field);
    Random random(100 + seed);
    for (int start = 0; start < 3000; ++start) {
      Vec3 x = random.in_box(1.0), gradient = Vec3::Zero();
      double value = field.value(x, gradient);
      for (int step = 0; step < 40 && gradient.norm() > 1e-11; ++step) {
        Mat3 hessian;
        constexpr double kStep = 1e-6;
        for (int k = 0; k < 3; ++k) {
          Vec3 after, before;
          (void)field.value(x + kStep * Vec3::Unit(k), after);
          (void)field.value(x - kStep * Vec3::Unit(k), before);
          hessian.col(k) = (after - before) / (2.0 * kStep);
        }
        Vec3 move = hessian.fullPivLu().solve(gradient);
        if (!(move.norm() < 0.03)) move *= 0.03 / move.norm();
        x -= move;
        value = field.value(x, gradient);
      }
      if (!(gradient.norm() < 1e-9)) continue;
      std::array<int, 3> cell{};
      for (int k = 0; k < 3; ++k) {
        cell[static_cast<std::size_t>(k)] = static_cast<int>(std::floor((x[k] - kLattice.origin[k]) / kLattice.cell));
      }
      bool other_sign = true;
      for (unsigned c = 0; c < 8; ++c) {
        const Vec3 node = kLattice.origin + kLattice.cell * Vec3(cell[0] + static_cast<int>(c & 1u),
            cell[1] + static_cast<int>(c >> 1 & 1u), cell[2] + static_cast<int>(c >> 2));
        other_sign = other_sign && (field.value(node) > 0.0) != (value > 0.0);
      }
      if (!other_sign) continue;
      ++open_ones;
      EXPECT_NE(std::find(open.begin(), open.end(), cell), open.end()) << seed << ": " << x.transpose();
    }
  }
  EXPECT_GT(open_ones, 20);
}

// Cavities of a hundredth to a quarter of a cell, anywhere in a cell.
TEST(MissedBlobs, AreOpenAroundTheSmallestCavities) {
  Random random(5);
  // F = 0 at the origin
  const double g = 0.5 * (1.0 + std::sqrt(5.0)), closed = std::sqrt(1.0 - std::cbrt(0.5 / 12.0));
  for (int round = 0; round < 60; ++round) {
    Body body;
    const double distance = closed + 0.011 * std::pow(random.uniform(0.02, 1.0), 2);
    for (int i = 0; i < 12; ++i) {
      Vec3 at = Vec3::Zero();
      at[i % 3] = i / 3 % 2 == 0 ? 1.0 : -1.0;
      at[(i % 3 + 1) % 3] = i / 6 == 0 ? g : -g;
      Primitive p;
      p.part = body.skeleton.part_count++;
      p.kernel = Kernel::wyvill(1.0);
      body.skeleton.primitive.push_back(p);
      body.parts.push_back({distance * at.normalized(), Quat::Identity()});
    }
    body.place();
    ASSERT_LT(FieldView(body.field).value(Vec3::Zero()), 0.0);
    const Lattice around{.origin = -0.4 * (Vec3::Constant(0.5) + random.in_box(0.35)), .cell = 0.4};
    std::uint64_t cubes = 0;
    const std::vector<OpenCells> open = find_open_cells(body.field, around, Executor(2), cubes);
    ASSERT_EQ(open.size(), 1u) << distance;
    EXPECT_EQ(open[0].block, (lattice::BlockCoord{0, 0, 0}));
    EXPECT_EQ(open[0].cell, (std::vector{std::array<std::uint8_t, 3>{0, 0, 0}}));
  }
}

}  // namespace
}  // namespace supple::implicit
