// The filter of the path tracer: what it brings nearer to the truth, and what it must leave.
#include <gtest/gtest.h>

#include <cmath>

#include "path/denoise.h"
#include "render/path_studio.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

using path::Film;
using path::Vec3f;

TEST(PathTracer, FilterBringsAFewSamplesNearerToMany) {
  const Mesh ball = sphere(Vec3(0, 0, 0.1), 0.5, 32);
  const Item item{.mesh = &ball, .colour = Vec3(0.8, 0.5, 0.3)};
  Studio studio;
  studio.settings.width = studio.settings.height = 64;
  studio.lights.above = Vec3f::Ones();
  studio.lights.sun = {.to_light = Vec3f(0.3F, -0.5F, 0.8F).normalized(), .irradiance = Vec3f::Constant(3.0F), .cosine = 0.995F};
  studio.ground = path::GroundPlane{.height = -0.4F, .albedo = Vec3f::Constant(0.5F)};
  studio.settings.most_samples = 512;
  const Film reference = studio.trace(std::span(&item, 1));
  studio.settings.most_samples = 8;
  Film film = studio.trace(std::span(&item, 1));
  const double before = rms_difference(film, reference);
  path::Denoiser{}.run(Vec3f(0, -5, 0), static_cast<float>(2.0 * std::tan(0.15) / 64.0), Executor(1), film);
  EXPECT_LT(rms_difference(film, reference), 0.7 * before);  // much of the picture is outlines at this size
}

TEST(PathTracer, FilterLeavesTheEdgesOfReflections) {
  // A mirror lies under a plate that ends over its middle: half of it shows sky, half the plate.
  const Mesh mirror = plate(1.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  Mesh cover;
  add_quadrangle(cover, Vec3(0, -9, 1), Vec3(9, -9, 1), Vec3(9, 9, 1), Vec3(0, 9, 1));
  std::array items = {Item{.mesh = &mirror, .colour = Vec3::Ones(), .roughness = 0.02, .metallic = 1.0}, matt(cover, 0.0)};
  items[1].two_sided = true;
  Studio studio;
  studio.view.camera = {.from = Vec3(0, -5, 0.9), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.1};
  studio.settings.width = studio.settings.height = 64;
  studio.settings.most_samples = 8;
  studio.lights.above = Vec3f::Ones();
  Film film = studio.trace(items);
  path::Denoiser{}.run(Vec3f(0, -5, 0.9F), static_cast<float>(2.0 * std::tan(0.05) / 64.0), Executor(1), film);
  for (int x = 0; x < 64; ++x) {
    const float light = film.radiance.at(x, 32).y();
    if (x < 27) { EXPECT_GT(light, 0.97F) << x; }
    if (x > 36) { EXPECT_LT(light, 0.03F) << x; }
  }
}

TEST(PathTracer, FilterKeepsTheDarkOfNarrowGaps) {
  // Under a plate that hangs low over a floor in even light, light falls off over about the width of the gap.
  const Mesh floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  Mesh shade;
  add_quadrangle(shade, Vec3(0, -9, 0.05), Vec3(9, -9, 0.05), Vec3(9, 9, 0.05), Vec3(0, 9, 0.05));
  std::array items = {matt(floor, 0.5), matt(shade, 0.0)};
  items[1].two_sided = true;
  Studio studio;
  studio.view.camera = {.from = Vec3(-1.2, 0, 0.1), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.06};
  studio.settings.width = studio.settings.height = 64;
  studio.lights.above = Vec3f::Ones();
  studio.settings.most_samples = 256;
  const Film reference = studio.trace(items);
  studio.settings.most_samples = 8;
  Film film = studio.trace(items);
  const double before = rms_difference(film, reference);
  path::Denoiser{}.run(Vec3f(-1.2F, 0, 0.1F), static_cast<float>(2.0 * std::tan(0.03) / 64.0), Executor(1), film);
  EXPECT_LT(rms_difference(film, reference), 0.3 * before);
}

TEST(PathTracer, FilterKeepsNothingOfEarlierPictures) {
  // Quiet light, the edge of a shadow, and background where the earlier picture had surfaces.
  const Mesh floor = plate(1.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  const Mesh small = plate(0.3, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY()), shade = plate(0.2, Vec3(0, 0, 0.3), Vec3::UnitX(), Vec3::UnitY());
  const std::array earlier = {matt(floor, 0.5)};
  const std::array later = {matt(small, 0.5), matt(shade, 0.3)};
  Studio studio;
  studio.view.camera = {.from = Vec3(0, -2, 2), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.5};
  studio.settings.width = studio.settings.height = 64;
  studio.lights.above = Vec3f::Ones();
  studio.lights.sun = {.to_light = Vec3f::UnitZ(), .irradiance = Vec3f::Ones(), .cosine = 0.999F};
  const auto filter = [](path::Denoiser& denoiser, Film& film) {
    denoiser.run(Vec3f(0, -2, 2), static_cast<float>(2.0 * std::tan(0.25) / 64.0), Executor(1), film);
  };
  path::Denoiser used, unused;
  Film before = studio.trace(earlier), film = studio.trace(later), same = studio.trace(later);
  filter(used, before);
  filter(used, film);
  filter(unused, same);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) ASSERT_EQ(film.radiance.at(x, y), same.radiance.at(x, y)) << x << " " << y;
}

TEST(PathTracer, FilterLeavesQuietPixelsBesideNoisyOnes) {
  // Direct light in a checkerboard whose means over neighbours are alike everywhere: only the noise, in the columns from `kNoisy` on, says what is to be
  // smoothed. Eight pixels go through the filter together, some of which are quiet.
  constexpr int kSize = 32, kNoisy = 15, kSpread = 5;  // columns by which noise spreads, one with each level
  Film film;
  film.resize(kSize, kSize);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      film.cover.store(x, y, 1.0F);
      film.reflectance.store(x, y, Vec3f::Ones());
      film.normal.store(x, y, Vec3f::UnitZ());
      film.position.store(x, y, Vec3f(static_cast<float>(x), static_cast<float>(y), 0.0F));
      film.direct.radiance.store(x, y, Vec3f::Constant((x + y) % 2 == 0 ? 1.0F : 0.5F));
      film.direct.variance.store(x, y, x >= kNoisy ? 0.25F : 0.0F);
    }
  path::Denoiser{}.run(Vec3f(16, 16, 1000), 1e-3F, Executor(1), film);
  for (int y = 8; y < 24; ++y) {
    for (int x = 4; x < kNoisy - kSpread; ++x) EXPECT_NEAR(film.radiance.at(x, y).x(), (x + y) % 2 == 0 ? 1.0F : 0.5F, 1e-6F) << x << ' ' << y;
    for (int x = kNoisy + 2; x < 24; ++x) EXPECT_NEAR(film.radiance.at(x, y).x(), 0.75F, 0.15F) << x << ' ' << y;
  }
}

