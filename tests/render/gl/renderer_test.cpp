#include "supple/render/renderer.h"

#include <cmath>
#include <cstdlib>

#include "gl/gl_context.h"
#include "render/shapes.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

RenderSettings small(int width = 320, int height = 180) {
  RenderSettings settings;
  settings.width = width;
  settings.height = height;
  settings.shadow_size = 1024;
  return settings;
}

/// Two balls and a rounded box that touch, above a ground.
struct Scene {
  std::vector<Mesh> meshes = {sphere(Vec3(-0.5, 0, 0.5), 0.5, 24), sphere(Vec3(0.45, 0, 0.45), 0.45, 24),
                              rounded_box(Vec3(0.3, 0.2, 0.1), 0.1, 12,
                                          {.position = Vec3(0, 1, 0.3), .orientation = Quat::Identity()})};
  std::vector<Item> items = {{.mesh = &meshes[0], .colour = Vec3(0.9, 0.3, 0.1)},
                             {.mesh = &meshes[1], .colour = Vec3(0.1, 0.3, 0.9)},
                             {.mesh = &meshes[2], .colour = Vec3(0.3, 0.8, 0.3)}};
  View view;
  Scene() { view.ground = Ground{}; }
};

TEST(Renderer, CoversTheAreaOfASpheresPerspectiveOutline) {
  const Mesh ball = sphere(Vec3::Zero(), 1.0, 64);
  const Item item{.mesh = &ball, .colour = Vec3::Zero(), .roughness = 1.0};
  View view;
  view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.7};
  view.background_top = view.background_bottom = Vec3::Ones();
  view.light.intensity = 0.0;
  RenderSettings settings = small(640, 480);
  settings.samples = 1;
  const std::unique_ptr<Renderer> renderer = make_renderer(settings);
  const Image image = renderer->render(view, std::span(&item, 1));
  const Image empty = renderer->render(view, {});
  double pixels = 0.0;
  for (std::size_t i = 0; i < image.pixels.size(); i += 3) pixels += image.pixels[i] != empty.pixels[i] ? 1.0 : 0.0;
  // A sphere on the axis projects to a disc of radius tan(asin(r / d)). With one sample, a pixel is covered when its
  // centre is; the count of centres in a disc of radius R differs from its area by about R^(2/3), 30 of 60,000.
  const double radius = std::tan(std::asin(1.0 / 5.0)) / std::tan(0.35) * 240.0;
  const double exact = M_PI * radius * radius;
  EXPECT_NEAR(pixels, exact, 0.005 * exact);
}

TEST(Renderer, ShowsItemsInTheirColoursNearestFirst) {
  const Mesh near_ball = sphere(Vec3(0, -1, 0.5), 0.3, 16);
  const Mesh far_ball = sphere(Vec3(0, 1.5, 0.5), 0.9, 16);
  const std::array items = {Item{.mesh = &near_ball, .colour = Vec3(0.9, 0.1, 0.1)},
                            Item{.mesh = &far_ball, .colour = Vec3(0.1, 0.1, 0.9)}};
  View view;
  view.camera = {.from = Vec3(0, -5, 0.5), .look_at = Vec3(0, 0, 0.5)};
  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  for (const bool swapped : {false, true}) {
    const std::array order = {items[swapped ? 1 : 0], items[swapped ? 0 : 1]};
    const Image image = renderer->render(view, order);
    const std::array<int, 3> middle = pixel(image, 160, 90);
    EXPECT_GT(middle[0], 2 * middle[2]);
    const std::array<int, 3> above = pixel(image, 160, 56);
    EXPECT_GT(above[2], above[0]);
  }
}

