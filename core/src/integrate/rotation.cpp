// Rotations of rigid bodies (docs/notation.md): exponential, logarithm, free motion.
#include <array>
#include <cmath>

#include "integrate/step.h"
#include "laws/lanes.h"
#include "supple/core/integrate.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

template <class T>
struct HalfAngle {
  T sinc;  ///< sin(x) / x
  T cos;
};

constexpr double kSeriesLimit = 0.0625;

/// sin(x)/x and cos(x) by series of x^2, where eight terms are exact to the last place.
template <class T>
HalfAngle<T> half_angle_series(T x2) {
  constexpr std::array<double, 7> kSinc{1.0,        -1.0 / 6.0,          1.0 / 120.0,         -1.0 / 5040.0,
                                        1.0 / 362880.0, -1.0 / 39916800.0, 1.0 / 6227020800.0};
  constexpr std::array<double, 8> kCos{1.0,           -1.0 / 2.0,         1.0 / 24.0,          -1.0 / 720.0,
                                       1.0 / 40320.0, -1.0 / 3628800.0, 1.0 / 479001600.0, -1.0 / 87178291200.0};
  T sinc(kSinc.back());
  for (std::size_t k = kSinc.size() - 1; k-- > 0;) sinc = fma(sinc, x2, T(kSinc[k]));
  T cos(kCos.back());
  for (std::size_t k = kCos.size() - 1; k-- > 0;) cos = fma(cos, x2, T(kCos[k]));
  return {sinc, cos};
}

HalfAngle<double> half_angle(double x2) {
  if (x2 < kSeriesLimit) return half_angle_series(x2);
  const double x = std::sqrt(x2);
  const math::SinCos value = math::sin_cos(x);
  return {value.sin / x, value.cos};
}

/// q turned by twice the rotation vector `half`, of unit length.
template <class T>
Rotation<T> turned(const HalfAngle<T>& value, const Vector<T>& half, const Rotation<T>& q) {
  const Rotation<T> p = product({value.sinc * half, value.cos}, q);
  const T scale = fma(T(-0.5), fma(p.w, p.w, dot(p.u, p.u)), T(1.5));
  return {scale * p.u, scale * p.w};
}

/// One Newton step to unit length; a product of unit quaternions is a rounding error away from it.
void renormalise(Quat& q) { q.coeffs() *= 1.5 - 0.5 * q.squaredNorm(); }

/// R_k(h): the exact flow of L_k^2 / (2 I_k) over h on the orientation and the body angular momentum.
void rotate_about_axis(int k, double h, const Vec3& inertia, Quat& q, Vec3& body_momentum) {
  const double half = 0.5 * h * body_momentum[k] / inertia[k];
  const HalfAngle<double> value = half_angle(half * half);
  const double s = value.sinc * half;
  const double c = value.cos;
  const int i = (k + 1) % 3;
  const int j = (k + 2) % 3;
  const double sin_full = 2.0 * s * c;
  const double cos_full = 1.0 - 2.0 * s * s;
  const double l_i = body_momentum[i];
  const double l_j = body_momentum[j];
  body_momentum[i] = cos_full * l_i + sin_full * l_j;
  body_momentum[j] = -sin_full * l_i + cos_full * l_j;
  Vec3 axis = Vec3::Zero();
  axis[k] = s;
  q = q * Quat(c, axis.x(), axis.y(), axis.z());
}

}  // namespace

Quat rotation_exp(const Vec3& rotation) {
  const HalfAngle<double> value = half_angle(0.25 * rotation.squaredNorm());
  const Vec3 u = 0.5 * value.sinc * rotation;
  return Quat(value.cos, u.x(), u.y(), u.z());
}

Vec3 rotation_log(const Quat& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Vec3 u = sign * q.vec();
  const double w = sign * q.w();
  const double length = u.norm();
  // Below 1e-8 the arc tangent equals its argument to the last place.
  if (length < 1e-8) return 2.0 / w * u;
  return 2.0 * math::atan2(length, w) / length * u;
}

