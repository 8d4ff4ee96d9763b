#include <cmath>
#include <limits>

#include "supple/core/error.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void DepthField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  std::vector<Vec3> gradients(points.size());
  evaluate(points, values, gradients);
}

void DepthField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  field_.evaluate(points, values, gradients);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double slope = gradients[i].norm();
    if (slope > 0.0) gradients[i] /= slope;
    if (values[i] != 0.0) values[i] /= slope;
  }
}

Interval DepthField::bound(const Box& box) const {
  const Interval value = field_.bound(box);
  const double steepest = field_.gradient_bound(box);
  return {value.lower > 0.0 ? value.lower / steepest : -kInfinity, value.upper < 0.0 ? value.upper / steepest : kInfinity};
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  std::vector<Vec3> gradients(points.size());
  evaluate(points, values, gradients);
}

void UnitedField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  std::vector<double> value(points.size());
  std::vector<Vec3> gradient(points.size());
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    fields_[k].evaluate(points, value, gradient);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (k > 0 && !(value[i] > values[i])) continue;
      values[i] = value[i];
      gradients[i] = gradient[i];
    }
  }
}

void UnitedField::evaluate_parts(std::span<const Vec3>, FieldParts&) const { SUPPLE_EXPECTS(false && "parts of one body"); }

Interval UnitedField::bound(const Box& box) const {
  Interval result = fields_.front().bound(box);
  for (const FieldView& field : std::span(fields_).subspan(1)) {
    const Interval other = field.bound(box);
    result.lower = std::max(result.lower, other.lower);
    result.upper = std::max(result.upper, other.upper);
  }
  return result;
}

double UnitedField::gradient_bound(const Box& box) const {
  double largest = 0.0;
  for (const FieldView& field : fields_) largest = std::max(largest, field.gradient_bound(box));
  return largest;
}

Box UnitedField::surface_box() const {
  Box box;
  for (const FieldView& field : fields_) {
    if (const Box other = field.surface_box(); !other.empty()) box = box.united(other);
  }
  return box;
}

double UnitedField::feature_size() const {
  double least = std::numeric_limits<double>::infinity();
  for (const FieldView& field : fields_) least = std::min(least, field.feature_size());
  return least;
}

}  // namespace supple::implicit
