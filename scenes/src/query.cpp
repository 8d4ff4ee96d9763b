#include "supple/scenes/query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "read_scene_faults.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"
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
    case collision::RuleReason::Asked: return "the scene asks for it";
    case collision::RuleReason::Fits: return "smooth patches, each seen whole from its peak";
    case collision::RuleReason::NoGraph: return "a patch that is no graph over a disc";
    case collision::RuleReason::ThirdBody: return "a third body presses on the patch";
    case collision::RuleReason::NoSkeleton: return "no polar patch, and no skeleton to send rays from";
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

std::string text(const ordered_json& json) { return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"; }

}  // namespace

std::string query_forces(Simulation& simulation) {
  const Model& model = simulation.model();
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
  ordered_json json;
  json["time_s"] = simulation.time();
  json["cpu_us"] = 1e6 * cpu_s;
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
                         {"capacity_j", s.force.norm() > 0.0 ? contact_capacity(simulation, s.bodies.a, s.bodies.b) : 0.0},
                         {"largest_pressure_pa", s.largest_pressure},
                         {"largest_overlap_m", s.largest_overlap},
                         {"residual", s.residual},
                         {"error_bound", s.error_estimate},
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
  ordered_json json;
  json["time_s"] = simulation.time();
  json["convention"] = "value > 0 inside; the outward normal is -gradient / |gradient|";
  ordered_json objects = ordered_json::array();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
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
  ordered_json json;
  json["cell_m"] = simulation.cell();
  json["cpu_ms"] = cpu_ms;
  ordered_json objects = ordered_json::array();
  const std::size_t surfaces = static_cast<std::size_t>(std::count_if(
      meshes.begin(), meshes.end(), [](const Mesh& m) { return !m.position.empty(); }));
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].position.empty()) continue;
    const MeshReport report = inspect(meshes[i]);
    objects.push_back({{"name", model.objects[i].name},
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
  return text + "; of objects that touch the smallest holds for all of them";
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
  const auto plural = [](std::size_t n) { return n == 1 ? "" : "s"; };
  line("%zu object%s, %zu particle%s, %d frames at %g a second", model.objects.size(), plural(model.objects.size()),
       model.particles.size(), plural(model.particles.size()), scene.frame_count(), scene.frame_rate);
  for (const ObjectModel& o : model.objects) {
    const std::size_t primitives = o.skeleton.primitive.size();
    line("  %-16s %u particle%s, %zu primitive%s, %zu surface samples%s", o.name.c_str(), o.last - o.first,
         plural(o.last - o.first), primitives, plural(primitives), o.samples.size(), o.collides ? "" : ", no contact");
  }
  line("time step %g s (%d a frame)%s", simulation.time_step(), 1 << simulation.state().halvings,
       scene.time_step.size || scene.time_step.substeps ? ", fixed by the scene" : ", by the stability limits at frame 1");
  if (model.cell > 0.0) line("surface lattice cell %s", cells_text(model).c_str());
  out += "\n";
  const StepPlan plan = plan_step(scene, model, requested_outputs(scene));
  for (const PlannedStage& planned : plan.stages) {
    line("%-4s %-24s %-10s %s", planned.on ? "on" : "off", std::string(info(planned.stage).name).c_str(),
         std::string(info(planned.stage).module).c_str(), planned.reason.c_str());
  }
  if (!plan.on(Stage::SolveContactSurface)) return out;
  const std::vector<collision::ContactSurface::Summary>& pairs = simulation.contacts().summary;
  constexpr std::size_t kMostShown = 10;
  line("\n%zu contact%s at frame %d", pairs.size(), plural(pairs.size()), simulation.frame());
  for (std::size_t k = 0; k < std::min(pairs.size(), kMostShown); ++k) {
    const auto& s = pairs[k];
    line("  %s, %s: %s (%s), %llu points, error at most %.1e", body_name(simulation, s.bodies.a).c_str(),
         body_name(simulation, s.bodies.b).c_str(), rule_name(s.rule), reason_text(s.reason).c_str(),
         static_cast<unsigned long long>(s.points), s.error_estimate);
  }
  if (pairs.size() > kMostShown) line("  and %zu more", pairs.size() - kMostShown);
  return out;
}

}  // namespace supple::scenes
