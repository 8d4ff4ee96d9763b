#include "supple/implicit/project.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "implicit/bodies.h"
#include "supple/core/error.h"
#include "supple/implicit/solids.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::random_body;
using testing::Random;
using testing::wyvill_point;

/// Newton along the gradient of one Wyvill point, R = 1, iso 0.5, on the x axis: where it is after n steps.
double iterate(double start, int n) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  return project_to_surface(body.field, Vec3(start, 0, 0), n).point.x();
}

TEST(ProjectToSurface, TakesTheNewtonIteratesOfTheTheory) {
  EXPECT_NEAR(iterate(0.3, 1), 0.470115660, 5e-10);
  EXPECT_NEAR(iterate(0.3, 2), 0.454174099, 5e-10);
  EXPECT_NEAR(iterate(0.3, 3), 0.454202019, 5e-10);
  EXPECT_NEAR(iterate(0.6, 1), 0.438693576, 5e-10);
  EXPECT_NEAR(iterate(0.6, 2), 0.454207057, 5e-10);
  EXPECT_NEAR(iterate(0.6, 3), 0.454202019, 5e-10);
}

TEST(ProjectToSurface, StaysOnItsSideWherePlainNewtonLeavesIt) {
  // Unguarded, 0.8 lands at -0.4542 and 0.95 diverges.
  for (const double start : {0.8, 0.95, 0.99}) {
    const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
    const Projection p = project_to_surface(body.field, Vec3(start, 0, 0));
    EXPECT_TRUE(p.converged) << start;
    EXPECT_NEAR(p.point.x(), 0.454202019, 5e-10) << start;
    EXPECT_LT((p.normal - Vec3::UnitX()).norm(), 1e-15);
  }
}

TEST(ProjectToSurface, ReportsFailureWhereTheFieldIsFlat) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  EXPECT_FALSE(project_to_surface(body.field, Vec3(1.5, 0, 0)).converged);
  EXPECT_FALSE(project_to_surface(body.field, Vec3::Zero()).converged);
}

TEST(ProjectToSurface, ConvergesFromEveryPointNearTheSurfaceOfAnyBody) {
  const Body body = random_body({.seed = 51, .parts = 12});
  Random random(52);
  int tried = 0;
  while (tried < 500) {
    const Vec3 start = random.in_box(1.5);
    if (std::abs(FieldView(body.field).value(start)) > 0.2) continue;
    ++tried;
    const Projection p = project_to_surface(body.field, start);
    EXPECT_TRUE(p.converged) << start.transpose();
    Vec3 gradient;
    EXPECT_LE(std::abs(FieldView(body.field).value(p.point, gradient)), 1e-13);
    EXPECT_LT((p.normal + gradient.normalized()).norm(), 1e-14);
  }
}

TEST(RootOnSegment, FindsTheRootToRoundOff) {
  const Body body = random_body({.seed = 53, .parts = 12});
  Random random(54);
  int tried = 0;
  while (tried < 500) {
    const Vec3 a = random.in_box(1.5);
    const Vec3 b = random.in_box(1.5);
    if (FieldView(body.field).value(a) * FieldView(body.field).value(b) > 0.0) continue;
    ++tried;
    const Vec3 root = root_on_segment(body.field, a, b);
    EXPECT_LT(std::abs(FieldView(body.field).value(root)), 1e-14);  // slope 20 times eps
    EXPECT_NEAR((root - a).norm() + (root - b).norm(), (a - b).norm(), 1e-14);
  }
}

TEST(RootOnSegment, KeepsAnEndThatIsTheRoot) {
  const HalfSpace ground{};
  EXPECT_EQ(root_on_segment(ground, Vec3(0, 0, 0), Vec3(0, 0, 1)), Vec3(0, 0, 0));
  EXPECT_EQ(root_on_segment(ground, Vec3(0, 0, 1), Vec3(1, 0, 0)), Vec3(1, 0, 0));
  EXPECT_THROW(static_cast<void>(root_on_segment(ground, Vec3(0, 0, 1), Vec3(0, 0, 2))), ContractViolation);
}

