/// @file plane.h
/// One number a pixel, eight pixels at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "lanes.h"

namespace supple::render::path {

/// Rows from the top; kMargin zeros around them and up to whole lanes, so that filters need no borders.
class Plane {
 public:
  static constexpr int kMargin = 16;

  /// All zeros, unless it has that size already.
  void resize(int width, int height) {
    if (width == width_ && height == height_) return;
    width_ = width;
    height_ = height;
    pitch_ = (width + 2 * kMargin + static_cast<int>(kLanes) - 1) / static_cast<int>(kLanes) * static_cast<int>(kLanes);
    // Planes that lie one after the other begin at different places of their pages, as the sets of a cache go by those.
    lead_ = static_cast<std::ptrdiff_t>(reinterpret_cast<std::uintptr_t>(this) / sizeof(Plane) % 64 * kCacheLine);
    values_.assign(static_cast<std::size_t>(lead_ + std::ptrdiff_t{pitch_} * (height + 2 * kMargin)), 0.0F);
  }
  [[nodiscard]] float& at(int x, int y) { return *pixel(x, y); }
  [[nodiscard]] float at(int x, int y) const { return *pixel(x, y); }
  /// The pixels x to x + 7.
  [[nodiscard]] Lanes load(int x, int y) const { return _mm256_loadu_ps(pixel(x, y)); }
  void store(int x, int y, Lanes v) { _mm256_storeu_ps(pixel(x, y), v); }
  /// The pixel x alone.
  void store(int x, int y, float v) { at(x, y) = v; }
  [[nodiscard]] float* pixel(int x, int y) { return values_.data() + offset(x, y); }
  [[nodiscard]] const float* pixel(int x, int y) const { return values_.data() + offset(x, y); }

 private:
  static constexpr std::size_t kCacheLine = 16;  // numbers
  [[nodiscard]] std::ptrdiff_t offset(int x, int y) const { return lead_ + static_cast<std::ptrdiff_t>(y + kMargin) * pitch_ + x + kMargin; }
  int width_ = 0, height_ = 0;
  int pitch_ = 0;
  std::ptrdiff_t lead_ = 0;
  std::vector<float> values_;
};

/// One vector a pixel.
struct VectorPlane {
  Plane x, y, z;
  void resize(int width, int height) {
    for (Plane* plane : {&x, &y, &z}) plane->resize(width, height);
  }
  [[nodiscard]] Vec3f at(int px, int py) const { return {x.at(px, py), y.at(px, py), z.at(px, py)}; }
  [[nodiscard]] Vec3Lanes load(int px, int py) const { return {x.load(px, py), y.load(px, py), z.load(px, py)}; }
  template <class Vector>
  void store(int px, int py, const Vector& v) {
    x.store(px, py, v.x());
    y.store(px, py, v.y());
    z.store(px, py, v.z());
  }
};

/// Sums over the (2 reach + 1)^2 pixels around, whose weights fall linearly from (reach + 1)^2 in the middle.
template <int reach>
[[nodiscard]] Lanes tent_sum(const Plane& plane, int x, int y) {
  Lanes sum{};
  for (int dy = -reach; dy <= reach; ++dy) {
    Lanes row{};
    for (int dx = -reach; dx <= reach; ++dx) row += plane.load(x + dx, y + dy) * static_cast<float>(reach + 1 - std::abs(dx));
    sum += row * static_cast<float>(reach + 1 - std::abs(dy));
  }
  return sum;
}

}  // namespace supple::render::path
