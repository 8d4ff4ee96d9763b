#include "srgb.h"

#include <algorithm>
#include <cmath>

namespace supple::render {
namespace {

double light_of(double encoded) { return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4); }

struct Steps {
  static constexpr int kParts = 4096;               // of light; in each the value rises by one at most (12.92 * 255 / 4096 < 1)
  std::array<double, 256> from{};                   // least light of a value
  std::array<std::uint8_t, kParts + 1> at_least{};  // value at the begin of a part
  Steps() {
    for (std::size_t value = 1; value < from.size(); ++value) from[value] = light_of((static_cast<double>(value) - 0.5) / 255.0);
    std::uint8_t value = 0;
    for (std::size_t part = 0; part <= kParts; ++part) {
      while (value < 255 && static_cast<double>(part) / kParts >= from[value + 1u]) ++value;
      at_least[part] = value;
    }
  }
};

}  // namespace

const std::array<double, 256>& linear_of_srgb() {
  static const std::array<double, 256> light = [] {
    std::array<double, 256> out{};
    for (std::size_t value = 0; value < out.size(); ++value) out[value] = light_of(static_cast<double>(value) / 255.0);
    return out;
  }();
  return light;
}

std::uint8_t srgb_of_linear(double light) {
  static const Steps steps;
  const double v = std::clamp(light, 0.0, 1.0);
  const std::uint8_t value = steps.at_least[static_cast<std::size_t>(v * Steps::kParts)];
  return value < 255 && v >= steps.from[value + 1u] ? value + 1 : value;
}

}  // namespace supple::render
