/// Polar quadrature of a patch that kinks of a field cross. Along a ray from the peak the pressures are smooth between
/// kinks: Gauss-Legendre on each piece. The integral along a ray is smooth in the angle but where a kink meets the rim or
/// touches the ray: Gauss-Kronrod on panels between the former, halved where the two rules of a panel differ.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "polar_rule.h"
#include "supple/core/math.h"

namespace supple::collision {
namespace {

constexpr double kWidest = 2.2;          // panel at the beginning [rad]
constexpr double kWidestCoarse = 3.3;
constexpr int kMostRadial = 16;
constexpr int kFewest = 3;
constexpr double kUnseen = 0.03;         // of the error asked for: slivers beyond a kink between two rays
constexpr double kEnough = 0.9;          // leaves room for that and for Newton's method
constexpr std::size_t kMostPanels = 48, kMostBesideThirds = 192;  // that the estimate may ask for
constexpr double kBesideThirds = 4.0;    // rays may touch a third body anywhere on a face, where rules converge slowly
constexpr int kSamples = 8;              // of the heights along a ray, to find crossings
constexpr int kCornerSteps = 8;
constexpr int kCrossingSteps = 6;
constexpr double kSameTurn = 1e-7;       // [rad]
constexpr double kLeastAlong = 0.5;      // cosine between the rim and the line to its next point
constexpr double kLeastSight = 0.1;      // cosine between a ray and the normal of the rim: nearer to grazing, rays begin elsewhere
constexpr double kMostChange = 2.0;      // of the radius, over what its slopes say
constexpr double kTurn = 2.0 * std::numbers::pi;

/// Points of the Gauss rule on a piece of a ray.
int nodes_on(int radial, double share) {
  return std::clamp(static_cast<int>(std::ceil(radial * (0.35 + 0.65 * share))), 2, kMostRadial);
}

/// Points that are compared with n.
int check_of(int n) { return n > 4 ? n - 2 : n - 1; }

/// Kinks so near to another, to the peak or to the rim are left out: the error is of the square.
double shortest_piece(double error) { return 3e-3 * std::sqrt(error); }

void weigh(PatchSums& sums, const Vec3& x, const Vec3& normal, double weight, double pressure) {
  if (weight != 0.0) sums.add(x, normal, weight, pressure);
}

/// Of force, area and first moment, over those of `all`.
double share_of_difference(const PatchSums& a, const PatchSums& b, const PatchSums& all) {
  const double force = (a.force - b.force).norm() / std::max(all.force.norm(), 1e-3 * all.load);
  const double area = std::abs(a.area - b.area) / all.area;
  const Vec3 first = (a.first - b.first) - (a.load - b.load) * all.centre();
  return std::max({force, area, first.norm() / (all.load * std::sqrt(all.area))});
}

/// What the finer of two rules is off by at most, which differ by x. On panels that were never halved it converges faster
/// than the coarser one, as in QUADPACK (Piessens et al. 1983, sec. 2.2.4.1); the few points of the coarsest rules, and
/// panels at the end of a crossing, are not that regular.
constexpr double kRegular = 2000.0;
/// Sectors of faces, whose pressure is not smooth in the direction where rays pass corners of the cores, are trusted so far only.
constexpr double kLeastOnFaces = 0.05;
double estimate_of(double regular, double halved, bool fine, double least) {
  constexpr double kHalf = 0.5;
  const double share = fine ? std::clamp(std::sqrt(kRegular * regular), least, 1.0) : kHalf;
  return share * regular + kHalf * halved;
}
/// The difference that an error allows.
double difference_for(double error, bool fine, double least) {
  return fine ? std::max(error, std::min(std::cbrt(error * error / kRegular), error / least)) : error;
}

}  // namespace

/// Whether there are certainly none where the rim may be, which is kept in `smooth_`.
bool PolarRuleSolver::no_kinks_near(PairPressure& pressure) {
  constexpr double kReach = 1.5;  // of the rim, over what the curvature of the pressure says
  const double square = 2.0 * kReach * kReach * frame_.peak;
  const double height = std::abs(frame_.height_uu) + 2.0 * std::abs(frame_.height_uv) + std::abs(frame_.height_vv);
  const Vec3 across = (square * (frame_.u.cwiseAbs2() + frame_.v.cwiseAbs2())).cwiseSqrt();
  const Vec3 half = across + 0.5 * square * height * frame_.axis.cwiseAbs();
  smooth_ = {frame_.origin - half, frame_.origin + half};
  kinks_.clear();
  const bool known = pressure.kinks(smooth_, kinks_);
  const double reach = half.norm();
  const bool near = std::any_of(kinks_.begin(), kinks_.end(), [&](const implicit::Kink& kink) {
    return std::abs(kink.value(frame_.origin)) <= kink.change(frame_.origin, reach);
  });
  kinks_.clear();
  return known && !near;
}

void PolarRuleSolver::find_kinks(PairPressure& pressure) {
  kinks_.clear();
  Box box;
  for (const Vec3& x : rim_batch_.point) {
    box.include(x);
    if (rim_.size() > 1) continue;  // the ray stands for those all around
    const Vec3 reach = Vec3::Constant((x - frame_.origin).norm());
    box.include(frame_.origin - reach);
    box.include(frame_.origin + reach);
  }
  for (const Vec3& x : node_.point) box.include(x);
  pressure.kinks(box, kinks_);
  double square = 0.0;
  for (const Vec3& x : rim_batch_.point) square = std::max(square, (x - frame_.origin).squaredNorm());
  constexpr double kMargin = 1.2;  // what finer rules may find the rim to reach beyond
  const double reach = kMargin * std::sqrt(square);
  std::erase_if(kinks_, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Pressures of the third bodies at points, and their slopes.
void PolarRuleSolver::evaluate_thirds(std::span<const Vec3> points) {
  const std::size_t n = points.size();
  third_value_.resize(third_.size() * n);
  third_slope_.resize(third_.size() * n);
  for (std::size_t t = 0; t < third_.size(); ++t) {
    const auto value = std::span(third_value_).subspan(t * n, n);
    const auto slope = std::span(third_slope_).subspan(t * n, n);
    third_[t]->field.evaluate(points, value, slope);
    for (double& v : value) v *= third_[t]->material.modulus;
    for (Vec3& g : slope) g *= third_[t]->material.modulus;
  }
}

/// s of a kink; of a third body, how much harder than the pair it presses where the axis through x meets Sigma, to first order.
double PolarRuleSolver::side_of(std::size_t kink, PairPressure& pressure, const Vec3& x) {
  if (kink < kinks_.size()) return kinks_[kink].value(x);
  const ContactBody& body = *third_[kink - kinks_.size()];
  const double share = frame_.depth[0] / frame_.thickness;
  double a, b;
  pressure.evaluate(0, {&x, 1}, {&a, 1});
  pressure.evaluate(1, {&x, 1}, {&b, 1});
  return body.material.modulus * body.field.value(x) - (share * a + (1.0 - share) * b);
}

/// The same with its slope at point i of a batch, for which the third bodies have been evaluated.
double PolarRuleSolver::side_of(std::size_t kink, const PressureBatch& at, std::size_t i, Vec3& slope) const {
  if (kink < kinks_.size()) return kinks_[kink].value(at.point[i], slope);
  const std::size_t k = (kink - kinks_.size()) * at.size() + i;
  const double share = frame_.depth[0] / frame_.thickness;
  slope = third_slope_[k] - (share * at.slope_a[i] + (1.0 - share) * at.slope_b[i]);
  return third_value_[k] - (share * at.a[i] + (1.0 - share) * at.b[i]);
}

/// Whether third bodies press harder than the pair all over the patch, as far as its nodes and the rim show.
bool PolarRuleSolver::taken_by_thirds() {
  const auto taken = [this](std::size_t n, std::size_t i, double p) {
    for (std::size_t t = 0; t < third_.size(); ++t) {
      if (third_value_[t * n + i] > p) return true;
    }
    return false;
  };
  evaluate_thirds(node_.point);
  for (std::size_t i = 0; i < node_.size(); ++i) {
    if (!taken(node_.size(), i, pressure_[i])) return false;
  }
  follow_rim();
  evaluate_thirds(fine_rim_);
  for (std::size_t i = 0; i < fine_rim_.size(); ++i) {
    if (!taken(fine_rim_.size(), i, 0.0)) return false;
  }
  return true;
}

/// Whether some change their side on the patch, as far as its nodes show and the rim as they give it; keeps which.
bool PolarRuleSolver::kinks_cross() {
  crossing_.clear();
  if (kinks_.empty() && third_.empty()) return false;
  follow_rim();
  for (std::size_t k = 0; k < kinks_.size(); ++k) {
    const bool side = kinks_[k].value(frame_.origin) > 0.0;
    const auto other = [&](const Vec3& x) { return (kinks_[k].value(x) > 0.0) != side; };
    if (std::any_of(fine_rim_.begin(), fine_rim_.end(), other) ||
        std::any_of(node_.point.begin(), node_.point.end(), other)) {
      crossing_.push_back(k);
    }
  }
  if (third_.empty()) return !crossing_.empty();
  thirds_seen_.assign(third_.size(), 0);
  const auto look = [this](std::size_t n, std::size_t i, double p) {
    for (std::size_t t = 0; t < third_.size(); ++t) thirds_seen_[t] |= third_value_[t * n + i] > p ? 1 : 2;
  };
  evaluate_thirds(node_.point);
  for (std::size_t i = 0; i < node_.size(); ++i) look(node_.size(), i, pressure_[i]);
  evaluate_thirds(fine_rim_);
  for (std::size_t i = 0; i < fine_rim_.size(); ++i) look(fine_rim_.size(), i, 0.0);
  for (std::size_t t = 0; t < third_.size(); ++t) {
    if (thirds_seen_[t] == 3) crossing_.push_back(kinks_.size() + t);
  }
  return !crossing_.empty();
}

/// The rim found so far as a trigonometric sum, and points of it that leave no room for a kink between them.
void PolarRuleSolver::follow_rim() {
  const std::size_t n = rim_.size(), half = n / 2;
  for (const int which : {0, 1}) {
    const std::vector<double>& f = which == 0 ? rim_.radius : rim_.height;
    std::vector<double>& out = wave_[which];
    out.assign(2 * half + 2, 0.0);
    for (std::size_t m = 0; m <= half; ++m) {
      const double scale = (m == 0 || 2 * m == n ? 1.0 : 2.0) / static_cast<double>(n);
      for (std::size_t k = 0; k < n; ++k) {
        const std::size_t at = m * k % n;
        out[2 * m] += scale * f[k] * rim_.cosine[at];
        out[2 * m + 1] += scale * f[k] * rim_.sine[at];
      }
    }
  }
  fine_rim_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    for (const double part : {0.0, 0.25, 0.5, 0.75}) {
      const auto [s, c] = math::sin_cos(kTurn * (static_cast<double>(i) + part) / static_cast<double>(n));
      const auto [radius, height] = rim_at(c, s);
      fine_rim_.push_back(frame_.origin + radius * direction(c, s) + height * frame_.axis);
    }
  }
}

std::array<double, 2> PolarRuleSolver::rim_at(double cosine, double sine) const {
  std::array<double, 2> sum{};
  double c = 1.0, s = 0.0;
  for (std::size_t m = 0; 2 * m < wave_[0].size(); ++m) {
    for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
      sum[which] += wave_[which][2 * m] * c + wave_[which][2 * m + 1] * s;
    }
    const double next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
  return sum;
}

/// Where a kink meets the rim, begun between points of `fine_rim_`: p_A = p_B = s = 0.
void PolarRuleSolver::find_corners(PairPressure& pressure, std::vector<Vec3>& corners) {
  const std::vector<Vec3>& rim = fine_rim_;
  const std::size_t n = rim.size();
  std::vector<std::size_t> kink;
  PressureBatch& batch = rim_batch_;
  batch.point.clear();
  for (const std::size_t k : crossing_) {
    double before = side_of(k, pressure, rim[n - 1]);
    for (std::size_t i = 0; i < n; ++i) {
      const double here = side_of(k, pressure, rim[i]);
      if ((before > 0.0) != (here > 0.0)) {
        batch.point.push_back(rim[i] + here / (here - before) * (rim[(i + n - 1) % n] - rim[i]));
        kink.push_back(k);
      }
      before = here;
    }
  }
  corners_lost_ = false;
  if (kink.empty()) return;
  batch.resize(batch.point.size());
  std::vector<double> last(kink.size(), 0.0);
  for (int step = 0; step < kCornerSteps; ++step) {
    pressure.evaluate(batch);
    evaluate_thirds(batch.point);
    bool moved = false;
    for (std::size_t i = 0; i < kink.size(); ++i) {
      Vec3 slope;
      const double s = side_of(kink[i], batch, i, slope);
      Mat3 rows;
      rows.row(0) = batch.slope_a[i];
      rows.row(1) = batch.slope_b[i];
      rows.row(2) = slope;
      const double volume = rows.determinant();
      const Vec3 value(batch.a[i], batch.b[i], s);
      const Vec3 &a = batch.slope_a[i], &b = batch.slope_b[i];
      Vec3 move = -(value[0] * b.cross(slope) + value[1] * slope.cross(a) + value[2] * a.cross(b)) / volume;
      last[i] = move.norm();
      if (!(last[i] <= extent_)) move.setZero();
      batch.point[i] += move;
      moved = moved || last[i] > 1e-9 * extent_;
    }
    if (!moved) break;
  }
  for (std::size_t i = 0; i < kink.size(); ++i) {
    const auto same = [&](std::size_t j) { return kink[j] == kink[i] && (batch.point[j] - batch.point[i]).norm() <= 1e-6 * extent_; };
    bool found = last[i] <= 1e-6 * extent_;
    for (std::size_t j = 0; j < i && found; ++j) found = !same(j);
    if (!found) {  // the panels find it by halving
      corners_lost_ = true;
      continue;
    }
    corners.push_back(batch.point[i]);
  }
}

double PolarRuleSolver::model_height(std::size_t ray, double share) const {
  const double square = share * share;
  return share * linear_[ray] + square * (square_[ray] + square * fourth_[ray]);
}

/// Where the rays cross kinks: first on the heights as the curvature at the peak and the rim give them, then on Sigma.
void PolarRuleSolver::find_crossings(PairPressure& pressure, double error) {
  const double enough = std::min(1e-3, 0.1 * std::sqrt(error));  // pieces that miss a kink by x leave an error of x^2
  crossings_.clear();
  sheets_.clear();
  for (const std::size_t k : crossing_) {
    Sheet sheet;
    sheet.flat = k < kinks_.size() && kinks_[k].form == implicit::Kink::Form::Plane;
    if (sheet.flat) sheet.value = kinks_[k].value(frame_.origin, sheet.slope);
    sheets_.push_back(sheet);
  }
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Vec3 reach = rays_.radius[i] * direction(rays_.cosine[i], rays_.sine[i]);
    const auto place = [&](double share) -> Vec3 { return frame_.origin + share * reach + model_height(i, share) * frame_.axis; };
    std::array<double, kSamples + 1> height;
    for (int j = 0; j <= kSamples; ++j) height[static_cast<std::size_t>(j)] = model_height(i, static_cast<double>(j) / kSamples);
    for (std::size_t c = 0; c < crossing_.size(); ++c) {
      const std::size_t k = crossing_[c];
      const Sheet& sheet = sheets_[c];
      const double along = sheet.flat ? sheet.slope.dot(reach) : 0.0, up = sheet.flat ? sheet.slope.dot(frame_.axis) : 0.0;
      const auto side = [&](double share) {
        return sheet.flat ? sheet.value + along * share + up * model_height(i, share) : side_of(k, pressure, place(share));
      };
      const auto between = [&](double left, double s_left, double right, double s_right) {
        double share = left + (right - left) * s_left / (s_left - s_right);
        for (int step = 0; step < 3; ++step) {
          const double s = side(share);
          ((s > 0.0) == (s_left > 0.0) ? left : right) = share;
          ((s > 0.0) == (s_left > 0.0) ? s_left : s_right) = s;
          share = left + (right - left) * s_left / (s_left - s_right);
        }
        crossings_.push_back({i, k, share, model_height(i, share), std::max(0.0, share - 0.5 / kSamples),
                              share + 0.5 / kSamples, false});
      };
      std::array<double, kSamples + 1> s;
      for (std::size_t j = 0; j < s.size(); ++j) {
        const double share = static_cast<double>(j) / kSamples;
        s[j] = sheet.flat ? sheet.value + along * share + up * height[j]
                          : side_of(k, pressure, frame_.origin + share * reach + height[j] * frame_.axis);
      }
      for (std::size_t j = 0; j < kSamples; ++j) {
        const double left = static_cast<double>(j) / kSamples, right = static_cast<double>(j + 1) / kSamples;
        if ((s[j] > 0.0) != (s[j + 1] > 0.0)) {
          between(left, s[j], right, s[j + 1]);
          continue;
        }
        // A ray that dips through a kink and back between two samples: at the vertex of a parabola through three of them.
        if (j == 0 || (s[j - 1] > 0.0) != (s[j] > 0.0)) continue;
        const double bend = s[j - 1] - 2.0 * s[j] + s[j + 1], slope = 0.5 * (s[j + 1] - s[j - 1]);
        if (!(bend * s[j] > 0.0) || !(std::abs(slope) < std::abs(bend))) continue;
        const double vertex = left - slope / bend / kSamples;
        const double dip = side(vertex);
        if ((dip > 0.0) == (s[j] > 0.0)) continue;
        const double before = vertex < left ? left - 1.0 / kSamples : left, after = vertex < left ? left : right;
        between(before, vertex < left ? s[j - 1] : s[j], vertex, dip);
        between(vertex, dip, after, vertex < left ? s[j] : s[j + 1]);
      }
    }
  }
  PressureBatch& batch = rim_batch_;
  batch.resize(crossings_.size());
  std::size_t open = crossings_.size();
  for (int step = 0; step < kCrossingSteps && open > 0; ++step) {
    for (std::size_t c = 0; c < crossings_.size(); ++c) {
      const Crossing& x = crossings_[c];
      batch.point[c] = frame_.origin + (x.radius * rays_.radius[x.ray]) * direction(rays_.cosine[x.ray], rays_.sine[x.ray]) +
                       x.height * frame_.axis;
    }
    pressure.evaluate(batch);
    evaluate_thirds(batch.point);
    for (std::size_t c = 0; c < crossings_.size(); ++c) {
      Crossing& x = crossings_[c];
      if (x.good) continue;
      const Vec3 e = rays_.radius[x.ray] * direction(rays_.cosine[x.ray], rays_.sine[x.ray]);
      Vec3 slope;
      const double s = side_of(x.kink, batch, c, slope), gap = batch.a[c] - batch.b[c];
      const Vec3 across = batch.slope_a[c] - batch.slope_b[c];
      const double gr = across.dot(e), gt = across.dot(frame_.axis), sr = slope.dot(e), st = slope.dot(frame_.axis);
      const double determinant = gr * st - gt * sr;
      const double radius = x.radius + (gt * s - st * gap) / determinant;
      if (!std::isfinite(radius)) continue;
      const double next = std::clamp(radius, x.left, x.right);  // two that lie close must not change places
      const double moved = next - x.radius;
      x.height -= (gap + gr * moved) / gt;
      x.radius = next;
      // Relative to the piece between kink and rim on faces, whose share of the ray may be small.
      x.good = std::abs(moved) <= enough * (about_middle_ ? std::abs(1.0 - next) : 1.0) && next == radius;
      if (x.good) --open;
    }
  }
  const double shortest = shortest_piece(error);
  std::erase_if(crossings_, [&](const Crossing& x) { return !x.good || x.radius < shortest || x.radius > 1.0 - shortest; });
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& x, const Crossing& y) {
    return x.ray != y.ray ? x.ray < y.ray : x.radius != y.radius ? x.radius < y.radius : x.kink < y.kink;
  });
}

