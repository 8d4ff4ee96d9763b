#include "supple/implicit/missed_pieces.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "march_cases.h"
#include "polygonise_lattice.h"
#include "supple/core/error.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

/// Of the finer lattice.
using Node = std::array<std::int64_t, 3>;

constexpr int kParts = kSearchParts;
/// The smallest cubes along an edge of the finer lattice; they only tell whether something is there.
constexpr int kShift = 2, kUnits = 1 << kShift;
/// Cubes that are looked at in a cell before it counts as undecided; without bounds of second order those of three halvings.
constexpr int kMostCubes = 10'000, kMostByValues = 8 + 64 + 512;
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

/// A node of the finer lattice, and whether it is inside, that may belong to a piece.
struct Seed {
  Node node;
  bool inside;
};

class Signs {
 public:
  Signs(const Field& field, const Lattice& fine) : field_(field), fine_(fine) {}
  /// Whether nodes are inside; valid until the next call.
  const std::vector<double>& operator()(std::span<const Node> nodes) {
    points_.clear();
    for (const Node& n : nodes) points_.push_back(lattice::node_position(fine_, n[0], n[1], n[2]));
    values_.resize(points_.size());
    field_.evaluate(points_, values_);
    return values_;
  }

 private:
  const Field& field_;
  const Lattice& fine_;
  std::vector<Vec3> points_;
  std::vector<double> values_;
};

/// Looks for the extrema of F in a block of 8^3 cells. Cubes are measured in the smallest of them.
class BlockSearch {
 public:
  BlockSearch(const Field& field, const Lattice& fine)
      : field_(field), unit_{.origin = fine.origin, .cell = fine.cell / kUnits}, signs_(field, fine) {}

  void search(const lattice::BlockCoord& block, std::vector<Seed>& seeds, MissedPieces& counts) {
    seeds_ = &seeds;
    counts_ = &counts;
    constexpr int kEdge = lattice::kCells * kCell;
    halve({std::int64_t{kEdge} * block[0], std::int64_t{kEdge} * block[1], std::int64_t{kEdge} * block[2]}, kEdge);
  }

 private:
  static constexpr int kCell = kParts * kUnits;

  /// @param edge  of a cube of several cells
  void halve(const Node& at, int edge) {
    for (unsigned c = 0; c < 8; ++c) {
      const Node half = corner_of(at, c, edge / 2);
      if (edge / 2 == kCell) {
        search_cell(half);
        continue;
      }
      ++counts_->cubes;
      const Interval value = field_.bound(box_of(half, edge / 2));
      if (value.lower <= 0.0 && value.upper > 0.0) halve(half, edge / 2);
    }
  }

  void search_cell(const Node& cell) {
    ++counts_->cubes;
    const Field::BoxBounds bounds = field_.box_bounds(box_of(cell, kCell));
    if (excludes(bounds)) return;
    std::array<Node, 8> corner;
    for (unsigned c = 0; c < 8; ++c) corner[c] = node_near(corner_of(cell, c, kCell));
    const std::vector<double>& value = signs_(corner);
    corners_ = 0;
    for (unsigned c = 0; c < 8; ++c) corners_ |= (value[c] > 0.0 ? 1u : 0u) << c;
    cell_ = corner[0];
    left_ = bounds.second_order ? kMostCubes : kMostByValues;
    undecided_ = !bounds.second_order && corners_ != 0 && corners_ != 255;
    if (!undecided_) search_parts(cell, kCell);
    counts_->undecided += undecided_ ? 1 : 0;
  }

  void search_parts(const Node& at, int edge) {
    for (unsigned c = 0; c < 8; ++c) {
      if (--left_ < 0) {
        undecided_ = true;
        return;
      }
      ++counts_->cubes;
      const Node part = corner_of(at, c, edge / 2);
      const Field::BoxBounds bounds = field_.box_bounds(box_of(part, edge / 2));
      if (bounds.least_slope > 0.0) continue;
      if (bounds.value.lower > 0.0 || bounds.value.upper <= 0.0) {
        look_at(part, edge / 2, bounds.value.lower > 0.0);
      } else if (edge / 2 > 1) {
        search_parts(part, edge / 2);
      } else {
        undecided_ = true;
        look_around(part);
      }
    }
  }

