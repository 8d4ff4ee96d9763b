#include "supple/implicit/surface_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "implicit/bodies.h"
#include "supple/core/error.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/project.h"
#include "support/allocations.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::random_body;
using testing::Random;
using testing::wyvill_point;

constexpr double kPi = 3.14159265358979323846;

struct Sampled {
  SampleLayout layout;
  SampleState state;
  SurfaceSamples samples;

  explicit Sampled(const Body& body, double spacing) : layout(make_sample_layout(body.skeleton, spacing)) {
    again(body);
  }
  void again(const Body& body, int threads = 1, std::span<const std::uint8_t> active = {}) {
    const Executor executor(threads);
    sample_surface({body.skeleton, layout, body.parts, body.field}, {active}, executor, state, samples);
  }
  [[nodiscard]] double area() const { return std::accumulate(samples.area.begin(), samples.area.end(), 0.0); }
  [[nodiscard]] std::size_t valid() const {
    return static_cast<std::size_t>(std::count(samples.valid.begin(), samples.valid.end(), 1));
  }
};

Primitive turned(ShapeKind shape, const Vec3& size, double radius) {
  Primitive p = wyvill_point(radius);
  p.shape = shape;
  p.size = size;
  p.offset.position = {0.1, -0.2, 0.3};
  p.offset.orientation = Quat(Eigen::AngleAxisd(0.7, Vec3(2, -1, 2) / 3.0));
  return p;
}

struct Lone {
  ShapeKind shape;
  Vec3 size;
  double area;  ///< at distance rho, radius R = 1
  std::vector<Vec3> control = {};
};

// All rays of a large sphere pass through a box about its centre: a few stand for them, with the whole solid angle.
TEST(SurfaceSamples, OfALargeSphereAreFewForASmallBoxAboutItsCentre) {
  const Body body = body_of({{wyvill_point(1e6), Vec3::Zero()}});
  SampleLayout layout;
  const Vec3 half = Vec3::Constant(0.4), centre(0.1, 0.2, 0.3);
  const std::size_t seen = make_sample_layout(body.skeleton, 0.05, body.parts, {centre - half, centre + half}, layout);
  EXPECT_GT(seen, 1u << 17);
  EXPECT_LT(seen, 1u << 19);
  ASSERT_EQ(layout.size(), seen);
  double solid_angle = 0.0;
  for (const Vec3& s : layout.spread) solid_angle += s.z();
  EXPECT_NEAR(solid_angle, 4.0 * 3.14159265358979323846, 1e-8);
}

TEST(SurfaceSamples, OfALonePrimitiveCoverItsRoundedShapeExactly) {
  const double rho = iso_distance(Kernel::wyvill(1.0), 0.5);
  const double sphere = 4.0 * kPi * rho * rho;
  EXPECT_NEAR(sphere, 2.5924356480, 5e-11);  // 4 pi (1 - 2^(-1/3))
  const double a = 0.9, b = 0.6, c = 0.4;  // Steiner: faces + rho (integral of the edges' angles) + the sphere
  for (const Lone& lone :
       {Lone{ShapeKind::Point, {0, 0, 0}, sphere}, Lone{ShapeKind::Segment, {a, 0, 0}, 4 * kPi * rho * a + sphere},
        Lone{ShapeKind::Rectangle, {a, b, 0}, 8 * a * b + 4 * kPi * rho * (a + b) + sphere},
        Lone{ShapeKind::Box, {a, b, c}, 8 * (a * b + b * c + c * a) + 4 * kPi * rho * (a + b + c) + sphere},
        Lone{ShapeKind::Disc, {a, 0, 0}, 2 * kPi * a * a + 2 * kPi * kPi * a * rho + sphere},
        Lone{ShapeKind::Ring, {a, 0, 0}, 4 * kPi * kPi * a * rho}, Lone{ShapeKind::Arc, {a, 1.1, 0}, 4.4 * kPi * a * rho + sphere},
        // A right triangle of legs 0.9 and 1.2: twice its area, pi rho over its perimeter, and the sphere.
        Lone{ShapeKind::Triangle, {0, 0, 0}, 1.08 + 3.6 * kPi * rho + sphere, {{0, 0, 0}, {0.9, 0, 0}, {0, 1.2, 0}}},
        Lone{ShapeKind::Polygon, {0, 0, 0}, 2.16 + 4.2 * kPi * rho + sphere, {{0, 0, 0}, {0.9, 0, 0}, {0.9, 0, 1.2}, {0, 0, 1.2}}},
        Lone{ShapeKind::Curve, {0, 0, 0}, 3 * kPi * rho + sphere, {{0, 0, 0}, {0.5, 1, 1}, {0.5, 1, 1}}}}) {
    Primitive primitive = turned(lone.shape, lone.size, 1.0);
    primitive.control = lone.control;
    const Body body = body_of({{primitive, Vec3(1, 2, 3)}});
    const Sampled sampled(body, 0.1);
    EXPECT_EQ(sampled.valid(), sampled.layout.size());
    EXPECT_EQ(sampled.samples.failures, 0u);
    EXPECT_NEAR(sampled.area(), lone.area, 1e-11 * lone.area) << static_cast<int>(lone.shape);
  }
}

