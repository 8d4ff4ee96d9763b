/// What the panels of a pass may hold beside what their lines tell, and where they would be split for it.
#include <algorithm>
#include <cmath>
#include <utility>

#include "numbers.h"
#include "surface/accuracy.h"
#include "surface/panels/panel_pass.h"

namespace supple::collision::panel_pass {

/// Whether slopes at neighbouring rays of a line lead towards zero, and back.
bool Pass::may_turn(std::uint32_t index, std::size_t row, std::size_t stride) const {
  const PanelArena::Line& line = a_.line[index];
  const std::size_t first = line.first - (index / n_) * n_ * n_, inner = panels_[line.panel].inner;
  const auto value = [&](std::size_t i) -> const LevelValue& { return a_.value[row + (first + i * line.stride) * stride]; };
  for (std::size_t i = 0; i + 1 < n_; ++i) {
    const double towards = value(i).value > 0.0 ? -1.0 : 1.0;
    if (towards * value(i).slope[inner] > 0.0 && towards * value(i + 1).slope[inner] < 0.0) return true;
  }
  return false;
}

/// Where a third body's level, or the pressure, seems to turn near zero between two places of a line: what it is there.
void Pass::look_at_turns() {
  constexpr double kNear = 0.5;  // of the nearer value beside it
  std::size_t begin = 0;
  a_.cut_ray.clear();
  std::vector<PanelArena::Turn>& found = a_.near_zero;
  found.clear();
  for (std::size_t k = 0; k < which_.size(); ++k) {
    const Panel& panel = panels_[which_[k]];
    const std::size_t count = panel.levels.size();
    for (std::size_t j = 0; j < n_; ++j) {
      const auto index = static_cast<std::uint32_t>(k * n_ + j);
      for (std::size_t l = 0; l < count && !a_.line[index].dead; ++l) {
        const std::uint16_t level = a_.level[panel.levels.begin + l];
        if (s_.levels.is_kink(level) || (s_.chart.star() && !s_.levels.is_third(level)) || (!s_.chart.star() && !may_turn(index, begin + l, count))) continue;
        sample_line(index, level, begin + l, count, at_rim(index, l));
        for (std::size_t i = 0; i + 1 < a_.sample.size(); ++i) {
          const std::optional<LevelSample> turn = turn_between(a_.sample[i], a_.sample[i + 1]);
          const double side = a_.sample[i].value > 0.0 ? 1.0 : -1.0;
          if (!turn || side * turn->value > kNear * side * (std::abs(a_.sample[i].value) < std::abs(a_.sample[i + 1].value) ? a_.sample[i] : a_.sample[i + 1]).value) continue;
          found.push_back({index, level, *turn});
          Plane at = a_.line[index].base;
          at[panel.inner] = turn->place;
          a_.cut_ray.push_back(start_ray(panel, at, lattice_of(index)));
        }
      }
    }
    begin += n_ * n_ * count;
  }
  if (found.empty()) return;
  lift(s_.view, a_.cut_ray, s_.enough, a_.rays);
  a_.query.clear();
  for (std::size_t i = 0; i < found.size(); ++i) a_.query.push_back({static_cast<std::uint32_t>(i), found[i].level, {}});
  std::vector<LevelValue> lattice = std::move(a_.value);
  evaluate(a_.cut_ray);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!a_.cut_ray[i].found) continue;
    const std::size_t inner = panels_[a_.line[found[i].line].panel].inner;
    found[i].sample = {a_.cut_ray[i].place[inner], a_.value[i].value, a_.value[i].slope[inner]};
    a_.turn.push_back(found[i]);
  }
  a_.value = std::move(lattice);
}

