#include "supple/core/interactions.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "core/support.h"
#include "supple/core/error.h"
#include "supple/core/integrate.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

/// Laws on the chain of a crowd, bond frames apart.
constexpr std::size_t kChainLaws = 13;

/// A crowd with every law at work: bonds of all kinds on a chain, geometric laws within and between two objects.
struct Crowd {
  Particles p;
  Interactions interactions;
};

Crowd make_crowd(std::size_t count, std::uint64_t seed) {
  Draw draw(seed);
  Crowd crowd;
  Particles& p = crowd.p;
  const double size = 0.25 * std::cbrt(static_cast<double>(count));
  for (std::size_t i = 0; i < count; ++i) {
    p.add(draw.vector(size), draw.uniform(0.5, 2.0), draw.uniform(0.01, 0.1));
    p.set.object.back() = i < count / 2 ? 0 : 1;
    p.set.normal.back() = draw.direction();
    p.state.orientation.back() = draw.rotation();
    p.state.velocity.back() = draw.vector(1.0);
    p.state.angular_momentum.back() = draw.vector(0.05);
  }
  Interactions& all = crowd.interactions;
  all.cohesion.resize(1);
  all.form.resize(1);
  all.form_radius.resize(1);
  all.coplanarity.resize(2);
  all.normalised_coplanarity.resize(1);
  all.co_normality.resize(1);
  all.co_circularity.resize(1);
  all.normalised_co_circularity.resize(1);
  all.lennard_jones.resize(1);
  all.linear_cohesion.resize(1);
  all.directed_cohesion.resize(1);
  all.tabulated_cohesion.resize(1);
  all.directed_form.resize(1);
  const auto table = std::make_shared<const CohesionTable>(CohesionTable::with_error(4.0, 1e-4));
  all.bond_frame.push_back(test::bond_frames(p, 30.0, 0.5));
  for (std::size_t i = 0; i < count; ++i) {  // away from rest
    p.state.position[i] += draw.vector(0.1);
    p.state.orientation[i] = rotation_exp(draw.vector(0.8)) * p.state.orientation[i];
  }
  const auto add = [](auto& list, std::uint32_t a, std::uint32_t b, const auto& law) {
    list.first.push_back(a);
    list.second.push_back(b);
    list.law.push_back(law);
  };
  test::along_chain(count, 3, [&](std::uint32_t a, std::uint32_t b) {
    const Weight weight{.range = draw.uniform(0.5, 3.0)};
    add(all.cohesion[0], a, b, Cohesion{.r0 = draw.uniform(0.3, 0.8), .f0 = 2.0, .a = 4.0});
    add(all.form[0], a, b, Form{.strength = 0.2, .curvature = draw.uniform(-2, 2), .weight = weight});
    add(all.form_radius[0], a, b, FormRadius{.strength = 0.3, .radius = draw.uniform(0.2, 2), .weight = {}});
    add(all.coplanarity[b % 2], a, b, Coplanarity{.strength = 0.4, .weight = weight});
    add(all.normalised_coplanarity[0], a, b, NormalisedCoplanarity{.strength = 0.3, .weight = weight});
    add(all.co_normality[0], a, b, CoNormality{.strength = 0.4, .weight = weight});
    add(all.co_circularity[0], a, b, CoCircularity{.strength = 0.3, .weight = weight});
    add(all.normalised_co_circularity[0], a, b, NormalisedCoCircularity{.strength = 0.2, .weight = weight});
    LennardJones lennard_jones{.r0 = draw.uniform(0.2, 0.4), .depth = 0.1, .repulsive = 3 + static_cast<int>(a % 5),
                               .attractive = 1 + static_cast<int>(b % 2)};
    if (a % 3 > 0) lennard_jones.cut_off = 3.0 * lennard_jones.r0;
    if (a % 3 > 1) lennard_jones.switch_from = 0.5 * lennard_jones.r0;
    add(all.lennard_jones[0], a, b, lennard_jones);
    add(all.linear_cohesion[0], a, b,
        LinearCohesion{.r0 = draw.uniform(0.3, 0.8), .f0 = 0.5, .a = 4.0, .eta = draw.uniform(0.0, 0.3)});
    add(all.directed_cohesion[0], a, b,
        DirectedCohesion{.scale = 0.5,
                         .a = 3.0,
                         .semi_axes_a = Vec3(0.2, 0.3, 0.25),
                         .semi_axes_b = Vec3(0.3, 0.2, draw.uniform(0.1, 0.3))});
    DirectedForm directed_form{.strength = 0.1, .shape_a = Mat3::Zero(), .shape_b = Mat3::Zero(), .weight = weight};
    directed_form.shape_a << 0.7, 0.1, -0.3, 0.1, -0.4, 0.2, -0.3, 0.2, draw.uniform(-1, 1);
    directed_form.shape_b << 0.2, -0.3, 0.1, -0.3, 0.9, 0.6, 0.1, 0.6, draw.uniform(-1, 1);
    add(all.directed_form[0], a, b, directed_form);
    add(all.tabulated_cohesion[0], a, b, TabulatedCohesion{.r0 = draw.uniform(0.3, 0.8), .f0 = 0.5, .table = table});
  });
  const Cohesion cohesion{.r0 = 0.3, .f0 = 1.0, .a = 8.0};
  all.geometric_cohesion.push_back(
      {.name = "own", .object_a = 0, .object_b = 0, .range = cohesion.influence_radius(1e-3), .law = cohesion});
  const LinearCohesion linear{.r0 = 0.3, .f0 = 0.4, .a = 8.0, .eta = 0.1};
  all.geometric_linear_cohesion.push_back(
      {.name = "linear", .object_a = 1, .object_b = 1, .range = linear.influence_radius(1e-3), .law = linear});
  const TabulatedCohesion tabulated{.r0 = 0.2, .f0 = 0.4, .table = table};
  all.geometric_tabulated_cohesion.push_back(
      {.name = "table", .object_a = 0, .object_b = 1, .range = 0.2 * table->end(), .law = tabulated});
  const LennardJones lennard_jones{.r0 = 0.25, .depth = 0.02, .repulsive = 4, .attractive = 2, .cut_off = 0.6};
  all.geometric_lennard_jones.push_back(
      {.name = "both", .object_a = 0, .object_b = 1, .range = lennard_jones.cut_off, .law = lennard_jones});
  const Repulsion repulsion{.force = 1.0, .distance = 0.3, .length = 0.05, .tolerance = 1e-3};
  all.repulsion.push_back(
      {.name = "other", .object_a = 1, .object_b = 0, .range = repulsion.cut_off(), .law = repulsion});
  const Weight ending{.range = 0.5};
  all.geometric_coplanarity.push_back(
      {.name = "flat", .object_a = 0, .object_b = 1, .range = 0.5, .law = {.strength = 0.4, .weight = ending}});
  all.geometric_co_normality.push_back(
      {.name = "parallel", .object_a = 0, .object_b = 0, .range = 0.5, .law = {.strength = 0.3, .weight = ending}});
  all.geometric_co_circularity.push_back(
      {.name = "round", .object_a = 1, .object_b = 1, .range = 0.5, .law = {.strength = 0.2, .weight = ending}});
  all.gravity = Vec3(0.1, 0.0, -9.81);
  all.external.push_back({.particle = 3, .force = Vec3(1, 2, 3), .torque = Vec3(0, 0, 4), .begin = 0, .end = 1});
  return crowd;
}

