/// What a rule on a smooth patch is off by, from what is known of the patch besides its nodes: the peak, and pressures, slopes and
/// normals at the rim. With them the integral along the radius has a far more exact value than Gauss's.
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "numbers.h"
#include "supple/core/error.h"
#include "supple/core/math.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kShare = 3.0, kShareFinest = 8.0;  // of the radius, over what its exact value says
constexpr double kRises = 2.5;               // of the rim over its chords, over that of a circle
constexpr double kAngles = 6.0;              // over what the angles of the rim say: 5.1 seen with the fewest, 2.7 with more
constexpr double kRim = 4.0;                 // over what is left of the way to it: 2.3 seen

/// Which ends of (0, 1) a rule knows beside the nodes of Gauss's.
struct Known {
  bool centre, centre_slope, centre_bend, rim_slope;  // the value at the rim always
  bool even;                                          // functions of s^2, with `odd` powers from s^3 on; or polynomials of s
  int odd = 0;
};

/// Weights for the integral of f(s) s ds over (0, 1); `centre_bend` is known to be 0 and needs none.
struct EndedRule {
  std::vector<double> node;  ///< over those of Gauss's rule and s
  double centre = 0.0, centre_slope = 0.0, rim = 0.0, rim_slope = 0.0;
};

/// Values of a Legendre polynomial on (0, 1), of its first and second derivatives.
std::array<long double, 3> legendre(int degree, long double t) {
  const long double x = 2.0L * t - 1.0L;
  std::array<long double, 3> here{1.0L, 0.0L, 0.0L}, before{};
  for (int k = 1; k <= degree; ++k) {
    std::array<long double, 3> next;
    for (std::size_t d = 0; d < 3; ++d) {
      next[d] = ((2 * k - 1) * (x * here[d] + (d > 0 ? static_cast<long double>(d) * here[d - 1] : 0.0L)) - (k - 1) * before[d]) / k;
    }
    before = here;
    here = next;
  }
  return {here[0], 2.0L * here[1], 4.0L * here[2]};
}

EndedRule make_ended(const GaussRule& gauss, const Known& known) {
  const std::size_t size = gauss.node.size() + 1 + known.centre + known.centre_slope + known.centre_bend + known.rim_slope;
  // What each function is at the nodes and ends, and its integral.
  Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic> values(size, size);
  Eigen::Matrix<long double, Eigen::Dynamic, 1> integral(size);
  for (std::size_t i = 0; i < size; ++i) {
    // The value of the function and its derivatives in s.
    const auto at = [&](long double s) -> std::array<long double, 3> {
      const std::size_t powers = size - static_cast<std::size_t>(known.odd);
      if (!known.even) return legendre(static_cast<int>(i), s);
      if (i < powers) {
        const std::array<long double, 3> f = legendre(static_cast<int>(i), s * s);
        return {f[0], 2.0L * s * f[1], 2.0L * f[1] + 4.0L * s * s * f[2]};
      }
      const std::size_t power = 3 + 2 * (i - powers);
      long double f = s;
      for (std::size_t k = 2; k < power; ++k) f *= s;
      return {f * s, static_cast<long double>(power) * f, 0.0L};
    };
    const auto row = static_cast<Eigen::Index>(i);
    Eigen::Index column = 0;
    for (const double s : gauss.node) values(row, column++) = at(s)[0];
    if (known.centre) values(row, column++) = at(0.0L)[0];
    if (known.centre_slope) values(row, column++) = at(0.0L)[1];
    if (known.centre_bend) values(row, column++) = at(0.0L)[2];
    values(row, column++) = at(1.0L)[0];
    if (known.rim_slope) values(row, column++) = at(1.0L)[1];
    const GaussRule& fine = gauss_rule(16);
    integral[row] = 0.0L;
    for (std::size_t k = 0; k < fine.node.size(); ++k) integral[row] += static_cast<long double>(fine.weight[k] * fine.node[k]) * at(fine.node[k])[0];
  }
  const Eigen::Matrix<long double, Eigen::Dynamic, 1> weight = values.partialPivLu().solve(integral);
  EndedRule rule;
  Eigen::Index column = 0;
  const auto next = [&] { return static_cast<double>(weight[column++]); };
  for (std::size_t j = 0; j < gauss.node.size(); ++j) rule.node.push_back(next() / (gauss.weight[j] * gauss.node[j]));
  if (known.centre) rule.centre = next();
  if (known.centre_slope) rule.centre_slope = next();
  if (known.centre_bend) ++column;
  rule.rim = next();
  if (known.rim_slope) rule.rim_slope = next();
  return rule;
}

