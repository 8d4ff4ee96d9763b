#include "surface/panels/panel_corners.h"

#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

/// Where the ends of a line meet each other or a side of the panel, on the way to the other line. @return the nearest such place to it
std::optional<double> meeting(const LineShape& from, double to, double low, double high) {
  const double gap = to - from.at;
  double least = kInfinity;
  const auto after = [&](double distance, double speed) {  // speed: at which the distance falls, over that between the lines
    const double way = distance / speed;
    if (way / gap > 0.0 && way / gap < 1.0) least = std::min(least, way / gap);
  };
  for (std::size_t i = 0; i < from.ends.size(); ++i) {
    const LineEnd& end = from.ends[i];
    if (end.level == LineEnd::kSide) continue;
    after(high - end.place, end.drift);
    after(end.place - low, -end.drift);
    if (i + 1 == from.ends.size() || from.ends[i + 1].level == LineEnd::kSide) continue;
    const LineEnd& next = from.ends[i + 1];
    // Two places of one level meet where the square of their distance, which changes evenly, is zero.
    const double halve = next.level == end.level ? 0.5 : 1.0;
    after(halve * (next.place - end.place), end.drift - next.drift);
  }
  if (!std::isfinite(least)) return std::nullopt;
  return from.at + least * gap;
}

/// How fast the ends of a line move.
double drift_of(const LineShape& line) {
  double sum = 0.0;
  for (const LineEnd& end : line.ends) sum += std::abs(end.drift);
  return sum;
}

}  // namespace

std::optional<PanelCorner> corner_between(const LineShape& one, const LineShape& other, double low, double high) {
  const auto alike = [](const LineEnd& p, const LineEnd& q) { return p.level == q.level; };
  if (std::equal(one.ends.begin(), one.ends.end(), other.ends.begin(), other.ends.end(), alike)) return std::nullopt;
  const double gap = other.at - one.at;
  const std::optional<double> up = meeting(one, other.at, low, high), down = meeting(other, one.at, low, high);
  // The nearer it is to the line that tells, the better it is known.
  const bool by_one = up && (!down || *up - one.at <= other.at - *down);
  const double at = by_one ? *up : down ? *down : 0.5 * (one.at + other.at);
  double change = std::abs(other.area - one.area);
  if (up || down) change = std::max(change, std::min(gap * drift_of(by_one ? one : other), high - low));
  return PanelCorner{at, kOfRectangle * gap * change, kOfRectangle * gap * std::abs(other.load - one.load)};
}

std::optional<PanelCorner> corner_beyond(const LineShape& last, double side, double low, double high) {
  const std::optional<double> at = meeting(last, side, low, high);
  if (!at) return std::nullopt;
  const double drift = drift_of(last);
  double length = 0.0;
  for (std::size_t i = 0; i < last.ends.size(); ++i) length += (i % 2 == 0 ? -1.0 : 1.0) * last.ends[i].place;
  const double rest = std::abs(side - *at), area = 0.5 * rest * rest * drift, share = length > 0.0 ? std::min(drift * rest / length, 1.0) : 1.0;
  return PanelCorner{*at, area, share * last.load * rest / 3.0};
}

}  // namespace supple::collision
