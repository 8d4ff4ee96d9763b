#include "file/expand/expand_scene.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include "file/fields/fields_info.h"
#include "file/scene_places.h"
#include "file/expand/shipped_includes.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

constexpr std::string_view kOpening = "${";

bool has_expression(const Node& node) { return node.kind == Node::Kind::Scalar && node.text.find(kOpening) != std::string::npos; }

bool is_list_of_mappings(const Node& node) {
  return node.kind == Node::Kind::List &&
         std::all_of(node.items.begin(), node.items.end(), [](const Node* item) { return item->kind == Node::Kind::Mapping; });
}

/// Counts and heights again after children have changed.
void measure(Node& node) {
  node.count = 1;
  node.height = 0;
  const auto add = [&node](const Node& child) {
    node.count += child.count;
    node.height = std::max(node.height, child.height + 1);
  };
  for (const Node* item : node.items) add(*item);
  for (const Node::Entry& entry : node.entries) add(*entry.value);
}

Node* without(Node& mapping, std::span<const std::string_view> keys, Tree& tree) {
  const auto named = [&](const Node::Entry& entry) { return std::find(keys.begin(), keys.end(), entry.key) != keys.end(); };
  if (std::none_of(mapping.entries.begin(), mapping.entries.end(), named)) return &mapping;
  Node* out = tree.copy(mapping);
  std::erase_if(out->entries, named);
  measure(*out);
  return out;
}

/// Merges included files; every file is read once for each `include` that names it.
class Includes {
 public:
  Includes(const FileAccess& files, SourceTexts& texts, Tree& tree, FaultList& faults)
      : files_(files), texts_(texts), tree_(tree), faults_(faults) {}

  /// The scene whose items of lists, too, have the keys of the files that they include.
  Node* merge_all(Node* root, const std::filesystem::path& folder) {
    Node* out = merge(root, folder);
    for (std::size_t i = 0; i < out->entries.size(); ++i) {
      const Node& list = *out->entries[i].value;
      const auto includes = [](const Node* item) { return item->kind == Node::Kind::Mapping && item->find("include") != nullptr; };
      if (list.kind != Node::Kind::List || std::none_of(list.items.begin(), list.items.end(), includes)) continue;
      Node* items = tree_.copy(list);
      for (Node*& item : items->items) {
        if (includes(item)) item = merge(item, folder);
      }
      measure(*items);
      if (out == root) out = tree_.copy(*root);
      out->entries[i].value = items;
    }
    measure(*out);
    return out;
  }

 private:
  static constexpr std::string_view kKey[] = {"include"};

  Node* merge(Node* root, const std::filesystem::path& folder) {
    const Node::Entry* entry = root->find("include");
    if (entry == nullptr) return root;
    std::vector<const Node*> names;
    if (entry->value->kind == Node::Kind::List) {
      names.assign(entry->value->items.begin(), entry->value->items.end());
    } else {
      names.push_back(entry->value);
    }
    Node* out = without(*root, kKey, tree_);
    // The last one wins over those before it, and the file itself over all.
    for (auto name = names.rbegin(); name != names.rend(); ++name) {
      Node* included = read(**name, folder);
      if (included != nullptr) out = merged(*included, *out, tree_);
    }
    return out;
  }

