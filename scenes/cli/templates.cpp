#include "templates.h"

#include <array>
#include <filesystem>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/nearest_word.h"

namespace supple::tool {
namespace {

constexpr std::string_view kTitle = "@TITLE@";

constexpr std::array kTemplates{
    Template{"ball", "a soft ball falls on the ground", R"(# A soft ball falls on the ground and bounces. `supple reference` lists every key.
schema: 1
title: @TITLE@
duration: 2 s
frame_rate: 24
gravity: [0, 0, -9.81]
variables: {r: 20 cm}                  # used below as ${r}; change it here or by --set variables.r=30cm

objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, "${5*r}"], velocity: [0.3, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: "${2*r}"}}]
    contact: {modulus: 10 kPa, friction: 0.4, dissipation: 0.2}
    colour: [0.85, 0.35, 0.15]

camera: {from: [1.6, -2.4, 1], look_at: [0.3, 0, 0.45], field_of_view_deg: 34}
ground: {height: 0, friction: 0.4}
output: {images: {size: [640, 480]}, film: true}
)"},
    Template{"balls", "a row of balls of growing size falls on the ground", R"(# Balls of growing size fall on the ground: `repeat` writes one object several times.
schema: 1
title: @TITLE@
duration: 2 s
frame_rate: 24
gravity: [0, 0, -9.81]
variables: {n: 5}
defaults:
  objects: {contact: {modulus: 10 kPa, friction: 0.4, dissipation: 0.3}}

objects:
  - repeat: {i: "${n}"}
    name: ball${i}
    particles: {arrange: single, at: ["${0.3*(i - (n - 1)/2)}", 0, "${0.5 + 0.15*i}"], mass: "${0.05*(1 + i)}"}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: "${0.12 + 0.02*i}"}}]
    colour: ["${0.9 - 0.12*i}", 0.4, "${0.2 + 0.12*i}"]

camera: {from: [0.8, -2.0, 0.9], look_at: [0, 0, 0.35], field_of_view_deg: 36}
ground: {height: 0, friction: 0.4}
output: {images: {size: [640, 480]}, film: true}
)"},
    Template{"chain", "a chain hangs from its first particle and swings", R"(# A chain hangs from its first particle and swings.
schema: 1
title: @TITLE@
duration: 3 s
frame_rate: 24
gravity: [0, 0, -9.81]

objects:
  - name: chain
    particles: {arrange: line, count: 12, spacing: 8 cm, at: [0.44, 0, 1.3], mass: 0.02}
    interactions:
      - {law: bond_frame, within: 0.09, stretch: 400, rotation: 0.02}
      - {law: friction, within: 0.09, linear: 0.05, angular: 0.0002}
    pins: [{particle: 0, orientation: false}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 9 cm}}]
    colour: [0.25, 0.5, 0.75]

camera: {from: [0.4, -3.6, 1], look_at: [0, 0, 0.75], field_of_view_deg: 34}
ground: {height: 0}
output: {images: {size: [640, 480]}, film: true}
)"},
    Template{"jelly", "a jelly cube falls on a step", R"(# A jelly cube of 27 particles falls on the edge of a step.
schema: 1
title: @TITLE@
duration: 1.5 s
frame_rate: 24
gravity: [0, 0, -9.81]

objects:
  - name: jelly
    particles: {arrange: grid, columns: 3, rows: 3, layers: 3, spacing: 6 cm, at: [0.05, 0, 0.5], axis: [0.3, 0.1, 1], mass: 0.02}
    interactions:
      - {law: bond_frame, within: 0.11, stretch: 60, rotation: 0.03}
      - {law: friction, within: 0.11, linear: 0.08, angular: 0.001}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 5 kPa, friction: 0.4, dissipation: 0.5}
    colour: [0.80, 0.10, 0.15]
    roughness: 0.15

obstacles:
  - {name: step, shape: box, at: [-0.15, 0, 0.1], half_sizes: [0.2, 0.4, 0.1], rounding: 1 cm, friction: 0.4}

camera: {from: [1.7, -2, 1], look_at: [0.2, 0, 0.15], field_of_view_deg: 32}
ground: {height: 0, friction: 0.4}
output: {images: {size: [640, 480]}, film: true}
)"},
    Template{"sheet", "a sheet that is held at its corners is pressed in the middle", R"(# A sheet that is held at its corners is pressed in the middle and takes its shape back.
schema: 1
title: @TITLE@
duration: 3 s
frame_rate: 24

objects:
  - name: sheet
    particles: {arrange: grid, columns: 7, rows: 7, spacing: 0.12, mass: 10 g}
    interactions:
      - {law: bond_frame, within: 0.18, stretch: 30, rotation: 0.1}   # edges and diagonals
      - {law: friction, within: 0.18, linear: 0.1, angular: 0.0005}
    medium: {linear: 1, angular: 1}
    pins: [{particle: 0}, {particle: 6}, {particle: 42}, {particle: -1}]
    loads:
      - {particle: 24, force: [0, 0, -6], until: 0.75, ramp: 0.25}
    skeleton: [{shape: square, half_size: 0.06, kernel: {type: wyvill, radius: 0.08}}]
    colour: [0.3, 0.55, 0.75]

camera: {from: [0.9, -1.7, 0.8], look_at: [0, 0, -0.05], field_of_view_deg: 34}
output: {images: {size: [640, 480]}, film: true}
)"},
};

}  // namespace

std::span<const Template> templates() { return kTemplates; }

std::string write_new_scene(const std::string& name, const std::string& from) {
  const auto usage = [](std::string expected, std::string found, std::string hint) {
    return Error(ErrorKind::Usage, Fault{.place = "supple new", .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
  };
  const Template* chosen = nullptr;
  std::vector<std::string_view> names;
  std::string all;
  for (const Template& one : kTemplates) {
    if (one.name == from) chosen = &one;
    names.push_back(one.name);
    all += (all.empty() ? "" : ", ") + std::string(one.name);
  }
  if (chosen == nullptr) {
    const std::string near = nearest_word(from, names);
    throw usage("expected a template", '\'' + from + '\'', near.empty() ? "known: " + all : "did you mean '" + near + "'?");
  }
  std::filesystem::path path = name;
  if (path.extension() != ".yaml") path += ".yaml";
  const std::string stem = path.stem().string();
  const bool plain = !stem.empty() && stem.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_- ") == std::string::npos;
  if (!plain) throw usage("expected a name of letters, digits, blanks, - and _", '\'' + stem + '\'', "");
  if (std::filesystem::exists(std::filesystem::symlink_status(path))) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(), .key = {}, .expected = "expected a new file", .found = "one that exists", .hint = "choose another name"});
  }
  std::string text(chosen->text);
  text.replace(text.find(kTitle), kTitle.size(), '"' + stem + '"');
  io::write_atomically(path, text);
  return path.string();
}

}  // namespace supple::tool
