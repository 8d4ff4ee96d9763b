#include "gl/shader_parts.h"
#include "gl/shaders.h"

namespace supple::render::shaders {
namespace {

// The normal by its octahedral map (Meyer et al. 2010), 16 bits a coordinate.
const char* const kPacking = R"(
uniform int id;
uvec2 packed_geometry(vec3 normal) {
  vec3 n = gl_FrontFacing ? normal : -normal;
  n /= max(abs(n.x) + abs(n.y) + abs(n.z), 1e-20);
  vec2 sign_of = vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  vec2 octahedral = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * sign_of;
  uvec2 bits = uvec2(round(clamp(octahedral * 0.5 + 0.5, 0.0, 1.0) * 65535.0));
  return uvec2(bits.x | (bits.y << 16u), uint(id));
}
)";

const char* const kPaint = R"(
uniform int paint;           // PaintKind
uniform vec3 first;          // linear
uniform vec3 second;
uniform vec3 paint_axis;
uniform sampler2D picture;
uniform float picture_aspect;
uniform sampler2D maps;      // a row for each colour map
uniform float map_row;
uniform vec2 value_range;

vec3 albedo(vec3 at, vec3 n) {   // at: in cubes, slices or widths of the pattern
  vec3 along = dFdx(at);
  vec3 up = dFdy(at);
  vec3 slope = normalize(cross(along, up) + vec3(0.0, 0.0, 1e-18));
  vec3 weight = slope * slope;
  weight *= weight;
  weight /= weight.x + weight.y + weight.z;
  if (paint == 1) {
    vec3 width = abs(along) + abs(up);
    return mix(second, first, 0.5 + 0.5 * wave(at.x, width.x) * wave(at.y, width.y) * wave(at.z, width.z));
  }
  if (paint == 2) {
    float t = dot(at, paint_axis);
    return mix(second, first, 0.5 + 0.5 * wave(t, abs(dot(along, paint_axis)) + abs(dot(up, paint_axis))));
  }
  if (paint == 3) {
    vec2 proportion = vec2(1.0, picture_aspect);
    return weight.x * texture(picture, at.yz * proportion).rgb + weight.y * texture(picture, at.xz * proportion).rgb +
           weight.z * texture(picture, at.xy * proportion).rgb;
  }
  if (paint == 4) {
    float t = clamp((at.x - value_range.x) / (value_range.y - value_range.x), 0.0, 1.0);
    return textureLod(maps, vec2(t * 255.0 / 256.0 + 0.5 / 256.0, map_row), 0.0).rgb;
  }
  if (paint == 5) {
    vec3 srgb = 0.5 + 0.5 * normalize(n);
    return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), vec3(greaterThan(srgb, vec3(0.04045))));
  }
  return first;
}
)";

}  // namespace

std::string position_only() {
  return std::string(kVersion) + R"(
layout(location = 0) in vec3 position;
uniform mat4 to_clip;
void main() {
  gl_Position = to_clip * vec4(position, 1.0);
})";
}

std::string surface() {
  return std::string(kVersion) + R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 to_clip;
centroid out vec3 world_normal;
void main() {
  world_normal = normal;
  gl_Position = to_clip * vec4(position, 1.0);
})";
}

std::string painted_surface() {
  return std::string(kVersion) + R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 at;
uniform mat4 to_clip;
centroid out vec3 world_normal;
out vec3 painted_at;   // at the middle of the pixel, for derivatives
void main() {
  world_normal = normal;
  painted_at = at;
  gl_Position = to_clip * vec4(position, 1.0);
})";
}

std::string whole_picture() {
  return std::string(kVersion) + R"(
uniform float plane;
void main() {
  gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, plane, 1.0);
})";
}

std::string nothing() { return std::string(kVersion) + "void main() {}\n"; }

// A ray of light through a ball of glass is as long in it as its face is turned to the light, and each of its two faces takes a half.
std::string passed_by_glass() {
  return std::string(kVersion) + R"(
uniform vec3 to_light;
uniform vec3 tint;           // what the glass lets through along its least extent
uniform float reflectance;   // at normal incidence
centroid in vec3 world_normal;
out vec4 passed;
void main() {
  float cosine = abs(dot(normalize(world_normal), to_light));
  float fresnel = reflectance + (1.0 - reflectance) * pow(1.0 - cosine, 5.0);   // Schlick 1994
  passed = vec4(pow(max(tint, 0.001), vec3(0.5 * cosine)) * (1.0 - fresnel), 1.0);
})";
}

std::string geometry() {
  return std::string(kVersion) + kPacking + R"(
centroid in vec3 world_normal;
out uvec2 data;
void main() { data = packed_geometry(world_normal); })";
}

std::string painted_geometry() {
  return std::string(kVersion) + kPacking + kWave + kPaint + R"(
centroid in vec3 world_normal;
in vec3 painted_at;
layout(location = 0) out uvec2 data;
layout(location = 1) out vec4 colour;   // square roots, which spend 8 bits as the eye does
void main() {
  data = packed_geometry(world_normal);
  colour = vec4(sqrt(clamp(albedo(painted_at, world_normal), 0.0, 1.0)), 1.0);
})";
}

}  // namespace supple::render::shaders
