#include "supple/fit/fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

#include "fit/balls.h"
#include "fit/data.h"
#include "fit/measure.h"
#include "fit/packing.h"
#include "fit/sections.h"
#include "fit/shell.h"
#include "fit/solve.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/math.h"

namespace supple::fit {
namespace {

constexpr double kPointRadius = 0.45420201867;  // of a lone point's surface at iso 0.5, over that of its support

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

constexpr std::size_t kSamples = 16000;

/// Handles of closed pieces.
long genus_of(const MeshReport& mesh) { return static_cast<long>(mesh.components) - mesh.euler_characteristic / 2; }

/// Samples, distances and the balls that touch the surface; all lengths over the diagonal.
struct Data {
  Data(const Mesh& given, double most, double error, const Executor& executor)
      : mesh(given), tree(given), surface(sample_surface(given, kSamples)), points(surface.position), largest_ball(most), genus(genus_of(inspect(given))), pieces(inspect(given).components) {
    constexpr double kStep = 1.0 / 48.0;
    around = sample_surroundings(mesh, tree, kStep, executor);
    constexpr double kSlack = 0.2, kBeforeHollow = 2.0;  // balls larger than a hollow blend across it
    radius = touching_radii(surface, points, -1.0, most, kSlack * error, executor);
    const std::vector<double> outside = touching_radii(surface, points, 1.0, most, kSlack * error, executor);
    for (std::size_t k = 0; k < radius.size(); ++k) radius[k] = std::min(radius[k], std::max(kBeforeHollow * outside[k], error));
  }

  const Mesh& mesh;
  SurfaceTree tree;
  SurfaceSamples surface;
  PointTree points;
  Surroundings around;
  std::vector<double> radius;  ///< of the largest ball at a sample, from inside and with respect to hollows outside
  double largest_ball;
  long genus;
  std::size_t pieces;  ///< two for a closed shell
};

Targets targets_of(const Data& data) {
  Targets out{data.surface, data.radius, {}, {}};
  for (double& size : out.size) size = std::max(size, 0.25 * data.surface.spacing);
  constexpr double kWeight = 0.5;  // of the distance from the surface
  for (std::size_t k = 0; k < data.around.inside.size(); ++k) {
    if (data.around.depth[k] > data.around.step) out.inside.add(data.around.inside[k], kWeight * data.around.depth[k]);
  }
  for (std::size_t k = 0; k < data.around.outside.size(); ++k) {
    if (data.around.gap[k] > data.around.step) out.outside.add(data.around.outside[k], kWeight * data.around.gap[k]);
  }
  return out;
}

/// Ellipsoids that begin as balls.
std::vector<Blob> blobs_of(std::span<const Ball> balls) {
  std::vector<Blob> out;
  for (const Ball& ball : balls) out.push_back({.centre = ball.centre, .axes = Vec3::Constant(ball.radius / kPointRadius), .round = false});
  return out;
}

/// Where data and fit are farther apart than `most`.
struct Faults {
  std::vector<std::uint32_t> missed;  ///< samples of the data outside the fit
  std::vector<Vec3> inside, outside;  ///< points of the fitted surface inside and outside the data
  double largest = 1.0, rms = 1.0;    ///< distance
  long topology = std::numeric_limits<long>::max();  ///< pieces and handles that the fitted surface has too many or too few

  [[nodiscard]] bool within(const Faults& limit) const { return largest <= limit.largest && rms <= limit.rms && topology <= limit.topology; }

