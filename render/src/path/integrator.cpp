#include "integrator.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

namespace supple::render::path {
namespace {

constexpr int kTile = 8;
constexpr std::uint32_t kEdgeSamples = 8;  // times those of the tile
constexpr std::uint32_t kRaysAPath = 2;    // camera rays of which one goes on beyond its first surface
constexpr std::uint32_t kEdgeStream = 0xfffffff0u;  // those of tiles begin at 0
constexpr float kWideLobe = 0.2F;          // from this alpha on, reflections are about as smooth as diffuse light
constexpr float kSharp = 0.5F;             // mirrors whose every camera ray goes on
constexpr float kOneSurface = 0.98F;       // square of the mean of unit normals that are nearly parallel
constexpr float kSameNormal = 0.95F, kSameCover = 0.1F, kSameAlbedo = 0.03F;

/// Sample `number` of `count` that a pixel takes together from two sequences of numbers, `stream` and the next one.
struct Pick {
  int x = 0;
  int y = 0;
  std::uint32_t stream = 0;
  std::uint32_t count = 1;
  std::uint32_t number = 0;
};

struct Ray {
  Vec3f from;
  Vec3f direction;
};

/// What one camera ray brings.
struct Sample {
  Vec3f direct = Vec3f::Zero();
  Vec3f indirect = Vec3f::Zero();
  float weight = 0.0F;    ///< camera rays that its indirect light stands for; 0: it knows of none
  float nearness = 0.0F;  ///< 1 / distance of where it comes from
  float mirror = 0.0F;
  Facet facet;
};

class Tracer {
 public:
  Tracer(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
         const TraceSettings& settings)
      : geometry_(geometry), lights_(lights), ground_(ground), camera_(camera), settings_(settings),
        to_world_(camera.view.block<3, 3>(0, 0).transpose()), sun_axes_(lights.sun.to_light), sun_radiance_(lights.sun.radiance()),
        sun_density_(1.0F / lights.sun.solid_angle()), gap_(2e-5F * static_cast<float>(camera.distance)) {}

  /// Of a bundle of neighbouring picks. @param rays_a_path  camera rays of which one goes on beyond its first surface; 0: none
  void sample(std::span<const Pick> picks, std::uint32_t rays_a_path, std::span<Sample> out) const;

 private:
  struct Place {
    Vec3f point;
    Vec3f normal;
    Vec3f leave;
    Bsdf bsdf;
  };
  enum class Met : std::uint8_t { Nothing, Surface, Ground, Light };

  [[nodiscard]] Ray camera_ray(int x, int y, Sampler& random) const;
  [[nodiscard]] Met meet(const Ray& ray, float time, float choice, Place& place, float& distance, std::size_t& light) const;
  [[nodiscard]] Met nearest(const Ray& ray, bool met_surface, const Hit& hit, Place& place, float& distance, std::size_t& light) const;
  [[nodiscard]] Vec3f sunlight(const Place& place, const Axes& axes, const Vec3f& out, Sampler& random, Vec3f& direction) const;
  [[nodiscard]] Vec3f lamplight(const Place& place, const Axes& axes, const Vec3f& out, float time, Sampler& random) const;
  [[nodiscard]] Vec3f indirect(Place place, const Ray& camera_ray, float time, Sampler& random, float& nearness) const;
  [[nodiscard]] float ground_share(const Vec3f& point) const;

