#include "denoise.h"

#include <cmath>
#include <span>

namespace supple::render::path {
namespace {

constexpr int kLevels = 5;
static_assert((1 << (kLevels - 1)) <= Plane::kMargin);
constexpr float kAlbedoFloor = 0.02F;
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

bool SurfacePart::take(const Sample& sample, const Vec3f& falls) {
  constexpr float kSameSide = 0.8F;
  if (count > 0.0F && normal.dot(sample.facet.normal) < kSameSide * count) return false;
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
  Lanes r{}, g{}, b{}, variance{}, weight{};
  void add(const Light& light, int x, int y, Lanes w) {
    r += w * light.r.load(x, y);
    g += w * light.g.load(x, y);
    b += w * light.b.load(x, y);
    variance += w * w * light.variance.load(x, y);
    weight += w;
  }
  /// What lies there already, in those lanes.
  void keep(const Light& light, int x, int y, LaneMask who) {
    r = select(who, light.r.load(x, y), r);
    g = select(who, light.g.load(x, y), g);
    b = select(who, light.b.load(x, y), b);
    variance = select(who, light.variance.load(x, y), variance);
    weight = select(who, all_lanes(1.0F), weight);
  }
  /// @param shown  lanes with a surface; the others stay empty
  void store(Light& light, int x, int y, LaneMask shown) const {
    const Lanes share = select(both(shown, weight > 0.0F), 1.0F / weight, 0.0F);
    light.r.store(x, y, share * r);
    light.g.store(x, y, share * g);
    light.b.store(x, y, share * b);
    light.variance.store(x, y, share * share * variance);
    light.bright.store(x, y, share * luminance(Vec3Lanes(r, g, b)));
  }
};

template <class Body>
void Denoiser::rows(const Body& body) const {
  executor_->for_blocks(static_cast<std::size_t>(height_), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) body(y);
  });
}

/// Eight pixels at a time, and whether some show a surface.
template <class Body>
void Denoiser::blocks(int y, const Body& body) const {
  for (int x = 0; x < width_; x += static_cast<int>(kLanes)) body(x, any(f_.shown.load(x, y) > 0.0F));
}

/// Those of which some do.
template <class Body>
void Denoiser::shown_blocks(int y, const Body& body) const {
  blocks(y, [&](int x, bool shown) {
    if (shown) body(x);
  });
}

void Denoiser::resize(int width, int height) {
  if (width == width_ && height == height_) return;
  width_ = width;
  height_ = height;
  for (Plane* plane : {&f_.nx, &f_.ny, &f_.nz, &f_.px, &f_.py, &f_.pz, &f_.cover, &f_.shown, &f_.share, &f_.nearness, &f_.near, &f_.plane})
    plane->reset(width, height);
  for (Signal& signal : signals_) {
    for (Plane* plane : {&signal.noise, &signal.guide, &signal.scale}) plane->reset(width, height);
    for (Light* light : {&signal.light, &signal.next})
      for (Plane* plane : {&light->r, &light->g, &light->b, &light->variance, &light->bright}) plane->reset(width, height);
  }
}

