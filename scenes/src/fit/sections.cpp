#include "fit/sections.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "model/bond_stiffness.h"
#include "supple/core/interrupt.h"

namespace supple::fit {
namespace {

using Matrix = Eigen::MatrixXd;
using Sparse = Eigen::SparseMatrix<double>;
using Block = Eigen::Matrix<double, 12, 12>;
using Rows = Eigen::Matrix<double, 3, 12>;

constexpr std::size_t kCases = 9;  ///< tension along three axes, bending of each in two planes

Mat3 cross_matrix(const Vec3& d) {
  Mat3 out;
  out << 0.0, -d.z(), d.y(), d.z(), 0.0, -d.x(), -d.y(), d.x(), 0.0;
  return out;
}

/// Volume and its second moments about its middle.
struct Moments {
  double volume = 0.0;
  Mat3 second = Mat3::Zero();
  Vec3 first = Vec3::Zero();

  void add(double part, const Vec3& sum, const Mat3& square) {
    volume += part;
    first += sum;
    second += square;
  }
  void centre() { second -= first * first.transpose() / volume; }
  void turn(const Mat3& axes) { second = axes.transpose() * second * axes; }
  /// Of the section across an axis: its area, or its second moment for bending, where the body is as long as it is far from its middle.
  [[nodiscard]] double section(Eigen::Index along, Eigen::Index across) const {
    return (across == along ? volume : second(across, across)) / std::sqrt(second(along, along) / volume);
  }
};

Moments moments_of(const Mesh& mesh) {
  Moments out;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]], sum = a + b + c;
    const double part = a.dot(b.cross(c)) / 6.0;  // of a tetrahedron with the origin
    out.add(part, 0.25 * part * sum, 0.05 * part * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()));
  }
  out.centre();
  return out;
}

Moments moments_of(const Surroundings& lattice) {
  Moments out;
  const double square = lattice.step * lattice.step, cube = square * lattice.step;
  for (const Vec3& p : lattice.inside) out.add(cube, cube * p, cube * (p * p.transpose() + square / 12.0 * Mat3::Identity()));
  out.centre();
  return out;
}

/// A packing in the principal axes of its particles.
struct Body {
  std::vector<Vec3> place;
  std::vector<Face> face;
  Moments solid, cubes;  ///< of the mesh and of the lattice
  Vec3 weight = Vec3::Zero();  ///< of the axes

  Body(const Mesh& mesh, const Surroundings& lattice, const Packing& packing) : place(packing.particle), face(packing.face), solid(moments_of(mesh)), cubes(moments_of(lattice)) {
    Vec3 mean = Vec3::Zero();
    for (const Vec3& p : place) mean += p / static_cast<double>(place.size());
    Mat3 moment = Mat3::Zero();
    for (const Vec3& p : place) moment += (p - mean) * (p - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(moment);
    Mat3 axes = solver.eigenvectors();
    if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
    for (Vec3& p : place) p = axes.transpose() * (p - mean);
    for (Face& f : face) f = turned(f, axes, mean);
    for (Moments* one : {&solid, &cubes}) one->turn(axes);
    weight = solver.eigenvalues().cwiseAbs2();
    weight /= weight.sum();
  }

 private:
  static Face turned(const Face& f, const Mat3& axes, const Vec3& mean) {
    Face out{axes.transpose() * f.area, axes.transpose() * (f.centre - mean), axes.transpose() * f.first * axes, Face::no_moments()};
    for (Eigen::Index m = 0; m < 3; ++m) {
      Mat3 sum = Mat3::Zero();
      for (Eigen::Index n = 0; n < 3; ++n) sum += axes(n, m) * f.second[static_cast<std::size_t>(n)];
      out.second[static_cast<std::size_t>(m)] = axes.transpose() * sum * axes;
    }
    return out;
  }
};

/// Uniaxial stress along an axis: 1, or the coordinate across for bending.
struct Load {
  Eigen::Index along;
  Eigen::Index across;  ///< = along: tension
  [[nodiscard]] double force(const Face& face) const { return across == along ? face.area[along] : face.centre[across] * face.area[along] + face.first(across, along); }
  /// Torque of the stress about the centre of a face.
  [[nodiscard]] Vec3 turn(const Face& face) const {
    if (across == along) return face.first.col(along).cross(Vec3::Unit(along));
    const Vec3 arm = face.centre[across] * face.first.col(along) + face.second[static_cast<std::size_t>(along)].col(across);
    return arm.cross(Vec3::Unit(along));
  }
};

std::array<Load, kCases> loads() {
  std::array<Load, kCases> out{};
  for (Eigen::Index k = 0; k < 9; ++k) out[static_cast<std::size_t>(k)] = {k / 3, k % 3};
  return out;
}

/// Forces and torques of the tractions: those on the free boundary of a share are the opposite of those on its faces.
Eigen::VectorXd traction(const Packing& packing, const Body& body, const Load& load) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(body.place.size()));
  for (std::size_t b = 0; b < body.face.size(); ++b) {
    const Face& face = body.face[b];
    const Vec3 t = load.force(face) * Vec3::Unit(load.along);
    const Vec3 turn = load.turn(face);
    for (const auto& [i, sign] : {std::pair(packing.bond[b][0], -1.0), std::pair(packing.bond[b][1], 1.0)}) {
      out.segment<3>(6 * i) += sign * t;
      out.segment<3>(6 * i + 3) += sign * ((face.centre - body.place[i]).cross(t) + turn);
    }
  }
  return out;
}

