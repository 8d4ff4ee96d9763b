#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "benchmarks/contact_cases.h"
#include "collision/bodies.h"
#include "supple/implicit/kinks.h"

namespace supple::collision {
namespace {

using implicit::Kernel;
using implicit::Kink;
using implicit::Primitive;
using implicit::ShapeKind;
using testing::Stage;

/// A field of primitives in one part.
struct Body {
  implicit::Skeleton skeleton;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  explicit Body(std::vector<Primitive> primitives, const Pose& pose = {}) {
    skeleton.primitive = std::move(primitives);
    skeleton.part_count = 1;
    implicit::place_skeleton(skeleton, {&pose, 1}, placed);
    implicit::index_field(skeleton, placed, field);
  }
};

Primitive make(ShapeKind shape, const Vec3& size, const Kernel& kernel, const Vec3& at = Vec3::Zero()) {
  Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = kernel;
  p.offset = {at, Quat(0.8, 0.3, -0.4, 0.2).normalized()};
  return p;
}

/// Largest error of the polynomial through the values of f at the 21 Chebyshev points of [a, b].
template <class F>
double interpolation_error(double a, double b, const F& f) {
  constexpr int n = 20;
  std::vector<double> x, y, w;
  for (int k = 0; k <= n; ++k) {
    x.push_back(0.5 * (a + b) - 0.5 * (b - a) * math::sin_cos(std::numbers::pi * k / n).cos);
    y.push_back(f(x.back()));
    w.push_back((k % 2 == 0 ? 1.0 : -1.0) * (k == 0 || k == n ? 0.5 : 1.0));
  }
  double worst = 0.0;
  for (int i = 0; i < 97; ++i) {
    const double at = a + (b - a) * (i + 0.37) / 97.0;
    double top = 0.0, bottom = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      top += w[k] * y[k] / (at - x[k]);
      bottom += w[k] / (at - x[k]);
    }
    worst = std::max(worst, std::abs(top / bottom - f(at)));
  }
  return worst;
}

/// Errors of polynomials of a field along at(t), |t| <= reach: one on all of it, and the worst of those between two kinks each.
struct LineErrors {
  double whole = 0.0, pieces = 0.0;
};
template <class Line>
LineErrors errors_along(const Body& body, const std::vector<Kink>& kinks, const Line& at, double reach) {
  const auto f = [&](double t) { return implicit::FieldView(body.field).value(at(t)); };
  std::vector<double> cut{-reach, reach};
  for (const Kink& kink : kinks) {
    constexpr int kSteps = 2000;
    for (int i = 0; i < kSteps; ++i) {
      double low = -reach + 2.0 * reach * i / kSteps, high = low + 2.0 * reach / kSteps;
      const bool side = kink.value(at(low)) > 0.0;
      if ((kink.value(at(high)) > 0.0) == side) continue;
      for (int k = 0; k < 50; ++k) ((kink.value(at(0.5 * (low + high))) > 0.0) == side ? low : high) = 0.5 * (low + high);
      cut.push_back(low);
    }
  }
  std::sort(cut.begin(), cut.end());
  LineErrors errors{interpolation_error(-reach, reach, f), 0.0};
  for (std::size_t i = 0; i + 1 < cut.size(); ++i) {
    // 21 points leave 1e-8 where the nearest pole is as far away as the piece is long; tiny pieces only round.
    if (cut[i + 1] - cut[i] >= 1e-9) errors.pieces = std::max(errors.pieces, interpolation_error(cut[i], cut[i + 1], f));
  }
  return errors;
}

TEST(Kinks, OfArcsAndRingsAreAllKnownAwayFromTheirAxes) {
  Primitive arc = make(ShapeKind::Arc, Vec3(0.5, 1.2, 0), Kernel::wyvill(1.2));
  arc.stretch = Vec3(1.2, 0.9, 1.0);
  const auto [sine, cosine] = math::sin_cos(1.2);
  const Pose pose{Vec3(0.3, -0.2, 0.1), Quat(0.5, 0.1, 0.7, -0.3).normalized()};
  const Quat turn = pose.orientation * arc.offset.orientation;
  const Vec3 end = pose.position + turn * Vec3(1.2 * 0.5 * cosine, 0.9 * 0.5 * sine, 0.0);
  const Vec3 behind = pose.position - turn * Vec3(0.22, 0.0, 0.0);  // nearly as far from both ends
  const Vec3 half = Vec3::Constant(0.08);
  for (const bool ring : {false, true}) {
    arc.shape = ring ? ShapeKind::Ring : ShapeKind::Arc;
    const Body body({arc}, pose);
    std::vector<Kink> kinks;
    EXPECT_FALSE(kinks_of(body.field, body.field.surface_box(), kinks));
    for (const Vec3& middle : {end, behind}) {
      kinks.clear();
      EXPECT_TRUE(kinks_of(body.field, {middle - half, middle + half}, kinks));
      double whole = 0.0;
      for (int line = 0; line < 30; ++line) {
        const auto [s, c] = math::sin_cos(1.7 * line);
        const Vec3 along(0.6 * c, 0.6 * s, 0.8);
        const LineErrors errors = errors_along(body, kinks, [&](double t) { return Vec3(middle + 0.001 * line * along.unitOrthogonal() + t * along); }, 0.08);
        whole = std::max(whole, errors.whole);
        EXPECT_LT(errors.pieces, 1e-7) << line;
      }
      EXPECT_TRUE(ring || whole > 2e-6) << whole;
    }
    // Beside another primitive, the torus at which its kernel ends is not among them.
    const Body two({arc, make(ShapeKind::Point, Vec3::Zero(), Kernel::wyvill(0.6), Vec3(0.5, 0.1, 0))}, pose);
    EXPECT_FALSE(kinks_of(two.field, {end - half, end + half}, kinks));
  }
}

TEST(Kinks, PartEveryLineIntoPiecesOnWhichTheFieldIsSmooth) {
  Primitive triangle = make(ShapeKind::Triangle, Vec3::Zero(), Kernel::wyvill(1.0));
  triangle.control = {Vec3(-0.5, -0.3, 0), Vec3(0.6, -0.2, 0), Vec3(0.0, 0.5, 0)};
  Primitive directed = make(ShapeKind::Directed, Vec3(1.0, 1.2, 1.1), Kernel::wyvill(1.2));
  directed.control = {Vec3(1.3, 1.0, 1.4)};
  const Kernel wyvill = Kernel::wyvill(1.0);
  Primitive narrows = make(ShapeKind::Segment, Vec3(0.3, 0, 0), wyvill), widens = make(ShapeKind::Segment, Vec3(0.2, 0, 0), Kernel::murakami(0.9));
  narrows.taper = 0.7;
  widens.taper = 1.25;
  widens.stretch = Vec3(1.2, 0.9, 1.0);
  const std::vector<std::vector<Primitive>> bodies{
      {make(ShapeKind::Rectangle, Vec3(0.4, 0.3, 0), wyvill)},
      {make(ShapeKind::Segment, Vec3(0.4, 0, 0), wyvill)},
      {make(ShapeKind::Box, Vec3(0.3, 0.2, 0.25), Kernel::soft_object(1.0))},
      {make(ShapeKind::Disc, Vec3(0.4, 0, 0), wyvill)},
      {triangle},
      {directed},
      {narrows},
      {widens},
      {make(ShapeKind::Point, Vec3::Zero(), Kernel::nishimura(1.8))},
      {make(ShapeKind::Point, Vec3::Zero(), Kernel::blanc_schlick(1.6, 0.5)),
       make(ShapeKind::Ellipsoid, Vec3(0.9, 0.7, 0.8), wyvill, Vec3(0.5, 0.1, 0))},
      {make(ShapeKind::Rectangle, Vec3(0.3, 0.3, 0), Kernel::gascuel(0.4, 0.7, 1.5)),
       make(ShapeKind::Disc, Vec3(0.3, 0, 0), Kernel::murakami(0.8), Vec3(0.2, 0.3, 0.2))},
  };
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Body body(bodies[b], {Vec3(0.3, -0.2, 0.1), Quat(0.5, 0.1, 0.7, -0.3).normalized()});
    std::vector<Kink> kinks;
    EXPECT_TRUE(kinks_of(body.field, body.field.surface_box(), kinks)) << b;
    double whole = 0.0;
    for (int line = 0; line < 40; ++line) {
      // Lines that pass the middle at a distance, clear of the cores, whose distance has a cone of its own.
      const auto [s, c] = math::sin_cos(1.7 * line);
      const double z = 2.0 * (line + 0.5) / 40.0 - 1.0;
      const Vec3 n(std::sqrt(1.0 - z * z) * c, std::sqrt(1.0 - z * z) * s, z);
      const Vec3 along = n.unitOrthogonal();
      const auto at = [&](double t) -> Vec3 { return Vec3(0.3, -0.2, 0.1) + 0.55 * n + t * along; };
      const LineErrors errors = errors_along(body, kinks, at, 0.5);
      whole = std::max(whole, errors.whole);
      EXPECT_LT(errors.pieces, 1e-7) << b << " line " << line;
    }
    EXPECT_GT(whole, 1e-5) << b;  // otherwise the pieces prove nothing
  }
}