void rotate_free(Quat& orientation, const Vec3& angular_momentum, const Vec3& inertia, double dt) {
  if (inertia.x() == inertia.y() && inertia.y() == inertia.z()) {
    const double scale = 0.5 * dt / inertia.x();
    const Vector<double> half{scale * angular_momentum.x(), scale * angular_momentum.y(), scale * angular_momentum.z()};
    const Rotation<double> q{{orientation.x(), orientation.y(), orientation.z()}, orientation.w()};
    const Rotation<double> next = turned(half_angle(dot(half, half)), half, q);
    orientation = Quat(next.w, next.u.x, next.u.y, next.u.z);
  } else {
    Vec3 body = orientation.conjugate() * angular_momentum;
    rotate_about_axis(2, 0.5 * dt, inertia, orientation, body);
    rotate_about_axis(1, 0.5 * dt, inertia, orientation, body);
    rotate_about_axis(0, dt, inertia, orientation, body);
    rotate_about_axis(1, 0.5 * dt, inertia, orientation, body);
    rotate_about_axis(2, 0.5 * dt, inertia, orientation, body);
    renormalise(orientation);
  }
}

bool rotate_four(const Vec3* angular_momentum, const Vec3* inertia, double dt, Quat* orientation) {
  const auto all = [](__m256d is_true) { return _mm256_movemask_pd(is_true) == 0xf; };
  const Vector<Lanes> moment = load_vectors(inertia->data());
  const __m256d isotropic = _mm256_and_pd(_mm256_cmp_pd(moment.x.v, moment.y.v, _CMP_EQ_OQ),
                                          _mm256_cmp_pd(moment.y.v, moment.z.v, _CMP_EQ_OQ));
  const Lanes scale = Lanes(0.5 * dt) / moment.x;
  const Vector<Lanes> half = scale * load_vectors(angular_momentum->data());
  const Lanes x2 = dot(half, half);
  if (!all(_mm256_and_pd(isotropic, _mm256_cmp_pd(x2.v, _mm256_set1_pd(kSeriesLimit), _CMP_LT_OQ)))) return false;
  std::array<Lanes, 4> q;
  for (std::size_t k = 0; k < 4; ++k) q[k] = Lanes::load_any(orientation[k].coeffs().data());
  transpose(q[0], q[1], q[2], q[3]);
  const Rotation<Lanes> next = turned(half_angle_series(x2), half, {{q[0], q[1], q[2]}, q[3]});
  q = {next.u.x, next.u.y, next.u.z, next.w};
  transpose(q[0], q[1], q[2], q[3]);
  for (std::size_t k = 0; k < 4; ++k) {
    if (angular_momentum[k] != Vec3::Zero()) q[k].store_any(orientation[k].coeffs().data());
  }
  return true;
}

void rotate_free_exponential(Quat& orientation, const Vec3& angular_momentum, const Vec3& inertia, double dt) {
  if (inertia.x() == inertia.y() && inertia.y() == inertia.z()) {
    rotate_free(orientation, angular_momentum, inertia, dt);
    return;
  }
  const auto angular_velocity_at = [&](const Quat& q) {
    return Vec3(q * (q.conjugate() * angular_momentum).cwiseQuotient(inertia));
  };
  Vec3 omega = angular_velocity_at(orientation);
  // The iteration contracts by about |dt omega| / 2; it ends at rounding errors.
  constexpr int kMostIterations = 60;
  for (int k = 0; k < kMostIterations; ++k) {
    const Vec3 next = angular_velocity_at(rotation_exp(0.5 * dt * omega) * orientation);
    const double change2 = (next - omega).squaredNorm();
    omega = next;
    if (!(change2 > 1e-31 * omega.squaredNorm())) break;
  }
  orientation = rotation_exp(dt * omega) * orientation;
  renormalise(orientation);
}

}  // namespace supple::core
