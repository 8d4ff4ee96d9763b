/// @file fields.h
/// The keys of a scene, once: `fields` lists the members of each struct with rule and meaning, in the order of the
/// struct. The reader, the reference page and the JSON schema are archives over these lists.
///
/// An archive offers
///   archive(key, member, rule, meaning), archive.required(key, member, rule, meaning)
///   archive.given(key)                              whether the file names the key
///   archive.check(holds, key, expected, found, hint)  a relation between keys; `key` may be a path below this mapping
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "camera.h"
#include "fields_looks.h"
#include "fields_rules.h"
#include "read_scene_faults.h"
#include "supple/core/gay_berne.h"
#include "supple/core/lennard_jones.h"
#include "supple/core/math.h"
#include "supple/implicit/kernel.h"

namespace supple::scenes {

inline constexpr double kMostCount = 1e6;
inline constexpr double kMostSubsteps = 1048576.0;

template <class Archive>
void fields(Archive& archive, TimeStepDesc& d) {
  archive("size", d.size, above(0.0, kTime).or_auto(), "largest step; a step is always frame / 2^k");
  archive("substeps", d.substeps, between(1.0, kMostSubsteps, kNumber).or_auto(), "steps a frame, a power of two");
  archive("max_substeps", d.max_substeps, between(1.0, kMostSubsteps, kNumber), "automatic steps finer than this are refused");
  if (d.substeps) {
    const int n = *d.substeps;
    archive.check((n & (n - 1)) == 0, "substeps", "expected a power of two", std::to_string(n), "");
  }
}

template <class Archive>
void fields(Archive& archive, IntegratorDesc& d) {
  using enum MethodName;
  archive("method", d.method, {},
          "auto: symplectic unless stiffness makes backward_euler cheaper by far; `supple explain` says which and why");
  archive("rotation", d.rotation, Rule{}.only("method", d.method, {Auto, Symplectic}),
          "of free bodies: about one principal axis after another, or about the axis of the middle attitude");
  archive("tolerance", d.tolerance,
          between(1e-14, 0.1, kNumber).or_auto().only("method", d.method, {Auto, Adaptive, BackwardEuler, ImplicitMidpoint}),
          "local error (adaptive) or last correction (implicit) over the smallest length, or in radians; auto: 1e-6 and 1e-9");
}

template <class Archive>
void fields(Archive& archive, ParticlesDesc& d) {
  using enum ArrangeKind;
  const auto only = [&d](const Rule& rule, std::initializer_list<ArrangeKind> kinds) {
    return rule.only("arrange", d.arrange, kinds);
  };
  archive("arrange", d.arrange, {}, "how the particles lie; generators lie in the x-y plane");
  archive.required("count", d.count, only(between(1.0, kMostCount, kNumber), {Line, Ring, Spiral}), "how many");
  archive.required("radius", d.radius, only(above(0.0, kLength), {Ring, Geodesic}), "of the circle or sphere");
  archive.required("frequency", d.frequency, only(between(1.0, 300.0, kNumber), {Geodesic}),
                   "parts of each edge of an icosahedron; 10 frequency^2 + 2 particles");
  archive.required("inner_radius", d.inner_radius, only(at_least(0.0, kLength), {Spiral}), "where the spiral begins");
  archive.required("outer_radius", d.outer_radius, only(above(0.0, kLength), {Spiral}), "where the spiral ends");
  archive("turns", d.turns, only(up_to(1000.0, kNumber), {Spiral}), "of the spiral");
  archive.required("spacing", d.spacing, only(above(0.0, kLength), {Line, Grid}), "between neighbours");
  archive.required("columns", d.columns, only(between(1.0, 1e4, kNumber), {Grid}), "along x");
  archive.required("rows", d.rows, only(between(1.0, 1e4, kNumber), {Grid}), "along y");
  archive("layers", d.layers, only(between(1.0, 1e4, kNumber), {Grid}), "along z");
  archive.required("file", d.file, only({}, {File}), "CSV of x, y, z [m], relative to the scene's folder");
  archive("normal", d.normal, only({}, {Ring, Spiral}), "where particle normals point: along the axis, or out of the curve");
  archive("disorder", d.disorder, at_least(0.0, kLength), "each particle is moved at random by up to this, alike in every run");
  archive("at", d.at, any(kLength), "where the origin of the arrangement goes");
  archive("axis", d.axis, direction(), "where its z axis goes");
  archive("angle_deg", d.angle, degrees(-360.0, 360.0), "turn about its own axis, made first");
  archive("velocity", d.velocity, any(kSpeed), "at the start");
  archive("spin", d.spin, any(kSpin), "at the start, of the whole about its centre of mass");
  archive("mass", d.mass, above(0.0, kMass), "of one particle");
  archive("inertia_radius", d.inertia_radius, above(0.0, kLength).or_auto(),
          "a in the inertia 2/5 m a^2; auto: half the distance of the nearest neighbour; of single and `separate` particles, the moments of the solid that each carries");
  archive("inertia_axes", d.inertia_axes, at_least(0.0, kLength),
          "instead: semi-axes of a solid ellipsoid in each particle's frame; zero: not given");
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
  if (d.arrange == File) {
    const std::filesystem::path file = d.file;
    const bool climbs = std::find(file.begin(), file.end(), "..") != file.end();
    archive.check(!d.file.empty() && file.is_relative() && !climbs, "file", "expected a file inside the scene's folder",
                  '\'' + shown(d.file) + '\'', "");
  }
  if (d.arrange == Grid) {
    const double all = double(d.columns) * d.rows * d.layers;
    archive.check(all <= kMostCount, d.layers > 1 ? "layers" : "rows", "expected at most 1000000 particles", number_text(all), "");
  }
}

/// Whether an object has a law without energy.
inline bool literal_laws(const ObjectDesc& d) {
  return std::any_of(d.interactions.begin(), d.interactions.end(), [](const InteractionDesc& i) { return i.paper_literal; });
}

/// What the keys of the cohesion law must say together.
template <class Archive>
void check_cohesion(Archive& archive, const InteractionDesc& d) {
  const bool by_maximum = d.maximum_distance || d.maximum_ratio || d.maximum_force || d.scale_force;
  const bool by_gain = d.gain || d.alpha;
  archive.check(by_maximum || by_gain, "", "expected maximum_distance and maximum_force, or gain and alpha", "none of them", "");
  archive.check(!(by_maximum && by_gain), d.gain ? "gain" : "alpha",
                "expected either maximum_distance and maximum_force, or gain and alpha", "keys of both", "");
  archive.check(by_gain || !by_maximum || ((d.maximum_distance || d.maximum_ratio) && (d.maximum_force || d.scale_force)),
                d.maximum_force   ? "maximum_force"
                : d.scale_force   ? "scale_force"
                : d.maximum_ratio ? "maximum_ratio"
                                  : "maximum_distance",
                "expected maximum_distance and maximum_force together", "one of them",
                d.maximum_ratio || d.scale_force ? "maximum_ratio stands for maximum_distance, scale_force for maximum_force" : "");
  archive.check(!(d.maximum_distance && d.maximum_ratio), "maximum_ratio", "expected either maximum_distance or maximum_ratio",
                "both", "");
  archive.check(!(d.maximum_force && d.scale_force), "scale_force", "expected either maximum_force or scale_force", "both", "");
  archive.check(by_maximum || !by_gain || (d.gain && d.alpha), d.gain ? "gain" : "alpha", "expected gain and alpha together",
                "one of them", "");
  if (d.rest_distance && d.maximum_distance) {
    archive.check(*d.maximum_distance > *d.rest_distance, "maximum_distance",
                  "expected more than rest_distance = " + number_text(*d.rest_distance) + " [m]",
                  number_text(*d.maximum_distance), "");
  }
}

/// What the keys of the Lennard-Jones law must say together.
template <class Archive>
void check_lennard_jones(Archive& archive, const InteractionDesc& d) {
  archive.check(d.depth || d.scale_force, "", "expected depth or scale_force", "neither", "");
  archive.check(!(d.depth && d.scale_force), "depth", "expected either depth or scale_force", "both", "");
  archive.check(d.repulsive > d.attractive, "repulsive", "expected more than attractive = " + std::to_string(d.attractive),
                std::to_string(d.repulsive), "");
  archive.check(!d.switch_from || d.cut_off, "switch_from", "expected a cut_off to switch to", "none", "");
  if (d.switch_from && d.cut_off) {
    archive.check(*d.switch_from < *d.cut_off, "switch_from", "expected less than cut_off = " + number_text(*d.cut_off) + " [m]",
                  number_text(*d.switch_from), "");
  }
  archive.check(!d.geometric || d.cut_off, "cut_off", "expected a cut-off for a geometric law", "none", "");
}

/// What the keys of the Gay-Berne law must say together.
template <class Archive>
void check_gay_berne(Archive& archive, const InteractionDesc& d) {
  archive.check(d.depth.has_value(), "depth", "expected an energy > 0 [J]", "nothing", "this key is required");
  archive.check(d.geometric, "geometric", "expected true for gay_berne", "false",
                "it acts between all ellipsoids in range; for bonds there is directed_cohesion");
  archive.check(d.cut_off.has_value(), "cut_off", "expected a cut-off for a geometric law", "none", "");
  if (!d.cut_off) return;
  const double length = 2.0 * d.semi_axes.maxCoeff();
  archive.check(*d.cut_off > length, "cut_off", "expected more than the longest ellipsoid, " + number_text(length) + " [m]",
                number_text(*d.cut_off), "");
  archive.check(!d.switch_from || *d.switch_from < *d.cut_off, "switch_from",
                "expected less than cut_off = " + number_text(*d.cut_off) + " [m]", number_text(d.switch_from.value_or(0.0)), "");
}

template <class Archive>
void fields(Archive& archive, InteractionDesc& d) {
  using enum LawKind;
  const auto only = [&d](const Rule& rule, std::initializer_list<LawKind> laws) { return rule.only("law", d.law, laws); };
  archive.required("law", d.law, {}, "what acts between bonded particles");
  archive("neighbours", d.neighbours, between(1.0, 1000.0, kNumber), "bonds join particles up to this many apart in their order");
  archive("within", d.within, above(0.0, kLength),
          "instead: bonds join particles nearer than this at rest; with geometric: the range of the law");
  archive("geometric", d.geometric, only({}, {Cohesion, LinearCohesion, LennardJones, GayBerne, Coplanarity, CoNormality, CoCircularity}),
          "instead of bonds: all pairs of the object in range, found anew each step; gay_berne has no bonds");
  archive("normalised", d.normalised, only({}, {Coplanarity, CoCircularity}),
          "weight psi / d^2 instead of psi, so that scale does not matter; strength is then in J");
  archive("paper_literal", d.paper_literal, only({}, {FormRadius}),
          "as printed by Lombardo & Puech 1995, for comparison: it conserves neither energy nor momentum");
  archive.required("stretch", d.stretch, only(at_least(0.0, kStiffness), {BondFrame}), "k_s");
  archive.required("rotation", d.rotation, only(at_least(0.0, kTorque), {BondFrame}), "k_theta");
  archive.required("strength", d.strength, only(at_least(0.0, kBending), {Form, DirectedForm}),
                   "k; a chain bends like a beam of EI = 2 k / spacing");
  archive.required("strength", d.strength,
                   only(at_least(0.0, d.normalised ? kEnergy : kStiffness), {FormRadius, Coplanarity, CoCircularity}), "k");
  archive.required("strength", d.strength, only(at_least(0.0, kEnergy), {CoNormality}), "k");
  archive("linear", d.linear, only(at_least(0.0, kDamping), {Friction}), "c, against relative velocity");
  archive("angular", d.angular, only(at_least(0.0, kAngularDamping), {Friction}), "c_r, against relative spin");
  archive("rest_distance", d.rest_distance, only(above(0.0, kLength).or_auto(), {Cohesion, LinearCohesion, LennardJones}),
          "r0; auto: of each bond at rest");
  archive("maximum_distance", d.maximum_distance, only(above(0.0, kLength), {Cohesion}), "r_m, of the largest attraction");
  archive("maximum_ratio", d.maximum_ratio, only(above(1.0, kNumber), {Cohesion}),
          "r_m / r0, instead of maximum_distance: the same curve for every rest distance");
  archive("maximum_force", d.maximum_force, only(above(0.0, kForce), {Cohesion}), "F_max, the largest attraction");
  archive("scale_force", d.scale_force, only(above(0.0, kForce), {Cohesion, LinearCohesion, DirectedCohesion, LennardJones}),
          "F0 of the cohesion laws (of cohesion instead of maximum_force); E of lennard_jones, instead of depth");
  archive("gain", d.gain, only(above(0.0, kPressure), {Cohesion}), "E, instead of maximum_distance and maximum_force");
  archive("alpha", d.alpha, only(above(0.0, kInverseArea), {Cohesion}), "alpha, with gain");
  archive("table_error", d.table_error, only(between(1e-9, 0.1, kNumber), {Cohesion}),
          "force from a table with at most this error over F_max; absent: no table");
  archive("shape", d.shape, only(above(0.0, kNumber), {LinearCohesion, DirectedCohesion}), "a, how fast the force falls off");
  archive("eta", d.eta, only(at_least(0.0, kNumber), {LinearCohesion}), "stiffness at rest over F0 / r0");
  archive.required("semi_axes", d.semi_axes, only(above(0.0, kLength), {DirectedCohesion, GayBerne}),
                   "of each particle's ellipsoid, along its own x, y, z; bonded particles rest where theirs touch");
  archive("depth", d.depth, only(above(0.0, kEnergy), {LennardJones, GayBerne}), "binding energy; of gay_berne epsilon");
  archive("sigma", d.sigma, only(above(0.0, kLength), {GayBerne}),
          "over which the force between surfaces falls off; absent: twice the smallest semi-axis");
  archive("gamma", d.gamma, only(above(0.0, kNumber), {GayBerne}), "shift of the distance between surfaces, over sigma");
  archive("wells", d.wells, only(above(0.0, kNumber), {GayBerne}), "depth for approach along the own x, y, z, over depth");
  archive("upsilon", d.upsilon, only(between(0.0, core::SwitchedGayBerne::kLargestExponent, kNumber), {GayBerne}),
          "exponent of the shapes' strength");
  archive("mu", d.mu, only(between(1.0, core::SwitchedGayBerne::kLargestExponent, kNumber), {GayBerne}),
          "exponent of the wells' strength");
  archive("repulsive", d.repulsive, only(between(2.0, core::LennardJones::kLargestExponent, kNumber), {LennardJones}),
          "n of (r0/d)^n");
  archive("attractive", d.attractive, only(between(1.0, core::LennardJones::kLargestExponent - 1, kNumber), {LennardJones}),
          "m of (r0/d)^m");
  archive("cut_off", d.cut_off, only(above(0.0, kLength), {LennardJones, GayBerne}),
          "where force and energy become 0; absent: nowhere");
  archive("switch_from", d.switch_from, only(above(0.0, kLength), {LennardJones, GayBerne}),
          "where the potential begins to be switched off; absent: the force is shifted; of gay_berne 0.9 cut_off");
  archive("range", d.range,
          only(above(0.0, kLength), {Form, FormRadius, DirectedForm, Coplanarity, CoNormality, CoCircularity}),
          "h of the weight (1 - d^2/h^2)^3; absent: weight 1");
  archive.check(!(archive.given("neighbours") && d.within), "within", "expected either neighbours or within", "both", "");
  archive.check(!(archive.given("neighbours") && d.geometric), "neighbours", "expected either neighbours or geometric", "both", "");
  const bool by_range = d.law == Coplanarity || d.law == CoNormality || d.law == CoCircularity;
  archive.check(!d.geometric || d.rest_distance || by_range || d.law == GayBerne, "rest_distance",
                "expected a length > 0 [m] for a geometric law", "nothing", "");
  archive.check(!d.geometric || d.range || !by_range, "range", "expected a length > 0 [m] for a geometric law", "nothing", "");
  archive.check(!(d.geometric && d.normalised), "normalised", "expected either normalised or geometric", "both",
                "psi / d^2 grows without bound where two particles meet");
  if (d.law == Cohesion) check_cohesion(archive, d);
  if (d.law == LennardJones) check_lennard_jones(archive, d);
  if (d.law == GayBerne) check_gay_berne(archive, d);
  if (d.law == LinearCohesion || d.law == DirectedCohesion) {
    archive.check(d.scale_force.has_value(), "scale_force", "expected a force > 0 [N]", "nothing", "this key is required");
  }
  archive.check(!(d.geometric && (d.law == LennardJones || d.law == GayBerne) && d.within), "within",
                "expected cut_off alone for the range", "both", "");
  archive.check(!(d.geometric && by_range && d.within), "within", "expected range alone for a geometric law", "both", "");
}

template <class Archive>
void fields(Archive& archive, KernelDesc& d) {
  using enum KernelName;
  archive("type", d.type, {}, "wyvill: (1 - d^2/R^2)^3; gascuel: linear down to the thickness, then cubic; murakami: (1 - d^2/R^2)^2; "
                              "blinn: Gaussian; all others by their papers, all 0 beyond R");
  archive("radius", d.radius, above(0.0, kLength), "support R; required, except where the shape gives the support itself (then its smallest semi-axis or radius)");
  archive.required("thickness", d.thickness, above(0.0, kLength).only("type", d.type, {Gascuel}), "e: distance of the surface");
  archive.required("slope", d.slope, above(0.0, kSlope).only("type", d.type, {Gascuel}),
                   "steepness at the surface; slope (radius - thickness) <= 3 iso");
  archive("sharpness", d.sharpness,
          between(implicit::Kernel::kLeastSharpness, implicit::Kernel::kLargestSharpness, kNumber).only("type", d.type, {Blinn, Cauchy}),
          "s of exp(-s^2 d^2/R^2) and (1 + s^2 d^2/R^2)^-2, of which the tangent at R is taken off");
  archive("hardness", d.hardness,
          between(implicit::Kernel::kLeastHardness, implicit::Kernel::kLargestHardness, kNumber).only("type", d.type, {BlancSchlick}),
          "p: the slope at R/2 is 2 + 16 p/9, over R");
  if (d.thickness && d.radius > 0.0) {
    archive.check(*d.thickness < d.radius, "thickness", "expected less than radius = " + number_text(d.radius) + " [m]",
                  number_text(*d.thickness), "");
  }
}

/// Corners span an area and control points a line; polygons are plane and convex.
template <class Archive>
void check_points(Archive& archive, const SkeletonDesc& d) {
  using enum ShapeName;
  const std::vector<Vec3>& p = d.points;
  const std::size_t n = p.size();
  if (d.shape == Curve && n >= 2) {
    double length = 0.0;
    for (std::size_t i = 1; i < n; ++i) length += (p[i] - p[i - 1]).norm();
    archive.check(length > 0.0, "points", "expected a curve of some length", "all points at one place", "");
  }
  if ((d.shape != Triangle && d.shape != Polygon) || n < 3) return;
  Vec3 area = Vec3::Zero();
  double largest = 0.0;
  for (std::size_t i = 1; i + 1 < n; ++i) area += 0.5 * (p[i] - p[0]).cross(p[i + 1] - p[0]);
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, (p[i] - p[0]).norm());
  const bool spans = area.norm() > 1e-9 * largest * largest;
  archive.check(spans, "points", "expected corners that span an area", number_text(area.norm()) + " m^2", "");
  if (!spans || d.shape == Triangle) return;
  const Vec3 normal = area.normalized();
  double turned = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& here = p[i];
    const Vec3 ahead = p[(i + 1) % n] - here, next = p[(i + 2) % n] - p[(i + 1) % n];
    const double off = std::abs(normal.dot(here - p[0]));
    const std::string key = "points[" + std::to_string(i) + ']';
    archive.check(off <= 1e-9 * largest, key, "expected a corner in the plane of the others", short_text(off) + " m off it", "");
    archive.check(normal.dot(ahead.cross(next)) >= -1e-12 * largest * largest && ahead.norm() > 0.0, key,
                  "expected corners of a convex polygon, in order", "a turn to the other side", "");
    turned += math::atan2(normal.dot(ahead.cross(next)), ahead.dot(next));
  }
  archive.check(turned < 3.0 * std::numbers::pi, "points", "expected corners of a convex polygon, in order", "edges that cross", "");
}