TEST(Kinks, HaveTheSlopeOfTheirFunctionAndStayOutOfALonePoint) {
  const Body plate({make(ShapeKind::Rectangle, Vec3(0.4, 0.3, 0), Kernel::wyvill(1.0)),
                    make(ShapeKind::Disc, Vec3(0.4, 0, 0), Kernel::wyvill(1.0))});
  std::vector<Kink> kinks;
  EXPECT_TRUE(kinks_of(plate.field, plate.field.surface_box(), kinks));
  EXPECT_EQ(kinks.size(), 4u + 1u + 1u + 1u);  // sides, the support; the disc's edge, its support
  const Vec3 x(0.31, -0.47, 0.29);
  for (const Kink& kink : kinks) {
    for (int k = 0; k < 3; ++k) {
      for (const double way : {-0.4, 0.4}) {
        EXPECT_LE(std::abs(kink.value(x + way * Vec3::Unit(k)) - kink.value(x)), kink.change(x, 0.4) + 1e-12);
      }
    }
    Vec3 slope;
    EXPECT_EQ(kink.value(x, slope), kink.value(x));
    for (int k = 0; k < 3; ++k) {
      constexpr double h = 1e-5;  // leaves h^2 f''' / 6, far below the tolerance
      EXPECT_NEAR(slope[k], (kink.value(x + h * Vec3::Unit(k)) - kink.value(x - h * Vec3::Unit(k))) / (2.0 * h), 1e-7);
    }
  }
  kinks.clear();
  const Body point({make(ShapeKind::Point, Vec3::Zero(), Kernel::wyvill(1.0))});
  EXPECT_TRUE(kinks_of(point.field, point.field.surface_box(), kinks));
  EXPECT_TRUE(kinks.empty());
  Primitive tapered = make(ShapeKind::Segment, Vec3(0.4, 0, 0), Kernel::wyvill(1.0));
  tapered.taper = 0.5;
  EXPECT_TRUE(kinks_of(Body({tapered}).field, point.field.surface_box(), kinks));
  EXPECT_FALSE(kinks_of(Body({tapered, tapered}).field, point.field.surface_box(), kinks));
  tapered.kernel = Kernel::nishimura(1.0);
  EXPECT_FALSE(kinks_of(Body({tapered}).field, point.field.surface_box(), kinks));
}

// A curve along a line is a segment.
TEST(Kinks, OfCurvesLieWhereTheirCapsBegin) {
  for (const double taper : {1.0, 0.7, 1.4}) {
    Primitive line = make(ShapeKind::Segment, Vec3(0.3, 0, 0), Kernel::wyvill(1.0)), curve = make(ShapeKind::Curve, Vec3::Zero(), Kernel::wyvill(1.0));
    line.taper = curve.taper = taper;
    curve.control = {Vec3(-0.3, 0, 0), Vec3(0, 0, 0), Vec3(0.3, 0, 0)};
    const Body a({line}), b({curve});
    std::vector<Kink> of_line, of_curve;
    EXPECT_TRUE(kinks_of(a.field, a.field.surface_box(), of_line));
    EXPECT_FALSE(kinks_of(b.field, b.field.surface_box(), of_curve));  // others are where two of its points are nearest
    ASSERT_GE(of_line.size(), 2u);
    ASSERT_EQ(of_curve.size(), 2u);
    for (const Vec3& x : {Vec3(0.31, -0.47, 0.29), Vec3(-0.2, 0.1, 0.4)}) {
      const std::array<double, 2> lines{std::abs(of_line[0].value(x)), std::abs(of_line[1].value(x))},
          curves{std::abs(of_curve[0].value(x)), std::abs(of_curve[1].value(x))};
      EXPECT_NEAR(std::min(lines[0], lines[1]), std::min(curves[0], curves[1]), 1e-12) << taper;
      EXPECT_NEAR(std::max(lines[0], lines[1]), std::max(curves[0], curves[1]), 1e-12) << taper;
    }
  }
}

