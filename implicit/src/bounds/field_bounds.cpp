// Bounds of F and |grad F| on boxes: kernels fall with distance, so f on a box lies between g(d_far) and g(d_near), and
// the sum of these intervals holds F. Those of second order: field_box_bounds.cpp.
#include <algorithm>
#include <cmath>
#include <limits>

#include "field/field_index.h"
#include "field/field_lanes.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// @param lower, upper  corners of the box relative to the primitive's position
DistanceRange range_between(const PackedPrimitive& p, const PackedShape& shape, const Vec3& lower, const Vec3& upper) {
  if (p.kind == PackedKind::PointWyvill || p.kind == PackedKind::PointGascuel) {
    const Vec3 near = lower.cwiseMax(-upper).cwiseMax(0.0);
    const Vec3 far = lower.cwiseAbs().cwiseMax(upper.cwiseAbs());
    return {near.squaredNorm(), far.squaredNorm()};
  }
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> A(shape.to_local.data());
  const Vec3 centre = 0.5 * (lower + upper);
  const Vec3 half_box = 0.5 * (upper - lower);
  const Vec3 y = A * centre;
  // Distance changes by at most distance_scale per length, which is the better bound for boxes turned by 45 degrees.
  const double steps = shape.distance_scale * half_box.norm() * (1.0 + 1e-14);
  if (shape.foot == PackedFoot::Scalar) {
    const double here = std::sqrt(foot(shape.view, y).q);
    // Round-off: of y, and of the foot point on curves, whose polynomials cancel.
    const double change = steps + 1e-13 * shape.distance_scale * (centre.norm() + half_box.norm() + shape.kernel.radius);
    const double least = std::max(here - change, 0.0);
    return {least * least, (here + change) * (here + change)};
  }
  // The box of the turned box, wider by the round-off of turning it.
  const Mat3 A_abs = A.cwiseAbs();
  const Vec3 spread = A_abs * (half_box + 8.0 * kEps * (centre.cwiseAbs() + half_box));
  Vec3 near = (y.cwiseAbs() - spread).cwiseMax(0.0);
  Vec3 far = y.cwiseAbs() + spread;
  double here2 = 0.0;  // of the centre
  const bool is_disc = shape.foot == PackedFoot::Disc;
  if (is_disc) {
    const double r = shape.half[0];
    const auto rim = [r](double a, double b) { return std::max(std::sqrt(a * a + b * b) - r, 0.0); };
    near = {rim(near.x(), near.y()), 0.0, near.z()};
    far = {rim(far.x(), far.y()), 0.0, far.z()};
    here2 = Vec3(rim(y.x(), y.y()), 0.0, y.z()).squaredNorm();
  } else {
    const Vec3 half(shape.half[0], shape.half[1], shape.half[2]);
    near = (near - half).cwiseMax(0.0);
    far = (far - half).cwiseMax(0.0);
    here2 = (y.cwiseAbs() - half).cwiseMax(0.0).squaredNorm();
  }
  const double change = steps + 1e-15 * spread.sum();
  const double here = std::sqrt(here2);
  const double least = std::max(here * (1.0 - 1e-14) - change, 0.0);
  const double most = here * (1.0 + 1e-14) + change;
  return {std::max(near.squaredNorm(), least * least), std::min(far.squaredNorm(), most * most)};
}

/// Adds the range of primitive i to the sums.
void add_single(const Field::Index& index, std::uint32_t i, const Box& box, bool with_slope, lanes::BoundSums& sums) {
  const PrimitiveBound bound = bound_primitive(index, i, box, with_slope);
  const PackedShape& shape = index.shape[i];
  sums.upper += bound.value.upper;
  sums.lower += bound.value.lower;
  sums.slope += bound.slope;
  sums.scale += shape.peak;
  sums.slope_scale += shape.lipschitz;
  sums.terms += 1.0;
}

