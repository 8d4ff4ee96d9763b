#include "fit/grid_field.h"

#include <algorithm>
#include <cmath>

#include "supple/implicit/march_cubes.h"

namespace supple::fit {

void GridField::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  for (std::size_t p = 0; p < points.size(); ++p) values[p] = sample(points[p], nullptr);
}

void GridField::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  for (std::size_t p = 0; p < points.size(); ++p) values[p] = sample(points[p], &gradients[p]);
}

void GridField::evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
  parts = {};
  parts.offset.assign(points.size() + 1, 0);
}

Interval GridField::bound(const Box& box) const {
  Interval out{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  std::array<std::size_t, 3> first{}, last{};
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const double most = static_cast<double>(count[axis] - 1);
    first[axis] = static_cast<std::size_t>(std::clamp(std::floor(box.lower[k]), 0.0, most));
    last[axis] = static_cast<std::size_t>(std::clamp(std::ceil(box.upper[k]), 0.0, most));
  }
  for (std::size_t k = first[2]; k <= last[2]; ++k) {
    for (std::size_t j = first[1]; j <= last[1]; ++j) {
      const auto [low, high] = std::minmax_element(value.begin() + static_cast<std::ptrdiff_t>(at(first[0], j, k)), value.begin() + static_cast<std::ptrdiff_t>(at(last[0], j, k) + 1));
      out.lower = std::min<double>(out.lower, *low);
      out.upper = std::max<double>(out.upper, *high);
    }
  }
  return out;
}

double GridField::gradient_bound(const Box& box) const {
  const Interval range = bound(box);
  return std::sqrt(3.0) * (range.upper - range.lower);
}

Box GridField::surface_box() const { return {Vec3::Zero(), Vec3(static_cast<double>(count[0] - 1), static_cast<double>(count[1] - 1), static_cast<double>(count[2] - 1))}; }

double GridField::sample(const Vec3& place, Vec3* gradient) const {
  std::array<std::size_t, 3> cell{};
  Vec3 x;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const double inside = std::clamp(place[k], 0.0, static_cast<double>(count[axis] - 1));
    cell[axis] = std::min(static_cast<std::size_t>(inside), count[axis] - 2);
    x[k] = inside - static_cast<double>(cell[axis]);
  }
  double sum = 0.0;
  Vec3 slope = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const std::size_t a = corner & 1, b = (corner >> 1) & 1, c = corner >> 2;
    const double v = value[at(cell[0] + a, cell[1] + b, cell[2] + c)];
    const Vec3 w(a != 0 ? x[0] : 1.0 - x[0], b != 0 ? x[1] : 1.0 - x[1], c != 0 ? x[2] : 1.0 - x[2]);
    sum += v * w.prod();
    slope += v * Vec3((a != 0 ? 1.0 : -1.0) * w[1] * w[2], (b != 0 ? 1.0 : -1.0) * w[0] * w[2], (c != 0 ? 1.0 : -1.0) * w[0] * w[1]);
  }
  if (gradient != nullptr) *gradient = slope;
  return sum;
}

std::vector<std::size_t> parts_of(const GridField& field, bool inside, std::vector<std::uint32_t>& part) {
  part.assign(field.value.size(), kNoPart);
  const std::array<std::size_t, 3> stride{1, field.count[0], field.count[0] * field.count[1]};
  const auto wanted = [&](std::size_t n) { return part[n] == kNoPart && (field.value[n] > 0.0F) == inside; };
  std::vector<std::size_t> size, open;
  for (std::size_t start = 0; start < part.size(); ++start) {
    if (!wanted(start)) continue;
    const auto number = static_cast<std::uint32_t>(size.size());
    size.push_back(0);
    open.assign(1, start);
    part[start] = number;
    while (!open.empty()) {
      const std::size_t n = open.back();
      open.pop_back();
      ++size.back();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t along = n / stride[axis] % field.count[axis];
        for (const bool up : {false, true}) {
          if (up ? along + 1 == field.count[axis] : along == 0) continue;
          const std::size_t next = up ? n + stride[axis] : n - stride[axis];
          if (!wanted(next)) continue;
          part[next] = number;
          open.push_back(next);
        }
      }
    }
  }
  return size;
}

std::size_t fill_cavities(GridField& field) {
  std::vector<std::uint32_t> part;
  const std::vector<std::size_t> around = parts_of(field, false, part);  // part 0 holds the border
  for (std::size_t n = 0; n < part.size(); ++n) {
    if (part[n] != 0 && part[n] != kNoPart) field.value[n] = std::max(-field.value[n], std::numeric_limits<float>::min());
  }
  return around.size() - 1;
}

Mesh surface_of_grid(const GridField& field, const Executor& executor) {
  implicit::MarchOptions march;
  march.lattice.cell = 1.0;
  Mesh mesh = implicit::march_cubes(field, march, executor);
  mesh.normal.clear();
  return mesh;
}

}  // namespace supple::fit
