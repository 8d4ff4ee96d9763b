#include "solids/closed_surface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <optional>
#include <string>

#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"

namespace supple::implicit {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

constexpr double kTouching = 1e-7;        // of the mesh's size: nearer triangles touch
constexpr double kPieces = 1.0 / 512.0;   // of the mesh's size: longest edge of the pieces of crossing triangles
constexpr std::size_t kMostPieces = 1U << 20;

[[noreturn]] void refuse(const std::string& expected, const std::string& found, const std::string& hint) {
  throw Error(ErrorKind::Scene, Fault{.place = {}, .key = "mesh", .expected = expected, .found = found, .hint = hint});
}

/// Triangles over vertices that are all used and at different positions.
struct Welded {
  std::vector<Vec3> position;
  std::vector<std::uint32_t> given;  // the first vertex of the mesh at each place
  std::vector<Triangle> triangle;    // without those that have two corners at one place
};

Welded welded(const Mesh& mesh) {
  std::vector<std::uint32_t> order;
  for (const Triangle& t : mesh.triangle) order.insert(order.end(), t.begin(), t.end());
  std::sort(order.begin(), order.end());
  order.erase(std::unique(order.begin(), order.end()), order.end());
  const auto before = [](const Vec3& a, const Vec3& b) { return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3); };
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t j) { return before(mesh.position[i], mesh.position[j]); });
  Welded out;
  std::vector<std::uint32_t> vertex(mesh.position.size());
  for (const std::uint32_t i : order) {
    if (out.position.empty() || mesh.position[i] != out.position.back()) {
      out.position.push_back(mesh.position[i]);
      out.given.push_back(i);
    }
    vertex[i] = static_cast<std::uint32_t>(out.position.size() - 1);
  }
  for (const Triangle& t : mesh.triangle) {
    const Triangle corner{vertex[t[0]], vertex[t[1]], vertex[t[2]]};
    if (corner[0] != corner[1] && corner[1] != corner[2] && corner[2] != corner[0]) out.triangle.push_back(corner);
  }
  return out;
}

/// A side of a triangle: whether it runs from its lower vertex to its higher one.
struct Side {
  std::uint32_t low, high, triangle;
  bool ascending;
};

/// By vertices; the sides of an edge are neighbours.
std::vector<Side> sides_of(const std::vector<Triangle>& triangle) {
  std::vector<Side> sides;
  sides.reserve(3 * triangle.size());
  for (std::uint32_t t = 0; t < triangle.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[t][k], b = triangle[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.low != y.low ? x.low < y.low : x.high != y.high ? x.high < y.high : x.triangle < y.triangle;
  });
  return sides;
}

/// Calls use(first, last) for the sides of each edge.
template <class Use>
void each_edge(const std::vector<Side>& sides, const Use& use) {
  for (std::size_t begin = 0; begin < sides.size();) {
    std::size_t end = begin + 1;
    while (end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high) ++end;
    use(begin, end);
    begin = end;
  }
}

std::string edge_text(const Welded& mesh, const Side& side) {
  const auto given = std::minmax(mesh.given[side.low], mesh.given[side.high]);
  const bool swapped = given.first != mesh.given[side.low];
  const Vec3 &a = mesh.position[swapped ? side.high : side.low], &b = mesh.position[swapped ? side.low : side.high];
  char text[240];
  std::snprintf(text, sizeof text, "the edge between vertices %zu and %zu, counted from 1, at (%.6g, %.6g, %.6g) and (%.6g, %.6g, %.6g)",
                std::size_t{given.first} + 1, std::size_t{given.second} + 1, a.x(), a.y(), a.z(), b.x(), b.y(), b.z());
  return text;
}

/// That every edge is between two triangles, or more in pairs.
void expect_closed(const Welded& mesh, const std::vector<Side>& sides) {
  std::size_t open = 0, first = sides.size();
  each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if ((end - begin) % 2 == 0) return;
    ++open;
    if (first == sides.size() || sides[begin].triangle < sides[first].triangle) first = begin;
  });
  if (open == 0) return;
  std::size_t count = 1;
  while (first + count < sides.size() && sides[first + count].low == sides[first].low && sides[first + count].high == sides[first].high) ++count;
  const std::string others = open == 1 ? "" : "; " + std::to_string(open - 1) + (open == 2 ? " other edge is" : " other edges are") + " open, too";
  refuse("expected a closed surface, every edge between two triangles",
         (count == 1 ? "one triangle" : counted(count, "triangle")) + " at " + edge_text(mesh, sides[first]) + others,
         "close its holes, so that it has an inside");
}

