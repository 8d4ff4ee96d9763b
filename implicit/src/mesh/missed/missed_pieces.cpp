#include "supple/implicit/missed_pieces.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "bounds/weighted_bounds.h"
#include "bounds/eighth_bounds.h"
#include "mesh/cubes/march_cases.h"
#include "mesh/missed/missed_blobs.h"
#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/polygonise_junctions.h"
#include "mesh/partition/polygonise_roots.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

/// Of the finer lattice.
using Node = std::array<std::int64_t, 3>;

constexpr int kParts = kSearchParts;
/// The smallest cubes along an edge of the finer lattice; they only show whether a piece exists.
constexpr int kShift = 2, kUnits = 1 << kShift;
/// Largest number of cubes processed in a cell before it counts as undecided; without bounds of second order those of three halvings.
constexpr int kMostCubes = 10'000, kMostByValues = 8 + 64 + 512;
/// Smallest cubes of a cell that may stay undecided before the rest of it is given up, too.
constexpr int kMostOpen = 64;
/// Nodes of the finer lattice in a piece before it counts as undecided.
constexpr std::size_t kMostNodes = 4'000'000;
/// Vertices stay this far from the nodes [finer cells].
constexpr double kLeast = 0x1p-17;

Node stepped(Node node, int x, int y, int z) { return {node[0] + x, node[1] + y, node[2] + z}; }
Node corner_of(const Node& node, unsigned corner, int edge) {
  return stepped(node, edge * static_cast<int>(corner & 1u), edge * static_cast<int>(corner >> 1 & 1u), edge * static_cast<int>(corner >> 2));
}
/// Of the coarse lattice too.
bool is_coarse(const Node& node) { return (node[0] | node[1] | node[2]) % kParts == 0; }
/// Along the axes, to the nearest of the coarse lattice.
constexpr std::size_t kFarthest = 3 * kParts / 2;
std::size_t steps_to_coarse(const Node& node) {
  std::int64_t steps = 0;
  for (const std::int64_t i : node) steps += std::min(i & (kParts - 1), -i & (kParts - 1));
  return static_cast<std::size_t>(steps);
}
bool before(const Node& a, const Node& b) {
  return std::tie(a[2], a[1], a[0]) < std::tie(b[2], b[1], b[0]);
}
struct HashNode {
  std::size_t operator()(const Node& n) const noexcept {
    std::uint64_t h = 0;
    for (const std::int64_t i : n) h = (h ^ static_cast<std::uint64_t>(i)) * 0x9e3779b97f4a7c15;
    return static_cast<std::size_t>(h ^ h >> 29);
  }
};
using NodeSet = std::unordered_set<Node, HashNode>;

using lattice::Label;

/// A node of the finer lattice that may belong to a piece.
struct Seed {
  Node node;
  Label label;
};

class Labels {
 public:
  Labels(std::span<const WeightedField> weighted, const Lattice& fine) : weighted_(weighted), fine_(fine) {}
  /// Whose the nodes are; valid until the next call. @param candidates  ascending
  const std::vector<Label>& operator()(std::span<const Node> nodes, std::span<const std::uint32_t> candidates) {
    points_.clear();
    for (const Node& n : nodes) points_.push_back(lattice::node_position(fine_, n[0], n[1], n[2]));
    labels_.assign(nodes.size(), 0);
    best_.assign(nodes.size(), 0.0);
    values_.resize(nodes.size());
    for (const std::uint32_t body : candidates) {
      weighted_[body].evaluate(points_, values_);
      for (std::size_t i = 0; i < values_.size(); ++i) {
        if (!(values_[i] > best_[i])) continue;
        best_[i] = values_[i];
        labels_[i] = body + 1;
      }
    }
    return labels_;
  }

 private:
  std::span<const WeightedField> weighted_;
  const Lattice& fine_;
  std::vector<Vec3> points_;
  std::vector<double> values_, best_;
  std::vector<Label> labels_;
};

/// Searches for extrema in a block of 8^3 cells. Cubes are measured in the smallest of them.
class BlockSearch {
 public:
  BlockSearch(std::span<const WeightedField> weighted, const Lattice& fine)
      : weighted_(weighted), unit_{.origin = fine.origin, .cell = fine.cell / kUnits}, bounds_(weighted), labels_(weighted, fine),
        by_eighths_(weighted.size() == 1 && EighthBounds::know(weighted[0].field())) {}