struct Evaluated {
  Loads internal, external;
  InteractionCounts counts;
};

Evaluated evaluate_loads(const Particles& p, const Interactions& interactions, const Executor& executor,
                         double time = 0.5) {
  Evaluated result;
  result.internal.reset(p.set.size());
  result.external.reset(p.set.size());
  InteractionWorkspace workspace(p.set, interactions);
  result.counts = accumulate_interactions(p.set, p.state, interactions, executor, workspace, result.internal);
  add_external_loads(p.set, interactions, time, result.external);
  return result;
}

std::uint64_t hash_of(const Evaluated& loads) {
  Hasher hasher;
  for (const Loads* part : {&loads.internal, &loads.external}) {
    hasher.add(part->force);
    hasher.add(part->torque);
  }
  return hasher.value();
}

/// Within a few hundred roundings of terms up to the largest.
void expect_reference_laws(const Particles& p, const Interactions& interactions) {
  const Evaluated fast = evaluate_loads(p, interactions, Executor(1));
  Loads reference;
  reference.reset(p.set.size());
  double scale = 0.0;
  for (const LawReport& report : report_laws(p.set, p.state, interactions, 0.5)) {
    for (std::size_t i = 0; i < p.set.size(); ++i) {
      reference.force[i] += report.loads.force[i];
      reference.torque[i] += report.loads.torque[i];
      scale = std::max({scale, report.loads.force[i].norm(), report.loads.torque[i].norm()});
    }
  }
  for (std::size_t i = 0; i < p.set.size(); ++i) {
    EXPECT_LE((fast.internal.force[i] + fast.external.force[i] - reference.force[i]).norm(), 1e-12 * scale) << i;
    EXPECT_LE((fast.internal.torque[i] + fast.external.torque[i] - reference.torque[i]).norm(), 1e-12 * scale) << i;
  }
}

