#include "mesh/creases/crease_mending.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mesh/triangle_borders.h"

namespace supple::implicit {
namespace {

using Triangle = TriangleSteps::Triangle;

constexpr int kGrowths = 4;
constexpr std::size_t kMostTaken = 60;  // triangles of a hole

/// A polygon on one side of the crease, projected along a direction.
class Ears {
 public:
  /// @param joined  whether an edge between two vertices is there already
  Ears(const Mesh& mesh, std::span<const std::uint32_t> owner, const std::function<bool(std::uint32_t, std::uint32_t)>& joined)
      : mesh_(mesh), owner_(owner), joined_(joined) {}

  /// Cuts off the best ear until a triangle is left. @return whether the polygon was filled
  bool fill(std::vector<std::uint32_t> polygon, std::vector<Triangle>& out) {
    outward_ = Vec3::Zero();
    for (const std::uint32_t v : polygon) {
      if (!on_crease(v)) outward_ += mesh_.normal[v];
    }
    while (polygon.size() > 3) {
      const std::optional<std::size_t> ear = best_ear(polygon);
      if (!ear) return false;
      out.push_back(corner(polygon, *ear));
      polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(*ear));
    }
    const Triangle last{polygon[0], polygon[1], polygon[2]};
    out.push_back(last);
    return is_plain(last);
  }

 private:
  [[nodiscard]] bool on_crease(std::uint32_t v) const { return v >= owner_.size(); }
  static Triangle corner(const std::vector<std::uint32_t>& polygon, std::size_t k) {
    const std::size_t n = polygon.size();
    return {polygon[(k + n - 1) % n], polygon[k], polygon[(k + 1) % n]};
  }
  [[nodiscard]] double turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return (mesh_.position[b] - mesh_.position[a]).cross(mesh_.position[c] - mesh_.position[a]).dot(outward_);
  }
  /// Whether a triangle has an extent, and faces outward at every corner.
  [[nodiscard]] bool is_plain(const Triangle& t) const {
    const Vec3 across = (mesh_.position[t[1]] - mesh_.position[t[0]]).cross(mesh_.position[t[2]] - mesh_.position[t[0]]);
    return across.dot(outward_) > 0.0 &&
           std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return on_crease(v) || across.dot(mesh_.normal[v]) > 0.0; });
  }
  /// Twice the area over the square of the longest side.
  [[nodiscard]] double roundness(const Triangle& t) const {
    const Vec3 a = mesh_.position[t[1]] - mesh_.position[t[0]], b = mesh_.position[t[2]] - mesh_.position[t[0]];
    return a.cross(b).norm() / std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
  }
  [[nodiscard]] std::optional<std::size_t> best_ear(const std::vector<std::uint32_t>& polygon) const {
    std::optional<std::size_t> best;
    double most = 0.0;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const Triangle t = corner(polygon, k);
      if ((on_crease(t[0]) && on_crease(t[2])) || !is_plain(t) || joined_(t[0], t[2])) continue;
      const bool holds_other = std::any_of(polygon.begin(), polygon.end(), [&](std::uint32_t v) {
        return std::find(t.begin(), t.end(), v) == t.end() && turn(t[0], t[1], v) >= 0.0 && turn(t[1], t[2], v) >= 0.0 && turn(t[2], t[0], v) >= 0.0;
      });
      const double round = roundness(t);
      if (holds_other || round <= most) continue;
      most = round;
      best = k;
    }
    return best;
  }

  const Mesh& mesh_;
  std::span<const std::uint32_t> owner_;
  const std::function<bool(std::uint32_t, std::uint32_t)>& joined_;
  Vec3 outward_ = Vec3::Zero();
};

/// A hole's border, counter-clockwise: a vertex on the crease, those of one node, another on the crease, those of the other node.
struct Border {
  std::uint32_t first = 0, second = 0;  ///< on the crease
  std::vector<std::uint32_t> left, right;  ///< from first to second, and from second to first
};

