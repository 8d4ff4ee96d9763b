#include "shaders.h"

namespace supple::render::shaders {
namespace {

const char* const kVersion = "#version 330 core\n";

/// Points of Vogel's disc (Vogel 1979), turned by an angle of the pixel (interleaved gradient noise, Jimenez 2014).
const char* const kDisc = R"(
float pixel_turn() {
  return 6.2831853 * fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))));
}
const mat2 kGoldenTurn = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);
)";

/// Share of the sun's disc a point sees: percentage-closer soft shadows (Fernando 2005) in an orthographic map.
/// Every tap is compared with the tangent plane of the receiver, so that a slanted surface does not shadow itself.
/// Few taps where nothing is near: a loop ends when its last lane does.
const char* const kShadow = R"(
uniform sampler2D shadow_depth;
uniform sampler2DShadow shadow_compare;
uniform mat4 shadow_to_unit;
uniform mat4 shadow_axes;
uniform vec3 shadow_extent;
uniform float shadow_texels;    // 0: no shadows
uniform float light_tangent;    // tangent of the light's angular radius

float sun_visibility(vec3 p, vec3 n, bool wanted) {
  vec3 nl = mat3(shadow_axes) * n;
  vec2 texel = shadow_extent.xy / max(shadow_texels, 1.0);
  float step = max(texel.x, texel.y);
  vec3 q = (shadow_to_unit * vec4(p + n * (1.2 * step), 1.0)).xyz;
  bool seen = wanted && shadow_texels > 0.0 && nl.z < -0.01 && all(greaterThan(q.xy, vec2(0.0))) &&
              all(lessThan(q.xy, vec2(1.0)));
  vec2 slope = clamp(nl.xy / max(-nl.z, 0.05), -4.0, 4.0) * shadow_extent.xy / shadow_extent.z;
  float slack = 0.75 * step / shadow_extent.z;

  float turn = pixel_turn();
  vec2 spin = vec2(cos(turn), sin(turn));
  // The widest penumbra is that of a blocker at the near end of the map.
  float reach = max(light_tangent * clamp(q.z, 0.0, 1.2) * shadow_extent.z, 1.5 * step);
  int search = seen ? 16 : 0;
  float blockers = 0.0;
  float depth_sum = 0.0;
  vec2 turned = spin;
  for (int i = 0; i < search; ++i) {
    vec2 offset = turned * (reach * sqrt((float(i) + 0.5) / 16.0)) / shadow_extent.xy;
    float depth = textureLod(shadow_depth, q.xy + offset, 0.0).r;
    float limit = min(q.z + dot(slope, offset) - slack, 1.0);
    float blocked = depth < limit ? 1.0 : 0.0;
    blockers += blocked;
    depth_sum += blocked * depth;
    turned = kGoldenTurn * turned;
  }
  float gap = max(q.z - depth_sum / max(blockers, 1.0), 0.0) * shadow_extent.z;
  float radius = clamp(light_tangent * gap, 1.2 * step, reach);
  float texels = radius / step;
  bool partly = blockers > 0.5 && blockers < 15.5;
  int taps = partly ? int(clamp(8.0 + 0.8 * texels * texels, 10.0, 56.0)) : 0;
  float lit = 0.0;
  turned = spin;
  for (int i = 0; i < taps; ++i) {
    vec2 offset = turned * (radius * sqrt((float(i) + 0.5) / float(taps))) / shadow_extent.xy;
    lit += texture(shadow_compare, vec3(q.xy + offset, min(q.z + dot(slope, offset) - slack, 1.0)));
    turned = kGoldenTurn * turned;
  }
  return partly ? lit / float(taps) : (blockers < 0.5 ? 1.0 : 0.0);
}
)";

/// Light and the filmic curve, a fit of the ACES output transform (Narkowicz 2015).
const char* const kLight = R"(
uniform vec3 eye;
uniform vec3 to_light;
uniform vec3 sun;            // irradiance / pi at normal incidence
uniform vec3 sky;            // radiance from above
uniform vec3 bounce;         // radiance from below
uniform float exposure;
vec3 filmic(vec3 radiance) {
  vec3 x = max(radiance * exposure, 0.0);
  return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}
)";

