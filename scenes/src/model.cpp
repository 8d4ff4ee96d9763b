#include "supple/scenes/model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <optional>

#include "fields_rules.h"
#include "model_contact.h"
#include "model_faults.h"
#include "supple/core/arrange.h"
#include "supple/core/error.h"
#include "supple/core/io/mesh_files.h"

namespace supple::scenes {
namespace {

/// Cells across the thinnest surface: a plate then has about a hundred triangles across its rounded rim.
constexpr double kCellsAcross = 8.0;   // lattice cells across the smallest surface thickness
constexpr double kCellsAlong = 64.0;   // at least, along the largest side of an object with its supports

constexpr double kBelievable = 1e4;     // ways of a particle over the size of everything, and over that in a frame
constexpr double kVolumeCell = 0.125;   // of the iso radius: cells that measure a held volume

core::NormalDirection direction_of(NormalKind normal) {
  return normal == NormalKind::Radial ? core::NormalDirection::Radial : core::NormalDirection::Axis;
}

/// The shortest rotation from z to a direction.
Quat from_z_to(const Vec3& direction) {
  const Vec3 a = direction.normalized();
  if (a.z() < -1.0 + 1e-12) return Quat(0.0, 1.0, 0.0, 0.0);
  return Quat(1.0 + a.z(), -a.y(), a.x(), 0.0).normalized();
}

core::Arrangement arrange(const Scene& scene, const ParticlesDesc& d, const std::string& key) {
  core::Arrangement out;
  switch (d.arrange) {
    case ArrangeKind::Single: out = core::arrange_single(); break;
    case ArrangeKind::Line: out = core::arrange_line(d.count, d.spacing); break;
    case ArrangeKind::Ring: out = core::arrange_ring(d.count, d.radius, direction_of(d.normal)); break;
    case ArrangeKind::Grid: out = core::arrange_grid(d.columns, d.rows, d.spacing, d.layers); break;
    case ArrangeKind::Spiral:
      out = core::arrange_spiral(d.count, d.inner_radius, d.outer_radius, d.turns, direction_of(d.normal));
      break;
    case ArrangeKind::Geodesic: out = core::arrange_geodesic(d.frequency, d.radius); break;
    case ArrangeKind::File:
      out.position = read_for(key + ".file", [&] { return io::read_points_csv(scene.source.parent_path() / d.file); });
      out.orientation.assign(out.position.size(), Quat::Identity());
      break;
  }
  if (d.disorder > 0.0) core::disorder(out, d.disorder);
  core::place(out, Pose{d.at, from_z_to(d.axis) * core::rotation_exp(d.angle * Vec3::UnitZ())});
  return out;
}

/// Distance of each point to its nearest neighbour; infinite for a single one. Sweeps along the longest extent.
std::vector<double> nearest_distances(std::span<const Vec3> points) {
  Box box;
  for (const Vec3& p : points) box.include(p);
  Eigen::Index axis = 0;
  if (!points.empty()) box.extent().maxCoeff(&axis);
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return points[a][axis] != points[b][axis] ? points[a][axis] < points[b][axis] : a < b;
  });
  std::vector<double> nearest(points.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Vec3& here = points[order[i]];
    double& least = nearest[order[i]];
    for (std::size_t j = i + 1; j < order.size() && points[order[j]][axis] - here[axis] < least; ++j) {
      least = std::min(least, (points[order[j]] - here).norm());
    }
    for (std::size_t j = i; j > 0 && here[axis] - points[order[j - 1]][axis] < least; --j) {
      least = std::min(least, (points[order[j - 1]] - here).norm());
    }
  }
  return nearest;
}

/// Largest distance of two points: pairs in falling order of their distances from the centre, cut when none can win.
double largest_distance(std::span<const Vec3> points) {
  if (points.empty()) return 0.0;
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : points) centre += p;
  centre /= static_cast<double>(points.size());
  std::vector<Vec3> sorted(points.begin(), points.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const Vec3& a, const Vec3& b) { return (a - centre).squaredNorm() > (b - centre).squaredNorm(); });
  double largest = 0.0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const double reach = (sorted[i] - centre).norm();
    if (2.0 * reach <= largest) break;
    for (std::size_t j = i + 1; j < sorted.size() && reach + (sorted[j] - centre).norm() > largest; ++j) {
      largest = std::max(largest, (sorted[i] - sorted[j]).norm());
    }
  }
  return largest;
}

