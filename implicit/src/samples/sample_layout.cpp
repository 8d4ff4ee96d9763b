// Where the seeds of a skeleton start and which way they go. A rounded slab (point, segment, rectangle, box) is swept
// by its faces, quarter cylinders along its edges and the octants of a sphere at its corners (Steiner's formula), so
// the areas of a lone primitive's samples sum to its surface exactly.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "field/ray_box.h"
#include "skeleton/shapes.h"
#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/implicit/surface_samples.h"

namespace supple::implicit {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// Directions of one sphere that are tested for a box.
constexpr double kMostNear = 1 << 18;

/// Smallest multiple of `step` that is at least x and at least `least`.
int count_for(double x, int step, int least) {
  const double steps = std::ceil(std::max(x, static_cast<double>(least)) / step);
  SUPPLE_EXPECTS(steps < 1e8);
  return step * static_cast<int>(steps);
}

/// The concentric map of the square [-1, 1]^2 to the unit disc, equal-area (Shirley & Chiu 1997).
Eigen::Vector2d concentric(double a, double b) {
  double r = a;
  double angle = 0.0;
  if (std::abs(a) >= std::abs(b)) {
    if (a != 0.0) angle = kPi / 4.0 * (b / a);
  } else {
    r = b;
    angle = kPi / 2.0 - kPi / 4.0 * (a / b);
  }
  const auto [sin, cos] = math::sin_cos(angle);
  return {r * cos, r * sin};
}

/// The direction of cell (i, j) of m x m on the half sphere of one side of z: the concentric map to a disc and Lambert's
/// equal-area map of that to the half sphere.
Vec3 direction_of(double i, double j, int m, double side) {
  const Eigen::Vector2d d = concentric((2.0 * i + 1.0) / m - 1.0, (2.0 * j + 1.0) / m - 1.0);
  const double r2 = d.squaredNorm();
  const double lift = std::sqrt(2.0 - r2);
  return Vec3(d.x() * lift, d.y() * lift, side * (1.0 - r2)).normalized();
}

/// 2 m^2 directions of equal solid angle, m even, mirror-symmetric in x, y, z, none in a coordinate plane.
template <class Use>
void for_sphere(int m, const Use& use) {
  for (const double side : {1.0, -1.0}) {
    for (int j = 0; j < m; ++j) {
      for (int i = 0; i < m; ++i) use(direction_of(i, j, m, side));
    }
  }
}

/// A cone of directions around `axis`, all of them where the sine of its half angle is 1 or more.
struct Cone {
  Vec3 axis = Vec3::UnitX();
  double half_angle = kPi;
  /// Directions from a ball of radius `slack` around the origin towards a ball.
  static Cone towards(const Vec3& centre, double radius, double slack) {
    const double distance = centre.norm(), sine = (radius + slack) / distance;
    if (!(sine < 1.0)) return {};
    return {centre / distance, math::atan2(sine, std::sqrt(1.0 - sine * sine))};
  }
};

/// Those of the directions that lie in a cone, and a few more, by halving blocks of cells.
template <class Use>
void for_sphere(int m, const Cone& cone, const Use& use) {
  constexpr double kStretch = 3.0;  // of the map from the square to the half sphere, at most
  const auto visit = [&](const auto& self, double side, int i, int j, int width) -> void {
    if (i >= m || j >= m) return;
    if (width == 1) {
      use(direction_of(i, j, m, side));
      return;
    }
    const double middle = 0.5 * (width - 1);
    const Vec3 u = direction_of(std::min(i + middle, m - 1.0), std::min(j + middle, m - 1.0), m, side);
    const double off = math::atan2(u.cross(cone.axis).norm(), u.dot(cone.axis));
    if (off > cone.half_angle + kStretch * std::numbers::sqrt2 * width / m) return;
    const int half = width / 2;
    for (const int dj : {0, half}) {
      for (const int di : {0, half}) self(self, side, i + di, j + dj, half);
    }
  };
  int width = 1;
  while (width < m) width *= 2;
  for (const double side : {1.0, -1.0}) visit(visit, side, 0, 0, width);
}

class LayoutBuilder {
 public:
  /// @param spacing  of each primitive, or one for all   @param near  keeps the seeds whose rays meet it; null: all   @param parts  world poses, with `near`
  LayoutBuilder(const Skeleton& skeleton, std::span<const double> spacing, std::span<const Pose> parts, const Box* near, SampleLayout& out)
      : skeleton_(skeleton), asked_(spacing), parts_(parts), near_(near), layout_(out) {}

