// A picture knows no length and no place of its own: the same scene in other units, or elsewhere, looks the same.
#include <gtest/gtest.h>

#include <cmath>

#include "render/shapes.h"
#include "supple/render/image.h"
#include "supple/render/layers.h"
#include "supple/render/renderer.h"

namespace supple::render {
namespace {

using test::sphere;

/// Balls that touch, one of them glossy and one striped, a chequered pillar and a board overhead on a chequered ground, in the light of
/// sun and lamp; `size` times as large, and moved by `at`.
struct Scenery {
  std::array<Mesh, 4> meshes;
  std::array<Item, 4> items;
  View view;

  Scenery(double size, const Vec3& at) {
    meshes = {sphere(Vec3(-0.45, 0, 0.5), 0.5, 24), sphere(Vec3(0.4, -0.1, 0.35), 0.35, 24), box(Vec3(0.1, 0.9, 0.41), Vec3(0.3, 0.2, 0.41)),
              box(Vec3(0.5, -0.1, 1.1), Vec3(0.35, 0.35, 0.02))};
    for (Mesh& mesh : meshes) {
      for (Vec3& p : mesh.position) p = size * p + at;
      for (const char* axis : {"velocity_x", "velocity_y", "velocity_z"}) mesh.columns.push_back({axis, std::vector<double>(mesh.vertex_count(), size)});
    }
    items[0] = {.mesh = &meshes[0], .colour = Vec3(0.8, 0.2, 0.15), .roughness = 0.2};
    items[1] = {.mesh = &meshes[1], .colour = Vec3(0.2, 0.4, 0.8), .wireframe = true};
    items[2] = {.mesh = &meshes[2], .paint = {.kind = PaintKind::Checker, .colour = Vec3(0.1, 0.3, 0.2), .size = 0.16 * size}};
    items[3] = {.mesh = &meshes[3], .paint = {.kind = PaintKind::Stripes, .colour = Vec3(0.7, 0.6, 0.1), .size = 0.09 * size, .axis = Vec3(1, 1, 0)}};
    view.camera = {.from = size * Vec3(0.6, -3, 1.6) + at, .look_at = size * Vec3(0.05, 0.1, 0.45) + at, .field_of_view = 0.6};
    view.ground = Ground{.height = at.z(), .paint = {.kind = PaintKind::Checker, .colour = Vec3(0.5, 0.5, 0.6), .size = 0.25 * size}};
    view.area_lights = {{.at = size * Vec3(-1.5, -1, 2) + at, .facing = Vec3(1.5, 1, -1.6), .half_sizes = size * Eigen::Vector2d(0.4, 0.3), .radiance = 8.0}};
  }
  Scenery(const Scenery&) = delete;

