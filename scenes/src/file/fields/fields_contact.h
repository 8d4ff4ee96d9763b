/// @file fields_contact.h
/// The keys of contact; see fields.h.
#pragma once

#include <initializer_list>
#include <string>

#include "file/fields/fields_rules.h"
#include "file/fields/fields_shapes.h"
#include "file/read_scene_faults.h"

namespace supple::scenes {

/// Of a lattice of bonds that act between two particles each (Cauchy's relation).
inline constexpr double kLargestPoissonsRatio = 0.25;

template <class Archive>
void fields(Archive& archive, SubstanceDesc& d) {
  archive.required("youngs_modulus", d.youngs_modulus, above(0.0, kPressure), "E, the stiffness in stretching and bending");
  archive.required("density", d.density, above(0.0, kDensity), "mass of the volume that the surface encloses at the start");
  archive("poissons_ratio", d.poissons_ratio, between(0.0, kLargestPoissonsRatio, kNumber),
          "nu, contraction across over extension along, of blocks and sheets; bonds between pairs carry at most 0.25. Rods do not contract");
  archive("damping_ratio", d.damping_ratio, between(0.0, 1.0, kNumber),
          "damping of the slowest free vibration over the critical one; replaced by 'rayleigh'. In contact it sets the dissipation for blows at a tenth of the speed of sound sqrt(E / density)");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient of the surface");
}

template <class Archive>
void fields(Archive& archive, MaterialDesc& d) {
  archive("modulus", d.modulus, above(0.0, kPressure).or_auto(), "P: the pressure inside is P (f - iso), f the field; auto: 1e4, or by the object's 'material'");
  archive("friction", d.friction, between(0.0, 100.0, kNumber).or_auto(), "Coulomb coefficient mu; a pair has sqrt(mu_A mu_B); auto: 0, or by the object's 'material'");
  archive("dissipation", d.dissipation, at_least(0.0, kInverseSpeed).or_auto(), "damping d of Hunt & Crossley 1975; no rebound is faster than 1/d; auto: 0, or by the object's 'material'");
  archive("self", d.self, {}, "contact between parts of the object; absent: true. Parts that no path of the blending graph connects touch as bodies of their own. Groups that are connected through others only (the fingers of a hand) touch by their own fields, without those of the others; in an object with 'volume' all groups that do not blend directly do so. Parts joined by a bond never touch. Parts that overlap at the start, and parts whose bond broke or whose blend faded, touch once they have been apart");
}

template <class Archive>
void fields(Archive& archive, RestitutionDesc& d) {
  archive.required("value", d.value, up_to(1.0, kNumber), "rebound speed over approach speed");
  archive.required("at_speed", d.at_speed, above(0.0, kSpeed), "approach speed at which it holds");
}

template <class Archive>
void fields(Archive& archive, PairDesc& d) {
  archive.required("objects", d.objects, identifier().items(2, 2), "names of two objects or obstacles; 'ground' stands for the ground");
  archive("collide", d.collide, {}, "whether the two can touch");
  archive("from", d.from, at_least(0.0, kTime), "time from which the two can touch; what overlaps then is pushed apart, by external work");
  archive("until", d.until, above(0.0, kTime), "time from which they pass through each other; absent: never");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient, instead of sqrt(mu_A mu_B)");
  archive("dissipation", d.dissipation, at_least(0.0, kInverseSpeed), "damping d, instead of that of the materials");
  archive("restitution", d.restitution, {}, "rebound speed, instead of dissipation");
  archive.check(d.until > d.from, "until", "expected more than from = " + number_text(d.from) + " [s]", number_text(d.until), "");
  archive.check(d.collide.value_or(true) || !(archive.given("from") || archive.given("until")), "collide", "expected two that can touch between times", "collide: false", "");
  archive.check(!(d.dissipation && d.restitution), "restitution", "expected either dissipation or restitution", "both", "");
  if (d.objects.size() == 2) {
    archive.check(d.objects[0] != d.objects[1], "objects", "expected two different objects", '\'' + shown(d.objects[0]) + "' twice", "");
  }
}

template <class Archive>
void fields(Archive& archive, StickDesc& d) {
  archive.required("stiffness", d.stiffness, above(0.0, kStiffness), "force over sliding distance, up to the Coulomb limit");
  archive("damping", d.damping, at_least(0.0, kTime), "damping over stiffness: the force over sliding speed is stiffness times this");
}

template <class Archive>
void fields(Archive& archive, ContactDesc& d) {
  archive("error", d.error, between(1e-10, 0.1, kNumber), "relative error of force, area and centre of pressure; absent: the accuracy, or 1e-4 where the scene fixes its steps or its method");
  archive("rule", d.rule, {}, "quadrature points of the contact surface. polar: in polar rings about the pressure peak; march: on triangles that are refined; panels: on panels cut at the boundary; auto: panels where the pressure has many maxima, polar where it fits, else march");
  archive("split", d.split, {}, "how forces reach the particles. energy: by the gradient of the contact energy; contribution: by each primitive's share of the field");
  archive("core", d.core, {}, "soft: a run whose bodies are pressed through each other ends with exit code 5 and names them; barrier: bodies stop approaching where the pressure exceeds half of that in the middle of the weaker one");
  archive("friction_speed", d.friction_speed, above(0.0, kSpeed), "sliding speed below which Coulomb friction falls to zero. Where an explicit step of friction would reverse the sliding, the pair has a higher one; implicit methods have one so small that no creep shows");
  archive("stick", d.stick, {}, "friction by springs up to the Coulomb limit, so that bodies held by friction stay at rest; absent: they creep");
  archive("bulge", d.bulge, between(0.0, 1.0, kNumber), "height of the bulge beside a contact over the depth of the contact; 0: no bulge");
  archive("bulge_volume", d.bulge_volume, {}, "instead of 'bulge': bulges hold the volume that the contact displaces, to 1e-3 of it; a warning names the contacts where the fields or 'bulge_width' do not allow it");
  archive("bulge_width", d.bulge_width, up_to(1.0, kNumber).or_auto(), "largest width of the bulge over the feature size of the other body; auto: 0.15, or as wide as 'bulge_volume' needs");
  archive("bulge_literal", d.bulge_literal, {}, "bulge as published (Gascuel 1993): by distance instead of pressure, of one width; it jumps up at first touch, and bulges may cross");
  archive("sample_spacing", d.sample_spacing, above(0.0, kLength).or_auto(), "distance between surface samples; auto: a sixth of the thickness, primitive by primitive, or a third where contact.error is 5e-2 or more");
  const bool bulges = archive.given("bulge") || archive.given("bulge_volume");
  for (const char* key : {"bulge_width", "bulge_literal"}) {
    archive.check(bulges || !archive.given(key), key, "expected 'bulge' or 'bulge_volume' beside it", "neither", "add one of the two");
  }
  archive.check(!d.bulge_volume || d.bulge == 0.0, "bulge", "expected no height beside 'bulge_volume'", number_text(d.bulge), "leave out one of the two");
  archive.check(!d.bulge_volume || !d.bulge_literal, "bulge_literal", "expected false beside 'bulge_volume'", "true", "leave out one of the two");
}

template <class Archive>
void fields(Archive& archive, SleepDesc& d) {
  archive("speed", d.speed, above(0.0, kSpeed), "a body is quiet while its kinetic energy is below that of its mass at this speed");
  archive("time", d.time, above(0.0, kTime), "how long all bodies that touch one another must be quiet before they fall asleep together");
}

template <class Archive>
void fields(Archive& archive, GroundDesc& d) {
  archive("height", d.height, any(kLength), "z of the plane");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("texture", d.texture, {}, "pattern by x and y; absent: none");
  archive("visible", d.visible, {}, "whether it is drawn");
  archive("collides", d.collides, {}, "whether it touches the objects that have contact");
  archive("modulus", d.modulus, above(0.0, kPressure), "P: pressure is P times slope times depth");
  archive("slope", d.slope, above(0.0, kSlope), "of its field; that of an object is about the inverse of its size, and a default that is more than 10 times softer than an object that may touch it gives a warning");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient");
}

template <class Archive>
void fields(Archive& archive, ObstacleKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "time at which the obstacle is there");
  archive("at", d.at, any(kLength), "position, as the obstacle's 'at'");
  archive("turn_deg", d.turn, degrees(-36000.0, 36000.0), "rotation of a box, mesh or implicit obstacle about turn_axis");
}