  /// @param bodies  that may have a part of the block  @param reaching  all whose supports may reach it
  void search(const lattice::BlockCoord& block, std::span<const std::uint32_t> bodies, std::span<const std::uint32_t> reaching,
      std::vector<Seed>& seeds, MissedPieces& counts) {
    bodies_ = bodies;
    seeds_ = &seeds;
    counts_ = &counts;
    find_candidates(weighted_, box_of(lowest_of(block), kEdge), reaching, candidates_[0]);
    by_eighths_ ? halve(lowest_of(block), kEdge, 0) : search_eighths(lowest_of(block), kEdge, 0);
  }

  /// The same for some of its cells, of a single body.
  void search(const OpenCells& open, std::vector<Seed>& seeds, MissedPieces& counts) {
    static constexpr std::uint32_t kOnly = 0;
    bodies_ = {&kOnly, 1};
    seeds_ = &seeds;
    counts_ = &counts;
    const Node low = lowest_of(open.block);
    find_candidates(weighted_, box_of(low, kEdge), bodies_, candidates_[kLevels - 2]);
    for (const auto& [x, y, z] : open.cell) search_cell(stepped(low, kCell * x, kCell * y, kCell * z));
  }

 private:
  static constexpr int kCell = kParts * kUnits, kEdge = lattice::kCells * kCell;
  static constexpr std::size_t kLevels = 4;  ///< of cubes from a block to a cell, each with candidates for its parts

  static Node lowest_of(const lattice::BlockCoord& block) {
    return {std::int64_t{kEdge} * block[0], std::int64_t{kEdge} * block[1], std::int64_t{kEdge} * block[2]};
  }

  /// search_eighths for a single body, eight cubes side by side; the remaining cells are processed with all bounds.
  void halve(const Node& at, int edge, std::size_t level) {
    EighthBounds& bounds = eighths_[level];
    const unsigned settled = bounds(weighted_[0].field(), box_of(at, edge), candidates_[level].primitive).settled();
    counts_->cubes += 8;
    for (unsigned c = 0; c < 8; ++c) {
      if ((settled >> c & 1u) != 0) continue;
      const Node half = corner_of(at, c, edge / 2);
      if (edge / 2 == kCell) {
        search_cell(half);
        continue;
      }
      Candidates& candidates = candidates_[level + 1];
      bounds.narrow(c, candidates.primitive);
      candidates.body = candidates_[level].body;
      candidates.offset = {0, static_cast<std::uint32_t>(candidates.primitive.size())};
      halve(half, edge / 2, level + 1);
    }
  }

  /// @param edge  of a cube of several cells  @param level  its own
  void search_eighths(const Node& at, int edge, std::size_t level) {
    // Second derivatives vary too far over larger cubes.
    const std::array<Verdict, 8> eighth = edge == 2 * kCell ? bounds_.eighths(box_of(at, edge)) : std::array<Verdict, 8>{};
    for (unsigned c = 0; c < 8; ++c) {
      if (eighth[c].settled()) continue;
      const Node half = corner_of(at, c, edge / 2);
      if (edge / 2 == kCell) {
        search_cell(half);
      } else if (!look(half, edge / 2, level + 1).settled()) {
        search_eighths(half, edge / 2, level + 1);
      }
    }
  }

  Verdict look(const Node& at, int edge, std::size_t level) {
    ++counts_->cubes;
    const Verdict verdict = bounds_(box_of(at, edge), candidates_[level - 1], false);
    if (!verdict.settled()) bounds_.narrow(candidates_[level]);
    return verdict;
  }

  void search_cell(const Node& cell) {
    const Verdict verdict = look(cell, kCell, kLevels - 1);
    if (verdict.settled()) return;
    std::array<Node, 8> corner;
    for (unsigned c = 0; c < 8; ++c) corner[c] = node_near(corner_of(cell, c, kCell));
    const std::vector<Label>& label = labels_(corner, bodies_);
    std::copy(label.begin(), label.end(), corners_.begin());
    cell_ = corner[0];
    left_ = verdict.second_order ? kMostCubes : kMostByValues;
    open_ = kMostOpen;
    undecided_ = !verdict.second_order && std::any_of(corners_.begin(), corners_.end(), [&](Label l) { return l != corners_[0]; });
    if (!undecided_) search_parts(cell, kCell);
    counts_->undecided += undecided_ ? 1 : 0;
  }