  Node* read(const Node& name, const std::filesystem::path& folder) {
    const auto fail = [&](std::string expected, std::string found, std::string hint) -> Node* {
      faults_.add(name.mark, "include", std::move(expected), std::move(found), std::move(hint));
      return nullptr;
    };
    if (name.kind != Node::Kind::Scalar || name.text.empty()) return fail("expected the name of a file", name.described(), "");
    if (std::string_view(name.text).starts_with(kShippedPrefix)) {
      const std::optional<std::string_view> shipped = shipped_include(name.text);
      if (!shipped) return fail("expected '" + std::string(kShippedMaterials) + "'", '\'' + shown(name.text) + '\'', "");
      const std::uint32_t source = texts_.add(name.text, std::string(*shipped), false);
      return parse_yaml(texts_.text(source), source, tree_, faults_);
    }
    const std::filesystem::path path = folder / name.text;
    std::error_code unknown;
    const std::filesystem::path real = std::filesystem::weakly_canonical(std::filesystem::absolute(path, unknown), unknown);
    if (std::find(open_.begin(), open_.end(), real) != open_.end()) return fail("expected files that do not include one another in a circle", '\'' + shown(name.text) + '\'', "");
    if (++count_ > kMostIncludes) return fail("expected at most " + std::to_string(kMostIncludes) + " included files", "more", "");
    std::optional<std::string> text;
    try {
      expect_readable(files_, path);
      text = read_text(path);
    } catch (const Error& error) {
      const Fault& fault = error.faults().front();
      return fail(fault.expected, '\'' + shown(name.text) + "', " + fault.found, fault.hint);
    }
    if (!text && std::filesystem::exists(real, unknown)) return fail("expected a readable scene file", '\'' + shown(name.text) + "', which cannot be read", "");
    if (!text) return fail("expected a readable scene file", "no file '" + shown(name.text) + '\'', io::hint_of_absent(path));
    const std::uint32_t source = texts_.add(path.string(), std::move(*text), false);
    Node* root = parse_yaml(texts_.text(source), source, tree_, faults_);
    if (root == nullptr) return nullptr;
    if (root->kind != Node::Kind::Mapping) return fail("expected a file with a mapping", root->described(), "");
    open_.push_back(real);
    Node* whole = merge_all(root, path.parent_path());
    open_.pop_back();
    return whole;
  }

  const FileAccess& files_;
  SourceTexts& texts_;
  Tree& tree_;
  FaultList& faults_;
  std::vector<std::filesystem::path> open_;
  std::size_t count_ = 0;
};

}  // namespace

Node* merged(Node& base, Node& over, Tree& tree) {
  if (base.kind == Node::Kind::Mapping && over.kind == Node::Kind::Mapping) {
    Node* out = tree.copy(over);
    for (const Node::Entry& entry : base.entries) {
      const auto same = std::find_if(out->entries.begin(), out->entries.end(), [&](const Node::Entry& e) { return e.key == entry.key; });
      if (same == out->entries.end()) {
        out->entries.push_back(entry);
      } else {
        same->value = merged(*entry.value, *same->value, tree);
      }
    }
    measure(*out);
    return out;
  }
  if (is_list_of_mappings(base) && is_list_of_mappings(over)) {
    Node* out = tree.copy(over);
    out->items.insert(out->items.begin(), base.items.begin(), base.items.end());
    measure(*out);
    return out;
  }
  return &over;
}

Node* with_includes(Node* root, const FileAccess& files, SourceTexts& texts, Tree& tree, FaultList& faults) {
  Node* out = Includes(files, texts, tree, faults).merge_all(root, files.folder);
  if (out->count > kMostNodes) {
    std::string expected = "expected at most ";
    expected.append(std::to_string(kMostNodes)).append(" nodes in all files");
    faults.add(root->mark, "include", std::move(expected), "more", "");
  }
  return out;
}

Expansion::Expansion(const Node& root, Tree& tree, FaultList& faults) : tree_(tree), faults_(faults) {
  const Node::Entry* entry = root.find("variables");
  if (entry == nullptr || entry->value->kind == Node::Kind::Null) return;
  if (entry->value->kind != Node::Kind::Mapping) {
    faults_.add(entry->value->mark, "variables", "expected a mapping of names to values", entry->value->described(), "");
    return;
  }
  for (const Node::Entry& variable : entry->value->entries) {
    const std::string key = "variables." + shown(variable.key);
    if (const auto fault = fault_of_name(variable.key)) fail(variable.mark, key, *fault);
    if (variable.value->kind != Node::Kind::Scalar) {
      fail(variable.value->mark, key, {"expected a number, a quantity or a text", variable.value->described(), ""});
      continue;
    }
    variables_.push_back({variable.key, {.node = variable.value, .mark = variable.mark, .value = {}}});
  }
}

