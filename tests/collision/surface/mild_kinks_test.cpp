/// Patches that mild kinks cross: where supports of Wyvill kernels end only third derivatives jump.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "benchmarks/contact_shapes.h"
#include "collision/bodies.h"
#include "supple/implicit/kinks.h"

namespace supple::collision {
namespace {

using implicit::Kernel;
using implicit::Kink;

implicit::Skeleton two_points(const Kernel& kernel) {
  implicit::Skeleton skeleton;
  for (const double side : {-1.0, 1.0}) {
    implicit::Primitive p;
    p.kernel = kernel;
    p.offset.position = {0.4 * side * kernel.radius, 0.0, 0.0};
    p.stretch = {1.0, 1.2, 0.9};
    skeleton.primitive.push_back(p);
  }
  skeleton.part_count = 1;
  return skeleton;
}

/// What the second derivative of f along a line jumps by at t, from differences of second order on either side.
template <class F>
double jump_of_second(const F& f, double t, double h) {
  const auto second = [&](double side) {
    return (2.0 * f(t) - 5.0 * f(t + side * h) + 4.0 * f(t + 2.0 * side * h) - f(t + 3.0 * side * h)) / (h * h);
  };
  return std::abs(second(1.0) - second(-1.0));
}

TEST(MildKinks, AreThoseAcrossWhichSecondDerivativesDoNotJump) {
  const std::array<Kernel, 6> kernels{Kernel::wyvill(0.8),    Kernel::soft_object(0.8),        Kernel::murakami(0.8),
                                      Kernel::nishimura(0.8), Kernel::blanc_schlick(0.8, 0.5), Kernel::gascuel(0.5, 0.8, 1.5)};
  for (std::size_t k = 0; k < kernels.size(); ++k) {
    const implicit::Skeleton skeleton = two_points(kernels[k]);
    const Pose pose;
    implicit::PlacedSkeleton placed;
    implicit::Field field;
    implicit::place_skeleton(skeleton, {&pose, 1}, placed);
    implicit::index_field(skeleton, placed, field);
    std::vector<Kink> kinks;
    ASSERT_TRUE(kinks_of(field, {Vec3::Constant(-1.0), Vec3::Constant(1.0)}, kinks));
    ASSERT_FALSE(kinks.empty());
    const Vec3 along = Vec3(1.0, 0.2, 0.1).normalized();
    const auto at = [&](double t) -> Vec3 { return Vec3(0.0, 0.05, 0.02) + t * along; };
    const auto f = [&](double t) { return implicit::FieldView(field).value(at(t)); };
    for (const Kink& kink : kinks) {
      EXPECT_EQ(kink.order, k == 0 ? 3 : 2) << k;
      double low = 0.0, high = 2.0;
      if ((kink.value(at(low)) > 0.0) == (kink.value(at(high)) > 0.0)) continue;
      const bool side = kink.value(at(low)) > 0.0;
      for (int i = 0; i < 60; ++i) ((kink.value(at(0.5 * (low + high))) > 0.0) == side ? low : high) = 0.5 * (low + high);
      // Differences of second order are off by the fourth derivative, 384 / R^4 at most, and a jump of the third counts with 1 h of it.
      const double jump = jump_of_second(f, low, 1e-3);
      if (kink.order >= 3) {
        EXPECT_LT(jump, 0.5) << k;
      } else {
        EXPECT_GT(jump, 1.0) << k;
      }
    }
  }
}

/// Ten blobs on ten blobs, as `contact_poses POSES ten_blobs auto SEED` presses them together.
class Blobs {
 public:
  explicit Blobs(std::uint64_t seed) : draw_(seed) {}
  void next() { benchmarks::press(a_, b_, draw_.logarithmic(0.01, 0.3) * 0.05, draw_); }
  [[nodiscard]] ContactSurface::Summary solve(double error, bool otherwise = false) const {
    const Executor executor(1);
    std::array<ContactBody, 2> bodies{a_.body(), b_.body()};
    if (otherwise) bodies = benchmarks::seen_otherwise(bodies);
    ContactCandidates candidates;
    ContactSurface surface;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
    return surface.summary.at(0);
  }