  /// @return number of seeds tested
  std::size_t build() {
    layout_.clear();
    for (std::size_t i = 0; i < skeleton_.primitive.size(); ++i) {
      primitive_ = &skeleton_.primitive[i];
      id_ = static_cast<std::uint32_t>(i);
      if (near_ != nullptr && !find_near()) continue;
      const Kernel& kernel = primitive_->kernel;
      const double peak = evaluate(kernel, 0.0).value;
      rho_ = skeleton_.iso < peak ? iso_distance(kernel, skeleton_.iso) : 0.5 * kernel.radius;
      const Vec3& size = primitive_->size;
      spacing_ = asked_[asked_.size() == 1 ? 0 : i] / primitive_->stretch.maxCoeff();
      view_ = view_of(*primitive_);
      switch (primitive_->shape) {
        case ShapeKind::Point: slab(Vec3::Zero()); break;
        case ShapeKind::Segment:
          if (primitive_->taper == 1.0) {
            slab({size.x(), 0.0, 0.0});
          } else {
            const std::array<Vec3, 2> ends{Vec3(-size.x(), 0.0, 0.0), Vec3(size.x(), 0.0, 0.0)};
            curve(ends);
          }
          break;
        case ShapeKind::Rectangle: slab({size.x(), size.y(), 0.0}); break;
        case ShapeKind::Box: slab(size); break;
        case ShapeKind::Disc: disc(size.x()); break;
        case ShapeKind::Ellipsoid:
        case ShapeKind::Superquadric:
        case ShapeKind::Directed: star(); break;
        case ShapeKind::Triangle:
        case ShapeKind::Polygon: polygon(primitive_->control); break;
        case ShapeKind::Curve: curve(primitive_->control); break;
        case ShapeKind::Ring: arc(size.x(), kPi); break;
        case ShapeKind::Arc: arc(size.x(), size.y()); break;
      }
    }
    return seen_;
  }

 private:
  /// The ball around the box in the frame of the unstretched primitive. @return whether the support reaches it
  [[nodiscard]] bool find_near() {
    const Vec3& stretch = primitive_->stretch;
    const Vec3 centre = primitive_->offset.to_body(parts_[primitive_->part].to_body(near_->centre()));
    const double radius = 0.5 * near_->extent().norm();
    near_centre_ = centre.cwiseQuotient(stretch);
    near_radius_ = radius / stretch.minCoeff();
    const Box support = support_box(*primitive_);
    return !support.lower.allFinite() || !support.upper.allFinite() || support.inflated(radius).contains(centre);
  }

  /// Directions from points at most `slack` off the origin that may meet the ball; all without one.
  [[nodiscard]] Cone near_cone(double slack) const {
    return near_ == nullptr ? Cone{} : Cone::towards(near_centre_, near_radius_, slack);
  }
  template <class Use>
  void for_directions(int m, double slack, const Use& use) const {
    if (near_ == nullptr) {
      for_sphere(m, use);
    } else {
      for_sphere(m, near_cone(slack), use);
    }
  }

  /// The cells of n along [-half, half] of an axis that the ball covers: [first, second).
  [[nodiscard]] std::pair<int, int> near_cells(int axis, double half, int n) const {
    if (near_ == nullptr) return {0, n};
    const auto cell = [&](double x) { return std::clamp(0.5 * (x / half + 1.0) * n, 0.0, static_cast<double>(n)); };
    return {static_cast<int>(cell(near_centre_[axis] - near_radius_)),
            std::min(n, static_cast<int>(cell(near_centre_[axis] + near_radius_)) + 1)};
  }

