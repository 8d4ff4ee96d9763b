/// @file fields_contact.h
/// The keys of what touches what, and how; see fields.h.
#pragma once

#include <initializer_list>
#include <string>

#include "file/fields_rules.h"
#include "file/fields_shapes.h"
#include "file/read_scene_faults.h"

namespace supple::scenes {

template <class Archive>
void fields(Archive& archive, MaterialDesc& d) {
  archive("modulus", d.modulus, above(0.0, kPressure), "P0: pressure is P0 (f - iso)");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient; a pair has sqrt(mu_A mu_B)");
  archive("dissipation", d.dissipation, at_least(0.0, kInverseSpeed), "Hunt & Crossley d; 1/d is the largest speed of a bounce");
  archive("self", d.self, {}, "whether parts of the object that its blending graph does not join touch each other: those that it joins by no way as bodies of their own, groups that others join (the fingers of a hand) by their own fields, without what these add (all that do not blend do so in an object that holds its volume); not those that a bond ties; those that overlap at the start, or that a bond or its blend has left, only once they have been apart; absent: true");
}

template <class Archive>
void fields(Archive& archive, RestitutionDesc& d) {
  archive.required("value", d.value, up_to(1.0, kNumber), "rebound speed over approach speed");
  archive.required("at_speed", d.at_speed, above(0.0, kSpeed), "approach speed at which it holds");
}

template <class Archive>
void fields(Archive& archive, PairDesc& d) {
  archive.required("objects", d.objects, identifier().items(2, 2), "two names of objects or obstacles; 'ground' is the ground");
  archive("collide", d.collide, {}, "whether they can touch");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "instead of sqrt(mu_A mu_B)");
  archive("dissipation", d.dissipation, at_least(0.0, kInverseSpeed), "instead of the materials'");
  archive("restitution", d.restitution, {}, "instead of dissipation");
  archive.check(!(d.dissipation && d.restitution), "restitution", "expected either dissipation or restitution", "both", "");
  if (d.objects.size() == 2) {
    archive.check(d.objects[0] != d.objects[1], "objects", "expected two different objects", '\'' + shown(d.objects[0]) + "' twice", "");
  }
}

template <class Archive>
void fields(Archive& archive, StickDesc& d) {
  archive.required("stiffness", d.stiffness, above(0.0, kStiffness), "force over the distance that touching bodies have slid, up to the Coulomb limit");
  archive("damping", d.damping, at_least(0.0, kTime), "times stiffness: force over the speed of sliding");
}

template <class Archive>
void fields(Archive& archive, ContactDesc& d) {
  archive("error", d.error, between(1e-10, 0.1, kNumber), "relative error of force, area and centre of pressure");
  archive("rule", d.rule, {}, "points of the contact surface: along the seeds' rays, in polar rings about the peak, on triangles that are refined, on panels cut at the rim; auto: panels where the pressure has many hills, polar where it fits, else what meets the error");
  archive("split", d.split, {}, "how forces reach the particles: gradient of the contact energy, or by contribution");
  archive("core", d.core, {}, "soft: bodies pressed too hard pass one another, which is reported; barrier: deep cores turn back what approaches");
  archive("friction_speed", d.friction_speed, above(0.0, kSpeed), "below it Coulomb friction fades out; pairs that an explicit time step would turn back, to and fro, have a higher one; implicit methods have one that shows no creep");
  archive("stick", d.stick, {}, "friction by springs that hold up to the Coulomb limit: what should stay stays; absent: it creeps");
  archive("bulge", d.bulge, between(0.0, 1.0, kNumber), "height of the bulge beside a contact over its depth; 0: none");
  archive("bulge_volume", d.bulge_volume, {}, "in place of 'bulge': as high as holds the volume that the contact displaces, to 1e-3 of it; a warning tells where the fields or 'bulge_width' do not let it");
  archive("bulge_width", d.bulge_width, up_to(1.0, kNumber).or_auto(), "width of the bulge at most, as a share of the other body's feature size; auto: 0.15, with 'bulge_volume' as wide as it takes");
  archive("bulge_literal", d.bulge_literal, {}, "as published: by distance instead of pressure, of one width; it pops up at first touch and bulges may cross");
  archive("sample_spacing", d.sample_spacing, above(0.0, kLength).or_auto(), "of the surface samples; auto: a sixth of the smallest feature");
  const bool bulges = archive.given("bulge") || archive.given("bulge_volume");
  for (const char* key : {"bulge_width", "bulge_literal"}) {
    archive.check(bulges || !archive.given(key), key, "expected 'bulge' or 'bulge_volume' beside it", "neither", "add one of the two");
  }
  archive.check(!d.bulge_volume || d.bulge == 0.0, "bulge", "expected no height beside 'bulge_volume'", number_text(d.bulge), "leave out one of the two");
  archive.check(!d.bulge_volume || !d.bulge_literal, "bulge_literal", "expected false beside 'bulge_volume'", "true", "leave out one of the two");
}

