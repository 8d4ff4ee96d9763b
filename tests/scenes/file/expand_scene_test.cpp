// Variables, expressions, repetition, defaults and includes of scene files.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "file/expand/expression.h"
#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

std::optional<Value> no_variables(std::string_view) { return std::nullopt; }

Value value_of(const std::string& text) { return evaluate_expression(text, no_variables); }

ExpressionFault fault_of(const std::string& text) {
  try {
    const Value value = value_of(text);
    ADD_FAILURE() << text << " has the value " << value.spelt();
  } catch (const ExpressionFault& fault) {
    return fault;
  }
  return {};
}

TEST(Expression, HasTheValueOfItsArithmetic) {
  const std::pair<const char*, double> cases[] = {
      {"1 + 2*3", 7.0},          {"(1 + 2)*3", 9.0},        {"2^3^2", 512.0},           {"-2^2", -4.0},           {"8/2/2", 2.0},
      {"2 - 3 - 4", -5.0},       {"1e3 + .5", 1000.5},      {"sqrt(2)*sqrt(2)", 2.0},   {"min(3, 1, 2)", 1.0},    {"max(3, 1, 2)", 3.0},
      {"abs(-3)", 3.0},          {"floor(-0.5)", -1.0},     {"ceil(-0.5)", 0.0},        {"round(2.5)", 3.0},      {"exp(log(5))", 5.0},
      {"sin(pi/6)", 0.5},        {"cos(60 deg)", 0.5},      {"tan(45 deg)", 1.0},       {"4^0.5", 2.0},           {"2^-2", 0.25},
      {"asin(1)/pi", 0.5},       {"acos(-1) / 1 rad", std::numbers::pi}, {"atan2(1, -1)/1 rad", 0.75 * std::numbers::pi}};
  for (const auto& [text, expected] : cases) EXPECT_NEAR(value_of(text).number, expected, 1e-14 * std::max(1.0, std::abs(expected))) << text;
}

TEST(Expression, KeepsUnits) {
  const std::pair<const char*, const char*> cases[] = {
      {"5 cm", "0.05 m"},     {"2*(3 cm)", "0.06 m"},     {"1 m/2 s", "0.5 m/s"},      {"1/2 s", "0.5 1/s"},       {"3 kN * 2 mm", "6 kg m^2/s^2"},
      {"sqrt(4 m^2)", "2 m"}, {"2 N s", "2 kg m/s"},      {"90 deg - 90 deg", "0 rad"}, {"(3 m)^2/(1 m)", "9 m"},   {"6 m / 2 m", "3"},
      {"min(2 m, 3 m)", "2 m"}, {"abs(-2 kg)", "2 kg"},   {"20 %", "0.2"},              {"1 m^2*1 m", "1 m^3"}};
  for (const auto& [text, expected] : cases) EXPECT_EQ(value_of(text).spelt(), expected) << text;
}

TEST(Expression, SaysWhatIsWrong) {
  EXPECT_EQ(fault_of("1 m + 1 s").expected, "expected a length [m] after '+'");
  EXPECT_EQ(fault_of("1 m + 1 s").found, "a time [s]");
  EXPECT_EQ(fault_of("1 +").found, "the end of the expression");
  EXPECT_EQ(fault_of("(1").expected, "expected ')'");
  EXPECT_EQ(fault_of("1 2").expected, "expected an operator or the end of the expression");
  EXPECT_EQ(fault_of("2 x").hint, "a product is written with '*'");
  EXPECT_EQ(fault_of("x").expected, "expected a variable, a unit or a function");
  EXPECT_EQ(fault_of("1/0").expected, "expected a divisor that is not 0");
  EXPECT_EQ(fault_of("0^-1").expected, "expected a divisor that is not 0");
  EXPECT_EQ(fault_of("sqrt(-1)").expected, "expected an argument >= 0 of sqrt");
  EXPECT_EQ(fault_of("sqrt(1 m)").expected, "expected a square of a unit in sqrt");
  EXPECT_EQ(fault_of("log(0)").expected, "expected an argument > 0 of log");
  EXPECT_EQ(fault_of("sin(1 m)").expected, "expected a number without unit as angle");
  EXPECT_EQ(fault_of("min(1 m, 1)").expected, "expected arguments of min with one unit");
  EXPECT_EQ(fault_of("atan2(1)").found, "1");
  EXPECT_EQ(fault_of("exp(1e3)").expected, "expected a finite value");
  EXPECT_EQ(fault_of("m^9").expected, "expected units to powers of at most 8");
  EXPECT_EQ(fault_of(std::string(100000, '(')).expected, "expected at most 64 nested parentheses");
  EXPECT_EQ(fault_of(std::string(100000, '-')).expected, "expected at most 64 nested parentheses");
}

