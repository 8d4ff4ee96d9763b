#include "surface/polar/rim_waves.h"

#include <algorithm>

#include "surface/quadrature.h"

namespace supple::collision {

/// Radius and height of the rim in directions, all at once.
template <class Directions>
std::array<Directions, 2> RimWaves::sum(const Directions& cosine, const Directions& sine) const {
  std::array<Directions, 2> sum{Directions::Zero(), Directions::Zero()};
  Directions c = Directions::Ones(), s = Directions::Zero();
  for (Eigen::Index m = 0; m < wave_[0].cosine.size(); ++m) {
    for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) sum[which] += wave_[which].cosine[m] * c + wave_[which].sine[m] * s;
    const Directions next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
  return sum;
}

void RimWaves::fit(const Rays& rim) {
  const auto n = static_cast<Eigen::Index>(rim.size()), waves = n / 2 + 1;
  const CurveAngles& angles = curve_angles(rim.size());
  for (Wave& wave : wave_) {
    const std::vector<double>& f = &wave == &wave_[0] ? rim.radius : rim.height;
    wave.cosine.setZero(waves);
    wave.sine.setZero(waves);
    for (Eigen::Index k = 0; k < n; ++k) {
      const double share = f[static_cast<std::size_t>(k)] * (1.0 / static_cast<double>(n));
      wave.cosine += share * Eigen::Map<const Eigen::ArrayXd>(angles.wave_cosine.data() + k * waves, waves);
      wave.sine += share * Eigen::Map<const Eigen::ArrayXd>(angles.wave_sine.data() + k * waves, waves);
    }
    const Eigen::Index inner = (n - 1) / 2;
    wave.cosine.segment(1, inner) *= 2.0;
    wave.sine.segment(1, inner) *= 2.0;
  }
  count_ = rim.size();
}

void RimWaves::place(const PeakFrame& frame, std::vector<Vec3>& points) const {
  const CurveAngles& angles = curve_angles(count_);
  constexpr std::size_t kTogether = 8;
  using Together = Eigen::Array<double, kTogether, 1>;
  points.resize(4 * count_);
  for (std::size_t first = 0; first < points.size(); first += kTogether) {
    const std::size_t count = std::min(kTogether, points.size() - first);
    Together cosine = Together::Zero(), sine = Together::Zero();
    std::copy_n(angles.cosine.data() + first, count, cosine.data());
    std::copy_n(angles.sine.data() + first, count, sine.data());
    const std::array<Together, 2> at = sum(cosine, sine);
    for (std::size_t i = 0; i < count; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      points[first + i] = frame.origin + at[0][j] * (cosine[j] * frame.u + sine[j] * frame.v) + at[1][j] * frame.axis;
    }
  }
}

std::array<double, 2> RimWaves::at(double cosine, double sine) const {
  using One = Eigen::Array<double, 1, 1>;
  const std::array<One, 2> at = sum(One(cosine), One(sine));
  return {at[0][0], at[1][0]};
}

}  // namespace supple::collision
