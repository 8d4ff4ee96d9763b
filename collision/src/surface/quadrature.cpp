#include "surface/quadrature.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "numbers.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::collision {
namespace {

constexpr int kLargestGauss = 16;

/// Newton on the Legendre polynomial P_n, from the asymptotic roots.
GaussRule make_gauss(int n) {
  GaussRule rule;
  for (int i = 0; i < n; ++i) {
    double x = -math::sin_cos(std::numbers::pi * (i + 0.75) / (n + 0.5)).cos;
    double slope = 1.0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      double p = 1.0, before = 0.0;
      for (int k = 1; k <= n; ++k) {
        const double next = ((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k;
        before = p;
        p = next;
      }
      slope = n * (x * p - before) / (x * x - 1.0);
      const double step = p / slope;
      x -= step;
      if (std::abs(step) < 1e-16) break;
    }
    rule.node.push_back(0.5 * (1.0 + x));
    rule.weight.push_back(1.0 / ((1.0 - x * x) * slope * slope));
  }
  return rule;
}

/// @param node  the positive ones from the outside, the middle one last   @param smaller  weights of every second one
KronrodRule make_nested(std::span<const double> node, std::span<const double> weight, std::span<const double> smaller) {
  KronrodRule rule;
  const std::size_t half = node.size() - 1;
  for (std::size_t k = 0; k <= 2 * half; ++k) {
    const std::size_t i = k <= half ? k : 2 * half - k;
    rule.node.push_back(k <= half ? -node[i] : node[i]);
    rule.weight.push_back(weight[i]);
    rule.gauss_weight.push_back(i % 2 == 1 ? smaller[i / 2] : 0.0);
  }
  return rule;
}

/// Weight of an even number n of equally spaced angles in the trigonometric interpolant, at distance x from an angle:
/// sin(n x / 2) cot(x / 2) / n.
double cardinal(int n, double x) {
  const auto [s, c] = math::sin_cos(0.5 * x);
  if (std::abs(s) < 1e-14) return 1.0;
  return math::sin_cos(0.5 * n * x).sin * c / (s * n);
}

std::vector<PolarRule> make_polar(bool single_ray) {
  std::vector<PolarRule> rules;
  constexpr std::array<std::array<int, 3>, 7> kSizes{
      {{2, 6, 2}, {3, 8, 2}, {4, 12, 3}, {6, 20, 3}, {8, 28, 4}, {12, 44, 5}, {16, 64, 6}}};
  for (const auto& size : kSizes) {
    PolarRule rule{.radial = size[0], .angular = single_ray ? 1 : size[1], .column = size[2], .cosine = {}, .sine = {},
                   .from_coarser = {}};
    for (int k = 0; k < rule.angular; ++k) {
      const auto [s, c] = math::sin_cos(kTurn * k / rule.angular);
      rule.cosine.push_back(c);
      rule.sine.push_back(s);
      if (rules.empty()) continue;
      const int coarse = rules.back().angular;
      for (int j = 0; j < coarse; ++j) {
        const double x = kTurn * (static_cast<double>(k) / rule.angular - static_cast<double>(j) / coarse);
        rule.from_coarser.push_back(cardinal(coarse, x));
      }
    }
    rules.push_back(std::move(rule));
  }
  return rules;
}

CurveAngles make_curve_angles(const PolarRule& rule) {
  CurveAngles angles;
  const auto n = static_cast<std::size_t>(rule.angular);
  for (std::size_t i = 0; i < 4 * n; ++i) {
    const auto [s, c] = math::sin_cos(kTurn * (0.25 * static_cast<double>(i)) / static_cast<double>(n));
    angles.cosine.push_back(c);
    angles.sine.push_back(s);
  }
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t m = 0; m <= n / 2; ++m) {
      angles.wave_cosine.push_back(rule.cosine[m * k % n]);
      angles.wave_sine.push_back(rule.sine[m * k % n]);
    }
  }
  return angles;
}

}  // namespace

const GaussRule& gauss_rule(int n) {
  static const std::vector<GaussRule> rules = [] {
    std::vector<GaussRule> all(1);
    for (int k = 1; k <= kLargestGauss; ++k) all.push_back(make_gauss(k));
    return all;
  }();
  SUPPLE_EXPECTS(n >= 1 && n <= kLargestGauss);
  return rules[static_cast<std::size_t>(n)];
}

