#include "file/yaml/yaml_quantity.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <vector>

#include "file/read_scene_faults.h"
#include "supple/core/io/number_range.h"

namespace supple::scenes {
namespace {

struct Unit {
  std::string_view name;
  double factor;
  Dimension dimension;
};

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr Dimension kNoDimension{};

constexpr double kInch = 0.0254, kPound = 0.45359237, kPoundForce = kPound * 9.80665;  // by definition
constexpr double kTurn = 360.0 * kDegree;

/// By quantity, in the order of messages and the reference.
constexpr std::array kUnits{
    Unit{"m", 1.0, kLength.dimension},       Unit{"km", 1e3, kLength.dimension},     Unit{"dm", 1e-1, kLength.dimension},
    Unit{"cm", 1e-2, kLength.dimension},     Unit{"mm", 1e-3, kLength.dimension},    Unit{"um", 1e-6, kLength.dimension},
    Unit{"nm", 1e-9, kLength.dimension},     Unit{"pm", 1e-12, kLength.dimension},   Unit{"Mm", 1e6, kLength.dimension},
    Unit{"in", kInch, kLength.dimension},    Unit{"ft", 12.0 * kInch, kLength.dimension},
    Unit{"yd", 36.0 * kInch, kLength.dimension}, Unit{"mi", 63360.0 * kInch, kLength.dimension},
    Unit{"kg", 1.0, kMass.dimension},        Unit{"g", 1e-3, kMass.dimension},       Unit{"mg", 1e-6, kMass.dimension},
    Unit{"ug", 1e-9, kMass.dimension},       Unit{"ng", 1e-12, kMass.dimension},     Unit{"t", 1e3, kMass.dimension},
    Unit{"lb", kPound, kMass.dimension},     Unit{"oz", kPound / 16.0, kMass.dimension},
    Unit{"s", 1.0, kTime.dimension},         Unit{"ms", 1e-3, kTime.dimension},      Unit{"us", 1e-6, kTime.dimension},
    Unit{"ns", 1e-9, kTime.dimension},       Unit{"ps", 1e-12, kTime.dimension},     Unit{"min", 60.0, kTime.dimension},
    Unit{"h", 3600.0, kTime.dimension},      Unit{"d", 86400.0, kTime.dimension},
    Unit{"Hz", 1.0, kRate.dimension},        Unit{"kHz", 1e3, kRate.dimension},      Unit{"MHz", 1e6, kRate.dimension},
    Unit{"GHz", 1e9, kRate.dimension},
    Unit{"rad", 1.0, kAngle.dimension},      Unit{"mrad", 1e-3, kAngle.dimension},   Unit{"deg", kDegree, kAngle.dimension},
    Unit{"arcmin", kDegree / 60.0, kAngle.dimension}, Unit{"arcsec", kDegree / 3600.0, kAngle.dimension},
    Unit{"gon", kTurn / 400.0, kAngle.dimension},     Unit{"rev", kTurn, kAngle.dimension},
    Unit{"rpm", kTurn / 60.0, kSpin.dimension},
    Unit{"N", 1.0, kForce.dimension},        Unit{"nN", 1e-9, kForce.dimension},     Unit{"uN", 1e-6, kForce.dimension},
    Unit{"mN", 1e-3, kForce.dimension},      Unit{"kN", 1e3, kForce.dimension},      Unit{"MN", 1e6, kForce.dimension},
    Unit{"lbf", kPoundForce, kForce.dimension},
    Unit{"Pa", 1.0, kPressure.dimension},    Unit{"hPa", 1e2, kPressure.dimension},  Unit{"kPa", 1e3, kPressure.dimension},
    Unit{"MPa", 1e6, kPressure.dimension},   Unit{"GPa", 1e9, kPressure.dimension},  Unit{"bar", 1e5, kPressure.dimension},
    Unit{"atm", 101325.0, kPressure.dimension}, Unit{"psi", kPoundForce / (kInch * kInch), kPressure.dimension},
    Unit{"J", 1.0, kTorque.dimension},       Unit{"mJ", 1e-3, kTorque.dimension},    Unit{"kJ", 1e3, kTorque.dimension},
    Unit{"MJ", 1e6, kTorque.dimension},      Unit{"%", 1e-2, kNoDimension},
};

struct UnitWord {
  std::string_view word, unit;
};
/// Words and signs for units that are taken as well. The micro sign is one character in Latin-1 and another one in Greek.
constexpr std::array kUnitWords{
    UnitWord{"meter", "m"},       UnitWord{"meters", "m"},      UnitWord{"metre", "m"},       UnitWord{"metres", "m"},
    UnitWord{"micron", "um"},     UnitWord{"microns", "um"},    UnitWord{"inch", "in"},       UnitWord{"inches", "in"},
    UnitWord{"foot", "ft"},       UnitWord{"feet", "ft"},       UnitWord{"yard", "yd"},       UnitWord{"yards", "yd"},
    UnitWord{"mile", "mi"},       UnitWord{"miles", "mi"},      UnitWord{"gram", "g"},        UnitWord{"grams", "g"},
    UnitWord{"tonne", "t"},       UnitWord{"tonnes", "t"},      UnitWord{"lbs", "lb"},        UnitWord{"pound", "lb"},
    UnitWord{"pounds", "lb"},     UnitWord{"ounce", "oz"},      UnitWord{"ounces", "oz"},     UnitWord{"sec", "s"},
    UnitWord{"secs", "s"},        UnitWord{"second", "s"},      UnitWord{"seconds", "s"},     UnitWord{"msec", "ms"},
    UnitWord{"mins", "min"},      UnitWord{"minute", "min"},    UnitWord{"minutes", "min"},   UnitWord{"hr", "h"},
    UnitWord{"hour", "h"},        UnitWord{"hours", "h"},       UnitWord{"day", "d"},         UnitWord{"days", "d"},
    UnitWord{"degree", "deg"},    UnitWord{"degrees", "deg"},   UnitWord{"radian", "rad"},    UnitWord{"radians", "rad"},
    UnitWord{"turn", "rev"},      UnitWord{"turns", "rev"},     UnitWord{"percent", "%"},     UnitWord{"\u00b0", "deg"},
    UnitWord{"\u00b5m", "um"},    UnitWord{"\u03bcm", "um"},    UnitWord{"\u00b5g", "ug"},    UnitWord{"\u03bcg", "ug"},
    UnitWord{"\u00b5s", "us"},    UnitWord{"\u03bcs", "us"},    UnitWord{"\u00b5N", "uN"},    UnitWord{"\u03bcN", "uN"},
};
/// Words that mean another unit to some, or are misspelt: the unit is suggested only.
constexpr std::array kUnclearWords{UnitWord{"Kg", "kg"}, UnitWord{"KG", "kg"}, UnitWord{"ton", "t"}, UnitWord{"tons", "t"}};

/// Null: none.
const Unit* find_unit(std::string_view name) {
  const auto* const word = std::find_if(kUnitWords.begin(), kUnitWords.end(), [&](const UnitWord& w) { return w.word == name; });
  if (word != kUnitWords.end()) name = word->unit;
  const auto* const unit = std::find_if(kUnits.begin(), kUnits.end(), [&](const Unit& u) { return u.name == name; });
  return unit == kUnits.end() ? nullptr : unit;
}

constexpr const char* kRangeHint = "numbers are 0 or between 1e-50 and 1e50 in size";

bool in_range(double value) {
  return value == 0.0 || (std::abs(value) >= io::kSmallestNumber && std::abs(value) <= io::kLargestNumber);
}

bool digit(char c) { return c >= '0' && c <= '9'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// A number at the start of a text.
struct Leading {
  std::size_t length = 0;  // 0: none
  double value = 0.0;
  bool in_range = true;
  bool octal_looking = false;
  bool divides_by_zero = false;
};
/// [+-] digits [. digits] [e digits]
Leading leading_decimal(std::string_view text) {
  std::size_t i = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  const std::size_t start = i;
  while (i < text.size() && digit(text[i])) ++i;
  const std::size_t whole = i - start;
  std::size_t fraction = 0;
  if (i < text.size() && text[i] == '.') {
    ++i;
    while (i < text.size() && digit(text[i])) ++i, ++fraction;
  }
  Leading out;
  if (whole + fraction == 0) return out;
  if (i < text.size() && (text[i] == 'e' || text[i] == 'E')) {
    std::size_t j = i + 1;
    if (j < text.size() && (text[j] == '+' || text[j] == '-')) ++j;
    if (j < text.size() && digit(text[j])) {
      while (j < text.size() && digit(text[j])) ++j;
      i = j;
    }
  }
  out.length = i;
  out.octal_looking = whole > 1 && text[start] == '0' && i == start + whole;
  const std::size_t sign = text[0] == '+' ? 1 : 0;
  const auto [end, error] = std::from_chars(text.data() + sign, text.data() + i, out.value);
  out.in_range = error == std::errc() && end == text.data() + i && in_range(out.value);
  return out;
}

/// A decimal number, or one over another: "30000/1001", rounded once.
Leading leading_number(std::string_view text) {
  Leading out = leading_decimal(text);
  std::size_t i = out.length;
  while (i < text.size() && text[i] == ' ') ++i;
  if (out.length == 0 || i == text.size() || text[i] != '/') return out;
  ++i;
  while (i < text.size() && text[i] == ' ') ++i;
  if (i == text.size() || !(digit(text[i]) || text[i] == '.')) return out;  // the unit begins with it
  const Leading below = leading_decimal(text.substr(i));
  if (below.length == 0) return out;
  out.length = i + below.length;
  out.divides_by_zero = below.value == 0.0;
  out.octal_looking = out.octal_looking || below.octal_looking;
  out.value /= below.value;
  out.in_range = out.in_range && below.in_range && in_range(out.value);
  return out;
}

std::string plain_decimal(std::string_view text) {
  std::string out(text.substr(0, text[0] == '-' ? 1 : 0));
  text.remove_prefix(text[0] == '-' || text[0] == '+' ? 1 : 0);
  while (text.size() > 1 && text[0] == '0') text.remove_prefix(1);
  return out += text;
}

/// "m/s^2", "N s/m", "1/m^2": factors joined by blanks, '*' or '/', the latter for the next factor alone.
/// @param wanted  whose units are suggested; null: all
std::string unknown_unit_hint(std::string_view name, const Dimension* wanted) {
  const std::string unknown = "unknown unit '" + shown(name) + '\'';
  const auto* const word = std::find_if(kUnclearWords.begin(), kUnclearWords.end(), [&](const UnitWord& w) { return w.word == name; });
  if (word != kUnclearWords.end()) return unknown + "; did you mean '" + std::string(word->unit) + "'?";
  std::vector<std::string_view> names;
  for (const Unit& u : kUnits) {
    if (wanted == nullptr || u.dimension == *wanted) names.push_back(u.name);
  }
  // Of several that are as near, the first in the order is named: one that is so in either order is the only one.
  const std::string near = nearest_word(name, names);
  const std::vector<std::string_view> backwards(names.rbegin(), names.rend());
  const bool only = !near.empty() && nearest_word(name, backwards) == near;
  return unknown + (only ? "; did you mean '" + near + "'?" : "; known: " + joined(names));
}

struct UnitText {
  bool ok = false;
  double factor = 1.0;
  Dimension dimension;
  std::string hint;
};
UnitText read_unit(std::string_view text, const Dimension& wanted) {
  UnitText out;
  int sign = 1;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == ' ' || text[i] == '*') {
      ++i;
      continue;
    }
    if (text[i] == '/') {
      if (sign < 0) break;
      sign = -1;
      ++i;
      continue;
    }
    std::size_t j = i;
    while (j < text.size() && text[j] != ' ' && text[j] != '*' && text[j] != '/' && text[j] != '^') ++j;
    const std::string_view name = text.substr(i, j - i);
    int power = 1;
    if (j < text.size() && text[j] == '^') {
      const auto [end, error] = std::from_chars(text.data() + j + 1, text.data() + text.size(), power);
      if (error != std::errc() || power < 1 || power > 4) {
        out.hint = "exponents of units are written m^2";
        return out;
      }
      j = static_cast<std::size_t>(end - text.data());
    }
    i = j;
    if (name == "1" && sign == 1) continue;
    const Unit* const unit = find_unit(name);
    if (unit == nullptr) {
      const bool alone = name.size() == text.size() && std::any_of(kUnits.begin(), kUnits.end(), [&](const Unit& u) { return u.dimension == wanted; });
      out.hint = unknown_unit_hint(name, alone ? &wanted : nullptr);
      return out;
    }
    for (int k = 0; k < power; ++k) {
      out.factor = sign > 0 ? out.factor * unit->factor : out.factor / unit->factor;
      out.dimension.m = static_cast<std::int8_t>(out.dimension.m + sign * unit->dimension.m);
      out.dimension.kg = static_cast<std::int8_t>(out.dimension.kg + sign * unit->dimension.kg);
      out.dimension.s = static_cast<std::int8_t>(out.dimension.s + sign * unit->dimension.s);
      out.dimension.rad = static_cast<std::int8_t>(out.dimension.rad + sign * unit->dimension.rad);
    }
    sign = 1;
  }
  out.ok = sign > 0;
  if (!out.ok) out.hint = "a unit is missing after '/'";
  return out;
}

/// The same exponents; an angle may also be left out ("1/s" for rad/s).
bool matches(Dimension found, Dimension wanted) {
  if (found == wanted) return true;
  found.rad = wanted.rad = 0;
  return found == wanted && wanted != Dimension{};
}

std::string not_a_number_hint(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  std::string_view bare = lower;
  if (!bare.empty() && (bare[0] == '+' || bare[0] == '-')) bare.remove_prefix(1);
  if (bare == ".nan" || bare == ".inf" || bare == "nan" || bare == "inf" || bare == "infinity") return "numbers must be finite";
  return "";
}

}  // namespace

