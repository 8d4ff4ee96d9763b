#include "march_rule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace supple::collision {
namespace {

constexpr double kFlat = 0.2;          // in cells: highest middle of an edge of a mesh that is fine enough
constexpr double kLeastTurn = 0.5;     // cosine between normals of such a mesh's triangle
constexpr double kMargin = 2.0;        // of a cubic polynomial, in what it misses at the middles of edges
constexpr double kDoubt = 1.0 / 64.0;  // share of the error asked for that a single doubtful piece may be
constexpr int kMostLevels = 24;        // of splitting doubtful pieces at once

}  // namespace

double MarchRuleSolver::height_at(const Piece& piece, const Vec2& at) {
  return quadratic(piece, at, [](const Foot& f) { return f.height; });
}

/// By the Bezier controls of the cubic polynomial with the values and slopes at the corners.
MarchRuleSolver::Shape MarchRuleSolver::shape_of(const Piece& piece) const {
  const auto& c = piece.corner;
  bool good = true;
  std::size_t positive = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    good = good && c[i].good && piece.middle[i].good;
    positive += c[i].pressure > 0.0 ? 1 : 0;
  }
  std::array<std::array<double, 3>, 3> edge{};  // [i][j]: next to corner i on the way to j
  double margin = 0.0, lowest = std::numeric_limits<double>::infinity(), highest = -lowest, sum = 0.0;
  const auto see = [&](double control) {
    lowest = std::min(lowest, control);
    highest = std::max(highest, control);
  };
  for (std::size_t i = 0; i < 3; ++i) {
    see(c[i].pressure);
    for (std::size_t j = 0; j < 3; ++j) {
      if (i == j) continue;
      edge[i][j] = c[i].pressure + c[i].slope.dot(c[j].at - c[i].at) / 3.0;
      see(edge[i][j]);
      sum += edge[i][j] / 4.0 - c[i].pressure / 12.0;
    }
  }
  see(sum);
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const double middle = (c[j].pressure + 3.0 * (edge[j][k] + edge[k][j]) + c[k].pressure) / 8.0;
    margin = std::max(margin, kMargin * std::abs(piece.middle[i].pressure - middle));
  }
  Shape shape;
  shape.most = std::max(highest + margin, 0.0);
  if (positive == 0) {
    shape.certain = good && highest < -margin;
    return shape;
  }
  if (positive == 3) {
    shape.part = Part::All;
    shape.certain = good && lowest > margin;
    return shape;
  }
  shape.part = positive == 1 ? Part::Corner : Part::AllButCorner;
  const double sign = positive == 1 ? 1.0 : -1.0;  // of the lone corner
  std::size_t lone = 0;
  while ((c[lone].pressure > 0.0) != (positive == 1)) ++lone;
  const std::size_t i = lone;
  std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
  // Rays run along the edge that crosses the rim more steeply.
  const Vec3 x = plane(piece.triangle, c[i].at);
  const auto fall = [&](std::size_t to) { return std::abs(c[i].pressure - c[to].pressure) / (plane(piece.triangle, c[to].at) - x).norm(); };
  if (fall(k) > fall(j)) std::swap(j, k);
  const double inner = sum;
  // Along the rays the pressure only goes away from that of the lone corner: differences of controls are those of its rate.
  const auto steady = [&](std::size_t to, std::size_t other) {
    const std::array<double, 6> steps{edge[i][to] - c[i].pressure, edge[to][i] - edge[i][to],     c[to].pressure - edge[to][i],
                                      inner - edge[i][other],      edge[to][other] - inner, edge[other][to] - edge[other][i]};
    return std::all_of(steps.begin(), steps.end(), [&](double step) { return sign * step < -margin; });
  };
  if (!steady(j, k)) std::swap(j, k);
  shape.order = {i, j, k};
  // Controls along the edge across, from the lone corner: once they have changed sign, they stay so.
  const bool once = !(sign * edge[i][k] < 0.0 && sign * edge[k][i] > 0.0);
  shape.certain = good && once && steady(j, k) && sign * edge[j][k] < -margin && sign * edge[k][j] < -margin;
  return shape;
}

/// The triangles of the mesh as pieces.
void MarchRuleSolver::begin(PairPressure& pressure, std::span<const ContactBody* const> third, std::vector<Piece>& pieces) {
  const std::array<Vec2, 6> at{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(0.5, 0.5), Vec2(0, 0.5), Vec2(0.5, 0)};
  pieces.clear();
  feet_.clear();
  for (std::uint32_t t = 0; t < mesh_.triangle.size(); ++t) {
    Piece piece;
    piece.triangle = t;
    pieces.push_back(piece);
    for (const Vec2& x : at) feet_.add(t, x, 0.0);
  }
  place(pressure, third, feet_);
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (std::size_t k = 0; k < 3; ++k) {
      pieces[p].corner[k] = foot(feet_, 6 * p + k);
      pieces[p].middle[k] = foot(feet_, 6 * p + 3 + k);
    }
  }
}

/// Four pieces of each.
void MarchRuleSolver::split(PairPressure& pressure, std::span<const ContactBody* const> third, std::span<const Piece> from,
                            std::vector<Piece>& to) {
  feet_.clear();
  const std::size_t first = to.size();
  for (const Piece& p : from) {
    const auto add = [&](const Foot& a, const Foot& b, const Foot& c) {
      Piece piece;
      piece.triangle = p.triangle;
      piece.corner = {a, b, c};
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2 at = 0.5 * (piece.corner[(k + 1) % 3].at + piece.corner[(k + 2) % 3].at);
        feet_.add(p.triangle, at, height_at(p, at));
      }
      to.push_back(piece);
    };
    for (std::size_t k = 0; k < 3; ++k) add(p.corner[k], p.middle[(k + 2) % 3], p.middle[(k + 1) % 3]);
    add(p.middle[0], p.middle[1], p.middle[2]);
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
bool MarchRuleSolver::smooth(const Piece& piece) const {
  const auto& c = mesh_.triangle[piece.triangle].corner;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!piece.corner[k].good || !piece.middle[k].good || std::abs(piece.middle[k].height) > kFlat * cell_) return false;
    if (mesh_.normal[c[k]].dot(mesh_.normal[c[(k + 1) % 3]]) < kLeastTurn) return false;
  }
  return true;
}

/// Takes out pieces that certainly do not press, and splits those whose rim is in doubt until they are small; appends leaves.
void MarchRuleSolver::settle(PairPressure& pressure, std::span<const ContactBody* const> third, double error, std::vector<Piece>& pieces) {
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
    split(pressure, third, doubtful_, pieces);
  }
}

}  // namespace supple::collision
