#include "fit/faults.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fit/balls.h"
#include "fit/measure.h"

namespace supple::fit {
namespace {

constexpr std::size_t kSamples = 16000;

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

/// Centres of the balls that touch the samples from inside, and of those from outside.
std::vector<Vec3> middles(const Data& data) {
  std::vector<Vec3> out;
  for (const double side : {-1.0, 1.0}) {
    const std::vector<double>& radius = side < 0.0 ? data.touching : data.hollow;
    for (std::size_t k = 0; k < radius.size(); ++k) out.push_back(data.surface.position[k] + side * radius[k] * data.surface.normal[k]);
  }
  return out;
}

}  // namespace

long genus_of(const MeshReport& mesh) { return static_cast<long>(mesh.components) - mesh.euler_characteristic / 2; }

Data::Data(const Mesh& given, double most, double error, const Executor& executor)
    : mesh(given), tree(given), surface(sample_surface(given, kSamples)), points(surface.position), largest_ball(most), genus(genus_of(inspect(given))), pieces(inspect(given).components) {
  constexpr double kStep = 1.0 / 48.0;
  around = sample_surroundings(mesh, tree, kStep, executor);
  constexpr double kSlack = 0.2, kBeforeHollow = 2.0;  // balls larger than a hollow blend across it
  touching = touching_radii(surface, points, -1.0, most, kSlack * error, executor);
  hollow = touching_radii(surface, points, 1.0, most, kSlack * error, executor);
  radius = touching;
  for (std::size_t k = 0; k < radius.size(); ++k) radius[k] = std::min(radius[k], std::max(kBeforeHollow * hollow[k], error));
}

double share_thinner_than(const Data& data, double radius) {
  std::size_t thin = 0;
  for (std::size_t k = 0; k < data.touching.size(); ++k) thin += std::min(data.touching[k], data.hollow[k]) < radius ? 1U : 0U;
  return static_cast<double>(thin) / static_cast<double>(data.touching.size());
}

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

std::vector<char> wrong_middles(const Data& data, const implicit::Field& field) {
  const std::vector<Vec3> middle = middles(data);
  std::vector<double> value(middle.size());
  implicit::FieldView(field).evaluate(middle, value);
  const std::size_t samples = data.surface.position.size();
  std::vector<char> out(middle.size());
  for (std::size_t k = 0; k < middle.size(); ++k) {
    const bool inside = k < samples, bounded = (inside ? data.touching[k] : data.hollow[k - samples]) < data.largest_ball;
    out[k] = bounded && (inside ? value[k] < 0.0 : value[k] > 0.0) ? 1 : 0;
  }
  return out;
}

void add_pinched(const Data& data, const implicit::Field& field, const std::vector<char>& before, double apart, Faults& faults) {
  const std::vector<Vec3> middle = middles(data);
  const std::vector<char> now = wrong_middles(data, field);
  for (std::size_t k = 0; k < now.size(); ++k) {
    if (now[k] == 0 || before[k] != 0) continue;
    std::vector<Vec3>& out = k < data.surface.position.size() ? faults.inside : faults.outside;
    const auto close = [&](const Vec3& p) { return (p - middle[k]).squaredNorm() < apart * apart; };
    if (std::none_of(out.begin(), out.end(), close)) out.push_back(middle[k]);
  }
}

void hold_signs(const Faults& faults, const Data& data, double least, Targets& targets) {
  constexpr double kWeight = 4.0;  // over the distance
  const auto weight = [&](const Vec3& p) { return kWeight * std::max(data.tree.distance(p), least); };
  for (const Vec3& p : faults.inside) targets.inside.add(p, weight(p));
  for (const Vec3& p : faults.outside) targets.outside.add(p, weight(p));
}

}  // namespace supple::fit
