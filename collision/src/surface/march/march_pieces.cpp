#include "numbers.h"
#include "surface/march/march_rule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace supple::collision {
namespace {

/// Of a mesh that is fine enough.
struct Smoothness {
  double flat;  // in cells: highest middle of an edge
  double turn;  // least cosine between normals of a triangle
};
constexpr Smoothness kSmooth{0.2, 0.5}, kSmoothEnough{0.35, 0.25};  // the latter at coarse errors
constexpr double kMargin = 2.0;        // of a cubic polynomial, in what it misses at the middles of edges
constexpr double kDoubt = 1.0 / 64.0;  // share of the error asked for that a single doubtful piece may be
constexpr int kMostLevels = 24;        // of splitting doubtful pieces at once

}  // namespace

double MarchRuleSolver::height_at(const Piece& piece, const Vec2& at) {
  return quadratic(piece, at, [](const Foot& f) { return f.height; });
}

MarchRuleSolver::Controls::Controls(const Piece& piece) {
  const auto& c = piece.corner;
  const auto see = [this](double control) {
    lowest = std::min(lowest, control);
    highest = std::max(highest, control);
  };
  for (std::size_t i = 0; i < 3; ++i) {
    corner[i] = c[i].pressure;
    see(corner[i]);
    for (std::size_t j = 0; j < 3; ++j) {
      if (i == j) continue;
      edge[i][j] = c[i].pressure + c[i].slope.dot(c[j].at - c[i].at) / 3.0;
      see(edge[i][j]);
      inner += edge[i][j] / 4.0 - c[i].pressure / 12.0;
    }
  }
  see(inner);
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const double middle = (c[j].pressure + 3.0 * (edge[j][k] + edge[k][j]) + c[k].pressure) / 8.0;
    margin = std::max(margin, kMargin * std::abs(piece.middle[i].pressure - middle));
  }
}

/// Whether the pressure only goes away from that of corner i along rays from there to corner `to`: differences of controls are those of its rate.
bool MarchRuleSolver::Controls::steady(std::size_t i, std::size_t to, double sign) const {
  const std::size_t other = 3 - i - to;
  const std::array<double, 6> steps{edge[i][to] - corner[i], edge[to][i] - edge[i][to],     corner[to] - edge[to][i],
                                    inner - edge[i][other],  edge[to][other] - inner, edge[other][to] - edge[other][i]};
  return std::all_of(steps.begin(), steps.end(), [&](double step) { return sign * step < -margin; });
}

/// Or whether it bends one way along all of them: then it changes its sign once where it has two signs at their ends. Where it has one, as beyond the rim
/// on the edge across, it keeps it if it bends away from zero, or else if it goes away from it where they begin.
bool MarchRuleSolver::Controls::bends(std::size_t i, std::size_t to, double sign) const {
  const std::size_t other = 3 - i - to;
  const std::array<double, 3> bend{edge[to][i] - 2.0 * edge[i][to] + corner[i], corner[to] - 2.0 * edge[to][i] + edge[i][to],
                                   edge[to][other] - 2.0 * inner + edge[i][other]};
  if (std::all_of(bend.begin(), bend.end(), [&](double change) { return sign * change > margin; })) return true;
  if (!std::all_of(bend.begin(), bend.end(), [&](double change) { return sign * change < -margin; })) return false;
  const double ends = corner[i] / (corner[i] - corner[other]);
  const double begin = edge[i][to] - corner[i], middle = inner - edge[i][other], end = edge[other][to] - edge[other][i];
  const double last = (1.0 - ends) * middle + ends * end, here = (1.0 - ends) * ((1.0 - ends) * begin + ends * middle) + ends * last;
  return sign * here < -margin && sign * last < -margin && sign * end < -margin;
}

