/// @file energy_columns.h
/// The contact energy of bodies of which one may be far thinner than both are wide.
#pragma once

#include "supple/collision/bodies.h"

namespace supple::collision {

/// Where two bodies are compared: A is moved by `shift`, and both may have pressure inside `box`, which is finite and not empty.
struct ShiftedPair {
  const ContactBody* a = nullptr;
  const ContactBody* b = nullptr;
  Vec3 shift = Vec3::Zero();
  Box box;
};

/// Integral of [min(p_A, p_B)]+ dV [J] by columns parallel to `along` (unit). Within a column bounds of the gradients limit the steps, so that no part thicker
/// than 2^-13 of the longest column is stepped over. Columns are divided where their sums change from one to the next, and where such bounds leave room beside
/// a column without pressure. @param most  columns, about
[[nodiscard]] double column_energy(const ShiftedPair& pair, const Vec3& along, int most);

}  // namespace supple::collision
