/// @file fields_particles.h
/// The keys of the particles of an object; see fields.h.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <numbers>
#include <optional>
#include <string>

#include "file/expand/course.h"
#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"

namespace supple::scenes {

inline constexpr double kMostCount = 1e6;

/// Checks that a list is empty or has an item for each of something.
template <class Archive>
void check_length(Archive& archive, const char* key, std::size_t found, std::size_t wanted, const std::string& what) {
  archive.check(!archive.sound(key) || found == 0 || found == wanted, key, "expected " + what + ": " + std::to_string(wanted), std::to_string(found), "");
}

/// Checks that bonds join two particles each, and the lists beside them.
template <class Archive>
void check_bonds(Archive& archive, const ParticlesDesc& d) {
  if (!archive.sound("points") || !archive.sound("bonds")) return;
  check_length(archive, "sections", d.sections.size(), d.bonds.size() / 2, "one for each bond");
  check_length(archive, "normals", d.normals.size(), d.points.size(), "one for each particle");
  check_length(archive, "directions", d.directions.size(), d.normals.size(), "one for each normal");
  check_length(archive, "curvatures", d.curvatures.size(), 2 * d.normals.size(), "two for each normal");
  archive.check(d.normals.empty() || (!d.directions.empty() && !d.curvatures.empty() && !d.sections.empty() && d.thickness > 0.0), "normals",
                "expected 'directions', 'curvatures', 'thickness' and 'sections' beside them", "less", "");
  archive.check(d.bonds.size() % 2 == 0, "bonds", "expected an even number of particles, two for each bond", std::to_string(d.bonds.size()), "");
  for (std::size_t k = 0; k < d.bonds.size(); ++k) {
    const std::string key = "bonds[" + std::to_string(k) + ']';
    archive.check(d.bonds[k] < static_cast<int>(d.points.size()), key, "expected a whole number from 0 to " + std::to_string(d.points.size() - 1), std::to_string(d.bonds[k]), "");
    archive.check(k % 2 == 0 || d.bonds[k] != d.bonds[k - 1], key, "expected a bond between two particles", "one twice", "");
  }
}

template <class Archive>
void fields(Archive& archive, ParticlesDesc& d) {
  using enum ArrangeKind;
  const auto only = [&d](const Rule& rule, std::initializer_list<ArrangeKind> kinds) {
    return rule.only("arrange", d.arrange, kinds);
  };
  archive("arrange", d.arrange, {}, "arrangement of the particles; line, ring, grid and spiral lie in the x-y plane");
  archive.required("count", d.count, only(between(1.0, kMostCount, kNumber), {Line, Ring, Spiral, Curve, Scatter}), "number of particles");
  archive.required("radius", d.radius, only(above(0.0, kLength), {Ring, Geodesic, Ball, Tube}), "radius of the circle, sphere, ball or tube; a ball holds the particles whose centres are within it");
  archive.required("frequency", d.frequency, only(between(1.0, 300.0, kNumber), {Geodesic}),
                   "parts of each edge of an icosahedron; 10 frequency^2 + 2 particles");
  archive.required("inner_radius", d.inner_radius, only(at_least(0.0, kLength), {Spiral}), "where the spiral begins");
  archive.required("outer_radius", d.outer_radius, only(above(0.0, kLength), {Spiral}), "where the spiral ends");
  archive("turns", d.turns, only(up_to(1000.0, kNumber), {Spiral}), "number of turns");
  archive.required("spacing", d.spacing, only(above(0.0, kLength), {Line, Grid, Ball, Tube, Scatter, Fill}), "distance between neighbours; scatter: the least distance; ball and fill: of a cubic lattice");
  archive.required("columns", d.columns, only(between(1.0, 1e4, kNumber), {Grid}), "number along x");
  archive.required("rows", d.rows, only(between(1.0, 1e4, kNumber), {Grid}), "number along y");
  archive("layers", d.layers, only(between(1.0, 1e4, kNumber), {Grid}), "number along z");
  archive.required("length", d.length, only(above(0.0, kLength), {Tube}), "length of the tube along z, about its middle; its particles lie on rings");
  archive.required("points", d.points, only(any(kLength).items(2, 10000), {Curve}), "points through which a smooth curve passes (Catmull-Rom); particles lie on it at equal distances, their x along it");
  archive.required("points", d.points, only(any(kLength).items(1, 10000), {Points}), "places of the particles");
  archive("bonds", d.bonds, only(between(0.0, kMostCount, kNumber), {Points}), "numbers of particles, from 0, that a material joins: the first to the second, the third to the fourth and so on");
  archive("sections", d.sections, only(above(0.0, kArea), {Points}), "area of the section of each bond, as `supple fit` finds them; absent: all equal");
  archive("normals", d.normals, only(direction(), {Points}), "of a shell: one for each particle, outward; absent: the particles fill a solid");
  archive("directions", d.directions, only(direction(), {Points}), "of a shell: x of each particle's frame, in which its first principal curvature is measured");
  archive("thickness", d.thickness, only(above(0.0, kLength), {Points}), "of a shell, from which it bends");
  archive("curvatures", d.curvatures, only(any(kSlope), {Points}), "of a shell: both principal curvatures of each particle one after the other, > 0 where it bulges along the normal; they are the rest shape of directed_form");
  archive.required("size", d.size, only(above(0.0, kLength), {Scatter}), "edges of the box, about its middle, in which particles lie at random");
  archive("seed", d.seed, only(between(0.0, 1e9, kNumber), {Scatter}), "another seed gives other places");
  archive.required("file", d.file, only(file_name(), {File, Fill}),
                   "relative to the scene's folder. file: particles as CSV of x, y, z [m], or as CSV with a line of names or PLY with columns of these names: x, y, z; nx, ny, nz (normal); radius (of inertia) [m]; mass [kg]; qw, qx, qy, qz (orientation); vx, vy, vz [m/s]. fill: closed mesh, OBJ or PLY [m], whose inside is filled with particles");
  archive("normal", d.normal, only({}, {Ring, Spiral}), "direction of the particle normals: along the axis, or outward from the curve");
  archive("own_normal", d.own_normal, direction(), "direction of the normal in each particle's frame, where a file gives none");
  archive("disorder", d.disorder, at_least(0.0, kLength), "each particle is moved at random by at most this, the same in every run");
  archive("at", d.at, any(kLength), "position of the origin of the arrangement");
  archive("axis", d.axis, direction(), "direction of the z axis of the arrangement");
  archive("angle_deg", d.angle, degrees(-360.0, 360.0), "rotation of the arrangement about its own z axis, before the others");
  archive("velocity", d.velocity, any(kSpeed), "initial velocity");
  archive("spin", d.spin, any(kSpin), "initial angular velocity of the whole about its centre of mass");
  archive("mass", d.mass, above(0.0, kMass).or_auto(), "mass of one particle; auto: 1 kg, or by the object's 'material'");
  archive("inertia_radius", d.inertia_radius, above(0.0, kLength).or_auto(),
          "a in the moment of inertia 2/5 m a^2; auto: half the distance to the nearest neighbour. Single particles, and those of an object with `separate`, have the moments of the solid that each carries instead, and their frames are turned to its principal axes");
  archive("inertia_axes", d.inertia_axes, at_least(0.0, kLength),
          "instead of inertia_radius: semi-axes of a solid ellipsoid in each particle's frame; zero: not given");
  if (archive.given("inertia_axes")) {
    archive.check(d.inertia_axes.minCoeff() > 0.0, "inertia_axes", "expected three lengths > 0 [m]", "a zero", "");
    archive.check(!d.inertia_radius, "inertia_axes", "expected either inertia_radius or inertia_axes", "both", "");
  }
  if (d.arrange == Spiral) {
    archive.check(d.count >= 2, "count", "expected a whole number >= 2 for a spiral", std::to_string(d.count), "");
    archive.check(d.inner_radius < d.outer_radius, "outer_radius",
                  "expected more than inner_radius = " + number_text(d.inner_radius) + " [m]", number_text(d.outer_radius),
                  "");
  }
  if (d.spacing > 0.0 && (d.arrange == Ball || d.arrange == Tube)) {
    const double across = 2.0 * d.radius / d.spacing;
    const double all = std::numbers::pi * (d.arrange == Ball ? across * across * across / 6.0 : across * (d.length / d.spacing + 1.0));
    archive.check(all <= kMostCount, "spacing", "expected at most 1000000 particles", "about " + short_text(all), "enlarge it");
  }
  if (d.spacing > 0.0 && d.arrange == Scatter) {
    constexpr double kMostScattered = 1e5, kMostFilled = 0.3;  // random places for more become rare
    const double filled = d.count * std::numbers::pi / 6.0 * d.spacing * d.spacing * d.spacing / (d.size + Vec3::Constant(d.spacing)).prod();
    archive.check(d.count <= kMostScattered, "count", "expected at most 100000 scattered particles", std::to_string(d.count), "");
    archive.check(filled <= kMostFilled, "count", "expected balls of diameter 'spacing' to fill at most 0.3 of the box", short_text(filled) + " of it",
                  "reduce 'count' or 'spacing', or enlarge 'size'");
  }
  if (d.arrange == Points) check_bonds(archive, d);
  if (d.arrange == Curve) archive.check(d.count >= 2, "count", "expected a whole number >= 2 for a curve", std::to_string(d.count), "");
  if (d.arrange == Grid) {
    const double all = double(d.columns) * d.rows * d.layers;
    archive.check(all <= kMostCount, d.layers > 1 ? "layers" : "rows", "expected at most 1000000 particles", number_text(all), "");
  }
}

template <class Archive>
void fields(Archive& archive, KindDesc& d) {
  archive("hinge", d.hinge, {}, "a hinge has interactions with particles of all types");
  archive("type", d.type, between(0.0, kMostCount, kNumber), "of standard particles; particles of different types have repulsion only");
  archive.required("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
                   "numbers of the particles: from 0, negative from the end");
  archive.check(!(d.hinge && archive.given("type")), "type", "expected either hinge or type", "both", "");
}

template <class Archive>
void fields(Archive& archive, CourseKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "time of the value");
  archive.required("factor", d.factor, any(kNumber), "value at that time");
}

