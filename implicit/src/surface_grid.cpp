#include "supple/implicit/surface_grid.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <unordered_map>

#include "field_index.h"
#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/implicit/mesh_limits.h"

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

constexpr double kInfinity = std::numeric_limits<double>::infinity();
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
  explicit Impl(FloatGrid::Ptr made) : grid(std::move(made)) {}
  FloatGrid::Ptr grid;
};

SurfaceGrid::SurfaceGrid() = default;
SurfaceGrid::~SurfaceGrid() = default;
SurfaceGrid::SurfaceGrid(SurfaceGrid&&) noexcept = default;
SurfaceGrid& SurfaceGrid::operator=(SurfaceGrid&&) noexcept = default;

std::uint64_t SurfaceGrid::active_voxels() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return impl_->grid->activeVoxelCount();
}

std::uint64_t SurfaceGrid::memory_bytes() const {
  SUPPLE_EXPECTS(impl_ != nullptr);
  return impl_->grid->memUsage();
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

namespace {

/// Whether the nodes of a box may be in the band.
Verdict look(const FieldView& field, double width, const Box& box) {
  const Interval value = field.bound(box);
  const double band = width * field.gradient_bound(box);
  if (value.lower > band) return Verdict::Inside;
  if (value.upper < -band) return Verdict::Outside;
  return Verdict::Keep;
}

double band_of(const GridOptions& options) { return options.half_width * options.lattice.cell; }

BlockRange range_of(const FieldView& field, const GridOptions& options) {
  return block_range(field.surface_box(), options.lattice,
                     static_cast<int>(std::min(std::ceil(options.half_width), 1e6)));
}

/// What stands for voxels beyond the band: its width, or the largest |F| in it, with the sign of the side.
float inside_value(const GridOptions& options, float largest) {
  const auto width = static_cast<float>(band_of(options));
  if (options.content == GridContent::SignedDistance) return -width;
  return largest > 0.0F ? largest : width;
}

void set_beyond(Leaf& leaf, float inside) {
  for (auto voxel = leaf.beginValueOff(); voxel; ++voxel) voxel.setValue(*voxel > 0.0F ? inside : -inside);
}

void fill(FloatTree& tree, const BlockBox& box, float value) {
  tree.fill({first_voxel(box.lower), first_voxel(box.upper).offsetBy(kCells - 1)}, value, false);
}

/// Puts a sampled leaf, or the tile that stands for it, into the tree.
void place(FloatTree& tree, const BlockCoord& block, SampledLeaf& sampled, float inside) {
  if (sampled.leaf) {
    tree.addLeaf(sampled.leaf.release());
  } else {
    fill(tree, {block, block}, sampled.inside ? inside : -inside);
  }
}

/// A whole grid and what its making found.
struct MadeGrid {
  FloatGrid::Ptr grid;
  float inside = 0.0F;
  std::vector<std::pair<BlockCoord, float>> largest;  ///< |value| by leaf
  std::uint64_t looked_at = 0;
};

std::uint64_t most_leaves(const GridOptions& options) { return std::max<std::uint64_t>(1, options.max_voxels / kLeafVoxels); }

/// The leaves that may hold some of the band. @throws Error{Limit}
BlockList band_leaves(const FieldView& field, const GridOptions& options, const Executor& executor) {
  const double width = band_of(options);
  const RefineOptions refine{.limit = most_leaves(options),
                             .look_factor = 8,  // up to eight for each that is kept
                             .last_node = kCells - 1,
                             .keep_inside = true,
                             .counted = "voxels",
                             .per_block = kLeafVoxels};
  return refine_blocks(range_of(field, options), options.lattice, 0, executor, refine,
                       [&](const Box& box, std::span<const std::uint32_t>, std::vector<std::uint32_t>&) {
                         return look(field, width, box);
                       });
}

MadeGrid make_whole(const FieldView& field, const GridOptions& options, const Executor& executor) {
  SUPPLE_EXPECTS(options.half_width >= 1.0 && std::isfinite(options.half_width));
  openvdb::initialize();
  const Lattice& lattice = options.lattice;
  const BlockList list = band_leaves(field, options, executor);
  std::vector<SampledLeaf> leaves(list.block.size());
  executor.for_blocks(leaves.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) leaves[i] = sample_leaf(field, options, list.block[i]);
  });
  MadeGrid made;
  made.looked_at = leaves.size();
  float largest = 0.0F;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    largest = std::max(largest, leaves[i].largest);
    if (leaves[i].leaf) made.largest.emplace_back(list.block[i], leaves[i].largest);
  }
  made.inside = inside_value(options, largest);
  executor.for_blocks(leaves.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (leaves[i].leaf) set_beyond(*leaves[i].leaf, made.inside);
    }
  });
  executor.run([&] {
    made.grid = FloatGrid::create(-made.inside);
    for (const BlockBox& box : list.inside) fill(made.grid->tree(), box, made.inside);
    for (std::size_t i = 0; i < leaves.size(); ++i) place(made.grid->tree(), list.block[i], leaves[i], made.inside);
    // One tree for one content: boxes are tiles as large as they can be, whatever the order in which they came.
    made.grid->tree().prune();
    made.grid->setName(options.name);
    made.grid->setGridClass(options.content == GridContent::SignedDistance ? openvdb::GRID_LEVEL_SET
                                                                           : openvdb::GRID_UNKNOWN);
    openvdb::math::Transform::Ptr transform = openvdb::math::Transform::createLinearTransform(lattice.cell);
    transform->postTranslate({lattice.origin.x(), lattice.origin.y(), lattice.origin.z()});
    made.grid->setTransform(transform);
    made.grid->insertMeta("units", openvdb::StringMetadata("m"));
    made.grid->insertMeta("up_axis", openvdb::StringMetadata("z"));
  });
  return made;
}

