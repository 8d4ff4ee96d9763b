#include <algorithm>
#include <limits>
#include <vector>

#include "error_search.h"
#include "supple/core/error.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

/// D = F_m - max(0, F_j): the surface of body m where bodies divide space is D = 0.
class Share {
 public:
  Share(std::span<const FieldView> fields, std::size_t own) : own_(fields[own]) {
    const Box box = own_.surface_box();
    for (std::size_t j = 0; j < fields.size(); ++j) {
      if (j != own && fields[j].surface_box().overlaps(box)) others_.push_back(fields[j]);
    }
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
  /// An upper bound alone: what others take is left out.
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

}  // namespace

std::vector<Mesh> polygonise_partition_within(std::span<const FieldView> fields, const Lattice& coarsest, const PartitionError& error,
                                              const Executor& executor, PolygoniseCounts* counts) {
  SUPPLE_EXPECTS(error.largest > 0.0 && coarsest.cell > 0.0);
  constexpr double kTelling = 1000.0;  // blocks
  PolygoniseCounts local;
  PolygoniseCounts& count = counts != nullptr ? *counts : local;
  std::vector<Mesh> meshes;
  const ErrorGoal goal{.error = error.largest, .first = coarsest.cell, .stated = error.cell_is_stated, .key = error.key, .where = " where objects touch"};
  make_within(goal, [&](int level) {
    meshes = polygonise_partition(fields, {.origin = coarsest.origin, .cell = spacing_at(coarsest.cell, level)}, executor, &count);
    double found = 0.0;
    for (std::size_t m = 0; m < meshes.size(); ++m) found = std::max(found, centroid_error(Share(fields, m), meshes[m], executor));
    const auto blocks = static_cast<double>(count.blocks_visited);
    return LevelTry{.error = found, .telling = blocks >= kTelling, .levels_left = levels_left(blocks, static_cast<double>(kMostBlocks), 2.0)};
  });
  return meshes;
}

}  // namespace supple::implicit
