/// @file model_faults.h
/// Faults that only the whole scene shows, by key; raised together.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "read_scene_faults.h"
#include "scene_places.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

class ModelFaults {
 public:
  explicit ModelFaults(const Scene& scene) : scene_(scene) {}
  void add(std::string key, std::string expected, std::string found, std::string hint) {
    if (faults_.size() == 20) return;
    std::string place = place_of(scene_, key);
    faults_.push_back({std::move(place), std::move(key), std::move(expected), std::move(found), std::move(hint)});
  }
  /// As `add`, but only the first of a key.
  void add_once(const std::string& key, std::string expected, std::string found, std::string hint) {
    const bool known = std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) { return fault.key == key; });
    if (!known) add(key, std::move(expected), std::move(found), std::move(hint));
  }
  /// @throws Error{Scene} when there is any.
  void raise() const {
    if (!faults_.empty()) throw Error(ErrorKind::Scene, faults_);
  }

 private:
  const Scene& scene_;
  std::vector<Fault> faults_;
};

}  // namespace supple::scenes