bool looks_like_number(std::string_view text) {
  return !text.empty() && leading_number(text).length == text.size();
}

QuantityText read_quantity(std::string_view text, const Quantity& quantity) {
  QuantityText out;
  text = trimmed(text);
  const Leading number = leading_number(text);
  if (number.length == 0) {
    out.hint = not_a_number_hint(text);
    return out;
  }
  if (number.octal_looking) {
    const std::string_view written = text.substr(0, number.length);
    out.hint = "a leading zero looks octal" + (written.find('/') == std::string_view::npos ? "; write " + plain_decimal(written) : std::string());
    return out;
  }
  if (number.divides_by_zero) {
    out.hint = "numbers must be finite";
    return out;
  }
  const std::string_view rest = trimmed(text.substr(number.length));
  if (!number.in_range) {
    out.hint = kRangeHint;
    return out;
  }
  out.value = number.value;
  if (rest.empty()) {
    out.ok = true;
    return out;
  }
  if (rest[0] == ',' && rest.size() > 1 && digit(rest[1])) {
    out.hint = "the decimal sign is a point";
    return out;
  }
  if ((rest[0] == 'x' || rest[0] == 'o' || rest[0] == '_') && rest.size() == text.size() - number.length) {
    out.hint = "write a plain decimal number";
    return out;
  }
  const UnitText unit = read_unit(rest, quantity.dimension);
  if (!unit.ok) {
    out.hint = unit.hint;
    return out;
  }
  if (!matches(unit.dimension, quantity.dimension)) {
    const std::string_view noun = noun_of(unit.dimension);
    out.hint = '\'' + shown(rest) + "' is " + (noun.empty() ? "something else" : "a unit of " + std::string(noun));
    return out;
  }
  const bool degrees = quantity.unit == kAngle.unit;
  if (!(degrees && rest == "deg")) out.value *= degrees ? unit.factor / kDegree : unit.factor;
  out.ok = in_range(out.value);
  if (!out.ok) out.hint = kRangeHint;
  return out;
}