TEST(SurfaceSamples, OfAStretchedBallAreThoseOfAnEllipsoid) {
  Primitive ball = turned(ShapeKind::Point, Vec3::Zero(), 1.0);
  ball.stretch = {0.5, 0.8, 1.2};
  const Body stretched = body_of({{ball, Vec3(1, 2, 3)}});
  const Body ellipsoid = body_of({{turned(ShapeKind::Ellipsoid, ball.stretch, 1.0), Vec3(1, 2, 3)}});
  const Sampled a(stretched, 0.03), b(ellipsoid, 0.03);
  EXPECT_NEAR(a.area(), b.area(), 2e-3 * b.area());  // different directions; each errs by order two in 0.03 / 0.23
}

TEST(SurfaceSamples, OfCurvesConvergeToTheAreaOfTheMesh) {
  Primitive p = turned(ShapeKind::Curve, Vec3::Zero(), 0.5);
  p.control = {{-0.8, 0, 0}, {-0.2, 0.9, 0}, {0.4, -0.7, 0.4}, {0.9, 0.2, 0}};
  p.taper = 1.4;
  const Body body = body_of({{p, Vec3(1, 2, 3)}});
  const Sampled sampled(body, 0.02);
  const double area = inspect(polygonise(body.field, Lattice{Vec3::Zero(), 0.02}, Executor(1))).area;
  // Order two of the mesh in 0.02 / 0.23; rays across the axis meet the cone aslant, and at the ends leave a gap or an
  // overlap of the slope (0.1) times the perimeter times the radius.
  EXPECT_NEAR(sampled.area(), area, 0.03 * area);
}

TEST(SurfaceSamples, OfAnEllipsoidConvergeToItsArea) {
  // Surface of the ellipsoid with semi-axes s (0.5, 0.8, 1.2), s = 0.454202019 for kernel radius 1: midpoint rule of
  // order 2 on a smooth integrand, checked against four times finer cells.
  const Body body = body_of({{turned(ShapeKind::Ellipsoid, {0.5, 0.8, 1.2}, 1.0), Vec3(1, 2, 3)}});
  const double fine = Sampled(body, 0.005).area();
  const double error1 = std::abs(Sampled(body, 0.08).area() - fine);
  const double error2 = std::abs(Sampled(body, 0.04).area() - fine);
  EXPECT_LT(error2, 2e-3 * fine);
  EXPECT_LT(error2, 0.4 * error1);
}

TEST(SampleLayout, SeedsStandForAtMostTheSpacingSquared) {
  for (const ShapeKind shape : {ShapeKind::Point, ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc,
                                ShapeKind::Box, ShapeKind::Ellipsoid}) {
    const Body body = body_of({{turned(shape, {0.9, 0.6, 0.4}, 1.0), Vec3::Zero()}});
    for (const double spacing : {1.0, 0.1, 0.03}) {
      const Sampled sampled(body, spacing);
      EXPECT_GE(sampled.layout.size(), 32u);
      for (const double area : sampled.samples.area) EXPECT_LE(area, spacing * spacing * (1 + 1e-12));
    }
  }
  EXPECT_THROW(static_cast<void>(make_sample_layout(Skeleton{}, 0.0)), ContractViolation);
}

