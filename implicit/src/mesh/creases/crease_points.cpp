#include "mesh/creases/crease_points.h"

#include <cmath>
#include <limits>

namespace supple::implicit {

std::optional<Vec3> meeting_point(std::span<const FieldView> fields, std::span<const std::uint32_t> nodes, const Vec3& start, double farthest) {
  constexpr int kMaxIterations = 20;
  Vec3 x = start;
  const std::size_t n = std::min<std::size_t>(nodes.size(), 3);
  for (int i = 0; i < kMaxIterations; ++i) {
    std::array<double, 3> f{};
    std::array<Vec3, 3> g{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    double largest = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      f[k] = fields[nodes[k]].value(x, g[k]);
      largest = std::max(largest, std::abs(f[k]));
    }
    if (largest <= 1e-13) return x;
    const Vec3 along = g[0].cross(g[1]);
    const Vec3 third = n == 3 ? g[2] : along;
    const Vec3 step = -(f[0] * g[1].cross(third) + f[1] * third.cross(g[0]) + f[2] * along) / along.dot(third);
    x += step;
    if (!((x - start).norm() <= farthest)) return std::nullopt;
    if (step.norm() <= std::numeric_limits<double>::epsilon() * x.cwiseAbs().maxCoeff()) return x;
  }
  return std::nullopt;
}

}  // namespace supple::implicit