/// What may press beyond an outermost line that does not, by parabolas from its nodes to the side of the panel, and in its corners.
void Pass::look_beyond(Panel& panel, std::size_t k, bool upper, double& most) const {
  const std::size_t in = panel.inner, out = 1 - in, along = in == 0 ? 1 : n_, step = out == 0 ? 1 : n_;
  const std::size_t first = upper ? (n_ - 1) * step : 0;
  const auto near = [&](std::size_t i, bool other) { return node(k, first + i * along + (other ? (upper ? -step : step) : 0)); };
  const double side = low_of(panel, out) + (upper ? width_of(panel, out) : 0.0);
  const auto add = [&](double area, double load, double place) {
    panel.missed_area += area;
    panel.missed_load += load;
    if (area <= most) return;
    most = area;
    part(panel, out, place);
  };
  for (std::size_t i = 0; i < n_; ++i) {
    const Node ray = near(i, false), other = near(i, true);
    if (!ray.found) continue;
    const double way = side - ray.at[out], bend = other.found ? (other.slope[out] - ray.slope[out]) / (other.at[out] - ray.at[out]) : 0.0;
    const double slope = ray.slope[out] + way * bend, pressure = ray.pressure + way * (ray.slope[out] + 0.5 * way * bend);
    if (pressure > 0.0 && slope != 0.0) {
      const double area = gauss_.weight[i] * width_of(panel, in) * std::min(pressure / std::abs(slope), std::abs(way));
      add(area, 0.5 * pressure * area, ray.at[out]);
    }
    if (i != 0 && i + 1 != n_) continue;
    const Node beside = near(i == 0 ? 1 : i - 1, false);
    const double to_corner = low_of(panel, in) + (i == 0 ? 0.0 : width_of(panel, in)) - ray.at[in];
    const double bend_in = beside.found ? (beside.slope[in] - ray.slope[in]) / (beside.at[in] - ray.at[in]) : 0.0;
    const double twist = other.found ? (other.slope[in] - ray.slope[in]) / (other.at[out] - ray.at[out]) : 0.0;
    const double in_corner = pressure + to_corner * (ray.slope[in] + way * twist + 0.5 * to_corner * bend_in);
    if (!(in_corner > 0.0) || slope == 0.0 || ray.slope[in] == 0.0) continue;
    const double area = 0.5 * std::min(in_corner / std::abs(slope), std::abs(way)) * std::min(in_corner / std::abs(ray.slope[in]), std::abs(to_corner));
    add(area, in_corner * area / 3.0, ray.at[out]);
  }
}

/// What may press along a side of the panel that is nowhere met by what its outermost nodes say of it: where cubics between these turn above zero.
/// @param in  the coordinate that is fixed there
void Pass::look_aside(Panel& panel, std::size_t k, std::size_t in, bool upper, double& most) const {
  const std::size_t out = 1 - in, step = in == 0 ? 1 : n_, along = out == 0 ? 1 : n_;
  const double side = low_of(panel, in) + (upper ? width_of(panel, in) : 0.0);
  a_.sample.clear();
  a_.root.clear();
  double steepest = 0.0, fall = 0.0;
  for (std::size_t j = 0; j < n_; ++j) {
    const Node ray = node(k, j * along + (upper ? (n_ - 1) * step : 0));
    const Node other = node(k, j * along + (upper ? (n_ - 2) * step : step));
    if (!ray.found || !other.found) continue;
    const double way = side - ray.at[in], gap = other.at[in] - ray.at[in];
    const double slope = ray.slope[in] + way * (other.slope[in] - ray.slope[in]) / gap;
    const double pressure = ray.pressure + 0.5 * way * (ray.slope[in] + slope);
    a_.sample.push_back({ray.at[out], pressure, ray.slope[out] + way * (other.slope[out] - ray.slope[out]) / gap});
    if (pressure > 0.0) return;  // looked at otherwise
    steepest = std::max(steepest, std::abs(a_.sample.back().slope));
    fall = std::max(fall, std::abs(slope));
  }
  if (a_.sample.size() < 2) return;
  predict_roots(a_.sample, a_.sample.front().place, a_.sample.back().place, a_.root);
  for (std::size_t i = 0; i + 1 < a_.root.size(); i += 2) {
    // A cap as parabolas have it.
    const double chord = a_.root[i + 1].guess - a_.root[i].guess, height = 0.25 * chord * steepest;
    const double area = 2.0 / 3.0 * chord * std::min(height / fall, (1.0 - gauss_.node.back()) * width_of(panel, in));
    panel.missed_area += area;
    panel.missed_load += 0.4 * height * area;
    if (area <= most) continue;
    most = area;
    part(panel, in, upper ? low_of(panel, in) + gauss_.node.back() * width_of(panel, in) : low_of(panel, in) + gauss_.node.front() * width_of(panel, in));
  }
}

