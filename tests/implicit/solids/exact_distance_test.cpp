#include "solids/exact_distance.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <thread>
#include <utility>

#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/math.h"
#include "supple/implicit/mesh_solid.h"
#include "supple/implicit/solids.h"
#include "support/closed_meshes.h"

namespace supple::implicit {
namespace {

using test::block, test::both, test::gear, test::octahedral_sphere, test::places;

const Quat kTurn(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));

/// F = -slope times the exact distance, as of a mesh solid.
class ExactSolid {
 public:
  ExactSolid(const Mesh& mesh, const MeshSolidOptions& options) : distance_(closed_surface(mesh)), options_(options) {}
  [[nodiscard]] double value(const Vec3& x, Vec3& gradient) const {
    const double f = -options_.slope * distance_.at(options_.pose.to_body(x), &gradient);
    gradient = -options_.slope * (options_.pose.orientation * gradient);
    return f;
  }
  [[nodiscard]] const ExactDistance& distance() const { return distance_; }
  [[nodiscard]] const ClosedSurface& surface() const { return distance_.surface(); }

 private:
  ExactDistance distance_;
  MeshSolidOptions options_;
};

double value(const ExactSolid& solid, const Vec3& x) {
  Vec3 gradient;
  return solid.value(x, gradient);
}

std::vector<Vec3> directions(int count) {
  std::vector<Vec3> out;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count, turn = 2.399963229728653 * i, r = std::sqrt(1.0 - z * z);
    out.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  return out;
}

/// Distance to a triangle by its Voronoi regions (Ericson 2005, "Real-Time Collision Detection", sec. 5.1.5).
double distance_to(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d1 <= 0.0 && d2 <= 0.0) return ap.norm();
  if (d3 >= 0.0 && d4 <= d3) return bp.norm();
  if (const double vc = d1 * d4 - d3 * d2; vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return (ap - d1 / (d1 - d3) * ab).norm();
  if (d6 >= 0.0 && d5 <= d6) return cp.norm();
  if (const double vb = d5 * d2 - d1 * d6; vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return (ap - d2 / (d2 - d6) * ac).norm();
  if (const double va = d3 * d6 - d5 * d4; va <= 0.0 && d4 >= d3 && d5 >= d6) return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).norm();
  return std::abs(ab.cross(ac).normalized().dot(ap));
}

double distance_to(const Mesh& mesh, const Vec3& x) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& t : mesh.triangle) least = std::min(least, distance_to(x, mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]]));
  return least;
}

constexpr double kAny = std::numeric_limits<double>::infinity();  // thickness

TEST(ExactDistance, IsTheBoxThatItsTrianglesBound) {
  // However thin: all of it is exact but for rounding of coordinates below 2.
  for (const double thickness : {0.4, 0.02, 1e-3, 1e-6}) {
    for (const bool turned : {false, true}) {
      const Vec3 half(0.5, 0.4, 0.5 * thickness), at(0.3, -0.2, 0.1);
      const ExactSolid solid(block(half, Vec3::Zero(), turned), {.slope = 3.0, .pose = {at, kTurn}});
      const SolidBox box({at, kTurn}, half, 0.0, 3.0);
      EXPECT_EQ(solid.surface().deviation, 0.0);
      EXPECT_NEAR(solid.distance().thickness(0.01, kAny), thickness, 1e-9);
      EXPECT_NEAR(solid.distance().thickness(0.01, 2.0 * thickness), thickness, 1e-9);
      EXPECT_NEAR(solid.distance().thickness(0.01, 0.5 * thickness), 0.5 * thickness, 1e-9);
      std::vector<Vec3> all = places({Vec3(-0.8, -0.7, -0.4), Vec3(0.8, 0.7, 0.4)}, 500);
      for (const Vec3& x : places({-1.1 * half, 1.1 * half}, 500)) all.push_back(x);
      for (const Vec3& local : all) {
        const Vec3 x = at + kTurn * local;
        Vec3 slope, expected;
        const double f = solid.value(x, slope);
        EXPECT_NEAR(f, FieldView(box).value(x, expected), 1e-14) << local.transpose();
        // Where one place is nearest by far, so that rounding does not turn the way to it.
        const Vec3 over = local.cwiseAbs() - half;
        std::array<double, 3> depth{over.x(), over.y(), over.z()};
        std::sort(depth.begin(), depth.end());
        if (depth[2] < 0.0 && depth[2] - depth[1] < 1e-9) continue;
        EXPECT_LT((slope - expected).norm(), 3e-14 / std::max(std::abs(f), 1e-3) + 1e-13) << local.transpose();
      }
    }
  }
}

