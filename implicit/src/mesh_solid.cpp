#include "supple/implicit/mesh_solid.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "single_part.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kBand = 6.0;    // cells outside the mesh in which distances are kept
constexpr double kMargin = kBand + 2.0;
constexpr double kCellsAlong = 64.0;
constexpr double kMostHollow = 0.15;  // share of the mesh's area: edges of 90 degrees of a cube eight cells wide have less
constexpr double kThin = 1.8, kThick = 3.7;  // cells that plates have at least: which are there, and whose faces do not feel what lies beyond the middle
constexpr double kMostTried = 8e6;    // cells of a lattice that nobody asked for

/// The mesh's triangles for OpenVDB, in index space.
struct Triangles {
  const Mesh& mesh;
  Vec3 origin;
  double voxel;
  [[nodiscard]] std::size_t polygonCount() const { return mesh.triangle.size(); }
  [[nodiscard]] std::size_t pointCount() const { return mesh.position.size(); }
  [[nodiscard]] static std::size_t vertexCount(std::size_t) { return 3; }
  void getIndexSpacePoint(std::size_t face, std::size_t corner, openvdb::Vec3d& out) const {
    const Vec3 x = (mesh.position[mesh.triangle[face][corner]] - origin) / voxel;
    out = openvdb::Vec3d(x.x(), x.y(), x.z());
  }
};

/// Weights of the uniform cubic B-spline at t in [0, 1] for the nodes -1 .. 2, and their slopes.
struct Weights {
  std::array<double, 4> value, slope;
  explicit Weights(double t) {
    const double s = 1.0 - t;
    value = {s * s * s / 6.0, (3.0 * t * t * (t - 2.0) + 4.0) / 6.0, (3.0 * s * s * (s - 2.0) + 4.0) / 6.0, t * t * t / 6.0};
    slope = {-0.5 * s * s, 0.5 * t * (3.0 * t - 4.0), -0.5 * s * (3.0 * s - 4.0), 0.5 * t * t};
  }
};

[[noreturn]] void refuse(const std::string& key, const std::string& expected, const std::string& found, const std::string& hint) {
  throw Error(ErrorKind::Scene, Fault{.place = {}, .key = key, .expected = expected, .found = found, .hint = hint});
}

std::string shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// The same surface with one vertex at each place, without triangles that this closes up.
Mesh welded(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.position.size()), vertex(mesh.position.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto before = [](const Vec3& a, const Vec3& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t i, std::uint32_t j) { return before(mesh.position[i], mesh.position[j]); });
  Mesh joined;
  for (const std::uint32_t i : order) {
    if (joined.position.empty() || mesh.position[i] != joined.position.back()) joined.position.push_back(mesh.position[i]);
    vertex[i] = static_cast<std::uint32_t>(joined.position.size() - 1);
  }
  for (const auto& t : mesh.triangle) {
    const std::array<std::uint32_t, 3> corners{vertex[t[0]], vertex[t[1]], vertex[t[2]]};
    if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]) joined.triangle.push_back(corners);
  }
  return joined;
}

/// Corners of their own for every face, with its normal.
Mesh flat_faces(const Mesh& mesh) {
  Mesh flat;
  for (const auto& triangle : mesh.triangle) {
    const Vec3 &a = mesh.position[triangle[0]], &b = mesh.position[triangle[1]], &c = mesh.position[triangle[2]];
    const Vec3 normal = (b - a).cross(c - a);
    const auto first = static_cast<std::uint32_t>(flat.position.size());
    flat.triangle.push_back({first, first + 1, first + 2});
    for (const Vec3* x : {&a, &b, &c}) {
      flat.position.push_back(*x);
      flat.normal.push_back(normal.norm() > 0.0 ? normal.normalized().eval() : Vec3::UnitZ().eval());
    }
  }
  return flat;
}

/// Signed distances to a mesh [m] on a lattice around it, cut off beyond the band outside.
/// The unit in which floats hold distances of cells of this size [m]: 1, or a power of two where floats end in metres.
double unit_of(double voxel) {
  constexpr double kLeast = 1e-30, kMost = 1e30;
  return voxel >= kLeast && voxel <= kMost ? 1.0 : std::ldexp(1.0, std::ilogb(voxel));
}

struct Distances {
  Vec3 corner = Vec3::Zero();
  std::array<std::size_t, 3> size{};
  std::vector<float> at;  // x fastest, over unit_of(voxel)
  double deepest = 0.0;
};

