/// @file supple/render/view.h
/// The content of a picture for all renderers: camera, lights, ground, and items with their materials. Colours are sRGB in
/// [0, 1] and become linear light (IEC 61966-2-1) before anything is computed with them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "supple/core/mesh.h"
#include "supple/core/types.h"
#include "supple/render/colour_map.h"
#include "supple/render/image.h"

namespace supple::render {

struct Camera {
  Vec3 from = Vec3(0, -4, 2);     ///< [m]
  Vec3 look_at = Vec3::Zero();    ///< [m]
  Vec3 up = Vec3::UnitZ();        ///< looking along it, y is up in the picture
  double field_of_view = 0.61;    ///< vertical [rad], in (0, pi)
  double aperture = 0.0;          ///< radius of a thin lens [m]; 0: everything is sharp (path tracer)
  double focus = 0.0;             ///< distance that is sharp, along the line of sight [m]; 0: distance of look_at
};

struct Light {
  Vec3 direction = Vec3(-0.50, 0.40, -1.0);  ///< direction in which the light travels
  double intensity = 3.0;                    ///< irradiance over pi, relative to the radiance of the sky
};

/// A rectangular light that shines on one side.
struct AreaLight {
  Vec3 at = Vec3::Zero();                    ///< centre [m]
  Vec3 facing = -Vec3::UnitZ();              ///< direction in which it shines
  Eigen::Vector2d half_sizes = {0.5, 0.5};   ///< [m]; the first is horizontal
  Vec3 colour = Vec3::Ones();                ///< sRGB
  double radiance = 5.0;                     ///< relative to that of the sky
};

/// Source of the colour of an item. Patterns are in object coordinates: the columns "rest_x", "rest_y", "rest_z"
/// of the mesh [m], or world positions where it has none, so they move and deform with the body.
enum class PaintKind : std::uint8_t {
  Plain,    ///< Item::colour
  Checker,  ///< cubes of Item::colour and Paint::colour, alternating
  Stripes,  ///< the same in slices across Paint::axis
  Picture,  ///< an image, projected along the three axes and mixed by the slope of the surface there
  Values,   ///< a column of the mesh through a colour map
  Normals,  ///< (n + 1) / 2
};

struct Paint {
  PaintKind kind = PaintKind::Plain;
  Vec3 colour = Vec3(0.95, 0.95, 0.93);           ///< second colour of Checker and Stripes
  double size = 0.1;                              ///< edge of a cube, thickness of a slice, width of the image [m]
  Vec3 axis = Vec3::UnitX();                      ///< Stripes
  std::shared_ptr<const Image> picture = nullptr; ///< Picture
  std::string column = {};                        ///< Values; a mesh without it shows the lower end
  ColourMap map = ColourMap::Viridis;             ///< Values
  double lower = 0.0;                             ///< Values: values at the ends of the map
  double upper = 1.0;
};

struct Ground {
  double height = 0.0;                       ///< z [m]
  Vec3 colour = Vec3(0.58, 0.57, 0.55);      ///< sRGB, fades to the background with distance
  Paint paint = {};                          ///< Checker, Stripes or Picture, by world x and y; or Plain
};

/// Values and gradients of a field at points [m]; inside > 0. Called from several threads at once.
using SurfaceField = std::function<void(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients)>;

/// What light does that goes into an item, whose mesh is then closed.
enum class InsideKind : std::uint8_t {
  Opaque,   ///< comes back where it goes in
  Scatter,  ///< scatters evenly in all directions until it leaves; the mean over a thick body is Item::colour
  Glass,    ///< is refracted at the smooth surface, whatever Item::roughness says
};

struct Inside {
  InsideKind kind = InsideKind::Opaque;
  double index = 1.5;                        ///< Glass: of refraction, above 1
  double depth = 0.0;                        ///< Scatter: mean free path, above 0; Glass: way over which white light takes the item's colour, 0: clear [m]
};

struct Item {
  const Mesh* mesh = nullptr;                ///< may be empty
  Vec3 colour = Vec3(0.8, 0.8, 0.8);         ///< sRGB in [0, 1]; of a metal, that of its reflection
  double roughness = 0.45;                   ///< (0, 1]
  bool two_sided = false;                    ///< draws back faces, too: for surfaces that are not closed
  double metallic = 0.0;                     ///< 0: dielectric of index 1.5, 1: metal
  double opacity = 1.0;                      ///< (0, 1]; OpenGL: in steps of 1 / samples
  Paint paint = {};
  bool surface = true;                       ///< false: only the `wireframe` is drawn
  double reflectance = 0.04;                 ///< of the clear coat at normal incidence; 0: matt
  SurfaceField field = {};                   ///< field whose zero set the mesh approximates; the path tracer intersects it instead of the triangles
  double field_reach = 0.0;                  ///< largest distance of the surface from its triangle [m]
  Inside inside = {};
  bool wireframe = false;                    ///< edges of the triangles, dark on a surface, in the item's colour without
  bool fixed = false;                        ///< a part of what does not give way: OpenGL draws no line of contact where two of them meet
};

struct View {
  Camera camera;
  Light light;
  std::optional<Ground> ground;
  Vec3 background_top = Vec3(0.40, 0.45, 0.52);     ///< sRGB
  Vec3 background_bottom = Vec3(0.80, 0.80, 0.79);  ///< sRGB
  std::vector<AreaLight> area_lights = {};          ///< OpenGL uses the first four
};

}  // namespace supple::render
