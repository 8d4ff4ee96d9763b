/// @file supple_bench.cpp
/// All benchmarks as one program, which links the libraries once:
///   supple_bench NAME [ARGUMENT...]
/// Under the name of a benchmark (a link core_bench to this file) it is that benchmark.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include "programs.h"

namespace {

struct Program {
  std::string_view name;
  int (*main)(int argc, char** argv);
};

#define SUPPLE_BENCHMARK(name) Program{#name, supple::benchmarks::programs::name},
constexpr std::array kPrograms{
#include "supple_bench_programs.inc"  // those of the modules that this build has
};
#undef SUPPLE_BENCHMARK

const Program* named(std::string_view name) {
  const auto found = std::find_if(kPrograms.begin(), kPrograms.end(), [&](const Program& program) { return program.name == name; });
  return found == kPrograms.end() ? nullptr : &*found;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 0) {
    if (const Program* program = named(std::filesystem::path(argv[0]).filename().string())) return program->main(argc, argv);
  }
  if (argc > 1) {
    if (const Program* program = named(argv[1])) return program->main(argc - 1, argv + 1);
  }
  const std::string_view word = argc > 1 ? argv[1] : "";
  const bool asks = word == "-h" || word == "--help";
  std::string known;
  for (const Program& program : kPrograms) known.append(known.empty() ? "" : ", ").append(program.name);
  if (!asks) std::fprintf(stderr, "error: expected a benchmark, found '%.*s'\n", static_cast<int>(word.size()), word.data());
  std::fprintf(asks ? stdout : stderr, "usage: supple_bench NAME [ARGUMENT...]    NAME: %s\n", known.c_str());
  return asks ? 0 : 2;
}