template <class Archive>
void fields(Archive& archive, CourseDesc& d) {
  archive("expression", d.expression, {}, "of the time t: \"sin(2*pi*t/(1 s))\", with the functions of ${expressions}; taken at a 64th of a frame, linear in between");
  archive("keys", d.keys, {}, "instead: values at rising times, linear in between, constant before and after");
  archive.check(d.expression.empty() != d.keys.empty(), "", "expected either expression or keys", d.keys.empty() ? "neither" : "both", "");
  for (std::size_t k = 1; k < d.keys.size(); ++k) {
    archive.check(d.keys[k].time > d.keys[k - 1].time, "keys[" + std::to_string(k) + "].time", "expected a time after that of the key before", number_text(d.keys[k].time), "");
  }
  if (d.expression.empty()) return;
  if (const auto fault = fault_of_course(d.expression)) archive.check(false, "expression", fault->expected, fault->found, fault->hint);
}

template <class Archive>
void fields(Archive& archive, WindDesc& d) {
  archive.required("velocity", d.velocity, any(kSpeed), "velocity of the medium");
  archive("course", d.course, {}, "a factor of the velocity as a function of time; absent: 1");
}

template <class Archive>
void fields(Archive& archive, CutDesc& d) {
  archive.required("time", d.time, above(0.0, kTime), "when the bonds break: at the end of the step that reaches it");
  archive("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount}, "all bonds between two of these; negative numbers count from the end");
  archive("at", d.at, any(kLength), "instead: all bonds that cross a plane at the start; a point of it");
  archive("normal", d.normal, direction(), "of that plane");
  archive.check(d.particles.empty() == d.at.has_value(), "", "expected either particles or at", d.at ? "both" : "neither", "");
}

template <class Archive>
void fields(Archive& archive, PinKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "time at which the particle is there");
  archive("by", d.by, any(kLength), "away from its place at the start");
  archive("turn_deg", d.turn, degrees(-36000.0, 36000.0), "rotation about turn_axis");
}