template <class Archive>
void fields(Archive& archive, SkeletonDesc& d) {
  using enum ShapeName;
  const auto only = [&d](const Rule& rule, std::initializer_list<ShapeName> shapes) {
    return rule.only("shape", d.shape, shapes);
  };
  archive.required("shape", d.shape, {}, "what is thickened by the kernel; flat shapes lie in their x-y plane");
  archive.required("half_size", d.half_size, only(above(0.0, kLength), {Square}), "half an edge");
  archive.required("half_length", d.half_length, only(above(0.0, kLength), {Segment}), "along x");
  archive.required("half_sizes", d.half_sizes, only(above(0.0, kLength).items(d.shape == Box ? 3 : 2, d.shape == Rectangle ? 2 : 3), {Rectangle, Box}),
                   "along x, y (and z for a box)");
  archive.required("radius", d.radius, only(above(0.0, kLength), {Disc, Ring, Arc}), "of the disc or circle");
  archive.required("half_angle_deg", d.half_angle, only(degrees(0.1, 180.0), {Arc}), "the arc goes as far to either side of the x axis");
  archive.required("points", d.points, only(any(kLength).items(3, 3), {Triangle}), "corners");
  archive.required("points", d.points, only(any(kLength).items(3, 32), {Polygon}), "corners of a plane convex polygon, in order");
  archive.required("points", d.points, only(any(kLength).items(2, 4), {Curve}),
                   "control points of a Bezier curve: 2 for a line, 3 quadratic, 4 cubic");
  archive.required("semi_axes", d.semi_axes, only(above(0.0, kLength), {Ellipsoid, Superquadric}), "of the support, along x, y, z");
  archive("exponents", d.exponents, only(between(0.2, 1.0, kNumber).items(2, 2), {Superquadric}),
          "e1 (seen from the side) and e2 (seen from above): 1 is round, 0.2 nearly square");
  archive.required("radii", d.radii, only(above(0.0, kLength), {Directed}), "of the support, along x, y, z");
  archive("radii_behind", d.radii_behind, only(above(0.0, kLength), {Directed}), "along -x, -y, -z; absent: as radii");
  archive("end_radius", d.end_radius, only(above(0.0, kLength), {Segment, Curve}),
          "support radius at the end, kernel.radius being that at the beginning; absent: the same");
  archive("convolve", d.convolve, only({}, {Segment, Triangle, Polygon, Ring, Arc}),
          "integrate the kernel over the shape, so that shapes that share ends join without a bulge; kernels wyvill, murakami, cauchy");
  archive("stretch", d.stretch, between(1e-3, 1e3, kNumber), "of shape and support along the primitive's axes");
  archive("at", d.at, any(kLength), "offset in the particle's frame");
  archive("turn_axis", d.turn_axis, direction(), "in the particle's frame, with turn_deg");
  archive("turn_deg", d.turn, degrees(-360.0, 360.0), "rotation in the particle's frame");
  archive("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
          "which particles carry it, from 0, negative from the end; absent: all");
  archive("volume", d.volume, above(0.0, kVolume), "held by each of its copies, where the object's volume is held by primitive; absent: as the object says");
  archive.required("kernel", d.kernel, {}, "how the field falls off");
  const bool own_scale = d.shape == Ellipsoid || d.shape == Superquadric || d.shape == Directed;
  check_points(archive, d);
  archive.check(!d.convolve || d.end_radius == 0.0, "convolve", "expected no end_radius with convolve", "one", "");
  const bool closed_form = d.kernel.type == KernelName::Wyvill || d.kernel.type == KernelName::Murakami || d.kernel.type == KernelName::Cauchy;
  archive.check(!d.convolve || closed_form, "kernel.type", "expected one of wyvill, murakami, cauchy with convolve",
                '\'' + std::string(name_of(d.kernel.type)) + '\'', "");
  archive.check(d.kernel.radius > 0.0 || own_scale, "kernel.radius", "expected a length > 0 [m]", "nothing",
                "this key is required");
}