// Seen from above with y up, light that travels along +x throws the shadow of a ball at height h by h tan(angle).
TEST(Renderer, ThrowsAShadowOnTheGroundOnTheFarSideOfTheLight) {
  const Mesh ball = sphere(Vec3(0, 0, 1.0), 0.25, 24);
  const Item item{.mesh = &ball, .colour = Vec3(0.8, 0.2, 0.2)};
  View view;
  view.ground = Ground{};
  view.camera = {.from = Vec3(0, 0, 8), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.6};
  view.light.direction = Vec3(1, 0, -1);
  RenderSettings settings = small(400, 400);
  const Image lit = make_renderer(settings)->render(view, std::span(&item, 1));
  settings.shadow_size = 0;
  const Image unshaded = make_renderer(settings)->render(view, std::span(&item, 1));
  const double scale = 200.0 / (8.0 * std::tan(0.3));  // pixels a metre of ground
  const int far_side = static_cast<int>(200.0 + scale * 1.0);
  const int near_side = static_cast<int>(200.0 - scale * 1.0);
  EXPECT_LT(brightness(lit, far_side, 200), 0.8 * brightness(lit, near_side, 200));
  EXPECT_NEAR(brightness(unshaded, far_side, 200), brightness(unshaded, near_side, 200), 9);

  // Centre of what is darker by the shadow alone: over the ball's shadow, at (1, 0) on the ground. Where the ball
  // itself is seen, nothing differs except its own dark side, which is left out.
  double sum = 0.0;
  double sum_x = 0.0;
  double sum_y = 0.0;
  for (int y = 0; y < 400; ++y)
    for (int x = 200 + static_cast<int>(0.4 * scale); x < 400; ++x) {
      const double dark = brightness(unshaded, x, y) - brightness(lit, x, y);
      sum += dark;
      sum_x += dark * (x + 0.5 - 200.0) / scale;
      sum_y += dark * (200.0 - y - 0.5) / scale;
    }
  ASSERT_GT(sum, 0.0);
  // 2 % of the distance: the ground's brightness varies by occlusion and fade under the shadow.
  EXPECT_NEAR(sum_x / sum, 1.0, 0.02);
  EXPECT_NEAR(sum_y / sum, 0.0, 0.02);
}

TEST(Renderer, HasNoShadowAcneOnALitBall) {
  const Mesh ball = sphere(Vec3(0, 0, 1.0), 0.8, 48);
  const Item item{.mesh = &ball, .colour = Vec3(0.7, 0.7, 0.7)};
  View view;
  view.camera = {.from = Vec3(0, -5, 1.0), .look_at = Vec3(0, 0, 1.0)};
  view.light.direction = Vec3(-0.7, 1.0, -0.4);
  RenderSettings settings = small();
  const Image shaded = make_renderer(settings)->render(view, std::span(&item, 1));
  settings.shadow_size = 0;
  const Image plain = make_renderer(settings)->render(view, std::span(&item, 1));
  // A convex body shades only what its own n . l already leaves dark; the terminator band may lose a little.
  int differing = 0;
  for (std::size_t i = 0; i < plain.pixels.size(); ++i) differing += plain.pixels[i] - shaded.pixels[i] > 3 ? 1 : 0;
  EXPECT_EQ(differing, 0);
}

TEST(Renderer, DarkensTheGroundUnderABall) {
  const Mesh ball = sphere(Vec3(0, 0, 0.5), 0.5, 24);
  const Item item{.mesh = &ball};
  View view;
  view.ground = Ground{};
  view.camera = {.from = Vec3(0, -6, 1.2), .look_at = Vec3(0, 0, 0.3)};
  view.light.intensity = 0.0;  // the sky alone
  const Image image = make_renderer(small())->render(view, std::span(&item, 1));
  const Image empty = make_renderer(small())->render(view, {});
  // The ground point at y = -.2, well under the ball: of its sky the ball hides more than a third.
  const double scale = 90.0 / std::tan(0.305);
  const Vec3 back = (view.camera.from - view.camera.look_at).normalized();
  const Vec3 up = back.cross(Vec3::UnitX());
  const Vec3 p = Vec3(0, -0.2, 0) - view.camera.from;
  const int row = static_cast<int>(90.0 - scale * p.dot(up) / -p.dot(back));
  EXPECT_LT(brightness(image, 160, row), 0.8 * brightness(empty, 160, row));
}

TEST(Renderer, DrawsADarkLineWhereTwoItemsTouch) {
  // The same two balls, once as two items and once as one: the line is all that differs.
  Mesh left = sphere(Vec3(-0.5, 0, 0), 0.5, 32);
  const Mesh right = sphere(Vec3(0.5, 0, 0), 0.5, 32);
  View view;
  view.camera = {.from = Vec3(0, -3, 0), .look_at = Vec3::Zero()};
  const std::array two = {Item{.mesh = &left}, Item{.mesh = &right}};
  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  const Image touching = renderer->render(view, two);
  const auto base = static_cast<std::uint32_t>(left.vertex_count());
  Mesh joined = left;
  joined.position.insert(joined.position.end(), right.position.begin(), right.position.end());
  joined.normal.insert(joined.normal.end(), right.normal.begin(), right.normal.end());
  for (const auto& t : right.triangle) joined.triangle.push_back({t[0] + base, t[1] + base, t[2] + base});
  const Item one{.mesh = &joined};
  const Image plain = renderer->render(view, std::span(&one, 1));
  EXPECT_LT(brightness(touching, 159, 90) + brightness(touching, 160, 90),
            brightness(plain, 159, 90) + brightness(plain, 160, 90));
  EXPECT_EQ(brightness(touching, 100, 90), brightness(plain, 100, 90));
}

