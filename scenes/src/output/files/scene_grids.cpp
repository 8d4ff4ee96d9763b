#include "output/files/scene_grids.h"

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>

#include "file/scene_places.h"
#include "output/files/output_files.h"
#include "simulation/frame.h"
#include "supple/collision/deformed_field.h"
#include "supple/core/error.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// The deformed pressure of a body that others divide, and those that may reduce it.
struct Pressures {
  collision::DeformedPressure own;
  std::vector<collision::DeformedPressure> others;
};

Pressures pressures_of(const Division& division, std::size_t at) {
  Pressures pressures{division.pressure[at], {}};
  for (const std::size_t k : division.others_of(at)) pressures.others.push_back(division.pressure[k]);
  return pressures;
}

implicit::GridContent content_of(const GriddingDesc& gridding) {
  return gridding.content == GridContentName::Field ? implicit::GridContent::Field : implicit::GridContent::SignedDistance;
}

/// Version numbers of the fields and deformed pressures of a frame.
class BodyVersions {
 public:
  BodyVersions(Simulation& simulation, const Division& division, ContentVersions& versions)
      : simulation_(simulation), division_(division), versions_(versions), field_(division.placed.size()), pressure_(division.pressure.size()) {
    versions_.begin_frame();
  }
  [[nodiscard]] std::uint64_t field(std::uint32_t body) {
    if (field_[body]) return *field_[body];
    ContentWords words;
    words.add(Kind::Field);
    simulation_.add_field_content(body, words);
    return *(field_[body] = versions_.of(words.view()));
  }
  /// @param k  of the division
  [[nodiscard]] std::uint64_t pressure(std::size_t k) {
    if (pressure_[k]) return *pressure_[k];
    ContentWords words;
    words.add(Kind::Pressure);
    division_.pressure[k].add_content([this](std::uint32_t body) { return field(body); }, words);
    return *(pressure_[k] = versions_.of(words.view()));
  }
  /// The grid of a body that others divide.
  [[nodiscard]] std::uint64_t grid(std::size_t k, const std::string& name) {
    ContentWords words;
    words.add(Kind::Grid);
    for (const char c : name) words.add(static_cast<std::uint64_t>(c));
    words.add(pressure(k));
    for (const std::size_t other : division_.others_of(k)) words.add(pressure(other));
    return versions_.of(words.view());
  }

 private:
  enum class Kind : std::uint8_t { Field, Pressure, Grid };
  Simulation& simulation_;
  const Division& division_;
  ContentVersions& versions_;
  std::vector<std::optional<std::uint64_t>> field_, pressure_;
};

implicit::SurfaceGrid make_divided(Pressures pressures, double modulus, const implicit::GridOptions& options, const Executor& executor) {
  if (options.content == implicit::GridContent::SignedDistance) {
    return implicit::make_surface_grid(collision::DeformedDepth(std::move(pressures.own), std::move(pressures.others)), options, executor);
  }
  return implicit::make_surface_grid(collision::DeformedField(std::move(pressures.own), std::move(pressures.others), modulus), options, executor);
}

}  // namespace

void SceneGrids::write(const fs::path& folder, const std::string& name, int frame, Simulation& simulation) try {
  const std::vector<Body>& bodies = simulation.bodies();
  const Model& model = simulation.model();
  const GriddingDesc& gridding = simulation.scene().output.gridding;
  const Executor executor(1);
  implicit::GridOptions options;
  options.half_width = gridding.half_width;
  options.content = content_of(gridding);
  const bool distance = options.content == implicit::GridContent::SignedDistance;
  const std::vector<implicit::Field>& fields = simulation.fields();
  const Division& division = simulation.division();
  BodyVersions versions(simulation, division, versions_);
  std::vector<const implicit::SurfaceGrid*> grids;
  std::map<std::uint64_t, implicit::SurfaceGrid> divided;
  std::deque<collision::DeformedField> bulging;
  std::deque<implicit::DepthField> depth;
  std::vector<implicit::UnitedBody> united;
  updater_.resize(surface_count(bodies));
  for (std::uint32_t i = 0; i < surface_count(bodies); ++i) {
    if (bodies[i].skeleton.primitive.empty()) continue;
    options.name = bodies[i].name;
    const ObjectModel& object = model.objects[bodies[i].object];
    options.lattice.cell = object.cell;
    const auto place = std::lower_bound(division.body.begin(), division.body.end(), i);
    const bool apart = place == division.body.end() || *place != i;
    const auto at = static_cast<std::size_t>(place - division.body.begin());
    const double modulus = division.placed[i].material.modulus;
    if (gridding.of != GriddedName::Objects) {
      // With its bulges, but without the reduction by others: that is in the union.
      const implicit::FieldView whole =
          apart ? implicit::FieldView(fields[i]) : bulging.emplace_back(division.pressure[at], std::vector<collision::DeformedPressure>{}, modulus);
      united.push_back({distance ? implicit::FieldView(depth.emplace_back(whole)) : whole, apart ? versions.field(i) : versions.pressure(at),
                        apart ? &fields[i] : nullptr});
    }
    if (gridding.of == GriddedName::Scene) continue;
    try {
      if (apart) {
        grids.push_back(&updater_[i].make(fields[i], options, executor));
        continue;
      }
      const std::uint64_t version = versions.grid(at, bodies[i].name);
      if (auto kept = divided_.extract(version); !kept.empty()) {
        grids.push_back(&divided.insert(std::move(kept)).position->second);
      } else {
        grids.push_back(&divided.emplace(version, make_divided(pressures_of(division, at), modulus, options, executor)).first->second);
      }
    } catch (const Error& error) {
      throw with_keys_of(model, error, &object, nullptr);
    }
  }
  divided_ = std::move(divided);
  if (!united.empty()) {
    options.name = "scene";
    options.lattice.cell = simulation.cell();
    grids.push_back(&united_.make(united, options, executor));
  }
  implicit::write_grids(folder / "grids" / numbered(name, frame, ".vdb"), grids);
} catch (const Error& error) {
  rethrow_with_places(simulation.scene(), with_keys_of(simulation.model(), error, nullptr, nullptr));
}

void expect_grid_sizes(Simulation& simulation, const Executor& executor) try {
  const std::vector<Body>& bodies = simulation.bodies();
  const GriddingDesc& gridding = simulation.scene().output.gridding;
  if (gridding.of == GriddedName::Scene) return;
  const std::vector<implicit::Field>& fields = simulation.fields();
  const Division& division = simulation.division();
  for (std::uint32_t i = 0; i < surface_count(bodies); ++i) {
    if (bodies[i].skeleton.primitive.empty() || std::binary_search(division.body.begin(), division.body.end(), i)) continue;
    const ObjectModel& object = simulation.model().objects[bodies[i].object];
    try {
      implicit::expect_griddable(fields[i], {.lattice = {.cell = object.cell}, .half_width = gridding.half_width}, executor);
    } catch (const Error& error) {
      throw with_keys_of(simulation.model(), error, &object, nullptr);
    }
  }
} catch (const Error& error) {
  rethrow_with_places(simulation.scene(), error);
}

}  // namespace supple::scenes
