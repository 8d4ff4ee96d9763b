#include "mesh/cut_crossings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mesh/triangle_crossings.h"

namespace supple::implicit {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

constexpr std::size_t kTogether = 512;

/// Boxes of one width that cover a box.
struct Boxes {
  Vec3 corner = Vec3::Zero();
  double per_width = 0.0;
  std::array<std::size_t, 3> count{};

  Boxes(const Box& all, double width) : corner(all.lower), per_width(1.0 / width) {
    for (std::size_t k = 0; k < 3; ++k) count[k] = 1 + along(all.upper, k);
  }
  [[nodiscard]] std::size_t along(const Vec3& p, std::size_t k) const {
    const auto i = static_cast<Eigen::Index>(k);
    return static_cast<std::size_t>((p[i] - corner[i]) * per_width);
  }
  [[nodiscard]] std::size_t number() const { return count[0] * count[1] * count[2]; }
  [[nodiscard]] std::size_t holding(const Vec3& p) const { return along(p, 0) + count[0] * (along(p, 1) + count[1] * along(p, 2)); }
  /// Calls use(number) for those of a range.
  template <class Range, class Use>
  void each(const Range& range, const Use& use) const {
    for (std::size_t z = 0; z <= range.more[2]; ++z) {
      for (std::size_t y = 0; y <= range.more[1]; ++y) {
        for (std::size_t x = 0; x <= range.more[0]; ++x) use(range.first + x + count[0] * (y + count[1] * z));
      }
    }
  }
};

bool cross(const Mesh& mesh, const Triangle& s, const Triangle& t) {
  std::size_t common = 0;
  for (const std::uint32_t v : s) common += v == t[0] || v == t[1] || v == t[2] ? 1 : 0;
  return common < 2 && triangles_cross(mesh.position, s, t);
}

}  // namespace

void CutCrossings::find_cuts(const Mesh& from, const Mesh& to, const Executor& executor) {
  cut_.resize(from.triangle_count());
  executor.for_blocks(cut_.size(), kTogether, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const Triangle &corner = from.triangle[n], &middle = to.triangle[4 * n + 3];
      const std::array<Vec3, 3> p{to.position[corner[0]], to.position[corner[1]], to.position[corner[2]]};
      const std::array<Vec3, 3> m{to.position[middle[0]], to.position[middle[1]], to.position[middle[2]]};
      Cut& cut = cut_[n];
      cut.box = Box{};
      for (std::size_t k = 0; k < 3; ++k) {
        cut.box.include(p[k]);
        cut.box.include(m[k]);
      }
      // With edges E at the beginning and E + D at the end, the normal of a part moves along
      // E1 x E2 + t (E1 x D2 + D1 x E2) + t^2 D1 x D2: within the hull of its Bezier points.
      const Vec3 ab = 0.5 * (p[1] - p[0]), ac = 0.5 * (p[2] - p[0]), flat = ab.cross(ac);
      const std::array<Vec3, 3> d{m[0] - p[0] - ab, m[1] - p[0] - ab - ac, m[2] - p[0] - ac};
      const double length = flat.norm();
      cut.axis = flat / length;
      double whole2 = 1.0, part2 = 1.0;  // of the normal that turns most: its length, and that along the axis
      bool turns = !(length > 0.0);
      const auto add = [&](const Vec3& normal) {
        const double along = normal.dot(cut.axis), square = normal.squaredNorm(), along2 = along * along;
        turns = turns || !(along > 0.0);
        if (square * part2 <= whole2 * along2) return;
        whole2 = square;
        part2 = along2;
      };
      const auto part = [&](const Vec3& d1, const Vec3& d2, const Vec3& e1, const Vec3& e2) {
        const Vec3 linear = e1.cross(d2) + d1.cross(e2);
        add(flat + 0.5 * linear);
        add(flat + linear + d1.cross(d2));
      };
      part(d[0], d[2], ab, ac);                        // from a: ab, ca
      part(-d[0], d[1] - d[0], ab, ac);                // from ab: b, bc
      part(d[1] - d[2], -d[2], ab, ac);                // from ca: bc, c
      part(d[1] - d[0], d[2] - d[0], ac, ac - ab);     // from ab: bc, ca
      if (turns) cut.axis.setZero();
      cut.sine = std::sqrt(1.0 - part2 / whole2);
    }
  });
}

