#include "file/expand/expression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "file/read_scene_faults.h"
#include "supple/core/math.h"

namespace supple::scenes {
namespace {

constexpr int kDeepestExpression = 64;  // nested parentheses, functions and signs

struct Function {
  std::string_view name;
  std::size_t least, most;  // arguments
};
constexpr std::size_t kAnyNumber = 64;
constexpr std::array kFunctions{
    Function{"sqrt", 1, 1},  Function{"abs", 1, 1},   Function{"min", 1, kAnyNumber}, Function{"max", 1, kAnyNumber},
    Function{"floor", 1, 1}, Function{"ceil", 1, 1},  Function{"round", 1, 1},        Function{"exp", 1, 1},
    Function{"log", 1, 1},   Function{"sin", 1, 1},   Function{"cos", 1, 1},          Function{"tan", 1, 1},
    Function{"asin", 1, 1},  Function{"acos", 1, 1},  Function{"atan", 1, 1},         Function{"atan2", 2, 2}};

const Function* function_named(std::string_view name) {
  const auto* const found = std::find_if(kFunctions.begin(), kFunctions.end(), [&](const Function& f) { return f.name == name; });
  return found == kFunctions.end() ? nullptr : found;
}

bool begins_name(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool in_name(char c) { return begins_name(c) || (c >= '0' && c <= '9'); }
/// Units may have signs of their own: %, the degree sign and the micro sign (more than one byte).
bool begins_unit(char c) { return begins_name(c) || c == '%' || (static_cast<unsigned char>(c) & 0x80U) != 0; }

std::string kind_of(const Dimension& dimension) {
  if (dimension == Dimension{}) return "a number without unit";
  const std::string_view noun = noun_of(dimension);
  if (noun.empty()) return "a quantity in " + si_unit(dimension);
  return with_article(noun) + " [" + si_unit(dimension) + ']';
}

Value pure(double number) { return {.number = number, .dimension = {}, .text = {}}; }

class Parser {
 public:
  Parser(std::string_view text, const FindVariable& variables, std::span<const std::string_view> known)
      : text_(text), variables_(variables), known_(known) {}

  Value all() {
    const Value value = sum();
    skip_blanks();
    if (at_ < text_.size()) fail("expected an operator or the end of the expression", '\'' + shown(text_.substr(at_)) + '\'');
    return value;
  }

 private:
  [[noreturn]] static void fail(std::string expected, std::string found, std::string hint = "") {
    throw ExpressionFault{std::move(expected), std::move(found), std::move(hint)};
  }
  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n')) ++at_;
  }
  bool take(char c) {
    skip_blanks();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }

  Value sum() {
    Value value = product();
    for (;;) {
      const bool plus = take('+');
      if (!plus && !take('-')) return value;
      const Value next = product();
      expect_number(next);
      expect_number(value);
      if (next.dimension != value.dimension) {
        fail("expected " + kind_of(value.dimension) + " after '" + (plus ? "+'" : "-'"), kind_of(next.dimension), "both sides of a sum need the same unit");
      }
      value.number = checked(plus ? value.number + next.number : value.number - next.number);
    }
  }

  Value product() {
    Value value = signed_power();
    for (;;) {
      const bool times = take('*');
      if (!times && !take('/')) return value;
      const Value next = signed_power();
      expect_number(next);
      expect_number(value);
      if (!times && next.number == 0.0) fail("expected a divisor that is not 0", "0");
      value.number = checked(times ? value.number * next.number : value.number / next.number);
      value.dimension = checked(value.dimension * (times ? next.dimension : inverse(next.dimension)));
    }
  }

  Value signed_power() {
    const Depth deeper(*this);
    if (take('-')) {
      Value value = signed_power();
      expect_number(value);
      value.number = -value.number;
      return value;
    }
    if (take('+')) return signed_power();
    Value value = primary();
    if (!take('^')) return value;
    const Value exponent = signed_power();
    expect_number(value);
    expect_pure(exponent, "exponent");
    return power(value, exponent.number);
  }

  static Value power(const Value& base, double exponent) {
    const bool whole = exponent == std::floor(exponent) && std::abs(exponent) <= 64.0;
    if (!whole) {
      expect_pure(base, "base of a power with a fraction as exponent");
      if (base.number < 0.0) fail("expected a base >= 0 of a power with a fraction as exponent", number_text(base.number));
      return pure(checked(base.number == 0.0 ? 0.0 : math::pow(base.number, exponent)));
    }
    if (base.number == 0.0 && exponent < 0.0) fail("expected a divisor that is not 0", "0");
    Value out = pure(1.0);
    for (int k = 0; k < std::abs(static_cast<int>(exponent)); ++k) {
      out.number = exponent > 0.0 ? out.number * base.number : out.number / base.number;
      out.dimension = checked(out.dimension * (exponent > 0.0 ? base.dimension : inverse(base.dimension)));
    }
    out.number = checked(out.number);
    return out;
  }

  Value primary() {
    const Depth deeper(*this);
    skip_blanks();
    if (at_ == text_.size()) fail("expected a number, a variable or '('", "the end of the expression");
    if (take('(')) {
      const Value value = sum();
      if (!take(')')) fail("expected ')'", at_ < text_.size() ? '\'' + shown(text_.substr(at_)) + '\'' : "the end of the expression");
      return value;
    }
    const LeadingNumber number = leading_decimal_of(text_.substr(at_));
    if (number.length > 0) {
      at_ += number.length;
      return with_units(pure(number.value));
    }
    if (begins_name(text_[at_])) return named();
    fail("expected a number, a variable or '('", '\'' + shown(text_.substr(at_)) + '\'');
  }

  /// Units that follow a number, separated by blanks: "2 cm", "3 N s".
  Value with_units(Value value) {
    for (;;) {
      const std::size_t before = at_;
      skip_blanks();
      if (at_ == text_.size() || !begins_unit(text_[at_])) {
        at_ = before;
        return value;
      }
      std::size_t end = at_;
      while (end < text_.size() && (in_name(text_[end]) || begins_unit(text_[end]))) ++end;
      const std::string_view name = text_.substr(at_, end - at_);
      const std::optional<KnownUnit> unit = unit_named(name);
      if (!unit) fail("expected a unit or an operator after a number", '\'' + shown(name) + '\'', "a product is written with '*'");
      at_ = end;
      Value factor{.number = unit->factor, .dimension = unit->dimension, .text = {}};
      if (take('^')) factor = power(factor, signed_power().number);
      value.number = checked(value.number * factor.number);
      value.dimension = checked(value.dimension * factor.dimension);
    }
  }

  Value named() {
    std::size_t end = at_;
    while (end < text_.size() && in_name(text_[end])) ++end;
    const std::string_view name = text_.substr(at_, end - at_);
    at_ = end;
    if (const Function* function = function_named(name)) return call(*function);
    if (name == "pi") return pure(std::numbers::pi);
    if (std::optional<Value> value = variables_(name)) return *value;
    if (const std::optional<KnownUnit> unit = unit_named(name)) return {.number = unit->factor, .dimension = unit->dimension, .text = {}};
    fail("expected a variable, a unit or a function", '\'' + shown(name) + '\'', known_.empty() ? "variables are declared under `variables`" : known_hint(name, known_));
  }

  Value call(const Function& function) {
    if (!take('(')) fail("expected '(' after " + std::string(function.name), "none");
    std::vector<Value> arguments;
    do {
      arguments.push_back(sum());
      expect_number(arguments.back());
    } while (take(',') && arguments.size() <= kAnyNumber);
    if (!take(')')) fail("expected ')' after the arguments of " + std::string(function.name), "none");
    if (arguments.size() < function.least || arguments.size() > function.most) {
      fail("expected " + std::to_string(function.least) + (function.most > function.least ? " or more" : "") + " arguments of " + std::string(function.name),
           std::to_string(arguments.size()));
    }
    return apply(function.name, arguments);
  }

  static Value apply(std::string_view name, const std::vector<Value>& arguments) {
    Value x = arguments[0];
    if (name == "abs") {
      x.number = std::abs(x.number);
      return x;
    }
    if (name == "sqrt") {
      if (x.number < 0.0) fail("expected an argument >= 0 of sqrt", number_text(x.number));
      const std::optional<Dimension> half = root_of(x.dimension);
      if (!half) fail("expected a square of a unit in sqrt", kind_of(x.dimension));
      return {.number = std::sqrt(x.number), .dimension = *half, .text = {}};
    }
    if (name == "min" || name == "max" || name == "atan2") {
      for (const Value& next : arguments) {
        if (next.dimension != x.dimension) fail("expected arguments of " + std::string(name) + " with one unit", kind_of(x.dimension) + " and " + kind_of(next.dimension));
      }
      if (name == "atan2") return angle(math::atan2(x.number, arguments[1].number));
      for (const Value& next : arguments) x.number = name == "min" ? std::min(x.number, next.number) : std::max(x.number, next.number);
      return x;
    }
    if (name == "sin" || name == "cos" || name == "tan") {
      if (x.dimension != kAngle.dimension) expect_pure(x, "angle");
      const math::SinCos at = math::sin_cos(x.number);
      return pure(checked(name == "sin" ? at.sin : name == "cos" ? at.cos : at.sin / at.cos));
    }
    expect_pure(x, "argument of " + std::string(name));
    const double v = x.number;
    if (name == "floor") return pure(std::floor(v));
    if (name == "ceil") return pure(std::ceil(v));
    if (name == "round") return pure(std::round(v));
    if (name == "exp") return pure(checked(math::exp(v)));
    if (name == "atan") return angle(math::atan2(v, 1.0));
    if (name == "log") {
      if (!(v > 0.0)) fail("expected an argument > 0 of log", number_text(v));
      return pure(math::log(v));
    }
    if (std::abs(v) > 1.0) fail("expected an argument from -1 to 1 of " + std::string(name), number_text(v));
    const double other = std::sqrt((1.0 - v) * (1.0 + v));
    return angle(name == "asin" ? math::atan2(v, other) : math::atan2(other, v));
  }

  static Value angle(double radians) { return {.number = radians, .dimension = kAngle.dimension, .text = {}}; }
  static double checked(double number) {
    if (!std::isfinite(number)) fail("expected a finite value", "one beyond the range of numbers");
    return number;
  }
  static Dimension checked(const Dimension& dimension) {
    constexpr int kLargestExponent = 8;
    for (const int exponent : {dimension.m, dimension.kg, dimension.s, dimension.rad}) {
      if (std::abs(exponent) > kLargestExponent) fail("expected units to powers of at most " + std::to_string(kLargestExponent), "more");
    }
    return dimension;
  }
  static void expect_number(const Value& value) {
    if (value.is_text) fail("expected a number", "the text '" + shown(value.text) + '\'');
  }
  static void expect_pure(const Value& value, const std::string& what) {
    expect_number(value);
    if (value.dimension != Dimension{}) fail("expected a number without unit as " + what, kind_of(value.dimension), "divide by a unit");
  }

  /// Counts nested calls, so that no text exhausts the stack.
  struct Depth {
    explicit Depth(Parser& p) : parser(p) {
      if (++parser.depth_ > 4 * kDeepestExpression) fail("expected at most " + std::to_string(kDeepestExpression) + " nested parentheses", "more");
    }
    ~Depth() { --parser.depth_; }
    Depth(const Depth&) = delete;
    Depth& operator=(const Depth&) = delete;
    Parser& parser;
  };

  std::string_view text_;
  const FindVariable& variables_;
  std::span<const std::string_view> known_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace

std::string Value::spelt() const {
  if (is_text) return text;
  const std::string unit = si_unit(dimension);
  return number_text(number) + (unit.empty() ? "" : ' ' + unit);
}

Value evaluate_expression(std::string_view text, const FindVariable& variables, std::span<const std::string_view> known) {
  return Parser(text, variables, known).all();
}

std::optional<ExpressionFault> fault_of_name(std::string_view name) {
  const bool word = !name.empty() && begins_name(name.front()) && std::all_of(name.begin(), name.end(), in_name);
  if (!word) return ExpressionFault{"expected a name of letters, digits and _", '\'' + shown(name) + '\'', ""};
  if (function_named(name) != nullptr || name == "pi") return ExpressionFault{"expected a name that is no function or constant", '\'' + shown(name) + '\'', ""};
  if (unit_named(name)) return ExpressionFault{"expected a name that is no unit", '\'' + shown(name) + '\'', "write a longer name"};
  return std::nullopt;
}

}  // namespace supple::scenes