TEST(SampleLayout, TakesASpacingForEachPrimitive) {
  // A ball of a tenth of the size has as many seeds at a tenth of the spacing, and a hundredth of them at the same.
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(0.1), Vec3(2.0, 0.0, 0.0)}});
  const auto seeds = [](const SampleLayout& layout, std::uint32_t primitive) { return std::count(layout.primitive.begin(), layout.primitive.end(), primitive); };
  const SampleLayout same = make_sample_layout(body.skeleton, 0.01), own = make_sample_layout(body.skeleton, std::array{0.1, 0.01});
  EXPECT_EQ(seeds(own, 0), seeds(own, 1));
  EXPECT_EQ(seeds(own, 1), seeds(same, 1));
  EXPECT_GT(seeds(same, 0), 50 * seeds(own, 0));
  EXPECT_EQ(make_sample_layout(body.skeleton, std::array{0.01, 0.01}).direction, same.direction);
  EXPECT_THROW(static_cast<void>(make_sample_layout(body.skeleton, std::array{0.01})), ContractViolation);
}

TEST(SampleLayout, IsSymmetricAboutThePlanesOfAPlate) {
  // What is symmetric gets no torque from its sampling: first moments of area and direction vanish.
  Primitive p = turned(ShapeKind::Rectangle, {0.9, 0.6, 0.0}, 1.0);
  p.offset = Pose{};
  const Body body = body_of({{p, Vec3::Zero()}});
  const Sampled sampled(body, 0.1);
  Vec3 first = Vec3::Zero(), normals = Vec3::Zero();
  for (std::size_t s = 0; s < sampled.layout.size(); ++s) {
    first += sampled.samples.area[s] * sampled.samples.point[s];
    normals += sampled.samples.area[s] * sampled.samples.normal[s];
  }
  EXPECT_LT(first.norm(), 1e-12);
  EXPECT_LT(normals.norm(), 1e-12);
}

class SampledBody : public ::testing::TestWithParam<testing::BodyOptions> {
 protected:
  Body body_ = random_body(GetParam());
};

double contribution(const Body& body, std::size_t k, const Vec3& x) {
  const Primitive& p = body.skeleton.primitive[k];
  const Vec3 away = x - body.placed.position[k];
  const Vec3 y = body.placed.rotation.empty() ? away : Vec3(body.placed.rotation[k].transpose() * away);
  return evaluate(p.kernel, evaluate(p, y).q).value;
}

TEST_P(SampledBody, ValidSamplesLieOnTheSurfaceInTheirTerritory) {
  const Sampled sampled(body_, 0.15);
  std::size_t valid = 0;
  for (std::size_t s = 0; s < sampled.layout.size(); ++s) {
    if (sampled.samples.valid[s] == 0) {
      EXPECT_EQ(sampled.samples.area[s], 0.0);
      continue;
    }
    ++valid;
    const Vec3& x = sampled.samples.point[s];
    Vec3 gradient;
    EXPECT_LE(std::abs(FieldView(body_.field).value(x, gradient)), 1e-13);
    EXPECT_LT((sampled.samples.normal[s] + gradient.normalized()).norm(), 1e-10);
    EXPECT_GE(sampled.samples.area[s], 0.0);
    const double own = contribution(body_, sampled.layout.primitive[s], x);
    for (std::size_t k = 0; k < body_.skeleton.primitive.size(); ++k) {
      EXPECT_LE(contribution(body_, k, x), own + 1e-14);
    }
    const Pose& part = body_.parts[sampled.layout.part[s]];
    const Vec3 along = x - part.to_world(sampled.layout.foot[s]);
    EXPECT_NEAR(along.dot(part.orientation * sampled.layout.direction[s]), sampled.state.distance[s], 1e-13);
    EXPECT_LE(sampled.state.distance[s], sampled.layout.reach[s]);
  }
  EXPECT_GT(valid, 100u);
}

