/// @file fields_info.h
/// The field lists as data for the reference page, the JSON schema and hints.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "file/fields/fields_archive.h"

namespace supple::scenes {

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

class InfoArchive final : public FieldArchive {
 public:
  std::vector<FieldInfo> list;

 private:
  void field(const Member& member, const Label& label, const Rule& rule) override;
};

/// Finds whether a mapping without keys is complete.
class EmptyArchive final : public FieldArchive {
 public:
  bool complete = true;
  void check(bool holds, const std::string& key, std::string expected, std::string found, std::string hint) override;

 private:
  void field(const Member& member, const Label& label, const Rule& rule) override;
};

/// The keys of a mapping, and whether it may be empty. @pre type: Mapping or Mappings
struct MappingInfo {
  std::vector<FieldInfo> keys;
  bool may_be_empty = false;
};
[[nodiscard]] MappingInfo mapping_info(const MemberType& type);

/// Every key of a scene.
[[nodiscard]] const std::vector<FieldInfo>& scene_fields();

/// "a length > 0 [m]", "three lengths [m]", "one of a, b": what a key expects, after "expected ".
[[nodiscard]] std::string expectation(FieldType type, std::span<const std::string_view> choices, const Rule& rule);

}  // namespace supple::scenes
