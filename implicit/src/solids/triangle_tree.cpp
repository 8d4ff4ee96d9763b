#include "solids/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "supple/core/error.h"
#include "supple/core/interrupt.h"

namespace supple::implicit {
namespace {

/// Solid angle of a triangle seen from the origin, > 0 from behind (van Oosterom & Strackee 1983, eq. 8).
double solid_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

TriangleTree::TriangleTree(std::span<const Vec3> position, std::span<const std::array<std::uint32_t, 3>> triangle) : count_(triangle.size()) {
  SUPPLE_EXPECTS(count_ < kLeaf);
  Box box;
  std::vector<Face> given;
  std::vector<std::uint32_t> order;
  for (std::uint32_t t = 0; t < count_; ++t) {
    Face face{.corner = {position[triangle[t][0]], position[triangle[t][1]], position[triangle[t][2]]}, .normal = {}, .inward = {}, .inverse_square = {}, .triangle = t};
    const Vec3 across = (face.corner[1] - face.corner[0]).cross(face.corner[2] - face.corner[0]);
    const double area = across.norm();
    face.normal = area > 0.0 ? Vec3(across / area) : Vec3::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 along = face.corner[(k + 1) % 3] - face.corner[k];
      face.inward[k] = face.normal.cross(along);
      face.inverse_square[k] = 1.0 / along.squaredNorm();
      box.include(face.corner[k]);
    }
    if (area > 0.0) order.push_back(t);
    given.push_back(face);
  }
  if (order.empty()) {
    place_.assign(count_, 0);
    face_.push_back({.corner = {}, .normal = Vec3::Zero(), .inward = {}, .inverse_square = {}, .triangle = 0});
    return;
  }
  origin_ = box.centre();
  constexpr double kRounding = 1e-6;  // of single precision, over the size of the mesh, with room to spare
  unit_ = std::ldexp(1.0, std::ilogb(box.extent().maxCoeff()));
  pad_ = kRounding * 0.5 * (box.extent() / unit_).norm();
  place_.assign(count_, static_cast<std::uint32_t>(order.size()));
  face_.reserve(order.size() + 1);
  root_ = build(order, 0, given);
  for (const std::uint32_t t : order) {
    place_[t] = static_cast<std::uint32_t>(face_.size());
    face_.push_back(given[t]);
  }
  // The target of triangles without area.
  face_.push_back({.corner = {}, .normal = Vec3::Zero(), .inward = {}, .inverse_square = {}, .triangle = 0});
}

/// Parts faces at medians along the longest side of their middles. @param first  place of the first of them in `face_`   @return the new node
std::uint32_t TriangleTree::build(std::span<std::uint32_t> faces, std::uint32_t first, std::span<const Face> given) {
  heed_scope();
  const auto middle = [&](std::uint32_t t) -> Vec3 { return (given[t].corner[0] + given[t].corner[1] + given[t].corner[2]) / 3.0; };
  const auto halve = [&](std::size_t begin, std::size_t end) {
    if (end - begin <= kWide) return end;
    Box box;
    for (std::size_t i = begin; i < end; ++i) box.include(middle(faces[i]));
    Eigen::Index axis = 0;
    box.extent().maxCoeff(&axis);
    std::sort(faces.begin() + static_cast<std::ptrdiff_t>(begin), faces.begin() + static_cast<std::ptrdiff_t>(end), [&](std::uint32_t s, std::uint32_t t) {
      const double at_s = middle(s)[axis], at_t = middle(t)[axis];
      return at_s != at_t ? at_s < at_t : s < t;
    });
    return begin + (end - begin + 2 * kWide - 1) / (2 * kWide) * kWide;  // leaves are full
  };
  std::array<std::size_t, kWide + 1> part{};
  part[kWide] = faces.size();
  for (std::size_t step = kWide / 2; step > 0; step /= 2) {
    for (std::size_t c = 0; c < kWide; c += 2 * step) part[c + step] = halve(part[c], part[c + 2 * step]);
  }
  const auto at = static_cast<std::uint32_t>(node_.size());
  node_.emplace_back();
  dipole_.emplace_back();
  for (std::size_t c = 0; c < kWide; ++c) {
    const std::span<std::uint32_t> own = faces.subspan(part[c], part[c + 1] - part[c]);
    Box box;
    Dipole dipole;
    double weight = 0.0;
    for (const std::uint32_t t : own) {
      const Face& face = given[t];
      for (const Vec3& x : face.corner) box.include(x);
      const double area = 0.5 * (face.corner[1] - face.corner[0]).cross(face.corner[2] - face.corner[0]).norm();
      weight += area;
      dipole.centre += area * middle(t);
      dipole.area += area * face.normal;
    }
    if (!own.empty()) dipole.centre /= weight;
    for (const std::uint32_t t : own) {
      for (const Vec3& x : given[t].corner) dipole.radius = std::max(dipole.radius, (x - dipole.centre).norm());
    }
    const std::uint32_t begin = first + static_cast<std::uint32_t>(part[c]);
    const std::uint32_t child = own.empty() ? kNone : own.size() > kWide ? build(own, begin, given) : add_leaf(own, begin, given);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      constexpr float kFar = std::numeric_limits<float>::infinity();
      node_[at].lower[k][c] = own.empty() ? kFar : static_cast<float>((box.lower[axis] - origin_[axis]) / unit_ - pad_);
      node_[at].upper[k][c] = own.empty() ? -kFar : static_cast<float>((box.upper[axis] - origin_[axis]) / unit_ + pad_);
    }
    node_[at].child[c] = child;
    dipole_[at][c] = dipole;
  }
  return at;
}