std::string_view noun_of(const Dimension& dimension) {
  if (dimension == kTorque.dimension) return "energy or torque";
  for (const Quantity& q : {kNumber, kLength, kMass, kTime, kRate, kAngle, kSpeed, kSpin, kAcceleration, kForce,
                            kPressure, kStiffness, kDamping, kAngularDamping, kSlope, kInverseArea, kInverseSpeed,
                            kArea, kVolume}) {
    if (q.dimension == dimension) return q.noun;
  }
  return "";
}

Dimension operator*(const Dimension& a, const Dimension& b) {
  return {static_cast<std::int8_t>(a.m + b.m), static_cast<std::int8_t>(a.kg + b.kg), static_cast<std::int8_t>(a.s + b.s),
          static_cast<std::int8_t>(a.rad + b.rad)};
}

Dimension inverse(const Dimension& a) {
  return {static_cast<std::int8_t>(-a.m), static_cast<std::int8_t>(-a.kg), static_cast<std::int8_t>(-a.s), static_cast<std::int8_t>(-a.rad)};
}

std::optional<Dimension> root_of(const Dimension& a) {
  if (a.m % 2 != 0 || a.kg % 2 != 0 || a.s % 2 != 0 || a.rad % 2 != 0) return std::nullopt;
  return Dimension{static_cast<std::int8_t>(a.m / 2), static_cast<std::int8_t>(a.kg / 2), static_cast<std::int8_t>(a.s / 2),
                   static_cast<std::int8_t>(a.rad / 2)};
}

