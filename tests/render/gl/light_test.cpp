// Light before exposure and tone curve, by both renderers: sun, sky and rectangles of known radiance on the ground, shadows of
// rectangles, patterns of the ground.
#include <cmath>

#include "path/bsdf.h"
#include "render/shapes.h"
#include "render/support.h"
#include "supple/render/renderer.h"

namespace supple::render::test {
namespace {

const std::array<double, 3> kSky = {0.93, 1.0, 1.10};
const std::array<double, 3> kSun = {1.0, 0.965, 0.91};  // of intensity 1

std::vector<RendererKind> renderers() {
  std::vector<RendererKind> kinds = {RendererKind::Gl};
  if (has_path_tracer()) kinds.push_back(RendererKind::Path);
  return kinds;
}

RenderSettings settings_for(RendererKind kind, int size = 16) {
  RenderSettings settings;
  settings.kind = kind;
  settings.width = settings.height = size;
  settings.noise = 0.0;
  settings.most_samples = 64;
  settings.denoise = false;
  return settings;
}

LinearImage light_of(Renderer& renderer, const View& view, std::span<const Item> items) {
  LinearImage light;
  static_cast<void>(renderer.render(view, items, &light));
  return light;
}

LinearImage light_of(const RenderSettings& settings, const View& view, std::span<const Item> items) {
  return light_of(*make_renderer(settings), view, items);
}

std::array<double, 4> mean(const LinearImage& image) {
  std::array<double, 4> sum{};
  for (std::size_t i = 0; i < image.rgba.size(); ++i) sum[i % 4] += image.rgba[i];
  for (double& v : sum) v /= static_cast<double>(image.width * image.height);
  return sum;
}

double srgb(double linear) { return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055; }

View from_above(double field_of_view) {
  View view;
  view.camera = {.from = Vec3(0.3, 0.1, 5), .look_at = Vec3(0.3, 0.1, 0), .up = Vec3::UnitY(), .field_of_view = field_of_view};
  view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.4))};
  return view;
}

TEST(SceneLinear, IsTheRadianceOfTheGroundUnderSunAndSky) {
  // A matt plane sends back albedo x (sun x cosine + sky), whatever the exposure.
  View view = from_above(0.01);
  for (const RendererKind kind : renderers()) {
    const std::unique_ptr<Renderer> renderer = make_renderer(settings_for(kind));
    for (const double intensity : {0.0, 3.0, 40.0}) {  // the last one is far beyond what the display shows
      view.light = {.direction = Vec3(0.6, 0.0, -0.8), .intensity = intensity};
      const std::array<double, 4> found = mean(light_of(*renderer, view, {}));
      for (std::size_t k = 0; k < 3; ++k) {
        const double expected = 0.4 * (0.8 * intensity * kSun[k] + kSky[k]);
        EXPECT_NEAR(found[k], expected, 5e-3 * expected) << static_cast<int>(kind) << ' ' << intensity;
      }
      EXPECT_EQ(found[3], 1.0);
    }
  }
}

TEST(SceneLinear, IsWhatTheMaterialSendsBackOfTheSun) {
  // The bidirectional reflectance has a closed form; the sky is the same with and without the sun.
  Mesh plate;
  add_quadrangle(plate, Vec3(-1, -1, 0), Vec3(1, -1, 0), Vec3(1, 1, 0), Vec3(-1, 1, 0));
  const Vec3 to_sun = Vec3(0.4, 0.3, 0.6).normalized();
  for (const RendererKind kind : renderers()) {
    RenderSettings settings = settings_for(kind, 8);
    settings.shadow_softness = 1e-3;
    const std::unique_ptr<Renderer> renderer = make_renderer(settings);
    for (const double reflectance : {0.0, 0.01, 0.04})
      for (const double elevation : {1.4, 0.8, 0.35}) {
        const Item item{.mesh = &plate, .colour = Vec3::Constant(srgb(0.5)), .roughness = 0.6, .reflectance = reflectance};
        View view;
        const Vec3 to_eye(0, -std::cos(elevation), std::sin(elevation));
        view.camera = {.from = 50.0 * to_eye, .look_at = Vec3::Zero(), .up = Vec3(0, 0.6, 0.8), .field_of_view = 2e-3};
        view.light = {.direction = -to_sun, .intensity = 2.0};
        const std::array<double, 4> lit = mean(light_of(*renderer, view, std::span(&item, 1)));
        view.light.intensity = 0.0;
        const std::array<double, 4> dark = mean(light_of(*renderer, view, std::span(&item, 1)));
        using path::Vec3f;
        path::Bsdf bsdf;
        bsdf.diffuse = Vec3f::Constant(0.5F);
        bsdf.normal_reflectance = Vec3f::Constant(static_cast<float>(reflectance));
        bsdf.grazing_reflectance = static_cast<float>(std::min(1.0, 50.0 * reflectance));
        bsdf.alpha = 0.36F;
        const Vec3f f = bsdf.evaluate(to_eye.cast<float>(), to_sun.cast<float>());
        for (std::size_t k = 0; k < 3; ++k) {
          const double expected = M_PI * static_cast<double>(f[0]) * 2.0 * kSun[k];
          // OpenGL widens the lobe by half the sun's tangent, and a pixel has normals of 16 bits.
          EXPECT_NEAR(lit[k] - dark[k], expected, 5e-3 * expected) << static_cast<int>(kind) << ' ' << reflectance << ' ' << elevation;
        }
      }
  }
}

