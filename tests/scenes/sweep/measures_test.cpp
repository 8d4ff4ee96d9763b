#include "sweep/measures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include <nlohmann/json.hpp>

#include "supple/core/error.h"
#include "supple/scenes/sweep.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// Two balls that never meet: one flies at 2 m/s along y, one falls onto the floor and comes to rest there.
constexpr const char* kScene = R"(
schema: 1
duration: 2 s
frame_rate: 20
gravity: [0, 0, -9.81]
integrator: {method: backward_euler}
obstacles: [{name: floor, shape: plane, modulus: 1e12}]
objects:
  - name: flies
    particles: {arrange: line, count: 2, spacing: 0.5, at: [0, 0, 2], velocity: [0, 2, 0], mass: 0.5}
  - name: rests
    particles: {arrange: single, at: [0, 0, 0.0966], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e5, dissipation: 20}
)";

class Measures : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    std::ofstream(folder_ / "two.yaml") << kScene;
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] SweepPlan plan(const std::string& measures) const {
    std::ofstream(folder_ / "measures.yaml") << measures;
    return plan_sweep({.scene = folder_ / "two.yaml", .set = {"objects.flies.particles.mass=[0.5, 1]"}, .measures = folder_ / "measures.yaml"});
  }
  [[nodiscard]] ordered_json values_of(const std::string& measures) const {
    write_plan(folder_ / "sweep", plan(measures), true);
    const SweepRow row = run_point(folder_ / "sweep", 1);
    EXPECT_EQ(row.outcome, "done") << row.reason;
    std::ifstream file(folder_ / "sweep/point_0001/row.json");
    return ordered_json::parse(file)["values"];
  }
  [[nodiscard]] std::string error_of(const std::string& measures) const {
    try {
      (void)plan(measures);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Scene);
      std::string text = error.what();
      for (std::size_t at = text.find(folder_.string()); at != std::string::npos; at = text.find(folder_.string())) text.erase(at, folder_.string().size() + 1);
      return text;
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(Measures, ReduceTheTablesOfFrames) {
  const ordered_json values = values_of(R"(
far: {frames: objects, of: flies, column: y_m, reduce: final}
mean_y: {frames: objects, of: flies, column: y_m, reduce: mean}
travelled: {frames: objects, of: flies, column: vy_m_s, reduce: integral}
apart: {frames: particles, of: flies, column: x_m, across: max, reduce: max}
near: {frames: particles, of: flies, column: x_m, across: min, reduce: min}
both: {frames: particles, of: flies, column: mass_kg, across: sum, reduce: min}
when_fast: {frames: objects, of: flies, column: speed_m_s, reduce: peak_time}
fallen: {frames: energies, column: external_work_j, reduce: final}
)");
  EXPECT_NEAR(values["far"].get<double>(), 4.0, 1e-9);
  EXPECT_NEAR(values["mean_y"].get<double>(), 2.0, 1e-9);
  EXPECT_NEAR(values["travelled"].get<double>(), 4.0, 1e-9);
  EXPECT_NEAR(values["apart"].get<double>(), 0.25, 1e-9);
  EXPECT_NEAR(values["near"].get<double>(), -0.25, 1e-9);
  EXPECT_NEAR(values["both"].get<double>(), 1.0, 1e-12);
  EXPECT_NEAR(values["when_fast"].get<double>(), 2.0, 1e-9);  // it falls, ever faster
  EXPECT_GT(values["fallen"].get<double>(), 0.0);
  EXPECT_EQ(values.begin().key(), "far");
}

TEST_F(Measures, TakeTheContactOfAPair) {
  const ordered_json values = values_of(R"(
depth: {pair: [rests, floor], take: depth_at_rest}
touching: {pair: [floor, rests], take: contact_time}
load: {frames: contacts, pair: [rests, floor], column: force_a_n, reduce: final}
all: {frames: contacts, column: force_az_n, reduce: final}
none: {pair: [flies, floor], take: peak_force}
never: {pair: [flies, floor], take: restitution}
touches: {pair: [rests, floor], take: touches}
bounce: {pair: [rests, floor], take: restitution}
)");
  // pi g (a D^2 - 2 D^3 / 3) = weight
  const double depth = values["depth"].get<double>(), weight = 0.2 * 9.81;
  EXPECT_NEAR(std::numbers::pi * 5e5 * (0.1 * depth * depth - 2.0 / 3.0 * depth * depth * depth) / weight, 1.0, 1e-2);
  EXPECT_NEAR(values["touching"].get<double>(), 2.0, 0.05);
  EXPECT_NEAR(values["load"].get<double>() / weight, 1.0, 1e-2);
  EXPECT_NEAR(values["all"].get<double>() / weight, 1.0, 1e-2);
  EXPECT_EQ(values["none"].get<double>(), 0.0);
  EXPECT_TRUE(values["never"].is_null());
  EXPECT_EQ(values["touches"].get<int>(), 1);
  EXPECT_TRUE(values["bounce"].is_null());  // it lasts
}

TEST_F(Measures, HaveValuesOfTheReport) {
  const ordered_json values = values_of("e: {result: audits.energy_error}\nd: {result: objects.flies.diameter}\no: {result: outcome}\np: {result: 'pairs[0].a'}\nq: {result: 'pairs[3].a'}\n");
  EXPECT_TRUE(values["e"].is_number());
  EXPECT_NEAR(values["d"].get<double>(), 0.5, 1e-12);
  EXPECT_EQ(values["o"], "done");
  EXPECT_EQ(values["p"], "rests");
  EXPECT_TRUE(values["q"].is_null());
}

TEST_F(Measures, AreChosenWhereNoneAreGiven) {
  write_plan(folder_ / "sweep", plan_sweep({.scene = folder_ / "two.yaml", .set = {"objects.flies.particles.mass=[0.5, 1]"}}));
  ASSERT_EQ(run_point(folder_ / "sweep", 2).outcome, "done");
  std::ifstream table(collect_sweep(folder_ / "sweep"));
  std::string names;
  std::getline(table, names);
  EXPECT_EQ(names, "point,objects.flies.particles.mass,outcome,frames,state_hash,energy_error,rests-floor.touches,rests-floor.contact_time_s,rests-floor.peak_force_n,"
                   "rests-floor.largest_depth_m,rests-floor.restitution,reason");
}

TEST_F(Measures, AreRefusedBeforeTheFirstRun) {
  EXPECT_EQ(error_of("m: {pair: [rests, flor], take: peak_force}"),
            "measures.yaml:1:11: m.pair: expected objects or obstacles of the scene, found 'flor'; did you mean 'floor'? (known: flies, rests, floor)");
  EXPECT_NE(error_of("m: {pair: [rests, floor], take: peak_forse}").find("did you mean 'peak_force'?"), std::string::npos) << error_of("m: {pair: [rests, floor], take: peak_forse}");
  EXPECT_NE(error_of("m: {piar: [rests, floor], take: peak_force}").find("unknown key; did you mean 'pair'?"), std::string::npos) << error_of("m: {piar: [rests, floor], take: peak_force}");
  EXPECT_EQ(error_of("m: {frames: particles, of: flyes, column: x_m, reduce: max}"),
            "measures.yaml:1:28: m.of: expected an object of the scene, found 'flyes'; did you mean 'flies'? (known: flies, rests)");
  EXPECT_EQ(error_of("m: {frames: energies, column: kinetik_j, reduce: max}"),
            "measures.yaml:1:31: m.column: expected a column of energies, found 'kinetik_j'; did you mean 'kinetic_j'? (known: kinetic_j, interaction_j, contact_j, total_j, dissipated_j, ...)");
  EXPECT_NE(error_of("m: {result: audits.energy_eror}").find("m.result: expected a value of result.json, found 'audits.energy_eror'; did you mean 'energy_error'?"), std::string::npos);
  EXPECT_EQ(error_of("m: {result: audits}"), "measures.yaml:1:13: m.result: expected a single value of result.json, found several below 'audits'");
  EXPECT_NE(error_of("m: {take: peak_force}").find("m.take: expected a pair to take it of, found none; add pair: [A, B]"), std::string::npos) << error_of("m: {take: peak_force}");
  EXPECT_NE(error_of("m: {result: frames, take: peak_force, pair: [rests, floor]}").find("m: expected one of result, take (with pair) and frames, found several"), std::string::npos);
  EXPECT_NE(error_of("m: {}").find("expected one of result, take (with pair) and frames, found none"), std::string::npos) << error_of("m: {}");
  EXPECT_NE(error_of("m: {frames: energies, column: total_j}").find("m.frames: expected column and reduce with it, found neither, or one"), std::string::npos);
  EXPECT_NE(error_of("m: {pair: [rests, floor, flies], take: touches}").find("m.pair: expected two names, found another number"), std::string::npos);
  EXPECT_NE(error_of("m: {frames: energies, of: rests, column: total_j, reduce: max}").find("m.of: expected it with frames: objects or frames: particles"), std::string::npos);
  EXPECT_EQ(error_of("m: peak"), "measures.yaml:1:4: m: expected a mapping, found 'peak'; write {pair: [A, B], take: peak_force}, {frames: TABLE, column: C, reduce: max} or {result: PATH}");
  EXPECT_EQ(error_of("[1, 2]"), "measures.yaml:1:1: expected measures by name, found a list of 2; write NAME: {pair: [A, B], take: peak_force}");
  EXPECT_EQ(error_of(""), "measures.yaml:1:1: expected measures by name, found an empty file; write NAME: {pair: [A, B], take: peak_force}");
}

}  // namespace
}  // namespace supple::scenes