/// Sums over the primitives whose support meets the box; subtrees that lie inside it are added as a whole, for each of
/// their primitives then ranges from 0 to its peak.
lanes::BoundSums touching_sums(const Field::Index& index, const Box& box, bool with_slope) {
  if (index.size() > 0 && index.uniform && index.primitive[0].kind == PackedKind::PointWyvill) {
    const lanes::Bounds bounds{{box.lower[0], box.lower[1], box.lower[2]}, {box.upper[0], box.upper[1], box.upper[2]}};
    return lanes::bound_points(index, bounds, with_slope);
  }
  lanes::BoundSums sums;
  if (index.level_count == 0) {
    for (std::uint32_t i = 0; i < index.size(); ++i) {
      if (index.support[i].overlaps(box)) add_single(index, i, box, with_slope, sums);
    }
    return sums;
  }
  struct Entry {
    std::size_t level, pack;
  };
  Entry stack[kPack * 12];
  std::size_t depth = 0;
  stack[depth++] = {index.level_count, 0};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.level == 0) {
      const LeafPack& leaf = index.leaf[entry.pack];
      for (std::size_t s = 0; s < kPack; ++s) {
        if (leaf.reach2[s] >= 0.0 && index.support[leaf.id[s]].overlaps(box)) {
          add_single(index, leaf.id[s], box, with_slope, sums);
        }
      }
      continue;
    }
    const NodePack& node = index.level[entry.level - 1][entry.pack];
    for (std::size_t s = 0; s < kPack; ++s) {
      bool meets = true;
      bool inside = true;
      for (int k = 0; k < 3; ++k) {
        meets = meets && node.lower[k][s] <= box.upper[k] && box.lower[k] <= node.upper[k][s];
        inside = inside && box.lower[k] <= node.lower[k][s] && node.upper[k][s] <= box.upper[k];
      }
      if (!meets) continue;
      if (inside) {
        sums.upper += node.peak[s];
        sums.scale += node.peak[s];
        sums.slope += node.lipschitz[s];
        sums.slope_scale += node.lipschitz[s];
        sums.terms += 1.0;
      } else {
        stack[depth++] = {entry.level - 1, entry.pack * kPack + s};
      }
    }
  }
  return sums;
}

/// Whether {F >= 0} may reach into the box, which is refined down to `resolution`.
bool may_hold(const Field& field, const Box& box, double resolution) {
  if (field.bound(box).upper < 0.0) return false;
  Eigen::Index axis;
  const double edge = box.extent().maxCoeff(&axis);
  if (edge <= resolution) return true;
  Box half = box;
  half.upper[axis] = box.centre()[axis];
  if (may_hold(field, half, resolution)) return true;
  half = box;
  half.lower[axis] = box.centre()[axis];
  return may_hold(field, half, resolution);
}

/// The box of {F >= 0} to within a few hundredths of its size or of the smallest feature.
Box find_surface_box(const Field::Index& index, const Field& field) {
  // The body lies within the supports and contains each primitive's own iso-surface: each side is sought in between.
  Box box;
  Box inner;
  double last_reach = 0.0;
  const Kernel* last_kernel = nullptr;
  for (std::size_t i = 0; i < index.size(); ++i) {
    const PackedShape& shape = index.shape[i];
    box = box.united(index.support[i]);
    if (!(shape.peak > index.iso) || shape.foot == PackedFoot::Convolved) continue;
    const Kernel& k = shape.kernel;
    if (last_kernel == nullptr || *last_kernel != k) {
      last_reach = index.iso > 0.0 ? iso_distance(k, index.iso) : k.radius;
      last_kernel = &k;
    }
    const Box& support = index.support[i];
    const Vec3 beyond = (1.0 - last_reach / k.radius) * shape.rounding;
    const Box own{support.lower + beyond, support.upper - beyond};
    if (!own.empty()) inner = inner.united(own);
  }
  if (box.empty()) return box;
  const double size = box.extent().maxCoeff();
  const double resolution = std::max(0.75 * index.feature_size, size / 48.0);  // some thousand boxes a slab at most
  if (inner.empty()) {
    if (!may_hold(field, box, resolution)) return Box{};
    inner = {box.centre(), box.centre()};
  }
  if (index.size() == 1 && (index.primitive[0].kind == PackedKind::PointWyvill || index.primitive[0].kind == PackedKind::PointGascuel)) {
    return inner.inflated(1e-9 * size);  // a ball, and the tolerance of the search for its radius
  }
  const double tolerance = std::max(index.feature_size / 24.0, size / 256.0);
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool low : {true, false}) {
      double& side = low ? box.lower[axis] : box.upper[axis];  // F is zero beyond it
      double within = low ? inner.lower[axis] : inner.upper[axis];
      while (std::abs(within - side) > tolerance) {
        const double middle = 0.5 * (side + within);
        Box slab = box;
        (low ? slab.upper : slab.lower)[axis] = middle;
        if (may_hold(field, slab, resolution)) {
          within = middle;
        } else {
          side = middle;
        }
      }
    }
  }
  return box;
}

