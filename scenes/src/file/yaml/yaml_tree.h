/// @file yaml_tree.h
/// YAML text as a tree with the position of every key and value. yaml-cpp serves as tokeniser only; duplicate and
/// merge keys, aliases, several documents, sizes and depths are checked here, because yaml-cpp accepts them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "file/read_scene_faults.h"

namespace supple::scenes {

inline constexpr std::size_t kLargestText = std::size_t{8} << 20;  ///< [bytes]
inline constexpr std::uint64_t kMostNodes = 200'000;               ///< every alias counted at each use
inline constexpr std::size_t kDeepest = 64;                        ///< nested lists and mappings

struct Node {
  enum class Kind : std::uint8_t { Null, Scalar, List, Mapping };
  struct Entry {
    std::string key;
    Mark mark;  ///< of the key
    Node* value = nullptr;
  };
  Kind kind = Kind::Null;
  Mark mark;
  std::string text;            ///< Scalar
  bool quoted = false;         ///< Scalar in quotes
  std::vector<Node*> items;    ///< List
  std::vector<Entry> entries;  ///< Mapping, in file order
  std::uint64_t count = 1;     ///< nodes of this subtree, aliases counted at each use
  std::size_t height = 0;      ///< levels below this node

  [[nodiscard]] const Entry* find(std::string_view key) const;
  /// What an unquoted scalar says as YAML 1.2 spells it: true, True, TRUE, false, False or FALSE; none for anything else.
  [[nodiscard]] std::optional<bool> boolean() const;
  /// "nothing", "a mapping", "a list of 3", -0.2, 'text': the part of a message after "found".
  [[nodiscard]] std::string described() const;
};

/// Position of a key below a node, or of the nearest given one above it.
/// @param key  "objects.ball.skeleton[0].radius", "" for the node; items of a list by index or by their `name`
[[nodiscard]] Mark mark_of(const Node& node, std::string_view key);

/// Owner of nodes; addresses stay valid. Nodes may be shared by aliases.
class Tree {
 public:
  Node* make(Node::Kind kind, Mark mark);
  Node* copy(const Node& node);  ///< children are shared

 private:
  std::deque<Node> nodes_;
};

/// Reads one document. Faults go to `faults`; null when nothing usable was found.
[[nodiscard]] Node* parse_yaml(const std::string& text, std::uint32_t source, Tree& tree, FaultList& faults);

}  // namespace supple::scenes
