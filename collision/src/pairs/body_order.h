/// @file body_order.h
/// Which of two bodies comes first, whichever is named first, and the axes that they give: what is chosen by these changes neither with the
/// order of bodies nor with the axes of the world.
#pragma once

#include "supple/collision/bodies.h"

namespace supple::collision {

/// Of the first part; the origin where a body has none.
[[nodiscard]] inline Vec3 first_place(const ContactBody& body) { return body.pose.empty() ? Vec3::Zero().eval() : body.pose.front().position; }

/// Whether the first of two bodies comes first: by what they are, then by how each sees the way to the other.
[[nodiscard]] bool leads(const ContactBody& one, const ContactBody& other);

/// Whether two bodies press alike everywhere, as what they are and where they lie is the same, bit by bit.
[[nodiscard]] bool coincide(const ContactBody& one, const ContactBody& other);

/// That of the first part of the body that leads, or of the other where only that one has a skeleton, which lies as its pose says; world axes where
/// neither has.
[[nodiscard]] Pose common_pose(const ContactBody& leading, const ContactBody& other);

}  // namespace supple::collision
