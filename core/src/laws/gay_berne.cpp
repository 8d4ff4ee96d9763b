#include "supple/core/gay_berne.h"

#include <cmath>

#include "laws/gay_berne_kernel.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

Mat3 turned(const Mat3& q, const Vec3& diagonal) { return q * diagonal.asDiagonal() * q.transpose(); }

double whole_power(double x, int n) {
  double y = 1.0;
  for (; n > 0; --n) y *= x;
  return y;
}

/// w such that the trace of [t] A - A [t] times M is w . t, for symmetric A and M; [t] v = t x v.
Vec3 turn_of(const Mat3& a, const Mat3& m) {
  const Mat3 p = a * m;
  return 2.0 * Vec3(p(1, 2) - p(2, 1), p(2, 0) - p(0, 2), p(0, 1) - p(1, 0));
}

void require(const GayBerne& law) {
  SUPPLE_EXPECTS(law.sigma > 0.0 && law.radii.minCoeff() > 0.0 && law.well.minCoeff() > 0.0);
  SUPPLE_EXPECTS(law.upsilon >= 0 && law.mu >= 1);
}

}  // namespace

PairLoad evaluate(const GayBerne& law, const PairPose& pose) {
  require(law);
  const Mat3 q_a = pose.orientation_a.toRotationMatrix(), q_b = pose.orientation_b.toRotationMatrix();
  const Mat3 g_a = turned(q_a, squared_radii(law)), g_b = turned(q_b, squared_radii(law));
  const Mat3 b_a = turned(q_a, softness_of(law)), b_b = turned(q_b, softness_of(law));
  const Mat3 g = g_a + g_b;
  const Mat3 g_inverse = g.inverse(), b_inverse = (b_a + b_b).inverse();
  const double d = pose.r.norm();
  const Vec3 u = pose.r / d;

  const Vec3 kappa = g_inverse * u, iota = b_inverse * u;
  const double touch = 1.0 / std::sqrt(0.5 * u.dot(kappa));
  const double rho = law.sigma / (d - touch + law.gamma * law.sigma);
  const double rho6 = whole_power(rho, 6);
  const double radial = 4.0 * law.epsilon * (rho6 * rho6 - rho6);
  const double slope = 4.0 * law.epsilon * (6.0 * rho6 - 12.0 * rho6 * rho6) * rho / law.sigma;
  const double eta = whole_power(std::sqrt(2.0 * size_of(law) * size_of(law) / g.determinant()), law.upsilon);
  const double chi = whole_power(2.0 * u.dot(iota), law.mu);
  const double energy = radial * eta * chi;

  // d touch = -touch^3 / 4 d(u^T G^-1 u), d(u^T G^-1 u) = 2 kappa . du - kappa^T dG kappa, du = (1 - u u^T) dr / d.
  const double by_touch = eta * chi * slope * 0.25 * touch * touch * touch;
  const double by_chi = law.mu * energy / u.dot(iota);
  const double by_eta = -0.5 * law.upsilon * energy;
  const Vec3 along = (by_touch * 2.0 * kappa + by_chi * 2.0 * iota) / d;
  const auto torque = [&](const Mat3& g_x, const Mat3& b_x) -> Vec3 {
    return turn_of(g_x, by_touch * kappa * kappa.transpose() - by_eta * g_inverse) +
           turn_of(b_x, by_chi * iota * iota.transpose());
  };
  return {.energy = energy,
          .force_b = -(eta * chi * slope * u + along - along.dot(u) * u),
          .torque_a = torque(g_a, b_a),
          .torque_b = torque(g_b, b_b)};
}

PairLoad evaluate(const SwitchedGayBerne& law, const PairPose& pose) {
  const double d = pose.r.norm();
  if (d >= law.cut_off) {
    return {.energy = 0.0, .force_b = Vec3::Zero(), .torque_a = Vec3::Zero(), .torque_b = Vec3::Zero()};
  }
  PairLoad load = evaluate(law.ellipsoid, pose);
  if (d <= law.switch_from) return load;
  const double width = law.cut_off - law.switch_from;
  const double t = (d - law.switch_from) / width;
  const double share = 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t));
  const double slope = -30.0 * t * t * (1.0 - t) * (1.0 - t) / width;
  load.force_b = share * load.force_b - load.energy * slope / d * pose.r;
  load.torque_a *= share;
  load.torque_b *= share;
  load.energy *= share;
  return load;
}

Stiffness stiffness(const SwitchedGayBerne& law) {
  const GayBerne& e = law.ellipsoid;
  require(e);
  // The gap s = d - sigma_12 + gamma sigma is 2^(1/6) sigma at rest; at 0.9 of that
  const double s = 0.9 * 1.122462048309373 * e.sigma;
  const double rho6 = whole_power(e.sigma / s, 6);
  const double bend = 4.0 * e.epsilon * (156.0 * rho6 - 42.0) * rho6 / (s * s);
  const double slope = std::abs(4.0 * e.epsilon * (6.0 - 12.0 * rho6) * rho6 / s);
  // det(G_A + G_B) is least where both are parallel, B at its softest.
  const double eta = whole_power(size_of(e) / (2.0 * e.radii.prod()), e.upsilon);
  const double deepest = eta * e.well.maxCoeff();
  // Largest change of sigma_12 with direction, over d (Kantorovich), and by rotating one particle.
  const double ratio = e.radii.maxCoeff() / e.radii.minCoeff();
  const double lean = 0.5 * (ratio - 1.0 / ratio);
  const double lever = 0.5 * e.radii.maxCoeff() * (ratio * ratio - 1.0);
  // How fast the depths of the wells change with direction.
  const double contrast = e.mu * (math::pow(e.well.maxCoeff() / e.well.minCoeff(), 1.0 / e.mu) - 1.0) +
                          e.upsilon * (ratio * ratio - 1.0);
  const double least = e.radii.minCoeff();
  const double turning = slope * lever + e.epsilon * contrast;
  return {.translation = deepest * (bend * (1.0 + lean * lean) + (slope * (1.0 + lean) + e.epsilon * contrast / least) *
                                                                    (1.0 + lean) / least),
          .rotation = deepest * (bend * lever * lever + (1.0 + contrast) * turning)};
}

}  // namespace supple::core
