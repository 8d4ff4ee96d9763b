/// @file fields_archive.h
/// Archives over the field lists of fields.h. An archive sees each member as data, so that the lists are compiled once, for all archives.
#pragma once

#include <concepts>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "file/fields/fields_rules.h"

namespace supple::scenes {

enum class FieldType : std::uint8_t { Number, Whole, Boolean, Text, Choice, Choices, Vector, Vectors, Numbers, Wholes, Texts, Mapping, Mappings };

class FieldArchive;

/// Operations on a member without its C++ type; operations that a type does not have are null.
struct MemberType {
  FieldType type = FieldType::Number;
  bool optional = false;                                    ///< std::optional of what `type` says
  std::span<const std::string_view> choices;                ///< Choice, Choices
  std::size_t (*chosen)(const void* member) = nullptr;      ///< Choice: its index
  void (*choose)(void* member, std::size_t index) = nullptr;  ///< Choice: sets it; Choices: adds it at the end
  void (*clear)(void* member) = nullptr;                    ///< Choices
  std::vector<std::size_t> (*all_chosen)(const void* member) = nullptr;  ///< Choices: the indices in their order
  void* (*add)(void* member) = nullptr;                     ///< Mappings: a new one at the end; optional Mapping: a new one in its place
  std::vector<void*> (*all)(void* member) = nullptr;        ///< Mapping, Mappings: every one, none of an empty optional
  void (*fields)(FieldArchive& archive, void* one) = nullptr;  ///< Mapping, Mappings: the members of one of them
  std::shared_ptr<void> (*make)() = nullptr;                ///< Mapping, Mappings: a new one with all defaults
};

struct Member {
  void* at = nullptr;
  const MemberType* type = nullptr;
  /// @pre T is what the type says
  template <class T>
  [[nodiscard]] T& as() const {
    return *static_cast<T*>(at);
  }
};

template <class T>
[[nodiscard]] const MemberType& member_type();

class FieldArchive {
 public:
  FieldArchive() = default;
  FieldArchive(const FieldArchive&) = delete;
  FieldArchive& operator=(const FieldArchive&) = delete;
  virtual ~FieldArchive() = default;

  template <class T>
  void operator()(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    field({&value, &member_type<T>()}, {key, meaning, false}, rule);
  }
  template <class T>
  void required(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    field({&value, &member_type<T>()}, {key, meaning, true}, rule);
  }
  /// Whether the file names the key.
  [[nodiscard]] virtual bool given(std::string_view /*key*/) const { return false; }
  /// Whether the value of a key is reliable: false where it, or a key that may be its misspelling, is faulty.
  [[nodiscard]] virtual bool sound(std::string_view /*key*/) const { return true; }
  /// A relation between keys; `key` may be a path below this mapping, or "" for the mapping itself.
  virtual void check(bool /*holds*/, const std::string& /*key*/, std::string /*expected*/, std::string /*found*/, std::string /*hint*/) {}

 protected:
  struct Label {
    std::string_view key, meaning;
    bool required = false;
  };
  virtual void field(const Member& member, const Label& label, const Rule& rule) = 0;
};

/// All members of a scene, and those of its parts by their types.
void scene_members(FieldArchive& archive, Scene& scene);

/// A struct that has a field list.
template <class D>
concept Described = std::is_class_v<D> && requires(FieldArchive& archive, D& d) { fields(archive, d); };

namespace member_types {

template <class T> struct ValueOf { using type = T; };
template <class T> struct ValueOf<std::optional<T>> { using type = T; };
template <class T> inline constexpr bool is_vector = false;
template <class T> inline constexpr bool is_vector<std::vector<T>> = true;

template <class D>
void describe(MemberType& out) {
  out.fields = [](FieldArchive& archive, void* one) { fields(archive, *static_cast<D*>(one)); };
  out.make = []() -> std::shared_ptr<void> { return std::make_shared<D>(); };
}

template <class Value>
void describe_list(MemberType& out) {
  using One = typename Value::value_type;
  if constexpr (std::same_as<One, Vec3>) {
    out.type = FieldType::Vectors;
  } else if constexpr (std::same_as<One, double>) {
    out.type = FieldType::Numbers;
  } else if constexpr (std::same_as<One, int>) {
    out.type = FieldType::Wholes;
  } else if constexpr (std::same_as<One, std::string>) {
    out.type = FieldType::Texts;
  } else if constexpr (std::is_enum_v<One>) {
    out.type = FieldType::Choices;
    out.choices = EnumNames<One>::names;
    out.choose = [](void* member, std::size_t index) { static_cast<Value*>(member)->push_back(static_cast<One>(index)); };
    out.clear = [](void* member) { static_cast<Value*>(member)->clear(); };
    out.all_chosen = [](const void* member) {
      std::vector<std::size_t> indices;
      for (const One one : *static_cast<const Value*>(member)) indices.push_back(static_cast<std::size_t>(one));
      return indices;
    };
  } else {
    out.type = FieldType::Mappings;
    out.add = [](void* member) -> void* { return &static_cast<Value*>(member)->emplace_back(); };
    out.all = [](void* member) {
      std::vector<void*> every;
      for (One& one : *static_cast<Value*>(member)) every.push_back(&one);
      return every;
    };
    describe<One>(out);
  }
}

template <class T>
MemberType describe_member() {
  using Value = typename ValueOf<T>::type;
  MemberType out;
  out.optional = !std::same_as<T, Value>;
  if constexpr (std::same_as<Value, double>) {
    out.type = FieldType::Number;
  } else if constexpr (std::same_as<Value, int>) {
    out.type = FieldType::Whole;
  } else if constexpr (std::same_as<Value, bool>) {
    out.type = FieldType::Boolean;
  } else if constexpr (std::same_as<Value, std::string>) {
    out.type = FieldType::Text;
  } else if constexpr (std::same_as<Value, Vec3>) {
    out.type = FieldType::Vector;
  } else if constexpr (is_vector<Value>) {
    describe_list<Value>(out);
  } else if constexpr (std::is_enum_v<Value>) {
    out.type = FieldType::Choice;
    out.choices = EnumNames<Value>::names;
    out.chosen = [](const void* member) { return static_cast<std::size_t>(*static_cast<const Value*>(member)); };
    out.choose = [](void* member, std::size_t index) { *static_cast<Value*>(member) = static_cast<Value>(index); };
  } else {
    static_assert(Described<Value>, "a member of a scene needs a field list");
    out.type = FieldType::Mapping;
    if constexpr (std::same_as<T, Value>) {
      out.all = [](void* member) { return std::vector<void*>{member}; };
    } else {
      out.add = [](void* member) -> void* { return &static_cast<T*>(member)->emplace(); };
      out.all = [](void* member) {
        T& value = *static_cast<T*>(member);
        return value ? std::vector<void*>{&*value} : std::vector<void*>();
      };
    }
    describe<Value>(out);
  }
  return out;
}

}  // namespace member_types

template <class T>
const MemberType& member_type() {
  static const MemberType type = member_types::describe_member<T>();
  return type;
}

}  // namespace supple::scenes
