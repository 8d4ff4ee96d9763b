#include "supple/core/interactions.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "laws/interaction_workspace.h"
#include "laws/law_lists.h"
#include "neighbours/packed_lanes.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

/// Fewer pairs than this are done by the calling thread: waking others takes longer.
constexpr std::size_t kSerialPairs = 1024;
constexpr std::size_t kBatchBlock = 128;
constexpr std::size_t kParticleBlock = 512;
/// Skin of the kept pairs of a geometric law, in ranges.
constexpr double kSkin = 0.15;
/// Square of the largest move, in skins: half of one, less the rounding of distances.
constexpr double kMoveLimit2 = 0.2499;

void load_rows(const double* a, const double* b, const double* c, const double* d, std::array<Lanes, 4>& columns) {
  columns = {Lanes::load(a), Lanes::load(b), Lanes::load(c), Lanes::load(d)};
  transpose(columns[0], columns[1], columns[2], columns[3]);
}

/// One batch: poses to lanes, the kernel, and its loads back as one row for each pair.
template <class Law>
void evaluate_batch(const std::vector<StagedPose>& pose, const std::uint32_t* first, const std::uint32_t* second,
                    const LaneRow* numbers, std::array<StagedPairLoads, kLanes>& out) {
  using Kernel = PairKernel<Law>;
  const StagedPose& a0 = pose[first[0]];
  const StagedPose& a1 = pose[first[1]];
  const StagedPose& a2 = pose[first[2]];
  const StagedPose& a3 = pose[first[3]];
  const StagedPose& b0 = pose[second[0]];
  const StagedPose& b1 = pose[second[1]];
  const StagedPose& b2 = pose[second[2]];
  const StagedPose& b3 = pose[second[3]];

  KernelPair<Lanes> pair{};
  // x_B - x_A before the transposition: one instead of two.
  std::array<Lanes, 4> r{Lanes::load(b0.position.data()) - Lanes::load(a0.position.data()),
                         Lanes::load(b1.position.data()) - Lanes::load(a1.position.data()),
                         Lanes::load(b2.position.data()) - Lanes::load(a2.position.data()),
                         Lanes::load(b3.position.data()) - Lanes::load(a3.position.data())};
  transpose(r[0], r[1], r[2], r[3]);
  pair.r = {r[0], r[1], r[2]};
  std::array<Lanes, 4> c;
  if constexpr (Kernel::kOrientation) {
    load_rows(a0.orientation.data(), a1.orientation.data(), a2.orientation.data(), a3.orientation.data(), c);
    pair.orientation_a = {{c[0], c[1], c[2]}, c[3]};
    load_rows(b0.orientation.data(), b1.orientation.data(), b2.orientation.data(), b3.orientation.data(), c);
    pair.orientation_b = {{c[0], c[1], c[2]}, c[3]};
  }
  if constexpr (Kernel::kNormal) {
    load_rows(a0.normal.data(), a1.normal.data(), a2.normal.data(), a3.normal.data(), c);
    pair.normal_a = {c[0], c[1], c[2]};
    load_rows(b0.normal.data(), b1.normal.data(), b2.normal.data(), b3.normal.data(), c);
    pair.normal_b = {c[0], c[1], c[2]};
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
                         const std::vector<StagedPose>& pose, std::vector<StagedLoads>& sum) {
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
                    const std::vector<StagedPose>& pose, StagedPairLoads* out) {
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
  work.pose.resize(set.size());
  work.sum.resize(set.size());
  for_particles(set.size(), executor, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      StagedPose& pose = work.pose[i];
      const Vec3& x = state.position[i];
      pose.position = {x.x(), x.y(), x.z(), 0.0};
      const Quat& q = state.orientation[i];
      if (work.needs_orientation) pose.orientation = {q.x(), q.y(), q.z(), q.w()};
      if (work.needs_normal) {
        const Vec3 n = q * set.normal[i];
        pose.normal = {n.x(), n.y(), n.z(), 0.0};
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

double dot(const Vec3& a, const Vec3& b) { return fma(a.x(), b.x(), fma(a.y(), b.y(), a.z() * b.z())); }

/// Pairs nearer than the range and a skin, kept until a particle has moved by half the skin. Only pairs in range act,
/// in their order, so that no bit depends on when the pairs were found.
template <class Law>
void find_near_pairs(PackedGeometric<Law>& law, const ParticleState& state, const Executor& executor,
                     InteractionWorkspace::Impl& work, InteractionCounts& counts) {
  law.position.resize(law.particle.size());
  for (std::size_t k = 0; k < law.particle.size(); ++k) law.position[k] = state.position[law.particle[k]];
  if (law.position.empty()) return;
  const double skin = kSkin * law.range;
  const bool kept = law.reference.size() == law.position.size() &&
                    packed::largest_move2(law.position[0].data(), law.reference[0].data(), law.position.size()) <=
                        kMoveLimit2 * skin * skin;
  if (kept) {
    counts.pairs_visited += law.near.size();
    return;
  }
  counts.pairs_visited += work.grid.find(law.position, law.range + skin, executor, law.near);
  law.reference = law.position;
}

template <class Law>
void accumulate_geometric(PackedGeometric<Law>& law, const ParticleState& state, const Executor& executor,
                          InteractionWorkspace::Impl& work, InteractionCounts& counts) {
  find_near_pairs(law, state, executor, work, counts);
  law.pairs.clear();
  const double range2 = law.range * law.range;
  for (const IndexPair& pair : law.near) {
    if (!law.same_object && law.side[pair.first] == law.side[pair.second]) continue;
    if (!law.kind.empty() && !takes_kinds(law.kinds, law.kind[pair.first], law.kind[pair.second])) continue;
    const Vec3 r = law.position[pair.first] - law.position[pair.second];
    if (dot(r, r) < range2) law.pairs.add(law.particle[pair.first], law.particle[pair.second]);
  }
  law.pairs.pad();
  counts.pairs_present += law.pairs.count;

  if (executor.threads() == 1 || law.pairs.count < kSerialPairs) {
    accumulate_in_order<Law>(law.pairs, law.numbers.data(), 0, work.pose, work.sum);
    return;
  }
  if (work.pair_loads.size() < law.pairs.count) work.pair_loads.resize(law.pairs.count);
  evaluate_pairs<Law>(law.pairs, law.numbers.data(), 0, executor, work.pose, work.pair_loads.data());
  for (std::size_t k = 0; k < law.pairs.count; ++k) {
    scatter<PairKernel<Law>::kTorque>(work.pair_loads[k], work.sum[law.pairs.first[k]],
                                      work.sum[law.pairs.second[k]]);
  }
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
  using Kernel = PairKernel<Law>;
  PackedGeometric<Law> out;
  out.range = law.range;
  out.same_object = law.object_a == law.object_b;
  out.kinds = law.kinds;
  std::array<double, Kernel::kNumbers> numbers;
  Kernel::pack(law.law, numbers.data());
  for (std::size_t n = 0; n < Kernel::kNumbers; ++n) out.numbers[n].value.fill(numbers[n]);
  for (std::uint32_t i = 0; i < set.size(); ++i) {
    if (set.object[i] != law.object_a && set.object[i] != law.object_b) continue;
    out.particle.push_back(i);
    out.side.push_back(set.object[i] == law.object_b ? 1 : 0);
    if (law.kinds != PairKinds::Any) out.kind.push_back(set.kind.empty() ? 0 : set.kind[i]);
  }
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

void PackedPairs::clear() {
  first.clear();
  second.clear();
  count = 0;
}

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

double ExternalLoad::factor(double time) const {
  if (time < begin || time >= end) return 0.0;
  if (ramp <= 0.0) return 1.0;
  return std::min(1.0, std::min((time - begin) / ramp, (end - time) / ramp));
}

bool ExternalLoad::changes(double from, double to) const {
  const double since = from - 4.0 * std::numeric_limits<double>::epsilon() * std::abs(from);
  const double steady = end - begin > 2.0 * ramp ? ramp : 0.5 * (end - begin);
  return (since <= begin + steady && to >= begin) || (since <= end && to >= end - steady);
}

double ExternalLoad::mean(double from, double to) const {
  SUPPLE_EXPECTS(from < to);
  if (!changes(from, to)) return factor(from);
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
                                          const Interactions& interactions, double time, const Executor& executor,
                                          InteractionWorkspace& workspace, Loads& internal, Loads& external) {
  const std::size_t n = set.size();
  SUPPLE_EXPECTS(state.size() == n && internal.force.size() == n && external.force.size() == n);
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
    accumulate_literal_form(list, set, state, internal);
    counts.pairs_visited += list.law.size();
    counts.pairs_present += list.law.size();
  }
  unstage_loads(executor, work, internal);

  const auto [from, to] = interactions.load_span;
  if (from < to) {
    add_external(set, interactions, from, to, external);
  } else {
    add_external(set, interactions, time, time, external);
  }
  return counts;
}

void external_loads(const ParticleSet& set, const Interactions& interactions, double from, double to, Loads& external) {
  external.reset(set.size());
  add_external(set, interactions, from, to, external);
}

}  // namespace supple::core