TEST(Interactions, AddUpToTheReferenceLaws) {
  for (const std::size_t count : {2U, 3U, 7U, 61U}) {
    const Crowd crowd = make_crowd(std::max<std::size_t>(count, 4), 31 + count);
    expect_reference_laws(crowd.p, crowd.interactions);
  }
}

TEST(BondsInARow, AddUpToTheReferenceLawsHoweverListsAndPairsAreOrdered) {
  // Rows are batches of bonds whose particles follow each other; lists with the same bonds share their batches.
  const Particles p = make_crowd(40, 77).p;
  Draw draw(78);
  Interactions all;
  const auto add = [&](std::uint32_t apart, std::uint32_t first, std::uint32_t count, std::uint32_t stride) {
    BondedLaw<Coplanarity> list;
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t a = first + (count - 1 - k) * stride;
      list.first.push_back(a);
      list.second.push_back(a + apart);
      list.law.push_back({.strength = draw.uniform(0.5, 2.0), .weight = {}});
    }
    all.coplanarity.push_back(std::move(list));
  };
  add(1, 0, 20, 1);
  add(2, 0, 20, 1);  // as many from the same on, yet others
  add(1, 0, 20, 1);  // the same
  add(3, 5, 9, 3);   // none follows another
  add(5, 34, 1, 1);
  add(1, 30, 9, 1);
  all.cohesion.push_back({.name = "",
                          .first = all.coplanarity[1].first,
                          .second = all.coplanarity[1].second,
                          .law = std::vector<Cohesion>(20, {.r0 = 0.5, .f0 = 1.0})});
  expect_reference_laws(p, all);
}

TEST(Kinds, FollowTheRuleTable) {
  for (const bool join : {false, true}) {
    EXPECT_TRUE(interact_completely(kHinge, 1, join) && interact_completely(1, kHinge, join));
    EXPECT_TRUE(interact_completely(3, 3, join));
    EXPECT_FALSE(interact_completely(3, 4, join));
    EXPECT_EQ(interact_completely(kHinge, kHinge, join), join);
  }
}

TEST(Kinds, DecideWhichPairsAGeometricLawTakes) {
  // A row 1 1 H H 2 2, all within range of each other: each particle is pushed by those that it does not interact with.
  Particles p;
  for (int i = 0; i < 6; ++i) p.add(Vec3(0.1 * i, 0, 0));
  p.set.kind = {1, 1, kHinge, kHinge, 2, 2};
  const Repulsion law{.force = 1.0, .distance = 0.5, .length = 0.1};
  const auto push = [&](int a, int b) {
    return -evaluate(law, {.r = Vec3(0.1 * (b - a), 0, 0)}).force_b.x();
  };
  struct Case {
    PairKinds kinds;
    std::size_t pairs;
    double first, hinge;  // what pushes particle 0 and particle 2
  };
  const double far = push(0, 4) + push(0, 5), near = push(0, 1) + push(0, 2) + push(0, 3);
  const double beside = push(2, 4) + push(2, 5) - push(1, 2) - push(0, 2), other = push(2, 3);
  for (const Case& expected : {Case{PairKinds::Any, 15, near + far, other + beside}, Case{PairKinds::Incomplete, 5, far, other},
                               Case{PairKinds::IncompleteButHinges, 4, far, 0.0}, Case{PairKinds::Complete, 10, near, beside},
                               Case{PairKinds::CompleteWithHinges, 11, near, other + beside}}) {
    Interactions all;
    all.repulsion.push_back({.name = "r", .range = law.cut_off(), .law = law, .kinds = expected.kinds});
    const Evaluated loads = evaluate_loads(p, all, Executor(1));
    const auto reports = report_laws(p.set, p.state, all, 0.0);
    const double round_off = 1e-12 * std::abs(near);
    EXPECT_NEAR(loads.internal.force[0].x(), expected.first, round_off);
    EXPECT_NEAR(loads.internal.force[2].x(), expected.hinge, round_off);
    EXPECT_NEAR(reports[0].loads.force[2].x(), expected.hinge, round_off);
    EXPECT_EQ(loads.counts.pairs_present, expected.pairs);
  }
}

