#include "supple/implicit/field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "field/field_index.h"
#include "field/field_lanes.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::implicit {
namespace {

/// Batches are cut into groups of blocks that share one query of the hierarchy: at most this many blocks, as long as
/// the edges of their box sum to at most kGroupExtent typical supports. Larger groups visit more leaves per block.
constexpr std::size_t kGroupBlocks = 64;
constexpr double kGroupExtent = 1.75;

/// Per thread, and never read before it is written: reused so that evaluation does not allocate.
struct Scratch {
  std::vector<std::uint64_t> bits, summary;  // all zero between uses
  std::vector<std::uint32_t> ids, group_ids;
  std::vector<LeafPack> packs;
  std::vector<double> values;
  std::vector<Vec3> gradients;

  static Scratch& of_thread(std::size_t primitive_count) {
    thread_local Scratch scratch;
    if (scratch.ids.size() < primitive_count + lanes::kSpill) {
      scratch.bits.resize((primitive_count + 63) / 64);
      scratch.summary.resize((primitive_count + 4095) / 4096);
      scratch.ids.resize(primitive_count + lanes::kSpill);
      scratch.group_ids.resize(primitive_count + lanes::kSpill + kPack);
      scratch.packs.resize((primitive_count + kPack - 1) / kPack);
    }
    return scratch;
  }
};

/// Candidates of a box from the hierarchy, in id order, into scratch.ids.
std::size_t query(const Field::Index& index, const lanes::Bounds& box, Scratch& scratch) {
  if (!index.cull) {
    std::iota(scratch.ids.begin(), scratch.ids.begin() + static_cast<std::ptrdiff_t>(index.size()), 0u);
    return index.size();
  }
  lanes::collect(index, box, scratch.bits.data(), scratch.summary.data());
  std::size_t count = 0;
  const std::size_t summaries = (index.size() + 4095) / 4096;
  for (std::size_t s = 0; s < summaries; ++s) {
    for (std::uint64_t words = scratch.summary[s]; words != 0; words &= words - 1) {
      const std::size_t w = 64 * s + static_cast<std::size_t>(std::countr_zero(words));
      for (std::uint64_t word = scratch.bits[w]; word != 0; word &= word - 1) {
        scratch.ids[count++] = static_cast<std::uint32_t>(64 * w + static_cast<std::size_t>(std::countr_zero(word)));
      }
      scratch.bits[w] = 0;
    }
    scratch.summary[s] = 0;
  }
  return count;
}

double edge_sum(const lanes::Bounds& b) {
  return (b.upper[0] - b.lower[0]) + (b.upper[1] - b.lower[1]) + (b.upper[2] - b.lower[2]);
}

lanes::Bounds united(const lanes::Bounds& a, const lanes::Bounds& b) {
  lanes::Bounds box = a;
  for (std::size_t k = 0; k < 3; ++k) {
    box.lower[k] = std::min(a.lower[k], b.lower[k]);
    box.upper[k] = std::max(a.upper[k], b.upper[k]);
  }
  return box;
}

/// A run of points and their box.
struct Group {
  std::size_t begin, end;
  lanes::Bounds box;
};

/// Calls use(group) for consecutive groups of points that are close together.
template <class Use>
void for_groups(const Field::Index& index, std::span<const Vec3> points, const Use& use) {
  const double limit = kGroupExtent * index.typical_extent;
  const auto block_at = [&](std::size_t begin, std::size_t end) {
    return Group{begin, end, lanes::bounds_of(points.data() + begin, end - begin)};
  };
  const std::size_t n = points.size();
  Group group{0, 0, {}};
  const auto flush = [&] {
    if (group.end > group.begin) use(group);
    group.begin = group.end;
  };
  for (std::size_t begin = 0; begin < n; begin += lanes::kBlock) {
    const std::size_t end = std::min(begin + lanes::kBlock, n);
    const Group block = block_at(begin, end);
    if (edge_sum(block.box) > limit && end - begin > 1) {  // scattered points
      flush();
      constexpr std::size_t kFew = 4;
      for (std::size_t few = begin; few < end; few += kFew) {
        const Group some = block_at(few, std::min(few + kFew, end));
        if (edge_sum(some.box) <= limit) {
          use(some);
        } else {
          for (std::size_t i = some.begin; i < some.end; ++i) use(block_at(i, i + 1));
        }
      }
      group = {end, end, {}};
      continue;
    }
    const bool fits = group.end > group.begin && group.end - group.begin < kGroupBlocks * lanes::kBlock &&
                      edge_sum(united(group.box, block.box)) <= limit;
    if (fits) {
      group.end = end;
      group.box = united(group.box, block.box);
    } else {
      flush();
      group = block;
    }
  }
  flush();
}

/// @return kernel evaluations made
std::uint64_t evaluate_batch(const Field::Index& index, std::span<const Vec3> points, double* values,
                             Vec3* gradients) {
  const lanes::Primitives in{index.primitive.data(), index.shape.data(), index.iso, index.uniform};
  const std::size_t n = points.size();
  if (n == 0) return 0;
  if (index.size() <= Field::Index::kScanLimit) {
    std::uint32_t ids[Field::Index::kScanLimit + lanes::kSpill];
    if (index.cull && index.size() > 1) {  // for one primitive the evaluation costs no more than a test
      return lanes::evaluate_packs(in, index.leaf, ids, {points.data(), n, values, gradients});
    }
    std::iota(ids, ids + index.size(), 0u);
    lanes::evaluate_ids(in, {ids, index.size()}, {points.data(), n, values, gradients});
    return index.size() * n;
  }
  Scratch& scratch = Scratch::of_thread(index.size());
  std::uint64_t visited = 0;
  for_groups(index, points, [&](const Group& group) {
    const std::size_t candidates = query(index, group.box, scratch);
    const std::size_t count = group.end - group.begin;
    const lanes::Batch at{points.data() + group.begin, count, values + group.begin,
                          gradients == nullptr ? nullptr : gradients + group.begin};
    if (count <= lanes::kBlock || !index.cull) {
      lanes::evaluate_ids(in, {scratch.ids.data(), candidates}, at);
      visited += candidates * count;
      return;
    }
    const std::size_t packs = (candidates + kPack - 1) / kPack;
    for (std::size_t i = 0; i < packs * kPack; ++i) {
      if (i < candidates) {
        set_slot(scratch.packs[i / kPack], i % kPack, index.rounded[scratch.ids[i]], scratch.ids[i]);
      } else {
        clear_slot(scratch.packs[i / kPack], i % kPack);
      }
    }
    visited += lanes::evaluate_packs(in, {scratch.packs.data(), packs}, scratch.group_ids.data(), at);
  });
  return visited;
}

}  // namespace

