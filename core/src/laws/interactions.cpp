#include "supple/core/interactions.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <utility>

#include "laws/interaction_workspace.h"
#include "laws/law_lists.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

/// Fewer pairs than this are done by the calling thread: waking others takes longer.
constexpr std::size_t kSerialPairs = 1024;
constexpr std::size_t kBatchBlock = 128;
constexpr std::size_t kParticleBlock = 512;
/// A coordinate of the fillers of lists, whose square is finite.
constexpr double kFarAway = 1e150;
constexpr std::size_t kFillers = 2;

/// The rows of four particles as columns.
[[gnu::always_inline]] inline std::array<Lanes, 4> load_rows(const StagedRow* rows, const std::uint32_t* j) {
  std::array<Lanes, 4> c{Lanes::load(rows[j[0]].value.data()), Lanes::load(rows[j[1]].value.data()),
                         Lanes::load(rows[j[2]].value.data()), Lanes::load(rows[j[3]].value.data())};
  transpose(c[0], c[1], c[2], c[3]);
  return c;
}
[[gnu::always_inline]] inline Vector<Lanes> load_vectors_of(const StagedRow* rows, const std::uint32_t* j) {
  const std::array<Lanes, 4> c = load_rows(rows, j);
  return {c[0], c[1], c[2]};
}
[[gnu::always_inline]] inline Rotation<Lanes> load_rotations_of(const StagedRow* rows, const std::uint32_t* j) {
  const std::array<Lanes, 4> c = load_rows(rows, j);
  return {{c[0], c[1], c[2]}, c[3]};
}

/// One batch: poses to lanes, the kernel, and its loads back as one row for each pair.
template <class Law>
void evaluate_batch(const StagedPoses& pose, const std::uint32_t* first, const std::uint32_t* second,
                    const LaneRow* numbers, std::array<StagedPairLoads, kLanes>& out) {
  using Kernel = PairKernel<Law>;
  KernelPair<Lanes> pair{};
  // x_B - x_A before the transposition: one instead of two.
  std::array<Lanes, 4> r;
  for (std::size_t k = 0; k < kLanes; ++k) {
    r[k] = Lanes::load(pose.position[second[k]].value.data()) - Lanes::load(pose.position[first[k]].value.data());
  }
  transpose(r[0], r[1], r[2], r[3]);
  pair.r = {r[0], r[1], r[2]};
  if constexpr (Kernel::kOrientation) {
    pair.orientation_a = load_rotations_of(pose.orientation.data(), first);
    pair.orientation_b = load_rotations_of(pose.orientation.data(), second);
  }
  if constexpr (Kernel::kNormal) {
    pair.normal_a = load_vectors_of(pose.normal.data(), first);
    pair.normal_b = load_vectors_of(pose.normal.data(), second);
  }
  std::array<Lanes, Kernel::kNumbers> p;
  for (std::size_t k = 0; k < Kernel::kNumbers; ++k) p[k] = Lanes::load(numbers[k].value.data());

  const KernelLoads<Lanes> loads = Kernel::loads(p.data(), pair);
  const auto store = [&out](const Vector<Lanes>& v, std::array<double, 4> StagedPairLoads::* row) {
    std::array<Lanes, 4> rows{v.x, v.y, v.z, Lanes(0.0)};
    transpose(rows[0], rows[1], rows[2], rows[3]);
    for (std::size_t k = 0; k < kLanes; ++k) rows[k].store((out[k].*row).data());
  };
  store(loads.force_b, &StagedPairLoads::force);
  if constexpr (Kernel::kTorque) {
    store(loads.torque_a, &StagedPairLoads::torque_a);
    store(loads.torque_b, &StagedPairLoads::torque_b);
  }
}

void add_row(std::array<double, 4>& sum, const std::array<double, 4>& term) {
  (Lanes::load(sum.data()) + Lanes::load(term.data())).store(sum.data());
}

void subtract_row(std::array<double, 4>& sum, const std::array<double, 4>& term) {
  (Lanes::load(sum.data()) - Lanes::load(term.data())).store(sum.data());
}

