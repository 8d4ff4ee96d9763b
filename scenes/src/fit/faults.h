/// @file faults.h
/// The data that primitives describe, and where their surface leaves it.
#pragma once

#include <limits>
#include <vector>

#include "fit/point_tree.h"
#include "fit/samples.h"
#include "fit/solve.h"

namespace supple::fit {

/// Handles of closed pieces.
[[nodiscard]] long genus_of(const MeshReport& mesh);

/// Samples, distances and the balls that touch the surface; all lengths over the diagonal.
struct Data {
  /// @param most   radius of balls at most   @param error  the finest that primitives are fitted to
  Data(const Mesh& given, double most, double error, const Executor& executor);

  const Mesh& mesh;
  SurfaceTree tree;
  SurfaceSamples surface;
  PointTree points;
  Surroundings around;
  std::vector<double> touching, hollow;  ///< radii of the largest balls that touch a sample from inside and from outside
  std::vector<double> radius;            ///< of balls from inside that respect hollows outside
  double largest_ball;
  long genus;
  std::size_t pieces;  ///< two for a closed shell
};

/// Share of the surface beside walls or gaps whose half is thinner than a radius.
[[nodiscard]] double share_thinner_than(const Data& data, double radius);

[[nodiscard]] Targets targets_of(const Data& data);

/// Where data and fit are farther apart than asked.
struct Faults {
  std::vector<std::uint32_t> missed;  ///< samples of the data outside the fit
  std::vector<Vec3> inside, outside;  ///< points on the wrong side of the fitted surface, inside and outside the data
  double largest = 1.0, rms = 1.0;    ///< distance
  long topology = std::numeric_limits<long>::max();  ///< pieces and handles that the fitted surface has too many or too few

  [[nodiscard]] bool within(const Faults& limit) const { return largest <= limit.largest && rms <= limit.rms && topology <= limit.topology; }

  /// @param enough  a distance that needs no mending
  [[nodiscard]] bool better_than(const Faults& other, double enough) const {
    const bool near = largest <= enough;
    if (near != (other.largest <= enough)) return near;
    return near ? topology < other.topology : largest < other.largest;
  }
};

/// @param cell  of the mesh that shows the surface   @param most  distance up to which nothing is wrong
[[nodiscard]] Faults find_faults(const Data& data, const implicit::Field& field, double cell, double most, const Executor& executor);

/// Which middles of the data's thin parts and gaps lie on the wrong side of a fitted surface, for each sample that inside and that outside.
[[nodiscard]] std::vector<char> wrong_middles(const Data& data, const implicit::Field& field);

/// Points where the surface is newly pinched off or grown together, what a wrong topology has near, however small the distances.
/// @param before  of a field of the right topology   @param apart  of the points that are added to `inside` and `outside`
void add_pinched(const Data& data, const implicit::Field& field, const std::vector<char>& before, double apart, Faults& faults);

/// Holds points of the fitted surface where it is wrong to their side of it. @param least  distance from the data that such a point counts as at least
void hold_signs(const Faults& faults, const Data& data, double least, Targets& targets);

}  // namespace supple::fit
