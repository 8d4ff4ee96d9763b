#include "scene_mutations.h"

#include <yaml-cpp/yaml.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "supple/scenes/read_scene.h"

namespace supple::stress {
namespace {

constexpr int kDeepest = 60;            // of what is read; deeper trees are mutated as text
constexpr std::size_t kMostItems = 20'000;

const std::vector<std::string>& odd_scalars() {
  static const std::vector<std::string> list{
      "0", "-0.0", "1", "-1", "3", "1000", "1e-300", "5e-324", "1e-9", "1e-6", "1e6", "1e9", "1e300", "1.8e308", "1e309", "-1e309", "2147483647",
      "2147483648", "4294967296", "9223372036854775808", "18446744073709551616", ".nan", ".inf", "-.inf", "nan", "inf", "0x10", "017", "1_000",
      "1,5", "1e", "+5", "--1", "1e400", "5 kPa", "3 lb", "0.1 mm", "1e6 s", "5kPa", "true", "yes", "~", "null", "''", "abc", "[]", "{}", "[1, 2]",
      "[1, 2, 3]", "[0, 0, 0]", "[1e300, 0, 0]", "[[1]]", "{a: 1}", "'../../etc/passwd'", "/dev/zero", "*a", "!!int 5", "!!binary aGk=", "'a\tb'",
      "\"\\0\"", "\"\\xff\"", "\xff\xfe", "\xed\xa0\x80", "\xc3\xa9", "\xe2\x80\xae", "? x", "<<", "auto", "ground"};
  return list;
}

bool is_number(const std::string& text, double& value) {
  char* end = nullptr;
  value = std::strtod(text.c_str(), &end);
  return end != text.c_str() && (*end == '\0' || *end == ' ');
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < ' ') {
      std::array<char, 8> code{};
      std::snprintf(code.data(), code.size(), "\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      out += code.data();
    } else {
      out += c;
    }
  }
  return out + '"';
}

bool is_plain(const std::string& text) {
  return !text.empty() && text.find_first_of(":#,[]{}\"'&*!|>%@`\n\t?") == std::string::npos && text.front() != ' ' && text.back() != ' ' &&
         text.front() != '-';
}

bool read(const YAML::Node& node, Value& value, int depth, std::size_t& items) {
  if (depth > kDeepest || ++items > kMostItems) return false;
  if (node.IsMap()) {
    value.kind = Value::Kind::Map;
    for (const auto& pair : node) {
      if (!pair.first.IsScalar()) return false;
      value.keys.push_back(pair.first.Scalar());
      if (!read(pair.second, value.items.emplace_back(), depth + 1, items)) return false;
    }
    return true;
  }
  if (node.IsSequence()) {
    value.kind = Value::Kind::List;
    for (const auto& item : node) {
      if (!read(item, value.items.emplace_back(), depth + 1, items)) return false;
    }
    return true;
  }
  double number = 0.0;
  const std::string text = node.IsScalar() ? node.Scalar() : "~";
  value.text = node.Tag() != "!" && (is_plain(text) || is_number(text, number)) ? text : quoted(text);
  return true;
}

void print(const Value& value, std::string& out) {
  out += value.anchor;
  if (value.kind == Value::Kind::Scalar) {
    out += value.text;
    return;
  }
  const bool map = value.kind == Value::Kind::Map;
  out += map ? '{' : '[';
  for (std::size_t i = 0; i < value.items.size(); ++i) {
    if (i > 0) out += map ? ",\n  " : ", ";
    if (map) out += value.keys[i] + ": ";
    print(value.items[i], out);
  }
  out += map ? '}' : ']';
}

/// A place in a tree.
struct Place {
  Value* value;
  Value* parent;
  std::size_t index;
};

void collect(Value& value, Value* parent, std::size_t index, std::vector<Place>& places) {
  places.push_back({&value, parent, index});
  for (std::size_t i = 0; i < value.items.size(); ++i) collect(value.items[i], &value, i, places);
}

Value scalar(std::string text) { return Value{.kind = Value::Kind::Scalar, .text = std::move(text)}; }

std::string another_number(const std::string& text, Random& random) {
  double number = 0.0;
  if (!is_number(text, number) || random.one_in(4)) return random.of(odd_scalars());
  constexpr std::array kFactors{-1.0, 0.0, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999, 1.1, 2.0, 3.0, 10.0, 1e3, 1e6, 1e9, 1e12};
  std::array<char, 40> digits{};
  std::snprintf(digits.data(), digits.size(), "%.9g", number * kFactors[random.below(kFactors.size())]);
  return digits.data();
}

Value odd_value(const Vocabulary& vocabulary, Random& random) {
  if (random.one_in(3)) return scalar(random.of(vocabulary.words));
  return scalar(random.of(odd_scalars()));
}

void drop(Value& parent, std::size_t index) {
  parent.items.erase(parent.items.begin() + static_cast<std::ptrdiff_t>(index));
  if (parent.kind == Value::Kind::Map) parent.keys.erase(parent.keys.begin() + static_cast<std::ptrdiff_t>(index));
}

void repeat(Value& parent, std::size_t index, std::size_t times) {
  const Value copy = parent.items[index];
  for (std::size_t k = 0; k < times; ++k) {
    parent.items.push_back(copy);
    if (parent.kind == Value::Kind::Map) parent.keys.push_back(parent.keys[index]);
  }
}

std::string misspelt(std::string key, Random& random) {
  if (key.empty()) return "x";
  const std::size_t at = random.below(key.size());
  switch (random.below(4)) {
    case 0: key.erase(at, 1); break;
    case 1: key.insert(at, 1, static_cast<char>('a' + random.below(26))); break;
    case 2: std::swap(key[at], key[key.size() - 1 - at]); break;
    default: key[at] = "_- .A\x01"[random.below(6)]; break;
  }
  return key;
}

std::string nested(Random& random) {
  constexpr std::array<std::size_t, 4> kDepths{5, 100, 2000, 100'000};
  const std::size_t depth = kDepths[random.below(kDepths.size())];
  return std::string(depth, '[') + "1" + std::string(random.one_in(8) ? depth - 1 : depth, ']');
}

void change_value(Value& value, const Vocabulary& vocabulary, Random& random) {
  if (value.kind != Value::Kind::Scalar) {
    if (random.one_in(2)) value = random.one_in(2) ? odd_value(vocabulary, random) : Value{.kind = value.kind};
    return;
  }
  double number = 0.0;
  value.text = is_number(value.text, number) || random.one_in(2) ? another_number(value.text, random) : odd_value(vocabulary, random).text;
}

/// Changes around a place that has a parent.
void change_place(const Place& place, std::vector<Place>& places, const Vocabulary& vocabulary, Random& random) {
  Value& parent = *place.parent;
  const bool map = parent.kind == Value::Kind::Map;
  switch (random.below(9)) {
    case 0: drop(parent, place.index); break;
    case 1: repeat(parent, place.index, random.one_in(10) ? 1000 : 1 + random.below(3)); break;
    case 2:
      if (map) parent.keys[place.index] = misspelt(parent.keys[place.index], random);
      break;
    case 3:
      if (map) parent.keys[place.index] = random.of(vocabulary.keys);
      break;
    case 4:
      if (map) parent.keys.push_back(random.of(vocabulary.keys));
      parent.items.push_back(odd_value(vocabulary, random));
      break;
    case 5: {  // what belongs elsewhere
      const Value other = *random.of(places).value;
      *place.value = other;
      break;
    }
    case 6: {  // an alias, which may lie within what it names
      random.of(places).value->anchor = "&a ";
      *place.value = scalar("*a");
      break;
    }
    case 7: *place.value = scalar(random.one_in(2) ? nested(random) : std::string(std::size_t{1} << random.below(20), 'x')); break;
    default: {
      Value inner = *place.value;
      *place.value = Value{.kind = random.one_in(2) ? Value::Kind::List : Value::Kind::Map, .items = {std::move(inner)}};
      if (place.value->kind == Value::Kind::Map) place.value->keys = {random.of(vocabulary.keys)};
    }
  }
}

void find_words(const nlohmann::json& schema, std::set<std::string>& keys, std::set<std::string>& words) {
  if (schema.is_object()) {
    for (const auto& [name, inner] : schema.items()) {
      if (name == "properties" && inner.is_object()) {
        for (const auto& property : inner.items()) keys.insert(property.key());
      }
      if (name == "enum" || name == "const") {
        for (const auto& word : inner.is_array() ? inner : nlohmann::json::array({inner})) {
          if (word.is_string()) words.insert(word.get<std::string>());
        }
      }
      find_words(inner, keys, words);
    }
  } else if (schema.is_array()) {
    for (const auto& inner : schema) find_words(inner, keys, words);
  }
}

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t number) {
  std::seed_seq words{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U), static_cast<std::uint32_t>(number),
                      static_cast<std::uint32_t>(number >> 32U)};
  engine_.seed(words);
}

