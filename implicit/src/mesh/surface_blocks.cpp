#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <queue>

#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/range_of_surface.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/implicit/mesh_limits.h"

namespace supple::implicit {
namespace lattice {
namespace {

constexpr std::size_t kBoxesPerTask = 32;
constexpr std::size_t kMostCubes = 8192;  // of a level that is refined at once
constexpr std::size_t kSamples = 8, kSampled = 128;  // of a level with more, and the cubes of each
constexpr double kSpreads = 6.0, kFarTooMany = 1.25;  // below their mean, samples leave no doubt; of the limit
constexpr double kHopeless = 1000.0;                  // times the limit: two samples that both count so many leave no doubt either
constexpr double kLargestNode = 1 << 30;
constexpr std::size_t kMostOutermost = 60'000;  // boxes that are halved for a side of a range

/// A cube of 2^level blocks, in units of its own size, with its candidates.
struct Cube {
  BlockCoord at{};
  std::uint32_t first = 0, count = 0;
};

BlockBox blocks_of(const BlockCoord& at, int level, const BlockRange& range) {
  BlockBox box;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int64_t low = std::int64_t{at[k]} << level;
    const std::int64_t high = low + (std::int64_t{1} << level) - 1;
    box.lower[k] = static_cast<std::int32_t>(std::max<std::int64_t>(low, range.lower[k]));
    box.upper[k] = static_cast<std::int32_t>(std::min<std::int64_t>(high, range.upper[k]));
  }
  return box;
}

Box world_box(const BlockBox& blocks, const Lattice& lattice, int last_node) {
  const auto node = [](std::int32_t block, int offset) { return std::int64_t{kCells} * block + offset; };
  return {node_position(lattice, node(blocks.lower[0], 0), node(blocks.lower[1], 0), node(blocks.lower[2], 0)),
          node_position(lattice, node(blocks.upper[0], last_node), node(blocks.upper[1], last_node),
                        node(blocks.upper[2], last_node))};
}

/// The first cubes of a range: the fewest that hold it, at most two along an axis. @return their size
int first_cubes(const BlockRange& range, std::vector<Cube>& cubes) {
  int size = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    while ((range.upper[k] >> size) - (range.lower[k] >> size) > 1) ++size;
  }
  for (std::int32_t z = range.lower[2] >> size; z <= range.upper[2] >> size; ++z) {
    for (std::int32_t y = range.lower[1] >> size; y <= range.upper[1] >> size; ++y) {
      for (std::int32_t x = range.lower[0] >> size; x <= range.upper[0] >> size; ++x) cubes.push_back({.at = {x, y, z}});
    }
  }
  return size;
}

/// A cube's child of half the size.
Cube child_of(const Cube& cube, unsigned corner) {
  Cube child = cube;
  for (std::size_t k = 0; k < 3; ++k) child.at[k] = 2 * cube.at[k] + static_cast<std::int32_t>(corner >> k & 1u);
  return child;
}

/// The outermost block along an axis that is kept, as are the cubes around it, times `side` (1 or -1). None where no block is, or where many boxes lie equally far
/// out, as on a flat face.
std::optional<std::int32_t> outermost(const BlockRange& range, std::size_t axis, std::int32_t side, const std::function<bool(const Cube&, int)>& keeps) {
  struct Open {
    std::int32_t out;  // its outermost block, times the side
    int size;
    Cube cube;
    bool operator<(const Open& other) const { return out != other.out ? out < other.out : size > other.size; }
  };
  std::priority_queue<Open> open;
  const auto add = [&](const Cube& cube, int size) {
    if (!keeps(cube, size)) return;
    const BlockBox blocks = blocks_of(cube.at, size, range);
    open.push({side > 0 ? blocks.upper[axis] : -blocks.lower[axis], size, cube});
  };
  std::vector<Cube> first;
  const int size = first_cubes(range, first);
  for (const Cube& cube : first) add(cube, size);
  for (std::size_t halved = 0; !open.empty() && halved < kMostOutermost; ++halved) {
    heed_scope();
    const Open now = open.top();
    if (now.size == 0) return now.out;
    open.pop();
    for (unsigned corner = 0; corner < 8; ++corner) add(child_of(now.cube, corner), now.size - 1);
  }
  return std::nullopt;
}

/// Result of one task of a level.
struct LevelPart {
  std::vector<Cube> cube;
  std::vector<std::uint32_t> candidate;
  std::vector<BlockBox> inside;