  /// With faces of their own at every side, whose corners have its normal.
  static Mesh box(const Vec3& middle, const Vec3& half) {
    Mesh mesh;
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        const Vec3 c = middle + side * half[axis] * Vec3::Unit(axis), u = side * half[(axis + 1) % 3] * Vec3::Unit((axis + 1) % 3);
        const Vec3 v = half[(axis + 2) % 3] * Vec3::Unit((axis + 2) % 3);
        add_quadrangle(mesh, c - u - v, c + u - v, c + u + v, c - u + v);
      }
    return mesh;
  }
};

constexpr int kWidth = 192, kHeight = 144;

/// Those of this build.
std::vector<RendererKind> kinds() {
  return has_path_tracer() ? std::vector{RendererKind::Gl, RendererKind::Path} : std::vector{RendererKind::Gl};
}

std::unique_ptr<Renderer> renderer_of(RendererKind kind) {
  return make_renderer({.width = kWidth, .height = kHeight, .kind = kind, .most_samples = 16});
}

const Vec3 kFarAway = Vec3(1e6, -1e6, 1e6);
/// [dB], a root mean square of 0.8 of 255 levels. Lengths that are no powers of two have other texels in shadow maps, and pixels at edges
/// may fall to their other side.
constexpr double kSame = 50.0;

TEST(Scale, OfAPowerOfTwoChangesNoByteOfAPicture) {
  for (const RendererKind kind : kinds()) {
    const auto renderer = renderer_of(kind);
    const Scenery metres(1.0, Vec3::Zero());
    const Image expected = renderer->render(metres.view, metres.items);
    for (const double size : {0x1p-30, 0x1p-20, 0x1p-10, 0x1p10, 0x1p20}) {
      const Scenery scaled(size, Vec3::Zero());
      EXPECT_EQ(renderer->render(scaled.view, scaled.items).pixels, expected.pixels) << "times " << size;
    }
  }
}

TEST(Scale, AndPlaceChangeNoMoreThanRounding) {
  for (const RendererKind kind : kinds()) {
    const auto renderer = renderer_of(kind);
    const Scenery metres(1.0, Vec3::Zero());
    const Image expected = renderer->render(metres.view, metres.items);
    const auto expect_same = [&](double size, const Vec3& at) {
      const Scenery other(size, at);
      const ImageDifference difference = compare(renderer->render(other.view, other.items), expected, 1.0);
      EXPECT_GT(difference.psnr, kSame) << static_cast<int>(kind) << " times " << size << " at " << at.transpose();
    };
    for (const double size : {1e-9, 1e-6, 1e3, 1e6}) expect_same(size, Vec3::Zero());
    for (const double size : {1.0, 1e3}) expect_same(size, kFarAway);
    expect_same(1e-6, 1e-6 * kFarAway);
  }
}

TEST(Scale, DoesNotFollowFromHowFarPastItACameraLooks) {
  for (const RendererKind kind : kinds()) {
    const auto renderer = renderer_of(kind);
    const auto picture = [&](double size, double times) {
      Scenery scenery(size, Vec3::Zero());
      Camera& camera = scenery.view.camera;
      camera.look_at = camera.from + times * (camera.look_at - camera.from);
      return renderer->render(scenery.view, scenery.items);
    };
    const Image expected = picture(1.0, 100.0);
    EXPECT_GT(compare(picture(1.0, 1e6), expected, 1.0).psnr, kSame);
    EXPECT_GT(compare(picture(1e-6, 1e6), expected, 1.0).psnr, kSame);
    // A direction of a micrometre to look in is one, too.
    const Image near_by = picture(1.0, 1e-2);
    EXPECT_GT(compare(picture(1.0, 1e-6), near_by, 1.0).psnr, kSame);
    EXPECT_GT(compare(picture(1e6, 1e-6), near_by, 1.0).psnr, kSame);
  }
}

TEST(Scale, ShowsWhatIsCloseToTheEye) {
  Scenery scenery(1.0, Vec3::Zero());
  const Camera& camera = scenery.view.camera;
  const Vec3 ahead = (camera.look_at - camera.from).normalized();
  constexpr double kOff = 2e-3;  // [m], of a camera 3.3 m from what it looks at
  const Mesh mote = sphere(camera.from + 1.5 * kOff * ahead, 0.5 * kOff, 16);
  const Item item{.mesh = &mote, .colour = Vec3(0.0, 0.9, 0.0)};
  const Layers layers = make_layer_renderer({.width = kWidth, .height = kHeight})->render(scenery.view, std::span(&item, 1));
  const std::size_t middle = static_cast<std::size_t>(kWidth) * (kHeight / 2) + kWidth / 2;
  EXPECT_EQ(layers.object[middle], 1u);
  EXPECT_NEAR(layers.depth[middle], kOff, 1e-2 * kOff);  // facets lie up to 1 - cos(pi / 32) of half of it below the ball
  for (const RendererKind kind : kinds()) {
    std::vector<Item> items(scenery.items.begin(), scenery.items.end());
    items.push_back(item);
    const Image picture = renderer_of(kind)->render(scenery.view, items);
    const std::uint8_t* pixel = &picture.pixels[3 * middle];
    EXPECT_GT(pixel[1], 2 * pixel[0]) << static_cast<int>(kind);
  }
}

TEST(Scale, OfDepthsAndVelocitiesIsThatOfTheScene) {
  const Scenery metres(1.0, Vec3::Zero());
  const auto renderer = make_layer_renderer({.width = kWidth, .height = kHeight});
  const Layers expected = renderer->render(metres.view, metres.items);
  for (const double size : {0x1p-30, 0x1p20}) {
    const Scenery scaled(size, Vec3::Zero());
    const Layers layers = renderer->render(scaled.view, scaled.items);
    EXPECT_EQ(layers.object, expected.object);
    EXPECT_EQ(layers.normal, expected.normal);
    for (std::size_t i = 0; i < layers.depth.size(); ++i) {
      ASSERT_EQ(layers.depth[i], static_cast<float>(size) * expected.depth[i]);
      ASSERT_EQ(layers.velocity[3 * i], static_cast<float>(size) * expected.velocity[3 * i]);
    }
  }
}

}  // namespace
}  // namespace supple::render
