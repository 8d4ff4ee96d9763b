/// @file supple/fit/fit.h
/// Deformable objects from triangle meshes, points and volumes: particles, bonds and skeleton of an object whose surface lies within an error of the data. An
/// optional component. It uses CGAL, whose packages are under the GPL, and so is a program that links it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/mesh.h"

namespace supple::fit {

/// What is done with data of several pieces that do not touch.
enum class Pieces : std::uint8_t {
  Refuse,   ///< an error
  Largest,  ///< the one with the largest volume is fitted, or another one, see `piece`
};

enum class Kind : std::uint8_t {
  Solid,  ///< the inside of the surface
  Shell,  ///< a layer about the surface, which may be open
};

/// What lies inside the surface of a volume: one of these. Level sets of OpenVDB need none.
struct VolumeOptions {
  std::optional<double> iso{};                   ///< values above
  std::optional<std::array<double, 2>> window{}; ///< values between two
  std::optional<std::uint32_t> label{};          ///< voxels of this number, below 2^24

  [[nodiscard]] bool given() const { return iso || window || label; }
};

/// Of the object: keys of `material` in scene files.
struct Substance {
  double youngs_modulus = 50e3;  ///< [Pa], > 0
  double density = 1000.0;       ///< [kg/m^3], > 0
  double poissons_ratio = 0.2;   ///< in [0, 0.25]
  double damping_ratio = 0.05;   ///< in [0, 1]
  double friction = 0.5;         ///< >= 0
};

struct FitOptions {
  double error = 0.01;           ///< largest distance between the surfaces, either way, over the diagonal of the data's box; in [1e-3, 0.1]
  std::uint32_t particles = 200; ///< of the object; in [1, 10000]
  std::uint32_t primitives = 2000;  ///< at most; in [1, 10000]
  Pieces pieces = Pieces::Refuse;
  std::uint32_t piece = 1;       ///< with Pieces::Largest: which one, counted from the largest; >= 1
  Kind kind = Kind::Solid;
  std::optional<double> thickness{};  ///< of a shell [m]; absent: a third of the distance between particles
  VolumeOptions volume{};
  Substance material{};
  int threads = 0;               ///< 0: all of the machine; does not change the result
};

/// What was mended in the data.
struct Repair {
  std::size_t vertices = 0;      ///< of the mesh that is fitted
  std::size_t triangles = 0;
  std::size_t holes = 0;         ///< closed
  double closed_area = 0.0;      ///< of the triangles that close them, over the area of all
  std::size_t pieces = 1;        ///< in the data
  bool turned = false;           ///< triangles were turned to look outwards
  std::size_t points = 0;        ///< of data that has no triangles
  bool normals_given = false;    ///< with these
  double points_rms = 0.0;       ///< distance of the points used to the surface through them, over the diagonal
  std::size_t voxels = 0;        ///< of volumes
  std::size_t cavities = 0;      ///< of volumes, filled
  bool cut = false;              ///< the border of the volume cuts what lies inside
};

/// Distances from the points of one surface to the other, over the diagonal of the data's box.
struct Distance {
  double rms = 0.0;      ///< of samples even in area
  double largest = 0.0;  ///< one-sided Hausdorff distance, within a twentieth of the error asked
};

struct FitReport {
  Repair repair;
  double diagonal = 0.0;          ///< of the data's box [m]
  Distance from_data, to_data;    ///< of points of the data to the fitted surface, and the other way
  double volume = 0.0;            ///< of the data [m^3]
  double volume_error = 0.0;      ///< of the fitted surface, over that of the data
  long genus_in = 0, genus_out = 0;  ///< handles: 0 for a sphere, 1 for a torus
  std::size_t pieces_out = 0;     ///< of the fitted surface, cavities included
  std::size_t primitives = 0, particles = 0, bonds = 0;
  bool within = false;            ///< both largest distances are within the error asked
  bool rigid = false;             ///< bonds connect all particles, so that no motion but that of a rigid body is free
  double seconds = 0.0;
  std::vector<std::string> warnings;

  [[nodiscard]] double two_sided() const { return from_data.largest > to_data.largest ? from_data.largest : to_data.largest; }
};

/// An ellipsoid or a segment with Wyvill's kernel (implicit/skeleton.h).
struct FittedPrimitive {
  std::uint32_t particle = 0;            ///< that carries it
  Vec3 at = Vec3::Zero();                ///< from the particle, in its frame [m]; frames of solids have the axes of the data
  Vec3 semi_axes = Vec3::Zero();         ///< of the support [m]; three equal ones: a point. Of a segment: half its length along x, then twice the radius of the support
  Quat orientation = Quat::Identity();   ///< of the axes
  bool segment = false;
};

/// A particle of a shell.
struct FittedFrame {
  Vec3 normal = Vec3::UnitZ();     ///< z of its frame, outward
  Vec3 direction = Vec3::UnitX();  ///< x of its frame, along which the first curvature is
  double first = 0.0, second = 0.0;  ///< principal curvatures [1/m], > 0 where the shell bulges along the normal
};

struct FittedObject {
  Vec3 origin = Vec3::Zero();                           ///< the data's centre of mass, from which positions count [m]
  double spacing = 0.0;                                 ///< of the particles: cube root of the volume of one [m]
  std::vector<Vec3> particles;                          ///< centres of equal shares of the volume [m]
  std::vector<std::array<std::uint32_t, 2>> bonds;      ///< between particles whose shares have a common face, sorted
  std::vector<double> sections;                         ///< of the bonds [m^2]: the body has the modulus of a material of this Poisson's ratio
  std::vector<FittedFrame> frames;                      ///< of the particles of a shell
  double thickness = 0.0;                               ///< of a shell [m]
  std::vector<FittedPrimitive> primitives;              ///< sorted by particle
  Substance material;
  Mesh surface;                                         ///< fitted [m], with the column `distance` to the data [m]
  Mesh data;                                            ///< mended [m], with the column `distance` to the fitted surface [m]
  FitReport report;
};

/// Fits an object to data: balls of the medial axis that cover the surface (Ma et al. 2012), moved and resized by least squares of field and
/// normals on samples (Levenberg 1944; Marquardt 1963), more of them where the error is too large, fewer where none is missed; particles by centroidal
/// packing (Lloyd 1982). The result depends on data and options alone.
/// @param file  a mesh (PLY, OBJ, OFF, STL) or points (XYZ, PLY) [m], or a volume (NIfTI, NRRD, MetaImage: mm unless the file says otherwise; OpenVDB: m). Holes
/// are closed where that adds less than a tenth of the area.
/// @throws Error{Usage} for options out of range, Error{Io} for a file that is absent or ends early, Error{Limit} for 4e8 voxels and more, Error{Scene} for data
/// that is empty, open beyond repair, joins more than two triangles at an edge, or has several pieces that are not asked for
[[nodiscard]] FittedObject fit(const std::filesystem::path& file, const FitOptions& options = {});

/// Keys of an object for scene files: particles, skeleton, material and contact.
[[nodiscard]] std::string object_text(const FittedObject& object, const std::string& title);
/// The report as JSON, and in words for people.
[[nodiscard]] std::string report_json(const FitReport& report);
[[nodiscard]] std::string report_text(const FitReport& report);

}  // namespace supple::fit
