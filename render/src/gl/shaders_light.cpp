#include "gl/shader_parts.h"
#include "gl/shaders.h"

namespace supple::render::shaders {
namespace {

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
const float kCorner = 6.0;      // texels
const float kUnknown = 0.15;    // weight

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
  // A face that meets this one in a corner lies before its tangent plane, too, and hides nothing of it: what is nearer than some
  // texels, or beyond the cone of the light, counts little, so that it is dark only where nothing else is known.
  float lit = 0.0;
  float known = 0.0;
  turned = spin;
  for (int i = 0; i < taps; ++i) {
    float shift = radius * sqrt((float(i) + 0.5) / float(taps));
    vec2 offset = turned * shift / shadow_extent.xy;
    float limit = q.z + dot(slope, offset) - slack;   // beyond 1 where nothing of the map is
    float near_by = max(kCorner * step, (shift - 1.5 * step) / max(light_tangent, 1e-3)) / shadow_extent.z;
    float found = textureLod(shadow_depth, q.xy + offset, 0.0).r;
    float weight = found < min(limit, 1.0) && limit - found < near_by ? kUnknown : 1.0;
    lit += weight < 1.0 ? 0.0 : texture(shadow_compare, vec3(q.xy + offset, min(limit - near_by, 1.0)));
    known += weight;
    turned = kGoldenTurn * turned;
  }
  return partly ? lit / known : (blockers < 0.5 ? 1.0 : 0.0);
}
)";

/// Glass throws no shadow as other bodies do: the sun comes through straight on, less what its faces reflect and the glass takes.
const char* const kGlassShadow = R"(
#ifdef INSIDE
uniform sampler2D glass_depth;    // of the first glass along the light, in the shadow map
uniform sampler2D glass_passed;   // share of the light behind all of it
uniform int has_glass;            // 0: none

vec3 passed_by_glass(vec3 p, vec3 n) {
  vec2 texel = shadow_extent.xy / max(shadow_texels, 1.0);
  float step = max(texel.x, texel.y);
  vec3 q = (shadow_to_unit * vec4(p + (1.2 * step) * n, 1.0)).xyz;
  bool seen = has_glass > 0 && all(greaterThan(q.xy, vec2(0.0))) && all(lessThan(q.xy, vec2(1.0)));
  float slack = 2.0 * step / shadow_extent.z;
  float reach = max(light_tangent * clamp(q.z, 0.0, 1.2) * shadow_extent.z, 1.5 * step);
  float turn = pixel_turn();
  vec2 turned = vec2(cos(turn), sin(turn));
  float nearest = 1.0;
  for (int i = 0; i < (seen ? 12 : 0); ++i) {
    vec2 offset = turned * (reach * sqrt((float(i) + 0.5) / 12.0)) / shadow_extent.xy;
    nearest = min(nearest, textureLod(glass_depth, q.xy + offset, 0.0).r);
    turned = kGoldenTurn * turned;
  }
  bool shaded = nearest < min(q.z, 1.0) - slack;
  float radius = clamp(light_tangent * max(q.z - nearest, 0.0) * shadow_extent.z, 1.2 * step, reach);
  vec3 sum = vec3(0.0);
  for (int i = 0; i < (shaded ? 24 : 0); ++i) {
    vec2 at = q.xy + turned * (radius * sqrt((float(i) + 0.5) / 24.0)) / shadow_extent.xy;
    bool behind = textureLod(glass_depth, at, 0.0).r < q.z - slack;
    sum += behind ? textureLod(glass_passed, at, 0.0).rgb : vec3(1.0);
    turned = kGoldenTurn * turned;
  }
  return shaded ? sum / 24.0 : vec3(1.0);
}
#else
vec3 passed_by_glass(vec3 p, vec3 n) { return vec3(1.0); }
#endif
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

/// A GGX lobe over a diffuse base, as in path/bsdf.h, by cosines from the normal; what reflects less than any solid has no lobe.
const char* const kMaterial = R"(
float grazing_of(vec3 normal_reflectance) {
  return min(50.0 * max(max(normal_reflectance.r, normal_reflectance.g), normal_reflectance.b), 1.0);
}