TEST(Interactions, GiveNoForceAndNoMomentToTheWhole) {
  const Crowd crowd = make_crowd(200, 32);
  const Evaluated loads = evaluate_loads(crowd.p, crowd.interactions, Executor(1));
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double scale = 0.0;
  for (std::size_t i = 0; i < crowd.p.set.size(); ++i) {
    force += loads.internal.force[i];
    moment += crowd.p.state.position[i].cross(loads.internal.force[i]) + loads.internal.torque[i];
    scale += loads.internal.force[i].norm();
  }
  EXPECT_LE(force.norm(), 1e-13 * scale);
  EXPECT_LE(moment.norm(), 1e-13 * scale);
}

TEST(Interactions, AreTheGradientOfThePotentialEnergy) {
  Crowd crowd = make_crowd(40, 33);
  const Evaluated loads = evaluate_loads(crowd.p, crowd.interactions, Executor(1));
  Draw draw(34);
  const double h = 1e-5;
  for (int k = 0; k < 5; ++k) {
    const std::size_t i = static_cast<std::size_t>(8 * k);
    const Vec3 dx = draw.direction(), turn = draw.direction();
    const auto at = [&](double step) {
      Particles moved = crowd.p;
      moved.state.position[i] += step * dx;
      moved.state.orientation[i] = rotation_exp(step * turn) * moved.state.orientation[i];
      return potential_energy(moved.set, moved.state, crowd.interactions);
    };
    const double expected = loads.internal.force[i].dot(dx) + loads.internal.torque[i].dot(turn);
    // Truncation h^2 U'''/6 with U''' up to 1e4 where close pairs repel; a pair crossing its range adds less.
    EXPECT_NEAR(-(at(h) - at(-h)) / (2.0 * h), expected, 1e-6 * (1.0 + std::abs(expected))) << i;
  }
}

TEST(Interactions, HaveTheSameBitsForEveryNumberOfThreads) {
  const Crowd crowd = make_crowd(3000, 35);
  const std::uint64_t one = hash_of(evaluate_loads(crowd.p, crowd.interactions, Executor(1)));
  for (const int threads : {2, 3, 8}) {
    EXPECT_EQ(hash_of(evaluate_loads(crowd.p, crowd.interactions, Executor(threads))), one) << threads;
  }
}

TEST(Interactions, OfOneLawAloneHaveTheSameBitsForEveryNumberOfThreads) {
  const Crowd crowd = make_crowd(3000, 37);
  const Interactions& all = crowd.interactions;
  std::vector<Interactions> alone(4);
  alone[0].bond_frame = all.bond_frame;  // bonds in runs
  alone[1].coplanarity = all.coplanarity;
  alone[2].repulsion = all.repulsion;    // found among neighbours
  alone[3].cohesion = all.cohesion;      // bonds in a list
  std::mt19937 shuffle(38);
  std::shuffle(alone[3].cohesion[0].second.begin(), alone[3].cohesion[0].second.end(), shuffle);
  BondedLaw<Cohesion>& bonds = alone[3].cohesion[0];
  for (std::size_t k = bonds.law.size(); k-- > 0;) {
    if (bonds.first[k] > bonds.second[k]) std::swap(bonds.first[k], bonds.second[k]);
    if (bonds.first[k] != bonds.second[k]) continue;
    bonds.first.erase(bonds.first.begin() + static_cast<std::ptrdiff_t>(k));
    bonds.second.erase(bonds.second.begin() + static_cast<std::ptrdiff_t>(k));
    bonds.law.erase(bonds.law.begin() + static_cast<std::ptrdiff_t>(k));
  }
  for (const Interactions& one : alone) {
    const Evaluated expected = evaluate_loads(crowd.p, one, Executor(1));
    EXPECT_GT(expected.internal.force[1500].norm() + expected.internal.force[1501].norm(), 0.0);
    for (const int threads : {2, 3, 8}) EXPECT_EQ(hash_of(evaluate_loads(crowd.p, one, Executor(threads))), hash_of(expected)) << threads;
  }
}

