/// @file shaders.h
/// The shaders of the picture, GLSL 3.30. A geometry pass keeps normal, id and depth of every sample; one pass over the
/// picture then lights each surface of a pixel once, so that its price does not grow with the number of triangles.
/// Ids in the geometry buffer: 0 no item, 1 + item, and a bit for fixed items. Items whose colour is not one for all (`painted`) write it, too.
#pragma once

#include <compare>
#include <string>

namespace supple::render::shaders {

/// Features that the lighting of a picture needs. Branches cost time even where none is taken, so each choice has programs of its own.
struct Lighting {
  int samples = 1;            ///< of the geometry buffer
  bool painted = false;       ///< albedos of the geometry buffer where a material requires it
  bool area_lights = false;
  bool ground_paint = false;
  bool inside = false;        ///< light goes into some of the items
  bool scene_linear = false;  ///< radiance times cover, and cover, instead of the display's colours
  auto operator<=>(const Lighting&) const = default;
};

// Vertex stages.
[[nodiscard]] std::string position_only();  ///< to_clip
[[nodiscard]] std::string surface();        ///< with the normal
[[nodiscard]] std::string painted_surface();  ///< and the attributes of the colour
[[nodiscard]] std::string whole_picture();  ///< one triangle that covers the target at depth `plane` (clip)

// Fragment stages; `samples` is that of the geometry buffer.
[[nodiscard]] std::string nothing();                      ///< depth only
[[nodiscard]] std::string ground_occlusion();             ///< share of the sky a ground point sees past the height map
[[nodiscard]] std::string passed_by_glass();              ///< share of the sun that passes a face of glass
[[nodiscard]] std::string geometry();                     ///< normal and id
[[nodiscard]] std::string painted_geometry();             ///< and the square root of the albedo
[[nodiscard]] std::string screen_occlusion(int samples);  ///< ambient occlusion of items at half size, with depth
[[nodiscard]] std::string occlusion_blur();
[[nodiscard]] std::string classify(const Lighting& lighting);    ///< background; depth .1 ground, .5 nothing, .9 items
[[nodiscard]] std::string lit_ground(const Lighting& lighting);  ///< for pixels of ground alone
[[nodiscard]] std::string lit_items(const Lighting& lighting);   ///< for pixels with at least one sample on an item

}  // namespace supple::render::shaders
