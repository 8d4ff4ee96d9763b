/// @file scene_keys.h
/// The keys of a scene with an effect, each with the value that was read: two scenes are equivalent where these are equal,
/// whatever the order, units and defaults written out in their files.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "file/named_files.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// A key whose value is not the default.
struct SceneKey {
  std::string path;      ///< "objects.ball.particles.mass"; items of a list by name or index
  std::string value;     ///< as in a file; kGiven for a mapping, the hash of its content for a file
  std::string fallback;  ///< the value where the key is left out; kNone where there is none
  friend bool operator==(const SceneKey&, const SceneKey&) = default;
};
using SceneKeys = std::vector<SceneKey>;  ///< by path, ascending

inline constexpr std::string_view kGiven = "given";
inline constexpr std::string_view kNone = "none";

/// The keys that act on the motion: neither looks and outputs, nor grounds, obstacles, pairs and rules of contact without effect by
/// the rules of the scene. An obstacle counts if an object may touch it, even if none comes near.
/// @param hashes  of the files that the scene names
[[nodiscard]] SceneKeys motion_keys(const Scene& scene, FileHashes& hashes);
/// Whether objects may touch anything, one another included, by the rules of the scene.
[[nodiscard]] bool may_touch(const Scene& scene);
/// The keys that affect a picture of a given state.
[[nodiscard]] SceneKeys picture_keys(const Scene& scene, FileHashes& hashes);

[[nodiscard]] std::uint64_t hash_of(const SceneKeys& keys);
/// One line a key, for files.
[[nodiscard]] std::string text_of(const SceneKeys& keys);
/// @throws Error{Corrupt} for another text
[[nodiscard]] SceneKeys keys_in(std::string_view text);

/// Differences of two scenes, for a message.
struct KeyDifferences {
  std::string found;  ///< "objects.ball.particles.mass=2 (here 1)", of the other scene first; the first few of them
  std::string set;    ///< "--set objects.ball.particles.mass=2", which makes this scene the other one; empty where --set cannot
};
[[nodiscard]] KeyDifferences differences(const SceneKeys& here, const SceneKeys& other);

}  // namespace supple::scenes
