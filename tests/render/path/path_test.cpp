// The path tracer against closed forms: even light, the sky over a tilted plate, rectangles of light and their shadows.
#include <bit>
#include <cmath>
#include <numeric>
#include <set>

#include "render/path_studio.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

using path::Bsdf;
using path::Film;
using path::Lights;
using path::Sampler;
using path::Vec3f;

constexpr float kPi = path::kPi;

TEST(PathTracer, FindsAWhiteBodyInEvenLightAsBrightAsTheLight) {
  // The furnace test: what reflects everything cannot be seen, what reflects half is half as bright.
  const Mesh ball = sphere(Vec3::Zero(), 0.5, 24);
  Studio studio;
  studio.lights.above = studio.lights.below = Vec3f::Ones();
  for (const double albedo : {1.0, 0.5}) {
    const Item item = matt(ball, albedo);
    const Film film = studio.trace(std::span(&item, 1));
    double covered = 0.0;
    for (const auto& [x, y] : pixels_of(film)) {
      covered += film.cover.at(x, y);
      if (film.cover.at(x, y) > 0.0F) { EXPECT_NEAR(film.radiance.at(x, y).y(), albedo, 1e-4); }  // each path's weight is exact
    }
    EXPECT_GT(covered, 200.0);
  }
}

TEST(PathTracer, LosesNoLightBetweenWhiteBodies) {
  // Two touching balls trade light many times; in even light they too cannot be seen.
  const std::array meshes = {sphere(Vec3(-0.35, 0, 0), 0.35, 24), sphere(Vec3(0.35, 0, 0), 0.35, 24)};
  const std::array items = {matt(meshes[0], 1.0), matt(meshes[1], 1.0)};
  Studio studio;
  studio.settings.bounces = 64;
  studio.settings.most_samples = 64;
  studio.lights.above = studio.lights.below = Vec3f::Ones();
  const Film film = studio.trace(items);
  double sum = 0.0, count = 0.0;
  for (const auto& [x, y] : pixels_of(film)) {
    sum += film.cover.at(x, y) * film.radiance.at(x, y).y();
    count += film.cover.at(x, y);
  }
  // Roulette lets a fifth of some ten thousand paths or less end at 0 or go on heavier: deviation .25 / 100, four times.
  EXPECT_NEAR(sum / count, 1.0, 0.01);
}

TEST(PathTracer, LosesNoLightInADeepWhiteBox) {
  Mesh box;  // open above
  const std::array<Vec3, 4> corner = {Vec3(-0.3, -0.3, 0), Vec3(0.3, -0.3, 0), Vec3(0.3, 0.3, 0), Vec3(-0.3, 0.3, 0)};
  const Vec3 down(0, 0, -1.2);
  add_quadrangle(box, corner[0] + down, corner[1] + down, corner[2] + down, corner[3] + down);
  for (std::size_t k = 0; k < 4; ++k) add_quadrangle(box, corner[(k + 1) % 4], corner[k], corner[k] + down, corner[(k + 1) % 4] + down);
  Item item = matt(box, 1.0);
  item.two_sided = true;
  Studio studio;
  studio.view.camera = {.from = Vec3(0, 0, 8), .look_at = Vec3(0, 0, -1), .up = Vec3::UnitY(), .field_of_view = 0.05};
  studio.settings.bounces = 256;
  studio.settings.most_samples = 64;
  studio.lights.above = studio.lights.below = Vec3f::Ones();
  const Film film = studio.trace(std::span(&item, 1));
  for (const auto& [x, y] : pixels_of(film)) ASSERT_EQ(film.cover.at(x, y), 1.0F);
  // Paths leave after some four bounces, of which roulette ends 5 % and makes the others heavier: deviation .25 of 32,000 paths.
  EXPECT_NEAR(mean_green(film), 1.0, 0.01);
}

/// Whether each box of 2^-a x 2^-(m-a) holds one of 2^m points, for every a: a (0, m, 2)-net in base 2.
bool is_net(const std::vector<path::Pair<float>>& points) {
  const int m = static_cast<int>(std::bit_width(points.size())) - 1;
  for (int a = 0; a <= m; ++a) {
    std::set<std::pair<int, int>> boxes;
    for (const auto& [x, y] : points)
      boxes.emplace(static_cast<int>(x * static_cast<float>(1 << a)), static_cast<int>(y * static_cast<float>(1 << (m - a))));
    if (boxes.size() != points.size()) return false;
  }
  return true;
}

