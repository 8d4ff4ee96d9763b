#include "file/expand/course.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "file/read_scene_faults.h"

namespace supple::scenes {
namespace {

constexpr double kPointsOfFrame = 64.0;
constexpr double kMostPoints = 1e6;

/// @throws ExpressionFault
double value_at(std::string_view expression, const Quantity& quantity, double time) {
  const Value value = evaluate_expression(expression, [time](std::string_view name) -> std::optional<Value> {
    if (name != "t") return std::nullopt;
    return Value{.number = time, .dimension = kTime.dimension, .text = {}};
  });
  if (value.is_text || !(value.dimension == quantity.dimension)) {
    const bool plain = quantity.dimension == Dimension{};
    throw ExpressionFault{plain ? "expected a number without unit" : "expected a length", value.spelt(), plain ? "divide by a unit: t/(1 s)" : "5 cm*sin(2*pi*t/(1 s))"};
  }
  if (!std::isfinite(value.number)) throw ExpressionFault{"expected a finite number", "another at t = " + short_text(time) + " s", ""};
  return value.number;
}

/// Values at every 64th of a frame until the end of the scene.
void add_table(std::string_view expression, const Quantity& quantity, const Scene& scene, core::Course& course) {
  const auto points = static_cast<std::size_t>(std::clamp(std::ceil(scene.duration * scene.frame_rate * kPointsOfFrame), 1.0, kMostPoints));
  for (std::size_t k = 0; k <= points; ++k) {
    course.time.push_back(scene.duration * static_cast<double>(k) / static_cast<double>(points));
    course.factor.push_back(value_at(expression, quantity, course.time.back()));
  }
}

}  // namespace

std::optional<ExpressionFault> fault_of_way(std::string_view expression) try {
  const double start = value_at(expression, kLength, 0.0);
  if (std::abs(start) <= 1e-9) return std::nullopt;
  return ExpressionFault{"expected 0 at t = 0, the place at the start", short_text(start) + " m", "subtract this value"};
} catch (const ExpressionFault& fault) {
  return fault;
}

std::shared_ptr<const core::Course> way_of(std::string_view expression, const Scene& scene) {
  if (expression.empty()) return nullptr;
  auto way = std::make_shared<core::Course>();
  add_table(expression, kLength, scene, *way);
  return way;
}

std::optional<ExpressionFault> fault_of_course(std::string_view expression) try {
  (void)value_at(expression, kNumber, 0.0);
  return std::nullopt;
} catch (const ExpressionFault& fault) {
  return fault;
}

std::shared_ptr<const core::Course> course_of(const std::optional<CourseDesc>& d, const Scene& scene) {
  if (!d) return nullptr;
  auto course = std::make_shared<core::Course>();
  for (const CourseKeyDesc& key : d->keys) {
    course->time.push_back(key.time);
    course->factor.push_back(key.factor);
  }
  if (!d->expression.empty()) add_table(d->expression, kNumber, scene, *course);
  return course;
}

}  // namespace supple::scenes
