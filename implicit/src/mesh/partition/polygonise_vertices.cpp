#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/partition/polygonise_block_edges.h"
#include "mesh/partition/polygonise_partition.h"
#include "supple/implicit/project.h"

namespace supple::implicit::lattice {
namespace {

LabelSet pair_of(Label a, Label b) { return labels_of(std::array{a, b}); }

}  // namespace

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
    add_edge({x, y, z, mask}, nodes_, f, roots_);
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
      if (const std::optional<Label> winner = winner_at(pair_of(vertex.low, vertex.high), vertex.point)) vertex.by = winner;
      break;
    }
    const auto number = static_cast<std::uint32_t>(out.use_end.size());
    if (vertex.by && (has_mesh(vertex.low) || has_mesh(vertex.high))) {
      const bool low_first = label_[first] == vertex.low;
      const std::array at{nodes_[low_first ? first : last], nodes_[low_first ? last : first]};
      add_covered({number, pair_of(vertex.low, vertex.high), *vertex.by, vertex.point}, at, out);
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

double Labeller::scale_of(const LabelSet& labels) const {
  double scale = 0.0;
  for (const Label l : labels.view()) scale += l == 0 ? 0.0 : scale_[slot_of(l)];
  return scale;
}

/// The label that wins over others at a point where they meet.
std::optional<Label> Labeller::winner_at(const LabelSet& labels, const Vec3& point) const {
  Vec3 gradient;
  const double value = fields_[labels.view().back() - 1].value(point, gradient);
  const double tolerance = root_tolerance(scale_of(labels), point, gradient);
  std::optional<Label> winner;
  double most = (labels.has(0) ? 0.0 : value) + tolerance;
  const auto look = [&](Label label, double other) {
    if (!(other > most)) return;
    most = other;
    winner = label;
  };
  if (!labels.has(0)) look(0, 0.0);
  for (const std::uint32_t body : candidates_) {
    if (!labels.has(body + 1)) look(body + 1, fields_[body].value(point));
  }
  return winner;
}

void Labeller::add_covered(const Cover& cover, std::span<const Vec3> at, PartitionVertices& out) const {
  const auto add = [&](Label label, Label across, Label beyond, const Vec3& place) {
    if (!has_mesh(label)) return;
    Vec3 own, other = Vec3::Zero();
    (void)fields_[label - 1].value(place, own);
    if (across != 0) (void)fields_[across - 1].value(place, other);
    out.use.push_back({.body = label - 1, .other = beyond, .contact = across, .normal = outward(own - other, Vec3::UnitZ()),
                       .position = place});
  };
  std::array<Vec3, 3> place;
  for (std::size_t k = 0; k < cover.between.count; ++k) {
    const Label label = cover.between.label[k];
    place[k] = root_between(fields_, label, cover.by, at[k], cover.point, scale_of(pair_of(label, cover.by))).point;
  }
  for (std::size_t k = 0; k < cover.between.count; ++k) add(cover.between.label[k], cover.by, kAnyLabel, place[k]);
  for (std::size_t k = 0; k < cover.between.count; ++k) add(cover.by, cover.between.label[k], cover.between.label[k], place[k]);
  out.use_end.push_back(static_cast<std::uint32_t>(out.use.size()));
  out.kind.push_back(VertexKind::Covered);
  out.cover.push_back(cover);
}

void Labeller::add_covered(const Cell& cell, std::span<const std::uint8_t> chain, const Cover& cover, PartitionVertices& out) const {
  std::array<Vec3, 3> at;
  for (std::size_t k = 0; k < cover.between.count; ++k) {
    // Where the centre of its nodes is in no body, one of them is.
    const Label label = cover.between.label[k];
    const Vec3 middle = middle_of(cell, chain, label);
    const auto value_at = [&](Label l) { return l == 0 ? 0.0 : fields_[l - 1].value(middle); };
    const auto node = std::find_if(chain.begin(), chain.end(), [&](std::uint8_t c) { return label_[cell.node(c)] == label; });
    at[k] = value_at(label) > value_at(cover.by) ? middle : nodes_[cell.node(*node)];
  }
  add_covered(cover, at, out);
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

/// Where a body ends on the line from one of its nodes to a point outside all bodies.
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

/// The pair of labels of a simplex that a third one separates on all its edges between them.
std::optional<Cover> Labeller::covered_pair(const Cell& cell, std::span<const std::uint8_t> chain,
                                                            const LabelSet& labels) const {
  std::optional<Cover> found;
  for (std::size_t k = 0; k < labels.count; ++k) {
    const Label by = labels.label[k], low = labels.label[k == 0 ? 1 : 0], high = labels.label[k == 2 ? 1 : 2];
    if (!has_mesh(low) && !has_mesh(high)) continue;
    Vec3 middle = Vec3::Zero();
    int edges = 0;
    bool covered = true;
    for (const std::uint8_t a : chain) {
      for (const std::uint8_t b : chain) {
        if (label_[cell.node(a)] != low || label_[cell.node(b)] != high || !covered) continue;
        const Vec3 point = root_between(fields_, low, high, nodes_[cell.node(a)], nodes_[cell.node(b)], scale_of(pair_of(low, high))).point;
        covered = winner_at(pair_of(low, high), point) == std::optional<Label>(by);
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
      found = Cover{.between = pair_of(low, high), .by = by, .point = inside};
      break;
    }
  }
  return found;
}

/// Those that come nearer to the largest value at some node than values change.
std::vector<Label> Labeller::others_near(const Cell& cell, std::span<const std::uint8_t> chain, const LabelSet& labels) const {
  const auto best = [&](std::size_t node) { return label_[node] == 0 ? 0.0 : value(slot_of(label_[node]), node); };
  std::array<double, 4> largest{};
  for (std::size_t k = 0; k < chain.size(); ++k) largest[k] = best(cell.node(chain[k]));
  const auto spread = [&](const std::array<double, 4>& v) {
    const auto [low, high] = std::minmax_element(v.begin(), v.begin() + chain.size());
    return *high - *low;
  };
  std::vector<Label> near;
  const auto look = [&](Label label, const auto& of) {
    if (labels.has(label)) return;
    std::array<double, 4> own{};
    double behind = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < chain.size(); ++k) {
      own[k] = of(cell.node(chain[k]));
      behind = std::min(behind, largest[k] - own[k]);
    }
    if (behind < spread(own) + spread(largest)) near.push_back(label);
  };
  look(0, [](std::size_t) { return 0.0; });
  for (std::size_t slot = 0; slot < candidates_.size(); ++slot) {
    look(candidates_[slot] + 1, [&](std::size_t node) { return value(slot, node); });
  }
  return near;
}

/// Where four labels would meet in a tetrahedron if fields were linear in it, taken inside; none where that is far from it.
std::optional<Vec3> Labeller::linear_meeting(const Cell& cell, const Simplex& simplex, const LabelSet& labels) const {
  const auto at = [&](Label label, std::size_t corner) {
    return label == 0 ? 0.0 : value(slot_of(label), cell.node(simplex.corner[corner]));
  };
  Eigen::Matrix3d slope;
  Vec3 rest;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const auto ahead = [&](std::size_t corner) { return at(labels.label[static_cast<std::size_t>(k) + 1], corner) - at(labels.label[0], corner); };
    rest[k] = -ahead(0);
    for (Eigen::Index c = 0; c < 3; ++c) slope(k, c) = ahead(static_cast<std::size_t>(c) + 1) + rest[k];
  }
  const Vec3 share = slope.inverse() * rest;
  constexpr double kBeyond = 0.5, kMargin = 0.02;
  std::array<double, 4> part{1.0 - share.sum(), share[0], share[1], share[2]};
  double sum = 0.0;
  for (double& p : part) {
    if (!(p > -kBeyond)) return {};
    p = std::max(p, kMargin);
    sum += p;
  }
  Vec3 point = Vec3::Zero();
  for (std::size_t c = 0; c < 4; ++c) point += part[c] / sum * corner_of(simplex, c);
  return point;
}

/// Where the labels of a tetrahedron's nodes meet with others that win at none, so that four do. @param labels  in: those, out: all four
std::optional<Junction> Labeller::meet_with_others(const Cell& cell, const Simplex& simplex, LabelSet& labels) const {
  const std::vector<Label> near = others_near(cell, simplex.corner, labels);
  const auto meet = [&](const LabelSet& four) -> std::optional<Junction> {
    const std::optional<Vec3> start = linear_meeting(cell, simplex, four);
    if (!start) return {};
    const Junction junction = meet_inside(fields_, simplex, four, *start, scale_of(four));
    if (!junction.exact || winner_at(four, junction.point)) return {};
    labels = four;
    return junction;
  };
  for (std::size_t i = 0; i < near.size(); ++i) {
    const LabelSet with = labels.with(near[i]);
    if (with.count == 4) {
      if (const auto met = meet(with)) return met;
      continue;
    }
    for (std::size_t j = i + 1; j < near.size(); ++j) {
      if (const auto met = meet(with.with(near[j]))) return met;
    }
  }
  return {};
}

/// Are there triangles between any two of them?
bool Labeller::can_part(const LabelSet& labels) const {
  return std::count_if(labels.view().begin(), labels.view().end(), [&](Label l) { return !has_mesh(l); }) < 2;
}

bool Labeller::wins_over(Label by, const LabelSet& labels, const Vec3& point) const {
  const auto value_of = [&](Label l) { return l == 0 ? 0.0 : fields_[l - 1].value(point); };
  const double own = value_of(by);
  return std::all_of(labels.view().begin(), labels.view().end(), [&](Label l) { return own > value_of(l); });
}

/// The middle of where values put the interfaces on the edges of a simplex.
Vec3 Labeller::middle_of_crossings(const Cell& cell, const Simplex& simplex) const {
  Vec3 sum = Vec3::Zero();
  int crossings = 0;
  for (std::size_t b = 0; b < simplex.size; ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      if (simplex.label[a] == simplex.label[b]) continue;
      sum += crossing(cell.node(simplex.corner[a]), cell.node(simplex.corner[b]));
      ++crossings;
    }
  }
  return sum / crossings;
}

