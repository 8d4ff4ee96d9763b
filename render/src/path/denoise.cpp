#include "denoise.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

// Rows that a loop writes are none of those that it reads: they are more than compilers check by themselves.
#ifdef __clang__
#define SUPPLE_ROWS_ARE_APART _Pragma("clang loop vectorize(assume_safety)")
#else
#define SUPPLE_ROWS_ARE_APART _Pragma("GCC ivdep")
#endif

namespace supple::render::path {
namespace {

constexpr int kLevels = 5;
constexpr float kAlbedoFloor = 0.02F;
constexpr float kNearScale = 2.5F;   // 1 / distance over which indirect light may change, times that of what it comes from
// Standard errors that count as the same. Edges of shadows are sharp, indirect light is known to be smooth by what is near,
// except in mirrors.
constexpr float kDirectScale = 1.0F, kMattScale = 16.0F, kMirrorScale = 2.0F;
constexpr std::array<float, 2> kKernel = {1.0F / 2.0F, 1.0F / 4.0F};

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
  Planes() = default;
  explicit Planes(std::size_t pixels) : r(pixels), g(pixels), b(pixels), variance(pixels) {}
};

struct Features {
  std::vector<float> nx, ny, nz, px, py, pz, cover;
  std::vector<float> shown;  ///< 1 where there is a surface, else 0
  std::vector<float> near;   ///< 1 / distance over which indirect light may change much (Ward & Heckbert 1992)
  std::vector<float> plane;  ///< 1 / distance from the tangent plane that counts as far, at stride 1
};

/// A part of the light on its way through the filter.
struct Signal {
  Planes light, next;
  std::vector<float> noise;  ///< 1 / difference of brightness that counts as large
  std::vector<float> bright;
  std::vector<float> guide;  ///< brightness, a little smoothed
  std::vector<float> scale;  ///< standard errors that count as the same
  Signal() = default;
  explicit Signal(std::size_t pixels) : light(pixels), next(pixels), noise(pixels), bright(pixels), guide(pixels), scale(pixels) {}
};

/// Sums of one row, by pixel.
struct Sums {
  std::vector<float> r, g, b, variance, weight;
  void clear(std::size_t width) {
    for (auto* v : {&r, &g, &b, &variance, &weight}) v->assign(width, 0.0F);
  }
};

/// What lies (dx, dy) pixels from a row of them.
struct Tap {
  int dx = 0, dy = 0;
  float kernel = 0.0F;
  float plane_scale = 1.0F;
};

/// How alike surfaces are: facing the same way, and how far off in scales of the tangent plane.
void compare_features(int width, int y, const Tap& tap, const Features& f, std::vector<float>& alike, std::array<std::vector<float>, 2>& off) {
  const int first = std::max(0, -tap.dx), last = std::min(width, width - tap.dx);
  const auto row = static_cast<std::ptrdiff_t>(y) * width;
  const std::ptrdiff_t shift = static_cast<std::ptrdiff_t>(tap.dy) * width + tap.dx;
  const auto here = [row](const std::vector<float>& v) { return v.data() + row; };
  const auto there = [row, shift](const std::vector<float>& v) { return v.data() + row + shift; };
  const float *nx = here(f.nx), *ny = here(f.ny), *nz = here(f.nz), *px = here(f.px), *py = here(f.py), *pz = here(f.pz);
  const float *mx = there(f.nx), *my = there(f.ny), *mz = there(f.nz), *qx = there(f.px), *qy = there(f.py), *qz = there(f.pz);
  const float *plane = here(f.plane), *cover = there(f.cover), *near = here(f.near);
  float *to = alike.data(), *far = off[0].data(), *farther = off[1].data();
  SUPPLE_ROWS_ARE_APART
  for (int x = first; x < last; ++x) {
    float facing = std::max(0.0F, nx[x] * mx[x] + ny[x] * my[x] + nz[x] * mz[x]);
    facing *= facing;
    facing *= facing;
    facing *= facing;
    facing *= facing;
    facing *= facing;
    to[x] = tap.kernel * facing * cover[x];
    const float ax = qx[x] - px[x], ay = qy[x] - py[x], az = qz[x] - pz[x];
    far[x] = std::abs(ax * nx[x] + ay * ny[x] + az * nz[x]) * (plane[x] * tap.plane_scale);
    farther[x] = far[x] + (ax * ax + ay * ay + az * az) * (near[x] * near[x]);
  }
}

/// Adds what the tap shows to the row y.
void add_tap(int width, int y, const Tap& tap, const Signal& signal, const std::vector<float>& cover, const std::vector<float>& alike,
             const std::vector<float>& off, Sums& sums) {
  const int first = std::max(0, -tap.dx), last = std::min(width, width - tap.dx);
  const auto row = static_cast<std::ptrdiff_t>(y) * width;
  const std::ptrdiff_t there = row + static_cast<std::ptrdiff_t>(tap.dy) * width + tap.dx;
  const float *noise = signal.noise.data() + row, *guide = signal.guide.data() + row, *other = signal.guide.data() + there;
  const float *r = signal.light.r.data() + there, *g = signal.light.g.data() + there, *b = signal.light.b.data() + there;
  const float *variance = signal.light.variance.data() + there, *same = alike.data(), *far = off.data(), *covered = cover.data() + there;
  float *sum_r = sums.r.data(), *sum_g = sums.g.data(), *sum_b = sums.b.data(), *sum_v = sums.variance.data(), *sum_w = sums.weight.data();
  const float own = tap.dx == 0 && tap.dy == 0 ? tap.kernel : 0.0F;  // a pixel is like itself, whatever its features
  SUPPLE_ROWS_ARE_APART
  for (int x = first; x < last; ++x) {
    const float w = std::max(own * covered[x], same[x] * fall(far[x] + std::abs(other[x] - guide[x]) * noise[x]));
    sum_r[x] += w * r[x];
    sum_g[x] += w * g[x];
    sum_b[x] += w * b[x];
    sum_v[x] += w * w * variance[x];
    sum_w[x] += w;
  }
}

/// to[x] += weight of a row that lies (dx, dy) pixels away, for the row y.
void add_row(int width, const float* from, int dx, float weight, float* to) {
  const int first = std::max(0, -dx), last = std::min(width, width - dx);
  for (int x = first; x < last; ++x) to[x] += weight * from[x + dx];
}

/// Means over neighbours that show a surface: what a single pixel knows of noise, brightness and nearness is noisy itself.
class Means {
 public:
  Means(int width, int height, int reach) : width_(width), height_(height), reach_(reach) {}
  /// Of `values` that are 0 where nothing is shown, for the row y.
  void of(const std::vector<float>& values, int y, std::vector<float>& to) const {
    to.assign(static_cast<std::size_t>(width_), 0.0F);
    for (int dy = -reach_; dy <= reach_; ++dy) {
      if (y + dy < 0 || y + dy >= height_) continue;
      const float* row = values.data() + static_cast<std::ptrdiff_t>(y + dy) * width_;
      for (int dx = -reach_; dx <= reach_; ++dx)
        add_row(width_, row, dx, static_cast<float>((reach_ + 1 - std::abs(dx)) * (reach_ + 1 - std::abs(dy))), to.data());
    }
  }