void Expansion::fail(Mark mark, const std::string& key, const ExpressionFault& fault) { faults_.add(mark, key, fault.expected, fault.found, fault.hint); }

std::optional<Value> Expansion::find(std::string_view name) {
  const auto index = std::find_if(indices_.rbegin(), indices_.rend(), [&](const Index& i) { return i.name == name; });
  if (index != indices_.rend()) return Value{.number = index->value, .dimension = {}, .text = {}};
  const auto found = std::find_if(variables_.begin(), variables_.end(), [&](const auto& v) { return v.first == name; });
  if (found == variables_.end()) return std::nullopt;
  Variable& variable = found->second;
  if (variable.open) throw ExpressionFault{"expected variables that do not depend on themselves", '\'' + shown(name) + '\'', ""};
  if (!variable.known) {
    variable.open = true;
    std::vector<Index> outside;
    std::swap(outside, indices_);  // variables are the same everywhere
    const auto restore = [&] {
      variable.open = false;
      std::swap(outside, indices_);
    };
    try {
      variable.value = value_of(*variable.node);
    } catch (...) {
      restore();
      throw;
    }
    restore();
    variable.known = true;
  }
  return variable.value;
}

/// A scalar whose expressions have become values: one expression alone keeps its unit, others become text. @throws ExpressionFault
Value Expansion::value_of(const Node& scalar) {
  const FindVariable variables = [this](std::string_view name) { return find(name); };
  std::vector<std::string_view> names;
  for (const auto& variable : variables_) names.push_back(variable.first);
  for (const Index& index : indices_) names.push_back(index.name);
  const std::string_view text = scalar.text;
  if (text.find(kOpening) == std::string_view::npos) {
    const std::optional<KnownUnit> quantity = read_any_quantity(text);
    const bool number_in_quotes = scalar.quoted && looks_like_number(text);
    if (quantity && !number_in_quotes) return {.number = quantity->factor, .dimension = quantity->dimension, .text = {}};
    return {.number = 0.0, .dimension = {}, .is_text = true, .quoted = scalar.quoted, .text = scalar.text};
  }
  Value out{.number = 0.0, .dimension = {}, .is_text = true, .quoted = scalar.quoted, .text = {}};
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t begin = std::min(text.find(kOpening, at), text.size());
    const bool literal = begin > at && text[begin - 1] == '$' && begin < text.size();  // "$${" stands for "${"
    out.text += text.substr(at, begin - at - (literal ? 1 : 0));
    if (begin == text.size()) break;
    if (literal) {
      out.text += kOpening;
      at = begin + kOpening.size();
      continue;
    }
    const std::size_t end = text.find('}', begin);
    if (end == std::string_view::npos) throw ExpressionFault{"expected '}' at the end of an expression", '\'' + shown(text.substr(begin)) + '\'', ""};
    const Value value = evaluate_expression(text.substr(begin + kOpening.size(), end - begin - kOpening.size()), variables, names);
    if (begin == 0 && end + 1 == text.size()) return value;
    out.text += value.spelt();
    at = end + 1;
  }
  return out;
}

Node* Expansion::expand(Node& node, const std::string& key) {
  switch (node.kind) {
    case Node::Kind::Null: return &node;
    case Node::Kind::List: return expand_list(node, key);
    case Node::Kind::Mapping: return expand_mapping(node, key);
    case Node::Kind::Scalar: break;
  }
  if (!has_expression(node)) return &node;
  try {
    const Value value = value_of(node);
    Node* out = tree_.copy(node);
    out->text = value.spelt();
    out->quoted = value.is_text && value.quoted;
    return out;
  } catch (const ExpressionFault& fault) {
    fail(node.mark, key, fault);
    return &node;
  }
}

Node* Expansion::expand_list(Node& list, const std::string& key) {
  std::vector<Node*> items;
  for (std::size_t i = 0; i < list.items.size(); ++i) expand_item(*list.items[i], key + '[' + std::to_string(i) + ']', items);
  if (items == list.items) return &list;
  Node* out = tree_.copy(list);
  out->items = std::move(items);
  measure(*out);
  return out;
}

