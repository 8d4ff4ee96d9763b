/// @file supple/implicit/mesh_columns.h
/// What the parts (particles) of a body know, spread over its surface as columns of the mesh: weighted by each part's
/// share of the field, and where no part reaches (in a bulge) taken from the nearest one.
#pragma once

#include <span>
#include <string>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/mesh_motion.h"

namespace supple::implicit {

/// Where a part is and where it was at rest.
struct PartPlace {
  Pose now;
  Pose rest;
};

/// Adds the columns "rest_x", "rest_y", "rest_z" [m]: where each vertex was at rest, if every part had carried it along
/// rigidly, from `origin`. Of a body that moves rigidly they are exact, so what they colour sticks to it.
/// @param parts  by the field's part index
void add_rest_coordinates(const FieldView& field, std::span<const PartPlace> parts, const Vec3& origin,
                          const Executor& executor, Mesh& mesh);

/// Adds a column `name` of one number a part. @param places of the parts [m]  @param values  shape of places
void add_part_values(const FieldView& field, std::span<const Vec3> places, std::span<const double> values,
                     const std::string& name, const Executor& executor, Mesh& mesh);

/// Adds the column "speed": the length of the mean of the parts' velocities at each vertex [m/s].
void add_speed(const FieldView& field, std::span<const PartMotion> parts, const Executor& executor, Mesh& mesh);

}  // namespace supple::implicit
