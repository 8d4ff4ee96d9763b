// Solids that stand side by side look like one: no dots, lines or gaps where their faces meet.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "render/shapes.h"
#include "render/support.h"
#include "supple/render/renderer.h"

namespace supple::render::test {
namespace {

/// Steps along x of equal depth, from -half_width to half_width in y.
struct Stairs {
  std::vector<double> heights;
  double depth = 0.3;
  double half_width = 0.4;

  [[nodiscard]] double x(std::size_t k) const { return depth * static_cast<double>(k); }
  [[nodiscard]] double height(std::size_t k) const { return k < heights.size() ? heights[k] : 0.0; }

  /// A block for each step.
  [[nodiscard]] std::vector<Mesh> blocks() const {
    std::vector<Mesh> out;
    for (std::size_t k = 0; k < heights.size(); ++k) out.push_back(block_of(Vec3(x(k), -half_width, 0), Vec3(x(k + 1), half_width, heights[k])));
    return out;
  }

  /// The surface of all of them, without vertices on edges of others.
  [[nodiscard]] Mesh joined() const {
    std::vector<double> levels = heights;
    levels.push_back(0.0);
    std::sort(levels.begin(), levels.end());
    levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
    Mesh mesh;
    const double w = half_width;
    for (std::size_t k = 0; k < heights.size(); ++k) {
      const double a = x(k), b = x(k + 1), top = heights[k];
      add_quadrangle(mesh, Vec3(a, -w, top), Vec3(b, -w, top), Vec3(b, w, top), Vec3(a, w, top));
      add_quadrangle(mesh, Vec3(a, -w, 0), Vec3(a, w, 0), Vec3(b, w, 0), Vec3(b, -w, 0));
      for (std::size_t i = 0; i + 1 < levels.size() && levels[i] < top; ++i) {
        const double c = levels[i], d = levels[i + 1];
        add_quadrangle(mesh, Vec3(a, -w, c), Vec3(b, -w, c), Vec3(b, -w, d), Vec3(a, -w, d));
        add_quadrangle(mesh, Vec3(b, w, c), Vec3(a, w, c), Vec3(a, w, d), Vec3(b, w, d));
        if (c >= height(k + 1)) add_quadrangle(mesh, Vec3(b, -w, c), Vec3(b, w, c), Vec3(b, w, d), Vec3(b, -w, d));
        if (c >= (k == 0 ? 0.0 : heights[k - 1])) add_quadrangle(mesh, Vec3(a, w, c), Vec3(a, -w, c), Vec3(a, -w, d), Vec3(a, w, d));
      }
    }
    return mesh;
  }
};

std::vector<Item> fixed_items(const std::vector<Mesh>& meshes) {
  std::vector<Item> items;
  for (const Mesh& mesh : meshes) items.push_back({.mesh = &mesh, .colour = Vec3(0.6, 0.6, 0.65), .fixed = true});
  return items;
}

RenderSettings sized(int width, int height, int samples = 4) {
  RenderSettings settings;
  settings.width = width;
  settings.height = height;
  settings.samples = samples;
  return settings;
}

constexpr int kSeen = 12;  // of 765: four levels of each channel

/// Pixels darker or brighter than all around them are in another picture of the same.
int dots_of(const Image& image, const Image& same) {
  int dots = 0;
  for (int y = 1; y + 1 < same.height; ++y)
    for (int x = 1; x + 1 < same.width; ++x) {
      int least = 765, most = 0;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          least = std::min(least, brightness(same, x + i, y + j));
          most = std::max(most, brightness(same, x + i, y + j));
        }
      const int here = brightness(image, x, y);
      dots += here < least - kSeen || here > most + kSeen ? 1 : 0;
    }
  return dots;
}

TEST(Seams, OfBlocksSideBySideAreNotSeen) {
  const Stairs stairs{.heights = {0.4, 0.25, 0.1}};
  const std::vector<Mesh> blocks = stairs.blocks(), joined = {stairs.joined()};
  const std::unique_ptr<Renderer> renderer = make_renderer(sized(240, 160));
  View view;
  view.ground = Ground{};
  int dots = 0;
  for (int k = 0; k < 48; ++k) {
    // Directions of a spiral over the upper half sphere.
    const double up = 0.15 + 0.7 * k / 48.0, turn = 2.39996 * k;
    const Vec3 to_eye(std::sqrt(1.0 - up * up) * std::cos(turn), std::sqrt(1.0 - up * up) * std::sin(turn), up);
    view.camera = {.from = Vec3(0.45, 0, 0.15) + 2.3 * to_eye, .look_at = Vec3(0.45, 0, 0.15), .up = Vec3::UnitZ(), .field_of_view = 0.5};
    dots += dots_of(renderer->render(view, fixed_items(blocks)), renderer->render(view, fixed_items(joined)));
  }
  EXPECT_EQ(dots, 0);
}

TEST(Seams, HaveNoCracksWhereCornersEndOnEdges) {
  // Lit from the left, where the faces between two blocks are dark.
  const Stairs stairs{.heights = {0.4, 0.25, 0.13}};
  const std::vector<Mesh> blocks = stairs.blocks(), joined = {stairs.joined()};
  for (const int samples : {1, 4}) {
    RenderSettings settings = sized(64, 96, samples);
    settings.shadow_size = 0;
    const std::unique_ptr<Renderer> renderer = make_renderer(settings);
    View view;
    view.ground = Ground{};
    view.light = {.direction = Vec3(0, 1, 0), .intensity = 6.0};
    int dots = 0;
    for (int k = 0; k < 80; ++k) {
      const double turn = 0.2 + 0.9 * std::fmod(0.618034 * k, 1.0), up = 0.1 + 0.3 * std::fmod(0.754878 * k, 1.0);
      const Vec3 aim(k % 2 == 0 ? 0.3 : 0.6, -0.4, k % 2 == 0 ? 0.125 : 0.065);
      view.camera = {.from = aim + Vec3(std::sin(turn), -std::cos(turn), up), .look_at = aim, .up = Vec3(0.1, 0, 1), .field_of_view = k % 2 == 0 ? 0.2 : 0.1};
      dots += dots_of(renderer->render(view, fixed_items(blocks)), renderer->render(view, fixed_items(joined)));
    }
    EXPECT_EQ(dots, 0) << samples;
  }
}

/// Largest difference along a row, of long steps seen from ahead: there everything is alike along a row of the picture.
int unevenness(Renderer& renderer, View view, int phase) {
  static const Stairs stairs{.heights = {0.4, 0.25, 0.1}, .half_width = 2.0};
  static const std::vector<Mesh> blocks = stairs.blocks();
  constexpr double kDistance = 60.0, kTall = 1.4;
  const Vec3 aim(0.45, 0.0, 0.2 + kTall / 160.0 * phase / 8.0);  // seams at any height within a pixel
  view.camera = {.from = aim + kDistance * Vec3(0.8, 0, 0.6), .look_at = aim, .up = Vec3::UnitZ(), .field_of_view = 2.0 * std::atan(0.5 * kTall / kDistance)};
  const Image image = renderer.render(view, fixed_items(blocks));
  int uneven = 0;
  for (int y = 0; y < image.height; ++y) {
    int least = 765, most = 0;
    for (int x = 0; x < image.width; ++x) {
      least = std::min(least, brightness(image, x, y));
      most = std::max(most, brightness(image, x, y));
    }
    uneven = std::max(uneven, most - least);
  }
  return uneven;
}

TEST(Seams, AreEvenAlongEdgesWhereTheSunThrowsNoShadow) {
  for (const int samples : {1, 4}) {
    const std::unique_ptr<Renderer> renderer = make_renderer(sized(96, 160, samples));
    for (const Vec3& sun : {Vec3(-0.6, 0.3, -0.7), Vec3(-0.3, -0.1, -0.9), Vec3(-0.9, 0.1, -0.3)})
      for (int phase = 0; phase < 8; ++phase) {
        View view;
        view.light = {.direction = sun};
        EXPECT_LE(unevenness(*renderer, view, phase), kSeen) << "phase " << phase << ", sun " << sun.transpose() << ", samples " << samples;
      }
  }
}

TEST(Seams, AreEvenAlongEdgesWhereARectangleThrowsNoShadow) {
  // So far off that its light is the same all along a row.
  const std::unique_ptr<Renderer> renderer = make_renderer(sized(96, 160));
  for (const Vec3& to_light : {Vec3(0.6, 0, 0.8), Vec3(0.9, 0, 0.44)})
    for (int phase = 0; phase < 8; ++phase) {
      View view;
      view.light.intensity = 0.0;
      view.area_lights = {{.at = 40.0 * to_light, .facing = -to_light, .half_sizes = {4, 4}, .radiance = 60.0}};
      EXPECT_LE(unevenness(*renderer, view, phase), kSeen) << "phase " << phase << ", light " << to_light.transpose();
    }
}

}  // namespace
}  // namespace supple::render::test
