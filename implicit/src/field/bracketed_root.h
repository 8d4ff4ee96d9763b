/// @file bracketed_root.h
#pragma once

#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Root of F on a + t along between t = low and t = high, whose values have opposite signs; returns t. Newton kept in
/// its bracket, and bisection whenever a step is not half of the one before.
[[nodiscard]] double bracketed_root(const FieldView& field, const Vec3& a, const Vec3& along, double low, double f_low, double high,
                                    double f_high);

}  // namespace supple::implicit