template <class Archive>
void fields(Archive& archive, PinMotionDesc& d) {
  archive("keys", d.keys, {}, "places at rising times; the particle leaves its place at the start at time 0, and is at rest after the last key");
  archive("between", d.between, {}, "interpolation of keys; smooth: the speed is zero where the motion turns back, so the particle never passes beyond a key");
  archive("turn_axis", d.turn_axis, direction(), "axis of turn_deg, through the particle");
  archive("x", d.x, {}, "instead of keys: way along x, an expression of the time t: \"5 cm*sin(2*pi*t/(1 s))\", 0 at t = 0; taken at a 64th of a frame, linear in between; absent: 0");
  archive("y", d.y, {}, "the same along y");
  archive("z", d.z, {}, "the same along z");
  const bool formula = !(d.x.empty() && d.y.empty() && d.z.empty());
  archive.check(formula == d.keys.empty(), "", "expected either keys or x, y, z", formula ? "both" : "neither", "");
  for (std::size_t k = 1; k < d.keys.size(); ++k) {
    archive.check(d.keys[k].time > d.keys[k - 1].time, "keys[" + std::to_string(k) + "].time", "expected a time after that of the key before", number_text(d.keys[k].time), "");
  }
  const bool leaves = !d.keys.empty() && d.keys[0].time == 0.0 && !(d.keys[0].by.isZero(0.0) && d.keys[0].turn == 0.0);
  archive.check(!leaves, "keys[0]", "expected the place at the start at time 0", "another", "give it a time > 0, or move the particle");
  const auto expect_way = [&archive](const char* key, const std::string& expression) {
    if (expression.empty()) return;
    if (const auto fault = fault_of_way(expression)) archive.check(false, key, fault->expected, fault->found, fault->hint);
  };
  expect_way("x", d.x);
  expect_way("y", d.y);
  expect_way("z", d.z);
}

