/// @file plane.h
/// One number per pixel, eight pixels at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "path/lanes.h"

namespace supple::render::path {

/// Rows from the top; kMargin zeros around them and up to whole lanes, so that filters need no borders.
class Plane {
 public:
  static constexpr int kMargin = 16;
  Plane() = default;
  Plane(Plane&&) = default;
  Plane& operator=(Plane&&) = default;

  /// All zeros, unless it has that size already.
  void resize(int width, int height) {
    if (width == width_ && height == height_) return;
    width_ = width;
    height_ = height;
    pitch_ = (width + 2 * kMargin + static_cast<int>(kLanes) - 1) / static_cast<int>(kLanes) * static_cast<int>(kLanes);
    // Planes that lie one after the other begin at different places of their pages, as the sets of a cache go by those.
    const std::size_t lead = reinterpret_cast<std::uintptr_t>(this) / sizeof(Plane) % 64 * kCacheLine;
    values_.assign(lead + kCacheLine + static_cast<std::size_t>(pitch_ * (height + 2 * kMargin)), 0.0F);
    // Eight pixels of a tile never lie in two lines.
    const std::size_t off = reinterpret_cast<std::uintptr_t>(values_.data()) / sizeof(float) % kCacheLine;
    first_ = values_.data() + (lead + kCacheLine - off) + index(kMargin, kMargin);
  }
  /// Offset of a pixel, or from one pixel to another; the same in all planes of one size.
  [[nodiscard]] std::ptrdiff_t index(int x, int y) const { return std::ptrdiff_t{y} * pitch_ + x; }
  [[nodiscard]] float& at(int x, int y) { return first_[index(x, y)]; }
  [[nodiscard]] float at(int x, int y) const { return first_[index(x, y)]; }
  /// That pixel and the seven to its right.
  [[nodiscard]] Lanes load(std::ptrdiff_t index) const { return _mm256_loadu_ps(first_ + index); }
  [[nodiscard]] Lanes load(int x, int y) const { return load(index(x, y)); }
  void prefetch(std::ptrdiff_t index) const { __builtin_prefetch(first_ + index); }
  void store(std::ptrdiff_t index, Lanes v) { _mm256_storeu_ps(first_ + index, v); }
  void store(int x, int y, Lanes v) { store(index(x, y), v); }
  /// The pixel x alone.
  void store(int x, int y, float v) { at(x, y) = v; }

 private:
  static constexpr std::size_t kCacheLine = 16;  // numbers
  int width_ = 0, height_ = 0;
  int pitch_ = 0;
  float* first_ = nullptr;  ///< the pixel (0, 0)
  std::vector<float> values_;
};

/// One vector per pixel.
struct VectorPlane {
  Plane x, y, z;
  void resize(int width, int height) {
    for (Plane* plane : {&x, &y, &z}) plane->resize(width, height);
  }
  [[nodiscard]] Vec3f at(int px, int py) const { return {x.at(px, py), y.at(px, py), z.at(px, py)}; }
  [[nodiscard]] Vec3Lanes load(std::ptrdiff_t index) const { return {x.load(index), y.load(index), z.load(index)}; }
  [[nodiscard]] Vec3Lanes load(int px, int py) const { return load(x.index(px, py)); }
  void prefetch(std::ptrdiff_t index) const {
    for (const Plane* plane : {&x, &y, &z}) plane->prefetch(index);
  }
  void store(std::ptrdiff_t index, const Vec3Lanes& v) {
    x.store(index, v.x());
    y.store(index, v.y());
    z.store(index, v.z());
  }
  template <class Vector>
  void store(int px, int py, const Vector& v) {
    x.store(px, py, v.x());
    y.store(px, py, v.y());
    z.store(px, py, v.z());
  }
};

/// Sums over the (2 reach + 1)^2 pixels around, whose weights fall linearly from (reach + 1)^2 in the middle.
template <int reach>
[[nodiscard]] Lanes tent_sum(const Plane& plane, std::ptrdiff_t index) {
  Lanes sum{};
  for (int dy = -reach; dy <= reach; ++dy) {
    Lanes row{};
    for (int dx = -reach; dx <= reach; ++dx) row += plane.load(index + plane.index(dx, dy)) * static_cast<float>(reach + 1 - std::abs(dx));
    sum += row * static_cast<float>(reach + 1 - std::abs(dy));
  }
  return sum;
}

}  // namespace supple::render::path
