#include "fit/find_skeleton.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "fit/balls.h"
#include "fit/thin.h"
#include "supple/core/interrupt.h"

namespace supple::fit {
namespace {

/// Ellipsoids that begin as balls.
std::vector<Blob> blobs_of(std::span<const Ball> balls) {
  std::vector<Blob> out;
  for (const Ball& ball : balls) out.push_back({.centre = ball.centre, .axes = Vec3::Constant(ball.radius / kPointRadius), .form = Form::Ellipsoid});
  return out;
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

constexpr double kFirstLevel = 0.02;
constexpr std::array<double, 6> kNextLevels{0.03, 0.04, 0.05, 0.06, 0.08, 0.1};
constexpr double kEnough = 0.75;  // of the error: a distance between samples that leaves room for those between them
constexpr int kIterations = 8;

/// Balls that cover the surface, moved and resized, with more of them where the distances are larger than the error.
/// @param targets  receives points that have to be held to their side   @return what is left
Faults mend(const Data& data, double error, std::uint32_t most_blobs, const SolveOptions& solving, const Executor& executor, Targets& targets, FoundSkeleton& out) {
  constexpr double kReach = 0.6, kFirst = 0.35;  // of the error: balls reach samples, and distances that call for more
  constexpr double kLeastReach = 0.15, kFiner = 0.6;
  constexpr int kRounds = 8;
  std::vector<std::uint32_t> all(data.surface.position.size());
  std::iota(all.begin(), all.end(), 0U);
  std::vector<Ball> balls = cover_surface(data.surface, data.points, data.radius, all, kReach * error);
  cover_inside(data.around, data.largest_ball, balls);
  bool full = balls.size() > most_blobs;
  if (full) balls.resize(most_blobs);
  out = {.blobs = blobs_of(balls), .cell = std::min(0.5 * error, 1.0 / 128.0), .thinnest = kPointRadius * solving.smallest};
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
    full = full || blobs.size() > most_blobs;
    if (blobs.size() > most_blobs) blobs.resize(most_blobs);
    std::vector<Ball> more = cover_surface(data.surface, data.points, data.radius, faults.missed, reach);
    for (const Vec3& p : faults.inside) more.push_back({p, std::min(data.tree.distance(p), data.largest_ball)});
    full = full || blobs.size() + more.size() > most_blobs;
    more.resize(std::min<std::size_t>(more.size(), most_blobs - std::min<std::size_t>(most_blobs, blobs.size())));
    const std::vector<Blob> added = blobs_of(more);
    blobs.insert(blobs.end(), added.begin(), added.end());
  }
  out.full = full;
  return least;
}

}  // namespace

double first_level_of(double error) { return std::min(error, kFirstLevel); }

double level_of(double error) {
  double out = first_level_of(error);
  for (const double level : kNextLevels) {
    if (level <= error) out = level;
  }
  return out;
}

FoundSkeleton find_skeleton(const Data& data, double error, std::uint32_t most, const Executor& executor) {
  constexpr double kRms = 0.25;
  constexpr int kAttempts = 25, kFurtherAttempts = 12;
  const double first = first_level_of(error), last = level_of(error);
  SolveOptions solving{.iterations = kIterations, .smallest = 0.25 * first / kPointRadius, .largest = 1.5 * data.largest_ball / kPointRadius};
  Targets targets = targets_of(data);
  FoundSkeleton out;
  const Faults least = mend(data, first, most, solving, executor, targets, out);
  solving.iterations = kIterations / 2;  // from one attempt to the next little changes
  const auto thin_to = [&](double level, int attempts) {
    Faults limit = least;
    limit.largest = std::max(least.largest, kEnough * level);
    limit.rms = std::max(least.rms, kEnough * kRms * level);
    thin(data, limit, out.cell, attempts, solving, executor, targets, out.blobs);
  };
  thin_to(first, kAttempts);
  for (const double level : kNextLevels) {
    if (level <= last) thin_to(level, kFurtherAttempts);
  }
  // Balls that began thinner than the thinnest and that no step reached: the surface does not show them.
  constexpr double kRounding = 1.0 - 1e-9;
  std::erase_if(out.blobs, [&](const Blob& blob) { return (blob.form == Form::Segment ? blob.axes.y() : blob.axes.minCoeff()) < kRounding * solving.smallest; });
  return out;
}

}  // namespace supple::fit
