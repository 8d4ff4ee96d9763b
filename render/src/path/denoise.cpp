#include "path/denoise.h"

#include <cmath>
#include <span>

namespace supple::render::path {
namespace {

constexpr int kLevels = 5;
static_assert((1 << (kLevels - 1)) <= Plane::kMargin);
constexpr float kReflectanceFloor = 0.02F;
constexpr float kNearScale = 2.5F;   // 1 / distance over which indirect light may change, times that of what it comes from
// Standard errors that count as the same. Edges of shadows are sharp, indirect light is known to be smooth by what is near,
// except in mirrors.
constexpr float kDirectScale = 1.0F, kMattScale = 16.0F, kMirrorScale = 2.0F;
constexpr float kQuiet = 0.002F;     // standard error over (brightness + 0.1) of direct light that stays as it is
constexpr std::array<float, 2> kKernel = {1.0F / 2.0F, 1.0F / 4.0F};

/// About exp(-t), for t >= 0.
template <class Number>
Number fall(Number t) {
  Number x = larger(1.0F - 0.125F * t, 0.0F);
  x *= x;
  x *= x;
  return x * x;
}

template <class Number>
Number thirty_second_power(Number x) {
  for (int k = 0; k < 5; ++k) x *= x;
  return x;
}

}  // namespace

bool SurfacePart::take(const Sample& sample, const Vec3f& falls, float steepness) {
  constexpr float kSameSide = 0.8F, kSamePlane = 4.0F;
  if (count > 0.0F) {
    if (normal.dot(sample.facet.normal) < kSameSide * count) return false;
    const float off = std::abs((sample.facet.position - position / count).dot(normal.normalized()));
    if (off * steepness > kSamePlane) return false;
  }
  normal += sample.facet.normal;
  position += sample.facet.position;
  light += falls;
  count += 1.0F;
  return true;
}

/// Surfaces around a pixel where surfaces meet: of pixels that show one each, and the parts of those where others meet; empty
/// places have no weight.
struct Neighbours {
  static constexpr int kMost = 48;
  using Numbers = Eigen::Array<float, kMost, 1>;
  using Vectors = Eigen::Array<float, kMost, 3>;
  Vectors normal = Vectors::Zero(), position = Vectors::Zero(), light = Vectors::Zero();
  Numbers plane = Numbers::Zero();
  Numbers weight = Numbers::Zero();
  Eigen::Index count = 0;
  Vec3f own = Vec3f::Zero();  ///< light of the pixel itself

  void add(const Vec3f& facing, const Vec3f& place, const Vec3f& falls, float flat, float share) {
    if (count == kMost) return;
    normal.row(count) = facing.array();
    position.row(count) = place.array();
    light.row(count) = falls.array();
    plane[count] = flat;
    weight[count++] = share;
  }
  /// What falls on a facet of the pixel from the sky and other surfaces, by the neighbours on the same surface.
  [[nodiscard]] Vec3f light_of(const Facet& facet) const {
    const Vec3f &n = facet.normal, &p = facet.position;
    const Numbers facing = (normal.col(0) * n.x() + normal.col(1) * n.y() + normal.col(2) * n.z()).max(0.0F);
    const Numbers x = p.x() - position.col(0), y = p.y() - position.col(1), z = p.z() - position.col(2);
    const Numbers far = (x * n.x() + y * n.y() + z * n.z()).abs() * plane;
    const Numbers w = weight * facing.square().square().square() * far.unaryExpr([](float t) { return fall(t); });
    constexpr float kOwn = 1e-4F;  // alone where no neighbour is alike
    const Vec3f sum = (light.colwise() * w).colwise().sum().matrix().transpose();
    return (kOwn * own + sum) / (kOwn + w.sum());
  }
};

/// Of eight pixels.
struct Denoiser::Sums {
  Vec3Lanes colour = Vec3Lanes::Zero();
  Lanes variance{}, weight{};
  void add(const Light& light, std::ptrdiff_t at, Lanes w) {
    colour += w * light.colour.load(at);
    variance += w * w * light.variance.load(at);
    weight += w;
  }
  /// What lies there already, in those lanes.
  void keep(const Light& light, std::ptrdiff_t at, LaneMask who) {
    colour = select(who, light.colour.load(at), colour);
    variance = select(who, light.variance.load(at), variance);
    weight = select(who, all_lanes(1.0F), weight);
  }
  /// @param shown  lanes with a surface; the others stay empty
  void store(Light& light, std::ptrdiff_t at, LaneMask shown) const {
    const Lanes share = select(both(shown, weight > 0.0F), 1.0F / weight, 0.0F);
    light.colour.store(at, share * colour);
    light.variance.store(at, share * share * variance);
    light.bright.store(at, share * luminance(colour));
  }
};

void Denoiser::Light::resize(int width, int height) {
  colour.resize(width, height);
  for (Plane* plane : {&variance, &bright}) plane->resize(width, height);
}

void Denoiser::Light::copy(const Light& from, std::ptrdiff_t at, bool is_there) {
  const Vec3Lanes same = from.colour.load(at);
  bright.store(at, luminance(same));
  if (is_there) return;
  colour.store(at, same);
  variance.store(at, from.variance.load(at));
}

template <class Body>
void Denoiser::rows(const Body& body) const {
  executor_->for_blocks(static_cast<std::size_t>(film_->height), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) body(y);
  });
}

