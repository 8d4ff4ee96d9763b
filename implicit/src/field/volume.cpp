#include "supple/implicit/volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "supple/core/error.h"
#include "supple/core/interrupt.h"

namespace supple::implicit {

namespace {

constexpr double kLeastCell = 1e-12;  // of the largest coordinate, whose round-off hides what is smaller
constexpr int kEdge = 4;  // cells along a block
constexpr std::size_t kCells = kEdge * kEdge * kEdge;
constexpr double kShift = 0.5;                        // of the surface, to either side [cells]
constexpr double kHalfDiagonal = 0.8660254037844387;  // [cells]
constexpr double kReach = kHalfDiagonal + kShift;     // a cell farther from the surface lies on one side of all three [cells]

/// A level set near a point by its tangent plane: the signed distance, positive inside, and |direction| along the axes of the
/// unit normal. Lengths in cells.
struct NearPlane {
  double distance = 0.0;
  Vec3 slant = Vec3::UnitX();
};

/// Part of a unit cube on the inner side of a plane at a distance from its middle: over all cubes of a lattice these add up
/// exactly to what lies between planes.
double cube_share(const NearPlane& plane, double shift) {
  constexpr double kLeast = 1e-4;  // of a slant, for which round-off stays below 1e-8
  Vec3 n = plane.slant.cwiseMax(kLeast);
  const double whole = n.sum();
  const double up_to = 0.5 * whole + plane.distance + shift;  // from the corner that lies deepest
  if (up_to <= 0.0) return 0.0;
  if (up_to >= whole) return 1.0;
  // The smaller of the two parts, by inclusion and exclusion of the corners that stick out.
  const double a = std::min(up_to, whole - up_to);
  const auto cube = [](double x) { return x > 0.0 ? x * x * x : 0.0; };
  const double part = (cube(a) - cube(a - n.x()) - cube(a - n.y()) - cube(a - n.z()) + cube(a - n.x() - n.y()) + cube(a - n.y() - n.z()) +
                       cube(a - n.z() - n.x())) / (6.0 * n.prod());
  return up_to <= whole - up_to ? part : 1.0 - part;
}

/// The share of a cell. Smeared by cubes, whose second moment is 1/12 in all directions, volumes V(s) of the bodies between the
/// surface and its parallel at s are too large by V''/24, whose difference over -1/2, 0, 1/2 is taken off: what is left is exact
/// for planes and, as V is cubic (Steiner), of fourth order for smooth surfaces.
double share_of(const NearPlane& plane) {
  return (4.0 * cube_share(plane, 0.0) - 0.5 * (cube_share(plane, kShift) + cube_share(plane, -kShift))) / 3.0;
}

/// Middles of a block's cells, and how much of each lies inside [cells].
struct Block {
  std::array<Vec3, kCells> points;
  std::array<double, kCells> share;
};

/// Shares of the cells of a block that the surface may cut: from each middle Newton's steps to the foot on the surface, and the
/// distance from the tangent plane there.
class CutBlock {
 public:
  /// @param steepest  bound of |grad F| wherever the steps may lead [1/m]
  void measure(const FieldView& field, double cell, double steepest, Block& block) {
    std::array<double, kCells> values;
    std::array<Vec3, kCells> gradients;
    field.evaluate(block.points, values, gradients);
    open_.clear();
    for (std::size_t i = 0; i < kCells; ++i) {
      block.share[i] = values[i] > 0.0 ? 1.0 : 0.0;
      if (std::abs(values[i]) > steepest * kReach * cell || gradients[i].isZero()) continue;
      searches_[open_.size()] = {.cell = i, .middle = block.points[i], .inside = values[i] > 0.0};
      open_.push_back(open_.size());
      searches_[open_.back()].look(block.points[i], values[i], gradients[i], cell);
    }
    const std::size_t count = open_.size();
    for (int step = 0; step < kSteps && !open_.empty(); ++step) {
      std::array<Vec3, kCells> feet;
      const std::size_t n = open_.size();
      for (std::size_t k = 0; k < n; ++k) feet[k] = searches_[open_[k]].foot;
      field.evaluate({feet.data(), n}, {values.data(), n}, {gradients.data(), n});
      std::size_t left = 0;
      for (std::size_t k = 0; k < n; ++k) {
        if (searches_[open_[k]].look(feet[k], values[k], gradients[k], cell)) open_[left++] = open_[k];
      }
      open_.resize(left);
    }
    for (std::size_t k = 0; k < count; ++k) {
      Search& search = searches_[k];
      double& distance = search.plane.distance;
      distance = search.inside ? std::max(distance, 0.0) : std::min(distance, 0.0);
      block.share[search.cell] = share_of(search.plane);
    }
  }

 private:
  static constexpr int kSteps = 12;
  static constexpr double kSettled = 1e-3;           // of a cell; the next step would change its square
  static constexpr double kFarthest = kReach + 0.5;  // where a foot is searched [cells]

