#include "output/run/result_file.h"

#include <algorithm>
#include <array>
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include "file/fields/fields_rules.h"
#include "output/meshes/search_files.h"
#include "output/run/spare_memory.h"
#include "simulation/contact_work.h"
#include "simulation/pair_contacts.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/read_scene.h"

namespace supple::scenes {
namespace {

using nlohmann::ordered_json;

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Null where no step has measured it.
ordered_json json_of(const ObjectModel& object, const std::vector<implicit::VolumeState>& volumes) {
  ordered_json held = {{"of", name_of(object.volume_of)},
                       {"target_m3", object.target},
                       {"volume_m3", ordered_json::array()},
                       {"scale", ordered_json::array()}};
  for (std::size_t k = 0; k < object.target.size(); ++k) {
    const implicit::VolumeState& v = volumes[object.first_volume + k];
    held["volume_m3"].push_back(v.volume > 0.0 ? ordered_json(v.volume) : ordered_json(nullptr));
    held["scale"].push_back(v.scale);
  }
  return held;
}

ordered_json json_of(const ErrorEstimate& error) {
  if (error.object.empty()) return nullptr;
  return {{"position_m", error.position}, {"share", error.share}, {"object", error.object}, {"frames", error.frames}};
}

/// Estimates by stage, and which is largest; null: not known.
ordered_json json_of(const Scene& scene, const StageErrors& errors) {
  const std::array<std::pair<const char*, const ErrorEstimate*>, 3> stages{{{"time", &errors.time}, {"contact", &errors.contact}, {"mesh", &errors.mesh}}};
  const std::optional<double> accuracy = accuracy_of(scene);
  ordered_json json = {{"accuracy", accuracy ? ordered_json(*accuracy) : ordered_json(nullptr)}};
  const char* largest = nullptr;
  double most = 0.0;
  for (const auto& [name, error] : stages) {
    json[name] = json_of(*error);
    if (error->object.empty() || !(error->share > most)) continue;
    most = error->share;
    largest = name;
  }
  json["largest"] = largest != nullptr ? ordered_json(largest) : ordered_json(nullptr);
  json["work"] = errors.work;
  return json;
}

ordered_json vector(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

/// Every two objects that touched.
ordered_json json_of(const Model& model, const std::vector<RunRecord::PairContact>& pairs) {
  ordered_json list = ordered_json::array();
  for (const RunRecord::PairContact& pair : pairs) {
    const bool ended = pair.first_end >= 0.0, met = ended && pair.approach_speed > 0.0;
    const auto known = [](bool there, double value) { return there ? ordered_json(value) : ordered_json(nullptr); };
    list.push_back({{"a", pair_member_name(model, pair.objects.a)},
                    {"b", pair_member_name(model, pair.objects.b)},
                    {"touches", pair.touches},
                    {"touching", pair.touching},
                    {"contact_time_s", pair.contact_time},
                    {"peak_force_n", pair.peak_force},
                    {"peak_time_s", pair.peak_time},
                    {"impulse_ns", vector(pair.impulse)},
                    {"largest_depth_m", pair.largest_depth},
                    {"depth_m", pair.depth},
                    {"first_touch_s", pair.first_begin},
                    {"first_contact_time_s", known(ended, pair.first_end - pair.first_begin)},
                    {"approach_speed_m_s", known(met, pair.approach_speed)},
                    {"rebound_speed_m_s", known(met, pair.rebound_speed)},
                    {"restitution", known(met, pair.rebound_speed / pair.approach_speed)}});
  }
  return list;
}

}  // namespace

ordered_json report_of(const Scene& scene, const RunResult& result, const Simulation* simulation, const TimeTaken& taken) {
  ordered_json json;
  json["scene"] = scene_name(scene);
  json["title"] = scene.title;
  json["scene_file"] = std::filesystem::absolute(scene.source).string();
  if (const SceneSource* source = source_of(scene); source != nullptr && !source->overrides.empty()) json["set"] = source->overrides;
  json["outcome"] = result.outcome;
  json["reason"] = result.reason;
  json["exit_code"] = result.exit_code;
  json["frames"] = result.frames;
  json["last_good_frame"] = result.frames;
  json["frame_count"] = scene.frame_count();
  json["frame_rate"] = scene.frame_rate;
  ordered_json pictures = {{"drawn", result.pictures_drawn}, {"kept", result.pictures_kept}, {"frames_at_once", result.frames_at_once}};
  json["state_hash"] = to_hex(result.state_hash);
  if (result.origin) {
    json["origin"] = {{"folder", result.origin->folder.string()},
                      {"frame", result.origin->frame},
                      {"state_hash", to_hex(result.origin->state_hash)},
                      {"differences", result.origin->differences}};
  }
  json["warnings"] = result.warnings;
  json["units"] = {{"length", "m"}, {"up_axis", "z"}};
  if (simulation != nullptr) {
    const State& state = simulation->state();
    json["steps"] = state.steps;
    json["time_step_s"] = simulation->time_step();
    json["simulated_s"] = simulation->time();
    const core::StepReport& work = simulation->integration();
    json["integrator"] = {{"choice", simulation->integrator().reason},
                          {"substeps", work.substeps},
                          {"rejected", work.rejected},
                          {"force_evaluations", work.force_evaluations},
                          {"newton_iterations", work.newton_iterations},
                          {"last_correction", work.last_correction},
                          {"within_tolerance", work.within_tolerance}};
    const Audits audits = simulation->audits();
    json["audits"] = {{"momentum_error", audits.momentum_error},
                      {"angular_momentum_error", audits.angular_momentum_error},
                      {"energy_error", audits.energy_error},
                      {"energy_returned", audits.energy_returned},
                      {"contact_residual", audits.contact_residual},
                      {"largest_overlap", audits.largest_overlap},
                      {"largest_overlap_share", audits.largest_overlap_share},
                      {"dissipated_j", state.ledger.dissipated},
                      {"dissipated_by_contacts_j", all_pair_work(state.record)},
                      {"broken_j", state.links.released},
                      {"yielded_j", state.links.flowed},
                      {"external_work_j", state.ledger.external_work},
                      {"external_impulse_ns", vector(state.ledger.external_impulse)},
                      {"pin_impulse_ns", vector(state.ledger.pin_impulse)},
                      {"pin_angular_impulse_nms", vector(state.ledger.pin_angular_impulse)}};
    json["errors"] = json_of(scene, result.errors);
    json["friction"] = ordered_json::array();
    for (const auto& [names, speed] : simulation->friction_speeds()) {
      json["friction"].push_back({{"a", names.first}, {"b", names.second}, {"speed_m_s", speed}, {"asked_m_s", scene.contact.friction_speed}});
    }
    json["overloads"] = ordered_json::array();
    for (const auto& o : state.record.overloads) {
      json["overloads"].push_back({{"a", o.a}, {"b", o.b}, {"time_s", o.time}, {"energy_j", o.energy}, {"capacity_j", o.capacity}});
    }
    json["pairs"] = json_of(simulation->model(), state.record.pair_contacts);
    json["core_impulses"] = state.record.core_impulses;
    const Model& model = simulation->model();
    ordered_json objects = ordered_json::object();
    for (std::size_t i = 0; i < model.objects.size(); ++i) {
      const ObjectModel& o = model.objects[i];
      const auto& record = state.record.objects[i];
      const auto pieces = std::count_if(simulation->bodies().begin(), simulation->bodies().end(),
                                        [i](const Body& body) { return body.object == i && !body.origin.is_group(); });
      objects[o.name] = {{"particles", o.last - o.first},
                         {"pieces", pieces},
                         {"diameter", o.rest_diameter},
                         {"largest_deformation", record.largest_deformation},
                         {"final_shape_error", record.final_shape_error}};
      if (o.holds_volume) objects[o.name]["volume"] = json_of(o, state.volumes);
    }
    json["objects"] = objects;
    json["searches"] = json_of(result.searches);
    const Profile profile = simulation->profile();
    ordered_json stages = ordered_json::object();
    for (const StageInfo& stage : stage_table()) {
      const StageProfile& p = profile[static_cast<std::size_t>(stage.stage)];
      stages[std::string(stage.name)] = {
          {"calls", p.calls}, {"cpu_s", p.cpu_s}, {"visited", p.visited}, {"present", p.present}};
    }
    json["stages"] = stages;
    const render::RenderTimes& t = result.pictures.render;
    pictures.update({{"images", result.pictures.images}, {"context_cpu_s", t.context}, {"shaders_cpu_s", t.shaders},
                     {"upload_cpu_s", t.upload},         {"draw_cpu_s", t.draw},       {"read_back_cpu_s", t.read_back},
                     {"encode_cpu_s", result.pictures.encode_s}});
  }
  json["pictures"] = pictures;
  json["film"] = result.film.empty() ? ordered_json(nullptr) : ordered_json(result.film.filename().string());
  json["peak_memory_mb"] = peak_memory_mb();
  json["wall_s"] = taken.wall;
  json["cpu_s"] = taken.cpu;
  return json;
}

void write_result_file(const Scene& scene, const RunResult& result, const Simulation* simulation, const TimeTaken& taken) {
  const SpareMemory spare(kSpareForJson);
  const ordered_json json = report_of(scene, result, simulation, taken);
  io::write_atomically(result.report, std::string_view(json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"));
}

}  // namespace supple::scenes
