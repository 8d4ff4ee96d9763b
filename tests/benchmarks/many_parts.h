/// @file many_parts.h
/// Bodies of many primitives, for benchmarks and tests.
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "contact_shapes.h"
#include "supple/collision/bodies.h"
#include "supple/implicit/surface_samples.h"

namespace supple::benchmarks {

/// Wyvill primitives, one part each.
struct Parts {
  implicit::Skeleton skeleton;
  std::vector<Pose> pose;
  std::vector<Vec3> still;
  implicit::SampleLayout layout;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::SampleState kept;
  implicit::SurfaceSamples samples;

  Parts(implicit::Skeleton from, double spacing) : skeleton(std::move(from)), layout(implicit::make_sample_layout(skeleton, spacing)) {
    pose.resize(skeleton.part_count);
    still.assign(pose.size(), Vec3::Zero());
  }
  void index() {
    implicit::place_skeleton(skeleton, pose, placed);
    implicit::index_field(skeleton, placed, field);
    implicit::sample_surface({skeleton, layout, pose, field}, {}, Executor(1), kept, samples);
  }
  [[nodiscard]] collision::ContactBody body() const {
    collision::ContactBody b;
    b.field = field;
    b.material.modulus = 5e3;
    b.pose = pose;
    b.velocity = still;
    b.angular_velocity = still;
    b.samples = &samples;
    b.skeleton = &skeleton;
    return b;
  }
};

/// A body such as fits make: ellipsoids of many sizes, each near an earlier one, or points of the same volumes in their places.
inline Parts limbs(std::uint32_t count, implicit::ShapeKind shape = implicit::ShapeKind::Ellipsoid) {
  constexpr double kLeast = 0.04, kMost = 0.2, kLongest = 3.0, kApart = 0.3;  // supports [m], long over thin, and between middles over the size
  Draw draw(count);
  implicit::Skeleton skeleton;
  skeleton.part_count = count;
  std::vector<Pose> pose;
  for (std::uint32_t k = 0; k < count; ++k) {
    implicit::Primitive& p = skeleton.primitive.emplace_back();
    p.part = k;
    p.shape = shape;
    const double size = draw.logarithmic(kLeast, kMost);
    const Vec3 axes = size * Vec3(1.0, draw.uniform(1.0, kLongest), draw.uniform(1.0, kLongest));
    const bool ball = shape == implicit::ShapeKind::Point;
    if (!ball) p.size = axes;
    p.kernel = implicit::Kernel::wyvill(ball ? std::cbrt(axes.prod()) : 1.0);
    const Vec3 beside = k == 0 ? Vec3::Zero().eval() : Vec3(pose[static_cast<std::size_t>(draw.uniform(0.0, k))].position + kApart * axes.maxCoeff() * draw.direction());
    pose.push_back({beside, draw.rotation()});
  }
  Parts parts(std::move(skeleton), 0.012);
  parts.pose = std::move(pose);
  return parts;
}

/// Turned at random, with its lowest sample up to 3 cm beneath z = 0 and near the z axis.
/// @param rest  poses that it has by itself
inline void lay(Parts& parts, const std::vector<Pose>& rest, Draw& draw) {
  constexpr double kAside = 0.02, kShallow = 0.0015, kDeep = 0.03;  // [m]
  const Quat turn = draw.rotation();
  const auto place = [&](const Vec3& aside) {
    for (std::size_t k = 0; k < rest.size(); ++k) parts.pose[k] = {turn * rest[k].position + aside, turn * rest[k].orientation};
    parts.index();
  };
  place(Vec3::Zero());
  Vec3 lowest = Vec3::Zero();
  for (std::size_t i = 0; i < parts.samples.point.size(); ++i) {
    if (parts.samples.valid[i] != 0 && parts.samples.point[i].z() < lowest.z()) lowest = parts.samples.point[i];
  }
  place(Vec3(draw.uniform(-kAside, kAside), draw.uniform(-kAside, kAside), -draw.logarithmic(kShallow, kDeep)) - lowest);
}

}  // namespace supple::benchmarks