template <class Archive>
void fields(Archive& archive, PinDesc& d) {
  archive.required("particle", d.particle, between(-kMostCount, kMostCount, kNumber), "number of the particle: from 0, negative from the end");
  archive("position", d.position, {}, "whether the position is held");
  archive("orientation", d.orientation, {}, "whether the orientation is held");
  archive("until", d.until, above(0.0, kTime), "time from which the particle is free; absent: never");
  archive("motion", d.motion, {}, "how the pin moves the particle, which keeps its velocity when it is freed; absent: at rest");
  if (!d.motion) return;
  const auto& keys = d.motion->keys;
  const bool shifts = keys.empty() || std::any_of(keys.begin(), keys.end(), [](const PinKeyDesc& key) { return !key.by.isZero(0.0); });
  const bool turns = std::any_of(keys.begin(), keys.end(), [](const PinKeyDesc& key) { return key.turn != 0.0; });
  archive.check(d.position || !shifts, "motion", "expected a pin that holds the position it moves", "position: false", "");
  archive.check(d.orientation || !turns, "motion", "expected a pin that holds the orientation it turns", "orientation: false", "");
}

template <class Archive>
void fields(Archive& archive, LoadDesc& d) {
  archive.required("particle", d.particle, between(-kMostCount, kMostCount, kNumber), "number of the particle: from 0, negative from the end");
  archive("force", d.force, any(kForce), "in world axes");
  archive("torque", d.torque, any(kTorque), "in world axes");
  archive("from", d.from, at_least(0.0, kTime), "time at which the load begins");
  archive("until", d.until, above(0.0, kTime), "time at which the load ends; absent: never");
  archive("ramp", d.ramp, at_least(0.0, kTime), "time of the linear rise from 'from' and of the linear fall to 'until'");
  archive("course", d.course, {}, "a factor of force and torque as a function of time; absent: 1");
  archive.check(d.until > d.from, "until", "expected more than from = " + number_text(d.from) + " [s]", number_text(d.until), "");
}

/// Number of particles; none when a file has them.
[[nodiscard]] inline std::optional<int> particle_count(const ParticlesDesc& d) {
  switch (d.arrange) {
    case ArrangeKind::Single: return 1;
    case ArrangeKind::Line:
    case ArrangeKind::Ring:
    case ArrangeKind::Curve:
    case ArrangeKind::Scatter:
    case ArrangeKind::Spiral: return d.count;
    case ArrangeKind::Points: return static_cast<int>(d.points.size());
    case ArrangeKind::Grid:
      if (double(d.columns) * d.rows * d.layers > kMostCount) break;
      return d.columns * d.rows * d.layers;
    case ArrangeKind::Geodesic: return 10 * d.frequency * d.frequency + 2;
    case ArrangeKind::Ball:
    case ArrangeKind::Tube:
    case ArrangeKind::Fill:
    case ArrangeKind::File: break;
  }
  return std::nullopt;
}

}  // namespace supple::scenes
