/// Where kinks of the fields cross pieces of marched triangles: on rays, and on the edges that rays begin and end on.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "numbers.h"
#include "surface/accuracy.h"
#include "surface/march/march_rule.h"

namespace supple::collision {
namespace {

constexpr double kReach = 1.1;       // of the feet of a piece, that its image may extend to

}  // namespace

/// Of the corners and the middles of the edges, at a place, in the quadratic polynomial through them.
std::array<double, 6> MarchRuleSolver::weights(const Piece& piece, const Vec2& at) {
  const auto& c = piece.corner;
  const Vec2 u = c[1].at - c[0].at, v = c[2].at - c[0].at, w = at - c[0].at;
  const double whole = cross(u, v), q = cross(w, v) / whole, r = cross(u, w) / whole, p = 1.0 - q - r;
  return {p * (2.0 * p - 1.0), q * (2.0 * q - 1.0), r * (2.0 * r - 1.0), 4.0 * q * r, 4.0 * r * p, 4.0 * p * q};
}

/// Kinks that may cross the leaves [first, end).
void MarchRuleSolver::find_crossings(const PairPressure& pressure, std::size_t first, std::size_t end, double error) {
  crossings_.clear();
  for (std::size_t l = first; l < end; ++l) {
    Leaf& leaf = leaves_[l];
    leaf.first_crossing = crossings_.size();
    leaf.crossings = 0;
    leaf.trust = Trust::Smooth;
    leaf.mild = true;
    if (leaf.shape.part == Part::None) continue;
    std::array<Vec3, 6> foot;
    const auto lifted = [&](const Foot& f) { return Vec3(plane(leaf.piece.triangle, f.at) + f.height * along(leaf.piece.triangle, f.at)); };
    for (std::size_t k = 0; k < 3; ++k) {
      foot[k] = lifted(leaf.piece.corner[k]);
      foot[3 + k] = lifted(leaf.piece.middle[k]);
    }
    const Vec3 centre = (foot[3] + foot[4] + foot[5]) / 3.0;
    double reach = 0.0;
    for (const Vec3& x : foot) reach = std::max(reach, kReach * (x - centre).norm());
    if (!all_kinks_) {
      known_.clear();
      const Vec3 around = Vec3::Constant(reach);
      if (!pressure.kinks({centre - around, centre + around}, known_)) leaf.trust = Trust::Kinked;
    }
    for (std::size_t k = 0; k < kinks_.size(); ++k) {
      const implicit::Kink& kink = kinks_[k];
      if (std::abs(kink.value(centre)) > kink.change(centre, reach)) continue;
      Crossing crossing{.kink = k, .side = {}};
      for (std::size_t i = 0; i < 6; ++i) crossing.side[i] = kink.value(foot[i]);
      // By the Bezier controls of the polynomial.
      const auto& s = crossing.side;
      const std::array<double, 6> control{
          s[0], s[1], s[2], 2.0 * s[3] - 0.5 * (s[1] + s[2]), 2.0 * s[4] - 0.5 * (s[2] + s[0]), 2.0 * s[5] - 0.5 * (s[0] + s[1])};
      const auto [least, most] = std::minmax_element(control.begin(), control.end());
      if (*least > 0.0 || *most < 0.0) continue;
      if (is_mild(kink, error)) {
        leaf.trust = Trust::Kinked;
        continue;
      }
      crossings_.push_back(crossing);
      leaf.mild = leaf.mild && kink.order > 2;
    }
    leaf.crossings = crossings_.size() - leaf.first_crossing;
    if (leaf.crossings > 0) cross_kinks(leaf);
  }
}

/// Turns the rays of a leaf that presses all over, so that they cross its kinks; where rays may touch one, rules are not trusted.
void MarchRuleSolver::cross_kinks(Leaf& leaf) const {
  constexpr double kTouch = 0.1;  // of what s changes by over the leaf
  const auto kinks = std::span(crossings_).subspan(leaf.first_crossing, leaf.crossings);
  // Rates of s along the rays from corner i to j, linear over the leaf, are least at a corner.
  const auto least_rate = [&](std::size_t i, std::size_t j) {
    const std::size_t k = 3 - i - j;
    double least = kInfinity;
    for (const Crossing& crossing : kinks) {
      const auto& s = crossing.side;
      const std::array<double, 3> rate{4.0 * s[3 + k] - 3.0 * s[i] - s[j], 3.0 * s[j] + s[i] - 4.0 * s[3 + k],
                                       4.0 * (s[3 + i] - s[3 + j]) - s[j] + s[i]};
      const auto [low, high] = std::minmax_element(rate.begin(), rate.end());
      const double change = std::max({std::abs(s[1] - s[0]), std::abs(s[2] - s[1]), std::abs(s[0] - s[2])});
      least = std::min(least, std::max(*low, -*high) / change);
    }
    return least;
  };
  double best = least_rate(leaf.shape.order[0], leaf.shape.order[1]);
  for (std::size_t i = 0; i < 3 && leaf.shape.part == Part::All; ++i) {
    const std::size_t j = (i + 1) % 3;
    const double rate = least_rate(i, j);
    if (!(rate > best)) continue;
    best = rate;
    leaf.shape.order = {i, j, 3 - i - j};
  }
  if (!(best > kTouch)) leaf.trust = Trust::Lost;
}

/// Guesses where the kinks of its leaf cross a ray between two places.
void MarchRuleSolver::add_cuts(const Ray& along, double low, double high, std::vector<Ray>& cuts) const {
  const Leaf& leaf = leaves_[along.leaf];
  const auto at = [&](double u) { return low + u * (high - low); };
  std::array<std::array<double, 6>, 3> weight;
  for (std::size_t i = 0; i < 3; ++i) weight[i] = weights(leaf.piece, along.from + at(0.5 * static_cast<double>(i)) * along.way);
  for (std::size_t k = leaf.first_crossing; k < leaf.first_crossing + leaf.crossings; ++k) {
    std::array<double, 3> side{};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 6; ++j) side[i] += weight[i][j] * crossings_[k].side[j];
    }
    // s = c + b u + a u^2
    const double c = side[0], b = 4.0 * side[1] - 3.0 * side[0] - side[2], a = 2.0 * (side[0] + side[2]) - 4.0 * side[1];
    const double square = b * b - 4.0 * a * c;
    if (!(square > 0.0)) continue;
    const double q = -0.5 * (b + std::copysign(std::sqrt(square), b)), turn = a != 0.0 ? -0.5 * b / a : -1.0;
    for (const double u : {q != 0.0 ? c / q : -1.0, a != 0.0 ? q / a : -1.0}) {
      if (!(u > 0.0 && u < 1.0)) continue;
      Ray cut;
      cut.leaf = along.leaf;
      cut.kink = crossings_[k].kink;
      cut.from = along.from;
      cut.way = along.way;
      cut.rim = b + 2.0 * a * u > 0.0 ? Rim::Rises : Rim::Falls;
      const bool split = turn > 0.0 && turn < 1.0;
      cut.low = split && u > turn ? at(turn) : low;
      cut.high = split && u < turn ? at(turn) : high;
      cut.at = at(u);
      cut.height = height_at(leaf.piece, cut.from + cut.at * cut.way);
      cuts.push_back(cut);
    }
  }
}

