#include "supple/implicit/height_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "implicit/check_fields.h"
#include "supple/core/mesh.h"

namespace supple::implicit {
namespace {

using Height = std::function<double(double, double)>;

/// Heights over [-1, 1]^2 at n x n points, 0.25 m up, with a slope of 3 / m.
HeightField sampled(const Height& height, std::size_t n) {
  const double spacing = 2.0 / static_cast<double>(n - 1);
  std::vector<double> heights;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) heights.push_back(height(-1.0 + spacing * static_cast<double>(i), -1.0 + spacing * static_cast<double>(j)));
  }
  return {Vec3(-1.0, -1.0, 0.25), spacing, n, n, heights, 3.0};
}

double wave(double x, double y) { return 0.3 * std::sin(2.0 * x) * std::cos(1.5 * y); }
HeightField make_terrain(std::size_t n = 21) { return sampled(wave, n); }

/// Heights that jump from point to point.
HeightField make_rough() {
  return sampled([](double x, double y) { return 0.2 * std::sin(1e4 * (x + 1.7 * y)) + (x > 0.15 ? 1.0 : 0.0); }, 9);
}

TEST(HeightField, IsTheDistanceFromAPlaneUpToItsBorders) {
  const double a = 0.2, b = -0.3, length = std::sqrt(1.0 + a * a + b * b);
  const HeightField ramp = sampled([&](double x, double y) { return a * x + b * y; }, 11);
  for (const Vec3& p : testing::random_points(4, 500, 1.0)) {
    const double depth = (0.25 + a * p.x() + b * p.y() - p.z()) / length, inside = 1.0 - p.head<2>().cwiseAbs().maxCoeff();
    EXPECT_NEAR(FieldView(ramp).value(p), 3.0 * std::min(depth, inside), 1e-14) << p.transpose();
  }
  for (const double edge : {-1.0, 1.0}) {
    EXPECT_LT((ramp.height(edge, 0.37) - Vec3(0.25 + a * edge + b * 0.37, a, b)).norm(), 1e-14);
    EXPECT_LT((ramp.height(0.37, edge) - Vec3(0.25 + a * 0.37 + b * edge, a, b)).norm(), 1e-14);
  }
}

TEST(HeightField, IsExactForSaddlesOfStraightLines) {
  const Height saddle = [](double x, double y) { return 0.1 + 0.2 * x - 0.1 * y + 0.4 * x * y; };
  for (const std::size_t n : {2U, 3U, 8U}) {
    const HeightField field = sampled(saddle, n);
    for (const Vec3& p : testing::random_points(4, 100, 1.0)) {
      const Vec3 exact(0.25 + saddle(p.x(), p.y()), 0.2 + 0.4 * p.y(), -0.1 + 0.4 * p.x());
      EXPECT_LT((field.height(p.x(), p.y()) - exact).norm(), 1e-13) << n << ": " << p.transpose();
    }
  }
}

TEST(HeightField, StaysWithinTheCornersOfEachCell) {
  constexpr std::size_t kPoints = 9;
  const HeightField rough = make_rough();
  const auto corner = [](double x) { return 0.25 * std::clamp(std::floor(4.0 * x), -4.0, 3.0); };
  for (const Vec3& p : testing::random_points(9, 20000, 1.0)) {
    double least = 1e9, largest = -1e9;
    for (const double dx : {0.0, 0.25}) {
      for (const double dy : {0.0, 0.25}) {
        const double h = rough.height(corner(p.x()) + dx, corner(p.y()) + dy).x();
        least = std::min(least, h);
        largest = std::max(largest, h);
      }
    }
    const double h = rough.height(p.x(), p.y()).x();
    EXPECT_GE(h, least - 1e-14) << p.transpose();
    EXPECT_LE(h, largest + 1e-14) << p.transpose();
  }
  // A step rises once, from one flat part to the other.
  const HeightField step = sampled([](double x, double) { return x > 0.1 ? 1.0 : 0.0; }, kPoints);
  double last = 0.25;
  for (double x = -1.0; x <= 1.0; x += 0.01) {
    const double h = step.height(x, 0.3).x();
    EXPECT_GE(h, last - 1e-14);
    last = h;
    EXPECT_TRUE(x >= 0.0 || std::abs(h - 0.25) < 1e-14) << x;
    EXPECT_TRUE(x <= 0.25 || std::abs(h - 1.25) < 1e-14) << x;
  }
}

