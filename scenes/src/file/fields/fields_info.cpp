#include "file/fields/fields_info.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "file/read_scene_faults.h"

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

std::string number_default(double value, const Rule& rule) {
  if (!std::isfinite(value) || !rule.holds(value)) return "";
  if (!rule.degrees) return number_text(value);
  return number_text(std::round(value * 180.0 / std::numbers::pi * 1e4) / 1e4);  // for reading, so rounded
}

/// The value of a key that is left out.
std::string default_of(const Member& member, const Rule& rule) {
  const MemberType& type = *member.type;
  if (type.optional) return rule.automatic ? "auto" : "";
  switch (type.type) {
    case FieldType::Number: return number_default(member.as<double>(), rule);
    case FieldType::Whole: return std::to_string(member.as<int>());
    case FieldType::Boolean: return member.as<bool>() ? "true" : "false";
    case FieldType::Text: return '"' + member.as<std::string>() + '"';
    case FieldType::Choice: return std::string(type.choices[type.chosen(member.at)]);
    case FieldType::Choices: {
      const std::vector<std::size_t> chosen = type.all_chosen(member.at);
      return chosen.empty() ? "none" : std::string(type.choices[chosen.front()]);
    }
    case FieldType::Vector: return bracketed(std::span(member.as<Vec3>().data(), std::min<std::size_t>(rule.most_items, 3)), number_text);
    case FieldType::Wholes: return bracketed(member.as<std::vector<int>>(), [](int v) { return std::to_string(v); });
    case FieldType::Numbers: return bracketed(member.as<std::vector<double>>(), number_text);
    case FieldType::Vectors:
    case FieldType::Texts:
    case FieldType::Mapping:
    case FieldType::Mappings: break;
  }
  return "";
}

}  // namespace

void InfoArchive::field(const Member& member, const Label& label, const Rule& rule) {
  const MemberType& type = *member.type;
  FieldInfo& info = list.emplace_back();
  info.key = label.key;
  info.meaning = label.meaning;
  info.type = type.type;
  info.required = label.required;
  info.may_be_absent = type.optional;
  info.rule = rule;
  info.choices = type.choices;
  if (!label.required) info.default_text = default_of(member, rule);
  if (type.fields == nullptr) return;
  MappingInfo mapping = mapping_info(type);
  info.children = std::move(mapping.keys);
  info.may_be_empty = mapping.may_be_empty;
}

void EmptyArchive::check(bool holds, const std::string& /*key*/, std::string /*expected*/, std::string /*found*/, std::string /*hint*/) {
  complete = complete && holds;
}

void EmptyArchive::field(const Member& /*member*/, const Label& label, const Rule& rule) {
  if (label.required) complete = complete && !rule.when.applies();
}

MappingInfo mapping_info(const MemberType& type) {
  InfoArchive keys;
  EmptyArchive empty;
  const std::shared_ptr<void> listed = type.make(), defaults = type.make();
  type.fields(keys, listed.get());
  type.fields(empty, defaults.get());
  return {.keys = std::move(keys.list), .may_be_empty = empty.complete};
}

const std::vector<FieldInfo>& scene_fields() {
  static const std::vector<FieldInfo> list = [] {
    InfoArchive archive;
    Scene scene;
    scene_members(archive, scene);
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
    case FieldType::Numbers:
    case FieldType::Wholes:
      return (rule.least_items != 0 ? "a list of " + count_text(rule, 0, kUnlimited) : std::string("a list")) + ", each " + rule_text(rule, type == FieldType::Wholes);
    case FieldType::Texts: return std::to_string(rule.least_items) + " names";
    case FieldType::Mapping: return "a mapping";
    case FieldType::Mappings: return "a list of mappings";
  }
  return "";
}

}  // namespace supple::scenes
