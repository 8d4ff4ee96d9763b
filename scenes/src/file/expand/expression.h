/// @file expression.h
/// Expressions in scene files: numbers with units, variables, + - * / ^ and functions. Nothing is executed: an expression has a value
/// or a fault.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "file/yaml/yaml_quantity.h"

namespace supple::scenes {

/// The value of an expression or of a variable: a quantity in SI units, or a text.
struct Value {
  double number = 0.0;
  Dimension dimension;
  bool is_text = false;
  bool quoted = false;  ///< a text that was in quotes
  std::string text;

  /// As a scene spells it: "0.05 m", "3", a text.
  [[nodiscard]] std::string spelt() const;
};

/// Why an expression has no value.
struct ExpressionFault {
  std::string expected, found, hint;
};

/// Values of variables by name; none for a name that is not one. May throw an ExpressionFault.
using FindVariable = std::function<std::optional<Value>(std::string_view)>;

/// The value of the text between "${" and "}". Grammar: sums of products of powers; a number may be followed by units ("2 cm", "3 N s"),
/// which belong to it; a name is a variable, a unit, `pi` or a function: sqrt, abs, min, max, floor, ceil, round, exp, log, sin, cos, tan,
/// asin, acos, atan, atan2. Dimensions are checked. @param known  names of variables, for hints  @throws ExpressionFault
[[nodiscard]] Value evaluate_expression(std::string_view text, const FindVariable& variables, std::span<const std::string_view> known = {});

/// Whether a variable may have this name: a word that is no unit, function or constant. Otherwise what is wrong with it.
[[nodiscard]] std::optional<ExpressionFault> fault_of_name(std::string_view name);

}  // namespace supple::scenes