/// What may press between nodes that do not: where the pressure is concave along Sigma, it lies below all its tangents.
void Pass::look_between(Panel& panel, std::size_t k, double most) const {
  double below = kInfinity, least = 0.0;
  const Plane middle{low_of(panel, 0) + 0.5 * width_of(panel, 0), low_of(panel, 1) + 0.5 * width_of(panel, 1)};
  for (std::size_t i = 0; i < n_ * n_; ++i) {
    const Node ray = node(k, i);
    below = std::min(below, ray.pressure + ray.slope[0] * (middle[0] - ray.at[0]) + ray.slope[1] * (middle[1] - ray.at[1]));
    least = std::min(least, ray.pressure);
  }
  if (!(below > 0.0)) return;
  const double area = width_of(panel, 0) * width_of(panel, 1) * below / (below - least);
  if (area > most) part_longer(s_.chart, panel);
  panel.missed_area += area;
  panel.missed_load += below * area / 3.0;
}

/// Where a third body begins and ceases to press harder between two lines, as its values across them tell.
/// @param row  of the level's value at the first ray of the lattice   @param stride  to that at the next
void Pass::look_across(std::size_t k, std::size_t row, std::size_t stride) {
  const Panel& panel = panels_[which_[k]];
  const std::size_t in = panel.inner, out = 1 - in, along = in == 0 ? 1 : n_, step = out == 0 ? 1 : n_;
  for (std::size_t i = 0; i < n_; ++i) {
    a_.sample.clear();
    a_.root.clear();
    double most = 0.0;  // pressure
    for (std::size_t j = 0; j < n_; ++j) {
      const std::size_t index = i * along + j * step;
      const SigmaRay& ray = a_.ray[k * n_ * n_ + index];
      const LevelValue& value = a_.value[row + index * stride];
      most = std::max(most, ray.pressure);
      if (ray.found) a_.sample.push_back({ray.place[out], value.value, value.slope[out]});
    }
    if (a_.sample.size() < 2 || !(most > 0.0)) continue;
    (void)predict_roots(a_.sample, a_.sample.front().place, a_.sample.back().place, a_.root);
    for (std::size_t r = 0; r + 1 < a_.root.size(); ++r) {
      if (!a_.root[r].open_high || !a_.root[r + 1].open_low) continue;
      const double area = gauss_.weight[i] * width_of(panel, in) * (a_.root[r + 1].guess - a_.root[r].guess);
      hide(k, area, most * area, a_.root[r].guess);
    }
  }
}

void Pass::hide(std::size_t k, double area, double load, double place) {
  PanelArena::Hidden& hidden = a_.hidden[k];
  hidden.area += area;
  hidden.load += load;
  if (area <= hidden.most) return;
  hidden.most = area;
  hidden.place = place;
}

/// A level along a line of the lattice, or along the side of the panel beside the outermost one, as parabolas across have it; to `sample`.
void Pass::sample_beside(std::size_t k, bool upper, bool side, std::size_t row, std::size_t stride) {
  const Panel& panel = panels_[which_[k]];
  const std::size_t in = panel.inner, out = 1 - in, along = in == 0 ? 1 : n_, step = out == 0 ? 1 : n_;
  const double to = low_of(panel, out) + (upper ? width_of(panel, out) : 0.0);
  a_.sample.clear();
  for (std::size_t i = 0; i < n_; ++i) {
    const std::size_t index = i * along + (upper ? (n_ - 1) * step : 0), next = upper ? index - step : index + step;
    const SigmaRay &ray = a_.ray[k * n_ * n_ + index], &other = a_.ray[k * n_ * n_ + next];
    if (!ray.found || !other.found) continue;
    const LevelValue &here = a_.value[row + index * stride], &there = a_.value[row + next * stride];
    const double way = side ? to - ray.place[out] : 0.0, share = way / (other.place[out] - ray.place[out]);
    const double value = here.value + way * (here.slope[out] + 0.5 * share * (there.slope[out] - here.slope[out]));
    a_.sample.push_back({ray.place[in], value, here.slope[in] + share * (there.slope[in] - here.slope[in])});
  }
}

/// How far a level of `sample` is negative along a line, where the rim is not. @param limit  where the line leaves the patch
double Pass::negative_length(const Panel& panel, double limit) {
  const double begin = low_of(panel, panel.inner), end = begin + width_of(panel, panel.inner);
  a_.root.clear();
  if (a_.sample.empty()) return 0.0;
  bool positive = predict_roots(a_.sample, begin, end, a_.root);
  double length = 0.0, from = begin;
  for (std::size_t r = 0; r <= a_.root.size(); ++r) {
    const double to = std::clamp(r < a_.root.size() ? a_.root[r].guess : end, from, std::max(limit, from));
    if (!positive) length += to - from;
    from = to;
    positive = !positive;
  }
  return length;
}

