/// @file symmetry.h
/// Lines that two bodies are the same all around.
#pragma once

#include <optional>

#include "supple/collision/bodies.h"
#include "surface/find_peak.h"

namespace supple::collision {

/// @param overlap  of the bodies; how far it reaches says what counts as on a line
/// @return a line about which both bodies look the same, as far as their skeletons and cores tell
std::optional<CommonAxis> axis_of_symmetry(const ContactBody& a, const ContactBody& b, const Box& overlap);

}  // namespace supple::collision