/// For each triangle the first one that it is connected to by edges of two triangles that `counts` holds for.
template <class Counts>
std::vector<std::uint32_t> joined(std::size_t triangles, const std::vector<Side>& sides, const Counts& counts) {
  std::vector<std::uint32_t> parent(triangles);
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  each_edge(sides, [&](std::size_t begin, std::size_t end) {
    const std::uint32_t s = sides[begin].triangle, t = sides[begin + 1].triangle;
    if (end - begin != 2 || !counts(s) || !counts(t)) return;
    const auto [low, high] = std::minmax({root(s), root(t)});
    parent[high] = low;
  });
  for (std::uint32_t t = 0; t < triangles; ++t) parent[t] = root(t);
  return parent;
}

/// Reverses shells that intersect others so that all are oriented outward: a shell that is cut bounds no cavity.
/// @return number of reversed triangles
std::size_t turn_crossing_shells(Welded& mesh, const std::vector<Side>& sides, const std::vector<std::uint8_t>& crosses) {
  const std::vector<std::uint32_t> shell = joined(mesh.triangle.size(), sides, [](std::uint32_t) { return true; });
  std::vector<double> volume(mesh.triangle.size(), 0.0);
  std::vector<std::uint8_t> cut(mesh.triangle.size(), 0);
  for (std::uint32_t t = 0; t < mesh.triangle.size(); ++t) {
    const Triangle& c = mesh.triangle[t];
    const Vec3& origin = mesh.position[mesh.triangle[shell[t]][0]];
    volume[shell[t]] += (mesh.position[c[0]] - origin).dot((mesh.position[c[1]] - origin).cross(mesh.position[c[2]] - origin));
    cut[shell[t]] = std::max(cut[shell[t]], crosses[t]);
  }
  std::size_t count = 0;
  for (std::uint32_t t = 0; t < mesh.triangle.size(); ++t) {
    if (cut[shell[t]] == 0 || volume[shell[t]] >= 0.0) continue;
    std::swap(mesh.triangle[t][1], mesh.triangle[t][2]);
    ++count;
  }
  return count;
}

/// Reverses triangles that are oriented against most of those that they are connected to by edges of two triangles.
/// @return number of reversed triangles
std::size_t agree(Welded& mesh, const std::vector<Side>& sides) {
  struct Neighbour {
    std::uint32_t triangle;
    bool agrees;
  };
  std::vector<std::vector<Neighbour>> near(mesh.triangle.size());
  bool all = true;
  each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin != 2) return;
    const Side &one = sides[begin], &other = sides[begin + 1];
    const bool agrees = one.ascending != other.ascending;
    all = all && agrees;
    near[one.triangle].push_back({other.triangle, agrees});
    near[other.triangle].push_back({one.triangle, agrees});
  });
  if (all) return 0;
  const auto area = [&](std::uint32_t t) {
    const Triangle& c = mesh.triangle[t];
    return (mesh.position[c[1]] - mesh.position[c[0]]).cross(mesh.position[c[2]] - mesh.position[c[0]]).norm();
  };
  constexpr std::uint8_t kUnknown = 2;
  std::vector<std::uint8_t> turned(mesh.triangle.size(), kUnknown);
  std::vector<std::uint32_t> shell;
  std::size_t count = 0;
  for (std::uint32_t seed = 0; seed < mesh.triangle.size(); ++seed) {
    if (turned[seed] != kUnknown) continue;
    turned[seed] = 0;
    shell.assign(1, seed);
    double as_given = 0.0, other_way = 0.0;
    for (std::size_t i = 0; i < shell.size(); ++i) {
      const std::uint32_t t = shell[i];
      (turned[t] == 0 ? as_given : other_way) += area(t);
      for (const Neighbour& n : near[t]) {
        const std::uint8_t wanted = n.agrees ? turned[t] : static_cast<std::uint8_t>(1 - turned[t]);
        if (turned[n.triangle] == kUnknown) {
          turned[n.triangle] = wanted;
          shell.push_back(n.triangle);
        } else if (turned[n.triangle] != wanted) {
          const auto edge = std::find_if(sides.begin(), sides.end(), [&](const Side& s) {
            const Triangle& c = mesh.triangle[n.triangle];
            return s.triangle == t && std::count(c.begin(), c.end(), s.low) + std::count(c.begin(), c.end(), s.high) == 2;
          });
          refuse("expected a surface with two sides", "a one-sided one, like a Klein bottle: its orientation reverses at " + edge_text(mesh, *edge), "");
        }
      }
    }
    for (const std::uint32_t t : shell) {
      if ((turned[t] != 0) == (as_given >= other_way)) {
        std::swap(mesh.triangle[t][1], mesh.triangle[t][2]);
        ++count;
      }
    }
  }
  return count;
}