/// Integrals over z = 0 of [F]+, of its points and of the area of {F > 0}: along lines of y between rim and kinks by Gauss's
/// rule, over x = middle - half cos(phi) by a fine composite one in phi, in which the lengths of the lines are smooth at the ends
/// of the patch. Nothing of the polar rule is in it.
struct PlaneSums {
  double force = 0.0, area = 0.0;
  Vec3 first = Vec3::Zero();
};
PlaneSums on_plane(const implicit::Field& field, const std::vector<Kink>& kinks, double reach, int lines) {
  constexpr std::array<double, 4> kNode{0.069431844202973714, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
  constexpr std::array<double, 4> kWeight{0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  const implicit::FieldView view(field);
  PlaneSums sums;
  // F has one hill along a line, at y.
  const auto hill = [&](double x) {
    double low = -reach, high = reach;
    for (int k = 0; k < 90; ++k) {
      const double third = (high - low) / 3.0;
      if (view.value(Vec3(x, low + third, 0)) < view.value(Vec3(x, high - third, 0))) {
        low += third;
      } else {
        high -= third;
      }
    }
    return 0.5 * (low + high);
  };
  const auto highest = [&](double x) { return view.value(Vec3(x, hill(x), 0)); };
  double inside = -reach, end[2];
  while (highest(inside) <= 0.0) inside += 0.01 * reach;
  inside += 0.02 * reach;
  for (const int side : {0, 1}) {
    double in = inside, out = side == 0 ? -reach : reach;
    for (int k = 0; k < 60; ++k) (highest(0.5 * (in + out)) > 0.0 ? in : out) = 0.5 * (in + out);
    end[side] = in;
  }
  for (int line = 0; line < lines; ++line) {
    for (std::size_t q = 0; q < kNode.size(); ++q) {
      const auto [s, c] = math::sin_cos(std::numbers::pi * (line + kNode[q]) / lines);
      const double x = 0.5 * (end[0] + end[1]) - 0.5 * (end[1] - end[0]) * c;
      const double dx = 0.5 * (end[1] - end[0]) * s * std::numbers::pi / lines * kWeight[q];
      std::vector<double> cut;
      const double top = hill(x);
      for (const double side : {-reach, reach}) {
        double in = top, out = side;
        for (int k = 0; k < 60; ++k) (view.value(Vec3(x, 0.5 * (in + out), 0)) > 0.0 ? in : out) = 0.5 * (in + out);
        cut.push_back(in);
      }
      const auto cut_at_roots = [&](const auto& g) {
        constexpr int kSteps = 64;
        for (int i = 0; i < kSteps; ++i) {
          double low = -reach + 2.0 * reach * i / kSteps, high = low + 2.0 * reach / kSteps;
          const bool side = g(low) > 0.0;
          if ((g(high) > 0.0) == side) continue;
          for (int k = 0; k < 48; ++k) ((g(0.5 * (low + high)) > 0.0) == side ? low : high) = 0.5 * (low + high);
          cut.push_back(0.5 * (low + high));
        }
      };
      for (const Kink& kink : kinks) cut_at_roots([&](double y) { return kink.value(Vec3(x, y, 0)); });
      std::sort(cut.begin(), cut.end());
      for (std::size_t i = 0; i + 1 < cut.size(); ++i) {
        const double width = cut[i + 1] - cut[i];
        if (view.value(Vec3(x, 0.5 * (cut[i] + cut[i + 1]), 0)) <= 0.0) continue;
        sums.area += dx * width;
        for (std::size_t g = 0; g < kNode.size(); ++g) {
          const Vec3 at(x, cut[i] + width * kNode[g], 0);
          const double p = dx * width * kWeight[g] * view.value(at);
          sums.force += p;
          sums.first += p * at;
        }
      }
    }
  }
  return sums;
}

TEST(SplitRule, AcrossTheEdgesAndTheCornerOfAPlateKeepsItsBoundAndTheErrorAsked) {
  // A plate leans with a corner on a rigid plane: three regions of its field lie on the patch.
  for (const double lean : {0.1, 0.35}) {
    Primitive p;
    p.shape = ShapeKind::Rectangle;
    p.size = Vec3(0.5, 0.5, 0);
    p.kernel = Kernel::wyvill(1.0);
    const Quat turn = (Quat(Eigen::AngleAxisd(lean, Vec3::UnitX())) * Quat(Eigen::AngleAxisd(-0.8 * lean, Vec3::UnitY()))).normalized();
    // The lowest corner lies .41 above the plane, and the surface .454 from it.
    const Vec3 corner = turn * Vec3(-0.5, -0.5, 0);
    const Pose pose{-corner + Vec3(0, 0, 0.41), turn};
    const Body plate({p}, pose);
    const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
    std::vector<Kink> kinks;
    ASSERT_TRUE(kinks_of(plate.field, plate.field.surface_box(), kinks));
    const PlaneSums exact = on_plane(plate.field, kinks, 0.9, 1000);
    double last = 1.0;
    for (const double asked : {1e-3, 1e-6, 1e-8}) {
      Stage stage;
      stage.add(plate.field, {pose.position});
      stage.add(plane).fixed = true;
      const ContactSurface& s = stage.solve({.error = asked});
      ASSERT_EQ(s.summary.size(), 1u);
      const ContactSurface::Summary& sum = s.summary[0];
      ASSERT_EQ(sum.rule, ContactRule::Polar);
      EXPECT_GE(sum.kinks, 2u) << lean;
      const double error = std::max({std::abs(sum.force.z() / exact.force - 1.0), std::abs(sum.area / exact.area - 1.0),
                                     (sum.centre_of_pressure - exact.first / exact.force).head<2>().norm() / std::sqrt(exact.area)});
      EXPECT_LE(sum.error_estimate, asked);
      EXPECT_LE(error, sum.error_estimate + 2e-9) << lean << " " << asked;  // 2e-9: the compliance of the plane and the lines
      EXPECT_LT(sum.points, 4000u);
      last = error;
    }
    EXPECT_LT(last, 1e-8);
  }
}

// On a flat face the pressure pushes across it alone, whatever the body: what is left along it is an error of the rule.
TEST(SplitRule, PartsPatchesWhereTheCapOfATaperedSegmentBegins) {
  Primitive p;
  p.shape = ShapeKind::Segment;
  p.size = Vec3(0.2, 0, 0);
  p.taper = 0.6;
  for (const double height : {0.25, 0.24, 0.22}) {
    p.kernel = Kernel::murakami(0.5);
    const Pose pose{Vec3(0, 0, height), Quat::Identity()};
    const Body horn({p}, pose);
    const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
    for (const double asked : {1e-3, 1e-6, 1e-8}) {
      Stage stage;
      stage.add(horn.field, {pose.position}, 2e3);
      stage.add(plane, {}, 1e4).fixed = true;
      const ContactSurface& s = stage.solve({.error = asked});
      ASSERT_EQ(s.summary.size(), 1u);
      EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
      EXPECT_GE(s.summary[0].kinks, 1u) << height;
      EXPECT_LE(s.summary[0].error_estimate, asked) << height;
      EXPECT_LE(s.summary[0].force.head<2>().norm(), s.summary[0].error_estimate * s.summary[0].force.norm()) << height << ' ' << asked;
    }
  }
}

TEST(SplitRule, IsLeftAloneWhereNoKinkCrosses) {
  Primitive p;
  p.shape = ShapeKind::Rectangle;
  p.size = Vec3(0.5, 0.5, 0);
  p.kernel = Kernel::wyvill(1.0);
  const Pose pose{Vec3(0, 0, 0.4), Quat::Identity()};
  const Body plate({p}, pose);
  const testing::WyvillSphere ball{Vec3(0.1, 0.05, -0.25), {0.6, 0.5}};
  Stage stage;
  stage.add(plate.field, {pose.position});
  stage.add(ball, {ball.centre});
  const ContactSurface& s = stage.solve({.error = 1e-6});
  ASSERT_EQ(s.summary.size(), 1u);
  EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
  EXPECT_EQ(s.summary[0].kinks, 0u);
}

/// Lumps of Wyvill points over a rigid plane, whose patches are not seen whole from their peaks.
struct Lumps {
  const char* name;
  std::vector<Vec3> at;
  std::vector<double> support;
  double stretch;  // widest extent of the patch
};
Body body_of(const Lumps& lumps) {
  std::vector<Primitive> blobs;
  for (std::size_t i = 0; i < lumps.at.size(); ++i) {
    Primitive p;
    p.kernel = Kernel::wyvill(lumps.support[i]);
    p.offset.position = lumps.at[i];
    blobs.push_back(p);
  }
  return Body(blobs);
}

TEST(StarRule, SeesPatchesThatTheirPeaksDoNotSee) {
  const std::vector<Lumps> all{
      {"dumb-bell", {Vec3(0, 0, 0.3), Vec3(1.01, 0, 0.3)}, {1.0, 1.0}, 1.6},
      {"tail", {Vec3(0, 0, 0.3), Vec3(0.8, 0.1, 0.38), Vec3(1.3, 0.5, 0.36)}, {1.2, 0.9, 0.9}, 1.9},
      {"waist off the line", {Vec3(0, 0, 0.3), Vec3(0.75, 0.3, 0.4), Vec3(1.45, -0.05, 0.32)}, {1.1, 0.9, 1.0}, 2.0},
  };
  for (const Lumps& lumps : all) {
    const Body body = body_of(lumps);
    const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
    std::vector<Kink> kinks;
    ASSERT_TRUE(kinks_of(body.field, body.field.surface_box(), kinks));
    const PlaneSums exact = on_plane(body.field, kinks, lumps.stretch, 1000);
    for (const double asked : {1e-2, 1e-3, 1e-6}) {
      Stage stage;
      stage.add(body.field);
      stage.add(plane).fixed = true;
      const ContactSurface::Summary s = stage.solve({.error = asked}).summary.at(0);
      ASSERT_EQ(s.rule, ContactRule::Polar) << lumps.name << ' ' << asked;
      EXPECT_EQ(s.patches, 1u) << lumps.name;
      const double error = std::max({std::abs(s.force.z() / exact.force - 1.0), std::abs(s.area / exact.area - 1.0),
                                     (s.centre_of_pressure - exact.first / exact.force).head<2>().norm() / std::sqrt(exact.area)});
      EXPECT_LE(s.error_estimate, asked) << lumps.name;
      EXPECT_LE(error, s.error_estimate + 2e-9) << lumps.name << ' ' << asked;  // 2e-9: the compliance of the plane and the lines
    }
  }
}

TEST(StarRule, FindsAllOfThePatchesOfTwoLumps) {
  // Poses of `contact_poses 1000 ten_blobs`, by seed, which asked most of the search: peaks along a bent ridge, to which Newton's
  // method goes in steps that leave Sigma or goes to and fro; a patch near another whose seeds have one hill; rays that graze the
  // rim, beyond which more of the patch lies. Against the bodies seen otherwise, and marching, which has no peaks.
  struct Case {
    std::uint64_t seed;
    std::vector<int> poses;
  };
  const Executor executor(1);
  const auto solve = [&](const std::array<ContactBody, 2>& bodies, double error, ContactRule only) {
    ContactCandidates candidates;
    ContactSurface surface;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = error, .only = only}, executor, surface);
    return surface.summary.at(0);
  };
  for (const Case& c : {Case{2026, {67, 160, 478, 588}}, Case{11, {335, 432}}, Case{12, {139, 187, 864}}, Case{77, {17}}, Case{6, {151}}}) {
    benchmarks::Rigid a(benchmarks::ten_blobs(1), 1e6, 0.03), b(benchmarks::ten_blobs(2), 2e6, 0.03);
    benchmarks::Draw draw(c.seed);
    for (int pose = 0; pose <= c.poses.back(); ++pose) {
      benchmarks::press(a, b, draw.logarithmic(0.01, 0.3) * 0.05, draw);
      if (std::find(c.poses.begin(), c.poses.end(), pose) == c.poses.end()) continue;
      const ContactSurface::Summary other = solve(benchmarks::seen_otherwise({a.body(), b.body()}), 1e-6, ContactRule::None);
      const ContactSurface::Summary marched = solve({a.body(), b.body()}, 1e-3, ContactRule::March);
      const auto error = [&](const ContactSurface::Summary& s, const ContactSurface::Summary& exact) {
        return benchmarks::difference(s, {exact.force.norm(), exact.area, exact.centre_of_pressure});
      };
      EXPECT_LE(error(other, marched), 1e-2) << c.seed << ' ' << pose;  // as fine as its grids are: nothing of the patch is missing
      for (const double asked : {1e-2, 1e-3, 1e-6}) {
        const ContactSurface::Summary s = solve({a.body(), b.body()}, asked, ContactRule::None);
        EXPECT_LE(s.error_estimate, asked) << c.seed << ' ' << pose;
        EXPECT_LE(error(s, other), s.error_estimate + other.error_estimate) << c.seed << ' ' << pose << ' ' << asked;
      }
    }
  }
}

