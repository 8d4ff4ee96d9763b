#include "file/read_scene_archive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "supple/core/printable.h"

namespace supple::scenes {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

bool letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

bool is_identifier(std::string_view text) {
  return !text.empty() && letter(text[0]) && text.size() <= 100 && std::all_of(text.begin(), text.end(), [](char c) {
    return letter(c) || (c >= '0' && c <= '9') || c == '.' || c == '-';
  });
}

/// Lines may break.
bool has_controls(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) { return (c >= 0 && c < 0x20 && c != '\n' && c != '\t') || c == 0x7F; });
}

/// Words of other tools and of the physics for keys that we name differently.
std::string_view our_word(std::string_view key) {
  constexpr std::array<std::array<std::string_view, 2>, 9> kWords{{{"stiffness", "modulus"},
                                                                   {"fov", "field_of_view_deg"},
                                                                   {"field_of_view", "field_of_view_deg"},
                                                                   {"position", "at"},
                                                                   {"offset", "at"},
                                                                   {"fps", "frame_rate"},
                                                                   {"damping", "medium"},
                                                                   {"forces", "loads"},
                                                                   {"k", "strength"}}};
  for (const auto& [theirs, ours] : kWords) {
    if (theirs == key) return ours;
  }
  return "";
}

/// The same for the words of a choice.
std::string_view our_choice(std::string_view word) {
  constexpr std::array<std::array<std::string_view, 2>, 6> kWords{{{"literal", "contribution"},
                                                                   {"hard", "barrier"},
                                                                   {"heightfield", "heights"},
                                                                   {"height_field", "heights"},
                                                                   {"halfspace", "plane"},
                                                                   {"half_space", "plane"}}};
  for (const auto& [theirs, ours] : kWords) {
    if (theirs == word) return ours;
  }
  return "";
}

std::string expected_text(FieldType type, const Rule& rule) {
  return "expected " + expectation(type, {}, rule) + (rule.automatic ? ", or auto" : "");
}

/// For a word where a number or `auto` belongs.
std::string automatic_hint(std::string_view text, const Rule& rule) {
  constexpr std::array<std::string_view, 1> kWords{"auto"};
  return rule.automatic && !nearest_word(text, kWords).empty() ? "did you mean 'auto'?" : "";
}

/// For words that YAML 1.1 and other tools take for true or false.
std::string boolean_hint(const Node& node) {
  if (node.kind != Node::Kind::Scalar) return "";
  std::string word = node.text;
  std::transform(word.begin(), word.end(), word.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  for (const std::string_view yes : {"true", "yes", "y", "on", "1"}) {
    if (word == yes) return "did you mean true?";
  }
  for (const std::string_view no : {"false", "no", "n", "off", "0"}) {
    if (word == no) return "did you mean false?";
  }
  return "";
}

/// Where else a key of this name exists: "objects.particles", or "" when nowhere or at the top.
std::string home_of(std::string_view key, const std::vector<FieldInfo>& list, const std::string& path) {
  for (const FieldInfo& info : list) {
    if (info.key == key && !path.empty()) return path;
    const std::string below = home_of(key, info.children, path.empty() ? std::string(info.key) : path + '.' + std::string(info.key));
    if (!below.empty()) return below;
  }
  return "";
}

/// Whether a scalar is valid for a key.
bool takes(const FieldInfo& info, const Node& scalar) {
  const std::string_view text = scalar.text;
  switch (info.type) {
    case FieldType::Number: {
      const QuantityText number = read_quantity(text, info.rule.quantity);
      return number.ok && info.rule.holds(number.value);
    }
    case FieldType::Whole: {
      const WholeText number = read_whole(text);
      return number.ok && info.rule.holds(static_cast<double>(number.value));
    }
    case FieldType::Choice:
    case FieldType::Choices: return std::find(info.choices.begin(), info.choices.end(), text) != info.choices.end();
    case FieldType::Text: return info.required && info.rule.name && is_identifier(text);
    default: return false;
  }
}

}  // namespace

