// Bonds between particles that follow each other in their order, as in chains and sheets: (a, b), (a + 1, b + 1), ...
// Poses and sums are kept as one row for each coordinate, so that a batch loads, computes and adds whole stretches of
// rows, and laws on the same bonds are evaluated together. The reference is evaluate() in pair_laws.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/interactions.h"

namespace supple::core::runs {

/// Bonds of a batch; what is known of them is stored for this many.
inline constexpr std::size_t kBatch = 8;

struct alignas(64) NumberRow {
  std::array<double, kBatch> value;
};

/// Rows of a pose, then of the loads of a particle where it is the first of a bond, then where it is the second.
inline constexpr std::size_t kPosition = 0, kOrientation = 3, kNormal = 7, kFirst = 10, kSecond = 16, kRows = 22;
/// Force, of the second particle on both sides, and torque of a particle.
inline constexpr std::size_t kForce = 0, kTorque = 3;

/// Bonds (first + k, second + k), k < count.
struct Batch {
  std::uint32_t first = 0, second = 0, count = 0;
};

/// Numbers of one law, from `begin` on: shape [batches][PairKernel<Law>::kNumbers].
struct GroupLaw {
  std::uint32_t law = 0;      ///< place in `bonded_lists`
  std::uint32_t numbers = 0;  ///< PairKernel<Law>::kNumbers
  std::size_t begin = 0;
};

/// All laws that have the same bonds.
struct Group {
  std::vector<Batch> batch;
  std::vector<GroupLaw> laws;
  bool normal = false, torque = false;  ///< whether a law uses them
  std::size_t count = 0;                ///< bonds
};

/// Where the kernels work.
struct Work {
  const NumberRow* numbers;
  double* rows;
  std::size_t room;
  [[nodiscard]] double* row(std::size_t k) const { return rows + k * room; }
};

struct Runs {
  std::vector<Group> groups;
  std::vector<NumberRow> numbers;
  std::vector<NumberRow> rows;  ///< shape [kRows][room / kBatch]
  std::size_t room = 0;         ///< particles, and space for a batch that reaches beyond them
  bool normal = false;          ///< whether a law uses normals

  [[nodiscard]] bool empty() const { return groups.empty(); }
  [[nodiscard]] Work work() { return {numbers.data(), rows.empty() ? nullptr : rows.front().value.data(), room}; }
};

/// Takes the lists whose bonds mostly follow each other. @return for every list, law after law as in `bonded_lists`,
/// whether it was taken
std::vector<bool> pack(std::size_t particles, const Interactions& interactions, Runs& runs);

/// Poses of the particles [begin, end) to rows, and their sums to 0.
void stage(const ParticleSet& set, const ParticleState& state, std::size_t begin, std::size_t end, Runs& runs);

/// Adds the loads of all bonds of a group, in order.
void accumulate(const Group& group, const Work& work);

/// Adds the sums of the particles [begin, end) to their loads.
void add_sums(const Work& work, std::size_t begin, std::size_t end, Loads& loads);

/// Loads of one bond, the last number of each 0.
struct alignas(32) BondLoads {
  std::array<double, 4> force_b, torque_a, torque_b;
};
/// The loads of the bonds of one batch, each to its own place.
void evaluate(const Group& group, std::size_t batch, const Work& work, BondLoads* out);

}  // namespace supple::core::runs
