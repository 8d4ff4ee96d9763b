#include "supple/implicit/creases.h"

#include <algorithm>
#include <utility>

#include "field/bytes_of.h"
#include "field/field_index.h"
#include "mesh/creases/crease_nodes.h"
#include "mesh/creases/crease_points.h"
#include "mesh/creases/crease_sharpening.h"
#include "mesh/cubes/march_tried.h"
#include "mesh/error_search.h"
#include "mesh/local_division.h"
#include "mesh/triangle_errors.h"
#include "supple/core/error.h"

namespace supple::implicit {

bool has_creases(const Field& field) {
  const Field::Index& index = field.packed();
  if (index.blend.rule() != BlendRule::Graph) return false;
  const std::vector<Box> box = node_supports(index);
  std::vector<std::uint32_t> order;
  for (std::uint32_t k = 0; k < box.size(); ++k) {
    if (!box[k].empty()) order.push_back(k);
  }
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return box[a].lower.x() != box[b].lower.x() ? box[a].lower.x() < box[b].lower.x() : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = i + 1; j < order.size() && box[order[j]].lower.x() <= box[order[i]].upper.x(); ++j) {
      if (box[order[i]].overlaps(box[order[j]]) && index.blend.weight(order[i], order[j]) < 1.0) return true;
    }
  }
  return false;
}

namespace {

/// The mesh with creases on one lattice, and its kept data.
class CreaseMarcher {
 public:
  /// @param field  to be kept until the next call
  const Mesh& make(const Field& field, const Lattice& lattice, bool skip, const Executor& executor);
  /// centroid_error of the mesh that was made since the last call.
  [[nodiscard]] double error(const Executor& executor);
  /// Marches from scratch: counts are then those of a new mesher. The mesh stays.
  void march_anew(const Executor& executor);

  [[nodiscard]] const MarchCounts& counts() const { return counts_; }
  [[nodiscard]] std::size_t on_creases() const { return sharpened_.on_creases; }
  [[nodiscard]] bool whole() const { return marcher_.whole(); }
  [[nodiscard]] MarchCounts most_counts() const { return marcher_.most_counts(counts_); }
  /// Of all that is kept, the mesh too.
  [[nodiscard]] std::uint64_t bytes() const { return counts_.bytes + bytes_of(mesh_) + bytes_of(last_mesh_) + errors_.bytes(); }
  [[nodiscard]] Mesh take_mesh() { return std::move(mesh_); }

 private:
  void count_kept();
  /// Whether nothing changed since the last mesh was made.
  [[nodiscard]] bool stayed(bool others) const {
    const march::ViewMemory& changes = marcher_.memory.view;
    return !others && !changes.all && changes.changes.reaches().empty();
  }
  /// Of the vertices that did not stay where they were and as they were.
  void find_owners(const Field& field, std::span<const std::uint32_t> nodes, bool all, const Executor& executor);

  march::Marcher marcher_;
  const Field* field_ = nullptr;
  Lattice lattice_;
  bool skip_ = true;
  MarchCounts counts_;
  bool made_ = false;                 ///< a mesh, of which the following is
  std::vector<std::uint32_t> node_;   ///< that its fields are of
  std::vector<std::uint32_t> owner_;  ///< of the vertices of the marched mesh, by place in `node_`
  CreaseMemory memory_;
  CrossingMemory crossings_;
  Mesh mesh_, last_mesh_;
  TriangleErrors errors_;             ///< of last_mesh_, or mesh_ once they are requested
  Sharpened sharpened_;               ///< of mesh_
  double error_ = 0.0;                ///< the largest of them [m]
  double feature_ = 0.0;              ///< of the field when they were [m]
  bool measured_ = false;             ///< errors_ are those of mesh_
  bool comparable_ = false;           ///< errors_ are those of last_mesh_
};

void CreaseMarcher::march_anew(const Executor& executor) {
  marcher_.kept = false;
  marcher_.march(*field_, lattice_, skip_, executor, counts_);
  count_kept();
}

void CreaseMarcher::count_kept() {
  counts_.blunt_cells = sharpened_.blunt_cells;
  counts_.bytes += memory_.bytes() + crossings_.bytes() + bytes_of(owner_) + bytes_of(marcher_.mesh);
}

const Mesh& CreaseMarcher::make(const Field& field, const Lattice& lattice, bool skip, const Executor& executor) {
  field_ = &field;
  lattice_ = lattice;
  skip_ = skip;
  const Field::Index& index = field.index();
  const std::vector<Box> box = node_supports(index);
  std::vector<NodeField> nodes;
  std::vector<std::uint32_t> present;
  for (std::uint32_t k = 0; k < box.size(); ++k) {
    if (box[k].empty()) continue;
    nodes.emplace_back(field, k, box[k]);
    present.push_back(k);
  }
  const std::vector<FieldView> views(nodes.begin(), nodes.end());
  const bool others = !std::exchange(made_, false) || present != node_;  // made_: should the next lines throw
  marcher_.march(field, lattice, skip, executor, counts_);
  if (stayed(others)) {
    made_ = true;
    comparable_ = false;  // differences are counted from this call on
    count_kept();
    return mesh_;
  }
  comparable_ = std::exchange(measured_, false);
  const march::ViewMemory& changes = marcher_.memory.view;
  find_owners(field, present, others || changes.all, executor);
  memory_.begin_call(others || changes.all);
  if (comparable_) std::swap(mesh_, last_mesh_);
  mesh_ = marcher_.mesh;
  sharpened_ = sharpen({field, views, lattice, owner_, skip}, changes, memory_, crossings_, mesh_);
  memory_.end_call();
  node_ = std::move(present);
  made_ = true;
  count_kept();
  return mesh_;
}

double CreaseMarcher::error(const Executor& executor) {
  const double feature = field_->feature_size();
  const bool other = std::exchange(feature_, feature) != feature;
  if (measured_ && !other) return error_;
  const auto differs = [this](const Box& evaluated) { return marcher_.memory.view.differs_at(evaluated); };
  error_ = errors_.measure(*field_, mesh_, last_mesh_, !comparable_ || other, differs, executor);
  measured_ = true;
  return error_;
}

void CreaseMarcher::find_owners(const Field& field, std::span<const std::uint32_t> nodes, bool all, const Executor& executor) {
  const std::vector<Vec3>& position = marcher_.mesh.position;
  std::vector<std::uint32_t> found(position.size()), fresh;
  std::size_t known = 0;  // vertices so far
  const auto add_fresh = [&](std::size_t end) {
    for (; known < end; ++known) fresh.push_back(static_cast<std::uint32_t>(known));
  };
  if (!all) {
    for (const march::Run& run : marcher_.scratch.stayed) {
      add_fresh(run.to);
      std::copy_n(owner_.begin() + static_cast<std::ptrdiff_t>(run.from), run.count, found.begin() + static_cast<std::ptrdiff_t>(run.to));
      known = run.to + run.count;
    }
  }
  add_fresh(position.size());
  std::vector<Vec3> points;
  for (const std::uint32_t v : fresh) points.push_back(position[v]);
  const std::vector<std::uint32_t> of_points = largest_nodes(field, nodes, points, executor);
  for (std::size_t i = 0; i < fresh.size(); ++i) found[fresh[i]] = of_points[i];
  owner_ = std::move(found);
}

}  // namespace

