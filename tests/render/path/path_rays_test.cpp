// Rays and bundles of the path tracer: they meet what is there, whatever the hierarchy and the order.
#include <gtest/gtest.h>

#include <cmath>

#include "render/path_studio.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

using path::Film;
using path::Vec3f;

TEST(PathTracer, MeetsTheFieldInsteadOfACoarseMesh) {
  const Mesh fine = sphere(Vec3::Zero(), 0.6, 96);
  const Mesh coarse = sphere(Vec3::Zero(), 0.6, 5);
  Item item{.mesh = &fine, .colour = Vec3(0.7, 0.5, 0.3), .roughness = 0.3};
  Studio studio;
  studio.settings.width = studio.settings.height = 64;
  studio.settings.most_samples = 64;
  studio.lights.above = Vec3f::Ones();
  studio.lights.sun = {.to_light = Vec3f(0.3F, -0.5F, 0.8F).normalized(), .irradiance = Vec3f::Constant(3.0F), .cosine = 0.99F};
  const Film exact = studio.trace(std::span(&item, 1));
  item.mesh = &coarse;
  const Film faceted = studio.trace(std::span(&item, 1));
  item.field = [](std::span<const Vec3> p, std::span<double> f, std::span<Vec3> g) {
    for (std::size_t i = 0; i < p.size(); ++i) {
      f[i] = 0.36 - p[i].squaredNorm();
      g[i] = -2.0 * p[i];
    }
  };
  item.field_reach = 0.1;
  const Film smooth = studio.trace(std::span(&item, 1));
  const auto inner = [&](const Film& film) {
    double sum = 0.0;
    for (const auto& [x, y] : pixels_of(film))
      if (exact.cover.at(x, y) >= 1.0F && exact.position.at(x, y).y() < -0.3F) sum += (film.normal.at(x, y) - exact.normal.at(x, y)).squaredNorm();
    return std::sqrt(sum);
  };
  EXPECT_LT(inner(smooth), 0.1 * inner(faceted));
  // Away from the outline every hit lies on the ball and has its normal.
  for (const auto& [x, y] : pixels_of(smooth))
    if (smooth.cover.at(x, y) >= 1.0F && smooth.position.at(x, y).y() < -0.3F) {
      EXPECT_NEAR(smooth.position.at(x, y).norm(), 0.6, 1e-3);  // the mean over a pixel lies a little inside
      EXPECT_GT(smooth.normal.at(x, y).normalized().dot(smooth.position.at(x, y).normalized()), 0.9999F);
    }
}

TEST(PathTracer, ShadesGapsOfAnySize) {
  for (const double size : {1e-9, 1e-6, 1e-3, 1.0, 1e3}) {
    // A lid over a floor, at a thousandth of their size.
    const double gap = 1e-3 * size;
    const Mesh floor = plate(size, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY()), lid = plate(size, Vec3(0, 0, gap), Vec3::UnitY(), Vec3::UnitX());
    const std::array items = {matt(floor, 0.5), matt(lid, 0.5)};
    path::Geometry geometry;
    const Vec3f from(0.1F * static_cast<float>(size), 0.0F, 0.5F * static_cast<float>(gap));
    for (const std::size_t count : {1u, 2u}) {
      geometry.set(std::span(items).first(count), {}, 0.0, 0.0F);
      path::Hit hit;
      ASSERT_TRUE(geometry.meet(from, -Vec3f::UnitZ(), 0.0F, 0.0F, false, hit));
      EXPECT_EQ(geometry.blocked(hit.leave, Vec3f::UnitZ(), INFINITY, 0.0F), count == 2) << size;
    }
  }
}

