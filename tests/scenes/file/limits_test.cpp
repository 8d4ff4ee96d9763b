#include "supple/scenes/limits.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/support.h"
#include "model/point_tree.h"
#include "supple/core/arrange.h"
#include "supple/core/interrupt.h"
#include "supple/scenes/check.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

Scene scene_of(const std::string& object, const std::string& rest = "") {
  return parse_scene("schema: 1\nduration: 0.1\nframe_rate: 10\n" + rest + "objects:\n  - name: a\n" + object, "limits.yaml", ".");
}

double counted(const SceneCounts& counts, Counted what) {
  double sum = 0.0;
  for (const Count& count : counts.count) sum += count.what == what ? count.number : 0.0;
  return sum;
}

/// A check that nothing breaks off, on machines of any speed.
CheckReport check_in_time(const Scene& scene, double memory = kCheckMemory) { return check_scene(scene, {}, memory, 3600.0); }

SceneCounts count_all(const Scene& scene) { return count_scene(scene, kDefaultMemory); }

/// The fault that a scene is refused with; empty where it is not.
Fault refusal(const Scene& scene, double memory) {
  try {
    expect_within(scene, count_scene(scene, memory), memory);
  } catch (const OverBudget& over) {
    EXPECT_EQ(over.kind(), ErrorKind::Limit);
    return over.faults().front();
  }
  return {};
}

TEST(SceneCounts, AreThoseOfTheModel) {
  const std::string laws = "    interactions:\n      - {law: bond_frame, neighbours: 7, stretch: 1, rotation: 1}\n      - {law: coplanarity, within: 0.35, strength: 1}\n"
                           "      - {law: friction, within: 0.25, linear: 1, angular: 1}\n";
  // So many particles that pairs are looked for, not taken for all.
  const Scene scene = scene_of("    particles: {arrange: grid, columns: 30, rows: 20, spacing: 0.2}\n" + laws + "    skeleton: [{shape: point, kernel: {radius: 0.3}}]\n");
  const SceneCounts counts = count_all(scene);
  const Model model = build_model(scene);
  EXPECT_EQ(counted(counts, Counted::Particles), static_cast<double>(model.particles.size()));
  EXPECT_EQ(counted(counts, Counted::Primitives), static_cast<double>(model.objects[0].skeleton.primitive.size()));
  EXPECT_EQ(counted(counts, Counted::Bonds),
            static_cast<double>(model.interactions.bond_frame.at(0).first.size() + model.interactions.coplanarity.at(0).first.size()));
  EXPECT_EQ(counted(counts, Counted::FrictionBonds), static_cast<double>(model.interactions.friction.at(0).first.size()));
}

TEST(SceneCounts, OfParticlesInAFileAreThoseOfGenerators) {
  const std::filesystem::path folder = temp_folder() / "counts";
  std::filesystem::create_directories(folder);
  {
    std::ofstream file(folder / "points.csv");
    for (int i = 0; i < 700; ++i) file << 0.2 * i << ",0,0\n";
  }
  const std::string object = "    interactions: [{law: bond_frame, within: 0.5, stretch: 1, rotation: 1}]\n";
  const std::string head = "schema: 1\nduration: 0.1\nobjects:\n  - name: a\n    particles: ";
  const SceneCounts by_file = count_all(parse_scene(head + "{arrange: file, file: points.csv}\n" + object, "f.yaml", folder));
  const SceneCounts made = count_all(parse_scene(head + "{arrange: line, count: 700, spacing: 0.2}\n" + object, "l.yaml", "."));
  for (const Counted what : {Counted::Particles, Counted::Bonds, Counted::Bodies}) EXPECT_EQ(counted(by_file, what), counted(made, what));
  EXPECT_EQ(counted(made, Counted::Bonds), 699.0 + 698.0);
}

TEST(SceneCounts, EstimateWhatIsFarTooMuch) {
  const Scene scene = scene_of("    particles: {arrange: grid, columns: 300, rows: 300, spacing: 0.2}\n    interactions: [{law: bond_frame, within: 1e9, stretch: 1, rotation: 1}]\n");
  const double pairs = 90000.0 * 89999.0 / 2.0;
  EXPECT_NEAR(counted(count_all(scene), Counted::Bonds), pairs, 0.01 * pairs);
  const Fault fault = refusal(scene, kDefaultMemory);
  EXPECT_EQ(fault.key, "objects.a.interactions[0].within");
  EXPECT_EQ(fault.found.rfind("about 40", 0), 0U) << fault.found;
}

