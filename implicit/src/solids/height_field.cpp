#include "supple/implicit/height_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "field/single_part.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kMostOfDifference = 1.5;  // of a slope: with those of both directions no Bezier point of a cell leaves its corners' values
constexpr double kLeastOfTwist = 3.0;      // a slope is this share of a difference at least where the mixed one is taken whole

/// Cubic Hermite weights at t in [0, 1] of the values and of the slopes at 0 and 1, and their derivatives.
struct HermiteWeights {
  std::array<double, 2> value, slope, value_rate, slope_rate;
  explicit HermiteWeights(double t) {
    const double s = 1.0 - t, bend = 6.0 * t * s;
    value = {s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t)};
    slope = {t * s * s, -t * t * s};
    value_rate = {-bend, bend};
    slope_rate = {s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)};
  }
};

/// Of three values in a row at the middle one. @param before, after  one-sided differences
double limited_slope(double before, double after) {
  if (!(before * after > 0.0)) return 0.0;
  const double most = kMostOfDifference * std::min(std::abs(before), std::abs(after));
  return std::copysign(std::min(0.5 * std::abs(before + after), most), before);
}

/// At the end of a row. @param first, second  differences from there on
double end_slope(double first, double second) {
  const double parabola = first + 0.5 * (first - second);
  if (!(parabola * first > 0.0)) return 0.0;
  return std::copysign(std::min(std::abs(parabola), kMostOfDifference * std::abs(first)), first);
}

/// At place k of a row of n values. @param difference  from a place to the next
template <class Difference>
double slope_in_row(std::size_t k, std::size_t n, const Difference& difference) {
  if (n == 2) return difference(0);
  if (k == 0) return end_slope(difference(0), difference(1));
  if (k == n - 1) return end_slope(difference(n - 2), difference(n - 3));
  return limited_slope(difference(k - 1), difference(k));
}

/// Cosines of a surface's slope to the vertical at the points of its grid.
std::vector<double> cosines(const LimitedBicubic& height, std::size_t columns, std::size_t rows, double spacing) {
  std::vector<double> cosine;
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i) cosine.push_back(1.0 / std::hypot(1.0, height.slope(i, j).norm() / spacing));
  }
  return cosine;
}

/// Product of an interval of numbers > 0 and another one.
Interval product(const Interval& positive, const Interval& other) {
  return {(other.lower < 0.0 ? positive.upper : positive.lower) * other.lower, (other.upper < 0.0 ? positive.lower : positive.upper) * other.upper};
}

/// Distance from a solid that is the intersection of three, from how far a point lies beyond each of them; rises with each.
double beyond_all(const Vec3& over) {
  const double outside = over.cwiseMax(0.0).norm();
  return outside > 0.0 ? outside : over.maxCoeff();
}

/// How far the numbers of an interval lie beyond [middle - half, middle + half].
Interval beyond(double lower, double upper, double middle, double half) {
  const double low = lower - middle, high = upper - middle;
  const double least = low <= 0.0 && high >= 0.0 ? 0.0 : std::min(std::abs(low), std::abs(high));
  return {least - half, std::max(std::abs(low), std::abs(high)) - half};
}

}  // namespace

LimitedBicubic::LimitedBicubic(std::size_t columns, std::size_t rows, std::span<const double> values) : columns_(columns), rows_(rows) {
  SUPPLE_EXPECTS(columns >= 2 && rows >= 2 && values.size() == columns * rows);
  for (const double value : values) node_.push_back({value, Vec2::Zero(), 0.0});
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i) {
      Vec2& slope = node_[j * columns + i].slope;
      slope.x() = slope_in_row(i, columns, [&](std::size_t k) { return node(k + 1, j).value - node(k, j).value; });
      slope.y() = slope_in_row(j, rows, [&](std::size_t k) { return node(i, k + 1).value - node(i, k).value; });
    }
  }
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i) node_[j * columns + i].twist = limited_twist(i, j);
  }
  for (std::size_t j = 0; j + 1 < rows; ++j) {
    for (std::size_t i = 0; i + 1 < columns; ++i) steepest_ = std::max(steepest_, steepest_in(i, j));
  }
}

