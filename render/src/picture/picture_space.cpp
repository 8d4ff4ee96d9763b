#include "picture/picture_space.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"

namespace supple::render {
namespace {

/// Nearest and largest distance from a point to a box.
struct Reach {
  double nearest, farthest;
};
Reach reach_of(const Box& box, const Vec3& from) {
  const Vec3 below = box.lower - from, above = from - box.upper;
  return {.nearest = below.cwiseMax(above).cwiseMax(0.0).norm(), .farthest = below.cwiseAbs().cwiseMax(above.cwiseAbs()).norm()};
}

/// How far off a camera looks.
double seen_distance(const Camera& camera, std::span<const Item> items) {
  constexpr double kPast = 4.0, kShort = 0.5;  // of the last item, of the first one
  const double distance = (camera.from - camera.look_at).norm();
  if (!(distance > 0.0 && std::isfinite(distance)))
    throw Error(ErrorKind::Usage, Fault{.place = {}, .key = "camera.from", .expected = "expected a point away from camera.look_at",
                                        .found = "the same point", .hint = {}});
  Box box;
  for (const Item& item : items) {
    SUPPLE_EXPECTS(item.mesh != nullptr);
    for (const Vec3& p : item.mesh->position) box.include(p);
  }
  if (box.empty()) return distance;
  const Reach reach = reach_of(box, camera.from);
  // Where all items are at the eye, there is no distance.
  return reach.farthest > 0.0 ? std::clamp(distance, kShort * reach.nearest, kPast * reach.farthest) : distance;
}

}  // namespace

LocalView localised(const View& view, std::span<const Item> items) {
  const Camera& camera = view.camera;
  const double distance = seen_distance(camera, items), given = (camera.from - camera.look_at).norm();
  const bool unchanged = distance == given;
  LocalView out{.space = {}, .view = view, .pattern_origin = Vec3::Zero()};
  out.space = {unchanged ? camera.look_at : Vec3(camera.from + distance / given * (camera.look_at - camera.from)),
               std::exp2(-std::round(std::log2(distance)))};
  const PictureSpace& space = out.space;
  View& local = out.view;
  local.camera.from = space.place(camera.from);
  local.camera.look_at = Vec3::Zero();
  local.camera.aperture = space.per_metre * camera.aperture;
  local.camera.focus = space.per_metre * (camera.focus > 0.0 ? camera.focus : given);
  if (local.ground) {
    local.ground->height = space.per_metre * (view.ground->height - space.origin.z());
    local.ground->paint.size = space.per_metre * view.ground->paint.size;
    out.pattern_origin = space.place(same_in_pattern(view.ground->paint, space.origin, true));
  }
  for (AreaLight& light : local.area_lights) {
    light.at = space.place(light.at);
    light.half_sizes *= space.per_metre;
  }
  return out;
}

Vec3 same_in_pattern(const Paint& paint, const Vec3& place, bool on_ground) {
  const auto whole = [](double length, double period) { return period * std::round(length / period); };
  const double pair = 2.0 * paint.size;  // of two colours
  switch (paint.kind) {
    case PaintKind::Checker: return place.unaryExpr([&](double x) { return whole(x, pair); });
    case PaintKind::Stripes: {
      Vec3 axis = paint.axis.normalized();
      if (on_ground) axis.z() = 0.0;
      const double along = place.dot(axis), squared = axis.squaredNorm();
      if (!(squared > 0.0)) return place;
      return place - (along - whole(along, pair)) / squared * axis;  // across them all places look the same
    }
    case PaintKind::Picture: {
      // Its width over its height is a ratio of pixels: after so many of its widths it begins anew both across and upward.
      const double period = paint.size * paint.picture->height;
      return place.unaryExpr([&](double x) { return whole(x, period); });
    }
    case PaintKind::Plain:
    case PaintKind::Values:
    case PaintKind::Normals: break;
  }
  return Vec3::Zero();
}

}  // namespace supple::render
