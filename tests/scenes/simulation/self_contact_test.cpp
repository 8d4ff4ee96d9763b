// Parts of one object that do not blend touch each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "scenes/run_scenes.h"
#include "supple/core/mesh.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/query.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

const char* const kBall = "{shape: point, kernel: {radius: 0.3}}";
const char* const kTwin = "{shape: point, at: [0, 0.06, 0], kernel: {radius: 0.3}}, {shape: point, at: [0.02, -0.08, 0.03], kernel: {radius: 0.25}}";
const std::string kHead = "schema: 1\nduration: 1 s\nframe_rate: 20\ntime_step: {substeps: 64}\ncontact: {bulge: 0.4}\noutput: {cell: 0.03}\nobjects:\n";

/// Two bodies that turn, and loads that press them together: as groups of one object, or as two objects.
Simulation two_bodies(const std::string& skeleton, bool groups, SimulationOptions options = {}) {
  const std::string body = "inertia_radius: 0.1, mass: 0.1, ", rest = "    skeleton: [" + skeleton +
                                                                      "]\n    contact: {modulus: 2e4, friction: 0.3, dissipation: 0.1}\n";
  const std::string left = "force: [0.6, 0.05, 0], torque: [0, 0, 2e-4]}", right = "force: [-0.6, 0, 0.05]}";
  if (groups) {
    return make(kHead + "  - name: pair\n    particles: {arrange: line, count: 2, spacing: 0.5, " + body + "}\n" + rest +
                    "    blend: {rule: graph}\n    loads: [{particle: 0, " + left + ", {particle: 1, " + right + "]\n",
                options);
  }
  const auto one = [&](const std::string& name, const std::string& x, const std::string& load) {
    return "  - name: " + name + "\n    particles: {at: [" + x + ", 0, 0], " + body + "}\n" + rest + "    loads: [{particle: 0, " + load + "]\n";
  };
  return make(kHead + one("a", "-0.25", left) + one("b", "0.25", right), options);
}

TEST(SelfContact, OfTwoGroupsHasTheBitsOfTwoObjects) {
  for (const char* skeleton : {kBall, kTwin}) {
    Simulation groups = two_bodies(skeleton, true), objects = two_bodies(skeleton, false);
    ASSERT_EQ(groups.bodies().size(), 2u);
    EXPECT_EQ(groups.bodies()[1].name, "pair.2");
    run(groups, 4);
    run(objects, 4);
    int touched = 0;
    while (groups.frame() < 13) {
      groups.step();
      objects.step();
      ASSERT_EQ(groups.state().particles.position, objects.state().particles.position) << groups.time();
      ASSERT_EQ(groups.state().particles.angular_momentum, objects.state().particles.angular_momentum) << groups.time();
      const auto &own = groups.contacts().summary, &other = objects.contacts().summary;
      ASSERT_EQ(own.size(), other.size()) << groups.time();
      if (own.empty()) continue;
      ++touched;
      EXPECT_EQ(own[0].energy, other[0].energy);
      EXPECT_EQ(own[0].force, other[0].force);
    }
    EXPECT_GT(touched, 10);
    EXPECT_LT(groups.audits().momentum_error, 1e-13);
    EXPECT_LT(groups.audits().angular_momentum_error, 1e-13);
    EXPECT_EQ(groups.audits().energy_error, objects.audits().energy_error);
  }
}

// Divided by their contact, with its bulge, as objects are.
TEST(SelfContact, MeshesAreThoseOfTwoObjects) {
  Simulation groups = two_bodies(kTwin, true), objects = two_bodies(kTwin, false);
  while (groups.contacts().summary.empty()) groups.step_frame();
  run(objects, groups.frame());
  ASSERT_EQ(groups.meshes().size(), 1u);
  ASSERT_EQ(objects.meshes().size(), 2u);
  const Mesh& both = groups.meshes()[0];
  std::vector<Vec3> apart = objects.meshes()[0].position;
  apart.insert(apart.end(), objects.meshes()[1].position.begin(), objects.meshes()[1].position.end());
  EXPECT_EQ(both.position, apart);
  const MeshReport report = inspect(both);
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_EQ(report.components, 2u);
}

TEST(SelfContact, HasTheSameBitsForAnyThreadsAndWithoutSkipsAndFromASavedState) {
  const auto hash = [](SimulationOptions options) {
    Simulation simulation = two_bodies(kTwin, true, options);
    run(simulation, 13);
    return simulation.state_hash();
  };
  const std::uint64_t one = hash({.threads = 1});
  EXPECT_EQ(hash({.threads = 3}), one);
  EXPECT_EQ(hash({.threads = 1, .skip = false}), one);
  Simulation first = two_bodies(kTwin, true), second = two_bodies(kTwin, true);
  while (first.frame() < 13 && first.contacts().summary.empty()) first.step_frame();
  first.step();
  second.restore(first.state());
  run(second, 13);
  EXPECT_EQ(second.state_hash(), one);
}