TEST(Intersect, NeverStepsAcrossASurface) {
  // Against 4,000 samples along each ray: no sample before the hit lies inside, and no inside sample is missed.
  int hits = 0;
  for (const std::uint64_t seed : {61u, 62u, 63u}) {
    const Body body = random_body({.seed = seed, .parts = 15, .half_width = 1.3});
    Random random(seed + 100);
    std::vector<Vec3> points(4000);
    std::vector<double> values(4000);
    for (int ray = 0; ray < 300; ++ray) {
      const Vec3 origin = 3.0 * random.direction();
      const Vec3 direction = (random.in_box(1.2) - origin).normalized();
      const double t_max = 6.0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        points[i] = origin + t_max * static_cast<double>(i) / 3999.0 * direction;
      }
      body.field.evaluate(points, values);
      std::size_t first = 0;
      while (first < points.size() && !(values[first] > 0.0)) ++first;
      const std::optional<double> t = intersect(body.field, origin, direction, t_max);
      if (first < points.size()) {
        ASSERT_TRUE(t.has_value());
        EXPECT_LE(*t, t_max * static_cast<double>(first) / 3999.0 + 1e-12);
      }
      if (t) {
        ++hits;
        EXPECT_LT(std::abs(FieldView(body.field).value(origin + *t * direction)), 1e-9);
      }
    }
  }
  EXPECT_GT(hits, 300);
}

TEST(Intersect, FindsTheSphereOfOnePoint) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  const std::optional<double> head_on = intersect(body.field, Vec3(-3, 0, 0), Vec3::UnitX(), 10.0);
  ASSERT_TRUE(head_on.has_value());
  EXPECT_NEAR(*head_on, 3.0 - radius, 1e-14);
  const std::optional<double> grazing = intersect(body.field, Vec3(-3, radius - 1e-6, 0), Vec3::UnitX(), 10.0);
  ASSERT_TRUE(grazing.has_value());
  EXPECT_NEAR(*grazing, 3.0 - std::sqrt(radius * radius - std::pow(radius - 1e-6, 2)), 1e-9);
  EXPECT_FALSE(intersect(body.field, Vec3(-3, radius + 1e-6, 0), Vec3::UnitX(), 10.0).has_value());
  const std::optional<double> outwards = intersect(body.field, Vec3::Zero(), Vec3::UnitX(), 10.0);
  ASSERT_TRUE(outwards.has_value());
  EXPECT_NEAR(*outwards, radius, 1e-15);
  EXPECT_FALSE(intersect(body.field, Vec3(-3, 0, 0), Vec3::UnitX(), 1.0).has_value());
}

/// Closed forms for rays from far away: t of the first meeting, or nothing.
std::optional<double> sphere_hit(const Vec3& origin, const Vec3& direction, double radius) {
  const double b = origin.dot(direction);
  const double disc = b * b - (origin.squaredNorm() - radius * radius);
  if (disc < 0.0) return std::nullopt;
  return -b - std::sqrt(disc);
}

TEST(Intersect, GrazedSpheresAreMetAndMissedToRoundOff) {
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  Random random(71);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 direction = random.direction();
    const Vec3 side = direction.cross(random.direction()).normalized();
    for (const double share : {1e-3, 1e-6, 1e-9, 1e-12}) {
      const Vec3 inside = (1.0 - share) * radius * side - 2.0 * direction;
      const std::optional<double> hit = intersect(body.field, inside, direction, 10.0);
      ASSERT_TRUE(hit.has_value()) << share;
      // A grazing ray magnifies the rounding of the radius (1e-15) by 1 / sqrt(2 share).
      EXPECT_NEAR(*hit, 2.0 - radius * std::sqrt(share * (2.0 - share)), 1e-15 + 4e-15 / std::sqrt(2.0 * share)) << share;
      const Vec3 outside = (1.0 + share) * radius * side - 2.0 * direction;
      EXPECT_FALSE(intersect(body.field, outside, direction, 10.0).has_value()) << share;
    }
  }
}

