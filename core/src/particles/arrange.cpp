#include "supple/core/arrange.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "neighbours/cell_search.h"
#include "particles/random_share.h"
#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/core/neighbours.h"

namespace supple::core {
namespace {

/// Body axes from a tangent in the x-y plane: x along the curve, z the normal, right-handed.
Quat frame_on_curve(const Vec3& tangent, NormalDirection normal) {
  const Vec3 x = tangent.normalized();
  const Vec3 z = normal == NormalDirection::Axis ? Vec3(Vec3::UnitZ()) : Vec3(x.y(), -x.x(), 0.0);
  Mat3 axes;
  axes.col(0) = x;
  axes.col(1) = z.cross(x);
  axes.col(2) = z;
  return Quat(axes).normalized();
}

double inverse_sinh(double u) { return math::log(u + std::sqrt(u * u + 1.0)); }  // u >= 0

/// Arc length of r = b theta from the origin to the radius b u, over b.
double spiral_length(double u) { return 0.5 * (u * std::sqrt(1.0 + u * u) + inverse_sinh(u)); }

/// The u in [low, high] with spiral_length(u) = length: Newton, held inside the bracket.
double spiral_at(double length, double low, double high) {
  double u = 0.5 * (low + high);
  for (int i = 0; i < 200; ++i) {
    const double excess = spiral_length(u) - length;
    (excess > 0.0 ? high : low) = u;
    double next = u - excess / std::sqrt(1.0 + u * u);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == u) break;
    u = next;
  }
  return u;
}

}  // namespace

Arrangement arrange_spiral(int count, double inner_radius, double outer_radius, double turns, NormalDirection normal) {
  SUPPLE_EXPECTS(count >= 2 && inner_radius >= 0.0 && inner_radius < outer_radius && turns > 0.0);
  const double b = (outer_radius - inner_radius) / (2.0 * std::numbers::pi * turns);  // dr / dtheta
  const double u_first = inner_radius / b;
  const double u_last = outer_radius / b;
  const double s_first = spiral_length(u_first);
  const double s_last = spiral_length(u_last);
  Arrangement out;
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / (count - 1);
    double u = spiral_at(s_first + share * (s_last - s_first), u_first, u_last);
    if (i == 0) u = u_first;
    if (i == count - 1) u = u_last;
    const auto [sin, cos] = math::sin_cos(u - u_first);
    out.position.emplace_back(b * u * cos, b * u * sin, 0.0);
    out.orientation.push_back(frame_on_curve(Vec3(cos - u * sin, sin + u * cos, 0.0), normal));
  }
  return out;
}

Arrangement arrange_ring(int count, double radius, NormalDirection normal) {
  SUPPLE_EXPECTS(count >= 1 && radius > 0.0);
  Arrangement out;
  for (int i = 0; i < count; ++i) {
    const auto [sin, cos] = math::sin_cos(2.0 * std::numbers::pi * i / count);
    out.position.emplace_back(radius * cos, radius * sin, 0.0);
    out.orientation.push_back(frame_on_curve(Vec3(-sin, cos, 0.0), normal));
  }
  return out;
}

Arrangement arrange_line(int count, double spacing) { return arrange_grid(count, 1, spacing); }

Arrangement arrange_grid(int columns, int rows, double spacing, int layers) {
  SUPPLE_EXPECTS(columns >= 1 && rows >= 1 && layers >= 1 && spacing > 0.0);
  Arrangement out;
  const auto centred = [spacing](int index, int count) { return spacing * (index - 0.5 * (count - 1)); };
  for (int layer = 0; layer < layers; ++layer) {
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        out.position.emplace_back(centred(column, columns), centred(row, rows), centred(layer, layers));
        out.orientation.push_back(Quat::Identity());
      }
    }
  }
  return out;
}

void disorder(Arrangement& arrangement, double distance) {
  SUPPLE_EXPECTS(distance >= 0.0);
  for (std::uint64_t i = 0; i < arrangement.size(); ++i) {
    Vec3 way;
    std::uint64_t draw = 0;
    do {  // the first point of a cube that lies in the ball
      for (int k = 0; k < 3; ++k) way[k] = 2.0 * random_share(i, draw++) - 1.0;
    } while (way.squaredNorm() > 1.0);
    arrangement.position[i] += distance * way;
  }
}

