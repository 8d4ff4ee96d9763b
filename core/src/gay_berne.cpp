#include "supple/core/gay_berne.h"

#include <array>
#include <cmath>
#include <functional>

#include "packed_list.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

Vec3 squares(const GayBerne& law) { return law.radii.cwiseAbs2(); }

Vec3 softness(const GayBerne& law) {
  Vec3 out;
  for (int k = 0; k < 3; ++k) out[k] = math::pow(law.well[k], -1.0 / law.mu);
  return out;
}

double volume(const GayBerne& law) {
  const double ab = law.radii[0] * law.radii[1];
  return (ab + law.radii[2] * law.radii[2]) * std::sqrt(ab);
}

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
  const Mat3 g_a = turned(q_a, squares(law)), g_b = turned(q_b, squares(law));
  const Mat3 b_a = turned(q_a, softness(law)), b_b = turned(q_b, softness(law));
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
  const double eta = whole_power(std::sqrt(2.0 * volume(law) * volume(law) / g.determinant()), law.upsilon);
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

void NeighbourList::Impl::stage_ellipsoids(const Vec3& radii2, const Vec3& softness,
                                           std::span<const Quat> orientations, const Executor& executor) {
  for (std::vector<packed::Row>& rows : ellipsoid) {
    rows.resize(position.size());
    std::fill(rows.begin() + static_cast<std::ptrdiff_t>(source.size()), rows.end(), packed::Row{});
  }
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const Mat3 q = orientations[source[e]].toRotationMatrix();
      const Mat3 g = turned(q, radii2), b = turned(q, softness);
      ellipsoid[0][e] = {g(0, 0), g(1, 1), g(2, 2), 0.0};
      ellipsoid[1][e] = {g(1, 2), g(2, 0), g(0, 1), 0.0};
      ellipsoid[2][e] = {b(0, 0), b(1, 1), b(2, 2), 0.0};
      ellipsoid[3][e] = {b(1, 2), b(2, 0), b(0, 1), 0.0};
    }
  };
  executor.for_blocks(source.size(), kPointBlock, std::cref(body));
}

void accumulate_geometric(NeighbourList& list, const GayBerne& law, std::span<const Quat> orientations,
                          const Executor& executor, Loads& loads) {
  require(law);
  NeighbourList::Impl& impl = list.impl();
  const std::size_t n = impl.reference.size();
  SUPPLE_EXPECTS(orientations.size() == n && loads.force.size() == n && loads.torque.size() == n);
  impl.stage_ellipsoids(squares(law), softness(law), orientations, executor);
  const double volume2 = 2.0 * volume(law) * volume(law);
  const packed::GayBerneNumbers numbers{.range2 = impl.range * impl.range,
                                        .epsilon4 = 4.0 * law.epsilon,
                                        .slope = 24.0 * law.epsilon / law.sigma,
                                        .sigma = law.sigma,
                                        .shift = law.gamma * law.sigma,
                                        .volume2 = volume2,
                                        .upsilon = law.upsilon,
                                        .mu = law.mu};
  impl.clear(impl.force, executor);
  impl.clear(impl.turn, executor);
  packed::EllipsoidRows rows{};
  for (std::size_t k = 0; k < rows.size(); ++k) rows[k] = impl.ellipsoid[k].data();
  impl.for_lists(executor, [&](const packed::ListBlock& block) {
    packed::gay_berne_loads(numbers, block, impl.position.data(), rows, impl.force.data(), impl.turn.data());
  });
  impl.for_points(executor, [&](std::size_t i, std::size_t point) {
    const packed::Row& f = impl.force[point];
    const packed::Row& t = impl.turn[point];
    loads.force[i] += Vec3(f.x, f.y, f.z);
    loads.torque[i] += Vec3(t.x, t.y, t.z);
  });
}

}  // namespace supple::core
