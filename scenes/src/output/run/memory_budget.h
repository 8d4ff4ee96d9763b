/// @file memory_budget.h
/// Memory of a scene, including counts that only its model shows.
#pragma once

#include <utility>

#include "supple/scenes/limits.h"

namespace supple::scenes {

class MemoryBudget {
 public:
  /// @param counts  so far   @param memory  that may be taken [byte]   @throws OverBudget
  MemoryBudget(const Scene& scene, SceneCounts counts, double memory) : scene_(scene), counts_(std::move(counts)), memory_(memory) {
    expect_within(scene_, counts_, memory_);
  }
  void add(Count count) { counts_.count.push_back(std::move(count)); }
  /// To be called before what was added is allocated. @throws OverBudget
  void expect() const { expect_within(scene_, counts_, memory_); }

 private:
  const Scene& scene_;
  SceneCounts counts_;
  double memory_;
};

}  // namespace supple::scenes