  /// Cubes first..last of a processed parent, with their candidates, which are consecutive.
  void append(const LevelPart& other, std::size_t first, std::size_t last) {
    if (first == last) return;
    const std::uint32_t from = other.cube[first].first, to = other.cube[last - 1].first + other.cube[last - 1].count;
    const auto at = static_cast<std::uint32_t>(candidate.size());
    candidate.insert(candidate.end(), other.candidate.begin() + from, other.candidate.begin() + to);
    for (std::size_t i = first; i < last; ++i) {
      cube.push_back(other.cube[i]);
      cube.back().first += at - from;
    }
  }
};

/// Where the blocks of a level lie.
struct LevelGrid {
  const BlockRange& range;
  const Lattice& lattice;
  const RefineOptions& options;
};

/// Processes every cube of 2^size blocks of a level, in order; @return those to keep.
LevelPart look(const LevelPart& level, int size, const LevelGrid& grid, const Decide& decide, const Executor& executor) {
  std::vector<LevelPart> parts((level.cube.size() + kBoxesPerTask - 1) / kBoxesPerTask);
  executor.for_blocks(level.cube.size(), kBoxesPerTask, [&](std::size_t begin, std::size_t end) {
    LevelPart& part = parts[begin / kBoxesPerTask];
    for (std::size_t i = begin; i < end; ++i) {
      Cube cube = level.cube[i];
      const std::span candidates(level.candidate.data() + cube.first, cube.count);
      const BlockBox blocks = blocks_of(cube.at, size, grid.range);
      cube.first = static_cast<std::uint32_t>(part.candidate.size());
      const Verdict verdict = decide(world_box(blocks, grid.lattice, grid.options.last_node), candidates, part.candidate);
      cube.count = static_cast<std::uint32_t>(part.candidate.size()) - cube.first;
      if (verdict == Verdict::Keep) {
        part.cube.push_back(cube);
        continue;
      }
      part.candidate.resize(cube.first);
      if (verdict == Verdict::Inside && grid.options.keep_inside) part.inside.push_back(blocks);
    }
  });
  LevelPart joined;
  for (const LevelPart& part : parts) {
    joined.append(part, 0, part.cube.size());
    joined.inside.insert(joined.inside.end(), part.inside.begin(), part.inside.end());
  }
  return joined;
}

/// Cubes of half the size that lie in the range; they share their parent's candidates.
void halve(LevelPart& level, int size, const BlockRange& range) {
  std::vector<Cube> children;
  children.reserve(8 * level.cube.size());
  for (const Cube& cube : level.cube) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      const Cube child = child_of(cube, corner);
      const BlockBox blocks = blocks_of(child.at, size, range);
      if (!BlockRange{blocks.lower, blocks.upper}.empty()) children.push_back(child);
    }
  }
  level.cube = std::move(children);
}

/// Refines levels down to blocks. A level of many cubes is refined in parts, one after the other, so that what does not fit is
/// refused without having been in memory.
class Refinement {
 public:
  Refinement(const BlockRange& range, const Lattice& lattice, const Executor& executor, const RefineOptions& options, const Decide& decide)
      : range_(range), lattice_(lattice), executor_(executor), options_(options), decide_(decide) {}

