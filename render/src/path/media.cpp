/// @file media.cpp
/// Light that goes into bodies: refraction by glass, and random walks through what scatters it.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "path/tracer.h"

namespace supple::render::path {
namespace {

constexpr int kFreeSteps = 8;     // of a random walk before it may end by chance
constexpr int kMostSteps = 2048;  // after which it leaves where it came in

/// Single-scattering albedo of a thick body of that albedo under even light, for even scattering (van de Hulst 1980; inverted by Kulla & Conty 2017).
Vec3f single_albedo(const Vec3f& thick) {
  return thick.unaryExpr([](float a) {
    const float bounded = std::clamp(a, 0.0F, 1.0F), b = 1.139F + 1.17F * bounded;
    const float s = 2.0F * (1.0F - bounded) / (b + std::sqrt(b * b - 0.556F * (1.0F - bounded)));
    return 1.0F - std::min(s * s, 1.0F);
  });
}

/// Random numbers of one walk.
class WalkRandom {
 public:
  explicit WalkRandom(std::uint32_t seed) : seed_(hash(seed)) {}
  float number() { return static_cast<float>(hash(seed_ + 0x9e3779b9u * ++count_) >> 8) * 0x1p-24F; }
  Vec3f direction() {
    const float z = 2.0F * number() - 1.0F, angle = 2.0F * kPi * number(), across = std::sqrt(std::max(0.0F, 1.0F - z * z));
    return {across * std::cos(angle), across * std::sin(angle), z};
  }

 private:
  std::uint32_t seed_;
  std::uint32_t count_ = 0;
};

LaneBits chosen(LaneMask mask, LaneBits yes, LaneBits no) {
  const auto bits = std::bit_cast<LaneBits>(mask);
  return (yes & bits) | (no & ~bits);
}

}  // namespace

void Tracer::put_inside(const Hit& hit, std::size_t lane, Places& places) const {
  const Medium& medium = geometry_.medium(hit.item);
  const bool opaque = medium.kind == InsideKind::Opaque || hit.wire;
  places.bsdf.local[lane] = opaque ? 1.0F : 0.0F;
  if (opaque) return;
  places.item[lane] = hit.item + 1;
  places.pass.set_lane(lane, hit.pass);
  if (medium.kind == InsideKind::Scatter) {
    places.scatter[lane] = -1;
    return;
  }
  places.glass[lane] = -1;
  places.back[lane] = hit.back ? -1 : 0;
  places.ratio[lane] = hit.back ? medium.index : 1.0F / medium.index;
  places.bsdf.diffuse.set_lane(lane, Vec3f::Ones());
  places.bsdf.normal_reflectance.set_lane(lane, Vec3f::Zero());
  places.bsdf.grazing_reflectance[lane] = 0.0F;
}

/// Paths that met glass are reflected or go through, by chance.
void Tracer::pass_glass(const Places& places, const Axes& axes, const Vec3Lanes& away, Lanes which, Walk& walk) const {
  const LaneMask glass = both(walk.rays.who, places.glass);
  const RefractionOf<Lanes> refraction(away.z(), places.ratio);
  const LaneMask reflects = which < refraction.reflected;
  const Vec3Lanes past(-places.ratio * away.x(), -places.ratio * away.y(), -refraction.cosine);
  const Vec3Lanes local = select(reflects, Vec3Lanes(-away.x(), -away.y(), away.z()), past);
  walk.rays.direction = select(glass, axes.to_world(local).normalized(), walk.rays.direction);
  walk.rays.from = select(glass, select(reflects, places.leave, places.pass), walk.rays.from);
  const LaneMask passes = both(glass, ~reflects);
  walk.rays.inside = chosen(passes, chosen(places.back, LaneBits{}, places.item), walk.rays.inside);
  // What is mirrored from outside is in glint().
  walk.no_lights = both(glass, both(reflects, ~places.back) | ~walk.from_eye);
  walk.lights = both(glass, ~walk.no_lights);
  walk.from_eye = both(walk.from_eye, glass);
}

/// What a path inside of glass loses on its way.
void Tracer::absorb(const Meeting& met, Walk& walk) const {
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (walk.rays.who[k] == 0 || walk.rays.inside[k] == 0 || !(met.distance[k] < INFINITY)) continue;
    const Vec3f& absorption = geometry_.medium(walk.rays.inside[k] - 1).absorption;
    walk.weight.set_lane(k, walk.weight.lane(k).cwiseProduct((-met.distance[k] * absorption).array().exp().matrix()));
  }
}

