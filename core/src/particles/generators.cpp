#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>

#include "particles/random_share.h"
#include "supple/core/arrange.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

constexpr int kTriesOfPoint = 100;     // of a scattered particle
constexpr int kChordsOfPiece = 256;    // of a curve between two points, for its length

Quat frame_of(const Vec3& x, const Vec3& z) {
  Mat3 axes;
  axes.col(0) = x;
  axes.col(1) = z.cross(x);
  axes.col(2) = z;
  return Quat(axes).normalized();
}

Vec3 across(const Vec3& direction) {
  Eigen::Index least = 0;
  direction.cwiseAbs().minCoeff(&least);
  return Vec3::Unit(least).cross(direction).normalized();
}

/// A curve through points, uniform Catmull-Rom; u counts the pieces.
class SmoothCurve {
 public:
  explicit SmoothCurve(std::span<const Vec3> points) : points_(points) {}
  [[nodiscard]] Vec3 at(double u) const {
    const auto [p, t] = piece(u);
    return 0.5 * (2.0 * p[1] + t * ((p[2] - p[0]) + t * ((2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3]) + t * (3.0 * p[1] - p[0] - 3.0 * p[2] + p[3]))));
  }
  [[nodiscard]] Vec3 tangent(double u) const {
    const auto [p, t] = piece(u);
    return 0.5 * ((p[2] - p[0]) + t * (2.0 * (2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3]) + 3.0 * t * (3.0 * p[1] - p[0] - 3.0 * p[2] + p[3])));
  }
  [[nodiscard]] double pieces() const { return static_cast<double>(points_.size() - 1); }

 private:
  struct Piece {
    std::array<Vec3, 4> p;
    double t = 0.0;
  };
  [[nodiscard]] Piece piece(double u) const {
    const std::size_t last = points_.size() - 1;
    const std::size_t k = std::min(static_cast<std::size_t>(std::max(u, 0.0)), last - 1);
    return {{points_[k > 0 ? k - 1 : 0], points_[k], points_[k + 1], points_[std::min(k + 2, last)]}, u - static_cast<double>(k)};
  }
  std::span<const Vec3> points_;
};

}  // namespace

Arrangement arrange_ball(double radius, double spacing) {
  SUPPLE_EXPECTS(radius > 0.0 && spacing > 0.0);
  constexpr double kRounding = 1e-9;  // points on the sphere count as within it
  const double reach = radius / spacing * (1.0 + kRounding);
  const int n = static_cast<int>(std::floor(reach));
  Arrangement out;
  for (int z = -n; z <= n; ++z) {
    for (int y = -n; y <= n; ++y) {
      for (int x = -n; x <= n; ++x) {
        const Vec3 point(x, y, z);
        if (point.squaredNorm() > reach * reach) continue;
        out.position.emplace_back(spacing * point);
        out.orientation.push_back(Quat::Identity());
      }
    }
  }
  return out;
}

Arrangement arrange_tube(double radius, double length, double spacing) {
  SUPPLE_EXPECTS(radius > 0.0 && length > 0.0 && spacing > 0.0);
  const int rings = 1 + std::max(1, static_cast<int>(std::lround(length / spacing)));
  const int around = std::max(3, static_cast<int>(std::lround(2.0 * std::numbers::pi * radius / spacing)));
  Arrangement out;
  for (int ring = 0; ring < rings; ++ring) {
    const double z = length * (static_cast<double>(ring) / (rings - 1) - 0.5);
    for (int k = 0; k < around; ++k) {
      const auto [sin, cos] = math::sin_cos(2.0 * std::numbers::pi * k / around);
      const Vec3 normal(cos, sin, 0.0);
      out.position.emplace_back(radius * normal + z * Vec3::UnitZ());
      out.orientation.push_back(frame_of(Vec3::UnitZ(), normal));
    }
  }
  return out;
}

Arrangement arrange_curve(std::span<const Vec3> points, int count) {
  SUPPLE_EXPECTS(count >= 2 && points.size() >= 2);
  const SmoothCurve curve(points);
  std::vector<double> length{0.0};  // up to the ends of the chords
  const double step = 1.0 / kChordsOfPiece;
  const auto chords = static_cast<std::size_t>(curve.pieces()) * kChordsOfPiece;
  for (std::size_t k = 0; k < chords; ++k) {
    length.push_back(length.back() + (curve.at(step * static_cast<double>(k + 1)) - curve.at(step * static_cast<double>(k))).norm());
  }
  Arrangement out;
  Vec3 x = curve.tangent(0.0).normalized(), z = std::abs(x.z()) < 0.9 ? Vec3((Vec3::UnitZ() - x.z() * x).normalized()) : across(x);
  for (int i = 0; i < count; ++i) {
    const double wanted = length.back() * i / (count - 1);
    const auto after = std::min<std::size_t>(static_cast<std::size_t>(std::upper_bound(length.begin(), length.end(), wanted) - length.begin()), chords);
    const double share = (wanted - length[after - 1]) / std::max(length[after] - length[after - 1], std::numeric_limits<double>::min());
    const double u = step * (static_cast<double>(after - 1) + std::min(share, 1.0));
    const Vec3 next = curve.tangent(u).normalized();
    z = Quat::FromTwoVectors(x, next) * z;
    x = next;
    z = (z - z.dot(x) * x).normalized();
    out.position.push_back(curve.at(u));
    out.orientation.push_back(frame_of(x, z));
  }
  return out;
}

Arrangement arrange_scatter(const Vec3& size, int count, double apart, int seed) {
  SUPPLE_EXPECTS(count >= 1 && apart > 0.0 && size.minCoeff() > 0.0);
  using Cell = std::tuple<std::int64_t, std::int64_t, std::int64_t>;
  std::multimap<Cell, std::size_t> taken;
  const auto number = [apart](double x) { return static_cast<std::int64_t>(std::floor(x / apart)); };
  Arrangement out;
  const auto is_free = [&](const Vec3& x) {
    for (std::int64_t k = 0; k < 27; ++k) {
      const Cell cell{number(x.x()) + k % 3 - 1, number(x.y()) + k / 3 % 3 - 1, number(x.z()) + k / 9 - 1};
      const auto [first, last] = taken.equal_range(cell);
      if (std::any_of(first, last, [&](const auto& one) { return (out.position[one.second] - x).norm() < apart; })) return false;
    }
    return true;
  };
  const std::uint64_t most = static_cast<std::uint64_t>(kTriesOfPoint) * static_cast<std::uint64_t>(count);
  for (std::uint64_t attempt = 0; attempt < most && out.size() < static_cast<std::size_t>(count); ++attempt) {
    Vec3 x;
    for (Eigen::Index axis = 0; axis < 3; ++axis) x[axis] = size[axis] * (random_share(static_cast<std::uint64_t>(seed), 3 * attempt + static_cast<std::uint64_t>(axis)) - 0.5);
    if (!is_free(x)) continue;
    taken.emplace(Cell{number(x.x()), number(x.y()), number(x.z())}, out.size());
    out.position.push_back(x);
    out.orientation.push_back(Quat::Identity());
  }
  return out;
}

}  // namespace supple::core
