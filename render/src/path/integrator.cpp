#include "path/integrator.h"

#include <algorithm>
#include <array>

#include "path/details.h"

namespace supple::render::path {
namespace {

constexpr int kTile = 8;
constexpr std::uint32_t kRaysAPath = 2;    // camera rays of a pixel of which one goes on beyond its first surface
constexpr float kMirrorErrors = 8.0F;  // more, of squared errors that show as blotches
constexpr std::uint32_t kDetailStream = 0xfffffff0u;  // those of tiles begin at 0

/// Sums over a part of the light of a pixel, or of eight.
template <class Number>
struct LightSum {
  using Vector = typename LaneTypes<Number>::Vector;
  Vector radiance = Vector::Zero();
  Number bright{}, bright2{}, weight{}, count{};

  /// @param share  0: not this sample
  void add(const Vector& light, Number share) {
    radiance += light * share;
    const Number y = luminance(light);
    bright += share * y;
    bright2 += share * y * y;
    weight += share;
    count += select(share > 0.0F, constant<Number>(1.0F), 0.0F);
  }
  /// Of the mean, estimated as if the samples were independent (stratified ones do better).
  [[nodiscard]] Number variance() const {
    const Number average = mean();
    return select(count >= 2.0F, larger(bright2 / weight - average * average, 0.0F) / (count - 1.0F), 0.0F);
  }
  [[nodiscard]] Number mean() const { return select(count > 0.0F, bright / weight, 0.0F); }
};

/// Sums of the samples of a pixel, or of eight.
template <class Number>
struct Sums {
  using Vector = typename LaneTypes<Number>::Vector;
  LightSum<Number> direct, indirect;
  Vector albedo = Vector::Zero();
  Vector reflectance = Vector::Zero();
  Vector normal = Vector::Zero();
  Vector position = Vector::Zero();
  Number cover{};
  Number walked_cover{};  ///< of the samples with indirect light
  Number nearness{};
  Number mirror{};

  void add(const SampleOf<Number>& s, Number taken) {
    const FacetOf<Number>& facet = s.facet;
    direct.add(s.direct * facet.cover, taken);
    albedo += facet.albedo * facet.cover;
    reflectance += facet.reflectance * facet.cover;
    normal += facet.normal * facet.cover;
    position += facet.position * facet.cover;
    cover += facet.cover;
    add_indirect(s, s.weight);
  }
  void add_indirect(const SampleOf<Number>& s, Number weight) {
    const Number cover_of_path = weight * s.facet.cover;
    indirect.add(s.indirect * s.facet.cover, weight);
    walked_cover += cover_of_path;
    nearness += cover_of_path * s.nearness;
    mirror += cover_of_path * s.mirror;
  }
};

LightSum<float> total(const LightSum<Lanes>& sum) {
  return {.radiance = path::total(sum.radiance), .bright = path::total(sum.bright), .bright2 = path::total(sum.bright2),
          .weight = path::total(sum.weight), .count = path::total(sum.count)};
}

Sums<float> total(const Sums<Lanes>& sum) {
  return {.direct = total(sum.direct), .indirect = total(sum.indirect), .albedo = path::total(sum.albedo),
          .reflectance = path::total(sum.reflectance), .normal = path::total(sum.normal), .position = path::total(sum.position), .cover = path::total(sum.cover),
          .walked_cover = path::total(sum.walked_cover), .nearness = path::total(sum.nearness), .mirror = path::total(sum.mirror)};
}

/// Pixels [left, right) x [top, bottom), at most kTile across.
struct Window {
  int left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] int width() const { return right - left; }
  [[nodiscard]] int height() const { return bottom - top; }
  [[nodiscard]] LaneMask inside() const { return first_lanes(width()); }
};

/// The pixels of a row of a tile.
struct Row {
  Sums<Lanes> sums;
  Lanes direct_variance{}, indirect_variance{};  ///< of means of the luminance
};

/// The pixels of a tile, and estimates of their noise.
class Tile {
 public:
  explicit Tile(const Window& window) : window_(window) {}
  [[nodiscard]] Row& operator[](int y) { return rows_[static_cast<std::size_t>(y - window_.top)]; }