vec3 fresnel_of(vec3 normal_reflectance, float cosine) {   // Schlick 1994
  float c = 1.0 - cosine;
  return normal_reflectance + (grazing_of(normal_reflectance) - normal_reflectance) * (c * c * c * c * c);
}

// Of the base: what goes in or out under that angle (Ashikhmin & Shirley 2000, eq. 5).
float base_share(float grazing, float cosine) {
  float s = 1.0 - 0.5 * cosine;
  return 1.0 - grazing * (s * s * s * s * s);
}

// Reflectance of the base over its albedo, for light from one direction.
vec3 base_of(vec3 normal_reflectance, float out_cosine, float in_cosine) {
  float grazing = grazing_of(normal_reflectance);
  return (1.0 - normal_reflectance) * (base_share(grazing, out_cosine) * base_share(grazing, in_cosine) / (1.0 - 5.0 / 28.0 * grazing));
}

// The same for even light from all around.
vec3 base_of(vec3 normal_reflectance, float out_cosine) {
  return (1.0 - normal_reflectance) * base_share(grazing_of(normal_reflectance), out_cosine);
}
)";

/// What becomes of light: a colour of the display over the background, or radiance and cover for compositing.
const char* const kShown = R"(
#ifdef SCENE_LINEAR
vec4 background(vec3 behind) { return vec4(0.0); }
vec4 shown(vec3 radiance, float cover, vec3 behind) { return vec4(max(radiance, 0.0) * cover, cover); }
vec4 stored(vec4 light) { return light; }
#else
vec4 background(vec3 behind) { return vec4(behind, 1.0); }
vec4 shown(vec3 radiance, float cover, vec3 behind) { return vec4(mix(behind, filmic(radiance), cover), 1.0); }
vec4 stored(vec4 light) { return encoded(light.rgb); }
#endif
)";

const char* const kAreaUniforms = R"(
uniform int area_lights;
uniform vec3 area_centre[4];
uniform vec3 area_u[4];        // half the edge along either side
uniform vec3 area_v[4];
uniform vec3 area_radiance[4];
)";

/// Share of a rectangle a point sees: percentage-closer soft shadows for rectangles, in a perspective map from the middle
/// of each along its normal. With k the reciprocal of the depth, the point s of the rectangle is hidden by what lies at
/// t + s (k_blocker - k) in the map, t the receiver's place there, and the tangent plane of the receiver is affine in k.
const char* const kAreaShadow = R"(
uniform sampler2D area_depth;            // a map for each light, two by two
uniform sampler2DShadow area_compare;
uniform vec3 area_lower[4];              // least tangents in the map, k of its near plane
uniform vec3 area_extent[4];             // their extents, and that of k; 0: no map
uniform float area_texels;               // edge of one map

