#include "crease_crossings.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>

#include "supple/core/error.h"
#include "triangle_crossings.h"

namespace supple::implicit {
namespace {

using Triangle = TriangleSteps::Triangle;

/// Boxes in the cells of a lattice that they touch, by a hash of these.
class CellsOfBoxes {
 public:
  /// @param number  of each box
  CellsOfBoxes(std::span<const Box> boxes, std::span<const std::uint32_t> number, double cell) : per_cell_(1.0 / cell) {
    std::size_t count = 0;
    for (const Box& box : boxes) each_cell(box, [&](const Place&) { ++count; });
    first_.assign(std::bit_ceil(count + 1) + 1, 0);
    for (const Box& box : boxes) each_cell(box, [&](const Place& place) { ++first_[bucket(place) + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    entry_.resize(count);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      each_cell(boxes[i], [&](const Place& place) { entry_[next[bucket(place)]++] = {boxes[i], number[i]}; });
    }
  }

  /// Calls use(number) for each box that overlaps another one, rarely twice.
  template <class Use>
  void each_near(const Box& box, const Use& use) const {
    each_cell(box, [&](const Place& place) {
      const std::size_t in = bucket(place);
      for (std::uint32_t i = first_[in]; i < first_[in + 1]; ++i) {
        const Entry& entry = entry_[i];
        // In the cell of the least corner that both have in common.
        if (entry.box.overlaps(box) && place_of(entry.box.lower.cwiseMax(box.lower)) == place) use(entry.number);
      }
    });
  }

 private:
  using Place = std::array<std::int64_t, 3>;
  struct Entry {
    Box box;
    std::uint32_t number;
  };

  [[nodiscard]] Place place_of(const Vec3& p) const {
    Place place{};
    for (std::size_t k = 0; k < 3; ++k) place[k] = static_cast<std::int64_t>(std::floor(p[static_cast<Eigen::Index>(k)] * per_cell_));
    return place;
  }
  template <class Use>
  void each_cell(const Box& box, const Use& use) const {
    const Place low = place_of(box.lower), high = place_of(box.upper);
    for (std::int64_t z = low[2]; z <= high[2]; ++z) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t x = low[0]; x <= high[0]; ++x) use(Place{x, y, z});
      }
    }
  }
  [[nodiscard]] std::size_t bucket(const Place& place) const {
    return static_cast<std::size_t>(place[0] + 1031 * place[1] + 1048583 * place[2]) & (first_.size() - 2);
  }

  double per_cell_;
  std::vector<std::uint32_t> first_;  ///< entry of each bucket; their number is a power of two
  std::vector<Entry> entry_;
};

class TakingBack {
 public:
  TakingBack(std::span<const Vec3> position, const std::vector<bool>& safe, double cell, TriangleSteps& steps)
      : position_(position), safe_(safe), cell_(cell), steps_(steps) {}

  std::vector<std::uint32_t> run() {
    std::vector<std::uint32_t> sought, all;
    for (auto t = static_cast<std::uint32_t>(safe_.size()); t < steps_.triangles().size(); ++t) sought.push_back(t);
    for (std::uint32_t t = 0; t < safe_.size(); ++t) {
      if (!safe_[t]) sought.push_back(t);
    }
    while (!sought.empty()) {
      std::vector<std::uint32_t> back;
      for (const auto& [s, t] : pairs(sought)) {
        if (!steps_.is_there(s) || !steps_.is_there(t)) continue;
        // Numbers of steps from 1 on, with 0 for what none made.
        const std::uint32_t later = std::max(steps_.maker(s) + 1, steps_.maker(t) + 1);
        SUPPLE_EXPECTS(later > 0);
        steps_.take_back(later - 1, back);
      }
      all.insert(all.end(), back.begin(), back.end());
      sought = std::move(back);
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    std::erase_if(all, [this](std::uint32_t t) { return !steps_.is_there(t); });
    return all;
  }

 private:
  [[nodiscard]] bool is_safe(std::uint32_t t) const { return t < safe_.size() && safe_[t]; }
  [[nodiscard]] Box box_of(std::uint32_t t) const { return implicit::box_of(position_, steps_[t]); }

  /// Those that must not both be there, one of them sought.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> pairs(std::vector<std::uint32_t>& sought) {
    std::erase_if(sought, [this](std::uint32_t t) { return !steps_.is_there(t); });
    std::vector<Box> box;
    is_sought_.assign(steps_.triangles().size(), false);
    for (const std::uint32_t t : sought) {
      box.push_back(box_of(t));
      is_sought_[t] = true;
    }
    const CellsOfBoxes cells(box, sought, cell_);
    std::vector<std::array<std::uint32_t, 2>> found;
    for (std::uint32_t s = 0; s < steps_.triangles().size(); ++s) {
      if (!steps_.is_there(s)) continue;
      cells.each_near(box_of(s), [&](std::uint32_t t) {
        if ((is_sought_[s] && s >= t) || (is_safe(s) && is_safe(t))) return;
        if (share_a_way(steps_[s], steps_[t]) || triangles_cross(position_, steps_[s], steps_[t])) found.push_back({s, t});
      });
    }
    return found;
  }

  /// Whether two triangles run along an edge in the same direction, or have all corners in common.
  static bool share_a_way(const Triangle& s, const Triangle& t) {
    std::size_t common = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (s[i] != t[k]) continue;
        if (s[(i + 1) % 3] == t[(k + 1) % 3]) return true;
        ++common;
      }
    }
    return common == 3;
  }

  std::span<const Vec3> position_;
  const std::vector<bool>& safe_;
  double cell_;
  TriangleSteps& steps_;
  std::vector<bool> is_sought_;
};

}  // namespace

std::vector<std::uint32_t> take_back_crossings(std::span<const Vec3> position, const std::vector<bool>& safe, double cell, TriangleSteps& steps) {
  return TakingBack(position, safe, cell, steps).run();
}

}  // namespace supple::implicit