/// Index of a particle of an object of n, negative from the end.
std::optional<std::uint32_t> particle_index(int given, std::uint32_t n) {
  const std::int64_t index = given < 0 ? std::int64_t{given} + n : given;
  if (index < 0 || index >= n) return std::nullopt;
  return static_cast<std::uint32_t>(index);
}

void fail_index(ModelFaults& faults, const std::string& key, int given, std::uint32_t n) {
  faults.add(key, particle_range(n), std::to_string(given), "");
}

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

/// @param volume  receives what the scene says each primitive holds, or 0 [m^3]
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
    if (!(d.iso > 0.0 && d.iso < implicit::peak(primitive.kernel))) {
      faults.add(object + ".iso",
                 "expected an iso value in (0, " + number_text(implicit::peak(primitive.kernel)) + "), which a kernel reaches",
                 number_text(d.iso), "");
      continue;
    }
    std::vector<std::uint32_t> carriers;
    for (std::size_t j = 0; j < s.particles.size(); ++j) {
      const std::string place = key + ".particles[" + std::to_string(j) + ']';
      const auto index = particle_index(s.particles[j], n);
      if (!index) {
        fail_index(faults, place, s.particles[j], n);
      } else if (std::find(carriers.begin(), carriers.end(), *index) != carriers.end()) {
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
  return skeleton;
}

/// How the particles of an object blend. @param rest  their places
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
      const auto index = particle_index(d.groups[k].particles[j], n);
      if (!index) {
        fail_index(faults, place, d.groups[k].particles[j], n);
      } else if (blend.node[*index] != kNone) {
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

/// Which particles are hinges, and the types of the others.
void set_kinds(const ObjectDesc& d, const std::string& key, const ObjectModel& object, Model& model, ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  for (std::size_t k = 0; k < d.kinds.size(); ++k) {
    for (std::size_t j = 0; j < d.kinds[k].particles.size(); ++j) {
      if (const auto index = particle_index(d.kinds[k].particles[j], n)) {
        model.particles.kind[object.first + *index] =
            d.kinds[k].hinge ? core::kHinge : static_cast<std::uint32_t>(d.kinds[k].type);
      } else {
        fail_index(faults, key + ".kinds[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']',
                   d.kinds[k].particles[j], n);
      }
    }
  }
}

/// Those bonds whose particles interact completely.
core::Bonds complete_bonds(const core::Bonds& bonds, const core::ParticleSet& set, bool hinges_join) {
  core::Bonds complete;
  for (std::size_t b = 0; b < bonds.first.size(); ++b) {
    if (!core::interact_completely(set.kind[bonds.first[b]], set.kind[bonds.second[b]], hinges_join)) continue;
    complete.first.push_back(bonds.first[b]);
    complete.second.push_back(bonds.second[b]);
  }
  return complete;
}

/// Adds the laws of one object.
class LawBuilder {
 public:
  LawBuilder(Model& model, ModelFaults& faults, const ObjectModel& object, std::string key)
      : model_(model), faults_(faults), object_(object), key_(std::move(key)) {}

  void add(const InteractionDesc& d, std::size_t index) {
    const std::string key = key_ + ".interactions[" + std::to_string(index) + ']';
    if (d.geometric) {
      add_geometric(d, key);
      return;
    }
    const core::Bonds near = d.within ? core::bonds_within(model_.rest.position, object_.first, object_.last, *d.within)
                                      : core::bonds_along(object_.first, object_.last, d.neighbours);
    const core::Bonds bonds = complete_bonds(near, model_.particles, object_.hinges_join);
    if (bonds.first.empty()) {
      faults_.add(key, "expected a bond", "none",
                  !near.first.empty() ? "'kinds' keeps all neighbours apart"
                  : d.within ? "no two particles are nearer than " + number_text(*d.within) + " m"
                           : "the object has a single particle");
      return;
    }
    if (d.law == LawKind::Friction) {
      model_.interactions.friction.push_back({name(d), bonds.first, bonds.second, d.linear, d.angular});
      return;
    }
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      if (model_.rest.position[bonds.first[b]] == model_.rest.position[bonds.second[b]]) {
        faults_.add(key, "expected bonded particles at different places",
                    "particles " + std::to_string(bonds.first[b] - object_.first) + " and " +
                        std::to_string(bonds.second[b] - object_.first) + " at one place",
                    "");
        return;
      }
    }
    add_bonded(d, bonds, key);
  }

 private:
  void add_bonded(const InteractionDesc& d, const core::Bonds& bonds, const std::string& key) {
    const core::Weight weight{.range = d.range.value_or(0.0)};
    core::Interactions& laws = model_.interactions;
    const auto fill_same = [&](auto& list, const auto& law) {
      fill(list, d, bonds, [&](const core::PairPose&) { return law; });
    };
    switch (d.law) {
      case LawKind::Cohesion:
        if (d.table_error) {
          fill(laws.tabulated_cohesion, d, bonds,
               [&](const core::PairPose& rest) { return tabulated(d, cohesion(d, rest.r.norm(), key)); });
        } else {
          fill(laws.cohesion, d, bonds, [&](const core::PairPose& rest) { return cohesion(d, rest.r.norm(), key); });
        }
        break;
      case LawKind::LinearCohesion:
        fill(laws.linear_cohesion, d, bonds, [&](const core::PairPose& rest) { return linear_cohesion(d, rest.r.norm()); });
        break;
      case LawKind::DirectedCohesion:
        fill(laws.directed_cohesion, d, bonds, [&](const core::PairPose& rest) {
          core::DirectedCohesion law{
              .scale = 0.0, .a = d.shape, .semi_axes_a = d.semi_axes, .semi_axes_b = d.semi_axes};
          law.scale = d.scale_force.value_or(0.0) * law.rest_distance(rest);
          return law;
        });
        break;
      case LawKind::LennardJones:
        fill(laws.lennard_jones, d, bonds, [&](const core::PairPose& rest) { return lennard_jones(d, rest.r.norm()); });
        break;
      case LawKind::GayBerne: break;  // geometric only
      case LawKind::Form:
        fill(laws.form, d, bonds, [&](const core::PairPose& rest) {
          return core::Form{d.strength, core::Form::fit_curvature(rest.r, rest.normal_a, rest.normal_b), weight};
        });
        break;
      case LawKind::FormRadius:
        if (d.paper_literal) {
          add_literal_form(d, bonds, weight, key);
        } else {
          fill(laws.form_radius, d, bonds,
               [&](const core::PairPose& rest) { return core::FormRadius{d.strength, radius(rest, key), weight}; });
        }
        break;
      case LawKind::DirectedForm: add_directed_form(d, bonds, weight); break;
      case LawKind::BondFrame:
        fill(laws.bond_frame, d, bonds,
             [&](const core::PairPose& rest) { return core::BondFrame::from_rest(d.stretch, d.rotation, rest); });
        break;
      case LawKind::Coplanarity:
        if (d.normalised) {
          fill_same(laws.normalised_coplanarity, core::NormalisedCoplanarity{d.strength, weight});
        } else {
          fill_same(laws.coplanarity, core::Coplanarity{d.strength, weight});
        }
        break;
      case LawKind::CoNormality: fill_same(laws.co_normality, core::CoNormality{d.strength, weight}); break;
      case LawKind::CoCircularity:
        if (d.normalised) {
          fill_same(laws.normalised_co_circularity, core::NormalisedCoCircularity{d.strength, weight});
        } else {
          fill_same(laws.co_circularity, core::CoCircularity{d.strength, weight});
        }
        break;
      case LawKind::Friction: break;
    }
  }

  /// Between all particles of the object within the range of the law, as their kinds allow.
  void add_geometric(const InteractionDesc& d, const std::string& key) {
    const std::uint32_t object = model_.particles.object[object_.first];
    const auto begin = model_.particles.kind.begin();
    const bool kinds = std::any_of(begin + object_.first, begin + object_.last, [](std::uint32_t k) { return k != 0; });
    const core::PairKinds taken = !kinds                ? core::PairKinds::Any
                                  : object_.hinges_join ? core::PairKinds::CompleteWithHinges
                                                        : core::PairKinds::Complete;
    const auto add_list = [&](auto& lists, double range, const auto& law) {
      lists.push_back(
          {.name = name(d), .object_a = object, .object_b = object, .range = range, .law = law, .kinds = taken});
    };
    core::Interactions& laws = model_.interactions;
    const double r0 = d.rest_distance.value_or(0.0);
    const core::Weight weight{.range = d.range.value_or(0.0)};
    if (d.law == LawKind::GayBerne) {
      const core::SwitchedGayBerne law = gay_berne(d);
      add_list(laws.gay_berne, law.cut_off, law);
    } else if (d.law == LawKind::Coplanarity) {
      add_list(laws.geometric_coplanarity, weight.range, core::Coplanarity{d.strength, weight});
    } else if (d.law == LawKind::CoNormality) {
      add_list(laws.geometric_co_normality, weight.range, core::CoNormality{d.strength, weight});
    } else if (d.law == LawKind::CoCircularity) {
      add_list(laws.geometric_co_circularity, weight.range, core::CoCircularity{d.strength, weight});
    } else if (d.law == LawKind::LennardJones) {
      add_list(laws.geometric_lennard_jones, d.cut_off.value_or(0.0), lennard_jones(d, r0));
    } else if (d.law == LawKind::LinearCohesion) {
      const core::LinearCohesion law = linear_cohesion(d, r0);
      add_list(laws.geometric_linear_cohesion, d.within.value_or(law.influence_radius(kGeometricTail)), law);
    } else {
      const core::Cohesion law = cohesion(d, r0, key);
      const double range = d.within.value_or(law.influence_radius(kGeometricTail));
      if (d.table_error) {
        add_list(laws.geometric_tabulated_cohesion, range, tabulated(d, law));
      } else {
        add_list(laws.geometric_cohesion, range, law);
      }
    }
  }

  core::LinearCohesion linear_cohesion(const InteractionDesc& d, double rest_distance) {
    return {.r0 = d.rest_distance.value_or(rest_distance), .f0 = d.scale_force.value_or(0.0), .a = d.shape, .eta = d.eta};
  }

  core::LennardJones lennard_jones(const InteractionDesc& d, double rest_distance) {
    const double r0 = d.rest_distance.value_or(rest_distance);
    const double n = d.repulsive, m = d.attractive;
    return {.r0 = r0,
            .depth = d.depth.value_or(d.scale_force.value_or(0.0) * r0 * (n - m) / (n * m)),
            .repulsive = d.repulsive,
            .attractive = d.attractive,
            .cut_off = d.cut_off.value_or(0.0),
            .switch_from = d.switch_from.value_or(0.0)};
  }

  static core::SwitchedGayBerne gay_berne(const InteractionDesc& d) {
    const double cut_off = d.cut_off.value_or(0.0);
    return {.ellipsoid = {.epsilon = d.depth.value_or(0.0),
                          .sigma = d.sigma.value_or(2.0 * d.semi_axes.minCoeff()),
                          .gamma = d.gamma,
                          .radii = d.semi_axes,
                          .well = d.wells,
                          .upsilon = d.upsilon,
                          .mu = d.mu},
            .switch_from = d.switch_from.value_or(kGayBerneSwitch * cut_off),
            .cut_off = cut_off};
  }

  /// The table of the law's shape: one for all bonds of that shape.
  core::TabulatedCohesion tabulated(const InteractionDesc& d, const core::Cohesion& law) {
    std::shared_ptr<const core::CohesionTable>& table = tables_[{law.a, *d.table_error}];
    if (!table) {
      table = std::make_shared<const core::CohesionTable>(core::CohesionTable::with_error(law.a, *d.table_error));
    }
    return {.r0 = law.r0, .f0 = law.f0, .table = table};
  }

  /// Each particle's own radius, by least squares over its bonds: R = sum r . dn / sum |dn|^2.
  void add_literal_form(const InteractionDesc& d, const core::Bonds& bonds, const core::Weight& weight,
                        const std::string& key) {
    std::vector<double> along(object_.last - object_.first), squares(object_.last - object_.first);
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const core::PairPose rest = rest_pose(bonds.first[b], bonds.second[b]);
      const Vec3 change = rest.normal_b - rest.normal_a;
      for (const std::uint32_t i : {bonds.first[b], bonds.second[b]}) {
        along[i - object_.first] += rest.r.dot(change);
        squares[i - object_.first] += change.squaredNorm();
      }
    }
    const auto radius_of = [&](std::uint32_t i) {
      if (squares[i - object_.first] > 1e-18) return along[i - object_.first] / squares[i - object_.first];
      fail_flat(key);
      return 0.0;
    };
    core::BondedLaw<core::LiteralForm> list{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      list.law.push_back({d.strength, radius_of(bonds.first[b]), radius_of(bonds.second[b]), weight});
    }
    model_.interactions.literal_form.push_back(std::move(list));
  }

  /// Each particle's shape operator, by least squares over its bonds.
  void add_directed_form(const InteractionDesc& d, const core::Bonds& bonds, const core::Weight& weight) {
    const std::size_t n = object_.last - object_.first;
    std::vector<std::vector<Vec3>> offsets(n), changes(n);
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const core::PairPose rest = rest_pose(bonds.first[b], bonds.second[b]);
      const Vec3 change = rest.normal_b - rest.normal_a;
      offsets[bonds.first[b] - object_.first].push_back(rest.r);
      changes[bonds.first[b] - object_.first].push_back(change);
      offsets[bonds.second[b] - object_.first].push_back(-rest.r);
      changes[bonds.second[b] - object_.first].push_back(-change);
    }
    std::vector<Mat3> shape;
    for (std::size_t k = 0; k < n; ++k) {
      const std::uint32_t i = object_.first + static_cast<std::uint32_t>(k);
      const Mat3 q = model_.rest.orientation[i].toRotationMatrix();
      shape.push_back(q.transpose() *
                      core::fit_shape_operator(q * model_.particles.normal[i], offsets[k], changes[k]) * q);
    }
    core::BondedLaw<core::DirectedForm> list{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      list.law.push_back(
          {d.strength, shape[bonds.first[b] - object_.first], shape[bonds.second[b] - object_.first], weight});
    }
    model_.interactions.directed_form.push_back(std::move(list));
  }

  /// "spiral/bond_frame"; a second law of the same kind is "spiral/bond_frame.2".
  std::string name(const InteractionDesc& d) {
    const int count = ++counts_[static_cast<std::size_t>(d.law)];
    return object_.name + '/' + std::string(name_of(d.law)) + (count > 1 ? '.' + std::to_string(count) : "");
  }

  [[nodiscard]] core::PairPose rest_pose(std::uint32_t a, std::uint32_t b) const {
    return core::pair_pose(model_.particles, model_.rest, a, b);
  }

  template <class Law, class Make>
  void fill(std::vector<core::BondedLaw<Law>>& list, const InteractionDesc& d, const core::Bonds& bonds, const Make& make) {
    core::BondedLaw<Law> law{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      law.law.push_back(make(rest_pose(bonds.first[b], bonds.second[b])));
    }
    list.push_back(std::move(law));
  }

  core::Cohesion cohesion(const InteractionDesc& d, double rest_distance, const std::string& key) {
    const double r0 = d.rest_distance.value_or(rest_distance);
    if (d.gain && d.alpha) return core::Cohesion::from_gain(r0, *d.gain, *d.alpha);
    const double r_m = d.maximum_ratio ? *d.maximum_ratio * r0 : d.maximum_distance.value_or(0.0);
    if (!(r_m > r0) || !(d.maximum_force || d.scale_force)) {
      faults_.add_once(key + ".maximum_distance",
                       "expected more than the rest distance of every bond, " + number_text(r0) + " m here",
                       number_text(r_m), "");
      return {.r0 = r0, .f0 = 1.0};
    }
    if (d.scale_force) return core::Cohesion::from_ratio(r0, r_m / r0, *d.scale_force);
    return core::Cohesion::from_maximum(r0, r_m, *d.maximum_force);
  }

  /// Least squares over the pair: R = r . (n_B - n_A) / |n_B - n_A|^2 (the inverse problem of Form::fit_curvature).
  double radius(const core::PairPose& rest, const std::string& key) {
    const Vec3 change = rest.normal_b - rest.normal_a;
    if (change.norm() < 1e-9) {
      fail_flat(key);
      return 0.0;
    }
    return rest.r.dot(change) / change.squaredNorm();
  }

  void fail_flat(const std::string& key) {
    faults_.add_once(key, "expected normals that differ along every bond for form_radius", "parallel ones",
                     "use 'law: form', which knows flat shapes");
  }

  static constexpr double kGayBerneSwitch = 0.9;  // of the cut-off
  /// |f| at the range of a geometric cohesion over the largest attraction.
  static constexpr double kGeometricTail = 1e-3;

  Model& model_;
  ModelFaults& faults_;
  const ObjectModel& object_;
  std::string key_;
  std::array<int, EnumNames<LawKind>::names.size()> counts_{};
  std::map<std::pair<double, double>, std::shared_ptr<const core::CohesionTable>> tables_;  ///< by a and error
};

