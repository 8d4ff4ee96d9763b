#include "model/material.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "model/bond_stiffness.h"
#include "model/model_contact.h"
#include "supple/core/directed_form.h"
#include "supple/implicit/volume.h"

namespace supple::scenes {
namespace {

constexpr double kVolumeCell = 0.25;  // of the least iso radius: volumes of balls err by 1e-3

/// The law of a spring along the bond: linear within a thousandth up to twice its length.
constexpr double kLinearShape = 1e-3, kLinearEta = 1e3;

/// Root of a rising function between 0 and `most`.
template <class Function>
double root_of_rising(double most, const Function& f) {
  double low = 0.0, high = most;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    (f(middle) < 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// @param least_cell  of cells, over the diagonal; 0: as the thinnest primitive needs
double volume_of(const implicit::Skeleton& skeleton, std::span<const Pose> poses, double least_cell = 0.0) {
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(skeleton, poses, placed);
  implicit::index_field(skeleton, placed, field);
  double thinnest = std::numeric_limits<double>::infinity();
  for (const implicit::Primitive& primitive : skeleton.primitive) thinnest = std::min(thinnest, iso_radius(primitive, skeleton.iso));
  const double coarsest = least_cell > 0.0 ? least_cell * field.surface_box().extent().norm() : 0.0;
  return implicit::enclosed_volume(field, std::max(kVolumeCell * thinnest, coarsest));
}

/// Particles with the same entries of the skeleton carry equal solids, measured once.
std::vector<double> carried_volumes(const ObjectDesc& d, std::size_t n, const implicit::Skeleton& skeleton) {
  std::vector<std::vector<std::size_t>> entries(n);
  for (std::size_t k = 0; k < d.skeleton.size(); ++k) {
    for (const int given : d.skeleton[k].particles) {
      const std::int64_t index = given < 0 ? std::int64_t{given} + static_cast<std::int64_t>(n) : given;
      if (index >= 0 && index < static_cast<std::int64_t>(n)) entries[static_cast<std::size_t>(index)].push_back(k);
    }
  }
  std::map<std::vector<std::size_t>, double> known;
  std::vector<double> volume(n);
  std::size_t at = 0;
  for (std::size_t i = 0; i < n; ++i) {
    implicit::Skeleton own{.primitive = {}, .part_count = 1, .iso = skeleton.iso, .blend = {}};
    for (; at < skeleton.primitive.size() && skeleton.primitive[at].part == i; ++at) {
      own.primitive.push_back(skeleton.primitive[at]);
      own.primitive.back().part = 0;
    }
    const auto [place, fresh] = known.try_emplace(entries[i], 0.0);
    const Pose pose;
    if (fresh && !own.primitive.empty()) place->second = volume_of(own, {&pose, 1});
    volume[i] = place->second;
  }
  return volume;
}

/// Numbers of particles along the axes of a lattice; all 1 but one for a rod.
struct Lattice {
  std::array<int, 3> count{1, 1, 1};
  [[nodiscard]] int directions() const {
    return static_cast<int>(std::count_if(count.begin(), count.end(), [](int n) { return n > 1; }));
  }
};

Lattice lattice_of(const ParticlesDesc& d) {
  if (d.arrange == ArrangeKind::Grid) return {{d.columns, d.rows, d.layers}};
  return {{d.count, 1, 1}};
}

/// Size of the body for its slowest vibration.
struct Slenderness {
  double length = 0.0;   ///< [m]
  double gyration = 0.0;  ///< least radius of gyration across [m]
};

/// beta of Rayleigh's damping by stiffness, 2 zeta / omega of the slowest vibration of a free bar: stretching, pi c / L, or bending,
/// 22.37 r c / L^2 with c^2 = E / rho (Euler and Bernoulli).
double damping_time(const SubstanceDesc& d, const Slenderness& body) {
  const double sound = std::sqrt(d.youngs_modulus / d.density);
  constexpr double kFreeBending = 22.3733;
  const double omega = std::min(std::numbers::pi * sound / body.length, kFreeBending * body.gyration * sound / (body.length * body.length));
  return 2.0 * d.damping_ratio / omega;
}

/// Adds the bonds of one object to two lists: springs along, and frames across and in rotation.
class MaterialBonds {
 public:
  MaterialBonds(const ObjectModel& object, const Model& model) : object_(object), model_(model) {
    along_.name = object.name + "/material_along";
    frame_.name = object.name + "/material_frame";
  }
  void add(std::uint32_t a, std::uint32_t b, const BondStiffness& k) {
    a += object_.first;
    b += object_.first;
    if (a > b) std::swap(a, b);
    const core::PairPose rest = core::pair_pose(model_.particles, model_.rest, a, b);
    const double length = rest.r.norm();
    if (k.along > k.across) {
      append(along_, a, b, core::LinearCohesion{.r0 = length, .f0 = (k.along - k.across) * length / kLinearEta, .a = kLinearShape, .eta = kLinearEta});
    }
    append(frame_, a, b, core::BondFrame::from_rest(k.across, k.rotation, rest));
  }
  void give(core::Interactions& laws) {
    if (!along_.law.empty()) laws.linear_cohesion.push_back(std::move(along_));
    if (!frame_.law.empty()) laws.bond_frame.push_back(std::move(frame_));
  }

 private:
  template <class Law>
  static void append(core::BondedLaw<Law>& list, std::uint32_t a, std::uint32_t b, const Law& law) {
    list.first.push_back(a);
    list.second.push_back(b);
    list.law.push_back(law);
  }
  const ObjectModel& object_;
  const Model& model_;
  core::BondedLaw<core::LinearCohesion> along_;
  core::BondedLaw<core::BondFrame> frame_;
};

/// Shares of the cells between particles along one axis, over the spacing: outer ones are wider by `beyond` / spacing.
std::vector<double> cell_shares(int particles, double beyond) {
  std::vector<double> share(static_cast<std::size_t>(std::max(particles - 1, 0)), 1.0);
  if (share.empty()) return share;
  share.front() += beyond;
  share.back() += beyond;
  return share;
}

/// Share of a particle: half of each cell beside it; 1 across a sheet.
double particle_share(const std::vector<double>& cells, int at) {
  if (cells.empty()) return 1.0;
  const auto k = static_cast<std::size_t>(at);
  return 0.5 * ((k > 0 ? cells[k - 1] : 0.0) + (k < cells.size() ? cells[k] : 0.0));
}

/// What a block of these cells lacks of the bending stiffness across them, over E (spacing)^2 times the section: see material.h. A bond deforms as the
/// solution of Saint-Venant does in its middle: u = (x z, -nu y z, -(x^2 + nu (z^2 - y^2)) / 2).
double bending_rest(const std::vector<double>& cells, double nu, double alpha) {
  const double middle = 0.5 * static_cast<double>(cells.size());
  double width = 0.0, moment = 0.0;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const double z = static_cast<double>(k) + 0.5 - middle;
    width += cells[k];
    moment += cells[k] * z * z;
  }
  const double total = (2.0 + 3.0 * alpha) * (1.0 + nu);  // E s / k_n
  const double diagonals = (1.0 - nu) * (1.0 - nu) + alpha * (1.0 + nu) * (1.0 + nu);  // energy of those in one plane with the bar
  const double beside = 0.25 * (1.0 + nu * nu + diagonals) / total;  // of bonds half a cell from the middle of theirs
  const double turned = alpha * (5.0 + 5.0 * nu * nu + 2.0 * (1.0 - nu) * (1.0 - nu)) / (4.0 * total);  // frames turn against the bond
  return width * width / 12.0 - moment / width - beside - turned;
}

class LatticeBonds {
 public:
  LatticeBonds(const Lattice& lattice, double beyond, MaterialBonds& out) : lattice_(lattice), out_(out) {
    for (std::size_t axis = 0; axis < 3; ++axis) cells_[axis] = cell_shares(lattice.count[axis], beyond);
  }
  [[nodiscard]] const std::vector<double>& cells(std::size_t axis) const { return cells_[axis]; }

  /// All bonds along edges, and along face diagonals with `diagonal` times that stiffness.
  void add(const BondStiffness& edge, double diagonal) {
    constexpr std::array<std::array<int, 3>, 9> kOffsets{
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, -1, 0}, {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}}};
    const std::array<int, 3>& n = lattice_.count;
    for (int z = 0; z < n[2]; ++z) {
      for (int y = 0; y < n[1]; ++y) {
        for (int x = 0; x < n[0]; ++x) {
          for (const std::array<int, 3>& offset : kOffsets) add_one({x, y, z}, offset, edge, diagonal);
        }
      }
    }
  }

