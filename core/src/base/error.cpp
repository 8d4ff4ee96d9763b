#include "supple/core/error.h"

#include <algorithm>
#include <utility>

#include "supple/core/printable.h"

namespace supple {
namespace {

/// Length of the UTF-8 character that a text begins with, or 0 where it is malformed.
std::size_t character_length(std::string_view text) {
  const auto byte = [text](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0U; };
  const unsigned first = byte(0);
  const std::size_t length = first < 0x80U ? 1 : first >= 0xC2U && first <= 0xDFU ? 2 : (first & 0xF0U) == 0xE0U ? 3 : first >= 0xF0U && first <= 0xF4U ? 4 : 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(k) & 0xC0U) != 0x80U) return 0;
  }
  return length;
}

std::string join(const std::vector<Fault>& faults) {
  std::string text;
  for (const Fault& fault : faults) {
    if (!text.empty()) text += '\n';
    text += fault.message();
  }
  return text;
}

std::vector<Fault> require_some(std::vector<Fault> faults) {
  SUPPLE_EXPECTS(!faults.empty());
  return faults;
}

/// Of a valid character: C1 controls start sequences on some terminals, as ESC does; those of U+2028 to U+202E and U+2066 to U+2069
/// separate lines and change the order in which a terminal shows what follows.
bool is_control(std::string_view character) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(character[k]); };
  if (byte(0) == 0xE2U) return (byte(1) == 0x80U && byte(2) >= 0xA8U && byte(2) <= 0xAEU) || (byte(1) == 0x81U && byte(2) >= 0xA6U && byte(2) <= 0xA9U);
  return byte(0) < 0x20U || byte(0) == 0x7FU || (byte(0) == 0xC2U && byte(1) < 0xA0U);
}

}  // namespace

std::string printable(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t length = character_length(text);
    const std::string_view character = text.substr(0, std::max<std::size_t>(length, 1));
    if (length == 0 || is_control(character)) {
      constexpr std::string_view kDigits = "0123456789abcdef";
      for (const char c : character) {
        const auto byte = static_cast<unsigned char>(c);
        out.append("\\x") += kDigits[byte >> 4U];
        out += kDigits[byte & 15U];
      }
    } else {
      out += character;
    }
    text.remove_prefix(character.size());
  }
  return out;
}

std::string Fault::message() const {
  std::string text = place;
  const auto append = [&text](std::string_view separator, const std::string& part) {
    if (part.empty()) return;
    if (!text.empty()) text += separator;
    text += part;
  };
  append(": ", key);
  append(": ", expected);
  if (!found.empty()) append(expected.empty() ? ": " : ", ", "found " + found);
  append("; ", hint);
  return printable(text);
}

Error::Error(ErrorKind kind, Fault fault) : Error(kind, std::vector<Fault>{std::move(fault)}) {}

Error::Error(ErrorKind kind, std::vector<Fault> faults)
    : std::runtime_error(join(faults)), kind_(kind), faults_(require_some(std::move(faults))) {}

namespace detail {

void contract_failed(const char* condition, const char* file, int line) {
  throw ContractViolation(std::string(file) + ':' + std::to_string(line) + ": precondition broken: " + condition);
}

}  // namespace detail
}  // namespace supple
