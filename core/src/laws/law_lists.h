// The geometric laws of a scene, each named once, in the order in which their loads are summed.
#pragma once

#include <tuple>

#include "laws/bonded_lists.h"

namespace supple::core {

/// Calls visit(lists) with the std::vector<BondedLaw<Law>> of every law.
template <class All, class Visit>
void for_each_bonded(All& laws, const Visit& visit) {
  std::apply([&visit](auto&... lists) { (visit(lists), ...); }, bonded_lists(laws));
}

/// Calls visit(lists) with the std::vector<GeometricLaw<Law>> of every law.
template <class All, class Visit>
void for_each_geometric(All& laws, const Visit& visit) {
  visit(laws.geometric_cohesion);
  visit(laws.geometric_linear_cohesion);
  visit(laws.geometric_tabulated_cohesion);
  visit(laws.geometric_lennard_jones);
  visit(laws.gay_berne);
  visit(laws.geometric_coplanarity);
  visit(laws.geometric_co_normality);
  visit(laws.geometric_co_circularity);
  visit(laws.repulsion);
}

}  // namespace supple::core