void Denoiser::fill(const Film& film, const Vec3f& eye, float footprint) {
  mixed_.assign(film.radiance.size(), 0);
  parts_.clear();
  for (const DetailedPixel& detailed : film.detailed) {
    if (detailed.detail != Detail::Surfaces) continue;
    std::array<SurfacePart, 2>& parts = parts_.emplace_back();
    mixed_[detailed.pixel] = static_cast<std::uint32_t>(parts_.size());
    if (!detailed.walks) continue;
    for (const Sample& sample : std::span(film.detailed_samples).subspan(detailed.samples, detailed.rays)) {
      if (sample.facet.cover <= 0.0F) continue;
      const Vec3f falls = sample.indirect.cwiseQuotient(sample.facet.albedo.cwiseMax(kAlbedoFloor));
      if (!parts[0].take(sample, falls)) parts[1].take(sample, falls);
    }
  }
  Light &direct = signals_[0].light, &indirect = signals_[1].light;
  const std::array summed = {&f_.cover, &f_.shown, &f_.nearness, &direct.variance, &direct.bright, &indirect.variance, &indirect.bright};
  rows([&](int y) {
    for (int x = 0; x < width_; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
      if (film.cover[i] <= 0.0F) {
        for (Plane* plane : summed) plane->at(x, y) = 0.0F;
        continue;
      }
      f_.nearness.at(x, y) = film.nearness[i];
      const Vec3f albedo = film.albedo[i].cwiseMax(kAlbedoFloor);
      const float scale = 1.0F / luminance(albedo);
      for (std::size_t k = 0; k < 2; ++k) {
        const FilmLight& part = k == 0 ? film.direct : film.indirect;
        const Vec3f falls = part.radiance[i].cwiseQuotient(albedo);
        Light& light = signals_[k].light;
        light.r.at(x, y) = falls.x();
        light.g.at(x, y) = falls.y();
        light.b.at(x, y) = falls.z();
        light.variance.at(x, y) = part.variance[i] * scale * scale;
        light.bright.at(x, y) = luminance(falls);
      }
      signals_[0].scale.at(x, y) = kDirectScale;
      signals_[1].scale.at(x, y) = kMattScale + film.mirror[i] * (kMirrorScale - kMattScale);
      f_.nx.at(x, y) = film.normal[i].x();
      f_.ny.at(x, y) = film.normal[i].y();
      f_.nz.at(x, y) = film.normal[i].z();
      f_.px.at(x, y) = film.position[i].x();
      f_.py.at(x, y) = film.position[i].y();
      f_.pz.at(x, y) = film.position[i].z();
      f_.cover.at(x, y) = film.cover[i];
      f_.shown.at(x, y) = 1.0F;
      f_.plane.at(x, y) = 1.0F / (2.0F * footprint * (film.position[i] - eye).norm() + 1e-12F);
    }
  });
  rows([&](int y) {
    shown_blocks(y, [&](int x) {
      f_.near.store(x, y, kNearScale * tent_sum<2>(f_.nearness, x, y) / tent_sum<2>(f_.cover, x, y));
      f_.share.store(x, y, 1.0F / larger(tent_sum<1>(f_.shown, x, y), 1.0F));
    });
  });
}

/// Means over neighbours: what a single pixel knows of noise and brightness is noisy itself.
void Denoiser::guide(int y) {
  shown_blocks(y, [&](int x) {
    const Lanes share = f_.share.load(x, y);
    for (Signal& signal : signals_) {
      const Lanes error = root(share * tent_sum<1>(signal.light.variance, x, y));
      signal.noise.store(x, y, 1.0F / (signal.scale.load(x, y) * error + 1e-4F));
      signal.guide.store(x, y, share * tent_sum<1>(signal.light.bright, x, y));
    }
  });
}

template <bool with_direct>
void Denoiser::smooth_block(int stride, int x, int y, LaneMask shown, LaneMask quiet) {
  const auto vector = [](const Plane& a, const Plane& b, const Plane& c, int px, int py) {
    return Vec3Lanes(a.load(px, py), b.load(px, py), c.load(px, py));
  };
  const Vec3Lanes normal = vector(f_.nx, f_.ny, f_.nz, x, y), position = vector(f_.px, f_.py, f_.pz, x, y);
  const Lanes plane = f_.plane.load(x, y) * (1.0F / static_cast<float>(stride)), near = f_.near.load(x, y);
  const std::array<Lanes, 2> guide = {signals_[0].guide.load(x, y), signals_[1].guide.load(x, y)};
  const std::array<Lanes, 2> noise = {signals_[0].noise.load(x, y), signals_[1].noise.load(x, y)};
  constexpr std::size_t first = with_direct ? 0 : 1;
  std::array<Sums, 2> sums;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      const int px = x + dx * stride, py = y + dy * stride;
      const float kernel = kKernel[static_cast<std::size_t>(std::abs(dx))] * kKernel[static_cast<std::size_t>(std::abs(dy))];
      const Lanes covered = kernel * f_.cover.load(px, py);
      if (dx == 0 && dy == 0) {  // a pixel is like itself, whatever its features
        for (std::size_t k = first; k < 2; ++k) sums[k].add(signals_[k].light, px, py, covered);
        continue;
      }
      const Lanes facing = larger(normal.dot(vector(f_.nx, f_.ny, f_.nz, px, py)), 0.0F);
      const Vec3Lanes apart = vector(f_.px, f_.py, f_.pz, px, py) - position;
      const Lanes off = magnitude(apart.dot(normal)) * plane;
      const std::array<Lanes, 2> far = {off, off + apart.dot(apart) * (near * near)};
      const Lanes alike = covered * thirty_second_power(facing);
      for (std::size_t k = first; k < 2; ++k) {
        const Lanes differs = magnitude(signals_[k].guide.load(px, py) - guide[k]) * noise[k];
        sums[k].add(signals_[k].light, px, py, alike * fall(far[k] + differs));
      }
    }
  sums[0].keep(signals_[0].light, x, y, quiet);
  for (std::size_t k = 0; k < 2; ++k) sums[k].store(signals_[k].next, x, y, shown);
}

