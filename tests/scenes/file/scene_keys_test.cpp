/// Which keys saved states and pictures depend on.
#include "file/fields/scene_keys.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "scenes/run_scenes.h"
#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

using Sets = std::vector<std::string>;

const std::string kDrops = std::string(small::kTwoDrops) + "duration: 0.5 s\n";
/// A ball beside the drops that touches nothing.
const std::string kGhost = R"(
schema: 1
duration: 0.5 s
frame_rate: 8
gravity: [0, 0, -9.81]
objects: [{name: ball, particles: {velocity: [0.5, 0, 0]}, skeleton: [{shape: point, kernel: {radius: 0.15}}]}]
)";
/// A soft ball on the ground and a shelf below it.
const std::string kRests = R"(
schema: 1
duration: 0.25 s
frame_rate: 8
gravity: [0, 0, -9.81]
ground: {height: -0.2}
obstacles: [{name: shelf, shape: box, at: [0, 0, -0.4], half_sizes: [0.1, 0.1, 0.1]}]
objects:
  - name: ball
    particles: {mass: 0.1}
    skeleton: [{shape: box, half_sizes: [0.1, 0.1, 0.1], kernel: {radius: 0.15}}]
    contact: {modulus: 1e4}
)";

Scene parsed(const std::string& text, const Sets& sets = {}) { return parse_scene(text, "scene.yaml", ".", sets); }

TEST(SceneKeys, ThatActOnNothingChangeNoBitAndRefuseNoState) {
  const std::vector<std::pair<std::string, std::vector<Sets>>> cases = {
      {kGhost,
       {{"ground={height: -0.1}"}, {"ground={height: -0.1, collides: false}"}, {"pairs=[]"}, {"contact={error: 1e-2, rule: march}"},
        {"obstacles=[{name: shelf, shape: box, at: [0, 0, -0.3], half_sizes: [1, 1, 0.1]}]"},
        {"obstacles=[{name: blob, shape: implicit, skeleton: [{shape: point, kernel: {radius: 2}}]}]"},
        {"camera={from: [0, -5, 2]}"}, {"integrator={method: auto}"}, {"planar=false"}, {"frame_rate=8 Hz"}, {"duration=0.25 s"},
        {"gravity=[0, 0, -981 cm/s^2]"}, {"objects.ball.iso=0.5"}}},
      {kDrops,
       {{"ground={height: -1, collides: false, modulus: 1e3}"}, {"pairs=[{objects: [left, right]}]"}, {"pairs=[{objects: [left, right], collide: true}]"},
        {"contact={bulge: 0.4, bulge_width: 0.2}"},
        {"obstacles=[{name: shelf, shape: box, half_sizes: [1, 1, 1]}]",
         "pairs=[{objects: [shelf, left], collide: false}, {objects: [right, shelf], collide: false}]"},
        {"ground={height: 0}", "pairs=[{objects: [ground, left], collide: false}, {objects: [right, ground], collide: false}]"}}},
      {kRests, {{"objects.ball.colour=[1, 0, 0]"}, {"obstacles.shelf.visible=false"}, {"ground.texture={pattern: checker}"}}}};
  for (const auto& [text, all] : cases) {
    const Scene plain = parsed(text);
    const std::uint64_t state = hash_after(plain, 3, {});
    for (const Sets& sets : all) {
      const Scene changed = parsed(text, sets);
      EXPECT_EQ(changed.content_hash, plain.content_hash) << sets[0] << *changed.motion_keys;
      EXPECT_EQ(hash_after(changed, 3, {}), state) << sets[0];
    }
  }
}

TEST(SceneKeys, ThatMayActRefuseStates) {
  const std::vector<std::pair<std::string, std::vector<Sets>>> cases = {
      {kGhost,
       {{"frame_rate=9"}, {"objects.ball.contact={}", "ground=true"}, {"objects.ball.particles.mass=2"}, {"objects.ball.skeleton[0].kernel.radius=0.2"},
        {"obstacles=[{name: shelf, shape: box, half_sizes: [1, 1, 1], keys: [{time: 0, at: [0, 0, 0]}, {time: 1, at: [0, 0, 9]}]}]"}}},
      {kDrops,
       {{"ground={height: -1}"}, {"pairs=[{objects: [left, right], collide: false}]"}, {"pairs=[{objects: [left, right], friction: 0.3}]"},
        {"contact={error: 1e-2}"}, {"obstacles=[{name: shelf, shape: box, half_sizes: [1, 1, 1]}]"},
        {"obstacles=[{name: shelf, shape: box, half_sizes: [1, 1, 1]}]", "pairs=[{objects: [shelf, left], collide: false}]"}}},
      {kRests,
       {{"ground.friction=0.4"}, {"obstacles.shelf.at=[0, 0, -0.5]"}, {"obstacles=[]"},
        {"pairs=[{objects: [shelf, ball], collide: false}]"}, {"pairs=[{objects: [ground, ball], collide: false}]"}}}};
  for (const auto& [text, all] : cases) {
    const Scene plain = parsed(text);
    for (const Sets& sets : all) EXPECT_NE(parsed(text, sets).content_hash, plain.content_hash) << sets[0];
  }
}