 private:
  int width_;
  int height_;
  int reach_;
};

/// Pixels around one where surfaces meet that show one surface each; empty places have no weight.
struct Neighbours {
  static constexpr int kMost = 32;
  using Numbers = Eigen::Array<float, kMost, 1>;
  using Vectors = Eigen::Array<float, kMost, 3>;
  Vectors normal = Vectors::Zero(), position = Vectors::Zero(), light = Vectors::Zero();
  Numbers plane = Numbers::Zero();
  Numbers weight = Numbers::Zero();
  Vec3f own = Vec3f::Zero();  ///< light of the pixel itself

  /// What falls on a facet of the pixel from the sky and other surfaces, by the neighbours on the same surface.
  [[nodiscard]] Vec3f light_of(const Facet& facet) const {
    const Vec3f &n = facet.normal, &p = facet.position;
    const Numbers facing = (normal.col(0) * n.x() + normal.col(1) * n.y() + normal.col(2) * n.z()).max(0.0F);
    const Numbers off = ((p.x() - position.col(0)) * n.x() + (p.y() - position.col(1)) * n.y() + (p.z() - position.col(2)) * n.z()).abs();
    const Numbers w = weight * facing.square().square().square() * (off * plane).unaryExpr([](float t) { return fall(t); });
    constexpr float kOwn = 1e-4F;  // alone where no neighbour is alike
    const Vec3f sum = (light.colwise() * w).colwise().sum().matrix().transpose();
    return (kOwn * own + sum) / (kOwn + w.sum());
  }
};

class Filter {
 public:
  Filter(int width, int height, const Executor& executor) : width_(width), height_(height), executor_(executor) {}

