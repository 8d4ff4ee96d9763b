// Where the seeds of a skeleton start and which way they go. A rounded slab (point, segment, rectangle, box) is swept
// by its faces, quarter cylinders along its edges and the octants of a sphere at its corners (Steiner's formula), so
// the areas of a lone primitive's samples sum to its surface exactly.
#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/implicit/surface_samples.h"

namespace supple::implicit {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Smallest multiple of `step` that is at least x and at least `least`.
int count_for(double x, int step, int least) {
  const double steps = std::ceil(std::max(x, static_cast<double>(least)) / step);
  SUPPLE_EXPECTS(steps < 1e6);
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

/// 2 m^2 directions of equal solid angle, m even, mirror-symmetric in x, y, z, none in a coordinate plane: concentric
/// maps of m x m cells to discs and Lambert's equal-area map of those to the hemispheres.
template <class Use>
void for_sphere(int m, const Use& use) {
  for (const double side : {1.0, -1.0}) {
    for (int j = 0; j < m; ++j) {
      for (int i = 0; i < m; ++i) {
        const Eigen::Vector2d d = concentric((2.0 * i + 1.0) / m - 1.0, (2.0 * j + 1.0) / m - 1.0);
        const double r2 = d.squaredNorm();
        const double lift = std::sqrt(2.0 - r2);
        use(Vec3(d.x() * lift, d.y() * lift, side * (1.0 - r2)).normalized());
      }
    }
  }
}

class LayoutBuilder {
 public:
  LayoutBuilder(const Skeleton& skeleton, double spacing) : skeleton_(skeleton), spacing_(spacing) {}

  SampleLayout build() {
    for (std::size_t i = 0; i < skeleton_.primitive.size(); ++i) {
      primitive_ = &skeleton_.primitive[i];
      id_ = static_cast<std::uint32_t>(i);
      const Kernel& kernel = primitive_->kernel;
      const double peak = evaluate(kernel, 0.0).value;
      rho_ = skeleton_.iso < peak ? iso_distance(kernel, skeleton_.iso) : 0.5 * kernel.radius;
      const Vec3& size = primitive_->size;
      switch (primitive_->shape) {
        case ShapeKind::Point: slab(Vec3::Zero()); break;
        case ShapeKind::Segment: slab({size.x(), 0.0, 0.0}); break;
        case ShapeKind::Rectangle: slab({size.x(), size.y(), 0.0}); break;
        case ShapeKind::Box: slab(size); break;
        case ShapeKind::Disc: disc(size.x()); break;
        case ShapeKind::Ellipsoid: ellipsoid(size); break;
      }
    }
    return std::move(layout_);
  }

 private:
  void add(const Vec3& foot, const Vec3& direction, double reach, const Vec3& spread) {
    layout_.primitive.push_back(id_);
    layout_.part.push_back(primitive_->part);
    layout_.foot.push_back(primitive_->offset.to_world(foot));
    layout_.direction.push_back((primitive_->offset.orientation * direction).normalized());
    layout_.reach.push_back(reach);
    layout_.spread.push_back(spread);
  }

  /// Cells of an m x m grid over a hemisphere that are at most spacing_^2 large on a sphere of radius r.
  [[nodiscard]] int sphere_count(double r) const { return count_for(std::sqrt(2.0 * kPi) * r / spacing_, 2, 4); }

  void slab(const Vec3& half) {
    const double R = primitive_->kernel.radius;
    const int m = sphere_count(rho_);
    for_sphere(m, [&](const Vec3& u) {
      const Vec3 corner(std::copysign(half.x(), u.x()), std::copysign(half.y(), u.y()), std::copysign(half.z(), u.z()));
      add(corner, u, R, {0.0, 0.0, 2.0 * kPi / (m * m)});
    });
    for (int k = 0; k < 3; ++k) {  // edges along axis k
      if (!(half[k] > 0.0)) continue;
      const int i = (k + 1) % 3;
      const int j = (k + 2) % 3;
      const int turns = count_for(2.0 * kPi * rho_ / spacing_, 4, 8);
      const int cells = count_for(2.0 * half[k] / spacing_, 1, 1);
      for (int c = 0; c < cells; ++c) {
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
      for (const double side : {1.0, -1.0}) {
        for (int r = 0; r < rows; ++r) {
          for (int c = 0; c < columns; ++c) {
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
          add({d.x(), d.y(), 0.0}, {0.0, 0.0, side}, R, {kPi * r * r / (m * m), 0.0, 0.0});
        }
      }
    }
    // The rim sweeps half a torus: (r + rho cos latitude) rho d(latitude) d(turn).
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

  void ellipsoid(const Vec3& size) {
    const int m = sphere_count(rho_ / primitive_->kernel.radius * size.maxCoeff());
    for_sphere(m, [&](const Vec3& s) {
      // x = D s maps solid angles by abc / |D s|^3.
      const Vec3 x = size.cwiseProduct(s);
      const double length = x.norm();
      add(Vec3::Zero(), x / length, length, {0.0, 0.0, 2.0 * kPi / (m * m) * size.prod() / (length * length * length)});
    });
  }

  const Skeleton& skeleton_;
  double spacing_;
  const Primitive* primitive_ = nullptr;
  std::uint32_t id_ = 0;
  double rho_ = 0.0;  ///< distance of the lone primitive's surface [m]
  SampleLayout layout_;
};

}  // namespace

SampleLayout make_sample_layout(const Skeleton& skeleton, double spacing) {
  SUPPLE_EXPECTS(spacing > 0.0);
  return LayoutBuilder(skeleton, spacing).build();
}

}  // namespace supple::implicit
