// What moved primitives do not reach is kept from mesh to mesh, whatever the field: the mesh is that of a fresh mesher, bit by bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/implicit/convolution.h"
#include "supple/implicit/creases.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/volume.h"

namespace supple::implicit {
namespace {

using namespace testing;

Lattice lattice_of(double cell) { return {.origin = Vec3(0.013, -0.007, 0.004), .cell = cell}; }

/// Edges between some of the nodes, with weights of 0, 1 and between.
void link(Body& body, Random& random) {
  Blend& blend = body.skeleton.blend;
  blend.edge.clear();
  std::uint32_t nodes = body.skeleton.part_count;
  if (!blend.node.empty()) nodes = *std::max_element(blend.node.begin(), blend.node.end()) + 1;
  for (std::uint32_t a = 0; a < nodes; ++a) {
    for (std::uint32_t b = a + 1; b < nodes; ++b) {
      if (random.below(3) == 0) blend.edge.push_back({a, b, random.below(2) == 0 ? 1.0 : random.uniform(0.0, 1.0)});
    }
  }
}

/// Of all shapes and kernels, some of them convolved.
Body mixed_body(std::uint64_t seed, BlendRule rule, std::uint32_t parts) {
  Random random(300 + seed);
  const double radius = parts > 64 ? 0.22 : 0.4;
  Body body = random_body({.seed = seed, .parts = parts, .half_width = 0.8, .least_radius = 0.7 * radius, .largest_radius = radius, .every_shape = true});
  for (Primitive& p : body.skeleton.primitive) {
    const bool can = p.shape == ShapeKind::Segment || p.shape == ShapeKind::Triangle || p.shape == ShapeKind::Arc;
    if (can && convolves(p.kernel.kind) && random.below(2) == 0) {
      p.taper = 1.0;
      p.convolved = true;
    }
  }
  Blend& blend = body.skeleton.blend;
  blend.rule = rule;
  if (random.below(2) == 0) {  // groups
    for (std::uint32_t k = 0; k < parts; ++k) blend.node.push_back(k % (1 + parts / 3));
  }
  if (rule == BlendRule::Graph) link(body, random);
  body.place();
  return body;
}

/// Changes a body in a way of its own for each round, and says how.
std::string change(Body& body, std::uint32_t round, Random& random) {
  Skeleton& skeleton = body.skeleton;
  const auto any = [&] { return random.below(static_cast<std::uint32_t>(body.parts.size())); };
  const std::uint32_t some = any();
  switch (round) {
    case 0: return "nothing";
    case 1: body.parts[some].position += random.in_box(0.01); return "one moved a little";
    case 2: body.parts[some].orientation = random.rotation(); return "one turned";
    case 3: body.parts[some].position = Vec3(2.1, 0.3, -0.2); return "one left the others";
    case 4: body.parts[some].position = random.in_box(0.6); return "one moved far";
    case 5: skeleton.primitive[some] = scaled(skeleton.primitive[some], 0.8); return "one shrank";
    case 6: {
      skeleton.primitive.push_back(skeleton.primitive[some]);
      skeleton.primitive.back().part = skeleton.part_count++;
      body.parts.push_back({random.in_box(0.7), random.rotation()});
      if (!skeleton.blend.node.empty()) skeleton.blend.node.push_back(skeleton.blend.node[some]);
      return "one more";
    }
    case 7:
      for (int k = 0; k < 3; ++k) body.parts[any()].position += random.in_box(0.1);
      return "some moved";
    case 8: skeleton.iso = 0.44; return "another iso value";
    case 9: {
      body.parts.pop_back();
      skeleton.primitive.pop_back();
      --skeleton.part_count;
      if (!skeleton.blend.node.empty()) skeleton.blend.node.pop_back();
      return "one fewer";
    }
    case 10: body.parts[some].position += random.in_box(0.05); return "one moved";
    case 11:
      if (skeleton.blend.rule == BlendRule::Graph) link(body, random);
      skeleton.blend.exponent = 3.0;
      skeleton.blend.opening = 0.4;
      return "another blend";
    case 12: skeleton.primitive[some].kernel = Kernel::murakami(skeleton.primitive[some].kernel.radius); return "another kernel of that radius";
    case 13:
      for (Pose& part : body.parts) part.position += random.in_box(0.01);
      return "all moved";
    default: body.parts[some].position += random.in_box(0.3); return "one moved";
  }
}
constexpr std::uint32_t kRounds = 15;

class KeptMesh : public ::testing::TestWithParam<std::tuple<BlendRule, int, std::uint32_t>> {};

TEST_P(KeptMesh, IsThatOfAFreshMesherWhateverMoves) {
  const auto [rule, threads, parts] = GetParam();
  for (std::uint64_t seed = 0; seed < (parts > 64 ? 1 : 2); ++seed) {
    Random random(40 + seed);
    Body body = mixed_body(seed, rule, parts);
    const MarchOptions options{.lattice = lattice_of(parts > 64 ? 0.07 : 0.08)};
    CubeMesher mesher;
    const Executor executor(threads);
    for (std::uint32_t round = 0; round < kRounds; ++round) {
      const std::string what = change(body, round, random);
      body.place();
      const Mesh& kept = mesher.make(body.field, options, executor);
      body.field.set_culling(round % 2 == 0);
      EXPECT_EQ(hash_of(kept), hash_of(march_cubes(body.field, options, Executor(1)))) << seed << ": " << what;
      body.field.set_culling(true);
      EXPECT_GT(kept.triangle_count(), 300u);
    }
  }
}
constexpr std::array kRules{BlendRule::Sum, BlendRule::Graph, BlendRule::Ricci, BlendRule::Gradient};
// Up to 64 primitives are scanned, more are sought in a hierarchy.
INSTANTIATE_TEST_SUITE_P(Few, KeptMesh, ::testing::Combine(::testing::ValuesIn(kRules), ::testing::Values(1, 2), ::testing::Values(12u)));
INSTANTIATE_TEST_SUITE_P(Many, KeptMesh, ::testing::Combine(::testing::ValuesIn(kRules), ::testing::Values(2), ::testing::Values(70u)));

TEST(KeptMeshes, WithCreasesAreThoseOfAFreshMesherWhateverMoves) {
  for (const auto& [threads, parts] : {std::pair{1, 12u}, std::pair{2, 70u}}) {
    Random random(70);
    Body body = mixed_body(3, BlendRule::Graph, parts);
    const MarchOptions options{.lattice = lattice_of(0.09)};
    CreaseMesher mesher;
    const Executor executor(threads);
    for (std::uint32_t round = 0; round < kRounds; ++round) {
      const std::string what = change(body, round, random);
      body.place();
      const Mesh& kept = mesher.make(body.field, options, executor);
      EXPECT_EQ(hash_of(kept), hash_of(march_creases(body.field, options, Executor(1)))) << parts << ": " << what;
      EXPECT_GT(kept.vertex_count(), march_cubes(body.field, options, Executor(1)).vertex_count());
    }
  }
}

/// What a mesher makes to an error, or what it says where it makes nothing.
template <class Mesher>
std::string within_error(Mesher& mesher, const Body& body, double error, const Executor& executor, MarchCounts* counts = nullptr) {
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  try {
    const Mesh& mesh = mesher.make(body.field, {.lattice = lattice_of(0.0), .error = error}, executor, &count);
    return to_hex(hash_of(mesh)) + ' ' + std::to_string(count.cell) + ' ' + std::to_string(count.refinements) + ' ' + std::to_string(1e9 * count.error);
  } catch (const Error& refused) {
    return refused.what();
  }
}

/// Meshes of a body that changes, to an error that does, too, and is out of reach once.
template <class Mesher>
void expect_fresh_to_an_error(Body body, double error, const Executor& executor) {
  Random random(43);
  Mesher mesher;
  for (std::uint32_t round = 0; round < kRounds; ++round) {
    const std::string what = change(body, round, random);
    body.place();
    const double wanted = round == 3 ? 1e-12 : round % 4 == 2 ? 0.4 * error : error;
    Mesher fresh;
    EXPECT_EQ(within_error(mesher, body, wanted, executor), within_error(fresh, body, wanted, Executor(1))) << round << ": " << what;
  }
}

class KeptMeshToAnError : public ::testing::TestWithParam<std::tuple<BlendRule, int>> {};

TEST_P(KeptMeshToAnError, IsThatOfAFreshMesherWhateverMoves) {
  const auto [rule, threads] = GetParam();
  expect_fresh_to_an_error<CubeMesher>(mixed_body(1, rule, 12), 0.03, Executor(threads));
}
INSTANTIATE_TEST_SUITE_P(Rules, KeptMeshToAnError,
                         ::testing::Values(std::tuple{BlendRule::Sum, 1}, std::tuple{BlendRule::Sum, 2}, std::tuple{BlendRule::Graph, 2},
                                           std::tuple{BlendRule::Ricci, 2}, std::tuple{BlendRule::Gradient, 1}));

TEST(KeptMeshes, OfPointsToAnErrorAreThoseOfAFreshMesher) {
  for (const int threads : {1, 2}) {
    Body body = random_body({.seed = 5, .parts = 12, .half_width = 0.8, .least_radius = 0.35, .largest_radius = 0.5, .only_points = true});
    expect_fresh_to_an_error<CubeMesher>(std::move(body), 0.003, Executor(threads));
  }
}

TEST(KeptMeshes, WithCreasesToAnErrorAreThoseOfAFreshMesher) {
  for (const int threads : {1, 2}) expect_fresh_to_an_error<CreaseMesher>(mixed_body(3, BlendRule::Graph, 12), 0.04, Executor(threads));
}

// Values are sums of few primitives: those of other places, signs and roots are kept.
TEST(KeptMeshes, SampleOnlyWhatMovedPrimitivesReach) {
  for (const BlendRule rule : kRules) {
    Body body = random_body({.seed = 3, .parts = 300, .half_width = 1.5, .least_radius = 0.2, .largest_radius = 0.3});
    body.skeleton.blend.rule = rule;
    body.place();
    const MarchOptions options{.lattice = lattice_of(0.08)};
    CubeMesher mesher;
    MarchCounts all, counts;
    (void)mesher.make(body.field, options, Executor(1), &all);
    EXPECT_FALSE(all.single_precision);
    EXPECT_GT(all.bytes, 0u);
    (void)mesher.make(body.field, options, Executor(1), &counts);
    EXPECT_EQ(counts.tiles_sampled, 0u);
    EXPECT_EQ(counts.tiles, all.tiles);
    Random random(9);
    for (int round = 0; round < 4; ++round) {
      body.parts[random.below(300)].position += random.in_box(0.03);
      body.place();
      const Mesh& kept = mesher.make(body.field, options, Executor(1), &counts);
      EXPECT_GT(counts.tiles_sampled, 0u);
      EXPECT_LT(counts.tiles_sampled, all.tiles_sampled / 20);
      EXPECT_EQ(hash_of(kept), hash_of(march_cubes(body.field, options, Executor(1))));
    }
    mesher.forget();
    (void)mesher.make(body.field, options, Executor(1), &counts);
    EXPECT_EQ(counts.tiles_sampled, all.tiles_sampled);
  }
}

// Leaves within a ball hold no values: their signs must follow it, from inside to outside and back at once.
TEST(KeptMeshes, FollowABallThatJumps) {
  std::vector<std::pair<Primitive, Vec3>> balls;
  for (int i = 0; i < 3; ++i) balls.emplace_back(wyvill_point(0.8), Vec3(1.2 * i, 0, 0));
  for (auto& [ball, place] : balls) ball.kernel = Kernel::soft_object(0.8);
  Body body = body_of(balls);
  const MarchOptions options{.lattice = lattice_of(0.02)};
  CubeMesher mesher;
  (void)mesher.make(body.field, options, Executor(1));
  for (const Vec3& place : {Vec3(0.3, 1.5, 0.2), Vec3(0.4, 0.1, 0.0), Vec3(-2.0, -1.0, 0.6), Vec3(0.0, 0.0, 0.0)}) {
    body.parts[0].position = place;
    body.place();
    EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(1))), hash_of(march_cubes(body.field, options, Executor(1))));
  }
}

