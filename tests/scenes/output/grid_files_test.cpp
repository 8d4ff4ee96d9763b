#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "scenes/small_scenes.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/grid_file.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

const std::string kTwo = std::string(small::kTwoDrops) + R"(
duration: 0.5 s
output: {grid: vdb}
)";

class GridFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / "grid_files" / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    scene_ = parse_scene(kTwo, "drops.yaml", ".");
    scene_.source = "drops.yaml";
  }
  void TearDown() override { fs::remove_all(folder_); }
  RunOptions options() const { return {.folder = folder_, .threads = 1}; }

  fs::path folder_;
  Scene scene_;
};

TEST_F(GridFiles, AreObjectsOfTheSceneOrBoth) {
  const auto grids_of = [&](GriddedName of, GridContentName content) {
    scene_.output.gridding.of = of;
    scene_.output.gridding.content = content;
    RunOptions again = options();
    again.overwrite = true;
    EXPECT_EQ(run_scene(scene_, again).outcome, "done");
    return folder_ / "grids/drops.0001.vdb";
  };
  const fs::path objects = grids_of(GriddedName::Objects, GridContentName::Distance);
  EXPECT_LT(GridOfFile(objects, "left").interpolate(Vec3(-0.3, 0, 0)), 0.0);
  EXPECT_GT(GridOfFile(objects, "left").interpolate(Vec3(0.3, 0, 0)), 0.0);
  EXPECT_FALSE(GridOfFile(objects, "scene").found());
  const fs::path scene = grids_of(GriddedName::Scene, GridContentName::Distance);
  EXPECT_FALSE(GridOfFile(scene, "left").found());
  EXPECT_LT(GridOfFile(scene, "scene").interpolate(Vec3(-0.3, 0, 0)), 0.0);
  EXPECT_LT(GridOfFile(scene, "scene").interpolate(Vec3(0.3, 0, 0)), 0.0);
  const fs::path both = grids_of(GriddedName::Both, GridContentName::Field);
  EXPECT_GT(GridOfFile(both, "right").interpolate(Vec3(0.3, 0, 0)), 0.0);
  EXPECT_GT(GridOfFile(both, "scene").interpolate(Vec3(0.3, 0, 0)), 0.0);
}

