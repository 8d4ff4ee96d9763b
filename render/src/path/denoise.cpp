#include "denoise.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace supple::render::path {
namespace {

constexpr int kLevels = 4;
constexpr float kAlbedoFloor = 0.02F;
constexpr float kNoiseScale = 2.0F;  // standard errors that count as the same
constexpr std::array<float, 3> kKernel = {3.0F / 8.0F, 1.0F / 4.0F, 1.0F / 16.0F};

/// exp(-t) for t >= 0, to 2e-4, without a call, so that loops become vector loops.
inline float fall(float t) {
  const float x = std::min(t, 80.0F) * 1.44269504F;
  const float whole = std::floor(x);
  const float r = x - whole;
  const float part = 1.0F - r * (0.69314718F - r * (0.24022651F - r * (0.05550411F - r * 0.00780F)));
  return std::bit_cast<float>((127 - static_cast<std::int32_t>(whole)) << 23) * part;
}

/// Numbers of all pixels, one array a channel.
struct Planes {
  std::vector<float> r, g, b, variance;
  explicit Planes(std::size_t pixels) : r(pixels), g(pixels), b(pixels), variance(pixels) {}
};

struct Features {
  std::vector<float> nx, ny, nz, px, py, pz, cover;
  std::vector<float> plane;  ///< 1 / distance from the tangent plane that counts as far, at stride 1
  std::vector<float> noise;  ///< 1 / difference of brightness that counts as large
  std::vector<float> guide;  ///< brightness, a little smoothed
};

/// Sums of one row, by pixel.
struct Sums {
  std::vector<float> r, g, b, variance, weight;
};

/// Adds what lies (dx, dy) pixels away to the row y.
void add_tap(int width, int y, int dx, int dy, float kernel, float plane_scale, const Planes& in, const Features& f, Sums& sums) {
  const int first = std::max(0, -dx), last = std::min(width, width - dx);
  const auto row = static_cast<std::ptrdiff_t>(y) * width;
  const std::ptrdiff_t shift = static_cast<std::ptrdiff_t>(dy) * width + dx;
  const auto here = [row](const std::vector<float>& v) { return v.data() + row; };
  const auto there = [row, shift](const std::vector<float>& v) { return v.data() + row + shift; };
  const float *nx = here(f.nx), *ny = here(f.ny), *nz = here(f.nz), *px = here(f.px), *py = here(f.py), *pz = here(f.pz);
  const float *mx = there(f.nx), *my = there(f.ny), *mz = there(f.nz), *qx = there(f.px), *qy = there(f.py), *qz = there(f.pz);
  const float *plane = here(f.plane), *noise = here(f.noise), *guide = here(f.guide), *other = there(f.guide), *cover = there(f.cover);
  const float *r = there(in.r), *g = there(in.g), *b = there(in.b), *variance = there(in.variance);
  float *sum_r = sums.r.data(), *sum_g = sums.g.data(), *sum_b = sums.b.data(), *sum_v = sums.variance.data(), *sum_w = sums.weight.data();
  const float own = dx == 0 && dy == 0 ? 1.0F : 0.0F;  // a pixel is like itself, whatever its features
#pragma GCC ivdep
  for (int x = first; x < last; ++x) {
    float facing = std::max(0.0F, nx[x] * mx[x] + ny[x] * my[x] + nz[x] * mz[x]);
    facing *= facing;
    facing *= facing;
    facing *= facing;
    facing *= facing;
    facing *= facing;
    const float off = std::abs((qx[x] - px[x]) * nx[x] + (qy[x] - py[x]) * ny[x] + (qz[x] - pz[x]) * nz[x]) * (plane[x] * plane_scale);
    const float different = std::abs(other[x] - guide[x]) * noise[x];
    const float w = kernel * std::max(own, facing * fall(off + different)) * cover[x];
    sum_r[x] += w * r[x];
    sum_g[x] += w * g[x];
    sum_b[x] += w * b[x];
    sum_v[x] += w * w * variance[x];
    sum_w[x] += w;
  }
}

}  // namespace

