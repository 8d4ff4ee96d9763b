#include "output/pictures/camera.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/error.h"

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
  const auto next = std::upper_bound(keys.begin(), keys.end(), time, [](double t, const CameraKeyDesc& key) { return t < key.time; });
  const auto k = static_cast<std::size_t>(next - keys.begin()) - 1;
  const auto slope = [&keys](std::size_t i) -> Row {
    if (i == 0 || i + 1 == keys.size()) return Row::Zero();
    return (row_of(keys[i + 1]) - row_of(keys[i - 1])) / (keys[i + 1].time - keys[i - 1].time);
  };
  const double width = keys[k + 1].time - keys[k].time;
  const double t = (time - keys[k].time) / width, t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * row_of(keys[k]) + (t3 - 2 * t2 + t) * width * slope(k) +
         (3 * t2 - 2 * t3) * row_of(keys[k + 1]) + (t3 - t2) * width * slope(k + 1);
}

/// Distance before `middle` in the direction `back` at which the middle `share` of a picture holds a box.
double distance_to_see(const Box& box, const Vec3& middle, const Vec3& back, const CameraDesc& desc, double aspect, double share) {
  Vec3 right = desc.up.cross(back);
  if (!(right.norm() > 1e-9 * desc.up.norm())) right = back.unitOrthogonal();
  right.normalize();
  const Vec3 up = back.cross(right);
  const double half_height = share * std::tan(0.5 * desc.field_of_view), half_width = aspect * half_height;
  double distance = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3 x;
    for (int k = 0; k < 3; ++k) x[k] = ((corner >> k & 1) != 0 ? box.upper : box.lower)[k] - middle[k];
    distance = std::max(distance, x.dot(back) + std::max(std::abs(x.dot(right)) / half_width, std::abs(x.dot(up)) / half_height));
  }
  return distance;
}

}  // namespace

std::span<const CameraDesc> cameras_of(const Scene& scene) {
  if (scene.cameras.empty()) return {&scene.camera, 1};
  return scene.cameras;
}

double aspect_of(const Scene& scene) {
  const std::vector<int> size = scene.output.images ? scene.output.images->size : ImagesDesc{}.size;
  return static_cast<double>(size.at(0)) / size.at(1);
}

bool is_open(const CameraDesc& desc) { return desc.keys.empty() && !(desc.from && desc.look_at); }

std::vector<CameraDesc> placed_cameras(const Scene& scene, const Box& seen) {
  constexpr double kShare = 0.8;
  const Vec3 usual(0.4, -2.6, 1.4);
  const double aspect = aspect_of(scene);
  const std::span<const CameraDesc> all = cameras_of(scene);
  std::vector<CameraDesc> cameras(all.begin(), all.end());
  for (CameraDesc& camera : cameras) {
    if (!is_open(camera)) continue;
    if (!camera.look_at) camera.look_at = seen.empty() ? Vec3(Vec3::Zero()) : seen.centre();
    if (!camera.from) {
      const Vec3 back = usual.normalized();
      const double distance = seen.empty() ? usual.norm() : distance_to_see(seen, *camera.look_at, back, camera, aspect, kShare);
      camera.from = *camera.look_at + distance * back;
    }
    if (*camera.from == *camera.look_at) camera.look_at = *camera.from - usual;
  }
  return cameras;
}

render::Camera camera_at(const CameraDesc& desc, double time, double duration) {
  SUPPLE_EXPECTS(!is_open(desc));
  render::Camera camera{.up = desc.up, .field_of_view = desc.field_of_view, .aperture = desc.aperture, .focus = desc.focus.value_or(0.0)};
  if (desc.keys.empty()) {
    camera.from = *desc.from;
    camera.look_at = *desc.look_at;
  } else {
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
