#include "supple/scenes/accuracy.h"
#include "supple/core/counted.h"
#include "supple/scenes/query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "file/read_scene_faults.h"
#include "model/warnings.h"
#include "output/meshes/search_choice.h"
#include "output/meshes/search_files.h"
#include "output/run/spare_memory.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"
#include "supple/implicit/mesh_routes.h"
#include "supple/implicit/polygonise.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/probe.h"

namespace supple::scenes {
namespace {

using nlohmann::ordered_json;
namespace fs = std::filesystem;

ordered_json vector(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

std::string body_name(const Simulation& simulation, std::uint32_t body) {
  return body_name(simulation.model(), simulation.bodies(), body);
}

/// Why the rule was taken.
std::string reason_text(collision::RuleReason reason) {
  switch (reason) {
    case collision::RuleReason::Asked: return "set in the scene";
    case collision::RuleReason::Fits: return "smooth patches, each star-shaped about its peak";
    case collision::RuleReason::NoGraph: return "a patch that is not a graph over a disc";
    case collision::RuleReason::ThirdBody: return "a third body presses on the patch";
    case collision::RuleReason::Unmet: return "its error estimate is smaller than that of polar, which exceeds the given error";
    case collision::RuleReason::ManyHills: return "the pressure has many maxima, which panels cover all at once";
    case collision::RuleReason::Within: return "one body lies inside the other, whose pressure is nowhere smaller: energy, but no contact surface and no force";
  }
  return "";
}

ordered_json loads_json(const core::Loads& loads) {
  ordered_json particles = ordered_json::array();
  for (std::size_t i = 0; i < loads.force.size(); ++i) {
    particles.push_back({{"force", vector(loads.force[i])}, {"torque", vector(loads.torque[i])}});
  }
  return particles;
}

/// A pair with one body entirely inside the other has reached its capacity.
double capacity_of(Simulation& simulation, const collision::ContactSurface::Summary& s) {
  if (s.reason == collision::RuleReason::Within) return s.energy;
  return s.force.norm() > 0.0 ? contact_capacity(simulation, s.bodies.a, s.bodies.b) : 0.0;
}

std::string text(const ordered_json& json) { return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"; }

}  // namespace

std::string query_forces(Simulation& simulation) {
  const Model& model = simulation.model();
  const SpareMemory spare(kSpareForJson);
  ordered_json json;
  json["time_s"] = simulation.time();
  ordered_json objects = ordered_json::array();
  for (const ObjectModel& o : model.objects) objects.push_back({{"name", o.name}, {"first", o.first}, {"last", o.last}});
  json["objects"] = objects;
  ordered_json laws = ordered_json::array();
  for (const core::LawReport& law : report_forces(simulation)) {
    laws.push_back({{"name", law.name}, {"energy_j", law.energy}, {"particles", loads_json(law.loads)}});
  }
  json["laws"] = laws;
  return text(json);
}

std::string query_contact(Simulation& simulation, bool samples) {
  double cpu_s = std::numeric_limits<double>::infinity();
  for (int time = 0; time < 3; ++time) {  // the first one finds caches empty
    simulation.restore(State(simulation.state()));
    const double begin = process_cpu_seconds();
    (void)simulation.contacts();
    cpu_s = std::min(cpu_s, process_cpu_seconds() - begin);
  }
  const collision::ContactSurface& surface = simulation.contacts();
  const std::vector<double> energy_error = simulation.energy_estimates();
  const SpareMemory spare(kSpareForJson);
  ordered_json json;
  json["time_s"] = simulation.time();
  json["cpu_us"] = 1e6 * cpu_s;
  const double given_error = simulation.model().contact.error;
  ordered_json pairs = ordered_json::array();
  for (std::size_t k = 0; k < surface.summary.size(); ++k) {
    const auto& s = surface.summary[k];
    ordered_json pair = {{"a", body_name(simulation, s.bodies.a)},
                         {"b", body_name(simulation, s.bodies.b)},
                         {"rule", rule_name(s.rule)},
                         {"rule_reason", reason_text(s.reason)},
                         {"force_n", vector(s.force)},
                         {"moment_nm", vector(s.moment)},
                         {"area_m2", s.area},
                         {"centre_of_pressure_m", vector(s.centre_of_pressure)},
                         {"energy_j", s.energy},
                         {"energy_error_j", energy_error[k]},
                         {"capacity_j", capacity_of(simulation, s)},
                         {"largest_pressure_pa", s.largest_pressure},
                         {"largest_overlap_m", s.largest_overlap},
                         {"residual", s.residual},
                         {"error_estimate", s.error_estimate},
                         {"error_asked", given_error},
                         {"error_met", !misses_error(s, given_error)},
                         {"patches", s.patches},
                         {"points", s.points},
                         {"evaluations", s.evaluations}};
    if (samples) {
      ordered_json rows = ordered_json::array();
      for (std::size_t i = 0; i < surface.point.size(); ++i) {
        if (surface.pair[i] != k) continue;
        rows.push_back({{"point", vector(surface.point[i])},
                        {"normal", vector(surface.normal[i])},
                        {"area_m2", surface.area[i]},
                        {"pressure_pa", surface.pressure[i]}});
      }
      pair["samples"] = rows;
    }
    pairs.push_back(pair);
  }
  json["pairs"] = pairs;
  return text(json);
}

std::string query_field(Simulation& simulation, const fs::path& points) {
  const std::vector<Vec3> at = io::read_points_csv(points);
  const std::vector<Body>& bodies = simulation.bodies();
  const std::vector<implicit::Field>& fields = simulation.fields();
  const SpareMemory spare(kSpareForJson);
  ordered_json json;
  json["time_s"] = simulation.time();
  json["convention"] = "value > 0 inside; the outward normal is -gradient / |gradient|";
  ordered_json objects = ordered_json::array();
  for (std::size_t i = 0; i < surface_count(bodies); ++i) {
    if (bodies[i].skeleton.primitive.empty()) continue;
    std::vector<double> values(at.size());
    std::vector<Vec3> gradients(at.size());
    fields[i].evaluate(at, values, gradients);
    ordered_json rows = ordered_json::array();
    for (std::size_t p = 0; p < at.size(); ++p) {
      rows.push_back({{"point", vector(at[p])}, {"value", values[p]}, {"gradient_1_m", vector(gradients[p])}});
    }
    objects.push_back({{"name", bodies[i].name}, {"points", rows}});
  }
  json["objects"] = objects;
  return text(json);
}

std::string query_mesh(Simulation& simulation, const MeshQuery& query) {
  if (query.cells > 0) simulation.set_cells(query.cells);
  const fs::path extension = query.out.extension();
  const bool is_file = extension == ".ply" || extension == ".obj";
  if (!is_file && !extension.empty() && !fs::is_directory(query.out)) {
    throw Error(ErrorKind::Usage, Fault{.place = "--out",
                                        .key = {},
                                        .expected = "expected a .ply or .obj file, or a folder",
                                        .found = '\'' + query.out.string() + '\'',
                                        .hint = "supple export writes usd"});
  }
  const auto write = extension == ".obj" ? io::write_obj : io::write_ply;
  const Model& model = simulation.model();
  const double begin = process_cpu_seconds();
  const std::vector<Mesh>& meshes = simulation.meshes();
  const double cpu_ms = 1e3 * (process_cpu_seconds() - begin);
  const SpareMemory spare(kSpareForJson);
  ordered_json json;
  json["cpu_ms"] = cpu_ms;
  ordered_json objects = ordered_json::array();
  const std::size_t surfaces = static_cast<std::size_t>(std::count_if(
      meshes.begin(), meshes.end(), [](const Mesh& m) { return !m.position.empty(); }));
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].position.empty()) continue;
    const MeshReport report = inspect(meshes[i]);
    // Where an error is given and no cell, the error sets the cells.
    const ObjectModel& o = model.objects[i];
    const bool on_cells = !o.mesh_error || o.cell_is_stated;
    objects.push_back({{"name", o.name},
                       {"cell_m", on_cells ? ordered_json(o.cell) : ordered_json()},
                       {"error_m", o.mesh_error ? ordered_json(*o.mesh_error) : ordered_json()},
                       {"vertices", meshes[i].vertex_count()},
                       {"triangles", meshes[i].triangle_count()},
                       {"closed", report.closed},
                       {"oriented", report.oriented},
                       {"euler_characteristic", report.euler_characteristic},
                       {"components", report.components},
                       {"area_m2", report.area},
                       {"volume_m3", report.volume}});
    if (query.out.empty()) continue;
    if (is_file && surfaces == 1) {
      write(query.out, meshes[i]);
    } else {
      const fs::path folder = is_file ? query.out.parent_path() : query.out;
      const std::string stem = is_file ? query.out.stem().string() + "." : std::string();
      if (!folder.empty()) io::make_writable_folder(folder);
      write(folder / (stem + model.objects[i].name + (is_file ? extension.string() : ".ply")), meshes[i]);
    }
  }
  json["objects"] = objects;
  json["searches"] = json_of(simulation.searches());
  return text(json);
}