  /// Whether the stretch [0, reach] of a ray in the part's frame meets the box.
  [[nodiscard]] bool meets_near(const Vec3& foot, const Vec3& direction, double reach) const {
    const Pose& pose = parts_[primitive_->part];
    return ray_meets(*near_, pose.to_world(foot), pose.orientation * direction, reach);
  }

  /// A seed of the unstretched shape.
  void add(const Vec3& foot, const Vec3& direction, double reach, const Vec3& spread) {
    const Vec3& stretch = primitive_->stretch;
    if (stretch == Vec3::Ones()) {
      push(foot, direction, reach, spread);
      return;
    }
    // A ray's volume element (a + b t + c t^2) dt grows by det S, and t by |S u|.
    const Vec3 image = stretch.cwiseProduct(direction);
    const double l = image.norm();
    push(stretch.cwiseProduct(foot), image / l, reach * l,
         stretch.prod() / l * Vec3(spread.x(), spread.y() / l, spread.z() / (l * l)));
  }

  void push(const Vec3& foot, const Vec3& direction, double reach, const Vec3& spread) {
    ++seen_;
    const Vec3 from = primitive_->offset.to_world(foot);
    const Vec3 along = (primitive_->offset.orientation * direction).normalized();
    if (near_ != nullptr && !meets_near(from, along, reach)) return;
    layout_.primitive.push_back(id_);
    layout_.part.push_back(primitive_->part);
    layout_.foot.push_back(from);
    layout_.direction.push_back(along);
    layout_.reach.push_back(reach);
    layout_.spread.push_back(spread);
  }

  /// Cells of an m x m grid over a hemisphere that are at most spacing_^2 large on a sphere of radius r.
  [[nodiscard]] int sphere_count(double r, const Cone& cone = {}) const {
    double count = std::sqrt(2.0 * kPi) * r / spacing_;
    // In a box near the centre of a far larger sphere the seeds of all of it would meet: fewer stand for them.
    if (near_ != nullptr) count = std::min(count, std::sqrt(kMostNear / (1.0 - math::sin_cos(cone.half_angle).cos)));
    return count_for(count, 2, 4);
  }

  void slab(const Vec3& half) {
    const double R = primitive_->kernel.radius;
    const int m = sphere_count(rho_, near_cone(half.norm()));
    for_directions(m, half.norm(), [&](const Vec3& u) {
      const Vec3 corner(std::copysign(half.x(), u.x()), std::copysign(half.y(), u.y()), std::copysign(half.z(), u.z()));
      add(corner, u, R, {0.0, 0.0, 2.0 * kPi / (static_cast<double>(m) * m)});
    });
    for (int k = 0; k < 3; ++k) {  // edges along axis k
      if (!(half[k] > 0.0)) continue;
      const int i = (k + 1) % 3;
      const int j = (k + 2) % 3;
      const int turns = count_for(2.0 * kPi * rho_ / spacing_, 4, 8);
      const int cells = count_for(2.0 * half[k] / spacing_, 1, 1);
      const auto [first, last] = near_cells(k, half[k], cells);
      for (int c = first; c < last; ++c) {
        for (int t = 0; t < turns; ++t) {
          const auto [sin, cos] = math::sin_cos((2.0 * t + 1.0) * kPi / turns);
          Vec3 foot, u = Vec3::Zero();
          foot[k] = half[k] * ((2.0 * c + 1.0) / cells - 1.0);
          foot[i] = std::copysign(half[i], cos);
          foot[j] = std::copysign(half[j], sin);
          u[i] = cos;
          u[j] = sin;
          add(foot, u, R, {0.0, 2.0 * half[k] / cells * (2.0 * kPi / turns), 0.0});
        }
      }
    }
    for (int k = 0; k < 3; ++k) {  // faces across axis k
      const int i = (k + 1) % 3;
      const int j = (k + 2) % 3;
      if (!(half[i] > 0.0 && half[j] > 0.0)) continue;
      const int columns = count_for(2.0 * half[i] / spacing_, 1, 1);
      const int rows = count_for(2.0 * half[j] / spacing_, 1, 1);
      const auto [first_column, last_column] = near_cells(i, half[i], columns);
      const auto [first_row, last_row] = near_cells(j, half[j], rows);
      for (const double side : {1.0, -1.0}) {
        for (int r = first_row; r < last_row; ++r) {
          for (int c = first_column; c < last_column; ++c) {
            Vec3 foot;
            foot[k] = side * half[k];
            foot[i] = half[i] * ((2.0 * c + 1.0) / columns - 1.0);
            foot[j] = half[j] * ((2.0 * r + 1.0) / rows - 1.0);
            add(foot, side * Vec3::Unit(k), R, {4.0 * half[i] * half[j] / (columns * rows), 0.0, 0.0});
          }
        }
      }
    }
  }

