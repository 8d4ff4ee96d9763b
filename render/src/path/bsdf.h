/// @file bsdf.h
/// How a surface scatters: a GGX lobe over a diffuse base that together reflect no more than comes in. Directions are in
/// axes whose z is the normal, and point away from the surface.
#pragma once

#include <algorithm>

#include "sampling.h"

namespace supple::render::path {

struct Bsdf {
  Vec3f diffuse = Vec3f::Constant(0.8F);  ///< albedo of the base
  Vec3f normal_reflectance = Vec3f::Constant(0.04F);
  float grazing_reflectance = 1.0F;
  float alpha = 0.2F;                     ///< width of the lobe, roughness squared

  [[nodiscard]] bool has_lobe() const { return grazing_reflectance > 0.0F; }

  [[nodiscard]] Vec3f fresnel(float cosine) const {  // Schlick 1994
    const float c = std::clamp(1.0F - cosine, 0.0F, 1.0F);
    const float weight = c * c * c * c * c;
    return normal_reflectance + weight * (Vec3f::Constant(grazing_reflectance) - normal_reflectance);
  }

  /// Chance of taking the lobe instead of the base.
  [[nodiscard]] float lobe_share(const Vec3f& out) const {
    if (!has_lobe()) return 0.0F;
    const float lobe = luminance(fresnel(out.z()));
    const float base = luminance(diffuse);
    return base > 0.0F ? std::clamp(lobe / (lobe + base), 0.1F, 0.9F) : 1.0F;
  }

  /// f times the cosine of `in`.
  [[nodiscard]] Vec3f evaluate(const Vec3f& out, const Vec3f& in) const {
    if (out.z() <= 0.0F || in.z() <= 0.0F) return Vec3f::Zero();
    Vec3f f = base(out.z(), in.z());
    if (has_lobe()) {
      const Vec3f h = (out + in).normalized();
      f += fresnel(out.dot(h)) * (distribution(h) * masking(out, in) / (4.0F * out.z() * in.z()));
    }
    return f * in.z();
  }

  [[nodiscard]] float density(const Vec3f& out, const Vec3f& in) const {
    if (out.z() <= 0.0F || in.z() <= 0.0F) return 0.0F;
    const float share = lobe_share(out);
    float density = (1.0F - share) * in.z() / kPi;
    if (share > 0.0F) {
      const Vec3f h = (out + in).normalized();
      density += share * distribution(h) / ((1.0F + lambda(out)) * 4.0F * out.z());
    }
    return density;
  }

  /// A direction, by `density`; below the horizon (z <= 0) now and then.
  [[nodiscard]] Vec3f sample(const Vec3f& out, float choice, const Eigen::Vector2f& u) const {
    if (choice >= lobe_share(out)) return cosine_direction(u);
    const Vec3f h = visible_normal(out, u);
    return 2.0F * out.dot(h) * h - out;
  }

 private:
  /// Reciprocal, and dark where the lobe reflects (Ashikhmin & Shirley 2000, eq. 5, for any grazing reflectance g: the
  /// factor is 1 / (1 - 5/28 g), 28/23 for theirs).
  [[nodiscard]] Vec3f base(float cos_out, float cos_in) const {
    const Vec3f flat = diffuse.cwiseProduct(Vec3f::Ones() - normal_reflectance) * (1.0F / kPi);
    if (!has_lobe()) return flat;
    const auto fall = [](float c) {
      const float s = 1.0F - 0.5F * c;
      return s * s * s * s * s;
    };
    const float g = grazing_reflectance;
    const float both = (1.0F - g * fall(cos_out)) * (1.0F - g * fall(cos_in)) / (1.0F - g * 5.0F / 28.0F);
    return flat * both;
  }
  [[nodiscard]] float distribution(const Vec3f& h) const {  // Trowbridge & Reitz 1975
    const float a2 = alpha * alpha;
    const float d = h.z() * h.z() * (a2 - 1.0F) + 1.0F;
    return a2 / (kPi * d * d);
  }
  [[nodiscard]] float lambda(const Vec3f& v) const {
    const float tan2 = (v.x() * v.x() + v.y() * v.y()) / (v.z() * v.z());
    return 0.5F * (std::sqrt(1.0F + alpha * alpha * tan2) - 1.0F);
  }
  /// Height-correlated Smith term (Heitz 2014).
  [[nodiscard]] float masking(const Vec3f& out, const Vec3f& in) const { return 1.0F / (1.0F + lambda(out) + lambda(in)); }

  /// A normal of the microfacets seen from `out` (Heitz 2018).
  [[nodiscard]] Vec3f visible_normal(const Vec3f& out, const Eigen::Vector2f& u) const {
    const Vec3f v = Vec3f(alpha * out.x(), alpha * out.y(), out.z()).normalized();
    const float across = v.x() * v.x() + v.y() * v.y();
    const Vec3f t1 = across > 0.0F ? Vec3f(Vec3f(-v.y(), v.x(), 0.0F) / std::sqrt(across)) : Vec3f(Vec3f::UnitX());
    const Vec3f t2 = v.cross(t1);
    const float r = std::sqrt(u.x());
    const float angle = 2.0F * kPi * u.y();
    const float a = r * std::cos(angle);
    const float s = 0.5F * (1.0F + v.z());
    const float b = (1.0F - s) * std::sqrt(std::max(0.0F, 1.0F - a * a)) + s * r * std::sin(angle);
    const Vec3f n = a * t1 + b * t2 + std::sqrt(std::max(0.0F, 1.0F - a * a - b * b)) * v;
    return Vec3f(alpha * n.x(), alpha * n.y(), std::max(1e-6F, n.z())).normalized();
  }
};

}  // namespace supple::render::path
