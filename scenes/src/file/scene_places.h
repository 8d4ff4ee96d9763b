/// @file scene_places.h
/// What reading a scene leaves besides its keys: their positions in its file, for faults that only the whole scene shows, and from where it may read files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "file/named_files.h"
#include "file/yaml/yaml_tree.h"
#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

struct ScenePlaces {
  SourceTexts texts;
  Tree tree;
  const Node* root = nullptr;
  SceneSource source;
  FileAccess files;
};

/// Of a scene that was not read: the folder of its source.
[[nodiscard]] inline FileAccess files_of(const Scene& scene) {
  return scene.places == nullptr ? FileAccess{scene.source.parent_path(), {}} : scene.places->files;
}

/// "file:line:column" of a key, or of the nearest one above it that is given; the file alone of a scene that was not read.
/// @param key  as in messages and overrides: "objects.ball.skeleton[0].radius"
[[nodiscard]] std::string place_of(const Scene& scene, std::string_view key);

/// Reads the file that a key names, so that its faults name the key too. @param read  called without arguments
template <class Read>
auto read_for(const std::string& key, Read&& read) try {
  return std::forward<Read>(read)();
} catch (const Error& error) {
  std::vector<Fault> faults = error.faults();
  for (Fault& fault : faults) {
    if (fault.key.empty()) fault.key = key;
  }
  throw Error(error.kind(), std::move(faults));
}

/// The text of a scene file, at most one byte more than `parse_yaml` takes, so that it refuses larger ones; none where it cannot be read.
[[nodiscard]] std::optional<std::string> read_text(const std::filesystem::path& path);

/// Throws the error again with the positions of its keys.
[[noreturn]] void rethrow_with_places(const Scene& scene, const Error& error);

}  // namespace supple::scenes
