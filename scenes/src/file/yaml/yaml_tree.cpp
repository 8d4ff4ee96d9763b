#include "file/yaml/yaml_tree.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include "file/yaml/yaml_faults.h"
#include "file/yaml/yaml_quantity.h"

namespace supple::scenes {
namespace {

constexpr const char* kBulkHint = "keep bulk particles in a CSV file and name it under particles.file";

struct Stop {};  // the rest is unreliable; the fault is already listed

/// Length of the UTF-8 character at `at`, or 0 when it is malformed, overlong, a surrogate or beyond U+10FFFF.
std::size_t character_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return at + i < text.size() ? static_cast<unsigned char>(text[at + i]) : 0U; };
  const auto tail = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first <= 0xDFU) return tail(1) ? 2 : 0;
  if (first >= 0xE0U && first <= 0xEFU) {
    if (!tail(1) || !tail(2)) return 0;
    if (first == 0xE0U && byte(1) < 0xA0U) return 0;
    if (first == 0xEDU && byte(1) > 0x9FU) return 0;
    return 3;
  }
  if (first >= 0xF0U && first <= 0xF4U) {
    if (!tail(1) || !tail(2) || !tail(3)) return 0;
    if (first == 0xF0U && byte(1) < 0x90U) return 0;
    if (first == 0xF4U && byte(1) > 0x8FU) return 0;
    return 4;
  }
  return 0;
}

/// Checks before a tokeniser sees the text.
bool fit_to_parse(std::string_view text, std::uint32_t source, FaultList& faults) {
  if (text.size() > kLargestText) {
    faults.add({source, 1, 1}, "", "expected a file of at most 8 MiB", "more", kBulkHint);
    return false;
  }
  // Each of these makes a node outside quotes and comments; yaml-cpp would read them all before the first event.
  const auto marks = std::count_if(text.begin(), text.end(), [](char c) { return c == ',' || c == '[' || c == '{'; });
  if (static_cast<std::uint64_t>(marks) > kMostNodes) {
    faults.add({source, 1, 1}, "", "expected at most 200000 nodes", "more", kBulkHint);
    return false;
  }
  Mark mark{source, 1, 1};
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const std::size_t length = character_length(text, i);
    const bool control = (byte < 0x20U && byte != '\n' && byte != '\r' && byte != '\t') || byte == 0x7FU;
    if (length == 0 || control) {
      constexpr std::string_view digits = "0123456789abcdef";
      const std::string found = std::string("the byte 0x") + digits[byte >> 4U] + digits[byte & 15U];
      faults.add(mark, "", control ? "expected text without control characters" : "expected UTF-8 text", found,
                 control ? "" : "save the file as UTF-8");
      return false;
    }
    if (byte == '\n') {
      ++mark.line;
      mark.column = 1;
    } else {
      mark.column += static_cast<int>(length);
    }
    i += length;
  }
  return true;
}

/// Builds the tree from the tokeniser's events.
class Builder : public YAML::EventHandler {
 public:
  Builder(std::uint32_t source, Tree& tree, FaultList& faults) : source_(source), tree_(tree), faults_(faults) {}

  Node* root = nullptr;
  Mark last;                 ///< of the last node
  bool last_quoted = false;  ///< it is a text in quotes, or one after '|' or '>'