/// Attempts to fill a hole around a triangle that failed, each with the vertices of the hole in the end.
class Attempts {
 public:
  /// @param number  of the triangle, larger than all before
  void add(std::uint32_t number, std::span<const std::uint32_t> vertices) {
    vertex_.insert(vertex_.end(), vertices.begin(), vertices.end());
    number_.push_back(number);
    end_.push_back(vertex_.size());
  }
  [[nodiscard]] std::size_t size() const { return number_.size(); }
  [[nodiscard]] std::uint32_t number(std::size_t k) const { return number_[k]; }
  [[nodiscard]] std::span<const std::uint32_t> vertices(std::size_t k) const {
    const std::size_t begin = k == 0 ? 0 : end_[k - 1];
    return std::span(vertex_).subspan(begin, end_[k] - begin);
  }

 private:
  std::vector<std::uint32_t> number_, vertex_;
  std::vector<std::size_t> end_;
};

class Mending {
 public:
  Mending(const Mesh& mesh, std::span<const std::uint32_t> owner, double cell, bool skip, const CreaseVertex& add_vertex, TriangleSteps& steps)
      : mesh_(mesh), owner_(owner), cell_(cell), skip_(skip), add_vertex_(add_vertex), steps_(steps) {}

  void run() {
    constexpr int kPasses = 3;
    for (int pass = 0; pass < kPasses && mend_all(); ++pass) continue;
  }

 private:
  [[nodiscard]] bool on_crease(std::uint32_t v) const { return v >= owner_.size(); }
  [[nodiscard]] bool crosses(std::uint32_t a, std::uint32_t b) const { return !on_crease(a) && !on_crease(b) && owner_[a] != owner_[b]; }
  [[nodiscard]] bool is_crossed(const Triangle& t) const { return crosses(t[0], t[1]) || crosses(t[1], t[2]) || crosses(t[2], t[0]); }

  /// @return whether a hole was filled
  bool mend_all() {
    number_ = steps_.numbers();
    triangle_.clear();
    for (const std::uint32_t n : number_) triangle_.push_back(steps_[n]);
    std::vector<std::uint32_t> crossed;
    for (std::uint32_t i = 0; i < triangle_.size(); ++i) {
      if (is_crossed(triangle_[i])) crossed.push_back(i);
    }
    if (crossed.empty()) return false;
    list_stars();
    touched_before_ = std::exchange(touched_, std::vector<bool>(mesh_.vertex_count(), false));
    touched_before_.resize(mesh_.vertex_count(), true);
    in_hole_.assign(triangle_.size(), 0);
    seen_.resize(mesh_.vertex_count(), 0);
    const Attempts last = std::exchange(failed_, {});
    bool any = false;
    std::size_t known = 0;
    for (const std::uint32_t i : crossed) {
      if (touches_filled(i)) continue;
      while (known < last.size() && last.number(known) < number_[i]) ++known;
      if (known < last.size() && last.number(known) == number_[i] && fails_again(last.vertices(known))) {
        failed_.add(number_[i], last.vertices(known));
      } else if (mend(i)) {
        any = true;
      } else if (skip_) {
        keep_failed(number_[i]);
      }
    }
    return any;
  }

