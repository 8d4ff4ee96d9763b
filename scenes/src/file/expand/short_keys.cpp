#include "file/expand/short_keys.h"

#include <algorithm>
#include <span>

#include "file/fields/fields_info.h"

namespace supple::scenes {
namespace {

constexpr std::string_view kOfScene[] = {"include", "variables", "defaults", "materials"};
constexpr std::string_view kOfItem[] = {"repeat"};
constexpr std::string_view kOfIncludingItem[] = {"repeat", "include"};
constexpr std::string_view kOfObject[] = {"repeat", "include", "emit"};

class Search {
 public:
  explicit Search(FaultList& faults) : faults_(faults) {}

  void of_mapping(const Node& mapping, const std::vector<FieldInfo>& fields, std::span<const std::string_view> shorts, const std::string& path) {
    std::vector<std::string_view> names(shorts.begin(), shorts.end());
    for (const FieldInfo& field : fields) names.push_back(field.key);
    for (const Node::Entry& entry : mapping.entries) {
      const std::string place = (path.empty() ? "" : path + '.') + shown(entry.key);
      const auto field = std::find_if(fields.begin(), fields.end(), [&](const FieldInfo& info) { return info.key == entry.key; });
      if (field != fields.end()) {
        of_value(*entry.value, *field, path.empty(), place);
      } else if (std::find(names.begin(), names.end(), entry.key) == names.end()) {
        const std::string near = nearest_word(entry.key, names);
        if (std::find(shorts.begin(), shorts.end(), near) != shorts.end()) faults_.add(entry.mark, place, "unknown key", "", "did you mean '" + near + "'?");
      }
    }
  }

 private:
  void of_value(const Node& value, const FieldInfo& field, bool of_scene, const std::string& place) {
    if (field.type == FieldType::Mapping && value.kind == Node::Kind::Mapping) of_mapping(value, field.children, {}, place);
    if (field.type != FieldType::Mappings || value.kind != Node::Kind::List) return;
    std::span<const std::string_view> shorts = kOfItem;
    if (of_scene) shorts = field.key == "objects" ? std::span<const std::string_view>(kOfObject) : kOfIncludingItem;
    for (std::size_t i = 0; i < value.items.size(); ++i) {
      if (value.items[i]->kind == Node::Kind::Mapping) of_mapping(*value.items[i], field.children, shorts, place + '[' + std::to_string(i) + ']');
    }
  }

  FaultList& faults_;
};

}  // namespace

void tell_misspelt_short_keys(const Node& root, FaultList& faults) { Search(faults).of_mapping(root, scene_fields(), kOfScene, ""); }

}  // namespace supple::scenes
