#include "supple/core/links.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "laws/bonded_lists.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

using Pair = std::pair<std::uint32_t, std::uint32_t>;

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

Pair ordered(std::uint32_t a, std::uint32_t b) { return {std::min(a, b), std::max(a, b)}; }

/// The link of two particles, kNone when they have none.
std::size_t find_link(const Links& links, std::uint32_t a, std::uint32_t b) {
  const Pair wanted = ordered(a, b);
  std::size_t low = 0, high = links.size();
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (Pair(links.first[middle], links.second[middle]) < wanted) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low < links.size() && Pair(links.first[low], links.second[low]) == wanted ? low : kNone;
}

/// Energy of a link, and its loads with A the smaller particle.
struct LinkLoad {
  double energy = 0.0;
  Vec3 force_b = Vec3::Zero();
  Vec3 torque_a = Vec3::Zero();
  Vec3 torque_b = Vec3::Zero();
};

bool exceeds(const BreakRule& rule, double rest_distance, const PairPose& pose, const LinkLoad& load) {
  const double d = pose.r.norm();
  if (d / rest_distance - 1.0 > rule.stretch || load.energy > rule.energy) return true;
  if (std::isinf(rule.force) && std::isinf(rule.couple)) return false;
  const double tension = std::max(0.0, -load.force_b.dot(pose.r) / d);
  const double couple = std::max(load.torque_a.norm(), load.torque_b.norm()) / rule.couple;
  return tension / rule.force + couple * couple > 1.0;
}

bool needs_loads(const LinkRule& rule) {
  return std::isfinite(rule.breaking.energy) || std::isfinite(rule.breaking.force) || std::isfinite(rule.breaking.couple);
}

/// A bond frame with its rest data as they are now.
BondFrame present_frame(const Links& links, const LinkState& state, std::size_t frame) {
  BondFrame law = links.frame[frame];
  law.rest_a = state.rest_a[frame];
  law.rest_b = state.rest_b[frame];
  law.rest_orientation_a = Quat::Identity();
  law.rest_orientation_b = state.turn[frame];
  return law;
}

/// Moves the rest data of one frame towards the present pose.
void flow(const PairPose& pose, double share, std::size_t frame, LinkState& state) {
  const Vec3 now_a = pose.orientation_a.conjugate() * pose.r;
  const Vec3 now_b = pose.orientation_b.conjugate() * -pose.r;
  state.rest_a[frame] += share * (now_a - state.rest_a[frame]);
  state.rest_b[frame] += share * (now_b - state.rest_b[frame]);
  const Quat now = pose.orientation_a.conjugate() * pose.orientation_b;
  Quat& turn = state.turn[frame];
  turn = (turn * rotation_exp(share * rotation_log(turn.conjugate() * now))).normalized();
}

/// Removes the pairs for which `gone` holds; `keep` moves the data that belong to the others.
void forget_pairs(std::vector<std::uint32_t>& first, std::vector<std::uint32_t>& second, const auto& gone, const auto& keep) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < first.size(); ++k) {
    if (gone(first[k], second[k])) continue;
    first[kept] = first[k];
    second[kept] = second[k];
    keep(kept, k);
    ++kept;
  }
  first.resize(kept);
  second.resize(kept);
}

/// All lists of geometric laws.
auto geometric_lists(auto& laws) {
  return std::tie(laws.geometric_cohesion, laws.geometric_linear_cohesion, laws.geometric_tabulated_cohesion,
                  laws.geometric_lennard_jones, laws.gay_berne, laws.geometric_coplanarity, laws.geometric_co_normality,
                  laws.geometric_co_circularity, laws.repulsion);
}

/// The same for the bonds of lists of laws.
void forget_laws(auto& lists, const auto& gone) {
  for (auto& list : lists) {
    auto& laws = list.law;
    forget_pairs(list.first, list.second, gone, [&laws](std::size_t to, std::size_t from) { laws[to] = laws[from]; });
    laws.erase(laws.begin() + static_cast<std::ptrdiff_t>(list.first.size()), laws.end());
  }
}

/// The same for all bonds and friction.
void forget_bonds(Interactions& interactions, const auto& gone) {
  std::apply([&gone](auto&... lists) { (forget_laws(lists, gone), ...); }, bonded_lists(interactions));
  for (Friction& friction : interactions.friction) {
    forget_pairs(friction.first, friction.second, gone, [](std::size_t, std::size_t) {});
  }
}

}  // namespace

bool BreakRule::ever() const noexcept {
  return std::isfinite(stretch) || std::isfinite(energy) || std::isfinite(force) || std::isfinite(couple);
}

void LinkState::save(StateWriter& out) const {
  out.write(std::span<const std::uint8_t>(broken));
  out.write(std::span<const Vec3>(rest_a));
  out.write(std::span<const Vec3>(rest_b));
  out.write(std::span<const Quat>(turn));
  out.write(released);
  out.write(flowed);
}

