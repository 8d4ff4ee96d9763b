#include "output/view/view_frame.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "output/pictures/camera.h"
#include "output/pictures/picture.h"
#include "output/view/view_arrays.h"
#include "supple/core/integrate.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/probe.h"

namespace supple::scenes {
namespace {

using Json = nlohmann::json;

/// Seven digits: finer than any plot.
double rounded(double value) {
  if (value == 0.0 || !std::isfinite(value)) return 0.0;
  const double unit = std::pow(10.0, 6.0 - std::floor(std::log10(std::abs(value))));
  return std::isfinite(unit) && unit > 0.0 ? std::round(value * unit) / unit : value;
}

Json json_of(const Vec3& v) { return {rounded(v.x()), rounded(v.y()), rounded(v.z())}; }

void add_grid(Json& json, const GridPoints& grid) {
  json["origin"] = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
  json["step"] = grid.step;
}

std::vector<double> pressure_of(const Mesh& mesh) {
  for (const Mesh::Column& column : mesh.columns) {
    if (column.name == "pressure") return column.values;
  }
  return {};
}

/// Values from 0 to `largest` in 8 bits.
std::vector<std::uint32_t> in_bytes(const std::vector<double>& values, double largest) {
  std::vector<std::uint32_t> out;
  out.reserve(values.size());
  for (const double value : values) out.push_back(static_cast<std::uint32_t>(std::lround(255.0 * std::clamp(value / largest, 0.0, 1.0))));
  return out;
}

void append_triangles(std::string& arrays, const Mesh& mesh) {
  std::vector<std::uint32_t> corners;
  corners.reserve(3 * mesh.triangle_count());
  for (const auto& triangle : mesh.triangle) corners.insert(corners.end(), triangle.begin(), triangle.end());
  append_differences(arrays, corners, difference_width(mesh.vertex_count()), 1);
}

/// Quadrature points of all contacts, at most kMost of them, spread evenly over their order.
Json contact_points(const ContactReport& report, std::string& arrays) {
  constexpr std::size_t kMost = 600;
  const std::size_t all = report.points.point.size(), stride = std::max<std::size_t>(1, (all + kMost - 1) / kMost);
  std::vector<Vec3> points;
  std::vector<double> pressures;
  double largest = 0.0;
  for (std::size_t i = 0; i < all; i += stride) {
    points.push_back(report.points.point[i]);
    pressures.push_back(report.points.pressure[i]);
    largest = std::max(largest, pressures.back());
  }
  Json json{{"count", points.size()}, {"pressure", rounded(largest)}};
  if (points.empty()) return json;
  const GridPoints grid = on_grid(points);
  add_grid(json, grid);
  append_differences(arrays, grid.node, 2, 3);
  append_differences(arrays, in_bytes(pressures, std::max(largest, 1e-300)), 2, 1);
  return json;
}

Json particles_of(const Simulation& simulation, std::string& arrays) {
  const std::vector<Vec3>& position = simulation.state().particles.position;
  const GridPoints grid = on_grid(position);
  Json json{{"count", position.size()}};
  add_grid(json, grid);
  append_differences(arrays, grid.node, 2, 3);
  return json;
}

Json pairs_of(const ContactReport& report) {
  Json json = Json::array();
  for (const ContactReport::Pair& pair : report.pairs) {
    json.push_back({{"a", pair.a}, {"b", pair.b}, {"force", json_of(pair.force)}, {"at", json_of(pair.centre_of_pressure)},
                    {"area", rounded(pair.area)}, {"pressure", rounded(pair.largest_pressure)}});
  }
  return json;
}

Json numbers_of(Simulation& simulation) {
  const Energies energies = simulation.energies();
  const core::Ledger& ledger = simulation.state().ledger;
  const core::Motion motion = core::measure_motion(simulation.model().particles, simulation.state().particles);
  Json laws = Json::array();
  for (const core::LawReport& law : report_forces(simulation)) laws.push_back({law.name, rounded(law.energy)});
  return {{"energy", {{"kinetic", rounded(energies.kinetic)}, {"interaction", rounded(energies.interaction)}, {"contact", rounded(energies.contact)},
                      {"total", rounded(energies.total())}}},
          {"laws", std::move(laws)},
          {"work", rounded(ledger.external_work)},
          {"dissipated", rounded(ledger.dissipated)},
          {"pins", json_of(ledger.pin_impulse)},
          {"momentum", json_of(motion.momentum)},
          {"spin", json_of(motion.angular_momentum)}};
}

}  // namespace

std::string ViewFrames::write(Simulation& simulation) {
  const ContactReport report = report_contacts(simulation);
  Json json = numbers_of(simulation);
  json["frame"] = simulation.frame();
  json["time"] = rounded(simulation.time());
  json["pairs"] = pairs_of(report);
  const CameraDesc& desc = simulation.model().cameras.front();
  const render::Camera camera = camera_at(desc, simulation.time(), simulation.scene().duration);
  json["camera"] = {json_of(camera.from), json_of(camera.look_at), rounded(camera.field_of_view)};

  std::string arrays;
  json["meshes"] = Json::array();
  std::vector<Mesh> meshes = simulation.meshes();
  for (Mesh& mesh : obstacle_meshes(simulation.scene(), simulation.model(), simulation.time())) meshes.push_back(std::move(mesh));
  kept_.resize(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const Mesh& mesh = meshes[i];
    Kept& kept = kept_[i];
    std::vector<double> pressure = pressure_of(mesh);
    const double largest = pressure.empty() ? 0.0 : *std::max_element(pressure.begin(), pressure.end());
    if (!(largest > 0.0)) pressure.clear();
    if (!mesh.position.empty() && kept.position == mesh.position && kept.triangle == mesh.triangle && kept.pressure == pressure) {
      json["meshes"].push_back({{"kept", true}});
      continue;
    }
    const GridPoints grid = on_grid(mesh.position);
    Json entry{{"vertices", mesh.vertex_count()}};
    add_grid(entry, grid);
    append_differences(arrays, grid.node, 2, 3);
    append_differences(arrays, on_octahedron(mesh.normal), 2, 2);
    if (largest > 0.0) {
      entry["pressure"] = rounded(largest);
      append_differences(arrays, in_bytes(pressure, largest), 2, 1);
    }
    if (kept.triangle != mesh.triangle) {
      entry["triangles"] = mesh.triangle_count();
      append_triangles(arrays, mesh);
    }
    json["meshes"].push_back(std::move(entry));
    kept = {mesh.position, std::move(pressure), mesh.triangle};
  }
  json["points"] = contact_points(report, arrays);
  json["particles"] = particles_of(simulation, arrays);

  const std::string text = json.dump();
  std::string out;
  for (unsigned k = 0; k < 4; ++k) out += static_cast<char>((text.size() >> (8U * k)) & 0xFFU);
  return out + text + arrays;
}

}  // namespace supple::scenes