/// Principal moments of a solid ellipsoid of these semi-axes, m/5 (b^2 + c^2, ...).
Vec3 principal_moments(double mass, const Vec3& axes) {
  const Vec3 squares = axes.cwiseAbs2();
  return 0.2 * mass * (Vec3::Constant(squares.sum()) - squares);
}

/// Semi-axes of the ellipsoid whose second moments along a particle's axes are those of the solid that it carries alone;
/// exact for a ball, within a hundredth otherwise. Zero without a surface.
Vec3 enclosed_axes(const implicit::Skeleton& object, std::uint32_t part, bool planar) {
  implicit::Skeleton own{.primitive = {}, .part_count = 1, .iso = object.iso, .blend = {}};
  for (const implicit::Primitive& primitive : object.primitive) {
    if (primitive.part == part) own.primitive.push_back(primitive);
    if (primitive.part == part) own.primitive.back().part = 0;
  }
  if (own.primitive.empty()) return Vec3::Zero();
  const implicit::Primitive& first = own.primitive.front();
  const bool ball = own.primitive.size() == 1 && first.shape == implicit::ShapeKind::Point && !first.convolved &&
                    first.stretch == Vec3::Ones() && first.offset.position.isZero();
  if (ball) return Vec3::Constant(iso_radius(first, own.iso));
  const Pose still;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(own, {&still, 1}, placed);
  implicit::index_field(own, placed, field);
  const Box box = field.surface_box();
  if (box.empty()) return Vec3::Zero();
  constexpr int kCells = 32;
  const Vec3 cell = box.extent() / kCells;
  std::vector<Vec3> point;
  for (int k = 0; k < kCells; ++k) {
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) point.emplace_back(box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5)));
    }
  }
  std::vector<double> value(point.size());
  implicit::FieldView(field).evaluate(point, value);
  Vec3 squares = Vec3::Zero();
  double inside = 0.0;
  for (std::size_t s = 0; s < point.size(); ++s) {
    if (!(value[s] > 0.0)) continue;
    squares += point[s].cwiseAbs2();
    inside += 1.0;
  }
  if (inside == 0.0) return Vec3::Zero();
  Vec3 axes2 = 5.0 / inside * squares;
  if (planar) axes2.setConstant(0.5 * (axes2.x() + axes2.y()));  // it turns about z alone
  return axes2.cwiseSqrt();
}

