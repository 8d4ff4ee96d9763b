/// @file friction_watch.h
/// Below which speeds friction fades out in a run. Explicit steps raise the speed that a scene asks for where friction would turn a pair back, to and
/// fro (react.h); implicit ones raise it with how fast a pair moves (compliant_contact.h).
#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>

#include "simulation/frame.h"
#include "supple/core/compliant_contact.h"

namespace supple::scenes {

class FrictionWatch {
 public:
  /// The pairs of `frame.surface` in explicit steps of `context.step`, by the mean contributions where their load acts.
  void look(const StageContext& context, const Frame& frame);
  /// The same of an implicit step. @param loads  by pair of `frame.surface`
  void look(const StageContext& context, const Frame& frame, std::span<const core::ContactPairLoad> loads);
  /// The largest speed of each two objects, by their names [m/s].
  [[nodiscard]] const std::map<std::pair<std::string, std::string>, double>& speeds() const { return speeds_; }

 private:
  void note(const StageContext& context, const collision::BodyPair& bodies, double speed);

  std::map<std::pair<std::string, std::string>, double> speeds_;
};

}  // namespace supple::scenes
