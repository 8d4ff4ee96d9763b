#include "path/tracer.h"

#include <array>

namespace supple::render::path {
namespace {

constexpr float kWideLobe = 0.2F;  // from this alpha on, reflections are about as smooth as diffuse light
constexpr int kInGlass = 24;       // surfaces of glass along a path
constexpr float kSharp = 0.5F;     // mirrors whose every camera ray goes on

Vec3Lanes turn(const Eigen::Matrix3f& m, const Vec3Lanes& v) {
  return Vec3Lanes(m.col(0)) * v.x() + Vec3Lanes(m.col(1)) * v.y() + Vec3Lanes(m.col(2)) * v.z();
}

}  // namespace

RayBundle Tracer::camera_rays(const Picks& picks, Random& random) const {
  const Lanes x = number_of(picks.x), y = number_of(picks.y);
  const Pair<Lanes> jitter = random.pair();
  const Lanes across = (x + jitter.x) * (2.0F / static_cast<float>(settings_.width)) - 1.0F;
  const Lanes up = (static_cast<float>(settings_.height - 1) - y + jitter.y) * (2.0F / static_cast<float>(settings_.height)) - 1.0F;
  Vec3Lanes local(across * camera_.half_extent.x(), up * camera_.half_extent.y(), all_lanes(-1.0F));
  Vec3Lanes start = Vec3Lanes::Zero();
  if (settings_.aperture > 0.0) {
    const Pair<Lanes> lens = on_disc(random.pair());
    start = static_cast<float>(settings_.aperture) * Vec3Lanes(lens.x, lens.y, Lanes{});
    local = local * static_cast<float>(settings_.focus) - start;
  }
  return {.from = Vec3Lanes(camera_.eye) + turn(to_world_, start), .direction = turn(to_world_, local).normalized(),
          .time = random.number(), .who = picks.who, .together = true};
}

/// Of the surfaces that rays meet, the ground and the lamps.
Tracer::Meeting Tracer::meet(const RayBundle& rays, Lanes choice, Places& places) const {
  std::array<Hit, kLanes> hits;
  Meeting met{};
  met.surface = geometry_.meet(rays, choice, settings_.exact, hits);
  met.distance = all_lanes(INFINITY);
  for (std::size_t k = 0; k < kLanes; ++k)
    if (met.surface[k] != 0) met.distance[k] = hits[k].distance;
  if (ground_) {
    const Lanes t = (ground_->height - rays.from.z()) / rays.direction.z();
    const LaneMask below = both(rays.direction.z() < 0.0F, rays.from.z() > ground_->height);
    met.ground = both(rays.who, both(below, t < met.distance));
    met.surface = both(met.surface, ~met.ground);
    met.distance = select(met.ground, t, met.distance);
  }
  for (const Rectangle& lamp : lights_.rectangles) {
    const Lanes t = lamp.distance(rays.from, rays.direction);
    const LaneMask nearer = both(rays.who, t < met.distance);
    met.lamp |= nearer;
    met.distance = select(nearer, t, met.distance);
    met.radiance = select(nearer, Vec3Lanes(lamp.radiance), met.radiance);
    const Lanes density = density_of_face(all_lanes(lamp.area()), -rays.direction.dot(Vec3Lanes(lamp.front)), t);
    met.density = select(nearer, density / static_cast<float>(lights_.rectangles.size()), met.density);
  }
  if (geometry_.has_media()) {
    places.item = LaneBits{};
    places.glass = places.scatter = places.back = LaneMask{};
    places.bsdf.local = all_lanes(1.0F);
  }
  met.surface = both(met.surface, ~met.lamp);
  met.ground = both(met.ground, ~met.lamp);

  if (any(met.ground)) {
    const Vec3Lanes p = rays.from + met.distance * rays.direction;
    const Lanes clear = clearance(larger(larger(magnitude(p.x()), magnitude(p.y())), std::abs(ground_->height)));
    places.point = places.pass = p;
    places.normal = Vec3Lanes(Vec3f::UnitZ());
    places.leave = Vec3Lanes(p.x(), p.y(), ground_->height + clear);
    places.bsdf = {.diffuse = Vec3Lanes(ground_->albedo), .normal_reflectance = Vec3Lanes::Zero(), .grazing_reflectance = Lanes{},
                   .alpha = all_lanes(1.0F)};
    for (std::size_t k = 0; ground_->pattern != nullptr && k < kLanes; ++k)
      if (met.ground[k] != 0) places.bsdf.diffuse.set_lane(k, ground_->pattern->colour((p.lane(k).head<2>() - ground_->pattern_origin) / ground_->pattern_size));
  }
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (met.surface[k] == 0) continue;
    const Hit& hit = hits[k];
    places.point.set_lane(k, hit.point);
    places.normal.set_lane(k, hit.normal);
    places.leave.set_lane(k, hit.leave);
    places.bsdf.diffuse.set_lane(k, hit.bsdf.diffuse);
    places.bsdf.normal_reflectance.set_lane(k, hit.bsdf.normal_reflectance);
    places.bsdf.grazing_reflectance[k] = hit.bsdf.grazing_reflectance;
    places.bsdf.alpha[k] = hit.bsdf.alpha;
    if (geometry_.has_media()) put_inside(hit, k, places);
  }
  met.surface |= met.ground;
  return met;
}

