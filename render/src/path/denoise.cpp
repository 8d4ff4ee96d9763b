#include "denoise.h"

#include <algorithm>

namespace supple::render::path {
namespace {

constexpr int kLevels = 4;
constexpr float kAlbedoFloor = 0.02F;
constexpr float kNoiseScale = 0.8F;  // standard errors that count as the same

}  // namespace

void denoise(int width, int height, const Vec3f& eye, float footprint, const Executor& executor, Film& film) {
  const std::size_t pixels = film.radiance.size();
  std::vector<Vec3f> light(pixels), next(pixels);
  std::vector<float> variance(pixels), next_variance(pixels), smooth(pixels), guide(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const Vec3f albedo = film.albedo[i].cwiseMax(kAlbedoFloor);
    light[i] = film.radiance[i].cwiseQuotient(albedo);
    const float scale = 1.0F / luminance(albedo);
    variance[i] = film.variance[i] * scale * scale;
  }
  constexpr std::array<float, 3> kKernel = {3.0F / 8.0F, 1.0F / 4.0F, 1.0F / 16.0F};
  const auto index = [width](int x, int y) { return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x); };
  const auto rows = [&](const auto& body) {
    executor.for_blocks(static_cast<std::size_t>(height), 4, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
        for (int x = 0; x < width; ++x)
          if (film.cover[index(x, y)] > 0.0F) body(x, y);
    });
  };
  for (int level = 0; level < kLevels; ++level) {
    const int stride = 1 << level;
    // Both the estimates of variance and what they are compared with are noisy: means over 3 x 3 pixels.
    rows([&](int x, int y) {
      float sum = 0.0F, weights = 0.0F, bright = 0.0F;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int px = x + dx, py = y + dy;
          if (px < 0 || py < 0 || px >= width || py >= height || film.cover[index(px, py)] <= 0.0F) continue;
          const float w = (dx == 0 ? 2.0F : 1.0F) * (dy == 0 ? 2.0F : 1.0F);
          sum += w * variance[index(px, py)];
          bright += w * luminance(light[index(px, py)]);
          weights += w;
        }
      smooth[index(x, y)] = sum / weights;
      guide[index(x, y)] = bright / weights;
    });
    rows([&](int x, int y) {
      const std::size_t here = index(x, y);
      const Vec3f& n = film.normal[here];
      const Vec3f& p = film.position[here];
      const float plane = 1.0F / (2.0F * footprint * static_cast<float>(stride) * (p - eye).norm() + 1e-12F);
      const float noise = 1.0F / (kNoiseScale * std::sqrt(smooth[here]) + 1e-4F);
      Vec3f sum = Vec3f::Zero();
      float weights = 0.0F, sum_variance = 0.0F;
      for (int dy = -2; dy <= 2; ++dy)
        for (int dx = -2; dx <= 2; ++dx) {
          const int px = x + dx * stride, py = y + dy * stride;
          if (px < 0 || py < 0 || px >= width || py >= height) continue;
          const std::size_t there = index(px, py);
          if (film.cover[there] <= 0.0F) continue;
          float facing = std::max(0.0F, film.normal[there].dot(n));
          facing *= facing;
          facing *= facing;
          facing *= facing;
          facing *= facing;
          facing *= facing;
          const float off = std::abs((film.position[there] - p).dot(n)) * plane;
          const float different = std::abs(guide[there] - guide[here]) * noise;
          float w = kKernel[static_cast<std::size_t>(std::abs(dx))] * kKernel[static_cast<std::size_t>(std::abs(dy))] * facing *
                    std::exp(-off - different) * film.cover[there];
          if (there == here) w = kKernel[0] * kKernel[0] * film.cover[here];
          sum += w * light[there];
          sum_variance += w * w * variance[there];
          weights += w;
        }
      next[here] = sum / weights;
      next_variance[here] = sum_variance / (weights * weights);
    });
    light.swap(next);
    variance.swap(next_variance);
  }
  for (std::size_t i = 0; i < pixels; ++i)
    if (film.cover[i] > 0.0F) film.radiance[i] = light[i].cwiseProduct(film.albedo[i].cwiseMax(kAlbedoFloor));
}

}  // namespace supple::render::path