float area_visibility(int i, vec3 p, vec3 n) {
  vec2 half_sizes = vec2(length(area_u[i]), length(area_v[i]));
  vec3 across = area_u[i] / half_sizes.x;
  vec3 along = -area_v[i] / half_sizes.y;
  vec3 front = cross(along, across);
  vec3 q = p - area_centre[i];
  q = vec3(dot(q, across), dot(q, along), dot(q, front));
  vec3 m = vec3(dot(n, across), dot(n, along), dot(n, front));
  vec3 extent = max(area_extent[i], 1e-9);
  vec2 texel = extent.xy / area_texels;
  float step = max(texel.x, texel.y) * max(q.z, 0.0);
  q += m * (1.2 * step);
  float k = 1.0 / max(q.z, 1e-6);
  vec2 place = (q.xy * k - area_lower[i].xy) / extent.xy;
  float depth = (area_lower[i].z - k) / extent.z;
  bool seen = area_extent[i].z > 0.0 && q.z > 0.0 && depth > 0.0;
  // In units of the map: how depth grows along the receiver's plane, and what counts as the same surface.
  vec2 slope = clamp(-m.xy / min(dot(m, q), -0.05 * length(q)) * extent.xy / extent.z, -4.0, 4.0);
  float slack = 0.75 * step * k * k / extent.z;

  float turn = pixel_turn() * 0.15915494;
  vec2 start = vec2(turn, fract(turn * 17.0 + 0.37));
  const vec2 kPlastic = vec2(0.75487767, 0.56984029);   // Roberts 2018
  vec2 corner = 0.5 * vec2(float(i & 1), float(i >> 1));
  vec2 low = vec2(0.5) / area_texels;   // outside of a map nothing hides
  int search = seen ? 24 : 0;
  float blockers = 0.0;
  float sum = 0.0;
  for (int j = 0; j < search; ++j) {
    // Half of them as far as the nearest blocker may lie, half nearer and nearer.
    float level = (j & 1) == 0 ? 1.0 : (float(j) + 0.5) / 24.0;
    vec2 s = (fract(start + float(j) * kPlastic) * 2.0 - 1.0) * half_sizes;
    vec2 offset = s * (max(depth, 0.0) * extent.z * level * level) / extent.xy;
    vec2 there = clamp(place + offset, low, 1.0 - low);
    float found = there == place + offset ? textureLod(area_depth, corner + 0.5 * there, 0.0).r : 1.0;
    float apart = (depth - found) * extent.z;
    // Only what lies between here and the rectangle hides some of it.
    bool between = all(lessThan(abs(offset) * extent.xy, half_sizes * apart + 1.5 * texel));
    float blocked = between && found < depth + dot(slope, offset) - slack ? 1.0 : 0.0;
    blockers += blocked;
    sum += blocked * apart;
  }
  vec2 reach = max(half_sizes * (sum / max(blockers, 1.0)), 1.2 * texel) / extent.xy;
  int taps = blockers > 0.5 ? 32 : 0;
  float lit = 0.0;
  for (int j = 0; j < taps; ++j) {
    vec2 offset = (fract(start + float(j) * kPlastic) * 2.0 - 1.0) * reach;
    float limit = min(depth + dot(slope, offset) - slack, 1.0);
    vec2 there = clamp(place + offset, low, 1.0 - low);
    lit += there == place + offset ? texture(area_compare, vec3(corner + 0.5 * there, limit)) : 1.0;
  }
  return taps > 0 ? lit / 32.0 : 1.0;
}
)";

/// Rectangles. Diffuse by the contour integral of Lambert (Baum, Rushmeier & Winget 1989, clipped to the
/// horizon by its closed-form fit, Hill & Heitz 2016); glossy by the point of the rectangle nearest to the mirrored view
/// (Karis 2013).
const char* const kAreaLight = R"(
vec3 edge_integral(vec3 a, vec3 b) {
  float x = clamp(dot(a, b), -0.9999, 0.9999);
  return cross(a, b) * (acos(x) * inversesqrt(1.0 - x * x));
}

// Irradiance over pi of a unit radiance; what lies below the horizon is clipped as of a sphere of the same solid angle.
float rectangle_share(vec3 p, vec3 n, vec3 c, vec3 u, vec3 v) {
  vec3 a = normalize(c - u - v - p);
  vec3 b = normalize(c + u - v - p);
  vec3 d = normalize(c + u + v - p);
  vec3 e = normalize(c - u + v - p);
  // From the lit side the corners run clockwise.
  vec3 f = (edge_integral(a, b) + edge_integral(b, d) + edge_integral(d, e) + edge_integral(e, a)) * -0.15915494;
  float size = length(f);
  return max((size * size + dot(f, n)) / (size + 1.0), 0.0);
}

vec3 area_diffuse(vec3 p, vec3 n) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < area_lights; ++i) {
    float lit = dot(p - area_centre[i], cross(area_u[i], area_v[i])) > 0.0 ? area_visibility(i, p, n) : 0.0;
    sum += area_radiance[i] * (lit * rectangle_share(p, n, area_centre[i], area_u[i], area_v[i]));
  }
  return sum;
}

