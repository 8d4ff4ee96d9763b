/// @file model_faults.h
/// Faults that only the whole scene shows, and files that cannot be read, by key; raised together.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "file/read_scene_faults.h"
#include "file/scene_places.h"
#include "supple/core/error.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

class ModelFaults {
 public:
  explicit ModelFaults(const Scene& scene) : scene_(scene) {}
  void add(std::string key, std::string expected, std::string found, std::string hint) {
    std::string place = place_of(scene_, key);
    keep(ErrorKind::Scene, {std::move(place), std::move(key), std::move(expected), std::move(found), std::move(hint)});
  }
  /// As `add`, but only for the first fault of a key.
  void add_once(const std::string& key, std::string expected, std::string found, std::string hint) {
    if (!has(key)) add(key, std::move(expected), std::move(found), std::move(hint));
  }
  [[nodiscard]] bool has(const std::string& key) const {
    return std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) { return fault.key == key; });
  }
  [[nodiscard]] bool none() const { return faults_.empty(); }
  /// Reads the file that `key` names; returns nothing and adds faults where it cannot be read or has another format.
  template <class Read>
  auto read(const std::string& key, const Read& read) -> std::optional<decltype(read())> try {
    return read();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::Io && error.kind() != ErrorKind::Scene) throw;
    for (Fault fault : error.faults()) {
      if (fault.key.empty()) fault.key = key;
      keep(error.kind(), std::move(fault));
    }
    return std::nullopt;
  }
  /// @throws Error when there is any: Io if all are of files that cannot be read, else Scene.
  void raise() const {
    if (!faults_.empty()) throw Error(kind_, faults_);
  }

 private:
  void keep(ErrorKind kind, Fault fault) {
    if (faults_.size() == 20) return;
    if (faults_.empty() || kind == ErrorKind::Scene) kind_ = kind;
    faults_.push_back(std::move(fault));
  }

  const Scene& scene_;
  ErrorKind kind_ = ErrorKind::Scene;
  std::vector<Fault> faults_;
};

}  // namespace supple::scenes
