#include "picture/draw_list.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "picture/lighting.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

void append(const Mesh& mesh, const PictureSpace& space, DrawList& list) {
  SUPPLE_EXPECTS(mesh.normal.size() == mesh.position.size());
  const auto base = static_cast<std::uint32_t>(list.vertices.size() / 6);
  SUPPLE_EXPECTS(std::size_t{base} + mesh.vertex_count() <= std::size_t{0xffffffff});
  list.vertices.resize(list.vertices.size() + 6 * mesh.vertex_count());
  float* out = list.vertices.data() + 6 * std::size_t{base};
  bool finite = true;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i, out += 6) {
    const Vec3 p = space.place(mesh.position[i]);
    list.bounds.include(p);
    finite = finite && p.allFinite();
    for (int k = 0; k < 3; ++k) {
      out[k] = static_cast<float>(p[k]);
      out[3 + k] = static_cast<float>(mesh.normal[i][k]);
    }
  }
  SUPPLE_EXPECTS(finite);

  std::size_t at = list.indices.size();
  list.indices.resize(at + 3 * mesh.triangle_count());
  std::uint32_t largest = 0;
  for (const std::array<std::uint32_t, 3>& triangle : mesh.triangle)
    for (const std::uint32_t vertex : triangle) {
      largest = std::max(largest, vertex);
      list.indices[at++] = base + vertex;
    }
  SUPPLE_EXPECTS(largest < mesh.vertex_count());
}

/// Attributes that determine the colour at the vertices of an item.
void append_paint(const Item& item, std::vector<float>& out) {
  const Mesh& mesh = *item.mesh;
  const std::size_t first = out.size();
  out.resize(first + 3 * mesh.vertex_count(), 0.0F);
  if (item.paint.kind == PaintKind::Values) {
    const std::vector<double>* values = column(mesh, item.paint.column);
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i)
      out[first + 3 * i] = static_cast<float>(values == nullptr ? item.paint.lower : (*values)[i]);
  } else if (has_pattern(item.paint)) {
    const std::vector<Eigen::Vector3f> places = places_in_pattern(item);
    for (std::size_t i = 0; i < places.size(); ++i) std::copy_n(places[i].data(), 3, &out[first + 3 * i]);
  }
}

/// The next length of a ladder of four rungs an octave.
double rung(double length) { return std::exp2(std::ceil(4.0 * std::log2(std::max(length, 1e-6))) / 4.0); }

}  // namespace

const std::vector<double>* column(const Mesh& mesh, std::string_view name) {
  for (const Mesh::Column& c : mesh.columns)
    if (c.name == name) return &c.values;
  return nullptr;
}

bool has_pattern(const Paint& paint) {
  return paint.kind == PaintKind::Checker || paint.kind == PaintKind::Stripes || paint.kind == PaintKind::Picture;
}

std::vector<Eigen::Vector3f> places_in_pattern(const Item& item) {
  const Mesh& mesh = *item.mesh;
  const std::array rest = {column(mesh, "rest_x"), column(mesh, "rest_y"), column(mesh, "rest_z")};
  const bool has_rest = rest[0] != nullptr && rest[1] != nullptr && rest[2] != nullptr;
  const auto place = [&](std::size_t v) -> Vec3 { return has_rest ? Vec3((*rest[0])[v], (*rest[1])[v], (*rest[2])[v]) : mesh.position[v]; };
  std::vector<Eigen::Vector3f> out(mesh.vertex_count());
  if (out.empty()) return out;
  const Vec3 origin = same_in_pattern(item.paint, place(0));
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = Vec3((place(v) - origin) / item.paint.size).cast<float>();
  return out;
}

bool is_painted(const Item& item) {
  return item.paint.kind != PaintKind::Plain || item.wireframe || !item.surface;
}

RectangleEdges rectangle_edges(const AreaLight& light) {
  const Vec3 facing = light.facing.normalized();
  Vec3 across = Vec3::UnitZ().cross(facing);
  if (!(across.norm() > 1e-9)) across = Vec3::UnitX();
  across.normalize();
  return {.u = light.half_sizes.x() * across, .v = light.half_sizes.y() * facing.cross(across)};
}

