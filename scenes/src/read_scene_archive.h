/// @file read_scene_archive.h
/// The archive that reads: one per mapping of the file.
#pragma once

#include <algorithm>
#include <concepts>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fields.h"
#include "fields_info.h"
#include "read_scene_faults.h"
#include "yaml_tree.h"

namespace supple::scenes {

class ReadArchive {
 public:
  /// @param mapping  a Mapping node   @param path  its key path, "" for the whole scene
  ReadArchive(FaultList& faults, const Node& mapping, std::string path)
      : faults_(faults), mapping_(mapping), path_(std::move(path)) {}

  template <class T>
  void operator()(std::string_view key, T& value, const Rule& rule, std::string_view /*meaning*/) {
    field(key, value, rule, false);
  }
  template <class T>
  void required(std::string_view key, T& value, const Rule& rule, std::string_view /*meaning*/) {
    field(key, value, rule, true);
  }
  [[nodiscard]] bool given(std::string_view key) const { return mapping_.find(key) != nullptr; }
  [[nodiscard]] bool sound(std::string_view key) const;
  /// A fault at `key` (a path below this mapping, or "" for the mapping) unless it holds, that key is faulty already, or, where
  /// it is one of this mapping, another one of them is lost or seems misspelt, which may be what `key` misses.
  void check(bool holds, const std::string& key, std::string expected, std::string found, std::string hint);
  /// Reports keys that no field took, and relations that do not hold. Call after `fields`.
  void finish();

 private:
  template <class T>
  void field(std::string_view key, T& value, const Rule& rule, bool required) {
    if (!rule.when.choices.empty() && faults_.has(path_of(rule.when.selector))) {
      known_.push_back(key);  // the kind is not known, so nothing can be said about its keys
      return;
    }
    if (!rule.when.applies()) {
      idle_.push_back({key, rule.when});
      return;
    }
    known_.push_back(key);
    const std::string path = path_of(key);
    if (const Node::Entry* entry = mapping_.find(key)) {
      read(*entry->value, path, value, rule);
    } else if (required) {
      missing_.push_back({std::string(key), rule.when.selector, "expected " + expectation(value, rule)});
    }
  }

  [[nodiscard]] std::string path_of(std::string_view key) const {
    return path_.empty() ? std::string(key) : path_ + '.' + std::string(key);
  }
  void fault(const Node& node, const std::string& path, std::string expected, std::string hint) {
    faults_.add(node.mark, path, std::move(expected), node.described(), std::move(hint));
  }

  void read(const Node& node, const std::string& path, double& value, const Rule& rule);
  void read(const Node& node, const std::string& path, int& value, const Rule& rule);
  void read(const Node& node, const std::string& path, bool& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::string& value, const Rule& rule);
  void read(const Node& node, const std::string& path, Vec3& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<Vec3>& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<int>& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<std::string>& value, const Rule& rule);
  [[nodiscard]] bool read_items(const Node& node, const std::string& path, const Rule& rule, std::string_view noun);
  /// Index of the word in names, or none with a fault. @param type  Choice or Choices: what else the fault says may stand there
  std::optional<std::size_t> read_choice(const Node& node, const std::string& path, std::span<const std::string_view> names,
                                         FieldType type = FieldType::Choice);

  template <class E>
    requires std::is_enum_v<E>
  void read(const Node& node, const std::string& path, E& value, const Rule& /*rule*/) {
    if (const auto index = read_choice(node, path, EnumNames<E>::names)) value = static_cast<E>(*index);
  }

  template <class E>
    requires std::is_enum_v<E>
  void read(const Node& node, const std::string& path, std::vector<E>& value, const Rule& rule) {
    value.clear();
    if (node.kind != Node::Kind::List) {
      if (node.kind == Node::Kind::Scalar && node.text == "none") return;
      if (const auto index = read_choice(node, path, EnumNames<E>::names, FieldType::Choices)) value = {static_cast<E>(*index)};
      return;
    }
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      E one{};
      read(*node.items[i], path + '[' + std::to_string(i) + ']', one, rule);
      if (std::find(value.begin(), value.end(), one) == value.end()) value.push_back(one);
    }
  }

  template <class T>
    requires std::same_as<T, double> || std::same_as<T, int> || std::same_as<T, bool> || std::same_as<T, Vec3>
  void read(const Node& node, const std::string& path, std::optional<T>& value, const Rule& rule) {
    if (rule.automatic && node.kind == Node::Kind::Scalar && node.text == "auto") return;
    const std::size_t before = faults_.count();
    T read_value{};
    read(node, path, read_value, rule);
    if (faults_.count() == before) {
      value = read_value;
    } else {
      lost_ = true;
    }
  }

  template <Described D>
  void read(const Node& node, const std::string& path, D& value, const Rule& /*rule*/) {
    if (node.kind != Node::Kind::Mapping) {
      refuse<D>(node, path, false);
      return;
    }
    ReadArchive inner(faults_, node, path);
    fields(inner, value);
    inner.finish();
  }

  template <Described D>
  void read(const Node& node, const std::string& path, std::optional<D>& value, const Rule& rule) {
    if (node.boolean() == false) return;
    value.emplace();
    if (node.boolean() == true) {
      Node empty;
      empty.kind = Node::Kind::Mapping;
      empty.mark = node.mark;
      read(empty, path, *value, rule);
    } else if (node.kind != Node::Kind::Mapping) {
      refuse<D>(node, path, true);
    } else {
      read(node, path, *value, rule);
    }
  }

  template <Described D>
  void read(const Node& node, const std::string& path, std::vector<D>& value, const Rule& rule) {
    if (!read_items(node, path, rule, "mappings")) return;
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      read(*node.items[i], path + '[' + std::to_string(i) + ']', value.emplace_back(), rule);
    }
  }

  /// A fault at what is no mapping.
  template <Described D>
  void refuse(const Node& node, const std::string& path, bool may_be_absent) {
    InfoArchive keys;
    EmptyArchive empty;
    D listed{}, defaults{};
    fields(keys, listed);
    fields(empty, defaults);
    fault(node, path, "expected a mapping", mapping_hint(node, keys.list, empty.complete) + (may_be_absent ? " or false for none" : ""));
  }
  /// What to write instead of `node`. @param may_be_empty  {} is complete
  static std::string mapping_hint(const Node& node, const std::vector<FieldInfo>& keys, bool may_be_empty);

  /// Faults of keys that no field took. @return whether one of them seems misspelt
  bool finish_unknown();
  void finish_idle();

  struct Idle {
    std::string_view key;
    When when;
  };

  /// A required key that is not given.
  struct Missing {
    std::string key;
    std::string_view selector;  ///< for whose value it is required; empty: always
    std::string expected;
  };

  /// A relation that does not hold.
  struct Broken {
    std::string key, expected, found, hint;
  };

  FaultList& faults_;
  const Node& mapping_;
  std::string path_;
  std::vector<std::string_view> known_;
  std::vector<Idle> idle_;
  std::vector<Missing> missing_;
  bool lost_ = false;  ///< a key is given whose value is faulty, and there is no default in its place
  std::vector<Broken> broken_;
};

}  // namespace supple::scenes