  /// For the foot of one middle.
  struct Search {
    std::size_t cell = 0;
    Vec3 middle = Vec3::Zero();
    bool inside = false;
    Vec3 foot = Vec3::Zero();  ///< next point to evaluate
    NearPlane plane{};
    double least = std::numeric_limits<double>::infinity();  ///< of |F| so far
    Vec3 before = Vec3::Zero(), beyond = Vec3::Zero();  ///< the last feet on the middle's side of the surface and on the other one
    bool crossed = false;

    /// Takes the field at a point. @return whether there is another point to evaluate
    bool look(const Vec3& point, double value, const Vec3& gradient, double size) {
      const bool first = std::isinf(least);
      const bool halved = std::abs(value) <= 0.5 * least;
      least = std::min(least, std::abs(value));
      if ((value > 0.0) == inside) {
        before = point;
      } else {
        beyond = point;
        crossed = true;
      }
      if (!halved && crossed) {  // steep between flat sides, where Newton's steps would go to and fro
        foot = 0.5 * (before + beyond);
        return true;
      }
      const double steepness = gradient.norm();
      if (!(steepness > 0.0)) return false;
      const Vec3 inward = gradient / steepness;
      const double distance = (value / steepness + inward.dot(middle - point)) / size, change = distance - plane.distance;
      plane = {distance, inward.cwiseAbs()};
      foot = middle - std::clamp(distance, -kFarthest, kFarthest) * size * inward;
      if (first) return true;
      return std::abs(change) > kSettled && (crossed || std::abs(distance) < kFarthest);
    }
  };

  std::array<Search, kCells> searches_;
  std::vector<std::size_t> open_;
};

using Place = Eigen::Matrix<std::int64_t, 3, 1>;

/// Calls visit(place) for all places from `first` to `last` that lie in no box of blocks which reaches(first, last) denies, x fastest, z slowest.
template <class Reaches, class Visit>
void for_places(const Place& first, const Place& last, const Reaches& reaches, const Visit& visit) {
  if (!reaches(first, last)) return;
  Eigen::Index axis = 2;
  while (axis >= 0 && first[axis] == last[axis]) --axis;
  if (axis < 0) return visit(first);
  const std::int64_t middle = first[axis] + (last[axis] - first[axis]) / 2;
  Place end = last, begin = first;
  end[axis] = middle;
  begin[axis] = middle + 1;
  for_places(first, end, reaches, visit);
  for_places(begin, last, reaches, visit);
}

/// Calls whole(block) for blocks that bounds show to be inside, cut(block) for the others that may contain a part of the body;
/// the middles of the cells are set in both, the shares in the second.
/// @param cell  made larger where coordinates do not resolve it
template <class Whole, class Cut>
void for_blocks_of(const FieldView& field, double& cell, const Whole& whole, const Cut& cut) {
  SUPPLE_EXPECTS(cell > 0.0);
  Box box = field.surface_box();
  if (box.empty()) return;
  SUPPLE_EXPECTS(box.lower.allFinite() && box.upper.allFinite());
  cell = std::max(cell, kLeastCell * std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff()));
  const Vec3 around = Vec3::Constant(kShift * cell);
  box = {box.lower - around, box.upper + around};
  const double edge = kEdge * cell;
  Block block;
  CutBlock near_surface;
  const auto box_of = [&](const Place& first, const Place& last) {
    return Box{edge * first.cast<double>() - around, edge * (last.array() + 1).matrix().cast<double>() + around};
  };
  const auto reaches = [&](const Place& first, const Place& last) {
    heed_scope();
    return !(field.bound(box_of(first, last)).upper < 0.0);
  };
  const auto visit = [&](const Place& place) {
    const Vec3 corner = edge * place.cast<double>();
    for (std::size_t i = 0; i < kCells; ++i) {
      const auto k = static_cast<int>(i);
      block.points[i] = corner + cell * (Vec3(k % kEdge, k / kEdge % kEdge, k / (kEdge * kEdge)) + Vec3::Constant(0.5));
    }
    if (field.bound(box_of(place, place)).lower > 0.0) return whole(block);
    const Vec3 steps = Vec3::Constant(kReach * cell);
    near_surface.measure(field, cell, field.gradient_bound({corner - steps, corner + Vec3::Constant(edge) + steps}), block);
    cut(block);
  };
  const auto place_of = [&](const Vec3& point) { return Place((point / edge).array().floor().cast<std::int64_t>()); };
  for_places(place_of(box.lower), place_of(box.upper), reaches, visit);
}

/// How the parts of a row share a cell: each has what lies on its side of the planes where it is as strong as the strongest other
/// one. The shares add up to 1.
void share_among(const FieldParts& parts, std::size_t row, double cell, std::vector<double>& shares) {
  const std::uint32_t begin = parts.offset[row], end = parts.offset[row + 1];
  shares.assign(end - begin, 0.0);
  std::uint32_t best = begin, second = end;
  for (std::uint32_t r = begin + 1; r < end; ++r) {
    if (parts.value[r] > parts.value[best]) {
      second = best;
      best = r;
    } else if (second == end || parts.value[r] > parts.value[second]) {
      second = r;
    }
  }
  if (second == end) {
    shares[0] = 1.0;
    return;
  }
  double sum = 0.0;
  for (std::uint32_t r = begin; r < end; ++r) {
    const std::uint32_t other = r == best ? second : best;
    const double ahead = parts.value[r] - parts.value[other];
    const Vec3 gradient = parts.gradient[r] - parts.gradient[other];
    const double steepness = gradient.norm() * cell;
    double& share = shares[r - begin];
    if (std::abs(ahead) >= kReach * steepness) {
      share = r == best && ahead > 0.0 ? 1.0 : 0.0;
    } else {
      share = share_of({ahead / steepness, gradient.cwiseAbs() * (cell / steepness)});
    }
    sum += share;
  }
  if (!(sum > 0.0)) shares[best - begin] = sum = 1.0;
  for (double& share : shares) share /= sum;
}

}  // namespace

