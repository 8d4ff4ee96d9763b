#include "surface/find_peak.h"

#include <cmath>
#include <numeric>

#include "numbers.h"
#include "pairs/boxes.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr std::size_t kMostHills = 16;
constexpr double kRound = 5e-3;  // of the curvatures: principal directions of less difference depend on rounding

/// What slopes along the axis say. A body so deep in the other that its pressure hardly falls, or rises, from Sigma on has the extent.
void set_depths(PeakFrame& frame, double fall, double rise, double extent) {
  const auto depth = [&](double slope) { return slope * extent > frame.peak ? frame.peak / slope : extent; };
  frame.depth[0] = depth(fall);
  frame.depth[1] = depth(rise);
  frame.thickness = frame.depth[0] + frame.depth[1];
}

/// Of a direction across the axis: that in which the bodies say that it goes.
double sign_of(const PairPressure& pressure, const Vec3& from, const Vec3& axis, const Vec3& direction) {
  const std::optional<Vec3> way = pressure.tangent(from, axis, &direction);
  return way && way->dot(direction) < 0.0 ? -1.0 : 1.0;
}

}  // namespace

Principal principal(double xx, double xy, double yy) {
  const double mean = 0.5 * (xx + yy), half = 0.5 * (xx - yy);
  const double radius = std::sqrt(half * half + xy * xy);
  // Half-angle of (half, xy), without a trigonometric function.
  double c = 1.0, s = 0.0;
  if (radius > 1e-14 * (std::abs(xx) + std::abs(yy))) {
    if (half >= 0.0) {
      c = std::sqrt(0.5 * (1.0 + half / radius));
      s = 0.5 * xy / (radius * c);
    } else {
      s = std::copysign(std::sqrt(0.5 * (1.0 - half / radius)), xy);
      c = 0.5 * xy / (radius * s);
      if (xy == 0.0) c = 0.0;
    }
  }
  return {c, s, mean + radius, mean - radius};
}

void PeakFinder::start_from_seeds(PairPressure& pressure, std::span<const Vec3> seeds, double spacing,
                                  StartPoints& out) {
  out.hill.clear();
  out.inside.clear();
  out.beside.clear();
  batch_.resize(seeds.size());
  std::copy(seeds.begin(), seeds.end(), batch_.point.begin());
  pressure.evaluate(batch_);
  score_.resize(seeds.size());
  // A sample has zero pressure in its own body, so that the sum is what the other body says of it. The round-off of
  // that zero must not turn a sample on both surfaces into an outside one.
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const double a = batch_.a[i] / pressure.modulus(0), b = batch_.b[i] / pressure.modulus(1);
    score_[i] = a + b;
    (std::min(a, b) > -kOnSurface && score_[i] > 0.0 ? out.inside : out.beside).push_back(start_at(i));
  }
  order_.resize(seeds.size());
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [this](std::uint32_t i, std::uint32_t j) {
    return score_[i] != score_[j] ? score_[i] > score_[j] : i < j;
  });
  const double near = 4.0 * spacing * spacing;
  for (std::size_t k = 0; k < order_.size() && out.hill.size() < kMostHills; ++k) {
    const Vec3& x = seeds[order_[k]];
    bool top = true;
    for (std::size_t j = 0; j < k && top; ++j) top = (seeds[order_[j]] - x).squaredNorm() > near;
    if (top) out.hill.push_back(start_at(order_[k]));
  }
}

