#include "supple/render/layers.h"

#include <ImfChannelList.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <half.h>

#include <cmath>

#include "render/shapes.h"
#include "render/support.h"

namespace supple::render {
namespace {

using test::Folder;
using test::sphere;

constexpr int kWidth = 65, kHeight = 33;  // odd, so that a pixel looks along the axis

std::size_t at(int x, int y) { return static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x); }

struct Scenery {
  Mesh ball = sphere(Vec3(0, 0, 0), 1.0, 48);
  Mesh small = sphere(Vec3(1.5, -1, 0), 0.25, 24);
  View view;
  Scenery() {
    view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.8};
    for (const char* axis : {"velocity_x", "velocity_y", "velocity_z"}) {
      ball.columns.push_back({.name = axis, .values = std::vector<double>(ball.vertex_count(), axis[9] == 'y' ? -2.0 : 0.5)});
    }
  }
  [[nodiscard]] std::array<Item, 2> items() const { return {Item{.mesh = &ball}, Item{.mesh = &small}}; }
};

Layers layers_of(const Scenery& scenery) {
  return make_layer_renderer({.width = kWidth, .height = kHeight})->render(scenery.view, scenery.items());
}

TEST(Layers, SayWhatTheMiddleOfEachPixelMeets) {
  const Scenery scenery;
  const Layers layers = layers_of(scenery);
  const double half_height = std::tan(0.4), half_width = half_height * kWidth / kHeight;
  std::array<int, 3> seen{};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vec3 ray(((x + 0.5) / kWidth * 2 - 1) * half_width, 1.0, (1 - (y + 0.5) / kHeight * 2) * half_height);
      const std::uint32_t id = layers.object[at(x, y)];
      ASSERT_LE(id, 2u);
      ++seen[id];
      if (id == 0) {
        EXPECT_TRUE(std::isinf(layers.depth[at(x, y)]));
        continue;
      }
      const Vec3 centre = id == 1 ? Vec3::Zero() : Vec3(1.5, -1, 0);
      const double radius = id == 1 ? 1.0 : 0.25;
      const Vec3 hit = scenery.view.camera.from + layers.depth[at(x, y)] * ray;
      // The diagonal of a facet spans d = sqrt(2) pi / 48 at most: it lies d^2 / 8 = 1.07e-3 below the sphere, and where a
      // ray grazes it the point is off by an angle of sqrt(2 x 1.07e-3), whose cosine is .9989.
      const Vec3 n(layers.normal[3 * at(x, y)], layers.normal[3 * at(x, y) + 1], layers.normal[3 * at(x, y) + 2]);
      EXPECT_NEAR((hit - centre).norm(), radius, 1.5e-3 * radius) << x << ' ' << y;
      EXPECT_NEAR(n.norm(), 1.0, 1e-6);
      EXPECT_GT(n.dot((hit - centre) / radius), 0.9988) << x << ' ' << y;
      EXPECT_FLOAT_EQ(layers.velocity[3 * at(x, y) + 1], id == 1 ? -2.0F : 0.0F);
    }
  }
  // Areas of the outlines: a sphere at distance d fills a disc of tan(asin(r / d)).
  const double pixel = 4.0 * half_width * half_height / (kWidth * kHeight);
  const double outline = M_PI * std::pow(std::tan(std::asin(0.2)), 2) / pixel;
  EXPECT_NEAR(seen[1], outline, 2.0 * std::sqrt(M_PI * outline));  // the pixels on the rim go either way
  EXPECT_GT(seen[2], 3);
  EXPECT_NEAR(layers.depth[at(kWidth / 2, kHeight / 2)], 4.0, 1e-3);
}

TEST(Layers, HaveTheGroundBehindItems) {
  Scenery scenery;
  scenery.view.ground = Ground{.height = -0.5};
  const Layers layers = layers_of(scenery);
  const double slope = std::tan(0.4) * (1 - (kHeight - 0.5) / kHeight * 2);
  EXPECT_EQ(layers.object[at(0, kHeight - 1)], 3u);
  EXPECT_NEAR(layers.depth[at(0, kHeight - 1)], -0.5 / slope, 1e-5);
  EXPECT_FLOAT_EQ(layers.normal[3 * at(0, kHeight - 1) + 2], 1.0F);
  EXPECT_EQ(layers.object[at(0, 0)], 0u);
  EXPECT_EQ(layers.object[at(kWidth / 2, kHeight / 2)], 1u);
}

TEST(Exr, HoldsPictureAndLayers) {
  const Folder folder;
  const Scenery scenery;
  const Layers layers = layers_of(scenery);
  LinearImage picture{.width = kWidth, .height = kHeight, .rgba = {}};
  for (int i = 0; i < 4 * kWidth * kHeight; ++i) picture.rgba.push_back(static_cast<float>(i * 7 % 256) * 0.25F);
  picture.rgba[1] = 1e9F;  // more than a half can hold
  const std::vector<std::string> names{"ball", "small"};
  write_exr(folder / "a.exr", picture, layers, names, "beef");
  EXPECT_EQ(folder.file_count(), 1U);
  EXPECT_EQ(exr_fingerprint(folder / "a.exr"), "beef");
  EXPECT_EQ(exr_fingerprint(folder / "none.exr"), "");

  Imf::InputFile file((folder / "a.exr").c_str());
  EXPECT_EQ(file.header().findTypedAttribute<Imf::StringAttribute>("objects")->value(), "1 ball, 2 small");
  std::vector<half> green(kWidth * kHeight), cover(kWidth * kHeight), up(kWidth * kHeight);
  std::vector<float> depth(kWidth * kHeight);
  std::vector<std::uint32_t> id(kWidth * kHeight);
  Imf::FrameBuffer buffer;
  const auto add = [&](const char* name, Imf::PixelType type, auto& values) {
    EXPECT_EQ(file.header().channels()[name].type, type) << name;
    buffer.insert(name, Imf::Slice(type, reinterpret_cast<char*>(values.data()), sizeof values[0], sizeof values[0] * kWidth));
  };
  add("G", Imf::HALF, green);
  add("A", Imf::HALF, cover);
  add("N.Z", Imf::HALF, up);
  add("Z", Imf::FLOAT, depth);
  add("id", Imf::UINT, id);
  file.setFrameBuffer(buffer);
  file.readPixels(0, kHeight - 1);
  EXPECT_EQ(depth, layers.depth);
  EXPECT_EQ(id, layers.object);
  for (std::size_t i = 0; i < id.size(); ++i) {
    EXPECT_EQ(up[i], half(layers.normal[3 * i + 2]));
    EXPECT_EQ(green[i], half(i > 0 ? picture.rgba[4 * i + 1] : static_cast<float>(HALF_MAX)));
    EXPECT_EQ(cover[i], half(picture.rgba[4 * i + 3]));
  }
  EXPECT_FLOAT_EQ(file.header().findTypedAttribute<Imf::FloatAttribute>("exposure")->value(), 0.42F);
}

}  // namespace
}  // namespace supple::render
