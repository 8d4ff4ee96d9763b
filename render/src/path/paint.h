/// @file paint.h
/// The material at a point of an item: the same paints as the shaders', evaluated at points.
#pragma once

#include <array>
#include <vector>

#include "path/bsdf.h"
#include "supple/render/view.h"

namespace supple::render::path {

/// Checker, Stripes or Picture at points.
class Pattern {
 public:
  Pattern() = default;
  Pattern(const Paint& paint, const Vec3& colour);
  /// Albedo at a place, in cubes, slices or widths, where the surface has the normal n (Picture: which axes it is projected along).
  [[nodiscard]] Vec3f colour(const Vec3f& at, const Vec3f& n) const;
  /// Albedo of a level plane: squares in place of cubes.
  [[nodiscard]] Vec3f colour(const Eigen::Vector2f& p) const;

 private:
  PaintKind kind_ = PaintKind::Plain;
  Vec3f first_ = Vec3f::Zero();
  Vec3f second_ = Vec3f::Zero();
  Vec3f axis_ = Vec3f::UnitX();
  std::vector<Vec3f> texels_;    ///< of the picture, from its lowest row up
  int width_ = 0;
  int height_ = 0;
};

class PaintSource {
 public:
  PaintSource() = default;
  explicit PaintSource(const Item& item);

  /// @param corner, weight  the triangle's vertices, barycentric coordinates
  [[nodiscard]] Bsdf bsdf(const Item& item, const std::uint32_t* corner, const Vec3f& weight, const Vec3f& normal, bool on_wire) const;

 private:
  [[nodiscard]] Vec3f colour(const Item& item, const std::uint32_t* corner, const Vec3f& weight, const Vec3f& normal) const;
  Vec3f first_ = Vec3f::Zero();  ///< linear
  Bsdf plain_;                   ///< where the colour is everywhere the same
  Pattern pattern_;
  std::vector<Vec3f> place_;     ///< of the vertices, in the pattern
  std::vector<float> values_;    ///< of the vertices
};

}  // namespace supple::render::path