/// Sums of the panels from `first` on.
bool PolarRuleSolver::solve_panels(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  const std::size_t count = (panels_.size() - first) * per_panel;
  for (std::vector<double>* column : {&rays_.cosine, &rays_.sine, &rays_.radius, &rays_.height, &turn_, &linear_, &square_, &fourth_}) {
    column->resize(count);
  }
  if (about_middle_) {
    place_rays(rule, first);
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      const Panel& panel = panels_[first + i / per_panel];
      turn_[i] = 0.5 * (panel.end - panel.begin);
      const auto [s, c] = math::sin_cos(0.5 * (panel.begin + panel.end) + turn_[i] * rule.node[i % per_panel]);
      rays_.cosine[i] = c;
      rays_.sine[i] = s;
      const auto [radius, height] = about_star_ ? outline_at(c, s) : rim_at(c, s);
      rays_.radius[i] = radius;
      rays_.height[i] = height;
      if (!(radius > 0.0)) return false;
    }
  }
  const double rim_error = rim_error_;
  if (!solve_rim(pressure, rays_, error)) return false;
  rim_error_ = std::max(rim_error_, rim_error);
  for (std::size_t i = 0; i < count; ++i) {
    const double c = rays_.cosine[i], s = rays_.sine[i], rim = rays_.radius[i];
    if (about_star_) {
      linear_[i] = rim * rise_.dot(direction(c, s));
      square_[i] = rays_.height[i] - linear_[i];
      fourth_[i] = 0.0;
      continue;
    }
    linear_[i] = 0.0;
    // Faces are flat about the middle.
    square_[i] = about_middle_ ? 0.0
                               : 0.5 * rim * rim * (frame_.height_uu * c * c + 2.0 * frame_.height_uv * c * s + frame_.height_vv * s * s);
    fourth_[i] = rays_.height[i] - square_[i];
  }
  find_crossings(pressure, error);

  const double shortest = shortest_piece(error);
  foot_.clear();
  height_.clear();
  weight_.clear();
  ray_nodes_.clear();
  ray_fewer_.clear();
  std::size_t next = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Panel& panel = panels_[first + i / per_panel];
    const double rim = rays_.radius[i];
    const Vec3 e = direction(rays_.cosine[i], rays_.sine[i]);
    const std::size_t crossing_begin = next;
    while (next < crossings_.size() && crossings_[next].ray == i) ++next;
    const auto nodes = [&](int most, int inner, double angle) {
      double left = 0.0, lift_left = 0.0;
      for (std::size_t c = crossing_begin; c <= next; ++c) {
        const double right = c < next ? crossings_[c].radius : 1.0;
        const double lift_right = c < next ? crossings_[c].height - model_height(i, right) : 0.0;
        if (c < next && (right - left < shortest || 1.0 - right < shortest)) continue;
        // On faces it is the short last piece on which the pressure falls.
        const GaussRule& gauss = gauss_rule(!about_middle_ ? nodes_on(most, right - left) : c < next ? inner : most);
        for (std::size_t j = 0; j < gauss.node.size(); ++j) {
          const double along = gauss.node[j], r = left + (right - left) * along;
          foot_.push_back(frame_.origin + (r * rim) * e);
          height_.push_back(model_height(i, r) + lift_left + along * (lift_right - lift_left));
          weight_.push_back(angle * turn_[i] * gauss.weight[j] * (right - left) * rim * rim * r * jacobian_);
        }
        left = right;
        lift_left = lift_right;
      }
    };
    ray_nodes_.push_back(foot_.size());
    const int fewest = check_of(kFewest);  // is enough on the inner pieces, where more confirm it
    nodes(panel.nodes, panel.nodes == kFewest ? fewest : panel.nodes, rule.weight[i % per_panel]);
    ray_fewer_.push_back(foot_.size());
    const double fewer = rule.gauss_weight[i % per_panel];
    const int check = check_of(panel.nodes);
    if (fewer > 0.0) nodes(check, check == fewest ? kFewest : check, fewer);
  }
  ray_nodes_.push_back(foot_.size());
  node_.resize(foot_.size());
  const double residual = residual_, lift = lift_;
  if (!solve_heights(pressure, error)) return false;
  if (!integrate()) return false;
  residual_ = std::max(residual_, residual);
  lift_ = std::max(lift_, lift);
  for (std::size_t p = first; p < panels_.size(); ++p) keep_panel(panels_[p], rule, (p - first) * per_panel);
  return true;
}

