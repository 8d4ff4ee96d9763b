/// @file bsdf.h
/// How a surface scatters: a GGX lobe over a diffuse base that together reflect no more than comes in. Directions are in
/// axes whose z is the normal, and point away from the surface.
#pragma once

#include "path/sampling.h"

namespace supple::render::path {

template <class Number>
struct BsdfOf {
  using Vector = typename LaneTypes<Number>::Vector;
  Vector diffuse = Vector::Constant(constant<Number>(0.8F));  ///< albedo of the base
  Vector normal_reflectance = Vector::Constant(constant<Number>(0.04F));
  Number grazing_reflectance = constant<Number>(1.0F);        ///< 0: no lobe
  Number alpha = constant<Number>(0.2F);                      ///< width of the lobe, roughness squared
  Number local = constant<Number>(1.0F);                      ///< 1: the base sends light back where it comes in; 0: elsewhere

  [[nodiscard]] auto has_lobe() const { return grazing_reflectance > 0.0F; }

  [[nodiscard]] Vector fresnel(Number cosine) const {  // Schlick 1994
    const Number c = clamped(1.0F - cosine, 0.0F, 1.0F);
    const Number weight = c * c * c * c * c;
    return normal_reflectance + weight * (Vector::Constant(grazing_reflectance) - normal_reflectance);
  }

  /// About what it sends that way of even light from all around. @param cosine  of the direction it goes to
  [[nodiscard]] Vector reflectance(Number cosine) const {
    const Number c = larger(cosine, 0.0F);
    const Vector of_base = diffuse.cwiseProduct(Vector::Ones() - normal_reflectance) * (1.0F - grazing_reflectance * fall(c));
    return select(has_lobe(), Vector(of_base + fresnel(c)), Vector(diffuse));
  }

  /// Of even light from all around, what the lobe leaves to a white base that sends it that way.
  [[nodiscard]] Vector passed(Number cosine) const {
    const Vector below = Vector::Ones() - normal_reflectance;
    return select(has_lobe(), Vector(below * (1.0F - grazing_reflectance * fall(larger(cosine, 0.0F)))), Vector(Vector::Ones()));
  }

  /// Chance of taking the lobe instead of the base.
  [[nodiscard]] Number lobe_share(const Vector& out) const {
    const Number lobe = luminance(fresnel(out.z()));
    const Number base = luminance(diffuse);
    const Number share = clamped(lobe / (lobe + base), 0.1F, 0.9F);
    return select(has_lobe(), select(base > 0.0F, share, 1.0F), 0.0F);
  }

  /// f times the cosine of `in`.
  [[nodiscard]] Vector evaluate(const Vector& out, const Vector& in) const {
    Vector f = base(out.z(), in.z()) * local;
    if (any(has_lobe())) {
      const Vector h = (out + in).normalized();
      const Number lobe = distribution(h) * masking(out, in) / (4.0F * out.z() * in.z());
      f += fresnel(out.dot(h)) * select(has_lobe(), lobe, 0.0F);
    }
    return select(above(out, in), Vector(f * in.z()), Vector(Vector::Zero()));
  }

  [[nodiscard]] Number density(const Vector& out, const Vector& in) const {
    const Number share = lobe_share(out);
    Number density = (1.0F - share) * local * in.z() * (1.0F / kPi);
    if (any(has_lobe())) {
      const Vector h = (out + in).normalized();
      const Number lobe = share * distribution(h) / ((1.0F + lambda(out)) * 4.0F * out.z());
      density += select(has_lobe(), lobe, 0.0F);
    }
    return select(above(out, in), density, 0.0F);
  }

  /// A direction, by `density`; below the horizon (z <= 0) now and then.
  [[nodiscard]] Vector sample(const Vector& out, Number choice, const Pair<Number>& u) const {
    const Vector from_base = cosine_direction(u);
    if (!any(has_lobe())) return from_base;
    const Vector h = visible_normal(out, u);
    return select(choice < lobe_share(out), Vector(2.0F * out.dot(h) * h - out), from_base);
  }

