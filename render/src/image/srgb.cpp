#include "image/srgb.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "supple/core/error.h"

namespace supple::render {
namespace {

double light_of(double encoded) { return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4); }

struct Steps {
  static constexpr int kParts = 4096;               // of light; in each the value rises by one at most (12.92 * 255 / 4096 < 1)
  std::array<double, 257> from{};                   // least light of a value; none reaches 256
  std::array<float, 257> from_single{};             // the least number in single precision that is no less
  std::array<std::uint8_t, kParts + 1> at_least{};  // value at the begin of a part
  Steps() {
    for (std::size_t value = 1; value < 256; ++value) from[value] = light_of((static_cast<double>(value) - 0.5) / 255.0);
    from[256] = std::numeric_limits<double>::infinity();
    for (std::size_t value = 0; value < from.size(); ++value) {
      const auto nearest = static_cast<float>(from[value]);
      from_single[value] = static_cast<double>(nearest) < from[value] ? std::nextafter(nearest, INFINITY) : nearest;
    }
    std::uint8_t value = 0;
    for (std::size_t part = 0; part <= kParts; ++part) {
      while (static_cast<double>(part) / kParts >= from[value + 1u]) ++value;
      at_least[part] = value;
    }
  }
};

const Steps& steps() {
  static const Steps made;
  return made;
}

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
  const double v = std::clamp(light, 0.0, 1.0);
  const std::uint8_t value = steps().at_least[static_cast<std::size_t>(v * Steps::kParts)];
  return v >= steps().from[value + 1u] ? value + 1 : value;
}

void srgb_of_linear(std::span<const float> light, std::span<std::uint8_t> values) {
  SUPPLE_EXPECTS(light.size() == values.size());
  const Steps& table = steps();
  for (std::size_t i = 0; i < light.size(); ++i) {
    const float v = std::clamp(light[i], 0.0F, 1.0F);
    const std::uint8_t value = table.at_least[static_cast<std::size_t>(v * static_cast<float>(Steps::kParts))];
    values[i] = static_cast<std::uint8_t>(value + static_cast<int>(v >= table.from_single[value + 1u]));
  }
}

}  // namespace supple::render
