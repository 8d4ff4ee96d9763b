/// Arrays of numbers in few bytes, for the viewer (viewer/README.md).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/types.h"

namespace supple::scenes {

/// Appends values as differences to the value `stride` places before (the first ones to 0), with signs in the lowest bit, byte by byte of
/// all values: bytes of small differences are mostly equal and compress well.
/// @param width  bytes of a difference, 1 to 4   @pre all differences fit
void append_differences(std::string& out, std::span<const std::uint32_t> values, int width, std::size_t stride);

/// Bytes that hold the differences of values below `count`.
[[nodiscard]] int difference_width(std::size_t count);

/// Points on a grid of 2^14 nodes along the longest side of their box.
struct GridPoints {
  Vec3 origin = Vec3::Zero();        ///< [m]
  double step = 0.0;                 ///< between nodes [m]; points move by at most half of it in each direction
  std::vector<std::uint32_t> node;   ///< x, y, z of each point
};
[[nodiscard]] GridPoints on_grid(std::span<const Vec3> points);

/// Unit vectors on a square of 8 bits a side: the octahedron unfolded (Meyer et al. 2010), two values each. The error is below one degree.
[[nodiscard]] std::vector<std::uint32_t> on_octahedron(std::span<const Vec3> normals);

/// zlib. @throws std::bad_alloc
[[nodiscard]] std::string compress(std::string_view bytes);
[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace supple::scenes
