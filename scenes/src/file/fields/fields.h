/// @file fields.h
/// The keys of a scene, once: `fields` lists the members of each struct with rule and meaning, in the order of the
/// struct. The reader, the reference page and the JSON schema are archives over these lists. Here are those of scenes and objects, in fields_*.h those of
/// their parts.
///
/// An archive offers
///   archive(key, member, rule, meaning), archive.required(key, member, rule, meaning)
///   archive.given(key)                              whether the file names the key
///   archive.sound(key)                              whether its value is reliable: false where it, or a key that may be its misspelling, is faulty
///   archive.check(holds, key, expected, found, hint)  a relation between keys; `key` may be a path below this mapping
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "file/fields/fields_contact.h"
#include "file/fields/fields_laws.h"
#include "file/fields/fields_looks.h"
#include "file/fields/fields_output.h"
#include "file/fields/fields_particles.h"
#include "file/fields/fields_rules.h"
#include "file/fields/fields_shapes.h"
#include "file/read_scene_faults.h"
#include "output/pictures/camera.h"
#include "supple/core/math.h"

namespace supple::scenes {

inline constexpr double kMostSubsteps = 1048576.0;

template <class Archive>
void fields(Archive& archive, TimeStepDesc& d) {
  archive("size", d.size, above(0.0, kTime).or_auto(), "largest time step; a step is the time of a frame over 2^k, with k from the stability limits");
  archive("substeps", d.substeps, between(1.0, kMostSubsteps, kNumber).or_auto(),
          "exactly this many steps per frame (per `size` if that is given), a power of two; the run ends with exit code 5 where contacts cannot be followed with them");
  archive("max_substeps", d.max_substeps, between(1.0, kMostSubsteps, kNumber), "most steps per frame; a scene whose automatic steps would be finer is refused");
  if (d.substeps) {
    const int n = *d.substeps;
    archive.check((n & (n - 1)) == 0, "substeps", "expected a power of two", std::to_string(n), "");
  }
}

template <class Archive>
void fields(Archive& archive, IntegratorDesc& d) {
  using enum MethodName;
  archive("method", d.method, {},
          "auto: symplectic or implicit_midpoint, whichever reaches the accuracy at less cost; with time_step.size and no `accuracy` symplectic, or backward_euler where stiffness makes that much cheaper. "
          "`supple explain` prints the choice and its reason. backward_euler and implicit_midpoint solve contact and friction within the step, so that bodies held by "
          "friction stay at rest. implicit: implicit_midpoint in steps that resolve contact; backward_euler where the scene fixes steps that do not");
  archive("rotation", d.rotation, Rule{}.only("method", d.method, {Auto, Symplectic}),
          "how free particles rotate. splitting: about one principal axis after another; exponential: once, about the axis at the middle of the step");
  archive("tolerance", d.tolerance,
          between(1e-14, 0.1, kNumber).or_auto().only("method", d.method, {Auto, Adaptive, BackwardEuler, ImplicitMidpoint, Implicit}),
          "largest local error (adaptive) or last correction (implicit methods), relative to the smallest length, or in radians; auto: 1e-6 (adaptive), or for implicit methods a thousandth of the accuracy, 1e-9 without one");
}

/// Checks that the particles of pins, loads and primitives exist.
template <class Archive>
void check_particles(Archive& archive, const ObjectDesc& d) {
  const std::optional<int> count = particle_count(d.particles);
  const auto sound = [&](const char* key) { return archive.sound("particles." + std::string(key)); };
  if (!count || !sound("arrange") || !sound("count") || !sound("columns") || !sound("rows") || !sound("layers") || !sound("frequency")) return;
  const auto check = [&](const std::string& key, int particle) {
    archive.check(particle >= -*count && particle < *count, key, particle_range(static_cast<std::uint32_t>(*count)),
                  std::to_string(particle), "");
  };
  for (std::size_t k = 0; k < d.pins.size(); ++k) check("pins[" + std::to_string(k) + "].particle", d.pins[k].particle);
  for (std::size_t k = 0; k < d.loads.size(); ++k) check("loads[" + std::to_string(k) + "].particle", d.loads[k].particle);
  for (std::size_t k = 0; k < d.cuts.size(); ++k) {
    for (std::size_t j = 0; j < d.cuts[k].particles.size(); ++j) {
      check("cuts[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']', d.cuts[k].particles[j]);
    }
  }
  for (std::size_t k = 0; k < d.kinds.size(); ++k) {
    for (std::size_t j = 0; j < d.kinds[k].particles.size(); ++j) {
      check("kinds[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']', d.kinds[k].particles[j]);
    }
  }
  for (std::size_t k = 0; d.blend && k < d.blend->groups.size(); ++k) {
    for (std::size_t j = 0; j < d.blend->groups[k].particles.size(); ++j) {
      check("blend.groups[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']', d.blend->groups[k].particles[j]);
    }
  }
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    for (std::size_t j = 0; j < d.skeleton[k].particles.size(); ++j) {
      check("skeleton[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']', d.skeleton[k].particles[j]);
    }
  }
}

/// Checks what a material needs beside it.
template <class Archive>
void check_material(Archive& archive, const ObjectDesc& d) {
  using enum ArrangeKind;
  constexpr std::array kKnown{Single, Line, Ring, Spiral, Grid, Curve, Ball, Fill, Points};
  const bool known = std::find(kKnown.begin(), kKnown.end(), d.particles.arrange) != kKnown.end();
  archive.check(!d.skeleton.empty(), "material", "expected a skeleton, whose volume has the material", "none", "add 'skeleton'");
  archive.check(known || d.separate, "material", "expected particles in a line, ring, spiral, curve, grid, ball, filled mesh or at points, or bodies of their own",
                "arrange: " + std::string(name_of(d.particles.arrange)), "give 'mass' and 'interactions' instead");
  archive.check(d.particles.arrange != Points || d.separate || d.particles.points.size() < 2 || !d.particles.bonds.empty(), "material", "expected bonds between the particles", "none",
                "add 'particles.bonds', or give 'mass' and 'interactions' instead");
  archive.check(!d.particles.mass, "particles.mass", "expected either a mass or a material", "both", "leave out one of the two");
}

template <class Archive>
void fields(Archive& archive, ObjectDesc& d) {
  archive.required("name", d.name, identifier(), "unique; objects are numbered in the order of their names");
  archive.required("particles", d.particles, {}, "the particles of the object");
  archive("separate", d.separate, {}, "each particle is a body of its own that touches the others");
  archive("kinds", d.kinds, {}, "hinges and types; particles that are not named are standard particles of type 0");
  archive("hinges_join", d.hinges_join, {}, "whether the interactions also act between two hinges");
  archive("interactions", d.interactions, {}, "laws that act between the particles");
  archive("material", d.material, {},
          "physical properties, from which masses, moments, bonds, damping and contact follow; or the name of one of 'materials'. Grids become blocks and sheets, balls, filled meshes and points with bonds solids, lines, rings, spirals and curves round rods of the volume that the surface encloses; absent: these have keys of their own");
  archive("skeleton", d.skeleton, {}, "primitives that the particles carry; the surface is where their field equals iso; absent: no surface");
  archive("iso", d.iso, inside(0.0, 1.0, kNumber), "value of the field on the surface");
  archive("blend", d.blend, {}, "how the fields of its particles combine; absent: they sum");
  archive("volume", d.volume, {}, "keeps the volume by scaling the kernels (Desbrun & Gascuel 1995); the work of the kernels against contact counts as external work; absent: the volume is not kept");
  archive("contact", d.contact, {}, "material of the surface in contact; absent or false: it touches nothing");
  archive("repulsion", d.repulsion, {}, "exponential repulsion from other objects that have this key, where contact is off");
  archive("medium", d.medium, {}, "drag of a surrounding medium; absent: none");
  archive("breaking", d.breaking, {}, "when bonded pairs break; absent: never. A piece without bonds to the rest becomes a body of its own");
  archive("yielding", d.yielding, {}, "when bond frames take the present pose as their rest pose; absent: never");
  archive("rayleigh", d.rayleigh, {}, "damping of motion and deformation by alpha M + beta K; absent: none");
  archive("pins", d.pins, {}, "particles whose position or orientation is held");
  archive("loads", d.loads, {}, "external forces and torques");
  archive("cuts", d.cuts, {}, "bonds that break at given times, as with 'breaking'");
  archive("appears", d.appears, at_least(0.0, kTime), "time from which the object is there, with the velocities of its particles: until then it is held at its place, touches nothing and is not drawn; its energy is external work");
  archive("scale", d.scale, above(0.0, kNumber), "factor of its lengths: of particles but not their 'at', of the skeleton, of 'within' and of meshes. Forces and stiffnesses stay, those of a material follow");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("roughness", d.roughness, up_to(1.0, kNumber), "of the drawn surface");
  archive("look", d.look, {}, "appearance in pictures");
  archive("meshing", d.meshing, {}, "lattice cell and error of this object's meshes; where objects touch, the smallest values apply to all of them");
  archive.check(!(d.meshing.cell || d.meshing.error) || !d.skeleton.empty(), "meshing", "expected a skeleton, whose surface is meshed", "none",
                "add 'skeleton' or remove 'meshing'");
  archive.check(!d.separate || (d.interactions.empty() && d.kinds.empty()), "separate",
                "expected no interactions or kinds in an object of separate bodies", "some",
                "remove them, or 'separate'");
  archive.check(!d.volume || !d.skeleton.empty(), "volume", "expected a skeleton, whose volume is kept", "none", "");
  archive.check(!d.volume || (!d.breaking && !d.separate), "volume", "expected an object that stays one body",
                d.breaking ? "'breaking'" : "'separate'", "");
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    archive.check(!d.skeleton[k].volume || (d.volume && d.volume->of == VolumeOfName::Primitive), "skeleton[" + std::to_string(k) + "].volume",
                  "expected the object's volume to be held by primitive", d.volume ? std::string(name_of(d.volume->of)) : "not held",
                  "add 'volume: {of: primitive}'");
  }
  archive.check(d.cuts.empty() || !d.interactions.empty() || d.material, "cuts", "expected interactions that can be cut", "none",
                "add 'interactions' or remove 'cuts'");
  archive.check(d.cuts.empty() || !d.volume, "cuts", "expected an object that stays one body beside 'volume'", "cuts", "");
  archive.check(!d.blend || d.blend->fade == 0.0 || d.breaking || !archive.sound("breaking"), "blend.fade", "expected 'breaking' for bonds that fade", "none", "");
  archive.check(!d.breaking || !d.interactions.empty() || d.material, "breaking", "expected interactions that can break", "none",
                "add 'interactions' or remove 'breaking'");
  const bool from_file = d.particles.arrange == ArrangeKind::File || d.particles.arrange == ArrangeKind::Fill;
  archive.check(d.scale == 1.0 || !from_file, "scale", "expected particles that the scene places", "a file that does", "scale the file instead");
  if (d.material) check_material(archive, d);
  archive.check(!(d.breaking && literal_laws(d)), "breaking", "expected no law with paper_literal, which has no energy", "one", "");
  archive.check(!d.contact || !d.skeleton.empty(), "contact", "expected a skeleton for contact", "none",
                "add 'skeleton' or remove 'contact'");
  check_particles(archive, d);
  check_slopes(archive, d.skeleton, d.iso);
}

/// Checks that names of objects and obstacles are unique and not "ground", and that the objects of pairs exist.
template <class Archive>
void check_names(Archive& archive, const Scene& d) {
  std::map<std::string_view, std::string> index;
  const auto check_unique = [&](const std::string& name, const std::string& place) {
    const std::string key = place + ".name";
    archive.check(name != "ground", key, "expected a name other than 'ground'", "", "'ground' stands for the ground in pairs");
    const auto [first, fresh] = index.try_emplace(name, place);
    archive.check(fresh || name.empty(), key, "expected a unique name", '\'' + shown(name) + '\'',
                  first->second + " has it already");
  };
  for (std::size_t i = 0; i < d.objects.size(); ++i) check_unique(d.objects[i].name, "objects[" + std::to_string(i) + ']');
  for (std::size_t i = 0; i < d.obstacles.size(); ++i) check_unique(d.obstacles[i].name, "obstacles[" + std::to_string(i) + ']');
  // The names for pairs are unknown where a name is missing, or the key that lists it is misspelt.
  const bool unknown = (d.objects.empty() && !archive.sound("objects")) || (d.obstacles.empty() && !archive.sound("obstacles")) ||
                       (!d.ground && !archive.sound("ground"));
  if (index.contains("") || unknown) return;
  std::vector<std::string_view> names;
  for (const auto& [name, place] : index) names.push_back(name);
  if (d.ground) names.emplace_back("ground");
  std::map<std::pair<std::string, std::string>, std::size_t> pairs;
  for (std::size_t k = 0; k < d.pairs.size(); ++k) {
    std::vector<std::string> two = d.pairs[k].objects;
    const std::string key = "pairs[" + std::to_string(k) + "].objects";
    for (std::size_t side = 0; side < two.size(); ++side) {
      const bool known = index.contains(two[side]) || (two[side] == "ground" && d.ground);
      const std::string hint = two[side] == "ground" ? "the scene has none: add 'ground: true'" : known_hint(two[side], names);
      archive.check(known, key + '[' + std::to_string(side) + ']', "expected the name of an object or obstacle, or 'ground'",
                    '\'' + shown(two[side]) + '\'', hint);
    }
    if (two.size() != 2) continue;
    std::sort(two.begin(), two.end());
    const auto [first, fresh] = pairs.try_emplace({two[0], two[1]}, k);
    archive.check(fresh, key, "expected a pair that is not listed yet", two[0] + " and " + two[1],
                  "pairs[" + std::to_string(first->second) + "] has it already");
  }
}

template <class Archive>
void check_cameras(Archive& archive, const Scene& d) {
  archive.check(d.cameras.empty() || !archive.given("camera"), "cameras", "expected either camera or cameras", "both", "");
  archive.check(d.camera.name.empty(), "camera.name", "expected no name for the only camera", '\'' + shown(d.camera.name) + '\'',
                "use 'cameras' for several");
  for (std::size_t i = 0; i < std::max<std::size_t>(d.cameras.size(), 1); ++i) {
    const CameraDesc& camera = d.cameras.empty() ? d.camera : d.cameras[i];
    const std::string key = (d.cameras.empty() ? "camera" : "cameras[" + std::to_string(i) + ']') + ".keys";
    for (int frame = 1; !camera.keys.empty() && frame <= d.frame_count(); ++frame) {
      const render::Camera at = camera_at(camera, (frame - 1) / d.frame_rate, d.duration);
      const Vec3 sight = at.look_at - at.from;
      const bool apart = sight.norm() > 0.0;
      const bool across = sight.cross(at.up).norm() > 1e-6 * sight.norm() * at.up.norm();
      if (apart && across) continue;
      const std::string when = " in frame " + std::to_string(frame);
      archive.check(apart, key, "expected 'from' apart from 'look_at' at all times", "one point" + when, "add a key beside it");
      archive.check(!apart || across, key, "expected a line of sight across 'up' at all times", "one along it" + when, "choose another 'up'");
      break;
    }
  }
  std::map<std::string, std::size_t> named;
  for (std::size_t i = 0; i < d.cameras.size(); ++i) {
    const std::string key = "cameras[" + std::to_string(i) + "].name";
    archive.check(!d.cameras[i].name.empty(), key, "expected a name", "nothing", "this key is required");
    const auto [first, fresh] = named.try_emplace(d.cameras[i].name, i);
    archive.check(fresh, key, "expected a unique name", '\'' + shown(d.cameras[i].name) + '\'',
                  "cameras[" + std::to_string(first->second) + "] has it already");
  }
}

template <class Archive>
void fields(Archive& archive, Scene& d) {
  archive.required("schema", d.schema, between(1.0, 1.0, kNumber), "version of this format");
  archive("title", d.title, {}, "free text");
  archive.required("duration", d.duration, above(0.0, kTime), "length of the animation; frame n shows t = (n - 1) / frame_rate");
  archive("frame_rate", d.frame_rate, above(0.0, kRate), "frames per second");
  archive("gravity", d.gravity, any(kAcceleration), "acceleration of gravity; z is up");
  archive("gravity_course", d.gravity_course, {}, "a factor of gravity as a function of time; absent: 1");
  archive("wind", d.wind, {}, "velocity of the medium: the drag of objects with 'medium' is -gamma m (v - wind); absent: at rest");
  archive("planar", d.planar, {}, "motion in a plane: particles keep their z, which must be the same for all, and rotate about z only");
  archive("accuracy", d.accuracy, between(1e-5, 4e-2, kNumber),
          "error of positions relative to the size of the bodies, until a scene becomes chaotic: sets time step, integrator, contact error, mesh error and noise together, as `supple explain` prints; other keys override what it sets; above 1e-2, as previews have it, errors may be several times as large; absent: the motion is that of 1e-2 where the scene gives neither time_step.size, time_step.substeps nor integrator.method and every law has an energy; meshes and pictures have their own defaults");
  archive("time_step", d.time_step, {}, "size of the time steps. A run ends with exit code 5 and names the fastest object if nine tenths of its energy come neither from the initial state nor from loads or obstacles. Scenes whose energy does not balance by their own choice are exempt: laws with paper_literal, contact.split: contribution, objects with 'volume', and obstacles with keys in steps that the scene fixes");
  archive("integrator", d.integrator, {}, "method of time integration");
  archive.required("objects", d.objects, Rule{}.items(1, 100000), "deformable objects");
  archive("obstacles", d.obstacles, {}, "solids at rest or moved by keys, which forces do not move. Together with the ground they are one solid whose pressure is the largest of theirs, so flush faces count once, as a contact with the first of them (the ground, then by name). Obstacles that form one solid should overlap: faces that only meet leave a groove");
  archive("pairs", d.pairs, {}, "contact settings of two objects that replace those of their materials");
  archive("contact", d.contact, {}, "how contact is computed");
  archive("sleep", d.sleep, {}, "bodies at rest are not moved until something touches them or a load on them changes; absent: bodies never sleep");
  archive("camera", d.camera, {}, "the camera");
  archive("cameras", d.cameras, {}, "several cameras, instead of 'camera'; each has its own images, NAME.CAMERA.0001.png, and its own film");
  archive("light", d.light, {}, "sunlight");
  archive("lights", d.lights, {}, "rectangular area lights; OpenGL uses the first four");
  archive("background", d.background, {}, "colours of the background, from top to bottom");
  archive("render", d.render, {}, "how pictures are drawn");
  archive("ground", d.ground, {}, "a horizontal plane that carries objects; absent: none");
  archive("output", d.output, {}, "files that a run writes");
  archive.check(d.duration * d.frame_rate <= 1e6, "duration", "expected at most 1000000 frames",
                number_text(std::floor(d.duration * d.frame_rate)), "");
  const int given = d.time_step.substeps.value_or(1);
  archive.check(!d.time_step.size || *d.time_step.size * d.frame_rate * kMostSubsteps >= given, "time_step.size",
                "expected at least " + short_text(given / (d.frame_rate * kMostSubsteps)) + " s, " +
                    (given > 1 ? std::to_string(given) + " substeps of " : "") + "a frame's time over 2^20",
                d.time_step.size ? number_text(*d.time_step.size) : "", "");
  for (std::size_t i = 0; i < d.objects.size(); ++i) {
    const Vec3& axes = d.objects[i].particles.inertia_axes;
    archive.check(!d.objects[i].meshing.error || d.output.meshing.method == MeshingName::Auto || d.output.meshing.method == MeshingName::Cubes,
                  "objects[" + std::to_string(i) + "].meshing.error", "expected output.meshing.method auto or cubes with an error",
                  std::string(name_of(d.output.meshing.method)), "leave out 'method'");
    archive.check(!d.planar || (axes.x() == axes.y() && axes.y() == axes.z()),
                  "objects[" + std::to_string(i) + "].particles.inertia_axes", "expected three equal ones in a planar scene",
                  "different ones", "a planar particle turns about z only: use inertia_radius");
  }
  const bool implicit = d.integrator.method == MethodName::BackwardEuler || d.integrator.method == MethodName::ImplicitMidpoint ||
                        d.integrator.method == MethodName::Implicit;
  const bool literal = std::any_of(d.objects.begin(), d.objects.end(), [](const ObjectDesc& o) { return literal_laws(o); });
  archive.check(!(implicit && literal), "integrator.method",
                "expected an explicit method beside a law with paper_literal, which has no energy",
                std::string(name_of(d.integrator.method)), "use 'symplectic' or 'rk4'");
  check_names(archive, d);
  const double views = std::floor(d.duration * d.frame_rate) * static_cast<double>(std::max<std::size_t>(d.cameras.size(), 1));
  archive.check(d.cameras.size() < 2 || views <= 1e6, "cameras", "expected at most 1000000 pictures, one per frame and camera", number_text(views),
                "use fewer cameras or frames");
  if (views <= 1e6) check_cameras(archive, d);
}



}  // namespace supple::scenes