/// Rows of balls that unite where they touch.
Body rows_of_balls() {
  std::vector<std::pair<Primitive, Vec3>> balls;
  for (int i = 0; i < 12; ++i) {
    for (int j = 0; j < 3; ++j) balls.emplace_back(wyvill_point(0.5), Vec3(0.35 * i, 0.35 * j, 0.03 * ((i + j) % 3)));
  }
  Body body = body_of(balls);
  body.skeleton.blend.rule = BlendRule::Graph;
  body.place();
  return body;
}

// Points of creases are kept beside one ball after the other that moves, to the last bit: also those that only a step of their search
// brings near it.
TEST(KeptMeshes, WithCreasesFollowOneBallAfterTheOther) {
  Body body = rows_of_balls();
  const MarchOptions options{.lattice = lattice_of(0.03)};
  CreaseMesher mesher;
  MarchCounts all, counts;
  (void)mesher.make(body.field, options, Executor(2), &all);
  (void)mesher.make(body.field, options, Executor(2), &counts);
  EXPECT_EQ(counts.tiles_sampled, 0u);
  EXPECT_GT(all.bytes, 0u);
  Random random(4);
  for (std::size_t i = 0; i < body.parts.size(); i += 3) {
    body.parts[i].position += random.in_box(i % 2 == 0 ? 0.005 : 0.06);
    body.place();
    const Mesh& kept = mesher.make(body.field, options, Executor(2), &counts);
    EXPECT_LT(counts.tiles_sampled, all.tiles_sampled / 4);
    EXPECT_EQ(hash_of(kept), hash_of(march_creases(body.field, options, Executor(1)))) << i;
  }
  // Meshes to an error between them change nothing.
  const MarchOptions within{.lattice = {.origin = options.lattice.origin, .cell = 0.0}, .error = 0.02};
  EXPECT_EQ(hash_of(mesher.make(body.field, within, Executor(2))), hash_of(march_creases(body.field, within, Executor(1))));
  EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(2))), hash_of(march_creases(body.field, options, Executor(1))));
}