template <bool kTorque>
void scatter(const StagedPairLoads& loads, StagedLoads& a, StagedLoads& b) {
  subtract_row(a.force, loads.force);
  add_row(b.force, loads.force);
  if constexpr (kTorque) {
    add_row(a.torque, loads.torque_a);
    add_row(b.torque, loads.torque_b);
  }
}

/// Pairs in order, both sides at once. The sums of a particle are associated as in `gather`.
template <class Law>
void accumulate_in_order(const PackedPairs& pairs, const LaneRow* numbers, std::size_t stride,
                         const StagedPoses& pose, std::vector<StagedLoads>& sum) {
  std::array<StagedPairLoads, kLanes> loads;
  for (std::size_t begin = 0; begin < pairs.count; begin += kLanes, numbers += stride) {
    evaluate_batch<Law>(pose, &pairs.first[begin], &pairs.second[begin], numbers, loads);
    const std::size_t count = std::min(kLanes, pairs.count - begin);
    for (std::size_t k = 0; k < count; ++k) {
      scatter<PairKernel<Law>::kTorque>(loads[k], sum[pairs.first[begin + k]], sum[pairs.second[begin + k]]);
    }
  }
}

/// Each pair to its own slot of `out`, in blocks.
template <class Law>
void evaluate_pairs(const PackedPairs& pairs, const LaneRow* numbers, std::size_t stride, const Executor& executor,
                    const StagedPoses& pose, StagedPairLoads* out) {
  const auto body = [&](std::size_t begin, std::size_t end) {
    std::array<StagedPairLoads, kLanes> loads{};
    for (std::size_t batch = begin; batch < end; ++batch) {
      const std::size_t pair = batch * kLanes;
      evaluate_batch<Law>(pose, &pairs.first[pair], &pairs.second[pair], numbers + batch * stride, loads);
      const std::size_t count = std::min(kLanes, pairs.count - pair);
      for (std::size_t k = 0; k < count; ++k) out[pair + k] = loads[k];
    }
  };
  executor.for_blocks(pairs.batches(), kBatchBlock, std::ref(body));
}

/// Work on [0, particles), by the calling thread where waking others would take longer.
template <class Body>
void for_particles(std::size_t particles, const Executor& executor, const Body& body) {
  if (particles < kSerialPairs) {
    body(std::size_t{0}, particles);
  } else {
    executor.for_blocks(particles, kParticleBlock, std::cref(body));
  }
}

/// Poses for the laws that are no runs; sums are set to 0.
void stage_poses(const ParticleSet& set, const ParticleState& state, const Executor& executor,
                 InteractionWorkspace::Impl& work) {
  const std::size_t n = set.size();
  StagedPoses& pose = work.pose;
  pose.position.resize(n + kFillers);
  if (work.needs_orientation) pose.orientation.resize(n + kFillers, {{0.0, 0.0, 0.0, 1.0}});
  if (work.needs_normal) pose.normal.resize(n + kFillers);
  work.sum.resize(n + kFillers);
  pose.position[n].value.fill(kFarAway);
  pose.position[n + 1].value.fill(-kFarAway);
  for_particles(n, executor, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3& x = state.position[i];
      pose.position[i] = {{x.x(), x.y(), x.z(), 0.0}};
      const Quat& q = state.orientation[i];
      if (work.needs_orientation) pose.orientation[i] = {{q.x(), q.y(), q.z(), q.w()}};
      if (work.needs_normal) {
        const Vec3 normal = q * set.normal[i];
        pose.normal[i] = {{normal.x(), normal.y(), normal.z(), 0.0}};
      }
      work.sum[i] = StagedLoads{};
    }
  });
}

void unstage_loads(const Executor& executor, InteractionWorkspace::Impl& work, Loads& loads) {
  const runs::Work rows = work.runs.work();
  for_particles(loads.force.size(), executor, [&](std::size_t begin, std::size_t end) {
    if (work.has_lists) {
      for (std::size_t i = begin; i < end; ++i) {
        const StagedLoads& sum = work.sum[i];
        loads.force[i] += Vec3(sum.force[0], sum.force[1], sum.force[2]);
        loads.torque[i] += Vec3(sum.torque[0], sum.torque[1], sum.torque[2]);
      }
    }
    if (!work.runs.empty()) runs::add_sums(rows, begin, end, loads);
  });
}

