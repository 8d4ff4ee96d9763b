/// What a user reads when a scene is wrong, word for word: tests/golden/messages/NAME.yaml and NAME.txt.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

const fs::path& folder() {
  static const fs::path path = source_dir() / "tests/golden/messages";
  return path;
}

/// Overrides stand in comments, one a line: "# --set objects.ball.iso=2".
std::vector<std::string> overrides_of(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream lines(text);
  const std::string mark = "# --set ";
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(mark)) out.push_back(line.substr(mark.size()));
  }
  return out;
}

std::string message_of(const fs::path& path) {
  const std::string text = contents(path);
  try {
    (void)build_model(parse_scene(text, path.filename().string(), "", overrides_of(text)));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    return std::string(error.what()) + '\n';
  }
  return "no fault\n";
}

std::vector<std::string> names() {
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder())) {
    if (entry.path().extension() == ".yaml") out.push_back(entry.path().stem().string());
  }
  std::sort(out.begin(), out.end());
  return out;
}

class Message : public testing::TestWithParam<std::string> {};

TEST_P(Message, ReadsAsAgreed) {
  EXPECT_EQ(message_of(folder() / (GetParam() + ".yaml")), contents(folder() / (GetParam() + ".txt")));
}

INSTANTIATE_TEST_SUITE_P(Golden, Message, testing::ValuesIn(names()), [](const auto& instance) { return instance.param; });

TEST(Messages, OfFilesThatAreAbsentNameTheirKey) {
  const Scene scene = parse_scene(R"(
schema: 1
duration: 1 s
frame_rate: 24
objects:
  - {name: ball, particles: {arrange: file, file: absent.csv, mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}]}
)", "scene.yaml", "");
  try {
    (void)build_model(scene);
    FAIL() << "a file that is absent was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    ASSERT_EQ(error.faults().size(), 1u);
    EXPECT_EQ(error.faults()[0].place, "absent.csv");
    EXPECT_EQ(error.faults()[0].key, "objects.ball.particles.file");
  }
}

TEST(Messages, NameAllFilesThatAreAbsent) {
  const std::string text = R"(
schema: 1
duration: 1 s
objects:
  - {name: ball, particles: {arrange: file, file: absent.csv, mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}]}
  - {name: cube, particles: {arrange: file, file: nowhere.csv, mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}]}
)";
  const std::string solids = R"(
schema: 1
duration: 1 s
objects:
  - {name: ball, particles: {mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}], contact: {}}
  - {name: cube, particles: {mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}]}
obstacles:
  - {name: hill, shape: heights, file: absent.csv}
  - {name: roof, shape: mesh, file: absent.obj}
)";
  const auto expect = [](const std::string& scene, ErrorKind kind, const std::vector<std::string>& keys) {
    try {
      (void)build_model(parse_scene(scene, "scene.yaml", ""));
      FAIL() << "files that are absent were read";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), kind);
      std::vector<std::string> found;
      for (const Fault& fault : error.faults()) found.push_back(fault.key);
      EXPECT_EQ(found, keys);
    }
  };
  expect(text, ErrorKind::Io, {"objects.ball.particles.file", "objects.cube.particles.file"});
  expect(solids, ErrorKind::Io, {"obstacles.hill.file", "obstacles.roof.file"});
  expect(solids + "pairs: [{objects: [ball, cube], friction: 0.1}]\n", ErrorKind::Scene, {"obstacles.hill.file", "obstacles.roof.file", "pairs[0]"});
}

TEST(Messages, OfPipesDevicesAndFoldersNameTheirKeyAtOnce) {
  const fs::path place = temp_folder() / "messages";
  fs::create_directories(place / "folder");
  ASSERT_EQ(::mkfifo((place / "pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", place / "device");
  const std::string head = "schema: 1\nduration: 1\nobjects:\n  - {name: ball, particles: ", skeleton = ", skeleton: [{shape: point, kernel: {radius: 0.1}}]}\n";
  const std::vector<fs::path> devices{"/dev"};  // allowed, and refused all the same
  for (const auto& [file, found] : {std::pair{"pipe", "a pipe"}, {"device", "a device or a socket"}, {"folder", "a folder"}}) {
    const std::string name(file);
    for (const std::string& text : {head + "{arrange: file, file: " + name + "}" + skeleton,
                                    head + "{}" + skeleton + "obstacles: [{name: hill, shape: heights, file: " + name + "}]\n",
                                    head + "{}" + skeleton + "obstacles: [{name: hill, shape: mesh, file: " + name + "}]\n"}) {
      try {
        (void)build_model(parse_scene(text, "scene.yaml", place, {}, devices));
        ADD_FAILURE() << "read: " << file;
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::Io);
        EXPECT_EQ(error.faults().at(0).expected, "expected a regular file");
        EXPECT_EQ(error.faults().at(0).found, found);
        EXPECT_TRUE(error.faults().at(0).key.ends_with(".file")) << error.faults().at(0).key;
      }
    }
  }
  fs::remove_all(place);
}

TEST(Messages, AreAtLeastForty) { EXPECT_GE(names().size(), 40u); }

}  // namespace
}  // namespace supple::scenes
