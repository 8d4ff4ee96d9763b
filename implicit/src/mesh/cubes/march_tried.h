/// @file march_tried.h
/// Data that a mesher keeps of its trial meshes for an error.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numeric>
#include <utility>

#include "field/bytes_of.h"
#include "mesh/cubes/march_mesher.h"
#include "mesh/error_search.h"
#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::implicit::march {

/// Meshers by the cell of their lattice. @tparam OnLattice  has std::uint64_t bytes() const
template <class OnLattice>
class TriedLattices {
 public:
  /// @param most  that is kept [byte]
  explicit TriedLattices(std::uint64_t most) : most_(most) {}

  void keep_at_most(std::uint64_t most) { most_ = most; }
  void begin_call() {
    for (auto& [cell, on] : on_) on.used = false;
  }
  /// The mesher of a cell, and whether this is the first time in this call.
  std::pair<OnLattice&, bool> use(double cell) {
    Entry& on = on_[cell];
    return {on.mesher, !std::exchange(on.used, true)};
  }
  /// Drops others than that of a cell, the coarsest first, which are cheapest to rebuild, until they fit without it: it may
  /// be the next to be dropped, and finer ones follow.
  /// @param beside  size of other kept data [byte]
  void fit(double cell, std::uint64_t beside = 0) { leave_out(cell, beside, on_.contains(cell) ? on_.at(cell).mesher.bytes() : 0); }
  /// Drops what this call did not use, and others as above until all fits. @return whether it does
  bool end_call(double cell, std::uint64_t beside = 0) {
    std::erase_if(on_, [](const auto& on) { return !on.second.used; });
    leave_out(cell, beside, 0);
    return bytes() + beside <= most_;
  }
  void clear() { on_.clear(); }
  /// make_within; keeps nothing when that throws.
  void search(const ErrorGoal& goal, const std::function<LevelTry(int level)>& make) try {
    make_within(goal, make);
  } catch (...) {
    clear();
    throw;
  }
  [[nodiscard]] std::uint64_t bytes() const {
    return std::accumulate(on_.begin(), on_.end(), std::uint64_t{0}, [](std::uint64_t sum, const auto& on) { return sum + on.second.mesher.bytes(); });
  }

 private:
  struct Entry {
    OnLattice mesher;
    bool used = false;  ///< in this call
  };
  void leave_out(double cell, std::uint64_t beside, std::uint64_t without) {
    for (auto at = on_.begin(); at != on_.end() && bytes() - without + beside > most_;) at = at->first == cell ? std::next(at) : on_.erase(at);
  }
  std::uint64_t most_;
  std::map<double, Entry, std::greater<>> on_;  ///< the coarsest first
};

/// Predicted sizes of the meshes of a search, which double from level to level.
class TriedSize {
 public:
  /// @param most  triangles
  TriedSize(const FieldView& field, const Vec3& origin, std::uint64_t most) : field_(field), origin_(origin), most_(most) {}
  /// Whether a level's mesh can be expected to have more. @throws Error{Limit} as that of level 0 would
  bool exceeds(int level, double cell, const Executor& executor) {
    if (most_ == ~std::uint64_t{0}) return false;
    exceeded_ = level == 0 ? exceeds_first({.origin = origin_, .cell = cell}, executor)
                           : std::ldexp(static_cast<double>(triangles_), level - level_) > static_cast<double>(most_);
    return exceeded_;
  }
  void add(int level, const Mesh& mesh) {
    level_ = level;
    triangles_ = mesh.triangle_count();
  }
  [[nodiscard]] bool is_exceeded() const { return exceeded_; }