void PeakFinder::start_from_scan(PairPressure& pressure, const Box& overlap, StartPoints& out) {
  out.hill.clear();
  out.inside.clear();
  out.beside.clear();
  if (overlap.empty() || !is_finite(overlap)) return;
  constexpr int kNodes = 11;
  constexpr double kStep = 1.0 / (kNodes - 1);
  batch_.resize(kNodes * kNodes * kNodes);
  const Vec3 extent = overlap.extent();
  const auto index = [](int i, int j, int k) { return static_cast<std::size_t>((k * kNodes + j) * kNodes + i); };
  for (int k = 0; k < kNodes; ++k) {
    for (int j = 0; j < kNodes; ++j) {
      for (int i = 0; i < kNodes; ++i) {
        batch_.point[index(i, j, k)] = overlap.lower + extent.cwiseProduct(Vec3(i, j, k) * kStep);
      }
    }
  }
  pressure.evaluate(batch_);
  score_.resize(batch_.size());
  for (std::size_t n = 0; n < batch_.size(); ++n) {
    score_[n] = std::min(batch_.a[n], batch_.b[n]);
    if (score_[n] >= 0.0) out.inside.push_back(start_at(n));
  }
  order_.clear();
  for (int k = 0; k < kNodes; ++k) {
    for (int j = 0; j < kNodes; ++j) {
      for (int i = 0; i < kNodes; ++i) {
        const std::size_t here = index(i, j, k);
        bool top = true;
        for (int n = 0; n < 27 && top; ++n) {
          const int x = i + n % 3 - 1, y = j + n / 3 % 3 - 1, z = k + n / 9 - 1;
          if (std::min({x, y, z}) < 0 || std::max({x, y, z}) >= kNodes) continue;
          const std::size_t there = index(x, y, z);
          top = score_[there] < score_[here] || (score_[there] == score_[here] && there >= here);
        }
        if (top) order_.push_back(static_cast<std::uint32_t>(here));
      }
    }
  }
  std::sort(order_.begin(), order_.end(), [this](std::uint32_t i, std::uint32_t j) {
    return score_[i] != score_[j] ? score_[i] > score_[j] : i < j;
  });
  for (std::size_t n = 0; n < order_.size() && n < kMostHills; ++n) out.hill.push_back(start_at(order_[n]));
}

Vec3 PeakFinder::foot_on_sigma(PairPressure& pressure, const Vec3& x, double reach) {
  constexpr int kSteps = 4;
  batch_.resize(1);
  batch_.point[0] = x;
  for (int step = 0; step < kSteps; ++step) {
    pressure.evaluate(batch_);
    step_to_sigma(batch_, reach);
  }
  const Vec3 foot = batch_.point[0];
  batch_.resize(5);
  return foot;
}

/// The axis from the slopes at a place, for the first step. @return a direction across it; nothing where the slopes are the same
std::optional<Vec3> PeakFinder::first_axis(PairPressure& pressure, const Vec3& x, Vec3& axis) {
  batch_.resize(1);
  batch_.point[0] = x;
  pressure.evaluate(batch_);
  axis = batch_.slope_b[0] - batch_.slope_a[0];
  const double norm = axis.norm();
  if (!(norm > 0.0)) return std::nullopt;
  axis /= norm;
  batch_.resize(5);
  return pressure.tangent(x, axis).value_or(axis.unitOrthogonal());
}

/// Evaluates a place and four beside it, h away along u and v.
void PeakFinder::look_around(PairPressure& pressure, const Vec3& x, const Vec3& u, const Vec3& v, double h) {
  batch_.point[0] = x;
  batch_.point[1] = x + h * u;
  batch_.point[2] = x - h * u;
  batch_.point[3] = x + h * v;
  batch_.point[4] = x - h * v;
  pressure.evaluate(batch_);
}

/// Second derivatives of a body's pressure along u and v, by differences of the slopes `h` away.
PeakFinder::Bends PeakFinder::bends_of(int side, const Vec3& u, const Vec3& v, double h) const {
  const std::vector<Vec3>& g = side == 0 ? batch_.slope_a : batch_.slope_b;
  const auto second = [&](std::size_t along, const Vec3& direction) { return (g[2 * along + 1] - g[2 * along + 2]).dot(direction) / (2.0 * h); };
  return {second(0, u), 0.5 * (second(0, v) + second(1, u)), second(1, v)};
}

