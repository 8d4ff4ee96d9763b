#include "response/energy_loads.h"

#include <numeric>

namespace supple::collision {

Range advance_range(const std::vector<std::uint32_t>& sorted, std::size_t begin, std::uint32_t k) {
  std::size_t end = begin;
  while (end < sorted.size() && sorted[end] == k) ++end;
  return {begin, end};
}

Vec3 velocity_of(const ContactBody& body, std::size_t part, const Vec3& x) {
  Vec3 v = body.velocity.empty() ? Vec3::Zero().eval() : body.velocity[part];
  if (!body.angular_velocity.empty()) v += body.angular_velocity[part].cross(x - body.pose[part].position);
  return v;
}

void contributions_at(const ContactBody& body, std::span<const Vec3> points, implicit::FieldParts& out) {
  const std::size_t n = points.size();
  if (body.pose.size() == 1) {
    out.offset.resize(n + 1);
    std::iota(out.offset.begin(), out.offset.end(), 0u);
    out.part.assign(n, 0);
    out.value.assign(n, 1.0);
    return;
  }
  body.field.evaluate_parts(points, out);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = 0.0;
    for (std::uint32_t e = out.offset[i]; e < out.offset[i + 1]; ++e) sum += out.value[e];
    for (std::uint32_t e = out.offset[i]; e < out.offset[i + 1]; ++e) out.value[e] /= sum;
  }
}

Squeezed squeezed_of(const ContactSurface& surface, const Range& volume) {
  const std::size_t n = volume.end - volume.begin;
  return {std::span(surface.volume_point).subspan(volume.begin, n), std::span(surface.volume_weight).subspan(volume.begin, n),
          std::span(surface.volume_side).subspan(volume.begin, n)};
}

bool add_energy_loads(const ContactBody& body, const Squeezed& volume, std::uint8_t side, EnergyScratch& scratch, std::span<Vec3> force,
                      std::span<Vec3> torque) {
  scratch.point.clear();
  scratch.weight.clear();
  for (std::size_t i = 0; i < volume.point.size(); ++i) {
    if (volume.side[i] != side) continue;
    scratch.point.push_back(volume.point[i]);
    scratch.weight.push_back(volume.weight[i] * body.material.modulus);
  }
  body.field.evaluate_parts(scratch.point, scratch.rows);
  const implicit::FieldParts& rows = scratch.rows;
  for (std::size_t i = 0; i < scratch.point.size(); ++i) {
    for (std::uint32_t e = rows.offset[i]; e < rows.offset[i + 1]; ++e) {
      const std::size_t k = rows.part[e];
      const Vec3 f = scratch.weight[i] * rows.gradient[e];
      force[k] += f;
      torque[k] += (scratch.point[i] - body.pose[k].position).cross(f);
      if (!rows.by_turn.empty()) torque[k] -= scratch.weight[i] * rows.by_turn[e];
    }
  }
  return !scratch.point.empty();
}

}  // namespace supple::collision
