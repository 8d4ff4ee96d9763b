#include "simulation/scene_samples.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "file/read_scene_faults.h"
#include "file/scene_places.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

constexpr double kCellsApart = 4.0;

double spacing_of(const SamplingDesc& sampling, double cell) {
  if (sampling.density) return implicit::even_spacing(*sampling.density);
  if (sampling.spacing) return *sampling.spacing;
  return cell > 0.0 ? kCellsApart * cell : 1.0;  // without a surface there is no cell, and nothing to sample
}

/// Replaces `lattice.cell` in faults by the key of the scene, or the object whose features need smaller cells.
[[noreturn]] void refuse(const Scene& scene, const Error& error, const std::string& object, bool by_feature) {
  std::vector<Fault> faults = error.faults();
  for (Fault& fault : faults) {
    if (fault.key != "lattice.cell") continue;
    if (by_feature) {
      fault.key = "output.samples";
      fault.found += ", half the size of the smallest features of '" + object + "'";
      fault.hint = "make these features larger, or the object smaller";
      continue;
    }
    fault.hint += ", which are a sixth of the spacing";
    const std::optional<double> density = scene.output.sampling.density;
    fault.key = density ? "output.sampling.density" : "output.sampling.spacing";
    if (!density) continue;
    fault.found += " for a density of " + short_text(*density) + " [1/m^2]";
    fault.hint += ", " + short_text(implicit::even_spacing(1.0)) + " / sqrt(density)";
  }
  rethrow_with_places(scene, {error.kind(), std::move(faults)});
}

}  // namespace

SceneSamples::SceneSamples(const SamplingDesc& sampling, double cell) : sampler_(spacing_of(sampling, cell)) {}

void SceneSamples::follow(Simulation& simulation, const Executor& executor) {
  std::vector<OfBody> before = std::move(bodies_);
  bodies_.clear();
  std::sort(before.begin(), before.end(), [](const OfBody& a, const OfBody& b) { return a.particle < b.particle; });
  std::vector<Pose> pose;
  for (std::size_t i = 0; i < surface_count(simulation.bodies()); ++i) {
    const Body& body = simulation.bodies()[i];
    if (body.skeleton.primitive.empty()) continue;
    OfBody& samples = bodies_.emplace_back(OfBody{.object = body.object, .particle = body.particle, .set = {}});
    const auto same = std::lower_bound(before.begin(), before.end(), body.particle,
                                       [](const OfBody& a, const auto& particle) { return a.particle < particle; });
    if (same != before.end() && same->particle == body.particle) samples.set = std::move(same->set);
    core::gather_poses(simulation.state().particles, body.particle, pose);
    const implicit::Field& field = simulation.fields()[i];
    try {
      (void)sampler_.update(field, pose, executor, samples.set);
    } catch (const Error& error) {
      refuse(simulation.scene(), error, body.name, sampler_.is_cell_of_feature(field));
    }
  }
}

void SceneSamples::expect_sizes(Simulation& simulation, const Executor& executor) const {
  for (std::size_t i = 0; i < surface_count(simulation.bodies()); ++i) {
    const Body& body = simulation.bodies()[i];
    if (body.skeleton.primitive.empty()) continue;
    const implicit::Field& field = simulation.fields()[i];
    try {
      sampler_.expect_size(field, executor);
    } catch (const Error& error) {
      refuse(simulation.scene(), error, body.name, sampler_.is_cell_of_feature(field));
    }
  }
}

io::PointSet SceneSamples::points() const {
  io::PointSet points;
  for (const OfBody& body : bodies_) {
    points.position.insert(points.position.end(), body.set.point.begin(), body.set.point.end());
  }
  const auto fill = [&](std::vector<double>& values, const auto& value) {
    std::size_t at = 0;
    for (const OfBody& body : bodies_) {
      for (std::size_t s = 0; s < body.set.size(); ++s) values[at++] = static_cast<double>(value(body, s));
    }
  };
  fill(points.add("id"), [](const OfBody& body, std::size_t s) { return body.set.id[s]; });
  fill(points.add("object"), [](const OfBody& body, std::size_t) { return body.object; });
  fill(points.add("owner"), [](const OfBody& body, std::size_t s) { return body.particle[body.set.part[s]]; });
  std::vector<double>& normal = points.add("normal", {"normal_x", "normal_y", "normal_z"});
  std::size_t at = 0;
  for (const OfBody& body : bodies_) {
    for (const Vec3& n : body.set.normal) {
      for (Eigen::Index k = 0; k < 3; ++k) normal[at++] = n[k];
    }
  }
  fill(points.add("area_m2"), [](const OfBody& body, std::size_t s) { return body.set.area[s]; });
  return points;
}

}  // namespace supple::scenes