/// Bonds of runs come last; their sums are associated as in `runs::accumulate`.
void gather(const Executor& executor, InteractionWorkspace::Impl& work) {
  const auto body = [&work](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      StagedLoads sum{}, first{}, second{};
      if (work.has_lists) sum = work.sum[i];
      for (std::uint32_t k = work.gather_start[i]; k < work.gather_start[i + 1]; ++k) {
        const std::uint32_t bond = work.gather_entry[k] / 2;
        const bool is_first = work.gather_entry[k] % 2 == 0;
        if (bond >= work.listed_bonds) {
          const runs::BondLoads& loads = work.run_loads[bond - work.listed_bonds];
          StagedLoads& side = is_first ? first : second;
          add_row(side.force, loads.force_b);
          add_row(side.torque, is_first ? loads.torque_a : loads.torque_b);
          continue;
        }
        const StagedPairLoads& loads = work.pair_loads[bond];
        if (is_first) {
          subtract_row(sum.force, loads.force);
          add_row(sum.torque, loads.torque_a);
        } else {
          add_row(sum.force, loads.force);
          add_row(sum.torque, loads.torque_b);
        }
      }
      if (work.has_lists) work.sum[i] = sum;
      if (work.runs.empty()) continue;
      const runs::Work rows = work.runs.work();
      for (std::size_t k = 0; k < 3; ++k) {
        rows.row(runs::kFirst + runs::kForce + k)[i] = first.force[k];
        rows.row(runs::kFirst + runs::kTorque + k)[i] = first.torque[k];
        rows.row(runs::kSecond + runs::kForce + k)[i] = second.force[k];
        rows.row(runs::kSecond + runs::kTorque + k)[i] = second.torque[k];
      }
    }
  };
  executor.for_blocks(work.gather_start.size() - 1, kParticleBlock, std::ref(body));
}

void accumulate_bonds(const Executor& executor, InteractionWorkspace::Impl& work) {
  if (executor.threads() == 1 || work.bond_count < kSerialPairs) {
    std::apply(
        [&](const auto&... bonds) {
          (accumulate_in_order<typename std::decay_t<decltype(bonds)>::LawType>(
               bonds.pairs, bonds.numbers.data(),
               PairKernel<typename std::decay_t<decltype(bonds)>::LawType>::kNumbers, work.pose, work.sum),
           ...);
        },
        work.bonded);
    for (const runs::Group& group : work.runs.groups) runs::accumulate(group, work.runs.work());
    return;
  }
  work.pair_loads.resize(work.listed_bonds);
  std::size_t offset = 0;
  const auto evaluate_law = [&](const auto& bonds) {
    using Law = typename std::decay_t<decltype(bonds)>::LawType;
    evaluate_pairs<Law>(bonds.pairs, bonds.numbers.data(), PairKernel<Law>::kNumbers, executor, work.pose,
                        work.pair_loads.data() + offset);
    offset += bonds.pairs.count;
  };
  std::apply([&](const auto&... bonds) { (evaluate_law(bonds), ...); }, work.bonded);
  work.run_loads.resize(work.bond_count - work.listed_bonds);
  const runs::Work rows = work.runs.work();
  for (std::size_t g = 0; g < work.runs.groups.size(); ++g) {
    const runs::Group& group = work.runs.groups[g];
    const auto body = [&](std::size_t begin, std::size_t end) {
      for (std::size_t batch = begin; batch < end; ++batch) {
        runs::evaluate(group, batch, rows, work.run_loads.data() + work.batch_bonds[g][batch]);
      }
    };
    executor.for_blocks(group.batch.size(), kBatchBlock, std::cref(body));
  }
  gather(executor, work);
}

/// `set` where the mask is, else `clear`.
Vector<Lanes> where(Lanes mask, const Vector<Lanes>& set, const Vector<Lanes>& clear) {
  return {by_highest_bit(mask, set.x, clear.x), by_highest_bit(mask, set.y, clear.y), by_highest_bit(mask, set.z, clear.z)};
}
Vector<Lanes> masked(Lanes mask, const Vector<Lanes>& v) { return {mask & v.x, mask & v.y, mask & v.z}; }