vec3 area_light(vec3 p, vec3 n, vec3 v, vec3 albedo, vec3 normal_reflectance, float a2) {
  vec3 sum = vec3(0.0);
  vec3 mirrored = reflect(-v, n);
  for (int i = 0; i < area_lights; ++i) {
    vec3 c = area_centre[i];
    vec3 front = normalize(cross(area_u[i], area_v[i]));
    float lit = dot(p - c, front) > 0.0 ? area_visibility(i, p, n) : 0.0;
    float nv = max(dot(n, v), 0.08);
    vec3 base = base_of(normal_reflectance, nv, max(dot(n, normalize(c - p)), 0.0));
    sum += area_radiance[i] * albedo * base * (lit * rectangle_share(p, n, c, area_u[i], area_v[i]));
    float t = dot(c - p, front) / min(dot(mirrored, front), -1e-3);
    vec3 hit = p + mirrored * max(t, 0.0) - c;
    float u = clamp(dot(hit, area_u[i]) / dot(area_u[i], area_u[i]), -1.0, 1.0);
    float w = clamp(dot(hit, area_v[i]) / dot(area_v[i], area_v[i]), -1.0, 1.0);
    vec3 to = c + u * area_u[i] + w * area_v[i] - p;
    float d2 = dot(to, to);
    vec3 l = to * inversesqrt(d2);
    vec3 h = normalize(l + v);
    float nh = max(dot(n, h), 0.0);
    float nl = max(dot(n, l), 0.0);
    float area = 4.0 * length(area_u[i]) * length(area_v[i]);
    // The lobe is widened by the light's angular size and keeps its energy.
    float wide = min(sqrt(a2) + 0.5 * sqrt(area / d2), 1.0);
    float spread = nh * nh * (a2 - 1.0) + 1.0;
    float lobe = a2 / (spread * spread) * (a2 / (wide * wide)) * 0.25 / (nl * nv + 0.05);
    vec3 fresnel = fresnel_of(normal_reflectance, max(dot(v, h), 0.0));
    float seen_share = min(nl * max(-dot(l, front), 0.0) * area / (d2 * 3.14159265), 1.0);
    sum += area_radiance[i] * fresnel * (lit * lobe * seen_share);
  }
  return sum;
}
)";

/// The pattern of the ground lies in its x and y; `across` and `up` are what a pixel spans of it.
const char* const kGroundPaint = R"(
uniform int ground_paint;           // PaintKind
uniform vec3 ground_second;
uniform float ground_paint_size;
uniform vec2 ground_axis;
uniform sampler2D ground_picture;
uniform float ground_aspect;

vec3 ground_colour(vec2 at, vec2 across, vec2 up) {
  at /= ground_paint_size;
  across /= ground_paint_size;
  up /= ground_paint_size;
  if (ground_paint == 1) {
    vec2 width = abs(across) + abs(up);
    return mix(ground_second, ground_albedo, 0.5 + 0.5 * wave(at.x, width.x) * wave(at.y, width.y));
  }
  if (ground_paint == 2) {
    float t = dot(at, ground_axis);
    return mix(ground_second, ground_albedo, 0.5 + 0.5 * wave(t, abs(dot(across, ground_axis)) + abs(dot(up, ground_axis))));
  }
  if (ground_paint == 3) {
    vec2 proportion = vec2(1.0, ground_aspect);
    return textureGrad(ground_picture, at * proportion, across * proportion, up * proportion).rgb;
  }
  return ground_albedo;
}
)";

const char* const kGroundLight = R"(
uniform float camera_distance;
uniform sampler2D ground_visibility;
uniform mat4 ground_to_unit;
uniform float ground_occluded;    // 0: nothing stands above the ground
uniform vec2 ground_origin;       // of the pattern

vec2 ground_place(vec2 pixel) {
  vec3 ray = eye_ray(pixel);
  return (eye + (transpose(mat3(view)) * ray) * ground_depth(ray)).xy;
}

vec4 ground_light(vec3 p, vec3 behind, vec3 visible) {
  vec2 at = (ground_to_unit * vec4(p, 1.0)).xy;
  float ao = mix(1.0, textureLod(ground_visibility, clamp(at, 0.0, 1.0), 0.0).r, ground_occluded);
#ifdef GROUND_PAINT
  vec2 here = ground_place(gl_FragCoord.xy);
  vec3 albedo = ground_colour(p.xy - ground_origin, ground_place(gl_FragCoord.xy + vec2(1.0, 0.0)) - here,
                              ground_place(gl_FragCoord.xy + vec2(0.0, 1.0)) - here);
#else
  vec3 albedo = ground_albedo;
#endif
  vec3 radiance = sun * (max(to_light.z, 0.0) * visible) + sky * ao;
#ifdef AREA_LIGHTS
  radiance += area_diffuse(p, vec3(0.0, 0.0, 1.0));
#endif
  // Into the background with distance and towards the horizon, so that there is no edge.
  float away = length(p.xy) / camera_distance;
  float down = (eye.z - p.z) / length(eye - p);
  float fade = (1.0 - smoothstep(0.7, 3.2, away)) * smoothstep(0.02, 0.22, down);
  return shown(albedo * radiance, fade, behind);
}
)";