TEST(SplitRule, LeavesNothingOutBetweenCornersThatAreNearlyTheSame) {
  // Two corners of the rim less than 1e-7 apart, which the bodies have however they are seen; marching has no corners.
  benchmarks::Rigid a(benchmarks::ten_blobs(1), 1e6, 0.03), b(benchmarks::ten_blobs(2), 2e6, 0.03);
  benchmarks::Draw draw(9501);
  const Executor executor(1);
  for (int pose = 0; pose <= 216; ++pose) {
    benchmarks::press(a, b, draw.logarithmic(0.01, 0.3) * 0.05, draw);
    if (pose != 15 && pose != 207 && pose != 216) continue;
    const std::array<ContactBody, 2> bodies{a.body(), b.body()};
    ContactCandidates candidates;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    const auto solve = [&](double error, ContactRule only) {
      ContactSurface surface;
      solve_contact_surface(bodies, candidates, {.error = error, .only = only}, executor, surface);
      return surface.summary.at(0);
    };
    const ContactSurface::Summary marched = solve(1e-10, ContactRule::March);
    EXPECT_LE(marched.error_estimate, 1e-10) << pose;
    for (const double asked : {1e-8, 1e-10}) {
      const ContactSurface::Summary s = solve(asked, ContactRule::Polar);
      EXPECT_LE(s.error_estimate, asked) << pose;
      EXPECT_LE(benchmarks::difference(s, {marched.force.norm(), marched.area, marched.centre_of_pressure}), s.error_estimate + marched.error_estimate)
          << pose << ' ' << asked;
    }
  }
}