/// What a kernel keeps of a particle for all its neighbours.
struct Nothing {};
template <class Kernel, bool kKeeps = Kernel::kOrientation>
struct OwnNumbers {
  using Type = Nothing;
};
template <class Kernel>
struct OwnNumbers<Kernel, true> {
  using Type = typename Kernel::template Own<Lanes>;
};

/// Four particles that add up what their neighbours do to them.
template <class Law>
class Owners {
 public:
  using Kernel = PairKernel<Law>;

  Owners(const StagedPoses& pose, const std::uint32_t* owner, const std::vector<StagedLoads>& sum)
      : position_(pose.position.data()), other_normal_(pose.normal.data()), other_orientation_(pose.orientation.data()),
        owner_(owner), index_(lanes_of_indices(owner)), x_(load_vectors_of(position_, owner)) {
    if constexpr (Kernel::kOrientation) orientation_ = load_rotations_of(other_orientation_, owner);
    if constexpr (Kernel::kNormal) normal_ = load_vectors_of(other_normal_, owner);
    force_ = load(sum, &StagedLoads::force);
    if constexpr (Kernel::kTorque) torque_ = load(sum, &StagedLoads::torque);
  }
  /// @return all bits of the lanes whose neighbour is in range
  [[gnu::always_inline]] Lanes near(Lanes range2, const std::uint32_t* j) const {
    const Vector<Lanes> r = load_vectors_of(position_, j) - x_;
    return less(dot(r, r), range2);
  }
  /// Adds what one neighbour does to each. @param one  the numbers of the law, and as lanes
  /// @return a bit for each pair in range
  [[gnu::always_inline]] unsigned add(const double* one, const Lanes* numbers, Lanes range2, const std::uint32_t* j) {
    KernelPair<Lanes> pair{};
    const Vector<Lanes> r = load_vectors_of(position_, j) - x_;
    const Lanes near = less(dot(r, r), range2);
    if constexpr (requires { Kernel::loads_of_one(one, numbers, pair); }) {
      pair.r = r;
      force_ = force_ - masked(near, Kernel::loads_of_one(one, numbers, pair).force_b);
    } else if constexpr (!Kernel::kTorque) {
      // What acts along r is the same from both sides.
      pair.r = r;
      force_ = force_ - masked(near, Kernel::loads(numbers, pair).force_b);
    } else if constexpr (Kernel::kOrientation) {
      const auto loads = Kernel::loads_on(own_, numbers, load_rotations_of(other_orientation_, j), r);
      force_ = force_ - masked(near, loads.force_b);
      torque_ = torque_ + masked(near, loads.torque_a);
    } else {
      // The first of a pair has the lower index, so that both of its particles compute the same.
      const Lanes second = less(lanes_of_indices(j), index_);
      const Lanes sign = second & Lanes(-0.0);
      pair.r = {r.x ^ sign, r.y ^ sign, r.z ^ sign};
      const Vector<Lanes> other = load_vectors_of(other_normal_, j);
      pair.normal_a = where(second, other, normal_);
      pair.normal_b = where(second, normal_, other);
      const KernelLoads<Lanes> loads = Kernel::loads(numbers, pair);
      const Vector<Lanes>& f = loads.force_b;
      force_ = force_ - masked(near, Vector<Lanes>{f.x ^ sign, f.y ^ sign, f.z ^ sign});
      torque_ = torque_ + masked(near, where(second, loads.torque_b, loads.torque_a));
    }
    return bits_of(near);
  }
  void prepare(const Lanes* numbers) {
    if constexpr (Kernel::kOrientation) own_ = Kernel::own(numbers, orientation_);
  }
  void store(std::size_t count, std::vector<StagedLoads>& sum) const {
    store(force_, count, sum, &StagedLoads::force);
    if constexpr (Kernel::kTorque) store(torque_, count, sum, &StagedLoads::torque);
  }

 private:
  using LoadRow = std::array<double, 4> StagedLoads::*;
  Vector<Lanes> load(const std::vector<StagedLoads>& sum, LoadRow row) const {
    std::array<Lanes, 4> c;
    for (std::size_t k = 0; k < kLanes; ++k) c[k] = Lanes::load((sum[owner_[k]].*row).data());
    transpose(c[0], c[1], c[2], c[3]);
    return {c[0], c[1], c[2]};
  }
  void store(const Vector<Lanes>& v, std::size_t count, std::vector<StagedLoads>& sum, LoadRow row) const {
    std::array<Lanes, 4> rows{v.x, v.y, v.z, Lanes(0.0)};
    transpose(rows[0], rows[1], rows[2], rows[3]);
    for (std::size_t k = 0; k < count; ++k) rows[k].store((sum[owner_[k]].*row).data());
  }