Field::Field() : index_(std::make_unique<Index>()) {}
Field::~Field() = default;
Field::Field(Field&&) noexcept = default;
Field& Field::operator=(Field&&) noexcept = default;

const Field::Index& Field::index() const {
  Index& index = *index_;
  if (!index.built.load(std::memory_order_acquire)) {
    const std::lock_guard lock(index.build_mutex);
    if (!index.built.load(std::memory_order_relaxed)) {
      index.pack_balls();
      index.build_leaves();
      index.build_levels();
      index.built.store(true, std::memory_order_release);
    }
  }
  return index;
}

void Field::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  if (index_->blend.active()) {
    evaluate_blended(index(), points, values.data(), nullptr);
    return;
  }
  evaluate_batch(index(), points, values.data(), nullptr);
}

void Field::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  if (index_->blend.active()) {
    evaluate_blended(index(), points, values.data(), gradients.data());
    return;
  }
  evaluate_batch(index(), points, values.data(), gradients.data());
}

void part_rows(const Field::Index& index, std::span<const Vec3> points, FieldParts& parts) {
  const lanes::Primitives in{index.primitive.data(), index.shape.data(), 0.0, index.uniform};
  Scratch& scratch = Scratch::of_thread(index.size());
  parts.offset.assign(1, 0);
  parts.part.clear();
  parts.value.clear();
  parts.gradient.clear();
  const auto add_rows = [&](std::size_t begin, std::size_t end, std::size_t candidates) {
    if (scratch.values.size() < kPack * candidates) {
      scratch.values.resize(kPack * candidates);
      scratch.gradients.resize(kPack * candidates);
    }
    lanes::evaluate_each(in, {scratch.ids.data(), candidates},
                         {points.data() + begin, end - begin, scratch.values.data(), scratch.gradients.data()});
    for (std::size_t j = 0; j < end - begin; ++j) {
      for (std::size_t i = 0; i < candidates; ++i) {
        const double f = scratch.values[kPack * i + j];
        if (f == 0.0) continue;
        const std::uint32_t part = index.primitive[scratch.ids[i]].part;
        if (parts.part.size() == parts.offset.back() || parts.part.back() != part) {
          parts.part.push_back(part);
          parts.value.push_back(f);
          parts.gradient.push_back(scratch.gradients[kPack * i + j]);
        } else {
          parts.value.back() += f;
          parts.gradient.back() += scratch.gradients[kPack * i + j];
        }
      }
      parts.offset.push_back(static_cast<std::uint32_t>(parts.part.size()));
    }
  };
  const auto add_points = [&](std::size_t begin, std::size_t end) {
    for (; begin < end; begin += kPack) {
      const std::size_t stop = std::min(begin + kPack, end);
      const lanes::Bounds box = lanes::bounds_of(points.data() + begin, stop - begin);
      const bool scan = index.cull && index.size() <= Field::Index::kScanLimit;
      const std::size_t candidates = scan
                                         ? lanes::filter(index.leaf.data(), index.leaf.size(), box, scratch.ids.data())
                                         : query(index, box, scratch);
      add_rows(begin, stop, candidates);
    }
  };
  if (index.size() <= Field::Index::kScanLimit) {
    add_points(0, points.size());
  } else {
    for_groups(index, points, [&](const Group& group) { add_points(group.begin, group.end); });
  }
}

