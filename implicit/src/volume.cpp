#include "supple/implicit/volume.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "supple/core/error.h"

namespace supple::implicit {

namespace {

constexpr int kEdge = 4;  // cells along a block
constexpr std::size_t kCells = kEdge * kEdge * kEdge;

/// Middles of a block's cells, and how much of each lies inside [cells].
struct Block {
  std::array<Vec3, kCells> points;
  std::array<double, kCells> values;
  std::array<Vec3, kCells> gradients;
  std::array<double, kCells> share;
};

/// Calls whole(block) for blocks that bounds show to be inside, cut(block) for the others that may hold some of the body;
/// the middles of the cells are set in both, the shares in the second.
template <class Whole, class Cut>
void for_blocks_of(const FieldView& field, double cell, const Whole& whole, const Cut& cut) {
  SUPPLE_EXPECTS(cell > 0.0);
  const Box box = field.surface_box();
  if (box.empty()) return;
  SUPPLE_EXPECTS(box.lower.allFinite() && box.upper.allFinite());
  const double edge = kEdge * cell;
  Block block;
  using Place = Eigen::Matrix<std::int64_t, 3, 1>;
  const Place first = (box.lower / edge).array().floor().cast<std::int64_t>(), last = (box.upper / edge).array().floor().cast<std::int64_t>();
  for (std::int64_t z = first.z(); z <= last.z(); ++z) {
    for (std::int64_t y = first.y(); y <= last.y(); ++y) {
      for (std::int64_t x = first.x(); x <= last.x(); ++x) {
        const Vec3 corner = edge * Place(x, y, z).cast<double>();
        const Interval bound = field.bound({corner, corner + Vec3::Constant(edge)});
        if (bound.upper < 0.0) continue;
        for (std::size_t i = 0; i < kCells; ++i) {
          const auto k = static_cast<int>(i);
          block.points[i] = corner + cell * (Vec3(k % kEdge, k / kEdge % kEdge, k / (kEdge * kEdge)) + Vec3::Constant(0.5));
        }
        if (bound.lower > 0.0) {
          whole(block);
          continue;
        }
        field.evaluate(block.points, block.values, block.gradients);
        for (std::size_t i = 0; i < kCells; ++i) {
          // Distance from the tangent plane over the width of the cell along its normal.
          const double width = cell * block.gradients[i].cwiseAbs().sum();
          const double f = block.values[i];
          block.share[i] = width > 0.0 ? std::clamp(0.5 + f / width, 0.0, 1.0) : (f > 0.0 ? 1.0 : 0.0);
        }
        cut(block);
      }
    }
  }
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
  const auto give = [&](const Block& block, bool whole) {
    field.evaluate_parts(block.points, parts);
    for (std::size_t i = 0; i < kCells; ++i) {
      const double share = whole ? 1.0 : block.share[i];
      if (share == 0.0 || parts.offset[i] == parts.offset[i + 1]) continue;
      std::uint32_t best = parts.offset[i];
      for (std::uint32_t r = best + 1; r < parts.offset[i + 1]; ++r) {
        if (parts.value[r] > parts.value[best]) best = r;
      }
      volume[parts.part[best]] += share * cell * cell * cell;
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
}
void VolumeState::load(StateReader& in) {
  in.read(scale);
  in.read(volume);
}
void VolumeState::hash(Hasher& hasher) const {
  hasher.add(scale);
  hasher.add(volume);
}

void control_volume(const VolumeControl& control, double volume, double dt, VolumeState& state) noexcept {
  constexpr double kLargestChange = 0.02;
  const double change = state.volume > 0.0 ? volume - state.volume : 0.0;
  const double growth = (control.rate * (control.target - volume) * dt - control.damping * change) / control.target;
  state.scale = std::clamp(state.scale * (1.0 + std::clamp(growth, -kLargestChange, kLargestChange)), 0.25, 4.0);
  state.volume = volume;
}

}  // namespace supple::implicit
