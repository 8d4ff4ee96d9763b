#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "numbers.h"
#include "surface/accuracy.h"
#include "surface/panels/panel_pass.h"

namespace supple::collision {
namespace panel_pass {
namespace {

/// Polynomials of the two highest degrees above 1 that n Gauss points tell apart, the second one zero where there is but one: times the weights, orthonormal
/// on (0, 1). Two, as functions may be even or odd.
using HighestPolynomials = std::array<std::vector<double>, 2>;

HighestPolynomials make_highest(int n) {
  const GaussRule& rule = gauss_rule(n);
  HighestPolynomials highest;
  for (std::size_t i = 0; i < rule.node.size(); ++i) {
    const double x = 2.0 * rule.node[i] - 1.0;
    double p = 1.0, before = 0.0;
    for (int degree = 1; degree < n; ++degree) {
      const double next = ((2.0 * degree - 1.0) * x * p - (degree - 1.0) * before) / degree;
      before = p;
      p = next;
    }
    highest[0].push_back(std::sqrt(2.0 * n - 1.0) * p * rule.weight[i]);
    highest[1].push_back(n > 3 ? std::sqrt(2.0 * n - 3.0) * before * rule.weight[i] : 0.0);
  }
  return highest;
}

const HighestPolynomials& highest_polynomials(int n) {
  constexpr int kMost = 16;
  static const std::vector<HighestPolynomials> all = [] {
    std::vector<HighestPolynomials> rules(1);
    for (int k = 1; k <= kMost; ++k) rules.push_back(make_highest(k));
    return rules;
  }();
  return all[static_cast<std::size_t>(n)];
}

}  // namespace

/// Values of the levels of `query`, with their derivatives by the panel's coordinates.
void Pass::evaluate(std::span<const SigmaRay> rays) {
  a_.value.resize(a_.query.size());
  evaluate_levels(s_.levels, s_.view, rays, a_.query, a_.levels, a_.value);
  for (std::size_t i = 0; i < a_.query.size(); ++i) a_.value[i].slope = s_.chart.slopes(rays[a_.query[i].ray].place, a_.value[i].slope);
}

void Pass::place_lattice() {
  a_.ray.clear();
  for (const std::uint32_t p : which_) {
    const Panel& panel = panels_[p];
    const Slice near = panel.nodes.size() > 0 ? panel.nodes : panel.guess;
    for (std::size_t j = 0; j < n_; ++j) {
      for (std::size_t i = 0; i < n_; ++i) {
        a_.ray.push_back(start_ray(panel, lattice_place(panel, i, j), std::span(a_.node).subspan(near.begin, near.size())));
      }
    }
  }
  bracket_between_walls();
  lift(s_.view, a_.ray, s_.enough, a_.rays);
}

/// Whether Sigma is a graph, and how lines should run.
void Pass::look_at_lattice() {
  for (std::size_t k = 0; k < which_.size(); ++k) {
    Panel& panel = panels_[which_[k]];
    const std::span<const SigmaRay> rays = std::span(a_.ray).subspan(k * n_ * n_, n_ * n_);
    Plane change{};
    panel.steep = false;
    for (const SigmaRay& ray : rays) {
      if (!ray.found) continue;
      const bool inside = !panel.walls || (ray.height > panel.low[panel.along] && ray.height < panel.high[panel.along]);
      // A foot between walls that the signs at these do not tell has another one beside it.
      const bool more = panel.walls && !ray.bracketed;
      if (ray.pressure > 0.0 && inside) panel.steep = panel.steep || ray.cosine < kRayCosine || more;
      const Plane slope = s_.chart.slopes(ray.place, ray.slope);
      for (const std::size_t c : {0u, 1u}) change[c] += std::abs(slope[c]) * width_of(panel, c);
    }
    panel.inner = !s_.chart.star() && change[0] >= change[1] ? 0 : 1;
    part_longer(s_.chart, panel);
    panel.nodes = {static_cast<std::uint32_t>(a_.node.size()), static_cast<std::uint32_t>(a_.node.size() + rays.size())};
    a_.node.insert(a_.node.end(), rays.begin(), rays.end());
  }
}

/// Rays of cells with walls: where p_A - p_B has different signs at these, the foot is sought between them.
void Pass::bracket_between_walls() {
  std::vector<std::uint32_t>& open = a_.open;
  PressureBatch& batch = a_.rays.batch;
  open.clear();
  for (std::size_t k = 0; k < which_.size(); ++k) {
    if (!panels_[which_[k]].walls) continue;
    for (std::size_t i = 0; i < n_ * n_; ++i) open.push_back(static_cast<std::uint32_t>(k * n_ * n_ + i));
  }
  if (open.empty()) return;
  batch.resize(2 * open.size());
  const auto walls_of = [&](std::uint32_t i) {
    const Panel& panel = panels_[which_[i / (n_ * n_)]];
    return Plane{panel.low[panel.along], panel.high[panel.along]};
  };
  for (std::size_t n = 0; n < open.size(); ++n) {
    const Plane walls = walls_of(open[n]);
    for (const std::size_t side : {0u, 1u}) batch.point[2 * n + side] = s_.view.frame.world(a_.ray[open[n]].local(walls[side]));
  }
  s_.view.pressure.evaluate_values(batch);
  for (std::size_t n = 0; n < open.size(); ++n) {
    SigmaRay& ray = a_.ray[open[n]];
    const double sense = ray.sense();
    const bool above_low = sense * (batch.a[2 * n] - batch.b[2 * n]) > 0.0, below_high = sense * (batch.a[2 * n + 1] - batch.b[2 * n + 1]) < 0.0;
    if (!above_low || !below_high) continue;
    const Plane walls = walls_of(open[n]);
    ray.low = walls[0];
    ray.high = walls[1];
    ray.low_seen = ray.high_seen = ray.bracketed = true;
    ray.height = std::clamp(ray.height, walls[0], walls[1]);
  }
}

void Pass::make_lines() {
  a_.line.clear();
  for (std::size_t k = 0; k < which_.size(); ++k) {
    const Panel& panel = panels_[which_[k]];
    const std::size_t in = panel.inner, out = 1 - in;
    const auto base = static_cast<std::uint32_t>(k * n_ * n_);
    for (std::size_t j = 0; j < n_; ++j) {
      PanelArena::Line line{};
      line.panel = which_[k];
      line.base[out] = low_of(panel, out) + gauss_.node[j] * width_of(panel, out);
      line.begin = low_of(panel, in);
      line.end = line.begin + width_of(panel, in);
      line.weight = gauss_.weight[j] * width_of(panel, out);
      line.first = base + static_cast<std::uint32_t>(in == 0 ? j * n_ : j);
      line.stride = static_cast<std::uint32_t>(in == 0 ? 1 : n_);
      a_.line.push_back(line);
    }
  }
}

/// What is known of a level along a line, to `sample`.
/// @param row  of its value at the first ray of the lattice   @param stride  to that at the next   @param end  what it is where the line leaves the patch
void Pass::sample_line(std::uint32_t index, std::uint16_t level, std::size_t row, std::size_t stride, const std::optional<LevelSample>& end) {
  const PanelArena::Line& line = a_.line[index];
  const std::size_t lattice = (index / n_) * n_ * n_, inner = panels_[line.panel].inner;
  a_.sample.clear();
  for (std::size_t i = 0; i < n_; ++i) {
    const SigmaRay& ray = a_.ray[line.first + i * line.stride];
    if (!ray.found && level != Levels::kRim) continue;  // there is nothing to be cut
    const LevelValue& value = a_.value[row + (line.first + i * line.stride - lattice) * stride];
    if (end && !(ray.place[inner] < end->place)) break;
    a_.sample.push_back({ray.place[inner], value.value, value.slope[inner]});
  }
  if (end) a_.sample.push_back(*end);
  for (const PanelArena::Turn& turn : a_.turn) {
    if (turn.line != index || turn.level != level || (end && !(turn.sample.place < end->place))) continue;
    const auto after = std::find_if(a_.sample.begin(), a_.sample.end(), [&](const LevelSample& sample) { return sample.place > turn.sample.place; });
    a_.sample.insert(after, turn.sample);
  }
}

void Pass::predict_line(std::uint32_t index, std::uint16_t level, std::size_t row, std::size_t stride, const std::optional<LevelSample>& end) {
  PanelArena::Line& line = a_.line[index];
  sample_line(index, level, row, stride, end);
  if (a_.sample.empty()) return;
  a_.root.clear();
  const bool positive = predict_roots(a_.sample, line.begin, end ? end->place : line.end, a_.root);
  const bool inside = a_.sample.front().value > 0.0;
  for (const LevelRoot& root : a_.root) a_.search.push_back({index, level, root, root.guess, 0.0, inside, false});
  if (a_.root.empty() && !positive && !s_.levels.is_kink(level)) line.dead = true;
  const bool harder = std::any_of(a_.sample.begin(), a_.sample.end(), [](const LevelSample& sample) { return !(sample.value > 0.0); });
  if (s_.levels.is_third(level) && harder) panels_[line.panel].thirds |= third_bit(level - Levels::kFirstThird);
}

/// What bounds the patch most at the rays of the lattice. Walls count as the pressures of both bodies change on the way to them.
void Pass::find_least() {
  a_.least.assign(a_.ray.size(), {kInfinity, {}});
  for (std::size_t i = 0; i < a_.query.size(); ++i) {
    const LevelQuery& query = a_.query[i];
    if (s_.levels.is_kink(query.level)) continue;
    const SigmaRay& ray = a_.ray[query.ray];
    const bool wall = query.level == Levels::kLowWall || query.level == Levels::kHighWall;
    const double scale = wall ? ray.fall[0] + ray.fall[1] : 1.0;
    const LevelValue& value = a_.value[i];
    if (scale * value.value < a_.least[query.ray].value) a_.least[query.ray] = {scale * value.value, {scale * value.slope[0], scale * value.slope[1]}};
  }
}

/// Where levels change their sign along the lines, as the lattice tells.
void Pass::predict() {
  a_.query.clear();
  for (std::size_t k = 0; k < which_.size(); ++k) {
    const Panel& panel = panels_[which_[k]];
    const double low = panel.low[panel.along], high = panel.high[panel.along];
    for (std::size_t i = 0; i < n_ * n_; ++i) {
      for (std::uint32_t l = panel.levels.begin; l < panel.levels.end; ++l) {
        a_.query.push_back({static_cast<std::uint32_t>(k * n_ * n_ + i), a_.level[l], {low, high}});
      }
    }
  }
  evaluate(a_.ray);
  a_.search.clear();
  a_.hidden.assign(which_.size(), {});
  find_least();
  a_.rim.clear();
  a_.rim_search.clear();
  a_.turn.clear();
  if (s_.chart.star()) {
    predict_all(true);
    meet_rims();
  }
  look_at_turns();
  predict_all(false);
}

/// @param rims  those alone
void Pass::predict_all(bool rims) {
  std::size_t begin = 0;
  for (std::size_t k = 0; k < which_.size(); ++k) {
    const Panel& panel = panels_[which_[k]];
    const std::size_t count = panel.levels.size();
    for (std::size_t j = 0; j < n_; ++j) {
      const auto index = static_cast<std::uint32_t>(k * n_ + j);
      const PanelArena::Line& line = a_.line[index];
      for (std::size_t l = 0; l < count && !line.dead; ++l) {
        const std::uint16_t level = a_.level[panel.levels.begin + l];
        if (s_.chart.star() && (level == Levels::kRim) != rims) continue;
        predict_line(index, level, begin + l, count, at_rim(index, l));
      }
    }
    for (std::size_t l = 0; l < count && !rims; ++l) {
      if (!s_.levels.is_third(a_.level[panel.levels.begin + l])) continue;
      look_across(k, begin + l, count);
      look_beside(k, begin, begin + l, count);
    }
    begin += n_ * n_ * count;
  }
  std::erase_if(a_.search, [this](const PanelArena::Search& search) { return a_.line[search.line].dead; });
}

/// What an evaluation at the place of a search says. @return whether to go on
bool Pass::judge(PanelArena::Search& search, const LevelValue& value, const SigmaRay& ray) {
  const PanelArena::Line& line = a_.line[search.line];
  LevelRoot& root = search.root;
  const double enough = s_.enough_rim * (line.end - line.begin);
  const bool near = std::abs(ray.step) <= s_.enough;
  if (ray.found && std::abs(ray.step) > s_.view.reach) return true;  // the foot first
  const bool beyond = (value.value > 0.0) == root.rises;
  (beyond ? root.high : root.low) = search.place;
  (beyond ? root.open_high : root.open_low) = false;
  const std::size_t inner = panels_[line.panel].inner;
  const double slope = value.slope[inner];
  search.drift = slope != 0.0 ? -value.slope[1 - inner] / slope : 0.0;
  double next = search.place - value.value / slope;
  if (!(next > root.low && next < root.high)) {
    const bool lower = slope != 0.0 && std::isfinite(next) ? next <= root.low : beyond;
    next = lower ? (root.open_low ? root.low : 0.5 * (root.low + root.high)) : (root.open_high ? root.high : 0.5 * (root.low + root.high));
  }
  const double move = std::abs(next - search.place);
  search.place = next;
  if (root.high - root.low <= 1e-3 * enough) {
    search.found = !root.open_low && !root.open_high;
    return false;
  }
  search.found = near && move <= enough;
  return !search.found;
}

/// Newton's method along lines and rays at once, within brackets.
void Pass::search() {
  a_.cut_ray.clear();
  a_.open.clear();
  for (std::size_t i = 0; i < a_.search.size(); ++i) {
    const PanelArena::Search& search = a_.search[i];
    const PanelArena::Line& line = a_.line[search.line];
    Plane at = line.base;
    at[panels_[line.panel].inner] = search.place;
    const Panel& panel = panels_[line.panel];
    a_.cut_ray.push_back(start_ray(panel, at, lattice_of(search.line)));
    a_.open.push_back(static_cast<std::uint32_t>(i));
  }
  for (int step = 0; step < kBracketSteps && !a_.open.empty(); ++step) step_searches();
  for (const std::uint32_t i : a_.open) a_.search[i].found = !a_.search[i].root.open_low && !a_.search[i].root.open_high;
}

void Pass::step_searches() {
  probe(s_.view, a_.cut_ray, a_.open, a_.rays);
  a_.query.clear();
  for (const std::uint32_t i : a_.open) {
    SigmaRay& ray = a_.cut_ray[i];
    ray.found = std::isfinite(ray.step);
    if (ray.found) ray.height += std::clamp(ray.step, -s_.view.reach, s_.view.reach);
    const Panel& panel = panels_[a_.line[a_.search[i].line].panel];
    a_.query.push_back({i, a_.search[i].level, {panel.low[panel.along], panel.high[panel.along]}});
  }
  evaluate(a_.cut_ray);
  std::size_t kept = 0;
  for (std::size_t n = 0; n < a_.open.size(); ++n) {
    const std::uint32_t i = a_.open[n];
    PanelArena::Search& search = a_.search[i];
    if (!judge(search, a_.value[n], a_.cut_ray[i])) continue;
    SigmaRay& ray = a_.cut_ray[i];
    const std::size_t inner = panels_[a_.line[search.line].panel].inner;
    const Plane from = ray.at;
    ray.place[inner] = search.place;
    ray.at = s_.chart.at(ray.place);
    if (ray.found) ray.height += (ray.at[0] - from[0]) * ray.rise[0] + (ray.at[1] - from[1]) * ray.rise[1];
    a_.open[kept++] = i;
  }
  a_.open.resize(kept);
}

void Pass::add_piece(std::uint32_t index, double begin, double end) {
  const PanelArena::Line& line = a_.line[index];
  const Panel& panel = panels_[line.panel];
  constexpr double kNothing = 1e-12;
  if (!(end - begin > kNothing * (line.end - line.begin))) return;
  a_.piece.push_back({index, static_cast<std::uint32_t>(a_.cut_ray.size()), 1, begin, end, false});
  const std::span<const SigmaRay> near = lattice_of(index);
  for (std::size_t i = 0; i < n_; ++i) {
    Plane at = line.base;
    at[panel.inner] = begin + gauss_.node[i] * (end - begin);
    a_.cut_ray.push_back(start_ray(panel, at, near));
  }
}

/// The pieces of a line between its roots on which no level is negative.
void Pass::cut_line(std::uint32_t index) {
  PanelArena::Line& line = a_.line[index];
  const Panel& panel = panels_[line.panel];
  const auto event_of = [this](const auto& event) -> const PanelArena::Search& { return a_.search[event.second]; };
  // Levels that are negative where the line begins: those whose first root rises.
  std::size_t negative = 0;
  for (std::uint32_t l = panel.levels.begin; l < panel.levels.end; ++l) {
    const std::uint16_t level = a_.level[l];
    if (s_.levels.is_kink(level)) continue;
    const auto first = std::find_if(a_.event.begin(), a_.event.end(), [&](const auto& event) { return event_of(event).level == level; });
    if (first != a_.event.end()) negative += event_of(*first).root.rises ? 1 : 0;
  }
  double begin = line.begin;
  bool ended = false;  // of a star: what presses beyond its rim is another patch
  const PanelArena::Search* second = nullptr;  // where a second level became negative
  if (negative == 0) a_.end.push_back({LineEnd::kSide, line.begin, 0.0});
  for (const auto& event : a_.event) {
    const PanelArena::Search& search = event_of(event);
    const double end = std::clamp(event.first, begin, line.end);
    if (negative == 0 && !ended) add_piece(index, begin, end);
    begin = end;
    if (s_.levels.is_kink(search.level)) continue;
    const std::size_t before = negative;
    if (!search.root.rises) ++negative;
    if (search.root.rises && negative > 0) --negative;
    if ((before == 0) != (negative == 0) && !ended) a_.end.push_back({search.level, end, search.drift});
    if (before == 1 && negative == 2) second = &search;
    if (before == 2 && negative == 1 && second != nullptr && second->level != search.level) {
      const LineSlot slot{search.level, second->level, second->place - search.place, second->drift - search.drift};
      if (!line.missed || slot.length > line.missed->length) line.missed = slot;
    }
    ended = ended || (s_.chart.star() && search.level == Levels::kRim && !search.root.rises);
  }
  if (!line.missed && index < a_.rim.size() && a_.rim[index].taken) line.missed = a_.rim[index].missed;
  if (negative > 0 || ended) return;
  add_piece(index, begin, line.end);
  a_.end.push_back({LineEnd::kSide, line.end, 0.0});
}

void Pass::make_pieces() {
  join_rims();
  a_.piece.clear();
  a_.cut_ray.clear();
  a_.end.clear();
  auto next = a_.search.begin();
  for (std::uint32_t i = 0; i < a_.line.size(); ++i) {
    PanelArena::Line& line = a_.line[i];
    line.ends.begin = line.ends.end = static_cast<std::uint32_t>(a_.end.size());
    a_.event.clear();
    bool dead = line.dead;
    while (next != a_.search.end() && next->line == i) {
      const auto begin = next;
      bool any = false;
      for (; next != a_.search.end() && next->line == i && next->level == begin->level; ++next) {
        if (next->found) a_.event.emplace_back(next->place, static_cast<std::uint32_t>(next - a_.search.begin()));
        if (next->found && s_.levels.is_third(next->level)) panels_[line.panel].thirds |= third_bit(next->level - Levels::kFirstThird);
        any = any || next->found;
      }
      // Roots that there are not: all along the line it is what it is inside.
      dead = dead || (!any && !begin->inside && !s_.levels.is_kink(begin->level));
    }
    if (dead) {
      if (i < a_.rim.size() && a_.rim[i].taken) line.missed = a_.rim[i].missed;
      continue;
    }
    if (a_.event.empty()) {
      if (!a_.ray[line.first].found) continue;
      a_.piece.push_back({i, line.first, line.stride, line.begin, line.end, true});
      a_.end.insert(a_.end.end(), {{LineEnd::kSide, line.begin, 0.0}, {LineEnd::kSide, line.end, 0.0}});
    } else {
      std::sort(a_.event.begin(), a_.event.end());
      cut_line(i);
    }
    line.ends.end = static_cast<std::uint32_t>(a_.end.size());
  }
  lift(s_.view, a_.cut_ray, s_.enough, a_.rays);
}

/// What flows out of a body's apex through a place of Sigma, of a pressure that falls evenly to where the body ends; where it hardly falls, or rises first, of one that
/// ends within the body's size.
void Pass::add_flux(const Vec3& at, const SigmaRay& ray, double area, PatchSums& sums) const {
  for (const std::size_t side : {0u, 1u}) {
    const std::optional<Apex>& apex = s_.apex[side];
    if (!apex || !(ray.pressure > 0.0)) continue;
    const Vec3 way = apex->way(at);
    const double sign = side == 0 ? 1.0 : -1.0, fall = sign * ray.sense() * ray.fall[side];
    double rate = way.dot(s_.view.frame.axis[ray.along]) * fall;  // at which the body's pressure falls along the way
    for (const std::size_t k : {0u, 1u}) {
      rate -= way.dot(s_.view.frame.axis[static_cast<std::size_t>(k == 0 ? first_across(ray.along) : second_across(ray.along))]) * (ray.slope[k] + fall * ray.rise[k]);
    }
    const double slowest = ray.pressure / s_.longest[side];
    rate = slowest + 0.5 * (rate + std::hypot(rate, slowest));
    if (!(rate > 0.0)) continue;
    const double length = ray.pressure / rate, wide = length / apex->distance(at);
    sums.flux[side] += area * sign * ray.normal.dot(way) * ray.pressure * length * (0.5 + wide * (1.0 / 3.0 + wide / 12.0));
  }
}

/// @return what the highest polynomials along the piece hold of the load
double Pass::add_points(const PanelArena::Piece& piece, Panel& panel, PatchSums& sums, bool first) {
  const PanelArena::Line& line = a_.line[piece.line];
  const HighestPolynomials& highest = highest_polynomials(order_);
  const std::vector<SigmaRay>& rays = piece.lattice ? a_.ray : a_.cut_ray;
  const double length = piece.end - piece.begin;
  Plane rough{};
  for (std::size_t i = 0; i < n_; ++i) {
    const SigmaRay& ray = rays[piece.first + i * piece.stride];
    if (!ray.found || !(ray.cosine > 0.0)) continue;
    if (ray.pressure > 0.0 && ray.cosine < kRayCosine) panel.steep = true;
    const double pressure = std::max(ray.pressure, 0.0), stretch = line.weight * length * s_.chart.stretch(ray.place) / ray.cosine, area = stretch * gauss_.weight[i];
    const Vec3 at = s_.view.frame.world(ray.local(ray.height));
    sums.add(at - s_.reference, ray.normal, area, pressure);
    for (const std::size_t d : {0u, 1u}) rough[d] += stretch * highest[d][i] * pressure;
    add_flux(at, ray, area, sums);
    if (first) a_.point.push_back({at, ray.normal, area, pressure, ray.mismatch, ray.fall, ray.cosine});
  }
  return std::abs(rough[0]) + std::abs(rough[1]);
}

void Pass::add_up(bool first) {
  const HighestPolynomials& highest = highest_polynomials(order_);
  auto piece = a_.piece.begin();
  for (std::size_t k = 0; k < which_.size(); ++k) {
    Panel& panel = panels_[which_[k]];
    PatchSums sums;
    double along = 0.0;
    Plane across{};
    if (first) panel.points.begin = static_cast<std::uint32_t>(a_.point.size());
    a_.shape.clear();
    for (std::size_t j = 0; j < n_; ++j) {
      const auto index = static_cast<std::uint32_t>(k * n_ + j);
      const PanelArena::Line& line = a_.line[index];
      PatchSums of_line;
      for (; piece != a_.piece.end() && piece->line == index; ++piece) along += add_points(*piece, panel, of_line, first);
      for (const std::size_t d : {0u, 1u}) across[d] += of_line.load / gauss_.weight[j] * highest[d][j];
      sums.add(of_line);
      const double width = line.weight * stretch_of(panel);
      a_.shape.push_back({line.base[1 - panel.inner], of_line.area / width, of_line.load / width, std::span<const LineEnd>(a_.end).subspan(line.ends.begin, line.ends.size()), line.missed});
      panel.open = panel.open || (s_.chart.star() && panel.high[1] >= 1.0 && line.ends.size() > 0 && a_.end[line.ends.end - 1].level == LineEnd::kSide);
    }
    if (!first) {
      panel.off.add(sums, -1.0);
      continue;
    }
    panel.points.end = static_cast<std::uint32_t>(a_.point.size());
    panel.sums = panel.off = sums;
    judge_panel(k, {along, std::abs(across[0]) + std::abs(across[1])});
    if (!s_.chart.star() && !panel.walls) note_crossings(panel);
    panel.missed_area *= stretch_of(panel);
    panel.missed_load *= stretch_of(panel);
  }
}

}  // namespace panel_pass

SigmaRay start_ray(const PlaneChart& chart, const Panel& panel, const PlaneChart::Place& place, std::span<const SigmaRay> near) {
  SigmaRay ray;
  ray.place = place;
  ray.at = chart.at(place);
  const PlaneChart::Place& at = ray.at;
  ray.along = panel.along;
  ray.reverse = panel.reverse;
  const double low = panel.low[panel.along], high = panel.high[panel.along], margin = 0.5 * (high - low);
  ray.low = low - margin;
  ray.high = high + margin;
  ray.height = 0.5 * (low + high);
  double least = kInfinity;
  for (const SigmaRay& other : near) {
    if (!other.found || other.along != panel.along) continue;
    const double du = at[0] - other.at[0], dv = at[1] - other.at[1], square = du * du + dv * dv;
    if (square >= least) continue;
    least = square;
    ray.height = std::clamp(other.height + du * other.rise[0] + dv * other.rise[1], ray.low, ray.high);
  }
  return ray;
}

void part_longer(const PlaneChart& chart, Panel& panel) {
  using panel_pass::low_of, panel_pass::width_of;
  const panel_pass::Plane middle{low_of(panel, 0) + 0.5 * width_of(panel, 0), low_of(panel, 1) + 0.5 * width_of(panel, 1)};
  const panel_pass::Plane u = chart.slopes(middle, {1.0, 0.0}), v = chart.slopes(middle, {0.0, 1.0});
  const bool first = width_of(panel, 0) * std::hypot(u[0], v[0]) >= width_of(panel, 1) * std::hypot(u[1], v[1]);
  panel_pass::part_middle(panel, first ? 0 : 1);
}

void measure_panels(PanelSetting& setting, std::span<Panel> panels, std::span<const std::uint32_t> which, PanelArena& arena) {
  std::vector<std::uint32_t>& rest = arena.compared;
  for (const int order : {setting.order, setting.order - 1}) {
    const bool first = order == setting.order;
    if (!first) {
      // Where there is nothing, and nothing beside it, one look is enough.
      rest.clear();
      for (const std::uint32_t p : which) {
        if (panels[p].points.size() > 0 || panels[p].missed_load > 0.0) rest.push_back(p);
      }
      which = rest;
    }
    panel_pass::Pass pass(setting, panels, which, order, arena);
    pass.place_lattice();
    if (first) pass.look_at_lattice();
    pass.make_lines();
    pass.predict();
    pass.search();
    pass.make_pieces();
    pass.add_up(first);
  }
}

}  // namespace supple::collision
