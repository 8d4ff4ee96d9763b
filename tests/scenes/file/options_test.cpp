// Every key of a scene file changes something: two scenes that differ in it alone differ in their state, their surfaces,
// their pictures or their files. Keys without a line here are found by walking the schema.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>


#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/render/image.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#ifdef SUPPLE_HAS_CGAL
#include "supple/cgal/surface_meshes.h"
#include "support/temp_folder.h"
#endif

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// What of a scene is compared.
enum class In { State, Surface, Picture, Files };

/// A scene of one object in parts.
struct Parts {
  std::string particles = "arrange: line, count: 5, spacing: 0.2, disorder: 0.02, velocity: [0.1, 0.2, 0.3], spin: [1, 2, 3]";
  std::string interactions = "{law: bond_frame, stretch: 50, rotation: 0.5}";
  std::string skeleton = "{shape: point, kernel: {radius: 0.3}}";
  std::string object{};  ///< more keys of it
  std::string scene{};   ///< more keys of the scene
  std::string timing = "duration: 0.2\nframe_rate: 20\n";
};

/// A key, or one choice of a key, and two scenes that differ in nothing else.
struct Option {
  std::string key;
  In in = In::State;
  Parts one, other;
};

std::string text_of(const Parts& parts) {
  const auto line = [](const std::string& key, const std::string& value) {
    return value.empty() ? std::string() : "    " + key + ": [" + value + "]\n";
  };
  return "schema: 1\n" + parts.timing + "objects:\n  - name: body\n    particles: {" + parts.particles + "}\n" +
         line("interactions", parts.interactions) + line("skeleton", parts.skeleton) +
         (parts.object.empty() ? "" : "    " + parts.object + "\n") + parts.scene + "\n";
}

/// Lines whose two scenes are written by replacing $ in a common one.
Option differs(std::string key, In in, Parts common, const std::string& one, const std::string& other) {
  const auto with = [&](const std::string& value) {
    Parts parts = common;
    for (std::string* text : {&parts.particles, &parts.interactions, &parts.skeleton, &parts.object, &parts.scene, &parts.timing}) {
      for (std::size_t at; (at = text->find('$')) != std::string::npos;) text->replace(at, 1, value);
    }
    return parts;
  };
  return {std::move(key), in, with(one), with(other)};
}

void add_motion(std::vector<Option>& all) {
  const auto in_scene = [&](const std::string& key, const std::string& scene, const std::string& one, const std::string& other) {
    all.push_back(differs(key, In::State, {.scene = scene}, one, other));
  };
  all.push_back(differs("duration", In::Files, {.scene = "output: {particles: csv}", .timing = "duration: $\nframe_rate: 20\n"}, "0.1", "0.2"));
  all.push_back(differs("frame_rate", In::Files, {.scene = "output: {particles: csv}", .timing = "duration: 0.2\nframe_rate: $\n"}, "10", "20"));
  in_scene("gravity", "gravity: $", "[0, 0, 0]", "[0, 0, -9.81]");
  const std::string gravity = "gravity: [0, 0, -9.81]\n", drag = "medium: {linear: 1}";
  in_scene("gravity_course.expression", gravity + "gravity_course: {expression: \"$\"}", "1", "t / (1 s)");
  in_scene("gravity_course.keys.time", gravity + "gravity_course: {keys: [{time: 0, factor: 1}, {time: $, factor: 2}]}", "0.1", "0.2");
  in_scene("gravity_course.keys.factor", gravity + "gravity_course: {keys: [{time: 0, factor: $}]}", "1", "2");
  const auto in_wind = [&](const std::string& key, const std::string& scene, const std::string& one, const std::string& other) {
    all.push_back(differs("wind." + key, In::State, {.object = drag, .scene = "wind: {" + scene + "}"}, one, other));
  };
  in_wind("velocity", "velocity: $", "[1, 0, 0]", "[2, 0, 0]");
  in_wind("course.expression", "velocity: [1, 0, 0], course: {expression: \"$\"}", "1", "t / (1 s)");
  in_wind("course.keys.time", "velocity: [1, 0, 0], course: {keys: [{time: 0, factor: 1}, {time: $, factor: 2}]}", "0.1", "0.2");
  in_wind("course.keys.factor", "velocity: [1, 0, 0], course: {keys: [{time: 0, factor: $}]}", "1", "2");
  all.push_back(differs("planar", In::State,
                        {.particles = "arrange: line, count: 5, spacing: 0.2, spin: [0, 0, 3]",
                         .object = "loads: [{particle: 2, force: [0, 0, 1]}]",
                         .scene = "planar: $"}, "false", "true"));
  in_scene("accuracy", "accuracy: $", "1e-2", "1e-4");
  in_scene("time_step.size", "time_step: {size: $}", "auto", "0.1 ms");
  in_scene("time_step.substeps", "time_step: {substeps: $}", "auto", "1024");
  in_scene("sleep.speed", "sleep: {speed: $, time: 0.02}", "1e-6", "100");
  in_scene("sleep.time", "sleep: {speed: 100, time: $}", "0.02", "10");
  in_scene("time_step.max_substeps", "time_step: {max_substeps: $}", "4096", "1");
  for (const char* method : {"rk4", "adaptive", "backward_euler", "implicit_midpoint", "implicit"}) {
    in_scene("integrator.method=" + std::string(method), "integrator: {method: $}", "symplectic", method);
  }
  all.push_back(differs("integrator.method=auto", In::State,
                        {.interactions = "{law: bond_frame, stretch: 1e10, rotation: 0.5}", .scene = "integrator: {method: $}\ntime_step: {size: 50 ms}"},
                        "symplectic", "auto"));
  all.push_back(differs("integrator.rotation=exponential", In::State,
                        {.particles = "arrange: single, inertia_axes: [0.1, 0.2, 0.3], spin: [1, 2, 3]", .interactions = "",
                         .scene = "integrator: {rotation: $}"}, "splitting", "exponential"));
  in_scene("integrator.tolerance", "integrator: {method: adaptive, tolerance: $}", "1e-3", "1e-9");
}