Arrangement arrange_geodesic(int frequency, double radius) {
  SUPPLE_EXPECTS(frequency >= 1 && frequency <= 300 && radius > 0.0);
  const double golden = 0.5 * (1.0 + std::sqrt(5.0));
  std::vector<Vec3> corner;
  for (const double one : {1.0, -1.0}) {
    for (const double phi : {golden, -golden}) {
      corner.emplace_back(0.0, one, phi);
      corner.emplace_back(one, phi, 0.0);
      corner.emplace_back(phi, 0.0, one);
    }
  }
  std::swap(corner[9], corner[11]);  // the last is opposite to the first
  const auto adjacent = [&corner](std::size_t a, std::size_t b) { return (corner[a] - corner[b]).squaredNorm() < 4.5; };

  Arrangement out;
  const auto add = [&](const Vec3& direction) {
    const Vec3 normal = direction.normalized();
    Eigen::Index least = 0;
    normal.cwiseAbs().minCoeff(&least);
    Mat3 frame;
    frame.col(2) = normal;
    frame.col(0) = Vec3::Unit(least).cross(normal).normalized();
    frame.col(1) = normal.cross(frame.col(0));
    out.position.emplace_back(radius * normal);
    out.orientation.emplace_back(frame);
  };
  for (const Vec3& c : corner) add(c);
  for (std::size_t a = 0; a < corner.size(); ++a) {
    for (std::size_t b = a + 1; b < corner.size(); ++b) {
      if (!adjacent(a, b)) continue;
      for (int i = 1; i < frequency; ++i) add((frequency - i) * corner[a] + i * corner[b]);
    }
  }
  for (std::size_t a = 0; a < corner.size(); ++a) {
    for (std::size_t b = a + 1; b < corner.size(); ++b) {
      for (std::size_t c = b + 1; c < corner.size(); ++c) {
        if (!adjacent(a, b) || !adjacent(b, c) || !adjacent(a, c)) continue;
        for (int i = 1; i < frequency; ++i) {
          for (int j = 1; i + j < frequency; ++j) {
            add((frequency - i - j) * corner[a] + i * corner[b] + j * corner[c]);
          }
        }
      }
    }
  }
  return out;
}

Arrangement arrange_single() { return {{Vec3::Zero()}, {Quat::Identity()}}; }

void place(Arrangement& arrangement, const Pose& pose) {
  for (std::size_t i = 0; i < arrangement.size(); ++i) {
    arrangement.position[i] = pose.to_world(arrangement.position[i]);
    arrangement.orientation[i] = (pose.orientation * arrangement.orientation[i]).normalized();
    if (!arrangement.velocity.empty()) arrangement.velocity[i] = pose.orientation * arrangement.velocity[i];
  }
}

Bonds bonds_along(std::uint32_t begin, std::uint32_t end, int steps) {
  SUPPLE_EXPECTS(begin <= end && steps >= 1);
  Bonds bonds;
  for (std::uint32_t a = begin; a < end; ++a) {
    for (std::uint32_t b = a + 1; b < end && b - a <= static_cast<std::uint32_t>(steps); ++b) {
      bonds.first.push_back(a);
      bonds.second.push_back(b);
    }
  }
  return bonds;
}

std::uint64_t count_bonds_along(std::uint64_t particles, int steps) {
  SUPPLE_EXPECTS(steps >= 1);
  const std::uint64_t reach = std::min<std::uint64_t>(static_cast<std::uint64_t>(steps), particles > 0 ? particles - 1 : 0);
  return reach * particles - reach * (reach + 1) / 2;
}

Bonds bonds_within(std::span<const Vec3> position, std::uint32_t begin, std::uint32_t end, double distance) {
  SUPPLE_EXPECTS(begin <= end && end <= position.size() && distance > 0.0);
  Bonds bonds;
  for (const IndexPair& pair : find_neighbours(position.subspan(begin, end - begin), distance)) {
    bonds.first.push_back(begin + pair.first);
    bonds.second.push_back(begin + pair.second);
  }
  return bonds;
}

BondCount count_bonds_within(std::span<const Vec3> position, double distance) {
  constexpr std::uint64_t kMostCounted = 10'000'000;  // one by one, in a fraction of a second
  constexpr std::size_t kSample = 512;
  const auto stride = static_cast<std::uint32_t>(std::max<std::size_t>(1, position.size() / kSample));
  const std::uint64_t estimate = stride * count_near_points(position, distance, stride) / 2;
  if (stride == 1 || estimate > kMostCounted) return {.number = estimate, .estimated = stride > 1};
  return {.number = count_near_points(position, distance, 1) / 2, .estimated = false};
}

}  // namespace supple::core