  /// The innermost node that is not complete, or null.
  [[nodiscard]] const Node* open() const { return open_.empty() ? nullptr : open_.back().node; }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (documents_++ > 0) stop(at(mark), "expected one document", "another one", "remove '---' and what follows it");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Mark where = at(mark);
    if (!open_.empty() && open_.back().has_key) where = open_.back().key_mark;  // yaml-cpp gives the token after it
    if (expects_key()) stop(where, "expected a key", "nothing", "");
    leaf(Node::Kind::Null, where, anchor);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    if (expects_key()) stop(at(mark), "expected a key", "an alias", "");
    Node* node = anchors_[anchor];
    const bool open = std::any_of(open_.begin(), open_.end(), [&](const Open& o) { return o.node == node; });
    if (open) stop(at(mark), "expected an alias to a complete node", "one to a node that contains it", "");
    if (open_.size() + node->height > kDeepest) too_deep(at(mark));
    count(at(mark), node->count);
    place(node);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, const std::string& value) override {
    check_tag(mark, tag);
    last = at(mark);
    last_quoted = tag == "!";
    if (expects_key()) {
      Open& open = open_.back();
      open.has_key = true;
      open.key = value;
      open.key_mark = at(mark);
      open.keep = true;
      if (value == "<<") {
        faults_.add(open.key_mark, path(), "merge keys '<<' are not supported", "", "repeat the keys or use an alias");
        open.keep = false;
      } else if (!open.keys.insert(value).second) {
        const int line = open.node->find(value) != nullptr ? open.node->find(value)->mark.line : open.key_mark.line;
        faults_.add(open.key_mark, path(), "duplicate key", "", "it is already given on line " + std::to_string(line));
        open.keep = false;
      }
      count(open.key_mark, 1);
      if (anchor != 0) {  // an alias to a key is its text
        Node* node = anchors_[anchor] = tree_.make(Node::Kind::Scalar, open.key_mark);
        node->text = value;
      }
      return;
    }
    Node* node = leaf(Node::Kind::Scalar, at(mark), anchor);
    node->text = value;
    node->quoted = tag == "!";
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    begin(Node::Kind::List, mark, tag, anchor);
  }
  void OnSequenceEnd() override { end(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    begin(Node::Kind::Mapping, mark, tag, anchor);
  }
  void OnMapEnd() override { end(); }

  [[noreturn]] void stop(Mark mark, std::string expected, std::string found, std::string hint) {
    faults_.add(mark, "", std::move(expected), std::move(found), std::move(hint));
    throw Stop{};
  }
  [[nodiscard]] Mark at(const YAML::Mark& mark) const {
    return {source_, std::max(mark.line, 0) + 1, std::max(mark.column, 0) + 1};
  }

 private:
  struct Open {
    Node* node = nullptr;
    bool has_key = false;  // a mapping whose key waits for its value
    bool keep = true;      // false: the pair is dropped (a duplicate)
    std::string key;
    Mark key_mark;
    std::set<std::string> keys;
  };

  [[nodiscard]] bool expects_key() const {
    return !open_.empty() && open_.back().node->kind == Node::Kind::Mapping && !open_.back().has_key;
  }
  /// Path of the current key in the scene, for messages.
  [[nodiscard]] std::string path() const {
    std::string text;
    for (const Open& open : open_) {
      if (open.node->kind == Node::Kind::List) {
        text += '[' + std::to_string(open.node->items.size()) + ']';
      } else {
        if (!text.empty()) text += '.';
        text += shown(open.key);
      }
    }
    return text;
  }
  void check_tag(const YAML::Mark& mark, const std::string& tag) {
    if (!tag.empty() && tag != "?" && tag != "!") {
      stop(at(mark), "expected no type tags", '\'' + shown(tag) + '\'', "remove the tag");
    }
  }
  void count(Mark mark, std::uint64_t nodes) {
    count_ += nodes;
    if (count_ > kMostNodes) {
      stop(mark, "expected at most 200000 nodes, every alias counted at each use", "more", kBulkHint);
    }
  }
  [[noreturn]] void too_deep(Mark mark) {
    stop(mark, "expected at most " + std::to_string(kDeepest) + " nested levels", "more", "");
  }
  Node* leaf(Node::Kind kind, Mark mark, YAML::anchor_t anchor) {
    Node* node = tree_.make(kind, mark);
    if (anchor != 0) anchors_[anchor] = node;
    count(mark, 1);
    place(node);
    return node;
  }
  void begin(Node::Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    check_tag(mark, tag);
    last = at(mark);
    last_quoted = false;
    if (expects_key()) stop(at(mark), "expected a key", "a list or a mapping", "keys are plain words");
    if (open_.size() >= kDeepest) too_deep(at(mark));
    count(at(mark), 1);
    Open open;
    open.node = tree_.make(kind, at(mark));
    if (anchor != 0) anchors_[anchor] = open.node;
    open_.push_back(std::move(open));
  }
  void end() {
    Node* node = open_.back().node;
    open_.pop_back();
    place(node);
  }
  /// Passes a complete node to the open one.
  void place(Node* node) {
    if (open_.empty()) {
      root = node;
      return;
    }
    Open& parent = open_.back();
    parent.node->count += node->count;
    parent.node->height = std::max(parent.node->height, node->height + 1);
    if (parent.node->kind == Node::Kind::List) {
      parent.node->items.push_back(node);
      return;
    }
    if (parent.keep) parent.node->entries.push_back({parent.key, parent.key_mark, node});
    parent.has_key = false;
  }

  std::uint32_t source_;
  Tree& tree_;
  FaultList& faults_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, Node*> anchors_;
  std::uint64_t count_ = 0;
  int documents_ = 0;
};