void add_arrangements(std::vector<Option>& all) {
  const auto arranged = [&](const std::string& key, const std::string& particles, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.particles." + key, In::State, {.particles = particles, .interactions = ""}, one, other));
  };
  const std::string single = "arrange: single";
  for (const auto& [name, rest] : std::map<std::string, std::string>{
           {"line", "count: 3, spacing: 0.2"}, {"ring", "count: 5, radius: 0.4"}, {"grid", "columns: 2, rows: 2, spacing: 0.2"},
           {"spiral", "count: 6, inner_radius: 0.1, outer_radius: 0.3"}, {"file", "file: points.csv"},
           {"geodesic", "frequency: 1, radius: 0.3"}, {"ball", "radius: 0.2, spacing: 0.1"}, {"tube", "radius: 0.2, length: 0.4, spacing: 0.1"},
           {"curve", "count: 4, points: [[0, 0, 0], [1, 0, 0], [1, 1, 0]]"}, {"scatter", "count: 3, size: [1, 1, 1], spacing: 0.1"},
           {"fill", "file: block.obj, spacing: 0.2"}, {"points", "points: [[0, 0, 0], [1, 0, 0]]"}}) {
    arranged("arrange=" + name, "$", single, "arrange: " + name + ", " + rest);
  }
  arranged("count", "arrange: line, count: $, spacing: 0.2", "3", "4");
  arranged("radius", "arrange: ring, count: 5, radius: $", "0.4", "0.5");
  arranged("frequency", "arrange: geodesic, frequency: $, radius: 0.5", "1", "2");
  arranged("inner_radius", "arrange: spiral, count: 6, inner_radius: $, outer_radius: 0.3", "0.1", "0.15");
  arranged("outer_radius", "arrange: spiral, count: 6, inner_radius: 0.1, outer_radius: $", "0.3", "0.4");
  arranged("turns", "arrange: spiral, count: 6, inner_radius: 0.1, outer_radius: 0.3, turns: $", "1", "2");
  arranged("spacing", "arrange: line, count: 3, spacing: $", "0.1", "0.2");
  arranged("columns", "arrange: grid, columns: $, rows: 2, spacing: 0.2", "2", "3");
  arranged("rows", "arrange: grid, columns: 2, rows: $, spacing: 0.2", "2", "3");
  arranged("layers", "arrange: grid, columns: 2, rows: 2, layers: $, spacing: 0.2", "1", "2");
  arranged("file", "arrange: file, file: $", "points.csv", "more_points.csv");
  all.push_back(differs("objects.particles.own_normal", In::State,
                        {.particles = "arrange: grid, columns: 2, rows: 2, spacing: 0.2, disorder: 0.03, own_normal: $",
                         .interactions = "{law: coplanarity, within: 0.25, strength: 5}"}, "[0, 0, 1]", "[0, 1, 1]"));
  arranged("length", "arrange: tube, radius: 0.2, length: $, spacing: 0.1", "0.3", "0.6");
  arranged("points", "arrange: curve, count: 4, points: $", "[[0, 0, 0], [1, 0, 0]]", "[[0, 0, 0], [1, 1, 0]]");
  arranged("size", "arrange: scatter, count: 3, size: $, spacing: 0.1", "[1, 1, 1]", "[1, 2, 1]");
  arranged("seed", "arrange: scatter, count: 3, size: [1, 1, 1], spacing: 0.1, seed: $", "1", "2");
  arranged("normal=radial", "arrange: ring, count: 5, radius: 0.3, normal: $", "axis", "radial");
  arranged("disorder", "arrange: line, count: 3, spacing: 0.2, disorder: $", "0", "0.01");
  arranged("at", "arrange: single, at: $", "[0, 0, 0]", "[0, 0, 1]");
  arranged("axis", "arrange: line, count: 3, spacing: 0.2, axis: $", "[0, 0, 1]", "[0, 1, 1]");
  arranged("angle_deg", "arrange: line, count: 3, spacing: 0.2, angle_deg: $", "0", "30");
  arranged("velocity", "arrange: single, velocity: $", "[0, 0, 0]", "[1, 0, 0]");
  arranged("spin", "arrange: single, spin: $", "[0, 0, 0]", "[1, 0, 0]");
  const auto loaded = [&](const std::string& key, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.particles." + key, In::State,
                          {.particles = "arrange: line, count: 3, spacing: 0.2, " + key + ": $", .interactions = "",
                           .object = "loads: [{particle: 0, force: [1, 0, 0], torque: [0.1, 0.2, 0.3]}]"}, one, other));
  };
  loaded("mass", "1", "2");
  loaded("inertia_radius", "auto", "0.2");
  all.push_back(differs("objects.particles.bonds", In::State,
                        {.particles = "arrange: points, points: [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]], bonds: [$]", .interactions = "",
                         .object = "material: {youngs_modulus: 1e4, density: 1000}\n    loads: [{particle: 0, force: [1, 0.5, 2]}]"}, "0, 1, 1, 2", "0, 1, 0, 2"));
  const std::string places = "arrange: points, points: [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]], bonds: [0, 1, 1, 2]";
  const auto shell = [&](const std::string& key, const std::string& one, const std::string& other) {
    std::string rest;
    for (const auto& [name, value] : {std::pair<std::string, std::string>{"sections", "0.01, 0.01"}, {"normals", "[0, 0, 1], [0, 0, 1], [0, 0, 1]"}, {"directions", "[1, 0, 0], [1, 0, 0], [1, 0, 0]"},
                                      {"curvatures", "1, 0, 1, 0, 1, 0"}}) {
      rest += ", " + name + ": [" + (name == key ? "$" : value) + ']';
    }
    rest += std::string(", thickness: ") + (key == "thickness" ? "$" : "0.05");
    all.push_back(differs("objects.particles." + key, In::State,
                          {.particles = places + rest, .interactions = "", .object = "material: {youngs_modulus: 1e4, density: 1000}\n    loads: [{particle: 0, force: [1, 0.5, 2]}]"}, one,
                          other));
  };
  shell("sections", "0.01, 0.01", "0.01, 0.02");
  shell("normals", "[0, 0, 1], [0, 0, 1], [0, 0, 1]", "[0, 0, 1], [0, 0.1, 1], [0, 0, 1]");
  shell("directions", "[1, 0, 0], [1, 0, 0], [1, 0, 0]", "[1, 1, 0], [1, 0, 0], [1, 0, 0]");
  shell("curvatures", "1, 0, 1, 0, 1, 0", "1, 0, 1, 0, 2, 0");
  shell("thickness", "0.05", "0.06");
  all.push_back(differs("objects.scale", In::State, {.interactions = "", .object = "scale: $"}, "1", "2"));
  loaded("inertia_axes", "[0.2, 0.2, 0.2]", "[0.1, 0.2, 0.3]");
}

void add_laws(std::vector<Option>& all) {
  // Bonds of every kind hold this sheet, disturbed and bent by loads, as well as the law in question.
  const std::string sheet = "arrange: grid, columns: 3, rows: 3, spacing: 0.2, disorder: 0.03, spin: [0, 0, 1]";
  const std::string loads = "loads: [{particle: 0, force: [0.5, 0, 2], torque: [0.1, 0, 0]}]";
  const std::string base = "{law: bond_frame, within: 0.25, stretch: 50, rotation: 0.5}";
  const auto law = [&](const std::string& key, const std::string& text, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.interactions." + key, In::State,
                          {.particles = sheet, .interactions = base + (text.empty() ? "" : ", " + text), .object = loads}, one, other));
  };
  const auto on_ring = [&](const std::string& key, const std::string& interactions, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.interactions." + key, In::State,
                          {.particles = "arrange: ring, count: 8, radius: 0.3, normal: radial", .interactions = interactions, .object = loads}, one, other));
  };
  const std::map<std::string, std::string> laws = {
      {"cohesion", "within: 0.25, maximum_ratio: 1.2, maximum_force: 5"},
      {"linear_cohesion", "within: 0.25, scale_force: 5"},
      {"directed_cohesion", "within: 0.25, scale_force: 5, semi_axes: [0.1, 0.08, 0.12]"},
      {"lennard_jones", "within: 0.25, depth: 0.5"},
      {"gay_berne", "geometric: true, depth: 0.1, semi_axes: [0.1, 0.08, 0.06], cut_off: 0.5"},
      {"bond_frame", "within: 0.3, stretch: 20, rotation: 0.1"},
      {"form", "within: 0.25, strength: 0.5"},
      {"directed_form", "within: 0.25, strength: 0.5"},
      {"coplanarity", "within: 0.25, strength: 5"},
      {"co_normality", "within: 0.25, strength: 0.5"},
      {"co_circularity", "within: 0.25, strength: 5"},
      {"friction", "within: 0.25, linear: 1"}};
  for (const auto& [name, keys] : laws) {
    const Parts without{.particles = sheet, .interactions = base, .object = loads};
    Parts with = without;
    with.interactions += ", {law: " + name + ", " + keys + "}";
    all.push_back({"objects.interactions.law=" + name, In::State, without, with});
  }
  law("neighbours", "{law: bond_frame, neighbours: $, stretch: 20, rotation: 0.1}", "1", "2");
  law("within", "{law: bond_frame, within: $, stretch: 20, rotation: 0.1}", "0.25", "0.35");
  law("geometric", "{law: coplanarity, strength: 5, range: 0.3, $}", "within: 0.25", "geometric: true");
  law("normalised", "{law: coplanarity, within: 0.25, strength: 5, normalised: $}", "false", "true");
  on_ring("law=form_radius", "{law: bond_frame, stretch: 50, rotation: 0.5}$", "", ", {law: form_radius, strength: 5}");
  on_ring("paper_literal", "{law: bond_frame, stretch: 50, rotation: 0.5}, {law: form_radius, strength: 5, paper_literal: $}", "false", "true");
  law("stretch", "{law: bond_frame, stretch: $, rotation: 0.1}", "20", "40");
  law("rotation", "{law: bond_frame, stretch: 20, rotation: $}", "0.1", "0.2");
  law("strength", "{law: form, strength: $}", "0.5", "1");
  law("linear", "{law: friction, linear: $}", "0", "1");
  law("angular", "{law: friction, angular: $}", "0", "1");
  law("rest_distance", "{law: linear_cohesion, scale_force: 5, rest_distance: $}", "auto", "0.25");
  law("maximum_distance", "{law: cohesion, maximum_distance: $, maximum_force: 5}", "0.5", "0.6");
  law("maximum_ratio", "{law: cohesion, maximum_ratio: $, maximum_force: 5}", "1.2", "1.4");
  law("maximum_force", "{law: cohesion, maximum_ratio: 1.2, maximum_force: $}", "5", "6");
  law("scale_force", "{law: linear_cohesion, scale_force: $}", "5", "6");
  law("gain", "{law: cohesion, gain: $, alpha: 30}", "100", "200");
  law("alpha", "{law: cohesion, gain: 100, alpha: $}", "30", "40");
  law("table_error", "{law: cohesion, maximum_ratio: 1.2, maximum_force: 5$}", "", ", table_error: 0.01");
  law("shape", "{law: linear_cohesion, scale_force: 5, shape: $}", "4", "5");
  law("eta", "{law: linear_cohesion, scale_force: 5, eta: $}", "0", "1");
  law("semi_axes", "{law: directed_cohesion, scale_force: 5, semi_axes: $}", "[0.1, 0.1, 0.1]", "[0.1, 0.08, 0.12]");
  const auto ellipsoids = [&](const std::string& key, const std::string& one, const std::string& other) {
    const auto with = [&](const std::string& value) {
      return "{law: gay_berne, geometric: true, semi_axes: [0.1, 0.08, 0.06], cut_off: 0.5" +
             std::string(key == "depth" ? "" : ", depth: 0.1") + (value.empty() ? "" : ", " + key + ": " + value) + "}";
    };
    law(key, "$", with(one), with(other));
  };
  ellipsoids("depth", "0.1", "0.2");
  ellipsoids("sigma", "", "0.15");
  ellipsoids("gamma", "1", "0.8");
  ellipsoids("wells", "[1, 1, 1]", "[1, 0.5, 0.2]");
  ellipsoids("upsilon", "1", "2");
  law("mu", "{law: gay_berne, geometric: true, depth: 0.1, semi_axes: [0.1, 0.08, 0.06], cut_off: 0.5, wells: [1, 0.5, 0.2], mu: $}",
      "1", "2");
  law("repulsive", "{law: lennard_jones, depth: 0.5, repulsive: $}", "12", "9");
  law("attractive", "{law: lennard_jones, depth: 0.5, attractive: $}", "6", "4");
  law("cut_off", "{law: lennard_jones, depth: 0.5$}", "", ", cut_off: 0.5");
  law("switch_from", "{law: lennard_jones, depth: 0.5, cut_off: 0.5$}", "", ", switch_from: 0.3");
  law("range", "{law: form, strength: 0.5$}", "", ", range: 0.6");

  const std::string kinds = "kinds: $";
  const auto kind = [&](const std::string& key, const std::string& object, const std::string& one, const std::string& other) {
    all.push_back(differs(key, In::State, {.object = object}, one, other));
  };
  kind("objects.kinds.type", kinds, "[{type: 0, particles: [0, 1]}]", "[{type: 1, particles: [0, 1]}]");
  kind("objects.kinds.particles", kinds, "[{type: 1, particles: [0]}]", "[{type: 1, particles: [0, 1]}]");
  kind("objects.kinds.hinge", kinds, "[{type: 1, particles: [0]}, {particles: [1]}]", "[{type: 1, particles: [0]}, {hinge: true, particles: [1]}]");
  kind("objects.hinges_join", "hinges_join: $\n    kinds: [{hinge: true, particles: [1, 2]}]", "false", "true");
}