TEST(Sampler, FillsEveryElementaryIntervalOnceByPairs) {
  const auto points = [](int pixel, int dimension, std::uint32_t count) {
    std::vector<path::Pair<float>> all;
    for (std::uint32_t s = 0; s < count; ++s) {
      Sampler random(static_cast<std::uint32_t>(pixel), 7, 3, count, s);
      for (int d = 0; d < dimension; ++d) static_cast<void>(random.pair());
      all.push_back(random.pair());
    }
    return all;
  };
  for (int pixel = 0; pixel < 20; ++pixel)
    for (const int dimension : {0, 1, 5}) EXPECT_TRUE(is_net(points(pixel, dimension, 16))) << pixel << ' ' << dimension;
  for (const std::uint32_t count : {256u, 4096u}) EXPECT_TRUE(is_net(points(3, 2, count))) << count;
}

TEST(Sampler, FillsThemByTheSamplesOfSquareBlocksOfPixelsToo) {
  for (const std::uint32_t across : {1u, 2u, 4u})
    for (const std::uint32_t left : {0u, 4u, 252u, 256u, 700u}) {
      std::vector<path::Pair<float>> points;
      const std::uint32_t each = 16 / (across * across);
      for (std::uint32_t y = 8; y < 8 + across; ++y)
        for (std::uint32_t x = left; x < left + across; ++x)
          for (std::uint32_t s = 0; s < each; ++s) points.push_back(Sampler(x, y, 0, each, s).pair());
      EXPECT_TRUE(is_net(points)) << across << ' ' << left;
    }
}

TEST(Bsdf, ReflectsNoMoreThanComesInFromAnyAngle) {
  for (const float alpha : {0.02F, 0.2F, 0.6F, 1.0F})
    for (const float reflectance : {0.0F, 0.04F, 0.5F})
      for (const float cosine : {0.05F, 0.3F, 0.7F, 1.0F}) {
        const Bsdf bsdf{.diffuse = Vec3f::Ones(), .normal_reflectance = Vec3f::Constant(reflectance),
                        .grazing_reflectance = reflectance > 0.0F ? 1.0F : 0.0F, .alpha = alpha};
        const Vec3f out(std::sqrt(1.0F - cosine * cosine), 0.0F, cosine);
        double sum = 0.0;
        constexpr std::uint32_t kSamples = 4096;
        for (std::uint32_t s = 0; s < kSamples; ++s) {
          Sampler random(1, 2, 0, kSamples, s);
          const float which = random.number();
          const Vec3f in = bsdf.sample(out, which, random.pair());
          const float density = bsdf.density(out, in);
          if (density > 0.0F) sum += bsdf.evaluate(out, in).y() / density;
        }
        EXPECT_LT(sum / kSamples, 1.0 + 0.02) << alpha << ' ' << reflectance << ' ' << cosine;  // 4 standard errors
      }
}

// The integral of the falls over all directions cancels by the factor's design: what is left is (1 - R0)(1 - g fall(cos)).
TEST(Bsdf, BaseReflectsWhatTheLobeLeaves) {
  for (const float grazing : {0.0F, 0.5F, 1.0F})
    for (const float cosine : {0.1F, 0.5F, 1.0F}) {
      const Bsdf with{.diffuse = Vec3f(0.2F, 0.6F, 1.0F), .normal_reflectance = Vec3f::Constant(0.1F * grazing), .grazing_reflectance = grazing};
      Bsdf without = with;
      without.diffuse = Vec3f::Zero();
      const Vec3f out(std::sqrt(1.0F - cosine * cosine), 0.0F, cosine);
      Vec3 sum = Vec3::Zero();
      constexpr int kSteps = 400;
      for (int i = 0; i < kSteps; ++i) {
        const float c = (static_cast<float>(i) + 0.5F) / kSteps;
        const Vec3f in(0.0F, std::sqrt(1.0F - c * c), c);  // the same for every angle about the normal
        sum += 2.0 * kPi / kSteps * (with.evaluate(out, in) - without.evaluate(out, in)).cast<double>();
      }
      const Vec3 expected = (1.0 - 0.1 * grazing) * (1.0 - grazing * std::pow(1.0 - 0.5 * cosine, 5)) * with.diffuse.cast<double>();
      EXPECT_LT((sum - expected).norm(), 1e-4) << grazing << ' ' << cosine;
    }
}

