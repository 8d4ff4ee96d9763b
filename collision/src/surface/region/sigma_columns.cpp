#include <algorithm>
#include <cmath>

#include "surface/panels/panel_rule.h"
#include "surface/quadrature.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

/// A line from a place of Sigma to where a body ends.
struct Column {
  Vec3 from;
  double share;   // of the area across it [m^2]
  double length;  // as far as it is known [m]
  double low, high;
  bool high_seen;
};

/// Newton's method along the columns for the zero of the body's pressure, safeguarded by halving. @return whether all of them lead out
bool find_ends(const ColumnJob& job, int side, const Vec3& way, std::vector<Column>& columns) {
  constexpr int kMostSteps = 40;
  std::vector<std::size_t> open;
  std::vector<Vec3> point, slope;
  std::vector<double> value;
  for (std::size_t i = 0; i < columns.size(); ++i) open.push_back(i);
  bool lead_out = true;
  for (int step = 0; step < kMostSteps && !open.empty(); ++step) {
    point.clear();
    for (const std::size_t i : open) point.push_back(columns[i].from + columns[i].length * way);
    value.resize(point.size());
    slope.resize(point.size());
    job.pressure.evaluate(side, point, value, slope);
    std::size_t kept = 0;
    for (std::size_t n = 0; n < open.size(); ++n) {
      Column& column = columns[open[n]];
      const double fall = -slope[n].dot(way);
      const bool inside = value[n] > 0.0;
      (inside ? column.low : column.high) = column.length;
      column.high_seen = column.high_seen || !inside;
      const double move = fall > 0.0 ? std::clamp(value[n] / fall, -job.reach, job.reach) : inside ? job.reach : -job.reach;
      double next = column.length + move;
      if (next <= column.low || (column.high_seen && next >= column.high)) next = column.high_seen ? 0.5 * (column.low + column.high) : column.low + job.reach;
      const double moved = std::abs(next - column.length);
      column.length = std::max(next, 0.0);
      if (moved <= job.enough) {
        lead_out = lead_out && fall >= kLeastFall * slope[n].norm();
      } else {
        open[kept++] = open[n];
      }
    }
    open.resize(kept);
  }
  return lead_out && open.empty();
}

}  // namespace

void add_columns(const ColumnJob& job, std::span<const Panel> panels, std::span<const PanelPoint> sigma, PatchPoints& points) {
  const GaussRule& rule = gauss_rule(job.order);
  std::vector<Column> columns;
  std::vector<double> value;
  for (const int side : {0, 1}) {
    if (job.regions[static_cast<std::size_t>(side)] == Region::None) continue;
    const Vec3 way = side == 0 ? job.way : Vec3(-job.way);
    columns.clear();
    bool sure = true;
    for (const Panel& panel : panels) {
      for (std::uint32_t i = panel.points.begin; i < panel.points.end; ++i) {
        const PanelPoint& p = sigma[i];
        const double cosine = p.normal.dot(job.way), fall = p.fall[static_cast<std::size_t>(side)];
        sure = sure && cosine > kLeastFall;
        columns.push_back({p.at, p.area * cosine, fall > 0.0 ? std::min(p.pressure / fall, job.reach) : job.reach, 0.0, 0.0, false});
      }
    }
    sure = find_ends(job, side, way, columns) && sure;
    points.unsure[side] = points.unsure[side] || !sure;
    if (!sure) continue;
    const std::size_t begin = points.volume_point.size();
    for (const Column& column : columns) {
      for (std::size_t k = 0; k < rule.node.size(); ++k) {
        points.volume_point.push_back(column.from + rule.node[k] * column.length * way);
        points.volume_weight.push_back(rule.weight[k] * column.length * column.share);
      }
    }
    add_to_region(job.pressure, side, begin, value, points);
    if (job.regions[static_cast<std::size_t>(side)] == Region::Points) continue;
    points.volume_point.resize(begin);
    points.volume_weight.resize(begin);
    points.volume_side.resize(begin);
  }
}

}  // namespace supple::collision
