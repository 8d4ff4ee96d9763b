#include "file/course.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "file/read_scene_faults.h"

namespace supple::scenes {
namespace {

constexpr double kPointsOfFrame = 64.0;
constexpr double kMostPoints = 1e6;

/// @throws ExpressionFault
double value_at(std::string_view expression, double time) {
  const Value value = evaluate_expression(expression, [time](std::string_view name) -> std::optional<Value> {
    if (name != "t") return std::nullopt;
    return Value{.number = time, .dimension = kTime.dimension, .text = {}};
  });
  if (value.is_text || !(value.dimension == Dimension{})) throw ExpressionFault{"expected a number without unit", value.spelt(), "divide by a unit: t/(1 s)"};
  if (!std::isfinite(value.number)) throw ExpressionFault{"expected a finite number", "another at t = " + short_text(time) + " s", ""};
  return value.number;
}

}  // namespace

std::optional<ExpressionFault> fault_of_course(std::string_view expression) try {
  (void)value_at(expression, 0.0);
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
  if (!d->expression.empty()) {
    const auto points = static_cast<std::size_t>(std::clamp(std::ceil(scene.duration * scene.frame_rate * kPointsOfFrame), 1.0, kMostPoints));
    for (std::size_t k = 0; k <= points; ++k) {
      course->time.push_back(scene.duration * static_cast<double>(k) / static_cast<double>(points));
      course->factor.push_back(value_at(d->expression, course->time.back()));
    }
  }
  return course;
}

}  // namespace supple::scenes
