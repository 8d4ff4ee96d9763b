/// @file expand_scene.h
/// What a scene file says in short, written out before its keys are read: `include`, `variables`, `defaults`, `repeat`, `emit` and ${expressions}.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "file/expand/expression.h"
#include "file/named_files.h"
#include "file/yaml/yaml_tree.h"

namespace supple::scenes {

inline constexpr std::size_t kMostIncludes = 64;  ///< files of one scene

/// The tree with the files that `include` names merged into it, which may include others: what a file says itself wins over what it
/// includes; lists of mappings are joined, included items first. So are items of lists that include files. Paths are relative to the file that names them.
/// Nodes keep the places in their own files. @param root  a mapping
[[nodiscard]] Node* with_includes(Node* root, const FileAccess& files, SourceTexts& texts, Tree& tree, FaultList& faults);

/// Variables of a scene, and the expansion of nodes by them.
class Expansion {
 public:
  /// @param root  with `variables`, if any; outlives this
  Expansion(const Node& root, Tree& tree, FaultList& faults);

  /// The tree without `variables`, `defaults` and `materials`: defaults are merged into the items of the lists that they name, names of
  /// materials have become these, items with `repeat` are repeated, and expressions have become their values.
  [[nodiscard]] Node* expand_scene(Node& root);
  /// A node whose expressions have become their values; the same node where it has none. @param key  for messages
  [[nodiscard]] Node* expand(Node& node, const std::string& key);

 private:
  struct Variable {
    const Node* node = nullptr;
    Mark mark;
    bool open = false;  // being evaluated
    bool known = false;
    Value value;
  };
  struct Index {
    std::string name;
    double value = 0.0;
  };

  [[nodiscard]] std::optional<Value> find(std::string_view name);
  [[nodiscard]] Value value_of(const Node& scalar);
  [[nodiscard]] Node* with_materials(const Node& root, Node& scene);
  [[nodiscard]] Node* expand_list(Node& list, const std::string& key);
  [[nodiscard]] Node* expand_mapping(Node& mapping, const std::string& key);
  void expand_item(Node& item, const std::string& key, std::vector<Node*>& out);
  [[nodiscard]] std::vector<std::pair<Index, std::size_t>> counts_of(const Node& repeat, const std::string& key);
  void repeat(Node& item, std::span<const std::pair<Index, std::size_t>> counts, const std::string& key, std::vector<Node*>& out);
  void stand(Node& item, const std::string& key, std::vector<Node*>& out);
  void emit(Node& item, const Node::Entry& entry, const std::string& key, std::vector<Node*>& out);
  [[nodiscard]] std::optional<double> number_of(const Node& mapping, std::string_view name, std::string_view like, double otherwise, const std::string& key);
  void count(const Node& node, const std::string& key);
  void fail(Mark mark, const std::string& key, const ExpressionFault& fault);

  Tree& tree_;
  FaultList& faults_;
  std::vector<std::pair<std::string, Variable>> variables_;  // in the order of the file
  std::vector<Index> indices_;                               // inner ones last
  std::uint64_t nodes_ = 0;                                  // of all copies
};

/// The node with the keys of `over`, and with those of `base` that it does not have; mappings are merged in the same way.
[[nodiscard]] Node* merged(Node& base, Node& over, Tree& tree);

}  // namespace supple::scenes
