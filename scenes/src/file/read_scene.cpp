#include "supple/scenes/read_scene.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "file/expand/expand_scene.h"
#include "file/read_scene_archive.h"
#include "file/expand/scale_object.h"
#include "file/fields/scene_keys.h"
#include "file/scene_places.h"
#include "file/expand/short_keys.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/accuracy.h"

namespace supple::scenes {
namespace {

/// Follows one "path=value" down the tree; nodes on the path are copied, because aliases may share them.
class Override {
 public:
  Override(Tree& tree, FaultList& faults, std::uint32_t source, std::string_view path)
      : tree_(tree), faults_(faults), mark_{source, 1, 1}, path_(path), rest_(path) {}

  void apply(Node*& root, Node* value) {
    Node** slot = &root;
    while (!rest_.empty()) {
      if (rest_[0] == '.' && rest_.size() < path_.size()) rest_.remove_prefix(1);
      const std::string done(path_.substr(0, path_.size() - rest_.size()));
      Node* node = *slot;
      if (node->boolean() == true) {
        node = tree_.make(Node::Kind::Mapping, mark_);  // `images: true` is `images: {}`
      } else {
        node = tree_.copy(*node);
      }
      *slot = node;
      const bool mapping = node->kind == Node::Kind::Mapping;
      slot = node->kind == Node::Kind::List ? item(*node, done) : mapping ? key(*node, done) : nullptr;
      if (slot == nullptr) {
        if (node->kind == Node::Kind::Scalar) fail(done, "expected a mapping or a list", node->described());
        return;
      }
    }
    *slot = value;
  }

 private:
  void fail(std::string key, std::string expected, std::string found) {
    if (!key.empty() && key.back() == '.') key.pop_back();
    faults_.add(mark_, shown(key), std::move(expected), std::move(found), "");
  }

  Node** key(Node& mapping, const std::string& done) {
    const std::size_t length = std::min(rest_.find_first_of(".["), rest_.size());
    const std::string_view word = rest_.substr(0, length);
    if (word.empty()) {
      fail(done, "expected a key", '\'' + shown(rest_) + '\'');
      return nullptr;
    }
    rest_.remove_prefix(length);
    for (Node::Entry& entry : mapping.entries) {
      if (entry.key == word) return &entry.value;
    }
    mapping.entries.push_back({std::string(word), mark_, tree_.make(Node::Kind::Mapping, mark_)});
    return &mapping.entries.back().value;
  }

  Node** item(Node& list, const std::string& done) {
    std::string_view word = rest_;
    if (word[0] == '[') word.remove_prefix(1);
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), index);
    if (error == std::errc()) {
      std::string_view after = word.substr(static_cast<std::size_t>(end - word.data()));
      if (after.starts_with(']')) after.remove_prefix(1);
      if (index < list.items.size() && (after.empty() || after[0] == '.' || after[0] == '[')) {
        rest_ = after;
        return &list.items[index];
      }
    }
    // Names may hold dots, so the longest one that fits is meant.
    Node** best = nullptr;
    std::string_view name;
    std::string known;
    for (Node*& node : list.items) {
      const Node::Entry* entry = node->kind == Node::Kind::Mapping ? node->find("name") : nullptr;
      if (entry == nullptr) continue;
      const std::string_view text = entry->value->text;
      known += (known.empty() ? "" : ", ") + shown(text);
      const bool fits = rest_.starts_with(text) && (rest_.size() == text.size() || rest_[text.size()] == '.');
      if (fits && text.size() > name.size()) {
        best = &node;
        name = text;
      }
    }
    if (best == nullptr) {
      const std::string range = list.items.empty() ? "none: the list is empty"
                                                   : "an index from 0 to " + std::to_string(list.items.size() - 1);
      fail(done, known.empty() ? "expected " + range : "expected " + range + " or one of the names " + known,
           '\'' + shown(rest_.substr(0, rest_.find('.'))) + '\'');
      return nullptr;
    }
    rest_.remove_prefix(name.size());
    return best;
  }

  Tree& tree_;
  FaultList& faults_;
  Mark mark_;
  std::string_view path_;
  std::string_view rest_;
};

/// One `--set path=value`.
struct Setting {
  std::uint32_t source;
  std::string_view path;
  Node* value;
};

/// The tree with variables as the settings have them, expanded, and then with the other settings.
Node* expand(Node* root, std::span<const Setting> settings, Tree& tree, FaultList& faults) {
  constexpr std::string_view kVariables = "variables.";
  for (const Setting& setting : settings) {
    if (!setting.path.starts_with(kVariables)) continue;
    const Node::Entry* variables = root->find("variables");
    const std::string_view name = setting.path.substr(kVariables.size());
    if (variables == nullptr || variables->value->find(name) == nullptr) {
      std::vector<std::string_view> names;
      if (variables != nullptr) {
        for (const Node::Entry& entry : variables->value->entries) names.push_back(entry.key);
      }
      faults.add({setting.source, 1, 1}, shown(setting.path), names.empty() ? "expected a scene with variables" : "expected a variable of the scene",
                 names.empty() ? "one without" : '\'' + shown(name) + '\'', names.empty() ? "" : known_hint(name, names));
      continue;
    }
    Override(tree, faults, setting.source, setting.path).apply(root, setting.value);
  }
  const std::size_t before = faults.count();
  tell_misspelt_short_keys(*root, faults);
  if (faults.count() > before) faults.raise();
  Expansion expansion(*root, tree, faults);
  root = expansion.expand_scene(*root);
  std::vector<Node*> values;
  for (const Setting& setting : settings) values.push_back(expansion.expand(*setting.value, shown(setting.path)));
  if (faults.count() > before) faults.raise();  // expressions without a value would be faults of their keys, too
  for (std::size_t k = 0; k < settings.size(); ++k) {
    if (!settings[k].path.starts_with(kVariables)) Override(tree, faults, settings[k].source, settings[k].path).apply(root, values[k]);
  }
  return root;
}