void add_object_rules(std::vector<Option>& all) {
  const auto in_object = [&](const std::string& key, const std::string& object, const std::string& one, const std::string& other) {
    all.push_back(differs("objects." + key, In::State, {.object = object}, one, other));
  };
  // Two in one object: bodies of their own touch each other.
  all.push_back(differs("objects.separate", In::State,
                        {.particles = "arrange: line, count: 2, spacing: 0.2", .interactions = "", .object = "separate: $\n    contact: {modulus: 1000}"},
                        "false", "true"));
  all.push_back(differs("objects.contact.self", In::State,
                        {.particles = "arrange: line, count: 2, spacing: 0.4, spin: [0, 9, 0], mass: 0.1", .interactions = "",
                         .object = "blend: {rule: graph}\n    contact: {modulus: 1000, self: $}\n    loads: [{particle: 0, force: [40, 0, 0]}]"},
                        "false", "true"));
  in_object("repulsion.own", "repulsion: {force: 1, distance: 0.2, length: 0.1, own: $}", "false", "true");
  in_object("repulsion.force", "repulsion: {force: $, distance: 0.2, length: 0.1, own: true}", "1", "2");
  in_object("repulsion.distance", "repulsion: {force: 1, distance: $, length: 0.1, own: true}", "0.2", "0.3");
  in_object("repulsion.length", "repulsion: {force: 1, distance: 0.3, length: $, own: true}", "0.1", "0.2");
  in_object("medium.linear", "medium: {linear: $}", "0", "1");
  in_object("medium.angular", "medium: {angular: $}", "0", "1");
  in_object("rayleigh.mass", "rayleigh: {mass: $}", "0", "1");
  in_object("rayleigh.stiffness", "rayleigh: {stiffness: $}", "0", "0.01");
  const std::string pull = "\n    loads: [{particle: 0, force: [-200, 0, 50], torque: [0, 30, 0]}]";
  for (const auto& [key, value] : std::map<std::string, std::string>{{"stretch", "0.05"}, {"energy", "0.01"}, {"force", "5"}}) {
    in_object("breaking." + key, "$" + pull, "", "breaking: {" + key + ": " + value + "}");
  }
  in_object("breaking.couple", "breaking: {force: 60$}" + pull, "", ", couple: 0.5");
  in_object("yielding.energy", "$" + pull, "yielding: {energy: 1e9}", "yielding: {energy: 0.01}");
  in_object("yielding.time", "yielding: {energy: 0.01, time: $}" + pull, "0", "1");
  const std::string turned = "loads: [{particle: 0, force: [40, 0, 5]}]\n    cuts: ";
  in_object("appears", "appears: $", "0", "0.1");
  in_object("cuts.time", turned + "[{time: $, particles: [0, 1]}]", "0.05", "0.15");
  in_object("cuts.particles", turned + "[{time: 0.05, particles: $}]", "[0, 1]", "[1, 2]");
  in_object("cuts.at", turned + "[{time: 0.05, at: $, normal: [1, 0, 0]}]", "[-0.3, 0, 0]", "[0.1, 0, 0]");
  in_object("cuts.normal", turned + "[{time: 0.05, at: [0.1, 0, 0], normal: $}]", "[1, 0, 0]", "[0, 1, 0]");
  in_object("pins.until", "pins: [{particle: 0$}]", "", ", until: 0.05");
  in_object("pins.particle", "pins: [{particle: $}]", "0", "1");
  const auto in_motion = [&](const std::string& key, const std::string& motion, const std::string& one, const std::string& other) {
    in_object("pins.motion." + key, "pins: [{particle: 0, motion: {" + motion + "}}]", one, other);
  };
  in_motion("keys.time", "keys: [{time: $, by: [0.1, 0, 0]}]", "0.1", "0.2");
  in_motion("keys.by", "keys: [{time: 0.1, by: $}]", "[0.1, 0, 0]", "[0, 0.1, 0]");
  in_motion("keys.turn_deg", "keys: [{time: 0.1, turn_deg: $}]", "10", "20");
  in_motion("between=linear", "keys: [{time: 0.15, by: [0.1, 0, 0]}], between: $", "smooth", "linear");
  in_motion("turn_axis", "keys: [{time: 0.1, turn_deg: 20}], turn_axis: $", "[1, 0, 0]", "[0, 1, 0]");
  for (const std::string axis : {"x", "y", "z"}) in_motion(axis, axis + ": \"$\"", "1 cm*t/(1 s)", "2 cm*t/(1 s)");
  in_object("pins.position", "pins: [{particle: 0, position: $}]", "true", "false");
  in_object("pins.orientation", "pins: [{particle: 0, orientation: $}]", "true", "false");
  in_object("loads.particle", "loads: [{particle: $, force: [0, 0, 1]}]", "0", "1");
  in_object("loads.force", "loads: [{particle: 0, force: $}]", "[0, 0, 1]", "[0, 1, 1]");
  in_object("loads.torque", "loads: [{particle: 0, torque: $}]", "[0, 0, 1]", "[0, 1, 1]");
  in_object("loads.from", "loads: [{particle: 0, force: [0, 0, 1], from: $}]", "0", "0.05");
  in_object("loads.until", "loads: [{particle: 0, force: [0, 0, 1]$}]", "", ", until: 0.05");
  in_object("loads.course.expression", "loads: [{particle: 0, force: [0, 0, 1], course: {expression: \"$\"}}]", "1", "t / (1 s)");
  in_object("loads.course.keys.time", "loads: [{particle: 0, force: [0, 0, 1], course: {keys: [{time: 0, factor: 1}, {time: $, factor: 2}]}}]", "0.1", "0.2");
  in_object("loads.course.keys.factor", "loads: [{particle: 0, force: [0, 0, 1], course: {keys: [{time: 0, factor: $}]}}]", "1", "2");
  in_object("loads.ramp", "loads: [{particle: 0, force: [0, 0, 1], ramp: $}]", "0", "0.05");
  const auto volume = [&](const std::string& key, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.volume." + key, In::State,
                          {.particles = "arrange: line, count: 3, spacing: 0.15, velocity: [0, 0, 0]",
                           .interactions = "{law: bond_frame, stretch: 50, rotation: 0.5, neighbours: 2}",
                           .object = "volume: {" + key.substr(0, key.find('=')) + ": $}\n    loads: [{particle: 0, force: [-30, 0, 0]}, {particle: 2, force: [20, 0, 0]}]"},
                          one, other));
  };
  volume("of=particle", "object", "particle");
  all.push_back(differs("objects.volume.of=primitive", In::State,
                        {.skeleton = "{shape: point, kernel: {radius: 0.3}}, {shape: point, at: [0, 0.1, 0], kernel: {radius: 0.25}}",
                         .object = "volume: {of: $, target: 0.01}"}, "particle", "primitive"));
  all.push_back(differs("objects.skeleton.volume", In::State,
                        {.skeleton = "{shape: point$, kernel: {radius: 0.3}}", .object = "volume: {of: primitive}"}, "", ", volume: 0.02"));
  volume("target", "auto", "0.2");
  volume("rate", "2", "20");
  volume("damping", "0.05", "0.1");
  const auto of_material = [&](const std::string& key, const std::string& one, const std::string& other) {
    std::string material = "youngs_modulus: 1e4, density: 1000, poissons_ratio: 0.2, damping_ratio: 0.05, friction: 0.5";
    const std::size_t at = material.find(key + ": ") + key.size() + 2, end = std::min(material.find(',', at), material.size());
    material.replace(at, end - at, "$");
    const bool touches = key == "friction";
    all.push_back(differs("objects.material." + key, In::State,
                          {.particles = "arrange: grid, columns: 3, rows: 3, layers: 3, spacing: 0.1, velocity: [1, 0, 0]", .interactions = "",
                           .skeleton = "{shape: point, kernel: {radius: 0.15}}",
                           .object = "material: {" + material + "}\n    loads: [{particle: 0, force: [3, 0, 2]}]" + (touches ? "\n    contact: {}" : ""),
                           .scene = touches ? "gravity: [0, 0, -9.81]\nground: {height: -0.17, friction: 1}" : ""},
                          one, other));
  };
  of_material("youngs_modulus", "1e4", "2e4");
  of_material("density", "1000", "1100");
  of_material("poissons_ratio", "0.1", "0.2");
  of_material("damping_ratio", "0.05", "0.1");
  of_material("friction", "0.1", "0.5");
}

