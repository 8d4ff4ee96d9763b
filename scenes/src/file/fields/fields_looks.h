/// @file fields_looks.h
/// The keys that affect only pictures; see fields.h.
#pragma once

#include <algorithm>
#include <string>

#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"
#include "supple/scenes/looks.h"

namespace supple::scenes {

template <class Archive>
void fields(Archive& archive, TextureDesc& d) {
  using enum PatternName;
  archive("pattern", d.pattern, {}, "pattern that moves and deforms with the body; picture: projected along the three axes of the object, on the ground from above");
  archive("colour", d.colour, between(0.0, 1.0, kNumber).only("pattern", d.pattern, {Checker, Stripes}), "sRGB, alternates with the object's colour");
  archive("size", d.size, above(0.0, kLength), "edge of a cube, thickness of a slice, width of the picture");
  archive("axis", d.axis, direction().only("pattern", d.pattern, {Stripes}), "across the slices");
  archive.required("file", d.file, file_name().only("pattern", d.pattern, {Picture}), "PNG, relative to the scene's folder");
}

template <class Archive>
void fields(Archive& archive, LookDesc& d) {
  using enum ColourByName;
  using enum BodyName;
  archive("metallic", d.metallic, between(0.0, 1.0, kNumber), "0: plastic; 1: metal, whose reflections have its colour");
  archive("reflectance", d.reflectance, between(0.0, 1.0, kNumber), "of non-metals at normal incidence; 0: matt");
  archive("opacity", d.opacity, up_to(1.0, kNumber), "OpenGL draws it in steps of 1 / samples; shadows are those of an opaque body");
  archive("body", d.body, {}, "what light does that goes in. opaque: comes back where it went in; translucent: scatters inside, as in wax, milk or skin; glass: is refracted, by a smooth "
          "surface. The path tracer follows it; shadows of glass have no caustics. OpenGL is an approximation: shadows that bleed, and glass that shows sky and ground but no other bodies");
  archive("index", d.index, between(1.01, 4.0, kNumber).only("body", d.body, {Glass}), "of refraction: water 1.33, glass 1.5, diamond 2.4");
  archive("depth", d.depth, above(0.0, kLength).or_auto().only("body", d.body, {Translucent, Glass}),
          "translucent: mean free path of light, the longer the softer; auto: a fifth of the smallest thickness. glass: way over which white light takes the object's colour; auto: the smallest thickness");
  archive("texture", d.texture, {}, "pattern on the surface; absent: none");
  archive("colour_by", d.colour_by, {}, "what the colour of the surface shows. pressure: contact pressure [Pa]; stretch: d / d0 - 1 of the nearby bonds; speed: of the surface [m/s]");
  archive("map", d.map, Rule{}.only("colour_by", d.colour_by, {Pressure, Stretch, Speed}), "colour map");
  archive.required("range", d.range, any(kNumber).items(2, 2).only("colour_by", d.colour_by, {Pressure, Stretch, Speed}),
                   "values at the two ends of the map");
  archive("scale_bar", d.scale_bar, Rule{}.only("colour_by", d.colour_by, {Pressure, Stretch, Speed}), "draws the scale at the right");
  archive("surface", d.surface, {}, "whether the surface is drawn");
  archive("wireframe", d.wireframe, {}, "draws the edges of the triangles");
  archive("smooth", d.smooth, at_least(0.0, kLength), "pictures even out dimples up to this wide, such as those between the particles of a grid, and keep the volume; where surfaces touch they stay as they are. Files have "
          "the surface itself; 0: none");
  archive("frames", d.frames, at_least(0.0, kLength), "length of three arrows along each particle's axes, x red, y green, z blue; 0: none");
  archive("bonds", d.bonds, at_least(0.0, kLength), "radius of rods between bonded particles; 0: none");
  archive.check(!d.texture || d.colour_by == Colour, "texture", "expected either texture or colour_by", "both", "");
  archive.check(d.body != Glass || (!d.texture && d.colour_by == Colour), "body", "expected one colour, as glass has no pattern on its surface", "texture or colour_by", "");
  archive.check(d.body == Opaque || d.metallic == 0.0, "body", "expected metallic: 0, as no light goes into metal", "both", "");
  const bool values = d.colour_by == Pressure || d.colour_by == Stretch || d.colour_by == Speed;
  archive.check(!values || !archive.given("range") || d.range.x() < d.range.y(), "range", "expected a rising pair",
                number_text(d.range.x()) + " to " + number_text(d.range.y()), "");
}

template <class Archive>
void fields(Archive& archive, CameraKeyDesc& d) {
  archive.required("time", d.time, at_least(0.0, kTime), "time of this view");
  archive("from", d.from, any(kLength), "position of the camera");
  archive("look_at", d.look_at, any(kLength), "point in the middle of the picture");
  archive("field_of_view_deg", d.field_of_view, degrees(1.0, 150.0), "vertical");
  archive.check((d.look_at - d.from).norm() > 0.0, "look_at", "expected a point apart from 'from'", "the same point", "");
}

template <class Archive>
void fields(Archive& archive, CameraDesc& d) {
  archive("name", d.name, identifier(), "part of the names of its images and its film; required under 'cameras'");
  archive("from", d.from, any(kLength).or_auto(),
          "position of the camera; auto: in front of the scene, to the right and above, so that surfaces, obstacles and the ground below them are in view at the start");
  archive("look_at", d.look_at, any(kLength).or_auto(), "point in the middle of the picture; auto: the middle of surfaces and obstacles");
  archive("up", d.up, direction(), "direction that is up in the picture");
  archive("field_of_view_deg", d.field_of_view, degrees(1.0, 150.0), "vertical");
  archive("aperture", d.aperture, at_least(0.0, kLength), "radius of the lens; 0: everything is sharp; for renderer path");
  archive("focus", d.focus, above(0.0, kLength).or_auto(), "distance that is sharp; auto: distance of look_at");
  archive("turntable_deg", d.turntable, degrees(-36000.0, 36000.0), "angle by which the camera turns about 'up' through look_at during the scene");
  archive("keys", d.keys, {}, "views at times, interpolated smoothly; before the first and after the last the camera is at rest");
  if (d.from && d.look_at) {
    const Vec3 sight = *d.look_at - *d.from;
    archive.check(sight.norm() > 0.0, "look_at", "expected a point apart from 'from'", "the same point", "");
    archive.check(sight.norm() == 0.0 || sight.cross(d.up).norm() > 1e-6 * sight.norm() * d.up.norm(), "up",
                  "expected a direction across the line of sight", "one along it", "");
  }
  for (std::size_t k = 1; k < d.keys.size(); ++k) {
    archive.check(d.keys[k - 1].time < d.keys[k].time, "keys[" + std::to_string(k) + "].time", "expected a later time than the key before",
                  number_text(d.keys[k].time), "");
  }
  archive.check(d.keys.empty() || !(archive.given("from") || archive.given("look_at")), "keys", "expected either keys or from and look_at",
                "both", "");
}

template <class Archive>
void fields(Archive& archive, LightDesc& d) {
  archive("direction", d.direction, direction(), "direction in which the light travels");
  archive("intensity", d.intensity, at_least(0.0, kNumber), "irradiance over pi, relative to the radiance of the sky; 0: no sun");
  archive("softness_deg", d.softness, degrees(0.0, 20.0), "angular radius of the sun; 0: sharp shadows");
}

template <class Archive>
void fields(Archive& archive, AreaLightDesc& d) {
  archive.required("at", d.at, any(kLength), "middle of the rectangle");
  archive("facing", d.facing, direction(), "direction in which it shines");
  archive("half_sizes", d.half_sizes, above(0.0, kLength).items(2, 2), "half the edges, the first one horizontal");
  archive("colour", d.colour, between(0.0, 1.0, kNumber), "sRGB");
  archive("intensity", d.intensity, at_least(0.0, kNumber), "radiance, relative to that of the sky");
}

template <class Archive>
void fields(Archive& archive, RenderDesc& d) {
  using enum RendererName;
  const auto only = [&d](const Rule& rule) { return rule.only("renderer", d.renderer, {Path}); };
  archive("renderer", d.renderer, {}, "gl: OpenGL; path: path tracing, in builds with Embree 3");
  archive("pixel_error", d.pixel_error, above(0.0, kNumber).or_auto(),
          "largest error of meshes in pixels of the nearest camera; sets the cells of meshes that are only drawn; auto: output.cell sets them");
  archive("noise", d.noise, only(between(0.0, 1.0, kNumber)),
          "standard error of a pixel over its brightness, before the filter, at which sampling ends; 0: sampling ends at most_samples");
  archive("most_samples", d.most_samples, only(between(1.0, 65536.0, kNumber)), "most samples per pixel, a power of two");
  archive("denoise", d.denoise, only({}), "filter against noise, guided by normals, positions and colours");
  archive("exact_surface", d.exact_surface, only({}), "rays intersect the field itself, deformed by contact, so coarse meshes look smooth");
  archive("shutter", d.shutter, only(between(0.0, 1.0, kNumber)), "exposure time over the time between frames; moving bodies are blurred");
  archive.check((d.most_samples & (d.most_samples - 1)) == 0, "most_samples", "expected a power of two", std::to_string(d.most_samples), "");
}

template <class Archive>
void fields(Archive& archive, BackgroundDesc& d) {
  archive("top", d.top, between(0.0, 1.0, kNumber), "sRGB");
  archive("bottom", d.bottom, between(0.0, 1.0, kNumber), "sRGB");
}

}  // namespace supple::scenes