 private:
  benchmarks::Rigid a_{benchmarks::ten_blobs(1), 1e6, 0.03}, b_{benchmarks::ten_blobs(2), 2e6, 0.03};
  benchmarks::Draw draw_;
};

double off_by(const ContactSurface::Summary& s, const ContactSurface::Summary& exact) {
  return benchmarks::difference(s, {exact.force.norm(), exact.area, exact.centre_of_pressure});
}

TEST(MildKinks, PartPatchesAtFineErrorsAloneWithinTheErrorAsked) {
  Blobs blobs(4);
  constexpr std::array<double, 4> kAsked{1e-3, 1e-4, 1e-5, 1e-6};
  constexpr std::array<std::size_t, 4> kMostPoints{1500, 3500, 10000, 16000};
  std::vector<std::size_t> points;
  int crossed = 0;
  for (int pose = 0; pose < 80; ++pose) {
    blobs.next();
    const ContactSurface::Summary exact = blobs.solve(1e-9, true);
    if (exact.kinks == 0) continue;
    ++crossed;
    for (std::size_t k = 0; k < kAsked.size(); ++k) {
      const ContactSurface::Summary s = blobs.solve(kAsked[k]);
      EXPECT_EQ(s.rule, ContactRule::Polar);
      EXPECT_EQ(s.kinks > 0, kAsked[k] < 1e-4) << pose << ' ' << kAsked[k];
      EXPECT_LE(s.points, kMostPoints[k]) << pose;
      if (k == 0) points.push_back(s.points);
      EXPECT_LE(s.error_estimate, kAsked[k]) << pose;
      const double off = off_by(s, exact);
      EXPECT_LE(off, s.error_estimate) << pose << ' ' << kAsked[k];
      EXPECT_NEAR(s.energy / exact.energy, 1.0, 4.0 * kAsked[k]) << pose;  // of which the bound says nothing
    }
  }
  EXPECT_GT(crossed, 60);
  std::sort(points.begin(), points.end());
  EXPECT_LE(points.at(points.size() / 2), 48u);  // rings of twelve rays; sectors have 200 and more
}

TEST(MildKinks, AreMetWithinTheErrorWhereOutlinesAreUneven) {
  // Lobes and necks, on which rings converge slowly.
  struct Case {
    std::uint64_t seed;
    std::vector<int> poses;
  };
  for (const Case& c : {Case{2026, {67, 97, 478, 563, 641}}, Case{11, {335, 432}}, Case{1234, {227}}}) {
    Blobs blobs(c.seed);
    for (int pose = 0; pose <= c.poses.back(); ++pose) {
      blobs.next();
      if (std::find(c.poses.begin(), c.poses.end(), pose) == c.poses.end()) continue;
      const ContactSurface::Summary exact = blobs.solve(1e-9, true);
      for (const double asked : {1e-3, 1e-6}) {
        const ContactSurface::Summary s = blobs.solve(asked);
        EXPECT_LE(s.error_estimate, asked) << c.seed << ' ' << pose;
        EXPECT_LE(off_by(s, exact), s.error_estimate + exact.error_estimate) << c.seed << ' ' << pose << ' ' << asked;
      }
    }
  }
}

TEST(MildKinks, LeaveEstimatesTrueWhereTwoRulesAgreeByChance) {
  struct Case {
    std::uint64_t seed;
    int pose;
    double asked;
  };
  for (const Case& c : {Case{11, 1119, 3e-6}, Case{21, 1986, 1e-6}}) {
    Blobs blobs(c.seed);
    for (int pose = 0; pose <= c.pose; ++pose) blobs.next();
    const ContactSurface::Summary exact = blobs.solve(1e-8, true), s = blobs.solve(c.asked);
    EXPECT_LE(off_by(s, exact), s.error_estimate + exact.error_estimate) << c.seed;
  }
}

TEST(MildKinks, AreNotTheOnlyOnesOfAPlate) {
  // At its edges second derivatives jump: there patches are parted at any error.
  benchmarks::Rigid ball(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.22), 1e6, 0.03);
  benchmarks::Rigid plate(benchmarks::wyvill_shape(implicit::ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), 1e6, 0.03);
  benchmarks::Draw draw(3);
  int parted = 0;
  for (int pose = 0; pose < 30; ++pose) {
    benchmarks::press(ball, plate, draw.logarithmic(0.01, 0.3) * 0.07, draw);
    const Executor executor(1);
    const std::array<ContactBody, 2> bodies{ball.body(), plate.body()};
    ContactCandidates candidates;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    std::array<ContactSurface, 2> surface;
    solve_contact_surface(bodies, candidates, {.error = 1e-3}, executor, surface[0]);
    solve_contact_surface(bodies, candidates, {.error = 1e-10}, executor, surface[1]);
    EXPECT_EQ(surface[0].summary.at(0).kinks > 0, surface[1].summary.at(0).kinks > 0) << pose;
    parted += surface[0].summary.at(0).kinks > 0 ? 1 : 0;
  }
  EXPECT_GT(parted, 5);
}

}  // namespace
}  // namespace supple::collision
