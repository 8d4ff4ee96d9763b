#include "surface/march/sigma_mesh.h"

#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "pairs/body_order.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

using Key = std::uint64_t;
constexpr unsigned kBits = 21;  // of a coordinate on the lattice
constexpr std::int64_t kMiddle = std::int64_t{1} << (kBits - 1);
constexpr Key kMask = (Key{1} << kBits) - 1;
constexpr double kEnd = 1.0 - 1e-5;  // of the pressure outside a support: beside its end
constexpr double kFar = 1e6;   // beyond every support, in the size of the body

using Place = std::array<std::int64_t, 3>;

Key key_of(const Place& at) {
  Key key = 0;
  for (std::size_t k = 0; k < 3; ++k) key |= static_cast<Key>(at[k] + kMiddle) << (kBits * k);
  return key;
}

Place place_of(Key key) {
  Place at;
  for (std::size_t k = 0; k < 3; ++k) at[k] = static_cast<std::int64_t>(key >> (kBits * k) & kMask) - kMiddle;
  return at;
}

/// Pressure [Pa] of a body outside the support of its field; minus infinity where there is none.
double outside_support(const PairPressure& pressure, int side) {
  const implicit::FieldView& field = pressure.field(side);
  if (field.as_field() == nullptr) return -kInfinity;
  const Box box = field.surface_box();
  return pressure.modulus(side) * field.value(box.upper + kFar * (box.extent() + Vec3::Constant(field.feature_size())));
}

/// Adds the places that lie so far from those of a sorted list, which stays sorted: along an axis all move alike.
/// @param room  for the result
void add_moved(Key by, std::vector<Key>& keys, std::vector<Key>& room) {
  room.clear();
  std::size_t moved = 0;
  for (const Key key : keys) {
    for (; moved < keys.size() && keys[moved] + by <= key; ++moved) {
      if (room.empty() || room.back() != keys[moved] + by) room.push_back(keys[moved] + by);
    }
    if (room.empty() || room.back() != key) room.push_back(key);
  }
  for (; moved < keys.size(); ++moved) {
    if (room.back() != keys[moved] + by) room.push_back(keys[moved] + by);
  }
  keys.swap(room);
}
constexpr std::array<Key, 3> kAlongAxis{1, Key{1} << kBits, Key{1} << (2 * kBits)};  // to the next place along an axis

/// Corner c of a cell: bit k of c is its side along axis k.
std::array<int, 3> corner(std::size_t c) { return {static_cast<int>(c & 1), static_cast<int>(c >> 1 & 1), static_cast<int>(c >> 2)}; }

/// Sign of the volume of (b - a, c - a, d - a) between corners of a cell.
int turn(std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
  const auto way = [a](std::size_t to) {
    const auto p = corner(a), q = corner(to);
    return std::array<int, 3>{q[0] - p[0], q[1] - p[1], q[2] - p[2]};
  };
  const auto u = way(b), v = way(c), w = way(d);
  return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

}  // namespace

Vec3 SigmaMesher::place(Key key) const {
  const Place at = place_of(key);
  return origin_ + axes_ * (cell_ * Vec3(static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])));
}

/// Of a block of cells. @param key  of the block   @param side  its, before `axes_` @param beside  how much larger each way, in its sides
Box SigmaMesher::box_of(Key key, double side, double beside) const {
  const Place at = place_of(key);
  const Vec3 low(static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2]));
  const Vec3 centre = origin_ + axes_ * (side * (low + Vec3::Constant(0.5))), half = axes_.cwiseAbs() * Vec3::Constant((0.5 + beside) * side);
  Box box;
  box.lower = centre - half;
  box.upper = centre + half;
  return box;
}

/// Cells of blocks in which both bodies may press equally, and their neighbours.
bool SigmaMesher::find_cells(const PairPressure& pressure, const Box& overlap) {
  unsigned level = 1;
  const double reach = (overlap.centre() - origin_).norm() + 0.5 * overlap.extent().norm();
  while (std::ldexp(cell_, static_cast<int>(level)) < reach) {
    if (++level + 2 >= kBits) return false;
  }
  cells_.clear();
  for (std::size_t c = 0; c < 8; ++c) {
    const auto k = corner(c);
    cells_.push_back(key_of({k[0] - 1, k[1] - 1, k[2] - 1}));
  }
  for (; level > 0; --level) {
    const double side = std::ldexp(cell_, static_cast<int>(level));
    std::erase_if(cells_, [&](Key key) {
      const Box box = box_of(key, side, 0.0);
      return !box.overlaps(overlap) || !pressure.may_meet(box);
    });
    if (cells_.size() > kMostCells / 8) return false;
    near_.clear();
    for (const Key key : cells_) {
      const Place at = place_of(key);
      for (std::size_t c = 0; c < 8; ++c) {
        const auto k = corner(c);
        near_.push_back(key_of({2 * at[0] + k[0], 2 * at[1] + k[1], 2 * at[2] + k[2]}));
      }
    }
    cells_.swap(near_);
  }
  std::sort(cells_.begin(), cells_.end());
  for (const Key step : kAlongAxis) {  // and one to either side
    for (Key& key : cells_) key -= step;
    add_moved(step, cells_, near_);
    add_moved(step, cells_, near_);
  }
  return cells_.size() <= kMostCells;
}

