#include "bounds/eighth_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bounds/field_box_bounds.h"
#include "field/field_index.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

using Lanes = Eigen::Array<double, 8, 1>;

bool is_disc(PackedKind kind) { return kind == PackedKind::DiscWyvill || kind == PackedKind::DiscGascuel; }
bool is_wyvill(PackedKind kind) {
  return kind == PackedKind::PointWyvill || kind == PackedKind::SlabWyvill || kind == PackedKind::DiscWyvill;
}

/// f between two distances, 2 df/dq there, and that at a third.
struct KernelRange {
  Lanes lower, upper, steepest, flattest, here;
};

/// f = t^3 and df/dq = -3 t^2 / R^2 with t = 1 - q / R^2.
KernelRange wyvill_range(double inverse_r2, const Lanes& near2, const Lanes& far2, const Lanes& here2) {
  const auto base = [&](const Lanes& q) -> Lanes { return (1.0 - inverse_r2 * q).max(0.0); };
  const Lanes most = base(near2), least = base(far2);
  const double factor = -6.0 * inverse_r2;
  return {least.cube(), most.cube(), factor * most.square(), factor * least.square(), factor * base(here2).square()};
}

/// By df/dd, see kernel.h and slope_range in field_box_bounds.cpp.
KernelRange gascuel_range(const PackedShape& shape, const Lanes& near2, const Lanes& far2, const Lanes& here2) {
  const Kernel& k = shape.kernel;
  struct Sample {
    Lanes value, derivative;
  };
  const auto at = [&](const Lanes& distance) -> Sample {
    const Lanes d = distance.min(k.radius), u = d - k.radius, line = shape.outer_cubic * (d - k.thickness) + shape.outer_square;
    const auto inner = d <= k.thickness;
    return {inner.select(k.iso + k.slope * (k.thickness - d), u.square() * line),
            inner.select(Lanes::Constant(-k.slope), u * (2.0 * line + shape.outer_cubic * u))};
  };
  const Lanes near = near2.sqrt(), far = far2.sqrt(), here = here2.sqrt();
  const Sample most = at(near), least = at(far);
  // Beyond the thickness df/dd is a parabola: steepest at its vertex or at the ends.
  const double vertex = (shape.outer_cubic * (k.thickness + 2.0 * k.radius) - shape.outer_square) / (3.0 * shape.outer_cubic);
  const Lanes steepest = (near < vertex && far > vertex).select(Lanes::Constant(lipschitz(k)), -most.derivative.min(least.derivative)) * (1.0 + 1e-12);
  return {least.value, most.value, -steepest / near, (most.derivative.max(least.derivative) * (1.0 - 1e-12)).min(0.0) / far.max(1e-300),
          at(here).derivative / here.max(1e-300)};
}

template <class Mask>
unsigned bits_of(const Mask& mask) {
  unsigned bits = 0;
  for (int c = 0; c < 8; ++c) bits |= (mask[c] ? 1u : 0u) << c;
  return bits;
}

}  // namespace

bool EighthBounds::know(const Field& field) {
  const Field::Index& index = field.index();
  return !index.blend.active() &&
         std::all_of(index.primitive.begin(), index.primitive.end(), [](const PackedPrimitive& p) { return p.kind != PackedKind::General; });
}

EighthBounds::Verdict EighthBounds::operator()(const Field& field, const Box& box, std::span<const std::uint32_t> ids) {
  const Field::Index& index = field.index();
  Sums sums;
  term_.resize(ids.size());
  for (std::size_t k = 0; k < ids.size(); ++k) {
    term_[k].id = ids[k];
    add(index, box, term_[k], sums);
  }
  const double n = static_cast<double>(ids.size()), scale = sums.scale + index.iso, round_off = (16.0 + n) * kEps * scale;
  Verdict verdict;
  verdict.one_sign = bits_of(sums.lower - round_off > index.iso || sums.upper + round_off < index.iso);
  const double largest = 0.25 * box.extent().maxCoeff();
  if (verdict.one_sign != 0xff) verdict.sloped = ~verdict.one_sign & find_sloped(index, sums.gradient, (64.0 + 2.0 * n) * kEps * scale / largest);
  return verdict;
}