TEST(ExactDistance, HasTheDistancesOfAllTrianglesLookedAtOneByOne) {
  // Teeth with edges of 90 degrees and more, and with gaps between them that close to nothing at their feet.
  const Mesh mesh = gear(24, 0.8, 1.0, 0.3);
  const ExactSolid solid(mesh, {.slope = 1.0});
  for (const Vec3& x : places({Vec3(-1.2, -1.2, -0.4), Vec3(1.2, 1.2, 0.4)}, 2000)) {
    EXPECT_NEAR(std::abs(value(solid, x)), distance_to(mesh, x), 1e-14);
    // Inside by the outline, whose corners have angles 2 pi k / 96 and one of the two radii.
    const double corner = std::fmod(std::atan2(x.y(), x.x()) / (2.0 * std::numbers::pi) * 96.0 + 96.0, 96.0), first = std::floor(corner);
    const auto at = [](double k) {
      const auto [s, c] = math::sin_cos(2.0 * std::numbers::pi * k / 96.0);
      return Vec3((std::fmod(k, 4.0) < 2.0 ? 1.0 : 0.8) * Vec3(c, s, 0));
    };
    const Vec3 side = at(std::fmod(first + 1.0, 96.0)) - at(first);
    const double left = side.cross(Vec3(x.x(), x.y(), 0.0) - at(first)).z();
    if (std::abs(left) < 1e-12) continue;
    EXPECT_EQ(value(solid, x) > 0.0, left > 0.0 && std::abs(x.z()) < 0.15) << x.transpose();
  }
}

TEST(ExactDistance, LiesBetweenTheBallsAroundAndWithinItsFaces) {
  // All corners are on the outer ball, and the inner one touches the plane of the face that is nearest to the middle.
  constexpr double kRadius = 0.8;
  for (const int levels : {3, 5}) {
    const Mesh mesh = octahedral_sphere(kRadius, levels);
    double inner = kRadius;
    for (const auto& t : mesh.triangle) {
      const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
      inner = std::min(inner, (b - a).cross(c - a).normalized().dot(a));
    }
    const ExactSolid solid(mesh, {.slope = 1.0});
    for (const Vec3& u : directions(500)) {
      for (const double r : {0.3, 0.7, 0.79, 0.85, 2.0}) {
        EXPECT_LE(value(solid, r * u), kRadius - r + 1e-14);
        EXPECT_GE(value(solid, r * u), inner - r - 1e-14);
      }
    }
  }
}

TEST(ExactDistance, GivesAPointTheSameBitsWhateverWasAskedBefore) {
  const ExactSolid solid(gear(24, 0.8, 1.0, 0.3), {.slope = 1.0}), other(octahedral_sphere(1.0, 4), {.slope = 1.0});
  std::vector<Vec3> points = places({Vec3(-1.1, -1.1, -0.2), Vec3(1.1, 1.1, 0.2)}, 300);
  for (std::size_t i = 0; i < 24; ++i) points.push_back(solid.surface().position[7 * i]);  // where several triangles are equally near
  std::vector<double> all(points.size());
  std::vector<Vec3> slopes(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) all[i] = solid.value(points[i], slopes[i]);
  for (std::size_t i = points.size(); i-- > 0;) {
    (void)value(other, points[points.size() - 1 - i]);
    Vec3 slope;
    EXPECT_EQ(solid.value(points[i], slope), all[i]);
    EXPECT_EQ(slope, slopes[i]);
  }
}

TEST(ExactDistance, HasTheCavityThatAShellTheOtherWayRoundBounds) {
  const Vec3 outer(1.0, 0.8, 0.6), inner(0.8, 0.6, 0.3), at(0.05, -0.05, 0.1);
  const SolidBox whole({}, outer, 0.0, 1.0), hole({at, Quat::Identity()}, inner, 0.0, 1.0);
  const std::vector<Vec3> all = places({-1.2 * outer, 1.2 * outer}, 1500);
  for (const bool inside_out : {false, true}) {
    const ExactSolid hollow(both(block(outer, Vec3::Zero(), inside_out), block(inner, at, !inside_out)), {.slope = 1.0});
    // The wall beside the cavity is 0.15 thick, the one below it 0.2, that above 0.4.
    EXPECT_NEAR(hollow.distance().thickness(0.001, kAny), 0.15, 1e-9);
    for (const Vec3& x : all) {
      // Both distances are exact in the wall and in the cavity, and outside the box is nearer.
      const double expected = std::min(FieldView(whole).value(x), -FieldView(hole).value(x));
      EXPECT_NEAR(value(hollow, x), expected, 1e-14) << x.transpose();
    }
    // One the same way round is within.
    const ExactSolid filled(both(block(outer, Vec3::Zero(), inside_out), block(inner, at, inside_out)), {.slope = 1.0});
    const ExactSolid alone(block(outer), {.slope = 1.0});
    EXPECT_EQ(filled.surface().triangle.size(), 12u);
    for (const Vec3& x : all) EXPECT_NEAR(value(filled, x), value(alone, x), 1e-14);
  }
}

