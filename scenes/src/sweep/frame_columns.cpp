#include "sweep/frame_columns.h"

#include <cmath>
#include <span>

#include "output/files/frame_tables.h"
#include "supple/core/integrate.h"

namespace supple::scenes {
namespace {

void add_column(FrameColumns& columns, std::string name, std::vector<double> values) {
  columns.name.push_back(std::move(name));
  columns.value.push_back(std::move(values));
}

FrameColumns flat(const io::PointSet& points) {
  FrameColumns columns;
  const std::size_t rows = points.position.size();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& x : points.position) values.push_back(x[axis]);
    add_column(columns, std::array{"x_m", "y_m", "z_m"}[static_cast<std::size_t>(axis)], std::move(values));
  }
  for (const io::PointData& data : points.data) {
    const std::size_t n = data.components();
    std::vector<double> length(rows, 0.0);
    for (std::size_t k = 0; k < data.component.size(); ++k) {
      std::vector<double> values(rows);
      for (std::size_t i = 0; i < rows; ++i) {
        values[i] = data.values[n * i + k];
        length[i] += values[i] * values[i];
      }
      add_column(columns, data.component[k], std::move(values));
    }
    for (std::size_t i = 0; i < rows; ++i) length[i] = data.component.empty() ? data.values[i] : std::sqrt(length[i]);
    add_column(columns, data.name, std::move(length));
  }
  return columns;
}

FrameColumns energy_columns(Simulation& simulation) {
  const Energies energies = simulation.energies();
  const core::Ledger& ledger = simulation.state().ledger;
  FrameColumns columns;
  for (const auto& [name, value] : {std::pair{"kinetic_j", energies.kinetic}, {"interaction_j", energies.interaction}, {"contact_j", energies.contact},
                                    {"total_j", energies.total()}, {"dissipated_j", ledger.dissipated}, {"external_work_j", ledger.external_work}}) {
    add_column(columns, name, {value});
  }
  columns.members.resize(1);
  return columns;
}

FrameColumns object_columns(const Simulation& simulation) {
  const Model& model = simulation.model();
  const core::ParticleState& particles = simulation.state().particles;
  FrameColumns columns;
  for (const char* name : {"x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "speed_m_s", "deformation"}) add_column(columns, name, {});
  for (const ObjectModel& object : model.objects) {
    Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero();
    double mass = 0.0;
    for (std::uint32_t p = object.first; p < object.last; ++p) {
      centre += model.particles.mass[p] * particles.position[p];
      velocity += model.particles.mass[p] * particles.velocity[p];
      mass += model.particles.mass[p];
    }
    centre /= mass;
    velocity /= mass;
    const std::size_t n = object.last - object.first;
    double deformation = 0.0;
    if (!object.separate && object.rest_diameter > 0.0) {
      deformation = core::shape_error(std::span(model.rest.position).subspan(object.first, n), std::span(particles.position).subspan(object.first, n)).rms / object.rest_diameter;
    }
    const std::array<double, 8> row{centre.x(), centre.y(), centre.z(), velocity.x(), velocity.y(), velocity.z(), velocity.norm(), deformation};
    for (std::size_t k = 0; k < row.size(); ++k) columns.value[k].push_back(row[k]);
    columns.members.push_back({object.name, {}});
  }
  return columns;
}

FrameColumns particle_columns(Simulation& simulation) {
  FrameColumns columns = flat(particle_points(simulation));
  for (const auto object : simulation.model().particles.object) columns.members.push_back({simulation.model().objects[object].name, {}});
  return columns;
}

FrameColumns contact_columns(Simulation& simulation) {
  FrameColumns columns = flat(contact_pairs(simulation));
  for (const auto& summary : simulation.contacts().summary) {
    columns.members.push_back({object_name(simulation.model(), simulation.bodies(), summary.bodies.a), object_name(simulation.model(), simulation.bodies(), summary.bodies.b)});
  }
  return columns;
}

}  // namespace

FrameColumns frame_columns(FrameTableName table, Simulation& simulation) {
  switch (table) {
    case FrameTableName::Energies: return energy_columns(simulation);
    case FrameTableName::Objects: return object_columns(simulation);
    case FrameTableName::Particles: return particle_columns(simulation);
    case FrameTableName::Contacts: break;
  }
  return contact_columns(simulation);
}

}  // namespace supple::scenes