TEST(HeightField, PassesThroughItsHeightsAndConvergesAtThirdOrderOnSlopes) {
  // Where neither sin 2x nor cos 1.5y turns; slopes at the points of the grid are of second order.
  const auto error = [](std::size_t n) {
    const HeightField terrain = make_terrain(n);
    double largest = 0.0;
    for (double x = -0.5; x <= 0.5; x += 0.037) {
      for (double y = 0.3; y <= 0.8; y += 0.041) largest = std::max(largest, std::abs(terrain.height(x, y).x() - 0.25 - wave(x, y)));
    }
    return largest;
  };
  EXPECT_NEAR(make_terrain().height(0.4, -0.7).x(), 0.25 + wave(0.4, -0.7), 1e-14);
  EXPECT_GT(std::log2(error(41) / error(81)), 2.7);
}

TEST(HeightField, GradientIsThatOfItsValue) {
  testing::expect_gradients(make_terrain(), 1.5, 1e-4);
  testing::expect_gradients(make_rough(), 1.5, 1e-2);
}

TEST(HeightField, BoundsHold) {
  testing::expect_bounds(make_terrain(), 1.5);
  testing::expect_bounds(make_rough(), 1.5);
  const Box everywhere{Vec3::Constant(-std::numeric_limits<double>::infinity()), Vec3::Constant(std::numeric_limits<double>::infinity())};
  EXPECT_NEAR(make_terrain().bound(everywhere).upper, 3.0, 1e-12);  // a metre from the sides
}

TEST(HeightField, EndsAtItsBorders) {
  const HeightField terrain = make_terrain();
  const FieldView field(terrain);
  // Beside the ground it is as far as the side, or the rim above.
  EXPECT_NEAR(field.value(Vec3(1.2, 0.1, -3.0)), -3.0 * 0.2, 1e-14);
  EXPECT_NEAR(field.value(Vec3(-1.3, -1.4, -3.0)), -3.0 * 0.5, 1e-14);
  EXPECT_NEAR(field.value(Vec3(0.9, 0.1, -3.0)), 3.0 * 0.1, 1e-14);
  const HeightField flat = sampled([](double, double) { return 0.0; }, 5);
  EXPECT_NEAR(FieldView(flat).value(Vec3(1.3, 0.1, 0.65)), -3.0 * 0.5, 1e-14);
  EXPECT_NEAR(FieldView(flat).value(Vec3(-1.3, 1.4, 1.45)), -3.0 * 1.3, 1e-14);
  const Box box = terrain.surface_box();
  EXPECT_NEAR(box.lower.x(), -1.0, 1e-14);
  EXPECT_NEAR(box.upper.y(), 1.0, 1e-14);
  EXPECT_LT(box.upper.z(), 0.25 + 0.3);
}

TEST(HeightField, MeshLiesOnTheFieldAndHasItsSides) {
  const HeightField terrain = make_terrain(5);
  const Mesh mesh = terrain.mesh(4);
  constexpr std::size_t kGround = 17 * 17, kSides = 4 * 2 * 17;
  ASSERT_EQ(mesh.vertex_count(), kGround + kSides);
  double lowest = 1.0;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR(FieldView(terrain).value(mesh.position[i]), 0.0, 1e-14);
    if (i < kGround) lowest = std::min(lowest, mesh.position[i].z());
    if (mesh.position[i].head<2>().cwiseAbs().maxCoeff() > 0.999) continue;  // the gradient jumps at the rim
    Vec3 gradient;
    std::ignore = FieldView(terrain).value(mesh.position[i], gradient);
    EXPECT_LT((mesh.normal[i] + gradient.normalized()).norm(), 1e-14);
  }
  double area = 0.0;  // of the sides
  for (const auto& [a, b, c] : mesh.triangle) {
    const Vec3 twice = (mesh.position[b] - mesh.position[a]).cross(mesh.position[c] - mesh.position[a]);
    EXPECT_GT(twice.dot(mesh.normal[a]), 0.0);
    if (a >= kGround) area += 0.5 * twice.norm();
  }
  // By trapezia over the rim.
  double expected = 0.0;
  for (int k = 0; k < 16; ++k) {
    for (const double edge : {-1.0, 1.0}) {
      for (const double at : {-1.0 + 0.125 * k, -1.0 + 0.125 * (k + 1)}) {
        expected += 0.0625 * (terrain.height(at, edge).x() + terrain.height(edge, at).x() - 2.0 * lowest);
      }
    }
  }
  EXPECT_NEAR(area, expected, 1e-12);
}

}  // namespace
}  // namespace supple::implicit