void add_surfaces(std::vector<Option>& all) {
  const auto shape = [&](const std::string& key, const std::string& skeleton, const std::string& one, const std::string& other) {
    all.push_back(differs("objects.skeleton." + key, In::Surface,
                          {.particles = "arrange: line, count: 2, spacing: 0.5", .skeleton = "{" + skeleton + "}"}, one, other));
  };
  const std::map<std::string, std::string> shapes = {
      {"segment", "half_length: 0.1"}, {"square", "half_size: 0.1"}, {"rectangle", "half_sizes: [0.1, 0.2]"}, {"disc", "radius: 0.1"},
      {"box", "half_sizes: [0.1, 0.1, 0.1]"}, {"triangle", "points: [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]]"},
      {"polygon", "points: [[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0]]"}, {"ring", "radius: 0.15"},
      {"arc", "radius: 0.15, half_angle_deg: 40"}, {"curve", "points: [[0, 0, 0], [0.1, 0.1, 0], [0.2, 0, 0]]"}};
  for (const auto& [name, keys] : shapes) {
    shape("shape=" + name, "$, kernel: {radius: 0.2}", "shape: point", "shape: " + name + ", " + keys);
  }
  for (const char* own : {"shape: ellipsoid, semi_axes: [0.2, 0.3, 0.25]", "shape: superquadric, semi_axes: [0.2, 0.3, 0.25]",
                          "shape: directed, radii: [0.2, 0.3, 0.25]"}) {
    const std::string text = own;
    shape("shape=" + text.substr(7, text.find(',') - 7), "$", "shape: point, kernel: {radius: 0.2}", text + ", kernel: {type: wyvill}");
  }
  const std::string k = ", kernel: {radius: 0.2}";
  shape("half_size", "shape: square, half_size: $" + k, "0.1", "0.12");
  shape("half_length", "shape: segment, half_length: $" + k, "0.1", "0.12");
  shape("half_sizes", "shape: box, half_sizes: $" + k, "[0.1, 0.1, 0.1]", "[0.1, 0.12, 0.1]");
  shape("radius", "shape: disc, radius: $" + k, "0.1", "0.12");
  shape("half_angle_deg", "shape: arc, radius: 0.15, half_angle_deg: $" + k, "40", "50");
  shape("points", "shape: curve, points: $" + k, "[[0, 0, 0], [0.1, 0.1, 0], [0.2, 0, 0]]", "[[0, 0, 0], [0.1, 0.2, 0], [0.2, 0, 0]]");
  shape("semi_axes", "shape: ellipsoid, semi_axes: $, kernel: {type: wyvill}", "[0.2, 0.3, 0.25]", "[0.2, 0.3, 0.3]");
  shape("exponents", "shape: superquadric, semi_axes: [0.2, 0.3, 0.25], exponents: $, kernel: {type: wyvill}", "[0.5, 0.5]", "[0.5, 0.8]");
  shape("radii", "shape: directed, radii: $, kernel: {type: wyvill}", "[0.2, 0.3, 0.25]", "[0.2, 0.3, 0.3]");
  shape("radii_behind", "shape: directed, radii: [0.2, 0.3, 0.25]$, kernel: {type: wyvill}", "", ", radii_behind: [0.2, 0.3, 0.3]");
  shape("end_radius", "shape: segment, half_length: 0.1$" + k, "", ", end_radius: 0.15");
  shape("convolve", "shape: segment, half_length: 0.1, convolve: $" + k, "false", "true");
  shape("stretch", "shape: point, stretch: $" + k, "[1, 1, 1]", "[1, 1, 1.5]");
  shape("at", "shape: point, at: $" + k, "[0, 0, 0]", "[0, 0, 0.1]");
  shape("turn_axis", "shape: segment, half_length: 0.1, turn_deg: 30, turn_axis: $" + k, "[0, 0, 1]", "[0, 1, 0]");
  shape("turn_deg", "shape: segment, half_length: 0.1, turn_deg: $" + k, "0", "30");
  shape("particles", "shape: point$" + k, "", ", particles: [0]");
  shape("kernel.radius", "shape: point, kernel: {radius: $}", "0.2", "0.25");
  for (const char* type : {"soft_object", "murakami", "nishimura", "blinn", "cauchy", "blanc_schlick"}) {
    shape("kernel.type=" + std::string(type), "shape: point, kernel: {type: $, radius: 0.3}", "wyvill", type);
  }
  shape("kernel.type=gascuel", "shape: point, kernel: {radius: 0.3, $}", "type: wyvill", "type: gascuel, thickness: 0.15, slope: 5");
  shape("kernel.thickness", "shape: point, kernel: {type: gascuel, radius: 0.3, thickness: $, slope: 5}", "0.15", "0.2");
  // The slope of one kernel does not move its surface; where two meet it does.
  all.push_back(differs("objects.skeleton.kernel.slope", In::Surface,
                        {.particles = "arrange: line, count: 2, spacing: 0.3", .skeleton = "{shape: point, kernel: {type: gascuel, radius: 0.3, thickness: 0.15, slope: $}}"},
                        "5", "8"));
  shape("kernel.sharpness", "shape: point, kernel: {type: blinn, radius: 0.3, sharpness: $}", "2", "3");
  shape("kernel.hardness", "shape: point, kernel: {type: blanc_schlick, radius: 0.3, hardness: $}", "0.5", "2");

  const auto joined = [&](const std::string& key, const std::string& object, const std::string& one, const std::string& other) {
    all.push_back(differs("objects." + key, In::Surface,
                          {.particles = "arrange: ring, count: 6, radius: 0.2", .object = object}, one, other));
  };
  joined("iso", "iso: $", "0.5", "0.4");
  for (const char* rule : {"graph", "ricci", "gradient"}) joined("blend.rule=" + std::string(rule), "blend: {rule: $}", "sum", rule);
  joined("blend.groups.particles", "blend: {rule: graph, groups: [{particles: $}]}", "[0, 1, 2]", "[0, 1, 2, 3]");
  joined("blend.neighbours", "blend: {rule: graph$}", "", ", neighbours: 2");
  joined("blend.within", "blend: {rule: graph$}", "", ", within: 0.25");
  joined("blend.exponent", "blend: {rule: ricci, exponent: $}", "4", "8");
  joined("blend.opening", "blend: {rule: gradient, opening: $}", "0.3", "0.6");
  all.push_back(differs("objects.blend.fade", In::Surface,
                        {.object = "blend: {rule: graph, neighbours: 1, fade: $}\n    breaking: {stretch: 0.05}\n    loads: [{particle: 0, force: [-200, 0, 0]}]"},
                        "0", "10"));
  const auto meshed = [&](const std::string& key, const std::string& scene, const std::string& one, const std::string& other) {
    all.push_back(differs("output." + key, In::Surface, {.scene = "output: {" + scene + "}"}, one, other));
  };
  meshed("cell", "cell: $", "auto", "0.05");
  all.push_back(differs("objects.meshing.cell", In::Surface, {.object = "meshing: {$}"}, "", "cell: 0.05"));
  all.push_back(differs("objects.meshing.error", In::Surface, {.object = "meshing: {$}", .scene = "output: {cell: 0.1, meshing: {method: cubes}}"}, "", "error: 1e-4"));
  meshed("meshing.method=tetrahedra", "cell: 0.05, meshing: {method: $}", "cubes", "tetrahedra");
  meshed("meshing.method=openvdb", "cell: 0.05, meshing: {method: $}", "cubes", "openvdb");
  meshed("meshing.method=auto", "cell: 0.05, meshing: {method: $}", "tetrahedra", "auto");
  meshed("meshing.error", "cell: 0.1, meshing: {method: cubes, error: $}", "auto", "1e-4");
#ifdef SUPPLE_HAS_CGAL
  meshed("meshing.method=delaunay", "cell: 0.1, meshing: {method: $}", "cubes", "delaunay");
  meshed("meshing.angle_deg", "cell: 0.1, meshing: {method: delaunay, size: 0.2, distance: 0.02, angle_deg: $}", "5", "30");
  meshed("meshing.size", "cell: 0.1, meshing: {method: delaunay, size: $}", "auto", "0.06");
  meshed("meshing.distance", "cell: 0.1, meshing: {method: delaunay, size: 0.2, distance: $}", "0.02", "0.002");
#endif
}