std::string ReadArchive::mapping_hint(const Node& node, const std::vector<FieldInfo>& keys, bool may_be_empty) {
  const FieldInfo* meant = nullptr;  // by a scalar: the first key that takes it
  for (const FieldInfo& info : keys) {
    if (meant == nullptr && node.kind == Node::Kind::Scalar && info.rule.when.applies() && takes(info, node)) meant = &info;
  }
  if (meant == nullptr && may_be_empty) return "write {} for the defaults";
  std::string mapping, rest;
  for (const FieldInfo& info : keys) {
    const When& when = info.rule.when;
    const bool selected = meant != nullptr && when.selector == meant->key && !when.choices.empty();
    const bool applies = selected ? std::find(when.choices.begin(), when.choices.end(), node.text) != when.choices.end() : when.applies();
    if (&info != meant && !(info.required && applies)) continue;
    mapping += (mapping.empty() ? "" : ", ") + std::string(info.key) + ": " + (&info == meant ? shown(node.text) : "...");
    if (&info != meant) rest += (rest.empty() ? "" : ", ") + std::string(info.key) + ": " + expectation(info.type, info.choices, info.rule);
  }
  if (!mapping.empty()) return "write {" + mapping + '}' + (rest.empty() ? "" : " (" + rest + ')');
  std::vector<std::string_view> names;
  for (const FieldInfo& info : keys) names.push_back(info.key);
  return "write {key: value} with one or more of " + joined(names) + ',';
}

void ReadArchive::field(const Member& member, const Label& label, const Rule& rule) {
  if (!rule.when.choices.empty() && faults_.has(path_of(rule.when.selector))) {
    known_.push_back(label.key);  // the kind is unknown, so its keys cannot be checked
    return;
  }
  if (!rule.when.applies()) {
    idle_.push_back({label.key, rule.when});
    return;
  }
  known_.push_back(label.key);
  const std::string path = path_of(label.key);
  if (const Node::Entry* entry = mapping_.find(label.key)) {
    read(*entry->value, path, member, rule);
  } else if (label.required) {
    const MemberType& type = *member.type;
    missing_.push_back({std::string(label.key), rule.when.selector, "expected " + expectation(type.type, type.choices, rule)});
  }
}

void ReadArchive::read(const Node& node, const std::string& path, const Member& member, const Rule& rule) {
  const MemberType& type = *member.type;
  switch (type.type) {
    case FieldType::Number: return read_one<double>(node, path, member, rule);
    case FieldType::Whole: return read_one<int>(node, path, member, rule);
    case FieldType::Boolean: return read_one<bool>(node, path, member, rule);
    case FieldType::Vector: return read_one<Vec3>(node, path, member, rule);
    case FieldType::Text: return read(node, path, member.as<std::string>(), rule);
    case FieldType::Vectors: return read(node, path, member.as<std::vector<Vec3>>(), rule);
    case FieldType::Numbers: return read(node, path, member.as<std::vector<double>>(), rule);
    case FieldType::Wholes: return read(node, path, member.as<std::vector<int>>(), rule);
    case FieldType::Texts: return read(node, path, member.as<std::vector<std::string>>(), rule);
    case FieldType::Choice:
      if (const auto index = read_choice(node, path, type.choices)) type.choose(member.at, *index);
      return;
    case FieldType::Choices: return read_choices(node, path, member);
    case FieldType::Mapping: return read_mapping(node, path, member);
    case FieldType::Mappings:
      if (!read_items(node, path, rule, "mappings")) return;
      for (std::size_t i = 0; i < node.items.size(); ++i)
        read_members(*node.items[i], path + '[' + std::to_string(i) + ']', type, type.add(member.at));
      return;
  }
}

template <class T>
void ReadArchive::read_one(const Node& node, const std::string& path, const Member& member, const Rule& rule) {
  if (!member.type->optional) return read(node, path, member.as<T>(), rule);
  if (rule.automatic && node.kind == Node::Kind::Scalar && node.text == "auto") return;
  const std::size_t before = faults_.count();
  T value{};
  read(node, path, value, rule);
  if (faults_.count() == before) {
    member.as<std::optional<T>>() = value;
  } else {
    lost_ = true;
  }
}

