/// @file tests/implicit/bodies.h
/// Bodies and points for tests, the same on every run.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "supple/implicit/field.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit::testing {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(engine_() % n); }
  Vec3 in_box(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
  Vec3 direction() {
    for (;;) {
      const Vec3 v = in_box(1.0);
      const double n = v.norm();
      if (n > 0.1 && n < 1.0) return v / n;
    }
  }
  Quat rotation() {
    for (;;) {
      const Quat q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      if (q.norm() > 0.1 && q.norm() < 1.0) return q.normalized();
    }
  }

 private:
  std::mt19937_64 engine_;
};

/// A skeleton, the poses of its parts and the field they make.
struct Body {
  Skeleton skeleton;
  std::vector<Pose> parts;
  PlacedSkeleton placed;
  Field field;

  void place() {
    place_skeleton(skeleton, parts, placed);
    index_field(skeleton, placed, field);
  }
};

struct BodyOptions {
  std::uint64_t seed = 1;
  std::uint32_t parts = 12;
  std::uint32_t primitives_per_part = 1;
  double half_width = 1.0;  ///< parts lie in this cube [m]
  double least_radius = 0.3;
  double largest_radius = 0.6;
  bool only_points = false;  ///< Wyvill points instead of many shapes and kernels
  bool every_shape = false;  ///< also those that are measured point by point, tapered and stretched
};

/// Control points, angles, exponents, taper and stretch for a shape of about the size R.
inline void set_details(Primitive& p, Random& random, double R) {
  const auto add = [&](std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) p.control.push_back(random.in_box(R));
  };
  switch (p.shape) {
    case ShapeKind::Triangle: add(3); break;
    case ShapeKind::Polygon: {
      const Quat turn = random.rotation();
      for (const double angle : {0.2, 1.4, 2.5, 4.0, 5.1}) p.control.push_back(R * (turn * Vec3(std::cos(angle), std::sin(angle), 0.0)));
      break;
    }
    case ShapeKind::Curve: add(2 + random.below(3)); break;
    case ShapeKind::Arc: p.size.y() = random.uniform(0.3, 3.1); break;
    case ShapeKind::Superquadric: p.exponent = {random.uniform(0.3, 1.0), random.uniform(0.3, 1.0)}; break;
    case ShapeKind::Directed: p.control = {Vec3(random.uniform(0.5, 1), random.uniform(0.5, 1), random.uniform(0.5, 1)) * R}; break;
    default: break;
  }
  if (random.below(3) == 0) p.taper = random.uniform(0.5, 1.6);
  if (random.below(4) == 0) p.stretch = {random.uniform(0.6, 1.4), random.uniform(0.6, 1.4), random.uniform(0.6, 1.4)};
}

inline Primitive random_primitive(Random& random, const BodyOptions& options, std::uint32_t part) {
  Primitive p;
  p.part = part;
  const double R = random.uniform(options.least_radius, options.largest_radius);
  p.kernel = Kernel::wyvill(R);
  if (options.only_points) return p;
  p.shape = static_cast<ShapeKind>(random.below(options.every_shape ? 13 : 6));
  p.size = Vec3(random.uniform(0.3, 1), random.uniform(0.3, 1), random.uniform(0.3, 1)) * R;
  if (options.every_shape) set_details(p, random, R);
  p.offset.position = random.in_box(0.2 * R);
  p.offset.orientation = random.rotation();
  switch (random.below(10)) {
    case 0: p.kernel = Kernel::soft_object(R); break;
    case 1: p.kernel = Kernel::murakami(R); break;
    case 2: p.kernel = Kernel::nishimura(R); break;
    case 3: p.kernel = Kernel::blinn(R, random.uniform(1.0, 3.0)); break;
    case 4: p.kernel = Kernel::cauchy(R, random.uniform(1.0, 3.0)); break;
    case 5: p.kernel = Kernel::blanc_schlick(R, random.uniform(0.05, 1.0)); break;
    default: break;
  }
  if (p.kernel.kind == KernelKind::Wyvill && random.below(2) == 1) {
    const double e = random.uniform(0.3, 0.7) * R;
    p.kernel = Kernel::gascuel(e, R, random.uniform(0.5, 2.9) * 0.5 / (R - e));
  }
  return p;
}

inline Body random_body(const BodyOptions& options) {
  Random random(options.seed);
  Body body;
  body.skeleton.part_count = options.parts;
  for (std::uint32_t part = 0; part < options.parts; ++part) {
    Pose pose;
    pose.position = random.in_box(options.half_width);
    pose.orientation = random.rotation();
    body.parts.push_back(pose);
    for (std::uint32_t k = 0; k < options.primitives_per_part; ++k) {
      body.skeleton.primitive.push_back(random_primitive(random, options, part));
    }
  }
  body.place();
  return body;
}

/// Primitives of one kind, turned and some of them stretched, each a part of its own.
struct KindOptions {
  std::uint64_t seed = 1;
  ShapeKind shape = ShapeKind::Point;
  Kernel kernel = Kernel::wyvill(0.5);
  double taper = 1.0;
  bool convolved = false;  ///< none is stretched then
};
inline constexpr std::uint32_t kPartsOfAKind = 24;
inline Body body_of_kind(const KindOptions& kind) {
  Random random(kind.seed);
  Body body;
  body.skeleton.part_count = kPartsOfAKind;
  for (std::uint32_t i = 0; i < kPartsOfAKind; ++i) {
    Primitive p;
    p.part = i;
    p.shape = kind.shape;
    p.kernel = kind.kernel;
    p.convolved = kind.convolved;
    p.size = 0.5 * Vec3(random.uniform(0.3, 1), random.uniform(0.3, 1), random.uniform(0.3, 1));
    set_details(p, random, 0.5);
    p.taper = kind.taper;
    if (kind.convolved) p.stretch = Vec3::Ones();
    body.skeleton.primitive.push_back(p);
    body.parts.push_back({random.in_box(0.9), random.rotation()});
  }
  body.place();
  return body;
}

/// Primitives given in world axes, one part each.
inline Body body_of(const std::vector<std::pair<Primitive, Vec3>>& primitives) {
  Body body;
  for (const auto& [primitive, position] : primitives) {
    body.skeleton.primitive.push_back(primitive);
    body.skeleton.primitive.back().part = body.skeleton.part_count++;
    body.parts.push_back(Pose{position, Quat::Identity()});
  }
  body.place();
  return body;
}

inline Primitive wyvill_point(double radius) {
  Primitive p;
  p.kernel = Kernel::wyvill(radius);
  return p;
}

inline std::vector<Vec3> random_points(std::uint64_t seed, std::size_t count, double half_width) {
  Random random(seed);
  std::vector<Vec3> points(count);
  for (Vec3& p : points) p = random.in_box(half_width);
  return points;
}

}  // namespace supple::implicit::testing