/// All that the values near a primitive depend on, by a hash for what is more than a point.
struct PrimitiveKey {
  std::array<double, 3> position{};
  double inverse_r2 = 0.0;
  std::uint64_t rest = 0;
  bool operator==(const PrimitiveKey&) const = default;
};

PrimitiveKey key_of(const Field::Index& index, std::size_t id) {
  const PackedPrimitive& p = index.primitive[id];
  PrimitiveKey key{p.position, p.inverse_r2, p.part};
  if (p.kind == PackedKind::PointWyvill) return key;
  const PackedShape& shape = index.shape[id];
  Hasher hasher;
  hasher.add(std::uint64_t{p.part});
  hasher.add(std::span<const double>(shape.to_local));
  hasher.add(std::span<const double>(shape.half));
  const Kernel& k = shape.kernel;
  hasher.add(static_cast<std::uint64_t>(k.kind));
  for (const double x : {k.radius, k.thickness, k.slope, k.iso, k.shape}) hasher.add(x);
  const ShapeView& v = shape.view;
  hasher.add(static_cast<std::uint64_t>(v.kind));
  hasher.add(std::span<const Vec3>(&v.size, 1));
  for (const double x : {v.radius, v.taper, v.pair[0], v.pair[1], v.gain}) hasher.add(x);
  hasher.add(v.control);
  key.rest = hasher.value();
  return key;
}

struct BlockHash {
  std::size_t operator()(const BlockCoord& b) const {
    return static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span<const std::int32_t>(b))));
  }
};

bool same(const GridOptions& a, const GridOptions& b) {
  return a.lattice.origin == b.lattice.origin && a.lattice.cell == b.lattice.cell && a.content == b.content &&
         a.half_width == b.half_width && a.max_voxels == b.max_voxels && a.name == b.name;
}

bool same(const BlockRange& a, const BlockRange& b) { return a.lower == b.lower && a.upper == b.upper; }

}  // namespace

void expect_griddable(const FieldView& field, const GridOptions& options, const Executor& executor) {
  if (range_of(field, options).count() > most_leaves(options)) (void)band_leaves(field, options, executor);
}

