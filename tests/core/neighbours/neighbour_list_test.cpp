#include "supple/core/neighbour_list.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>

#include "core/support.h"
#include "supple/core/error.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;

/// Oriented particles at a density such that each has some twenty neighbours within a range of 1.
struct Crowd {
  std::vector<Vec3> position, normal;
  std::optional<PeriodicBox> box;
};

Crowd make_crowd(std::size_t count, std::uint64_t seed, bool periodic) {
  Draw draw(seed);
  Crowd crowd;
  const double size = std::max(3.0, std::cbrt(static_cast<double>(count) / 5.0));
  if (periodic) crowd.box = PeriodicBox{Vec3(-1.0, 0.5, 2.0), size * Vec3(1.0, 1.1, 0.95)};
  while (crowd.position.size() < count) {
    const Vec3 x = draw.vector(0.5 * size) + Vec3::Constant(0.5 * size);
    const double boxes = periodic ? std::round(draw.uniform(-3.0, 3.0)) : 0.0;
    crowd.position.push_back(x + boxes * size * Vec3::UnitX());
    crowd.normal.push_back(draw.direction());
  }
  return crowd;
}

Vec3 between(const Crowd& crowd, std::size_t i, std::size_t j) {
  const Vec3 r = crowd.position[j] - crowd.position[i];
  return crowd.box ? crowd.box->nearest_image(r) : r;
}

/// All pairs nearer than a distance, by visiting every pair.
std::vector<IndexPair> near_pairs(const Crowd& crowd, double distance) {
  std::vector<IndexPair> pairs;
  for (std::uint32_t i = 0; i < crowd.position.size(); ++i) {
    for (std::uint32_t j = i + 1; j < crowd.position.size(); ++j) {
      if (between(crowd, i, j).norm() < distance) pairs.push_back({i, j});
    }
  }
  return pairs;
}

NeighbourList make_list(const Crowd& crowd, const Executor& executor = Executor(1)) {
  NeighbourList list(1.0, 0.2, crowd.box);
  list.update(crowd.position, executor);
  return list;
}

const SurfaceLaws kSurface{.cohesion = {.r0 = 0.4, .f0 = 1.3, .a = 4.0},
                           .form = 0.7,
                           .curvature = 0.9,
                           .coplanarity = 1.1,
                           .conormality = 0.6,
                           .cocircularity = 0.8};

PairLoad conormality(double k, const Weight& weight, const PairPose& p) {
  const double d = p.r.norm(), unlike = (p.normal_a - p.normal_b).squaredNorm();
  const Weight::Value at = weight.at(d);
  const Vec3 torque = 2.0 * k * at.psi * p.normal_a.cross(p.normal_b);
  return {.energy = k * at.psi * unlike,
          .force_b = -k * at.slope * unlike / d * p.r,
          .torque_a = torque,
          .torque_b = -torque};
}

PairLoad cocircularity(double k, const Weight& weight, const PairPose& p) {
  const double d = p.r.norm(), c = (p.normal_a + p.normal_b).dot(p.r);
  const Weight::Value at = weight.at(d);
  return {.energy = k * at.psi * c * c,
          .force_b = -2.0 * k * c * at.psi * (p.normal_a + p.normal_b) - k * c * c * at.slope / d * p.r,
          .torque_a = -2.0 * k * c * at.psi * p.normal_a.cross(p.r),
          .torque_b = -2.0 * k * c * at.psi * p.normal_b.cross(p.r)};
}

/// Calls use(i, j, load) for every pair in range, law by law.
template <class Use>
void for_surface_loads(const Crowd& crowd, const SurfaceLaws& law, const Use& use) {
  const Weight weight{.range = 1.0};
  for (const IndexPair& pair : near_pairs(crowd, 1.0)) {
    PairPose pose;
    pose.r = between(crowd, pair.first, pair.second);
    pose.normal_a = crowd.normal[pair.first];
    pose.normal_b = crowd.normal[pair.second];
    use(pair, evaluate(law.cohesion, pose));
    use(pair, evaluate(Form{.strength = law.form, .curvature = law.curvature, .weight = weight}, pose));
    use(pair, evaluate(Coplanarity{.strength = law.coplanarity, .weight = weight}, pose));
    use(pair, conormality(law.conormality, weight, pose));
    use(pair, cocircularity(law.cocircularity, weight, pose));
  }
}