/// Fills `corners_` and `feet_` with about where kinks meet the rim in the leaves [first, end), if the polynomials through their feet say that they do.
void MarchRuleSolver::guess_corners(std::size_t first, std::size_t end) {
  constexpr int kLooks = 9;
  corners_.clear();
  feet_.clear();
  for (std::size_t l = first; l < end; ++l) {
    const Leaf& leaf = leaves_[l];
    if (leaf.crossings == 0 || (leaf.shape.part != Part::Corner && leaf.shape.part != Part::AllButCorner)) continue;
    const auto& c = leaf.piece.corner;
    const std::size_t i = leaf.shape.order[0], j = leaf.shape.order[1], k = leaf.shape.order[2];
    const auto rim_at = [&](double across) {
      const Vec2 from = c[i].at + across * (c[k].at - c[i].at), way = (1.0 - across) * (c[j].at - c[i].at);
      const auto look = [&](double u) { return quadratic(leaf.piece, from + u * way, [](const Foot& f) { return f.pressure; }); };
      const double p = look(0.0), q = look(0.5), r = look(1.0), b = 4.0 * q - 3.0 * p - r, a = 2.0 * (p + r) - 4.0 * q;
      const double root = -0.5 * (b + std::copysign(std::sqrt(std::max(b * b - 4.0 * a * p, 0.0)), b));
      const double u = root != 0.0 && p / root >= 0.0 && p / root <= 1.0 ? p / root : a != 0.0 ? root / a : 0.5;
      return Vec2(from + std::clamp(u, 0.0, 1.0) * way);
    };
    std::array<Vec2, kLooks> place;
    for (std::size_t m = 0; m < kLooks; ++m) place[m] = rim_at(leaf.ends * static_cast<double>(m) / (kLooks - 1));
    for (std::size_t n = leaf.first_crossing; n < leaf.first_crossing + leaf.crossings; ++n) {
      const auto side = [&](const Vec2& at) {
        const std::array<double, 6> weight = weights(leaf.piece, at);
        double s = 0.0;
        for (std::size_t q = 0; q < 6; ++q) s += weight[q] * crossings_[n].side[q];
        return s;
      };
      double before = side(place[0]);
      for (std::size_t m = 1; m < kLooks; ++m) {
        const double after = side(place[m]);
        if ((before > 0.0) != (after > 0.0)) {
          const Vec2 at = place[m - 1] + before / (before - after) * (place[m] - place[m - 1]);
          corners_.push_back({l, crossings_[n].kink, false});
          feet_.add(leaf.piece.triangle, at, height_at(leaf.piece, at));
        }
        before = after;
      }
    }
  }
}

