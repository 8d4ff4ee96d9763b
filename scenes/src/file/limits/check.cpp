#include "supple/scenes/accuracy.h"
#include "supple/scenes/check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "file/limits/work_limit.h"
#include "file/read_scene_faults.h"
#include "model/crowded_start.h"
#include "supple/core/interrupt.h"
#include "supple/scenes/output_limits.h"
#include "supple/scenes/query.h"
#include "supple/scenes/run.h"

namespace supple::scenes {
namespace {

/// The reason why a scene was not built, as a sentence.
std::string not_built(const SceneCounts& counts, double build) {
  const Count& most = *std::max_element(counts.count.begin(), counts.count.end(), [](const Count& a, const Count& b) { return (rule_of(a.what).drawn ? 0.0 : a.bytes()) < (rule_of(b.what).drawn ? 0.0 : b.bytes()); });
  return most.key + ": only the counts of the scene were checked: with " + count_text(most) + ' ' + std::string(rule_of(most.what).name) + " it needs about " +
         bytes_text(counts.undrawn_bytes()) + " of memory, more than the limit of " + bytes_text(build) + " of a check; --memory raises the limit";
}

std::string not_solved(const CrowdedStart& crowd) {
  return crowd.key + ": the scene was counted, not built: about " + short_text(std::round(crowd.pairs)) + " pairs of bodies overlap at the start, each with about " +
         short_text(std::round(crowd.others)) + " others, and solving their contacts takes longer than a check; move them apart";
}

std::string unfinished(const Scene& scene, double seconds, double build) {
  return scene.source.string() + ": the scene was counted, but building it, solving its first contacts and counting the cells of its surfaces takes more than the limits of a check, " + short_text(seconds) +
         " s of processor time and " + bytes_text(build) + " of memory; --time-limit and --memory raise them";
}

/// What is looked at here does not depend on how exact contacts are, which may take long where they are deep.
constexpr double kContactError = 0.05;

constexpr double kForOutputs = 0.4;  // of the time to build a scene, beside that time

/// @param limit  of the building, and with some more time of the counts of what the surfaces at the start would be drawn with
void build_and_look(Scene scene, const SimulationOptions& options, double seconds, WorkLimit& limit, CheckReport& report) {
  scene.contact.error = std::max(contact_error(scene), kContactError);
  Simulation simulation(std::move(scene), options);
  limit.extend(kForOutputs * seconds);
  try {
    expect_output_sizes(simulation, requested_outputs(simulation.scene()));
  } catch (const Error& error) {
    throw Error(ErrorKind::Scene, error.faults());
  }
  limit.lift();
  report.built = true;
  report.particles = simulation.model().particles.size();
  report.warnings = simulation.warnings();
  report.mesh_obstacles = describe_mesh_obstacles(simulation.model());
  simulation.expect_steps();
}

}  // namespace

CheckReport check_scene(const Scene& scene, SimulationOptions options, double build, double seconds) {
  CheckReport report;
  report.objects = scene.objects.size();
  report.frames = scene.frame_count();
  const double allowed = std::max(options.memory, build);
  const SceneCounts counts = count_scene(scene, build);
  expect_within(scene, counts, allowed);
  for (const Count& count : counts.count) {
    if (count.what == Counted::Particles) report.particles += static_cast<std::size_t>(count.number);
  }
  if (counts.undrawn_bytes() > build) {
    report.warnings.push_back(not_built(counts, build));
    return report;
  }
  check_pictures(scene);
  if (const std::optional<CrowdedStart> crowd = find_crowd(scene)) {
    report.warnings.push_back(not_solved(*crowd));
    return report;
  }
  WorkLimit limit(seconds, build, options.interrupt);
  options.questions = true;
  options.memory = build;
  options.interrupt = limit.interrupt();
  try {
    const InterruptScope scope(limit.interrupt());
    build_and_look(scene, options, seconds, limit, report);
  } catch (const Interrupted&) {
    if (!limit.passed()) throw;
    report.warnings.push_back(unfinished(scene, seconds, build));
    report.built = false;
  } catch (const OverBudget& over) {  // by counts that only the model has
    expect_within(scene, over.counts(), allowed);
    report.warnings = {not_built(over.counts(), build)};
  }
  return report;
}

}  // namespace supple::scenes