TEST(SceneKeys, OfSolidsBeforeOthersCountBecauseStatesNumberThem) {
  const std::string text = kRests + "contact: {stick: {stiffness: 1000}}\n";
  const Sets before{"obstacles=[{name: away, shape: box, at: [9, 0, 0], half_sizes: [1, 1, 1]}, {name: shelf, shape: box, at: [0, 0, -0.4], half_sizes: [0.1, 0.1, 0.1]}]",
                    "pairs=[{objects: [away, ball], collide: false}]"};
  const Sets behind{"obstacles=[{name: zero, shape: box, at: [9, 0, 0], half_sizes: [1, 1, 1]}, {name: shelf, shape: box, at: [0, 0, -0.4], half_sizes: [0.1, 0.1, 0.1]}]",
                    "pairs=[{objects: [zero, ball], collide: false}]"};
  const Scene plain = parsed(text);
  EXPECT_NE(parsed(text, before).content_hash, plain.content_hash);
  EXPECT_EQ(parsed(text, behind).content_hash, plain.content_hash);
  EXPECT_EQ(hash_after(parsed(text, behind), 3, {}), hash_after(plain, 3, {}));
}

KeyDifferences difference(const Scene& here, const Scene& other) {
  return differences(keys_in(*here.motion_keys), keys_in(*other.motion_keys));
}

TEST(SceneKeys, AreNamedWhereTheyDifferWithWhatMakesThemEqual) {
  const auto expect = [](const Sets& mine, const Sets& theirs, const std::string& found, const std::string& set) {
    const KeyDifferences differ = difference(parsed(kDrops, mine), parsed(kDrops, theirs));
    EXPECT_EQ(differ.found, found);
    EXPECT_EQ(differ.set, set);
  };
  expect({}, {"objects.left.particles.mass=2"}, "objects.left.particles.mass=2 (here 0.5)", "--set objects.left.particles.mass=2");
  expect({"objects.left.particles.mass=2"}, {}, "objects.left.particles.mass=0.5 (here 2)", "--set objects.left.particles.mass=0.5");
  expect({}, {"integrator.method=rk4"}, "integrator.method=rk4 (here auto)", "--set integrator.method=rk4");
  expect({"gravity=[0, 0, -1]"}, {}, "gravity=[0, 0, 0] (here [0, 0, -1])", "--set 'gravity=[0, 0, 0]'");
  expect({"ground={height: -1}"}, {}, "ground=none (here given)", "--set ground=false");
  expect({}, {"ground={height: -1}"}, "ground=given (here none)", "--set 'ground={}' --set ground.height=-1");
  expect({"ground={height: -1, friction: 0.1}"}, {"ground={height: -2}"}, "ground.friction=0.5 (here 0.1), ground.height=-2 (here -1)",
         "--set ground.friction=0.5 --set ground.height=-2");
  expect({"objects.left.contact.self=true"}, {}, "objects.left.contact.self=none (here true)", "");
  expect({}, {"pairs=[{objects: [right, left], friction: 0.5}]"}, "pairs(left, right)=given (here none)", "");
  expect({"time_step.size=10 ms"}, {"time_step.size=20 ms"}, "time_step.size=0.02 (here 0.01)", "--set time_step.size=0.02");
}

TEST(SceneKeys, OfAnotherSetOfObjectsAreNamed) {
  const KeyDifferences differ = difference(parsed(kDrops), parsed(kGhost));
  EXPECT_EQ(differ.found, "gravity=[0, 0, -9.81] (here [0, 0, 0]), objects.ball=given (here none), objects.left=none (here given), "
                          "objects.right=none (here given)");
  EXPECT_EQ(differ.set, "");
}

