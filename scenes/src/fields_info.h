/// @file fields_info.h
/// The field lists as data: what the reference page, the JSON schema and hints print.
#pragma once

#include <concepts>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "fields.h"

namespace supple::scenes {

enum class FieldType : std::uint8_t { Number, Whole, Boolean, Text, Choice, Choices, Vector, Vectors, Wholes, Texts, Mapping, Mappings };

struct FieldInfo {
  std::string_view key;
  std::string_view meaning;
  FieldType type = FieldType::Number;
  bool required = false;
  bool may_be_absent = false;                ///< std::optional, so false or auto (by the rule) stand for none
  bool may_be_empty = false;                 ///< Mapping: {} is complete
  std::string default_text;                  ///< "" without default
  Rule rule;
  std::span<const std::string_view> choices; ///< Choice, Choices
  std::vector<FieldInfo> children;           ///< Mapping, Mappings
};

class InfoArchive {
 public:
  std::vector<FieldInfo> list;

  template <class T>
  void operator()(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    add(key, value, rule, meaning).default_text = default_of(value, rule);
  }
  template <class T>
  void required(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    add(key, value, rule, meaning).required = true;
  }
  [[nodiscard]] static bool given(std::string_view /*key*/) { return false; }
  [[nodiscard]] static bool sound(std::string_view /*key*/) { return true; }
  static void check(bool /*holds*/, const std::string& /*key*/, const std::string& /*expected*/, const std::string& /*found*/,
                    const std::string& /*hint*/) {}

 private:
  template <class T>
  FieldInfo& add(std::string_view key, T& value, const Rule& rule, std::string_view meaning);

  static std::string default_of(double value, const Rule& rule);
  static std::string default_of(int value, const Rule& /*rule*/) { return std::to_string(value); }
  static std::string default_of(bool value, const Rule& /*rule*/) { return value ? "true" : "false"; }
  static std::string default_of(const std::string& value, const Rule& /*rule*/) { return '"' + value + '"'; }
  static std::string default_of(const Vec3& value, const Rule& rule);
  static std::string default_of(const std::vector<int>& value, const Rule& rule);
  template <class E>
    requires std::is_enum_v<E>
  static std::string default_of(const std::vector<E>& value, const Rule& /*rule*/) {
    return value.empty() ? "none" : std::string(name_of(value.front()));
  }
  template <class T>
  static std::string default_of(const std::optional<T>& /*value*/, const Rule& rule) {
    return rule.automatic ? "auto" : "";
  }
  template <class T>
  static std::string default_of(const T& value, const Rule& /*rule*/) {
    if constexpr (std::is_enum_v<T>) return std::string(name_of(value));
    return "";
  }
};

/// Tells whether a mapping without keys is complete.
class EmptyArchive {
 public:
  bool complete = true;

  template <class T>
  void operator()(std::string_view /*key*/, T& /*value*/, const Rule& /*rule*/, std::string_view /*meaning*/) {}
  template <class T>
  void required(std::string_view /*key*/, T& /*value*/, const Rule& rule, std::string_view /*meaning*/) {
    complete = complete && !rule.when.applies();
  }
  [[nodiscard]] static bool given(std::string_view /*key*/) { return false; }
  [[nodiscard]] static bool sound(std::string_view /*key*/) { return true; }
  void check(bool holds, const std::string& /*key*/, const std::string& /*expected*/, const std::string& /*found*/, const std::string& /*hint*/) {
    complete = complete && holds;
  }
};

/// A struct that has a field list.
template <class D>
concept Described = std::is_class_v<D> && requires(InfoArchive& archive, D& d) { fields(archive, d); };

template <class T>
struct FieldKind;
template <> struct FieldKind<double> { static constexpr FieldType type = FieldType::Number; };
template <> struct FieldKind<int> { static constexpr FieldType type = FieldType::Whole; };
template <> struct FieldKind<bool> { static constexpr FieldType type = FieldType::Boolean; };
template <> struct FieldKind<std::string> { static constexpr FieldType type = FieldType::Text; };
template <> struct FieldKind<Vec3> { static constexpr FieldType type = FieldType::Vector; };
template <> struct FieldKind<std::vector<Vec3>> { static constexpr FieldType type = FieldType::Vectors; };
template <> struct FieldKind<std::vector<int>> { static constexpr FieldType type = FieldType::Wholes; };
template <> struct FieldKind<std::vector<std::string>> { static constexpr FieldType type = FieldType::Texts; };
template <class E>
  requires std::is_enum_v<E>
struct FieldKind<E> { static constexpr FieldType type = FieldType::Choice; };
template <class E>
  requires std::is_enum_v<E>
struct FieldKind<std::vector<E>> { static constexpr FieldType type = FieldType::Choices; };
template <Described D> struct FieldKind<D> { static constexpr FieldType type = FieldType::Mapping; };
template <Described D> struct FieldKind<std::vector<D>> { static constexpr FieldType type = FieldType::Mappings; };
template <class T> struct FieldKind<std::optional<T>> { static constexpr FieldType type = FieldKind<T>::type; };

template <class T>
struct FieldValue { using type = T; };
template <class T> struct FieldValue<std::optional<T>> { using type = T; };
template <Described D> struct FieldValue<std::vector<D>> { using type = D; };
template <class E>
  requires std::is_enum_v<E>
struct FieldValue<std::vector<E>> { using type = E; };

template <class T>
FieldInfo& InfoArchive::add(std::string_view key, T& /*value*/, const Rule& rule, std::string_view meaning) {
  using Value = typename FieldValue<T>::type;
  FieldInfo& info = list.emplace_back();
  info.key = key;
  info.meaning = meaning;
  info.type = FieldKind<T>::type;
  info.may_be_absent = !std::is_same_v<T, Value> && info.type != FieldType::Mappings && info.type != FieldType::Choices;
  info.rule = rule;
  if constexpr (std::is_enum_v<Value>) info.choices = EnumNames<Value>::names;
  if constexpr (Described<Value>) {
    InfoArchive inner;
    Value value{};
    fields(inner, value);
    info.children = std::move(inner.list);
    EmptyArchive empty;
    Value defaults{};
    fields(empty, defaults);
    info.may_be_empty = empty.complete;
  }
  return info;
}

/// Every key of a scene.
[[nodiscard]] const std::vector<FieldInfo>& scene_fields();

/// "a length > 0 [m]", "three lengths [m]", "one of a, b": what a key expects, after "expected ".
[[nodiscard]] std::string expectation(FieldType type, std::span<const std::string_view> choices, const Rule& rule);
template <class T>
[[nodiscard]] std::string expectation(const T& /*value*/, const Rule& rule) {
  std::span<const std::string_view> choices;
  using Value = typename FieldValue<T>::type;
  if constexpr (std::is_enum_v<Value>) choices = EnumNames<Value>::names;
  return expectation(FieldKind<T>::type, choices, rule);
}

}  // namespace supple::scenes
