/// @file fields_shapes.h
/// The keys of skeletons, kernels and blending; see fields.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <string>
#include <vector>

#include "file/fields/fields_particles.h"
#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"
#include "supple/core/math.h"
#include "supple/implicit/kernel.h"

namespace supple::scenes {

template <class Archive>
void fields(Archive& archive, KernelDesc& d) {
  using enum KernelName;
  archive("type", d.type, {}, "wyvill: (1 - d^2/R^2)^3; gascuel: linear down to the thickness, then cubic; murakami: (1 - d^2/R^2)^2; "
                              "blinn: Gaussian; the others as in their papers; all are 0 beyond R");
  archive("radius", d.radius, above(0.0, kLength), "support R; required, except for shapes that give the support themselves (ellipsoid, superquadric, directed), where it is their smallest semi-axis or radius; another value scales thickness and slope of gascuel there, and changes nothing for other kernels");
  archive.required("thickness", d.thickness, above(0.0, kLength).only("type", d.type, {Gascuel}), "e: distance from the shape to the surface");
  archive.required("slope", d.slope, above(0.0, kSlope).only("type", d.type, {Gascuel}),
                   "slope at the surface; slope (radius - thickness) <= 3 iso");
  archive("sharpness", d.sharpness,
          between(implicit::Kernel::kLeastSharpness, implicit::Kernel::kLargestSharpness, kNumber).only("type", d.type, {Blinn, Cauchy}),
          "s of exp(-s^2 d^2/R^2) (blinn) and (1 + s^2 d^2/R^2)^-2 (cauchy); the tangent at R is subtracted");
  archive("hardness", d.hardness,
          between(implicit::Kernel::kLeastHardness, implicit::Kernel::kLargestHardness, kNumber).only("type", d.type, {BlancSchlick}),
          "p: the slope at R/2 is 2 + 16 p/9, over R");
  if (d.thickness && d.radius > 0.0) {
    archive.check(*d.thickness < d.radius, "thickness", "expected less than radius = " + number_text(d.radius) + " [m]",
                  number_text(*d.thickness), "");
  }
}

/// Checks that corners span an area and control points a line; polygons must be plane and convex.
template <class Archive>
void check_points(Archive& archive, const SkeletonDesc& d) {
  using enum ShapeName;
  const std::vector<Vec3>& p = d.points;
  const std::size_t n = p.size();
  if (d.shape == Curve && n >= 2) {
    double length = 0.0;
    for (std::size_t i = 1; i < n; ++i) length += (p[i] - p[i - 1]).norm();
    archive.check(length > 0.0, "points", "expected a curve of length > 0 [m]", number_text(length), "");
  }
  if ((d.shape != Triangle && d.shape != Polygon) || n < 3) return;
  Vec3 area = Vec3::Zero();
  double largest = 0.0;
  for (std::size_t i = 1; i + 1 < n; ++i) area += 0.5 * (p[i] - p[0]).cross(p[i + 1] - p[0]);
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, (p[i] - p[0]).norm());
  const double least = 1e-9 * largest * largest;
  const bool spans = area.norm() > least;
  archive.check(spans, "points", "expected corners that span an area > " + short_text(least) + " m^2, 1e-9 of their largest distance squared",
                number_text(area.norm()) + " m^2", "");
  if (!spans || d.shape == Triangle) return;
  const Vec3 normal = area.normalized();
  double turned = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& here = p[i];
    const Vec3 ahead = p[(i + 1) % n] - here, next = p[(i + 2) % n] - p[(i + 1) % n];
    const double off = std::abs(normal.dot(here - p[0]));
    const std::string key = "points[" + std::to_string(i) + ']';
    archive.check(off <= 1e-9 * largest, key, "expected a corner in the plane of the others", short_text(off) + " m off it", "");
    archive.check(ahead.norm() > 0.0, key, "expected a distance > 0 [m] to the next corner", number_text(ahead.norm()), "");
    const double turn = math::atan2(normal.dot(ahead.cross(next)), ahead.dot(next));
    archive.check(normal.dot(ahead.cross(next)) >= -1e-12 * largest * largest, key,
                  "expected corners of a convex polygon, in order, with a turn >= 0 [deg] after this edge",
                  short_text(turn * 180.0 / std::numbers::pi), "");
    turned += turn;
  }
  archive.check(turned < 3.0 * std::numbers::pi, "points", "expected corners of a convex polygon, in order", "edges that cross", "");
}

