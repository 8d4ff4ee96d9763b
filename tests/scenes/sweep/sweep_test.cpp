#include "supple/scenes/sweep.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Texts = std::vector<std::string>;

template <class Body>
std::string message_of(const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

class Sweep : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    write("drops.yaml", std::string(small::kTwoDrops) + "title: Two drops\nduration: 0.5 s\n");
    write("chain.yaml", small::kUnstable);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string read(const fs::path& path) const {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  [[nodiscard]] SweepPlan plan(Texts set, std::string sample = {}, std::uint64_t seed = 1) const {
    return plan_sweep({.scene = folder_ / "drops.yaml", .set = std::move(set), .sample = std::move(sample), .seed = seed});
  }
  [[nodiscard]] fs::path planned(const Texts& set) const {
    write_plan(folder_ / "sweep", plan(set));
    return folder_ / "sweep";
  }
  [[nodiscard]] std::string error_of(const Texts& set, const std::string& sample = {}) const {
    return message_of([&] { (void)plan(set, sample); });
  }

  fs::path folder_;
};

const std::string kMass = "objects.left.particles.mass";
const std::string kModulus = "objects.left.contact.modulus";

TEST_F(Sweep, HasAllCombinationsTheLastKeyFastest) {
  const SweepPlan made = plan({kMass + "=[0.5, 1]", "title=A title", kModulus + "=1e3:1e5:log3"});
  EXPECT_EQ(made.parameters, (Texts{kMass, kModulus}));
  ASSERT_EQ(made.points.size(), 6u);
  EXPECT_EQ(made.points[0].set, (Texts{kMass + "=0.5", "title=A title", kModulus + "=1000"}));
  EXPECT_EQ(made.points[1].set, (Texts{kMass + "=0.5", "title=A title", kModulus + "=10000"}));
  EXPECT_EQ(made.points[3].set, (Texts{kMass + "=1", "title=A title", kModulus + "=1000"}));
  EXPECT_EQ(made.points[5].number, 6);
  EXPECT_EQ(made.points[5].folder, "point_0006");
}

TEST_F(Sweep, HasThePlanThatWasWritten) {
  const SweepPlan made = plan({kMass + "=0.5:1:log", kModulus + "=[1e3, 2 kPa]"}, "lhs:5", 7);
  write_plan(folder_ / "sweep", made);
  const SweepPlan same = read_plan(folder_ / "sweep");
  EXPECT_EQ(same.scene, fs::absolute(folder_ / "drops.yaml").lexically_normal());
  EXPECT_EQ(same.parameters, made.parameters);
  EXPECT_EQ(same.sample, "lhs:5");
  EXPECT_EQ(same.seed, 7u);
  ASSERT_EQ(same.points.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(same.points[i].number, made.points[i].number);
    EXPECT_EQ(same.points[i].folder, made.points[i].folder);
    EXPECT_EQ(same.points[i].set, made.points[i].set);
  }
  write_plan(folder_ / "sweep", plan({kMass + "=0.5:1:log", kModulus + "=[1e3, 2 kPa]"}, "lhs:5", 7));  // the same plan again
  const SweepPlan other = plan({kMass + "=0.5:1:log", kModulus + "=[1e3, 2 kPa]"}, "lhs:5", 8);
  EXPECT_NE(other.points[0].set, made.points[0].set);
  EXPECT_EQ(message_of([&] { write_plan(folder_ / "sweep", other); }),
            (folder_ / "sweep/sweep.json").string() + ": expected the plan of this sweep, found another one; choose another --out, or --overwrite to replace it; points of the same scene and values are kept");
  write_plan(folder_ / "sweep", other, true);
  EXPECT_EQ(read_plan(folder_ / "sweep").seed, 8u);
}

TEST_F(Sweep, OfALatinHypercubeUsesEveryPartOfARangeOnce) {
  constexpr int kCount = 40;
  const SweepPlan made = plan({kMass + "=1:3", "frame_rate=10:1000:log"}, "lhs:" + std::to_string(kCount));
  std::set<int> mass, rate;
  double product = 0.0;
  for (const SweepPoint& point : made.points) {
    const double m = (std::stod(point.set[0].substr(point.set[0].find('=') + 1)) - 1.0) / 2.0;
    const double r = std::log10(std::stod(point.set[1].substr(point.set[1].find('=') + 1)) / 10.0) / 2.0;
    mass.insert(static_cast<int>(m * kCount));
    rate.insert(static_cast<int>(r * kCount));
    product += (m - 0.5) * (r - 0.5) / kCount;
  }
  EXPECT_EQ(mass.size(), static_cast<std::size_t>(kCount));
  EXPECT_EQ(rate.size(), static_cast<std::size_t>(kCount));
  EXPECT_LT(std::abs(product), 4.0 / 12.0 / std::sqrt(kCount));  // four standard deviations of independent orders
}

TEST_F(Sweep, AtRandomStaysInItsRanges) {
  const SweepPlan made = plan({kMass + "=1:3", kModulus + "=[1e3, 1e4]", "title=one"}, "random:100");
  ASSERT_EQ(made.points.size(), 100u);
  std::set<std::string> moduli;
  for (const SweepPoint& point : made.points) {
    const double m = std::stod(point.set[0].substr(point.set[0].find('=') + 1));
    EXPECT_TRUE(m >= 1.0 && m < 3.0) << m;
    moduli.insert(point.set[1]);
    EXPECT_EQ(point.set[2], "title=one");
  }
  EXPECT_EQ(moduli, (std::set<std::string>{kModulus + "=1e3", kModulus + "=1e4"}));
  EXPECT_EQ(made.points[7].set, plan({kMass + "=1:3", kModulus + "=[1e3, 1e4]", "title=one"}, "random:100").points[7].set);
}

TEST_F(Sweep, IsRefusedBeforeItsFirstRun) {
  EXPECT_NE(error_of({"objects.left.contact.modulsu=1:2:3"}).find("unknown key; did you mean 'modulus'?"), std::string::npos) << error_of({"objects.left.contact.modulsu=1:2:3"});
  EXPECT_NE(error_of({kMass + "=[1, -2]"}).find("expected a mass > 0"), std::string::npos) << error_of({kMass + "=[1, -2]"});
  EXPECT_EQ(error_of({kMass + "=2"}).find("--set: expected a key with several values, found none"), 0u);
  EXPECT_EQ(error_of({kMass + "=[1, 2]", kMass + "=3"}), "--set " + kMass + ": expected each key once, found it twice; a list has all values: " + kMass + "=[x, y]");
  EXPECT_EQ(error_of({kMass + "=1:2"}), "--set " + kMass + ": expected a number of values, as in a:b:N or a:b:logN, found a range; --sample random:N or --sample lhs:N draws values from ranges");
  EXPECT_EQ(error_of({kMass + "=1:2:3"}, "lhs:3"),
            "--set " + kMass + ": expected a range a:b or a:b:log, or a list, for samples, found a number of values; leave out the number, or --sample for the grid of all values");
  EXPECT_EQ(error_of({kMass + "=1:2"}, "lsh:3"), "--sample: expected random:N or lhs:N with N from 1 to 100000, found 'lsh:3'; lhs is a Latin hypercube: each key's range is used evenly");
  EXPECT_EQ(error_of({kMass + "=1:2"}, "lhs:"), "--sample: expected random:N or lhs:N with N from 1 to 100000, found 'lhs:'; lhs is a Latin hypercube: each key's range is used evenly");
  EXPECT_EQ(error_of({kMass + "=1:2:1000", kModulus + "=1:2:101"}), "--set: expected at most 100000 points, found more; draw some of them: --sample lhs:N with ranges a:b");
}

TEST_F(Sweep, IsReadFromItsFolderOnly) {
  EXPECT_EQ(message_of([&] { (void)read_plan(folder_); }),
            (folder_ / "sweep.json").string() + ": expected the plan of a sweep, found no such file; supple sweep SCENE --set KEY=VALUES --out DIR --plan-only writes it");
  write("sweep.json", "{\"sweep\": 1}");
  EXPECT_NE(message_of([&] { (void)read_plan(folder_); }).find("found another text"), std::string::npos);
  write("sweep.json", "{\"sweep\": 2}");
  EXPECT_NE(message_of([&] { (void)read_plan(folder_); }).find("found one of another version of supple"), std::string::npos);
}

TEST_F(Sweep, RunsAPointOnce) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  const SweepRow first = run_point(sweep, 2);
  EXPECT_EQ(first.outcome, "done");
  EXPECT_FALSE(first.kept);
  const std::string row = read(sweep / "point_0002/row.json");
  const auto when = fs::last_write_time(sweep / "point_0002/result.json");
  EXPECT_TRUE(run_point(sweep, 2).kept);
  EXPECT_EQ(read(sweep / "point_0002/row.json"), row);
  EXPECT_EQ(fs::last_write_time(sweep / "point_0002/result.json"), when);
  write("drops.yaml", std::string(small::kTwoDrops) + "title: Two drops\nduration: 0.25 s\n");  // another scene
  EXPECT_FALSE(run_point(sweep, 2).kept);
  EXPECT_NE(read(sweep / "point_0002/row.json"), row);
  EXPECT_EQ(message_of([&] { (void)run_point(sweep, 3); }), "--point: expected a point from 1 to 2, found 3; " + (sweep / "sweep.json").string() + " lists them");
}