TEST(SplitRule, KeepsItsBoundWhereTwoRulesAgreeOnAWrongAnswer) {
  // Poses of `contact_poses 1000 SHAPES auto SEED`, against the bodies seen otherwise at 1e-10. Of a disc on a box: a ray that meets
  // two kinks in another order than the next one; a kink that lies elsewhere on Sigma than the guess of its heights says; a kink that the
  // first rim does not reach, but that of more rays; pieces of rays on which rules of three and of four points put the same two, twice; a
  // kink that leaves the patch between two rays and is not parted exactly there; rules without kinks that agree by chance. Of capsules: such
  // rules; Newton's method to the rim where the pressure bends there; a kink that leaves the patch between two rays. Of blobs: an
  // angle at which the rim nearly goes along the ray; many short pieces; the two coarsest rules; short pieces with two points; fine
  // rules that agree by chance at a coarse error; radii that are compared with too few. Of discs: a ray that touches a kink, near a corner of
  // the rim, between two rays that neither sees it, or where it also crosses another. Of blobs: a rim that nearly goes along the ray, whose
  // last two pairs of coefficients fall by chance; many kinks in one panel; rings of a mild patch, and rays of one of its sectors, that agree by chance.
  enum class Shapes : std::uint8_t { DiscOnBox, Capsules, Blobs, Murakami };
  struct Case {
    Shapes shapes;
    std::uint64_t seed;
    int pose;
    double asked;
  };
  const Executor executor(1);
  const auto solve = [&](const std::array<ContactBody, 2>& bodies, double error) {
    ContactCandidates candidates;
    ContactSurface surface;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
    return surface.summary.at(0);
  };
  const auto shape = [](ShapeKind kind, const Vec3& size, double support, double modulus) {
    return benchmarks::Rigid(benchmarks::wyvill_shape(kind, size, support), modulus, 0.03);
  };
  for (const Case& c : {Case{Shapes::DiscOnBox, 12, 306, 1e-6}, Case{Shapes::DiscOnBox, 12, 437, 1e-10}, Case{Shapes::DiscOnBox, 11, 48, 1e-5},
                        Case{Shapes::DiscOnBox, 11, 6, 1e-4}, Case{Shapes::DiscOnBox, 1234, 69, 1e-4}, Case{Shapes::DiscOnBox, 1234, 134, 1e-6},
                        Case{Shapes::DiscOnBox, 102, 519, 1e-2}, Case{Shapes::DiscOnBox, 6103, 156, 1e-8}, Case{Shapes::DiscOnBox, 77, 464, 1e-6}, Case{Shapes::Capsules, 204, 777, 1e-2}, Case{Shapes::Capsules, 1234, 265, 1e-6}, Case{Shapes::Capsules, 77, 967, 1e-5},
                        Case{Shapes::Capsules, 101, 852, 1e-5}, Case{Shapes::Blobs, 1234, 227, 1e-3}, Case{Shapes::Blobs, 102, 767, 1e-3},
                        Case{Shapes::Blobs, 1234, 898, 1e-2}, Case{Shapes::Blobs, 831, 178, 1e-4}, Case{Shapes::Blobs, 901, 4, 1e-2},
                        Case{Shapes::Murakami, 1, 451, 1e-6}, Case{Shapes::Murakami, 5, 696, 1e-4}, Case{Shapes::DiscOnBox, 6102, 719, 1e-8},
                        Case{Shapes::DiscOnBox, 6103, 27, 1e-9}, Case{Shapes::Blobs, 1, 397, 1e-8},
                        Case{Shapes::Murakami, 7, 13, 1e-5}, Case{Shapes::Blobs, 3, 219, 1e-6}, Case{Shapes::Blobs, 9601, 581, 1e-5},
                        Case{Shapes::Blobs, 77, 359, 1e-4}, Case{Shapes::Blobs, 2026, 156, 6e-5}}) {
    const bool disc = c.shapes == Shapes::DiscOnBox, blobs = c.shapes == Shapes::Blobs || c.shapes == Shapes::Murakami;
    const auto ten = [&](std::uint64_t seed) {
      implicit::Skeleton skeleton = benchmarks::ten_blobs(seed);
      for (Primitive& p : skeleton.primitive) {
        if (c.shapes == Shapes::Murakami) p.kernel = Kernel::murakami(p.kernel.radius);
      }
      return skeleton;
    };
    benchmarks::Rigid a = disc    ? shape(ShapeKind::Disc, Vec3(0.15, 0, 0), 0.15, 1e6)
                          : blobs ? benchmarks::Rigid(ten(1), 1e6, 0.03)
                                  : shape(ShapeKind::Segment, Vec3(0.2, 0, 0), 0.2, 1e6);
    benchmarks::Rigid b = disc    ? shape(ShapeKind::Box, Vec3(0.2, 0.1, 0.1), 0.15, 2e6)
                          : blobs ? benchmarks::Rigid(ten(2), 2e6, 0.03)
                                  : shape(ShapeKind::Segment, Vec3(0.1, 0, 0), 0.25, 3e6);
    const double size = disc ? 0.07 : blobs ? 0.05 : 0.1;
    benchmarks::Draw draw(c.seed);
    for (int pose = 0; pose <= c.pose; ++pose) benchmarks::press(a, b, draw.logarithmic(0.01, 0.3) * size, draw);
    const ContactSurface::Summary exact = solve(benchmarks::seen_otherwise({a.body(), b.body()}), 1e-10), s = solve({a.body(), b.body()}, c.asked);
    EXPECT_EQ(s.rule, ContactRule::Polar);
    EXPECT_LE(exact.error_estimate, std::max(1e-10, 0.05 * c.asked));  // far finer than what is asked
    EXPECT_LE(s.error_estimate, c.asked);
    EXPECT_LE(benchmarks::difference(s, {exact.force.norm(), exact.area, exact.centre_of_pressure}), s.error_estimate + exact.error_estimate)
        << c.seed << ' ' << c.pose;
  }
}

