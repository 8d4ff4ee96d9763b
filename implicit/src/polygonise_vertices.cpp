#include <algorithm>
#include <cmath>

#include "polygonise_block_edges.h"
#include "polygonise_partition.h"
#include "supple/implicit/project.h"

namespace supple::implicit::lattice {

std::size_t Labeller::slot_of(Label label) const {
  return static_cast<std::size_t>(std::lower_bound(candidates_.begin(), candidates_.end(), label - 1) -
                                  candidates_.begin());
}

void Labeller::label_nodes() {
  values_.resize(candidates_.size() * kBlockNodes);
  scale_.assign(candidates_.size(), 0.0);
  std::array<double, kBlockNodes> best{};
  label_.fill(0);
  for (std::size_t slot = 0; slot < candidates_.size(); ++slot) {
    const std::span<double> values(values_.data() + slot * kBlockNodes, kBlockNodes);
    fields_[candidates_[slot]].evaluate(nodes_, values);
    for (std::size_t n = 0; n < kBlockNodes; ++n) {
      scale_[slot] = std::max(scale_[slot], std::abs(values[n]));
      if (values[n] > best[n]) {
        best[n] = values[n];
        label_[n] = candidates_[slot] + 1;
      }
    }
  }
}

void Labeller::mark_edges(LabelledBlock& block) {
  for (int z = 0; z < kCells; ++z) {
    for (int y = 0; y < kCells; ++y) {
      for (unsigned mask = 1; mask <= kDirections; ++mask) {
        unsigned bits = 0;
        for (int x = 0; x < kCells; ++x) {
          const Cell cell{x, y, z};
          bits |= static_cast<unsigned>(label_[cell.node(0)] != label_[cell.node(mask)]) << x;
        }
        block.edges.set_row(EdgeSet::row_of(y, z, mask), static_cast<std::uint8_t>(bits));
      }
    }
  }
  block.edge_count = block.edges.close();
}

/// Roots of the edges between two labels, in one batch.
void Labeller::solve_edges(const LabelledBlock& block, Label low, Label high, PartitionVertices& out) {
  const std::size_t plus = slot_of(low == 0 ? high : low), minus = slot_of(high);
  roots_.clear();
  std::size_t i = 0;
  for_edges(block.edges, [&](int x, int y, int z, unsigned mask) {
    const EdgeVertex& vertex = edge_vertex_[i++];
    if (vertex.low != low || vertex.high != high) return;
    const auto f = [&](int at) {
      const auto node = static_cast<std::size_t>(at);
      return low == 0 ? value(plus, node) : value(plus, node) - value(minus, node);
    };
    add_edge(x, y, z, mask, nodes_, f, roots_);
  });
  if (low == 0) {
    roots_.solve(fields_[candidates_[plus]], {}, scale_[plus]);
  } else {
    roots_.solve(fields_[candidates_[plus]], fields_[candidates_[minus]], scale_[plus] + scale_[minus]);
  }
  std::size_t solved = 0;
  for (EdgeVertex& vertex : edge_vertex_) {
    if (vertex.low != low || vertex.high != high) continue;
    vertex.point = roots_.point(solved);
    vertex.gradient = roots_.gradient(solved);
    out.counts.residual = std::max(out.counts.residual, std::abs(roots_.value(solved)));
    if (low != 0 && roots_.plus_value(solved) < -root_tolerance(scale_[plus], vertex.point, vertex.gradient)) {
      vertex.by = 0;
      ++out.counts.gaps;
    }
    ++solved;
  }
}

void Labeller::add_edge_vertices(const LabelledBlock& block, PartitionVertices& out) {
  edge_vertex_.clear();
  std::vector<std::pair<Label, Label>> pairs;
  for_edges(block.edges, [&](int x, int y, int z, unsigned mask) {
    const Cell cell{x, y, z};
    const auto [low, high] = std::minmax(label_[cell.node(0)], label_[cell.node(mask)]);
    edge_vertex_.push_back({.low = low, .high = high, .point = Vec3::Zero(), .gradient = Vec3::Zero(), .by = {}});
    if (pairs.empty() || pairs.back() != std::pair(low, high)) pairs.emplace_back(low, high);
  });
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  for (const auto& [low, high] : pairs) solve_edges(block, low, high, out);

  std::size_t i = 0;
  for_edges(block.edges, [&](int x, int y, int z, unsigned mask) {
    EdgeVertex& vertex = edge_vertex_[i++];
    const Cell cell{x, y, z};
    const std::size_t first = cell.node(0), last = cell.node(mask);
    // A third label that wins between two nodes where others do is seldom far from winning at one of them.
    const auto change = [&](std::size_t slot) { return std::abs(value(slot, first) - value(slot, last)); };
    const auto is_near = [&](std::size_t slot) {
      const Label label = candidates_[slot] + 1;
      if (label == vertex.low || label == vertex.high) return false;
      return std::max(value(slot, first), value(slot, last)) > -0.5 * std::max(change(slot), change(slot_of(vertex.high)));
    };
    for (std::size_t slot = 0; slot < candidates_.size(); ++slot) {
      if (!is_near(slot)) continue;
      if (const std::optional<Label> winner = winner_at(vertex.low, vertex.high, vertex.point)) vertex.by = winner;
      break;
    }
    const auto number = static_cast<std::uint32_t>(out.use_end.size());
    if (vertex.by && (has_mesh(vertex.low) || has_mesh(vertex.high))) {
      const Cover cover{number, vertex.low, vertex.high, *vertex.by, vertex.point};
      const bool low_first = label_[first] == vertex.low;
      add_covered(cover, nodes_[low_first ? first : last], nodes_[low_first ? last : first], out);
      return;
    }
    const Vec3 along = nodes_[last] - nodes_[first];
    const Label inner = vertex.low == 0 ? vertex.high : vertex.low;
    const bool inner_first = label_[first] == inner;
    const Vec3 normal = outward(vertex.gradient, inner_first ? along : Vec3(-along));
    const auto use = [&](Label label, Label other, const Vec3& shared_normal) {
      if (!has_mesh(label)) return;
      out.use.push_back({.body = label - 1, .contact = other, .normal = shared_normal, .position = vertex.point});
    };
    use(inner, vertex.low == 0 ? 0 : vertex.high, normal);
    if (vertex.low != 0) use(vertex.high, vertex.low, -normal);
    out.use_end.push_back(static_cast<std::uint32_t>(out.use.size()));
    out.kind.push_back(VertexKind::Edge);
  });
}

/// The label that wins over two others at a point of the interface between them.
std::optional<Label> Labeller::winner_at(Label low, Label high, const Vec3& point) const {
  Vec3 gradient;
  const double value = fields_[high - 1].value(point, gradient);
  const double tolerance = root_tolerance(scale_of(low, high), point, gradient);
  std::optional<Label> winner;
  double most = (low == 0 ? 0.0 : value) + tolerance;
  const auto look = [&](Label label, double other) {
    if (!(other > most)) return;
    most = other;
    winner = label;
  };
  if (low != 0) look(0, 0.0);
  for (const std::uint32_t body : candidates_) {
    if (body + 1 != low && body + 1 != high) look(body + 1, fields_[body].value(point));
  }
  return winner;
}

void Labeller::add_covered(const Cover& cover, const Vec3& at_low, const Vec3& at_high, PartitionVertices& out) const {
  const auto add = [&](Label label, Label across, Label beyond, const Vec3& place) {
    if (!has_mesh(label)) return;
    Vec3 own, other = Vec3::Zero();
    (void)fields_[label - 1].value(place, own);
    if (across != 0) (void)fields_[across - 1].value(place, other);
    out.use.push_back({.body = label - 1, .other = beyond, .contact = across, .normal = outward(own - other, Vec3::UnitZ()),
                       .position = place});
  };
  const Vec3 to_low = root_between(fields_, cover.low, cover.by, at_low, cover.point, scale_of(cover.low, cover.by)).point;
  const Vec3 to_high = root_between(fields_, cover.by, cover.high, cover.point, at_high, scale_of(cover.by, cover.high)).point;
  add(cover.low, cover.by, kAnyLabel, to_low);
  add(cover.by, cover.low, cover.low, to_low);
  add(cover.by, cover.high, cover.high, to_high);
  add(cover.high, cover.by, kAnyLabel, to_high);
  out.use_end.push_back(static_cast<std::uint32_t>(out.use.size()));
  out.kind.push_back(VertexKind::Covered);
  out.cover.push_back(cover);
}

/// Where the values at two nodes with different labels put their interface on the line between them.
Vec3 Labeller::crossing(std::size_t node_a, std::size_t node_b) const {
  const auto low = std::min(label_[node_a], label_[node_b]);
  const auto high = std::max(label_[node_a], label_[node_b]);
  const auto f = [&](std::size_t node) {
    return low == 0 ? value(slot_of(high), node) : value(slot_of(low), node) - value(slot_of(high), node);
  };
  const double a = f(node_a), b = f(node_b);
  // Kept off the ends, so that points between crossings lie inside their simplex.
  const double t = std::clamp(a / (a - b), 0.01, 0.99);
  return nodes_[node_a] + t * (nodes_[node_b] - nodes_[node_a]);
}

/// Where a body ends on the way from a node of its own to a point outside all bodies.
Vec3 Labeller::own_root(Label label, const Vec3& inside, const Vec3& outside) const {
  return root_on_segment(fields_[label - 1], inside, outside);
}

Vec3 Labeller::own_normal(Label label, const Vec3& point, const Vec3& fallback) const {
  Vec3 gradient;
  (void)fields_[label - 1].value(point, gradient);
  return outward(gradient, fallback);
}

/// A body's own vertex where the junction of a simplex lies in a gap: where the body ends on the way to the junction,
/// so that it stays inside the simplex.
Vec3 Labeller::own_junction(Label label, const Cell& cell, std::span<const std::uint8_t> chain,
                            const Vec3& shared) const {
  Vec3 sum = Vec3::Zero(), first = Vec3::Zero();
  int own = 0;
  for (const std::uint8_t corner : chain) {
    const std::size_t node = cell.node(corner);
    if (label_[node] != label) continue;
    if (own == 0) first = nodes_[node];
    sum += nodes_[node];
    ++own;
  }
  const Vec3 middle = sum / own;
  return own_root(label, fields_[label - 1].value(middle) > 0.0 ? middle : first, shared);
}

/// The middle of a simplex's nodes with this label.
Vec3 Labeller::middle_of(const Cell& cell, std::span<const std::uint8_t> chain, Label label) const {
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (const std::uint8_t corner : chain) {
    if (label_[cell.node(corner)] != label) continue;
    sum += nodes_[cell.node(corner)];
    ++count;
  }
  return sum / count;
}

/// The pair of labels of a simplex that a third one keeps apart on all its edges between them.
std::optional<Labeller::CoveredPair> Labeller::covered_pair(const Cell& cell, std::span<const std::uint8_t> chain,
                                                            const LabelSet& labels) const {
  std::optional<CoveredPair> found;
  for (std::size_t k = 0; k < labels.count; ++k) {
    const Label by = labels.label[k], low = labels.label[k == 0 ? 1 : 0], high = labels.label[k == 2 ? 1 : 2];
    if (!has_mesh(low) && !has_mesh(high)) continue;
    Vec3 middle = Vec3::Zero();
    int edges = 0;
    bool covered = true;
    for (const std::uint8_t a : chain) {
      for (const std::uint8_t b : chain) {
        if (label_[cell.node(a)] != low || label_[cell.node(b)] != high || !covered) continue;
        const Vec3 point = root_between(fields_, low, high, nodes_[cell.node(a)], nodes_[cell.node(b)], scale_of(low, high)).point;
        covered = winner_at(low, high, point) == std::optional<Label>(by);
        middle += point;
        ++edges;
      }
    }
    if (!covered) continue;
    if (found) return {};  // more than one
    middle /= edges;
    for (const double share : {0.5, 0.2, 0.05, 0.01}) {  // a thin gap between convex bodies is not convex
      const Vec3 inside = middle + share * (middle_of(cell, chain, by) - middle);
      const auto value = [&](Label label) { return label == 0 ? 0.0 : fields_[label - 1].value(inside); };
      if (!(value(by) > value(low) && value(by) > value(high))) continue;
      found = CoveredPair{low, high, by, inside};
      break;
    }
  }
  return found;
}

void Labeller::add_junction(const Cell& cell, const std::array<std::uint8_t, 4>& chain, std::uint8_t size,
                            const LabelSet& labels, PartitionVertices& out) {
  Simplex s{.low = nodes_[cell.node(0)], .high = nodes_[cell.node(7)], .corner = chain, .label = {}, .size = size};
  Vec3 start = Vec3::Zero();
  int crossings = 0;
  for (std::size_t b = 0; b < size; ++b) {
    s.label[b] = label_[cell.node(chain[b])];
    for (std::size_t a = 0; a < b; ++a) {
      if (s.label[a] == s.label[b]) continue;
      start += crossing(cell.node(chain[a]), cell.node(chain[b]));
      ++crossings;
    }
  }
  start /= crossings;
  double scale = 0.0;
  for (const Label l : labels.view()) {
    if (l != 0) scale += scale_[slot_of(l)];
  }
  const std::span<const std::uint8_t> corners(chain.data(), size);
  ++out.counts.junctions;
  Junction junction = meet_inside(fields_, s, labels, start, scale);
  if (!junction.exact && labels.count == 3) {
    if (const std::optional<CoveredPair> pair = covered_pair(cell, corners, labels)) {
      const auto number = static_cast<std::uint32_t>(out.use_end.size());
      const Cover cover{number, pair->low, pair->high, pair->by, pair->middle};
      // Where the middle of its nodes is not a body's own, one of them is.
      const auto own = [&](Label label) {
        const Vec3 middle = middle_of(cell, corners, label);
        const auto value = [&](Label l) { return l == 0 ? 0.0 : fields_[l - 1].value(middle); };
        if (value(label) > value(pair->by)) return middle;
        const auto at = std::find_if(corners.begin(), corners.end(), [&](std::uint8_t c) { return label_[cell.node(c)] == label; });
        return nodes_[cell.node(*at)];
      };
      add_covered(cover, own(pair->low), own(pair->high), out);
      return;
    }
  }
  if (!junction.exact && labels.count == 3) junction = search_inside(fields_, s, labels, scale);
  if (!junction.exact) junction = find_junction(fields_, s, labels, start, scale);
  if (!junction.exact) ++out.counts.junctions_moved;
  out.counts.residual = std::max(out.counts.residual, junction.residual);

  const std::size_t first = labels.label[0] == 0 ? 1 : 0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t k = first; k < labels.count; ++k) {
    largest = std::max(largest, fields_[labels.label[k] - 1].value(junction.point));
  }
  const bool gap = !junction.exact && largest < 0.0;
  for (std::size_t k = first; k < labels.count; ++k) {
    const std::uint32_t body = labels.label[k] - 1;
    if (has_mesh_[body] == 0) continue;
    const Label contact = labels.label[k == first ? first + 1 : first];
    VertexUse use{.body = body, .contact = contact, .normal = normal_at(fields_, labels, body, junction.point),
                  .position = junction.point};
    if (gap) {
      use.contact = 0;
      use.position = own_junction(labels.label[k], cell, corners, junction.point);
      use.normal = own_normal(labels.label[k], use.position, use.normal);
    }
    out.use.push_back(use);
  }
  out.use_end.push_back(static_cast<std::uint32_t>(out.use.size()));
  out.kind.push_back(VertexKind::Junction);
}

