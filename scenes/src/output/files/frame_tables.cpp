#include "output/files/frame_tables.h"

#include <span>

#include "supple/scenes/contact_report.h"

namespace supple::scenes {
namespace {

void set(std::vector<double>& values, std::span<const Vec3> vectors) {
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) values[3 * i + k] = vectors[i][static_cast<Eigen::Index>(k)];
  }
}

}  // namespace

io::PointSet particle_points(Simulation& simulation) {
  const core::ParticleState& state = simulation.state().particles;
  const core::ParticleSet& particles = simulation.model().particles;
  const core::Loads& contact = simulation.contact_loads();
  io::PointSet points;
  points.position = state.position;
  points.line = core::bonded_pairs(simulation.laws());
  std::vector<double>& object = points.add("object");
  for (std::size_t i = 0; i < state.size(); ++i) object[i] = particles.object[i];
  std::vector<double>& mass = points.add("mass_kg");
  for (std::size_t i = 0; i < state.size(); ++i) mass[i] = particles.mass[i];
  std::vector<double>& orientation = points.add("orientation", {"qx", "qy", "qz", "qw"});
  for (std::size_t i = 0; i < state.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k) orientation[4 * i + k] = state.orientation[i].coeffs()[static_cast<Eigen::Index>(k)];
  }
  set(points.add("velocity_m_s", {"vx_m_s", "vy_m_s", "vz_m_s"}), state.velocity);
  set(points.add("angular_momentum_si", {"lx_si", "ly_si", "lz_si"}), state.angular_momentum);
  set(points.add("contact_force_n", {"contact_fx_n", "contact_fy_n", "contact_fz_n"}), contact.force);
  set(points.add("contact_torque_nm", {"contact_tx_nm", "contact_ty_nm", "contact_tz_nm"}), contact.torque);
  return points;
}

io::PointSet contact_points(Simulation& simulation) {
  const collision::ContactSurface& surface = simulation.contacts();
  io::PointSet points;
  points.position = surface.point;
  const std::size_t n = surface.point.size();
  std::vector<double>& body_a = points.add("body_a");
  for (std::size_t s = 0; s < n; ++s) body_a[s] = surface.summary[surface.pair[s]].bodies.a;
  std::vector<double>& body_b = points.add("body_b");
  for (std::size_t s = 0; s < n; ++s) body_b[s] = surface.summary[surface.pair[s]].bodies.b;
  set(points.add("normal", {"normal_x", "normal_y", "normal_z"}), surface.normal);
  points.add("area_m2") = surface.area;
  points.add("pressure_pa") = surface.pressure;
  std::vector<Vec3> force(n);
  for (std::size_t s = 0; s < n; ++s) force[s] = -surface.pressure[s] * surface.area[s] * surface.normal[s];
  set(points.add("force_a_n", {"force_ax_n", "force_ay_n", "force_az_n"}), force);
  return points;
}

io::PointSet contact_pairs(Simulation& simulation) {
  const ContactReport report = report_contacts(simulation);
  io::PointSet points;
  for (const ContactReport::Pair& pair : report.pairs) points.position.push_back(pair.centre_of_pressure);
  const auto add = [&](const char* name, const auto& value) {
    std::vector<double>& values = points.add(name);
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = static_cast<double>(value(report.pairs[k]));
  };
  using Pair = ContactReport::Pair;
  add("body_a", [](const Pair& p) { return p.bodies.a; });
  add("body_b", [](const Pair& p) { return p.bodies.b; });
  std::vector<Vec3> force, elastic;
  for (const Pair& pair : report.pairs) {
    force.push_back(pair.force);
    elastic.push_back(pair.elastic_force);
  }
  set(points.add("force_a_n", {"force_ax_n", "force_ay_n", "force_az_n"}), force);
  set(points.add("elastic_force_a_n", {"elastic_force_ax_n", "elastic_force_ay_n", "elastic_force_az_n"}), elastic);
  add("area_m2", [](const Pair& p) { return p.area; });
  add("largest_pressure_pa", [](const Pair& p) { return p.largest_pressure; });
  add("largest_overlap_m", [](const Pair& p) { return p.largest_overlap; });
  add("energy_j", [](const Pair& p) { return p.energy; });
  add("dissipated_power_w", [](const Pair& p) { return p.dissipated_power; });
  add("dissipated_work_j", [](const Pair& p) { return p.dissipated_work; });
  add("error_estimate", [](const Pair& p) { return p.error_estimate; });
  add("points", [](const Pair& p) { return p.last - p.first; });
  return points;
}

}  // namespace supple::scenes