  void disc(double r) {
    const double R = primitive_->kernel.radius;
    const int m = count_for(std::sqrt(kPi) * r / spacing_, 2, 2);
    for (const double side : {1.0, -1.0}) {
      for (int j = 0; j < m; ++j) {
        for (int i = 0; i < m; ++i) {
          const Eigen::Vector2d d = r * concentric((2.0 * i + 1.0) / m - 1.0, (2.0 * j + 1.0) / m - 1.0);
          add({d.x(), d.y(), 0.0}, {0.0, 0.0, side}, R, {kPi * r * r / (static_cast<double>(m) * m), 0.0, 0.0});
        }
      }
    }
    // The edge of a disc sweeps half a torus: (r + rho cos latitude) rho d(latitude) d(turn).
    const int turns = count_for(2.0 * kPi * (r + rho_) / spacing_, 4, 8);
    const int latitudes = count_for(kPi * rho_ / spacing_, 2, 4);
    for (int l = 0; l < latitudes; ++l) {
      const double width = kPi / latitudes;
      const double from = -kPi / 2.0 + width * l;
      const auto [sin_l, cos_l] = math::sin_cos(from + 0.5 * width);
      const double belt = math::sin_cos(from + width).sin - math::sin_cos(from).sin;
      for (int t = 0; t < turns; ++t) {
        const auto [sin, cos] = math::sin_cos((2.0 * t + 1.0) * kPi / turns);
        const double turn = 2.0 * kPi / turns;
        add({r * cos, r * sin, 0.0}, {cos_l * cos, cos_l * sin, sin_l}, R, {0.0, r * width * turn, belt * turn});
      }
    }
  }

  /// Rays from the centre of star-shaped primitives, with the solid angles of an ellipsoid with the same semi-axes.
  void star() {
    const double R = primitive_->kernel.radius;
    Vec3 size = primitive_->size;
    if (primitive_->shape == ShapeKind::Directed) size = 0.5 * (size + primitive_->control[0]);
    const Cone cone = near_ == nullptr ? Cone{} : Cone::towards(near_centre_.cwiseQuotient(size), near_radius_ / size.minCoeff(), 0.0);
    const int m = sphere_count(rho_ / R * size.maxCoeff(), cone);
    const auto use = [&](const Vec3& s) {
      // x = D s maps solid angles by abc / |D s|^3.
      const Vec3 x = size.cwiseProduct(s);
      const double length = x.norm();
      const double reach = length * R / std::sqrt(foot(view_, x).q);  // u is homogeneous of degree one
      add(Vec3::Zero(), x / length, reach, {0.0, 0.0, 2.0 * kPi / (static_cast<double>(m) * m) * size.prod() / (length * length * length)});
    };
    if (near_ == nullptr) {
      for_sphere(m, use);
    } else {
      for_sphere(m, cone, use);
    }
  }

  /// Two unit vectors that complete z to a right-handed frame.
  static Mat3 frame_of(const Vec3& z) {
    Eigen::Index least;
    z.cwiseAbs().minCoeff(&least);
    Mat3 frame;
    frame.col(2) = z.normalized();
    frame.col(0) = Vec3::Unit(least).cross(frame.col(2)).normalized();
    frame.col(1) = frame.col(2).cross(frame.col(0));
    return frame;
  }

