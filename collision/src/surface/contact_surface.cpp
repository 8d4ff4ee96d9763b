#include "supple/collision/contact_surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/error.h"
#include "surface/kept_results.h"
#include "surface/pair_solver.h"

namespace supple::collision {
namespace {

/// Numbers of pairs, points and points of squeezed regions.
struct Extent {
  std::size_t pairs = 0, points = 0, volumes = 0;
  void operator+=(const Extent& other) {
    pairs += other.pairs;
    points += other.points;
    volumes += other.volumes;
  }
};

/// What a surface needs of one pair. @param parted  whether A, B have several parts, whose forces need the regions
Extent extent_of(const PairResult& result, const std::array<bool, 2>& parted) {
  if (result.summary.rule == ContactRule::None && result.summary.error_estimate == 0.0 && !(result.summary.energy > 0.0)) return {};
  Extent extent{1, result.points.point.size(), 0};
  for (std::size_t i = 0; i < result.points.volume_side.size() && (parted[0] || parted[1]); ++i) {
    extent.volumes += parted[result.points.volume_side[i]] ? 1 : 0;
  }
  return extent;
}

/// @param keep  never fewer entries than there are: what lies beyond is not written again when they are wanted
void resize(ContactSurface& out, const Extent& size, bool keep) {
  const auto to = [keep](std::size_t n, auto&... arrays) { (arrays.resize(keep ? std::max(n, arrays.size()) : n), ...); };
  to(size.pairs, out.summary);
  to(size.points, out.pair, out.point, out.normal, out.area, out.pressure);
  to(size.volumes, out.volume_pair, out.volume_side, out.volume_point, out.volume_weight);
}

/// Copies one pair that touches to its place.
void put(const PairResult& result, const std::array<bool, 2>& parted, const Extent& begin, ContactSurface& out) {
  const auto at = [](auto& to, std::size_t place) { return to.begin() + static_cast<std::ptrdiff_t>(place); };
  const auto index = static_cast<std::uint32_t>(begin.pairs);
  const PatchPoints& points = result.points;
  out.summary[index] = result.summary;
  std::fill_n(at(out.pair, begin.points), points.point.size(), index);
  std::copy(points.point.begin(), points.point.end(), at(out.point, begin.points));
  std::copy(points.normal.begin(), points.normal.end(), at(out.normal, begin.points));
  std::copy(points.area.begin(), points.area.end(), at(out.area, begin.points));
  std::copy(points.pressure.begin(), points.pressure.end(), at(out.pressure, begin.points));
  std::size_t place = begin.volumes;
  for (std::size_t i = 0; i < points.volume_side.size() && (parted[0] || parted[1]); ++i) {
    if (!parted[points.volume_side[i]]) continue;
    out.volume_pair[place] = index;
    out.volume_side[place] = points.volume_side[i];
    out.volume_point[place] = points.volume_point[i];
    out.volume_weight[place++] = points.volume_weight[i];
  }
}

}  // namespace

void ContactSurface::clear() {
  pair.clear();
  point.clear();
  normal.clear();
  area.clear();
  pressure.clear();
  volume_pair.clear();
  volume_side.clear();
  volume_point.clear();
  volume_weight.clear();
  summary.clear();
}

void solve_contact_surface(std::span<const ContactBody> bodies, const ContactCandidates& candidates,
                           const ContactSettings& settings, const Executor& executor, ContactSurface& out) {
  SUPPLE_EXPECTS(settings.error >= 1e-10 && settings.error <= 0.1);
  SUPPLE_EXPECTS(candidates.offset.size() == candidates.pair.size() + 1);
  if (candidates.pair.empty()) return out.clear();
  thread_local std::vector<PairResult> results;
  thread_local std::vector<Extent> begins;  // of blocks
  thread_local Partners partners;
  thread_local std::vector<Box> boxes;
  thread_local std::vector<SharedApex> shared_apex;
  boxes.resize(bodies.size());
  shared_apex.resize(settings.energy ? bodies.size() : 0);
  partners.build(bodies.size(), candidates.pair);
  // In portions, so that what pairs leave behind is joined while it is still near, and buffers stay small.
  constexpr std::size_t kMostKept = std::size_t{32} << 20;
  const std::size_t pairs = candidates.pair.size();
  if (results.size() < std::min(pairs, kPortion)) results.resize(std::min(pairs, kPortion));
  begins.resize(kPortion / kPairsTogether);
  struct Job {
    ContactQuery query;
    std::span<Box> boxes;
    std::span<SharedApex> shared_apex;
    std::vector<PairResult>& results;
    std::vector<Extent>& begins;
    ContactSurface& out;
    std::size_t first;
    [[nodiscard]] std::array<bool, 2> parted(std::size_t k) const {
      const BodyPair& pair = query.candidates.pair[first + k];
      return {query.bodies[pair.a].pose.size() > 1, query.bodies[pair.b].pose.size() > 1};
    }
  } job{{bodies, candidates, partners, boxes, shared_apex, settings}, boxes, shared_apex, results, begins, out, 0};
  constexpr std::size_t kBodies = 64;
  executor.for_blocks(bodies.size(), kBodies, [&job](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) job.boxes[i] = job.query.bodies[i].field ? job.query.bodies[i].field.surface_box() : Box{};
  });
  if (settings.energy) {
    constexpr std::size_t kApexes = 4;
    executor.for_blocks(bodies.size(), kApexes, [&job](std::size_t begin, std::size_t end) {
      thread_local PairSolver solver;
      for (std::size_t i = begin; i < end; ++i) job.shared_apex[i] = solver.find_apex(job.query, static_cast<std::uint32_t>(i));
    });
  }
  Extent size;
  for (; job.first < pairs; job.first += kPortion) {
    const std::size_t count = std::min(kPortion, pairs - job.first);
    executor.for_blocks(count, kPairsTogether, [&job](std::size_t begin, std::size_t end) {
      thread_local PairSolver solver;
      Extent block;
      for (std::size_t k = begin; k < end; ++k) {
        solver.solve(job.query, job.first + k, job.results[k]);
        block += extent_of(job.results[k], job.parted(k));
      }
      job.begins[begin / kPairsTogether] = block;
    });
    for (std::size_t block = 0; block * kPairsTogether < count; ++block) {
      const Extent extent = begins[block];
      begins[block] = size;
      size += extent;
    }
    resize(out, size, true);
    executor.for_blocks(count, kPairsTogether, [&job](std::size_t begin, std::size_t end) {
      Extent at = job.begins[begin / kPairsTogether];
      for (std::size_t k = begin; k < end; ++k) {
        const std::array<bool, 2> parted = job.parted(k);
        const Extent extent = extent_of(job.results[k], parted);
        if (extent.pairs > 0) put(job.results[k], parted, at, job.out);
        at += extent;
      }
    });
    keep_room(results, kMostKept);
  }
  resize(out, size, false);
}