TEST(Interactions, HaveTheSameBitsForEveryVectorWidth) {
  const Crowd crowd = make_crowd(1000, 47);
  const std::uint64_t any = hash_of(evaluate_loads(crowd.p, crowd.interactions, Executor(1)));
  for (const auto target : {HWY_AVX2, HWY_AVX3}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    EXPECT_EQ(hash_of(evaluate_loads(crowd.p, crowd.interactions, Executor(1))), any) << hwy::TargetName(target);
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(Interactions, CountWhatTheyVisit) {
  const Crowd crowd = make_crowd(60, 36);
  const Evaluated loads = evaluate_loads(crowd.p, crowd.interactions, Executor(1));
  const std::size_t chain = 59 + 58 + 57;
  EXPECT_GE(loads.counts.pairs_present, kChainLaws * chain + 59 + 58);
  EXPECT_GE(loads.counts.pairs_visited, loads.counts.pairs_present);
  Interactions bonded = crowd.interactions;
  bonded.geometric_cohesion.clear();
  bonded.geometric_linear_cohesion.clear();
  bonded.geometric_tabulated_cohesion.clear();
  bonded.geometric_lennard_jones.clear();
  bonded.geometric_coplanarity.clear();
  bonded.geometric_co_normality.clear();
  bonded.geometric_co_circularity.clear();
  bonded.repulsion.clear();
  EXPECT_EQ(evaluate_loads(crowd.p, bonded, Executor(1)).counts.pairs_visited, kChainLaws * chain + 59 + 58);
}

TEST(Interactions, AllocateNothingAfterTheFirstCall) {
  const Crowd crowd = make_crowd(2000, 37);
  for (const int threads : {1, 2}) {
    const Executor executor(threads);
    InteractionWorkspace workspace(crowd.p.set, crowd.interactions);
    Loads internal, external;
    const auto call = [&] {
      internal.reset(crowd.p.set.size());
      external.reset(crowd.p.set.size());
      accumulate_interactions(crowd.p.set, crowd.p.state, crowd.interactions, executor, workspace, internal);
      add_external_loads(crowd.p.set, crowd.interactions, 0.0, external);
    };
    call();
    const std::uint64_t before = supple::test::allocation_count();
    for (int again = 0; again < 20; ++again) call();  // whichever thread takes which block
    EXPECT_EQ(supple::test::allocation_count(), before) << threads;
  }
}

TEST(GeometricLaws, GiveTheSameBitsFromKeptPairsAndFromNewOnes) {
  Crowd crowd = make_crowd(400, 45);
  const Executor executor(1);
  InteractionWorkspace kept(crowd.p.set, crowd.interactions);
  Draw draw(46);
  // Moves of a few hundredths: the pairs of the ranges .27 to 1 are kept for some steps and found anew in others.
  for (int step = 0; step < 30; ++step) {
    for (Vec3& x : crowd.p.state.position) x += 0.01 * draw.direction();
    if (step == 20) crowd.p.state.position[5] += Vec3(0.7, 0.0, 0.0);
    Evaluated loads;
    loads.internal.reset(crowd.p.set.size());
    loads.external.reset(crowd.p.set.size());
    accumulate_interactions(crowd.p.set, crowd.p.state, crowd.interactions, executor, kept, loads.internal);
    add_external_loads(crowd.p.set, crowd.interactions, 0.5, loads.external);
    ASSERT_EQ(hash_of(loads), hash_of(evaluate_loads(crowd.p, crowd.interactions, executor))) << step;
  }
}

TEST(GeometricLaws, KeepTheEnergyOfAMelt) {
  // 500 atoms in open space whose force ends smoothly. omega^2 = 57 * 2^(5/3) 12 / 12: omega dt = 0.03 for the stiffest
  // pairs, and velocity Verlet holds the energy to (omega dt)^2.
  constexpr int kCells = 5;
  const double edge = std::cbrt(4.0 / 0.8442);
  Particles p;
  Draw draw(59);
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    const Vec3 corner(i % kCells, i / kCells % kCells, i / kCells / kCells);
    for (const Vec3& basis : {Vec3(0, 0, 0), Vec3(0.5, 0.5, 0), Vec3(0.5, 0, 0.5), Vec3(0, 0.5, 0.5)}) {
      p.add(edge * (corner + basis));
      p.state.velocity.back() = draw.vector(1.5);
    }
  }
  Interactions all;
  const LennardJones law{.r0 = std::cbrt(std::sqrt(2.0)), .depth = 1.0, .cut_off = 2.5, .switch_from = 2.0};
  all.geometric_lennard_jones.push_back({.name = "melt", .range = law.cut_off, .law = law});
  InteractionWorkspace workspace(p.set, all);
  Loads loads, external;
  const auto forces = [&] {
    loads.reset(p.set.size());
    external.reset(p.set.size());
    accumulate_interactions(p.set, p.state, all, Executor(1), workspace, loads);
    add_external_loads(p.set, all, 0.0, external);
  };
  const auto energy = [&] {
    double sum = potential_energy(p.set, p.state, all);
    for (const Vec3& v : p.state.velocity) sum += 0.5 * v.squaredNorm();
    return sum;
  };
  const auto kick = [&](double time) {
    for (std::size_t i = 0; i < p.set.size(); ++i) p.state.velocity[i] += time * loads.force[i];
  };
  forces();
  const double start = energy(), dt = 0.002;
  double largest = 0.0;
  for (int step = 0; step < 250; ++step) {
    kick(0.5 * dt);
    for (std::size_t i = 0; i < p.set.size(); ++i) p.state.position[i] += dt * p.state.velocity[i];
    forces();
    kick(0.5 * dt);
    if (step % 10 == 9) largest = std::max(largest, std::abs(energy() - start));
  }
  EXPECT_LE(largest, 1e-3 * std::abs(start));
}

TEST(GeometricLaws, ActOnlyBetweenTheirObjects) {
  Particles p;
  p.add(Vec3(0, 0, 0));
  p.add(Vec3(0.2, 0, 0));
  p.add(Vec3(0.4, 0, 0));
  p.set.object = {0, 0, 2};
  Interactions all;
  all.repulsion.push_back({.name = "r", .object_a = 0, .object_b = 2, .range = 0.3,
                           .law = {.force = 1.0, .distance = 0.2, .length = 0.05, .tolerance = 0.13}});
  const Evaluated loads = evaluate_loads(p, all, Executor(1));
  EXPECT_EQ(loads.counts.pairs_present, 1U);
  EXPECT_EQ(loads.internal.force[0], Vec3::Zero());
  EXPECT_GT(loads.internal.force[2].x(), 0.0);
  EXPECT_LT(loads.internal.force[1].x(), 0.0);
}

TEST(GeometricCohesion, HasAnEnergyThatVanishesAtItsRange) {
  Particles p;
  p.add(Vec3::Zero());
  p.add(Vec3::UnitX());
  const Cohesion law{.r0 = 1.0, .f0 = 1.0, .a = 4.0};
  Interactions all;
  all.geometric_cohesion.push_back({.name = "c", .object_a = 0, .object_b = 0, .range = 3.0, .law = law});
  EXPECT_NEAR(potential_energy(p.set, p.state, all), -law.energy(3.0), 1e-15);
  p.state.position[1].x() = 3.0 - 1e-9;
  EXPECT_NEAR(potential_energy(p.set, p.state, all), 0.0, 1e-12);
  p.state.position[1].x() = 3.0 + 1e-9;
  EXPECT_EQ(potential_energy(p.set, p.state, all), 0.0);
}

TEST(ExternalLoads, ActInTheirWindowAndRampAtBothEnds) {
  const ExternalLoad load{.begin = 1.0, .end = 3.0, .ramp = 0.5};
  EXPECT_EQ(load.factor(0.99), 0.0);
  EXPECT_DOUBLE_EQ(load.factor(1.25), 0.5);
  EXPECT_EQ(load.factor(2.0), 1.0);
  EXPECT_DOUBLE_EQ(load.factor(2.75), 0.5);
  EXPECT_EQ(load.factor(3.0), 0.0);
  const ExternalLoad step{.begin = 1.0, .end = 3.0};
  EXPECT_EQ(step.factor(1.0), 1.0);
  EXPECT_EQ(step.factor(2.999), 1.0);
  EXPECT_EQ(step.factor(3.0), 0.0);
  const ExternalLoad lasting{.begin = 0.0, .end = std::numeric_limits<double>::infinity(), .ramp = 2.0};
  EXPECT_EQ(lasting.factor(1e12), 1.0);
}

TEST(ExternalLoads, MeansOverStepsHoldTheWholeImpulse) {
  const double inf = std::numeric_limits<double>::infinity();
  const ExternalLoad blow{.begin = 0.512, .end = 0.523}, window{.begin = 0.23, .end = 0.61}, early{.end = 0.37},
      ramped{.begin = 0.11, .end = 0.83, .ramp = 0.21}, peak{.begin = 0.31, .end = 0.45, .ramp = 0.3};
  for (const auto& [load, impulse] : {std::pair{blow, 0.011}, {window, 0.38}, {early, 0.37}, {ramped, 0.72 - 0.21}, {peak, 0.14 * 0.14 / 4 / 0.3}}) {
    double sum = 0.0, from = 0.0;
    for (const double to : {0.1, 0.2, 0.25, 0.3, 0.4, 0.515, 0.52, 0.7, 0.8, 1.0}) {
      sum += (to - from) * load.mean(from, to);
      from = to;
    }
    EXPECT_NEAR(sum, impulse, 1e-15);
  }
  const ExternalLoad lasting{.begin = 0.0, .end = inf};
  for (const double t : {0.0, 0.05, 1e6}) EXPECT_EQ(lasting.mean(t, t + 0.1), 1.0);
  EXPECT_EQ(ramped.mean(0.4, 0.6), 1.0);
  EXPECT_NEAR(ramped.mean(0.15, 0.25), 0.09 / 0.21, 1e-15);  // the factor is linear in either ramp
  EXPECT_NEAR(ramped.mean(0.7, 0.8), 0.08 / 0.21, 1e-15);
  EXPECT_TRUE(blow.changes(0.4, 0.52));
  EXPECT_TRUE(blow.changes(0.4, 0.6));
  EXPECT_FALSE(blow.changes(0.53, 0.6));
  EXPECT_FALSE(lasting.changes(0.1, 1e9));
  EXPECT_FALSE(ramped.changes(0.33, 0.61));
}

TEST(ExternalLoads, ChangeInTheStepThatFirstFeelsThem) {
  // Steps whose times meet up to rounding, loads that begin or end just there: the next step never takes the factor that was.
  for (int n = 1; n < 200; ++n) {
    const double end = (n - 1) * (1.0 / 24) + 1.0 / 24, next = n * (1.0 / 24), later = next + 1.0 / 24;
    for (const double at : {n / 24.0, end, next, 0.5 * (end + next)}) {
      if (at < std::min(end, next) || at > std::max(end, next)) continue;
      EXPECT_TRUE((ExternalLoad{.begin = at, .end = 100.0}.changes(next, later))) << n;
      EXPECT_TRUE((ExternalLoad{.end = at}.changes(next, later))) << n;
    }
  }
}

TEST(ExternalLoads, AndGravityAreKeptApartFromInternalLoads) {
  Crowd crowd = make_crowd(10, 38);
  const Evaluated inside = evaluate_loads(crowd.p, crowd.interactions, Executor(1), 0.5);
  EXPECT_EQ(inside.external.force[3], Vec3(crowd.p.set.mass[3] * crowd.interactions.gravity + Vec3(1, 2, 3)));
  EXPECT_EQ(inside.external.torque[3], Vec3(0, 0, 4));
  const Evaluated outside = evaluate_loads(crowd.p, crowd.interactions, Executor(1), 1.5);
  EXPECT_EQ(outside.external.force[3], Vec3(crowd.p.set.mass[3] * crowd.interactions.gravity));
  EXPECT_EQ(outside.internal.force[3], inside.internal.force[3]);
}

TEST(LawReports, NameEveryLawAndAddUpToThePotentialEnergy) {
  const Crowd crowd = make_crowd(30, 39);
  const std::vector<LawReport> reports = report_laws(crowd.p.set, crowd.p.state, crowd.interactions, 0.5);
  ASSERT_EQ(reports.size(), crowd.interactions.law_count() + 2);  // gravity and external loads
  EXPECT_EQ(reports[3].name, "bond_frame");
  EXPECT_EQ(reports[reports.size() - 10].name, "own");
  EXPECT_EQ(reports[reports.size() - 2].name, "gravity");
  EXPECT_EQ(reports.back().name, "external");
  double energy = 0.0, size = 0.0;
  for (const LawReport& report : reports) {
    energy += report.energy;
    size += std::abs(report.energy);
  }
  EXPECT_NEAR(energy, potential_energy(crowd.p.set, crowd.p.state, crowd.interactions), 1e-13 * size);
}

/// The largest eigenfrequency about a pose, from differences of the loads: sqrt of the largest eigenvalue of M^-1 H.
double true_frequency(const Particles& p, const Interactions& interactions) {
  const auto n = static_cast<Eigen::Index>(6 * p.set.size());
  Eigen::MatrixXd h(n, n);
  const double step = 1e-5;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto loads_at = [&](double by) {
      Particles moved = p;
      const auto i = static_cast<std::size_t>(k / 6);
      if (k % 6 < 3) {
        moved.state.position[i] += by * Vec3::Unit(k % 3);
      } else {
        moved.state.orientation[i] = rotation_exp(by * Vec3::Unit(k % 3)) * moved.state.orientation[i];
      }
      return evaluate_loads(moved, interactions, Executor(1)).internal;
    };
    const Loads plus = loads_at(step), minus = loads_at(-step);
    const auto inertia_of = [&](Eigen::Index row) {
      const auto i = static_cast<std::size_t>(row / 6);
      return row % 6 < 3 ? p.set.mass[i] : p.set.inertia[i].x();
    };
    for (Eigen::Index row = 0; row < n; ++row) {
      const auto i = static_cast<std::size_t>(row / 6);
      const auto& a = row % 6 < 3 ? plus.force[i] : plus.torque[i];
      const auto& b = row % 6 < 3 ? minus.force[i] : minus.torque[i];
      h(row, k) = -(a[row % 3] - b[row % 3]) / (2.0 * step) / std::sqrt(inertia_of(row) * inertia_of(k));
    }
  }
  const Eigen::MatrixXd symmetric = 0.5 * (h + h.transpose());
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric).eigenvalues().maxCoeff());
}