void ReadArchive::read_choices(const Node& node, const std::string& path, const Member& member) {
  const MemberType& type = *member.type;
  type.clear(member.at);
  if (node.kind != Node::Kind::List) {
    if (node.kind == Node::Kind::Scalar && node.text == "none") return;
    if (const auto index = read_choice(node, path, type.choices, FieldType::Choices)) type.choose(member.at, *index);
    return;
  }
  std::vector<std::size_t> taken;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    // A refused word is replaced by the first one.
    const std::size_t one = read_choice(*node.items[i], path + '[' + std::to_string(i) + ']', type.choices).value_or(0);
    if (std::find(taken.begin(), taken.end(), one) != taken.end()) continue;
    taken.push_back(one);
    type.choose(member.at, one);
  }
}

void ReadArchive::read_mapping(const Node& node, const std::string& path, const Member& member) {
  const MemberType& type = *member.type;
  if (!type.optional) return read_members(node, path, type, member.at);
  const std::optional<bool> word = node.boolean();
  if (word == false) return;
  void* one = type.add(member.at);
  if (word != true) return read_members(node, path, type, one);
  Node empty;
  empty.kind = Node::Kind::Mapping;
  empty.mark = node.mark;
  read_members(empty, path, type, one);
}

void ReadArchive::read_members(const Node& node, const std::string& path, const MemberType& type, void* one) {
  if (node.kind != Node::Kind::Mapping) return refuse(node, path, type);
  ReadArchive inner(faults_, node, path, files_);
  type.fields(inner, one);
  inner.finish();
}

void ReadArchive::refuse(const Node& node, const std::string& path, const MemberType& type) {
  const MappingInfo info = mapping_info(type);
  fault(node, path, "expected a mapping", mapping_hint(node, info.keys, info.may_be_empty) + (type.optional ? " or false for none" : ""));
}

void ReadArchive::check(bool holds, const std::string& key, std::string expected, std::string found, std::string hint) {
  if (!holds) broken_.push_back({key, std::move(expected), std::move(found), std::move(hint)});
}

bool ReadArchive::finish_unknown() {
  bool misspelt = false;
  std::vector<std::string_view> names;  // kinds share keys
  for (const std::string_view name : known_) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  for (const Node::Entry& entry : mapping_.entries) {
    const std::string_view key = entry.key;
    const bool idle = std::any_of(idle_.begin(), idle_.end(), [&](const Idle& one) { return one.key == key; });
    if (idle || std::find(names.begin(), names.end(), key) != names.end()) continue;
    std::string hint = "known: " + joined(names);
    const std::string_view ours = our_word(key);
    std::string near = std::find(names.begin(), names.end(), ours) != names.end() ? std::string(ours) : "";
    if (near.empty()) near = nearest_word(key, names);
    if (!near.empty()) {
      misspelt = true;
      if (mapping_.find(near) == nullptr) faults_.doubt(path_of(near));
      hint = "did you mean '" + near + "'? (" + hint + ')';
    } else if (const std::string home = home_of(key, scene_fields(), ""); !home.empty() && home != path_) {
      hint = "a key of this name belongs to " + home + " (" + hint + ')';
    }
    faults_.add(entry.mark, path_of(shown(key)), "unknown key", "", hint);
  }
  return misspelt;
}

/// Keys that belong to other values of a selector, unless the selector's own value is unknown.
void ReadArchive::finish_idle() {
  for (const Node::Entry& entry : mapping_.entries) {
    if (std::find(known_.begin(), known_.end(), entry.key) != known_.end()) continue;
    std::vector<std::string_view> users;
    const When* when = nullptr;
    for (const Idle& idle : idle_) {
      if (idle.key != entry.key) continue;
      users.insert(users.end(), idle.when.choices.begin(), idle.when.choices.end());
      when = &idle.when;
    }
    if (when == nullptr || faults_.has(path_of(when->selector))) continue;
    const std::string selector(when->selector);
    faults_.add(entry.mark, path_of(shown(entry.key)), "has no meaning with " + selector + ": " + std::string(when->current), "",
                "it belongs to " + selector + ": " + joined(users));
  }
}

