/// @file lighting.h
/// The light of every picture, for both renderers: radiance of sun, sky and ground, and the response of film.
#pragma once

#include "supple/render/view.h"

namespace supple::render {

inline constexpr float kExposure = 0.42F;

/// Irradiance over pi at normal incidence.
[[nodiscard]] inline Eigen::Vector3f sun_colour(const Light& light) {
  return static_cast<float>(light.intensity) * Eigen::Vector3f(1.0F, 0.965F, 0.91F);
}
/// Radiance from above.
[[nodiscard]] inline Eigen::Vector3f sky_colour() { return {0.93F, 1.0F, 1.10F}; }

/// Linear light of an sRGB colour in [0, 1] (IEC 61966-2-1).
[[nodiscard]] Eigen::Vector3f linear_colour(const Vec3& srgb);

}  // namespace supple::render