TEST(SceneLinear, LeavesTheBackgroundOutAndKeepsCover) {
  // A white plate under an even sky covers half of the picture; its edge lies on a border of pixels.
  Mesh plate;
  add_quadrangle(plate, Vec3(0, -9, 0), Vec3(9, -9, 0), Vec3(9, 9, 0), Vec3(0, 9, 0));
  const Item item{.mesh = &plate, .colour = Vec3::Ones(), .roughness = 1.0, .reflectance = 0.0};
  View view;
  view.camera = {.from = Vec3(0, 0, 5), .look_at = Vec3::Zero(), .up = Vec3::UnitY(), .field_of_view = 0.4};
  view.light.intensity = 0.0;
  for (const RendererKind kind : renderers()) {
    const LinearImage light = light_of(settings_for(kind), view, std::span(&item, 1));
    for (std::size_t y = 0; y < 16; ++y)
      for (std::size_t x = 0; x < 16; ++x) {
        const float* pixel = &light.rgba[4 * (16 * y + x)];
        EXPECT_EQ(pixel[3], x < 8 ? 0.0F : 1.0F);
        for (std::size_t k = 0; k < 3; ++k) {
          // OpenGL adds a rim and the mirror of the studio, which even matt items have.
          EXPECT_NEAR(pixel[k], x < 8 ? 0.0 : kSky[k], x < 8 ? 0.0 : (kind == RendererKind::Path ? 1e-3 : 0.15)) << static_cast<int>(kind);
        }
      }
  }
}

TEST(SceneLinear, IsTheRadianceOfAnEmitterInThePicture) {
  if (!has_path_tracer()) {
    EXPECT_THROW((void)make_renderer(settings_for(RendererKind::Path)), Error);
    return;
  }
  View view;
  view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.1};
  view.area_lights = {{.at = Vec3::Zero(), .facing = Vec3(0, -1, 0), .half_sizes = {1, 1}, .colour = Vec3::Constant(srgb(0.5)), .radiance = 300.0}};
  const std::array<double, 4> found = mean(light_of(settings_for(RendererKind::Path), view, {}));
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(found[k], 150.0, 1e-3);
  EXPECT_EQ(found[3], 1.0);
}

/// Irradiance over pi at the origin facing up, of unit radiance from x0..x1, y0..y1 at height h (Howell's catalogue, C-2).
double rectangle_share(double x0, double x1, double y0, double y1, double h) {
  const auto corner = [h](double x, double y) {
    const double a = std::hypot(x, h), b = std::hypot(y, h);
    return (x / a * std::atan(y / a) + y / b * std::atan(x / b)) / (2.0 * M_PI);
  };
  return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0);
}