  const Geometry& geometry_;
  const Lights& lights_;
  const std::optional<GroundPlane>& ground_;
  const CameraMatrices& camera_;
  const TraceSettings& settings_;
  Eigen::Matrix3f to_world_;
  Axes sun_axes_;
  Vec3f sun_radiance_;   // infinite for a point, as is the density of its directions; neither is asked for then
  float sun_density_;
  float gap_;  // between a surface and the paths that leave it [m]
};

Ray Tracer::camera_ray(int x, int y, Sampler& random) const {
  const Eigen::Vector2f jitter = random.pair();
  const Eigen::Vector2f at((static_cast<float>(x) + jitter.x()) / static_cast<float>(settings_.width),
                           (static_cast<float>(settings_.height - 1 - y) + jitter.y()) / static_cast<float>(settings_.height));
  Vec3f local((2.0F * at.x() - 1.0F) * camera_.half_extent.x(), (2.0F * at.y() - 1.0F) * camera_.half_extent.y(), -1.0F);
  if (settings_.aperture <= 0.0) return {camera_.eye, (to_world_ * local).normalized()};
  const Eigen::Vector2f lens = on_disc(random.pair()) * static_cast<float>(settings_.aperture);
  const Vec3f start(lens.x(), lens.y(), 0.0F);
  local = local * static_cast<float>(settings_.focus) - start;
  return {camera_.eye + to_world_ * start, (to_world_ * local).normalized()};
}

Tracer::Met Tracer::meet(const Ray& ray, float time, float choice, Place& place, float& distance, std::size_t& light) const {
  Hit hit;
  const bool met_surface = geometry_.meet(ray.from, ray.direction, time, choice, settings_.exact, hit);
  return nearest(ray, met_surface, hit, place, distance, light);
}

/// Of the surface that a ray meets, the ground and the lamps.
Tracer::Met Tracer::nearest(const Ray& ray, bool met_surface, const Hit& hit, Place& place, float& distance, std::size_t& light) const {
  Met met = met_surface ? Met::Surface : Met::Nothing;
  distance = met_surface ? hit.distance : INFINITY;
  if (ground_ && ray.direction.z() < 0.0F && ray.from.z() > ground_->height) {
    const float t = (ground_->height - ray.from.z()) / ray.direction.z();
    if (t < distance) {
      met = Met::Ground;
      distance = t;
    }
  }
  for (std::size_t i = 0; i < lights_.rectangles.size(); ++i) {
    const float t = lights_.rectangles[i].distance(ray.from, ray.direction);
    if (t >= distance) continue;
    met = Met::Light;
    distance = t;
    light = i;
  }
  if (met == Met::Surface) place = {hit.point, hit.normal, hit.leave + gap_ * hit.face_normal, hit.bsdf};
  if (met == Met::Ground) {
    const Vec3f p = ray.from + distance * ray.direction;
    place = {p, Vec3f::UnitZ(), Vec3f(p.x(), p.y(), ground_->height + gap_),
             {.diffuse = ground_->pattern != nullptr ? ground_->pattern->colour(p.head<2>() + ground_->origin) : ground_->albedo, .normal_reflectance = Vec3f::Zero(), .grazing_reflectance = 0.0F}};
  }
  return met;
}

/// Into the background with distance and towards the horizon, as in the shaders.
float Tracer::ground_share(const Vec3f& point) const {
  if (!ground_->fades) return 1.0F;
  const auto step = [](float a, float b, float x) {
    const float t = std::clamp((x - a) / (b - a), 0.0F, 1.0F);
    return t * t * (3.0F - 2.0F * t);
  };
  const float away = std::hypot(point.x(), point.y()) / static_cast<float>(camera_.distance);
  const float down = (camera_.eye.z() - point.z()) / (camera_.eye - point).norm();
  return (1.0F - step(0.7F, 3.2F, away)) * step(0.02F, 0.22F, down);
}

/// What comes from the sun along `direction` unless something is in the way.
Vec3f Tracer::sunlight(const Place& place, const Axes& axes, const Vec3f& out, Sampler& random, Vec3f& direction) const {
  const Sun& sun = lights_.sun;
  const Eigen::Vector2f u = random.pair();
  if (!sun.shines()) return Vec3f::Zero();
  direction = sun.is_point() ? sun.to_light : sun_axes_.to_world(sun.sample(u));
  const Vec3f in = axes.to_local(direction);
  const Vec3f f = place.bsdf.evaluate(out, in);
  if (f.maxCoeff() <= 0.0F) return Vec3f::Zero();
  if (sun.is_point()) return f.cwiseProduct(sun.irradiance);
  return f.cwiseProduct(sun_radiance_) * (power_share(sun_density_, place.bsdf.density(out, in)) / sun_density_);
}

/// What comes from one of the rectangles.
Vec3f Tracer::lamplight(const Place& place, const Axes& axes, const Vec3f& out, float time, Sampler& random) const {
  if (lights_.rectangles.empty()) return Vec3f::Zero();
  const Eigen::Vector2f which = random.pair();
  const Eigen::Vector2f at = random.pair();
  const auto count = static_cast<float>(lights_.rectangles.size());
  const Rectangle& light = lights_.rectangles[std::min(static_cast<std::size_t>(which.x() * count), lights_.rectangles.size() - 1)];
  const Vec3f to = light.centre + (2.0F * at.x() - 1.0F) * light.u + (2.0F * at.y() - 1.0F) * light.v - place.leave;
  const float distance = to.norm();
  const Vec3f direction = to / distance;
  if (direction.dot(light.front) >= 0.0F) return Vec3f::Zero();
  const Vec3f in = axes.to_local(direction);
  const Vec3f f = place.bsdf.evaluate(out, in);
  if (f.maxCoeff() <= 0.0F || geometry_.blocked(place.leave, direction, distance * 0.9999F, time)) return Vec3f::Zero();
  const float density = light.density(distance, direction) / count;
  return f.cwiseProduct(light.radiance) * (power_share(density, place.bsdf.density(out, in)) / density);
}

/// What comes to a surface from the sky and from other surfaces.
Vec3f Tracer::indirect(Place place, const Ray& camera_ray, float time, Sampler& random, float& nearness) const {
  Vec3f sum = Vec3f::Zero();
  Vec3f weight = Vec3f::Ones();
  Ray ray = camera_ray;
  for (int bounce = 1; bounce <= settings_.bounces; ++bounce) {
    const Axes axes(place.normal);
    const Vec3f away = axes.to_local(-ray.direction);
    if (away.z() <= 0.0F) return sum;
    const float which = random.number();
    const Vec3f in = place.bsdf.sample(away, which, random.pair());
    const float density = place.bsdf.density(away, in);
    if (!(density > 0.0F)) return sum;
    weight = weight.cwiseProduct(place.bsdf.evaluate(away, in) / density);
    if (bounce > 1) {  // Russian roulette (Arvo & Kirk 1990)
      const float stay = std::min(0.95F, weight.maxCoeff());
      if (!(random.number() < stay)) return sum;
      weight /= stay;
    }
    ray = {place.leave, axes.to_world(in)};

    const auto add = [&](const Vec3f& light) {
      const Vec3f more = weight.cwiseProduct(light);
      sum += more * std::min(1.0F, settings_.largest_indirect / std::max(luminance(more), 1e-30F));
    };
    float distance = 0.0F;
    std::size_t light = 0;
    const float choice = random.number();
    const Met met = meet(ray, time, choice, place, distance, light);
    if (met == Met::Nothing) {
      add(lights_.sky(ray.direction));
      const Sun& sun = lights_.sun;
      if (sun.shines() && sun.contains(ray.direction)) add(sun_radiance_ * power_share(density, sun_density_));
      return sum;
    }
    if (met == Met::Light) {
      const Rectangle& shape = lights_.rectangles[light];
      const float other = shape.density(distance, ray.direction) / static_cast<float>(lights_.rectangles.size());
      add(shape.radiance * power_share(density, other));
      return sum;
    }
    if (bounce == 1) nearness = 1.0F / std::max(distance, gap_);
    const Axes there(place.normal);
    const Vec3f back = there.to_local(-ray.direction);
    if (back.z() <= 0.0F) return sum;
    Vec3f to_sun;
    const Vec3f sunny = sunlight(place, there, back, random, to_sun);
    const bool lit = sunny.maxCoeff() > 0.0F && !geometry_.blocked(place.leave, to_sun, INFINITY, time);
    add((lit ? sunny : Vec3f(Vec3f::Zero())) + lamplight(place, there, back, time, random));
  }
  return sum;
}

void Tracer::sample(std::span<const Pick> picks, std::uint32_t rays_a_path, std::span<Sample> out) const {
  constexpr std::size_t kSize = RayBundle::kSize;
  std::array<Sampler, kSize> random;
  std::array<Ray, kSize> ray;
  std::array<Place, kSize> place;
  std::array<float, kSize> choice{};
  RayBundle looks;
  for (std::size_t i = 0; i < picks.size(); ++i) {
    const Pick& pick = picks[i];
    random[i] = Sampler(pick.x, pick.y, pick.stream, pick.count, pick.number);
    ray[i] = camera_ray(pick.x, pick.y, random[i]);
    looks.add(ray[i].from, ray[i].direction, random[i].number());
    choice[i] = random[i].number();
  }
  std::array<Hit, kSize> hits;
  const std::array<bool, kSize> met = geometry_.meet(looks, choice, settings_.exact, hits);

  RayBundle to_sun;
  std::array<std::size_t, kSize> of_ray{};  // to the sun: its sample
  std::array<Vec3f, kSize> sunny;
  std::array<bool, kSize> goes_on{};
  for (std::size_t i = 0; i < picks.size(); ++i) {
    out[i] = {};
    const std::uint32_t share = std::min(rays_a_path, picks[i].count);
    if (share > 0 && picks[i].number % share == 0) out[i].weight = static_cast<float>(share);
    float distance = 0.0F;
    std::size_t light = 0;
    const Met what = nearest(ray[i], met[i], hits[i], place[i], distance, light);
    if (what == Met::Nothing) continue;
    Facet& facet = out[i].facet;
    facet.cover = what == Met::Ground ? ground_share(place[i].point) : 1.0F;
    if (what == Met::Light) {
      out[i].direct = lights_.rectangles[light].radiance;
      continue;
    }
    facet.albedo = place[i].bsdf.diffuse + place[i].bsdf.normal_reflectance;
    facet.normal = place[i].normal;
    facet.position = place[i].point;
    out[i].mirror = place[i].bsdf.has_lobe() ? std::max(0.0F, 1.0F - place[i].bsdf.alpha / kWideLobe) : 0.0F;
    const Axes axes(place[i].normal);
    const Vec3f away = axes.to_local(-ray[i].direction);
    if (facet.cover <= 0.0F || away.z() <= 0.0F) continue;
    if (share > 0 && out[i].mirror > kSharp) out[i].weight = 1.0F;  // sharp reflections are edges, too
    goes_on[i] = out[i].weight > 0.0F;
    Vec3f direction;
    sunny[i] = sunlight(place[i], axes, away, random[i], direction);
    if (sunny[i].maxCoeff() > 0.0F) {
      of_ray[to_sun.count] = i;
      to_sun.add(place[i].leave, direction, looks.time[i]);
    }
    out[i].direct = lamplight(place[i], axes, away, looks.time[i], random[i]);
  }
  if (to_sun.count > 0) {
    const std::array<bool, kSize> blocked = geometry_.blocked(to_sun);
    for (std::size_t k = 0; k < to_sun.count; ++k)
      if (!blocked[k]) out[of_ray[k]].direct += sunny[of_ray[k]];
  }
  for (std::size_t i = 0; i < picks.size(); ++i) {
    if (!goes_on[i]) continue;
    const Pick& pick = picks[i];
    const auto share = static_cast<std::uint32_t>(out[i].weight);
    Sampler further(pick.x, pick.y, pick.stream + 1, pick.count / share, pick.number / share);
    out[i].indirect = indirect(place[i], ray[i], looks.time[i], further, out[i].nearness);
  }
}

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
  Bundler(const Tracer& tracer, std::uint32_t rays_a_path, const Take& take) : tracer_(tracer), rays_a_path_(rays_a_path), take_(take) {}
  void add(const Pick& pick) {
    picks_[count_++] = pick;
    if (count_ == RayBundle::kSize) flush();
  }
  void flush() {
    tracer_.sample(std::span(picks_.data(), count_), rays_a_path_, samples_);
    for (std::size_t i = 0; i < count_; ++i) take_(picks_[i], samples_[i]);
    count_ = 0;
  }

