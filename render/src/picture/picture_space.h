/// @file picture_space.h
/// The coordinates in which a picture is computed. Single precision, thresholds and floors of both renderers hold for lengths near 1 and positions near 0, so
/// a picture has its own origin and its own unit of length: a scene of nanometres, of kilometres, or far from the origin of the world
/// looks like the same scene of metres beside it.
#pragma once

#include <span>

#include "supple/render/view.h"

namespace supple::render {

struct PictureSpace {
  Vec3 origin = Vec3::Zero();  ///< in the world [m]
  double per_metre = 1.0;      ///< units in a metre, a power of two: changing to them leaves every mantissa as it is

  PictureSpace() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): a place is a space of metres
  PictureSpace(const Vec3& at, double units_in_a_metre = 1.0) : origin(at), per_metre(units_in_a_metre) {}
  [[nodiscard]] Vec3 place(const Vec3& world) const { return per_metre * (world - origin); }
  [[nodiscard]] Vec3 world(const Vec3& place) const { return place / per_metre + origin; }
  bool operator==(const PictureSpace&) const = default;
};

/// A view in the lengths of its picture.
struct LocalView {
  PictureSpace space;
  View view;            ///< looks at zero
  Vec3 pattern_origin;  ///< of the ground's pattern
};

/// The unit is near the distance of the camera, the origin is what it looks at. Of a camera that looks far past all items, or not half
/// as far as the first of them, it is a point nearer to them on the same line.
/// @throws Error{Usage} when the eye is at look_at
[[nodiscard]] LocalView localised(const View& view, std::span<const Item> items);

/// A place near `place` [m] where a pattern looks as it does at zero, so that differences from there, in single precision, tell its colours.
/// @param on_ground  only x and y count
[[nodiscard]] Vec3 same_in_pattern(const Paint& paint, const Vec3& place, bool on_ground = false);

}  // namespace supple::render
