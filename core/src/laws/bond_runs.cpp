#include "laws/bond_runs.h"

#include <cstring>
#include <map>

#include "laws/bond_runs-inl.h"
#include "supple/core/error.h"

namespace supple::core::runs {
namespace {

/// Bonds sorted by the difference of their particle numbers, then by their first particle.
std::vector<std::uint32_t> sorted_bonds(std::span<const std::uint32_t> first, std::span<const std::uint32_t> second) {
  std::vector<std::uint32_t> order(first.size());
  for (std::uint32_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t j, std::uint32_t k) {
    return std::pair(second[j] - first[j], first[j]) < std::pair(second[k] - first[k], first[k]);
  });
  return order;
}

std::vector<Batch> batches_of(std::span<const std::uint32_t> first, std::span<const std::uint32_t> second,
                              std::span<const std::uint32_t> order) {
  std::vector<Batch> out;
  for (const std::uint32_t k : order) {
    if (!out.empty()) {
      Batch& last = out.back();
      if (last.count < kBatch && first[k] == last.first + last.count && second[k] == last.second + last.count) {
        ++last.count;
        continue;
      }
    }
    out.push_back({first[k], second[k], 1});
  }
  return out;
}

/// Whether the lanes are filled well enough to justify the transpositions that other batches need.
bool pays(std::span<const Batch> batches, std::size_t bonds) {
  std::size_t steps = 0;
  for (const Batch& batch : batches) steps += (batch.count + kLanes - 1) / kLanes;
  return 2 * steps <= 3 * ((bonds + kLanes - 1) / kLanes);
}

template <class Law>
void pack_numbers(const BondedLaw<Law>& list, std::span<const std::uint32_t> order, const Group& group, Runs& runs) {
  constexpr std::size_t kNumbers = PairKernel<Law>::kNumbers;
  std::size_t bond = 0;
  for (const Batch& batch : group.batch) {
    const std::size_t row = runs.numbers.size();
    runs.numbers.resize(row + kNumbers);
    for (std::size_t lane = 0; lane < kBatch; ++lane) {
      std::array<double, kNumbers> p;
      PairKernel<Law>::pack(list.law[order[bond + std::min<std::size_t>(lane, batch.count - 1)]], p.data());
      for (std::size_t k = 0; k < kNumbers; ++k) runs.numbers[row + k].value[lane] = p[k];
    }
    bond += batch.count;
  }
}

bool same_bonds(const Group& a, std::span<const Batch> b) {
  return std::equal(a.batch.begin(), a.batch.end(), b.begin(), b.end(), [](const Batch& p, const Batch& q) {
    return p.first == q.first && p.second == q.second && p.count == q.count;
  });
}

void store_bonds(const Vector<Lanes>& v, std::size_t count, BondLoads* out, std::array<double, 4> BondLoads::* row) {
  std::array<Lanes, 4> rows{v.x, v.y, v.z, Lanes(0.0)};
  transpose(rows[0], rows[1], rows[2], rows[3]);
  for (std::size_t k = 0; k < count; ++k) rows[k].store((out[k].*row).data());
}

}  // namespace

std::vector<bool> pack(std::size_t particles, const Interactions& interactions, Runs& runs) {
  std::vector<bool> taken;
  std::multimap<std::array<std::size_t, 3>, std::size_t> known;  // by bonds, first particle and batches
  std::uint32_t law = 0;
  const auto take = [&]<class Law>(const BondedLaw<Law>& list) {
    SUPPLE_EXPECTS(list.first.size() == list.law.size() && list.second.size() == list.law.size());
    for (std::size_t k = 0; k < list.law.size(); ++k) {
      SUPPLE_EXPECTS(list.first[k] < particles && list.second[k] < particles && list.first[k] != list.second[k]);
      if (list.first[k] > list.second[k]) return false;
    }
    if (list.law.empty()) return false;
    const std::vector<std::uint32_t> order = sorted_bonds(list.first, list.second);
    std::vector<Batch> batches = batches_of(list.first, list.second, order);
    if (!pays(batches, order.size())) return false;
    const std::array<std::size_t, 3> key{order.size(), batches.front().first, batches.size()};
    std::size_t index = runs.groups.size();
    for (auto [it, end] = known.equal_range(key); it != end; ++it) {
      if (same_bonds(runs.groups[it->second], batches)) index = it->second;
    }
    if (index == runs.groups.size()) {
      runs.groups.push_back({.batch = std::move(batches), .laws = {}, .count = order.size()});
      known.emplace(key, index);
    }
    using Kernel = PairKernel<Law>;
    Group& group = runs.groups[index];
    group.laws.push_back({law, Kernel::kNumbers, runs.numbers.size()});
    group.normal = group.normal || Kernel::kNormal;
    group.torque = group.torque || Kernel::kTorque;
    pack_numbers(list, order, group, runs);
    return true;
  };
  const auto walk = [&](const auto& lists) {
    for (const auto& list : lists) taken.push_back(take(list));
    ++law;
  };
  std::apply([&](const auto&... lists) { (walk(lists), ...); }, bonded_lists(interactions));

  if (runs.empty()) return taken;
  // An odd number of cache lines, or rows of many particles would compete for the same places of a cache.
  runs.room = ((particles + 2 * kBatch) / kBatch | 1) * kBatch;
  runs.rows.resize(kRows * runs.room / kBatch);
  for (const Group& group : runs.groups) runs.normal = runs.normal || group.normal;
  return taken;
}

