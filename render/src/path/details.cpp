#include "details.h"

#include <algorithm>
#include <array>
#include <utility>

#include "plane.h"

namespace supple::render::path {
namespace {

constexpr std::uint32_t kSurfacesSamples = 32, kSurfacesTimes = 8;  // at least, and times those of the tile
constexpr std::uint32_t kLightSamples = 16;  // at least, where light changes within a few pixels
constexpr float kOneSurface = 0.98F;         // square of the mean of unit normals that are nearly parallel
constexpr float kSameNormal = 0.95F, kSameCover = 0.1F, kSameAlbedo = 0.03F;
constexpr float kSameShade = 0.3F;           // difference of direct light, over (luminance + 0.1)
constexpr float kGap = 0.05F;                // size of a pixel over the distance that its light comes from
constexpr std::array<std::pair<int, int>, 4> kBeside = {{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};

/// What tells details, of all pixels; zeros where nothing is shown.
struct Signs {
  Plane cover, inside;           ///< inside: 1 in the picture
  std::array<Plane, 3> albedo;   ///< times cover
  std::array<Plane, 3> normal;
  Plane nearness;                ///< as in the film
  Plane size;                    ///< of a pixel [m]
  Plane direct, light;           ///< luminances

  Signs(int width, int height) {
    for (Plane* plane : {&cover, &inside, &nearness, &size, &direct, &light}) plane->reset(width, height);
    for (std::size_t k = 0; k < 3; ++k) {
      albedo[k].reset(width, height);
      normal[k].reset(width, height);
    }
  }
  void fill(const Film& film, const CameraMatrices& camera, float pixel, std::size_t i, int x, int y) {
    inside.at(x, y) = 1.0F;
    if (film.cover[i] <= 0.0F) return;
    cover.at(x, y) = film.cover[i];
    for (std::size_t k = 0; k < 3; ++k) {
      albedo[k].at(x, y) = film.cover[i] * film.albedo[i][static_cast<Eigen::Index>(k)];
      normal[k].at(x, y) = film.normal[i][static_cast<Eigen::Index>(k)];
    }
    nearness.at(x, y) = film.nearness[i];
    size.at(x, y) = pixel * (film.position[i] - camera.eye).norm();
    direct.at(x, y) = luminance(film.direct.radiance[i]);
    light.at(x, y) = luminance(film.radiance[i]);
  }

  [[nodiscard]] LaneMask surfaces_meet(int x, int y) const {
    const Vec3Lanes own = vector(normal, x, y), colour = vector(albedo, x, y);
    const Lanes covered = cover.load(x, y);
    LaneMask meet = both(covered > 0.0F, own.dot(own) < kOneSurface);
    for (const auto& [dx, dy] : kBeside) {
      const int px = x + dx, py = y + dy;
      const Lanes other = cover.load(px, py);
      const Vec3Lanes apart = colour - vector(albedo, px, py);
      const Lanes differs = larger(larger(magnitude(apart.x()), magnitude(apart.y())), magnitude(apart.z()));
      const LaneMask turned = both(both(covered > 0.0F, other > 0.0F), own.dot(vector(normal, px, py)) < kSameNormal);
      meet |= both(inside.load(px, py) > 0.0F, (magnitude(covered - other) > kSameCover) | (differs > kSameAlbedo) | turned);
    }
    return meet;
  }
  /// By the mean nearness of what the pixels around see light from: one path a pixel knows little.
  [[nodiscard]] LaneMask are_gaps(int x, int y) const {
    return both(cover.load(x, y) > 0.0F, tent_sum<2>(nearness, x, y) * size.load(x, y) > kGap * tent_sum<2>(cover, x, y));
  }
  [[nodiscard]] LaneMask shadows_end(int x, int y) const {
    const Lanes own = direct.load(x, y), all = light.load(x, y);
    LaneMask ends{};
    for (const auto& [dx, dy] : kBeside) {
      const int px = x + dx, py = y + dy;
      const Lanes scale = 0.5F * (all + light.load(px, py)) + 0.1F;
      ends |= both(cover.load(px, py) > 0.0F, magnitude(own - direct.load(px, py)) > kSameShade * scale);
    }
    return both(cover.load(x, y) > 0.0F, ends);
  }

 private:
  [[nodiscard]] static Vec3Lanes vector(const std::array<Plane, 3>& planes, int x, int y) {
    return {planes[0].load(x, y), planes[1].load(x, y), planes[2].load(x, y)};
  }
};

}  // namespace

void find_details(const CameraMatrices& camera, const TraceSettings& settings, const Executor& executor, Film& film) {
  const int width = settings.width, height = settings.height;
  const auto rows = [&](const auto& body) {
    executor.for_blocks(static_cast<std::size_t>(height), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t y = begin; y < end; ++y) body(static_cast<int>(y), y * static_cast<std::size_t>(width));
    });
  };
  Signs signs(width, height);
  const float pixel = 2.0F * camera.half_extent.y() / static_cast<float>(height);
  rows([&](int y, std::size_t row) {
    for (int x = 0; x < width; ++x) signs.fill(film, camera, pixel, row + static_cast<std::size_t>(x), x, y);
  });

  const auto most = static_cast<std::uint32_t>(settings.most_samples);
  std::vector<std::vector<DetailedPixel>> found(static_cast<std::size_t>(height));
  rows([&](int y, std::size_t row) {
    for (int left = 0; left < width; left += static_cast<int>(kLanes)) {
      const LaneMask meet = signs.surfaces_meet(left, y), gap = signs.are_gaps(left, y), ends = signs.shadows_end(left, y);
      if (!any(meet | gap | ends)) continue;
      for (std::size_t k = 0; k < std::min(kLanes, static_cast<std::size_t>(width - left)); ++k) {
        if ((meet[k] | gap[k] | ends[k]) == 0) continue;
        const std::size_t i = row + static_cast<std::size_t>(left) + k;
        const std::uint32_t samples = film.samples[i];
        const Detail detail = meet[k] != 0 ? Detail::Surfaces : gap[k] != 0 ? Detail::Gap : Detail::Shadow;
        const std::uint32_t asked = detail == Detail::Surfaces ? std::max(kSurfacesSamples, kSurfacesTimes * samples) : kLightSamples;
        const std::uint32_t rays = std::min(most, asked);
        if (rays > samples || detail == Detail::Surfaces)
          found[static_cast<std::size_t>(y)].push_back({.pixel = i, .detail = detail, .rays = rays, .walks = gap[k] != 0, .samples = 0});
      }
    }
  });
  film.detailed.clear();
  std::size_t samples = 0;
  for (const std::vector<DetailedPixel>& row : found)
    for (DetailedPixel detailed : row) {
      detailed.samples = samples;
      if (detailed.detail == Detail::Surfaces) samples += detailed.rays;
      film.detailed.push_back(detailed);
    }
  film.detailed_samples.resize(samples);
}

}  // namespace supple::render::path