/// The geometry buffer (octahedral normal, id; depth) and what of a pixel follows from the camera alone.
const char* const kGeometry = R"(
uniform vec2 half_extent;
uniform vec2 picture_size;
uniform vec2 depth_range;     // near and far plane [m]
uniform mat4 view;
uniform float eye_height;     // above the ground; below 0: no ground to be seen [m]
const float kNowhere = 1e4;   // depth of nothing, in depths of the far plane

vec3 eye_ray(vec2 pixel) { return vec3((pixel / picture_size * 2.0 - 1.0) * half_extent, -1.0); }

float eye_depth(float stored) {
  return stored < 1.0 ? depth_range.x * depth_range.y / (depth_range.y - stored * (depth_range.y - depth_range.x))
                      : kNowhere * depth_range.y;
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
  vec3 high = 1.055 * pow(max(linear, 1e-6), vec3(1.0 / 2.4)) - 0.055;
  return vec4(mix(linear * 12.92, high, vec3(greaterThan(linear, vec3(0.0031308)))), 1.0);
}
)";

const char* const kGroundLight = R"(
uniform vec3 ground_albedo;
uniform float camera_distance;
uniform sampler2D ground_visibility;
uniform mat4 ground_to_unit;
uniform float ground_occluded;    // 0: nothing stands above the ground

vec3 ground_light(vec3 p, vec3 behind, float visible) {
  vec2 at = (ground_to_unit * vec4(p, 1.0)).xy;
  float ao = mix(1.0, textureLod(ground_visibility, clamp(at, 0.0, 1.0), 0.0).r, ground_occluded);
  vec3 radiance = ground_albedo * (sun * (max(to_light.z, 0.0) * visible) + sky * ao);
  // Into the background with distance and towards the horizon, so that there is no edge.
  float away = length(p.xy) / camera_distance;
  float down = (eye.z - p.z) / length(eye - p);
  float fade = (1.0 - smoothstep(0.7, 3.2, away)) * smoothstep(0.02, 0.22, down);
  return mix(behind, filmic(radiance), fade);
}
)";

const char* const kItemLight = R"(
uniform sampler2D materials;      // albedo and roughness of each item
uniform sampler2D occlusion;
uniform float occlusion_radius;   // [m]
uniform int contact_taps;         // 0: no other item to touch

float item_visibility(float depth) {
  vec2 at = (gl_FragCoord.xy - 0.5) * 0.5;
  ivec2 corner = ivec2(floor(at));
  vec2 f = at - floor(at);
  ivec2 last = textureSize(occlusion, 0) - 1;
  float sum = 0.0;
  float weight_sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    ivec2 o = ivec2(i & 1, i >> 1);
    vec2 there = texelFetch(occlusion, min(corner + o, last), 0).rg;
    vec2 b = mix(1.0 - f, f, vec2(o));
    float weight = (b.x * b.y + 0.01) * (max(1.0 - abs(there.g - depth) / (0.5 * occlusion_radius), 0.0) + 1e-4);
    sum += weight * there.r;
    weight_sum += weight;
  }
  return sum / weight_sum;
}

// A dark hair line where another item meets this one in the picture and in depth.
float contact_line(uint id, float depth) {
  ivec2 last = ivec2(picture_size) - 1;
  float near_by = 6.0 * depth * 2.0 * half_extent.y / picture_size.y;
  float touching = 0.0;
  vec2 turned = vec2(1.25, 0.0);
  for (int i = 0; i < contact_taps; ++i) {
    ivec2 there = clamp(ivec2(gl_FragCoord.xy + turned), ivec2(0), last);
    uint other = GEOMETRY(there, 0).g;
    float gap = abs(eye_depth(DEPTH(there, 0).r) - depth);
    touching += other > 0u && other != id ? max(1.0 - gap / near_by, 0.0) : 0.0;
    turned = mat2(0.70710678, 0.70710678, -0.70710678, 0.70710678) * turned;
  }
  return 1.0 - 0.6 * min(touching * 0.5, 1.0);
}

