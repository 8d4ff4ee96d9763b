// Meshes of bodies that touch, from frame to frame: what is kept changes no bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <tuple>

#include "implicit/analytic_fields.h"
#include "supple/core/content_versions.h"
#include "supple/core/error.h"
#include "supple/implicit/mesh_limits.h"
#include "supple/implicit/partition_mesher.h"

namespace supple::implicit {
namespace {

using namespace testing;

/// Ball or capsule: the places within a radius of a segment; or the ground, below a height.
struct Piece {
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();
  double radius = 0.0;  ///< 0: the ground, below from.z

  [[nodiscard]] FunctionField field() const {
    if (radius == 0.0) return below(from.z());
    const Vec3 start = from, along = to - from;
    const double r = radius, length2 = std::max(along.squaredNorm(), 1e-30);
    return {.function =
                [=](const Vec3& p, Vec3& gradient) {
                  const Vec3 d = p - start - std::clamp((p - start).dot(along) / length2, 0.0, 1.0) * along;
                  const double n = d.norm();
                  gradient = n > 0.0 ? Vec3(-d / n) : Vec3::Zero();
                  return r - n;
                },
            .lipschitz = 1.0,
            .box = Box{from.cwiseMin(to), from.cwiseMax(to)}.inflated(r * (1.0 + 1e-12))};
  }
};

/// Pieces of a frame with numbers for them.
class Pieces {
 public:
  std::vector<Piece> piece;

  /// What a mesher is given in this frame.
  struct Input {
    std::vector<FunctionField> field;
    std::vector<FieldView> view;
    std::vector<std::uint64_t> version;
  };
  [[nodiscard]] Input input() {
    Input in;
    versions_.begin_frame();
    for (const Piece& p : piece) {
      ContentWords words;
      words.add(p.from);
      words.add(p.to);
      words.add(p.radius);
      in.version.push_back(versions_.of(words.view()));
      in.field.push_back(p.field());
    }
    in.view.assign(in.field.begin(), in.field.end());
    return in;
  }

