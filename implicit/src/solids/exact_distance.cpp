#include "solids/exact_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace supple::implicit {
namespace {

/// A side of a triangle, in the order of its vertices.
struct Side {
  std::uint32_t low, high, triangle, number;
};

std::vector<Side> sides_of(const ClosedSurface& surface) {
  std::vector<Side> sides;
  sides.reserve(3 * surface.triangle.size());
  for (std::uint32_t t = 0; t < surface.triangle.size(); ++t) {
    const auto& corner = surface.triangle[t];
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t a = corner[k], b = corner[(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, k});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.low != y.low ? x.low < y.low : x.high != y.high ? x.high < y.high : x.triangle < y.triangle;
  });
  return sides;
}

/// Angle of a triangle at a corner.
double angle_at(const Vec3& corner, const Vec3& next, const Vec3& last) {
  const Vec3 u = next - corner, v = last - corner;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

Vec3 unit_or_zero(const Vec3& v) {
  const double length = v.norm();
  return length > 0.0 ? Vec3(v / length) : Vec3::Zero();
}

}  // namespace

ExactDistance::ExactDistance(ClosedSurface surface) : surface_(std::move(surface)), tree_(surface_.position, surface_.triangle) {
  for (const Vec3& x : surface_.position) box_.include(x);
  find_normals();
}

void ExactDistance::find_normals() {
  const auto& triangle = surface_.triangle;
  edge_normal_.resize(triangle.size());
  corner_normal_.resize(triangle.size());
  std::vector<Vec3> at_vertex(surface_.position.size(), Vec3::Zero());
  std::vector<std::uint8_t> unsure(surface_.position.size(), 0);
  for (std::uint32_t t = 0; t < triangle.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[t][k], b = triangle[t][(k + 1) % 3], c = triangle[t][(k + 2) % 3];
      at_vertex[a] += angle_at(surface_.position[a], surface_.position[b], surface_.position[c]) * tree_.normal(t);
      if (surface_.crossing[t] != 0) unsure[a] = 1;
    }
  }
  const std::vector<Side> sides = sides_of(surface_);
  for (std::size_t begin = 0; begin < sides.size();) {
    std::size_t end = begin;
    Vec3 sum = Vec3::Zero();
    bool crosses = false;
    for (; end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high; ++end) {
      sum += tree_.normal(sides[end].triangle);
      crosses = crosses || surface_.crossing[sides[end].triangle] != 0;
    }
    const bool known = (end - begin) % 2 == 0 && !crosses;
    if (!known) unsure[sides[begin].low] = unsure[sides[begin].high] = 1;
    for (std::size_t i = begin; i < end; ++i) edge_normal_[sides[i].triangle][sides[i].number] = known ? unit_or_zero(sum) : Vec3::Zero();
    begin = end;
  }
  for (std::uint32_t t = 0; t < triangle.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = triangle[t][k];
      corner_normal_[t][k] = unsure[v] == 0 ? unit_or_zero(at_vertex[v]) : Vec3::Zero();
    }
  }
}

double ExactDistance::at(const Vec3& x, Vec3* slope) const {
  const TriangleSite site = tree_.nearest(x);
  const Vec3& face = tree_.normal(site.triangle);
  if (site.feature == TriangleSite::kFace) {
    // A face is seen from the side that is outside, but where others pass through it.
    const bool turned = surface_.crossing[site.triangle] != 0 && is_around(*surface_.around, x) != (site.height < 0.0);
    if (slope != nullptr) *slope = turned ? Vec3(-face) : face;
    return turned ? -site.height : site.height;
  }
  const std::size_t k = site.feature;
  const Vec3& normal = k >= TriangleSite::kCorner ? corner_normal_[site.triangle][k - TriangleSite::kCorner]
                                                  : edge_normal_[site.triangle][k - TriangleSite::kEdge];
  constexpr double kSure = 1e-3;  // cosine between the way from the surface and the normal
  constexpr double kNear = 1e-12;  // of the size: the way from the surface is lost in rounding
  const double distance = std::sqrt(site.square), above = site.from.dot(normal);
  const bool inside = std::abs(above) > kSure * distance ? above < 0.0 : is_around(*surface_.around, x);
  if (slope != nullptr) {
    const bool on_surface = distance <= kNear * box_.extent().maxCoeff();
    if (on_surface) *slope = normal.isZero() ? face : normal;
    else *slope = (inside ? -1.0 : 1.0) / distance * site.from;
  }
  return inside ? -distance : distance;
}

double ExactDistance::opposite_ball(const Vec3& on_surface, const Vec3& normal, double largest) const {
  constexpr int kMostSteps = 20;
  constexpr double kTouches = 1e-6, kOpposite = -0.9;  // of the radius; cosine between the ways to both places
  double radius = largest, cosine = -1.0;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3 centre = on_surface - radius * normal;
    const TriangleSite site = tree_.nearest(centre);
    const Vec3 way = site.feature == TriangleSite::kFace ? Vec3(site.height * tree_.normal(site.triangle)) : site.from;  // from the nearest place
    const Vec3 between = on_surface - (centre - way);
    const double along = between.dot(normal);
    if (way.norm() >= radius * (1.0 - kTouches) || !(along > 0.0)) break;
    radius = between.squaredNorm() / (2.0 * along);  // of the ball through both places
    cosine = 1.0 - between.squaredNorm() / (2.0 * radius * radius);
  }
  return cosine <= kOpposite ? radius : std::numeric_limits<double>::infinity();
}

double ExactDistance::thickness(double share, double most) const {
  constexpr std::size_t kPlaces = 2000;
  const double largest = 0.5 * std::min(most, box_.extent().minCoeff());
  std::vector<double> found;
  each_place(kPlaces, [&](const Vec3& at, const Vec3& normal) { found.push_back(2.0 * opposite_ball(at, normal, largest)); });
  if (found.empty()) return std::numeric_limits<double>::infinity();
  const auto at = found.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(found.size()));
  std::nth_element(found.begin(), at, found.end());
  return *at;
}

}  // namespace supple::implicit
