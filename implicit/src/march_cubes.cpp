#include "supple/implicit/march_cubes.h"

#include <algorithm>
#include <bit>

#include "bytes_of.h"
#include "error_search.h"
#include "field_index.h"
#include "march_refined.h"
#include "march_tried.h"
#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::implicit {
namespace march {

void Marcher::march(const FieldView& field, const Lattice& on, bool skip, const Executor& executor, MarchCounts& counts) {
  const Field* points = field.as_field();
  const double level = points != nullptr ? points->packed().iso : 0.0;
  const bool single = sampler != nullptr && sampler->single_precision();
  sampler = make_sampler(field, on, skip, memory);
  if (!kept || level != iso || sampler->single_precision() != single || skip != skipped) memory.forget();
  kept = false;
  skipped = skip;
  iso = level;
  sampler->prepare(executor, table);
  table.begin_call();
  sampler->sample(executor, table);
  assemble(table, *sampler, on, executor, scratch, mesh);
  kept = true;
  lattice = on;
  counts = {};
  counts.blocks = table.block.size();
  counts.single_precision = sampler->single_precision();
  counts.cell = on.cell;
  for (std::size_t b = 0; b < table.block.size(); ++b) {
    if (table.touched[b] == 0) continue;
    counts.tiles_sampled += static_cast<std::uint64_t>(std::popcount(table.block[b].changed));
    counts.kernel_values += table.block[b].kernel_values;
  }
  counts.tiles = table.held.tiles;
  counts.nodes = blobs::kTileNodes * counts.tiles;
  counts.bytes = table.held.bytes + scratch.bytes() + memory.bytes();
}

MarchCounts Marcher::most_counts(const MarchCounts& counts) const {
  constexpr std::uint64_t kTiles = 64;  // of a block
  MarchCounts most = counts;
  most.blocks = sampler->most_blocks(table);
  most.tiles = kTiles * most.blocks;
  return most;
}

}  // namespace march

struct CubeMesher::Impl {
  explicit Impl(std::uint64_t most_kept) : tried(most_kept) {}

  march::RefinedMarcher fixed;  ///< of the last mesh without an error
  march::TriedLattices<march::RefinedMarcher> tried;
  march::CutScratch scratch;
  Mesh alone;  ///< where nothing is kept of it
  /// @param most  triangles of a mesh that is made; where the search asks for more, it ends. @return null then
  const Mesh* make_to_error(const FieldView& field, const MarchOptions& options, const Executor& executor, MarchCounts& count,
                            std::uint64_t most = ~std::uint64_t{0});
};

CubeMesher::CubeMesher(std::uint64_t most_kept) : impl_(std::make_unique<Impl>(most_kept)) {}
CubeMesher::~CubeMesher() = default;
CubeMesher::CubeMesher(CubeMesher&&) noexcept = default;
CubeMesher& CubeMesher::operator=(CubeMesher&&) noexcept = default;

namespace {

/// How a mesh of a level is made: triangles are cut, up to twice, before cells get smaller.
struct LevelPlan {
  double cell = 0.0;  ///< [m]
  int refinements = 0;
};
LevelPlan plan_of(double first_cell, int level) {
  constexpr int kRefinements = 2;
  const int refinements = std::min(level / 2, kRefinements);
  return {spacing_at(first_cell, level - 2 * refinements), refinements};
}

}  // namespace

const Mesh* CubeMesher::Impl::make_to_error(const FieldView& field, const MarchOptions& options, const Executor& executor, MarchCounts& count,
                                            std::uint64_t most) {
  const double first = first_cell(field, options.lattice.cell);
  const Mesh* mesh = nullptr;
  march::RefinedMarcher* last = nullptr;
  LevelPlan plan;
  std::uint64_t sampled = 0, values = 0;  // of all meshes
  march::TriedSize size(field, options.lattice.origin, most);
  tried.begin_call();
  tried.search({.error = options.error, .first = first, .stated = first == options.lattice.cell}, [&](int level) {
    plan = plan_of(first, level);
    if (size.exceeds(level, plan.cell, executor)) return LevelTry{};  // ends the search
    const auto [on, first_time] = tried.use(plan.cell);
    last = &on;
    if (first_time) {
      on.march(field, {.origin = options.lattice.origin, .cell = plan.cell}, options.skip, executor);
      sampled += on.counts().tiles_sampled;
      values += on.counts().kernel_values;
    }
    mesh = &on.mesh(plan.refinements, executor, scratch);
    const double error = on.error(plan.refinements, executor);
    count = on.counts();
    count.refinements = plan.refinements;
    count.error = error;
    size.add(level, *mesh);
    tried.fit(plan.cell, scratch.bytes());
    return march::try_kept(error, *mesh, on, executor);
  });
  if (size.is_exceeded()) {
    tried.clear();
    return nullptr;
  }
  count.tiles_sampled = sampled;
  count.kernel_values = values;
  const bool fits = tried.end_call(plan.cell, scratch.bytes());
  count.bytes = fits ? tried.bytes() + scratch.bytes() - bytes_of(*mesh) : 0;
  if (fits) return mesh;
  alone = last->take_mesh(plan.refinements);
  tried.clear();
  scratch = {};
  return &alone;
}

const Mesh& CubeMesher::make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                             MarchCounts* counts) {
  SUPPLE_EXPECTS(options.refinements >= 0 && options.refinements <= kMostRefinements && options.error >= 0.0);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  impl_->alone = {};
  if (options.error > 0.0) {
    impl_->fixed = {};
    return *impl_->make_to_error(field, options, executor, count);
  }
  impl_->tried.clear();
  impl_->fixed.march(field, options.lattice, options.skip, executor);
  const Mesh& mesh = impl_->fixed.mesh(options.refinements, executor, impl_->scratch);
  count = impl_->fixed.counts();
  count.refinements = options.refinements;
  count.bytes = impl_->fixed.bytes() + impl_->scratch.bytes() - bytes_of(mesh);
  return mesh;
}

void CubeMesher::expect_error(const FieldView& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles) {
  SUPPLE_EXPECTS(options.error > 0.0);
  MarchCounts count;
  (void)impl_->make_to_error(field, options, executor, count, most_triangles);
}

void CubeMesher::keep_at_most(std::uint64_t most_kept) { impl_->tried.keep_at_most(most_kept); }

std::uint64_t CubeMesher::kept_to_error() const {
  const std::uint64_t tried = impl_->tried.bytes();
  return tried > 0 ? tried + impl_->scratch.bytes() : 0;
}

void CubeMesher::forget() {
  impl_->fixed.forget();
  impl_->tried.clear();
}

Mesh march_cubes(const FieldView& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  CubeMesher mesher;
  return mesher.make(field, options, executor, counts);
}

void expect_marchable(const FieldView& field, const Lattice& lattice, const Executor& executor) {
  march::SamplerMemory memory;
  march::make_sampler(field, lattice, true, memory)->expect_size(executor);
}

}  // namespace supple::implicit
