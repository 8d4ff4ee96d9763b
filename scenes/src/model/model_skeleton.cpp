#include "model/model_skeleton.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Jacobi>

#include "model/model_contact.h"
#include "model/model_volume.h"
#include "supple/core/arrange.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/implicit/convolution.h"

namespace supple::scenes {
namespace {

implicit::ShapeKind shape_of(ShapeName name) {
  switch (name) {
    case ShapeName::Point: return implicit::ShapeKind::Point;
    case ShapeName::Segment: return implicit::ShapeKind::Segment;
    case ShapeName::Square:
    case ShapeName::Rectangle: return implicit::ShapeKind::Rectangle;
    case ShapeName::Disc: return implicit::ShapeKind::Disc;
    case ShapeName::Box: return implicit::ShapeKind::Box;
    case ShapeName::Ellipsoid: break;
    case ShapeName::Triangle: return implicit::ShapeKind::Triangle;
    case ShapeName::Polygon: return implicit::ShapeKind::Polygon;
    case ShapeName::Ring: return implicit::ShapeKind::Ring;
    case ShapeName::Arc: return implicit::ShapeKind::Arc;
    case ShapeName::Curve: return implicit::ShapeKind::Curve;
    case ShapeName::Superquadric: return implicit::ShapeKind::Superquadric;
    case ShapeName::Directed: return implicit::ShapeKind::Directed;
  }
  return implicit::ShapeKind::Ellipsoid;
}

Vec3 size_of(const SkeletonDesc& d) {
  switch (d.shape) {
    case ShapeName::Point: return Vec3::Zero();
    case ShapeName::Segment: return {d.half_length, 0.0, 0.0};
    case ShapeName::Square: return {d.half_size, d.half_size, 0.0};
    case ShapeName::Rectangle: return {d.half_sizes.x(), d.half_sizes.y(), 0.0};
    case ShapeName::Disc:
    case ShapeName::Ring: return {d.radius, 0.0, 0.0};
    case ShapeName::Arc: return {d.radius, d.half_angle, 0.0};
    case ShapeName::Box: return d.half_sizes;
    case ShapeName::Triangle:
    case ShapeName::Polygon:
    case ShapeName::Curve: return Vec3::Zero();
    case ShapeName::Directed: return d.radii;
    case ShapeName::Ellipsoid:
    case ShapeName::Superquadric: break;
  }
  return d.semi_axes;
}

/// Smallest radius or semi-axis of a support that its shape gives; 0 for the others.
double own_radius(const SkeletonDesc& d) {
  switch (d.shape) {
    case ShapeName::Ellipsoid:
    case ShapeName::Superquadric: return d.semi_axes.minCoeff();
    case ShapeName::Directed:
      return d.radii_behind.isZero() ? d.radii.minCoeff() : std::min(d.radii.minCoeff(), d.radii_behind.minCoeff());
    default: return 0.0;
  }
}

/// @throws Error where the kernel's numbers do not fit together
implicit::Kernel kernel_of(const KernelDesc& d, double radius, double iso) {
  using implicit::Kernel;
  switch (d.type) {
    case KernelName::Wyvill: break;
    case KernelName::Gascuel: return Kernel::gascuel(d.thickness.value_or(0.0), radius, d.slope.value_or(0.0), iso);
    case KernelName::SoftObject: return Kernel::soft_object(radius);
    case KernelName::Murakami: return Kernel::murakami(radius);
    case KernelName::Nishimura: return Kernel::nishimura(radius);
    case KernelName::Blinn: return Kernel::blinn(radius, d.sharpness);
    case KernelName::Cauchy: return Kernel::cauchy(radius, d.sharpness);
    case KernelName::BlancSchlick: return Kernel::blanc_schlick(radius, d.hardness);
  }
  return Kernel::wyvill(radius);
}

/// Whether moments are principal, within their accuracy.
bool has_no_products(const Mat3& moments) {
  constexpr double kKnown = 1e-4;
  const double largest = std::max({std::abs(moments(0, 1)), std::abs(moments(0, 2)), std::abs(moments(1, 2))});
  return largest <= kKnown * moments.trace();
}

/// The mean of x x^T over a solid, in axes turned by `turn` [m^2]; zero where no surface is found. @param cells  at least, along its box
Mat3 second_moments(const implicit::Skeleton& solid, const Quat& turn, int cells) {
  const Pose pose{Vec3::Zero(), turn.conjugate()};
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(solid, {&pose, 1}, placed);
  implicit::index_field(solid, placed, field);
  Box box = field.surface_box();
  if (box.empty()) return Mat3::Zero();
  // As fine as it takes to meet solids that are thin askew of the axes, whose box is then drawn closer.
  constexpr int kMostCells = 256;
  constexpr double kEnough = 400.0, kTight = 0.5;
  Mat3 sum = Mat3::Zero();
  double inside = 0.0;
  while (cells <= kMostCells) {
    const Vec3 cell = box.extent() / cells;
    std::vector<Vec3> point;
    std::vector<double> value;
    Box met;
    sum.setZero();
    inside = 0.0;
    for (int k = 0; k < cells; ++k) {
      heed_scope();
      point.clear();
      for (int j = 0; j < cells; ++j) {
        for (int i = 0; i < cells; ++i) point.emplace_back(box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5)));
      }
      value.resize(point.size());
      implicit::FieldView(field).evaluate(point, value);
      for (std::size_t s = 0; s < point.size(); ++s) {
        if (!(value[s] > 0.0)) continue;
        sum += point[s] * point[s].transpose();
        inside += 1.0;
        met.include(point[s] - cell);
        met.include(point[s] + cell);
      }
    }
    const bool tight = inside == 0.0 || (met.extent().array() >= kTight * box.extent().array()).all();
    if (!tight) {
      box = met;
    } else if (inside < kEnough) {
      cells *= 2;
    } else {
      break;
    }
  }
  return inside > 0.0 ? Mat3(sum / inside) : sum;
}