/// Whether points of the rim are neighbours: the rim leads from one to the next, and its radius changes as its slope says. Where a
/// ray grazes the rim the radius jumps, and what lies beyond is not seen.
bool PolarRuleSolver::rim_joins(std::size_t first, std::size_t last, bool closed) const {
  const double least = about_star_ ? 0.0 : kLeastSight;
  for (std::size_t i = first; i + (closed ? 0 : 1) < last; ++i) {
    const RimPoint &p = kept_rim_[i], &q = kept_rim_[i + 1 < last ? i + 1 : first];
    const Vec2 chord = q.at - p.at;
    double steepest = 0.0;  // of the logarithm of the radius over the angle
    for (const RimPoint* x : {&p, &q}) {
      const Vec2 tangent(-x->outward.y(), x->outward.x());
      const double sight = x->outward.dot(x->at);
      if (!(sight > least * x->outward.norm() * x->at.norm())) return false;
      if (!(tangent.dot(chord) >= kLeastAlong * tangent.norm() * chord.norm())) return false;
      steepest = std::max(steepest, std::abs(tangent.dot(x->at)) / sight);
    }
    const double square_p = p.at.squaredNorm(), square_q = q.at.squaredNorm();
    const double change = std::abs(square_q - square_p) / (square_p + square_q);
    const double angle = std::abs(p.at.x() * q.at.y() - p.at.y() * q.at.x()) / std::sqrt(square_p * square_q);
    if (!(change <= kMostChange * angle * (1.0 + steepest))) return false;
  }
  return true;
}