/// Of a ball around the primitive's origin that holds its support.
double largest_radius(const implicit::Primitive& p) {
  const bool plain = p.shape <= implicit::ShapeKind::Ellipsoid && p.taper == 1.0 && p.stretch == Vec3::Ones();
  if (plain) return p.size.norm() + p.kernel.radius;
  const Box box = implicit::support_box(p);
  return box.lower.cwiseAbs().cwiseMax(box.upper).norm();
}

/// Particles of one object.
void add_particles(const Scene& scene, const ObjectDesc& d, const std::string& key, ObjectModel& object, Model& model,
                   ModelFaults& faults) {
  const core::Arrangement arrangement = arrange(scene, d.particles, key + ".particles");
  const auto n = static_cast<std::uint32_t>(arrangement.size());
  object.first = static_cast<std::uint32_t>(model.particles.size());
  object.last = object.first + n;
  if (n == 0) {
    faults.add(key + ".particles.file", "expected at least one particle", "none", "");
    return;
  }
  std::vector<double> volume;
  object.skeleton = build_skeleton(d, key, n, volume, faults);
  if (d.blend) {
    object.skeleton.blend = blend_of(*d.blend, key + ".blend", arrangement.position, faults);
    object.fade = d.blend->fade;
  }
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double iso = iso_radius(primitive, d.iso);
    object.iso_radius = object.iso_radius == 0.0 ? iso : std::min(object.iso_radius, iso);
  }

  if (d.volume && !object.skeleton.primitive.empty()) {
    object.holds_volume = true;
    object.volume = {.rate = d.volume->rate, .damping = d.volume->damping};
    object.volume_cell = kVolumeCell * object.iso_radius;
    object.volume_of = d.volume->of;
    if (object.volume_of != VolumeOfName::Primitive) volume.assign(object.volume_of == VolumeOfName::Particle ? n : 1, 0.0);
    for (double& target : volume) target = target > 0.0 ? target : d.volume->target.value_or(0.0);
    object.target = std::move(volume);
  }

  const std::vector<double> nearest = nearest_distances(arrangement.position);
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : arrangement.position) centre += p;
  centre /= n;  // all masses of an object are equal
  const bool all_alike = std::all_of(d.skeleton.begin(), d.skeleton.end(), [](const SkeletonDesc& s) { return s.particles.empty(); });
  Vec3 lone = Vec3::Zero();
  for (std::uint32_t i = 0; i < n; ++i) {
    Vec3 axes = d.particles.inertia_axes;
    if (d.particles.inertia_radius) {
      axes.setConstant(*d.particles.inertia_radius);
    } else if (axes.isZero() && (n == 1 || d.separate)) {
      if (i == 0 || !all_alike) lone = enclosed_axes(object.skeleton, i, scene.planar);
      axes = lone;
    } else if (axes.isZero()) {
      axes.setConstant(0.5 * nearest[i]);
    }
    if (!(axes.maxCoeff() > 0.0)) {
      faults.add_once(key + ".particles.inertia_radius", "expected a length > 0 [m]", "nothing",
                      n > 1 ? "two particles lie at one place, so give it" : "a single particle without a surface needs it");
    }
    const Vec3 inertia = principal_moments(d.particles.mass, axes);
    const Quat& q = arrangement.orientation[i];
    model.particles.mass.push_back(d.particles.mass);
    model.particles.inertia.push_back(inertia);
    model.particles.normal.push_back(Vec3::UnitZ());
    model.particles.object.push_back(static_cast<std::uint32_t>(model.objects.size()));
    model.particles.pinned.push_back(0);
    model.particles.kind.push_back(0);
    model.initial.position.push_back(arrangement.position[i]);
    model.initial.orientation.push_back(arrangement.orientation[i]);
    model.initial.velocity.push_back(d.particles.velocity + d.particles.spin.cross(arrangement.position[i] - centre));
    model.initial.angular_momentum.emplace_back(q * inertia.cwiseProduct(q.conjugate() * d.particles.spin));
    if (n == 1) object.rest_diameter = 2.0 * (object.iso_radius > 0.0 ? object.iso_radius : axes.maxCoeff());
    model.smallest_length = std::min({model.smallest_length, nearest[i], n == 1 ? 0.5 * object.rest_diameter : nearest[i]});
  }
  if (object.iso_radius > 0.0) model.smallest_length = std::min(model.smallest_length, object.iso_radius);
  if (n > 1) object.rest_diameter = largest_distance(arrangement.position);
}

