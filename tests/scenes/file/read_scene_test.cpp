#include "supple/scenes/read_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "file/yaml/yaml_quantity.h"
#include "supple/core/error.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Scene parse(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return parse_scene(text, "test.yaml", "", overrides);
}

std::vector<Fault> faults_of(const std::string& text, const std::vector<std::string>& overrides = {}) {
  try {
    (void)parse(text, overrides);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    return error.faults();
  }
  ADD_FAILURE() << "no fault";
  return {};
}

std::string object_with(const std::string& particles, const std::string& rest = "") {
  return "schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: {" + particles + "}\n" + rest;
}

// The example of the user's guide, with every kind of key.
constexpr const char* kSentence = R"(
schema: 1
title: A deformable ball hits a shape-memory spiral
duration: 6 s
frame_rate: 24
gravity: [0, 0, 0]

objects:
  - name: spiral
    particles: {arrange: spiral, count: 10, inner_radius: 0.15, outer_radius: 55 cm, turns: 1.2, normal: radial, mass: 20 g}
    interactions:
      - {law: bond_frame, neighbours: 2, stretch: 400, rotation: 1.5}     # exact shape memory
      - {law: coplanarity, strength: 2}
      - {law: friction, linear: 0.4, angular: 0.01}
    skeleton:
      - {shape: square, half_size: 0.09, kernel: {type: wyvill, radius: 0.16}}
    contact: {modulus: 2e4, friction: 0.3, dissipation: 0.5}
    colour: [0.85, 0.45, 0.20]

  - name: ball
    particles: {arrange: single, at: [-1.4, 0.05, 0], velocity: [2.5, 0, 0], mass: 0.1}
    skeleton:
      - {shape: point, kernel: {type: wyvill, radius: 0.5}}
    contact: {modulus: 1e4}

camera: {from: [0.4, -2.6, 1.4], look_at: [0, 0, 0], field_of_view_deg: 35}
ground: {height: -0.6}
output: {images: {size: [1280, 720]}, film: true, contacts: csv}
)";

TEST(SceneReader, ReadsASceneLikeASentence) {
  const Scene scene = parse(kSentence);
  EXPECT_EQ(scene.title, "A deformable ball hits a shape-memory spiral");
  EXPECT_EQ(scene.duration, 6.0);
  EXPECT_EQ(scene.frame_count(), 145);  // frame 145 shows t = 6 s
  ASSERT_EQ(scene.objects.size(), 2u);
  EXPECT_EQ(scene.objects[0].name, "ball");  // by name
  const ObjectDesc& spiral = scene.objects[1];
  EXPECT_EQ(spiral.particles.arrange, ArrangeKind::Spiral);
  EXPECT_EQ(spiral.particles.count, 10);
  EXPECT_DOUBLE_EQ(spiral.particles.outer_radius, 0.55);
  EXPECT_DOUBLE_EQ(spiral.particles.mass.value(), 0.02);
  EXPECT_EQ(spiral.particles.normal, NormalKind::Radial);
  ASSERT_EQ(spiral.interactions.size(), 3u);
  EXPECT_EQ(spiral.interactions[0].law, LawKind::BondFrame);
  EXPECT_EQ(spiral.interactions[0].neighbours, 2);
  EXPECT_EQ(spiral.interactions[0].stretch, 400.0);
  EXPECT_EQ(spiral.interactions[1].strength, 2.0);
  ASSERT_EQ(spiral.skeleton.size(), 1u);
  EXPECT_EQ(spiral.skeleton[0].shape, ShapeName::Square);
  EXPECT_EQ(spiral.skeleton[0].kernel.radius, 0.16);
  ASSERT_TRUE(spiral.contact);
  EXPECT_EQ(spiral.contact->modulus, 2e4);
  EXPECT_EQ(scene.objects[0].particles.velocity, Vec3(2.5, 0, 0));
  EXPECT_NEAR(scene.camera.field_of_view, 35.0 * std::numbers::pi / 180.0, 1e-15);
  ASSERT_TRUE(scene.ground);
  EXPECT_EQ(scene.ground->height, -0.6);
  ASSERT_TRUE(scene.output.images);
  EXPECT_TRUE(scene.output.film);
  EXPECT_EQ(scene.output.contacts, std::vector{TableName::Csv});
}