const char* const kItemLight = R"(
uniform sampler2D materials;      // albedo and roughness of each item; in the next row, metallic, painted, reflectance, inside
uniform sampler2D occlusion;
uniform float occlusion_radius;
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

const uint kFixed = 0x40000000u;

// A dark hair line where another item meets this one in the picture and in depth, unless their faces are flush or both are fixed.
float contact_line(uint id, float depth, vec3 n) {
  ivec2 last = ivec2(picture_size) - 1;
  float near_by = 6.0 * depth * 2.0 * half_extent.y / picture_size.y;
  float touching = 0.0;
  vec2 turned = vec2(1.25, 0.0);
  for (int i = 0; i < contact_taps; ++i) {
    ivec2 there = clamp(ivec2(gl_FragCoord.xy + turned), ivec2(0), last);
    uvec2 geometry_there = GEOMETRY(there, 0).rg;
    uint other = geometry_there.g;
    float bent = min(8.0 * (1.0 - dot(unpack_normal(geometry_there.r), n)), 1.0);
    float gap = abs(eye_depth(DEPTH(there, 0).r) - depth);
    bool apart = other != id && (other & id & kFixed) == 0u;
    touching += apart ? bent * max(1.0 - gap / near_by, 0.0) : 0.0;
    turned = mat2(0.70710678, 0.70710678, -0.70710678, 0.70710678) * turned;
  }
  return 1.0 - 0.6 * min(touching * 0.5, 1.0);
}

#ifdef INSIDE
// Light from the sun that scatters inside: it bends around the body, the farther the longer its free path (`soft`, over half the
// body's extent), and comes through where the sun is behind. Over all directions of the normal the mean is that of n.l.
vec3 scattered(vec3 albedo, float soft, float cosine, float behind) {
  vec3 wrap = min(vec3(soft) * (0.5 + albedo), 1.0);
  vec3 around = max((vec3(cosine) + wrap) / ((1.0 + wrap) * (1.0 + wrap)), 0.0);
  return around + wrap * albedo * (0.25 * pow(max(behind, 0.0), 4.0));
}

// What a ray brings that goes through a ball of glass: its second refraction is that of the first one mirrored. Beyond are sky, floor
// and the light that the ball gathers from the sun.
vec3 through_glass(vec3 n, vec3 v, float index, vec3 tint) {
  vec3 within = refract(-v, n, 1.0 / index);
  vec3 m = normalize(n - 2.0 * dot(n, within) * within);   // where the chord leaves the ball
  vec3 out_of = refract(within, -m, index);
  vec3 d = dot(out_of, out_of) > 0.0 ? out_of : reflect(within, m);
  float blur = 0.03;
  vec3 floor_light = max(ground_albedo * (sky + sun * max(to_light.z, 0.0)), bounce);
  vec3 beyond = mix(floor_light, sky, smoothstep(-blur, blur, d.z));
  float focus = smoothstep(0.90, 0.995, dot(d, to_light));
  float way = abs(dot(n, within));                         // over the ball's diameter
  return (beyond + sun * (0.6 * focus)) * pow(max(tint, 0.001), vec3(way));
}
#endif

