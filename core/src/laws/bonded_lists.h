// All lists of bonded laws of a scene that have an energy, in one order.
#pragma once

#include <tuple>

#include "supple/core/interactions.h"

namespace supple::core {

/// References to the lists: `Lists` is Interactions or const Interactions.
template <class Lists>
auto bonded_lists(Lists& laws) {
  return std::tie(laws.cohesion, laws.form, laws.form_radius, laws.bond_frame, laws.coplanarity,
                  laws.normalised_coplanarity, laws.co_normality, laws.co_circularity, laws.normalised_co_circularity,
                  laws.lennard_jones, laws.linear_cohesion, laws.directed_cohesion, laws.tabulated_cohesion,
                  laws.directed_form);
}

/// visit(law, first, second) for every bond of every list, in order.
template <class Lists, class Visit>
void for_each_bond(Lists& laws, const Visit& visit) {
  const auto walk = [&visit](auto& lists) {
    for (auto& list : lists) {
      for (std::size_t k = 0; k < list.law.size(); ++k) visit(list.law[k], list.first[k], list.second[k]);
    }
  };
  std::apply([&walk](auto&... lists) { (walk(lists), ...); }, bonded_lists(laws));
}

}  // namespace supple::core
