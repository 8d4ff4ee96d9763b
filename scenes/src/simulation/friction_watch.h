/// @file friction_watch.h
/// Records the speeds below which friction falls to zero in a run. Explicit steps raise the speed of the scene where friction would otherwise reverse the
/// motion of a pair in every step (react.h); implicit steps raise it with the relative speed of the pair (compliant_contact.h).
#pragma once

#include <map>
#include <string>
#include <utility>

#include "simulation/frame.h"

namespace supple::scenes {

class FrictionWatch {
 public:
  /// The pairs of `frame.surface`, by `frame.friction_speed`.
  void look(const StageContext& context, const Frame& frame);
  /// The largest such speed of each two objects, by their names [m/s].
  [[nodiscard]] const std::map<std::pair<std::string, std::string>, double>& speeds() const { return speeds_; }

 private:
  std::map<std::pair<std::string, std::string>, double> speeds_;
};

}  // namespace supple::scenes