/// A place of a fourth label that passes between three from one of their edges.
std::optional<Cover> Labeller::covered_by_fourth(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& middle) const {
  for (std::size_t b = 0; b < simplex.size; ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      const Label low = simplex.label[a], high = simplex.label[b];
      if (low == high) continue;
      const Vec3 from = nodes_[cell.node(simplex.corner[a])], to = nodes_[cell.node(simplex.corner[b])];
      const Vec3 root = root_between(fields_, low, high, from, to, scale_of(pair_of(low, high))).point;
      const std::optional<Label> by = winner_at(pair_of(low, high), root);
      if (!by || labels.has(*by)) continue;
      for (const double share : {0.5, 0.2, 0.05}) {
        const Vec3 point = root + share * (middle - root);
        if (wins_over(*by, labels, point)) return Cover{.between = labels, .by = *by, .point = point};
      }
    }
  }
  return {};
}

Labeller::Met Labeller::meet_on_face(const Cell& cell, const Simplex& face, const LabelSet& labels) const {
  return meet_three(cell, face, labels, middle_of_crossings(cell, face));
}

Labeller::Met Labeller::meet_three(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& start) const {
  const std::span<const std::uint8_t> corners(simplex.corner.data(), simplex.size);
  const double scale = scale_of(labels);
  const bool alone = others_near(cell, corners, labels).empty();
  if (simplex.size == 4 && !alone) {
    LabelSet four = labels;
    if (const std::optional<Junction> met = meet_with_others(cell, simplex, four)) return {*met, four, {}};
  }
  const bool parts = !alone && can_part(labels);
  const auto covering = [&](const Junction& j) { return parts ? winner_at(labels, j.point) : std::nullopt; };
  Junction junction = meet_inside(fields_, simplex, labels, start, scale);
  std::optional<Label> by;
  if (junction.exact) by = covering(junction);
  if (junction.exact && !by) return {junction, labels, {}};
  if (simplex.size == 4 && !alone) {  // as on its faces
    std::optional<Cover> across;
    for (std::size_t v = 0; v < 4; ++v) {
      const std::optional<Simplex> face = face_of(simplex, v);
      if (!face) continue;
      const Met met = meet_on_face(cell, *face, labels);
      if (met.cover && met.cover->between.count == 3) across = met.cover;
      if (met.cover || !met.junction.exact) continue;
      const Junction nearer = meet_inside(fields_, simplex, labels, met.junction.point + 0.1 * (start - met.junction.point), scale);
      if (nearer.exact && !covering(nearer)) return {nearer, labels, {}};
    }
    if (across) {
      for (const double share : {0.5, 0.2, 0.05}) {
        const Vec3 point = across->point + share * (start - across->point);
        if (wins_over(across->by, labels, point)) return {{}, labels, Cover{.between = labels, .by = across->by, .point = point}};
      }
    }
  }
  if (const std::optional<Cover> pair = covered_pair(cell, corners, labels)) return {{}, labels, pair};
  if (by) return {{}, labels, Cover{.between = labels, .by = *by, .point = junction.point}};
  junction = search_inside(fields_, simplex, labels, scale);
  by = junction.exact ? covering(junction) : std::nullopt;
  if (by) return {{}, labels, Cover{.between = labels, .by = *by, .point = junction.point}};
  if (junction.exact) return {junction, labels, {}};
  if (parts) {
    if (const std::optional<Cover> cover = covered_by_fourth(cell, simplex, labels, start)) return {{}, labels, cover};
  }
  return {find_junction(fields_, simplex, labels, start, scale), labels, {}};
}