namespace {

/// "0.01 m", or that of every object where one has its own.
std::string cells_text(const Model& model) {
  const auto one = [](const ObjectModel& o) { return o.own_cell; };
  if (std::none_of(model.objects.begin(), model.objects.end(), one)) return short_text(model.cell) + " m";
  std::string text;
  for (const ObjectModel& o : model.objects) {
    if (o.cell > 0.0) text += (text.empty() ? "" : ", ") + o.name + ' ' + short_text(o.cell) + " m";
  }
  return text + "; objects that touch use the smallest of theirs";
}

/// Whether the mesh of an object that touches no other is searched for missed pieces, and why.
std::string search_text(const Simulation& simulation, std::size_t object) {
  const MeshingDesc& d = simulation.model().meshing;
  if (d.search) return "searched: set in the scene";
  if (d.method != MeshingName::Auto && d.method != MeshingName::Cubes) return "not searched: only meshes by marching cubes are";
  const ObjectModel& model = simulation.model().objects[object];
  const core::ParticleState& particles = simulation.state().particles;
  const std::span<const Body> surfaces = std::span(simulation.bodies()).first(surface_count(simulation.bodies()));
  const auto bodies = static_cast<std::size_t>(std::count_if(surfaces.begin(), surfaces.end(), [&](const Body& b) { return b.object == object; }));
  implicit::SearchEstimate sum;
  std::optional<Unsearched> why;
  bool by_grid = false;
  for (const Body& body : surfaces) {
    if (body.object != object) continue;
    std::vector<Pose> poses;
    for (const std::uint32_t p : body.particle) poses.push_back({particles.position[p], particles.orientation[p]});
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(body.skeleton, poses, placed);
    const implicit::SearchEstimate one = implicit::estimate_search(body.skeleton, placed.support, model.cell);
    sum.search_ms += one.search_ms;
    sum.mesh_ms += one.mesh_ms;
    if (const auto left_out = why_left_out(one, bodies)) why = left_out;
    by_grid = by_grid || (d.method == MeshingName::Auto && !model.mesh_error &&
                          !implicit::estimate_routes(body.skeleton, placed.support, model.cell).prefers_cubes());
  }
  if (by_grid) return "not searched: meshed by OpenVDB";
  if (why == Unsearched::Undecided) return "not searched: cells along blends by gradients or tight bends would stay undecided";
  const std::string cost = "estimated search cost: " + short_text(std::round(100.0 * sum.search_ms / std::max(sum.mesh_ms, 1e-9)) / 100.0) +
                           " x meshing";
  return why ? "not searched, " + cost + "; output.meshing.search: true searches it" : "searched, " + cost;
}

/// One line per object with a mesh.
std::string searches_text(const Simulation& simulation) {
  const Model& model = simulation.model();
  const OutputRequest outputs = requested_outputs(simulation.scene());
  if (!outputs.images && !outputs.meshes) return "";
  if (search_is_off(model.meshing)) return "search for pieces between the nodes of the lattice: switched off in the scene\n";
  std::string text;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    if (!model.objects[i].skeleton.primitive.empty()) text += "  " + model.objects[i].name + ": " + search_text(simulation, i) + '\n';
  }
  if (text.empty()) return text;
  const bool bulges = model.bulge.attenuation > 0.0 || model.bulge.keep_volume;
  return "search for pieces between the nodes of the lattice (objects that touch are " +
         std::string(bulges ? "not searched, as they bulge" : "searched together, by the estimated cost in each frame") + ")\n" + text;
}

