/// @file supple/implicit/mesh_motion.h
/// Velocity of the surface of a body and the owning part, as columns of its mesh.
#pragma once

#include <cstdint>
#include <span>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// A part (particle) of a body as a rigid motion.
struct PartMotion {
  Vec3 centre = Vec3::Zero();            ///< [m]
  Vec3 velocity = Vec3::Zero();          ///< of the centre [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  std::uint32_t id = 0;                  ///< value of "owner"
};

/// The field shortly before and after the present time, with parts carried and all other data changed.
struct FieldMoments {
  FieldView before, after;
  double apart = 0.0;  ///< time between the two [s], > 0
};

/// Adds the columns "velocity_x", "velocity_y", "velocity_z" [m/s] and "owner" (id of the part with the largest share of
/// the field) to a mesh. Along the normal the velocity is that of the moving surface, dF/dt / |grad F| with every part's
/// field carried rigidly (Witkin & Heckbert 1994, sec. 3); across it, the parts' velocities weighted by their fields.
/// @param parts    by the field's part index
/// @param moments  where dF/dt is not that of rigid parts but is found by a difference: kernels are scaled, or a blend fades;
///                 null: nowhere
void add_motion(const FieldView& field, std::span<const PartMotion> parts, const Executor& executor, Mesh& mesh,
                const FieldMoments* moments = nullptr);

}  // namespace supple::implicit