MarchRuleSolver::Shape MarchRuleSolver::shape_of(const Piece& piece) const {
  const auto& c = piece.corner;
  const Controls controls(piece);
  const double margin = controls.margin;
  bool good = true;
  std::size_t positive = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    good = good && c[i].good && piece.middle[i].good;
    positive += c[i].pressure > 0.0 ? 1 : 0;
  }
  Shape shape;
  shape.most = std::max(controls.highest + margin, 0.0);
  if (positive == 0) {
    shape.certain = good && controls.highest < -margin;
    return shape;
  }
  if (positive == 3) {
    shape.part = Part::All;
    shape.certain = good && controls.lowest > margin;
    return shape;
  }
  shape.part = positive == 1 ? Part::Corner : Part::AllButCorner;
  const double sign = positive == 1 ? 1.0 : -1.0;  // of the lone corner
  std::size_t i = 0;
  while ((c[i].pressure > 0.0) != (positive == 1)) ++i;
  std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
  // Rays run along the edge that crosses the rim more steeply.
  const Vec3 x = plane(piece.triangle, c[i].at);
  const auto fall = [&](std::size_t to) { return std::abs(c[i].pressure - c[to].pressure) / (plane(piece.triangle, c[to].at) - x).norm(); };
  if (fall(k) > fall(j)) std::swap(j, k);
  const auto rays_certain = [&](std::size_t to) { return controls.steady(i, to, sign) || controls.bends(i, to, sign); };
  if (!rays_certain(j)) std::swap(j, k);
  shape.order = {i, j, k};
  // Controls along the edge across, from the lone corner: once they have changed sign, they stay so.
  const auto& edge = controls.edge;
  const bool once = !(sign * edge[i][k] < 0.0 && sign * edge[k][i] > 0.0);
  shape.certain = good && once && rays_certain(j) && sign * edge[j][k] < -margin && sign * edge[k][j] < -margin;
  return shape;
}

/// The triangles of the mesh as pieces. Vertices and middles of edges have the same image seen from every triangle, and are placed once.
void MarchRuleSolver::begin(PairPressure& pressure, Thirds third, std::vector<Piece>& pieces) {
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  const std::array<Vec2, 6> at{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(0.5, 0.5), Vec2(0, 0.5), Vec2(0.5, 0)};
  const auto edge_of = [](const SigmaMesh::Triangle& triangle, std::size_t across) {
    const auto [low, high] = std::minmax(triangle.corner[(across + 1) % 3], triangle.corner[(across + 2) % 3]);
    return static_cast<std::uint64_t>(low) << 32 | high;
  };
  const std::size_t vertices = mesh_.vertex.size();
  const auto place_of = [&](std::uint32_t t, std::size_t k) {
    const SigmaMesh::Triangle& triangle = mesh_.triangle[t];
    if (k < 3) return static_cast<std::size_t>(triangle.corner[k]);
    return vertices + edges_.number(edge_of(triangle, k - 3));
  };
  edges_.start(3 * mesh_.triangle.size());
  feet_.clear();
  feet_.triangle.assign(vertices, kNone);
  feet_.at.resize(vertices);
  spots_.clear();
  for (std::uint32_t t = 0; t < mesh_.triangle.size(); ++t) {
    for (std::size_t k = 0; k < 6; ++k) {
      const std::size_t i = place_of(t, k);
      spots_.push_back(i);
      if (i < feet_.triangle.size()) {
        if (feet_.triangle[i] != kNone) continue;
        feet_.triangle[i] = t;
        feet_.at[i] = at[k];
      } else {
        feet_.triangle.push_back(t);
        feet_.at.push_back(at[k]);
      }
    }
  }
  feet_.height.assign(feet_.triangle.size(), 0.0);
  place(pressure, third, feet_);
  pieces.assign(mesh_.triangle.size(), {});
  for (std::uint32_t t = 0; t < pieces.size(); ++t) {
    pieces[t].triangle = t;
    for (std::size_t k = 0; k < 6; ++k) {
      const std::size_t i = spots_[6 * t + k];
      feet_.triangle[i] = t;
      feet_.at[i] = at[k];
      find_tangents(feet_, i);
      feet_.good[i] = feet_.met[i] != 0 && upright(feet_, i) ? 1 : 0;
      (k < 3 ? pieces[t].corner[k] : pieces[t].middle[k - 3]) = foot(feet_, i);
    }
  }
}