/// What a third body takes beside the outermost lines in another way than along them.
void Pass::look_beside(std::size_t k, std::size_t rim, std::size_t row, std::size_t stride) {
  const Panel& panel = panels_[which_[k]];
  const std::size_t in = panel.inner, out = 1 - in;
  const double end = low_of(panel, in) + width_of(panel, in);
  double most = 0.0;  // pressure
  for (std::size_t i = 0; i < n_ * n_; ++i) most = std::max(most, a_.ray[k * n_ * n_ + i].pressure);
  if (!(most > 0.0)) return;
  for (const bool upper : {false, true}) {
    std::array<double, 2> length{};  // along the line, along the side
    std::array<std::size_t, 2> roots{};
    for (const bool side : {false, true}) {
      const std::size_t which = side ? 1 : 0;
      sample_beside(k, upper, side, rim, stride);
      a_.root.clear();
      if (a_.sample.empty()) return;
      (void)predict_roots(a_.sample, low_of(panel, in), end, a_.root);
      const auto falls = std::find_if(a_.root.begin(), a_.root.end(), [](const LevelRoot& root) { return !root.rises; });
      const double limit = falls != a_.root.end() ? falls->guess : end;
      sample_beside(k, upper, side, row, stride);
      length[which] = negative_length(panel, limit);
      roots[which] = static_cast<std::size_t>(std::count_if(a_.root.begin(), a_.root.end(), [limit](const LevelRoot& root) { return root.guess < limit; }));
    }
    if (roots[0] == roots[1] && (length[0] > 0.0) == (length[1] > 0.0)) continue;
    const double way = upper ? (1.0 - gauss_.node.back()) * width_of(panel, out) : gauss_.node.front() * width_of(panel, out);
    const double area = 0.5 * way * std::abs(length[1] - length[0]);
    hide(k, area, most * area, low_of(panel, out) + (upper ? width_of(panel, out) - way : way));
  }
}

/// What the panel may hold that no line tells, and where it would be split: at the worst corner, else in the middle of what is roughest.
/// @param rough  what the highest polynomials hold of the load, along lines and across them
void Pass::judge_panel(std::size_t k, const Plane& rough) {
  Panel& panel = panels_[which_[k]];
  const PanelArena::Hidden& hidden = a_.hidden[k];
  const std::size_t out = 1 - panel.inner;
  panel.missed_area = hidden.area;
  panel.missed_load = hidden.load;
  double most = hidden.most;
  if (most > 0.0) part(panel, out, hidden.place);
  const bool told = s_.chart.star() && judge_slots(k, most);
  if (!told) judge_sides(k, most);
  if (panel.points.size() > 0 && !(most > 0.0)) part_middle(panel, rough[0] >= rough[1] ? panel.inner : out);
  if (!told && panel.points.size() > 0) judge_corners(k, most);
}

/// Where the patch goes on beyond the panel: at the ends of lines that a side cuts off, and between what the ends of the outermost lines drift to.
void Pass::note_crossings(const Panel& panel) {
  const std::size_t in = panel.inner, out = 1 - in;
  const auto add = [&](double along, double across, double width, std::size_t beyond, bool upper) {
    Plane place{};
    place[in] = along;
    place[out] = across;
    a_.crossing.push_back({place, width, static_cast<std::uint8_t>(beyond), upper, panel.nodes});
  };
  for (std::size_t j = 0; j < n_; ++j) {
    const LineShape& line = a_.shape[j];
    for (std::size_t i = 0; i + 1 < line.ends.size(); i += 2) {
      const LineEnd &enters = line.ends[i], &leaves = line.ends[i + 1];
      const double strip = gauss_.weight[j] * width_of(panel, out);
      if (enters.level == LineEnd::kSide) add(enters.place, line.at, strip, in, false);
      if (leaves.level == LineEnd::kSide) add(leaves.place, line.at, strip, in, true);
      for (const bool upper : {false, true}) {
        if (j != (upper ? n_ - 1 : 0)) continue;
        const double side = low_of(panel, out) + (upper ? width_of(panel, out) : 0.0), way = side - line.at;
        const double from = enters.place + way * enters.drift, to = leaves.place + way * leaves.drift;
        if (to > from) add(0.5 * (from + to), side, to - from, out, upper);
      }
    }
  }
}

