#include "mesh/local_division.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <unordered_set>
#include <utility>
#include <vector>

#include "mesh/curved_middle.h"
#include "mesh/error_search.h"
#include "mesh/triangle_crossings.h"
#include "supple/core/error.h"
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

double twice_area(const Mesh& mesh, const Corners& t) {
  const Vec3& p = mesh.position[t[0]];
  return (mesh.position[t[1]] - p).cross(mesh.position[t[2]] - p).norm();
}

/// A mesh, the errors of its triangles [m], the edges whose middles are not on the surface, and by vertex, 1: it is on a crease.
struct Measured {
  Mesh& mesh;
  std::vector<double> error;
  std::vector<Edge> off;
  std::vector<std::uint8_t> on_crease;
};

/// Whether a triangle is to be divided: its error exceeds the goal, or, where the surface bends so much in it that shading by its normals shows it, an
/// eighth of the goal. Vertices on creases have normals of no side.
bool is_coarse(const Measured& of, std::size_t n, double goal) {
  constexpr double kCosine = 0.87, kShare = 0.125;  // of 30 degrees
  if (of.error[n] > goal) return true;
  if (!(of.error[n] > kShare * goal)) return false;
  const Corners& t = of.mesh.triangle[n];
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t a = t[k], b = t[next(k)];
    if (of.on_crease[a] == 0 && of.on_crease[b] == 0 && of.mesh.normal[a].dot(of.mesh.normal[b]) < kCosine) return true;
  }
  return false;
}

bool share_an_edge(const Corners& s, const Corners& t) {
  return std::count_if(s.begin(), s.end(), [&](std::uint32_t v) { return v == t[0] || v == t[1] || v == t[2]; }) >= 2;
}

/// Whether an edge runs from one side of a crease to another, as far as the normals at its ends tell.
bool runs_across(const Measured& of, std::uint32_t a, std::uint32_t b) {
  constexpr double kAcross = 0.5;  // cosine of 60 degrees
  return of.on_crease[a] == 0 && of.on_crease[b] == 0 && of.mesh.normal[a].dot(of.mesh.normal[b]) < kAcross;
}

/// The same edge for both of its triangles where lengths are equal. Those across creases count as twice as long, so that they are divided at the crease first.
std::size_t longest_edge(const Measured& of, const Corners& t) {
  constexpr double kOfCrease = 4.0;  // of the square
  const auto length = [&](std::size_t k) {
    return (runs_across(of, t[k], t[next(k)]) ? kOfCrease : 1.0) * (of.mesh.position[t[k]] - of.mesh.position[t[next(k)]]).squaredNorm();
  };
  const auto longer = [&](std::size_t k, std::size_t l) {
    const double of_k = length(k), of_l = length(l);
    return of_k != of_l ? of_k > of_l : key_of(t[k], t[next(k)]) < key_of(t[l], t[next(l)]);
  };
  const std::size_t k = longer(1, 0) ? 1 : 0;
  return longer(2, k) ? 2 : k;
}

/// Against the normals of its vertices, which do not tell where it crosses a crease.
bool is_inverted(const Measured& of, const Corners& t) {
  if (runs_across(of, t[0], t[1]) || runs_across(of, t[1], t[2]) || runs_across(of, t[2], t[0])) return false;
  const Mesh& mesh = of.mesh;
  const Vec3 area = (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]);
  return !(area.dot(mesh.normal[t[0]] + mesh.normal[t[1]] + mesh.normal[t[2]]) > 0.0);
}

/// A place of the surface.
struct Foot {
  Vec3 point = Vec3::Zero(), normal = Vec3::Zero();
};

/// Where the surface is met above or below a place. @param up  unit   @param farthest  from there [m]
std::optional<Foot> foot_along(const FieldView& field, const Vec3& place, const Vec3& up, double farthest) {
  constexpr double kFirst = 0x1p-4;  // step, over the farthest one
  const double value = field.value(place), sign = value > 0.0 ? 1.0 : -1.0;
  for (double step = kFirst * farthest; step <= farthest; step *= 2.0) {
    const Vec3 there = place + sign * step * up;
    if ((field.value(there) > 0.0) == (value > 0.0)) continue;
    Foot foot{.point = root_on_segment(field, place, there)};
    Vec3 slope;
    static_cast<void>(field.value(foot.point, slope));
    if (!(slope.squaredNorm() > 0.0)) return std::nullopt;
    foot.normal = -slope.normalized();
    return foot;
  }
  return std::nullopt;
}