TEST(SceneReader, ReadsJsonToo) {
  const Scene scene = parse(R"({"schema": 1, "duration": "500 ms", "objects": [{"name": "a", "particles": {"mass": 2}}]})");
  EXPECT_EQ(scene.duration, 0.5);
  EXPECT_EQ(scene.objects[0].particles.mass, 2.0);
}

TEST(SceneReader, ConvertsUnits) {
  const auto mass = [](const std::string& text) { return parse(object_with("mass: " + text)).objects[0].particles.mass.value(); };
  EXPECT_DOUBLE_EQ(mass("10 g"), 0.01);
  EXPECT_DOUBLE_EQ(mass("\"10g\""), 0.01);
  EXPECT_DOUBLE_EQ(mass("2 t"), 2000.0);
  EXPECT_DOUBLE_EQ(mass("2 N s^2/m"), 2.0);
  EXPECT_DOUBLE_EQ(mass("+1.5e-2"), 0.015);
  const Scene scene = parse(object_with("velocity: [1 km/s, 5 cm/s, -2], spin: [180 deg/s, 1 rad/s, 2 1/s], angle_deg: 0.5 rad"));
  EXPECT_DOUBLE_EQ(scene.objects[0].particles.velocity.x(), 1000.0);
  EXPECT_DOUBLE_EQ(scene.objects[0].particles.velocity.y(), 0.05);
  EXPECT_DOUBLE_EQ(scene.objects[0].particles.spin.x(), std::numbers::pi);
  EXPECT_DOUBLE_EQ(scene.objects[0].particles.spin.z(), 2.0);
  EXPECT_DOUBLE_EQ(scene.objects[0].particles.angle, 0.5);
  EXPECT_EQ(parse("schema: 1\nduration: 2 min\nframe_rate: 12 Hz\nobjects: [{name: a, particles: {}}]").duration, 120.0);
}

TEST(SceneReader, TakesEveryUnitItKnows) {
  // By definition: international yard and pound (1959), standard gravity 9.80665 m/s^2, atmosphere 101325 Pa.
  const auto read = [](const std::string& text, const Quantity& quantity) {
    const QuantityText found = read_quantity(text, quantity);
    EXPECT_TRUE(found.ok) << text << ": " << found.hint;
    return found.value;
  };
  struct Case {
    const char* text;
    Quantity quantity;
    double value;
  };
  for (const Case& c : {Case{"1 in", kLength, 0.0254},           {"12 in", kLength, 0.3048},           {"1 ft", kLength, 0.3048},
                        {"1 yd", kLength, 0.9144},               {"1 mi", kLength, 1609.344},          {"2 nm", kLength, 2e-9},
                        {"2 inches", kLength, 0.0508},           {"3 feet", kLength, 0.9144},          {"5 metres", kLength, 5.0},
                        {"5 \u00b5m", kLength, 5e-6},            {"5 \u03bcm", kLength, 5e-6},         {"1 lb", kMass, 0.45359237},
                        {"16 oz", kMass, 0.45359237},            {"2 \u00b5g", kMass, 2e-9},           {"3 h", kTime, 10800.0},
                        {"2 days", kTime, 172800.0},             {"3 ns", kTime, 3e-9},                {"5 seconds", kTime, 5.0},
                        {"2 MHz", kRate, 2e6},                   {"1 lbf", kForce, 4.4482216152605},   {"1 psi", kPressure, 6894.757293168361},
                        {"1 atm", kPressure, 101325.0},          {"2 bar", kPressure, 2e5},            {"3 MJ", kEnergy, 3e6},
                        {"1 rev", kAngle, 360.0},                {"100 gon", kAngle, 90.0},            {"30 arcmin", kAngle, 0.5},
                        {"90 degrees", kAngle, 90.0},            {"90\u00b0", kAngle, 90.0},           {"60 rpm", kSpin, 2.0 * std::numbers::pi},
                        {"1 rev/s", kSpin, 2.0 * std::numbers::pi}, {"36 km/h", kSpeed, 10.0},         {"1 lb/in^3", {"density", "", {-3, 1, 0, 0}}, 27679.904710203125},
                        {"50 percent", kNumber, 0.5}}) {
    EXPECT_NEAR(read(c.text, c.quantity), c.value, 1e-14 * c.value) << c.text;
  }
  for (const UnitsOfKind& kind : known_units()) {
    const auto of_noun = [&](const Quantity& q) { return kind.noun == q.noun || (q.noun == kTorque.noun && kind.noun == "energy or torque"); };
    const std::array kQuantities{kNumber, kLength, kMass, kTime, kRate, kAngle, kSpin, kForce, kTorque, kPressure};
    const auto* const quantity = std::find_if(kQuantities.begin(), kQuantities.end(), of_noun);
    ASSERT_NE(quantity, kQuantities.end()) << kind.noun;
    for (const auto* names : {&kind.units, &kind.words}) {
      for (const std::string_view name : *names) EXPECT_GT(read("2 " + std::string(name), *quantity), 0.0);
    }
  }
  EXPECT_EQ(read("5 inch", kLength), 5 * 0.0254);
}