  /// The half sphere around `outward` at the end of a curve.
  void cap(const Vec3& end, const Vec3& outward, double reach) {
    const Mat3 frame = frame_of(outward);
    const int m = sphere_count(rho_ * reach / primitive_->kernel.radius);
    for_sphere(m, [&](const Vec3& u) {
      if (u.z() > 0.0) add(end, frame * u, reach, {0.0, 0.0, 2.0 * kPi / (static_cast<double>(m) * m)});
    });
  }

  /// The tube of radius rho around a piece of a curve of length l at `point`: (1 - rho k.u) l rho d(turn), k the curvature
  /// vector and u the direction.
  void belt(const Vec3& point, const Vec3& tangent, const Vec3& curvature, double length, double reach) {
    const Mat3 frame = frame_of(tangent);
    const int turns = count_for(2.0 * kPi * rho_ * reach / primitive_->kernel.radius / spacing_, 4, 8);
    const double turn = 2.0 * kPi / turns;
    for (int i = 0; i < turns; ++i) {
      const auto [sin, cos] = math::sin_cos((i + 0.5) * turn);
      const Vec3 u = frame * Vec3(cos, sin, 0.0);
      add(point, u, reach, {0.0, length * turn, -length * turn * curvature.dot(u)});
    }
  }

  void curve(std::span<const Vec3> control) {
    const double R = primitive_->kernel.radius;
    const double widest = std::max(1.0, primitive_->taper);
    double length = 0.0;
    for (std::size_t i = 1; i < control.size(); ++i) length += (control[i] - control[i - 1]).norm();
    const int cells = count_for(length / spacing_, 1, 4);
    for (int i = 0; i < cells; ++i) {
      const double t = (i + 0.5) / cells;
      const BezierPoint p = bezier(control, t);
      const double speed = p.first.norm();
      if (!(speed > 0.0)) continue;
      const Vec3 tangent = p.first / speed;
      const Vec3 curvature = (p.second - p.second.dot(tangent) * tangent) / (speed * speed);
      belt(p.point, tangent, curvature, speed / cells, R * widest);
    }
    cap(control.front(), -end_tangent(control, true), R * widest);
    cap(control.back(), end_tangent(control, false), R * widest);
  }

  /// Direction of a curve at an end; where control points coincide, towards the next that differs.
  static Vec3 end_tangent(std::span<const Vec3> control, bool front) {
    const std::size_t n = control.size();
    for (std::size_t i = 1; i < n; ++i) {
      const Vec3 d = front ? Vec3(control[i] - control[0]) : Vec3(control[n - 1] - control[n - 1 - i]);
      if (d.norm() > 0.0) return d.normalized();
    }
    return Vec3::UnitX();
  }

  void arc(double r, double half_angle) {
    const double R = primitive_->kernel.radius;
    const int cells = count_for(2.0 * half_angle * (r + rho_) / spacing_, 1, 8);
    for (int i = 0; i < cells; ++i) {
      const auto [sin, cos] = math::sin_cos(half_angle * ((2.0 * i + 1.0) / cells - 1.0));
      belt({r * cos, r * sin, 0.0}, {-sin, cos, 0.0}, Vec3(-cos, -sin, 0.0) / r, 2.0 * half_angle * r / cells, R);
    }
    if (primitive_->shape == ShapeKind::Ring) return;
    const auto [sin, cos] = math::sin_cos(half_angle);
    cap({r * cos, r * sin, 0.0}, {-sin, cos, 0.0}, R);
    cap({r * cos, -r * sin, 0.0}, {-sin, -cos, 0.0}, R);
  }