void LinkState::load(StateReader& in) {
  in.read(broken);
  in.read(rest_a);
  in.read(rest_b);
  in.read(turn);
  in.read(released);
  in.read(flowed);
}

void LinkState::hash(Hasher& hasher) const {
  for (const std::uint8_t flag : broken) hasher.add(std::uint64_t{flag});
  hasher.add(std::span<const Vec3>(rest_a));
  hasher.add(std::span<const Vec3>(rest_b));
  hasher.add(std::span<const Quat>(turn));
  hasher.add(released);
  hasher.add(flowed);
}

Links make_links(const ParticleSet& set, const ParticleState& rest, const Interactions& interactions,
                 std::span<const LinkRule> rules) {
  Links links;
  if (rules.empty()) return links;
  links.rules.assign(rules.begin(), rules.end());
  const auto rule_of = [&](std::uint32_t particle) {
    const auto found = std::find_if(rules.begin(), rules.end(),
                                    [&](const LinkRule& rule) { return rule.object == set.object[particle]; });
    return found == rules.end() ? kNone : static_cast<std::size_t>(found - rules.begin());
  };
  std::vector<Pair> pairs;
  for_each_bond(interactions, [&](const auto&, std::uint32_t a, std::uint32_t b) {
    SUPPLE_EXPECTS(a < set.size() && b < set.size());
    if (rule_of(a) == kNone && rule_of(b) == kNone) return;
    SUPPLE_EXPECTS(set.object[a] == set.object[b]);
    pairs.push_back(ordered(a, b));
  });
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  for (const auto& [a, b] : pairs) {
    links.first.push_back(a);
    links.second.push_back(b);
    links.rest_distance.push_back((rest.position[b] - rest.position[a]).norm());
    links.rule.push_back(static_cast<std::uint32_t>(rule_of(a)));
  }
  for (std::size_t list = 0; list < interactions.bond_frame.size(); ++list) {
    const BondedLaw<BondFrame>& law = interactions.bond_frame[list];
    for (std::size_t bond = 0; bond < law.law.size(); ++bond) {
      const std::size_t link = find_link(links, law.first[bond], law.second[bond]);
      if (link == kNone || std::isinf(rules[links.rule[link]].yield.energy)) continue;
      SUPPLE_EXPECTS(law.first[bond] < law.second[bond]);
      links.frame_link.push_back(static_cast<std::uint32_t>(link));
      links.frame_list.push_back(static_cast<std::uint32_t>(list));
      links.frame_bond.push_back(static_cast<std::uint32_t>(bond));
      links.frame.push_back(law.law[bond]);
    }
  }
  return links;
}

LinkState unbroken(const Links& links) {
  LinkState state;
  state.broken.assign(links.size(), 0);
  for (const BondFrame& law : links.frame) {
    state.rest_a.push_back(law.rest_a);
    state.rest_b.push_back(law.rest_b);
    state.turn.push_back(law.rest_orientation_a.conjugate() * law.rest_orientation_b);
  }
  return state;
}

LinkChange update_links(const LinkedParticles& linked, const Links& links, double dt, LinkState& links_state, Ledger& ledger,
                        std::span<const std::uint32_t> cut) {
  // Names for the lambda below, where clang 14 takes no structured bindings.
  const ParticleSet& set = linked.set;
  const ParticleState& state = linked.state;
  const Interactions& present = linked.present;
  SUPPLE_EXPECTS(links_state.broken.size() == links.size() && dt >= 0.0);
  LinkChange change;
  thread_local std::vector<LinkLoad> load;
  thread_local std::vector<std::size_t> breaking;
  load.assign(links.size(), {});
  breaking.clear();

  const auto add_loads = [&] {
    for_each_bond(present, [&](const auto& law, std::uint32_t a, std::uint32_t b) {
      const std::size_t link = find_link(links, a, b);
      if (link == kNone) return;
      const PairLoad one = evaluate(law, pair_pose(set, state, a, b));
      LinkLoad& sum = load[link];
      sum.energy += one.energy;
      sum.force_b += a < b ? one.force_b : Vec3(-one.force_b);
      sum.torque_a += a < b ? one.torque_a : one.torque_b;
      sum.torque_b += a < b ? one.torque_b : one.torque_a;
    });
  };
  const bool loads_decide = std::any_of(links.rules.begin(), links.rules.end(), needs_loads);
  if (loads_decide) add_loads();
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (links_state.broken[k] != 0) continue;
    const PairPose pose = pair_pose(set, state, links.first[k], links.second[k]);
    if (exceeds(links.rules[links.rule[k]].breaking, links.rest_distance[k], pose, load[k])) breaking.push_back(k);
  }
  for (const std::uint32_t k : cut) {
    SUPPLE_EXPECTS(k < links.size());
    if (links_state.broken[k] == 0) breaking.push_back(k);
  }
  std::sort(breaking.begin(), breaking.end());
  breaking.erase(std::unique(breaking.begin(), breaking.end()), breaking.end());
  if (!breaking.empty() && !loads_decide) add_loads();  // for the books
  for (const std::size_t k : breaking) {
    links_state.broken[k] = 1;
    links_state.released += load[k].energy;
    ledger.dissipated += load[k].energy;
    ++change.broke;
  }

  for (std::size_t frame = 0; frame < links.frame.size(); ++frame) {
    const std::uint32_t link = links.frame_link[frame];
    if (links_state.broken[link] != 0) continue;
    const YieldRule& rule = links.rules[links.rule[link]].yield;
    const PairPose pose = pair_pose(set, state, links.first[link], links.second[link]);
    const double before = evaluate(present_frame(links, links_state, frame), pose).energy;
    if (!(before > rule.energy)) continue;
    flow(pose, rule.time > 0.0 ? 1.0 - math::exp(-dt / rule.time) : 1.0, frame, links_state);
    const double after = evaluate(present_frame(links, links_state, frame), pose).energy;
    links_state.flowed += before - after;
    ledger.dissipated += before - after;
    ++change.yielded;
  }
  return change;
}

