#include "file/fields/scene_keys.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <type_traits>
#include <utility>

#include "file/fields/fields_archive.h"
#include "file/read_scene_faults.h"
#include "output/pictures/camera.h"
#include "supple/core/hash.h"

namespace supple::scenes {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::size_t kMostShown = 6;  // keys in a message

/// Keys that change pictures and files but not the motion, on every level.
constexpr std::array<std::string_view, 21> kLooks = {
    "schema", "title", "duration", "camera", "cameras", "light", "lights", "background", "render", "output", "colour", "roughness",
    "look", "visible", "texture", "smooth_deg", "meshing", "bulge", "bulge_volume", "bulge_width", "bulge_literal"};
constexpr std::string_view kDrawnExtent = "extent";  // of a plane, which has no end

/// Keys at the top that change no picture, and those of the output that do.
constexpr std::array<std::string_view, 3> kUnseen = {"schema", "title", "duration"};
constexpr std::array<std::string_view, 3> kSeenOutput = {"images", "meshing", "cell"};

template <std::size_t N>
bool among(const std::array<std::string_view, N>& keys, std::string_view key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

/// Which keys are taken, by the mapping they are in ("" for the scene) and their name.
using Taken = bool (*)(std::string_view mapping, std::string_view key);

bool moves(std::string_view mapping, std::string_view key) {
  return !among(kLooks, key) && !(mapping.starts_with("obstacles.") && key == kDrawnExtent);
}

bool shows(std::string_view mapping, std::string_view key) {
  if (mapping.empty()) return !among(kUnseen, key);
  if (mapping == "output") return among(kSeenOutput, key);
  return !(mapping == "output.images" && key == "formats");  // each has a hash of its own
}

/// Shortest text that reads back as the same angle [rad].
std::string degrees_text(double angle) {
  const double degrees = angle / kDegree;
  for (int digits = 1; digits < std::numeric_limits<double>::max_digits10; ++digits) {
    std::array<char, 40> text{};
    const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), degrees, std::chars_format::general, digits);
    double read = 0.0;
    std::from_chars(text.data(), end, read);
    if (read * kDegree == angle) return {text.data(), end};
  }
  return number_text(degrees);
}

std::string value_text(double value, const Rule& rule) { return rule.degrees ? degrees_text(value) : number_text(value); }
std::string value_text(int value, const Rule& /*rule*/) { return std::to_string(value); }
std::string value_text(bool value, const Rule& /*rule*/) { return value ? "true" : "false"; }
std::string value_text(const std::string& value, const Rule& /*rule*/) { return shown(value); }
std::string value_text(const Vec3& value, const Rule& rule) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(rule.most_items, 3); ++i) {
    text += (i == 0 ? "" : ", ") + value_text(value[static_cast<Eigen::Index>(i)], rule);
  }
  return '[' + text + ']';
}
template <class T>
std::string value_text(const std::vector<T>& values, const Rule& rule) {
  Rule each = rule;
  each.most_items = std::numeric_limits<std::size_t>::max();  // of a vector in the list
  std::string text;
  for (const T& value : values) text += (text.empty() ? "" : ", ") + value_text(value, each);
  return '[' + text + ']';
}
template <class T>
std::string value_text(const std::optional<T>& value, const Rule& rule) {
  return value ? value_text(*value, rule) : rule.automatic ? "auto" : std::string(kNone);
}

template <class T>
std::string one_text(const Member& member, const Rule& rule) {
  return member.type->optional ? value_text(member.as<std::optional<T>>(), rule) : value_text(member.as<T>(), rule);
}

/// The value of a member that is no mapping, as in a file.
std::string member_text(const Member& member, const Rule& rule) {
  const MemberType& type = *member.type;
  switch (type.type) {
    case FieldType::Number: return one_text<double>(member, rule);
    case FieldType::Whole: return one_text<int>(member, rule);
    case FieldType::Boolean: return one_text<bool>(member, rule);
    case FieldType::Vector: return one_text<Vec3>(member, rule);
    case FieldType::Text: return value_text(member.as<std::string>(), rule);
    case FieldType::Vectors: return value_text(member.as<std::vector<Vec3>>(), rule);
    case FieldType::Numbers: return value_text(member.as<std::vector<double>>(), rule);
    case FieldType::Wholes: return value_text(member.as<std::vector<int>>(), rule);
    case FieldType::Texts: return value_text(member.as<std::vector<std::string>>(), rule);
    case FieldType::Choice: return std::string(type.choices[type.chosen(member.at)]);
    case FieldType::Choices: {
      std::vector<std::string_view> words;
      for (const std::size_t index : type.all_chosen(member.at)) words.push_back(type.choices[index]);
      return '[' + joined(words) + ']';
    }
    case FieldType::Mapping:
    case FieldType::Mappings: break;
  }
  return "";
}