vec3 item_light(vec3 p, vec3 n, float depth, uint id, float visible) {
  int number = int(id) - 1;
  vec4 material = texelFetch(materials, ivec2(number & 4095, number >> 12), 0);
  vec3 albedo = material.rgb;
  float roughness = material.a;
  vec3 v = normalize(eye - p);
  vec3 h = normalize(v + to_light);
  float nv = max(dot(n, v), 0.08);   // interpolated normals may look away at an outline
  float nl = max(dot(n, to_light), 0.0);
  float nh = max(dot(n, h), 0.0);
  float vh = max(dot(v, h), 0.0);

  // Cook and Torrance 1982 with the GGX distribution and the height-correlated Smith term (Heitz 2014).
  float a = clamp(roughness * roughness + 0.5 * light_tangent, 0.003, 1.0);
  float a2 = a * a;
  float spread = nh * nh * (a2 - 1.0) + 1.0;
  float d = a2 / (spread * spread);
  float smith = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
  float fresnel = 0.04 + 0.96 * pow(1.0 - vh, 5.0);
  vec3 radiance = sun * (nl * visible) * (albedo * (1.0 - fresnel) + d * smith * fresnel);

  // Occlusion with the light that an occluder of the same colour sends back (Jimenez et al. 2016).
  float ao = item_visibility(depth);
  vec3 many = max(vec3(ao), ((2.0404 * albedo - 0.3324) * ao + (-4.7951 * albedo + 0.6417)) * ao * ao +
                                (2.7552 * albedo + 0.6903) * ao);
  vec3 around = mix(bounce, sky, 0.5 + 0.5 * n.z);
  radiance += albedo * around * many;

  // The studio in the mirror: sky over floor, and a broad soft box opposite the sun. Split sum by Karis 2013.
  vec3 mirrored = reflect(-v, n);
  float blur = 0.08 + 0.7 * roughness;
  vec3 seen = mix(bounce, sky, smoothstep(-blur, blur, mirrored.z));
  vec3 box = normalize(vec3(-to_light.xy, 0.9));
  seen += sky * 1.6 * smoothstep(0.80 - 0.4 * roughness, 0.90 + 0.1 * roughness, dot(mirrored, box));
  vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
  float split = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
  float gloss = 0.04 * (-1.04 * split + r.z) + (1.04 * split + r.w);
  radiance += seen * gloss * ao;

  // A rim of light from behind parts the item from a ground of the same brightness.
  float edge = pow(1.0 - nv, 4.0);
  radiance += sky * (0.22 * edge * ao) * (0.4 + 0.6 * albedo) * smoothstep(-0.4, 0.8, n.z);
  return filmic(radiance) * contact_line(id, depth);
}
)";

/// Version, number of samples and access to the geometry buffer, which is a multisampled texture above one sample.
std::string header(int samples) {
  const std::string kind = samples > 1 ? "MS" : "";
  const std::string sample = samples > 1 ? "s" : "0";
  return std::string(kVersion) + "#define SAMPLES " + std::to_string(samples) + "\nuniform usampler2D" + kind +
         " geometry;\nuniform sampler2D" + kind + " depths;\n#define GEOMETRY(at, s) texelFetch(geometry, at, " + sample +
         ")\n#define DEPTH(at, s) texelFetch(depths, at, " + sample + ")\n";
}

}  // namespace

std::string position_only() {
  return std::string(kVersion) + R"(
layout(location = 0) in vec3 position;
uniform mat4 to_clip;
out vec3 world;
void main() {
  world = position;
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

std::string whole_picture() {
  return std::string(kVersion) + R"(
uniform float plane;
void main() {
  gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, plane, 1.0);
})";
}

std::string nothing() { return std::string(kVersion) + "void main() {}\n"; }

std::string height_range() {
  return std::string(kVersion) + R"(
in vec3 world;
uniform float ground_height;
out vec4 range;
void main() {
  float height = max(world.z - ground_height, 0.0);
  range = vec4(-height, height, 0.0, 0.0);
})";
}