TEST(PathTracer, FilterKeepsTheBrightRimOfGlossyBodies) {
  // A red ball that mirrors a white sky: its reflectance grows to 1 towards the outline, within few pixels.
  const Mesh ball = sphere(Vec3::Zero(), 0.5, 96);
  const Item item{.mesh = &ball, .colour = Vec3(0.8, 0.1, 0.15), .roughness = 0.15};
  Studio studio;
  studio.settings.width = studio.settings.height = 64;
  studio.settings.noise = 0.1;
  studio.settings.most_samples = 64;
  studio.view.camera.field_of_view = 0.22;
  studio.lights.above = studio.lights.below = Vec3f::Ones();
  Film film = studio.trace(std::span(&item, 1));
  path::Denoiser{}.run(Vec3f(0, -5, 0), static_cast<float>(2.0 * std::tan(0.11) / 64.0), Executor(1), film);
  studio.settings.noise = 0.0;
  studio.settings.most_samples = 1024;
  const Film reference = studio.trace(std::span(&item, 1));
  double error2 = 0.0, light2 = 0.0, count = 0.0;
  for (const path::DetailedPixel& d : film.detailed) {
    if (d.detail != path::Detail::Surfaces || reference.cover.at(d.x, d.y) < 0.05F) continue;
    const double green = reference.radiance.at(d.x, d.y).y();  // of which the ball itself sends little
    error2 += std::pow(film.radiance.at(d.x, d.y).y() - green, 2);
    light2 += green * green;
    count += 1.0;
  }
  EXPECT_GT(count, 100.0);
  // Noise may be a tenth, and reflectances leave out what roughness does to them, as much again. That of neighbours farther in, which
  // reflect less, would be off by more than half.
  EXPECT_LT(std::sqrt(error2 / light2), 0.2);
}