Loads surface_loads(const Crowd& crowd, const Executor& executor = Executor(1),
                    Precision precision = Precision::Double) {
  NeighbourList list = make_list(crowd, executor);
  Loads loads;
  loads.reset(crowd.position.size());
  accumulate_geometric(list, kSurface, crowd.normal, executor, loads, precision);
  return loads;
}

Loads twelve_six_loads(const Crowd& crowd, const Executor& executor = Executor(1),
                       Precision precision = Precision::Double) {
  NeighbourList list = make_list(crowd, executor);
  Loads loads;
  loads.reset(crowd.position.size());
  accumulate_geometric(list, TwelveSix{.epsilon = 0.3, .sigma = 0.5}, executor, loads, precision);
  return loads;
}

TEST(NeighbourLists, HoldThePairsInReachAndNoOthers) {
  for (const bool periodic : {false, true}) {
    for (const std::size_t count : {0U, 1U, 2U, 9U, 65U, 700U}) {
      const Crowd crowd = make_crowd(count, 50 + count, periodic);
      // The search rounds coordinates to floats, 2^-24 of the extent, and errs to the safe side.
      const std::vector<IndexPair> found = make_list(crowd).pairs();
      const std::vector<IndexPair> least = near_pairs(crowd, 1.2), most = near_pairs(crowd, 1.2 + 1e-5);
      EXPECT_TRUE(std::includes(found.begin(), found.end(), least.begin(), least.end())) << count << periodic;
      EXPECT_TRUE(std::includes(most.begin(), most.end(), found.begin(), found.end())) << count << periodic;
    }
  }
}

TEST(NeighbourLists, HoldPointsFarApartOnTopOfEachOtherAndInOnePlane) {
  for (const double far : {1e3, 1e9, 1e12}) {
    Crowd crowd = make_crowd(200, 61, false);
    crowd.position[7] = Vec3(far, -far, 0.0);
    crowd.position[8] = crowd.position[9];
    const std::vector<IndexPair> found = make_list(crowd).pairs();
    const std::vector<IndexPair> least = near_pairs(crowd, 1.2);
    EXPECT_TRUE(std::includes(found.begin(), found.end(), least.begin(), least.end())) << far;
  }
  Crowd flat = make_crowd(400, 62, false);
  for (Vec3& x : flat.position) x.z() = 1e4;
  EXPECT_EQ(make_list(flat).pairs().size(), near_pairs(flat, 1.2).size());
}

TEST(NeighbourLists, AreKeptUntilAParticleHasMovedHalfTheSkin) {
  Crowd crowd = make_crowd(300, 51, true);
  const Executor executor(1);
  NeighbourList list = make_list(crowd);
  const std::vector<Vec3> start = crowd.position;
  Draw draw(52);
  for (Vec3& x : crowd.position) x += 0.0999 * draw.direction();
  EXPECT_FALSE(list.update(crowd.position, executor));
  const std::vector<IndexPair> kept = list.pairs(), now = near_pairs(crowd, 1.0);
  EXPECT_TRUE(std::includes(kept.begin(), kept.end(), now.begin(), now.end()));
  crowd.position[299] = start[299] + Vec3(0.0, 0.1001, 0.0);
  EXPECT_TRUE(list.update(crowd.position, executor));
  EXPECT_FALSE(list.update(crowd.position, executor));
}

TEST(NeighbourLists, GoOnWithTheSameBitsFromTheirReferencePositions) {
  Crowd crowd = make_crowd(500, 53, true);
  const Executor executor(1);
  NeighbourList list = make_list(crowd);
  StateWriter writer;
  list.save(writer);
  Draw draw(54);
  for (Vec3& x : crowd.position) x += 0.09 * draw.direction();
  NeighbourList other(1.0, 0.2, crowd.box);
  StateReader reader(writer.bytes());
  other.load(reader);
  Hasher one, two;
  list.hash(one);
  other.hash(two);
  EXPECT_EQ(one.value(), two.value());
  const auto loads_of = [&](NeighbourList& from) {
    EXPECT_FALSE(from.update(crowd.position, executor));
    Loads loads;
    loads.reset(crowd.position.size());
    accumulate_geometric(from, kSurface, crowd.normal, executor, loads);
    return test::hash_of(loads);
  };
  EXPECT_EQ(loads_of(list), loads_of(other));
}

TEST(NeighbourLists, RefuseABoxShorterThanTwiceTheirReach) {
  EXPECT_THROW(NeighbourList(1.0, 0.2, PeriodicBox{Vec3::Zero(), Vec3(5.0, 2.3, 5.0)}), ContractViolation);
  EXPECT_THROW(NeighbourList(0.0, 0.2), ContractViolation);
  EXPECT_THROW(NeighbourList(1.0, 0.0), ContractViolation);
}