/// The frame at a place on Sigma with the pressure `frame.peak`.
/// @param curvature  of the pressure on Sigma along u and v   @param gap  of p_A - p_B   @param flattest  curvature that is believed
void PeakFinder::set_frame(PairPressure& pressure, const Tangents& at, const Bends& curvature, const Bends& gap, double flattest, PeakFrame& frame) {
  const Principal p = principal(curvature.uu, curvature.uv, curvature.vv);
  const bool round = p.first - p.second <= kRound * (std::abs(curvature.uu) + std::abs(curvature.vv) + flattest);
  const double cs = round ? 1.0 : p.cosine, sn = round ? 0.0 : p.sine;
  const Vec3 one = cs * at.u + sn * at.v, two = frame.axis.cross(one);
  // Of faces as long as features are; where their rims lie is sought in any case.
  const double face = frame.flat ? 2.0 * frame.peak / (pressure.feature_size() * pressure.feature_size()) : flattest;
  const double scale_u = std::max(std::abs(round ? curvature.uu : p.first), face), scale_v = std::max(std::abs(round ? curvature.vv : p.second), face);
  const double sign_u = sign_of(pressure, frame.origin, frame.axis, one), sign_v = sign_of(pressure, frame.origin, frame.axis, two);
  frame.u = sign_u / std::sqrt(scale_u) * one;
  frame.v = sign_v / std::sqrt(scale_v) * two;
  // Sigma: (p_A - p_B)(x) = 0 with slope -steepness along the axis.
  const double d_uu = gap.uu / at.steepness, d_uv = gap.uv / at.steepness, d_vv = gap.vv / at.steepness;
  frame.height_uu = (cs * cs * d_uu + 2.0 * cs * sn * d_uv + sn * sn * d_vv) / scale_u;
  frame.height_uv = sign_u * sign_v * (-cs * sn * d_uu + (cs * cs - sn * sn) * d_uv + cs * sn * d_vv) / std::sqrt(scale_u * scale_v);
  frame.height_vv = (sn * sn * d_uu - 2.0 * cs * sn * d_uv + cs * cs * d_vv) / scale_v;
}

/// Newton's step to where the pressure is largest along the tangents, where curvatures smaller than the flattest one are not believed.
PeakFinder::Ascent PeakFinder::ascent(const Tangents& at, const Bends& curvature, double flattest, const Vec3& slope) {
  const Principal p = principal(curvature.uu, curvature.uv, curvature.vv);
  const Vec3 first = p.cosine * at.u + p.sine * at.v, other = at.axis.cross(first);
  const double c1 = std::max(std::abs(p.first), flattest), c2 = std::max(std::abs(p.second), flattest);
  const double g1 = slope.dot(first), g2 = slope.dot(other);
  return {(g1 / c1) * first + (g2 / c2) * other, 0.5 * (g1 * g1 / c1 + g2 * g2 / c2), std::min(std::abs(p.first), std::abs(p.second))};
}

