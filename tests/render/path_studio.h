/// @file path_studio.h
/// What the path tracer's tests draw, and what they ask of its films.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "path/integrator.h"
#include "shapes.h"
#include "supple/render/renderer.h"

namespace supple::render::test {

/// A picture of items without a tone curve.
struct Studio {
  View view;
  path::TraceSettings settings;
  path::Lights lights;
  std::optional<path::GroundPlane> ground;
  path::Geometry geometry;
  double shutter = 0.0;

  Studio() {
    settings.width = settings.height = 32;
    settings.noise = 0.0;
    settings.most_samples = 16;
    view.camera = {.from = Vec3(0, -5, 0), .look_at = Vec3::Zero(), .up = Vec3::UnitZ(), .field_of_view = 0.3};
  }
  path::Film trace(std::span<const Item> items, int threads = 1) {
    geometry.set(items, view.camera.look_at, shutter, 0.0F);
    settings.focus = view.camera.focus > 0.0 ? view.camera.focus : (view.camera.from - view.camera.look_at).norm();
    settings.aperture = view.camera.aperture;
    path::Film film;
    path::trace({geometry, lights, ground, camera_matrices(view.camera, 1.0 * settings.width / settings.height, {})}, settings,
                Executor(threads), film);
    return film;
  }
};

inline Item matt(const Mesh& mesh, double albedo) {
  // sRGB of a linear grey.
  const double srgb = albedo <= 0.0031308 ? 12.92 * albedo : 1.055 * std::pow(albedo, 1.0 / 2.4) - 0.055;
  return {.mesh = &mesh, .colour = Vec3::Constant(srgb), .roughness = 1.0, .reflectance = 0.0};
}

inline Mesh plate(double half, const Vec3& at, const Vec3& u, const Vec3& v) {
  Mesh mesh;
  add_quadrangle(mesh, at - half * u - half * v, at + half * u - half * v, at + half * u + half * v, at - half * u + half * v);
  return mesh;
}

struct Pixel {
  int x, y;
};

inline std::vector<Pixel> pixels_of(const path::Film& film) {
  std::vector<Pixel> pixels;
  for (int y = 0; y < film.height; ++y)
    for (int x = 0; x < film.width; ++x) pixels.push_back({x, y});
  return pixels;
}

inline double mean_green(const path::Film& film) {
  double sum = 0.0;
  for (const auto& [x, y] : pixels_of(film)) sum += film.radiance.at(x, y).y();
  return sum / (film.width * film.height);
}

inline double total(const path::Film& film, const path::Plane& plane) {
  double sum = 0.0;
  for (const auto& [x, y] : pixels_of(film)) sum += plane.at(x, y);
  return sum;
}

inline double rms_difference(const path::Film& a, const path::Film& b) {
  double sum = 0.0, count = 0.0;
  for (const auto& [x, y] : pixels_of(a)) {
    if (!(a.cover.at(x, y) > 0.0F && b.cover.at(x, y) > 0.0F)) continue;
    sum += (a.cover.at(x, y) * a.radiance.at(x, y) - b.cover.at(x, y) * b.radiance.at(x, y)).squaredNorm() / 3.0;
    count += 1.0;
  }
  return std::sqrt(sum / count);
}

}  // namespace supple::render::test