template <class Archive>
void fields(Archive& archive, BlendGroupDesc& d) {
  archive.required("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
                   "from 0, negative from the end");
}

template <class Archive>
void fields(Archive& archive, BlendDesc& d) {
  using enum BlendName;
  const auto only = [&d](const Rule& rule, std::initializer_list<BlendName> rules) { return rule.only("rule", d.rule, rules); };
  archive("rule", d.rule, {},
          "sum: everything blends; graph: what neighbours or within name blends, the rest meets in a crease; ricci: the n-norm; "
          "gradient: surfaces blend where they run into each other and not where they are parallel or face each other");
  archive("groups", d.groups, {}, "particles of one group sum; particles in none are groups of their own");
  archive("neighbours", d.neighbours, only(between(1.0, 1000.0, kNumber), {Graph}),
          "groups blend that hold particles up to this many apart in their order");
  archive("within", d.within, only(above(0.0, kLength), {Graph}), "or particles nearer than this at rest");
  archive("exponent", d.exponent, only(between(1.0, 100.0, kNumber), {Ricci}), "n: 1 is the sum, a large one nearly the union");
  archive("opening", d.opening, only(between(0.05, 0.95, kNumber), {Gradient}),
          "where surfaces cross at right angles: small blends widely, 1 would be the union");
  archive("fade", d.fade, only(at_least(0.0, kTime), {Graph}),
          "how long particles still blend, less and less, after the bond between them broke; pieces part when it has faded");
}

