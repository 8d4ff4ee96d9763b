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

}  // namespace

void linearise_contacts(std::span<const ContactBody> bodies, const ContactRules& rules, const ContactSurface& surface,
                        std::span<const std::span<const std::uint32_t>> particles, LineariseScratch& scratch, core::ContactPoints& out) {
  SUPPLE_EXPECTS(particles.size() == bodies.size());
  out.clear();
  out.offset.push_back(0);
  std::size_t begin = 0;
  for (std::size_t k = 0; k < surface.summary.size(); ++k) {
    std::size_t end = begin;
    while (end < surface.pair.size() && surface.pair[end] == k) ++end;
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
    out.pair.push_back(row);
    begin = end;
  }
}

}  // namespace supple::collision
