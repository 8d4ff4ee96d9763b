#include "surface/region/polar_columns.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "numbers.h"
#include "surface/accuracy.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

constexpr double kUpright = 0.3;      // cosine of a body's normal to the columns at the rim: nearer to grazing, they are long beside it
constexpr double kWidest = 1.3;      // across over along at the rim: energies by wider columns are off by more than asked
constexpr double kEndsWithin = 1e-3;  // of the peak: ends beside the rim are that near to the other body's surface
constexpr double kLong = 1.5;         // over the depth below the peak, to first order
constexpr int kMostOnColumn = 6;

}  // namespace

/// Spreads the columns of both sides as far as the bodies lean away at the rim.
bool PatchColumns::reach_rim(const PeakFrame& frame, const AlongAxis& sigma, const Vec3& across) {
  const double norm_a = sigma.slope_a.norm(), norm_b = sigma.slope_b.norm();
  if (!(-sigma.up_a > kUpright * norm_a) && !widen(frame, 0, sigma.slope_a / -norm_a, across)) return false;
  return sigma.up_b > kUpright * norm_b || widen(frame, 1, sigma.slope_b / -norm_b, across);
}

/// Columns that hold the squeezed region of a body so deep that it is wider beyond Sigma spread so far that it falls away from them at the rim.
/// @param outward  normal of the body at the rim   @param across  from the axis to the rim
bool PatchColumns::widen(const PeakFrame& frame, int side, const Vec3& outward, const Vec3& across) {
  const double cosine = (side == 0 ? 1.0 : -1.0) * outward.dot(frame.axis);
  const double far = across.norm(), sight = outward.dot(across) / far, aim = std::min(kUpright, 0.5 * sight);
  if (!(sight > kLeastSight)) return cosine > kLeastSight;
  const double widened = (aim - cosine) / (sight - aim);
  spread_[side] = std::max(spread_[side], widened / far);
  widest_[side] = std::max(widest_[side], widened);
  return true;
}

/// Distance from Sigma along the columns of a side, by their ways, to where the body's pressure vanishes; the last entry is the
/// column through the peak.
/// @param tolerance  of the last step, over the thickness   @param inside  the same of steps from where there is pressure
bool PatchColumns::find_ends(PairPressure& pressure, const PatchNodes& patch, int side, double tolerance, double inside) {
  const std::size_t n = patch.at.size() + 1;
  std::vector<double>& end = end_[side];
  end.resize(n);
  line_point_.resize(n);
  line_value_.resize(n);
  line_slope_.resize(n);
  low_.assign(n, 0.0);
  high_.assign(n, patch.extent);
  const double floor = 16.0 * kEpsilon * pressure.modulus(side);
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const Vec3& g = side == 0 ? patch.at.slope_a[i] : patch.at.slope_b[i];
    const double fall = -g.dot(column(i).way);
    end[i] = fall * patch.frame.depth[side] > 0.5 * patch.pressure[i] ? patch.pressure[i] / fall : 2.0 * patch.frame.depth[side];
  }
  end[n - 1] = patch.frame.depth[side];
  reached_.resize(n);
  open_.resize(n);
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int iteration = 0; iteration < kBracketSteps; ++iteration) {
    for (const std::size_t i : open_) {
      reached_[i] = end[i];
      line_point_[i] = (i + 1 < n ? patch.at.point[i] : patch.peak) + end[i] * column(i).way;
    }
    evaluate_on_lines(pressure, side);
    std::erase_if(open_, [&](std::size_t i) {
      const double fall = -line_slope_[i].dot(column(i).way), newton = end[i] + line_value_[i] / fall;
      (line_value_[i] > 0.0 ? low_[i] : high_[i]) = end[i];
      // Where a body is deep its pressure rises first; far beyond its surface the support may have ended.
      const double next = fall > 0.0 && newton >= low_[i] && newton <= high_[i] ? newton : 0.5 * (low_[i] + high_[i]);
      const double enough = line_value_[i] >= 0.0 ? inside : tolerance;
      const bool near = std::abs(next - end[i]) <= enough * patch.frame.thickness || std::abs(line_value_[i]) <= floor;
      end[i] = next;
      return near;
    });
    if (open_.empty()) return true;
  }
  return false;
}