TEST(Intersect, MeetsConesRoundedPlatesAndRingsWhereTheirFormulasSay) {
  const double rho = iso_distance(Kernel::wyvill(0.5), 0.5);
  Random random(72);
  Primitive ring = wyvill_point(0.5);
  ring.shape = ShapeKind::Ring;
  ring.size = {1.0, 0.0, 0.0};
  const Body torus = body_of({{ring, Vec3::Zero()}});
  Primitive plate = wyvill_point(0.5);
  plate.shape = ShapeKind::Rectangle;
  plate.size = {1.0, 1.0, 0.0};
  const Body slab = body_of({{plate, Vec3::Zero()}});
  Primitive egg = wyvill_point(1.0);
  egg.stretch = {0.4, 0.9, 1.3};
  const Body ellipsoid = body_of({{egg, Vec3::Zero()}});
  for (int trial = 0; trial < 300; ++trial) {
    // Down on the ring's tube: height sqrt(rho^2 - (r - 1)^2).
    const double r = 1.0 + random.uniform(-0.999, 0.999) * rho, angle = random.uniform(0.0, 6.28);
    const Vec3 above(r * std::cos(angle), r * std::sin(angle), 3.0);
    const std::optional<double> down = intersect(torus.field, above, -Vec3::UnitZ(), 10.0);
    ASSERT_TRUE(down.has_value());
    EXPECT_NEAR(*down, 3.0 - std::sqrt(rho * rho - (r - 1.0) * (r - 1.0)), 1e-12);
    EXPECT_FALSE(intersect(torus.field, Vec3(0.0, 0.0, 3.0), -Vec3::UnitZ(), 10.0).has_value());  // through the hole
    // The flat part of the plate.
    const Vec3 target(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), rho);
    const Vec3 direction = Vec3(random.uniform(-1, 1), random.uniform(-1, 1), -1.0).normalized();
    const Vec3 origin = target - 0.1 * direction / -direction.z();
    const std::optional<double> flat = intersect(slab.field, origin, direction, 10.0);
    ASSERT_TRUE(flat.has_value());
    EXPECT_NEAR(*flat, (target - origin).norm(), 1e-13);
    // An ellipsoid is a sphere in stretched coordinates.
    const Vec3 from = 3.0 * random.direction();
    const Vec3 towards = (random.in_box(0.5) - from).normalized();
    const Vec3 y = from.cwiseQuotient(egg.stretch), u = towards.cwiseQuotient(egg.stretch);
    const std::optional<double> expected = sphere_hit(y, u.normalized(), 2.0 * rho);
    const std::optional<double> found = intersect(ellipsoid.field, from, towards, 10.0);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (found) {
      EXPECT_NEAR(*found, *expected / u.norm(), 1e-9);  // grazing rays magnify 1e-16 by up to 1e5 here
    }
  }
}

TEST(Intersect, SeesFilmsThinnerThanAnyStep) {
  // Two balls overlap in a lens whose field exceeds the iso value by 1e-12 only: a ray across it must stop there.
  const double merge = 2.0 * std::sqrt(1.0 - std::cbrt(0.25));  // the saddle touches zero at this distance
  const auto through = [&](double D) {
    const Body body = body_of({{wyvill_point(1.0), Vec3(-D / 2, 0, 0)}, {wyvill_point(1.0), Vec3(D / 2, 0, 0)}});
    return intersect(body.field, Vec3(0, -2, 0), Vec3::UnitY(), 10.0);
  };
  EXPECT_TRUE(through(merge - 1e-12).has_value());
  EXPECT_NEAR(*through(merge - 1e-12), 2.0, 2e-6);
  EXPECT_FALSE(through(merge + 1e-12).has_value());
}

