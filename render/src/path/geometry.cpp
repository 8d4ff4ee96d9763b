#include "path/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <tuple>
#include <type_traits>

#include "path/paint.h"
#include "picture/draw_list.h"
#include "picture/lighting.h"
#include "supple/core/error.h"
#include "supple/core/executor.h"

namespace supple::render::path {
namespace {

void check(RTCDevice device) {
  const RTCError code = rtcGetDeviceError(device);
  if (code == RTC_ERROR_NONE) return;
  // An unknown error is an exception of a task that Embree cancelled, which it does where an allocation fails in another one.
  const bool memory = code == RTC_ERROR_OUT_OF_MEMORY || code == RTC_ERROR_UNKNOWN;
  throw Error(memory ? ErrorKind::Limit : ErrorKind::Internal,
              Fault{.place = "render", .key = {}, .expected = memory ? "no memory for the triangles of the picture"
                                                                     : "Embree reports error " + std::to_string(code),
                    .found = {}, .hint = {}});
}

/// What Embree gave, which is nothing where its memory is out. @throws Error
template <class Given>
Given* given(RTCDevice device, Given* pointer) {
  if (pointer != nullptr) return pointer;
  check(device);
  throw std::bad_alloc();
}

Vec3f vector(const float* v) { return {v[0], v[1], v[2]}; }

/// Corners of the triangles (0, 1, 3) and (2, 3, 1), as Embree has them. There is no second one where 2 and 3 are the same.
using Quadrangle = std::array<std::uint32_t, 4>;
static_assert(sizeof(Quadrangle) == 4 * sizeof(std::uint32_t));

/// Joins triangles that follow each other and have an edge in common: hierarchies of half as many leaves take half the time to build,
/// and rays pass through fewer of them.
std::vector<Quadrangle> joined(const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<Quadrangle> out;
  out.reserve(triangles.size());
  const auto join = [&](const auto& first, const auto& second) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b) {
        const std::uint32_t from = first[(a + 1) % 3], to = first[(a + 2) % 3];
        if (from != second[(b + 2) % 3] || to != second[(b + 1) % 3]) continue;
        out.push_back({first[a], from, second[b], to});
        return true;
      }
    return false;
  };
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const auto& t = triangles[i];
    if (i + 1 < triangles.size() && join(t, triangles[i + 1])) {
      ++i;
    } else {
      out.push_back({t[0], t[1], t[2], t[2]});
    }
  }
  return out;
}

Medium medium_of(const Item& item, double per_metre) {
  constexpr float kLeast = 1e-3F;  // of a colour, so that what is absorbed is finite
  const auto depth = static_cast<float>(per_metre * item.inside.depth);
  Medium medium{.kind = item.inside.kind, .index = static_cast<float>(item.inside.index), .mean_free_path = depth};
  if (depth > 0.0F) medium.absorption = -linear_colour(item.colour).cwiseMax(kLeast).array().log().matrix() / depth;
  return medium;
}

/// How far corners of quadrangles that follow each other lie from their middles, over how far all do: squares, which turning, moving
/// and scaling leave as they are.
float spread_of(const std::vector<Quadrangle>& quadrangles, const std::vector<float>& position) {
  constexpr std::size_t kTogether = 64;
  const Vec3f origin = vector(&position[4 * std::size_t{quadrangles[0][0]}]);
  Vec3f total = Vec3f::Zero();
  float squares = 0.0F, apart = 0.0F;
  for (std::size_t first = 0; first < quadrangles.size(); first += kTogether) {
    const std::size_t last = std::min(first + kTogether, quadrangles.size());
    const auto count = 4.0F * static_cast<float>(last - first);
    const Vec3f near = vector(&position[4 * std::size_t{quadrangles[first][0]}]);
    Vec3f sum = Vec3f::Zero();
    float own_squares = 0.0F;
    for (std::size_t i = first; i < last; ++i)
      for (const std::uint32_t corner : quadrangles[i]) {
        const Vec3f d = vector(&position[4 * std::size_t{corner}]) - near;
        sum += d;
        own_squares += d.squaredNorm();
      }
    const float own = std::max(0.0F, own_squares - sum.squaredNorm() / count);
    const Vec3f middle = near + sum / count - origin;
    apart += own;
    squares += own + count * middle.squaredNorm();
    total += count * middle;
  }
  const float all = squares - total.squaredNorm() / (4.0F * static_cast<float>(quadrangles.size()));
  return apart / std::max(all, std::numeric_limits<float>::min());
}

}  // namespace

