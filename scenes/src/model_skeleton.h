/// @file model_skeleton.h
/// The part of a model that gives particles their surfaces.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model_faults.h"
#include "supple/implicit/skeleton.h"

namespace supple::scenes {

/// Index of a particle of an object of n, negative ones from the end; none, with a fault at `key`, where there is no such particle.
[[nodiscard]] std::optional<std::uint32_t> particle_index(int given, std::uint32_t n, const std::string& key, ModelFaults& faults);

/// The primitives of an object of n particles, in the order of the particles.
/// @param volume  receives what the scene says each primitive holds, or 0 [m^3]
[[nodiscard]] implicit::Skeleton build_skeleton(const ObjectDesc& d, const std::string& key, std::uint32_t n, std::vector<double>& volume,
                                                ModelFaults& faults);

/// How the particles of an object blend. @param rest  their places
[[nodiscard]] implicit::Blend blend_of(const BlendDesc& d, const std::string& key, std::span<const Vec3> rest, ModelFaults& faults);

/// Semi-axes of the ellipsoid whose second moments along a particle's axes are those of the solid that it carries alone;
/// exact for a ball, within a hundredth otherwise, within some of those that are thin askew. Zero without a surface.
[[nodiscard]] Vec3 enclosed_axes(const implicit::Skeleton& object, std::uint32_t part, bool planar);

}  // namespace supple::scenes