TEST(PeriodicBoxes, GiveTheShortestImage) {
  const PeriodicBox box{Vec3(5.0, 5.0, 5.0), Vec3(2.0, 3.0, 4.0)};
  EXPECT_EQ(box.nearest_image(Vec3(1.5, -1.25, 9.0)), Vec3(-0.5, -1.25, 1.0));
}

TEST(TwelveSixForces, AreThoseOfEveryPairInRange) {
  for (const bool periodic : {false, true}) {
    for (const std::size_t count : {2U, 9U, 64U, 700U}) {
      const Crowd crowd = make_crowd(count, 70 + count, periodic);
      const Loads loads = twelve_six_loads(crowd);
      std::vector<Vec3> force(count, Vec3::Zero());
      std::vector<double> scale(count, 0.0);
      for (const IndexPair& pair : near_pairs(crowd, 1.0)) {
        const Vec3 r = between(crowd, pair.first, pair.second);
        const double d = r.norm(), s6 = std::pow(0.5 / d, 6.0);
        const Vec3 f = 4.0 * 0.3 * (12.0 * s6 * s6 - 6.0 * s6) / (d * d) * r;
        force[pair.first] -= f;
        force[pair.second] += f;
        const double size = 4.0 * 0.3 * (12.0 * s6 * s6 + 6.0 * s6) / d;
        scale[pair.first] += size;
        scale[pair.second] += size;
      }
      // Positions of images are rounded to 1e-16 of the box and enter with the power 13.
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_LE((loads.force[i] - force[i]).norm(), 1e-12 * scale[i]) << count << ' ' << i << periodic;
      }
    }
  }
}

TEST(SurfaceLoads, AreThoseOfTheFiveLawsOfEveryPairInRange) {
  for (const bool periodic : {false, true}) {
    for (const std::size_t count : {2U, 9U, 64U, 700U}) {
      const Crowd crowd = make_crowd(count, 80 + count, periodic);
      const Loads loads = surface_loads(crowd);
      Loads reference;
      reference.reset(count);
      std::vector<double> force(count, 0.0), torque(count, 0.0);
      for_surface_loads(crowd, kSurface, [&](const IndexPair& pair, const PairLoad& load) {
        reference.force[pair.first] -= load.force_b;
        reference.force[pair.second] += load.force_b;
        reference.torque[pair.first] += load.torque_a;
        reference.torque[pair.second] += load.torque_b;
        for (const std::uint32_t i : {pair.first, pair.second}) {
          force[i] += load.force_b.norm();
          torque[i] += load.torque_a.norm() + load.torque_b.norm();
        }
      });
      // Some tens of roundings of the terms; form divides by d^2, which magnifies those of r for near pairs.
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_LE((loads.force[i] - reference.force[i]).norm(), 1e-12 * force[i]) << count << ' ' << i << periodic;
        EXPECT_LE((loads.torque[i] - reference.torque[i]).norm(), 1e-12 * torque[i]) << count << ' ' << i << periodic;
      }
    }
  }
}

TEST(SurfaceLoads, GiveNoForceAndNoMomentToTheWhole) {
  const Crowd crowd = make_crowd(2000, 55, false);
  const Loads loads = surface_loads(crowd);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double force_scale = 0.0, moment_scale = 0.0;
  for (std::size_t i = 0; i < crowd.position.size(); ++i) {
    force += loads.force[i];
    moment += crowd.position[i].cross(loads.force[i]) + loads.torque[i];
    force_scale += loads.force[i].norm();
    moment_scale += crowd.position[i].norm() * loads.force[i].norm();
  }
  EXPECT_LE(force.norm(), 1e-14 * force_scale);
  EXPECT_LE(moment.norm(), 1e-14 * moment_scale);
}

TEST(GeometricLoads, HaveTheSameBitsForEveryNumberOfThreads) {
  for (const bool periodic : {false, true}) {
    const Crowd crowd = make_crowd(20000, 56, periodic);
    const std::uint64_t surface = test::hash_of(surface_loads(crowd)), radial = test::hash_of(twelve_six_loads(crowd));
    for (const int threads : {2, 3, 8}) {
      EXPECT_EQ(test::hash_of(surface_loads(crowd, Executor(threads))), surface) << threads;
      EXPECT_EQ(test::hash_of(twelve_six_loads(crowd, Executor(threads))), radial) << threads;
    }
  }
}

