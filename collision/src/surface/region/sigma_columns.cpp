#include <algorithm>
#include <cmath>

#include "surface/accuracy.h"
#include "surface/panels/panel_rule.h"
#include "surface/quadrature.h"
#include "surface/region/column_kinks.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

/// A line from a place of Sigma to where a body ends.
struct Column {
  Vec3 from, way;
  double share;   // of the area across it [m^2]
  double widens;  // across, over a step along it [1/m]
  double length;  // as far as it is known [m]
  double low, high;
  bool high_seen;
};

/// The columns of a side, with a guess of their lengths. @return whether they are sure to hold what the body loses, as far as Sigma tells
bool start_columns(const ColumnJob& job, std::size_t side, std::span<const Panel> panels, std::span<const PanelPoint> sigma, std::vector<Column>& columns) {
  const double sign = side == 0 ? 1.0 : -1.0;
  bool sure = true;
  columns.clear();
  for (const Panel& panel : panels) {
    for (std::uint32_t i = panel.points.begin; i < panel.points.end; ++i) {
      const PanelPoint& p = sigma[i];
      const Vec3 way = sign * job.way;
      const double cosine = sign * p.normal.dot(way), fall = p.fall[side];
      sure = sure && cosine > kLeastFall;
      const double guess = fall > 0.0 ? std::min(p.pressure / fall, job.reach) : job.reach;
      columns.push_back({p.at, way, p.area * cosine, 0.0, guess, 0.0, 0.0, false});
    }
  }
  return sure;
}

/// How ends of columns are looked for.
struct Search {
  double enough, reach;  // of a step; longest one that is believed [m]
  double least_fall;     // cosine of the body's normal to a column
};

/// Newton's method along the columns for the zero of the body's pressure, safeguarded by halving. @return whether all end, and fall as they should there
bool find_ends(PairPressure& pressure, int side, const Search& search, std::vector<Column>& columns) {
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
      const double move = fall > 0.0 ? std::clamp(value[n] / fall, -search.reach, search.reach) : inside ? search.reach : -search.reach;
      double next = column.length + move;
      if (next <= column.low || (column.high_seen && next >= column.high)) next = column.high_seen ? 0.5 * (column.low + column.high) : column.low + search.reach;
      const double moved = std::abs(next - column.length);
      column.length = std::max(next, 0.0);
      if (moved <= search.enough) {
        lead_out = lead_out && fall >= search.least_fall * slope[n].norm();
      } else {
        open[kept++] = open[n];
      }
    }
    open.resize(kept);
  }
  return lead_out && open.empty();
}

/// Points along the columns, and the volumes that they stand for. @param order  of Gauss's rule along a column
void fill_columns(int order, ColumnKinks& kinks, std::span<const Column> columns, PatchPoints& points) {
  for (const Column& column : columns) {
    const std::span<const double> part = kinks.parts(column.from, column.way, column.length);
    const GaussRule& rule = gauss_rule(order_of_parts(order, part));
    for (std::size_t i = 0; i + 1 < part.size(); ++i) {
      const double length = part[i + 1] - part[i];
      for (std::size_t k = 0; k < rule.node.size(); ++k) {
        const double along = part[i] + rule.node[k] * length, wide = 1.0 + along * column.widens;
        points.volume_point.push_back(column.from + along * column.way);
        points.volume_weight.push_back(rule.weight[k] * length * column.share * wide * wide);
      }
    }
  }
}

}  // namespace

void add_columns(const ColumnJob& job, std::span<const Panel> panels, std::span<const PanelPoint> sigma, PatchPoints& points) {
  std::vector<Column> columns;
  std::vector<double> value;
  for (const std::size_t side : {0u, 1u}) {
    if (job.regions[side] == Region::None) continue;
    const bool begun = start_columns(job, side, panels, sigma, columns);
    const bool sure = find_ends(job.pressure, static_cast<int>(side), {job.enough, job.reach, kLeastFall}, columns) && begun;
    points.unsure[side] = points.unsure[side] || !sure;
    if (!sure) continue;
    const std::size_t begin = points.volume_point.size();
    ColumnKinks kinks(job.pressure, static_cast<int>(side), job.error);
    fill_columns(job.order, kinks, columns, points);
    add_to_region(job.pressure, static_cast<int>(side), begin, value, points);
    if (job.regions[side] == Region::Points) continue;
    points.volume_point.resize(begin);
    points.volume_weight.resize(begin);
    points.volume_side.resize(begin);
  }
}

void add_flow(PairPressure& pressure, int side, const Apex& apex, double error, PatchPoints& points) {
  constexpr double kStep = 0.03;  // of a step, over the feature size and the root of the error: ends are off by its square
  const double sign = side == 0 ? 1.0 : -1.0, reach = 0.5 * pressure.feature_size();
  thread_local std::vector<Column> columns;
  thread_local std::vector<double> value;
  columns.clear();
  for (std::size_t i = 0; i < points.point.size(); ++i) {
    const Vec3& at = points.point[i];
    const Vec3 way = apex.way(at);
    columns.push_back({at, way, sign * points.area[i] * points.normal[i].dot(way), 1.0 / apex.distance(at), reach, 0.0, 0.0, false});
  }
  find_ends(pressure, side, {kStep * std::sqrt(error) * reach, reach, 0.0}, columns);
  const std::size_t begin = points.volume_point.size();
  // Columns may go through most of the body: five points hold the pressure of a ball, and two more digits ask for one more.
  ColumnKinks kinks(pressure, side, error);
  fill_columns(std::clamp(static_cast<int>(std::lround(3.5 - 0.5 * std::log10(error))), 5, 9), kinks, columns, points);
  if (apex.lost) fill_body(pressure, side, apex.at, error, points.volume_point, points.volume_weight);
  add_to_region(pressure, side, begin, value, points);
  points.volume_point.resize(begin);
  points.volume_weight.resize(begin);
  points.volume_side.resize(begin);
}

}  // namespace supple::collision
