#include "scene_keys.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <concepts>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <type_traits>
#include <utility>

#include "camera.h"
#include "fields.h"
#include "fields_archive.h"
#include "read_scene_faults.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::size_t kMostTold = 6;  // keys in a message

/// Keys that change pictures and files but not the motion, on every level.
constexpr std::array<std::string_view, 20> kLooks = {
    "schema", "title", "duration", "camera", "cameras", "light", "lights", "background", "render", "output", "colour", "roughness",
    "look", "visible", "texture", "meshing", "bulge", "bulge_volume", "bulge_width", "bulge_literal"};
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
  return !(mapping == "output.images" && key == "formats");  // each has a fingerprint of its own
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

/// What a file holds, whatever its name. One that cannot be read, or is larger than any that is, is a fault of whoever needs it.
std::string content_text(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path, status)) return "absent";
  if (std::filesystem::file_size(path, status) > io::kLargestInput) return "too large";
  std::ifstream file(path, std::ios::binary);
  std::string part(std::size_t{1} << 20, '\0');  // what is in memory at once
  Hasher hasher;
  while (file) {
    file.read(part.data(), static_cast<std::streamsize>(part.size()));
    hasher.add(std::string_view(part).substr(0, static_cast<std::size_t>(file.gcount())));
  }
  return "content " + to_hex(hasher.value());
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
template <class E>
  requires std::is_enum_v<E>
std::string value_text(E value, const Rule& /*rule*/) {
  return std::string(name_of(value));
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

/// What a key holds: of optional ones and lists of mappings one of them.
template <class T> struct FieldValue { using type = T; };
template <class T> struct FieldValue<std::optional<T>> { using type = T; };
template <Described D> struct FieldValue<std::vector<D>> { using type = D; };

/// Values of keys that are no mappings, with which a mapping begins.
class DefaultArchive {
 public:
  std::vector<std::pair<std::string_view, std::string>> texts;

  template <class T>
  void operator()(std::string_view key, T& value, const Rule& rule, std::string_view /*meaning*/) {
    using Value = typename FieldValue<T>::type;
    if constexpr (!Described<Value>) {
      if (rule.when.applies()) texts.emplace_back(key, value_text(value, rule));
    }
  }
  template <class T>
  void required(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    (*this)(key, value, rule, meaning);
  }
  [[nodiscard]] static bool given(std::string_view /*key*/) { return false; }
  static void check(bool /*holds*/, const std::string& /*key*/, const std::string& /*expected*/, const std::string& /*found*/,
                    const std::string& /*hint*/) {}
};

template <Described D>
const DefaultArchive& defaults_of() {
  static const DefaultArchive archive = [] {
    DefaultArchive made;
    D defaults{};
    fields(made, defaults);
    return made;
  }();
  return archive;
}

template <class D>
concept Named = requires(const D& d) {
  { d.name } -> std::convertible_to<std::string>;
};

/// What every mapping of a scene is listed with.
struct Listing {
  Taken taken;
  std::filesystem::path folder;  ///< where files are looked for
  SceneKeys keys{};
};

/// The archive that lists values other than the defaults; one per mapping.
class KeyArchive {
 public:
  template <Described D>
  static void list_mapping(Listing& listing, const std::string& path, D& value) {
    KeyArchive archive(listing, path, defaults_of<D>());
    fields(archive, value);
  }

  template <class T>
  void operator()(std::string_view key, T& value, const Rule& rule, std::string_view /*meaning*/) {
    if (rule.when.applies() && listing_.taken(mapping_, key)) list(key, value, rule);
  }
  template <class T>
  void required(std::string_view key, T& value, const Rule& rule, std::string_view meaning) {
    (*this)(key, value, rule, meaning);
  }
  [[nodiscard]] static bool given(std::string_view /*key*/) { return false; }
  static void check(bool /*holds*/, const std::string& /*key*/, const std::string& /*expected*/, const std::string& /*found*/,
                    const std::string& /*hint*/) {}

 private:
  KeyArchive(Listing& listing, const std::string& mapping, const DefaultArchive& defaults)
      : listing_(listing), mapping_(mapping), defaults_(defaults) {}

  [[nodiscard]] std::string path_of(std::string_view key) const {
    return mapping_.empty() ? std::string(key) : mapping_ + '.' + std::string(key);
  }
  void add(std::string path, std::string value, std::string_view fallback) {
    listing_.keys.push_back({std::move(path), std::move(value), std::string(fallback)});
  }

  template <class T>
  void list(std::string_view key, T& value, const Rule& rule) {
    if constexpr (std::is_same_v<T, std::string>) {
      if (key == "file") {
        if (!value.empty()) add(path_of(key), content_text(listing_.folder / value), kNone);
        return;
      }
    }
    const auto usual = std::find_if(defaults_.texts.begin(), defaults_.texts.end(), [&](const auto& text) { return text.first == key; });
    const std::string_view fallback = usual == defaults_.texts.end() ? kNone : std::string_view(usual->second);
    std::string text = value_text(value, rule);
    if (text != fallback) add(path_of(key), std::move(text), fallback);
  }
  template <Described D>
  void list(std::string_view key, D& value, const Rule& /*rule*/) {
    list_mapping(listing_, path_of(key), value);
  }
  template <Described D>
  void list(std::string_view key, std::optional<D>& value, const Rule& /*rule*/) {
    if (!value) return;
    add(path_of(key), std::string(kGiven), "false");
    list_mapping(listing_, path_of(key), *value);
  }
  template <Described D>
  void list(std::string_view key, std::vector<D>& values, const Rule& /*rule*/) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::string item = path_of(key) + item_name(values[i], i);
      add(item, std::string(kGiven), kNone);
      list_mapping(listing_, item, values[i]);
    }
  }
  template <class D>
  static std::string item_name(const D& value, std::size_t index) {
    if constexpr (Named<D>) return '.' + value.name;
    return '[' + std::to_string(index) + ']';
  }
  /// The order of pairs says nothing.
  static std::string item_name(const PairDesc& pair, std::size_t /*index*/) {
    std::string text;
    for (const std::string& name : pair.objects) text += (text.empty() ? "(" : ", ") + name;
    return text + ')';
  }

  Listing& listing_;
  const std::string& mapping_;  ///< its path, "" for the scene
  const DefaultArchive& defaults_;
};