TEST(SceneCounts, RefuseWhatTakesMost) {
  const Fault bonds = refusal(scene_of("    particles: {arrange: line, count: 100000, spacing: 0.2}\n    interactions: [{law: bond_frame, neighbours: 1000, stretch: 1, rotation: 1}]\n"),
                              kDefaultMemory);
  EXPECT_EQ(bonds.key, "objects.a.interactions[0].neighbours");
  EXPECT_EQ(bonds.found, "99499500");  // 1000 n - 1000 1001 / 2
  EXPECT_NE(bonds.hint.find("--memory 71.1G"), std::string::npos) << bonds.hint;
  const Fault bodies = refusal(scene_of("    particles: {arrange: line, count: 1000000, spacing: 0.2}\n    separate: true\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n"),
                               kDefaultMemory);
  EXPECT_EQ(bodies.key, "objects.a.separate");
  EXPECT_EQ(bodies.found, "1000000");
  const std::string grid = "    particles: {arrange: grid, columns: 300, rows: 100, spacing: 0.2";
  const std::string pushes = "}\n    repulsion: {force: 1, distance: 1e6, length: 1e5}\n";
  EXPECT_EQ(refusal(scene_of(grid + pushes + "  - name: b\n" + grid + ", at: [0, 0, 3]" + pushes), kDefaultMemory).key, "objects.a.repulsion");
}

TEST(SceneCounts, AllowWhatTheyAllowedBefore) {
  EXPECT_TRUE(refusal(scene_of("    particles: {arrange: line, count: 100000, spacing: 0.2}\n    interactions: [{law: bond_frame, neighbours: 2, stretch: 1, rotation: 1}]\n"),
                      kDefaultMemory).key.empty());
  EXPECT_TRUE(refusal(scene_of("    particles: {arrange: line, count: 100000, spacing: 2}\n    separate: true\n    contact: {}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n"),
                      kDefaultMemory).key.empty());
}

TEST(SceneCounts, HoldWhenAModelIsBuilt) {
  const Scene scene = scene_of("    particles: {arrange: line, count: 1000, spacing: 0.2}\n");
  EXPECT_THROW(static_cast<void>(build_model(scene, 1e5)), OverBudget);
  EXPECT_NO_THROW(static_cast<void>(build_model(scene, 1e6)));
}

TEST(SurfaceSamples, OfAFlatBodyAreCountedBeforeTheyAreMade) {
  const std::string flat = "    particles: {arrange: single}\n    skeleton: [{shape: ellipsoid, semi_axes: [9000, 4000, 40], kernel: {type: wyvill}}]\n    contact: {}\n";
  const Scene scene = scene_of(flat, "contact: {sample_spacing: 0.5}\nobstacles: [{name: o, shape: implicit, skeleton: [{shape: segment, half_length: 1, kernel: {radius: 1}},{shape: point, at: [0,2,0], kernel: {radius: 1}}]}]\n");
  try {
    static_cast<void>(build_model(scene));
    FAIL() << "billions of samples fit into no memory";
  } catch (const OverBudget& over) {
    EXPECT_EQ(over.faults().front().key, "contact.sample_spacing");
    EXPECT_GT(counted(over.counts(), Counted::Samples), 1e8);
  }
}

TEST(Check, CountsWhatItDoesNotBuild) {
  const Scene scene = scene_of("    particles: {arrange: spiral, count: 999999, inner_radius: 0.15, outer_radius: 0.55, turns: 1.2}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n");
  const CheckReport counted_only = check_in_time(scene);
  EXPECT_FALSE(counted_only.built);
  EXPECT_EQ(counted_only.particles, 999999U);
  ASSERT_EQ(counted_only.warnings.size(), 1U);
  EXPECT_EQ(counted_only.warnings[0].rfind("objects.a.skeleton: only the counts of the scene were checked: with 999999 primitives", 0), 0U) << counted_only.warnings[0];
  const Scene small = scene_of("    particles: {arrange: line, count: 10, spacing: 0.2}\n");
  EXPECT_TRUE(check_in_time(small).built);
  EXPECT_FALSE(check_in_time(small, 1e3).built);
}