TEST(Renderer, GivesTheSameBytesTwiceAndAfterAnotherScene) {
  const Scene scene;
  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  const Image first = renderer->render(scene.view, scene.items);
  EXPECT_EQ(renderer->render(scene.view, scene.items).pixels, first.pixels);
  View other = scene.view;
  other.ground.reset();
  other.light.intensity = 0.0;
  other.camera.from = Vec3(1, 3, 0.5);
  EXPECT_NE(renderer->render(other, std::span(scene.items).first(1)).pixels, first.pixels);
  static_cast<void>(renderer->render(other, {}));
  EXPECT_EQ(renderer->render(scene.view, scene.items).pixels, first.pixels);
}

TEST(Renderer, GivesTheSamePictureByOsMesaAndByEgl) {
  const Scene scene;
  RenderSettings settings = small();
  const std::unique_ptr<Renderer> osmesa = make_renderer(settings);
  settings.context = ContextKind::Egl;
  const std::unique_ptr<Renderer> egl = make_renderer(settings);
  const Image a = osmesa->render(scene.view, scene.items);
  const Image b = egl->render(scene.view, scene.items);
  const Image c = osmesa->render(scene.view, scene.items);
  EXPECT_EQ(a.pixels, c.pixels);
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  int largest = 0;
  double squares = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const int difference = std::abs(a.pixels[i] - b.pixels[i]);
    largest = std::max(largest, difference);
    squares += difference * difference;
  }
  // Another rasteriser than the software one may round edges differently.
  const bool same_rasteriser = egl->description().find("llvmpipe") != std::string::npos;
  EXPECT_LE(largest, same_rasteriser ? 1 : 255) << egl->description();
  // 35 dB of 255.
  EXPECT_LE(squares / static_cast<double>(a.pixels.size()), 255.0 * 255.0 / std::pow(10.0, 3.5)) << egl->description();
}

TEST(Renderer, DrawsTheBackgroundOfAnEmptyScene) {
  View view;
  view.background_top = Vec3(0.2, 0.4, 0.6);
  view.background_bottom = Vec3(0.8, 0.6, 0.4);
  const Mesh nothing;
  const Item item{.mesh = &nothing};
  const Image image = make_renderer(small())->render(view, std::span(&item, 1));
  // Untouched by the tone curve: 255 times the sRGB value, to rounding.
  const std::array<double, 3> top = {51, 102, 153};
  const std::array<double, 3> bottom = {204, 153, 102};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(pixel(image, 10, 0)[k], top[k], 1.0);
    EXPECT_NEAR(pixel(image, 10, 179)[k], bottom[k], 1.0);
  }
}

TEST(Renderer, FadesTheGroundIntoTheBackgroundWithoutAnEdge) {
  View view;
  view.ground = Ground{.height = 0.0, .colour = Vec3(0.5, 0.1, 0.1)};
  view.camera = {.from = Vec3(0, -4, 0.6), .look_at = Vec3(0, 0, 0.6)};
  const Image image = make_renderer(small(64, 400))->render(view, {});
  for (int y = 1; y < 400; ++y)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LE(std::abs(pixel(image, 32, y)[k] - pixel(image, 32, y - 1)[k]), 6) << "row " << y;
  EXPECT_LT(pixel(image, 32, 395)[1], 160);
}

TEST(Renderer, LooksStraightDown) {
  const Scene scene;
  View view = scene.view;
  view.camera = {.from = Vec3(0, 0, 6), .look_at = Vec3::Zero()};
  const Image image = make_renderer(small())->render(view, scene.items);
  // x is right and y is up in the picture: red at x < 0, blue at x > 0.
  const std::array<int, 3> left = pixel(image, 140, 90);
  const std::array<int, 3> right = pixel(image, 178, 90);
  EXPECT_GT(left[0], left[2]);
  EXPECT_GT(right[2], right[0]);
}