// Refined, the coarser meshes are held besides the finest.
TEST(KeptMeshes, CountWhatRefinementsHold) {
  const Body body = random_body({.seed = 3, .parts = 12, .half_width = 0.8});
  std::uint64_t coarser = 0, unrefined = 0;
  for (const int refinements : {0, 1, 2}) {
    CubeMesher mesher;
    MarchCounts counts;
    const Mesh& mesh = mesher.make(body.field, {.lattice = lattice_of(0.08), .refinements = refinements}, Executor(1), &counts);
    if (refinements == 0) unrefined = counts.bytes;
    EXPECT_GE(counts.bytes, unrefined + coarser) << refinements;
    coarser += mesh.vertex_count() * 2 * sizeof(Vec3) + mesh.triangle_count() * sizeof(mesh.triangle[0]);
  }
}

/// Balls and shapes that meet at every angle, so that creases stay cut off in some cells of this size.
constexpr double kBluntCell = 0.07;
Body steep_body(std::uint64_t seed, std::uint32_t parts) {
  Body body = random_body({.seed = seed, .parts = parts, .half_width = parts > 64 ? 1.0 : 0.6});
  body.skeleton.blend.rule = BlendRule::Graph;
  Random random(seed);
  link(body, random);
  body.place();
  return body;
}

