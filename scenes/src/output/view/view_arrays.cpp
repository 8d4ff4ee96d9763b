#include "output/view/view_arrays.h"

#include <libdeflate.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>

#include "supple/core/error.h"

namespace supple::scenes {

void append_differences(std::string& out, std::span<const std::uint32_t> values, int width, std::size_t stride) {
  SUPPLE_EXPECTS(width >= 1 && width <= 4 && stride > 0);
  const std::size_t start = out.size(), count = values.size();
  out.resize(start + count * static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < count; ++i) {
    const auto difference = static_cast<std::int32_t>(values[i] - (i < stride ? 0U : values[i - stride]));
    const auto folded = (static_cast<std::uint32_t>(difference) << 1U) ^ static_cast<std::uint32_t>(difference >> 31);
    for (int k = 0; k < width; ++k) out[start + static_cast<std::size_t>(k) * count + i] = static_cast<char>((folded >> (8U * static_cast<unsigned>(k))) & 0xFFU);
  }
}

int difference_width(std::size_t count) {
  const std::size_t largest = 2 * count;  // with the sign
  return largest <= 0x100 ? 1 : largest <= 0x10000 ? 2 : largest <= 0x1000000 ? 3 : 4;
}

GridPoints on_grid(std::span<const Vec3> points) {
  constexpr double kNodes = 16384.0;
  GridPoints grid;
  if (points.empty()) return grid;
  Vec3 low = points.front(), high = points.front();
  for (const Vec3& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  grid.origin = low;
  grid.step = std::max((high - low).maxCoeff(), 1e-30) / (kNodes - 1.0);
  grid.node.reserve(3 * points.size());
  for (const Vec3& p : points) {
    for (int k = 0; k < 3; ++k) grid.node.push_back(static_cast<std::uint32_t>(std::lround((p[k] - grid.origin[k]) / grid.step)));
  }
  return grid;
}

std::vector<std::uint32_t> on_octahedron(std::span<const Vec3> normals) {
  std::vector<std::uint32_t> out;
  out.reserve(2 * normals.size());
  for (const Vec3& n : normals) {
    const double sum = std::max(n.lpNorm<1>(), 1e-30);
    double u = n.x() / sum, v = n.y() / sum;
    if (n.z() < 0.0) {  // the lower half is folded over the diagonals
      const double above = u;
      u = (1.0 - std::abs(v)) * (above < 0.0 ? -1.0 : 1.0);
      v = (1.0 - std::abs(above)) * (v < 0.0 ? -1.0 : 1.0);
    }
    for (const double side : {u, v}) out.push_back(static_cast<std::uint32_t>(std::lround(std::clamp(127.5 * (side + 1.0), 0.0, 255.0))));
  }
  return out;
}

std::string compress(std::string_view bytes) {
  constexpr int kLevel = 9;
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(libdeflate_alloc_compressor(kLevel),
                                                                                                libdeflate_free_compressor);
  if (!compressor) throw std::bad_alloc();
  std::string out(libdeflate_zlib_compress_bound(compressor.get(), bytes.size()), '\0');
  out.resize(libdeflate_zlib_compress(compressor.get(), bytes.data(), bytes.size(), out.data(), out.size()));
  return out;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t there = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = (word << 8U) | (k < there ? static_cast<std::uint8_t>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) out += k <= there ? kDigits[(word >> (18U - 6U * k)) & 63U] : '=';
  }
  return out;
}

}  // namespace supple::scenes