TEST_F(Sweep, GoesOnWithAPointThatWasBrokenOff) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  const std::string whole = run_point(sweep, 1).outcome == "done" ? read(sweep / "point_0001/row.json") : "";
  // As a kill leaves it: an unfinished row, the first states, no report.
  nlohmann::ordered_json row = nlohmann::ordered_json::parse(whole);
  row["outcome"] = "unfinished";
  row["values"] = nlohmann::ordered_json::object();
  std::ofstream(sweep / "point_0001/row.json") << row.dump();
  fs::remove(sweep / "point_0001/result.json");
  for (const int frame : {4, 5}) fs::remove(sweep / "point_0001/states" / ("drops.000" + std::to_string(frame) + ".state"));
  const auto kept = fs::last_write_time(sweep / "point_0001/states/drops.0002.state");
  EXPECT_EQ(run_point(sweep, 1).outcome, "done");
  EXPECT_EQ(read(sweep / "point_0001/row.json"), whole);
  EXPECT_EQ(fs::last_write_time(sweep / "point_0001/states/drops.0002.state"), kept);
}

TEST_F(Sweep, KeepsFailedPointsAsRows) {
  write_plan(folder_ / "sweep", plan_sweep({.scene = folder_ / "chain.yaml", .set = {"objects.chain.interactions[0].stretch=[1e6, 1]"}}));
  EXPECT_EQ(run_point(folder_ / "sweep", 1).outcome, "diverged");
  EXPECT_EQ(run_point(folder_ / "sweep", 1).kept, true);
  const std::string table = read(collect_sweep(folder_ / "sweep"));
  EXPECT_EQ(table.find("point,objects.chain.interactions[0].stretch,outcome,reason\n1,1e6,diverged,"), 0u) << table;
  EXPECT_NE(table.find("\n2,1,missing,\n"), std::string::npos) << table;
}