/// Evaluations at 1e-3 and 1e-6, rising, of patches between bodies pressed together by some share of `size`; no estimate may be below its error.
/// @param crossed  of those that kinks cross, or of the others
std::array<std::vector<std::uint64_t>, 2> work_within_estimates(benchmarks::Rigid& a, benchmarks::Rigid& b, double size, int poses, bool crossed) {
  benchmarks::Draw draw(5);
  std::array<std::vector<std::uint64_t>, 2> work;
  for (int i = 0; i < poses; ++i) {
    benchmarks::press(a, b, draw.logarithmic(0.01, 0.3) * size, draw);
    const Executor executor(1);
    const std::array<ContactBody, 2> bodies{a.body(), b.body()};
    ContactCandidates candidates;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    const auto solve = [&](double error) {
      ContactSurface surface;
      solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
      return surface.summary.at(0);
    };
    const ContactSurface::Summary fine = solve(1e-10);
    if ((fine.kinks > 0) != crossed) continue;
    for (const std::size_t which : {0u, 1u}) {
      const ContactSurface::Summary s = solve(which == 0 ? 1e-3 : 1e-6);
      const double off = benchmarks::difference(s, {fine.force.norm(), fine.area, fine.centre_of_pressure});
      EXPECT_LE(off, s.error_estimate + fine.error_estimate) << i;
      work[which].push_back(s.evaluations);
    }
  }
  for (std::vector<std::uint64_t>& some : work) std::sort(some.begin(), some.end());
  return work;
}

void expect_middle(const std::vector<std::uint64_t>& work, std::uint64_t most) {
  ASSERT_GT(work.size(), 20u);
  EXPECT_LE(work[work.size() / 2], most);
}

/// Summary of two bodies at an error, by the search for candidates and the surface.
ContactSurface::Summary contact_of(const std::array<ContactBody, 2>& bodies, double error, ContactRule only = ContactRule::None) {
  const Executor executor(1);
  ContactCandidates candidates;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  ContactSurface surface;
  solve_contact_surface(bodies, candidates, {.error = error, .only = only}, executor, surface);
  return surface.summary.empty() ? ContactSurface::Summary{} : surface.summary.front();
}

TEST(PatchesBetweenSamples, AreFoundBesideLargerOnes) {
  // Two balls of one body on a plane, the second hardly: samples are two radii apart, so mostly none lies in its patch.
  constexpr double kRadius = 0.014, kApart = 0.045, kSpacing = 0.03, kE = 1e6;
  implicit::Skeleton two = benchmarks::linear_sphere(kRadius);
  two.primitive.push_back(two.primitive.front());
  two.primitive[0].offset.position.x() = -0.5 * kApart;
  two.primitive[1].offset.position.x() = 0.5 * kApart;
  benchmarks::Rigid both(two, kE, kSpacing), one(benchmarks::linear_sphere(kRadius), kE, kSpacing);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0 / kRadius};
  const Pose origin;
  const ContactBody ground = benchmarks::single_part(plane, kE, origin);
  benchmarks::Draw draw(3);
  for (int i = 0; i < 60; ++i) {
    const double deep = draw.logarithmic(1e-3, 0.1) * kRadius, shallow = draw.logarithmic(1e-3, 0.5) * deep;
    const Quat tilt(Eigen::AngleAxisd(std::asin((deep - shallow) / kApart), -Vec3::UnitY())), roll(Eigen::AngleAxisd(draw.uniform(0.0, 6.28), Vec3::UnitX()));
    both.put({Vec3(0, 0, kRadius - 0.5 * (deep + shallow)), Quat(tilt * roll)});
    const ContactSurface::Summary s = contact_of({both.body(), ground}, 1e-3);
    double force = 0.0, area = 0.0;
    for (const double depth : {deep, shallow}) {
      one.put({Vec3(0, 0, kRadius - depth), Quat::Identity()});
      const ContactSurface::Summary alone = contact_of({one.body(), ground}, 1e-8);
      force += alone.force.norm();
      area += alone.area;
    }
    EXPECT_EQ(s.patches, 2u) << i << " depths " << deep << ' ' << shallow;
    EXPECT_NEAR(s.force.norm(), force, 1e-3 * force) << i;
    EXPECT_NEAR(s.area, area, 1e-3 * area) << i;
  }
}

