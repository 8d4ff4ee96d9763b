/// @file sweep_values.h
/// Values of a key of a sweep, as `--set KEY=VALUES` gives them.
#pragma once

#include <string>
#include <vector>

namespace supple::scenes {

struct SweepValues {
  enum class Kind { Fixed, List, Range };
  std::string key;
  Kind kind = Kind::Fixed;
  std::vector<std::string> list;  ///< Fixed: one value; List: all, those of a:b:N included
  bool stepped = false;           ///< List: it was given as a:b:N
  double low = 0.0, high = 0.0;   ///< Range, in `unit`
  bool log = false;               ///< Range
  std::string unit;               ///< Range; "" for none

  /// Range or List: the value at a share in [0, 1) of the way. @pre kind is not Fixed
  [[nodiscard]] std::string at(double share) const;
};

/// @param setting  "key=values"   @throws Error{Usage}
[[nodiscard]] SweepValues read_sweep_values(const std::string& setting);

}  // namespace supple::scenes