/// By the value at the centre and the largest slope anywhere.
PrimitiveBound bound_convolution(const Field::Index& index, std::uint32_t id, const Box& box) {
  const PackedPrimitive& p = index.primitive[id];
  const PackedShape& shape = index.shape[id];
  const Box part = box.intersection(index.support[id]);
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> A(shape.to_local.data());
  const double f = convolve(shape.view, shape.kernel, A * (part.centre() - Vec3(p.position[0], p.position[1], p.position[2]))).value;
  const double change = 0.5 * part.extent().norm() * shape.lipschitz * (1.0 + 1e-12);
  const bool clipped = part.lower != box.lower || part.upper != box.upper;  // the box reaches where f is 0
  return {.value = {clipped ? 0.0 : std::max(f - change, 0.0), std::min(f + change, shape.peak)}, .slope = shape.lipschitz};
}

}  // namespace

DistanceRange distance_range(const Field::Index& index, std::uint32_t id, const Box& box) {
  const PackedPrimitive& p = index.primitive[id];
  const Vec3 position(p.position[0], p.position[1], p.position[2]);
  const Box part = box.intersection(index.support[id]);
  return range_between(p, index.shape[id], part.lower - position, part.upper - position);
}

PrimitiveBound bound_primitive(const Field::Index& index, std::uint32_t id, const Box& box, bool with_slope) {
  const PackedShape& shape = index.shape[id];
  if (shape.foot == PackedFoot::Convolved) return bound_convolution(index, id, box);
  const DistanceRange range = distance_range(index, id, box);
  PrimitiveBound bound{{evaluate(shape.kernel, range.far2).value, evaluate(shape.kernel, range.near2).value}};
  if (with_slope) {
    bound.slope = shape.distance_scale * lipschitz(shape.kernel, std::sqrt(range.near2), std::sqrt(range.far2));
  }
  return bound;
}

Interval Field::bound(const Box& box) const {
  const Index& index = this->index();
  if (box.empty()) return {-index.iso, -index.iso};
  if (index.blend.active()) return blended_bound(index, box);
  const lanes::BoundSums sums = touching_sums(index, box, false);
  if (sums.terms == 0.0) return {-index.iso, -index.iso};
  const double round_off = (16.0 + sums.terms) * kEps * (sums.scale + index.iso);
  return {std::max(sums.lower - index.iso - round_off, -index.iso), sums.upper - index.iso + round_off};
}

double Field::gradient_bound(const Box& box) const {
  const Index& index = this->index();
  if (box.empty()) return 0.0;
  if (index.blend.active()) return blended_gradient_bound(index, box);
  const lanes::BoundSums sums = touching_sums(index, box, true);
  return sums.slope + (32.0 + sums.terms) * kEps * sums.slope_scale;
}

Box Field::surface_box() const {
  const Index& index = *index_;
  if (!index.surface_box_known.load(std::memory_order_acquire)) {
    const std::lock_guard lock(index.surface_box_mutex);
    if (!index.surface_box_known.load(std::memory_order_relaxed)) {
      index.surface_box = find_surface_box(this->index(), *this);
      index.surface_box_known.store(true, std::memory_order_release);
    }
  }
  return index.surface_box;
}

}  // namespace supple::implicit
