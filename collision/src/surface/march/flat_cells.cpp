#include "surface/march/flat_cells.h"

#include <algorithm>
#include <cmath>

namespace supple::collision {
namespace {

/// Unit normals of one body's surface within the other, from where Newton's method leads on a grid of the overlap.
std::vector<Vec3> normals_within(PairPressure& pressure, int side, const Box& overlap) {
  constexpr int kPlaces = 5, kSteps = 12;
  constexpr double kMet = 1e-6;  // of the modulus
  const Vec3 extent = overlap.extent();
  const double longest = 0.5 * extent.norm();
  std::vector<Vec3> at;
  for (int i = 0; i < kPlaces; ++i) {
    for (int j = 0; j < kPlaces; ++j) {
      for (int k = 0; k < kPlaces; ++k) at.push_back(overlap.lower + extent.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5)) / kPlaces);
    }
  }
  std::vector<double> value(at.size()), other(at.size());
  std::vector<Vec3> slope(at.size());
  for (int step = 0;; ++step) {
    pressure.evaluate(side, at, value, slope);
    if (step == kSteps) break;
    for (std::size_t i = 0; i < at.size(); ++i) {
      const double square = slope[i].squaredNorm();
      if (!(square > 0.0)) continue;
      Vec3 move = (-value[i] / square) * slope[i];
      const double length = move.norm();
      if (length > longest) move *= longest / length;
      at[i] += move;
    }
  }
  pressure.evaluate(1 - side, at, other);
  std::vector<Vec3> normal;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (other[i] > 0.0 && std::abs(value[i]) <= kMet * pressure.modulus(side) && slope[i].squaredNorm() > 0.0) normal.push_back(-slope[i].normalized());
  }
  return normal;
}

}  // namespace

std::optional<FlatCells> flat_cells(PairPressure& pressure, const Box& overlap) {
  constexpr double kThin = 0.5, kAlike = 0.98, kMostStretch = 1024.0;
  const double size_a = pressure.field(0).feature_size(), size_b = pressure.field(1).feature_size();
  const int thin = size_a < size_b ? 0 : 1;
  const double stretch = std::min(std::max(size_a, size_b) / std::min(size_a, size_b), kMostStretch);
  if (!(stretch * kThin >= 1.0)) return std::nullopt;
  const std::vector<Vec3> normal = normals_within(pressure, thin, overlap);
  std::size_t most = 0, best = 0;
  for (std::size_t i = 0; i < normal.size(); ++i) {
    const auto alike = static_cast<std::size_t>(
        std::count_if(normal.begin(), normal.end(), [&](const Vec3& n) { return std::abs(n.dot(normal[i])) > kAlike; }));
    if (alike > most) {
      most = alike;
      best = i;
    }
  }
  if (2 * most <= normal.size()) return std::nullopt;
  return FlatCells{normal[best], stretch};
}

}  // namespace supple::collision
