#pragma once

#include <cstdint>

#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// `evaluate_parts` of a field that is one part everywhere.
template <class Solid>
void evaluate_single_part(const Solid& solid, std::span<const Vec3> points, FieldParts& parts) {
  const std::size_t n = points.size();
  parts.offset.resize(n + 1);
  for (std::size_t i = 0; i <= n; ++i) parts.offset[i] = static_cast<std::uint32_t>(i);
  parts.part.assign(n, 0);
  parts.value.resize(n);
  parts.gradient.resize(n);
  solid.evaluate(points, parts.value, parts.gradient);
}

}  // namespace supple::implicit
