#include "supple/implicit/even_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

constexpr double kRemove = 0.5;           ///< samples nearer than this [spacings] are one too many
constexpr double kAdd = 0.7;              ///< a place farther than this from all samples gets one
constexpr double kCell = 1.0 / 6.0;       ///< of the lattice whose vertices are such places: 0.7 + sqrt(3) / 6 < 1
constexpr double kFarthestMove = 0.5;     ///< a sample whose surface went farther away is lost
constexpr std::size_t kSamplesPerTask = 64;

/// Points by cubes of the spacing.
class Near {
 public:
  explicit Near(double reach) : reach_(reach) {}
  [[nodiscard]] bool any(const Vec3& p, double radius) const {
    const Key at = key(p);
    for (std::int64_t n = 0; n < 27; ++n) {
      const auto found = cube_.find({at[0] + n % 3 - 1, at[1] + n / 3 % 3 - 1, at[2] + n / 9 - 1});
      if (found == cube_.end()) continue;
      for (const Vec3& q : found->second) {
        if ((q - p).squaredNorm() < radius * radius) return true;
      }
    }
    return false;
  }
  void add(const Vec3& p) { cube_[key(p)].push_back(p); }

 private:
  using Key = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& k) const {
      return static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span<const std::int64_t>(k))));
    }
  };
  [[nodiscard]] Key key(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p.x() / reach_)), static_cast<std::int64_t>(std::floor(p.y() / reach_)),
            static_cast<std::int64_t>(std::floor(p.z() / reach_))};
  }
  double reach_;
  std::unordered_map<Key, std::vector<Vec3>, Hash> cube_;
};

}  // namespace

EvenSampler::EvenSampler(double spacing) : spacing_(spacing) { SUPPLE_EXPECTS(spacing > 0.0 && std::isfinite(spacing)); }

const EvenSampleSet& EvenSampler::update(const Field& field, std::span<const Pose> parts, const Executor& executor,
                                         EvenSampleCounts* counts) {
  EvenSampleCounts count;
  const Mesh& mesh = mesher_.make(field, {.lattice = {.cell = kCell * spacing_}}, executor);
  const MeshReport report = inspect(mesh);
  count.remade = set_.size() > 0 && (report.components != components_ || report.euler_characteristic != euler_);
  components_ = report.components;
  euler_ = report.euler_characteristic;

  const EvenSampleSet old = std::move(set_);
  set_ = {};
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
  Near near(spacing_);
  const auto take = [&](std::uint64_t id, const Vec3& point, const Vec3& normal) {
    near.add(point);
    set_.id.push_back(id);
    set_.point.push_back(point);
    set_.normal.push_back(normal);
  };
  for (std::size_t s = 0; s < carried; ++s) {  // the older of two that are too near stays
    if (projected[s].converged && !near.any(projected[s].point, kRemove * spacing_)) {
      take(old.id[s], projected[s].point, projected[s].normal);
    }
  }
  count.kept = set_.size();
  count.removed = old.size() - set_.size();
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    if (!near.any(mesh.position[v], kAdd * spacing_)) take(next_id_++, mesh.position[v], mesh.normal[v]);
  }
  count.added = set_.size() - count.kept;

  FieldParts shares;
  field.evaluate_parts(set_.point, shares);
  set_.part.resize(set_.size());
  set_.local.resize(set_.size());
  for (std::size_t s = 0; s < set_.size(); ++s) {
    double largest = 0.0;
    for (std::uint32_t r = shares.offset[s]; r < shares.offset[s + 1]; ++r) {
      if (!(shares.value[r] > largest)) continue;
      largest = shares.value[r];
      set_.part[s] = shares.part[r];
    }
    const Pose& pose = parts[set_.part[s]];
    set_.local[s] = pose.orientation.conjugate() * (set_.point[s] - pose.position);
  }
  if (counts != nullptr) *counts = count;
  return set_;
}

}  // namespace supple::implicit