template <class Archive>
void fields(Archive& archive, VolumeDesc& d) {
  archive("of", d.of, {}, "object: one scale for all its kernels; particle: the part of the body in which the particle's share of the field is the largest, a scale for its own kernels; primitive: the same for every primitive");
  archive("target", d.target, above(0.0, kVolume).or_auto(), "V0; auto: the volume at the start");
  archive("rate", d.rate, up_to(1000.0, kRate), "alpha: kernels grow by alpha (V0 - V) / V0");
  archive("damping", d.damping, between(0.0, 0.15, kNumber), "beta: against change of the volume");
}

template <class Archive>
void fields(Archive& archive, MaterialDesc& d) {
  archive("modulus", d.modulus, above(0.0, kPressure), "P0: pressure is P0 (f - iso)");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient; a pair has sqrt(mu_A mu_B)");
  archive("dissipation", d.dissipation, at_least(0.0, kInverseSpeed), "Hunt & Crossley d; 1/d is the largest speed of a bounce");
}

template <class Archive>
void fields(Archive& archive, KindDesc& d) {
  archive("hinge", d.hinge, {}, "joins what is around it");
  archive("type", d.type, between(0.0, kMostCount, kNumber), "of standard particles; those of different types only repel");
  archive.required("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
                   "from 0, negative from the end");
  archive.check(!(d.hinge && archive.given("type")), "type", "expected either hinge or type", "both", "");
}