  /// @return mean over all pixels of their squared standard error over (luminance + 0.1) squared, in mirrors as many times as much
  float estimate_errors() {
    // One path per pixel says nothing about its noise, which is at most the difference between pixels; a few say little where light
    // is even except for rare dark paths: they count as if one of them were such a path.
    LightSum<Lanes> paths;
    for_rows([&](std::size_t, const Row& row) {
      const Sums<Lanes>& sum = row.sums;
      const LaneMask walked = sum.walked_cover > 0.0F;
      paths.add(select(walked, sum.indirect.radiance / sum.indirect.weight, Vec3Lanes::Zero()), select(walked, all_lanes(1.0F), 0.0F));
    });
    const LightSum<float> spread = total(paths);
    const Lanes between = all_lanes(spread.variance() * spread.count);
    Lanes error2{};
    for_rows([&](std::size_t y, Row& row) {
      const Sums<Lanes>& sum = row.sums;
      const LaneMask shown = sum.cover > 0.0F;
      row.direct_variance = select(shown, select(sum.direct.count < 2.0F, bend(y), sum.direct.variance()), 0.0F);
      const Lanes own = sum.indirect.variance(), several = larger(sum.indirect.count, 1.0F);
      row.indirect_variance = select(shown, (own * (several - 1.0F) + between / several) / several, 0.0F);
      const Lanes error_of_paths = select(shown, select(sum.indirect.count < 2.0F, between, own), 0.0F);
      const Lanes scale = sum.direct.mean() + sum.indirect.mean() + 0.1F;
      // Reflections are filtered less.
      const Lanes mirror = select(sum.walked_cover > 0.0F, sum.mirror / sum.walked_cover, 0.0F);
      error2 += (row.direct_variance + error_of_paths * (1.0F + kMirrorErrors * mirror)) / (scale * scale);
    });
    return path::total(error2) / static_cast<float>(window_.width() * window_.height());
  }

 private:
  template <class Body>
  void for_rows(const Body& body) {
    for (std::size_t y = 0; y < static_cast<std::size_t>(window_.height()); ++y) body(y, rows_[y]);
  }
  /// Variance of a single sample of direct light by second differences of neighbours, which light that changes evenly does not
  /// have: in the mean at least the true one.
  [[nodiscard]] Lanes bend(std::size_t y) const {
    const auto mean = [&](std::size_t row) { return rows_[row].sums.direct.mean(); };
    Lanes sum{};
    float count = 0.0F;
    const auto add = [&](Lanes before, Lanes middle, Lanes after) {
      const Lanes d = middle - 0.5F * (before + after);
      sum += d * d / 1.5F;  // the variance of d is 1 + 2 / 4 times that of a sample
      count += 1.0F;
    };
    const int width = window_.width(), height = window_.height();
    if (width > 2) {
      LaneBits at = kLaneNumbers;  // the nearest lane with two neighbours
      at = at < 1u ? all_lanes(1u) : at;
      const LaneBits last = all_lanes(static_cast<std::uint32_t>(width - 2));
      at = at > last ? last : at;
      const Lanes row = mean(y);
      add(permuted(row, at - 1u), permuted(row, at), permuted(row, at + 1u));
    }
    if (height > 2) {
      const std::size_t at = std::clamp(y, std::size_t{1}, static_cast<std::size_t>(height - 2));
      add(mean(at - 1), mean(at), mean(at + 1));
    }
    if (count > 0.0F) return sum / count;
    const Lanes own = mean(y);
    return own * own;
  }

  Window window_;
  std::array<Row, kTile> rows_;
};

/// Fills a film.
class Exposure {
 public:
  Exposure(const Tracer& tracer, const TraceSettings& settings, const Executor& executor, Film& film)
      : tracer_(tracer), settings_(settings), executor_(executor), film_(film),
        most_(static_cast<std::uint32_t>(settings.most_samples)),
        least_(std::min(static_cast<std::uint32_t>(settings.least_samples), most_)) {}

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
  [[nodiscard]] static Picks picks_of_row(const Window& window, int y) {
    return {.who = window.inside(), .x = kLaneNumbers + static_cast<std::uint32_t>(window.left), .y = all_lanes(static_cast<std::uint32_t>(y))};
  }
  std::uint32_t sample_until_quiet(const Window& window, Tile& tile) const;
  bool walk_where_no_ray_did(const Window& window, std::uint32_t n, Tile& tile) const;
  template <class Number>
  void keep_surface(int x, int y, const Sums<Number>& sum, float count, Number variance) const;
  template <class Number>
  void keep_paths(int x, int y, const Sums<Number>& sum, float count, Number variance) const;