TEST(Renderer, DrawsBackFacesOfTwoSidedItemsOnly) {
  Mesh sheet;
  sheet.position = {Vec3(-1, 0, -1), Vec3(1, 0, -1), Vec3(0, 0, 1)};
  sheet.normal.assign(3, Vec3(0, 1, 0));
  sheet.triangle = {{0, 2, 1}};  // faces +y; the camera is at -y
  Item item{.mesh = &sheet, .colour = Vec3(0.1, 0.7, 0.1)};
  View view;
  view.camera = {.from = Vec3(0, -5, 0)};
  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  const Image background = renderer->render(view, {});
  EXPECT_EQ(renderer->render(view, std::span(&item, 1)).pixels, background.pixels);
  item.two_sided = true;
  const Image image = renderer->render(view, std::span(&item, 1));
  EXPECT_NE(pixel(image, 160, 90), pixel(background, 160, 90));
}

TEST(Renderer, TakesEverySampleCount) {
  const Scene scene;
  RenderSettings settings = small();
  for (const int samples : {1, 2, 4, 8}) {
    settings.samples = samples;
    const Image image = make_renderer(settings)->render(scene.view, scene.items);
    const std::array<int, 3> red = pixel(image, 140, 80);
    EXPECT_GT(red[0], red[2]) << samples;
  }
}

TEST(Renderer, RefusesSettingsAndCamerasThatCannotBe) {
  RenderSettings settings = small();
  const auto make = [&settings] { static_cast<void>(make_renderer(settings)); };
  settings.width = 0;
  expect_error(ErrorKind::Usage, {"render.width: expected 1 to 16384 pixels, found 0"}, make);
  settings = small(320, 16385);
  expect_error(ErrorKind::Usage, {"render.height: expected 1 to 16384 pixels, found 16385"}, make);
  settings = small();
  settings.samples = 3;
  expect_error(ErrorKind::Usage, {"render.samples: expected 1, 2, 4 or 8, found 3"}, make);
  settings = small();
  settings.shadow_size = -1;
  expect_error(ErrorKind::Usage, {"render.shadow_size"}, make);
  settings = small();
  settings.shadow_softness = std::nan("");
  expect_error(ErrorKind::Usage, {"render.shadow_softness"}, make);

  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  View view;
  view.camera.from = view.camera.look_at;
  expect_error(ErrorKind::Usage, {"camera.from"}, [&] { static_cast<void>(renderer->render(view, {})); });
  view = View();
  view.camera.field_of_view = 4.0;
  expect_error(ErrorKind::Usage, {"camera.field_of_view"}, [&] { static_cast<void>(renderer->render(view, {})); });
}

TEST(Renderer, NamesALibraryThatIsNotThereAndItsPackage) {
  expect_error(ErrorKind::Io, {"libabsent.so.8", "cannot be loaded", "apt-get install libabsent8"},
               [] { const Library library("libabsent.so.8", "libabsent8"); });
}

TEST(Renderer, NamesThePathTracersComponentWhereItIsAbsent) {
  RenderSettings settings = small();
  settings.kind = RendererKind::Path;
  if (has_path_tracer()) {
    EXPECT_NE(make_renderer(settings)->description().find("Embree"), std::string::npos);
    settings.most_samples = 3;
    expect_error(ErrorKind::Usage, {"render.most_samples", "found 3"}, [&] { static_cast<void>(make_renderer(settings)); });
  } else {
    expect_error(ErrorKind::Usage, {"Embree 3", "libembree-dev"}, [&] { static_cast<void>(make_renderer(settings)); });
  }
}

TEST(Renderer, TimesItsWorkByParts) {
  const Scene scene;
  const std::unique_ptr<Renderer> renderer = make_renderer(small());
  const RenderTimes made = renderer->times();
  EXPECT_GT(made.context, 0.0);
  EXPECT_GT(made.shaders, 0.0);
  static_cast<void>(renderer->render(scene.view, scene.items));
  const RenderTimes drawn = renderer->times();
  EXPECT_GT(drawn.upload, made.upload);
  EXPECT_GT(drawn.draw, made.draw);
  EXPECT_GT(drawn.read_back, made.read_back);
  EXPECT_EQ(drawn.context, made.context);
}

TEST(Renderer, DescribesItsDriver) {
  const std::string text = make_renderer(small())->description();
  EXPECT_EQ(text.rfind("OSMesa, ", 0), 0U) << text;
  EXPECT_NE(text.find(", OpenGL 4.5"), std::string::npos) << text;
}

}  // namespace
}  // namespace supple::render::test