template <class Archive>
void fields(Archive& archive, RepulsionDesc& d) {
  archive.required("force", d.force, above(0.0, kForce), "at the distance d0");
  archive.required("distance", d.distance, above(0.0, kLength), "d0");
  archive.required("length", d.length, above(0.0, kLength), "over which the force falls by e");
  archive("own", d.own, {}, "also between all particles of the object; without it, only between those that kinds keep apart");
}

template <class Archive>
void fields(Archive& archive, MediumDesc& d) {
  archive("linear", d.linear, at_least(0.0, kRate), "gamma: force -gamma m v");
  archive("angular", d.angular, at_least(0.0, kRate), "gamma_r: torque -gamma_r I omega");
}

template <class Archive>
void fields(Archive& archive, BreakingDesc& d) {
  archive("stretch", d.stretch, above(0.0, kNumber), "d / d0 - 1 of the pair");
  archive("energy", d.energy, above(0.0, kEnergy), "of all laws of the pair");
  archive("force", d.force, above(0.0, kForce), "tension F_c; with couple: F / F_c + (M / M_c)^2 > 1 breaks");
  archive("couple", d.couple, above(0.0, kTorque), "M_c, on either particle");
  archive.check(d.stretch || d.energy || d.force || d.couple, "", "expected stretch, energy, force or couple", "none of them", "");
}

template <class Archive>
void fields(Archive& archive, YieldingDesc& d) {
  archive.required("energy", d.energy, at_least(0.0, kEnergy), "of a bond frame, from which it flows");
  archive("time", d.time, at_least(0.0, kTime), "in which the rest pose follows to 1/e; 0: at once");
}

template <class Archive>
void fields(Archive& archive, RayleighDesc& d) {
  archive("mass", d.mass, at_least(0.0, kRate), "alpha: drag -alpha M q', as of a medium");
  archive("stiffness", d.stiffness, at_least(0.0, kTime), "beta: -beta K q' against deformation; a mode gets the ratio beta omega / 2");
}

template <class Archive>
void fields(Archive& archive, PinDesc& d) {
  archive.required("particle", d.particle, between(-kMostCount, kMostCount, kNumber), "from 0; negative counts from the end");
  archive("position", d.position, {}, "held");
  archive("orientation", d.orientation, {}, "held");
}

template <class Archive>
void fields(Archive& archive, LoadDesc& d) {
  archive.required("particle", d.particle, between(-kMostCount, kMostCount, kNumber), "from 0; negative counts from the end");
  archive("force", d.force, any(kForce), "world axes");
  archive("torque", d.torque, any(kTorque), "world axes");
  archive("from", d.from, at_least(0.0, kTime), "begin");
  archive("until", d.until, above(0.0, kTime), "end; absent: never");
  archive("ramp", d.ramp, at_least(0.0, kTime), "linear rise and fall inside the window");
  archive.check(d.until > d.from, "until", "expected more than from = " + number_text(d.from) + " [s]", number_text(d.until), "");
}

/// How many particles there are; none when a file decides.
[[nodiscard]] inline std::optional<int> particle_count(const ParticlesDesc& d) {
  switch (d.arrange) {
    case ArrangeKind::Single: return 1;
    case ArrangeKind::Line:
    case ArrangeKind::Ring:
    case ArrangeKind::Spiral: return d.count;
    case ArrangeKind::Grid:
      if (double(d.columns) * d.rows * d.layers > kMostCount) break;
      return d.columns * d.rows * d.layers;
    case ArrangeKind::Geodesic: return 10 * d.frequency * d.frequency + 2;
    case ArrangeKind::File: break;
  }
  return std::nullopt;
}