  /// @param level  cubes of 2^size blocks that are not processed yet
  void refine(LevelPart level, int size) {
    for (;; --size) {
      std::uint64_t& looked = looked_[static_cast<std::size_t>(size)];
      looked += level.cube.size();
      if (looked > options_.limit * options_.look_factor) refuse(blocks_in(looked, size));
      level = look(level, size, {range_, lattice_, options_}, decide_, executor_);
      found_.inside.insert(found_.inside.end(), level.inside.begin(), level.inside.end());
      const std::size_t count = level.cube.size();
      if (size == 0) {
        found_.append(level, 0, count);
        if (found_.cube.size() > options_.limit) refuse(static_cast<double>(found_.cube.size()));
        return;
      }
      if (count > kMostCubes) {
        // By all halves, as a band about the surface fills more of them the smaller they are.
        if (expected_ == 0.0) {
          expected_ = blocks_in(8 * std::uint64_t{count}, size - 1);
          expect_not_far_too_many(level, size);
        }
        for (std::size_t first = 0; first < count; first += kMostCubes) {
          LevelPart part;
          part.append(level, first, std::min(first + kMostCubes, count));
          halve(part, size - 1, range_);
          refine(std::move(part), size - 1);
        }
        return;
      }
      halve(level, size - 1, range_);
    }
  }
  /// Blocks that are left, in no order.
  LevelPart& found() { return found_; }

 private:
  /// Refuses counts far above the limit early, by samples of a level whose cubes were processed; their spread measures their quality.
  void expect_not_far_too_many(const LevelPart& level, int size) const {
    const std::size_t stride = odd(level.cube.size() / kSampled + 1);
    double sum = 0.0, squares = 0.0, least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < kSamples; ++k) {
      const double blocks = static_cast<double>(stride) * sampled_blocks(every(level, k * stride / kSamples, stride), size, k);
      sum += blocks;
      squares += blocks * blocks;
      least = std::min(least, blocks);
      if (k == 1 && least > kHopeless * static_cast<double>(options_.limit)) refuse(sum / 2.0);
    }
    constexpr auto n = static_cast<double>(kSamples);
    const double mean = sum / n, spread = std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1.0));
    if (mean - kSpreads * spread > kFarTooMany * static_cast<double>(options_.limit)) refuse(mean);
  }
  /// About how many blocks are left of cubes of 2^size blocks that were looked at: levels of many are thinned out.
  double sampled_blocks(LevelPart level, int size, std::size_t sample) const {
    double share = 1.0;
    while (size > 0) {
      if (level.cube.size() > 8 * kSampled) {
        const std::size_t stride = odd(level.cube.size() / kSampled);
        level = every(level, sample * stride / kSamples, stride);
        share *= static_cast<double>(stride);
      }
      halve(level, --size, range_);
      level = look(level, size, {range_, lattice_, options_}, decide_, executor_);
    }
    return share * static_cast<double>(level.cube.size());
  }
  /// Cubes come in eights, which even strides would see one of.
  static std::size_t odd(std::size_t number) { return number | 1; }
  static LevelPart every(const LevelPart& level, std::size_t first, std::size_t stride) {
    LevelPart part;
    for (std::size_t i = first; i < level.cube.size(); i += stride) part.append(level, i, i + 1);
    return part;
  }
  /// A surface in n boxes of 2^size blocks lies in about 4^size n blocks.
  static double blocks_in(std::uint64_t boxes, int size) { return std::ldexp(static_cast<double>(boxes), 2 * size); }
  [[noreturn]] void refuse(double least) const { refuse_blocks(std::max(least, expected_), lattice_, options_); }

  const BlockRange& range_;
  const Lattice& lattice_;
  const Executor& executor_;
  const RefineOptions& options_;
  const Decide& decide_;
  LevelPart found_;
  std::array<std::uint64_t, 32> looked_{};  // cubes of each size
  double expected_ = 0.0;                   // blocks, by the first level that is refined in parts
};

}  // namespace

void refuse_blocks(double blocks, const Lattice& lattice, const RefineOptions& options) {
  // The blocks of a surface fall with the square of the cell.
  const double cell = lattice.cell * std::sqrt(blocks / static_cast<double>(options.limit));
  const std::string counted(options.counted);
  throw Error(ErrorKind::Limit,
              {.place = "",
               .key = "lattice.cell",
               .expected = "expected a surface in at most " + std::to_string(options.limit * options.per_block) + ' ' +
                           counted,
               .found = "about " + three_digits(blocks * static_cast<double>(options.per_block)) + " with cells of " +
                        three_digits(lattice.cell) + " m",
               .hint = "use cells of at least " + three_digits(1.05 * cell) + " m"});
}