// Along each azimuth the columns of the height range hide elevations from atan(low / d) to atan(high / d); with the
// cosine weight of a diffuse receiver the hidden share is the difference of sin^2 of the elevations.
std::string ground_occlusion() {
  return std::string(kVersion) + R"(
uniform sampler2D heights;
uniform float map_size;      // edge of the map [m]
uniform float target_size;   // edge of this target [texel]
out vec4 visibility;
const int kAzimuths = 20;
const int kSteps = 12;
void main() {
  vec2 here = gl_FragCoord.xy / target_size;
  float hidden = 0.0;
  for (int a = 0; a < kAzimuths; ++a) {
    float angle = 6.2831853 * (float(a) + 0.5) / float(kAzimuths);
    vec2 along = vec2(cos(angle), sin(angle));
    float lowest = 1.0;
    float highest = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      float s = (float(k) + 0.5) / float(kSteps);
      float distance = 0.6 * s * s + 0.002;
      vec2 range = textureLod(heights, here + along * distance, 0.0).rg;
      float d2 = distance * distance * map_size * map_size;
      float low = max(-range.x, 0.0);
      float high = range.y;
      if (high >= 0.0) {
        lowest = min(lowest, low * low / (low * low + d2));
        highest = max(highest, high * high / (high * high + d2));
      }
    }
    hidden += max(highest - lowest, 0.0);
  }
  vec2 rim = smoothstep(vec2(0.0), vec2(0.12), min(here, 1.0 - here));
  visibility = vec4(1.0 - hidden / float(kAzimuths) * rim.x * rim.y);
})";
}

// The normal by its octahedral map (Meyer et al. 2010), 16 bits a coordinate.
std::string geometry() {
  return std::string(kVersion) + R"(
centroid in vec3 world_normal;
uniform int id;
out uvec2 data;
void main() {
  vec3 n = gl_FrontFacing ? world_normal : -world_normal;
  n /= max(abs(n.x) + abs(n.y) + abs(n.z), 1e-20);
  vec2 sign_of = vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  vec2 octahedral = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * sign_of;
  uvec2 bits = uvec2(round(clamp(octahedral * 0.5 + 0.5, 0.0, 1.0) * 65535.0));
  data = uvec2(bits.x | (bits.y << 16u), uint(id));
})";
}

// Scalable ambient obscurance (McGuire, Mara, Luebke 2012), without its mip chain: the disc is a few dozen pixels.
std::string screen_occlusion(int samples) {
  return header(samples) + kDisc + kGeometry + R"(
uniform float radius;        // [m]
out vec4 data;
const int kTaps = 14;
void main() {
  ivec2 last = ivec2(picture_size) - 1;
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * 2, last);
  uvec2 item = GEOMETRY(pixel, 0).rg;
  vec3 ray = eye_ray(vec2(pixel) + 0.5);
  float depth = eye_depth(DEPTH(pixel, 0).r);
  vec3 n = mat3(view) * unpack_normal(item.x);
  vec3 p = ray * depth;
  // Four by four turns, which the blur averages exactly.
  ivec2 cell = ivec2(gl_FragCoord.xy) & 3;
  float turn = 6.2831853 * float((cell.x * 4 + cell.y * 5 + (cell.y & 1) * 2) & 15) / 16.0;
  vec2 turned = vec2(cos(turn), sin(turn));
  float pixels = clamp(radius / (depth * half_extent.y) * 0.5 * picture_size.y, 3.0, 0.15 * picture_size.y);
  int taps = item.y > 0u ? kTaps : 0;
  float r2 = radius * radius;
  float sum = 0.0;
  for (int i = 0; i < taps; ++i) {
    vec2 offset = turned * (pixels * sqrt((float(i) + 0.5) / float(kTaps)));
    ivec2 other = clamp(pixel + ivec2(round(offset)), ivec2(0), last);
    vec3 other_ray = eye_ray(vec2(other) + 0.5);
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
uniform float nowhere;   // depths beyond are of no item [m]
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

// Sorts the pixels for the passes that follow: a software rasteriser takes both sides of every branch, but leaves out
// whole patches that fail the depth test. The background is drawn on the way.
std::string classify(int samples) {
  return header(samples) + kGeometry + kPixel + R"(
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uint any = 0u;
  for (int s = 0; s < SAMPLES; ++s) any |= GEOMETRY(pixel, s).g;
  bool is_floor = ground_depth(eye_ray(gl_FragCoord.xy)) < depth_range.y;
  gl_FragDepth = any > 0u ? 0.9 : (is_floor ? 0.1 : 0.5);
  colour = encoded(background_colour());
})";
}