/// The smallest mixed difference of the cells around a point, less where a slope is limited to little of a difference; 0 where their signs differ.
double LimitedBicubic::limited_twist(std::size_t i, std::size_t j) const {
  const Node& here = node(i, j);
  double least = kInfinity, sign = 0.0;
  for (const std::size_t i_other : {i - 1, i + 1}) {
    for (const std::size_t j_other : {j - 1, j + 1}) {
      if (i_other >= columns_ || j_other >= rows_) continue;  // also those before 0
      const double along_u = node(i_other, j).value - here.value, along_v = node(i, j_other).value - here.value;
      const double way = (i_other > i ? 1.0 : -1.0) * (j_other > j ? 1.0 : -1.0);
      const double mixed = way * (node(i_other, j_other).value - here.value - along_u - along_v);
      const double share_u = along_u != 0.0 ? std::abs(here.slope.x() / along_u) : 1.0, share_v = along_v != 0.0 ? std::abs(here.slope.y() / along_v) : 1.0;
      if (mixed * sign < 0.0 || mixed == 0.0) return 0.0;
      sign = mixed;
      least = std::min(least, std::abs(mixed) * std::min(1.0, kLeastOfTwist * std::min(share_u, share_v)));
    }
  }
  return std::copysign(least, sign);
}

/// Derivatives of a cell lie between the differences of its Bezier points.
double LimitedBicubic::steepest_in(std::size_t i, std::size_t j) const {
  std::array<std::array<double, 4>, 4> point{};  // [along v][along u]
  for (const std::size_t b : {0U, 1U}) {
    for (const std::size_t a : {0U, 1U}) {
      const Node& corner = node(i + a, j + b);
      const double u = (a == 0 ? 1.0 : -1.0) / 3.0, v = (b == 0 ? 1.0 : -1.0) / 3.0;
      const std::size_t at_u = 3 * a, at_v = 3 * b, next_u = 1 + a, next_v = 1 + b;
      point[at_v][at_u] = corner.value;
      point[at_v][next_u] = corner.value + u * corner.slope.x();
      point[next_v][at_u] = corner.value + v * corner.slope.y();
      point[next_v][next_u] = corner.value + u * corner.slope.x() + v * corner.slope.y() + u * v * corner.twist;
    }
  }
  double along_u = 0.0, along_v = 0.0;
  for (std::size_t m = 0; m < 4; ++m) {
    for (std::size_t n = 0; n < 3; ++n) {
      along_u = std::max(along_u, std::abs(point[m][n + 1] - point[m][n]));
      along_v = std::max(along_v, std::abs(point[n + 1][m] - point[n][m]));
    }
  }
  return 3.0 * std::hypot(along_u, along_v);
}

Vec3 LimitedBicubic::at(double u, double v) const {
  const auto i = static_cast<std::size_t>(std::min(u, static_cast<double>(columns_ - 2)));
  const auto j = static_cast<std::size_t>(std::min(v, static_cast<double>(rows_ - 2)));
  const HermiteWeights across(u - static_cast<double>(i)), along(v - static_cast<double>(j));
  Vec3 sum = Vec3::Zero();
  for (const std::size_t b : {0U, 1U}) {
    for (const std::size_t a : {0U, 1U}) {
      const Node& corner = node(i + a, j + b);
      const double row = across.value[a] * corner.value + across.slope[a] * corner.slope.x();
      const double turned = across.value[a] * corner.slope.y() + across.slope[a] * corner.twist;
      const double row_rate = across.value_rate[a] * corner.value + across.slope_rate[a] * corner.slope.x();
      const double turned_rate = across.value_rate[a] * corner.slope.y() + across.slope_rate[a] * corner.twist;
      sum += Vec3(along.value[b] * row + along.slope[b] * turned, along.value[b] * row_rate + along.slope[b] * turned_rate,
                  along.value_rate[b] * row + along.slope_rate[b] * turned);
    }
  }
  return sum;
}

Interval LimitedBicubic::range(const Interval& u, const Interval& v) const {
  const auto first = [](double at, std::size_t count) { return static_cast<std::size_t>(std::min(at, static_cast<double>(count - 2))); };
  Interval range{kInfinity, -kInfinity};
  for (std::size_t j = first(v.lower, rows_); j <= first(v.upper, rows_) + 1; ++j) {
    for (std::size_t i = first(u.lower, columns_); i <= first(u.upper, columns_) + 1; ++i) {
      range.lower = std::min(range.lower, node(i, j).value);
      range.upper = std::max(range.upper, node(i, j).value);
    }
  }
  return range;
}