 private:
  [[nodiscard]] static Number fall(Number cosine) {
    const Number s = 1.0F - 0.5F * cosine;
    return s * s * s * s * s;
  }
  [[nodiscard]] static auto above(const Vector& out, const Vector& in) { return both(out.z() > 0.0F, in.z() > 0.0F); }
  /// Reciprocal, and dark where the lobe reflects (Ashikhmin & Shirley 2000, eq. 5, for any grazing reflectance g: the
  /// factor is 1 / (1 - 5/28 g), 28/23 for theirs).
  [[nodiscard]] Vector base(Number cos_out, Number cos_in) const {
    const Vector flat = diffuse.cwiseProduct(Vector::Ones() - normal_reflectance) * (1.0F / kPi);
    if (!any(has_lobe())) return flat;
    const Number g = grazing_reflectance;
    const Number both = (1.0F - g * fall(cos_out)) * (1.0F - g * fall(cos_in)) / (1.0F - g * (5.0F / 28.0F));
    return flat * both;
  }
  [[nodiscard]] Number distribution(const Vector& h) const {  // Trowbridge & Reitz 1975
    const Number a2 = alpha * alpha;
    const Number d = h.z() * h.z() * (a2 - 1.0F) + 1.0F;
    return a2 / (kPi * d * d);
  }
  [[nodiscard]] Number lambda(const Vector& v) const {
    const Number tan2 = (v.x() * v.x() + v.y() * v.y()) / (v.z() * v.z());
    return 0.5F * (root(1.0F + alpha * alpha * tan2) - 1.0F);
  }
  /// Height-correlated Smith term (Heitz 2014).
  [[nodiscard]] Number masking(const Vector& out, const Vector& in) const { return 1.0F / (1.0F + lambda(out) + lambda(in)); }

  /// A normal of the microfacets seen from `out` (Heitz 2018).
  [[nodiscard]] Vector visible_normal(const Vector& out, const Pair<Number>& u) const {
    const Vector v = Vector(alpha * out.x(), alpha * out.y(), out.z()).normalized();
    const Number across = v.x() * v.x() + v.y() * v.y();
    const Number scale = 1.0F / root(across);
    const auto tilted = across > 0.0F;
    const Vector t1(select(tilted, -v.y() * scale, 1.0F), select(tilted, v.x() * scale, 0.0F), Number{});
    const Vector t2 = v.cross(t1);
    const Pair<Number> d = on_disc(u);
    const Number s = 0.5F * (1.0F + v.z());
    const Number b = (1.0F - s) * root(larger(1.0F - d.x * d.x, 0.0F)) + s * d.y;
    const Vector n = d.x * t1 + b * t2 + root(larger(1.0F - d.x * d.x - b * b, 0.0F)) * v;
    return Vector(alpha * n.x(), alpha * n.y(), larger(n.z(), 1e-6F)).normalized();
  }
};
/// Of one surface.
using Bsdf = BsdfOf<float>;

/// Refraction at a smooth surface (Snell), and what it reflects of unpolarised light (Fresnel).
template <class Number>
struct RefractionOf {
  Number reflected;  ///< share; 1: all of it
  Number cosine;     ///< of the angle between the normal and light that passes
  /// @param cosine_in  of the angle of incidence, in [0, 1]  @param ratio  index on this side over that beyond
  RefractionOf(Number cosine_in, Number ratio) {
    const Number c = clamped(cosine_in, 0.0F, 1.0F);
    const Number k = 1.0F - ratio * ratio * (1.0F - c * c);
    cosine = root(larger(k, 0.0F));
    const Number across = (ratio * c - cosine) / (ratio * c + cosine), along = (c - ratio * cosine) / (c + ratio * cosine);
    reflected = select(k > 0.0F, smaller(0.5F * (across * across + along * along), 1.0F), constant<Number>(1.0F));
  }
};

}  // namespace supple::render::path
