#include "supple/collision/linearise.h"

#include <algorithm>

#include "response/energy_loads.h"
#include "supple/core/error.h"

namespace supple::collision {
namespace {

/// Appends the shares of one body at a point; a body without particles has none. @param parts  contributions
void add_shares(std::span<const std::uint32_t> particles, const implicit::FieldParts& parts, std::size_t point, double sign,
                core::ContactPoints& out) {
  if (particles.empty()) return;
  if (particles.size() == 1) {
    out.particle.push_back(particles[0]);
    out.share.push_back(sign);
    return;
  }
  for (std::uint32_t e = parts.offset[point]; e < parts.offset[point + 1]; ++e) {
    out.particle.push_back(particles[parts.part[e]]);
    out.share.push_back(sign * parts.value[e]);
  }
}

core::ObstacleSide obstacle_of(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) {
  if (b.empty()) return core::ObstacleSide::B;
  return a.empty() ? core::ObstacleSide::A : core::ObstacleSide::None;
}

/// Slope of the pressure in the approach from the slopes of both pressures along the normal; a field may be flat in its middle.
double slope_of(double a, double b) { return a > 0.0 && b > 0.0 ? a * b / (a + b) : 0.0; }

/// The points of one pair, as one of its bodies has them.
struct SidePoints {
  const ContactSurface& surface;
  std::size_t pair = 0;
  Range points;                                  ///< on Sigma
  Range volume;                                  ///< in both squeezed regions
  std::uint8_t side = 0;                         ///< 0: A, 1: B
  [[nodiscard]] double sign() const { return side == 0 ? -1.0 : 1.0; }  ///< of the pressure along N, as a force on the body
};

/// Takes from the parts what they get by their contributions on Sigma. @return integral of p dA [N]
double take_contributions(const ContactBody& body, const SidePoints& at, const implicit::FieldParts& parts, LineariseScratch& scratch) {
  double load = 0.0;
  for (std::size_t i = at.points.begin; i < at.points.end; ++i) {
    const double force = at.surface.area[i] * at.surface.pressure[i];
    const Vec3 f = at.sign() * force * at.surface.normal[i];
    const std::size_t row = i - at.points.begin;
    for (std::uint32_t e = parts.offset[row]; e < parts.offset[row + 1]; ++e) {
      const std::uint32_t k = parts.part[e];
      const double share = parts.value[e];
      scratch.force[k] -= share * f;
      scratch.torque[k] -= share * (at.surface.point[i] - body.pose[k].position).cross(f);
      scratch.share[k] += share * force;
    }
    load += force;
  }
  return load;
}

/// Appends the difference of both splits on one body. What quadrature leaves of its force and moment is spread as `react` does.
void add_split(const ContactBody& body, std::span<const std::uint32_t> particles, const SidePoints& at, const implicit::FieldParts& parts,
               LineariseScratch& scratch, core::ContactPoints& out) {
  const std::size_t count = particles.size();
  scratch.force.assign(count, Vec3::Zero());
  scratch.torque.assign(count, Vec3::Zero());
  scratch.share.assign(count, 0.0);
  if (!add_energy_loads(body, squeezed_of(at.surface, at.volume), at.side, scratch.energy, scratch.force, scratch.torque)) return;
  const double load = take_contributions(body, at, parts, scratch);
  if (!(load > 0.0)) return;
  const Vec3& centre = at.surface.summary[at.pair].centre_of_pressure;
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    force += scratch.force[k];
    moment += (body.pose[k].position - centre).cross(scratch.force[k]) + scratch.torque[k];
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double share = scratch.share[k] / load;
    const Vec3 f = scratch.force[k] - share * force;
    const Vec3 torque = scratch.torque[k] - share * ((centre - body.pose[k].position).cross(force) + moment);
    if (f == Vec3::Zero() && torque == Vec3::Zero()) continue;
    out.split_particle.push_back(particles[k]);
    out.split_force.push_back(f);
    out.split_torque.push_back(torque);
  }
}

}  // namespace

void linearise_contacts(const ReactionInputs& in, std::span<const std::span<const std::uint32_t>> particles, LineariseScratch& scratch,
                        core::ContactPoints& out) {
  const std::span<const ContactBody> bodies = in.bodies;
  const ContactSurface& surface = in.surface;
  SUPPLE_EXPECTS(particles.size() == bodies.size());
  out.clear();
  out.offset.push_back(0);
  Range points, volume;
  for (std::uint32_t k = 0; k < surface.summary.size(); ++k) {
    points = advance_range(surface.pair, points.end, k);
    volume = advance_range(surface.volume_pair, volume.end, k);
    const BodyPair& pair = surface.summary[k].bodies;
    const ContactBody &a = bodies[pair.a], &b = bodies[pair.b];
    const PairMaterial material = material_of(bodies, in.rules, pair);
    const core::ObstacleSide obstacle = obstacle_of(particles[pair.a], particles[pair.b]);
    core::ContactPoints::Pair row{.begin = static_cast<std::uint32_t>(out.point.size()),
                                  .friction = material.friction,
                                  .dissipation = material.dissipation,
                                  .obstacle = obstacle};
    const std::size_t n = points.end - points.begin;
    const std::span<const Vec3> x = std::span(surface.point).subspan(points.begin, n);
    scratch.value.resize(n);
    scratch.gradient_a.resize(n);
    scratch.gradient_b.resize(n);
    a.field.evaluate(x, scratch.value, scratch.gradient_a);
    b.field.evaluate(x, scratch.value, scratch.gradient_b);
    if (particles[pair.a].size() > 1) contributions_at(a, x, scratch.parts_a);
    if (particles[pair.b].size() > 1) contributions_at(b, x, scratch.parts_b);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3& normal = surface.normal[points.begin + i];
      out.point.push_back(x[i]);
      out.normal.push_back(normal);
      out.weight.push_back(surface.area[points.begin + i]);
      out.pressure.push_back(surface.pressure[points.begin + i]);
      out.slope.push_back(slope_of(-a.material.modulus * scratch.gradient_a[i].dot(normal), b.material.modulus * scratch.gradient_b[i].dot(normal)));
      out.obstacle_velocity.push_back(obstacle == core::ObstacleSide::None ? Vec3::Zero().eval()
                                                                           : velocity_of(obstacle == core::ObstacleSide::B ? b : a, 0, x[i]));
      add_shares(particles[pair.a], scratch.parts_a, i, 1.0, out);
      add_shares(particles[pair.b], scratch.parts_b, i, -1.0, out);
      out.offset.push_back(static_cast<std::uint32_t>(out.particle.size()));
    }
    row.end = static_cast<std::uint32_t>(out.point.size());
    row.split_begin = static_cast<std::uint32_t>(out.split_particle.size());
    SidePoints at{.surface = surface, .pair = k, .points = points, .volume = volume};
    if (in.settings.split == SplitRule::Energy && particles[pair.a].size() > 1) add_split(a, particles[pair.a], at, scratch.parts_a, scratch, out);
    at.side = 1;
    if (in.settings.split == SplitRule::Energy && particles[pair.b].size() > 1) add_split(b, particles[pair.b], at, scratch.parts_b, scratch, out);
    row.split_end = static_cast<std::uint32_t>(out.split_particle.size());
    out.pair.push_back(row);
  }
}

}  // namespace supple::collision