Node* Expansion::expand_mapping(Node& mapping, const std::string& key) {
  Node* out = &mapping;
  for (std::size_t i = 0; i < mapping.entries.size(); ++i) {
    const Node::Entry& entry = mapping.entries[i];
    Node* value = expand(*entry.value, key.empty() ? shown(entry.key) : key + '.' + shown(entry.key));
    if (value == entry.value) continue;
    if (out == &mapping) out = tree_.copy(mapping);
    out->entries[i].value = value;
  }
  if (out != &mapping) measure(*out);
  return out;
}

/// An item of a list, as often as its `repeat` asks for.
void Expansion::expand_item(Node& item, const std::string& key, std::vector<Node*>& out) {
  const Node::Entry* entry = item.kind == Node::Kind::Mapping ? item.find("repeat") : nullptr;
  if (entry == nullptr) {
    stand(item, key, out);
    return;
  }
  constexpr std::string_view kKey[] = {"repeat"};
  repeat(*without(item, kKey, tree_), counts_of(*entry->value, key + ".repeat"), key, out);
}

/// `repeat: {i: 3, j: 4}`: indices and how often; `repeat: 3` has the index i.
std::vector<std::pair<Expansion::Index, std::size_t>> Expansion::counts_of(const Node& repeat, const std::string& key) {
  std::vector<std::pair<Index, std::size_t>> counts;
  const auto add = [&](const std::string& name, Mark mark, const Node& node) {
    try {
      const Value value = node.kind == Node::Kind::Scalar ? value_of(node) : Value{.dimension = {}, .is_text = true, .text = {}};
      const bool whole = !value.is_text && value.dimension == Dimension{} && value.number == std::floor(value.number) && value.number >= 0.0 &&
                         value.number <= static_cast<double>(kMostNodes);
      if (!whole) {
        throw ExpressionFault{"expected a whole number from 0 to " + std::to_string(kMostNodes), node.kind == Node::Kind::Scalar ? value.spelt() : node.described(),
                              value.is_text ? "a mapping gives each index its count, as 'repeat: {i: 3, j: 4}'" : ""};
      }
      const auto same = [&](const auto& other) { return other.first == name; };
      if (const auto fault = fault_of_name(name)) throw *fault;
      if (std::any_of(variables_.begin(), variables_.end(), same)) throw ExpressionFault{"expected an index that is no variable", '\'' + shown(name) + '\'', ""};
      counts.push_back({{name, 0.0}, static_cast<std::size_t>(value.number)});
    } catch (const ExpressionFault& fault) {
      fail(mark, &node == &repeat ? key : key + '.' + shown(name), fault);
      counts.push_back({{name, 0.0}, 1});  // what uses the index has no fault of its own
    }
  };
  if (repeat.kind == Node::Kind::Mapping) {
    for (const Node::Entry& entry : repeat.entries) add(entry.key, entry.value->mark, *entry.value);
  } else {
    add("i", repeat.mark, repeat);
  }
  return counts;
}

void Expansion::repeat(Node& item, std::span<const std::pair<Index, std::size_t>> counts, const std::string& key, std::vector<Node*>& out) {
  if (counts.empty()) {
    count(item, key);
    if (nodes_ <= kMostNodes) stand(item, key, out);
    return;
  }
  indices_.push_back(counts.front().first);
  for (std::size_t i = 0; i < counts.front().second && nodes_ <= kMostNodes; ++i) {
    indices_.back().value = static_cast<double>(i);
    repeat(item, counts.subspan(1), key, out);
  }
  indices_.pop_back();
}

/// An item of a list, and of `objects` one for each time at which its `emit` has one appear.
void Expansion::stand(Node& item, const std::string& key, std::vector<Node*>& out) {
  const bool object = key.starts_with("objects[") && item.kind == Node::Kind::Mapping;
  const Node::Entry* entry = object ? item.find("emit") : nullptr;
  if (entry == nullptr || entry->value->kind == Node::Kind::Null || entry->value->boolean() == false) {
    out.push_back(expand(item, key));
    return;
  }
  emit(item, *entry, key, out);
}

