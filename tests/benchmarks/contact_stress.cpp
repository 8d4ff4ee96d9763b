// Stability of contact in extreme scenes: stiffness x mass ratio x speed at time_step.size of 1/24 s, stacks that grow heavier
// upward, balls squeezed to half their diameter, a thousand random shots. Prints the table of docs/stability.md; with a file name
// also writes the map as SVG. `--seed N` repeats the shots of a run. Exit code 1 when a run gained energy, let a body pass
// without a warning, stopped, or failed within the capacity of its contacts.
#include <array>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "programs.h"
#include "scenes/contact_stress.h"
#include "supple/core/executor.h"
#include "usage.h"

namespace {

using namespace supple::scenes;
using supple::Executor;
using stress::Outcome;
using stress::Result;

constexpr std::array<double, 8> kModulus{1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
constexpr std::array<double, 4> kRatio{1.0, 1e2, 1e4, 1e6};
constexpr std::array<double, 4> kSpeed{1.0, 5.0, 20.0, 50.0};

bool bad(const Result& r) {
  return r.outcome == Outcome::Gains || r.outcome == Outcome::Passed || r.outcome == Outcome::Stopped ||
         (r.valid && r.outcome != Outcome::Held);
}

struct Block {
  std::string name;
  std::size_t columns;
  std::vector<Result> results;  // row by row
};

/// The results in the order of the runs, which share the processors.
std::vector<Result> all_of(const std::vector<std::function<Result()>>& runs) {
  std::vector<Result> results(runs.size());
  Executor().for_blocks(runs.size(), 1, [&](std::size_t begin, std::size_t) { results[begin] = runs[begin](); });
  return results;
}

void print(const Block& b) {
  std::map<Outcome, int> count;
  int valid = 0;
  double largest = 0.0;
  for (std::size_t k = 0; k < b.results.size(); ++k) {
    const Result& r = b.results[k];
    ++count[r.outcome];
    valid += r.valid ? 1 : 0;
    if (r.outcome == Outcome::Held) largest = std::max(largest, r.energy_error);
    if (bad(r)) std::fprintf(stderr, "%s, run %zu: outcome %d %s\n", b.name.c_str(), k, static_cast<int>(r.outcome), r.reason.c_str());
  }
  std::printf("| %s | %zu | %d | %d | %d | %d | %d | %d | %.1e |\n", b.name.c_str(), b.results.size(), valid, count[Outcome::Held],
              count[Outcome::Overloaded], count[Outcome::Gains], count[Outcome::Passed], count[Outcome::Stopped], largest);
  std::fflush(stdout);
}

const char* colour(const Result& r) {
  if (bad(r)) return "#c0392b";
  return r.outcome == Outcome::Held ? "#3b6ea5" : "#e6c36a";
}

void draw(const std::vector<Block>& blocks, const std::string& file) {
  constexpr int kCell = 9, kGap = 34, kMargin = 12;
  int width = 0, height = kMargin;
  for (const Block& b : blocks) {
    const int rows = static_cast<int>((b.results.size() + b.columns - 1) / b.columns);
    width = std::max(width, 2 * kMargin + kCell * static_cast<int>(b.columns));
    height += kGap + kCell * rows;
  }
  std::ofstream out(file);
  out << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << std::max(width, 480) << "\" height=\"" << height
      << "\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  int y = kMargin;
  for (const Block& b : blocks) {
    out << "<text x=\"" << kMargin << "\" y=\"" << y + 14 << "\">" << b.name << "</text>\n";
    y += 22;
    for (std::size_t k = 0; k < b.results.size(); ++k) {
      out << "<rect x=\"" << kMargin + kCell * static_cast<int>(k % b.columns) << "\" y=\"" << y + kCell * static_cast<int>(k / b.columns)
          << "\" width=\"" << kCell - 1 << "\" height=\"" << kCell - 1 << "\" fill=\"" << colour(b.results[k]) << "\"/>\n";
    }
    y += kCell * static_cast<int>((b.results.size() + b.columns - 1) / b.columns) + kGap - 22;
  }
  out << "</svg>\n";
}

}  // namespace

int supple::benchmarks::programs::contact_stress(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_stress [--seed N] [FILE.svg]";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 3, {{"--seed", 1}});
  std::string map;
  unsigned seed = std::random_device{}();
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--seed" && i + 1 < argc) {
      seed = supple::benchmarks::whole_number(kUsage, argv[++i], 0U);
    } else {
      map = argv[i];
    }
  }
  std::vector<Block> blocks;
  const auto run = [&blocks](std::string name, std::size_t columns, const std::vector<std::function<Result()>>& runs) {
    blocks.push_back({std::move(name), columns, all_of(runs)});
    print(blocks.back());
  };
  std::printf("| what | runs | valid | held | overloaded, reported | gains energy | passes without a warning | stops | energy error of the held |\n"
              "|---|---|---|---|---|---|---|---|---|\n");
  std::vector<std::function<Result()>> meetings, stacks, squeezes, shots, cores;
  for (const double E : kModulus) {
    for (const double speed : kSpeed) {
      for (const double ratio : kRatio) meetings.emplace_back([=] { return stress::meet(E, ratio, speed); });
    }
    for (const double ratio : kRatio) {
      stacks.emplace_back([=] { return stress::stack(E, ratio); });
      squeezes.emplace_back([=] { return stress::squeeze(E, ratio); });
    }
  }
  run("two balls meet at 1, 5, 20, 50 radii/s", kRatio.size() * kSpeed.size(), meetings);
  run("a stack of ten, heavier upward", kRatio.size(), stacks);
  run("a ball between two plates, to half its diameter", kRatio.size(), squeezes);

  std::mt19937 random(seed);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  const auto draw_shot = [&uniform] {
    const double speed = uniform(10.0, 600.0);
    return std::pair(speed, 0.1 + speed * 1e-3 * uniform(0.0, 1.0));
  };
  for (int k = 0; k < 1000; ++k) shots.emplace_back([shot = draw_shot()] { return stress::shoot(shot.first, shot.second); });
  for (int k = 0; k < 1000; ++k) {
    cores.emplace_back([shot = draw_shot()] {
      Result r = stress::shoot(shot.first, shot.second, "contact: {core: barrier, error: 0.01}\n", 1e4);
      r.valid = false;
      return r;
    });
  }
  run("a thousand shots at a thin plate, up to 600 m/s", 50, shots);
  run("the same against hard cores, 10,000 times softer", 50, cores);
  int wrong = 0;
  for (const Block& b : blocks) {
    for (const Result& r : b.results) wrong += bad(r) ? 1 : 0;
  }
  std::printf("\nseed %u; %d runs did what must not happen\n", seed, wrong);
  if (!map.empty()) draw(blocks, map);
  return wrong == 0 ? 0 : 1;
}