TEST(Bsdf, DensitiesIntegrateToTheShareAboveTheHorizonAndAgreeWithValues) {
  for (const float alpha : {0.15F, 0.5F}) {
    const Bsdf bsdf{.diffuse = Vec3f::Constant(0.4F), .normal_reflectance = Vec3f::Constant(0.1F), .alpha = alpha};
    const Vec3f out = Vec3f(0.6F, 0.0F, 0.8F);
    // Mid-point rule in cos and angle; the lobe is smooth over many cells.
    double density = 0.0, reflected = 0.0;
    constexpr int kCos = 400, kAngle = 800;
    for (int i = 0; i < kCos; ++i)
      for (int k = 0; k < kAngle; ++k) {
        const float c = (static_cast<float>(i) + 0.5F) / kCos, s = std::sqrt(1.0F - c * c);
        const float angle = 2.0F * kPi * (static_cast<float>(k) + 0.5F) / kAngle;
        const Vec3f in(s * std::cos(angle), s * std::sin(angle), c);
        density += bsdf.density(out, in);
        reflected += bsdf.evaluate(out, in).y();
      }
    const double cell = 2.0 * M_PI / (static_cast<double>(kCos) * kAngle);
    double above = 0.0, sampled = 0.0;
    constexpr std::uint32_t kSamples = 16384;
    for (std::uint32_t s = 0; s < kSamples; ++s) {
      Sampler random(3, 4, 0, kSamples, s);
      const float which = random.number();
      const Vec3f in = bsdf.sample(out, which, random.pair());
      if (in.z() <= 0.0F) continue;
      above += 1.0 / kSamples;
      sampled += bsdf.evaluate(out, in).y() / bsdf.density(out, in) / kSamples;
    }
    EXPECT_NEAR(density * cell, above, 0.005);
    EXPECT_NEAR(sampled, reflected * cell, 0.005);
    // Reciprocity: f itself is symmetric.
    const Vec3f in = Vec3f(-0.3F, 0.5F, std::sqrt(1.0F - 0.34F));
    EXPECT_NEAR(bsdf.evaluate(out, in).y() / in.z(), bsdf.evaluate(in, out).y() / out.z(), 1e-5);
  }
}

TEST(PathTracer, LightsATiltedPlateByItsShareOfSkyAndOfWhatIsBelow) {
  Studio studio;
  studio.settings.most_samples = 256;
  studio.lights.above = Vec3f::Constant(2.0F);
  studio.lights.below = Vec3f::Constant(0.5F);
  for (const double tilt : {0.0, 0.6, 1.2}) {  // of the normal from the horizon upward
    const Vec3 up(0, std::sin(tilt), std::cos(tilt));
    const Mesh mesh = plate(4.0, Vec3::Zero(), Vec3::UnitX(), up);
    const Item item = matt(mesh, 0.6);
    const Film film = studio.trace(std::span(&item, 1));
    const double normal_z = mesh.normal[0].z();
    ASSERT_LT(mesh.normal[0].y(), 0.0);
    const double expected = 0.6 * (2.0 * 0.5 * (1.0 + normal_z) + 0.5 * 0.5 * (1.0 - normal_z));
    const double mean = mean_green(film);
    // A sample is 1.2 or .3 with about even chance: deviation .45, over 512 for 32^2 x 256 samples, four times.
    EXPECT_NEAR(mean, expected, 4.0 * 0.45 / 512.0) << tilt;
  }
}

TEST(PathTracer, GivesTheSunItsIrradianceWhateverItsSize) {
  const Mesh mesh = plate(2.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ());
  const Item item = matt(mesh, 0.5);
  Studio studio;
  studio.lights.sun = {.to_light = Vec3f(0.6F, -0.8F, 0.0F), .irradiance = Vec3f::Constant(kPi), .cosine = 1.0F};
  for (const double radius : {0.0, 0.05, 0.3}) {
    studio.lights.sun.cosine = static_cast<float>(std::cos(radius));
    studio.settings.most_samples = 64;
    const Film film = studio.trace(std::span(&item, 1));
    const double mean = mean_green(film);
    EXPECT_NEAR(mean, 0.5 * 0.8, 0.004) << radius;  // albedo times E / pi times the cosine; the disc is above the plate
  }
}