vec4 item_light(vec3 p, vec3 n, float depth, uint id, vec3 visible, vec3 own_albedo) {
  int number = int(id & ~kFixed) - 1;
  ivec2 row = ivec2(number & 4095, (number >> 12) * 2);
  vec4 material = texelFetch(materials, row, 0);
  vec4 more = texelFetch(materials, row + ivec2(0, 1), 0);
  vec3 base = more.y > 0.5 ? own_albedo : material.rgb;
  vec3 albedo = base * (1.0 - more.x);
  vec3 normal_reflectance = mix(vec3(more.z), base, more.x);
  float roughness = material.a;
  vec3 v = normalize(eye - p);
#ifdef INSIDE
  float soft = max(more.w, 0.0);
  bool is_glass = more.w < 0.0;
  vec3 inner = albedo;
  if (soft > 0.0) albedo = vec3(0.0);
  if (is_glass) {
    float f = (-more.w - 1.0) / (1.0 - more.w);
    normal_reflectance = vec3(f * f);
    albedo = vec3(0.0);
    roughness = 0.05;
  }
#endif
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
  vec3 radiance = sun * (nl * visible) * (albedo * base_of(normal_reflectance, nv, nl) + d * smith * fresnel_of(normal_reflectance, vh));

#ifdef INSIDE
  if (soft > 0.0) {
    float cosine = dot(n, to_light);
    // Shadows bleed in, too, and the own shadow of the body is that of the wrapped cosine.
    vec3 lit = mix(visible, vec3(1.0), cosine < 0.0 ? 0.7 : 0.25 * min(soft, 1.0));
    radiance += sun * lit * inner * scattered(inner, soft, cosine, -dot(v, to_light)) * base_of(normal_reflectance, nv);
    albedo = inner;
  }
#endif

  // Occlusion with the light that an occluder of the same colour sends back (Jimenez et al. 2016).
  float ao = item_visibility(depth);
  vec3 many = max(vec3(ao), ((2.0404 * albedo - 0.3324) * ao + (-4.7951 * albedo + 0.6417)) * ao * ao +
                                (2.7552 * albedo + 0.6903) * ao);
  vec3 around = mix(bounce, sky, 0.5 + 0.5 * n.z);
  radiance += albedo * base_of(normal_reflectance, nv) * around * many;

  // The studio in the mirror: sky over floor, and a broad soft box opposite the sun. Split sum by Karis 2013.
  vec3 mirrored = reflect(-v, n);
  float blur = 0.08 + 0.7 * roughness;
  vec3 seen = mix(bounce, sky, smoothstep(-blur, blur, mirrored.z));
  vec3 box = normalize(vec3(-to_light.xy, 0.9));
  seen += sky * 1.6 * smoothstep(0.80 - 0.4 * roughness, 0.90 + 0.1 * roughness, dot(mirrored, box));
  vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
  float split = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
  vec3 gloss = normal_reflectance * (-1.04 * split + r.z) + grazing_of(normal_reflectance) * (1.04 * split + r.w);
#ifdef INSIDE
  if (is_glass) {
    vec3 passed = 1.0 - fresnel_of(normal_reflectance, nv);
    return shown(radiance + seen * gloss + passed * through_glass(n, v, -more.w, inner), 1.0, vec3(0.0));
  }
#endif
  radiance += seen * gloss * ao;
#ifdef AREA_LIGHTS
  radiance += area_light(p, n, v, albedo, normal_reflectance, a2);
#endif

  // A rim of light from behind parts the item from a ground of the same brightness.
  float edge = pow(1.0 - nv, 4.0);
  radiance += sky * (0.22 * edge * ao) * (0.4 + 0.6 * albedo) * smoothstep(-0.4, 0.8, n.z);
  return shown(radiance, 1.0, vec3(0.0)) * vec4(vec3(contact_line(id, depth, n)), 1.0);
}
)";

std::string choices(const Lighting& lighting) {
  return std::string(lighting.area_lights ? "#define AREA_LIGHTS\n" : "") + (lighting.ground_paint ? "#define GROUND_PAINT\n" : "") +
         (lighting.inside ? "#define INSIDE\n" : "") + (lighting.scene_linear ? "#define SCENE_LINEAR\n" : "");
}

/// What falls on ground and items beside sun and sky, and the ground's own colour.
std::string lights(const Lighting& lighting) {
  return (lighting.area_lights ? std::string(kAreaUniforms) + kAreaShadow + kAreaLight : std::string()) +
         "uniform vec3 ground_albedo;\n" + (lighting.ground_paint ? std::string(kWave) + kGroundPaint : std::string());
}

