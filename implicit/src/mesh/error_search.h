/// @file error_search.h
/// Meshes to a given error: measurement of the error, and choice of the level.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

struct MarchCounts;

/// Largest distance of the centroids of a mesh to the surface F = 0 [m]: |F| / |grad F| where the surface is smooth within a triangle.
/// Where it bends by more than 14 degrees, as at a crease, that may be less than the distance: there it is the distance to the point of the
/// surface that Newton's method leads to, or to the nearest vertex, which is never below the distance.
[[nodiscard]] double centroid_error(const FieldView& field, const Mesh& mesh, const Executor& executor);

/// centroid_error of some triangles, each by itself. It depends on the triangle, the feature size and the field in `evaluated` alone.
/// @param triangles  their numbers, shape [n]   @param error  [m], shape [n]   @param evaluated  shape [n]
void centroid_errors(const FieldView& field, const Mesh& mesh, std::span<const std::uint32_t> triangles, std::span<double> error,
                     std::span<Box> evaluated);

/// Meshes get finer by levels: from one to the next, triangles get shorter by sqrt(2), and twice as many.
/// Length of triangles at a level [m]. @param first  at level 0 [m]
[[nodiscard]] double spacing_at(double first, int level);

/// Number of further levels before a limit is reached. @param now  present cost, > 0   @param growth  from one level to the next, > 1
[[nodiscard]] int levels_left(double now, double most, double growth);

/// A trial mesh.
struct LevelTry {
  double error = 0.0;    ///< found [m]
  bool telling = false;  ///< so fine that errors of finer ones follow from it and the two before
  int levels_left = 0;   ///< by which finer ones still fit
  /// Where levels_left may underestimate: computes the exact value, at a cost.
  std::function<int()> count_levels_left{};
};

/// Limits of a mesh of marching cubes: 8 GB, and kMarchNodes nodes around it.
[[nodiscard]] LevelTry tried(double error, const Mesh& mesh, const MarchCounts& counts);

/// Level 0 of marching cubes: no ball of the surface passes through a cell of half the feature size.
/// @param cell  given cell, or 0 [m]
[[nodiscard]] double first_cell(const FieldView& field, double cell);

struct ErrorGoal {
  double error = 0.0;              ///< of the mesh at most [m], > 0
  double first = 0.0;              ///< length of triangles at level 0 [m]
  bool stated = false;             ///< whether it is the given cell, which is named in the error where it is too small
  std::string key = "mesh.error";  ///< named when it cannot be reached
  std::string where{};             ///< appended to `found` of the error
};

/// Makes meshes of rising level, from 0 on, until one meets the error. Errors fall by two per level on a smooth surface, by sqrt(2) where it
/// has an edge that no vertex meets; the last meshes show which. At most four levels are skipped at a time, two while
/// the order is in doubt or the error seems out of reach.
/// @param make  makes a level's mesh; an Error{Limit} for its size is reported in terms of errors
/// @throws Error{Limit} as soon as no mesh within the limits would meet the error; the hint keeps a level in reserve
void make_within(const ErrorGoal& goal, const std::function<LevelTry(int level)>& make);

}  // namespace supple::implicit
