/// @file paint.h
/// The material at a point of an item: the same paints as the shaders', evaluated at points.
#pragma once

#include <array>
#include <vector>

#include "bsdf.h"
#include "supple/render/view.h"

namespace supple::render::path {

class PaintSource {
 public:
  PaintSource() = default;
  explicit PaintSource(const Item& item);

  /// @param corner, weight, places  the triangle's vertices, barycentric coordinates, positions
  /// @param world   the point [m]
  [[nodiscard]] Bsdf bsdf(const Item& item, const std::uint32_t* corner, const Vec3f& weight,
                          const std::array<Vec3f, 3>& places, const Vec3f& world, const Vec3f& normal, bool on_wire) const;

 private:
  [[nodiscard]] Vec3f colour(const Item& item, const std::uint32_t* corner, const Vec3f& weight,
                             const std::array<Vec3f, 3>& places, const Vec3f& world, const Vec3f& normal) const;
  Vec3f first_ = Vec3f::Zero();
  Vec3f second_ = Vec3f::Zero();
  std::vector<Vec3f> rest_;    ///< object coordinates, shape [vertices]; empty: world positions
  std::vector<float> values_;  ///< of the column, shape [vertices]
  std::vector<Vec3f> texels_;  ///< linear, rows from bottom to top
};

}  // namespace supple::render::path