/// Adds up a panel's rays from `ray` on and keeps its nodes.
void PolarRuleSolver::keep_panel(Panel& panel, const KronrodRule& rule, std::size_t ray) {
  panel.fine = panel.angular = panel.radial = {};
  panel.first = kept_.point.size();
  for (std::size_t k = 0; k < rule.node.size(); ++k) {
    for (std::size_t i = ray_nodes_[ray + k]; i < ray_fewer_[ray + k]; ++i) {
      const Vec3 x = node_.point[i] - frame_.origin;
      weigh(panel.fine, x, normal_[i], area_[i], pressure_[i]);
      weigh(panel.angular, x, normal_[i], area_[i] * (rule.gauss_weight[k] / rule.weight[k]), pressure_[i]);
    }
    for_columns([&](auto& kept, const auto& node) {
      kept.insert(kept.end(), node.begin() + static_cast<std::ptrdiff_t>(ray_nodes_[ray + k]),
                  node.begin() + static_cast<std::ptrdiff_t>(ray_fewer_[ray + k]));
    });
    for (std::size_t i = ray_fewer_[ray + k]; i < ray_nodes_[ray + k + 1]; ++i) {
      weigh(panel.radial, node_.point[i] - frame_.origin, normal_[i], area_[i], pressure_[i]);
    }
  }
  panel.last = kept_.point.size();
  if (about_middle_) return;
  panel.rim = kept_rim_.size();
  for (std::size_t i = ray; i < ray + rule.node.size(); ++i) {
    kept_rim_.push_back({rays_.radius[i] * Vec2(rays_.cosine[i], rays_.sine[i]), rays_.height[i], rays_.outward[i]});
  }
  panel.rim_end = kept_rim_.size();
}

