#include "supple/scenes/model.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>

#include "model/warnings.h"
#include "simulation/frame.h"
#include "supple/core/error.h"
#include "supple/core/interactions.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Model model_of(const std::string& text) { return build_model(parse_scene(text, "test.yaml", "")); }

constexpr const char* kHead = "schema: 1\nduration: 1\nobjects:\n";
constexpr const char* kSpiral = R"(
  - name: spiral
    particles: {arrange: spiral, count: 10, inner_radius: 0.15, outer_radius: 0.55, turns: 1.2, normal: radial, mass: 20 g}
    interactions:
      - {law: bond_frame, neighbours: 2, stretch: 400, rotation: 1.5}
      - {law: form, strength: 2}
      - {law: cohesion, maximum_distance: 0.6, maximum_force: 3}
      - {law: friction, linear: 0.4, angular: 0.01}
      - {law: friction, linear: 0.1}
    skeleton: [{shape: square, half_size: 0.09, kernel: {radius: 0.16}}]
    contact: {modulus: 2e4, friction: 0.4, dissipation: 0.5}
    medium: {linear: 2}
    pins: [{particle: 0, orientation: false}, {particle: -1}]
    loads: [{particle: -2, force: [0, 1, 0], from: 1, until: 2, ramp: 0.1}]
)";
constexpr const char* kBall = R"(
  - name: ball
    particles: {at: [-1.4, 0.05, 0], velocity: [2.5, 0, 0], spin: [0, 0, 3], mass: 0.1}
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
    contact: {modulus: 1e4, friction: 0.9}
)";
// (1 - d^2/R^2)^3 = 1/2 at d = sqrt(1 - 2^(-1/3)) R.
const double kIso = std::sqrt(1.0 - std::cbrt(0.5));

TEST(Model, CountsWhatTheSceneSays) {
  const Model model = model_of(std::string(kHead) + kSpiral + kBall);
  ASSERT_EQ(model.objects.size(), 2u);
  EXPECT_EQ(model.objects[0].name, "ball");
  EXPECT_EQ(model.objects[1].first, 1u);
  EXPECT_EQ(model.objects[1].last, 11u);
  EXPECT_EQ(model.particles.size(), 11u);
  ASSERT_EQ(model.interactions.bond_frame.size(), 1u);
  EXPECT_EQ(model.interactions.bond_frame[0].law.size(), 9u + 8u);
  EXPECT_EQ(model.interactions.bond_frame[0].name, "spiral/bond_frame");
  EXPECT_EQ(model.interactions.friction[1].name, "spiral/friction.2");
  EXPECT_EQ(model.interactions.form[0].law.size(), 9u);
  EXPECT_EQ(model.objects[1].skeleton.primitive.size(), 10u);
  EXPECT_GT(model.objects[1].samples.size(), 320u);
  EXPECT_TRUE(model.objects[0].collides);
  EXPECT_EQ(model.interactions.medium[0].object, 1u);
  EXPECT_EQ(model.particles.pinned[1], core::kPinPosition);
  EXPECT_EQ(model.particles.pinned[10], core::kPinPosition | core::kPinOrientation);
  EXPECT_EQ(model.interactions.external[0].particle, 9u);
  EXPECT_EQ(model.interactions.external[0].end, 2.0);
}

TEST(Model, TakesRestDataFromTheArrangement) {
  const Model model = model_of(std::string(kHead) + kSpiral);
  const auto& position = model.rest.position;
  const auto& form = model.interactions.form[0];
  for (std::size_t b = 0; b < form.law.size(); ++b) {
    const std::uint32_t i = form.first[b], j = form.second[b];
    const Vec3 r = position[j] - position[i];
    const Vec3 change = model.rest.orientation[j] * Vec3::UnitZ() - model.rest.orientation[i] * Vec3::UnitZ();
    EXPECT_NEAR(form.law[b].curvature, r.dot(change) / r.squaredNorm(), 1e-12);  // least squares of one curvature a pair
    EXPECT_GT(form.law[b].curvature, 0.0);
    EXPECT_NEAR(model.interactions.cohesion[0].law[b].r0, r.norm(), 1e-15);
  }
  // At rest no bond is strained: the frame memory has its minimum 0 there.
  EXPECT_NEAR(model.interactions.bond_frame[0].law[0].rest_a.norm(), (position[1] - position[0]).norm(), 1e-15);
  double largest = 0.0;
  for (const Vec3& a : position) {
    for (const Vec3& b : position) largest = std::max(largest, (a - b).norm());
  }
  EXPECT_DOUBLE_EQ(model.objects[0].rest_diameter, largest);
}

TEST(Model, GivesParticlesTheInertiaOfABall) {
  const Model model = model_of(std::string(kHead) + kSpiral + kBall);
  const double a = kIso * 0.5;  // alone: the iso radius
  EXPECT_NEAR(model.particles.inertia[0].x(), 0.4 * 0.1 * a * a, 1e-15);
  const double r = (model.rest.position[2] - model.rest.position[1]).norm();
  EXPECT_NEAR(model.particles.inertia[1].y(), 0.4 * 0.02 * 0.25 * r * r, 1e-15);
  const Model given = model_of(std::string(kHead) + "  - {name: a, particles: {mass: 2, inertia_radius: 0.5}}\n");
  EXPECT_DOUBLE_EQ(given.particles.inertia[0].z(), 0.4 * 2 * 0.25);
}

TEST(Model, FindsNearestNeighboursOfUnevenPoints) {
  // A pair close together and one far away: each has its own nearest distance.
  const fs::path folder = temp_folder() / "model_points";
  fs::create_directories(folder);
  std::ofstream(folder / "points.csv") << "x,y,z\n0,0,0\n0.1,0,0\n5,0,0\n5,3,0\n";
  const std::string text = std::string(kHead) + "  - {name: a, particles: {arrange: file, file: points.csv}}\n";
  const Model model = build_model(parse_scene(text, "test.yaml", folder));
  ASSERT_EQ(model.particles.size(), 4u);
  const double expected[] = {0.1, 0.1, 3.0, 3.0};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(model.particles.inertia[i].x(), 0.1 * expected[i] * expected[i], 1e-12);
  EXPECT_NEAR(model.objects[0].rest_diameter, std::hypot(5.0, 3.0), 1e-15);
}

TEST(Model, FindsNearestNeighboursOfManyPoints) {
  const Model model = model_of(std::string(kHead) +
                               "  - {name: a, particles: {arrange: grid, columns: 7, rows: 6, layers: 5, spacing: 1, disorder: 0.9}}\n");
  const std::vector<Vec3>& position = model.rest.position;
  for (std::size_t i = 0; i < position.size(); ++i) {
    double nearest = 100.0;
    for (std::size_t j = 0; j < position.size(); ++j) nearest = j == i ? nearest : std::min(nearest, (position[j] - position[i]).norm());
    EXPECT_DOUBLE_EQ(model.particles.inertia[i].x(), 0.1 * nearest * nearest * model.particles.mass[i]);
  }
}

