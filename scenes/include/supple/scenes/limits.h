/// @file supple/scenes/limits.h
/// What a scene takes, counted before any of it is allocated, and how much it may take.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/error.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Memory for a scene unless the caller allows another amount [byte].
inline constexpr double kDefaultMemory = 8e9;
/// Memory for what `check_scene` builds unless the caller allows another amount: about a second of work [byte].
inline constexpr double kCheckMemory = 2e8;

/// What scenes may have very many of.
enum class Counted : std::uint8_t { Particles, Primitives, Bonds, FrictionBonds, NeighbourPairs, Laws, Bodies, Samples, FileBytes, TexturePixels, ImageSamples };

/// How much memory one of them takes.
struct CountRule {
  std::string_view name;  ///< in messages, plural
  std::string_view hint;  ///< how to have fewer
  double bytes = 0.0;     ///< of one, all copies of it, as measured with scenes that have many [byte]
  bool drawn = false;     ///< only pictures need it, which a check draws none of
};
[[nodiscard]] const CountRule& rule_of(Counted what);

/// So many of something, and the key of the scene that asks for them.
struct Count {
  Counted what = Counted::Particles;
  std::string key;
  double number = 0.0;
  bool estimated = false;  ///< from a part of the particles
  [[nodiscard]] double bytes() const { return number * rule_of(what).bytes; }
};

struct SceneCounts {
  std::vector<Count> count;
  bool with_pairs = true;  ///< false: those that depend on distances were not counted, as the others are many enough
  [[nodiscard]] double bytes() const;
  [[nodiscard]] double undrawn_bytes() const;  ///< without what pictures alone need
};

/// Counts without building anything: by the keys, by the sizes of files and, where pairs are found by distances, from the places of particles.
/// @param others  pairs are not looked for where all that is counted otherwise takes more [byte]
[[nodiscard]] SceneCounts count_scene(const Scene& scene, double others);

/// A scene takes more memory than allowed.
class OverBudget : public Error {
 public:
  OverBudget(Fault fault, SceneCounts counts) : Error(ErrorKind::Limit, std::move(fault)), counts_(std::move(counts)) {}
  [[nodiscard]] const SceneCounts& counts() const noexcept { return counts_; }

 private:
  SceneCounts counts_;
};

/// @throws OverBudget where the counts take more than `memory` [byte], naming the key, number and limit of what takes most
void expect_within(const Scene& scene, const SceneCounts& counts, double memory);

/// "1000000", "about 3000000".
[[nodiscard]] std::string count_text(const Count& count);
/// "8 GB", "1.5 MB" ...
[[nodiscard]] std::string bytes_text(double bytes);
/// A number of bytes: "4G", "1.5 GB", "800M", "64k"; without a unit in GB. NaN where the text is none, or not above 0.
[[nodiscard]] double parse_bytes(std::string_view text);

}  // namespace supple::scenes
