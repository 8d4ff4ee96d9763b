/// @file supple/implicit/kinks.h
/// Where derivatives of a field jump: between the regions of a shape whose nearest point is on a face, an edge or a corner,
/// and where a kernel changes its formula or ends. Quadrature rules split their intervals there.
#pragma once

#include <cstdint>
#include <vector>

#include "supple/core/types.h"

namespace supple::implicit {

class Field;

/// {s = 0} of a function s that is smooth near there.
struct Kink {
  enum class Form : std::uint8_t {
    Plane,   ///< s = first row of `to_local` . (x - origin) - level
    Offset,  ///< at the distance `level` from the box [-half, half], measured in y = to_local (x - origin)
    Disc,    ///< the same from the disc of radius half.x in y_z = 0
  };
  Form form = Form::Plane;
  Vec3 origin = Vec3::Zero();           ///< world [m]
  Mat3 to_local = Mat3::Identity();
  Vec3 half = Vec3::Zero();             ///< [m]
  double level = 0.0;                   ///< [m]; > 0 except for planes
  int order = 2;                        ///< of the lowest derivative of the field that jumps there, at least

  /// s [m], a signed distance to first order where `to_local` does not stretch, and its gradient [1].
  [[nodiscard]] double value(const Vec3& x, Vec3& gradient) const noexcept;
  [[nodiscard]] double value(const Vec3& x) const noexcept;
  /// Largest change of s within a distance of x [m].
  [[nodiscard]] double change(const Vec3& x, double distance) const noexcept;
};

/// Appends the kinks of the primitives whose supports may meet the box; some of them may not meet the box, or the body.
/// @return whether these are all kinks: false for curves, superquadrics and convolved primitives, for arcs, rings and tapered segments beside
///         others or of kernels of several formulas, for arcs and rings whose axis may meet the box, and not for fields that combine their
///         parts by another rule than the sum
bool kinks_of(const Field& field, const Box& box, std::vector<Kink>& out);

}  // namespace supple::implicit
