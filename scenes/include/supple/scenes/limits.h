/// @file supple/scenes/limits.h
/// Memory that a scene needs, estimated by counts before anything is allocated, and the limits of memory and time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/error.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Default limit of memory for a scene [byte].
inline constexpr double kDefaultMemory = 8e9;
/// Default limits of memory [byte] and of processor time [s] for what `check_scene` builds, so that it answers in a second and 256 MB.
inline constexpr double kCheckMemory = 2e8, kCheckSeconds = 0.7;

/// Items of which a scene may have very many.
enum class Counted : std::uint8_t { Particles, Primitives, Bonds, FrictionBonds, NeighbourPairs, Laws, Bodies, Samples, FileBytes, TexturePixels, ImageSamples };

/// Memory that one of them needs.
struct CountRule {
  std::string_view name;  ///< in messages, plural
  std::string_view hint;  ///< how to reduce the number
  double bytes = 0.0;     ///< per item, all copies included, measured on scenes with many [byte]
  bool drawn = false;     ///< needed by pictures only, which a check does not draw
};
[[nodiscard]] const CountRule& rule_of(Counted what);

/// A number of items, and the key of the scene that causes them.
struct Count {
  Counted what = Counted::Particles;
  std::string key;
  double number = 0.0;
  bool estimated = false;  ///< extrapolated from a part of the particles
  [[nodiscard]] double bytes() const { return number * rule_of(what).bytes; }
};

struct SceneCounts {
  std::vector<Count> count;
  bool with_pairs = true;  ///< false: pairs found by distance are not counted, as the other items already exceed the limit
  [[nodiscard]] double bytes() const;
  [[nodiscard]] double undrawn_bytes() const;  ///< without items that only pictures need
};

/// Counts without building anything: from keys, sizes of files and, for pairs found by distance, positions of particles.
/// @param others  pairs found by distance are not counted if all other items need more than this [byte]
[[nodiscard]] SceneCounts count_scene(const Scene& scene, double others);

/// A scene needs more memory than allowed.
class OverBudget : public Error {
 public:
  OverBudget(Fault fault, SceneCounts counts) : Error(ErrorKind::Limit, std::move(fault)), counts_(std::move(counts)) {}
  [[nodiscard]] const SceneCounts& counts() const noexcept { return counts_; }

 private:
  SceneCounts counts_;
};

/// @throws OverBudget where the counts take more than `memory` [byte], naming the key, number and limit of the item that needs most
void expect_within(const Scene& scene, const SceneCounts& counts, double memory);

/// "1000000", "about 3000000".
[[nodiscard]] std::string count_text(const Count& count);
/// "8 GB", "1.5 MB" ...
[[nodiscard]] std::string bytes_text(double bytes);
/// A number of bytes: "4G", "1.5 GB", "800M", "64k"; without a unit in GB. NaN for another text or a number not above 0.
[[nodiscard]] double parse_bytes(std::string_view text);

}  // namespace supple::scenes