void denoise(int width, int height, const Vec3f& eye, float footprint, const Executor& executor, Film& film) {
  const std::size_t pixels = film.radiance.size();
  Planes light(pixels), next(pixels);
  Features f;
  for (auto* v : {&f.nx, &f.ny, &f.nz, &f.px, &f.py, &f.pz, &f.cover, &f.plane, &f.noise, &f.guide}) v->resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const Vec3f albedo = film.albedo[i].cwiseMax(kAlbedoFloor);
    const Vec3f falls = film.radiance[i].cwiseQuotient(albedo);
    light.r[i] = falls.x();
    light.g[i] = falls.y();
    light.b[i] = falls.z();
    const float scale = 1.0F / luminance(albedo);
    light.variance[i] = film.variance[i] * scale * scale;
    f.nx[i] = film.normal[i].x();
    f.ny[i] = film.normal[i].y();
    f.nz[i] = film.normal[i].z();
    f.px[i] = film.position[i].x();
    f.py[i] = film.position[i].y();
    f.pz[i] = film.position[i].z();
    f.cover[i] = film.cover[i];
    f.plane[i] = 1.0F / (2.0F * footprint * (film.position[i] - eye).norm() + 1e-12F);
  }
  const auto index = [width](int x, int y) { return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x); };
  const auto rows = [&](const auto& body) {
    executor.for_blocks(static_cast<std::size_t>(height), 4, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) body(y);
    });
  };
  for (int level = 0; level < kLevels; ++level) {
    const int stride = 1 << level;
    // Both the estimates of variance and what they are compared with are noisy: means over 3 x 3 pixels.
    rows([&](int y) {
      for (int x = 0; x < width; ++x) {
        if (f.cover[index(x, y)] <= 0.0F) continue;
        float sum = 0.0F, weights = 0.0F, bright = 0.0F;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx) {
            const int px = x + dx, py = y + dy;
            if (px < 0 || py < 0 || px >= width || py >= height || f.cover[index(px, py)] <= 0.0F) continue;
            const std::size_t there = index(px, py);
            const float w = (dx == 0 ? 2.0F : 1.0F) * (dy == 0 ? 2.0F : 1.0F);
            sum += w * light.variance[there];
            bright += w * luminance(Vec3f(light.r[there], light.g[there], light.b[there]));
            weights += w;
          }
        f.noise[index(x, y)] = 1.0F / (kNoiseScale * std::sqrt(sum / weights) + 1e-4F);
        f.guide[index(x, y)] = bright / weights;
      }
    });
    rows([&](int y) {
      thread_local Sums sums;
      for (auto* v : {&sums.r, &sums.g, &sums.b, &sums.variance, &sums.weight}) v->assign(static_cast<std::size_t>(width), 0.0F);
      for (int dy = -2; dy <= 2; ++dy) {
        if (y + dy * stride < 0 || y + dy * stride >= height) continue;
        for (int dx = -2; dx <= 2; ++dx)
          add_tap(width, y, dx * stride, dy * stride, kKernel[static_cast<std::size_t>(std::abs(dx))] * kKernel[static_cast<std::size_t>(std::abs(dy))],
                  1.0F / static_cast<float>(stride), light, f, sums);
      }
      for (int x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(x);
        if (!(sums.weight[i] > 0.0F)) continue;
        const float share = 1.0F / sums.weight[i];
        next.r[index(x, y)] = share * sums.r[i];
        next.g[index(x, y)] = share * sums.g[i];
        next.b[index(x, y)] = share * sums.b[i];
        next.variance[index(x, y)] = share * share * sums.variance[i];
      }
    });
    std::swap(light, next);
  }
  for (std::size_t i = 0; i < pixels; ++i)
    if (film.cover[i] > 0.0F) film.radiance[i] = Vec3f(light.r[i], light.g[i], light.b[i]).cwiseProduct(film.albedo[i].cwiseMax(kAlbedoFloor));
}

}  // namespace supple::render::path