// Meshes of fields that stay are as they were, also after others to an error, whose errors are known or not.
TEST(KeptMeshes, WithCreasesThatStay) {
  std::uint64_t blunt = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Body body = steep_body(seed, 10);
    const MarchOptions fixed{.lattice = lattice_of(kBluntCell)}, within{.lattice = fixed.lattice, .error = 0.5 * kBluntCell};
    CreaseMesher mesher;
    const auto expect_fresh = [&](const MarchOptions& options) {
      MarchCounts counts, expected;
      const std::uint64_t kept = hash_of(mesher.make(body.field, options, Executor(2), &counts));
      EXPECT_EQ(kept, hash_of(march_creases(body.field, options, Executor(1), &expected))) << seed;
      EXPECT_EQ(counts.blunt_cells, expected.blunt_cells) << seed;
      EXPECT_EQ(counts.error, expected.error) << seed;
      blunt += counts.blunt_cells;
    };
    for (int round = 0; round < 2; ++round) {
      for (const MarchOptions& options : {fixed, within}) {
        for (int call = 0; call < 3; ++call) expect_fresh(options);
      }
      body.parts[seed % body.parts.size()].position += Vec3(0.004, -0.003, 0.007);
      body.place();
    }
  }
  EXPECT_GT(blunt, 0u);
}

