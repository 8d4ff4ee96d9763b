#include "supple/fit/fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "fit/data.h"
#include "fit/find_skeleton.h"
#include "fit/measure.h"
#include "fit/packing.h"
#include "fit/sections.h"
#include "fit/shell.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::fit {
namespace {

void expect_range(const char* option, bool good, const char* expected, const std::string& found) {
  if (good) return;
  throw Error(ErrorKind::Usage, Fault{.place = option, .key = {}, .expected = expected, .found = found, .hint = {}});
}

void check(const FitOptions& options) {
  expect_range("--error", options.error >= 1e-3 && options.error <= 0.1, "expected a share of the diagonal from 0.1% to 10%", std::to_string(options.error));
  expect_range("--particles", options.particles >= 1 && options.particles <= 10000, "expected a whole number from 1 to 10000", std::to_string(options.particles));
  const auto& window = options.volume.window;
  expect_range("--window", !window || (*window)[0] < (*window)[1], "expected two values, the smaller one first",
               window ? short_number((*window)[0]) + ':' + short_number((*window)[1]) : "");
  const Substance& material = options.material;
  const bool possible = material.youngs_modulus > 0.0 && material.density > 0.0 && material.poissons_ratio >= 0.0 && material.poissons_ratio <= 0.25 && material.damping_ratio >= 0.0 &&
                        material.damping_ratio <= 1.0 && material.friction >= 0.0;
  expect_range("--material", possible, "expected a modulus and a density > 0, Poisson's ratio from 0 to 0.25, a damping ratio from 0 to 1 and a friction >= 0", "others");
  expect_range("--thickness", !options.thickness || *options.thickness > 0.0, "expected a length > 0 [m]", options.thickness ? short_number(*options.thickness) : "");
  expect_range("--pieces", options.piece >= 1, "expected a whole number of at least 1", std::to_string(options.piece));
  expect_range("--primitives", options.primitives >= 1 && options.primitives <= 10000, "expected a whole number from 1 to 10000", std::to_string(options.primitives));
}

/// The data in axes of its own: the middle of its box is the origin, the diagonal is 1.
struct Frame {
  Vec3 middle;
  double diagonal;
};

Frame normalise(Mesh& mesh) {
  Box box;
  for (const Vec3& p : mesh.position) box.include(p);
  const Frame frame{box.centre(), box.extent().norm()};
  for (Vec3& p : mesh.position) p = (p - frame.middle) / frame.diagonal;
  return frame;
}

Vec3 centre_of_mass(const Mesh& mesh) {
  Vec3 sum = Vec3::Zero();
  double volume = 0.0;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    const double part = a.dot(b.cross(c)) / 6.0;
    volume += part;
    sum += 0.25 * part * (a + b + c);
  }
  return sum / volume;
}

void warn_of_units(FitReport& report) {
  constexpr double kLargest = 100.0, kSmallest = 1e-4;
  if (report.diagonal <= kLargest && report.diagonal >= kSmallest) return;
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "the data is %.3g m across: coordinates count as metres; scale the object in the scene where they are others", report.diagonal);
  report.warnings.emplace_back(text.data());
}

/// Of surfaces that are not quite the data's.
void warn_of_source(FitReport& report) {
  constexpr double kFar = 0.01;
  if (report.repair.points_rms > kFar) {
    report.warnings.push_back("the surface through the points misses them by " + short_number(100.0 * report.repair.points_rms) + " % of the diagonal (RMS): normals may be wrong, or gaps too large");
  }
  if (report.repair.cut) report.warnings.emplace_back("the border of the volume cuts what lies inside, and closes the surface there");
}

/// Primitives hang on the particle whose share they lie in.
/// @param points  of which the particles have shares
void hang(FittedObject& object, const FoundSkeleton& skeleton, const Packing& packing, const std::vector<Vec3>& points, double diagonal) {
  const PointTree tree(points);
  for (const Blob& blob : skeleton.blobs) {
    const std::uint32_t particle = packing.share[tree.nearest(blob.centre)];
    Quat frame = Quat::Identity();
    if (!object.frames.empty()) {
      const FittedFrame& f = object.frames[particle];
      Mat3 axes;
      axes << f.direction, f.normal.cross(f.direction), f.normal;
      frame = Quat(axes);
    }
    object.primitives.push_back({particle, diagonal * (frame.inverse() * (blob.centre - packing.particle[particle])), diagonal * blob.axes, frame.inverse() * blob.turn, blob.form == Form::Segment});
  }
  std::stable_sort(object.primitives.begin(), object.primitives.end(), [](const auto& a, const auto& b) { return a.particle < b.particle; });
}

