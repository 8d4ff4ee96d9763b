#include "integrator.h"

#include <algorithm>
#include <array>
#include <span>

#include "details.h"

namespace supple::render::path {
namespace {

constexpr int kTile = 8;
constexpr std::uint32_t kRaysAPath = 2;    // camera rays of a pixel of which one goes on beyond its first surface
constexpr std::uint32_t kDetailStream = 0xfffffff0u;  // those of tiles begin at 0

/// Sums of a part of the light of a pixel.
struct LightSum {
  Vec3f radiance = Vec3f::Zero();
  float bright = 0.0F;
  float bright2 = 0.0F;
  float weight = 0.0F;
  float count = 0.0F;

  void add(const Vec3f& light, float share = 1.0F) {
    radiance += share * light;
    const float y = luminance(light);
    bright += share * y;
    bright2 += share * y * y;
    weight += share;
    count += 1.0F;
  }
  /// Of the mean, estimated as if the samples were independent (stratified ones do better).
  [[nodiscard]] float variance() const {
    return count < 2.0F ? 0.0F : std::max(0.0F, bright2 / weight - mean() * mean()) / (count - 1.0F);
  }
  [[nodiscard]] float mean() const { return count > 0.0F ? bright / weight : 0.0F; }
};

/// Sums of the samples of a pixel.
struct Sums {
  LightSum direct, indirect;
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  float cover = 0.0F;
  float walked_cover = 0.0F;  ///< of the samples that know of indirect light
  float nearness = 0.0F;
  float mirror = 0.0F;

  void add(const Sample& s) {
    direct.add(s.facet.cover * s.direct);
    albedo += s.facet.cover * s.facet.albedo;
    normal += s.facet.cover * s.facet.normal;
    position += s.facet.cover * s.facet.position;
    cover += s.facet.cover;
    add_indirect(s);
  }
  void add_indirect(const Sample& s) {
    if (!(s.weight > 0.0F)) return;
    indirect.add(s.facet.cover * s.indirect, s.weight);
    const float cover_of_path = s.weight * s.facet.cover;
    walked_cover += cover_of_path;
    nearness += cover_of_path * s.nearness;
    mirror += cover_of_path * s.mirror;
  }
};

/// Hands samples over in the order of their picks, made by bundles.
template <class Take>
class Bundler {
 public:
  Bundler(const Tracer& tracer, const Take& take) : tracer_(tracer), take_(take) {}
  void add(const Pick& pick) {
    picks_[count_++] = pick;
    if (count_ == kLanes) flush();
  }
  void flush() {
    tracer_.sample(std::span(picks_.data(), count_), samples_);
    for (std::size_t i = 0; i < count_; ++i) take_(picks_[i], samples_[i]);
    count_ = 0;
  }

 private:
  const Tracer& tracer_;
  Take take_;
  std::array<Pick, kLanes> picks_;
  std::array<Sample, kLanes> samples_;
  std::size_t count_ = 0;
};

/// Pixels [left, right) x [top, bottom).
struct Window {
  int left = 0, top = 0, right = 0, bottom = 0;
  template <class Body>
  void for_pixels(const Body& body) const {
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) body(x, y);
  }
};

/// Variances of means of the luminance.
struct Variance {
  float direct = 0.0F;
  float indirect = 0.0F;
};

/// The pixels of a tile, and what they tell of their noise.
class Tile {
 public:
  explicit Tile(const Window& window) : window_(window) {}
  [[nodiscard]] Sums& at(int x, int y) { return sums_[inside(x, y)]; }
  [[nodiscard]] const Sums& at(int x, int y) const { return sums_[inside(x, y)]; }
  [[nodiscard]] const Variance& variance(int x, int y) const { return variance_[inside(x, y)]; }

  /// @return mean over all pixels of their squared standard error over (luminance + 0.1) squared
  float estimate_errors() {
    // One path a pixel knows nothing of its noise: at most what pixels differ by.
    LightSum spread;
    window_.for_pixels([&](int x, int y) {
      const Sums& sum = at(x, y);
      if (sum.walked_cover > 0.0F) spread.add(sum.indirect.radiance / sum.indirect.weight);
    });
    const float between = spread.variance() * spread.count;
    float error2 = 0.0F;
    window_.for_pixels([&](int x, int y) {
      const Sums& sum = at(x, y);
      if (sum.cover <= 0.0F) return;
      Variance& variance = variance_[inside(x, y)];
      variance.direct = sum.direct.count < 2.0F ? bend(x, y) : sum.direct.variance();
      variance.indirect = sum.indirect.count < 2.0F ? between : sum.indirect.variance();
      const float scale = sum.direct.mean() + sum.indirect.mean() + 0.1F;
      error2 += (variance.direct + variance.indirect) / (scale * scale);
    });
    return error2 / static_cast<float>((window_.right - window_.left) * (window_.bottom - window_.top));
  }