TEST(SceneReader, TakesFractions) {
  const auto rate = [](const std::string& text) {
    return parse("schema: 1\nduration: 1001\nframe_rate: " + text + "\nobjects: [{name: a, particles: {}}]");
  };
  EXPECT_EQ(rate("30000/1001").frame_rate, 30000.0 / 1001.0);
  EXPECT_EQ(rate("30000 / 1001 Hz").frame_rate, 30000.0 / 1001.0);
  EXPECT_EQ(rate("30000/1001").frame_count(), 30001);
  EXPECT_EQ(parse(object_with("mass: 1/4 kg")).objects[0].particles.mass, 0.25);
  EXPECT_EQ(parse(object_with("at: [-5/8 in, 1/2, .5/2 m]")).objects[0].particles.at, Vec3(-0.625 * 0.0254, 0.5, 0.25));
  EXPECT_EQ(parse(object_with("spin: [3/2 rad/s, 2 1/s, 1/2 1/s]")).objects[0].particles.spin, Vec3(1.5, 2.0, 0.5));
  const auto hint = [](const std::string& mass) { return faults_of(object_with("mass: " + mass)).at(0).hint; };
  EXPECT_EQ(hint("1/0"), "numbers must be finite");
  EXPECT_EQ(hint("1/03"), "a leading zero looks octal");
  EXPECT_EQ(hint("1e40/1e-40"), "numbers are 0 or between 1e-50 and 1e50 in size");
  EXPECT_TRUE(hint("1/2/3").starts_with("unknown unit '3'; known: m, km, "));
}

TEST(SceneReader, TellsWhatToWriteForUnitsItDoesNotKnow) {
  const auto hint = [](const std::string& key, const std::string& unit) {
    const std::vector<Fault> faults = faults_of(object_with(key + ": 5 " + unit));
    return faults.size() == 1 ? faults[0].hint : std::to_string(faults.size()) + " faults";
  };
  struct Case {
    std::string key, unit, text;
  };
  const std::string kSpacing = "arrange: line, count: 2, spacing";
  for (const Case& c : std::vector<Case>{{kSpacing, "kkm", "did you mean 'km'?"},
                                         {kSpacing, "xm", "known: m, km, dm, cm, mm, um, nm, pm, Mm, in, ft, yd, mi"},
                                         {kSpacing, "furlong", "known: m, km, dm, cm, mm, um, nm, pm, Mm, in, ft, yd, mi"},
                                         {"mass", "kgs", "did you mean 'kg'?"},
                                         {"mass", "Kg", "did you mean 'kg'?"},
                                         {"mass", "ton", "did you mean 't'?"}}) {
    const std::string found = hint(c.key, c.unit);
    EXPECT_TRUE(found.ends_with(c.text)) << c.unit << ": " << found;
  }
  EXPECT_EQ(faults_of(object_with("mass: 5 ft lbf")).at(0).hint, "'ft lbf' is a unit of energy or torque");
}