void add_contact(std::vector<Option>& all) {
  // A lying bar in the ground, in a box and beside another object, sliding.
  const std::string shortly = "duration: 0.03\nframe_rate: 100\n";
  const Parts sliding{.particles = "arrange: line, count: 3, spacing: 0.2, velocity: [1, 0, -1], mass: 0.1", .timing = shortly};
  const std::string ground = "ground: {height: -0.1, modulus: 1e4}\n";
  const auto on_ground = [&](const std::string& key, const std::string& contact, const std::string& scene, const std::string& one, const std::string& other) {
    Parts parts = sliding;
    parts.object = "contact: " + contact;
    parts.scene = scene;
    all.push_back(differs(key, In::State, parts, one, other));
  };
  on_ground("objects.contact.modulus", "{modulus: $}", ground, "1000", "2000");
  on_ground("objects.contact.friction", "{modulus: 1000, friction: $}", ground, "0", "0.5");
  on_ground("objects.contact.dissipation", "{modulus: 1000, dissipation: $}", ground, "0", "0.2");
  const std::string rubs = "{modulus: 1000, friction: 0.5, dissipation: 0.1}";
  on_ground("contact.error", rubs, ground + "contact: {error: $}", "1e-2", "1e-6");
  on_ground("contact.split=contribution", rubs, ground + "contact: {split: $}", "energy", "contribution");
  on_ground("contact.rule=panels", rubs, ground + "contact: {error: 1e-2, rule: $}", "auto", "panels");
  on_ground("contact.rule=polar", rubs, ground + "contact: {error: 1e-2, rule: $}", "march", "polar");
  on_ground("contact.rule=march", rubs, ground + "contact: {error: 1e-2, rule: $}", "auto", "march");
  on_ground("contact.rule=panels", rubs, ground + "contact: {error: 1e-2, rule: $}", "auto", "panels");
  on_ground("contact.friction_speed", rubs, ground + "contact: {friction_speed: $}", "0.001", "5");
  on_ground("contact.stick.stiffness", rubs, ground + "contact: {stick: {stiffness: $}}", "10", "20");
  on_ground("contact.stick.damping", rubs, ground + "contact: {stick: {stiffness: 10, damping: $}}", "0", "0.05");
  on_ground("ground.height", rubs, "ground: {height: $, modulus: 1e4}", "-0.1", "-0.08");
  on_ground("ground.collides", rubs, "ground: {height: -0.1, collides: $}", "true", "false");
  on_ground("ground.modulus", rubs, "ground: {height: -0.1, modulus: $}", "1e4", "2e4");
  on_ground("ground.slope", rubs, "ground: {height: -0.1, modulus: 1e4, slope: $}", "1", "2");
  on_ground("ground.friction", rubs, "ground: {height: -0.1, modulus: 1e4, friction: $}", "0.5", "0.1");
  const auto pair = [&](const std::string& key, const std::string& keys, const std::string& one, const std::string& other) {
    on_ground("pairs." + key, rubs, ground + "pairs: [{objects: [body, ground], " + keys + "}]", one, other);
  };
  pair("collide", "collide: $", "true", "false");
  pair("from", "from: $", "0", "0.08");
  pair("until", "from: 0$", "", ", until: 0.01");
  pair("friction", "friction: $", "0.1", "0.3");
  pair("dissipation", "dissipation: $", "0", "0.3");
  pair("restitution.value", "restitution: {value: $, at_speed: 1}", "0.5", "0.7");
  pair("restitution.at_speed", "restitution: {value: 0.5, at_speed: $}", "1", "2");
  const std::string box = "obstacles: [{name: block, shape: box, half_sizes: [0.3, 0.3, 0.1], at: [0, 0, -0.2], modulus: 1e4, ";
  on_ground("pairs.objects", rubs, "contact: {error: 1e-2}\n" + ground + box + "}]\npairs: [{objects: [body, $], collide: false}]", "ground", "block");
  const auto obstacle = [&](const std::string& key, const std::string& keys, const std::string& one, const std::string& other) {
    on_ground("obstacles." + key, rubs, "contact: {error: 1e-2}\nobstacles: [{name: block, modulus: 1e4, " + keys + "}]", one, other);
  };
  obstacle("shape=plane", "at: [0, 0, -0.12], $", "shape: box, half_sizes: [0.3, 0.3, 0.02]", "shape: plane");
  obstacle("shape=heights", "at: [0, 0, -0.12], $", "shape: plane", "shape: heights, file: heights.csv");
  obstacle("at", "shape: plane, at: $", "[0, 0, -0.12]", "[0, 0, -0.1]");
  obstacle("normal", "shape: plane, at: [0, 0, -0.12], normal: $", "[0, 0, 1]", "[0, 0.3, 1]");
  obstacle("half_sizes", "shape: box, at: [0, 0, -0.2], half_sizes: $", "[0.3, 0.3, 0.1]", "[0.3, 0.3, 0.12]");
  obstacle("rounding", "shape: box, at: [0.1, 0, -0.2], turn_deg: 20, turn_axis: [0, 1, 0], half_sizes: [0.2, 0.3, 0.1], rounding: $", "0", "0.05");
  obstacle("turn_axis", "shape: box, at: [0, 0, -0.2], half_sizes: [0.3, 0.3, 0.1], turn_deg: 10, turn_axis: $", "[0, 0, 1]", "[0, 1, 0]");
  obstacle("turn_deg", "shape: box, at: [0, 0, -0.2], half_sizes: [0.3, 0.3, 0.1], turn_axis: [0, 1, 0], turn_deg: $", "0", "10");
  const std::string lift = "shape: box, half_sizes: [0.3, 0.3, 0.1], turn_axis: [0, 1, 0], between: smooth, keys: [{time: 0, at: [0, 0, -0.22]}, ";
  obstacle("keys", "shape: plane, $", "at: [0, 0, -0.12]", "keys: [{time: 0, at: [0, 0, -0.12]}, {time: 0.2, at: [0, 0, -0.1]}]");
  obstacle("keys.time", lift + "{time: $, at: [0, 0, -0.17]}]", "0.1", "0.2");
  obstacle("keys.at", lift + "{time: 0.2, at: $}]", "[0, 0, -0.2]", "[0, 0, -0.15]");
  obstacle("keys.turn_deg", lift + "{time: 0.2, at: [0, 0, -0.2], turn_deg: $}]", "0", "20");
  obstacle("between=linear", "shape: plane, between: $, keys: [{time: 0, at: [0, 0, -0.13]}, {time: 0.2, at: [0, 0, -0.1]}]", "smooth", "linear");
  obstacle("file", "shape: heights, at: [0, 0, -0.12], file: $", "heights.csv", "more_heights.csv");
  obstacle("shape=mesh", "at: [0, 0, -0.2], $", "shape: box, half_sizes: [0.5, 0.5, 0.1]", "shape: mesh, file: block.obj");
  obstacle("shape=implicit", "at: [0, 0, -0.2], $", "shape: box, half_sizes: [0.5, 0.5, 0.1]",
           "shape: implicit, skeleton: [{shape: rectangle, half_sizes: [0.5, 0.5], kernel: {radius: 0.2}}]");
  const std::string plate = "at: [0, 0, -0.2], shape: implicit, skeleton: [{shape: rectangle, half_sizes: [0.5, 0.5], kernel: ";
  obstacle("skeleton", plate + "{radius: $}}]", "0.2", "0.21");
  obstacle("iso", plate + "{radius: 0.2}}], iso: $", "0.5", "0.45");
  obstacle("slope", "shape: plane, at: [0, 0, -0.12], slope: $", "1", "2");
  obstacle("friction", "shape: plane, at: [0, 0, -0.12], friction: $", "0.5", "0.1");
  all.push_back(differs("obstacles.modulus", In::State,
                        {.particles = sliding.particles, .object = "contact: {modulus: 1000}", .scene = "obstacles: [{name: block, shape: plane, at: [0, 0, -0.12], modulus: $}]"},
                        "1e4", "2e4"));
  // Pressed hard, but with less energy than it holds: the barrier stiffens.
  all.push_back(differs("contact.core=barrier", In::State,
                        {.particles = "arrange: single, mass: 9e-4, velocity: [0, 0, -20]", .interactions = "", .object = "contact: {modulus: 100}",
                         .scene = "ground: {height: -0.2, modulus: 100}\ncontact: {core: $, error: 1e-2}", .timing = "duration: 0.06\nframe_rate: 50\n"}, "soft", "barrier"));
  // Particles that touch each other; the ground beside them has no size of its own.
  const auto beside = [&](const std::string& key, const std::string& keys, const std::string& one, const std::string& other) {
    all.push_back(differs("contact." + key, In::Surface,
                          {.interactions = "", .object = "separate: true\n    contact: {modulus: 1000}",
                           .scene = "contact: {" + keys + "}\noutput: {cell: 0.03}", .timing = shortly}, one, other));
  };
  beside("bulge", "bulge: $", "0", "0.5");
  beside("bulge_volume", "bulge_volume: $", "false", "true");
  beside("bulge_width", "bulge: 0.5, bulge_width: $", "0.05", "0.5");
  beside("bulge_literal", "bulge: 0.5, bulge_literal: $", "false", "true");
  // Samples only say where to look for a contact: its points, and so the last digits, depend on them.
  all.push_back(differs("contact.sample_spacing", In::State,
                        {.object = "contact: {modulus: 1000}", .scene = "ground: {height: -0.1, modulus: 1000}\ncontact: {sample_spacing: $}"},
                        "auto", "0.01"));
}