  /// A part of the cell where F keeps its sign: it belongs to a piece unless it hangs together with a node of the lattice.
  void look_at(const Node& part, int edge, bool inside) {
    if (edge == kCell / 2) return;  // has one of its own
    const Node node = node_near(edge > kUnits ? stepped(part, edge / 2, edge / 2, edge / 2) : part);
    if (edge >= kUnits || (signs_({&node, 1})[0] > 0.0) == inside) {
      add_unless_joined(node, inside);
    } else {
      look_around(part);
      undecided_ = true;
    }
  }

  /// The nodes of the finer lattice around a smallest cube.
  void look_around(const Node& part) {
    std::array<Node, 8> corner;
    for (unsigned k = 0; k < 8; ++k) corner[k] = corner_of({part[0] >> kShift, part[1] >> kShift, part[2] >> kShift}, k, 1);
    const std::vector<double> value = signs_(corner);
    for (unsigned k = 0; k < 8; ++k) add_unless_joined(corner[k], value[k] > 0.0);
  }

  /// The node of the finer lattice that is nearest to one of the smallest cubes' corners.
  static Node node_near(Node at) {
    for (std::int64_t& i : at) i = (i + kUnits / 2) >> kShift;
    return at;
  }

  /// By straight ways along the axes to corners of the cell with the same sign.
  void add_unless_joined(const Node& node, bool inside) {
    for (unsigned c = 0; c < 8; ++c) {
      if ((corners_ >> c & 1u) != (inside ? 1u : 0u)) continue;
      const Node to = corner_of(cell_, c, kParts);
      way_.assign(1, node);
      for (std::size_t k = 0; k < 3; ++k) {
        while (way_.back()[k] != to[k]) {
          Node next = way_.back();
          next[k] += to[k] > next[k] ? 1 : -1;
          way_.push_back(next);
        }
      }
      const std::vector<double>& value = signs_(way_);
      if (std::all_of(value.begin(), value.end(), [&](double v) { return (v > 0.0) == inside; })) return;
    }
    seeds_->push_back({node, inside});
  }

  /// Neither a piece nor a part of one has its extremum there.
  static bool excludes(const Field::BoxBounds& bounds) {
    return bounds.value.lower > 0.0 || bounds.value.upper <= 0.0 || bounds.least_slope > 0.0;
  }
  [[nodiscard]] Box box_of(const Node& at, int edge) const {
    return {lattice::node_position(unit_, at[0], at[1], at[2]), lattice::node_position(unit_, at[0] + edge, at[1] + edge, at[2] + edge)};
  }

  const Field& field_;
  Lattice unit_;
  Signs signs_;
  std::vector<Seed>* seeds_ = nullptr;
  MissedPieces* counts_ = nullptr;
  Node cell_{};
  unsigned corners_ = 0;  ///< of the cell that are inside
  int left_ = 0;
  bool undecided_ = false;
  std::vector<Node> way_;
};

enum class Flood { Closed, Joined, Known, TooLarge };

/// The nodes of one sign that hang together with a seed: those inside along edges, those outside across faces of cells too, as in
/// march_cases.h. Ends at a node of the coarse lattice or of another part.
Flood flood(const Seed& seed, const NodeSet& known, Signs& signs, NodeSet& part) {
  std::vector<Node> front{seed.node}, next;
  NodeSet other;
  part.insert(seed.node);
  while (!front.empty()) {
    next.clear();
    for (const Node& node : front) {
      if (known.contains(node)) return Flood::Known;
      if (is_coarse(node)) return Flood::Joined;
      for (int step = 0; step < 27; ++step) {
        const int x = step % 3 - 1, y = step / 3 % 3 - 1, z = step / 9 - 1;
        const int far = std::abs(x) + std::abs(y) + std::abs(z);
        if (far == 0 || far > (seed.inside ? 1 : 2)) continue;
        const Node to = stepped(node, x, y, z);
        if (!part.contains(to) && other.insert(to).second) next.push_back(to);
      }
    }
    const std::vector<double>& value = signs(next);
    front.clear();
    for (std::size_t i = 0; i < next.size(); ++i) {
      if ((value[i] > 0.0) != seed.inside) continue;
      other.erase(next[i]);
      part.insert(next[i]);
      front.push_back(next[i]);
    }
    if (part.size() > kMostNodes) return Flood::TooLarge;
  }
  return Flood::Closed;
}