 private:
  [[nodiscard]] std::uint32_t index(const std::array<int, 3>& at) const {
    return static_cast<std::uint32_t>((at[2] * lattice_.count[1] + at[1]) * lattice_.count[0] + at[0]);
  }
  void add_one(const std::array<int, 3>& at, const std::array<int, 3>& offset, const BondStiffness& edge, double diagonal) {
    std::array<int, 3> other{};
    double weight = 1.0;
    int steps = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      other[axis] = at[axis] + offset[axis];
      if (other[axis] < 0 || other[axis] >= lattice_.count[axis]) return;
      steps += offset[axis] != 0 ? 1 : 0;
      weight *= offset[axis] == 0 ? particle_share(cells_[axis], at[axis])
                                  : cells_[axis][static_cast<std::size_t>(std::min(at[axis], other[axis]))];
    }
    if (steps == 2) weight *= diagonal;
    out_.add(index(at), index(other), {weight * edge.along, weight * edge.across, weight * edge.rotation});
  }

  Lattice lattice_;
  MaterialBonds& out_;
  std::array<std::vector<double>, 3> cells_;
};

/// Where the surface does not reach from one particle to the next, bonds have no section.
void expect_filled(double beyond, const std::string& key, ModelFaults& faults) {
  if (beyond > 0.0) return;
  faults.add(key + ".material", "expected a surface that fills the space between the particles", "less volume than the particles span",
             "enlarge the kernel's radius, or reduce 'spacing'");
}

