// Questions about a state: they need no step, and say where a contact misses its error.
#include "supple/scenes/query.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

/// A ball of 1 kg that rests in the ground, friction and all; `most` is time_step.max_substeps.
Scene stiff_ball(const std::string& most, const std::string& modulus = "1e12") {
  return parse_scene("schema: 1\nduration: 1 s\nframe_rate: 10\nground: {modulus: 1e9}\ntime_step: {max_substeps: " + most +
                         "}\nobjects:\n  - name: ball\n    particles: {at: [0, 0, 0.22], mass: 1, velocity: [0.3, 0, 0]}\n"
                         "    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]\n    contact: {modulus: " + modulus + "}\n",
                     "stiff.yaml", ".");
}

/// Without the time that it took.
nlohmann::json contact_of(Simulation& simulation) {
  auto answer = nlohmann::json::parse(query_contact(simulation, true));
  answer.erase("cpu_us");
  return answer;
}

TEST(Query, NeedsNoStepThatMaxSubstepsAllows) {
  EXPECT_THROW(Simulation{stiff_ball("16")}, Error);
  Simulation refused(stiff_ball("16"), {.questions = true});
  Simulation allowed(stiff_ball("1048576"));
  EXPECT_GT(allowed.state().halvings, 4);
  // The very step that is refused: friction of slow bodies knows it.
  EXPECT_EQ(refused.time_step(), allowed.time_step());
  EXPECT_EQ(contact_of(refused), contact_of(allowed));
  EXPECT_EQ(query_forces(refused), query_forces(allowed));
  try {
    refused.step();
    FAIL() << "a step finer than allowed was made";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
  }
}

TEST(Query, IsAnsweredWhereNoStepIsFineEnough) {
  Simulation simulation(stiff_ball("16", "1e40"), {.questions = true});
  EXPECT_EQ(simulation.state().halvings, 20);
  EXPECT_EQ(nlohmann::json::parse(query_contact(simulation, false)).at("pairs").size(), 1u);
  EXPECT_THROW(simulation.expect_steps(), Error);
}

TEST(Explain, SaysWhyNoStepCanBeMade) {
  Simulation refused(stiff_ball("16"), {.questions = true}), allowed(stiff_ball("1048576"));
  EXPECT_NE(explain(refused).find("no time step is possible: stiff.yaml:5:27: time_step.max_substeps: expected a stable step with at most 16 substeps"),
            std::string::npos) << explain(refused);
  EXPECT_EQ(explain(allowed).find("no time step is possible"), std::string::npos) << explain(allowed);
}

TEST(Query, SaysWhereTheErrorIsAboveWhatWasAsked) {
  // The patch of a ring on the ground: polar rings do not fit, marching reaches the given error.
  const auto make = [](const std::string& rule) {
    return Simulation(parse_scene("schema: 1\nduration: 1 s\nground: {modulus: 1e6}\ncontact: {error: 1e-3, rule: " + rule +
                                      "}\nobjects:\n  - name: hoop\n    particles: {at: [0, 0, 0.085]}\n"
                                      "    skeleton: [{shape: ring, radius: 0.3, kernel: {type: wyvill, radius: 0.2}}]\n    contact: {modulus: 1e4}\n",
                                  "test.yaml", "."));
  };
  for (const bool met : {true, false}) {
    Simulation simulation = make(met ? "march" : "polar");
    const auto pair = nlohmann::json::parse(query_contact(simulation, false)).at("pairs").at(0);
    EXPECT_EQ(pair.at("error_asked").get<double>(), 1e-3);
    EXPECT_EQ(pair.at("error_met").get<bool>(), met);
    EXPECT_EQ(pair.at("error_estimate").get<double>() > 1.01e-3, !met) << pair;
    const std::string text = explain(simulation);
    EXPECT_EQ(text.find(", above the given 0.001") == std::string::npos, met) << text;
  }
}

}  // namespace
}  // namespace supple::scenes