// A comb of forty blades: the two triangles of its back cross all of them and are cut into hundreds of thousands of pieces, which takes seconds.
TEST(ExactDistance, OfShellsThatCrossInManyPlacesIsInterruptedWithinATriangle) {
  constexpr int kBlades = 40;
  Mesh comb = block(Vec3(0.5, 0.5, 0.05));
  for (int k = 0; k < kBlades; ++k) comb = both(comb, block(Vec3(0.001, 0.5, 0.2), Vec3(-0.49 + k * 0.025, 0, 0.2)));
  std::atomic<int> interrupt{0};
  const InterruptScope scope(&interrupt);
  std::jthread signal([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    interrupt = 2;
  });
  const double began = process_cpu_seconds();
  EXPECT_THROW((void)closed_surface(comb), Interrupted);
  EXPECT_LT(process_cpu_seconds() - began, 0.5);
}

TEST(ExactDistance, IsTheUnionOfShellsThatCross) {
  // Three bars as the axes of a cross; each pair crosses, with no vertex or edge in common.
  const Vec3 half[] = {Vec3(1.0, 0.1, 0.12), Vec3(0.11, 1.0, 0.13), Vec3(0.09, 0.14, 1.0)};
  Mesh mesh = both(both(block(half[0]), block(half[1])), block(half[2], Vec3::Zero(), true));
  const ExactSolid cross(mesh, {.slope = 1.0, .pose = {Vec3::Zero(), kTurn}});
  EXPECT_EQ(cross.surface().crossing_before, 24u);  // the sides of the bars, not their ends
  EXPECT_EQ(cross.surface().turned, 12u);    // the third bar, which bounds no cavity
  EXPECT_GT(cross.surface().deviation, 0.0);
  EXPECT_LE(cross.surface().deviation, 2.0 / 512.0);
  for (const Vec3& local : places({Vec3::Constant(-1.1), Vec3::Constant(1.1)}, 3000)) {
    double nearest = -std::numeric_limits<double>::infinity();
    for (const Vec3& h : half) nearest = std::max(nearest, FieldView(SolidBox({}, h, 0.0, 1.0)).value(local));
    const double f = value(cross, kTurn * local);
    if (std::abs(nearest) > 1e-12) {
      EXPECT_EQ(f > 0.0, nearest > 0.0) << local.transpose();
    }
    if (nearest < 0.0) {
      EXPECT_NEAR(f, nearest, 1e-14) << local.transpose();
    }
    // Inside the walls of the others are no surface: a point is deeper than in each bar alone, but for pieces that stand out.
    if (nearest > 0.0) {
      EXPECT_GE(f, nearest - cross.surface().deviation) << local.transpose();
    }
  }
}

TEST(ExactDistance, IsTheUnionOfShellsThatShareAFace) {
  // Two boxes one upon the other, of which the upper one stands on a part of the lower one's face, or on all of it.
  for (const double side : {0.3, 0.5}) {
    const Vec3 half(0.5, 0.5, 0.2), above(side, side, 0.2), at(0, 0, 0.4);
    const ExactSolid tower(both(block(half), block(above, at)), {.slope = 1.0});
    // On the axis the way to the nearest side or to an end counts alone, not that to the common face.
    EXPECT_NEAR(value(tower, Vec3(0, 0, 0.2)), std::min(side, 0.4), tower.surface().deviation + 1e-14) << side;
    for (const Vec3& x : places({Vec3(-0.6, -0.6, -0.3), Vec3(0.6, 0.6, 0.7)}, 1500)) {
      const double one = FieldView(SolidBox({}, half, 0.0, 1.0)).value(x), other = FieldView(SolidBox({at, Quat::Identity()}, above, 0.0, 1.0)).value(x);
      const double nearest = std::max(one, other);
      if (nearest < -1e-12) {
        EXPECT_NEAR(value(tower, x), nearest, 1e-14) << x.transpose();
      }
      if (nearest > 1e-12) {
        EXPECT_GE(value(tower, x), nearest - tower.surface().deviation - 1e-14) << x.transpose();
      }
    }
  }
}

TEST(ExactDistance, TurnsTrianglesThatRunTheOtherWayThanMostOfTheirShell) {
  const ExactSolid solid(block(Vec3(0.5, 0.5, 0.2)), {.slope = 1.0});
  for (const std::vector<std::size_t>& turned : {std::vector<std::size_t>{3}, {0, 4, 5, 9}}) {
    Mesh mesh = block(Vec3(0.5, 0.5, 0.2));
    for (const std::size_t t : turned) std::swap(mesh.triangle[t][1], mesh.triangle[t][2]);
    const ExactSolid mended(mesh, {.slope = 1.0});
    EXPECT_EQ(mended.surface().turned, turned.size());
    for (const Vec3& x : places({Vec3(-0.6, -0.6, -0.3), Vec3(0.6, 0.6, 0.3)}, 500)) EXPECT_NEAR(value(mended, x), value(solid, x), 1e-15);
  }
  EXPECT_EQ(solid.surface().turned, 0u);
}

}  // namespace
}  // namespace supple::implicit
