/// @file supple/scenes/looks.h
/// Keys that affect only pictures: materials, cameras, lights. A run can be resumed with other values of these.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple::scenes {

enum class PatternName : std::uint8_t { Checker, Stripes, Picture };

/// objects[].look.texture, obstacles[].texture, ground.texture
struct TextureDesc {
  PatternName pattern = PatternName::Checker;
  Vec3 colour = Vec3(0.95, 0.95, 0.93);  ///< checker, stripes: the second colour, sRGB
  double size = 0.1;                  ///< [m]
  Vec3 axis = Vec3::UnitX();          ///< stripes: direction across them
  std::string file;                   ///< picture: PNG beside the scene
};

enum class ColourByName : std::uint8_t { Colour, Pressure, Stretch, Speed, Normals };
enum class MapName : std::uint8_t { Viridis, Magma, Coolwarm, Turbo, Grey };

enum class BodyName : std::uint8_t { Opaque, Translucent, Glass };

/// objects[].look
struct LookDesc {
  double metallic = 0.0;
  double reflectance = 0.04;          ///< of non-metals at normal incidence
  double opacity = 1.0;
  BodyName body = BodyName::Opaque;
  double index = 1.5;                 ///< glass: of refraction
  std::optional<double> depth;        ///< translucent: mean free path; glass: way over which light takes the colour [m]; absent: by the thickness
  std::optional<TextureDesc> texture;
  ColourByName colour_by = ColourByName::Colour;
  MapName map = MapName::Viridis;
  Vec3 range = Vec3(0, 1, 0);         ///< values at the two ends of the map, in SI units
  bool scale_bar = true;
  bool surface = true;
  bool wireframe = false;
  double smooth = 0.0;                ///< width of the dimples that pictures even out [m]; 0: none
  double frames = 0.0;                ///< length of the arrows at each particle [m]; 0: none
  double bonds = 0.0;                 ///< radius of the rods between bonded particles [m]; 0: none
};

/// cameras[].keys[]
struct CameraKeyDesc {
  double time = 0.0;                  ///< [s]
  Vec3 from = Vec3(0.4, -2.6, 1.4);
  Vec3 look_at = Vec3::Zero();
  double field_of_view = 0.61;        ///< [rad] (key field_of_view_deg)
};

/// camera, cameras[]
struct CameraDesc {
  std::string name;                   ///< empty: the only camera
  std::optional<Vec3> from;           ///< absent: a place from which the initial scene is in view (`Model::cameras`)
  std::optional<Vec3> look_at;        ///< absent: the middle of the initial scene
  Vec3 up = Vec3::UnitZ();
  double field_of_view = 0.61;        ///< vertical [rad] (key field_of_view_deg)
  double aperture = 0.0;              ///< radius of the lens [m]
  std::optional<double> focus;        ///< distance that is sharp [m]; absent: distance of look_at
  double turntable = 0.0;             ///< rotation about 'up' through look_at during the scene [rad] (key turntable_deg)
  std::vector<CameraKeyDesc> keys;    ///< by time; instead of from, look_at and field_of_view
};

struct LightDesc {
  Vec3 direction = Vec3(-0.50, 0.40, -1.0);
  double intensity = 3.0;             ///< irradiance over pi, relative to the radiance of the sky
  double softness = 0.045;            ///< angular radius [rad] (key softness_deg)
};

/// lights[]: rectangles that shine on the side they face
struct AreaLightDesc {
  Vec3 at = Vec3::Zero();             ///< [m]
  Vec3 facing = Vec3(0, 0, -1);
  Vec3 half_sizes = Vec3(0.5, 0.5, 0);  ///< across and along [m]
  Vec3 colour = Vec3::Ones();         ///< sRGB
  double intensity = 5.0;             ///< radiance, relative to that of the sky
};

enum class RendererName : std::uint8_t { Gl, Path };

/// render: how pictures are drawn
struct RenderDesc {
  RendererName renderer = RendererName::Gl;
  std::optional<double> pixel_error;  ///< largest distance of meshes to surfaces [pixel]; absent: by output.cell
  double noise = 0.1;                 ///< path: standard error of a pixel over its brightness, before the filter
  int most_samples = 256;             ///< path: per pixel, a power of two
  bool denoise = true;                ///< path
  bool exact_surface = true;          ///< path: rays intersect the field, not the triangles
  double shutter = 0.0;               ///< path: exposure over the time between frames
};

struct BackgroundDesc {
  Vec3 top = Vec3(0.40, 0.45, 0.52);     ///< sRGB
  Vec3 bottom = Vec3(0.80, 0.80, 0.79);  ///< sRGB
};

}  // namespace supple::scenes
