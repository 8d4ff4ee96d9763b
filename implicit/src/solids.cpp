#include "supple/implicit/solids.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "single_part.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Weights of the uniform cubic B-spline at t in [0, 1] from knot k, for the coefficients k-1 .. k+2, and their slopes.
struct SplineWeights {
  double value[4];
  double slope[4];
  explicit SplineWeights(double t) {
    const double s = 1.0 - t;
    value[0] = s * s * s / 6.0;
    value[1] = (3.0 * t * t * (t - 2.0) + 4.0) / 6.0;
    value[2] = (3.0 * s * s * (s - 2.0) + 4.0) / 6.0;
    value[3] = t * t * t / 6.0;
    slope[0] = -0.5 * s * s;
    slope[1] = 0.5 * t * (3.0 * t - 4.0);
    slope[2] = -0.5 * s * (3.0 * s - 4.0);
    slope[3] = 0.5 * t * t;
  }
};

/// B-spline coefficients c_-1 .. c_n of the cubic through f_0 .. f_n-1 that ends with slope 0 (mirrored data): solves
/// c_k-1 + 4 c_k + c_k+1 = 6 f_k. `line` holds f in [1, n] and receives c in [0, n + 1].
void spline_coefficients(std::span<double> line, std::vector<double>& upper) {
  const std::size_t n = line.size() - 2;
  upper.resize(n + 1);
  // c_0 = c_2 and c_n+1 = c_n-1 in the numbering of `line`.
  upper[1] = 0.5;
  line[1] = 6.0 * line[1] / 4.0;
  for (std::size_t k = 2; k <= n; ++k) {
    const double below = k == n ? 2.0 : 1.0;
    const double pivot = 4.0 - below * upper[k - 1];
    upper[k] = 1.0 / pivot;
    line[k] = (6.0 * line[k] - below * line[k - 1]) / pivot;
  }
  for (std::size_t k = n - 1; k >= 1; --k) line[k] -= upper[k] * line[k + 1];
  line[0] = line[2];
  line[n + 1] = line[n - 1];
}

}  // namespace

SolidBox::SolidBox(const Pose& pose, const Vec3& half_sizes, double rounding, double slope)
    : centre_(pose.position),
      rotation_(pose.orientation.toRotationMatrix()),
      half_(half_sizes),
      rounding_(rounding),
      slope_(slope) {
  SUPPLE_EXPECTS(half_sizes.minCoeff() > 0.0 && slope > 0.0);
  SUPPLE_EXPECTS(rounding >= 0.0 && rounding <= half_sizes.minCoeff());
}

double SolidBox::evaluate(const Vec3& point, Vec3* gradient) const {
  const Vec3 y = rotation_.transpose() * (point - centre_);
  const Vec3 over = y.cwiseAbs() - half_ + Vec3::Constant(rounding_);
  Vec3 outward = over.cwiseMax(0.0);
  double distance = outward.norm();
  if (distance > 0.0) {
    outward /= distance;
  } else {
    Eigen::Index nearest = 0;
    distance = over.maxCoeff(&nearest);
    outward = Vec3::Unit(nearest);
  }
  if (gradient != nullptr) {
    for (int k = 0; k < 3; ++k) outward[k] = std::copysign(outward[k], y[k]);
    *gradient = -slope_ * (rotation_ * outward);
  }
  return slope_ * (rounding_ - distance);
}

void SolidBox::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], nullptr);
}

void SolidBox::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], &gradients[i]);
}

void SolidBox::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { evaluate_single_part(*this, points, parts); }

Interval SolidBox::bound(const Box& box) const {
  const double most = slope_ * half_.minCoeff();
  if (!box.lower.allFinite() || !box.upper.allFinite()) return {-kInfinity, most};
  // A distance changes by at most the way; the rest is round-off.
  const double way = slope_ * 0.5 * box.extent().norm();
  const double value = evaluate(box.centre(), nullptr);
  const double scale = slope_ * (box.centre().norm() + centre_.norm() + half_.norm()) + way;
  const double round_off = 16.0 * std::numeric_limits<double>::epsilon() * scale;
  return {value - way - round_off, std::min(value + way, most) + round_off};
}

double SolidBox::gradient_bound(const Box&) const { return slope_ * (1.0 + 16.0 * std::numeric_limits<double>::epsilon()); }

Box SolidBox::surface_box() const {
  const Vec3 reach = (rotation_.cwiseAbs() * half_) * (1.0 + 16.0 * std::numeric_limits<double>::epsilon());
  return {centre_ - reach, centre_ + reach};
}

std::optional<CorePoint> SolidBox::core_point(const Vec3& place) const {
  const Vec3 y = rotation_.transpose() * (place - centre_);
  const Vec3 reach = half_ - Vec3::Constant(rounding_);
  return CorePoint{centre_ + rotation_ * y.cwiseMax(-reach).cwiseMin(reach), rounding_};
}