/// The same on Sigma, by Newton's method in both parameters.
void MarchRuleSolver::find_corners(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end) {
  constexpr double kMet = 1e-5;  // of the piece
  guess_corners(first, end);
  feet_.make_room();
  open_.resize(corners_.size());
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int step = 0; step < kFreeSteps && !open_.empty(); ++step) {
    measure(pressure, third, feet_, open_);
    std::size_t left = 0;
    for (const std::size_t i : open_) {
      const double move = to_sigma(feet_, i), size = std::sqrt(twice_parameters(leaves_[corners_[i].leaf].piece));
      if (!std::isfinite(move)) continue;
      feet_.height[i] += std::clamp(move, -0.5 * cell_, 0.5 * cell_);
      if (std::abs(feet_.height[i]) > cell_) continue;
      if (std::abs(move) > kFarOff * cell_) {
        open_[left++] = i;
        continue;
      }
      find_tangents(feet_, i);
      lift(feet_, i, move);
      const Foot here = foot(feet_, i);
      Vec3 slope;
      const double s = kinks_[corners_[i].kink].value(feet_.batch.point[i], slope);
      const Vec2 rate(slope.dot(feet_.along_s[i]), slope.dot(feet_.along_t[i]));
      Vec2 way = meeting_of(here.slope, -here.pressure, rate, -s);
      if (!way.allFinite()) continue;
      const double length = way.norm();
      if (length > size) way *= size / length;
      feet_.at[i] += way;
      feet_.height[i] += way.dot(here.climb);
      corners_[i].found = length < kMet * size && std::abs(move) < kMet * cell_;
      if (!corners_[i].found) open_[left++] = i;
    }
    open_.resize(left);
  }
}