/// That along edges of more than two triangles as many run one way as the other.
void expect_balanced(const Welded& mesh, const std::vector<Side>& sides) {
  each_edge(sides, [&](std::size_t begin, std::size_t end) {
    const auto ascending = std::count_if(sides.begin() + static_cast<std::ptrdiff_t>(begin), sides.begin() + static_cast<std::ptrdiff_t>(end),
                                         [](const Side& s) { return s.ascending; });
    if (2 * static_cast<std::size_t>(ascending) == end - begin) return;
    refuse("expected triangles that are all oriented the same way around the solid",
           std::to_string(end - begin) + " triangles, of which " + std::to_string(ascending) + " run along it one way, at " + edge_text(mesh, sides[begin]),
           "separate the shells that meet there, or reverse triangles");
  });
}

/// Smallest distance of two segments is at most `reach` (Ericson 2005, "Real-Time Collision Detection", sec. 5.1.9).
bool segments_touch(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, double reach) {
  const Vec3 u = q - p, v = b - a, r = p - a;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v), ur = u.dot(r), vr = v.dot(r);
  const double det = uu * vv - uv * uv;
  double s = det > 0.0 ? std::clamp((uv * vr - ur * vv) / det, 0.0, 1.0) : 0.0;
  double t = vv > 0.0 ? (uv * s + vr) / vv : 0.0;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = uu > 0.0 ? std::clamp((uv * t - ur) / uu, 0.0, 1.0) : 0.0;
  }
  return (r + s * u - t * v).squaredNorm() <= reach * reach;
}

/// Corners of a triangle, and its unit normal.
struct Flat {
  std::array<Vec3, 3> corner;
  Vec3 normal;
  [[nodiscard]] double height(const Vec3& x) const { return normal.dot(x - corner[0]); }
  /// Whether a point of its plane lies on it, or at most `reach` outside.
  [[nodiscard]] bool holds(const Vec3& x, double reach) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 along = corner[(k + 1) % 3] - corner[k];
      if (normal.cross(along).dot(x - corner[k]) < -reach * along.norm()) return false;
    }
    return true;
  }
};

/// Whether the edges of s come within `reach` of the face or the edges of t. Faces in one plane do not count; their neighbours do.
/// @param shared  a corner that both have by their mesh: edges of s that end there are left out; null: none
bool touches(const Flat& s, const Flat& t, double reach, const Vec3* shared) {
  std::array<double, 3> height;
  for (std::size_t k = 0; k < 3; ++k) height[k] = t.height(s.corner[k]);
  const auto [least, most] = std::minmax_element(height.begin(), height.end());
  if (*least > reach || *most < -reach || (*least >= -reach && *most <= reach)) return false;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    const Vec3 &p = s.corner[k], &q = s.corner[next];
    if (shared != nullptr && (p == *shared || q == *shared)) continue;
    if (std::min(height[k], height[next]) > reach || std::max(height[k], height[next]) < -reach) continue;
    if (std::abs(height[k]) <= reach && t.holds(p, reach)) return true;
    if (height[k] * height[next] < 0.0 && t.holds(p + height[k] / (height[k] - height[next]) * (q - p), reach)) return true;
    for (std::size_t e = 0; e < 3; ++e) {
      if (segments_touch(p, q, t.corner[e], t.corner[(e + 1) % 3], reach)) return true;
    }
  }
  return false;
}