/// Where the surface has a crease between two places of it, by halving of the way from one to the other: the normals of both stay apart.
struct Crease {
  Foot foot;        ///< with the mean of the normals of both sides
  double at = 0.0;  ///< on the way, 0..1
};
std::optional<Crease> find_crease(const FieldView& field, const Foot& one, const Foot& other) {
  constexpr int kHalvings = 12;
  constexpr double kSmooth = 0.985;  // cosine of 10 degrees
  const Vec3 way = other.point - one.point, sum = one.normal + other.normal;
  const double length = way.norm();
  Vec3 up = sum - sum.dot(way) / way.squaredNorm() * way;
  if (!(up.norm() > 0.0)) return std::nullopt;
  up.normalize();
  Vec3 normal_low = one.normal, normal_high = other.normal, point = one.point;
  double low = 0.0, high = 1.0;
  for (int k = 0; k < kHalvings; ++k) {
    if (normal_low.dot(normal_high) > kSmooth) return std::nullopt;
    const double middle = 0.5 * (low + high);
    const std::optional<Foot> foot = foot_along(field, one.point + middle * way, up, 2.0 * length);
    if (!foot) return std::nullopt;
    const bool lower = foot->normal.dot(normal_low) > foot->normal.dot(normal_high);
    (lower ? low : high) = middle;
    (lower ? normal_low : normal_high) = foot->normal;
    point = foot->point;
  }
  if (normal_low.dot(normal_high) > kSmooth || !((normal_low + normal_high).norm() > 0.0)) return std::nullopt;
  return Crease{{point, (normal_low + normal_high).normalized()}, 0.5 * (low + high)};
}

/// One round: every coarse triangle is divided into four.
class Round {
 public:
  /// @param reach  of a vertex that moves onto the surface [m]
  Round(const FieldView& field, const Executor& executor, double goal, double reach, Measured& of)
      : field_(field), executor_(executor), goal_(goal), reach_(reach), mesh_(of.mesh), error_(of.error), off_(of.off), of_(of), old_(of.mesh.vertex_count()) {
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
    std::uint32_t a = kNone, b = kNone;              ///< of the edge that it divides
    std::optional<Foot> foot{};                      ///< where it goes
    bool on_crease = false, moved = false;
  };
  void choose_edges();
  void list_movers();
  void divide_triangles();
  void move();
  /// Puts vertices of triangles that are inverted or intersect others back. @param changed  triangles to test; receives those that this changed
  void take_back(std::vector<std::uint32_t>& changed);
  void put_back(Mover& mover);
  [[nodiscard]] std::optional<Foot> crease_on(const Mover& mover) const;
  void find_foot(Mover& mover) const;
  [[nodiscard]] bool is_near(const Vec3& p) const;
  [[nodiscard]] std::uint32_t middle_of(std::uint32_t a, std::uint32_t b) const;

  const FieldView& field_;
  const Executor& executor_;
  double goal_, reach_;  ///< [m]
  Mesh& mesh_;
  std::vector<double>& error_;
  std::vector<Edge>& off_;
  Measured& of_;
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
    if (!is_coarse(of_, n, goal_)) continue;
    for (std::size_t k = 0; k < 3; ++k) choose(mesh_.triangle[n], k);
  }
  for (bool more = !chosen.empty(); more;) {
    more = false;
    for (const Corners& t : mesh_.triangle) {
      if (at_end[t[0]] + at_end[t[1]] + at_end[t[2]] < 2) continue;
      const auto is_chosen = [&](std::size_t k) { return chosen.contains(key_of(t[k], t[next(k)])); };
      if (is_chosen(0) || is_chosen(1) || is_chosen(2)) more |= choose(t, longest_edge(of_, t));
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
  of_.on_crease.resize(mesh_.vertex_count(), 0);
  const auto add = [&](const Mover& mover) {
    moves_[mover.vertex] = static_cast<std::uint32_t>(mover_.size());
    mover_.push_back(mover);
    mesh_.position[mover.vertex] = mover.home;
  };
  for (const Edge& edge : off_) add({.vertex = edge.middle, .start = mesh_.position[edge.middle], .home = mesh_.position[edge.middle], .a = edge.a, .b = edge.b});
  for (const Edge& edge : edge_) {
    const Vec3 &a = mesh_.position[edge.a], &b = mesh_.position[edge.b];
    mesh_.normal[edge.middle] = mesh_.normal[edge.a];
    const bool smooth = of_.on_crease[edge.a] == 0 && of_.on_crease[edge.b] == 0;
    add({.vertex = edge.middle,
         .start = smooth ? curved_middle(a, mesh_.normal[edge.a], b, mesh_.normal[edge.b]) : Vec3(0.5 * (a + b)),
         .home = 0.5 * (a + b),
         .a = edge.a,
         .b = edge.b});
  }
}

bool Round::is_near(const Vec3& p) const {
  constexpr double kShare = 0.1;  // of the error
  Vec3 slope;
  const double value = field_.value(p, slope);
  return std::abs(value) < kShare * goal_ * slope.norm();
}

/// Where the edge of a mover crosses a crease, not near an end; of an edge between two places of creases, beside its middle.
std::optional<Foot> Round::crease_on(const Mover& mover) const {
  constexpr double kCosine = 0.97, kNearEnd = 0.2, kBeside = 0.125;  // of 14 degrees; of the edge
  const auto foot_of = [&](std::uint32_t v) { return Foot{mesh_.position[v], mesh_.normal[v]}; };
  const Foot a = foot_of(mover.a), b = foot_of(mover.b);
  const int ends = of_.on_crease[mover.a] + of_.on_crease[mover.b];
  if (ends == 1) return std::nullopt;
  if (ends == 0) {
    if (a.normal.dot(b.normal) > kCosine) return std::nullopt;
    const std::optional<Crease> crease = find_crease(field_, a, b);
    if (!crease || crease->at < kNearEnd || crease->at > 1.0 - kNearEnd) return std::nullopt;
    return crease->foot;
  }
  const Vec3 aside = kBeside * (b.point - a.point).cross(a.normal + b.normal).normalized() * (b.point - a.point).norm();
  const Projection one = project_to_surface(field_, mover.home - aside), other = project_to_surface(field_, mover.home + aside);
  if (!one.converged || !other.converged || one.normal.dot(other.normal) > kCosine) return std::nullopt;
  const std::optional<Crease> crease = find_crease(field_, {one.point, one.normal}, {other.point, other.normal});
  return crease ? std::optional(crease->foot) : std::nullopt;
}

/// Where a mover goes, if it reaches the surface. Reads the mesh alone.
void Round::find_foot(Mover& mover) const {
  mover.foot = crease_on(mover);
  mover.on_crease = mover.foot && (mover.foot->point - mover.home).squaredNorm() <= reach_ * reach_;
  if (mover.on_crease) return;
  const Projection foot = project_to_surface(field_, mover.start);
  // In a valley Newton's method may go to and fro between its sides.
  const bool reaches = (foot.converged || is_near(foot.point)) && (foot.point - mover.home).squaredNorm() <= reach_ * reach_;
  mover.foot = reaches ? std::optional(Foot{foot.point, foot.normal}) : std::nullopt;
}

void Round::move() {
  executor_.for_blocks(mover_.size(), kTrianglesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) find_foot(mover_[i]);
  });
  for (Mover& mover : mover_) {
    if (!mover.foot) {
      put_back(mover);
      continue;
    }
    mesh_.position[mover.vertex] = mover.foot->point;
    mesh_.normal[mover.vertex] = mover.foot->normal;
    of_.on_crease[mover.vertex] = mover.on_crease ? 1 : 0;
    mover.moved = true;
  }
}

