#include "grid/grid_leaves.h"

#include <openvdb/tools/ChangeBackground.h>

#include <limits>

#include "supple/core/error.h"

namespace supple::implicit::gridding {

using namespace lattice;
using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;

namespace {

Coord first_voxel(const BlockCoord& block) { return {kCells * block[0], kCells * block[1], kCells * block[2]}; }

template <class T>
using PerVoxel = std::array<T, kLeafVoxels>;

/// From a node to a neighbour on the other side of the surface.
struct CrossedEdge {
  openvdb::Index node;
  Vec3 way;
};

/// Of some nodes of a leaf: their edges that cross the surface, to nodes of the leaf and beyond it.
std::vector<CrossedEdge> crossed_edges(const FieldView& field, const Lattice& lattice, const Coord& origin, const PerVoxel<double>& values,
                                       std::span<const openvdb::Index> nodes) {
  std::vector<CrossedEdge> crossed;
  std::vector<CrossedEdge> open;
  std::vector<Vec3> beyond;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int step : {-1, 1}) {
      const Vec3 way = step * lattice.cell * Vec3::Unit(axis);
      const int face = step < 0 ? 0 : kCells - 1;
      Box next;  // the nodes beyond the face: not evaluated where their side is known
      std::vector<openvdb::Index> at_face;
      for (const openvdb::Index n : nodes) {
        Coord local = Leaf::offsetToLocalCoord(n);
        if (local[axis] == face) {
          at_face.push_back(n);
          local[axis] += step;
          const Coord at = origin + local;
          next.include(node_position(lattice, at.x(), at.y(), at.z()));
          continue;
        }
        local[axis] += step;
        if ((values[Leaf::coordToOffset(local)] > 0.0) != (values[n] > 0.0)) crossed.push_back({n, way});
      }
      if (at_face.empty()) continue;
      const Interval bound = field.bound(next);
      const bool inside = bound.lower > 0.0;
      for (const openvdb::Index n : at_face) {
        if (inside || bound.upper <= 0.0) {
          if (inside != (values[n] > 0.0)) crossed.push_back({n, way});
          continue;
        }
        Coord at = origin + Leaf::offsetToLocalCoord(n);
        at[axis] += step;
        open.push_back({n, way});
        beyond.push_back(node_position(lattice, at.x(), at.y(), at.z()));
      }
    }
  }
  std::vector<double> value(beyond.size());
  field.evaluate(beyond, value);
  for (std::size_t k = 0; k < beyond.size(); ++k) {
    if ((value[k] > 0.0) != (values[open[k].node] > 0.0)) crossed.push_back(open[k]);
  }
  return crossed;
}

/// Distances to the surface [m] along the edges that cross it, the least of each node's; infinite where none does.
void measure_along(const FieldView& field, double cell, const PerVoxel<Vec3>& points, const PerVoxel<double>& values,
                   std::span<const CrossedEdge> edges, PerVoxel<double>& distance) {
  constexpr int kHalvings = 20;
  distance.fill(std::numeric_limits<double>::infinity());
  std::vector<double> near(edges.size(), 0.0), value(edges.size());  // share of the edge on the node's side
  std::vector<Vec3> at(edges.size());
  double width = 1.0;
  for (int k = 0; k < kHalvings; ++k) {
    width *= 0.5;
    for (std::size_t e = 0; e < edges.size(); ++e) at[e] = points[edges[e].node] + (near[e] + width) * edges[e].way;
    field.evaluate(at, value);
    for (std::size_t e = 0; e < edges.size(); ++e) {
      if ((value[e] > 0.0) == (values[edges[e].node] > 0.0)) near[e] += width;
    }
  }
  for (std::size_t e = 0; e < edges.size(); ++e) {
    double& least = distance[edges[e].node];
    least = std::min(least, (near[e] + 0.5 * width) * cell);
  }
}

bool may_cross(const FieldView& field, const Box& box) {
  const Interval value = field.bound(box);
  return value.lower <= 0.0 && value.upper > 0.0;
}

}  // namespace

bool is_thin(const FieldView& field, const GridOptions& options) { return field.feature_size() < 3.0 * options.lattice.cell; }

