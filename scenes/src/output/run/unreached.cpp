#include "output/run/unreached.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "file/fields/scene_keys.h"
#include "file/scene_places.h"
#include "output/files/output_files.h"
#include "output/files/saved_frames.h"
#include "simulation/reach.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/model.h"
#include "supple/scenes/run.h"
#include "supple/scenes/state.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

using Names = std::set<std::string>;

/// Whether the head of a saved state names this scene; false for files that are none.
bool names_scene(const fs::path& path, std::uint64_t scene) {
  std::array<std::uint64_t, 3> head{};  // magic, version, scene
  const std::optional<std::size_t> size = io::read_start(path, std::as_writable_bytes(std::span(head)));
  return size == sizeof head && head[2] == scene;
}

/// The solid that a key belongs to: "obstacles.wall.size" or "ground.height"; empty for other keys.
std::string solid_of(std::string_view path) {
  constexpr std::string_view kObstacles = "obstacles.", kGround = "ground";
  if (path == kGround || path.starts_with("ground.")) return std::string(kGround);
  if (!path.starts_with(kObstacles)) return {};
  path.remove_prefix(kObstacles.size());
  return std::string(path.substr(0, path.find('.')));
}

/// Whether a key is of a pair with one of these solids: "pairs(ball, wall).friction".
bool pairs_with(std::string_view path, const Names& solids) {
  constexpr std::string_view kPairs = "pairs(";
  if (!path.starts_with(kPairs)) return false;
  const std::string_view names = path.substr(kPairs.size(), path.find(')') - kPairs.size());
  const std::size_t comma = names.find(", ");
  return solids.contains(std::string(names.substr(0, comma))) || (comma != std::string_view::npos && solids.contains(std::string(names.substr(comma + 2))));
}

/// Solids whose keys differ, or that only one scene has.
Names differing_solids(const SceneKeys& here, const SceneKeys& there) {
  Names names;
  const auto add = [&](const SceneKeys& some, const SceneKeys& others) {
    for (const SceneKey& key : some) {
      const std::string name = solid_of(key.path);
      if (!name.empty() && std::find(others.begin(), others.end(), key) == others.end()) names.insert(name);
    }
  };
  add(here, there);
  add(there, here);
  return names;
}

/// Without those of some solids. @param touching  without it the rules of contact have no effect
SceneKeys keys_without(const SceneKeys& keys, const Names& solids, bool touching) {
  SceneKeys out;
  std::copy_if(keys.begin(), keys.end(), std::back_inserter(out), [&](const SceneKey& key) {
    const bool rules = key.path == "contact" || key.path.starts_with("contact.");
    return !solids.contains(solid_of(key.path)) && !pairs_with(key.path, solids) && (touching || !rules);
  });
  return out;
}

/// Whether the run never touched these solids, and would not have touched those of the scene.
bool reached_none(const Scene& scene, const Names& solids, const RunRecord& record) {
  const auto reached = [&](const RunRecord::Solid& solid) { return solid.reached && solids.contains(solid.name); };
  if (std::any_of(record.solids.begin(), record.solids.end(), reached)) return false;
  const Model model = build_model(scene);
  if (record.reach.size() != model.objects.size()) return false;
  for (std::uint32_t k = 0; k < model.fixed.size(); ++k) {
    if (!solids.contains(model.fixed[k].name)) continue;
    if (takes_part(model.fixed[k])) return false;
    for (std::uint32_t i = 0; i < model.objects.size(); ++i) {
      const auto number = static_cast<std::uint32_t>(model.objects.size()) + k;
      if (!model.objects[i].collides || (model.rules.allowed && !model.rules.allowed(i, number))) continue;
      const auto apart = [&](const Box& box) { return is_apart(model.fixed[k], box); };
      if (!std::all_of(record.reach[i].begin(), record.reach[i].end(), apart)) return false;
    }
  }
  return true;
}

/// The scene with these solids out of contact.
Scene out_of_contact(const Scene& scene, const Names& solids) {
  Scene out = scene;
  std::erase_if(out.pairs, [&](const PairDesc& pair) { return std::any_of(pair.objects.begin(), pair.objects.end(), [&](const std::string& name) { return solids.contains(name); }); });
  if (out.ground && solids.contains("ground")) out.ground->collides = false;
  for (const ObstacleDesc& obstacle : out.obstacles) {
    if (!solids.contains(obstacle.name)) continue;
    for (const ObjectDesc& object : out.objects) {
      if (object.contact) out.pairs.push_back({.objects = {object.name, obstacle.name}, .collide = false, .friction = {}, .dissipation = {}, .restitution = {}});
    }
  }
  return out;
}

}  // namespace

Scene scene_to_draw(const Scene& scene, const fs::path& path) {
  if (names_scene(path, scene.content_hash) || scene.motion_keys == nullptr) return scene;
  StateOrigin origin;
  try {
    const State state = load_state(path, origin_of(scene), {.belongs_to = &origin});
    const SceneKeys here = keys_in(*scene.motion_keys), there = keys_in(*origin.keys);
    const Names solids = differing_solids(here, there);
    if (solids.empty() || state.substep != 0 || !reached_none(scene, solids, state.record)) return scene;
    Scene drawn = out_of_contact(scene, solids);
    const FileAccess files = files_of(scene);
    FileHashes hashes(files);
    const bool touching = may_touch(drawn);
    if (keys_without(motion_keys(drawn, hashes), solids, touching) != keys_without(there, solids, touching)) return scene;
    drawn.content_hash = origin.scene;
    drawn.motion_keys = origin.keys;
    return drawn;
  } catch (const Error&) {
    return scene;  // whoever reads the state says what is wrong with it
  }
}

Scene scene_to_draw(const Scene& scene, const fs::path& folder, const std::set<int>& frames) {
  const std::string name = scene_name(scene);
  const std::optional<SavedRange> saved = saved_range(folder, name, scene.frame_count());
  if (!saved) return scene;
  int last = saved->last;
  while (last > saved->first && ((!frames.empty() && last > *frames.rbegin()) || !fs::exists(state_path(folder, name, last)))) --last;
  return scene_to_draw(scene, state_path(folder, name, last));
}

}  // namespace supple::scenes
