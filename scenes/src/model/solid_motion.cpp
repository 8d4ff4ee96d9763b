#include "supple/scenes/solid_motion.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/integrate.h"

namespace supple::scenes {
namespace {

constexpr Eigen::Index kRows = 4;
using Row = Eigen::Matrix<double, kRows, 1>;

Row row_of(const ObstacleKeyDesc& key) {
  Row row;
  row << key.at, key.turn;
  return row;
}

double length_of(const std::vector<ObstacleKeyDesc>& keys, std::size_t k) { return keys[k + 1].time - keys[k].time; }

/// Fritsch & Butland 1984: the weighted harmonic mean of the chords' slopes beside a key, 0 where they differ in sign.
Row slope_at(const std::vector<ObstacleKeyDesc>& keys, std::size_t i) {
  Row slope = Row::Zero();
  if (i == 0 || i + 1 == keys.size()) return slope;
  const double before = length_of(keys, i - 1), after = length_of(keys, i);
  const Row d0 = (row_of(keys[i]) - row_of(keys[i - 1])) / before, d1 = (row_of(keys[i + 1]) - row_of(keys[i])) / after;
  const double w0 = 2.0 * after + before, w1 = after + 2.0 * before;
  for (Eigen::Index k = 0; k < kRows; ++k) {
    if (d0[k] * d1[k] > 0.0) slope[k] = (w0 + w1) / (w0 / d0[k] + w1 / d1[k]);
  }
  return slope;
}

/// Between two keys, p(s) = ((c3 s + c2) s + c1) s + c0 of the time s since the first of them.
struct Piece {
  Row c0, c1, c2, c3;
};

Piece piece_of(const SolidMotion& motion, std::size_t k) {
  const double h = length_of(motion.keys, k);
  const Row a = row_of(motion.keys[k]), chord = (row_of(motion.keys[k + 1]) - a) / h;
  if (motion.between == LeadName::Linear) return {a, chord, Row::Zero(), Row::Zero()};
  const Row s0 = slope_at(motion.keys, k), s1 = slope_at(motion.keys, k + 1);
  return {a, s0, (3.0 * chord - 2.0 * s0 - s1) / h, (s0 + s1 - 2.0 * chord) / (h * h)};
}

/// Largest |c1 + 2 c2 s + 3 c3 s^2| on [0, h], row by row.
Row fastest(const Piece& p, double h) {
  Row out;
  for (Eigen::Index k = 0; k < kRows; ++k) {
    const auto at = [&](double s) { return std::abs(p.c1[k] + s * (2.0 * p.c2[k] + s * 3.0 * p.c3[k])); };
    out[k] = std::max(at(0.0), at(h));
    const double peak = p.c3[k] != 0.0 ? -p.c2[k] / (3.0 * p.c3[k]) : -1.0;
    if (peak > 0.0 && peak < h) out[k] = std::max(out[k], at(peak));
  }
  return out;
}

}  // namespace

SolidPlace place_at(const SolidMotion& motion, double time) {
  SUPPLE_EXPECTS(!motion.keys.empty());
  const std::vector<ObstacleKeyDesc>& keys = motion.keys;
  Row row = row_of(keys.front()), rate = Row::Zero();
  if (time >= keys.back().time) {
    row = row_of(keys.back());
  } else if (time >= keys.front().time) {
    std::size_t k = 0;
    while (keys[k + 1].time <= time) ++k;
    const Piece p = piece_of(motion, k);
    const double s = time - keys[k].time;
    row = p.c0 + s * (p.c1 + s * (p.c2 + s * p.c3));
    rate = p.c1 + s * (2.0 * p.c2 + s * 3.0 * p.c3);
  }
  return {.pose = {row.head<3>(), core::rotation_exp(row[3] * motion.axis)},
          .velocity = rate.head<3>(),
          .spin = rate[3] * motion.axis};
}

bool moves(const SolidMotion& motion, double from, double to) {
  const std::vector<ObstacleKeyDesc>& keys = motion.keys;
  for (std::size_t k = 0; k + 1 < keys.size(); ++k) {
    if (keys[k].time <= to && keys[k + 1].time >= from && row_of(keys[k]) != row_of(keys[k + 1])) return true;
  }
  return false;
}

double largest_speed(const SolidMotion& motion, double radius) {
  double speed = 0.0;
  for (std::size_t k = 0; k + 1 < motion.keys.size(); ++k) {
    const Row rate = fastest(piece_of(motion, k), length_of(motion.keys, k));
    speed = std::max(speed, rate.head<3>().norm() + rate[3] * radius);
  }
  return speed;
}

}  // namespace supple::scenes