TEST(SceneReader, TakesBooleansAsYamlSpellsThem) {
  const auto visible = [](const std::string& word) { return parse(object_with("", "ground: {visible: " + word + "}\n")).ground->visible; };
  for (const char* word : {"true", "True", "TRUE"}) EXPECT_TRUE(visible(word)) << word;
  for (const char* word : {"false", "False", "FALSE"}) EXPECT_FALSE(visible(word)) << word;
  EXPECT_TRUE(parse(object_with("", "ground: True\n")).ground);
  EXPECT_FALSE(parse(object_with("", "ground: FALSE\n")).ground);
  EXPECT_TRUE(parse(object_with("", "output: {meshing: {search: True}}\n")).output.meshing.search);
  const auto hint = [](const std::string& word) { return faults_of(object_with("", "ground: {visible: " + word + "}\n")).at(0).hint; };
  for (const char* word : {"yes", "Yes", "on", "tRUE", "1"}) EXPECT_EQ(hint(word), "did you mean true?") << word;
  for (const char* word : {"no", "Off", "n", "0"}) EXPECT_EQ(hint(word), "did you mean false?") << word;
  for (const char* word : {"\"true\"", "maybe", "[]"}) EXPECT_FALSE(hint(word).ends_with("false?")) << word;
}

TEST(SceneReader, RefusesTextThatNoFormatCanHold) {
  const auto fault = [](const std::string& text) { return faults_of(text).at(0); };
  const std::string scene = "schema: 1\nduration: 1\nobjects: [{name: a, particles: {}}]\n";
  EXPECT_EQ(fault(scene + "title: \"a\\x1b[2Jb\"\n").expected, "expected text without control characters");
  EXPECT_EQ(parse(scene + "title: \"<a> & 'b' \\u00e9\\nc\"\n").title, "<a> & 'b' \u00e9\nc");
  for (const char* name : {"../a.csv", "/a.csv", "b/../../a.csv", "\"\"", "\"a.csv\\0b\"", "\"a\\nb\""}) {
    const std::string file(name);
    const std::string particles = "schema: 1\nduration: 1\nobjects: [{name: a, particles: {arrange: file, file: " + file + "}}]\n";
    for (const std::string& text : {particles, scene + "obstacles: [{name: b, shape: mesh, file: " + file + "}]\n",
                                    scene + "ground: {texture: {pattern: picture, file: " + file + "}}\n"}) {
      EXPECT_EQ(fault(text).expected, "expected a file inside the scene's folder") << text;
    }
  }
  for (const char* name : {"a b", "a/b", "\"a\\nb\"", "\"a\\\"b\"", "\u00e9", "1a", "-a"}) {
    EXPECT_EQ(fault("schema: 1\nduration: 1\nobjects: [{name: " + std::string(name) + ", particles: {}}]\n").expected, "expected a name") << name;
  }
}

TEST(SceneReader, TakesFalseAsAbsentAndTrueAsTheDefaults) {
  const std::string skeleton = "    skeleton: [{shape: point, kernel: {radius: 1}}]\n";
  EXPECT_FALSE(parse(object_with("", skeleton + "    contact: false\n")).objects[0].contact);
  EXPECT_TRUE(parse(object_with("", skeleton + "    contact: true\n")).objects[0].contact);
  EXPECT_TRUE(parse(object_with("", "output: {images: true, cell: auto}\n")).output.images);
}

TEST(SceneReader, OverridesByNameAndByIndex) {
  const Scene scene = parse(kSentence, {"objects.ball.particles.mass=2", "objects[0].skeleton[0].kernel.radius=20 cm",
                                        "output.images.samples=2", "camera.from=[1, 2, 3]", "objects.ball.medium.linear=0.5"});
  EXPECT_EQ(scene.objects[0].particles.mass, 2.0);
  EXPECT_DOUBLE_EQ(scene.objects[1].skeleton[0].kernel.radius, 0.2);
  EXPECT_EQ(scene.output.images->samples, 2);
  EXPECT_EQ(scene.camera.from, Vec3(1, 2, 3));
  ASSERT_TRUE(scene.objects[0].medium);
  EXPECT_EQ(scene.objects[0].medium->linear, 0.5);
}

