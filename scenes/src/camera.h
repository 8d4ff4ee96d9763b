/// Where the cameras of a scene are at a time.
#pragma once

#include <span>

#include "supple/render/view.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// `cameras`, or the one `camera`.
[[nodiscard]] std::span<const CameraDesc> cameras_of(const Scene& scene);

/// Keys are joined by cubic Hermite curves whose slopes are those of the chord over each key (Catmull & Rom 1974, uneven
/// times) and 0 at the ends; the turntable turns at an even rate.
[[nodiscard]] render::Camera camera_at(const CameraDesc& desc, double time, double duration);

}  // namespace supple::scenes