double SolidBox::feature_size() const { return 2.0 * half_.minCoeff(); }

Mesh SolidBox::mesh() const {
  Mesh mesh;
  const auto corner = [this](double x, double y, double z) {
    return Vec3(centre_ + rotation_ * Vec3(x, y, z).cwiseProduct(half_));
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const auto at = [&](double u, double v) {
        Vec3 p;
        p[axis] = side;
        p[(axis + 1) % 3] = side * u;
        p[(axis + 2) % 3] = v;
        return corner(p.x(), p.y(), p.z());
      };
      add_quadrangle(mesh, at(-1, -1), at(1, -1), at(1, 1), at(-1, 1));
    }
  }
  return mesh;
}

HeightField::HeightField(const Vec3& corner, double spacing, std::size_t columns, std::size_t rows,
                         std::span<const double> heights, double slope)
    : corner_(corner), spacing_(spacing), columns_(columns), rows_(rows), slope_(slope), steepest_(0.0) {
  SUPPLE_EXPECTS(columns >= 2 && rows >= 2 && heights.size() == columns * rows);
  SUPPLE_EXPECTS(spacing > 0.0 && slope > 0.0);
  coefficient_.assign((columns + 2) * (rows + 2), 0.0);
  std::vector<double> upper;
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i) coefficient_[index(i + 1, j + 1)] = heights[j * columns + i];
    spline_coefficients(std::span(coefficient_).subspan(index(0, j + 1), columns + 2), upper);
  }
  std::vector<double> line(rows + 2);
  for (std::size_t i = 0; i < columns + 2; ++i) {
    for (std::size_t j = 1; j <= rows; ++j) line[j] = coefficient_[index(i, j)];
    spline_coefficients(line, upper);
    for (std::size_t j = 0; j < rows + 2; ++j) coefficient_[index(i, j)] = line[j];
  }
  // Slopes of a B-spline are means of the differences of its coefficients.
  double along_x = 0.0, along_y = 0.0;
  for (std::size_t j = 0; j < rows + 2; ++j) {
    for (std::size_t i = 0; i < columns + 2; ++i) {
      if (i > 0) along_x = std::max(along_x, std::abs(coefficient_[index(i, j)] - coefficient_[index(i - 1, j)]));
      if (j > 0) along_y = std::max(along_y, std::abs(coefficient_[index(i, j)] - coefficient_[index(i, j - 1)]));
    }
  }
  steepest_ = std::hypot(along_x, along_y) / spacing;
}

Vec3 HeightField::height(double x, double y) const {
  const double last_x = static_cast<double>(columns_ - 1), last_y = static_cast<double>(rows_ - 1);
  const double u = std::clamp((x - corner_.x()) / spacing_, 0.0, last_x);
  const double v = std::clamp((y - corner_.y()) / spacing_, 0.0, last_y);
  const auto i = static_cast<std::size_t>(std::min(u, last_x - 1.0)), j = static_cast<std::size_t>(std::min(v, last_y - 1.0));
  const SplineWeights across(u - static_cast<double>(i)), along(v - static_cast<double>(j));
  Vec3 h = Vec3::Zero();
  for (std::size_t b = 0; b < 4; ++b) {
    double value = 0.0, slope = 0.0;
    const double* row = &coefficient_[index(i, j + b)];
    for (std::size_t a = 0; a < 4; ++a) {
      value += across.value[a] * row[a];
      slope += across.slope[a] * row[a];
    }
    h += Vec3(along.value[b] * value, along.value[b] * slope / spacing_, along.slope[b] * value / spacing_);
  }
  return h + Vec3(corner_.z(), 0.0, 0.0);
}

void HeightField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    values[i] = slope_ * (height(points[i].x(), points[i].y()).x() - points[i].z());
  }
}

void HeightField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 h = height(points[i].x(), points[i].y());
    values[i] = slope_ * (h.x() - points[i].z());
    gradients[i] = slope_ * Vec3(h.y(), h.z(), -1.0);
  }
}

void HeightField::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
  evaluate_single_part(*this, points, parts);
}