SurfaceGrid make_surface_grid(const FieldView& field, const GridOptions& options, const Executor& executor) {
  SurfaceGrid result;
  result.impl_ = std::make_unique<SurfaceGrid::Impl>(make_whole(field, options, executor).grid);
  return result;
}

struct GridUpdater::Impl {
  SurfaceGrid result;
  bool usable = false;
  GridOptions options;
  BlockRange range;
  double iso = 0.0;
  BlendIndex blend;
  std::vector<PrimitiveKey> key, next_key;
  std::vector<Box> support;
  float inside = 0.0F;
  std::unordered_map<BlockCoord, float, BlockHash> largest;  ///< |value| by leaf, for GridContent::Field
  std::vector<BlockCoord> touched;
  std::vector<SampledLeaf> sampled;

  /// Blocks of the range that a box reaches.
  void touch(const Box& box) {
    const BlockRange reached = block_range(box, options.lattice, 1);
    for (std::int32_t z = std::max(reached.lower[2], range.lower[2]); z <= std::min(reached.upper[2], range.upper[2]); ++z) {
      for (std::int32_t y = std::max(reached.lower[1], range.lower[1]); y <= std::min(reached.upper[1], range.upper[1]); ++y) {
        for (std::int32_t x = std::max(reached.lower[0], range.lower[0]); x <= std::min(reached.upper[0], range.upper[0]); ++x) {
          touched.push_back({x, y, z});
        }
      }
    }
  }

  /// Lists the blocks that may be different. @return false where everything may be
  bool list_touched(const Field::Index& index, const std::vector<Box>& boxes) {
    touched.clear();
    if (key.size() != next_key.size()) return false;
    for (std::size_t i = 0; i < key.size(); ++i) {
      if (key[i] == next_key[i]) continue;
      touch(support[i]);
      touch(boxes[i]);
      if (touched.size() > 64 * (index.size() + 4096)) drop_repeats();
    }
    drop_repeats();
    return 2 * touched.size() < std::max<std::size_t>(result.impl_->grid->tree().leafCount(), 64);
  }
  void drop_repeats() {
    std::sort(touched.begin(), touched.end(), before);
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  }

  /// @return false when the largest value is another one
  bool update(const FieldView& field, const Executor& executor, GridCounts& counts) {
    const double width = band_of(options);
    sampled.clear();
    sampled.resize(touched.size());
    std::vector<Verdict> verdict(touched.size());
    executor.for_blocks(touched.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const BlockCoord& b = touched[i];
        const Box box{node_position(options.lattice, kCells * b[0], kCells * b[1], kCells * b[2]),
                      node_position(options.lattice, kCells * b[0] + kCells - 1, kCells * b[1] + kCells - 1,
                                    kCells * b[2] + kCells - 1)};
        verdict[i] = look(field, width, box);
        if (verdict[i] == Verdict::Keep) {
          sampled[i] = sample_leaf(field, options, b);
        } else {
          sampled[i].inside = verdict[i] == Verdict::Inside;
        }
      }
    });
    counts.leaves_looked_at = touched.size();
    counts.leaves_sampled = static_cast<std::uint64_t>(std::count(verdict.begin(), verdict.end(), Verdict::Keep));
    if (options.content == GridContent::Field) {
      for (std::size_t i = 0; i < touched.size(); ++i) {
        if (sampled[i].leaf) {
          largest[touched[i]] = sampled[i].largest;
        } else {
          largest.erase(touched[i]);
        }
      }
      float most = 0.0F;
      for (const auto& [block, value] : largest) most = std::max(most, value);
      if (inside_value(options, most) != inside) return false;
    }
    FloatTree& tree = result.impl_->grid->tree();
    for (std::size_t i = 0; i < touched.size(); ++i) {
      if (sampled[i].leaf) set_beyond(*sampled[i].leaf, inside);
      place(tree, touched[i], sampled[i], inside);
    }
    tree.prune();
    return true;
  }
};

GridUpdater::GridUpdater() : impl_(std::make_unique<Impl>()) {}
GridUpdater::~GridUpdater() = default;
GridUpdater::GridUpdater(GridUpdater&&) noexcept = default;
GridUpdater& GridUpdater::operator=(GridUpdater&&) noexcept = default;

