/// @file plane_chart.h
/// Coordinates of panels in the plane across their rays.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "supple/core/math.h"

namespace supple::collision {

/// Coordinates of panels over the plane: those of the plane itself [m], or those of a star about its origin: the angle [rad], and the distance over how far
/// the star reaches in that direction [1]. The rim of a patch that its origin sees is about the same distance away in every direction then.
struct PlaneChart {
  using Place = std::array<double, 2>;

  Place axis{1.0, 1.0};       ///< lengths that the cosine and the sine of the angle are multiplied by [m]
  /// How far a star reaches over these lengths: a sum of waves, those of the cosine and the sine of each multiple of the angle [1]; empty: the plane itself.
  std::vector<Place> wave;

  [[nodiscard]] bool star() const { return !wave.empty(); }

  /// Of a star that reaches about as far as values at equally spaced angles, smoothed by the kernel of Fejer, which keeps it positive.
  static std::vector<Place> waves_of(std::span<const double> values);

  /// Where a place is in the plane [m].
  [[nodiscard]] Place at(const Place& place) const {
    if (!star()) return place;
    const auto [sine, cosine] = math::sin_cos(place[0]);
    const double radius = place[1] * reach_at(sine, cosine)[0];
    return {radius * axis[0] * cosine, radius * axis[1] * sine};
  }

  /// The coordinates of a place in the plane [m].
  [[nodiscard]] Place place_of(const Place& at) const {
    if (!star()) return at;
    const double x = at[0] / axis[0], y = at[1] / axis[1], radius = std::hypot(x, y), angle = math::atan2(y, x);
    if (!(radius > 0.0)) return {0.0, 0.0};
    return {angle < 0.0 ? angle + 2.0 * std::numbers::pi : angle, radius / reach_at(y / radius, x / radius)[0]};
  }

  /// Derivatives by the coordinates of a function with these slopes over the plane.
  [[nodiscard]] Place slopes(const Place& place, const Place& over_plane) const {
    if (!star()) return over_plane;
    const auto [sine, cosine] = math::sin_cos(place[0]);
    const auto [far, rate] = reach_at(sine, cosine);
    const double out = axis[0] * cosine * over_plane[0] + axis[1] * sine * over_plane[1], around = axis[1] * cosine * over_plane[1] - axis[0] * sine * over_plane[0];
    return {place[1] * (far * around + rate * out), far * out};
  }

  /// Area of the plane over that of the coordinates.
  [[nodiscard]] double stretch(const Place& place) const {
    if (!star()) return 1.0;
    const auto [sine, cosine] = math::sin_cos(place[0]);
    const double far = reach_at(sine, cosine)[0];
    return axis[0] * axis[1] * far * far * place[1];
  }

 private:
  /// How far the star reaches, and how that changes with the angle.
  [[nodiscard]] std::array<double, 2> reach_at(double sine, double cosine) const {
    double far = 0.0, rate = 0.0, c = 1.0, s = 0.0;
    for (std::size_t m = 0; m < wave.size(); ++m) {
      far += wave[m][0] * c + wave[m][1] * s;
      rate += static_cast<double>(m) * (wave[m][1] * c - wave[m][0] * s);
      const double next = c * cosine - s * sine;
      s = s * cosine + c * sine;
      c = next;
    }
    return {far, rate};
  }
};

inline std::vector<PlaneChart::Place> PlaneChart::waves_of(std::span<const double> values) {
  constexpr std::size_t kWaves = 6;
  const auto n = static_cast<double>(values.size());
  std::vector<Place> wave(kWaves + 1);
  std::vector<math::SinCos> turn;
  for (std::size_t k = 0; k < values.size(); ++k) turn.push_back(math::sin_cos(2.0 * std::numbers::pi * static_cast<double>(k) / n));
  for (std::size_t m = 0; m <= kWaves; ++m) {
    const double share = (m == 0 ? 1.0 : 2.0) / n * (1.0 - static_cast<double>(m) / (kWaves + 1.0));
    for (std::size_t k = 0; k < values.size(); ++k) {
      const auto [sine, cosine] = turn[m * k % values.size()];
      wave[m][0] += share * values[k] * cosine;
      wave[m][1] += share * values[k] * sine;
    }
  }
  return wave;
}

}  // namespace supple::collision