/// Who may touch whom, by what a scene says.
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
      if (object.contact && (object.separate || object.breaking || object.blend)) return true;
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

/// Leaves out solids that nothing may touch. One that is led along bounds the time step, one of primitives the spacing of samples,
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

/// Leaves out pairs that say nothing, or of what cannot touch anyway.
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

SceneKeys keys_of(Scene scene, Taken taken, const std::filesystem::path& folder) {
  Listing listing{taken, folder};
  KeyArchive::list_mapping(listing, "", scene);
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
    if (other->fallback != "false") return {};  // an item of a list
    value = "{}";
  }
  const std::string word = path + '=' + value;
  return "--set " + (word.find_first_of(" []{}'*?") == std::string::npos ? word : '\'' + word + '\'');
}

}  // namespace

SceneKeys motion_keys(const Scene& scene, const std::filesystem::path& folder) {
  Scene acting = scene;
  const Touching touching(scene);
  const bool meets_solids = leave_out_solids(touching, acting);
  leave_out_pairs(touching, acting);
  if (!meets_solids && !touching.among_objects()) acting.contact = {};
  return keys_of(std::move(acting), moves, folder);
}

SceneKeys picture_keys(const Scene& scene, const std::filesystem::path& folder) {
  SceneKeys keys = keys_of(scene, shows, folder);
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
    if (end == std::string_view::npos || first >= end || second >= end) {
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
    if (!inside && ++count <= kMostTold) {
      const auto told = [](const SceneKey* key, const SceneKey* instead) {
        if (key != nullptr) return key->value;
        return instead->value == kGiven ? std::string(kNone) : instead->fallback;
      };
      out.found += (out.found.empty() ? "" : ", ") + path + '=' + told(theirs, mine) + " (here " + told(mine, theirs) + ')';
    }
    if (inside && theirs == nullptr) continue;  // goes with its mapping
    const std::string set = setting(theirs, mine);
    settable = settable && !set.empty();
    out.set += (out.set.empty() ? "" : " ") + set;
  }
  if (count > kMostTold) out.found += " and " + std::to_string(count - kMostTold) + " more";
  if (!settable || count > kMostTold) out.set.clear();
  return out;
}

}  // namespace supple::scenes