bool ReadArchive::sound(std::string_view key) const {
  if (faults_.has(path_of(key))) return false;
  const std::array<std::string_view, 1> own{key.substr(0, key.find('.'))};
  if (mapping_.find(own[0]) != nullptr) return true;
  return std::none_of(mapping_.entries.begin(), mapping_.entries.end(), [&](const Node::Entry& entry) {
    return std::find(known_.begin(), known_.end(), entry.key) == known_.end() && !nearest_word(entry.key, own).empty();
  });
}

void ReadArchive::finish() {
  const bool misspelt = finish_unknown();
  for (Missing& missing : missing_) {
    const std::string path = path_of(missing.key);
    if (faults_.has(path) || (!missing.selector.empty() && faults_.has(path_of(missing.selector)))) continue;
    faults_.add(mapping_.mark, path, std::move(missing.expected), "nothing", "this key is required");
  }
  finish_idle();
  for (Broken& relation : broken_) {
    const std::string& key = relation.key;
    if ((misspelt || lost_) && key.find_first_of(".[") == std::string::npos) continue;
    const std::string path = path_.empty() ? key : key.empty() ? path_ : path_ + '.' + key;
    if (!key.empty() && faults_.has(path)) continue;
    faults_.add(mark_of(mapping_, key), path, std::move(relation.expected), std::move(relation.found), std::move(relation.hint));
  }
}

void ReadArchive::read(const Node& node, const std::string& path, double& value, const Rule& rule) {
  const std::string expected = expected_text(FieldType::Number, rule);
  if (node.kind != Node::Kind::Scalar) {
    fault(node, path, expected, "");
    return;
  }
  const QuantityText text = read_quantity(node.text, rule.quantity);
  if (!text.ok || !rule.holds(text.value)) {
    fault(node, path, expected, text.hint.empty() ? automatic_hint(node.text, rule) : text.hint);
    return;
  }
  value = rule.degrees ? text.value * kDegree : text.value;
}

void ReadArchive::read(const Node& node, const std::string& path, int& value, const Rule& rule) {
  const std::string expected = expected_text(FieldType::Whole, rule);
  if (node.kind != Node::Kind::Scalar) {
    fault(node, path, expected, "");
    return;
  }
  const WholeText text = read_whole(node.text);
  if (!text.ok || !rule.holds(static_cast<double>(text.value)) || std::abs(text.value) > 2'000'000'000) {
    fault(node, path, expected, text.hint.empty() ? automatic_hint(node.text, rule) : text.hint);
    return;
  }
  value = static_cast<int>(text.value);
}

void ReadArchive::read(const Node& node, const std::string& path, bool& value, const Rule& rule) {
  if (const std::optional<bool> read_value = node.boolean()) {
    value = *read_value;
  } else {
    const std::string automatic = node.kind == Node::Kind::Scalar ? automatic_hint(node.text, rule) : "";
    fault(node, path, expected_text(FieldType::Boolean, rule), automatic.empty() ? boolean_hint(node) : automatic);
  }
}

void ReadArchive::read(const Node& node, const std::string& path, std::string& value, const Rule& rule) {
  if (node.kind != Node::Kind::Scalar) {
    fault(node, path, rule.name ? "expected a name" : "expected text", "");
  } else if (rule.file && !may_name(files_, node.text)) {
    fault(node, path, kInsideFolder, printable(node.text) == node.text ? kAllowHint : "names of files have no control characters");
  } else if (has_controls(node.text)) {
    fault(node, path, "expected text without control characters", "");
  } else if (rule.name && !is_identifier(node.text)) {
    fault(node, path, "expected a name", "names are at most 100 letters, digits, '_', '.', '-', and begin with a letter or '_'");
  } else {
    value = node.text;
  }
}