class ExpandedScene : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] Scene parse(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    return parse_scene(text, "test.yaml", folder_, overrides);
  }
  [[nodiscard]] std::vector<Fault> faults(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    try {
      (void)parse(text, overrides);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Scene);
      return error.faults();
    }
    ADD_FAILURE() << "no fault in " << text;
    return {Fault{}};
  }

  fs::path folder_ = temp_folder() / (std::string("expand_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

constexpr const char* kBalls = R"(
schema: 1
duration: 1 s
variables: {r: 5 cm, gap: "${r/10}", n: 3, heavy: 2 kg}
objects:
  - repeat: {i: "${n}"}
    name: ball${i}
    particles: {arrange: single, at: ["${(2*r + gap)*i}", 0, "${r}"], mass: "${heavy/(1 + i)}"}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: "${r/0.5}"}}]
)";

TEST_F(ExpandedScene, RepeatsObjectsWithTheirIndex) {
  const Scene scene = parse(kBalls);
  ASSERT_EQ(scene.objects.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(scene.objects[i].name, "ball" + std::to_string(i));
    EXPECT_DOUBLE_EQ(scene.objects[i].particles.at.x(), 0.105 * static_cast<double>(i));
    EXPECT_EQ(scene.objects[i].particles.at.z(), 0.05);
    EXPECT_EQ(scene.objects[i].particles.mass, 2.0 / (1.0 + static_cast<double>(i)));
    EXPECT_EQ(scene.objects[i].skeleton[0].kernel.radius, 0.1);
  }
}

TEST_F(ExpandedScene, TakesVariablesAndKeysOfCopiesFromTheCommandLine) {
  const Scene scene = parse(kBalls, {"variables.n=5", "variables.r=10 cm", "objects.ball4.particles.mass=${heavy*10}"});
  ASSERT_EQ(scene.objects.size(), 5U);
  EXPECT_DOUBLE_EQ(scene.objects[1].particles.at.x(), 0.21);
  EXPECT_EQ(scene.objects[4].particles.mass, 20.0);
  const Fault fault = faults(kBalls, {"variables.N=5"})[0];
  EXPECT_EQ(fault.expected, "expected a variable of the scene");
  EXPECT_EQ(fault.key, "variables.N");
  EXPECT_EQ(faults("schema: 1\nduration: 1\nobjects: [{name: a, particles: {arrange: single, mass: 1}}]\n", {"variables.n=5"})[0].found, "one without");
}

TEST_F(ExpandedScene, IsTheSameSceneAsOneThatIsSpeltOut) {
  const char* spelt = R"(
schema: 1
duration: 1 s
objects:
  - name: ball0
    particles: {arrange: single, at: [0, 0, 0.05], mass: 2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
)";
  EXPECT_EQ(parse(kBalls, {"variables.n=1"}).content_hash, parse(spelt).content_hash);
}

TEST_F(ExpandedScene, NestsIndices) {
  const Scene scene = parse(R"(
schema: 1
duration: 1
objects:
  - repeat: {row: 2, column: 3}
    name: b${row}_${column}
    particles: {arrange: single, at: ["${column}", "${row}", 0], mass: 1}
)");
  ASSERT_EQ(scene.objects.size(), 6U);
  EXPECT_EQ(scene.objects[5].name, "b1_2");
  EXPECT_EQ(scene.objects[5].particles.at, Vec3(2, 1, 0));
}

TEST_F(ExpandedScene, MergesDefaultsIntoItemsThatLackTheKeys) {
  const Scene scene = parse(R"(
schema: 1
duration: 1
defaults:
  objects: {contact: {modulus: 20 kPa, friction: 0.5}, colour: [1, 0, 0], skeleton: [{shape: point, kernel: {type: wyvill, radius: 1}}]}
objects:
  - {name: a, particles: {arrange: single, mass: 1}, contact: {friction: 0.1}}
  - {name: b, particles: {arrange: single, mass: 1}, colour: [0, 1, 0]}
)");
  EXPECT_EQ(scene.objects[0].contact->modulus, 2e4);
  EXPECT_EQ(scene.objects[0].contact->friction, 0.1);
  EXPECT_EQ(scene.objects[1].contact->friction, 0.5);
  EXPECT_EQ(scene.objects[1].colour, Vec3(0, 1, 0));
  const Fault fault = faults("schema: 1\nduration: 1\ndefaults: {objcts: {}}\nobjects: []\n")[0];
  EXPECT_EQ(fault.key, "defaults.objcts");
  EXPECT_NE(fault.hint.find("objects"), std::string::npos);
}

