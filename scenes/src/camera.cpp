#include "camera.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace supple::scenes {
namespace {

using Row = Eigen::Matrix<double, 7, 1>;

Row row_of(const CameraKeyDesc& key) {
  Row row;
  row << key.from, key.look_at, key.field_of_view;
  return row;
}

Row interpolate(const std::vector<CameraKeyDesc>& keys, double time) {
  if (time <= keys.front().time) return row_of(keys.front());
  if (time >= keys.back().time) return row_of(keys.back());
  std::size_t k = 0;
  while (keys[k + 1].time <= time) ++k;
  const auto slope = [&keys](std::size_t i) -> Row {
    if (i == 0 || i + 1 == keys.size()) return Row::Zero();
    return (row_of(keys[i + 1]) - row_of(keys[i - 1])) / (keys[i + 1].time - keys[i - 1].time);
  };
  const double width = keys[k + 1].time - keys[k].time;
  const double t = (time - keys[k].time) / width, t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * row_of(keys[k]) + (t3 - 2 * t2 + t) * width * slope(k) +
         (3 * t2 - 2 * t3) * row_of(keys[k + 1]) + (t3 - t2) * width * slope(k + 1);
}

}  // namespace

std::span<const CameraDesc> cameras_of(const Scene& scene) {
  if (scene.cameras.empty()) return {&scene.camera, 1};
  return scene.cameras;
}

render::Camera camera_at(const CameraDesc& desc, double time, double duration) {
  render::Camera camera{.from = desc.from, .look_at = desc.look_at, .up = desc.up, .field_of_view = desc.field_of_view,
                        .aperture = desc.aperture, .focus = desc.focus.value_or(0.0)};
  if (!desc.keys.empty()) {
    const Row row = interpolate(desc.keys, time);
    camera.from = row.head<3>();
    camera.look_at = row.segment<3>(3);
    camera.field_of_view = std::clamp(row[6], 0.017, 3.0);
  }
  if (desc.turntable != 0.0 && duration > 0.0) {
    const Eigen::AngleAxisd turn(desc.turntable * time / duration, desc.up.normalized());
    camera.from = camera.look_at + turn * (camera.from - camera.look_at);
  }
  return camera;
}

bool may_show(const render::Camera& camera, double aspect, const Vec3& light, double softness, const Box& box) {
  if (box.empty()) return false;
  const Vec3 ahead = (camera.look_at - camera.from).normalized();
  Vec3 right = ahead.cross(camera.up);
  if (!(right.norm() > 1e-9)) return true;
  right.normalize();
  const Vec3 up = right.cross(ahead);
  const double half_height = std::tan(0.5 * camera.field_of_view);
  const double half_width = aspect * half_height;
  // Normals of the pyramid's sides, pointing inward, and of the plane through the camera.
  const std::array<Vec3, 5> inward = {ahead, half_width * ahead + right, half_width * ahead - right, half_height * ahead + up,
                                      half_height * ahead - up};
  const Vec3 travels = light.normalized();
  for (const Vec3& side : inward) {
    const Vec3 n = side.normalized();
    const double nearest = n.dot(box.centre() - camera.from) + 0.5 * n.cwiseAbs().dot(box.extent());
    // Rays of a soft sun leave its direction by up to its radius; those that go inward reach the picture somewhere.
    if (nearest < -camera.aperture && n.dot(travels) <= -std::sin(softness)) return false;
  }
  return true;
}

double cell_for(double error, double pixel, double distance, double radius) {
  return std::sqrt(8.0 * error * pixel * distance * radius);
}

}  // namespace supple::scenes
