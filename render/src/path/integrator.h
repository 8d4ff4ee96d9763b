/// @file integrator.h
/// Light along random paths (Kajiya 1986): sun and rectangles are sampled at every bounce and weighed against directions
/// that the surfaces choose (multiple importance sampling, Veach 1997); the even sky is met by those directions alone. Of
/// several camera rays, all of which see edges and shadows, one goes on beyond its first surface.
#pragma once

#include <optional>
#include <vector>

#include "../draw_list.h"
#include "geometry.h"
#include "lights.h"
#include "paint.h"
#include "supple/core/executor.h"

namespace supple::render::path {

struct GroundPlane {
  float height = 0.0F;         ///< relative to the origin [m]
  Vec3f albedo = Vec3f::Zero();
  bool fades = false;          ///< into the background with distance, for the camera
  const Pattern* pattern = nullptr;  ///< in place of the albedo, by world x and y; null: none
  Eigen::Vector2f origin = Eigen::Vector2f::Zero();  ///< of positions, in the world [m]
};

struct TraceSettings {
  int width = 0;
  int height = 0;
  int least_samples = 2;       ///< camera rays a pixel, a power of two: from fewer a tile does not know its noise
  int most_samples = 256;      ///< a pixel, a power of two
  double noise = 0.05;         ///< standard error of a pixel's luminance over (luminance + 0.1), RMS of a tile; 0: most_samples
  int bounces = 6;             ///< surfaces along a path after the first
  bool exact = true;           ///< hits lie on the surface of the field, where an item has one
  double aperture = 0.0;       ///< radius of the lens [m]
  double focus = 1.0;          ///< distance of the plane that is sharp, along the line of sight [m]
  float largest_indirect = 10.0F;  ///< luminance that a bounce can add; keeps single bright paths out of a picture
};

/// A part of the light of all pixels.
struct FilmLight {
  std::vector<Vec3f> radiance;     ///< mean over the covered part
  std::vector<float> variance;     ///< of the mean luminance
};

/// What one camera ray of a pixel met.
struct Facet {
  float cover = 0.0F;
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();  ///< relative to the origin [m]
};

/// A pixel where surfaces meet, with its facets from Film::facets.
struct MixedPixel {
  std::size_t pixel = 0;
  std::size_t first = 0;
  std::size_t last = 0;
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
  std::vector<MixedPixel> mixed;   ///< in the order of pixels
  std::vector<Facet> facets;
};

/// The same bits for any number of threads: a tile of 8 x 8 pixels decides about its samples alone, and then each pixel by its
/// neighbours whether it lies on an edge, which takes more of the camera rays.
void trace(const Geometry& geometry, const Lights& lights, const std::optional<GroundPlane>& ground, const CameraMatrices& camera,
           const TraceSettings& settings, const Executor& executor, Film& film);

}  // namespace supple::render::path