std::optional<PeakFrame> PeakFinder::climb(PairPressure& pressure, const Vec3& start, double extent, bool convex, bool stop_on_faces) {
  const double reach = std::min(0.5 * pressure.feature_size(), extent);  // longest step
  const double h = 1e-4 * reach;
  PeakFrame frame;
  Vec3 x = start;
  double before = -kInfinity;  // min(p_A, p_B) and |p_A - p_B| at the last point kept
  double gap_before = 0.0;
  Vec3 kept = start, step = Vec3::Zero();
  bool lifted = false;
  const std::optional<Vec3> along = first_axis(pressure, x, frame.axis);
  if (!along) return std::nullopt;
  for (int iteration = 0; iteration < kBracketSteps; ++iteration) {
    // The tangents come from the normal at the last point; they need not be exact.
    Vec3 u = (*along - along->dot(frame.axis) * frame.axis).normalized();
    look_around(pressure, x, u, frame.axis.cross(u), h);
    const double a = batch_.a[0], b = batch_.b[0], lower = std::min(a, b), gap = std::abs(a - b);
    const Vec3 slope = batch_.slope_a[0] - batch_.slope_b[0];
    const double steepness = slope.norm();
    if (!(steepness > 0.0)) return std::nullopt;
    const Vec3 axis = -slope / steepness;
    const double fall = -batch_.slope_a[0].dot(axis), rise = batch_.slope_b[0].dot(axis);
    const double w = std::clamp(fall / (fall + rise), 0.0, 1.0);
    const double level = (1.0 - w) * a + w * b;  // p at the foot on Sigma, to first order
    // Neither up nor nearer to Sigma.
    if (lower < before && gap > 0.5 * gap_before && step.norm() > 1e-12 * reach) {
      // A long step along a bent Sigma is a good one from where its end has a foot.
      if (!lifted && !convex) {
        x = foot_on_sigma(pressure, x, reach);
      } else {
        step *= 0.5;
        x = kept + step;
      }
      lifted = !lifted;
      continue;
    }
    lifted = false;
    kept = x;
    before = lower;
    gap_before = gap;

    const double noise = pressure.noise(x, steepness);
    u = (u - u.dot(axis) * axis).normalized();
    const Vec3 v = axis.cross(u);
    const Tangents at{u, v, axis, steepness};
    // Weights of the Lagrange function q = (1 - w) p_A + w p_B, whose gradient is tangential to Sigma.
    const Vec3 tangential = (1.0 - w) * batch_.slope_a[0] + w * batch_.slope_b[0];
    const Bends of_a = bends_of(0, u, v, h), of_b = bends_of(1, u, v, h), q = of_a.mixed(of_b, -(1.0 - w), -w);
    // A patch longer than `extent` along a direction of no curvature is not believed.
    const double flattest = 2.0 * std::max(std::abs(level), noise) / (extent * extent);
    const Ascent up = ascent(at, q, flattest, tangential);
    const bool flat = stop_on_faces && level > noise && up.least_curvature <= flattest;
    step = ((a - b) / steepness) * axis;
    if (!flat) step += up.step;
    const bool on_sigma = gap <= 1e-6 * std::abs(level) + noise;
    const bool at_top = up.gain <= 1e-12 * std::abs(level) + 1e-3 * noise;
    frame.axis = axis;
    frame.flat = flat && on_sigma;
    if (frame.flat || (on_sigma && at_top) || iteration + 1 == kBracketSteps) {
      if (level <= pressure.noise_on_sigma(x, fall, rise) || !on_sigma) return std::nullopt;
      frame.origin = x;
      frame.peak = level;
      set_frame(pressure, at, q, of_a.mixed(of_b, 1.0, -1.0), flattest, frame);
      set_depths(frame, fall, rise, extent);
      return frame;
    }
    const double length = step.norm();
    if (length > reach) step *= reach / length;
    x += step;
  }
  return std::nullopt;
}

std::optional<PeakFrame> PeakFinder::find_on_axis(PairPressure& pressure, const CommonAxis& axis, const Vec3& start, double extent) {
  const double reach = std::min(0.5 * pressure.feature_size(), extent);  // longest step
  const Vec3 u = axis.direction.unitOrthogonal();
  PeakFrame frame;
  frame.axis = axis.direction;
  frame.origin = axis.point + (start - axis.point).dot(axis.direction) * axis.direction;
  for (int iteration = 0; iteration < kBracketSteps; ++iteration) {
    batch_.resize(1);
    batch_.point[0] = frame.origin;
    pressure.evaluate(batch_);
    const double a = batch_.a[0], b = batch_.b[0];
    const double fall = -batch_.slope_a[0].dot(frame.axis), rise = batch_.slope_b[0].dot(frame.axis), steepness = fall + rise;
    if (!(steepness > 0.0)) return std::nullopt;
    const double noise = pressure.noise(frame.origin, steepness);
    const double level = (a * rise + b * fall) / steepness;  // p at the foot on Sigma, to first order
    if (std::abs(a - b) > 1e-6 * std::abs(level) + noise) {
      frame.origin += std::clamp((a - b) / steepness, -reach, reach) * frame.axis;
      continue;
    }
    if (level <= pressure.noise_on_sigma(frame.origin, fall, rise)) return std::nullopt;
    // Beside the axis the gradients turn by the second derivatives, the same ones in all directions.
    const double h = 1e-4 * reach;
    batch_.point[0] = frame.origin + h * u;
    pressure.evaluate(batch_);
    const double a_uu = batch_.slope_a[0].dot(u) / h, b_uu = batch_.slope_b[0].dot(u) / h;
    const double curvature = std::max(-(a_uu * rise + b_uu * fall) / steepness, 2.0 * level / (extent * extent));
    frame.peak = level;
    frame.u = u / std::sqrt(curvature);
    frame.v = frame.axis.cross(frame.u);
    set_depths(frame, fall, rise, extent);
    frame.height_uu = frame.height_vv = (a_uu - b_uu) / (steepness * curvature);
    return frame;
  }
  return std::nullopt;
}

}  // namespace supple::collision