/// Particles that pins, loads and primitives name are there.
template <class Archive>
void check_particles(Archive& archive, const ObjectDesc& d) {
  const std::optional<int> count = particle_count(d.particles);
  if (!count) return;
  const auto check = [&](const std::string& key, int particle) {
    archive.check(particle >= -*count && particle < *count, key, particle_range(static_cast<std::uint32_t>(*count)),
                  std::to_string(particle), "");
  };
  for (std::size_t k = 0; k < d.pins.size(); ++k) check("pins[" + std::to_string(k) + "].particle", d.pins[k].particle);
  for (std::size_t k = 0; k < d.loads.size(); ++k) check("loads[" + std::to_string(k) + "].particle", d.loads[k].particle);
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

template <class Archive>
void fields(Archive& archive, ObjectMeshingDesc& d) {
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of its meshes and grids; auto: as output.cell");
  archive("error", d.error, above(0.0, kLength).or_auto(), "as output.meshing.error, which it replaces");
}

template <class Archive>
void fields(Archive& archive, ObjectDesc& d) {
  archive.required("name", d.name, identifier(), "unique; objects are numbered in the order of their names");
  archive.required("particles", d.particles, {}, "who is there");
  archive("separate", d.separate, {}, "each particle is a body of its own, which touches the others");
  archive("kinds", d.kinds, {}, "hinges and types; particles not named are standard, of type 0");
  archive("hinges_join", d.hinges_join, {}, "whether the interactions act between two hinges");
  archive("interactions", d.interactions, {}, "what holds them together");
  archive("skeleton", d.skeleton, {}, "what they look like; without it the object has no surface");
  archive("iso", d.iso, inside(0.0, 1.0, kNumber), "value of the field on the surface");
  archive("blend", d.blend, {}, "how the surfaces of its particles join; absent: as the sum");
  archive("volume", d.volume, {}, "held by growing and shrinking the kernels (Desbrun & Gascuel 1995); absent: not held");
  archive("contact", d.contact, {}, "what the surface does on contact; absent or false: it touches nothing");
  archive("repulsion", d.repulsion, {}, "exponential repulsion from other objects that have it, where contact is off");
  archive("medium", d.medium, {}, "drag of a surrounding medium; absent: none");
  archive("breaking", d.breaking, {}, "when bonded pairs come apart; absent: never. What no bond joins any more is a body of its own");
  archive("yielding", d.yielding, {}, "when bond frames take the present pose as their rest pose; absent: never");
  archive("rayleigh", d.rayleigh, {}, "damping of motion and deformation by alpha M + beta K; absent: none");
  archive("pins", d.pins, {}, "particles that do not move");
  archive("loads", d.loads, {}, "external forces and torques");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("roughness", d.roughness, up_to(1.0, kNumber), "of the drawn surface");
  archive("look", d.look, {}, "what else its pictures show");
  archive("meshing", d.meshing, {}, "cell and error of its own; where objects touch, the smallest of theirs hold for all of them");
  archive.check(!(d.meshing.cell || d.meshing.error) || !d.skeleton.empty(), "meshing", "expected a skeleton, whose surface it divides", "none",
                "add 'skeleton' or remove 'meshing'");
  archive.check(!d.separate || (d.interactions.empty() && d.kinds.empty()), "separate",
                "expected no interactions or kinds in an object of separate bodies", "some",
                "remove them, or 'separate'");
  archive.check(!d.volume || !d.skeleton.empty(), "volume", "expected a skeleton, whose volume it is", "none", "");
  archive.check(!d.volume || (!d.breaking && !d.separate), "volume", "expected an object that stays one body",
                d.breaking ? "'breaking'" : "'separate'", "");
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    archive.check(!d.skeleton[k].volume || (d.volume && d.volume->of == VolumeOfName::Primitive), "skeleton[" + std::to_string(k) + "].volume",
                  "expected the object's volume to be held by primitive", d.volume ? std::string(name_of(d.volume->of)) : "not held",
                  "add 'volume: {of: primitive}'");
  }
  archive.check(!d.blend || d.blend->fade == 0.0 || d.breaking, "blend.fade", "expected 'breaking' for bonds that fade", "none", "");
  archive.check(!d.breaking || !d.interactions.empty(), "breaking", "expected interactions that can break", "none",
                "add 'interactions' or remove 'breaking'");
  archive.check(!(d.breaking && literal_laws(d)), "breaking", "expected no law with paper_literal, which has no energy", "one", "");
  archive.check(!d.contact || !d.skeleton.empty(), "contact", "expected a skeleton for contact", "none",
                "add 'skeleton' or remove 'contact'");
  check_particles(archive, d);
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    const KernelDesc& kernel = d.skeleton[k].kernel;
    if (kernel.type != KernelName::Gascuel || !kernel.slope || !kernel.thickness || kernel.radius <= 0.0) continue;
    const double width = kernel.radius - *kernel.thickness;
    archive.check(*kernel.slope * width <= 3.0 * d.iso, "skeleton[" + std::to_string(k) + "].kernel.slope",
                  "expected slope (radius - thickness) <= 3 iso = " + number_text(3.0 * d.iso),
                  short_text(*kernel.slope * width), "use a slope of at most " + short_text(3.0 * d.iso / width) + " [1/m]");
  }
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
  archive("rule", d.rule, {}, "points of the contact surface: along the seeds' rays, in polar rings about the peak, in tetrahedra; auto: the cheapest that fits");
  archive("split", d.split, {}, "how forces reach the particles: gradient of the contact energy, or by contribution");
  archive("core", d.core, {}, "soft: bodies pressed too hard pass one another, which is reported; barrier: deep cores turn back what approaches");
  archive("friction_speed", d.friction_speed, above(0.0, kSpeed), "below it Coulomb friction fades out");
  archive("stick", d.stick, {}, "friction by springs that hold up to the Coulomb limit: what should stay stays; absent: it creeps");
  archive("bulge", d.bulge, between(0.0, 1.0, kNumber), "height of the bulge beside a contact over its depth; 0: none");
  archive("bulge_volume", d.bulge_volume, {}, "in place of 'bulge': as high as holds the volume that the contact displaces");
  archive("bulge_width", d.bulge_width, up_to(1.0, kNumber), "share of the other body's feature size");
  archive("bulge_literal", d.bulge_literal, {}, "as published: by distance instead of pressure, of one width; it pops up at first touch and bulges may cross");
  archive("sample_spacing", d.sample_spacing, above(0.0, kLength).or_auto(), "of the surface samples; auto: a sixth of the smallest feature");
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
void fields(Archive& archive, ImagesDesc& d) {
  archive("size", d.size, between(16.0, 16384.0, kNumber).items(2, 2), "width, height [pixel]");
  archive("samples", d.samples, between(1.0, 8.0, kNumber), "a pixel: 1, 2, 4 or 8");
  archive("formats", d.formats, {}, "exr: half floats, light before exposure and tone curve times cover, cover, depth, normals, velocities and numbers of objects");
  archive.check(!d.formats.empty(), "formats", "expected a format of images", "none", "write 'images: false' for no images");
  archive.check((d.samples & (d.samples - 1)) == 0, "samples", "expected 1, 2, 4 or 8", std::to_string(d.samples), "");
}