void pack(std::span<const Item> items, const PictureSpace& space, DrawList& list) {
  list.vertices.clear();
  list.indices.clear();
  list.ranges.clear();
  list.bounds = Box();
  list.paint.clear();
  const bool painted = std::any_of(items.begin(), items.end(), is_painted);
  for (std::size_t i = 0; i < items.size(); ++i) {
    SUPPLE_EXPECTS(items[i].mesh != nullptr);
    const Mesh& mesh = *items[i].mesh;
    if (mesh.triangle.empty()) continue;
    const std::size_t first = list.indices.size();
    append(mesh, space, list);
    if (painted) append_paint(items[i], list.paint);
    list.ranges.push_back({.first = first, .count = list.indices.size() - first, .item = i});
  }
}

CameraMatrices camera_matrices(const Camera& camera, double aspect, const Box& bounds) {
  const auto refuse = [](const char* key, const char* expected, const std::string& found) {
    throw Error(ErrorKind::Usage, Fault{.place = {}, .key = key, .expected = expected, .found = found, .hint = {}});
  };
  const Vec3 eye = camera.from - camera.look_at;
  CameraMatrices out;
  out.distance = eye.norm();
  if (!(out.distance > 0.0 && std::isfinite(out.distance)))
    refuse("camera.from", "expected a point away from camera.look_at", "the same point");
  if (!(camera.field_of_view > 0.0 && camera.field_of_view < std::numbers::pi))
    refuse("camera.field_of_view", "expected an angle in (0, pi) [rad]", std::to_string(camera.field_of_view));

  const Vec3 back = eye / out.distance;
  Vec3 right = camera.up.cross(back);
  // Straight up or down there is no horizon to be level with: y is up in the picture then.
  if (!(right.norm() > 1e-9 * camera.up.norm())) right = Vec3::UnitY().cross(back);
  if (!(right.norm() > 1e-9)) right = Vec3::UnitX();
  right.normalize();
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.block<1, 3>(0, 0) = right.transpose();
  view.block<1, 3>(1, 0) = back.cross(right).transpose();
  view.block<1, 3>(2, 0) = back.transpose();
  view.block<3, 1>(0, 3) = -view.block<3, 3>(0, 0) * eye;

  double farthest = 12.0 * out.distance;
  if (!bounds.empty()) farthest = std::max(farthest, 1.01 * ((bounds.centre() - eye).norm() + bounds.extent().norm()));
  const double nearest = 1e-5 * out.distance;
  const double half_height = std::tan(0.5 * camera.field_of_view);
  Eigen::Matrix4d projection = Eigen::Matrix4d::Zero();
  projection(0, 0) = 1.0 / (half_height * aspect);
  projection(1, 1) = 1.0 / half_height;
  projection(2, 3) = nearest;
  projection(3, 2) = -1.0;

  out.view = view.cast<float>();
  out.view_projection = (projection * view).cast<float>();
  out.eye = eye.cast<float>();
  out.half_extent = Eigen::Vector2d(half_height * aspect, half_height).cast<float>();
  out.depth_range = Eigen::Vector2d(nearest, farthest).cast<float>();
  return out;
}

MapFit fit_map(const Box& bounds, const Vec3& direction, int size) {
  SUPPLE_EXPECTS(!bounds.empty());
  const Vec3 along = direction.normalized();
  const Vec3 across = (std::abs(along.z()) > 0.9 ? Vec3::UnitX() : Vec3::UnitZ()).cross(along).normalized();
  Mat3 axes;
  // Seen along w with u to the right, v is up: the picture is not mirrored, and front faces keep their turn.
  axes << across.transpose(), across.cross(along).transpose(), along.transpose();

  const Vec3 middle = axes * bounds.centre();
  const Vec3 reach = axes.cwiseAbs() * bounds.extent();
  Vec3 extent;
  Vec3 corner;
  for (int k = 0; k < 3; ++k) {
    // Margin of four texels: for filters at the border, and for the shift onto whole texels.
    extent[k] = rung(reach[k] * (1.0 + 4.0 / size) + 1e-6);
    const double texel = extent[k] / size;
    corner[k] = texel * std::floor((middle[k] - 0.5 * extent[k]) / texel + 0.5);
  }
  Eigen::Matrix4d to_unit = Eigen::Matrix4d::Identity();
  to_unit.block<3, 3>(0, 0) = extent.cwiseInverse().asDiagonal() * axes;
  to_unit.block<3, 1>(0, 3) = -corner.cwiseQuotient(extent);
  Eigen::Matrix4d to_clip = 2.0 * to_unit;
  to_clip.block<3, 1>(0, 3).array() -= 1.0;
  to_clip.row(3) = Eigen::RowVector4d(0, 0, 0, 1);
  Eigen::Matrix4d rotation = Eigen::Matrix4d::Identity();
  rotation.block<3, 3>(0, 0) = axes;
  return {.to_unit = to_unit.cast<float>(),
          .to_clip = to_clip.cast<float>(),
          .axes = rotation.cast<float>(),
          .extent = extent.cast<float>()};
}

