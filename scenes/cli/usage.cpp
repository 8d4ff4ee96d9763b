#include "usage.h"

#include <string>
#include <string_view>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/nearest_word.h"

namespace supple::tool {
namespace {

/// @param near  the nearest known word, or empty
[[noreturn]] void refuse(const std::string& place, const std::string& kind, std::string_view found, const std::string& near,
                         const std::vector<std::string>& known) {
  std::string all;
  for (const std::string& word : known) all += (all.empty() ? "" : ", ") + word;
  throw Error(ErrorKind::Usage, Fault{.place = place,
                                      .key = {},
                                      .expected = "expected " + kind,
                                      .found = "'" + std::string(found) + "'",
                                      .hint = near.empty() ? "known: " + all : "did you mean '" + near + "'? (known: " + all + ')'});
}

std::string nearest(std::string_view word, const std::vector<std::string>& known) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  return nearest_word(word, views);
}

const CLI::App* command_of(const CLI::App& app, std::string_view word, const std::string& place) {
  std::vector<std::string> known;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (verb->get_name() == word) return verb;
    known.push_back(verb->get_name());
  }
  refuse(place, "a command", word, nearest(word, known), known);
}

std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

}  // namespace

void expect_known_words(const CLI::App& app, std::span<char* const> words) {
  const CLI::App* at = &app;
  std::string place = app.get_name().empty() ? "supple" : app.get_name();
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string_view word = words[i];
    if (word == "--") return;
    if (word.size() > 1 && word[0] == '-' && std::string_view(".0123456789").find(word[1]) == std::string_view::npos) {
      const std::string name(word.substr(0, word.find('=')));
      const CLI::Option* option = at->get_option_no_throw(name);
      if (option == nullptr && !at->get_allow_extras()) {
        const std::vector<std::string> known = options_of(*at);
        refuse(place, "an option", name, nearest(name, known), known);
      }
      const bool takes_next = option != nullptr && option->get_items_expected_min() > 0 && name.size() == word.size();
      if (takes_next) ++i;
      continue;
    }
    if (at != &app) continue;
    at = command_of(app, word, place);
    place += ' ' + at->get_name();
  }
}

}  // namespace supple::tool