/// Rows that lie `stride` apart one after the other: two of the three rows that a row needs are then in the nearest cache.
template <class Body>
void Denoiser::rows_apart(int stride, const Body& body) const {
  const int height = film_->height, longest = (height + stride - 1) / stride;
  executor_->for_blocks(static_cast<std::size_t>(stride * longest), 32, [&](std::size_t begin, std::size_t end) {
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      if (const int y = k / longest + k % longest * stride; y < height) body(y);
  });
}

/// Eight pixels at a time, by the first of them, and whether some show a surface.
template <class Body>
void Denoiser::blocks(int y, const Body& body) const {
  const std::ptrdiff_t begin = film_->cover.index(0, y), end = film_->cover.index(film_->width, y);
  for (std::ptrdiff_t at = begin; at < end; at += static_cast<std::ptrdiff_t>(kLanes)) body(at, any(film_->cover.load(at) > 0.0F));
}

/// Those of which some do.
template <class Body>
void Denoiser::shown_blocks(int y, const Body& body) const {
  blocks(y, [&](std::ptrdiff_t at, bool shown) {
    if (shown) body(at);
  });
}

template <class Vector>
auto Denoiser::steepness(const Vector& position) const {
  return 1.0F / (2.0F * footprint_ * Vector(position - Vector(eye_)).norm() + 1e-12F);  // at the eye itself
}

void Denoiser::resize() {
  const int width = film_->width, height = film_->height;
  for (Plane* plane : {&f_.shown, &f_.share, &f_.near}) plane->resize(width, height);
  for (Signal& signal : signals_) {
    signal.guide.resize(width, height);
    for (Light* light : {&signal.light, &signal.next}) light->resize(width, height);
  }
}

void Denoiser::fill() {
  const Film& film = *film_;
  const std::array parts = {&film.direct, &film.indirect};
  rows([&](int y) {
    blocks(y, [&](std::ptrdiff_t at, bool any_shown) {
      if (!any_shown) {
        f_.shown.store(at, Lanes{});
        for (Signal& signal : signals_) Sums{}.store(signal.light, at, LaneMask{});
        return;
      }
      const LaneMask shown = film.cover.load(at) > 0.0F;
      f_.shown.store(at, select(shown, all_lanes(1.0F), 0.0F));
      const Vec3Lanes reflectance = film.reflectance.load(at).cwiseMax(kReflectanceFloor);
      const Lanes scale = 1.0F / luminance(reflectance);
      for (std::size_t k = 0; k < 2; ++k) {
        const Vec3Lanes falls = parts[k]->radiance.load(at).cwiseQuotient(reflectance);
        Light& light = signals_[k].light;
        light.colour.store(at, falls);
        light.variance.store(at, parts[k]->variance.load(at) * scale * scale);
        light.bright.store(at, luminance(falls));
      }
    });
  });
  rows([&](int y) {
    shown_blocks(y, [&](std::ptrdiff_t at) {
      f_.near.store(at, kNearScale * tent_sum<2>(film.nearness, at) / tent_sum<2>(film.cover, at));
      f_.share.store(at, 1.0F / larger(tent_sum<1>(f_.shown, at), 1.0F));
    });
  });
}