/// Into the background with distance and towards the horizon, as in the shaders.
Lanes Tracer::ground_share(const Vec3Lanes& point) const {
  if (!ground_->fades) return all_lanes(1.0F);
  const auto step = [](float a, float b, Lanes x) {
    const Lanes t = clamped((x - a) * (1.0F / (b - a)), 0.0F, 1.0F);
    return t * t * (3.0F - 2.0F * t);
  };
  const Lanes away = root(point.x() * point.x() + point.y() * point.y()) * (1.0F / static_cast<float>(camera_.distance));
  const Lanes down = (camera_.eye.z() - point.z()) / (Vec3Lanes(camera_.eye) - point).norm();
  return (1.0F - step(0.7F, 3.2F, away)) * step(0.02F, 0.22F, down);
}

/// Light from the sun where nothing occludes it.
Tracer::Light Tracer::sunlight(const Places& places, const Axes& axes, const Vec3Lanes& out, Random& random) const {
  const Sun& sun = lights_.sun;
  const Pair<Lanes> u = random.pair();
  if (!sun.shines()) return {.light = Vec3Lanes::Zero(), .direction = Vec3Lanes::Zero()};
  const Vec3Lanes direction = sun.is_point() ? Vec3Lanes(sun.to_light) : sun_axes_.to_world(sun.sample(u));
  const Vec3Lanes in = axes.to_local(direction);
  const Vec3Lanes f = places.bsdf.evaluate(out, in);
  if (sun.is_point()) return {.light = f.cwiseProduct(Vec3Lanes(sun.irradiance)), .direction = direction};
  const Lanes share = power_share(all_lanes(sun_density_), places.bsdf.density(out, in));
  return {.light = f.cwiseProduct(sun_radiance_) * (share * (1.0F / sun_density_)), .direction = direction};
}

/// Light from one of the rectangles.
Vec3Lanes Tracer::lamplight(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to_lights, Random& random) const {
  if (lights_.rectangles.empty()) return Vec3Lanes::Zero();
  const Lanes which = random.number();
  const Pair<Lanes> at = random.pair();
  const auto count = static_cast<float>(lights_.rectangles.size());
  Vec3Lanes to = Vec3Lanes::Zero(), front = to, radiance = to;
  Lanes area{};
  for (std::size_t i = 0; i < lights_.rectangles.size(); ++i) {  // the last one that begins before `which` stays
    const Rectangle& lamp = lights_.rectangles[i];
    const LaneMask mine = which * count >= static_cast<float>(i);
    const Vec3Lanes point = Vec3Lanes(lamp.centre) + (2.0F * at.x - 1.0F) * Vec3Lanes(lamp.u) + (2.0F * at.y - 1.0F) * Vec3Lanes(lamp.v);
    to = select(mine, point - places.leave, to);
    front = select(mine, Vec3Lanes(lamp.front), front);
    radiance = select(mine, Vec3Lanes(lamp.radiance), radiance);
    area = select(mine, all_lanes(lamp.area()), area);
  }
  const Lanes distance = to.norm();
  const Vec3Lanes direction = to / distance;
  const Lanes facing = -direction.dot(front);
  const Vec3Lanes in = axes.to_local(direction);
  const Vec3Lanes f = places.bsdf.evaluate(out, in);
  const LaneMask lit = both(to_lights.who, both(facing > 0.0F, f.maxCoeff() > 0.0F));
  if (!any(lit)) return Vec3Lanes::Zero();
  const RayBundle to_lamp{.from = places.leave, .direction = direction, .time = to_lights.time, .who = lit};
  const LaneMask blocked = geometry_.blocked(to_lamp, distance * 0.9999F);
  const Lanes density = density_of_face(area, facing, distance) / count;
  Vec3Lanes light = f.cwiseProduct(radiance) * (power_share(density, places.bsdf.density(out, in)) / density);
  if (geometry_.has_glass()) light = light.cwiseProduct(past_glass(to_lights, places.leave, direction, distance, both(lit, ~blocked)));
  return select(both(lit, ~blocked), light, Vec3Lanes::Zero());
}