  const StagedRow* position_;
  const StagedRow* other_normal_;
  const StagedRow* other_orientation_;
  const std::uint32_t* owner_;
  Lanes index_;
  Vector<Lanes> x_, normal_{}, force_, torque_{};
  Rotation<Lanes> orientation_{};
  typename OwnNumbers<Kernel>::Type own_{};
};

template <class Law>
void take_near(const Owners<Law>& owners, Lanes range2, const std::uint32_t* j, std::uint32_t listed, std::uint32_t filler,
               NearColumns& out) {
  if (out.entry.size() < kLanes * (listed + std::size_t{1})) out.entry.resize(2 * kLanes * (listed + std::size_t{1}));
  std::array<std::uint32_t, kLanes> count{};
  for (std::uint32_t s = 0; s < listed; ++s, j += kGroup) {
    const unsigned near = bits_of(owners.near(range2, j));
    for (std::uint32_t k = 0; k < kLanes; ++k) {
      out.entry[kLanes * count[k] + k] = j[k];
      count[k] += near >> k & 1U;
    }
  }
  out.steps = *std::max_element(count.begin(), count.end());
  for (std::uint32_t k = 0; k < kLanes; ++k) {
    for (std::uint32_t s = count[k]; s < out.steps; ++s) out.entry[kLanes * s + k] = filler;
  }
}

/// @return pairs in range, each counted from both sides
template <class Law>
std::uint64_t accumulate_block(const PackedGeometric<Law>& law, const PairLists::Block& block, NearColumns& near,
                               const StagedPoses& pose, std::vector<StagedLoads>& sum) {
  std::array<Lanes, PairKernel<Law>::kNumbers> numbers;
  for (std::size_t n = 0; n < numbers.size(); ++n) numbers[n] = Lanes(law.numbers[n]);
  const Lanes range2(law.range * law.range);
  const auto filler = static_cast<std::uint32_t>(sum.size() - kFillers);
  std::uint64_t present = 0;
  for (const PairGroup& group : block.group) {
    for (std::size_t first = 0; first < group.owners; first += kLanes) {
      Owners<Law> owners(pose, group.owner.data() + first, sum);
      owners.prepare(numbers.data());
      const std::uint32_t* j = block.entry.data() + group.begin + first;
      std::uint32_t steps = group.steps;
      std::size_t stride = kGroup;
      if constexpr (PairKernel<Law>::kTorque) {
        // Laws that take longer than the search for what is in range.
        take_near(owners, range2, j, group.steps, filler, near);
        j = near.entry.data();
        steps = near.steps;
        stride = kLanes;
      }
      for (std::uint32_t s = 0; s < steps; ++s, j += stride) {
        present += static_cast<unsigned>(std::popcount(owners.add(law.numbers.data(), numbers.data(), range2, j)));
      }
      owners.store(std::min<std::size_t>(kLanes, group.owners - first), sum);
    }
  }
  return present;
}

template <class Law>
void accumulate_geometric(PackedGeometric<Law>& law, const ParticleState& state, const Executor& executor,
                          InteractionWorkspace::Impl& work, InteractionCounts& counts) {
  counts.pairs_visited += law.lists.update(state.position, executor);
  const std::span<const PairLists::Block> blocks = law.lists.blocks();
  work.present.assign(blocks.size(), 0);
  if (law.near.size() < blocks.size()) law.near.resize(blocks.size());
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      work.present[b] = accumulate_block(law, blocks[b], law.near[b], work.pose, work.sum);
    }
  };
  executor.for_blocks(blocks.size(), 1, std::cref(body));
  std::uint64_t listed = 0, present = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    listed += blocks[b].pairs;
    present += work.present[b];
  }
  counts.pairs_visited += listed / 2;
  counts.pairs_present += present / 2;
}