/// Displacements of a solid of modulus 1.
Eigen::VectorXd displacement(const Body& body, const Load& load, double nu) {
  Eigen::VectorXd out(3 * static_cast<Eigen::Index>(body.place.size()));
  for (std::size_t i = 0; i < body.place.size(); ++i) {
    const Vec3& p = body.place[i];
    Vec3 u = -nu * p;
    if (load.across == load.along) {
      u[load.along] = p[load.along];
    } else {
      const Eigen::Index other = 3 - load.along - load.across;
      const double x = p[load.along], y = p[load.across], z = p[other];
      u[load.along] = x * y;
      u[load.across] = -0.5 * (x * x + nu * (y * y - z * z));
      u[other] = -nu * y * z;
    }
    out.segment<3>(3 * static_cast<Eigen::Index>(i)) = u;
  }
  return out;
}

/// Particles in the middle of a body along an axis: those at its ends take tractions themselves, and are stiffer.
std::vector<std::size_t> middle_of(const Body& body, Eigen::Index along) {
  constexpr std::size_t kEnough = 12;
  constexpr double kMiddle = 0.6;
  double end = 0.0;
  for (const Vec3& p : body.place) end = std::max(end, std::abs(p[along]));
  std::vector<std::size_t> out, all;
  for (std::size_t i = 0; i < body.place.size(); ++i) {
    all.push_back(i);
    if (std::abs(body.place[i][along]) <= kMiddle * end) out.push_back(i);
  }
  return out.size() >= kEnough ? out : all;
}

/// Strain or curvature in the middle over that of the exact displacements, by least squares beside all rigid motions.
double share_of(const Body& body, const Load& load, const Eigen::VectorXd& exact, const Eigen::VectorXd& moved) {
  const std::vector<std::size_t> middle = middle_of(body, load.along);
  Matrix columns(3 * static_cast<Eigen::Index>(middle.size()), 7);
  Eigen::VectorXd places(columns.rows());
  for (Eigen::Index row = 0; row < columns.rows(); row += 3) {
    const auto i = static_cast<Eigen::Index>(middle[static_cast<std::size_t>(row / 3)]);
    columns.block<3, 3>(row, 0).setIdentity();
    columns.block<3, 3>(row, 3) = -cross_matrix(body.place[static_cast<std::size_t>(i)]);
    columns.block<3, 1>(row, 6) = exact.segment<3>(3 * i);
    places.segment<3>(row) = moved.segment<3>(6 * i);
  }
  return columns.colPivHouseholderQr().solve(places)(6);
}

/// Energy of a bond to second order, for displacements and rotations of both particles: see `BondFrame` and `LinearCohesion` in core/pair_laws.h.
Block bond_block(const Vec3& r, const scenes::BondStiffness& k) {
  Rows a = Rows::Zero(), b = Rows::Zero(), turn = Rows::Zero();
  for (Rows* rows : {&a, &b}) {
    rows->block<3, 3>(0, 0) = -Mat3::Identity();
    rows->block<3, 3>(0, 6).setIdentity();
  }
  a.block<3, 3>(0, 3) = cross_matrix(r);
  b.block<3, 3>(0, 9) = cross_matrix(r);
  turn.block<3, 3>(0, 3) = -Mat3::Identity();
  turn.block<3, 3>(0, 9).setIdentity();
  const Eigen::Matrix<double, 1, 12> along = r.normalized().transpose() * (0.5 * (a + b));
  return 0.5 * k.across * (a.transpose() * a + b.transpose() * b) + 2.0 * k.rotation * turn.transpose() * turn + std::max(k.along - k.across, 0.0) * along.transpose() * along;
}

/// Stiffness of all bonds, for a modulus of 1; bonds of no section have none.
Sparse stiffness(const Packing& packing, const Body& body, const std::vector<double>& section, double nu) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t b = 0; b < section.size(); ++b) {
    if (!(section[b] > 0.0)) continue;
    const auto [i, j] = packing.bond[b];
    const Vec3 r = body.place[j] - body.place[i];
    const Block block = bond_block(r, scenes::packing_bond(1.0, nu, section[b], r.norm()));
    const auto place = [i = i, j = j](int k) { return static_cast<int>(6 * (k < 6 ? i : j)) + k % 6; };
    for (int row = 0; row < 12; ++row) {
      for (int column = 0; column < 12; ++column) entries.emplace_back(place(row), place(column), block(row, column));
    }
  }
  const auto n = 6 * static_cast<Eigen::Index>(body.place.size());
  Sparse out(n, n);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