TEST(PathTracer, FollowsBundlesAsItFollowsRays) {
  const std::array meshes = {sphere(Vec3(-0.3, 0, 0), 0.4, 12), sphere(Vec3(0.3, 0.2, 0), 0.4, 12)};
  std::array items = {matt(meshes[0], 0.5), matt(meshes[1], 0.5)};
  items[0].opacity = 0.5;
  path::Geometry geometry;
  geometry.set(items, {}, 0.0, 0.0F);
  std::size_t hits_found = 0, shadows = 0;
  for (const bool together : {false, true})
    for (int row = 0; row < 40; ++row) {
      const std::size_t count = 1 + static_cast<std::size_t>(row) % path::kLanes;
      path::RayBundle rays{.from = path::Vec3Lanes::Zero(), .direction = path::Vec3Lanes(Vec3f::UnitY()), .time = {},
                           .who = path::first_lanes(static_cast<int>(count)), .together = together};
      path::Lanes choice{}, light{};
      for (std::size_t i = 0; i < path::kLanes; ++i) {
        choice[i] = 0.1F + 0.11F * static_cast<float>(i);
        light[i] = i % 2 == 0 ? INFINITY : 2.9F;
        rays.from.set_lane(i, Vec3f(-0.8F + 0.04F * static_cast<float>(row) + 0.003F * static_cast<float>(i), -3, 0.1F));
      }
      std::array<path::Hit, path::kLanes> hits;
      const path::LaneMask met = geometry.meet(rays, choice, false, hits);
      const path::LaneMask blocked = geometry.blocked(rays, light);
      for (std::size_t i = 0; i < count; ++i) {
        path::Hit alone;
        EXPECT_EQ(met[i] != 0, geometry.meet(rays.from.lane(i), Vec3f::UnitY(), 0.0F, choice[i], false, alone));
        EXPECT_EQ(blocked[i] != 0, geometry.blocked(rays.from.lane(i), Vec3f::UnitY(), light[i], 0.0F));
        shadows += blocked[i] != 0 ? 1 : 0;
        if (met[i] == 0) continue;
        ++hits_found;
        EXPECT_EQ(hits[i].item, alone.item);
        EXPECT_NEAR(hits[i].distance, alone.distance, 1e-5);
      }
      for (std::size_t i = count; i < path::kLanes; ++i) EXPECT_TRUE(met[i] == 0 && blocked[i] == 0);
    }
  EXPECT_GT(hits_found, 120u);
  EXPECT_GT(shadows, 120u);
}

TEST(PathTracer, MissesNothingInBundlesAlongTheFacesOfTheBoxOfAllItems) {
  // In planes of the box, where the distance of a ray to them is no number.
  const Mesh mesh = plate(1.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  const Item item = matt(mesh, 0.5);
  path::Geometry geometry;
  geometry.set(std::span(&item, 1), {}, 0.0, 0.0F);
  int hits_found = 0;
  for (int place = 0; place < 49; ++place)
    for (const bool together : {false, true}) {
      const Vec3f from(0.5F * static_cast<float>(place % 7 - 3), 0.5F * static_cast<float>(place / 7 - 3), 1.0F), down = -Vec3f::UnitZ();
      const path::RayBundle rays{.from = path::Vec3Lanes(from), .direction = path::Vec3Lanes(down), .time = {},
                                 .who = path::first_lanes(1), .together = together};
      std::array<path::Hit, path::kLanes> hits;
      path::Hit alone;
      const bool met = geometry.meet(from, down, 0.0F, 0.0F, false, alone);
      EXPECT_EQ(geometry.meet(rays, path::Lanes{}, false, hits)[0] != 0, met) << from.transpose();
      EXPECT_EQ(geometry.blocked(rays)[0] != 0, geometry.blocked(from, down, INFINITY, 0.0F)) << from.transpose();
      hits_found += met ? 1 : 0;
    }
  EXPECT_EQ(hits_found, 2 * 25);
}

TEST(PathTracer, MissesNothingInBundlesThatComeFromAfarOrBeginInside) {
  const Mesh ball = sphere(Vec3(3, 0, 0), 1.0, 16), other = sphere(Vec3(-3, 1, 0), 0.5, 16);
  const std::array items = {matt(ball, 0.5), matt(other, 0.5)};
  path::Geometry geometry;
  geometry.set(items, {}, 0.0, 0.0F);
  int hits_found = 0;
  for (const float away : {0.0F, 2.0F, 30.0F, 3000.0F})
    for (int k = 0; k < 400; ++k) {
      // At vertices, where the ball of all items is nearest, and at places beside them.
      const Vec3f at = (1.0F + 0.001F * static_cast<float>(k % 3)) * ball.position[static_cast<std::size_t>(k) * ball.position.size() / 400].cast<float>();
      const Vec3f direction = Vec3f(std::sin(1.7F * static_cast<float>(k)), std::cos(2.3F * static_cast<float>(k)), 0.4F).normalized();
      const Vec3f from = at - away * direction;
      const path::RayBundle rays{.from = path::Vec3Lanes(from), .direction = path::Vec3Lanes(direction), .time = {}, .who = path::first_lanes(1)};
      std::array<path::Hit, path::kLanes> hits;
      path::Hit alone;
      const bool met = geometry.meet(from, direction, 0.0F, 0.0F, false, alone);
      EXPECT_EQ(geometry.meet(rays, path::Lanes{}, false, hits)[0] != 0, met) << k << " from " << away;
      EXPECT_EQ(geometry.blocked(rays)[0] != 0, geometry.blocked(from, direction, INFINITY, 0.0F)) << k << " from " << away;
      hits_found += met ? 1 : 0;
    }
  EXPECT_GT(hits_found, 400);
}

TEST(PathTracer, MeetsEachTriangleWhetherOrNotItJoinsTheNextOne) {
  // Squares of two triangles that begin at any of their corners, the same with the second one turned over, and fans of three.
  Mesh mesh;
  const auto add = [&](std::size_t a, std::size_t b, bool over, std::size_t count) {
    const auto first = static_cast<std::uint32_t>(mesh.position.size());
    const Vec3 corner(2.0 * static_cast<double>(first), 0, 0.1 * static_cast<double>(a));
    for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0.2), Vec3(1, 1, 0), Vec3(0, 1, 0.3), Vec3(-1, 0.5, 0)}) {
      mesh.position.push_back(corner + p);
      mesh.normal.push_back(Vec3(0.3 * p.y(), 0.4 * p.x() - 0.2 * p.y(), 1.0).normalized());
    }
    const std::array<std::array<std::uint32_t, 3>, 3> corners = {{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}}};
    for (std::size_t t = 0; t < count; ++t) {
      std::array<std::uint32_t, 3> own{};
      for (std::size_t k = 0; k < 3; ++k) own[k] = first + corners[t][(k + (t == 0 ? a : b)) % 3];
      if (over && t == 1) std::swap(own[0], own[1]);
      mesh.triangle.push_back(own);
    }
  };
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) {
      add(a, b, false, 2);
      add(a, b, true, 2);
      add(a, b, false, 3);
    }
  Item item = matt(mesh, 0.5);
  item.two_sided = true;
  path::Geometry geometry;
  geometry.set(std::span(&item, 1), {}, 0.0, 0.0F);
  for (const auto& t : mesh.triangle) {
    const bool back = (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]).z() < 0.0;
    for (const Vec3& weight : {Vec3(0.2, 0.3, 0.5), Vec3(0.05, 0.05, 0.9), Vec3(0.9, 0.05, 0.05), Vec3(0.45, 0.5, 0.05)}) {
      Vec3 p = Vec3::Zero(), n = Vec3::Zero();
      for (int k = 0; k < 3; ++k) {
        p += weight[k] * mesh.position[t[static_cast<std::size_t>(k)]];
        n += weight[k] * mesh.normal[t[static_cast<std::size_t>(k)]];
      }
      path::Hit hit;
      ASSERT_TRUE(geometry.meet((p + Vec3::UnitZ()).cast<float>(), -Vec3f::UnitZ(), 0.0F, 0.0F, false, hit)) << p.transpose();
      EXPECT_LT((hit.point.cast<double>() - p).norm(), 1e-5 * (1.0 + p.norm()));
      if (back) continue;
      EXPECT_LT((hit.normal.cast<double>() - n.normalized()).norm(), 1e-4) << p.transpose();
    }
  }
}