/// Data of an item kept between pictures.
struct Geometry::Part {
  RTCGeometry geometry = nullptr;
  unsigned id = RTC_INVALID_GEOMETRY_ID;
  bool moving = false;
  unsigned mask = 0;                 ///< of the rays that meet it: 1, and 2 those of shadows
  std::vector<float> position;       ///< at the beginning, and for moving ones at the end; [vertices][4]
  std::vector<float> position_end;
  std::vector<Vec3f> normal;
  std::vector<Quadrangle> quadrangle;
  std::vector<std::uint32_t> first_quadrangle;  ///< of each vertex
  float spread = 0.0F;  ///< when its hierarchy was built
  PaintSource paint;
};

Geometry::Geometry() : device_(given(nullptr, rtcNewDevice("set_affinity=0"))) {
  scene_ = given(device_, rtcNewScene(device_));
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);  // a hierarchy for each item and one of them all: others are not refitted
  check(device_);
}

Geometry::~Geometry() {
  if (committing_) return;  // TBB would wait for ever for a task that it had no memory for
  for (const auto& part : parts_)  // of a picture whose making ran out of memory some are not there
    if (part != nullptr && part->geometry != nullptr) rtcReleaseGeometry(part->geometry);
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void Geometry::set(std::span<const Item> items, const PictureSpace& space, double shutter, float wire) {
  counts_ = {};
  wire_ = wire;
  const bool same_place = space == space_;
  bool changed = scene_is_new_;
  scene_is_new_ = false;
  space_ = space;
  for (std::size_t i = items.size(); i < parts_.size(); ++i) {
    if (parts_[i] == nullptr || parts_[i]->geometry == nullptr) continue;
    changed = true;
    rtcDetachGeometry(scene_, parts_[i]->id);
    rtcReleaseGeometry(parts_[i]->geometry);
  }
  parts_.resize(items.size());
  items_.assign(items.begin(), items.end());
  media_.clear();
  for (const Item& item : items) media_.push_back(medium_of(item, space.per_metre));
  const auto any_is = [&](auto&& test) { return std::any_of(items.begin(), items.end(), [&](const Item& item) { return test(item.inside.kind); }); };
  has_media_ = any_is([](InsideKind kind) { return kind != InsideKind::Opaque; });
  has_glass_ = any_is([](InsideKind kind) { return kind == InsideKind::Glass; });
  for (std::size_t i = 0; i < items.size(); ++i) {
    SUPPLE_EXPECTS(items[i].mesh != nullptr);
    const Mesh& mesh = *items[i].mesh;
    SUPPLE_EXPECTS(mesh.normal.size() == mesh.position.size());
    if (!parts_[i]) parts_[i] = std::make_unique<Part>();
    Part& part = *parts_[i];
    part.paint = PaintSource(items[i]);

    const std::size_t n = mesh.vertex_count();
    const auto* vx = column(mesh, "velocity_x");
    const auto* vy = column(mesh, "velocity_y");
    const auto* vz = column(mesh, "velocity_z");
    const bool moving = shutter > 0.0 && vx != nullptr && vy != nullptr && vz != nullptr;
    std::vector<float> begin(4 * n), end(moving ? 4 * n : 0);
    for (std::size_t v = 0; v < n; ++v) {
      const Vec3 half = moving ? Vec3(0.5 * shutter * space.per_metre * Vec3((*vx)[v], (*vy)[v], (*vz)[v])) : Vec3(Vec3::Zero());
      const Vec3 p = space.place(mesh.position[v]);
      for (int k = 0; k < 3; ++k) {
        begin[4 * v + static_cast<std::size_t>(k)] = static_cast<float>(p[k] - half[k]);
        if (moving) end[4 * v + static_cast<std::size_t>(k)] = static_cast<float>(p[k] + half[k]);
      }
    }
    part.normal.resize(n);
    for (std::size_t v = 0; v < n; ++v) part.normal[v] = mesh.normal[v].cast<float>();

    std::vector<Quadrangle> quadrangle = joined(mesh.triangle);
    // Wires alone throw no shadow, and glass lets light pass.
    const unsigned mask = items[i].surface && items[i].inside.kind != InsideKind::Glass ? 3u : 1u;
    const bool same_triangles = part.geometry != nullptr && mask == part.mask && moving == part.moving && part.position.size() == begin.size() &&
                                quadrangle == part.quadrangle;
    if (same_triangles && same_place && begin == part.position && end == part.position_end) {
      ++counts_.kept;
      continue;
    }
    changed = true;
    part.position = std::move(begin);
    part.position_end = std::move(end);
    if (same_triangles) {
      // The buffers are Embree's copies: they keep their places.
      std::memcpy(rtcGetGeometryBufferData(part.geometry, RTC_BUFFER_TYPE_VERTEX, 0), part.position.data(),
                  part.position.size() * sizeof(float));
      rtcUpdateGeometryBuffer(part.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
      if (moving) {
        std::memcpy(rtcGetGeometryBufferData(part.geometry, RTC_BUFFER_TYPE_VERTEX, 1), part.position_end.data(),
                    part.position_end.size() * sizeof(float));
        rtcUpdateGeometryBuffer(part.geometry, RTC_BUFFER_TYPE_VERTEX, 1);
      }
      constexpr float kWorn = 1.5F;  // boxes grow with it, and with them what rays cost
      const float spread = spread_of(part.quadrangle, part.position);
      const bool worn = spread > kWorn * part.spread;
      if (worn) {
        rtcUpdateGeometryBuffer(part.geometry, RTC_BUFFER_TYPE_INDEX, 0);  // which has Embree build anew
        part.spread = spread;
      }
      rtcCommitGeometry(part.geometry);
      ++(worn ? counts_.built : counts_.refitted);
      continue;
    }
    if (part.geometry != nullptr) {
      rtcDetachGeometry(scene_, part.id);
      rtcReleaseGeometry(part.geometry);
      part.geometry = nullptr;
    }
    part.moving = moving;
    part.quadrangle = std::move(quadrangle);
    if (part.quadrangle.empty()) continue;
    for (const auto& triangle : mesh.triangle)
      for (const std::uint32_t v : triangle) SUPPLE_EXPECTS(v < n);
    part.first_quadrangle.assign(n, 0);
    for (std::size_t q = part.quadrangle.size(); q-- > 0;)
      for (const std::uint32_t v : part.quadrangle[q]) part.first_quadrangle[v] = static_cast<std::uint32_t>(q);
    part.spread = spread_of(part.quadrangle, part.position);
    part.geometry = given(device_, rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_QUAD));
    rtcSetGeometryBuildQuality(part.geometry, RTC_BUILD_QUALITY_REFIT);
    if (moving) rtcSetGeometryTimeStepCount(part.geometry, 2);
    const auto fill = [&](unsigned slot, const std::vector<float>& from) {
      void* to = given(device_, rtcSetNewGeometryBuffer(part.geometry, RTC_BUFFER_TYPE_VERTEX, slot, RTC_FORMAT_FLOAT3, 4 * sizeof(float), n));
      std::memcpy(to, from.data(), from.size() * sizeof(float));
    };
    fill(0, part.position);
    if (moving) fill(1, part.position_end);
    void* to = given(device_, rtcSetNewGeometryBuffer(part.geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, sizeof(Quadrangle), part.quadrangle.size()));
    std::memcpy(to, part.quadrangle.data(), part.quadrangle.size() * sizeof(Quadrangle));
    rtcSetGeometryMask(part.geometry, mask);
    part.mask = mask;
    rtcCommitGeometry(part.geometry);
    part.id = static_cast<unsigned>(i);
    rtcAttachGeometryByID(scene_, part.geometry, part.id);
    ++counts_.built;
  }
  // By the thread that draws: others draw other pictures. A device with threads=1 would limit the threads of the whole process.
  committing_ = true;
  if (changed) Executor(1).run([this] { rtcJoinCommitScene(scene_); });
  RTCBounds box;
  rtcGetSceneBounds(scene_, &box);
  check(device_);
  committing_ = false;
  lower_ = {box.lower_x, box.lower_y, box.lower_z};
  upper_ = {box.upper_x, box.upper_y, box.upper_z};
  const float margin = 1e-4F * (upper_ - lower_).norm();  // of round-off, and no ray along a face lies in it
  lower_.array() -= margin;
  upper_.array() += margin;
  centre_ = 0.5F * (lower_ + upper_);
  float furthest2 = 0.0F;
  for (const auto& part : parts_)
    for (const std::vector<float>* places : {&part->position, &part->position_end})
      for (std::size_t at = 0; at < places->size(); at += 4) furthest2 = std::max(furthest2, (vector(&(*places)[at]) - centre_).squaredNorm());
  radius_ = std::sqrt(furthest2) + margin;
}

/// Of a ray and a triangle.
struct Geometry::Crossing {
  float distance = std::numeric_limits<float>::infinity();
  unsigned item = RTC_INVALID_GEOMETRY_ID;
  unsigned quadrangle = 0;
  float u = 0.0F, v = 0.0F;
};

/// The first crossings of rays. Of several at one place Embree would keep the one that its hierarchy came to last; here it is the first
/// in a fixed order, fronts before backs, so that a picture depends on no hierarchy and bodies behind a face that they share with a
/// transparent one are seen.
struct Geometry::Query {
  /// Distances that differ by less are one place, to Embree a few times as much: it compares before it divides.
  static constexpr float kOnePlace = 4.0F * std::numeric_limits<float>::epsilon();

  RTCIntersectContext context;
  std::array<Crossing, kLanes> first;

  const Geometry* geometry;

  Query(const Geometry& of, RTCIntersectContextFlags flags) : geometry(&of) {
    rtcInitIntersectContext(&context);
    context.flags = flags;
    context.filter = look_at;
  }

  /// Embree's call for every crossing up to the reach of its ray, which ends beyond all at the place of the first one.
  static void look_at(const RTCFilterFunctionNArguments* of) {
    static_assert(std::is_standard_layout_v<Query>);
    auto& query = *reinterpret_cast<Query*>(of->context);
    for (unsigned k = 0; k < of->N; ++k) {
      if (of->valid[k] != -1) continue;
      const Vec3f direction(RTCRayN_dir_x(of->ray, of->N, k), RTCRayN_dir_y(of->ray, of->N, k), RTCRayN_dir_z(of->ray, of->N, k));
      const Vec3f normal(RTCHitN_Ng_x(of->hit, of->N, k), RTCHitN_Ng_y(of->hit, of->N, k), RTCHitN_Ng_z(of->hit, of->N, k));
      const Vec3f from(RTCRayN_org_x(of->ray, of->N, k), RTCRayN_org_y(of->ray, of->N, k), RTCRayN_org_z(of->ray, of->N, k));
      float& reach = RTCRayN_tfar(of->ray, of->N, k);
      Crossing& first = query.first[k];
      Crossing found{.distance = reach,
                     .item = RTCHitN_geomID(of->hit, of->N, k), .quadrangle = RTCHitN_primID(of->hit, of->N, k),
                     .u = RTCHitN_u(of->hit, of->N, k), .v = RTCHitN_v(of->hit, of->N, k)};
      bool back = normal.dot(direction) > 0.0F;
      query.geometry->move_to_vertex(from, direction, RTCRayN_time(of->ray, of->N, k), found, back);
      if (back) found.distance *= 1.0F + kOnePlace;
      const auto order = [](const Crossing& c) { return std::tie(c.distance, c.item, c.quadrangle, c.u, c.v); };  // u, v: on its diagonal
      if (order(found) < order(first)) first = found;
      reach = first.distance * (1.0F + 2.0F * kOnePlace);
    }
  }
};

/// A crossing at a vertex becomes that of the first quadrangle there: which of them Embree looks at depends on its hierarchy, as the ray misses
/// the boxes of some by rounding.
/// @param back  whether that is a back face
void Geometry::move_to_vertex(const Vec3f& from, const Vec3f& direction, float time, Crossing& crossing, bool& back) const {
  constexpr float kNearCorner = 0.05F;  // of a side: farther off none is within rounding
  constexpr float kRounding = 4.0F * std::numeric_limits<float>::epsilon();
  const bool far_u = crossing.u > 0.5F, far_v = crossing.v > 0.5F;
  if (std::abs(crossing.u - (far_u ? 1.0F : 0.0F)) > kNearCorner || std::abs(crossing.v - (far_v ? 1.0F : 0.0F)) > kNearCorner) return;
  const Part& part = *parts_[crossing.item];
  const auto place = [&](std::uint32_t vertex) -> Vec3f {
    const Vec3f p = vector(&part.position[4 * std::size_t{vertex}]);
    return part.moving ? Vec3f(p + time * (vector(&part.position_end[4 * std::size_t{vertex}]) - p)) : p;
  };
  const std::uint32_t vertex = part.quadrangle[crossing.quadrangle][far_u ? (far_v ? 2 : 1) : (far_v ? 3 : 0)];
  const Vec3f way = place(vertex) - from;
  const float along = way.dot(direction) / direction.squaredNorm(), round = kRounding * (from.cwiseAbs().maxCoeff() + along * direction.norm());
  if ((way - along * direction).squaredNorm() > round * round) return;
  crossing.distance = along;
  crossing.quadrangle = part.first_quadrangle[vertex];
  const Quadrangle& first = part.quadrangle[crossing.quadrangle];
  // Where two corners of a triangle's quadrangle are one, it is the last.
  const std::size_t corner = first[0] == vertex ? 0 : first[1] == vertex ? 1 : first[3] == vertex ? 3 : 2;
  crossing.u = corner == 1 || corner == 2 ? 1.0F : 0.0F;
  crossing.v = corner >= 2 ? 1.0F : 0.0F;
  const Vec3f a = place(first[corner == 2 ? 2 : 0]), b = place(first[corner == 2 ? 3 : 1]), c = place(first[corner == 2 ? 1 : 3]);
  back = (b - a).cross(c - a).dot(direction) > 0.0F;
}

namespace {

/// The least distance that is surely past another.
float beyond(float distance) { return distance * (1.0F + 2e-6F) + std::numeric_limits<float>::min(); }

}  // namespace

Geometry::Crossing Geometry::crossed(const Vec3f& from, const Vec3f& direction, float time, float near_end, float far_end) const {
  Query query(*this, RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
  RTCRayHit ray{};
  ray.ray = {.org_x = from.x(), .org_y = from.y(), .org_z = from.z(), .tnear = near_end,
             .dir_x = direction.x(), .dir_y = direction.y(), .dir_z = direction.z(), .time = time,
             .tfar = far_end, .mask = 1u, .id = 0, .flags = 0};
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_, &query.context, &ray);
  return query.first[0];
}

bool Geometry::meet(const Vec3f& from, const Vec3f& direction, float time, float choice, bool exact, Hit& hit) const {
  return first_visible(crossed(from, direction, time, 0.0F), {from, direction, time, choice, exact, 0}, hit);
}

bool Geometry::leave(std::uint32_t item, const Vec3f& from, const Vec3f& direction, float time, float reach, Hit& hit) const {
  Crossing crossing = crossed(from, direction, time, 0.0F, reach);
  const Ray ray{from, direction, time, 0.0F, false, item + 1};
  while (first_visible(crossing, ray, hit)) {
    if (hit.distance >= reach) return false;
    if (hit.item == item && hit.back) return true;
    crossing = crossed(from, direction, time, beyond(hit.distance), reach);
  }
  return false;
}

Vec3f Geometry::passed_by_glass(const Vec3f& from, const Vec3f& direction, float time, float distance) const {
  Vec3f absorbed = Vec3f::Zero();
  float share = 1.0F;
  for (float at = 0.0F; at < distance;) {
    const Crossing crossing = crossed(from, direction, time, at, distance);
    if (crossing.item == RTC_INVALID_GEOMETRY_ID || crossing.distance > distance) break;
    const Medium& medium = media_[crossing.item];
    at = beyond(crossing.distance);
    if (medium.kind != InsideKind::Glass) continue;
    const Part& part = *parts_[crossing.item];
    const Quadrangle& corner = part.quadrangle[crossing.quadrangle];
    const auto place = [&](std::uint32_t vertex) { return vector(&part.position[4 * std::size_t{vertex}]); };
    const Vec3f normal = (place(corner[1]) - place(corner[0])).cross(place(corner[3]) - place(corner[0])).stableNormalized();
    const float cosine = normal.dot(direction);
    share *= 1.0F - RefractionOf<float>(std::abs(cosine), 1.0F / medium.index).reflected;
    // From where a ray leaves, on all of its way; from where it enters, not before it.
    absorbed += medium.absorption * (cosine > 0.0F ? crossing.distance : -crossing.distance);
  }
  return share * (-absorbed.cwiseMax(0.0F)).array().exp().matrix();
}

/// Of what a ray crosses from this crossing on.
bool Geometry::first_visible(Crossing crossing, const Ray& ray, Hit& hit) const {
  const auto& [from, direction, time, choice, exact, inside] = ray;
  for (int layer = 0; layer < 32 && crossing.item != RTC_INVALID_GEOMETRY_ID; ++layer) {
    const Part& part = *parts_[crossing.item];
    const Item& item = items_[crossing.item];
    const Quadrangle& quadrangle = part.quadrangle[crossing.quadrangle];
    // In the second one Embree counts from 1 down. Round-off at an edge of the first leads to none that is not there.
    const bool second = crossing.u + crossing.v > 1.0F && quadrangle[2] != quadrangle[3];
    const std::array<std::uint32_t, 3> corner = second ? std::array{quadrangle[2], quadrangle[3], quadrangle[1]}
                                                       : std::array{quadrangle[0], quadrangle[1], quadrangle[3]};
    const float u = second ? 1.0F - crossing.u : crossing.u, v = second ? 1.0F - crossing.v : crossing.v;
    const Vec3f weight(1.0F - u - v, u, v);
    std::array<Vec3f, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = vector(&part.position[4 * std::size_t{corner[k]}]);
      if (part.moving) p[k] += time * (vector(&part.position_end[4 * std::size_t{corner[k]}]) - p[k]);
    }
    hit.item = crossing.item;
    hit.distance = crossing.distance;
    hit.point = weight[0] * p[0] + weight[1] * p[1] + weight[2] * p[2];
    const Vec3f cross = (p[1] - p[0]).cross(p[2] - p[0]);
    const float twice_area = std::max(cross.norm(), 1e-30F);
    hit.face_normal = cross / twice_area;

    // Behind a back face of a closed body, or a front face from its inside, through the holes of a wireframe, past part of what is not opaque.
    float edge = INFINITY;
    for (std::size_t k = 0; item.wireframe && k < 3; ++k)
      edge = std::min(edge, weight[static_cast<Eigen::Index>(k)] * twice_area / (p[(k + 2) % 3] - p[(k + 1) % 3]).norm());
    const bool on_wire = item.wireframe && edge < wire_ * hit.distance;
    const bool back = hit.face_normal.dot(direction) > 0.0F;
    const bool from_inside = inside == crossing.item + 1;
    const bool visible = on_wire || (item.surface && (back == from_inside || item.two_sided) && choice < item.opacity);
    if (!visible) {
      crossing = crossed(from, direction, time, beyond(hit.distance));
      continue;
    }
    hit.normal = (weight[0] * part.normal[corner[0]] + weight[1] * part.normal[corner[1]] + weight[2] * part.normal[corner[2]]).normalized();
    hit.back = back;
    hit.wire = on_wire;
    if (back) {
      hit.face_normal = -hit.face_normal;
      hit.normal = -hit.normal;
    }
    // Each tangent plane at a corner pulls the point out to itself.
    hit.leave = Vec3f::Zero();
    hit.pass = hit.point;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vec3f n = back ? Vec3f(-part.normal[corner[k]]) : part.normal[corner[k]];
      hit.leave += weight[k] * (hit.point - std::min(0.0F, (hit.point - p[static_cast<std::size_t>(k)]).dot(n)) * n);
    }
    hit.bsdf = part.paint.bsdf(item, corner.data(), weight, hit.normal, on_wire);
    if (exact && item.field && !on_wire && !part.moving) refine(item, direction, hit);
    float largest = 0.0F;
    for (const Vec3f& at : p) largest = std::max(largest, at.cwiseAbs().maxCoeff());
    hit.leave += clearance(largest) * hit.face_normal;
    hit.pass -= clearance(largest) * hit.face_normal;
    // A smooth normal may look away where the triangle does not.
    if (hit.normal.dot(direction) > -0.02F) hit.normal = (hit.normal - (hit.normal.dot(direction) + 0.02F) * direction).normalized();
    return true;
  }
  return false;
}

