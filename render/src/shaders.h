/// @file shaders.h
/// The shaders of the picture, GLSL 3.30. A geometry pass keeps normal, id and depth of every sample; one pass over the
/// picture then lights each surface of a pixel once, so that its price does not grow with the number of triangles.
/// Ids in the geometry buffer: 0 no item, 1 + item. Items whose colour is not one for all (`painted`) write it, too.
#pragma once

#include <string>

namespace supple::render::shaders {

// Vertex stages.
[[nodiscard]] std::string position_only();  ///< to_clip
[[nodiscard]] std::string surface();        ///< with the normal
[[nodiscard]] std::string painted_surface();  ///< and with what decides the colour
[[nodiscard]] std::string whole_picture();  ///< one triangle that covers the target at depth `plane` (clip)

// Fragment stages; `samples` is that of the geometry buffer.
[[nodiscard]] std::string nothing();                      ///< depth only
[[nodiscard]] std::string height_range();                 ///< -lowest and highest point above the ground, for GL_MAX
[[nodiscard]] std::string ground_occlusion();             ///< share of the sky a ground point sees past that range
[[nodiscard]] std::string geometry();                     ///< normal and id
[[nodiscard]] std::string painted_geometry();             ///< and the square root of the albedo
[[nodiscard]] std::string screen_occlusion(int samples);  ///< ambient occlusion of items at half size, with depth
[[nodiscard]] std::string occlusion_blur();
[[nodiscard]] std::string classify(int samples);          ///< background; depth .1 ground, .5 nothing, .9 items
[[nodiscard]] std::string lit_ground();                   ///< for pixels of ground alone
/// For pixels with at least one sample on an item; `painted`: albedos of the geometry buffer where a material says so.
[[nodiscard]] std::string lit_items(int samples, bool painted);

}  // namespace supple::render::shaders