void Round::put_back(Mover& mover) {
  mesh_.position[mover.vertex] = mover.home;
  of_.on_crease[mover.vertex] = 0;
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
    const std::size_t k = at_end[t[0]] + at_end[t[1]] + at_end[t[2]] < 2 ? 0 : longest_edge(of_, t);
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
    if (is_inverted(of_, t)) add_farthest(std::span(&t, 1), back);
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
    if (!mover.moved) off_.push_back({mover.a, mover.b, mover.vertex});
  }
}

/// Measures the triangles whose error is negative: centroid_error, and where a vertex is not on the surface, the distance to the point that
/// Newton's method leads to. Of `every` triangles one, from `first` on.
void measure(const FieldView& field, Measured& of, const Executor& executor, std::size_t first = 0, std::size_t every = 1) {
  std::vector<std::uint8_t> is_off(of.mesh.vertex_count(), 0);
  for (const Edge& edge : of.off) is_off[edge.middle] = 1;
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

const Mesh* LocalDivision::divide(const FieldView& field, const Mesh& from, double goal, std::size_t most, const Executor& executor, std::size_t on_creases) {
  SUPPLE_EXPECTS(on_creases <= from.vertex_count());
  mesh_ = from;
  double reach2 = 0.0;
  for (const Corners& t : mesh_.triangle) {
    for (std::size_t k = 0; k < 3; ++k) reach2 = std::max(reach2, (mesh_.position[t[k]] - mesh_.position[t[next(k)]]).squaredNorm());
  }
  Measured of{mesh_, std::vector<double>(mesh_.triangle_count(), -1.0), {}, std::vector<std::uint8_t>(mesh_.vertex_count(), 0)};
  std::fill(of.on_crease.end() - static_cast<std::ptrdiff_t>(on_creases), of.on_crease.end(), std::uint8_t{1});
  const auto coarse = [&](std::size_t n) { return of.error[n] >= 0.0 && is_coarse(of, n, goal); };
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
  const auto coarse_area = [&] {
    double twice = 0.0;
    for (std::size_t n = 0; n < mesh_.triangle_count(); ++n) twice += coarse(n) ? twice_area(mesh_, mesh_.triangle[n]) : 0.0;
    return 0.5 * twice;
  };
  // Across a crease they get twice as many in each round, and half as wide.
  constexpr double kGain = 0.35;  // of the area in two rounds: a quarter, and what may be lost where they are divided anew beside it
  double last = std::numeric_limits<double>::infinity(), before = last;  // area of the coarse triangles before the last two rounds
  for (; count_coarse() > 0; measure(field, of, executor)) {
    const double area = coarse_area();
    if (area >= kGain * std::exchange(before, std::exchange(last, area))) return nullptr;  // some do not reach the surface
    Round round(field, executor, goal, std::sqrt(reach2), of);
    if (round.triangle_count() > most) return nullptr;
    round.divide();
  }
  error_ = of.error.empty() ? 0.0 : *std::max_element(of.error.begin(), of.error.end());
  return &mesh_;
}

}  // namespace supple::implicit
