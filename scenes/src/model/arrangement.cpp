#include "model/arrangement.h"

#include <cmath>
#include <vector>

#include "file/fields/fields_particles.h"
#include "supple/core/error.h"
#include "supple/core/integrate.h"
#include "supple/core/io/particle_files.h"
#include "supple/core/io/read_mesh.h"
#include "supple/implicit/mesh_solid.h"

namespace supple::scenes {
namespace {

core::NormalDirection direction_of(NormalKind normal) {
  return normal == NormalKind::Radial ? core::NormalDirection::Radial : core::NormalDirection::Axis;
}

constexpr auto kMost = static_cast<std::size_t>(kMostCount);

/// The points of a cubic lattice about the middle of a closed mesh that lie inside it.
core::Arrangement fill_mesh(const Scene& scene, const ParticlesDesc& d, const std::string& key, ModelFaults& faults) try {
  core::Arrangement out;
  const auto read = faults.read(key + ".file", [&] { return io::read_mesh(named_file(files_of(scene), d.file)); });
  if (!read) return out;
  const implicit::MeshSolid solid(*read, {.slope = 1.0, .pose = {}});
  const Box box = solid.surface_box();
  const Vec3 middle = 0.5 * (box.lower + box.upper), reach = (0.5 * box.extent() / d.spacing).array().floor();
  constexpr double kMostPoints = 2.0 * kMostCount;  // around the mesh
  if (const double points = (2.0 * reach + Vec3::Ones()).prod(); points > kMostPoints) {
    faults.add(key + ".spacing", "expected at most " + number_text(kMostPoints) + " points of a lattice around the mesh", short_text(points), "enlarge it");
    return out;
  }
  std::vector<Vec3> row;
  std::vector<double> value;
  for (double z = -reach.z(); z <= reach.z(); z += 1.0) {
    for (double y = -reach.y(); y <= reach.y(); y += 1.0) {
      row.clear();
      for (double x = -reach.x(); x <= reach.x(); x += 1.0) row.emplace_back(middle + d.spacing * Vec3(x, y, z));
      value.resize(row.size());
      solid.evaluate(row, value);
      for (std::size_t k = 0; k < row.size(); ++k) {
        if (!(value[k] >= 0.0)) continue;
        out.position.push_back(row[k]);
        out.orientation.push_back(Quat::Identity());
      }
    }
  }
  if (out.size() == 0) faults.add(key + ".spacing", "expected a spacing that leaves particles inside the mesh", number_text(d.spacing), "reduce it");
  return out;
} catch (const Error& error) {
  if (error.kind() != ErrorKind::Scene) throw;
  const Fault& fault = error.faults().front();
  faults.add(key + ".file", fault.expected, fault.found, fault.hint);
  return {};
}

core::Arrangement along_curve(const ParticlesDesc& d, const std::string& key, ModelFaults& faults) {
  for (std::size_t k = 1; k < d.points.size(); ++k) {
    if (d.points[k] != d.points[k - 1]) continue;
    faults.add(key + ".points[" + std::to_string(k) + ']', "expected a point apart from the one before it", "the same", "");
    return {};
  }
  return core::arrange_curve(d.points, d.count);
}

core::Arrangement scattered(const ParticlesDesc& d, const std::string& key, ModelFaults& faults) {
  core::Arrangement out = core::arrange_scatter(d.size, d.count, d.spacing, d.seed);
  if (out.size() == static_cast<std::size_t>(d.count)) return out;
  faults.add(key + ".count", "expected a count for which a hundred tries for each particle find places", "only " + std::to_string(out.size()) + " places",
             "reduce 'count' or 'spacing', or enlarge 'size'");
  return {};
}

/// The shortest rotation from z to a direction.
Quat from_z_to(const Vec3& direction) {
  const Vec3 a = direction.normalized();
  if (a.z() < -1.0 + 1e-12) return Quat(0.0, 1.0, 0.0, 0.0);
  return Quat(1.0 + a.z(), -a.y(), a.x(), 0.0).normalized();
}

/// z along the normal, x as near to the direction as it allows.
Quat frame_of(const Vec3& normal, const Vec3& direction) {
  Mat3 axes;
  axes.col(2) = normal.normalized();
  const Vec3 along = direction - direction.dot(axes.col(2)) * axes.col(2);
  axes.col(0) = along.norm() > 1e-6 * direction.norm() ? Vec3(along.normalized()) : Vec3(axes.col(2).unitOrthogonal());
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return Quat(axes);
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
    case ArrangeKind::Ball: out = core::arrange_ball(d.radius, d.spacing); break;
    case ArrangeKind::Tube: out = core::arrange_tube(d.radius, d.length, d.spacing); break;
    case ArrangeKind::Curve: out = along_curve(d, key, faults); break;
    case ArrangeKind::Scatter: out = scattered(d, key, faults); break;
    case ArrangeKind::Fill: out = fill_mesh(scene, d, key, faults); break;
    case ArrangeKind::Points:
      out.position = d.points;
      out.orientation.assign(d.points.size(), Quat::Identity());
      for (std::size_t i = 0; i < d.normals.size(); ++i) out.orientation[i] = frame_of(d.normals[i], d.directions[i]);
      break;
    case ArrangeKind::File:
      out = faults.read(key + ".file", [&] { return io::read_particles(named_file(files_of(scene), d.file), kMost); }).value_or(core::Arrangement());
      break;
  }
  if (d.disorder > 0.0) core::disorder(out, d.disorder);
  core::place(out, Pose{d.at, from_z_to(d.axis) * core::rotation_exp(d.angle * Vec3::UnitZ())});
  return out;
}

}  // namespace supple::scenes
