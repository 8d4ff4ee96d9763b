#include "supple/implicit/march_cubes.h"

#include <algorithm>
#include <bit>

#include "field/bytes_of.h"
#include "field/field_index.h"
#include "mesh/cubes/march_refined.h"
#include "mesh/cubes/march_tried.h"
#include "mesh/error_search.h"
#include "mesh/local_division.h"
#include "mesh/partition/polygonise_blocks.h"
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
  LocalDivision division;
  Mesh alone;  ///< where no data are kept of it

  // For make_to_error. Triangles are divided, up to twice, before cells get smaller.
  static march::LevelPlan plan_of(double first, int level) {
    constexpr int kRefinements = 2;
    const int refinements = std::min(level / 2, kRefinements);
    return {spacing_at(first, level - 2 * refinements), refinements};
  }
  const Mesh& mesh_on(march::RefinedMarcher& on, bool first_time, const march::LevelPlan& plan, const FieldView& field, const MarchOptions& options,
                      const Executor& executor) {
    if (first_time) on.march(field, {.origin = options.lattice.origin, .cell = plan.cell}, options.skip, executor);
    return on.mesh(plan.refinements, options.may_cross, executor, scratch);
  }
  static double error_on(march::RefinedMarcher& on, const march::LevelPlan& plan, const Executor& executor) { return on.error(plan.refinements, executor); }
  const Mesh* divide(const march::RefinedMarcher& /*on*/, const FieldView& field, const Mesh& mesh, double error, std::size_t most, const Executor& executor) {
    return division.divide(field, mesh, error, most, executor);
  }
  static Mesh take_mesh(march::RefinedMarcher& on, const march::LevelPlan& plan) { return on.take_mesh(plan.refinements); }
  [[nodiscard]] std::uint64_t bytes_beside() const { return scratch.bytes(); }
  void forget_beside() { scratch = {}; }
};

CubeMesher::CubeMesher(std::uint64_t most_kept) : impl_(std::make_unique<Impl>(most_kept)) {}
CubeMesher::~CubeMesher() = default;
CubeMesher::CubeMesher(CubeMesher&&) noexcept = default;
CubeMesher& CubeMesher::operator=(CubeMesher&&) noexcept = default;

const Mesh& CubeMesher::make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                             MarchCounts* counts) {
  SUPPLE_EXPECTS(options.refinements >= 0 && options.refinements <= kMostRefinements && options.error >= 0.0);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  impl_->alone = {};
  if (options.error > 0.0) {
    impl_->fixed = {};
    return *march::make_to_error(*impl_, field, options, executor, count);
  }
  impl_->tried.clear();
  impl_->fixed.march(field, options.lattice, options.skip, executor);
  const Mesh& mesh = impl_->fixed.mesh(options.refinements, options.may_cross, executor, impl_->scratch);
  count = impl_->fixed.counts();
  count.refinements = options.refinements;
  count.bytes = impl_->fixed.bytes() + impl_->scratch.bytes() - bytes_of(mesh);
  return mesh;
}

void CubeMesher::expect_error(const FieldView& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles) {
  SUPPLE_EXPECTS(options.error > 0.0);
  MarchCounts count;
  (void)march::make_to_error(*impl_, field, options, executor, count, most_triangles);
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
