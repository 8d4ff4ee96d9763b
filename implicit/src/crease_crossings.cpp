#include "crease_crossings.h"

#include <algorithm>
#include <cmath>

#include "triangle_crossings.h"

namespace supple::implicit {
namespace {

using Triangle = TriangleSteps::Triangle;

/// Cells that boxes touch, by a hash: some more than these.
class TouchedCells {
 public:
  explicit TouchedCells(double cell) : per_cell_(1.0 / cell), bit_(kBits, false) {}

  void add(const Box& box) {
    (void)any(box, [this](std::size_t place) {
      bit_[place] = true;
      return false;
    });
  }
  [[nodiscard]] bool touch(const Box& box) const {
    return any(box, [this](std::size_t place) { return static_cast<bool>(bit_[place]); });
  }

 private:
  static constexpr std::size_t kBits = std::size_t{1} << 22;

  template <class Use>
  [[nodiscard]] bool any(const Box& box, const Use& use) const {
    std::array<std::uint64_t, 3> low{}, high{};
    for (Eigen::Index k = 0; k < 3; ++k) {
      low[static_cast<std::size_t>(k)] = static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(box.lower[k] * per_cell_)));
      high[static_cast<std::size_t>(k)] = static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(box.upper[k] * per_cell_)));
    }
    for (std::uint64_t z = low[2]; z != high[2] + 1; ++z) {
      for (std::uint64_t y = low[1]; y != high[1] + 1; ++y) {
        for (std::uint64_t x = low[0]; x != high[0] + 1; ++x) {
          if (use(static_cast<std::size_t>(x + 1031 * y + 1048583 * z) % kBits)) return true;
        }
      }
    }
    return false;
  }

  double per_cell_;
  std::vector<bool> bit_;
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
    if (sought.empty()) return all;
    // A pair that crosses has a triangle that is not safe: all that could ever cross is near one.
    const TriangleBoxes boxes(position_, steps_.triangles(), near(sought));
    while (!sought.empty()) {
      std::vector<std::uint32_t> back;
      for (const auto& [s, t] : pairs(sought, boxes)) {
        if (!steps_.is_there(s) || !steps_.is_there(t)) continue;
        // Numbers of steps from 1 on, with 0 for what none made.
        steps_.take_back(std::max(steps_.maker(s) + 1, steps_.maker(t) + 1) - 1, back);
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

  /// Triangles that share a cell with one of some, or are one of them.
  [[nodiscard]] std::vector<std::uint32_t> near(std::span<const std::uint32_t> some) const {
    TouchedCells cells(cell_);
    for (const std::uint32_t t : some) cells.add(box_of(t));
    std::vector<std::uint32_t> near;
    for (std::uint32_t t = 0; t < steps_.triangles().size(); ++t) {
      if (cells.touch(box_of(t))) near.push_back(t);
    }
    return near;
  }

  /// Those that must not both be there, one of them sought, both there.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> pairs(std::span<const std::uint32_t> sought, const TriangleBoxes& boxes) const {
    std::vector<std::array<std::uint32_t, 2>> found;
    for (const std::uint32_t s : sought) {
      if (!steps_.is_there(s)) continue;
      boxes.each_near(box_of(s), [&](std::uint32_t t) {
        if (s == t || !steps_.is_there(t) || (is_safe(s) && is_safe(t))) return;
        if (share_a_way(steps_[s], steps_[t]) || triangles_cross(position_, steps_[s], steps_[t])) found.push_back({std::min(s, t), std::max(s, t)});
      });
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
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
};

}  // namespace

std::vector<std::uint32_t> take_back_crossings(std::span<const Vec3> position, const std::vector<bool>& safe, double cell, TriangleSteps& steps) {
  return TakingBack(position, safe, cell, steps).run();
}

}  // namespace supple::implicit