TEST(Intersect, MissesNoTubeOfARingWhoseMiddleIsInItsSupport) {
  // Across a ring q falls, rises and falls again before it rises: slopes of one sign at two ends say nothing of between.
  Primitive ring = wyvill_point(1.2);
  ring.shape = ShapeKind::Ring;
  ring.size = {0.5, 0.0, 0.0};
  Body body = body_of({{ring, Vec3::Zero()}});
  body.skeleton.iso = 0.9;
  body.place();
  Random random(91);
  constexpr int kSamples = 3000;
  constexpr double kMost = 4.0;
  int hits = 0;
  for (int ray = 0; ray < 400; ++ray) {
    const Vec3 origin = 2.0 * random.direction();
    const Vec3 direction = (random.in_box(0.6) - origin).normalized();
    int first = 0;
    while (first < kSamples && FieldView(body.field).value(origin + kMost * first / kSamples * direction) < 0.0) ++first;
    if (first == kSamples) continue;
    const std::optional<double> t = intersect(body.field, origin, direction, kMost);
    ASSERT_TRUE(t.has_value()) << ray;
    EXPECT_LE(*t, kMost * first / kSamples) << ray;
    ++hits;
  }
  EXPECT_GT(hits, 100);
}

TEST(Intersect, MissesNoSurfaceOfAnyShape) {
  // Against 20,000 samples along each ray: the hit is no later than the first sample of another sign.
  int hits = 0;
  for (const std::uint64_t seed : {81u, 82u, 83u}) {
    const Body body = random_body({.seed = seed, .parts = 15, .half_width = 1.3, .every_shape = true});
    Random random(seed + 100);
    constexpr std::size_t kSamples = 20000;
    std::vector<Vec3> points(kSamples);
    std::vector<double> values(kSamples);
    for (int ray = 0; ray < 60; ++ray) {
      const bool inside = ray % 3 == 0;
      const Vec3 origin = inside ? random.in_box(1.0) : Vec3(3.0 * random.direction());
      const Vec3 direction = (random.in_box(1.2) - origin).normalized();
      const double t_max = 6.0;
      for (std::size_t i = 0; i < kSamples; ++i) {
        points[i] = origin + t_max * static_cast<double>(i) / (kSamples - 1.0) * direction;
      }
      body.field.evaluate(points, values);
      std::size_t first = 0;
      while (first < kSamples && (values[first] > 0.0) == (values[0] > 0.0)) ++first;
      const std::optional<double> t = intersect(body.field, origin, direction, t_max);
      if (first < kSamples) {
        ASSERT_TRUE(t.has_value()) << seed << ' ' << ray;
        EXPECT_LE(*t, t_max * static_cast<double>(first) / (kSamples - 1.0) + 1e-12);
      }
      if (t) {
        ++hits;
        EXPECT_LT(std::abs(FieldView(body.field).value(origin + *t * direction)), 1e-12);
      }
    }
  }
  EXPECT_GT(hits, 80);
}

TEST(Intersect, MeetsTheSurfaceOfEveryBlendAndNothingElse) {
  // Against 4,000 samples along each ray. Blends by gradients have no bound of |grad F| where two nodes meet, which must not count as a hit.
  for (const BlendRule rule : {BlendRule::Graph, BlendRule::Ricci, BlendRule::Gradient}) {
    int hits = 0, passes = 0;
    for (const std::uint64_t seed : {71u, 72u, 73u}) {
      Body body = random_body({.seed = seed, .parts = 6, .half_width = 0.7, .every_shape = true});
      body.skeleton.blend.rule = rule;
      if (rule == BlendRule::Graph) body.skeleton.blend.edge = {{0, 1, 1.0}, {1, 2, 0.5}, {3, 4, 1.0}};
      body.place();
      Random random(seed + 100);
      constexpr int kSamples = 4000;
      constexpr double kMost = 5.0;
      for (int ray = 0; ray < 40; ++ray) {
        const Vec3 origin = 2.2 * random.direction();
        const Vec3 direction = (random.in_box(1.2) - origin).normalized();
        const double at_start = FieldView(body.field).value(origin);
        int first = 0;
        while (first <= kSamples && (FieldView(body.field).value(origin + kMost * first / kSamples * direction) > 0.0) == (at_start > 0.0)) ++first;
        const std::optional<double> t = intersect(body.field, origin, direction, kMost);
        if (first <= kSamples) {
          ASSERT_TRUE(t.has_value()) << static_cast<int>(rule) << ' ' << seed << ' ' << ray;
          EXPECT_LE(*t, kMost * first / kSamples) << static_cast<int>(rule) << ' ' << seed << ' ' << ray;
          ++hits;
        } else {
          ++passes;
        }
        if (t) {
          EXPECT_LT(std::abs(FieldView(body.field).value(origin + *t * direction)), 1e-9) << static_cast<int>(rule) << ' ' << seed << ' ' << ray;
        }
      }
    }
    EXPECT_GT(hits, 30);
    EXPECT_GT(passes, 10);
  }
}