/// Newton's method along the ray, into the body or out of it. A hit that would leave the neighbourhood of its triangle stays: at outlines the surface
/// may curve away from the ray.
void Geometry::refine(const Item& item, const Vec3f& direction, Hit& hit) const {
  const Vec3 along = direction.cast<double>();
  const Vec3 start = space_.world(hit.point.cast<double>());
  const double inward = hit.back ? -1.0 : 1.0;
  double t = 0.0;
  Vec3 gradient = Vec3::Zero();
  bool found = false;
  for (int step = 0; step < 4 && !found; ++step) {
    const Vec3 p = start + t * along;
    double value = 0.0;
    item.field(std::span(&p, 1), std::span(&value, 1), std::span(&gradient, 1));
    const double slope = gradient.dot(along);
    const double size = gradient.norm();
    if (!(size > 0.0)) return;
    if (!(inward * slope > 0.05 * size)) break;  // grazing: the normal is good, the root may be far
    const double move = -value / slope;
    t += move;
    if (std::abs(t) > item.field_reach) return;
    found = std::abs(move) < 1e-4 * item.field_reach;
  }
  const Vec3f normal = (-inward * gradient.normalized()).cast<float>();
  if (normal.dot(hit.face_normal) < 0.3F) return;
  hit.normal = normal;
  if (!found) return;
  const Vec3f p = space_.place(start + t * along).cast<float>();
  hit.distance += static_cast<float>(space_.per_metre * t);
  // Outside of triangle and surface both, so that neither shadows the other.
  const float outward = (p - hit.point).dot(hit.face_normal);
  (outward > 0.0F ? hit.leave : hit.pass) = p;
  hit.point = p;
}

