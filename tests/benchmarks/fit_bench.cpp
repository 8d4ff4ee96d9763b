/// @file fit_bench.cpp
/// Error of fitted skeletons by number of primitives and time, beside two plain ways to describe the same data by as many primitives:
///   fit      the skeleton that `supple fit` finds
///   spheres  a union of inner spheres of the medial axis: always the one that adds most volume; all grown by the mean gap that they leave, and reaching as far
///            beyond the data as suits best
///   equal    equal blobs at the centres of equal shares of the volume, with the radius and the iso value that suit best
/// One JSON object per line. Distances are RMS of samples and the two-sided Hausdorff distance, over the diagonal, measured alike for all three.
///   fit_bench DATA [ERROR...]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <queue>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fit/balls.h"
#include "fit/measure.h"
#include "fit/packing.h"
#include "fit/solve.h"
#include "programs.h"
#include "supple/core/error.h"
#include "supple/fit/fit.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;
using namespace supple::fit;

constexpr double kCell = 1.0 / 256.0;  // of all surfaces that are measured, over the diagonal

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The data; lengths over the diagonal.
struct Shape {
  explicit Shape(const Mesh& given) : mesh(given), tree(mesh), surface(sample_surface(mesh, kSamples)), points(surface.position), around(sample_surroundings(mesh, tree, kStep, executor)) {}

  static constexpr std::size_t kSamples = 16000;
  static constexpr double kStep = 1.0 / 128.0;
  Executor executor{1};
  Mesh mesh;
  SurfaceTree tree;
  SurfaceSamples surface;
  PointTree points;
  Surroundings around;

  [[nodiscard]] double volume() const { return inspect(mesh).volume; }
};

/// What describes the data: blobs that are summed, or united.
struct Description {
  std::vector<Blob> blobs;
  double iso = 0.5;
  bool united = false;

  [[nodiscard]] Mesh surface(const Executor& executor) const {
    implicit::Skeleton skeleton = skeleton_of(blobs);
    skeleton.iso = iso;
    if (united) skeleton.blend.rule = implicit::BlendRule::Graph;  // without edges: the largest
    implicit::PlacedSkeleton placed;
    implicit::Field field;
    place_skeleton(skeleton, std::vector<Pose>(blobs.size()), placed);
    index_field(skeleton, placed, field);
    return mesh_of(field, kCell, executor);
  }
};

double radius_of_point(double support) { return support * implicit::iso_distance(implicit::Kernel::wyvill(1.0), 0.5); }

/// Inner spheres, always the one that covers most points of a lattice not yet covered; of equal ones the first.
std::vector<Ball> largest_spheres(const Shape& shape, std::size_t count, double slack) {
  const std::vector<double> radius = touching_radii(shape.surface, shape.points, -1.0, 0.5, slack, shape.executor);
  const auto ball_at = [&](std::size_t k) { return Ball{shape.surface.position[k] - radius[k] * shape.surface.normal[k], radius[k]}; };
  const PointTree inside(shape.around.inside);
  std::vector<char> open(shape.around.inside.size(), 1);
  std::vector<std::uint32_t> near;
  const auto gain = [&](const Ball& ball) {
    inside.within(ball.centre, ball.radius, near);
    return std::count_if(near.begin(), near.end(), [&](std::uint32_t p) { return open[p] != 0; });
  };
  // Gains only fall, so one that is still the largest when it is counted anew is the largest of all.
  using Entry = std::pair<std::ptrdiff_t, std::int64_t>;  // gain, minus the sample
  std::priority_queue<Entry> queue;
  for (std::size_t k = 0; k < radius.size(); ++k) queue.emplace(gain(ball_at(k)), -static_cast<std::int64_t>(k));
  std::vector<Ball> out;
  while (!queue.empty() && out.size() < count) {
    const auto k = static_cast<std::size_t>(-queue.top().second);
    queue.pop();
    const std::ptrdiff_t now = gain(ball_at(k));
    if (now == 0) continue;
    if (!queue.empty() && Entry(now, -static_cast<std::int64_t>(k)) < queue.top()) {
      queue.emplace(now, -static_cast<std::int64_t>(k));
      continue;
    }
    out.push_back(ball_at(k));
    for (const std::uint32_t p : near) open[p] = 0;
  }
  return out;
}

/// Such spheres, all grown by the mean gap that they leave.
Description grown_spheres(const Shape& shape, std::size_t count, double slack) {
  const std::vector<Ball> balls = largest_spheres(shape, count, slack);
  double gap = 0.0;
  for (const Vec3& p : shape.surface.position) {
    double least = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls) least = std::min(least, (p - ball.centre).norm() - ball.radius);
    gap += least / static_cast<double>(Shape::kSamples);
  }
  Description out;
  out.united = true;
  for (const Ball& ball : balls) out.blobs.push_back({.centre = ball.centre, .axes = Vec3::Constant(std::max(ball.radius + gap, 0.0) / radius_of_point(1.0))});
  return out;
}

/// The iso value of least squares of F / |grad F| at the samples of the data that the blobs reach.
double best_iso(const Shape& shape, const std::vector<Blob>& blobs) {
  implicit::Field field;
  build_field(blobs, field);
  std::vector<double> value(Shape::kSamples);
  std::vector<Vec3> gradient(Shape::kSamples);
  field.evaluate(shape.surface.position, value, gradient);
  double sum = 0.0, weights = 0.0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    const double square = gradient[k].squaredNorm();
    if (!(square > 0.0)) continue;
    sum += (value[k] + 0.5) / square;  // F counts from the iso value 1/2
    weights += 1.0 / square;
  }
  return weights > 0.0 ? sum / weights : 0.5;
}

