#include "fit/thin.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "supple/core/interrupt.h"

namespace supple::fit {
namespace {

constexpr double kCarries = 0.1;  // value with which a blob is at a sample, of the iso value 1/2

/// Samples that a blob reaches, in order, and its values there.
struct Reach {
  std::vector<std::uint32_t> sample;
  std::vector<double> value;
};

implicit::FieldParts parts_at_samples(const std::vector<Blob>& blobs, const Data& data) {
  implicit::Field field;
  implicit::FieldParts out;
  build_field(blobs, field);
  implicit::FieldView(field).evaluate_parts(data.surface.position, out);
  return out;
}

std::vector<Reach> reaches_of(const std::vector<Blob>& blobs, const Data& data, const implicit::FieldParts& parts) {
  std::vector<Reach> out(blobs.size());
  for (std::uint32_t s = 0; s < data.surface.position.size(); ++s) {
    for (std::uint32_t e = parts.offset[s]; e < parts.offset[s + 1]; ++e) {
      out[parts.part[e]].sample.push_back(s);
      out[parts.part[e]].value.push_back(parts.value[e]);
    }
  }
  return out;
}

/// Pairs of blobs that are at a common sample, sorted.
std::vector<std::array<std::uint32_t, 2>> neighbours(const implicit::FieldParts& parts) {
  constexpr double kTouches = 0.5 * kCarries;
  std::vector<std::array<std::uint32_t, 2>> out;
  for (std::size_t s = 0; s + 1 < parts.offset.size(); ++s) {
    for (std::uint32_t e = parts.offset[s]; e < parts.offset[s + 1]; ++e) {
      for (std::uint32_t f = parts.offset[s]; parts.value[e] > kTouches && f < e; ++f) {
        if (parts.value[f] > kTouches) out.push_back({std::min(parts.part[e], parts.part[f]), std::max(parts.part[e], parts.part[f])});
      }
    }
    constexpr std::size_t kMany = 100000;
    if (out.size() < kMany && s + 2 < parts.offset.size()) continue;
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
  }
  return out;
}

/// Sum of two blobs where either reaches.
Reach united(const Reach& a, const Reach& b) {
  constexpr std::uint32_t kEnd = std::numeric_limits<std::uint32_t>::max();
  Reach out;
  std::size_t i = 0, j = 0;
  while (i < a.sample.size() || j < b.sample.size()) {
    const std::uint32_t p = i < a.sample.size() ? a.sample[i] : kEnd, q = j < b.sample.size() ? b.sample[j] : kEnd;
    out.sample.push_back(std::min(p, q));
    out.value.push_back((p <= q ? a.value[i++] : 0.0) + (q <= p ? b.value[j++] : 0.0));
  }
  return out;
}

/// About even in index.
Reach thinned(const Reach& all, std::size_t most) {
  const std::size_t step = (all.sample.size() + most - 1) / most;
  Reach out;
  for (std::size_t k = 0; k < all.sample.size(); k += step) {
    out.sample.push_back(all.sample[k]);
    out.value.push_back(all.value[k]);
  }
  return out;
}

/// Semi-axes of an ellipsoid like the blob.
Vec3 extent(const Blob& blob) {
  return blob.form == Form::Segment ? Vec3(blob.axes.x() / kPointRadius + blob.axes.y(), blob.axes.y(), blob.axes.y()) : blob.axes;
}

/// An ellipsoid with the moments of two, all of one density; distances between centres count as parts of surfaces, which are smaller than supports.
Blob merged(const Blob& a, const Blob& b) {
  constexpr double kMoment = 0.2;  // of a solid ellipsoid, over the squares of its semi-axes
  const double of_a = extent(a).prod(), of_b = extent(b).prod(), share = of_a / (of_a + of_b);
  Mat3 moments = Mat3::Zero();
  Blob out;
  out.form = Form::Ellipsoid;
  out.centre = share * a.centre + (1.0 - share) * b.centre;
  for (const auto& [blob, weight] : {std::pair(&a, share), std::pair(&b, 1.0 - share)}) {
    const Mat3 q = blob->turn.toRotationMatrix();
    const Vec3 from = (blob->centre - out.centre) / kPointRadius;
    moments += weight * (q * (kMoment * extent(*blob).cwiseAbs2()).asDiagonal() * q.transpose() + from * from.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> solved(moments);
  Mat3 q = solved.eigenvectors().rowwise().reverse();
  if (q.determinant() < 0.0) q.col(2) = -q.col(2);
  out.turn = Quat(q);
  out.axes = (solved.eigenvalues().reverse() / kMoment).cwiseMax(0.0).cwiseSqrt();
  return out;
}

/// The rod whose moments are those of an ellipsoid; not a longer one, as no sample tells how far an end beyond all of them is.
Blob segment_of(const Blob& ellipsoid) {
  constexpr double kLength = 0.7745966692414834, kThickness = 0.8944271909999159;  // sqrt(3/5), sqrt(4/5): of a straight line and of a disc over an ellipsoid's semi-axes
  Blob out = ellipsoid;
  out.form = Form::Segment;
  const double radius = kThickness * std::sqrt(ellipsoid.axes.y() * ellipsoid.axes.z());
  out.axes = Vec3(kPointRadius * (kLength * ellipsoid.axes.x() - radius), radius, radius);
  return out;
}

/// Levenberg and Marquardt's method on values at samples, few steps. @return sum of squares of the distances by which samples would move
double match(Blob& blob, const Reach& wanted, const Data& data, const SolveOptions& solving) {
  using Square = Eigen::Matrix<double, kBlobParameters, kBlobParameters>;
  struct Sums {
    double cost = 0.0;
    BlobStep slope = BlobStep::Zero();
    Square second = Square::Zero();
  };
  const auto sums_of = [&](const Blob& one) {
    Sums out;
    for (std::size_t k = 0; k < wanted.sample.size(); ++k) {
      const BlobValue at = value_of(one, data.surface.position[wanted.sample[k]]);
      const double size = data.radius[wanted.sample[k]], rest = size * (at.value - wanted.value[k]);
      out.cost += rest * rest;
      out.slope += size * rest * at.slope;
      out.second.noalias() += size * size * at.slope * at.slope.transpose();
    }
    return out;
  };
  constexpr int kSteps = 6;
  constexpr double kFirstDamping = 0.01, kMostDamping = 1e3, kLeast = 1e-12;
  double damping = kFirstDamping;
  blob = moved(blob, BlobStep::Zero(), solving);
  Sums now = sums_of(blob);
  for (int step = 0; step < kSteps && damping < kMostDamping; ++step) {
    for (; damping < kMostDamping; damping *= 10.0) {
      Square system = now.second;
      system.diagonal() += damping * now.second.diagonal() + BlobStep::Constant(kLeast);
      const Blob tried = moved(blob, -system.llt().solve(now.slope), solving);
      const Sums then = sums_of(tried);
      if (!(then.cost < now.cost)) continue;
      blob = tried;
      now = then;
      damping *= 0.2;
      break;
    }
  }
  return now.cost;
}

/// One blob for two.
Change merge(const std::vector<Blob>& blobs, std::uint32_t a, std::uint32_t b, const std::vector<Reach>& reach, const Data& data, const SolveOptions& solving) {
  constexpr std::size_t kCompared = 300;
  constexpr double kClearly = 0.5;  // segments take the place of ellipsoids where they leave less than this share
  const Reach all = united(reach[a], reach[b]), wanted = thinned(all, kCompared);
  Change out;
  Blob ellipsoid = merged(blobs[a], blobs[b]);
  Blob segment = segment_of(ellipsoid);
  out.need = match(ellipsoid, wanted, data, solving);
  const double of_segment = match(segment, wanted, data, solving);
  const bool straight = of_segment < kClearly * out.need;
  if (straight) out.need = of_segment;
  out.need *= static_cast<double>(all.sample.size()) / static_cast<double>(wanted.sample.size());
  out.gone = {a, b};
  out.come = {straight ? segment : ellipsoid};
  for (std::size_t k = 0; k < all.sample.size(); ++k) {
    if (all.value[k] > kCarries) out.samples.push_back(all.sample[k]);
  }
  return out;
}

/// All but some.
template <class T>
std::vector<T> without(const std::vector<T>& all, const std::vector<std::uint32_t>& which) {
  std::vector<char> gone(all.size(), 0);
  for (const std::uint32_t k : which) gone[k] = 1;
  std::vector<T> out;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (gone[k] == 0) out.push_back(all[k]);
  }
  return out;
}

/// Which blobs may not go by a kind of change any more, as it failed.
struct Kept {
  std::vector<char> dropped, merged;

  [[nodiscard]] bool keeps(const Change& change) const {
    const std::vector<char>& kind = change.come.empty() ? dropped : merged;
    return std::any_of(change.gone.begin(), change.gone.end(), [&](std::uint32_t b) { return kind[b] != 0; });
  }
  void keep(const Change& change) {
    for (const std::uint32_t b : change.gone) (change.come.empty() ? dropped : merged)[b] = 1;
  }
};

/// The first changes, at most so many, no two of them of one blob or at one sample.
std::vector<const Change*> first_of(const std::vector<Change>& changes, const Kept& kept, std::size_t samples, std::size_t most) {
  std::vector<char> touched(samples, 0), used(kept.dropped.size(), 0);
  std::vector<const Change*> out;
  for (const Change& change : changes) {
    if (out.size() == most) break;
    const bool beside = std::any_of(change.samples.begin(), change.samples.end(), [&](std::uint32_t s) { return touched[s] != 0; });
    const bool taken = std::any_of(change.gone.begin(), change.gone.end(), [&](std::uint32_t b) { return used[b] != 0; });
    if (beside || taken || kept.keeps(change)) continue;
    for (const std::uint32_t s : change.samples) touched[s] = 1;
    for (const std::uint32_t b : change.gone) used[b] = 1;
    out.push_back(&change);
  }
  return out;
}

/// The change whose blobs are nearest to a point is not tried again.
void keep_nearest(const std::vector<const Change*>& tried, const std::vector<Blob>& blobs, const Vec3& p, Kept& kept) {
  double least = std::numeric_limits<double>::infinity();
  const Change* nearest = nullptr;
  for (const Change* change : tried) {
    for (const std::uint32_t b : change->gone) {
      const double distance = (blobs[b].centre - p).squaredNorm();
      if (!(distance < least)) continue;
      least = distance;
      nearest = change;
    }
  }
  if (nearest != nullptr) kept.keep(*nearest);
}

/// Blobs that are at no sample of changes: these stay as they are, so that what is right elsewhere stays so.
std::vector<char> apart_from(const std::vector<const Change*>& made, const std::vector<Blob>& blobs, const Data& data) {
  constexpr double kTouches = 0.5 * kCarries;
  std::vector<char> out(blobs.size(), 1);
  const implicit::FieldParts parts = parts_at_samples(blobs, data);
  for (const Change* change : made) {
    for (const std::uint32_t s : change->samples) {
      for (std::uint32_t e = parts.offset[s]; e < parts.offset[s + 1]; ++e) {
        if (parts.value[e] > kTouches) out[parts.part[e]] = 0;
      }
    }
  }
  return out;
}

}  // namespace

std::vector<Change> changes_of(const std::vector<Blob>& blobs, const Data& data, const SolveOptions& solving, const Executor& executor) {
  const implicit::FieldParts parts = parts_at_samples(blobs, data);
  const std::vector<Reach> reach = reaches_of(blobs, data, parts);
  std::vector<Change> out(blobs.size());
  for (std::uint32_t b = 0; b < blobs.size(); ++b) {
    out[b].gone = {b};
    for (std::size_t k = 0; k < reach[b].sample.size(); ++k) {
      const double distance = reach[b].value[k] * data.radius[reach[b].sample[k]];
      out[b].need += distance * distance;
      if (reach[b].value[k] > kCarries) out[b].samples.push_back(reach[b].sample[k]);
    }
  }
  const std::vector<std::array<std::uint32_t, 2>> pairs = neighbours(parts);
  out.resize(blobs.size() + pairs.size());
  constexpr std::size_t kBlock = 4;
  executor.for_blocks(pairs.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) out[blobs.size() + k] = merge(blobs, pairs[k][0], pairs[k][1], reach, data, solving);
  });
  std::stable_sort(out.begin(), out.end(), [](const Change& a, const Change& b) { return a.need < b.need; });
  return out;
}