TEST_P(SampledBody, FindsTheOutermostRootOfItsTerritoryThatDenseSamplingSees) {
  const Sampled sampled(body_, 0.15);
  constexpr int kSteps = 2000;
  std::vector<Vec3> points(kSteps + 1);
  std::vector<double> values(kSteps + 1);
  int compared = 0, missed = 0;
  for (std::size_t s = 0; s < sampled.layout.size(); s += 3) {
    const Pose& part = body_.parts[sampled.layout.part[s]];
    const Vec3 origin = part.to_world(sampled.layout.foot[s]);
    const Vec3 direction = part.orientation * sampled.layout.direction[s];
    const double step = sampled.layout.reach[s] / kSteps;
    for (int i = 0; i <= kSteps; ++i) points[i] = origin + i * step * direction;
    body_.field.evaluate(points, values);
    double outermost = -1.0, own = -1.0;
    for (int i = kSteps - 1; i >= 0; --i) {
      if (!(values[i] > 0.0 && values[i + 1] <= 0.0)) continue;
      const Vec3 root = root_on_segment(body_.field, points[i], points[i + 1]);
      const double t = (root - origin).norm();
      if (outermost < 0.0) outermost = t;
      bool mine = true;
      const double f = contribution(body_, sampled.layout.primitive[s], root);
      for (std::size_t k = 0; k < body_.skeleton.primitive.size(); ++k) {
        mine = mine && contribution(body_, k, root) <= f;
      }
      if (mine && own < 0.0) own = t;
    }
    const double expected = own >= 0.0 ? own : outermost;
    ++compared;
    missed += std::abs(expected - sampled.state.distance[s]) > 1e-9;
    EXPECT_EQ(sampled.samples.valid[s] == 1, own >= 0.0) << s;
  }
  EXPECT_EQ(missed, 0);
  EXPECT_GT(compared, 100);
}

TEST_P(SampledBody, DoNotDependOnWhereTheyStart) {
  const Sampled fresh(body_, 0.2);
  Sampled moved(body_, 0.2);
  Random random(5);
  for (std::size_t s = 0; s < moved.layout.size(); ++s) {
    moved.state.distance[s] = random.uniform(-0.5, 1.0) * moved.layout.reach[s];
  }
  moved.again(body_);
  for (std::size_t s = 0; s < moved.layout.size(); ++s) {
    EXPECT_NEAR(moved.state.distance[s], fresh.state.distance[s], 1e-13 * moved.layout.reach[s]);
    EXPECT_EQ(moved.samples.valid[s], fresh.samples.valid[s]);
  }
}

TEST_P(SampledBody, ThreadsDoNotChangeABit) {
  const Sampled alone(body_, 0.15);
  for (const int threads : {2, 3, 8}) {
    Sampled shared(body_, 0.15);
    shared.state.distance.clear();
    shared.again(body_, threads);
    EXPECT_EQ(shared.state.distance, alone.state.distance);
    EXPECT_EQ(shared.samples.point, alone.samples.point);
    EXPECT_EQ(shared.samples.normal, alone.samples.normal);
    EXPECT_EQ(shared.samples.area, alone.samples.area);
    EXPECT_EQ(shared.samples.valid, alone.samples.valid);
  }
}

TEST_P(SampledBody, InactivePartsKeepTheirDistanceAndAreInvalid) {
  Sampled sampled(body_, 0.2);
  const std::vector<double> before = sampled.state.distance;
  std::vector<std::uint8_t> active(body_.parts.size(), 0);
  active[1] = 1;
  for (Pose& pose : body_.parts) pose.position.x() += 0.01 * pose.position.y();
  body_.place();
  sampled.again(body_, 1, active);
  std::uint64_t visited = 0;
  for (std::size_t s = 0; s < sampled.layout.size(); ++s) {
    if (sampled.layout.part[s] == 1) {
      ++visited;
    } else {
      EXPECT_EQ(sampled.state.distance[s], before[s]);
      EXPECT_EQ(sampled.samples.valid[s], 0);
    }
  }
  EXPECT_EQ(sampled.samples.visited, visited);
}

TEST_P(SampledBody, AllocateNothingOnceWarm) {
  Sampled sampled(body_, 0.2);
  const Executor executor(1);
  PlacedSkeleton placed;
  Field field;
  const auto step = [&] {
    place_skeleton(body_.skeleton, body_.parts, placed);
    index_field(body_.skeleton, placed, field);
    sample_surface({body_.skeleton, sampled.layout, body_.parts, field}, {}, executor, sampled.state, sampled.samples);
    static_cast<void>(field.bound(body_.placed.support[0]));
    static_cast<void>(field.surface_box());
  };
  step();
  const std::uint64_t before = supple::test::allocation_count();
  step();
  EXPECT_EQ(supple::test::allocation_count(), before);
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, SampledBody,
    ::testing::Values(testing::BodyOptions{.seed = 1, .parts = 3}, testing::BodyOptions{.seed = 2, .parts = 12},
                      testing::BodyOptions{.seed = 3, .parts = 6, .primitives_per_part = 3},
                      testing::BodyOptions{.seed = 9, .parts = 8, .every_shape = true},
                      testing::BodyOptions{
                          .seed = 4, .parts = 90, .half_width = 0.8, .least_radius = 0.3, .largest_radius = 0.5}));

