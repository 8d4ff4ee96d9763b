/// @file kept_budget.h
/// Meshers of many bodies share a limit of kept data for meshes to an error.
#pragma once

#include <algorithm>
#include <cstdint>

namespace supple::scenes {

/// Meshers are served in order; one for which too little is left makes its meshes from scratch. No bit of a mesh depends on that.
class KeptBudget {
 public:
  /// @param most  limit for all meshers together [byte]
  explicit KeptBudget(std::uint64_t most) : most_(most) {}
  /// Counts the data that a mesher holds. @pre each once, before any is used
  template <class Mesher>
  void add(const Mesher& mesher) {
    kept_ += mesher.kept_to_error();
  }
  /// Calls make(mesher), which may keep what remains of the limit. @return its result
  template <class Mesher, class Make>
  decltype(auto) use(Mesher& mesher, const Make& make) {
    kept_ -= mesher.kept_to_error();
    mesher.keep_at_most(most_ - std::min(kept_, most_));
    decltype(auto) made = make(mesher);
    kept_ += mesher.kept_to_error();
    return made;
  }
  [[nodiscard]] std::uint64_t kept() const { return kept_; }

 private:
  std::uint64_t most_, kept_ = 0;
};

}  // namespace supple::scenes