  void fill(const Film& film, const Vec3f& eye, float footprint);
  /// One level of the transform.
  void smooth(int stride);
  void finish(Film& film) const;

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }
  template <class Body>
  void rows(const Body& body) const {
    executor_.for_blocks(static_cast<std::size_t>(height_), 4, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) body(y);
    });
  }
  void guide(int y, Signal& signal) const;
  [[nodiscard]] Neighbours around(std::size_t pixel) const;

  int width_;
  int height_;
  const Executor& executor_;
  Features f_;
  std::array<Signal, 2> signals_;    ///< direct, indirect
  std::vector<std::uint8_t> mixed_;  ///< whether surfaces meet in a pixel
};

void Filter::fill(const Film& film, const Vec3f& eye, float footprint) {
  const std::size_t pixels = film.radiance.size();
  for (auto* v : {&f_.nx, &f_.ny, &f_.nz, &f_.px, &f_.py, &f_.pz, &f_.plane, &f_.near, &f_.shown}) v->resize(pixels);
  f_.cover = film.cover;
  mixed_.assign(pixels, 0);
  for (const DetailedPixel& detailed : film.detailed) mixed_[detailed.pixel] = detailed.detail == Detail::Surfaces ? 1 : 0;
  for (Signal& signal : signals_) signal = Signal(pixels);
  rows([&](int y) {
    thread_local std::vector<float> near, cover;
    const Means means(width_, height_, 2);
    means.of(film.nearness, y, near);
    means.of(film.cover, y, cover);
    for (int x = 0; x < width_; ++x) {
      const std::size_t i = index(x, y);
      const auto at = static_cast<std::size_t>(x);
      if (film.cover[i] <= 0.0F) continue;
      const Vec3f albedo = film.albedo[i].cwiseMax(kAlbedoFloor);
      const float scale = 1.0F / luminance(albedo);
      for (std::size_t k = 0; k < 2; ++k) {
        const FilmLight& part = k == 0 ? film.direct : film.indirect;
        const Vec3f falls = part.radiance[i].cwiseQuotient(albedo);
        Signal& signal = signals_[k];
        signal.light.r[i] = falls.x();
        signal.light.g[i] = falls.y();
        signal.light.b[i] = falls.z();
        signal.light.variance[i] = part.variance[i] * scale * scale;
        signal.bright[i] = luminance(falls);
      }
      signals_[0].scale[i] = kDirectScale;
      signals_[1].scale[i] = kMattScale + film.mirror[i] * (kMirrorScale - kMattScale);
      f_.nx[i] = film.normal[i].x();
      f_.ny[i] = film.normal[i].y();
      f_.nz[i] = film.normal[i].z();
      f_.px[i] = film.position[i].x();
      f_.py[i] = film.position[i].y();
      f_.pz[i] = film.position[i].z();
      f_.shown[i] = 1.0F;
      f_.near[i] = kNearScale * near[at] / cover[at];
      f_.plane[i] = 1.0F / (2.0F * footprint * (film.position[i] - eye).norm() + 1e-12F);
    }
  });
}

void Filter::guide(int y, Signal& signal) const {
  thread_local std::vector<float> weights, variance, bright;
  const Means means(width_, height_, 1);
  means.of(f_.shown, y, weights);
  means.of(signal.light.variance, y, variance);
  means.of(signal.bright, y, bright);
  const std::size_t row = index(0, y);
  for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) {
    const float share = 1.0F / std::max(weights[x], 1.0F);
    signal.noise[row + x] = 1.0F / (signal.scale[row + x] * std::sqrt(variance[x] * share) + 1e-4F);
    signal.guide[row + x] = bright[x] * share;
  }
}