/// The lists that are no runs. @param taken  by runs, list by list
template <class Law>
void pack_bonds(const std::vector<BondedLaw<Law>>& laws, std::vector<bool>::const_iterator& taken,
                PackedBonds<Law>& out) {
  using Kernel = PairKernel<Law>;
  for (const BondedLaw<Law>& law : laws) {
    if (*taken++) continue;
    for (std::size_t k = 0; k < law.law.size(); ++k) {
      const std::size_t lane = out.pairs.count % kLanes;
      if (lane == 0) out.numbers.resize(out.numbers.size() + Kernel::kNumbers);
      std::array<double, Kernel::kNumbers> numbers;
      Kernel::pack(law.law[k], numbers.data());
      LaneRow* const rows = out.numbers.data() + (out.numbers.size() - Kernel::kNumbers);
      // Written to the end of the row: a later bond overwrites its lane, so that the padding repeats the last bond.
      for (std::size_t n = 0; n < Kernel::kNumbers; ++n) {
        std::fill(rows[n].value.begin() + static_cast<std::ptrdiff_t>(lane), rows[n].value.end(), numbers[n]);
      }
      out.pairs.add(law.first[k], law.second[k]);
    }
  }
  out.pairs.pad();
}

template <class Law>
PackedGeometric<Law> pack_geometric(const GeometricLaw<Law>& law, const ParticleSet& set) {
  std::vector<std::uint32_t> particle;
  std::vector<std::uint8_t> side;   // whether it belongs to object_b
  std::vector<std::uint32_t> kind;
  for (std::uint32_t i = 0; i < set.size(); ++i) {
    if (set.object[i] != law.object_a && set.object[i] != law.object_b) continue;
    particle.push_back(i);
    side.push_back(set.object[i] == law.object_b ? 1 : 0);
    kind.push_back(set.kind.empty() ? 0 : set.kind[i]);
  }
  PairLists::Takes takes;
  const bool same_object = law.object_a == law.object_b;
  if (!same_object || law.kinds != PairKinds::Any) {
    takes = [same_object, kinds = law.kinds, side, kind](std::uint32_t i, std::uint32_t j) {
      return (same_object || side[i] != side[j]) && takes_kinds(kinds, kind[i], kind[j]);
    };
  }
  PackedGeometric<Law> out{.range = law.range,
                           .numbers = {},
                           .lists = PairLists(law.range, particle, static_cast<std::uint32_t>(set.size()), takes),
                           .near = {}};
  PairKernel<Law>::pack(law.law, out.numbers.data());
  return out;
}

void build_gather_lists(std::size_t particles, InteractionWorkspace::Impl& work) {
  work.gather_start.assign(particles + 1, 0);
  const auto for_each_pair = [&work](const auto& visit) {
    std::uint32_t bond = 0;
    const auto walk = [&](const PackedPairs& pairs) {
      for (std::size_t k = 0; k < pairs.count; ++k) visit(bond++, pairs.first[k], pairs.second[k]);
    };
    std::apply([&](const auto&... bonds) { (walk(bonds.pairs), ...); }, work.bonded);
    work.listed_bonds = bond;
    for (const runs::Group& group : work.runs.groups) {
      for (const runs::Batch& batch : group.batch) {
        for (std::uint32_t k = 0; k < batch.count; ++k) visit(bond++, batch.first + k, batch.second + k);
      }
    }
    return static_cast<std::size_t>(bond);
  };
  work.bond_count = for_each_pair([&work](std::uint32_t, std::uint32_t a, std::uint32_t b) {
    ++work.gather_start[a + 1];
    ++work.gather_start[b + 1];
  });
  std::size_t run_bonds = 0;
  work.law_bonds = work.listed_bonds;
  for (const runs::Group& group : work.runs.groups) {
    work.law_bonds += group.laws.size() * group.count;
    std::vector<std::size_t>& begin = work.batch_bonds.emplace_back();
    for (const runs::Batch& batch : group.batch) {
      begin.push_back(run_bonds);
      run_bonds += batch.count;
    }
  }
  SUPPLE_EXPECTS(work.bond_count < (std::size_t{1} << 31));
  for (std::size_t i = 0; i < particles; ++i) work.gather_start[i + 1] += work.gather_start[i];
  work.gather_entry.resize(2 * work.bond_count);
  std::vector<std::uint32_t> next(work.gather_start.begin(), work.gather_start.end() - 1);
  for_each_pair([&](std::uint32_t bond, std::uint32_t a, std::uint32_t b) {
    work.gather_entry[next[a]++] = 2 * bond;
    work.gather_entry[next[b]++] = 2 * bond + 1;
  });
}

}  // namespace