TEST_F(ExpandedScene, MergesIncludedFiles) {
  write("ground.yaml", "gravity: [0, 0, -9.81]\nvariables: {r: 1 m, far: 2 m}\nobjects:\n  - {name: base, particles: {arrange: single, at: [\"${far}\", 0, 0], mass: 1}}\n");
  write("more.yaml", "include: ground.yaml\nframe_rate: 12\n");
  const Scene scene = parse(R"(
include: more.yaml
schema: 1
duration: 1
frame_rate: 30
variables: {r: 3 m}
objects:
  - {name: own, particles: {arrange: single, at: ["${r}", 0, 0], mass: 1}}
)");
  EXPECT_EQ(scene.frame_rate, 30.0);
  EXPECT_EQ(scene.gravity, Vec3(0, 0, -9.81));
  ASSERT_EQ(scene.objects.size(), 2U);
  EXPECT_EQ(scene.objects[0].particles.at.x(), 2.0);
  EXPECT_EQ(scene.objects[1].particles.at.x(), 3.0);
}

TEST_F(ExpandedScene, MergesFilesIntoItemsAsOftenAsTheyAreIncluded) {
  write("jelly.yaml", "material: {youngs_modulus: 1e4, density: 1000}\nparticles: {arrange: points, points: [[0, 0, 0], [0, 0, 1]], bonds: [0, 1], at: [9, 9, 9]}\n"
                      "skeleton: [{shape: point, at: [0, 0, 0.1], kernel: {radius: 2}}]\ncontact: {friction: 0.25}\n");
  const Scene scene = parse(R"(
schema: 1
duration: 1
include: supple:materials
objects:
  - {name: a, include: jelly.yaml, particles: {at: [0, 0, 2]}}
  - {repeat: 2, name: "b${i}", include: jelly.yaml, particles: {at: ["${1.5*i}", 0, 0]}, scale: 3, material: rubber}
)");
  ASSERT_EQ(scene.objects.size(), 3U);
  EXPECT_EQ(scene.objects[0].particles.at, Vec3(0, 0, 2));
  EXPECT_EQ(scene.objects[0].particles.points[1], Vec3(0, 0, 1));
  EXPECT_EQ(scene.objects[0].material->density, 1000.0);
  EXPECT_EQ(scene.objects[2].particles.at, Vec3(1.5, 0, 0));
  EXPECT_EQ(scene.objects[2].particles.points[1], Vec3(0, 0, 3));
  EXPECT_DOUBLE_EQ(scene.objects[2].skeleton[0].at.z(), 0.3);
  EXPECT_EQ(scene.objects[2].skeleton[0].kernel.radius, 6.0);
  EXPECT_EQ(scene.objects[2].material->youngs_modulus, 2e6);
  EXPECT_EQ(scene.objects[2].contact->friction, 0.25);
}

TEST_F(ExpandedScene, ScaleMultipliesLengthsOnly) {
  const std::string head = "schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: {arrange: grid, columns: 2, rows: 2, spacing: 0.5, at: [1, 1, 1], mass: 2}\n";
  const Scene scene = parse(head + "    interactions: [{law: bond_frame, within: 0.6, stretch: 7, rotation: 1}]\n"
                                   "    skeleton: [{shape: segment, half_length: 0.25, end_radius: 0.4, stretch: [1, 2, 1], kernel: {type: gascuel, radius: 0.5, thickness: 0.2, slope: 2}}]\n"
                                   "    meshing: {cell: 0.05}\n    scale: 10\n");
  const ObjectDesc& d = scene.objects[0];
  EXPECT_EQ(d.particles.spacing, 5.0);
  EXPECT_EQ(d.particles.at, Vec3(1, 1, 1));
  EXPECT_EQ(d.particles.mass, 2.0);
  EXPECT_EQ(d.interactions[0].within, 6.0);
  EXPECT_EQ(d.interactions[0].stretch, 7.0);
  EXPECT_EQ(d.skeleton[0].half_length, 2.5);
  EXPECT_EQ(d.skeleton[0].end_radius, 4.0);
  EXPECT_EQ(d.skeleton[0].stretch, Vec3(1, 2, 1));
  EXPECT_EQ(d.skeleton[0].kernel.radius, 5.0);
  EXPECT_EQ(d.skeleton[0].kernel.thickness, 2.0);
  EXPECT_DOUBLE_EQ(*d.skeleton[0].kernel.slope, 0.2);
  EXPECT_EQ(d.meshing.cell, 0.5);
}

TEST_F(ExpandedScene, NamesThePlaceInTheIncludedFile) {
  write("part.yaml", "objects:\n  - name: a\n    particles: {arrange: single, mass: -1}\n");
  const Fault fault = faults("include: part.yaml\nschema: 1\nduration: 1\n")[0];
  EXPECT_NE(fault.place.find("part.yaml:3:40"), std::string::npos) << fault.place;
  EXPECT_EQ(fault.key, "objects[0].particles.mass");
}