/// Points of a lattice inside a solid, enough for all its particles; lengths over the diagonal.
/// @throws Error{Scene} where there are none: in a plate that is thinner than their step
Surroundings fill_solid(const std::filesystem::path& file, const Data& data, double volume, int particles, const Executor& executor) {
  constexpr double kPointsOfShare = 40.0, kLeastPoints = 20000.0;
  const double points = std::max(kPointsOfShare * particles, kLeastPoints);
  Surroundings lattice = sample_surroundings(data.mesh, data.tree, math::pow(volume / points, 1.0 / 3.0), executor);
  if (lattice.inside.empty()) refuse(file, "expected a mesh that encloses a volume", "one so thin that points " + short_number(100.0 * lattice.step) + " % of the diagonal apart miss it", "fit a surface without inside by --kind shell");
  return lattice;
}

/// Particles, bonds and their sections of a solid; lengths over the diagonal.
Packing add_solid(FittedObject& object, const FoundSkeleton& skeleton, const Data& data, const Surroundings& lattice, const FitOptions& options, const Executor& executor) {
  const double diagonal = object.report.diagonal;
  Packing packing = pack_inside(lattice, options.particles, executor);
  for (const double area : bond_sections(data.mesh, lattice, packing, options.material.poissons_ratio)) object.sections.push_back(diagonal * diagonal * area);
  hang(object, skeleton, packing, lattice.inside, diagonal);
  return packing;
}

/// The same of a shell about a surface, with its frames.
Packing add_shell(FittedObject& object, const FoundSkeleton& skeleton, const Mesh& middle, const FitOptions& options, const Executor& executor) {
  ShellElements shell = pack_shell(middle, options.particles, executor);
  const double diagonal = object.report.diagonal;
  for (const SurfaceFrame& f : shell.frame) object.frames.push_back({f.normal, f.direction, f.first / diagonal, f.second / diagonal});
  for (const Face& edge : shell.packing.face) object.sections.push_back(diagonal * edge.area.norm() * object.thickness);
  hang(object, skeleton, shell.packing, shell.samples.position, diagonal);
  return std::move(shell.packing);
}

void report_errors(FittedObject& object, const Data& data, const FoundSkeleton& skeleton, const FitOptions& options, const Executor& executor) {
  FitReport& report = object.report;
  implicit::Field field;
  build_field(skeleton.blobs, field);
  object.surface = mesh_of(field, skeleton.cell, executor);
  const MeshReport in = inspect(data.mesh), out = inspect(object.surface);
  report.genus_in = genus_of(in);
  report.genus_out = genus_of(out);
  report.pieces_out = out.components;
  report.volume_error = out.volume / in.volume - 1.0;
  const double within = 0.05 * options.error;
  const SurfaceTree fitted(object.surface);
  report.from_data = measure(data.mesh, object.surface, fitted, within, executor);
  report.to_data = measure(object.surface, data.mesh, data.tree, within, executor);
  object.data = data.mesh;
  object.data.columns = {{"distance", distances(data.mesh.position, fitted, executor)}};
  object.surface.columns = {{"distance", distances(object.surface.position, data.tree, executor)}};
  report.within = report.two_sided() <= options.error;
  if (!report.within) {
    std::array<char, 320> text{};
    const double largest = 100.0 * report.two_sided(), asked = 100.0 * options.error;
    if (skeleton.full) {
      std::snprintf(text.data(), text.size(), "the largest distance is %.3g %% of the diagonal, more than the %.3g %% asked with at most %u primitives", largest, asked, options.primitives);
    } else {
      std::snprintf(text.data(), text.size(),
                    "the largest distance is %.3g %% of the diagonal, more than the %.3g %% asked, although more primitives were allowed; %.2g %% of the surface lies at walls or gaps "
                    "thinner than %.2g %%, the thinnest primitive that this error allows",
                    largest, asked, 100.0 * share_thinner_than(data, skeleton.thinnest), 200.0 * skeleton.thinnest);
    }
    report.warnings.emplace_back(text.data());
  }
  if (report.genus_in != report.genus_out || report.pieces_out != data.pieces) {
    report.warnings.push_back("the fitted surface has " + counted(report.pieces_out, "piece") + " and " + counted(static_cast<std::size_t>(std::max(0L, report.genus_out)), "handle") + ", the data has " + counted(data.pieces, "piece") + " and " +
                              counted(static_cast<std::size_t>(std::max(0L, report.genus_in)), "handle"));
  }
}