void PackedPairs::add(std::uint32_t a, std::uint32_t b) {
  first.push_back(a);
  second.push_back(b);
  ++count;
}

void PackedPairs::pad() {
  while (first.size() % kLanes != 0) {
    first.push_back(first.back());
    second.push_back(second.back());
  }
}

double Course::at(double t) const {
  SUPPLE_EXPECTS(!time.empty() && time.size() == factor.size());
  if (t <= time.front()) return factor.front();
  if (t >= time.back()) return factor.back();
  const auto k = static_cast<std::size_t>(std::upper_bound(time.begin(), time.end(), t) - time.begin());
  const double share = (t - time[k - 1]) / (time[k] - time[k - 1]);
  return factor[k - 1] + share * (factor[k] - factor[k - 1]);
}

double Course::largest() const {
  double most = 0.0;
  for (const double f : factor) most = std::max(most, std::abs(f));
  return most;
}

double ExternalLoad::factor(double time) const { return course ? window(time) * course->at(time) : window(time); }

double ExternalLoad::window(double time) const {
  if (time < begin || time >= end) return 0.0;
  if (ramp <= 0.0) return 1.0;
  return std::min(1.0, std::min((time - begin) / ramp, (end - time) / ramp));
}

bool ExternalLoad::changes(double from, double to) const {
  const double since = from - 4.0 * std::numeric_limits<double>::epsilon() * std::abs(from);
  const double steady = end - begin > 2.0 * ramp ? ramp : 0.5 * (end - begin);
  if (course && since <= course->time.back() && to >= course->time.front()) return true;
  return (since <= begin + steady && to >= begin) || (since <= end && to >= end - steady);
}

/// Between the knots of window and course their product is of second degree, for which Gauss' rule of two points is exact.
double ExternalLoad::mean(double from, double to) const {
  SUPPLE_EXPECTS(from < to);
  if (!changes(from, to)) return factor(from);
  if (!course) return mean_of_window(from, to);
  std::vector<double> knots{from, to};
  const auto add = [&](double t) {
    if (t > from && t < to) knots.push_back(t);
  };
  const double rise = std::min(ramp, 0.5 * (end - begin));
  for (const double t : {begin, begin + rise, end - rise, end}) add(t);
  for (auto t = std::upper_bound(course->time.begin(), course->time.end(), from); t != course->time.end() && *t < to; ++t) add(*t);
  std::sort(knots.begin(), knots.end());
  constexpr double kGauss = 0.57735026918962576;  // 1/sqrt(3)
  double sum = 0.0;
  for (std::size_t k = 1; k < knots.size(); ++k) {
    const double middle = 0.5 * (knots[k - 1] + knots[k]), half = 0.5 * (knots[k] - knots[k - 1]);
    sum += half * (factor(middle - kGauss * half) + factor(middle + kGauss * half));
  }
  return sum / (to - from);
}

double ExternalLoad::mean_of_window(double from, double to) const {
  const double rise = ramp > 0.0 ? std::min(ramp, 0.5 * (end - begin)) : 0.0;
  const double height = ramp > 0.0 ? rise / ramp : 1.0;
  const auto impulse = [&](double t) {  // integral of the factor up to t
    if (t <= begin) return 0.0;
    const double risen = std::min(t - begin, rise);
    double sum = rise > 0.0 ? 0.5 * height * risen * (risen / rise) : 0.0;
    if (t > begin + rise) sum += height * (std::min(t, end - rise) - begin - rise);
    if (t > end - rise && rise > 0.0) {
      const double left = std::max(end - t, 0.0);
      sum += 0.5 * height * (rise - left * (left / rise));
    }
    return sum;
  };
  return (impulse(to) - impulse(from)) / (to - from);
}