std::span<const std::uint32_t> candidates_of(const Field::Index& index, const Box& box) {
  Scratch& scratch = Scratch::of_thread(index.size());
  const lanes::Bounds bounds{{box.lower[0], box.lower[1], box.lower[2]}, {box.upper[0], box.upper[1], box.upper[2]}};
  const bool scan = index.cull && index.size() <= Field::Index::kScanLimit;
  const std::size_t count = scan ? lanes::filter(index.leaf.data(), index.leaf.size(), bounds, scratch.ids.data())
                                 : query(index, bounds, scratch);
  return {scratch.ids.data(), count};
}

void Field::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
  parts.by_turn.clear();
  if (index_->blend.active()) {
    blended_part_rows(index(), points, parts);
  } else {
    part_rows(index(), points, parts);
  }
}

double Field::feature_size() const { return index_->feature_size; }
std::size_t Field::primitive_count() const { return index_->size(); }
void Field::set_culling(bool on) { index_->cull = on; }

FieldCounts Field::count(std::span<const Vec3> points) const {
  std::vector<double> values(points.size());
  const std::uint64_t visited = evaluate_batch(index(), points, values.data(), nullptr);
  return {.points = points.size(),
          .primitives_visited = visited,
          .primitives_present = points.size() * index_->size()};
}

bool Field::convex() const noexcept { return index_->convex; }

std::optional<CorePoint> Field::core_point(const Vec3& place) const {
  if (!index_->core_radius) return std::nullopt;
  const PackedPrimitive& p = index_->primitive.front();
  const PackedShape& shape = index_->shape.front();
  // Not stretched, so A is a rotation and half the gradient of q leads to the foot.
  const Mat3 A = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.to_local.data());
  const FootSample sample = foot(shape.view, A * (place - Vec3(p.position[0], p.position[1], p.position[2])));
  return CorePoint{place - A.transpose() * sample.half_gradient, *index_->core_radius, index_->core_is_point};
}

namespace {

Mat3 primitive_hessian(const Field::Index& index, std::size_t i, const Vec3& point) {
  if (!index.support[i].contains(point)) return Mat3::Zero();
  const PackedPrimitive& p = index.primitive[i];
  const PackedShape& shape = index.shape[i];
  const Mat3 A = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.to_local.data());
  if (shape.foot == PackedFoot::Convolved) {
    const double h = 1e-5 * shape.kernel.radius / shape.distance_scale;
    Mat3 hessian;
    for (int k = 0; k < 3; ++k) {
      const auto slope_at = [&](double step) -> Vec3 {
        const Vec3 x = point + step * Vec3::Unit(k) - Vec3(p.position[0], p.position[1], p.position[2]);
        return A.transpose() * convolve(shape.view, shape.kernel, A * x).gradient;
      };
      hessian.col(k) = (slope_at(h) - slope_at(-h)) / (2.0 * h);
    }
    return 0.5 * (hessian + hessian.transpose());
  }
  Mat3 second;  // of q in the local frame
  const FootSample sample = foot(shape.view, A * (point - Vec3(p.position[0], p.position[1], p.position[2])), &second);
  const Vec3 g = 2.0 * A.transpose() * sample.half_gradient;
  return second_slope(shape.kernel, sample.q) * g * g.transpose() +
         supple::implicit::evaluate(shape.kernel, sample.q).slope * A.transpose() * second * A;
}

}  // namespace

