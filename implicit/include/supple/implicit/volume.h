/// @file supple/implicit/volume.h
/// A body's volume kept near a target by scaling its kernels (Desbrun & Gascuel 1995): a proportional-derivative
/// controller on the measured volume. The paper shifts a kernel, f(d - epsilon); here its lengths are
/// multiplied by a scale, which keeps it smooth at the skeleton and compact.
#pragma once

#include <cstddef>
#include <vector>

#include "supple/core/hash.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

/// Volume of {F >= 0} by cubic cells [m^3]: full cells where bounds prove it, the others by their part on the inner side of
/// the tangent plane at the foot point of their centre, with a correction for curvature. Exact for planes; relative to
/// the volume it errs by about a third of (cell / radius of curvature)^4, the same for every kernel; second order at creases.
/// Changes smoothly while the surface moves.
/// Takes time by the cells of the body, not by those of the box around it.
/// @param cell  [m], > 0; where the support ends closer to the surface than a cell, the cells beyond are unknown; less than 1e-12 of
/// the largest coordinate counts as that
/// @pre the surface box is bounded
[[nodiscard]] double enclosed_volume(const FieldView& field, double cell);

/// The same by part: a cell is shared by the planes where its strongest parts are equal, so the territories of all parts add up to
/// `enclosed_volume` up to rounding. With cells of a sixth of the least iso radius a part errs by about 1e-3. Shape [part_count].
[[nodiscard]] std::vector<double> part_volumes(const FieldView& field, double cell, std::size_t part_count);

/// The same body with every primitive on a part of its own, numbered like the primitives: `part_volumes` of its field, placed
/// with the pose of each primitive's own part, are those of the primitives.
[[nodiscard]] Skeleton by_primitive(const Skeleton& skeleton);

/// The primitive with all lengths of its kernel (of its support, for shapes that give that) multiplied by `scale` > 0; values
/// on the kernel's range stay, slopes are divided by it. The shape's own size stays.
[[nodiscard]] Primitive scaled(const Primitive& primitive, double scale);

struct VolumeControl {
  double target = 0.0;   ///< V0 [m^3], > 0
  double rate = 2.0;     ///< alpha [1/s]
  double damping = 0.05; ///< beta [1], < 1/6
};

/// Part of State, by body, part or primitive.
struct VolumeState {
  double scale = 1.0;    ///< of the kernels
  double volume = 0.0;   ///< at the last step [m^3]; 0: not measured yet
  double rate = 0.0;     ///< d(scale)/dt / scale of the last step [1/s]
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

inline constexpr double kLeastScale = 0.25, kLargestScale = 4.0;

/// One step: d(scale)/scale = (alpha (V0 - V) dt - beta (V - V_last)) / V0, at most 2 % a step, the scale kept in this range. alpha dt counts
/// as 1/3 at most, with which a ball, whose volume is as the third power of its scale, gets to V0 in one step: more would overshoot.
void control_volume(const VolumeControl& control, double volume, double dt, VolumeState& state) noexcept;

}  // namespace supple::implicit