/// Particles on a lattice and the material that they carry.
struct FilledLattice {
  const SubstanceDesc& material;
  const Lattice& lattice;
  double spacing;  ///< [m]
  double volume;   ///< that the surface encloses [m^3]
};

Slenderness add_block(const FilledLattice& body, const std::string& key, MaterialBonds& out, ModelFaults& faults) {
  const SubstanceDesc& d = body.material;
  const Lattice& lattice = body.lattice;
  const double spacing = body.spacing, volume = body.volume;
  Vec3 extent;
  for (std::size_t axis = 0; axis < 3; ++axis) extent[static_cast<Eigen::Index>(axis)] = spacing * (lattice.count[axis] - 1);
  const double beyond = extent.prod() < volume ? root_of_rising(std::cbrt(volume), [&](double b) { return (extent + Vec3::Constant(2.0 * b)).prod() - volume; }) : 0.0;
  expect_filled(beyond, key, faults);
  const double nu = d.poissons_ratio, alpha = sliding_ratio(nu);
  LatticeBonds bonds(lattice, beyond / spacing, out);
  Eigen::Index thin = 0;
  extent.minCoeff(&thin);
  BondStiffness k;
  k.along = d.youngs_modulus * spacing / ((2.0 + 3.0 * alpha) * (1.0 + nu));
  k.across = alpha * k.along;
  const double rest = bending_rest(bonds.cells(static_cast<std::size_t>(thin)), nu, alpha);
  k.rotation = std::max(0.0, rest) * d.youngs_modulus * spacing * spacing * spacing / (10.0 * (1.0 + nu * nu));
  bonds.add(k, 1.0);
  const Vec3 whole = extent + Vec3::Constant(2.0 * beyond);
  return {whole.maxCoeff(), whole.minCoeff() / std::sqrt(12.0)};
}