void stage(const ParticleSet& set, const ParticleState& state, std::size_t begin, std::size_t end, Runs& runs) {
  const Work work = runs.work();
  const auto store = [&work](std::size_t row, std::size_t i, const Vector<Lanes>& v) {
    v.x.store_any(work.row(row) + i);
    v.y.store_any(work.row(row + 1) + i);
    v.z.store_any(work.row(row + 2) + i);
  };
  const auto stage_four = [&](std::size_t i, const Vec3* position, const Quat* orientation, const Vec3* normal) {
    store(kPosition, i, load_vectors(position->data()));
    std::array<Lanes, 4> q;
    for (std::size_t k = 0; k < 4; ++k) q[k] = Lanes::load_any(orientation[k].coeffs().data());
    transpose(q[0], q[1], q[2], q[3]);
    store(kOrientation, i, {q[0], q[1], q[2]});
    q[3].store_any(work.row(kOrientation + 3) + i);
    if (runs.normal) store(kNormal, i, rotate(Rotation<Lanes>{{q[0], q[1], q[2]}, q[3]}, load_vectors(normal->data())));
  };
  std::size_t i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    stage_four(i, &state.position[i], &state.orientation[i], &set.normal[i]);
  }
  if (i < end) {
    // The rows have room for whole vector steps; lanes beyond the particles are not used.
    std::array<Vec3, kLanes> position, normal;
    std::array<Quat, kLanes> orientation;
    for (std::size_t k = 0; k < kLanes; ++k) {
      const std::size_t last = std::min(i + k, end - 1);
      position[k] = state.position[last];
      orientation[k] = state.orientation[last];
      normal[k] = set.normal[last];
    }
    stage_four(i, position.data(), orientation.data(), normal.data());
  }
  if (begin == 0 && end == set.size()) {
    std::memset(work.row(kFirst), 0, (kRows - kFirst) * work.room * sizeof(double));
  } else {
    for (std::size_t row = kFirst; row < kRows; ++row) std::fill(work.row(row) + begin, work.row(row) + end, 0.0);
  }
}

void add_sums(const Work& work, std::size_t begin, std::size_t end, Loads& loads) {
  std::size_t i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    const auto add = [&](const Vector<Lanes>& v, Vec3& to) {
      store_vectors(load_vectors(to.data()) + v, to.data());
    };
    add(load_rows<Lanes>(work, kSecond + kForce, i) - load_rows<Lanes>(work, kFirst + kForce, i), loads.force[i]);
    add(load_rows<Lanes>(work, kSecond + kTorque, i) + load_rows<Lanes>(work, kFirst + kTorque, i), loads.torque[i]);
  }
  for (; i < end; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<int>(k);
      loads.force[i][axis] += work.row(kSecond + kForce + k)[i] - work.row(kFirst + kForce + k)[i];
      loads.torque[i][axis] += work.row(kSecond + kTorque + k)[i] + work.row(kFirst + kTorque + k)[i];
    }
  }
}

void accumulate(const Group& group, const Work& work) { accumulate_lanes<Lanes>(group, work); }

void evaluate(const Group& group, std::size_t batch, const Work& work, BondLoads* out) {
  for (std::size_t part = 0; part < group.batch[batch].count; part += kLanes) {
    const KernelLoads<Lanes> loads = batch_loads<Lanes>(group, batch, part, work);
    const std::size_t count = std::min<std::size_t>(kLanes, group.batch[batch].count - part);
    store_bonds(loads.force_b, count, out + part, &BondLoads::force_b);
    store_bonds(loads.torque_a, count, out + part, &BondLoads::torque_a);
    store_bonds(loads.torque_b, count, out + part, &BondLoads::torque_b);
  }
}

}  // namespace supple::core::runs