TEST(PatchesBetweenSamples, OfBlobsAreThoseOfMarching) {
  // Poses in which the second patch has a sixth of the area, and no sample.
  benchmarks::Rigid a(benchmarks::ten_blobs(1), 1e6, 0.03), b(benchmarks::ten_blobs(2), 2e6, 0.03);
  for (const auto& [seed, pose] : {std::pair(9201, 263), std::pair(9701, 90)}) {
    benchmarks::Draw draw(static_cast<std::uint64_t>(seed));
    for (int i = 0; i <= pose; ++i) benchmarks::press(a, b, draw.logarithmic(0.01, 0.3) * 0.05, draw);
    const ContactSurface::Summary polar = contact_of({a.body(), b.body()}, 1e-3), march = contact_of({a.body(), b.body()}, 1e-3, ContactRule::March);
    EXPECT_EQ(polar.rule, ContactRule::Polar);
    EXPECT_EQ(polar.patches, 2u);
    EXPECT_NEAR(polar.area, march.area, 2e-3 * march.area);
    EXPECT_NEAR(polar.force.norm(), march.force.norm(), 2e-3 * march.force.norm());
  }
}

TEST(SplitRule, KeepsItsEstimatesWithLittleWork) {
  benchmarks::Rigid ball(benchmarks::wyvill_shape(ShapeKind::Point, Vec3::Zero(), 0.22), 1e6, 0.03);
  benchmarks::Rigid plate(benchmarks::wyvill_shape(ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), 1e6, 0.03);
  benchmarks::Rigid a(benchmarks::ten_blobs(1), 1e6, 0.03), b(benchmarks::ten_blobs(2), 2e6, 0.03);
  const auto of_plate = work_within_estimates(ball, plate, 0.07, 150, true), of_blobs = work_within_estimates(a, b, 0.05, 100, true);
  expect_middle(of_plate[0], 2600);
  expect_middle(of_plate[1], 7000);
  expect_middle(of_blobs[0], 1200);  // kinks in a third derivative are not parted at
  expect_middle(of_blobs[1], 34000);
}

TEST(SplitRule, GivesRaysThatAreNotCheckedAsManyPoints) {
  // Between two rays whose pieces are shorter and longer lies one with the longest piece that three points are given to.
  for (const auto& [seed, pose] : {std::pair(1, 901), std::pair(2, 964), std::pair(22, 116)}) {
    benchmarks::for_cases({}, [](std::string_view name) { return name == "disc_on_box"; }, [&, at = pose, from = seed](std::string_view, const auto& make_pose) {
      benchmarks::Draw draw(static_cast<std::uint64_t>(from));
      for (int i = 0; i < at; ++i) (void)make_pose(draw);
      const benchmarks::Pair pair = make_pose(draw);
      const ContactSurface::Summary exact = contact_of(benchmarks::seen_otherwise(pair.bodies), 1e-10), s = contact_of(pair.bodies, 1e-6);
      EXPECT_LE(benchmarks::difference(s, {exact.force.norm(), exact.area, exact.centre_of_pressure}), s.error_estimate + exact.error_estimate) << from;
    });
  }
}

TEST(SplitRule, KeepsItsBoundsBetweenAnyTwoShapes) {
  // A triangle on a polygon, whose kinks are oblique to the faces, and a ring on a stretched ball with a kink that is not told as one of all.
  struct Case {
    std::uint64_t seed;
    int pose;
  };
  for (const auto& [seed, pose] : {Case{1, 53}, Case{2, 282}, Case{5, 55}}) {
    benchmarks::for_cases({}, [](std::string_view name) { return name == "shapes"; }, [&, at = pose, from = seed](std::string_view, const auto& make_pose) {
      benchmarks::Draw draw(from);
      for (int i = 0; i < at; ++i) (void)make_pose(draw);
      const benchmarks::Pair pair = make_pose(draw);
      const ContactSurface::Summary exact = contact_of(pair.bodies, 1e-8);
      for (const double error : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
        const ContactSurface::Summary s = contact_of(pair.bodies, error);
        EXPECT_LE(benchmarks::difference(s, {exact.force.norm(), exact.area, exact.centre_of_pressure}), s.error_estimate + exact.error_estimate)
            << from << ' ' << error;
      }
    });
  }
}

TEST(SplitRule, ForgetsWhatWasKnownOfThePairBefore) {
  // Of boxes all kinks are known; those of balls beside a third one are not looked for at this error.
  Primitive brick = make(ShapeKind::Box, Vec3(0.3, 0.3, 0.1), Kernel::wyvill(0.3));
  brick.offset = {};
  const Body below({brick}, {Vec3(0, 0, 20), Quat::Identity()}), above({brick}, {Vec3(0.05, 0, 20.45), Quat::Identity()});
  const Primitive point = make(ShapeKind::Point, Vec3::Zero(), Kernel::gascuel(1.0, 1.5, 0.5));
  const std::array balls{Body({point}, {Vec3(0, 0, 0.8), Quat::Identity()}), Body({point}, {Vec3(0, 0, -0.8), Quat::Identity()}),
                         Body({point}, {Vec3(0.85, 0, 0), Quat::Identity()})};
  const auto answer = [&](bool first) {
    Stage stage;
    if (first) {
      stage.add(below.field, {Vec3(0, 0, 20)});
      stage.add(above.field, {Vec3(0.05, 0, 20.45)});
    }
    for (const Body& ball : balls) stage.add(ball.field, {Vec3::Zero()});
    const ContactSurface& s = stage.solve({.error = 1e-2});
    EXPECT_EQ(s.summary.size(), first ? 4u : 3u);
    return s.summary.at(first ? 1 : 0);
  };
  const ContactSurface::Summary alone = answer(false), after = answer(true);
  ASSERT_EQ(alone.rule, ContactRule::Polar);
  EXPECT_EQ(alone.force, after.force);
  EXPECT_EQ(alone.error_estimate, after.error_estimate);
  EXPECT_EQ(alone.points, after.points);
}