const SurfaceGrid& GridUpdater::make(const Field& field, const GridOptions& options, const Executor& executor,
                                     GridCounts* counts) {
  Impl& self = *impl_;
  const Field::Index& index = field.index();
  GridCounts count;
  self.next_key.resize(index.size());
  for (std::size_t i = 0; i < index.size(); ++i) self.next_key[i] = key_of(index, i);
  const BlockRange range = range_of(field, options);
  const bool comparable = self.usable && same(options, self.options) && index.iso == self.iso &&
                          index.blend == self.blend && same(range, self.range);
  self.usable = false;
  bool done = false;
  if (comparable && self.list_touched(index, index.support)) {
    executor.run([&] { done = self.update(field, executor, count); });
  }
  if (!done) {
    MadeGrid made = make_whole(field, options, executor);
    count = {.leaves_looked_at = made.looked_at, .leaves_sampled = made.looked_at, .whole = true};
    self.result.impl_ = std::make_unique<SurfaceGrid::Impl>(std::move(made.grid));
    self.inside = made.inside;
    self.largest.clear();
    if (options.content == GridContent::Field) self.largest.insert(made.largest.begin(), made.largest.end());
    self.options = options;
    self.range = range;
    self.iso = index.iso;
    self.blend = index.blend;
  }
  self.key.swap(self.next_key);
  self.support = index.support;
  self.usable = true;
  if (counts != nullptr) *counts = count;
  return self.result;
}

void DepthField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  std::vector<Vec3> gradients(points.size());
  evaluate(points, values, gradients);
}

void DepthField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  field_.evaluate(points, values, gradients);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double slope = gradients[i].norm();
    if (slope > 0.0) gradients[i] /= slope;
    if (values[i] != 0.0) values[i] /= slope;
  }
}

Interval DepthField::bound(const Box& box) const {
  const Interval value = field_.bound(box);
  const double steepest = field_.gradient_bound(box);
  return {value.lower > 0.0 ? value.lower / steepest : -kInfinity, value.upper < 0.0 ? value.upper / steepest : kInfinity};
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  std::vector<Vec3> gradients(points.size());
  evaluate(points, values, gradients);
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  std::vector<double> value(points.size());
  std::vector<Vec3> gradient(points.size());
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    fields_[k].evaluate(points, value, gradient);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (k > 0 && !(value[i] > values[i])) continue;
      values[i] = value[i];
      gradients[i] = gradient[i];
    }
  }
}

void UnitedField::evaluate_parts(std::span<const Vec3>, FieldParts&) const { SUPPLE_EXPECTS(false && "parts of one body"); }

Interval UnitedField::bound(const Box& box) const {
  Interval result = fields_.front().bound(box);
  for (const FieldView& field : std::span(fields_).subspan(1)) {
    const Interval other = field.bound(box);
    result.lower = std::max(result.lower, other.lower);
    result.upper = std::max(result.upper, other.upper);
  }
  return result;
}

double UnitedField::gradient_bound(const Box& box) const {
  double largest = 0.0;
  for (const FieldView& field : fields_) largest = std::max(largest, field.gradient_bound(box));
  return largest;
}

Box UnitedField::surface_box() const {
  Box box;
  for (const FieldView& field : fields_) {
    if (const Box other = field.surface_box(); !other.empty()) box = box.united(other);
  }
  return box;
}

double UnitedField::feature_size() const {
  double least = std::numeric_limits<double>::infinity();
  for (const FieldView& field : fields_) least = std::min(least, field.feature_size());
  return least;
}