/// Rules for the parts of the sums. Along the axis they are even in s but for the asymmetry of the patch, across it of any parity.
struct EndedRules {
  EndedRule axial, area, force, first;
};
enum Kind : std::uint8_t { Exact, Less, General };  // all that is known; one thing less; polynomials of s all
using EndedSet = std::array<EndedRules, 3>;

/// @param round  the patch is the same all around
const EndedSet& ended_rules(std::size_t r, bool round) {
  static const std::vector<EndedSet> all = [] {
    std::vector<EndedSet> sets;
    for (std::size_t k = 1; k <= kFinestJudged; ++k) {
      const GaussRule& gauss = gauss_rule(polar_rules()[k].radial);
      for (const bool same : {false, true}) {
        const int odd = same ? 0 : k < 3 ? 1 : 2;
        const EndedRule general = make_ended(gauss, {true, true, false, true, false});
        const EndedRule area = make_ended(gauss, {true, true, false, false, false}), first = make_ended(gauss, {true, true, true, true, false});
        sets.push_back({{{make_ended(gauss, {true, false, false, true, true, odd}), make_ended(gauss, {true, false, false, false, true, odd}), general, first},
                         {make_ended(gauss, {false, false, false, true, true, odd}), make_ended(gauss, {false, false, false, false, true, odd}),
                          make_ended(gauss, {true, false, false, true, false}), general},
                         {general, area, general, first}}});
      }
    }
    return sets;
  }();
  return all[2 * (r - 1) + (round ? 1 : 0)];
}

}  // namespace

/// What a rim says that equally spaced angles leave out: the share of the order that they take for the mean, from those of lower orders,
/// as these fall geometrically. By chance, or by symmetry, all of these may be small. The square of what the rule before did not see
/// of the rim, an order of half its angles, says more than enough: it is heeded whole with few orders, else by its geometric mean with them.
double PolarRuleSolver::unseen_by_angles(std::size_t r) const {
  const std::size_t n = rim_.size();
  if (n == 1) return 0.0;
  double mean = 0.0;
  for (const double radius : rim_.radius) mean += radius * radius;
  double most = 0.0;
  for (std::size_t m = 3; 2 * m <= n; ++m) {
    double c = 0.0, s = 0.0;
    for (std::size_t k = 0, at = 0; k < n; ++k) {
      const double square = rim_.radius[k] * rim_.radius[k];
      c += square * rim_.cosine[at];
      s += square * rim_.sine[at];
      at += m;
      if (at >= n) at -= n;
    }
    const double share = (2 * m == n ? 1.0 : 2.0) * std::sqrt(c * c + s * s) / mean;
    if (share > 0.0) most = std::max(most, math::pow(share, static_cast<double>(n) / static_cast<double>(m)));
  }
  const double moved = rim_moved();
  return std::max(most, r == 1 ? moved * moved : moved * std::sqrt(most));
}