void add_pins_and_loads(const ObjectDesc& d, const std::string& key, const ObjectModel& object, Model& model,
                        ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  for (std::size_t k = 0; k < d.pins.size(); ++k) {
    const auto index = particle_index(d.pins[k].particle, n);
    if (!index) {
      fail_index(faults, key + ".pins[" + std::to_string(k) + "].particle", d.pins[k].particle, n);
      continue;
    }
    std::uint8_t& pinned = model.particles.pinned[object.first + *index];
    if (d.pins[k].position) pinned |= core::kPinPosition;
    if (d.pins[k].orientation) pinned |= core::kPinOrientation;
  }
  for (std::size_t k = 0; k < d.loads.size(); ++k) {
    const LoadDesc& load = d.loads[k];
    const auto index = particle_index(load.particle, n);
    if (!index) {
      fail_index(faults, key + ".loads[" + std::to_string(k) + "].particle", load.particle, n);
      continue;
    }
    model.interactions.external.push_back(
        {object.first + *index, load.force, load.torque, load.from, load.until, load.ramp});
  }
}

core::LinkRule link_rule(const ObjectDesc& d, std::uint32_t object) {
  core::LinkRule rule{.object = object, .breaking = {}, .yield = {}};
  if (d.breaking) {
    rule.breaking.stretch = d.breaking->stretch.value_or(rule.breaking.stretch);
    rule.breaking.energy = d.breaking->energy.value_or(rule.breaking.energy);
    rule.breaking.force = d.breaking->force.value_or(rule.breaking.force);
    rule.breaking.couple = d.breaking->couple.value_or(rule.breaking.couple);
  }
  if (d.yielding) rule.yield = {d.yielding->energy, d.yielding->time};
  return rule;
}

