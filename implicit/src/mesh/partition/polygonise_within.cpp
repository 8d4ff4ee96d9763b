#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "field/bytes_of.h"
#include "mesh/error_search.h"
#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/mesh_limits.h"
#include "supple/implicit/partition_mesher.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

/// Body m and the others that may take of its surface, ascending.
std::vector<std::size_t> sharers_of(std::span<const FieldView> fields, std::size_t m) {
  const Box box = fields[m].surface_box();
  std::vector<std::size_t> sharers{m};
  for (std::size_t j = 0; j < fields.size(); ++j) {
    if (j != m && fields[j].surface_box().overlaps(box)) sharers.push_back(j);
  }
  return sharers;
}

/// D = F_m - max(0, F_j): the surface of body m where bodies divide space is D = 0.
class Share {
 public:
  Share(std::span<const FieldView> fields, std::span<const std::size_t> sharers) : own_(fields[sharers.front()]) {
    for (const std::size_t j : sharers.subspan(1)) others_.push_back(fields[j]);
  }

  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    std::vector<Vec3> gradients(points.size());
    evaluate(points, values, gradients);
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    thread_local std::vector<double> most, other;
    thread_local std::vector<Vec3> most_slope, other_slope;
    most.assign(points.size(), 0.0);
    most_slope.assign(points.size(), Vec3::Zero());
    other.resize(points.size());
    other_slope.resize(points.size());
    Box box;
    for (const Vec3& p : points) box.include(p);
    own_.evaluate(points, values, gradients);
    for (const FieldView& field : others_) {
      if (!field.surface_box().overlaps(box)) continue;
      field.evaluate(points, other, other_slope);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (other[i] <= most[i]) continue;
        most[i] = other[i];
        most_slope[i] = other_slope[i];
      }
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      values[i] -= most[i];
      gradients[i] -= most_slope[i];
    }
  }
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { own_.evaluate_parts(points, parts); }
  /// An upper bound: other bodies are ignored.
  [[nodiscard]] Interval bound(const Box& box) const { return {-std::numeric_limits<double>::infinity(), own_.bound(box).upper}; }
  [[nodiscard]] double gradient_bound(const Box& box) const {
    double steepest = 0.0;
    for (const FieldView& field : others_) steepest = std::max(steepest, field.gradient_bound(box));
    return own_.gradient_bound(box) + steepest;
  }
  [[nodiscard]] Box surface_box() const { return own_.surface_box(); }
  [[nodiscard]] double feature_size() const { return own_.feature_size(); }

 private:
  FieldView own_;
  std::vector<FieldView> others_;
};

/// centroid_error of the bodies' meshes, the largest.
double largest_error(std::span<const FieldView> fields, std::span<const Mesh> meshes, const Executor& executor) {
  double largest = 0.0;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    largest = std::max(largest, centroid_error(Share(fields, sharers_of(fields, m)), meshes[m], executor));
  }
  return largest;
}

/// Errors of meshes by bodies whose surfaces are the same.
class KeptErrors {
 public:
  /// As largest_error.
  double measure(std::span<const FieldView> fields, std::span<const std::uint64_t> version, std::span<const Mesh> meshes,
                 const Executor& executor) {
    std::map<std::uint64_t, Entry> last = std::exchange(entry_, {});
    double largest = 0.0;
    for (std::size_t m = 0; m < meshes.size(); ++m) {
      const std::vector<std::size_t> sharers = sharers_of(fields, m);
      std::vector<std::uint64_t> versions;
      for (const std::size_t j : sharers) versions.push_back(version[j]);
      auto node = last.extract(version[m]);
      Entry entry = node.empty() ? Entry{} : std::move(node.mapped());
      if (node.empty() || entry.version != versions || !entry.is_of(meshes[m])) {
        entry = {.version = std::move(versions), .position = meshes[m].position, .normal = meshes[m].normal, .triangle = meshes[m].triangle};
        entry.error = centroid_error(Share(fields, sharers), meshes[m], executor);
      }
      largest = std::max(largest, entry.error);
      entry_.emplace(version[m], std::move(entry));
    }
    return largest;
  }
  [[nodiscard]] std::uint64_t bytes() const {
    std::uint64_t sum = 0;
    for (const auto& [own, e] : entry_) sum += sizeof e + bytes_of(e.version) + bytes_of(e.position) + bytes_of(e.normal) + bytes_of(e.triangle);
    return sum;
  }

 private:
  struct Entry {
    std::vector<std::uint64_t> version;  ///< of the fields, as the body's sharers
    std::vector<Vec3> position, normal;
    std::vector<std::array<std::uint32_t, 3>> triangle;
    double error = 0.0;  ///< [m]

    [[nodiscard]] bool is_of(const Mesh& mesh) const {
      return same_bits(position, mesh.position) && same_bits(normal, mesh.normal) && same_bits(triangle, mesh.triangle);
    }
  };
  template <class T>
  static bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
  }

  std::map<std::uint64_t, Entry> entry_;  ///< by the version of the body's own field
};