  void polygon(std::span<const Vec3> corner) {
    const double R = primitive_->kernel.radius;
    const std::size_t n = corner.size();
    Vec3 area = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < n; ++i) area += (corner[i] - corner[0]).cross(corner[i + 1] - corner[0]);
    const Vec3 normal = area.normalized();
    for (std::size_t i = 1; i + 1 < n; ++i) {  // both faces of the fan's triangles, each in k^2 alike
      const Vec3 a = corner[i] - corner[0], b = corner[i + 1] - corner[0];
      const int k = count_for(std::max({a.norm(), b.norm(), (a - b).norm()}) / (1.5 * spacing_), 1, 1);
      const double share = 0.5 * a.cross(b).dot(normal) / (k * k);
      for (int p = 0; p < k; ++p) {
        for (int q = 0; p + q < k; ++q) {
          for (const double third : {1.0 / 3.0, 2.0 / 3.0}) {
            if (third > 0.5 && p + q + 1 >= k) continue;
            const Vec3 at = corner[0] + (p + third) / k * a + (q + third) / k * b;
            for (const double side : {1.0, -1.0}) add(at, side * normal, R, {share, 0.0, 0.0});
          }
        }
      }
    }
    const int m = sphere_count(rho_);
    const int turns = count_for(kPi * rho_ / spacing_, 2, 4);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3& here = corner[i];
      const Vec3 ahead = corner[i + 1 < n ? i + 1 : 0] - here;
      const Vec3 behind = corner[i > 0 ? i - 1 : n - 1] - here;
      const Vec3 out = ahead.cross(normal).normalized();
      const int cells = count_for(ahead.norm() / spacing_, 1, 1);
      for (int c = 0; c < cells; ++c) {
        for (int t = 0; t < turns; ++t) {
          const auto [sin, cos] = math::sin_cos(kPi * ((t + 0.5) / turns - 0.5));
          add(here + (c + 0.5) / cells * ahead, cos * out + sin * normal, R, {0.0, ahead.norm() / cells * (kPi / turns), 0.0});
        }
      }
      // Every direction has one corner that lies farthest along it.
      for_sphere(m, [&](const Vec3& u) {
        if (u.dot(ahead) <= 0.0 && u.dot(behind) < 0.0) add(here, u, R, {0.0, 0.0, 2.0 * kPi / (static_cast<double>(m) * m)});
      });
    }
  }

  const Skeleton& skeleton_;
  std::span<const double> asked_;  ///< spacing on the surface, of each primitive or of all [m]
  std::span<const Pose> parts_;
  const Box* near_;
  double spacing_ = 0.0;  ///< of the unstretched shape [m]
  ShapeView view_;
  const Primitive* primitive_ = nullptr;
  std::uint32_t id_ = 0;
  double rho_ = 0.0;  ///< distance of the lone primitive's surface [m]
  Vec3 near_centre_ = Vec3::Zero();  ///< of the ball around `near_`, in the frame of the unstretched primitive [m]
  double near_radius_ = 0.0;
  std::size_t seen_ = 0;
  SampleLayout& layout_;
};

}  // namespace

void SampleLayout::clear() noexcept {
  primitive.clear();
  part.clear();
  foot.clear();
  direction.clear();
  reach.clear();
  spread.clear();
}

SampleLayout make_sample_layout(const Skeleton& skeleton, double spacing) {
  SUPPLE_EXPECTS(spacing > 0.0);
  SampleLayout layout;
  LayoutBuilder(skeleton, {&spacing, 1}, {}, nullptr, layout).build();
  return layout;
}

SampleLayout make_sample_layout(const Skeleton& skeleton, std::span<const double> spacing) {
  SUPPLE_EXPECTS(spacing.size() == skeleton.primitive.size() && std::all_of(spacing.begin(), spacing.end(), [](double s) { return s > 0.0; }));
  SampleLayout layout;
  LayoutBuilder(skeleton, spacing, {}, nullptr, layout).build();
  return layout;
}

std::size_t make_sample_layout(const Skeleton& skeleton, double spacing, std::span<const Pose> parts, const Box& near,
                               SampleLayout& out) {
  SUPPLE_EXPECTS(spacing > 0.0 && parts.size() == skeleton.part_count);
  return LayoutBuilder(skeleton, {&spacing, 1}, parts, &near, out).build();
}

}  // namespace supple::implicit
