#include "surface/region/sigma_columns.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "surface/accuracy.h"
#include "surface/quadrature.h"
#include "surface/region/column_kinks.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

/// A line from a place of Sigma to where a body ends.
struct Column {
  Vec3 from, way;
  std::array<double, 3> across;  // area [m^2]: coefficients of the powers of the distance along it
  double length;                 // as far as it is known [m]
  double low = 0.0, high = 0.0;
  bool high_seen = false;
};

/// Newton's method along the columns for the zero of the body's pressure, safeguarded by halving. @param reach  longest step that is believed [m]
/// @return whether all end, and the pressure falls there
bool find_ends(PairPressure& pressure, int side, double error, double reach, std::vector<Column>& columns) {
  constexpr double kStep = 0.03;  // over the longest step and the root of the error: ends are off by its square
  const double enough = kStep * std::sqrt(error) * reach;
  thread_local std::vector<std::size_t> open;
  thread_local std::vector<Vec3> point, slope;
  thread_local std::vector<double> value;
  open.clear();
  for (std::size_t i = 0; i < columns.size(); ++i) open.push_back(i);
  bool lead_out = true;
  for (int step = 0; step < kBracketSteps && !open.empty(); ++step) {
    point.clear();
    for (const std::size_t i : open) point.push_back(columns[i].from + columns[i].length * columns[i].way);
    value.resize(point.size());
    slope.resize(point.size());
    pressure.evaluate(side, point, value, slope);
    std::size_t kept = 0;
    for (std::size_t n = 0; n < open.size(); ++n) {
      Column& column = columns[open[n]];
      const double fall = -slope[n].dot(column.way);
      const bool inside = value[n] > 0.0;
      (inside ? column.low : column.high) = column.length;
      column.high_seen = column.high_seen || !inside;
      const double move = fall > 0.0 ? std::clamp(value[n] / fall, -reach, reach) : inside ? reach : -reach;
      double next = column.length + move;
      if (next <= column.low || (column.high_seen && next >= column.high)) next = column.high_seen ? 0.5 * (column.low + column.high) : column.low + reach;
      const double moved = std::abs(next - column.length);
      column.length = std::max(next, 0.0);
      if (moved <= enough) {
        lead_out = lead_out && fall >= 0.0;
      } else {
        open[kept++] = open[n];
      }
    }
    open.resize(kept);
  }
  return lead_out && open.empty();
}

/// Gauss points of a column: two more digits ask for one more. @param at_once  at an error of 1
int points_of_column(double at_once, double error) { return std::clamp(static_cast<int>(std::lround(at_once - 0.5 * std::log10(error))), 2, 9); }

/// Points along the columns, and the volumes that they stand for. @param order  of Gauss's rule along a column
void fill_columns(int order, ColumnKinks& kinks, std::span<const Column> columns, PatchPoints& points) {
  for (const Column& column : columns) {
    const std::span<const double> part = kinks.parts(column.from, column.way, column.length);
    const GaussRule& rule = gauss_rule(order_of_parts(order, part));
    for (std::size_t i = 0; i + 1 < part.size(); ++i) {
      const double length = part[i + 1] - part[i];
      for (std::size_t k = 0; k < rule.node.size(); ++k) {
        const double along = part[i] + rule.node[k] * length;
        points.volume_point.push_back(column.from + along * column.way);
        points.volume_weight.push_back(rule.weight[k] * length * (column.across[0] + along * (column.across[1] + along * column.across[2])));
      }
    }
  }
}

/// Columns along the mean normal of Sigma, weighted with the pressure. @return false where Sigma has none
bool start_parallel(PairPressure& pressure, int side, double reach, const PatchPoints& points, std::vector<Column>& columns) {
  const double sign = side == 0 ? 1.0 : -1.0;
  Vec3 force = Vec3::Zero();
  for (std::size_t i = 0; i < points.point.size(); ++i) force += (points.area[i] * points.pressure[i]) * points.normal[i];
  const double length = force.norm();
  if (!(length > 0.0)) return false;
  const Vec3 way = sign / length * force;
  thread_local std::vector<Vec3> slope;
  thread_local std::vector<double> value;
  slope.resize(points.point.size());
  value.resize(points.point.size());
  pressure.evaluate(side, points.point, value, slope);
  for (std::size_t i = 0; i < points.point.size(); ++i) {
    const double fall = -slope[i].dot(way);
    columns.push_back({points.point[i], way, {sign * points.area[i] * points.normal[i].dot(way), 0.0, 0.0}, fall > 0.0 ? std::min(value[i] / fall, reach) : reach});
  }
  return true;
}

/// Columns down the slope of a body's pressure from points of Sigma, and by how much they spread: these follow from how the way changes along Sigma.
/// @return false where the pressure has no slope
bool start_falls(PairPressure& pressure, int side, double reach, const PatchPoints& points, std::vector<Column>& columns) {
  constexpr double kDifference = 1e-4;  // of a feature of the bodies: central differences are good to the square of it
  constexpr std::size_t kPlaces = 5;    // a point, and two beside it along each of two tangents
  const double h = kDifference * pressure.feature_size(), sign = side == 0 ? 1.0 : -1.0;
  const std::size_t n = points.point.size();
  thread_local std::vector<Vec3> place, slope;
  thread_local std::vector<double> value;
  place.clear();
  slope.resize(kPlaces * n);
  value.resize(kPlaces * n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& x = points.point[i];
    const Vec3 u = points.normal[i].unitOrthogonal(), v = points.normal[i].cross(u);
    place.insert(place.end(), {x, x - h * u, x + h * u, x - h * v, x + h * v});
  }
  pressure.evaluate(side, place, value, slope);
  for (std::size_t i = 0; i < n; ++i) {
    std::array<Vec3, kPlaces> way;
    for (std::size_t k = 0; k < kPlaces; ++k) {
      const double steep = slope[kPlaces * i + k].norm();
      if (!(steep > 0.0)) return false;
      way[k] = slope[kPlaces * i + k] / -steep;
    }
    const Vec3 u = points.normal[i].unitOrthogonal(), v = points.normal[i].cross(u);
    const Vec3 by_u = (way[2] - way[1]) / (2.0 * h), by_v = (way[4] - way[3]) / (2.0 * h);
    const double area = sign * points.area[i];
    columns.push_back({points.point[i],
                       way[0],
                       {area * u.cross(v).dot(way[0]), area * (by_u.cross(v) + u.cross(by_v)).dot(way[0]), area * by_u.cross(by_v).dot(way[0])},
                       std::min(points.pressure[i] / slope[kPlaces * i].norm(), reach)});
  }
  return true;
}