/// Calls use(body, mesher of its kind, which keeps at most so much) for bodies of every kind of sampler and mesher.
template <class Use>
void for_kinds(const Use& use) {
  Body points = random_body({.seed = 5, .parts = 60, .half_width = 1.0, .least_radius = 0.25, .largest_radius = 0.3, .only_points = true});
  use(points, [](auto... most) { return CubeMesher(most...); });
  Body shapes = random_body({.seed = 3, .parts = 60, .half_width = 1.0, .least_radius = 0.25, .largest_radius = 0.35});
  use(shapes, [](auto... most) { return CubeMesher(most...); });
  Body rows = rows_of_balls();
  use(rows, [](auto... most) { return CreaseMesher(most...); });
}

TEST(KeptMeshes, ToAnErrorAreMadeAnewOnlyWhereSomethingMoved) {
  constexpr double kError = 0.01;
  for_kinds([&](Body& body, const auto& mesher_of) {
    auto mesher = mesher_of();
    MarchCounts all, counts;
    const std::string first = within_error(mesher, body, kError, Executor(1), &all);
    EXPECT_EQ(within_error(mesher, body, kError, Executor(1), &counts), first);
    EXPECT_EQ(counts.tiles_sampled, 0u);
    EXPECT_GT(counts.bytes, 0u);
    body.parts[7].position += Vec3(0.0005, 0.0, 0.0003);  // the same meshes are tried
    body.place();
    (void)within_error(mesher, body, kError, Executor(1), &counts);
    EXPECT_GT(counts.tiles_sampled, 0u);
    EXPECT_LT(counts.tiles_sampled, all.tiles_sampled / 2);
  });
}

TEST(KeptMeshes, ToAnErrorTakeNoMoreThanAllowed) {
  constexpr double kError = 0.01;
  for_kinds([&](Body& body, const auto& mesher_of) {
    auto mesher = mesher_of();
    MarchCounts all, counts;
    const std::string made = within_error(mesher, body, kError, Executor(1), &all);
    (void)within_error(mesher, body, kError, Executor(1), &counts);
    ASSERT_EQ(counts.tiles_sampled, 0u);
    const std::uint64_t most = mesher.kept_to_error() - 1;
    auto less = mesher_of(most), none = mesher_of(std::uint64_t{0});
    std::uint64_t sampled = 0;
    constexpr int kMore = 3;
    for (int round = 0; round < 1 + kMore; ++round) {
      EXPECT_EQ(within_error(less, body, kError, Executor(1), &counts), made);
      EXPECT_LE(less.kept_to_error(), most);
      if (round > 0) sampled += counts.tiles_sampled;
      EXPECT_EQ(within_error(none, body, kError, Executor(1), &counts), made);
      EXPECT_EQ(counts.bytes, 0u);
      EXPECT_GE(counts.tiles_sampled, all.tiles_sampled);
    }
    EXPECT_GT(sampled, 0u);  // the coarsest is made anew at times
    if (std::is_same_v<decltype(mesher), CreaseMesher>) {  // whose meshes have each a lattice of its own
      EXPECT_LT(sampled, all.tiles_sampled);
    }
  });
}

