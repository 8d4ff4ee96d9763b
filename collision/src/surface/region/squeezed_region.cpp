#include "surface/region/squeezed_region.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pairs/boxes.h"
#include "supple/core/error.h"
#include "surface/accuracy.h"
#include "surface/quadrature.h"

namespace supple::collision {
namespace {

constexpr int kAcross = 3;                // Gauss points of a cell, each way
constexpr double kPlacesInFeature = 8.0;  // on a column, to see the pieces of the region
constexpr double kCellsInFeature = 2.0;   // each way, to see all of it
constexpr double kFewestPlaces = 16.0, kMostPlaces = 512.0, kFewestCells = 4.0, kMostCells = 32.0;
// What is smaller than a cell or than what lies between two places is a small share of the region: over the error, and over its root.
constexpr double kPlacesOfError = 0.64, kCellsOfError = 0.5;
constexpr double kRough = 1e-2;  // error from which on fewer Gauss points along a piece of a column are enough
constexpr int kAlong = 8, kAlongRough = 4;  // these points
constexpr double kFine = 1e-4;  // error below which there may be more cells, and pieces are half as long
constexpr std::size_t kMostLeaves = 4096, kMostFineLeaves = 16384;
constexpr double kMostParts = 64.0;  // of a piece of a column: overlaps may be 1e12 times as long as the smallest feature
constexpr std::size_t kMostPoints = std::size_t{1} << 22;  // after which cells are halved no more
constexpr double kEndsOfError = 1e-3;   // the same of the ends of columns, off by the square of what the last two values lie apart

}  // namespace

void add_to_region(PairPressure& pressure, int side, std::size_t begin, std::vector<double>& value, PatchPoints& points) {
  points.volume_side.resize(points.volume_point.size(), static_cast<std::uint8_t>(side));
  const auto added = std::span(points.volume_point).subspan(begin);
  value.resize(added.size());
  pressure.evaluate(side, added, value);
  for (std::size_t i = 0; i < added.size(); ++i) {
    points.displaced[side] += points.volume_weight[begin + i];
    points.energy[side] += points.volume_weight[begin + i] * std::max(value[i], 0.0);
  }
}

/// What is positive within the region, one after the other for all places: the own pressure, by how much that of the other body exceeds it, and
/// by how much those of third ones, which of obstacles are held against its own [Pa].
void SqueezedRegion::find_margins(const Lost& lost, std::span<const Vec3> at) {
  const std::size_t n = at.size();
  margin_.resize(margins(lost) * n);
  const auto own = std::span(margin_).first(n), rest = std::span(margin_).subspan(n, n);
  lost.pressure.evaluate(lost.side, at, own);
  lost.pressure.evaluate(1 - lost.side, at, rest);
  if (!lost.third.empty()) {
    const auto spared = std::span(margin_).last(n);
    std::copy(rest.begin(), rest.end(), spared.begin());
    third_.resize(n);
    for (const ContactBody* body : lost.third) {
      // Of obstacles, which are one solid, only the one that presses hardest loses space.
      const std::span<const double> harder = body->fixed && lost.pressure.body(lost.side).fixed ? own : rest;
      body->field.evaluate(at, third_);
      for (std::size_t i = 0; i < n; ++i) spared[i] = std::min(spared[i], harder[i] - body->material.modulus * third_[i]);
    }
  }
  for (std::size_t i = 0; i < n && !lost.equal; ++i) rest[i] -= own[i];
}

/// Where a margin may change its sign twice between places: where a parabola through three of one sign does.
void SqueezedRegion::add_turn(std::size_t column, std::size_t margin, double at, double step, const std::array<double, 3>& value) {
  const double sign = value[1] > 0.0 ? 1.0 : -1.0, before = sign * value[0], here = sign * value[1], after = sign * value[2];
  const double bend = before - 2.0 * here + after, rise = 0.5 * (after - before);
  if (!(before >= here && after >= here && bend > 0.0) || after <= 0.0 || !(here - 0.5 * rise * rise / bend < 0.0)) return;
  turn_.push_back({column, margin, at, at - step * rise / bend, value[1], 0.0});
}

/// The changes on both sides of turns, where the margin has the other sign there indeed.
void SqueezedRegion::find_pairs_of_changes(const Lost& lost, double step) {
  place_.clear();
  for (const Change& turn : turn_) place_.push_back(from_[turn.column] + turn.high * along_);
  find_margins(lost, place_);
  for (std::size_t i = 0; i < turn_.size(); ++i) {
    const auto& [column, margin, at, turns_at, value, unused] = turn_[i];
    const double there = margin_[margin * turn_.size() + i];
    if ((there > 0.0) == (value > 0.0)) continue;
    // The sign at the places around is that at the one between them; a secant needs no more.
    const double low = turns_at < at ? at - step : at;
    change_.push_back({column, margin, low, turns_at, value, there});
    change_.push_back({column, margin, turns_at, low + step, there, value});
  }
  turn_.clear();
}

/// Where margins change their sign along the columns, by halving and a straight line through the last two values. Each by itself: pieces of the region
/// may be thin where what bounds them is not.
void SqueezedRegion::find_changes(const Lost& lost) {
  const double most = std::min(kMostPlaces, std::ceil(kPlacesOfError / lost.error));
  const double places = std::max(std::min(std::ceil(kPlacesInFeature * length_ / feature_), most), kFewestPlaces), step = length_ / places;
  const std::size_t steps = static_cast<std::size_t>(places), row = steps + 1, n = from_.size() * row;
  place_.clear();
  for (const Vec3& x : from_) {
    for (std::size_t k = 0; k < row; ++k) place_.push_back(x + (static_cast<double>(k) * step) * along_);
  }
  find_margins(lost, place_);
  change_.clear();
  positive_.assign(from_.size(), 0);
  for (std::size_t c = 0; c < from_.size(); ++c) {
    for (std::size_t j = 0; j < margins(lost); ++j) {
      const double* const margin = &margin_[j * n + c * row];
      positive_[c] += margin[0] > 0.0 ? 1 : 0;
      for (std::size_t k = 1; k < row; ++k) {
        const double at = static_cast<double>(k) * step;
        if ((margin[k] > 0.0) != (margin[k - 1] > 0.0)) {
          change_.push_back({c, j, at - step, at, margin[k - 1], margin[k]});
        } else if (k + 1 < row) {
          add_turn(c, j, at, step, {margin[k - 1], margin[k], margin[k + 1]});
        }
      }
    }
  }
  find_pairs_of_changes(lost, step);
  const double enough = std::sqrt(kEndsOfError * lost.error) * length_;
  for (double gap = step; gap > enough; gap *= 0.5) {
    place_.clear();
    for (const Change& e : change_) place_.push_back(from_[e.column] + 0.5 * (e.low + e.high) * along_);
    find_margins(lost, place_);
    for (std::size_t i = 0; i < change_.size(); ++i) {
      Change& e = change_[i];
      const double margin = margin_[e.margin * change_.size() + i], middle = 0.5 * (e.low + e.high);
      const bool lower = (margin > 0.0) == (e.at_low > 0.0);
      (lower ? e.low : e.high) = middle;
      (lower ? e.at_low : e.at_high) = margin;
    }
  }
  std::sort(change_.begin(), change_.end(), [](const Change& p, const Change& q) { return std::pair(p.column, p.at()) < std::pair(q.column, q.at()); });
}

/// The sums of cells by their columns, whose points are appended.
void SqueezedRegion::measure(const Lost& lost, std::span<Cell> cells) {
  constexpr std::size_t kTogether = 32;  // as many places as stay near
  for (std::size_t i = 0; i < cells.size(); i += kTogether) measure_block(lost, cells.subspan(i, std::min(kTogether, cells.size() - i)));
}

void SqueezedRegion::measure_block(const Lost& lost, std::span<Cell> cells) {
  const GaussRule& across = gauss_rule(kAcross);
  constexpr std::size_t kColumns = kAcross * kAcross;
  from_.clear();
  area_.clear();
  for (const Cell& cell : cells) {
    for (std::size_t i = 0; i < across.node.size(); ++i) {
      for (std::size_t j = 0; j < across.node.size(); ++j) {
        from_.push_back(origin_ + (cell.corner[0] + across.node[i] * cell.width[0]) * across_[0] + (cell.corner[1] + across.node[j] * cell.width[1]) * across_[1]);
        area_.push_back(across.weight[i] * across.weight[j] * cell.width[0] * cell.width[1]);
      }
    }
  }
  find_changes(lost);
  const std::size_t begin = point_.size();
  auto next = change_.begin();
  for (std::size_t c = 0; c < from_.size(); ++c) {
    if (c % kColumns == 0) cells[c / kColumns].begin = point_.size();
    double low = 0.0;
    std::size_t positive = positive_[c];
    for (; next != change_.end() && next->column == c; ++next) {
      const double at = next->at();
      if (positive == margins(lost)) add_piece(c, low, at);
      low = at;
      positive += next->at_high > 0.0 ? 1 : -1;
    }
    if (positive == margins(lost)) add_piece(c, low, length_);  // the overlap's box ends there
    cells[c / kColumns].end = point_.size();
  }
  value_.resize(point_.size() - begin);
  lost.pressure.evaluate(lost.side, std::span(point_).subspan(begin), value_);
  for (Cell& cell : cells) {
    for (std::size_t i = cell.begin; i < cell.end; ++i) {
      cell.sums.volume += volume_[i];
      cell.sums.energy += volume_[i] * value_[i - begin];
    }
  }
}

void SqueezedRegion::add_piece(std::size_t column, double low, double high) {
  const GaussRule& along = gauss_rule(along_piece_);
  const double parts = std::clamp(std::ceil((high - low) / longest_piece_), 1.0, kMostParts), length = (high - low) / parts;
  for (double k = 0.0; k < parts; ++k) {
    for (std::size_t j = 0; j < along.node.size(); ++j) {
      point_.push_back(from_[column] + (low + (k + along.node[j]) * length) * along_);
      volume_.push_back(area_[column] * length * along.weight[j]);
    }
  }
}

/// Quarters of `split_`, measured, join the others.
void SqueezedRegion::quarter(const Lost& lost) {
  quarter_.clear();
  for (const Cell& cell : split_) {
    const std::array<double, 2> half{0.5 * cell.width[0], 0.5 * cell.width[1]};
    for (const double i : {0.0, 1.0}) {
      for (const double j : {0.0, 1.0}) quarter_.push_back({.corner = {cell.corner[0] + i * half[0], cell.corner[1] + j * half[1]}, .width = half});
    }
  }
  measure(lost, quarter_);
  for (std::size_t k = 0; k < split_.size(); ++k) {
    const std::span<Cell> quarters = std::span(quarter_).subspan(4 * k, 4);
    Sums fine;
    for (const Cell& q : quarters) fine.add(q.sums);
    for (Cell& q : quarters) q.off = {0.25 * std::abs(fine.energy - split_[k].sums.energy), 0.25 * std::abs(fine.volume - split_[k].sums.volume)};
  }
  leaf_.insert(leaf_.end(), quarter_.begin(), quarter_.end());
}

/// Moves the cells that miss most to `split_`. @return whether there are such
bool SqueezedRegion::choose(double error) {
  Sums all;
  for (const Cell& cell : leaf_) all.add(cell.sums);
  const auto off = [&](const Cell& cell) { return all.energy > 0.0 ? std::max(cell.off.energy / all.energy, cell.off.volume / all.volume) : 0.0; };
  // Errors of one sign add up, others cancel: between the two.
  double sum = 0.0, square = 0.0;
  const auto grows_beyond = [&](const Cell& cell, double most) {
    const double e = off(cell);
    sum += e;
    square += e * e;
    return kTwoOrders * std::sqrt(std::sqrt(square) * sum) > most;
  };
  if (std::none_of(leaf_.begin(), leaf_.end(), [&](const Cell& cell) { return grows_beyond(cell, error); })) return false;
  std::stable_sort(leaf_.begin(), leaf_.end(), [&](const Cell& p, const Cell& q) { return off(p) < off(q); });
  sum = square = 0.0;
  const auto first = std::find_if(leaf_.begin(), leaf_.end(), [&](const Cell& cell) { return grows_beyond(cell, kOfKept * error); });
  split_.assign(first, leaf_.end());
  leaf_.erase(first, leaf_.end());
  add_empty_neighbours();
  return true;
}

/// Cells that hold nothing join `split_` where they touch a smaller one of these that holds something: a corner of the region may lie between their columns, which two
/// orders do not tell.
void SqueezedRegion::add_empty_neighbours() {
  const auto touch = [](const Cell& p, const Cell& q) {
    constexpr double kBeside = 1e-6;  // of a width
    const auto along = [&](std::size_t k) {
      const double gap = kBeside * p.width[k];
      return p.corner[k] <= q.corner[k] + q.width[k] + gap && q.corner[k] <= p.corner[k] + p.width[k] + gap;
    };
    return along(0) && along(1);
  };
  const std::size_t chosen = split_.size();
  const auto joins = [&](const Cell& cell) {
    if (cell.begin != cell.end) return false;
    const auto beside = [&](const Cell& other) { return other.begin != other.end && cell.width[0] > 1.5 * other.width[0] && touch(cell, other); };
    return std::any_of(split_.begin(), split_.begin() + static_cast<std::ptrdiff_t>(chosen), beside);
  };
  const auto kept = std::stable_partition(leaf_.begin(), leaf_.end(), [&](const Cell& cell) { return !joins(cell); });
  split_.insert(split_.end(), kept, leaf_.end());
  leaf_.erase(kept, leaf_.end());
}

void SqueezedRegion::fill(const Lost& lost, const Box& overlap, const Vec3& across, PatchPoints& points) {
  SUPPLE_EXPECTS(is_finite(overlap));
  Eigen::Index axis = 0;
  across.cwiseAbs().maxCoeff(&axis);
  along_ = Vec3::Unit(axis);
  across_ = {Vec3::Unit((axis + 1) % 3), Vec3::Unit((axis + 2) % 3)};
  origin_ = overlap.lower;
  length_ = overlap.extent()[axis];
  feature_ = lost.pressure.feature_size();
  along_piece_ = lost.error < kRough ? kAlong : kAlongRough;
  longest_piece_ = lost.error < kFine ? 0.5 * feature_ : feature_;
  std::array<double, 2> cells{}, width{};
  const double most = std::min(kMostCells, std::ceil(kCellsOfError / std::sqrt(lost.error)));
  for (std::size_t k = 0; k < 2; ++k) {
    const double range = overlap.extent().dot(across_[k]);
    cells[k] = std::max(std::min(std::ceil(kCellsInFeature * range / feature_), most), kFewestCells);
    width[k] = range / cells[k];
  }
  point_.clear();
  volume_.clear();
  leaf_.clear();
  split_.clear();
  for (double i = 0.0; i < cells[0]; ++i) {
    for (double j = 0.0; j < cells[1]; ++j) split_.push_back({.corner = {i * width[0], j * width[1]}, .width = width});
  }
  measure(lost, split_);
  const std::size_t most_leaves = lost.error < kFine ? kMostFineLeaves : kMostLeaves;
  for (quarter(lost); leaf_.size() < most_leaves && point_.size() < kMostPoints && choose(lost.error);) quarter(lost);
  const std::size_t begin = points.volume_point.size();
  const auto append = [](auto& to, const auto& from, const Cell& cell) {
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(cell.begin), from.begin() + static_cast<std::ptrdiff_t>(cell.end));
  };
  for (const Cell& cell : leaf_) {
    append(points.volume_point, point_, cell);
    append(points.volume_weight, volume_, cell);
  }
  add_to_region(lost.pressure, lost.side, begin, value_, points);
}

}  // namespace supple::collision
