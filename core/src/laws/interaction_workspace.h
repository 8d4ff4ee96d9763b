// Buffers of accumulate_interactions: the laws packed for the kernels, poses staged for aligned loads, and sums.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "laws/bond_runs.h"
#include "laws/gay_berne_kernel.h"
#include "laws/pair_kernels.h"
#include "neighbours/pair_lists.h"
#include "supple/core/interactions.h"

namespace supple::core {

/// x, y, z and 0, or a quaternion.
struct alignas(32) StagedRow {
  std::array<double, 4> value;
};

/// Rows of the particles and, of geometric laws, of the two fillers of their lists: far away and far from each other, so that
/// they are in range of nothing. What no law reads is empty.
struct StagedPoses {
  std::vector<StagedRow> position, orientation, normal;
};

struct alignas(32) StagedLoads {
  std::array<double, 4> force;
  std::array<double, 4> torque;
};

/// What one pair does; the force on A is -force.
struct alignas(32) StagedPairLoads {
  std::array<double, 4> force;
  std::array<double, 4> torque_a;
  std::array<double, 4> torque_b;
};

struct alignas(32) LaneRow {
  std::array<double, kLanes> value;
};

/// Pairs in batches of four; the last batch repeats its last pair, whose copies are computed and not used.
struct PackedPairs {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> second;
  std::size_t count = 0;

  void add(std::uint32_t a, std::uint32_t b);
  void pad();
  [[nodiscard]] std::size_t batches() const { return (count + kLanes - 1) / kLanes; }
};

/// All bonds of one kind of law, list after list. Numbers: shape [batches][PairKernel<Law>::kNumbers] rows of lanes.
template <class Law>
struct PackedBonds {
  using LawType = Law;
  PackedPairs pairs;
  std::vector<LaneRow> numbers;
};

/// The neighbours in range of four particles, each column a list of its own that is filled up with fillers.
struct NearColumns {
  std::vector<std::uint32_t> entry;  ///< shape [steps][kLanes]
  std::uint32_t steps = 0;
};

/// A geometric law and the lists of the particles it acts on.
template <class Law>
struct PackedGeometric {
  using LawType = Law;
  double range = 0.0;
  std::array<double, PairKernel<Law>::kNumbers> numbers;
  PairLists lists;
  std::vector<NearColumns> near;  ///< of each block of the lists, so that no thread needs one of its own
};

struct InteractionWorkspace::Impl {
  std::tuple<PackedBonds<Cohesion>, PackedBonds<Form>, PackedBonds<FormRadius>, PackedBonds<BondFrame>,
             PackedBonds<Coplanarity>, PackedBonds<NormalisedCoplanarity>, PackedBonds<CoNormality>,
             PackedBonds<CoCircularity>, PackedBonds<NormalisedCoCircularity>, PackedBonds<LennardJones>,
             PackedBonds<LinearCohesion>, PackedBonds<DirectedCohesion>, PackedBonds<TabulatedCohesion>,
             PackedBonds<DirectedForm>>
      bonded;
  std::tuple<std::vector<PackedGeometric<Cohesion>>, std::vector<PackedGeometric<LinearCohesion>>,
             std::vector<PackedGeometric<TabulatedCohesion>>, std::vector<PackedGeometric<LennardJones>>,
             std::vector<PackedGeometric<SwitchedGayBerne>>, std::vector<PackedGeometric<Coplanarity>>,
             std::vector<PackedGeometric<CoNormality>>, std::vector<PackedGeometric<CoCircularity>>,
             std::vector<PackedGeometric<Repulsion>>>
      geometric;

  runs::Runs runs;  ///< the bonded laws that are not in `bonded`

  bool has_lists = false;          ///< laws in `bonded` or `geometric`, which the following three serve
  bool needs_orientation = false;
  bool needs_normal = false;
  std::size_t listed_bonds = 0;    ///< in `bonded`
  std::size_t bond_count = 0;      ///< those and the ones of `runs`, which come after
  std::size_t law_bonds = 0;       ///< each counted once for every law on it

  StagedPoses pose;
  std::vector<StagedLoads> sum;
  std::vector<StagedPairLoads> pair_loads;  ///< of all bonds in `bonded`
  std::vector<runs::BondLoads> run_loads;
  std::vector<std::uint64_t> present;       ///< pairs in range, of each block of a geometric law
  std::vector<std::vector<std::size_t>> batch_bonds;  ///< of each group the first bond of each batch

  /// For each particle its bonds in ascending order: 2 bond, +1 where it is the second of the pair.
  std::vector<std::uint32_t> gather_start;
  std::vector<std::uint32_t> gather_entry;
};

}  // namespace supple::core