  /// @param enough  a distance that needs no mending
  [[nodiscard]] bool better_than(const Faults& other, double enough) const {
    const bool near = largest <= enough;
    if (near != (other.largest <= enough)) return near;
    return near ? topology < other.topology : largest < other.largest;
  }
};

/// Vertices of all pieces of a mesh but the largest.
std::vector<char> on_small_pieces(const Mesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.position.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& t : mesh.triangle) {
    parent[root(t[1])] = root(t[0]);
    parent[root(t[2])] = root(t[0]);
  }
  std::vector<std::size_t> count(parent.size(), 0);
  for (std::uint32_t i = 0; i < parent.size(); ++i) ++count[root(i)];
  const auto largest = static_cast<std::uint32_t>(std::max_element(count.begin(), count.end()) - count.begin());
  std::vector<char> out(parent.size());
  for (std::uint32_t i = 0; i < parent.size(); ++i) out[i] = root(i) != largest ? 1 : 0;
  return out;
}

Faults find_faults(const Data& data, const implicit::Field& field, double cell, double most, const Executor& executor) {
  Faults out;
  const Mesh mesh = mesh_of(field, cell, executor);
  if (mesh.triangle.empty()) {
    out.missed.resize(data.surface.position.size());
    std::iota(out.missed.begin(), out.missed.end(), 0U);
    return out;
  }
  const SurfaceTree tree(mesh);
  const std::vector<double> of_data = distances(data.surface.position, tree, executor), of_fit = distances(mesh.position, data.tree, executor);
  std::vector<double> value(data.surface.position.size());
  implicit::FieldView(field).evaluate(data.surface.position, value);
  out.largest = 0.0;
  for (std::uint32_t k = 0; k < of_data.size(); ++k) {
    out.largest = std::max(out.largest, of_data[k]);
    if (of_data[k] > most && value[k] < 0.0) out.missed.push_back(k);
  }
  const auto mean_square = [](const std::vector<double>& d) { return std::inner_product(d.begin(), d.end(), d.begin(), 0.0) / static_cast<double>(d.size()); };
  out.rms = std::sqrt(std::max(mean_square(of_data), mean_square(of_fit)));
  const MeshReport report = inspect(mesh);
  out.topology = std::abs(static_cast<long>(report.components) - static_cast<long>(data.pieces)) + std::abs(genus_of(report) - data.genus);
  const std::vector<char> small = on_small_pieces(mesh);
  const double apart = 0.5 * most;
  std::vector<Vec3> kept;
  for (std::size_t k = 0; k < of_fit.size(); ++k) {
    out.largest = std::max(out.largest, of_fit[k]);
    if (of_fit[k] <= most && small[k] == 0) continue;
    const auto close = [&](const Vec3& p) { return (p - mesh.position[k]).squaredNorm() < apart * apart; };
    if (std::any_of(kept.begin(), kept.end(), close)) continue;
    kept.push_back(mesh.position[k]);
    (data.tree.signed_distance(kept.back()) < 0.0 ? out.inside : out.outside).push_back(kept.back());
  }
  return out;
}

/// Holds points of the fitted surface where it is wrong to their side of it. @param least  distance from the data that such a point counts as at least
void hold_signs(const Faults& faults, const Data& data, double least, Targets& targets) {
  constexpr double kWeight = 4.0;  // over the distance
  const auto weight = [&](const Vec3& p) { return kWeight * std::max(data.tree.distance(p), least); };
  for (const Vec3& p : faults.inside) targets.inside.add(p, weight(p));
  for (const Vec3& p : faults.outside) targets.outside.add(p, weight(p));
}

/// Blobs that no sample needs are dropped: those whose share of the field stays small wherever it is compared with the data.
void prune(std::vector<Blob>& blobs, const Targets& targets) {
  constexpr double kLeast = 0.01;
  implicit::Field field;
  build_field(blobs, field);
  std::vector<double> largest(blobs.size(), 0.0);
  implicit::FieldParts parts;
  for (const auto* points : {&targets.surface.position, &targets.inside.position}) {
    implicit::FieldView(field).evaluate_parts(*points, parts);
    for (std::size_t e = 0; e < parts.part.size(); ++e) largest[parts.part[e]] = std::max(largest[parts.part[e]], parts.value[e]);
  }
  std::vector<Blob> kept;
  for (std::size_t k = 0; k < blobs.size(); ++k) {
    if (largest[k] >= kLeast) kept.push_back(blobs[k]);
  }
  blobs = std::move(kept);
}

/// The blob with the largest share of the field at each point; none where no blob reaches.
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
std::vector<std::uint32_t> owners(const implicit::Field& field, std::span<const Vec3> points) {
  implicit::FieldParts parts;
  implicit::FieldView(field).evaluate_parts(points, parts);
  std::vector<std::uint32_t> out(points.size(), kNone);
  for (std::size_t k = 0; k < points.size(); ++k) {
    double largest = 0.0;
    for (std::uint32_t e = parts.offset[k]; e < parts.offset[k + 1]; ++e) {
      if (parts.value[e] <= largest) continue;
      largest = parts.value[e];
      out[k] = parts.part[e];
    }
  }
  return out;
}

/// Blobs that hold a point outside the data are too large for what they carry: balls of at most a share of their radius take their place, so that they
/// cover the same samples.
void divide(std::vector<Blob>& blobs, const Data& data, const implicit::Field& field, std::span<const Vec3> outside, double reach) {
  constexpr double kShare = 0.6;
  std::vector<char> large(blobs.size(), 0);
  for (const std::uint32_t k : owners(field, outside)) {
    if (k != kNone) large[k] = 1;
  }
  const std::vector<std::uint32_t> owner = owners(field, data.surface.position);
  std::vector<double> radius = data.radius;
  std::vector<std::uint32_t> wanted;
  for (std::uint32_t s = 0; s < owner.size(); ++s) {
    if (owner[s] == kNone || large[owner[s]] == 0) continue;
    radius[s] = std::min(radius[s], kShare * kPointRadius * blobs[owner[s]].axes.minCoeff());
    wanted.push_back(s);
  }
  std::vector<Blob> out;
  for (std::size_t k = 0; k < blobs.size(); ++k) {
    if (large[k] == 0) out.push_back(blobs[k]);
  }
  const std::vector<Blob> parts = blobs_of(cover_surface(data.surface, data.points, radius, wanted, reach));
  out.insert(out.end(), parts.begin(), parts.end());
  blobs = std::move(out);
}

struct Skeleton {
  std::vector<Blob> blobs;
  double cell = 0.0;  ///< of meshes that show its errors
};

constexpr double kEnough = 0.75;  // of the error: a distance between samples that leaves room for those between them
constexpr int kIterations = 8;

/// Balls that cover the surface, moved and resized, with more of them where the distances are larger than the error.
/// @param targets  receives points that have to be held to their side   @return what is left
Faults mend(const Data& data, double error, std::uint32_t most_blobs, const SolveOptions& solving, const Executor& executor, Targets& targets, Skeleton& out) {
  constexpr double kReach = 0.6, kFirst = 0.35;  // of the error: balls reach samples, and distances that call for more
  constexpr double kLeastReach = 0.15, kFiner = 0.6;
  constexpr int kRounds = 8;
  std::vector<std::uint32_t> all(data.surface.position.size());
  std::iota(all.begin(), all.end(), 0U);
  std::vector<Ball> balls = cover_surface(data.surface, data.points, data.radius, all, kReach * error);
  cover_inside(data.around, data.largest_ball, balls);
  if (balls.size() > most_blobs) balls.resize(most_blobs);
  out = {blobs_of(balls), std::min(0.5 * error, 1.0 / 128.0)};
  const double enough = kEnough * error;
  double reach = kReach * error, most = kFirst * error;
  std::vector<Blob> blobs = out.blobs;
  Faults least;
  for (int round = 0; round < kRounds; ++round) {
    heed_scope();
    balance(blobs, targets, solving, executor);
    solve(blobs, targets, solving, executor);
    prune(blobs, targets);
    implicit::Field field;
    build_field(blobs, field);
    const Faults faults = find_faults(data, field, out.cell, most, executor);
    if (faults.better_than(least, enough)) {
      out.blobs = blobs;
      least = faults;
    }
    if ((least.topology == 0 && least.largest <= enough) || round + 1 == kRounds) break;
    if (faults.largest <= enough) most *= kFiner;  // what is wrong in the topology is smaller
    hold_signs(faults, data, most, targets);
    reach = std::max(0.7 * reach, kLeastReach * error);
    divide(blobs, data, field, faults.outside, reach);
    if (blobs.size() > most_blobs) blobs.resize(most_blobs);
    std::vector<Ball> more = cover_surface(data.surface, data.points, data.radius, faults.missed, reach);
    for (const Vec3& p : faults.inside) more.push_back({p, std::min(data.tree.distance(p), data.largest_ball)});
    more.resize(std::min<std::size_t>(more.size(), most_blobs - std::min<std::size_t>(most_blobs, blobs.size())));
    const std::vector<Blob> added = blobs_of(more);
    blobs.insert(blobs.end(), added.begin(), added.end());
  }
  return least;
}

/// The blobs without which the surface moves least, at most so many, no two of them at one sample. @param kept  those that stay
std::vector<std::uint32_t> least_needed(std::span<const Blob> blobs, const Data& data, std::span<const char> kept, std::size_t most) {
  constexpr double kCarries = 0.1;  // value with which a blob is at a sample, of the iso value 1/2
  implicit::Field field;
  build_field(blobs, field);
  implicit::FieldParts parts;
  implicit::FieldView(field).evaluate_parts(data.surface.position, parts);
  std::vector<double> need(blobs.size(), 0.0);  // sum of squares of the distances by which samples would move
  std::vector<std::vector<std::uint32_t>> carried(blobs.size());
  for (std::uint32_t s = 0; s < data.surface.position.size(); ++s) {
    for (std::uint32_t e = parts.offset[s]; e < parts.offset[s + 1]; ++e) {
      const double distance = parts.value[e] * data.radius[s];
      need[parts.part[e]] += distance * distance;
      if (parts.value[e] > kCarries) carried[parts.part[e]].push_back(s);
    }
  }
  std::vector<std::uint32_t> order;
  for (std::uint32_t b = 0; b < blobs.size(); ++b) {
    if (kept[b] == 0) order.push_back(b);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return need[a] < need[b]; });
  std::vector<char> touched(data.surface.position.size(), 0);
  std::vector<std::uint32_t> out;
  for (const std::uint32_t b : order) {
    if (out.size() == most) break;
    if (std::any_of(carried[b].begin(), carried[b].end(), [&](std::uint32_t s) { return touched[s] != 0; })) continue;
    for (const std::uint32_t s : carried[b]) touched[s] = 1;
    out.push_back(b);
  }
  return out;
}

