// AVX2 and AVX-512 variants only; support of AES must not affect the variant that a processor gets.
#define HWY_DISABLE_PCLMUL_AES

#include "neighbours/packed_lanes.h"

#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: false warnings in the headers of AVX-512.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "neighbours/packed_gay_berne.cpp"  // NOLINT
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "neighbours/packed_rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace supple::core::packed::HWY_NAMESPACE {

/// A symmetric matrix: its diagonal, and the elements yz, zx and xy.
struct Symmetric {
  Vector d, o;
};

HWY_INLINE Vector cross(const Vector& a, const Vector& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}

HWY_INLINE Vector plus(const Vector& a, const Vector& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}

HWY_INLINE Vector times(const Symmetric& m, const Vector& v) {
  return {hn::MulAdd(m.d.x, v.x, hn::MulAdd(m.o.z, v.y, hn::Mul(m.o.y, v.z))),
          hn::MulAdd(m.o.z, v.x, hn::MulAdd(m.d.y, v.y, hn::Mul(m.o.x, v.z))),
          hn::MulAdd(m.o.y, v.x, hn::MulAdd(m.o.x, v.y, hn::Mul(m.d.z, v.z)))};
}

/// The inverse times the determinant.
HWY_INLINE Symmetric adjugate(const Symmetric& m) {
  return {{hn::MulSub(m.d.y, m.d.z, hn::Mul(m.o.x, m.o.x)), hn::MulSub(m.d.z, m.d.x, hn::Mul(m.o.y, m.o.y)),
           hn::MulSub(m.d.x, m.d.y, hn::Mul(m.o.z, m.o.z))},
          {hn::MulSub(m.o.y, m.o.z, hn::Mul(m.d.x, m.o.x)), hn::MulSub(m.o.z, m.o.x, hn::Mul(m.d.y, m.o.y)),
           hn::MulSub(m.o.x, m.o.y, hn::Mul(m.d.z, m.o.z))}};
}

/// The vector of the antisymmetric part of A C: (AC)_yz - (AC)_zy and so on.
HWY_INLINE Vector twist(const Symmetric& a, const Symmetric& c) {
  const auto part = [](V dy, V dz, V cx, V ox, V cz, V cy) HWY_ATTR {
    return hn::MulAdd(hn::Sub(dy, dz), cx, hn::Mul(ox, hn::Sub(cz, cy)));
  };
  const Vector o = cross(a.o, c.o);
  return {hn::Sub(part(a.d.y, a.d.z, c.o.x, a.o.x, c.d.z, c.d.y), o.x),
          hn::Sub(part(a.d.z, a.d.x, c.o.y, a.o.y, c.d.x, c.d.z), o.y),
          hn::Sub(part(a.d.x, a.d.y, c.o.z, a.o.z, c.d.y, c.d.x), o.z)};
}

HWY_INLINE V whole_power(V x, int n) {
  V y = set(1.0);
  for (; n > 0; n >>= 1) {
    if ((n & 1) != 0) y = hn::Mul(y, x);
    x = hn::Mul(x, x);
  }
  return y;
}

struct alignas(64) Column {
  double v[kBatch];
};
struct Columns3 {
  Column x, y, z;
};

HWY_INLINE V load(const Column& c, std::size_t k) { return hn::Load(D(), c.v + k); }
HWY_INLINE Vector load(const Columns3& c, std::size_t k) { return {load(c.x, k), load(c.y, k), load(c.z, k)}; }
HWY_INLINE void store(V value, std::size_t k, Column& c) { hn::Store(value, D(), c.v + k); }
HWY_INLINE void store(const Vector& value, std::size_t k, Columns3& c) {
  store(value.x, k, c.x);
  store(value.y, k, c.y);
  store(value.z, k, c.z);
}

/// Values of a batch, filled by short passes. k = adj(G) r, i = adj(B) r; of the first particle
/// k_turn = G_i k x k, i_turn = B_i i x i and det_turn = twist(G_i, adj(G)).
struct Ellipsoids {
  Columns3 r, k, k_turn, det_turn, i, i_turn;
  Column det_g, det_b;
  Column c0, e1, e2, f1, f2, f3;
};
constexpr std::size_t kNear = 8;  ///< batches that stay in the first cache

