#include "mesh/error_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <vector>

#include "mesh/cubes/march_tiles.h"
#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

constexpr std::size_t kBatch = 512;  // triangles
constexpr double kOrderTwo = 0.5, kOrderOne = 0.5 * std::numbers::sqrt2;  // by which errors shrink from level to level

bool is_smooth(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle, const Vec3& outward) {
  constexpr double kCosine = 0.97;
  return std::all_of(triangle.begin(), triangle.end(), [&](std::uint32_t v) { return mesh.normal[v].dot(outward) > kCosine; });
}

/// Never below the distance from p to the surface, on which the mesh's vertices lie.
double distance_by_points(const FieldView& field, const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle, const Vec3& p, Box& evaluated) {
  constexpr int kIterations = 50;
  double least = std::numeric_limits<double>::infinity();
  for (const std::uint32_t v : triangle) least = std::min(least, (mesh.position[v] - p).norm());
  const Projection foot = project_to_surface(field, p, kIterations, &evaluated);
  return foot.converged ? std::min(least, (foot.point - p).norm()) : least;
}

/// Extrapolates how errors shrink from the last three meshes.
class Order {
 public:
  void add(int level, double error) {
    if (meshes_++ > 0) {
      // Orders between 3/2 and 5/2 are taken as two: at order p, the fourth power of the gain is 2^(2 p levels).
      const int levels = level - level_;
      const double gain = error_ / error, fourth = gain * gain * gain * gain;
      was_slow_ = slow_;
      slow_ = fourth < std::ldexp(1.0, 3 * levels);
      even_ = !slow_ && fourth < std::ldexp(1.0, 5 * levels);
    }
    level_ = level;
    error_ = error;
  }
  [[nodiscard]] bool known() const { return meshes_ > 2; }
  /// As on a smooth surface with triangles that are small against its radii.
  [[nodiscard]] bool even() const { return even_; }
  [[nodiscard]] int levels_to(double wanted) const { return levels_to(wanted, slow_ ? kOrderOne : kOrderTwo); }
  /// If errors fall as fast as they did at their best.
  [[nodiscard]] int least_levels_to(double wanted) const { return levels_to(wanted, slow_ && was_slow_ ? kOrderOne : kOrderTwo); }
  /// The error after some levels if it falls as slowly as it did at its worst.
  [[nodiscard]] double most_after(int levels) const {
    double error = error_;
    for (; levels > 0; --levels) error *= slow_ || was_slow_ ? kOrderOne : kOrderTwo;
    return error;
  }

 private:
  [[nodiscard]] int levels_to(double wanted, double factor) const {
    int levels = 0;
    for (double error = error_; error > wanted; error *= factor) ++levels;
    return levels;
  }

  int meshes_ = 0, level_ = 0;
  double error_ = 0.0;
  bool slow_ = false, was_slow_ = false, even_ = false;
};

[[noreturn]] void refuse(const ErrorGoal& goal, double found, int level, double reachable) {
  using lattice::three_digits;
  throw Error(ErrorKind::Limit, {.place = "",
                                 .key = goal.key,
                                 .expected = "expected an error of at most " + three_digits(goal.error) + " m",
                                 .found = three_digits(found) + " m with triangles of " + three_digits(spacing_at(goal.first, level)) + " m" +
                                          goal.where + ", and a mesh that meets it is too large",
                                 .hint = "allow at least " + three_digits(1.05 * reachable) + " m"});
}

/// The coarsest mesh alone is too large.
[[noreturn]] void refuse_first(const ErrorGoal& goal, const Error& size) {
  std::vector<Fault> faults = size.faults();
  for (Fault& fault : faults) {
    fault.key = goal.key;
    fault.expected += " in the coarsest mesh";
    fault.hint = "remove the error and " + fault.hint;
  }
  throw Error(ErrorKind::Limit, std::move(faults));
}

}  // namespace

void centroid_errors(const FieldView& field, const Mesh& mesh, std::span<const std::uint32_t> triangles, std::span<double> error,
                     std::span<Box> evaluated) {
  SUPPLE_EXPECTS(error.size() == triangles.size() && evaluated.size() == triangles.size());
  for (std::size_t begin = 0; begin < triangles.size(); begin += kBatch) {
    std::array<Vec3, kBatch> points, gradients;
    std::array<double, kBatch> values;
    const std::size_t n = std::min(kBatch, triangles.size() - begin);
    for (std::size_t i = 0; i < n; ++i) {
      const auto& t = mesh.triangle[triangles[begin + i]];
      points[i] = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
    }
    field.evaluate(std::span(points).first(n), std::span(values).first(n), std::span(gradients).first(n));
    for (std::size_t i = 0; i < n; ++i) {
      const double slope = gradients[i].norm();
      const auto& t = mesh.triangle[triangles[begin + i]];
      const bool smooth = slope > 0.0 && is_smooth(mesh, t, -gradients[i] / slope);
      Box& box = evaluated[begin + i] = Box{points[i], points[i]};
      error[begin + i] = smooth ? std::abs(values[i]) / slope : distance_by_points(field, mesh, t, points[i], box);
    }
  }
}