/// The rotation to axes in which symmetric moments have no products, by Jacobi's rotations: among these it is a near one.
Quat principal_axes(Mat3 moments) {
  if (has_no_products(moments)) return Quat::Identity();
  Mat3 axes = Mat3::Identity();
  constexpr int kSweeps = 8;  // convergence is quadratic
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (const auto& [p, q] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
      Eigen::JacobiRotation<double> turn;
      turn.makeJacobi(moments, p, q);
      moments.applyOnTheLeft(p, q, turn.adjoint());
      moments.applyOnTheRight(p, q, turn);
      axes.applyOnTheRight(p, q, turn);
    }
  }
  return Quat(axes).normalized();
}

/// Convolved primitives may reach less than their kernels do, even together.
void check_reach(const ObjectDesc& d, const std::string& object, const implicit::Skeleton& skeleton, ModelFaults& faults) {
  if (skeleton.primitive.empty() || d.volume) return;  // which scales the kernels
  std::vector<double> sum(skeleton.part_count, 0.0);
  for (const implicit::Primitive& primitive : skeleton.primitive) sum[d.separate ? primitive.part : 0] += implicit::peak(primitive);
  const double most = *std::max_element(sum.begin(), sum.end());
  if (d.iso < most) return;
  faults.add(object + ".iso", "expected an iso value in (0, " + short_text(most) + "), which the field can reach", number_text(d.iso),
             "the field of a convolved primitive is larger where it is longer or wider relative to kernel.radius");
}

}  // namespace

std::optional<std::uint32_t> particle_index(int given, std::uint32_t n, const std::string& key, ModelFaults& faults) {
  const std::int64_t index = given < 0 ? std::int64_t{given} + n : given;
  if (index >= 0 && index < n) return static_cast<std::uint32_t>(index);
  faults.add(key, particle_range(n), std::to_string(given), "");
  return std::nullopt;
}