/// A ring of round section that lies on z = 0.
Mesh lying_ring(double radius, double thickness) {
  constexpr std::uint32_t kAround = 96, kAcross = 48;
  Mesh mesh;
  for (std::uint32_t i = 0; i < kAround; ++i)
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      const double a = 2.0 * M_PI * i / kAround, b = 2.0 * M_PI * j / kAcross;
      const Vec3 out(std::cos(a), std::sin(a), 0.0), n = std::cos(b) * out + std::sin(b) * Vec3::UnitZ();
      mesh.position.push_back(radius * out + thickness * (n + Vec3::UnitZ()));
      mesh.normal.push_back(n);
      const std::uint32_t here = i * kAcross + j, ahead = (i + 1) % kAround * kAcross + j;
      const std::uint32_t up = i * kAcross + (j + 1) % kAcross, both = (i + 1) % kAround * kAcross + (j + 1) % kAcross;
      mesh.triangle.push_back({here, ahead, both});
      mesh.triangle.push_back({here, both, up});
    }
  return mesh;
}

TEST(Ground, SeesTheSkyBetweenAWallAndWhatHangsOverhead) {
  // In the middle of a ring r / R = 1 / 3 all around hides elevations up to 2 atan(1/3), whose sine squared is .36, and a ball
  // of .3 in a height of 1.2 overhead hides (.3 / 1.2)^2; a matt plane sees the rest.
  const Mesh ring = lying_ring(0.6, 0.2), ball = sphere(Vec3(0, 0, 1.2), 0.3, 32);
  const std::array items = {Item{.mesh = &ring, .colour = Vec3::Zero(), .reflectance = 0.0},
                            Item{.mesh = &ball, .colour = Vec3::Zero(), .reflectance = 0.0}};
  View view;
  view.camera = {.from = Vec3(0, -3.5, 3.5), .look_at = Vec3::Zero(), .field_of_view = 0.01};
  view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.4))};
  view.light.intensity = 0.0;
  for (const RendererKind kind : renderers()) {
    RenderSettings settings = settings_for(kind);
    settings.most_samples = 256;
    const double visible = mean(light_of(settings, view, items))[1] / (0.4 * kSky[1]);
    // The tracer's error is that of 256 x 256 rays; OpenGL looks along 12 columns, of which those under the rim of the ball are
    // a tenth of the sine squared apart.
    EXPECT_NEAR(visible, 1.0 - 0.36 - 0.0625, kind == RendererKind::Path ? 0.01 : 0.1) << static_cast<int>(kind);
  }
}

/// A thin funnel, z = height + slope (r - inner).
Mesh funnel(double inner, double outer, double height, double slope) {
  constexpr std::uint32_t kAround = 96, kAlong = 24;
  Mesh mesh;
  for (std::uint32_t i = 0; i < kAround; ++i)
    for (std::uint32_t j = 0; j <= kAlong; ++j) {
      const double a = 2.0 * M_PI * i / kAround, r = inner + (outer - inner) * j / kAlong;
      const Vec3 out(std::cos(a), std::sin(a), 0.0);
      mesh.position.push_back(r * out + (height + slope * (r - inner)) * Vec3::UnitZ());
      mesh.normal.push_back((Vec3::UnitZ() - slope * out).normalized());
      if (j == kAlong) continue;
      const std::uint32_t here = i * (kAlong + 1) + j, ahead = (i + 1) % kAround * (kAlong + 1) + j;
      mesh.triangle.push_back({here, here + 1, ahead + 1});
      mesh.triangle.push_back({here, ahead + 1, ahead});
    }
  return mesh;
}

TEST(Ground, DoesNotSeeTheSkyThroughAThinSlope) {
  // From its middle the funnel hides elevations from 0.03 / 0.3 to 1.11 / 1.5; OpenGL meets it in a column up to a tenth later.
  const auto share = [](double r, double z) { return z * z / (z * z + r * r); };
  const Mesh mesh = funnel(0.3, 1.5, 0.03, 0.9);
  const Item item{.mesh = &mesh, .colour = Vec3::Zero(), .two_sided = true, .reflectance = 0.0};
  View view;
  view.camera = {.from = Vec3(0, -0.02, 5), .look_at = Vec3::Zero(), .field_of_view = 0.01};
  view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.4))};
  view.light.intensity = 0.0;
  for (const RendererKind kind : renderers()) {
    RenderSettings settings = settings_for(kind);
    settings.most_samples = 256;
    const double visible = mean(light_of(settings, view, std::span(&item, 1)))[1] / (0.4 * kSky[1]);
    EXPECT_NEAR(visible, 1.0 - share(1.5, 1.11) + share(0.3, 0.03), kind == RendererKind::Path ? 0.01 : 0.1) << static_cast<int>(kind);
  }
}

