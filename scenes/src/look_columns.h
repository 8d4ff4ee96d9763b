/// Columns of a body's mesh that its look asks for: rest coordinates for textures, stretch of bonds, speed.
#pragma once

#include "supple/core/executor.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Calls f(first, second) for every bonded pair of every law.
template <class F>
void for_each_bond(const core::Interactions& laws, const F& f) {
  const auto each = [&f](const auto& list) {
    for (const auto& law : list)
      for (std::size_t b = 0; b < law.first.size(); ++b) f(law.first[b], law.second[b]);
  };
  each(laws.cohesion), each(laws.form), each(laws.form_radius), each(laws.bond_frame), each(laws.coplanarity);
  each(laws.normalised_coplanarity), each(laws.co_normality), each(laws.co_circularity);
  each(laws.normalised_co_circularity), each(laws.lennard_jones), each(laws.linear_cohesion);
  each(laws.directed_cohesion), each(laws.tabulated_cohesion), each(laws.directed_form), each(laws.literal_form);
}

/// @param poses  of the body's particles
void add_look_columns(const Model& model, const Body& body, const core::ParticleState& particles,
                      const core::Interactions& laws, const implicit::FieldView& field, std::span<const Pose> poses,
                      const Executor& executor, Mesh& mesh);

}  // namespace supple::scenes
