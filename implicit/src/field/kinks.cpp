#include "supple/implicit/kinks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "field/field_index.h"

namespace supple::implicit {

namespace {

/// From the core, in its own axes.
Vec3 off_core(const Kink& kink, const Vec3& x) noexcept {
  const Vec3 y = kink.to_local * (x - kink.origin);
  if (kink.form != Kink::Form::Disc) return y - y.cwiseMax(-kink.half).cwiseMin(kink.half);
  const double rho = std::sqrt(y.x() * y.x() + y.y() * y.y());
  const double share = rho > kink.half.x() ? (rho - kink.half.x()) / rho : 0.0;
  return {share * y.x(), share * y.y(), y.z()};
}

}  // namespace

double Kink::value(const Vec3& x) const noexcept {
  if (form == Form::Plane) return to_local.row(0).transpose().dot(x - origin) - level;
  return 0.5 * (off_core(*this, x).squaredNorm() / level - level);
}

double Kink::value(const Vec3& x, Vec3& gradient) const noexcept {
  if (form == Form::Plane) {
    gradient = to_local.row(0);
    return gradient.dot(x - origin) - level;
  }
  const Vec3 v = off_core(*this, x);
  gradient = to_local.transpose() * v / level;
  return 0.5 * (v.squaredNorm() / level - level);
}

double Kink::change(const Vec3& x, double distance) const noexcept {
  Vec3 gradient;
  (void)value(x, gradient);
  // The second derivatives of a squared distance to a convex set are at most 2.
  const double bend = form == Form::Plane ? 0.0 : to_local.squaredNorm() / level;
  return distance * (gradient.norm() + 0.5 * bend * distance);
}

namespace {

/// Distances at which a kernel changes its formula; unused entries are 0. Its support is one of them.
std::array<double, 2> levels_of(const Kernel& kernel) noexcept {
  const double R = kernel.radius;
  switch (kernel.kind) {
    case KernelKind::Gascuel: return {kernel.thickness, R};
    case KernelKind::Nishimura: return {R / 3.0, R};
    case KernelKind::BlancSchlick: return {0.5 * R, R};
    default: return {0.0, R};
  }
}

/// Derivatives below this order go over a level without a jump: (1 - rho^2)^3 ends with two of them, the others with one.
int order_of(const Kernel& kernel) noexcept { return kernel.kind == KernelKind::Wyvill ? 3 : 2; }

/// Whether the line x = y = 0 of a primitive surely passes a box by.
bool clear_of_axis(const Mat3& to_local, const Box& box, const Vec3& origin) noexcept {
  if (!box.lower.allFinite() || !box.upper.allFinite()) return false;
  const Vec3 centre = to_local * (box.centre() - origin), half = 0.5 * (to_local.cwiseAbs() * box.extent());
  return centre.head<2>().squaredNorm() > half.head<2>().squaredNorm();
}

}  // namespace

bool kinks_of(const Field& field, const Box& box, std::vector<Kink>& out) {
  const Field::Index& index = field.index();
  bool complete = !index.blend.active();
  // Alone, a primitive's potential is beyond the iso value wherever the body is.
  const double farthest = index.size() == 1 && index.shape[0].view.gain == 0.0 && index.iso > 0.0 && index.iso < index.shape[0].peak
                              ? (1.0 - 1e-9) * iso_distance(index.shape[0].kernel, index.iso)
                              : std::numeric_limits<double>::infinity();
  for (const std::uint32_t id : candidates_of(index, box)) {
    const PackedShape& shape = index.shape[id];
    Kink kink;
    kink.origin = {index.primitive[id].position[0], index.primitive[id].position[1], index.primitive[id].position[2]};
    const Mat3 A = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.to_local.data());
    const auto plane = [&](const Vec3& along, double at) {
      const Vec3 normal = A.transpose() * along;  // unit after the division, as the level is then a distance
      const double length = normal.norm();
      Kink side{.form = Kink::Form::Plane, .origin = kink.origin};
      side.to_local.row(0) = normal / length;
      side.level = at / length;
      out.push_back(side);
    };
    // Where the nearest point g(t) leaves an end: g'.x w + w' |x|^2 = 0 for x from that end and widths w. A plane, or a sphere.
    const auto cap = [&](const Vec3& end, const Vec3& along, double width) {
      constexpr double kStraight = 1e-7;  // below, the sphere is a plane but for rounding
      const double growth = shape.view.taper - 1.0, steepness = along.norm();
      if (!(steepness > 0.0)) return;
      if (std::abs(growth) < kStraight) {
        plane(along, along.dot(end));
        return;
      }
      const Vec3 middle = end - 0.5 * width / growth * along;
      Kink ball{.form = Kink::Form::Offset, .origin = kink.origin + A.inverse() * middle};
      ball.to_local = A;
      ball.level = 0.5 * width / std::abs(growth) * steepness;
      out.push_back(ball);
    };
    bool levels = true;
    if (shape.foot == PackedFoot::Slab) {
      kink.form = Kink::Form::Offset;
      kink.half = {shape.half[0], shape.half[1], shape.half[2]};
      for (int k = 0; k < 3; ++k) {
        if (kink.half[k] > 0.0) {
          plane(Vec3::Unit(k), kink.half[k]);
          plane(Vec3::Unit(k), -kink.half[k]);
        }
      }
    } else if (shape.foot == PackedFoot::Disc) {
      kink.form = Kink::Form::Disc;
      kink.half = {shape.half[0], 0.0, 0.0};
      Kink edge = kink;
      edge.form = Kink::Form::Offset;
      edge.half.setZero();
      edge.level = shape.half[0];
      edge.to_local = A;
      edge.to_local.row(2).setZero();
      out.push_back(edge);
    } else if (shape.foot == PackedFoot::Scalar && shape.view.kind == ShapeKind::Segment && shape.view.gain == 0.0) {
      const double h = shape.view.size.x();
      cap(Vec3(-h, 0.0, 0.0), Vec3(2.0 * h, 0.0, 0.0), 1.0);
      cap(Vec3(h, 0.0, 0.0), Vec3(2.0 * h, 0.0, 0.0), shape.view.taper);
      levels = false;
      // Levels of the kernel lie on cones.
      const std::array<double, 2> level = levels_of(shape.kernel);
      const bool inside = std::any_of(level.begin(), level.end(), [&](double at) { return at > 0.0 && at < farthest; });
      complete = complete && index.size() == 1 && !inside;
    } else if (shape.foot == PackedFoot::Scalar && shape.view.kind == ShapeKind::Curve) {
      const BezierPoint begin = bezier(shape.view.control, 0.0), end = bezier(shape.view.control, 1.0);
      cap(begin.point, begin.first, 1.0);
      cap(end.point, end.first, shape.view.taper);
      levels = complete = false;
    } else if (shape.foot == PackedFoot::Scalar && shape.view.kind == ShapeKind::Superquadric) {
      // Powers |x|^(2 / e) have as many derivatives there as e leaves them.
      const auto [vertical, around] = shape.view.pair;
      for (int k = 0; k < 3; ++k) {
        if ((k < 2 ? around : vertical) != 1.0) plane(Vec3::Unit(k), 0.0);
      }
      levels = complete = false;
    } else if (shape.foot == PackedFoot::Scalar && shape.view.kind == ShapeKind::Directed) {
      for (int k = 0; k < 3; ++k) plane(Vec3::Unit(k), 0.0);
      levels = false;
      complete = complete && index.size() == 1;
    } else if (shape.foot == PackedFoot::Scalar && (shape.view.kind == ShapeKind::Ring || shape.view.kind == ShapeKind::Arc)) {
      if (shape.view.kind == ShapeKind::Arc) {
        // Where the nearest point is an end, and beyond the axis where it goes from one end to the other.
        const auto [cosine, sine] = shape.view.pair;
        plane(Vec3(-sine, cosine, 0.0), 0.0);
        plane(Vec3(-sine, -cosine, 0.0), 0.0);
        plane(Vec3::UnitY(), 0.0);
      }
      levels = false;
      // Levels of the kernel are tori; at the axis the nearest point jumps.
      const std::array<double, 2> level = levels_of(shape.kernel);
      const bool inside = std::any_of(level.begin(), level.end(), [&](double at) { return at > 0.0 && at < farthest; });
      complete = complete && index.size() == 1 && !inside && clear_of_axis(A, box, kink.origin);
    } else if (shape.foot == PackedFoot::Scalar &&
               (shape.view.kind == ShapeKind::Triangle || shape.view.kind == ShapeKind::Polygon)) {
      const std::span<const Vec3> corner = shape.view.control;
      for (std::size_t i = 0; i < corner.size(); ++i) {
        const std::size_t next = (i + 1) % corner.size(), last = (i + 2) % corner.size();
        const Vec3 edge = corner[next] - corner[i];
        const Vec3 across = edge.cross(edge.cross(corner[last] - corner[i]));
        plane(across, across.dot(corner[i]));
        plane(edge, edge.dot(corner[i]));
        plane(edge, edge.dot(corner[next]));
      }
      levels = false;
      complete = complete && index.size() == 1;
    } else {
      complete = false;
      levels = false;
    }
    if (!levels) continue;
    kink.to_local = A;
    kink.order = order_of(shape.kernel);
    for (const double level : levels_of(shape.kernel)) {
      if (!(level > 0.0) || level >= farthest) continue;
      kink.level = level;
      out.push_back(kink);
    }
  }
  return complete;
}

}  // namespace supple::implicit
