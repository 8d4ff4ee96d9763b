/// @file contact_pile.cpp
/// Many balls in a bin, one JSON object per line: CPU time of a step once they have settled, and after they have fallen asleep;
/// mean CPU time of a step over the quarter of a second with most impacts. From 10,000 balls on they start almost at rest, in whole
/// layers, and ten steps are measured. On an idle machine the wall time of the fastest step shows the gain by threads:
/// `contact_pile 100 --threads 2`.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "programs.h"
#include "supple/core/cpu_time.h"
#include "supple/core/hash.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::scenes;

constexpr int kMany = 10000;
constexpr double kDiameter = 0.1;

std::string pile(int count, bool sleeps) {
  const bool many = count >= kMany;
  const int side = std::max(2, static_cast<int>(std::ceil(std::cbrt(count) - 1e-9)));
  const int layer = side * side, layers = (count + layer - 1) / layer;
  const double spacing = many ? 0.985 * kDiameter : 1.1 * kDiameter;  // many: pressed a little on all sides
  const double wall = 0.5 * side * spacing + (many ? 0.0 : 0.1 * kDiameter);
  const auto text = [](double x) { return std::to_string(x); };
  const auto grid = [&](const char* name, int columns, int rows, int high, double z) {
    const auto whole = [](int n) { return std::to_string(n); };
    return "  - name: " + std::string(name) + "\n    particles: {arrange: grid, columns: " + whole(columns) + ", rows: " + whole(rows) +
           ", layers: " + whole(high) + ", spacing: " + text(spacing) + ", disorder: " + text(many ? 5e-4 : 4e-3) + ", at: [0, 0, " + text(z) +
           "], mass: 0.05}\n    separate: true\n"
           "    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.075, thickness: 0.05, slope: 10}}]\n"
           "    contact: {modulus: 4e4, friction: 0.3, dissipation: 0.5}\n    medium: {linear: 2, angular: 2}\n";
  };
  // What is short of a whole layer lies on the others: whole rows, and a part of one above them.
  const int whole = many ? layers : count / layer, rows = many ? 0 : count % layer / side, rest = many ? 0 : count % side;
  std::string balls = whole > 0 ? grid("balls", side, side, whole, 0.5 * whole * spacing) : "";
  if (rows > 0) balls += grid("rows", side, rows, 1, (whole + 0.5) * spacing);
  if (rest > 0) balls += grid("rest", rest, 1, 1, (whole + (rows > 0 ? 1.5 : 0.5)) * spacing);
  const auto plane = [&](const char* name, double x, double y) {
    return "  - {name: " + std::string(name) + ", shape: plane, at: [" + text(x) + ", " + text(y) + ", 0], normal: [" +
           text(-x) + ", " + text(-y) + ", 0]}\n";
  };
  return "schema: 1\nduration: 20 s\nframe_rate: 24\ntime_step: {substeps: 64}\ngravity: [0, 0, -9.81]\ncontact: {error: 0.01}\n" +
         std::string(sleeps ? "sleep: {speed: 0.02, time: 0.1}\n" : "") +
         "objects:\n" + balls + "ground: {height: 0}\nobstacles:\n" +
         plane("left", -wall, 0) + plane("right", wall, 0) + plane("front", 0, -wall) + plane("back", 0, wall);
}

double peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

void measure(int count, bool sleeps, int threads) {
  const double begin = process_cpu_seconds();
  Simulation simulation(parse_scene(pile(count, sleeps), "pile.yaml", "."), {.threads = threads});
  const double made = process_cpu_seconds() - begin;
  constexpr int kSettle = 3072;  // two seconds
  const int steps = count < kMany ? 40 : 10;
  constexpr int kFallFrom = 384, kFallTo = 768;  // most balls of a thousand meet then
  double falling = 0.0;
  for (int k = 0; k < kSettle && count < kMany; ++k) {
    if (k == kFallFrom || k == kFallTo) falling = process_cpu_seconds() - falling;  // the difference at the second
    simulation.step();
  }
  double least = std::numeric_limits<double>::infinity(), shortest = least, all = 0.0;
  for (int k = 0; k < steps; ++k) {
    const double before = process_cpu_seconds();
    const auto begun = std::chrono::steady_clock::now();
    simulation.step();
    shortest = std::min(shortest, std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
    const double step = process_cpu_seconds() - before;
    least = std::min(least, step);
    all += step;
  }
  const double memory = peak_mb();
  const auto& island = simulation.state().sleep.island;
  const auto asleep = std::count_if(island.begin(), island.end(), [](std::uint32_t i) { return i != collision::SleepState::kAwake; });
  const auto& summary = simulation.contacts().summary;
  const std::size_t contacts = summary.size();
  const auto polar = std::count_if(summary.begin(), summary.end(), [](const auto& s) { return s.rule == collision::ContactRule::Polar; });
  double fastest = 0.0;
  for (const Vec3& v : simulation.state().particles.velocity) fastest = std::max(fastest, v.norm());
  std::printf("{\"name\": \"collision/pile/balls=%zu%s,threads=%d\", \"cpu_ms_step_min\": %.4g, \"wall_ms_step_min\": %.4g, \"cpu_ms_step_mean\": %.4g, \"cpu_ms_step_falling\": %.4g, \"contacts\": %zu, \"by_polar\": %td, "
              "\"cpu_us_contact\": %.3g, \"asleep\": %td, \"largest_speed\": %.2g, \"made_cpu_s\": %.3g, \"peak_mb\": %.0f, \"hash\": \"%s\"}\n",
              simulation.bodies().size(), sleeps ? ",sleep" : "", threads, 1e3 * least, 1e3 * shortest, 1e3 * all / steps,
              count < kMany ? 1e3 * falling / (kFallTo - kFallFrom) : 0.0, contacts, polar,
              1e6 * least / static_cast<double>(std::max<std::size_t>(contacts, 1)), asleep, fastest, made, memory,
              to_hex(simulation.state_hash()).c_str());
  std::fflush(stdout);
}

}  // namespace

int supple::benchmarks::programs::contact_pile(int argc, char** argv) {
  using supple::benchmarks::whole_number;
  constexpr std::string_view kUsage = "contact_pile [BALLS ...] [--threads N]    from 10,000 balls on the last layer is filled";
  supple::benchmarks::answer_usage(argc, argv, kUsage, std::numeric_limits<std::size_t>::max(), {{"--threads", 1}});
  std::vector<int> counts;
  int threads = 1;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--threads" && i + 1 < argc) {
      threads = whole_number(kUsage, argv[++i]);
    } else {
      counts.push_back(whole_number(kUsage, argv[i]));
    }
  }
  if (counts.empty()) counts = {10, 100, 1000, 100000};
  for (const int count : counts) {
    measure(count, false, threads);
    if (count < kMany) measure(count, true, threads);
  }
  return 0;
}