TEST(LargestFrequency, BoundsTheEigenfrequenciesAndIsNotFarAbove) {
  Particles spiral = test::make_spiral();
  spiral.set.mass[4] *= 3.0;
  Interactions frames;
  frames.bond_frame.push_back(test::bond_frames(spiral, 400.0, 1.5));
  Interactions both = frames;
  both.coplanarity.push_back(test::coplanarities(spiral, 2.0));
  for (const Interactions& interactions : {frames, both}) {
    const double exact = true_frequency(spiral, interactions);
    const double bound = largest_frequency(spiral.set, spiral.state, interactions);
    EXPECT_GE(bound, exact);
    EXPECT_LE(bound, 2.0 * exact);
  }
}

TEST(LargestFrequency, BoundsATriangleOfSprings) {
  // Three springs of zero length, U = k |r|^2 each (stiffness 2 k): the eigenvalues m omega^2 are 0 and 6 k.
  Particles p;
  p.add(Vec3(0, 0, 0), 2.0);
  p.add(Vec3(1, 0, 0), 2.0);
  p.add(Vec3(0.5, 0.8, 0), 2.0);
  Interactions all;
  BondedLaw<FormRadius> springs{.name = "springs", .first = {0, 0, 1}, .second = {1, 2, 2}, .law = {}};
  springs.law.assign(3, {.strength = 5.0, .radius = 0.0, .weight = {}});
  all.form_radius.push_back(springs);
  EXPECT_NEAR(true_frequency(p, all), std::sqrt(6.0 * 5.0 / 2.0), 1e-6);
  EXPECT_DOUBLE_EQ(largest_frequency(p.set, p.state, all), std::sqrt(2.0 / 2.0 * 2 * 10.0));
}

TEST(LargestFrequency, IsZeroForWhatCannotMove) {
  Particles spiral = test::make_spiral();
  Interactions all;
  all.bond_frame.push_back(test::bond_frames(spiral, 400.0, 1.5));
  spiral.set.pinned.assign(spiral.set.size(), kPinPosition | kPinOrientation);
  EXPECT_EQ(largest_frequency(spiral.set, spiral.state, all), 0.0);
}

TEST(InteractionWorkspaces, RefuseBondsOfParticlesThatDoNotExist) {
  Particles p;
  p.add(Vec3::Zero());
  Interactions all;
  all.coplanarity.push_back({.name = "c", .first = {0}, .second = {1}, .law = {Coplanarity{}}});
  EXPECT_THROW(InteractionWorkspace(p.set, all), ContractViolation);
}

}  // namespace
}  // namespace supple::core
