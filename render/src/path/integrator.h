/// @file integrator.h
/// Light along random paths (Kajiya 1986): sun and rectangles are sampled at every bounce and weighed against directions
/// that the surfaces choose (multiple importance sampling, Veach 1997); the even sky is met by those directions alone. Of
/// several camera rays, all of which see edges and shadows, one goes on beyond its first surface.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "path/plane.h"
#include "path/tracer.h"
#include "supple/core/executor.h"

namespace supple::render::path {

/// A part of the light of all pixels.
struct FilmLight {
  VectorPlane radiance;  ///< mean over the covered part
  Plane variance;        ///< of the mean luminance
};

/// Why camera rays of a pixel are traced again.
enum class Detail : std::uint8_t {
  Surfaces,  ///< meet in it: its indirect light is that of its facets, by neighbours on the same surfaces, in gaps by paths, too
  Gap,       ///< light comes from a few pixels away and changes as fast: it takes more paths, too
  Shadow,    ///< the edge of one is near
};

struct DetailedPixel {
  int x = 0;
  int y = 0;
  Detail detail = Detail::Surfaces;
  std::uint32_t rays = 0;
  bool walks = false;       ///< its rays have paths of their own
  std::size_t samples = 0;  ///< first of `rays` in Film::detailed_samples, of Detail::Surfaces
};

/// Features are those of the first surface, for the denoiser. All are zero where nothing is shown.
struct Film {
  int width = 0;
  int height = 0;
  FilmLight direct;      ///< that the first surface has straight from sun and rectangles: with the edges of shadows
  FilmLight indirect;    ///< from the sky and other surfaces: softer, and noisier
  VectorPlane radiance;  ///< the sum of both
  Plane cover;           ///< in [0, 1]: not background
  VectorPlane albedo;
  VectorPlane reflectance;
  VectorPlane normal;
  VectorPlane position;  ///< in the picture's space
  Plane nearness;        ///< mean of 1 / distance of what indirect light comes from, 0 for the sky, times cover
  Plane mirror;          ///< 1 where reflections are sharp, 0 on matt surfaces
  Plane samples;         ///< camera rays
  std::vector<DetailedPixel> detailed;  ///< in the order of pixels
  std::vector<Sample> detailed_samples;

  void resize(int across, int down);
};

/// What a picture is made of.
struct TracedScene {
  const Geometry& geometry;
  const Lights& lights;
  const std::optional<GroundPlane>& ground;
  const CameraMatrices& camera;
};

/// The same bits for any number of threads: a tile of 8 x 8 pixels decides about its samples alone, and then each pixel by
/// itself and its neighbours whether it holds detail that a filter cannot restore, and takes more camera rays.
void trace(const TracedScene& scene, const TraceSettings& settings, const Executor& executor, Film& film);

}  // namespace supple::render::path