/// All but some. @param which  sorted or not
template <class T>
std::vector<T> without(const std::vector<T>& all, std::span<const std::uint32_t> which) {
  std::vector<char> gone(all.size(), 0);
  for (const std::uint32_t k : which) gone[k] = 1;
  std::vector<T> out;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (gone[k] == 0) out.push_back(all[k]);
  }
  return out;
}

/// Drops the blobs least needed, many at once and fewer where that fails, while the others can be moved, turned and resized so that
/// the faults stay within a limit.
void thin(const Data& data, const Faults& limit, const SolveOptions& solving, const Executor& executor, Targets& targets, Skeleton& skeleton) {
  constexpr double kMostShare = 0.3;
  constexpr int kMostAttempts = 25;
  std::vector<char> kept(skeleton.blobs.size(), 0);  // without these it failed
  std::size_t batch = skeleton.blobs.size();
  for (int attempt = 0; attempt < kMostAttempts && skeleton.blobs.size() > 1; ++attempt) {
    heed_scope();
    const auto most = static_cast<std::size_t>(kMostShare * static_cast<double>(skeleton.blobs.size()));
    batch = std::max<std::size_t>(std::min(batch, most), 1);
    const std::vector<std::uint32_t> dropped = least_needed(skeleton.blobs, data, kept, batch);
    if (dropped.empty()) break;
    std::vector<Blob> tried = without(skeleton.blobs, dropped);
    balance(tried, targets, solving, executor);
    solve(tried, targets, solving, executor);
    implicit::Field field;
    build_field(tried, field);
    const Faults faults = find_faults(data, field, skeleton.cell, limit.largest, executor);
    if (faults.within(limit)) {
      skeleton.blobs = std::move(tried);
      kept = without(kept, dropped);
      batch = 2 * dropped.size();
      continue;
    }
    hold_signs(faults, data, limit.largest, targets);
    for (const std::uint32_t s : faults.missed) {
      const Vec3& p = data.surface.position[s];
      const auto nearer = [&](std::uint32_t a, std::uint32_t b) { return (skeleton.blobs[a].centre - p).squaredNorm() < (skeleton.blobs[b].centre - p).squaredNorm(); };
      kept[*std::min_element(dropped.begin(), dropped.end(), nearer)] = 1;
    }
    if (dropped.size() == 1) kept[dropped.front()] = 1;
    batch = dropped.size() / 2;
  }
}