  /// @pre bounds_ were evaluated for it last
  void search_parts(const Node& at, int edge) {
    const std::array<Verdict, 8> eighth = bounds_.eighths(box_of(at, edge));
    for (unsigned c = 0; c < 8; ++c) {
      if (--left_ < 0) {
        undecided_ = true;
        return;
      }
      if (eighth[c].flat) continue;
      ++counts_->cubes;
      const Node part = corner_of(at, c, edge / 2);
      // An eighth of the cell has a node of its own: what is certain of it need not be flat.
      const Verdict verdict = bounds_(box_of(part, edge / 2), candidates_[kLevels - 1], edge < kCell);
      if (verdict.flat) continue;
      if (verdict.certain) {
        look_at(part, edge / 2, verdict.label);
      } else if (edge / 2 > 1) {
        search_parts(part, edge / 2);
      } else {
        undecided_ = true;
        look_around(part);
        if (--open_ == 0) left_ = 0;
      }
    }
  }

  /// A part of the cell that is all one label's: it belongs to a piece unless it hangs together with a node of the lattice.
  void look_at(const Node& part, int edge, Label label) {
    if (edge == kCell / 2) return;  // has one of its own
    const Node node = node_near(edge > kUnits ? stepped(part, edge / 2, edge / 2, edge / 2) : part);
    if (edge >= kUnits || labels_({&node, 1}, bodies_)[0] == label) {
      add_unless_joined(node, label);
    } else {
      look_around(part);
      undecided_ = true;
    }
  }

  /// The nodes of the finer lattice around a smallest cube.
  void look_around(const Node& part) {
    std::array<Node, 8> corner;
    for (unsigned k = 0; k < 8; ++k) corner[k] = corner_of({part[0] >> kShift, part[1] >> kShift, part[2] >> kShift}, k, 1);
    const std::vector<Label> label = labels_(corner, bodies_);
    for (unsigned k = 0; k < 8; ++k) add_unless_joined(corner[k], label[k]);
  }

  /// The node of the finer lattice that is nearest to one of the smallest cubes' corners.
  static Node node_near(Node at) {
    for (std::int64_t& i : at) i = (i + kUnits / 2) >> kShift;
    return at;
  }

  /// By straight ways along the axes to corners of the cell with the same label.
  void add_unless_joined(const Node& node, Label own) {
    for (unsigned c = 0; c < 8; ++c) {
      if (corners_[c] != own) continue;
      const Node to = corner_of(cell_, c, kParts);
      way_.assign(1, node);
      for (std::size_t k = 0; k < 3; ++k) {
        while (way_.back()[k] != to[k]) {
          Node next = way_.back();
          next[k] += to[k] > next[k] ? 1 : -1;
          way_.push_back(next);
        }
      }
      const std::vector<Label>& label = labels_(way_, bodies_);
      if (std::all_of(label.begin(), label.end(), [&](Label l) { return l == own; })) return;
    }
    seeds_->push_back({node, own});
  }

  [[nodiscard]] Box box_of(const Node& at, int edge) const {
    return {lattice::node_position(unit_, at[0], at[1], at[2]), lattice::node_position(unit_, at[0] + edge, at[1] + edge, at[2] + edge)};
  }

  std::span<const WeightedField> weighted_;
  Lattice unit_;
  CubeBounds bounds_;
  Labels labels_;
  bool by_eighths_;
  std::array<EighthBounds, kLevels - 1> eighths_;
  std::span<const std::uint32_t> bodies_;
  std::array<Candidates, kLevels> candidates_;
  std::vector<Seed>* seeds_ = nullptr;
  MissedPieces* counts_ = nullptr;
  Node cell_{};
  std::array<Label, 8> corners_{};  ///< of the cell
  int left_ = 0, open_ = 0;
  bool undecided_ = false;
  std::vector<Node> way_;
};

struct Flood {
  enum class End { Closed, Joined, Known, Several, TooLarge };
  End end;
  Label beyond;   ///< the label around the nodes
  Node coarse{};  ///< where it joined, the node of the coarse lattice
};

