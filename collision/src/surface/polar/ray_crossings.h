/// @file ray_crossings.h
/// Where rays of a patch cross its levels.
#pragma once

#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/polar/imprint.h"
#include "surface/polar/outline.h"
#include "surface/polar/patch_levels.h"
#include "surface/polar/rim_waves.h"

namespace supple::collision {

/// Where a ray crosses a level on Sigma.
struct Crossing {
  std::size_t ray, level;
  double radius, height;  // radius over that of the rim; [m]
  double left, right;     // the radius lies between these
  bool good;              // Newton's method has found it
};

/// Heights of Sigma along rays [m], at a share s of each: s linear + s^2 (square + s^2 rest), about a star s linear + s^2 (square + s rest).
struct RayHeights {
  std::vector<double> linear, square, rest;
  bool star = false;
  [[nodiscard]] double at(std::size_t ray, double share) const {
    const double second = share * share;
    return share * linear[ray] + second * (square[ray] + (star ? share : second) * rest[ray]);
  }
};

/// The rays of a patch, and what may cross them.
struct CrossedPatch {
  PairPressure& pressure;
  const PeakFrame& frame;
  PatchLevels& levels;
  const Rays& rays;
  const RayHeights& heights;
  ImprintFinder& finder;
  bool faces;  ///< crossings are held to the error over the piece between them and the rim, whose share of the ray may be small
  [[nodiscard]] double height(std::size_t ray, double share) const { return heights.at(ray, share); }
  [[nodiscard]] Vec3 direction(double cosine, double sine) const { return cosine * frame.u + sine * frame.v; }
};

class RayCrossings {
 public:
  /// @return crossings by ray and radius, also those that Newton's method loses; valid until the next call
  std::vector<Crossing>& find(const CrossedPatch& on, double error);

 private:
  /// A level along a ray: s = value + share (along + square share + mixed rise) + rise (up + up_square rise) of those that tell.
  struct RaySheet {
    std::size_t ray, level;
    Vec3 reach;  // from the origin to the rim [m]
    bool told;
    double value, along, up, square, mixed, up_square;
  };
  [[nodiscard]] RaySheet sheet_along(const CrossedPatch& on, std::size_t ray, std::size_t c, const Vec3& reach) const;
  static double side_on_ray(const CrossedPatch& on, const RaySheet& along, double share, double rise);
  void cross_between(const CrossedPatch& on, const RaySheet& along, Interval where, Interval sides, std::size_t others);
  bool cross_imprints(const CrossedPatch& on, std::size_t ray, std::size_t level, std::span<const double> s);
  void sample_thirds(const CrossedPatch& on);
  void guess(const CrossedPatch& on);

  std::vector<Crossing> crossings_;
  std::vector<Sheet> sheets_;  // of the levels that cross
  PressureBatch batch_;
  PressureBatch some_;             // its points at which Newton's method has not ended
  std::vector<std::size_t> open_;  // which they are
};

}  // namespace supple::collision