double centroid_error(const FieldView& field, const Mesh& mesh, const Executor& executor) {
  std::vector<double> largest((mesh.triangle_count() + kBatch - 1) / kBatch, 0.0);
  executor.for_blocks(mesh.triangle_count(), kBatch, [&](std::size_t begin, std::size_t end) {
    std::array<std::uint32_t, kBatch> triangles;
    std::array<double, kBatch> error;
    std::array<Box, kBatch> evaluated;
    const std::size_t n = end - begin;
    std::iota(triangles.begin(), triangles.end(), static_cast<std::uint32_t>(begin));
    centroid_errors(field, mesh, std::span(triangles).first(n), std::span(error).first(n), std::span(evaluated).first(n));
    double& most = largest[begin / kBatch];
    for (std::size_t i = 0; i < n; ++i) most = std::max(most, error[i]);
  });
  return largest.empty() ? 0.0 : *std::max_element(largest.begin(), largest.end());
}

double spacing_at(double first, int level) { return std::ldexp(level % 2 == 0 ? first : kOrderOne * first, -(level / 2)); }

int levels_left(double now, double most, double growth) {
  constexpr int kMany = 100;
  int levels = 0;
  for (now *= growth; levels < kMany && now <= most; now *= growth) ++levels;
  return levels;
}

LevelTry tried(double error, const Mesh& mesh, const MarchCounts& counts) {
  constexpr double kTelling = 10'000.0;  // triangles
  constexpr double kMostBytes = 8e9;
  // By counts: the decision must not depend on the memory that a mesher keeps from earlier meshes.
  constexpr double kBytesATriangle = 72.0;  // with its half of a vertex, and the memory for dividing triangles
  constexpr double kBytesATile = 400.0;     // of 4^3 nodes
  const auto triangles = static_cast<double>(mesh.triangle_count());
  const double bytes = kBytesATile * static_cast<double>(counts.tiles) + kBytesATriangle * triangles;
  // Blocks reach half their length beyond the nodes, on average.
  const double along = march::kBlockNodes * (std::cbrt(static_cast<double>(counts.blocks)) - 0.5), nodes = along * along * along;
  return {.error = error,
          .telling = triangles >= kTelling,
          .levels_left = std::min(levels_left(bytes, kMostBytes, 2.0),
                                  levels_left(nodes, static_cast<double>(kMarchNodes), 2.0 * std::numbers::sqrt2))};
}

double first_cell(const FieldView& field, double cell) {
  const double whole = 0.5 * field.feature_size();
  return cell > 0.0 ? std::min(cell, whole) : whole;
}

void make_within(const ErrorGoal& goal, const std::function<LevelTry(int level)>& make) {
  SUPPLE_EXPECTS(goal.error > 0.0 && goal.first > 0.0);
  constexpr int kEvenLevels = 4, kLevels = 2;
  constexpr double kPromise = 0.9;  // of the error: predicted error of a level that is tried
  Order order;
  LevelTry now;
  for (int level = 0, last = 0;;) {
    try {
      now = make(level);
    } catch (const Error& failure) {
      if (failure.kind() != ErrorKind::Limit) throw;
      if (level == 0 && goal.stated) throw;
      if (level == 0) refuse_first(goal, failure);
      refuse(goal, now.error, last, now.error);
    }
    if (now.error <= goal.error) return;
    order.add(level, now.error);
    const int wanted = order.levels_to(kPromise * goal.error), even_levels = order.even() ? kEvenLevels : kLevels;
    // What follows is the same for any more.
    const int enough = std::max({order.least_levels_to(goal.error), std::min(wanted, even_levels), 1});
    if (now.levels_left < enough && now.count_levels_left) now.levels_left = now.count_levels_left();
    const bool far = order.least_levels_to(goal.error) > now.levels_left, hopeless = far && now.telling;
    if (now.levels_left == 0 || (hopeless && order.known())) refuse(goal, now.error, level, order.most_after(std::max(now.levels_left - 1, 0)));
    last = level;
    const int most = hopeless ? 1 : order.even() && !far ? kEvenLevels : kLevels;
    level += std::min({wanted, most, now.levels_left});
  }
}

}  // namespace supple::implicit
