#include "supple/implicit/mesh_columns.h"

#include <array>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

/// Mean of value(part, vertex place) by the shares of the field at each vertex; place(part) is where a part is.
template <class Place, class Value>
std::vector<Vec3> spread(const FieldView& field, std::size_t parts, const Executor& executor, const Mesh& mesh,
                         const Place& place, const Value& value) {
  constexpr std::size_t kBatch = 256;
  std::vector<Vec3> out(mesh.vertex_count(), Vec3::Zero());
  executor.for_blocks(mesh.vertex_count(), kBatch, [&](std::size_t begin, std::size_t end) {
    thread_local FieldParts shares;
    field.evaluate_parts(std::span<const Vec3>(mesh.position).subspan(begin, end - begin), shares);
    for (std::size_t v = begin; v < end; ++v) {
      const Vec3& x = mesh.position[v];
      double sum = 0.0;
      Vec3 mean = Vec3::Zero();
      for (std::size_t i = shares.offset[v - begin]; i < shares.offset[v - begin + 1]; ++i) {
        SUPPLE_EXPECTS(shares.part[i] < parts);
        sum += shares.value[i];
        mean += shares.value[i] * value(shares.part[i], x);
      }
      if (sum > 0.0) {
        out[v] = mean / sum;
        continue;
      }
      std::size_t nearest = 0;
      for (std::size_t k = 1; k < parts; ++k)
        if ((place(k) - x).squaredNorm() < (place(nearest) - x).squaredNorm()) nearest = k;
      if (parts > 0) out[v] = value(nearest, x);
    }
  });
  return out;
}

}  // namespace

void add_rest_coordinates(const FieldView& field, std::span<const PartPlace> parts, const Vec3& origin,
                          const Executor& executor, Mesh& mesh) {
  const std::vector<Vec3> rest = spread(
      field, parts.size(), executor, mesh, [&](std::size_t k) { return parts[k].now.position; },
      [&](std::size_t k, const Vec3& x) -> Vec3 { return parts[k].rest.to_world(parts[k].now.to_body(x)) - origin; });
  constexpr std::array<const char*, 3> kNames = {"rest_x", "rest_y", "rest_z"};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Mesh::Column& column = mesh.columns.emplace_back();
    column.name = kNames[static_cast<std::size_t>(axis)];
    for (const Vec3& p : rest) column.values.push_back(p[axis]);
  }
}

void add_part_values(const FieldView& field, std::span<const Vec3> places, std::span<const double> values,
                     const std::string& name, const Executor& executor, Mesh& mesh) {
  SUPPLE_EXPECTS(places.size() == values.size());
  const std::vector<Vec3> spread_values = spread(
      field, places.size(), executor, mesh, [&](std::size_t k) { return places[k]; },
      [&](std::size_t k, const Vec3&) -> Vec3 { return Vec3(values[k], 0, 0); });
  Mesh::Column& column = mesh.columns.emplace_back();
  column.name = name;
  for (const Vec3& v : spread_values) column.values.push_back(v.x());
}

void add_speed(const FieldView& field, std::span<const PartMotion> parts, const Executor& executor, Mesh& mesh) {
  const std::vector<Vec3> velocity = spread(
      field, parts.size(), executor, mesh, [&](std::size_t k) { return parts[k].centre; },
      [&](std::size_t k, const Vec3& x) -> Vec3 { return parts[k].velocity + parts[k].angular_velocity.cross(x - parts[k].centre); });
  Mesh::Column& column = mesh.columns.emplace_back();
  column.name = "speed";
  for (const Vec3& v : velocity) column.values.push_back(v.norm());
}

}  // namespace supple::implicit