/// Irradiance over pi of unit radiance from the rectangle [x0, x1] x [y0, y1] at height h over the origin, which faces it
/// (Hottel's view factor of a corner, four times).
double corner_factor(double a, double b, double h) {
  const double x = a / h, y = b / h;
  return 0.5 / M_PI * (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) + y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y)));
}
double view_factor(double x0, double x1, double y0, double y1, double h) {
  return corner_factor(x1, y1, h) - corner_factor(x0, y1, h) - corner_factor(x1, y0, h) + corner_factor(x0, y0, h);
}

TEST(PathTracer, ShadesTheEdgeOfARectanglesShadowByItsVisiblePart) {
  // Floor at z = 0, a light of 1 x 1 at z = 2, and at z = 1 a half plane over x > 0. From the floor at x, the light is
  // seen for light coordinates below -x.
  Studio studio;
  const Mesh floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  Mesh shade;
  add_quadrangle(shade, Vec3(0, -9, 1), Vec3(9, -9, 1), Vec3(9, 9, 1), Vec3(0, 9, 1));
  std::array items = {matt(floor, 1.0), matt(shade, 0.0)};
  items[1].two_sided = true;
  studio.lights.rectangles = {{.centre = Vec3f(0, 0, 2), .u = Vec3f(0.5F, 0, 0), .v = Vec3f(0, -0.5F, 0), .front = -Vec3f::UnitZ(),
                               .radiance = Vec3f::Constant(3.0F)}};
  studio.settings.most_samples = 1024;
  studio.settings.width = studio.settings.height = 4;
  for (const double x : {-1.0, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6}) {
    studio.view.camera = {.from = Vec3(x - 1.5, 0, 0.5), .look_at = Vec3(x, 0, 0), .up = Vec3::UnitZ(), .field_of_view = 0.002};
    const Vec3f shift = Vec3f(static_cast<float>(-x), 0, 0);  // places are relative to what is looked at
    studio.lights.rectangles[0].centre = Vec3f(0, 0, 2) + shift;
    const Film film = studio.trace(items);
    const double upper = std::clamp(-x, -0.5, 0.5);
    const double expected = 3.0 * view_factor(-0.5 - x, upper - x, -0.5, 0.5, 2.0);
    const double mean = mean_green(film);
    // 16,384 stratified samples of at most 3 x .08 / (share): below .002 in every case.
    EXPECT_NEAR(mean, expected, 0.003) << x;
  }
}

TEST(PathTracer, ConvergesAtLeastAsTheRootOfTheSamples) {
  const Mesh ball = sphere(Vec3(0, 0, 0.1), 0.5, 16);
  const Item item{.mesh = &ball, .colour = Vec3(0.8, 0.5, 0.3), .roughness = 0.5};
  Studio studio;
  studio.lights.above = Vec3f::Ones();
  studio.lights.sun = {.to_light = Vec3f(0.3F, -0.5F, 0.8F).normalized(), .irradiance = Vec3f::Constant(3.0F), .cosine = 0.99F};
  studio.ground = path::GroundPlane{.height = -0.4F, .albedo = Vec3f::Constant(0.5F)};
  studio.settings.width = studio.settings.height = 16;
  studio.settings.most_samples = 4096;
  const Film reference = studio.trace(std::span(&item, 1));
  std::vector<double> x, y;
  for (const int n : {4, 16, 64, 256}) {
    studio.settings.least_samples = studio.settings.most_samples = n;
    const Film film = studio.trace(std::span(&item, 1));
    x.push_back(std::log(n));
    y.push_back(std::log(rms_difference(film, reference)));
  }
  const double mx = (x[0] + x[1] + x[2] + x[3]) / 4, my = (y[0] + y[1] + y[2] + y[3]) / 4;
  double slope = 0.0, norm = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    slope += (x[i] - mx) * (y[i] - my);
    norm += (x[i] - mx) * (x[i] - mx);
  }
  EXPECT_LT(slope / norm, -0.47);  // independent samples: -1/2; stratified ones fall faster
  EXPECT_GT(slope / norm, -1.5);
}

