/// @file contact_cases.h
/// The seventeen cases of contact queries in random poses.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "contact_shapes.h"

namespace supple::benchmarks {

/// Whether a command names a case, or all: these do not include four of which many poses are marched, up to seconds each.
inline bool names(std::string_view command, std::string_view name) {
  return command == name || (command == "all" && name != "shapes" && name != "pinched" && name != "ring" && name != "pierced");
}

/// Calls `visit(name, make_pose)` for each case that is wanted; `make_pose(draw)` puts its two bodies in the next random pose, the same ones
/// on every stage. Spheres of linear pressure have closed forms, in the place and size of the bodies on the default stage.
/// @param depths  least and largest overlap over the size of the bodies, for all cases; else 1e-3 to 0.3, of those without a closed form from 1e-2 on
template <class Wanted, class Visit>
void for_cases(const Stage& stage, const Wanted& wanted, const Visit& visit, const std::optional<std::array<double, 2>>& depths = std::nullopt) {
  const auto turned = [](Draw& draw, const Vec3& position) { return Pose{position, draw.rotation()}; };
  const auto somewhere = [](Draw& draw) -> Vec3 { return draw.uniform(0.0, 1.0) * draw.direction(); };
  constexpr double kRadius = 0.1, kSpacing = 0.03, kE = 1e6;
  const double shallow = depths ? (*depths)[0] : 1e-3, least = depths ? shallow : 0.01, deep = depths ? (*depths)[1] : 0.3;

  const auto two_spheres = [&](std::string_view name, double rb, double eb) {
    if (!wanted(name)) return;
    Rigid a(linear_sphere(kRadius), kLinearModulus * kE, kSpacing, stage);
    Rigid b(linear_sphere(rb), kLinearModulus * eb, kSpacing * rb / kRadius, stage);
    visit(name, [&](Draw& draw) {
      const Vec3 axis = draw.direction(), centre = somewhere(draw);
      const double D = kRadius + rb - draw.logarithmic(shallow, deep) * std::min(kRadius, rb);
      a.put(turned(draw, centre));
      b.put(turned(draw, centre + D * axis));
      return Pair{{a.body(), b.body()}, true, spheres(kRadius, kE, rb, eb, D, centre, axis)};
    });
  };
  two_spheres("equal", kRadius, kE);
  two_spheres("radii", 2.0 * kRadius, kE);
  two_spheres("stiffness", kRadius, 3.0 * kE);

  if (wanted("plane")) {
    Rigid ball(linear_sphere(kRadius), kLinearModulus * kE, kSpacing, stage);
    implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
    const Pose origin;
    const double k = 100.0 * kE / kRadius;
    visit("plane", [&](Draw& draw) {
      const Vec3 up = draw.direction(), centre = somewhere(draw);
      const double h = kRadius - draw.logarithmic(shallow, deep) * kRadius;
      ball.put(turned(draw, centre));
      plane = stage.place(implicit::HalfSpace{centre - h * up, up, 1.0});
      collision::ContactBody ground = single_part(plane, k, origin);
      ground.fixed = true;
      return Pair{{ball.body(), ground}, true, sphere_on_flat(kRadius, kE, k, h, centre, -up)};
    });
  }
  if (wanted("slab")) {
    // The face of a box whose pressure rises linearly over its rounding.
    constexpr double kRounding = 0.1;
    Rigid ball(linear_sphere(kRadius), kLinearModulus * kE, kSpacing, stage);
    Rigid slab(linear_shape(implicit::ShapeKind::Box, Vec3(0.3, 0.3, 0.05), kRounding), kLinearModulus * kE, 2.0 * kSpacing, stage);
    visit("slab", [&](Draw& draw) {
      const Pose pose = turned(draw, somewhere(draw));
      slab.put(pose);
      const double h = kRadius - draw.logarithmic(shallow, deep) * kRadius;
      const Vec3 at(draw.uniform(-0.15, 0.15), draw.uniform(-0.15, 0.15), 0.05 + kRounding + h);
      const Vec3 centre = pose.position + pose.orientation * at;
      ball.put(turned(draw, centre));
      return Pair{{ball.body(), slab.body()},
                  true,
                  sphere_on_flat(kRadius, kE, kE / kRounding, h, centre, -(pose.orientation * Vec3::UnitZ()))};
    });
  }
  // Faces on faces: a rounded box lies flat on a plane, and on the face of another one, turned and shifted.
  const Vec3 half(0.1, 0.08, 0.05);
  constexpr double kEdge = 0.02;
  const auto overlap = [&](Draw& draw) { return draw.logarithmic(least, deep) * kEdge; };
  if (wanted("face_on_plane")) {
    Rigid box(linear_shape(implicit::ShapeKind::Box, half, kEdge), kLinearModulus * kE, kSpacing, stage);
    implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
    const Pose origin;
    visit("face_on_plane", [&](Draw& draw) {
      const Pose pose = turned(draw, somewhere(draw));
      box.put(pose);
      const Vec3 up = pose.orientation * Vec3::UnitZ();
      const double h = kEdge - overlap(draw), k = 10.0 * kE / kEdge;
      const Vec3 core = pose.position - half.z() * up;
      plane = stage.place(implicit::HalfSpace{core - h * up, up, 1.0});
      collision::ContactBody ground = single_part(plane, k, origin);
      ground.fixed = true;
      return Pair{{box.body(), ground}, true, face_on_flat(half.x(), half.y(), kEdge, kE, k, h, core, -up)};
    });
  }
  if (wanted("face_on_face")) {
    Rigid a(linear_shape(implicit::ShapeKind::Box, half, kEdge), kLinearModulus * kE, kSpacing, stage);
    Rigid b(linear_shape(implicit::ShapeKind::Box, half, kEdge), 2.0 * kLinearModulus * kE, kSpacing, stage);
    visit("face_on_face", [&](Draw& draw) {
      const Pose pose = turned(draw, somewhere(draw));
      a.put(pose);
      const Vec3 at(draw.uniform(-1.0, 1.0) * half.x(), draw.uniform(-1.0, 1.0) * half.y(), 2.0 * (half.z() + kEdge) - overlap(draw));
      const Quat turn = pose.orientation * Quat(Eigen::AngleAxisd(draw.uniform(0.0, kPi), Vec3::UnitZ()));
      b.put({pose.position + pose.orientation * at, turn});
      return Pair{{a.body(), b.body()}, false, {}};
    });
  }
  /// Bodies without a closed form: a surface point of B is pressed into one of A, normal against normal.
  const auto pressed = [&](std::string_view name, Rigid& a, Rigid& b, double size) {
    if (!wanted(name)) return;
    visit(name, [&](Draw& draw) {
      press(a, b, draw.logarithmic(least, deep) * size, draw);
      return Pair{{a.body(), b.body()}, false, {}};
    });
  };
  {
    Rigid a(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.2, 0.3, 0.25), 0.2), kE, kSpacing, stage);
    Rigid b(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.25, 0.2, 0.2), 0.2), 2.0 * kE, kSpacing, stage);
    pressed("ellipsoids", a, b, 0.1);
  }
  {
    Rigid ball(wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.22), kE, kSpacing, stage);
    Rigid plate(wyvill_shape(implicit::ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), kE, kSpacing, stage);
    pressed("plate", ball, plate, 0.07);
  }
  {
    Rigid a(wyvill_shape(implicit::ShapeKind::Segment, Vec3(0.2, 0.0, 0.0), 0.2), kE, kSpacing, stage);
    Rigid b(wyvill_shape(implicit::ShapeKind::Segment, Vec3(0.1, 0.0, 0.0), 0.25), 3.0 * kE, kSpacing, stage);
    pressed("capsules", a, b, 0.1);
  }
  {
    Rigid disc(wyvill_shape(implicit::ShapeKind::Disc, Vec3(0.15, 0.0, 0.0), 0.15), kE, kSpacing, stage);
    Rigid box(wyvill_shape(implicit::ShapeKind::Box, Vec3(0.2, 0.1, 0.1), 0.15), 2.0 * kE, kSpacing, stage);
    pressed("disc_on_box", disc, box, 0.07);
  }
  {
    Rigid a(ten_blobs(1), kE, kSpacing, stage), b(ten_blobs(2), 2.0 * kE, kSpacing, stage);
    pressed("ten_blobs", a, b, 0.05);
  }
  {
    Rigid a(ten_blobs(1, true), kE, kSpacing, stage), b(ten_blobs(2, true), 2.0 * kE, kSpacing, stage);
    pressed("ten_parts", a, b, 0.05);
  }
  if (wanted("shapes")) {
    std::optional<Rigid> a, b;
    visit("shapes", [&](Draw& draw) {
      // Bodies that go through one another elsewhere are drawn again.
      do {
        a.emplace(any_shape(draw), kE, kSpacing, stage);
        b.emplace(any_shape(draw), 2.0 * kE, kSpacing, stage);
      } while (!press(*a, *b, draw.logarithmic(least, deep) * 0.07, draw));
      return Pair{{a->body(), b->body()}, false, {}};
    });
  }
  // Convex bodies, one of them thin, pressed in by up to thrice its thickness: the other one may come out on its far side.
  if (wanted("pierced")) {
    std::optional<Rigid> thin, other;
    visit("pierced", [&](Draw& draw) {
      const auto convex_shape = [&](std::optional<Rigid>& body, double support, double modulus) {
        do {
          implicit::Skeleton skeleton = any_shape(draw);
          skeleton.primitive.front().kernel = implicit::Kernel::wyvill(support);
          body.emplace(std::move(skeleton), modulus, kSpacing, stage);
        } while (!body->field().convex());
      };
      const double support = draw.uniform(0.04, 0.1);
      convex_shape(thin, support, kE);
      convex_shape(other, draw.uniform(0.08, 0.2), draw.logarithmic(0.2, 5.0) * kE);
      press(*thin, *other, draw.logarithmic(0.2, 3.0) * support, draw);
      return Pair{{thin->body(), other->body()}, false, {}};
    });
  }
  // Bodies that reach around the other one: a ball between two blobs, with a patch on each if neither is missed by the random step aside, and a
  // ball in a ring that is too narrow, with a crescent or a whole belt. The ball is pressed in by the depth on each side when it is in the middle.
  const double of_support = implicit::iso_distance(implicit::Kernel::wyvill(1.0), 0.5);
  if (wanted("pinched")) {
    std::optional<Rigid> ball, jaws;
    visit("pinched", [&](Draw& draw) {
      constexpr double kSupport = 0.2;
      const std::array<double, 2> support{kSupport * draw.uniform(0.6, 1.0), kSupport * draw.uniform(0.6, 1.0)};
      const double small = kSupport * draw.logarithmic(0.2, 1.0), depth = of_support * small * draw.logarithmic(least, deep);
      implicit::Skeleton two;
      for (const int i : {0, 1}) {
        implicit::Primitive& p = two.primitive.emplace_back();
        p.kernel = implicit::Kernel::wyvill(support[static_cast<std::size_t>(i)]);
        p.offset.position = Vec3((i == 0 ? -1.0 : 1.0) * (of_support * (support[static_cast<std::size_t>(i)] + small) - depth), 0.0, 0.0);
      }
      two.part_count = 1;
      jaws.emplace(std::move(two), 2.0 * kE, kSpacing, stage);
      ball.emplace(wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), small), kE, 0.5 * small, stage);
      const Pose pose = turned(draw, somewhere(draw));
      jaws->put(pose);
      const Vec3 aside = draw.uniform(0.0, 1.0) * (2.0 * depth * draw.direction());
      ball->put(turned(draw, pose.position + pose.orientation * aside));
      return Pair{{ball->body(), jaws->body()}, false, {}};
    });
  }
  if (wanted("ring")) {
    std::optional<Rigid> ball;
    constexpr double kTube = 0.15, kMiddle = 0.2;
    Rigid ring(wyvill_shape(implicit::ShapeKind::Ring, Vec3(kMiddle, 0.0, 0.0), kTube), 2.0 * kE, kSpacing, stage);
    visit("ring", [&](Draw& draw) {
      const double depth = of_support * kTube * draw.logarithmic(least, deep), hole = kMiddle - of_support * kTube;
      const double support = (hole + depth) / of_support;
      ball.emplace(wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), support), kE, kSpacing, stage);
      const Pose pose = turned(draw, somewhere(draw));
      ring.put(pose);
      const Vec3 aside = draw.uniform(0.0, 1.0) * (2.0 * depth * draw.direction());
      ball->put(turned(draw, pose.position + pose.orientation * aside));
      return Pair{{ball->body(), ring.body()}, false, {}};
    });
  }
}

/// What a command may name: `all`, or a case.
inline std::vector<std::string_view> case_names() {
  std::vector<std::string_view> names{"all"};
  const auto listed = [&names](std::string_view name) {
    names.push_back(name);
    return false;
  };
  for_cases({}, listed, [](std::string_view, const auto&) {});
  return names;
}

}  // namespace supple::benchmarks
