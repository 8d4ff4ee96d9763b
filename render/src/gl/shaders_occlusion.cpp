#include "gl/shader_parts.h"
#include "gl/shaders.h"

namespace supple::render::shaders {

// Along each azimuth the columns of the height range hide elevations from atan(low / d) to atan(high / d), and what joins one
// column to the next the elevations in between; with the cosine weight of a diffuse receiver the hidden share is the measure
// of their sin^2. What is hidden already is kept in bins (Therrien, Levesque & Gilet 2023), for a wall may stand behind what
// hangs overhead. Their borders differ from azimuth to azimuth, so that the mean over all azimuths has no steps.
std::string ground_occlusion() {
  return std::string(kVersion) + R"(
uniform sampler2D heights;
uniform float map_size;      // edge of the map
uniform float target_size;   // edge of this target [texel]
out vec4 visibility;
const int kAzimuths = 20;
const int kSteps = 12;
const float kBins = 31.0;

uint bins_below(float share, float border) { return (1u << uint(share * (kBins - 1.0) + border)) - 1u; }

float count(uint bins) {
  bins -= (bins >> 1) & 0x55555555u;
  bins = (bins & 0x33333333u) + ((bins >> 2) & 0x33333333u);
  bins = (bins + (bins >> 4)) & 0x0f0f0f0fu;
  return float((bins * 0x01010101u) >> 24);
}

void main() {
  vec2 here = gl_FragCoord.xy / target_size;
  float hidden = 0.0;
  for (int a = 0; a < kAzimuths; ++a) {
    float angle = 6.2831853 * (float(a) + 0.5) / float(kAzimuths);
    float border = fract(0.61803399 * float(a));
    vec2 along = vec2(cos(angle), sin(angle));
    uint bins = 0u;
    float distance_before = 0.0;
    vec2 heights_before = vec2(0.0, -1.0);
    vec2 shares_before = vec2(0.0);
    for (int k = 0; k < kSteps; ++k) {
      float s = (float(k) + 0.5) / float(kSteps);
      float distance = (0.6 * s * s + 0.002) * map_size;
      vec2 range = textureLod(heights, here + along * (distance / map_size), 0.0).rg;
      range.x = max(-range.x, 0.0);
      vec2 shares = range * range / (range * range + distance * distance);
      float gap = max(range.x - heights_before.y, heights_before.x - range.y);
      bool joined = heights_before.y >= 0.0 && gap < distance - distance_before;   // else one hangs over the other
      float from = joined ? min(shares.x, shares_before.x) : shares.x;
      float to = joined ? max(shares.y, shares_before.y) : shares.y;
      if (range.y >= 0.0) bins |= bins_below(to, border) & ~bins_below(from, border);
      distance_before = distance;
      heights_before = range;
      shares_before = shares;
    }
    hidden += count(bins) / (kBins - 1.0);
  }
  vec2 rim = smoothstep(vec2(0.0), vec2(0.12), min(here, 1.0 - here));
  visibility = vec4(1.0 - hidden / float(kAzimuths) * rim.x * rim.y);
})";
}

// Scalable ambient obscurance (McGuire, Mara, Luebke 2012), without its mip chain: the disc is a few dozen pixels.
std::string screen_occlusion(int samples) {
  return header(samples) + kDisc + kGeometry + R"(
uniform float radius;
out vec4 data;
const int kTaps = 14;
void main() {
  ivec2 last = ivec2(picture_size) - 1;
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * 2, last);
  float stored_depth = DEPTH(pixel, 0).r;
  vec3 ray = eye_ray(vec2(pixel) + sample_at[0]);
  float depth = eye_depth(stored_depth);
  vec3 n = mat3(view) * unpack_normal(GEOMETRY(pixel, 0).r);
  vec3 p = ray * depth;
  // Four by four turns, which the blur averages exactly.
  ivec2 cell = ivec2(gl_FragCoord.xy) & 3;
  float turn = 6.2831853 * float((cell.x * 4 + cell.y * 5 + (cell.y & 1) * 2) & 15) / 16.0;
  vec2 turned = vec2(cos(turn), sin(turn));
  float pixels = clamp(radius / (depth * half_extent.y) * 0.5 * picture_size.y, 3.0, 0.15 * picture_size.y);
  int taps = stored_depth > 0.0 ? kTaps : 0;
  float r2 = radius * radius;
  float sum = 0.0;
  for (int i = 0; i < taps; ++i) {
    vec2 offset = turned * (pixels * sqrt((float(i) + 0.5) / float(kTaps)));
    ivec2 other = clamp(pixel + ivec2(round(offset)), ivec2(0), last);
    vec3 other_ray = eye_ray(vec2(other) + sample_at[0]);
    vec3 v = other_ray * min(eye_depth(DEPTH(other, 0).r), ground_depth(other_ray)) - p;
    float d2 = dot(v, v);
    float closeness = max(1.0 - d2 / r2, 0.0);
    sum += closeness * closeness * max(dot(v, n) - 0.02 * radius, 0.0) * inversesqrt(d2 + 1e-4 * r2);
    turned = kGoldenTurn * turned;
  }
  data = vec4(max(1.0 - 2.6 * sum / float(kTaps), 0.0), depth, 0.0, 0.0);
})";
}

std::string occlusion_blur() {
  return std::string(kVersion) + R"(
uniform sampler2D occlusion;
uniform float radius;
uniform float nowhere;   // depths beyond are of no item
out vec4 data;
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 last = textureSize(occlusion, 0) - 1;
  vec2 here = texelFetch(occlusion, pixel, 0).rg;
  // A whole patch of lanes without items has nothing to blur.
  int rows = here.g < nowhere ? 2 : -2;
  float sum = 1e-4 * here.r;
  float weight_sum = 1e-4;
  for (int y = -2; y < rows; ++y)
    for (int x = -2; x < 2; ++x) {
      vec2 there = texelFetch(occlusion, clamp(pixel + ivec2(x, y), ivec2(0), last), 0).rg;
      float weight = max(1.0 - abs(there.g - here.g) / radius, 0.0);
      sum += weight * there.r;
      weight_sum += weight;
    }
  data = vec4(sum / weight_sum, here.g, 0.0, 0.0);
})";
}

}  // namespace supple::render::shaders