/// @param make  the meshes of a level on its lattice, their error and counts
template <class Make>
std::vector<Mesh> within(const Lattice& coarsest, const PartitionError& error, PolygoniseCounts& all, const Make& make) {
  SUPPLE_EXPECTS(error.largest > 0.0 && coarsest.cell > 0.0);
  constexpr double kTelling = 100.0;  // blocks, of some 300 triangles each
  std::vector<Mesh> meshes;
  all = {};
  const ErrorGoal goal{.error = error.largest, .first = coarsest.cell, .stated = error.cell_is_stated, .key = error.key, .where = " where objects touch"};
  make_within(goal, [&](int level) {
    PolygoniseCounts count;
    const double found = make(level, Lattice{.origin = coarsest.origin, .cell = spacing_at(coarsest.cell, level)}, meshes, count);
    const PolygoniseCounts before = std::exchange(all, count);
    all.blocks_visited += before.blocks_visited;
    all.blocks_present += before.blocks_present;
    all.nodes += before.nodes;
    const auto blocks = static_cast<double>(count.blocks);
    return LevelTry{.error = found, .telling = blocks >= kTelling, .levels_left = levels_left(blocks, static_cast<double>(kMostBlocks), 2.0)};
  });
  return meshes;
}

}  // namespace

struct PartitionErrorMesher::Impl {
  struct OnLevel {
    PartitionMesher mesher;
    KeptErrors errors;
    std::uint64_t bytes = 0;  ///< of both
    bool used = false;        ///< in this call
  };
  std::uint64_t most_kept = 0;
  std::map<int, OnLevel> level;

  [[nodiscard]] std::uint64_t bytes() const {
    return std::accumulate(level.begin(), level.end(), std::uint64_t{0}, [](std::uint64_t sum, const auto& on) { return sum + on.second.bytes; });
  }
  /// The coarsest ones are cheapest to rebuild.
  void leave_out_coarsest() {
    while (!level.empty() && bytes() > most_kept) level.erase(level.begin());
  }
};

PartitionErrorMesher::PartitionErrorMesher(std::uint64_t most_kept) : impl_(std::make_unique<Impl>()) { impl_->most_kept = most_kept; }
PartitionErrorMesher::~PartitionErrorMesher() = default;
PartitionErrorMesher::PartitionErrorMesher(PartitionErrorMesher&&) noexcept = default;
PartitionErrorMesher& PartitionErrorMesher::operator=(PartitionErrorMesher&&) noexcept = default;

std::vector<Mesh> PartitionErrorMesher::make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& coarsest,
                                             const PartitionError& error, const Executor& executor, PolygoniseCounts* counts) {
  SUPPLE_EXPECTS(version.size() == fields.size());
  PolygoniseCounts local;
  PolygoniseCounts& count = counts != nullptr ? *counts : local;
  for (auto& [number, on] : impl_->level) on.used = false;
  std::vector<Mesh> result = within(coarsest, error, count, [&](int number, const Lattice& lattice, std::vector<Mesh>& meshes, PolygoniseCounts& of_level) {
    Impl::OnLevel& on = impl_->level[number];
    on.used = true;
    meshes = on.mesher.make(fields, version, lattice, executor, &of_level);
    const double found = on.errors.measure(fields, version, meshes, executor);
    on.bytes = of_level.bytes + on.errors.bytes();
    impl_->leave_out_coarsest();
    return found;
  });
  std::erase_if(impl_->level, [](const auto& on) { return !on.second.used; });
  count.bytes = impl_->bytes();
  return result;
}

void PartitionErrorMesher::forget() { impl_->level.clear(); }

std::vector<Mesh> polygonise_partition_within(std::span<const FieldView> fields, const Lattice& coarsest, const PartitionError& error,
                                              const Executor& executor, PolygoniseCounts* counts) {
  PolygoniseCounts local;
  return within(coarsest, error, counts != nullptr ? *counts : local,
                [&](int, const Lattice& lattice, std::vector<Mesh>& meshes, PolygoniseCounts& count) {
                  meshes = polygonise_partition(fields, lattice, executor, &count);
                  return largest_error(fields, meshes, executor);
                });
}

void expect_divisible_within(std::span<const FieldView> fields, const Lattice& coarsest, const PartitionError& error, const Executor& executor,
                             std::uint64_t most_blocks) {
  constexpr double kReached = 0.0;  // ends the search
  std::vector<Box> surface;
  for (const FieldView& field : fields) surface.push_back(field.surface_box());
  double blocks = 0.0;  // of the last level
  int last = 0;
  PolygoniseCounts counts;
  (void)within(coarsest, error, counts, [&](int level, const Lattice& lattice, std::vector<Mesh>& meshes, PolygoniseCounts& count) {
    if (level == 0) blocks = static_cast<double>(lattice::find_label_blocks(fields, surface, lattice, executor, kMostBlocks, count).block.size());
    if (std::ldexp(blocks, level - std::exchange(last, level)) > static_cast<double>(most_blocks)) return kReached;
    meshes = polygonise_partition(fields, lattice, executor, &count);
    blocks = static_cast<double>(count.blocks);
    return largest_error(fields, meshes, executor);
  });
}

}  // namespace supple::implicit