TEST(PathTracer, TakesSamplesUntilTheStatedNoise) {
  const Mesh ball = sphere(Vec3::Zero(), 0.5, 16);
  const Item item{.mesh = &ball, .colour = Vec3(0.8, 0.5, 0.3)};
  Studio studio;
  studio.lights.above = Vec3f::Ones();
  studio.lights.sun = {.to_light = Vec3f(0.3F, -0.5F, 0.8F).normalized(), .irradiance = Vec3f::Constant(3.0F), .cosine = 0.98F};
  studio.settings.width = studio.settings.height = 24;
  studio.settings.most_samples = 2048;
  const Film reference = studio.trace(std::span(&item, 1));
  double before = 0.0;
  studio.settings.most_samples = 1024;
  for (const double noise : {0.2, 0.05, 0.02}) {
    studio.settings.noise = noise;
    const Film film = studio.trace(std::span(&item, 1));
    const double samples = total(film, film.samples);
    EXPECT_GT(samples, before);
    before = samples;
    double sum = 0.0, count = 0.0;
    for (const auto& [x, y] : pixels_of(film)) {
      const double exact = path::luminance(reference.radiance.at(x, y)) * reference.cover.at(x, y);
      const double error = (path::luminance(film.radiance.at(x, y)) * film.cover.at(x, y) - exact) / (exact + 0.1);
      sum += error * error;
      count += 1.0;
    }
    EXPECT_LT(std::sqrt(sum / count), 1.2 * noise) << noise;  // the reference has noise of its own
  }
}

TEST(PathTracer, TakesMoreSamplesWhereSurfacesMeetInThePicture) {
  const Mesh ball = sphere(Vec3::Zero(), 0.4, 48);
  const Item item = matt(ball, 0.5);
  Studio studio;
  studio.settings.noise = 1.0;
  studio.settings.most_samples = 64;
  studio.settings.width = studio.settings.height = 64;
  studio.lights.above = studio.lights.below = Vec3f::Ones();
  const Film film = studio.trace(std::span(&item, 1));
  const double radius = 32.0 * std::tan(std::asin(0.4 / 5.0)) / std::tan(0.15);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      const double off = std::hypot(x - 31.5, y - 31.5) - radius;
      const float samples = film.samples.at(x, y);
      if (std::abs(off) < 0.5) {
        EXPECT_EQ(samples, 32.0F) << x << ' ' << y;
      } else if (off > 3.0 || off < -8.0) {
        EXPECT_EQ(samples, 1.0F) << x << ' ' << y;
      }
    }
}

/// A floor seen from above, 64 pixels of 0.02 m across, under a black half-plane x > 0 at some height.
struct HalfShaded : Studio {
  Mesh floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  Mesh shade;
  std::array<Item, 2> items;
  explicit HalfShaded(double height) {
    add_quadrangle(shade, Vec3(0, -90, height), Vec3(90, -90, height), Vec3(90, 90, height), Vec3(0, 90, height));
    items = {matt(floor, 0.5), matt(shade, 0.0)};
    items[1].two_sided = true;
    settings.width = settings.height = 64;
    settings.noise = 1.0;
    settings.most_samples = 64;
    view.camera = {.from = Vec3(0, 0, 5), .look_at = Vec3::Zero(), .up = Vec3::UnitY(), .field_of_view = 2.0 * std::atan(0.64 / 5.0)};
  }
};

TEST(PathTracer, TakesMoreSamplesWhereAShadowEnds) {
  HalfShaded studio(20.0);  // the camera is below the half-plane
  studio.lights.sun = {.to_light = Vec3f::UnitZ(), .irradiance = Vec3f::Constant(3.0F), .cosine = std::cos(0.0005F)};
  const Film film = studio.trace(studio.items);
  std::array<double, 64> light{}, taken_anew{};
  for (const auto& [x, y] : pixels_of(film)) {
    const double share = film.direct.radiance.at(x, y).y() * kPi / 1.5;
    if (film.samples.at(x, y) == 1.0F) {
      if (x < 30 || x > 33) { EXPECT_NEAR(share, x < 32 ? 1.0 : 0.0, 1e-3) << x; }
      continue;
    }
    EXPECT_EQ(film.samples.at(x, y), 16.0F);
    EXPECT_TRUE(x >= 30 && x <= 33) << x;
    light[static_cast<std::size_t>(x)] += share;
    taken_anew[static_cast<std::size_t>(x)] += 1.0;
  }
  // One sample tells on which side of the edge a pixel is: at least the two that differ.
  EXPECT_GE(std::accumulate(taken_anew.begin(), taken_anew.end(), 0.0), 128.0);
  // Of the penumbra, as wide as a pixel, half lies in either pixel beside its middle: an eighth of the light.
  for (const std::size_t x : {31, 32}) {
    const double most = 4.0 * std::sqrt(0.125 * 0.875 / 16.0 / taken_anew[x]);  // four standard errors of independent rays
    EXPECT_NEAR(light[x] / taken_anew[x], x == 31 ? 0.875 : 0.125, most);
  }
}