Interval HeightField::bound(const Box& box) const {
  // A B-spline lies between the coefficients that reach a place.
  const auto cell = [](double at, double corner, double spacing, std::size_t count) {
    const double u = std::clamp((at - corner) / spacing, 0.0, static_cast<double>(count - 1));
    return static_cast<std::size_t>(std::min(u, static_cast<double>(count) - 2.0));
  };
  const std::size_t left = cell(box.lower.x(), corner_.x(), spacing_, columns_);
  const std::size_t right = cell(box.upper.x(), corner_.x(), spacing_, columns_);
  const std::size_t front = cell(box.lower.y(), corner_.y(), spacing_, rows_);
  const std::size_t back = cell(box.upper.y(), corner_.y(), spacing_, rows_);
  Interval h{kInfinity, -kInfinity};
  for (std::size_t j = front; j <= back + 3; ++j) {
    for (std::size_t i = left; i <= right + 3; ++i) {
      const double c = coefficient_[index(i, j)];
      h.lower = std::min(h.lower, c);
      h.upper = std::max(h.upper, c);
    }
  }
  const double lower = h.lower + corner_.z() - box.upper.z(), upper = h.upper + corner_.z() - box.lower.z();
  double scale = std::abs(corner_.z()) + std::max(std::abs(h.lower), std::abs(h.upper));
  for (const double z : {box.lower.z(), box.upper.z()}) scale += std::isfinite(z) ? std::abs(z) : 0.0;
  const double round_off = 32.0 * std::numeric_limits<double>::epsilon() * scale;
  return {slope_ * (lower - round_off), slope_ * (upper + round_off)};
}

double HeightField::gradient_bound(const Box&) const {
  return slope_ * std::hypot(1.0, steepest_) * (1.0 + 16.0 * std::numeric_limits<double>::epsilon());
}

Box HeightField::surface_box() const {
  const double top = corner_.z() + *std::max_element(coefficient_.begin(), coefficient_.end());
  return {Vec3::Constant(-kInfinity), Vec3(kInfinity, kInfinity, top)};
}

double HeightField::feature_size() const { return 2.0 * spacing_; }

Mesh HeightField::mesh(int finer) const {
  SUPPLE_EXPECTS(finer >= 1);
  const std::size_t across = (columns_ - 1) * static_cast<std::size_t>(finer) + 1;
  const std::size_t along = (rows_ - 1) * static_cast<std::size_t>(finer) + 1;
  Mesh mesh;
  for (std::size_t j = 0; j < along; ++j) {
    for (std::size_t i = 0; i < across; ++i) {
      const double x = corner_.x() + spacing_ * static_cast<double>(i) / finer;
      const double y = corner_.y() + spacing_ * static_cast<double>(j) / finer;
      const Vec3 h = height(x, y);
      mesh.position.emplace_back(x, y, h.x());
      mesh.normal.push_back(Vec3(-h.y(), -h.z(), 1.0).normalized());
    }
  }
  for (std::size_t j = 0; j + 1 < along; ++j) {
    for (std::size_t i = 0; i + 1 < across; ++i) {
      const auto a = static_cast<std::uint32_t>(j * across + i), b = a + 1;
      const auto d = static_cast<std::uint32_t>(a + across), c = d + 1;
      mesh.triangle.push_back({a, b, c});
      mesh.triangle.push_back({a, c, d});
    }
  }
  return mesh;
}

MovedField::MovedField(const FieldView& field, const Pose& pose)
    : field_(field), position_(pose.position), rotation_(pose.orientation.toRotationMatrix()) {}

std::vector<Vec3> MovedField::local(std::span<const Vec3> points) const {
  std::vector<Vec3> moved;
  moved.reserve(points.size());
  for (const Vec3& x : points) moved.emplace_back(rotation_.transpose() * (x - position_));
  return moved;
}

Box MovedField::local(const Box& box) const {
  const Vec3 centre = rotation_.transpose() * (box.centre() - position_);
  const Vec3 half = 0.5 * rotation_.cwiseAbs().transpose() * box.extent();
  return {centre - half, centre + half};
}

void MovedField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  field_.evaluate(local(points), values);
}

void MovedField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  field_.evaluate(local(points), values, gradients);
  for (Vec3& g : gradients) g = rotation_ * g;
}

void MovedField::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
  field_.evaluate_parts(local(points), parts);
  for (Vec3& g : parts.gradient) g = rotation_ * g;
  for (Vec3& g : parts.by_turn) g = rotation_ * g;
}

Box MovedField::surface_box() const {
  Box box = field_.surface_box();
  if (box.empty()) return box;
  if (rotation_ == Mat3::Identity()) return {box.lower + position_, box.upper + position_};
  if (!box.lower.allFinite() || !box.upper.allFinite()) {
    const Vec3 infinite = Vec3::Constant(std::numeric_limits<double>::infinity());
    return {-infinite, infinite};
  }
  const Vec3 centre = rotation_ * box.centre() + position_;
  const Vec3 half = 0.5 * rotation_.cwiseAbs() * box.extent();
  return {centre - half, centre + half};
}

std::optional<CorePoint> MovedField::core_point(const Vec3& place) const {
  std::optional<CorePoint> core = field_.core_point(rotation_.transpose() * (place - position_));
  if (core) core->point = rotation_ * core->point + position_;
  return core;
}

}  // namespace supple::implicit