/// Of a sheet: stiffness along solves E h = (C11^2 - C12^2) / C11 with C11 = (3 k_n + k_t) / 2, C12 = (k_n - k_t) / 2. In bending, curvatures k1 and k2 cost
/// (x (k1^2 + k2^2) + q k1 k2) / 2 with q = k_t s^2 / 2 and x = 4 k_theta + q, so a strip with free edges has the stiffness x - q^2 / 4x, which is to be E h^3 / 12.
Slenderness add_sheet(const FilledLattice& body, const std::string& key, MaterialBonds& out, ModelFaults& faults) {
  const SubstanceDesc& d = body.material;
  const Lattice& lattice = body.lattice;
  const double spacing = body.spacing, volume = body.volume;
  Vec3 extent = Vec3::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) extent[static_cast<Eigen::Index>(axis)] = spacing * (lattice.count[axis] - 1);
  const double h = root_of_rising(std::cbrt(volume), [&](double thickness) {
    double product = thickness;
    for (Eigen::Index axis = 0; axis < 3; ++axis) product *= extent[axis] > 0.0 ? extent[axis] + thickness : 1.0;
    return product - volume;
  });
  expect_filled(h, key, faults);
  const double nu = d.poissons_ratio, wanted = (1.0 - 3.0 * nu) / (1.0 + nu), plane = d.youngs_modulus * h;
  const double bending = d.youngs_modulus * h * h * h / 12.0;
  BondStiffness k;
  k.across = std::min(wanted * plane / ((1.5 + 0.5 * wanted) * (1.0 - nu * nu)), bending / (spacing * spacing));
  const double half = 1.5 * plane - 2.0 * k.across;
  k.along = 0.25 * (half + std::sqrt(half * half + 4.0 * plane * k.across));
  const double mixed = 0.5 * k.across * spacing * spacing;
  k.rotation = 0.25 * (0.5 * (bending + std::hypot(bending, mixed)) - mixed);
  LatticeBonds(lattice, 0.5 * h / spacing, out).add(k, 0.5);
  return {extent.maxCoeff() + h, h / std::sqrt(12.0)};
}

/// A body of another shape on a cubic lattice: all bonds between neighbours are equal, and their sum of k l^2, which in a block is that of its volume, is that of V.
Slenderness add_solid(const ObjectDesc& d, const ObjectModel& object, const Model& model, const std::string& key, MaterialBonds& out, ModelFaults& faults) {
  constexpr double kReach = 1.5;           // of the spacing: edges and face diagonals
  constexpr double kSquaresOfCell = 15.0;  // sum of (length / spacing)^2 of the bonds of a cell
  const double s = d.particles.spacing, nu = d.material->poissons_ratio, alpha = sliding_ratio(nu);
  const core::Bonds bonds = core::bonds_within(model.rest.position, object.first, object.last, kReach * s);
  double squares = 0.0;
  Box box;
  for (std::uint32_t i = object.first; i < object.last; ++i) box = box.united(Box{model.rest.position[i], model.rest.position[i]});
  for (std::size_t b = 0; b < bonds.first.size(); ++b) squares += (model.rest.position[bonds.second[b]] - model.rest.position[bonds.first[b]]).squaredNorm() / (s * s);
  if (bonds.first.empty()) faults.add(key + ".particles.spacing", "expected neighbours for bonds", "none", "reduce it");
  const double share = squares > 0.0 ? kSquaresOfCell * object.solid_volume / (s * s * s * squares) : 1.0;
  BondStiffness k;
  k.along = share * d.material->youngs_modulus * s / ((2.0 + 3.0 * alpha) * (1.0 + nu));
  k.across = alpha * k.along;
  k.rotation = 0.0;
  for (std::size_t b = 0; b < bonds.first.size(); ++b) out.add(bonds.first[b] - object.first, bonds.second[b] - object.first, k);
  const Vec3 whole = box.extent() + Vec3::Constant(s);
  return {whole.maxCoeff(), whole.minCoeff() / std::sqrt(12.0)};
}

/// The listed bonds of particles at points.
class PointBonds {
 public:
  PointBonds(const ObjectDesc& d, const ObjectModel& object, const Model& model) : d_(d.particles), object_(object), model_(model) {
    double lengths = 0.0;
    for (std::size_t b = 0; b < size(); ++b) lengths += length(b);
    constexpr double kDimensions = 3.0;  // sections of shares that fill V: sum of section times length = 3 V
    equal_section_ = kDimensions * object.solid_volume / lengths;
  }
  [[nodiscard]] std::size_t size() const { return d_.bonds.size() / 2; }
  [[nodiscard]] std::uint32_t first(std::size_t b) const { return static_cast<std::uint32_t>(d_.bonds[2 * b]); }
  [[nodiscard]] std::uint32_t second(std::size_t b) const { return static_cast<std::uint32_t>(d_.bonds[2 * b + 1]); }
  [[nodiscard]] double length(std::size_t b) const { return (place(second(b)) - place(first(b))).norm(); }
  [[nodiscard]] double section(std::size_t b) const { return d_.sections.empty() ? equal_section_ : d_.sections[b]; }
  [[nodiscard]] Vec3 extent() const {
    Box box;
    for (std::uint32_t i = object_.first; i < object_.last; ++i) box.include(model_.rest.position[i]);
    return box.extent();
  }