TEST(PathTracer, KnowsTheNoiseOfOneSampleByItsNeighbours) {
  HalfShaded studio(20.0);  // all of the picture lies in the middle of a penumbra that reaches 5 m to either side
  studio.lights.sun = {.to_light = Vec3f::UnitZ(), .irradiance = Vec3f::Constant(3.0F), .cosine = std::cos(0.25F)};
  studio.settings.most_samples = 2;
  // Half the sun is seen: a sample is L or 0, its variance L^2 / 4, and brightness is known by that sample alone.
  const double light = 1.5 / kPi;
  const double one = 0.5 * light * std::sqrt(0.5 / (0.1 * 0.1) + 0.5 / ((light + 0.1) * (light + 0.1)));
  const auto taken_anew = [&](double noise) {  // where a tile has been content with one sample: at a second, none can be
    studio.settings.noise = noise;
    return studio.trace(studio.items).detailed.size();
  };
  EXPECT_EQ(taken_anew(0.6 * one), 0u);
  EXPECT_GT(taken_anew(1.7 * one), 2048u);
}

TEST(PathTracer, TakesMorePathsInNarrowGaps) {
  // A trench, four pixels wide and ten deep, between black walls, seen from above.
  constexpr double kHalf = 0.04, kDepth = 0.2;
  const Mesh floor = plate(4.0, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  Mesh walls;
  for (const double x : {-kHalf, kHalf})
    add_quadrangle(walls, Vec3(x, -90, 0), Vec3(x, 90, 0), Vec3(x, 90, kDepth), Vec3(x, -90, kDepth));
  std::array items = {matt(floor, 0.5), matt(walls, 0.0)};
  items[1].two_sided = true;
  Studio studio;
  studio.settings.width = studio.settings.height = 64;
  studio.settings.noise = 1.0;
  studio.settings.most_samples = 64;
  studio.view.camera = {.from = Vec3(0, 0, 5), .look_at = Vec3::Zero(), .up = Vec3::UnitY(), .field_of_view = 2.0 * std::atan(0.64 / 5.0)};
  studio.lights.above = Vec3f::Ones();
  const Film film = studio.trace(items);
  double sum = 0.0, count = 0.0;
  for (const path::DetailedPixel& d : film.detailed) {
    const int x = d.x;
    EXPECT_LT(std::abs(x - 31.5), 16.0);
    if (d.detail != path::Detail::Gap) continue;
    EXPECT_EQ(film.samples.at(d.x, d.y), 16.0F);
    if (x != 31 && x != 32) continue;  // a wall stands on the outer two
    const double s = 0.02 * (x - 31.5), left = kHalf + s, right = kHalf - s;
    const double sky = 0.5 * (left / std::hypot(left, kDepth) + right / std::hypot(right, kDepth));
    const double error = film.radiance.at(d.x, d.y).y() / 0.5 - sky;
    sum += error * error - sky * (1.0 - sky) / 16.0;  // the variance of as many independent paths
    count += 1.0;
  }
  EXPECT_EQ(count, 128.0);
  EXPECT_LT(sum, 0.0);  // stratified ones do better
}

TEST(PathTracer, GivesTheSameBytesForAnyNumberOfThreadsAndAfterAnotherPicture) {
  const std::array meshes = {sphere(Vec3(-0.5, 0, 0.5), 0.5, 24), sphere(Vec3(0.45, 0, 0.45), 0.45, 24)};
  const std::array items = {Item{.mesh = &meshes[0], .colour = Vec3(0.9, 0.3, 0.1)},
                            Item{.mesh = &meshes[1], .colour = Vec3(0.1, 0.3, 0.9), .roughness = 0.2, .metallic = 1.0}};
  View view;
  view.area_lights = {{.at = Vec3(0, -1, 2)}};
  RenderSettings settings;
  settings.width = 93;
  settings.height = 64;
  settings.kind = RendererKind::Path;
  settings.most_samples = 16;
  for (const bool with_ground : {true, false}) {
    if (with_ground) view.ground = Ground{};
    else view.ground.reset();
    View other = view;
    other.camera.from = view.camera.look_at + 0.5 * (view.camera.from - view.camera.look_at);
    settings.threads = 1;
    const Image one = make_renderer(settings)->render(view, items);
    for (const int threads : {2, 3}) {
      settings.threads = threads;
      const std::unique_ptr<Renderer> renderer = make_renderer(settings);
      EXPECT_EQ(renderer->render(view, items).pixels, one.pixels) << threads;
      EXPECT_NE(renderer->render(other, items).pixels, one.pixels) << threads;
      EXPECT_EQ(renderer->render(view, items).pixels, one.pixels) << threads << ' ' << with_ground;
    }
  }
}

TEST(PathTracer, AgreesWithOpenGlOnABallInTheSun) {
  const Mesh ball = sphere(Vec3(0, 0, 0.5), 0.5, 48);
  const Item item{.mesh = &ball, .colour = Vec3(0.7, 0.3, 0.2), .roughness = 0.9};
  View view;
  view.camera = {.from = Vec3(0.5, -4, 1.6), .look_at = Vec3(0, 0, 0.4)};
  view.ground = Ground{};
  RenderSettings settings;
  settings.width = 96;
  settings.height = 72;
  const Image gl = make_renderer(settings)->render(view, std::span(&item, 1));
  settings.kind = RendererKind::Path;
  const Image path = make_renderer(settings)->render(view, std::span(&item, 1));
  double sum = 0.0;
  for (std::size_t i = 0; i < gl.pixels.size(); ++i) sum += std::abs(gl.pixels[i] - path.pixels[i]);
  // OpenGL knows light between surfaces only by rules of thumb: some 4 % of the range.
  EXPECT_LT(sum / static_cast<double>(gl.pixels.size()), 10.0);
}

TEST(PathTracer, BlursWhatMovesAndWhatIsOutOfFocus) {
  Mesh ball = sphere(Vec3::Zero(), 0.2, 16);
  for (const char* name : {"velocity_x", "velocity_y", "velocity_z"})
    ball.columns.push_back({name, std::vector<double>(ball.vertex_count(), name[9] == 'x' ? 10.0 : 0.0)});
  const Item item = matt(ball, 0.5);
  Studio studio;
  studio.settings.most_samples = 256;  // the outermost pixels show the ball a hundredth of the time
  const auto width_of = [&](const Film& film) {
    int width = 0;
    for (int x = 0; x < 32; ++x) width += film.cover.at(x, 16) > 0.0F ? 1 : 0;
    return width;
  };
  const Film still = studio.trace(std::span(&item, 1));
  studio.shutter = 0.04;
  const Film moving = studio.trace(std::span(&item, 1));
  // .4 m at 5 m with 32 pixels over 2 x 5 tan(.15) m: 8.5 pixels more, and the same light in all.
  EXPECT_NEAR(width_of(moving) - width_of(still), 8.5, 2.0);
  EXPECT_NEAR(total(moving, moving.cover), total(still, still.cover), 0.03 * total(still, still.cover));
  studio.shutter = 0.0;
  studio.view.camera.aperture = 0.2;
  EXPECT_LE(std::abs(width_of(studio.trace(std::span(&item, 1))) - width_of(still)), 2);  // in focus
  studio.view.camera.focus = 10.0;
  // A point at 5 m spreads over 2 x .2 (10 - 5)/10 = .2 m there: 4.2 pixels, of which the outermost are hardly met.
  const int wider = width_of(studio.trace(std::span(&item, 1))) - width_of(still);
  EXPECT_GE(wider, 2);
  EXPECT_LE(wider, 5);
}

// Eight rays scatter as one does: round-off of a few operations, where none cancels.
TEST(Bsdf, IsTheSameForEightRaysAsForOne) {
  path::BsdfOf<path::Lanes> eight;
  std::array<Bsdf, path::kLanes> one;
  path::Vec3Lanes out = path::Vec3Lanes::Zero(), other = path::Vec3Lanes::Zero();
  path::LaneBits pixel{};
  for (std::size_t k = 0; k < path::kLanes; ++k) {
    const auto t = static_cast<float>(k);
    one[k] = {.diffuse = Vec3f(0.1F * t, 0.3F, 0.7F), .normal_reflectance = Vec3f::Constant(0.05F * t), .grazing_reflectance = k % 3 == 0 ? 0.0F : 1.0F,
              .alpha = 0.1F + 0.1F * t};
    eight.diffuse.set_lane(k, one[k].diffuse);
    eight.normal_reflectance.set_lane(k, one[k].normal_reflectance);
    eight.grazing_reflectance[k] = one[k].grazing_reflectance;
    eight.alpha[k] = one[k].alpha;
    out.set_lane(k, k == 7 ? Vec3f(Vec3f::UnitZ()) : Vec3f(0.3F - 0.1F * t, 0.2F, k == 5 ? -0.4F : 0.9F).normalized());
    other.set_lane(k, Vec3f(0.5F, 0.1F * t - 0.3F, 0.6F).normalized());
    pixel[k] = 17 * static_cast<std::uint32_t>(k);
  }
  path::SamplerOf<path::Lanes> random(pixel, pixel + 3u, path::LaneBits{}, path::LaneBits{} + 4u, path::LaneBits{} + 1u);
  const path::Lanes which = random.number();
  const path::Vec3Lanes sampled = eight.sample(out, which, random.pair()), light = eight.evaluate(out, other);
  const path::Lanes density = eight.density(out, other);
  for (std::size_t k = 0; k < path::kLanes; ++k) {
    Sampler alone(pixel[k], pixel[k] + 3, 0, 4, 1);
    const float choice = alone.number();
    EXPECT_EQ(which[k], choice) << k;
    EXPECT_NEAR((sampled.lane(k) - one[k].sample(out.lane(k), choice, alone.pair())).norm(), 0.0, 1e-5) << k;
    const Vec3f expected = one[k].evaluate(out.lane(k), other.lane(k));
    EXPECT_NEAR((light.lane(k) - expected).norm(), 0.0, 1e-5 * (1.0 + expected.norm())) << k;
    const float expected_density = one[k].density(out.lane(k), other.lane(k));
    EXPECT_NEAR(density[k], expected_density, 1e-5 * (1.0 + expected_density)) << k;
    EXPECT_EQ(density[k] > 0.0F, k != 5) << k;
  }
}

TEST(PathTracer, PaintsLikeOpenGl) {
  Mesh sheet = plate(0.5, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ());
  sheet.columns.push_back({"value", {0.0, 1.0, 1.0, 0.0}});
  auto picture = std::make_shared<Image>(Image{.width = 2, .height = 2, .pixels = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}});
  for (Vec3& p : sheet.position) p.y() = 0.05;
  View view;
  view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.21};
  view.light.direction = Vec3(0, 1, -0.3);
  RenderSettings settings;
  settings.width = settings.height = 48;
  settings.denoise = false;
  settings.noise = 0.05;
  Item item{.mesh = &sheet, .colour = Vec3(0.9, 0.3, 0.2), .roughness = 1.0, .reflectance = 0.0};
  for (const PaintKind kind : {PaintKind::Plain, PaintKind::Checker, PaintKind::Stripes, PaintKind::Picture, PaintKind::Values, PaintKind::Normals}) {
    item.paint = {.kind = kind, .colour = Vec3(0.1, 0.2, 0.6), .size = kind == PaintKind::Picture ? 1.0 : 0.25, .picture = picture, .column = "value"};
    settings.kind = RendererKind::Gl;
    const Image gl = make_renderer(settings)->render(view, std::span(&item, 1));
    settings.kind = RendererKind::Path;
    const Image traced = make_renderer(settings)->render(view, std::span(&item, 1));
    double sum = 0.0;
    for (std::size_t i = 0; i < gl.pixels.size(); ++i) sum += std::abs(gl.pixels[i] - traced.pixels[i]);
    EXPECT_LT(sum / static_cast<double>(gl.pixels.size()), 9.0) << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace supple::render::test
