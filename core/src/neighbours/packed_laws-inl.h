// The laws of packed loops, for vectors of doubles and of floats. Included once for each width.
#if defined(SUPPLE_PACKED_LAWS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SUPPLE_PACKED_LAWS_INL_H
#undef SUPPLE_PACKED_LAWS_INL_H
#else
#define SUPPLE_PACKED_LAWS_INL_H
#endif

#include "neighbours/packed_rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {

template <class W>
HWY_INLINE W all(double value) {
  return hn::Set(hn::DFromV<W>(), static_cast<hn::TFromV<W>>(value));
}

/// The force on the neighbour over r; 0 out of range.
template <class W>
HWY_INLINE W twelve_six_slope(const TwelveSixNumbers& law, W d2, W inverse) {
  const W i6 = hn::Mul(hn::Mul(inverse, inverse), inverse);
  const W g = hn::Mul(hn::Mul(i6, inverse), hn::MulSub(all<W>(law.twelve), i6, all<W>(law.six)));
  return hn::IfThenElseZero(hn::Lt(d2, all<W>(law.range2)), g);
}

template <class W>
struct SurfaceGains {
  W g, u_a, u_b, u_c;
};

/// With a = n_i . r, b = n_j . r, c = n_i . n_j the energy of a pair is U_c(d) + psi E,
/// E = k_f (kappa^2 + 2 w / d^2) + a q_a + b q_b + 2 k_n (1 - c), w = kappa (a - b) + 1 - c,
/// q_a = k_p a + k_c (a + b), q_b = k_p b + k_c (a + b),
/// so that dU/dr = G r + U_a n_i + U_b n_j, dU/dn_i = U_a r + U_c n_j and dU/dn_j = U_b r + U_c n_i.
/// @param pull  slope of cohesion times d
template <class W>
HWY_INLINE SurfaceGains<W> surface_gains(const SurfaceNumbers& law, const VectorOf<W>& r, const VectorOf<W>& n,
                                         const VectorOf<W>& m, W pull) {
  const W one = all<W>(1.0);
  const W d2 = squared(r);
  const W inverse = hn::Div(one, d2);
  const W rest = hn::Max(hn::NegMulAdd(d2, all<W>(law.inverse_h2), one), all<W>(0.0));
  const W a = dot(n, r), b = dot(m, r);
  const W unlike = hn::NegMulAdd(n.x, m.x, hn::NegMulAdd(n.y, m.y, hn::NegMulAdd(n.z, m.z, one)));
  const W rest2 = hn::Mul(rest, rest);
  const W psi = hn::Mul(rest2, rest);
  const W form = hn::Mul(all<W>(law.form4), inverse);
  const W bend = hn::Mul(all<W>(law.half_curvature), form);
  const W q_a = hn::MulAdd(all<W>(law.flatness2), a, hn::Mul(all<W>(law.cocircularity2), b));
  const W q_b = hn::MulAdd(all<W>(law.flatness2), b, hn::Mul(all<W>(law.cocircularity2), a));
  const W bent = hn::Mul(form, hn::MulAdd(all<W>(law.curvature), hn::Sub(a, b), unlike));
  const W e2 = hn::Add(hn::MulAdd(all<W>(law.conormality4), unlike, hn::Add(bent, all<W>(law.form_offset2))),
                       hn::MulAdd(a, q_a, hn::Mul(b, q_b)));
  const W radial = hn::Mul(inverse, hn::NegMulAdd(psi, bent, pull));
  return {.g = hn::MulAdd(hn::Mul(rest2, all<W>(law.slope)), e2, radial),
          .u_a = hn::Mul(psi, hn::Add(q_a, bend)),
          .u_b = hn::Mul(psi, hn::Sub(q_b, bend)),
          .u_c = hn::Mul(psi, hn::NegMulAdd(all<W>(0.5), form, all<W>(-law.conormality2)))};
}

}  // namespace supple::core::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