double rms_of(const std::vector<double>& distance) {
  double squares = 0.0;
  for (const double d : distance) squares += d * d;
  return std::sqrt(squares / static_cast<double>(distance.size()));
}

/// The larger RMS distance of samples, of both ways.
double rms_between(const Shape& shape, const Mesh& surface) {
  if (surface.triangle.empty()) return std::numeric_limits<double>::infinity();
  const SurfaceTree tree(surface);
  return std::max(rms_of(distances(shape.surface.position, tree, shape.executor)), rms_of(distances(sample_surface(surface, Shape::kSamples).position, shape.tree, shape.executor)));
}

/// The one of least RMS distance. @param make  a description by a value
template <class Make>
Description best_of(const Shape& shape, std::span<const double> values, const Make& make) {
  Description best;
  double least = std::numeric_limits<double>::infinity();
  for (const double value : values) {
    Description one = make(value);
    const double rms = rms_between(shape, one.surface(shape.executor));
    if (!(rms < least)) continue;
    least = rms;
    best = std::move(one);
  }
  return best;
}

Description spheres(const Shape& shape, std::size_t count) {
  constexpr std::array<double, 3> kSlacks{0.003, 0.01, 0.02};  // by which spheres may reach beyond samples
  return best_of(shape, kSlacks, [&](double slack) { return grown_spheres(shape, count, slack); });
}

Description equal_blobs(const Shape& shape, std::size_t count) {
  constexpr std::array<double, 6> kRadii{0.8, 0.95, 1.1, 1.3, 1.6, 2.0};  // of the support, over the distance between blobs
  const std::vector<Vec3> centre = pack_points(shape.around.inside, count, shape.executor).particle;
  const double spacing = std::cbrt(shape.volume() / static_cast<double>(count));
  return best_of(shape, kRadii, [&](double radius) {
    Description out;
    for (const Vec3& p : centre) out.blobs.push_back({.centre = p, .axes = Vec3::Constant(radius * spacing)});
    out.iso = best_iso(shape, out.blobs);
    return out;
  });
}

void print_row(const Shape& shape, const std::string& name, double error, const char* method, const Description& description, double cpu_s) {
  const Mesh surface = description.surface(shape.executor);
  if (surface.triangle.empty()) return;
  const SurfaceTree tree(surface);
  constexpr double kWithin = 0.05;  // of the error asked, as reports of fits have it
  const Distance from = measure(shape.mesh, surface, tree, kWithin * error, shape.executor), to = measure(surface, shape.mesh, shape.tree, kWithin * error, shape.executor);
  const MeshReport report = inspect(surface), data = inspect(shape.mesh);
  std::printf("{\"name\": \"fit/%s/error=%g/%s\", \"data\": \"%s\", \"asked\": %g, \"method\": \"%s\", \"primitives\": %zu, \"rms\": %.5g, \"largest\": %.5g, \"volume_error\": %.4g, \"pieces\": %zu, "
              "\"handles\": %ld, \"cpu_s\": %.3g}\n",
              name.c_str(), error, method, name.c_str(), error, method, description.blobs.size(), std::max(from.rms, to.rms), std::max(from.largest, to.largest), report.volume / data.volume - 1.0,
              static_cast<std::size_t>(report.components), static_cast<long>(report.components) - report.euler_characteristic / 2, cpu_s);
  std::fflush(stdout);
}

/// The fit of one particle, so that nothing but the surface limits the size of primitives.
FittedObject fit_one(const std::filesystem::path& file, double error) {
  constexpr std::uint32_t kMostPrimitives = 10000;
  return fit::fit(file, {.error = error, .particles = 1, .primitives = kMostPrimitives, .pieces = Pieces::Largest, .threads = 1});
}

void compare(const std::filesystem::path& file, double error) {
  const double start = cpu_seconds();
  const FittedObject object = fit_one(file, error);
  const double fitted = cpu_seconds();
  const double scale = 1.0 / object.report.diagonal;
  Mesh data = object.data;
  data.columns.clear();
  for (Vec3& p : data.position) p *= scale;
  const Shape shape(data);
  Description skeleton;
  for (const FittedPrimitive& p : object.primitives) {
    const bool round = !p.segment && p.semi_axes.x() == p.semi_axes.y() && p.semi_axes.x() == p.semi_axes.z();
    skeleton.blobs.push_back({.centre = scale * (object.particles[p.particle] + p.at), .axes = scale * p.semi_axes, .turn = p.orientation, .form = p.segment ? Form::Segment : round ? Form::Ball : Form::Ellipsoid});
  }
  const std::string name = file.stem().string();
  print_row(shape, name, error, "fit", skeleton, fitted - start);
  const std::size_t count = skeleton.blobs.size();
  double before = cpu_seconds();
  const Description packed = spheres(shape, count);
  print_row(shape, name, error, "spheres", packed, cpu_seconds() - before);
  before = cpu_seconds();
  const Description equal = equal_blobs(shape, count);
  print_row(shape, name, error, "equal", equal, cpu_seconds() - before);
}

}  // namespace

int supple::benchmarks::programs::fit_bench(int argc, char** argv) {
  constexpr std::string_view kUsage = "fit_bench DATA [ERROR...]    a mesh or points, and errors over the diagonal, such as 0.02";
  constexpr std::size_t kMostErrors = 20;
  answer_usage(argc, argv, kUsage, 1 + kMostErrors);
  if (argc < 2) refuse(kUsage, "a file of data", "");
  std::vector<double> errors;
  for (int i = 2; i < argc; ++i) errors.push_back(positive_number(kUsage, argv[i]));
  if (errors.empty()) errors = {0.1, 0.05, 0.02, 0.01};
  try {
    for (const double error : errors) compare(argv[1], error);
  } catch (const Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return static_cast<int>(error.kind());
  }
  return 0;
}