/// A number of a mapping in SI units, of the dimension of `like`; none where it has a fault.
std::optional<double> Expansion::number_of(const Node& mapping, std::string_view name, std::string_view like, double otherwise, const std::string& key) {
  const Node::Entry* entry = mapping.find(name);
  if (entry == nullptr) return otherwise;
  try {
    const Value value = entry->value->kind == Node::Kind::Scalar ? value_of(*entry->value) : Value{.dimension = {}, .is_text = true, .text = {}};
    const bool right = !value.is_text && (value.dimension == Dimension{} || value.dimension == read_any_quantity(like)->dimension);
    if (right && value.number >= 0.0 && std::isfinite(value.number)) return value.number;
    throw ExpressionFault{"expected a number like " + std::string(like), entry->value->kind == Node::Kind::Scalar ? value.spelt() : entry->value->described(), ""};
  } catch (const ExpressionFault& fault) {
    fail(entry->value->mark, key + '.' + std::string(name), fault);
  }
  return std::nullopt;
}

/// `emit: {rate: 4 Hz, count: 20, from: 1 s}`: objects NAME.1, NAME.2 ... with `appears`, and the index i.
void Expansion::emit(Node& item, const Node::Entry& entry, const std::string& key, std::vector<Node*>& out) {
  const std::string place = key + ".emit";
  const Node& settings = *entry.value;
  if (settings.kind != Node::Kind::Mapping) {
    fail(settings.mark, place, {"expected a mapping with rate and count", settings.described(), "emit: {rate: 4 Hz, count: 20}"});
    return;
  }
  constexpr std::string_view kKeys[] = {"rate", "count", "from"};
  for (const Node::Entry& given : settings.entries) {
    if (std::find(std::begin(kKeys), std::end(kKeys), given.key) != std::end(kKeys)) continue;
    return fail(given.mark, place, {"expected one of rate, count, from", '\'' + shown(given.key) + '\'', known_hint(given.key, kKeys)});
  }
  const std::optional<double> given_rate = number_of(settings, "rate", "4 Hz", 0.0, place), given_from = number_of(settings, "from", "1 s", 0.0, place);
  const std::optional<double> given_number = number_of(settings, "count", "20", 0.0, place);
  if (!given_rate || !given_from || !given_number) return;
  const double rate = *given_rate, from = *given_from, number = *given_number;
  if (!(rate > 0.0)) return fail(settings.mark, place + ".rate", {"expected a rate above 0", "none", ""});
  if (!(number >= 1.0) || number != std::floor(number) || number > static_cast<double>(kMostNodes))
    return fail(settings.mark, place + ".count", {"expected a whole number from 1 to " + std::to_string(kMostNodes), "another", ""});
  constexpr std::string_view kOwn[] = {"emit"};
  Node& plain = *without(item, kOwn, tree_);
  indices_.push_back({"i", 0.0});
  for (std::size_t i = 0; i < static_cast<std::size_t>(number) && nodes_ <= kMostNodes; ++i) {
    indices_.back().value = static_cast<double>(i);
    count(plain, key);
    Node* copy = tree_.copy(*expand(plain, key));
    for (Node::Entry& named : copy->entries) {
      if (named.key != "name" || named.value->kind != Node::Kind::Scalar) continue;
      named.value = tree_.copy(*named.value);
      named.value->text += '.' + std::to_string(i + 1);
    }
    Node* time = tree_.make(Node::Kind::Scalar, settings.mark);
    time->text = number_text(from + static_cast<double>(i) / rate);
    std::erase_if(copy->entries, [](const Node::Entry& other) { return other.key == "appears"; });
    copy->entries.push_back({"appears", entry.mark, time});
    measure(*copy);
    out.push_back(copy);
  }
  indices_.pop_back();
}

void Expansion::count(const Node& node, const std::string& key) {
  const bool before = nodes_ > kMostNodes;
  nodes_ += node.count;
  if (!before && nodes_ > kMostNodes) {
    fail(node.mark, key, {"expected at most " + std::to_string(kMostNodes) + " nodes, every repetition counted", "more", "keep bulk particles in a CSV file and name it under particles.file"});
  }
}