/// Balls in a row that do not blend.
std::string row(int count, const std::string& spacing, const std::string& keys, const std::string& contact = "{modulus: 2e4}") {
  return "schema: 1\nduration: 2 s\nframe_rate: 20\nobjects:\n  - name: row\n    particles: {arrange: line, count: " + std::to_string(count) +
         ", spacing: " + spacing + ", mass: 0.1}\n    skeleton: [" + kBall + "]\n    blend: {rule: graph}\n    contact: " + contact +
         "\n    " + keys + '\n';
}

TEST(SelfContact, CanBeSwitchedOff) {
  Simulation simulation = make(row(2, "0.5", "loads: [{particle: 0, force: [0.5, 0, 0]}]", "{modulus: 2e4, self: false}"));
  ASSERT_EQ(simulation.bodies().size(), 1u);
  EXPECT_TRUE(simulation.warnings().empty());
  run(simulation, 15);
  const auto& x = simulation.state().particles.position;
  EXPECT_GT(x[0].x(), x[1].x());  // it went through
  EXPECT_EQ(x[1], Vec3(0.25, 0.0, 0.0));
}

// Bonds are joints: what lies on both sides of one may overlap, the others may not.
TEST(SelfContact, IsNotBetweenBondedParts) {
  const std::string bonds = "interactions: [{law: bond_frame, stretch: 5, rotation: 0.1}, {law: friction, linear: 0.5}]\n    ";
  Simulation simulation = make(row(4, "0.3", bonds + "loads: [{particle: 0, force: [2.5, 0, 0]}, {particle: -1, force: [-2.5, 0, 0]}]"));
  EXPECT_EQ(simulation.model().objects[0].bonded.size(), 3u);
  EXPECT_TRUE(simulation.warnings().empty());
  std::vector<collision::BodyPair> met;
  double nearest = 1.0;
  for (int frame = 2; frame < 25; ++frame) {
    run(simulation, frame);
    for (const auto& s : simulation.contacts().summary) met.push_back(s.bodies);
    const auto& x = simulation.state().particles.position;
    for (int k = 0; k < 3; ++k) nearest = std::min(nearest, (x[k + 1] - x[k]).norm());
  }
  EXPECT_LT(nearest, 0.2);  // of 0.27 at which free balls touch
  ASSERT_FALSE(met.empty());
  for (const collision::BodyPair& pair : met) EXPECT_GT(pair.b - pair.a, 1u);

  Simulation two = make(row(2, "0.3", bonds));
  EXPECT_NE(explain(two).find("off  find_contacts"), std::string::npos) << explain(two);
}

TEST(SelfContact, OfPartsThatOverlapAtTheStartBeginsOnceTheyHaveBeenApart) {
  Simulation simulation = make(row(2, "0.2", "loads: [{particle: 0, force: [-1, 0, 0], from: 0.2, until: 0.4}, {particle: 1, force: [1, 0, 0], from: 0.2, "
                                             "until: 0.4}, {particle: 0, force: [2, 0, 0], from: 0.4, until: 0.7}, {particle: 1, force: [-2, 0, 0], from: 0.4, until: 0.7}]"));
  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_EQ(simulation.warnings()[0],
            "objects.row.contact: parts that do not blend overlap at the start, and touch only once they have been apart: 1 pair, the first "
            "with particles 0 and 1");
  const std::vector<Vec3> start = simulation.state().particles.position;
  run(simulation, 4);
  EXPECT_EQ(simulation.state().particles.position, start);  // nothing drives them apart
  EXPECT_EQ(simulation.energies().total(), 0.0);
  EXPECT_TRUE(simulation.state().apart.empty());
  run(simulation, 9);
  EXPECT_EQ(simulation.state().apart, (ApartPairs{{0, 1}}));
  double nearest = 1.0;
  while (simulation.frame() < 30) {
    simulation.step();
    const auto& x = simulation.state().particles.position;
    nearest = std::min(nearest, x[1].x() - x[0].x());
  }
  EXPECT_GT(nearest, 0.05);
  EXPECT_LT(nearest, 0.27);
  EXPECT_GT(simulation.state().particles.velocity[1].x(), 0.1);  // and they flew apart again
  EXPECT_LT(simulation.audits().energy_error, 1e-2);
}

// Balls in one place press on each other along no direction, until they are moved a little.
TEST(SelfContact, LeavesPartsInOnePlaceAlone) {
  const std::string text = R"(
schema: 1
duration: 1 s
frame_rate: 20
objects:
  - name: twins
    particles: {arrange: line, count: 2, spacing: 0.5, mass: 0.1}
    skeleton: [{shape: point, at: [0.25, 0, 0], particles: [0], kernel: {radius: 0.3}}, {shape: point, at: [-0.25, 0, 0], particles: [1], kernel: {radius: 0.3}}]
    blend: {rule: graph}
    contact: {modulus: 2e4}
    loads: [{particle: 0, force: [0, 0.01, 0]}]
)";
  Simulation simulation = make(text);
  EXPECT_EQ(simulation.model().objects[0].overlapping.size(), 1u);
  run(simulation, 5);
  EXPECT_EQ(simulation.energies().contact, 0.0);
}