/// The surface that is fitted: the data, or a layer about it, of which the middle is kept.
Mesh surface_of(const std::filesystem::path& file, FitOptions& options, FittedObject& object, Mesh& middle, const Executor& executor) {
  Mesh mesh = read_surface(file, options, object.report.repair, executor);
  if (options.kind == Kind::Solid) return mesh;
  const double spacing = std::sqrt(inspect(mesh).area / options.particles);
  constexpr double kShare = 1.0 / 3.0;
  object.thickness = options.thickness.value_or(kShare * spacing);
  middle = mesh;
  mesh = thickened(middle, object.thickness);
  Box box;
  for (const Vec3& p : mesh.position) box.include(p);
  constexpr double kOfThickness = 0.25, kLeastError = 1e-3;  // a coarser surface would have holes
  options.error = std::max(kLeastError, std::min(options.error, kOfThickness * object.thickness / box.extent().norm()));
  return mesh;
}

}  // namespace

FittedObject fit(const std::filesystem::path& file, const FitOptions& asked) {
  const auto begin = std::chrono::steady_clock::now();
  check(asked);
  FitOptions options = asked;
  const Executor executor(options.threads);
  FittedObject object;
  FitReport& report = object.report;
  Mesh middle_surface;
  Mesh mesh = surface_of(file, options, object, middle_surface, executor);
  const Frame frame = normalise(mesh);
  for (Vec3& p : middle_surface.position) p = (p - frame.middle) / frame.diagonal;
  report.diagonal = frame.diagonal;
  const double volume = inspect(mesh).volume;
  report.volume = volume * frame.diagonal * frame.diagonal * frame.diagonal;
  warn_of_units(report);
  warn_of_source(report);
  const double spacing = math::pow(volume / options.particles, 1.0 / 3.0);
  constexpr double kLargest = 0.5, kLargestBall = 1.25;  // of the diagonal, and of the spacing: a primitive moves with one of the particles
  const Data data(mesh, options.particles == 1 ? kLargest : std::min(kLargest, kLargestBall * spacing), first_level_of(options.error), executor);
  const bool solid = options.kind == Kind::Solid;
  const Surroundings lattice = solid ? fill_solid(file, data, volume, options.particles, executor) : Surroundings{};
  const FoundSkeleton skeleton = find_skeleton(data, options.error, options.primitives, executor);
  object.material = options.material;
  const Packing packing = solid ? add_solid(object, skeleton, data, lattice, options, executor) : add_shell(object, skeleton, middle_surface, options, executor);
  const Vec3 middle = centre_of_mass(mesh);
  object.origin = frame.middle + frame.diagonal * middle;
  object.spacing = frame.diagonal * spacing;
  for (const Vec3& p : packing.particle) object.particles.push_back(frame.diagonal * (p - middle));
  object.bonds = packing.bond;
  report_errors(object, data, skeleton, options, executor);
  for (Mesh* one : {&object.surface, &object.data}) {
    for (Vec3& p : one->position) p = frame.diagonal * (p - middle);
    for (double& d : one->columns.front().values) d *= frame.diagonal;
  }
  report.primitives = object.primitives.size();
  report.particles = object.particles.size();
  report.bonds = object.bonds.size();
  report.rigid = packing.connected;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return object;
}

}  // namespace supple::fit
