/// @file fields_rules.h
/// Rules for the value of a key: quantity, range, and the kinds for which it has a meaning. The reader checks these
/// rules; the reference page and the JSON schema print them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "file/yaml/yaml_quantity.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Names of an enum's values in files, in the order of the enumerators (which count from 0).
template <class E>
struct EnumNames;
template <> struct EnumNames<MethodName> {
  static constexpr std::array<std::string_view, 7> names{"auto",     "symplectic",     "rk4",              "adaptive",
                                                         "backward_euler", "implicit_midpoint", "implicit"};
};
template <> struct EnumNames<RotationName> {
  static constexpr std::array<std::string_view, 2> names{"splitting", "exponential"};
};
template <> struct EnumNames<ArrangeKind> {
  static constexpr std::array<std::string_view, 13> names{"single", "line", "ring", "grid", "spiral", "file", "geodesic",
                                                          "ball",   "tube", "curve", "scatter", "fill", "points"};
};
template <> struct EnumNames<NormalKind> {
  static constexpr std::array<std::string_view, 2> names{"axis", "radial"};
};
template <> struct EnumNames<LawKind> {
  static constexpr std::array<std::string_view, 13> names{
      "cohesion",    "linear_cohesion", "directed_cohesion", "lennard_jones", "gay_berne",      "form", "form_radius",
      "directed_form", "bond_frame",    "coplanarity",       "co_normality",  "co_circularity", "friction"};
};
template <> struct EnumNames<ShapeName> {
  static constexpr std::array<std::string_view, 14> names{"point",     "segment",  "square",  "rectangle", "disc",
                                                          "box",       "ellipsoid", "triangle", "polygon",  "ring",
                                                          "arc",       "curve",    "superquadric", "directed"};
};
template <> struct EnumNames<ObstacleName> {
  static constexpr std::array<std::string_view, 5> names{"plane", "box", "heights", "mesh", "implicit"};
};
template <> struct EnumNames<LeadName> {
  static constexpr std::array<std::string_view, 2> names{"smooth", "linear"};
};
template <> struct EnumNames<KernelName> {
  static constexpr std::array<std::string_view, 8> names{"wyvill",    "gascuel", "soft_object", "murakami",
                                                         "nishimura", "blinn",   "cauchy",      "blanc_schlick"};
};
template <> struct EnumNames<VolumeOfName> {
  static constexpr std::array<std::string_view, 3> names{"object", "particle", "primitive"};
};
template <> struct EnumNames<BlendName> {
  static constexpr std::array<std::string_view, 4> names{"sum", "graph", "ricci", "gradient"};
};
template <> struct EnumNames<SplitName> {
  static constexpr std::array<std::string_view, 2> names{"energy", "contribution"};
};
template <> struct EnumNames<RuleName> {
  static constexpr std::array<std::string_view, 4> names{"auto", "polar", "march", "panels"};
};
template <> struct EnumNames<CoreName> {
  static constexpr std::array<std::string_view, 2> names{"soft", "barrier"};
};
template <> struct EnumNames<RendererName> {
  static constexpr std::array<std::string_view, 2> names{"gl", "path"};
};
template <> struct EnumNames<BodyName> {
  static constexpr std::array<std::string_view, 3> names = {"opaque", "translucent", "glass"};
};
template <> struct EnumNames<PatternName> {
  static constexpr std::array<std::string_view, 3> names{"checker", "stripes", "picture"};
};
template <> struct EnumNames<ColourByName> {
  static constexpr std::array<std::string_view, 5> names{"colour", "pressure", "stretch", "speed", "normals"};
};
template <> struct EnumNames<MapName> {
  static constexpr std::array<std::string_view, 5> names{"viridis", "magma", "coolwarm", "turbo", "grey"};
};
template <> struct EnumNames<ImageName> {
  static constexpr std::array<std::string_view, 2> names{"png", "exr"};
};
template <> struct EnumNames<TableName> {
  static constexpr std::array<std::string_view, 2> names{"csv", "vtk"};
};
template <> struct EnumNames<MeshName> {
  static constexpr std::array<std::string_view, 3> names{"ply", "obj", "usd"};
};
template <> struct EnumNames<MeshingName> {
  static constexpr std::array<std::string_view, 5> names{"auto", "cubes", "tetrahedra", "delaunay", "openvdb"};
};
template <> struct EnumNames<GriddedName> {
  static constexpr std::array<std::string_view, 3> names{"objects", "scene", "both"};
};
template <> struct EnumNames<GridContentName> {
  static constexpr std::array<std::string_view, 2> names{"distance", "field"};
};
template <> struct EnumNames<GridName> {
  static constexpr std::array<std::string_view, 1> names{"vdb"};
};

