#include "field/field_index.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Relative widening of reaches: far above the round-off of q, far below anything that costs time.
constexpr double kSlack = 1e-12;

PackedFoot foot_of(const Primitive& p) noexcept {
  if (p.convolved) return PackedFoot::Convolved;
  switch (p.shape) {
    case ShapeKind::Segment: return p.taper == 1.0 ? PackedFoot::Slab : PackedFoot::Scalar;
    case ShapeKind::Point:
    case ShapeKind::Rectangle:
    case ShapeKind::Box:
    case ShapeKind::Ellipsoid: return PackedFoot::Slab;
    case ShapeKind::Disc: return PackedFoot::Disc;
    default: return PackedFoot::Scalar;
  }
}

PackedKind kind_of(const Primitive& p) noexcept {
  const bool wyvill = p.kernel.kind == KernelKind::Wyvill;
  const PackedFoot foot = foot_of(p);
  if ((!wyvill && p.kernel.kind != KernelKind::Gascuel) || foot == PackedFoot::Scalar || foot == PackedFoot::Convolved) {
    return PackedKind::General;
  }
  if (foot == PackedFoot::Disc) return wyvill ? PackedKind::DiscWyvill : PackedKind::DiscGascuel;
  if (p.shape == ShapeKind::Point && p.stretch == Vec3::Ones()) return wyvill ? PackedKind::PointWyvill : PackedKind::PointGascuel;
  return wyvill ? PackedKind::SlabWyvill : PackedKind::SlabGascuel;
}

/// A primitive as the kernels of the index take it.
struct PackedRow {
  PackedPrimitive& packed;
  PackedShape& shape;
  RoundedBox& rounded;
};

/// @param control  where the primitive's control points have been copied to
void pack(const Primitive& p, const Vec3* control, const Vec3& position, const Mat3& rotation, const PackedRow& row) noexcept {
  auto& [packed, shape, rounded] = row;
  const double R = p.kernel.radius;
  packed.position = {position.x(), position.y(), position.z()};
  packed.inverse_r2 = 1.0 / (R * R);
  packed.gradient_factor = -6.0 / (R * R);
  packed.kind = kind_of(p);
  packed.part = p.part;

  Vec3 half = Vec3::Zero();  // of the flat part, primitive frame
  shape.view = view_of(p);
  shape.view.control = {control, p.control.size()};
  Vec3 scale = p.stretch;
  switch (p.shape) {
    case ShapeKind::Segment:
    case ShapeKind::Disc: half = {p.size.x(), 0.0, 0.0}; break;
    case ShapeKind::Rectangle: half = {p.size.x(), p.size.y(), 0.0}; break;
    case ShapeKind::Box: half = p.size; break;
    case ShapeKind::Ellipsoid:
      scale = scale.cwiseProduct(p.size / R);
      shape.view.kind = ShapeKind::Point;
      break;
    default: break;
  }
  const Mat3 A = scale.cwiseInverse().asDiagonal() * rotation.transpose();
  const Support support = support_of(p, rotation);
  shape.rounding = support.rounding;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    for (int j = 0; j < 3; ++j) shape.to_local[static_cast<std::size_t>(3 * i + j)] = A(i, j);
    const double low = support.core.lower[i], high = support.core.upper[i];
    const double slack = kSlack * (support.core.extent().maxCoeff() + R) + 1e-15 * std::abs(position[i]);
    rounded.lower[k] = position[i] + low - slack * (low != 0.0);  // exact for a point
    rounded.upper[k] = position[i] + high + slack * (high != 0.0);
    shape.half[k] = half[i];
  }
  rounded.reach2 = support.reach * support.reach * (1.0 + 4.0 * kSlack);
  shape.kernel = p.kernel;
  shape.foot = foot_of(p);
  shape.distance_scale = distance_scale(p);
  shape.peak = peak(p.kernel);
  if (p.kernel.kind == KernelKind::Gascuel) {
    const double w = R - p.kernel.thickness;
    shape.outer_square = p.kernel.iso / (w * w);
    shape.outer_cubic = (2.0 * p.kernel.iso / w - p.kernel.slope) / (w * w);
  }
  shape.lipschitz = shape.distance_scale * lipschitz(p.kernel);
  if (p.convolved) {
    const ConvolutionLimits limits = convolution_limits(shape.view, p.kernel);
    shape.peak = limits.peak;
    shape.lipschitz = shape.distance_scale * limits.slope;
  }
}