TEST(AreaLights, ShadeTheGroundThroughTheirPenumbraAsTheirVisiblePartDoes) {
  // A light of 1 x .6 at z = 2, and below it a half plane over x > 0: from the ground at x, the part of the light below
  // -x (2 - z) / z + ... is seen. At z = 1 the penumbra is as wide as the light, at z = .4 a quarter of it.
  for (const double z : {1.0, 0.4}) {
    Mesh shade;
    add_quadrangle(shade, Vec3(0, -3, z), Vec3(3, -3, z), Vec3(3, 3, z), Vec3(0, 3, z));
    const Item item{.mesh = &shade, .colour = Vec3::Zero(), .roughness = 1.0, .two_sided = true, .reflectance = 0.0};
    View view;
    view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.4))};
    view.light.intensity = 0.0;
    view.area_lights = {{.at = Vec3(0, 0, 2), .facing = Vec3(0, 0, -1), .half_sizes = {0.5, 0.3}}};
    for (const RendererKind kind : renderers()) {
      const std::unique_ptr<Renderer> renderer = make_renderer(settings_for(kind));
      const double width = z / (2.0 - z);
      for (const double s : {-1.0, -0.55, -0.4, -0.2, 0.0, 0.2, 0.4, 0.55, 1.0}) {
        const double x = s * width;
        view.camera = {.from = Vec3(x - 0.5, 0, 0.3), .look_at = Vec3(x, 0, 0), .up = Vec3::UnitZ(), .field_of_view = 0.004};
        std::array<std::array<double, 4>, 2> found;
        for (int on = 0; on < 2; ++on) {
          view.area_lights[0].radiance = on == 1 ? 3.0 : 0.0;
          found[static_cast<std::size_t>(on)] = mean(light_of(*renderer, view, std::span(&item, 1)));
        }
        // The line from x on the ground through the edge meets the light's plane at x - x 2 / z ... = -x (2 - z) / z.
        const double upper = std::clamp(-x * (2.0 - z) / z, -0.5, 0.5);
        const double expected = 0.4 * 3.0 * rectangle_share(-0.5 - x, upper - x, -0.3, 0.3, 2.0);
        const double whole = 0.4 * 3.0 * rectangle_share(-0.5 - x, 0.5 - x, -0.3, 0.3, 2.0);
        // OpenGL sees 32 stratified points of the light and counts all of its parts alike: a twentieth of its light.
        EXPECT_NEAR(found[1][1] - found[0][1], expected, (kind == RendererKind::Gl ? 0.05 : 0.02) * whole)
            << static_cast<int>(kind) << " z " << z << " s " << s;
      }
    }
  }
}

TEST(AreaLights, DoNotShadeTheBodyTheyFallOnFirst) {
  // No light shades the body that it falls on first.
  const Mesh ball = sphere(Vec3(0, 0, 0.5), 0.5, 32);
  const Item item{.mesh = &ball, .colour = Vec3::Constant(0.7), .roughness = 0.9};
  View view;
  view.camera = {.from = Vec3(0, 0, 6), .look_at = Vec3::Zero(), .up = Vec3::UnitY(), .field_of_view = 0.15};
  view.light.intensity = 0.0;
  view.area_lights = {{.at = Vec3(0, 0, 3), .facing = Vec3(0, 0, -1), .half_sizes = {0.5, 0.5}}};
  const std::unique_ptr<Renderer> renderer = make_renderer(settings_for(RendererKind::Gl, 64));
  const LinearImage with = light_of(*renderer, view, std::span(&item, 1));
  view.area_lights[0].radiance = 0.0;
  const LinearImage without = light_of(*renderer, view, std::span(&item, 1));
  for (std::size_t y = 0; y < 64; ++y)
    for (std::size_t x = 0; x < 64; ++x) {
      const double px = (static_cast<double>(x) - 31.5) / 32.0 * 6.0 * std::tan(0.075), py = (static_cast<double>(y) - 31.5) / 32.0 * 6.0 * std::tan(0.075);
      if (std::hypot(px, py) > 0.25) continue;
      const double r2 = px * px + py * py;
      const Vec3 n = Vec3(px, py, std::sqrt(0.25 - r2)).normalized();
      const Vec3 p = Vec3(0, 0, 0.5) + 0.5 * n;
      // Far away a light is a point: I cos cos / r^2, to the square of its size over its distance; the rest is gloss.
      const Vec3 to = Vec3(0, 0, 3) - p;
      const double albedo = std::pow((0.7 + 0.055) / 1.055, 2.4);
      const double expected = albedo * 5.0 / M_PI * n.dot(to.normalized()) * to.normalized().z() / to.squaredNorm();
      const double found = with.rgba[4 * (64 * y + x) + 1] - without.rgba[4 * (64 * y + x) + 1];
      EXPECT_NEAR(found, expected, 0.2 * expected) << x << ' ' << y;
    }
}

