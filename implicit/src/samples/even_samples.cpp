#include "supple/implicit/even_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/implicit/mesh_limits.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

constexpr double kRemove = 0.5;           ///< samples nearer than this [spacings] are one too many
constexpr double kAdd = 0.7;              ///< a point farther than this from all samples of its side gets one
constexpr double kCell = 1.0 / 6.0;       ///< of the lattice whose vertices are such places, at most: 0.7 + sqrt(3) / 6 < 1
constexpr double kCellOfFeature = 0.5;    ///< no ball of the surface passes through a cell of half the feature size
constexpr double kFarthestMove = 0.5;     ///< a sample whose surface went farther away is lost
constexpr double kSpacingByDensity = 1.28;  ///< d sqrt(n) of n samples per square metre on a plane, measured
constexpr std::size_t kSamplesPerTask = 64;

constexpr std::size_t kTrianglesPerTask = 512;
constexpr std::uint32_t kNone = 0xffffffff;

/// Samples by cubes of the spacing.
class Near {
 public:
  Near(double reach, const EvenSampleSet& set) : reach_(reach), set_(set) {}
  /// Whether a sample is nearer than that.
  [[nodiscard]] bool any(const Vec3& p, const Vec3& n, double radius) const {
    const std::uint32_t s = nearest(p, n);
    return s != kNone && (set_.point[s] - p).squaredNorm() < radius * radius;
  }
  /// Nearest sample whose normal is within a right angle of n, if any lies in the cubes around; of equals the lower one.
  [[nodiscard]] std::uint32_t nearest(const Vec3& p, const Vec3& n) const {
    std::uint32_t best = kNone;
    double least = 0.0;
    around(p, [&](std::uint32_t s) {
      if (set_.normal[s].dot(n) <= 0.0) return;
      const double d = (set_.point[s] - p).squaredNorm();
      if (best != kNone && (d > least || (d == least && s > best))) return;
      best = s;
      least = d;
    });
    return best;
  }
  void add(std::uint32_t s) { cube_[key(set_.point[s])].push_back(s); }

 private:
  using Key = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& k) const {
      return static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span<const std::int64_t>(k))));
    }
  };
  template <class Look>
  void around(const Vec3& p, const Look& look) const {
    const Key at = key(p);
    for (std::int64_t n = 0; n < 27; ++n) {
      const auto found = cube_.find({at[0] + n % 3 - 1, at[1] + n / 3 % 3 - 1, at[2] + n / 9 - 1});
      if (found == cube_.end()) continue;
      for (const std::uint32_t s : found->second) look(s);
    }
  }
  [[nodiscard]] Key key(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p.x() / reach_)), static_cast<std::int64_t>(std::floor(p.y() / reach_)),
            static_cast<std::int64_t>(std::floor(p.z() / reach_))};
  }
  double reach_;
  const EvenSampleSet& set_;
  std::unordered_map<Key, std::vector<std::uint32_t>, Hash> cube_;
};

/// Gives the area of every triangle to the sample nearest to its middle on its side of the surface.
void share_area(const Mesh& mesh, const Near& near, const Executor& executor, std::vector<double>& area) {
  const std::size_t count = mesh.triangle_count();
  std::vector<std::uint32_t> owner(count);
  std::vector<double> size(count);
  executor.for_blocks(count, kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto [a, b, c] = mesh.triangle[t];
      const Vec3 normal = (mesh.position[b] - mesh.position[a]).cross(mesh.position[c] - mesh.position[a]);
      size[t] = 0.5 * normal.norm();
      owner[t] = near.nearest((mesh.position[a] + mesh.position[b] + mesh.position[c]) / 3.0, normal);
    }
  });
  for (std::size_t t = 0; t < count; ++t) {
    if (owner[t] != kNone) area[owner[t]] += size[t];
  }
}

}  // namespace

EvenSampler::EvenSampler(double spacing) : spacing_(spacing) { SUPPLE_EXPECTS(spacing > 0.0 && std::isfinite(spacing)); }

double even_spacing(double density) {
  SUPPLE_EXPECTS(density > 0.0);
  return kSpacingByDensity / std::sqrt(density);
}

void EvenSampler::expect_size(const Field& field, const Executor& executor) const {
  expect_marchable(field, {.cell = cell(field)}, executor);
}

double EvenSampler::cell(const Field& field) const {
  return is_cell_of_feature(field) ? kCellOfFeature * field.feature_size() : kCell * spacing_;
}

bool EvenSampler::is_cell_of_feature(const Field& field) const { return kCellOfFeature * field.feature_size() < kCell * spacing_; }

EvenSampleCounts EvenSampler::update(const Field& field, std::span<const Pose> parts, const Executor& executor,
                                     EvenSampleSet& set) {
  EvenSampleCounts count;
  const Mesh& mesh = mesher_.make(field, {.lattice = {.cell = cell(field)}}, executor);
  const MeshReport report = inspect(mesh);
  count.remade = set.size() > 0 && (report.components != set.components || report.euler_characteristic != set.euler_characteristic);

  const EvenSampleSet old = std::move(set);
  set = {};
  set.components = report.components;
  set.euler_characteristic = report.euler_characteristic;
  const std::size_t carried = count.remade ? 0 : old.size();
  std::vector<Projection> projected(carried);
  executor.for_blocks(carried, kSamplesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const Pose& pose = parts[old.part[s]];
      const Vec3 start = pose.position + pose.orientation * old.local[s];
      projected[s] = project_to_surface(field, start);
      if ((projected[s].point - start).norm() > kFarthestMove * spacing_) projected[s].converged = false;
    }
  });
  Near near(spacing_, set);
  const auto take = [&](std::uint64_t id, const Vec3& point, const Vec3& normal) {
    set.id.push_back(id);
    set.point.push_back(point);
    set.normal.push_back(normal);
    near.add(static_cast<std::uint32_t>(set.size() - 1));
  };
  for (std::size_t s = 0; s < carried; ++s) {  // the older of two that are too near stays
    if (projected[s].converged && !near.any(projected[s].point, projected[s].normal, kRemove * spacing_)) {
      take(old.id[s], projected[s].point, projected[s].normal);
    }
  }
  count.kept = set.size();
  count.removed = old.size() - set.size();
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    if (!near.any(mesh.position[v], mesh.normal[v], kAdd * spacing_)) take(next_id_++, mesh.position[v], mesh.normal[v]);
  }
  count.added = set.size() - count.kept;
  set.area.assign(set.size(), 0.0);
  share_area(mesh, near, executor, set.area);

  FieldParts shares;
  field.evaluate_parts(set.point, shares);
  set.part.resize(set.size());
  set.local.resize(set.size());
  for (std::size_t s = 0; s < set.size(); ++s) {
    double largest = 0.0;
    for (std::uint32_t r = shares.offset[s]; r < shares.offset[s + 1]; ++r) {
      if (!(shares.value[r] > largest)) continue;
      largest = shares.value[r];
      set.part[s] = shares.part[r];
    }
    const Pose& pose = parts[set.part[s]];
    set.local[s] = pose.orientation.conjugate() * (set.point[s] - pose.position);
  }
  return count;
}

}  // namespace supple::implicit
