// Energies, loads by law and the frequency bound, from the reference laws of pair_laws.cpp.
#include <algorithm>
#include <cmath>
#include <utility>

#include "laws/bonded_lists.h"
#include "laws/law_lists.h"
#include "laws/pair_hessians.h"
#include "supple/core/error.h"
#include "supple/core/interactions.h"

namespace supple::core {
namespace {

/// Calls visit(law, a, b) for every pair on which a list acts, in order.
template <class Law, class Visit>
void for_each_pair(const BondedLaw<Law>& list, const ParticleSet&, const ParticleState&, const Visit& visit) {
  for (std::size_t k = 0; k < list.law.size(); ++k) visit(list.law[k], list.first[k], list.second[k]);
}

template <class Law, class Visit>
void for_each_pair(const GeometricLaw<Law>& list, const ParticleSet& set, const ParticleState& state,
                   const Visit& visit) {
  for (const IndexPair& pair : find_neighbours(state.position, list.range)) {
    const auto lower = std::min(set.object[pair.first], set.object[pair.second]);
    const auto upper = std::max(set.object[pair.first], set.object[pair.second]);
    if (lower != std::min(list.object_a, list.object_b) || upper != std::max(list.object_a, list.object_b)) continue;
    if (list.takes(set, pair.first, pair.second)) visit(list.law, pair.first, pair.second);
  }
}

/// Energy that a list counts as zero: that of a pair at the end of its range, so that pairs may enter and leave.
template <class Law>
double zero_energy(const BondedLaw<Law>&) {
  return 0.0;
}
template <class Law>
double zero_energy(const GeometricLaw<Law>& list) {
  if constexpr (requires { list.law.energy(list.range); }) {
    return list.law.energy(list.range);
  } else {
    return 0.0;
  }
}

/// Calls visit(list) for every list of pairs of a scene, in one order.
template <class Visit>
void for_each_list(const Interactions& interactions, const Visit& visit) {
  const auto visit_all = [&visit](const auto& lists) {
    for (const auto& list : lists) visit(list);
  };
  for_each_bonded(interactions, visit_all);
  for_each_geometric(interactions, visit_all);
}

/// The stiffness of a law, found once where it is the same at every distance.
template <class Law>
class PairStiffness {
 public:
  explicit PairStiffness(const Law& law) : law_(law) {
    if constexpr (!kOfDistance) same_ = stiffness(law);
  }
  [[nodiscard]] Stiffness at(double rest_distance) const {
    if constexpr (kOfDistance) return stiffness(law_, rest_distance);
    return same_;
  }