template <class Archive>
void fields(Archive& archive, SkeletonDesc& d) {
  using enum ShapeName;
  const auto only = [&d](const Rule& rule, std::initializer_list<ShapeName> shapes) {
    return rule.only("shape", d.shape, shapes);
  };
  archive.required("shape", d.shape, {}, "shape that the kernel thickens; flat shapes lie in their x-y plane");
  archive.required("half_size", d.half_size, only(above(0.0, kLength), {Square}), "half an edge");
  archive.required("half_length", d.half_length, only(above(0.0, kLength), {Segment}), "along x");
  archive.required("half_sizes", d.half_sizes, only(above(0.0, kLength).items(d.shape == Box ? 3 : 2, d.shape == Rectangle ? 2 : 3), {Rectangle, Box}),
                   "along x, y (and z for a box)");
  archive.required("radius", d.radius, only(above(0.0, kLength), {Disc, Ring, Arc}), "radius of the disc or circle");
  archive.required("half_angle_deg", d.half_angle, only(degrees(0.1, 180.0), {Arc}), "half the angle of the arc, whose middle is on the x axis");
  archive.required("points", d.points, only(any(kLength).items(3, 3), {Triangle}), "corners");
  archive.required("points", d.points, only(any(kLength).items(3, 32), {Polygon}), "corners of a plane convex polygon, in order");
  archive.required("points", d.points, only(any(kLength).items(2, 4), {Curve}),
                   "control points of a Bezier curve: 2 for a line, 3 quadratic, 4 cubic");
  archive.required("semi_axes", d.semi_axes, only(above(0.0, kLength), {Ellipsoid, Superquadric}), "of the support, along x, y, z");
  archive("exponents", d.exponents, only(between(0.2, 1.0, kNumber).items(2, 2), {Superquadric}),
          "e1 (seen from the side) and e2 (seen from above): 1 is round, 0.2 nearly square");
  archive.required("radii", d.radii, only(above(0.0, kLength), {Directed}), "of the support, along x, y, z");
  archive("radii_behind", d.radii_behind, only(above(0.0, kLength), {Directed}), "of the support, along -x, -y, -z; absent: as radii");
  archive("end_radius", d.end_radius, only(above(0.0, kLength), {Segment, Curve}),
          "support radius at the end; kernel.radius is that at the beginning; absent: kernel.radius");
  archive("convolve", d.convolve, only({}, {Segment, Triangle, Polygon, Ring, Arc}),
          "integrates the kernel over the shape, so that shapes with common ends join without a bulge; for kernels wyvill, murakami and cauchy");
  archive("stretch", d.stretch, between(1e-3, 1e3, kNumber), "factors of shape and support along the primitive's axes");
  archive("at", d.at, any(kLength), "offset in the particle's frame");
  archive("turn_axis", d.turn_axis, direction(), "axis of turn_deg, in the particle's frame");
  archive("turn_deg", d.turn, degrees(-360.0, 360.0), "rotation about turn_axis, in the particle's frame");
  archive("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
          "numbers of the particles that carry it: from 0, negative from the end; absent: all");
  archive("volume", d.volume, above(0.0, kVolume), "target volume of each copy, with volume: {of: primitive}; absent: the object's");
  archive.required("kernel", d.kernel, {}, "field as a function of the distance to the shape");
  const bool own_scale = d.shape == Ellipsoid || d.shape == Superquadric || d.shape == Directed;
  check_points(archive, d);
  archive.check(!d.convolve || d.end_radius == 0.0, "convolve", "expected no end_radius with convolve", "one", "");
  const bool closed_form = d.kernel.type == KernelName::Wyvill || d.kernel.type == KernelName::Murakami || d.kernel.type == KernelName::Cauchy;
  archive.check(!d.convolve || closed_form, "kernel.type", "expected one of wyvill, murakami, cauchy with convolve",
                '\'' + std::string(name_of(d.kernel.type)) + '\'', "");
  archive.check(d.kernel.radius > 0.0 || own_scale || !archive.sound("shape"), "kernel.radius", "expected a length > 0 [m]", "nothing",
                "this key is required");
}