/// Values and slopes of one body at the open points of lines.
void PatchColumns::evaluate_on_lines(PairPressure& pressure, int side) {
  const std::size_t n = open_.size();
  if (n == line_point_.size()) return pressure.evaluate(side, line_point_, line_value_, line_slope_);
  some_.resize(n);
  for (std::size_t k = 0; k < n; ++k) some_.point[k] = line_point_[open_[k]];
  pressure.evaluate(side, some_.point, some_.a, some_.slope_a);
  for (std::size_t k = 0; k < n; ++k) {
    line_value_[open_[k]] = some_.a[k];
    line_slope_[open_[k]] = some_.slope_a[k];
  }
}

/// Ways of the columns of a side, and how what they enclose widens; the last one is that through the peak. @return false where two of them meet
bool PatchColumns::start(const PatchNodes& patch, int side) {
  const std::size_t n = patch.at.size();
  const double sign = side == 0 ? 1.0 : -1.0, spread = spread_[side];
  column_.assign(spread == 0.0 ? 1 : n + 1, {sign * patch.frame.axis, {{1.0, 0.0, 0.0}}});
  if (spread == 0.0) return true;
  for (std::size_t i = 0; i <= n; ++i) {
    const Vec3 d = (i < n ? patch.at.point[i] : patch.peak) - patch.frame.origin, across = d - d.dot(patch.frame.axis) * patch.frame.axis;
    Column& along = column_[i];
    along.way += spread * across;
    const double narrow = i < n ? 1.0 + sign * spread * patch.normal[i].dot(across) / patch.normal[i].dot(patch.frame.axis) : 1.0;
    if (!(narrow > 0.0)) return false;
    along.swept = {{narrow, spread * (1.0 + narrow), spread * spread}};
  }
  return true;
}

/// Whether the body's pressure falls along all columns from where they begin. Where it rises first, Sigma lies beyond the middle of a body that may end
/// elsewhere, too.
bool PatchColumns::lead_out(const PatchNodes& patch, int side) const {
  const std::vector<Vec3>& slope = side == 0 ? patch.at.slope_a : patch.at.slope_b;
  for (std::size_t i = 0; i < patch.at.size(); ++i) {
    const Vec3& way = column(i).way;
    if (!(-slope[i].dot(way) > kLeastFall * slope[i].norm() * way.norm())) return false;
  }
  return true;
}

/// Whether columns that are long end within the other body. A body that reaches around it may press on from the near side of it to the far
/// one: columns then lead through it to where that ends elsewhere.
bool PatchColumns::end_within(PairPressure& pressure, const PatchNodes& patch, int side) {
  line_point_.clear();
  for (std::size_t i = 0; i < patch.at.size(); ++i) {
    if (end_[side][i] > kLong * patch.frame.depth[side]) line_point_.push_back(patch.at.point[i] + end_[side][i] * column(i).way);
  }
  other_value_.resize(line_point_.size());
  pressure.evaluate(1 - side, line_point_, other_value_);
  const double least = -kEndsWithin * patch.frame.peak;
  return std::all_of(other_value_.begin(), other_value_.end(), [least](double p) { return p >= least; });
}