void Filter::smooth(int stride) {
  rows([&](int y) {
    for (Signal& signal : signals_) guide(y, signal);
  });
  rows([&](int y) {
    thread_local std::array<Sums, 2> sums;
    thread_local std::vector<float> alike;
    thread_local std::array<std::vector<float>, 2> off;
    for (Sums& s : sums) s.clear(static_cast<std::size_t>(width_));
    alike.resize(static_cast<std::size_t>(width_));
    for (auto& o : off) o.resize(static_cast<std::size_t>(width_));
    for (int dy = -1; dy <= 1; ++dy) {
      if (y + dy * stride < 0 || y + dy * stride >= height_) continue;
      for (int dx = -1; dx <= 1; ++dx) {
        const Tap tap{.dx = dx * stride, .dy = dy * stride,
                      .kernel = kKernel[static_cast<std::size_t>(std::abs(dx))] * kKernel[static_cast<std::size_t>(std::abs(dy))],
                      .plane_scale = 1.0F / static_cast<float>(stride)};
        compare_features(width_, y, tap, f_, alike, off);
        for (std::size_t k = 0; k < 2; ++k) add_tap(width_, y, tap, signals_[k], f_.cover, alike, off[k], sums[k]);
      }
    }
    for (std::size_t k = 0; k < 2; ++k)
      for (int x = 0; x < width_; ++x) {
        const auto i = static_cast<std::size_t>(x);
        if (!(sums[k].weight[i] > 0.0F)) continue;
        const float share = 1.0F / sums[k].weight[i];
        Planes& next = signals_[k].next;
        next.r[index(x, y)] = share * sums[k].r[i];
        next.g[index(x, y)] = share * sums[k].g[i];
        next.b[index(x, y)] = share * sums[k].b[i];
        next.variance[index(x, y)] = share * share * sums[k].variance[i];
        signals_[k].bright[index(x, y)] = share * luminance(Vec3f(sums[k].r[i], sums[k].g[i], sums[k].b[i]));
      }
  });
  for (Signal& signal : signals_) std::swap(signal.light, signal.next);
}

void Filter::finish(Film& film) const {
  const Planes &direct = signals_[0].light, &indirect = signals_[1].light;
  for (std::size_t i = 0; i < film.radiance.size(); ++i) {
    if (film.cover[i] <= 0.0F) continue;
    const Vec3f falls(direct.r[i] + indirect.r[i], direct.g[i] + indirect.g[i], direct.b[i] + indirect.b[i]);
    film.radiance[i] = falls.cwiseProduct(film.albedo[i].cwiseMax(kAlbedoFloor));
  }
  executor_.for_blocks(film.detailed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DetailedPixel& detailed = film.detailed[k];
      if (detailed.detail != Detail::Surfaces) continue;
      const std::size_t pixel = detailed.pixel;
      const Neighbours neighbours = around(pixel);
      Vec3f sum = Vec3f::Zero();
      float cover = 0.0F;
      for (const Facet& facet : std::span(film.facets).subspan(detailed.facets, detailed.rays)) {
        if (facet.cover <= 0.0F) continue;
        sum += facet.cover * neighbours.light_of(facet).cwiseProduct(facet.albedo.cwiseMax(kAlbedoFloor));
        cover += facet.cover;
      }
      if (cover > 0.0F) film.radiance[pixel] = film.direct.radiance[pixel] + sum / cover;
    }
  });
}

Neighbours Filter::around(std::size_t pixel) const {
  constexpr int kReach = 2;
  const Planes& light = signals_[1].light;
  const int x = static_cast<int>(pixel % static_cast<std::size_t>(width_)), y = static_cast<int>(pixel / static_cast<std::size_t>(width_));
  Neighbours out;
  out.own = Vec3f(light.r[pixel], light.g[pixel], light.b[pixel]);
  Eigen::Index k = 0;
  for (int py = std::max(0, y - kReach); py <= std::min(height_ - 1, y + kReach); ++py)
    for (int px = std::max(0, x - kReach); px <= std::min(width_ - 1, x + kReach); ++px) {
      const std::size_t i = index(px, py);
      if (f_.cover[i] <= 0.0F || mixed_[i] != 0) continue;
      out.normal.row(k) << f_.nx[i], f_.ny[i], f_.nz[i];
      out.position.row(k) << f_.px[i], f_.py[i], f_.pz[i];
      out.light.row(k) << light.r[i], light.g[i], light.b[i];
      out.plane[k] = f_.plane[i];
      out.weight[k] = f_.cover[i] / static_cast<float>((px - x) * (px - x) + (py - y) * (py - y));
      ++k;
    }
  return out;
}

}  // namespace

void denoise(int width, int height, const Vec3f& eye, float footprint, const Executor& executor, Film& film) {
  Filter filter(width, height, executor);
  filter.fill(film, eye, footprint);
  for (int level = 0; level < kLevels; ++level) filter.smooth(1 << level);
  filter.finish(film);
}

}  // namespace supple::render::path