/// Light that comes straight from sun and rectangles.
Vec3Lanes Tracer::direct(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to, Random& random) const {
  Light sunny = sunlight(places, axes, out, random);
  LaneMask lit = both(to.who, sunny.light.maxCoeff() > 0.0F);
  LaneMask shadowed{};
  if (any(lit))
    shadowed = geometry_.blocked({.from = places.leave, .direction = sunny.direction, .time = to.time, .who = lit, .together = to.together});
  if (geometry_.has_glass()) {
    sunny.light = sunny.light.cwiseProduct(past_glass(to, places.leave, sunny.direction, all_lanes(INFINITY), both(lit, ~shadowed)));
    sunny.light = select(places.glass, glint(places, axes, out, to), sunny.light);
    lit = both(lit | places.glass, to.who);
  }
  return select(both(lit, ~shadowed), sunny.light, Vec3Lanes::Zero()) + lamplight(places, axes, out, to, random);
}

/// Share of the light of a lamp that a path meets which counts, where other surfaces look for it by themselves, too.
/// @param density  over solid angle, with which they do
Lanes Tracer::counted(const Walk& walk, Lanes density) {
  return select(walk.lights, all_lanes(1.0F), select(walk.no_lights, Lanes{}, power_share(walk.density, density)));
}

/// Light from the sky and from other surfaces.
Vec3Lanes Tracer::indirect(Places& places, const RayBundle& camera_rays, Random& random, Lanes& nearness) const {
  Vec3Lanes sum = Vec3Lanes::Zero();
  Walk walk{.rays = camera_rays, .weight = Vec3Lanes::Ones(), .density = {}, .from_eye = camera_rays.who, .lights = {}, .no_lights = {}};
  RayBundle& rays = walk.rays;
  rays.together = false;
  const auto add = [&](LaneMask who, const Vec3Lanes& light) {
    const Vec3Lanes more = walk.weight.cwiseProduct(light);
    const Lanes bound = smaller(settings_.largest_indirect / larger(luminance(more), 1e-30F), 1.0F);
    sum += select(who, more * bound, Vec3Lanes::Zero());
  };
  const int most = settings_.bounces + (geometry_.has_glass() ? kInGlass : 0);
  Lanes turns{};  // at other surfaces than glass
  for (int bounce = 1; bounce <= most; ++bounce) {
    const Lanes which = random.number();
    const Pair<Lanes> u = random.pair();
    if (geometry_.has_media()) {
      const LaneMask left = scatter_inside(places, Axes(places.normal).to_local(-rays.direction), which, random.number(), walk);
      const Vec3Lanes out = Vec3Lanes(Vec3f::UnitZ());
      if (any(left)) add(left, direct(places, Axes(places.normal), out, {left, rays.time}, random));
      rays.direction = select(left, -places.normal, rays.direction);
    }
    const Axes axes(places.normal);
    const Vec3Lanes away = axes.to_local(-rays.direction);
    const Vec3Lanes in = places.bsdf.sample(away, which, u);
    const LaneMask glass = both(rays.who, places.glass);
    walk.density = places.bsdf.density(away, in);
    rays.who = both(rays.who, glass | (walk.density > 0.0F));
    walk.weight = select(glass, walk.weight, walk.weight.cwiseProduct(places.bsdf.evaluate(away, in)) / walk.density);
    if (bounce > 1) {  // Russian roulette (Arvo & Kirk 1990)
      const Lanes stay = select(glass, all_lanes(1.0F), smaller(walk.weight.maxCoeff(), 0.95F));
      rays.who = both(rays.who, random.number() < stay);
      walk.weight = walk.weight / stay;
    }
    turns += select(glass, Lanes{}, 1.0F);
    rays.who = both(rays.who, turns <= static_cast<float>(settings_.bounces));
    if (!any(rays.who)) break;
    rays.from = select(glass, rays.from, places.leave);
    rays.direction = select(glass, rays.direction, axes.to_world(in));
    if (geometry_.has_glass()) pass_glass(places, axes, away, which, walk);

    const Lanes choice = random.number();
    const Meeting met = meet(rays, choice, places);
    if (geometry_.has_glass()) absorb(met, walk);
    const LaneMask outside = both(rays.who, ~(met.surface | met.lamp));
    const LaneMask sunny = both(outside, lights_.sun.contains(rays.direction));
    add(outside, lights_.sky(rays.direction));
    if (any(sunny)) add(sunny, sun_radiance_ * counted(walk, all_lanes(sun_density_)));
    if (any(met.lamp)) add(met.lamp, met.radiance * counted(walk, met.density));
    rays.who = met.surface;
    if (bounce == 1) nearness = select(met.surface, 1.0F / larger(met.distance, least_distance_), 0.0F);

    const Axes there(places.normal);
    const Vec3Lanes back = there.to_local(-rays.direction);
    rays.who = both(rays.who, back.z() > 0.0F);
    if (!any(rays.who)) break;
    add(rays.who, direct(places, there, back, {rays.who, rays.time}, random));
  }
  return sum;
}