/// Whether a convex body comes out of the other one beyond this patch: then it has another patch there, where what it loses ends, too. Sought from columns
/// at whose end the pressure of the other body falls. @param ended  the columns are there; else lines along the axis
bool PatchColumns::goes_through(PairPressure& pressure, const PatchNodes& patch, int side, bool ended) {
  constexpr std::size_t kFew = 8;
  const std::size_t n = patch.at.size(), stride = (n + kFew - 1) / kFew;
  const Vec3 axis = (side == 0 ? 1.0 : -1.0) * patch.frame.axis;
  const auto way = [&](std::size_t i) { return ended ? column(i).way : axis; };
  open_.clear();
  for (std::size_t i = 0; i < n; i += stride) open_.push_back(i);
  open_.push_back(n);
  some_.resize(open_.size());
  std::vector<double> length, low(open_.size(), 0.0), high(open_.size(), kInfinity);
  for (const std::size_t i : open_) length.push_back(ended ? end_[side][i] : patch.frame.depth[side]);
  const auto place = [&] {
    for (std::size_t k = 0; k < open_.size(); ++k) some_.point[k] = (open_[k] < n ? patch.at.point[open_[k]] : patch.peak) + length[k] * way(open_[k]);
  };
  place();
  for (int step = 0; step < kFreeSteps && !ended; ++step) {
    pressure.evaluate(side, some_.point, some_.a, some_.slope_a);
    for (std::size_t k = 0; k < open_.size(); ++k) {
      (some_.a[k] > 0.0 ? low : high)[k] = length[k];
      const double fall = -some_.slope_a[k].dot(axis), newton = length[k] + some_.a[k] / fall;
      length[k] = fall > 0.0 && newton > low[k] && newton < high[k] ? std::min(newton, length[k] + patch.frame.depth[side])
                  : std::isfinite(high[k])                          ? 0.5 * (low[k] + high[k])
                                                                    : length[k] + patch.frame.depth[side];
    }
    place();
  }
  pressure.evaluate(1 - side, some_.point, some_.b, some_.slope_b);
  for (std::size_t k = 0; k < open_.size(); ++k) {
    if (some_.slope_b[k].dot(way(open_[k])) < 0.0 && comes_out(pressure, -kEndsWithin * patch.frame.peak, side, some_.point[k])) return true;
  }
  return false;
}

/// Whether the surface of a body leaves the other one near a place of it: by the place where their normals are the same, which is farthest out.
bool PatchColumns::comes_out(PairPressure& pressure, double out, int side, Vec3 at) {
  constexpr double kNear = 1e-3, kAlike = 1e-3;  // to the surface, of the feature size; between normals
  const double size = pressure.feature_size();
  for (int step = 0; step < kBracketSteps; ++step) {
    Vec3 slope, other_slope;
    const double own = pressure.value(side, at, slope), other = pressure.value(1 - side, at, other_slope);
    const double steep = slope.norm(), other_steep = other_slope.norm();
    if (!(steep > 0.0)) return false;
    const Vec3 normal = -slope / steep;
    const double off = own / steep;
    const bool on_surface = std::abs(off) <= kNear * size;
    if (on_surface && other < out) return true;
    if (!(other_steep > 0.0)) return false;
    const Vec3 aim = -other_slope / other_steep, across = aim - aim.dot(normal) * normal;
    if (on_surface && across.norm() < kAlike) return false;
    at += std::clamp(off, -size, size) * normal + size * across;
  }
  return true;
}

