/// @file supple/core/links.h
/// Breaking and plastic flow. A link is a pair of bonded particles with all laws between them, which break together.
/// LinkState records what broke or yielded; `intact` gives the remaining laws, so that all other code works on plain Interactions.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/integrate.h"
#include "supple/core/interactions.h"
#include "supple/core/particles.h"

namespace supple::core {

/// A link breaks when it exceeds any of these; infinity: never.
struct BreakRule {
  double stretch = std::numeric_limits<double>::infinity();  ///< d / d0 - 1 [1]
  double energy = std::numeric_limits<double>::infinity();   ///< of all its laws together [J]
  /// Beam-like bond: tension / force + (couple on a particle / couple)^2 > 1 (after Potyondy & Cundall 2004).
  double force = std::numeric_limits<double>::infinity();    ///< [N]
  double couple = std::numeric_limits<double>::infinity();   ///< [N m]
  [[nodiscard]] bool ever() const noexcept;                  ///< false: no limit is set
};

/// A bond frame whose energy exceeds `energy` takes over the present pose as its rest pose with relaxation time `time`:
/// d_A += (1 - exp(-dt / time)) (Q_A^T r - d_A), and the same for the relative rotation.
struct YieldRule {
  double energy = std::numeric_limits<double>::infinity();  ///< [J]
  double time = 0.0;                                        ///< [s]; 0: at once
};

/// The rule of one object.
struct LinkRule {
  std::uint32_t object = 0;
  BreakRule breaking;
  YieldRule yield;
  bool cut = false;  ///< its links may be named to `update_links`, also without limits
};

/// All links of the objects that have a rule, sorted by (first, second). Part of a Scene.
struct Links {
  std::vector<std::uint32_t> first;    ///< particle A, shape [links]
  std::vector<std::uint32_t> second;   ///< particle B, A < B, shape [links]
  std::vector<double> rest_distance;   ///< d0 [m], shape [links]
  std::vector<std::uint32_t> rule;     ///< into `rules`, shape [links]
  std::vector<LinkRule> rules;
  std::vector<BondFrame> frame;            ///< bond frames that may yield, in their initial form, shape [frames]
  std::vector<std::uint32_t> frame_link;   ///< their link
  std::vector<std::uint32_t> frame_list;   ///< where they are: Interactions::bond_frame[list].law[bond]
  std::vector<std::uint32_t> frame_bond;
  [[nodiscard]] std::size_t size() const noexcept { return first.size(); }
};

/// Part of State.
struct LinkState {
  std::vector<std::uint8_t> broken;   ///< shape [links]
  std::vector<Vec3> rest_a, rest_b;   ///< of the bond frames that may yield, shape [frames]
  std::vector<Quat> turn;             ///< Q_A0* Q_B0 of the same, shape [frames]
  double released = 0.0;              ///< energy of broken links [J]
  double flowed = 0.0;                ///< energy dissipated by plastic flow [J]
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// @pre bonds of the objects with a rule join particles of one object
[[nodiscard]] Links make_links(const ParticleSet& set, const ParticleState& rest, const Interactions& interactions,
                               std::span<const LinkRule> rules);
/// Nothing broken, rest data of the scene.
[[nodiscard]] LinkState unbroken(const Links& links);

/// Changes by `update_links`.
struct LinkChange {
  std::uint32_t broke = 0;
  std::uint32_t yielded = 0;
  [[nodiscard]] bool any() const noexcept { return broke + yielded > 0; }
};

/// Particles and the present interactions between them.
struct LinkedParticles {
  const ParticleSet& set;
  const ParticleState& state;
  const Interactions& present;  ///< what `intact` gives for the present state of the links; after a change it must be made again
};

/// Between two steps: breaks and yields links by their rules, `dt` after the last call. Their energy is booked as dissipated.
/// @param cut  links that break in any case
LinkChange update_links(const LinkedParticles& linked, const Links& links, double dt, LinkState& links_state, Ledger& ledger,
                        std::span<const std::uint32_t> cut = {});

/// The interactions without the bonds (and friction) of broken links, with the present rest data.
[[nodiscard]] Interactions intact(const Interactions& interactions, const Links& links, const LinkState& state);

/// The interactions without laws between resting particles: their bonds and friction, and geometric laws of
/// objects whose particles all rest. External loads stay. @param resting  1: rests, shape [particles]
[[nodiscard]] Interactions without_resting(const ParticleSet& set, const Interactions& interactions,
                                           std::span<const std::uint8_t> resting);

/// Every two objects, or one with itself, between whose particles a geometric law acts.
[[nodiscard]] std::vector<std::array<std::uint32_t, 2>> acting_objects(const Interactions& interactions);

/// The piece that each particle belongs to, named by its smallest particle: shape [particles]. Objects that cannot break
/// are one piece; the others fall into what unbroken links connect.
[[nodiscard]] std::vector<std::uint32_t> find_pieces(const ParticleSet& set, const Links& links, const LinkState& state);

}  // namespace supple::core