/// As add_slope in field_box_bounds.cpp has them, and distances by the same vectors.
void EighthBounds::add(const Field::Index& index, const Box& box, Term& term, Sums& sums) {
  const PackedPrimitive& p = index.primitive[term.id];
  const PackedShape& shape = index.shape[term.id];
  const Mat3 A = to_local_of(p, shape);
  const Vec3 half = 0.25 * box.extent(), middle = box.centre() - Vec3(p.position[0], p.position[1], p.position[2]);
  const Vec3 y0 = A * middle;
  const double reach = (half + rounding_of(box)).norm();
  // Turning the box takes some round-off.
  const Vec3 step = A.cwiseAbs() * ((1.0 + 1e-12) * half + rounding_of(box) + 16.0 * kEps * (middle.cwiseAbs() + half));
  static const std::array<Lanes, 3> kSide = [] {
    std::array<Lanes, 3> side;
    for (unsigned c = 0; c < 8; ++c) {
      for (unsigned k = 0; k < 3; ++k) side[k][c] = (c >> k & 1u) != 0 ? 1.0 : -1.0;
    }
    return side;
  }();
  std::array<Lanes, 3> y, v;
  for (int k = 0; k < 3; ++k) {
    y[static_cast<std::size_t>(k)] = y0[k] + (A(k, 0) * half.x()) * kSide[0] + (A(k, 1) * half.y()) * kSide[1] + (A(k, 2) * half.z()) * kSide[2];
  }
  Lanes far2;
  term.across = 0.0;
  if (is_disc(p.kind)) {
    const double r = shape.half[0];
    const Lanes rho = (y[0].square() + y[1].square()).sqrt(), beyond = (rho - r).max(0.0), share = beyond / rho.max(1e-300);
    v = {share * y[0], share * y[1], y[2]};
    term.across = std::sqrt(A.rowwise().squaredNorm().maxCoeff()) * reach * (1.0 + 1e-12) + 1e-14 * y0.norm();
    term.low = {v[0], v[1], y[2] - step.z()};
    term.high = {v[0], v[1], y[2] + step.z()};
    term.near2 = (beyond - term.across).max(0.0).square() + (y[2].abs() - step.z()).max(0.0).square();
    far2 = (beyond + term.across).square() + (y[2].abs() + step.z()).square();
  } else {
    term.near2.setZero();
    far2.setZero();
    for (std::size_t k = 0; k < 3; ++k) {
      const double h = shape.half[k], s = step[static_cast<Eigen::Index>(k)];
      const auto gap = [h](const Lanes& at) -> Lanes { return at - at.max(-h).min(h); };
      v[k] = gap(y[k]);
      term.low[k] = gap(y[k] - s);
      term.high[k] = gap(y[k] + s);
      term.near2 += term.low[k].max(-term.high[k]).max(0.0).square();
      far2 += term.low[k].abs().max(term.high[k].abs()).square();
    }
  }
  const Lanes here2 = v[0].square() + v[1].square() + v[2].square(), here = here2.sqrt();
  const double change = shape.distance_scale * reach * (1.0 + 1e-12) + 1e-14 * (y0.norm() + step.sum());
  term.near2 = term.near2.max((here * (1.0 - 1e-14) - change).max(0.0).square());
  far2 = far2.min((here * (1.0 + 1e-14) + change).square());
  term.radius2 = shape.kernel.radius * shape.kernel.radius * (1.0 + 1e-12);
  const KernelRange range = is_wyvill(p.kind) ? wyvill_range(p.inverse_r2, term.near2, far2, here2) : gascuel_range(shape, term.near2, far2, here2);
  sums.lower += range.lower;
  sums.upper += range.upper;
  term.steepest = range.steepest;
  term.flattest = range.flattest;
  for (int k = 0; k < 3; ++k) {
    sums.gradient[static_cast<std::size_t>(k)] += range.here * (A(0, k) * v[0] + A(1, k) * v[1] + A(2, k) * v[2]);
  }
  sums.scale += shape.peak + shape.lipschitz * reach;
}

unsigned EighthBounds::find_sloped(const Field::Index& index, const std::array<Lanes, 3>& gradient, double slack) const {
  const Lanes length = (gradient[0].square() + gradient[1].square() + gradient[2].square()).sqrt();
  const Lanes inverse = 1.0 / length.max(1e-300);
  const std::array<Lanes, 3> n{inverse * gradient[0], inverse * gradient[1], inverse * gradient[2]};
  Lanes rise = Lanes::Constant(-slack);
  for (const Term& term : term_) {
    const Mat3 A = to_local_of(index.primitive[term.id], index.shape[term.id]);
    std::array<Lanes, 3> m;
    for (int k = 0; k < 3; ++k) m[static_cast<std::size_t>(k)] = A(k, 0) * n[0] + A(k, 1) * n[1] + A(k, 2) * n[2];
    Lanes way = Lanes::Zero();  // largest m.v
    for (std::size_t k = 0; k < 3; ++k) way += (m[k] * term.low[k]).max(m[k] * term.high[k]);
    if (term.across > 0.0) way += term.across * (m[0].square() + m[1].square()).sqrt();
    rise += (way > 0.0).select(term.steepest, term.flattest) * way;
  }
  return bits_of(rise > 0.0);
}

void EighthBounds::narrow(unsigned eighth, std::vector<std::uint32_t>& ids) const {
  ids.clear();
  for (const Term& term : term_) {
    if (!(term.near2[eighth] > term.radius2)) ids.push_back(term.id);
  }
}

}  // namespace supple::implicit
