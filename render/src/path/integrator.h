/// @file integrator.h
/// Light along random paths (Kajiya 1986): sun and rectangles are sampled at every bounce and weighed against directions
/// that the surfaces choose (multiple importance sampling, Veach 1997); the even sky is met by those directions alone. Of
/// several camera rays, all of which see edges and shadows, one goes on beyond its first surface.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "supple/core/executor.h"
#include "tracer.h"

namespace supple::render::path {

/// A part of the light of all pixels.
struct FilmLight {
  std::vector<Vec3f> radiance;     ///< mean over the covered part
  std::vector<float> variance;     ///< of the mean luminance
};

/// Why a pixel takes its camera rays anew.
enum class Detail : std::uint8_t {
  Surfaces,  ///< meet in it: its indirect light is that of its facets, by neighbours on the same surfaces, in gaps by paths, too
  Gap,       ///< light comes from a few pixels away and changes as fast: it takes more paths, too
  Shadow,    ///< the edge of one is near
};

struct DetailedPixel {
  std::size_t pixel = 0;
  Detail detail = Detail::Surfaces;
  std::uint32_t rays = 0;
  bool walks = false;       ///< its rays have paths of their own
  std::size_t samples = 0;  ///< first of `rays` in Film::detailed_samples, of Detail::Surfaces
};

/// One pixel after the other from the top left. Features are those of the first surface, for the denoiser.
struct Film {
  FilmLight direct;                ///< that the first surface has straight from sun and rectangles: with the edges of shadows
  FilmLight indirect;              ///< from the sky and other surfaces: softer, and noisier
  std::vector<Vec3f> radiance;     ///< the sum of both
  std::vector<float> cover;        ///< in [0, 1]: not background
  std::vector<Vec3f> albedo;
  std::vector<Vec3f> normal;
  std::vector<Vec3f> position;     ///< relative to the origin [m]
  std::vector<float> nearness;     ///< mean of 1 / distance of what indirect light comes from [1/m], 0 for the sky, times cover
  std::vector<float> mirror;       ///< 1 where reflections are sharp, 0 on matt surfaces
  std::vector<std::uint32_t> samples;
  std::vector<DetailedPixel> detailed;  ///< in the order of pixels
  std::vector<Sample> detailed_samples;
};

/// The same bits for any number of threads: a tile of 8 x 8 pixels decides about its samples alone, and then each pixel by
/// itself and its neighbours whether it holds detail that a filter cannot restore, and takes more camera rays.
void trace(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
           const TraceSettings& settings, const Executor& executor, Film& film);

}  // namespace supple::render::path