namespace {

void add_external(const ParticleSet& set, const Interactions& interactions, double from, double to, Loads& external) {
  if (interactions.gravity != Vec3::Zero()) {
    for (std::size_t i = 0; i < set.size(); ++i) external.force[i] += set.mass[i] * interactions.gravity;
  }
  for (const ExternalLoad& load : interactions.external) {
    SUPPLE_EXPECTS(load.particle < set.size());
    const double factor = from < to ? load.mean(from, to) : load.factor(from);
    if (factor == 0.0) continue;
    external.force[load.particle] += factor * load.force;
    external.torque[load.particle] += factor * load.torque;
  }
}

}  // namespace

InteractionWorkspace::InteractionWorkspace(const ParticleSet& set, const Interactions& interactions)
    : impl_(std::make_unique<Impl>()) {
  const std::size_t n = set.size();
  const std::vector<bool> taken = runs::pack(n, interactions, impl_->runs);
  auto next = taken.begin();
  for_each_bonded(interactions, [&]<class Law>(const std::vector<BondedLaw<Law>>& lists) {
    pack_bonds(lists, next, std::get<PackedBonds<Law>>(impl_->bonded));
  });
  for_each_geometric(interactions, [&]<class Law>(const std::vector<GeometricLaw<Law>>& lists) {
    for (const auto& law : lists) {
      std::get<std::vector<PackedGeometric<Law>>>(impl_->geometric).push_back(pack_geometric(law, set));
      impl_->needs_orientation = impl_->needs_orientation || PairKernel<Law>::kOrientation;
      impl_->needs_normal = impl_->needs_normal || PairKernel<Law>::kNormal;
      impl_->has_lists = true;
    }
  });
  std::apply(
      [this](const auto&... bonds) {
        const auto note = [this]<class Law>(const PackedBonds<Law>& packed) {
          if (packed.pairs.count == 0) return;
          impl_->has_lists = true;
          impl_->needs_orientation = impl_->needs_orientation || PairKernel<Law>::kOrientation;
          impl_->needs_normal = impl_->needs_normal || PairKernel<Law>::kNormal;
        };
        (note(bonds), ...);
      },
      impl_->bonded);
  build_gather_lists(n, *impl_);
}

InteractionWorkspace::~InteractionWorkspace() = default;
InteractionWorkspace::InteractionWorkspace(InteractionWorkspace&&) noexcept = default;
InteractionWorkspace& InteractionWorkspace::operator=(InteractionWorkspace&&) noexcept = default;

InteractionCounts accumulate_interactions(const ParticleSet& set, const ParticleState& state,
                                          const Interactions& interactions, const Executor& executor,
                                          InteractionWorkspace& workspace, Loads& loads) {
  const std::size_t n = set.size();
  SUPPLE_EXPECTS(state.size() == n && loads.force.size() == n);
  InteractionWorkspace::Impl& work = workspace.impl();
  SUPPLE_EXPECTS(work.gather_start.size() == n + 1);
  InteractionCounts counts{.pairs_visited = work.law_bonds, .pairs_present = work.law_bonds};

  if (work.has_lists) stage_poses(set, state, executor, work);
  if (!work.runs.empty()) {
    for_particles(n, executor, [&](std::size_t begin, std::size_t end) {
      runs::stage(set, state, begin, end, work.runs);
    });
  }
  accumulate_bonds(executor, work);
  const auto accumulate_lists = [&](auto& lists) {
    for (auto& law : lists) accumulate_geometric(law, state, executor, work, counts);
  };
  std::apply([&](auto&... lists) { (accumulate_lists(lists), ...); }, work.geometric);
  for (const BondedLaw<LiteralForm>& list : interactions.literal_form) {
    accumulate_literal_form(list, set, state, loads);
    counts.pairs_visited += list.law.size();
    counts.pairs_present += list.law.size();
  }
  unstage_loads(executor, work, loads);
  return counts;
}

void add_external_loads(const ParticleSet& set, const Interactions& interactions, double time, Loads& external) {
  SUPPLE_EXPECTS(external.force.size() == set.size());
  const auto [from, to] = interactions.load_span;
  if (from < to) {
    add_external(set, interactions, from, to, external);
  } else {
    add_external(set, interactions, time, time, external);
  }
}

void external_loads(const ParticleSet& set, const Interactions& interactions, double from, double to, Loads& external) {
  external.reset(set.size());
  add_external(set, interactions, from, to, external);
}

}  // namespace supple::core