void SigmaMesher::find_nodes(PairPressure& pressure) {
  nodes_ = cells_;
  for (const Key step : kAlongAxis) add_moved(step, nodes_, near_);
  node_.resize(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i) node_.point[i] = place(nodes_[i]);
  pressure.evaluate_values(node_);
}

/// @param overlap  holds all of Sigma that presses: what the images of triangles at the border leave out lies where nobody does, as all cells are cut that
///                 touch one in which the bodies may press equally
void SigmaMesher::cut_cells(const PairPressure& pressure, const Box& overlap, SigmaMesh& out) {
  // Six tetrahedra around the main diagonal of a cell: one for each order of the axes.
  constexpr std::array<std::array<std::size_t, 2>, 6> kPaths{{{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}}};
  cuts_.clear();  // three a triangle
  std::array<std::uint32_t, 4> next{};  // nodes at the corners of the last cell with the lower x, which the others follow: those of later cells come later
  for (const Key key : cells_) {
    std::array<std::uint32_t, 8> node;
    std::array<bool, 8> above;
    for (std::size_t c = 0; c < 4; ++c) {
      const Key wanted = key + (c & 1) * kAlongAxis[1] + (c >> 1) * kAlongAxis[2];
      while (nodes_[next[c]] != wanted) ++next[c];
      node[2 * c] = next[c];
      node[2 * c + 1] = next[c] + 1;
    }
    Place at{};
    if (mirrored_) {
      at = place_of(key);
      const std::array<std::uint32_t, 8> plain = node;
      for (std::size_t c = 0; c < 8; ++c) {
        auto k = corner(c);
        for (std::size_t i = 0; i < 2; ++i) {
          if (at[i] < 0) k[i] = 1 - k[i];
        }
        node[c] = plain[static_cast<std::size_t>(k[0] + 2 * k[1] + 4 * k[2])];
      }
    }
    for (std::size_t c = 0; c < 8; ++c) above[c] = node_.a[node[c]] >= node_.b[node[c]];
    if (std::equal(above.begin() + 1, above.end(), above.begin())) continue;
    const auto presses = [this](std::uint32_t n) { return node_.a[n] > 0.0 && node_.b[n] > 0.0; };
    if (std::none_of(node.begin(), node.end(), presses)) {
      const Box near = box_of(key, cell_, 1.0);
      if (!near.overlaps(overlap) || !pressure.may_meet(near)) continue;
    }
    const bool reversed = mirrored_ && (at[0] < 0) != (at[1] < 0);
    for (const auto& path : kPaths) {
      std::array<std::size_t, 4> up, down;
      std::size_t ups = 0, downs = 0;
      for (const std::size_t c : {std::size_t{0}, path[0], path[1], std::size_t{7}}) (above[c] ? up[ups++] : down[downs++]) = c;
      if (ups == 0 || downs == 0) continue;
      const auto cut = [&](std::size_t u, std::size_t d) { return Cut{node[u], node[d]}; };
      const auto add = [&](const Cut& p, const Cut& q, const Cut& r, bool upright) {
        const bool keep = upright != reversed;
        cuts_.push_back(p);
        cuts_.push_back(keep ? q : r);
        cuts_.push_back(keep ? r : q);
      };
      // Corners run counterclockwise as seen from below.
      if (ups == 1) {
        add(cut(up[0], down[0]), cut(up[0], down[1]), cut(up[0], down[2]), turn(up[0], down[0], down[1], down[2]) > 0);
      } else if (downs == 1) {
        add(cut(up[0], down[0]), cut(up[1], down[0]), cut(up[2], down[0]), turn(down[0], up[0], up[1], up[2]) < 0);
      } else {
        const bool keep = turn(up[0], down[0], up[1], down[1]) < 0;
        const Cut p = cut(up[0], down[0]), q = cut(up[0], down[1]), r = cut(up[1], down[1]), s = cut(up[1], down[0]);
        add(p, q, r, keep);
        add(p, r, s, keep);
      }
    }
  }
  out.triangle.clear();
  numbered_.start(cuts_.size());
  for (std::size_t i = 0; i < cuts_.size(); i += 3) {
    out.triangle.push_back({{numbered_.number(cuts_[i].key()), numbered_.number(cuts_[i + 1].key()), numbered_.number(cuts_[i + 2].key())}});
  }
  unique_.clear();
  for (const std::uint64_t key : numbered_.keys()) unique_.push_back(Cut::of(key));
}

