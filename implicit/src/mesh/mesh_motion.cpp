#include "supple/implicit/mesh_motion.h"

#include <algorithm>
#include <array>

#include "supple/core/error.h"

namespace supple::implicit {

void add_motion(const FieldView& field, std::span<const PartMotion> parts, const Executor& executor, Mesh& mesh,
                const FieldMoments* moments) {
  SUPPLE_EXPECTS(moments == nullptr || moments->apart > 0.0);
  constexpr std::size_t kBatch = 256;
  const std::size_t n = mesh.vertex_count();
  std::array<std::vector<double>, 4> column;
  for (auto& values : column) values.assign(n, 0.0);
  executor.for_blocks(n, kBatch, [&](std::size_t begin, std::size_t end) {
    thread_local FieldParts shares;
    std::array<double, kBatch> before, after;
    const auto points = std::span<const Vec3>(mesh.position).subspan(begin, end - begin);
    field.evaluate_parts(points, shares);
    if (moments != nullptr) {
      moments->before.evaluate(points, std::span(before).first(points.size()));
      moments->after.evaluate(points, std::span(after).first(points.size()));
    }
    for (std::size_t v = begin; v < end; ++v) {
      const Vec3& x = mesh.position[v];
      double sum = 0.0, rate = 0.0, largest = 0.0;
      Vec3 velocity = Vec3::Zero(), gradient = Vec3::Zero();
      for (std::size_t i = shares.offset[v - begin]; i < shares.offset[v - begin + 1]; ++i) {
        SUPPLE_EXPECTS(shares.part[i] < parts.size());
        const PartMotion& part = parts[shares.part[i]];
        const Vec3 moves = part.velocity + part.angular_velocity.cross(x - part.centre);
        const double f = shares.value[i];
        sum += f;
        velocity += f * moves;
        gradient += shares.gradient[i];
        rate -= shares.gradient[i].dot(moves);
        if (!shares.by_turn.empty()) rate += shares.by_turn[i].dot(part.angular_velocity);
        if (f > largest) {
          largest = f;
          column[3][v] = static_cast<double>(part.id);
        }
      }
      if (!(sum > 0.0)) continue;
      velocity /= sum;
      if (moments != nullptr) rate = (after[v - begin] - before[v - begin]) / moments->apart;
      const double slope2 = gradient.squaredNorm();
      if (slope2 > 0.0) velocity -= (rate + velocity.dot(gradient)) / slope2 * gradient;
      for (int k = 0; k < 3; ++k) column[static_cast<std::size_t>(k)][v] = velocity[k];
    }
  });
  constexpr std::array<const char*, 4> kNames{"velocity_x", "velocity_y", "velocity_z", "owner"};
  for (std::size_t k = 0; k < 4; ++k) mesh.columns.push_back({kNames[k], std::move(column[k])});
}

}  // namespace supple::implicit
