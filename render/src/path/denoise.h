/// @file denoise.h
/// A filter that follows features: the edge-avoiding a-trous transform (Dammertz et al. 2010) of the light that falls on
/// each pixel (radiance over reflectance), stopped by normals, tangent planes and differences above the estimated noise
/// (Schied et al. 2017). Direct and indirect light go apart; the second is stopped by distance, too, where other surfaces are
/// near, as it can change no faster than these allow (Ward & Heckbert 1992). A pixel where surfaces meet has the indirect light of each
/// of its facets from neighbours on the same surface.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "path/integrator.h"

namespace supple::render::path {

struct Neighbours;  // of a pixel, in denoise.cpp

/// One of the surfaces that meet in a pixel, by the paths of its samples.
struct SurfacePart {
  Vec3f normal = Vec3f::Zero(), position = Vec3f::Zero();
  Vec3f light = Vec3f::Zero();  ///< that falls on it from the sky and other surfaces
  float count = 0.0F;           ///< of paths

  /// A sample with a path: only if it faces the same way and lies in the same plane, to some pixels. @return whether it does
  /// @param steepness  1 / (two pixels) where it lies
  bool take(const Sample& sample, const Vec3f& falls, float steepness);
};

class Denoiser {
 public:
  /// Replaces film.radiance. @param footprint  of a pixel at unit distance  @param eye  relative to the origin
  void run(const Vec3f& eye, float footprint, const Executor& executor, Film& film);

 private:
  /// Beside those of the film.
  struct Features {
    Plane shown;  ///< 1 where there is a surface, else 0
    Plane share;  ///< 1 / number of pixels around that show one
    Plane near;   ///< 1 / distance over which indirect light may change much (Ward & Heckbert 1992)
  };
  struct Light {
    VectorPlane colour;
    Plane variance;
    Plane bright;
    void resize(int width, int height);
    /// @param is_there  but for round-off of its brightness
    void copy(const Light& from, std::ptrdiff_t at, bool is_there);
  };
  /// A part of the light on its way through the filter.
  struct Signal {
    Light light, next;
    Plane guide;  ///< brightness, a little smoothed
  };
  struct Sums;

  void resize();
  void fill();
  void sort_paths();
  /// 1 / distance from the tangent plane there that counts as far, at stride 1.
  template <class Vector>
  [[nodiscard]] auto steepness(const Vector& position) const;
  void guide(int y);
  [[nodiscard]] std::array<Lanes, 2> noise(std::ptrdiff_t at) const;
  /// One level of the transform.
  void smooth(int stride);
  /// @param quiet  lanes whose direct light stays as it is; all that show a surface unless `with_direct`
  template <bool with_direct>
  void smooth_block(int stride, std::ptrdiff_t at, const std::array<Lanes, 2>& noise, LaneMask shown, LaneMask quiet);
  void finish(Film& film) const;
  [[nodiscard]] Neighbours around(const DetailedPixel& pixel) const;
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(film_->width) + static_cast<std::size_t>(x);
  }
  /// Number of the block of eight pixels that begins there.
  [[nodiscard]] static std::size_t block(std::ptrdiff_t at) { return static_cast<std::size_t>(at) / kLanes; }
  template <class Body>
  void rows(const Body& body) const;
  template <class Body>
  void rows_apart(int stride, const Body& body) const;
  template <class Body>
  void blocks(int y, const Body& body) const;
  template <class Body>
  void shown_blocks(int y, const Body& body) const;

  const Executor* executor_ = nullptr;
  const Film* film_ = nullptr;
  Vec3f eye_ = Vec3f::Zero();
  float footprint_ = 0.0F;
  Features f_;
  std::array<Signal, 2> signals_;     ///< direct, indirect
  std::vector<std::uint8_t> kept_;    ///< 1: the last level left the direct light of that block, which so is in both planes
  std::vector<std::uint32_t> mixed_;  ///< of a pixel where surfaces meet, 1 + its place in parts_; 0: one surface
  std::vector<std::array<SurfacePart, 2>> parts_;
};

}  // namespace supple::render::path