bool PolarRuleSolver::solve_split(PairPressure& pressure, const ContactSettings& settings) {
  const double error = settings.error;
  cut_ = !crossing_.empty() && crossing_.back() >= kinks_.size();
  const bool fine = error < 1e-4;
  const KronrodRule& rule = kronrod_rule(fine ? 7 : 3);
  const int radial = !fine ? 4 : error >= 1e-6 ? 6 : error >= 1e-8 ? 8 : 10;
  const double widest = fine ? kWidest : kWidestCoarse;
  about_middle_ = false;
  std::vector<Vec3> corners;
  find_corners(pressure, corners);
  std::vector<double> turns;
  for (const Vec3& x : corners) {
    const Vec3 d = x - frame_.origin;
    const double turn = math::atan2(d.dot(frame_.v) / frame_.v.squaredNorm(), d.dot(frame_.u) / frame_.u.squaredNorm());
    turns.push_back(turn < 0.0 ? turn + kTurn : turn);
  }
  if (turns.empty()) turns.push_back(0.0);
  std::sort(turns.begin(), turns.end());
  turns.push_back(turns.front() + kTurn);
  panels_.clear();
  for (std::size_t t = 0; t + 1 < turns.size(); ++t) {
    const double width = turns[t + 1] - turns[t];
    if (width < kSameTurn) continue;
    const int parts = static_cast<int>(std::ceil(width / widest));
    for (int i = 0; i < parts; ++i) {
      Panel panel;
      panel.begin = turns[t] + width * i / parts;
      panel.end = turns[t] + width * (i + 1) / parts;
      panel.nodes = radial;
      panels_.push_back(panel);
    }
  }
  return solve_all_panels(pressure, settings, rule, nullptr, fine);
}