/// Words of a hint as the shell splits them.
Sets sets_in(std::string text) {
  Sets sets;
  const std::string mark = "--set ";
  while (text.starts_with(mark)) {
    text.erase(0, mark.size());
    const bool quoted = text.front() == '\'';
    const std::size_t end = quoted ? text.find('\'', 1) : std::min(text.find(' '), text.size());
    sets.push_back(quoted ? text.substr(1, end - 1) : text.substr(0, end));
    text.erase(0, std::min(text.size(), end + (quoted ? 2 : 1)));
  }
  return sets;
}

TEST(SceneKeys, ThatAHintSetsMakeTheSceneTheOther) {
  const std::vector<Sets> others = {{"objects.ball.particles.mass=0.3"}, {"objects.ball.particles.angle_deg=33.3"}, {"ground=false"}, {"gravity=[1, 2, 1e-7]"},
                                    {"ground.height=-0.3", "sleep=true"}, {"sleep={time: 0.1234567890123}"}, {"obstacles.shelf.turn_deg=-77.7"},
                                    {"contact.stick={stiffness: 10}"}, {"time_step.size=7 ms"}, {"objects.ball.rayleigh={mass: 2}"}};
  const Scene here = parsed(kRests);
  for (const Sets& other : others) {
    const Scene there = parsed(kRests, other);
    const std::string set = difference(here, there).set, back = difference(there, here).set;
    EXPECT_EQ(parsed(kRests, sets_in(set)).content_hash, there.content_hash) << set;
    Sets both = other;
    for (const std::string& one : sets_in(back)) both.push_back(one);
    EXPECT_EQ(parsed(kRests, both).content_hash, here.content_hash) << back;
  }
}

TEST(SceneKeys, OfPicturesKnowNoFormatsAndNoDurationWithoutATurntable) {
  const std::uint64_t plain = parsed(kDrops).picture_hash;
  for (const char* same : {"duration=2 s", "title=Drops", "output={mesh: ply}", "pairs=[]"}) EXPECT_EQ(parsed(kDrops, {same}).picture_hash, plain) << same;
  EXPECT_EQ(parsed(kDrops, {"output={images: {formats: [png, exr]}}"}).picture_hash, parsed(kDrops, {"output={images: {}}"}).picture_hash);
  for (const char* other : {"output={images: {size: [320, 200]}}", "render.renderer=path", "objects.left.colour=[1, 0, 0]", "ground={collides: false}",
                            "contact={bulge: 0.4}", "output={cell: 1 cm}"}) {
    EXPECT_NE(parsed(kDrops, {other}).picture_hash, plain) << other;
  }
  EXPECT_NE(parsed(kDrops, {"camera.turntable_deg=90", "duration=2 s"}).picture_hash, parsed(kDrops, {"camera.turntable_deg=90"}).picture_hash);
}

TEST(SceneKeys, KnowAFileByItsContent) {
  const std::filesystem::path folder = temp_folder() / "scene_keys";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "one.csv") << "x,y,z\n0,0,0\n";
  std::ofstream(folder / "same.csv") << "x,y,z\n0,0,0\n";
  std::ofstream(folder / "other.csv") << "x,y,z\n0,0,1\n";
  const auto scene = [&](const std::string& file) {
    return parse_scene("schema: 1\nduration: 1 s\nobjects: [{name: cloud, particles: {arrange: file, file: " + file + "}}]\n", "cloud.yaml", folder);
  };
  EXPECT_EQ(scene("one.csv").content_hash, scene("same.csv").content_hash);
  EXPECT_NE(scene("one.csv").content_hash, scene("other.csv").content_hash);
  const KeyDifferences differ = difference(scene("one.csv"), scene("other.csv"));
  EXPECT_TRUE(differ.found.starts_with("objects.cloud.particles.file=content ")) << differ.found;
  EXPECT_EQ(differ.set, "");
  std::filesystem::remove_all(folder);
}

TEST(SceneKeys, AreReadFromTheirText) {
  const SceneKeys keys = keys_in(*parsed(kRests).motion_keys);
  EXPECT_FALSE(keys.empty());
  EXPECT_EQ(text_of(keys), *parsed(kRests).motion_keys);
  EXPECT_EQ(hash_of(keys), parsed(kRests).content_hash);
  EXPECT_THROW((void)keys_in("gravity\n"), Error);
}

}  // namespace
}  // namespace supple::scenes