TEST_F(ExpandedScene, RefusesIncludesInACircleOutsideItsFolderAndOfOtherFiles) {
  write("a.yaml", "include: b.yaml\n");
  write("b.yaml", "include: a.yaml\n");
  EXPECT_EQ(faults("include: a.yaml\nschema: 1\n")[0].expected, "expected files that do not include one another in a circle");
  EXPECT_EQ(faults("include: ../other.yaml\nschema: 1\n")[0].expected, "expected a file inside the scene's folder");
  EXPECT_EQ(faults("include: /etc/passwd\nschema: 1\n")[0].expected, "expected a file inside the scene's folder");
  EXPECT_EQ(faults("include: none.yaml\nschema: 1\n")[0].found, "no file 'none.yaml'");
  try {  // beside a scene that is named without a folder
    (void)parse_scene("include: none.yaml\nschema: 1\n", "test.yaml", "");
    ADD_FAILURE() << "no fault";
  } catch (const Error& error) {
    EXPECT_EQ(error.faults()[0].found, "no file 'none.yaml'");
  }
  fs::create_symlink("/etc/passwd", folder_ / "link.yaml");
  EXPECT_EQ(faults("include: link.yaml\nschema: 1\n")[0].expected, "expected a file inside the scene's folder");
  fs::create_directories(folder_ / "inner");
  EXPECT_EQ(faults("include: inner\nschema: 1\n")[0].found, "'inner', a folder");
  write("many.yaml", "duration: 1\n");
  std::string many = "schema: 1\ninclude: [many.yaml";
  for (int i = 0; i < 100; ++i) many += ", many.yaml";
  EXPECT_EQ(faults(many + "]\n")[0].expected, "expected at most 64 included files");
}

TEST_F(ExpandedScene, RefusesWhatHasNoValue) {
  const auto fault = [&](const std::string& variables, const std::string& mass) {
    return faults("schema: 1\nduration: 1\nvariables: {" + variables + "}\nobjects:\n  - {name: a, particles: {arrange: single, mass: \"" + mass + "\"}}\n")[0];
  };
  EXPECT_EQ(fault("a: \"${b}\", b: \"${a}\"", "1").expected, "expected variables that do not depend on themselves");
  EXPECT_EQ(fault("m: 1", "1").expected, "expected a name that is no unit");
  EXPECT_EQ(fault("sin: 1", "1").expected, "expected a name that is no function or constant");
  EXPECT_EQ(fault("long-name: 1", "1").expected, "expected a name of letters, digits and _");
  EXPECT_EQ(fault("list: [1]", "1").expected, "expected a number, a quantity or a text");
  EXPECT_EQ(fault("x: 1", "${x").expected, "expected '}' at the end of an expression");
  EXPECT_EQ(fault("x: 1 m", "${x}").key, "objects[0].particles.mass");
  EXPECT_EQ(fault("x: red", "${2*x}").found, "the text 'red'");
  EXPECT_EQ(fault("x: 1", "${y}").key, "objects[0].particles.mass");
  EXPECT_NE(fault("width: 1", "${widht}").hint.find("did you mean 'width'?"), std::string::npos);
}

TEST_F(ExpandedScene, RefusesRepetitionsThatAreTooMany) {
  const auto expected = [&](const std::string& repeat) {
    return faults("schema: 1\nduration: 1\nobjects:\n  - {repeat: " + repeat + ", name: \"a${i}\", particles: {arrange: single, mass: 1}}\n")[0].expected;
  };
  EXPECT_EQ(expected("1000000000"), "expected a whole number from 0 to 200000");
  EXPECT_EQ(expected("1.5"), "expected a whole number from 0 to 200000");
  EXPECT_EQ(expected("2 m"), "expected a whole number from 0 to 200000");
  EXPECT_EQ(expected("{i: 200000, j: 200000, k: 200000}"), "expected at most 200000 nodes, every repetition counted");
  const Fault name = faults("schema: 1\nduration: 1\nobjects:\n  - {repeat: {count: 4, index: k}, name: \"a${k}\", particles: {arrange: single, mass: 1}}\n")[0];
  EXPECT_EQ(name.key, "objects[0].repeat.index");
  EXPECT_EQ(name.hint, "a mapping gives each index its count, as 'repeat: {i: 3, j: 4}'");
}

TEST_F(ExpandedScene, SaysThatExpressionsInFlowCollectionsNeedQuotes) {
  EXPECT_EQ(faults("schema: 1\nobjects:\n  - {particles: {mass: ${1}}}\n")[0].hint, "expressions inside [ ] or { } need quotes: \"${...}\"");
}

TEST_F(ExpandedScene, LeavesDollarsThatOpenNoExpression) {
  EXPECT_EQ(parse("schema: 1\nduration: 1\ntitle: 5 $ and $${x}\nobjects: [{name: a, particles: {arrange: single, mass: 1}}]\n").title, "5 $ and ${x}");
}

}  // namespace
}  // namespace supple::scenes