 private:
  ContentVersions versions_;
};

Piece random_piece(Random& random) {
  const Vec3 from = random.in_box(0.7);
  return {.from = from, .to = random.below(2) == 0 ? from : Vec3(from + random.in_box(0.4)), .radius = random.uniform(0.2, 0.45)};
}

/// Some move, come, go or change places; others stay.
void next_frame(Random& random, std::vector<Piece>& piece) {
  for (Piece& p : piece) {
    if (random.below(6) != 0) continue;
    const Vec3 step = p.radius == 0.0 ? Vec3(0, 0, random.uniform(-0.02, 0.02)) : random.in_box(0.01);
    p.from += step;
    p.to += step;
  }
  const auto somewhere = [&] { return piece.begin() + random.below(static_cast<std::uint32_t>(piece.size())); };
  if (random.below(5) == 0 && piece.size() < 8) piece.insert(somewhere(), random_piece(random));
  if (random.below(5) == 0 && piece.size() > 3) {
    const auto gone = somewhere();
    if (gone->radius > 0.0) piece.erase(gone);
  }
  if (random.below(6) == 0) std::iter_swap(somewhere(), somewhere());
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void expect_same(const std::vector<Mesh>& kept, const std::vector<Mesh>& fresh) {
  ASSERT_EQ(kept.size(), fresh.size());
  for (std::size_t m = 0; m < kept.size(); ++m) {
    ASSERT_TRUE(same_bits(kept[m].position, fresh[m].position)) << m;
    ASSERT_TRUE(same_bits(kept[m].normal, fresh[m].normal)) << m;
    ASSERT_TRUE(same_bits(kept[m].triangle, fresh[m].triangle)) << m;
    ASSERT_TRUE(same_bits(kept[m].columns.at(0).values, fresh[m].columns.at(0).values)) << m;
  }
}

/// Of all that tells of the meshes and not of the work.
void expect_same(const PolygoniseCounts& kept, const PolygoniseCounts& fresh) {
  EXPECT_EQ(kept.blocks_present, fresh.blocks_present);
  EXPECT_EQ(kept.cell, fresh.cell);
  EXPECT_EQ(kept.residual, fresh.residual);
  EXPECT_EQ(kept.junctions, fresh.junctions);
  EXPECT_EQ(kept.junctions_moved, fresh.junctions_moved);
  EXPECT_EQ(kept.boundary_points, fresh.boundary_points);
  EXPECT_EQ(kept.boundary_points_moved, fresh.boundary_points_moved);
  EXPECT_EQ(kept.gaps, fresh.gaps);
}

const Lattice kLattice{.origin = {0.0137, -0.0071, 0.0229}, .cell = 0.05};

TEST(PartitionMesher, GivesWhatAFreshOneGivesWhateverMovesComesAndGoes) {
  constexpr int kFrames = 10;
  std::uint64_t visited = 0, all_visited = 0;
  for (std::uint64_t seed = 41; seed <= 54; ++seed) {
    Random random(seed);
    Pieces pieces;
    pieces.piece.push_back({.from = {0, 0, -0.5}});
    for (std::uint32_t n = 2 + random.below(6); n > 0; --n) pieces.piece.push_back(random_piece(random));
    const Lattice lattice{.origin = kLattice.origin, .cell = random.below(2) == 0 ? 0.07 : 0.1};
    PartitionMesher one, two;
    for (int frame = 0; frame < kFrames; ++frame) {
      const Pieces::Input in = pieces.input();
      PolygoniseCounts counts, of_two, fresh_counts;
      const std::vector<Mesh> fresh = polygonise_partition(in.view, lattice, Executor(1), &fresh_counts);
      ASSERT_NO_FATAL_FAILURE(expect_same(one.make(in.view, in.version, lattice, Executor(1), &counts), fresh)) << seed << " " << frame;
      ASSERT_NO_FATAL_FAILURE(expect_same(two.make(in.view, in.version, lattice, Executor(2), &of_two), fresh)) << seed << " " << frame;
      expect_same(counts, fresh_counts);
      EXPECT_EQ(counts.blocks_visited, of_two.blocks_visited);
      visited += counts.blocks_visited;
      all_visited += fresh_counts.blocks_visited;
      next_frame(random, pieces.piece);
    }
  }
  EXPECT_LT(visited, (4 * all_visited) / 5);  // or nothing was tried
}

/// Balls in a row that touch their neighbours.
Pieces row_of_balls(int count) {
  Pieces pieces;
  for (int i = 0; i < count; ++i) {
    const Vec3 centre(0.7 * i, 0.01 * i, 0.02 * i);
    pieces.piece.push_back({.from = centre, .to = centre, .radius = 0.4});
  }
  return pieces;
}

/// How many blocks of the lattice a box meets.
std::uint64_t blocks_met(const Box& box) {
  std::uint64_t count = 1;
  for (int k = 0; k < 3; ++k) {
    const auto block = [&](double x) { return std::floor((x - kLattice.origin[k]) / (8.0 * kLattice.cell)); };
    count *= static_cast<std::uint64_t>(block(box.upper[k]) - block(box.lower[k]) + 1.0);
  }
  return count;
}

TEST(PartitionMesher, VisitsNoBlockWhereNothingMovedAndThoseThatAMovedBodyReaches) {
  Pieces pieces = row_of_balls(12);
  PartitionMesher mesher;
  PolygoniseCounts counts;
  const auto make = [&] {
    const Pieces::Input in = pieces.input();
    return mesher.make(in.view, in.version, kLattice, Executor(1), &counts);
  };
  const std::vector<Mesh> first = make();
  const std::uint64_t all = counts.blocks_visited;
  EXPECT_GT(counts.bytes, 0u);
  expect_same(make(), first);
  EXPECT_EQ(counts.blocks_visited, 0u);
  EXPECT_EQ(counts.nodes, 0u);

  const Box before = pieces.piece[5].field().box;
  pieces.piece[5].from.z() += 0.01;
  pieces.piece[5].to.z() += 0.01;
  // Bounds of a ball are wider than it by half the diagonal of a block.
  const double slack = 0.5 * std::sqrt(3.0) * 8.0 * kLattice.cell;
  const std::uint64_t reached = blocks_met(before.united(pieces.piece[5].field().box).inflated(slack));
  (void)make();
  EXPECT_GT(counts.blocks_visited, 0u);
  EXPECT_LE(counts.blocks_visited, reached);
  EXPECT_LT(counts.blocks_visited, all / 3);

  pieces.piece.erase(pieces.piece.begin() + 5);  // the others have lower numbers now
  (void)make();
  EXPECT_LE(counts.blocks_visited, reached);
  pieces = row_of_balls(12);
  mesher.forget();
  (void)make();
  EXPECT_EQ(counts.blocks_visited, all);
}

TEST(PartitionMesher, BeginsAnewOnAnotherLatticeAndAfterAFault) {
  Pieces pieces = row_of_balls(3);
  PartitionMesher mesher;
  PolygoniseCounts counts;
  const Pieces::Input in = pieces.input();
  (void)mesher.make(in.view, in.version, kLattice, Executor(1));
  for (const Lattice& other : {Lattice{.origin = kLattice.origin, .cell = 0.06}, Lattice{.origin = {0, 0, 0.01}, .cell = 0.06}}) {
    const std::vector<Mesh> fresh = polygonise_partition(in.view, other, Executor(1));
    expect_same(mesher.make(in.view, in.version, other, Executor(1), &counts), fresh);
    EXPECT_GT(counts.blocks_visited, 0u);
  }
  EXPECT_THROW((void)mesher.make(in.view, in.version, {.origin = Vec3::Zero(), .cell = 1e-4}, Executor(1)), Error);
  const std::vector<Mesh> fresh = polygonise_partition(in.view, kLattice, Executor(1));
  expect_same(mesher.make(in.view, in.version, kLattice, Executor(1)), fresh);
  EXPECT_TRUE(mesher.make({}, {}, kLattice, Executor(1)).empty());
}

/// What polygonise_partition_within says; empty where it finds meshes, those of `fresh`.
std::string refusal_of(const Pieces::Input& in, const PartitionError& error, std::vector<Mesh>& fresh, PolygoniseCounts& counts) {
  try {
    fresh = polygonise_partition_within(in.view, {.origin = kLattice.origin, .cell = 0.2}, error, Executor(1), &counts);
  } catch (const Error& refused) {
    return refused.what();
  }
  return {};
}

TEST(PartitionErrorMesher, GivesAndRefusesWhatAFreshOneDoesWhateverMovesComesAndGoes) {
  constexpr int kFrames = 6;
  std::uint64_t visited = 0, all_visited = 0;
  int refused = 0;
  for (std::uint64_t seed = 61; seed <= 65; ++seed) {
    Random random(seed);
    Pieces pieces;
    pieces.piece.push_back({.from = {0, 0, -0.5}});
    for (std::uint32_t n = 2 + random.below(4); n > 0; --n) pieces.piece.push_back(random_piece(random));
    PartitionErrorMesher one, two, small(1'000'000);
    for (int frame = 0; frame < kFrames; ++frame) {
      const Pieces::Input in = pieces.input();
      const PartitionError error{.largest = frame == 3 ? 1e-9 : frame == 4 ? 0.02 : 0.008};
      PolygoniseCounts counts, of_two, of_small, fresh_counts;
      std::vector<Mesh> fresh;
      const std::string said = refusal_of(in, error, fresh, fresh_counts);
      for (const auto& [mesher, threads, count] : {std::tuple{&one, 1, &counts}, std::tuple{&two, 2, &of_two}, std::tuple{&small, 1, &of_small}}) {
        const auto make = [&, mesher = mesher, threads = threads, count = count] {
          return mesher->make(in.view, in.version, {.origin = kLattice.origin, .cell = 0.2}, error, Executor(threads), count);
        };
        if (said.empty()) {
          ASSERT_NO_FATAL_FAILURE(expect_same(make(), fresh)) << seed << " " << frame;
          expect_same(*count, fresh_counts);
          continue;
        }
        try {
          (void)make();
          ADD_FAILURE() << "not refused";
        } catch (const Error& kept) {
          EXPECT_EQ(kept.what(), said);
        }
      }
      refused += said.empty() ? 0 : 1;
      EXPECT_EQ(counts.blocks_visited, of_two.blocks_visited);
      EXPECT_TRUE(!said.empty() || of_small.bytes <= 1'000'000u) << of_small.bytes;
      EXPECT_GE(of_small.blocks_visited, counts.blocks_visited);
      if (frame != 3) {
        visited += counts.blocks_visited;
        all_visited += fresh_counts.blocks_visited;
      }
      next_frame(random, pieces.piece);
    }
  }
  EXPECT_EQ(refused, 5);
  EXPECT_LT(visited, (4 * all_visited) / 5);  // or nothing was tried
}

TEST(PartitionErrorMesher, VisitsNoBlockOfAnyLevelWhereNothingMovedAndKeepsAsMuchAsItMay) {
  Pieces pieces = row_of_balls(8);
  const auto visited = [&](PartitionErrorMesher& mesher, PolygoniseCounts& counts) {
    const Pieces::Input in = pieces.input();
    (void)mesher.make(in.view, in.version, {.origin = kLattice.origin, .cell = 0.2}, {.largest = 0.004}, Executor(1), &counts);
    return counts.blocks_visited;
  };
  PartitionErrorMesher mesher;
  PolygoniseCounts counts, last;
  const std::uint64_t all = visited(mesher, counts);
  EXPECT_GT(all, counts.blocks);  // of more than one level
  EXPECT_EQ(visited(mesher, counts), 0u);
  const std::uint64_t bytes = counts.bytes;

  PartitionErrorMesher less(bytes - 1), none(0);  // the coarsest is made anew
  EXPECT_EQ(visited(less, last), all);
  const std::uint64_t anew = visited(less, last);
  EXPECT_GT(anew, 0u);
  EXPECT_LE(anew, all - counts.blocks);
  EXPECT_GT(last.bytes, bytes / 2);
  EXPECT_LT(last.bytes, bytes);
  (void)visited(none, last);
  EXPECT_EQ(visited(none, last), all);
  EXPECT_EQ(last.bytes, 0u);

  pieces.piece[4].from.z() += 0.01;
  pieces.piece[4].to.z() += 0.01;
  const std::uint64_t moved = visited(mesher, counts);
  EXPECT_GT(moved, 0u);
  EXPECT_LT(moved, all / 2);
  mesher.forget();
  EXPECT_EQ(visited(mesher, counts), all);
}

TEST(PartitionErrorMesher, RefusesAnErrorOutOfReachFromCoarseMeshes) {
  Pieces pieces = row_of_balls(8);
  const Pieces::Input in = pieces.input();
  PolygoniseCounts counts, coarsest;
  (void)polygonise_partition(in.view, kLattice, Executor(1), &coarsest);
  ASSERT_GT(coarsest.blocks, 100u);
  EXPECT_THROW((void)polygonise_partition_within(in.view, kLattice, {.largest = 1e-9}, Executor(1), &counts), Error);
  // Surfaces take 1, 2 and 4 times the blocks, and those beside them; four levels up they would take 16 times.
  EXPECT_LT(counts.blocks_visited, 10 * coarsest.blocks);
  EXPECT_NEAR(counts.cell, 0.5 * kLattice.cell, 1e-15);
}

TEST(MeshLimits, TellOfAnErrorOutOfReachWhatItsMeshWouldWhereThatIsSoon) {
  Pieces pieces = row_of_balls(8);
  const Pieces::Input in = pieces.input();
  const auto refusal = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const Error& refused) {
      return refused.what();
    }
    return {};
  };
  for (const double largest : {1e-9, 1e-3}) {
    const std::string of_meshes =
        refusal([&] { (void)polygonise_partition_within(in.view, kLattice, {.largest = largest}, Executor(1)); });
    EXPECT_EQ(of_meshes.empty(), largest > 1e-9);
    EXPECT_EQ(refusal([&] { expect_divisible_within(in.view, kLattice, {.largest = largest}, Executor(1), 10'000); }), of_meshes);
    EXPECT_EQ(refusal([&] { expect_divisible_within(in.view, kLattice, {.largest = largest}, Executor(1), 10); }), "");
  }
}

TEST(PartitionErrorMesher, BeginsAnewOnAnotherLatticeAndAfterARefusal) {
  Pieces pieces = row_of_balls(3);
  const Pieces::Input in = pieces.input();
  PartitionErrorMesher mesher;
  for (const double cell : {0.1, 0.2, 0.14, 0.05, 0.1}) {
    for (const double largest : {0.004, 1e-9, 0.01}) {
      const Lattice coarsest{.origin = kLattice.origin, .cell = cell};
      if (largest == 1e-9) {
        EXPECT_THROW((void)mesher.make(in.view, in.version, coarsest, {.largest = largest}, Executor(1)), Error);
        continue;
      }
      PolygoniseCounts counts, fresh_counts;
      const std::vector<Mesh> fresh = polygonise_partition_within(in.view, coarsest, {.largest = largest}, Executor(1), &fresh_counts);
      expect_same(mesher.make(in.view, in.version, coarsest, {.largest = largest}, Executor(1), &counts), fresh);
      expect_same(counts, fresh_counts);
    }
  }
  EXPECT_TRUE(mesher.make({}, {}, kLattice, {.largest = 0.01}, Executor(1)).empty());
}

// A body that wins nowhere changes no mesh, but what the error of the other one is measured by.
TEST(PartitionErrorMesher, MeasuresAnewWhereANeighbourChangedAndTheMeshDidNot) {
  const FunctionField ball = sphere(Vec3::Zero(), 0.4);
  const auto within = [&](double share) {  // a field that takes this share of the ball's own, and its slope not
    return FunctionField{.function =
                             [=](const Vec3& p, Vec3& gradient) {
                               gradient = Vec3::Zero();
                               return share * (0.4 - p.norm()) - 1e-6;
                             },
                         .lipschitz = 1.0,
                         .box = ball.box};
  };
  const Lattice coarsest{.origin = kLattice.origin, .cell = 0.1};
  PartitionErrorMesher mesher;
  std::vector<double> cell;
  for (const double share : {0.9, 0.0}) {  // by the first, errors are a tenth
    const FunctionField other = within(share);
    const std::vector<FieldView> views{ball, other};
    const std::vector<std::uint64_t> version{0, 1 + cell.size()};
    PolygoniseCounts counts, fresh;
    const std::vector<Mesh> expected = polygonise_partition_within(views, coarsest, {.largest = 0.001}, Executor(1), &fresh);
    expect_same(mesher.make(views, version, coarsest, {.largest = 0.001}, Executor(1), &counts), expected);
    EXPECT_EQ(counts.cell, fresh.cell);
    cell.push_back(fresh.cell);
  }
  EXPECT_GT(cell[0], cell[1]);
}

}  // namespace
}  // namespace supple::implicit