/// Halves panels until the estimate is low enough; then nodes and sums of all are in place.
/// @param larger  rule that panels get before they are halved, or null
bool PolarRuleSolver::solve_all_panels(PairPressure& pressure, const ContactSettings& settings, const KronrodRule& first,
                                       const KronrodRule* larger, bool fine) {
  const KronrodRule* rule = &first;
  const double error = settings.error;
  kept_.resize(0);
  kept_weight_.clear();
  kept_area_.clear();
  kept_pressure_.clear();
  kept_normal_.clear();
  kept_rim_.clear();
  residual_ = lift_ = rim_error_ = 0.0;
  std::size_t begin = 0, solved = panels_.size();
  PatchSums all;
  const bool beside = about_middle_ && cut_;
  // A corner within a panel keeps its larger rule from converging faster.
  const double least = beside || corners_lost_ ? 1.0 : about_middle_ ? kLeastOnFaces : 0.0, safety = beside ? kBesideThirds : 1.0;
  for (;;) {
    if (!solve_panels(pressure, *rule, error, begin)) return false;
    for (std::size_t p = begin; p < panels_.size() && !about_middle_; ++p) {
      if (!rim_joins(panels_[p].rim, panels_[p].rim_end, false)) return false;
    }
    all = {};
    for (const Panel& panel : panels_) all.add(panel.fine);
    if (!(all.load > 0.0) || !(all.area > 0.0)) return false;
    double regular = 0.0, halved = 0.0;
    for (Panel& panel : panels_) {
      panel.by_angle = share_of_difference(panel.fine, panel.angular, all);
      panel.by_radius = share_of_difference(panel.angular, panel.radial, all);
      (panel.halved ? halved : regular) += panel.by_angle + panel.by_radius;
    }
    estimate_ = safety * estimate_of(regular, halved, fine, least);
    if (estimate_ <= kEnough * error || solved >= (beside ? kMostBesideThirds : kMostPanels)) break;
    // New ones go to the end; the angles are put in order when all is done.
    const auto count = static_cast<double>(panels_.size());
    const double share_regular = 0.5 * difference_for(error / safety, fine, least) / count,
                 share_halved = 0.5 * error / safety / count;
    std::vector<Panel> finer;
    bool by_angle = false;
    std::erase_if(panels_, [&](const Panel& panel) {
      const double share = panel.halved ? share_halved : share_regular;
      const bool more = panel.by_radius > share && panel.nodes < kMostRadial, halve = panel.by_angle > share;
      if (!more && !halve) return false;
      by_angle = by_angle || halve;
      Panel next;
      next.nodes = more ? std::min(panel.nodes + 4, kMostRadial) : panel.nodes;
      next.begin = panel.begin;
      next.halved = panel.halved || (halve && larger == nullptr);
      if (halve && larger == nullptr) {
        next.end = 0.5 * (panel.begin + panel.end);
        finer.push_back(next);
        next.begin = next.end;
      }
      next.end = panel.end;
      finer.push_back(next);
      return true;
    });
    if (finer.empty()) break;
    if (larger != nullptr && by_angle) rule = std::exchange(larger, nullptr);
    begin = panels_.size();
    solved += finer.size();
    panels_.insert(panels_.end(), finer.begin(), finer.end());
  }
  std::sort(panels_.begin(), panels_.end(), [](const Panel& a, const Panel& b) { return a.begin < b.begin; });
  node_.resize(0);
  weight_.clear();
  area_.clear();
  pressure_.clear();
  normal_.clear();
  fine_ = {};
  for (const Panel& panel : panels_) {
    for_columns([&panel](const auto& kept, auto& node) {
      node.insert(node.end(), kept.begin() + static_cast<std::ptrdiff_t>(panel.first), kept.begin() + static_cast<std::ptrdiff_t>(panel.last));
    });
    fine_.add(panel.fine);
  }
  if (!about_middle_) {
    polygon_.clear();
    for (const Panel& panel : panels_) {
      polygon_.insert(polygon_.end(), kept_rim_.begin() + static_cast<std::ptrdiff_t>(panel.rim),
                      kept_rim_.begin() + static_cast<std::ptrdiff_t>(panel.rim_end));
    }
    kept_rim_ = polygon_;
    if (!rim_joins(0, kept_rim_.size(), true)) return false;
  }
  node_.resize(node_.point.size());
  estimate_ += kUnseen * error + algebraic_error();
  return true;
}

}  // namespace supple::collision