void add_pictures(std::vector<Option>& all) {
  const std::string small = "output: {images: {size: [48, 36], samples: 1}}\n";
  const std::string camera = "camera: {from: [0.4, -1.2, 0.4], look_at: [0.4, 0, 0]}\n";
  const auto look = [&](const std::string& key, const std::string& object, const std::string& one, const std::string& other) {
    all.push_back(differs("objects." + key, In::Picture, {.object = object, .scene = camera + small}, one, other));
  };
  look("colour", "colour: $", "[0.8, 0.1, 0.1]", "[0.1, 0.8, 0.1]");
  look("roughness", "roughness: $", "0.45", "0.1");
  look("look.metallic", "look: {metallic: $}", "0", "1");
  look("look.reflectance", "look: {reflectance: $}", "0.04", "0.4");
  look("look.body=translucent", "look: {body: $}", "opaque", "translucent");
  look("look.body=glass", "look: {body: $}", "opaque", "glass");
  look("look.index", "look: {body: glass, index: $}", "1.5", "2.4");
  look("look.depth", "look: {body: translucent, depth: $}", "0.01", "0.1");
  all.push_back(differs("objects.look.opacity", In::Picture,
                        {.object = "look: {opacity: $}", .scene = camera + "output: {images: {size: [48, 36], samples: 4}}\n"}, "1", "0.5"));
  look("look.texture.pattern=stripes", "look: {texture: {pattern: $, size: 0.07}}", "checker", "stripes");
  look("look.texture.pattern=picture", "look: {texture: {$}}", "pattern: checker", "pattern: picture, file: texture.png");
  look("look.texture.colour", "look: {texture: {pattern: checker, colour: $}}", "[1, 1, 1]", "[0, 0, 1]");
  look("look.texture.size", "look: {texture: {pattern: checker, size: $}}", "0.1", "0.05");
  look("look.texture.axis", "look: {texture: {pattern: stripes, axis: $}}", "[1, 0, 0]", "[0, 0, 1]");
  look("look.texture.file", "look: {texture: {pattern: picture, file: $}}", "texture.png", "more_texture.png");
  look("look.colour_by=stretch", "look: {$}", "colour_by: colour", "colour_by: stretch, range: [-0.1, 0.1]");
  look("look.colour_by=pressure", "look: {$}", "colour_by: colour", "colour_by: pressure, range: [0, 1]");
  look("look.colour_by=speed", "look: {$}", "colour_by: colour", "colour_by: speed, range: [0, 1]");
  look("look.colour_by=normals", "look: {colour_by: $}", "colour", "normals");
  for (const char* map : {"magma", "coolwarm", "turbo", "grey"}) {
    look("look.map=" + std::string(map), "look: {colour_by: speed, range: [0, 1], map: $}", "viridis", map);
  }
  look("look.range", "look: {colour_by: speed, range: $}", "[0, 1]", "[0, 2]");
  all.push_back(differs("objects.look.scale_bar", In::Picture,
                        {.object = "look: {colour_by: speed, range: [0, 1], scale_bar: $}",
                         .scene = camera + "output: {images: {size: [160, 120], samples: 1}}\n"}, "true", "false"));
  look("look.surface", "look: {surface: $}", "true", "false");
  look("look.wireframe", "look: {wireframe: $}", "false", "true");
  look("look.smooth", "look: {smooth: $}", "0", "0.4");
  look("look.frames", "look: {surface: false, frames: $}", "0", "0.2");
  look("look.bonds", "look: {surface: false, bonds: $}", "0", "0.05");
  const auto scene = [&](const std::string& key, const std::string& text, const std::string& one, const std::string& other) {
    all.push_back(differs(key, In::Picture, {.scene = text + "\n" + small}, one, other));
  };
  scene("obstacles.smooth_deg", "obstacles: [{name: block, shape: mesh, file: block.obj, at: [0.4, 0.3, 0], smooth_deg: $}]", "30", "120");
  const auto seen = [&](const std::string& key, const std::string& keys, const std::string& one, const std::string& other) {
    Parts parts{.scene = "camera: {" + keys + "}\n" + small};
    all.push_back(differs("camera." + key, In::Picture, parts, one, other));
    // The same of one among several, which are then drawn to files of their own names.
    parts.scene = "cameras: [{name: a, " + keys + "}]\n" + small;
    all.push_back(differs("cameras." + key, In::Picture, parts, one, other));
  };
  const std::string middle = "look_at: [0.4, 0, 0], ";
  seen("from", middle + "from: $", "[0, -2, 0]", "[0, -2, 1]");
  seen("up", middle + "up: $", "[0, 0, 1]", "[0.3, 0, 1]");
  seen("field_of_view_deg", middle + "field_of_view_deg: $", "30", "50");
  seen("turntable_deg", middle + "turntable_deg: $", "0", "90");
  const std::string key = "keys: [{time: 0, from: [0, -2, 0], look_at: [0, 0, 0]}, ";
  seen("keys.time", key + "{time: $, from: [1, -2, 0], look_at: [0, 0, 0]}]", "0.1", "0.2");
  seen("keys.from", key + "{time: 0.2, from: $, look_at: [0, 0, 0]}]", "[1, -2, 0]", "[1, -2, 1]");
  seen("keys.look_at", key + "{time: 0.2, from: [1, -2, 0], look_at: $}]", "[0, 0, 0]", "[0, 0, 0.5]");
  seen("keys.field_of_view_deg", key + "{time: 0.2, from: [1, -2, 0], look_at: [0, 0, 0], field_of_view_deg: $}]", "30", "60");
  all.push_back(differs("camera.look_at", In::Picture, {.scene = "camera: {look_at: $}\n" + small}, "[0.4, 0, 0]", "[0, 0, 0]"));
  all.push_back(differs("cameras.look_at", In::Picture, {.scene = "cameras: [{name: a, look_at: $}]\n" + small}, "[0.4, 0, 0]", "[0, 0, 0]"));
  all.push_back(differs("cameras.name", In::Files, {.scene = "cameras: [{name: $}]\n" + small}, "front", "above"));
  const std::string ground = "ground: {height: -0.2, collides: false}\n";
  scene("light.direction", ground + "light: {direction: $}", "[0, 0, -1]", "[1, 0, -1]");
  scene("light.intensity", ground + "light: {intensity: $}", "3", "1");
  scene("light.softness_deg", ground + camera + "light: {softness_deg: $}", "0", "10");
  const auto lamp = [&](const std::string& name, const std::string& keys, const std::string& one, const std::string& other) {
    scene("lights." + name, "lights: [{" + keys + "}]", one, other);
  };
  lamp("at", "at: $, facing: [0, 1, -1]", "[0, -1, 1]", "[0.5, -1, 1]");
  lamp("facing", "at: [0, -1, 1], facing: $", "[0, 1, -1]", "[0, 0, -1]");
  lamp("half_sizes", "at: [0, -1, 1], facing: [0, 1, -1], half_sizes: $", "[0.5, 0.5]", "[1, 0.5]");
  lamp("colour", "at: [0, -1, 1], facing: [0, 1, -1], colour: $", "[1, 1, 1]", "[1, 0, 0]");
  lamp("intensity", "at: [0, -1, 1], facing: [0, 1, -1], intensity: $", "5", "2");
  scene("background.top", "background: {top: $}", "[0, 0, 0]", "[1, 0, 0]");
  scene("background.bottom", "background: {bottom: $}", "[0, 0, 0]", "[1, 0, 0]");
  scene("ground.texture.pattern=stripes", "ground: {height: -0.2, collides: false, texture: {pattern: $}}", "checker", "stripes");
  scene("ground.texture.pattern=picture", "ground: {height: -0.2, collides: false, texture: {$}}", "pattern: checker", "pattern: picture, file: texture.png");
  scene("ground.texture.colour", "ground: {height: -0.2, collides: false, texture: {colour: $}}", "[1, 1, 1]", "[0, 0, 1]");
  scene("ground.texture.size", "ground: {height: -0.2, collides: false, texture: {size: $}}", "0.1", "0.25");
  scene("ground.texture.axis", "ground: {height: -0.2, collides: false, texture: {pattern: stripes, axis: $}}", "[1, 0, 0]", "[0, 1, 0]");
  scene("ground.texture.file", "ground: {height: -0.2, collides: false, texture: {pattern: picture, file: $}}", "texture.png", "more_texture.png");
  scene("ground.colour", "ground: {height: -0.2, collides: false, colour: $}", "[0.8, 0.8, 0.8]", "[0.1, 0.5, 0.1]");
  scene("ground.visible", "ground: {height: -0.2, collides: false, visible: $}", "true", "false");
  const auto obstacle = [&](const std::string& name, const std::string& keys, const std::string& one, const std::string& other) {
    scene("obstacles." + name, camera + "obstacles: [{name: block, shape: plane, at: [0, 0, -0.2], " + keys + "}]", one, other);
  };
  obstacle("extent", "extent: $", "0.3", "0.5");
  obstacle("colour", "colour: $", "[0.8, 0.8, 0.8]", "[0.1, 0.5, 0.1]");
  obstacle("roughness", "roughness: $", "0.6", "0.1");
  obstacle("visible", "visible: $", "true", "false");
  obstacle("texture.pattern=stripes", "texture: {pattern: $, size: 0.07}", "checker", "stripes");
  obstacle("texture.pattern=picture", "texture: {$}", "pattern: checker", "pattern: picture, file: texture.png");
  obstacle("texture.colour", "texture: {colour: $}", "[1, 1, 1]", "[0, 0, 1]");
  obstacle("texture.size", "texture: {size: $}", "0.1", "0.05");
  obstacle("texture.axis", "texture: {pattern: stripes, axis: $}", "[1, 0, 0]", "[0, 1, 0]");
  obstacle("texture.file", "texture: {pattern: picture, file: $}", "texture.png", "more_texture.png");
  scene("render.pixel_error", "render: {pixel_error: $}", "1", "0.05");
  if (!render::has_path_tracer()) return;
  const auto traced = [&](const std::string& name, const std::string& text, const std::string& one, const std::string& other) {
    scene(name, ground + text, one, other);
  };
  traced("render.renderer=path", camera + "render: {renderer: $}", "gl", "path");
  const auto path = [&](const std::string& name, const std::string& keys, const std::string& one, const std::string& other) {
    traced("render." + name, camera + "render: {renderer: path, " + keys + "}", one, other);
  };
  path("noise", "noise: $, denoise: false", "0.5", "0.02");
  path("most_samples", "noise: 0, denoise: false, most_samples: $", "4", "8");
  path("denoise", "noise: 0, most_samples: 4, denoise: $", "true", "false");
  path("exact_surface", "noise: 0, most_samples: 1, exact_surface: $", "true", "false");
  path("shutter", "noise: 0, most_samples: 4, shutter: $", "0", "1");
  for (const std::string several : {"camera", "cameras"}) {
    const auto lens = [&](const std::string& keys) {
      return several == "camera" ? "camera: {" + keys + "}\n" : "cameras: [{name: a, " + keys + "}]\n";
    };
    const std::string few = "render: {renderer: path, noise: 0, most_samples: 4}\n";
    traced(several + ".aperture", few + lens("from: [0.4, -1.2, 0.4], aperture: $"), "0", "0.1");
    traced(several + ".focus", few + lens("from: [0.4, -1.2, 0.4], aperture: 0.1, focus: $"), "auto", "0.5");
  }
}

