/// @file scale_object.h
/// Objects enlarged or reduced by their key `scale`.
#pragma once

#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Multiplies the lengths of an object by its `scale`: those of the particles' arrangement, of the skeleton, of 'within' and of meshing.
void scale_lengths(ObjectDesc& d);

}  // namespace supple::scenes