/// Of pixels where surfaces meet in gaps, to the surfaces that they left.
void Denoiser::sort_paths() {
  const Film& film = *film_;
  mixed_.assign(static_cast<std::size_t>(film.width) * static_cast<std::size_t>(film.height), 0);
  parts_.clear();
  for (const DetailedPixel& detailed : film.detailed) {
    if (detailed.detail != Detail::Surfaces) continue;
    std::array<SurfacePart, 2>& parts = parts_.emplace_back();
    mixed_[index(detailed.x, detailed.y)] = static_cast<std::uint32_t>(parts_.size());
    if (!detailed.walks) continue;
    for (const Sample& sample : std::span(film.detailed_samples).subspan(detailed.samples, detailed.rays)) {
      if (sample.facet.cover <= 0.0F) continue;
      const Vec3f falls = sample.indirect.cwiseQuotient(sample.facet.reflectance.cwiseMax(kReflectanceFloor));
      const float steep = steepness(sample.facet.position);
      if (!parts[0].take(sample, falls, steep)) parts[1].take(sample, falls, steep);
    }
  }
}

/// Means over neighbours: the brightness and noise of a single pixel are noisy themselves.
void Denoiser::guide(int y) {
  shown_blocks(y, [&](std::ptrdiff_t at) {
    for (Signal& signal : signals_) signal.guide.store(at, f_.share.load(at) * tent_sum<1>(signal.light.bright, at));
  });
}

/// 1 / difference of brightness that counts as large, of direct and indirect light.
std::array<Lanes, 2> Denoiser::noise(std::ptrdiff_t at) const {
  const std::array scale = {all_lanes(kDirectScale), kMattScale + film_->mirror.load(at) * (kMirrorScale - kMattScale)};
  std::array<Lanes, 2> out;
  for (std::size_t k = 0; k < 2; ++k)
    out[k] = 1.0F / (scale[k] * root(f_.share.load(at) * tent_sum<1>(signals_[k].light.variance, at)) + 1e-4F);
  return out;
}

template <bool with_direct>
void Denoiser::smooth_block(int stride, std::ptrdiff_t at, const std::array<Lanes, 2>& noise, LaneMask shown, LaneMask quiet) {
  const Vec3Lanes normal = film_->normal.load(at), position = film_->position.load(at);
  const Lanes plane = steepness(position) * (1.0F / static_cast<float>(stride)), near = f_.near.load(at);
  const std::array<Lanes, 2> guide = {signals_[0].guide.load(at), signals_[1].guide.load(at)};
  constexpr std::size_t first = with_direct ? 0 : 1;
  std::array<Sums, 2> sums;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      const std::ptrdiff_t other = at + stride * film_->cover.index(dx, dy);
      const float kernel = kKernel[static_cast<std::size_t>(std::abs(dx))] * kKernel[static_cast<std::size_t>(std::abs(dy))];
      const Lanes covered = kernel * film_->cover.load(other);
      if (dx == 0 && dy == 0) {  // a pixel is like itself, whatever its features
        for (std::size_t k = first; k < 2; ++k) sums[k].add(signals_[k].light, at, covered);
        continue;
      }
      const Lanes facing = larger(normal.dot(film_->normal.load(other)), 0.0F);
      const Vec3Lanes apart = film_->position.load(other) - position;
      const Lanes off = magnitude(apart.dot(normal)) * plane;
      const std::array<Lanes, 2> far = {off, off + apart.dot(apart) * (near * near)};
      const Lanes alike = covered * thirty_second_power(facing);
      for (std::size_t k = first; k < 2; ++k) {
        const Lanes differs = magnitude(signals_[k].guide.load(other) - guide[k]) * noise[k];
        sums[k].add(signals_[k].light, other, alike * fall(far[k] + differs));
      }
    }
  sums[0].keep(signals_[0].light, at, quiet);
  for (std::size_t k = first; k < 2; ++k) sums[k].store(signals_[k].next, at, shown);
}

