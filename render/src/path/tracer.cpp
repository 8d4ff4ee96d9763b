#include "tracer.h"

#include <algorithm>
#include <array>

namespace supple::render::path {
namespace {

constexpr float kWideLobe = 0.2F;   // from this alpha on, reflections are about as smooth as diffuse light
constexpr float kSharp = 0.5F;     // mirrors whose every camera ray goes on

}  // namespace

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

void Tracer::sample(std::span<const Pick> picks, std::span<Sample> out) const {
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
    out[i].weight = static_cast<float>(picks[i].share);
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
    if (picks[i].sees_mirrors && out[i].mirror > kSharp) out[i].weight = 1.0F;
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

}  // namespace supple::render::path