 private:
  [[nodiscard]] std::size_t inside(int x, int y) const { return static_cast<std::size_t>((y - window_.top) * kTile + x - window_.left); }
  /// Variance of a single sample of direct light by second differences of neighbours, which light that changes evenly does not
  /// have: in the mean at least the true one.
  [[nodiscard]] float bend(int x, int y) const {
    float sum = 0.0F, count = 0.0F;
    const auto add = [&](int cx, int cy, int dx, int dy) {
      const float d = at(cx, cy).direct.mean() - 0.5F * (at(cx - dx, cy - dy).direct.mean() + at(cx + dx, cy + dy).direct.mean());
      sum += d * d / 1.5F;  // the variance of d is 1 + 2 / 4 times that of a sample
      count += 1.0F;
    };
    if (window_.right - window_.left > 2) add(std::clamp(x, window_.left + 1, window_.right - 2), y, 1, 0);
    if (window_.bottom - window_.top > 2) add(x, std::clamp(y, window_.top + 1, window_.bottom - 2), 0, 1);
    const float mean = at(x, y).direct.mean();
    return count > 0.0F ? sum / count : mean * mean;
  }

  Window window_;
  std::array<Sums, kTile * kTile> sums_;
  std::array<Variance, kTile * kTile> variance_;
};

/// Fills a film.
class Exposure {
 public:
  Exposure(const Tracer& tracer, const TraceSettings& settings, const Executor& executor, Film& film)
      : tracer_(tracer), settings_(settings), executor_(executor), film_(film),
        most_(static_cast<std::uint32_t>(settings.most_samples)),
        least_(std::min(static_cast<std::uint32_t>(settings.least_samples), most_)) {}

  void clear() const;
  void expose_tiles() const;
  void expose_details() const;

 private:
  template <class Body>
  void for_tiles(const Body& body) const {
    const auto across = static_cast<std::size_t>((settings_.width + kTile - 1) / kTile);
    const auto down = static_cast<std::size_t>((settings_.height + kTile - 1) / kTile);
    executor_.for_blocks(across * down, 1, [&](std::size_t tile, std::size_t) {
      const int left = static_cast<int>(tile % across) * kTile, top = static_cast<int>(tile / across) * kTile;
      body(Window{left, top, std::min(left + kTile, settings_.width), std::min(top + kTile, settings_.height)});
    });
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(settings_.width) + static_cast<std::size_t>(x);
  }
  std::uint32_t sample_until_quiet(const Window& window, Tile& tile) const;
  void keep_surface(std::size_t i, const Sums& sum, std::uint32_t count, float variance) const;
  void keep_paths(std::size_t i, const Sums& sum, std::uint32_t count, float variance) const;

