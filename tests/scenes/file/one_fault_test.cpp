/// One slip in a scene is one fault: no consequence of it is reported at other keys.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "file/fields/fields_info.h"
#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A key in a text, and the scalar behind it; empty: a list or a mapping is.
struct Entry {
  std::size_t key = 0, key_size = 0, value = 0, value_size = 0;
};

bool of_word(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_'; }

std::vector<Entry> entries_of(const std::string& text) {
  std::vector<Entry> found;
  for (std::size_t colon = text.find(": "); colon != std::string::npos; colon = text.find(": ", colon + 1)) {
    if (text.substr(text.rfind('\n', colon) + 1, colon).find('#') < colon - text.rfind('\n', colon)) continue;  // in a comment
    Entry entry;
    entry.key = colon;
    while (entry.key > 0 && of_word(text[entry.key - 1])) --entry.key;
    entry.key_size = colon - entry.key;
    entry.value = colon + 2;
    const std::size_t end = text.find_first_of(",}\n[{#\"", entry.value);
    if (end != std::string::npos && (text[end] == ',' || text[end] == '}' || text[end] == '\n')) entry.value_size = end - entry.value;
    if (entry.key_size > 0) found.push_back(entry);
  }
  return found;
}

/// Whether a place belongs to a variable: each use of one that is gone or is no number is a fault of its own.
bool of_variables(const std::string& text, std::size_t place) {
  const std::string_view before = std::string_view(text).substr(0, place);
  const std::size_t top = before.rfind("\nvariables:");
  if (top == std::string_view::npos) return false;
  for (std::size_t line = before.find('\n', top + 1); line != std::string_view::npos; line = before.find('\n', line + 1)) {
    if (line + 1 < text.size() && text[line + 1] != ' ' && text[line + 1] != '\n' && text[line + 1] != '#') return false;
  }
  return place > top + 1;
}

/// The words that choose: of all keys.
void add_choices(const std::vector<FieldInfo>& fields, std::set<std::string>& words) {
  for (const FieldInfo& field : fields) {
    for (const std::string_view word : field.choices) words.emplace(word);
    add_choices(field.children, words);
  }
}

std::vector<std::string> faults_of(const std::string& text, const fs::path& folder) {
  std::vector<std::string> out;
  try {
    (void)parse_scene(text, "scene.yaml", folder);
  } catch (const Error& error) {
    for (const Fault& fault : error.faults()) out.push_back(fault.key + ": " + fault.expected + ", found " + fault.found);
  }
  return out;
}

struct SceneText {
  fs::path folder;
  std::string name, text;
};

/// Of the library, of what pins, loads, kinds, pairs and led obstacles say of others, and of what is written in short.
std::vector<SceneText> scene_texts() {
  std::vector<SceneText> texts;
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() / "scenes/library")) {
    if (entry.path().extension() != ".yaml") continue;
    std::ifstream file(entry.path());
    std::stringstream text;
    text << file.rdbuf();
    texts.push_back({entry.path().parent_path(), entry.path().filename(), text.str()});
  }
  std::sort(texts.begin(), texts.end(), [](const SceneText& a, const SceneText& b) { return a.name < b.name; });
  const std::string head = "schema: 1\nduration: 1\nobjects:\n";
  const std::string rest = R"(    kinds: [{hinge: true, particles: [1]}, {type: 1, particles: [2]}]
    interactions: [{law: bond_frame, stretch: 10, rotation: 1}]
    skeleton: [{shape: segment, half_length: 0.1, particles: [0, 2], kernel: {type: wyvill, radius: 0.2}}]
    contact: {modulus: 1e4}
    breaking: {stretch: 0.1}
    pins: [{particle: 2, orientation: false}]
    loads: [{particle: -3, force: [1, 0, 0], from: 0.1, until: 0.2}]
)";
  const std::string pairs = "ground: {height: -1}\npairs: [{objects: [a, ground], friction: 0.3}]\n";
  for (const char* arrangement : {"arrange: line, count: 3, spacing: 0.2", "arrange: ring, count: 3, radius: 0.2, normal: radial",
                                  "arrange: grid, columns: 3, rows: 1, spacing: 0.2", "arrange: geodesic, frequency: 1, radius: 0.2",
                                  "arrange: spiral, count: 3, inner_radius: 0.1, outer_radius: 0.3, turns: 1"}) {
    texts.push_back({".", arrangement, head + "  - name: a\n    particles: {" + arrangement + "}\n" + rest + pairs});
  }
  texts.push_back({".", "short keys", R"(schema: 1
duration: 1
variables: {r: 0.1 m}
defaults:
  objects: {roughness: 0.5}
materials: {gum: {youngs_modulus: 20 kPa, density: 1050 kg/m^3}}
objects:
  - name: drop
    emit: {rate: 3 Hz, count: 2, from: 0.1 s}
    particles: {at: ["${r*i}", 0, 0]}
    material: gum
    skeleton:
      - {shape: point, repeat: 2, at: ["${r*i}", 0, 0], kernel: {radius: "${r}"}}
)"});
  return texts;
}

/// Changes every entry that `change` gives another text for, one at a time.
template <class Change>
void expect_one_fault(const Change& change) {
  int tried = 0;
  for (const SceneText& scene : scene_texts()) {
    ASSERT_TRUE(faults_of(scene.text, scene.folder).empty()) << scene.name << ": " << faults_of(scene.text, scene.folder).front();
    for (const Entry& entry : entries_of(scene.text)) {
      std::string text = scene.text;
      if (of_variables(text, entry.key) || !change(text, entry)) continue;
      ++tried;
      const std::vector<std::string> faults = faults_of(text, scene.folder);
      const auto line = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(entry.key), '\n') + 1;
      std::string all;
      for (const std::string& fault : faults) all += "\n  " + fault;
      EXPECT_EQ(faults.size(), 1U) << scene.name << ':' << line << ' ' << scene.text.substr(entry.key, entry.key_size) << all;
    }
  }
  EXPECT_GT(tried, 100);
}

TEST(OneFault, ForAChoiceThatIsMisspelt) {
  std::set<std::string> words;
  add_choices(scene_fields(), words);
  expect_one_fault([&](std::string& text, const Entry& entry) {
    if (text.substr(entry.key, entry.key_size) == "name" || !words.contains(text.substr(entry.value, entry.value_size))) return false;
    text = text.substr(0, entry.value + entry.value_size) + "q" + text.substr(entry.value + entry.value_size);
    return true;
  });
}

TEST(OneFault, ForAKeyThatIsMisspelt) {
  expect_one_fault([](std::string& text, const Entry& entry) {
    if (text.substr(0, entry.key).ends_with("repeat: {")) return false;  // each use of an index that is gone is a fault of its own
    text = text.substr(0, entry.key + entry.key_size) + "q" + text.substr(entry.key + entry.key_size);
    return true;
  });
}

TEST(OneFault, ForANumberThatIsNone) {
  expect_one_fault([](std::string& text, const Entry& entry) {
    const std::string value = text.substr(entry.value, entry.value_size);
    if (value.find_first_of("0123456789") != 0 && value.find_first_of("0123456789") != 1) return false;
    text = text.substr(0, entry.value) + "1..2" + text.substr(entry.value + entry.value_size);
    return true;
  });
}

}  // namespace
}  // namespace supple::scenes