/// Newton's method on the edges of the lattice, held between places on both sides of Sigma: triangles do not turn over, as they may where
/// vertices leave their edges.
void SigmaMesher::place_vertices(PairPressure& pressure, SigmaMesh& out) {
  const std::size_t n = unique_.size();
  vertex_.resize(n);
  edge_.resize(n);
  met_.assign(n, 0);
  out.at_end.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto [u, d] = unique_[i];
    const double above = node_.a[u] - node_.b[u], below = node_.a[d] - node_.b[d];
    edge_[i] = {.at = above / (above - below)};
    vertex_.point[i] = node_.point[u] + edge_[i].at * (node_.point[d] - node_.point[u]);
  }
  open_.resize(n);
  for (std::size_t i = 0; i < n; ++i) open_[i] = i;
  for (int step = 0; step < kBracketSteps && !open_.empty(); ++step) {
    pressure.evaluate(vertex_, open_, some_);
    std::size_t left = 0;
    for (const std::size_t i : open_) {
      Edge& edge = edge_[i];
      const Vec3 &from = node_.point[unique_[i].above], way = node_.point[unique_[i].below] - from;
      const double value = vertex_.a[i] - vertex_.b[i];
      (value >= 0.0 ? edge.low : edge.high) = edge.at;
      double next = edge.at - value / (vertex_.slope_a[i] - vertex_.slope_b[i]).dot(way);
      if (!(next >= edge.low && next <= edge.high)) next = 0.5 * (edge.low + edge.high);
      const double move = next - edge.at;
      edge.at = next;
      vertex_.point[i] = from + next * way;
      if (std::abs(move) < 1e-7) {
        met_[i] = 1;
      } else {
        open_[left++] = i;
      }
    }
    open_.resize(left);
  }
  out.vertex = vertex_.point;
  out.normal.assign(n, Vec3::Zero());
  const double end_a = kEnd * outside_support(pressure, 0), end_b = kEnd * outside_support(pressure, 1);
  for (std::size_t i = 0; i < n; ++i) {
    if (met_[i] != 0) out.normal[i] = (vertex_.slope_b[i] - vertex_.slope_a[i]).normalized();
    out.at_end[i] = vertex_.a[i] < end_a && vertex_.b[i] < end_b ? 1 : 0;
  }
}

/// Sigma goes through no node but by chance: no planes of symmetry of bodies do, and no cylinders of round radii.
void SigmaMesher::lay_lattice(const PairPressure& pressure, const Box& overlap, double cell, const std::optional<CommonAxis>& axis,
                              const std::optional<FlatCells>& flat) {
  mirrored_ = axis.has_value();
  Vec3 origin = Vec3::Zero(), shift(0.2763932, 0.3819660, 0.4142136);
  if (mirrored_) {
    cell_ = 0.9472136 * cell;
    const Vec3 &z = axis->direction, x = z.unitOrthogonal();
    axes_ << x, z.cross(x), z;
    origin = axis->point;
    shift.head<2>().setZero();
  } else {
    cell_ = cell;
    const Pose pose = common_pose(pressure.body(0), pressure.body(1));
    axes_ = pose.orientation.toRotationMatrix();
    origin = pose.position;
    if (flat) {
      const Vec3 &z = flat->across, x = pressure.tangent(overlap.centre(), z).value_or(z.unitOrthogonal());
      axes_ << x, z.cross(x), z;
    }
  }
  const Vec3 to_centre = axes_.transpose() * (overlap.centre() - origin);
  if (flat) axes_.leftCols<2>() *= flat->stretch;
  Vec3 near = Vec3::Zero();  // whole cells
  for (Eigen::Index k = mirrored_ ? 2 : 0; k < 3; ++k) near[k] = std::round(to_centre[k] / (cell_ * axes_.col(k).norm()));
  origin_ = origin + axes_ * (cell_ * (near + shift));
}

bool SigmaMesher::mesh(PairPressure& pressure, const Box& overlap, double cell, const std::optional<CommonAxis>& axis,
                       const std::optional<FlatCells>& flat, SigmaMesh& out) {
  lay_lattice(pressure, overlap, cell, axis, flat);
  if (!find_cells(pressure, overlap)) return false;
  find_nodes(pressure);
  cut_cells(pressure, overlap, out);
  place_vertices(pressure, out);
  return true;
}

}  // namespace supple::collision
