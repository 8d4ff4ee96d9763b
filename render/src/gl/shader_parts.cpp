#include "gl/shader_parts.h"

namespace supple::render::shaders {

const char* const kVersion = "#version 330 core\n";

/// Points of Vogel's disc (Vogel 1979), turned by an angle of the pixel (interleaved gradient noise, Jimenez 2014).
const char* const kDisc = R"(
float pixel_turn() {
  return 6.2831853 * fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))));
}
const mat2 kGoldenTurn = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);
)";

/// The geometry buffer (octahedral normal, id; depth) and what of a pixel follows from the camera alone.
const char* const kGeometry = R"(
uniform vec2 half_extent;
uniform vec2 picture_size;
uniform vec2 depth_range;     // near plane, and what lies beyond all items
uniform mat4 view;
uniform float eye_height;     // above the ground; below 0: no ground to be seen
const float kNowhere = 1e4;   // depth of nothing, over depth_range.y

vec3 eye_ray(vec2 pixel) { return vec3((pixel / picture_size * 2.0 - 1.0) * half_extent, -1.0); }

float eye_depth(float stored) {
  return stored > 0.0 ? depth_range.x / stored : kNowhere * depth_range.y;
}

float ground_depth(vec3 ray) {
  float fall = -dot(view[2].xyz, ray);
  return eye_height > 0.0 && fall > 1e-6 ? eye_height / fall : kNowhere * depth_range.y;
}

vec3 unpack_normal(uint bits) {
  vec2 f = vec2(float(bits & 65535u), float(bits >> 16u)) / 65535.0 * 2.0 - 1.0;
  vec3 n = vec3(f, 1.0 - abs(f.x) - abs(f.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
)";

/// What a pixel shows where there is nothing, and how it is stored: sRGB (IEC 61966-2-1).
const char* const kPixel = R"(
uniform vec3 background_top;
uniform vec3 background_bottom;
out vec4 colour;

vec3 background_colour() {
  float t = clamp(gl_FragCoord.y / picture_size.y, 0.0, 1.0);
  return mix(background_bottom, background_top, t * t * (3.0 - 2.0 * t));
}

vec4 encoded(vec3 light) {
  vec3 linear = clamp(light, 0.0, 1.0);
  // 1.055 x^(1/2.4) - 0.055 to 4e-5, a hundredth of a level of 8 bits.
  vec3 half_power = sqrt(linear);
  vec3 quarter_power = sqrt(half_power);
  vec3 high = 1.12268099 * half_power + 0.19613609 * quarter_power - 0.33550082 * half_power * quarter_power +
              0.08132968 * linear - 0.06461156;
  return vec4(mix(linear * 12.92, high, vec3(greaterThan(linear, vec3(0.0031308)))), 1.0);
}
)";

// Patterns are averaged over the pixel: the box filter of a square wave has a closed form (Heckbert 1989, sec. 3.4).
const char* const kWave = R"(
float wave(float x, float width) {   // +1 and -1 in turn, period 2, averaged over the width
  float w = max(width, 1e-4);
  float a = abs(fract((x - 0.5 * w) * 0.5) - 0.5);
  float b = abs(fract((x + 0.5 * w) * 0.5) - 0.5);
  return 2.0 * (a - b) / w;
}
)";

std::string header(int samples) {
  const std::string kind = samples > 1 ? "MS" : "";
  const std::string sample = samples > 1 ? "s" : "0";
  return std::string(kVersion) + "#define SAMPLES " + std::to_string(samples) + "\nuniform vec2 sample_at[SAMPLES];   // within the pixel\nuniform usampler2D" + kind +
         " geometry;\nuniform sampler2D" + kind + " depths;\n#define GEOMETRY(at, s) texelFetch(geometry, at, " + sample +
         ")\n#define DEPTH(at, s) texelFetch(depths, at, " + sample + ")\n";
}

}  // namespace supple::render::shaders
