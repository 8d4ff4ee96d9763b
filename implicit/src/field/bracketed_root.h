/// @file bracketed_root.h
#pragma once

#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Ends of a part of a line and F there, of opposite signs.
struct Bracket {
  double low, f_low, high, f_high;
};

/// Root of F on a + t along in the bracket; returns t. Newton kept in its bracket, and bisection whenever a step is not half of
/// the one before.
[[nodiscard]] double bracketed_root(const FieldView& field, const Vec3& a, const Vec3& along, const Bracket& bracket);

}  // namespace supple::implicit
