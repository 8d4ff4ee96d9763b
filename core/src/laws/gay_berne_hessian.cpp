// The Hessian of Gay-Berne ellipsoids by numbers that carry their first and second derivatives in y.
#include <algorithm>
#include <array>
#include <cmath>

#include "laws/gay_berne_kernel.h"
#include "laws/relative_hessian.h"

namespace supple::core {
namespace {

struct Jet {
  double value = 0.0;
  Vec9 first = Vec9::Zero();
  Mat9 second = Mat9::Zero();

  friend Jet operator+(const Jet& a, const Jet& b) {
    return {a.value + b.value, a.first + b.first, a.second + b.second};
  }
  friend Jet operator-(const Jet& a, const Jet& b) {
    return {a.value - b.value, a.first - b.first, a.second - b.second};
  }
  friend Jet operator*(double s, const Jet& a) { return {s * a.value, s * a.first, s * a.second}; }
  friend Jet operator*(const Jet& a, const Jet& b) {
    const Mat9 mixed = a.first * b.first.transpose();
    return {a.value * b.value, a.value * b.first + b.value * a.first,
            a.value * b.second + b.value * a.second + mixed + mixed.transpose()};
  }
};

/// f(a), f having the derivatives f1 and f2 at the value of a.
Jet chain(const Jet& a, double f, double f1, double f2) {
  return {f, f1 * a.first, f1 * a.second + f2 * a.first * a.first.transpose()};
}

Jet power(const Jet& a, double n) {
  const double f = math::pow(a.value, n);
  return chain(a, f, n * f / a.value, n * (n - 1.0) * f / (a.value * a.value));
}

using Jets = std::array<Jet, 3>;
/// xx, yy, zz, yz, zx, xy.
using SymmetricJets = std::array<Jet, 6>;

/// A vector that a particle carries, turned by dtheta x b + dtheta x (dtheta x b) / 2.
Jets carried(const Vec3& b, int turn) {
  Jets out;
  for (int i = 0; i < 3; ++i) {
    Jet& c = out[static_cast<std::size_t>(i)];
    c.value = b[i];
    for (int j = 0; j < 3; ++j) {
      c.first[turn + j] = Vec3(Vec3::Unit(j).cross(b))[i];
      for (int k = 0; k < 3; ++k) {
        c.second(turn + j, turn + k) =
            0.5 * ((i == j ? b[k] : 0.0) + (i == k ? b[j] : 0.0)) - (j == k ? b[i] : 0.0);
      }
    }
  }
  return out;
}

/// Adds Q diag(d) Q^T, and Q diag(e) Q^T.
void add_turned(const Quat& q, int turn, const Vec3& d, const Vec3& e, SymmetricJets& with_d, SymmetricJets& with_e) {
  constexpr std::array<std::pair<std::size_t, std::size_t>, 6> kPlaces{{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {2, 0}, {0, 1}}};
  const Mat3 frame = q.toRotationMatrix();
  for (int k = 0; k < 3; ++k) {
    const Jets column = carried(frame.col(k), turn);
    for (std::size_t p = 0; p < kPlaces.size(); ++p) {
      const Jet product = column[kPlaces[p].first] * column[kPlaces[p].second];
      with_d[p] = with_d[p] + d[k] * product;
      with_e[p] = with_e[p] + e[k] * product;
    }
  }
}

SymmetricJets adjugate(const SymmetricJets& m) {
  return {m[1] * m[2] - m[3] * m[3], m[2] * m[0] - m[4] * m[4], m[0] * m[1] - m[5] * m[5],
          m[4] * m[5] - m[0] * m[3], m[5] * m[3] - m[1] * m[4], m[3] * m[4] - m[2] * m[5]};
}

/// r . M^-1 r, and the determinant.
struct InverseForm {
  Jet value, determinant;
  InverseForm(const SymmetricJets& m, const Jets& r) {
    const SymmetricJets a = adjugate(m);
    determinant = m[0] * a[0] + m[5] * a[5] + m[4] * a[4];
    const Jet squares = a[0] * (r[0] * r[0]) + a[1] * (r[1] * r[1]) + a[2] * (r[2] * r[2]);
    const Jet mixed = a[3] * (r[1] * r[2]) + a[4] * (r[2] * r[0]) + a[5] * (r[0] * r[1]);
    value = (squares + 2.0 * mixed) * power(determinant, -1.0);
  }
};

}  // namespace

PairHessian hessian(const SwitchedGayBerne& law, const PairPose& pose, HessianKind kind) {
  const GayBerne& e = law.ellipsoid;
  if (pose.r.norm() >= law.cut_off) return PairHessian::Zero();
  SymmetricJets g, b;
  const Vec3 radii2 = squared_radii(e), softness = softness_of(e);
  add_turned(pose.orientation_a, kTurnA, radii2, softness, g, b);
  add_turned(pose.orientation_b, kTurnB, radii2, softness, g, b);
  Jets r;
  for (int k = 0; k < 3; ++k) {
    Jet& x = r[static_cast<std::size_t>(k)];
    x.value = pose.r[k];
    x.first[kR + k] = 1.0;
  }
  const Jet d2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
  const Jet d = power(d2, 0.5);
  const InverseForm by_g(g, r), by_b(b, r);
  Jet gap = d - power(0.5 * (by_g.value * power(d2, -1.0)), -0.5);
  gap.value += e.gamma * e.sigma;

  const double s = gap.value;
  const double rho6 = math::pow(e.sigma / s, 6.0);
  const double bend = 4.0 * e.epsilon * (156.0 * rho6 - 42.0) * rho6 / (s * s);
  const Jet radial = chain(gap, 4.0 * e.epsilon * (rho6 - 1.0) * rho6,
                           4.0 * e.epsilon * (6.0 - 12.0 * rho6) * rho6 / s, bend);
  const Jet eta = power(2.0 * size_of(e) * size_of(e) * power(by_g.determinant, -1.0), 0.5 * e.upsilon);
  const Jet chi = power(2.0 * (by_b.value * power(d2, -1.0)), e.mu);

  const double width = law.cut_off - law.switch_from;
  const double t = std::clamp((d.value - law.switch_from) / width, 0.0, 1.0);
  const Jet share = chain(d, 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t)),
                          -30.0 * t * t * (1.0 - t) * (1.0 - t) / width,
                          -60.0 * t * (1.0 - t) * (1.0 - 2.0 * t) / (width * width));
  if (kind == HessianKind::PositiveSemiDefinite) {
    const double gain = std::max(bend, 0.0) * eta.value * chi.value * share.value;
    return from_relative(gain * gap.first * gap.first.transpose());
  }
  return from_relative((radial * eta * chi * share).second);
}

}  // namespace supple::core