AreaMap fit_area_map(const AreaLight& light, std::span<const float> vertices, int size) {
  constexpr float kWidest = 4.0F;
  const RectangleEdges edges = rectangle_edges(light);
  Eigen::Matrix3f axes;
  // Seen along the last axis with the first to the right, the second is up: front faces keep their turn.
  axes << edges.u.normalized().cast<float>().transpose(), -edges.v.normalized().cast<float>().transpose(),
      light.facing.normalized().cast<float>().transpose();
  const Eigen::Vector3f middle = light.at.cast<float>();
  const float nearest = 0.02F * static_cast<float>(light.half_sizes.minCoeff());
  Eigen::Vector2f least = Eigen::Vector2f::Constant(INFINITY), most = -least;
  float first = INFINITY, last = 0.0F;
  for (std::size_t i = 0; i + 6 <= vertices.size(); i += 6) {
    const Eigen::Vector3f q = axes * (Eigen::Vector3f(vertices[i], vertices[i + 1], vertices[i + 2]) - middle);
    if (!(q.z() > 0.0F)) continue;
    const float z = std::max(q.z(), nearest);
    const Eigen::Vector2f tangent = (q.head<2>() / z).cwiseMax(-kWidest).cwiseMin(kWidest);
    least = least.cwiseMin(tangent);
    most = most.cwiseMax(tangent);
    first = std::min(first, z);
    last = std::max(last, z);
  }
  AreaMap map;
  if (!(last > 0.0F)) return map;
  // Edges grow in steps and lie on whole texels, as in fit_map.
  for (Eigen::Index k = 0; k < 2; ++k) {
    const double extent = rung((most[k] - least[k]) * (1.0 + 4.0 / size) + 1e-6);
    const double texel = extent / size;
    map.extent[k] = static_cast<float>(extent);
    map.lower[k] = static_cast<float>(texel * std::floor((0.5 * (least[k] + most[k]) - 0.5 * extent) / texel + 0.5));
  }
  map.lower.z() = 1.02F / first;
  map.extent.z() = map.lower.z() - 0.98F / last;
  // With w the depth z: x / w and y / w run from -1 to 1 over the tangents, z / w over 1 / depth.
  Eigen::Matrix4f projection = Eigen::Matrix4f::Zero();
  for (Eigen::Index k = 0; k < 2; ++k) {
    projection(k, k) = 2.0F / map.extent[k];
    projection(k, 2) = -2.0F * map.lower[k] / map.extent[k] - 1.0F;
  }
  projection(2, 2) = 2.0F * map.lower.z() / map.extent.z() - 1.0F;
  projection(2, 3) = -2.0F / map.extent.z();
  projection(3, 2) = 1.0F;
  Eigen::Matrix4f to_light = Eigen::Matrix4f::Identity();
  to_light.block<3, 3>(0, 0) = axes;
  to_light.block<3, 1>(0, 3) = -(axes * middle);
  map.to_clip = projection * to_light;
  return map;
}

Eigen::Vector3f linear_colour(const Vec3& srgb) {
  const auto decode = [](double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); };
  return srgb.cwiseMax(0.0).cwiseMin(1.0).unaryExpr(decode).cast<float>();
}

}  // namespace supple::render
