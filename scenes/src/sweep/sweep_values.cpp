#include "sweep/sweep_values.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>

#include <nlohmann/json.hpp>

#include "file/yaml/yaml_quantity.h"
#include "file/yaml/yaml_tree.h"
#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/scenes/sweep.h"

namespace supple::scenes {
namespace {

[[noreturn]] void refuse_setting(const std::string& setting, std::string expected, std::string found, std::string hint) {
  throw Error(ErrorKind::Usage, Fault{.place = "--set " + shown(setting), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = std::min(text.find_first_not_of(' '), text.size());
  text.remove_prefix(first);
  return text.substr(0, text.find_last_not_of(' ') + 1);
}

/// A number with a unit or without.
struct End {
  double value = 0.0;
  std::string unit;
  KnownUnit of{};  ///< of the unit
};

std::optional<End> end_of(std::string_view text) {
  text = trimmed(text);
  const bool negative = text.starts_with('-');
  if (negative || text.starts_with('+')) text.remove_prefix(1);
  const LeadingNumber number = leading_decimal_of(text);
  if (number.length == 0 || !std::isfinite(number.value)) return std::nullopt;
  End end{.value = negative ? -number.value : number.value, .unit = std::string(trimmed(text.substr(number.length)))};
  if (end.unit.empty()) return end;
  const auto unit = read_any_quantity("1 " + end.unit);
  if (!unit) return std::nullopt;
  end.of = *unit;
  return end;
}

/// Fifteen digits: 0.1 to 0.5 in five steps is 0.1, 0.2, 0.3, 0.4, 0.5.
std::string value_text(double value, const std::string& unit) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.15g", value);
  return text.data() + (unit.empty() ? std::string() : ' ' + unit);
}

double between_ends(const SweepValues& range, double share) {
  if (!range.log) return range.low + share * (range.high - range.low);
  return range.low * math::pow(range.high / range.low, share);
}

constexpr const char* kForms = "expected a:b:N, a:b:logN or, to draw samples, a:b or a:b:log";

/// @param parts  at least two, the first a number
SweepValues range_of(const std::string& setting, const std::vector<std::string_view>& parts) {
  SweepValues range{.key = {}, .kind = SweepValues::Kind::Range, .list = {}, .unit = {}};
  const std::optional<End> low = end_of(parts[0]);
  const std::optional<End> high = end_of(parts[1]);
  if (!high || parts.size() > 3) refuse_setting(setting, kForms, '\'' + shown(setting.substr(setting.find('=') + 1)) + '\'', "put a text that holds colons in quotes");
  if (low->unit.empty() != high->unit.empty() || !(low->of.dimension == high->of.dimension)) {
    refuse_setting(setting, "expected both ends with units of the same kind, or none", '\'' + shown(trimmed(parts[0])) + "' and '" + shown(trimmed(parts[1])) + '\'', "");
  }
  range.unit = low->unit;
  range.low = low->value;
  range.high = low->unit == high->unit ? high->value : high->value * high->of.factor / low->of.factor;
  std::string_view way = parts.size() == 3 ? trimmed(parts[2]) : std::string_view();
  range.log = way.starts_with("log");
  if (range.log) {
    way.remove_prefix(3);
    if (!(range.low > 0.0 && range.high > 0.0)) refuse_setting(setting, "expected two numbers > 0 for equal ratios", '\'' + shown(parts[0]) + "' and '" + shown(parts[1]) + '\'', "");
  }
  if (way.empty() && (parts.size() == 2 || range.log)) return range;
  int count = 0;
  const auto [end, error] = std::from_chars(way.data(), way.data() + way.size(), count);
  if (error != std::errc() || end != way.data() + way.size() || count < 2 || static_cast<std::size_t>(count) > kMostSweepPoints) {
    refuse_setting(setting, "expected a number of values from 2 to " + std::to_string(kMostSweepPoints) + ", with 'log' before it for equal ratios", '\'' + shown(trimmed(parts[2])) + '\'',
                   "for example 1e3:1e6:log9");
  }
  range.kind = SweepValues::Kind::List;
  range.stepped = true;
  for (int i = 0; i < count; ++i) {
    const double value = i == 0 ? range.low : i + 1 == count ? range.high : between_ends(range, static_cast<double>(i) / (count - 1));
    range.list.push_back(value_text(value, range.unit));
  }
  return range;
}

/// Parts between colons.
std::vector<std::string_view> parts_of(std::string_view text) {
  std::vector<std::string_view> parts;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t colon = std::min(text.find(':', at), text.size());
    parts.push_back(text.substr(at, colon - at));
    at = colon + 1;
  }
  return parts;
}

/// YAML on one line.
std::string text_of(const Node& node) {
  switch (node.kind) {
    case Node::Kind::Null: return "null";
    case Node::Kind::Scalar: return node.quoted ? nlohmann::json(node.text).dump() : node.text;
    case Node::Kind::List: {
      std::string text;
      for (const Node* item : node.items) text += (text.empty() ? "" : ", ") + text_of(*item);
      return '[' + text + ']';
    }
    case Node::Kind::Mapping: break;
  }
  std::string text;
  for (const Node::Entry& entry : node.entries) text += (text.empty() ? "" : ", ") + nlohmann::json(entry.key).dump() + ": " + text_of(*entry.value);
  return '{' + text + '}';
}

std::vector<std::string> items_of(const std::string& setting, const std::string& text) {
  SourceTexts texts;
  Tree tree;
  FaultList faults(texts);
  const std::uint32_t source = texts.add("--set " + shown(setting), text, true);
  const Node* node = parse_yaml(texts.text(source), source, tree, faults);
  faults.raise();
  std::vector<std::string> items;
  for (const Node* item : node->items) items.push_back(text_of(*item));
  if (items.empty()) refuse_setting(setting, "expected a list of values", "an empty list", "a value that is itself a list is [[...]]");
  return items;
}

}  // namespace

std::string SweepValues::at(double share) const {
  if (kind == Kind::Range) return value_text(between_ends(*this, share), unit);
  const auto index = static_cast<std::size_t>(share * static_cast<double>(list.size()));
  return list[std::min(index, list.size() - 1)];
}

SweepValues read_sweep_values(const std::string& setting) {
  const std::size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    refuse_setting(setting, "expected path.to.key=values", '\'' + shown(setting) + '\'', "values: a:b:N, a:b:logN, [x, y, z], or one value");
  }
  const std::string text = setting.substr(equals + 1);
  const std::string_view content = trimmed(text);
  SweepValues values;
  const std::vector<std::string_view> parts = parts_of(content);
  if (content.starts_with('[')) {
    values.kind = SweepValues::Kind::List;
    values.list = items_of(setting, text);
  } else if (parts.size() > 1 && end_of(parts[0])) {
    values = range_of(setting, parts);
  } else {
    values.list = {text};
  }
  values.key = setting.substr(0, equals);
  return values;
}

}  // namespace supple::scenes
