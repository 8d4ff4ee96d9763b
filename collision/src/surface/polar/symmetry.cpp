#include "surface/polar/symmetry.h"

#include <algorithm>
#include <cmath>

namespace supple::collision {
namespace {

using implicit::Primitive;
using implicit::ShapeKind;

constexpr double kOnLine = 1e-9;

/// Which of its own axes a primitive is the same around: -1 for all, -2 for none.
int own_axis(const Primitive& p) {
  constexpr int kAll = -1, kNone = -2;
  const Vec3 size = p.shape == ShapeKind::Ellipsoid ? Vec3(p.size.cwiseProduct(p.stretch)) : p.stretch;
  const auto around = [&](int k) { return size[(k + 1) % 3] == size[(k + 2) % 3]; };
  switch (p.shape) {
    case ShapeKind::Point:
    case ShapeKind::Ellipsoid:
      if (around(0) && around(1)) return kAll;
      for (int k = 0; k < 3; ++k) {
        if (around(k)) return k;
      }
      return kNone;
    case ShapeKind::Segment: return around(0) ? 0 : kNone;
    case ShapeKind::Disc:
    case ShapeKind::Ring: return around(2) ? 2 : kNone;
    default: return kNone;
  }
}

Pose placed(const ContactBody& body, const Primitive& p) {
  const Pose& part = body.pose[p.part];
  return {part.to_world(p.offset.position), part.orientation * p.offset.orientation};
}

/// The line through the first primitive of a body that has but one.
std::optional<CommonAxis> line_of(const ContactBody& body) {
  if (body.skeleton == nullptr) return std::nullopt;
  for (const Primitive& p : body.skeleton->primitive) {
    const int axis = own_axis(p);
    if (axis < 0) continue;
    const Pose pose = placed(body, p);
    return CommonAxis{pose.position, pose.orientation * Vec3::Unit(axis)};
  }
  return std::nullopt;
}

/// Whether a body is the same all around a line, within a tolerance [m]; of cores as seen from a distance on both sides.
bool same_around(const ContactBody& body, const CommonAxis& line, double reach) {
  const double tolerance = kOnLine * reach;
  const auto on_line = [&](const Vec3& x) { return (x - line.point).cross(line.direction).norm() <= tolerance; };
  if (body.skeleton == nullptr) {
    bool seen = false;
    for (const double side : {-1.0, 1.0}) {
      const Vec3 place = line.point + side * 4.0 * reach * line.direction;
      const std::optional<implicit::CorePoint> core = body.field.core_point(place);
      if (!core || !core->round || !on_line(core->point)) return false;
      seen = seen || (core->point - place).norm() > tolerance;
    }
    return seen;
  }
  return std::all_of(body.skeleton->primitive.begin(), body.skeleton->primitive.end(), [&](const Primitive& p) {
    const int axis = own_axis(p);
    if (axis == -2) return false;
    const Pose pose = placed(body, p);
    return on_line(pose.position) && (axis == -1 || (pose.orientation * Vec3::Unit(axis)).cross(line.direction).norm() <= kOnLine);
  });
}

}  // namespace

std::optional<CommonAxis> axis_of_symmetry(const ContactBody& a, const ContactBody& b, const Box& overlap) {
  std::optional<CommonAxis> line = line_of(a);
  if (!line) line = line_of(b);
  if (!line) return std::nullopt;
  const double reach = overlap.extent().norm() + (overlap.centre() - line->point).norm();
  if (!std::isfinite(reach) || !same_around(a, *line, reach) || !same_around(b, *line, reach)) return std::nullopt;
  return line;
}

}  // namespace supple::collision