/// A finer skeleton than coarse errors need, thinned to them: few balls that leave the data by much are no start for least squares.
Skeleton fit_skeleton(const Data& data, const FitOptions& options, const Executor& executor) {
  constexpr double kCoarsest = 0.02, kRms = 0.25;
  const double error = std::min(options.error, kCoarsest);
  SolveOptions solving{.iterations = kIterations, .smallest = 0.25 * error / kPointRadius, .largest = 1.5 * data.largest_ball / kPointRadius};
  Targets targets = targets_of(data);
  Skeleton out;
  Faults limit = mend(data, error, options.primitives, solving, executor, targets, out);
  limit.largest = std::max(limit.largest, kEnough * options.error);
  limit.rms = std::max(limit.rms, kEnough * kRms * options.error);
  solving.iterations = kIterations / 2;  // from one attempt to the next little changes
  thin(data, limit, solving, executor, targets, out);
  return out;
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
void hang(FittedObject& object, const Skeleton& skeleton, const Packing& packing, const std::vector<Vec3>& points, double diagonal) {
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
    object.primitives.push_back({particle, diagonal * (frame.inverse() * (blob.centre - packing.particle[particle])), diagonal * blob.axes, frame.inverse() * blob.turn});
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
Packing add_solid(FittedObject& object, const Skeleton& skeleton, const Data& data, const Surroundings& lattice, const FitOptions& options, const Executor& executor) {
  const double diagonal = object.report.diagonal;
  Packing packing = pack_inside(lattice, options.particles, executor);
  for (const double area : bond_sections(data.mesh, lattice, packing, options.material.poissons_ratio)) object.sections.push_back(diagonal * diagonal * area);
  hang(object, skeleton, packing, lattice.inside, diagonal);
  return packing;
}

/// The same of a shell about a surface, with its frames.
Packing add_shell(FittedObject& object, const Skeleton& skeleton, const Mesh& middle, const FitOptions& options, const Executor& executor) {
  ShellElements shell = pack_shell(middle, options.particles, executor);
  const double diagonal = object.report.diagonal;
  for (const SurfaceFrame& f : shell.frame) object.frames.push_back({f.normal, f.direction, f.first / diagonal, f.second / diagonal});
  for (const Face& edge : shell.packing.face) object.sections.push_back(diagonal * edge.area.norm() * object.thickness);
  hang(object, skeleton, shell.packing, shell.samples.position, diagonal);
  return std::move(shell.packing);
}

void report_errors(FittedObject& object, const Data& data, const Skeleton& skeleton, const FitOptions& options, const Executor& executor) {
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
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(), "the largest distance is %.3g %% of the diagonal, more than the %.3g %% asked with at most %u primitives", 100.0 * report.two_sided(), 100.0 * options.error,
                  options.primitives);
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
  constexpr double kLargestBall = 1.25;  // of the spacing: a primitive moves with one particle
  const Data data(mesh, std::min(0.5, kLargestBall * spacing), options.error, executor);
  const bool solid = options.kind == Kind::Solid;
  const Surroundings lattice = solid ? fill_solid(file, data, volume, options.particles, executor) : Surroundings{};
  const Skeleton skeleton = fit_skeleton(data, options, executor);
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