void Denoiser::smooth(int stride) {
  rows([&](int y) { guide(y); });
  const std::array<const VectorPlane*, 4> vectors = {&film_->normal, &film_->position, &signals_[0].light.colour, &signals_[1].light.colour};
  const std::array<const Plane*, 5> numbers = {&film_->cover, &signals_[0].guide, &signals_[1].guide, &signals_[0].light.variance,
                                               &signals_[1].light.variance};
  rows_apart(stride, [&](int y) {
    // More streams than processors follow on their own: the row that the next one needs is fetched along with this one.
    const std::ptrdiff_t ahead = film_->cover.index(0, std::min(2 * stride, film_->height - 1 - y));
    blocks(y, [&](std::ptrdiff_t at, bool any_shown) {
      for (const VectorPlane* plane : vectors) plane->prefetch(at + ahead);
      for (const Plane* plane : numbers) plane->prefetch(at + ahead);
      if (any_shown) {
        const LaneMask shown = film_->cover.load(at) > 0.0F;
        const std::array<Lanes, 2> large = noise(at);
        const LaneMask quiet = large[0] * (kQuiet * (signals_[0].guide.load(at) + 0.1F)) > 1.0F;
        std::uint8_t& kept = kept_[block(at)];
        if (any(both(shown, ~quiet))) {
          smooth_block<true>(stride, at, large, shown, quiet);
          kept = 0;
          return;
        }
        smooth_block<false>(stride, at, large, shown, quiet);
        signals_[0].next.copy(signals_[0].light, at, kept != 0);
        kept = 1;
        return;
      }
      if (stride > 1) return;  // both planes have zeros there from the first level on
      for (Signal& signal : signals_) Sums{}.store(signal.next, at, LaneMask{});
    });
  });
  for (Signal& signal : signals_) std::swap(signal.light, signal.next);
}

void Denoiser::finish(Film& film) const {
  rows([&](int y) {
    shown_blocks(y, [&](std::ptrdiff_t at) {
      const Vec3Lanes falls = signals_[0].light.colour.load(at) + signals_[1].light.colour.load(at);
      film.radiance.store(at, falls.cwiseProduct(film.reflectance.load(at).cwiseMax(kReflectanceFloor)));
    });
  });
  executor_->for_blocks(film.detailed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DetailedPixel& detailed = film.detailed[k];
      if (detailed.detail != Detail::Surfaces) continue;
      const Neighbours neighbours = around(detailed);
      Vec3f sum = Vec3f::Zero();
      float cover = 0.0F;
      for (const Sample& sample : std::span(film.detailed_samples).subspan(detailed.samples, detailed.rays)) {
        if (sample.facet.cover <= 0.0F) continue;
        sum += sample.facet.cover * neighbours.light_of(sample.facet).cwiseProduct(sample.facet.reflectance.cwiseMax(kReflectanceFloor));
        cover += sample.facet.cover;
      }
      if (cover > 0.0F) film.radiance.store(detailed.x, detailed.y, Vec3f(film.direct.radiance.at(detailed.x, detailed.y) + sum / cover));
    }
  });
}

Neighbours Denoiser::around(const DetailedPixel& pixel) const {
  constexpr int kReach = 2;
  constexpr float kPaths = 32.0F;  // paths that weigh as much as a filtered pixel
  const Film& film = *film_;
  const Light& light = signals_[1].light;
  const int x = pixel.x, y = pixel.y;
  Neighbours out;
  out.own = light.colour.at(x, y);
  for (int py = std::max(0, y - kReach); py <= std::min(film.height - 1, y + kReach); ++py)
    for (int px = std::max(0, x - kReach); px <= std::min(film.width - 1, x + kReach); ++px) {
      const float cover = film.cover.at(px, py);
      if (cover <= 0.0F) continue;
      const float closeness = 1.0F / std::max(0.5F, static_cast<float>((px - x) * (px - x) + (py - y) * (py - y)));
      const float plane = steepness(film.position.at(px, py));
      const std::uint32_t mixed = mixed_[index(px, py)];
      if (mixed == 0) {
        out.add(film.normal.at(px, py), film.position.at(px, py), light.colour.at(px, py), plane, cover * closeness);
        continue;
      }
      for (const SurfacePart& part : parts_[mixed - 1])
        if (part.count > 0.0F)
          out.add(part.normal.normalized(), part.position / part.count, part.light / part.count, plane, closeness * part.count / kPaths);
    }
  return out;
}

void Denoiser::run(const Vec3f& eye, float footprint, const Executor& executor, Film& film) {
  executor_ = &executor;
  film_ = &film;
  eye_ = eye;
  footprint_ = footprint;
  resize();
  kept_.assign(block(film.cover.index(0, film.height)), 0);
  sort_paths();
  fill();
  for (int level = 0; level < kLevels; ++level) smooth(1 << level);
  finish(film);
}

}  // namespace supple::render::path