TEST(SceneReader, OverridesOneUseOfAnAliasOnly) {
  const Scene scene = parse("schema: 1\nduration: 1\nobjects:\n- {name: a, particles: &p {mass: 3}}\n- {name: b, particles: *p}\n",
                            {"objects.a.particles.mass=4"});
  EXPECT_EQ(scene.objects[0].particles.mass, 4.0);
  EXPECT_EQ(scene.objects[1].particles.mass, 3.0);
}

TEST(SceneReader, FindsEveryFaultAtOnceInTheOrderOfTheFile) {
  const auto faults = faults_of("schema: 2\nduration: -1\nobjects:\n  - {name: 1x, particles: {mass: 0}}\nkamera: {}\n");
  ASSERT_EQ(faults.size(), 5u);
  EXPECT_EQ(faults[0].place, "test.yaml:1:9");
  EXPECT_EQ(faults[1].place, "test.yaml:2:11");
  EXPECT_EQ(faults[2].place, "test.yaml:4:12");
  EXPECT_EQ(faults[3].place, "test.yaml:4:34");
  EXPECT_EQ(faults[4].place, "test.yaml:5:1");
}

TEST(SceneReader, ShowsTwentyFaultsAndCountsTheRest) {
  std::string text = "schema: 1\nduration: 1\nobjects: [{name: a, particles: {}}]\n";
  for (int i = 0; i < 30; ++i) text += "key" + std::to_string(i) + ": 1\n";
  const auto faults = faults_of(text);
  ASSERT_EQ(faults.size(), 20u);
  EXPECT_NE(faults.back().hint.find("10 more faults"), std::string::npos) << faults.back().hint;
}

TEST(SceneReader, CountsColumnsInCharacters) {
  EXPECT_EQ(faults_of("{title: \"\u00e9\u00e9\u00e9\", x: 1, schema: 1, duration: 1, objects: [{name: a, particles: {}}]}")[0].place,
            "test.yaml:1:16");
}

// Hostile texts are refused within seconds of processor time, also in a build with sanitizers.
class HostileText : public testing::Test {
 protected:
  void expect_refused(const std::string& text, const std::string& words) {
    const std::clock_t begin = std::clock();
    const auto faults = faults_of(text);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    ASSERT_FALSE(faults.empty());
    EXPECT_NE(faults[0].message().find(words), std::string::npos) << faults[0].message().substr(0, 300);
    EXPECT_LT(seconds, 5.0);
  }
};