/// The ten bits of x, two zeros between each and the next.
std::uint32_t spread_bits(std::uint32_t x) noexcept {
  x = (x | (x << 16)) & 0x030000ffu;
  x = (x | (x << 8)) & 0x0300f00fu;
  x = (x | (x << 4)) & 0x030c30c3u;
  return (x | (x << 2)) & 0x09249249u;
}

void set_box(NodePack& pack, std::size_t slot, const Box& box) noexcept {
  for (int k = 0; k < 3; ++k) {
    pack.lower[k][slot] = box.lower[k];
    pack.upper[k][slot] = box.upper[k];
  }
}

}  // namespace

double feature_of(const Primitive& p) noexcept {
  const Kernel& k = p.kernel;
  // The slope of Wyvill's kernel sets what counts as a feature of the others.
  const double kernel = k.kind == KernelKind::Gascuel  ? std::min(k.thickness, k.radius - k.thickness)
                        : k.kind == KernelKind::Wyvill ? k.radius
                                                       : std::min(k.radius, 1.717300207 / lipschitz(k));
  return kernel / distance_scale(p);
}

void Field::Index::pack_balls() {
  if (ball_radius.empty()) return;
  const std::size_t n = size();
  shape.resize(n);
  rounded.resize(n);
  support.resize(n);
  double extent = 0.0;
  Primitive ball;
  for (std::size_t i = 0; i < n; ++i) {
    if (ball.kernel.radius != ball_radius[i]) ball.kernel = Kernel::wyvill(ball_radius[i]);
    const Vec3 position(primitive[i].position[0], primitive[i].position[1], primitive[i].position[2]);
    PackedPrimitive same;
    pack(ball, nullptr, position, Mat3::Identity(), {same, shape[i], rounded[i]});
    support[i] = placed_support(ball, position, Mat3::Identity());
    extent += support[i].extent().sum();
  }
  typical_extent = extent / (3.0 * static_cast<double>(n));
}

void Field::Index::build_leaves() {
  const std::size_t n = size();
  order.resize(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<std::uint32_t>(i);
  if (n > kScanLimit) {
    Box all;
    for (const Box& box : support) all.include(box.centre());
    const Vec3 scale = all.extent().unaryExpr([](double e) { return e > 0.0 ? 1023.0 / e : 0.0; });
    code.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3 cell = (support[i].centre() - all.lower).cwiseProduct(scale);
      code[i] = spread_bits(static_cast<std::uint32_t>(cell.x())) |
                (spread_bits(static_cast<std::uint32_t>(cell.y())) << 1) |
                (spread_bits(static_cast<std::uint32_t>(cell.z())) << 2);
    }
    // Stable radix sort, so that equal codes stay in id order.
    order_swap.resize(n);
    for (std::uint32_t shift = 0; shift < 30; shift += 10) {
      std::array<std::uint32_t, 1025> start{};
      for (std::size_t i = 0; i < n; ++i) ++start[((code[i] >> shift) & 1023u) + 1];
      for (std::size_t b = 0; b < 1024; ++b) start[b + 1] += start[b];
      for (std::size_t i = 0; i < n; ++i) order_swap[start[(code[order[i]] >> shift) & 1023u]++] = order[i];
      order.swap(order_swap);
    }
  }
  leaf.resize((n + kPack - 1) / kPack);
  for (std::size_t i = 0; i < leaf.size() * kPack; ++i) {
    LeafPack& pack = leaf[i / kPack];
    if (i < n) {
      set_slot(pack, i % kPack, rounded[order[i]], order[i]);
      pack.inverse_r2[i % kPack] = primitive[order[i]].inverse_r2;
    } else {
      clear_slot(pack, i % kPack);
    }
  }
}

