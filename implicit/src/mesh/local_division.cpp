#include "mesh/local_division.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <unordered_set>
#include <utility>
#include <vector>

#include "mesh/curved_middle.h"
#include "mesh/error_search.h"
#include "mesh/triangle_crossings.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

using Corners = std::array<std::uint32_t, 3>;

constexpr std::size_t kTrianglesPerTask = 512;
constexpr std::uint32_t kNone = ~std::uint32_t{0};

/// A divided edge from a to b, a < b; `middle` is its new vertex.
struct Edge {
  std::uint32_t a = 0, b = 0, middle = kNone;
  bool operator<(const Edge& other) const { return a != other.a ? a < other.a : b < other.b; }
};

std::uint64_t key_of(std::uint32_t a, std::uint32_t b) { return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b); }

std::size_t next(std::size_t corner) { return corner == 2 ? 0 : corner + 1; }

/// Against the normals of its vertices.
bool is_inverted(const Mesh& mesh, const Corners& t) {
  const Vec3 area = (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]);
  return !(area.dot(mesh.normal[t[0]] + mesh.normal[t[1]] + mesh.normal[t[2]]) > 0.0);
}

/// Whether a triangle is to be divided: its error exceeds the goal, or, where the surface bends so much in it that shading by its normals shows it, an
/// eighth of the goal.
bool is_coarse(const Mesh& mesh, const Corners& t, double error, double goal) {
  constexpr double kCosine = 0.87, kShare = 0.125;  // of 30 degrees
  const Vec3 &p = mesh.normal[t[0]], &q = mesh.normal[t[1]], &r = mesh.normal[t[2]];
  return error > goal || (error > kShare * goal && std::min({p.dot(q), q.dot(r), r.dot(p)}) < kCosine);
}

bool share_an_edge(const Corners& s, const Corners& t) {
  return std::count_if(s.begin(), s.end(), [&](std::uint32_t v) { return v == t[0] || v == t[1] || v == t[2]; }) >= 2;
}

/// The same edge for both of its triangles where lengths are equal.
std::size_t longest_edge(const Mesh& mesh, const Corners& t) {
  const auto length = [&](std::size_t k) { return (mesh.position[t[k]] - mesh.position[t[next(k)]]).squaredNorm(); };
  const auto longer = [&](std::size_t k, std::size_t l) {
    const double of_k = length(k), of_l = length(l);
    return of_k != of_l ? of_k > of_l : key_of(t[k], t[next(k)]) < key_of(t[l], t[next(l)]);
  };
  const std::size_t k = longer(1, 0) ? 1 : 0;
  return longer(2, k) ? 2 : k;
}

/// A mesh, the errors of its triangles [m], and its vertices that are not on the surface.
struct Measured {
  Mesh& mesh;
  std::vector<double> error;
  std::vector<std::uint32_t> off;
};

/// One round: every coarse triangle is divided into four.
class Round {
 public:
  /// @param reach  of a vertex that moves onto the surface [m]
  Round(const FieldView& field, const Executor& executor, double goal, double reach, Measured& of)
      : field_(field), executor_(executor), goal_(goal), reach_(reach), mesh_(of.mesh), error_(of.error), off_(of.off), old_(of.mesh.vertex_count()) {
    choose_edges();
  }
  /// After it.
  [[nodiscard]] std::size_t triangle_count() const { return mesh_.triangle_count() + 2 * edge_.size(); }
  /// Leaves a negative error where it is to be measured.
  void divide();

 private:
  /// A vertex that is to move onto the surface.
  struct Mover {
    std::uint32_t vertex = 0;
    Vec3 start = Vec3::Zero(), home = Vec3::Zero();  ///< of Newton's method; where it stays otherwise
    bool moved = false;
  };
  void choose_edges();
  void list_movers();
  void divide_triangles();
  void move();
  /// Puts vertices of triangles that are inverted or intersect others back. @param changed  triangles to test; receives those that this changed
  void take_back(std::vector<std::uint32_t>& changed);
  void put_back(Mover& mover);
  [[nodiscard]] bool is_near(const Vec3& p) const;
  [[nodiscard]] std::uint32_t middle_of(std::uint32_t a, std::uint32_t b) const;