/// The largest value on a ray: samples, and a ternary search about the best.
std::pair<double, double> peak_on_ray(const Field& field, const Vec3& origin, const Vec3& direction, double t_max) {
  constexpr int kSamples = 6000;
  const auto value = [&](double t) { return FieldView(field).value(origin + t * direction); };
  int best = 0;
  double most = value(0.0);
  for (int i = 1; i <= kSamples; ++i) {
    const double f = value(t_max * i / kSamples);
    if (f > most) {
      most = f;
      best = i;
    }
  }
  double low = t_max * std::max(best - 1, 0) / kSamples, high = t_max * std::min(best + 1, kSamples) / kSamples;
  while (high - low > 1e-14) {
    const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
    if (value(a) < value(b)) {
      low = a;
    } else {
      high = b;
    }
  }
  return {0.5 * (low + high), std::max(most, value(0.5 * (low + high)))};
}

struct Rule {
  const char* name;
  BlendRule rule;
  bool convolved;
  double gap;    ///< of F, at which a ray passes: bounds are of second order, of blends by gradients of first
  double touch;  ///< of F, that counts as meeting
};
std::ostream& operator<<(std::ostream& out, const Rule& r) { return out << r.name; }

class IntersectedRule : public ::testing::TestWithParam<Rule> {};

Body body_of_rule(const Rule& r, std::uint64_t seed) {
  Body body = random_body({.seed = seed, .parts = 6, .half_width = 0.6, .every_shape = !r.convolved});
  if (r.convolved) {
    Random random(seed);
    for (Primitive& p : body.skeleton.primitive) {
      constexpr ShapeKind kShapes[] = {ShapeKind::Point, ShapeKind::Segment, ShapeKind::Triangle, ShapeKind::Ring, ShapeKind::Arc};
      p.shape = kShapes[random.below(5)];
      p.kernel = Kernel::cauchy(0.8, random.uniform(1.5, 3.0));
      p.convolved = p.shape != ShapeKind::Point;
      p.size = {random.uniform(0.2, 0.5), random.uniform(0.5, 3.0), 0.0};
      p.control.clear();
      if (p.shape == ShapeKind::Triangle) p.control = {random.in_box(0.4), random.in_box(0.4), random.in_box(0.4)};
    }
  }
  body.skeleton.blend.rule = r.rule;
  if (r.rule == BlendRule::Graph) body.skeleton.blend.edge = {{0, 1, 1.0}, {1, 2, 0.5}, {3, 4, 1.0}};
  body.place();
  return body;
}