/// Sun and lamps in the mirror of a surface of glass.
Vec3Lanes Tracer::glint(const Places& places, const Axes& axes, const Vec3Lanes& out, const LightRays& to) const {
  const LaneMask who = both(to.who, both(places.glass, ~places.back));
  if (!any(who)) return Vec3Lanes::Zero();
  const Vec3Lanes direction = axes.to_world(Vec3Lanes(-out.x(), -out.y(), out.z()));
  Lanes distance = all_lanes(INFINITY);
  Vec3Lanes radiance = select(lights_.sun.contains(direction), sun_radiance_, Vec3Lanes::Zero());
  for (const Rectangle& lamp : lights_.rectangles) {
    const Lanes t = lamp.distance(places.leave, direction);
    radiance = select(t < distance, Vec3Lanes(lamp.radiance), radiance);
    distance = smaller(t, distance);
  }
  const LaneMask lit = both(who, radiance.maxCoeff() > 0.0F);
  if (!any(lit)) return Vec3Lanes::Zero();
  const LaneMask blocked = geometry_.blocked({.from = places.leave, .direction = direction, .time = to.time, .who = lit}, distance * 0.9999F);
  const RefractionOf<Lanes> refraction(out.z(), places.ratio);
  return select(both(lit, ~blocked), radiance * refraction.reflected, Vec3Lanes::Zero());
}

/// Share of light that glass between a place and a light lets pass.
Vec3Lanes Tracer::past_glass(const LightRays& to, const Vec3Lanes& from, const Vec3Lanes& direction, Lanes distance, LaneMask lit) const {
  Vec3Lanes share = Vec3Lanes::Ones();
  for (std::size_t k = 0; k < kLanes; ++k)
    if (lit[k] != 0) share.set_lane(k, geometry_.passed_by_glass(from.lane(k), direction.lane(k), to.time[k], distance[k]));
  return share;
}

/// Paths that took the base of a body that scatters go on where they leave it, as from a white matt surface.
/// @return which did
LaneMask Tracer::scatter_inside(Places& places, const Vec3Lanes& away, Lanes which, Lanes seed, Walk& walk) const {
  const Lanes lobe = places.bsdf.lobe_share(away);
  const LaneMask enter = both(both(walk.rays.who, places.scatter), which >= lobe);
  if (!any(enter)) return enter;
  const Vec3Lanes passed = places.bsdf.passed(away.z()) / (1.0F - lobe);
  LaneMask left{};
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (enter[k] == 0) continue;
    Exit at{places.point.lane(k), places.normal.lane(k), places.leave.lane(k), places.pass.lane(k)};
    const Vec3f share = scattered(places.item[k] - 1, places.bsdf.diffuse.lane(k), std::bit_cast<LaneBits>(seed)[k], walk.rays.time[k], at);
    walk.weight.set_lane(k, walk.weight.lane(k).cwiseProduct(passed.lane(k)).cwiseProduct(share));
    places.point.set_lane(k, at.point);
    places.normal.set_lane(k, at.normal);
    places.leave.set_lane(k, at.leave);
    places.bsdf.diffuse.set_lane(k, Vec3f::Ones());
    places.bsdf.normal_reflectance.set_lane(k, Vec3f::Zero());
    places.bsdf.grazing_reflectance[k] = 0.0F;
    places.bsdf.local[k] = 1.0F;
    places.scatter[k] = 0;
    left[k] = share.maxCoeff() > 0.0F ? -1 : 0;
  }
  walk.rays.who = both(walk.rays.who, left | ~enter);
  return left;
}

/// A random walk through an item of this albedo. @param at  where light comes in; then where it leaves
/// @return share of it that does
Vec3f Tracer::scattered(std::uint32_t item, const Vec3f& albedo, std::uint32_t seed, float time, Exit& at) const {
  const Vec3f again = single_albedo(albedo);
  const float free_path = geometry_.medium(item).mean_free_path;
  WalkRandom random(seed);
  const float first = random.number(), second = random.number();
  const AxesOf<float> inward(Vec3f(-at.normal));
  Vec3f from = at.pass, direction = inward.to_world(cosine_direction<float>({first, second})), share = Vec3f::Ones();
  for (int step = 0; step < kMostSteps; ++step) {
    const float reach = -free_path * std::log(1.0F - random.number());
    if (Hit end; geometry_.leave(item, from, direction, time, reach, end)) {
      at.point = end.point;
      at.normal = -end.normal;
      at.leave = end.pass;
      return share;
    }
    from += reach * direction;
    share = share.cwiseProduct(again);
    if (step >= kFreeSteps) {
      const float stay = share.maxCoeff();
      if (!(random.number() < stay)) return Vec3f::Zero();
      share /= stay;
    }
    direction = random.direction();
  }
  return share;
}

}  // namespace supple::render::path