TEST_F(Sweep, KeepsPointsAsRowsWhoseSceneCannotBeReadAnyMore) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  write("drops.yaml", "schema: 1\nobjetcs: []\n");
  const SweepRow row = run_point(sweep, 1);
  EXPECT_EQ(row.outcome, "invalid");
  EXPECT_EQ(row.exit_code, 3);
  EXPECT_TRUE(run_point(sweep, 1).kept);
}

TEST_F(Sweep, TriesAgainWhatATimeLimitEnded) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  EXPECT_EQ(run_point(sweep, 1, {.time_limit = 1e-9}).outcome, "limit");
  EXPECT_EQ(run_point(sweep, 1).outcome, "done");
}

TEST_F(Sweep, WritesTableCellsAsNumbersWithoutUnits) {
  const fs::path sweep = planned({kMass + "=[500 g, 1]", "title=[\"a, \\\"b\\\"\", c]"});
  const std::string table = read(collect_sweep(sweep));
  EXPECT_EQ(table,
            "point," + kMass + ",title,outcome,reason\n"
            "1,0.5,\"a, \"\"b\"\"\",missing,\n2,0.5,c,missing,\n3,1,\"a, \"\"b\"\"\",missing,\n4,1,c,missing,\n");
}

TEST_F(Sweep, MakesRowsOfProcessesThatCrash) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  const std::vector<SweepRow> rows = run_sweep(sweep, {.jobs = 2, .command = {"/bin/sh", "-c", "echo on its way >&2; kill -9 $$"}});
  ASSERT_EQ(rows.size(), 2u);
  for (const SweepRow& row : rows) {
    EXPECT_EQ(row.outcome, "crashed");
    EXPECT_EQ(row.exit_code, 137);
    EXPECT_EQ(row.reason, "its process was ended by signal 9: on its way");
  }
  EXPECT_EQ(run_point(sweep, 1).outcome, "done");  // a crash is tried again
  EXPECT_NE(read(collect_sweep(sweep)).find("\n2,1,crashed,"), std::string::npos);
  EXPECT_EQ(message_of([&] { (void)run_sweep(sweep, {.command = {"/none/supple"}}); }), "/none/supple: cannot be started: No such file or directory");
}

TEST_F(Sweep, EndsWhenItIsInterrupted) {
  const fs::path sweep = planned({kMass + "=[0.5, 1]"});
  const std::atomic<int> interrupt{2};
  EXPECT_THROW((void)run_sweep(sweep, {.command = {"/bin/sh", "-c", "sleep 60"}, .interrupt = &interrupt}), Interrupted);
}

}  // namespace
}  // namespace supple::scenes