double LimitedBicubic::largest() const {
  return std::max_element(node_.begin(), node_.end(), [](const Node& a, const Node& b) { return a.value < b.value; })->value;
}

double LimitedBicubic::least() const {
  return std::min_element(node_.begin(), node_.end(), [](const Node& a, const Node& b) { return a.value < b.value; })->value;
}

HeightField::HeightField(const Vec3& corner, double spacing, std::size_t columns, std::size_t rows,
                         std::span<const double> heights, double slope)
    : corner_(corner),
      spacing_(spacing),
      columns_(columns),
      rows_(rows),
      height_(columns, rows, heights),
      cosine_(columns, rows, cosines(height_, columns, rows, spacing)),
      slope_(slope) {
  SUPPLE_EXPECTS(spacing > 0.0 && slope > 0.0);
}

double HeightField::column(double x) const { return std::clamp((x - corner_.x()) / spacing_, 0.0, static_cast<double>(columns_ - 1)); }

double HeightField::row(double y) const { return std::clamp((y - corner_.y()) / spacing_, 0.0, static_cast<double>(rows_ - 1)); }

Vec2 HeightField::half() const { return 0.5 * spacing_ * Vec2(static_cast<double>(columns_ - 1), static_cast<double>(rows_ - 1)); }

Vec2 HeightField::middle() const { return corner_.head<2>() + half(); }

Vec3 HeightField::height(double x, double y) const {
  const Vec3 h = height_.at(column(x), row(y));
  return {h.x() + corner_.z(), h.y() / spacing_, h.z() / spacing_};
}

double HeightField::evaluate(const Vec3& point, Vec3* gradient) const {
  const Vec2 from_middle = point.head<2>() - middle(), beside = from_middle.cwiseAbs() - half();
  const double u = column(point.x()), v = row(point.y());
  const Vec3 h = height_.at(u, v), cosine = cosine_.at(u, v);
  const double above = point.z() - corner_.z() - h.x();
  const Vec3 over(above * cosine.x(), beside.x(), beside.y());
  const double distance = beyond_all(over);
  if (gradient != nullptr) {
    Vec3 ground(0.0, 0.0, cosine.x());
    for (const Eigen::Index k : {0, 1}) {
      if (!(beside[k] > 0.0)) ground[k] = (above * cosine[k + 1] - cosine.x() * h[k + 1]) / spacing_;
    }
    Vec3 share = over.cwiseMax(0.0);
    if (share.isZero(0.0)) {
      Eigen::Index nearest = 0;
      over.maxCoeff(&nearest);
      share = Vec3::Unit(nearest);
    } else {
      share /= distance;
    }
    *gradient = -slope_ * (share.x() * ground + Vec3(std::copysign(share.y(), from_middle.x()), std::copysign(share.z(), from_middle.y()), 0.0));
  }
  return -slope_ * distance;
}

void HeightField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], nullptr);
}

void HeightField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], &gradients[i]);
}

void HeightField::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
  evaluate_single_part(*this, points, parts);
}

/// Of z - h over a box.
Interval HeightField::above_ground(const Box& box) const {
  const Interval h = height_.range({column(box.lower.x()), column(box.upper.x())}, {row(box.lower.y()), row(box.upper.y())});
  double scale = std::abs(corner_.z()) + std::max(std::abs(h.lower), std::abs(h.upper));
  for (const double z : {box.lower.z(), box.upper.z()}) scale += std::isfinite(z) ? std::abs(z) : 0.0;
  const double round_off = 32.0 * kEpsilon * scale;
  return {box.lower.z() - corner_.z() - h.upper - round_off, box.upper.z() - corner_.z() - h.lower + round_off};
}

Interval HeightField::bound(const Box& box) const {
  const Interval cosine = cosine_.range({column(box.lower.x()), column(box.upper.x())}, {row(box.lower.y()), row(box.upper.y())});
  const Interval ground = product(cosine, above_ground(box));
  const Interval x = beyond(box.lower.x(), box.upper.x(), middle().x(), half().x()), y = beyond(box.lower.y(), box.upper.y(), middle().y(), half().y());
  const Interval distance{beyond_all({ground.lower, x.lower, y.lower}), beyond_all({ground.upper, x.upper, y.upper})};
  double scale = middle().norm() + half().norm();
  for (const double d : {distance.lower, distance.upper}) scale += std::isfinite(d) ? std::abs(d) : 0.0;
  const double round_off = 32.0 * kEpsilon * scale;
  return {-slope_ * (distance.upper + round_off), -slope_ * (distance.lower - round_off)};
}

