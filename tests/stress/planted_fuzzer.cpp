#include <atomic>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "fuzzers.h"

namespace supple::stress {
namespace {

[[noreturn]] void refuse(const std::string& place) {
  throw Error(ErrorKind::Scene, Fault{.place = place, .key = {}, .expected = "expected another scene", .found = {}, .hint = {}});
}

void spin(double seconds) {
  static std::atomic<bool> never{false};
  const Meter meter;
  while (!never && (seconds < 0.0 || meter.processor_s() < seconds)) {
  }
}

void go_wrong(const std::string& plant) {
  if (plant == "crash") std::abort();
  if (plant == "hang") spin(-1.0);
  if (plant == "slow") spin(1.5 * kMostSeconds * slowness());
  if (plant == "contract") throw ContractViolation("planted");
  if (plant == "internal") throw std::logic_error("planted");
  if (plant == "place") refuse("fuzz.yaml");
  if (plant == "memory") {
    const auto bytes = static_cast<std::size_t>(1.5 * kMostBytes * slowness());
    const std::unique_ptr<char[]> memory(new char[bytes]);
    std::memset(memory.get(), 1, bytes);
    if (memory[bytes / 2] == 0) return;  // so that it is not left out
  }
  refuse("fuzz.yaml:1:1");
}

}  // namespace

Fuzzer planted_fuzzer(const std::string& plant) {
  Fuzzer fuzzer;
  fuzzer.limits.processor_s = 2.0;
  fuzzer.trial = [plant](std::uint64_t) { return judged("fuzz.yaml", [&] { go_wrong(plant); }); };
  fuzzer.keep = [](const FoundFault&) { return std::filesystem::path(); };
  return fuzzer;
}

}  // namespace supple::stress