template <class Archive>
void fields(Archive& archive, MeshingDesc& d) {
  using enum MeshingName;
  const auto only = [&d](const Rule& rule) { return rule.only("method", d.method, {Delaunay}); };
  archive("method", d.method, {}, "of objects that touch no other (those that do are divided by tetrahedra, to the same error; delaunay refines what bounds them, too); auto: cubes or openvdb, whichever costs less by counts, and vertices on the creases of blending graphs; openvdb: through a grid; delaunay: triangles of guaranteed quality, needs the component supple_cgal");
  archive("error", d.error, above(0.0, kLength).or_auto(), "largest distance of a triangle's centroid to the surface, for cubes and where objects touch; auto: by the cell");
  archive("angle_deg", d.angle, only(degrees(1.0, 30.0)), "least angle of a triangle");
  archive("size", d.size, only(above(0.0, kLength).or_auto()), "largest radius of a ball through a triangle's corners around a point of the surface; auto: two cells");
  archive("distance", d.distance, only(above(0.0, kLength).or_auto()), "from a triangle's circumcentre to that point; auto: a tenth of the size");
  archive("motion", d.motion, {}, "columns velocity_x, velocity_y, velocity_z [m/s] and owner (number of the particle) in mesh files");
  archive.check(!d.error || d.method == Auto || d.method == Cubes, "error", "expected method auto or cubes with an error",
                std::string(name_of(d.method)), "leave out 'method'");
}

template <class Archive>
void fields(Archive& archive, GriddingDesc& d) {
  archive("of", d.of, {}, "a grid of each object under its name, one of all named 'scene', or both");
  archive("content", d.content, {}, "signed distance near the surface to first order, or the field");
  archive("half_width", d.half_width, between(1.0, 100.0, kNumber), "of the band on each side of the surface, in cells");
}

template <class Archive>
void fields(Archive& archive, SamplingDesc& d) {
  archive("spacing", d.spacing, above(0.0, kLength).or_auto(),
          "no two samples of an object are nearer than half of it, no place of its surface is farther than it from all; auto: four times output.cell");
  archive("density", d.density, above(0.0, kInverseArea), "instead: samples a square metre, to a tenth where the surface is smooth and at rest");
  archive.check(!(d.spacing && d.density), "density", "expected either spacing or density", "both", "");
}

template <class Archive>
void fields(Archive& archive, FilmDesc& d) {
  archive("frame_rate", d.frame_rate, between(0.1, 1000.0, kRate).or_auto(),
          "frames a second of the film; auto: the scene's; less is slow motion");
}

template <class Archive>
void fields(Archive& archive, OutputDesc& d) {
  archive("images", d.images, {}, "a PNG a frame");
  archive("film", d.film, {}, "an MP4 of the images, by ffmpeg");
  archive("contacts", d.contacts, {}, "points of the contact surfaces, and of every pair that touches force, area, energy and dissipation, a frame; vtk: .vtp files and a .pvd each");
  archive("particles", d.particles, {}, "particles and bonds a frame; vtk: .vtp files and a .pvd");
  archive("samples", d.samples, {}, "points spread evenly over the surfaces a frame, which ride on their particles: id, owner, normal and area; as if nothing touched; vtk: .vtp files and a .pvd");
  archive("mesh", d.mesh, {}, "surfaces; ply, obj: a file an object and frame; usd: one file with all frames");
  archive("grid", d.grid, {}, "fields a frame");
  archive("meshing", d.meshing, {}, "how surfaces become meshes");
  archive("gridding", d.gridding, {}, "how fields become grids");
  archive("sampling", d.sampling, {}, "how far apart samples are");
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of meshes and grids of objects without 'meshing.cell'; auto: 8 cells across the smallest thickness of these, 64 along each");
  archive.check(!d.film || !d.images || std::count(d.images->formats.begin(), d.images->formats.end(), ImageName::Png) > 0, "film",
                "expected images as png for a film", "none", "add png to output.images.formats");
  archive.check(!d.film || d.images, "film", "expected images for a film", "none", "add 'images: true' under output");
}

template <class Archive>
void fields(Archive& archive, ObstacleKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "when it is there");
  archive("at", d.at, any(kLength), "as of the obstacle");
  archive("turn_deg", d.turn, degrees(-36000.0, 36000.0), "of boxes and meshes, about turn_axis");
}

template <class Archive>
void fields(Archive& archive, ObstacleDesc& d) {
  using enum ObstacleName;
  const auto only = [&d](const Rule& rule, std::initializer_list<ObstacleName> shapes) { return rule.only("shape", d.shape, shapes); };
  archive.required("name", d.name, identifier(), "unique, also among the objects");
  archive("shape", d.shape, {}, "plane, box, heights over x and y, or a closed mesh");
  archive("at", d.at, any(kLength), "a point of the plane, the middle of the box, added to heights and meshes");
  archive("normal", d.normal, only(direction(), {Plane}), "out of the solid");
  archive("extent", d.extent, only(above(0.0, kLength), {Plane}), "half the edge of the square that is drawn");
  archive.required("half_sizes", d.half_sizes, only(above(0.0, kLength), {Box}), "along its x, y, z");
  archive("rounding", d.rounding, only(at_least(0.0, kLength), {Box}), "radius of its edges in contact");
  archive("turn_axis", d.turn_axis, only(direction(), {Box, ObstacleName::Mesh}), "with turn_deg");
  archive("turn_deg", d.turn, only(degrees(-360.0, 360.0), {Box, ObstacleName::Mesh}), "rotation");
  archive("keys", d.keys, {}, "places at times; before the first and after the last it stands still; absent: always");
  archive("between", d.between, {}, "how keys are joined; smooth: at rest wherever it turns back, so that it never goes beyond a key");
  archive.required("file", d.file, only({}, {Heights, ObstacleName::Mesh}), "CSV of x, y, z [m] on a regular grid; a mesh as OBJ or PLY [m]; relative to the scene's folder");
  archive("voxel", d.voxel, only(above(0.0, kLength).or_auto(), {ObstacleName::Mesh}), "cell of the lattice that keeps its distances, about which edges are rounded; auto: a 64th of its longest side");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("roughness", d.roughness, up_to(1.0, kNumber), "of the drawn surface");
  archive("texture", d.texture, {}, "by the obstacle's own axes from 'at'; absent: none");
  archive("visible", d.visible, {}, "drawn");
  archive("modulus", d.modulus, above(0.0, kPressure), "P: pressure is modulus times slope times depth");
  archive("slope", d.slope, above(0.0, kSlope), "of its field");
  archive("friction", d.friction, between(0.0, 100.0, kNumber), "Coulomb coefficient");
  for (std::size_t k = 0; k < d.keys.size(); ++k) {
    const std::string key = "keys[" + std::to_string(k) + ']';
    archive.check(k == 0 || d.keys[k - 1].time < d.keys[k].time, key + ".time", "expected a later time than the key before",
                  number_text(d.keys[k].time), "");
    archive.check(d.keys[k].turn == 0.0 || d.shape == Box || d.shape == ObstacleName::Mesh, key + ".turn_deg",
                  "expected a box or a mesh that turns", std::string(name_of(d.shape)), "");
  }
  archive.check(d.keys.empty() || !(archive.given("at") || archive.given("turn_deg")), "keys", "expected either keys or at and turn_deg",
                "both", "");
  archive.check(d.shape != Box || d.rounding <= d.half_sizes.minCoeff(), "rounding", "expected at most the least half size",
                number_text(d.rounding), "");
}