implicit::Skeleton build_skeleton(const ObjectDesc& d, const std::string& object, std::uint32_t n, std::vector<double>& volume,
                                  ModelFaults& faults) {
  implicit::Skeleton skeleton;
  std::vector<std::pair<implicit::Primitive, double>> all;
  skeleton.part_count = n;
  skeleton.iso = d.iso;
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    const SkeletonDesc& s = d.skeleton[k];
    const std::string key = object + ".skeleton[" + std::to_string(k) + ']';
    // For an ellipsoid and its like the radius is but the scale of the kernel.
    const double radius = s.kernel.radius == 0.0 ? own_radius(s) : s.kernel.radius;
    implicit::Primitive primitive;
    primitive.shape = shape_of(s.shape);
    primitive.size = size_of(s);
    primitive.control = s.points;
    if (s.shape == ShapeName::Directed) primitive.control = {s.radii_behind.isZero() ? s.radii : s.radii_behind};
    primitive.exponent = {s.exponents.x(), s.exponents.y()};
    primitive.stretch = s.stretch;
    primitive.convolved = s.convolve;
    if (s.end_radius > 0.0) primitive.taper = s.end_radius / radius;
    primitive.offset = {s.at, core::rotation_exp(s.turn * s.turn_axis.normalized())};
    try {
      primitive.kernel = kernel_of(s.kernel, radius, d.iso);
    } catch (const Error& error) {
      const Fault& fault = error.faults().front();
      faults.add(key + '.' + fault.key, fault.expected, fault.found, fault.hint);
      continue;
    }
    if (s.volume) check_volume(primitive, *s.volume, key + ".volume", faults);
    std::vector<std::uint32_t> carriers;
    for (std::size_t j = 0; j < s.particles.size(); ++j) {
      const std::string place = key + ".particles[" + std::to_string(j) + ']';
      const auto index = particle_index(s.particles[j], n, place, faults);
      if (!index) continue;
      if (std::find(carriers.begin(), carriers.end(), *index) != carriers.end()) {
        faults.add(place, "expected each particle once", std::to_string(s.particles[j]), "");
      } else {
        carriers.push_back(*index);
      }
    }
    if (s.particles.empty()) {
      carriers.resize(n);
      std::iota(carriers.begin(), carriers.end(), 0U);
    }
    for (const std::uint32_t part : carriers) {
      primitive.part = part;
      all.emplace_back(primitive, s.volume.value_or(0.0));
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first.part < b.first.part; });
  for (const auto& [primitive, held] : all) {
    skeleton.primitive.push_back(primitive);
    volume.push_back(held);
  }
  check_reach(d, object, skeleton, faults);
  return skeleton;
}

implicit::Blend blend_of(const BlendDesc& d, const std::string& key, std::span<const Vec3> rest, ModelFaults& faults) {
  constexpr std::array kRules{implicit::BlendRule::Sum, implicit::BlendRule::Graph, implicit::BlendRule::Ricci,
                              implicit::BlendRule::Gradient};
  implicit::Blend blend;
  blend.rule = kRules[static_cast<std::size_t>(d.rule)];
  blend.exponent = d.exponent;
  blend.opening = d.opening;
  const auto n = static_cast<std::uint32_t>(rest.size());
  constexpr std::uint32_t kNone = 0xffffffff;
  blend.node.assign(n, kNone);
  std::uint32_t nodes = 0;
  for (std::size_t k = 0; k < d.groups.size(); ++k, ++nodes) {
    for (std::size_t j = 0; j < d.groups[k].particles.size(); ++j) {
      const std::string place = key + ".groups[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']';
      const auto index = particle_index(d.groups[k].particles[j], n, place, faults);
      if (!index) continue;
      if (blend.node[*index] != kNone) {
        faults.add(place, "expected a particle of no other group", std::to_string(d.groups[k].particles[j]), "");
      } else {
        blend.node[*index] = nodes;
      }
    }
  }
  for (std::uint32_t& node : blend.node) {
    if (node == kNone) node = nodes++;
  }
  if (blend.rule != implicit::BlendRule::Graph) return blend;
  const auto join = [&](const core::Bonds& bonds) {
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const auto [low, high] = std::minmax(blend.node[bonds.first[b]], blend.node[bonds.second[b]]);
      if (low != high) blend.edge.push_back({low, high, 1.0});
    }
  };
  if (d.neighbours) join(core::bonds_along(0, n, *d.neighbours));
  if (d.within) join(core::bonds_within(rest, 0, n, *d.within));
  const auto before = [](const implicit::BlendEdge& a, const implicit::BlendEdge& b) {
    return std::pair(a.a, a.b) < std::pair(b.a, b.b);
  };
  const auto same = [](const implicit::BlendEdge& a, const implicit::BlendEdge& b) { return a.a == b.a && a.b == b.b; };
  std::sort(blend.edge.begin(), blend.edge.end(), before);
  blend.edge.erase(std::unique(blend.edge.begin(), blend.edge.end(), same), blend.edge.end());
  return blend;
}

