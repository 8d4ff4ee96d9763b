/// @file march_tried.h
/// What a mesher keeps of the meshes that its last call tried to reach an error.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <numeric>
#include <utility>

#include "error_search.h"
#include "march_mesher.h"

namespace supple::implicit::march {

/// Meshers by the cell of their lattice. @tparam OnLattice  has std::uint64_t bytes() const
template <class OnLattice>
class TriedLattices {
 public:
  /// @param most  that is kept [byte]
  explicit TriedLattices(std::uint64_t most) : most_(most) {}

  void begin_call() {
    for (auto& [cell, on] : on_) on.used = false;
  }
  /// The mesher of a cell, and whether this is the first time in this call.
  std::pair<OnLattice&, bool> use(double cell) {
    Entry& on = on_[cell];
    return {on.mesher, !std::exchange(on.used, true)};
  }
  /// Leaves others than that of a cell out, the coarsest first, which take the least time to make anew, until the rest fits.
  void fit(double cell) {
    for (auto at = on_.begin(); at != on_.end() && bytes() > most_;) at = at->first == cell ? std::next(at) : on_.erase(at);
  }
  /// Leaves out what this call did not use. @return whether all that is left fits
  bool end_call(double cell) {
    std::erase_if(on_, [](const auto& on) { return !on.second.used; });
    fit(cell);
    return bytes() <= most_;
  }
  void clear() { on_.clear(); }
  [[nodiscard]] std::uint64_t bytes() const {
    return std::accumulate(on_.begin(), on_.end(), std::uint64_t{0}, [](std::uint64_t sum, const auto& on) { return sum + on.second.mesher.bytes(); });
  }

 private:
  struct Entry {
    OnLattice mesher;
    bool used = false;  ///< in this call
  };
  std::uint64_t most_;
  std::map<double, Entry, std::greater<>> on_;  ///< the coarsest first
};

/// tried() of a mesh. Counts decide what is tried, and those of a mesh that was kept may be others than of a fresh one: then those
/// of a fresh one are at most the marcher's, and are found where that is not enough to tell.
/// @param of  with counts(), whole(), most_counts() and march_anew(executor); to be kept while the search runs, as the mesh
template <class Of>
[[nodiscard]] LevelTry try_kept(double error, const Mesh& mesh, Of& of, const Executor& executor) {
  if (of.whole()) return tried(error, mesh, of.counts());
  LevelTry now = tried(error, mesh, of.most_counts());
  now.count_levels_left = [&of, &executor, &mesh, error] {
    of.march_anew(executor);
    return tried(error, mesh, of.counts()).levels_left;
  };
  return now;
}

}  // namespace supple::implicit::march