TEST(GroundPaint, LiesInWorldCoordinates) {
  for (const RendererKind kind : renderers()) {
    const std::unique_ptr<Renderer> renderer = make_renderer(settings_for(kind, 128));
    View view = from_above(0.4);
    view.light.intensity = 0.0;
    view.ground->paint = {.kind = PaintKind::Checker, .colour = Vec3::Constant(srgb(0.1)), .size = 0.25};
    const LinearImage checks = light_of(*renderer, view, {});
    view.ground->paint.kind = PaintKind::Stripes;
    view.ground->paint.axis = Vec3::UnitY();
    const LinearImage stripes = light_of(*renderer, view, {});
    auto picture = std::make_shared<Image>(Image{.width = 2, .height = 1, .pixels = {255, 0, 0, 0, 0, 255}});
    view.ground->paint = {.kind = PaintKind::Picture, .size = 1.0, .picture = picture};
    const LinearImage pictures = light_of(*renderer, view, {});
    const auto at = [&](const LinearImage& image, double x, double y, std::size_t k) {
      const double scale = 64.0 / (5.0 * std::tan(0.2));
      const auto column = static_cast<std::size_t>(64.0 + (x - 0.3) * scale), row = static_cast<std::size_t>(64.0 - (y - 0.1) * scale);
      return image.rgba[4 * (128 * row + column) + k] / kSky[k];
    };
    for (int i = -2; i <= 3; ++i)
      for (int j = -2; j <= 3; ++j) {
        const double x = 0.25 * i + 0.125, y = 0.25 * j + 0.125;
        EXPECT_NEAR(at(checks, x, y, 1), (i + j) % 2 == 0 ? 0.4 : 0.1, 0.004) << static_cast<int>(kind) << ' ' << i << ' ' << j;
        EXPECT_NEAR(at(stripes, x, y, 1), j % 2 == 0 ? 0.4 : 0.1, 0.004) << static_cast<int>(kind) << ' ' << j;
      }
    // The left texel is in the middle at x = 1/4 and 5/4, the right one at -1/4 and 3/4.
    for (const double x : {0.25, 1.25}) EXPECT_NEAR(at(pictures, x, 0.0, 0), 1.0, 0.1) << static_cast<int>(kind);
    for (const double x : {-0.25, 0.75}) EXPECT_NEAR(at(pictures, x, 0.0, 2), 1.0, 0.1) << static_cast<int>(kind);
  }
}

TEST(GroundPaint, IsGreyWhereItIsFinerThanAPixel) {
  View view = from_above(0.4);
  view.light.intensity = 0.0;
  view.ground->paint = {.kind = PaintKind::Checker, .colour = Vec3::Constant(srgb(0.1)), .size = 0.003};
  const LinearImage light = light_of(settings_for(RendererKind::Gl), view, {});
  for (std::size_t i = 0; i < 256; ++i) EXPECT_NEAR(light.rgba[4 * i + 1], 0.25, 0.01);
}