/// Which parts of an object touch each other, in a sentence; empty: it is one body.
std::string self_contact_text(const ObjectModel& object) {
  std::string text;
  const auto add_exceptions = [&](bool of_groups) {
    const auto except = [&](const std::vector<collision::BodyPair>& pairs, const char* which) {
      const auto count = std::count_if(pairs.begin(), pairs.end(), [&](const collision::BodyPair& pair) { return object.are_groups(pair) == of_groups; });
      if (count > 0) text += "; except " + counted(static_cast<std::size_t>(count), "pair") + ' ' + which;
    };
    except(object.bonded, "with a bond");
    except(object.overlapping, "that overlap at the start, until they have been apart");
  };
  if (!object.component.empty()) {
    std::size_t parts = 0;
    for (std::uint32_t i = 0; i < object.component.size(); ++i) parts += object.component[i] == i ? 1 : 0;
    text = std::to_string(parts) + " parts that do not blend are bodies that touch each other";
    add_exceptions(false);
  }
  if (!object.group.empty()) {
    text += (text.empty() ? "" : "; ") + counted(object.group.size(), "group touches the groups that it does not blend with, by its own field", "groups touch the groups that they do not blend with, by their own fields");
    add_exceptions(true);
  }
  return text;
}

}  // namespace

std::string explain(Simulation& simulation) {
  const Scene& scene = simulation.scene();
  const Model& model = simulation.model();
  std::string out = scene.title.empty() ? std::string() : scene.title + "\n";
  const auto line = [&](const char* format, auto... values) {
    const int n = std::snprintf(nullptr, 0, format, values...);
    std::string row(static_cast<std::size_t>(n) + 1, '\0');
    std::snprintf(row.data(), row.size(), format, values...);
    row.pop_back();
    out += row + "\n";
  };
  line("%s, %s, %s at %g per second", counted(model.objects.size(), "object").c_str(), counted(model.particles.size(), "particle").c_str(),
       counted(static_cast<std::size_t>(scene.frame_count()), "frame").c_str(), scene.frame_rate);
  for (const ObjectModel& o : model.objects) {
    line("  %-16s %s, %s, %s%s", o.name.c_str(), counted(o.last - o.first, "particle").c_str(), counted(o.skeleton.primitive.size(), "primitive").c_str(),
         counted(o.samples.size(), "surface sample").c_str(), o.collides ? "" : ", no contact");
    if (const std::string text = self_contact_text(o); !text.empty()) line("  %-16s %s", "", text.c_str());
  }
  try {
    simulation.expect_steps();
  } catch (const Error& refused) {
    line("no time step is possible: %s", refused.what());
  }
  line("time step %g s (%d per frame)%s", simulation.time_step(), 1 << simulation.state().halvings,
       scene.time_step.substeps ? ", fixed by the scene"
                                : scene.time_step.size ? ", by time_step.size and the stability limits at frame 1"
                                                       : ", by the stability limits at frame 1");
  if (const std::optional<double> accuracy = accuracy_of(scene)) {
    line("accuracy %g of the size of the bodies%s: contact.error %g, Newton's method to %g, slips below %g of a pair's speed may stick", *accuracy,
         scene.accuracy ? "" : " (default)", contact_error(scene), simulation.integrator().settings.tolerance, simulation.integrator().slow_slip);
    for (const ObjectModel& o : model.objects) {
      line("  %-16s %s m%s", o.name.c_str(), short_text(*accuracy * size_of(o)).c_str(),
           o.mesh_error ? (", meshes to " + short_text(*o.mesh_error) + " m").c_str() : "");
    }
  }
  if (model.cell > 0.0) line("surface lattice cell %s", cells_text(model).c_str());
  out += searches_text(simulation);
  out += "\n";
  const StepPlan plan = plan_step(scene, model, requested_outputs(scene));
  for (const PlannedStage& planned : plan.stages) {
    line("%-4s %-24s %-10s %s", planned.on ? "on" : "off", std::string(info(planned.stage).name).c_str(),
         std::string(info(planned.stage).module).c_str(), planned.reason.c_str());
  }
  if (!plan.on(Stage::SolveContactSurface)) return out;
  const std::vector<collision::ContactSurface::Summary>& pairs = simulation.contacts().summary;
  constexpr std::size_t kMostShown = 10;
  const double given_error = model.contact.error;
  line("\n%s at frame %d", counted(pairs.size(), "contact").c_str(), simulation.frame());
  for (std::size_t k = 0; k < std::min(pairs.size(), kMostShown); ++k) {
    const auto& s = pairs[k];
    const std::string missed = misses_error(s, given_error) ? ", above the given " + short_text(given_error) : "";
    line("  %s, %s: %s (%s), %llu points, error estimate %.1e%s", body_name(simulation, s.bodies.a).c_str(),
         body_name(simulation, s.bodies.b).c_str(), rule_name(s.rule), reason_text(s.reason).c_str(),
         static_cast<unsigned long long>(s.points), s.error_estimate, missed.c_str());
  }
  if (pairs.size() > kMostShown) line("  and %zu more", pairs.size() - kMostShown);
  return out;
}

std::string describe_mesh_obstacles(const Model& model) {
  std::string text;
  for (const FixedBody& body : model.fixed) {
    const auto* solid = std::get_if<implicit::MeshSolid>(&body.solid);
    if (solid == nullptr) continue;
    const implicit::MeshSolid::Report& report = solid->report();
    text += "  obstacle " + body.name + ": surface of " + counted(solid->mesh().triangle_count(), "triangle") + ", ";
    text += "deviates by at most " + short_text(report.deviation) + " m, " + short_text(100.0 * report.deviation / report.size) + " % of its size";
    if (report.crossing > 0) text += ", as " + counted(report.crossing, "triangle of its file crosses or touches others", "triangles of its file cross or touch others");
    text += '\n';
  }
  return text;
}

}  // namespace supple::scenes