void Labeller::add_junctions(LabelledBlock& block, PartitionVertices& out) {
  const auto labels_at = [&](const Cell& cell, std::span<const std::uint8_t> chain) {
    LabelSet set;
    for (const std::uint8_t corner : chain) set.insert(label_[cell.node(corner)]);
    return set;
  };
  constexpr std::array<std::uint8_t, 8> kCorners{0, 1, 2, 3, 4, 5, 6, 7};
  const auto many = [&](const Cell& cell) {
    std::size_t changes = 0;  // eight corners can hold more labels than a LabelSet
    for (const std::uint8_t corner : kCorners) changes += label_[cell.node(corner)] != label_[cell.node(0)] ? 1u : 0u;
    return changes > 1;
  };
  for_all_cells([&](const Cell& cell) {
    if (!many(cell)) return;
    for (std::size_t f = 0; f < kFaces; ++f) {
      const auto [first, second] = kFaceMasks[f];
      const std::array<std::uint8_t, 4> chain{0, first, static_cast<std::uint8_t>(first | second), 0};
      const LabelSet labels = labels_at(cell, {chain.data(), 3});
      if (labels.count < 3) continue;
      block.face_key.push_back(face_key(cell, f));
      add_junction(cell, chain, 3, labels, out);
    }
  });
  for_all_cells([&](const Cell& cell) {
    if (!many(cell)) return;
    for (const auto& chain : kTetrahedra) {
      const LabelSet labels = labels_at(cell, chain);
      if (labels.count > 2) add_junction(cell, chain, 4, labels, out);
    }
  });
}

void Labeller::take_block(const BlockCoord& coord, std::span<const std::uint32_t> candidates,
                          PartitionVertices& out) {
  candidates_ = candidates;
  block_nodes(lattice_, coord, nodes_);
  label_nodes();
  out.counts.nodes += std::uint64_t{kBlockNodes} * candidates.size();
  std::vector<Label> distinct(label_.begin(), label_.end());
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() < 2) return;
  LabelledBlock block;
  block.coord = coord;
  block.label.assign(label_.begin(), label_.end());
  block.has_junctions = distinct.size() > 2;
  block.first_vertex = static_cast<std::uint32_t>(out.use_end.size());
  mark_edges(block);
  add_edge_vertices(block, out);
  if (block.has_junctions) add_junctions(block, out);
  out.block.push_back(std::move(block));
}

}  // namespace supple::implicit::lattice