TEST(LightInside, BendsAroundTranslucentBodiesByBothRenderers) {
  // The sun from the left: the side away from it is dark on an opaque ball only, and the body as a whole sends back about the same.
  const Mesh ball = sphere(Vec3::Zero(), 1.0, 48);
  View view;
  view.camera = {.from = Vec3(0, -10, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.25};
  view.light = {.direction = Vec3::UnitX(), .intensity = 20.0};
  for (const RendererKind kind : renderers()) {
    Item item{.mesh = &ball, .colour = Vec3::Constant(srgb(0.8)), .roughness = 1.0, .reflectance = 0.0};
    const RenderSettings settings = settings_for(kind, 48);
    const LinearImage opaque = light_of(settings, view, std::span(&item, 1));
    item.inside = {.kind = InsideKind::Scatter, .depth = 0.3};
    const LinearImage soft = light_of(settings, view, std::span(&item, 1));
    const auto at = [](const LinearImage& image, int x) { return image.rgba[4 * static_cast<std::size_t>(24 * image.width + x) + 1]; };
    EXPECT_GT(at(soft, 28), 1.4F * at(opaque, 28)) << static_cast<int>(kind);  // beyond the terminator
    EXPECT_LT(at(soft, 10), at(opaque, 10)) << static_cast<int>(kind);
    EXPECT_NEAR(mean(soft)[1], mean(opaque)[1], 0.25 * mean(opaque)[1]) << static_cast<int>(kind);
  }
}

TEST(LightInside, TurnsThePictureInABallOfGlassByBothRenderers) {
  // Dark floor below, sky above: a ball of glass shows them upside down.
  const Mesh ball = sphere(Vec3(0, 0, 2), 1.0, 48);
  View view;
  view.camera = {.from = Vec3(0, -10, 2), .look_at = Vec3(0, 0, 2), .up = Vec3::UnitZ(), .field_of_view = 0.25};
  view.light = {.direction = Vec3(0, 0, -1), .intensity = 0.0};
  view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.05))};
  for (const RendererKind kind : renderers()) {
    const Item item{.mesh = &ball, .colour = Vec3::Ones(), .inside = {.kind = InsideKind::Glass, .index = 1.5}};
    const LinearImage image = light_of(settings_for(kind, 48), view, std::span(&item, 1));
    const auto at = [&](int y) { return image.rgba[4 * static_cast<std::size_t>(y * image.width + 24) + 1]; };
    EXPECT_NEAR(at(33), 1.0, 0.12) << static_cast<int>(kind);
    EXPECT_LT(at(15), 0.3) << static_cast<int>(kind);
  }
}

TEST(LightInside, ShadowsOfGlassAreWhatItLetsThroughByBothRenderers) {
  // Sun from above through a plate: two faces of index 1.5 and the colour over its thickness. Beside the plate the light is whole.
  const Mesh plate = block_of(Vec3(-1, -1, 2), Vec3(1, 1, 2.1));
  const std::array<double, 3> tint = {0.9, 0.5, 0.2};
  View view;
  view.camera = {.from = Vec3(0, -8, 1), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.02};
  view.light = {.direction = Vec3(0, 0, -1), .intensity = 40.0};
  view.ground = Ground{.height = 0.0, .colour = Vec3::Constant(srgb(0.4))};
  Item item{.mesh = &plate, .colour = Vec3(srgb(tint[0]), srgb(tint[1]), srgb(tint[2])),
            .inside = {.kind = InsideKind::Glass, .index = 1.5, .depth = 0.1}};
  for (const RendererKind kind : renderers()) {
    const std::array<double, 4> open = mean(light_of(settings_for(kind), view, {}));
    const std::array<double, 4> shaded = mean(light_of(settings_for(kind), view, std::span(&item, 1)));
    for (std::size_t k = 0; k < 3; ++k) {
      // The sky, a fortieth of the sun, is partly hidden by the plate.
      EXPECT_NEAR(shaded[k] / open[k], 0.96 * 0.96 * tint[k], 0.03) << static_cast<int>(kind) << ' ' << k;
    }
  }
}

TEST(Contact, HasALineWhereABodyTouchesAndNoneBetweenFixedItems) {
  const Mesh wall = block_of(Vec3(-1, 0, 0), Vec3(1, 1, 1)), step = block_of(Vec3(-1, -1, 0), Vec3(1, 0, 0.3));
  View view;
  view.camera = {.from = Vec3(0, -4, 3), .look_at = Vec3(0, 0, 0.3), .up = Vec3::UnitZ(), .field_of_view = 0.2};
  view.light = {.direction = Vec3(0, 1, -1), .intensity = 3.0};
  const auto darkest = [&](bool fixed) {
    const std::array items = {Item{.mesh = &wall, .fixed = true}, Item{.mesh = &step, .fixed = fixed}};
    const LinearImage image = light_of(settings_for(RendererKind::Gl, 48), view, items);
    float least = INFINITY;
    for (std::size_t i = 1; i < image.rgba.size(); i += 4) least = std::min(least, image.rgba[i]);
    return least;
  };
  EXPECT_LT(darkest(false), 0.7F * darkest(true));
}

}  // namespace
}  // namespace supple::render::test