void Field::Index::build_levels() {
  level_count = 0;
  const std::size_t n = size();
  if (n <= kScanLimit) return;
  struct Sums {
    double peak, lipschitz;
  };
  const auto leaf_sums = [&](std::size_t l) {
    Sums sums{0.0, 0.0};
    for (std::size_t i = l * kPack; i < std::min(n, (l + 1) * kPack); ++i) {
      const PackedShape& s = shape[order[i]];
      sums.peak += s.peak;
      sums.lipschitz += s.lipschitz;
    }
    return sums;
  };
  leaf_box.assign(leaf.size(), Box{});
  for (std::size_t i = 0; i < n; ++i) leaf_box[i / kPack] = leaf_box[i / kPack].united(support[order[i]]);
  std::vector<Box>* below = &leaf_box;
  std::vector<Box>* above = &box_swap;
  while (below->size() > 1 || level_count == 0) {
    if (level.size() == level_count) level.emplace_back();
    std::vector<NodePack>& nodes = level[level_count];
    const std::size_t count = below->size();
    nodes.resize((count + kPack - 1) / kPack);
    above->assign(nodes.size(), Box{});
    for (std::size_t i = 0; i < nodes.size() * kPack; ++i) {
      NodePack& node = nodes[i / kPack];
      const std::size_t slot = i % kPack;
      if (i >= count) {
        set_box(node, slot, Box{});
        node.peak[slot] = 0.0;
        node.lipschitz[slot] = 0.0;
        continue;
      }
      set_box(node, slot, (*below)[i]);
      (*above)[i / kPack] = (*above)[i / kPack].united((*below)[i]);
      Sums sums{0.0, 0.0};
      if (level_count == 0) {
        sums = leaf_sums(i);
      } else {
        const NodePack& child = level[level_count - 1][i];
        for (std::size_t s = 0; s < kPack; ++s) {
          sums.peak += child.peak[s];
          sums.lipschitz += child.lipschitz[s];
        }
      }
      node.peak[slot] = sums.peak;
      node.lipschitz[slot] = sums.lipschitz;
    }
    std::swap(below, above);
    ++level_count;
  }
}

void index_field(const Skeleton& skeleton, const PlacedSkeleton& placed, Field& field) {
  const std::size_t n = skeleton.primitive.size();
  const bool balls = placed.rotation.empty() && n > 0;
  SUPPLE_EXPECTS(placed.position.size() == n && placed.support.size() == n &&
                 (balls ? placed.radius.size() == n && placed.part.size() == n : placed.rotation.size() == n));
  if (!field.index_) field.index_ = std::make_unique<Field::Index>();
  Field::Index& index = *field.index_;
  index.iso = skeleton.iso;
  index.blend.assign(skeleton.blend, skeleton.part_count);
  index.primitive.resize(n);
  index.feature_size = kInfinity;
  index.uniform = true;
  index.convolved = false;
  index.convex = has_convex_levels(skeleton);
  index.surface_box_known.store(false, std::memory_order_release);
  index.core_radius.reset();
  index.control.clear();
  index.ball_radius.clear();
  index.built.store(false, std::memory_order_release);
  if (balls && n > Field::Index::kScanLimit && !index.blend.active()) {
    index.ball_radius = placed.radius;
    double last = 0.0, inverse_r2 = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double R = placed.radius[i];
      if (R != last) {
        inverse_r2 = 1.0 / (R * R);
        index.feature_size = std::min(index.feature_size, R);
        last = R;
      }
      const Vec3& at = placed.position[i];
      index.primitive[i] = {.position = {at.x(), at.y(), at.z()}, .inverse_r2 = inverse_r2, .gradient_factor = -6.0 / (R * R),
                            .kind = PackedKind::PointWyvill, .part = placed.part[i]};
    }
    return;
  }
  index.shape.resize(n);
  index.rounded.resize(n);
  index.support.assign(placed.support.begin(), placed.support.end());
  double extent = 0.0;
  for (const Primitive& p : skeleton.primitive) index.control.insert(index.control.end(), p.control.begin(), p.control.end());
  const Vec3* control = index.control.data();
  for (std::size_t i = 0; i < n; ++i) {
    pack(skeleton.primitive[i], control, placed.position[i], balls ? Mat3(Mat3::Identity()) : placed.rotation[i],
         {index.primitive[i], index.shape[i], index.rounded[i]});
    control += skeleton.primitive[i].control.size();
    index.feature_size = std::min(index.feature_size, feature_of(skeleton.primitive[i]));
    index.uniform = index.uniform && index.primitive[i].kind == index.primitive[0].kind;
    index.convolved = index.convolved || skeleton.primitive[i].convolved;
    extent += placed.support[i].extent().sum();
  }
  if (has_convex_core(skeleton) && evaluate(skeleton.primitive[0].kernel, 0.0).value > skeleton.iso) {
    index.core_radius = iso_distance(skeleton.primitive[0].kernel, skeleton.iso);
    index.core_is_point = skeleton.primitive[0].shape == ShapeKind::Point;
  }
  index.typical_extent = n > 0 ? extent / (3.0 * static_cast<double>(n)) : 0.0;
}

}  // namespace supple::implicit