/// What a ray meets, alone and in a bundle.
std::array<path::Hit, 2> both_ways(const path::Geometry& geometry, const Vec3f& from, const Vec3f& direction) {
  std::array<path::Hit, 2> out;
  const path::RayBundle rays{.from = path::Vec3Lanes(from), .direction = path::Vec3Lanes(direction), .time = {},
                             .who = path::first_lanes(1), .together = true};
  std::array<path::Hit, path::kLanes> hits;
  EXPECT_NE(geometry.meet(rays, path::Lanes{}, false, hits)[0], 0);
  EXPECT_TRUE(geometry.meet(from, direction, 0.0F, 0.0F, false, out[0]));
  out[1] = hits[0];
  return out;
}

TEST(PathTracer, MeetsFrontsBeforeBacksAtOnePlace) {
  const Mesh ball = sphere(Vec3::Zero(), 1.0, 12);
  Mesh turned = ball;
  for (auto& t : turned.triangle) std::swap(t[0], t[1]);
  for (const bool first : {false, true}) {
    const std::array items = {matt(first ? ball : turned, 0.5), matt(first ? turned : ball, 0.5)};
    path::Geometry geometry;
    geometry.set(items, {}, 0.0, 0.0F);
    for (int k = 0; k < 500; ++k) {
      const Vec3f from = Vec3f(std::sin(1.7F * static_cast<float>(k)), std::cos(2.3F * static_cast<float>(k)), 0.9F).normalized();
      for (const path::Hit& hit : both_ways(geometry, 4.0F * from, -from)) {
        EXPECT_EQ(hit.item, first ? 0u : 1u);
        EXPECT_NEAR(hit.distance, 3.0, 0.02);
      }
    }
  }
}

