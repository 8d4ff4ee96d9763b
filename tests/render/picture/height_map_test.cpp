// Heights over the ground by triangles: planes and spheres have closed forms.
#include "picture/height_map.h"

#include <gtest/gtest.h>

#include "render/shapes.h"

namespace supple::render::test {
namespace {

constexpr int kSize = 64;

struct Map {
  MapFit fit;
  std::vector<float> values;
  explicit Map(const Mesh& mesh, const Box& box, double ground) : fit(fit_map(box, Vec3(0, 0, -1), kSize)) {
    const Item item{.mesh = &mesh};
    DrawList list;
    pack(std::span(&item, 1), {}, list);
    fill_heights(list, fit, static_cast<float>(ground), kSize, values);
  }
  [[nodiscard]] float lowest(int column, int row) const { return -values[2 * static_cast<std::size_t>(row * kSize + column)]; }
  [[nodiscard]] float highest(int column, int row) const { return values[2 * static_cast<std::size_t>(row * kSize + column) + 1]; }
  /// The middle of a texel in the world.
  [[nodiscard]] Vec3 middle(int column, int row) const {
    const Eigen::Vector4f unit((static_cast<float>(column) + 0.5F) / kSize, (static_cast<float>(row) + 0.5F) / kSize, 0.0F, 1.0F);
    return Eigen::Vector4f(fit.to_unit.inverse() * unit).head<3>().cast<double>();
  }
};

template <class Body>
void for_texels(const Body& body) {
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) body(column, row);
}

TEST(HeightMap, OfATiltedSquareIsItsPlaneInsideAndNothingOutside) {
  const auto height = [](const Vec3& p) { return 1.0 + 0.3 * p.x() - 0.2 * p.y(); };
  Mesh square;
  for (const auto& [x, y] : {std::pair{-0.5, -0.7}, {0.6, -0.7}, {0.6, 0.4}, {-0.5, 0.4}})
    square.position.emplace_back(x, y, height(Vec3(x, y, 0)));
  square.normal.assign(4, Vec3::UnitZ());
  square.triangle = {{0, 1, 2}, {0, 3, 2}};  // of either turn
  const Map map(square, {Vec3(-1, -1, 0), Vec3(1, 1, 2)}, 0.25);
  int inside = 0;
  for_texels([&](int column, int row) {
    const Vec3 p = map.middle(column, row);
    const double margin = std::min({p.x() + 0.5, 0.6 - p.x(), p.y() + 0.7, 0.4 - p.y()});
    if (std::abs(margin) < 1e-4) return;
    if (margin < 0.0) {
      EXPECT_EQ(map.highest(column, row), kNoHeight);
      return;
    }
    ++inside;
    EXPECT_NEAR(map.highest(column, row), height(p) - 0.25, 2e-6);  // single precision of numbers near 1
    EXPECT_NEAR(map.lowest(column, row), height(p) - 0.25, 2e-6);
  });
  EXPECT_GT(inside, 300);
}

TEST(HeightMap, OfASphereOfTrianglesBelowATexelIsItsUndersideAndItsTop) {
  const double r = 0.6, z = 0.8;
  const int cells = 96;
  Mesh sphere = rounded_box(Vec3::Zero(), r, cells);
  for (Vec3& p : sphere.position) p.z() += z;
  const Map map(sphere, {Vec3(-1, -1, 0), Vec3(1, 1, 2)}, 0.0);
  // Chords of the angle a lie r a^2 / 8 inside, seen along a slope.
  const double angle = 1.3 * 0.5 * M_PI / cells;
  const double sagitta = 2.0 * r * angle * angle / 8.0;
  for_texels([&](int column, int row) {
    const Vec3 p = map.middle(column, row);
    const double rho = std::hypot(p.x(), p.y());
    if (rho > r) { EXPECT_EQ(map.highest(column, row), kNoHeight); }
    if (rho > 0.9 * r) return;
    const double half = std::sqrt(r * r - rho * rho);
    EXPECT_NEAR(map.highest(column, row), z + half, sagitta * r / half + 1e-6);
    EXPECT_NEAR(map.lowest(column, row), z - half, sagitta * r / half + 1e-6);
  });
}

TEST(HeightMap, LeavesOutWhatIsOutsideOfItsBoxAndBelowTheGround) {
  Mesh square;
  for (const auto& [x, y] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) square.position.emplace_back(x, y, 0.5);
  for (int k = 0; k < 4; ++k) square.position.push_back(square.position[static_cast<std::size_t>(k)] + Vec3(0, 0, 9.0));
  square.normal.assign(8, Vec3::UnitZ());
  square.triangle = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  const Map map(square, {Vec3(-1, -1, 0), Vec3(1, 1, 2)}, 0.75);
  int over = 0;
  for_texels([&](int column, int row) {
    if (map.highest(column, row) == kNoHeight) return;
    ++over;
    EXPECT_EQ(map.highest(column, row), 0.0F);
    EXPECT_EQ(map.lowest(column, row), 0.0F);
  });
  EXPECT_GT(over, 300);
}

}  // namespace
}  // namespace supple::render::test