void add_files(std::vector<Option>& all) {
  const auto file = [&](const std::string& key, const std::string& output, const std::string& one, const std::string& other) {
    all.push_back(differs("output." + key, In::Files, {.object = "contact: {modulus: 1000}", .scene = "ground: {height: -0.1}\noutput: {" + output + "}", .timing = "duration: 0.1\nframe_rate: 20\n"}, one, other));
  };
  file("images.size", "images: {size: $, samples: 1}", "[48, 36]", "[36, 36]");
  file("images.samples", "images: {size: [48, 36], samples: $}", "1", "4");
  for (const char* formats : {"exr", "[png, exr]"}) {
    file("images.formats=" + std::string(formats == std::string("exr") ? "exr" : "png"), "images: {size: [48, 36], samples: 1, formats: $}",
         formats == std::string("exr") ? "png" : "exr", formats);
  }
  file("film", "images: {size: [48, 36], samples: 1}, film: $", "false", "true");
  file("film.frame_rate", "images: {size: [48, 36], samples: 1}, film: {frame_rate: $}", "auto", "5");
  for (const char* what : {"contacts", "particles", "samples"}) {
    for (const char* format : {"csv", "vtk"}) file(what + std::string("=") + format, std::string(what) + ": $", "none", format);
  }
  for (const char* format : {"ply", "obj", "usd"}) file("mesh=" + std::string(format), "cell: 0.1, mesh: $", "none", format);
  file("grid=vdb", "cell: 0.1, grid: $", "none", "vdb");
  all.push_back(differs("output.meshing.search", In::Files,
                        {.skeleton = "{shape: point, kernel: {radius: 0.08}}",
                         .scene = "output: {cell: 0.1, mesh: ply, meshing: {search: $}}", .timing = "duration: 0.1\nframe_rate: 20\n"},
                        "false", "true"));
  all.push_back(differs("output.meshing.search=auto", In::Files,
                        {.skeleton = "{shape: point, kernel: {radius: 0.08}}",
                         .scene = "output: {cell: 0.1, mesh: ply, meshing: {search: $}}", .timing = "duration: 0.1\nframe_rate: 20\n"},
                        "false", "auto"));
  file("meshing.motion", "cell: 0.1, mesh: ply, meshing: {motion: $}", "false", "true");
  for (const char* of : {"scene", "both"}) file("gridding.of=" + std::string(of), "cell: 0.1, grid: vdb, gridding: {of: $}", "objects", of);
  file("gridding.content=field", "cell: 0.1, grid: vdb, gridding: {content: $}", "distance", "field");
  file("sampling.spacing", "samples: csv, sampling: {spacing: $}", "auto", "0.05");
  file("sampling.density", "samples: csv, sampling: {density: $}", "200", "400");
  file("gridding.half_width", "cell: 0.1, grid: vdb, gridding: {half_width: $}", "3", "5");
}

