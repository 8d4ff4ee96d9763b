#include "supple/implicit/volume.h"

#include <algorithm>
#include <array>

#include "supple/core/error.h"

namespace supple::implicit {

double enclosed_volume(const FieldView& field, double cell) {
  SUPPLE_EXPECTS(cell > 0.0);
  const Box box = field.surface_box();
  if (box.empty()) return 0.0;
  SUPPLE_EXPECTS(box.lower.allFinite() && box.upper.allFinite());
  constexpr int kEdge = 4;  // cells along a block
  constexpr std::size_t kCells = kEdge * kEdge * kEdge;
  const double edge = kEdge * cell;
  std::array<Vec3, kCells> points;
  std::array<double, kCells> values;
  std::array<Vec3, kCells> gradients;
  const Vec3 first = (box.lower / edge).array().floor(), last = (box.upper / edge).array().floor();
  double cells = 0.0;
  for (double z = first.z(); z <= last.z(); ++z) {
    for (double y = first.y(); y <= last.y(); ++y) {
      for (double x = first.x(); x <= last.x(); ++x) {
        const Vec3 corner = edge * Vec3(x, y, z);
        const Interval bound = field.bound({corner, corner + Vec3::Constant(edge)});
        if (bound.upper < 0.0) continue;
        if (bound.lower > 0.0) {
          cells += static_cast<double>(kCells);
          continue;
        }
        for (std::size_t i = 0; i < kCells; ++i) {
          const auto k = static_cast<int>(i);
          points[i] = corner + cell * (Vec3(k % kEdge, k / kEdge % kEdge, k / (kEdge * kEdge)) + Vec3::Constant(0.5));
        }
        field.evaluate(points, values, gradients);
        double sum = 0.0;
        for (std::size_t i = 0; i < kCells; ++i) {
          // Distance from the tangent plane over the width of the cell along its normal.
          const double width = cell * gradients[i].cwiseAbs().sum();
          sum += width > 0.0 ? std::clamp(0.5 + values[i] / width, 0.0, 1.0) : (values[i] > 0.0 ? 1.0 : 0.0);
        }
        cells += sum;
      }
    }
  }
  return cells * cell * cell * cell;
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
