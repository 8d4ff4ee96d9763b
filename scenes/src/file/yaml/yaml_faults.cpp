#include "file/yaml/yaml_faults.h"

#include <yaml-cpp/exceptions.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace supple::scenes {
namespace {

constexpr std::string_view kBlanks = " \t\r";

struct Told {
  Mark at;
  std::string expected, found, hint;
};

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

/// A place, and the line that it is in.
struct Place {
  Mark at;
  std::string_view before, rest;  // of the line
  bool last = false;              // nothing follows in the file

  Place(std::string_view text, Mark mark) : at(mark) {
    const std::size_t byte = byte_of(text, mark);
    const std::size_t begin = byte == 0 ? 0 : text.rfind('\n', byte - 1) + 1;  // npos + 1 is 0
    before = text.substr(begin, byte - begin);
    rest = text.substr(byte, std::min(text.find('\n', byte), text.size()) - byte);
    last = trimmed(text.substr(byte)).empty();
  }
  [[nodiscard]] std::string found() const {
    if (last) return "the end of the file";
    return trimmed(rest).empty() ? "the end of the line" : '\'' + shown(trimmed(rest)) + '\'';
  }
  /// Nothing stands before it in its line.
  [[nodiscard]] bool first() const { return trimmed(before).empty(); }
  [[nodiscard]] bool is_item() const { return trimmed(rest) == "-" || rest.starts_with("- "); }
  /// A mark in the same line.
  [[nodiscard]] Mark moved(std::size_t byte_of_line) const { return {at.source, at.line, static_cast<int>(byte_of_line) + 1}; }
};

std::string spaces(int count) { return std::to_string(count) + (count == 1 ? " space" : " spaces"); }

/// "the list that begins on line 3"
std::string named(const Node& node) {
  return std::string(node.kind == Node::Kind::List ? "the list" : "the mapping") + " that begins on line " + std::to_string(node.mark.line);
}

Told of_tab(const Place& place, std::size_t tab) { return {place.moved(tab), "expected spaces", "a tab", "indent by spaces"}; }

/// Byte of the first tab in the indentation of a line, dashes of items included, or npos.
std::size_t tab_of(std::string_view before) {
  const std::size_t end = before.find_first_not_of(" \t-");
  return before.substr(0, end).find('\t');
}

Told of_list_line(const Place& place, const Node& list) {
  std::string hint = "items begin with '- ' after " + spaces(list.mark.column - 1);
  if (!list.items.empty() && list.items.back()->kind == Node::Kind::Mapping) {
    hint += ", keys of the last item follow " + spaces(list.items.back()->mark.column - 1);
  }
  return {place.at, "expected an item of " + named(list) + ", or a key of the last one", place.found() + " after " + spaces(place.at.column - 1), hint};
}

Told of_mapping_line(const Place& place, const Node& mapping) {
  const std::string expected = "expected a key of " + named(mapping);
  if (place.is_item()) return {place.at, expected, place.found(), "a list has a key of its own, and a mapping has no items"};
  const Node* before = mapping.entries.empty() ? nullptr : mapping.entries.back().value;
  const bool in_list = before != nullptr && before->kind == Node::Kind::List && before->mark.column == place.at.column;
  return {place.at, expected, place.found() + " after " + spaces(place.at.column - 1),
          in_list ? "begin the items of a list with '- '" : "keys of one mapping are indented alike, here by " + spaces(mapping.mark.column - 1)};
}

/// A line that belongs to no list or mapping above it.
Told of_block(const Place& place, const YamlContext& context) {
  if (!place.first()) return {place.at, "expected the end of the line", place.found(), "a text in quotes ends at the next quote of its kind; put the other kind around it"};
  if (context.open == nullptr) return {place.at, "expected a key", place.found(), "keys of one mapping are indented alike"};
  return context.open->kind == Node::Kind::List ? of_list_line(place, *context.open) : of_mapping_line(place, *context.open);
}

Told of_brackets(const Place& place, const YamlContext& context, bool list) {
  const std::string expected = list ? "expected ',' or ']'" : "expected ',' or '}'";
  if (context.open == nullptr) return {place.at, expected, place.found(), ""};
  const std::size_t begin = byte_of(context.text, context.open->mark);
  const bool expression = context.text.substr(begin, byte_of(context.text, place.at) + 1 - begin).find("${") != std::string_view::npos;
  return {place.at, expected, place.found(),
          expression ? "expressions inside [ ] or { } need quotes: \"${...}\"" : named(*context.open) + " is not closed before"};
}

Told of_colon(const Place& place) {
  if (place.before.find(": ") != std::string_view::npos || place.before.find(":\t") != std::string_view::npos) {
    return {place.at, "expected one key in the line", "a second ': '", "a value with ': ' in it needs quotes"};
  }
  const std::size_t begin = place.before.find_first_not_of(kBlanks);
  const std::string more = place.at.line > 1 ? " as more of the text above" : "";
  return {place.moved(std::min(begin, place.before.size())), "expected a key", '\'' + shown(trimmed(std::string(place.before) + std::string(place.rest))) + '\'' + more,
          "keys of one mapping are indented alike, and ': ' follows each"};
}

/// yaml-cpp names the place after the escape.
Told of_escape(const Place& place) {
  const std::size_t slash = place.before.rfind('\\');
  const std::size_t begin = slash == std::string_view::npos ? place.before.size() : slash;
  return {place.moved(begin), "expected an escape of YAML", '\'' + shown(place.before.substr(begin)) + '\'', "write '\\\\' for a backslash, or put the text in single quotes"};
}

Told of_block_text(const Place& place) { return {place.at, "expected the end of the line", place.found(), "the text begins on the line after '|' or '>'"}; }

/// Expected and hint of what needs no more than its place; `found` is the rest of the line.
struct Plain {
  const char* message;
  const char* expected;
  const char* hint;
};

constexpr const char* kAnchorHint = "a text that begins with '*' or '&' needs quotes";
constexpr const char* kTagHint = "remove the tag; a text that begins with '!' needs quotes";
constexpr const char* kDirectiveHint = "remove the line";

const Plain* plain_of(std::string_view message) {
  namespace Msg = YAML::ErrorMsg;
  static const std::array all{
      Plain{Msg::UNKNOWN_TOKEN, "expected a value", "a text that begins with this character needs quotes"},
      Plain{Msg::BLOCK_ENTRY, "expected a value", "items of a list stand on lines of their own, or inside [ ] with commas"},
      Plain{Msg::MAP_KEY, "expected a value", "a text that begins with '? ' needs quotes"},
      Plain{Msg::FLOW_END, "expected no closing bracket, or that of the one opened last", "'[' is closed by ']' and '{' by '}'"},
      Plain{Msg::UNKNOWN_ANCHOR, "expected an alias to an anchor that stands before it", "write '&' and the name at what is meant; a text that begins with '*' needs quotes"},
      Plain{Msg::ALIAS_NOT_FOUND, "expected a name after '*'", kAnchorHint},
      Plain{Msg::ANCHOR_NOT_FOUND, "expected a name after '&'", kAnchorHint},
      Plain{Msg::CHAR_IN_ALIAS, "expected a blank after the name of an alias", kAnchorHint},
      Plain{Msg::CHAR_IN_ANCHOR, "expected a blank after the name of an anchor", kAnchorHint},
      Plain{Msg::MULTIPLE_ANCHORS, "expected one anchor", "remove the second one"},
      Plain{Msg::MULTIPLE_TAGS, "expected no type tags", kTagHint},
      Plain{Msg::CHAR_IN_TAG_HANDLE, "expected no type tags", kTagHint},
      Plain{Msg::TAG_WITH_NO_SUFFIX, "expected no type tags", kTagHint},
      Plain{Msg::END_OF_VERBATIM_TAG, "expected no type tags", kTagHint},
      Plain{Msg::YAML_DIRECTIVE_ARGS, "expected no directive", kDirectiveHint},
      Plain{Msg::YAML_VERSION, "expected no directive", kDirectiveHint},
      Plain{Msg::YAML_MAJOR_VERSION, "expected no directive", kDirectiveHint},
      Plain{Msg::REPEATED_YAML_DIRECTIVE, "expected no directive", kDirectiveHint},
      Plain{Msg::TAG_DIRECTIVE_ARGS, "expected no directive", kDirectiveHint},
      Plain{Msg::REPEATED_TAG_DIRECTIVE, "expected no directive", kDirectiveHint},
  };
  const auto found = std::find_if(all.begin(), all.end(), [&](const Plain& plain) { return message.starts_with(plain.message); });
  return found == all.end() ? nullptr : &*found;
}

Told told(std::string_view message, const Place& place, const YamlContext& context) {
  namespace Msg = YAML::ErrorMsg;
  const bool of_indentation = message == Msg::END_OF_SEQ || message == Msg::END_OF_MAP || message == Msg::MAP_VALUE || message == Msg::BLOCK_ENTRY;
  const std::size_t tab = of_indentation ? tab_of(place.before) : std::string_view::npos;
  if (tab != std::string_view::npos) return of_tab(place, tab);
  if (message == Msg::TAB_IN_INDENTATION) return of_tab(place, place.before.size());
  if (message == Msg::END_OF_SEQ_FLOW || message == Msg::END_OF_MAP_FLOW) return of_brackets(place, context, message == Msg::END_OF_SEQ_FLOW);
  if (message == Msg::END_OF_SEQ || message == Msg::END_OF_MAP) return of_block(place, context);
  if (message == Msg::MAP_VALUE) return of_colon(place);
  for (const char* escape : {Msg::INVALID_ESCAPE, Msg::INVALID_HEX, Msg::INVALID_UNICODE}) {
    if (message.starts_with(escape)) return of_escape(place);
  }
  if (message == Msg::ZERO_INDENT_IN_BLOCK || message == Msg::CHAR_IN_BLOCK) return of_block_text(place);
  if (const Plain* plain = plain_of(message)) return {place.at, plain->expected, place.found(), plain->hint};
  return {place.at, "expected YAML", shown(message), ""};
}

}  // namespace

