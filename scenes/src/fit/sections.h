/// @file sections.h
/// Sections of the bonds of a packing, such that the body stretches and bends by the modulus of its material.
#pragma once

#include <vector>

#include "fit/packing.h"

namespace supple::fit {

/// Areas of the faces between shares, times one factor for bonds within the outer layer of particles and another one for all others. With the faces alone every
/// particle is at rest in a uniform stress where Poisson's ratio is 0 (Bolander & Saito 1998); the factors correct what is left: bonds of pairs have no stiffness of
/// their own against bending, frames have too much, and outer shares lack neighbours. Uniform tension and pure bending, which are exact solutions in a body of any
/// shape (Saint-Venant), are applied as tractions along the principal axes, and the factors are those for which the least-squares strain and curvature of the
/// middle are exact on average, weighted by the squares of the moments of inertia, so mostly along the length of a body.
/// The lattice is a body of cubes: tractions of the stresses are summed over its squares, and strains and curvatures are those of the solid, by the ratio of
/// the sections of both.
/// @param mesh  closed, of positive volume
/// @param lattice  of which the particles have shares
/// @return one area for each bond; those of the faces for less than 8 or more than 3000 particles
[[nodiscard]] std::vector<double> bond_sections(const Mesh& mesh, const Surroundings& lattice, const Packing& packing, double poissons_ratio);

}  // namespace supple::fit