/// Where on the edge across from a corner the pressure turns and has another sign than at both ends, from the next corner (0) to the last (1), if it
/// does: by the quartic polynomial with the values and slopes at the ends, and the value at the middle.
std::optional<double> MarchRuleSolver::turn(const Piece& piece, std::size_t across) {
  const Foot &from = piece.corner[(across + 1) % 3], &to = piece.corner[(across + 2) % 3], &middle = piece.middle[across];
  if (!from.good || !to.good || !middle.good || (from.pressure > 0.0) != (to.pressure > 0.0)) return {};
  const double sign = from.pressure > 0.0 ? -1.0 : 1.0;
  const Vec2 way = to.at - from.at;
  const double p = from.pressure, q = to.pressure, rise = from.slope.dot(way) / 3.0, fall = to.slope.dot(way) / 3.0;
  const double rest = 16.0 * (middle.pressure - (p + q + 3.0 * (p + rise + q - fall)) / 8.0);
  constexpr int kLooks = 16;
  std::array<double, kLooks + 1> look;
  for (int i = 0; i <= kLooks; ++i) {
    const double t = static_cast<double>(i) / kLooks, u = 1.0 - t;
    look[static_cast<std::size_t>(i)] = sign * (u * u * u * p + 3.0 * u * u * t * (p + rise) + 3.0 * u * t * t * (q - fall) + t * t * t * q + rest * u * u * t * t);
  }
  const auto best = std::max_element(look.begin() + 1, look.end() - 1);
  const double before = *(best - 1), here = *best, after = *(best + 1), bend = before - 2.0 * here + after;
  if (!(bend < 0.0)) return {};
  const double step = std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
  if (!(here + 0.25 * (after - before) * step > 0.0)) return {};
  return (static_cast<double>(best - look.begin()) + step) / kLooks;
}

/// Fills `turns_`: places of the edges of pieces where the pressure turns and has another sign than at both ends. @param any  else none is looked for
void MarchRuleSolver::find_turns(PairPressure& pressure, Thirds third, std::span<const Piece> from, bool any) {
  turns_.assign(from.size(), {});
  feet_.clear();
  for (std::size_t p = 0; any && p < from.size(); ++p) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::optional<double> t = turn(from[p], k);
      if (!t) continue;
      const Vec2 at = (1.0 - *t) * from[p].corner[(k + 1) % 3].at + *t * from[p].corner[(k + 2) % 3].at;
      turns_[p][k].emplace();
      feet_.add(from[p].triangle, at, height_at(from[p], at));
    }
  }
  place(pressure, third, feet_);
  std::size_t place_of_turn = 0;
  for (std::size_t p = 0; p < from.size(); ++p) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (!turns_[p][k]) continue;
      const Foot found = foot(feet_, place_of_turn++);
      if (found.good && (found.pressure > 0.0) != (from[p].corner[(k + 1) % 3].pressure > 0.0)) turns_[p][k] = found;
      else turns_[p][k].reset();
    }
  }
}

/// The corners of the smaller ones of a piece, three each. @param turned  where the pressure turns on its edges
void MarchRuleSolver::divide(const Piece& p, const std::array<std::optional<Foot>, 3>& turned, std::vector<std::array<Foot, 3>>& to) const {
  const auto turns = std::count_if(turned.begin(), turned.end(), [](const auto& t) { return t.has_value(); });
  if (turns == 0 || turns == 3) {
    std::array<Foot, 3> middle = p.middle;
    for (std::size_t k = 0; k < 3 && turns == 3; ++k) middle[k] = *turned[k];
    for (std::size_t k = 0; k < 3; ++k) to.push_back({p.corner[k], middle[(k + 2) % 3], middle[(k + 1) % 3]});
    to.push_back(middle);
    return;
  }
  std::size_t i = 0;  // whose edges are both alike
  while (turned[i].has_value() != (turns == 1)) ++i;
  const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
  const Foot &a = p.corner[i], &b = p.corner[j], &c = p.corner[k];
  if (turns == 1) {
    to.push_back({a, b, *turned[i]});
    to.push_back({a, *turned[i], c});
    return;
  }
  const Foot &to_b = *turned[k], &to_c = *turned[j];
  const auto length = [&](const Foot& s, const Foot& t) { return (plane(p.triangle, t.at) - plane(p.triangle, s.at)).norm(); };
  to.push_back({a, to_b, to_c});
  if (length(to_b, c) < length(to_c, b)) {
    to.push_back({to_b, b, c});
    to.push_back({to_b, c, to_c});
  } else {
    to.push_back({to_b, b, to_c});
    to.push_back({to_c, b, c});
  }
}

