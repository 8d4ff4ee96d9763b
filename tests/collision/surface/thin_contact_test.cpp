/// Stiff bodies under small loads: overlaps of a thousandth of a body's rounding and less, down to round-off of the coordinates.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "benchmarks/contact_shapes.h"
#include "benchmarks/thin_cases.h"
#include "supple/implicit/mesh_solid.h"
#include "support/closed_meshes.h"

namespace supple::collision {
namespace {

using namespace benchmarks;

constexpr double kRound = 0.1, kE = 1e6;
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

TEST(ThinContacts, OfFlatCoresOnAPlaneAreTheClosedForm) {
  const double steep = 3.0 * kE / kRound;  // of the plane [Pa/m]
  const double stiffness = 1.0 / (kRound / kE + 1.0 / steep);
  const Pose still, turned{Vec3(0.3, 0.2, 0.7), Quat(Eigen::AngleAxisd(0.4, Vec3::UnitZ()))};
  for (const FlatCore& core : kFlatCores) {
    Rigid body(linear_shape(core.shape, core.size, kRound), kLinearModulus * kE, 0.03);
    body.put(turned);
    for (double d = 1e-3 * kRound; d > 1e-11 * kRound; d *= 0.1) {
      const implicit::HalfSpace plane{Vec3(0, 0, turned.position.z() - kRound + d), Vec3::UnitZ(), 1.0};
      const double overlap = plane.point.z() - (turned.position.z() - kRound);
      const ForceAndArea exact = on_plane(core, kRound, stiffness, overlap);
      for (const double error : {1e-2, 1e-4, 1e-6}) {
        const ContactSurface::Summary s = contact_between({body.body(), single_part(plane, steep, still)}, error);
        ASSERT_GT(s.points, 0u) << core.name << d;
        EXPECT_EQ(s.rule, ContactRule::Polar) << core.name << d;
        const double rounding = 8.0 * kEpsilon / overlap, bound = s.error_estimate + 2.0 * overlap / kRound + rounding;
        EXPECT_LE(s.error_estimate, std::max(1.01 * error, 40.0 * rounding)) << core.name << ' ' << d;
        EXPECT_NEAR(s.force.norm(), exact.force, bound * exact.force) << core.name << ' ' << d << ' ' << error;
        EXPECT_NEAR(s.area, exact.area, bound * exact.area) << core.name << ' ' << d << ' ' << error;
      }
    }
  }
}

// Equal balls that overlap by d: F = pi E d^2 / 4. Where d is some round-offs of the coordinates and rings do not fit, no other rule does: marching takes a
// million evaluations to say so.
TEST(ThinContacts, OfBallsAreToldDownToRoundOff) {
  Rigid a(linear_sphere(kRound), kLinearModulus * kE, 0.05), b(linear_sphere(kRound), kLinearModulus * kE, 0.05);
  Draw draw(3);
  int told = 0;
  for (int pose = 0; pose < 2000; ++pose) {
    const double depth = draw.logarithmic(1e-16, 1e-11);
    const bool on_axis = pose % 2 == 0;
    const Vec3 at(on_axis ? 0.0 : draw.uniform(0.0, 1.0), 0.0, draw.uniform(0.0, 1.0)), way = on_axis ? Vec3(Vec3::UnitZ()) : draw.direction();
    a.put({at, Quat::Identity()});
    b.put({at + (2.0 * kRound - depth) * way, Quat::Identity()});
    const double d = 2.0 * kRound - (b.body().pose[0].position - a.body().pose[0].position).norm(), force = 0.25 * kPi * kE * d * d;
    const ContactSurface::Summary s = contact_between({a.body(), b.body()}, 1e-3);
    EXPECT_NE(s.rule, ContactRule::March) << depth;
    EXPECT_LE(s.evaluations, 100000u) << depth;
    if (s.points == 0) {
      EXPECT_LE(d, 2e-13) << depth;
      continue;
    }
    ++told;
    EXPECT_NEAR(s.force.norm(), force, s.error_estimate * force) << depth;
  }
  EXPECT_GT(told, 1000);
}

// In any pose in which surfaces lie on one another: edges on faces, faces on faces, sides of capsules. By marching, which one of some ten thousand such
// queries still is left to, it takes a million evaluations.
TEST(ThinContacts, KeepTheirBoundsAndTakeNoMoreWorkThanDeeperOnes) {
  const std::vector<implicit::Skeleton> shapes = flat_shapes();
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    for (std::size_t j = i; j < shapes.size(); ++j) {
      Rigid a(shapes[i], 2.0 * kE, 0.03), b(shapes[j], 3.0 * kE, 0.03);
      Draw draw(31);
      for (int pose = 0; pose < 100; ++pose) {
        press(a, b, draw.logarithmic(1e-8, 1e-3) * kRound, draw);
        for (const double error : {1e-3, 1e-6}) {
          const ContactSurface::Summary s = contact_between({a.body(), b.body()}, error);
          ASSERT_GT(s.points, 0u) << i << j << ' ' << pose;
          EXPECT_EQ(s.rule, ContactRule::Polar) << i << j << ' ' << pose << ' ' << error;
          EXPECT_LE(s.evaluations, 200000u) << i << j << ' ' << pose << ' ' << error;
          if (error < 1e-3) continue;
          const ContactSurface::Summary fine = contact_between({a.body(), b.body()}, 1e-3 * error);
          const double bound = s.error_estimate + fine.error_estimate;
          EXPECT_LE(s.error_estimate, 1.01 * error) << i << j << ' ' << pose;
          EXPECT_LE((s.force - fine.force).norm(), bound * fine.force.norm()) << i << j << ' ' << pose;
          EXPECT_NEAR(s.area, fine.area, bound * fine.area) << i << j << ' ' << pose;
        }
      }
    }
  }
}

// Bodies that stand on one another lean by what they are pressed in: the pressure of a face falls to nothing across it, or at the edges of another.
/// A disc, a capsule or a plate above a box, which leans by up to three times as much as it is pressed in.
struct Leaning {
  double round;
  Rigid upper, lower;

