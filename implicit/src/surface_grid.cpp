#include "supple/implicit/surface_grid.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"

namespace supple::implicit {
namespace {

using namespace lattice;
using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

constexpr std::size_t kLeafVoxels = Leaf::SIZE;
constexpr std::size_t kLeavesPerTask = 16;
static_assert(Leaf::DIM == kCells, "a leaf holds the nodes that a block owns");

constexpr const char* kHashKey = "content_hash";

Coord first_voxel(const BlockCoord& block) { return {kCells * block[0], kCells * block[1], kCells * block[2]}; }

bool earlier(const Coord& a, const Coord& b) {
  return before({a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()});
}

/// Hash over the active voxels: leaves in z, y, x order, in each its voxels in z, y, x order.
std::uint64_t hash_of(const FloatGrid& grid) {
  std::vector<const Leaf*> leaves;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) leaves.push_back(leaf.getLeaf());
  std::sort(leaves.begin(), leaves.end(), [](const Leaf* a, const Leaf* b) { return earlier(a->origin(), b->origin()); });
  Hasher hasher;
  for (const Leaf* leaf : leaves) {
    for (int k = 0; k < kCells; ++k) {
      for (int j = 0; j < kCells; ++j) {
        for (int i = 0; i < kCells; ++i) {
          const Coord at = leaf->origin() + Coord(i, j, k);
          const auto offset = Leaf::coordToOffset(at);
          if (!leaf->isValueOn(offset)) continue;
          for (int axis = 0; axis < 3; ++axis) hasher.add(static_cast<std::uint64_t>(std::int64_t{at[axis]}));
          hasher.add(double{leaf->getValue(offset)});
        }
      }
    }
  }
  return hasher.value();
}

/// One leaf while the grid is built.
struct SampledLeaf {
  std::unique_ptr<Leaf> leaf;   ///< none when no voxel is in the band
  bool inside = false;          ///< of a leaf without band: all voxels inside
  float largest = 0.0F;         ///< largest |value| of an active voxel
};

SampledLeaf sample_leaf(const FieldView& field, const GridOptions& options, const BlockCoord& block) {
  std::array<Vec3, kLeafVoxels> points;
  std::array<double, kLeafVoxels> values{};
  std::array<Vec3, kLeafVoxels> gradients;
  const Coord origin = first_voxel(block);
  for (openvdb::Index n = 0; n < kLeafVoxels; ++n) {
    const Coord at = origin + Leaf::offsetToLocalCoord(n);
    points[n] = node_position(options.lattice, at.x(), at.y(), at.z());
  }
  field.evaluate(points, values, gradients);
  SampledLeaf result;
  result.leaf = std::make_unique<Leaf>(origin);
  const double width = options.half_width * options.lattice.cell;
  for (openvdb::Index n = 0; n < kLeafVoxels; ++n) {
    const double f = values[n], slope = gradients[n].norm();
    if (!(std::abs(f) <= width * slope)) {
      result.leaf->setValueOff(n, f > 0.0 ? 1.0F : -1.0F);  // its side, until the background is known
      continue;
    }
    const double distance = slope > 0.0 ? -f / slope : 0.0;
    const auto value = static_cast<float>(options.content == GridContent::Field ? f : distance);
    result.leaf->setValueOn(n, value);
    result.largest = std::max(result.largest, std::abs(value));
  }
  if (result.leaf->onVoxelCount() == 0) {
    result.inside = values[0] > 0.0;
    const bool uniform =
        std::all_of(values.begin(), values.end(), [&](double f) { return (f > 0.0) == result.inside; });
    if (uniform) result.leaf.reset();
  }
  return result;
}

/// An OpenVDB archive in memory with the offsets that a seekable file has.
class MemoryArchive : public openvdb::io::Archive {
 public:
  [[nodiscard]] std::string bytes(const openvdb::GridCPtrVec& grids) const {
    std::ostringstream stream(std::ios_base::binary);
    write(stream, grids, true);
    return std::move(stream).str();
  }
};

[[noreturn]] void fail(ErrorKind kind, const std::filesystem::path& path, const std::string& expected,
                       const std::string& found, const std::string& hint) {
  throw Error(kind, {.place = path.string(), .key = "", .expected = expected, .found = found, .hint = hint});
}

}  // namespace

struct SurfaceGrid::Impl {
  FloatGrid::Ptr grid;
  std::uint64_t active = 0;
  std::uint64_t memory = 0;

  explicit Impl(FloatGrid::Ptr made) : grid(std::move(made)) {
    for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) active += leaf->onVoxelCount();
    memory = grid->memUsage();
  }
};

SurfaceGrid::SurfaceGrid() = default;
SurfaceGrid::~SurfaceGrid() = default;
SurfaceGrid::SurfaceGrid(SurfaceGrid&&) noexcept = default;
SurfaceGrid& SurfaceGrid::operator=(SurfaceGrid&&) noexcept = default;

std::uint64_t SurfaceGrid::active_voxels() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return impl_->active;
}

std::uint64_t SurfaceGrid::memory_bytes() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return impl_->memory;
}

std::uint64_t SurfaceGrid::hash() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return hash_of(*impl_->grid);
}

double SurfaceGrid::value(std::int32_t i, std::int32_t j, std::int32_t k) const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return double{impl_->grid->tree().getValue(Coord(i, j, k))};
}

double SurfaceGrid::interpolate(const Vec3& world) const {
  SUPPLE_EXPECTS(impl_ != nullptr && world.allFinite());
  const openvdb::Vec3d at = impl_->grid->worldToIndex({world.x(), world.y(), world.z()});
  const Coord low = Coord::floor(at);
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    Coord node = low;
    for (int axis = 0; axis < 3; ++axis) {
      const double t = at[axis] - low[axis];
      const int step = corner >> axis & 1;
      weight *= step == 1 ? t : 1.0 - t;
      node[axis] += step;
    }
    if (weight != 0.0) sum += weight * double{impl_->grid->tree().getValue(node)};
  }
  return sum;
}