/// Checks that kernels of a given slope, of the primitives under 'skeleton', do not exceed their largest value.
template <class Archive>
void check_slopes(Archive& archive, const std::vector<SkeletonDesc>& skeleton, double iso) {
  for (std::size_t k = 0; k < skeleton.size(); ++k) {
    const KernelDesc& kernel = skeleton[k].kernel;
    if (kernel.type != KernelName::Gascuel || !kernel.slope || !kernel.thickness || kernel.radius <= 0.0) continue;
    const double width = kernel.radius - *kernel.thickness;
    archive.check(*kernel.slope * width <= 3.0 * iso, "skeleton[" + std::to_string(k) + "].kernel.slope",
                  "expected slope (radius - thickness) <= 3 iso = " + short_text(3.0 * iso),
                  short_text(*kernel.slope * width), "use a slope of at most " + short_text(3.0 * iso / width) + " [1/m]");
  }
}

template <class Archive>
void fields(Archive& archive, BlendGroupDesc& d) {
  archive.required("particles", d.particles, Rule{.quantity = kNumber, .low = -kMostCount, .high = kMostCount},
                   "numbers of the particles: from 0, negative from the end");
}

template <class Archive>
void fields(Archive& archive, BlendDesc& d) {
  using enum BlendName;
  const auto only = [&d](const Rule& rule, std::initializer_list<BlendName> rules) { return rule.only("rule", d.rule, rules); };
  archive("rule", d.rule, {},
          "sum: all groups blend; graph: the groups that neighbours or within names blend, the others meet in a crease; ricci: the n-norm; "
          "gradient: surfaces blend where they cross and not where they are parallel or face each other; "
          "the field jumps where the gradient of a group vanishes, such as half way between two of its balls");
  archive("groups", d.groups, {}, "particles of one group sum; a particle in no group is a group of its own");
  archive("neighbours", d.neighbours, only(between(1.0, 1000.0, kNumber), {Graph}),
          "groups blend whose particles' numbers differ by at most this");
  archive("within", d.within, only(above(0.0, kLength), {Graph}), "groups also blend whose particles are nearer than this at rest");
  archive("exponent", d.exponent, only(between(1.0, 100.0, kNumber), {Ricci}), "n: 1 is the sum; a large value is nearly the union");
  archive("opening", d.opening, only(between(0.05, 0.95, kNumber), {Gradient}),
          "where surfaces cross at right angles: a small value blends widely; 1 would be the union");
  archive("fade", d.fade, only(at_least(0.0, kTime), {Graph}),
          "time in which the blend of two particles fades after their bond broke; the pieces are separate bodies from then on");
}

template <class Archive>
void fields(Archive& archive, VolumeDesc& d) {
  archive("of", d.of, {}, "what keeps its volume. object: the whole, with one scale for all kernels; particle: for every particle the region in which its share of the field is the largest, with one scale for its kernels; primitive: the same for every primitive");
  archive("target", d.target, above(0.0, kVolume).or_auto(), "V0; kernels are scaled by 1/4 to 4, and a warning reports a target that is not reached; auto: the volume at the start");
  archive("rate", d.rate, up_to(1000.0, kRate), "alpha: the scale of the kernels grows at the rate alpha (V0 - V) / V0");
  archive("damping", d.damping, between(0.0, 0.15, kNumber), "beta: damping of changes of the volume");
}

}  // namespace supple::scenes