namespace {

constexpr std::size_t kPointsPerTask = 512;

/// Newton's steps along the gradient onto the surface; a point that they do not bring there within half a cell stays.
/// @pre no more than kPointsPerTask points
void project(const FieldView& field, double cell, std::span<const Vec3> from, std::span<Vec3> onto) {
  constexpr int kSteps = 6;
  constexpr double kNear = 1e-5, kFarthest = 0.5;  // of a cell; the step from so near goes to the square of it
  std::array<double, kPointsPerTask> values;
  std::array<Vec3, kPointsPerTask> at, gradients;
  std::array<std::size_t, kPointsPerTask> open;
  std::size_t count = from.size();
  for (std::size_t k = 0; k < count; ++k) {
    open[k] = k;
    at[k] = onto[k] = from[k];
  }
  for (int step = 0; step < kSteps && count > 0; ++step) {
    field.evaluate(std::span(at).first(count), std::span(values).first(count), std::span(gradients).first(count));
    std::size_t left = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double square = gradients[k].squaredNorm();
      if (!(square > 0.0)) continue;
      const Vec3 way = -values[k] / square * gradients[k];
      const Vec3 next = at[k] + way;
      if (!((next - from[open[k]]).norm() <= kFarthest * cell)) continue;
      if (way.norm() <= kNear * cell) {
        onto[open[k]] = next;
        continue;
      }
      open[left] = open[k];
      at[left++] = next;
    }
    count = left;
  }
}

/// Takes back what turns triangles over, until none is.
void keep_sides(const Mesh& mesh, std::vector<Vec3>& onto) {
  const auto normal_of = [&](const std::vector<Vec3>& p, const std::array<std::uint32_t, 3>& t) {
    return Vec3((p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]));
  };
  for (bool turned = true; turned;) {
    turned = false;
    for (const auto& t : mesh.triangle) {
      const Vec3 before = normal_of(mesh.position, t);
      if (before.dot(normal_of(onto, t)) > 0.0 || before.isZero()) continue;
      for (const std::uint32_t v : t) {
        turned = turned || onto[v] != mesh.position[v];
        onto[v] = mesh.position[v];
      }
    }
  }
}

}  // namespace

Mesh mesh_of(const SurfaceGrid& grid, const FieldView& field, const Executor& executor) {
  SUPPLE_EXPECTS(grid.impl_ != nullptr);
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quadrangles;
  executor.run([&] { openvdb::tools::volumeToMesh(*grid.impl_->grid, points, triangles, quadrangles); });
  Mesh mesh;
  for (const auto& p : points) mesh.position.push_back(Vec3(p.x(), p.y(), p.z()));
  // Clockwise from outside, as it gives them for F < 0 inside.
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) { mesh.triangle.push_back({a, c, b}); };
  for (const auto& t : triangles) add(t[0], t[1], t[2]);
  for (const auto& q : quadrangles) {
    add(q[0], q[1], q[2]);
    add(q[0], q[2], q[3]);
  }
  const double cell = grid.impl_->grid->voxelSize().x();
  std::vector<Vec3> onto(points.size());
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    project(field, cell, std::span(mesh.position).subspan(begin, end - begin), std::span(onto).subspan(begin, end - begin));
  });
  keep_sides(mesh, onto);
  mesh.position = std::move(onto);
  mesh.normal.resize(points.size());
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    std::array<double, kPointsPerTask> values;
    const auto normals = std::span(mesh.normal).subspan(begin, end - begin);
    field.evaluate(std::span(mesh.position).subspan(begin, end - begin), std::span(values).first(end - begin), normals);
    for (Vec3& n : normals) n = n.squaredNorm() > 0.0 ? Vec3(-n.normalized()) : Vec3::UnitZ();
  });
  return mesh;
}

void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid> grids) {
  std::vector<const SurfaceGrid*> pointers;
  for (const SurfaceGrid& grid : grids) pointers.push_back(&grid);
  write_grids(path, pointers);
}

void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid* const> grids) {
  openvdb::initialize();
  openvdb::GridCPtrVec pointers;
  for (const SurfaceGrid* grid : grids) {
    SUPPLE_EXPECTS(grid != nullptr && grid->impl_ != nullptr);
    const FloatGrid::Ptr marked = grid->impl_->grid->copy();  // shares the tree
    marked->insertMeta(kHashKey, openvdb::StringMetadata(to_hex(hash_of(*marked))));
    pointers.push_back(marked);
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