/// Finds which triangles, or pieces of them, touch others; those that share an edge do not.
class Touching {
 public:
  Touching(const Welded& mesh, const TriangleTree& tree, double reach) : mesh_(mesh), tree_(tree), reach_(reach) {}

  [[nodiscard]] Flat flat(std::uint32_t t) const {
    const Triangle& c = mesh_.triangle[t];
    return {{mesh_.position[c[0]], mesh_.position[c[1]], mesh_.position[c[2]]}, tree_.normal(t)};
  }
  /// Which triangles do.
  [[nodiscard]] std::vector<std::uint8_t> find() const {
    std::vector<std::uint8_t> found(mesh_.triangle.size(), 0);
    for (std::uint32_t t = 0; t < found.size(); ++t) {
      heed_scope();
      const Flat whole = flat(t);
      found[t] = !whole.normal.isZero() && any(t, whole) ? 1 : 0;
    }
    return found;
  }
  /// @param piece  of the triangle `of`
  [[nodiscard]] bool any(std::uint32_t of, const Flat& piece) const {
    Box box;
    for (const Vec3& x : piece.corner) box.include(x);
    box = box.inflated(reach_);
    bool found = false;
    tree_.each_near(box, [&](std::uint32_t t) {
      if (found) return;
      const Flat other = flat(t);
      Box around;
      for (const Vec3& x : other.corner) around.include(x);
      if (!around.overlaps(box)) return;
      const Vec3* shared = nullptr;
      std::size_t count = 0;
      for (const std::uint32_t v : mesh_.triangle[of]) {
        const Triangle& c = mesh_.triangle[t];
        if (v != c[0] && v != c[1] && v != c[2]) continue;
        shared = &mesh_.position[v];
        ++count;
      }
      found = count < 2 && (touches(piece, other, reach_, shared) || touches(other, piece, reach_, shared));
    });
    return found;
  }

 private:
  const Welded& mesh_;
  const TriangleTree& tree_;
  double reach_;
};

/// Sorts out which triangles bound the solid, and parts those that do so in places only.
class Boundary {
 public:
  Boundary(const Welded& mesh, ClosedSurface& out, double size)
      : mesh_(mesh), out_(out), touching_(mesh, *out.around, kTouching * size), step_(0.5 * kTouching * size), smallest_(kPieces * size) {}

  /// @param crosses  of each triangle: whether it touches others
  void find(const std::vector<Side>& sides, const std::vector<std::uint8_t>& crosses) {
    out_.position = mesh_.position;
    const auto count = static_cast<std::uint32_t>(mesh_.triangle.size());
    // On each side of a part of a shell that no other triangles cross all is inside, or all is outside.
    const std::vector<std::uint32_t> shell = joined(mesh_.triangle.size(), sides, [&](std::uint32_t t) {
      return crosses[t] == 0 && !touching_.flat(t).normal.isZero();
    });
    std::vector<std::optional<Place>> of_shell(count);
    for (std::uint32_t t = 0; t < count; ++t) {
      heed_scope();
      const Flat whole = touching_.flat(t);
      if (whole.normal.isZero()) continue;  // its edges are those of others
      if (crosses[t] != 0) {
        part(t, whole);
        continue;
      }
      std::optional<Place>& place = of_shell[shell[t]];
      if (!place) place = place_of(whole);
      add(t, whole, *place, false);
    }
    drop_unused();
  }

 private:
  enum class Place { OutsideAhead, OutsideBehind, Within };

  [[nodiscard]] Place place_of(const Flat& piece) const {
    const Vec3 middle = (piece.corner[0] + piece.corner[1] + piece.corner[2]) / 3.0;
    const bool ahead = is_around(*out_.around, middle + step_ * piece.normal), behind = is_around(*out_.around, middle - step_ * piece.normal);
    return ahead == behind ? Place::Within : ahead ? Place::OutsideBehind : Place::OutsideAhead;
  }