TEST_F(GridFiles, AreReadByTheToolsOfOpenVdb) {
  ASSERT_EQ(std::system("command -v vdb_print >/dev/null 2>&1"), 0) << "install libopenvdb-tools";
  scene_.output.gridding.of = GriddedName::Both;
  scene_.output.cell = 0.05;
  RunOptions first = options();
  first.frames = {1};
  EXPECT_EQ(run_scene(scene_, first).outcome, "done");
  const fs::path report = folder_ / "report.txt";
  ASSERT_EQ(std::system(("vdb_print -l " + (folder_ / "grids/drops.0001.vdb").string() + " >" + report.string() + " 2>&1").c_str()), 0);
  std::ifstream file(report);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  for (const std::string word : {"Name: left", "Name: right", "Name: scene", "class: level set", "voxel size: 0.05"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in\n" << text;
  }
}

TEST_F(GridFiles, TellOfBulgesThatHoldTooLittle) {
  // Without a mesh, too.
  const std::string ball = ", mass: 1}\n    contact: {modulus: 1e4}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]\n";
  const auto told_by = [&](const std::string& width) {
    scene_ = parse_scene("schema: 1\nduration: 1e-3\nobjects:\n  - name: low\n    particles: {at: [0, 0, 0]" + ball +
                             "  - name: high\n    particles: {at: [0, 0.02, 0.165]" + ball + "contact: {bulge_volume: true, bulge_width: " + width +
                             "}\noutput: {grid: vdb, cell: 0.02}\n",
                         "balls.yaml", ".");
    scene_.source = "balls.yaml";
    scene_.output.gridding.of = GriddedName::Both;
    RunOptions again = options();
    again.overwrite = true;
    std::vector<std::string> told = run_scene(scene_, again).warnings;
    std::erase_if(told, [](const std::string& warning) { return !warning.starts_with("contact.bulge_volume: the bulge of "); });
    EXPECT_EQ(fs::exists(folder_ / "searches/balls.0001.json"), !told.empty());
    return told;
  };
  const std::vector<std::string> narrow = told_by("0.15");
  ASSERT_EQ(narrow.size(), 2u);
  EXPECT_NE(narrow[0].find(" and 1 in all frames hold too little"), std::string::npos) << narrow[0];
  EXPECT_TRUE(told_by("auto").empty());
}

TEST_F(GridFiles, OfBodiesThatTouchEndWhereTheyDo) {
  scene_.output.gridding.of = GriddedName::Both;
  scene_.output.cell = 0.02;
  for (ObjectDesc& object : scene_.objects) object.particles.at.x() = object.name == "left" ? -0.2 : 0.2;
  RunOptions first = options();
  first.frames = {1};
  EXPECT_EQ(run_scene(scene_, first).outcome, "done");
  const fs::path file = folder_ / "grids/drops.0001.vdb";
  const GridOfFile left(file, "left"), right(file, "right"), both(file, "scene");
  // In the plane between equal drops, whose undeformed surfaces lie 0.027 m beyond it, and to its sides.
  for (const double y : {-0.04, 0.0, 0.04}) {
    EXPECT_NEAR(left.interpolate(Vec3(0.0, y, 0.0)), 0.0, 1e-6);
    EXPECT_NEAR(right.interpolate(Vec3(0.0, y, 0.0)), 0.0, 1e-6);
    EXPECT_NEAR(left.interpolate(Vec3(-0.02, y, 0.0)), -0.02, 1e-3);
    EXPECT_NEAR(right.interpolate(Vec3(-0.02, y, 0.0)), 0.02, 1e-3);
    EXPECT_NEAR(left.interpolate(Vec3(-0.04, y, 0.0)), -0.04, 2e-3);  // where the right drop deformed pressures nothing
    EXPECT_LT(both.interpolate(Vec3(0.0, y, 0.0)), -0.01);  // nothing parts their union
  }
}

TEST_F(GridFiles, KeepOnlyWhatIsThatOfAFrameAlone) {
  scene_.output.gridding.of = GriddedName::Both;
  scene_.output.cell = 0.02;
  for (ObjectDesc& object : scene_.objects) object.particles.at.x() = object.name == "left" ? -0.25 : 0.25;
  ObjectDesc far = scene_.objects.front();  // stands still beside them
  far.name = "far";
  far.particles.at = Vec3(0.0, 2.0, 0.0);
  far.particles.velocity = Vec3::Zero();
  scene_.objects.push_back(far);
  RunOptions all = options();
  EXPECT_EQ(run_scene(scene_, all).outcome, "done");
  int touching = 0;
  for (int frame = 1; frame <= 5; ++frame) {
    RunOptions alone = options();
    alone.folder = folder_ / "alone";
    alone.overwrite = true;
    alone.frames = {frame};
    EXPECT_EQ(run_scene(scene_, alone).outcome, "done");
    const fs::path name = "grids/drops.000" + std::to_string(frame) + ".vdb";
    for (const char* grid : {"left", "right", "far", "scene"}) {
      EXPECT_EQ(GridOfFile(folder_ / name, grid).content_hash(), GridOfFile(alone.folder / name, grid).content_hash()) << grid << ' ' << frame;
    }
    touching += GridOfFile(folder_ / name, "left").interpolate(Vec3(0.0, 0.0, 0.0)) < 1e-3 ? 1 : 0;
  }
  EXPECT_GE(touching, 1);
  EXPECT_LE(touching, 4);
}

TEST_F(GridFiles, OfTooManyVoxelsAreRefusedByTheKeyOfTheScene) {
  scene_.output.cell = 1e-5;
  const RunResult refused = run_scene(scene_, options());
  EXPECT_EQ(refused.outcome, "limit");
  EXPECT_NE(refused.reason.find("output.cell: expected a surface in at most"), std::string::npos) << refused.reason;
  EXPECT_NE(refused.reason.find("use cells of at least"), std::string::npos) << refused.reason;
}

}  // namespace
}  // namespace supple::scenes