void CutCrossings::find_doubtful() {
  // Twice as wide as what is cut: most lie in one or two, and normals are alike in one.
  constexpr double kWidth = 2.0;
  constexpr std::size_t kMostBoxes = 4;  // for each
  double extent = 0.0;
  all_ = Box{};
  for (const Cut& cut : cut_) {
    all_ = all_.united(cut.box);
    extent += cut.box.extent().maxCoeff();
  }
  width_ = kWidth * extent / static_cast<double>(cut_.size());
  while (Boxes(all_, width_).number() > kMostBoxes * cut_.size()) width_ *= 2.0;
  const Boxes boxes(all_, width_);
  axis_.assign(boxes.number(), Vec3::Zero());
  range_.resize(cut_.size());
  for (std::size_t n = 0; n < cut_.size(); ++n) {
    const Cut& cut = cut_[n];
    range_[n].first = static_cast<std::uint32_t>(boxes.holding(cut.box.lower));
    for (std::size_t k = 0; k < 3; ++k) range_[n].more[k] = static_cast<std::uint16_t>(boxes.along(cut.box.upper, k) - boxes.along(cut.box.lower, k));
    boxes.each(range_[n], [&](std::size_t b) { axis_[b] += cut.axis; });
  }
  doubtful_.assign(boxes.number(), 0);
  in_box_.clear();
  bool any = false;
  for (std::size_t n = 0; n < cut_.size(); ++n) {
    const Cut& cut = cut_[n];
    boxes.each(range_[n], [&](std::size_t b) {
      const double along = axis_[b].dot(cut.axis);
      if (along > 0.0 && along * along > cut.sine * cut.sine * axis_[b].squaredNorm()) return;
      doubtful_[b] = 1;
      any = true;
    });
  }
  if (!any) return;
  for (std::uint32_t n = 0; n < cut_.size(); ++n) {
    boxes.each(range_[n], [&](std::size_t b) {
      if (doubtful_[b] != 0) in_box_.push_back({static_cast<std::uint32_t>(b), n});
    });
  }
  std::sort(in_box_.begin(), in_box_.end(), [](const InBox& a, const InBox& b) { return a.box != b.box ? a.box < b.box : a.triangle < b.triangle; });
}

void CutCrossings::find_crossing(const Mesh& from, const Mesh& to, const Executor& executor) {
  const Boxes boxes(all_, width_);
  std::vector<std::size_t> first;
  for (std::size_t i = 0; i < in_box_.size(); ++i) {
    if (i == 0 || in_box_[i].box != in_box_[i - 1].box) first.push_back(i);
  }
  const std::size_t count = first.size();
  first.push_back(in_box_.size());
  found_.resize(std::max(found_.size(), count));
  const auto part = [&to](std::uint32_t n, std::size_t k) -> const Triangle& { return to.triangle[4 * std::size_t{n} + k]; };
  executor.for_blocks(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      found_[b].clear();
      const auto compare = [&](std::uint32_t n, std::size_t k, std::uint32_t o, std::size_t l) {
        if (!cross(to, part(n, k), part(o, l))) return;
        Middle farthest;
        double distance = 0.0;  // middles that are on their edges are left out: flat triangles cross by no more than rounding
        for (const auto& [of, which] : {std::pair{n, k}, std::pair{o, l}}) {
          for (std::size_t e = 0; e < 3; ++e) {
            const std::uint32_t v = part(of, 3)[e];
            const Triangle& t = part(of, which);
            if (std::find(t.begin(), t.end(), v) == t.end()) continue;
            const Vec3 middle = 0.5 * (to.position[from.triangle[of][e]] + to.position[from.triangle[of][(e + 1) % 3]]);
            const double moved = (to.position[v] - middle).squaredNorm();
            if (moved < distance || moved == 0.0 || (moved == distance && v > farthest.vertex)) continue;
            distance = moved;
            farthest = {v, middle};
          }
        }
        if (distance > 0.0) found_[b].push_back(farthest);
      };
      for (std::size_t i = first[b]; i < first[b + 1]; ++i) {
        const std::uint32_t n = in_box_[i].triangle;
        if (boxes.holding(cut_[n].box.lower) == in_box_[i].box) {
          for (std::size_t k = 0; k < 3; ++k) compare(n, k, n, (k + 1) % 3);
        }
        for (std::size_t j = i + 1; j < first[b + 1]; ++j) {
          const std::uint32_t o = in_box_[j].triangle;
          if (!cut_[n].box.overlaps(cut_[o].box)) continue;
          const Box common = cut_[n].box.intersection(cut_[o].box);
          if (boxes.holding(common.lower) != in_box_[i].box) continue;  // of all boxes that contain both, one
          for (std::size_t k = 0; k < 4; ++k) {
            const Box box = box_of(to.position, part(n, k));
            if (!box.overlaps(common)) continue;
            for (std::size_t l = 0; l < 4; ++l) {
              if (box.overlaps(box_of(to.position, part(o, l)))) compare(n, k, o, l);
            }
          }
        }
      }
    }
  });
  middle_.clear();
  for (std::size_t b = 0; b < count; ++b) middle_.insert(middle_.end(), found_[b].begin(), found_[b].end());
  std::sort(middle_.begin(), middle_.end(), [](const Middle& a, const Middle& c) { return a.vertex < c.vertex; });
  const auto same = [](const Middle& a, const Middle& c) { return a.vertex == c.vertex; };
  middle_.erase(std::unique(middle_.begin(), middle_.end(), same), middle_.end());
}

void CutCrossings::take_back(const Mesh& from, const Executor& executor, Mesh& to, std::vector<StraightEdge>& straight) {
  straight.clear();
  if (from.triangle.empty()) return;
  do {
find_cuts(from, to, executor);
    find_doubtful();
    find_crossing(from, to, executor);
    for (const Middle& middle : middle_) {
      straight.push_back({middle.vertex, to.position[middle.vertex], to.normal[middle.vertex]});
      to.position[middle.vertex] = middle.of_edge;
    }
  } while (!middle_.empty());
  std::sort(straight.begin(), straight.end(), [](const StraightEdge& a, const StraightEdge& b) { return a.vertex < b.vertex; });
}

}  // namespace supple::implicit
