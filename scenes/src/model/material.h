/// @file material.h
/// Masses, bonds, damping and contact of an object that follow from the physical properties of its material.
///
/// The volume V that the surface encloses at the start gives masses and thickness. Bonds of linear stiffness along and across join
/// neighbours (k_n and k_t), with rotations in between (k_theta); see `BondFrame` in core/pair_laws.h.
///
/// - Blocks: cells between eight particles, with bonds along edges and face diagonals of equal k_n and k_t = alpha k_n, are isotropic with
///   nu = (1 - alpha)/(4 + alpha) and E s = k_n (2 + 3 alpha)(1 + nu) for spacing s (sums over the directions of bonds; Born & Huang 1954).
///   Outer cells are wider by the distance of the surface to the outer particles, so that all cells fill V. k_theta adds what the cells lack
///   of the bending stiffness E W^3 / 12 across the least width W.
/// - Sheets (one layer): the same in a plane, diagonals of half the stiffness, alpha = (1 - 3 nu)/(1 + nu); thickness h by V, bending E h^3 / 12.
/// - Other solids (balls, filled meshes): the bonds of blocks, all equal, without k_theta; E is met on average, about a tenth less near the surface.
/// - Points with bonds: particles that fill shares of the solid, with bonds by the sections of the faces between them (model/bond_stiffness.h).
/// - Points with normals: a shell, with frames in its plane and directed_form of the measured curvatures across.
/// - Rods (lines, rings, spirals, curves): round, of the radius that gives V: EA, EI and GJ (of nu = 1/4) by k_n, k_t and k_theta.
#pragma once

#include <string>
#include <vector>

#include "model/model_faults.h"
#include "supple/collision/bodies.h"
#include "supple/core/arrange.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Volume of each particle [m^3], shape [particles]: of the solid that it carries alone where it is a body of its own, else its share of
/// the volume that the surface of all encloses. A fault where there is no surface. @pre d.material
[[nodiscard]] std::vector<double> material_volumes(const ObjectDesc& d, const std::string& key, const core::Arrangement& arrangement,
                                                   const implicit::Skeleton& skeleton, ModelFaults& faults);

/// Half size of a cube of this volume as `inertia_radius`: a in 2/5 m a^2 = m w^2 / 6 [m].
[[nodiscard]] double cube_inertia_radius(double volume);

/// Surface of an object of this material. The pressure rises like that of a layer of modulus E as thick as the least distance from the surface to the
/// middle, p = E depth / thickness; keys of `contact` win.
[[nodiscard]] collision::ContactMaterial contact_material(const ObjectDesc& d, const implicit::Skeleton& skeleton);

/// Adds bonds and Rayleigh damping of the material to the model. @param object  with `solid_volume`   @pre d.material
void add_material_laws(const ObjectDesc& d, const ObjectModel& object, const std::string& key, Model& model, ModelFaults& faults);

}  // namespace supple::scenes