std::uint64_t BlockRange::count() const {
  if (empty()) return 0;
  std::uint64_t product = 1;
  for (std::size_t k = 0; k < 3; ++k) product *= static_cast<std::uint64_t>(std::int64_t{upper[k]} - lower[k] + 1);
  return product;
}

std::string three_digits(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", x);
  return text;
}

bool is_bounded(const Box& box) { return box.lower.allFinite() && box.upper.allFinite(); }

BlockRange block_range(const Box& box, const Lattice& lattice, int margin) {
  SUPPLE_EXPECTS(std::isfinite(lattice.cell) && lattice.cell > 0.0 && lattice.origin.allFinite());
  if (box.empty()) return {};
  if (!is_bounded(box)) {
    throw Error(ErrorKind::Usage, {.place = "",
                                   .key = "surface",
                                   .expected = "expected a surface inside a bounded box",
                                   .found = "one that extends to infinity (a half-space?)",
                                   .hint = "give the body a finite shape, or leave it out of the mesh"});
  }
  BlockRange range;
  for (int k = 0; k < 3; ++k) {
    const double low = std::floor((box.lower[k] - lattice.origin[k]) / lattice.cell) - margin;
    const double high = std::ceil((box.upper[k] - lattice.origin[k]) / lattice.cell) + margin;
    const double far = std::max(std::abs(low), std::abs(high));
    if (!(far <= kLargestNode)) {
      throw Error(ErrorKind::Limit,
                  {.place = "",
                   .key = "lattice.cell",
                   .expected = "expected node numbers up to " + three_digits(kLargestNode),
                   .found = three_digits(far) + " with cells of " + three_digits(lattice.cell) + " m",
                   .hint = "use cells of at least " + three_digits(1.05 * lattice.cell * far / kLargestNode) + " m"});
    }
    const auto slot = static_cast<std::size_t>(k);
    range.lower[slot] = static_cast<std::int32_t>(std::floor(low / kCells));
    range.upper[slot] = static_cast<std::int32_t>(std::floor(high / kCells));
  }
  return range;
}

BlockList refine_blocks(const BlockRange& range, const Lattice& lattice, std::uint32_t bodies,
                        const Executor& executor, const RefineOptions& options, const Decide& decide) {
  BlockList list;
  list.offset.push_back(0);
  if (range.empty()) return list;
  LevelPart level;
  level.candidate.resize(bodies);
  std::iota(level.candidate.begin(), level.candidate.end(), 0u);
  const int size = first_cubes(range, level.cube);
  for (Cube& cube : level.cube) cube.count = bodies;
  Refinement refinement(range, lattice, executor, options, decide);
  refinement.refine(std::move(level), size);
  LevelPart& found = refinement.found();
  list.inside = std::move(found.inside);
  std::sort(found.cube.begin(), found.cube.end(), [](const Cube& a, const Cube& b) { return before(a.at, b.at); });
  list.block.reserve(found.cube.size());
  list.offset.reserve(found.cube.size() + 1);
  list.candidate.reserve(found.candidate.size());
  for (const Cube& cube : found.cube) {
    list.block.push_back(cube.at);
    const auto first = found.candidate.begin() + cube.first;
    list.candidate.insert(list.candidate.end(), first, first + cube.count);
    list.offset.push_back(static_cast<std::uint32_t>(list.candidate.size()));
  }
  return list;
}