double enclosed_volume(const FieldView& field, double cell) {
  double cells = 0.0;
  for_blocks_of(
      field, cell, [&](const Block&) { cells += static_cast<double>(kCells); },
      [&](const Block& block) {
        double sum = 0.0;
        for (const double share : block.share) sum += share;
        cells += sum;
      });
  return cells * cell * cell * cell;
}

std::vector<double> part_volumes(const FieldView& field, double cell, std::size_t part_count) {
  std::vector<double> volume(part_count, 0.0);
  FieldParts parts;
  std::vector<double> shares;
  const auto give = [&](const Block& block, bool whole) {
    field.evaluate_parts(block.points, parts);
    for (std::size_t i = 0; i < kCells; ++i) {
      const double share = whole ? 1.0 : block.share[i];
      if (share == 0.0 || parts.offset[i] == parts.offset[i + 1]) continue;
      share_among(parts, i, cell, shares);
      for (std::size_t k = 0; k < shares.size(); ++k) volume[parts.part[parts.offset[i] + k]] += share * shares[k] * cell * cell * cell;
    }
  };
  for_blocks_of(
      field, cell, [&](const Block& block) { give(block, true); }, [&](const Block& block) { give(block, false); });
  return volume;
}

Skeleton by_primitive(const Skeleton& skeleton) {
  Skeleton out = skeleton;
  out.part_count = static_cast<std::uint32_t>(skeleton.primitive.size());
  out.blend.node.clear();
  std::uint32_t nodes = 0;
  for (std::uint32_t k = 0; k < out.part_count; ++k) {
    Primitive& primitive = out.primitive[k];
    out.blend.node.push_back(skeleton.blend.node.empty() ? primitive.part : skeleton.blend.node[primitive.part]);
    nodes = std::max(nodes, out.blend.node.back() + 1);
    primitive.part = k;
  }
  // Nodes that hold no primitive may be the last ones.
  std::erase_if(out.blend.edge, [nodes](const BlendEdge& e) { return e.b >= nodes; });
  return out;
}

Primitive scaled(const Primitive& primitive, double scale) {
  SUPPLE_EXPECTS(scale > 0.0);
  Primitive out = primitive;
  out.kernel.radius *= scale;
  out.kernel.thickness *= scale;
  out.kernel.slope /= scale;
  out.kernel.steepest *= scale;
  if (scales(primitive)) {
    out.size *= scale;
    for (Vec3& radii : out.control) radii *= scale;
  }
  return out;
}

void VolumeState::save(StateWriter& out) const {
  out.write(scale);
  out.write(volume);
  out.write(rate);
}
void VolumeState::load(StateReader& in) {
  in.read(scale);
  in.read(volume);
  in.read(rate);
}
void VolumeState::hash(Hasher& hasher) const {
  hasher.add(scale);
  hasher.add(volume);
  hasher.add(rate);
}

void control_volume(const VolumeControl& control, double volume, double dt, VolumeState& state) noexcept {
  constexpr double kLargestChange = 0.02, kLargestGain = 1.0 / 3.0;
  const double change = state.volume > 0.0 ? volume - state.volume : 0.0;
  const double growth = (std::min(control.rate * dt, kLargestGain) * (control.target - volume) - control.damping * change) / control.target;
  const double last = state.scale;
  state.scale = std::clamp(last * (1.0 + std::clamp(growth, -kLargestChange, kLargestChange)), kLeastScale, kLargestScale);
  state.rate = dt > 0.0 ? (state.scale / last - 1.0) / dt : 0.0;
  state.volume = volume;
}

}  // namespace supple::implicit