Samples Tracer::sample(const Picks& picks) const {
  Random random(picks.x, picks.y, all_lanes(picks.stream), all_lanes(picks.count), picks.number);
  const RayBundle rays = camera_rays(picks, random);
  Places places{};
  const Meeting met = meet(rays, random.number(), places);

  Samples out;
  const LaneMask shown = met.surface | met.lamp;
  const Lanes of_ground = ground_ ? ground_share(places.point) : Lanes{};
  const Lanes cover = select(met.ground, of_ground, select(shown, all_lanes(1.0F), 0.0F));
  const BsdfOf<Lanes>& bsdf = places.bsdf;
  const auto on_surfaces = [&](const Vec3Lanes& v) { return select(met.surface, v, Vec3Lanes::Zero()); };
  out.mirror = select(both(met.surface, places.glass), all_lanes(1.0F), select(both(met.surface, bsdf.has_lobe()), larger(1.0F - bsdf.alpha * (1.0F / kWideLobe), 0.0F), 0.0F));
  const Axes axes(places.normal);
  const Vec3Lanes away = axes.to_local(-rays.direction);
  out.facet = {.cover = cover, .albedo = on_surfaces(bsdf.diffuse + bsdf.normal_reflectance),
               .reflectance = on_surfaces(bsdf.reflectance(away.z())), .normal = on_surfaces(places.normal),
               .position = on_surfaces(places.point)};
  const LaneMask lit = both(met.surface, both(cover > 0.0F, away.z() > 0.0F));
  out.direct = select(met.lamp, met.radiance, direct(places, axes, away, {lit, rays.time, true}, random));

  out.weight = select(picks.who, all_lanes(static_cast<float>(picks.share)), 0.0F);
  if (picks.sees_mirrors) out.weight = select(both(lit, out.mirror > kSharp), all_lanes(1.0F), out.weight);
  RayBundle paths = rays;
  paths.who = both(lit, out.weight > 0.0F);
  if (!any(paths.who)) return out;
  // A path that stands for several rays has the numbers of one of as many fewer.
  LaneBits count = all_lanes(picks.count), number = picks.number;
  if (picks.share > 1) {
    const auto alone = std::bit_cast<LaneBits>(out.weight == 1.0F);
    count = (count & alone) | (all_lanes(picks.count / picks.share) & ~alone);
    number = (number & alone) | ((number / picks.share) & ~alone);
  }
  Random further(picks.x, picks.y, all_lanes(picks.stream + 1u), count, number);
  out.indirect = indirect(places, paths, further, out.nearness);
  return out;
}

}  // namespace supple::render::path