void Denoiser::smooth(int stride) {
  rows([&](int y) { guide(y); });
  rows([&](int y) {
    blocks(y, [&](int x, bool any_shown) {
      if (any_shown) {
        const LaneMask shown = f_.shown.load(x, y) > 0.0F;
        const LaneMask quiet = signals_[0].noise.load(x, y) * (kQuiet * (signals_[0].guide.load(x, y) + 0.1F)) > 1.0F;
        return any(both(shown, ~quiet)) ? smooth_block<true>(stride, x, y, shown, quiet) : smooth_block<false>(stride, x, y, shown, quiet);
      }
      for (Signal& signal : signals_) Sums{}.store(signal.next, x, y, LaneMask{});
    });
  });
  for (Signal& signal : signals_) std::swap(signal.light, signal.next);
}

void Denoiser::finish(Film& film) const {
  const Light &direct = signals_[0].light, &indirect = signals_[1].light;
  rows([&](int y) {
    for (int x = 0; x < width_; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
      if (film.cover[i] <= 0.0F) continue;
      const Vec3f falls(direct.r.at(x, y) + indirect.r.at(x, y), direct.g.at(x, y) + indirect.g.at(x, y),
                        direct.b.at(x, y) + indirect.b.at(x, y));
      film.radiance[i] = falls.cwiseProduct(film.albedo[i].cwiseMax(kAlbedoFloor));
    }
  });
  executor_->for_blocks(film.detailed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DetailedPixel& detailed = film.detailed[k];
      if (detailed.detail != Detail::Surfaces) continue;
      const std::size_t pixel = detailed.pixel;
      const Neighbours neighbours = around(pixel);
      Vec3f sum = Vec3f::Zero();
      float cover = 0.0F;
      for (const Sample& sample : std::span(film.detailed_samples).subspan(detailed.samples, detailed.rays)) {
        if (sample.facet.cover <= 0.0F) continue;
        sum += sample.facet.cover * neighbours.light_of(sample.facet).cwiseProduct(sample.facet.albedo.cwiseMax(kAlbedoFloor));
        cover += sample.facet.cover;
      }
      if (cover > 0.0F) film.radiance[pixel] = film.direct.radiance[pixel] + sum / cover;
    }
  });
}

Neighbours Denoiser::around(std::size_t pixel) const {
  constexpr int kReach = 2;
  constexpr float kPaths = 32.0F;  // that tell as much as a filtered pixel
  const Light& light = signals_[1].light;
  const int x = static_cast<int>(pixel % static_cast<std::size_t>(width_));
  const int y = static_cast<int>(pixel / static_cast<std::size_t>(width_));
  Neighbours out;
  out.own = Vec3f(light.r.at(x, y), light.g.at(x, y), light.b.at(x, y));
  for (int py = std::max(0, y - kReach); py <= std::min(height_ - 1, y + kReach); ++py)
    for (int px = std::max(0, x - kReach); px <= std::min(width_ - 1, x + kReach); ++px) {
      if (f_.cover.at(px, py) <= 0.0F) continue;
      const float closeness = 1.0F / std::max(0.5F, static_cast<float>((px - x) * (px - x) + (py - y) * (py - y)));
      const float plane = f_.plane.at(px, py);
      const std::uint32_t mixed = mixed_[static_cast<std::size_t>(py) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(px)];
      if (mixed == 0) {
        out.add({f_.nx.at(px, py), f_.ny.at(px, py), f_.nz.at(px, py)}, {f_.px.at(px, py), f_.py.at(px, py), f_.pz.at(px, py)},
                {light.r.at(px, py), light.g.at(px, py), light.b.at(px, py)}, plane, f_.cover.at(px, py) * closeness);
        continue;
      }
      for (const SurfacePart& part : parts_[mixed - 1])
        if (part.count > 0.0F)
          out.add(part.normal.normalized(), part.position / part.count, part.light / part.count, plane, closeness * part.count / kPaths);
    }
  return out;
}

void Denoiser::run(int width, int height, const Vec3f& eye, float footprint, const Executor& executor, Film& film) {
  executor_ = &executor;
  resize(width, height);
  fill(film, eye, footprint);
  for (int level = 0; level < kLevels; ++level) smooth(1 << level);
  finish(film);
}

}  // namespace supple::render::path