  const FieldView& field_;
  const Executor& executor_;
  double goal_, reach_;  ///< [m]
  Mesh& mesh_;
  std::vector<double>& error_;
  std::vector<std::uint32_t>& off_;
  std::size_t old_;                     ///< vertices
  std::vector<Edge> edge_;              ///< sorted; the middles follow the old vertices in this order
  std::vector<Mover> mover_;
  std::vector<std::uint32_t> moves_;    ///< by vertex: its mover, or kNone
  std::vector<std::uint32_t> part_;     ///< triangles with movers
};

void Round::choose_edges() {
  std::unordered_set<std::uint64_t> chosen;
  std::vector<std::uint8_t> at_end(mesh_.vertex_count(), 0);  // of a chosen edge
  const auto choose = [&](const Corners& t, std::size_t k) {
    at_end[t[k]] = at_end[t[next(k)]] = 1;
    return chosen.insert(key_of(t[k], t[next(k)])).second;
  };
  for (std::size_t n = 0; n < mesh_.triangle_count(); ++n) {
    if (!is_coarse(mesh_, mesh_.triangle[n], error_[n], goal_)) continue;
    for (std::size_t k = 0; k < 3; ++k) choose(mesh_.triangle[n], k);
  }
  for (bool more = !chosen.empty(); more;) {
    more = false;
    for (const Corners& t : mesh_.triangle) {
      if (at_end[t[0]] + at_end[t[1]] + at_end[t[2]] < 2) continue;
      const auto is_chosen = [&](std::size_t k) { return chosen.contains(key_of(t[k], t[next(k)])); };
      if (is_chosen(0) || is_chosen(1) || is_chosen(2)) more |= choose(t, longest_edge(mesh_, t));
    }
  }
  for (const std::uint64_t key : chosen) edge_.push_back({static_cast<std::uint32_t>(key >> 32), static_cast<std::uint32_t>(key)});
  std::sort(edge_.begin(), edge_.end());
  for (std::size_t i = 0; i < edge_.size(); ++i) edge_[i].middle = static_cast<std::uint32_t>(old_ + i);
}

std::uint32_t Round::middle_of(std::uint32_t a, std::uint32_t b) const {
  const Edge wanted{std::min(a, b), std::max(a, b)};
  const auto at = std::lower_bound(edge_.begin(), edge_.end(), wanted);
  return at == edge_.end() || wanted < *at ? kNone : at->middle;
}

void Round::list_movers() {
  mesh_.position.resize(old_ + edge_.size());
  mesh_.normal.resize(old_ + edge_.size());
  moves_.assign(mesh_.vertex_count(), kNone);
  const auto add = [&](std::uint32_t vertex, const Vec3& start, const Vec3& home) {
    moves_[vertex] = static_cast<std::uint32_t>(mover_.size());
    mover_.push_back({vertex, start, home});
    mesh_.position[vertex] = home;
  };
  for (const std::uint32_t v : off_) add(v, mesh_.position[v], mesh_.position[v]);
  for (const Edge& edge : edge_) {
    const Vec3 &a = mesh_.position[edge.a], &b = mesh_.position[edge.b];
    mesh_.normal[edge.middle] = mesh_.normal[edge.a];
    add(edge.middle, curved_middle(a, mesh_.normal[edge.a], b, mesh_.normal[edge.b]), 0.5 * (a + b));
  }
}

bool Round::is_near(const Vec3& p) const {
  constexpr double kShare = 0.1;  // of the error
  Vec3 slope;
  const double value = field_.value(p, slope);
  return std::abs(value) < kShare * goal_ * slope.norm();
}

void Round::move() {
  executor_.for_blocks(mover_.size(), kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Mover& mover = mover_[i];
      const Projection foot = project_to_surface(field_, mover.start);
      // In a valley Newton's method may go to and fro between its sides.
      if ((!foot.converged && !is_near(foot.point)) || (foot.point - mover.home).squaredNorm() > reach_ * reach_) {
        put_back(mover);
        continue;
      }
      mesh_.position[mover.vertex] = foot.point;
      mesh_.normal[mover.vertex] = foot.normal;
      mover.moved = true;
    }
  });
}