/// The nodes of one label that are connected to a seed: those of a body along edges, those outside across faces of cells too, as in
/// march_cases.h. Stops at a node of the coarse lattice or of another part.
/// @param part  its nodes
Flood flood(const Seed& seed, const NodeSet& known, std::span<const std::uint32_t> bodies, Labels& labels, NodeSet& part) {
  using enum Flood::End;
  // by steps to the nearest node of the coarse lattice: those near it first
  std::array<std::vector<Node>, kFarthest + 1> front;
  std::vector<Node> from, next;
  NodeSet other;
  bool several = false;
  Label beyond = seed.label;
  part.insert(seed.node);
  front[steps_to_coarse(seed.node)].push_back(seed.node);
  for (auto nearest = front.begin(); nearest != front.end();) {
    if (nearest->empty()) {
      ++nearest;
      continue;
    }
    from.clear();
    from.swap(*nearest);
    next.clear();
    for (const Node& node : from) {
      if (known.contains(node)) return {Known, beyond};
      if (is_coarse(node)) return {Joined, beyond, node};
      for (int step = 0; step < 27; ++step) {
        const int x = step % 3 - 1, y = step / 3 % 3 - 1, z = step / 9 - 1;
        const int far = std::abs(x) + std::abs(y) + std::abs(z);
        if (far == 0 || far > (seed.label != 0 ? 1 : 2)) continue;
        const Node to = stepped(node, x, y, z);
        if (!part.contains(to) && other.insert(to).second) next.push_back(to);
      }
    }
    const std::vector<Label>& label = labels(next, bodies);
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (label[i] != seed.label) {
        several = several || (beyond != seed.label && beyond != label[i]);
        beyond = label[i];
        continue;
      }
      other.erase(next[i]);
      part.insert(next[i]);
      front[steps_to_coarse(next[i])].push_back(next[i]);
    }
    nearest = front.begin();
    if (part.size() > kMostNodes) return {TooLarge, beyond};
  }
  return {several ? Several : Closed, beyond};
}

/// The crossed edges around one piece, as they are requested, and the roots of its weighted field's difference to that around it.
class PieceVertices {
 public:
  PieceVertices(const Lattice& fine, const FieldView& plus, const FieldView& minus) : fine_(fine), plus_(plus), minus_(minus) {}

  std::uint32_t number(const Node& base, std::size_t axis) {
    const auto [at, is_new] = number_[axis].try_emplace(base, static_cast<std::uint32_t>(edge_.size()));
    if (is_new) edge_.emplace_back(base, axis);
    return at->second;
  }
  void solve() {
    std::vector<Vec3> ends;
    for (const auto& [base, axis] : edge_) {
      Node end = base;
      ++end[axis];
      for (const Node& n : {base, end}) ends.push_back(lattice::node_position(fine_, n[0], n[1], n[2]));
    }
    std::vector<double> value(ends.size()), less(ends.size());
    plus_.evaluate(ends, value);
    if (minus_) minus_.evaluate(ends, less);
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    double scale = 0.0;
    for (std::size_t i = 0; i < ends.size(); i += 2) {
      const double low = value[i] - less[i], high = value[i + 1] - less[i + 1];
      scale = std::max({scale, std::abs(value[i]), std::abs(less[i]), std::abs(value[i + 1]), std::abs(less[i + 1])});
      roots_.add(ends[i], ends[i + 1], low, high, lattice::guess_root(kNone, low, high, kNone));
    }
    roots_.solve(plus_, minus_, scale);
  }
  [[nodiscard]] std::size_t size() const { return edge_.size(); }
  [[nodiscard]] Vec3 point(std::size_t i) const {
    const auto& [base, axis] = edge_[i];
    const auto k = static_cast<Eigen::Index>(axis);
    const double low = lattice::node_position(fine_, base[0], base[1], base[2])[k];
    Vec3 p = roots_.point(i);
    p[k] = std::clamp(p[k], low + kLeast * fine_.cell, low + (1.0 - kLeast) * fine_.cell);
    return p;
  }
  /// From `plus` to `minus`.
  [[nodiscard]] Vec3 normal(std::size_t i, const Vec3& fallback) const {
    const double slope = roots_.gradient(i).norm();
    return slope > 0.0 ? Vec3(-roots_.gradient(i) / slope) : fallback;
  }
  [[nodiscard]] const std::pair<Node, std::size_t>& edge(std::size_t i) const { return edge_[i]; }

 private:
  const Lattice& fine_;
  FieldView plus_, minus_;
  std::array<std::unordered_map<Node, std::uint32_t, HashNode>, 3> number_;  // by axis
  std::vector<std::pair<Node, std::size_t>> edge_;
  lattice::EdgeRoots roots_;
};