// The iso value is set so that a ray dives under the surface by 1e-13 of F, for some ten-millionths of its length, or passes above it.
TEST_P(IntersectedRule, IsMetByRaysThatHardlyTouch) {
  constexpr double kMost = 5.0;
  int rays = 0;
  for (const std::uint64_t seed : {171u, 172u, 173u}) {
    Body body = body_of_rule(GetParam(), seed);
    Random random(seed + 100);
    for (int trial = 0; trial < 12; ++trial) {
      const Vec3 origin = 2.2 * random.direction();
      const Vec3 direction = (random.in_box(0.9) - origin).normalized();
      const double iso = body.skeleton.iso;
      const auto [at, most] = peak_on_ray(body.field, origin, direction, kMost);
      if (!(most > -0.9 * iso) || at < 1e-3) continue;
      ++rays;
      body.skeleton.iso = iso + most - 1e-13;
      body.place();
      const std::optional<double> dives = intersect(body.field, origin, direction, kMost);
      EXPECT_TRUE(dives.has_value()) << seed << ' ' << trial;
      if (dives) {
        EXPECT_LT(std::abs(FieldView(body.field).value(origin + *dives * direction)), GetParam().touch) << seed << ' ' << trial;
      }
      body.skeleton.iso = iso + most + GetParam().gap;
      body.place();
      EXPECT_FALSE(intersect(body.field, origin, direction, kMost).has_value()) << seed << ' ' << trial;
      body.skeleton.iso = iso;
      body.place();
    }
  }
  EXPECT_GT(rays, 25);
}

// Where the second derivatives of some shape have no bound a ray meets what is nearer than 1e-8 features, here 1 m / 0.6 at most, at slopes of
// up to 16 / m.
constexpr double kFirstOrder = 1e-7;

INSTANTIATE_TEST_SUITE_P(Rules, IntersectedRule,
                         ::testing::Values(Rule{"convolution", BlendRule::Sum, true, 1e-7, kFirstOrder},
                                           Rule{"convolution_ricci", BlendRule::Ricci, true, 1e-7, kFirstOrder},
                                           Rule{"graph", BlendRule::Graph, false, 1e-7, kFirstOrder}, Rule{"ricci", BlendRule::Ricci, false, 1e-7, kFirstOrder},
                                           Rule{"gradient", BlendRule::Gradient, false, 1e-4, 5e-5}),
                         ::testing::PrintToStringParamName());

TEST(Intersect, MeetsABoxThatRaysCutAtAnEdge) {
  // Its slope is the same everywhere outside: steps longer than F / slope would leap over the edge.
  constexpr double kHalf = 0.5, kRound = 0.05;
  const Pose pose{Vec3(0.3, -0.2, 0.1), Quat(0.7, 0.3, -0.4, 0.5).normalized()};
  const SolidBox box(pose, Vec3::Constant(kHalf), kRound, 6.0);
  const Vec3 centre(kHalf - kRound, kHalf - kRound, 0.0);  // of the edge's circle
  Random random(7);
  for (int ray = 0; ray < 500; ++ray) {
    const double turn = random.uniform(-0.3, 0.3), near = random.uniform(0.95, 0.9999) * kRound, away = random.uniform(0.5, 5.0);
    const Vec3 outwards(std::cos(0.25 * std::numbers::pi + turn), std::sin(0.25 * std::numbers::pi + turn), 0.0), along(outwards.y(), -outwards.x(), 0.0);
    const Vec3 origin = centre + near * outwards - away * along + Vec3(0.0, 0.0, random.uniform(-0.4, 0.4));
    const std::optional<double> t = intersect(box, pose.to_world(origin), pose.orientation * along, 10.0);
    ASSERT_TRUE(t.has_value()) << ray;
    const double half_chord = std::sqrt(kRound * kRound - near * near);
    EXPECT_NEAR(*t, away - half_chord, 1e-14 / half_chord) << ray;
  }
}

TEST(Intersect, MeetsAHalfSpace) {
  const HalfSpace ground{};
  const std::optional<double> t = intersect(ground, Vec3(0, 0, 2), Vec3(0.6, 0, -0.8), 100.0);
  ASSERT_TRUE(t.has_value());
  EXPECT_NEAR(*t, 2.5, 1e-14);
  EXPECT_FALSE(intersect(ground, Vec3(0, 0, 2), Vec3(0.6, 0, 0.8), 100.0).has_value());
}

}  // namespace
}  // namespace supple::implicit
