#include "path/details.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

namespace supple::render::path {
namespace {

constexpr std::uint32_t kSurfacesSamples = 32, kSurfacesTimes = 8;  // at least, and times those of the tile
constexpr std::uint32_t kLightSamples = 16;  // at least, where light changes within a few pixels
constexpr float kOneSurface = 0.98F;         // square of the mean of unit normals that are nearly parallel
constexpr float kSameNormal = 0.95F, kSameCover = 0.1F, kSameAlbedo = 0.03F;
constexpr float kSameShade = 0.3F;           // difference of direct light, over (luminance + 0.1)
constexpr float kGap = 0.05F;                // size of a pixel over the distance that its light comes from
constexpr int kAround = 2;                   // pixels, as far as the denoiser looks for single surfaces
constexpr int kRun = 16;                     // pixels that are passed over at once where nothing is seen
constexpr std::uint8_t kMeet = 1, kInGap = 2, kEnds = 4;
constexpr std::array<std::pair<int, int>, 4> kBeside = {{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};

/// Measures of detail, of eight pixels each.
class Signs {
 public:
  /// @param pixel  size of a pixel at unit distance
  Signs(const Film& film, const Vec3f& eye, float pixel) : film_(film), eye_(eye), pixel_(pixel) {}

  [[nodiscard]] LaneMask surfaces_meet(int x, int y) const {
    const std::ptrdiff_t at = film_.cover.index(x, y);
    const Lanes covered = film_.cover.load(at);
    const Vec3Lanes own = film_.normal.load(at), colour = film_.albedo.load(at) * covered;
    LaneMask meet = both(covered > 0.0F, own.dot(own) < kOneSurface);
    for (const auto& [dx, dy] : kBeside) {
      const std::ptrdiff_t beside = at + film_.cover.index(dx, dy);
      const Lanes other = film_.cover.load(beside);
      const Vec3Lanes apart = colour - film_.albedo.load(beside) * other;
      const Lanes differs = larger(larger(magnitude(apart.x()), magnitude(apart.y())), magnitude(apart.z()));
      const LaneMask turned = both(both(covered > 0.0F, other > 0.0F), own.dot(film_.normal.load(beside)) < kSameNormal);
      meet |= both(inside(x + dx, y + dy), (magnitude(covered - other) > kSameCover) | (differs > kSameAlbedo) | turned);
    }
    return meet;
  }
  /// By the mean nearness of what the pixels around see light from: one path per pixel is too noisy.
  [[nodiscard]] LaneMask are_gaps(std::ptrdiff_t at) const {
    const Lanes size = pixel_ * (film_.position.load(at) - Vec3Lanes(eye_)).norm();
    return both(film_.cover.load(at) > 0.0F, tent_sum<2>(film_.nearness, at) * size > kGap * tent_sum<2>(film_.cover, at));
  }
  [[nodiscard]] LaneMask shadows_end(std::ptrdiff_t at) const {
    const auto direct = [&](std::ptrdiff_t pixel) { return luminance(film_.direct.radiance.load(pixel)); };
    const auto light = [&](std::ptrdiff_t pixel) { return luminance(film_.radiance.load(pixel)); };
    const Lanes own = direct(at), all = light(at);
    LaneMask ends{};
    for (const auto& [dx, dy] : kBeside) {
      const std::ptrdiff_t beside = at + film_.cover.index(dx, dy);
      const Lanes scale = 0.5F * (all + light(beside)) + 0.1F;
      ends |= both(film_.cover.load(beside) > 0.0F, magnitude(own - direct(beside)) > kSameShade * scale);
    }
    return both(film_.cover.load(at) > 0.0F, ends);
  }

 private:
  [[nodiscard]] LaneMask inside(int x, int y) const {
    if (y < 0 || y >= film_.height) return LaneMask{};
    return x < 0 ? ~first_lanes(-x) : first_lanes(film_.width - x);
  }
  const Film& film_;
  Vec3f eye_;
  float pixel_;
};

}  // namespace

void find_details(const CameraMatrices& camera, const TraceSettings& settings, const Executor& executor, Film& film) {
  const int width = film.width, height = film.height;
  const Signs signs(film, camera.eye, 2.0F * camera.half_extent.y() / static_cast<float>(height));
  const auto most = static_cast<std::uint32_t>(settings.most_samples);
  const auto across = static_cast<std::size_t>(width);
  std::vector<std::uint8_t> seen(across * static_cast<std::size_t>(height));
  const auto for_rows = [&](const auto& body) {
    executor.for_blocks(static_cast<std::size_t>(height), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) body(row, static_cast<int>(row));
    });
  };
  for_rows([&](std::size_t row, int y) {
    for (std::size_t left = 0; left < across; left += kLanes) {
      const int x = static_cast<int>(left);
      const std::ptrdiff_t at = film.cover.index(x, y);
      const bool shown = any(film.cover.load(at) > 0.0F);
      const LaneMask meet = signs.surfaces_meet(x, y);
      const LaneMask gap = shown ? signs.are_gaps(at) : LaneMask{}, ends = shown ? signs.shadows_end(at) : LaneMask{};
      if (!any(meet | gap | ends)) continue;
      for (std::size_t k = 0; k < std::min(kLanes, across - left); ++k)
        seen[row * across + left + k] = static_cast<std::uint8_t>((meet[k] & kMeet) | (gap[k] & kInGap) | (ends[k] & kEnds));
    }
  });
  const auto seen_at = [&](int x, int y) { return seen[static_cast<std::size_t>(y) * across + static_cast<std::size_t>(x)]; };
  // Whether hardly a pixel around shows a single surface, whose light this one could have: where one sees through something.
  const auto sees_through = [&](int x, int y) {
    int meet = 0, all = 0;
    for (int py = std::max(0, y - kAround); py <= std::min(height - 1, y + kAround); ++py)
      for (int px = std::max(0, x - kAround); px <= std::min(width - 1, x + kAround); ++px, ++all) meet += seen_at(px, py) & kMeet;
    return 5 * meet >= 4 * all;
  };
  const auto nothing_seen = [&](int x, int y) {
    if (y < 0) return true;
    const std::span row = std::span(seen).subspan(static_cast<std::size_t>(y) * across, across);
    const std::span run = row.subspan(static_cast<std::size_t>(std::max(x - kAround, 0)));
    const auto length = std::min(run.size(), static_cast<std::size_t>(kRun + 2 * kAround));
    return std::all_of(run.begin(), run.begin() + static_cast<std::ptrdiff_t>(length), [](std::uint8_t sign) { return sign == 0; });
  };
  std::vector<std::vector<DetailedPixel>> found(static_cast<std::size_t>(height));
  for_rows([&](std::size_t row, int y) {
    for (int x = 0; x < width; ++x) {
      if (x % kRun == 0 && nothing_seen(x, y) && nothing_seen(x, y + 1 < height ? y + 1 : y - 1)) {  // two of at most five rows
        x += kRun - 1;
        continue;
      }
      const std::uint8_t here = seen_at(x, y);
      const bool through = sees_through(x, y);
      if (here == 0 && !through) continue;
      const auto samples = static_cast<std::uint32_t>(film.samples.at(x, y));
      const Detail detail = (here & kMeet) != 0 || through ? Detail::Surfaces : (here & kInGap) != 0 ? Detail::Gap : Detail::Shadow;
      const std::uint32_t wanted = detail == Detail::Surfaces ? std::max(kSurfacesSamples, kSurfacesTimes * samples) : kLightSamples;
      const std::uint32_t rays = std::min(most, wanted);
      const bool walks = (here & kInGap) != 0 || through;
      if (rays > samples || detail == Detail::Surfaces)
        found[row].push_back({.x = x, .y = y, .detail = detail, .rays = rays, .walks = walks, .samples = 0});
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
