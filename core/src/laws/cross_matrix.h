#pragma once

#include "supple/core/types.h"

namespace supple::core {

/// [v]: the matrix of v x.
inline Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace supple::core