 private:
  const Tracer& tracer_;
  std::uint32_t rays_a_path_;
  Take take_;
  std::array<Pick, RayBundle::kSize> picks_;
  std::array<Sample, RayBundle::kSize> samples_;
  std::size_t count_ = 0;
};

}  // namespace

void trace(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
           const TraceSettings& settings, const Executor& executor, Film& film) {
  const auto pixels = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height);
  film.radiance.assign(pixels, Vec3f::Zero());
  for (FilmLight* light : {&film.direct, &film.indirect}) {
    light->radiance.assign(pixels, Vec3f::Zero());
    light->variance.assign(pixels, 0.0F);
  }
  film.cover.assign(pixels, 0.0F);
  film.albedo.assign(pixels, Vec3f::Zero());
  film.normal.assign(pixels, Vec3f::Zero());
  film.position.assign(pixels, Vec3f::Zero());
  film.nearness.assign(pixels, 0.0F);
  film.mirror.assign(pixels, 0.0F);
  film.samples.assign(pixels, 0);

  const Tracer tracer(geometry, lights, ground, camera, settings);
  const int across = (settings.width + kTile - 1) / kTile;
  const int down = (settings.height + kTile - 1) / kTile;
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y) * static_cast<std::size_t>(settings.width) + static_cast<std::size_t>(x); };
  const auto for_tiles = [&](const auto& body) {
    executor.for_blocks(static_cast<std::size_t>(across) * static_cast<std::size_t>(down), 1, [&](std::size_t tile, std::size_t) {
      const int left = static_cast<int>(tile % static_cast<std::size_t>(across)) * kTile;
      const int top = static_cast<int>(tile / static_cast<std::size_t>(across)) * kTile;
      body(left, top, std::min(left + kTile, settings.width), std::min(top + kTile, settings.height));
    });
  };
  // What camera rays alone tell of a pixel.
  const auto keep_surface = [&](std::size_t i, const Sums& sum, std::uint32_t count) {
    film.samples[i] = count;
    film.cover[i] = sum.cover / static_cast<float>(count);
    if (sum.cover <= 0.0F) return;
    const float scale = 1.0F / film.cover[i];
    film.direct.radiance[i] = sum.direct.radiance * (scale / sum.direct.count);
    film.direct.variance[i] = sum.direct.variance() * scale * scale;
    film.radiance[i] = film.direct.radiance[i] + film.indirect.radiance[i];
    film.albedo[i] = sum.albedo / sum.cover;
    film.normal[i] = sum.normal / sum.cover;
    film.position[i] = sum.position / sum.cover;
  };
  const auto most = static_cast<std::uint32_t>(settings.most_samples);
  const std::uint32_t least = std::min(static_cast<std::uint32_t>(settings.least_samples), most);
  for_tiles([&](int left, int top, int right, int bottom) {
    std::array<Sums, kTile * kTile> sums;
    std::array<float, kTile * kTile> variance{};  // of indirect light
    const auto inside = [&](int x, int y) { return static_cast<std::size_t>((y - top) * kTile + x - left); };
    Bundler bundler(tracer, kRaysAPath, [&](const Pick& pick, const Sample& sample) { sums[inside(pick.x, pick.y)].add(sample); });
    std::uint32_t n = 0;
    for (std::uint32_t next = least;;) {
      float error2 = 0.0F;
      for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x)
          for (std::uint32_t s = 0; s < next - n; ++s) bundler.add({x, y, 2 * n, next - n, s});
      bundler.flush();
      // One path a pixel knows nothing of its noise: at most what pixels differ by.
      LightSum spread;
      for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
          const Sums& sum = sums[inside(x, y)];
          if (sum.walked_cover > 0.0F) spread.add(sum.indirect.radiance / sum.indirect.weight);
        }
      const float between = spread.variance() * spread.count;
      for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
          const Sums& sum = sums[inside(x, y)];
          if (sum.cover <= 0.0F) continue;
          float& of_pixel = variance[inside(x, y)];
          of_pixel = sum.indirect.count < 2.0F ? between : sum.indirect.variance();
          const float scale = sum.direct.mean() + sum.indirect.mean() + 0.1F;
          error2 += (sum.direct.variance() + of_pixel) / (scale * scale);
        }
      n = next;
      error2 /= static_cast<float>((right - left) * (bottom - top));
      const bool quiet = settings.noise > 0.0 && error2 <= static_cast<float>(settings.noise * settings.noise);
      if (quiet || n >= most) break;
      next = std::min(2 * n, most);
    }
    // Where only rays without a path met a surface, those go on, too.
    Bundler late(tracer, 1, [&](const Pick& pick, const Sample& sample) {
      if (sample.facet.cover > 0.0F) sums[inside(pick.x, pick.y)].add_indirect(sample);
    });
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const Sums& sum = sums[inside(x, y)];
        if (!(sum.cover > 0.0F) || sum.walked_cover > 0.0F) continue;
        for (std::uint32_t first = 0, count = least; first < n; first += count, count = first)
          for (std::uint32_t s = 0; s < count; ++s) late.add({x, y, 2 * first, count, s});
      }
    late.flush();
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const std::size_t i = index(x, y);
        const Sums& sum = sums[inside(x, y)];
        const float cover = sum.cover / static_cast<float>(n);
        if (sum.walked_cover > 0.0F) {
          film.indirect.radiance[i] = sum.indirect.radiance / sum.walked_cover;
          film.indirect.variance[i] = variance[inside(x, y)] / (cover * cover);
          film.nearness[i] = cover * sum.nearness / sum.walked_cover;
          film.mirror[i] = sum.mirror / sum.walked_cover;
        }
        keep_surface(i, sum, n);
      }
  });
  // Where surfaces meet in the picture a filter cannot help: such pixels take more camera rays, all anew, and have the
  // indirect light of each facet from its neighbours, once those are smooth.
  std::vector<std::uint32_t> camera_rays(pixels, 0);
  for_tiles([&](int left, int top, int right, int bottom) {
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const std::size_t i = index(x, y);
        const float cover = film.cover[i];
        bool differs = cover > 0.0F && film.normal[i].squaredNorm() < kOneSurface;
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
          if (x + dx < 0 || y + dy < 0 || x + dx >= settings.width || y + dy >= settings.height) continue;
          const std::size_t j = index(x + dx, y + dy);
          const float other = film.cover[j];
          differs |= std::abs(cover - other) > kSameCover;
          differs |= (cover * film.albedo[i] - other * film.albedo[j]).cwiseAbs().maxCoeff() > kSameAlbedo;
          differs |= cover * other > 0.0F && film.normal[i].dot(film.normal[j]) < kSameNormal;
        }
        const std::uint32_t more = std::min(kEdgeSamples * film.samples[i], most);
        if (differs && more > film.samples[i]) camera_rays[i] = more;
      }
  });
  film.mixed.clear();
  std::size_t facets = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (camera_rays[i] > 0) film.mixed.push_back({i, facets, facets + camera_rays[i]});
    facets += camera_rays[i];
  }
  film.facets.resize(facets);
  executor.for_blocks(film.mixed.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const MixedPixel& mixed = film.mixed[k];
      const std::size_t i = mixed.pixel;
      const auto width = static_cast<std::size_t>(settings.width);
      const int x = static_cast<int>(i % width), y = static_cast<int>(i / width);
      const auto count = static_cast<std::uint32_t>(mixed.last - mixed.first);
      Sums anew;
      Bundler bundler(tracer, 0, [&](const Pick& pick, const Sample& sample) {
        anew.add(sample);
        film.facets[mixed.first + pick.number] = sample.facet;
      });
      for (std::uint32_t s = 0; s < count; ++s) bundler.add({x, y, kEdgeStream, count, s});
      bundler.flush();
      const float before = film.cover[i];
      keep_surface(i, anew, count);
      if (!(before > 0.0F && film.cover[i] > 0.0F)) continue;
      const float share = film.cover[i] / before;
      film.nearness[i] *= share;
      film.indirect.variance[i] /= share * share;
    }
  });
}

}  // namespace supple::render::path
