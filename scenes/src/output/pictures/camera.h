/// Positions of the cameras of a scene in time.
#pragma once

#include <span>
#include <vector>

#include "supple/render/view.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// `cameras`, or the one `camera`.
[[nodiscard]] std::span<const CameraDesc> cameras_of(const Scene& scene);

/// The same, with positions for cameras without one: the box fills the middle four fifths of the picture; an empty box
/// leaves them at the origin. @param seen  bounding box of the initial surfaces [m]
[[nodiscard]] std::vector<CameraDesc> placed_cameras(const Scene& scene, const Box& seen);

/// Width over height of the pictures.
[[nodiscard]] double aspect_of(const Scene& scene);

/// Whether a camera has no position yet.
[[nodiscard]] bool is_open(const CameraDesc& desc);

/// Keys are joined by cubic Hermite curves whose slopes are those of the chord over each key (Catmull & Rom 1974, uneven
/// times) and 0 at the ends; the turntable turns at a constant rate. @pre the camera has keys or a position
[[nodiscard]] render::Camera camera_at(const CameraDesc& desc, double time, double duration);

/// Whether anything of a box, or of the shadow it throws, may be in the picture. Conservative: false only where the box and
/// all points in its shadow lie outside one side of the view frustum, or behind the camera.
/// @param aspect    width over height
/// @param softness  angular radius of the sun [rad]
[[nodiscard]] bool may_show(const render::Camera& camera, double aspect, const Vec3& light, double softness, const Box& box);

/// The largest lattice cell whose mesh of a surface of curvature radius `radius` stays within `error` pixels of it where it
/// is seen from `distance` away: a chord h misses an arc by h^2 / (8 R).
/// @param pixel  tangent of the angle of a pixel
[[nodiscard]] double cell_for(double error, double pixel, double distance, double radius);

}  // namespace supple::scenes
