// Thousands of almost valid inputs for the libraries, in a watched process. Prints one JSON object: numbers of trials and of refused
// inputs, and every fault with the file that shows it. Exit code 1 when there is a fault.
//   stress_inputs scenes|files|states|frames --count N --seed S --first N --sources DIR --scratch DIR
//   stress_inputs scenes ... --write only       writes the inputs as files and tries none
//   stress_inputs planted --plant KIND          trials with planted faults (fuzzers.h)
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "fuzzers.h"

namespace {

using namespace supple::stress;

constexpr const char* kUsage = "usage: stress_inputs scenes|files|states|frames|planted [--count N] [--seed S] [--first N] [--sources DIR] [--scratch DIR] [--write only] [--plant KIND]\n";
constexpr std::size_t kMostKept = 40;  // files of faults

struct Arguments {
  std::string what;
  std::string plant = "none";
  bool only_write = false;
  std::uint64_t count = 100, first = 0;
  FuzzSettings settings;
};

[[noreturn]] void leave_with_usage() {
  std::fputs(kUsage, stderr);
  std::exit(2);
}

Arguments read_arguments(int argc, char** argv) {
  if (argc < 2) leave_with_usage();
  Arguments a;
  a.what = argv[1];
  for (int k = 2; k + 1 < argc; k += 2) {
    const std::string_view name = argv[k];
    const char* value = argv[k + 1];
    if (name == "--count") {
      a.count = std::strtoull(value, nullptr, 10);
    } else if (name == "--seed") {
      a.settings.seed = std::strtoull(value, nullptr, 10);
    } else if (name == "--first") {
      a.first = std::strtoull(value, nullptr, 10);
    } else if (name == "--sources") {
      a.settings.sources = value;
    } else if (name == "--scratch") {
      a.settings.scratch = value;
    } else if (name == "--write") {
      a.only_write = true;
    } else if (name == "--plant") {
      a.plant = value;
    } else {
      leave_with_usage();
    }
  }
  return a;
}

Fuzzer fuzzer_of(const Arguments& a) {
  if (a.what == "scenes") return scene_fuzzer(a.settings);
  if (a.what == "files") return file_fuzzer(a.settings);
  if (a.what == "states") return state_fuzzer(a.settings);
  if (a.what == "frames") return frames_fuzzer(a.settings);
  if (a.what == "planted") return planted_fuzzer(a.plant);
  leave_with_usage();
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments = read_arguments(argc, argv);
  std::filesystem::create_directories(arguments.settings.scratch);
  const Fuzzer fuzzer = fuzzer_of(arguments);
  if (arguments.only_write) {
    for (std::uint64_t k = arguments.first; k < arguments.first + arguments.count; ++k) (void)fuzzer.keep({k, kAsItIs});
    return 0;
  }
  const Tally tally = watch(arguments.first, arguments.count, fuzzer.limits, arguments.settings.scratch / (arguments.what + ".log"), fuzzer.trial);
  nlohmann::json faults = nlohmann::json::array();
  for (const FoundFault& found : tally.faults) {
    const std::string file = faults.size() < kMostKept ? fuzzer.keep(found).string() : "";
    faults.push_back({{"number", found.number}, {"what", found.what}, {"file", file}});
  }
  const nlohmann::json result{{"tried", tally.tried}, {"refused", tally.refused}, {"faults", faults}};
  std::puts(result.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace).c_str());
  return tally.faults.empty() ? 0 : 1;
}