std::vector<double> estimate_energies(std::span<const ContactBody> bodies, const ContactCandidates& candidates, const ContactSettings& settings,
                                      const Executor& executor, const ContactSurface& surface) {
  SUPPLE_EXPECTS(settings.energy);
  if (surface.summary.empty()) return {};
  constexpr double kFiner = 1e-2, kFine = 1e-6, kFinest = 1e-10;  // error of the other solution, over that of the surface; at most; at least
  constexpr double kSafety = 3.0, kAlike = 0.2, kMostAlike = 2e-5;  // over the difference; what both may miss alike, over the error and over the energy
  ContactSettings other = settings;
  other.error = std::clamp(kFiner * settings.error, kFinest, kFine);
  other.other_columns = true;
  ContactSurface compared;
  solve_contact_surface(bodies, candidates, other, executor, compared);
  std::vector<double> off(bodies.size(), 0.0), alike(bodies.size(), 0.0);  // how pairs share what a body loses depends on where its columns begin: all pairs of a body together do not
  const auto add = [&off](const ContactSurface& solved, double sign) {
    for (const ContactSurface::Summary& s : solved.summary) {
      off[s.bodies.a] += sign * s.energy_a;
      off[s.bodies.b] += sign * s.energy_b;
    }
  };
  add(surface, 1.0);
  const double share = std::min(kAlike * settings.error, kMostAlike);
  for (std::size_t i = 0; i < bodies.size(); ++i) alike[i] = share * std::abs(off[i]);
  add(compared, -1.0);
  std::vector<double> estimate;
  const auto of = [&](std::uint32_t body) { return kSafety * std::abs(off[body]) + alike[body]; };
  for (const ContactSurface::Summary& s : surface.summary) estimate.push_back(of(s.bodies.a) + of(s.bodies.b));
  return estimate;
}

}  // namespace supple::collision