HWY_INLINE Symmetric broadcast_two(const double* diagonal, const double* other) {
  return {broadcast(diagonal), broadcast(other)};
}

/// With U = R(h) eta chi, h = d - sqrt(2 d^2 / Q), Q = r . k / det G, P = r . i / det B:
/// dU/dr = c0 r + e1 k + e2 i, and the torque on the first particle is f1 k_turn + f2 i_turn + f3 det_turn.
HWY_INLINE void evaluate_gains(const GayBerneNumbers& law, std::size_t p, Ellipsoids& near) {
  const Vector r = load(near.r, p);
  const V det_g = load(near.det_g, p), det_b = load(near.det_b, p);
  const V q = dot(r, load(near.k, p)), w = dot(r, load(near.i, p));
  const V d2 = squared(r);
  const V by_g = hn::Div(set(1.0), hn::Mul(det_g, q));
  const V w_d2 = hn::Mul(w, d2);
  const V by_b = hn::Div(set(1.0), hn::Mul(det_b, w_d2));
  const V inverse_q = hn::Mul(by_g, det_g), inverse_det_g = hn::Mul(by_g, q);
  const V inverse_d2 = hn::Mul(by_b, hn::Mul(det_b, w)), inverse_det_b = hn::Mul(by_b, w_d2);
  const V inverse_w = hn::Mul(by_b, hn::Mul(det_b, d2));

  const V touch = hn::Sqrt(hn::Mul(hn::Add(d2, d2), hn::Mul(det_g, inverse_q)));
  const V h = hn::Sub(hn::Sqrt(d2), touch);
  const V rho = hn::Div(set(law.sigma), hn::Add(h, set(law.shift)));
  const V rho3 = hn::Mul(hn::Mul(rho, rho), rho);
  const V rho6 = hn::Mul(rho3, rho3);
  const V w_over = hn::Mul(w, hn::Mul(inverse_det_b, inverse_d2));
  const V eta = whole_power(hn::Sqrt(hn::Mul(set(law.volume2), inverse_det_g)), law.upsilon);
  const V chi = whole_power(hn::Add(w_over, w_over), law.mu);
  const V both = hn::IfThenElseZero(hn::Lt(d2, set(law.range2)), hn::Mul(eta, chi));
  const V energy = hn::Mul(both, hn::Mul(set(law.epsilon4), hn::MulSub(rho6, rho6, rho6)));
  const V slope = hn::Mul(both, hn::Mul(hn::Mul(set(law.slope), rho), hn::NegMulAdd(hn::Add(rho6, rho6), rho6, rho6)));

  const V mu2 = hn::Mul(set(2.0 * law.mu), energy);
  const V e1 = hn::Mul(slope, hn::Mul(touch, inverse_q));
  const V e2 = hn::Mul(mu2, inverse_w);
  store(hn::Mul(hn::MulSub(slope, h, mu2), inverse_d2), p, near.c0);
  store(e1, p, near.e1);
  store(e2, p, near.e2);
  store(hn::Mul(e1, inverse_det_g), p, near.f1);
  store(hn::Mul(e2, inverse_det_b), p, near.f2);
  store(hn::Mul(set(static_cast<double>(law.upsilon)), hn::Mul(energy, inverse_det_g)), p, near.f3);
}

HWY_INLINE void add_ellipsoid_loads(std::uint32_t i, const std::uint32_t* HWY_RESTRICT j, const Ellipsoids& near,
                                    double* HWY_RESTRICT forces, double* HWY_RESTRICT torques) {
  Vector push[kParts], turn_i[kParts], turn_j[kParts];
  for (std::size_t p = 0; p < kParts; ++p) {
    const std::size_t k = p * kLanes;
    const Vector r = load(near.r, k);
    const Vector side = scaled_sum(load(near.e1, k), load(near.k, k), scaled(load(near.e2, k), load(near.i, k)));
    push[p] = scaled_sum(load(near.c0, k), r, side);
    turn_i[p] = scaled_sum(load(near.f1, k), load(near.k_turn, k),
                           scaled_sum(load(near.f2, k), load(near.i_turn, k),
                                      scaled(load(near.f3, k), load(near.det_turn, k))));
    turn_j[p] = minus(cross(r, side), turn_i[p]);
  }
  const Rows gradient = rows_of(push);
  add_total(gradient, forces + i);
  subtract_rows(gradient, j, forces);
  add_total(rows_of(turn_i), torques + i);
  add_rows(rows_of(turn_j), j, torques);
}