TEST(SurfaceSamples, SumToTheAreaOfABlendedBody) {
  // Two merged points against a mesh whose own error is of order (cell / radius)^2 / 10 < 1e-4. The seeds err by the
  // cells that the territories' border cuts: a strip of width spacing, at random signs, well below 1 %.
  const Body body = body_of({{wyvill_point(1.0), Vec3(-0.4, 0, 0)}, {wyvill_point(0.9), Vec3(0.4, 0.1, 0)}});
  const Executor executor(1);
  const double exact = inspect(polygonise(body.field, Lattice{Vec3::Zero(), 0.02}, executor)).area;
  EXPECT_NEAR(Sampled(body, 0.1).area(), exact, 1e-2 * exact);
  EXPECT_NEAR(Sampled(body, 0.02).area(), exact, 2e-3 * exact);
}

TEST(SurfaceSamples, SeeANarrowGapBetweenTwoParts) {
  // Just unmerged, D = 1.2175 (merging at 1.216617401): the gap is 0.05 wide, a fifth of the station spacing, and the
  // facing point of each part is on the line between them, before the other part's far side.
  const double D = 1.2175;
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(1.0), Vec3(D, 0, 0)}});
  const double facing = root_on_segment(body.field, Vec3::Zero(), Vec3(D / 2, 0, 0)).x();
  EXPECT_GT(2 * (D / 2 - facing), 0.02);
  EXPECT_LT(2 * (D / 2 - facing), 0.1);
  SampleLayout layout;  // one seed of the first part that looks straight at the second
  layout.primitive = {0};
  layout.part = {0};
  layout.foot = {Vec3::Zero()};
  layout.direction = {Vec3::UnitX()};
  layout.reach = {1.0};
  layout.spread = {Vec3(0, 0, 1)};
  SampleState state;
  SurfaceSamples samples;
  const Executor executor(1);
  sample_surface({body.skeleton, layout, body.parts, body.field}, {}, executor, state, samples);
  EXPECT_EQ(samples.valid[0], 1);
  EXPECT_NEAR(state.distance[0], facing, 1e-14);
}

TEST(SurfaceSamples, FollowAMovingBodyAsIfTheyWereNew) {
  Body body = random_body({.seed = 9, .parts = 8});
  Sampled kept(body, 0.2);
  for (int step = 0; step < 20; ++step) {
    Random random(static_cast<std::uint64_t>(step));
    for (Pose& pose : body.parts) {
      pose.position += 0.02 * random.in_box(1.0);
      pose.orientation = (pose.orientation * Quat(Eigen::AngleAxisd(0.05, random.direction()))).normalized();
    }
    body.place();
    kept.again(body);
  }
  const Sampled fresh(body, 0.2);
  EXPECT_EQ(kept.samples.valid, fresh.samples.valid);
  EXPECT_NEAR(kept.area(), fresh.area(), 1e-11);
}

TEST(SurfaceSamples, CountSeedsWithoutARoot) {
  Body body;
  body.skeleton.iso = 1.5;  // above the peak of a lone kernel
  body.skeleton.part_count = 1;
  body.skeleton.primitive = {wyvill_point(1.0)};
  body.parts.resize(1);
  body.place();
  const Sampled sampled(body, 0.3);
  EXPECT_EQ(sampled.samples.failures, sampled.layout.size());
  EXPECT_EQ(sampled.valid(), 0u);
  for (const double t : sampled.state.distance) EXPECT_LT(t, 0.0);
}

