#include "model/arrangement.h"

#include <cmath>
#include <vector>

#include "file/fields_particles.h"
#include "supple/core/integrate.h"
#include "supple/core/io/mesh_files.h"

namespace supple::scenes {
namespace {

core::NormalDirection direction_of(NormalKind normal) {
  return normal == NormalKind::Radial ? core::NormalDirection::Radial : core::NormalDirection::Axis;
}

/// The shortest rotation from z to a direction.
Quat from_z_to(const Vec3& direction) {
  const Vec3 a = direction.normalized();
  if (a.z() < -1.0 + 1e-12) return Quat(0.0, 1.0, 0.0, 0.0);
  return Quat(1.0 + a.z(), -a.y(), a.x(), 0.0).normalized();
}

}  // namespace

core::Arrangement arrange(const Scene& scene, const ParticlesDesc& d, const std::string& key, ModelFaults& faults) {
  core::Arrangement out;
  switch (d.arrange) {
    case ArrangeKind::Single: out = core::arrange_single(); break;
    case ArrangeKind::Line: out = core::arrange_line(d.count, d.spacing); break;
    case ArrangeKind::Ring: out = core::arrange_ring(d.count, d.radius, direction_of(d.normal)); break;
    case ArrangeKind::Grid: out = core::arrange_grid(d.columns, d.rows, d.spacing, d.layers); break;
    case ArrangeKind::Spiral:
      out = core::arrange_spiral(d.count, d.inner_radius, d.outer_radius, d.turns, direction_of(d.normal));
      break;
    case ArrangeKind::Geodesic: out = core::arrange_geodesic(d.frequency, d.radius); break;
    case ArrangeKind::File:
      out.position = faults.read(key + ".file", [&] { return io::read_points_csv(named_file(files_of(scene), d.file), static_cast<std::size_t>(kMostCount)); }).value_or(std::vector<Vec3>());
      out.orientation.assign(out.position.size(), Quat::Identity());
      break;
  }
  if (d.disorder > 0.0) core::disorder(out, d.disorder);
  core::place(out, Pose{d.at, from_z_to(d.axis) * core::rotation_exp(d.angle * Vec3::UnitZ())});
  return out;
}

}  // namespace supple::scenes