TEST(PathTracer, MeetsTheSameWhateverItsHierarchy) {
  // Balls that lie in each other, so that rays at vertices, edges and between items meet several triangles at one place.
  constexpr int kFrames = 6;
  const auto moved = [](int frame) {
    std::array<Mesh, 3> meshes = {sphere(Vec3::Zero(), 1.0, 12), sphere(Vec3(0.5, 0, 0), 1.0, 12), sphere(Vec3::Zero(), 1.0, 12)};
    for (std::size_t m = 0; m < 3; ++m)
      for (Vec3& p : meshes[m].position) p += 0.03 * frame * Vec3(std::sin(3.0 * p.y()), std::cos(2.0 * p.z()), std::sin(4.0 * p.x()));
    return meshes;
  };
  const auto items_of = [](const std::array<Mesh, 3>& meshes) { return std::array{matt(meshes[0], 0.5), matt(meshes[1], 0.5), matt(meshes[2], 0.5)}; };
  path::Geometry refitted, fresh;
  std::array<Mesh, 3> meshes;
  for (int frame = 0; frame < kFrames; ++frame) {
    meshes = moved(frame);
    refitted.set(items_of(meshes), {}, 0.0, 0.0F);
    EXPECT_EQ(refitted.counts().refitted, frame == 0 ? 0 : 3);
  }
  fresh.set(items_of(meshes), {}, 0.0, 0.0F);
  EXPECT_EQ(fresh.counts().built, 3);
  const Mesh& mesh = meshes[0];
  for (const auto& t : mesh.triangle)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f a = mesh.position[t[k]].cast<float>(), b = mesh.position[t[(k + 1) % 3]].cast<float>();
      for (const float share : {0.0F, 0.25F, 0.5F}) {
        const Vec3f at = a + share * (b - a), direction = -at.normalized();
        const auto one = both_ways(refitted, at - 3.0F * direction, direction), other = both_ways(fresh, at - 3.0F * direction, direction);
        for (std::size_t way = 0; way < 2; ++way) {
          EXPECT_EQ(one[way].item, other[way].item);
          EXPECT_EQ(one[way].distance, other[way].distance);
          EXPECT_EQ(one[way].point, other[way].point);
          EXPECT_EQ(one[way].face_normal, other[way].face_normal);
        }
      }
    }
}

TEST(PathTracer, BuildsAnewWhatHasLeftItsHierarchy) {
  Mesh ball = sphere(Vec3::Zero(), 1.0, 24);
  const Item item = matt(ball, 0.5);
  path::Geometry geometry;
  const auto set = [&] { geometry.set(std::span(&item, 1), {}, 0.0, 0.0F); };
  set();
  EXPECT_EQ(geometry.counts().built, 1);
  const Mat3 turn = Eigen::AngleAxisd(0.3, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  for (Vec3& p : ball.position) p = 2.0 * (turn * p) + Vec3::UnitX();
  set();  // a body that turns, grows and goes
  EXPECT_EQ(geometry.counts().refitted, 1);
  for (std::size_t i = 0; i < ball.position.size(); i += 2) ball.position[i] = Vec3(2, 0, 0) - ball.position[i];
  set();
  EXPECT_EQ(geometry.counts().built, 1);
}

TEST(PathTracer, KeepsItemsAndMovesVertices) {
  Mesh a = sphere(Vec3::Zero(), 0.5, 8), b = sphere(Vec3::UnitX(), 0.3, 8);
  const std::array items = {matt(a, 0.5), matt(b, 0.5)};
  path::Geometry geometry;
  geometry.set(items, {}, 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().built, 2);
  geometry.set(items, {}, 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().kept, 2);
  for (Vec3& p : b.position) p += Vec3(0.5, 0, 0);
  geometry.set(items, {}, 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().kept, 1);
  EXPECT_EQ(geometry.counts().refitted, 1);
  // The moved one is met where it is now.
  path::Hit hit;
  EXPECT_TRUE(geometry.meet(Vec3f(1.5F, -2, 0), Vec3f::UnitY(), 0.0F, 0.0F, false, hit));
  EXPECT_FALSE(geometry.meet(Vec3f(0.95F, -2, 0), Vec3f::UnitY(), 0.0F, 0.0F, false, hit));
  b = sphere(Vec3::UnitX(), 0.3, 9);
  geometry.set(items, {}, 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().built, 1);
}

}  // namespace
}  // namespace supple::render::test