bool Geometry::blocked(const Vec3f& from, const Vec3f& direction, float distance, float time) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = {.org_x = from.x(), .org_y = from.y(), .org_z = from.z(), .tnear = 0.0F,
                .dir_x = direction.x(), .dir_y = direction.y(), .dir_z = direction.z(), .time = time,
                .tfar = distance, .mask = 2u, .id = 0, .flags = 0};
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar < 0.0F;
}

namespace {

/// In Embree's layout.
RTCRay8 packet(const RayBundle& rays, Lanes distance, unsigned mask) {
  RTCRay8 to;
  const auto put = [](Lanes from, float* at) { _mm256_store_ps(at, from); };
  put(rays.from.x(), to.org_x);
  put(rays.from.y(), to.org_y);
  put(rays.from.z(), to.org_z);
  put(rays.direction.x(), to.dir_x);
  put(rays.direction.y(), to.dir_y);
  put(rays.direction.z(), to.dir_z);
  put(rays.time, to.time);
  put(Lanes{}, to.tnear);
  put(distance, to.tfar);
  std::fill_n(to.mask, kLanes, mask);
  std::fill_n(to.id, kLanes, 0u);
  std::fill_n(to.flags, kLanes, 0u);
  return to;
}

}  // namespace

/// Rays that cross the box (Kay & Kajiya 1986) and the ball of all items, and at most a few others.
LaneMask Geometry::cross_bounds(const RayBundle& rays) const {
  const auto between = [](float lower, float upper, Lanes from, Lanes direction) {
    const Lanes scale = 1.0F / direction, a = (lower - from) * scale, b = (upper - from) * scale;
    return Pair<Lanes>{smaller(a, b), larger(a, b)};
  };
  const Pair<Lanes> x = between(lower_.x(), upper_.x(), rays.from.x(), rays.direction.x());
  const Pair<Lanes> y = between(lower_.y(), upper_.y(), rays.from.y(), rays.direction.y());
  const Pair<Lanes> z = between(lower_.z(), upper_.z(), rays.from.z(), rays.direction.z());
  const Lanes enter = larger(larger(x.x, y.x), z.x), leave = smaller(smaller(x.y, y.y), z.y);
  constexpr float kRoundOff = 1.0F + 1e-5F, kRoundOffAlong = 2e-6F;
  const Vec3Lanes from_centre = rays.from - Vec3Lanes(centre_);
  const Lanes along = from_centre.dot(rays.direction), reach = radius_ + kRoundOffAlong * magnitude(along);
  const Vec3Lanes nearest = from_centre - along * rays.direction;  // to the centre, of the whole line
  const LaneMask passes = nearest.dot(nearest) > reach * reach, ahead = both(along > 0.0F, from_centre.dot(from_centre) > reach * reach);
  return both(rays.who, ~((enter > kRoundOff * leave) | (leave < 0.0F) | passes | ahead));
}