Labeller::Met Labeller::meet_four(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& start) const {
  const double scale = scale_of(labels);
  const Junction junction = meet_inside(fields_, simplex, labels, linear_meeting(cell, simplex, labels).value_or(start), scale);
  if (junction.exact) return {junction, labels, {}};
  // They do not: one passes between the three others, and comes through their face.
  for (std::size_t v = 0; v < 4; ++v) {
    const Simplex face = *face_of(simplex, v);
    const LabelSet three = labels_of(std::span(face.label.data(), 3));
    if (!can_part(three)) continue;
    const Met met = meet_on_face(cell, face, three);
    if (!met.cover || met.cover->by != simplex.label[v]) continue;
    for (const double share : {0.5, 0.2, 0.05}) {
      const Vec3 point = met.cover->point + share * (start - met.cover->point);
      if (wins_over(simplex.label[v], three, point)) return {{}, labels, Cover{.between = three, .by = simplex.label[v], .point = point}};
    }
  }
  return {find_junction(fields_, simplex, labels, start, scale), labels, {}};
}

Simplex Labeller::simplex_of(const Cell& cell, const std::array<std::uint8_t, 4>& chain, std::uint8_t size) const {
  Simplex s{.low = nodes_[cell.node(0)], .high = nodes_[cell.node(7)], .corner = chain, .label = {}, .size = size};
  for (std::size_t v = 0; v < size; ++v) s.label[v] = label_[cell.node(chain[v])];
  return s;
}