SampledLeaf sample_leaf(const FieldView& field, const GridOptions& options, bool thin, const BlockCoord& block) {
  PerVoxel<Vec3> points;
  PerVoxel<double> values{}, along;
  PerVoxel<Vec3> gradients;
  const Coord origin = first_voxel(block);
  for (openvdb::Index n = 0; n < kLeafVoxels; ++n) {
    const Coord at = origin + Leaf::offsetToLocalCoord(n);
    points[n] = node_position(options.lattice, at.x(), at.y(), at.z());
  }
  field.evaluate(points, values, gradients);
  const double cell = options.lattice.cell, width = band_of(options);
  std::vector<openvdb::Index> far;  // by first order
  for (openvdb::Index n = 0; thin && n < kLeafVoxels; ++n) {
    if (!(std::abs(values[n]) <= cell * gradients[n].norm())) far.push_back(n);
  }
  std::vector<CrossedEdge> crossed;
  if (!far.empty() && may_cross(field, box_of(block, options.lattice).inflated(cell))) {
    crossed = crossed_edges(field, options.lattice, origin, values, far);
    if (!crossed.empty()) measure_along(field, cell, points, values, crossed, along);
  }
  SampledLeaf result;
  result.leaf = std::make_unique<Leaf>(origin);
  for (openvdb::Index n = 0; n < kLeafVoxels; ++n) {
    const double f = values[n], slope = gradients[n].norm();
    const bool crosses = !crossed.empty() && std::isfinite(along[n]);
    if (!crosses && !(std::abs(f) <= width * slope)) {
      result.leaf->setValueOff(n, f > 0.0 ? 1.0F : -1.0F);  // its side, until the background is known
      continue;
    }
    // Where grad F vanishes, on skeletons and at the end of supports, it gives no distance: such nodes are near thin parts.
    const double distance = crosses ? std::copysign(along[n], -f) : slope > 0.0 ? -f / slope : 0.0;
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

Verdict look(const FieldView& field, const GridOptions& options, bool thin, const Box& box) {
  const Interval value = field.bound(box);
  const double band = band_of(options) * field.gradient_bound(box);
  if (value.lower <= band && value.upper >= -band) return Verdict::Keep;
  // Where F is constant, beyond supports, a node next to it may be on the other side.
  if (thin && may_cross(field, box.inflated(options.lattice.cell))) return Verdict::Keep;
  return value.lower > band ? Verdict::Inside : Verdict::Outside;
}

BlockRange range_of(const FieldView& field, const GridOptions& options) {
  return block_range(field.surface_box(), options.lattice,
                     static_cast<int>(std::min(std::ceil(options.half_width), 1e6)));
}

Box box_of(const BlockCoord& block, const Lattice& lattice) {
  return {node_position(lattice, kCells * block[0], kCells * block[1], kCells * block[2]),
          node_position(lattice, kCells * block[0] + kCells - 1, kCells * block[1] + kCells - 1, kCells * block[2] + kCells - 1)};
}

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

void change_beyond(FloatTree& tree, float inside) { openvdb::tools::changeBackground(tree, -inside); }

void place(FloatTree& tree, const BlockCoord& block, SampledLeaf& sampled, float inside) {
  if (sampled.leaf) {
    tree.addLeaf(sampled.leaf.release());
  } else {
    fill(tree, {block, block}, sampled.inside ? inside : -inside);
  }
}

std::uint64_t most_leaves(const GridOptions& options) { return std::max<std::uint64_t>(1, options.max_voxels / kLeafVoxels); }

BlockList band_leaves(const BlockRange& range, const GridOptions& options, std::uint32_t bodies, const Executor& executor,
                      const Decide& decide) {
  const RefineOptions refine{.limit = most_leaves(options),
                             .look_factor = 8,  // up to eight for each that is kept
                             .last_node = kCells - 1,
                             .keep_inside = true,
                             .counted = "voxels",
                             .per_block = kLeafVoxels};
  BlockList list = refine_blocks(range, options.lattice, bodies, executor, refine, decide);  // refuses far larger cells where there are too many
  if (options.lattice.cell < kLeastGridCell) {
    throw Error(ErrorKind::Limit, {.place = "",
                                   .key = "lattice.cell",
                                   .expected = "expected a cell of a size that OpenVDB takes, whose smallest is " + three_digits(kLeastGridCell) + " m",
                                   .found = three_digits(options.lattice.cell) + " m",
                                   .hint = "use cells of at least " + three_digits(kLeastGridCell) + " m, or lengths in a larger unit"});
  }
  return list;
}

BlockList band_leaves(const FieldView& field, const GridOptions& options, const Executor& executor) {
  const bool thin = is_thin(field, options);
  return band_leaves(range_of(field, options), options, 0, executor,
                     [&](const Box& box, std::span<const std::uint32_t>, std::vector<std::uint32_t>&) { return look(field, options, thin, box); });
}

void LargestValues::reset(std::span<const std::pair<BlockCoord, float>> by_leaf) {
  by_leaf_.clear();
  by_leaf_.insert(by_leaf.begin(), by_leaf.end());
}

void LargestValues::set(const BlockCoord& block, const SampledLeaf& sampled) {
  if (sampled.leaf) {
    by_leaf_[block] = sampled.largest;
  } else {
    by_leaf_.erase(block);
  }
}

float LargestValues::of_all() const {
  float largest = 0.0F;  // the same in any order
  for (const auto& [block, value] : by_leaf_) largest = std::max(largest, value);
  return largest;
}

MadeGrid make_whole(const BlockList& list, const GridOptions& options, const Executor& executor,
                    const std::function<SampledLeaf(std::size_t)>& sample) {
  openvdb::initialize();
  const Lattice& lattice = options.lattice;
  std::vector<SampledLeaf> leaves(list.block.size());
  executor.for_blocks(leaves.size(), kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) leaves[i] = sample(i);
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

MadeGrid make_whole(const FieldView& field, const GridOptions& options, const Executor& executor) {
  SUPPLE_EXPECTS(options.half_width >= 1.0 && std::isfinite(options.half_width));
  const BlockList list = band_leaves(field, options, executor);
  const bool thin = is_thin(field, options);
  return make_whole(list, options, executor, [&](std::size_t i) { return sample_leaf(field, options, thin, list.block[i]); });
}

bool same(const GridOptions& a, const GridOptions& b) {
  return a.lattice.origin == b.lattice.origin && a.lattice.cell == b.lattice.cell && a.content == b.content &&
         a.half_width == b.half_width && a.max_voxels == b.max_voxels && a.name == b.name;
}

}  // namespace supple::implicit::gridding