std::string painted_access(int samples) {
  return std::string("uniform sampler2D") + (samples > 1 ? "MS" : "") + " paints;\n" +
         "vec3 squared(vec3 v) { return v * v; }\n#define ALBEDO(at, s) squared(texelFetch(paints, at, " +
         (samples > 1 ? "s" : "0") + ").rgb)\n";
}

}  // namespace

// Sorts the pixels for the passes that follow: a software rasteriser takes both sides of every branch, but leaves out
// whole patches that fail the depth test. The background is drawn on the way.
std::string classify(const Lighting& lighting) {
  return header(lighting.samples) + choices(lighting) + kGeometry + kPixel + kLight + kShown + R"(
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  float nearest = 0.0;
  for (int s = 0; s < SAMPLES; ++s) nearest = max(nearest, DEPTH(pixel, s).r);
  bool is_floor = ground_depth(eye_ray(gl_FragCoord.xy)) < depth_range.y;
  gl_FragDepth = nearest > 0.0 ? 0.9 : (is_floor ? 0.1 : 0.5);
  colour = stored(background(background_colour()));
})";
}

std::string lit_ground(const Lighting& lighting) {
  return std::string(kVersion) + choices(lighting) + kDisc + kGeometry + kPixel + kShadow + kGlassShadow + kLight + kMaterial + kShown + lights(lighting) +
         kGroundLight + R"(
void main() {
  vec3 ray = eye_ray(gl_FragCoord.xy);
  vec3 p = eye + (transpose(mat3(view)) * ray) * ground_depth(ray);
  vec3 up = vec3(0.0, 0.0, 1.0);
  colour = stored(ground_light(p, background_colour(), sun_visibility(p, up, true) * passed_by_glass(p, up)));
})";
}

namespace {

// Rasterisation rounds the places of vertices. Where a corner of one face ends on an edge of another, this opens a crack of some 1/256 of a
// pixel, and what shows in it is a hidden face that begins at that edge: a sample of it lies in the plane of the face beside it. Such samples
// of fixed items become what all others of the pixel are.
const char* const kCracks = R"(
const float kBent = 0.9;        // cosine between the normals of different faces
const float kCrack = 0.0078125;  // pixels, more than two edges that are rounded to 1/256 are apart

bool alike(uint a, vec3 m, uint b, vec3 n) { return (a == b || (a & b & kFixed) != 0u) && dot(m, n) >= kBent; }

bool meets(uint a, vec3 m, vec3 p, uint b, vec3 n, vec3 q, float footprint) {
  bool fixed_ones = (a & b & kFixed) != 0u && dot(m, n) < kBent;
  mat3 to_world = transpose(mat3(view));
  float slant = max(abs(dot(m, normalize(to_world * p))), 0.05);
  return fixed_ones && abs(dot(to_world * (p - q), n)) * slant < kCrack * footprint * -p.z;
}

#if SAMPLES > 1
void close_cracks(inout uint id[SAMPLES], inout vec3 normal[SAMPLES], vec3 place[SAMPLES], float footprint) {
  int count[SAMPLES];
  for (int s = 0; s < SAMPLES; ++s) {
    count[s] = 0;
    for (int t = 0; t < SAMPLES; ++t) count[s] += alike(id[s], normal[s], id[t], normal[t]) ? 1 : 0;
  }
  for (int s = 0; s < SAMPLES; ++s)
    for (int t = 0; t < SAMPLES; ++t) {   // what has become like others meets nothing more
      bool hidden = count[t] > count[s] && count[t] + count[s] == SAMPLES && meets(id[s], normal[s], place[s], id[t], normal[t], place[t], footprint);
      id[s] = hidden ? id[t] : id[s];
      normal[s] = hidden ? normal[t] : normal[s];
    }
}
#else
void close_crack(ivec2 pixel, inout uint id, inout vec3 normal, vec3 place, float footprint) {
  ivec2 last = ivec2(picture_size) - 1;
  bool alone = true;
  bool hidden = false;
  uint found = 0u;
  vec3 its_normal = vec3(0.0);
  for (int k = 0; k < 4; ++k) {
    ivec2 there = clamp(pixel + ivec2(k < 2 ? 2 * k - 1 : 0, k < 2 ? 0 : 2 * k - 5), ivec2(0), last);
    uvec2 item = GEOMETRY(there, 0).rg;
    vec3 n = unpack_normal(item.x);
    vec3 q = eye_ray(vec2(there) + sample_at[0]) * eye_depth(DEPTH(there, 0).r);
    alone = alone && !alike(id, normal, item.y, n);
    bool here = meets(id, normal, place, item.y, n, q, footprint);
    hidden = hidden || here;
    found = here ? item.y : found;
    its_normal = here ? n : its_normal;
  }
  if (alone && hidden) {
    id = found;
    normal = its_normal;
  }
}
#endif
)";

}  // namespace

