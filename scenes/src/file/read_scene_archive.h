/// @file read_scene_archive.h
/// The reading archive: one per mapping of the file.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "file/fields/fields_info.h"
#include "file/named_files.h"
#include "file/read_scene_faults.h"
#include "file/yaml/yaml_tree.h"

namespace supple::scenes {

class ReadArchive final : public FieldArchive {
 public:
  /// @param mapping  a Mapping node   @param path  its key path, "" for the whole scene
  /// @param files  outlives the archive
  ReadArchive(FaultList& faults, const Node& mapping, std::string path, const FileAccess& files)
      : faults_(faults), mapping_(mapping), path_(std::move(path)), files_(files) {}

  [[nodiscard]] bool given(std::string_view key) const override { return mapping_.find(key) != nullptr; }
  [[nodiscard]] bool sound(std::string_view key) const override;
  /// A fault at `key` (a path below this mapping, or "" for the mapping) unless it holds, that key is faulty already, or, where
  /// it is one of this mapping, another key is lost or seems misspelt, which may be the cause.
  void check(bool holds, const std::string& key, std::string expected, std::string found, std::string hint) override;
  /// Reports unknown keys, and relations that do not hold. Call after the fields.
  void finish();

 private:
  void field(const Member& member, const Label& label, const Rule& rule) override;

  [[nodiscard]] std::string path_of(std::string_view key) const {
    return path_.empty() ? std::string(key) : path_ + '.' + std::string(key);
  }
  void fault(const Node& node, const std::string& path, std::string expected, std::string hint) {
    faults_.add(node.mark, path, std::move(expected), node.described(), std::move(hint));
  }

  void read(const Node& node, const std::string& path, const Member& member, const Rule& rule);
  template <class T>
  void read_one(const Node& node, const std::string& path, const Member& member, const Rule& rule);
  void read(const Node& node, const std::string& path, double& value, const Rule& rule);
  void read(const Node& node, const std::string& path, int& value, const Rule& rule);
  void read(const Node& node, const std::string& path, bool& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::string& value, const Rule& rule);
  void read(const Node& node, const std::string& path, Vec3& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<Vec3>& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<double>& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<int>& value, const Rule& rule);
  void read(const Node& node, const std::string& path, std::vector<std::string>& value, const Rule& rule);
  [[nodiscard]] bool read_items(const Node& node, const std::string& path, const Rule& rule, std::string_view noun);
  /// Index of the word in names, or none with a fault. @param type  Choice or Choices: what else the fault says may stand there
  std::optional<std::size_t> read_choice(const Node& node, const std::string& path, std::span<const std::string_view> names,
                                         FieldType type = FieldType::Choice);

  void read_choices(const Node& node, const std::string& path, const Member& member);
  void read_mapping(const Node& node, const std::string& path, const Member& member);
  /// The members of one description. @pre node: a Mapping
  void read_members(const Node& node, const std::string& path, const MemberType& type, void* one);
  /// A fault at a node that is not a mapping.
  void refuse(const Node& node, const std::string& path, const MemberType& type);
  /// Hint for the text to write instead of `node`. @param may_be_empty  {} is complete
  static std::string mapping_hint(const Node& node, const std::vector<FieldInfo>& keys, bool may_be_empty);

  /// Faults of unknown keys. @return whether one of them seems misspelt
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
  const FileAccess& files_;
  std::vector<std::string_view> known_;
  std::vector<Idle> idle_;
  std::vector<Missing> missing_;
  bool lost_ = false;  ///< a key is given whose value is faulty, and there is no default in its place
  std::vector<Broken> broken_;
};

}  // namespace supple::scenes