  const Tracer& tracer_;
  const TraceSettings& settings_;
  const Executor& executor_;
  Film& film_;
  std::uint32_t most_;
  std::uint32_t least_;
};

void Exposure::clear() const {
  const auto pixels = static_cast<std::size_t>(settings_.width) * static_cast<std::size_t>(settings_.height);
  film_.radiance.assign(pixels, Vec3f::Zero());
  for (FilmLight* light : {&film_.direct, &film_.indirect}) {
    light->radiance.assign(pixels, Vec3f::Zero());
    light->variance.assign(pixels, 0.0F);
  }
  film_.cover.assign(pixels, 0.0F);
  film_.albedo.assign(pixels, Vec3f::Zero());
  film_.normal.assign(pixels, Vec3f::Zero());
  film_.position.assign(pixels, Vec3f::Zero());
  film_.nearness.assign(pixels, 0.0F);
  film_.mirror.assign(pixels, 0.0F);
  film_.samples.assign(pixels, 0);
}

/// What camera rays alone tell of a pixel. @param variance  of the mean luminance of its direct light
void Exposure::keep_surface(std::size_t i, const Sums& sum, std::uint32_t count, float variance) const {
  film_.samples[i] = count;
  film_.cover[i] = sum.cover / static_cast<float>(count);
  if (sum.cover <= 0.0F) return;
  const float scale = 1.0F / film_.cover[i];
  film_.direct.radiance[i] = sum.direct.radiance * (scale / sum.direct.count);
  film_.direct.variance[i] = variance * scale * scale;
  film_.radiance[i] = film_.direct.radiance[i] + film_.indirect.radiance[i];
  film_.albedo[i] = sum.albedo / sum.cover;
  film_.normal[i] = sum.normal / sum.cover;
  film_.position[i] = sum.position / sum.cover;
}

/// What the paths of a pixel tell. @param variance  of the mean luminance of its indirect light
void Exposure::keep_paths(std::size_t i, const Sums& sum, std::uint32_t count, float variance) const {
  if (!(sum.walked_cover > 0.0F)) return;
  const float cover = sum.cover / static_cast<float>(count);
  film_.indirect.radiance[i] = sum.indirect.radiance / sum.walked_cover;
  film_.indirect.variance[i] = variance / (cover * cover);
  film_.nearness[i] = cover * sum.nearness / sum.walked_cover;
  film_.mirror[i] = sum.mirror / sum.walked_cover;
}

/// @return camera rays a pixel
std::uint32_t Exposure::sample_until_quiet(const Window& window, Tile& tile) const {
  Bundler bundler(tracer_, [&](const Pick& pick, const Sample& sample) { tile.at(pick.x, pick.y).add(sample); });
  std::uint32_t n = 0;
  for (std::uint32_t next = least_;;) {
    const std::uint32_t count = next - n, share = std::min(kRaysAPath, count);
    window.for_pixels([&](int x, int y) {
      for (std::uint32_t s = 0; s < count; ++s) bundler.add({x, y, 2 * n, count, s, (n + s) % kRaysAPath == 0 ? share : 0});
    });
    bundler.flush();
    n = next;
    const bool quiet = tile.estimate_errors() <= static_cast<float>(settings_.noise * settings_.noise) && settings_.noise > 0.0;
    if (quiet || n >= most_) return n;
    next = std::min(2 * n, most_);
  }
}

void Exposure::expose_tiles() const {
  for_tiles([&](const Window& window) {
    Tile tile(window);
    const std::uint32_t n = sample_until_quiet(window, tile);
    // Where only rays without a path met a surface, those go on, too.
    Bundler late(tracer_, [&](const Pick& pick, const Sample& sample) {
      if (sample.facet.cover > 0.0F) tile.at(pick.x, pick.y).add_indirect(sample);
    });
    bool any_late = false;
    window.for_pixels([&](int x, int y) {
      const Sums& sum = tile.at(x, y);
      if (!(sum.cover > 0.0F) || sum.walked_cover > 0.0F) return;
      any_late = true;
      for (std::uint32_t first = 0, count = least_; first < n; first += count, count = first)
        for (std::uint32_t s = 0; s < count; ++s) late.add({x, y, 2 * first, count, s, 1});
    });
    late.flush();
    if (any_late) tile.estimate_errors();
    window.for_pixels([&](int x, int y) {
      const Sums& sum = tile.at(x, y);
      keep_paths(index(x, y), sum, n, tile.variance(x, y).indirect);
      keep_surface(index(x, y), sum, n, tile.variance(x, y).direct);
    });
  });
}

void Exposure::expose_details() const {
  executor_.for_blocks(film_.detailed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DetailedPixel& detailed = film_.detailed[k];
      const std::size_t i = detailed.pixel;
      const auto width = static_cast<std::size_t>(settings_.width);
      const int x = static_cast<int>(i % width), y = static_cast<int>(i / width);
      Sums anew;
      Bundler bundler(tracer_, [&](const Pick& pick, const Sample& sample) {
        anew.add(sample);
        if (detailed.detail == Detail::Surfaces) film_.detailed_samples[detailed.samples + pick.number] = sample;
      });
      const float before = film_.cover[i];
      const bool walks = detailed.walks || !(before > 0.0F);  // or nothing is known of its indirect light
      const std::uint32_t share = walks ? 1 : 0;
      for (std::uint32_t s = 0; s < detailed.rays; ++s) bundler.add({x, y, kDetailStream, detailed.rays, s, share, false});
      bundler.flush();
      keep_paths(i, anew, detailed.rays, anew.indirect.variance());
      keep_surface(i, anew, detailed.rays, anew.direct.variance());
      if (walks || !(film_.cover[i] > 0.0F)) continue;
      const float share_of_cover = film_.cover[i] / before;
      film_.nearness[i] *= share_of_cover;
      film_.indirect.variance[i] /= share_of_cover * share_of_cover;
    }
  });
}

}  // namespace

void trace(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
           const TraceSettings& settings, const Executor& executor, Film& film) {
  const Tracer tracer(geometry, lights, ground, camera, settings);
  const Exposure exposure(tracer, settings, executor, film);
  exposure.clear();
  exposure.expose_tiles();
  find_details(camera, settings, executor, film);
  exposure.expose_details();
}

}  // namespace supple::render::path
