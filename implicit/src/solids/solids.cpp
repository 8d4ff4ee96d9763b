#include "supple/implicit/solids.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "field/single_part.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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