std::string si_unit(const Dimension& dimension) {
  const std::array<std::pair<std::string_view, int>, 4> factors{
      {{"kg", dimension.kg}, {"m", dimension.m}, {"s", dimension.s}, {"rad", dimension.rad}}};
  std::string above, below;
  for (const auto& [name, exponent] : factors) {
    const int size = std::abs(exponent);
    if (size == 0) continue;
    std::string& side = exponent > 0 ? above : below;
    if (exponent < 0) side += '/';
    if (exponent > 0 && !side.empty()) side += ' ';
    side += name;
    if (size > 1) side += '^' + std::to_string(size);
  }
  return above.empty() && !below.empty() ? '1' + below : above + below;
}

LeadingNumber leading_decimal_of(std::string_view text) {
  const bool signed_text = !text.empty() && (text[0] == '+' || text[0] == '-');
  const Leading number = leading_decimal(text);
  return signed_text ? LeadingNumber{} : LeadingNumber{number.length, number.value};
}

std::optional<KnownUnit> unit_named(std::string_view name) {
  const Unit* const unit = find_unit(name);
  return unit == nullptr ? std::nullopt : std::optional(KnownUnit{unit->factor, unit->dimension});
}

std::optional<KnownUnit> read_any_quantity(std::string_view text) {
  text = trimmed(text);
  const Leading number = leading_number(text);
  if (number.length == 0 || number.octal_looking || number.divides_by_zero || !number.in_range) return std::nullopt;
  const UnitText unit = read_unit(trimmed(text.substr(number.length)), {});
  if (!unit.ok) return std::nullopt;
  return KnownUnit{number.value * unit.factor, unit.dimension};
}