/// What `accuracy` sets, before the keys that override it are read. One that is faulty sets nothing; reading it says so.
void read_accuracy(const Node& root, Scene& scene) {
  const Node::Entry* entry = root.find("accuracy");
  if (entry == nullptr || entry->value->kind != Node::Kind::Scalar) return;
  const QuantityText accuracy = read_quantity(entry->value->text, kNumber);
  if (accuracy.ok && accuracy.value > 0.0) set_by_accuracy(accuracy.value, scene);
}

/// Objects with a material touch others, unless `contact` says something else. @pre the objects are in the order of the file
void touch_by_material(const Node& root, Scene& scene) {
  const std::vector<Node*>& items = root.find("objects")->value->items;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    if (scene.objects[i].material && items[i]->find("contact") == nullptr) scene.objects[i].contact.emplace();
  }
}

}  // namespace

int Scene::frame_count() const { return 1 + static_cast<int>(std::floor(duration * frame_rate + 1e-9)); }

Scene parse_scene(const std::string& text, const std::string& name, const std::filesystem::path& folder,
                  std::span<const std::string> overrides, std::span<const std::filesystem::path> allowed) {
  const auto places = std::make_shared<ScenePlaces>();
  places->files = {folder, {allowed.begin(), allowed.end()}};
  SourceTexts& texts = places->texts;
  Tree& tree = places->tree;
  FaultList faults(texts);
  const std::uint32_t source = texts.add(name, text, false);
  Node* root = parse_yaml(texts.text(source), source, tree, faults);
  if (root == nullptr) {
    if (faults.count() == 0) faults.add({source, 1, 1}, "", "expected a scene", "an empty file", "begin with 'schema: 1'");
    faults.raise();
  }
  const bool mapping = root->kind == Node::Kind::Mapping;
  if (mapping) {
    const std::size_t before = faults.count();
    root = with_includes(root, places->files, texts, tree, faults);
    if (faults.count() > before) faults.raise();  // keys of files that are not there would be missed, too
  }
  std::vector<Setting> settings;
  for (const std::string& text_set : overrides) {
    const std::size_t equals = std::min(text_set.find('='), text_set.size());
    const std::uint32_t set =
        texts.add("--set " + shown(text_set), equals < text_set.size() ? text_set.substr(equals + 1) : "", true);
    const std::string_view path = std::string_view(text_set).substr(0, equals);
    if (equals == text_set.size() || path.empty() || path.front() == '.' || path.back() == '.' ||
        path.find("..") != std::string_view::npos) {
      faults.add({set, 1, 1}, "", "expected path.to.key=value", '\'' + shown(text_set) + '\'', "");
      continue;
    }
    Node* value = parse_yaml(texts.text(set), set, tree, faults);
    if (value == nullptr) value = tree.make(Node::Kind::Null, {set, 1, 1});
    settings.push_back({set, path, value});
  }
  if (mapping) root = expand(root, settings, tree, faults);
  Scene scene;
  if (!mapping) {
    faults.add(root->mark, "", "expected a scene", root->described(), "a scene is a mapping that begins with 'schema: 1'");
  } else {
    read_accuracy(*root, scene);
    ReadArchive archive(faults, *root, "", places->files);
    scene_members(archive, scene);
    archive.finish();
  }
  faults.raise();
  touch_by_material(*root, scene);
  for (ObjectDesc& object : scene.objects) scale_lengths(object);
  // Ids follow names, so the order of the file changes no bit.
  const auto by_name = [](const auto& a, const auto& b) { return a.name < b.name; };
  std::sort(scene.objects.begin(), scene.objects.end(), by_name);
  std::sort(scene.obstacles.begin(), scene.obstacles.end(), by_name);
  scene.source = folder / name;
  places->root = root;
  places->source = {text, name, folder, {overrides.begin(), overrides.end()}, {allowed.begin(), allowed.end()}};
  scene.places = places;
  FileHashes hashes(places->files);
  const SceneKeys motion = motion_keys(scene, hashes);
  scene.motion_keys = std::make_shared<const std::string>(text_of(motion));
  scene.content_hash = hash_of(motion);
  scene.picture_hash = hash_of(picture_keys(scene, hashes));
  return scene;
}

const SceneSource* source_of(const Scene& scene) { return scene.places ? &scene.places->source : nullptr; }

Scene read_scene(const std::filesystem::path& path, std::span<const std::string> overrides, std::span<const std::filesystem::path> allowed) {
  std::error_code status;
  const auto fail = [&](std::string found, std::string hint = {}) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                     .key = "",
                                     .expected = "expected a readable scene file",
                                     .found = std::move(found),
                                     .hint = std::move(hint)});
  };
  if (std::filesystem::is_directory(path, status)) fail("a folder");
  const std::string name = path.filename().string();  // outputs have this name, also in files that cannot hold any name
  if (std::any_of(name.begin(), name.end(), [](char c) { return (c >= 0 && c < 0x20) || c == 0x7F; })) fail("a name with control characters");
  if (name.starts_with('.')) fail("a name that begins with a dot");  // "...yaml" would be the scene "..", whose folder is not its own
  const std::optional<std::string> text = read_text(path);
  if (!text && std::filesystem::exists(path, status)) fail("a file that cannot be read");
  if (!text) fail("no file of this name", io::hint_of_absent(path));
  Scene scene = parse_scene(*text, path.string(), path.parent_path(), overrides, allowed);
  scene.source = path;
  return scene;
}

}  // namespace supple::scenes