/// Faces that are not there are copies of the last one.
std::uint32_t TriangleTree::add_leaf(std::span<const std::uint32_t> faces, std::uint32_t first, std::span<const Face> given) {
  Leaf leaf{};
  leaf.first = first;
  leaf.count = static_cast<std::uint32_t>(faces.size());
  for (std::size_t i = 0; i < kWide; ++i) {
    const Face& face = given[faces[std::min(i, faces.size() - 1)]];
    for (std::size_t j = 0; j < 3; ++j) {
      const auto axis = static_cast<Eigen::Index>(j);
      for (std::size_t k = 0; k < 3; ++k) {
        leaf.corner[k][j][i] = static_cast<float>((face.corner[k][axis] - origin_[axis]) / unit_);
        leaf.along[k][j][i] = static_cast<float>((face.corner[(k + 1) % 3][axis] - face.corner[k][axis]) / unit_);
        leaf.inward[k][j][i] = static_cast<float>(face.inward[k][axis] / unit_);
      }
      leaf.inverse_square[j][i] = static_cast<float>(face.inverse_square[j] * unit_ * unit_);
      leaf.normal[j][i] = static_cast<float>(face.normal[axis]);
    }
  }
  leaf_.push_back(leaf);
  return kLeaf | static_cast<std::uint32_t>(leaf_.size() - 1);
}

/// Squared distances to the faces of a leaf, but for rounding: to the plane over a face, to the nearest edge elsewhere.
TriangleTree::Lanes TriangleTree::squares(const Leaf& leaf, const std::array<float, 3>& at) {
  const auto dot = [](const std::array<Lanes, 3>& a, const std::array<Lanes, 3>& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const auto from = [&](const std::array<Lanes, 3>& corner) { return std::array<Lanes, 3>{at[0] - corner[0], at[1] - corner[1], at[2] - corner[2]}; };
  const Lanes zero{}, one = zero + 1.0F;
  const Lanes height = dot(from(leaf.corner[0]), leaf.normal);
  Lanes nearest = zero + std::numeric_limits<float>::infinity(), within = nearest;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::array<Lanes, 3>& along = leaf.along[k];
    const std::array<Lanes, 3> y = from(leaf.corner[k]);
    const Lanes inward = dot(y, leaf.inward[k]);
    within = inward < within ? inward : within;
    Lanes t = dot(y, along) * leaf.inverse_square[k];
    t = t > zero ? t : zero;
    t = t < one ? t : one;
    const std::array<Lanes, 3> way{y[0] - t * along[0], y[1] - t * along[1], y[2] - t * along[2]};
    const Lanes square = dot(way, way);
    nearest = square < nearest ? square : nearest;
  }
  // Where rounding decides what lies over a face, both are the same but for rounding.
  return within >= zero ? height * height : nearest;
}

