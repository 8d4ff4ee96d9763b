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

/// Wyvill blobs in a deformed ball such that 30 supports overlap inside.
inline Body blobs(std::uint32_t count) {
  std::mt19937_64 engine(7);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  const auto surface = [](const Vec3& u) {
    return 1.0 + 0.2 * math::sin_cos(4.0 * u.x() + 1.0).sin * math::sin_cos(3.0 * u.y()).cos +
           0.15 * math::sin_cos(5.0 * u.z()).sin;
  };
  Body body;
  body.skeleton.part_count = count;
  const double volume = 4.3;  // of the deformed ball, nearly
  const double R = std::cbrt(30.0 * volume / (count * 4.0 / 3.0 * 3.141592653589793));
  while (body.parts.size() < count) {
    const Vec3 x = 1.4 * Vec3(uniform(), uniform(), uniform());
    if (x.norm() > surface(x.normalized())) continue;
    Primitive p;
    p.part = static_cast<std::uint32_t>(body.parts.size());
    p.kernel = Kernel::wyvill(R);
    body.skeleton.primitive.push_back(p);
    body.parts.push_back(Pose{x, Quat::Identity()});
  }
  body.place();
  return body;
}

}  // namespace supple::benchmarks
