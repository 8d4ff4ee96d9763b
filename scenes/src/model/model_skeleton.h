/// @file model_skeleton.h
/// The skeletons and blending of a model.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/model_faults.h"
#include "supple/implicit/skeleton.h"

namespace supple::scenes {

/// Index of a particle of an object of n, negative ones from the end; none, with a fault at `key`, where there is no such particle.
[[nodiscard]] std::optional<std::uint32_t> particle_index(int given, std::uint32_t n, const std::string& key, ModelFaults& faults);

/// The primitives of an object of n particles, in the order of the particles.
/// @param volume  receives the target volume of each primitive, or 0 [m^3]
[[nodiscard]] implicit::Skeleton build_skeleton(const ObjectDesc& d, const std::string& key, std::uint32_t n, std::vector<double>& volume,
                                                ModelFaults& faults);

/// The blend of the particles of an object. @param rest  their rest positions
[[nodiscard]] implicit::Blend blend_of(const BlendDesc& d, const std::string& key, std::span<const Vec3> rest, ModelFaults& faults);

/// Components and groups of a blending graph.
struct BlendComponents {
  std::vector<std::uint32_t> first;  ///< for each part: the first part that it is connected with, directly or through others
  std::vector<std::uint32_t> group{};  ///< first parts of the nodes that are connected with some node through others only; sorted
};
/// @param parts  of the blend's body
[[nodiscard]] BlendComponents blend_components(const implicit::Blend& blend, std::uint32_t parts);

/// The ellipsoid that has the second moments of a solid about the origin of its particle.
struct CarriedSolid {
  Vec3 axes = Vec3::Zero();        ///< semi-axes [m]
  Quat turn = Quat::Identity();    ///< their directions, in the particle's frame
};

/// Moments of the solid that a particle carries alone; exact for a ball, within a hundredth otherwise. Zero without a surface.
/// @param own_axes  takes the moments along the particle's axes and leaves out their products: the turn is none
[[nodiscard]] CarriedSolid carried_solid(const implicit::Skeleton& object, std::uint32_t part, bool own_axes);

/// Rotates the frames of the parts while primitives keep their poses in space. @param turn  shape [part_count]
void turn_primitives(std::span<const Quat> turn, implicit::Skeleton& skeleton);

}  // namespace supple::scenes