TEST(MeshLimits, TellOfAnErrorOutOfReachOfABodyWhatItsMeshWouldWhereThatIsSoon) {
  for_kinds([&](Body& body, const auto& mesher_of) {
    const auto told = [&](double error, std::uint64_t most) -> std::string {
      auto mesher = mesher_of();
      try {
        mesher.expect_error(body.field, {.lattice = lattice_of(0.0), .error = error}, Executor(1), most);
      } catch (const Error& refused) {
        return refused.what();
      }
      return {};
    };
    auto mesher = mesher_of();
    EXPECT_EQ(told(1e-12, 1'000'000'000), within_error(mesher, body, 1e-12, Executor(1)));
    EXPECT_EQ(told(1e-12, 100), "");
    EXPECT_EQ(told(0.05, 1'000'000'000), "");
  });
}

TEST(KeptMeshes, KeepRefinedVerticesWhereNothingMoved) {
  Body body = random_body({.seed = 3, .parts = 100, .half_width = 1.2, .least_radius = 0.25, .largest_radius = 0.35});
  for (const bool points : {false, true}) {
    if (points) body = random_body({.seed = 4, .parts = 100, .half_width = 1.2, .least_radius = 0.25, .largest_radius = 0.35, .only_points = true});
    CubeMesher mesher;
    Random random(5);
    for (int round = 0; round < 8; ++round) {
      const MarchOptions options{.lattice = lattice_of(0.08), .refinements = std::array{1, 2, 0}[static_cast<std::size_t>(round % 3 == 2 && round > 4 ? 2 : round / 3 % 2)]};
      if (round != 1) body.parts[random.below(100)].position += random.in_box(0.03);
      body.place();
      EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(2))), hash_of(march_cubes(body.field, options, Executor(1)))) << round;
    }
  }
}

// Where triangles would cross, edges stay straight: in one frame and not in the next, beside tiles that keep theirs.
TEST(KeptMeshes, KeepRefinedVerticesBesideEdgesThatStayStraight) {
  Body body = random_body({.seed = 1, .parts = 400, .least_radius = 0.15, .largest_radius = 0.4, .only_points = true});
  CubeMesher mesher;
  Random random(5);
  std::uint64_t least = ~std::uint64_t{0}, most = 0;
  for (int round = 0; round < 12; ++round) {
    const MarchOptions options{.lattice = lattice_of(0.2), .refinements = 1 + round / 6};
    for (int k = 0; k < 4; ++k) body.parts[random.below(400)].position += random.in_box(0.1);
    body.place();
    MarchCounts counts;
    EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(2), &counts)), hash_of(march_cubes(body.field, options, Executor(1)))) << round;
    least = std::min(least, counts.straight_edges);
    most = std::max(most, counts.straight_edges);
  }
  EXPECT_GT(least, 0u);
  EXPECT_GT(most, least);
}

// One mesher for a body of Wyvill points and another of capsules in turn, and on other lattices.
TEST(KeptMeshes, ForgetWhatIsOfAnotherBodyOrLattice) {
  const Body points = random_body({.seed = 1, .parts = 40, .only_points = true}), shapes = random_body({.seed = 2, .parts = 40});
  CubeMesher mesher;
  const auto expect_fresh = [&](const Body& body, double cell) {
    const MarchOptions options{.lattice = lattice_of(cell)};
    EXPECT_EQ(hash_of(mesher.make(body.field, options, Executor(1))), hash_of(march_cubes(body.field, options, Executor(1))));
  };
  for (int round = 0; round < 2; ++round) {
    expect_fresh(points, 0.08);
    expect_fresh(shapes, 0.08);
    expect_fresh(shapes, 0.1);
    expect_fresh(shapes, 0.08);
  }
  const Body none;
  expect_fresh(none, 0.08);
  expect_fresh(shapes, 0.08);
}

}  // namespace
}  // namespace supple::implicit
