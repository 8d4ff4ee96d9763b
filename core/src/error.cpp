#include "supple/core/error.h"

#include <utility>

namespace supple {
namespace {

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

}  // namespace

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
  return text;
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