Node* Expansion::expand_scene(Node& root) {
  for (auto& [name, variable] : variables_) {
    try {
      (void)find(name);
    } catch (const ExpressionFault& fault) {
      fail(variable.node->mark, "variables." + shown(name), fault);
    }
  }
  constexpr std::string_view kKeys[] = {"variables", "defaults", "materials"};
  Node* out = without(root, kKeys, tree_);
  const Node::Entry* defaults = root.find("defaults");
  if (defaults != nullptr && defaults->value->kind != Node::Kind::Null) {
    if (defaults->value->kind != Node::Kind::Mapping) {
      fail(defaults->value->mark, "defaults", {"expected a mapping of lists of the scene to keys of their items", defaults->value->described(), ""});
      return out;
    }
    std::vector<std::string_view> lists;
    for (const FieldInfo& info : scene_fields()) {
      if (info.type == FieldType::Mappings) lists.push_back(info.key);
    }
    for (const Node::Entry& entry : defaults->value->entries) {
      if (std::find(lists.begin(), lists.end(), entry.key) == lists.end()) {
        fail(entry.mark, "defaults." + shown(entry.key), {"expected one of the lists of a scene", '\'' + shown(entry.key) + '\'', known_hint(entry.key, lists)});
        continue;
      }
      const auto list = std::find_if(out->entries.begin(), out->entries.end(), [&](const Node::Entry& e) { return e.key == entry.key; });
      if (list == out->entries.end() || list->value->kind != Node::Kind::List) continue;
      Node* items = tree_.copy(*list->value);
      for (Node*& item : items->items) {
        if (item->kind == Node::Kind::Mapping) item = merged(*entry.value, *item, tree_);
      }
      measure(*items);
      list->value = items;
    }
    measure(*out);
    nodes_ += out->count;
  }
  return expand_mapping(*with_materials(root, *out), "");
}

/// The tree whose objects have the mappings of `materials` in place of their names.
Node* Expansion::with_materials(const Node& root, Node& scene) {
  const Node::Entry* materials = root.find("materials");
  std::vector<std::string_view> names;
  if (materials != nullptr && materials->value->kind == Node::Kind::Mapping) {
    for (const Node::Entry& entry : materials->value->entries) names.push_back(entry.key);
  } else if (materials != nullptr && materials->value->kind != Node::Kind::Null) {
    fail(materials->value->mark, "materials", {"expected a mapping of names to materials", materials->value->described(), ""});
    return &scene;
  }
  const Node::Entry* objects = scene.find("objects");
  if (objects == nullptr || objects->value->kind != Node::Kind::List) return &scene;
  Node* list = tree_.copy(*objects->value);
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const Node::Entry* material = list->items[i]->kind == Node::Kind::Mapping ? list->items[i]->find("material") : nullptr;
    if (material == nullptr || material->value->kind != Node::Kind::Scalar || material->value->boolean() == false) continue;
    const Node::Entry* known = names.empty() ? nullptr : materials->value->find(material->value->text);
    if (known == nullptr) {
      fail(material->value->mark, "objects[" + std::to_string(i) + "].material",
           {"expected a mapping, or the name of one of 'materials'", '\'' + shown(material->value->text) + '\'',
            names.empty() ? "add 'include: " + std::string(kShippedMaterials) + "' for jelly, rubber, foam, clay and steel" : known_hint(material->value->text, names)});
      continue;
    }
    Node* item = tree_.copy(*list->items[i]);
    for (Node::Entry& entry : item->entries) {
      if (entry.key == "material") entry.value = known->value;
    }
    measure(*item);
    list->items[i] = item;
  }
  measure(*list);
  Node* out = tree_.copy(scene);
  for (Node::Entry& entry : out->entries) {
    if (entry.key == "objects") entry.value = list;
  }
  measure(*out);
  return out;
}

}  // namespace supple::scenes