TEST(PathTracer, FilterKeepsTheDarkOfGapsAlongOutlines) {
  // Where a ball stands on a floor, in even light, its outline passes over the darkest part of the floor.
  const Mesh ball = sphere(Vec3(0, 0, 0.3), 0.3, 48), floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  const std::array items = {matt(ball, 0.5), matt(floor, 0.5)};
  Studio studio;
  studio.settings.width = studio.settings.height = 64;
  studio.settings.noise = 0.8;
  studio.view.camera = {.from = Vec3(0, -5, 1.5), .look_at = Vec3(0, 0, 0.1), .up = Vec3::UnitZ(), .field_of_view = 0.12};
  studio.lights.above = Vec3f::Ones();
  studio.settings.most_samples = 64;
  const Film paths = studio.trace(items);
  Film film = studio.trace(items);
  path::Denoiser{}.run(Vec3f(0, -5, 1.4F), static_cast<float>(2.0 * std::tan(0.06) / 64.0), Executor(1), film);
  studio.settings.noise = 0.0;
  studio.settings.most_samples = 256;
  const Film reference = studio.trace(items);
  double bias = 0.0, light = 0.0, count = 0.0, error2 = 0.0, path_error2 = 0.0;
  for (const path::DetailedPixel& d : film.detailed) {
    if (d.detail != path::Detail::Surfaces || !d.walks) continue;
    const double error = film.radiance.at(d.x, d.y).y() - reference.radiance.at(d.x, d.y).y();
    bias += error;
    error2 += error * error;
    path_error2 += std::pow(paths.radiance.at(d.x, d.y).y() - reference.radiance.at(d.x, d.y).y(), 2);
    light += reference.radiance.at(d.x, d.y).y();
    count += 1.0;
  }
  EXPECT_GT(count, 20.0);
  // Some 3,000 paths with a deviation of at most .4 and a mean of .15: a standard error of 5 %. Neighbours alone are 30 % brighter.
  EXPECT_LT(std::abs(bias), 0.1 * light);
  EXPECT_LT(error2, 0.5 * path_error2);  // outlines learn from outlines
}

TEST(PathTracer, FilterLeavesNoSpecklesWhereOneSeesThroughSomething) {
  // Half of the rays pass a ball and see the floor behind it, whose normal on top of the ball is the ball's own.
  const Mesh ball = sphere(Vec3(0, 0, 0.3), 0.3, 48), floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  std::array items = {matt(ball, 0.3), matt(floor, 0.8)};
  items[0].opacity = 0.5;
  Studio studio;
  studio.settings.width = studio.settings.height = 48;
  studio.settings.noise = 0.8;
  studio.view.camera = {.from = Vec3(0, -5, 4), .look_at = Vec3(0, 0, 0.3), .up = Vec3::UnitZ(), .field_of_view = 0.08};  // the ball fills it
  studio.lights.above = Vec3f(1.0F, 0.5F, 0.2F);
  studio.settings.most_samples = 64;
  Film film = studio.trace(items);
  path::Denoiser{}.run(Vec3f(0, -5, 3.7F), static_cast<float>(2.0 * std::tan(0.04) / 48.0), Executor(1), film);
  studio.settings.noise = 0.0;
  studio.settings.most_samples = 1024;
  const Film reference = studio.trace(items);
  double light = 0.0, error2 = 0.0, most = 0.0;
  for (int y = 8; y < 40; ++y)
    for (int x = 8; x < 40; ++x) {  // all of them on the ball
      const double expected = reference.radiance.at(x, y).y(), error = film.radiance.at(x, y).y() - expected;
      light += expected / (32 * 32);
      error2 += error * error / (32 * 32);
      most = std::max(most, std::abs(error));
    }
  // 16 paths a surface in each of 25 pixels, of about their own mean as deviation: 5 %, of two surfaces 3.5 %.
  EXPECT_LT(std::sqrt(error2), 0.035 * light);
  EXPECT_LT(most, 6.0 * 0.035 * light);
}

TEST(PathTracer, FilterLeavesNoDotsWhereAFewPathsMeetSomethingDark) {
  // A twentieth of an even sky is hidden behind a black plate: of two paths of a pixel hardly ever both end there.
  const Mesh floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  const Mesh shade = plate(1.0, Vec3(0.0, 3.0, 2.0), Vec3::UnitX(), Vec3(0.0, 0.6, 0.8));
  std::array items = {matt(floor, 0.5), matt(shade, 0.0)};
  items[1].two_sided = true;
  Studio studio;
  studio.view.camera = {.from = Vec3(0, -5, 3), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.1};
  studio.settings.width = studio.settings.height = 128;
  studio.lights.above = Vec3f::Ones();
  studio.settings.most_samples = 4;
  Film film = studio.trace(items);
  int dark = 0;
  for (const auto& [x, y] : pixels_of(film)) dark += film.indirect.radiance.at(x, y).y() == 0.0F;
  ASSERT_GT(dark, 0);
  path::Denoiser{}.run(Vec3f(0, -5, 3), static_cast<float>(2.0 * std::tan(0.05) / 128.0), Executor(1), film);
  for (int y = 1; y < 127; ++y)
    for (int x = 1; x < 127; ++x) {
      const auto light = [&](int px, int py) { return film.radiance.at(px, py).y(); };
      const float around = 0.25F * (light(x - 1, y) + light(x + 1, y) + light(x, y - 1) + light(x, y + 1));
      EXPECT_NEAR(light(x, y), around, 0.01F * around) << x << " " << y;
    }
}

}  // namespace
}  // namespace supple::render::test