/// The columns of one side. @return the length of the one at the summit; nothing where columns do not fit
std::optional<double> PatchColumns::add_side(PairPressure& pressure, const PatchNodes& patch, const Asked& asked, int side, PatchPoints& points) {
  const bool convex = pressure.field(side).convex();
  const Region region = asked.regions[static_cast<std::size_t>(side)];
  if (region == Region::None) {
    if (asked.may_go_through && convex && goes_through(pressure, patch, side, false)) return std::nullopt;
    return 0.5 * patch.frame.thickness;
  }
  const auto leave = [&] {
    points.unsure[side] = true;
    return patch.frame.depth[side];
  };
  const bool fits = widest_[side] <= kWidest && start(patch, side);
  if (!convex && !(fits && lead_out(patch, side))) return leave();
  if (!fits) return std::nullopt;
  const int nodes = spread_[side] > 0.0 ? kMostOnColumn : asked.nodes;
  // The length is off by the square of the last step. From beyond the surface, where a kernel may change its formula, the slope is by as much as the place.
  const double inside = std::min(1e-3, 0.1 * std::sqrt(asked.error));
  const bool from_ends = region == Region::Sums;
  if (!find_ends(pressure, patch, side, from_ends ? std::min(1e-3, asked.error) : inside, inside)) return std::nullopt;
  if (!convex && !end_within(pressure, patch, side)) return leave();
  if (asked.may_go_through && convex && goes_through(pressure, patch, side, true)) return std::nullopt;
  if (from_ends) {
    add_energy_from_ends(pressure, patch, nodes, side, points);
  } else {
    add_points(pressure, patch, nodes, side, points);
  }
  return end_[side][patch.summit];
}

std::optional<double> PatchColumns::add(PairPressure& pressure, const PatchNodes& patch, const Asked& asked, PatchPoints& points) {
  double thickness = 0.0;
  for (const int side : {0, 1}) {
    const std::optional<double> length = add_side(pressure, patch, asked, side, points);
    if (!length) return std::nullopt;
    thickness += *length;
  }
  return thickness;
}

/// Volume and energy of a side, these by the pressures and slopes at both ends of the columns, and by some between.
void PatchColumns::add_energy_from_ends(PairPressure& pressure, const PatchNodes& patch, int nodes, int side, PatchPoints& points) {
  const std::size_t n = patch.at.size();
  const TwoEndRule& rule = two_end_rule(nodes - 2);
  const std::size_t between = rule.node.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& begins = side == 0 ? patch.at.slope_a[i] : patch.at.slope_b[i];
    const Column& along = column(i);
    points.displaced[side] += patch.weight[i] * along.swept.volume(end_[side][i]);
    const double length = reached_[i], last = line_value_[i], slope = line_slope_[i].dot(along.way);
    const double rest = -0.5 * last * last / slope;  // to where the pressure vanishes
    const double width = along.swept.width(0.0), width_there = along.swept.width(length);
    const double first_slope = begins.dot(along.way) * width + patch.pressure[i] * along.swept.widens(0.0);
    const double last_slope = slope * width_there + last * along.swept.widens(length);
    const double sum = rule.end * (patch.pressure[i] * width + last * width_there) + rule.slope * length * (first_slope - last_slope);
    points.energy[side] += patch.weight[i] * (length * sum + rest * width_there);
  }
  if (between == 0) return;
  line_point_.resize(n * between);
  line_value_.resize(n * between);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < between; ++j) line_point_[i * between + j] = patch.at.point[i] + (reached_[i] * rule.node[j]) * column(i).way;
  }
  pressure.evaluate(side, line_point_, line_value_);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < between; ++j) {
      const double width = column(i).swept.width(reached_[i] * rule.node[j]);
      points.energy[side] += patch.weight[i] * reached_[i] * rule.weight[j] * width * line_value_[i * between + j];
    }
  }
}

/// Points of a squeezed region, and its sums by them.
void PatchColumns::add_points(PairPressure& pressure, const PatchNodes& patch, int nodes, int side, PatchPoints& points) {
  const std::size_t n = patch.at.size();
  const GaussRule& gauss = gauss_rule(nodes);
  const std::size_t begin = points.volume_point.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double length = end_[side][i];
    for (std::size_t j = 0; j < gauss.node.size(); ++j) {
      points.volume_point.push_back(patch.at.point[i] + (length * gauss.node[j]) * column(i).way);
      points.volume_weight.push_back(patch.weight[i] * length * gauss.weight[j] * column(i).swept.width(length * gauss.node[j]));
    }
  }
  add_to_region(pressure, side, begin, line_value_, points);
}

}  // namespace supple::collision
