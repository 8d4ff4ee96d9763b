/// @file contact_bodies.h
/// The bodies of a frame that contact looks at.
#pragma once

#include "simulation/frame.h"

namespace supple::scenes {

constexpr std::size_t kBodyBlock = 16;  ///< bodies of one task

[[nodiscard]] inline bool has_surface(const Body& body) { return !body.skeleton.primitive.empty(); }

[[nodiscard]] inline bool collides(const StageContext& context, const Body& body) {
  return has_surface(body) && context.model.objects[body.object].collides;
}

/// Calls use(i) for every body that is awake and collides.
template <class Use>
void for_awake(const StageContext& context, const Use& use) {
  const std::size_t count = context.awake != nullptr ? context.awake->size() : context.bodies.size();
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = context.awake != nullptr ? (*context.awake)[k] : k;
    if (collides(context, context.bodies[i])) use(i);
  }
}

/// The same from several threads; bodies share no data there.
template <class Use>
void for_awake_at_once(const StageContext& context, const Use& use) {
  const std::size_t count = context.awake != nullptr ? context.awake->size() : context.bodies.size();
  context.executor.for_blocks(count, kBodyBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t i = context.awake != nullptr ? (*context.awake)[k] : k;
      if (collides(context, context.bodies[i])) use(i);
    }
  });
}

/// The field of a body that is placed; nothing to do where this frame has it.
void index_body(const StageContext& context, std::size_t body, Frame& frame);

/// What contact sees of one body: its field, material, motion and samples.
void view_body(const StageContext& context, const core::ParticleState& particles, std::size_t body, Frame& frame);

}  // namespace supple::scenes
