#include "supple/core/links.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/support.h"

namespace supple::core {
namespace {

using test::Particles;

/// A chain of five particles on the x axis with bond frames, one object with a rule.
struct Chain {
  Particles p;
  Interactions laws;
  Links links;
  LinkState state;

  explicit Chain(const LinkRule& rule) {
    for (int i = 0; i < 5; ++i) p.add(Vec3(i, 0, 0));
    laws.bond_frame.push_back(test::bond_frames(p, 40.0, 0.5, 1));
    laws.friction.push_back({.name = "f", .first = {0, 1, 2, 3}, .second = {1, 2, 3, 4}, .linear = 0.3});
    const std::array rules{rule};
    links = make_links(p.set, p.state, laws, rules);
    state = unbroken(links);
  }
  LinkChange update(Ledger& ledger, double dt = 1e-3) {
    return update_links({p.set, p.state, intact(laws, links, state)}, links, dt, state, ledger);
  }
  [[nodiscard]] double energy() const {
    return potential_energy(p.set, p.state, intact(laws, links, state));
  }
};

TEST(Links, AreThePairsThatLawsJoin) {
  Particles p;
  for (int i = 0; i < 4; ++i) p.add(Vec3(i, 0, 0));
  p.set.object[3] = 1;
  Interactions laws;
  laws.cohesion.push_back({"c", {1, 0}, {2, 1}, {{.r0 = 1, .f0 = 1}, {.r0 = 1, .f0 = 1}}});
  laws.coplanarity.push_back({"p", {0, 0}, {1, 2}, {{.strength = 1, .weight = {}}, {.strength = 1, .weight = {}}}});
  const std::array rules{LinkRule{.object = 0, .breaking = {.stretch = 0.1}, .yield = {}}};
  const Links links = make_links(p.set, p.state, laws, rules);
  EXPECT_EQ(links.first, (std::vector<std::uint32_t>{0, 0, 1}));
  EXPECT_EQ(links.second, (std::vector<std::uint32_t>{1, 2, 2}));
  EXPECT_EQ(links.rest_distance, (std::vector<double>{1.0, 2.0, 1.0}));
  EXPECT_EQ(make_links(p.set, p.state, laws, {}).size(), 0u);
}

TEST(Breaking, ByStretchTakesAllLawsOfThePairAndBooksTheirEnergy) {
  Chain chain({.object = 0, .breaking = {.stretch = 0.2}, .yield = {}});
  Ledger ledger;
  chain.p.state.position[4] = Vec3(4.19, 0, 0);
  EXPECT_FALSE(chain.update(ledger).any());
  EXPECT_EQ(ledger.dissipated, 0.0);
  chain.p.state.position[4] = Vec3(4.21, 0, 0);
  const double before = chain.energy();
  EXPECT_EQ(chain.update(ledger).broke, 1u);
  // k_s / 4 (u^2 + u^2) with u = .21
  EXPECT_NEAR(chain.state.released, 0.5 * 40.0 * 0.21 * 0.21, 1e-12);
  EXPECT_NEAR(before - chain.energy(), ledger.dissipated, 1e-12);
  EXPECT_EQ(chain.energy(), 0.0);
  const Interactions left = intact(chain.laws, chain.links, chain.state);
  EXPECT_EQ(left.bond_frame[0].law.size(), chain.laws.bond_frame[0].law.size() - 1);
  EXPECT_EQ(left.friction[0].first, (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_FALSE(chain.update(ledger).any());
}

TEST(Breaking, ByEnergyHappensAtTheEnergy) {
  for (const double stretch : {0.0999, 0.1001}) {
    Chain chain({.object = 0, .breaking = {.energy = 0.5 * 40.0 * 0.01}, .yield = {}});
    chain.p.state.position[0].x() = -stretch;
    Ledger ledger;
    EXPECT_EQ(chain.update(ledger).broke, stretch > 0.1 ? 1u : 0u);
  }
}

TEST(Breaking, ByForceAndCoupleAddsUpAsInABeam) {
  // Tension 40 u; u = .05 gives F / F_c = .5. Turned by phi about its own axis: the couple is 2 k_theta sin phi.
  const double at_limit = std::asin(std::sqrt(0.5) * 0.4);
  for (const double turn : {0.99 * at_limit, 1.01 * at_limit}) {
    Chain chain({.object = 0, .breaking = {.force = 4.0, .couple = 0.4}, .yield = {}});
    chain.p.state.position[4].x() += 0.05;
    chain.p.state.orientation[4] = test::turn_about(Vec3::UnitX(), turn);
    Ledger ledger;
    EXPECT_EQ(chain.update(ledger).broke, turn > at_limit ? 1u : 0u) << turn;
  }
  // Compression does not break.
  Chain chain({.object = 0, .breaking = {.force = 1.0}, .yield = {}});
  chain.p.state.position[4].x() -= 0.5;
  Ledger ledger;
  EXPECT_FALSE(chain.update(ledger).any());
}

TEST(Breaking, OfCohesionReleasesTheWorkOfSeparation) {
  Particles p;
  p.add(Vec3::Zero());
  p.add(Vec3(1, 0, 0));
  Interactions laws;
  const Cohesion law{.r0 = 1.0, .f0 = 2.0, .a = 4.0};
  laws.cohesion.push_back({"c", {0}, {1}, {law}});
  const std::array rules{LinkRule{.object = 0, .breaking = {.stretch = 5.0}, .yield = {}}};
  const Links links = make_links(p.set, p.state, laws, rules);
  LinkState state = unbroken(links);
  p.state.position[1].x() = 6.1;
  Ledger ledger;
  EXPECT_EQ(update_links({p.set, p.state, laws}, links, 1e-3, state, ledger).broke, 1u);
  EXPECT_NEAR(ledger.dissipated, law.binding_energy(), 1e-10 * law.binding_energy());
}

TEST(Pieces, AreWhatUnbrokenLinksConnect) {
  Chain chain({.object = 0, .breaking = {.stretch = 0.2}, .yield = {}});
  chain.p.add(Vec3(0, 5, 0));
  chain.p.add(Vec3(1, 5, 0));
  chain.p.set.object[5] = chain.p.set.object[6] = 1;  // has no rule, so it stays one piece
  EXPECT_EQ(find_pieces(chain.p.set, chain.links, chain.state), (std::vector<std::uint32_t>{0, 0, 0, 0, 0, 5, 5}));
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    if (chain.links.first[k] <= 2 && chain.links.second[k] >= 3) chain.state.broken[k] = 1;
  }
  EXPECT_EQ(find_pieces(chain.p.set, chain.links, chain.state), (std::vector<std::uint32_t>{0, 0, 0, 3, 3, 5, 5}));
}

TEST(Pieces, OfAnObjectThatCannotBreakAreOne) {
  // Two bonds that do not connect: with a limit to break they are two bodies, without one body.
  Particles p;
  for (int i = 0; i < 4; ++i) p.add(Vec3(i, 0, 0));
  Interactions laws;
  laws.cohesion.push_back({"c", {0, 2}, {1, 3}, {{.r0 = 1, .f0 = 1}, {.r0 = 1, .f0 = 1}}});
  const auto pieces = [&](const LinkRule& rule, const Interactions& all) {
    const std::array rules{rule};
    const Links links = make_links(p.set, p.state, all, rules);
    return find_pieces(p.set, links, unbroken(links));
  };
  const LinkRule breaks{.object = 0, .breaking = {.stretch = 0.1}, .yield = {}};
  const LinkRule yields{.object = 0, .breaking = {}, .yield = {.energy = 1.0}};
  EXPECT_EQ(pieces(breaks, laws), (std::vector<std::uint32_t>{0, 0, 2, 2}));
  EXPECT_EQ(pieces(yields, laws), (std::vector<std::uint32_t>{0, 0, 0, 0}));
  EXPECT_EQ(pieces(breaks, {}), (std::vector<std::uint32_t>{0, 0, 0, 0}));  // nothing that could break
}

TEST(Yield, AtOnceMakesThePresentPoseTheRestPose) {
  Chain chain({.object = 0, .breaking = {}, .yield = {.energy = 0.01}});
  chain.p.state.position[4] = Vec3(4.2, 0.1, 0);
  chain.p.state.orientation[4] = test::turn_about(Vec3(1, 2, 3), 0.3);
  const double before = chain.energy();
  Ledger ledger;
  EXPECT_EQ(chain.update(ledger).yielded, 1u);
  EXPECT_NEAR(chain.energy(), 0.0, 1e-14);
  EXPECT_NEAR(ledger.dissipated, before, 1e-13);
  EXPECT_NEAR(chain.state.flowed, before, 1e-13);
  EXPECT_FALSE(chain.update(ledger).any());
}

TEST(Yield, RelaxesByItsTimeWhateverTheStep) {
  // The stretch u decays as exp(-t / time) while the energy is above the threshold; the particles are held.
  std::vector<double> left;
  for (const int steps : {10, 100}) {
    Chain chain({.object = 0, .breaking = {}, .yield = {.energy = 1e-9, .time = 0.5}});
    chain.p.state.position[4] = Vec3(4.2, 0, 0);
    Ledger ledger;
    for (int k = 0; k < steps; ++k) chain.update(ledger, 1.0 / steps);
    left.push_back(4.2 - 3.0 - chain.state.rest_a.back().x());
  }
  EXPECT_NEAR(left[0], 0.2 * std::exp(-2.0), 1e-14);
  EXPECT_NEAR(left[1], left[0], 1e-14);
}

TEST(Yield, LeavesAloneWhatIsBelowItsEnergy) {
  Chain chain({.object = 0, .breaking = {}, .yield = {.energy = 1.0}});
  chain.p.state.position[4] = Vec3(4.2, 0, 0);
  Ledger ledger;
  EXPECT_FALSE(chain.update(ledger).any());
  EXPECT_NEAR(chain.energy(), 0.5 * 40.0 * 0.04, 1e-12);
}

TEST(LinkState, IsReadBackAsItWasSaved) {
  Chain chain({.object = 0, .breaking = {.stretch = 0.2}, .yield = {.energy = 0.01, .time = 0.3}});
  chain.p.state.position[4] = Vec3(4.3, 0.1, 0);
  chain.p.state.position[1] = Vec3(1, 0.1, 0);
  Ledger ledger;
  EXPECT_TRUE(chain.update(ledger).any());
  StateWriter out;
  chain.state.save(out);
  LinkState back;
  StateReader in(out.bytes());
  back.load(in);
  EXPECT_TRUE(in.at_end());
  Hasher a, b, untouched;
  chain.state.hash(a);
  back.hash(b);
  unbroken(chain.links).hash(untouched);
  EXPECT_EQ(a.value(), b.value());
  EXPECT_NE(a.value(), untouched.value());
}

}  // namespace
}  // namespace supple::core
