/// @file course.h
/// Courses: factors as functions of time.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "file/expand/expression.h"
#include "supple/core/interactions.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// What is wrong with an expression of t; none where it is a number at t = 0.
[[nodiscard]] std::optional<ExpressionFault> fault_of_course(std::string_view expression);

/// What is wrong with an expression of t for a way [m]; none where it is 0 at t = 0.
[[nodiscard]] std::optional<ExpressionFault> fault_of_way(std::string_view expression);

/// The way along an axis as a table [m], as for a course; null where the expression is empty.
/// @throws ExpressionFault where the expression has no finite value at some time
[[nodiscard]] std::shared_ptr<const core::Course> way_of(std::string_view expression, const Scene& scene);

/// The course as a table: keys, or the expression at every 64th of a frame until the end of the scene; null without one.
/// @throws ExpressionFault where the expression has no finite value at some time
[[nodiscard]] std::shared_ptr<const core::Course> course_of(const std::optional<CourseDesc>& d, const Scene& scene);

}  // namespace supple::scenes