/// All particles move in one plane z = const.
void confine_to_plane(Model& model, ModelFaults& faults) {
  const double z = model.initial.position.front().z();
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    const double other = model.initial.position[i].z();
    if (other != z) {
      const std::string& name = model.objects[model.particles.object[i]].name;
      faults.add_once("objects." + name + ".particles", "expected all particles at one z in a planar scene",
                      "z = " + number_text(other) + " m beside z = " + number_text(z) + " m",
                      "choose 'at' and 'axis' so that they lie in one horizontal plane, or remove 'planar'");
    }
    model.particles.pinned[i] |= core::kPlanar;
  }
}

/// Pinned particles begin at rest, or the pin would take their momentum in the first step.
void stop_pinned(Model& model) {
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    const std::uint8_t pinned = model.particles.pinned[i];
    model.initial.velocity[i] = core::free_translation(pinned, model.initial.velocity[i]);
    model.initial.angular_momentum[i] = core::free_rotation(pinned, model.initial.angular_momentum[i]);
  }
}

/// Limits of what is no divergence: where particles start and how fast, free flight through the film, and far more than
/// the size of the objects on top.
void set_believable(const Scene& scene, const Box& everything, Model& model) {
  double size = everything.extent().norm();
  if (!(size > 0.0)) size = model.smallest_length;
  double start = 0.0, speed = 0.0;
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    start = std::max(start, model.initial.position[i].norm());
    speed = std::max(speed, model.initial.velocity[i].norm());
  }
  for (const FixedBody& body : model.fixed) {
    for (const ObstacleKeyDesc& key : body.motion.keys) start = std::max(start, key.at.norm());
  }
  speed = std::max(speed, model.solid_speed);
  const double gravity = scene.gravity.norm(), time = scene.duration;
  model.believable_distance = kBelievable * size + start + (speed + 0.5 * gravity * time) * time;
  model.believable_speed = kBelievable * size * scene.frame_rate + speed + gravity * time;
}

}  // namespace