/// Where lines do not say what lies beside them: the nodes of the lattice do.
void Pass::judge_sides(std::size_t k, double& most) {
  Panel& panel = panels_[which_[k]];
  for (const bool upper : {false, true}) {
    look_aside(panel, k, panel.inner, upper, most);
    if (!(upper ? a_.shape.back() : a_.shape.front()).ends.empty()) continue;
    look_beyond(panel, k, upper, most);
    look_aside(panel, k, 1 - panel.inner, upper, most);
  }
  if (panel.points.size() == 0) look_between(panel, k, most);
}

/// Corners between lines that are not cut alike, and beside the outermost ones.
void Pass::judge_corners(std::size_t k, double& most) {
  Panel& panel = panels_[which_[k]];
  const std::size_t out = 1 - panel.inner;
  const double low = low_of(panel, panel.inner), high = low + width_of(panel, panel.inner);
  for (std::size_t j = 0; j <= n_; ++j) {
    const double side = low_of(panel, out) + (j == 0 ? 0.0 : width_of(panel, out));
    const std::optional<PanelCorner> corner =
        j == 0 || j == n_ ? corner_beyond(a_.shape[j == 0 ? 0 : j - 1], side, low, high) : corner_between(a_.shape[j - 1], a_.shape[j], low, high);
    if (corner) add_corner(panel, *corner, most);
  }
}

void Pass::add_corner(Panel& panel, const PanelCorner& corner, double& most) const {
  constexpr double kLeastShare = 1e-3;  // of the panel, beside a corner
  const std::size_t out = 1 - panel.inner;
  panel.missed_area += corner.area;
  panel.missed_load += corner.load;
  const double share = (corner.at - low_of(panel, out)) / width_of(panel, out);
  if (corner.area <= most || share < kLeastShare || share > 1.0 - kLeastShare) return;
  most = corner.area;
  part(panel, out, corner.at);
}

/// Corners where all lines meet the patch between the same two levels, or miss it by what these are apart: that is a smooth function of the line.
/// @return whether they do
bool Pass::judge_slots(std::size_t k, double& most) {
  Panel& panel = panels_[which_[k]];
  a_.slot.clear();
  a_.sample.clear();
  a_.root.clear();
  for (const LineShape& line : a_.shape) {
    if (line.ends.size() == 2) {
      a_.slot.push_back({line.ends[0].level, line.ends[1].level, line.ends[1].place - line.ends[0].place, line.ends[1].drift - line.ends[0].drift});
    } else if (line.ends.empty() && line.missed) {
      a_.slot.push_back(*line.missed);
    } else {
      return false;
    }
    if (a_.slot.back().enters != a_.slot.front().enters || a_.slot.back().leaves != a_.slot.front().leaves) return false;
    a_.sample.push_back({line.at, a_.slot.back().length, a_.slot.back().drift});
  }
  const std::size_t out = 1 - panel.inner;
  const double low = low_of(panel, out), high = low + width_of(panel, out);
  (void)predict_roots(a_.sample, low, high, a_.root);
  double steepest = 0.0;  // of the pressure, along lines
  for (std::size_t i = 0; i < n_ * n_; ++i) steepest = std::max(steepest, std::abs(s_.chart.slopes(a_.ray[k * n_ * n_ + i].place, a_.ray[k * n_ * n_ + i].slope)[panel.inner]));
  for (std::size_t r = 0; r < a_.root.size(); ++r) {
    const double at = a_.root[r].guess;
    std::size_t j = 0;
    while (j < n_ && a_.sample[j].place < at) ++j;
    const LineSlot& near = a_.slot[j < n_ ? j : n_ - 1];
    if (j > 0 && j < n_ && (a_.slot[j - 1].length > 0.0) != (a_.slot[j].length > 0.0)) {
      const LineShape &one = a_.shape[j - 1], &other = a_.shape[j];
      const double gap = other.at - one.at;
      add_corner(panel, {at, kOfRectangle * gap * std::abs(other.area - one.area), kOfRectangle * gap * std::abs(other.load - one.load)}, most);
      continue;
    }
    // A tip that no line meets, or that a line has too much of.
    const double rest = j == 0 ? at - low : j == n_ ? high - at : r + 1 < a_.root.size() ? a_.root[r + 1].guess - at : 0.0;
    const double wide = rest * std::abs(near.drift), area = 0.5 * rest * wide;
    add_corner(panel, {at, area, area * steepest * wide / 3.0}, most);
    if (j > 0 && j < n_) ++r;
  }
  return true;
}

}  // namespace supple::collision::panel_pass