void Labeller::add_junction(const Cell& cell, const std::array<std::uint8_t, 4>& chain, std::uint8_t size,
                            const LabelSet& labels, PartitionVertices& out) {
  const Simplex s = simplex_of(cell, chain, size);
  const Vec3 start = middle_of_crossings(cell, s);
  const std::span<const std::uint8_t> corners(chain.data(), size);
  ++out.counts.junctions;
  const Met met = labels.count == 4 ? meet_four(cell, s, labels, start) : meet_three(cell, s, labels, start);
  const Junction& junction = met.junction;
  if (met.cover) {
    Cover cover = *met.cover;
    cover.vertex = static_cast<std::uint32_t>(out.use_end.size());
    add_covered(cell, corners, cover, out);
    return;
  }
  const std::size_t begin = out.use.size();
  add_junction(met.labels, junction, out);
  if (junction.exact) return;
  ++out.counts.junctions_moved;
  double largest = -std::numeric_limits<double>::infinity();
  for (const Label l : labels.view()) {
    if (l != 0) largest = std::max(largest, fields_[l - 1].value(junction.point));
  }
  if (!(largest < 0.0)) return;
  for (std::size_t u = begin; u < out.use.size(); ++u) {  // in a gap
    VertexUse& use = out.use[u];
    use.contact = 0;
    use.position = own_junction(use.body + 1, cell, corners, junction.point);
    use.normal = own_normal(use.body + 1, use.position, use.normal);
  }
}

void Labeller::add_junction(const LabelSet& labels, const Junction& junction, PartitionVertices& out) const {
  out.counts.residual = std::max(out.counts.residual, junction.residual);
  out.meeting.push_back({static_cast<std::uint32_t>(out.use_end.size()), labels});
  const std::size_t first = labels.label[0] == 0 ? 1 : 0;
  for (std::size_t k = first; k < labels.count; ++k) {
    const std::uint32_t body = labels.label[k] - 1;
    if (has_mesh_[body] == 0) continue;
    const Label contact = labels.label[k == first ? first + 1 : first];
    out.use.push_back({.body = body, .contact = contact, .normal = normal_at(fields_, labels, body, junction.point),
                       .position = junction.point});
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
  const auto changes_in = [&](const Cell& cell) {
    std::size_t changes = 0;  // eight corners can hold more labels than a LabelSet
    for (const std::uint8_t corner : kCorners) changes += label_[cell.node(corner)] != label_[cell.node(0)] ? 1u : 0u;
    return changes;
  };
  for_all_cells([&](const Cell& cell) {
    if (changes_in(cell) < 2) return;
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
    if (changes_in(cell) == 0) return;
    for (std::size_t t = 0; t < kTetrahedra.size(); ++t) {
      const auto& chain = kTetrahedra[t];
      LabelSet labels = labels_at(cell, chain);
      if (labels.count > 2) add_junction(cell, chain, 4, labels, out);
      if (labels.count != 2) continue;
      if (const std::optional<Junction> met = meet_with_others(cell, simplex_of(cell, chain, 4), labels)) {
        ++out.counts.junctions;
        block.lone_key.push_back(tetrahedron_key(cell, t));
        add_junction(labels, *met, out);
      }
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