std::size_t byte_of(std::string_view text, Mark mark) {
  std::size_t begin = 0;
  for (int line = 1; line < mark.line; ++line) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string_view::npos) return text.size();
    begin = end + 1;
  }
  return std::min(begin + static_cast<std::size_t>(mark.column - 1), text.size());
}

std::size_t unclosed_quote(std::string_view text, std::size_t begin) {
  constexpr std::string_view openers = " \t\r\n[{,:";
  for (std::size_t i = begin; i < text.size(); ++i) {
    const bool opens = i == begin || openers.find(text[i - 1]) != std::string_view::npos;
    if (opens && text[i] == '#') i = std::min(text.find('\n', i), text.size());
    if (i >= text.size() || !opens || (text[i] != '\'' && text[i] != '"')) continue;
    const char quote = text[i];
    std::size_t end = i + 1;
    for (; end < text.size(); ++end) {
      const bool escaped = quote == '"' ? text[end] == '\\' : text.substr(end, 2) == "''";
      if (escaped) {
        ++end;
      } else if (text[end] == quote) {
        break;
      }
    }
    if (end >= text.size()) return i;
    i = end;
  }
  return std::string_view::npos;
}

void add_unclosed_quote(std::size_t begin, std::uint32_t source, std::string_view text, FaultList& faults) {
  const std::string_view above = text.substr(0, begin);
  const std::size_t line_begin = above.rfind('\n') + 1;  // npos + 1 is 0
  const Mark at{source, static_cast<int>(std::count(above.begin(), above.end(), '\n')) + 1, static_cast<int>(begin - line_begin) + 1};
  faults.add(at, "", std::string("expected a closing ") + text[begin], "none", "the text in quotes that begins here has no end");
}

void add_yaml_fault(std::string_view message, Mark at, const YamlContext& context, FaultList& faults) {
  if (message == YAML::ErrorMsg::EOF_IN_SCALAR || message == YAML::ErrorMsg::DOC_IN_SCALAR) {
    const std::size_t begin = byte_of(context.text, context.last);
    const std::size_t quote = unclosed_quote(context.text.substr(0, byte_of(context.text, at)), begin);
    if (quote != std::string_view::npos) return add_unclosed_quote(quote, at.source, context.text, faults);
  }
  Told fault = told(message, Place(context.text, at), context);
  faults.add(fault.at, "", std::move(fault.expected), std::move(fault.found), std::move(fault.hint));
}

}  // namespace supple::scenes
