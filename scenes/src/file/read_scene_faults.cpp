#include "file/read_scene_faults.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

namespace supple::scenes {
namespace {

constexpr std::size_t kMostShown = 20;
constexpr std::size_t kMostKept = 1000;  // a hostile file may have a fault per node

bool continues_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

}  // namespace

std::uint32_t SourceTexts::add(std::string name, std::string text, bool whole) {
  sources_.push_back({std::move(name), std::move(text), whole});
  return static_cast<std::uint32_t>(sources_.size() - 1);
}

std::string SourceTexts::place(Mark mark) const {
  const Source& source = sources_[mark.source];
  if (source.whole) return source.name;
  std::size_t start = 0;
  for (int line = 1; line < mark.line && start < source.text.size(); ++line) {
    const std::size_t end = source.text.find('\n', start);
    if (end == std::string::npos) break;
    start = end + 1;
  }
  int column = 1;
  const std::string_view before = std::string_view(source.text).substr(start, static_cast<std::size_t>(mark.column - 1));
  for (const char c : before) column += continues_character(c) ? 0 : 1;
  return source.name + ':' + std::to_string(mark.line) + ':' + std::to_string(column);
}

void FaultList::add(Mark mark, std::string key, std::string expected, std::string found, std::string hint) {
  ++count_;
  if (faults_.size() >= kMostKept) return;
  faults_.push_back({mark, Fault{"", std::move(key), std::move(expected), std::move(found), std::move(hint)}});
}

void FaultList::doubt(std::string key) {
  if (doubted_.size() < kMostKept) doubted_.push_back(std::move(key));
}

bool FaultList::has(std::string_view key) const {
  const auto concerns = [key](std::string_view other) {
    if (other.empty()) return false;
    const std::string_view above = other.size() < key.size() ? other : key;
    const std::string_view below = other.size() < key.size() ? key : other;
    return below.starts_with(above) && (below.size() == above.size() || below[above.size()] == '.' || below[above.size()] == '[');
  };
  return std::any_of(faults_.begin(), faults_.end(), [&](const Placed& placed) { return concerns(placed.fault.key); }) ||
         std::any_of(doubted_.begin(), doubted_.end(), concerns);
}

void FaultList::raise() const {
  if (faults_.empty()) return;
  std::vector<Placed> sorted = faults_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Placed& a, const Placed& b) { return a.mark < b.mark; });
  // What `repeat`, `emit` or `defaults` copies to many entries is one fault of the file.
  const auto same = [](const Placed& a, const Placed& b) {
    return a.mark == b.mark && a.fault.expected == b.fault.expected && a.fault.found == b.fault.found && a.fault.hint == b.fault.hint;
  };
  sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
  const std::size_t all = sorted.size() + (count_ - faults_.size());
  std::vector<Fault> out;
  for (Placed& placed : sorted) {
    if (out.size() == kMostShown) break;
    placed.fault.place = texts_.place(placed.mark);
    out.push_back(std::move(placed.fault));
  }
  if (all > kMostShown) {
    std::string& hint = out.back().hint;
    hint += (hint.empty() ? "(" : " (") + std::to_string(all - kMostShown) + " more faults are not shown)";
  }
  throw Error(ErrorKind::Scene, std::move(out));
}

std::string shown(std::string_view text) {
  std::string out;
  std::size_t characters = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (!continues_character(c) && ++characters > 60) return out + "...";
    if (byte < 0x20 || byte == 0x7F) {
      std::array<char, 8> escaped{};
      std::snprintf(escaped.data(), escaped.size(), "\\x%02x", byte);
      out += escaped.data();
    } else {
      out += c;
    }
  }
  return out;
}

std::string with_article(std::string_view noun) {
  const bool vowel = !noun.empty() && std::string_view("aei").find(noun[0]) != std::string_view::npos;
  return (vowel ? "an " : "a ") + std::string(noun);
}

std::string number_text(double value) {
  std::array<char, 32> text{};
  const bool whole = std::abs(value) < 1e9 && value == std::floor(value);
  const auto [end, error] = whole ? std::to_chars(text.data(), text.data() + text.size(), static_cast<long long>(value))
                                  : std::to_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() ? std::string(text.data(), end) : "?";
}

std::string short_text(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

std::string particle_range(std::uint32_t n) {
  return "expected a particle from 0 to " + std::to_string(n - 1) + ", or from -" + std::to_string(n) + " to -1";
}

std::string joined(std::span<const std::string_view> words) {
  std::string text;
  for (const std::string_view word : words) {
    if (!text.empty()) text += ", ";
    text += word;
  }
  return text;
}

std::string known_hint(std::string_view name, std::span<const std::string_view> names) {
  const std::string near = nearest_word(name, names), known = "known: " + shown(joined(names));
  return near.empty() ? known : "did you mean '" + near + "'? (" + known + ')';
}

}  // namespace supple::scenes