Distances distances_to(const Mesh& mesh, const Box& box, double voxel) {
  Distances made;
  made.corner = box.lower - Vec3::Constant(kMargin * voxel);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    made.size[axis] = static_cast<std::size_t>(std::ceil(box.extent()[static_cast<Eigen::Index>(axis)] / voxel) + 2.0 * kMargin + 1.0);
  }
  openvdb::initialize();
  const auto transform = openvdb::math::Transform::createLinearTransform(1.0);  // distances in cells
  openvdb::FloatGrid::Ptr grid;
  tbb::task_arena alone(1);  // whatever the number of threads, the same bits
  alone.execute([&] {
    grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(Triangles{mesh, made.corner, voxel}, *transform,
                                                           static_cast<float>(kBand), std::numeric_limits<float>::max());
  });
  const double unit = unit_of(voxel);
  made.at.reserve(made.size[0] * made.size[1] * made.size[2]);
  const auto nodes_of = grid->getConstAccessor();
  for (std::size_t k = 0; k < made.size[2]; ++k) {
    for (std::size_t j = 0; j < made.size[1]; ++j) {
      for (std::size_t i = 0; i < made.size[0]; ++i) {
        const float cells = nodes_of.getValue({static_cast<int>(i), static_cast<int>(j), static_cast<int>(k)});
        const double distance = static_cast<double>(std::min(cells, static_cast<float>(kBand))) * voxel;
        made.at.push_back(static_cast<float>(distance / unit));
        made.deepest = std::max(made.deepest, -distance);
      }
    }
  }
  return made;
}

/// Share of a mesh's area behind which there are fewer cells up to the other side, by points spread evenly over its faces: two thirds of that deep, the
/// surface must be a fifth of it away. @param faces  that do not share corners   @param slope  of the field [1/m]
double hollow_share(const FieldView& solid, const Mesh& faces, double voxel, double slope, double cells) {
  const double deep = 2.0 / 3.0 * cells * voxel, least = 0.2 * cells * voxel * slope;
  double area = 0.0, hollow = 0.0;
  for (std::size_t face = 0; face < faces.triangle.size(); ++face) {
    const Vec3* corner = &faces.position[3 * face];
    const Vec3 u = corner[1] - corner[0], v = corner[2] - corner[0], normal = faces.normal[3 * face];
    const double whole = 0.5 * u.cross(v).norm();
    const double count = std::ceil(whole / (voxel * voxel));
    area += whole;
    for (double k = 0.0; k < count; ++k) {
      double s = std::fmod(1.0 / 3.0 + k * 0.7548776662466927, 1.0), t = std::fmod(1.0 / 3.0 + k * 0.5698402909980532, 1.0);
      if (s + t > 1.0) {
        s = 1.0 - s;
        t = 1.0 - t;
      }
      const Vec3 at = corner[0] + s * u + t * v;
      // On either side, as faces need not point outwards.
      if (solid.value(at - deep * normal) < least && solid.value(at + deep * normal) < least) hollow += whole / count;
    }
  }
  return area > 0.0 ? hollow / area : 1.0;
}

}  // namespace