/// Marching cubes around the nodes of one piece, for the bodies on both sides of it.
void add_piece(std::span<const WeightedField> weighted, const Lattice& fine, const NodeSet& part, Label own, Label beyond, std::span<Mesh> meshes) {
  std::vector<Node> cells;
  for (const Node& node : part) {
    for (unsigned c = 0; c < 8; ++c) cells.push_back(corner_of(node, c, -1));
  }
  std::sort(cells.begin(), cells.end(), before);  // `part` has no order
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  const bool body = own != 0;  // or a cavity in one
  const Label inner = body ? own : beyond, outer = body ? beyond : 0;
  PieceVertices vertices(fine, weighted[inner - 1], outer != 0 ? FieldView(weighted[outer - 1]) : FieldView());
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const Node& cell : cells) {
    unsigned corners = 0;
    for (unsigned c = 0; c < 8; ++c) corners |= (part.contains(corner_of(cell, c, 1)) == body ? 1u : 0u) << c;
    const march::CellLoops& loops = march::kCellLoops[corners];
    for (std::size_t l = 0; l < loops.loops; ++l) {
      const march::Loop& loop = loops.loop[l];
      std::array<std::uint32_t, 7> ring{};
      const auto apex = static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(loop.apices)));
      for (std::size_t k = 0; k < loop.size; ++k) {
        const march::CellEdge edge = march::kCellEdge[loop.edge[(apex + k) % loop.size]];
        ring[k] = vertices.number(corner_of(cell, edge.corner, 1), edge.axis);
      }
      for (std::size_t k = 2; k < loop.size; ++k) triangles.push_back({ring[0], ring[k - 1], ring[k]});
    }
  }
  vertices.solve();
  const auto add_to = [&](Mesh& mesh, bool outwards, Label contact) {
    const auto first = static_cast<std::uint32_t>(mesh.vertex_count());
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const auto& [base, axis] = vertices.edge(i);
      const double along = part.contains(base) == body ? 1.0 : -1.0;
      const Vec3 normal = vertices.normal(i, along * Vec3::Unit(static_cast<Eigen::Index>(axis)));
      mesh.position.push_back(vertices.point(i));
      mesh.normal.push_back(outwards ? normal : Vec3(-normal));
      for (auto& column : mesh.columns) column.values.push_back(static_cast<double>(contact));
    }
    for (const auto& t : triangles) {
      mesh.triangle.push_back(outwards ? std::array{first + t[0], first + t[1], first + t[2]} : std::array{first + t[0], first + t[2], first + t[1]});
    }
  };
  add_to(meshes[inner - 1], true, outer);
  if (outer != 0) add_to(meshes[outer - 1], false, inner);
}

/// For each block of a list, ascending, the weighted fields whose supports may reach it: those of block i are weighted field[offset[i]] up to weighted field[offset[i + 1]].
struct Reaching {
  std::vector<std::size_t> offset;
  std::vector<std::uint32_t> weighted_field;
};
Reaching find_reaching(std::span<const WeightedField> weighted, const Lattice& lattice, std::span<const lattice::BlockCoord> blocks) {
  Box all;
  const auto corner = [&](const lattice::BlockCoord& at, int add) {
    return lattice::node_position(lattice, lattice::kCells * (std::int64_t{at[0]} + add), lattice::kCells * (std::int64_t{at[1]} + add),
                                  lattice::kCells * (std::int64_t{at[2]} + add));
  };
  for (const lattice::BlockCoord& at : blocks) all = all.united({corner(at, 0), corner(at, 1)});
  std::vector<std::vector<std::uint32_t>> reach(blocks.size());
  for (std::uint32_t c = 0; c < weighted.size(); ++c) {
    const auto [low, high] = lattice::block_range(weighted[c].support_box().intersection(all), lattice, 0);
    for (std::int32_t z = low[2]; z <= high[2]; ++z) {
      for (std::int32_t y = low[1]; y <= high[1]; ++y) {
        auto at = std::lower_bound(blocks.begin(), blocks.end(), lattice::BlockCoord{low[0], y, z}, lattice::before);
        for (; at != blocks.end() && (*at)[2] == z && (*at)[1] == y && (*at)[0] <= high[0]; ++at) {
          reach[static_cast<std::size_t>(at - blocks.begin())].push_back(c);
        }
      }
    }
  }
  Reaching found;
  found.offset.assign(1, 0);
  for (const std::vector<std::uint32_t>& some : reach) {
    found.weighted_field.insert(found.weighted_field.end(), some.begin(), some.end());
    found.offset.push_back(found.weighted_field.size());
  }
  return found;
}

/// Results of the searches of blocks.
struct BlockSeeds {
  std::vector<Seed> seeds;
  MissedPieces counts;
};