SurfaceGrid make_surface_grid(const FieldView& field, const GridOptions& options, const Executor& executor) {
  SUPPLE_EXPECTS(options.half_width >= 1.0 && std::isfinite(options.half_width));
  openvdb::initialize();
  const Lattice& lattice = options.lattice;
  const double width = options.half_width * lattice.cell;
  const RefineOptions refine{.limit = std::max<std::uint64_t>(1, options.max_voxels / kLeafVoxels),
                             .look_factor = 8,  // up to eight for each that is kept
                             .last_node = kCells - 1,
                             .keep_inside = true,
                             .counted = "voxels",
                             .per_block = kLeafVoxels};
  const BlockRange range =
      block_range(field.surface_box(), lattice, static_cast<int>(std::min(std::ceil(options.half_width), 1e6)));
  const BlockList list = refine_blocks(
      range, lattice, 0, executor, refine,
      [&](const Box& box, std::span<const std::uint32_t>, std::vector<std::uint32_t>&) {
        const Interval value = field.bound(box);
        const double band = width * field.gradient_bound(box);
        if (value.lower > band) return Verdict::Inside;
        if (value.upper < -band) return Verdict::Outside;
        return Verdict::Keep;
      });

  std::vector<SampledLeaf> leaves(list.block.size());
  executor.for_blocks(leaves.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) leaves[i] = sample_leaf(field, options, list.block[i]);
  });
  // Beyond the band: the width of the band, or the largest |F| in it, with the sign of the side.
  const bool is_distance = options.content == GridContent::SignedDistance;
  float largest = 0.0F;
  for (const SampledLeaf& sampled : leaves) largest = std::max(largest, sampled.largest);
  const float beyond = !is_distance && largest > 0.0F ? largest : static_cast<float>(width);
  const float inside = is_distance ? -beyond : beyond;
  executor.for_blocks(leaves.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!leaves[i].leaf) continue;
      for (auto voxel = leaves[i].leaf->beginValueOff(); voxel; ++voxel) {
        voxel.setValue(*voxel > 0.0F ? inside : -inside);
      }
    }
  });

  SurfaceGrid result;
  executor.run([&] {
    FloatGrid::Ptr grid = FloatGrid::create(-inside);
    for (const BlockBox& box : list.inside) {
      grid->tree().fill({first_voxel(box.lower), first_voxel(box.upper).offsetBy(kCells - 1)}, inside, false);
    }
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      if (leaves[i].leaf) {
        grid->tree().addLeaf(leaves[i].leaf.release());
      } else if (leaves[i].inside) {
        const Coord low = first_voxel(list.block[i]);
        grid->tree().fill({low, low.offsetBy(kCells - 1)}, inside, false);
      }
    }
    grid->setName(options.name);
    grid->setGridClass(is_distance ? openvdb::GRID_LEVEL_SET : openvdb::GRID_UNKNOWN);
    openvdb::math::Transform::Ptr transform = openvdb::math::Transform::createLinearTransform(lattice.cell);
    transform->postTranslate({lattice.origin.x(), lattice.origin.y(), lattice.origin.z()});
    grid->setTransform(transform);
    grid->insertMeta("units", openvdb::StringMetadata("m"));
    grid->insertMeta("up_axis", openvdb::StringMetadata("z"));
    grid->insertMeta(kHashKey, openvdb::StringMetadata(to_hex(hash_of(*grid))));
    result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(grid));
  });
  return result;
}

void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid> grids) {
  openvdb::initialize();
  openvdb::GridCPtrVec pointers;
  for (const SurfaceGrid& grid : grids) {
    SUPPLE_EXPECTS(grid.impl_ != nullptr);
    pointers.push_back(grid.impl_->grid);
  }
  std::string bytes;
  Executor(1).run([&] { bytes = MemoryArchive().bytes(pointers); });
  io::write_atomically(path, std::as_bytes(std::span<const char>(bytes)));
}

SurfaceGrid read_grid(const std::filesystem::path& path, const std::string& name) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    fail(ErrorKind::Io, path, "expected a readable .vdb file", code ? code.message() : "none", "");
  }
  openvdb::initialize();
  SurfaceGrid result;
  Executor(1).run([&] {
    openvdb::GridBase::Ptr base;
    std::string names;
    try {
      openvdb::io::File file(path.string());
      file.open(false);
      for (auto each = file.beginName(); each != file.endName(); ++each) names += (names.empty() ? "" : ", ") + *each;
      if (file.hasGrid(name)) base = file.readGrid(name);
    } catch (const std::exception& error) {
      fail(ErrorKind::Corrupt, path, "expected an OpenVDB file", error.what(), "write it again");
    }
    if (!base) fail(ErrorKind::Corrupt, path, "expected a grid '" + name + "'", names.empty() ? "none" : names, "");
    FloatGrid::Ptr grid = openvdb::gridPtrCast<FloatGrid>(base);
    if (!grid) fail(ErrorKind::Corrupt, path, "expected a grid of floats named '" + name + "'", base->type(), "");
    // OpenVDB reads truncated files without an error.
    if (const auto written = grid->getMetadata<openvdb::StringMetadata>(kHashKey);
        written && written->value() != to_hex(hash_of(*grid))) {
      fail(ErrorKind::Corrupt, path, "expected the content that was written (hash " + written->value() + ")",
           to_hex(hash_of(*grid)), "the file is truncated or changed: write it again");
    }
    result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(grid));
  });
  return result;
}

}  // namespace supple::implicit
