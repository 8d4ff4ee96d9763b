/// @file supple/scenes/read_scene.h
/// Scene files: YAML in, a checked Scene out, or every fault at once with file, line, column, key and hint.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Reads and checks a scene. It may come from a stranger: it reads regular files only, which are, after links are resolved, in its own folder or allowed.
/// @param overrides  "objects.ball.particles.mass=2" (objects by name), applied before checks
/// @param allowed    files and folders elsewhere that it may read
/// @throws Error{Io} when the file cannot be read; Error{Scene} with up to 20 faults, each
/// "file:line:column: path.to.key: expected ..., found ...; hint". Files over 8 MiB or 200,000 nodes (each alias counted
/// at each use), aliases to ancestors, duplicate or unknown keys, several documents, merge keys, NaN, infinities, bad
/// UTF-8 and octal-looking integers are faults.
[[nodiscard]] Scene read_scene(const std::filesystem::path& path, std::span<const std::string> overrides = {},
                               std::span<const std::filesystem::path> allowed = {});

/// The same from text; `name` stands for the file in messages, files that the scene names are read from `folder`.
[[nodiscard]] Scene parse_scene(const std::string& text, const std::string& name,
                                const std::filesystem::path& folder, std::span<const std::string> overrides = {},
                                std::span<const std::filesystem::path> allowed = {});

/// What a scene was read from: `parse_scene` with these gives it again, as long as the files that it names are the same.
struct SceneSource {
  std::string text;
  std::string name;                    ///< of the file
  std::filesystem::path folder;
  std::vector<std::string> overrides;
  std::vector<std::filesystem::path> allowed;
};
/// Null for a scene that was not read.
[[nodiscard]] const SceneSource* source_of(const Scene& scene);

/// The reference page of all keys (Markdown), and a JSON Schema, from the field lists that read scenes.
[[nodiscard]] std::string scene_reference();
[[nodiscard]] std::string scene_json_schema();

}  // namespace supple::scenes