template <class E>
[[nodiscard]] constexpr std::string_view name_of(E value) {
  return EnumNames<E>::names[static_cast<std::size_t>(value)];
}

/// The choices of another key for which a key has a meaning; empty: always.
struct When {
  std::string_view selector;
  std::string_view current;
  std::vector<std::string_view> choices;
  [[nodiscard]] bool applies() const {
    if (choices.empty()) return true;
    for (const std::string_view choice : choices) {
      if (choice == current) return true;
    }
    return false;
  }
};

struct Rule {
  Quantity quantity = kNumber;
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;
  bool high_open = false;
  bool degrees = false;    ///< written in degrees, kept in radians
  bool automatic = false;  ///< `auto` is the same as leaving the key out
  bool direction = false;  ///< a vector that must not vanish
  bool name = false;       ///< text that must be an identifier
  bool file = false;       ///< text that must name a file inside the scene's folder
  std::size_t least_items = 0;
  std::size_t most_items = std::numeric_limits<std::size_t>::max();
  When when = {};

  [[nodiscard]] Rule or_auto() const {
    Rule rule = *this;
    rule.automatic = true;
    return rule;
  }
  [[nodiscard]] Rule items(std::size_t least, std::size_t most) const {
    Rule rule = *this;
    rule.least_items = least;
    rule.most_items = most;
    return rule;
  }
  /// Only with these values of the key `selector`, which is read before this one.
  template <class E>
  [[nodiscard]] Rule only(std::string_view selector, E current, std::initializer_list<E> choices) const {
    Rule rule = *this;
    rule.when = {selector, name_of(current), {}};
    for (const E choice : choices) rule.when.choices.push_back(name_of(choice));
    return rule;
  }
  [[nodiscard]] bool holds(double value) const {
    return (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
  }
};

[[nodiscard]] inline Rule any(const Quantity& quantity) { return {.quantity = quantity}; }
[[nodiscard]] inline Rule above(double low, const Quantity& quantity) {
  return {.quantity = quantity, .low = low, .low_open = true};
}
[[nodiscard]] inline Rule at_least(double low, const Quantity& quantity) { return {.quantity = quantity, .low = low}; }
[[nodiscard]] inline Rule between(double low, double high, const Quantity& quantity) {
  return {.quantity = quantity, .low = low, .high = high};
}
[[nodiscard]] inline Rule inside(double low, double high, const Quantity& quantity) {
  return {.quantity = quantity, .low = low, .high = high, .low_open = true, .high_open = true};
}
/// In (0, high].
[[nodiscard]] inline Rule up_to(double high, const Quantity& quantity) {
  return {.quantity = quantity, .low = 0.0, .high = high, .low_open = true};
}
[[nodiscard]] inline Rule degrees(double low, double high) {
  return {.quantity = kAngle, .low = low, .high = high, .degrees = true};
}
[[nodiscard]] inline Rule direction() { return {.direction = true}; }
[[nodiscard]] inline Rule identifier() { return {.name = true}; }
[[nodiscard]] inline Rule file_name() { return {.file = true}; }

/// "a length > 0 [m]", "a number in [0, 1]", "a whole number >= 1"
[[nodiscard]] std::string rule_text(const Rule& rule, bool whole);

}  // namespace supple::scenes