 private:
  [[nodiscard]] bool exceeds_first(const Lattice& lattice, const Executor& executor) const {
    expect_marchable(field_, lattice, executor);
    constexpr std::uint64_t kTrianglesALeaf = 100;  // of 8^3 cells that a surface crosses
    PolygoniseCounts counts;
    try {
      return kTrianglesALeaf * lattice::surface_blocks(field_, lattice, executor, most_ / kTrianglesALeaf + 1, counts).block.size() > most_;
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Limit) throw;
      return true;
    }
  }

  FieldView field_;
  Vec3 origin_;
  std::uint64_t most_, triangles_ = 0;
  int level_ = 0;
  bool exceeded_ = false;
};

/// tried() of a mesh. Counts decide the trials, and those of a kept mesh may differ from those of a new one: then those
/// of a new one are at most the marcher's, and are computed where that bound does not decide.
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

/// Lattice and refinements of a level.
struct LevelPlan {
  double cell = 0.0;  ///< [m]
  int refinements = 0;
};

/// Makes meshes of rising level until one meets options.error, alone or with some of its triangles divided, and keeps their data within the limit.
/// @param of    has `tried`, TriedLattices<OnLattice>; divide(), as LocalDivision, and `division`; `alone`, the mesh where nothing is kept of it; plan_of(first cell, level);
///              mesh_on(on, first_time, plan, field, options, executor), where first_time says that this call makes the first mesh of the
///              lattice; error_on(on, plan, executor); take_mesh(on, plan); and bytes_beside() and forget_beside() of what is kept
///              beside the lattices [byte]
/// @param most  largest number of triangles of a mesh; a search that needs more ends. @return null then
template <class Of, class AnyField>
const Mesh* make_to_error(Of& of, const AnyField& field, const MarchOptions& options, const Executor& executor, MarchCounts& count,
                          std::uint64_t most = ~std::uint64_t{0}) {
  const double first = first_cell(field, options.lattice.cell);
  const Mesh *mesh = nullptr, *divided = nullptr;
  decltype(&of.tried.use(first).first) last = nullptr;
  LevelPlan plan;
  std::uint64_t sampled = 0, values = 0;  // of all meshes
  TriedSize size(field, options.lattice.origin, most);
  of.tried.begin_call();
  of.tried.search({.error = options.error, .first = first, .stated = first == options.lattice.cell}, [&](int level) {
    plan = of.plan_of(first, level);
    if (size.exceeds(level, plan.cell, executor)) return LevelTry{};  // ends the search
    const auto [on, first_time] = of.tried.use(plan.cell);
    last = &on;
    mesh = &of.mesh_on(on, first_time, plan, field, options, executor);
    const double error = of.error_on(on, plan, executor);
    count = on.counts();
    count.refinements = plan.refinements;
    count.error = error;
    if (first_time) {
      sampled += count.tiles_sampled;
      values += count.kernel_values;
    }
    size.add(level, *mesh);
    of.tried.fit(plan.cell, of.bytes_beside());
    // The next level has twice as many triangles: where fewer do by dividing those that are too far from the surface, the cells stay.
    divided = error > options.error ? of.divide(on, field, *mesh, options.error, 2 * mesh->triangle_count(), executor) : nullptr;
    if (divided != nullptr) {
      count.error = of.division.error();
      return LevelTry{.error = count.error};
    }
    return try_kept(error, *mesh, on, executor);
  });
  if (size.is_exceeded()) {
    of.tried.clear();
    return nullptr;
  }
  count.tiles_sampled = sampled;
  count.kernel_values = values;
  const bool fits = of.tried.end_call(plan.cell, of.bytes_beside());
  if (divided != nullptr) {
    of.alone = of.division.take();
    count.bytes = fits ? of.tried.bytes() + of.bytes_beside() : 0;
  } else {
    count.bytes = fits ? of.tried.bytes() + of.bytes_beside() - bytes_of(*mesh) : 0;
    if (fits) return mesh;
    of.alone = of.take_mesh(*last, plan);
  }
  if (fits) return &of.alone;
  of.tried.clear();
  of.forget_beside();
  return &of.alone;
}

}  // namespace supple::implicit::march