std::optional<Value> parse_value(const std::string& text) {
  try {
    Value value;
    std::size_t items = 0;
    if (!read(YAML::Load(text), value, 0, items) || value.kind == Value::Kind::Scalar) return std::nullopt;
    return value;
  } catch (const YAML::Exception&) {
    return std::nullopt;
  }
}

std::string print_value(const Value& value) {
  std::string out;
  if (value.kind != Value::Kind::Map) {
    print(value, out);
    return out + '\n';
  }
  for (std::size_t i = 0; i < value.items.size(); ++i) {
    out += value.keys[i] + ": ";
    print(value.items[i], out);
    out += '\n';
  }
  return out;
}

Vocabulary scene_vocabulary() {
  std::set<std::string> keys, words;
  find_words(nlohmann::json::parse(scenes::scene_json_schema()), keys, words);
  return {{keys.begin(), keys.end()}, {words.begin(), words.end()}};
}

void mutate(Value& value, const Vocabulary& vocabulary, Random& random) {
  const bool gentle = random.one_in(2);  // numbers alone: many such scenes are good ones
  for (std::size_t left = 1 + random.below(4); left > 0; --left) {
    std::vector<Place> places;
    collect(value, nullptr, 0, places);
    const Place place = random.of(places);
    if (gentle) {
      double number = 0.0;
      if (is_number(place.value->text, number)) place.value->text = another_number(place.value->text, random);
    } else if (place.parent == nullptr || random.one_in(2)) {
      change_value(*place.value, vocabulary, random);
    } else {
      change_place(place, places, vocabulary, random);
    }
  }
}