  /// Adds a triangle, or a piece of one, if it lies between inside and outside.
  void add(std::uint32_t of, const Flat& piece, Place place, bool crosses) {
    if (place == Place::Within) return;
    Triangle corner = mesh_.triangle[of];
    if (crosses) {
      for (std::size_t k = 0; k < 3; ++k) {
        corner[k] = static_cast<std::uint32_t>(out_.position.size());
        out_.position.push_back(piece.corner[k]);
      }
    }
    if (place == Place::OutsideBehind) std::swap(corner[1], corner[2]);
    out_.triangle.push_back(corner);
    out_.crossing.push_back(crosses ? 1 : 0);
  }

  /// Halves the longest edge of pieces that touch others, until they are small.
  void part(std::uint32_t of, const Flat& whole) {
    std::vector<Flat> pieces{whole};
    while (!pieces.empty()) {
      heed_scope();
      const Flat piece = pieces.back();
      pieces.pop_back();
      std::size_t longest = 0;
      const auto length = [&](std::size_t k) { return (piece.corner[(k + 1) % 3] - piece.corner[k]).norm(); };
      for (std::size_t k = 1; k < 3; ++k) longest = length(k) > length(longest) ? k : longest;
      const bool touches_others = touching_.any(of, piece);
      if (!touches_others || length(longest) <= smallest_ || out_.triangle.size() >= kMostPieces) {
        if (touches_others) out_.deviation = std::max(out_.deviation, length(longest));
        add(of, piece, place_of(piece), true);
        continue;
      }
      const Vec3 &a = piece.corner[longest], &b = piece.corner[(longest + 1) % 3], &c = piece.corner[(longest + 2) % 3];
      const Vec3 middle = 0.5 * (a + b);
      pieces.push_back({{middle, b, c}, piece.normal});
      pieces.push_back({{a, middle, c}, piece.normal});
    }
  }

  void drop_unused() {
    std::vector<std::uint32_t> number(out_.position.size(), 0);
    for (const Triangle& t : out_.triangle) {
      for (const std::uint32_t v : t) number[v] = 1;
    }
    std::size_t count = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (number[v] == 0) continue;
      out_.position[count] = out_.position[v];
      number[v] = static_cast<std::uint32_t>(count++);
    }
    out_.position.resize(count);
    for (Triangle& t : out_.triangle) {
      for (std::uint32_t& v : t) v = number[v];
    }
  }

  const Welded& mesh_;
  ClosedSurface& out_;
  Touching touching_;
  double step_;      // to either side of a triangle [m]
  double smallest_;  // longest edge of pieces that are parted no further [m]
};

}  // namespace

bool is_around(const TriangleTree& tree, const Vec3& x) { return std::abs(tree.winding_number(x)) > 0.5; }

ClosedSurface closed_surface(const Mesh& given) {
  Welded mesh = welded(given);
  if (mesh.triangle.empty()) refuse("expected a closed surface, every edge between two triangles", "no triangle", "");
  ClosedSurface out;
  std::vector<Side> sides = sides_of(mesh.triangle);
  expect_closed(mesh, sides);
  out.turned = agree(mesh, sides);
  if (out.turned > 0) sides = sides_of(mesh.triangle);
  expect_balanced(mesh, sides);
  Box box;
  for (const Vec3& x : mesh.position) box.include(x);
  const double size = box.extent().maxCoeff();
  out.around = std::make_shared<const TriangleTree>(mesh.position, mesh.triangle);
  std::vector<std::uint8_t> crosses = Touching(mesh, *out.around, kTouching * size).find();
  out.crossing_before = static_cast<std::size_t>(std::count(crosses.begin(), crosses.end(), 1));
  if (const std::size_t turned = turn_crossing_shells(mesh, sides, crosses); turned > 0) {
    out.turned += turned;
    sides = sides_of(mesh.triangle);
    out.around = std::make_shared<const TriangleTree>(mesh.position, mesh.triangle);
  }
  Boundary(mesh, out, size).find(sides, crosses);
  if (out.triangle.empty()) refuse("expected a closed surface with an inside", "one that encloses nothing", "make it thicker");
  return out;
}

}  // namespace supple::implicit