double HeightField::gradient_bound(const Box& box) const {
  const Interval above = above_ground(box);
  const double farthest = std::max(std::abs(above.lower), std::abs(above.upper)), most = cosine_.largest();
  const double turned = cosine_.steepest() > 0.0 ? cosine_.steepest() * farthest : 0.0;  // far off, but for planes
  const double ground = std::hypot(most, (most * height_.steepest() + turned) / spacing_);
  return slope_ * std::max(1.0, ground) * (1.0 + 16.0 * kEpsilon);
}

Box HeightField::surface_box() const {
  const double top = corner_.z() + height_.largest();
  const Vec2 beside = half() + Vec2::Constant(16.0 * kEpsilon * (middle().norm() + half().norm()));
  const Vec2 lower = middle() - beside, upper = middle() + beside;
  return {Vec3(lower.x(), lower.y(), -kInfinity), Vec3(upper.x(), upper.y(), top + 16.0 * kEpsilon * std::abs(top))};
}

double HeightField::feature_size() const { return 2.0 * spacing_; }

Mesh HeightField::mesh(int finer) const {
  SUPPLE_EXPECTS(finer >= 1);
  const std::size_t across = (columns_ - 1) * static_cast<std::size_t>(finer) + 1;
  const std::size_t along = (rows_ - 1) * static_cast<std::size_t>(finer) + 1;
  Mesh mesh;
  for (std::size_t j = 0; j < along; ++j) {
    for (std::size_t i = 0; i < across; ++i) {
      const double x = corner_.x() + spacing_ * static_cast<double>(i) / finer;
      const double y = corner_.y() + spacing_ * static_cast<double>(j) / finer;
      const Vec3 h = height(x, y);
      mesh.position.emplace_back(x, y, h.x());
      mesh.normal.push_back(Vec3(-h.y(), -h.z(), 1.0).normalized());
    }
  }
  for (std::size_t j = 0; j + 1 < along; ++j) {
    for (std::size_t i = 0; i + 1 < across; ++i) {
      const auto a = static_cast<std::uint32_t>(j * across + i), b = a + 1;
      const auto d = static_cast<std::uint32_t>(a + across), c = d + 1;
      mesh.triangle.push_back({a, b, c});
      mesh.triangle.push_back({a, c, d});
    }
  }
  add_sides(across, along, mesh);
  return mesh;
}

/// Strips of triangles from the border of the surface down to the lowest height. @param across, along  vertices of the surface each way
void HeightField::add_sides(std::size_t across, std::size_t along, Mesh& mesh) const {
  const double lowest = corner_.z() + height_.least();
  const auto add_side = [&](std::size_t first, std::size_t stride, std::size_t count, const Vec3& outward) {
    const auto begin = static_cast<std::uint32_t>(mesh.position.size());
    for (std::size_t k = 0; k < count; ++k) {
      const Vec3 rim = mesh.position[first + k * stride];
      mesh.position.push_back(rim);
      mesh.position.emplace_back(rim.x(), rim.y(), lowest);
      mesh.normal.insert(mesh.normal.end(), 2, outward);
    }
    for (std::uint32_t k = 0; k + 1 < count; ++k) {
      const std::uint32_t top = begin + 2 * k, low = top + 1, next_top = top + 2, next_low = top + 3;
      const bool turned = (mesh.position[next_top] - mesh.position[top]).cross(Vec3::UnitZ()).dot(outward) < 0.0;
      const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        turned ? mesh.triangle.push_back({a, c, b}) : mesh.triangle.push_back({a, b, c});
      };
      if (mesh.position[top].z() > lowest) add(top, low, next_low);
      if (mesh.position[next_top].z() > lowest) add(top, next_low, next_top);
    }
  };
  add_side(0, 1, across, -Vec3::UnitY());
  add_side((along - 1) * across, 1, across, Vec3::UnitY());
  add_side(0, across, along, -Vec3::UnitX());
  add_side(across - 1, across, along, Vec3::UnitX());
}

}  // namespace supple::implicit