void Round::put_back(Mover& mover) {
  mesh_.position[mover.vertex] = mover.home;
  Vec3 slope;
  static_cast<void>(field_.value(mover.home, slope));
  if (slope.squaredNorm() > 0.0) mesh_.normal[mover.vertex] = -slope.normalized();
  mover.moved = false;
}

void Round::divide_triangles() {
  std::vector<Corners> triangles;
  std::vector<double> errors;
  triangles.reserve(triangle_count());
  errors.reserve(triangle_count());
  std::vector<std::uint8_t> at_end(mesh_.vertex_count(), 0);
  for (const Edge& edge : edge_) at_end[edge.a] = at_end[edge.b] = 1;
  for (std::size_t n = 0; n < mesh_.triangle_count(); ++n) {
    const Corners& t = mesh_.triangle[n];
    const std::size_t k = at_end[t[0]] + at_end[t[1]] + at_end[t[2]] < 2 ? 0 : longest_edge(mesh_, t);
    const std::uint32_t a = t[k], b = t[next(k)], c = t[next(next(k))], ab = middle_of(a, b);
    if (ab == kNone) {  // then no other edge is divided
      const bool moves = std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return moves_[v] != kNone; });
      if (moves) part_.push_back(static_cast<std::uint32_t>(triangles.size()));
      triangles.push_back(t);
      errors.push_back(moves ? -1.0 : error_[n]);
      continue;
    }
    const auto add = [&](const Corners& part) {
      part_.push_back(static_cast<std::uint32_t>(triangles.size()));
      triangles.push_back(part);
      errors.push_back(-1.0);
    };
    const std::uint32_t bc = middle_of(b, c), ca = middle_of(c, a);
    if (ca == kNone) {
      add({a, ab, c});
    } else {
      add({a, ab, ca});
      add({ca, ab, c});
    }
    if (bc == kNone) {
      add({ab, b, c});
    } else {
      add({ab, b, bc});
      add({ab, bc, c});
    }
  }
  mesh_.triangle = std::move(triangles);
  error_ = std::move(errors);
}

void Round::take_back(std::vector<std::uint32_t>& changed) {
  std::vector<std::uint8_t> is_changed(mesh_.triangle_count(), 0);
  std::vector<std::uint32_t> back;  // movers
  const auto has_moved = [&](std::uint32_t v) { return moves_[v] != kNone && mover_[moves_[v]].moved; };
  const auto add_farthest = [&](std::span<const Corners> triangles, std::vector<std::uint32_t>& to) {
    std::uint32_t farthest = kNone;
    double most = -1.0;
    for (const Corners& t : triangles) {
      for (const std::uint32_t v : t) {
        if (!has_moved(v)) continue;
        const double moved = (mesh_.position[v] - mover_[moves_[v]].home).squaredNorm();
        if (moved < most || (moved == most && moves_[v] > farthest)) continue;
        most = moved;
        farthest = moves_[v];
      }
    }
    if (farthest != kNone) to.push_back(farthest);
  };
  for (const std::uint32_t n : changed) {
    const Corners& t = mesh_.triangle[n];
    is_changed[n] = 1;
    if (is_inverted(mesh_, t)) add_farthest(std::span(&t, 1), back);
  }
  const TriangleBoxes boxes(mesh_.position, mesh_.triangle, changed);
  std::vector<std::vector<std::uint32_t>> found((mesh_.triangle_count() + kTrianglesPerTask - 1) / kTrianglesPerTask);
  executor_.for_blocks(mesh_.triangle_count(), kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const Corners& t = mesh_.triangle[n];
      boxes.each_near(box_of(mesh_.position, t), [&](std::uint32_t other) {
        if (other == n || (is_changed[n] != 0 && other < n)) return;  // once for each pair
        const Corners& s = mesh_.triangle[other];
        if (share_an_edge(s, t) || !triangles_cross(mesh_.position, s, t)) return;
        add_farthest(std::array{s, t}, found[begin / kTrianglesPerTask]);
      });
    }
  });
  for (const std::vector<std::uint32_t>& part : found) back.insert(back.end(), part.begin(), part.end());
  std::sort(back.begin(), back.end());
  back.erase(std::unique(back.begin(), back.end()), back.end());
  std::vector<std::uint8_t> is_back(mover_.size(), 0);
  for (const std::uint32_t m : back) {
    put_back(mover_[m]);
    is_back[m] = 1;
  }
  changed.clear();
  for (const std::uint32_t n : part_) {
    const Corners& t = mesh_.triangle[n];
    if (std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return moves_[v] != kNone && is_back[moves_[v]] != 0; })) changed.push_back(n);
  }
}