/// Whether both shares of a bond are at the surface.
std::vector<char> outer_bonds(const Packing& packing) {
  constexpr double kOpen = 0.15;  // of a share: its free boundary over its faces
  std::vector<Vec3> sum(packing.particle.size(), Vec3::Zero());
  std::vector<double> all(packing.particle.size(), 0.0);
  for (std::size_t b = 0; b < packing.bond.size(); ++b) {
    for (const std::uint32_t i : packing.bond[b]) {
      sum[i] += i == packing.bond[b][0] ? packing.face[b].area : Vec3(-packing.face[b].area);
      all[i] += packing.face[b].area.norm();
    }
  }
  std::vector<char> out;
  for (const auto& bond : packing.bond) {
    out.push_back(std::all_of(bond.begin(), bond.end(), [&](std::uint32_t i) { return sum[i].norm() > kOpen * all[i]; }) ? 1 : 0);
  }
  return out;
}

/// What a body of given sections lacks.
struct Response {
  Eigen::Vector2d excess = Eigen::Vector2d::Zero();    ///< logarithms of stiffness over that asked, in tension and in bending
  Eigen::Matrix2d share = Eigen::Matrix2d::Zero();     ///< of outer and of other bonds in the energy of each
};

Response response(const Packing& packing, const Body& body, const std::vector<double>& section, const std::vector<char>& outer, double nu) {
  Sparse matrix = stiffness(packing, body, section, nu);
  constexpr double kHeld = 1e-10;  // against rigid motions, on which balanced loads do no work
  const double held = kHeld * matrix.diagonal().sum() / static_cast<double>(matrix.rows());
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) matrix.coeffRef(i, i) += held;
  const Eigen::SimplicialLDLT<Sparse> solver(matrix);
  std::vector<double> of_outer = section;
  for (std::size_t b = 0; b < section.size(); ++b) of_outer[b] *= outer[b];
  const Sparse outer_matrix = stiffness(packing, body, of_outer, nu);
  Response out;
  Eigen::Vector2d compliance = Eigen::Vector2d::Zero();
  for (const Load& load : loads()) {
    const Eigen::VectorXd force = traction(packing, body, load), moved = solver.solve(force);
    const Eigen::Index kind = load.across == load.along ? 0 : 1;
    const double weight = body.weight[load.along] * (kind == 0 ? 1.0 : 0.5);
    const double larger = body.solid.section(load.along, load.across) / body.cubes.section(load.along, load.across);
    compliance[kind] += weight * share_of(body, load, displacement(body, load, nu), moved) * larger;
    const double energy = force.dot(moved), in_outer = moved.dot(outer_matrix * moved);
    if (!(energy > 0.0)) continue;
    out.share(kind, 0) += weight * in_outer / energy;
    out.share(kind, 1) += weight * (1.0 - in_outer / energy);
  }
  if (compliance.minCoeff() > 0.0) out.excess = -compliance.array().log().matrix();
  return out;
}

}  // namespace

std::vector<double> bond_sections(const Mesh& mesh, const Surroundings& lattice, const Packing& packing, double poissons_ratio) {
  constexpr std::size_t kLeast = 8, kMost = 3000;
  constexpr int kIterations = 8;
  constexpr double kTolerance = 1e-3, kLargestStep = 0.5, kLargestFactor = 3.0, kDamping = 1e-3;
  std::vector<double> face;
  for (const Face& f : packing.face) face.push_back(f.area.norm());
  if (packing.particle.size() < kLeast || packing.particle.size() > kMost) return face;
  const Body body(mesh, lattice, packing);
  const std::vector<char> outer = outer_bonds(packing);
  Eigen::Vector2d factor = Eigen::Vector2d::Zero();  // logarithms, of outer and of other bonds
  std::vector<double> section = face;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    heed_scope();
    const Response found = response(packing, body, section, outer, poissons_ratio);
    if (found.excess.cwiseAbs().maxCoeff() < kTolerance) break;
    const Eigen::Matrix2d normal = found.share.transpose() * found.share + kDamping * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d step = -normal.ldlt().solve(found.share.transpose() * found.excess);
    const double most = std::log(kLargestFactor);
    factor = (factor + step.cwiseMax(-kLargestStep).cwiseMin(kLargestStep)).cwiseMax(-most).cwiseMin(most);
    for (std::size_t b = 0; b < face.size(); ++b) section[b] = std::exp(factor[outer[b] != 0 ? 0 : 1]) * face[b];
  }
  return section;
}

}  // namespace supple::fit
