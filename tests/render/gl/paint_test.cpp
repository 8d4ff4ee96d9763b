// Where colours come from, and what is drawn over and beside surfaces.
#include <cmath>

#include "render/shapes.h"
#include "render/support.h"
#include "supple/render/glyphs.h"
#include "supple/render/overlay.h"
#include "supple/render/renderer.h"

namespace supple::render::test {
namespace {

/// Looking at the x-z plane from -y: one metre is 100 pixels, (0, 0) is the middle of 400 x 200.
View front_view() {
  View view;
  view.camera = {.from = Vec3(0, -10, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 2.0 * std::atan(0.1)};
  view.light.direction = Vec3(0, 1, 0);
  return view;
}

RenderSettings front_settings() {
  RenderSettings settings;
  settings.width = 400;
  settings.height = 200;
  settings.shadow_size = 0;
  return settings;
}

/// A square of 1.6 m facing the camera, its rest coordinates moved by `shift` against its position.
Mesh sheet(const Vec3& shift = Vec3::Zero()) {
  Mesh mesh;
  add_quadrangle(mesh, Vec3(-0.8, 0, -0.8), Vec3(0.8, 0, -0.8), Vec3(0.8, 0, 0.8), Vec3(-0.8, 0, 0.8));
  for (int k = 0; k < 3; ++k) {
    Mesh::Column column{.name = std::string("rest_") + "xyz"[k], .values = {}};
    for (const Vec3& p : mesh.position) column.values.push_back((p + shift)[k]);
    mesh.columns.push_back(column);
  }
  return mesh;
}

int red(const Image& image, double x, double z) {
  return pixel(image, static_cast<int>(200 + 100 * x), static_cast<int>(100 - 100 * z))[0];
}

TEST(Paint, ChecksAndStripesLieInObjectCoordinates) {
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  for (const double shift : {0.0, 0.25}) {
    const Mesh mesh = sheet(Vec3(shift, 0.1, 0));  // y = .1 lies inside a layer of cubes
    Item item{.mesh = &mesh, .colour = Vec3(0.9, 0.9, 0.9), .roughness = 1.0};
    item.paint = {.kind = PaintKind::Checker, .colour = Vec3(0.1, 0.1, 0.1), .size = 0.25};
    const Image checks = renderer->render(front_view(), std::span(&item, 1));
    item.paint.kind = PaintKind::Stripes;
    const Image stripes = renderer->render(front_view(), std::span(&item, 1));
    for (int i = -2; i <= 1; ++i)
      for (int k = -2; k <= 1; ++k) {
        const double x = 0.25 * i + 0.125, z = 0.25 * k + 0.125;
        const int turn = shift > 0.0 ? 1 : 0;
        EXPECT_EQ(red(checks, x, z) > 120, (i + k + turn) % 2 == 0) << i << ' ' << k;
        EXPECT_EQ(red(stripes, x, z) > 120, (i + turn) % 2 == 0) << i;
      }
  }
}

TEST(Paint, ChecksFinerThanAPixelAreGrey) {
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  const Mesh mesh = sheet(Vec3(0, 0.0005, 0));
  Item item{.mesh = &mesh, .colour = Vec3(1, 1, 1), .roughness = 1.0};
  item.paint = {.kind = PaintKind::Checker, .colour = Vec3(0, 0, 0), .size = 0.001};
  const Image image = renderer->render(front_view(), std::span(&item, 1));
  int least = 255, most = 0;
  for (double x = -0.7; x < 0.7; x += 0.013) {
    least = std::min(least, red(image, x, 0.3 * x));
    most = std::max(most, red(image, x, 0.3 * x));
  }
  EXPECT_LE(most - least, 12);
}

TEST(Paint, PicturesAreUprightAndAsWideAsTheySay) {
  auto picture = std::make_shared<Image>(Image{.width = 2, .height = 2, .pixels = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}});
  const Mesh mesh = sheet(Vec3(0.8, 0, 0.8));
  Item item{.mesh = &mesh, .roughness = 1.0};
  item.paint = {.kind = PaintKind::Picture, .size = 1.6, .picture = picture};
  const Image image = make_renderer(front_settings())->render(front_view(), std::span(&item, 1));
  const auto at = [&](double x, double z) { return pixel(image, static_cast<int>(200 + 100 * x), static_cast<int>(100 - 100 * z)); };
  EXPECT_GT(at(-0.4, 0.4)[0], 2 * at(-0.4, 0.4)[2]);   // red top left
  EXPECT_GT(at(0.4, 0.4)[1], 2 * at(0.4, 0.4)[0]);     // green top right
  EXPECT_GT(at(-0.4, -0.4)[2], 2 * at(-0.4, -0.4)[0]); // blue below
  EXPECT_NEAR(at(0.4, -0.4)[0], at(0.4, -0.4)[2], 40); // white
}

TEST(Paint, ValuesRunThroughTheMap) {
  Mesh mesh = sheet();
  mesh.columns.push_back({"pressure", {0.0, 10.0, 10.0, 0.0}});
  Item item{.mesh = &mesh, .roughness = 1.0};
  item.paint = {.kind = PaintKind::Values, .column = "pressure", .map = ColourMap::Coolwarm, .lower = 0.0, .upper = 10.0};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  const Image image = renderer->render(front_view(), std::span(&item, 1));
  // A plain sheet of the map's colour there looks the same to the rounding of 8 bits under the square root and the curve.
  for (const double x : {-0.6, -0.2, 0.2, 0.6}) {
    const Vec3 colour = colour_of(ColourMap::Coolwarm, (x + 0.005 + 0.8) / 1.6);
    const Item plain{.mesh = &mesh, .colour = colour, .roughness = 1.0};
    const Image same = renderer->render(front_view(), std::span(&plain, 1));
    for (std::size_t k = 0; k < 3; ++k) {
      const int px = static_cast<int>(200 + 100 * x);
      EXPECT_NEAR(pixel(image, px, 100)[k], pixel(same, px, 100)[k], 3) << x;
    }
  }
}

TEST(Paint, MetalsReflectTheirOwnColour) {
  const Mesh ball = sphere(Vec3::Zero(), 0.8, 32);
  Item item{.mesh = &ball, .colour = Vec3(0.9, 0.3, 0.1), .roughness = 0.3};
  View view = front_view();
  view.light = {.direction = Vec3(1, 0.2, -1), .intensity = 0.3};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  // Away from the outline, where everything is a mirror: the highlight of a dielectric adds white, that of a metal its hue.
  const auto whiteness = [&] {
    const Image image = renderer->render(view, std::span(&item, 1));
    double most = 0.0;
    for (int y = 40; y < 160; ++y)
      for (int x = 140; x < 260; ++x)
        if (std::hypot(x - 200, y - 100) < 60)
          most = std::max(most, pixel(image, x, y)[2] / (pixel(image, x, y)[0] + 1.0));
    return most;
  };
  const double plastic = whiteness();
  item.metallic = 1.0;
  EXPECT_GT(plastic, 1.5 * whiteness());
}

TEST(Paint, TheSunShowsInMetalsInItsReflectionOnly) {
  const Mesh ball = sphere(Vec3::Zero(), 0.8, 32);
  Item item{.mesh = &ball, .colour = Vec3(0.9, 0.3, 0.1), .roughness = 0.1};
  View view = front_view();
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  // Share of the face that faces the sun which is another with it than without.
  const auto changed = [&] {
    view.light.intensity = 0.0;
    const Image dark = renderer->render(view, std::span(&item, 1));
    view.light.intensity = 1.0;
    const Image lit = renderer->render(view, std::span(&item, 1));
    int pixels = 0, count = 0;
    for (double x = -0.5; x <= 0.5; x += 0.05)
      for (double z = -0.5; z <= 0.5; z += 0.05, ++count) pixels += red(lit, x, z) > red(dark, x, z) + 4 ? 1 : 0;
    return static_cast<double>(pixels) / count;
  };
  EXPECT_GT(changed(), 0.95);
  item.metallic = 1.0;
  EXPECT_LT(changed(), 0.25);
}

TEST(Paint, HalfOpaqueItemsShowHalfOfWhatIsBehind) {
  const Mesh front = sheet();
  Mesh back;
  add_quadrangle(back, Vec3(-0.8, 1, -0.8), Vec3(0.8, 1, -0.8), Vec3(0.8, 1, 0.8), Vec3(-0.8, 1, 0.8));
  std::array items = {Item{.mesh = &front, .colour = Vec3(0.9, 0.1, 0.1)}, Item{.mesh = &back, .colour = Vec3(0.1, 0.1, 0.9)}};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  const View view = front_view();
  const Image opaque = renderer->render(view, items);
  const Image behind = renderer->render(view, std::span(items).subspan(1));
  items[0].opacity = 0.5;
  const Image mixed = renderer->render(view, items);
  const auto linear = [](int v) { return std::pow((v / 255.0 + 0.055) / 1.055, 2.4); };
  for (std::size_t k = 0; k < 3; k += 2) {
    const double expected = 0.5 * (linear(pixel(opaque, 200, 100)[k]) + linear(pixel(behind, 200, 100)[k]));
    // Occlusion and the dark line between items depend on who is in front.
    EXPECT_NEAR(linear(pixel(mixed, 200, 100)[k]), expected, 0.15 * expected + 0.02);
  }
}

TEST(Paint, WiresLieOnTheSurfaceOrStandAlone) {
  const Mesh mesh = sheet();
  Item item{.mesh = &mesh, .colour = Vec3(0.9, 0.9, 0.9)};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  const Image plain = renderer->render(front_view(), std::span(&item, 1));
  item.wireframe = true;
  const Image wired = renderer->render(front_view(), std::span(&item, 1));
  item.surface = false;
  const Image alone = renderer->render(front_view(), std::span(&item, 1));
  const Image background = renderer->render(front_view(), {});
  // The diagonal runs through the middle; (.4, -.1) is on no edge.
  EXPECT_LT(brightness(wired, 199, 100), brightness(plain, 199, 100) - 100);
  EXPECT_NEAR(brightness(wired, 240, 110), brightness(plain, 240, 110), 3.0);  // what is painted keeps its root in 8 bits
  EXPECT_EQ(brightness(alone, 240, 110), brightness(background, 240, 110));
  EXPECT_NE(brightness(alone, 199, 100), brightness(background, 199, 100));
}

TEST(Paint, AreaLightsBrightenWhatTheyFace) {
  const Mesh mesh = sheet();
  const Item item{.mesh = &mesh, .colour = Vec3(0.5, 0.5, 0.5), .roughness = 1.0};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  View view = front_view();
  view.light.intensity = 0.0;
  const Image dark = renderer->render(view, std::span(&item, 1));
  view.area_lights = {{.at = Vec3(-0.8, -1, 0), .facing = Vec3(0, 1, 0), .half_sizes = {0.2, 0.2}, .radiance = 10.0}};
  const Image lit = renderer->render(view, std::span(&item, 1));
  view.area_lights[0].facing = Vec3(0, -1, 0);
  const Image away = renderer->render(view, std::span(&item, 1));
  EXPECT_GT(red(lit, -0.7, 0), red(lit, 0.7, 0) + 20);
  EXPECT_GT(red(lit, 0.7, 0), red(dark, 0.7, 0));
  EXPECT_EQ(away.pixels, dark.pixels);
}

TEST(Paint, AreaLightsThrowShadowsOfItemsOnItems) {
  const Mesh mesh = sheet();
  Mesh screen;  // its umbra on the sheet reaches .19 m to either side of x = 0
  add_quadrangle(screen, Vec3(-0.52, -0.5, -0.12), Vec3(-0.28, -0.5, -0.12), Vec3(-0.28, -0.5, 0.12), Vec3(-0.52, -0.5, 0.12));
  const std::array items = {Item{.mesh = &mesh, .colour = Vec3(0.5, 0.5, 0.5), .roughness = 1.0},
                            Item{.mesh = &screen, .roughness = 1.0, .two_sided = true}};
  const std::unique_ptr<Renderer> renderer = make_renderer(front_settings());
  View view = front_view();
  view.light.intensity = 0.0;
  const Image dark = renderer->render(view, items);
  view.area_lights = {{.at = Vec3(-0.8, -1, 0), .facing = Vec3(0.8, 1, 0), .half_sizes = {0.05, 0.05}, .radiance = 300.0}};
  const Image open = renderer->render(view, std::span(items).first(1));
  const Image shaded = renderer->render(view, items);
  for (const double x : {-0.1, 0.0, 0.1}) {
    EXPECT_GT(red(open, x, 0), red(dark, x, 0) + 20) << x;
    EXPECT_NEAR(red(shaded, x, 0), red(dark, x, 0), 1) << x;
    EXPECT_NEAR(red(shaded, x, 0.6), red(open, x, 0.6), 1) << x;
  }
}

TEST(ColourMaps, EndWhereTheirTablesEnd) {
  EXPECT_TRUE(colour_of(ColourMap::Viridis, 0.0).isApprox(Vec3(68, 1, 84) / 255.0));
  EXPECT_TRUE(colour_of(ColourMap::Viridis, 7.0).isApprox(Vec3(253, 231, 37) / 255.0));
  EXPECT_TRUE(colour_of(ColourMap::Grey, std::nan("")).isZero());
  EXPECT_NEAR(colour_of(ColourMap::Grey, 0.37).x(), 0.37, 0.003);
}

TEST(ScaleBars, HaveRoundTicksInRange) {
  EXPECT_EQ(ticks(0.0, 1.0, 6), (std::vector<double>{0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0}));
  EXPECT_EQ(ticks(-3.0, 9.0, 6), (std::vector<double>{-2.0, 0.0, 2.0, 4.0, 6.0, 8.0}));
  for (const double scale : {1e-6, 0.37, 1.0, 5e4})
    for (const double lower : {-1.0, 0.0, 0.21}) {
      const std::vector<double> marks = ticks(lower * scale, (lower + 0.83) * scale, 6);
      EXPECT_GE(marks.size(), 2u);
      EXPECT_LE(marks.size(), 6u);
      EXPECT_GE(marks.front(), lower * scale - 1e-6 * scale);
      EXPECT_LE(marks.back(), (lower + 0.83) * scale + 1e-6 * scale);
    }
}

TEST(ScaleBars, ShowTheMapFromBottomToTopAtTheRight) {
  Image image{.width = 320, .height = 240, .pixels = std::vector<std::uint8_t>(3 * 320 * 240, 40)};
  const ScaleBar bar{.map = ColourMap::Grey, .lower = 0.0, .upper = 5.0, .title = "speed [m/s]"};
  draw_scale_bars(image, std::span(&bar, 1));
  EXPECT_EQ(brightness(image, 100, 120), 120);  // the left is as it was
  // The one column that runs through the whole bar darkens steadily downward.
  int column = -1;
  for (int x = 200; x < 320 && column < 0; ++x) {
    bool steady = true;
    for (int y = 91; y < 170; ++y) steady = steady && brightness(image, x, y) < brightness(image, x, y - 1);
    if (steady) column = x;
  }
  EXPECT_GT(column, 0);
}

TEST(Text, IsAsWideAsItSaysAndDark) {
  Image image{.width = 200, .height = 40, .pixels = std::vector<std::uint8_t>(3 * 200 * 40, 255)};
  draw_text(image, 10, 30, 18, "0.25");
  int first = 200, last = 0;
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 200; ++x)
      if (brightness(image, x, y) < 400) {
        first = std::min(first, x);
        last = std::max(last, x);
      }
  EXPECT_NEAR(first, 10, 1.5);
  EXPECT_NEAR(last + 1 - 10, text_width("0.25", 18), 2.0);
}

TEST(Glyphs, AreClosedAndPointAlongTheirAxes) {
  const Pose pose{.position = Vec3(1, 2, 3), .orientation = Quat(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitZ()))};
  const std::array<Mesh, 3> axes = frame_glyphs(std::span(&pose, 1), 0.5);
  EXPECT_NEAR((axes[0].position.back() - Vec3(1, 2.5, 3)).norm(), 0.0, 1e-12);  // the tip of x points along world y
  EXPECT_NEAR((axes[2].position.back() - Vec3(1, 2, 3.5)).norm(), 0.0, 1e-12);
  Mesh ball, rod;
  add_ball(ball, Vec3(1, 0, 0), 0.5);
  const MeshReport report = inspect(ball);
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_NEAR(report.volume, 4.0 / 3.0 * M_PI * 0.125, 0.15 * report.volume);  // 80 flat faces
  add_rod(rod, Vec3::Zero(), Vec3(0, 0, 2), 0.1);
  // Twelve sides: area 12/2 sin(30 deg) r^2 = 3 r^2. The bands share no vertices, so volume comes by the divergence theorem.
  EXPECT_NEAR(inspect(rod).volume, 0.06, 1e-12);
}

}  // namespace
}  // namespace supple::render::test