/// Where the leaves [first, end) are parted across the rays: where the rim, and kinks, meet the edges that rays begin and end on.
void MarchRuleSolver::find_breaks(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end) {
  find_ends(pressure, third, first, end);
  cuts_.clear();
  for (std::size_t l = first; l < end; ++l) {
    const Leaf& leaf = leaves_[l];
    if (leaf.crossings == 0) continue;
    const auto& c = leaf.piece.corner;
    const auto [i, j, k] = leaf.shape.order;
    Ray edge;
    edge.leaf = l;
    edge.from = c[i].at;
    edge.way = c[k].at - c[i].at;
    if (leaf.shape.part == Part::AllButCorner) add_cuts(edge, leaf.ends, 1.0, cuts_);
    else add_cuts(edge, 0.0, leaf.ends, cuts_);
    edge.from = c[j].at;
    edge.way = c[k].at - c[j].at;
    if (leaf.shape.part != Part::Corner) add_cuts(edge, 0.0, 1.0, cuts_);
  }
  find_zeros(pressure, third, cuts_);
  find_corners(pressure, third, first, end);
  breaks_.clear();
  std::size_t cut = 0, corner = 0;
  for (std::size_t l = first; l < end; ++l) {
    Leaf& leaf = leaves_[l];
    leaf.first_break = breaks_.size();
    const bool rim = leaf.shape.part == Part::Corner || leaf.shape.part == Part::AllButCorner;
    const double stop = leaf.shape.part == Part::Corner ? leaf.ends : 1.0;
    breaks_.push_back(0.0);
    for (; cut < cuts_.size() && cuts_[cut].leaf == l; ++cut) {
      if (cuts_[cut].at > 0.0 && cuts_[cut].at < stop) breaks_.push_back(cuts_[cut].at);
    }
    for (; corner < corners_.size() && corners_[corner].leaf == l; ++corner) {
      const auto [i, j, k] = leaf.shape.order;
      const Vec2 u = leaf.piece.corner[j].at - leaf.piece.corner[i].at, v = leaf.piece.corner[k].at - leaf.piece.corner[i].at,
                 w = feet_.at[corner] - leaf.piece.corner[i].at;
      const double across = cross(u, w) / cross(u, v);
      if (corners_[corner].found && across > 0.0 && across < leaf.ends) breaks_.push_back(across);
    }
    if (rim) breaks_.push_back(leaf.ends);
    breaks_.push_back(1.0);
    std::sort(breaks_.begin() + static_cast<std::ptrdiff_t>(leaf.first_break), breaks_.end());
    leaf.breaks = breaks_.size() - leaf.first_break;
  }
}

/// Where kinks cut the parts of the rays that press.
void MarchRuleSolver::find_cuts(PairPressure& pressure, Thirds third) {
  cuts_.clear();
  for (Ray& ray : rays_) {
    ray.first_cut = cuts_.size();
    if (leaves_[ray.leaf].crossings > 0) add_cuts(ray, ray.begins(), ray.ends(), cuts_);
    ray.cuts = cuts_.size() - ray.first_cut;
  }
  find_zeros(pressure, third, cuts_);
  for (const Ray& ray : rays_) {
    const auto from = cuts_.begin() + static_cast<std::ptrdiff_t>(ray.first_cut);
    std::sort(from, from + static_cast<std::ptrdiff_t>(ray.cuts), [](const Ray& p, const Ray& q) { return p.at < q.at; });
  }
}

/// Whether the points of a leaf, the feet from this one on, lie on one side of every kink between two cuts, and all rays of a part
/// meet the same kinks in the same order; from part to part one kink more or less, where it meets an edge, and none at the tip that the
/// last rays shrink to. Otherwise a kink leaves the leaf between two rays.
bool MarchRuleSolver::sides_agree(const Leaf& leaf, std::size_t first_ray, std::size_t end_ray, std::size_t foot) {
  constexpr double kOnKink = 1e-6;  // in cells
  const auto kinks = std::span(crossings_).subspan(leaf.first_crossing, leaf.crossings);
  part_sides_.resize(leaf.breaks);
  for (auto& sides : part_sides_) sides.clear();
  for (std::size_t r = first_ray; r < end_ray; ++r) {
    sides_.clear();
    for (std::size_t seen = 0; seen < rays_[r].feet; seen += static_cast<std::size_t>(rays_[r].nodes)) {
      for (const Crossing& crossing : kinks) {
        int sides = 0;
        for (int n = 0; n < rays_[r].nodes; ++n) {
          const double s = kinks_[crossing.kink].value(feet_.batch.point[foot + seen + static_cast<std::size_t>(n)]);
          if (std::abs(s) > kOnKink * cell_) sides |= s > 0.0 ? 1 : 2;
        }
        if (sides == 3) return false;
        sides_.push_back(static_cast<std::uint8_t>(sides));
      }
    }
    foot += rays_[r].feet;
    auto& expected = part_sides_[rays_[r].part];
    if (expected.empty()) expected = sides_;
    if (sides_ != expected) return false;
  }
  const std::size_t n = kinks.size(), parts = rays_[end_ray - 1].part + 1;
  if (part_sides_[parts - 1].size() > n) return false;
  for (std::size_t part = 0; part + 1 < parts; ++part) {
    const double place = breaks_[leaf.first_break + part + 1];
    const std::size_t here = part_sides_[part].size(), next = part_sides_[part + 1].size();
    if (here + (place == leaf.ends ? 0 : n) != next && here != next + (place == leaf.ends ? 0 : n)) return false;
  }
  return true;
}

}  // namespace supple::collision
