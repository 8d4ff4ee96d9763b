#include "mesh/delaunay/patch_surface.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/partition/polygonise_roots.h"

namespace supple::implicit {

using lattice::Label;
using lattice::LabelSet;

Shape shape_of(const Corners& c) {
  Shape s{};
  std::array<double, 3> edge{};  // opposite to the corners
  for (std::size_t k = 0; k < 3; ++k) edge[k] = (c[(k + 2) % 3] - c[(k + 1) % 3]).norm();
  s.sharpest = static_cast<std::size_t>(std::min_element(edge.begin(), edge.end()) - edge.begin());
  s.shortest = edge[s.sharpest];
  const Vec3 u = c[1] - c[0], w = c[2] - c[0], n = u.cross(w);
  const double n2 = n.squaredNorm();
  const std::size_t k = s.sharpest;
  const Vec3 p = c[(k + 1) % 3] - c[k], q = c[(k + 2) % 3] - c[k];
  s.angle = std::atan2(std::sqrt(n2), p.dot(q));
  s.centre = c[0] + (u.squaredNorm() * w.cross(n) + w.squaredNorm() * n.cross(u)) / (2.0 * n2);
  s.radius = n2 > 0.0 ? (s.centre - c[0]).norm() : std::numeric_limits<double>::infinity();
  return s;
}

PatchSurface::PatchSurface(std::span<const FieldView> fields) : fields_(fields) {
  for (const FieldView& field : fields) box_.push_back(field.surface_box());
}

std::optional<Vec3> PatchSurface::settle(const LabelSet& labels, const Vec3& start, double within) const {
  constexpr int kMaxRounds = 40;
  const std::size_t n = std::min<std::size_t>(labels.count, 4) - 1;  // equations
  Vec3 x = start, last = start;
  double last_norm = std::numeric_limits<double>::infinity(), level = 0.0;
  for (int round = 0; round < kMaxRounds; ++round) {
    Eigen::Matrix<double, 3, 3> slope = Eigen::Matrix<double, 3, 3>::Zero();
    Vec3 difference = Vec3::Zero(), first_slope = Vec3::Zero();
    level = 0.0;
    double scale = 0.0;
    if (labels.label[0] != 0) level = fields_[labels.label[0] - 1].value(x, first_slope);
    bool close = true;
    for (std::size_t k = 0; k < n; ++k) {
      Vec3 gradient;
      const auto row = static_cast<Eigen::Index>(k);
      const double f = fields_[labels.label[k + 1] - 1].value(x, gradient);
      scale = std::max({scale, std::abs(f), std::abs(level)});
      difference[row] = f - level;
      slope.row(row) = (gradient - first_slope).transpose();
      close = close && std::abs(difference[row]) <= lattice::root_tolerance(scale, x, gradient - first_slope);
    }
    if (close) return wins(labels, x, level) ? std::optional(x) : std::nullopt;
    const double norm = difference.norm();
    if (norm > 0.9 * last_norm && (x - last).norm() > 1e-14 * within) {  // half the step instead
      x = 0.5 * (x + last);
      last_norm *= 1.0 + 1e-3;
      continue;
    }
    last = x;
    last_norm = norm;
    const auto rows = static_cast<Eigen::Index>(n);
    x -= slope.topRows(rows).completeOrthogonalDecomposition().solve(difference.head(rows));
    if (!((x - start).norm() <= within)) return std::nullopt;
  }
  return std::nullopt;
}

bool PatchSurface::wins(const LabelSet& labels, const Vec3& x, double level) const {
  constexpr double kTie = 1e-9;
  if (level < -kTie) return false;
  for (std::size_t m = 0; m < fields_.size(); ++m) {
    const auto label = static_cast<Label>(m + 1);
    const auto own = labels.view();
    if (std::find(own.begin(), own.end(), label) != own.end() || !box_[m].contains(x)) continue;
    if (fields_[m].value(x) > level + kTie) return false;
  }
  return true;
}

double PatchSurface::distance_along(const PatchComplex::Triangle& t, const Vec3& from, const Vec3& direction, double most) const {
  double along = 0.0;
  for (int round = 0; round < 8; ++round) {
    Vec3 gradient, other = Vec3::Zero();
    const Vec3 at = from + along * direction;
    double f = fields_[t.inner - 1].value(at, gradient);
    if (t.outer != 0) f -= fields_[t.outer - 1].value(at, other);
    const double slope = (gradient - other).dot(direction);
    if (slope == 0.0) break;
    const double step = -f / slope;
    if (!(std::abs(along + step) <= most)) break;
    along += step;
  }
  return std::abs(along);
}

double PatchSurface::uprightness(const PatchComplex::Triangle& t, const Corners& corner, double most) const {
  const Vec3 middle = (corner[0] + corner[1] + corner[2]) / 3.0, normal = normal_of(corner);
  Vec3 slope, other = Vec3::Zero();
  double f = fields_[t.inner - 1].value(middle, slope);
  if (t.outer != 0) f -= fields_[t.outer - 1].value(middle, other);
  slope -= other;
  const double steepness = slope.norm(), size = normal.norm();
  if (std::abs(f) > most * steepness) return -1.0;
  return size > 0.0 && steepness > 0.0 ? -slope.dot(normal) / (steepness * size) : 1.0;
}

bool PatchSurface::is_folded(const PatchComplex& complex, double least) const {
  for (std::uint32_t t = 0; t < complex.triangles().size(); ++t) {
    const PatchComplex::Triangle& triangle = complex.triangle(t);
    if (triangle.alive && uprightness(triangle, complex.corners(t), std::numeric_limits<double>::infinity()) < least) return true;
  }
  return false;
}

}  // namespace supple::implicit
