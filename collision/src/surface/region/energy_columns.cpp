#include "surface/region/energy_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "numbers.h"
#include "surface/plane.h"

namespace supple::collision {
namespace {

constexpr double kFinest = 1.0 / 8192.0;  // step, over the longest column
constexpr double kLongest = 1.0 / 16.0;   // step where both have pressure, over the longest column
constexpr int kAcross = 3;                // parts of a rectangle, each way
constexpr double kEnough = 0.03;          // doubt over the sum that is left
constexpr double kUnseen = 0.1;           // of what may be beside a column without pressure

/// Integrals along one column [J/m^2].
struct ColumnSums {
  double own = 0.0;   ///< of [min(p_A, p_B)]+
  double most = 0.0;  ///< about what it is at most within the rectangle around the column
};

/// A rectangle across the columns.
struct Rectangle {
  Vec2 middle = Vec2::Zero(), half = Vec2::Zero();
  ColumnSums sums;
  double doubt = 0.0;  ///< by how much its part of the integral may be wrong [J]
  [[nodiscard]] double area() const { return 4.0 * half.x() * half.y(); }
};

class ColumnIntegral {
 public:
  ColumnIntegral(const ShiftedPair& pair, const Vec3& along) : pair_(pair), along_(along), centre_(pair.box.centre()) {
    first_ = along.unitOrthogonal();
    second_ = along.cross(first_);
    const Vec3 half = 0.5 * pair.box.extent();
    whole_.half = {first_.cwiseAbs().dot(half), second_.cwiseAbs().dot(half)};
    longest_ = 2.0 * along.cwiseAbs().dot(half);
    const auto steepest = [](const ContactBody& body, const Box& box) { return std::max(body.field.gradient_bound(box), std::numeric_limits<double>::min()); };
    steep_a_ = steepest(*pair.a, {pair.box.lower - pair.shift, pair.box.upper - pair.shift});
    steep_b_ = steepest(*pair.b, pair.box);
  }

  [[nodiscard]] double sum(int most) {
    divide(whole_);
    const std::vector<Rectangle> roots = std::move(heap_);
    heap_.clear();
    for (const Rectangle& root : roots) divide(root);
    const auto less = [](const Rectangle& a, const Rectangle& b) { return a.doubt < b.doubt; };
    std::make_heap(heap_.begin(), heap_.end(), less);
    while (columns_ < most) {
      double doubt = 0.0, energy = 0.0;
      for (const Rectangle& r : heap_) {
        doubt += r.doubt;
        energy += r.area() * r.sums.own;
      }
      if (!(doubt > kEnough * energy)) break;
      std::pop_heap(heap_.begin(), heap_.end(), less);
      const Rectangle worst = heap_.back();
      heap_.pop_back();
      const std::size_t begin = heap_.size();
      divide(worst);
      for (std::size_t end = begin + 1; end <= heap_.size(); ++end) std::push_heap(heap_.begin(), heap_.begin() + static_cast<std::ptrdiff_t>(end), less);
    }
    double energy = 0.0;
    for (const Rectangle& r : heap_) energy += r.area() * r.sums.own;
    return energy;
  }

 private:
  /// Adds the parts of a rectangle to the heap's end.
  void divide(const Rectangle& whole) {
    const Vec2 half = whole.half / kAcross;
    const std::size_t begin = heap_.size();
    double finer = 0.0;
    for (int j = 0; j < kAcross; ++j) {
      for (int i = 0; i < kAcross; ++i) {
        Rectangle part;
        part.middle = whole.middle + Vec2((2 * i - kAcross + 1) * half.x(), (2 * j - kAcross + 1) * half.y());
        part.half = half;
        part.sums = along_column(part.middle, half.norm());
        finer += part.area() * part.sums.own;
        heap_.push_back(part);
      }
    }
    columns_ += kAcross * kAcross;
    const double change = std::abs(finer - whole.area() * whole.sums.own) / (kAcross * kAcross);
    for (std::size_t k = begin; k < heap_.size(); ++k) {
      Rectangle& part = heap_[k];
      part.doubt = std::max(change, part.sums.own > 0.0 ? 0.0 : kUnseen * part.area() * part.sums.most);
    }
  }

  /// Where the line through a place across enters and leaves the box [m]; none where it misses it.
  [[nodiscard]] Interval within_box(const Vec3& start) const {
    Interval range{-kInfinity, kInfinity};
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double low = pair_.box.lower[k] - start[k], high = pair_.box.upper[k] - start[k];
      if (along_[k] == 0.0) {
        if (low > 0.0 || high < 0.0) return {0.0, -1.0};
        continue;
      }
      range.lower = std::max(range.lower, std::min(low / along_[k], high / along_[k]));
      range.upper = std::min(range.upper, std::max(low / along_[k], high / along_[k]));
    }
    return range;
  }

  [[nodiscard]] ColumnSums along_column(const Vec2& across, double reach) const {
    const Vec3 start = centre_ + across.x() * first_ + across.y() * second_;
    const Interval range = within_box(start);
    ColumnSums sums, before;
    double step = 0.0;
    for (double s = range.lower; s <= range.upper;) {
      const Vec3 x = start + s * along_;
      const double of_a = pair_.a->field.value(x - pair_.shift), of_b = pair_.b->field.value(x);
      const double stiff_a = pair_.a->material.modulus, stiff_b = pair_.b->material.modulus;
      const ColumnSums now{.own = std::max(0.0, std::min(stiff_a * of_a, stiff_b * of_b)),
                           .most = std::max(0.0, std::min(stiff_a * (of_a + steep_a_ * reach), stiff_b * (of_b + steep_b_ * reach)))};
      sums.own += 0.5 * step * (before.own + now.own);
      sums.most += 0.5 * step * (before.most + now.most);
      before = now;
      if (s >= range.upper) break;
      // So far nothing vanishes, or nothing begins. Where a stiff body begins or ends the pressure jumps nearly: half of the way, so that little is left before a jump.
      const double free = std::min(of_a / steep_a_, of_b / steep_b_);
      step = std::max(free > 0.0 ? std::min(0.5 * free, kLongest * longest_) : -free, kFinest * longest_);
      step = std::min(step, range.upper - s);
      s = step < range.upper - s ? s + step : range.upper;
    }
    return sums;
  }

  ShiftedPair pair_;
  Vec3 along_, centre_, first_, second_;
  Rectangle whole_;
  double longest_ = 0.0;
  double steep_a_ = 0.0, steep_b_ = 0.0;  // |grad F|, at most
  int columns_ = 0;
  std::vector<Rectangle> heap_;
};

}  // namespace

double column_energy(const ShiftedPair& pair, const Vec3& along, int most) { return ColumnIntegral(pair, along).sum(most); }

}  // namespace supple::collision