// Bonded parts are pieces when their bond breaks, and touch once the crack has opened.
TEST(SelfContact, BeginsWhenABondBreaks) {
  Simulation simulation = make(row(2, "0.3", R"(interactions: [{law: bond_frame, stretch: 200, rotation: 1}]
    breaking: {stretch: 0.2}
    loads: [{particle: 0, force: [-15, 0, 0], until: 0.04}, {particle: 1, force: [15, 0, 0], until: 0.04}, {particle: 0, force: [2, 0, 0], from: 0.2}, {particle: 1, force: [-2, 0, 0], from: 0.2}]
    medium: {linear: 5})"));
  ASSERT_EQ(simulation.bodies().size(), 2u);
  simulation.step();
  EXPECT_TRUE(simulation.state().apart.empty());  // their boxes are, but a bond joins them
  run(simulation, 5);
  EXPECT_EQ(simulation.state().links.broken, (std::vector<std::uint8_t>{1}));
  EXPECT_EQ(simulation.state().apart.size(), 1u);
  double nearest = 1.0;
  while (simulation.frame() < 35) {
    simulation.step();
    const auto& x = simulation.state().particles.position;
    nearest = std::min(nearest, x[1].x() - x[0].x());
  }
  EXPECT_GT(nearest, 0.05);
  EXPECT_LT(nearest, 0.27);
}

// Of five parts, four pairs are bonded, and each part has one more with the ground; of three that overlap in a row, one pair may touch.
TEST(SelfContact, CountsItsPairsOneByOne) {
  const auto present = [](Simulation simulation) {
    simulation.step();
    const StageProfile found = simulation.profile()[static_cast<std::size_t>(Stage::FindContacts)];
    EXPECT_GT(found.calls, 0u);
    return static_cast<double>(found.present) / static_cast<double>(found.calls);
  };
  EXPECT_EQ(present(make(row(5, "0.3", "interactions: [{law: bond_frame, stretch: 5, rotation: 0.1}]\nground: {height: -0.13}"))), 6 + 5);
  EXPECT_EQ(present(make(row(3, "0.2", "loads: []\nground: {height: -0.13}"))), 1 + 3);
}

/// Least distance of head and tail of the worm until frame 20.
double nearest_ends(const std::vector<std::string>& overrides) {
  Simulation worm(library_scene("contacts/worm_curls_up", overrides));
  double nearest = 2.0;
  while (worm.frame() < 20) {
    worm.step_frame();
    const auto& x = worm.state().particles.position;
    nearest = std::min(nearest, x.back().x() - x.front().x());
  }
  return nearest;
}

TEST(SelfContact, StopsAWormThatCurlsUp) {
  EXPECT_GT(nearest_ends({"contact.error=0.01"}), 0.15);  // of 0.27 at which they touch
  EXPECT_LT(nearest_ends({"contact.error=0.01", "objects.worm.contact.self=false"}), 0.0);
}

TEST(SelfContact, IsExplained) {
  Simulation free = make(row(3, "0.5", "loads: []"));
  EXPECT_NE(explain(free).find("3 parts that do not blend are bodies that touch each other\n"), std::string::npos) << explain(free);
  EXPECT_NE(explain(free).find("find_contacts            collision  3 bodies may touch\n"), std::string::npos) << explain(free);
  Simulation mixed = make(row(4, "0.2", "interactions: [{law: bond_frame, stretch: 5, rotation: 0.1}]"));
  EXPECT_NE(explain(mixed).find("4 parts that do not blend are bodies that touch each other; except 3 pairs with a bond\n"), std::string::npos)
      << explain(mixed);
  Simulation overlapping = make(row(3, "0.2", "loads: []"));
  EXPECT_NE(explain(overlapping).find("; except 2 pairs that overlap at the start, until they have been apart\n"), std::string::npos)
      << explain(overlapping);
}

/// Three parts in a row of which the middle one blends with both others, which do not blend with each other.
std::string joined(const std::string& skeleton, const std::string& keys, const std::string& contact) {
  return "  - name: chain\n    particles: {arrange: line, count: 3, spacing: 0.25, inertia_radius: 0.1, mass: 0.1}\n    skeleton: [" + skeleton +
         "]\n    blend: {rule: graph, neighbours: 1}\n    contact: " + contact + "\n    " + keys + '\n';
}
const std::string kPressed = "loads: [{particle: 0, force: [0.6, 0.05, 0], torque: [0, 0, 2e-4]}, {particle: 2, force: [-0.6, 0, 0.05]}]";
const std::string kRubs = "{modulus: 2e4, friction: 0.3, dissipation: 0.1}";

TEST(GroupContact, IsThatOfTwoObjects) {
  for (const char* skeleton : {kBall, kTwin}) {
    Simulation groups = make(kHead + joined(skeleton, kPressed, kRubs)), objects = two_bodies(skeleton, false);
    ASSERT_EQ(groups.bodies().size(), 3u);
    EXPECT_EQ(groups.bodies()[0].name, "chain");
    EXPECT_EQ(groups.bodies()[1].name, "chain.group1");
    EXPECT_EQ(groups.bodies()[2].name, "chain.group3");
    EXPECT_TRUE(groups.warnings().empty());
    int touched = 0;
    while (groups.frame() < 13) {
      groups.step();
      objects.step();
      for (const auto& [own, other] : {std::pair(0, 0), std::pair(2, 1)}) {
        ASSERT_EQ(groups.state().particles.position[own], objects.state().particles.position[other]) << groups.time();
        ASSERT_EQ(groups.state().particles.angular_momentum[own], objects.state().particles.angular_momentum[other]) << groups.time();
      }
      const auto &own = groups.contacts().summary, &other = objects.contacts().summary;
      ASSERT_EQ(own.size(), other.size()) << groups.time();
      if (own.empty()) continue;
      ++touched;
      EXPECT_EQ(own[0].bodies, (collision::BodyPair{1, 2}));
      EXPECT_EQ(report_contacts(groups).pairs[0].a, "chain.group1");
      EXPECT_EQ(own[0].energy, other[0].energy);
      EXPECT_EQ(own[0].force, other[0].force);
    }
    EXPECT_GT(touched, 10);
    EXPECT_EQ(groups.state().particles.velocity[1], Vec3::Zero());  // the middle one touches neither
    EXPECT_EQ(groups.audits().energy_error, objects.audits().energy_error);
  }
}

TEST(GroupContact, HasTheSameBitsForAnyThreadsAndWithoutSkipsAndFromASavedState) {
  const auto chain = [](SimulationOptions options) { return make(kHead + joined(kTwin, kPressed, kRubs), options); };
  const auto hash = [&](SimulationOptions options) {
    Simulation simulation = chain(options);
    run(simulation, 13);
    return simulation.state_hash();
  };
  const std::uint64_t one = hash({.threads = 1});
  EXPECT_EQ(hash({.threads = 3}), one);
  EXPECT_EQ(hash({.threads = 1, .skip = false}), one);
  Simulation first = chain({}), second = chain({});
  while (first.frame() < 13 && first.contacts().summary.empty()) first.step_frame();
  first.step();
  second.restore(first.state());
  run(second, 13);
  EXPECT_EQ(second.state_hash(), one);
}

// The surface of the whole has a crease where its groups meet, as without contact.
TEST(GroupContact, DividesNoSurface) {
  Simulation touching = make(kHead + joined(kTwin, kPressed, kRubs)), passing = make(kHead + joined(kTwin, kPressed, "{self: false}"));
  while (touching.frame() < 13 && touching.contacts().summary.empty()) touching.step_frame();
  passing.adopt(touching.state());
  ASSERT_EQ(touching.meshes().size(), 1u);
  EXPECT_EQ(touching.meshes()[0].position, passing.meshes()[0].position);
  EXPECT_TRUE(touching.division().body.empty());
}

// Groups that touch nothing change nothing, nor does their sleep: something that hits what they are part of wakes all of it, once.
TEST(GroupContact, ThatDoesNotHappenChangesNoBit) {
  const auto scene = [](const std::string& contact) {
    return "schema: 1\nduration: 4 s\nframe_rate: 20\nsleep: {speed: 0.01, time: 0.2}\nobjects:\n" +
           joined(kBall, "interactions: [{law: bond_frame, stretch: 20, rotation: 0.5}, {law: friction, linear: 0.5}]", contact) +
           "  - name: visitor\n    particles: {at: [0.25, 0, 1], velocity: [0, 0, -1.3], mass: 0.1, inertia_radius: 0.1}\n    skeleton: [" + kBall +
           "]\n    contact: {modulus: 2e4}\n";
  };
  Simulation groups = make(scene("{modulus: 2e4}")), whole = make(scene("{modulus: 2e4, self: false}"));
  ASSERT_EQ(groups.bodies().size(), 4u);
  ASSERT_EQ(whole.bodies().size(), 2u);
  bool slept = false, woke = false;
  while (groups.frame() < 40) {
    groups.step();
    whole.step();
    const bool asleep = groups.state().sleep.asleep(0);
    ASSERT_EQ(asleep, whole.state().sleep.asleep(0)) << groups.time();
    EXPECT_EQ(groups.state().sleep.asleep(2), asleep) << groups.time();
    EXPECT_EQ(groups.state().sleep.asleep(3), asleep) << groups.time();
    slept = slept || asleep;
    woke = woke || (slept && !asleep);
    ASSERT_EQ(groups.state().particles.position, whole.state().particles.position) << groups.time();
    ASSERT_EQ(groups.state().particles.velocity, whole.state().particles.velocity) << groups.time();
  }
  EXPECT_TRUE(slept);
  EXPECT_TRUE(woke);
}

TEST(GroupContact, OfThoseThatOverlapAtTheStartBeginsOnceTheyHaveBeenApart) {
  const auto close = [](const std::string& loads) {
    std::string text = "schema: 1\nduration: 2 s\nframe_rate: 20\nobjects:\n" + joined(kBall, loads, "{modulus: 2e4}");
    return make(text.replace(text.find("0.25"), 4, "0.1"));
  };
  Simulation simulation = close("loads: [{particle: 0, force: [-1, 0, 0], until: 0.2}, {particle: 2, force: [1, 0, 0], until: 0.2}, "
                                "{particle: 0, force: [2, 0, 0], from: 0.2, until: 0.5}, {particle: 2, force: [-2, 0, 0], from: 0.2, until: 0.5}]");
  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_NE(simulation.warnings()[0].find("touch only once they have been apart: 1 pair, the first with particles 0 and 2"), std::string::npos)
      << simulation.warnings()[0];
  EXPECT_EQ(simulation.energies().contact, 0.0);
  double nearest = 1.0;
  while (simulation.frame() < 30) {
    simulation.step();
    const auto& x = simulation.state().particles.position;
    if (!simulation.state().apart.empty()) nearest = std::min(nearest, x[2].x() - x[0].x());
  }
  EXPECT_EQ(simulation.state().apart, (ApartPairs{{0, 2}}));
  EXPECT_GT(nearest, 0.05);  // 0.27 is where they touch; they did not pass
  const auto& x = simulation.state().particles.position;
  EXPECT_GT(x[2].x() - x[0].x(), 0.2);
}

// Of five parts in a row six pairs do not blend, of which bonds tie three.
TEST(GroupContact, IsNotBetweenBondedGroups) {
  const auto present = [](const std::string& keys) {
    Simulation simulation = make("schema: 1\nduration: 1\nframe_rate: 20\nobjects:\n  - name: row\n    particles: {arrange: line, count: 5, spacing: 0.3, mass: 0.1}\n"
                                 "    skeleton: [" + std::string(kBall) + "]\n    blend: {rule: graph, neighbours: 1}\n    contact: {}\n    " + keys + "\nground: {height: -0.13}\n");
    simulation.step();
    const StageProfile found = simulation.profile()[static_cast<std::size_t>(Stage::FindContacts)];
    return static_cast<double>(found.present) / static_cast<double>(found.calls);
  };
  EXPECT_EQ(present("loads: []"), 6 + 1);
  EXPECT_EQ(present("interactions: [{law: bond_frame, stretch: 5, rotation: 0.1, neighbours: 2}]"), 3 + 1);
}

TEST(GroupContact, IsNotLookedForWhereBondsTieAllGroups) {
  Simulation tied = make(kHead + joined(kBall, "interactions: [{law: bond_frame, stretch: 5, rotation: 0.1, neighbours: 2}]", "{}"));
  EXPECT_NE(explain(tied).find("off  find_contacts"), std::string::npos) << explain(tied);
  Simulation free = make(kHead + joined(kBall, "interactions: [{law: bond_frame, stretch: 5, rotation: 0.1}]", "{}"));
  EXPECT_NE(explain(free).find("on   find_contacts"), std::string::npos) << explain(free);
}

// Two rows of three, each a component with two groups.
TEST(GroupContact, IsWithinComponents) {
  const std::filesystem::path folder = temp_folder();
  std::ofstream(folder / "two_rows.csv") << "-0.25, 0, 0\n0, 0, 0\n0.25, 0, 0\n-0.25, 1, 0\n0, 1, 0\n0.25, 1, 0\n";
  Simulation rows(parse_scene("schema: 1\nduration: 1\nframe_rate: 20\nobjects:\n  - name: rows\n    particles: {arrange: file, file: two_rows.csv, mass: 0.1, inertia_radius: 0.1}\n"
                              "    skeleton: [" + std::string(kBall) + "]\n    blend: {rule: graph, within: 0.3}\n    contact: {modulus: 2e4}\n"
                              "    loads: [{particle: 3, force: [0.6, 0, 0]}, {particle: 5, force: [-0.6, 0, 0]}]\n", "test.yaml", folder), {});
  std::vector<std::string> names;
  for (const Body& body : rows.bodies()) names.push_back(body.name);
  EXPECT_EQ(names, (std::vector<std::string>{"rows.1", "rows.2", "rows.group1", "rows.group3", "rows.group4", "rows.group6"}));
  EXPECT_EQ(surface_count(rows.bodies()), 2u);
  EXPECT_NE(explain(rows).find("2 parts that do not blend are bodies that touch each other; 4 groups touch the groups that they do not blend with, by their own fields\n"),
            std::string::npos)
      << explain(rows);
  while (rows.frame() < 13 && rows.contacts().summary.empty()) rows.step();
  ASSERT_EQ(rows.contacts().summary.size(), 1u);
  EXPECT_EQ(rows.contacts().summary[0].bodies, (collision::BodyPair{4, 5}));
  EXPECT_EQ(rows.meshes().size(), 1u);
}

// One group presses on two that blend with each other, where all three overlap: the energy is that of the pair that presses harder.
TEST(GroupContact, KeepsItsEnergyWhereThreeOverlap) {
  const std::filesystem::path folder = temp_folder();
  std::ofstream(folder / "hook.csv") << "0.375, 0.4, 0\n-0.6, 0.4, 0\n-0.6, 0, 0\n0.25, 0, 0\n0.5, 0, 0\n";
  Simulation hook(parse_scene("schema: 1\nduration: 2\nframe_rate: 50\ntime_step: {substeps: 64}\nobjects:\n  - name: hook\n"
                              "    particles: {arrange: file, file: hook.csv, mass: 0.1, inertia_radius: 0.1}\n    skeleton: [" + std::string(kBall) +
                              "]\n    blend: {rule: graph, neighbours: 1}\n    contact: {modulus: 2e4}\n    loads: [{particle: 0, force: [0, -5, 0], until: 0.05}]\n",
                              "test.yaml", folder), {});
  ASSERT_EQ(hook.bodies().size(), 6u);
  int together = 0;
  double fastest = 0.0;
  while (hook.frame() < 40) {
    hook.step();
    fastest = std::min(fastest, hook.state().particles.velocity[0].y());
    std::vector<collision::BodyPair> pairs;
    for (const auto& s : hook.contacts().summary) pairs.push_back(s.bodies);
    if (pairs.empty()) continue;
    EXPECT_EQ(pairs, (std::vector<collision::BodyPair>{{1, 4}, {1, 5}})) << hook.time();
    ++together;
  }
  EXPECT_GT(together, 20);
  EXPECT_LT(fastest, -1.0);
  EXPECT_LT(hook.audits().energy_error, 1e-4);
  EXPECT_LT(hook.audits().momentum_error, 1e-12);
  const auto& v = hook.state().particles.velocity;
  EXPECT_NEAR(v[3].x(), -v[4].x(), 1e-9);  // to both sides alike
  EXPECT_GT(v[0].y() - fastest, 1.0);
}

/// One group presses on two that blend with each other; all are bonded in their order.
Simulation bonded_hook(const std::string& keys, SimulationOptions options = {}) {
  const std::filesystem::path folder = temp_folder();
  std::ofstream(folder / "bonded_hook.csv") << "0.375, 0.4, 0\n-0.6, 0.4, 0\n-0.6, 0, 0\n0.25, 0, 0\n0.5, 0, 0\n";
  return Simulation(parse_scene("schema: 1\nduration: 2\nframe_rate: 50\ntime_step: {substeps: 64}\nobjects:\n  - name: hook\n"
                                "    particles: {arrange: file, file: bonded_hook.csv, mass: 0.1, inertia_radius: 0.1}\n    skeleton: [" + std::string(kBall) +
                                    "]\n    blend: {rule: graph, neighbours: 1}\n    contact: {modulus: 2e4}\n"
                                    "    interactions: [{law: bond_frame, stretch: 5, rotation: 0.1}]\n" + keys,
                                "test.yaml", folder), options);
}

TEST(GroupContact, OfWhatMayBreakHasTheBitsOfWhatMayNot) {
  const std::string pressed = "    loads: [{particle: 0, force: [0, -5, 0], until: 0.05}]\n";
  Simulation whole = bonded_hook(pressed), brittle = bonded_hook(pressed + "    breaking: {stretch: 9}\n");
  EXPECT_TRUE(brittle.warnings().empty());
  ASSERT_EQ(brittle.bodies().size(), whole.bodies().size());
  int touched = 0;
  while (whole.frame() < 30) {
    whole.step();
    brittle.step();
    ASSERT_EQ(brittle.state().particles.position, whole.state().particles.position) << whole.time();
    ASSERT_EQ(brittle.state().particles.angular_momentum, whole.state().particles.angular_momentum) << whole.time();
    touched += brittle.contacts().summary.empty() ? 0 : 1;
  }
  EXPECT_GT(touched, 20);
}

/// Six parts in a row, whose middle bond breaks at once. The left half is slowed down.
Simulation parted(const std::string& more) {
  return make("schema: 1\nduration: 4\nframe_rate: 20\n" + more + "objects:\n  - name: row\n    particles: {arrange: line, count: 6, spacing: 0.3, mass: 0.1, inertia_radius: 0.1}\n"
              "    skeleton: [" + std::string(kBall) + "]\n    blend: {rule: graph, neighbours: 1}\n    contact: {modulus: 2e4}\n"
              "    interactions: [{law: bond_frame, stretch: 20, rotation: 0.5}, {law: friction, linear: 0.5}]\n    breaking: {stretch: 0.02}\n"
              "    pins: [{particle: 1}]\n    loads: [{particle: 3, force: [3, 0, 0], until: 0.1}, {particle: 4, force: [3, 0, 0], until: 0.1}, {particle: 5, force: [3, 0, 0], until: 0.1}]\n");
}

// Each piece has the groups that others of it may touch; pieces touch by themselves, once a crack has opened.
TEST(GroupContact, IsWithinPieces) {
  Simulation row = parted("");
  ASSERT_EQ(row.bodies().size(), 7u);  // all six do not blend with another one
  while (row.frame() < 20 && row.bodies().size() == 7) row.step();
  ASSERT_EQ(row.state().links.broken, (std::vector<std::uint8_t>{0, 0, 1, 0, 0}));
  std::vector<std::string> names;
  for (const Body& body : row.bodies()) names.push_back(body.name);
  EXPECT_EQ(names, (std::vector<std::string>{"row.1", "row.2", "row.group1", "row.group3", "row.group4", "row.group6"}));
  EXPECT_EQ(row.bodies()[4].origin.piece, 3u);
  const collision::ContactRules rules = make_body_rules(row.model(), row.bodies(), {});
  int allowed = 0;
  for (std::uint32_t a = 0; a < 6; ++a) {
    for (std::uint32_t b = a + 1; b < 6; ++b) allowed += rules.allowed(a, b) ? 1 : 0;
  }
  EXPECT_EQ(allowed, 2);
  EXPECT_TRUE(rules.allowed(2, 3));
  EXPECT_TRUE(rules.allowed(4, 5));
}

TEST(GroupContact, RestsWithItsPiece) {
  Simulation row = parted("sleep: {speed: 0.01, time: 0.2}\n");
  bool left_alone = false;
  while (row.frame() < 60) {
    row.step();
    if (row.bodies().size() != 6) continue;
    const collision::SleepState& sleep = row.state().sleep;
    for (const auto& [group, piece] : {std::pair(2u, 0u), std::pair(3u, 0u), std::pair(4u, 1u), std::pair(5u, 1u)}) ASSERT_EQ(sleep.asleep(group), sleep.asleep(piece)) << row.time();
    left_alone = left_alone || (sleep.asleep(0) && !sleep.asleep(1));
  }
  EXPECT_TRUE(left_alone);
}

/// Two pinned parts and one between them, which loads pull off the first until that bond breaks and then press on it; the other bond holds.
Simulation swing(const std::string& fade, const std::string& contact = "{modulus: 2e4}", SimulationOptions options = {}) {
  const std::filesystem::path folder = temp_folder();
  std::ofstream(folder / "swing.csv") << "0, 0, 0\n0.25, 0, 0\n0.25, 0.6, 0\n";
  return Simulation(parse_scene("schema: 1\nduration: 2\nframe_rate: 50\nobjects:\n  - name: swing\n"
                                "    particles: {arrange: file, file: swing.csv, mass: 0.1, inertia_radius: 0.1}\n    skeleton: [" + std::string(kBall) +
                                    "]\n    blend: {rule: graph, neighbours: 1, fade: " + fade + "}\n    contact: " + contact +
                                    "\n    interactions: [{law: cohesion, maximum_ratio: 1.5, maximum_force: 1, neighbours: 2}]\n    breaking: {stretch: 0.2}\n    pins: [{particle: 0}, {particle: 2}]\n"
                                    "    loads: [{particle: 1, force: [1, 0, 0], until: 0.1}, {particle: 1, force: [-1, 0, 0], from: 0.1, until: 0.6}]\n",
                                "test.yaml", folder), options);
}

TEST(GroupContact, OfGroupsThatBondsHaveLeftBeginsOnceTheyHaveBeenApart) {
  Simulation touching = swing("0.05 s"), passing = swing("0.05 s", "{modulus: 2e4, self: false}"), blending = swing("0 s");
  EXPECT_EQ(touching.bodies().size(), 1u);  // all blend or are bonded
  const auto nearest = [](Simulation& simulation) {
    double x = 1.0;
    while (simulation.frame() < 30) {
      simulation.step();
      x = std::min(x, simulation.state().particles.position[1].x());
    }
    return x;
  };
  EXPECT_GT(nearest(touching), 0.2);  // of 0.27 where they touch
  EXPECT_LT(nearest(passing), 0.0);
  EXPECT_EQ(touching.state().links.broken, (std::vector<std::uint8_t>{1, 0, 0}));
  ASSERT_EQ(touching.bodies().size(), 3u);
  EXPECT_EQ(touching.bodies()[2].name, "swing.group2");
  EXPECT_EQ(touching.bodies()[2].origin.cut, (std::vector<std::uint32_t>{0}));
  EXPECT_EQ(touching.state().apart, (ApartPairs{{3, 4}}));  // behind all particles, as the body itself is led by the first
  EXPECT_LT(touching.audits().energy_error, 1e-3);
  EXPECT_LT(nearest(blending), 0.0);  // without fading they continue to blend
}

TEST(GroupContact, OfGroupsThatBondsHaveLeftGoesOnFromASavedState) {
  const auto hash = [](SimulationOptions options) {
    Simulation simulation = swing("0.05 s", "{modulus: 2e4}", options);
    run(simulation, 25);
    return simulation.state_hash();
  };
  const std::uint64_t one = hash({.threads = 1});
  EXPECT_EQ(hash({.threads = 3}), one);
  EXPECT_EQ(hash({.threads = 1, .skip = false}), one);
  for (const int frame : {3, 8, 15}) {
    Simulation first = swing("0.05 s"), second = swing("0.05 s");
    run(first, frame);
    first.step();
    second.restore(first.state());
    run(second, 25);
    EXPECT_EQ(second.state_hash(), one) << frame;
  }
}

// What holds its volume stays one body: its parts touch as groups, whose kernels grow and shrink with those of the whole, which they do not steer.
TEST(GroupContact, OfWhatHoldsItsVolumeIsThatOfItsKernels) {
  const auto pair = [](const std::string& contact) {
    return make(kHead + "  - name: pair\n    particles: {arrange: line, count: 2, spacing: 0.5, inertia_radius: 0.1, mass: 0.1}\n    skeleton: [" + kTwin +
                "]\n    blend: {rule: graph}\n    volume: {of: primitive, target: 0.007, rate: 5}\n    contact: " + contact +
                "\n    loads: [{particle: 0, force: [0.6, 0, 0]}, {particle: 1, force: [-0.6, 0, 0]}]\n");
  };
  Simulation touching = pair("{modulus: 2e4}"), passing = pair("{modulus: 2e4, self: false}");
  EXPECT_TRUE(touching.warnings().empty());
  ASSERT_EQ(touching.bodies().size(), 3u);
  ASSERT_EQ(passing.bodies().size(), 1u);
  const auto gap = [](const Simulation& simulation) { return simulation.state().particles.position[1].x() - simulation.state().particles.position[0].x(); };
  double nearest = 1.0;
  int touched = 0;
  while (touching.frame() < 6) {  // they bounce off each other once
    touching.step();
    passing.step();
    nearest = std::min(nearest, gap(touching));
    const auto& bodies = touching.bodies();
    for (const std::size_t k : {0u, 1u}) {
      const Body& group = bodies[1 + k];
      ASSERT_EQ(group.skeleton.primitive.size(), 2u);
      for (std::size_t j = 0; j < 2; ++j) {
        ASSERT_EQ(group.skeleton.primitive[j].kernel.radius, bodies[0].skeleton.primitive[2 * k + j].kernel.radius) << touching.time();
        ASSERT_EQ(group.skeleton.primitive[j].part, 0u);
      }
      for (std::size_t j = 0; j < group.samples.size(); ++j) ASSERT_EQ(group.samples.reach[j], bodies[0].samples.reach[group.seed[j]]) << touching.time();
    }
    if (touching.contacts().summary.empty()) {
      for (std::size_t j = 0; j < 4 && touched == 0; ++j) ASSERT_EQ(touching.state().volumes[j].scale, passing.state().volumes[j].scale) << touching.time();
      continue;
    }
    ++touched;
    EXPECT_EQ(touching.contacts().summary[0].bodies, (collision::BodyPair{1, 2}));
  }
  EXPECT_GT(touched, 10);
  EXPECT_GT(nearest, 0.2);
  EXPECT_NE(touching.state().volumes[0].scale, touching.state().volumes[2].scale);
  EXPECT_LT(touching.audits().energy_error, 1e-3);
  EXPECT_LT(gap(passing), nearest);
}

TEST(SelfContact, IsOfOneBodyWhereAllBlendOrNothingIsMeantToTouch) {
  const auto chain = [](const std::string& blend, const std::string& contact) {
    return make("schema: 1\nduration: 1\nobjects:\n  - name: chain\n    particles: {arrange: line, count: 4, spacing: 0.2, mass: 0.1}\n    skeleton: [" +
                std::string(kBall) + "]\n    blend: {rule: graph, " + blend + "}\n    contact: " + contact + '\n');
  };
  for (const std::string& contact : {std::string("{}"), std::string("{}\n    volume: {rate: 1}")}) {
    EXPECT_EQ(chain("neighbours: 3", contact).bodies().size(), 1u);
    EXPECT_TRUE(chain("neighbours: 3", contact).warnings().empty());
  }
  EXPECT_EQ(chain("neighbours: 1", "{self: false}").bodies().size(), 1u);
}

}  // namespace
}  // namespace supple::scenes