/// The nearest point lies on the face, or on an edge beyond which x lies.
inline void TriangleTree::look_at(const Face& face, const Vec3& x, TriangleSite& best) {
  const auto take = [&](double square, std::uint8_t feature, double height, const Vec3& from) {
    if (square > best.square || (square == best.square && face.triangle >= best.triangle)) return;
    best = {square, face.triangle, feature, height, from};
  };
  bool within = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 y = x - face.corner[k];
    if (y.dot(face.inward[k]) >= 0.0) continue;
    within = false;
    const std::size_t next = k == 2 ? 0 : k + 1;
    const Vec3 along = face.corner[next] - face.corner[k];
    const double t = y.dot(along) * face.inverse_square[k];
    if (t <= 0.0) take(y.squaredNorm(), static_cast<std::uint8_t>(TriangleSite::kCorner + k), 0.0, y);
    else if (const Vec3 z = x - face.corner[next]; t >= 1.0) take(z.squaredNorm(), static_cast<std::uint8_t>(TriangleSite::kCorner + next), 0.0, z);
    else if (const Vec3 from = y - t * along; true) take(from.squaredNorm(), static_cast<std::uint8_t>(TriangleSite::kEdge + k), 0.0, from);
  }
  if (!within) return;
  const double height = face.normal.dot(x - face.corner[0]);
  take(height * height, TriangleSite::kFace, height, Vec3::Zero());
}

TriangleSite TriangleTree::nearest(const Vec3& x) const {
  TriangleSite best;
  if (root_ == kNone) return best;
  thread_local std::uint32_t last = 0;  // points of successive queries lie close together
  look_at(face_[last < face_.size() - 1 ? last : 0], x, best);
  constexpr float kBelow = 1.0F - 1e-5F;  // more than single precision loses of a squared distance
  constexpr double kAbove = 1.0 + 1e-5;
  std::array<float, 3> at;
  constexpr double kFar = 1e18;  // units: the squares of what is farther do not fit; seen from there the mesh is a point
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    at[k] = static_cast<float>(std::clamp((x[axis] - origin_[axis]) / unit_, -kFar, kFar));
  }
  const double scale = 1.0 / (unit_ * unit_);
  struct Entry {
    float square;
    std::uint32_t child;
  };
  std::array<Entry, std::tuple_size_v<Stack>> stack;
  stack[0] = {0.0F, root_};
  for (std::size_t n = 1; n > 0;) {
    const Entry entry = stack[--n];
    if (static_cast<double>(entry.square) > best.square * scale) continue;
    if ((entry.child & kLeaf) != 0) {
      const Leaf& leaf = leaf_[entry.child & ~kLeaf];
      const Lanes square = squares(leaf, at);
      const double reach = (std::sqrt(best.square * scale) + pad_) * kAbove;
      const auto most = static_cast<float>(reach * reach);
      for (std::uint32_t i = 0; i < leaf.count; ++i) {
        if (square[i] <= most) look_at(face_[leaf.first + i], x, best);
      }
      continue;
    }
    const Node& node = node_[entry.child];
    Lanes square{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Lanes below = node.lower[k] - at[k], above = at[k] - node.upper[k];
      Lanes over = below > above ? below : above;
      over = over > Lanes{} ? over : Lanes{};
      square += over * over;
    }
    const std::size_t begin = n;
    const double most = best.square * scale;
    for (std::size_t c = 0; c < kWide; ++c) {
      const float least = square[c] * kBelow;
      if (node.child[c] == kNone || static_cast<double>(least) > most) continue;
      std::size_t i = n++;  // the nearest is tested first
      for (; i > begin && stack[i - 1].square < least; --i) stack[i] = stack[i - 1];
      stack[i] = {least, node.child[c]};
    }
  }
  last = place_[best.triangle];
  return best;
}

double TriangleTree::winding_number(const Vec3& x, std::uint32_t without) const {
  if (root_ == kNone) return 0.0;
  constexpr double kFarAway = 2.0;  // radii
  double angle = 0.0;
  Stack stack;
  stack[0] = root_;
  for (std::size_t n = 1; n > 0;) {
    const std::uint32_t at = stack[--n];
    for (std::size_t c = 0; c < kWide; ++c) {
      const std::uint32_t child = node_[at].child[c];
      if (child == kNone) continue;
      const Dipole& dipole = dipole_[at][c];
      const Vec3 way = dipole.centre - x;
      const double distance = way.norm();
      if (distance > kFarAway * dipole.radius) {
        angle += dipole.area.dot(way) / (distance * distance * distance);
      } else if ((child & kLeaf) == 0) {
        stack[n++] = child;
      } else {
        const Leaf& leaf = leaf_[child & ~kLeaf];
        for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) {
          const Face& face = face_[i];
          if (face.triangle != without) angle += solid_angle(face.corner[0] - x, face.corner[1] - x, face.corner[2] - x);
        }
      }
    }
  }
  return angle / (4.0 * std::numbers::pi);
}

}  // namespace supple::implicit
