// Light inside of bodies: glass against the laws of Snell, Fresnel and Beer, and energy in an even light.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render/path_studio.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

using path::Film;
using path::Vec3f;

constexpr double kIndex = 1.5;
const double kNormal = std::pow((kIndex - 1.0) / (kIndex + 1.0), 2);  // reflected at normal incidence

Item glass(const Mesh& mesh) { return {.mesh = &mesh, .colour = Vec3::Ones(), .inside = {.kind = InsideKind::Glass, .index = kIndex}}; }

Item scattering(const Mesh& mesh, double albedo, double free_path, double reflectance) {
  Item item = matt(mesh, albedo);
  item.reflectance = reflectance;
  item.roughness = 0.5;
  item.inside = {.kind = InsideKind::Scatter, .depth = free_path};
  return item;
}

/// Its large faces are across the line of sight, turned by an angle about z.
Mesh slab(double thickness, double turn) {
  Mesh mesh;
  const Mat3 axes = Eigen::AngleAxisd(turn, Vec3::UnitZ()).toRotationMatrix();
  const Vec3 u = 2.0 * axes.col(0), v = 0.5 * thickness * axes.col(1), w = 2.0 * axes.col(2);
  add_quadrangle(mesh, -u - v - w, u - v - w, u - v + w, -u - v + w);
  add_quadrangle(mesh, u + v - w, -u + v - w, -u + v + w, u + v + w);
  add_quadrangle(mesh, -u + v - w, -u - v - w, -u - v + w, -u + v + w);
  add_quadrangle(mesh, u - v - w, u + v - w, u + v + w, u - v + w);
  add_quadrangle(mesh, -u - v + w, u - v + w, u + v + w, -u + v + w);
  add_quadrangle(mesh, -u + v - w, u + v - w, u - v - w, -u - v - w);
  return mesh;
}

/// Mean over the pixels that show nothing but surfaces.
double mean_inside(const Film& film) {
  double sum = 0.0, count = 0.0;
  for (const auto& [x, y] : pixels_of(film)) {
    if (film.cover.at(x, y) < 1.0F) continue;
    sum += film.radiance.at(x, y).y();
    count += 1.0;
  }
  return sum / count;
}

struct EvenLight : Studio {
  EvenLight() {
    lights.above = lights.below = Vec3f::Ones();
    settings.most_samples = 64;
  }
};

TEST(Glass, RefractsAndReflectsByTheLawsOfSnellAndFresnel) {
  for (const double ratio : {1.0 / kIndex, kIndex, 1.0 / 2.4, 1.0 / 1.33})
    for (double angle = 0.0; angle < 1.56; angle += 0.05) {
      const path::RefractionOf<float> found(static_cast<float>(std::cos(angle)), static_cast<float>(ratio));
      const double sine = ratio * std::sin(angle);
      if (sine >= 1.0) {
        EXPECT_EQ(found.reflected, 1.0F) << ratio << ' ' << angle;
        continue;
      }
      const double beyond = std::asin(sine);
      EXPECT_NEAR(found.cosine, std::cos(beyond), 1e-5);
      // Fresnel 1823, in sums and differences of the angles.
      const double across = angle == 0.0 ? (1.0 - 1.0 / ratio) / (1.0 + 1.0 / ratio) : std::sin(angle - beyond) / std::sin(angle + beyond);
      const double along = angle == 0.0 ? across : std::tan(angle - beyond) / std::tan(angle + beyond);
      EXPECT_NEAR(found.reflected, 0.5 * (across * across + along * along), 1e-5) << ratio << ' ' << angle;
    }
  EXPECT_NEAR(path::RefractionOf<float>(1.0F, static_cast<float>(1.0 / kIndex)).reflected, kNormal, 1e-6);
}

TEST(Glass, IsInvisibleInEvenLight) {
  const Mesh ball = sphere(Vec3::Zero(), 0.3, 48);
  const Item item = glass(ball);
  EvenLight studio;
  EXPECT_NEAR(mean_inside(studio.trace(std::span(&item, 1))), 1.0, 2e-3);
}