void Round::divide() {
  list_movers();
  divide_triangles();
  move();
  for (std::vector<std::uint32_t> changed = part_; !changed.empty();) take_back(changed);
  off_.clear();
  for (const Mover& mover : mover_) {
    if (!mover.moved) off_.push_back(mover.vertex);
  }
}

/// Measures the triangles whose error is negative: centroid_error, and where a vertex is not on the surface, the distance to the point that
/// Newton's method leads to. Of `every` triangles one, from `first` on.
void measure(const FieldView& field, Measured& of, const Executor& executor, std::size_t first = 0, std::size_t every = 1) {
  std::vector<std::uint8_t> is_off(of.mesh.vertex_count(), 0);
  for (const std::uint32_t v : of.off) is_off[v] = 1;
  std::vector<std::uint32_t> on, off;
  for (std::size_t n = first; n < of.error.size(); n += every) {
    if (of.error[n] >= 0.0) continue;
    const Corners& t = of.mesh.triangle[n];
    (is_off[t[0]] + is_off[t[1]] + is_off[t[2]] > 0 ? off : on).push_back(static_cast<std::uint32_t>(n));
  }
  executor.for_blocks(on.size(), kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    std::array<double, kTrianglesPerTask> found;
    std::array<Box, kTrianglesPerTask> evaluated;
    const std::size_t n = end - begin;
    centroid_errors(field, of.mesh, std::span(on).subspan(begin, n), std::span(found).first(n), std::span(evaluated).first(n));
    for (std::size_t i = 0; i < n; ++i) of.error[on[begin + i]] = found[i];
  });
  executor.for_blocks(off.size(), kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Corners& t = of.mesh.triangle[off[i]];
      const Vec3 centroid = (of.mesh.position[t[0]] + of.mesh.position[t[1]] + of.mesh.position[t[2]]) / 3.0;
      const Projection foot = project_to_surface(field, centroid);
      of.error[off[i]] = foot.converged ? (foot.point - centroid).norm() : std::numeric_limits<double>::infinity();
    }
  });
}

}  // namespace

const Mesh* LocalDivision::divide(const FieldView& field, const Mesh& from, double goal, std::size_t most, const Executor& executor) {
  mesh_ = from;
  double reach2 = 0.0;
  for (const Corners& t : mesh_.triangle) {
    for (std::size_t k = 0; k < 3; ++k) reach2 = std::max(reach2, (mesh_.position[t[k]] - mesh_.position[t[next(k)]]).squaredNorm());
  }
  Measured of{mesh_, std::vector<double>(mesh_.triangle_count(), -1.0), {}};
  const auto coarse = [&](std::size_t n) { return of.error[n] >= 0.0 && is_coarse(mesh_, mesh_.triangle[n], of.error[n], goal); };
  const auto count_coarse = [&] {
    std::size_t count = 0;
    for (std::size_t n = 0; n < mesh_.triangle_count(); ++n) count += coarse(n) ? 1 : 0;
    return count;
  };
  // Each coarse triangle has three divided edges, each edge two triangles that become one more: an eighth of the triangles often shows that they get too many.
  constexpr std::size_t kParts = 8;
  for (std::size_t part = 0; part < kParts; ++part) {
    measure(field, of, executor, part, kParts);
    if (mesh_.triangle_count() + 3 * count_coarse() > most) return nullptr;
  }
  std::size_t last = mesh_.triangle_count(), before = last;  // coarse triangles of the last two rounds
  for (std::size_t count; (count = count_coarse()) > 0; measure(field, of, executor)) {
    if (count > 2 * std::exchange(before, std::exchange(last, count))) return nullptr;  // some do not reach the surface
    Round round(field, executor, goal, std::sqrt(reach2), of);
    if (round.triangle_count() > most) return nullptr;
    round.divide();
  }
  error_ = of.error.empty() ? 0.0 : *std::max_element(of.error.begin(), of.error.end());
  return &mesh_;
}

}  // namespace supple::implicit
