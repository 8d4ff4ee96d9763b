/// @file supple/implicit/surface_samples.h
/// Surface samples kept on particles (Desbrun & Gascuel 1995): each primitive sends seeds along directions fixed in its
/// part's frame; a seed keeps its distance rho along its ray from one step to the next and is projected again.
/// A seed is valid while its own primitive contributes most at its point (ties go to the lower primitive), so the
/// territories partition the surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/hash.h"
#include "supple/implicit/field.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

/// The seeds of one body, const in a Scene; index s is the same seed in every array.
struct SampleLayout {
  std::vector<std::uint32_t> primitive;  ///< the primitive that sends it
  std::vector<std::uint32_t> part;       ///< the part that carries that primitive
  std::vector<Vec3> foot;                ///< start on the skeleton, part frame [m]
  std::vector<Vec3> direction;           ///< unit, part frame
  std::vector<double> reach;             ///< longest rho to search: the kernel's support along the ray [m]
  /// Coefficients (a, b, c) of the area a + b rho + c rho^2 swept across the ray: a face [m^2] has (a, 0, 0), an edge
  /// [m] (0, b, 0), a corner or centre [sr] (0, 0, c), a disc's edge (0, b, c). On the surface: that area / (u . n).
  std::vector<Vec3> spread;
  [[nodiscard]] std::size_t size() const noexcept { return part.size(); }
  void clear() noexcept;
};

/// Seeds whose spacing on the surface of the single primitive is at most `spacing` [m] (each represents at most
/// spacing^2), spread evenly and symmetrically: sphere-like around points and ellipsoids, faces plus rounded borders
/// around plates, boxes, discs and segments. At least 32 per primitive. @pre spacing > 0
[[nodiscard]] SampleLayout make_sample_layout(const Skeleton& skeleton, double spacing);

/// The same with a spacing for each primitive [m], shape [primitives]. @pre all > 0
[[nodiscard]] SampleLayout make_sample_layout(const Skeleton& skeleton, std::span<const double> spacing);

/// The same seeds, but only those whose rays meet a box; replaces the content of `out`, keeps its capacity.
/// @param parts  world poses, shape [part_count]   @param near  world [m]
/// @return number of seeds that were tested: for points, plates, boxes and ellipsoids only those around the box
std::size_t make_sample_layout(const Skeleton& skeleton, double spacing, std::span<const Pose> parts, const Box& near,
                               SampleLayout& out);

/// The data that survive a step: rho per seed [m]; NaN-free; negative = no root was found. Part of State.
struct SampleState {
  std::vector<double> distance;
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// Samples of one body in the current frame; index s as in the layout. Frame data.
struct SurfaceSamples {
  std::vector<Vec3> point;           ///< on F = 0 [m]
  std::vector<Vec3> normal;          ///< unit, outward
  std::vector<double> area;          ///< [m^2]; sums to the surface area as spacing -> 0; 0 where invalid
  std::vector<std::uint8_t> valid;   ///< 1: on the surface and in its own territory
  std::vector<std::uint8_t> written; ///< 1: of a block of seeds some were projected by the last call; the other entries of the block are 0
  std::uint64_t visited = 0;         ///< seeds re-projected by the last call
  std::uint64_t failures = 0;        ///< seeds without a root
};

/// Samples of a body of one part, in the frame of that part: those of a block of seeds are found when one of them is asked for first, and move with
/// the part. For one skeleton and one layout, which must not change.
struct RigidSamples {
  PlacedSkeleton placed;
  Field field;
  SampleState state;
  SurfaceSamples samples;
  std::vector<std::uint8_t> found;  ///< 1: this block of seeds is found
};

/// A body whose surface is sampled.
struct SampledBody {
  const Skeleton& skeleton;
  const SampleLayout& layout;
  std::span<const Pose> parts;  ///< world poses, shape [part_count]
  const FieldView& field;
  RigidSamples* rigid = nullptr;  ///< of this body, which then has one part; saves the search for roots
};

/// Where a surface is sampled; empty: everywhere.
struct SampledRegion {
  std::span<const std::uint8_t> active{};  ///< flags by part, shape [part_count] or empty
  std::span<const Box> near{};             ///< world boxes, one of which the ray of a seed must meet [m]
};

/// Stage 4. Re-projects the seeds of the parts in `active` whose rays come near (all when these are empty); the rest keep their
/// distance and are marked invalid. The distance is a function of the poses alone up to 1e-13 reach: of the roots where the ray leaves
/// the body, the outermost in the seed's own territory, else the outermost. Roots are bracketed by fixed stations at
/// most a quarter of the field's feature size apart (32 intervals at most; dips and humps between stations are looked
/// into); the kept distance is but the start of the iteration. With `rigid`, distances are those in the frame of the part.
void sample_surface(const SampledBody& body, const SampledRegion& region, const Executor& executor, SampleState& state,
                    SurfaceSamples& out);

}  // namespace supple::implicit
