/// @file yaml_quantity.h
/// Numbers with units: a bare number is SI, "5 cm" is converted after its dimension has been checked. Fractions are numbers, too:
/// "30000/1001", "5/8 in".
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace supple::scenes {

/// Exponents of metre, kilogram, second and radian.
struct Dimension {
  std::int8_t m = 0, kg = 0, s = 0, rad = 0;
  friend bool operator==(const Dimension&, const Dimension&) = default;
};

[[nodiscard]] Dimension operator*(const Dimension& a, const Dimension& b);
[[nodiscard]] Dimension inverse(const Dimension& a);
/// The dimension whose square this is, if there is one.
[[nodiscard]] std::optional<Dimension> root_of(const Dimension& a);
/// "length", "energy or torque"; "" where there is no word.
[[nodiscard]] std::string_view noun_of(const Dimension& dimension);
/// "kg m/s^2"; "" of a pure number.
[[nodiscard]] std::string si_unit(const Dimension& dimension);

/// The quantity of a key: a noun and the SI unit for messages, and the dimension.
struct Quantity {
  std::string_view noun;
  std::string_view unit;  ///< "" for pure numbers
  Dimension dimension;
};

inline constexpr Quantity kNumber{"number", "", {}};
inline constexpr Quantity kLength{"length", "m", {1, 0, 0, 0}};
inline constexpr Quantity kMass{"mass", "kg", {0, 1, 0, 0}};
inline constexpr Quantity kTime{"time", "s", {0, 0, 1, 0}};
inline constexpr Quantity kRate{"rate", "1/s", {0, 0, -1, 0}};
inline constexpr Quantity kAngle{"angle", "deg", {0, 0, 0, 1}};
inline constexpr Quantity kSpeed{"speed", "m/s", {1, 0, -1, 0}};
inline constexpr Quantity kSpin{"angular speed", "rad/s", {0, 0, -1, 1}};
inline constexpr Quantity kAcceleration{"acceleration", "m/s^2", {1, 0, -2, 0}};
inline constexpr Quantity kForce{"force", "N", {1, 1, -2, 0}};
inline constexpr Quantity kTorque{"torque", "N m", {2, 1, -2, 0}};
inline constexpr Quantity kEnergy{"energy", "J", {2, 1, -2, 0}};
inline constexpr Quantity kPressure{"pressure", "Pa", {-1, 1, -2, 0}};
inline constexpr Quantity kStiffness{"stiffness", "N/m", {0, 1, -2, 0}};
inline constexpr Quantity kBending{"bending strength", "J m^2", {4, 1, -2, 0}};
inline constexpr Quantity kDamping{"damping", "N s/m", {0, 1, -1, 0}};
inline constexpr Quantity kAngularDamping{"angular damping", "N m s", {2, 1, -1, 0}};
inline constexpr Quantity kSlope{"slope", "1/m", {-1, 0, 0, 0}};
inline constexpr Quantity kArea{"area", "m^2", {2, 0, 0, 0}};
inline constexpr Quantity kVolume{"volume", "m^3", {3, 0, 0, 0}};
inline constexpr Quantity kDensity{"density", "kg/m^3", {-3, 1, 0, 0}};
inline constexpr Quantity kInverseArea{"inverse area", "1/m^2", {-2, 0, 0, 0}};
inline constexpr Quantity kInverseSpeed{"inverse speed", "s/m", {-1, 0, 1, 0}};

/// A scalar read as a quantity. Without `ok`, `hint` is advice for the user (may be empty).
struct QuantityText {
  bool ok = false;
  double value = 0.0;  ///< SI; of kAngle: degrees
  std::string hint;
};
[[nodiscard]] QuantityText read_quantity(std::string_view text, const Quantity& quantity);

/// A number without sign that a text begins with: digits [. digits] [e digits].
struct LeadingNumber {
  std::size_t length = 0;  ///< 0: none
  double value = 0.0;
};
[[nodiscard]] LeadingNumber leading_decimal_of(std::string_view text);

/// A unit in SI units. Of a quantity, `factor` is its value.
struct KnownUnit {
  double factor = 1.0;
  Dimension dimension;
};
/// By name or by a word for it: "cm", "metres".
[[nodiscard]] std::optional<KnownUnit> unit_named(std::string_view name);
/// A number with any unit, or without: "5 cm", "30000/1001"; none for other texts.
[[nodiscard]] std::optional<KnownUnit> read_any_quantity(std::string_view text);

/// Units of one kind, in the order of messages and of the reference.
struct UnitsOfKind {
  std::string_view noun;                 ///< "length"
  std::vector<std::string_view> units;   ///< "m", "km", ...
  std::vector<std::string_view> words;   ///< accepted as well: "metres"
};
[[nodiscard]] std::vector<UnitsOfKind> known_units();

/// A scalar read as a whole number.
struct WholeText {
  bool ok = false;
  long long value = 0;
  std::string hint;
};
[[nodiscard]] WholeText read_whole(std::string_view text);

/// True when the whole text is a number, or a fraction of two.
[[nodiscard]] bool looks_like_number(std::string_view text);

}  // namespace supple::scenes
