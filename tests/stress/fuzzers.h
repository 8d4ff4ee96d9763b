/// @file tests/stress/fuzzers.h
/// Inputs made from a seed and a number, tried in this process, and kept where they show a fault.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "supple/core/error.h"
#include "supple/scenes/scene.h"
#include "watched.h"

namespace supple::stress {

/// In place of a fault: an input is kept as it is.
inline constexpr const char* kAsItIs = "";

struct Fuzzer {
  Limits limits{};
  std::function<Trial(std::uint64_t)> trial;
  /// Writes the reduced input of a trial to a file. @return its name
  std::function<std::filesystem::path(const FoundFault&)> keep;
};

struct FuzzSettings {
  std::uint64_t seed = 1;
  std::filesystem::path sources;  ///< root of the source tree
  std::filesystem::path scratch;  ///< for files of trials and those that are kept
};

/// Mutated scenes of the library and of golden messages: read and checked, and run for two small frames if they are valid.
[[nodiscard]] Fuzzer scene_fuzzer(const FuzzSettings& settings);
/// Meshes (OBJ, PLY, OFF, STL) and tables of points (CSV), changed: read as obstacles and as places of particles.
[[nodiscard]] Fuzzer file_fuzzer(const FuzzSettings& settings);
/// Saved states with flipped bits, or exchanged, missing or added bytes: refused, or read as saved.
[[nodiscard]] Fuzzer state_fuzzer(const FuzzSettings& settings);
/// Lists of frames for `--frames`.
[[nodiscard]] Fuzzer frames_fuzzer(const FuzzSettings& settings);
/// Trials that go wrong on purpose, one kind after another, by what `plant` says: crash, hang, memory, slow, place, contract, internal.
/// All of them must be found.
[[nodiscard]] Fuzzer planted_fuzzer(const std::string& plant);

inline constexpr double kMostSeconds = 1.0;      ///< of processor time that refusing may take
inline constexpr double kMostBytes = 256e6 * 1.048576;  ///< of memory that refusing may take

/// Calls `use` and judges its exception: a user error refused in time, with little memory and with places, or a fault.
[[nodiscard]] Trial judged(const std::string& name, const std::function<void()>& use);

/// All that `supple check` does. @throws Error
void check_scene(const scenes::Scene& scene);
/// `check_scene`, then two frames with small pictures into a folder that is removed. @return a fault, or nothing
[[nodiscard]] std::string run_two_frames(scenes::Scene scene, const std::filesystem::path& folder);

[[nodiscard]] std::string file_text(const std::filesystem::path& path);
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace supple::stress