/// Marching cubes around the nodes of one piece.
void add_piece(const Field& field, const Lattice& fine, const NodeSet& part, bool inside, Mesh& mesh) {
  std::vector<Node> cells;
  for (const Node& node : part) {
    for (unsigned c = 0; c < 8; ++c) cells.push_back(corner_of(node, c, -1));
  }
  std::sort(cells.begin(), cells.end(), before);
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::array<std::unordered_map<Node, std::uint32_t, HashNode>, 3> number;  // of vertices, by axis
  const auto vertex = [&](const Node& base, std::size_t axis) {
    const auto [at, is_new] = number[axis].try_emplace(base, static_cast<std::uint32_t>(mesh.vertex_count()));
    if (!is_new) return at->second;
    Node end = base;
    ++end[axis];
    const Vec3 a = lattice::node_position(fine, base[0], base[1], base[2]), b = lattice::node_position(fine, end[0], end[1], end[2]);
    const auto k = static_cast<Eigen::Index>(axis);
    Vec3 point = root_on_segment(field, a, b);
    point[k] = std::clamp(point[k], a[k] + kLeast * fine.cell, b[k] - kLeast * fine.cell);
    std::array<double, 1> value{};
    std::array<Vec3, 1> gradient;
    field.evaluate({&point, 1}, value, gradient);
    const double slope = gradient[0].norm();
    const bool outwards = part.contains(base) == inside;
    mesh.position.push_back(point);
    mesh.normal.push_back(slope > 0.0 ? Vec3(-gradient[0] / slope) : Vec3((outwards ? 1.0 : -1.0) * Vec3::Unit(k)));
    return at->second;
  };
  for (const Node& cell : cells) {
    unsigned corners = 0;
    for (unsigned c = 0; c < 8; ++c) corners |= (part.contains(corner_of(cell, c, 1)) == inside ? 1u : 0u) << c;
    const march::CellLoops& loops = march::kCellLoops[corners];
    for (std::size_t l = 0; l < loops.loops; ++l) {
      const march::Loop& loop = loops.loop[l];
      std::array<std::uint32_t, 7> ring{};
      const auto apex = static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(loop.apices)));
      for (std::size_t k = 0; k < loop.size; ++k) {
        const march::CellEdge edge = march::kCellEdge[loop.edge[(apex + k) % loop.size]];
        ring[k] = vertex(corner_of(cell, edge.corner, 1), edge.axis);
      }
      for (std::size_t k = 2; k < loop.size; ++k) mesh.triangle.push_back({ring[0], ring[k - 1], ring[k]});
    }
  }
}

}  // namespace

MissedPieces add_missed_pieces(const Field& field, const Lattice& lattice, const Executor& executor, Mesh& mesh) {
  SUPPLE_EXPECTS(mesh.columns.empty());
  const Lattice fine{.origin = lattice.origin, .cell = lattice.cell / kParts};
  const auto blocks = find_surface_blocks(field, lattice, executor);
  std::vector<std::vector<Seed>> seeds(blocks.size());
  std::vector<MissedPieces> counts(blocks.size());
  executor.for_blocks(blocks.size(), 1, [&](std::size_t begin, std::size_t end) {
    BlockSearch search(field, fine);
    for (std::size_t b = begin; b < end; ++b) search.search(blocks[b], seeds[b], counts[b]);
  });
  MissedPieces found;
  Signs signs(field, fine);
  NodeSet known;  // of parts that were looked at
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    found.undecided += counts[b].undecided;
    found.cubes += counts[b].cubes;
    for (const Seed& seed : seeds[b]) {
      NodeSet part;
      const Flood end = flood(seed, known, signs, part);
      if (end == Flood::Closed) add_piece(field, fine, part, seed.inside, mesh);
      found.pieces += end == Flood::Closed ? 1 : 0;
      found.joined += end == Flood::Joined ? 1 : 0;
      found.undecided += end == Flood::TooLarge ? 1 : 0;
      known.merge(part);
    }
  }
  return found;
}

}  // namespace supple::implicit