TEST(SmoothPatches, KeepTheirEstimates) {
  // A linear ball of radius 1 on a rigid plane, F = pi E d^2 (1 - 2 d / 3) with E d / (1 + E / k) in place of E d for a plane of slope k.
  constexpr double k = 1e9;
  const Body ball({make(ShapeKind::Point, Vec3::Zero(), Kernel::gascuel(1.0, 1.5, 0.5))});
  for (int i = 1; i <= 100; ++i) {
    const double d = 1e-3 * i, force = std::numbers::pi / 2.0 * 2.0 * d * d * (1.0 - 2.0 * d / 3.0);
    const implicit::HalfSpace plane{-(1.0 - d) * Vec3::UnitZ(), Vec3::UnitZ(), 1.0};
    Stage stage;
    stage.add(ball.field, {Vec3::Zero()}, 2.0);
    stage.add(plane, {Vec3::Zero()}, k);
    const ContactSurface::Summary s = stage.solve({.error = 1e-3}).summary.at(0);
    const double error = std::abs(s.force.z() / force - 1.0);
    EXPECT_LE(error, s.error_estimate + 1e-8) << d;  // that the plane gives way
    EXPECT_LE(s.evaluations, 90u) << d;
  }
}

TEST(SmoothPatches, KeepTheirEstimatesBesideKinks) {
  // A linear ball on the face of a box, whose field has kinks at the planes through the sides of the face.
  constexpr double kModulus = benchmarks::kLinearModulus;
  benchmarks::Rigid ball(benchmarks::linear_sphere(0.1), kModulus, 0.03);
  benchmarks::Rigid box(benchmarks::linear_shape(ShapeKind::Box, Vec3(0.3, 0.3, 0.05), 0.1), kModulus, 0.06);
  for (const double error : {1e-3, 1e-6}) {
    std::vector<std::uint64_t> work;
    for (int i = 0; i < 40; ++i) {
      const double h = 0.1 - 1e-3 * (1.0 + 0.7 * i), side = 0.3 - 0.1 * (i % 4 + 1) * (i % 3 == 0 ? 1.0 : 0.75);
      const Vec3 centre(side, -0.1 * side, 0.15 + h);
      ball.put({centre, Quat(0.8, 0.3, -0.4, 0.2).normalized()});
      box.put({});
      const benchmarks::Answer exact = benchmarks::sphere_on_flat(0.1, 1.0, 1.0 / 0.1, h, centre, -Vec3::UnitZ());
      const Executor executor(1);
      ContactCandidates candidates;
      ContactSurface surface;
      const std::array<ContactBody, 2> bodies{ball.body(), box.body()};
      find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
      const ContactSurface::Summary& s = surface.summary.at(0);
      const double off = benchmarks::difference(s, exact);
      EXPECT_LE(off, s.error_estimate) << i << ' ' << error;
      if (s.kinks == 0) work.push_back(s.evaluations);
    }
    std::sort(work.begin(), work.end());
    expect_middle(work, error < 1e-3 ? 1400 : 600);
  }
}

TEST(SmoothPatches, KeepTheirEstimatesWhereTheyAreNotRound) {
  benchmarks::Rigid a(benchmarks::wyvill_shape(ShapeKind::Ellipsoid, Vec3(0.2, 0.3, 0.25), 0.2), 1e6, 0.03);
  benchmarks::Rigid b(benchmarks::wyvill_shape(ShapeKind::Ellipsoid, Vec3(0.25, 0.2, 0.2), 0.2), 2e6, 0.03);
  const auto work = work_within_estimates(a, b, 0.1, 60, false);
  expect_middle(work[0], 1000);
  expect_middle(work[1], 1000);
}

TEST(SmoothPatches, KeepTheirEstimatesInsideTheSupportsOfManyBlobs) {
  benchmarks::Rigid a(benchmarks::ten_blobs(1), 1e6, 0.03), b(benchmarks::ten_blobs(2), 2e6, 0.03);
  const auto work = work_within_estimates(a, b, 0.05, 600, false);
  expect_middle(work[0], 1100);
  expect_middle(work[1], 2300);
}

TEST(SmoothPatches, AreNotVouchedForByForcesThatAgreeByChance) {
  // The force by 4 radii crosses that by 6 where a linear ball overlaps a plane a hundred times as stiff by 0.300 of its radius.
  // At pressure p the ball is one of radius 1 - p, the plane has come up by p / k: F = pi integral of (1 - p)^2 - (h + p / k)^2 dp.
  constexpr double k = 100.0, kModulus = 2.0;
  const Body ball({make(ShapeKind::Point, Vec3::Zero(), Kernel::gascuel(1.0, 1.5, 0.5))});
  const auto cube = [](double x) { return x * x * x; };
  for (int i = 0; i <= 200; ++i) {
    const double h = 0.71 - 1e-4 * i, most = (1.0 - h) / (1.0 + 1.0 / k);
    const double force = std::numbers::pi / 3.0 * (1.0 - cube(1.0 - most) - k * (cube(h + most / k) - cube(h)));
    const implicit::HalfSpace plane{-h * Vec3::UnitZ(), Vec3::UnitZ(), 1.0};
    Stage stage;
    stage.add(ball.field, {Vec3::Zero()}, kModulus);
    stage.add(plane, {Vec3::Zero()}, k);
    double energy = 0.0;
    for (const double error : {1e-10, 1e-6, 1e-3}) {
      const ContactSurface::Summary s = stage.solve({.error = error}).summary.at(0);
      if (error == 1e-10) energy = s.energy;
      // Columns end where the kernel goes over to another formula.
      EXPECT_NEAR(s.energy, energy, error * energy) << h << ' ' << error;
      EXPECT_LE(s.error_estimate, error);
      EXPECT_LE(std::abs(s.force.z() - force), (s.error_estimate + 1e-12) * force)  // round-off of cubes, times k
          << h << ' ' << error;
    }
  }
}

}  // namespace
}  // namespace supple::collision