std::vector<Option> all_options() {
  std::vector<Option> all;
  add_motion(all);
  add_arrangements(all);
  add_laws(all);
  add_object_rules(all);
  add_surfaces(all);
  add_contact(all);
  add_pictures(all);
  add_files(all);
  return all;
}

class Options : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = temp_folder() / "options";
    fs::create_directories(folder());
    const auto write = [](const char* name, const std::string& text) { std::ofstream(folder() / name) << text; };
    write("points.csv", "x,y,z\n0,0,0\n0.2,0,0\n");
    write("more_points.csv", "x,y,z\n0,0,0\n0.2,0,0.1\n");
    for (const bool more : {false, true}) {
      std::string heights = "x,y,z\n";
      for (int i = -5; i <= 5; ++i) {
        for (int j = -5; j <= 5; ++j) {
          heights += std::to_string(0.2 * i) + "," + std::to_string(0.2 * j) + "," + std::to_string((more ? 0.02 : 0.01) * std::cos(0.4 * i)) + "\n";
        }
      }
      write(more ? "more_heights.csv" : "heights.csv", heights);
      write("block.obj", "v -0.5 -0.5 -0.1\nv 0.5 -0.5 -0.1\nv -0.5 0.5 -0.1\nv 0.5 0.5 -0.1\nv -0.5 -0.5 0.1\nv 0.5 -0.5 0.1\n"
                         "v -0.5 0.5 0.1\nv 0.5 0.5 0.1\nf 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
      render::Image picture{.width = 4, .height = 4, .pixels = std::vector<std::uint8_t>(48)};
      for (std::size_t k = 0; k < picture.pixels.size(); ++k) picture.pixels[k] = static_cast<std::uint8_t>((more ? 90 : 40) * (k % 3));
      render::write_png(folder() / (more ? "more_texture.png" : "texture.png"), picture);
    }
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }

  static SimulationOptions options() {
    SimulationOptions options{.threads = 1};
#ifdef SUPPLE_HAS_CGAL
    options.delaunay = cgal::delaunay_mesh;
#endif
    return options;
  }

  /// A number for what `in` names of a scene after two frames; a refusal is given as its message.
  static std::uint64_t outcome(const Parts& parts, In in) {
    const Scene scene = parse_scene(text_of(parts), "option.yaml", folder());
    Hasher hasher;
    try {
      if (in == In::State || in == In::Surface) {
        Simulation simulation(scene, options());
        while (simulation.frame() < 3) simulation.step_frame();
        if (in == In::State) return simulation.state_hash();
        for (const Mesh& mesh : simulation.meshes()) {
          for (const Vec3& x : mesh.position) hasher.add(std::span(&x, 1));
          hasher.add(std::uint64_t{mesh.triangle_count()});
        }
        return hasher.value();
      }
      const fs::path out = folder() / "out";
      fs::remove_all(out);
      const std::set<int> frames = in == In::Picture ? std::set<int>{3} : std::set<int>{};
      const RunResult done = run_scene(scene, {.folder = out, .frames = frames, .threads = 1, .delaunay = options().delaunay});
      EXPECT_EQ(done.outcome, "done") << done.reason;
      std::vector<fs::path> files;
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(out)) {
        if (entry.is_regular_file() && entry.path().filename() != "result.json" && entry.path().extension() != ".state") files.push_back(entry.path());
      }
      std::sort(files.begin(), files.end());
      for (const fs::path& file : files) {
        if (file.extension() == ".png") {  // its text names the scene
          const render::Image image = render::read_png(file);
          hasher.add(std::string_view(reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size()));
        } else if (in == In::Files) {
          hasher.add(std::uint64_t{fs::file_size(file)});
        }
        if (in == In::Files) hasher.add(fs::relative(file, out).string());
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Limit) throw;
      hasher.add(error.what());
    }
    return hasher.value();
  }

  /// That every option which `in` shows makes a difference.
  static void each_differs(In in) {
    std::map<std::string, std::uint64_t> known;
    const auto outcome_of = [&](const Parts& parts) {
      const auto [at, is_new] = known.try_emplace(text_of(parts));
      if (is_new) at->second = outcome(parts, in);
      return at->second;
    };
    for (const Option& option : all_options()) {
      if (option.in != in) continue;
      SCOPED_TRACE(option.key);
      try {
        EXPECT_NE(outcome_of(option.one), outcome_of(option.other)) << text_of(option.other);
      } catch (const Error& error) {
        ADD_FAILURE() << error.what() << '\n' << text_of(option.other);
      }
    }
  }
};

TEST_F(Options, ChangeTheMotion) { each_differs(In::State); }
TEST_F(Options, ChangeTheSurfaces) { each_differs(In::Surface); }
TEST_F(Options, ChangeThePictures) { each_differs(In::Picture); }
TEST_F(Options, ChangeTheFiles) { each_differs(In::Files); }

/// Calls use(path, choices) for all keys that hold no keys of their own.
template <class Use>
void walk(const nlohmann::json& node, const std::string& path, const Use& use) {
  for (const char* several : {"anyOf", "oneOf"}) {
    if (node.contains(several)) for (const auto& one : node[several]) walk(one, path, use);
  }
  if (node.contains("items") && node["items"].is_object()) walk(node["items"], path, use);
  if (node.contains("properties")) {
    for (const auto& [key, child] : node["properties"].items()) walk(child, path.empty() ? key : path + "." + key, use);
    return;
  }
  std::vector<std::string> choices;
  if (node.contains("enum")) for (const auto& choice : node["enum"]) if (choice.is_string()) choices.push_back(choice);
  use(path, choices);
}

TEST_F(Options, AreAllTried) {
  // One number that is always 1, names, and the name that a single camera has not.
  const std::set<std::string> exempt = {"schema", "title", "objects.name", "obstacles.name", "camera.name", "include", "variables", "defaults", "materials"};
  std::set<std::string> tried;
  for (const Option& option : all_options()) {
    tried.insert(option.key);
    tried.insert(option.key.substr(0, option.key.find('=')));
  }
  std::map<std::string, std::set<std::string>> untried;
  std::set<std::string> holders;
  walk(nlohmann::json::parse(scene_json_schema()), "", [&](const std::string& read, const std::vector<std::string>& choices) {
    // Skeletons of obstacles are read as those of objects are.
    const std::string path = read.starts_with("obstacles.skeleton.") ? "objects" + read.substr(read.find('.')) : read;
    // What is written out before keys are read has tests of its own (expand_scene_test.cpp, events_test.cpp).
    if (path.empty() || exempt.contains(path) || path.ends_with(".repeat") || path.ends_with(".include") || path == "objects.emit") return;
    for (const char* key : {"render.", "aperture", "focus"}) {
      if (!render::has_path_tracer() && path.find(key) != std::string::npos) return;
    }
#ifndef SUPPLE_HAS_CGAL
    if (path.starts_with("output.meshing.")) return;
#endif
    const bool known = std::any_of(tried.begin(), tried.end(), [&](const std::string& key) { return key == path || key.starts_with(path + "."); });
    EXPECT_TRUE(known) << path << " is in no line of this file";
    for (const std::string& choice : choices) {
      if (!tried.contains(path + "=" + choice)) untried[path].insert(choice);
    }
  });
  // One choice of each key is what the others differ from.
  for (const auto& [path, choices] : untried) {
    EXPECT_LE(choices.size(), 1u) << path << ": " << *choices.begin() << ", " << *choices.rbegin() << " are in no line of this file";
  }
}

}  // namespace
}  // namespace supple::scenes
