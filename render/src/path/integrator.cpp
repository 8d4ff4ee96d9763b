#include "integrator.h"

#include <algorithm>
#include <utility>

namespace supple::render::path {
namespace {

constexpr int kTile = 8;
constexpr std::uint32_t kEdgeSamples = 4;  // times those of the tile
constexpr float kOneSurface = 0.98F;       // square of the mean of unit normals that are nearly parallel
constexpr float kSameNormal = 0.95F, kSameCover = 0.1F, kSameAlbedo = 0.03F;

struct Ray {
  Vec3f from;
  Vec3f direction;
};

/// What one camera ray brings.
struct Sample {
  Vec3f radiance = Vec3f::Zero();
  float cover = 0.0F;
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
};

class Tracer {
 public:
  Tracer(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
         const TraceSettings& settings)
      : geometry_(geometry), lights_(lights), ground_(ground), camera_(camera), settings_(settings),
        gap_(2e-5F * static_cast<float>(camera.distance)) {}

  [[nodiscard]] Sample sample(int x, int y, std::uint32_t number) const;

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
  [[nodiscard]] Vec3f direct(const Place& place, const Axes& axes, const Vec3f& out, float time, Sampler& random) const;
  [[nodiscard]] float ground_share(const Vec3f& point) const;

  const Geometry& geometry_;
  const Lights& lights_;
  const std::optional<GroundPlane>& ground_;
  const CameraMatrices& camera_;
  const TraceSettings& settings_;
  float gap_;  // between a surface and the paths that leave it [m]
};

Ray Tracer::camera_ray(int x, int y, Sampler& random) const {
  const Eigen::Vector2f jitter = random.pair();
  const Eigen::Vector2f at((static_cast<float>(x) + jitter.x()) / static_cast<float>(settings_.width),
                           (static_cast<float>(settings_.height - 1 - y) + jitter.y()) / static_cast<float>(settings_.height));
  Vec3f local((2.0F * at.x() - 1.0F) * camera_.half_extent.x(), (2.0F * at.y() - 1.0F) * camera_.half_extent.y(), -1.0F);
  const Eigen::Matrix3f to_world = camera_.view.block<3, 3>(0, 0).transpose();
  const Eigen::Vector2f lens = on_disc(random.pair()) * static_cast<float>(settings_.aperture);
  if (settings_.aperture <= 0.0) return {camera_.eye, (to_world * local).normalized()};
  const Vec3f start(lens.x(), lens.y(), 0.0F);
  local = local * static_cast<float>(settings_.focus) - start;
  return {camera_.eye + to_world * start, (to_world * local).normalized()};
}

Tracer::Met Tracer::meet(const Ray& ray, float time, float choice, Place& place, float& distance, std::size_t& light) const {
  Met met = Met::Nothing;
  distance = INFINITY;
  Hit hit;
  if (geometry_.meet(ray.from, ray.direction, time, choice, settings_.exact, hit)) {
    met = Met::Surface;
    distance = hit.distance;
  }
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

Vec3f Tracer::direct(const Place& place, const Axes& axes, const Vec3f& out, float time, Sampler& random) const {
  Vec3f sum = Vec3f::Zero();
  const Eigen::Vector2f u = random.pair();
  const Sun& sun = lights_.sun;
  if (sun.shines()) {
    const Vec3f direction = sun.is_point() ? sun.to_light : sun.sample(u);
    const Vec3f in = axes.to_local(direction);
    const Vec3f f = place.bsdf.evaluate(out, in);
    if (f.maxCoeff() > 0.0F && !geometry_.blocked(place.leave, direction, INFINITY, time)) {
      if (sun.is_point()) {
        sum += f.cwiseProduct(sun.irradiance);
      } else {
        const float density = 1.0F / sun.solid_angle();
        sum += f.cwiseProduct(sun.radiance()) * (power_share(density, place.bsdf.density(out, in)) / density);
      }
    }
  }
  if (lights_.rectangles.empty()) return sum;
  const Eigen::Vector2f which = random.pair();
  const Eigen::Vector2f at = random.pair();
  const auto count = static_cast<float>(lights_.rectangles.size());
  const Rectangle& light = lights_.rectangles[std::min(static_cast<std::size_t>(which.x() * count), lights_.rectangles.size() - 1)];
  const Vec3f to = light.centre + (2.0F * at.x() - 1.0F) * light.u + (2.0F * at.y() - 1.0F) * light.v - place.leave;
  const float distance = to.norm();
  const Vec3f direction = to / distance;
  if (direction.dot(light.front) >= 0.0F) return sum;
  const Vec3f in = axes.to_local(direction);
  const Vec3f f = place.bsdf.evaluate(out, in);
  if (f.maxCoeff() <= 0.0F || geometry_.blocked(place.leave, direction, distance * 0.9999F, time)) return sum;
  const float density = light.density(distance, direction) / count;
  return sum + f.cwiseProduct(light.radiance) * (power_share(density, place.bsdf.density(out, in)) / density);
}

Sample Tracer::sample(int x, int y, std::uint32_t number) const {
  Sampler random(x, y, number);
  Sample out;
  Ray ray = camera_ray(x, y, random);
  const float time = random.number();
  Vec3f weight = Vec3f::Ones();
  float density = 0.0F;  // with which the last surface chose the ray
  for (int bounce = 0; bounce <= settings_.bounces; ++bounce) {
    const auto add = [&](const Vec3f& light) {
      Vec3f more = weight.cwiseProduct(light);
      const float bright = luminance(more);
      if (bounce > 0 && bright > settings_.largest_indirect) more *= settings_.largest_indirect / bright;
      out.radiance += more;
    };
    Place place;
    float distance = 0.0F;
    std::size_t light = 0;
    const float choice = random.number();
    const Met met = meet(ray, time, choice, place, distance, light);
    if (met == Met::Nothing) {
      if (bounce == 0) return out;
      add(lights_.sky(ray.direction));
      const Sun& sun = lights_.sun;
      if (sun.shines() && sun.contains(ray.direction)) add(sun.radiance() * power_share(density, 1.0F / sun.solid_angle()));
      return out;
    }
    if (bounce == 0) out.cover = 1.0F;
    if (met == Met::Light) {
      const Rectangle& shape = lights_.rectangles[light];
      const float other = shape.density(distance, ray.direction) / static_cast<float>(lights_.rectangles.size());
      add(shape.radiance * (bounce == 0 ? 1.0F : power_share(density, other)));
      return out;
    }
    if (bounce == 0) {
      out.albedo = place.bsdf.diffuse + place.bsdf.normal_reflectance;
      out.normal = place.normal;
      out.position = place.point;
      if (met == Met::Ground) out.cover = ground_share(place.point);
      if (out.cover <= 0.0F) return out;
    }
    const Axes axes(place.normal);
    const Vec3f away = axes.to_local(-ray.direction);
    if (away.z() <= 0.0F) return out;
    add(direct(place, axes, away, time, random));

    const float which = random.number();
    const Vec3f in = place.bsdf.sample(away, which, random.pair());
    density = place.bsdf.density(away, in);
    if (!(density > 0.0F)) return out;
    weight = weight.cwiseProduct(place.bsdf.evaluate(away, in) / density);
    if (bounce >= 1) {  // Russian roulette (Arvo & Kirk 1990)
      const float stay = std::min(0.95F, weight.maxCoeff());
      if (!(random.number() < stay)) return out;
      weight /= stay;
    }
    ray = {place.leave, axes.to_world(in)};
  }
  return out;
}

/// Sums of the samples of a pixel.
struct Sums {
  Vec3f radiance = Vec3f::Zero();
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  float cover = 0.0F;
  float bright = 0.0F;
  float bright2 = 0.0F;

  void add(const Sample& s) {
    radiance += s.cover * s.radiance;
    albedo += s.cover * s.albedo;
    normal += s.cover * s.normal;
    position += s.cover * s.position;
    cover += s.cover;
    const float y = s.cover * luminance(s.radiance);
    bright += y;
    bright2 += y * y;
  }
  /// Of the mean of n samples, estimated as if they were independent (stratified ones do better).
  [[nodiscard]] float variance(std::uint32_t n) const {
    const auto count = static_cast<float>(n);
    const float mean = bright / count;
    return n < 2 ? 0.0F : std::max(0.0F, bright2 / count - mean * mean) / (count - 1.0F);
  }
};

}  // namespace

void trace(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
           const TraceSettings& settings, const Executor& executor, Film& film) {
  const auto pixels = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height);
  film.radiance.assign(pixels, Vec3f::Zero());
  film.variance.assign(pixels, 0.0F);
  film.cover.assign(pixels, 0.0F);
  film.albedo.assign(pixels, Vec3f::Zero());
  film.normal.assign(pixels, Vec3f::Zero());
  film.position.assign(pixels, Vec3f::Zero());
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
  std::vector<Sums> sums(pixels);
  const auto most = static_cast<std::uint32_t>(settings.most_samples);
  for_tiles([&](int left, int top, int right, int bottom) {
    std::uint32_t n = 0;
    for (auto next = std::min(static_cast<std::uint32_t>(settings.least_samples), most);;) {
      float error2 = 0.0F;
      for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
          Sums& sum = sums[index(x, y)];
          for (std::uint32_t s = n; s < next; ++s) sum.add(tracer.sample(x, y, s));
          const float scale = sum.bright / static_cast<float>(next) + 0.1F;
          error2 += sum.variance(next) / (scale * scale);
        }
      n = next;
      error2 /= static_cast<float>((right - left) * (bottom - top));
      const bool quiet = settings.noise > 0.0 && error2 <= static_cast<float>(settings.noise * settings.noise);
      if (quiet || n >= most) break;
      next = std::min(2 * n, most);
    }
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const std::size_t i = index(x, y);
        film.samples[i] = n;
        film.cover[i] = sums[i].cover / static_cast<float>(n);
        film.normal[i] = sums[i].normal / static_cast<float>(n);
        film.albedo[i] = sums[i].albedo / static_cast<float>(n);
      }
  });
  // Where surfaces meet in the picture a filter cannot help: what a pixel shows of each takes more samples.
  std::vector<std::uint8_t> edge(pixels, 0);
  for_tiles([&](int left, int top, int right, int bottom) {
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const std::size_t i = index(x, y);
        bool differs = film.cover[i] > 0.0F && film.normal[i].squaredNorm() < kOneSurface * film.cover[i] * film.cover[i];
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
          if (x + dx < 0 || y + dy < 0 || x + dx >= settings.width || y + dy >= settings.height) continue;
          const std::size_t j = index(x + dx, y + dy);
          differs |= std::abs(film.cover[i] - film.cover[j]) > kSameCover;
          differs |= (film.albedo[i] - film.albedo[j]).cwiseAbs().maxCoeff() > kSameAlbedo;
          differs |= film.normal[i].dot(film.normal[j]) < kSameNormal * film.cover[i] * film.cover[j];
        }
        edge[i] = differs ? 1 : 0;
      }
  });
  for_tiles([&](int left, int top, int right, int bottom) {
    for (int y = top; y < bottom; ++y)
      for (int x = left; x < right; ++x) {
        const std::size_t i = index(x, y);
        Sums& sum = sums[i];
        const std::uint32_t first = film.samples[i];
        if (edge[i] != 0) film.samples[i] = std::min(kEdgeSamples * first, most);
        for (std::uint32_t s = first; s < film.samples[i]; ++s) sum.add(tracer.sample(x, y, s));
        film.cover[i] = sum.cover / static_cast<float>(film.samples[i]);
        if (sum.cover <= 0.0F) continue;
        film.radiance[i] = sum.radiance / sum.cover;
        film.albedo[i] = sum.albedo / sum.cover;
        film.normal[i] = sum.normal / sum.cover;
        film.position[i] = sum.position / sum.cover;
        film.variance[i] = sum.variance(film.samples[i]) / (film.cover[i] * film.cover[i]);
      }
  });
}

}  // namespace supple::render::path