TEST(GeometricLoads, HaveTheSameBitsForEveryVectorWidth) {
  const Crowd crowd = make_crowd(3000, 57, true);
  const std::uint64_t surface = test::hash_of(surface_loads(crowd)), radial = test::hash_of(twelve_six_loads(crowd));
  for (const auto target : {HWY_AVX2, HWY_AVX3}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    EXPECT_EQ(test::hash_of(surface_loads(crowd)), surface) << hwy::TargetName(target);
    EXPECT_EQ(test::hash_of(twelve_six_loads(crowd)), radial) << hwy::TargetName(target);
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// The crowd moved far away: in coordinates of single precision separations would be known to 2^-8 only.
Crowd far_away(Crowd crowd) {
  for (Vec3& x : crowd.position) x += Vec3(65536.0, -65536.0, 65536.0);
  return crowd;
}

TEST(SingleForces, AgreeWithDoubleToSinglePrecisionHoweverFarFromTheOrigin) {
  // Separations are rounded to u = 2^-24 of themselves and to 2^-29 of 1.2 in each coordinate, 2e-9; of r = 0.1 or
  // more that is 2 u in all. Power 13 and some ten roundings: 40 u of each pair's force.
  constexpr double kUnit = 0x1p-24;
  for (const bool periodic : {false, true}) {
    for (const std::size_t count : {2U, 9U, 64U, 700U}) {
      Crowd crowd = make_crowd(count, 90 + count, periodic);
      if (!periodic) crowd = far_away(crowd);
      const Loads loads = twelve_six_loads(crowd, Executor(1), Precision::SingleForces);
      const Loads exact = twelve_six_loads(crowd);
      std::vector<double> scale(count, 0.0);
      for (const IndexPair& pair : near_pairs(crowd, 1.0)) {
        const double d = between(crowd, pair.first, pair.second).norm(), s6 = std::pow(0.5 / d, 6.0);
        const double size = 4.0 * 0.3 * (12.0 * s6 * s6 + 6.0 * s6) / d * std::max(1.0, 0.1 / d);
        scale[pair.first] += size;
        scale[pair.second] += size;
      }
      bool rounded = count < 64;
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_LE((loads.force[i] - exact.force[i]).norm(), 40.0 * kUnit * scale[i]) << count << ' ' << i << periodic;
        rounded = rounded || (loads.force[i] - exact.force[i]).norm() > 0.01 * kUnit * scale[i];
      }
      EXPECT_TRUE(rounded);
    }
  }
}

TEST(SingleForces, OfTheFiveLawsAgreeWithDoubleToSinglePrecision) {
  // As above; n_i . r and n_j . r cancel, so a pair's error is that of the sum of its terms. A term of form grows as
  // 1/d^3, so near pairs are given more: the bound is 40 u of the size of all five terms with their factors.
  constexpr double kUnit = 0x1p-24;
  for (const bool periodic : {false, true}) {
    const std::size_t count = 700;
    Crowd crowd = make_crowd(count, 94, periodic);
    if (!periodic) crowd = far_away(crowd);
    const Loads loads = surface_loads(crowd, Executor(1), Precision::SingleForces), exact = surface_loads(crowd);
    std::vector<double> scale(count, 0.0);
    for (const IndexPair& pair : near_pairs(crowd, 1.0)) {
      const double d = between(crowd, pair.first, pair.second).norm();
      const double cohesion = kSurface.cohesion.f0 * kSurface.cohesion.r0 / d * std::pow(1.0 + d / 0.4, 3.0);
      const double form = kSurface.form / (d * d) * (2.0 + kSurface.curvature * d) * (2.0 / d + kSurface.curvature);
      const double others = kSurface.coplanarity * d + 4.0 * kSurface.conormality + 4.0 * kSurface.cocircularity * d;
      for (const std::uint32_t i : {pair.first, pair.second}) {
        scale[i] += (cohesion + 8.0 * (form + others)) * std::max(1.0, 0.1 / d);
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_LE((loads.force[i] - exact.force[i]).norm(), 40.0 * kUnit * scale[i]) << i << periodic;
      EXPECT_LE((loads.torque[i] - exact.torque[i]).norm(), 40.0 * kUnit * scale[i]) << i << periodic;
    }
  }
}

TEST(SingleForces, KeepMomentumAsDoublesDo) {
  const Crowd crowd = make_crowd(2000, 95, false);
  for (const bool surface : {false, true}) {
    const Loads loads = surface ? surface_loads(crowd, Executor(1), Precision::SingleForces)
                                : twelve_six_loads(crowd, Executor(1), Precision::SingleForces);
    Vec3 force = Vec3::Zero();
    double scale = 0.0;
    for (const Vec3& f : loads.force) {
      force += f;
      scale += f.norm();
    }
    EXPECT_LE(force.norm(), 1e-14 * scale) << surface;
  }
}

TEST(SingleForces, HaveTheSameBitsForEveryNumberOfThreadsAndEveryVectorWidth) {
  const Crowd crowd = make_crowd(20000, 96, true);
  const auto hash = [&](int threads) {
    const Executor executor(threads);
    return test::hash_of(surface_loads(crowd, executor, Precision::SingleForces)) ^
           (3 * test::hash_of(twelve_six_loads(crowd, executor, Precision::SingleForces)));
  };
  const std::uint64_t one = hash(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(hash(threads), one) << threads;
  for (const auto target : {HWY_AVX2, HWY_AVX3}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    EXPECT_EQ(hash(1), one) << hwy::TargetName(target);
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(GeometricLoads, AllocateNothingAfterTheFirstCall) {
  const Crowd crowd = make_crowd(5000, 58, true);
  for (const int threads : {1, 2}) {
    const Executor executor(threads);
    NeighbourList list(1.0, 0.2, crowd.box);
    std::vector<Vec3> moved = crowd.position;
    for (Vec3& x : moved) x += Vec3(0.15, 0.0, 0.0);
    Loads loads;
    loads.reset(crowd.position.size());
    const auto step = [&](const std::vector<Vec3>& positions) {
      list.update(positions, executor);
      accumulate_geometric(list, kSurface, crowd.normal, executor, loads);
    };
    step(crowd.position);
    step(moved);
    const std::uint64_t before = supple::test::allocation_count();
    step(crowd.position);
    step(moved);
    EXPECT_EQ(supple::test::allocation_count(), before) << threads;
  }
}

TEST(TwelveSixForces, KeepTheEnergyOfAMelt) {
  // 500 atoms of an fcc lattice, cut off where force and energy jump: 2.5 sigma. Velocity Verlet holds the energy of
  // the smooth part to (omega dt)^2; what crosses the cut-off takes 4 (2.5^-12 - 2.5^-6) = 0.0163 each time.
  constexpr int kCells = 5;
  const double edge = std::cbrt(4.0 / 0.8442);
  const PeriodicBox box{Vec3::Zero(), Vec3::Constant(kCells * edge)};
  std::vector<Vec3> x, v;
  Draw draw(59);
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    const Vec3 corner(i % kCells, i / kCells % kCells, i / kCells / kCells);
    for (const Vec3& basis : {Vec3(0, 0, 0), Vec3(0.5, 0.5, 0), Vec3(0.5, 0, 0.5), Vec3(0, 0.5, 0.5)}) {
      x.push_back(edge * (corner + basis));
      v.push_back(draw.vector(1.5));
    }
  }
  const Executor executor(1);
  NeighbourList list(2.5, 0.3, box);
  Loads loads;
  const auto forces = [&] {
    list.update(x, executor);
    loads.reset(x.size());
    accumulate_geometric(list, TwelveSix{}, executor, loads);
  };
  const auto energy = [&] {
    const double at_cut = 4.0 * (std::pow(2.5, -12.0) - std::pow(2.5, -6.0));
    double sum = 0.0;
    for (const IndexPair& pair : list.pairs()) {
      const double d = box.nearest_image(x[pair.second] - x[pair.first]).norm();
      if (d < 2.5) sum += 4.0 * (std::pow(d, -12.0) - std::pow(d, -6.0)) - at_cut;
    }
    for (const Vec3& u : v) sum += 0.5 * u.squaredNorm();
    return sum;
  };
  forces();
  const double start = energy();
  double largest = 0.0;
  const double dt = 0.002;
  for (int step = 0; step < 250; ++step) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      v[i] += 0.5 * dt * loads.force[i];
      x[i] += dt * v[i];
    }
    forces();
    for (std::size_t i = 0; i < x.size(); ++i) v[i] += 0.5 * dt * loads.force[i];
    if (step % 10 == 9) largest = std::max(largest, std::abs(energy() - start));
  }
  // omega^2 = 57 * 2^(5/3) 12 / 12: omega dt = 0.03 for the stiffest pairs; the shifted energy is continuous.
  EXPECT_LE(largest, 1e-3 * std::abs(start));
}

}  // namespace
}  // namespace supple::core