std::string mutate_text(std::string text, Random& random) {
  static constexpr char kAll[] = "{}[]:,-'\"#&*!|>%@`~? \t\n\r\0\xff\xc3\xa9 0123456789e.ax";
  constexpr std::string_view kLetters(kAll, sizeof kAll - 1);
  for (std::size_t left = 1 + random.below(8); left > 0 && !text.empty(); --left) {
    const std::size_t at = random.below(text.size());
    switch (random.below(6)) {
      case 0: text[at] = kLetters[random.below(kLetters.size())]; break;
      case 1: text.insert(at, 1, kLetters[random.below(kLetters.size())]); break;
      case 2: text.erase(at, 1 + random.below(20)); break;
      case 3: text[at] = static_cast<char>(random.below(256)); break;
      case 4: {  // a part a second time
        const std::string part = text.substr(at, 1 + random.below(80));
        text.insert(random.below(text.size()), part);
        break;
      }
      default:
        if (random.one_in(4)) text.resize(at);
    }
  }
  return text;
}

Value minimise(Value value, int most, const std::function<bool(const Value&)>& fails) {
  bool smaller = true;
  while (smaller && most > 0) {
    smaller = false;
    for (std::size_t k = 1; most > 0; ++k) {
      Value shorter = value;
      std::vector<Place> places;
      collect(shorter, nullptr, 0, places);
      if (k >= places.size()) break;
      drop(*places[k].parent, places[k].index);
      --most;
      if (!fails(shorter)) continue;
      value = std::move(shorter);
      smaller = true;
      --k;  // the next one has come to this place
    }
  }
  return value;
}

}  // namespace supple::stress