BlockList find_label_blocks(std::span<const FieldView> fields, std::span<const Box> surface, const Lattice& lattice,
                            const Executor& executor, std::uint64_t limit, PolygoniseCounts& counts) {
  Box all;
  for (const Box& box : surface) {
    if (is_bounded(box) && !box.empty()) all = all.united(box);
  }
  // One cell of margin: an edge that the surface crosses has one node outside the box of {F >= 0}.
  const BlockRange range = block_range(all, lattice, 1);
  counts.blocks_present = range.count();
  struct Candidate {
    std::uint32_t body;
    Interval value;
  };
  const Decide decide = [&](const Box& box, std::span<const std::uint32_t> candidates,
                            std::vector<std::uint32_t>& left) {
    thread_local std::vector<Candidate> found;
    found.clear();
    double largest_lower = 0.0;
    for (const std::uint32_t body : candidates) {
      if (!surface[body].overlaps(box)) continue;
      const Interval value = fields[body].bound(box);
      if (!(value.upper > 0.0)) continue;
      largest_lower = std::max(largest_lower, value.lower);
      found.push_back({body, value});
    }
    // A body below another one's lower bound everywhere is never the largest.
    std::erase_if(found, [&](const Candidate& c) { return c.value.upper < largest_lower; });
    const bool bounded =
        std::any_of(found.begin(), found.end(), [&](const Candidate& c) { return is_bounded(surface[c.body]); });
    if (!bounded) return Verdict::Outside;
    if (found.size() == 1 && found.front().value.lower > 0.0) return Verdict::Inside;
    for (const Candidate& c : found) left.push_back(c.body);
    return Verdict::Keep;
  };
  return refine_blocks(range, lattice, static_cast<std::uint32_t>(fields.size()), executor,
                       {.limit = limit, .look_factor = 4, .keep_inside = true}, decide);
}

std::optional<BlockRange> range_of_surface(const FieldView& field, const Lattice& lattice) {
  const Box surface = field.surface_box();
  const BlockRange range = block_range(surface, lattice, 1);
  const auto keeps = [&](const Cube& cube, int size) {
    const BlockBox blocks = blocks_of(cube.at, size, range);
    if (BlockRange{blocks.lower, blocks.upper}.empty()) return false;
    const Box box = world_box(blocks, lattice, kCells);
    if (!surface.overlaps(box)) return false;
    const Interval value = field.bound(box);
    return value.upper > 0.0 && !(value.lower > 0.0);
  };
  BlockRange out = range;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::optional<std::int32_t> last = outermost(range, axis, 1, keeps);
    const std::optional<std::int32_t> first = last ? outermost(range, axis, -1, keeps) : std::nullopt;
    if (!first) return std::nullopt;
    out.upper[axis] = *last;
    out.lower[axis] = -*first;
  }
  return out;
}

BlockList surface_blocks(const FieldView& field, const Lattice& lattice, const Executor& executor, std::uint64_t limit,
                         PolygoniseCounts& counts) {
  counts = {};
  const Box surface = field.surface_box();
  if (!surface.empty() && !is_bounded(surface)) (void)block_range(surface, lattice, 1);
  BlockList list = find_label_blocks({&field, 1}, {&surface, 1}, lattice, executor, limit, counts);
  counts.blocks_visited = list.block.size();
  return list;
}

}  // namespace lattice

void expect_divisible(std::span<const FieldView> fields, const Lattice& lattice, const Executor& executor) {
  std::vector<Box> surface;
  Box all;
  for (const FieldView& field : fields) {
    surface.push_back(field.surface_box());
    if (lattice::is_bounded(surface.back()) && !surface.back().empty()) all = all.united(surface.back());
  }
  if (lattice::block_range(all, lattice, 1).count() <= kMostBlocks) return;
  PolygoniseCounts counts;
  (void)lattice::find_label_blocks(fields, surface, lattice, executor, kMostBlocks, counts);
}

std::vector<std::array<std::int32_t, 3>> find_surface_blocks(const FieldView& field, const Lattice& lattice,
                                                             const Executor& executor, std::uint64_t limit,
                                                             PolygoniseCounts* counts) {
  PolygoniseCounts local;
  return std::move(lattice::surface_blocks(field, lattice, executor, limit, counts != nullptr ? *counts : local).block);
}

}  // namespace supple::implicit
