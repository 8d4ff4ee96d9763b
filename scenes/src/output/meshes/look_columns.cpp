#include "output/meshes/look_columns.h"

#include <algorithm>

#include "supple/core/parts.h"
#include "supple/implicit/mesh_columns.h"

namespace supple::scenes {
namespace {

/// Mean of d / d0 - 1 of the bonded pairs of each particle of a body.
std::vector<double> mean_stretch(const Model& model, const Body& body, const core::ParticleState& particles,
                                 const core::Interactions& laws) {
  std::vector<double> sum(particles.size(), 0.0), count(particles.size(), 0.0);
  const ObjectModel& object = model.objects[body.object];
  for (const auto& [a, b] : core::bonded_pairs(laws)) {
    if (a < object.first || a >= object.last) continue;
    const double rest = (model.rest.position[a] - model.rest.position[b]).norm();
    if (!(rest > 0.0)) continue;
    const double stretch = (particles.position[a] - particles.position[b]).norm() / rest - 1.0;
    for (const std::uint32_t i : {a, b}) {
      sum[i] += stretch;
      count[i] += 1.0;
    }
  }
  std::vector<double> out;
  for (const std::uint32_t i : body.particle) out.push_back(count[i] > 0.0 ? sum[i] / count[i] : 0.0);
  return out;
}

/// The smaller one of two bodies' pressures at each place [Pa].
std::vector<double> smaller_pressures(const collision::ContactBody& a, const collision::ContactBody& b, std::span<const Vec3> places) {
  std::vector<double> in_a(places.size()), in_b(places.size());
  a.field.evaluate(places, in_a);
  b.field.evaluate(places, in_b);
  for (std::size_t k = 0; k < places.size(); ++k) in_a[k] = std::min(a.material.modulus * in_a[k], b.material.modulus * in_b[k]);
  return in_a;
}

/// For points of a body's surface inside a fixed one, which does not cut it: the pressure of the contact surface on the way out of the fixed body, straight up
/// its gradient. Where that leaves the body: not positive.
std::vector<double> pressures_on_way_out(const collision::ContactBody& body, const collision::ContactBody& fixed, std::span<const Vec3> points) {
  constexpr int kHalvings = 30;  // the place is right within 1e-9 of the way
  std::vector<double> depth(points.size()), inside(points.size()), in_fixed(points.size()), low(points.size(), 0.0), high(points.size(), 1.0);
  std::vector<Vec3> gradient(points.size()), place(points.size());
  fixed.field.evaluate(points, depth, gradient);
  const auto take_middle = [&] {
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double square = gradient[k].squaredNorm();
      place[k] = square > 0.0 ? Vec3(points[k] - 0.5 * (low[k] + high[k]) * depth[k] / square * gradient[k]) : points[k];
    }
  };
  for (int n = 0; n < kHalvings; ++n) {
    take_middle();
    body.field.evaluate(place, inside);
    fixed.field.evaluate(place, in_fixed);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const bool before = body.material.modulus * inside[k] < fixed.material.modulus * in_fixed[k];
      (before ? low[k] : high[k]) = 0.5 * (low[k] + high[k]);
    }
  }
  take_middle();
  return smaller_pressures(body, fixed, place);
}

/// Pressures at points of a body's surface that lie inside a fixed body, and 0 at the others.
std::vector<double> pressures_in_fixed(const collision::ContactBody& body, const collision::ContactBody& fixed, std::span<const Vec3> points) {
  std::vector<double> out(points.size());
  fixed.field.evaluate(points, out);
  std::vector<Vec3> within;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (out[k] > 0.0) within.push_back(points[k]);
  }
  const std::vector<double> found = pressures_on_way_out(body, fixed, within);
  std::size_t next = 0;
  for (double& value : out) value = value > 0.0 ? found[next++] : 0.0;
  return out;
}

}  // namespace

void add_look_columns(const Model& model, const LookedAt& now, const Executor& executor, Mesh& mesh) {
  const auto& [body, particles, laws, field, poses] = now;
  const LookDesc& look = model.objects[body.object].look;
  std::vector<Vec3> places;
  for (const Pose& pose : poses) places.push_back(pose.position);
  if (look.texture) {
    const ObjectModel& object = model.objects[body.object];
    Vec3 origin = Vec3::Zero();
    for (std::uint32_t i = object.first; i < object.last; ++i) origin += model.rest.position[i] / (object.last - object.first);
    std::vector<Pose> rest;
    core::gather_poses(model.rest, body.particle, rest);
    std::vector<implicit::PartPlace> parts;
    for (std::size_t k = 0; k < poses.size(); ++k) parts.push_back({.now = poses[k], .rest = rest[k]});
    implicit::add_rest_coordinates(field, parts, origin, executor, mesh);
  }
  if (look.colour_by == ColourByName::Stretch)
    implicit::add_part_values(field, places, mean_stretch(model, body, particles, laws), "stretch", executor, mesh);
  if (look.colour_by == ColourByName::Speed) {
    std::vector<Vec3> velocity, spin;
    core::gather_motion(model.particles, particles, body.particle, velocity, spin);
    std::vector<implicit::PartMotion> parts;
    for (std::size_t k = 0; k < places.size(); ++k)
      parts.push_back({.centre = places[k], .velocity = velocity[k], .angular_velocity = spin[k], .id = body.particle[k]});
    implicit::add_speed(field, parts, executor, mesh);
  }
}

void add_pressure(std::span<const collision::ContactBody> bodies, const collision::ContactSurface& surface, std::uint32_t body,
                  const Executor& executor, Mesh& mesh) {
  constexpr std::size_t kBlock = 1024;
  std::vector<double> pressure(mesh.vertex_count(), 0.0);
  for (const auto& s : surface.summary) {
    if (s.bodies.a != body && s.bodies.b != body) continue;
    const collision::ContactBody &own = bodies[body], &other = bodies[s.bodies.a == body ? s.bodies.b : s.bodies.a];
    executor.for_blocks(pressure.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      const std::span<const Vec3> points = std::span(mesh.position).subspan(begin, end - begin);
      const std::vector<double> here = other.fixed ? pressures_in_fixed(own, other, points) : smaller_pressures(own, other, points);
      for (std::size_t k = 0; k < points.size(); ++k) pressure[begin + k] = std::max(pressure[begin + k], here[k]);
    });
  }
  mesh.columns.push_back({.name = "pressure", .values = std::move(pressure)});
}

}  // namespace supple::scenes
