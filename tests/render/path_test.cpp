// The path tracer against closed forms: even light, the sky over a tilted plate, rectangles of light and their shadows.
#include <bit>
#include <cmath>
#include <numeric>
#include <set>

#include "path/denoise.h"
#include "path/integrator.h"
#include "shapes.h"
#include "supple/render/renderer.h"
#include "support.h"

namespace supple::render::test {
namespace {

using path::Bsdf;
using path::Film;
using path::Lights;
using path::Sampler;
using path::Vec3f;

constexpr float kPi = path::kPi;

/// A picture of items without a tone curve.
struct Studio {
  View view;
  path::TraceSettings settings;
  Lights lights;
  std::optional<path::GroundPlane> ground;
  path::Geometry geometry;
  double shutter = 0.0;

  Studio() {
    settings.width = settings.height = 32;
    settings.noise = 0.0;
    settings.most_samples = 16;
    view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.3};
  }
  Film trace(std::span<const Item> items, int threads = 1) {
    geometry.set(items, view.camera.look_at, shutter, 0.0F);
    settings.focus = view.camera.focus > 0.0 ? view.camera.focus : (view.camera.from - view.camera.look_at).norm();
    settings.aperture = view.camera.aperture;
    Film film;
    path::trace(geometry, lights, ground, camera_matrices(view.camera, 1.0 * settings.width / settings.height, {}), settings,
                Executor(threads), film);
    return film;
  }
};

Item matt(const Mesh& mesh, double albedo) {
  // sRGB of a linear grey.
  const double srgb = albedo <= 0.0031308 ? 12.92 * albedo : 1.055 * std::pow(albedo, 1.0 / 2.4) - 0.055;
  return {.mesh = &mesh, .colour = Vec3::Constant(srgb), .roughness = 1.0, .reflectance = 0.0};
}

Mesh plate(double half, const Vec3& at, const Vec3& u, const Vec3& v) {
  Mesh mesh;
  add_quadrangle(mesh, at - half * u - half * v, at + half * u - half * v, at + half * u + half * v, at - half * u + half * v);
  return mesh;
}

struct Pixel {
  int x, y;
};

std::vector<Pixel> pixels_of(const Film& film) {
  std::vector<Pixel> pixels;
  for (int y = 0; y < film.height; ++y)
    for (int x = 0; x < film.width; ++x) pixels.push_back({x, y});
  return pixels;
}

double mean_green(const Film& film) {
  double sum = 0.0;
  for (const auto& [x, y] : pixels_of(film)) sum += film.radiance.at(x, y).y();
  return sum / (film.width * film.height);
}

double total(const Film& film, const path::Plane& plane) {
  double sum = 0.0;
  for (const auto& [x, y] : pixels_of(film)) sum += plane.at(x, y);
  return sum;
}

double rms_difference(const Film& a, const Film& b) {
  double sum = 0.0, count = 0.0;
  for (const auto& [x, y] : pixels_of(a)) {
    if (!(a.cover.at(x, y) > 0.0F && b.cover.at(x, y) > 0.0F)) continue;
    sum += (a.cover.at(x, y) * a.radiance.at(x, y) - b.cover.at(x, y) * b.radiance.at(x, y)).squaredNorm() / 3.0;
    count += 1.0;
  }
  return std::sqrt(sum / count);
}

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

TEST(PathTracer, FollowsBundlesAsItFollowsRays) {
  const std::array meshes = {sphere(Vec3(-0.3, 0, 0), 0.4, 12), sphere(Vec3(0.3, 0.2, 0), 0.4, 12)};
  std::array items = {matt(meshes[0], 0.5), matt(meshes[1], 0.5)};
  items[0].opacity = 0.5;
  path::Geometry geometry;
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
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
  geometry.set(std::span(&item, 1), Vec3::Zero(), 0.0, 0.0F);
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
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
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
  geometry.set(std::span(&item, 1), Vec3::Zero(), 0.0, 0.0F);
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

TEST(PathTracer, KeepsItemsAndMovesVertices) {
  Mesh a = sphere(Vec3::Zero(), 0.5, 8), b = sphere(Vec3::UnitX(), 0.3, 8);
  const std::array items = {matt(a, 0.5), matt(b, 0.5)};
  path::Geometry geometry;
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().built, 2);
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().kept, 2);
  for (Vec3& p : b.position) p += Vec3(0.5, 0, 0);
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().kept, 1);
  EXPECT_EQ(geometry.counts().moved, 1);
  // The moved one is met where it is now.
  path::Hit hit;
  EXPECT_TRUE(geometry.meet(Vec3f(1.5F, -2, 0), Vec3f::UnitY(), 0.0F, 0.0F, false, hit));
  EXPECT_FALSE(geometry.meet(Vec3f(0.95F, -2, 0), Vec3f::UnitY(), 0.0F, 0.0F, false, hit));
  b = sphere(Vec3::UnitX(), 0.3, 9);
  geometry.set(items, Vec3::Zero(), 0.0, 0.0F);
  EXPECT_EQ(geometry.counts().built, 1);
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