TEST(Glass, ShiftsWhatIsBehindATiltedPlateBySnellsLaw) {
  constexpr double kThickness = 0.4, kTurn = 0.8;
  const Mesh plate = slab(kThickness, kTurn);
  const Item item = glass(plate);
  Studio studio;
  studio.settings.width = 256;
  studio.settings.height = 16;
  studio.settings.most_samples = 256;
  studio.view.camera = {.from = Vec3(0, -400, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.0002};  // lines of sight are parallel
  studio.lights.rectangles.push_back({.centre = Vec3f(0, 3, 0), .u = 0.1F * Vec3f::UnitX(), .v = 2.0F * Vec3f::UnitZ(), .front = -Vec3f::UnitY(), .radiance = Vec3f::Ones()});
  const Film film = studio.trace(std::span(&item, 1));
  double sum = 0.0, moment = 0.0;
  for (const auto& [x, y] : pixels_of(film)) {
    const double light = film.radiance.at(x, y).y();
    sum += light;
    moment += light * (x + 0.5 - 0.5 * film.width);
  }
  const double pixel = 2.0 * 400.0 * std::tan(0.0001) / film.height;
  const double beyond = std::asin(std::sin(kTurn) / kIndex);
  const double shift = kThickness * std::sin(kTurn - beyond) / std::cos(beyond);
  EXPECT_NEAR(std::abs(moment / sum * pixel), shift, 0.02 * shift);
}

TEST(Glass, LetsPassWhatPlatesDo) {
  // All reflections between both faces together, and Beer's law along each way.
  const Mesh plate = slab(0.2, 0.0);
  Item item = glass(plate);
  Studio studio;
  studio.settings.most_samples = 4096;
  studio.settings.width = studio.settings.height = 8;
  studio.view.camera.field_of_view = 0.02;
  studio.lights.rectangles.push_back({.centre = Vec3f(0, 3, 0), .u = Vec3f::UnitX(), .v = Vec3f::UnitZ(), .front = -Vec3f::UnitY(), .radiance = Vec3f::Ones()});
  EXPECT_NEAR(mean_inside(studio.trace(std::span(&item, 1))), (1.0 - kNormal) / (1.0 + kNormal), 3e-3);
  item.colour = matt(plate, 0.5).colour;
  item.inside.depth = 0.2;
  const double through = 0.5, once = (1.0 - kNormal) * (1.0 - kNormal) * through / (1.0 - kNormal * kNormal * through * through);
  EXPECT_NEAR(mean_inside(studio.trace(std::span(&item, 1))), once, 3e-3);
  // Shadows take the way without reflections.
  EXPECT_NEAR(studio.geometry.passed_by_glass(Vec3f(0.1F, -1, 0.2F), Vec3f::UnitY(), 0.0F, INFINITY).y(), (1.0 - kNormal) * (1.0 - kNormal) * through, 1e-4);
  EXPECT_EQ(studio.geometry.passed_by_glass(Vec3f(0.1F, -1, 0.2F), Vec3f::UnitY(), 0.0F, 0.5F).y(), 1.0F);
  EXPECT_FALSE(studio.geometry.blocked(Vec3f(0.1F, -1, 0.2F), Vec3f::UnitY(), INFINITY, 0.0F));
}

TEST(Glass, MirrorsTheSun) {
  const Mesh plate = slab(0.2, 0.0);
  const Item item = glass(plate);
  Studio studio;
  studio.settings.width = studio.settings.height = 8;
  studio.view.camera.field_of_view = 0.002;
  const double cosine = 0.999;
  studio.lights.sun = {.to_light = -Vec3f::UnitY(), .irradiance = Vec3f::Ones(), .cosine = static_cast<float>(cosine)};
  const double radiance = 1.0 / (std::numbers::pi * (1.0 - cosine * cosine));
  const Film film = studio.trace(std::span(&item, 1));
  double direct = 0.0;
  for (const auto& [x, y] : pixels_of(film)) direct += film.direct.radiance.at(x, y).y() / 64.0;
  EXPECT_NEAR(direct, kNormal * radiance, 1e-3 * radiance);
}

TEST(Scatter, KeepsAllEnergyWhereNothingIsAbsorbed) {
  const Mesh ball = sphere(Vec3::Zero(), 0.3, 32);
  EvenLight studio;
  for (const double free_path : {0.02, 0.1, 1.0}) {
    const Item white = scattering(ball, 1.0, free_path, 0.0);
    EXPECT_NEAR(mean_inside(studio.trace(std::span(&white, 1))), 1.0, 4e-3) << free_path;
    // Below a coat it sends back as much as an opaque body does.
    const Item coated = scattering(ball, 1.0, free_path, 0.04);
    Item opaque = coated;
    opaque.inside = {};
    const double mean = mean_inside(studio.trace(std::span(&coated, 1)));
    EXPECT_NEAR(mean, mean_inside(studio.trace(std::span(&opaque, 1))), 0.01) << free_path;
    EXPECT_LT(mean, 1.0) << free_path;
  }
}

TEST(Scatter, HasTheColourOfTheItemWhereItIsThick) {
  const Mesh plate = slab(1.0, 0.0);
  EvenLight studio;
  studio.settings.width = studio.settings.height = 16;
  studio.settings.most_samples = 1024;
  for (const double albedo : {0.2, 0.5, 0.8}) {
    const Item item = scattering(plate, albedo, 0.01, 0.0);
    EXPECT_NEAR(mean_inside(studio.trace(std::span(&item, 1))), albedo, 0.02) << albedo;
  }
}

TEST(Scatter, LetsLightThroughWhereItIsThin) {
  // Lit from behind: the thinner a body, the brighter.
  Studio studio;
  studio.settings.most_samples = 64;
  studio.lights.sun = {.to_light = Vec3f::UnitY(), .irradiance = Vec3f::Ones(), .cosine = 0.999F};
  double before = 0.0;
  for (const double thickness : {2.0, 0.4, 0.1, 0.02}) {
    const Mesh plate = slab(thickness, 0.0);
    const Item item = scattering(plate, 0.8, 0.1, 0.0);
    const double light = mean_inside(studio.trace(std::span(&item, 1)));
    EXPECT_GT(light, 1.3 * before) << thickness;
    before = light;
  }
  EXPECT_GT(before, 0.1);
  EXPECT_LT(before, 1.0 / std::numbers::pi);
}

TEST(Scatter, IsTheSameForAnyNumberOfThreads) {
  const Mesh ball = sphere(Vec3(-0.2, 0, 0), 0.2, 24), other = sphere(Vec3(0.2, 0, 0), 0.2, 24);
  const std::array items = {glass(ball), scattering(other, 0.7, 0.05, 0.04)};
  EvenLight studio;
  studio.lights.sun = {.to_light = Vec3f(0.3F, -0.5F, 0.8F).normalized(), .irradiance = Vec3f::Ones(), .cosine = 0.999F};
  const Film one = studio.trace(items, 1), two = studio.trace(items, 2);
  for (const auto& [x, y] : pixels_of(one)) ASSERT_EQ(one.radiance.at(x, y), two.radiance.at(x, y));
}

}  // namespace
}  // namespace supple::render::test