Interactions intact(const Interactions& interactions, const Links& links, const LinkState& state) {
  Interactions left = interactions;
  for (std::size_t frame = 0; frame < links.frame_link.size(); ++frame) {
    left.bond_frame[links.frame_list[frame]].law[links.frame_bond[frame]] = present_frame(links, state, frame);
  }
  if (std::find(state.broken.begin(), state.broken.end(), 1) == state.broken.end()) return left;
  forget_bonds(left, [&](std::uint32_t a, std::uint32_t b) {
    const std::size_t link = find_link(links, a, b);
    return link != kNone && state.broken[link] != 0;
  });
  return left;
}

Interactions without_resting(const ParticleSet& set, const Interactions& interactions,
                             std::span<const std::uint8_t> resting) {
  SUPPLE_EXPECTS(resting.size() == set.size());
  Interactions left = interactions;
  const auto both_rest = [&](std::uint32_t a, std::uint32_t b) { return resting[a] != 0 && resting[b] != 0; };
  forget_bonds(left, both_rest);
  forget_laws(left.literal_form, both_rest);
  std::vector<std::uint8_t> moves;  // by object: any of its particles
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (moves.size() <= set.object[i]) moves.resize(set.object[i] + 1, 0);
    if (resting[i] == 0) moves[set.object[i]] = 1;
  }
  const auto thin = [&](auto& laws) {
    std::erase_if(laws, [&](const auto& law) { return moves[law.object_a] == 0 && moves[law.object_b] == 0; });
  };
  std::apply([&thin](auto&... lists) { (thin(lists), ...); }, geometric_lists(left));
  return left;
}

std::vector<std::array<std::uint32_t, 2>> acting_objects(const Interactions& interactions) {
  std::vector<std::array<std::uint32_t, 2>> pairs;
  const auto add = [&pairs](const auto& laws) {
    for (const auto& law : laws) pairs.push_back({law.object_a, law.object_b});
  };
  std::apply([&add](const auto&... lists) { (add(lists), ...); }, geometric_lists(interactions));
  return pairs;
}

std::vector<std::uint32_t> find_pieces(const ParticleSet& set, const Links& links, const LinkState& state) {
  std::vector<std::uint32_t> piece(set.size());
  std::iota(piece.begin(), piece.end(), 0U);
  const auto root = [&piece](std::uint32_t i) {
    while (piece[i] != i) i = piece[i] = piece[piece[i]];
    return i;
  };
  // The smaller root wins, so that a piece is named by its smallest particle.
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    const std::uint32_t x = root(a), y = root(b);
    piece[std::max(x, y)] = std::min(x, y);
  };
  std::vector<std::uint32_t> breakable;  // objects
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (links.rules[links.rule[k]].breaking.ever() || links.rules[links.rule[k]].cut) breakable.push_back(set.object[links.first[k]]);
  }
  std::sort(breakable.begin(), breakable.end());
  for (std::uint32_t i = 1; i < set.size(); ++i) {
    if (set.object[i] != set.object[i - 1]) continue;
    if (!std::binary_search(breakable.begin(), breakable.end(), set.object[i])) join(i - 1, i);
  }
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (state.broken[k] == 0) join(links.first[k], links.second[k]);
  }
  for (std::uint32_t i = 0; i < set.size(); ++i) piece[i] = root(i);
  return piece;
}

}  // namespace supple::core