Model build_model(const Scene& scene) {
  Model model;
  ModelFaults faults(scene);
  model.smallest_length = std::numeric_limits<double>::infinity();
  for (const ObjectDesc& d : scene.objects) {
    const std::string key = "objects." + d.name;
    ObjectModel object;
    object.name = d.name;
    add_particles(scene, d, key, object, model, faults);
    if (d.contact) {
      object.material = {d.contact->modulus, d.contact->friction, d.contact->dissipation};
      object.collides = !object.skeleton.primitive.empty();
      object.breaks = d.breaking.has_value();
    }
    set_kinds(d, key, object, model, faults);
    object.hinges_join = d.hinges_join;
    object.separate = d.separate;
    add_pins_and_loads(d, key, object, model, faults);
    model.objects.push_back(std::move(object));
  }
  if (model.particles.size() == 0) faults.add("objects", "expected at least one object with particles", "none", "");
  faults.raise();  // what follows relies on particles

  model.rest = model.initial;
  for (Vec3& velocity : model.rest.velocity) velocity.setZero();
  for (Vec3& momentum : model.rest.angular_momentum) momentum.setZero();
  if (scene.planar) confine_to_plane(model, faults);
  stop_pinned(model);

  model.interactions.gravity = scene.gravity;
  std::vector<core::LinkRule> link_rules;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const ObjectDesc& d = scene.objects[i];
    LawBuilder laws(model, faults, model.objects[i], "objects." + d.name);
    for (std::size_t k = 0; k < d.interactions.size(); ++k) laws.add(d.interactions[k], k);
    if (d.breaking || d.yielding) link_rules.push_back(link_rule(d, static_cast<std::uint32_t>(i)));
    if (d.rayleigh) {
      const auto object = static_cast<std::uint32_t>(i);
      if (d.rayleigh->mass > 0.0) model.interactions.medium.push_back({object, d.rayleigh->mass, d.rayleigh->mass});
      if (d.rayleigh->stiffness > 0.0) model.interactions.stiffness_damping.push_back({object, d.rayleigh->stiffness});
    }
    if (d.medium) {
      model.interactions.medium.push_back({static_cast<std::uint32_t>(i), d.medium->linear, d.medium->angular});
    }
  }
  build_contact(scene, model, faults);
  faults.raise();
  model.links = core::make_links(model.particles, model.rest, model.interactions, link_rules);

  double cell = std::numeric_limits<double>::infinity();
  Box everything;
  for (const ObjectModel& object : model.objects) {
    double reach = object.iso_radius;
    for (const implicit::Primitive& primitive : object.skeleton.primitive) {
      const double thickness = 2.0 * (iso_radius(primitive, object.skeleton.iso) + solid_half_size(primitive));
      cell = std::min(cell, thickness / kCellsAcross);
      reach = std::max(reach, primitive.offset.position.norm() + largest_radius(primitive));
    }
    Box own;
    for (std::uint32_t p = object.first; p < object.last; ++p) {
      own = own.united(Box{model.rest.position[p], model.rest.position[p]}.inflated(reach));
    }
    if (!object.skeleton.primitive.empty()) cell = std::min(cell, own.extent().maxCoeff() / kCellsAlong);
    everything = everything.united(own);
  }
  model.meshing = scene.output.meshing;
  if (scene.output.images) {
    const auto& formats = scene.output.images->formats;
    if (std::find(formats.begin(), formats.end(), ImageName::Exr) != formats.end()) model.meshing.motion = true;
  }
  if (scene.render.shutter > 0.0) model.meshing.motion = true;
  for (std::size_t i = 0; i < model.objects.size(); ++i) model.objects[i].look = scene.objects[i].look;
  if (std::isfinite(cell)) model.cell = scene.output.cell.value_or(cell);
  set_believable(scene, everything, model);
  return model;
}

}  // namespace supple::scenes
