#include "fields_info.h"

#include <limits>
#include <numbers>

namespace supple::scenes {
namespace {

constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();

std::string count_text(const Rule& rule, std::size_t least, std::size_t most) {
  if (rule.least_items != 0) least = rule.least_items;
  if (rule.most_items < most) most = rule.most_items;
  if (most == kUnlimited) return "at least " + std::to_string(least);
  return least == most ? std::to_string(least) : std::to_string(least) + " to " + std::to_string(most);
}

template <class T, class Text>
std::string bracketed(const T& values, const Text& text) {
  std::string out = "[";
  for (const auto value : values) out += (out.size() > 1 ? ", " : "") + text(value);
  return out + ']';
}

}  // namespace

std::string InfoArchive::default_of(double value, const Rule& rule) {
  if (!std::isfinite(value) || !rule.holds(value)) return "";
  if (!rule.degrees) return number_text(value);
  return number_text(std::round(value * 180.0 / std::numbers::pi * 1e4) / 1e4);  // for reading, so rounded
}

std::string InfoArchive::default_of(const Vec3& value, const Rule& rule) {
  const std::size_t count = std::min<std::size_t>(rule.most_items, 3);
  return bracketed(std::span(value.data(), count), number_text);
}

std::string InfoArchive::default_of(const std::vector<int>& value, const Rule& /*rule*/) {
  return bracketed(value, [](int v) { return std::to_string(v); });
}

const std::vector<FieldInfo>& scene_fields() {
  static const std::vector<FieldInfo> list = [] {
    InfoArchive archive;
    Scene scene;
    fields(archive, scene);
    return std::move(archive.list);
  }();
  return list;
}

std::string expectation(FieldType type, std::span<const std::string_view> choices, const Rule& rule) {
  switch (type) {
    case FieldType::Number: return rule_text(rule, false);
    case FieldType::Whole: return rule_text(rule, true);
    case FieldType::Boolean: return "true or false";
    case FieldType::Text: return rule.name ? "a name" : "text";
    case FieldType::Choice: return "one of " + joined(choices);
    case FieldType::Choices: return "one of " + joined(choices) + ", a list of them, or none";
    case FieldType::Vector:
      return rule.direction ? "a direction: a list of 3 numbers"
                            : "a list of " + count_text(rule, 3, 3) + ", each " + rule_text(rule, false);
    case FieldType::Vectors:
      return "a list of " + count_text(rule, 0, kUnlimited) + " points, each a list of 3, each " + rule_text(rule, false);
    case FieldType::Wholes:
      return (rule.least_items != 0 ? "a list of " + count_text(rule, 0, kUnlimited) : std::string("a list")) + ", each " + rule_text(rule, true);
    case FieldType::Texts: return std::to_string(rule.least_items) + " names";
    case FieldType::Mapping: return "a mapping";
    case FieldType::Mappings: return "a list of mappings";
  }
  return "";
}

}  // namespace supple::scenes