std::array<Geometry::Crossing, kLanes> Geometry::crossed(const RayBundle& rays) const {
  std::array<Crossing, kLanes> out;
  const LaneMask who = cross_bounds(rays);
  if (!any(who)) return out;
  if (!rays.together) {
    for (std::size_t k = 0; k < kLanes; ++k)
      if (who[k] != 0) out[k] = crossed(rays.from.lane(k), rays.direction.lane(k), rays.time[k], 0.0F);
    return out;
  }
  RTCRayHit8 bundle;
  bundle.ray = packet(rays, all_lanes(INFINITY), 1u);
  std::fill_n(bundle.hit.geomID, kLanes, RTC_INVALID_GEOMETRY_ID);
  Query query(*this, RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
  rtcIntersect8(reinterpret_cast<const int*>(&who), scene_, &query.context, &bundle);
  return query.first;
}

LaneMask Geometry::meet(const RayBundle& rays, Lanes choice, bool exact, std::array<Hit, kLanes>& hits) const {
  const std::array<Crossing, kLanes> crossings = crossed(rays);
  LaneMask met{};
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (rays.who[k] == 0 || crossings[k].item == RTC_INVALID_GEOMETRY_ID) continue;
    if (first_visible(crossings[k], {rays.from.lane(k), rays.direction.lane(k), rays.time[k], choice[k], exact, rays.inside[k]}, hits[k])) met[k] = -1;
  }
  return met;
}

LaneMask Geometry::blocked(const RayBundle& rays) const { return blocked(rays, all_lanes(INFINITY)); }

LaneMask Geometry::blocked(const RayBundle& rays, Lanes distance) const {
  const LaneMask who = cross_bounds(rays);
  if (!any(who)) return LaneMask{};
  if (!rays.together) {
    LaneMask out{};
    for (std::size_t k = 0; k < kLanes; ++k)
      if (who[k] != 0 && blocked(rays.from.lane(k), rays.direction.lane(k), distance[k], rays.time[k])) out[k] = -1;
    return out;
  }
  RTCRay8 bundle = packet(rays, distance, 2u);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded8(reinterpret_cast<const int*>(&who), scene_, &context, &bundle);
  return both(who, _mm256_load_ps(bundle.tfar) < 0.0F);
}

}  // namespace supple::render::path