 private:
  [[nodiscard]] const Vec3& place(std::uint32_t i) const { return model_.rest.position[object_.first + i]; }
  const ParticlesDesc& d_;
  const ObjectModel& object_;
  const Model& model_;
  double equal_section_ = 0.0;
};

/// A body of particles that each fill an equal share, with bonds between neighbouring shares; see `packing_bond`.
Slenderness add_packing(const ObjectDesc& d, const ObjectModel& object, const Model& model, MaterialBonds& out) {
  const PointBonds bonds(d, object, model);
  double sections = 0.0;
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    out.add(bonds.first(b), bonds.second(b), packing_bond(d.material->youngs_modulus, d.material->poissons_ratio, bonds.section(b), bonds.length(b)));
    sections += bonds.section(b);
  }
  const Vec3 whole = bonds.extent() + Vec3::Constant(std::sqrt(sections / static_cast<double>(bonds.size())));
  return {whole.maxCoeff(), whole.minCoeff() / std::sqrt(12.0)};
}

/// A shell of elements with bonds between neighbours whose shares of the surface have a common edge of width w; section = w h. In a plane,
/// bonds of k_n = k section / l and k_t = alpha k_n have k = 4 E / ((1 - nu^2)(3 + alpha)), alpha = (1 - 3 nu)/(1 + nu) (as add_sheet). Bending E h^3 / 12 is that of
/// directed_form with the measured curvatures, sum of strengths = E h^3 / 12 times the area, less what frames across take.
Slenderness add_shell(const ObjectDesc& d, const ObjectModel& object, Model& model, MaterialBonds& out) {
  const PointBonds bonds(d, object, model);
  const double thickness = d.particles.thickness, young = d.material->youngs_modulus, nu = d.material->poissons_ratio;
  const double alpha = std::max(0.0, (1.0 - 3.0 * nu) / (1.0 + nu)), factor = 4.0 / ((1.0 - nu * nu) * (3.0 + alpha));
  std::vector<Mat3> shape;
  for (std::size_t i = 0; i < d.particles.normals.size(); ++i) shape.push_back(Vec3(d.particles.curvatures[2 * i], d.particles.curvatures[2 * i + 1], 0.0).asDiagonal());
  core::BondedLaw<core::DirectedForm> form{object.name + "/material_form", {}, {}, {}};
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    const double length = bonds.length(b), width = bonds.section(b) / thickness;
    const double strip = young * thickness * thickness * thickness / 12.0 * width;  // E I
    constexpr double kSlidingShare = 0.2;
    BondStiffness k;
    k.along = factor * young * bonds.section(b) / length;
    k.across = std::min(std::max(alpha, kSlidingShare) * k.along, kSlidingShare * 4.0 * strip / (length * length * length));
    out.add(bonds.first(b), bonds.second(b), k);
    const double strength = 0.5 * strip * length - 0.125 * k.across * std::pow(length, 4);
    form.first.push_back(object.first + std::min(bonds.first(b), bonds.second(b)));
    form.second.push_back(object.first + std::max(bonds.first(b), bonds.second(b)));
    form.law.push_back({strength, shape[form.first.back() - object.first], shape[form.second.back() - object.first], {}});
  }
  model.interactions.directed_form.push_back(std::move(form));
  return {bonds.extent().maxCoeff() + thickness, thickness / std::sqrt(12.0)};
}

Slenderness add_rod(const ObjectDesc& d, const ObjectModel& object, const Model& model, double volume, MaterialBonds& out) {
  const auto n = object.last - object.first;
  const bool closed = d.particles.arrange == ArrangeKind::Ring && n > 2;
  const std::vector<Vec3>& x = model.rest.position;
  const std::uint32_t bonds = closed ? n : n - 1;
  const auto distance = [&](std::uint32_t b) { return (x[object.first + (b + 1) % n] - x[object.first + b]).norm(); };
  double length = 0.0;
  for (std::uint32_t b = 0; b < bonds; ++b) length += distance(b);
  const double caps = closed ? 0.0 : 4.0 / 3.0 * std::numbers::pi;  // an open rod ends in half balls
  const double radius = root_of_rising(std::sqrt(volume / (std::numbers::pi * length)),
                                       [&](double r) { return (std::numbers::pi * length + caps * r) * r * r - volume; });
  for (std::uint32_t b = 0; b < bonds; ++b) out.add(b, (b + 1) % n, rod_bond(d.material->youngs_modulus, std::numbers::pi * radius * radius, distance(b)));
  return {length + (closed ? 0.0 : 2.0 * radius), 0.5 * radius};
}