/// The densities along rays and at their ends.
PolarRuleSolver::EndedPatch PolarRuleSolver::end_rays(const GaussRule& gauss) const {
  const std::size_t radii = gauss.node.size(), angles = rim_.size();
  const Vec3 origin = frame_.origin, axis = frame_.axis;
  EndedPatch patch;
  const double sector = kTurn / static_cast<double>(angles);
  const Vec3 steep_u = frame_.u / frame_.u.squaredNorm(), steep_v = frame_.v / frame_.v.squaredNorm();
  double left = 0.0, whole = 0.0;
  for (std::size_t k = 0; k < angles; ++k) {
    for (std::size_t j = 0; j < radii; ++j) {
      const std::size_t i = k * radii + j;
      patch.along[j].add(node_.point[i] - origin, normal_[i], area_[i], pressure_[i]);
    }
    const double c = rim_.cosine[k], s = rim_.sine[k], radius = rim_.radius[k], scale = sector * radius * radius * jacobian_;
    const Vec3 reach = radius * direction(c, s);
    patch.centre.add(Vec3::Zero(), axis, scale, frame_.peak);
    patch.centre_slope.first += scale * frame_.peak * reach;
    patch.centre_slope.force -= scale * frame_.peak * radius *
                                ((frame_.height_uu * c + frame_.height_uv * s) * steep_u + (frame_.height_uv * c + frame_.height_vv * s) * steep_v);
    // Over the ray, the slope of p on Sigma where the rim was last looked at, and at the last node before it.
    const std::size_t last = k * radii + radii - 1;
    const Vec3 &a = rim_batch_.slope_a[k], &b = rim_batch_.slope_b[k];
    const AlongAxis sigma(a, b, axis);
    const double slope = sigma.slope(reach);
    const double share = (rim_batch_.point[k] - origin).dot(reach) / reach.squaredNorm(), step = 1.0 - share;
    const double bend = (slope - AlongAxis(node_.slope_a[last], node_.slope_b[last], axis).slope(reach)) / (share - gauss.node.back());
    const double there = sigma.pressure(rim_batch_.a[k], rim_batch_.b[k]);
    const Vec3 across = b - a, normal = across / across.norm(), x = reach + rim_.height[k] * axis;
    const double area = scale / normal.dot(axis), rest = there + step * (slope + 0.5 * bend * step);
    patch.rim.add(x, normal, area, rest);
    patch.rim_slope.add(x, normal, area, slope + bend * step);
    // What the pressure says is left of the way to the rim, and what the last step across the ray adds by the second derivatives.
    const double lift = std::abs((origin + x - rim_batch_.point[k]).dot(axis)), far = (rim_batch_.point[k] - node_.point[last]).norm();
    const double turn = ((a - node_.slope_a[last]).norm() * sigma.up_b - (b - node_.slope_b[last]).norm() * sigma.up_a) / (sigma.rate * far);
    left += 2.0 * radius * radius * (std::abs(rest) + turn * lift * (std::abs(step) * reach.norm() + 0.5 * lift)) / std::abs(slope);
    whole += radius * radius;
  }
  patch.left = left / whole;
  return patch;
}

/// What force, area and centre of pressure of rule r are off by at most on a patch that no kink crosses.
double PolarRuleSolver::estimate_by_ends(std::size_t r, bool round) const {
  SUPPLE_EXPECTS(r >= 1 && r <= kFinestJudged);
  const GaussRule& gauss = gauss_rule(polar_rules()[r].radial);
  const Vec3 axis = frame_.axis;
  const EndedPatch patch = end_rays(gauss);
  const EndedSet& rules = ended_rules(r, round);
  std::array<PatchSums, 3> sums;
  for (std::size_t kind = 0; kind < sums.size(); ++kind) {
    // Area has no slope at the rim, which its rule does not ask for.
    const auto sum = [&](const EndedRule& rule, const auto& part) {
      auto all = (rule.centre * part(patch.centre) + rule.centre_slope * part(patch.centre_slope) + rule.rim * part(patch.rim) + rule.rim_slope * part(patch.rim_slope));
      for (std::size_t j = 0; j < gauss.node.size(); ++j) all += rule.node[j] * part(patch.along[j]);
      return all;
    };
    PatchSums& to = sums[kind];
    const EndedRules& rule = rules[kind];
    to.load = sum(rule.axial, [](const Density& d) { return d.load; });
    to.area = sum(rule.area, [](const Density& d) { return d.area; });
    const auto both = [&](const EndedRule& across_axis, Vec3 Density::*part) -> Vec3 {
      const double up = sum(rule.axial, [&](const Density& d) { return (d.*part).dot(axis); });
      Vec3 all = up * axis;
      if (round) return all;
      for (const Vec3& side : {frame_.u, frame_.v}) {
        all += sum(across_axis, [&](const Density& d) { return (d.*part).dot(side); }) / side.squaredNorm() * side;
      }
      return all;
    };
    to.force = both(rule.force, &Density::force);
    to.first = both(rule.first, &Density::first);
  }
  const double off = std::max(relative_difference(fine_, sums[Exact]), relative_difference(fine_, sums[General]));
  const double share = r == kFinestJudged ? kShareFinest : kShare;
  return share * (off + relative_difference(sums[Exact], sums[Less])) + kAngles * unseen_by_angles(r) + kRim * patch.left + 2.0 * placing_error();
}