BlendComponents blend_components(const implicit::Blend& blend, std::uint32_t parts) {
  BlendComponents out;
  out.first.assign(parts, 0);
  if (blend.rule != implicit::BlendRule::Graph) return out;
  const std::uint32_t nodes = blend.node.empty() ? 0 : *std::max_element(blend.node.begin(), blend.node.end()) + 1;
  std::vector<std::uint32_t> root(nodes);
  std::iota(root.begin(), root.end(), 0U);
  const auto root_of = [&root](std::uint32_t k) {
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  for (const implicit::BlendEdge& e : blend.edge) root[root_of(e.a)] = root_of(e.b);
  std::vector<std::uint32_t> first(nodes, parts);
  for (std::uint32_t i = 0; i < parts; ++i) {
    std::uint32_t& least = first[root_of(blend.node[i])];
    least = std::min(least, i);
    out.first[i] = least;
  }
  std::vector<std::uint32_t> size(nodes, 0), joined(nodes, 1);  // nodes of components, and those that a node blends with, itself one of them
  for (std::uint32_t k = 0; k < nodes; ++k) ++size[root_of(k)];
  for (const implicit::BlendEdge& e : blend.edge) {
    ++joined[e.a];
    ++joined[e.b];
  }
  std::vector<std::uint8_t> seen(nodes, 0);
  for (std::uint32_t i = 0; i < parts; ++i) {
    const std::uint32_t k = blend.node[i];
    if (seen[k]++ == 0 && joined[k] < size[root_of(k)]) out.group.push_back(i);
  }
  return out;
}

CarriedSolid carried_solid(const implicit::Skeleton& object, std::uint32_t part, bool own_axes) {
  const auto before = [](const implicit::Primitive& a, std::uint32_t b) { return a.part < b; };
  implicit::Skeleton own{.primitive = {}, .part_count = 1, .iso = object.iso, .blend = {}};
  for (auto p = std::lower_bound(object.primitive.begin(), object.primitive.end(), part, before);
       p != object.primitive.end() && p->part == part; ++p) {
    own.primitive.push_back(*p);
    own.primitive.back().part = 0;
  }
  if (own.primitive.empty()) return {};
  const implicit::Primitive& first = own.primitive.front();
  const bool ball = own.primitive.size() == 1 && first.shape == implicit::ShapeKind::Point && !first.convolved &&
                    first.stretch == Vec3::Ones() && first.offset.position.isZero();
  if (ball) return {Vec3::Constant(iso_radius(first, own.iso)), Quat::Identity()};
  constexpr int kCells = 32;
  // Found along the axes of the first shape and, where the solid lies askew to them, again along its own: there its box is tight.
  Quat turn = first.offset.orientation;
  Mat3 moments = second_moments(own, turn, kCells);
  if (const Quat askew = principal_axes(moments); !askew.isApprox(Quat::Identity(), 0.0)) {
    turn = (turn * askew).normalized();
    moments = second_moments(own, turn, 2 * kCells);  // ends across an axis lie anywhere in a cell
  }
  const Mat3 m = turn.toRotationMatrix();
  const Mat3 along_own = m * moments * m.transpose();
  const bool kept = own_axes || has_no_products(along_own);
  if (kept) return {(5.0 * along_own.diagonal()).cwiseSqrt(), Quat::Identity()};
  return {(5.0 * moments.diagonal()).cwiseSqrt(), turn};
}

void turn_primitives(std::span<const Quat> turn, implicit::Skeleton& skeleton) {
  for (implicit::Primitive& primitive : skeleton.primitive) {
    const Quat back = turn[primitive.part].conjugate();
    if (back.w() == 1.0) continue;
    primitive.offset = {back * primitive.offset.position, (back * primitive.offset.orientation).normalized()};
  }
}

}  // namespace supple::scenes