/// Values of keys that are no mappings, with which a mapping begins.
class DefaultArchive final : public FieldArchive {
 public:
  std::vector<std::pair<std::string_view, std::string>> texts;

 private:
  void field(const Member& member, const Label& label, const Rule& rule) override {
    if (member.type->fields == nullptr && rule.when.applies()) texts.emplace_back(label.key, member_text(member, rule));
  }
};

/// The text of the key `name` of a mapping; empty where it has none.
class NameArchive final : public FieldArchive {
 public:
  std::string name;

 private:
  void field(const Member& member, const Label& label, const Rule& /*rule*/) override {
    if (label.key == "name" && member.type->type == FieldType::Text) name = member.as<std::string>();
  }
};

/// Common data of the listing of all mappings.
struct Listing {
  Taken taken;
  FileHashes& hashes;  ///< of files
  SceneKeys keys{};
  std::map<void (*)(FieldArchive&, void*), DefaultArchive> defaults{};  ///< of each type of mapping, by its members
};

const DefaultArchive& defaults_of(const MemberType& type, Listing& listing) {
  const auto [at, fresh] = listing.defaults.try_emplace(type.fields);
  if (fresh) type.fields(at->second, type.make().get());
  return at->second;
}

/// The archive that lists values other than the defaults; one per mapping.
class KeyArchive final : public FieldArchive {
 public:
  /// @param mapping  its path, "" for the scene
  KeyArchive(Listing& listing, std::string mapping, const DefaultArchive& defaults)
      : listing_(listing), mapping_(std::move(mapping)), defaults_(defaults) {}

 private:
  void field(const Member& member, const Label& label, const Rule& rule) override {
    if (!rule.when.applies() || !listing_.taken(mapping_, label.key)) return;
    if (member.type->fields != nullptr) {
      list_mappings(member, label.key);
    } else {
      list(member, label.key, rule);
    }
  }

  [[nodiscard]] std::string path_of(std::string_view key) const {
    return mapping_.empty() ? std::string(key) : mapping_ + '.' + std::string(key);
  }
  void add(std::string path, std::string value, std::string_view fallback) {
    listing_.keys.push_back({std::move(path), std::move(value), std::string(fallback)});
  }

  void list(const Member& member, std::string_view key, const Rule& rule) {
    if (key == "file" && member.type->type == FieldType::Text) {
      const std::string& name = member.as<std::string>();
      if (!name.empty()) add(path_of(key), listing_.hashes.of(name), kNone);
      return;
    }
    const auto usual = std::find_if(defaults_.texts.begin(), defaults_.texts.end(), [&](const auto& text) { return text.first == key; });
    const std::string_view fallback = usual == defaults_.texts.end() ? kNone : std::string_view(usual->second);
    std::string text = member_text(member, rule);
    if (text != fallback) add(path_of(key), std::move(text), fallback);
  }

  void list_mappings(const Member& member, std::string_view key) {
    const MemberType& type = *member.type;
    const std::vector<void*> all = type.all(member.at);
    for (std::size_t i = 0; i < all.size(); ++i) {
      std::string path = path_of(key);
      if (type.type == FieldType::Mappings) {
        // The order of pairs has no effect.
        path += mapping_.empty() && key == "pairs" ? pair_name(member.as<std::vector<PairDesc>>()[i]) : item_name(type, all[i], i);
        add(path, std::string(kGiven), kNone);
      } else if (type.optional) {
        add(path, std::string(kGiven), "false");
      }
      KeyArchive inner(listing_, std::move(path), defaults_of(type, listing_));
      type.fields(inner, all[i]);
    }
  }
  static std::string item_name(const MemberType& type, void* one, std::size_t index) {
    NameArchive names;
    type.fields(names, one);
    return names.name.empty() ? '[' + std::to_string(index) + ']' : '.' + names.name;
  }
  static std::string pair_name(const PairDesc& pair) { return '(' + joined(std::vector<std::string_view>(pair.objects.begin(), pair.objects.end())) + ')'; }

  Listing& listing_;
  std::string mapping_;
  const DefaultArchive& defaults_;
};

/// Objects and obstacles that may touch, by the rules of a scene.
class Touching {
 public:
  explicit Touching(const Scene& scene) : scene_(scene) {
    for (const PairDesc& pair : scene.pairs) {
      if (pair.objects.size() == 2 && pair.collide && !*pair.collide) never_.insert(ordered(pair.objects[0], pair.objects[1]));
    }
    for (const ObjectDesc& object : scene.objects) {
      if (object.contact) with_contact_.insert(object.name);
    }
  }