/// Whether certainly no kink crosses the patch, as the fields tell them all. The patch lies within `off` of the convex hull of its peak and of
/// points of its rim, and s of every kink is convex. So where s + change(., off) < 0 at these points, it is on the whole patch; and s > 0 there
/// where a tangent of s, which lies below it, is beyond |grad s| off at all of them.
bool PolarRuleSolver::clear_of_kinks(PairPressure& pressure) {
  const std::size_t n = rim_.size(), radii = node_.size() / n;
  if (n == 1) return false;
  const GaussRule& gauss = gauss_rule(static_cast<int>(radii));
  double longest = 0.0, highest = 0.0, sag = 0.0, bends = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double c = rim_.cosine[k], s = rim_.sine[k], radius = rim_.radius[k], height = rim_.height[k];
    longest = std::max(longest, radius * radius * direction(c, s).squaredNorm());
    highest = std::max(highest, std::abs(height));
    // Heights leave the chord from the peak to the rim by the parts of x^2 and x^4, as x - x^2 and x - x^4 are at most 1/4 and 0.48, and by what these miss.
    const double square = 0.5 * radius * radius * (frame_.height_uu * c * c + 2.0 * frame_.height_uv * c * s + frame_.height_vv * s * s);
    const double fourth = height - square;
    sag = std::max(sag, 0.25 * std::abs(square) + 0.48 * std::abs(fourth));
    for (std::size_t j = 0; j < radii; ++j) {
      const double r2 = gauss.node[j] * gauss.node[j];
      bends = std::max(bends, std::abs(height_[k * radii + j] - r2 * (square + r2 * fourth)));
    }
  }
  longest = std::sqrt(longest);
  // Between points of `fine_rim_` a circle rises over the chord by 1 - cos of half their angle, and heights that go up and down twice by four
  // times as much.
  const double rise = 1.0 - math::sin_cos(0.25 * std::numbers::pi / static_cast<double>(n)).cos;
  const double off = sag + kRises * (bends + rise * (longest + 4.0 * highest)) + rim_moved() * (longest + highest);
  const double reach = longest + highest + off;
  near_kinks_.clear();
  if (!pressure.kinks({frame_.origin - Vec3::Constant(reach), frame_.origin + Vec3::Constant(reach)}, near_kinks_)) return false;
  std::erase_if(near_kinks_, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
  if (near_kinks_.empty()) return true;
  if (kinks_.empty()) follow_rim();  // else it was followed to see whether they cross
  fine_rim_.push_back(frame_.origin);
  return std::all_of(near_kinks_.begin(), near_kinks_.end(), [&](const implicit::Kink& kink) {
    const auto all = [&](const auto& holds) { return std::all_of(fine_rim_.begin(), fine_rim_.end(), holds); };
    if (all([&](const Vec3& x) { return kink.value(x) + kink.change(x, off) < 0.0; })) return true;
    const Vec3& nearest = *std::min_element(fine_rim_.begin(), fine_rim_.end(), [&](const Vec3& x, const Vec3& y) { return kink.value(x) < kink.value(y); });
    Vec3 slope;
    const double least = kink.value(nearest, slope) - slope.norm() * off;
    return least > 0.0 && all([&](const Vec3& x) { return least + slope.dot(x - nearest) > 0.0; });
  });
}

}  // namespace supple::collision