  /// An attempt depends on the triangles at the vertices of its hole when the pass began. If holes were filled there since,
  /// the attempt also fails and is repeated in the next pass.
  [[nodiscard]] bool fails_again(std::span<const std::uint32_t> vertices) const {
    return std::none_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) { return touched_before_[v]; });
  }
  /// The last attempt, from a triangle.
  void keep_failed(std::uint32_t number) {
    around_.clear();
    for (const std::uint32_t i : hole_) {
      for (const std::uint32_t v : triangle_[i]) {
        if (std::exchange(seen_[v], attempt_) != attempt_) around_.push_back(v);
      }
    }
    failed_.add(number, around_);
  }

  void list_stars() {
    first_.assign(mesh_.vertex_count() + 1, 0);
    for (const Triangle& t : triangle_) {
      for (const std::uint32_t v : t) ++first_[v + 1];
    }
    for (std::size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
    star_.resize(3 * triangle_.size());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t i = 0; i < triangle_.size(); ++i) {
      for (const std::uint32_t v : triangle_[i]) star_[next[v]++] = i;
    }
  }
  [[nodiscard]] std::span<const std::uint32_t> star(std::uint32_t v) const {
    return std::span(star_).subspan(first_[v], first_[v + 1] - first_[v]);
  }
  /// The triangle that runs through an edge from a to b.
  [[nodiscard]] std::optional<std::uint32_t> triangle_at(std::uint32_t a, std::uint32_t b) const {
    for (const std::uint32_t i : star(a)) {
      const Triangle& t = triangle_[i];
      for (std::size_t k = 0; k < 3; ++k) {
        if (t[k] == a && t[(k + 1) % 3] == b) return i;
      }
    }
    return std::nullopt;
  }

  /// Adds a triangle to the hole, and its edges to the border or takes them off it.
  void add_to_hole(std::uint32_t triangle) {
    hole_.push_back(triangle);
    in_hole_[triangle] = attempt_;
    join_border(triangle_[triangle], open_);
  }

  /// @return whether a hole was filled
  bool mend(std::uint32_t start) {
    ++attempt_;
    hole_.clear();
    open_.clear();
    add_to_hole(start);
    for (int growth = 0; growth <= kGrowths; ++growth) {
      if (!(growth == 0 || grow_along_crease()) || !grow_across()) return false;
      const std::optional<Border> border = find_border();
      if (border && fill(*border)) return true;
    }
    return false;
  }

  /// Whether a triangle is gone or lies beside a hole that was filled in this pass.
  [[nodiscard]] bool touches_filled(std::uint32_t triangle) const {
    const Triangle& t = triangle_[triangle];
    return touched_[t[0]] || touched_[t[1]] || touched_[t[2]];
  }
  /// @return whether a triangle may be taken and the hole is not too large
  bool take(std::uint32_t triangle) {
    if (in_hole_[triangle] != attempt_) add_to_hole(triangle);
    return hole_.size() <= kMostTaken && !touches_filled(triangle);
  }
  bool take_around(std::uint32_t v) {
    const auto around = star(v);
    return std::all_of(around.begin(), around.end(), [&](std::uint32_t i) { return take(i); });
  }
  /// Takes what lies around the vertices at which the border meets the crease.
  bool grow_along_crease() {
    const std::vector<BorderEdge> open = open_;
    for (const auto& [a, b] : open) {
      if (on_crease(a) && !take_around(a)) return false;
    }
    return true;
  }
  /// Until no edge of the border crosses a crease.
  bool grow_across() {
    for (std::size_t before = 0; before != hole_.size();) {
      before = hole_.size();
      const std::vector<BorderEdge> open = open_;
      for (const auto& [a, b] : open) {
        if (!crosses(a, b)) continue;
        const std::optional<std::uint32_t> beyond = triangle_at(b, a);
        if (!beyond || !take(*beyond)) return false;
      }
    }
    return true;
  }

  /// None where the hole is not a disc, or where its border does not meet the crease at two vertices.
  [[nodiscard]] std::optional<Border> find_border() const {
    // None is open of a whole component.
    if (std::count_if(open_.begin(), open_.end(), [this](const BorderEdge& edge) { return on_crease(edge.first); }) != 2) return std::nullopt;
    std::vector<std::uint32_t> loop = loop_of(open_), inside;
    if (loop.empty()) return std::nullopt;
    for (const std::uint32_t i : hole_) inside.insert(inside.end(), triangle_[i].begin(), triangle_[i].end());
    std::sort(inside.begin(), inside.end());
    inside.erase(std::unique(inside.begin(), inside.end()), inside.end());
    // Of a disc: V - E + F = 1, with 2 E = 3 F + the edges of its border.
    if (2 * inside.size() != hole_.size() + open_.size() + 2) return std::nullopt;
    std::vector<std::size_t> meets;
    for (std::size_t k = 0; k < loop.size(); ++k) {
      if (on_crease(loop[k])) meets.push_back(k);
    }
    std::rotate(loop.begin(), loop.begin() + static_cast<std::ptrdiff_t>(meets[0]), loop.end());
    const auto second = loop.begin() + static_cast<std::ptrdiff_t>(meets[1] - meets[0]);
    Border border{.first = loop.front(), .second = *second, .left = {loop.begin() + 1, second}, .right = {second + 1, loop.end()}};
    if (border.left.empty() || border.right.empty() || owner_[border.left[0]] == owner_[border.right[0]]) return std::nullopt;
    const auto of_two = [&](std::uint32_t v) { return on_crease(v) || owner_[v] == owner_[border.left[0]] || owner_[v] == owner_[border.right[0]]; };
    return std::all_of(inside.begin(), inside.end(), of_two) ? std::optional(border) : std::nullopt;
  }

  bool fill(const Border& border) {
    const std::function<bool(std::uint32_t, std::uint32_t)> joined = [&](std::uint32_t a, std::uint32_t b) { return joined_outside(a, b); };
    const std::optional<std::vector<std::uint32_t>> along = crease_between(border);
    if (!along || (along->empty() && joined(border.first, border.second))) return false;
    std::vector<std::uint32_t> left{border.first}, right{border.second};
    left.insert(left.end(), border.left.begin(), border.left.end());
    left.push_back(border.second);
    left.insert(left.end(), along->rbegin(), along->rend());
    right.insert(right.end(), border.right.begin(), border.right.end());
    right.push_back(border.first);
    right.insert(right.end(), along->begin(), along->end());
    std::vector<Triangle> out;
    Ears ears(mesh_, owner_, joined);
    if (!ears.fill(left, out) || !ears.fill(right, out)) return false;
    std::vector<std::uint32_t> taken;
    for (const std::uint32_t i : hole_) {
      taken.push_back(number_[i]);
      for (const std::uint32_t v : triangle_[i]) touched_[v] = true;
    }
    steps_.replace(taken, out);
    return true;
  }

  /// Vertices on the crease between the two of a border, a cell apart.
  [[nodiscard]] std::optional<std::vector<std::uint32_t>> crease_between(const Border& border) const {
    const Vec3 from = mesh_.position[border.first], step = mesh_.position[border.second] - from;
    const std::array nodes{std::min(owner_[border.left[0]], owner_[border.right[0]]), std::max(owner_[border.left[0]], owner_[border.right[0]])};
    const double parts = std::max(std::round(step.norm() / cell_), 1.0);
    std::vector<std::uint32_t> along;
    for (double k = 1.0; k < parts; k += 1.0) {
      const std::optional<std::uint32_t> v = add_vertex_(nodes, from + k / parts * step);
      if (!v) return std::nullopt;
      along.push_back(*v);
    }
    return along;
  }

  /// Whether an edge that stays joins two vertices.
  [[nodiscard]] bool joined_outside(std::uint32_t a, std::uint32_t b) const {
    if (a + 1 >= first_.size() || b + 1 >= first_.size()) return false;  // made for this hole
    const auto around = star(a);
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t i) {
      const Triangle& t = triangle_[i];
      return std::find(t.begin(), t.end(), b) != t.end() && in_hole_[i] != attempt_;
    });
  }

  const Mesh& mesh_;
  std::span<const std::uint32_t> owner_;
  double cell_;
  bool skip_;
  const CreaseVertex& add_vertex_;
  TriangleSteps& steps_;
  std::vector<std::uint32_t> number_;        ///< of the triangles that are there when a pass begins
  std::vector<Triangle> triangle_;
  std::vector<std::uint32_t> first_, star_;  ///< triangles at each vertex
  std::vector<std::uint32_t> hole_;          ///< triangles that are taken out
  std::vector<BorderEdge> open_;                   ///< its border
  std::vector<bool> touched_;                ///< vertices of holes that were filled in this pass
  std::vector<bool> touched_before_;         ///< the same of the last pass
  Attempts failed_;                          ///< of this pass
  std::vector<std::uint32_t> around_;
  std::uint32_t attempt_ = 0;                ///< counts them
  std::vector<std::uint32_t> in_hole_;       ///< the last attempt that took a triangle
  std::vector<std::uint32_t> seen_;          ///< the last one for which a vertex was listed
};

}  // namespace

void mend_creases(const Mesh& mesh, std::span<const std::uint32_t> owner, double cell, bool skip, const CreaseVertex& add_vertex, TriangleSteps& steps) {
  Mending(mesh, owner, cell, skip, add_vertex, steps).run();
}

}  // namespace supple::implicit