TEST(Check, CountsBodiesThatBeginInOneAnotherByTheDozen) {
  const auto balls = [](const std::string& spacing) {
    return scene_of("    particles: {arrange: grid, columns: 5, rows: 5, layers: 4, spacing: " + spacing + "}\n    separate: true\n" +
                    "    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.075, thickness: 0.05, slope: 10}}]\n    contact: {}\n");
  };
  const CheckReport crowd = check_in_time(balls("1e-9"));
  EXPECT_FALSE(crowd.built);
  ASSERT_EQ(crowd.warnings.size(), 1U);
  EXPECT_EQ(crowd.warnings[0].rfind("objects.a.particles: the scene was counted, not built: about 4950 pairs of bodies overlap at the start, each with about 99 others", 0), 0U)
      << crowd.warnings[0];
  EXPECT_TRUE(check_in_time(balls("0.099")).built);  // as balls that touch
}

TEST(Check, IsBrokenOffAtItsLimitOfTimeAndByInterrupts) {
  const Scene scene = scene_of("    particles: {arrange: line, count: 1000, spacing: 0.2}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n    contact: {}\n", "ground: {height: -0.2}\n");
  EXPECT_TRUE(check_in_time(scene).built);
  const CheckReport late = check_scene(scene, {}, kCheckMemory, 1e-6);
  EXPECT_FALSE(late.built);
  ASSERT_EQ(late.warnings.size(), 1U);
  EXPECT_NE(late.warnings[0].find("more than the limits of a check, 1e-06 s of processor time and 200 MB of memory; --time-limit"), std::string::npos) << late.warnings[0];
  const std::atomic<int> signalled{2};
  EXPECT_THROW((void)check_scene(scene, {.interrupt = &signalled}, kCheckMemory, 600.0), Interrupted);
}

TEST(Bytes, AreReadAndShown) {
  EXPECT_EQ(parse_bytes("4G"), 4e9);
  EXPECT_EQ(parse_bytes("1.5 GB"), 1.5e9);
  EXPECT_EQ(parse_bytes("800M"), 8e8);
  EXPECT_EQ(parse_bytes("64k"), 64e3);
  EXPECT_EQ(parse_bytes("2T"), 2e12);
  EXPECT_EQ(parse_bytes("0.5"), 0.5e9);  // as without a unit
  EXPECT_EQ(parse_bytes("123B"), 123.0);
  for (const char* text : {"", "G", "-1G", "0", "nan", "inf", "4X", "4GG", "1e999G"}) EXPECT_TRUE(std::isnan(parse_bytes(text))) << text;
  EXPECT_EQ(bytes_text(8e9), "8 GB");
  EXPECT_EQ(bytes_text(2e8), "200 MB");
  EXPECT_EQ(bytes_text(1.54e3), "1.5 kB");
  EXPECT_EQ(bytes_text(12.0), "12 bytes");
}

class PointTrees : public ::testing::TestWithParam<int> {};

std::vector<Vec3> points_of(int kind) {
  core::test::Draw draw(31);
  std::vector<Vec3> points;
  switch (kind) {
    case 0: return core::arrange_geodesic(6, 2.0).position;  // every one has an opposite one
    case 1: return core::arrange_ring(200, 1.0, core::NormalDirection::Axis).position;
    case 2: return core::arrange_grid(9, 7, 0.3, 4).position;
    case 3: return std::vector<Vec3>(40, Vec3(1.0, 2.0, 3.0));
    case 4:
      for (int i = 0; i < 300; ++i) points.push_back(Vec3::Constant(1e6) + draw.vector(1.0));
      return points;
    default:
      for (int i = 0; i < 300; ++i) points.push_back(draw.vector(1.0).normalized() * (1.0 + 1e-9 * i) + Vec3(0.1, 0.0, 0.0));
      points.emplace_back(0.1, 0.0, 0.0);
      return points;
  }
}

TEST_P(PointTrees, FindTheNearestAndTheFarthestToTheBit) {
  const std::vector<Vec3> points = points_of(GetParam());
  const PointTree tree(points);
  const std::vector<double> nearest = tree.nearest_distances();
  double largest = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < points.size(); ++j) {
      if (i == j) continue;
      least = std::min(least, (points[j] - points[i]).squaredNorm());
      largest = std::max(largest, (points[i] - points[j]).norm());
    }
    EXPECT_EQ(nearest[i], std::sqrt(least)) << i;
  }
  EXPECT_EQ(tree.largest_distance(), largest);
}
INSTANTIATE_TEST_SUITE_P(Kinds, PointTrees, ::testing::Range(0, 6));

}  // namespace
}  // namespace supple::scenes
