#include "fit_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "supple/render/renderer.h"

namespace supple::tool {
namespace {

/// Means of the normals of the triangles around, by their areas.
void add_normals(Mesh& mesh) {
  mesh.normal.assign(mesh.position.size(), Vec3::Zero());
  for (const auto& t : mesh.triangle) {
    const Vec3 across = (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]);
    for (const std::uint32_t corner : t) mesh.normal[corner] += across;
  }
  for (Vec3& n : mesh.normal) n = n.norm() > 0.0 ? n.normalized() : Vec3(Vec3::UnitZ());
}

}  // namespace

void draw_fit(const fit::FittedObject& object, double error, const std::filesystem::path& file) {
  std::array<Mesh, 2> mesh{object.data, object.surface};
  Box box;
  for (const Vec3& p : mesh[0].position) box.include(p);
  Eigen::Index shortest = 0;
  box.extent().minCoeff(&shortest);
  const Vec3 toward = Vec3::Unit(shortest), up = shortest == 2 ? Vec3::UnitY() : Vec3::UnitZ(), right = up.cross(toward);
  const double width = std::abs(right.dot(box.extent())), height = std::abs(up.dot(box.extent()));
  constexpr double kGap = 0.1, kFieldOfView = 0.3, kShape = 16.0 / 9.0, kRoom = 1.1;
  const double shift = 0.5 * (1.0 + kGap) * width;
  std::array<render::Item, 2> item;
  for (std::size_t k = 0; k < mesh.size(); ++k) {
    add_normals(mesh[k]);
    for (Vec3& p : mesh[k].position) p += (k == 0 ? -shift : shift) * right - box.centre();
    item[k].mesh = &mesh[k];
    item[k].paint.kind = render::PaintKind::Values;
    item[k].paint.column = "distance";
    item[k].paint.upper = error * object.report.diagonal;
  }
  const double across = kRoom * std::max(height, (2.0 + kGap) * width / kShape);
  render::View view;
  view.camera.from = (0.5 * across / std::tan(0.5 * kFieldOfView) + 0.5 * box.extent()[shortest]) * toward;
  view.camera.up = up;
  view.camera.field_of_view = kFieldOfView;
  view.light.direction = -toward - 0.7 * up + 0.4 * right;
  render::RenderSettings settings;
  settings.width = 1280;
  settings.height = 720;
  render::write_png(file, render::make_renderer(settings)->render(view, item));
}

}  // namespace supple::tool
