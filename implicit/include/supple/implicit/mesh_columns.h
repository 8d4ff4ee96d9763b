/// @file supple/implicit/mesh_columns.h
/// Values of the parts (particles) of a body as columns of its surface mesh: weighted by each part's
/// share of the field; where no part reaches (in a bulge) taken from the nearest part.
#pragma once

#include <span>
#include <string>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/mesh_motion.h"

namespace supple::implicit {

/// Present pose and rest pose of a part.
struct PartPlace {
  Pose now;
  Pose rest;
};

/// Adds the columns "rest_x", "rest_y", "rest_z" [m]: the rest position of each vertex, if every part carried it
/// rigidly, from `origin`. Of a body that moves rigidly they are exact, so textures stick to it.
/// @param parts  by the field's part index
void add_rest_coordinates(const FieldView& field, std::span<const PartPlace> parts, const Vec3& origin,
                          const Executor& executor, Mesh& mesh);

/// Adds a column `name` of one value per part. @param places  of the parts [m]  @param values  shape of places
void add_part_values(const FieldView& field, std::span<const Vec3> places, std::span<const double> values,
                     const std::string& name, const Executor& executor, Mesh& mesh);

/// Adds the column "speed": the length of the mean of the parts' velocities at each vertex [m/s].
void add_speed(const FieldView& field, std::span<const PartMotion> parts, const Executor& executor, Mesh& mesh);

}  // namespace supple::implicit