TEST_F(HostileText, AliasBomb) {
  std::string text = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 9; ++i) {
    const std::string alias = "*a" + std::to_string(i - 1);
    text += 'a' + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 9; ++k) text += (k > 0 ? ", " : "") + alias;
    text += "]\n";
  }
  expect_refused(text, "200000 nodes");
}
TEST_F(HostileText, Cycle) { expect_refused("objects: &a [*a]\n", "that contains it"); }
TEST_F(HostileText, AliasToAKey) {
  EXPECT_EQ(parse("&name title: *name\n" + object_with("")).title, "title");
  expect_refused("schema: 1\nduration: 1\n&name objects:\n  - {name: a, contact: *name}\n", "found 'objects'");
}
TEST_F(HostileText, DeepNesting) {
  std::string block;
  for (int i = 0; i < 100; ++i) block += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  expect_refused(block, "64 nested levels");
  expect_refused("a: " + std::string(100, '[') + std::string(100, ']'), "64 nested levels");
  expect_refused(std::string(400, '{'), "");
  expect_refused(std::string(150'000, '['), "");
  expect_refused(std::string(8'000'000, '['), "200000 nodes");
}
TEST_F(HostileText, ManyNodes) {
  std::string text = "objects: [";
  for (int i = 0; i < 210'000; ++i) text += "1,";
  expect_refused(text + "]", "200000 nodes");
  std::string lines = "objects:\n";
  for (int i = 0; i < 210'000; ++i) lines += "- 1\n";
  expect_refused(lines, "200000 nodes");
}
TEST_F(HostileText, TooLarge) { expect_refused(std::string(std::size_t{9} << 20, ' '), "8 MiB"); }
TEST_F(HostileText, NulAndBrokenUtf8) {
  expect_refused(std::string("a: \0", 4), "control characters");
  for (const char* bad : {"\xff", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xe2\x82"}) {
    expect_refused(std::string("title: ") + bad, "UTF-8");
  }
}

TEST(SceneReader, SaysWhenAFileCannotBeRead) {
  try {
    (void)read_scene("/no/such/scene.yaml");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    EXPECT_STREQ(error.what(), "/no/such/scene.yaml: expected a readable scene file, found no file of this name; there is no folder '/no/such'");
  }
}

TEST(SceneReader, ReadsEverySceneOfTheLibrary) {
  int count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() / "scenes/library")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW((void)read_scene(entry.path())) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 6);
}

void collect_keys(const nlohmann::json& schema, std::vector<std::string>& keys) {
  if (schema.is_object() && schema.contains("properties") && schema["properties"].is_object()) {
    for (const auto& [key, value] : schema["properties"].items()) keys.push_back(key);
  }
  if (schema.is_structured()) {
    for (const auto& value : schema) collect_keys(value, keys);
  }
}

TEST(SceneReference, MentionsEveryKeyOfTheSchema) {
  const std::string page = scene_reference();
  std::vector<std::string> keys;
  collect_keys(nlohmann::json::parse(scene_json_schema()), keys);
  EXPECT_GT(keys.size(), 100u);
  for (const std::string& key : keys) EXPECT_NE(page.find("| `" + key + "` |"), std::string::npos) << key;
}

TEST(SceneReference, SchemaSaysWhatIsRequiredAndForWhich) {
  const auto schema = nlohmann::json::parse(scene_json_schema());
  EXPECT_EQ(schema["required"], nlohmann::json({"schema", "duration", "objects"}));
  const auto& particles = schema["properties"]["objects"]["items"]["properties"]["particles"];
  EXPECT_EQ(particles["additionalProperties"], false);
  bool ring = false;
  for (const auto& condition : particles["allOf"]) {
    ring = ring || (condition["if"]["properties"]["arrange"]["enum"] == nlohmann::json({"ring", "geodesic", "ball", "tube"}) &&
                    condition["then"]["required"] == nlohmann::json({"radius"}));
  }
  EXPECT_TRUE(ring);
  const auto& search = schema["properties"]["output"]["properties"]["meshing"]["properties"]["search"];
  EXPECT_EQ(search["anyOf"], nlohmann::json::parse(R"([{"type": "boolean"}, {"const": "auto"}])"));
}

TEST(SceneHashes, KnowWhatIsInTheFilesThatAreNamed) {
  const std::filesystem::path folder = temp_folder() / "scene_hashes";
  std::filesystem::create_directories(folder);
  const auto read = [&](const std::string& points, const std::string& picture) {
    std::ofstream(folder / "points.csv") << points;
    std::ofstream(folder / "skin.png") << picture;
    return parse_scene(R"(
schema: 1
duration: 1 s
objects:
  - name: cloud
    particles: {arrange: file, file: points.csv}
    look: {texture: {pattern: picture, file: skin.png}}
)", "cloud.yaml", folder);
  };
  const Scene scene = read("x,y,z\n0,0,0\n", "red");
  const Scene moved = read("x,y,z\n0,0,1\n", "red");
  const Scene painted = read("x,y,z\n0,0,0\n", "blue");
  EXPECT_EQ(read("x,y,z\n0,0,0\n", "red").content_hash, scene.content_hash);
  EXPECT_NE(moved.content_hash, scene.content_hash);
  EXPECT_EQ(painted.content_hash, scene.content_hash);
  EXPECT_NE(painted.picture_hash, scene.picture_hash);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace supple::scenes