const TwoEndRule& two_end_rule(int n) {
  static const std::vector<TwoEndRule> rules = [] {
    // On (-1, 1) the nodes are the roots of the Gegenbauer polynomials C_n with parameter 5/2.
    const double root = std::sqrt(48.0), far = std::sqrt((9.0 + root) / 33.0), near = std::sqrt((9.0 - root) / 33.0);
    const std::vector<std::vector<double>> nodes{
        {}, {0.0}, {-std::sqrt(1.0 / 7.0), std::sqrt(1.0 / 7.0)}, {-std::sqrt(1.0 / 3.0), 0.0, std::sqrt(1.0 / 3.0)}, {-far, -near, near, far}};
    const GaussRule& gauss = gauss_rule(kLargestGauss);
    std::vector<TwoEndRule> all;
    for (const std::vector<double>& at : nodes) {
      TwoEndRule rule{};
      double whole = 2.0, square = 2.0 / 3.0;  // integrals of 1 and x^2, less those of the nodes
      for (const double x : at) {
        // Of the polynomial with double roots at both ends that is 1 at this node and 0 at the others.
        double weight = 0.0;
        for (std::size_t k = 0; k < gauss.node.size(); ++k) {
          const double y = 2.0 * gauss.node[k] - 1.0, fall = (1.0 - y * y) / (1.0 - x * x);
          double value = fall * fall;
          for (const double other : at) value *= other == x ? 1.0 : (y - other) / (x - other);
          weight += 2.0 * gauss.weight[k] * value;
        }
        rule.node.push_back(0.5 * (1.0 + x));
        rule.weight.push_back(0.5 * weight);
        whole -= weight;
        square -= weight * x * x;
      }
      rule.end = 0.25 * whole;
      rule.slope = (whole - square) / 16.0;
      all.push_back(std::move(rule));
    }
    return all;
  }();
  SUPPLE_EXPECTS(n >= 0 && n < static_cast<int>(rules.size()));
  return rules[static_cast<std::size_t>(n)];
}

const KronrodRule& kronrod_rule(int gauss) {
  static const KronrodRule coarsest = make_nested(std::array{std::sqrt(6.0 / 7.0), std::sqrt(1.0 / 3.0), 0.0},
                                           std::array{98.0 / 495.0, 27.0 / 55.0, 28.0 / 45.0}, std::array{1.0});
  static const KronrodRule coarse = make_nested(std::array{0.960491268708020283423507092629080, 0.774596669241483377035853079956480,
                                                    0.434243749346802558002071502844628, 0.0},
                                         std::array{0.104656226026467265193823857192073, 0.268488089868333440728569280666710,
                                                    0.401397414775962222905051818618432, 0.450916538658474142345110087045571},
                                         std::array{5.0 / 9.0, 8.0 / 9.0});
  static const KronrodRule fine = make_nested(
      std::array{0.991455371120812639206854697526329, 0.949107912342758524526189684047851, 0.864864423359769072789712788640926,
                 0.741531185599394439863864773280788, 0.586087235467691130294144691258258, 0.405845151377397166906606412076961,
                 0.207784955007898467600689403773245, 0.0},
      std::array{0.022935322010529224963732008058970, 0.063092092629978553290700663189204, 0.104790010322250183839876322541518,
                 0.140653259715525918745189590510238, 0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
                 0.204432940075298892414161999234649, 0.209482141084727828012999174891714},
      std::array{0.129484966168869693270611432679082, 0.279705391489276667901467771423780, 0.381830050505118944950369775488975,
                 0.417959183673469387755102040816327});
  SUPPLE_EXPECTS(gauss == 2 || gauss == 3 || gauss == 7);
  return gauss == 2 ? coarsest : gauss == 3 ? coarse : fine;
}

const CurveAngles& curve_angles(std::size_t n) {
  static const std::vector<std::pair<std::size_t, CurveAngles>> all = [] {
    std::vector<std::pair<std::size_t, CurveAngles>> made{{1, make_curve_angles(polar_rays().front())}};
    for (const PolarRule& rule : polar_rules()) made.emplace_back(rule.angular, make_curve_angles(rule));
    return made;
  }();
  const auto found = std::find_if(all.begin(), all.end(), [n](const auto& of) { return of.first == n; });
  SUPPLE_EXPECTS(found != all.end());
  return found->second;
}

std::span<const PolarRule> polar_rules() {
  static const std::vector<PolarRule> rules = make_polar(false);
  return rules;
}

std::span<const PolarRule> polar_rays() {
  static const std::vector<PolarRule> rays = make_polar(true);
  return rays;
}

}  // namespace supple::collision