Mat3 part_hessian(const Field::Index& index, std::uint32_t part, const Vec3& point) {
  const auto first = std::partition_point(index.primitive.begin(), index.primitive.end(),
                                          [part](const PackedPrimitive& p) { return p.part < part; });
  Mat3 sum = Mat3::Zero();
  for (auto p = first; p != index.primitive.end() && p->part == part; ++p) {
    sum += primitive_hessian(index, static_cast<std::size_t>(p - index.primitive.begin()), point);
  }
  return sum;
}

Mat3 Field::hessian(const Vec3& point) const {
  Mat3 sum = Mat3::Zero();
  if (index_->blend.active()) {
    const double h = 1e-5 * index_->feature_size;
    for (int k = 0; k < 3; ++k) {
      const Vec3 points[2] = {point + h * Vec3::Unit(k), point - h * Vec3::Unit(k)};
      double values[2];
      Vec3 gradients[2];
      evaluate_blended(index(), points, values, gradients);
      sum.col(k) = (gradients[0] - gradients[1]) / (2.0 * h);
    }
    return 0.5 * (sum + sum.transpose());
  }
  for (std::size_t i = 0; i < index_->size(); ++i) sum += primitive_hessian(index(), i, point);
  return sum;
}

namespace {

/// The parts' sums by the rule, written out; parts without contribution are left out.
double combined_reference(const Blend& blend, std::vector<NodeSample> nodes) {
  std::erase_if(nodes, [](const NodeSample& k) { return k.value == 0.0; });
  double result = 0.0;
  for (const NodeSample& k : nodes) result = std::max(result, k.value);
  switch (blend.rule) {
    case BlendRule::Sum:
      result = 0.0;
      for (const NodeSample& k : nodes) result += k.value;
      break;
    case BlendRule::Graph:
      for (const NodeSample& k : nodes) {
        double sum = k.value;
        for (const BlendEdge& e : blend.edge) {
          if (e.a != k.node && e.b != k.node) continue;
          for (const NodeSample& j : nodes) {
            if (j.node != k.node && (j.node == e.a || j.node == e.b)) sum += e.weight * std::min(j.value, k.value);
          }
        }
        result = std::max(result, sum);
      }
      break;
    case BlendRule::Ricci: {
      double sum = 0.0;
      for (const NodeSample& k : nodes) sum += math::pow(k.value, blend.exponent);
      if (sum > 0.0) result = math::pow(sum, 1.0 / blend.exponent);
      break;
    }
    case BlendRule::Gradient:
      for (const NodeSample& a : nodes) {
        for (const NodeSample& b : nodes) {
          const double scale = a.gradient.norm() * b.gradient.norm();
          if (a.node == b.node || scale == 0.0) continue;
          const Opening opening = opening_of(blend.opening, std::clamp(a.gradient.dot(b.gradient) / scale, -1.0, 1.0));
          result = std::max(result, arc_blend(a.value, b.value, opening.t).value);
        }
      }
      break;
  }
  return result;
}

}  // namespace

double evaluate_reference(const Skeleton& skeleton, const PlacedSkeleton& placed, const Vec3& point, Vec3* gradient) {
  std::vector<NodeSample> nodes(skeleton.part_count);
  for (std::uint32_t i = 0; i < skeleton.part_count; ++i) nodes[i].node = i;
  double sum = 0.0;
  Vec3 slope = Vec3::Zero();
  for (std::size_t k = 0; k < skeleton.primitive.size(); ++k) {
    const Primitive& p = skeleton.primitive[k];
    const Mat3 rotation = placed.rotation.empty() ? Mat3(Mat3::Identity()) : placed.rotation[k];
    const Vec3 y = rotation.transpose() * (point - placed.position[k]);
    const Potential f = potential(p, y);
    const Vec3 own = rotation * f.gradient;
    sum += f.value;
    slope += own;
    NodeSample& node = nodes[skeleton.blend.node.empty() ? p.part : skeleton.blend.node[p.part]];
    node.value += f.value;
    node.gradient += own;
  }
  if (skeleton.blend.rule != BlendRule::Sum) sum = combined_reference(skeleton.blend, std::move(nodes));
  if (gradient != nullptr && skeleton.blend.rule == BlendRule::Sum) *gradient = slope;
  if (gradient != nullptr && skeleton.blend.rule != BlendRule::Sum) {
    const double h = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Vec3 step = h * Vec3::Unit(k);
      (*gradient)[k] = (evaluate_reference(skeleton, placed, point + step) - evaluate_reference(skeleton, placed, point - step)) / (2.0 * h);
    }
  }
  return sum - skeleton.iso;
}

}  // namespace supple::implicit
