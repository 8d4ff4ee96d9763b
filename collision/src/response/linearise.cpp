#include "supple/collision/linearise.h"

#include <algorithm>

#include "supple/core/error.h"

namespace supple::collision {
namespace {

/// Appends the shares of one body at a point; a body without particles has none.
void add_shares(std::span<const std::uint32_t> particles, const implicit::FieldParts& parts, std::size_t point, double sign,
                core::ContactPoints& out) {
  if (particles.empty()) return;
  if (particles.size() == 1) {
    out.particle.push_back(particles[0]);
    out.share.push_back(sign);
    return;
  }
  double sum = 0.0;
  for (std::uint32_t e = parts.offset[point]; e < parts.offset[point + 1]; ++e) sum += parts.value[e];
  for (std::uint32_t e = parts.offset[point]; e < parts.offset[point + 1]; ++e) {
    out.particle.push_back(particles[parts.part[e]]);
    out.share.push_back(sign * parts.value[e] / sum);
  }
}

Vec3 velocity_of_whole(const ContactBody& body, const Vec3& x) {
  Vec3 v = body.velocity.empty() ? Vec3::Zero().eval() : body.velocity[0];
  if (!body.angular_velocity.empty()) v += body.angular_velocity[0].cross(x - body.pose[0].position);
  return v;
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
  std::size_t begin = 0, end = 0;                ///< on Sigma
  std::size_t inner_begin = 0, inner_end = 0;    ///< in both squeezed regions
  std::uint8_t side = 0;                         ///< 0: A, 1: B
  [[nodiscard]] double sign() const { return side == 0 ? -1.0 : 1.0; }  ///< of the pressure along N, as a force on the body
};

/// Forces on parts from the energy: integral of grad p_k over the squeezed region. @return false: none is known
bool add_energy_forces(const ContactBody& body, const SidePoints& at, LineariseScratch& scratch) {
  scratch.inner_point.clear();
  scratch.inner_weight.clear();
  for (std::size_t i = at.inner_begin; i < at.inner_end; ++i) {
    if (at.surface.volume_side[i] != at.side) continue;
    scratch.inner_point.push_back(at.surface.volume_point[i]);
    scratch.inner_weight.push_back(at.surface.volume_weight[i] * body.material.modulus);
  }
  if (scratch.inner_point.empty()) return false;
  const implicit::FieldParts& parts = scratch.inner_parts;
  body.field.evaluate_parts(scratch.inner_point, scratch.inner_parts);
  for (std::size_t i = 0; i < scratch.inner_point.size(); ++i) {
    for (std::uint32_t e = parts.offset[i]; e < parts.offset[i + 1]; ++e) {
      const std::uint32_t k = parts.part[e];
      const Vec3 f = scratch.inner_weight[i] * parts.gradient[e];
      scratch.force[k] += f;
      scratch.torque[k] += (scratch.inner_point[i] - body.pose[k].position).cross(f);
      if (!parts.by_turn.empty()) scratch.torque[k] -= scratch.inner_weight[i] * parts.by_turn[e];
    }
  }
  return true;
}

/// Takes from the parts what they get by their contributions on Sigma. @return integral of p dA [N]
double take_contributions(const ContactBody& body, const SidePoints& at, const implicit::FieldParts& parts, LineariseScratch& scratch) {
  double load = 0.0;
  for (std::size_t i = at.begin; i < at.end; ++i) {
    const double force = at.surface.area[i] * at.surface.pressure[i];
    const Vec3 f = at.sign() * force * at.surface.normal[i];
    const std::size_t row = i - at.begin;
    double sum = 0.0;
    for (std::uint32_t e = parts.offset[row]; e < parts.offset[row + 1]; ++e) sum += parts.value[e];
    for (std::uint32_t e = parts.offset[row]; e < parts.offset[row + 1]; ++e) {
      const std::uint32_t k = parts.part[e];
      const double share = parts.value[e] / sum;
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
  if (!add_energy_forces(body, at, scratch)) return;
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

void linearise_contacts(std::span<const ContactBody> bodies, const ContactRules& rules, const ContactSurface& surface, SplitRule split,
                        std::span<const std::span<const std::uint32_t>> particles, LineariseScratch& scratch, core::ContactPoints& out) {
  SUPPLE_EXPECTS(particles.size() == bodies.size());
  out.clear();
  out.offset.push_back(0);
  std::size_t begin = 0, inner_begin = 0;
  for (std::size_t k = 0; k < surface.summary.size(); ++k) {
    std::size_t end = begin;
    while (end < surface.pair.size() && surface.pair[end] == k) ++end;
    std::size_t inner_end = inner_begin;
    while (inner_end < surface.volume_pair.size() && surface.volume_pair[inner_end] == k) ++inner_end;
    const BodyPair& pair = surface.summary[k].bodies;
    const ContactBody &a = bodies[pair.a], &b = bodies[pair.b];
    const PairMaterial material = material_of(bodies, rules, pair);
    const core::ObstacleSide obstacle = obstacle_of(particles[pair.a], particles[pair.b]);
    core::ContactPoints::Pair row{.begin = static_cast<std::uint32_t>(out.point.size()),
                                  .friction = material.friction,
                                  .dissipation = material.dissipation,
                                  .obstacle = obstacle};
    const std::size_t n = end - begin;
    const std::span<const Vec3> x = std::span(surface.point).subspan(begin, n);
    scratch.value.resize(n);
    scratch.gradient_a.resize(n);
    scratch.gradient_b.resize(n);
    a.field.evaluate(x, scratch.value, scratch.gradient_a);
    b.field.evaluate(x, scratch.value, scratch.gradient_b);
    if (particles[pair.a].size() > 1) a.field.evaluate_parts(x, scratch.parts_a);
    if (particles[pair.b].size() > 1) b.field.evaluate_parts(x, scratch.parts_b);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3& normal = surface.normal[begin + i];
      out.point.push_back(x[i]);
      out.normal.push_back(normal);
      out.weight.push_back(surface.area[begin + i]);
      out.pressure.push_back(surface.pressure[begin + i]);
      out.slope.push_back(slope_of(-a.material.modulus * scratch.gradient_a[i].dot(normal), b.material.modulus * scratch.gradient_b[i].dot(normal)));
      out.obstacle_velocity.push_back(obstacle == core::ObstacleSide::None ? Vec3::Zero().eval()
                                                                           : velocity_of_whole(obstacle == core::ObstacleSide::B ? b : a, x[i]));
      add_shares(particles[pair.a], scratch.parts_a, i, 1.0, out);
      add_shares(particles[pair.b], scratch.parts_b, i, -1.0, out);
      out.offset.push_back(static_cast<std::uint32_t>(out.particle.size()));
    }
    row.end = static_cast<std::uint32_t>(out.point.size());
    row.split_begin = static_cast<std::uint32_t>(out.split_particle.size());
    SidePoints at{.surface = surface, .pair = k, .begin = begin, .end = end, .inner_begin = inner_begin, .inner_end = inner_end};
    if (split == SplitRule::Energy && particles[pair.a].size() > 1) add_split(a, particles[pair.a], at, scratch.parts_a, scratch, out);
    at.side = 1;
    if (split == SplitRule::Energy && particles[pair.b].size() > 1) add_split(b, particles[pair.b], at, scratch.parts_b, scratch, out);
    row.split_end = static_cast<std::uint32_t>(out.split_particle.size());
    out.pair.push_back(row);
    begin = end;
    inner_begin = inner_end;
  }
}

}  // namespace supple::collision