template <class Archive>
void fields(Archive& archive, SleepDesc& d) {
  archive("speed", d.speed, above(0.0, kSpeed), "a body is quiet while its kinetic energy is less than that of its mass at this speed");
  archive("time", d.time, above(0.0, kTime), "for which all bodies that touch one another must have been quiet to fall asleep together");
}

template <class Archive>
void fields(Archive& archive, GroundDesc& d) {
  archive("height", d.height, any(kLength), "z of the plane");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("texture", d.texture, {}, "by x and y; absent: none");
  archive("visible", d.visible, {}, "drawn");
  archive("collides", d.collides, {}, "with every object that has contact");
  archive("modulus", d.modulus, above(0.0, kPressure), "P of the half-space");
  archive("slope", d.slope, above(0.0, kSlope), "of its field: pressure is modulus times slope times depth");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient");
}

template <class Archive>
void fields(Archive& archive, ObstacleKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "when it is there");
  archive("at", d.at, any(kLength), "as of the obstacle");
  archive("turn_deg", d.turn, degrees(-36000.0, 36000.0), "of boxes, meshes and implicit ones, about turn_axis");
}

template <class Archive>
void fields(Archive& archive, ObstacleDesc& d) {
  using enum ObstacleName;
  const auto only = [&d](const Rule& rule, std::initializer_list<ObstacleName> shapes) { return rule.only("shape", d.shape, shapes); };
  archive.required("name", d.name, identifier(), "unique, also among the objects");
  archive("shape", d.shape, {}, "plane, box, heights over x and y, a closed mesh, or primitives as objects have them");
  archive("at", d.at, any(kLength), "a point of the plane, the middle of the box, added to heights, meshes and primitives");
  archive("normal", d.normal, only(direction(), {Plane}), "out of the solid");
  archive("extent", d.extent, only(above(0.0, kLength), {Plane}), "half the edge of the square that is drawn");
  archive.required("half_sizes", d.half_sizes, only(above(0.0, kLength), {Box}), "along its x, y, z");
  archive("rounding", d.rounding, only(at_least(0.0, kLength), {Box}), "radius of its edges in contact");
  archive("turn_axis", d.turn_axis, only(direction(), {Box, ObstacleName::Mesh, Implicit}), "with turn_deg");
  archive("turn_deg", d.turn, only(degrees(-360.0, 360.0), {Box, ObstacleName::Mesh, Implicit}), "rotation");
  archive("keys", d.keys, {}, "places at times; before the first and after the last it stands still; absent: always");
  archive("between", d.between, {}, "how keys are joined; smooth: at rest wherever it turns back, so that it never goes beyond a key");
  archive.required("file", d.file, only(file_name(), {Heights, ObstacleName::Mesh}), "CSV of x, y, z [m] on a regular grid, between whose points the ground is smooth and goes no higher or lower than they do; at its borders it ends, with upright sides; a closed mesh as OBJ or PLY [m], exact where it is thin, its edges rounded over less than a hundredth of its longest side elsewhere ('supple check' tells); a shell in another one bounds a cavity if it runs the other way round, shells that overlap are one solid; relative to the scene's folder");
  archive.required("skeleton", d.skeleton, only({}, {Implicit}), "primitives that sum, about 'at'");
  archive("iso", d.iso, only(inside(0.0, 1.0, kNumber), {Implicit}), "value of the field on its surface");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("roughness", d.roughness, up_to(1.0, kNumber), "of the drawn surface");
  archive("texture", d.texture, {}, "by the obstacle's own axes from 'at'; absent: none");
  archive("visible", d.visible, {}, "drawn");
  archive("modulus", d.modulus, above(0.0, kPressure), "P: pressure is modulus times slope times depth, or times what the field of an implicit one is above iso");
  archive("slope", d.slope, only(above(0.0, kSlope), {Plane, Box, Heights, ObstacleName::Mesh}), "of its field");
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
