#include "mesh/creases/crease_crossings.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "mesh/same_triangles.h"
#include "mesh/triangle_crossings.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using Triangle = TriangleSteps::Triangle;

/// Boxes in the cells of a lattice that they touch, by a hash of these.
class CellsOfBoxes {
 public:
  explicit CellsOfBoxes(double cell) : per_cell_(1.0 / cell) {}
  void add(const Box& box, std::uint32_t number) { item_.push_back({box, place_of(box.lower), number}); }
  /// @pre all are added
  void sort() {
    std::size_t count = 0;
    for (const Item& item : item_) each_cell(item.box, [&](const Place&) { ++count; });
    first_.assign(std::bit_ceil(count + 1) + 1, 0);
    for (const Item& item : item_) each_cell(item.box, [&](const Place& place) { ++first_[bucket(place) + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    entry_.resize(count);
    for (std::uint32_t i = 0; i < item_.size(); ++i) each_cell(item_[i].box, [&](const Place& place) { entry_[next[bucket(place)]++] = i; });
  }

  /// Calls use(number) for each box that overlaps another one and for which wanted(number), rarely twice.
  template <class Wanted, class Use>
  void each_near(const Box& box, const Wanted& wanted, const Use& use) const {
    const Place low = place_of(box.lower);
    each_cell(box, [&](const Place& place) {
      const std::size_t in = bucket(place);
      for (std::uint32_t i = first_[in]; i < first_[in + 1]; ++i) {
        const Item& item = item_[entry_[i]];
        if (!wanted(item.number) || !item.box.overlaps(box)) continue;
        bool here = true;  // in the cell of the least corner that both have in common
        for (std::size_t k = 0; k < 3; ++k) here = here && std::max(item.low[k], low[k]) == place[k];
        if (here) use(item.number);
      }
    });
  }

 private:
  using Place = std::array<std::int64_t, 3>;
  struct Item {
    Box box;
    Place low;  ///< of its least corner
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
  std::vector<Item> item_;
  std::vector<std::uint32_t> first_;  ///< entry of each bucket; their number is a power of two
  std::vector<std::uint32_t> entry_;  ///< items
};

class TakingBack {
 public:
  TakingBack(const Mesh& mesh, const std::vector<bool>& safe, double cell, CrossingMemory& memory, TriangleSteps& steps)
      : mesh_(mesh), position_(mesh.position), safe_(safe), cell_(cell), memory_(memory), steps_(steps) {}

  std::vector<std::uint32_t> run() {
    std::vector<std::uint32_t> back, all;
    for (std::vector<Pair> found = first_pairs(); !found.empty(); found = pairs(back)) {
      back.clear();
      for (const auto& [s, t] : found) {
        if (!steps_.is_there(s) || !steps_.is_there(t)) continue;
        // Numbers of steps from 1, with 0 for triangles of no step.
        const std::uint32_t later = std::max(steps_.maker(s) + 1, steps_.maker(t) + 1);
        SUPPLE_EXPECTS(later > 0);
        steps_.take_back(later - 1, back);
      }
      all.insert(all.end(), back.begin(), back.end());
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    std::erase_if(all, [this](std::uint32_t t) { return !steps_.is_there(t); });
    return all;
  }

 private:
  using Pair = CrossingMemory::Pair;
  [[nodiscard]] bool is_safe(std::uint32_t t) const { return t < safe_.size() && safe_[t]; }
  [[nodiscard]] Box box_of(std::uint32_t t) const { return implicit::box_of(position_, steps_[t]); }

  /// Those that must not both be there before any step was taken back, of which one is not safe.
  [[nodiscard]] std::vector<Pair> first_pairs() {
    const std::vector<std::uint32_t> number = steps_.numbers();
    Mesh now{.position = mesh_.position, .normal = mesh_.normal, .triangle = {}, .columns = {}};
    std::vector<std::uint8_t> safe;
    for (const std::uint32_t t : number) {
      now.triangle.push_back(steps_[t]);
      safe.push_back(is_safe(t) ? 1 : 0);
    }
    const std::vector<std::uint32_t> last = same_as_last(now, safe);
    std::vector<std::uint32_t> sought;
    for (std::size_t i = 0; i < number.size(); ++i) {
      if (last[i] == kNoneSame) sought.push_back(number[i]);
    }
    std::vector<Pair> found = pairs(sought);
    std::vector<std::uint32_t> now_of(memory_.mesh.triangle_count(), kNoneSame);
    for (std::size_t i = 0; i < number.size(); ++i) {
      if (last[i] != kNoneSame) now_of[last[i]] = number[i];
    }
    for (const auto& [s, t] : memory_.pair) {
      if (now_of[s] != kNoneSame && now_of[t] != kNoneSame) found.push_back({now_of[s], now_of[t]});
    }
    sort(found);
    memory_.mesh = std::move(now);
    memory_.safe = std::move(safe);
    memory_.pair = found;
    for (Pair& pair : memory_.pair) {
      for (std::uint32_t& t : pair) t = static_cast<std::uint32_t>(std::lower_bound(number.begin(), number.end(), t) - number.begin());
    }
    return found;
  }

  /// For each triangle the one of the last call that has its corners and is as safe, none twice, nor any vertex: whether two of them collide is
  /// as it was then.
  [[nodiscard]] std::vector<std::uint32_t> same_as_last(const Mesh& now, std::span<const std::uint8_t> safe) const {
    if (memory_.mesh.triangle.empty()) return std::vector<std::uint32_t>(now.triangle_count(), kNoneSame);
    std::vector<std::uint32_t> vertex = same_vertices(now, memory_.mesh);
    leave_once(vertex, memory_.mesh.vertex_count());
    std::vector<std::uint32_t> same = same_triangles(now, memory_.mesh, vertex);
    for (std::size_t i = 0; i < same.size(); ++i) {
      if (same[i] != kNoneSame && memory_.safe[same[i]] != safe[i]) same[i] = kNoneSame;
    }
    leave_once(same, memory_.mesh.triangle_count());
    return same;
  }
  /// Keeps the first of equal numbers.
  static void leave_once(std::vector<std::uint32_t>& numbers, std::size_t count) {
    std::vector<bool> taken(count, false);
    for (std::uint32_t& n : numbers) {
      if (n == kNoneSame) continue;
      if (taken[n]) {
        n = kNoneSame;
      } else {
        taken[n] = true;
      }
    }
  }

  /// Those that must not both be there, one of them sought and one not safe, in rising order.
  [[nodiscard]] std::vector<Pair> pairs(std::vector<std::uint32_t>& sought) {
    std::erase_if(sought, [this](std::uint32_t t) { return !steps_.is_there(t); });
    if (sought.empty()) return {};
    is_sought_.assign(steps_.triangles().size(), false);
    CellsOfBoxes cells(cell_);
    Box all;
    for (const std::uint32_t t : sought) {
      const Box box = box_of(t);
      cells.add(box, t);
      all = all.united(box);
      is_sought_[t] = true;
    }
    cells.sort();
    std::vector<Pair> found;
    for (std::uint32_t s = 0; s < steps_.triangles().size(); ++s) {
      if (!steps_.is_there(s)) continue;
      const Box box = box_of(s);
      if (!box.overlaps(all)) continue;
      const bool sought_too = is_sought_[s], safe = is_safe(s);
      const auto wanted = [&](std::uint32_t t) { return !((sought_too && s >= t) || (safe && is_safe(t))); };
      cells.each_near(box, wanted, [&](std::uint32_t t) {
        if (collide(steps_[s], steps_[t])) found.push_back({s, t});
      });
    }
    sort(found);
    return found;
  }
  static void sort(std::vector<Pair>& found) {
    for (Pair& pair : found) pair = {std::min(pair[0], pair[1]), std::max(pair[0], pair[1])};
    std::sort(found.begin(), found.end());
  }

  /// Whether two triangles cross, run along an edge in the same direction, or have all corners in common.
  [[nodiscard]] bool collide(const Triangle& s, const Triangle& t) const {
    std::size_t common = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (s[i] != t[k]) continue;
        if (s[(i + 1) % 3] == t[(k + 1) % 3]) return true;
        ++common;
      }
    }
    if (common >= 2) return common == 3;  // each edge ends at a corner of the other triangle
    return triangles_cross(position_, s, t);
  }

  const Mesh& mesh_;
  std::span<const Vec3> position_;
  const std::vector<bool>& safe_;
  double cell_;
  CrossingMemory& memory_;
  TriangleSteps& steps_;
  std::vector<bool> is_sought_;
};

}  // namespace

std::vector<std::uint32_t> take_back_crossings(const Mesh& mesh, const std::vector<bool>& safe, double cell, CrossingMemory& memory,
                                               TriangleSteps& steps) {
  return TakingBack(mesh, safe, cell, memory, steps).run();
}

}  // namespace supple::implicit