std::vector<UnitsOfKind> known_units() {
  std::vector<UnitsOfKind> kinds;
  for (const Unit& unit : kUnits) {
    const std::string_view noun = noun_of(unit.dimension);
    auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const UnitsOfKind& k) { return k.noun == noun; });
    if (kind == kinds.end()) kind = kinds.insert(kinds.end(), {.noun = noun, .units = {}, .words = {}});
    kind->units.push_back(unit.name);
    for (const UnitWord& word : kUnitWords) {
      if (word.unit == unit.name) kind->words.push_back(word.word);
    }
  }
  return kinds;
}

WholeText read_whole(std::string_view text) {
  WholeText out;
  text = trimmed(text);
  const Leading number = leading_decimal(text);
  if (number.length == 0 || number.length != text.size()) {
    out.hint = not_a_number_hint(text);
    return out;
  }
  if (number.octal_looking) {
    out.hint = "a leading zero looks octal; write " + plain_decimal(text);
    return out;
  }
  const std::size_t sign = text[0] == '+' ? 1 : 0;
  const auto [end, error] = std::from_chars(text.data() + sign, text.data() + text.size(), out.value);
  if (error == std::errc::result_out_of_range) out.hint = "the number is out of range";
  out.ok = error == std::errc() && end == text.data() + text.size();
  return out;
}

}  // namespace supple::scenes