/// Ends of edges of pieces become corners of smaller ones: four of each, or where `at_turns` and the pressure turns on edges, so that both rims of a narrow
/// band cross it, as many as have a corner on its ridge and one rim each.
void MarchRuleSolver::split(PairPressure& pressure, Thirds third, std::span<const Piece> from, bool at_turns, std::vector<Piece>& to) {
  find_turns(pressure, third, from, at_turns);
  feet_.clear();
  const std::size_t first = to.size();
  for (std::size_t n = 0; n < from.size(); ++n) {
    divided_.clear();
    divide(from[n], turns_[n], divided_);
    for (const std::array<Foot, 3>& corner : divided_) {
      Piece& piece = to.emplace_back();
      piece.triangle = from[n].triangle;
      piece.corner = corner;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2 at = 0.5 * (corner[(k + 1) % 3].at + corner[(k + 2) % 3].at);
        feet_.add(piece.triangle, at, height_at(from[n], at));
      }
    }
  }
  place(pressure, third, feet_);
  for (std::size_t i = first; i < to.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) to[i].middle[k] = foot(feet_, 3 * (i - first) + k);
  }
}

/// Whether a piece with places that were not found may matter at all, by the bounds of the fields.
bool MarchRuleSolver::may_press(const PairPressure& pressure, const Piece& piece) const {
  Box box;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2& at = piece.corner[k].at;
    box.include(plane(piece.triangle, at));
    if (std::abs(piece.corner[k].height) <= cell_) box.include(plane(piece.triangle, at) + piece.corner[k].height * along(piece.triangle, at));
  }
  return pressure.may_meet(box.inflated(0.5 * box.extent().norm()));
}

/// Whether the image of a triangle of the mesh bends so little that Newton's method finds all of it.
bool MarchRuleSolver::smooth(const Piece& piece, double error) const {
  const Smoothness& least = error >= kCoarseError ? kSmoothEnough : kSmooth;
  const auto& c = mesh_.triangle[piece.triangle].corner;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!piece.corner[k].good || !piece.middle[k].good || std::abs(piece.middle[k].height) > least.flat * cell_) return false;
    if (mesh_.normal[c[k]].dot(mesh_.normal[c[(k + 1) % 3]]) < least.turn) return false;
  }
  return true;
}

/// Takes out pieces that certainly do not press, and splits those whose rim is in doubt until they are small; appends leaves.
void MarchRuleSolver::settle(PairPressure& pressure, Thirds third, double error, std::vector<Piece>& pieces) {
  double held = 0.0;  // area that presses, about
  for (const Leaf& leaf : leaves_) held += leaf.sums.area;
  const auto add = [&](const Piece& piece, const Shape& shape, double area) {
    Leaf leaf;
    leaf.piece = piece;
    leaf.shape = shape;
    if (!shape.certain) {
      leaf.doubt = area;
      leaf.doubt_load = area * shape.most;
    }
    leaves_.push_back(leaf);
  };
  for (int level = 0; !pieces.empty(); ++level) {
    doubtful_.clear();
    for (const Piece& piece : pieces) {
      const Shape shape = shape_of(piece);
      if (shape.part == Part::None && shape.certain) continue;
      const double area = area_of(piece);
      if (shape.certain) {
        add(piece, shape, area);
        int positive = 0;
        for (std::size_t k = 0; k < 3; ++k) positive += (piece.corner[k].pressure > 0.0 ? 1 : 0) + (piece.middle[k].pressure > 0.0 ? 1 : 0);
        held += area * positive / 6.0;
        continue;
      }
      const bool good = std::all_of(piece.corner.begin(), piece.corner.end(), [](const Foot& f) { return f.good; }) &&
                        std::all_of(piece.middle.begin(), piece.middle.end(), [](const Foot& f) { return f.good; });
      if (good || may_press(pressure, piece)) doubtful_.push_back(piece);
    }
    const bool last = level == kMostLevels || leaves_.size() + 4 * doubtful_.size() > kMostPieces;
    std::size_t left = 0;
    for (const Piece& piece : doubtful_) {
      const double area = area_of(piece);
      if (last || area < kDoubt * error * held) {
        add(piece, shape_of(piece), area);
      } else {
        doubtful_[left++] = piece;
      }
    }
    doubtful_.resize(left);
    pieces.clear();
    split(pressure, third, doubtful_, true, pieces);
  }
}

}  // namespace supple::collision