  const Tracer& tracer_;
  const TraceSettings& settings_;
  const Executor& executor_;
  Film& film_;
  std::uint32_t most_;
  std::uint32_t least_;
};

/// Estimates from camera rays alone of a pixel, or of eight. @param variance  of the mean luminance of its direct light
template <class Number>
void Exposure::keep_surface(int x, int y, const Sums<Number>& sum, float count, Number variance) const {
  using Vector = typename LaneTypes<Number>::Vector;
  const auto shown = sum.cover > 0.0F;
  const Number cover = sum.cover / count;
  const Number scale = select(shown, 1.0F / cover, 0.0F);
  const Number share = select(shown, 1.0F / sum.cover, 0.0F);
  const Vector direct = sum.direct.radiance * select(shown, scale / sum.direct.count, 0.0F);
  film_.samples.store(x, y, constant<Number>(count));
  film_.cover.store(x, y, cover);
  film_.direct.radiance.store(x, y, direct);
  film_.direct.variance.store(x, y, variance * scale * scale);
  film_.albedo.store(x, y, Vector(sum.albedo * share));
  film_.reflectance.store(x, y, Vector(sum.reflectance * share));
  film_.normal.store(x, y, Vector(sum.normal * share));
  film_.position.store(x, y, Vector(sum.position * share));
}

/// Estimates from the paths of a pixel, or of eight. @param variance  of the mean luminance of its indirect light
template <class Number>
void Exposure::keep_paths(int x, int y, const Sums<Number>& sum, float count, Number variance) const {
  using Vector = typename LaneTypes<Number>::Vector;
  const auto walked = sum.walked_cover > 0.0F;
  const Number share = select(walked, 1.0F / sum.walked_cover, 0.0F);
  const Number cover = sum.cover / count;
  film_.indirect.radiance.store(x, y, Vector(sum.indirect.radiance * share));
  film_.indirect.variance.store(x, y, select(walked, variance / (cover * cover), 0.0F));
  film_.nearness.store(x, y, cover * sum.nearness * share);
  film_.mirror.store(x, y, sum.mirror * share);
}

/// @return camera rays per pixel
std::uint32_t Exposure::sample_until_quiet(const Window& window, Tile& tile) const {
  const Lanes taken = select(window.inside(), all_lanes(1.0F), 0.0F);
  std::uint32_t n = 0;
  for (std::uint32_t next = least_;;) {
    const std::uint32_t count = next - n;
    for (int y = window.top; y < window.bottom; ++y) {
      Picks picks = picks_of_row(window, y);
      picks.stream = 2 * n;
      picks.count = count;
      for (std::uint32_t s = 0; s < count; ++s) {
        picks.number = all_lanes(s);
        picks.share = (n + s) % kRaysAPath == 0 ? std::min(kRaysAPath, count) : 0;
        tile[y].sums.add(tracer_.sample(picks), taken);
      }
    }
    n = next;
    const bool quiet = tile.estimate_errors() <= static_cast<float>(settings_.noise * settings_.noise) && settings_.noise > 0.0;
    if (quiet || n >= most_) return n;
    next = std::min(2 * n, most_);
  }
}

/// Where only rays without a path met a surface, those go on, too. @return whether there are any
bool Exposure::walk_where_no_ray_did(const Window& window, std::uint32_t n, Tile& tile) const {
  bool any_did = false;
  for (int y = window.top; y < window.bottom; ++y) {
    Sums<Lanes>& sums = tile[y].sums;
    Picks picks = picks_of_row(window, y);
    picks.who = both(picks.who, both(sums.cover > 0.0F, ~(sums.walked_cover > 0.0F)));
    picks.share = 1;
    if (!any(picks.who)) continue;
    any_did = true;
    for (std::uint32_t first = 0, count = least_; first < n; first += count, count = first) {
      picks.stream = 2 * first;
      picks.count = count;
      for (std::uint32_t s = 0; s < count; ++s) {
        picks.number = all_lanes(s);
        const Samples samples = tracer_.sample(picks);
        sums.add_indirect(samples, select(samples.facet.cover > 0.0F, samples.weight, 0.0F));
      }
    }
  }
  return any_did;
}

void Exposure::expose_tiles() const {
  for_tiles([&](const Window& window) {
    Tile tile(window);
    const std::uint32_t n = sample_until_quiet(window, tile);
    if (walk_where_no_ray_did(window, n, tile)) tile.estimate_errors();
    const auto count = static_cast<float>(n);
    for (int y = window.top; y < window.bottom; ++y) {
      const Row& row = tile[y];
      keep_surface(window.left, y, row.sums, count, row.direct_variance);
      keep_paths(window.left, y, row.sums, count, row.indirect_variance);
      film_.radiance.store(window.left, y, film_.direct.radiance.load(window.left, y) + film_.indirect.radiance.load(window.left, y));
    }
  });
}

void Exposure::expose_details() const {
  executor_.for_blocks(film_.detailed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DetailedPixel& detailed = film_.detailed[k];
      const int x = detailed.x, y = detailed.y;
      const float before = film_.cover.at(x, y);
      const bool walks = detailed.walks || !(before > 0.0F);  // or nothing is known of its indirect light
      Picks picks{.x = all_lanes(static_cast<std::uint32_t>(x)), .y = all_lanes(static_cast<std::uint32_t>(y)), .stream = kDetailStream,
                  .count = detailed.rays, .share = walks ? 1u : 0u, .sees_mirrors = false};
      Sums<Lanes> sums;
      for (std::uint32_t first = 0; first < detailed.rays; first += kLanes) {
        picks.who = first_lanes(static_cast<int>(detailed.rays - first));
        picks.number = kLaneNumbers + first;
        const Samples samples = tracer_.sample(picks);
        sums.add(samples, select(picks.who, all_lanes(1.0F), 0.0F));
        if (detailed.detail != Detail::Surfaces) continue;
        for (std::size_t s = first; s < std::min(first + kLanes, std::size_t{detailed.rays}); ++s)
          film_.detailed_samples[detailed.samples + s] = lane(samples, s - first);
      }
      const Sums<float> anew = total(sums);
      const auto count = static_cast<float>(detailed.rays);
      if (anew.walked_cover > 0.0F) keep_paths(x, y, anew, count, anew.indirect.variance());
      keep_surface(x, y, anew, count, anew.direct.variance());
      film_.radiance.store(x, y, Vec3f(film_.direct.radiance.at(x, y) + film_.indirect.radiance.at(x, y)));
      if (walks || !(anew.cover > 0.0F)) continue;
      const float share_of_cover = film_.cover.at(x, y) / before;
      film_.nearness.at(x, y) *= share_of_cover;
      film_.indirect.variance.at(x, y) /= share_of_cover * share_of_cover;
    }
  });
}

}  // namespace

void Film::resize(int across, int down) {
  width = across;
  height = down;
  for (FilmLight* light : {&direct, &indirect}) {
    light->radiance.resize(across, down);
    light->variance.resize(across, down);
  }
  for (VectorPlane* plane : {&radiance, &albedo, &reflectance, &normal, &position}) plane->resize(across, down);
  for (Plane* plane : {&cover, &nearness, &mirror, &samples}) plane->resize(across, down);
}

void trace(const TracedScene& scene, const TraceSettings& settings, const Executor& executor, Film& film) {
  const Tracer tracer(scene.geometry, scene.lights, scene.ground, scene.camera, settings);
  film.resize(settings.width, settings.height);
  const Exposure exposure(tracer, settings, executor, film);
  exposure.expose_tiles();
  find_details(scene.camera, settings, executor, film);
  exposure.expose_details();
}

}  // namespace supple::render::path