/// Names of objects and obstacles are unique, none is "ground", and pairs name what is there.
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
  if (index.contains("")) return;  // a name is missing, so nothing can be said about pairs
  std::vector<std::string_view> names;
  for (const auto& [name, place] : index) names.push_back(name);
  if (d.ground) names.emplace_back("ground");
  std::map<std::pair<std::string, std::string>, std::size_t> pairs;
  for (std::size_t k = 0; k < d.pairs.size(); ++k) {
    std::vector<std::string> two = d.pairs[k].objects;
    const std::string key = "pairs[" + std::to_string(k) + "].objects";
    for (std::size_t side = 0; side < two.size(); ++side) {
      const bool known = index.contains(two[side]) || (two[side] == "ground" && d.ground);
      const std::string near = known ? "" : nearest_word(two[side], names);
      archive.check(known, key + '[' + std::to_string(side) + ']', "expected the name of an object", '\'' + shown(two[side]) + '\'',
                    (near.empty() ? "" : "did you mean '" + near + "'? ") + "(known: " + shown(joined(names)) + ")");
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
      const std::string when = " in frame " + std::to_string(frame);
      const bool apart = sight.norm() > 0.0;
      archive.check(apart, key, "expected 'from' apart from 'look_at' at all times", "one point" + when, "add a key beside it");
      const bool across = sight.cross(at.up).norm() > 1e-6 * sight.norm() * at.up.norm();
      archive.check(!apart || across, key, "expected a line of sight across 'up' at all times", "one along it" + when, "choose another 'up'");
      if (!apart || !across) break;
    }
  }
  for (std::size_t i = 0; i < d.cameras.size(); ++i) {
    const std::string key = "cameras[" + std::to_string(i) + "].name";
    archive.check(!d.cameras[i].name.empty(), key, "expected a name", "nothing", "this key is required");
    for (std::size_t k = 0; k < i; ++k)
      archive.check(d.cameras[k].name != d.cameras[i].name, key, "expected a unique name", '\'' + shown(d.cameras[i].name) + '\'',
                    "cameras[" + std::to_string(k) + "] has it already");
  }
}

template <class Archive>
void fields(Archive& archive, Scene& d) {
  archive.required("schema", d.schema, between(1.0, 1.0, kNumber), "version of this format");
  archive("title", d.title, {}, "for people");
  archive.required("duration", d.duration, above(0.0, kTime), "of the animation; frame n shows t = (n - 1) / frame_rate");
  archive("frame_rate", d.frame_rate, above(0.0, kRate), "frames a second");
  archive("gravity", d.gravity, any(kAcceleration), "z is up");
  archive("planar", d.planar, {}, "particles keep their z, which must be one for all, and turn about z only");
  archive("time_step", d.time_step, {}, "how finely time is cut");
  archive("integrator", d.integrator, {}, "how a step is made");
  archive.required("objects", d.objects, Rule{}.items(1, 100000), "who is there");
  archive("obstacles", d.obstacles, {}, "solids that stand still or are led along");
  archive("pairs", d.pairs, {}, "what two objects do that differs from their materials");
  archive("contact", d.contact, {}, "how contact is computed");
  archive("sleep", d.sleep, {}, "bodies that rest are not moved until something touches them or a load on them changes; absent: never");
  archive("camera", d.camera, {}, "who looks on");
  archive("cameras", d.cameras, {}, "several onlookers, instead of 'camera': images NAME.CAMERA.0001.png and a film each");
  archive("light", d.light, {}, "the sun");
  archive("lights", d.lights, {}, "rectangles that shine; OpenGL takes the first four");
  archive("background", d.background, {}, "behind everything, from top to bottom");
  archive("render", d.render, {}, "how pictures are made");
  archive("ground", d.ground, {}, "a horizontal plane; absent: none");
  archive("output", d.output, {}, "what is written");
  archive.check(d.duration * d.frame_rate <= 1e6, "duration", "expected at most 1000000 frames",
                number_text(std::floor(d.duration * d.frame_rate)), "");
  archive.check(!d.time_step.size || *d.time_step.size * d.frame_rate * kMostSubsteps >= 1.0, "time_step.size",
                "expected at least " + short_text(1.0 / (d.frame_rate * kMostSubsteps)) + " s, a frame's time over 2^20",
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
  const bool implicit = d.integrator.method == MethodName::BackwardEuler || d.integrator.method == MethodName::ImplicitMidpoint;
  const bool literal = std::any_of(d.objects.begin(), d.objects.end(), [](const ObjectDesc& o) { return literal_laws(o); });
  archive.check(!(implicit && literal), "integrator.method",
                "expected an explicit method beside a law with paper_literal, which has no energy",
                std::string(name_of(d.integrator.method)), "use 'symplectic' or 'rk4'");
  check_names(archive, d);
  if (d.duration * d.frame_rate <= 1e6) check_cameras(archive, d);
}

}  // namespace supple::scenes