void ReadArchive::read(const Node& node, const std::string& path, Vec3& value, const Rule& rule) {
  const std::size_t least = rule.least_items == 0 ? 3 : rule.least_items, most = std::min<std::size_t>(rule.most_items, 3);
  if (node.kind != Node::Kind::List || node.items.size() < least || node.items.size() > most) {
    fault(node, path, expected_text(FieldType::Vector, rule), node.kind == Node::Kind::Scalar ? automatic_hint(node.text, rule) : "");
    return;
  }
  const std::size_t before = faults_.count();
  Vec3 read_value = Vec3::Zero();
  Rule each = rule;
  each.automatic = false;  // the vector as a whole
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    read(*node.items[i], path + '[' + std::to_string(i) + ']', read_value[static_cast<Eigen::Index>(i)], each);
  }
  if (faults_.count() != before) return;
  if (rule.direction && !(read_value.norm() > 1e-150 && read_value.norm() < 1e150)) {
    faults_.add(node.mark, path, "expected a direction", "a zero vector", "");
    return;
  }
  value = read_value;
}

bool ReadArchive::read_items(const Node& node, const std::string& path, const Rule& rule, std::string_view noun) {
  if (node.kind != Node::Kind::List) {
    fault(node, path, "expected a list of " + std::string(noun),
          node.kind == Node::Kind::Mapping ? "begin each item with '- '" : node.kind == Node::Kind::Null && rule.least_items == 0 ? "write [] for none" : "");
    return false;
  }
  if (node.items.size() < rule.least_items || node.items.size() > rule.most_items) {
    fault(node, path,
          rule.least_items == rule.most_items      ? "expected " + std::to_string(rule.least_items) + ' ' + std::string(noun)
          : node.items.size() > rule.most_items ? "expected a list of at most " + std::to_string(rule.most_items)
                                                : "expected a list of at least " + std::to_string(rule.least_items),
          "");
    return false;
  }
  return true;
}

void ReadArchive::read(const Node& node, const std::string& path, std::vector<Vec3>& value, const Rule& rule) {
  if (!read_items(node, path, rule, "points")) return;
  value.assign(node.items.size(), Vec3::Zero());
  const Rule each = rule.items(3, 3);
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    read(*node.items[i], path + '[' + std::to_string(i) + ']', value[i], each);
  }
}

void ReadArchive::read(const Node& node, const std::string& path, std::vector<double>& value, const Rule& rule) {
  if (!read_items(node, path, rule, "numbers")) return;
  value.assign(node.items.size(), 0.0);
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    read(*node.items[i], path + '[' + std::to_string(i) + ']', value[i], rule);
  }
}

void ReadArchive::read(const Node& node, const std::string& path, std::vector<int>& value, const Rule& rule) {
  if (!read_items(node, path, rule, "whole numbers")) return;
  value.assign(node.items.size(), 0);
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    read(*node.items[i], path + '[' + std::to_string(i) + ']', value[i], rule);
  }
}

void ReadArchive::read(const Node& node, const std::string& path, std::vector<std::string>& value, const Rule& rule) {
  if (!read_items(node, path, rule, "names")) return;
  value.assign(node.items.size(), "");
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    read(*node.items[i], path + '[' + std::to_string(i) + ']', value[i], rule);
  }
}

std::optional<std::size_t> ReadArchive::read_choice(const Node& node, const std::string& path,
                                                    std::span<const std::string_view> names, FieldType type) {
  std::string hint;
  if (node.kind == Node::Kind::Scalar) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == node.text) return i;
    }
    const std::string_view ours = our_choice(node.text);
    const std::string near = std::find(names.begin(), names.end(), ours) != names.end() ? std::string(ours) : nearest_word(node.text, names);
    if (!near.empty()) hint = "did you mean '" + near + "'?";
  }
  fault(node, path, "expected " + expectation(type, names, {}), hint);
  return std::nullopt;
}

}  // namespace supple::scenes
