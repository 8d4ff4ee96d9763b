// Where lines cross the kinks of a body.
#include "surface/region/column_kinks.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "../../benchmarks/contact_shapes.h"

namespace supple::collision {
namespace {

// The parts of lines through a disc, a rod and an ellipsoid end where these have kinks, and nowhere else.
TEST(ColumnKinks, AreWhereLinesCrossThem) {
  using implicit::ShapeKind;
  constexpr double kHalf = 0.25, kSupport = 0.4, kError = 1e-3;
  const Pose pose{Vec3(0.1, -0.2, 0.3), Quat(0.6, -0.2, 0.5, 0.3).normalized()};
  struct Line {
    Vec3 from, to;  // in the body
    std::vector<double> kinks;  // from 0 to 1
  };
  const auto expect_parts = [&](ShapeKind kind, const Vec3& size, std::span<const Line> lines) {
    benchmarks::Rigid rigid(benchmarks::wyvill_shape(kind, size, kSupport), 1.0, 0.05);
    rigid.put(pose);
    const ContactBody body = rigid.body();
    const PairPressure pressure(body, body);
    ColumnKinks kinks(pressure, 0, kError);
    for (const Line& line : lines) {
      const Vec3 from = pose.position + pose.orientation * line.from, way = pose.orientation * (line.to - line.from);
      const std::span<const double> part = kinks.parts(from, way.normalized(), way.norm());
      ASSERT_EQ(part.size(), line.kinks.size() + 2);
      EXPECT_EQ(part.front(), 0.0);
      EXPECT_EQ(part.back(), way.norm());
      for (std::size_t i = 0; i < line.kinks.size(); ++i) EXPECT_NEAR(part[i + 1] / way.norm(), line.kinks[i], 1e-9);
    }
  };
  const double across = std::sqrt(kHalf * kHalf - 0.15 * 0.15);
  expect_parts(ShapeKind::Disc, Vec3(kHalf, 0.0, 0.0),
               std::array{Line{Vec3(0.0, 0.0, 0.1), Vec3(0.5, 0.0, -0.1), {0.5}}, Line{Vec3(-0.5, 0.15, 0.0), Vec3(0.5, 0.15, 0.1), {0.5 - across, 0.5 + across}},
                          Line{Vec3(-0.5, 0.3, 0.0), Vec3(0.5, 0.3, 0.1), {}}, Line{Vec3(0.1, 0.0, -0.2), Vec3(0.1, 0.0, 0.2), {}}});
  expect_parts(ShapeKind::Segment, Vec3(kHalf, 0.0, 0.0),
               std::array{Line{Vec3(-0.5, 0.1, 0.0), Vec3(0.5, 0.0, 0.1), {0.25, 0.75}}, Line{Vec3(0.0, 0.1, 0.0), Vec3(0.0, -0.1, 0.1), {}}});
  expect_parts(ShapeKind::Ellipsoid, Vec3(kSupport, kSupport, 0.3), std::array{Line{Vec3(-0.3, 0.1, 0.0), Vec3(0.3, 0.0, 0.1), {}}});
}

}  // namespace
}  // namespace supple::collision