std::string lit_ground() {
  return std::string(kVersion) + kDisc + kGeometry + kPixel + kShadow + kLight + kGroundLight + R"(
void main() {
  vec3 ray = eye_ray(gl_FragCoord.xy);
  vec3 p = eye + (transpose(mat3(view)) * ray) * ground_depth(ray);
  colour = encoded(ground_light(p, background_colour(), sun_visibility(p, vec3(0.0, 0.0, 1.0), true)));
})";
}

// Each surface of a pixel is lit once, whatever number of its samples it covers. Surfaces: one for each item (two for
// an item that folds over itself within the pixel), the ground, and the background.
std::string lit_items(int samples) {
  return header(samples) + kDisc + kGeometry + kPixel + kShadow + kLight + kGroundLight + kItemLight + R"(
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 ray = eye_ray(gl_FragCoord.xy);
  vec3 along = transpose(mat3(view)) * ray;
  float floor_depth = ground_depth(ray);
  vec3 behind = background_colour();

  uint id[SAMPLES];
  vec3 normal[SAMPLES];
  float depth[SAMPLES];
  bool open[SAMPLES];
  for (int s = 0; s < SAMPLES; ++s) {
    uvec2 item = GEOMETRY(pixel, s).rg;
    float item_depth = eye_depth(DEPTH(pixel, s).r);
    bool is_item = item.y > 0u && item_depth <= floor_depth;
    id[s] = is_item ? item.y : 0u;
    normal[s] = is_item ? unpack_normal(item.x) : vec3(0.0, 0.0, 1.0);
    depth[s] = is_item ? item_depth : floor_depth;
    open[s] = true;
  }
  float footprint = 2.0 * half_extent.y / picture_size.y;   // of the pixel, at depth 1
  vec3 sum = vec3(0.0);
  int left = SAMPLES;
  while (left > 0) {
    bool found = false;
    uint surface_id = 0u;
    float first_depth = 0.0;
    vec3 first_normal = vec3(0.0, 0.0, 1.0);
    float slack = 0.0;
    float surface_depth = 0.0;
    vec3 n = vec3(0.0);
    int count = 0;
    for (int s = 0; s < SAMPLES; ++s) {
      if (open[s] && !found) {
        surface_id = id[s];
        first_depth = depth[s];
        first_normal = normal[s];
        slack = 1.5 * footprint * first_depth / max(abs(dot(first_normal, along)), 0.1);
        found = true;
      }
      bool near_by = abs(depth[s] - first_depth) < slack && dot(normal[s], first_normal) > 0.5;
      bool same = open[s] && id[s] == surface_id && (surface_id == 0u || near_by);
      open[s] = open[s] && !same;
      surface_depth += same ? depth[s] : 0.0;
      n += same ? normal[s] : vec3(0.0);
      count += same ? 1 : 0;
    }
    left -= count;
    surface_depth /= float(max(count, 1));
    n = normalize(n);
    bool is_item = surface_id > 0u;
    bool is_floor = !is_item && surface_depth < depth_range.y * 0.5 * kNowhere;
    vec3 p = eye + along * surface_depth;
    float visible = sun_visibility(p, n, is_item || is_floor);
    vec3 lit = behind;
    if (is_item) lit = item_light(p, n, surface_depth, surface_id, visible);
    if (is_floor) lit = ground_light(p, behind, visible);
    sum += lit * float(count);
  }

  colour = encoded(sum / float(SAMPLES));
})";
}

}  // namespace supple::render::shaders