  [[nodiscard]] bool has_contact(const std::string& object) const { return with_contact_.contains(object); }
  /// Whether some object may touch this solid.
  [[nodiscard]] bool meets(const std::string& solid) const {
    return std::any_of(with_contact_.begin(), with_contact_.end(), [&](const std::string& object) { return may_touch(object, solid); });
  }
  /// Whether objects may touch each other, or parts of one.
  [[nodiscard]] bool among_objects() const {
    for (const ObjectDesc& object : scene_.objects) {
      if (object.contact && (object.separate || object.breaking || !object.cuts.empty() || object.blend)) return true;
    }
    for (auto a = with_contact_.begin(); a != with_contact_.end(); ++a) {
      if (std::any_of(std::next(a), with_contact_.end(), [&](const std::string& b) { return may_touch(*a, b); })) return true;
    }
    return false;
  }

 private:
  static std::pair<std::string, std::string> ordered(const std::string& a, const std::string& b) { return std::minmax(a, b); }
  [[nodiscard]] bool may_touch(const std::string& a, const std::string& b) const { return !never_.contains(ordered(a, b)); }

  const Scene& scene_;
  std::set<std::pair<std::string, std::string>> never_;
  std::set<std::string> with_contact_;
};

/// Leaves out solids that nothing may touch. A moving one bounds the time step, one of primitives the spacing of samples,
/// and one before others is part of their numbers in a state: these stay. @return whether a solid is left that something may touch
bool leave_out_solids(const Touching& touching, Scene& scene) {
  bool met = scene.ground && scene.ground->collides && touching.meets("ground");
  bool contact = met || touching.among_objects();
  for (const ObstacleDesc& obstacle : scene.obstacles) {
    met = met || touching.meets(obstacle.name);
    contact = contact || met;
  }
  bool kept_after = false;
  for (std::size_t i = scene.obstacles.size(); i-- > 0;) {
    const ObstacleDesc& obstacle = scene.obstacles[i];
    const bool acts = touching.meets(obstacle.name) || !obstacle.keys.empty() || (contact && obstacle.shape == ObstacleName::Implicit);
    if (acts || kept_after) {
      kept_after = true;
    } else {
      scene.obstacles.erase(scene.obstacles.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
  if (scene.ground && !(scene.ground->collides && (kept_after || touching.meets("ground")))) scene.ground.reset();
  return met;
}

/// Leaves out pairs without keys, and pairs that cannot touch anyway.
void leave_out_pairs(const Touching& touching, Scene& scene) {
  const auto counts = [&](const std::string& name) {
    const auto is_it = [&](const ObstacleDesc& obstacle) { return obstacle.name == name; };
    return touching.has_contact(name) || (name == "ground" && scene.ground) ||
           std::any_of(scene.obstacles.begin(), scene.obstacles.end(), is_it);
  };
  std::erase_if(scene.pairs, [&](const PairDesc& pair) {
    const bool says = !pair.collide.value_or(true) || pair.friction || pair.dissipation || pair.restitution;
    return !says || !std::all_of(pair.objects.begin(), pair.objects.end(), counts);
  });
  for (PairDesc& pair : scene.pairs) {
    pair.collide = pair.collide.value_or(true) ? std::nullopt : std::optional(false);
    std::sort(pair.objects.begin(), pair.objects.end());
  }
}

SceneKeys keys_of(Scene scene, Taken taken, FileHashes& hashes) {
  Listing listing{taken, hashes};
  Scene empty;
  DefaultArchive defaults;
  scene_members(defaults, empty);
  KeyArchive archive(listing, "", defaults);
  scene_members(archive, scene);
  std::sort(listing.keys.begin(), listing.keys.end(), [](const SceneKey& a, const SceneKey& b) { return a.path < b.path; });
  return std::move(listing.keys);
}

const SceneKey* find(const SceneKeys& keys, std::string_view path) {
  const auto at = std::lower_bound(keys.begin(), keys.end(), path, [](const SceneKey& key, std::string_view p) { return key.path < p; });
  return at != keys.end() && at->path == path ? &*at : nullptr;
}

/// Whether one of the mappings around a key is given in one scene only, so that the key needs no mention.
bool within_another(const std::string& path, const SceneKeys& here, const SceneKeys& other) {
  for (std::size_t end = path.find_first_of(".[", 1); end != std::string::npos; end = path.find_first_of(".[", end + 1)) {
    const std::string_view above = std::string_view(path).substr(0, end);
    if ((find(here, above) == nullptr) != (find(other, above) == nullptr)) return true;
  }
  return false;
}

/// "--set 'ground={}' --set ground.height=1": makes a key what the other scene has; empty where that cannot be set.
std::string setting(const SceneKey* other, const SceneKey* here) {
  const std::string& path = (other != nullptr ? other : here)->path;
  std::string value = other != nullptr ? other->value : here->fallback;
  if (path.starts_with("pairs(") || value == kNone || value == "absent" || value.starts_with("content ")) return {};
  if (value == kGiven) {
    if (other == nullptr || other->fallback != "false") return {};  // an item of a list, or a damaged state
    value = "{}";
  }
  const std::string word = path + '=' + value;
  return "--set " + (word.find_first_of(" []{}'*?") == std::string::npos ? word : '\'' + word + '\'');
}

}  // namespace

SceneKeys motion_keys(const Scene& scene, FileHashes& hashes) {
  Scene acting = scene;
  const Touching touching(scene);
  const bool meets_solids = leave_out_solids(touching, acting);
  leave_out_pairs(touching, acting);
  if (!meets_solids && !touching.among_objects()) acting.contact = {};
  return keys_of(std::move(acting), moves, hashes);
}

bool may_touch(const Scene& scene) {
  Scene acting = scene;
  const Touching touching(scene);
  return leave_out_solids(touching, acting) || touching.among_objects();
}

SceneKeys picture_keys(const Scene& scene, FileHashes& hashes) {
  SceneKeys keys = keys_of(scene, shows, hashes);
  const std::span<const CameraDesc> cameras = cameras_of(scene);
  if (std::any_of(cameras.begin(), cameras.end(), [](const CameraDesc& c) { return c.turntable != 0.0; })) {
    keys.push_back({"turntable over", number_text(scene.duration), ""});
  }
  return keys;
}

std::uint64_t hash_of(const SceneKeys& keys) {
  Hasher hasher;
  for (const SceneKey& key : keys) {
    hasher.add(std::string_view(key.path));
    hasher.add(std::string_view(key.value));
  }
  return hasher.value();
}

std::string text_of(const SceneKeys& keys) {
  std::string text;
  for (const SceneKey& key : keys) text += key.path + '\t' + key.value + '\t' + key.fallback + '\n';
  return text;
}

SceneKeys keys_in(std::string_view text) {
  SceneKeys keys;
  while (!text.empty()) {
    const std::size_t end = text.find('\n'), first = text.find('\t'), second = text.find('\t', first + 1);
    const bool whole = end != std::string_view::npos && first < end && second < end;
    if (!whole || (!keys.empty() && text.substr(0, first) < keys.back().path)) {  // they are looked up by halving
      throw Error(ErrorKind::Corrupt, Fault{.expected = "expected keys of a scene in the saved state"});
    }
    keys.push_back({std::string(text.substr(0, first)), std::string(text.substr(first + 1, second - first - 1)),
                    std::string(text.substr(second + 1, end - second - 1))});
    text.remove_prefix(end + 1);
  }
  return keys;
}

KeyDifferences differences(const SceneKeys& here, const SceneKeys& other) {
  KeyDifferences out;
  std::set<std::string> paths;
  for (const SceneKeys* keys : {&here, &other}) {
    for (const SceneKey& key : *keys) paths.insert(key.path);
  }
  std::size_t count = 0;
  bool settable = true;
  for (const std::string& path : paths) {
    const SceneKey *mine = find(here, path), *theirs = find(other, path);
    if (mine != nullptr && theirs != nullptr && mine->value == theirs->value) continue;
    const bool inside = within_another(path, here, other);
    if (!inside && ++count <= kMostShown) {
      const auto value_of = [](const SceneKey* key, const SceneKey* instead) {
        if (key != nullptr) return key->value;
        return instead->value == kGiven ? std::string(kNone) : instead->fallback;
      };
      out.found += (out.found.empty() ? "" : ", ") + path + '=' + value_of(theirs, mine) + " (here " + value_of(mine, theirs) + ')';
    }
    if (inside && theirs == nullptr) continue;  // goes with its mapping
    const std::string set = setting(theirs, mine);
    settable = settable && !set.empty();
    out.set += (out.set.empty() ? "" : " ") + set;
  }
  if (count > kMostShown) out.found += " and " + std::to_string(count - kMostShown) + " more";
  if (!settable || count > kMostShown) out.set.clear();
  return out;
}

}  // namespace supple::scenes