void GayBerneLoads(const GayBerneNumbers& given, const ListBlock& list, const Row* HWY_RESTRICT position,
                   const EllipsoidRows& ellipsoid, Row* HWY_RESTRICT force, Row* HWY_RESTRICT torque) {
  const GayBerneNumbers law = given;
  const double* HWY_RESTRICT rows = &position->x;
  const double* HWY_RESTRICT g_diagonal = &ellipsoid[0]->x;
  const double* HWY_RESTRICT g_other = &ellipsoid[1]->x;
  const double* HWY_RESTRICT b_diagonal = &ellipsoid[2]->x;
  const double* HWY_RESTRICT b_other = &ellipsoid[3]->x;
  Ellipsoids near[kNear];
  for (std::size_t begin = 0; begin < list.batches; begin += kNear) {
    const std::uint32_t* HWY_RESTRICT owner = list.owner.data() + begin;
    const std::uint32_t* HWY_RESTRICT neighbour = list.neighbour.data() + kBatch * begin;
    const std::size_t count = std::min(list.batches - begin, kNear);
    for (std::size_t b = 0; b < count; ++b) {
      const Vector x = broadcast(rows + owner[b]);
      const Symmetric own = broadcast_two(g_diagonal + owner[b], g_other + owner[b]);
      for (std::size_t p = 0; p < kBatch; p += kLanes) {
        const std::uint32_t* HWY_RESTRICT j = neighbour + kBatch * b + p;
        const Vector r = minus(load_rows(rows, j), x);
        const Symmetric g{plus(own.d, load_rows(g_diagonal, j)), plus(own.o, load_rows(g_other, j))};
        const Symmetric c = adjugate(g);
        const Vector k = times(c, r);
        store(r, p, near[b].r);
        store(k, p, near[b].k);
        store(dot(Vector{g.d.x, g.o.z, g.o.y}, Vector{c.d.x, c.o.z, c.o.y}), p, near[b].det_g);
        store(cross(times(own, k), k), p, near[b].k_turn);
        store(twist(own, c), p, near[b].det_turn);
      }
    }
    for (std::size_t b = 0; b < count; ++b) {
      const Symmetric own = broadcast_two(b_diagonal + owner[b], b_other + owner[b]);
      for (std::size_t p = 0; p < kBatch; p += kLanes) {
        const std::uint32_t* HWY_RESTRICT j = neighbour + kBatch * b + p;
        const Symmetric g{plus(own.d, load_rows(b_diagonal, j)), plus(own.o, load_rows(b_other, j))};
        const Symmetric c = adjugate(g);
        const Vector i = times(c, load(near[b].r, p));
        store(i, p, near[b].i);
        store(dot(Vector{g.d.x, g.o.z, g.o.y}, Vector{c.d.x, c.o.z, c.o.y}), p, near[b].det_b);
        store(cross(times(own, i), i), p, near[b].i_turn);
      }
    }
    for (std::size_t b = 0; b < count; ++b) {
      for (std::size_t p = 0; p < kBatch; p += kLanes) evaluate_gains(law, p, near[b]);
    }
    for (std::size_t b = 0; b < count; ++b) {
      add_ellipsoid_loads(owner[b], neighbour + kBatch * b, near[b], &force->x, &torque->x);
    }
  }
}

}  // namespace supple::core::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace supple::core::packed {

HWY_EXPORT(GayBerneLoads);

void gay_berne_loads(const GayBerneNumbers& law, const ListBlock& list, const Row* position,
                     const EllipsoidRows& ellipsoid, Row* force, Row* torque) {
  HWY_DYNAMIC_DISPATCH(GayBerneLoads)(law, list, position, ellipsoid, force, torque);
}

}  // namespace supple::core::packed
#endif  // HWY_ONCE