/// `rest` without `word` where it begins with it and the word ends there, or nothing.
bool take(std::string_view& rest, std::string_view word) {
  if (!rest.starts_with(word) || (rest.size() > word.size() && rest[word.size()] != '.' && rest[word.size()] != '[')) return false;
  rest.remove_prefix(word.size());
  return true;
}

/// The node below `list` that `rest` begins with, by index or by its longest fitting name, or null.
const Node* item_of(const Node& list, std::string_view& rest) {
  std::size_t index = 0;
  if (rest.starts_with('[')) {
    const auto [end, error] = std::from_chars(rest.data() + 1, rest.data() + rest.size(), index);
    if (error != std::errc() || index >= list.items.size()) return nullptr;
    rest.remove_prefix(std::min(rest.size(), static_cast<std::size_t>(end - rest.data()) + 1));
    return list.items[index];
  }
  const Node* best = nullptr;
  std::string_view after = rest;
  for (const Node* node : list.items) {
    const Node::Entry* name = node->kind == Node::Kind::Mapping ? node->find("name") : nullptr;
    std::string_view left = rest;
    if (name == nullptr || !take(left, name->value->text) || left.size() >= after.size()) continue;
    best = node;
    after = left;
  }
  rest = after;
  return best;
}

}  // namespace

const Node::Entry* Node::find(std::string_view key) const {
  const auto entry = std::find_if(entries.begin(), entries.end(), [&](const Entry& e) { return e.key == key; });
  return entry == entries.end() ? nullptr : &*entry;
}

std::optional<bool> Node::boolean() const {
  if (kind != Kind::Scalar || quoted) return std::nullopt;
  for (const std::string_view word : {"true", "True", "TRUE"}) {
    if (text == word) return true;
  }
  for (const std::string_view word : {"false", "False", "FALSE"}) {
    if (text == word) return false;
  }
  return std::nullopt;
}

std::string Node::described() const {
  switch (kind) {
    case Kind::Null: return "nothing";
    case Kind::Mapping: return "a mapping";
    case Kind::List: return items.empty() ? "an empty list" : "a list of " + std::to_string(items.size());
    case Kind::Scalar: break;
  }
  return !quoted && looks_like_number(text) ? shown(text) : '\'' + shown(text) + '\'';
}

Node* Tree::make(Node::Kind kind, Mark mark) {
  Node& node = nodes_.emplace_back();
  node.kind = kind;
  node.mark = mark;
  return &node;
}

Node* Tree::copy(const Node& node) { return &nodes_.emplace_back(node); }

Mark mark_of(const Node& node, std::string_view key) {
  const Node* at = &node;
  while (!key.empty()) {
    if (key.front() == '.') key.remove_prefix(1);
    const Node* below = at->kind == Node::Kind::List ? item_of(*at, key) : nullptr;
    for (const Node::Entry& entry : at->entries) {
      if (below == nullptr && take(key, entry.key)) below = entry.value;
    }
    if (below == nullptr) break;
    at = below;
  }
  return at->mark;
}

Node* parse_yaml(const std::string& text, std::uint32_t source, Tree& tree, FaultList& faults) {
  if (!fit_to_parse(text, source, faults)) return nullptr;
  Builder builder(source, tree, faults);
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    while (parser.HandleNextDocument(builder)) {
    }
  } catch (const Stop&) {
    return nullptr;
  } catch (const YAML::Exception& error) {
    add_yaml_fault(error.msg, builder.at(error.mark), {text, builder.last, builder.open()}, faults);
    return nullptr;
  }
  // yaml-cpp ends a text without a closing quote where the file ends.
  const std::size_t begin = byte_of(text, builder.last);
  if (builder.last_quoted && unclosed_quote(text, begin) == begin) {
    add_unclosed_quote(begin, source, text, faults);
    return nullptr;
  }
  return builder.root;
}

}  // namespace supple::scenes