/// Gives the bonds to the model, with the damping of the slowest vibration.
void finish(const ObjectDesc& d, const Slenderness& body, const ObjectModel& object, MaterialBonds& bonds, Model& model) {
  bonds.give(model.interactions);
  const double time = damping_time(*d.material, body);
  if (!d.rayleigh && time > 0.0) model.interactions.stiffness_damping.push_back({model.particles.object[object.first], time});
}

}  // namespace

std::vector<double> material_volumes(const ObjectDesc& d, const std::string& key, const core::Arrangement& arrangement,
                                     const implicit::Skeleton& skeleton, ModelFaults& faults) {
  const std::size_t n = arrangement.size();
  if (skeleton.primitive.empty()) return std::vector<double>(n, 1.0);  // a fault of the skeleton is noted
  std::vector<double> volume;
  if (d.separate || n == 1) {
    volume = carried_volumes(d, n, skeleton);
  } else {
    std::vector<Pose> poses(n);
    for (std::size_t i = 0; i < n; ++i) poses[i] = {arrangement.position[i], arrangement.orientation[i]};
    // Small primitives of many shape the surface, and hardly change the volume.
    constexpr double kCellOfMany = 1.0 / 200.0;
    volume.assign(n, volume_of(skeleton, poses, d.particles.arrange == ArrangeKind::Points ? kCellOfMany : 0.0) / static_cast<double>(n));
  }
  if (!(*std::min_element(volume.begin(), volume.end()) > 0.0)) {
    faults.add_once(key + ".material", "expected a surface around every particle", "none that encloses a volume", "");
    volume.assign(n, 1.0);
  }
  return volume;
}

double cube_inertia_radius(double volume) { return std::sqrt(5.0 / 12.0) * std::cbrt(volume); }

collision::ContactMaterial contact_material(const ObjectDesc& d, const implicit::Skeleton& skeleton) {
  collision::ContactMaterial out;
  if (d.material) {
    double product = 0.0;  // slope times thickness: pressure over E on the depth of one thickness, for P = E
    for (const implicit::Primitive& p : skeleton.primitive) {
      const double slope = implicit::iso_slope(p.kernel, skeleton.iso) * implicit::distance_scale(p);
      product = std::max(product, slope * (iso_radius(p, skeleton.iso) + solid_half_size(p)));
    }
    if (product > 0.0) out.modulus = d.material->youngs_modulus / product;
    out.friction = d.material->friction;
    // The rebound of Hunt & Crossley is 1 - 2/3 d v, that of a vibration 1 - pi zeta, both for little damping.
    constexpr double kBlow = 0.1;  // speed over that of sound
    const double speed = kBlow * std::sqrt(d.material->youngs_modulus / d.material->density);
    out.dissipation = 1.5 * std::numbers::pi * d.material->damping_ratio / speed;
  }
  return {d.contact->modulus.value_or(out.modulus), d.contact->friction.value_or(out.friction), d.contact->dissipation.value_or(out.dissipation)};
}

void add_material_laws(const ObjectDesc& d, const ObjectModel& object, const std::string& key, Model& model, ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  if (n < 2 || d.separate) return;
  const Lattice lattice = lattice_of(d.particles);
  MaterialBonds bonds(object, model);
  const double volume = object.solid_volume;
  const FilledLattice filled{*d.material, lattice, d.particles.spacing, volume};
  Slenderness body;
  if (d.particles.arrange == ArrangeKind::Points) {
    body = d.particles.normals.empty() ? add_packing(d, object, model, bonds) : add_shell(d, object, model, bonds);
    finish(d, body, object, bonds, model);
    return;
  }
  const bool solid = d.particles.arrange == ArrangeKind::Ball || d.particles.arrange == ArrangeKind::Fill;
  switch (solid ? 0 : lattice.directions()) {
    case 0: body = add_solid(d, object, model, key, bonds, faults); break;
    case 3: body = add_block(filled, key, bonds, faults); break;
    case 2: body = add_sheet(filled, key, bonds, faults); break;
    default: body = add_rod(d, object, model, volume, bonds); break;
  }
  finish(d, body, object, bonds, model);
}

}  // namespace supple::scenes
