#include "path/paint.h"

#include "picture/draw_list.h"
#include "picture/lighting.h"

namespace supple::render::path {
namespace {

/// Bilinear, repeated.
Vec3f texel(const std::vector<Vec3f>& texels, int width, int height, float u, float v) {
  const float x = (u - std::floor(u)) * static_cast<float>(width) - 0.5F;
  const float y = (v - std::floor(v)) * static_cast<float>(height) - 0.5F;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto at = [&](int i, int j) -> const Vec3f& {
    return texels[static_cast<std::size_t>((j + height) % height) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>((i + width) % width)];
  };
  return (1 - fy) * ((1 - fx) * at(x0, y0) + fx * at(x0 + 1, y0)) + fy * ((1 - fx) * at(x0, y0 + 1) + fx * at(x0 + 1, y0 + 1));
}

Bsdf material(const Item& item, const Vec3f& base) {
  const auto metallic = static_cast<float>(std::clamp(item.metallic, 0.0, 1.0));
  const auto reflectance = static_cast<float>(std::clamp(item.reflectance, 0.0, 1.0));
  Bsdf bsdf;
  bsdf.diffuse = (1.0F - metallic) * base;
  bsdf.normal_reflectance = (1.0F - metallic) * Vec3f::Constant(reflectance) + metallic * base;
  // What reflects less than any solid does not reflect at grazing angles either (Lagarde & de Rousiers 2014).
  bsdf.grazing_reflectance = std::min(1.0F, 50.0F * bsdf.normal_reflectance.maxCoeff());
  const auto roughness = static_cast<float>(std::clamp(item.roughness, 0.02, 1.0));
  bsdf.alpha = roughness * roughness;
  return bsdf;
}

bool even(float x) { return (static_cast<long>(std::floor(x)) & 1) == 0; }

}  // namespace

Pattern::Pattern(const Paint& paint, const Vec3& colour)
    : kind_(paint.kind), first_(linear_colour(colour)), second_(linear_colour(paint.colour)),
      axis_(paint.axis.normalized().cast<float>()) {
  if (kind_ != PaintKind::Picture) return;
  const Image& image = *paint.picture;
  width_ = image.width;
  height_ = image.height;
  for (int y = height_ - 1; y >= 0; --y)
    for (int x = 0; x < width_; ++x) {
      const std::uint8_t* p = &image.pixels[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x))];
      texels_.push_back(linear_colour(Vec3(p[0], p[1], p[2]) / 255.0));
    }
}

Vec3f Pattern::colour(const Vec3f& at, const Vec3f& n) const {
  if (kind_ == PaintKind::Checker) return (even(at.x()) == even(at.y())) == even(at.z()) ? first_ : second_;
  if (kind_ == PaintKind::Stripes) return even(at.dot(axis_)) ? first_ : second_;
  if (kind_ != PaintKind::Picture) return first_;
  Vec3f share = n.cwiseAbs2().cwiseAbs2();
  share /= share.sum();
  const float aspect = static_cast<float>(width_) / static_cast<float>(height_);
  return share.x() * texel(texels_, width_, height_, at.y(), at.z() * aspect) +
         share.y() * texel(texels_, width_, height_, at.x(), at.z() * aspect) +
         share.z() * texel(texels_, width_, height_, at.x(), at.y() * aspect);
}

Vec3f Pattern::colour(const Eigen::Vector2f& at) const {
  return colour(Vec3f(at.x(), at.y(), 0.0F), Vec3f::UnitZ());
}

PaintSource::PaintSource(const Item& item) : first_(linear_colour(item.colour)), plain_(material(item, first_)), pattern_(item.paint, item.colour) {
  const Mesh& mesh = *item.mesh;
  if (has_pattern(item.paint)) place_ = places_in_pattern(item);
  if (item.paint.kind == PaintKind::Values) {
    const std::vector<double>* values = column(mesh, item.paint.column);
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v)
      values_.push_back(static_cast<float>(values == nullptr ? item.paint.lower : (*values)[v]));
  }
}

Vec3f PaintSource::colour(const Item& item, const std::uint32_t* corner, const Vec3f& weight, const Vec3f& normal) const {
  const Paint& paint = item.paint;
  if (paint.kind == PaintKind::Normals) return linear_colour(0.5 * normal.cast<double>() + Vec3::Constant(0.5));
  if (paint.kind == PaintKind::Values) {
    const float value = weight[0] * values_[corner[0]] + weight[1] * values_[corner[1]] + weight[2] * values_[corner[2]];
    return linear_colour(colour_of(paint.map, (value - paint.lower) / (paint.upper - paint.lower)));
  }
  const Vec3f &a = place_[corner[0]], &b = place_[corner[1]], &c = place_[corner[2]];
  return pattern_.colour(weight[0] * a + weight[1] * b + weight[2] * c, (b - a).cross(c - a).stableNormalized());
}

Bsdf PaintSource::bsdf(const Item& item, const std::uint32_t* corner, const Vec3f& weight, const Vec3f& normal, bool on_wire) const {
  if (on_wire) return material(item, first_ * (item.surface ? 0.08F : 1.0F));
  return item.paint.kind == PaintKind::Plain ? plain_ : material(item, colour(item, corner, weight, normal));
}

}  // namespace supple::render::path
