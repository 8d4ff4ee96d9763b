/// @file shader_parts.h
/// Pieces of GLSL that several shaders share.
#pragma once

#include <string>

namespace supple::render::shaders {

extern const char* const kVersion;
extern const char* const kDisc;      ///< pixel_turn, kGoldenTurn
extern const char* const kGeometry;  ///< eye_ray, eye_depth, ground_depth, unpack_normal
extern const char* const kPixel;     ///< background_colour, encoded
extern const char* const kWave;      ///< wave

/// Version, number of samples and access to the geometry buffer, which is a multisampled texture above one sample.
[[nodiscard]] std::string header(int samples);

}  // namespace supple::render::shaders