MeshSolid::MeshSolid(const Mesh& given, const MeshSolidOptions& options) : mesh_(flat_faces(given)), slope_(options.slope) {
  SUPPLE_EXPECTS(options.slope > 0.0 && options.voxel >= 0.0);
  const Mesh mesh = welded(given);
  const MeshReport report = inspect(mesh);
  if (mesh.triangle.empty() || !report.closed) {
    refuse("mesh", "expected a closed surface, every edge between two triangles",
           mesh.triangle.empty() ? "no triangle" : "an edge with another number of them", "close its holes");
  }
  Box box;
  for (const Vec3& x : mesh.position) box.include(x);
  const Vec3 extent = box.extent();
  voxel_ = options.voxel > 0.0 ? options.voxel : extent.maxCoeff() / kCellsAlong;
  if (!(voxel_ > 0.0)) refuse("mesh", "expected a mesh with an extent", "all vertices at one place", "");
  const auto nodes = [&](double h) { return ((extent / h).array().ceil() + 2.0 * kMargin + 1.0).prod(); };
  const auto most = static_cast<double>(options.max_voxels);
  if (nodes(voxel_) > most) {
    double fits = voxel_;
    while (nodes(fits) > most) fits *= 1.1;
    refuse("voxel", "expected at most " + std::to_string(options.max_voxels) + " cells around the mesh",
           shown(nodes(voxel_)) + " with a voxel of " + shown(voxel_) + " m", "a voxel of " + shown(fits) + " m would fit");
  }
  const auto sample = [&](double h) {
    Distances made = distances_to(mesh, box, voxel_ = h);
    corner_ = made.corner;
    size_ = made.size;
    distance_ = std::move(made.at);
    deepest_ = made.deepest;
  };
  const auto hollow_share_of = [&](double cells) { return hollow_share(*this, mesh_, voxel_, slope_, cells); };
  const double first = voxel_;
  sample(first);
  const double hollow = hollow_share_of(kThin);
  // As fine as thin parts ask for, or as there is room for.
  const double enough = options.voxel > 0.0 ? kThin : kThick;
  while (hollow_share_of(enough) > kMostHollow) {
    // As a message shows it: what it names was tried.
    const double finer = std::stod(shown(0.5 * std::min(voxel_, extent.maxCoeff())));
    if (nodes(finer) > std::min(most, kMostTried)) break;
    sample(finer);
  }
  const bool solid = hollow_share_of(kThin) <= kMostHollow;
  if (!solid || (options.voxel > 0.0 && voxel_ != first)) {
    refuse("voxel", "expected cells small enough for an inside behind the whole mesh",
           "none behind " + shown(100.0 * hollow) + " % of its area with a voxel of " + shown(first) + " m",
           solid ? "a voxel of " + shown(voxel_) + " m would do"
                 : "parts of it are too thin for a voxel of " + shown(voxel_) + " m, the finest tried: make them thicker, or try finer ones");
  }
  box_ = box.inflated(2.0 * voxel_);  // the spline mixes nodes of two cells around
}

double MeshSolid::evaluate(const Vec3& point, Vec3* gradient) const {
  std::array<std::size_t, 3> first{};
  std::array<double, 3> t{};
  std::array<bool, 3> beyond{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double last = static_cast<double>(size_[axis]) - 3.0;
    const double u = (point[static_cast<Eigen::Index>(axis)] - corner_[static_cast<Eigen::Index>(axis)]) / voxel_;
    const double inside = std::clamp(u, 1.0, last);
    beyond[axis] = inside != u;
    const double cell = std::min(std::floor(inside), last - 1.0);
    first[axis] = static_cast<std::size_t>(cell) - 1;
    t[axis] = inside - cell;
  }
  const Weights x(t[0]), y(t[1]), z(t[2]);
  double value = 0.0;
  Vec3 slope = Vec3::Zero();
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t b = 0; b < 4; ++b) {
      const float* row = &distance_[index(first[0], first[1] + b, first[2] + c)];
      double line = 0.0, along = 0.0;
      for (std::size_t a = 0; a < 4; ++a) {
        line += x.value[a] * static_cast<double>(row[a]);
        along += x.slope[a] * static_cast<double>(row[a]);
      }
      const double weight = y.value[b] * z.value[c];
      value += weight * line;
      slope += Vec3(weight * along, y.slope[b] * z.value[c] * line, y.value[b] * z.slope[c] * line);
    }
  }
  const double unit = unit_of(voxel_);
  if (gradient != nullptr) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (beyond[axis]) slope[static_cast<Eigen::Index>(axis)] = 0.0;
    }
    *gradient = (-slope_ / (voxel_ / unit)) * slope;
  }
  return -slope_ * (value * unit);
}

void MeshSolid::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], nullptr);
}

void MeshSolid::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], &gradients[i]);
}

void MeshSolid::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { evaluate_single_part(*this, points, parts); }

Interval MeshSolid::bound(const Box& box) const {
  const double most = slope_ * deepest_;  // a spline lies between its coefficients
  const double least = -slope_ * kBand * voxel_ * (1.0 + 1e-6);
  if (!box.lower.allFinite() || !box.upper.allFinite()) return {least, most};
  const double way = gradient_bound(box) * 0.5 * box.extent().norm();
  const double value = evaluate(box.centre(), nullptr);
  const double round_off = 1e-12 * slope_ * (deepest_ + kBand * voxel_);
  return {std::max(value - way - round_off, least - round_off), std::min(value + way, most) + round_off};
}

/// Neighbouring nodes differ by at most a cell, so each partial derivative of the spline is at most 1.
double MeshSolid::gradient_bound(const Box&) const { return slope_ * std::sqrt(3.0) * (1.0 + 1e-4); }

}  // namespace supple::implicit