template <class Archive>
void fields(Archive& archive, ObstacleDesc& d) {
  using enum ObstacleName;
  const auto only = [&d](const Rule& rule, std::initializer_list<ObstacleName> shapes) { return rule.only("shape", d.shape, shapes); };
  archive.required("name", d.name, identifier(), "unique, also among the objects");
  archive("shape", d.shape, {}, "plane, box, heights over x and y, closed mesh, or implicit: primitives as objects have them");
  archive("at", d.at, any(kLength), "a point of the plane, the middle of the box, added to heights, meshes and primitives");
  archive("normal", d.normal, only(direction(), {Plane}), "out of the solid");
  archive("extent", d.extent, only(above(0.0, kLength), {Plane}), "half the edge of the square that pictures show");
  archive.required("half_sizes", d.half_sizes, only(above(0.0, kLength), {Box}), "along its x, y, z");
  archive("rounding", d.rounding, only(at_least(0.0, kLength), {Box}), "radius of its edges in contact");
  archive("turn_axis", d.turn_axis, only(direction(), {Box, ObstacleName::Mesh, Implicit}), "axis of turn_deg");
  archive("turn_deg", d.turn, only(degrees(-360.0, 360.0), {Box, ObstacleName::Mesh, Implicit}), "rotation about turn_axis");
  archive("keys", d.keys, {}, "places at times; before the first and after the last the obstacle is at rest; absent: it is always at rest");
  archive("between", d.between, {}, "interpolation of keys; smooth: the speed is zero where the motion turns back, so the obstacle never passes beyond a key");
  archive.required("file", d.file, only(file_name(), {Heights, ObstacleName::Mesh}), "relative to the scene's folder. heights: CSV of x, y, z [m] on a regular grid; between the points the surface is smooth and neither higher nor lower than they are; at the border it ends with vertical sides. mesh: a closed mesh as OBJ or PLY [m], exact where it is thin; elsewhere its edges are rounded over less than a hundredth of its longest side ('supple check' prints the radius). A shell inside another one bounds a cavity if it is oriented the other way round; shells that overlap are one solid");
  archive.required("skeleton", d.skeleton, only({}, {Implicit}), "primitives whose fields sum, with 'at' as origin");
  archive("iso", d.iso, only(inside(0.0, 1.0, kNumber), {Implicit}), "value of the field on its surface");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("roughness", d.roughness, up_to(1.0, kNumber), "of the drawn surface");
  archive("texture", d.texture, {}, "pattern along the obstacle's own axes, from 'at'; absent: none");
  archive("smooth_deg", d.smooth, only(degrees(0.0, 180.0), {ObstacleName::Mesh}), "pictures show edges whose faces differ by less than this angle smooth; 0: all are sharp");
  archive("visible", d.visible, {}, "whether it is drawn");
  archive("modulus", d.modulus, above(0.0, kPressure), "P: pressure is P times slope times depth; of an implicit obstacle P (f - iso)");
  archive("slope", d.slope, only(above(0.0, kSlope), {Plane, Box, Heights, ObstacleName::Mesh}), "of its field; that of an object is about the inverse of its size, and a default that is more than 10 times softer than an object that may touch it gives a warning");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient");
  for (std::size_t k = 0; k < d.keys.size(); ++k) {
    const std::string key = "keys[" + std::to_string(k) + ']';
    archive.check(k == 0 || d.keys[k - 1].time < d.keys[k].time, key + ".time", "expected a later time than the key before",
                  number_text(d.keys[k].time), "");
    const bool turns = d.shape == Box || d.shape == ObstacleName::Mesh || d.shape == Implicit;
    archive.check(d.keys[k].turn == 0.0 || turns, key + ".turn_deg", "expected a box, a mesh or an implicit obstacle that turns",
                  std::string(name_of(d.shape)), "");
  }
  archive.check(d.shape != Implicit || !d.skeleton.empty(), "skeleton", "expected a primitive", "none", "");
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    const std::string key = "skeleton[" + std::to_string(k) + ']';
    archive.check(d.skeleton[k].particles.empty(), key + ".particles", "expected none: an obstacle has no particles", "some", "");
    archive.check(!d.skeleton[k].volume, key + ".volume", "expected none: an obstacle holds no volume", "one", "");
  }
  check_slopes(archive, d.skeleton, d.iso);
  archive.check(d.keys.empty() || !(archive.given("at") || archive.given("turn_deg")), "keys", "expected either keys or at and turn_deg",
                "both", "");
  archive.check(d.shape != Box || d.rounding <= d.half_sizes.minCoeff(), "rounding", "expected at most the least half size",
                number_text(d.rounding), "");
}

}  // namespace supple::scenes