struct CreaseMesher::Impl {
  explicit Impl(std::uint64_t most_kept) : tried(most_kept) {}

  CreaseMarcher fixed;  ///< of the last mesh without an error
  march::TriedLattices<CreaseMarcher> tried;
  LocalDivision division;
  Mesh alone;           ///< where no data are kept of it

  // For make_to_error.
  static march::LevelPlan plan_of(double first, int level) { return {.cell = spacing_at(first, level)}; }
  static const Mesh& mesh_on(CreaseMarcher& on, bool /*first_time*/, const march::LevelPlan& plan, const Field& field, const MarchOptions& options,
                             const Executor& executor) {
    return on.make(field, {.origin = options.lattice.origin, .cell = plan.cell}, options.skip, executor);
  }
  static double error_on(CreaseMarcher& on, const march::LevelPlan& /*plan*/, const Executor& executor) { return on.error(executor); }
  const Mesh* divide(const CreaseMarcher& on, const FieldView& field, const Mesh& mesh, double error, std::size_t most, const Executor& executor) {
    return division.divide(field, mesh, error, most, executor, on.on_creases());
  }
  static Mesh take_mesh(CreaseMarcher& on, const march::LevelPlan& /*plan*/) { return on.take_mesh(); }
  static std::uint64_t bytes_beside() { return 0; }
  static void forget_beside() {}
};

CreaseMesher::CreaseMesher(std::uint64_t most_kept) : most_kept_(most_kept) {}
CreaseMesher::~CreaseMesher() = default;
CreaseMesher::CreaseMesher(CreaseMesher&&) noexcept = default;
CreaseMesher& CreaseMesher::operator=(CreaseMesher&&) noexcept = default;

const Mesh& CreaseMesher::make(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  SUPPLE_EXPECTS(field.packed().blend.rule() == BlendRule::Graph && options.refinements == 0 && options.error >= 0.0);
  if (impl_ == nullptr) impl_ = std::make_unique<Impl>(most_kept_);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  impl_->alone = {};
  if (options.error > 0.0) {
    impl_->fixed = {};
    return *march::make_to_error(*impl_, field, options, executor, count);
  }
  impl_->tried.clear();
  const Mesh& mesh = impl_->fixed.make(field, options.lattice, options.skip, executor);
  count = impl_->fixed.counts();
  return mesh;
}

void CreaseMesher::expect_error(const Field& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles) {
  SUPPLE_EXPECTS(field.packed().blend.rule() == BlendRule::Graph && options.error > 0.0);
  if (impl_ == nullptr) impl_ = std::make_unique<Impl>(most_kept_);
  MarchCounts count;
  (void)march::make_to_error(*impl_, field, options, executor, count, most_triangles);
}

void CreaseMesher::keep_at_most(std::uint64_t most_kept) {
  most_kept_ = most_kept;
  if (impl_ != nullptr) impl_->tried.keep_at_most(most_kept);
}

std::uint64_t CreaseMesher::kept_to_error() const { return impl_ != nullptr ? impl_->tried.bytes() : 0; }

Mesh march_creases(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  CreaseMesher mesher;
  return mesher.make(field, options, executor, counts);
}

}  // namespace supple::implicit