 private:
  static constexpr bool kOfDistance = requires(const Law& law) { stiffness(law, 0.0); };
  const Law& law_;
  Stiffness same_{};
};

template <class Law>
Stiffness pair_stiffness(const Law& law, double rest_distance) {
  return PairStiffness<Law>(law).at(rest_distance);
}

}  // namespace

std::size_t Interactions::law_count() const {
  std::size_t count = literal_form.size();
  for_each_bonded(*this, [&count](const auto& lists) { count += lists.size(); });
  for_each_geometric(*this, [&count](const auto& lists) { count += lists.size(); });
  return count;
}

double potential_energy(const ParticleSet& set, const ParticleState& state, const Interactions& interactions) {
  double energy = 0.0;
  for_each_list(interactions, [&](const auto& list) {
    const double zero = zero_energy(list);
    for_each_pair(list, set, state, [&](const auto& law, std::uint32_t a, std::uint32_t b) {
      energy += evaluate(law, pair_pose(set, state, a, b)).energy - zero;
    });
  });
  return energy;
}

std::vector<LawReport> report_laws(const ParticleSet& set, const ParticleState& state,
                                   const Interactions& interactions, double time) {
  std::vector<LawReport> reports;
  const auto add_report = [&](std::string name) -> LawReport& {
    LawReport& report = reports.emplace_back();
    report.name = std::move(name);
    report.loads.reset(set.size());
    return report;
  };
  for_each_list(interactions, [&](const auto& list) {
    LawReport& report = add_report(list.name);
    const double zero = zero_energy(list);
    for_each_pair(list, set, state, [&](const auto& law, std::uint32_t a, std::uint32_t b) {
      const PairLoad load = evaluate(law, pair_pose(set, state, a, b));
      report.energy += load.energy - zero;
      report.loads.force[a] -= load.force_b;
      report.loads.force[b] += load.force_b;
      report.loads.torque[a] += load.torque_a;
      report.loads.torque[b] += load.torque_b;
    });
  });
  for (const BondedLaw<LiteralForm>& list : interactions.literal_form) {
    accumulate_literal_form(list, set, state, add_report(list.name).loads);
  }
  LawReport& gravity = add_report("gravity");
  for (std::size_t i = 0; i < set.size(); ++i) gravity.loads.force[i] = set.mass[i] * interactions.gravity;
  LawReport& external = add_report("external");
  for (const ExternalLoad& load : interactions.external) {
    const double factor = load.factor(time);
    external.loads.force[load.particle] += factor * load.force;
    external.loads.torque[load.particle] += factor * load.torque;
  }
  return reports;
}

double largest_frequency(const ParticleSet& set, const ParticleState& rest, const Interactions& interactions) {
  std::vector<Stiffness> total(set.size());
  const auto add = [&total](const Stiffness& k, std::uint32_t i) {
    total[i].translation += k.translation;
    total[i].rotation += k.rotation;
  };
  for_each_bonded(interactions, [&](const auto& lists) {
    for (const auto& list : lists) {
      for_each_pair(list, set, rest, [&](const auto& law, std::uint32_t a, std::uint32_t b) {
        const Stiffness k = pair_stiffness(law, (rest.position[b] - rest.position[a]).norm());
        add(k, a);
        add(k, b);
      });
    }
  });
  for_each_geometric(interactions, [&](const auto& lists) {
    for (const auto& list : lists) {
      const PairStiffness stiffness(list.law);
      for_each_pair(list, set, rest, [&](const auto&, std::uint32_t a, std::uint32_t b) {
        const Stiffness k = stiffness.at((rest.position[b] - rest.position[a]).norm());
        add(k, a);
        add(k, b);
      });
    }
  });
  for (const BondedLaw<LiteralForm>& list : interactions.literal_form) {
    for (std::size_t k = 0; k < list.law.size(); ++k) {
      add(stiffness(list.law[k]), list.first[k]);
      add(stiffness(list.law[k]), list.second[k]);
    }
  }
  // Objects that only meet later have no pair at rest: one pair each is counted.
  for_each_geometric(interactions, [&](const auto& lists) {
    for (const auto& list : lists) {
      const Stiffness k = pair_stiffness(list.law, list.range);
      for (std::uint32_t i = 0; i < set.size(); ++i) {
        if (set.object[i] == list.object_a || set.object[i] == list.object_b) add(k, i);
      }
    }
  });

  // The Hessian is positive semi-definite up to residual stress, so its largest eigenvalue is at most the sum of those
  // of its translational and its rotational block; a pinned degree of freedom has none.
  double translation = 0.0;
  double rotation = 0.0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if ((set.pinned[i] & kPinPosition) == 0) translation = std::max(translation, total[i].translation / set.mass[i]);
    if ((set.pinned[i] & kPinOrientation) == 0) {
      rotation = std::max(rotation, total[i].rotation / set.inertia[i].minCoeff());
    }
  }
  return std::sqrt(2.0 * (translation + rotation));
}

void for_each_hessian(const ParticleSet& set, const ParticleState& state, const Interactions& interactions,
                      HessianKind kind, const PairHessianVisitor& visit) {
  for_each_list(interactions, [&](const auto& list) {
    for_each_pair(list, set, state, [&](const auto& law, std::uint32_t a, std::uint32_t b) {
      visit(a, b, hessian(law, pair_pose(set, state, a, b), kind));
    });
  });
}

std::vector<std::array<std::uint32_t, 2>> bonded_pairs(const Interactions& interactions) {
  std::vector<std::array<std::uint32_t, 2>> pairs;
  const auto add = [&pairs](std::uint32_t a, std::uint32_t b) { pairs.push_back({std::min(a, b), std::max(a, b)}); };
  for_each_bond(interactions, [&add](const auto&, std::uint32_t a, std::uint32_t b) { add(a, b); });
  for (const BondedLaw<LiteralForm>& list : interactions.literal_form) {
    for (std::size_t k = 0; k < list.first.size(); ++k) add(list.first[k], list.second[k]);
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace supple::core
