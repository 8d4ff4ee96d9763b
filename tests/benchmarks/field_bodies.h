/// @file tests/benchmarks/field_bodies.h
/// The bodies that fields and meshes are timed on.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "implicit/bodies.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"
#include "supple/implicit/skeleton.h"

namespace supple::benchmarks {

using namespace supple::implicit;

using implicit::testing::Body;

/// Ten plates along a spiral.
inline Body plate_spiral() {
  Body body;
  body.skeleton.part_count = 10;
  for (std::uint32_t i = 0; i < 10; ++i) {
    Primitive p;
    p.part = i;
    p.shape = ShapeKind::Rectangle;
    p.size = {0.09, 0.09, 0.0};
    p.kernel = Kernel::wyvill(0.16);
    body.skeleton.primitive.push_back(p);
    const double t = i / 9.0;
    const double angle = t * 1.2 * 2.0 * 3.141592653589793;
    const auto [s, c] = math::sin_cos(angle);
    const double radius = 0.15 + 0.4 * t;
    Pose pose;
    pose.position = {radius * c, radius * s, 0.0};
    pose.orientation = Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()) *
                            Eigen::AngleAxisd(3.141592653589793 / 2, Vec3::UnitY()));
    body.parts.push_back(pose);
  }
  body.place();
  return body;
}

/// Parts at random in a deformed ball, one primitive each. @param primitive  called for the kernel radius by which `overlap` balls overlap inside
template <class Make>
Body filled_ball(std::uint32_t count, double overlap, const Make& primitive) {
  std::mt19937_64 engine(7);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  const auto surface = [](const Vec3& u) {
    return 1.0 + 0.2 * math::sin_cos(4.0 * u.x() + 1.0).sin * math::sin_cos(3.0 * u.y()).cos +
           0.15 * math::sin_cos(5.0 * u.z()).sin;
  };
  Body body;
  body.skeleton.part_count = count;
  const double volume = 4.3;  // of the deformed ball, nearly
  const double R = std::cbrt(overlap * volume / (count * 4.0 / 3.0 * 3.141592653589793));
  while (body.parts.size() < count) {
    const Vec3 x = 1.4 * Vec3(uniform(), uniform(), uniform());
    if (x.norm() > surface(x.normalized())) continue;
    Primitive p = primitive(R);
    p.part = static_cast<std::uint32_t>(body.parts.size());
    body.skeleton.primitive.push_back(p);
    body.parts.push_back(Pose{x, Quat::Identity()});
  }
  return body;
}

/// Wyvill blobs such that 30 supports overlap inside.
inline Body blobs(std::uint32_t count) {
  Body body = filled_ball(count, 30.0, [](double R) {
    Primitive p;
    p.kernel = Kernel::wyvill(R);
    return p;
  });
  body.place();
  return body;
}

/// Capsules with Gascuel's kernel, turned every way, such that 30 supports overlap inside, nearly.
inline Body capsules(std::uint32_t count) {
  Body body = filled_ball(count, 20.0, [](double R) {
    Primitive p;
    p.shape = ShapeKind::Segment;
    p.size.x() = 0.4 * R;
    p.kernel = Kernel::gascuel(0.5 * R, R, 1.0 / R);
    return p;
  });
  implicit::testing::Random random(11);
  for (Pose& part : body.parts) part.orientation = random.rotation();
  body.place();
  return body;
}

/// As many primitives as fits have overlap: ellipsoids turned every way, or points of the same volumes in their places.
inline Body ellipsoids(std::uint32_t count, ShapeKind shape = ShapeKind::Ellipsoid) {
  Body body = filled_ball(count, 6.0, [shape](double R) {
    Primitive p;
    p.shape = shape;
    const bool ball = shape == ShapeKind::Point;
    if (!ball) p.size = R * Vec3(1.6, 1.0, 0.625);
    p.kernel = Kernel::wyvill(ball ? R : 0.625 * R);
    return p;
  });
  implicit::testing::Random random(11);
  for (Pose& part : body.parts) part.orientation = random.rotation();
  body.place();
  return body;
}

/// Wyvill blobs of which near ones unite, some with a blend and some at an angle.
inline Body united_blobs(std::uint32_t count) {
  Body body = filled_ball(count, 8.0, [](double R) {
    Primitive p;
    p.kernel = Kernel::wyvill(R);
    return p;
  });
  Blend& blend = body.skeleton.blend;
  blend.rule = BlendRule::Graph;
  for (std::uint32_t a = 0; a < count; ++a) {
    for (std::uint32_t b = a + 1; b < count; ++b) {
      const double apart = (body.parts[a].position - body.parts[b].position).norm();
      if ((a + b) % 3 == 0 && apart < body.skeleton.primitive[a].kernel.radius) blend.edge.push_back({a, b, 1.0});
    }
  }
  body.place();
  return body;
}

}  // namespace supple::benchmarks