TEST(Model, StartsAsARigidMotionAboutTheCentreOfMass) {
  const Model model = model_of(std::string(kHead) +
                               "  - {name: a, particles: {arrange: line, count: 2, spacing: 2, at: [5, 0, 0], velocity: [1, 0, 0], "
                               "spin: [0, 0, 3], mass: 2, inertia_radius: 1}}\n");
  EXPECT_NEAR((model.initial.velocity[0] - Vec3(1, -3, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((model.initial.velocity[1] - Vec3(1, 3, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((model.initial.angular_momentum[0] - Vec3(0, 0, 0.8 * 3)).norm(), 0.0, 1e-15);
  EXPECT_EQ(model.rest.velocity[0], Vec3(0, 0, 0));
}

TEST(Model, RefusesScenesMadeByHandThatNoFileCouldAskFor) {
  const Scene scene = parse_scene(std::string(kHead) + kBall, "test.yaml", "");
  for (const double wrong : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    Scene rate = scene, duration = scene, mass = scene;
    rate.frame_rate = duration.duration = wrong;
    mass.objects[0].particles.mass = wrong;
    for (const Scene* s : {&rate, &duration, &mass}) EXPECT_THROW((void)build_model(*s), ContractViolation) << wrong;
  }
}

TEST(Model, HasALengthWhereParticlesLieAtOnePlace) {
  const std::filesystem::path folder = temp_folder() / "model";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "twice.csv") << "0, 0, 0\n0, 0, 0\n";
  const auto length = [&](const std::string& rest) {
    return build_model(parse_scene(std::string(kHead) + "  - {name: a, particles: {arrange: file, file: twice.csv" + rest + "}\n", "test.yaml", folder)).smallest_length;
  };
  EXPECT_EQ(length(", inertia_radius: 0.02}"), 0.02);
  const double ball = length("}, separate: true, skeleton: [{shape: point, kernel: {radius: 0.1}}]");
  EXPECT_NEAR(ball, 0.1 * kIso, 1e-6);
  std::filesystem::remove_all(folder);
}

TEST(Model, DoesNotDependOnTheOrderOfObjectsInTheFile) {
  const Model one = model_of(std::string(kHead) + kSpiral + kBall);
  const Model two = model_of(std::string(kHead) + kBall + kSpiral);
  ASSERT_EQ(one.particles.size(), two.particles.size());
  for (std::size_t i = 0; i < one.particles.size(); ++i) {
    EXPECT_EQ(one.initial.position[i], two.initial.position[i]);
    EXPECT_EQ(one.initial.orientation[i].coeffs(), two.initial.orientation[i].coeffs());
    EXPECT_EQ(one.particles.inertia[i], two.particles.inertia[i]);
  }
  EXPECT_EQ(one.objects[1].samples.foot, two.objects[1].samples.foot);
  EXPECT_EQ(one.cell, two.cell);
  EXPECT_EQ(one.contact_frequency, two.contact_frequency);
}

TEST(Model, ChoosesCellAndContactFrequencyFromTheSurfaces) {
  const Model model = model_of(std::string(kHead) + kSpiral + kBall);
  // The ball with its support is 1 m wide, 64 cells; 8 cells across the plates would be coarser.
  ASSERT_GT(2.0 * kIso * 0.16 / 8.0, 1.0 / 64.0);
  EXPECT_NEAR(model.cell, 1.0 / 64.0, 1e-12);
  EXPECT_NEAR(model.smallest_length, kIso * 0.16, 1e-12);
  // A linear ball against a rigid plane has the stiffness 2 pi K (a d - d^2) <= pi K a^2 / 2 (theory of contact, 7.8).
  const double a = kIso * 0.16;
  const double slope = 6.0 * kIso / 0.16 * std::pow(1.0 - kIso * kIso, 2);
  EXPECT_NEAR(model.contact_frequency, std::sqrt(2e4 * slope * std::acos(-1.0) * a * (a + 0.09) / 0.02),
              1e-9 * model.contact_frequency);
  EXPECT_EQ(model_of(std::string(kHead) + kSpiral).contact_frequency, 0.0);  // nothing to touch
}

// Hunt & Crossley: y - ln(1 + y) + e y + ln(1 - e y) = 0 with y = d v; table of the theory (7.7).
TEST(Warnings, TellWhatIsOddAtTheStart) {
  const auto warnings_of = [](const std::string& objects) {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\nground: {}\n" + objects, "test.yaml", ".")).warnings();
  };
  const std::string ball = "kernel: {radius: 0.3}}], contact: {}}\n";
  EXPECT_TRUE(warnings_of("objects:\n  - {name: a, particles: {at: [0, 0, 0.2]}, skeleton: [{shape: point, " + ball).empty());
  const auto sunk = warnings_of("objects:\n  - {name: a, particles: {at: [0, 0, -0.1]}, skeleton: [{shape: point, " + ball);
  ASSERT_EQ(sunk.size(), 1u);
  EXPECT_NE(sunk[0].find("'a' and 'ground' overlap so deeply"), std::string::npos) << sunk[0];
  const std::string small = "objects:\n  - {name: a, particles: {at: [0, 0, 1]}, skeleton: [{shape: point, " + ball;
  EXPECT_TRUE(warnings_of("output: {cell: 5}\n" + small).empty());  // is searched
  EXPECT_EQ(warnings_of("output: {cell: 5, meshing: {method: tetrahedra}}\n" + small).size(), 1u);
  const auto coarse = warnings_of("output: {cell: 5, meshing: {search: false}}\n" + small);
  ASSERT_EQ(coarse.size(), 1u);
  EXPECT_NE(coarse[0].find("cells of 5 m may miss 'a'"), std::string::npos) << coarse[0];
  // A search finds a whole ball, but does not join what comes apart. Thickness: 2 (1 - 2^(-1/3))^(1/2) 0.009 m.
  const auto rod = [&](const std::string& output) {
    return warnings_of("output: {" + output + "}\nobjects:\n  - {name: a, particles: {at: [0, 0, 1]}, skeleton: "
                       "[{shape: segment, half_length: 0.4, kernel: {radius: 9 mm}}]}\n");
  };
  const std::string lost = "output.cell: lattice cells of 0.015 m may miss 'a' or break it into pieces, as it is 0.00817564 m thick; "
                           "use smaller cells or 'output.meshing.error'";
  EXPECT_EQ(rod("cell: 15 mm"), std::vector<std::string>{lost});
  EXPECT_EQ(rod("cell: 15 mm, meshing: {search: true}"), std::vector<std::string>{lost});
  EXPECT_EQ(rod("cell: 15 mm, meshing: {method: openvdb}"), std::vector<std::string>{lost + " with method auto"});
  EXPECT_TRUE(rod("cell: 15 mm, meshing: {error: 0.5 mm}").empty());
  EXPECT_TRUE(rod("cell: 8 mm").empty());
  EXPECT_TRUE(warnings_of("output: {cell: 15 mm}\nobjects:\n  - {name: a, particles: {at: [0, 0, 1]}, skeleton: "
                          "[{shape: box, half_sizes: [0.1, 0.1, 0.1], kernel: {radius: 9 mm}}]}\n").empty());
  const auto thin = warnings_of(
      "objects:\n  - {name: a, particles: {at: [0, 0, 1], inertia_radius: 0.1}, skeleton: [{shape: triangle, convolve: true, "
      "points: [[0.2, 0, 0], [-0.1, 0.17, 0], [-0.1, -0.17, 0]], kernel: {type: cauchy, radius: 0.35}}]}\n");
  ASSERT_EQ(thin.size(), 1u);
  EXPECT_NE(thin[0].find("'a' may have no surface"), std::string::npos) << thin[0];
}

// The slope of wyvill at its iso distance d = (1 - 2^(-1/3))^(1/2) R is 6 (d / R) 2^(-2/3) / R = 1.71678 / R.
TEST(Warnings, TellOfObstaclesThatAreFarSofterThanWhatTouchesThem) {
  const auto warnings_of = [](const std::string& size, const std::string& contact, const std::string& obstacles) {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\n" + obstacles + "objects:\n  - {name: a, particles: {at: [0, 0, " + size +
                                      "]}, skeleton: [{shape: point, kernel: {radius: " + size + "}}], contact: {" + contact + "}}\n",
                                  "test.yaml", ".")).warnings();
  };
  EXPECT_TRUE(warnings_of("0.1", "", "ground: {}\n").empty());
  EXPECT_TRUE(warnings_of("1.75 mm", "", "ground: {}\n").empty());  // 9.8 times softer
  const std::string ground = "ground.slope: 'ground' is 17167.8 times softer than 'a', which sinks into it: the pressure grows by 1e+06 Pa per metre of depth "
                             "in it, by 1.71678e+10 in 'a'; a slope of 17167.8 makes it as stiff";
  EXPECT_EQ(warnings_of("0.001 mm", "", "ground: {}\n"), std::vector<std::string>{ground});
  EXPECT_TRUE(warnings_of("0.001 mm", "", "ground: {slope: 17167.8}\n").empty());
  EXPECT_TRUE(warnings_of("0.001 mm", "", "ground: {slope: 2}\n").empty());  // a given slope is meant
  EXPECT_TRUE(warnings_of("0.001 mm", "", "ground: {collides: false}\n").empty());
  EXPECT_TRUE(warnings_of("0.001 mm", "", "ground: {}\npairs: [{objects: [a, ground], collide: false}]\n").empty());
  const auto box = warnings_of("0.1", "modulus: 1e9", "ground: {collides: false}\nobstacles: [{name: step, shape: box, at: [0, 0, -2], half_sizes: [1, 1, 1]}]\n");
  ASSERT_EQ(box.size(), 1u);
  EXPECT_NE(box[0].find("obstacles.step.slope: 'step' is 17167.8 times softer than 'a'"), std::string::npos) << box[0];
  // Primitives have the slope of their kernels: their modulus decides.
  const auto bar = [&](const std::string& modulus) {
    return warnings_of("0.1", "modulus: 1e9", "obstacles: [{name: bar, shape: implicit, at: [0, 0, -3]" + modulus +
                       ", skeleton: [{shape: segment, half_length: 1, kernel: {radius: 0.1}}]}]\n");
  };
  const auto soft = bar("");
  ASSERT_EQ(soft.size(), 1u);
  EXPECT_NE(soft[0].find("obstacles.bar.modulus: 'bar' is "), std::string::npos) << soft[0];
  EXPECT_TRUE(bar(", modulus: 1e5").empty());
}

TEST(Warnings, TellOfSamplesThatAreTooFarApartOrOfNoUse) {
  const auto warnings_of = [](const std::string& spacing, const std::string& shape, const std::string& obstacles = "") {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\nground: {}\ncontact: {sample_spacing: " + spacing + "}\n" + obstacles +
                                  "objects:\n  - {name: a, particles: {at: [0, 0, 1], inertia_radius: 0.1}, skeleton: [{shape: " + shape +
                                  ", kernel: {radius: 0.2}}], contact: {}}\n", "test.yaml", ".")).warnings();
  };
  // 2 (1 - 2^(-1/3))^(1/2) 0.2 = 0.1817 m thick
  EXPECT_TRUE(warnings_of("0.18", "ring, radius: 0.3").empty());
  const auto wide = warnings_of("1000", "ring, radius: 0.3");
  ASSERT_EQ(wide.size(), 1u);
  EXPECT_NE(wide[0].find("contact.sample_spacing: samples 1000 m apart may miss contacts of 'a', as it is 0.1816"), std::string::npos) << wide[0];
  const auto thin = warnings_of("0.18", "ring, radius: 0.3",
                                "obstacles: [{name: bar, shape: implicit, at: [0, 0, 3], skeleton: [{shape: segment, half_length: 1, kernel: {radius: 0.05}}]}]\n");
  ASSERT_EQ(thin.size(), 1u);
  EXPECT_NE(thin[0].find("may miss contacts of 'a', as an obstacle is 0.0454"), std::string::npos) << thin[0];
  const auto idle = warnings_of("0.1", "point");
  ASSERT_EQ(idle.size(), 1u);
  EXPECT_NE(idle[0].find("contact.sample_spacing: it has no effect"), std::string::npos) << idle[0];
}

TEST(Warnings, TellOfKeysThatChangeNothing) {
  const auto warnings_of = [](const std::string& text, const std::string& contact = "", const std::string& particles = "inertia_radius: 0.1") {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\n" + text + "objects:\n  - {name: a, particles: {at: [0, 0, 1], " + particles +
                                  "}, skeleton: [{shape: point, kernel: {radius: 0.2}}], contact: {" + contact + "}}\n"
                                  "  - {name: b, particles: {at: [0, 0, 2]}, skeleton: [{shape: point, kernel: {radius: 0.2}}], contact: {friction: 1}}\n",
                                  "test.yaml", ".")).warnings();
  };
  const auto expect = [](const std::vector<std::string>& found, const std::vector<std::string>& expected) { EXPECT_EQ(found, expected); };
  const std::string stick = "contact: {stick: {stiffness: 100}, friction_speed: 0.1}\n", rough = "ground: {friction: 0.5}\n";
  const std::string smooth = ": it has no effect, as no two bodies that may touch have friction";
  const std::vector<std::string> both{"contact.stick" + smooth, "contact.friction_speed" + smooth};
  expect(warnings_of(stick), both);
  expect(warnings_of(stick + rough + "pairs: [{objects: [b, ground], collide: false}]\n"), both);
  expect(warnings_of(stick + rough + "pairs: [{objects: [b, ground], friction: 0}]\n"), both);
  expect(warnings_of(stick + rough), {});
  expect(warnings_of(stick + "pairs: [{objects: [a, b], friction: 0.1}]\n"), {});
  expect(warnings_of(stick, "friction: 0.1"), {});
  expect(warnings_of("contact: {friction_speed: 0.1}\n"), {both[1]});

  expect(warnings_of("contact: {bulge: 0, bulge_width: 0.2, bulge_literal: true}\n"),
         {"contact.bulge_width: it has no effect, as 'bulge' is 0", "contact.bulge_literal: it has no effect, as 'bulge' is 0"});
  expect(warnings_of("contact: {bulge: 0.1, bulge_width: 0.2}\n"), {});
  expect(warnings_of("contact: {bulge_volume: true, bulge_width: 0.2}\n"), {});

  expect(warnings_of(rough + "pairs: [{objects: [a, ground], collide: true}, {objects: [b, a]}]\n"),
         {"pairs[1]: it has no effect, as it has no key beside 'objects'"});
  expect(warnings_of(rough + "pairs: [{objects: [a, ground], until: 0.5 s}, {objects: [b, a], from: 0.1 s}]\n"), {});

  const std::string line = "arrange: line, count: 3, spacing: 0.1";
  const std::vector<std::string> whole{"objects.a.contact.self: it has no effect, as no parts of the object can touch each other: they blend or are bonded"};
  expect(warnings_of("", "self: true"), whole);
  expect(warnings_of("", "self: true", line), whole);
  expect(warnings_of("", "self: false", line), {});
  expect(warnings_of("", "", line), {});

  const std::string motion = "output: {meshing: {motion: true}, mesh: ";
  expect(warnings_of(motion + "obj}\n"), {"output.meshing.motion: it has no effect, as OBJ files have no such columns; ply and usd have"});
  expect(warnings_of(motion + "[obj, ply]}\n"), {});
}

TEST(Warnings, TellOfContactsThatAreNotSolvedAsWellAsAsked) {
  // The patch of a ring on the ground: polar rings do not fit, marching reaches the error.
  const auto scene_of = [](const std::string& rule) {
    return parse_scene("schema: 1\nduration: 0.02 s\nframe_rate: 100\nground: {modulus: 1e6}\ncontact: {error: 1e-3, rule: " + rule + "}\nobjects:\n"
                       "  - {name: hoop, particles: {at: [0, 0, 0.085]}, skeleton: [{shape: ring, radius: 0.3, kernel: {type: wyvill, radius: 0.2}}], "
                       "contact: {modulus: 1e4}}\n", "test.yaml", ".");
  };
  const auto warnings_of = [&](const std::string& rule) {
    Simulation simulation(scene_of(rule));
    while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
    return simulation.warnings();
  };
  EXPECT_TRUE(warnings_of("auto").empty());
  EXPECT_EQ(warnings_of("polar"), std::vector<std::string>{"contact.rule: polar does not fit the contact of 'hoop' and 'ground', which has no force then; 'auto' fits all contacts"});

  // Estimates above the error, whichever rule they are of: once for all steps.
  Simulation simulation(scene_of("auto"));
  collision::ContactSurface surface = simulation.contacts();
  ASSERT_EQ(surface.summary.size(), 1u);
  const Executor executor(1);
  Profile unused{};
  const StageContext context{simulation.model(), simulation.bodies(), simulation.model().rules, executor, unused};
  UnmetContacts unmet;
  for (const auto& [estimate, time] : {std::pair(0.5e-3, 0.0), std::pair(2e-3, 0.1), std::pair(8e-2, 0.2), std::pair(1.005e-3, 0.3)}) {
    surface.summary[0].error_estimate = estimate;
    unmet.look(context, surface, time);
  }
  std::vector<std::string> warnings;
  unmet.add_to(1e-3, warnings);
  EXPECT_EQ(warnings, std::vector<std::string>{"contact.error: contact of 'hoop' and 'ground' misses the given 0.001: its largest error estimate is 0.08 at t = 0.2 s, and 2 are too large from t = 0.1 s on"});
}

TEST(Warnings, LookForRingsArcsAndCurvesWhereTheyAre) {
  const auto warnings_of = [](const std::string& objects) {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\nobjects:\n" + objects, "test.yaml", ".")).warnings();
  };
  const std::string kernel = ", kernel: {radius: 0.1}}], contact: {}}\n";
  const std::string ball = "  - {name: ball, particles: {}, skeleton: [{shape: point, kernel: {radius: 0.4}}], contact: {}}\n";
  const auto beside = [&](const std::string& shape) { return warnings_of(ball + "  - {name: a, particles: {}, skeleton: [{" + shape + kernel); };
  // Around the ball without a touch, and with a surface though the middle of the circle has none.
  EXPECT_TRUE(beside("shape: ring, radius: 0.5").empty());
  EXPECT_TRUE(beside("shape: ring, radius: 0.5, convolve: true").empty());
  EXPECT_TRUE(beside("shape: arc, radius: 0.5, half_angle_deg: 80, convolve: true").empty());
  // The mean of the corners lies in the ball, the curve passes it by.
  EXPECT_TRUE(beside("shape: curve, points: [[-0.5, 0, -0.45], [0, 0, 0.9], [0.5, 0, -0.45]]").empty());
  EXPECT_FALSE(beside("shape: ring, radius: 0.1").empty());
  EXPECT_FALSE(beside("shape: curve, points: [[-0.5, 0, 0], [0, 0, 0.05], [0.5, 0, 0]]").empty());
}

/// In world axes at the start.
Mat3 inertia_of(const Model& model, std::size_t i) {
  const Mat3 q = model.initial.orientation[i].toRotationMatrix();
  return q * model.particles.inertia[i].asDiagonal() * q.transpose();
}

TEST(Model, FindsTheMomentsOfARodThatLiesAskew) {
  // A rod of length l and radius a along u with round ends: mean squares of a cylinder and of two half balls.
  const Model model = model_of(std::string(kHead) +
                               "  - {name: a, particles: {mass: 3}, skeleton: [{shape: curve, points: [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]], "
                               "kernel: {radius: 0.02}}]}\n");
  const double a = kIso * 0.02, l = std::sqrt(3.0), ends = 4.0 * a / (3.0 * l + 4.0 * a);
  const double along = (1.0 - ends) * l * l / 12.0 + ends * (l * l / 4.0 + 3.0 / 8.0 * a * l + a * a / 5.0);
  const double across = (1.0 - ends) * a * a / 4.0 + ends * a * a / 5.0;
  const Vec3 u = Vec3::Ones().normalized();
  const Mat3 around = u * u.transpose();
  const Mat3 expected = 3.0 * ((along + across) * (Mat3::Identity() - around) + 2.0 * across * around);
  EXPECT_LT((inertia_of(model, 0) - expected).cwiseAbs().maxCoeff(), 0.005 * expected.trace());
}

TEST(Model, ASolidTurnedInItsParticleTurnsAsOneWhoseParticleIsTurned) {
  const std::string shape = "skeleton: [{shape: ellipsoid, semi_axes: [0.5, 0.3, 0.2], kernel: {}";
  const std::string spin = "particles: {at: [1, 2, 3], spin: [1, -2, 0.5], mass: 2";
  const Model turned = model_of(std::string(kHead) + "  - {name: a, " + spin + ", axis: [0.6, 0, 0.8]}, " + shape + "}]}\n");
  const Model askew = model_of(std::string(kHead) + "  - {name: a, " + spin + "}, " + shape +
                               ", turn_axis: [0, 1, 0], turn_deg: 36.86989764584402}]}\n");
  EXPECT_LT((inertia_of(askew, 0) - inertia_of(turned, 0)).norm(), 1e-12);
  EXPECT_LT((askew.initial.angular_momentum[0] - turned.initial.angular_momentum[0]).norm(), 1e-12);
  const Quat direction = askew.initial.orientation[0] * askew.objects[0].skeleton.primitive[0].offset.orientation;
  EXPECT_NEAR(direction.angularDistance(turned.initial.orientation[0]), 0.0, 1e-7);
  EXPECT_NEAR((askew.initial.orientation[0] * askew.particles.normal[0] - Vec3::UnitZ()).norm(), 0.0, 1e-12);
}

TEST(Planar, HoldsEveryParticleInOnePlane) {
  const Model model = model_of("planar: true\n" + std::string(kHead) + kSpiral);
  EXPECT_EQ(model.particles.pinned[0], core::kPinPosition | core::kPlanar);
  EXPECT_EQ(model.particles.pinned[5], core::kPlanar);
  EXPECT_EQ(model_of(std::string(kHead) + kSpiral).particles.pinned[5], 0);
}

TEST(Planar, RefusesParticlesAtDifferentHeights) {
  try {
    (void)model_of("planar: true\n" + std::string(kHead) +
                   "  - {name: a, particles: {arrange: line, count: 3, spacing: 1, axis: [1, 0, 0], inertia_radius: 1}}\n");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    EXPECT_NE(std::string(error.what()).find("expected all particles at one z"), std::string::npos) << error.what();
  }
}

constexpr const char* kHinged = R"(
  - name: bar
    particles: {arrange: line, count: 7, spacing: 0.1}
    kinds: [{type: 1, particles: [0, 1, 2]}, {hinge: true, particles: [3]}, {type: 2, particles: [4, 5, -1]}]
    interactions: [{law: bond_frame, neighbours: 2, stretch: 100, rotation: 1}]
    repulsion: {force: 1, distance: 0.05, length: 0.01}
)";

TEST(Kinds, KeepTheBondsThatInteractCompletely) {
  const Model model = model_of(std::string(kHead) + kHinged);
  const auto& law = model.interactions.bond_frame.at(0);
  for (std::size_t k = 0; k < law.law.size(); ++k) {
    EXPECT_FALSE(law.first[k] < 3 && law.second[k] > 3) << law.first[k] << ' ' << law.second[k];
  }
  EXPECT_EQ(law.law.size(), 6u + 5u - 1u);  // all but 2-4
  ASSERT_EQ(model.interactions.repulsion.size(), 1u);
  EXPECT_EQ(model.interactions.repulsion[0].kinds, core::PairKinds::Incomplete);
  const Model own = model_of(std::string(kHead) + kHinged + "    hinges_join: true\n");
  EXPECT_EQ(own.interactions.repulsion[0].kinds, core::PairKinds::IncompleteButHinges);
}

TEST(Kinds, DecideWhichPairsAGeometricLawOfASceneTakes) {
  const auto kinds_of = [](const std::string& more) {
    const Model model = model_of(std::string(kHead) + "  - {name: drop, particles: {arrange: line, count: 4, spacing: 0.1}, "
                                 "interactions: [{law: linear_cohesion, geometric: true, rest_distance: 0.1, scale_force: 1}]" +
                                 more + "}\n");
    return model.interactions.geometric_linear_cohesion.at(0).kinds;
  };
  EXPECT_EQ(kinds_of(""), core::PairKinds::Any);
  EXPECT_EQ(kinds_of(", kinds: [{hinge: true, particles: [1]}]"), core::PairKinds::Complete);
  EXPECT_EQ(kinds_of(", kinds: [{type: 1, particles: [1]}], hinges_join: true"), core::PairKinds::CompleteWithHinges);
}

TEST(Kinds, DoNotApplyToRepulsionBetweenAllOwnParticles) {
  const Model model = model_of(std::string(kHead) +
                               "  - {name: a, particles: {arrange: line, count: 3, spacing: 1},"
                               " repulsion: {force: 1, distance: 0.5, length: 0.1, own: true}}\n");
  ASSERT_EQ(model.interactions.repulsion.size(), 1u);
  EXPECT_EQ(model.interactions.repulsion[0].kinds, core::PairKinds::Any);
  EXPECT_EQ(model.interactions.repulsion[0].object_a, model.interactions.repulsion[0].object_b);
}

TEST(Restitution, GivesTheDissipationOfTheTable) {
  const double table[][2] = {{0.01, 0.99337745}, {0.1, 0.93747558}, {0.5, 0.74843493}, {1, 0.59362426},
                             {2, 0.41071969},    {5, 0.19698025},   {20, 0.05000000}};
  for (const auto& [y, e] : table) {
    const std::string text = std::string(kHead) + kSpiral + kBall + "pairs: [{objects: [spiral, ball], restitution: {value: " +
                             std::to_string(e) + "00, at_speed: 2}}]\n";
    const Model model = model_of(text);
    ASSERT_EQ(model.rules.overrides.size(), 1u);
    EXPECT_EQ(model.rules.overrides[0].pair.a, 0u);
    // The table rounds e at 5e-9, std::to_string at 5e-7; dy/de is 1.5 at small y and y^2 at large y.
    EXPECT_NEAR(model.rules.overrides[0].material.dissipation * 2.0, y, 6e-7 * std::max(2.0, 2.0 * y * y)) << e;
    EXPECT_NEAR(model.rules.overrides[0].material.friction, std::sqrt(0.4 * 0.9), 1e-15);
  }
}

TEST(Restitution, OfOneNeedsNoDissipation) {
  const Model model = model_of(std::string(kHead) + kSpiral + kBall +
                               "pairs: [{objects: [spiral, ball], friction: 0.2, restitution: {value: 1, at_speed: 2}}]\n");
  EXPECT_EQ(model.rules.overrides[0].material.dissipation, 0.0);
  EXPECT_EQ(model.rules.overrides[0].material.friction, 0.2);
}

TEST(Pairs, ThatDoNotCollideRepelWhenBothCan) {
  const std::string repulsion = "    repulsion: {force: 2, distance: 0.1, length: 0.02}\n";
  const std::string objects = std::string(kHead) + kSpiral + repulsion + kBall + repulsion;
  const Model touching = model_of(objects);
  EXPECT_TRUE(touching.interactions.repulsion.empty());
  EXPECT_FALSE(touching.rules.allowed);
  const Model apart = model_of(objects + "pairs: [{objects: [ball, spiral], collide: false}]\n");
  ASSERT_TRUE(apart.rules.allowed);
  EXPECT_FALSE(apart.rules.allowed(0, 1));
  EXPECT_FALSE(apart.rules.allowed(1, 0));
  EXPECT_TRUE(apart.rules.allowed(0, 2));
  ASSERT_EQ(apart.interactions.repulsion.size(), 1u);
  EXPECT_EQ(apart.interactions.repulsion[0].law.force, 2.0);
  EXPECT_EQ(apart.interactions.repulsion[0].range, apart.interactions.repulsion[0].law.cut_off());
  EXPECT_EQ(apart.objects[0].samples.size(), 0u);  // nothing left to touch
}

TEST(Ground, IsTheLastBody) {
  const Model model = model_of(std::string(kHead) + kBall +
                               "ground: {height: -0.5, friction: 0.4}\npairs: [{objects: [ground, ball], friction: 0.1}]\n");
  ASSERT_EQ(model.fixed.size(), 1u);
  EXPECT_EQ(std::get<implicit::HalfSpace>(model.fixed[0].solid).point.z(), -0.5);
  ASSERT_EQ(model.rules.overrides.size(), 1u);
  EXPECT_EQ(model.rules.overrides[0].pair, (collision::BodyPair{0, 1}));
  EXPECT_TRUE(model_of(std::string(kHead) + kBall + "ground: {collides: false}\n").fixed.empty());
}

TEST(Seeds, AreMadeOnlyForWhatIsNotAllConvex) {
  const std::string ring = "  - name: ring\n    particles: {at: [0, 0, 2]}\n    skeleton: [{shape: ring, radius: 1, kernel: {radius: 0.2}}]\n    contact: {}\n";
  const std::string pair = "  - name: pair\n    particles: {arrange: line, count: 2, spacing: 0.5}\n" +
                           std::string("    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n    contact: {}\n");
  const auto seeds = [](const std::string& rest) { return model_of(std::string(kHead) + rest).objects[0].samples.size(); };
  EXPECT_EQ(seeds(kBall + std::string("ground: {}\n")), 0u);
  EXPECT_GT(seeds(kBall + ring), 0u);
  EXPECT_EQ(seeds(kBall + ring + "pairs: [{objects: [ball, ring], collide: false}]\n"), 0u);
  EXPECT_GT(seeds(pair + "ground: {}\n"), 0u);
  EXPECT_EQ(seeds(pair + "    separate: true\nground: {}\n"), 0u);
}

TEST(Seeds, AreAsFineAsTheirPrimitiveIsThick) {
  const auto seeds = [](const std::string& obstacles) {
    const Model model = model_of(std::string(kHead) + "  - name: a\n    particles: {arrange: line, count: 2, spacing: 1}\n    contact: {}\n" +
                                 "    skeleton: [{shape: point, kernel: {radius: 0.5}, particles: [0]}, {shape: point, kernel: {radius: 0.05}, particles: [1]}]\nground: {}\n" + obstacles);
    std::array<long, 2> count{};
    for (const std::uint32_t primitive : model.objects[0].samples.primitive) ++count[primitive];
    return count;
  };
  const auto [thick, thin] = seeds("");
  EXPECT_EQ(thick, thin);
  // Obstacles have no samples: those of all primitives see them.
  EXPECT_GT(seeds("obstacles: [{name: bar, shape: implicit, at: [0, 0, 3], skeleton: [{shape: segment, half_length: 1, kernel: {radius: 0.05}}]}]\n")[0], 50 * thick);
}

TEST(Skeletons, GoToTheParticlesNamed) {
  const Model model = model_of(std::string(kHead) + R"(
  - name: a
    particles: {arrange: line, count: 3, spacing: 1}
    skeleton:
      - {shape: ellipsoid, semi_axes: [0.3, 0.2, 0.4], kernel: {}}
      - {shape: box, half_sizes: [0.1, 0.2, 0.3], particles: [-1], turn_axis: [0, 0, 2], turn_deg: 90, kernel: {radius: 0.2}}
      - {shape: rectangle, half_sizes: [0.1, 0.2], particles: [0], kernel: {type: gascuel, radius: 0.2, thickness: 0.1, slope: 5}}
)");
  const auto& primitives = model.objects[0].skeleton.primitive;
  ASSERT_EQ(primitives.size(), 5u);
  EXPECT_EQ(primitives[0].shape, implicit::ShapeKind::Ellipsoid);
  EXPECT_EQ(primitives[0].kernel.radius, 0.2);  // its smallest semi-axis
  EXPECT_EQ(primitives[1].shape, implicit::ShapeKind::Rectangle);
  EXPECT_EQ(primitives[1].kernel.kind, implicit::KernelKind::Gascuel);
  EXPECT_EQ(primitives[4].part, 2u);
  EXPECT_NEAR((primitives[4].offset.orientation * Vec3::UnitX() - Vec3::UnitY()).norm(), 0.0, 1e-15);
  EXPECT_FALSE(model.objects[0].collides);
  EXPECT_EQ(model.objects[0].samples.size(), 0u);
}

TEST(Skeletons, TakeShapesKernelsAndStretchFromTheirKeys) {
  const Model model = model_of(std::string(kHead) + R"(
  - name: a
    particles: {}
    skeleton:
      - {shape: curve, points: [[0, 0, 0], [1, 0, 0], [1, 1, 0]], end_radius: 0.1, kernel: {type: blinn, radius: 0.4, sharpness: 3}}
      - {shape: arc, radius: 0.5, half_angle_deg: 90, convolve: true, stretch: [1, 2, 1], kernel: {type: cauchy, radius: 0.4}}
      - {shape: superquadric, semi_axes: [0.5, 0.4, 0.3], exponents: [0.2, 1], kernel: {type: blanc_schlick, hardness: 2}}
      - {shape: directed, radii: [0.5, 0.4, 0.3], radii_behind: [0.2, 0.4, 0.3], kernel: {}}
)");
  const auto& p = model.objects[0].skeleton.primitive;
  ASSERT_EQ(p.size(), 4u);
  EXPECT_EQ(p[0].control.size(), 3u);
  EXPECT_DOUBLE_EQ(p[0].taper, 0.25);
  EXPECT_EQ(p[0].kernel.shape, 3.0);
  EXPECT_TRUE(p[1].convolved);
  EXPECT_NEAR(p[1].size.y(), std::numbers::pi / 2, 1e-15);
  EXPECT_EQ(p[1].stretch, Vec3(1, 2, 1));
  EXPECT_EQ(p[2].exponent, (std::array<double, 2>{0.2, 1.0}));
  EXPECT_EQ(p[2].kernel.radius, 0.3);
  EXPECT_EQ(p[3].control.at(0), Vec3(0.2, 0.4, 0.3));
  EXPECT_EQ(p[3].kernel.radius, 0.2);
}

TEST(Blends, JoinGroupsAndNeighbours) {
  const Model model = model_of(std::string(kHead) + R"(
  - name: a
    particles: {arrange: line, count: 5, spacing: 1}
    skeleton: [{shape: point, kernel: {radius: 1}}]
    blend: {rule: graph, groups: [{particles: [0, 1]}, {particles: [-1]}], within: 1.5}
)");
  const implicit::Blend& blend = model.objects[0].skeleton.blend;
  EXPECT_EQ(blend.rule, implicit::BlendRule::Graph);
  EXPECT_EQ(blend.node, (std::vector<std::uint32_t>{0, 0, 2, 3, 1}));
  ASSERT_EQ(blend.edge.size(), 3u);  // particles 1-2, 2-3, 3-4
  EXPECT_EQ(std::pair(blend.edge[0].a, blend.edge[0].b), std::pair(0u, 2u));
  EXPECT_EQ(std::pair(blend.edge[1].a, blend.edge[1].b), std::pair(1u, 3u));
  EXPECT_EQ(std::pair(blend.edge[2].a, blend.edge[2].b), std::pair(2u, 3u));
}

TEST(FormRadius, RefusesFlatBonds) {
  try {
    (void)model_of(std::string(kHead) + R"(
  - name: a
    particles: {arrange: line, count: 5, spacing: 1}
    interactions: [{law: form_radius, strength: 1}]
)");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().size(), 1u);
    EXPECT_EQ(error.faults()[0].key, "objects.a.interactions[0]");
  }
}

/// Laws of a ring of eight around z, radius 1, normals outward; `interaction` is one mapping.
Model ring_with(const std::string& interaction) {
  return model_of(std::string(kHead) + R"(
  - name: ring
    particles: {arrange: ring, count: 8, radius: 1, normal: radial}
    interactions: [)" +
                  interaction + "]\n");
}

TEST(CohesionLaws, AreGivenByARatioForEveryRestDistance) {
  const Model model = ring_with("{law: cohesion, neighbours: 2, maximum_ratio: 1.5, maximum_force: 2}");
  for (const core::Cohesion& law : model.interactions.cohesion[0].law) {
    EXPECT_NEAR(law.a, 16.0 / 3.0, 1e-13);
    EXPECT_NEAR(law.force(law.maximum_distance()), -2.0, 1e-13);
  }
  const Model scaled = ring_with("{law: cohesion, maximum_ratio: 1.5, scale_force: 3}");
  EXPECT_EQ(scaled.interactions.cohesion[0].law[0].f0, 3.0);
}

TEST(CohesionLaws, ShareATableWhenAnErrorIsGiven) {
  const Model model = ring_with("{law: cohesion, maximum_ratio: 1.5, maximum_force: 2, table_error: 1e-3}");
  EXPECT_TRUE(model.interactions.cohesion.empty());
  ASSERT_EQ(model.interactions.tabulated_cohesion.size(), 1u);
  const auto& laws = model.interactions.tabulated_cohesion[0].law;
  const core::Cohesion exact = core::Cohesion::from_maximum(laws[0].r0, 1.5 * laws[0].r0, 2.0);
  const double difference = laws[0].force(1.3 * laws[0].r0) - exact.force(1.3 * laws[0].r0);
  EXPECT_NE(difference, 0.0);
  EXPECT_LE(std::abs(difference), 1e-3 * 2.0);
  const Model finer = ring_with("{law: cohesion, maximum_ratio: 1.5, maximum_force: 2, table_error: 1e-6}");
  EXPECT_GT(finer.interactions.tabulated_cohesion[0].law[0].table->intervals(), laws[0].table->intervals());
}

TEST(CohesionLaws, TakeLinearStiffness) {
  const Model model = ring_with("{law: linear_cohesion, scale_force: 3, shape: 5, eta: 0.2}");
  const core::LinearCohesion& law = model.interactions.linear_cohesion[0].law[0];
  EXPECT_NEAR(law.r0, 2.0 * std::sin(std::numbers::pi / 8), 1e-15);
  EXPECT_EQ(law.a, 5.0);
  EXPECT_NEAR(-law.slope(law.r0), 3.0 * 0.2 / law.r0, 1e-15);
  EXPECT_EQ(ring_with("{law: linear_cohesion, scale_force: 3}").interactions.linear_cohesion[0].law[0].eta, 0.0);
}

TEST(CohesionLaws, TakeARestDistanceByDirection) {
  const Model model = ring_with("{law: directed_cohesion, scale_force: 3, semi_axes: [0.5, 0.3, 0.2]}");
  const core::DirectedCohesion& law = model.interactions.directed_cohesion[0].law[0];
  EXPECT_EQ(law.semi_axes_b, Vec3(0.5, 0.3, 0.2));
  const auto pose = [&](std::size_t a, std::size_t b) {
    return core::PairPose{.r = model.rest.position[b] - model.rest.position[a],
                          .orientation_a = model.rest.orientation[a],
                          .orientation_b = model.rest.orientation[b],
                          .normal_a = Vec3::UnitZ(),
                          .normal_b = Vec3::UnitZ()};
  };
  EXPECT_NEAR(law.scale, 3.0 * law.rest_distance(pose(0, 1)), 1e-14);
  EXPECT_GT(core::evaluate(law, pose(0, 1)).force_b.norm(), 0.0);  // the ring rests elsewhere
}

TEST(GeometricLaws, ComeWithTheRangeOfTheLawOrTheirOwn) {
  const char* cohesion = "{law: cohesion, geometric: true, rest_distance: 0.5, maximum_ratio: 1.5, maximum_force: 2}";
  const Model model = ring_with(cohesion);
  ASSERT_EQ(model.interactions.geometric_cohesion.size(), 1u);
  const auto& list = model.interactions.geometric_cohesion[0];
  EXPECT_EQ(list.name, "ring/cohesion");
  EXPECT_EQ(list.range, list.law.influence_radius(1e-3));
  EXPECT_EQ(list.object_a, 0u);
  EXPECT_EQ(list.object_b, 0u);
  EXPECT_TRUE(model.interactions.cohesion.empty());
  const Model own = ring_with(
      "{law: cohesion, geometric: true, within: 0.9, rest_distance: 0.5, maximum_ratio: 1.5, maximum_force: 2}");
  EXPECT_EQ(own.interactions.geometric_cohesion[0].range, 0.9);
  const Model table = ring_with(
      "{law: cohesion, geometric: true, rest_distance: 0.5, maximum_ratio: 1.5, maximum_force: 2, table_error: 1e-4}");
  EXPECT_EQ(table.interactions.geometric_tabulated_cohesion.size(), 1u);
  const Model linear = ring_with("{law: linear_cohesion, geometric: true, rest_distance: 0.5, scale_force: 2}");
  EXPECT_EQ(linear.interactions.geometric_linear_cohesion[0].law.r0, 0.5);
  const Model pair = ring_with("{law: lennard_jones, geometric: true, rest_distance: 0.5, depth: 2, cut_off: 1.2}");
  EXPECT_EQ(pair.interactions.geometric_lennard_jones[0].range, 1.2);
}

TEST(GeometricLaws, OfNormalsEndAtTheRangeOfTheirWeight) {
  const Model model = ring_with(
      "{law: coplanarity, geometric: true, strength: 1, range: 0.9}, "
      "{law: co_normality, geometric: true, strength: 2, range: 0.8}, "
      "{law: co_circularity, geometric: true, strength: 3, range: 0.7}");
  ASSERT_EQ(model.interactions.geometric_coplanarity.size(), 1u);
  EXPECT_EQ(model.interactions.geometric_coplanarity[0].range, 0.9);
  EXPECT_EQ(model.interactions.geometric_coplanarity[0].law.weight.range, 0.9);
  EXPECT_EQ(model.interactions.geometric_co_normality[0].law.strength, 2.0);
  EXPECT_EQ(model.interactions.geometric_co_circularity[0].range, 0.7);
  EXPECT_TRUE(model.interactions.coplanarity.empty());
}

TEST(GayBerneLaws, TakeTheirEllipsoidsAndEndWithoutAJump) {
  const Model model = ring_with(
      "{law: gay_berne, geometric: true, semi_axes: [0.1, 0.2, 0.3], depth: 2, cut_off: 1.5, wells: [1, 0.5, 0.2], "
      "upsilon: 3, mu: 2, gamma: 0.9}");
  ASSERT_EQ(model.interactions.gay_berne.size(), 1u);
  const auto& list = model.interactions.gay_berne[0];
  EXPECT_EQ(list.name, "ring/gay_berne");
  EXPECT_EQ(list.range, 1.5);
  EXPECT_EQ(list.law.cut_off, 1.5);
  EXPECT_EQ(list.law.switch_from, 0.9 * 1.5);
  const core::GayBerne& law = list.law.ellipsoid;
  EXPECT_EQ(law.epsilon, 2.0);
  EXPECT_EQ(law.sigma, 0.2);
  EXPECT_EQ(law.gamma, 0.9);
  EXPECT_EQ(law.radii, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(law.well, Vec3(1.0, 0.5, 0.2));
  EXPECT_EQ(law.upsilon, 3);
  EXPECT_EQ(law.mu, 2);
  const Model given =
      ring_with("{law: gay_berne, geometric: true, semi_axes: [0.1, 0.2, 0.3], depth: 2, sigma: 0.15, cut_off: 1, switch_from: 0.8}");
  EXPECT_EQ(given.interactions.gay_berne[0].law.ellipsoid.sigma, 0.15);
  EXPECT_EQ(given.interactions.gay_berne[0].law.switch_from, 0.8);
}

TEST(LennardJonesLaws, TakeTheDepthOrTheForceOfThePaper) {
  const Model model = ring_with("{law: lennard_jones, depth: 2, cut_off: 3, switch_from: 2}");
  const core::LennardJones& law = model.interactions.lennard_jones[0].law[0];
  EXPECT_EQ(law.depth, 2.0);
  EXPECT_EQ(law.repulsive, 12);
  EXPECT_EQ(law.attractive, 6);
  EXPECT_EQ(law.cut_off, 3.0);
  EXPECT_EQ(law.switch_from, 2.0);
  const Model paper = ring_with("{law: lennard_jones, scale_force: 3, repulsive: 8, attractive: 4}");
  const core::LennardJones& from_force = paper.interactions.lennard_jones[0].law[0];
  EXPECT_NEAR(from_force.depth, core::LennardJones::from_gain(from_force.r0, 3.0, 4).depth, 1e-15);
  EXPECT_EQ(from_force.cut_off, 0.0);
}

TEST(NormalLaws, KnowTheirNormalisedForm) {
  const Model model = ring_with(
      "{law: coplanarity, strength: 1 N/m}, {law: coplanarity, normalised: true, strength: 2 J}, "
      "{law: co_normality, strength: 3}, {law: co_circularity, strength: 4, range: 2}, "
      "{law: co_circularity, normalised: true, strength: 5 J}");
  EXPECT_EQ(model.interactions.coplanarity[0].law[0].strength, 1.0);
  EXPECT_EQ(model.interactions.normalised_coplanarity[0].law[0].strength, 2.0);
  EXPECT_EQ(model.interactions.co_normality[0].law[0].strength, 3.0);
  EXPECT_EQ(model.interactions.co_circularity[0].law[0].weight.range, 2.0);
  EXPECT_EQ(model.interactions.normalised_co_circularity[0].law[0].strength, 5.0);
  EXPECT_EQ(model.interactions.normalised_co_circularity[0].name, "ring/co_circularity.2");
}

TEST(DirectedForms, RestOnTheirArrangement) {
  const Model model = ring_with("{law: directed_form, strength: 2}");
  ASSERT_EQ(model.interactions.directed_form.size(), 1u);
  // About a vertical ring of radius 1 the curvature along it is 1 and nothing is known across it. Chords: |w| is
  // second order in the angle between neighbours, so far from the 2 sin(pi/8) of a flat shape.
  for (const auto& law : model.interactions.directed_form[0].law) {
    EXPECT_NEAR(law.shape_a.norm(), 1.0, 0.1);
  }
  const double energy = core::potential_energy(model.particles, model.rest, model.interactions);
  EXPECT_LE(energy, 0.05 * 8.0 * 2.0);  // a flat shape would have k |dn|^2 / d^2 = k for each bond
}

TEST(LiteralForms, GiveEachParticleItsOwnRadius) {
  const Model model = model_of(std::string(kHead) + R"(
  - name: spiral
    particles: {arrange: spiral, count: 10, inner_radius: 0.15, outer_radius: 0.55, turns: 1.2, normal: radial}
    interactions: [{law: form_radius, strength: 3, paper_literal: true}]
)");
  EXPECT_TRUE(model.interactions.form_radius.empty());
  ASSERT_EQ(model.interactions.literal_form.size(), 1u);
  const auto& list = model.interactions.literal_form[0];
  EXPECT_EQ(list.name, "spiral/form_radius");
  EXPECT_EQ(list.law[0].strength, 3.0);
  EXPECT_NE(list.law[0].radius_a, list.law[0].radius_b);
  EXPECT_EQ(list.law[0].radius_b, list.law[1].radius_a);  // the radius belongs to the particle
  const Model ring = ring_with("{law: form_radius, strength: 1, paper_literal: true}");
  for (const core::LiteralForm& law : ring.interactions.literal_form[0].law) EXPECT_NEAR(law.radius_a, 1.0, 1e-14);
}

}  // namespace
}  // namespace supple::scenes
