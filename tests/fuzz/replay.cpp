// In place of libFuzzer, for any compiler: calls the target with every file of a corpus, and with changed copies of them.
//   fuzz_NAME [--changes N] FOLDER...     N changed copies of each file
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <string_view>
#include <vector>

#include "fuzz_target.h"

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes content(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Some bytes replaced, removed, doubled or exchanged.
Bytes changed(Bytes bytes, std::mt19937_64& random) {
  const auto below = [&random](std::size_t n) { return n == 0 ? std::size_t{0} : static_cast<std::size_t>(random() % n); };
  for (std::size_t left = 1 + below(4); left > 0; --left) {
    const auto at = static_cast<std::ptrdiff_t>(below(bytes.size()));
    const auto end = at + static_cast<std::ptrdiff_t>(below(std::min<std::size_t>(16, bytes.size() - static_cast<std::size_t>(at)) + 1));
    switch (bytes.empty() ? 0 : below(5)) {
      case 0: bytes.insert(bytes.begin() + at, static_cast<std::uint8_t>(below(256))); break;
      case 1: bytes[static_cast<std::size_t>(at)] ^= static_cast<std::uint8_t>(1U << below(8)); break;
      case 2: bytes.erase(bytes.begin() + at, bytes.begin() + end); break;
      case 3: {
        const Bytes part(bytes.begin() + at, bytes.begin() + end);
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(below(bytes.size())), part.begin(), part.end());
        break;
      }
      default: std::fill(bytes.begin() + at, bytes.begin() + end, static_cast<std::uint8_t>(below(2) * 255)); break;
    }
  }
  return bytes;
}

/// The input at work, in the folder from which the program was started: one that ends it is found there.
constexpr const char* kKept = "fuzz_input";

void run(const Bytes& bytes) {
  static supple::fuzz::InputFile kept(std::filesystem::current_path() / kKept);
  kept.with(bytes);
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t changes = 0, runs = 0;
  std::vector<std::filesystem::path> files;
  for (int k = 1; k < argc; ++k) {
    if (std::string_view(argv[k]) == "--changes" && k + 1 < argc) {
      changes = std::strtoull(argv[++k], nullptr, 10);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(argv[k])) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::mt19937_64 random(1);
  for (const auto& file : files) {
    const Bytes bytes = content(file);
    run(bytes);
    for (std::uint64_t k = 0; k < changes; ++k) run(changed(bytes, random));
    runs += 1 + changes;
  }
  std::filesystem::remove(kKept);
  std::printf("%llu inputs\n", static_cast<unsigned long long>(runs));
  return files.empty() ? 2 : 0;
}