// Each surface of a pixel is lit once, whatever number of its samples it covers. Surfaces: one for each item (two for
// an item that folds over itself within the pixel), the ground, and the background.
std::string lit_items(const Lighting& lighting) {
  return header(lighting.samples) + choices(lighting) +
         (lighting.painted ? painted_access(lighting.samples) : std::string("#define ALBEDO(at, s) vec3(0.0)\n")) + kDisc + kGeometry +
         kPixel + kShadow + kGlassShadow + kLight + kMaterial + kShown + lights(lighting) + kGroundLight + kItemLight + kCracks + R"(
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  mat3 to_world = transpose(mat3(view));
  vec3 along = to_world * eye_ray(gl_FragCoord.xy);
  vec3 behind = background_colour();

  uint id[SAMPLES];
  vec3 normal[SAMPLES];
  vec3 place[SAMPLES];   // from the eye
  float depth[SAMPLES];
  bool open[SAMPLES];
  for (int s = 0; s < SAMPLES; ++s) {
    uvec2 item = GEOMETRY(pixel, s).rg;
    float stored_depth = DEPTH(pixel, s).r;
    float item_depth = eye_depth(stored_depth);
    vec3 ray = eye_ray(vec2(pixel) + sample_at[s]);
    float floor_depth = ground_depth(ray);
    bool is_item = stored_depth > 0.0 && item_depth <= floor_depth;
    id[s] = is_item ? item.y : 0u;
    normal[s] = is_item ? unpack_normal(item.x) : vec3(0.0, 0.0, 1.0);
    depth[s] = is_item ? item_depth : floor_depth;
    place[s] = ray * depth[s];
    open[s] = true;
  }
  float footprint = 2.0 * half_extent.y / picture_size.y;   // of the pixel, at depth 1
  bool several = false;
  for (int s = 1; s < SAMPLES; ++s) several = several || id[s] != id[0] || dot(normal[s], normal[0]) < kBent;
#if SAMPLES > 1
  if (several) close_cracks(id, normal, place, footprint);
#else
  close_crack(pixel, id[0], normal[0], place[0], footprint);
#endif
  vec4 sum = vec4(0.0);
  int left = SAMPLES;
  while (left > 0) {
    bool found = false;
    uint surface_id = 0u;
    float first_depth = 0.0;
    vec3 first_normal = vec3(0.0, 0.0, 1.0);
    float slack = 0.0;
    float surface_depth = 0.0;
    vec3 middle = vec3(0.0);   // of its samples, which lies on the surface, too: the middle of the pixel may be behind another one
    vec3 n = vec3(0.0);
    vec3 own_albedo = vec3(0.0);
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
      middle += same ? place[s] : vec3(0.0);
      n += same ? normal[s] : vec3(0.0);
      own_albedo += same ? ALBEDO(pixel, s) : vec3(0.0);
      count += same ? 1 : 0;
    }
    left -= count;
    surface_depth /= float(max(count, 1));
    own_albedo /= float(max(count, 1));
    n = normalize(n);
    bool is_item = surface_id > 0u;
    bool is_floor = !is_item && surface_depth < depth_range.y * 0.5 * kNowhere;
    vec3 p = eye + to_world * (middle / float(max(count, 1)));
    vec3 visible = sun_visibility(p, n, is_item || is_floor) * passed_by_glass(p, n);
    vec4 lit = background(behind);
    if (is_item) lit = item_light(p, n, surface_depth, surface_id, visible, own_albedo);
    if (is_floor) lit = ground_light(p, behind, visible);
    sum += lit * float(count);
  }

  colour = stored(sum / float(SAMPLES));
})";
}

}  // namespace supple::render::shaders
