#include "file/named_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A folder of a scene, and one beside it, which links in the first lead to.
class SceneFiles : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"scene", "elsewhere"}) fs::create_directories(root_ / name);
    for (const char* name : {"scene/own.csv", "elsewhere/points.csv"}) std::ofstream(root_ / name) << "0, 0, 0\n";
    fs::create_symlink("../elsewhere/points.csv", root_ / "scene/out.csv");
    fs::create_symlink("../elsewhere", root_ / "scene/folder");
    fs::create_symlink("own.csv", root_ / "scene/in.csv");
    fs::create_symlink("circle.csv", root_ / "scene/circle.csv");
  }
  void TearDown() override { fs::remove_all(root_); }

  [[nodiscard]] Scene scene(const std::string& file, const std::vector<fs::path>& allowed = {}) const {
    return parse_scene("schema: 1\nduration: 1\nobjects:\n  - {name: a, particles: {arrange: file, file: " + file + "}, skeleton: [{shape: point, kernel: {radius: 1}}]}\n", "a.yaml",
                       root_ / "scene", {}, allowed);
  }
  /// What a model is refused with; empty where it is built.
  [[nodiscard]] std::string found(const std::string& file, const std::vector<fs::path>& allowed = {}) const try {
    (void)build_model(scene(file, allowed));
    return {};
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().front().expected, "expected a file inside the scene's folder");
    EXPECT_TRUE(error.faults().front().hint.starts_with("--allow-path")) << error.faults().front().hint;
    return error.faults().front().found;
  }

  fs::path root_ = temp_folder() / "files";
};

TEST_F(SceneFiles, AreInItsFolderWhereverLinksLead) {
  for (const char* file : {"own.csv", "in.csv", "./own.csv"}) EXPECT_EQ(found(file), "") << file;
  for (const char* file : {"out.csv", "folder/points.csv", "circle.csv"}) EXPECT_EQ(found(file), "a link to another place") << file;
  EXPECT_EQ(found("../elsewhere/points.csv"), "'../elsewhere/points.csv'");
}

TEST_F(SceneFiles, ElsewhereAreReadIfAllowed) {
  for (const fs::path& allowed : {root_ / "elsewhere", root_ / "elsewhere/points.csv", root_}) {
    for (const std::string& file : {std::string("out.csv"), std::string("folder/points.csv"), std::string("../elsewhere/points.csv"), (root_ / "elsewhere/points.csv").string()}) {
      EXPECT_EQ(found(file, {allowed}), "") << file << " with " << allowed;
    }
  }
  EXPECT_EQ(found("out.csv", {root_ / "else"}), "a link to another place");  // a part of a name is none of a path
  EXPECT_EQ(found("circle.csv", {root_}), "a link to another place");
}

TEST_F(SceneFiles, ThatMayNotBeReadAreNoPartOfItsHash) {
  const std::uint64_t before = scene("out.csv").content_hash, allowed = scene("out.csv", {root_}).content_hash;
  std::ofstream(root_ / "elsewhere/points.csv") << "1, 2, 3\n";
  EXPECT_EQ(scene("out.csv").content_hash, before);
  EXPECT_NE(scene("out.csv", {root_}).content_hash, allowed);
}

TEST_F(SceneFiles, WithNamesThatBeginWithADotAreNoScenes) {
  for (const char* name : {"...yaml", ".a.yaml"}) {
    std::ofstream(root_ / name) << "schema: 1\nduration: 1\nobjects: []\n";
    try {
      (void)read_scene(root_ / name);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.faults().front().found, "a name that begins with a dot");
    }
  }
  Scene one;
  one.source = "...yaml";
  EXPECT_EQ(scene_name(one), "scene");
}

}  // namespace
}  // namespace supple::scenes