  explicit Leaning(int which)
      : round(which == 0 ? 0.04 : which == 1 ? 0.05 : 0.02),
        upper(which == 0   ? linear_shape(implicit::ShapeKind::Disc, Vec3(0.1, 0, 0), round)
              : which == 1 ? linear_shape(implicit::ShapeKind::Segment, Vec3(0.08, 0, 0), round)
                           : linear_shape(implicit::ShapeKind::Rectangle, Vec3(0.06, 0.05, 0), round),
              kE, 0.03),
        lower(linear_shape(implicit::ShapeKind::Box, Vec3(0.15, 0.12, 0.08), 0.02), kE, 0.03) {
    lower.put({});
  }

  void put(Draw& draw, double deepest) {
    const double d = draw.logarithmic(1e-8, deepest), lean = draw.uniform(0.0, 3.0) * d / 0.1;
    const auto [s, c] = math::sin_cos(draw.uniform(0.0, 2.0 * kPi));
    const Quat tilt(Eigen::AngleAxisd(lean, Vec3(c, s, 0))), turn(Eigen::AngleAxisd(draw.uniform(0.0, kPi), Vec3::UnitZ()));
    upper.put({Vec3(0.01, 0.02, 0.1 + round - d), tilt * turn});
  }

  void keeps_its_bound(double error) const {
    const std::array<ContactBody, 2> bodies{upper.body(), lower.body()};
    const ContactSurface::Summary found = contact_between(bodies, error), fine = contact_between(bodies, 1e-3 * error);
    EXPECT_EQ(found.rule, ContactRule::Polar);
    EXPECT_LE(found.evaluations, 200000u);
    EXPECT_LE(found.error_estimate, 1.01 * error);
    const double bound = found.error_estimate + fine.error_estimate;
    EXPECT_LE((found.force - fine.force).norm(), bound * fine.force.norm());
    EXPECT_NEAR(found.area, fine.area, bound * fine.area);
  }
};

TEST(ThinContacts, OfFacesThatLeanKeepTheirBounds) {
  for (const int which : {0, 1, 2}) {
    Leaning pair(which);
    Draw draw(7);
    for (int pose = 0; pose < 60; ++pose) {
      SCOPED_TRACE(testing::Message() << which << " pose " << pose);
      pair.put(draw, 1e-5);
      for (const double error : {1e-4, 1e-6}) pair.keeps_its_bound(error);
    }
  }
}

/// Poses in which corners of the rim are hard to see: both ends of an edge that is left and met again lie between two rays, or three edges do;
/// an edge of one face touches that of another; a strip all but ends; rays are as little pressed where they meet an edge as at the rim.
TEST(ThinContacts, KeepTheirBoundsWhereCornersHide) {
  struct Hard {
    int which, pose;
    std::uint64_t seed;
    double error;
  };
  for (const Hard& hard : {Hard{0, 77, 14, 1e-6}, Hard{0, 25, 19, 1e-6}, Hard{0, 56, 19, 1e-6}, Hard{0, 865, 10, 1e-6}, Hard{0, 527, 10, 1e-4}, Hard{0, 165, 11, 1e-6}, Hard{0, 90, 11, 1e-4}, Hard{1, 85, 12, 1e-6},
                           Hard{2, 272, 10, 1e-3}, Hard{2, 47, 11, 1e-6}, Hard{2, 80, 14, 1e-4}, Hard{2, 95, 18, 1e-6}, Hard{2, 23, 18, 1e-6}}) {
    SCOPED_TRACE(testing::Message() << hard.which << " pose " << hard.pose << " seed " << hard.seed);
    Leaning pair(hard.which);
    Draw draw(hard.seed);
    for (int pose = 0; pose <= hard.pose; ++pose) pair.put(draw, 1e-4);
    pair.keeps_its_bound(hard.error);
  }
}

TEST(ThinContacts, OfAFaceOnAFaceTakeLittleWork) {
  Leaning plate(2);
  plate.upper.put({Vec3(0.01, 0.02, 0.1 + plate.round - 3e-3), Quat(Eigen::AngleAxisd(0.4, Vec3::UnitZ()))});
  EXPECT_LE(contact_between({plate.upper.body(), plate.lower.body()}, 1e-6).evaluations, 26000u);
}


/// A shank, a stock and two flukes, which cross: thin and thick parts, corners that point inwards.
Mesh anchor() {
  Mesh mesh = test::block(Vec3(0.04, 0.04, 0.5));
  append(mesh, test::block(Vec3(0.25, 0.03, 0.03), Vec3(0, 0, 0.4)));
  append(mesh, test::block(Vec3(0.35, 0.05, 0.04), Vec3(0, 0, -0.48)));
  for (const double side : {-1.0, 1.0}) append(mesh, test::block(Vec3(0.01, 0.12, 0.08), Vec3(side * 0.33, 0, -0.4)));
  return mesh;
}

// Balls of 1.5 percent of the size, pressed into the middles of faces by 1 percent: none finds a surface that is elsewhere.
TEST(ThinContacts, OfSmallBallsWithAllFacesOfAMeshAreFound) {
  constexpr double kDepth = 0.01, kRadius = 0.015;
  for (const Mesh& mesh : {anchor(), test::gear(24, 0.8, 1.0, 0.3)}) {
    const implicit::MeshSolid solid(mesh, {.slope = 1.0});
    const double size = solid.surface_box().extent().maxCoeff();
    benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius * size), 1e5, 0.2 * kRadius * size);
    const Pose still;
    const Executor executor(1);
    const Mesh& faces = solid.mesh();
    int probes = 0;
    for (std::size_t t = 0; t < faces.triangle.size(); t += 1 + faces.triangle.size() / 100) {
      const auto& c = faces.triangle[t];
      const Vec3 at = (faces.position[c[0]] + faces.position[c[1]] + faces.position[c[2]]) / 3.0, &normal = faces.normal[c[0]];
      if (implicit::FieldView(solid).value(at + kDepth * size * normal) > 0.0) continue;  // within another shell
      ball.put({at + (kRadius - kDepth) * size * normal, Quat::Identity()});
      const std::array<ContactBody, 2> bodies{ball.body(), benchmarks::single_part(solid, 1e6 / size, still)};
      ContactCandidates candidates;
      ContactSurface surface;
      find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = 1e-2}, executor, surface);
      ASSERT_EQ(surface.summary.size(), 1u) << at.transpose();
      EXPECT_GT(surface.summary[0].force.norm(), 0.0) << at.transpose();
      ++probes;
    }
    EXPECT_GT(probes, 40);
  }
}

}  // namespace
}  // namespace supple::collision