// Near a box the samples are those of the whole body, bit by bit; others keep their distance.
TEST(SurfaceSamples, NearABoxAreThoseOfAllThatLieThere) {
  const Body body = body_of({{wyvill_point(1.0), Vec3(-0.4, 0, 0)}, {wyvill_point(0.8), Vec3(0.4, 0.1, 0)}});
  const SampleLayout layout = make_sample_layout(body.skeleton, 0.05);
  const Executor executor(2);
  SampleState all_state, near_state;
  SurfaceSamples all, some;
  sample_surface({body.skeleton, layout, body.parts, body.field}, {}, executor, all_state, all);
  EXPECT_EQ(all.visited, layout.size());
  const std::vector<double> found = all_state.distance;
  sample_surface({body.skeleton, layout, body.parts, body.field}, {}, executor, all_state, all);
  EXPECT_EQ(all_state.distance, found);  // again, from where they are
  const std::array boxes{Box{Vec3(0.3, -0.2, 0.1), Vec3(0.9, 0.3, 0.9)}, Box{Vec3(-1, -1, -0.1), Vec3(-0.7, 0, 0)}};
  sample_surface({body.skeleton, layout, body.parts, body.field}, {{}, boxes}, executor, near_state, some);
  std::size_t inside = 0, outside = 0;
  for (std::size_t s = 0; s < layout.size(); ++s) {
    if (all.valid[s] == 0) continue;
    if (std::any_of(boxes.begin(), boxes.end(), [&](const Box& box) { return box.contains(all.point[s]); })) {
      EXPECT_EQ(some.valid[s], 1);
      EXPECT_EQ(some.point[s], all.point[s]);
      EXPECT_EQ(some.area[s], all.area[s]);
      ++inside;
    } else if (some.valid[s] == 0) {
      EXPECT_LT(near_state.distance[s], 0.0);  // never looked for
      ++outside;
    }
  }
  EXPECT_GT(inside, 20u);
  EXPECT_GT(outside, 2 * inside);
  EXPECT_LT(some.visited, all.visited / 2);
}

// Samples of a rigid body move with it: they are those of a new search, and do not depend on what was asked for before.
TEST(RigidSamples, AreThoseOfANewSearchWhereverTheBodyIs) {
  Body body = random_body({.seed = 21, .parts = 1, .primitives_per_part = 8, .every_shape = true});
  const SampleLayout layout = make_sample_layout(body.skeleton, 0.1);
  const Executor executor(2);
  RigidSamples kept;
  Random random(6);
  std::size_t valid = 0;
  for (int step = 0; step < 8; ++step) {
    body.parts[0] = {2.0 * random.in_box(1.0), Quat(Eigen::AngleAxisd(3.0 * step, random.direction()))};
    body.place();
    const Vec3 corner = body.parts[0].position;
    const std::array boxes{Box{corner, corner + Vec3::Constant(0.3 * step)}};
    const SampledRegion region{{}, step == 7 ? std::span<const Box>() : boxes};
    SampleState searched_state, moved_state, fresh_state;
    SurfaceSamples searched, moved, fresh;
    RigidSamples unused;
    sample_surface({body.skeleton, layout, body.parts, body.field}, region, executor, searched_state, searched);
    sample_surface({body.skeleton, layout, body.parts, body.field, &kept}, region, executor, moved_state, moved);
    sample_surface({body.skeleton, layout, body.parts, body.field, &unused}, region, executor, fresh_state, fresh);
    EXPECT_EQ(moved_state.distance, fresh_state.distance);
    EXPECT_EQ(moved.point, fresh.point);
    EXPECT_EQ(moved.area, fresh.area);
    EXPECT_EQ(moved.valid, searched.valid);
    EXPECT_EQ(moved.visited, searched.visited);
    EXPECT_EQ(moved.failures, searched.failures);
    for (std::size_t s = 0; s < layout.size(); ++s) {
      // Round-off of places about 3 away, over the least slope of the field along a ray.
      EXPECT_NEAR(moved_state.distance[s], searched_state.distance[s], 1e-12 * layout.reach[s]);
      EXPECT_LT((moved.normal[s] - searched.normal[s]).norm(), 1e-10);
      EXPECT_NEAR(moved.area[s], searched.area[s], 1e-10 * layout.reach[s] * layout.reach[s]);
      valid += moved.valid[s];
    }
  }
  EXPECT_GT(valid, 1000u);
}

TEST(SampleState, SurvivesSavingAndLoading) {
  const Body body = random_body({.seed = 10, .parts = 4});
  const Sampled sampled(body, 0.3);
  StateWriter writer;
  sampled.state.save(writer);
  StateReader reader(writer.bytes());
  SampleState loaded;
  loaded.load(reader);
  EXPECT_TRUE(reader.at_end());
  EXPECT_EQ(loaded.distance, sampled.state.distance);
  Hasher a, b;
  sampled.state.hash(a);
  loaded.hash(b);
  EXPECT_EQ(a.value(), b.value());
  loaded.distance[3] += 1e-15;
  Hasher c;
  loaded.hash(c);
  EXPECT_NE(a.value(), c.value());
}

}  // namespace
}  // namespace supple::implicit
