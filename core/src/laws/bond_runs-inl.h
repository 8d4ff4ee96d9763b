// The batches of bond_runs.h for lanes of any width.
#pragma once

#include <algorithm>
#include <tuple>
#include <utility>

#include "laws/bond_runs.h"
#include "laws/bonded_lists.h"
#include "laws/pair_kernels.h"

namespace supple::core::runs {

template <class Lists>
struct LawsOf;
template <class... Law>
struct LawsOf<std::tuple<const std::vector<BondedLaw<Law>>&...>> {
  using type = std::tuple<Law...>;
};
/// The laws of `bonded_lists`, in order.
using Laws = LawsOf<decltype(bonded_lists(std::declval<const Interactions&>()))>::type;

template <class T>
void add_to(Vector<T>& sum, const Vector<T>& term) {
  sum = sum + term;
}

template <class T>
Vector<T> load_rows(const Work& work, std::size_t row, std::size_t at) {
  return {T::load_any(work.row(row) + at), T::load_any(work.row(row + 1) + at), T::load_any(work.row(row + 2) + at)};
}

template <class T>
Rotation<T> load_orientation(const Work& work, std::size_t at) {
  return {load_rows<T>(work, kOrientation, at), T::load_any(work.row(kOrientation + 3) + at)};
}

/// The bonds (a + k, b + k) of some lanes.
template <class T>
struct BondLanes {
  const Work& work;
  std::size_t a, b;
  const Vector<T>& r;
  const double* numbers;  ///< of a law
};

template <class Law, class T>
void add_law(const BondLanes<T>& bond, KernelLoads<T>& sum) {
  const auto& [work, a, b, r, numbers] = bond;
  using Kernel = PairKernel<Law>;
  std::array<T, Kernel::kNumbers> p;
  for (std::size_t k = 0; k < Kernel::kNumbers; ++k) p[k] = T::load(numbers + k * kBatch);
  KernelPair<T> pair{.r = r, .orientation_a = {}, .orientation_b = {}, .normal_a = {}, .normal_b = {}};
  if constexpr (Kernel::kOrientation) {
    pair.orientation_a = load_orientation<T>(work, a);
    pair.orientation_b = load_orientation<T>(work, b);
  }
  if constexpr (Kernel::kNormal) {
    pair.normal_a = load_rows<T>(work, kNormal, a);
    pair.normal_b = load_rows<T>(work, kNormal, b);
  }
  const KernelLoads<T> loads = Kernel::loads(p.data(), pair);
  add_to(sum.force_b, loads.force_b);
  if constexpr (Kernel::kTorque) {
    add_to(sum.torque_a, loads.torque_a);
    add_to(sum.torque_b, loads.torque_b);
  }
}

template <class T, std::size_t... I>
void add_law_at(std::uint32_t law, const BondLanes<T>& bond, KernelLoads<T>& sum, std::index_sequence<I...>) {
  const auto add_if = [&]<std::size_t k>(std::integral_constant<std::size_t, k>) {
    if (law == k) add_law<std::tuple_element_t<k, Laws>>(bond, sum);
  };
  (add_if(std::integral_constant<std::size_t, I>{}), ...);
}

/// Loads of the lanes of a batch from `part` on; those beyond its bonds are not numbers of any use.
template <class T>
KernelLoads<T> batch_loads(const Group& group, std::size_t index, std::size_t part, const Work& work) {
  const std::size_t a = group.batch[index].first + part;
  const std::size_t b = group.batch[index].second + part;
  const Vector<T> r = load_rows<T>(work, kPosition, b) - load_rows<T>(work, kPosition, a);
  const T zero(0.0);
  KernelLoads<T> sum{{zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero}};
  for (const GroupLaw& law : group.laws) {
    const double* const numbers = work.numbers[law.begin + index * law.numbers].value.data() + part;
    add_law_at(law.law, BondLanes<T>{work, a, b, r, numbers}, sum, std::make_index_sequence<std::tuple_size_v<Laws>>{});
  }
  return sum;
}

/// Adds the lanes of v below `count`.
template <class T>
void add_rows(const Vector<T>& v, std::size_t count, double* x, double* y, double* z) {
  const auto add = [count](double* at, const T& term) {
    (T::load_any(at) + (count < T::kCount ? first_lanes(term, count) : term)).store_any(at);
  };
  add(x, v.x);
  add(y, v.y);
  add(z, v.z);
}

template <class T>
[[gnu::flatten]] void accumulate_lanes(const Group& group, const Work& work) {
  for (std::size_t index = 0; index < group.batch.size(); ++index) {
    const Batch& batch = group.batch[index];
    for (std::size_t part = 0; part < batch.count; part += T::kCount) {
      const KernelLoads<T> loads = batch_loads<T>(group, index, part, work);
      const auto add = [&](std::size_t row, std::size_t particle, const Vector<T>& v) {
        double* const x = work.row(row) + particle + part;
        add_rows(v, batch.count - part, x, x + work.room, x + 2 * work.room);
      };
      add(kFirst + kForce, batch.first, loads.force_b);
      add(kSecond + kForce, batch.second, loads.force_b);
      if (!group.torque) continue;
      add(kFirst + kTorque, batch.first, loads.torque_a);
      add(kSecond + kTorque, batch.second, loads.torque_b);
    }
  }
}

}  // namespace supple::core::runs