void thin(const Data& data, const Faults& limit, double cell, int attempts, const SolveOptions& given, const Executor& executor, Targets& targets, std::vector<Blob>& blobs) {
  constexpr double kMostShare = 0.3, kApart = 0.5;
  SolveOptions solving = given;
  Kept kept{std::vector<char>(blobs.size(), 0), std::vector<char>(blobs.size(), 0)};
  std::vector<Change> changes;       // of the blobs, where they are known
  std::vector<char> wrong;           // middles on the wrong side of their surface, where known
  std::size_t batch = blobs.size();
  for (int attempt = 0; attempt < attempts && blobs.size() > 1; ++attempt) {
    heed_scope();
    if (changes.empty()) changes = changes_of(blobs, data, solving, executor);
    const auto most = static_cast<std::size_t>(kMostShare * static_cast<double>(blobs.size()));
    const std::vector<const Change*> made = first_of(changes, kept, data.surface.position.size(), std::max<std::size_t>(std::min(batch, most), 1));
    if (made.empty()) break;
    std::vector<std::uint32_t> gone;
    for (const Change* change : made) gone.insert(gone.end(), change->gone.begin(), change->gone.end());
    std::vector<Blob> tried = without(blobs, gone);
    for (const Change* change : made) tried.insert(tried.end(), change->come.begin(), change->come.end());
    solving.fixed = without(apart_from(made, blobs, data), gone);
    solving.fixed.resize(tried.size(), 0);
    balance(tried, targets, solving, executor);
    solve(tried, targets, solving, executor);
    implicit::Field field;
    build_field(tried, field);
    Faults faults = find_faults(data, field, cell, limit.largest, executor);
    if (faults.within(limit)) {
      batch = 2 * made.size();
      kept = {without(kept.dropped, gone), without(kept.merged, gone)};
      kept.dropped.resize(tried.size(), 0);
      kept.merged.resize(tried.size(), 0);
      blobs = std::move(tried);
      changes.clear();
      wrong.clear();
      continue;
    }
    if (faults.topology > limit.topology) {
      if (wrong.empty()) {
        implicit::Field before;
        build_field(blobs, before);
        wrong = wrong_middles(data, before);
      }
      add_pinched(data, field, wrong, kApart * limit.largest, faults);
      for (const std::vector<Vec3>* points : {&faults.inside, &faults.outside}) {
        for (const Vec3& p : *points) keep_nearest(made, blobs, p, kept);
      }
    }
    hold_signs(faults, data, limit.largest, targets);
    for (const std::uint32_t s : faults.missed) keep_nearest(made, blobs, data.surface.position[s], kept);
    if (made.size() == 1) kept.keep(*made.front());
    batch = made.size() / 2;
  }
}

}  // namespace supple::fit
