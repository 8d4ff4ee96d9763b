#include "supple/scenes/limits.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "file/read_scene_faults.h"
#include "file/scene_places.h"

namespace supple::scenes {
namespace {

/// By Counted. Measured as the growth of the resident memory of `supple check` with their number, on x86-64.
constexpr std::array<CountRule, 11> kRules{{{"particles", "use fewer", 510.0},
                                           {"primitives", "use fewer per particle, or on fewer particles", 1250.0},
                                           {"bonds", "use fewer neighbours, or a shorter distance", 680.0},
                                           {"bonds of friction", "use fewer neighbours, or a shorter distance", 40.0},
                                           {"pairs of neighbours", "use a shorter range", 24.0},
                                           {"laws between objects", "use fewer objects with repulsion, or unite them in one object", 1000.0},
                                           {"bodies", "unite particles in one body", 11500.0},
                                           {"surface samples", "use a larger contact.sample_spacing, or thicker parts", 300.0},
                                           {"bytes of its file", "use a smaller file", 6.0},
                                           {"pixels of a texture", "use a smaller picture", 6.0},
                                           {"samples of an image", "use a smaller image, or fewer samples per pixel", 24.0, true}}};
constexpr std::string_view kUnits = "kMGT";

std::string whole_text(double number) {
  constexpr double kLongest = 1e15;  // that is shown digit by digit
  return number < kLongest ? std::to_string(static_cast<long long>(number)) : short_text(number);
}

}  // namespace

const CountRule& rule_of(Counted what) { return kRules[static_cast<std::size_t>(what)]; }

double SceneCounts::bytes() const {
  double sum = 0.0;
  for (const Count& c : count) sum += c.bytes();
  return sum;
}

double SceneCounts::undrawn_bytes() const {
  double sum = 0.0;
  for (const Count& c : count) sum += rule_of(c.what).drawn ? 0.0 : c.bytes();
  return sum;
}

void expect_within(const Scene& scene, const SceneCounts& counts, double memory) {
  const double bytes = counts.bytes();
  if (bytes <= memory) return;
  const Count& most = *std::max_element(counts.count.begin(), counts.count.end(), [](const Count& a, const Count& b) { return a.bytes() < b.bytes(); });
  const CountRule& rule = rule_of(most.what);
  const double room = std::max(0.0, memory - (bytes - most.bytes()));
  Fault fault{.place = place_of(scene, most.key),
              .key = most.key,
              .expected = "expected at most " + whole_text(room / rule.bytes) + ' ' + std::string(rule.name) + " in " + bytes_text(memory) + " of memory",
              .found = count_text(most),
              .hint = std::string(rule.hint) + ", or allow more memory: --memory "};
  constexpr double kDigit = 0.1e9;  // that hints are rounded up to
  fault.hint += short_text(std::ceil(1.05 * bytes / kDigit) * kDigit * 1e-9) + 'G';
  throw OverBudget(std::move(fault), counts);
}

std::string count_text(const Count& count) { return (count.estimated ? "about " : "") + whole_text(count.number); }

std::string bytes_text(double bytes) {
  constexpr double kStep = 1e3;
  std::size_t unit = 0;
  double value = bytes / kStep;
  while (value >= kStep && unit + 1 < kUnits.size()) {
    value /= kStep;
    ++unit;
  }
  return bytes < kStep ? short_text(bytes) + " bytes" : short_text(std::round(10.0 * value) / 10.0) + ' ' + kUnits[unit] + 'B';
}

double parse_bytes(std::string_view text) {
  constexpr double kNotBytes = std::numeric_limits<double>::quiet_NaN(), kStep = 1e3;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || !(value > 0.0)) return kNotBytes;
  std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
  if (unit.starts_with(' ')) unit.remove_prefix(1);
  if (unit.ends_with('B')) unit.remove_suffix(1);
  if (unit.empty() && text.ends_with('B')) return std::isfinite(value) ? value : kNotBytes;
  if (unit.empty()) unit = "G";
  const std::size_t power = unit == "K" ? 0 : kUnits.find(unit);
  if (unit.size() != 1 || power == std::string_view::npos) return kNotBytes;
  const double bytes = value * std::pow(kStep, static_cast<double>(power) + 1.0);
  return std::isfinite(bytes) ? bytes : kNotBytes;
}

}  // namespace supple::scenes