/// Whether columns hold what a body loses once. There the integrals of grad p and of grad(p) r + p I are those of -p n and of -p n r on Sigma, out of the body
/// (Gauss: p is zero on the rest of the border): the load, its moment, and the energy. Space that is counted twice is taken off by columns that have crossed.
bool hold_once(int side, std::span<const double> value, std::span<const Vec3> slope, double error, std::size_t begin, const PatchPoints& points) {
  const double sign = side == 0 ? 1.0 : -1.0;
  PatchSums on;
  for (std::size_t i = 0; i < points.point.size(); ++i) on.add(points.point[i] - points.point[0], points.normal[i], points.area[i], points.pressure[i]);
  const Vec3 centre = points.point[0] + on.centre();
  const double size = std::sqrt(std::max(on.spread / on.load - on.centre().squaredNorm(), on.area));
  Vec3 off = sign * on.force;
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < points.point.size(); ++i) {
    moment += (sign * points.area[i] * points.pressure[i]) * points.normal[i] * (points.point[i] - centre).transpose();
  }
  double volume = 0.0, crossed = 0.0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    const double w = points.volume_weight[begin + i];
    off += w * slope[i];
    moment += w * (slope[i] * (points.volume_point[begin + i] - centre).transpose() + value[i] * Eigen::Matrix3d::Identity());
    volume += w;
    crossed += std::max(-w, 0.0);
  }
  return off.norm() <= error * on.load && moment.norm() <= error * on.load * size && crossed <= error * volume;
}

/// Whether third bodies press harder than the other one of the pair at places of what a body loses.
bool thirds_take(PairPressure& pressure, int side, Thirds third, std::span<const Vec3> places) {
  Box box;
  for (const Vec3& x : places) box.include(x);
  std::vector<double> other, taken;
  for (const ContactBody* const body : third) {
    if (!(body->field.bound(box).upper > 0.0)) continue;
    if (other.empty()) {
      other.resize(places.size());
      taken.resize(places.size());
      pressure.evaluate(1 - side, places, other);
    }
    body->field.evaluate(places, taken);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (body->material.modulus * taken[i] > other[i]) return true;
    }
  }
  return false;
}

}  // namespace

bool add_columns(const ColumnJob& job, PatchPoints& points) {
  const auto& [pressure, side, third, region, error] = job;
  const double reach = 0.5 * pressure.feature_size();
  const std::size_t begin = points.volume_point.size();
  thread_local std::vector<Column> columns;
  thread_local std::vector<double> value;
  thread_local std::vector<Vec3> slope;
  ColumnKinks kinks(pressure, side, error);
  for (const auto start : {start_parallel, start_falls}) {
    columns.clear();
    if (!start(pressure, side, reach, points, columns) || !find_ends(pressure, side, error, reach, columns)) continue;
    fill_columns(points_of_column(1.4, error), kinks, columns, points);
    const auto added = std::span(points.volume_point).subspan(begin);
    value.resize(added.size());
    slope.resize(added.size());
    pressure.evaluate(side, added, value, slope);
    const bool hold = hold_once(side, value, slope, error, begin, points);
    const bool taken = hold && thirds_take(pressure, side, third, added);
    for (std::size_t i = 0; hold && !taken && i < added.size(); ++i) {
      points.displaced[side] += points.volume_weight[begin + i];
      points.energy[side] += points.volume_weight[begin + i] * value[i];
    }
    if (!hold || taken || region != Region::Points) {
      points.volume_point.resize(begin);
      points.volume_weight.resize(begin);
    }
    points.volume_side.resize(points.volume_point.size(), static_cast<std::uint8_t>(side));
    if (hold) return !taken;
  }
  return false;
}

void add_flow(PairPressure& pressure, int side, const Apex& apex, double error, PatchPoints& points) {
  const double sign = side == 0 ? 1.0 : -1.0, reach = 0.5 * pressure.feature_size();
  thread_local std::vector<Column> columns;
  thread_local std::vector<double> value;
  columns.clear();
  for (std::size_t i = 0; i < points.point.size(); ++i) {
    const Vec3& at = points.point[i];
    const Vec3 way = apex.way(at);
    const double area = sign * points.area[i] * points.normal[i].dot(way), widens = 1.0 / apex.distance(at);
    columns.push_back({at, way, {area, 2.0 * area * widens, area * widens * widens}, reach});
  }
  find_ends(pressure, side, error, reach, columns);
  const std::size_t begin = points.volume_point.size();
  ColumnKinks kinks(pressure, side, error);
  fill_columns(points_of_column(3.5, error), kinks, columns, points);
  if (apex.lost) fill_body(pressure, side, apex.at, error, points.volume_point, points.volume_weight);
  add_to_region(pressure, side, begin, value, points);
  points.volume_point.resize(begin);
  points.volume_weight.resize(begin);
  points.volume_side.resize(begin);
}

}  // namespace supple::collision