/// Block by block, cubes one at a time.
std::vector<BlockSeeds> search_blocks(std::span<const WeightedField> weighted, const Lattice& lattice, const Lattice& fine,
    const Executor& executor) {
  std::vector<FieldView> views;
  std::vector<Box> surface;
  for (const WeightedField& weighted_field : weighted) {
    views.emplace_back(weighted_field);
    surface.push_back(weighted_field.surface_box());
  }
  PolygoniseCounts blocks_looked_at;
  const lattice::BlockList blocks = lattice::find_label_blocks(views, surface, lattice, executor, kMostBlocks, blocks_looked_at);
  const Reaching reaching = find_reaching(weighted, lattice, blocks.block);
  std::vector<BlockSeeds> found(blocks.block.size());
  executor.for_blocks(found.size(), 1, [&](std::size_t begin, std::size_t end) {
    BlockSearch search(weighted, fine);
    for (std::size_t b = begin; b < end; ++b) {
      search.search(blocks.block[b], std::span(blocks.candidate).subspan(blocks.offset[b], blocks.offset[b + 1] - blocks.offset[b]),
                    std::span(reaching.weighted_field).subspan(reaching.offset[b], reaching.offset[b + 1] - reaching.offset[b]),
                    found[b].seeds, found[b].counts);
    }
  });
  return found;
}

/// The same for a sum of Wyvill points: the cubes that remain open after processing many at a time.
std::vector<BlockSeeds> search_blobs(const Field& field, std::span<const WeightedField> weighted, const Lattice& lattice,
    const Lattice& fine, const Executor& executor) {
  std::uint64_t cubes = 0;
  const std::vector<OpenCells> open = find_open_cells(field, lattice, executor, cubes);
  std::vector<BlockSeeds> found(open.size() + 1);
  found.back().counts.cubes = cubes;
  executor.for_blocks(open.size(), 1, [&](std::size_t begin, std::size_t end) {
    BlockSearch search(weighted, fine);
    for (std::size_t b = begin; b < end; ++b) search.search(open[b], found[b].seeds, found[b].counts);
  });
  return found;
}

MissedPieces add_missed(std::span<const SearchedBody> bodies, const Lattice& lattice, const Executor& executor, std::span<Mesh> meshes) {
  const Lattice fine{.origin = lattice.origin, .cell = lattice.cell / kParts};
  std::vector<WeightedField> weighted;
  for (const SearchedBody& body : bodies) weighted.emplace_back(body);
  const bool blobs = bodies.size() == 1 && is_sum_of_blobs(*bodies[0].field);
  const std::vector<BlockSeeds> blocks =
      blobs ? search_blobs(*bodies[0].field, weighted, lattice, fine, executor)
          : search_blocks(weighted, lattice, fine, executor);
  std::vector<std::uint32_t> all(bodies.size());
  std::iota(all.begin(), all.end(), 0u);
  MissedPieces found;
  Labels labels(weighted, fine);
  NodeSet known;   // of parts that were processed
  NodeSet joined;  // where they met the coarse lattice
  for (const BlockSeeds& block : blocks) {
    found.undecided += block.counts.undecided;
    found.cubes += block.counts.cubes;
    for (const Seed& seed : block.seeds) {
      NodeSet part;
      const auto [end, beyond, node] = flood(seed, known, all, labels, part);
      using enum Flood::End;
      if (end == Closed) add_piece(weighted, fine, part, seed.label, beyond, meshes);
      found.pieces += end == Closed ? 1 : 0;
      found.joined += end == Joined && joined.insert(node).second ? 1 : 0;
      found.undecided += end == TooLarge || end == Several ? 1 : 0;
      known.merge(part);
    }
  }
  return found;
}

}  // namespace

MissedPieces add_missed_pieces(const Field& field, const Lattice& lattice, const Executor& executor, Mesh& mesh) {
  SUPPLE_EXPECTS(mesh.columns.empty());
  const SearchedBody body{.field = &field};
  return add_missed({&body, 1}, lattice, executor, {&mesh, 1});
}

MissedPieces add_missed_pieces(std::span<const SearchedBody> bodies, const Lattice& lattice, const Executor& executor,
                               std::span<Mesh> meshes) {
  SUPPLE_EXPECTS(meshes.size() == bodies.size());
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    SUPPLE_EXPECTS(bodies[m].weight > 0.0 && meshes[m].columns.size() == 1 && meshes[m].columns[0].name == "contact");
  }
  return add_missed(bodies, lattice, executor, meshes);
}

}  // namespace supple::implicit
